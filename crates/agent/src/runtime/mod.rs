//! Clock, sockets, threads and disk around the pure step.
//!
//! The control thread alone calls [`crate::Agent::step`]; it talks to the other threads through
//! bounded queues and never waits for them, for Zenoh or for the disk.

pub mod clock;
pub mod comms;
pub mod control;
pub mod persist;
pub mod plans;
pub mod queue;
pub mod recording;
pub mod vehicle_link;
pub mod worker;

use crate::config::MavlinkEndpoint;
use crate::io::Input;
use crate::record::InboxError;
use std::net::SocketAddr;
use std::thread::JoinHandle;
use thiserror::Error;

/// What wakes the control thread before its next tick.
#[derive(Debug)]
pub enum Wake {
    /// Bytes from the MAVLink socket.
    Datagram {
        /// The datagram.
        bytes: Vec<u8>,
        /// Its sender.
        from: SocketAddr,
    },
    /// A message for the step.
    Input(Input),
    /// SIGINT or SIGTERM.
    Signal,
    /// Standard input was closed.
    Orphaned,
}

/// Why the agent cannot start.
#[derive(Debug, Error)]
pub enum RuntimeError {
    /// The MAVLink socket.
    #[error("mavlink {endpoint}: {source}")]
    Mavlink {
        /// As configured.
        endpoint: MavlinkEndpoint,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A thread.
    #[error("cannot start the {name} thread: {source}")]
    Thread {
        /// Which.
        name: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The signal handlers.
    #[error("cannot handle signals: {0}")]
    Signals(std::io::Error),
    /// The log.
    #[error(transparent)]
    Record(InboxError),
}

/// Starts a named thread.
///
/// # Errors
/// When the system gives none.
pub fn spawn(
    name: &'static str,
    body: impl FnOnce() + Send + 'static,
) -> Result<JoinHandle<()>, RuntimeError> {
    std::thread::Builder::new()
        .name(name.to_owned())
        .spawn(body)
        .map_err(|source| RuntimeError::Thread { name, source })
}
