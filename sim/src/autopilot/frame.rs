//! ENU/FLU to NED/FRD and geodetic coordinates. Only the MAVLink-facing files use this.

use fleet_core::types::{Quat, Vec3};
use nalgebra::{Quaternion, UnitQuaternion};
use std::f64::consts::FRAC_1_SQRT_2;

/// Latitude of the scenario's origin [deg]: PX4's default simulation home.
pub const LATITUDE: f64 = 47.397_742;
/// Longitude of the scenario's origin [deg].
pub const LONGITUDE: f64 = 8.545_594;
/// Altitude of the scenario's origin above mean sea level [m].
pub const ALTITUDE: f64 = 488.0;
/// Radius of the earth that PX4 projects with [m]: `CONSTANTS_RADIUS_OF_EARTH`.
const EARTH: f64 = 6_371_000.0;

/// Swaps ENU and NED, or FLU-free vectors of the world; its own inverse.
#[must_use]
pub fn world(v: &Vec3) -> Vec3 {
    Vec3::new(v.y, v.x, -v.z)
}

/// Swaps FLU and FRD; its own inverse.
#[must_use]
pub fn body(v: &Vec3) -> Vec3 {
    Vec3::new(v.x, -v.y, -v.z)
}

/// Attitude FLU to ENU as FRD to NED, or back, with `w >= 0`.
#[must_use]
pub fn attitude(q: &Quat) -> Quat {
    let world = Quaternion::new(0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2, 0.0);
    let body = Quaternion::new(0.0, 1.0, 0.0, 0.0);
    let turned = world * q.quaternion() * body;
    let sign = if turned.w < 0.0 { -1.0 } else { 1.0 };
    UnitQuaternion::new_normalize(sign * turned)
}

/// Latitude and longitude [1e-7 deg] and altitude [mm] of a scenario position [m; ENU].
#[must_use]
pub fn geodetic(p: &Vec3) -> (i32, i32, i32) {
    let latitude = LATITUDE + (p.y / EARTH).to_degrees();
    let longitude = LONGITUDE + (p.x / (EARTH * LATITUDE.to_radians().cos())).to_degrees();
    (
        (latitude * 1e7).round() as i32,
        (longitude * 1e7).round() as i32,
        ((ALTITUDE + p.z) * 1e3).round() as i32,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_body_vector_means_the_same_in_both_frames(
            axis in prop::array::uniform3(-3.0..3.0f64), v in prop::array::uniform3(-9.0..9.0f64)
        ) {
            let q = Quat::from_scaled_axis(Vec3::from(axis));
            let v = Vec3::from(v);
            let there = attitude(&q) * body(&v);
            prop_assert!((there - world(&(q * v))).norm() < 1e-12);
            prop_assert!((attitude(&attitude(&q)).inverse() * q).angle() < 1e-7);
        }
    }

    #[test]
    fn facing_east_is_a_yaw_of_ninety_degrees() {
        let (roll, pitch, yaw) = attitude(&Quat::identity()).euler_angles();
        assert!(roll.abs() < 1e-12 && pitch.abs() < 1e-12);
        assert!((yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    }
}
