//! The thread that writes the log: a disk that stalls must not stop the physics, nor the MAVLink
//! streams that every agent lives on.

use crate::exit::Failure;
use fleet_agent::record::{RecordError, Recorder};
use fleet_sim::log::{self, TruthMessage};
use fleet_sim::world::Crash;
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

/// Messages that may wait for the disk: half a minute of ten vehicles.
const CAPACITY: usize = 32_768;

/// What is written.
#[derive(Debug)]
pub enum Entry {
    /// Ground truth of one vehicle.
    Truth(TruthMessage),
    /// A crash.
    Crash {
        /// When, on the log's clock [ns].
        at_ns: u64,
        /// What.
        crash: Crash,
    },
}

/// A log being written.
#[derive(Debug)]
pub struct Recording {
    entries: SyncSender<Entry>,
    thread: JoinHandle<Result<(), RecordError>>,
}

impl Recording {
    /// Creates the log and its thread.
    ///
    /// # Errors
    /// When the file cannot be created.
    // Writing beside the physics needs a thread.
    #[allow(clippy::disallowed_methods)]
    pub fn start(path: &Path) -> Result<Self, Failure> {
        let recorder = Recorder::create(path)?;
        let (entries, received) = sync_channel(CAPACITY);
        let thread = std::thread::spawn(move || write(recorder, &received));
        Ok(Self { entries, thread })
    }

    /// Hands on one entry without waiting.
    ///
    /// # Errors
    /// When the log cannot be written, or is so far behind that the ground truth would have a hole:
    /// a verdict on such a log would be worth nothing.
    pub fn write(&self, entry: Entry) -> Result<(), Failure> {
        self.entries.try_send(entry).map_err(|error| {
            Failure::Environment(match error {
                TrySendError::Full(_) => "the disk is too slow for the log".to_owned(),
                TrySendError::Disconnected(_) => "the log could not be written; see above".to_owned(),
            })
        })
    }

    /// Waits until everything is written.
    ///
    /// # Errors
    /// When the log could not be written.
    pub fn finish(self) -> Result<(), Failure> {
        drop(self.entries);
        match self.thread.join() {
            Ok(result) => Ok(result?),
            Err(_) => Err(Failure::Environment("the log's thread ended by itself".to_owned())),
        }
    }
}

fn write(mut recorder: Recorder, entries: &Receiver<Entry>) -> Result<(), RecordError> {
    for entry in entries {
        let written = match entry {
            Entry::Truth(message) => message.record(&mut recorder),
            Entry::Crash { at_ns, crash } => log::record_crash(&mut recorder, &crash, at_ns),
        };
        if let Err(error) = written {
            tracing::error!(%error, "the log ends here");
            return Err(error);
        }
    }
    recorder.finish()
}
