//! What the step knows before the first message.

use fleet_core::control::Gains;
use serde::{Deserialize, Serialize};

/// Configuration of the onboard logic; recorded with every log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AgentConfig {
    /// Name of the fleet.
    pub fleet: String,
    /// Id of this drone.
    pub drone: String,
    /// Controller.
    #[serde(default)]
    pub gains: Gains,
    /// What the vehicle can do.
    #[serde(default)]
    pub vehicle: VehicleLimits,
    /// Thresholds of the pre-flight checks.
    #[serde(default)]
    pub preflight: PreflightLimits,
    /// Landing and return.
    #[serde(default)]
    pub landing: Landing,
}

impl AgentConfig {
    /// Defaults for `drone` of `fleet`.
    #[must_use]
    pub fn new(fleet: impl Into<String>, drone: impl Into<String>) -> Self {
        Self {
            fleet: fleet.into(),
            drone: drone.into(),
            gains: Gains::default(),
            vehicle: VehicleLimits::default(),
            preflight: PreflightLimits::default(),
            landing: Landing::default(),
        }
    }
}

/// Limits of the vehicle; a plan that asks for more is refused.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VehicleLimits {
    /// Largest |velocity| per axis [m/s].
    pub v_max: f64,
    /// Largest |acceleration| per axis [m/s^2].
    pub a_max: f64,
    /// Largest heading rate [rad/s].
    pub psi_rate_max: f64,
    /// First guess of the hover thrust, 0 to 1; refined in flight (PX4's MPC_THR_HOVER default is 0.5).
    pub hover_thrust: f64,
}

impl Default for VehicleLimits {
    fn default() -> Self {
        Self { v_max: 5.0, a_max: 4.0, psi_rate_max: 45f64.to_radians(), hover_thrust: 0.5 }
    }
}

/// Thresholds of the pre-flight checks (design.md, Common frame; safety.md, Decisions).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PreflightLimits {
    /// Oldest vehicle state [s].
    pub state_age: f64,
    /// Largest COM_OF_LOSS_T [s].
    pub offboard_loss: f64,
    /// Largest horizontal distance of the autopilot's local position from its origin on the pad [m].
    pub horizontal: f64,
    /// The same for height [m].
    pub height: f64,
    /// Least battery, 0 to 1.
    pub battery: f64,
}

impl Default for PreflightLimits {
    fn default() -> Self {
        Self { state_age: 0.1, offboard_loss: 0.5, horizontal: 0.5, height: 1.5, battery: 0.3 }
    }
}

/// Landing and return.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Landing {
    /// Descent rate [m/s] (what PX4's AUTO/LAND uses, mavlink.md section 3).
    pub descent: f64,
    /// Height above the pad at which the autopilot's own landing takes over [m].
    pub handover: f64,
    /// Largest speed on the way home [m/s].
    pub return_speed: f64,
    /// Distance kept from the top of the workspace on the way home [m].
    pub ceiling_margin: f64,
}

impl Default for Landing {
    fn default() -> Self {
        Self { descent: 0.7, handover: 0.25, return_speed: 2.0, ceiling_margin: 0.8 }
    }
}
