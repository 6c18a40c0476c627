//! Exact robustness at the samples of a trace (paper, Definition 1).

use super::error::FormulaError;
use super::node::{Compiled, Node};
use super::past::{once, since};
use super::window::{Point, negated, sliding_max, sliding_min, until};
use crate::types::Vec3;

/// Robustness at every sample at which the formula's horizon fits into the trace; the first is
/// mission time 0. `tracks[d][k]` is the position of drone d at sample k [m].
///
/// # Errors
/// When the tracks do not match the fleet, hold a number that is not finite, or end before the horizon.
pub fn robustness<T: AsRef<[Vec3]>>(formula: &Compiled, tracks: &[T]) -> Result<Vec<Point>, FormulaError> {
    let count = check(formula, tracks)?;
    Ok(trace(&formula.root, tracks, count))
}

/// Robustness at mission time 0 and the sample at which it is attained.
///
/// # Errors
/// As [`robustness`].
pub fn evaluate<T: AsRef<[Vec3]>>(formula: &Compiled, tracks: &[T]) -> Result<Point, FormulaError> {
    let count = check(formula, tracks)?;
    // Later samples cannot matter at time 0.
    let needed = (formula.root.horizon() + 1).min(count);
    Ok(trace(&formula.root, tracks, needed)[0])
}

fn check<T: AsRef<[Vec3]>>(formula: &Compiled, tracks: &[T]) -> Result<usize, FormulaError> {
    if tracks.len() != formula.drones {
        return Err(FormulaError::Tracks(format!(
            "{} tracks for a fleet of {} drones",
            tracks.len(),
            formula.drones
        )));
    }
    let count = tracks.first().map_or(0, |t| t.as_ref().len());
    if tracks.iter().any(|t| t.as_ref().len() != count) {
        return Err(FormulaError::Tracks("the tracks are not equally long".to_owned()));
    }
    if tracks.iter().any(|t| t.as_ref().iter().any(|p| !p.iter().all(|x| x.is_finite()))) {
        return Err(FormulaError::NotFinite("a position".to_owned()));
    }
    if count <= formula.root.horizon() {
        return Err(FormulaError::Horizon {
            needed: formula.horizon(),
            available: count.saturating_sub(1) as f64 * formula.sample,
        });
    }
    Ok(count)
}

/// One point for each of the first `count - horizon` samples.
fn trace<T: AsRef<[Vec3]>>(node: &Node, tracks: &[T], count: usize) -> Vec<Point> {
    match node {
        Node::Predicate(predicate) => (0..count)
            .map(|k| Point { rho: predicate.value(|drone| tracks[drone].as_ref()[k]), at: k })
            .collect(),
        Node::And(fs) => combine(fs, tracks, count, Point::min),
        Node::Or(fs) => combine(fs, tracks, count, Point::max),
        Node::Always(window, f) => sliding_min(&trace(f, tracks, count), *window),
        Node::Eventually(window, f) => sliding_max(&trace(f, tracks, count), *window),
        Node::Until { window, left, right } => {
            until(&trace(left, tracks, count), &trace(right, tracks, count), *window)
        }
        Node::Release { window, left, right } => {
            let (left, right) = (trace(left, tracks, count), trace(right, tracks, count));
            negated(&until(&negated(&left), &negated(&right), *window))
        }
        Node::Once(window, f) => once(&trace(f, tracks, count), *window, count - node.horizon()),
        Node::Historically(window, f) => {
            negated(&once(&negated(&trace(f, tracks, count)), *window, count - node.horizon()))
        }
        Node::Since { window, left, right } => {
            since(&trace(left, tracks, count), &trace(right, tracks, count), *window, count - node.horizon())
        }
        Node::Trigger { window, left, right } => {
            let (left, right) = (trace(left, tracks, count), trace(right, tracks, count));
            negated(&since(&negated(&left), &negated(&right), *window, count - node.horizon()))
        }
    }
}

fn combine<T: AsRef<[Vec3]>>(
    operands: &[Node],
    tracks: &[T],
    count: usize,
    pick: impl Fn(Point, Point) -> Point,
) -> Vec<Point> {
    operands
        .iter()
        .map(|f| trace(f, tracks, count))
        .reduce(|mut all, next| {
            all.truncate(next.len());
            for (a, b) in all.iter_mut().zip(next) {
                *a = pick(*a, b);
            }
            all
        })
        .unwrap_or_default()
}
