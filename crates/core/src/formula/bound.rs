//! A guaranteed lower bound of the robustness over the continuous time of trajectories.
//!
//! Time is cut at the samples. Each node gets a lower bound at every sample and one over every
//! *cell*, the closed interval between two samples, and the two are combined upwards:
//! predicates by Bernstein bounds (design.md, Continuous bound), `always` by the cells that its window
//! covers, `eventually` and `until` by the best witness among the samples, past operators alike
//! (`bound_past`). All operands are lower bounds and every operator is monotone, so the result is one
//! too; and it never exceeds the exact robustness on any sampling that contains these samples.

use super::bound_past;
use super::error::FormulaError;
use super::node::{Compiled, Node, Window};
use super::predicate::Predicate;
use super::window::{Point, sliding_max, sliding_min};
use crate::trajectory::Trajectory;
use crate::trajectory::clearance::common_breaks;

/// Subtracted from every predicate [m]: covers rounding (1e-11 m at coordinates up to 10 km) and
/// the nanosecond within which a knot counts as lying on a sample (at speeds up to 99 m/s).
pub const ROUNDING: f64 = 1e-7;
/// How far a trajectory may begin after 0 or end before the horizon [s]: rounding of summed durations.
const TIME_TOLERANCE: f64 = 1e-9;

/// Lower bound at mission time 0 [m] over `trajectories`, one for each drone, and the sample at
/// which, or after which, it is attained. Times between samples count: `always` is meant for all of
/// its window, `eventually` may be met anywhere in it.
///
/// # Errors
/// When there is not one trajectory for each drone, or one does not cover 0 to the horizon.
pub fn lower_bound(formula: &Compiled, trajectories: &[&Trajectory]) -> Result<Point, FormulaError> {
    if trajectories.len() != formula.drones {
        return Err(FormulaError::Tracks(format!(
            "{} trajectories for a fleet of {} drones",
            trajectories.len(),
            formula.drones
        )));
    }
    for trajectory in trajectories {
        if trajectory.start() > TIME_TOLERANCE {
            return Err(FormulaError::Tracks(format!(
                "a trajectory begins at {} s; legal is 0 or earlier",
                trajectory.start()
            )));
        }
        if trajectory.end() < formula.horizon() - TIME_TOLERANCE {
            return Err(FormulaError::Horizon { needed: formula.horizon(), available: trajectory.end() });
        }
    }
    let grid = Grid { trajectories, sample: formula.sample, count: formula.root.horizon() + 1 };
    Ok(grid.bounds(&formula.root).points[0])
}

/// Lower bounds of one node: `points[k]` at sample k, `cells[k]` over samples k to k + 1.
pub(super) struct Bounds {
    pub(super) points: Vec<Point>,
    pub(super) cells: Vec<Point>,
}

struct Grid<'a> {
    trajectories: &'a [&'a Trajectory],
    /// Sample period [s].
    sample: f64,
    /// Number of samples, from mission time 0.
    count: usize,
}

impl Grid<'_> {
    fn bounds(&self, node: &Node) -> Bounds {
        match node {
            Node::Predicate(predicate) => self.predicate(predicate),
            Node::And(fs) => self.combine(fs, Point::min),
            Node::Or(fs) => self.combine(fs, Point::max),
            Node::Always(window, f) => always(&self.bounds(f), *window),
            Node::Eventually(window, f) => eventually(self.bounds(f), *window),
            Node::Until { window, left, right } => until(&self.bounds(left), &self.bounds(right), *window),
            Node::Release { window, left, right } => {
                release(&self.bounds(left), &self.bounds(right), *window)
            }
            Node::Once(window, f) => bound_past::once(&self.bounds(f), *window, self.reached(node)),
            Node::Historically(window, f) => {
                bound_past::historically(&self.bounds(f), *window, self.reached(node))
            }
            Node::Since { window, left, right } => {
                bound_past::since(&self.bounds(left), &self.bounds(right), *window, self.reached(node))
            }
            Node::Trigger { window, left, right } => {
                bound_past::trigger(&self.bounds(left), &self.bounds(right), *window, self.reached(node))
            }
        }
    }

    /// Number of samples at which `node` can be evaluated.
    fn reached(&self, node: &Node) -> usize {
        self.count - node.horizon()
    }

    fn predicate(&self, predicate: &Predicate) -> Bounds {
        let time = |k: usize| k as f64 * self.sample;
        let points = (0..self.count)
            .map(|k| {
                let rho = predicate.value(|drone| self.trajectories[drone].position(time(k)));
                Point { rho: rho - ROUNDING, at: k }
            })
            .collect();
        let involved: Vec<&Trajectory> =
            predicate.drones().into_iter().map(|drone| self.trajectories[drone]).collect();
        let breaks = common_breaks(&involved, 0.0, time(self.count - 1));
        let mut next = breaks.partition_point(|t| *t <= TIME_TOLERANCE);
        let mut cells = Vec::with_capacity(self.count - 1);
        for k in 0..self.count - 1 {
            let (mut from, end) = (time(k), time(k + 1));
            let mut rho = f64::INFINITY;
            while from < end {
                let knot = breaks.get(next).copied().filter(|t| *t < end - TIME_TOLERANCE);
                let to = knot.unwrap_or(end);
                rho = rho.min(predicate.lower_bound(|drone| self.trajectories[drone].piece(from, to)));
                from = to;
                while breaks.get(next).is_some_and(|t| *t <= from + TIME_TOLERANCE) {
                    next += 1;
                }
            }
            cells.push(Point { rho: rho - ROUNDING, at: k });
        }
        Bounds { points, cells }
    }

    fn combine(&self, operands: &[Node], pick: impl Fn(Point, Point) -> Point) -> Bounds {
        let merge = |a: Vec<Point>, b: Vec<Point>| a.into_iter().zip(b).map(|(a, b)| pick(a, b)).collect();
        operands
            .iter()
            .map(|f| self.bounds(f))
            .reduce(|a, b| Bounds { points: merge(a.points, b.points), cells: merge(a.cells, b.cells) })
            .unwrap_or(Bounds { points: Vec::new(), cells: Vec::new() })
    }
}

/// At sample k the window [k + from, k + to] is the union of its cells; over cell k it reaches one further.
fn always(f: &Bounds, window: Window) -> Bounds {
    let Window { from, to } = window;
    let points = if from == to {
        sliding_min(&f.points, window)
    } else {
        sliding_min(&f.cells, Window { from, to: to - 1 })
    };
    Bounds { points, cells: sliding_min(&f.cells, window) }
}

/// Samples from k + 1 + from to k + to are in the window of every moment of cell k; a window of no
/// width only shifts the operand.
fn eventually(f: Bounds, window: Window) -> Bounds {
    let Window { from, to } = window;
    let cells = if from == to {
        sliding_max(&f.cells, window)
    } else {
        sliding_max(&f.points[1..], Window { from, to: to - 1 })
    };
    Bounds { points: sliding_max(&f.points, window), cells }
}

/// The best witness j for which `left` is bounded over all cells up to it.
fn until(left: &Bounds, right: &Bounds, window: Window) -> Bounds {
    let Window { from, to } = window;
    let count = left.points.len().min(right.points.len()).saturating_sub(to);
    // The best of the samples first..=k + to, first > k, as witnesses for moments from sample k on.
    let witness = |k: usize, first: usize| {
        let mut held = left.cells[k + 1..first].iter().fold(left.cells[k], |a, b| a.min(*b));
        let mut best = right.points[first].min(held);
        for j in first + 1..=k + to {
            if held.rho <= best.rho {
                break;
            }
            held = held.min(left.cells[j - 1]);
            best = best.max(right.points[j].min(held));
        }
        best
    };
    let points = (0..count).map(|k| {
        if from > 0 {
            return witness(k, k + from);
        }
        let now = right.points[k].min(left.points[k]);
        if to > 0 { now.max(witness(k, k + 1)) } else { now }
    });
    let cells = (0..count.saturating_sub(1)).map(|k| {
        if from < to {
            return witness(k, k + from + 1);
        }
        left.cells[k..=k + to].iter().fold(right.cells[k + to], |a, b| a.min(*b))
    });
    Bounds { points: points.collect(), cells: cells.collect() }
}

/// For each cell j of the window, `right` over it or the best `left` among the samples before it.
fn release(left: &Bounds, right: &Bounds, window: Window) -> Bounds {
    let Window { from, to } = window;
    let count = left.points.len().min(right.points.len()).saturating_sub(to);
    // `freed` is the best release so far, known at sample k + from.
    let over = |freed: Point, k: usize, last: usize| {
        let (mut freed, mut least) = (freed, right.cells[k + from].max(freed));
        for j in k + from + 1..=last {
            freed = freed.max(left.points[j]);
            if freed.rho >= least.rho {
                break;
            }
            least = least.min(right.cells[j].max(freed));
        }
        least
    };
    let points = (0..count).map(|k| {
        let freed = left.points[k + 1..=k + from].iter().fold(left.points[k], |a, b| a.max(*b));
        if from == to { right.points[k + to].max(freed) } else { over(freed, k, k + to - 1) }
    });
    let cells = (0..count.saturating_sub(1)).map(|k| {
        let freed = left.points[k + 1..=k + from].iter().fold(left.cells[k], |a, b| a.max(*b));
        over(freed, k, k + to)
    });
    Bounds { points: points.collect(), cells: cells.collect() }
}
