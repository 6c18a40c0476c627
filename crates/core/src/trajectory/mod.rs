//! Piecewise quintic trajectories, given by knots (the paper's motion primitives, section III-C).
//!
//! Between two knots each axis is the quintic that meets position, velocity and acceleration at
//! both ends (Mueller, Hehn, D'Andrea 2015), so a trajectory is twice continuously differentiable
//! by construction and no continuity has to be checked.

mod bernstein;
mod bounds;
pub mod clearance;

pub use bernstein::{Quintic, subdivide};

use crate::types::{Reference, Vec3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Most segments a trajectory may have (design.md, Wire).
pub const MAX_SEGMENTS: usize = 512;
/// Shortest segment [s] (design.md, Wire).
pub const MIN_SEGMENT: f64 = 0.05;
/// Longest segment [s] (design.md, Wire).
pub const MAX_SEGMENT: f64 = 10.0;

/// The full state of a trajectory at one time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Knot {
    /// Mission time [s].
    pub t: f64,
    /// Position [m; ENU].
    pub p: Vec3,
    /// Velocity [m/s; ENU].
    pub v: Vec3,
    /// Acceleration [m/s^2; ENU].
    pub a: Vec3,
    /// Heading [rad], continuous (not wrapped).
    pub psi: f64,
    /// Heading rate [rad/s].
    pub psi_rate: f64,
    /// Heading acceleration [rad/s^2].
    pub psi_acc: f64,
}

/// Why a list of knots is not a trajectory.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum TrajectoryError {
    /// Fewer than two knots or more than [`MAX_SEGMENTS`] segments.
    #[error("a trajectory has 2 to 513 knots, not {0}")]
    Count(usize),
    /// Times do not rise, or a segment is too short or too long.
    #[error("segment {index} lasts {seconds} s; legal is 0.05 to 10 s")]
    Duration {
        /// Which segment.
        index: usize,
        /// How long it is [s].
        seconds: f64,
    },
    /// A value is not finite.
    #[error("knot {0} holds a value that is not finite")]
    NotFinite(usize),
}

/// A checked piecewise quintic trajectory in mission time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<Knot>", into = "Vec<Knot>")]
pub struct Trajectory {
    knots: Vec<Knot>,
}

impl TryFrom<Vec<Knot>> for Trajectory {
    type Error = TrajectoryError;

    fn try_from(knots: Vec<Knot>) -> Result<Self, TrajectoryError> {
        if knots.len() < 2 || knots.len() > MAX_SEGMENTS + 1 {
            return Err(TrajectoryError::Count(knots.len()));
        }
        for (index, k) in knots.iter().enumerate() {
            let finite = [k.t, k.psi, k.psi_rate, k.psi_acc]
                .iter()
                .chain(k.p.iter())
                .chain(k.v.iter())
                .chain(k.a.iter())
                .all(|x| x.is_finite());
            if !finite {
                return Err(TrajectoryError::NotFinite(index));
            }
        }
        for (index, pair) in knots.windows(2).enumerate() {
            let seconds = pair[1].t - pair[0].t;
            // A rounding error of the caller's grid is not a different segment length.
            if !(MIN_SEGMENT - 1e-9..=MAX_SEGMENT + 1e-9).contains(&seconds) {
                return Err(TrajectoryError::Duration { index, seconds });
            }
        }
        Ok(Self { knots })
    }
}

impl From<Trajectory> for Vec<Knot> {
    fn from(trajectory: Trajectory) -> Self {
        trajectory.knots
    }
}

impl Trajectory {
    /// The knots, times rising.
    #[must_use]
    pub fn knots(&self) -> &[Knot] {
        &self.knots
    }

    /// First mission time [s].
    #[must_use]
    pub fn start(&self) -> f64 {
        self.knots[0].t
    }

    /// Last mission time [s].
    #[must_use]
    pub fn end(&self) -> f64 {
        self.knots[self.knots.len() - 1].t
    }

    /// Number of segments.
    #[must_use]
    pub fn segments(&self) -> usize {
        self.knots.len() - 1
    }

    /// Index of the segment that holds mission time `t`, clamped to the first and last.
    #[must_use]
    pub fn segment_at(&self, t: f64) -> usize {
        self.knots.partition_point(|k| k.t <= t).clamp(1, self.knots.len() - 1) - 1
    }

    /// Position quintic of one segment, per axis, in Bernstein form.
    ///
    /// # Panics
    /// When `segment` is not below [`Trajectory::segments`].
    #[must_use]
    pub fn quintic(&self, segment: usize) -> Quintic {
        let (a, b) = (&self.knots[segment], &self.knots[segment + 1]);
        Quintic::from_ends(b.t - a.t, (a.p, a.v, a.a), (b.p, b.v, b.a))
    }

    /// Heading quintic of one segment, in the first coordinate; the other two are zero.
    ///
    /// # Panics
    /// When `segment` is not below [`Trajectory::segments`].
    #[must_use]
    pub fn heading_quintic(&self, segment: usize) -> Quintic {
        let (a, b) = (&self.knots[segment], &self.knots[segment + 1]);
        let lift = |x: f64| Vec3::new(x, 0.0, 0.0);
        let ends = |k: &Knot| (lift(k.psi), lift(k.psi_rate), lift(k.psi_acc));
        Quintic::from_ends(b.t - a.t, ends(a), ends(b))
    }

    /// Position, velocity and acceleration at mission time `t` [m, m/s, m/s^2], clamped to the ends.
    #[must_use]
    pub fn motion(&self, t: f64) -> (Vec3, Vec3, Vec3) {
        let i = self.segment_at(t);
        let (a, b) = (&self.knots[i], &self.knots[i + 1]);
        let s = ((t - a.t) / (b.t - a.t)).clamp(0.0, 1.0);
        let q = self.quintic(i);
        (q.position(s), q.velocity(s), q.acceleration(s))
    }

    /// The reference at mission time `t` [s]; before the start and after the end it rests at the
    /// first and last position.
    #[must_use]
    pub fn sample(&self, t: f64) -> Reference {
        let (first, last) = (&self.knots[0], &self.knots[self.knots.len() - 1]);
        if t < first.t {
            return Reference::rest(first.p, first.psi);
        }
        if t > last.t {
            return Reference::rest(last.p, last.psi);
        }
        let i = self.segment_at(t);
        let (a, b) = (&self.knots[i], &self.knots[i + 1]);
        let h = b.t - a.t;
        let s = (t - a.t) / h;
        let q = self.quintic(i);
        let psi = self.heading_quintic(i);
        Reference {
            p: q.position(s),
            v: q.velocity(s),
            a: q.acceleration(s),
            j: q.jerk(s),
            psi: psi.position(s).x,
            psi_rate: psi.velocity(s).x,
        }
    }

    /// Position at mission time `t` [s], clamped to the ends.
    #[must_use]
    pub fn position(&self, t: f64) -> Vec3 {
        let i = self.segment_at(t);
        let (a, b) = (&self.knots[i], &self.knots[i + 1]);
        self.quintic(i).position(((t - a.t) / (b.t - a.t)).clamp(0.0, 1.0))
    }
}
