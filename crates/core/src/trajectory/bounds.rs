//! Bounds of a trajectory's velocity and acceleration.

use super::Trajectory;
use super::clearance::max_abs;
use crate::types::Vec3;

impl Trajectory {
    /// Upper bounds of |velocity| [m/s] and |acceleration| [m/s^2] per axis over continuous time, at
    /// most [`super::clearance::TOLERANCE`] above the true maxima and never below them.
    #[must_use]
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let mut v = Vec3::zeros();
        let mut a = Vec3::zeros();
        for segment in 0..self.segments() {
            let quintic = self.quintic(segment);
            // Nothing below the least of the three maxima so far has to be refined.
            v = v.sup(&max_abs(&quintic.velocity_points(), v.min()));
            a = a.sup(&max_abs(&quintic.acceleration_points(), a.min()));
        }
        (v, a)
    }
}
