//! Physical constants of the simulated airframe, each with its source.

use fleet_core::power::Vehicle;
use fleet_core::types::{GRAVITY, Vec3};

/// Constants of a quadrotor in X configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Airframe {
    /// Mass with battery [kg].
    pub mass: f64,
    /// Distance from the centre to a motor's axis [m].
    pub arm: f64,
    /// Principal moments of inertia [kg m^2; FLU].
    pub inertia: Vec3,
    /// Largest thrust of one motor [N].
    pub motor_thrust_max: f64,
    /// Time constant of a motor's thrust, first order [s].
    pub motor_lag: f64,
    /// Reaction torque for each newton of thrust [m].
    pub torque_per_thrust: f64,
    /// Thrust of a motor for each (rad/s)^2 of its speed [N s^2].
    pub thrust_per_speed2: f64,
    /// Quadratic drag of the frame [N/(m/s)^2].
    pub drag: f64,
    /// Linear drag of a rotor across its axis, for each rad/s of its speed [N s/m / (rad/s)].
    pub rotor_drag: f64,
    /// Radius within which two vehicles' centres cannot come without their rotors touching [m].
    pub rotor_span: f64,
}

/// Arm length of the F450 [m]: `arm_length` of the source below.
const ARM: f64 = 0.225;
/// Height of the F450's body [m]: `body_height` of the source below.
const BODY_HEIGHT: f64 = 0.1;
/// What its power is reckoned from is flown too.
const F450: Vehicle = Vehicle::F450;
/// Mass with payload and battery [kg].
const MASS: f64 = F450.mass;
/// Largest motor speed [rpm]: `propulsion.rpm.max` of the source below.
const RPM_MAX: f64 = 9068.0;
/// One revolution per minute in rad/s.
const RPM: f64 = std::f64::consts::PI / 30.0;

impl Airframe {
    /// The DJI F450 as the paper's authors simulate it: `config/uavs/f450.yaml` and the model
    /// equations of ctu-mrs/mrs_multirotor_simulator, unless a field says otherwise.
    pub const F450: Self = Self {
        mass: MASS,
        arm: ARM,
        // Solid cylinder, as in `MultirotorModel::ModelParams`. A trifilar pendulum gave
        // (0.0176, 0.0176, 0.0362) for a 1.48 kg F450-sized frame (J. Bannwarth,
        // UavQuadcopter460mm), which scales to within 15 % of these.
        inertia: Vec3::new(
            MASS * (3.0 * ARM * ARM + BODY_HEIGHT * BODY_HEIGHT) / 12.0,
            MASS * (3.0 * ARM * ARM + BODY_HEIGHT * BODY_HEIGHT) / 12.0,
            MASS * ARM * ARM / 2.0,
        ),
        motor_thrust_max: F450.rotor.thrust_per_speed2 * (RPM_MAX * RPM) * (RPM_MAX * RPM),
        // `motor_time_constant`; there it acts on the speed, here on the thrust.
        motor_lag: 0.03,
        torque_per_thrust: F450.rotor.torque_per_thrust,
        thrust_per_speed2: F450.rotor.thrust_per_speed2,
        drag: F450.drag,
        rotor_drag: F450.rotor.drag,
        rotor_span: 2.0 * (ARM + F450.rotor.radius),
    };

    /// Collective thrust at hover, 0 to 1 of the largest.
    #[must_use]
    pub fn hover_thrust(&self) -> f64 {
        self.mass * GRAVITY / (4.0 * self.motor_thrust_max)
    }
}
