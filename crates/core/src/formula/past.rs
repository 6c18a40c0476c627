//! Past operators at samples: windows that look back and are cut at sample 0, where the past begins.

use super::node::Window;
use super::window::Point;
use std::collections::VecDeque;

/// What was once in a window without samples.
pub const NEVER: f64 = f64::NEG_INFINITY;

/// Samples `[k - to, k - from]` from 0 on; None when all of the window lies before sample 0.
pub fn before(k: usize, window: Window) -> Option<(usize, usize)> {
    Some((k.saturating_sub(window.to), k.checked_sub(window.from)?))
}

/// `out[k] = max trace[k - to ..= k - from]` from sample 0 on, for k below `count`.
///
/// The caller sees to it that `trace` reaches to `count - 1 - from`.
pub fn once(trace: &[Point], window: Window, count: usize) -> Vec<Point> {
    let mut candidates: VecDeque<usize> = VecDeque::new();
    (0..count)
        .map(|k| {
            let Some((first, last)) = before(k, window) else { return Point { rho: NEVER, at: k } };
            while candidates.back().is_some_and(|&j| trace[last].rho > trace[j].rho) {
                candidates.pop_back();
            }
            candidates.push_back(last);
            while candidates.front().is_some_and(|&j| j < first) {
                candidates.pop_front();
            }
            candidates.front().map_or(Point { rho: NEVER, at: k }, |&best| trace[best])
        })
        .collect()
}

/// `out[k] = max over j in [k - to, k - from] of min(right[j], min left[j ..= k])`, for k below `count`.
///
/// Quadratic in the window at worst; it ends early once the left side has fallen below the best.
pub fn since(left: &[Point], right: &[Point], window: Window, count: usize) -> Vec<Point> {
    (0..count)
        .map(|k| {
            let Some((first, last)) = before(k, window) else { return Point { rho: NEVER, at: k } };
            let mut held = left[last..k].iter().rev().fold(left[k], |a, b| a.min(*b));
            let mut best = right[last].min(held);
            for j in (first..last).rev() {
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
