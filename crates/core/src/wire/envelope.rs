//! The envelope around every message.

use super::command::{Ack, Command, Commit, Offer};
use super::report::{Event, Heartbeat, ReplanNotice, Telemetry};
use crate::types::Nanos;
use serde::{Deserialize, Serialize};

/// Version of the wire format; another version is refused.
pub const SCHEMA: u16 = 1;

/// Header of every message (safety.md, section 1.3: mission, epoch and sequence from the first day).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Envelope<T> {
    /// [`SCHEMA`].
    pub schema: u16,
    /// Random 128-bit id of the mission in hex (32 characters).
    pub mission_id: String,
    /// Rises with every new fleet plan of a fleet.
    pub epoch: u64,
    /// Rises with every message of one sender within an epoch.
    pub seq: u64,
    /// When it was made. Downward messages carry the *receiving agent's* clock (the ground knows
    /// the offset from the `time` query), upward ones the sender's own.
    pub issued: Nanos,
    /// When it ceases to be valid, same clock as `issued`.
    pub valid_until: Nanos,
    /// The message.
    pub body: T,
}

/// What the ground sends to one drone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Down {
    /// On `down/plan`.
    Offer(Offer),
    /// On `down/commit`.
    Commit(Commit),
    /// On `down/cmd`.
    Command(Command),
}

/// What a drone sends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[allow(clippy::large_enum_variant)] // one at a time, a few a second: a box would only add noise
pub enum Up {
    /// On `up/heartbeat`, 5 Hz.
    Heartbeat(Heartbeat),
    /// On `up/telemetry`, 10 Hz.
    Telemetry(Telemetry),
    /// On `up/event`.
    Event(Event),
    /// On `up/ack`.
    Ack(Ack),
    /// On `up/replan`.
    Replan(ReplanNotice),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{EventKind, Mode, encode};

    #[test]
    fn an_event_survives_the_wire() {
        let event = Event {
            drone: "d1".into(),
            mission_time: Some(1.5),
            kind: EventKind::Mode { from: Mode::Idle, to: Mode::Armed },
            cause: "commanded".into(),
        };
        let sent = Envelope {
            schema: SCHEMA,
            mission_id: "0".repeat(32),
            epoch: 1,
            seq: 2,
            issued: Nanos(3),
            valid_until: Nanos(4),
            body: Up::Event(event),
        };
        let bytes = encode(&sent).expect("encodes");
        assert_eq!(Envelope::<Up>::from_bytes(&bytes).expect("decodes"), sent);
    }
}
