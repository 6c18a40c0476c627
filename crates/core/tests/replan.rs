//! What a committed replan keeps, on seeded random instances and on cases made to fail.
// A test may stop at the first surprise.
#![allow(missing_docs, clippy::unwrap_used)]

mod fixture;
#[path = "fixture/instance.rs"]
mod instance;

use fleet_core::replan::{Replanner, Request, Solution};
use fleet_core::trajectory::Trajectory;
use fleet_core::wire::{Plan, ReplanOutcome, encode};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

struct Case {
    plan: Plan,
    drone: String,
    request: Request,
    solution: Solution,
}

fn cases(seed: u64, n: u64) -> Vec<Case> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let plans = instance::plans();
    let mut replanners = BTreeMap::new();
    (0..n)
        .map(|id| {
            let plan = &plans[id as usize % plans.len()];
            let (drone, request) = instance::draw(&mut rng, plan, id);
            let key = (plan.scenario.clone(), drone.clone());
            let replanner = replanners.entry(key).or_insert_with(|| Replanner::new(plan, &drone).unwrap());
            let solution = replanner.solve(&request);
            Case { plan: plan.clone(), drone, request, solution }
        })
        .collect()
}

/// Samples of a trajectory, 5 ms apart.
fn times(trajectory: &Trajectory) -> impl Iterator<Item = f64> + '_ {
    let n = ((trajectory.end() - trajectory.start()) / 0.005).ceil() as u32;
    (0..=n).map(move |k| {
        trajectory.start() + (trajectory.end() - trajectory.start()) * f64::from(k) / f64::from(n)
    })
}

#[test]
fn most_random_replans_are_committed() {
    let all = cases(7, 200);
    let solved = all.iter().filter(|c| c.solution.outcome == ReplanOutcome::Committed).count();
    for c in all.iter().filter(|c| c.solution.outcome != ReplanOutcome::Committed) {
        println!("{} {} {:?} {}", c.plan.scenario, c.drone, c.request.start, c.solution.reason);
    }
    assert!(solved >= 190, "{solved} of 200");
}

#[test]
fn committed_replans_keep_limits_and_clearance_at_dense_samples() {
    for case in cases(11, 60) {
        let Some(new) = &case.solution.trajectory else { continue };
        let (plan, start) = (&case.plan, &case.request.start);
        let workspace = plan.region(&plan.workspace).unwrap();
        let peers = plan.drones.iter().filter(|d| d.id != case.drone);
        for t in times(new) {
            let r = new.sample(t);
            // What the start was beyond a limit may fade; the rest of the replan is strict.
            let fading = t < start.t + 2.0;
            let (extra_v, extra_a) = if fading {
                ((start.v.amax() - 3.0).max(0.0) + 0.5, (start.a.amax() - 3.0).max(0.0))
            } else {
                (0.0, 0.0)
            };
            assert!(r.v.amax() <= 3.0 + extra_v + 1e-6, "speed {} at {t}", r.v.amax());
            assert!(r.a.amax() <= 3.0 + extra_a + 1e-6, "acceleration {} at {t}", r.a.amax());
            for name in &plan.obstacles {
                assert!(plan.region(name).unwrap().outside(&r.p) > 0.0, "{name} at {t}");
            }
            assert!(workspace.inside(&r.p) >= if fading { -0.9 } else { -1e-6 }, "fence at {t}");
            for peer in peers.clone() {
                let distance = (r.p - peer.trajectory.position(t)).norm();
                assert!(distance >= 3.0 - if fading { 0.9 } else { 1e-6 }, "{distance} m at {t}");
            }
        }
    }
}

#[test]
fn replans_join_state_and_plan_without_a_jump() {
    for case in cases(13, 60) {
        let Some(new) = &case.solution.trajectory else { continue };
        let (start, end) = (&case.request.start, case.solution.t_rejoin.unwrap());
        let first = new.knots()[0];
        assert_eq!((first.t, first.p, first.v, first.a), (start.t, start.p, start.v, start.a));
        let turn = (first.psi - start.psi) / std::f64::consts::TAU;
        assert!((turn - turn.round()).abs() < 1e-9);
        assert_eq!(new.end(), end);
        let plan = &case.plan.drone(&case.drone).unwrap().trajectory;
        let (p, v, a) = plan.motion(end);
        let last = new.knots()[new.segments()];
        assert!((last.p - p).amax() < 1e-8 && (last.v - v).amax() < 1e-8 && (last.a - a).amax() < 1e-8);
        let r = plan.sample(end);
        assert!((last.psi - r.psi).abs() < 1e-9 && (last.psi_rate - r.psi_rate).abs() < 1e-9);
    }
}

#[test]
fn the_same_request_gives_the_same_bytes() {
    for (a, b) in cases(17, 30).into_iter().zip(cases(17, 30)) {
        assert_eq!(encode(&a.solution).unwrap(), encode(&b.solution).unwrap());
    }
}

#[test]
fn only_committed_replans_carry_a_trajectory() {
    for case in cases(19, 100) {
        let committed = case.solution.outcome == ReplanOutcome::Committed;
        assert_eq!(case.solution.trajectory.is_some(), committed);
        assert_eq!(case.solution.t_rejoin.is_some(), committed);
        let first = case.solution.t_rejoin == case.request.rejoin.first().copied();
        assert_eq!(case.solution.reason.is_empty(), committed && first);
    }
}
