//! Heading of a local replan: the fleet plan's, plus the start's offset fading out.

use crate::trajectory::{Knot, Trajectory};
use crate::types::Vec3;
use std::f64::consts::{PI, TAU};

/// Heading, rate and acceleration [rad, rad/s, rad/s^2].
pub type Heading = [f64; 3];

/// Heading of `trajectory` at mission time `t`, clamped to its ends.
pub fn planned(trajectory: &Trajectory, t: f64) -> Heading {
    let i = trajectory.segment_at(t);
    let (a, b) = (&trajectory.knots()[i], &trajectory.knots()[i + 1]);
    let s = ((t - a.t) / (b.t - a.t)).clamp(0.0, 1.0);
    let q = trajectory.heading_quintic(i);
    [q.position(s).x, q.velocity(s).x, q.acceleration(s).x]
}

/// The fleet plan's heading at `times`, plus a quintic that takes the start's offset from the plan
/// to zero at the last time. The first value equals `start.psi` up to whole turns; the last is the
/// plan's own, so the pieces join without a jump.
pub fn headings(plan: &Trajectory, start: &Knot, times: &[f64]) -> Vec<Heading> {
    let span = times[times.len() - 1] - times[0];
    let [psi, rate, acc] = planned(plan, times[0]);
    let lift = |x: f64| Vec3::new(x, 0.0, 0.0);
    let turn = (start.psi - psi + PI).rem_euclid(TAU) - PI;
    let offset = crate::trajectory::Quintic::from_ends(
        span,
        (lift(turn), lift(start.psi_rate - rate), lift(start.psi_acc - acc)),
        (lift(0.0), lift(0.0), lift(0.0)),
    );
    times
        .iter()
        .map(|t| {
            let s = ((t - times[0]) / span).clamp(0.0, 1.0);
            let [p, r, a] = planned(plan, *t);
            [p + offset.position(s).x, r + offset.velocity(s).x, a + offset.acceleration(s).x]
        })
        .collect()
}
