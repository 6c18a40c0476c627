//! Arming, modes, failsafe and landing: PX4's commander and land detector in their observable form.

use super::mode::FlightMode;
use super::params::Params;
use fleet_core::types::Nanos;

/// Time from launch until the estimator is ready and arming is possible [s] (measured 1.4 s).
const READY_AFTER: f64 = 1.4;
/// Period of the failsafe check [s]: a lost stream was seen to act 20 to 120 ms after
/// `COM_OF_LOSS_T`.
const CHECK_PERIOD: f64 = 0.05;
/// Least time by which the check lags `COM_OF_LOSS_T` [s]; see [`CHECK_PERIOD`].
const CHECK_LAG: f64 = 0.02;
/// From the first setpoint after a gap to OFFBOARD again [s] (measured 28 to 45 ms).
const RETURN_DELAY: f64 = 0.036;
/// Contact with low thrust for so long is a landing [s] (order of PX4's land detector).
const LANDED_AFTER: f64 = 0.3;
/// A collective below this share of hover counts as low thrust (MulticopterLandDetector).
pub const LOW_THRUST: f64 = 0.3;

/// Answer to a request, as MAV_RESULT names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Done.
    Accepted,
    /// Not now.
    TemporarilyRejected,
    /// Not such a value.
    Unsupported,
}

/// What the commander knows of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// In contact with the ground.
    pub on_ground: bool,
    /// The collective is below [`LOW_THRUST`] of hover.
    pub low_thrust: bool,
}

/// Arming and mode logic.
#[derive(Clone, Debug)]
pub struct Commander {
    armed: bool,
    intended: FlightMode,
    actual: FlightMode,
    before_land: FlightMode,
    failsafe: bool,
    terminated: bool,
    last_setpoint: Option<Nanos>,
    resumed: Option<Nanos>,
    next_check: Nanos,
    armed_at: Nanos,
    took_off: bool,
    landed: bool,
    contact_since: Option<Nanos>,
}

impl Default for Commander {
    fn default() -> Self {
        Self {
            armed: false,
            intended: FlightMode::Loiter,
            actual: FlightMode::Loiter,
            before_land: FlightMode::Loiter,
            failsafe: false,
            terminated: false,
            last_setpoint: None,
            resumed: None,
            next_check: Nanos(0),
            armed_at: Nanos(0),
            took_off: false,
            landed: true,
            contact_since: None,
        }
    }
}

impl Commander {
    /// Motors may turn.
    #[must_use]
    pub fn armed(&self) -> bool {
        self.armed
    }

    /// Motors were stopped for good.
    #[must_use]
    pub fn terminated(&self) -> bool {
        self.terminated
    }

    /// Mode that acts.
    #[must_use]
    pub fn actual(&self) -> FlightMode {
        self.actual
    }

    /// Mode that was asked for.
    #[must_use]
    pub fn intended(&self) -> FlightMode {
        self.intended
    }

    /// Whether a failsafe acts.
    #[must_use]
    pub fn failsafe(&self) -> bool {
        self.failsafe
    }

    /// What the land detector says.
    #[must_use]
    pub fn landed(&self) -> bool {
        self.landed
    }

    /// Whether the estimator is ready.
    #[must_use]
    pub fn ready(&self, now: Nanos) -> bool {
        now.since(Nanos(0)) >= READY_AFTER
    }

    /// A valid setpoint came.
    pub fn setpoint_received(&mut self, now: Nanos) {
        self.last_setpoint = Some(now);
    }

    /// Whether the newest setpoint is younger than `COM_OF_LOSS_T`.
    #[must_use]
    pub fn stream_fresh(&self, now: Nanos, params: &Params) -> bool {
        self.last_setpoint.is_some_and(|at| now.since(at) <= params.number("COM_OF_LOSS_T"))
    }

    /// Asks for a mode. Disarmed, every mode is accepted; armed, only one that can run now.
    pub fn request_mode(&mut self, now: Nanos, mode: FlightMode, params: &Params) -> Answer {
        let can_run = match mode {
            FlightMode::Offboard => self.stream_fresh(now, params),
            mode => !mode.needs_sticks(),
        };
        if self.armed && !can_run {
            return Answer::TemporarilyRejected;
        }
        if mode == FlightMode::Land && self.intended != FlightMode::Land {
            self.before_land = self.intended;
        }
        self.switch(mode);
        Answer::Accepted
    }

    /// Arms.
    pub fn arm(&mut self, now: Nanos, params: &Params) -> Answer {
        if self.armed {
            return Answer::Accepted;
        }
        let blocked = self.terminated
            || !self.ready(now)
            || self.intended.needs_sticks()
            || self.intended.prevents_arming()
            || (self.intended == FlightMode::Offboard && !self.stream_fresh(now, params));
        if blocked {
            return Answer::TemporarilyRejected;
        }
        self.armed = true;
        self.armed_at = now;
        self.took_off = false;
        Answer::Accepted
    }

    /// Disarms; in the air only with `force`.
    pub fn disarm(&mut self, force: bool) -> Answer {
        if self.armed && !self.landed && !force {
            return Answer::TemporarilyRejected;
        }
        self.stop();
        Answer::Accepted
    }

    /// Stops the motors for good (flight termination, crash).
    pub fn terminate(&mut self) {
        self.terminated = true;
        self.stop();
    }

    /// The take-off height is reached.
    pub fn takeoff_done(&mut self) {
        if self.intended == FlightMode::Takeoff {
            self.switch(FlightMode::Loiter);
        }
    }

    /// Advances timers; called every period of the physics.
    pub fn update(&mut self, now: Nanos, body: Body, params: &Params) {
        self.detect_landing(now, body);
        if !self.armed {
            return;
        }
        self.check_stream(now, params);
        self.disarm_by_timer(now, params);
    }

    fn switch(&mut self, mode: FlightMode) {
        self.intended = mode;
        self.actual = mode;
        self.failsafe = false;
        self.resumed = None;
    }

    fn stop(&mut self) {
        self.armed = false;
        self.failsafe = false;
        // Seen on PX4: after landing the reported mode flips back to the one before.
        if self.intended == FlightMode::Land {
            self.intended = self.before_land;
        }
        self.actual = self.intended;
    }

    fn detect_landing(&mut self, now: Nanos, body: Body) {
        if !body.on_ground {
            self.landed = false;
            self.took_off |= self.armed;
            self.contact_since = None;
        } else if self.armed && !body.low_thrust {
            self.contact_since = None;
        } else {
            let since = *self.contact_since.get_or_insert(now);
            self.landed |= now.since(since) >= LANDED_AFTER;
        }
    }

    fn check_stream(&mut self, now: Nanos, params: &Params) {
        if self.intended != FlightMode::Offboard {
            return;
        }
        if self.actual == FlightMode::Offboard {
            if now < self.next_check {
                return;
            }
            self.next_check = now.plus(CHECK_PERIOD);
            let age = self.last_setpoint.map_or(f64::INFINITY, |at| now.since(at));
            if age > params.number("COM_OF_LOSS_T") + CHECK_LAG {
                self.lose_stream(params);
            }
        } else if self.stream_fresh(now, params) {
            let first = *self.resumed.get_or_insert(now);
            if now.since(first) >= RETURN_DELAY {
                self.switch(FlightMode::Offboard);
            }
        } else {
            self.resumed = None;
        }
    }

    fn lose_stream(&mut self, params: &Params) {
        self.failsafe = true;
        self.resumed = None;
        self.actual = match params.number("COM_OBL_RC_ACT") as i64 {
            1 => FlightMode::Altctl,
            2 => FlightMode::Stabilized,
            3 => FlightMode::Rtl,
            4 => FlightMode::Land,
            5 => FlightMode::Loiter,
            6 => return self.terminate(),
            7 => return self.stop(),
            _ => FlightMode::Posctl,
        };
    }

    fn disarm_by_timer(&mut self, now: Nanos, params: &Params) {
        let rested = self.contact_since.map_or(0.0, |since| now.since(since));
        let limit = params.number("COM_DISARM_LAND");
        let preflight = params.number("COM_DISARM_PRFLT");
        // A limit of zero or less switches the timer off (PX4 parameter reference).
        let after_landing = self.took_off && self.landed && limit > 0.0 && rested >= limit;
        let never_flew = !self.took_off && preflight > 0.0 && now.since(self.armed_at) >= preflight;
        if after_landing || never_flew {
            self.stop();
        }
    }
}
