//! Arming, mode changes, failsafe, landing.

use super::*;

#[test]
fn arming_needs_estimator_mode_and_stream() {
    let mut bench = Bench::new(&[]);
    assert_eq!(bench.arm(1.0, 0.0), 1, "estimator not ready");
    assert_eq!(bench.arm(1.0, 21196.0), 1, "checks always run");
    bench.run(1.5);
    assert_eq!(bench.arm(2.0, 0.0), 3, "param1 is neither 0 nor 1");
    assert_eq!(bench.mode(6, 0), 0, "disarmed, OFFBOARD is accepted without a stream");
    assert_eq!(bench.last_heartbeat().system_status as u8, 0);
    assert_eq!(bench.arm(1.0, 0.0), 1, "but not armed");
    assert_eq!(bench.mode(4, 6), 0);
    assert_eq!(bench.arm(1.0, 0.0), 1, "not in LAND");
    assert_eq!(bench.mode(6, 0), 0);
    bench.stream = Some(([0.0; 3], 0.0, RATES));
    bench.run(0.05);
    assert_eq!(bench.last_heartbeat().system_status as u8, 3);
    assert_eq!(bench.arm(1.0, 0.0), 0);
    let beat = bench.last_heartbeat();
    assert_eq!(beat.custom_mode, 6 << 16);
    assert!(beat.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED));
    assert_eq!(beat.system_status as u8, 4);
}

#[test]
fn armed_without_taking_off_disarms_after_ten_seconds() {
    let mut bench = Bench::new(&[]);
    bench.run(1.5);
    bench.stream = Some(([0.0; 3], 0.0, RATES));
    bench.run(0.1);
    bench.mode(6, 0);
    assert_eq!(bench.arm(1.0, 0.0), 0);
    let after = bench.until(12.0, |b| !b.armed());
    assert!((9.9..10.1).contains(&after), "{after}");
    assert_eq!(bench.height(), 0.0);
}

#[test]
fn motors_act_at_once_after_arming() {
    let mut bench = Bench::new(&[]);
    bench.run(1.5);
    bench.stream = Some(([0.0; 3], 0.65, RATES));
    bench.run(0.1);
    bench.mode(6, 0);
    bench.arm(1.0, 0.0);
    let lift = bench.until(0.2, |b| b.height() > 0.0);
    let fast = bench.until(0.5, |b| b.plant.truth().v.z > 0.5);
    assert!(lift <= 0.06 && lift + fast <= 0.35, "{lift} {fast}");
}

#[test]
fn offboard_without_a_stream_is_rejected_in_flight_and_a_later_stream_does_not_switch() {
    let mut bench = Bench::flying(&[]);
    assert_eq!(bench.mode(4, 3), 0);
    bench.stream = None;
    bench.run(1.5);
    assert_eq!(bench.mode(6, 0), 1);
    assert_eq!(bench.actual(), FlightMode::Loiter);
    bench.stream = Some(([0.0; 3], 0.4, RATES));
    bench.run(0.5);
    assert_eq!(bench.actual(), FlightMode::Loiter);
    assert_eq!(bench.mode(6, 0), 0);
}

#[test]
fn loses_the_stream_after_the_timeout_and_returns_by_itself() {
    let table = [
        (0.0, FlightMode::Posctl),
        (1.0, FlightMode::Altctl),
        (2.0, FlightMode::Stabilized),
        (3.0, FlightMode::Rtl),
        (4.0, FlightMode::Land),
        (5.0, FlightMode::Loiter),
    ];
    for (action, fallback) in table {
        for timeout in [0.5, 1.0] {
            let mut bench = Bench::flying(&[("COM_OBL_RC_ACT", action), ("COM_OF_LOSS_T", timeout)]);
            bench.stream = None;
            let after = bench.until(2.0, |b| b.actual() != FlightMode::Offboard);
            assert!((timeout..timeout + 0.12).contains(&after), "action {action}: {after}");
            assert_eq!(bench.actual(), fallback);
            assert_eq!(bench.autopilot.commander().intended(), FlightMode::Offboard);
            assert_eq!(bench.last_heartbeat().system_status as u8, 5);
            bench.run((10 - (bench.now.0 / STEP) % 10) as f64 * 1e-3);
            bench.stream = Some(([0.0; 3], 0.42, RATES));
            let back = bench.until(0.2, |b| b.actual() == FlightMode::Offboard);
            assert!((0.028..=0.045).contains(&back), "action {action}: {back}");
        }
    }
}

#[test]
fn hold_keeps_height_and_stick_modes_sink() {
    for (action, low, high) in [(5.0, -0.3, 0.5), (0.0, -4.2, -2.0), (1.0, -4.2, -2.0)] {
        let mut bench = Bench::flying(&[("COM_OBL_RC_ACT", action)]);
        bench.stream = Some(([0.0; 3], 0.55, RATES));
        bench.run(2.0);
        let hover = bench.plant.airframe().hover_thrust() as f32;
        bench.stream = Some(([0.0; 3], 0.8 * hover, RATES));
        bench.until(6.0, |b| b.plant.truth().v.z < 0.1);
        bench.stream = Some(([0.0; 3], hover, RATES));
        bench.run(0.5);
        bench.stream = None;
        bench.until(2.0, |b| b.actual() != FlightMode::Offboard);
        bench.run(1.0);
        let before = bench.height();
        assert!(before > 5.0, "{before}");
        bench.run(5.0);
        let change = bench.height() - before;
        assert!((low..high).contains(&change), "action {action}: {change}");
    }
}

#[test]
fn lands_slowly_and_disarms_two_seconds_after_touchdown() {
    let mut bench = Bench::flying(&[]);
    assert_eq!(bench.mode(4, 6), 0);
    bench.run(2.0);
    let speed = -bench.plant.truth().v.z;
    assert!((0.6..0.8).contains(&speed), "{speed}");
    bench.until(20.0, |b| b.plant.truth().on_ground);
    assert!(bench.plant.take_impact().unwrap() < 0.9);
    let after = bench.until(4.0, |b| !b.armed());
    assert!((1.9..2.2).contains(&after), "{after}");
    assert_eq!(bench.actual(), FlightMode::Offboard, "the mode flips back");
    assert_eq!(bench.mode(6, 0), 0);
    assert_eq!(bench.arm(1.0, 0.0), 0, "flies again");
}

#[test]
fn landing_by_thrust_is_seen_when_thrust_is_cut() {
    let mut bench = Bench::flying(&[]);
    let hover = bench.plant.airframe().hover_thrust() as f32;
    bench.stream = Some(([0.0; 3], 0.93 * hover, RATES));
    bench.until(20.0, |b| b.plant.truth().on_ground);
    bench.run(3.0);
    assert!(bench.armed(), "93 % of hover is not low thrust");
    bench.stream = Some(([0.0; 3], 0.0, RATES));
    let after = bench.until(4.0, |b| !b.armed());
    assert!((1.9..2.2).contains(&after), "{after}");
}

#[test]
fn disarming_in_the_air_needs_force() {
    let mut bench = Bench::flying(&[]);
    assert_eq!(bench.arm(0.0, 0.0), 1);
    assert!(bench.armed());
    assert_eq!(bench.arm(0.0, 21196.0), 0);
    bench.run(0.3);
    assert!(!bench.armed() && bench.plant.truth().v.z < 0.0);
    bench.run(5.0);
    assert_eq!(bench.arm(1.0, 0.0), 0, "re-arms on the ground");
}

#[test]
fn takes_off_holds_and_returns_by_itself() {
    let mut bench = Bench::new(&[]);
    bench.run(1.5);
    assert_eq!(bench.command(MavCmd::MAV_CMD_NAV_TAKEOFF, [0.0; 3]), 0);
    assert_eq!(bench.arm(1.0, 0.0), 0);
    bench.until(10.0, |b| b.actual() == FlightMode::Loiter);
    bench.run(5.0);
    assert!((bench.height() - 2.5).abs() < 0.3, "{}", bench.height());
    let start = Vec3::new(3.0, -2.0, 0.2);
    assert!((bench.plant.truth().p - start).xy().norm() < 0.1);
    assert_eq!(bench.command(MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH, [0.0; 3]), 0);
    bench.until(20.0, |b| !b.armed());
    assert!((bench.plant.truth().p - start).norm() < 0.3);
}
