//! The autopilot: PX4's MAVLink behaviour around the rate controller.
//!
//! Pure: messages and time come as arguments, messages and motor commands go out; sockets belong
//! to the binary.

mod commander;
mod commands;
pub mod frame;
mod mode;
mod navigator;
pub mod params;
mod setpoint;
mod streams;
mod telemetry;

pub use commander::{Answer, Commander};
pub use mode::FlightMode;
pub use params::{ParamError, Params};
pub use streams::{LinkId, id};

use crate::plant::mixer;
use crate::plant::rate_controller::RateController;
use crate::plant::{DT, Truth};
use commander::{Body, LOW_THRUST};
use fleet_core::types::{GRAVITY, Nanos, Setpoint, Vec3};
use mavlink::dialects::common::MavMessage;
use navigator::Navigator;
use setpoint::External;
use std::collections::BTreeMap;
use streams::Streams;
use telemetry::Snapshot;

/// Time constant of the autopilot's own hover thrust estimate [s].
const HOVER_LAG: f64 = 1.0;
/// Range of the hover thrust estimate (PX4 HoverThrustEstimate).
const HOVER_RANGE: (f64, f64) = (0.1, 0.9);

/// A message to one client.
#[derive(Clone, Debug, PartialEq)]
pub struct Outgoing {
    /// Whose link.
    pub link: LinkId,
    /// What.
    pub body: OutgoingBody,
}

/// A message, or the acknowledgement of a command that the dialect has no name for.
#[derive(Clone, Debug, PartialEq)]
pub enum OutgoingBody {
    /// A message of the dialect.
    Message(Box<MavMessage>),
    /// COMMAND_ACK with MAV_RESULT_UNSUPPORTED for a command number that is not in the dialect.
    UnknownCommand {
        /// The number.
        command: u16,
        /// Who asked: system and component.
        asker: (u8, u8),
    },
}

/// One vehicle's autopilot.
#[derive(Clone, Debug)]
pub struct Autopilot {
    system: u8,
    boot_offset: u64,
    origin: Vec3,
    params: Params,
    commander: Commander,
    navigator: Navigator,
    rate_controller: RateController,
    saturated: [bool; 3],
    external: External,
    truth: Truth,
    collective: f64,
    hover: f64,
    reported: (FlightMode, FlightMode),
    was_armed: bool,
    links: BTreeMap<LinkId, Streams>,
    outbox: Vec<Outgoing>,
}

impl Autopilot {
    /// An autopilot that has just been launched. `truth` is the vehicle at rest on its pad, which
    /// becomes the origin of the local frame and home; `boot_offset` [ns] is what its own clock
    /// shows at simulated time 0.
    #[must_use]
    pub fn new(system: u8, truth: &Truth, params: Params, boot_offset: u64) -> Self {
        let commander = Commander::default();
        Self {
            system,
            boot_offset,
            origin: truth.p,
            hover: params.number("MPC_THR_HOVER"),
            params,
            reported: (commander.actual(), commander.intended()),
            commander,
            navigator: Navigator::default(),
            rate_controller: RateController::default(),
            saturated: [false; 3],
            external: External::default(),
            truth: *truth,
            collective: 0.0,
            was_armed: false,
            links: BTreeMap::new(),
            outbox: Vec::new(),
        }
    }

    /// System id.
    #[must_use]
    pub fn system(&self) -> u8 {
        self.system
    }

    /// Arming and modes.
    #[must_use]
    pub fn commander(&self) -> &Commander {
        &self.commander
    }

    /// Stops the motors for good.
    pub fn terminate(&mut self) {
        self.commander.terminate();
    }

    /// A client appeared: it gets the default streams.
    pub fn open_link(&mut self, now: Nanos, link: LinkId) {
        self.links.entry(link).or_insert_with(|| Streams::new(now));
    }

    /// A client went away.
    pub fn close_link(&mut self, link: LinkId) {
        self.links.remove(&link);
    }

    /// Takes the messages that wait to be sent.
    pub fn take_outgoing(&mut self) -> Vec<Outgoing> {
        std::mem::take(&mut self.outbox)
    }

    /// One period of the physics: from the estimate to motor commands, 0 to 1.
    pub fn step(&mut self, now: Nanos, truth: &Truth) -> [f64; 4] {
        self.truth = *truth;
        let low_thrust = self.collective < LOW_THRUST * self.hover;
        self.commander.update(now, Body { on_ground: truth.on_ground, low_thrust }, &self.params);
        let motors = self.control();
        self.report(now);
        motors
    }

    fn control(&mut self) -> [f64; 4] {
        if !self.commander.armed() {
            self.was_armed = false;
            self.collective = 0.0;
            self.navigator.leave();
            return [0.0; 4];
        }
        if !self.was_armed {
            self.was_armed = true;
            self.rate_controller.reset();
        }
        let wanted = self.wanted();
        self.collective = wanted.thrust;
        let landed = self.commander.landed();
        let torque = self.rate_controller.update(&wanted.rates, &self.truth.w, self.saturated, landed, DT);
        let mix = mixer::mix(wanted.thrust, torque);
        self.saturated = mix.saturated;
        self.estimate_hover(mix.motors.iter().sum::<f64>() / 4.0);
        let factor = self.params.number("THR_MDL_FAC");
        mix.motors.map(|thrust| motor_signal(thrust, factor))
    }

    fn wanted(&mut self) -> Setpoint {
        let mode = self.commander.actual();
        if mode == FlightMode::Offboard {
            self.navigator.leave();
            return self.external.resolve(&self.truth);
        }
        let command = self.navigator.fly(mode, &self.truth, &self.origin, self.hover, &self.params, DT);
        if command.takeoff_done {
            self.commander.takeoff_done();
        }
        command.setpoint
    }

    /// Hover thrust from thrust and felt acceleration along it, for the automatic modes.
    fn estimate_hover(&mut self, thrust: f64) {
        let felt = self.truth.specific_force.z;
        if self.commander.landed() || self.truth.on_ground || thrust < 0.1 || felt < 1.0 {
            return;
        }
        let sample = (thrust * GRAVITY / felt).clamp(HOVER_RANGE.0, HOVER_RANGE.1);
        self.hover += DT / HOVER_LAG * (sample - self.hover);
    }

    fn report(&mut self, now: Nanos) {
        let modes = (self.commander.actual(), self.commander.intended());
        let changed = modes != self.reported;
        self.reported = modes;
        let mut links = std::mem::take(&mut self.links);
        for (link, streams) in &mut links {
            if changed {
                self.send_by_id(now, *link, id::CURRENT_MODE);
            }
            streams.due(now, |message| {
                self.send_by_id(now, *link, message);
            });
        }
        self.links = links;
    }

    /// Queues the message with this id; false when it is not offered.
    fn send_by_id(&mut self, now: Nanos, link: LinkId, message: u32) -> bool {
        let snapshot = Snapshot {
            boot: self.boot(now),
            now,
            system: self.system,
            truth: &self.truth,
            origin: &self.origin,
            home: &self.origin,
            commander: &self.commander,
            stream_fresh: self.commander.stream_fresh(now, &self.params),
            rates: self.external.rates(),
        };
        match snapshot.message(message) {
            Some(message) => {
                self.send(link, message);
                true
            }
            None => false,
        }
    }

    fn send(&mut self, link: LinkId, message: MavMessage) {
        self.outbox.push(Outgoing { link, body: OutgoingBody::Message(Box::new(message)) });
    }

    fn boot(&self, now: Nanos) -> Nanos {
        Nanos(now.0 + self.boot_offset)
    }
}

/// Signal that gives a relative thrust under `thrust = f s^2 + (1 - f) s` (PX4 `THR_MDL_FAC`); the
/// simulated motors are linear, as those of PX4's own simulation.
fn motor_signal(thrust: f64, factor: f64) -> f64 {
    if factor <= f64::EPSILON {
        return thrust;
    }
    let linear = (1.0 - factor) / (2.0 * factor);
    (linear * linear + thrust.max(0.0) / factor).sqrt() - linear
}

#[cfg(test)]
mod tests;
