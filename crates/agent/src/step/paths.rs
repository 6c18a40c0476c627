//! References outside the fleet plan: climbs, brakes, legs home and descents.
//!
//! Rest-to-rest quintics peak at 15/8 of their mean speed and at 10/sqrt(3) d/T^2 of acceleration;
//! a quintic from speed v to rest over v T / 2 is the cubic smooth-step in speed and peaks at
//! 1.5 v / T of acceleration (both follow from the minimal polynomial; Mueller, Hehn, D'Andrea 2015).

use fleet_core::trajectory::{Quintic, Trajectory};
use fleet_core::types::{Nanos, Reference, Vec3};

/// A quintic flown from a moment on; afterwards it goes on at its final velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// When it begins.
    pub start: Nanos,
    /// Position.
    curve: Quintic,
    /// Heading at start and end [rad], turned the short way.
    psi: [f64; 2],
}

/// Position, velocity and acceleration.
pub type Ends = (Vec3, Vec3, Vec3);

impl Leg {
    /// From one state to another in `seconds`.
    #[must_use]
    pub fn new(start: Nanos, seconds: f64, from: Ends, to: Ends, psi: [f64; 2]) -> Self {
        let turn = wrap(psi[1] - psi[0]);
        Self { start, curve: Quintic::from_ends(seconds, from, to), psi: [psi[0], psi[0] + turn] }
    }

    /// From rest at `from` to rest at `to`.
    #[must_use]
    pub fn between(start: Nanos, seconds: f64, from: Vec3, to: Vec3, psi: [f64; 2]) -> Self {
        let z = Vec3::zeros();
        Self::new(start, seconds, (from, z, z), (to, z, z), psi)
    }

    /// Brakes from a state to rest, straight on, at no more than about `a_max` per axis [m/s^2].
    #[must_use]
    pub fn brake(start: Nanos, from: Ends, psi: f64, a_max: f64) -> Self {
        let seconds = brake_time(&from.1, a_max);
        let stop = from.0 + from.1 * (0.5 * seconds);
        Self::new(start, seconds, from, (stop, Vec3::zeros(), Vec3::zeros()), [psi, psi])
    }

    /// When it ends.
    #[must_use]
    pub fn end(&self) -> Nanos {
        self.start.plus(self.curve.h)
    }

    /// Where it ends [m].
    #[must_use]
    pub fn goal(&self) -> Vec3 {
        self.curve.points[5]
    }

    /// The reference at `now`: at rest before the start, at the final velocity after the end.
    #[must_use]
    pub fn sample(&self, now: Nanos) -> Reference {
        let t = now.since(self.start);
        let h = self.curve.h;
        let s = (t / h).clamp(0.0, 1.0);
        let over = (t - h).max(0.0);
        let v = self.curve.velocity(s);
        let inside = (0.0..=h).contains(&t);
        // Smooth-step heading: s^3 (10 - 15 s + 6 s^2) and its derivative.
        let step = s * s * s * (10.0 + s * (6.0 * s - 15.0));
        let slope = 30.0 * s * s * (1.0 - s) * (1.0 - s) / h;
        let turn = self.psi[1] - self.psi[0];
        Reference {
            p: self.curve.position(s) + v * over,
            v,
            a: if inside { self.curve.acceleration(s) } else { Vec3::zeros() },
            j: if inside { self.curve.jerk(s) } else { Vec3::zeros() },
            psi: self.psi[0] + turn * step,
            psi_rate: if inside { turn * slope } else { 0.0 },
        }
    }
}

/// Time to brake from `v` at no more than `a_max` per axis, at least 0.8 s.
#[must_use]
pub fn brake_time(v: &Vec3, a_max: f64) -> f64 {
    (1.5 * v.amax() / a_max).max(0.8)
}

/// Time for a rest-to-rest quintic over `distance` that keeps speed and acceleration.
#[must_use]
pub fn rest_time(distance: f64, v_max: f64, a_max: f64) -> f64 {
    let by_speed = 1.875 * distance / v_max;
    let by_acceleration = (10.0 / 3f64.sqrt() * distance / a_max).sqrt();
    by_speed.max(by_acceleration).max(1.0)
}

/// Angle in [-pi, pi).
#[must_use]
pub fn wrap(angle: f64) -> f64 {
    (angle + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI
}

/// Slowing down along a trajectory: its time runs on ever slower until it stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slowdown {
    /// Mission time at which it begins [s].
    start: f64,
    /// How long it takes [s].
    seconds: f64,
}

impl Slowdown {
    /// Begins at mission time `start` with speed `v`; the time-scaling adds at most `a_max` per axis.
    #[must_use]
    pub fn new(start: f64, v: &Vec3, a_max: f64) -> Self {
        Self { start, seconds: brake_time(v, a_max) }
    }

    /// Time along the path, its rate and its second and third derivatives at mission time `t`.
    fn path_time(&self, t: f64) -> [f64; 4] {
        let h = self.seconds;
        let s = ((t - self.start) / h).clamp(0.0, 1.0);
        // The rate is 1 - (3 s^2 - 2 s^3); integrated: s - s^3 + s^4 / 2.
        let time = self.start + h * (s - s * s * s + 0.5 * s * s * s * s);
        let rate = 1.0 - s * s * (3.0 - 2.0 * s);
        let second = if s < 1.0 { -6.0 * s * (1.0 - s) / h } else { 0.0 };
        let third = if s < 1.0 { (12.0 * s - 6.0) / (h * h) } else { 0.0 };
        [time, rate, second, third]
    }

    /// The reference at mission time `t` along what `path` gives at a mission time; chain rule.
    pub fn sample(&self, t: f64, path: impl Fn(f64) -> Reference) -> Reference {
        let [time, rate, second, third] = self.path_time(t);
        let r = path(time);
        Reference {
            p: r.p,
            v: r.v * rate,
            a: r.a * (rate * rate) + r.v * second,
            j: r.j * rate.powi(3) + r.a * (3.0 * rate * second) + r.v * third,
            psi: r.psi,
            psi_rate: r.psi_rate * rate,
        }
    }
}

/// The fleet plan with a local replan spliced in.
#[derive(Clone, Debug, PartialEq)]
pub struct Committed {
    /// The fleet plan's trajectory of this drone.
    pub fleet: Trajectory,
    /// The local piece flown now, from its own start to its own end.
    pub local: Option<Trajectory>,
}

impl Committed {
    /// The plan alone.
    #[must_use]
    pub fn new(fleet: Trajectory) -> Self {
        Self { fleet, local: None }
    }

    /// The committed reference at mission time `t` [s].
    #[must_use]
    pub fn sample(&self, t: f64) -> Reference {
        let piece = self.local.as_ref().filter(|piece| piece.start() <= t && t < piece.end());
        piece.unwrap_or(&self.fleet).sample(t)
    }

    /// Forgets a local piece that is over at mission time `t` [s].
    pub fn advance(&mut self, t: f64) {
        if self.local.as_ref().is_some_and(|piece| piece.end() <= t) {
            self.local = None;
        }
    }
}

#[cfg(test)]
#[path = "paths_tests.rs"]
mod tests;
