//! What a committed replan keeps, on seeded random instances and on cases made to fail.
// A test may stop at the first surprise.
#![allow(missing_docs, clippy::unwrap_used, clippy::panic)]

mod fixture;
#[path = "fixture/instance.rs"]
mod instance;

use fleet_core::replan::{ReplanError, Replanner, Request, Solution};
use fleet_core::trajectory::{Knot, Trajectory};
use fleet_core::types::Vec3;
use fleet_core::wire::{Plan, ReplanOutcome, encode};
use instance::{GUST, Push, STORM};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

struct Case {
    plan: Plan,
    drone: String,
    request: Request,
    solution: Solution,
}

fn cases(seed: u64, push: Push, n: u64) -> Vec<Case> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let plans = instance::plans();
    let mut replanners = BTreeMap::new();
    (0..n)
        .map(|id| {
            let plan = &plans[id as usize % plans.len()];
            let (drone, request) = instance::draw(&mut rng, plan, push, id);
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
    let all = cases(7, GUST, 200);
    let solved = all.iter().filter(|c| c.solution.outcome == ReplanOutcome::Committed).count();
    for c in all.iter().filter(|c| c.solution.outcome != ReplanOutcome::Committed) {
        println!("{} {} {:?} {}", c.plan.scenario, c.drone, c.request.start, c.solution.reason);
    }
    assert!(solved >= 190, "{solved} of 200");
}

#[test]
fn committed_replans_keep_limits_and_clearance_at_dense_samples() {
    for case in cases(11, GUST, 60) {
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
            assert!(r.j.amax() <= 20.0 + 1e-3, "jerk {} at {t}", r.j.amax());
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
    for case in cases(13, STORM, 60) {
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
    for (a, b) in cases(17, STORM, 30).into_iter().zip(cases(17, STORM, 30)) {
        assert_eq!(encode(&a.solution).unwrap(), encode(&b.solution).unwrap());
    }
}

#[test]
fn only_committed_replans_carry_a_trajectory() {
    for case in cases(19, STORM, 100) {
        let committed = case.solution.outcome == ReplanOutcome::Committed;
        assert_eq!(case.solution.trajectory.is_some(), committed);
        assert_eq!(case.solution.t_rejoin.is_some(), committed);
        let first = case.solution.t_rejoin == case.request.rejoin.first().copied();
        assert_eq!(case.solution.reason.is_empty(), committed && first);
    }
}

#[test]
fn storms_never_lead_into_an_obstacle() {
    for case in cases(23, STORM, 200) {
        let Some(new) = &case.solution.trajectory else { continue };
        for t in times(new) {
            let r = new.sample(t);
            for name in &case.plan.obstacles {
                assert!(case.plan.region(name).unwrap().outside(&r.p) > 0.0, "{name} at {t}");
            }
        }
    }
}

/// `drone` of the crossing plan at `t`, off by `distance` [m] and `drift` [m/s] towards the other.
fn towards_the_other(plan: &Plan, drone: usize, t: f64, distance: f64, drift: f64) -> Request {
    let (own, other) = (&plan.drones[drone].trajectory, &plan.drones[1 - drone].trajectory);
    let (p, v, a) = own.motion(t);
    let direction = (other.position(t) - p).normalize();
    let start = Knot {
        t,
        p: p + direction * distance,
        v: v + direction * drift,
        a,
        psi: 0.0,
        psi_rate: 0.0,
        psi_acc: 0.0,
    };
    Request { id: 0, hash: String::new(), t_event: t, deviation: distance, start, rejoin: vec![15.0] }
}

#[test]
fn simultaneous_replans_of_both_drones_stay_apart() {
    // The fleet plan's own least distance is 5.04 m: delta_min plus two tubes, with nothing to spare.
    let mut plan = fixture::crossing();
    plan.limits.delta_min = 4.2;
    let mut replanners = ["d1", "d2"].map(|id| Replanner::new(&plan, id).unwrap());
    let (mut least, mut least_free, mut compared) = (f64::INFINITY, f64::INFINITY, 0);
    for k in 0..60 {
        // Neither splice is on the slots, and the two are not the same.
        let splices = [6.52 + 0.05 * f64::from(k), 6.61 + 0.05 * f64::from(k)];
        let [a, b] = [0, 1]
            .map(|i| replanners[i].solve(&towards_the_other(&plan, i, splices[i], 0.3, 0.4)).trajectory);
        // Half of the acceleration limit would do, but not on every grid with bounded jerk.
        let (Some(a), Some(b)) = (a, b) else { continue };
        compared += 1;
        for t in times(&a).filter(|t| *t >= b.start()) {
            least = least.min((a.position(t) - b.position(t)).norm());
        }
        // The same pushes when nothing keeps the drones apart.
        let mut alone = plan.clone();
        alone.limits.delta_min = 0.0;
        let [a, b] = [0, 1].map(|i| {
            let id = &plan.drones[i].id;
            let request = towards_the_other(&plan, i, splices[i], 0.3, 0.4);
            Replanner::new(&alone, id).unwrap().solve(&request).trajectory.unwrap()
        });
        for t in times(&a).filter(|t| *t >= b.start()) {
            least_free = least_free.min((a.position(t) - b.position(t)).norm());
        }
    }
    assert!(compared >= 55, "only {compared} of 60 pairs were solved");
    assert!(least >= 4.2 - 1e-6, "{least} m");
    assert!(least_free < 4.15, "the pushes would not have brought them near: {least_free} m");
}

#[test]
fn hopeless_requests_are_answered_with_reasons() {
    let plan = fixture::tower();
    let mut replanner = Replanner::new(&plan, "d1").unwrap();
    let (p, v, a) = plan.drones[0].trajectory.motion(10.0);
    let start = Knot { t: 10.0, p, v, a, psi: 0.0, psi_rate: 0.0, psi_acc: 0.0 };
    let good =
        Request { id: 5, hash: "h".into(), t_event: 9.9, deviation: 0.5, start, rejoin: vec![15.0, 20.0] };
    assert_eq!(replanner.solve(&good).outcome, ReplanOutcome::Committed);

    let mut broken = good.clone();
    broken.start.v.x = f64::NAN;
    let mut inside = good.clone();
    inside.start.p = Vec3::new(0.0, 0.0, 10.0);
    let mut far = good.clone();
    far.start.p += Vec3::new(0.0, 0.0, 4.0);
    far.rejoin = vec![10.8];
    let mut past = good.clone();
    past.rejoin = vec![5.0, 10.1, 40.0];
    let mut none = good.clone();
    none.rejoin.clear();
    for (request, outcome, tries) in [
        (&broken, ReplanOutcome::Refused, 1),
        (&inside, ReplanOutcome::Refused, 2),
        (&far, ReplanOutcome::Infeasible, 1),
        (&past, ReplanOutcome::Infeasible, 3),
        (&none, ReplanOutcome::Infeasible, 1),
    ] {
        let s = replanner.solve(request);
        assert_eq!((s.outcome, s.id, s.hash.as_str()), (outcome, 5, "h"), "{}", s.reason);
        assert!(s.trajectory.is_none() && s.t_rejoin.is_none());
        assert_eq!(s.reason.split("; ").count(), tries, "{}", s.reason);
    }
    // A hopeless first waypoint does not hide a good second one.
    far.rejoin.push(20.0);
    let s = replanner.solve(&far);
    assert_eq!((s.outcome, s.t_rejoin), (ReplanOutcome::Committed, Some(20.0)), "{}", s.reason);
}

#[test]
fn a_replanner_needs_its_drone_and_regions() {
    let mut plan = fixture::tower();
    assert_eq!(Replanner::new(&plan, "d9").unwrap_err(), ReplanError::UnknownDrone("d9".into()));
    plan.obstacles.push("tower2".into());
    assert_eq!(Replanner::new(&plan, "d1").unwrap_err(), ReplanError::UnknownRegion("tower2".into()));
}
