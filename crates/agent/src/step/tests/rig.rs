//! A vehicle that follows body rates perfectly, an autopilot that obeys, and a ground station.

use super::plans::plan;
use crate::io::{Input, Output, VehicleCmd, VehicleMode, VehicleMsg, VehicleRequest};
use crate::step::{Agent, AgentConfig};
use fleet_core::replan::Replanner;
use fleet_core::types::{GRAVITY, Nanos, Quat, Setpoint, Vec3};
use fleet_core::wire::{
    AckResult, Command, Commit, Down, Envelope, Event, EventKind, Mode, Offer, Plan, RejectCode, SCHEMA, Up,
    encode, plan_hash,
};

pub const MISSION: &str = "00112233445566778899aabbccddeeff";
pub const DT: u64 = 10_000_000;

/// A point mass with attitude; thrust is proportional to the setpoint.
pub struct Body {
    pub p: Vec3,
    pub v: Vec3,
    pub q: Quat,
    pub pad: Vec3,
    pub hover: f64,
    /// Disturbance [m/s^2].
    pub push: Vec3,
    pub setpoint: Setpoint,
    pub armed: bool,
    pub mode: VehicleMode,
    pub params: [f64; 2],
}

impl Body {
    fn advance(&mut self, dt: f64) {
        let (rates, thrust) = match (self.armed, self.mode) {
            (false, _) => (Vec3::zeros(), 0.0),
            (true, VehicleMode::Land) => {
                (Vec3::zeros(), (self.hover * (1.0 + (-0.7 - self.v.z) * 2.0 / GRAVITY)).clamp(0.0, 1.0))
            }
            (true, _) => (self.setpoint.rates, self.setpoint.thrust),
        };
        self.q *= Quat::from_scaled_axis(rates * dt);
        let lift = self.q * Vec3::new(0.0, 0.0, GRAVITY * thrust / self.hover);
        let a = lift - Vec3::new(0.0, 0.0, GRAVITY) + self.push;
        self.p += self.v * dt + a * (0.5 * dt * dt);
        self.v += a * dt;
        if self.p.z <= self.pad.z && self.v.z <= 0.0 {
            (self.p.z, self.v) = (self.pad.z, Vec3::zeros());
            if self.mode == VehicleMode::Land {
                self.armed = false;
            }
        }
    }

    fn answer(&mut self, command: &VehicleCmd) -> Option<VehicleMsg> {
        let accepted = |request| Some(VehicleMsg::Ack { request: Some(request), result: 0 });
        match command {
            VehicleCmd::Rates(setpoint) => {
                self.setpoint = *setpoint;
                None
            }
            VehicleCmd::SetMode { mode } => {
                self.mode = *mode;
                accepted(VehicleRequest::Mode)
            }
            VehicleCmd::Arm { arm, .. } => {
                self.armed = *arm;
                accepted(VehicleRequest::Arm)
            }
            VehicleCmd::ReadParam { name } => {
                let value = self.params[usize::from(name == "COM_OBL_RC_ACT")];
                Some(VehicleMsg::Param { name: name.clone(), value })
            }
            VehicleCmd::Heartbeat | VehicleCmd::Interval { .. } | VehicleCmd::Request { .. } => None,
        }
    }
}

/// One agent with its vehicle.
pub struct Rig {
    pub agent: Agent,
    pub body: Body,
    pub now: Nanos,
    pub inbox: Vec<Input>,
    pub plan: Plan,
    pub seq: u64,
    pub epoch: u64,
    /// Everything published.
    pub published: Vec<Up>,
    /// Bytes of every outbox, for comparison.
    pub bytes: Vec<u8>,
    /// Requests to the solver with the time of their answer.
    pub solves: Vec<(Nanos, crate::SolveRequest)>,
    /// How long the solver takes; none: it never answers.
    pub solver: Option<f64>,
    /// Number of requests to the solver.
    pub requests: usize,
    /// Largest deviation while tracking.
    pub worst: f64,
    /// Whether the state messages arrive.
    pub sensing: bool,
    pub setpoints: Vec<Setpoint>,
}

impl Rig {
    pub fn new(hover: f64, plan: Plan) -> Self {
        Self::with(AgentConfig::new("fleet", "d1"), hover, plan)
    }

    pub fn with(config: AgentConfig, hover: f64, plan: Plan) -> Self {
        let pad = plan.drones[0].pad.p;
        Self {
            agent: Agent::new(config),
            body: Body {
                p: pad,
                v: Vec3::zeros(),
                q: Quat::identity(),
                pad,
                hover,
                push: Vec3::zeros(),
                setpoint: Setpoint { rates: Vec3::zeros(), thrust: 0.0 },
                armed: false,
                mode: VehicleMode::Loiter,
                params: [0.5, 5.0],
            },
            now: Nanos(1_000_000_000),
            inbox: Vec::new(),
            plan,
            seq: 0,
            epoch: 1,
            published: Vec::new(),
            bytes: Vec::new(),
            solves: Vec::new(),
            solver: Some(0.02),
            requests: 0,
            worst: 0.0,
            sensing: true,
            setpoints: Vec::new(),
        }
    }

    /// One drone on a pad, plan committed, armed; start set `ahead` seconds from now.
    pub fn started(hover: f64, ahead: f64) -> Self {
        let mut rig = Self::new(hover, plan(&[("d1", Vec3::new(1.0, 2.0, 0.1))]));
        rig.run(2.5);
        rig.commit();
        assert_eq!(rig.command(Command::Arm), AckResult::Accepted);
        rig.run(1.2);
        assert_eq!(rig.agent.mode, Mode::Armed);
        let start = rig.start_command(ahead);
        assert_eq!(rig.command(start), AckResult::Accepted);
        rig
    }

    pub fn start_command(&self, ahead: f64) -> Command {
        Command::Start { t0: self.now.plus(ahead), hash: self.hash() }
    }

    pub fn plan_bytes(&self) -> Vec<u8> {
        encode(&self.plan).expect("encodes")
    }

    pub fn hash(&self) -> String {
        plan_hash(&self.plan_bytes())
    }

    /// Offers and commits the plan.
    pub fn commit(&mut self) {
        let (hash, plan) = (self.hash(), self.plan_bytes());
        assert_eq!(self.ask(Down::Offer(Offer { hash: hash.clone(), plan })), AckResult::Accepted);
        assert_eq!(self.ask(Down::Commit(Commit { hash })), AckResult::Accepted);
    }

    pub fn command(&mut self, command: Command) -> AckResult {
        self.ask(Down::Command(command))
    }

    pub fn envelope(&mut self, body: Down) -> Envelope<Down> {
        self.seq += 1;
        Envelope {
            schema: SCHEMA,
            mission_id: MISSION.into(),
            epoch: self.epoch,
            seq: self.seq,
            issued: self.now,
            valid_until: self.now.plus(5.0),
            body,
        }
    }

    /// Sends one message and gives its one answer.
    pub fn ask(&mut self, body: Down) -> AckResult {
        let envelope = self.envelope(body);
        self.send(&envelope)
    }

    pub fn send(&mut self, envelope: &Envelope<Down>) -> AckResult {
        self.send_bytes(encode(envelope).expect("encodes"))
    }

    pub fn send_bytes(&mut self, bytes: Vec<u8>) -> AckResult {
        let before = self.published.len();
        self.inbox.push(Input::Ground { bytes });
        self.run(0.03);
        let mut answers = self.published[before..].iter().filter_map(|up| match up {
            Up::Ack(ack) => Some(ack.outcome.clone()),
            _ => None,
        });
        let answer = answers.next().expect("an answer");
        assert_eq!(answers.next(), None, "exactly one answer");
        answer
    }

    pub fn run(&mut self, seconds: f64) {
        let end = self.now.plus(seconds);
        while self.now < end {
            self.tick();
        }
    }

    pub fn run_until(&mut self, mode: Mode, patience: f64) {
        let end = self.now.plus(patience);
        while self.agent.mode != mode {
            assert!(self.now < end, "still {:?} after {patience} s; {:?}", self.agent.mode, self.faults());
            self.tick();
        }
    }

    fn sense(&mut self) {
        let k = self.now.0 / DT;
        if self.sensing {
            let boot_ms = (self.now.0 / 1_000_000) as u32;
            let w = if self.body.armed { self.body.setpoint.rates } else { Vec3::zeros() };
            let attitude = VehicleMsg::Attitude { boot_ms, q: self.body.q, w };
            self.inbox.push(Input::Vehicle(attitude));
            let (p, v) = (self.body.p - self.body.pad, self.body.v);
            self.inbox.push(Input::Vehicle(VehicleMsg::LocalPosition { boot_ms, p, v }));
        }
        let mode = self.body.mode;
        if k.is_multiple_of(20) {
            self.vehicle(VehicleMsg::Battery { remaining: Some(0.9), voltage: None, prearm_ok: true });
            let on_ground = self.body.p.z <= self.body.pad.z;
            self.vehicle(VehicleMsg::Landed { on_ground });
            self.vehicle(VehicleMsg::Mode { actual: mode, intended: mode });
        }
        if k.is_multiple_of(50) {
            self.vehicle(VehicleMsg::Heartbeat { armed: self.body.armed, mode, system_status: 4 });
        }
    }

    pub fn vehicle(&mut self, message: VehicleMsg) {
        self.inbox.push(Input::Vehicle(message));
    }

    fn solve(&mut self) {
        let due = self.solves.iter().position(|(at, _)| *at <= self.now);
        if let Some((_, request)) = due.map(|i| self.solves.remove(i)) {
            let mut replanner = Replanner::new(&self.plan, "d1").expect("in the plan");
            self.inbox.push(Input::Solved(replanner.solve(&request)));
        }
    }

    pub fn tick(&mut self) {
        self.sense();
        self.solve();
        let inbox = std::mem::take(&mut self.inbox);
        let outputs = self.agent.step(self.now, &inbox);
        ciborium::into_writer(&outputs, &mut self.bytes).expect("encodes");
        for output in outputs {
            self.carry(output);
        }
        self.body.advance(DT as f64 * 1e-9);
        if self.agent.mode == Mode::Track {
            self.worst = self.worst.max(self.agent.deviation.unwrap_or(0.0));
        }
        self.now = Nanos(self.now.0 + DT);
    }

    fn carry(&mut self, output: Output) {
        match output {
            Output::Vehicle(command) => {
                if let VehicleCmd::Rates(setpoint) = command {
                    self.setpoints.push(setpoint);
                }
                if let Some(message) = self.body.answer(&command) {
                    self.vehicle(message);
                }
            }
            Output::Publish { message, .. } => self.published.push(*message),
            Output::Persist { id, .. } => self.inbox.push(Input::Persisted { id, ok: true }),
            Output::Solve(request) => {
                self.requests += 1;
                if let Some(seconds) = self.solver {
                    self.solves.push((self.now.plus(seconds), *request));
                }
            }
            Output::Status(_) | Output::Tick(_) => {}
        }
    }

    pub fn events(&self) -> impl Iterator<Item = &Event> {
        self.published.iter().filter_map(|up| match up {
            Up::Event(event) => Some(event),
            _ => None,
        })
    }

    pub fn faults(&self) -> Vec<String> {
        let text = |event: &Event| match &event.kind {
            EventKind::Fault { text } => Some(text.clone()),
            _ => None,
        };
        self.events().filter_map(text).collect()
    }
}

pub fn code(answer: AckResult) -> RejectCode {
    match answer {
        AckResult::Rejected { code, reason } => {
            assert!(reason.len() > 5, "a reason for people");
            code
        }
        AckResult::Accepted => panic!("accepted"),
    }
}
