//! Rigid body quadrotor with lagging motors, drag and a ground to stand on.
//!
//! World ENU, body FLU. Deterministic, no allocation in [`Plant::step`].

mod airframe;
pub mod mixer;
pub mod rate_controller;

pub use airframe::Airframe;

use fleet_core::types::{GRAVITY, Quat, Vec3};

/// Period of the physics [s].
pub const DT: f64 = 1e-3;

/// Ground truth of one vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Position of the centre [m; ENU].
    pub p: Vec3,
    /// Velocity [m/s; ENU].
    pub v: Vec3,
    /// Body FLU to ENU.
    pub q: Quat,
    /// Body rates [rad/s; FLU].
    pub w: Vec3,
    /// What an accelerometer feels, without gravity's pull [m/s^2; FLU].
    pub specific_force: Vec3,
    /// Whether the vehicle stands on the ground.
    pub on_ground: bool,
}

/// A vehicle's body and motors.
#[derive(Clone, Debug)]
pub struct Plant {
    airframe: Airframe,
    truth: Truth,
    ground: f64,
    thrusts: [f64; 4],
    impact: Option<f64>,
}

impl Plant {
    /// A vehicle at rest on its pad `p` [m; ENU] with heading `psi` [rad]. The ground is flat, at
    /// the height at which the centre rests.
    #[must_use]
    pub fn new(airframe: Airframe, p: Vec3, psi: f64) -> Self {
        let truth = Truth {
            p,
            v: Vec3::zeros(),
            q: Quat::from_euler_angles(0.0, 0.0, psi),
            w: Vec3::zeros(),
            specific_force: Vec3::new(0.0, 0.0, GRAVITY),
            on_ground: true,
        };
        Self { airframe, truth, ground: p.z, thrusts: [0.0; 4], impact: None }
    }

    /// Ground truth now.
    #[must_use]
    pub fn truth(&self) -> &Truth {
        &self.truth
    }

    /// Height above the ground [m].
    #[must_use]
    pub fn height(&self) -> f64 {
        self.truth.p.z - self.ground
    }

    /// The constants.
    #[must_use]
    pub fn airframe(&self) -> &Airframe {
        &self.airframe
    }

    /// Downward speed of a touchdown [m/s] since this was last asked.
    pub fn take_impact(&mut self) -> Option<f64> {
        self.impact.take()
    }

    /// Puts the vehicle somewhere, for tests: in the air at rest unless `v` says otherwise, motors
    /// at the thrust that holds it.
    pub fn place(&mut self, p: Vec3, v: Vec3, q: Quat) {
        self.truth.p = p;
        self.truth.v = v;
        self.truth.q = q;
        self.truth.w = Vec3::zeros();
        self.truth.on_ground = p.z <= self.ground;
        let share = if self.truth.on_ground { 0.0 } else { self.airframe.mass * GRAVITY / 4.0 };
        self.thrusts = [share; 4];
    }

    /// One period `dt` [s] under motor commands (0 to 1), `wind` [m/s; ENU] and an outer `force`
    /// [N; ENU].
    pub fn step(&mut self, motors: [f64; 4], wind: &Vec3, force: &Vec3, dt: f64) {
        self.spin_motors(motors, dt);
        let body = self.body_force(wind);
        let a = self.truth.q * body / self.airframe.mass + force / self.airframe.mass
            - Vec3::new(0.0, 0.0, GRAVITY);
        if self.truth.on_ground && a.z <= 0.0 {
            self.rest();
            return;
        }
        self.truth.on_ground = false;
        self.truth.specific_force = self.truth.q.inverse() * (a + Vec3::new(0.0, 0.0, GRAVITY));
        let v = self.truth.v + dt * a;
        // The mean of old and new speed: exact for a constant acceleration.
        self.truth.p += 0.5 * dt * (self.truth.v + v);
        self.truth.v = v;
        self.turn(dt);
        self.touch();
    }

    fn spin_motors(&mut self, motors: [f64; 4], dt: f64) {
        let blend = 1.0 - (-dt / self.airframe.motor_lag).exp();
        for (thrust, command) in self.thrusts.iter_mut().zip(motors) {
            *thrust += blend * (command.clamp(0.0, 1.0) * self.airframe.motor_thrust_max - *thrust);
        }
    }

    /// Thrust and drag [N; FLU].
    fn body_force(&self, wind: &Vec3) -> Vec3 {
        let air = self.truth.q.inverse() * (self.truth.v - wind);
        let speeds: f64 = self.thrusts.iter().map(|t| (t / self.airframe.thrust_per_speed2).sqrt()).sum();
        let across = self.airframe.rotor_drag * speeds;
        let lift: f64 = self.thrusts.iter().sum();
        let drag = -self.airframe.drag * air.norm() * air;
        drag + Vec3::new(-across * air.x, -across * air.y, lift)
    }

    /// Euler's equations for one period, and the exact turn at the mean rate.
    fn turn(&mut self, dt: f64) {
        let lever = self.airframe.arm * std::f64::consts::FRAC_1_SQRT_2;
        let sum = |sign: &[f64; 4]| -> f64 { (0..4).map(|i| sign[i] * self.thrusts[i]).sum() };
        let torque = Vec3::new(
            lever * sum(&mixer::LEFT),
            -lever * sum(&mixer::FORWARD),
            self.airframe.torque_per_thrust * sum(&mixer::REACTION),
        );
        let w = self.truth.w;
        let inertia = self.airframe.inertia;
        let acceleration = (torque - w.cross(&inertia.component_mul(&w))).component_div(&inertia);
        self.truth.w += dt * acceleration;
        let mut q = self.truth.q * Quat::from_scaled_axis(0.5 * dt * (w + self.truth.w));
        q.renormalize_fast();
        self.truth.q = q;
    }

    /// Lands when the centre has come down to its height of rest.
    fn touch(&mut self) {
        if self.truth.p.z <= self.ground && self.truth.v.z < 0.0 {
            self.impact = Some(-self.truth.v.z);
            self.rest();
        }
    }

    /// Stands still and level on the ground; the landing gear's friction is taken as complete.
    fn rest(&mut self) {
        let (_, _, yaw) = self.truth.q.euler_angles();
        self.truth.p.z = self.ground;
        self.truth.v = Vec3::zeros();
        self.truth.w = Vec3::zeros();
        self.truth.q = Quat::from_euler_angles(0.0, 0.0, yaw);
        self.truth.specific_force = Vec3::new(0.0, 0.0, GRAVITY);
        self.truth.on_ground = true;
    }
}

#[cfg(test)]
mod tests;
