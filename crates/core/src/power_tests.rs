use super::*;
use crate::trajectory::Knot;
use nalgebra::Rotation3;
use proptest::prelude::*;

const F450: Vehicle = Vehicle::F450;

fn vector(bound: f64) -> impl Strategy<Value = Vec3> {
    let range = -bound..bound;
    (range.clone(), range.clone(), range).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

fn rotor_thrust() -> f64 {
    F450.mass * GRAVITY / 4.0
}

/// Wanders at up to about 1.5 m/s and 3 m/s^2 per axis, as the shipped plans do at most.
fn trajectory() -> impl Strategy<Value = Trajectory> {
    prop::collection::vec((1.0..10.0_f64, vector(1.0), vector(0.5)), 2..12).prop_map(|steps| {
        let mut knots: Vec<Knot> = Vec::new();
        for (h, v, a) in steps {
            let (t, p) =
                knots.last().map_or((0.0, Vec3::zeros()), |k| (k.t + h, k.p + (k.v + v) * (0.5 * h)));
            knots.push(Knot { t, p, v, a, psi: 0.0, psi_rate: 0.0, psi_acc: 0.0 });
        }
        Trajectory::try_from(knots).expect("legal durations")
    })
}

#[test]
fn hover_is_that_of_momentum_theory() {
    let weight = F450.mass * GRAVITY;
    let ideal = weight.powf(1.5) / (2.0 * AIR_DENSITY * 4.0 * F450.rotor.area()).sqrt();
    let merit = F450.rotor.figure_of_merit(rotor_thrust());
    let expected = ideal / merit / F450.rotor.efficiency;
    assert!((F450.hover_power() - expected).abs() < 1e-9 * expected);
    // Measured: 5.2 g/W at 1.7 kg.
    assert!((F450.hover_power() - 1700.0 / 5.2).abs() < 3.0, "{} W", F450.hover_power());
    assert!((0.4..0.8).contains(&merit), "{merit}");
}

#[test]
fn axial_flight_is_the_closed_form() {
    // Leishman, equations 2.52 and 2.61: v = -c/2 + sqrt(c^2/4 + v_h^2) in climb c.
    let hover = F450.rotor.induced_velocity(rotor_thrust(), 0.0, 0.0);
    for climb in [-3.0, -1.0, 0.0, 0.5, 3.0, 12.0_f64] {
        let closed = -0.5 * climb + (0.25 * climb * climb + hover * hover).sqrt();
        let found = F450.rotor.induced_velocity(rotor_thrust(), climb, 0.0);
        assert!((found - closed).abs() < 1e-9, "{climb}: {found} {closed}");
    }
    // Far across the axis the rotor works as a wing: v = v_h^2 / across.
    let fast = F450.rotor.induced_velocity(rotor_thrust(), 0.0, 200.0);
    assert!((fast - hover * hover / 200.0).abs() < 1e-4);
}

#[test]
fn at_rest_a_rotor_spends_its_reaction_torque() {
    for thrust in [0.5, 4.0, 9.0] {
        let torque_power = F450.rotor.torque_per_thrust * thrust * F450.rotor.speed(thrust);
        assert!((F450.rotor.shaft_power(thrust, 0.0, 0.0) - torque_power).abs() < 1e-9);
    }
    assert!(F450.rotor.power(0.0, 0.0, 0.0).abs() < 1e-12);
}

#[test]
fn level_flight_has_its_least_power_at_a_speed() {
    // The power bucket of every rotorcraft: induced power falls, drag rises.
    let at = |speed: f64| F450.flight_power(&Vec3::zeros(), &Vec3::new(speed, 0.0, 0.0));
    assert!(at(3.0) < at(0.0) && at(20.0) > at(0.0));
}

proptest! {
    #[test]
    fn glauert_equation_holds(thrust in 0.01..10.0_f64, axial in -20.0..20.0_f64, across in 0.0..20.0_f64) {
        let v = F450.rotor.induced_velocity(thrust, axial, across);
        let lift = 2.0 * AIR_DENSITY * F450.rotor.area() * v * across.hypot(axial + v);
        prop_assert!(v >= 0.0);
        prop_assert!((lift - thrust).abs() < 1e-8 * thrust, "{lift} {thrust}");
    }

    #[test]
    fn power_is_finite_and_not_negative(a in vector(30.0), v in vector(40.0)) {
        let power = F450.flight_power(&a, &v);
        prop_assert!(power.is_finite() && power >= 0.0);
    }

    #[test]
    fn climbing_faster_costs_more(a in vector(3.0), v in vector(3.0), more in 1e-3..3.0_f64) {
        let faster = v + Vec3::new(0.0, 0.0, more);
        let thrust = F450.thrust_accel(&a, &v);
        prop_assert!(F450.power(&thrust, &faster) > F450.power(&thrust, &v) || thrust.z <= 0.0);
        let axis = F450.rotor.power(rotor_thrust(), v.z, v.x.abs());
        prop_assert!(F450.rotor.power(rotor_thrust(), faster.z, v.x.abs()) > axis);
    }

    #[test]
    fn power_does_not_know_directions(a in vector(5.0), v in vector(5.0), psi in -4.0..4.0_f64) {
        let turn = Rotation3::from_axis_angle(&Vec3::z_axis(), psi);
        let (one, two) = (F450.flight_power(&a, &v), F450.flight_power(&(turn * a), &(turn * v)));
        prop_assert!((one - two).abs() < 1e-7 * one.max(1.0), "{one} {two}");
    }

    #[test]
    fn thrust_leans_against_all_drag(a in vector(5.0), v in vector(5.0)) {
        // What the plant of the simulator does with this thrust is the acceleration asked for.
        let f = F450.thrust_accel(&a, &v);
        let axis = f.normalize();
        let across = v - axis * v.dot(&axis);
        let speed = F450.rotor.speed(F450.mass * f.norm() / 4.0);
        let drag = v * (F450.drag * v.norm()) + across * (4.0 * F450.rotor.drag * speed);
        let found = f - Vec3::new(0.0, 0.0, GRAVITY) - drag / F450.mass;
        prop_assert!((found - a).norm() < 1e-6, "{found} {a}");
    }

    #[test]
    fn hovering_costs_hover_power(seconds in 0.1..10.0_f64) {
        let rest = |t| Knot {
            t, p: Vec3::new(1.0, 2.0, 3.0), v: Vec3::zeros(), a: Vec3::zeros(),
            psi: 0.0, psi_rate: 0.0, psi_acc: 0.0,
        };
        let energy = F450.energy(&Trajectory::try_from(vec![rest(0.0), rest(seconds)]).expect("legal"));
        prop_assert!((energy.total / energy.hover - 1.0).abs() < 1e-12);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn energy_is_the_integral_of_power(track in trajectory()) {
        // Midpoints 5 ms apart.
        let n = ((track.end() - track.start()) / 5e-3).ceil() as u32;
        let dt = (track.end() - track.start()) / f64::from(n);
        let sum: f64 = (0..n)
            .map(|k| {
                let (_, v, a) = track.motion(track.start() + (f64::from(k) + 0.5) * dt);
                F450.flight_power(&a, &v)
            })
            .sum();
        let energy = F450.energy(&track);
        prop_assert!((energy.total / (sum * dt) - 1.0).abs() < 2e-6, "{} {}", energy.total, sum * dt);
        prop_assert!((energy.hover / (track.end() - track.start()) - F450.hover_power()).abs() < 1e-9);
    }
}
