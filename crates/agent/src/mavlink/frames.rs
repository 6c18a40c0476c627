//! NED and FRD to ENU and FLU and back. Every map here is its own inverse.
//!
//! MAVLink speaks north-east-down and forward-right-down (mavlink.io, common message set).

use fleet_core::types::{Quat, Vec3};
use nalgebra::Quaternion;
use std::f64::consts::FRAC_1_SQRT_2;

/// A world vector from NED to ENU or from ENU to NED: swaps the first two axes, turns the third.
#[must_use]
pub fn ned_enu(v: Vec3) -> Vec3 {
    Vec3::new(v.y, v.x, -v.z)
}

/// A body vector from FRD to FLU or from FLU to FRD: turns the second and third axes.
#[must_use]
pub fn frd_flu(v: Vec3) -> Vec3 {
    Vec3::new(v.x, -v.y, -v.z)
}

/// An attitude from (FRD to NED) to (FLU to ENU) or back.
///
/// With n the turn NED to ENU, (0, 1, 1, 0)/sqrt 2, and f the turn FLU to FRD, (0, 1, 0, 0), it is
/// n q f; multiplied out, with the sign that keeps the map its own inverse.
#[must_use]
pub fn attitude(q: &Quat) -> Quat {
    let s = FRAC_1_SQRT_2;
    Quat::new_normalize(Quaternion::new(s * (q.w + q.k), s * (q.i + q.j), s * (q.i - q.j), s * (q.w - q.k)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector() -> impl Strategy<Value = Vec3> {
        (-100.0..100.0, -100.0..100.0, -100.0..100.0).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    fn quat() -> impl Strategy<Value = Quat> {
        (-3.0..3.0_f64, -1.5..1.5_f64, -3.0..3.0_f64)
            .prop_map(|(roll, pitch, yaw)| Quat::from_euler_angles(roll, pitch, yaw))
    }

    proptest! {
        #[test]
        fn there_and_back_is_the_identity(v in vector(), q in quat()) {
            prop_assert_eq!(ned_enu(ned_enu(v)), v);
            prop_assert_eq!(frd_flu(frd_flu(v)), v);
            prop_assert!(attitude(&attitude(&q)).angle_to(&q) < 1e-7);
        }

        /// The oracle: turning a body vector by the attitude and changing the world frame must
        /// commute, whatever the vector.
        #[test]
        fn attitude_commutes_with_the_vector_maps(v in vector(), q in quat()) {
            let through_ned = ned_enu(q * v);
            let through_enu = attitude(&q) * frd_flu(v);
            prop_assert!((through_ned - through_enu).norm() < 1e-9 * (1.0 + v.norm()));
        }
    }

    #[test]
    fn facing_north_in_ned_is_a_quarter_turn_left_of_east() {
        let enu = attitude(&Quat::identity());
        assert!((enu * Vec3::x() - Vec3::y()).norm() < 1e-12, "the nose points north");
        assert!((enu * Vec3::z() - Vec3::z()).norm() < 1e-12, "upright stays upright");
    }
}
