//! Bounds of a trajectory's velocity and acceleration over continuous time.

use super::{Quintic, Trajectory, subdivide};
use crate::types::Vec3;

/// Refinement stops when the bound is within this of an attained value, relative to the bound.
const TOLERANCE: f64 = 1e-4;
/// Most halvings of one piece; the gap of a Bernstein bound falls by four with each.
const MAX_DEPTH: u32 = 12;

impl Trajectory {
    /// Upper bounds of |velocity| [m/s] and |acceleration| [m/s^2] per axis over continuous time,
    /// within 0.01 % of the true maxima, never below them (convex hull of Bernstein control points).
    #[must_use]
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let mut v = Vec3::zeros();
        let mut a = Vec3::zeros();
        for segment in 0..self.segments() {
            let quintic: Quintic = self.quintic(segment);
            for axis in 0..3 {
                let velocity = quintic.velocity_points().map(|c| Vec3::new(c[axis], 0.0, 0.0));
                v[axis] = largest(velocity, v[axis], MAX_DEPTH);
                let acceleration = quintic.acceleration_points().map(|c| Vec3::new(c[axis], 0.0, 0.0));
                a[axis] = largest(acceleration, a[axis], MAX_DEPTH);
            }
        }
        (v, a)
    }
}

/// The greater of `floor` and a bound of |x| over the piece.
fn largest<const N: usize>(points: [Vec3; N], floor: f64, depth: u32) -> f64 {
    let bound = points.iter().map(|c| c.x.abs()).fold(0.0, f64::max);
    let attained = points[0].x.abs().max(points[N - 1].x.abs()).max(floor);
    if depth == 0 || bound - attained <= TOLERANCE * bound {
        return bound.max(floor);
    }
    let (left, right) = subdivide(points, 0.5);
    largest(right, largest(left, floor, depth - 1), depth - 1)
}
