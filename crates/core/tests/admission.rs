//! Plans that must be refused, one change each, and plans that must not.
// A test may stop at the first surprise.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic)]

mod fixture;

use fleet_core::admission::{VehicleLimits, admit};
use fleet_core::trajectory::{Knot, Trajectory};
use fleet_core::types::Vec3;
use fleet_core::wire::{Plan, PlanStatus, RejectCode};

const VEHICLE: VehicleLimits = VehicleLimits { v_max: 5.0, a_max: 4.0, psi_rate_max: 0.8 };

fn verdict(plan: &Plan) -> Result<(), (RejectCode, String)> {
    admit(plan, "d1", "fleet", &VEHICLE)
}

/// The code and the reason after `change` to the crossing plan.
fn refused(change: impl FnOnce(&mut Plan)) -> (RejectCode, String) {
    let mut plan = fixture::crossing();
    change(&mut plan);
    verdict(&plan).unwrap_err()
}

/// Changes the knots of one drone.
fn with_knots(plan: &mut Plan, drone: usize, change: impl FnOnce(&mut Vec<Knot>)) {
    let mut knots = plan.drones[drone].trajectory.knots().to_vec();
    change(&mut knots);
    plan.drones[drone].trajectory = Trajectory::try_from(knots).unwrap();
}

#[test]
fn admits_what_is_sound() {
    for plan in [fixture::tower(), fixture::crossing()] {
        assert_eq!(verdict(&plan), Ok(()));
    }
}

type Change = fn(&mut Plan);

#[test]
fn malformed() {
    let changes: [(&str, Change); 10] = [
        ("schema", |p| p.schema = 2),
        ("stands twice", |p| p.drones[1].id = "d1".into()),
        ("drones", |p| p.drones.clear()),
        ("horizon", |p| p.sample = 0.0),
        ("replan", |p| p.replan.eta = 0.0),
        ("covers", |p| p.horizon = 40.0),
        ("topics", |p| p.drones[0].topics.swap(0, 1)),
        ("topics", |p| p.drones[0].topics.push(99.0)),
        ("visit", |p| p.drones[0].visits[0].window = [1.0, 2.0]),
        ("tower2", |p| p.obstacles.push("tower2".into())),
    ];
    for (word, change) in changes {
        let (code, reason) = refused(change);
        assert_eq!(code, RejectCode::Malformed, "{reason}");
        assert!(reason.contains(word), "{reason:?} does not name {word}");
    }
}

#[test]
fn wrong_fleet() {
    assert_eq!(refused(|p| p.fleet = "other".into()).0, RejectCode::WrongFleet);
}

#[test]
fn not_in_plan() {
    let (code, _) = admit(&fixture::tower(), "d9", "fleet", &VEHICLE).unwrap_err();
    assert_eq!(code, RejectCode::NotInPlan);
}

#[test]
fn limits_above_the_vehicle() {
    for change in [
        (|p: &mut Plan| p.limits.v_max = 5.1) as Change,
        |p| p.limits.a_max = 4.1,
        |p| p.limits.psi_rate_max = 0.9,
        |p| p.limits.a_max = 0.0,
        |p| p.limits.tube = -0.1,
    ] {
        assert_eq!(refused(change).0, RejectCode::Limits);
    }
}

#[test]
fn trajectory_above_the_limits() {
    // Velocity and acceleration peak between knots: only a continuous bound sees them.
    for change in [
        (|p: &mut Plan| p.limits.v_max = 2.0) as Change,
        |p| p.limits.a_max = 1.0,
        |p| p.limits.psi_rate_max = 0.1,
    ] {
        let (code, reason) = refused(change);
        assert_eq!(code, RejectCode::Limits);
        assert!(reason.contains("segment"), "{reason}");
    }
}

#[test]
fn enters_an_obstacle_or_leaves_the_workspace() {
    let (code, reason) = refused(|p| with_knots(p, 0, |k| k[2].p.z = 8.0));
    assert_eq!(code, RejectCode::Clearance, "{reason}");
    let (code, reason) = refused(|p| with_knots(p, 0, |k| k[3].p.y = 9.2));
    assert_eq!(code, RejectCode::Clearance, "{reason}");
    assert!(reason.contains("workspace"), "{reason}");
}

#[test]
fn comes_too_close() {
    // A level below, d1 passes d2 at under 3 m.
    let (code, reason) = refused(|p| {
        with_knots(p, 1, |knots| knots.iter_mut().filter(|k| k.p.z > 14.0).for_each(|k| k.p.z -= 2.9));
    });
    assert_eq!(code, RejectCode::Separation, "{reason}");
    let (code, reason) = refused(|p| p.limits.delta_min = 5.5);
    assert_eq!(code, RejectCode::Separation, "{reason}");
}

#[test]
fn ends_in_motion_or_elsewhere() {
    let changes: [Change; 6] = [
        |p| with_knots(p, 0, |k| k[0].v.z = 0.1),
        |p| with_knots(p, 1, |k| k.last_mut().unwrap().a.x = 0.1),
        |p| with_knots(p, 0, |k| k.last_mut().unwrap().psi_rate = 0.1),
        |p| p.drones[0].pad.p += Vec3::new(0.4, 0.0, 0.0),
        |p| p.drones[0].pad.p.z = 5.0,
        |p| with_knots(p, 0, |k| k.last_mut().unwrap().p.x += 1.5),
    ];
    for change in changes {
        let (code, reason) = refused(change);
        assert_eq!(code, RejectCode::Ends, "{reason}");
    }
}

#[test]
fn certificate_missing_or_negative() {
    let changes: [Change; 5] = [
        |p| p.status = PlanStatus::Violated,
        |p| p.clauses.clear(),
        |p| p.clauses[0].result.rho_lower = 0.0,
        |p| p.clauses[0].result.rho = 0.3,
        |p| p.rho_lower = 0.45,
    ];
    for change in changes {
        let (code, reason) = refused(change);
        assert_eq!(code, RejectCode::Certificate, "{reason}");
    }
}

#[test]
fn a_number_that_is_not_one_is_refused() {
    for change in [
        (|p: &mut Plan| p.limits.v_max = f64::NAN) as Change,
        |p| p.horizon = f64::NAN,
        |p| p.limits.delta_min = f64::NAN,
        |p| p.rho_lower = f64::NAN,
        |p| p.clauses[0].result.rho = f64::NAN,
    ] {
        refused(change);
    }
}
