//! Messages from a drone.

use crate::trajectory::Trajectory;
use crate::types::{Nanos, Reference, Setpoint, State};
use serde::{Deserialize, Serialize};

/// What the agent is doing (safety.md, Modes).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// On the ground, disarmed.
    Idle,
    /// On the ground, armed.
    Armed,
    /// Climbing from the pad to the start of the plan.
    Takeoff,
    /// Following the committed plan.
    Track,
    /// Following the committed plan while a local replan is being solved.
    Replan,
    /// Hovering.
    Hold,
    /// Flying home.
    Return,
    /// Descending to land.
    Land,
    /// Aborted.
    Abort,
    /// A pilot took over; nothing is sent.
    Released,
}

/// Sent 5 times a second; the truth about links (design.md, Zenoh).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Heartbeat {
    /// Drone id.
    pub drone: String,
    /// Sender's clock.
    pub now: Nanos,
    /// Mode.
    pub mode: Mode,
    /// Hash of the committed plan; empty when there is none.
    pub hash: String,
    /// Mission time [s] when a start is known.
    pub mission_time: Option<f64>,
    /// Whether motors are armed, as the autopilot says.
    pub armed: bool,
    /// Remaining battery, 0 to 1, when known.
    pub battery: Option<f64>,
    /// Age of the newest vehicle state [s]; none when never seen.
    pub state_age: Option<f64>,
}

/// Sent 10 times a second.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Telemetry {
    /// Drone id.
    pub drone: String,
    /// Mode.
    pub mode: Mode,
    /// Mission time [s] when a start is known.
    pub mission_time: Option<f64>,
    /// Newest vehicle state.
    pub state: Option<State>,
    /// Committed reference at this time.
    pub reference: Option<Reference>,
    /// Last setpoint sent.
    pub setpoint: Option<Setpoint>,
    /// Distance between state and committed reference [m].
    pub deviation: Option<f64>,
    /// Estimated hover thrust, 0 to 1.
    pub hover_thrust: f64,
    /// Replans committed so far.
    pub replans: u32,
    /// Next topic waypoint [s].
    pub next_topic: Option<f64>,
    /// Next region to visit.
    pub next_region: Option<String>,
}

/// How a local replan ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReplanOutcome {
    /// Solved, checked and committed.
    Committed,
    /// No topic waypoint could be reached; holding.
    Infeasible,
    /// Solved too late to be spliced; tried again.
    Late,
    /// Solved but the own check refused it.
    Refused,
}

/// A local replan, for peers and ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReplanNotice {
    /// Drone id.
    pub drone: String,
    /// How it ended.
    pub outcome: ReplanOutcome,
    /// Mission time of the deviation event [s].
    pub t_event: f64,
    /// Deviation at the event [m].
    pub deviation: f64,
    /// Mission time of the splice [s].
    pub t_splice: Option<f64>,
    /// Topic waypoint at which the fleet plan is met again [s].
    pub t_rejoin: Option<f64>,
    /// The new piece, splice to rejoin.
    pub trajectory: Option<Trajectory>,
}

/// What happened.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum EventKind {
    /// The mode changed.
    Mode {
        /// Before.
        from: Mode,
        /// After.
        to: Mode,
    },
    /// A plan was accepted, committed or dropped.
    Plan {
        /// Its hash.
        hash: String,
    },
    /// The deviation passed eta.
    Deviation {
        /// How far [m].
        metres: f64,
    },
    /// Ground link lost (true) or back (false).
    Link {
        /// Whether it is lost.
        lost: bool,
    },
    /// The vehicle state went missing (true) or came back (false).
    StateStale {
        /// Whether it is missing.
        lost: bool,
    },
    /// The estimator jumped.
    EstimatorReset {
        /// How far [m].
        metres: f64,
    },
    /// The autopilot said something.
    Autopilot {
        /// Its words.
        text: String,
    },
    /// The mission ended for this drone.
    Landed,
    /// A fault that the agent noticed about itself or its surroundings.
    Fault {
        /// Its words.
        text: String,
    },
}

/// An event with its cause.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Event {
    /// Drone id.
    pub drone: String,
    /// Mission time [s] when a start is known.
    pub mission_time: Option<f64>,
    /// What; `what` on the wire, because `kind` there names the kind of message.
    #[serde(rename = "what")]
    pub kind: EventKind,
    /// Why, for people.
    pub cause: String,
}

/// Answer to the `time` query.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeReply {
    /// The agent's clock.
    pub now: Nanos,
}

/// Answer to the `status` query: enough for a restarted ground station to take over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Status {
    /// Drone id.
    pub drone: String,
    /// Mode.
    pub mode: Mode,
    /// Mission id of the committed or offered plan; empty when there is none.
    pub mission_id: String,
    /// Its epoch; 0 when none was ever seen.
    pub epoch: u64,
    /// Last sequence number accepted in this epoch.
    pub seq: u64,
    /// Hash of the committed plan; empty when there is none.
    pub hash: String,
    /// Mission time 0 on the agent's clock, when a start is known.
    pub t0: Option<Nanos>,
    /// Pre-flight checks that fail now, each with what to do.
    pub preflight: Vec<String>,
}
