//! The independent check of a replan: a solver's word is not enough to fly on.
//!
//! Everything is looked at on the trajectory itself, over continuous time, with the polyhedra and the
//! peers' plans, not with the rows that the solver was given.

use super::corridor::Scene;
use super::start::{Allowance, JERK_MAX, knot_after, recovery_depth, recovery_time};
use crate::trajectory::clearance::{max_abs, min_inside, min_outside, min_value};
use crate::trajectory::{Knot, Trajectory};
use crate::types::Vec3;
use thiserror::Error;

/// Rounding that a bound may be exceeded by [its own unit].
const ROUNDING: f64 = 1e-6;
/// The same for jerk [m/s^3]: it is 60 / h^3 times a difference of positions, so more is lost.
const JERK_ROUNDING: f64 = 1e-3;
/// Largest jump at a splice [m, m/s, m/s^2]; rounding of coordinates of some hundred metres.
const JUMP: f64 = 1e-8;
/// The heading may turn this much faster than planned while the start's offset fades: the limit is
/// for comfort of cameras and thrust margin, not for safety.
const HEADING_HEADROOM: f64 = 1.5;

/// What is wrong with a solved trajectory.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum CheckError {
    /// It does not begin at the splice or end on the plan.
    #[error("it does not join the {0} of the replan")]
    Join(&'static str),
    /// A limit is exceeded.
    #[error("{quantity} exceeds its limit by {by:.4} in the segment from {t:.2} s")]
    Limit {
        /// Which.
        quantity: &'static str,
        /// By how much [its unit].
        by: f64,
        /// Start of the segment [s].
        t: f64,
    },
    /// It leaves the workspace.
    #[error("it leaves the workspace by {by:.3} m in the segment from {t:.2} s")]
    Workspace {
        /// How far [m].
        by: f64,
        /// Start of the segment [s].
        t: f64,
    },
    /// It touches an obstacle.
    #[error("it touches obstacle {index} in the segment from {t:.2} s")]
    Obstacle {
        /// Its place in the plan.
        index: usize,
        /// Start of the segment [s].
        t: f64,
    },
    /// It comes too close to a peer's plan.
    #[error("it comes within {distance:.3} m of drone {index} in the segment from {t:.2} s")]
    Peer {
        /// Its place in the plan.
        index: usize,
        /// Distance [m].
        distance: f64,
        /// Start of the segment [s].
        t: f64,
    },
}

/// Checks a replan of drone `own` from `start` to the fleet plan.
pub fn check(trajectory: &Trajectory, start: &Knot, scene: &Scene<'_>, own: usize) -> Result<(), CheckError> {
    joins(trajectory, start, &scene.trajectories[own])?;
    limits(trajectory, scene)?;
    workspace(trajectory, scene, own)?;
    for segment in 0..trajectory.segments() {
        let q = trajectory.quintic(segment);
        for (index, obstacle) in scene.obstacles.iter().enumerate() {
            if min_outside(&q, obstacle, ROUNDING) <= 0.0 {
                return Err(CheckError::Obstacle { index, t: trajectory.knots()[segment].t });
            }
        }
    }
    (0..scene.trajectories.len()).filter(|i| *i != own).try_for_each(|i| peer(trajectory, scene, own, i))
}

fn joins(trajectory: &Trajectory, start: &Knot, plan: &Trajectory) -> Result<(), CheckError> {
    let (first, last) = (&trajectory.knots()[0], &trajectory.knots()[trajectory.segments()]);
    let same = |k: &Knot, (p, v, a): (Vec3, Vec3, Vec3)| {
        (k.p - p).amax().max((k.v - v).amax()).max((k.a - a).amax()) <= JUMP
    };
    if first.t != start.t || !same(first, (start.p, start.v, start.a)) {
        return Err(CheckError::Join("start"));
    }
    if !same(last, plan.motion(last.t)) {
        return Err(CheckError::Join("end"));
    }
    Ok(())
}

fn limits(trajectory: &Trajectory, scene: &Scene<'_>) -> Result<(), CheckError> {
    let knots = trajectory.knots();
    let times: Vec<f64> = knots.iter().map(|k| k.t).collect();
    let speed = Allowance::velocity(scene.limits, &knots[0], &times);
    let push = Allowance::acceleration(scene.limits, &knots[0], &times);
    for (i, pair) in knots.windows(2).enumerate() {
        let (t, h) = (pair[0].t, pair[1].t - pair[0].t);
        let q = trajectory.quintic(i);
        for axis in 0..3 {
            let (v, a) = (q.velocity_points(), q.acceleration_points());
            let v = excess(&v.map(|c| c[axis]), |s| speed.at(axis, t + s * h));
            let a = excess(&a.map(|c| c[axis]), |s| push.at(axis, t + s * h));
            for (quantity, by) in [("velocity", v), ("acceleration", a)] {
                if by > ROUNDING {
                    return Err(CheckError::Limit { quantity, by, t });
                }
            }
        }
        let by = max_abs(&q.jerk_points(), JERK_MAX).max() - JERK_MAX;
        if by > JERK_ROUNDING {
            return Err(CheckError::Limit { quantity: "jerk", by, t });
        }
        let by = max_abs(&trajectory.heading_quintic(i).velocity_points(), 0.0).x
            - HEADING_HEADROOM * scene.limits.psi_rate_max;
        if by > ROUNDING {
            return Err(CheckError::Limit { quantity: "heading rate", by, t });
        }
    }
    Ok(())
}

/// Upper bound of `|x(s)| - bound(s)`, with a bound that is linear in s in [0, 1].
fn excess<const N: usize>(coefficients: &[f64; N], bound: impl Fn(f64) -> f64) -> f64 {
    let room = |sign: f64| {
        let c =
            std::array::from_fn::<f64, N, _>(|i| bound(i as f64 / (N - 1) as f64) - sign * coefficients[i]);
        min_value(c, 0.0)
    };
    -room(1.0).min(room(-1.0))
}

/// Inside the workspace, up to what the start's deviation makes unavoidable.
fn workspace(trajectory: &Trajectory, scene: &Scene<'_>, own: usize) -> Result<(), CheckError> {
    let plan = &scene.trajectories[own];
    let unavoidable = Unavoidable::new(trajectory, plan, scene);
    for (i, w) in trajectory.knots().windows(2).enumerate() {
        let reach = unavoidable.at(w[0].t);
        let least = if reach > 0.0 {
            let pieces = plan.breaks(w[0].t, w[1].t);
            let inside = |w: &[f64]| min_inside(&plan.piece(w[0], w[1]), scene.workspace, reach);
            (pieces.windows(2).map(inside).fold(f64::INFINITY, f64::min) - reach).min(0.0)
        } else {
            0.0
        };
        let margin = min_inside(&trajectory.quintic(i), scene.workspace, least);
        if margin < least - ROUNDING {
            return Err(CheckError::Workspace { by: -margin, t: w[0].t });
        }
    }
    Ok(())
}

/// `delta_min` from a peer's fleet plan, up to what the start's deviation makes unavoidable.
fn peer(trajectory: &Trajectory, scene: &Scene<'_>, own: usize, index: usize) -> Result<(), CheckError> {
    let (plan, other) = (&scene.trajectories[own], &scene.trajectories[index]);
    let unavoidable = Unavoidable::new(trajectory, plan, scene);
    for w in trajectory.knots().windows(2) {
        let (from, to) = (w[0].t, w[1].t);
        let reach = unavoidable.at(from);
        let delta_min = scene.limits.delta_min;
        let least = if reach > 0.0 {
            (plan.min_distance(other, from, to, delta_min + reach) - reach).clamp(0.0, delta_min)
        } else {
            delta_min
        };
        let distance = trajectory.min_distance(other, from, to, least);
        if distance < least - ROUNDING {
            return Err(CheckError::Peer { index, distance, t: from });
        }
    }
    Ok(())
}

/// How far from the plan the drone must be expected while half of the acceleration limit brings the
/// start's deviation back. Bounds towards workspace and peers may give way by what of it the plan's
/// own margin does not cover, and only for that time; obstacles never do.
struct Unavoidable {
    reach: f64,
    until: f64,
}

impl Unavoidable {
    fn new(trajectory: &Trajectory, plan: &Trajectory, scene: &Scene<'_>) -> Self {
        let start = &trajectory.knots()[0];
        let (p, v, _) = plan.motion(start.t);
        let (off, drift) = (start.p - p, start.v - v);
        let distance = off.norm();
        let outward = if distance > 1e-9 { off.dot(&drift) / distance } else { drift.norm() };
        let a = 0.5 * scene.limits.a_max;
        let times: Vec<f64> = trajectory.knots().iter().map(|k| k.t).collect();
        let until = knot_after(&times, start.t + recovery_time(distance, outward, a));
        Self { reach: recovery_depth(distance, outward, a), until }
    }

    /// For a segment that begins at mission time `t` [m].
    fn at(&self, t: f64) -> f64 {
        if t < self.until - 1e-9 { self.reach } else { 0.0 }
    }
}
