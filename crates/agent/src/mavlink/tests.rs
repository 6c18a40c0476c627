//! The codec against messages built by hand; pymavlink is the independent oracle in
//! `tests/unit/test_mavlink_frames.py`.

use super::*;
use crate::io::{Stream, VehicleRequest};
use fleet_core::types::{Quat, Setpoint, Vec3};
use mavlink::dialects::common as m;
use proptest::prelude::*;

const SYSTEM: u8 = 7;

fn from(system: u8, component: u8, message: &MavMessage) -> Vec<u8> {
    let mut raw = MAVLinkV2MessageRaw::new();
    let header = MavHeader { system_id: system.into(), component_id: component, sequence: 0 };
    raw.serialize_message(header, message);
    raw.raw_bytes().to_vec()
}

fn decode(message: &MavMessage) -> Vec<VehicleMsg> {
    Codec::new(SYSTEM, SYSTEM).decode(&from(SYSTEM, 1, message))
}

fn parse(bytes: &[u8]) -> MavMessage {
    let frames = framing::frames(bytes);
    assert_eq!(frames.len(), 1);
    assert_eq!((frames[0].header.system_id, frames[0].header.component_id), (SYSTEM.into(), 191));
    frames[0].parse().unwrap()
}

fn sent(command: &VehicleCmd) -> MavMessage {
    parse(&Codec::new(SYSTEM, SYSTEM).encode(command, 1234))
}

fn landed() -> MavMessage {
    MavMessage::EXTENDED_SYS_STATE(m::EXTENDED_SYS_STATE_DATA {
        landed_state: m::MavLandedState::MAV_LANDED_STATE_IN_AIR,
        ..Default::default()
    })
}

#[test]
fn only_the_autopilot_of_the_target_system_is_heard() {
    let codec = Codec::new(SYSTEM, SYSTEM);
    let heard = |system, component| !codec.decode(&from(system, component, &landed())).is_empty();
    assert!(heard(7, 1));
    assert!(!heard(8, 1), "another vehicle");
    assert!(!heard(7, 191), "another companion computer");
    assert!(!heard(255, 190), "a ground station");
}

#[test]
fn rates_are_frd_with_mask_128() {
    let setpoint = Setpoint { rates: Vec3::new(0.1, 0.2, 0.3), thrust: 0.5 };
    let MavMessage::SET_ATTITUDE_TARGET(data) = sent(&VehicleCmd::Rates(setpoint)) else { panic!() };
    assert_eq!(data.type_mask.bits(), 128);
    assert_eq!([data.body_roll_rate, data.body_pitch_rate, data.body_yaw_rate], [0.1, -0.2, -0.3]);
    assert_eq!((data.thrust, data.q, data.time_boot_ms), (0.5, [1.0, 0.0, 0.0, 0.0], 1234));
    assert_eq!((data.target_system, data.target_component), (SYSTEM, 1));
}

#[test]
fn numbers_that_are_not_finite_are_never_sent() {
    let mut codec = Codec::new(SYSTEM, SYSTEM);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for at in 0..4 {
            let mut setpoint = Setpoint { rates: Vec3::zeros(), thrust: 0.5 };
            match at {
                3 => setpoint.thrust = bad,
                axis => setpoint.rates[axis] = bad,
            }
            assert!(codec.encode(&VehicleCmd::Rates(setpoint), 0).is_empty());
        }
    }
}

#[test]
fn commands_carry_their_numbers() {
    let long = |command: VehicleCmd| match sent(&command) {
        MavMessage::COMMAND_LONG(d) => (d.command as u32, d.param1, d.param2, d.param3),
        other => panic!("{other:?}"),
    };
    let mode = |mode| long(VehicleCmd::SetMode { mode });
    assert_eq!(mode(VehicleMode::Offboard), (176, 1.0, 6.0, 0.0));
    assert_eq!(mode(VehicleMode::Land), (176, 1.0, 4.0, 6.0));
    assert_eq!(mode(VehicleMode::Loiter), (176, 1.0, 4.0, 3.0));
    assert_eq!(mode(VehicleMode::Other(3 << 16)), (176, 1.0, 3.0, 0.0));
    assert_eq!(long(VehicleCmd::Arm { arm: true, force: false }), (400, 1.0, 0.0, 0.0));
    assert_eq!(long(VehicleCmd::Arm { arm: false, force: true }), (400, 0.0, 21196.0, 0.0));
    let ids = [
        (Stream::Attitude, 31.0),
        (Stream::LocalPosition, 32.0),
        (Stream::Odometry, 331.0),
        (Stream::Landed, 245.0),
        (Stream::Battery, 1.0),
        (Stream::Origin, 49.0),
    ];
    for (stream, id) in ids {
        assert_eq!(long(VehicleCmd::Interval { stream, period_us: 10_000 }), (511, id, 10_000.0, 0.0));
        assert_eq!(long(VehicleCmd::Request { stream }), (512, id, 0.0, 0.0));
    }
    let MavMessage::PARAM_REQUEST_READ(data) = sent(&VehicleCmd::ReadParam { name: "COM_OBL_RC_ACT".into() })
    else {
        panic!()
    };
    assert_eq!((data.param_id.to_str().unwrap(), data.param_index), ("COM_OBL_RC_ACT", -1));
}

#[test]
fn the_sequence_number_rises() {
    let mut codec = Codec::new(SYSTEM, SYSTEM);
    let sequences: Vec<u8> = (0..300).map(|_| codec.encode(&VehicleCmd::Heartbeat, 0)[4]).collect();
    assert!(sequences.windows(2).all(|w| w[1] == w[0].wrapping_add(1)));
}

#[test]
fn modes_follow_the_autopilot() {
    let heartbeat = |custom_mode, base_mode| {
        decode(&MavMessage::HEARTBEAT(m::HEARTBEAT_DATA {
            custom_mode,
            mavtype: m::MavType::MAV_TYPE_QUADROTOR,
            autopilot: m::MavAutopilot::MAV_AUTOPILOT_PX4,
            base_mode: m::MavModeFlag::from_bits_truncate(base_mode),
            system_status: m::MavState::MAV_STATE_CRITICAL,
            mavlink_version: 3,
        }))
    };
    let expect = |armed, mode| vec![VehicleMsg::Heartbeat { armed, mode, system_status: 5 }];
    assert_eq!(heartbeat(6 << 16, 129), expect(true, VehicleMode::Offboard));
    assert_eq!(heartbeat(4 << 16 | 6 << 24, 1), expect(false, VehicleMode::Land));
    assert_eq!(heartbeat(4 << 16 | 3 << 24, 1), expect(false, VehicleMode::Loiter));
    assert_eq!(heartbeat(3 << 16, 1), expect(false, VehicleMode::Other(3 << 16)));
}

#[test]
fn integer_parameters_are_bit_patterns() {
    let param = |param_value, param_type| {
        decode(&MavMessage::PARAM_VALUE(m::PARAM_VALUE_DATA {
            param_value,
            param_type,
            param_id: "COM_OBL_RC_ACT".into(),
            param_count: 1,
            param_index: 0,
        }))
    };
    let expect = |value| vec![VehicleMsg::Param { name: "COM_OBL_RC_ACT".into(), value }];
    use m::MavParamType as T;
    assert_eq!(param(f32::from_bits(5), T::MAV_PARAM_TYPE_INT32), expect(5.0));
    assert_eq!(param(f32::from_bits((-3_i32) as u32), T::MAV_PARAM_TYPE_INT32), expect(-3.0));
    assert_eq!(param(f32::from_bits(0xff), T::MAV_PARAM_TYPE_INT8), expect(-1.0));
    assert_eq!(param(0.5, T::MAV_PARAM_TYPE_REAL32), expect(0.5));
    assert_eq!(param(f32::NAN, T::MAV_PARAM_TYPE_REAL32), vec![]);
}

#[test]
fn acknowledgements_of_others_are_not_ours() {
    let ack = |command, target_system, target_component| {
        decode(&MavMessage::COMMAND_ACK(m::COMMAND_ACK_DATA {
            command,
            result: m::MavResult::MAV_RESULT_TEMPORARILY_REJECTED,
            target_system,
            target_component,
            ..Default::default()
        }))
    };
    let expect = |request| vec![VehicleMsg::Ack { request, result: 1 }];
    use m::MavCmd as C;
    assert_eq!(ack(C::MAV_CMD_COMPONENT_ARM_DISARM, SYSTEM, 191), expect(Some(VehicleRequest::Arm)));
    assert_eq!(ack(C::MAV_CMD_DO_SET_MODE, 0, 0), expect(Some(VehicleRequest::Mode)));
    assert_eq!(ack(C::MAV_CMD_COMPONENT_ARM_DISARM, 255, 190), expect(None));
    assert_eq!(ack(C::MAV_CMD_NAV_LAND, SYSTEM, 191), expect(None));
}

#[test]
fn a_timesync_request_is_answered_and_an_answer_is_not() {
    let mut codec = Codec::new(SYSTEM, SYSTEM);
    let sync = |tc1, ts1| {
        from(SYSTEM, 1, &MavMessage::TIMESYNC(m::TIMESYNC_DATA { tc1, ts1, ..Default::default() }))
    };
    let replies = codec.timesync_replies(&sync(0, 555), 777);
    assert_eq!(replies.len(), 1);
    let MavMessage::TIMESYNC(reply) = parse(&replies[0]) else { panic!() };
    assert_eq!((reply.tc1, reply.ts1), (777, 555));
    assert!(codec.timesync_replies(&sync(9, 555), 777).is_empty());
}

#[test]
fn unknown_battery_values_are_none() {
    let status = MavMessage::SYS_STATUS(m::SYS_STATUS_DATA {
        voltage_battery: u16::MAX,
        battery_remaining: -1,
        onboard_control_sensors_health: m::MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK,
        ..Default::default()
    });
    let expect = VehicleMsg::Battery { remaining: None, voltage: None, prearm_ok: true };
    assert_eq!(decode(&status), vec![expect]);
}

proptest! {
    #[test]
    fn decode_takes_any_bytes(bytes in proptest::collection::vec(any::<u8>(), 0..600)) {
        let _ = Codec::new(1, 1).decode(&bytes);
        let _ = Codec::new(1, 1).timesync_replies(&bytes, 5);
    }

    /// Valid frames with random payloads: no message holds a number that is not finite.
    #[test]
    fn random_payloads_give_finite_messages(
        id in prop::sample::select(vec![31_u32, 32, 331, 49, 22, 1, 0]),
        payload in proptest::collection::vec(any::<u8>(), 0..60),
    ) {
        if let Ok(message) = <MavMessage as mavlink::Message>::parse(mavlink::MavlinkVersion::V2, id, &payload) {
            for heard in decode(&message) {
                prop_assert!(fleet_core::wire::encode(&heard).is_ok(), "{:?}", heard);
            }
        }
    }

    #[test]
    fn a_pose_survives_the_frames(
        p in prop::array::uniform3(-50.0_f32..50.0),
        rates in prop::array::uniform3(-5.0_f32..5.0),
        (roll, pitch, yaw) in (-3.0..3.0_f64, -1.5..1.5_f64, -3.0..3.0_f64),
    ) {
        let frd_to_ned = Quat::from_euler_angles(roll, pitch, yaw);
        let heard = decode(&MavMessage::ATTITUDE_QUATERNION(m::ATTITUDE_QUATERNION_DATA {
            time_boot_ms: 5,
            q1: frd_to_ned.w as f32, q2: frd_to_ned.i as f32, q3: frd_to_ned.j as f32, q4: frd_to_ned.k as f32,
            rollspeed: rates[0], pitchspeed: rates[1], yawspeed: rates[2],
            repr_offset_q: [0.0; 4],
        }));
        let VehicleMsg::Attitude { q, w, .. } = &heard[0] else { panic!() };
        // The nose's height above the horizon is sin(pitch) in every frame.
        prop_assert!(((q * Vec3::x()).z - pitch.sin()).abs() < 1e-6);
        // A compass counts clockwise from north, mathematics counter-clockwise from east.
        let nose = q * Vec3::x();
        let heading = nose.y.atan2(nose.x);
        let expected = std::f64::consts::FRAC_PI_2 - yaw;
        prop_assert!(((heading - expected).sin()).abs() < 1e-5 && (heading - expected).cos() > 0.0);
        prop_assert_eq!([w.x, -w.y, -w.z], rates.map(f64::from));
        let heard = decode(&MavMessage::LOCAL_POSITION_NED(m::LOCAL_POSITION_NED_DATA {
            time_boot_ms: 5, x: p[0], y: p[1], z: p[2], vx: p[1], vy: p[2], vz: p[0],
        }));
        let VehicleMsg::LocalPosition { p: enu, v, .. } = &heard[0] else { panic!() };
        prop_assert_eq!([enu.y, enu.x, -enu.z], p.map(f64::from));
        prop_assert_eq!([v.y, v.x, -v.z], [p[1], p[2], p[0]].map(f64::from));
    }
}
