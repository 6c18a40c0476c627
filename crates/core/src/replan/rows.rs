//! The inequality rows of a replan: limits and corridors on Bernstein control points.

use super::basis::Basis;
use super::corridor::{Side, Source};
use super::grid::slots;
use super::start::{Allowance, JERK_MAX, recovery_time};
use super::states::States;
use crate::types::Limits;

/// Margin by which rows are tighter than the bounds, above the solver's feasibility tolerance.
const TIGHTER: f64 = 1e-6;
/// A row is posed from the first when the free solution is nearer to it than this share of the limit.
const NEAR_LIMIT: f64 = 0.15;
/// The same for corridors [m].
const NEAR_SIDE: f64 = 0.15;

/// Rows `coef . x <= upper + slack`, stored one after the other; x are the deviations of the free
/// knots from their base, scaled as in [`Basis`].
#[derive(Debug, Default)]
pub struct Rows {
    starts: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
    upper: Vec<f64>,
    near: Vec<f64>,
    slack: Vec<Option<usize>>,
    segment: Vec<usize>,
    softened: Vec<(Source, usize)>,
}

impl Rows {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.upper.len()
    }

    /// Number of slack variables.
    pub fn slacks(&self) -> usize {
        self.softened.len()
    }

    /// Columns and coefficients of row `i`.
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let end = self.starts.get(i + 1).copied().unwrap_or(self.columns.len());
        let range = self.starts[i]..end;
        self.columns[range.clone()].iter().copied().zip(self.values[range].iter().copied())
    }

    /// Right-hand side of row `i`.
    pub fn upper(&self, i: usize) -> f64 {
        self.upper[i]
    }

    /// Slack variable of row `i`, if it is soft.
    pub fn slack(&self, i: usize) -> Option<usize> {
        self.slack[i]
    }

    /// By how much `x` exceeds row `i`, before any slack.
    pub fn excess(&self, i: usize, x: &[f64]) -> f64 {
        self.row(i).map(|(c, v)| v * x[c]).sum::<f64>() - self.upper[i]
    }

    /// Whether `x` is near enough to row `i` for it to matter; `scale` widens what is near. All rows
    /// matter up to the last soft segment, where the price of slack drives the solution to bounds.
    pub fn is_near(&self, i: usize, x: &[f64], scale: f64) -> bool {
        let pressed = self.softened.iter().any(|(_, soft)| self.segment[i] <= *soft);
        pressed || self.excess(i, x) > -scale * self.near[i]
    }

    /// Appends a row; one without a variable is left to the check after the solve.
    fn push(
        &mut self,
        segment: usize,
        entries: impl Iterator<Item = (usize, f64)>,
        upper: f64,
        near: f64,
        slack: Option<usize>,
    ) {
        let start = self.columns.len();
        for (column, value) in entries {
            if value != 0.0 {
                self.columns.push(column);
                self.values.push(value);
            }
        }
        if self.columns.len() > start {
            self.starts.push(start);
            self.upper.push(upper - TIGHTER);
            self.near.push(near);
            self.slack.push(slack);
            self.segment.push(segment);
        }
    }

    fn slack_of(&mut self, source: Source, segment: usize) -> usize {
        let key = (source, segment);
        self.softened.iter().position(|k| *k == key).unwrap_or_else(|| {
            self.softened.push(key);
            self.softened.len() - 1
        })
    }

    /// Every row of a replan over `states`, with `sides` per slot.
    pub fn build(states: &States, bases: &[Basis], limits: &Limits, sides: &[Vec<Side>]) -> Self {
        let mut rows = Self::default();
        let start = &states.start;
        let speed = Allowance::velocity(limits, start, &states.times);
        let push = Allowance::acceleration(limits, start, &states.times);
        for (k, basis) in bases.iter().enumerate() {
            for axis in 0..3 {
                // The last coefficient is the next segment's first.
                for i in 0..4 {
                    let t = states.times[k] + basis.h * i as f64 / 4.0;
                    rows.limit(states, k, axis, &basis.velocity[i], speed.at(axis, t));
                }
                for i in 0..3 {
                    let t = states.times[k] + basis.h * i as f64 / 3.0;
                    rows.limit(states, k, axis, &basis.acceleration[i], push.at(axis, t));
                }
                // Jerk may jump at a knot, so both neighbours' coefficients count there.
                for row in &basis.jerk {
                    rows.limit(states, k, axis, row, JERK_MAX);
                }
            }
            for slot in slots(states.times[k], states.times[k + 1]) {
                for side in sides.get(slot).map_or(&[][..], Vec::as_slice) {
                    rows.corridor(states, k, basis, side, limits);
                }
            }
        }
        rows
    }

    fn limit(&mut self, states: &States, segment: usize, axis: usize, row: &[f64; 6], bound: f64) {
        let base = states.base_value(segment, axis, row);
        for sign in [1.0, -1.0] {
            let entries = states.columns(segment, axis).zip(row).filter_map(|(c, v)| Some((c?, sign * v)));
            self.push(segment, entries, bound - sign * base, NEAR_LIMIT * bound, None);
        }
    }

    fn corridor(&mut self, states: &States, segment: usize, basis: &Basis, side: &Side, limits: &Limits) {
        let t0 = states.times[segment];
        let soft = is_soft(states, segment, basis, side, limits);
        let slack = soft.then(|| self.slack_of(side.source, segment));
        for (i, row) in basis.position.iter().enumerate() {
            let offset = side.offset(t0 + basis.h * i as f64 / 5.0);
            let base: f64 = (0..3).map(|d| side.normal[d] * states.base_value(segment, d, row)).sum();
            let entries = (0..3).flat_map(|d| {
                let n = side.normal[d];
                states.columns(segment, d).zip(row).filter_map(move |(c, v)| Some((c?, -n * v)))
            });
            self.push(segment, entries, base - offset, NEAR_SIDE, slack);
        }
    }
}

/// Whether the start makes it impossible to keep `side` in this segment: control points that it
/// fixes are beyond, or the deviation from the plan takes longer than until this segment to come back
/// to what the plan can spare there.
fn is_soft(states: &States, segment: usize, basis: &Basis, side: &Side, limits: &Limits) -> bool {
    let (start, h, t) = (&states.start, basis.h, states.times[0]);
    if segment == 0 {
        let first = start.p + start.v * (h / 5.0);
        let second = start.p + start.v * (0.4 * h) + start.a * (h * h / 20.0);
        let fixed = [(0.0, start.p), (0.2, first), (0.4, second)];
        if fixed.iter().any(|(s, p)| side.normal.dot(p) < side.offset(t + s * h)) {
            return true;
        }
    }
    let (off, drift) = states.off;
    let (depth, outward) = (-side.normal.dot(&off) - side.spare, -side.normal.dot(&drift));
    t + recovery_time(depth, outward, 0.5 * limits.a_max) > states.times[segment] + 1e-9
}
