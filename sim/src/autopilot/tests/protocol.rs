//! Streams, requests, parameters and clocks.

use super::*;

#[test]
fn current_mode_is_sent_on_each_change() {
    let mut bench = Bench::flying(&[("COM_OBL_RC_ACT", 5.0)]);
    bench.stream = None;
    bench.heard.clear();
    bench.until(2.0, |b| b.actual() == FlightMode::Loiter);
    let mut modes = bench.heard.iter().filter_map(|m| match m {
        MavMessage::CURRENT_MODE(m) => Some((m.custom_mode, m.intended_custom_mode)),
        _ => None,
    });
    assert_eq!(modes.next_back(), Some((4 << 16 | 3 << 24, 6 << 16)));
}

#[test]
fn positions_are_relative_to_the_own_origin_in_ned() {
    let mut bench = Bench::flying(&[]);
    bench.heard.clear();
    bench.run(0.1);
    let local = bench.heard.iter().rev().find_map(|m| match m {
        MavMessage::LOCAL_POSITION_NED(m) => Some((m.x, m.y, m.z, m.time_boot_ms)),
        _ => None,
    });
    let (x, y, z, boot) = local.unwrap();
    assert!(x.abs() < 0.1 && y.abs() < 0.1 && (f64::from(-z) - bench.height()).abs() < 0.2);
    assert!(boot > 7000, "own boot clock");
    let origin = Vec3::new(3.0, -2.0, 0.2);
    for (id, want) in [(id::GPS_GLOBAL_ORIGIN, origin), (id::HOME_POSITION, origin)] {
        assert_eq!(bench.command(MavCmd::MAV_CMD_REQUEST_MESSAGE, [id as f32, 0.0, 0.0]), 0);
        let place = bench.heard.iter().find_map(|m| match m {
            MavMessage::GPS_GLOBAL_ORIGIN(m) => Some((m.latitude, m.longitude, m.altitude)),
            MavMessage::HOME_POSITION(m) => Some((m.latitude, m.longitude, m.altitude)),
            _ => None,
        });
        assert_eq!(place, Some(frame::geodetic(&want)));
    }
}

#[test]
fn intervals_requests_and_unknown_commands_are_answered() {
    let mut bench = Bench::new(&[]);
    bench.run(1.5);
    let interval = MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL;
    assert_eq!(bench.command(interval, [31.0, 10_000.0, 0.0]), 0);
    assert_eq!(bench.command(interval, [0.0, 10_000.0, 0.0]), 4, "HEARTBEAT is fixed");
    assert_eq!(bench.command(interval, [9999.0, 10_000.0, 0.0]), 2);
    assert_eq!(bench.command(interval, [115.0, 10_000.0, 0.0]), 0);
    bench.heard.clear();
    bench.run(1.0);
    let count = |wanted: fn(&MavMessage) -> bool| bench.heard.iter().filter(|m| wanted(m)).count();
    assert_eq!(count(|m| matches!(m, MavMessage::ATTITUDE_QUATERNION(_))), 100);
    assert_eq!(count(|m| matches!(m, MavMessage::HIL_STATE_QUATERNION(_))), 100);
    assert_eq!(bench.command(MavCmd::MAV_CMD_REQUEST_MESSAGE, [148.0, 0.0, 0.0]), 0);
    assert!(bench.heard.iter().any(|m| matches!(m, MavMessage::AUTOPILOT_VERSION(v) if v.uid != 0)));
    assert_eq!(bench.command(MavCmd::MAV_CMD_REQUEST_MESSAGE, [435.0, 0.0, 0.0]), 2);
    assert_eq!(bench.command(MavCmd::MAV_CMD_DO_ORBIT, [0.0; 3]), 3);
}

#[test]
fn parameters_are_read_listed_and_set() {
    let mut bench = Bench::flying(&[]);
    let value = |bench: &Bench| {
        bench.heard.iter().rev().find_map(|m| match m {
            MavMessage::PARAM_VALUE(v) => Some(v.clone()),
            _ => None,
        })
    };
    let read = |name: &str| {
        MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
            param_index: -1,
            target_system: 5,
            target_component: 1,
            param_id: name.into(),
        })
    };
    bench.say(read("COM_OF_LOSS_T"));
    assert_eq!(value(&bench).unwrap().param_value, 1.0);
    bench.heard.clear();
    bench.say(read("_HASH_CHECK"));
    assert!(bench.heard.is_empty());
    bench.say(read("NO_SUCH"));
    assert!(matches!(bench.heard[..], [MavMessage::STATUSTEXT(_)]));

    bench.heard.clear();
    bench.say(MavMessage::PARAM_REQUEST_LIST(PARAM_REQUEST_LIST_DATA {
        target_system: 5,
        target_component: 1,
    }));
    assert_eq!(bench.heard.len(), usize::from(value(&bench).unwrap().param_count));

    let set = |name: &str, param_value: f32, param_type| {
        MavMessage::PARAM_SET(PARAM_SET_DATA {
            param_value,
            target_system: 5,
            target_component: 1,
            param_id: name.into(),
            param_type,
        })
    };
    bench.say(set("COM_OBL_RC_ACT", f32::from_bits(5), MavParamType::MAV_PARAM_TYPE_INT32));
    assert_eq!(value(&bench).unwrap().param_value.to_bits(), 5);
    bench.say(set("COM_OBL_RC_ACT", 4.0, MavParamType::MAV_PARAM_TYPE_REAL32));
    assert_eq!(value(&bench).unwrap().param_value.to_bits(), 5, "a wrong type changes nothing");
    bench.say(set("COM_OF_LOSS_T", 0.5, MavParamType::MAV_PARAM_TYPE_REAL32));
    bench.stream = None;
    bench.run(0.7);
    assert_eq!(bench.actual(), FlightMode::Loiter, "set in flight, they act");
}

#[test]
fn timesync_is_answered_on_the_own_clock() {
    let mut bench = Bench::new(&[]);
    bench.run(0.5);
    bench.heard.clear();
    bench.say(MavMessage::TIMESYNC(TIMESYNC_DATA { ts1: 42, ..TIMESYNC_DATA::DEFAULT }));
    let reply = match &bench.heard[..] {
        [MavMessage::TIMESYNC(t)] => t.clone(),
        other => panic!("{other:?}"),
    };
    assert_eq!((reply.ts1, reply.tc1), (42, 7_500_000_000));
}
