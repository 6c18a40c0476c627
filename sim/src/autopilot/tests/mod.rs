//! The behaviour measured on PX4, row by row: the bench that the rows run on.

mod flight;
mod protocol;
mod setpoints;

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
