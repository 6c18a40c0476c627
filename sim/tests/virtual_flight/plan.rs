//! A small plan made by hand, with its certificate computed by the core.

use fleet_core::formula::bound::lower_bound;
use fleet_core::formula::exact::evaluate;
use fleet_core::formula::{Comparison, Formula, Names, compile};
use fleet_core::geometry::Polyhedron;
use fleet_core::trajectory::{Knot, Trajectory};
use fleet_core::types::{Limits, ReplanParams, Vec3};
use fleet_core::wire::{
    ClauseResult, DronePlan, Pad, Plan, PlanStatus, PlannedClause, Region, SCHEMA, Visit,
};

pub const HORIZON: f64 = 20.0;
const SAMPLE: f64 = 0.05;
const PADS: [(&str, Vec3); 2] = [("d1", Vec3::new(0.0, 0.0, 0.2)), ("d2", Vec3::new(8.0, 0.0, 0.2))];

/// Two drones, 8 m apart, out to a target each and back, side by side.
pub fn plan() -> Plan {
    let mut regions = vec![region("workspace", Vec3::new(-5.0, -6.0, -0.5), Vec3::new(13.0, 12.0, 12.0))];
    let mut drones = Vec::new();
    for (id, pad) in PADS {
        let out = pad + Vec3::new(0.5, 6.0, 6.0);
        let home = pad + Vec3::new(0.0, 0.0, 1.2);
        let side = Vec3::new(1.0, 1.0, 1.0);
        regions.push(region(&format!("home_{id}"), home - side, home + side));
        regions.push(region(&format!("target_{id}"), out - side, out + side));
        drones.push(drone(id, pad, home, out));
    }
    let mut plan = Plan {
        schema: SCHEMA,
        scenario: "by_hand".into(),
        fleet: "fleet".into(),
        seed: 3,
        horizon: HORIZON,
        sample: SAMPLE,
        limits: Limits { v_max: 3.0, a_max: 2.0, psi_rate_max: 0.5, delta_min: 3.0, tube: 0.4 },
        replan: ReplanParams { t_e: 0.1, t_g: 5.0, eta: 0.4, enabled: true },
        regions,
        workspace: "workspace".into(),
        obstacles: Vec::new(),
        clauses: Vec::new(),
        method: "by hand".into(),
        status: PlanStatus::Certified,
        rho: 0.0,
        rho_lower: 0.0,
        rho_bound: 1.0,
        drones,
    };
    certify(&mut plan);
    plan
}

/// Positions of all drones at the samples of [0, T], to the least robustness of all clauses.
pub fn judge(plan: &Plan, tracks: &[Vec<Vec3>]) -> f64 {
    let names = names(plan);
    let value =
        |c: &PlannedClause| evaluate(&compile(&c.formula, &names, plan.sample).unwrap(), tracks).unwrap().rho;
    plan.clauses.iter().map(value).fold(f64::INFINITY, f64::min)
}

fn region(name: &str, low: Vec3, high: Vec3) -> Region {
    Region { name: name.into(), shape: Polyhedron::from_box(low, high).unwrap() }
}

fn drone(id: &str, pad: Vec3, home: Vec3, out: Vec3) -> DronePlan {
    let knot =
        |t, p, psi| Knot { t, p, v: Vec3::zeros(), a: Vec3::zeros(), psi, psi_rate: 0.0, psi_acc: 0.0 };
    let knots = vec![
        knot(0.0, home, 0.0),
        knot(8.0, out, 1.0),
        knot(10.0, out, 1.0),
        knot(18.0, home, 0.0),
        knot(20.0, home, 0.0),
    ];
    DronePlan {
        id: id.into(),
        pad: Pad { p: pad, psi: 0.0 },
        home: format!("home_{id}"),
        trajectory: Trajectory::try_from(knots).unwrap(),
        visits: vec![Visit { region: format!("target_{id}"), t: 9.0, window: [0.0, 12.0], psi: None }],
        topics: vec![5.0, 9.0, 10.0, 15.0, 20.0],
    }
}

fn names(plan: &Plan) -> Names {
    Names::new(plan.drones.iter().map(|d| d.id.clone()).collect(), plan.regions.clone()).unwrap()
}

fn certify(plan: &mut Plan) {
    let always = |f| Formula::Always { from: 0.0, to: HORIZON, f: Box::new(f) };
    let inside = |drone: &str, region: &str| Formula::In { drone: drone.into(), region: region.into() };
    let mut formulas = vec![(
        "apart".to_owned(),
        always(Formula::Dist { a: "d1".into(), b: "d2".into(), cmp: Comparison::Ge, value: 3.0 }),
    )];
    for (id, _) in PADS {
        formulas.push((format!("safe_{id}"), always(inside(id, "workspace"))));
        let visit = inside(id, &format!("target_{id}"));
        formulas
            .push((format!("visit_{id}"), Formula::Eventually { from: 0.0, to: 12.0, f: Box::new(visit) }));
    }
    let names = names(plan);
    let trajectories: Vec<&Trajectory> = plan.drones.iter().map(|d| &d.trajectory).collect();
    let samples = (HORIZON / SAMPLE).round() as usize;
    let tracks: Vec<Vec<Vec3>> =
        trajectories.iter().map(|t| (0..=samples).map(|k| t.position(k as f64 * SAMPLE)).collect()).collect();
    let mut clauses = Vec::new();
    for (id, formula) in formulas {
        let compiled = compile(&formula, &names, SAMPLE).unwrap();
        let exact = evaluate(&compiled, &tracks).unwrap();
        let bound = lower_bound(&compiled, &trajectories).unwrap();
        clauses.push(PlannedClause {
            id,
            text: "by hand".into(),
            kind: "invariant".into(),
            drones: PADS.map(|(id, _)| id.to_owned()).to_vec(),
            weight: 1.0,
            priority: 0,
            formula,
            result: ClauseResult {
                rho: exact.rho,
                rho_lower: bound.rho.min(exact.rho),
                t_tightest: exact.at as f64 * SAMPLE,
            },
        });
    }
    let least = |value: fn(&ClauseResult) -> f64| {
        clauses.iter().map(|c| value(&c.result)).fold(f64::INFINITY, f64::min)
    };
    plan.rho = least(|r| r.rho);
    plan.rho_lower = least(|r| r.rho_lower);
    plan.clauses = clauses;
}
