//! The end of a flight: handing over to the autopilot's own landing, and knowing that it is over.

use super::Agent;
use crate::io::{Output, VehicleCmd, VehicleMode};
use fleet_core::types::Nanos;

/// Pause before a mode request is repeated [s].
const RETRY: f64 = 0.5;
/// Blind for longer than this, the autopilot's own landing is the better pilot [s].
const BLIND: f64 = 1.0;
/// Standing still this far above the descending reference means standing on something [m].
const BLOCKED: f64 = 0.5;

impl Agent {
    /// Hands over near the pad, on contact, or when blind; then waits for the autopilot to disarm.
    pub(super) fn advance_landing(&mut self, now: Nanos) {
        if !self.lifted || self.handing_over.is_none() && !self.near_ground(now) {
            return;
        }
        let due = self.handing_over.is_none_or(|at| now.since(at) >= RETRY);
        if due && self.vehicle.mode != Some(VehicleMode::Land) {
            self.handing_over = Some(now);
            self.out.push(Output::Vehicle(VehicleCmd::SetMode { mode: VehicleMode::Land }));
        }
    }

    /// Repeats a request to disarm until it is heard. On the ground only: in the air nothing asks.
    pub(super) fn advance_disarming(&mut self, now: Nanos) {
        if !self.vehicle.armed || self.lifted {
            self.disarming = None;
        } else if self.disarming.is_some_and(|at| now.since(at) >= RETRY) {
            self.disarm(now);
        }
    }

    fn near_ground(&self, now: Nanos) -> bool {
        if self.vehicle.age(now).is_none_or(|age| age > BLIND) {
            return true;
        }
        let Some(state) = self.vehicle.state(now) else { return true };
        let low = self.pad().is_some_and(|pad| state.p.z - pad.z <= self.config.landing.handover);
        let still = state.v.z.abs() < 0.1 && now.since(self.entered) > 2.0;
        let blocked = self.reference(now).is_some_and(|r| state.p.z - r.p.z > BLOCKED);
        low || (still && (blocked || self.vehicle.on_ground == Some(true)))
    }
}
