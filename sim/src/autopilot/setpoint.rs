//! The external setpoint: what SET_ATTITUDE_TARGET left behind (FLU).

use super::navigator::attitude_rates;
use crate::plant::Truth;
use fleet_core::types::{Quat, Setpoint, Vec3};

/// Either rates or an attitude; attitude wins when a message carries both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Body rates [rad/s; FLU]; a NaN axis is left uncontrolled.
    Rates(Vec3),
    /// Body FLU to ENU.
    Attitude(Quat),
}

/// The last setpoint, kept for as long as the mode lasts.
#[derive(Clone, Debug)]
pub struct External {
    target: Target,
    thrust: f64,
    rates: Vec3,
}

impl Default for External {
    fn default() -> Self {
        Self { target: Target::Rates(Vec3::zeros()), thrust: 0.0, rates: Vec3::zeros() }
    }
}

impl External {
    /// Takes a setpoint. A thrust that is not a number is none (measured); one outside 0 to 1 is
    /// clipped.
    pub fn set(&mut self, target: Target, thrust: f64) {
        self.target = target;
        self.thrust = if thrust.is_nan() { 0.0 } else { thrust.clamp(0.0, 1.0) };
    }

    /// The rates that act [rad/s; FLU], for ATTITUDE_TARGET.
    #[must_use]
    pub fn rates(&self) -> &Vec3 {
        &self.rates
    }

    /// Rates and thrust for the vehicle's state now.
    pub fn resolve(&mut self, truth: &Truth) -> Setpoint {
        let wanted = match self.target {
            Target::Rates(w) => w,
            Target::Attitude(q) => attitude_rates(&truth.q, &q),
        };
        self.rates = wanted;
        // The measured rate as its own setpoint: no torque, as a NaN setpoint has on PX4.
        let rates = wanted.zip_map(&truth.w, |want, is| if want.is_finite() { want } else { is });
        Setpoint { rates, thrust: self.thrust }
    }
}
