//! The modes that the autopilot flies by itself: mode and state to body rates and thrust.

use super::mode::FlightMode;
use super::params::Params;
use crate::plant::Truth;
use fleet_core::types::{GRAVITY, Quat, Setpoint, Vec3};

/// Position to velocity [1/s]: `MPC_XY_P`, `MPC_Z_P` (PX4 defaults).
const POSITION_P: Vec3 = Vec3::new(0.95, 0.95, 1.0);
/// Velocity to acceleration [1/s]: `MPC_XY_VEL_P_ACC`, `MPC_Z_VEL_P_ACC` (PX4 defaults).
const VELOCITY_P: Vec3 = Vec3::new(1.8, 1.8, 4.0);
/// Integral of the velocity error [1/s^2]: `MPC_XY_VEL_I_ACC`, `MPC_Z_VEL_I_ACC` (PX4 defaults).
const VELOCITY_I: Vec3 = Vec3::new(0.4, 0.4, 2.0);
/// Largest horizontal speed [m/s]: `MPC_XY_CRUISE`.
const CRUISE: f64 = 5.0;
/// Climb and descent of automatic modes [m/s]: `MPC_Z_V_AUTO_UP`, `MPC_Z_V_AUTO_DN`.
const CLIMB: f64 = 3.0;
/// See [`CLIMB`].
const DESCENT: f64 = 1.5;
/// Rise of AUTO/TAKEOFF [m/s]: `MPC_TKO_SPEED`.
const TAKEOFF_SPEED: f64 = 1.5;
/// Largest tilt [rad]: `MPC_TILTMAX_AIR` 45 degrees.
const TILT_MAX: f64 = std::f64::consts::FRAC_PI_4;
/// Attitude to body rates [1/s]: `MC_ROLL_P`, `MC_PITCH_P`, `MC_YAW_P` (PX4 defaults).
const ATTITUDE_P: Vec3 = Vec3::new(6.5, 6.5, 2.8);
/// Sinking of the stick modes without sticks [m/s] (measured 0.6 to 0.8).
const STICKLESS_SINK: f64 = 0.7;
/// Height within which RTL lands without climbing first, when this near home [m]: `RTL_MIN_DIST`.
const NEAR_HOME: f64 = 10.0;
/// A target is reached within this distance [m]: `NAV_ACC_RAD` is 10 m, `NAV_MC_ALT_RAD` 0.8 m.
const REACHED: f64 = 0.8;

/// State of the automatic modes.
#[derive(Clone, Debug)]
pub struct Navigator {
    mode: Option<FlightMode>,
    target: Vec3,
    yaw: f64,
    integral: Vec3,
    returning: bool,
}

/// What the navigator wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Rates and thrust.
    pub setpoint: Setpoint,
    /// AUTO/TAKEOFF has reached its height.
    pub takeoff_done: bool,
}

impl Default for Navigator {
    fn default() -> Self {
        Self { mode: None, target: Vec3::zeros(), yaw: 0.0, integral: Vec3::zeros(), returning: false }
    }
}

impl Navigator {
    /// Leaves the automatic modes, so that the next one starts afresh.
    pub fn leave(&mut self) {
        self.mode = None;
    }

    /// Flies `mode` for `dt` [s]. `home` is the take-off point [m; ENU], `hover` the estimated
    /// hover thrust.
    pub fn fly(
        &mut self,
        mode: FlightMode,
        truth: &Truth,
        home: &Vec3,
        hover: f64,
        params: &Params,
        dt: f64,
    ) -> Command {
        if self.mode != Some(mode) {
            self.enter(mode, truth, home, params);
        }
        let idle = truth.on_ground && mode != FlightMode::Takeoff;
        if idle {
            // Standing: motors are cut so that the land detector can see it.
            self.integral = Vec3::zeros();
            let setpoint = Setpoint { rates: Vec3::zeros(), thrust: 0.0 };
            return Command { setpoint, takeoff_done: false };
        }
        let takeoff_done = mode == FlightMode::Takeoff && self.target.z - truth.p.z < 0.1;
        let setpoint = match mode {
            FlightMode::Stabilized => self.level(truth, hover, GRAVITY),
            FlightMode::Altctl => {
                let a = VELOCITY_P.z * (-STICKLESS_SINK - truth.v.z);
                self.level(truth, hover, GRAVITY + a)
            }
            mode => {
                let v = self.velocity(mode, truth, home, params);
                self.accelerate(truth, &v, hover, dt)
            }
        };
        Command { setpoint, takeoff_done }
    }

    fn enter(&mut self, mode: FlightMode, truth: &Truth, home: &Vec3, params: &Params) {
        self.mode = Some(mode);
        self.integral = Vec3::zeros();
        self.yaw = truth.q.euler_angles().2;
        self.target = truth.p;
        if mode == FlightMode::Takeoff {
            self.target.z = home.z + params.number("MIS_TAKEOFF_ALT");
        }
        self.returning = mode == FlightMode::Rtl && (truth.p - home).xy().norm() > NEAR_HOME;
        if mode == FlightMode::Rtl {
            let high = if self.returning { home.z + params.number("RTL_RETURN_ALT") } else { truth.p.z };
            self.target.z = truth.p.z.max(high);
        }
    }

    /// Velocity that the mode wants [m/s; ENU].
    fn velocity(&mut self, mode: FlightMode, truth: &Truth, home: &Vec3, params: &Params) -> Vec3 {
        let to_target = |target: &Vec3| {
            let v = POSITION_P.component_mul(&(target - truth.p));
            let slow = (CRUISE / v.xy().norm().max(CRUISE)).min(1.0);
            Vec3::new(v.x * slow, v.y * slow, v.z.clamp(-DESCENT, CLIMB))
        };
        let land = -params.number("MPC_LAND_SPEED");
        match mode {
            FlightMode::Posctl => Vec3::new(0.0, 0.0, -STICKLESS_SINK),
            FlightMode::Land => {
                let v = to_target(&self.target);
                Vec3::new(v.x, v.y, land)
            }
            FlightMode::Takeoff => {
                let v = to_target(&self.target);
                Vec3::new(v.x, v.y, v.z.clamp(0.2, TAKEOFF_SPEED))
            }
            FlightMode::Rtl => {
                if self.returning && (self.target.z - truth.p.z).abs() < REACHED {
                    self.target = Vec3::new(home.x, home.y, self.target.z);
                    self.returning = (truth.p - home).xy().norm() > REACHED;
                }
                let v = to_target(&self.target);
                if self.returning { v } else { Vec3::new(v.x, v.y, land) }
            }
            _ => to_target(&self.target),
        }
    }

    /// Velocity loop, then attitude.
    fn accelerate(&mut self, truth: &Truth, wanted: &Vec3, hover: f64, dt: f64) -> Setpoint {
        let error = wanted - truth.v;
        self.integral += dt * VELOCITY_I.component_mul(&error);
        self.integral = self.integral.map(|x| x.clamp(-3.0, 3.0));
        let mut f = VELOCITY_P.component_mul(&error) + self.integral + Vec3::new(0.0, 0.0, GRAVITY);
        f.z = f.z.clamp(0.3 * GRAVITY, 2.0 * GRAVITY);
        let side = f.xy().norm();
        let most = f.z * TILT_MAX.tan();
        if side > most {
            f.x *= most / side;
            f.y *= most / side;
        }
        self.point(truth, &f, hover)
    }

    /// Level attitude with the thrust that gives the vertical specific force `lift` [m/s^2].
    fn level(&self, truth: &Truth, hover: f64, lift: f64) -> Setpoint {
        self.point(truth, &Vec3::new(0.0, 0.0, lift.clamp(0.0, 2.0 * GRAVITY)), hover)
    }

    /// Points the thrust along `f` [m/s^2; ENU] with the heading of entry.
    fn point(&self, truth: &Truth, f: &Vec3, hover: f64) -> Setpoint {
        let up = truth.q * Vec3::z();
        let wanted_up = if f.norm() > 1e-6 { f.normalize() } else { Vec3::z() };
        let heading = Quat::from_euler_angles(0.0, 0.0, self.yaw);
        let tilt = Quat::rotation_between(&Vec3::z(), &wanted_up).unwrap_or_default();
        let rates = attitude_rates(&truth.q, &(tilt * heading));
        Setpoint { rates, thrust: (hover * f.dot(&up) / GRAVITY).clamp(0.0, 1.0) }
    }
}

/// Body rates [rad/s; FLU] that turn `q` towards `wanted`: twice the vector part of the error
/// quaternion (PX4 `AttitudeControl`, after Brescianini, Hehn, D'Andrea 2013).
#[must_use]
pub fn attitude_rates(q: &Quat, wanted: &Quat) -> Vec3 {
    let error = q.inverse() * wanted;
    let sign = if error.w < 0.0 { -2.0 } else { 2.0 };
    ATTITUDE_P.component_mul(&(sign * error.imag()))
}
