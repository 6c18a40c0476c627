//! Guaranteed clearances and extremes over continuous time: Bernstein bounds with subdivision.
//!
//! The control points of a polynomial in Bernstein form bound it from both sides, the end points are
//! values of it, and halving brings the two together quadratically (Farin, Curves and Surfaces for
//! CAGD, section 4). Every bound here is on the safe side by at most [`TOLERANCE`].

use super::{Quintic, Trajectory, subdivide};
use crate::geometry::{HalfSpace, Polyhedron};
use crate::types::Vec3;

/// How far below the true minimum a bound may lie [unit of the function].
pub const TOLERANCE: f64 = 1e-7;
/// Halvings after which a piece's bound is taken as it is; 2^-24 of a segment is below a microsecond.
const MAX_DEPTH: u32 = 24;

/// Lower bound of `min over s` of [`Polyhedron::outside`] on a quintic [m]. Values above `enough`
/// are not refined: the result is then only known to be at least `enough`.
#[must_use]
pub fn min_outside(q: &Quintic, region: &Polyhedron, enough: f64) -> f64 {
    let beyond = |points: &[Vec3; 6], f: &HalfSpace| {
        points.iter().map(|p| f.a.dot(p) - f.b).fold(f64::INFINITY, f64::min)
    };
    minimum(
        q.points,
        |c| region.faces().iter().map(|f| beyond(c, f)).fold(f64::NEG_INFINITY, f64::max),
        |c| region.outside(&c[0]).min(region.outside(&c[5])),
        |c| subdivide(c, 0.5),
        enough,
    )
}

/// Lower bound of `min over s` of [`Polyhedron::inside`] on a quintic [m]; `enough` as in [`min_outside`].
#[must_use]
pub fn min_inside(q: &Quintic, region: &Polyhedron, enough: f64) -> f64 {
    minimum(
        q.points,
        |c| c.iter().map(|p| region.inside(p)).fold(f64::INFINITY, f64::min),
        |c| region.inside(&c[0]).min(region.inside(&c[5])),
        |c| subdivide(c, 0.5),
        enough,
    )
}

/// Lower bound of the distance between two quintics of the same duration, run side by side [m];
/// `enough` as in [`min_outside`].
#[must_use]
pub fn min_pair_distance(a: &Quintic, b: &Quintic, enough: f64) -> f64 {
    let d: [Vec3; 6] = std::array::from_fn(|i| a.points[i] - b.points[i]);
    min_value(squared_norm(&d), enough * enough).max(0.0).sqrt()
}

/// Upper bound of the distance between two quintics of the same duration, run side by side [m].
#[must_use]
pub fn max_pair_distance(a: &Quintic, b: &Quintic) -> f64 {
    let d: [Vec3; 6] = std::array::from_fn(|i| a.points[i] - b.points[i]);
    (-min_value(squared_norm(&d).map(|c| -c), f64::INFINITY)).max(0.0).sqrt()
}

/// Lower bound of a scalar polynomial on [0, 1] given by its Bernstein coefficients; `enough` as in
/// [`min_outside`].
#[must_use]
pub fn min_value<const N: usize>(coefficients: [f64; N], enough: f64) -> f64 {
    minimum(
        coefficients,
        |c| c.iter().copied().fold(f64::INFINITY, f64::min),
        |c| c[0].min(c[N - 1]),
        halve,
        enough,
    )
}

/// Upper bound of `|x_axis|` over a vector polynomial, for each axis; `enough`: values below it are
/// not refined.
#[must_use]
pub fn max_abs<const N: usize>(points: &[Vec3; N], enough: f64) -> Vec3 {
    Vec3::from_fn(|axis, _| {
        let up = std::array::from_fn::<f64, N, _>(|i| -points[i][axis]);
        let down = std::array::from_fn::<f64, N, _>(|i| points[i][axis]);
        (-min_value(up, -enough)).max(-min_value(down, -enough))
    })
}

/// Bernstein coefficients of `|d(s)|^2`, degree 10, from those of the quintic `d`.
fn squared_norm(d: &[Vec3; 6]) -> [f64; 11] {
    const C5: [f64; 6] = [1.0, 5.0, 10.0, 10.0, 5.0, 1.0];
    const C10: [f64; 11] = [1.0, 10.0, 45.0, 120.0, 210.0, 252.0, 210.0, 120.0, 45.0, 10.0, 1.0];
    let mut c = [0.0; 11];
    for i in 0..6 {
        for j in 0..6 {
            c[i + j] += C5[i] * C5[j] * d[i].dot(&d[j]);
        }
    }
    std::array::from_fn(|k| c[k] / C10[k])
}

fn halve<const N: usize>(coefficients: [f64; N]) -> ([f64; N], [f64; N]) {
    let mut c = coefficients;
    let (mut left, mut right) = (c, c);
    for level in (1..N).rev() {
        for i in 0..level {
            c[i] = 0.5 * (c[i] + c[i + 1]);
        }
        left[N - level] = c[0];
        right[level - 1] = c[level - 1];
    }
    (left, right)
}

/// Branch and bound over halvings of `root`: a lower bound of the minimum.
fn minimum<T: Copy>(
    root: T,
    lower: impl Fn(&T) -> f64,
    upper: impl Fn(&T) -> f64,
    split: impl Fn(T) -> (T, T),
    enough: f64,
) -> f64 {
    let mut result = f64::INFINITY;
    let mut best = upper(&root);
    let mut open = vec![(root, 0_u32)];
    while let Some((piece, depth)) = open.pop() {
        let low = lower(&piece);
        best = best.min(upper(&piece));
        if low >= enough || low >= best - TOLERANCE || depth == MAX_DEPTH {
            result = result.min(low);
        } else {
            let (left, right) = split(piece);
            open.push((left, depth + 1));
            open.push((right, depth + 1));
        }
    }
    result
}

impl Trajectory {
    /// The quintic of `[from, to]` [s], which must lie within one segment up to rounding.
    #[must_use]
    pub fn piece(&self, from: f64, to: f64) -> Quintic {
        let i = self.segment_at(0.5 * (from + to));
        let (t0, t1) = (self.knots()[i].t, self.knots()[i + 1].t);
        let s = |t: f64| ((t - t0) / (t1 - t0)).clamp(0.0, 1.0);
        self.quintic(i).restrict(s(from), s(to))
    }

    /// `from`, `to` and the knot times strictly between them [s], rising.
    #[must_use]
    pub fn breaks(&self, from: f64, to: f64) -> Vec<f64> {
        common_breaks(&[self], from, to)
    }

    /// Lower bound of the distance to `other` over the mission times `[from, to]` [m]; both must be
    /// defined there. `enough` as in [`min_outside`].
    #[must_use]
    pub fn min_distance(&self, other: &Self, from: f64, to: f64, enough: f64) -> f64 {
        common_breaks(&[self, other], from, to)
            .windows(2)
            .map(|w| min_pair_distance(&self.piece(w[0], w[1]), &other.piece(w[0], w[1]), enough))
            .fold(f64::INFINITY, f64::min)
    }
}

/// `from`, `to` and every knot time of `trajectories` strictly between them [s], rising.
#[must_use]
pub fn common_breaks(trajectories: &[&Trajectory], from: f64, to: f64) -> Vec<f64> {
    /// Knots closer than this are one [s]: times come from sums of decimal fractions.
    const SAME: f64 = 1e-9;
    let mut times = vec![from];
    for trajectory in trajectories {
        times.extend(trajectory.knots().iter().map(|k| k.t).filter(|t| *t > from + SAME && *t < to - SAME));
    }
    times.sort_by(f64::total_cmp);
    times.dedup_by(|b, a| *b - *a < SAME);
    times.push(to);
    times
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vec3(range: f64) -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(-range..range).prop_map(Vec3::from)
    }

    fn quintic() -> impl Strategy<Value = Quintic> {
        let end = || (vec3(5.0), vec3(3.0), vec3(3.0));
        (0.1..4.0, end(), end()).prop_map(|(h, a, b)| Quintic::from_ends(h, a, b))
    }

    /// Least value of `f` on a fine grid, the oracle of every bound.
    fn sampled(f: impl Fn(f64) -> f64) -> f64 {
        (0..=2000).map(|k| f(f64::from(k) / 2000.0)).fold(f64::INFINITY, f64::min)
    }

    proptest! {
        #[test]
        fn bounds_lie_just_below_the_sampled_minimum(a in quintic(), b in quintic(), low in vec3(3.0)) {
            let region = Polyhedron::from_box(low, low + Vec3::new(1.0, 2.0, 3.0)).unwrap();
            let b = Quintic { h: a.h, ..b };
            let speed = a.h * 40.0; // loose Lipschitz constant for the grid's own error
            let cases = [
                (min_outside(&a, &region, f64::INFINITY), sampled(|s| region.outside(&a.position(s)))),
                (min_inside(&a, &region, f64::INFINITY), sampled(|s| region.inside(&a.position(s)))),
                (
                    min_pair_distance(&a, &b, f64::INFINITY),
                    sampled(|s| (a.position(s) - b.position(s)).norm()),
                ),
            ];
            for (bound, least) in cases {
                prop_assert!(bound <= least + 1e-9, "bound {bound} above a sample {least}");
                prop_assert!(bound >= least - 2e-3 * (1.0 + speed), "bound {bound} far below {least}");
            }
        }

        #[test]
        fn early_stop_never_changes_the_verdict(a in quintic(), low in vec3(3.0)) {
            let region = Polyhedron::from_box(low, low + Vec3::new(1.0, 2.0, 3.0)).unwrap();
            let exact = min_outside(&a, &region, f64::INFINITY);
            prop_assume!(exact.abs() > 1e-6);
            prop_assert_eq!(min_outside(&a, &region, 0.0) >= 0.0, exact >= 0.0);
        }

        #[test]
        fn largest_absolute_value_bounds_every_sample(a in quintic()) {
            let bound = max_abs(&a.velocity_points(), 0.0);
            for axis in 0..3 {
                let least = sampled(|s| -a.velocity(s)[axis].abs());
                prop_assert!(bound[axis] >= -least - 1e-9);
                prop_assert!(bound[axis] <= -least + 1e-2 * (1.0 + a.h + 40.0 / a.h));
            }
        }
    }
}
