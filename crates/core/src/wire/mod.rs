//! Everything that crosses Zenoh or lands in a plan file: messages, codec and key names.
//!
//! Messages are CBOR maps with named fields inside an [`Envelope`]. Python sees them through
//! `fleet._core`; nothing is defined twice.

mod byte_string;
mod codec;
mod command;
mod envelope;
pub mod keys;
mod plan;
mod report;

pub use codec::{DecodeError, MAX_BYTES, MAX_DEPTH, decode, encode, plan_hash};
pub use command::{Ack, AckResult, Command, Commit, Offer, RejectCode};
pub use envelope::{Down, Envelope, SCHEMA, Up};
pub use plan::{ClauseResult, DronePlan, Pad, Plan, PlanStatus, PlannedClause, Region, Visit};
pub use report::{
    Event, EventKind, Heartbeat, Mode, ReplanNotice, ReplanOutcome, Status, Telemetry, TimeReply,
};
