//! Quintics in Bernstein form: the control points bound the curve over continuous time.

use crate::types::Vec3;

/// A vector quintic on [0, h] in Bernstein form; `s = t / h` in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quintic {
    /// Duration [s].
    pub h: f64,
    /// Control points of the position [m].
    pub points: [Vec3; 6],
}

impl Quintic {
    /// The quintic that meets (position, velocity, acceleration) at both ends of `h` seconds.
    ///
    /// Hermite to Bernstein: `b1 = p0 + v0 h/5`, `b2 = p0 + 2 v0 h/5 + a0 h^2/20`, and mirrored
    /// (Farin, Curves and Surfaces for CAGD, section 4.3: end derivatives of a Bezier curve).
    #[must_use]
    pub fn from_ends(h: f64, start: (Vec3, Vec3, Vec3), end: (Vec3, Vec3, Vec3)) -> Self {
        let ((p0, v0, a0), (p1, v1, a1)) = (start, end);
        let points = [
            p0,
            p0 + v0 * (h / 5.0),
            p0 + v0 * (0.4 * h) + a0 * (h * h / 20.0),
            p1 - v1 * (0.4 * h) + a1 * (h * h / 20.0),
            p1 - v1 * (h / 5.0),
            p1,
        ];
        Self { h, points }
    }

    /// Control points of the velocity [m/s].
    #[must_use]
    pub fn velocity_points(&self) -> [Vec3; 5] {
        std::array::from_fn(|i| (self.points[i + 1] - self.points[i]) * (5.0 / self.h))
    }

    /// Control points of the acceleration [m/s^2].
    #[must_use]
    pub fn acceleration_points(&self) -> [Vec3; 4] {
        let v = self.velocity_points();
        std::array::from_fn(|i| (v[i + 1] - v[i]) * (4.0 / self.h))
    }

    /// Control points of the jerk [m/s^3].
    #[must_use]
    pub fn jerk_points(&self) -> [Vec3; 3] {
        let a = self.acceleration_points();
        std::array::from_fn(|i| (a[i + 1] - a[i]) * (3.0 / self.h))
    }

    /// Position at `s` in [0, 1] [m].
    #[must_use]
    pub fn position(&self, s: f64) -> Vec3 {
        de_casteljau(self.points, s)
    }

    /// Velocity at `s` in [0, 1] [m/s].
    #[must_use]
    pub fn velocity(&self, s: f64) -> Vec3 {
        de_casteljau(self.velocity_points(), s)
    }

    /// Acceleration at `s` in [0, 1] [m/s^2].
    #[must_use]
    pub fn acceleration(&self, s: f64) -> Vec3 {
        de_casteljau(self.acceleration_points(), s)
    }

    /// Jerk at `s` in [0, 1] [m/s^3].
    #[must_use]
    pub fn jerk(&self, s: f64) -> Vec3 {
        de_casteljau(self.jerk_points(), s)
    }

    /// The same curve restricted to `[from, to]`, 0 <= from < to <= 1.
    #[must_use]
    pub fn restrict(&self, from: f64, to: f64) -> Self {
        let (_, right) = subdivide(self.points, from);
        let inner = if from < 1.0 { (to - from) / (1.0 - from) } else { 0.0 };
        let (points, _) = subdivide(right, inner);
        Self { h: self.h * (to - from), points }
    }
}

fn de_casteljau<const N: usize>(mut c: [Vec3; N], s: f64) -> Vec3 {
    for level in (1..N).rev() {
        for i in 0..level {
            c[i] = c[i] * (1.0 - s) + c[i + 1] * s;
        }
    }
    c[0]
}

/// Control points of the two halves of a Bernstein polynomial cut at `s` (de Casteljau).
#[must_use]
pub fn subdivide<const N: usize>(points: [Vec3; N], s: f64) -> ([Vec3; N], [Vec3; N]) {
    let mut c = points;
    let (mut left, mut right) = (points, points);
    left[0] = c[0];
    right[N - 1] = c[N - 1];
    for level in (1..N).rev() {
        for i in 0..level {
            c[i] = c[i] * (1.0 - s) + c[i + 1] * s;
        }
        left[N - level] = c[0];
        right[level - 1] = c[level - 1];
    }
    (left, right)
}
