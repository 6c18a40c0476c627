//! The knots of a replan: two fixed ends, free knots between, all around the fleet plan.

use super::basis::UNIT;
use crate::trajectory::{Knot, Trajectory};
use crate::types::Vec3;

/// Knot times with the scaled states that the variables deviate from: the start, the fleet plan at
/// the knots between, and the fleet plan at the rejoin.
#[derive(Debug)]
pub struct States {
    /// The start as requested.
    pub start: Knot,
    /// Position and velocity of the start, less those of the plan at its time [m, m/s].
    pub off: (Vec3, Vec3),
    /// Knot times [s].
    pub times: Vec<f64>,
    /// Per knot and axis `(p, v TAU, a TAU^2)`.
    pub base: Vec<[[f64; 3]; 3]>,
}

impl States {
    /// States from `start` to the plan at the last of `times`.
    pub fn new(start: &Knot, plan: &Trajectory, times: Vec<f64>) -> Self {
        let (p, v, _) = plan.motion(start.t);
        let off = (start.p - p, start.v - v);
        let scaled = |p: &Vec3, v: &Vec3, a: &Vec3| {
            std::array::from_fn(|d| [p[d] * UNIT[0], v[d] * UNIT[1], a[d] * UNIT[2]])
        };
        let base = times
            .iter()
            .enumerate()
            .map(|(k, t)| {
                let (p, v, a) = if k == 0 { (start.p, start.v, start.a) } else { plan.motion(*t) };
                scaled(&p, &v, &a)
            })
            .collect();
        Self { start: *start, off, times, base }
    }

    /// Number of segments.
    pub fn segments(&self) -> usize {
        self.times.len() - 1
    }

    /// Free knots times three: variables per axis.
    pub fn per_axis(&self) -> usize {
        3 * (self.times.len() - 2)
    }

    /// Variable of a knot's derivative on an axis; none at the fixed ends.
    pub fn column(&self, knot: usize, axis: usize, derivative: usize) -> Option<usize> {
        let free = knot > 0 && knot + 1 < self.times.len();
        free.then(|| axis * self.per_axis() + 3 * (knot - 1) + derivative)
    }

    /// Variables of a segment's two knots on an axis, in the order of [`super::basis::Basis`].
    pub fn columns(&self, segment: usize, axis: usize) -> impl Iterator<Item = Option<usize>> + '_ {
        (0..6).map(move |i| self.column(segment + i / 3, axis, i % 3))
    }

    /// Value of a basis row at the base states.
    pub fn base_value(&self, segment: usize, axis: usize, row: &[f64; 6]) -> f64 {
        let (a, b) = (&self.base[segment][axis], &self.base[segment + 1][axis]);
        (0..3).map(|i| row[i] * a[i] + row[3 + i] * b[i]).sum()
    }
}
