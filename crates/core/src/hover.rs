//! Hover thrust estimated in flight.
//!
//! In the spirit of PX4's zero-order hover thrust estimator (`ZeroOrderHoverThrustEkf`: one random-walk
//! state, hover thrust, seen through vertical acceleration, innovations gated at 3 sigma, result
//! within 0.1 to 0.9). The agent has no accelerometer, so vertical velocity is a second state. With the
//! thrust *scale* k = 1 / hover thrust the model is linear, `dv/dt = g (k u cos(tilt) - 1)`, and a plain
//! Kalman filter does.

use crate::types::GRAVITY;

/// Smallest and largest hover thrust (PX4 HoverThrustEstimate.msg).
pub const RANGE: [f64; 2] = [0.1, 0.9];
/// Unmodelled vertical acceleration (drag, gusts), as white noise [m/s^2 / sqrt(Hz)].
const ACCELERATION_NOISE: f64 = 0.4;
/// Random walk of the scale, relative to itself [1 / sqrt(s)]: battery sag and air density.
const SCALE_WALK: f64 = 0.01;
/// Standard deviation of the autopilot's vertical velocity [m/s] (mavlink.md, section 3: 0.1 to 0.25).
const VELOCITY_NOISE: f64 = 0.1;
/// First guess of the relative error of the configured hover thrust.
const INITIAL_ERROR: f64 = 0.3;
/// Innovations count at most this many standard deviations.
const GATE: f64 = 3.0;
/// A vertical velocity beyond this is not believed [m/s].
const VELOCITY_MAX: f64 = 50.0;
/// Lag from thrust command to thrust [s] (mavlink.md, section 3: T_TAU 0.05 s).
const MOTOR_LAG: f64 = 0.05;

/// Kalman filter over vertical velocity and thrust scale.
#[derive(Clone, Debug, PartialEq)]
pub struct HoverEstimator {
    velocity: f64,
    scale: f64,
    /// Covariance: velocity, cross, scale.
    p: [f64; 3],
    /// Thrust that acts now: the command behind the motors' lag.
    thrust: f64,
    started: bool,
}

impl HoverEstimator {
    /// Starts from a configured guess of the hover thrust.
    #[must_use]
    pub fn new(guess: f64) -> Self {
        let scale = 1.0 / guess.clamp(RANGE[0], RANGE[1]);
        let sigma = INITIAL_ERROR * scale;
        Self {
            velocity: 0.0,
            scale,
            p: [VELOCITY_NOISE * VELOCITY_NOISE, 0.0, sigma * sigma],
            thrust: 0.0,
            started: false,
        }
    }

    /// Estimated hover thrust, within [`RANGE`].
    #[must_use]
    pub fn hover_thrust(&self) -> f64 {
        (1.0 / self.scale).clamp(RANGE[0], RANGE[1])
    }

    /// Standard deviation of the hover thrust.
    #[must_use]
    pub fn deviation(&self) -> f64 {
        self.p[2].max(0.0).sqrt() * self.hover_thrust().powi(2)
    }

    /// The vehicle stands on the ground: nothing can be learned until it flies again.
    pub fn on_ground(&mut self, commanded: f64) {
        self.started = false;
        self.thrust = if (0.0..=1.0).contains(&commanded) { commanded } else { 0.0 };
    }

    /// One step of `dt` [s] in the air: the thrust commanded, the cosine of the tilt and the measured
    /// vertical velocity [m/s, up]. Inputs that are not finite or make no sense are ignored.
    pub fn update(&mut self, dt: f64, commanded: f64, cos_tilt: f64, velocity: f64) {
        let legal = (0.0..=0.2).contains(&dt)
            && (0.0..=1.0).contains(&commanded)
            && (-1.0..=1.0).contains(&cos_tilt)
            && velocity.abs() <= VELOCITY_MAX;
        if !legal {
            return;
        }
        if !self.started {
            self.started = true;
            self.velocity = velocity;
            (self.p[0], self.p[1]) = (VELOCITY_NOISE * VELOCITY_NOISE, 0.0);
        }
        self.thrust += (commanded - self.thrust) * (1.0 - (-dt / MOTOR_LAG).exp());
        self.predict(dt, self.thrust * cos_tilt);
        self.correct(velocity);
    }

    fn predict(&mut self, dt: f64, lift: f64) {
        self.velocity += dt * GRAVITY * (self.scale * lift - 1.0);
        let f = dt * GRAVITY * lift;
        let [pv, pc, ps] = self.p;
        let walk = SCALE_WALK * self.scale;
        self.p = [
            pv + 2.0 * f * pc + f * f * ps + ACCELERATION_NOISE.powi(2) * dt,
            pc + f * ps,
            ps + walk * walk * dt,
        ];
    }

    fn correct(&mut self, velocity: f64) {
        let [pv, pc, ps] = self.p;
        let s = pv + VELOCITY_NOISE.powi(2);
        let sigma = s.sqrt();
        // Cut rather than drop an outlier: a wrong first guess must not lock itself in.
        let innovation = (velocity - self.velocity).clamp(-GATE * sigma, GATE * sigma);
        let (kv, ks) = (pv / s, pc / s);
        self.velocity += kv * innovation;
        self.scale = (self.scale + ks * innovation).clamp(1.0 / RANGE[1], 1.0 / RANGE[0]);
        self.p = [pv - kv * pv, pc - kv * pc, ps - ks * pc];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Hovers a point mass of true hover thrust `truth` with a velocity loop for `seconds`.
    fn fly(truth: f64, guess: f64, seconds: f64, drag: f64) -> HoverEstimator {
        let mut filter = HoverEstimator::new(guess);
        let (dt, mut v, mut thrust) = (0.01, 0.0_f64, guess);
        for k in 0..(seconds / dt) as usize {
            let target = (k as f64 * dt).sin();
            let u = (filter.hover_thrust() * (1.0 + 3.0 * (target - v) / GRAVITY)).clamp(0.0, 1.0);
            thrust += (u - thrust) * (1.0 - (-dt / MOTOR_LAG).exp());
            v += dt * (GRAVITY * (thrust / truth - 1.0) - drag * v);
            filter.update(dt, u, 1.0, v);
        }
        filter
    }

    #[test]
    fn finds_the_hover_thrust_of_the_vehicle() {
        for truth in [0.25, 0.4, 0.5, 0.65] {
            let filter = fly(truth, 0.5, 6.0, 0.2);
            let error = (filter.hover_thrust() - truth).abs() / truth;
            assert!(error < 0.03, "truth {truth}: {}", filter.hover_thrust());
            assert!(filter.deviation() < 0.1 * truth);
        }
    }

    #[test]
    fn learns_nothing_on_the_ground() {
        let mut filter = HoverEstimator::new(0.4);
        for _ in 0..500 {
            filter.on_ground(0.0);
        }
        assert_eq!(filter.hover_thrust(), 0.4);
    }

    proptest! {
        #[test]
        fn stays_finite_and_in_range(values in proptest::collection::vec(proptest::array::uniform4(proptest::num::f64::ANY), 1..60)) {
            let mut filter = HoverEstimator::new(0.5);
            for [dt, u, c, v] in values {
                filter.update(dt, u, c, v);
                filter.update(0.01, u % 1.0, c % 1.0, v % 50.0);
            }
            prop_assert!((RANGE[0]..=RANGE[1]).contains(&filter.hover_thrust()));
        }
    }
}
