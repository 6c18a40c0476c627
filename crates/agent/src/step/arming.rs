//! Getting the autopilot's data flowing, and the way from disarmed to armed in offboard control.

use super::Agent;
use super::modes::Trigger;
use super::preflight::{OFFBOARD_ACTION, OFFBOARD_LOSS};
use crate::io::{Output, Stream, VehicleCmd, VehicleMode, VehicleMsg, VehicleRequest};
use fleet_core::types::Nanos;
use fleet_core::wire::{EventKind, Mode};

/// Setpoints are streamed this long before offboard control is asked for [s] (mavlink.md, 1b).
const PRE_STREAM: f64 = 0.5;
/// Pause before an unanswered request is repeated [s]; acknowledgements take 3 to 15 ms.
const RETRY: f64 = 0.4;
/// Arming fails when it takes longer than this [s].
const TIMEOUT: f64 = 5.0;

/// Streams with their periods [us] (mavlink.md, 1c).
const STREAMS: [(Stream, u32); 5] = [
    (Stream::Attitude, 10_000),
    (Stream::LocalPosition, 10_000),
    (Stream::Odometry, 20_000),
    (Stream::Landed, 100_000),
    (Stream::Battery, 200_000),
];

/// An arming sequence under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arming {
    since: Nanos,
    last_request: Option<Nanos>,
}

impl Arming {
    /// Begins to stream.
    #[must_use]
    pub fn begin(now: Nanos) -> Self {
        Self { since: now, last_request: None }
    }
}

impl Agent {
    /// One tick of the arming sequence: stream, offboard, arm, each repeated until it has happened.
    pub(super) fn advance_arming(&mut self, now: Nanos) {
        let Some(mut arming) = self.arming else { return };
        if self.vehicle.armed {
            self.arming = None;
            self.fire(now, Trigger::Armed, "armed");
            return;
        }
        if now.since(arming.since) > TIMEOUT {
            self.arming = None;
            let text = format!(
                "could not arm within {TIMEOUT} s (mode {:?}, {}): see the autopilot's messages",
                self.vehicle.mode, self.vehicle.last_words
            );
            self.event(now, EventKind::Fault { text }, "arming");
            return;
        }
        let due = arming.last_request.is_none_or(|at| now.since(at) >= RETRY);
        if now.since(arming.since) < PRE_STREAM || !due {
            return;
        }
        arming.last_request = Some(now);
        self.arming = Some(arming);
        let command = if self.vehicle.mode == Some(VehicleMode::Offboard) {
            VehicleCmd::Arm { arm: true, force: false }
        } else {
            VehicleCmd::SetMode { mode: VehicleMode::Offboard }
        };
        self.out.push(Output::Vehicle(command));
    }

    /// Shortens the wait for a heartbeat: acknowledgements come at once.
    pub(super) fn note_ack(&mut self, message: &VehicleMsg) {
        let VehicleMsg::Ack { request, result: 0 } = message else { return };
        let Some(arming) = self.arming.as_mut() else {
            if self.disarming.is_some() && *request == Some(VehicleRequest::Arm) {
                self.vehicle.armed = false;
            }
            return;
        };
        match request {
            // Ask for the next thing in the next tick.
            Some(VehicleRequest::Mode) => {
                arming.last_request = None;
                self.vehicle.mode = Some(VehicleMode::Offboard);
            }
            Some(VehicleRequest::Arm) => self.vehicle.armed = true,
            _ => {}
        }
    }

    /// Once a second: asks again for what does not flow, and reads the parameters of pre-flight.
    pub(super) fn ask_for_data(&mut self) {
        if self.vehicle.heartbeat.is_none() {
            return;
        }
        for (stream, period_us) in STREAMS {
            let expected = 1_000_000 / period_us;
            // Lost packets and a busy machine are no reason to ask again; a default rate is.
            if self.vehicle.drain(stream).count * 10 < expected * 7 {
                self.out.push(Output::Vehicle(VehicleCmd::Interval { stream, period_us }));
            }
        }
        if self.vehicle.drain(Stream::Origin).last.is_none() {
            self.out.push(Output::Vehicle(VehicleCmd::Request { stream: Stream::Origin }));
        }
        if self.mode == Mode::Idle {
            for name in [OFFBOARD_LOSS, OFFBOARD_ACTION] {
                // Read again while it is wrong: someone may be setting it right now.
                if !super::preflight::parameter_ok(&self.vehicle, &self.config.preflight, name) {
                    self.out.push(Output::Vehicle(VehicleCmd::ReadParam { name: name.to_owned() }));
                }
            }
        }
    }
}
