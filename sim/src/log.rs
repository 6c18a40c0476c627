//! What the simulator itself writes to the log: ground truth and crashes.

use crate::world::{Crash, World};
use fleet_agent::record::{EventMessage, PoseMessage, RecordError, Recorder, SchemaName};
use fleet_core::wire::{Event, EventKind};

/// Period of the ground truth [ns]: exactly 100 Hz of simulated time.
pub const TRUTH_PERIOD: u64 = 10_000_000;

/// Writes `/{drone}/truth` of every vehicle when it is due. `at_ns` is the world's time on the
/// log's clock.
///
/// # Errors
/// When the log cannot be written.
pub fn record_truth(recorder: &mut Recorder, world: &World, at_ns: u64) -> Result<(), RecordError> {
    if !world.now().0.is_multiple_of(TRUTH_PERIOD) {
        return Ok(());
    }
    for vehicle in world.vehicles() {
        let truth = vehicle.truth();
        let t = world.mission_time();
        let message = PoseMessage::motion(at_ns, truth.p, truth.v, truth.q, truth.w, t);
        recorder.json(&format!("/{}/truth", vehicle.id()), SchemaName::Pose, at_ns, &message)?;
    }
    Ok(())
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
