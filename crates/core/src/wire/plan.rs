//! The plan: trajectories of the whole fleet with the certificate that they satisfy the mission.

use crate::formula::Formula;
use crate::geometry::Polyhedron;
use crate::trajectory::Trajectory;
use crate::types::{Limits, ReplanParams, Vec3};
use serde::{Deserialize, Serialize};

/// A named region of the scenario.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Region {
    /// Unique name; a drone's home is `home.ID`.
    pub name: String,
    /// Its faces.
    pub shape: Polyhedron,
}

/// Where a drone stands before take-off and after landing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pad {
    /// Position of the vehicle's centre at rest [m; ENU].
    pub p: Vec3,
    /// Heading at rest [rad], counter-clockwise from east.
    pub psi: f64,
}

/// A visit that a drone's trajectory makes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Visit {
    /// Region name.
    pub region: String,
    /// Mission time of the visit [s].
    pub t: f64,
    /// Window in which it may happen [s].
    pub window: [f64; 2],
    /// Heading required there [rad], if any.
    pub psi: Option<f64>,
}

/// One drone's part of the plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DronePlan {
    /// Drone id.
    pub id: String,
    /// Its pad.
    pub pad: Pad,
    /// Name of its home region.
    pub home: String,
    /// Mission time 0 to T.
    pub trajectory: Trajectory,
    /// Visits in order of time.
    pub visits: Vec<Visit>,
    /// Topic waypoints [s], rising: `k T_g` and the visit times (design.md, Replan).
    pub topics: Vec<f64>,
}

/// Robustness of one clause.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClauseResult {
    /// Exact robustness at the samples k T_s [m].
    pub rho: f64,
    /// Guaranteed lower bound over continuous time [m]; never above `rho`.
    pub rho_lower: f64,
    /// Mission time at which it is tightest [s].
    pub t_tightest: f64,
}

/// A clause with its proof.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannedClause {
    /// Name of the clause.
    pub id: String,
    /// Source text.
    pub text: String,
    /// `invariant`, `event` or `rest`.
    pub kind: String,
    /// Drones that it speaks of.
    pub drones: Vec<String>,
    /// How much of the fleet's common margin it was planned with, above 0; 1 unless the text says other.
    pub weight: f64,
    /// Clauses of smaller priority give way first when a mission cannot hold.
    pub priority: u32,
    /// Parsed tree.
    pub formula: Formula,
    /// Its robustness in this plan.
    pub result: ClauseResult,
}

/// How planning ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlanStatus {
    /// Every clause holds with a positive lower bound and rho is at its upper bound to tolerance.
    Optimal,
    /// Every clause holds with a positive lower bound.
    Certified,
    /// At least one clause is violated.
    Violated,
}

/// A fleet plan; its file is the CBOR of this alone and its hash the SHA-256 of those bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Version of the format, [`super::SCHEMA`].
    pub schema: u16,
    /// Name of the scenario.
    pub scenario: String,
    /// Name of the fleet.
    pub fleet: String,
    /// Seed of every random choice.
    pub seed: u64,
    /// Mission duration T [s].
    pub horizon: f64,
    /// Sample period T_s [s].
    pub sample: f64,
    /// Limits that the trajectories keep.
    pub limits: Limits,
    /// Parameters of the onboard replanner.
    pub replan: ReplanParams,
    /// Every region by name: workspace, obstacles, targets, homes.
    pub regions: Vec<Region>,
    /// Name of the workspace region.
    pub workspace: String,
    /// Names of the obstacles.
    pub obstacles: Vec<String>,
    /// Mission formula with its robustness.
    pub clauses: Vec<PlannedClause>,
    /// Which method made it.
    pub method: String,
    /// Outcome.
    pub status: PlanStatus,
    /// Least of the clauses' `rho` [m].
    pub rho: f64,
    /// Least of the clauses' `rho_lower` [m].
    pub rho_lower: f64,
    /// Upper bound: the least of what each clause could reach alone [m].
    pub rho_bound: f64,
    /// The drones in order of the scenario.
    pub drones: Vec<DronePlan>,
}

impl Plan {
    /// The drone called `id`.
    #[must_use]
    pub fn drone(&self, id: &str) -> Option<&DronePlan> {
        self.drones.iter().find(|d| d.id == id)
    }

    /// The region called `name`.
    #[must_use]
    pub fn region(&self, name: &str) -> Option<&Polyhedron> {
        self.regions.iter().find(|r| r.name == name).map(|r| &r.shape)
    }
}
