//! The control tick: state and reference to one setpoint, and what to do when the state is late.

use super::Agent;
use super::modes::{Trigger, flies};
use super::phases::{Path, SPOOL};
use crate::io::{Output, VehicleCmd, VehicleMode};
use fleet_core::hover::HoverEstimator;
use fleet_core::types::{Nanos, Quat, Reference, Setpoint, State, Vec3};
use fleet_core::wire::{EventKind, Mode};

/// A state older than this is bridged by levelling out [s] (safety.md, row 17).
pub const COAST_AFTER: f64 = 0.1;
/// A state older than this cannot be bridged: level and descend [s].
const LOST_AFTER: f64 = 0.3;
/// Ticks for which it must have been lost before the flight is given up; the descent begins with the first.
const LOST_TICKS: u32 = 3;
/// Thrust for a blind descent, relative to hover.
const SINKING: f64 = 0.95;
/// Height above the pad [m] or climb [m/s] at which the vehicle has left the ground.
const LIFTED: [f64; 2] = [0.12, 0.2];
/// A setpoint gap counts as a reason for leaving offboard control for this long [s].
const GAP_MEMORY: f64 = 2.0;
/// COM_OF_LOSS_T assumed when it was never read [s].
const LOSS: f64 = 0.5;
/// Pause before offboard control is asked for again [s].
const RETRY: f64 = 0.5;

const IDLE: Setpoint = Setpoint { rates: Vec3::new(0.0, 0.0, 0.0), thrust: 0.0 };

impl Agent {
    /// Sends one setpoint when this mode sends any.
    pub(super) fn fly(&mut self, now: Nanos, dt: f64) {
        self.watch_state(now);
        self.watch_lift(now);
        self.watch_mode(now);
        // Once handed over it stays so: PX4 shows OFFBOARD again as soon as it has disarmed (mavlink.md, 3).
        let handed_over = self.handing_over.is_some()
            && (self.vehicle.mode == Some(VehicleMode::Land) || matches!(self.path, Path::Ground));
        if handed_over {
            // From here on the autopilot follows nothing of ours.
            self.path = Path::Ground;
        }
        let state = self.vehicle.state(now);
        let reference = self.reference(now);
        self.deviation = state.zip(reference).map(|(s, r)| (s.p - r.p).norm());
        let setpoint = match self.mode {
            Mode::Idle if self.arming.is_none() => None,
            Mode::Released => None,
            Mode::Idle | Mode::Armed => Some(IDLE),
            Mode::Land | Mode::Abort if handed_over => None,
            Mode::Land | Mode::Abort if !self.lifted => Some(IDLE),
            _ => Some(self.track(now, dt, state, reference)),
        };
        self.last_setpoint = setpoint;
        let Some(setpoint) = setpoint else {
            self.last_sent = None;
            return;
        };
        let loss = self.vehicle.params.get(super::preflight::OFFBOARD_LOSS).copied().unwrap_or(LOSS);
        if self.last_sent.is_some_and(|at| now.since(at) > loss) {
            self.gap = Some(now);
        }
        self.last_sent = Some(now);
        self.out.push(Output::Vehicle(VehicleCmd::Rates(setpoint)));
    }

    /// A setpoint for a flying mode: always finite, whatever the state is like.
    fn track(&mut self, now: Nanos, dt: f64, state: Option<State>, reference: Option<Reference>) -> Setpoint {
        let hover = self.hover.hover_thrust();
        let age = self.vehicle.age(now).unwrap_or(f64::INFINITY);
        if let (true, Some(state), Some(reference)) = (age <= COAST_AFTER, state, reference) {
            self.coasting = None;
            if self.lifted {
                let cos_tilt = (state.q * Vec3::z()).z;
                let thrust = self.last_setpoint.map_or(0.0, |s| s.thrust);
                self.hover.update(dt, thrust, cos_tilt, state.v.z);
            }
            if let Some(demand) = self.controller.update(&state, &reference, hover, dt) {
                self.acceleration = demand.acceleration;
                return self.spool(now, demand.setpoint);
            }
        }
        self.acceleration = Vec3::zeros();
        self.coast(now, dt, if age <= LOST_AFTER { hover } else { SINKING * hover })
    }

    /// On the ground in take-off the thrust comes up slowly and nothing is steered.
    fn spool(&self, now: Nanos, setpoint: Setpoint) -> Setpoint {
        if self.mode != Mode::Takeoff || self.lifted {
            return setpoint;
        }
        let share = (now.since(self.entered) / SPOOL).clamp(0.0, 1.0);
        Setpoint { rates: Vec3::zeros(), thrust: setpoint.thrust * share }
    }

    /// Levels out without a position: by the measured attitude while it is fresh, then by the one that
    /// our own rates should have led to, and in the end with zero rates.
    fn coast(&mut self, now: Nanos, dt: f64, thrust: f64) -> Setpoint {
        let age = self.vehicle.attitude_age(now).unwrap_or(f64::INFINITY);
        let fresh = age <= COAST_AFTER;
        let known = if fresh { self.vehicle.attitude() } else { self.coasting.or(self.vehicle.attitude()) };
        let blind = Setpoint { rates: Vec3::zeros(), thrust };
        let Some(q) = known.filter(|_| age <= LOST_AFTER) else { return blind };
        let level = Reference::rest(Vec3::zeros(), heading(&q));
        let Some(demand) = self.controller.steer(&q, Vec3::zeros(), &level, thrust) else { return blind };
        let turned = q * Quat::from_scaled_axis(demand.setpoint.rates * dt);
        self.coasting = Some(turned);
        demand.setpoint
    }

    fn watch_state(&mut self, now: Nanos) {
        let age = self.vehicle.age(now).unwrap_or(f64::INFINITY);
        let lost = age > COAST_AFTER;
        let matters = flies(self.mode) || self.mode == Mode::Armed;
        if matters && lost != self.state_lost {
            self.state_lost = lost;
            let cause = if lost { "vehicle state is late" } else { "vehicle state is back" };
            self.event(now, EventKind::StateStale { lost }, cause);
        }
        // An old state in the first tick after a pause of this process tells of the pause: what has arrived
        // meanwhile is still on its way through the socket (safety.md, 2.2: a fault needs persistence).
        self.lost_ticks = if matters && age > LOST_AFTER { self.lost_ticks + 1 } else { 0 };
        if self.lost_ticks > LOST_TICKS {
            self.fire(now, Trigger::StateLost, "vehicle state is lost");
        }
    }

    /// Notices the moment at which the vehicle leaves the ground: the thrust of that moment is a far
    /// better guess of hover than any configuration.
    fn watch_lift(&mut self, now: Nanos) {
        if self.lifted || self.mode != Mode::Takeoff {
            return;
        }
        let (Some(state), Some(pad)) = (self.vehicle.state(now), self.pad()) else { return };
        let thrust = self.last_setpoint.map_or(0.0, |s| s.thrust);
        if state.p.z - pad.z > LIFTED[0] || (state.v.z > LIFTED[1] && thrust > 0.0) {
            self.lifted = true;
            self.hover = HoverEstimator::new(thrust);
        } else if self.vehicle.on_ground == Some(false) && thrust > 0.0 {
            // The autopilot feels it even when the position does not show it.
            self.lifted = true;
        }
    }

    /// Disarmed by the autopilot, taken over by a pilot, or fallen out of offboard control.
    fn watch_mode(&mut self, now: Nanos) {
        if self.mode != Mode::Idle && !self.vehicle.armed {
            self.fire(now, Trigger::Disarmed, "the autopilot disarmed");
            if self.mode == Mode::Abort && self.lifted {
                // Abort is latched, but the flight is over: now disarm may leave it.
                self.lifted = false;
                self.event(now, EventKind::Landed, "disarmed in mode Abort");
            }
            return;
        }
        let ours = match self.vehicle.mode {
            Some(VehicleMode::Offboard) => {
                self.regaining = None;
                return;
            }
            Some(VehicleMode::Land) => self.handing_over.is_some(),
            _ => false,
        };
        if ours || !flies(self.mode) && self.mode != Mode::Armed {
            return;
        }
        let excused = self.gap.is_some_and(|at| now.since(at) < GAP_MEMORY);
        match self.regaining {
            None if !excused => {
                self.fire(now, Trigger::Taken, "the autopilot left offboard control by itself");
            }
            Some(at) if now.since(at) < RETRY => {}
            _ => {
                self.regaining = Some(now);
                self.out.push(Output::Vehicle(VehicleCmd::SetMode { mode: VehicleMode::Offboard }));
            }
        }
    }
}

fn heading(q: &Quat) -> f64 {
    let x = q * Vec3::x();
    x.y.atan2(x.x)
}
