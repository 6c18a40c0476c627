//! The plain types that every part shares, each field with unit and frame.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// A vector in metres, metres per second, ... as its field says.
pub type Vec3 = Vector3<f64>;
/// A unit quaternion that turns body FLU into world ENU coordinates.
pub type Quat = UnitQuaternion<f64>;

/// Standard gravity [m/s^2] (CGPM 1901).
pub const GRAVITY: f64 = 9.806_65;

/// A moment on one process's own monotonic clock [ns]. Clocks of different hosts are not comparable.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Nanos(pub u64);

impl Nanos {
    /// The moment `seconds` after zero; negative values give zero.
    #[must_use]
    pub fn from_seconds(seconds: f64) -> Self {
        Self((seconds * 1e9).round().max(0.0) as u64)
    }

    /// Seconds from `earlier` to `self`; negative when `self` is the earlier one.
    #[must_use]
    pub fn since(self, earlier: Self) -> f64 {
        if self.0 >= earlier.0 {
            (self.0 - earlier.0) as f64 * 1e-9
        } else {
            -((earlier.0 - self.0) as f64 * 1e-9)
        }
    }

    /// The moment `seconds` later (earlier when negative; never before zero).
    #[must_use]
    pub fn plus(self, seconds: f64) -> Self {
        let step = (seconds.abs() * 1e9).round() as u64;
        if seconds >= 0.0 { Self(self.0.saturating_add(step)) } else { Self(self.0.saturating_sub(step)) }
    }
}

/// What is known of a vehicle at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// When it was measured, on the agent's clock.
    pub at: Nanos,
    /// Position [m; scenario frame, ENU].
    pub p: Vec3,
    /// Velocity [m/s; ENU].
    pub v: Vec3,
    /// Attitude, body FLU to world ENU; on the wire as [w, x, y, z].
    #[serde(with = "wxyz")]
    pub q: Quat,
    /// Body rates [rad/s; FLU].
    pub w: Vec3,
}

/// What the vehicle should do at one moment of mission time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reference {
    /// Position [m; ENU].
    pub p: Vec3,
    /// Velocity [m/s; ENU].
    pub v: Vec3,
    /// Acceleration [m/s^2; ENU].
    pub a: Vec3,
    /// Jerk [m/s^3; ENU].
    pub j: Vec3,
    /// Heading [rad], counter-clockwise from east.
    pub psi: f64,
    /// Heading rate [rad/s].
    pub psi_rate: f64,
}

impl Reference {
    /// Hover at `p` with heading `psi`.
    #[must_use]
    pub fn rest(p: Vec3, psi: f64) -> Self {
        Self { p, v: Vec3::zeros(), a: Vec3::zeros(), j: Vec3::zeros(), psi, psi_rate: 0.0 }
    }
}

/// What is sent to the autopilot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Setpoint {
    /// Body rates [rad/s; FLU].
    pub rates: Vec3,
    /// Collective thrust, 0 to 1 of the vehicle's maximum.
    pub thrust: f64,
}

/// Limits of a mission; per axis where the paper has them per axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Largest |velocity| per axis [m/s].
    pub v_max: f64,
    /// Largest |acceleration| per axis [m/s^2].
    pub a_max: f64,
    /// Largest |heading rate| [rad/s].
    pub psi_rate_max: f64,
    /// Smallest distance between two drones' centres [m].
    pub delta_min: f64,
    /// Largest deviation from the plan for which the plan still guarantees safety [m].
    pub tube: f64,
}

/// Parameters of the event-triggered replanner (paper section IV-C; design.md "Replan").
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReplanParams {
    /// Period of the deviation check [s].
    pub t_e: f64,
    /// Period of the topic waypoints [s].
    pub t_g: f64,
    /// Deviation that triggers a replan [m].
    pub eta: f64,
    /// Whether deviations trigger replans at all.
    pub enabled: bool,
}

/// Serde adapter: a unit quaternion as `[w, x, y, z]`.
pub mod wxyz {
    use super::{Quat, Quaternion, UnitQuaternion};
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    /// Writes `[w, x, y, z]`.
    ///
    /// # Errors
    /// Only those of the serializer.
    pub fn serialize<S: Serializer>(q: &Quat, serializer: S) -> Result<S::Ok, S::Error> {
        [q.w, q.i, q.j, q.k].serialize(serializer)
    }

    /// Reads `[w, x, y, z]`; the length must be within 1e-3 of 1.
    ///
    /// # Errors
    /// When the four numbers are not close to a unit quaternion.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Quat, D::Error> {
        let [w, x, y, z] = <[f64; 4]>::deserialize(deserializer)?;
        let q = Quaternion::new(w, x, y, z);
        if (q.norm() - 1.0).abs() > 1e-3 {
            return Err(serde::de::Error::custom("quaternion is not of unit length"));
        }
        // A value that is unit to rounding is kept bit for bit, so that encode(decode(x)) == x.
        Ok(if (q.norm() - 1.0).abs() < 1e-12 {
            UnitQuaternion::new_unchecked(q)
        } else {
            UnitQuaternion::from_quaternion(q)
        })
    }
}
