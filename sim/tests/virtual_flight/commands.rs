//! Commands in flight from another ground session, and a pilot: over the wire's bytes.

use crate::{plan, world};
use fleet_core::geometry::Polyhedron;
use fleet_core::types::{Nanos, Vec3};
use fleet_core::wire::{
    AckResult, Command, Down, Envelope, EventKind, Mode, Plan, Region, RejectCode, SCHEMA, Up, encode,
};
use fleet_sim::autopilot::{LinkId, Params};
use fleet_sim::framing::deliver;
use fleet_sim::virtual_time::{EPOCH, VirtualFlight};
use fleet_sim::world::{End, WorldConfig};
use mavlink::dialects::common::{COMMAND_LONG_DATA, MavCmd, MavMessage};
use mavlink::{MAVLinkV2MessageRaw, MavHeader};

/// A pillar between the drones' ways, which go from (0, 0) and (8, 0) 6 m along y and up.
const PILLAR: [Vec3; 2] = [Vec3::new(2.0, 1.0, -0.5), Vec3::new(4.0, 2.0, 6.0)];
const PILLAR_TOML: &str = "[[obstacle]]\nname = \"pillar\"\nfaces = [\n\
    { a = [1.0, 0.0, 0.0], b = 4.0 }, { a = [-1.0, 0.0, 0.0], b = -2.0 },\n\
    { a = [0.0, 1.0, 0.0], b = 2.0 }, { a = [0.0, -1.0, 0.0], b = -1.0 },\n\
    { a = [0.0, 0.0, 1.0], b = 6.0 }, { a = [0.0, 0.0, -1.0], b = 0.5 },\n]\n";

/// A flight with what was heard so far.
struct Session {
    flight: VirtualFlight,
    plan: Plan,
    /// Mission time and content of everything but telemetry and heartbeats.
    heard: Vec<(f64, Up)>,
    pillar: Polyhedron,
    /// Least distance of any drone to the pillar so far [m].
    clearance: f64,
}

impl Session {
    fn new(config: &WorldConfig) -> Self {
        let pillar = Polyhedron::from_box(PILLAR[0], PILLAR[1]).unwrap();
        let mut plan = plan::plan();
        plan.regions.push(Region { name: "pillar".into(), shape: pillar.clone() });
        plan.obstacles.push("pillar".into());
        let flight = VirtualFlight::new(config, plan.clone()).unwrap();
        Self { flight, plan, heard: Vec::new(), pillar, clearance: f64::INFINITY }
    }

    /// Flies a calm world to mission time `t`.
    fn at(t: f64) -> Self {
        let mut session = Self::new(&world(1, 5, PILLAR_TOML));
        session.run_while(60.0, |s| s.flight.mission_time().is_none_or(|now| now < t));
        session
    }

    fn step(&mut self) {
        let published = self.flight.step(None).unwrap();
        let t = self.flight.mission_time().unwrap_or(f64::NAN);
        let kept = |up: &Up| !matches!(up, Up::Heartbeat(_) | Up::Telemetry(_));
        self.heard.extend(published.into_iter().filter(kept).map(|up| (t, up)));
        for vehicle in self.flight.world().vehicles() {
            self.clearance = self.clearance.min(self.pillar.outside(&vehicle.truth().p));
        }
    }

    fn run_while(&mut self, patience: f64, goes_on: impl Fn(&Self) -> bool) {
        let end = self.flight.now().plus(patience);
        while goes_on(self) {
            assert!(self.flight.now() < end, "not within {patience} s; {:?}", self.modes("d1"));
            self.step();
        }
    }

    fn run(&mut self, seconds: f64) {
        let end = self.flight.now().plus(seconds);
        self.run_while(seconds + 1.0, |s| s.flight.now() < end);
    }

    /// Commands one drone as a session that only asked it for its status; gives its one answer.
    fn command(&mut self, drone: &str, command: Command) -> AckResult {
        let status = self.flight.status(drone).unwrap().clone();
        let now = self.flight.now();
        let envelope = Envelope {
            schema: SCHEMA,
            mission_id: status.mission_id,
            epoch: status.epoch,
            seq: status.seq + 1,
            issued: now,
            valid_until: now.plus(5.0),
            body: Down::Command(command),
        };
        let before = self.heard.len();
        assert!(self.flight.send(drone, encode(&envelope).unwrap()));
        self.run(0.3);
        let mut answers = self.heard[before..].iter().filter_map(|(_, up)| match up {
            Up::Ack(ack) if ack.drone == drone => Some(ack),
            _ => None,
        });
        let answer = answers.next().unwrap().clone();
        assert_eq!(answers.next(), None, "exactly one answer");
        assert_eq!((answer.epoch, answer.seq), (envelope.epoch, envelope.seq));
        answer.outcome
    }

    /// Modes that a drone went through, in order.
    fn modes(&self, drone: &str) -> Vec<Mode> {
        let to = |(_, up): &(f64, Up)| match up {
            Up::Event(event) if event.drone == drone => match event.kind {
                EventKind::Mode { to, .. } => Some(to),
                _ => None,
            },
            _ => None,
        };
        self.heard.iter().filter_map(to).collect()
    }

    /// Flies on until both drones are down; both must have landed, clear of each other's way.
    fn land(&mut self) {
        self.run_while(150.0, |s| !s.flight.is_over());
        for vehicle in self.flight.world().vehicles() {
            assert_eq!(vehicle.end(), End::Landed, "{}", vehicle.id());
            assert!(!vehicle.armed());
        }
        assert!(self.clearance > 0.5, "{} m from the pillar", self.clearance);
    }

    fn away_from_pad(&self, drone: usize) -> f64 {
        let p = self.flight.world().vehicles()[drone].truth().p;
        (p - self.plan.drones[drone].pad.p).xy().norm()
    }
}

const UP: [Mode; 3] = [Mode::Armed, Mode::Takeoff, Mode::Track];

fn modes(rest: &[Mode]) -> Vec<Mode> {
    UP.iter().chain(rest).copied().collect()
}

#[test]
fn hold_resume_and_land_from_another_session() {
    let mut session = Session::at(3.0);
    assert_eq!(session.command("d1", Command::Hold), AckResult::Accepted);
    session.run(3.0);
    assert!(session.flight.world().vehicles()[0].truth().v.norm() < 0.05, "it hovers");
    assert_eq!(session.command("d1", Command::Resume), AckResult::Accepted);
    session.run_while(2.0, |s| s.modes("d1").last() != Some(&Mode::Track));
    // Back on the plan from the topic waypoint on.
    session.run_while(10.0, |s| s.flight.mission_time().is_some_and(|t| t < 12.0));
    let p = session.flight.world().vehicles()[0].truth().p;
    let away = (p - session.plan.drones[0].trajectory.position(12.0)).norm();
    assert!(away < 0.1, "{away} m from the plan");
    assert_eq!(session.command("d1", Command::Land), AckResult::Accepted);
    session.land();
    assert_eq!(session.modes("d1"), modes(&[Mode::Hold, Mode::Track, Mode::Land, Mode::Idle]));
    assert_eq!(session.modes("d2"), modes(&[Mode::Land, Mode::Idle]), "the other flies on");
    assert!(session.away_from_pad(0) > 1.0, "it landed where it was");
    assert!(session.away_from_pad(1) < 0.3);
}

#[test]
fn return_flies_home_and_lands_on_the_pad() {
    let mut session = Session::at(8.0);
    for drone in ["d1", "d2"] {
        assert_eq!(session.command(drone, Command::Return), AckResult::Accepted);
    }
    let AckResult::Rejected { code, .. } = session.command("d1", Command::Resume) else {
        panic!("return latches")
    };
    assert_eq!(code, RejectCode::Mode);
    session.land();
    for (i, drone) in ["d1", "d2"].into_iter().enumerate() {
        assert_eq!(session.modes(drone), modes(&[Mode::Return, Mode::Land, Mode::Idle]));
        assert!(session.away_from_pad(i) < 0.3, "{} m", session.away_from_pad(i));
    }
}

#[test]
fn abort_comes_down_disarms_and_is_latched_until_disarm() {
    let mut session = Session::at(5.0);
    assert_eq!(session.command("d1", Command::Abort), AckResult::Accepted);
    session.land();
    assert_eq!(session.modes("d1"), modes(&[Mode::Abort]));
    let AckResult::Rejected { code, .. } = session.command("d1", Command::Arm) else {
        panic!("abort latches")
    };
    assert_eq!(code, RejectCode::Mode);
    assert_eq!(session.command("d1", Command::Disarm), AckResult::Accepted);
    assert_eq!(session.modes("d1"), modes(&[Mode::Abort, Mode::Idle]));
}

/// DO_SET_MODE from a pilot's ground station: PX4's main mode 4 (auto), sub-mode 3 (loiter).
fn pilot_takes(session: &mut Session, system: u8) {
    let command = COMMAND_LONG_DATA {
        command: MavCmd::MAV_CMD_DO_SET_MODE,
        target_system: system,
        target_component: 1,
        param1: 1.0,
        param2: 4.0,
        param3: 3.0,
        ..COMMAND_LONG_DATA::DEFAULT
    };
    let mut raw = MAVLinkV2MessageRaw::new();
    let header = MavHeader { system_id: 255, component_id: 190, sequence: 0 };
    raw.serialize_message(header, &MavMessage::COMMAND_LONG(command));
    let now = Nanos(session.flight.now().0 - EPOCH);
    let mut vehicles = session.flight.world_mut().vehicles_mut().iter_mut();
    let vehicle = vehicles.find(|v| v.autopilot().system() == system).unwrap();
    deliver(vehicle.autopilot_mut(), now, LinkId(7), raw.raw_bytes());
}

#[test]
fn a_pilot_who_leaves_offboard_is_left_alone_until_resume() {
    let mut session = Session::at(5.0);
    pilot_takes(&mut session, 101);
    session.run_while(0.5, |s| s.modes("d1").last() != Some(&Mode::Released));
    session.run(0.1);
    // With PX4's default parameters a setpoint is fresh for 1 s; none comes any more.
    let defaults = Params::new(101);
    let fresh = |s: &Session| {
        let now = Nanos(s.flight.now().0 - EPOCH);
        s.flight.world().vehicles()[0].autopilot().commander().stream_fresh(now, &defaults)
    };
    assert!(fresh(&session));
    session.run(1.1);
    for _ in 0..30 {
        assert!(!fresh(&session), "the agent goes on streaming");
        session.run(0.1);
    }
    assert!(session.flight.world().vehicles()[0].armed(), "the pilot flies");
    let AckResult::Rejected { code, .. } = session.command("d1", Command::Land) else {
        panic!("the pilot has it")
    };
    assert_eq!(code, RejectCode::Mode);
    assert_eq!(session.command("d1", Command::Resume), AckResult::Accepted);
    session.run(3.0);
    assert!(fresh(&session), "held on our rates again");
    assert_eq!(session.command("d1", Command::Return), AckResult::Accepted);
    session.land();
    let flown = [Mode::Released, Mode::Hold, Mode::Return, Mode::Land, Mode::Idle];
    assert_eq!(session.modes("d1"), modes(&flown));
}

#[test]
fn arming_is_refused_with_the_parameter_that_is_wrong() {
    for (parameter, value) in [("COM_OF_LOSS_T", 1.0), ("COM_OBL_RC_ACT", 0.0)] {
        let mut config = world(1, 5, "");
        config.vehicles[0].params.insert(parameter.to_owned(), value);
        let mut session = Session::new(&config);
        // The script commits the plan, then waits for pre-flight; another session does not wait.
        session.run_while(10.0, |s| s.flight.status("d1").is_none_or(|status| status.hash.is_empty()));
        session.run(3.0);
        let AckResult::Rejected { code, reason } = session.command("d1", Command::Arm) else {
            panic!("{parameter} = {value} is no reason")
        };
        assert_eq!(code, RejectCode::Preflight);
        assert!(reason.contains(&format!("{parameter} is {value}")), "{reason}");
        assert!(!session.flight.world().vehicles()[0].was_armed());
    }
}
