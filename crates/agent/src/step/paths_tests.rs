use super::*;
use fleet_core::trajectory::Knot;

fn knot(t: f64, p: [f64; 3], v: [f64; 3]) -> Knot {
    Knot { t, p: p.into(), v: v.into(), a: Vec3::zeros(), psi: 0.1 * t, psi_rate: 0.1, psi_acc: 0.0 }
}

fn curve() -> Trajectory {
    let knots = vec![
        knot(0.0, [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]),
        knot(4.0, [3.0, 1.0, 2.0], [2.0, 0.5, 0.0]),
        knot(8.0, [9.0, 0.0, 2.0], [0.0, 0.0, 0.0]),
    ];
    Trajectory::try_from(knots).expect("legal")
}

/// Velocity, acceleration and jerk must be the derivatives of what stands before them.
fn consistent(sample: impl Fn(f64) -> Reference, times: &[f64]) {
    let h = 1e-4;
    for &t in times {
        let (a, b, m) = (sample(t - h), sample(t + h), sample(t));
        assert!(((b.p - a.p) / (2.0 * h) - m.v).norm() < 1e-5, "velocity at {t}");
        assert!(((b.v - a.v) / (2.0 * h) - m.a).norm() < 1e-5, "acceleration at {t}");
        assert!(((b.a - a.a) / (2.0 * h) - m.j).norm() < 1e-4, "jerk at {t}");
        assert!(((b.psi - a.psi) / (2.0 * h) - m.psi_rate).abs() < 1e-5, "heading at {t}");
    }
}

#[test]
fn derivatives_agree() {
    let from = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(2.0, -1.0, 0.5), Vec3::new(0.3, 0.0, -0.2));
    let to = (Vec3::new(2.0, 2.0, 1.0), Vec3::new(0.0, 0.0, -0.7), Vec3::zeros());
    let leg = Leg::new(Nanos(0), 3.0, from, to, [0.0, 1.0]);
    consistent(|t| leg.sample(Nanos::from_seconds(t)), &[0.5, 1.5, 2.9, 3.5, 6.0]);
    let plan = curve();
    let slow = Slowdown::new(3.0, &plan.sample(3.0).v, 3.0);
    consistent(|t| slow.sample(t, |u| plan.sample(u)), &[3.1, 3.5, 3.7, 6.0]);
}

#[test]
fn a_slowdown_begins_smoothly_and_ends_at_rest_on_the_path() {
    let plan = curve();
    let slow = Slowdown::new(5.0, &plan.sample(5.0).v, 3.0);
    let (before, after) = (plan.sample(5.0), slow.sample(5.0, |t| plan.sample(t)));
    assert!((before.v - after.v).norm() < 1e-9 && (before.a - after.a).norm() < 1e-9);
    let rest = slow.sample(9.0, |t| plan.sample(t));
    assert!(rest.v.norm() < 1e-12 && rest.a.norm() < 1e-12);
    let nearest = (0..8000).map(|k| (plan.position(f64::from(k) * 1e-3) - rest.p).norm());
    assert!(nearest.fold(f64::INFINITY, f64::min) < 2e-3);
}

#[test]
fn brakes_and_rests_keep_their_limits() {
    let from = (Vec3::zeros(), Vec3::new(3.0, -3.0, 1.0), Vec3::zeros());
    let leg = Leg::brake(Nanos(0), from, 0.3, 2.0);
    let climb = rest_time(8.0, 2.0, 2.0);
    let up = Leg::between(Nanos(0), climb, Vec3::zeros(), Vec3::new(0.0, 0.0, 8.0), [0.0, 0.0]);
    for k in 0..500 {
        let now = Nanos(k * 20_000_000);
        assert!(leg.sample(now).a.amax() <= 2.0 + 1e-9);
        assert!(up.sample(now).v.amax() <= 2.0 + 1e-9 && up.sample(now).a.amax() <= 2.0 + 1e-9);
    }
    assert!(leg.sample(leg.end()).v.norm() < 1e-9);
    assert_eq!(leg.goal(), leg.sample(leg.end().plus(3.0)).p);
}

#[test]
fn a_splice_replaces_the_plan_from_its_start_to_its_end() {
    let knots = vec![knot(2.0, [7.0; 3], [0.0; 3]), knot(4.0, [7.0; 3], [0.0; 3])];
    let piece = Trajectory::try_from(knots).expect("legal");
    let mut committed = Committed { local: Some(piece), ..Committed::new(curve()) };
    assert_eq!(committed.sample(1.99).p, curve().sample(1.99).p);
    assert_eq!(committed.sample(2.5).p.x, 7.0);
    assert_eq!(committed.sample(4.1).p, curve().sample(4.1).p);
    committed.advance(3.9);
    assert!(committed.local.is_some());
    committed.advance(4.0);
    assert_eq!(committed.local, None);
}
