//! The thread that writes the log.

use super::clock::Clock;
use super::spawn;
use super::{RuntimeError, queue::Queue};
use crate::AgentConfig;
use crate::io::{Input, Output};
use crate::record::{
    EventMessage, InboxError, Log, RecordError, Recorder, SchemaName, StepRecord, record_config,
    record_outputs, record_step,
};
use fleet_core::types::Nanos;
use fleet_core::wire::{Event, EventKind};
use std::path::Path;
use std::sync::mpsc::Receiver;
use std::thread::JoinHandle;

/// Steps that may wait for the disk: more than ten seconds of flight.
const CAPACITY: usize = 4096;
/// What a power cut may cost [s].
const CHECKPOINT: f64 = 1.0;

/// One call of the step.
#[derive(Debug)]
pub struct Step {
    /// Its moment.
    pub now: Nanos,
    /// What went in.
    pub inbox: Vec<Input>,
    /// What came out.
    pub outputs: Vec<Output>,
    /// Steps before this one that found the queue full and are missing from the log.
    pub lost: u64,
}

/// Creates the log and starts its thread, which ends when the queue's last sender is gone.
///
/// # Errors
/// When the file cannot be created.
pub fn start(
    path: &Path,
    config: &AgentConfig,
    clock: Clock,
) -> Result<(Queue<Step>, JoinHandle<()>), RuntimeError> {
    let mut recorder = Recorder::create(path).map_err(|error| RuntimeError::Record(error.into()))?;
    record_config(&mut recorder, config, clock.unix(clock.now())).map_err(RuntimeError::Record)?;
    let (queue, steps) = Queue::bounded("record", CAPACITY);
    let drone = config.drone.clone();
    let thread = spawn("record", move || run(recorder, &drone, clock, &steps))?;
    Ok((queue, thread))
}

fn run(mut recorder: Recorder, drone: &str, clock: Clock, steps: &Receiver<Step>) {
    let mut flushed = clock.now();
    let mut broken = false;
    for step in steps {
        if broken {
            // The flight goes on without a log; the queue must still be emptied.
            continue;
        }
        let now = step.now;
        let result = write(&mut recorder, drone, clock, step).and_then(|()| {
            if now.since(flushed) < CHECKPOINT {
                return Ok(());
            }
            flushed = now;
            Ok(recorder.checkpoint()?)
        });
        if let Err(error) = result {
            tracing::error!(%error, "the log ends here");
            broken = true;
        }
    }
    if let Err(error) = recorder.finish() {
        tracing::error!(%error, "the log has no index");
    }
}

fn write(recorder: &mut Recorder, drone: &str, clock: Clock, step: Step) -> Result<(), InboxError> {
    let Step { now, inbox, outputs, lost } = step;
    let at_ns = clock.unix(now);
    if lost > 0 {
        record_loss(recorder, drone, at_ns, lost)?;
    }
    record_outputs(recorder, drone, now, at_ns, &outputs)?;
    let record = StepRecord::new(now, inbox, &outputs)?;
    record_step(recorder, drone, at_ns, &record)
}

/// A log with a hole says so where the hole is: what comes after it does not replay.
fn record_loss(recorder: &mut Recorder, drone: &str, at_ns: u64, lost: u64) -> Result<(), RecordError> {
    tracing::error!(lost, "the disk was too slow: steps are missing from the log");
    let event = Event {
        drone: drone.to_owned(),
        mission_time: None,
        kind: EventKind::Fault { text: format!("{lost} steps before this moment are missing from the log") },
        cause: "the disk was too slow".to_owned(),
    };
    recorder.json("/event", SchemaName::Event, at_ns, &EventMessage::new(at_ns, drone, &event))
}
