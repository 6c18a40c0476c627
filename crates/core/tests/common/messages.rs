//! One message of every kind and with every variant, in a fixed order.
//!
//! The `all_*` functions end in a match without a wildcard: a variant that is added to the wire does
//! not compile here until it is listed, and then the golden file and Python's types must follow.

use super::regions;
use fleet_core::formula::{Axis, Comparison, Formula, Term};
use fleet_core::trajectory::{Knot, Trajectory};
use fleet_core::types::{Limits, Nanos, Quat, Reference, ReplanParams, Setpoint, State, Vec3};
use fleet_core::wire::*;

pub fn envelope<T>(body: T) -> Envelope<T> {
    Envelope {
        schema: SCHEMA,
        mission_id: "00112233445566778899aabbccddeeff".to_owned(),
        epoch: 3,
        seq: 4,
        issued: Nanos(5_000_000_000),
        valid_until: Nanos(6_000_000_000),
        body,
    }
}

pub fn trajectory() -> Trajectory {
    let knot = |t: f64| Knot {
        t,
        p: Vec3::new(1.0 + t, -2.5, 3.0),
        v: Vec3::new(0.5, 0.0, -0.125),
        a: Vec3::zeros(),
        psi: 0.1 * t,
        psi_rate: 0.1,
        psi_acc: 0.0,
    };
    Trajectory::try_from(vec![knot(0.0), knot(2.5), knot(5.0)]).unwrap()
}

fn all_modes() -> Vec<Mode> {
    let modes = vec![
        Mode::Idle,
        Mode::Armed,
        Mode::Takeoff,
        Mode::Track,
        Mode::Replan,
        Mode::Hold,
        Mode::Return,
        Mode::Land,
        Mode::Abort,
        Mode::Released,
    ];
    modes.iter().for_each(|mode| match mode {
        Mode::Idle | Mode::Armed | Mode::Takeoff | Mode::Track | Mode::Replan => {}
        Mode::Hold | Mode::Return | Mode::Land | Mode::Abort | Mode::Released => {}
    });
    modes
}

fn all_codes() -> Vec<RejectCode> {
    use RejectCode::*;
    let codes = vec![
        Malformed,
        Expired,
        Stale,
        WrongMission,
        Hash,
        NotInPlan,
        WrongFleet,
        Limits,
        Clearance,
        Separation,
        Ends,
        Certificate,
        Mode,
        Preflight,
        StartTime,
        Peer,
        Autopilot,
    ];
    codes.iter().for_each(|code| match code {
        Malformed | Expired | Stale | WrongMission | Hash | NotInPlan | WrongFleet | Limits => {}
        Clearance | Separation | Ends | Certificate | Mode | Preflight | StartTime | Peer | Autopilot => {}
    });
    codes
}

fn all_outcomes() -> Vec<ReplanOutcome> {
    use ReplanOutcome::*;
    let outcomes = vec![Committed, Infeasible, Late, Refused];
    outcomes.iter().for_each(|outcome| match outcome {
        Committed | Infeasible | Late | Refused => {}
    });
    outcomes
}

fn all_events() -> Vec<EventKind> {
    let text = || "motor 2 is hot".to_owned();
    let events = vec![
        EventKind::Mode { from: Mode::Armed, to: Mode::Takeoff },
        EventKind::Plan { hash: "ab".repeat(32) },
        EventKind::Deviation { metres: 0.5 },
        EventKind::Link { lost: true },
        EventKind::StateStale { lost: false },
        EventKind::EstimatorReset { metres: 0.75 },
        EventKind::Autopilot { text: text() },
        EventKind::Landed,
        EventKind::Fault { text: text() },
    ];
    events.iter().for_each(|event| match event {
        EventKind::Mode { .. } | EventKind::Plan { .. } | EventKind::Deviation { .. } => {}
        EventKind::Link { .. } | EventKind::StateStale { .. } | EventKind::EstimatorReset { .. } => {}
        EventKind::Autopilot { .. } | EventKind::Landed | EventKind::Fault { .. } => {}
    });
    events
}

pub fn all_commands() -> Vec<Command> {
    let commands = vec![
        Command::Arm,
        Command::Start { t0: Nanos(20_000_000_000), hash: "ab".repeat(32) },
        Command::Hold,
        Command::Resume,
        Command::Return,
        Command::Land,
        Command::Abort,
        Command::Disarm,
    ];
    commands.iter().for_each(|command| match command {
        Command::Arm | Command::Start { .. } | Command::Hold | Command::Resume => {}
        Command::Return | Command::Land | Command::Abort | Command::Disarm => {}
    });
    commands
}

fn all_formulas() -> Vec<Formula> {
    let inside = || Formula::In { drone: "d1".to_owned(), region: "box".to_owned() };
    let boxed = || Box::new(inside());
    let dist = |cmp| Formula::Dist { a: "d1".to_owned(), b: "d2".to_owned(), cmp, value: 3.0 };
    let (from, to) = (0.0, 2.5);
    let formulas = vec![
        inside(),
        Formula::Outside { drone: "d2".to_owned(), region: "wedge".to_owned() },
        dist(Comparison::Ge),
        dist(Comparison::Le),
        Formula::Linear {
            terms: [Axis::X, Axis::Y, Axis::Z]
                .map(|axis| Term { drone: "d1".to_owned(), axis, coef: -1.5 })
                .to_vec(),
            constant: 0.25,
        },
        Formula::Not { f: boxed() },
        Formula::And { fs: vec![inside(), inside()] },
        Formula::Or { fs: vec![inside()] },
        Formula::Implies { left: boxed(), right: boxed() },
        Formula::Always { from, to, f: boxed() },
        Formula::Eventually { from, to, f: boxed() },
        Formula::Until { from, to, left: boxed(), right: boxed() },
        Formula::Once { from, to, f: boxed() },
        Formula::Historically { from, to, f: boxed() },
        Formula::Since { from, to, left: boxed(), right: boxed() },
    ];
    formulas.iter().for_each(|formula| match formula {
        Formula::In { .. } | Formula::Outside { .. } | Formula::Dist { .. } | Formula::Linear { .. } => {}
        Formula::Not { .. } | Formula::And { .. } | Formula::Or { .. } | Formula::Implies { .. } => {}
        Formula::Always { .. } | Formula::Eventually { .. } | Formula::Until { .. } => {}
        Formula::Historically { .. } | Formula::Once { .. } | Formula::Since { .. } => {}
    });
    formulas
}

pub fn all_plans() -> Vec<Plan> {
    use PlanStatus::*;
    let statuses = [Optimal, Certified, Violated];
    statuses.iter().for_each(|status| match status {
        Optimal | Certified | Violated => {}
    });
    statuses.into_iter().map(plan).collect()
}

fn plan(status: PlanStatus) -> Plan {
    let clauses = all_formulas().into_iter().enumerate().map(|(i, formula)| PlannedClause {
        id: format!("c{i}"),
        text: "d1 in box".to_owned(),
        kind: ["invariant", "event", "rest"][i % 3].to_owned(),
        drones: vec!["d1".to_owned()],
        weight: 1.0 + i as f64 / 2.0,
        priority: i as u32,
        formula,
        result: ClauseResult { rho: 1.0, rho_lower: 0.875, t_tightest: 2.5 },
    });
    let drone = |id: &str, psi| DronePlan {
        id: id.to_owned(),
        pad: Pad { p: Vec3::new(1.0, -2.5, 0.2), psi: 0.5 },
        home: format!("home.{id}"),
        trajectory: trajectory(),
        visits: vec![Visit { region: "box".to_owned(), t: 2.5, window: [0.0, 3.0], psi }],
        topics: vec![2.5, 5.0],
    };
    Plan {
        schema: SCHEMA,
        scenario: "hover".to_owned(),
        fleet: "fleet".to_owned(),
        seed: 1,
        horizon: 5.0,
        sample: 0.05,
        limits: Limits { v_max: 3.0, a_max: 3.0, psi_rate_max: 0.5, delta_min: 3.0, tube: 0.4 },
        replan: ReplanParams { t_e: 0.1, t_g: 5.0, eta: 0.4, enabled: true },
        regions: regions(),
        workspace: "box".to_owned(),
        obstacles: vec!["wedge".to_owned()],
        clauses: clauses.collect(),
        method: "convex".to_owned(),
        status,
        rho: 1.0,
        rho_lower: 0.875,
        rho_bound: 1.0,
        drones: vec![drone("d1", Some(1.5)), drone("d2", None)],
    }
}

pub fn all_down() -> Vec<Down> {
    let hash = "ab".repeat(32);
    let mut all = vec![
        Down::Offer(Offer { hash: hash.clone(), plan: vec![0, 1, 127, 128, 255] }),
        Down::Commit(Commit { hash }),
    ];
    all.extend(all_commands().into_iter().map(Down::Command));
    all.iter().for_each(|down| match down {
        Down::Offer(_) | Down::Commit(_) | Down::Command(_) => {}
    });
    all
}

pub fn all_up() -> Vec<Up> {
    let mut all: Vec<Up> = all_modes().into_iter().map(|mode| Up::Heartbeat(heartbeat(mode))).collect();
    all.extend([true, false].map(|known| Up::Telemetry(telemetry(known))));
    all.extend(all_events().into_iter().map(|kind| {
        Up::Event(Event {
            drone: "d1".to_owned(),
            mission_time: matches!(kind, EventKind::Deviation { .. }).then_some(12.5),
            kind,
            cause: "wind".to_owned(),
        })
    }));
    let rejected = all_codes()
        .into_iter()
        .map(|code| AckResult::Rejected { code, reason: "tie the drone down first".to_owned() });
    all.extend([AckResult::Accepted].into_iter().chain(rejected).map(|outcome| {
        Up::Ack(Ack { drone: "d1".to_owned(), of: "arm".to_owned(), epoch: 3, seq: 4, outcome })
    }));
    all.extend(all_outcomes().into_iter().map(|outcome| Up::Replan(replan(outcome))));
    all.iter().for_each(|up| match up {
        Up::Heartbeat(_) | Up::Telemetry(_) | Up::Event(_) | Up::Ack(_) | Up::Replan(_) => {}
    });
    all
}

fn heartbeat(mode: Mode) -> Heartbeat {
    let known = mode == Mode::Track;
    Heartbeat {
        drone: "d1".to_owned(),
        now: Nanos(7_000_000_000),
        mode,
        hash: if known { "ab".repeat(32) } else { String::new() },
        mission_time: known.then_some(12.5),
        armed: known,
        battery: known.then_some(0.75),
        state_age: known.then_some(0.01),
    }
}

fn telemetry(known: bool) -> Telemetry {
    let state = State {
        at: Nanos(7_000_000_000),
        p: Vec3::new(1.0, 2.0, 3.0),
        v: Vec3::new(0.5, 0.0, 0.0),
        q: Quat::identity(),
        w: Vec3::zeros(),
    };
    Telemetry {
        drone: "d1".to_owned(),
        mode: Mode::Track,
        mission_time: known.then_some(12.5),
        state: known.then_some(state),
        reference: known.then(|| Reference::rest(Vec3::new(1.0, 2.0, 3.0), 0.25)),
        setpoint: known.then(|| Setpoint { rates: Vec3::zeros(), thrust: 0.5 }),
        deviation: known.then_some(0.0625),
        hover_thrust: 0.5,
        replans: 2,
        next_topic: known.then_some(15.0),
        next_region: known.then(|| "box".to_owned()),
    }
}

fn replan(outcome: ReplanOutcome) -> ReplanNotice {
    let committed = outcome == ReplanOutcome::Committed;
    ReplanNotice {
        drone: "d1".to_owned(),
        outcome,
        t_event: 12.5,
        deviation: 0.5,
        t_splice: committed.then_some(12.75),
        t_rejoin: committed.then_some(15.0),
        trajectory: committed.then(trajectory),
    }
}

pub fn all_status() -> Vec<Status> {
    let status = |t0, preflight: &[&str]| Status {
        drone: "d1".to_owned(),
        mode: Mode::Idle,
        mission_id: "00112233445566778899aabbccddeeff".to_owned(),
        epoch: 3,
        seq: 4,
        hash: "ab".repeat(32),
        t0,
        preflight: preflight.iter().map(|s| (*s).to_owned()).collect(),
    };
    vec![status(None, &["no position: wait for GPS"]), status(Some(Nanos(9)), &[])]
}
