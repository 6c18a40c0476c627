//! Body rates to torques, as PX4's `RateControl` does it.

use fleet_core::types::Vec3;
use std::f64::consts::PI;

/// Proportional gains [1/(rad/s)]: `MC_ROLLRATE_P`, `MC_PITCHRATE_P`, `MC_YAWRATE_P` (PX4 defaults).
const P: Vec3 = Vec3::new(0.15, 0.15, 0.2);
/// Integral gains [1/rad]: `MC_ROLLRATE_I`, `MC_PITCHRATE_I`, `MC_YAWRATE_I` (PX4 defaults).
const I: Vec3 = Vec3::new(0.2, 0.2, 0.1);
/// Derivative gains [s/(rad/s)]: `MC_ROLLRATE_D`, `MC_PITCHRATE_D`, `MC_YAWRATE_D` (PX4 defaults).
const D: Vec3 = Vec3::new(0.003, 0.003, 0.0);
/// Limit of each integral: `MC_RR_INT_LIM` and its like (PX4 defaults).
const INTEGRAL_MAX: f64 = 0.3;
/// Cut-off of the differentiated gyro [Hz]: `IMU_DGYRO_CUTOFF` (PX4 default).
const DERIVATIVE_CUTOFF: f64 = 30.0;
/// Rate error at which the integral stops growing [rad/s]: 400 deg/s in PX4's `updateIntegral`.
const INTEGRAL_FADE: f64 = 400.0 * PI / 180.0;

/// PID on body rates, derivative on the measurement.
#[derive(Clone, Debug, Default)]
pub struct RateController {
    integral: Vec3,
    last_rate: Option<Vec3>,
    angular_acceleration: Vec3,
}

impl RateController {
    /// Torques (-1 to 1, FLU) for the wanted and measured body rates [rad/s]. `saturated` is the
    /// mixer's last answer; `landed` freezes the integral, as PX4 does.
    pub fn update(
        &mut self,
        wanted: &Vec3,
        rate: &Vec3,
        saturated: [bool; 3],
        landed: bool,
        dt: f64,
    ) -> [f64; 3] {
        let raw = (rate - self.last_rate.unwrap_or(*rate)) / dt;
        self.last_rate = Some(*rate);
        let blend = 1.0 - (-2.0 * PI * DERIVATIVE_CUTOFF * dt).exp();
        self.angular_acceleration += blend * (raw - self.angular_acceleration);

        let error = wanted - rate;
        let torque = P.component_mul(&error) + self.integral - D.component_mul(&self.angular_acceleration);
        if !landed {
            self.integrate(&error, &torque, saturated, dt);
        }
        [torque.x, torque.y, torque.z]
    }

    /// Forgets everything, as on arming.
    pub fn reset(&mut self) {
        *self = Self::default();
    }

    fn integrate(&mut self, error: &Vec3, torque: &Vec3, saturated: [bool; 3], dt: f64) {
        for axis in 0..3 {
            if saturated[axis] && error[axis] * torque[axis] > 0.0 {
                continue;
            }
            // Large errors are those of a manoeuvre, not of a trim (PX4 `updateIntegral`).
            let fade = (1.0 - (error[axis] / INTEGRAL_FADE).powi(2)).max(0.0);
            let next = self.integral[axis] + fade * I[axis] * error[axis] * dt;
            if next.is_finite() {
                self.integral[axis] = next.clamp(-INTEGRAL_MAX, INTEGRAL_MAX);
            }
        }
    }
}
