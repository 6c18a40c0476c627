//! Lower bounds of past operators over continuous time: cells and samples as in `bound`, looking back.

use super::bound::Bounds;
use super::node::Window;
use super::past::{NEVER, before, once as sliding_once};
use super::window::{Point, negated};

/// What holds of a window without moments.
const ALWAYS: f64 = f64::INFINITY;

/// Samples are witnesses: those from k + 1 - to to k - from are in the window of every moment of cell k;
/// a window of no width only shifts the operand. `count` samples are wanted.
pub fn once(f: &Bounds, window: Window, count: usize) -> Bounds {
    let Window { from, to } = window;
    let cells = if from == to {
        sliding_once(&f.cells, window, count - 1)
    } else {
        sliding_once(&f.points, Window { from, to: to - 1 }, count - 1)
    };
    Bounds { points: sliding_once(&f.points, window, count), cells }
}

/// At sample k the window is the union of its cells; over cell k it reaches one further ahead.
pub fn historically(f: &Bounds, window: Window, count: usize) -> Bounds {
    let Window { from, to } = window;
    let least = |trace: &[Point], window, count| negated(&sliding_once(&negated(trace), window, count));
    let points = if from == to {
        least(&f.points, window, count)
    } else {
        let mut points = least(&f.cells, Window { from: from + 1, to }, count);
        first_moment(&mut points, f, from);
        points
    };
    let mut cells = least(&f.cells, window, count - 1);
    if let Some(last_before) = from.checked_sub(1) {
        first_moment(&mut cells, f, last_before);
    }
    Bounds { points, cells }
}

/// Where the window has shrunk to mission time 0 alone, the value there counts.
fn first_moment(trace: &mut [Point], f: &Bounds, k: usize) {
    if let Some(point) = trace.get_mut(k) {
        *point = f.points[0];
    }
}

/// The best witness j for which `left` is bounded over all cells from it on.
pub fn since(left: &Bounds, right: &Bounds, window: Window, count: usize) -> Bounds {
    let Window { from, to } = window;
    // Witnesses first..=last, `held` what is known of `left` from the last one on, cell j from j on.
    let witness = |first: usize, last: usize, mut held: Point| {
        let mut best = right.points[last].min(held);
        for j in (first..last).rev() {
            if held.rho <= best.rho {
                break;
            }
            held = held.min(left.cells[j]);
            best = best.max(right.points[j].min(held));
        }
        best
    };
    let held = |from: usize, to: usize| left.cells[from..to].iter().copied().reduce(Point::min);
    let points = (0..count).map(|k| match before(k, window) {
        Some((first, last)) => witness(first, last, held(last, k).unwrap_or(left.points[k])),
        None => Point { rho: NEVER, at: k },
    });
    let cells = (0..count - 1).map(|k| {
        let never = Point { rho: NEVER, at: k };
        let Some(last) = k.checked_sub(from) else { return never };
        let kept = held(last, k + 1).unwrap_or(never);
        if from == to {
            return right.cells[last].min(kept);
        }
        witness((k + 1).saturating_sub(to), last, kept)
    });
    Bounds { points: points.collect(), cells: cells.collect() }
}

/// For each cell j of the window, `right` over it or the best `left` among the samples after it.
pub fn trigger(left: &Bounds, right: &Bounds, window: Window, count: usize) -> Bounds {
    let Window { from, to } = window;
    // `made_up` is the best of `left` so far, known of every moment from the end of cell last on.
    let over = |first: usize, last: usize, mut made_up: Point| {
        let mut least = right.cells[last].max(made_up);
        for j in (first..last).rev() {
            made_up = made_up.max(left.points[j + 1]);
            if made_up.rho >= least.rho {
                break;
            }
            least = least.min(right.cells[j].max(made_up));
        }
        least
    };
    let best =
        |from: usize, to: usize, start: Point| left.points[from..to].iter().fold(start, |a, b| a.max(*b));
    let points = (0..count).map(|k| match before(k, window) {
        None => Point { rho: ALWAYS, at: k },
        Some((first, last)) if first == last => right.points[last].max(best(last, k, left.points[k])),
        Some((first, last)) => over(first, last - 1, best(last, k, left.points[k])),
    });
    let cells = (0..count - 1).map(|k| {
        let Some(last) = k.checked_sub(from) else {
            // The window opens at the end of the cell, or later.
            let opens = k + 1 == from;
            let now = || right.points[0].max(best(0, k + 1, left.points[k + 1]));
            return if opens { now() } else { Point { rho: ALWAYS, at: k } };
        };
        over(k.saturating_sub(to), last, best((last + 1).min(k + 1), k + 1, left.cells[k]))
    });
    Bounds { points: points.collect(), cells: cells.collect() }
}
