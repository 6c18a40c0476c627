//! Checks of an offered plan before it is accepted (safety.md, section 2.4), cheapest first.
//!
//! The ground has proved the plan; the drone believes none of it that it can check by itself. All
//! checks of motion are Bernstein bounds over continuous time, not samples.

mod content;
mod motion;

use crate::wire::{Plan, RejectCode};
use serde::{Deserialize, Serialize};

/// A refusal: machine-readable cause, and for people what, where and what is legal.
pub type Refusal = (RejectCode, String);

/// What the vehicle can do; a plan whose limits ask for more is refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VehicleLimits {
    /// Largest |velocity| per axis [m/s].
    pub v_max: f64,
    /// Largest |acceleration| per axis [m/s^2].
    pub a_max: f64,
    /// Largest |heading rate| [rad/s].
    pub psi_rate_max: f64,
}

/// Whether `drone` of `fleet` may accept `plan`.
///
/// # Errors
/// The first check that fails.
pub fn admit(plan: &Plan, drone: &str, fleet: &str, vehicle: &VehicleLimits) -> Result<(), Refusal> {
    content::schema(plan)?;
    content::fleet(plan, drone, fleet)?;
    content::times(plan)?;
    content::limits(plan, vehicle)?;
    content::regions(plan)?;
    content::certificate(plan)?;
    motion::ends(plan)?;
    motion::limits(plan)?;
    motion::clearance(plan)?;
    motion::separation(plan)
}

fn refuse<T>(code: RejectCode, reason: impl Into<String>) -> Result<T, Refusal> {
    Err((code, reason.into()))
}
