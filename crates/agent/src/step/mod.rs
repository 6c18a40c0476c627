//! The agent as a pure function of time and messages.
//!
//! Messages change what is known at once; everything that is *done* happens on the 10 ms grid, so
//! that extra calls do no harm.

mod arming;
mod command;
mod config;
mod fly;
mod homeward;
mod mission;
mod modes;
mod offer;
mod paths;
mod peers;
mod phases;
mod preflight;
mod publish;
mod replanning;
mod touchdown;
mod vehicle;

use crate::io::{Input, Output, VehicleCmd, VehicleMsg};
pub use config::{AgentConfig, Landing, PreflightLimits, VehicleLimits};
use fleet_core::control::Controller;
use fleet_core::hover::HoverEstimator;
use fleet_core::types::{Nanos, Quat, Setpoint, Vec3};
use fleet_core::wire::{EventKind, Mode, Status};

/// Period of the control tick [ns].
const TICK: u64 = 10_000_000;
/// An estimator jump beyond this ends the flight [m]: what it stood on is not known any more.
const JUMP_MAX: f64 = 2.0;

/// The onboard logic.
#[derive(Debug)]
pub struct Agent {
    config: AgentConfig,
    mode: Mode,
    entered: Nanos,
    vehicle: vehicle::Vehicle,
    mission: mission::Mission,
    peers: peers::Peers,
    replan: replanning::Replanning,
    path: phases::Path,
    arming: Option<arming::Arming>,
    controller: Controller,
    hover: HoverEstimator,
    /// Whether this flight has left the ground.
    lifted: bool,
    /// Last request to disarm, until it is heard.
    disarming: Option<Nanos>,
    /// Last request for the autopilot's own landing.
    handing_over: Option<Nanos>,
    /// Last request to come back to offboard control.
    regaining: Option<Nanos>,
    /// Attitude that our own rates should have led to while none is measured.
    coasting: Option<Quat>,
    /// Acceleration that the last setpoint aimed at [m/s^2; ENU].
    acceleration: Vec3,
    last_setpoint: Option<Setpoint>,
    last_sent: Option<Nanos>,
    /// Last time that our own stream had a gap longer than the autopilot allows.
    gap: Option<Nanos>,
    /// Distance between state and committed reference [m].
    deviation: Option<f64>,
    state_lost: bool,
    lost_ticks: u32,
    status: Option<Status>,
    up_seq: u64,
    ticks: u64,
    next_tick: Option<Nanos>,
    last_tick: Option<Nanos>,
    out: Vec<Output>,
}

impl Agent {
    /// An idle agent.
    #[must_use]
    pub fn new(config: AgentConfig) -> Self {
        Self {
            mode: Mode::Idle,
            entered: Nanos(0),
            vehicle: vehicle::Vehicle::default(),
            mission: mission::Mission::default(),
            peers: peers::Peers::default(),
            replan: replanning::Replanning::default(),
            path: phases::Path::Ground,
            arming: None,
            controller: Controller::new(config.gains),
            hover: HoverEstimator::new(config.vehicle.hover_thrust),
            lifted: false,
            disarming: None,
            handing_over: None,
            regaining: None,
            coasting: None,
            acceleration: Vec3::zeros(),
            last_setpoint: None,
            last_sent: None,
            gap: None,
            deviation: None,
            state_lost: false,
            lost_ticks: 0,
            status: None,
            up_seq: 0,
            ticks: 0,
            next_tick: None,
            last_tick: None,
            out: Vec::new(),
            config,
        }
    }

    /// What it was made with.
    #[must_use]
    pub fn config(&self) -> &AgentConfig {
        &self.config
    }

    /// Takes the messages that have arrived and gives the ones to send. Calling it with the same
    /// times and messages gives the same answers, byte for byte.
    pub fn step(&mut self, now: Nanos, inbox: &[Input]) -> Vec<Output> {
        for input in inbox {
            self.take(now, input);
        }
        let due = *self.next_tick.get_or_insert(now);
        if now >= due {
            // Missed ticks are skipped, never made up for: an old setpoint is worth nothing.
            let missed = (now.0 - due.0) / TICK;
            self.next_tick = Some(Nanos(due.0 + (missed + 1) * TICK));
            self.tick(now);
        }
        std::mem::take(&mut self.out)
    }

    fn take(&mut self, now: Nanos, input: &Input) {
        match input {
            Input::Vehicle(message) => self.take_vehicle(now, message),
            Input::Ground { bytes } => self.take_ground(now, bytes),
            Input::Peer { bytes } => self.peers.take(now, bytes),
            Input::Solved(solution) => self.take_solved(now, solution),
            Input::Persisted { id, ok } => self.take_persisted(now, *id, *ok),
        }
    }

    fn take_vehicle(&mut self, now: Nanos, message: &VehicleMsg) {
        self.note_ack(message);
        if let VehicleMsg::Text { text } = message {
            self.event(now, EventKind::Autopilot { text: text.clone() }, "STATUSTEXT");
        }
        if let Some(jump) = self.vehicle.take(now, message) {
            self.event(now, EventKind::EstimatorReset { metres: jump.metres }, "the estimator jumped");
            if jump.metres > JUMP_MAX {
                self.fire(now, modes::Trigger::Jumped, "the estimator jumped too far");
            }
        }
    }

    fn tick(&mut self, now: Nanos) {
        let dt = self.last_tick.map_or(0.01, |at| now.since(at)).clamp(0.001, 0.1);
        self.last_tick = Some(now);
        if self.mode == Mode::Idle && !self.vehicle.armed {
            if let Some(pad) = self.pad() {
                self.vehicle.zero_on_pad(pad);
            }
            self.hover.on_ground(0.0);
        }
        self.advance_arming(now);
        self.advance_disarming(now);
        self.advance_phase(now);
        self.fly(now, dt);
        self.log_tick(now);
        self.periodic(now);
        self.ticks += 1;
    }

    /// Messages at fixed rates, spread over the ticks.
    fn periodic(&mut self, now: Nanos) {
        let phase = |period: u64, offset: u64| self.ticks % period == offset;
        let (beat, ask) = (phase(100, 0), phase(100, 3));
        let (heartbeat, telemetry, status) = (phase(20, 1), phase(10, 5), phase(10, 7));
        if beat {
            self.out.push(Output::Vehicle(VehicleCmd::Heartbeat));
        }
        if ask {
            self.ask_for_data();
        }
        if heartbeat {
            self.publish_heartbeat(now);
        }
        if telemetry {
            self.publish_telemetry(now);
        }
        if status {
            self.refresh_status(now);
        }
    }
}

#[cfg(test)]
mod tests;
