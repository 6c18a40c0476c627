//! Small plans for flights: one target, out and back in 20 s.

use fleet_core::formula::Formula;
use fleet_core::geometry::Polyhedron;
use fleet_core::trajectory::{Knot, Trajectory};
use fleet_core::types::{Limits, ReplanParams, Vec3};
use fleet_core::wire::{
    ClauseResult, DronePlan, Pad, Plan, PlanStatus, PlannedClause, Region, SCHEMA, Visit,
};

/// Drones with their pads.
pub fn plan(drones: &[(&str, Vec3)]) -> Plan {
    let space = Polyhedron::from_box(Vec3::new(-20.0, -20.0, 0.0), Vec3::new(20.0, 20.0, 15.0)).expect("box");
    let target = Polyhedron::from_box(Vec3::new(4.0, -1.0, 4.0), Vec3::new(6.0, 1.0, 6.0)).expect("box");
    Plan {
        schema: SCHEMA,
        scenario: "rig".into(),
        fleet: "fleet".into(),
        seed: 1,
        horizon: 20.0,
        sample: 0.05,
        limits: Limits { v_max: 3.0, a_max: 3.0, psi_rate_max: 0.5, delta_min: 3.0, tube: 0.4 },
        replan: ReplanParams { t_e: 0.1, t_g: 5.0, eta: 0.4, enabled: true },
        regions: vec![
            Region { name: "workspace".into(), shape: space },
            Region { name: "tr1".into(), shape: target },
            Region {
                name: "home".into(),
                shape: Polyhedron::from_box(Vec3::new(-20.0, -20.0, 0.0), Vec3::new(20.0, 20.0, 3.0))
                    .expect("box"),
            },
        ],
        workspace: "workspace".into(),
        obstacles: Vec::new(),
        clauses: vec![visit_clause()],
        method: "by hand".into(),
        status: PlanStatus::Certified,
        rho: 0.5,
        rho_lower: 0.5,
        rho_bound: 1.0,
        drones: drones.iter().map(|(id, pad)| drone_plan(id, *pad)).collect(),
    }
}

fn visit_clause() -> PlannedClause {
    let visit = Formula::In { drone: "d1".into(), region: "tr1".into() };
    PlannedClause {
        id: "tr1".into(),
        text: "eventually[0,15] d1 in tr1".into(),
        kind: "event".into(),
        drones: vec!["d1".into()],
        weight: 1.0,
        priority: 0,
        formula: Formula::Eventually { from: 0.0, to: 15.0, f: Box::new(visit) },
        result: ClauseResult { rho: 0.5, rho_lower: 0.5, t_tightest: 10.0 },
    }
}

fn drone_plan(id: &str, pad: Vec3) -> DronePlan {
    let home = pad + Vec3::new(0.0, 0.0, 1.0);
    let knot =
        |t: f64, p: Vec3, v: Vec3| Knot { t, p, v, a: Vec3::zeros(), psi: 0.0, psi_rate: 0.0, psi_acc: 0.0 };
    let rest = Vec3::zeros();
    let knots = vec![
        knot(0.0, home, rest),
        knot(5.0, home + Vec3::new(3.0, 0.0, 2.0), Vec3::new(1.0, 0.0, 0.5)),
        knot(10.0, home + Vec3::new(5.0, 1.0, 4.0), rest),
        knot(15.0, home + Vec3::new(3.0, 0.0, 2.0), Vec3::new(-1.0, 0.0, -0.5)),
        knot(20.0, home, rest),
    ];
    DronePlan {
        id: id.into(),
        pad: Pad { p: pad, psi: 0.0 },
        home: "home".into(),
        trajectory: Trajectory::try_from(knots).expect("legal"),
        visits: vec![Visit { region: "tr1".into(), t: 10.0, window: [0.0, 15.0], psi: None }],
        topics: vec![5.0, 10.0, 15.0],
    }
}
