use super::*;
use crate::types::Nanos;
use proptest::prelude::*;

const HOVER: f64 = 0.42;

fn hovering(q: Quat) -> State {
    State { at: Nanos(0), p: Vec3::new(1.0, 2.0, 3.0), v: Vec3::zeros(), q, w: Vec3::zeros() }
}

fn update(state: &State, reference: &Reference) -> Demand {
    Controller::new(Gains::default()).update(state, reference, HOVER, 0.01).expect("finite input")
}

fn heading(psi: f64) -> Quat {
    UnitQuaternion::from_axis_angle(&Vec3::z_axis(), psi)
}

#[test]
fn hover_gives_hover_thrust_and_no_rates() {
    for psi in [-3.0, 0.0, 1.0, 3.1] {
        let state = hovering(heading(psi));
        let demand = update(&state, &Reference::rest(state.p, psi));
        assert!((demand.setpoint.thrust - HOVER).abs() < 1e-12);
        assert!(demand.setpoint.rates.norm() < 1e-9, "{:?}", demand.setpoint.rates);
    }
}

#[test]
fn feed_forward_alone_follows_a_trajectory_exactly() {
    // On a circle with the exact state, rates and thrust must be those of the moving attitude:
    // compared with a finite difference of the desired attitude.
    let (radius, omega) = (2.0_f64, 0.9_f64);
    let at = |t: f64| {
        let (s, c) = (omega * t).sin_cos();
        Reference {
            p: Vec3::new(radius * c, radius * s, 5.0),
            v: Vec3::new(-s, c, 0.0) * (radius * omega),
            a: Vec3::new(-c, -s, 0.0) * (radius * omega.powi(2)),
            j: Vec3::new(s, -c, 0.0) * (radius * omega.powi(3)),
            psi: 0.2 * t,
            psi_rate: 0.2,
        }
    };
    let pose = |t: f64| attitude(&(at(t).a + Vec3::new(0.0, 0.0, GRAVITY)), at(t).psi);
    for t in [0.0, 0.7, 2.2] {
        let r = at(t);
        let state = State { at: Nanos(0), p: r.p, v: r.v, q: pose(t), w: Vec3::zeros() };
        let mut controller = Controller::new(Gains::default());
        controller.jerk = r.j;
        let demand = controller.update(&state, &r, HOVER, 0.01).expect("finite input");
        let h = 1e-5;
        let w = (pose(t - h).inverse() * pose(t + h)).scaled_axis() / (2.0 * h);
        // Mellinger's yaw rate takes only the heading rate's share along z_B: within the tilt squared.
        assert!((demand.setpoint.rates - w).xy().norm() < 1e-3, "{} {}", demand.setpoint.rates, w);
        assert!((demand.setpoint.rates.z - w.z).abs() < 0.05);
        let force = (r.a + Vec3::new(0.0, 0.0, GRAVITY)).norm();
        assert!((demand.setpoint.thrust - HOVER * force / GRAVITY).abs() < 1e-9);
    }
}

#[test]
fn error_to_the_east_tilts_east() {
    let state = hovering(heading(0.0));
    let demand = update(&state, &Reference::rest(state.p + Vec3::new(0.5, 0.0, 0.0), 0.0));
    // Body FLU: a positive pitch rate turns z towards +x.
    assert!(demand.setpoint.rates.y > 0.5 && demand.acceleration.x > 1.0);
    assert!(demand.setpoint.rates.x.abs() < 1e-9);
}

#[test]
fn integral_winds_up_only_close_to_the_reference() {
    let mut near = Controller::new(Gains::default());
    let mut far = near.clone();
    let state = hovering(heading(0.0));
    for _ in 0..10_000 {
        near.update(&state, &Reference::rest(state.p + Vec3::new(0.1, 0.0, 0.0), 0.0), HOVER, 0.01);
        far.update(&state, &Reference::rest(state.p + Vec3::new(0.5, 0.0, 0.0), 0.0), HOVER, 0.01);
    }
    assert_eq!(near.integral.x, Gains::default().integral_max);
    assert_eq!(far.integral, Vec3::zeros());
}

#[test]
fn a_step_of_jerk_is_fed_forward_slowly_and_in_full() {
    let state = hovering(heading(0.0));
    let reference = Reference { j: Vec3::new(12.0, 16.0, 0.0), ..Reference::rest(state.p, 0.0) };
    let mut controller = Controller::new(Gains::default());
    let (mut last, mut rates) = (Vec3::zeros(), Vec3::zeros());
    // 20 m/s^3 at 60 m/s^4 take a third of a second.
    for tick in 0..40 {
        rates = controller.update(&state, &reference, HOVER, 0.01).expect("finite input").setpoint.rates;
        let step = (rates - last).norm() * GRAVITY;
        assert!(step <= 0.6 + 1e-9, "tick {tick}: {step} m/s^3");
        last = rates;
    }
    assert!((rates - Vec3::new(-16.0, 12.0, 0.0) / GRAVITY).norm() < 1e-9, "{rates}");
}

fn vector(limit: f64) -> impl Strategy<Value = Vec3> {
    [-limit..limit, -limit..limit, -limit..limit].prop_map(Vec3::from)
}

proptest! {
    #[test]
    fn a_handover_does_not_change_the_demand(
        dp in vector(1.4), dv in vector(1.5), a in vector(2.0), wound in vector(1.0),
        miss_p in vector(0.05), miss_v in vector(0.3),
    ) {
        // A new reference that begins where the vehicle was expected, while the vehicle is elsewhere.
        let old = Reference { a, v: Vec3::new(1.0, -2.0, 0.5), ..Reference::rest(Vec3::new(1.0, 2.0, 3.0), 0.0) };
        let mut controller = Controller::new(Gains::default());
        controller.integral = wound;
        let (p, v) = (old.p - dp, old.v - dv);
        let new = Reference { p, v, a: controller.handover(&p, &v, &old), ..old };
        let state = State { p: p + miss_p, v: v + miss_v, ..hovering(heading(0.0)) };
        let free = controller.feedback(&state.p, &state.v, &old) + wound;
        let expected = controller.feedback(&p, &v, &old) + wound;
        let limited = |x: Vec3| (limit_acceleration(x, &controller.gains) - x).norm() > 0.0;
        prop_assume!(dp.norm() < 1.5 && (old.p - state.p).norm() < 1.5 && !limited(free) && !limited(expected));
        let demand = |r: &Reference| controller.clone().update(&state, r, HOVER, 0.01).expect("finite").acceleration;
        // Only what one tick integrates differs.
        prop_assert!((demand(&old) - demand(&new)).norm() < 0.8 * 1.5 * 0.01 + 1e-9);
    }

    #[test]
    fn small_rotations_are_restored(axis in vector(1.0), angle in 0.01..0.4f64, psi in -3.0..3.0f64) {
        prop_assume!(axis.norm() > 0.1);
        let level = heading(psi);
        let turn = UnitQuaternion::from_scaled_axis(axis.normalize() * angle);
        let state = hovering(level * turn);
        let rates = update(&state, &Reference::rest(state.p, psi)).setpoint.rates;
        // The commanded rotation reduces the attitude error.
        let after = level.inverse() * (state.q * UnitQuaternion::from_scaled_axis(rates * 1e-3));
        prop_assert!(after.angle() < (level.inverse() * state.q).angle());
    }

    #[test]
    fn rates_converge_from_any_attitude(q in any::<[i8; 4]>(), psi in -3.0..3.0f64) {
        let raw = nalgebra::Quaternion::new(q[0].into(), q[1].into(), q[2].into(), q[3].into());
        prop_assume!(raw.norm() > 1.0);
        let controller = Controller::new(Gains::default());
        let mut attitude = UnitQuaternion::from_quaternion(raw);
        let reference = Reference::rest(Vec3::zeros(), psi);
        for _ in 0..1500 {
            let demand = controller.steer(&attitude, Vec3::zeros(), &reference, HOVER).expect("finite");
            attitude *= UnitQuaternion::from_scaled_axis(demand.setpoint.rates * 0.01);
        }
        prop_assert!(attitude.angle_to(&heading(psi)) < 0.02, "{}", attitude.angle_to(&heading(psi)));
    }

    #[test]
    fn output_is_finite_and_limited(
        p in proptest::array::uniform3(proptest::num::f64::ANY), v in proptest::array::uniform3(proptest::num::f64::ANY), a in vector(1e3), j in vector(1e3),
        psi in proptest::num::f64::ANY, turn in vector(3.0), hover in 0.1..0.9f64,
    ) {
        let q = UnitQuaternion::from_scaled_axis(turn);
        let state = State { at: Nanos(0), p: p.into(), v: v.into(), q, w: Vec3::zeros() };
        let reference = Reference { a, j, psi, ..Reference::rest(Vec3::zeros(), 0.0) };
        let gains = Gains::default();
        if let Some(demand) = Controller::new(gains).update(&state, &reference, hover, 0.01) {
            let Setpoint { rates, thrust } = demand.setpoint;
            prop_assert!((0.0..=1.0).contains(&thrust));
            prop_assert!(rates.x.abs() <= gains.rate_max && rates.y.abs() <= gains.rate_max);
            prop_assert!(rates.z.abs() <= 2.0 * gains.yaw_rate_max);
            let up = demand.acceleration.z + GRAVITY;
            prop_assert!(demand.acceleration.xy().norm() <= up * gains.tilt_max.tan() + 1e-9);
        } else {
            let numbers = [p[0], p[1], p[2], v[0], v[1], v[2], psi];
            // Refused only what is not finite, or overflows on the way.
            prop_assert!(numbers.iter().any(|x| !x.is_finite() || x.abs() > 1e150));
        }
    }
}
