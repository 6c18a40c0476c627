//! What a start outside the bounds is allowed, and for how long.
//!
//! A pushed drone may begin faster, harder accelerated or closer than the plan permits. No solver can
//! undo that at once; it is undone with half of the acceleration limit, so that the other half is
//! left for following the plan, and after that every bound is hard.

use crate::trajectory::Knot;
use crate::types::{Limits, Vec3};

/// Largest |jerk| per axis of a replan [m/s^3]. The thrust axis turns at about jerk / g = 2 rad/s:
/// half of what PX4 allows by default (MC_ROLLRATE_MAX 220 deg/s), the rest is left for feedback.
/// The paper bounds no jerk, but a waypoint that only a whip would reach is not reachable.
pub const JERK_MAX: f64 = 20.0;

/// Time [s] to bring back a point that is `depth` beyond a bound and moves further out at `outward`,
/// with constant acceleration `a`: brake to rest, then rest to rest over the whole depth. Zero when
/// it stops before the bound.
pub fn recovery_time(depth: f64, outward: f64, a: f64) -> f64 {
    let deepest = recovery_depth(depth, outward, a);
    if deepest > 0.0 { outward.max(0.0) / a + 2.0 * (deepest / a).sqrt() } else { 0.0 }
}

/// How far beyond the bound that point gets [m]; not positive when it stops before it.
pub fn recovery_depth(depth: f64, outward: f64, a: f64) -> f64 {
    let outward = outward.max(0.0);
    depth + outward * outward / (2.0 * a)
}

/// Limits of one quantity, widened at the start: `limit + excess (1 - (t - from) / (until - from))`
/// per axis, and `limit` from `until` on. `until` is a knot, so that it is linear on every segment.
#[derive(Clone, Copy, Debug)]
pub struct Allowance {
    limit: f64,
    excess: Vec3,
    from: f64,
    until: f64,
}

impl Allowance {
    /// Bound of `|axis|` at mission time `t`.
    pub fn at(&self, axis: usize, t: f64) -> f64 {
        let left = ((self.until - t) / (self.until - self.from)).clamp(0.0, 1.0);
        self.limit + self.excess[axis] * left
    }

    /// Velocity [m/s]. The second control point of the first segment is fixed by the start too and
    /// must fit under the fading bound, of which at least three quarters are left there. Fading takes
    /// a segment more than the excess needs at half authority.
    pub fn velocity(limits: &Limits, start: &Knot, times: &[f64]) -> Self {
        let ahead = start.v + start.a * ((times[1] - times[0]) / 4.0);
        let over = |v: f64| (v.abs() - limits.v_max).max(0.0);
        let excess = start.v.zip_map(&ahead, |v, w| over(v).max(over(w) / 0.75));
        let need = times[1] - times[0] + 2.0 * excess.max() / (0.5 * limits.a_max);
        Self { limit: limits.v_max, excess, from: times[0], until: knot_after(times, times[0] + need) }
    }

    /// Acceleration [m/s^2]: fades with half of the jerk limit.
    pub fn acceleration(limits: &Limits, start: &Knot, times: &[f64]) -> Self {
        let excess = start.a.map(|a| (a.abs() - limits.a_max).max(0.0));
        let need = excess.max() / (0.5 * JERK_MAX);
        Self {
            limit: limits.a_max,
            excess,
            from: times[0],
            until: knot_after(times, times[0] + need).max(times[1]),
        }
    }
}

/// The first knot time not before `t`, or the last.
pub fn knot_after(times: &[f64], t: f64) -> f64 {
    let i = times.partition_point(|x| *x < t - 1e-9);
    times[i.min(times.len() - 1)]
}
