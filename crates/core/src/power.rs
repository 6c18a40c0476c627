//! Electrical power of a quadrotor, from the thrust of its rotors and the air that they move through.
//!
//! Momentum theory in forward flight, as helicopters use it and as it was fitted to small quadrotors by
//! Liu, Sengupta, Kurzhanskiy, "A power consumption model for multi-rotor small unmanned aircraft
//! systems", ICUAS 2017:
//! - induced velocity `v = T / (2 rho A sqrt(across^2 + (axial + v)^2))` (Glauert 1926; Leishman,
//!   Principles of Helicopter Aerodynamics, 2nd ed., section 2.14),
//! - shaft power `T (axial + kappa v) + P0 (1 + mu^2)`, with mu the advance ratio. The work of drag is
//!   in the first term, because thrust leans against drag: the profile part keeps only what reaches
//!   the shaft as torque (Leishman, section 5.4),
//! - electrical power: shaft power over the efficiency of motor and speed controller.
//!
//! Slow descents use the same equation, as Liu et al. do: it holds up to about half the hover-induced
//! velocity (3 m/s here). Beyond, in the vortex ring, no momentum theory holds; it then says too little.

use crate::trajectory::Trajectory;
use crate::types::{GRAVITY, Vec3};
use std::f64::consts::PI;

/// Density of air at sea level [kg/m^3] (ISO 2533, standard atmosphere).
pub const AIR_DENSITY: f64 = 1.225;
/// Longest stretch over which power is integrated at once [s].
const STRETCH: f64 = 1.0;
/// Nodes and weights of the Gauss-Legendre rule of five points on [0, 1] (Abramowitz, Stegun, table 25.4).
const GAUSS: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_095),
    (0.230_765_344_947_158, 0.239_314_335_249_683),
    (0.5, 0.284_444_444_444_444),
    (0.769_234_655_052_842, 0.239_314_335_249_683),
    (0.953_089_922_969_332, 0.118_463_442_528_095),
];
/// Iterations for the induced velocity; Newton takes four to six, bisection guards it.
const ITERATIONS: usize = 60;
/// Iterations for a rotor's drag, which leans the thrust that it depends on; each gains more than a digit.
const LEANS: usize = 8;

/// One rotor with its motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rotor {
    /// Radius [m].
    pub radius: f64,
    /// Thrust for each (rad/s)^2 of speed [N s^2].
    pub thrust_per_speed2: f64,
    /// Reaction torque for each newton of thrust, in hover [m].
    pub torque_per_thrust: f64,
    /// Drag across the axis, for each m/s of air and rad/s of speed [N s/m / (rad/s)].
    pub drag: f64,
    /// Induced power over its ideal, kappa (Leishman, section 2.8: typically 1.15).
    pub induced_factor: f64,
    /// Shaft power over electrical power of motor and speed controller.
    pub efficiency: f64,
}

/// What the rotors must carry and push through the air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vehicle {
    /// Mass with battery [kg].
    pub mass: f64,
    /// Number of rotors; they share the thrust evenly and their axes are parallel.
    pub rotors: u8,
    /// Each of them.
    pub rotor: Rotor,
    /// Quadratic drag of the frame [N/(m/s)^2].
    pub drag: f64,
}

/// Electrical energy of a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy {
    /// Of the flight [J].
    pub total: f64,
    /// Of hovering for as long [J].
    pub hover: f64,
}

impl Rotor {
    /// Speed [rad/s] at a thrust [N].
    #[must_use]
    pub fn speed(&self, thrust: f64) -> f64 {
        (thrust.max(0.0) / self.thrust_per_speed2).sqrt()
    }

    /// Area of the disc [m^2].
    #[must_use]
    pub fn area(&self) -> f64 {
        PI * self.radius * self.radius
    }

    /// Velocity [m/s] that a thrust [N] adds to air that comes along the axis at `axial` (climb
    /// positive) and across it at `across` [m/s].
    #[must_use]
    pub fn induced_velocity(&self, thrust: f64, axial: f64, across: f64) -> f64 {
        let hover2 = thrust.max(0.0) / (2.0 * AIR_DENSITY * self.area());
        // Between these the product v * speed through the disc passes hover2.
        let (mut low, mut high) = (0.0, (-axial).max(0.0) + hover2.sqrt());
        let mut v = high;
        for _ in 0..ITERATIONS {
            let through = across.hypot(axial + v);
            let excess = v * through - hover2;
            if excess.abs() <= 1e-12 * hover2 || high - low <= 1e-12 * high {
                break;
            }
            if excess > 0.0 {
                high = v;
            } else {
                low = v;
            }
            let slope = through + v * (axial + v) / through.max(f64::MIN_POSITIVE);
            let newton = v - excess / slope;
            v = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        }
        v
    }

    /// Mechanical power at the shaft [W]; negative where the air drives the rotor.
    #[must_use]
    pub fn shaft_power(&self, thrust: f64, axial: f64, across: f64) -> f64 {
        let thrust = thrust.max(0.0);
        let speed = self.speed(thrust);
        let ideal = thrust * self.induced_velocity(thrust, 0.0, 0.0);
        let profile = self.torque_per_thrust * thrust * speed - self.induced_factor * ideal;
        let tip = (speed * self.radius).max(f64::MIN_POSITIVE);
        let advance2 = (across / tip).powi(2).min(1.0);
        let v = self.induced_velocity(thrust, axial, across);
        thrust * (axial + self.induced_factor * v) + profile * (1.0 + advance2)
    }

    /// Electrical power [W], never negative: a speed controller does not charge the battery.
    #[must_use]
    pub fn power(&self, thrust: f64, axial: f64, across: f64) -> f64 {
        (self.shaft_power(thrust, axial, across) / self.efficiency).max(0.0)
    }

    /// Ideal over real shaft power in hover.
    #[must_use]
    pub fn figure_of_merit(&self, thrust: f64) -> f64 {
        thrust * self.induced_velocity(thrust, 0.0, 0.0) / self.shaft_power(thrust, 0.0, 0.0)
    }
}

impl Vehicle {
    /// The DJI F450 as the paper's authors simulate it: `config/uavs/f450.yaml` and the model equations
    /// of ctu-mrs/mrs_multirotor_simulator, unless a field says otherwise. Its rotors have a figure of
    /// merit of 0.47, as follows from their reaction torque.
    pub const F450: Self = Self {
        mass: 1.7,
        rotors: 4,
        rotor: Rotor {
            radius: 0.11,
            // `propulsion.force_constant`, given for each rpm^2.
            thrust_per_speed2: 1.2216e-7 / ((PI / 30.0) * (PI / 30.0)),
            // `propulsion.moment_constant` times three propeller radii, as in the allocation matrix.
            torque_per_thrust: 0.07 * 3.0 * 0.11,
            // `rotorDragCoefficient` of PX4's Gazebo model x500, whose propellers are of like size.
            drag: 8.064_28e-5,
            induced_factor: 1.15,
            // Makes 1.7 kg hover at 327 W: 5.2 g/W were measured on a quadrotor of this weight with
            // 10 inch propellers (retromcsmart.com, "Quadrotor motor efficiency", 2013).
            efficiency: 0.72,
        },
        // `air_resistance_coeff` times the area pi arm^2.
        drag: 0.30 * PI * 0.225 * 0.225,
    };

    /// Thrust over mass [m/s^2; ENU] that gives the acceleration `a` at the velocity `v` through the air.
    #[must_use]
    pub fn thrust_accel(&self, a: &Vec3, v: &Vec3) -> Vec3 {
        let level = a + Vec3::new(0.0, 0.0, GRAVITY) + v * (self.drag * v.norm() / self.mass);
        let rotors = f64::from(self.rotors);
        let mut f = level;
        for _ in 0..LEANS {
            let axis = f.try_normalize(1e-9).unwrap_or_else(Vec3::z);
            let speed = self.rotor.speed(self.mass * f.norm() / rotors);
            let across = v - axis * v.dot(&axis);
            f = level + across * (rotors * self.rotor.drag * speed / self.mass);
        }
        f
    }

    /// Electrical power [W] of a thrust over mass `f` [m/s^2; ENU] at the velocity `v` through the air.
    #[must_use]
    pub fn power(&self, f: &Vec3, v: &Vec3) -> f64 {
        let rotors = f64::from(self.rotors);
        let axis = f.try_normalize(1e-9).unwrap_or_else(Vec3::z);
        let axial = v.dot(&axis);
        let across = (v - axis * axial).norm();
        rotors * self.rotor.power(self.mass * f.norm() / rotors, axial, across)
    }

    /// Electrical power [W] of flying with the acceleration `a` at the velocity `v` in still air.
    #[must_use]
    pub fn flight_power(&self, a: &Vec3, v: &Vec3) -> f64 {
        self.power(&self.thrust_accel(a, v), v)
    }

    /// Electrical power of hovering [W].
    #[must_use]
    pub fn hover_power(&self) -> f64 {
        self.flight_power(&Vec3::zeros(), &Vec3::zeros())
    }

    /// Electrical energy of a trajectory in still air; within 2e-6 of the exact integral for
    /// motions as gentle as the shipped plans' (|a| up to 3 m/s^2).
    #[must_use]
    pub fn energy(&self, trajectory: &Trajectory) -> Energy {
        let knots = trajectory.knots();
        let mut total = 0.0;
        for (segment, pair) in knots.windows(2).enumerate() {
            let quintic = trajectory.quintic(segment);
            let h = pair[1].t - pair[0].t;
            let count = (h / STRETCH).ceil().max(1.0);
            for part in 0..count as u32 {
                for (node, weight) in GAUSS {
                    let s = (f64::from(part) + node) / count;
                    let power = self.flight_power(&quintic.acceleration(s), &quintic.velocity(s));
                    total += weight * power * h / count;
                }
            }
        }
        Energy { total, hover: self.hover_power() * (trajectory.end() - trajectory.start()) }
    }
}

#[cfg(test)]
#[path = "power_tests.rs"]
mod tests;
