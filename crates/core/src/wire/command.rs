//! Messages from the ground and their answers.

use crate::types::Nanos;
use serde::{Deserialize, Serialize};

/// A fleet plan offered to a drone; nothing changes until [`Commit`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Offer {
    /// SHA-256 of `plan` in hex.
    pub hash: String,
    /// The bytes of the plan file (`X.plan.cbor`), a CBOR byte string.
    #[serde(with = "super::byte_string")]
    pub plan: Vec<u8>,
}

/// All drones accepted: the offered plan becomes the committed one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Commit {
    /// Hash of the accepted plan.
    pub hash: String,
}

/// An operator's command.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "command", rename_all = "snake_case", deny_unknown_fields)]
pub enum Command {
    /// Run the pre-flight checks, enter offboard control and arm.
    Arm,
    /// Fly the committed plan; mission time 0 is `t0` on this agent's clock, at least 10 s ahead.
    Start {
        /// Mission time 0.
        t0: Nanos,
        /// Hash of the plan that is to be flown.
        hash: String,
    },
    /// Stop and hover.
    Hold,
    /// Leave hold or released and rejoin the plan.
    Resume,
    /// Fly home and land.
    Return,
    /// Land here.
    Land,
    /// On the ground: disarm. In the air: descend level and land at once.
    Abort,
    /// Disarm; refused in the air.
    Disarm,
}

/// Why something was refused. One code, one cause.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RejectCode {
    /// Not decodable, wrong version, trailing bytes, too large.
    Malformed,
    /// `valid_until` has passed or lies too far ahead.
    Expired,
    /// Epoch or sequence is not newer.
    Stale,
    /// Another mission is committed and not finished.
    WrongMission,
    /// The hash does not match the bytes or the committed plan.
    Hash,
    /// This drone is not in the plan.
    NotInPlan,
    /// Fleet name differs.
    WrongFleet,
    /// A limit of the plan exceeds the vehicle's, or the trajectory exceeds the plan's.
    Limits,
    /// The trajectory enters an obstacle or leaves the workspace.
    Clearance,
    /// Two drones of the plan come too close.
    Separation,
    /// The trajectory does not begin over the pad, or does not end at rest.
    Ends,
    /// The plan's own proof is missing, not positive, or says that the mission is violated.
    Certificate,
    /// Not possible in this mode.
    Mode,
    /// A pre-flight check failed; the reason says which and what to do.
    Preflight,
    /// The start time is too near, past, or unreasonably far.
    StartTime,
    /// A peer's heartbeat is missing or shows another plan.
    Peer,
    /// The autopilot refused.
    Autopilot,
}

/// Outcome of a request.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "result", rename_all = "snake_case")]
pub enum AckResult {
    /// Done or under way.
    Accepted,
    /// Refused; nothing has changed.
    Rejected {
        /// Machine-readable cause.
        code: RejectCode,
        /// For people: what, where, what to do.
        reason: String,
    },
}

/// Answer to a downward message.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ack {
    /// Drone id.
    pub drone: String,
    /// What is answered: `plan`, `commit`, or the command's name.
    pub of: String,
    /// Epoch of the answered envelope.
    pub epoch: u64,
    /// Sequence number of the answered envelope.
    pub seq: u64,
    /// Outcome.
    pub outcome: AckResult,
}
