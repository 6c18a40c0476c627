use super::rate_controller::RateController;
use super::*;
use proptest::prelude::*;

fn hovering() -> Plant {
    let mut plant = Plant::new(Airframe::F450, Vec3::zeros(), 0.3);
    let q = plant.truth().q;
    plant.place(Vec3::new(1.0, 2.0, 10.0), Vec3::zeros(), q);
    plant
}

/// Closes the rate loop for `seconds` and gives the rates of one axis at every step.
fn fly_rates(plant: &mut Plant, wanted: Vec3, thrust: f64, seconds: f64, axis: usize) -> Vec<f64> {
    let mut controller = RateController::default();
    let mut saturated = [false; 3];
    (0..(seconds / DT) as usize)
        .map(|_| {
            let torque = controller.update(&wanted, &plant.truth().w, saturated, false, DT);
            let mix = mixer::mix(thrust, torque);
            saturated = mix.saturated;
            plant.step(mix.motors, &Vec3::zeros(), &Vec3::zeros(), DT);
            plant.truth().w[axis]
        })
        .collect()
}

fn time_to(rates: &[f64], level: f64) -> f64 {
    rates.iter().position(|w| *w >= level).map_or(f64::INFINITY, |i| (i + 1) as f64 * DT)
}

#[test]
fn hover_thrust_holds_height_and_lies_in_the_wanted_range() {
    let mut plant = hovering();
    let hover = plant.airframe().hover_thrust();
    assert!((0.35..=0.45).contains(&hover), "{hover}");
    for _ in 0..10_000 {
        plant.step([hover; 4], &Vec3::zeros(), &Vec3::zeros(), DT);
    }
    assert!((plant.truth().p - Vec3::new(1.0, 2.0, 10.0)).norm() < 1e-6);
}

#[test]
fn falls_freely_without_thrust_but_for_drag() {
    let mut plant = hovering();
    plant.truth.p.z = 100.0;
    plant.thrusts = [0.0; 4];
    for _ in 0..1000 {
        plant.step([0.0; 4], &Vec3::zeros(), &Vec3::zeros(), DT);
    }
    // v(t) = v_t tanh(g t / v_t) for quadratic drag.
    let terminal = (plant.airframe.mass * GRAVITY / plant.airframe.drag).sqrt();
    let expected = terminal * (GRAVITY / terminal).tanh();
    assert!((-plant.truth().v.z - expected).abs() < 2e-3, "{} {expected}", plant.truth().v.z);
    let drag = plant.airframe.drag * plant.truth().v.norm_squared() / plant.airframe.mass;
    assert!((plant.truth().specific_force.z - drag).abs() < 1e-2, "{}", plant.truth().specific_force);
}

#[test]
fn terminal_speed_in_wind_is_the_wind() {
    let mut plant = hovering();
    let hover = plant.airframe().hover_thrust();
    let wind = Vec3::new(3.0, -2.0, 0.0);
    for _ in 0..120_000 {
        plant.step([hover; 4], &wind, &Vec3::zeros(), DT);
    }
    assert!((plant.truth().v - wind).norm() < 0.02, "{}", plant.truth().v);
}

#[test]
fn a_force_pulse_gives_its_impulse() {
    let mut plant = hovering();
    plant.airframe.drag = 0.0;
    plant.airframe.rotor_drag = 0.0;
    let hover = plant.airframe().hover_thrust();
    let force = Vec3::new(2.0, 0.5, -0.25);
    for _ in 0..1000 {
        plant.step([hover; 4], &Vec3::zeros(), &force, DT);
    }
    let expected = force / plant.airframe.mass;
    assert!((plant.truth().v - expected).norm() < 1e-9);
    assert!((plant.truth().p - Vec3::new(1.0, 2.0, 10.0) - expected * 0.5).norm() < 1e-9);
}

#[test]
fn rate_step_response_lies_in_the_published_band() {
    // Measured on PX4 with its default gains: 63 % at 82-112 ms with 50 ms motors, 47-76 ms with
    // 20 ms motors, overshoot 5-17 %; ours lag 30 ms.
    for axis in 0..2 {
        for size in [1.0, 3.0, 6.0] {
            let mut wanted = Vec3::zeros();
            wanted[axis] = size;
            let rates = fly_rates(&mut hovering(), wanted, 0.5, 0.3, axis);
            let t63 = time_to(&rates, 0.63 * size);
            assert!((0.045..=0.110).contains(&t63), "axis {axis} size {size}: 63 % at {t63} s");
            let peak = rates.iter().fold(0.0_f64, |m, w| m.max(*w)) / size;
            assert!(peak < 1.20, "axis {axis} size {size}: peak {peak}");
        }
    }
}

#[test]
fn yaw_is_weaker_than_roll() {
    let yaw = fly_rates(&mut hovering(), Vec3::new(0.0, 0.0, 0.5), 0.42, 1.0, 2);
    let roll = fly_rates(&mut hovering(), Vec3::new(0.5, 0.0, 0.0), 0.42, 1.0, 0);
    assert!(time_to(&yaw, 0.315) > 3.0 * time_to(&roll, 0.315));
    assert!((yaw[yaw.len() - 1] - 0.5).abs() < 0.05, "{}", yaw[yaw.len() - 1]);
}

#[test]
fn stands_still_until_thrust_exceeds_weight_then_lifts_off_and_lands() {
    let mut plant = Plant::new(Airframe::F450, Vec3::new(1.0, 2.0, 0.2), 1.0);
    let start = *plant.truth();
    let hover = plant.airframe().hover_thrust();
    for _ in 0..2000 {
        plant.step([0.9 * hover; 4], &Vec3::new(5.0, 0.0, 0.0), &Vec3::zeros(), DT);
    }
    assert!((plant.truth().p - start.p).norm() < 1e-12 && plant.truth().on_ground);
    for _ in 0..1000 {
        plant.step([1.2 * hover; 4], &Vec3::zeros(), &Vec3::zeros(), DT);
    }
    assert!(!plant.truth().on_ground && plant.truth().p.z > 0.5);
    for _ in 0..5000 {
        plant.step([0.8 * hover; 4], &Vec3::zeros(), &Vec3::zeros(), DT);
    }
    assert!(plant.truth().on_ground && plant.take_impact().is_some_and(|v| v > 1.0));
    assert_eq!(plant.truth().p.z, 0.2);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Without thrust, drag and torque the kinetic energy of rotation and the angular momentum in
    /// the world stay; energy of translation changes by the work of gravity alone.
    #[test]
    fn torque_free_motion_keeps_energy_and_momentum(
        w in prop::array::uniform3(-4.0..4.0f64), v in prop::array::uniform3(-5.0..5.0f64)
    ) {
        let mut plant = hovering();
        plant.airframe.drag = 0.0;
        plant.thrusts = [0.0; 4];
        plant.truth.p.z = 100.0;
        plant.truth.w = Vec3::from(w);
        plant.truth.v = Vec3::from(v);
        let inertia = plant.airframe.inertia;
        let energy = |p: &Plant| (
            0.5 * p.truth.w.dot(&inertia.component_mul(&p.truth.w)),
            0.5 * p.truth.v.norm_squared() + GRAVITY * p.truth.p.z,
            p.truth.q * inertia.component_mul(&p.truth.w),
        );
        let before = energy(&plant);
        for _ in 0..1000 {
            plant.step([0.0; 4], &Vec3::zeros(), &Vec3::zeros(), DT);
        }
        let after = energy(&plant);
        prop_assert!((after.0 - before.0).abs() <= 0.02 * before.0 + 1e-9);
        prop_assert!((after.1 - before.1).abs() < 1e-6);
        prop_assert!((after.2 - before.2).norm() <= 0.02 * before.2.norm() + 1e-9);
        prop_assert!((plant.truth.q.norm() - 1.0).abs() < 1e-9);
    }
}
