//! Local replanning: from a measured state back to the next topic waypoint, as one Clarabel QP.
//!
//! Knots (p, v, a) on segments of at most 0.5 s are the variables; limits, corridors and bisecting
//! planes are rows on Bernstein control points, so they hold between the knots too. What the solver
//! returns is flown only with status Solved and after a check of its own ([`check`]).

mod basis;
mod check;
mod corridor;
mod grid;
mod heading;
mod qp;
mod rows;
mod start;
mod states;

use self::basis::{Basis, UNIT};
use self::corridor::{Scene, Side};
use self::rows::Rows;
use self::states::States;
use crate::geometry::Polyhedron;
use crate::trajectory::{Knot, Trajectory};
use crate::types::{Limits, Vec3};
use crate::wire::{Plan, ReplanOutcome};
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use self::check::CheckError;
pub use self::grid::{LONGEST, SHORTEST};
pub use self::qp::QpError;

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

/// Why no replanner can be made for a plan.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum ReplanError {
    /// The drone is not in the plan.
    #[error("drone {0} is not in the plan")]
    UnknownDrone(String),
    /// The workspace or an obstacle is not among the regions.
    #[error("region {0} is not in the plan")]
    UnknownRegion(String),
}

/// Why one rejoin candidate failed.
#[derive(Clone, Debug, PartialEq, Error)]
enum Failure {
    #[error("is not {SHORTEST} to {LONGEST} s ahead within the plan")]
    Reach,
    #[error("{0}")]
    Qp(#[from] QpError),
    #[error("solved, but {0}")]
    Check(#[from] CheckError),
}

/// Solves replans of one drone against one fleet plan.
#[derive(Clone, Debug)]
pub struct Replanner {
    own: usize,
    limits: Limits,
    workspace: Polyhedron,
    obstacles: Vec<Polyhedron>,
    trajectories: Vec<Trajectory>,
    sides: Vec<Vec<Side>>,
}

impl Replanner {
    /// Prepares the corridors of `drone` along `plan`.
    ///
    /// # Errors
    /// See [`ReplanError`].
    pub fn new(plan: &Plan, drone: &str) -> Result<Self, ReplanError> {
        let own = plan
            .drones
            .iter()
            .position(|d| d.id == drone)
            .ok_or_else(|| ReplanError::UnknownDrone(drone.to_owned()))?;
        let region = |name: &String| {
            plan.region(name).cloned().ok_or_else(|| ReplanError::UnknownRegion(name.clone()))
        };
        let mut replanner = Self {
            own,
            limits: plan.limits,
            workspace: region(&plan.workspace)?,
            obstacles: plan.obstacles.iter().map(region).collect::<Result<_, _>>()?,
            trajectories: plan.drones.iter().map(|d| d.trajectory.clone()).collect(),
            sides: Vec::new(),
        };
        replanner.sides = corridor::sides(&replanner.scene(), own);
        Ok(replanner)
    }

    /// Tries the rejoin candidates in order; the first that is solved and passes the check is
    /// committed. The same request always gives the same answer.
    pub fn solve(&mut self, request: &Request) -> Solution {
        let mut solution = Solution {
            id: request.id,
            hash: request.hash.clone(),
            outcome: ReplanOutcome::Infeasible,
            trajectory: None,
            t_rejoin: None,
            reason: String::new(),
        };
        if !is_finite(&request.start) {
            solution.outcome = ReplanOutcome::Refused;
            "the start is not finite".clone_into(&mut solution.reason);
            return solution;
        }
        let mut reasons = Vec::new();
        for rejoin in &request.rejoin {
            match self.candidate(&request.start, *rejoin) {
                Ok(trajectory) => {
                    solution.outcome = ReplanOutcome::Committed;
                    solution.trajectory = Some(trajectory);
                    solution.t_rejoin = Some(*rejoin);
                    break;
                }
                Err(failure) => {
                    if matches!(failure, Failure::Check(_)) {
                        solution.outcome = ReplanOutcome::Refused;
                    }
                    reasons.push(format!("{rejoin:.2} s: {failure}"));
                }
            }
        }
        solution.reason = if request.rejoin.is_empty() {
            "no waypoint to rejoin at".to_owned()
        } else {
            reasons.join("; ")
        };
        solution
    }

    fn scene(&self) -> Scene<'_> {
        Scene {
            workspace: &self.workspace,
            obstacles: &self.obstacles,
            trajectories: &self.trajectories,
            limits: &self.limits,
        }
    }

    fn candidate(&self, start: &Knot, rejoin: f64) -> Result<Trajectory, Failure> {
        let plan = &self.trajectories[self.own];
        let span = rejoin - start.t;
        // The end may exceed the plan's by the rounding of a sum of periods.
        let within = start.t >= plan.start() && rejoin <= plan.end() + 1e-9;
        if !within || !(SHORTEST..=LONGEST).contains(&span) {
            return Err(Failure::Reach);
        }
        let times = grid::knot_times(start.t, rejoin);
        let bases: Vec<Basis> = times.windows(2).map(|w| Basis::new(w[1] - w[0])).collect();
        let states = States::new(start, plan, times);
        let rows = Rows::build(&states, &bases, &self.limits, &self.sides);
        let x = qp::solve(&states, &bases, &rows)?;
        let trajectory = self.assemble(&states, &x).ok_or(QpError::Setup)?;
        check::check(&trajectory, start, &self.scene(), self.own)?;
        Ok(trajectory)
    }

    /// The trajectory of a solution; none when it holds a value that is not finite.
    fn assemble(&self, states: &States, x: &[f64]) -> Option<Trajectory> {
        let plan = &self.trajectories[self.own];
        let headings = heading::headings(plan, &states.start, &states.times);
        let last = states.segments();
        let knots = (0..=last)
            .map(|k| {
                let value = |derivative: usize| {
                    Vec3::from_fn(|axis, _| {
                        let free = states.column(k, axis, derivative).map_or(0.0, |i| x[i]);
                        (states.base[k][axis][derivative] + free) / UNIT[derivative]
                    })
                };
                let (p, v, a) = if k == 0 {
                    (states.start.p, states.start.v, states.start.a)
                } else {
                    (value(0), value(1), value(2))
                };
                let [psi, psi_rate, psi_acc] = headings[k];
                Knot { t: states.times[k], p, v, a, psi, psi_rate, psi_acc }
            })
            .collect::<Vec<_>>();
        Trajectory::try_from(knots).ok()
    }
}

fn is_finite(knot: &Knot) -> bool {
    let vectors = knot.p.iter().chain(knot.v.iter()).chain(knot.a.iter());
    vectors.chain([&knot.t, &knot.psi, &knot.psi_rate, &knot.psi_acc]).all(|x| x.is_finite())
}
