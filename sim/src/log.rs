//! What the simulator itself writes to the log: ground truth and crashes.

use crate::world::{Crash, Vehicle};
use fleet_agent::record::{EventMessage, Log, PoseMessage, RecordError, SchemaName};
use fleet_core::types::Nanos;
use fleet_core::wire::{Event, EventKind};

/// Period of the ground truth [ns]: exactly 100 Hz of simulated time.
pub const TRUTH_PERIOD: u64 = 10_000_000;

/// One message of the ground truth.
#[derive(Clone, Debug)]
pub struct TruthMessage {
    /// Where it goes.
    topic: String,
    /// When, on the log's clock [ns].
    at_ns: u64,
    message: PoseMessage,
}

impl TruthMessage {
    /// Writes it.
    ///
    /// # Errors
    /// When the log cannot be written.
    pub fn record(&self, log: &mut impl Log) -> Result<(), RecordError> {
        log.json(&self.topic, SchemaName::Pose, self.at_ns, &self.message)
    }
}

/// `/{drone}/truth` of a vehicle at `now` when it is due, else nothing. `at_ns` is `now` on the log's
/// clock.
#[must_use]
pub fn truth(vehicle: &Vehicle, now: Nanos, mission_time: Option<f64>, at_ns: u64) -> Option<TruthMessage> {
    now.0.is_multiple_of(TRUTH_PERIOD).then(|| {
        let truth = vehicle.truth();
        TruthMessage {
            topic: format!("/{}/truth", vehicle.id()),
            at_ns,
            message: PoseMessage::motion(at_ns, truth.p, truth.v, truth.q, truth.w, mission_time),
        }
    })
}

/// Writes a crash to `/event`.
///
/// # Errors
/// When the log cannot be written.
pub fn record_crash(log: &mut impl Log, crash: &Crash, at_ns: u64) -> Result<(), RecordError> {
    let text = format!("crash: {} at ({:.2}, {:.2}, {:.2})", crash.what, crash.p.x, crash.p.y, crash.p.z);
    let event = Event {
        drone: crash.drone.clone(),
        mission_time: crash.mission_time,
        kind: EventKind::Fault { text },
        cause: "seen by the simulator".into(),
    };
    let message = EventMessage::new(at_ns, &crash.drone, &event);
    log.json("/event", SchemaName::Event, at_ns, &message)
}
