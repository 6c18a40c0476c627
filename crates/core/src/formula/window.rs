//! Extrema over windows of traces: the whole arithmetic of temporal operators.

use super::node::Window;
use std::collections::VecDeque;

/// Robustness at one sample and where it comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Robustness [m].
    pub rho: f64,
    /// Sample at which a predicate attains it.
    pub at: usize,
}

impl Point {
    /// The lesser of two; the first when equal.
    #[must_use]
    pub fn min(self, other: Self) -> Self {
        if other.rho < self.rho { other } else { self }
    }

    /// The greater of two; the first when equal.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        if other.rho > self.rho { other } else { self }
    }
}

/// `out[k] = min trace[k + from ..= k + to]`, for every k for which the window fits.
pub fn sliding_min(trace: &[Point], window: Window) -> Vec<Point> {
    sliding(trace, window, |new, old| new < old)
}

/// `out[k] = max trace[k + from ..= k + to]`, for every k for which the window fits.
pub fn sliding_max(trace: &[Point], window: Window) -> Vec<Point> {
    sliding(trace, window, |new, old| new > old)
}

/// The monotonic deque (Lemire 2006, "Streaming maximum-minimum filter"): each sample enters and leaves once.
fn sliding(trace: &[Point], window: Window, better: impl Fn(f64, f64) -> bool) -> Vec<Point> {
    let Window { from, to } = window;
    let mut out = Vec::with_capacity(trace.len().saturating_sub(to));
    let mut candidates: VecDeque<usize> = VecDeque::new();
    for (i, point) in trace.iter().enumerate().skip(from) {
        while candidates.back().is_some_and(|&j| better(point.rho, trace[j].rho)) {
            candidates.pop_back();
        }
        candidates.push_back(i);
        if i < to {
            continue;
        }
        while candidates.front().is_some_and(|&j| j < i - to + from) {
            candidates.pop_front();
        }
        if let Some(&best) = candidates.front() {
            out.push(trace[best]);
        }
    }
    out
}

/// Until at samples: `out[k] = max over j in [k + from, k + to] of min(right[j], min left[k ..= j])`.
///
/// Quadratic in the window at worst; it ends early once the left side has fallen below the best.
pub fn until(left: &[Point], right: &[Point], window: Window) -> Vec<Point> {
    let count = left.len().min(right.len()).saturating_sub(window.to);
    (0..count)
        .map(|k| {
            let mut held = left[k + 1..=k + window.from].iter().fold(left[k], |a, b| a.min(*b));
            let mut best = right[k + window.from].min(held);
            for j in k + window.from + 1..=k + window.to {
                if held.rho <= best.rho {
                    break;
                }
                held = held.min(left[j]);
                best = best.max(right[j].min(held));
            }
            best
        })
        .collect()
}

/// The negation of every point.
pub fn negated(trace: &[Point]) -> Vec<Point> {
    trace.iter().map(|p| Point { rho: -p.rho, at: p.at }).collect()
}
