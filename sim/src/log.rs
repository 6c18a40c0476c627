//! What the simulator itself writes to the log: ground truth and crashes.

use crate::world::{Crash, World};
use fleet_agent::record::{EventMessage, PoseMessage, RecordError, Recorder, SchemaName};
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
    pub fn record(&self, recorder: &mut Recorder) -> Result<(), RecordError> {
        recorder.json(&self.topic, SchemaName::Pose, self.at_ns, &self.message)
    }
}

/// `/{drone}/truth` of every vehicle when it is due, else nothing. `at_ns` is the world's time on the
/// log's clock.
pub fn truth(world: &World, at_ns: u64) -> impl Iterator<Item = TruthMessage> + '_ {
    let due = world.now().0.is_multiple_of(TRUTH_PERIOD);
    let t = world.mission_time();
    world.vehicles().iter().filter(move |_| due).map(move |vehicle| {
        let truth = vehicle.truth();
        TruthMessage {
            topic: format!("/{}/truth", vehicle.id()),
            at_ns,
            message: PoseMessage::motion(at_ns, truth.p, truth.v, truth.q, truth.w, t),
        }
    })
}

/// Writes what [`truth`] gives.
///
/// # Errors
/// When the log cannot be written.
pub fn record_truth(recorder: &mut Recorder, world: &World, at_ns: u64) -> Result<(), RecordError> {
    truth(world, at_ns).try_for_each(|message| message.record(recorder))
}

/// Writes a crash to `/event`.
///
/// # Errors
/// When the log cannot be written.
pub fn record_crash(recorder: &mut Recorder, crash: &Crash, at_ns: u64) -> Result<(), RecordError> {
    let text = format!("crash: {} at ({:.2}, {:.2}, {:.2})", crash.what, crash.p.x, crash.p.y, crash.p.z);
    let event = Event {
        drone: crash.drone.clone(),
        mission_time: crash.mission_time,
        kind: EventKind::Fault { text },
        cause: "seen by the simulator".into(),
    };
    let message = EventMessage::new(at_ns, &crash.drone, &event);
    recorder.json("/event", SchemaName::Event, at_ns, &message)
}
