//! The behaviour measured on PX4, row by row.

use super::*;
use crate::plant::{Airframe, Plant};
use mavlink::MavHeader;
use mavlink::dialects::common::*;

const LINK: LinkId = LinkId(1);
const STEP: u64 = 1_000_000;
const RATES: u8 = 128;

struct Bench {
    plant: Plant,
    autopilot: Autopilot,
    now: Nanos,
    heard: Vec<MavMessage>,
    /// Rates FRD, thrust, mask, sent every 10 ms.
    stream: Option<([f32; 3], f32, u8)>,
}

impl Bench {
    fn new(overrides: &[(&str, f64)]) -> Self {
        let mut params = Params::new(5);
        for (name, value) in overrides {
            params.set_by_name(name, *value).unwrap();
        }
        let plant = Plant::new(Airframe::F450, Vec3::new(3.0, -2.0, 0.2), 0.4);
        let autopilot = Autopilot::new(5, plant.truth(), params, 7_000_000_000);
        let mut bench = Self { plant, autopilot, now: Nanos(0), heard: vec![], stream: None };
        bench.autopilot.open_link(Nanos(0), LINK);
        bench
    }

    /// Armed in OFFBOARD and hovering some metres up.
    fn flying(overrides: &[(&str, f64)]) -> Self {
        let mut bench = Self::new(overrides);
        bench.run(1.5);
        bench.stream = Some(([0.0; 3], 0.6, RATES));
        bench.run(0.1);
        assert_eq!(bench.mode(6, 0), 0);
        assert_eq!(bench.arm(1.0, 0.0), 0);
        bench.run(0.8);
        let hover = bench.plant.airframe().hover_thrust();
        for _ in 0..300 {
            let thrust = hover * (1.0 - 0.3 * bench.plant.truth().v.z);
            bench.stream = Some(([0.0; 3], thrust as f32, RATES));
            bench.run(0.01);
        }
        bench.stream = Some(([0.0; 3], hover as f32, RATES));
        assert!(bench.height() > 2.0 && bench.plant.truth().v.norm() < 0.05);
        bench
    }

    fn run(&mut self, seconds: f64) {
        for _ in 0..(seconds * 1e3).round() as u64 {
            if let (Some((rates, thrust, mask)), 0) = (self.stream, self.now.0 % 10_000_000) {
                self.setpoint(rates, thrust, mask, 5);
            }
            let motors = self.autopilot.step(self.now, self.plant.truth());
            self.plant.step(motors, &Vec3::zeros(), &Vec3::zeros(), DT);
            self.now.0 += STEP;
            self.collect();
        }
    }

    fn collect(&mut self) {
        for outgoing in self.autopilot.take_outgoing() {
            match outgoing.body {
                OutgoingBody::Message(message) => self.heard.push(*message),
                OutgoingBody::UnknownCommand { .. } => panic!("no unknown command was sent"),
            }
        }
    }

    fn say(&mut self, message: MavMessage) {
        let from = MavHeader { system_id: 245, component_id: 190, sequence: 0 };
        self.autopilot.on_message(self.now, LINK, &from, &message);
        self.collect();
    }

    fn setpoint(&mut self, rates: [f32; 3], thrust: f32, mask: u8, target: u8) {
        self.say(MavMessage::SET_ATTITUDE_TARGET(SET_ATTITUDE_TARGET_DATA {
            q: [1.0, 0.0, 0.0, 0.0],
            body_roll_rate: rates[0],
            body_pitch_rate: rates[1],
            body_yaw_rate: rates[2],
            thrust,
            target_system: target,
            target_component: 1,
            type_mask: AttitudeTargetTypemask::from_bits(mask).unwrap(),
            ..SET_ATTITUDE_TARGET_DATA::DEFAULT
        }));
    }

    /// Sends a command and gives the result of its acknowledgement.
    fn command(&mut self, command: MavCmd, p: [f32; 3]) -> u8 {
        self.heard.clear();
        self.say(MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
            param1: p[0],
            param2: p[1],
            param3: p[2],
            command,
            target_system: 5,
            target_component: 1,
            ..COMMAND_LONG_DATA::DEFAULT
        }));
        let ack = self.heard.iter().find_map(|m| match m {
            MavMessage::COMMAND_ACK(ack) => Some(ack.clone()),
            _ => None,
        });
        let ack = ack.expect("every command is answered");
        assert_eq!((ack.target_system, ack.target_component), (245, 190), "to who asked");
        assert_eq!(ack.command, command);
        ack.result as u8
    }

    fn mode(&mut self, main: u8, sub: u8) -> u8 {
        self.command(MavCmd::MAV_CMD_DO_SET_MODE, [1.0, f32::from(main), f32::from(sub)])
    }

    fn arm(&mut self, arm: f32, magic: f32) -> u8 {
        self.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [arm, magic, 0.0])
    }

    fn actual(&self) -> FlightMode {
        self.autopilot.commander().actual()
    }

    fn armed(&self) -> bool {
        self.autopilot.commander().armed()
    }

    fn height(&self) -> f64 {
        self.plant.truth().p.z - 0.2
    }

    /// Runs until `done`, at most `limit` seconds, and gives how long it took [s].
    fn until(&mut self, limit: f64, done: impl Fn(&Self) -> bool) -> f64 {
        let start = self.now;
        while !done(self) {
            assert!(self.now.since(start) < limit, "did not happen within {limit} s");
            self.run(1e-3);
        }
        self.now.since(start)
    }

    fn last_heartbeat(&mut self) -> HEARTBEAT_DATA {
        self.heard.clear();
        self.run(1.001);
        let mut beats = self.heard.iter().filter_map(|m| match m {
            MavMessage::HEARTBEAT(beat) => Some(beat.clone()),
            _ => None,
        });
        let beat = beats.next_back().expect("a heartbeat a second");
        assert!(beats.count() <= 1);
        beat
    }
}

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
