//! Tracking control: reference and state to body rates and collective thrust.
//!
//! Position loop and thrust after Lee, Leok, McClamroch, "Geometric tracking control of a quadrotor
//! UAV on SE(3)", CDC 2010, equations 15 and 16; desired attitude and rate feed-forward after
//! Mellinger, Kumar, "Minimum snap trajectory generation and control for quadrotors", ICRA 2011,
//! section III. The attitude error is split into tilt and heading (Brescianini, D'Andrea,
//! "Tilt-prioritized quadrocopter attitude control", TCST 2018), because yaw is weak on real vehicles
//! and must not disturb the direction of thrust. The rate loop itself is the autopilot's.

use crate::types::{GRAVITY, Quat, Reference, Setpoint, State, Vec3};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector2};
use serde::{Deserialize, Serialize};

/// Gains and saturations of the controller; none of them depends on the mass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Gains {
    /// Position gain [1/s^2]: the square of the natural frequency, 2 rad/s.
    pub position: f64,
    /// Velocity gain [1/s]: critically damped at 2 rad/s would be 4; the attitude loop's lag
    /// takes its share of the phase, so a little less is better damped.
    pub velocity: f64,
    /// Integral gain [1/s^3]; removes what drag and wind leave.
    pub integral: f64,
    /// Largest acceleration that the integral may ask for, per axis [m/s^2].
    pub integral_max: f64,
    /// Position errors are integrated only below this [m], so that a gust winds nothing up.
    pub integral_zone: f64,
    /// Position errors are cut to this length [m].
    pub error_max: f64,
    /// Tilt gain [1/s] (a real ArduPilot flew well with 6 to 7).
    pub tilt: f64,
    /// Heading gain [1/s]; 1.5 is clean on real vehicles, 6 is a limit cycle.
    pub yaw: f64,
    /// Largest heading rate asked for by the heading error [rad/s].
    pub yaw_rate_max: f64,
    /// Largest roll and pitch rate [rad/s] (PX4 MC_ROLLRATE_MAX, 220 deg/s).
    pub rate_max: f64,
    /// Largest tilt of the desired attitude [rad] (safety.md: 45 degrees).
    pub tilt_max: f64,
    /// Largest commanded acceleration per axis, before the tilt limit [m/s^2].
    pub acceleration_max: f64,
    /// Fastest change of the jerk that is fed forward [m/s^4]. A reference is continuous in
    /// acceleration only, at the splice of a replan above all; the body rates, jerk / g, would step
    /// with its jerk. This spreads a step of the 20 m/s^3 that a replan may have over 0.3 s, at no
    /// more than about 0.06 rad/s in a tick of 10 ms.
    pub snap_max: f64,
}

impl Default for Gains {
    fn default() -> Self {
        Self {
            position: 4.0,
            velocity: 3.6,
            integral: 0.8,
            integral_max: 1.5,
            integral_zone: 0.3,
            error_max: 1.5,
            tilt: 7.0,
            yaw: 1.5,
            yaw_rate_max: 30f64.to_radians(),
            rate_max: 220f64.to_radians(),
            tilt_max: 45f64.to_radians(),
            acceleration_max: 6.0,
            snap_max: 60.0,
        }
    }
}

/// What the controller asks for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// For the autopilot.
    pub setpoint: Setpoint,
    /// Acceleration that the setpoint aims at [m/s^2; ENU].
    pub acceleration: Vec3,
}

/// Position and attitude control; its only memories are the position integral and the jerk that
/// was fed forward last.
#[derive(Clone, Debug, PartialEq)]
pub struct Controller {
    gains: Gains,
    integral: Vec3,
    jerk: Vec3,
}

impl Controller {
    /// A controller at rest.
    #[must_use]
    pub fn new(gains: Gains) -> Self {
        Self { gains, integral: Vec3::zeros(), jerk: Vec3::zeros() }
    }

    /// Forgets the integral and the jerk.
    pub fn reset(&mut self) {
        self.integral = Vec3::zeros();
        self.jerk = Vec3::zeros();
    }

    /// Tracks `reference` from `state`; `hover_thrust` in (0, 1], `dt` since the last call [s].
    /// None when an input is not finite; what is returned is always finite and within the limits.
    pub fn update(
        &mut self,
        state: &State,
        reference: &Reference,
        hover_thrust: f64,
        dt: f64,
    ) -> Option<Demand> {
        if !finite_state(state) || !finite_reference(reference) || !dt.is_finite() {
            return None;
        }
        let g = &self.gains;
        let error = reference.p - state.p;
        if error.norm() < g.integral_zone {
            let next = self.integral + error * (g.integral * dt.clamp(0.0, 0.1));
            self.integral = next.map(|x| x.clamp(-g.integral_max, g.integral_max));
        }
        self.jerk += (reference.j - self.jerk).cap_magnitude(g.snap_max * dt.clamp(0.0, 0.1));
        let acceleration = self.feedback(&state.p, &state.v, reference) + self.integral;
        let reference = Reference { j: self.jerk, ..*reference };
        self.steer(&state.q, acceleration, &reference, hover_thrust)
    }

    /// Acceleration asked for at position `p` [m] and velocity `v` [m/s] without the integral
    /// [m/s^2; ENU]: reference, pull and damping (Lee 2010, equation 15).
    fn feedback(&self, p: &Vec3, v: &Vec3, reference: &Reference) -> Vec3 {
        let pull = (reference.p - p).cap_magnitude(self.gains.error_max) * self.gains.position;
        reference.a + pull + (reference.v - v) * self.gains.velocity
    }

    /// Acceleration [m/s^2; ENU] with which a new reference must begin at `p`, `v`, so that the
    /// demand goes on from what `reference` makes it there. The integral adds the same to both; what
    /// the new reference's own error adds is the same for both too while no limit acts.
    #[must_use]
    pub fn handover(&self, p: &Vec3, v: &Vec3, reference: &Reference) -> Vec3 {
        limit_acceleration(self.feedback(p, v, reference) + self.integral, &self.gains) - self.integral
    }

    /// The part of a demanded acceleration that moves the vehicle: the integral only holds against
    /// what pushes all the time [m/s^2; ENU].
    #[must_use]
    pub fn without_integral(&self, acceleration: &Vec3) -> Vec3 {
        acceleration - self.integral
    }

    /// Points the thrust so that `acceleration` [m/s^2; ENU] results, with heading, heading rate and
    /// jerk of `reference`; without any memory. None when an input is not finite.
    #[must_use]
    pub fn steer(
        &self,
        q: &Quat,
        acceleration: Vec3,
        reference: &Reference,
        hover_thrust: f64,
    ) -> Option<Demand> {
        let g = &self.gains;
        let acceleration = limit_acceleration(acceleration, g);
        let force = acceleration + Vec3::new(0.0, 0.0, GRAVITY);
        let desired = attitude(&force, reference.psi);
        let feed_forward = rate_feed_forward(&desired, &force, reference);
        let error = q.inverse() * desired;
        let (tilt, heading) = split(&error);
        let mut rates = error * feed_forward;
        rates.x = (rates.x + g.tilt * tilt.x).clamp(-g.rate_max, g.rate_max);
        rates.y = (rates.y + g.tilt * tilt.y).clamp(-g.rate_max, g.rate_max);
        let correction = (g.yaw * heading).clamp(-g.yaw_rate_max, g.yaw_rate_max);
        // Feed-forward and correction each get the same share of what yaw can do.
        rates.z = (rates.z + correction).clamp(-2.0 * g.yaw_rate_max, 2.0 * g.yaw_rate_max);
        // Lee 2010, equation 15: the force along the *actual* body z axis.
        let lift = force.dot(&(q * Vec3::z()));
        let thrust = (hover_thrust * lift / GRAVITY).clamp(0.0, 1.0);
        let finite = thrust.is_finite() && finite(&rates) && finite(&acceleration);
        finite.then_some(Demand { setpoint: Setpoint { rates, thrust }, acceleration })
    }
}

/// Cuts a demand to what the tilt limit and positive thrust allow: height before position.
fn limit_acceleration(acceleration: Vec3, gains: &Gains) -> Vec3 {
    let mut a = acceleration.map(|x| x.clamp(-gains.acceleration_max, gains.acceleration_max));
    let sideways = Vector2::new(a.x, a.y).cap_magnitude((a.z + GRAVITY) * gains.tilt_max.tan());
    (a.x, a.y) = (sideways.x, sideways.y);
    a
}

/// Attitude whose z axis is along `force` and whose x axis lies in the vertical plane of heading
/// `psi` (Mellinger, Kumar 2011, section III: z_B, y_B = z_B x x_C, x_B = y_B x z_B).
fn attitude(force: &Vec3, psi: f64) -> Quat {
    let z = force.normalize();
    let course = Vec3::new(psi.cos(), psi.sin(), 0.0);
    let y = z.cross(&course).normalize();
    let x = y.cross(&z);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, z])))
}

/// Body rates of the desired attitude [rad/s; desired body FLU] from jerk and heading rate
/// (Mellinger, Kumar 2011, equation 7 and below: h_w = (jerk - (z_B . jerk) z_B) / |force|).
fn rate_feed_forward(desired: &Quat, force: &Vec3, reference: &Reference) -> Vec3 {
    let j = desired.inverse() * reference.j;
    let up = (desired * Vec3::z()).z;
    let f = force.norm();
    Vec3::new(-j.y / f, j.x / f, reference.psi_rate * up)
}

/// Swing and twist of an attitude error about body z: the rotation vector that turns the body's z
/// axis onto the desired one [rad; body x, y] and the remaining heading error [rad].
fn split(error: &Quat) -> (Vector2<f64>, f64) {
    let (w, x, y, z) = (error.w, error.i, error.j, error.k);
    let twist = (w * w + z * z).sqrt();
    if twist < 1e-9 {
        // Upside down: every direction is as good, and there is no heading.
        return (Vector2::new(std::f64::consts::PI, 0.0), 0.0);
    }
    // error = swing * twist, twist = (w, 0, 0, z) / |..|, so swing = error * conj(twist).
    let sx = (w * x - y * z) / twist;
    let sy = (w * y + x * z) / twist;
    let sine = sx.hypot(sy);
    let angle = 2.0 * sine.atan2(twist);
    let scale = if sine > 1e-12 { angle / sine } else { 2.0 };
    let heading = 2.0 * z.atan2(w);
    let wrapped = (heading + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
    (Vector2::new(sx * scale, sy * scale), wrapped)
}

fn finite(v: &Vec3) -> bool {
    v.iter().all(|x| x.is_finite())
}

/// Whether every number of a state is finite.
#[must_use]
pub fn finite_state(state: &State) -> bool {
    finite(&state.p) && finite(&state.v) && finite(&state.w) && state.q.coords.iter().all(|x| x.is_finite())
}

/// Whether every number of a reference is finite.
#[must_use]
pub fn finite_reference(r: &Reference) -> bool {
    finite(&r.p)
        && finite(&r.v)
        && finite(&r.a)
        && finite(&r.j)
        && r.psi.is_finite()
        && r.psi_rate.is_finite()
}

#[cfg(test)]
#[path = "control_tests.rs"]
mod tests;
