//! External setpoints: type masks, frames, hold, foreign targets.

use super::*;

#[test]
fn until_the_timeout_the_last_rates_are_held() {
    let mut bench = Bench::flying(&[]);
    bench.stream = Some(([0.5, 0.0, 0.0], 0.5, RATES));
    bench.run(0.3);
    bench.stream = None;
    bench.run(0.6);
    let (roll, _, _) = bench.plant.truth().q.euler_angles();
    assert!(roll > 0.3 && (bench.plant.truth().w.x - 0.5).abs() < 0.05, "{roll}");
    assert_eq!(bench.actual(), FlightMode::Offboard);
}

#[test]
fn another_target_is_ignored_and_counts_as_a_lost_stream() {
    let mut bench = Bench::flying(&[("COM_OBL_RC_ACT", 5.0)]);
    bench.stream = None;
    for _ in 0..150 {
        bench.setpoint([0.0; 3], 0.42, RATES, 6);
        bench.run(0.01);
    }
    assert_eq!(bench.actual(), FlightMode::Loiter);
    bench.heard.clear();
    bench.say(MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        command: MavCmd::MAV_CMD_DO_SET_MODE,
        target_system: 6,
        ..COMMAND_LONG_DATA::DEFAULT
    }));
    assert!(bench.heard.is_empty());
}

#[test]
fn type_masks_and_not_a_number() {
    let falls = |rates, thrust, mask| {
        let mut bench = Bench::flying(&[]);
        bench.stream = Some((rates, thrust, mask));
        bench.run(0.5);
        assert_eq!(bench.actual(), FlightMode::Offboard, "no mode change");
        bench.plant.truth().v.z < -2.0
    };
    assert!(falls([0.0; 3], 0.42, RATES | 64), "throttle ignored is zero thrust");
    assert!(falls([0.0; 3], f32::NAN, RATES));
    assert!(falls([0.0; 3], -0.5, RATES));
    assert!(!falls([0.0; 3], 1.5, RATES));
    assert!(!falls([0.0; 3], 0.42, RATES | 32));
    assert!(!falls([0.0, 0.0, 3.0], 0.42, RATES | 4), "yaw uncontrolled");
    assert!(!falls([f32::NAN, 0.0, 0.0], 0.42, RATES));
    for mask in [RATES | 1, RATES | 2, RATES | 3] {
        let mut bench = Bench::flying(&[("COM_OBL_RC_ACT", 5.0)]);
        bench.stream = Some(([1.0, 1.0, 0.0], 0.42, mask));
        bench.run(1.2);
        assert_eq!(bench.actual(), FlightMode::Loiter, "mask {mask} is not a rate setpoint");
    }
}

#[test]
fn attitude_setpoints_level_the_vehicle() {
    for mask in [7, 0] {
        let mut bench = Bench::flying(&[]);
        bench.stream = Some(([1.0, 0.0, 0.0], 0.5, RATES));
        bench.run(0.4);
        bench.stream = Some(([1.0, 0.0, 0.0], 0.5, mask));
        bench.run(2.0);
        let up = bench.plant.truth().q * Vec3::z();
        assert!(up.z > 0.999, "mask {mask}: {up}");
    }
}

#[test]
fn rates_are_frd_and_answered_in_frd() {
    let mut bench = Bench::flying(&[]);
    let start = bench.plant.truth().q;
    bench.stream = Some(([0.0, 0.4, 0.0], 0.5, RATES));
    bench.run(0.6);
    // A positive pitch rate in FRD lifts the nose, so the vehicle goes backwards.
    assert!((start.inverse() * bench.plant.truth().v).x < -0.1);
    bench.heard.clear();
    bench.run(0.2);
    let seen = bench.heard.iter().find_map(|m| match m {
        MavMessage::ATTITUDE(a) => Some(a.clone()),
        _ => None,
    });
    let seen = seen.unwrap();
    assert!(seen.pitch > 0.1 && (seen.pitchspeed - 0.4).abs() < 0.05, "{seen:?}");
    let echo = bench.heard.iter().find_map(|m| match m {
        MavMessage::ATTITUDE_TARGET(t) => Some(t.body_pitch_rate),
        _ => None,
    });
    assert_eq!(echo, Some(0.4));
}
