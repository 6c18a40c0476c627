//! Local replanning: from a measured state back to the next topic waypoint, as one Clarabel QP.

use crate::trajectory::{Knot, Trajectory};
use crate::wire::ReplanOutcome;
use serde::{Deserialize, Serialize};

/// What to solve. The plan that it refers to is the one that the [`Replanner`] was made for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// Number of the request; the answer carries it.
    pub id: u64,
    /// Hash of the plan that `rejoin` refers to.
    pub hash: String,
    /// Mission time of the deviation event [s].
    pub t_event: f64,
    /// Deviation at the event [m].
    pub deviation: f64,
    /// Predicted vehicle state at the splice; its `t` is the mission time of the splice.
    pub start: Knot,
    /// Topic waypoints to try, in this order [s].
    pub rejoin: Vec<f64>,
}

/// The answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Solution {
    /// Number of the request.
    pub id: u64,
    /// Hash of the plan it is for.
    pub hash: String,
    /// `Committed` (solved and checked), `Infeasible` or `Refused`; never `Late`.
    pub outcome: ReplanOutcome,
    /// Splice to rejoin, when solved.
    pub trajectory: Option<Trajectory>,
    /// Where it meets the fleet plan [s], when solved.
    pub t_rejoin: Option<f64>,
    /// For people: why each candidate failed.
    pub reason: String,
}
