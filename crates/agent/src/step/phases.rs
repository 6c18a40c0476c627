//! Mode changes, what each mode flies, and the triggers that time brings.

use super::Agent;
use super::homeward::corners;
use super::modes::{Next, Trigger, next};
use super::paths::{Committed, Leg, Slowdown, brake_time, rest_time};
use crate::io::{Output, VehicleCmd, VehicleMode};
use fleet_core::types::{Nanos, Reference, State, Vec3};
use fleet_core::wire::{EventKind, Mode};

/// Take-off begins this long before mission time 0 [s] (design.md, Start).
pub const TAKEOFF_LEAD: f64 = 10.0;
/// The thrust comes up over this time before the climb begins [s].
pub const SPOOL: f64 = 1.5;
/// A climb lasts this long [s], unless the start is too high for it.
const CLIMB: f64 = 6.5;
/// Peers may be waited for this long at take-off [s]; spool, climb and this stay below the lead.
const PEER_GRACE: f64 = 1.0;
/// Distance from the plan's start that is accepted at mission time 0 [m] (design.md, Start).
const START_RADIUS: f64 = 0.3;
/// A landing within this distance of the pad ends on the pad [m].
const PAD_RADIUS: f64 = 1.5;
/// Acceleration used for brakes and legs outside the plan [m/s^2].
const GENTLE: f64 = 2.0;
/// Beyond this distance from its reference a manoeuvre begins at the measured state [m].
const REANCHOR: f64 = 0.6;

/// What is being flown.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Path {
    /// Nothing: on the ground, or released.
    #[default]
    Ground,
    /// Legs, one after the other.
    Legs(Vec<Leg>),
    /// The committed plan.
    Plan(Committed),
    /// Coming to rest on the committed plan.
    Slow(Slowdown, Committed),
    /// Straight down where it is, without holding a position.
    Sink {
        /// Heading [rad].
        psi: f64,
    },
}

impl Agent {
    /// The committed reference at `now`.
    pub(super) fn reference(&self, now: Nanos) -> Option<Reference> {
        let t = self.mission.time(now);
        match &self.path {
            Path::Ground => None,
            Path::Legs(legs) => {
                let leg = legs.iter().rev().find(|leg| leg.start <= now).or(legs.first())?;
                Some(leg.sample(now))
            }
            Path::Plan(committed) => Some(committed.sample(t?)),
            Path::Slow(slowdown, committed) => Some(slowdown.sample(t?, |u| committed.sample(u))),
            Path::Sink { psi } => {
                let state = self.vehicle.state(now)?;
                let down = Vec3::new(0.0, 0.0, -self.config.landing.descent);
                Some(Reference { v: down, ..Reference::rest(state.p, *psi) })
            }
        }
    }

    /// Looks `trigger` up in the table and does what it says.
    pub(super) fn fire(&mut self, now: Nanos, trigger: Trigger, cause: &str) -> Next {
        let next = next(self.mode, trigger);
        if let Next::To(mode) = next {
            self.enter(now, mode, cause);
        }
        next
    }

    fn enter(&mut self, now: Nanos, mode: Mode, cause: &str) {
        let from = self.mode;
        self.mode = mode;
        self.entered = now;
        self.event(now, EventKind::Mode { from, to: mode }, cause);
        if !matches!(mode, Mode::Replan | Mode::Track) {
            self.replan.drop_request();
        }
        match mode {
            Mode::Idle => self.enter_idle(now, from),
            Mode::Armed => self.path = Path::Ground,
            Mode::Takeoff => self.enter_takeoff(now),
            Mode::Track => self.enter_track(),
            // The request itself is made by the monitor, which knows the deviation.
            Mode::Replan => {}
            Mode::Hold => self.enter_hold(now),
            Mode::Return => self.enter_return(now),
            Mode::Land | Mode::Abort if !self.lifted => {
                self.path = Path::Ground;
                self.disarm(now);
            }
            Mode::Land => self.enter_land(now),
            Mode::Abort => self.path = Path::Sink { psi: self.heading(now) },
            Mode::Released => {
                self.path = Path::Ground;
                // A landing that a pilot broke off is over: a later one begins anew.
                self.handing_over = None;
                self.regaining = None;
            }
        }
    }

    /// Asks the autopilot to disarm; repeated until it has.
    pub(super) fn disarm(&mut self, now: Nanos) {
        self.disarming = Some(now);
        self.out.push(Output::Vehicle(VehicleCmd::Arm { arm: false, force: false }));
    }

    fn enter_idle(&mut self, now: Nanos, from: Mode) {
        if self.vehicle.armed {
            self.disarm(now);
        }
        if self.lifted {
            self.event(now, EventKind::Landed, &format!("disarmed in mode {from:?}"));
        }
        self.path = Path::Ground;
        self.lifted = false;
        self.handing_over = None;
        self.regaining = None;
        self.mission.t0 = None;
        self.controller.reset();
    }

    fn enter_takeoff(&mut self, now: Nanos) {
        let psi = self.heading(now);
        let (Some(plan), Some(state)) = (&self.mission.committed, self.vehicle.state(now)) else { return };
        let own = plan.own();
        let start = own.trajectory.sample(own.trajectory.start());
        let seconds = CLIMB.max(rest_time((start.p - state.p).norm(), 1.5, GENTLE));
        self.vehicle.keep_offset_of(own.pad.p);
        self.controller.reset();
        let leg = Leg::between(now.plus(SPOOL), seconds, state.p, start.p, [psi, start.psi]);
        self.path = Path::Legs(vec![leg]);
    }

    /// From take-off the plan alone; after a splice it is already in place.
    fn enter_track(&mut self) {
        if let (false, Some(plan)) = (matches!(self.path, Path::Plan(_)), &self.mission.committed) {
            self.path = Path::Plan(Committed::new(plan.own().trajectory.clone()));
        }
    }

    fn enter_hold(&mut self, now: Nanos) {
        let t = self.mission.time(now);
        if let (Path::Plan(committed), Some(t)) = (&self.path, t) {
            let committed = committed.clone();
            let v = committed.sample(t).v;
            self.path = Path::Slow(Slowdown::new(t, &v, self.brake_limit()), committed);
            return;
        }
        if let Some((from, psi)) = self.departure(now) {
            self.path = Path::Legs(vec![Leg::brake(now, from, psi, GENTLE)]);
        }
        if self.vehicle.mode != Some(VehicleMode::Offboard) {
            self.regaining = Some(now);
        }
    }

    fn brake_limit(&self) -> f64 {
        self.mission.committed.as_ref().map_or(GENTLE, |plan| plan.plan.limits.a_max)
    }

    /// Up above everything, home, and then land (first form of safety.md's return branch).
    fn enter_return(&mut self, now: Nanos) {
        let Some((from, psi)) = self.departure(now) else { return };
        let Some(plan) = &self.mission.committed else { return };
        let brake = Leg::brake(now, from, psi, GENTLE);
        let landing = &self.config.landing;
        let corners = corners(&plan.plan, &brake.goal(), &plan.own().pad.p, landing.ceiling_margin);
        let mut legs = vec![brake];
        for corner in corners {
            let (start, from) = (legs[legs.len() - 1].end(), legs[legs.len() - 1].goal());
            let seconds = rest_time((corner - from).norm(), landing.return_speed, GENTLE);
            legs.push(Leg::between(start, seconds, from, corner, [psi, psi]));
        }
        self.path = Path::Legs(legs);
    }

    /// Straight down at the landing rate; onto the pad when it is right below.
    fn enter_land(&mut self, now: Nanos) {
        let Some((from, psi)) = self.departure(now) else {
            self.path = Path::Sink { psi: self.heading(now) };
            return;
        };
        let pad = self.pad();
        let drift = from.0 + from.1 * (0.5 * brake_time(&from.1, GENTLE));
        let aside = pad.map(|pad| (pad - drift).xy().norm());
        let (mut target, mut seconds) = (drift, brake_time(&from.1, GENTLE).max(2.0));
        if let (Some(pad), Some(aside)) = (pad, aside.filter(|d| *d <= PAD_RADIUS)) {
            (target.x, target.y) = (pad.x, pad.y);
            seconds = seconds.max(rest_time(aside, 1.0, 1.0));
        } else {
            let stop = from.0 + from.1 * (0.5 * seconds);
            (target.x, target.y) = (stop.x, stop.y);
        }
        let down = Vec3::new(0.0, 0.0, -self.config.landing.descent);
        target.z = from.0.z + 0.5 * seconds * (from.1.z + down.z);
        let leg = Leg::new(now, seconds, from, (target, down, Vec3::zeros()), [psi, psi]);
        self.path = Path::Legs(vec![leg]);
    }

    /// Where a manoeuvre begins: the reference, so that nothing jumps, unless the vehicle is far from it.
    fn departure(&self, now: Nanos) -> Option<((Vec3, Vec3, Vec3), f64)> {
        let state = self.vehicle.state(now)?;
        let measured = ((state.p, state.v, Vec3::zeros()), heading_of(&state));
        let reference = self.reference(now).filter(|r| (r.p - state.p).norm() <= REANCHOR);
        Some(reference.map_or(measured, |r| ((r.p, r.v, r.a), r.psi)))
    }

    /// Measured heading [rad].
    pub(super) fn heading(&self, now: Nanos) -> f64 {
        self.vehicle.state(now).map_or(0.0, |state| heading_of(&state))
    }

    pub(super) fn pad(&self) -> Option<Vec3> {
        self.mission.committed.as_ref().map(|plan| plan.own().pad.p)
    }

    /// Triggers that time and position bring, once a tick.
    pub(super) fn advance_phase(&mut self, now: Nanos) {
        let t = self.mission.time(now);
        match self.mode {
            Mode::Idle | Mode::Armed => self.check_go(now, t),
            Mode::Takeoff if t.is_some_and(|t| t >= 0.0) => self.check_start(now),
            Mode::Track | Mode::Replan | Mode::Hold => self.advance_plan(now, t),
            Mode::Return => {
                let done =
                    matches!(&self.path, Path::Legs(legs) if legs.last().is_some_and(|l| now >= l.end()));
                if done {
                    self.fire(now, Trigger::OverHome, "over home");
                }
            }
            Mode::Land | Mode::Abort => self.advance_landing(now),
            Mode::Takeoff | Mode::Released => {}
        }
    }

    fn check_go(&mut self, now: Nanos, t: Option<f64>) {
        let Some(t) = t.filter(|t| *t >= -TAKEOFF_LEAD) else { return };
        let mut complaint = self.peers_complain(now, t, &[Mode::Armed, Mode::Takeoff]);
        if self.mode == Mode::Idle {
            complaint = Some("take-off is due and this drone is not armed".to_owned());
        }
        match complaint {
            None => {
                self.fire(now, Trigger::Go, "take-off is due and every peer agrees");
            }
            Some(text) if t >= -TAKEOFF_LEAD + PEER_GRACE || self.mode == Mode::Idle => {
                self.event(now, EventKind::Fault { text }, "take-off refused");
                self.mission.t0 = None;
                self.fire(now, Trigger::NoGo, "take-off refused");
            }
            Some(_) => {}
        }
    }

    fn check_start(&mut self, now: Nanos) {
        let start = self.mission.committed.as_ref().map(|plan| {
            let trajectory = &plan.own().trajectory;
            trajectory.sample(trajectory.start()).p
        });
        let away = start.zip(self.vehicle.state(now)).map(|(start, state)| (start - state.p).norm());
        let complaint = match away {
            Some(away) if away <= START_RADIUS => {
                self.peers_complain(now, 0.0, &[Mode::Takeoff, Mode::Track, Mode::Replan])
            }
            Some(away) => Some(format!("{away:.2} m from the start at t0; {START_RADIUS} m is legal")),
            None => Some("position unknown at t0".to_owned()),
        };
        match complaint {
            None => self.fire(now, Trigger::AtStart, "mission time 0"),
            Some(text) => {
                self.event(now, EventKind::Fault { text: text.clone() }, "start refused");
                self.fire(now, Trigger::NotAtStart, &text)
            }
        };
    }

    fn peers_complain(&self, now: Nanos, t: f64, modes: &[Mode]) -> Option<String> {
        let Some(plan) = &self.mission.committed else { return Some("no plan is committed".to_owned()) };
        plan.peers().find_map(|peer| self.peers.complaint(now, peer, &plan.hash, t, modes))
    }
}

/// Heading of the body's x axis [rad], counter-clockwise from east.
fn heading_of(state: &State) -> f64 {
    let x = state.q * Vec3::x();
    x.y.atan2(x.x)
}
