//! The recorded inbox: what a replay needs to run the same step again.

use super::{Log, RecordError};
use crate::io::{Input, Output};
use crate::{Agent, AgentConfig};
use fleet_core::types::Nanos;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// One call of [`Agent::step`]: its moment, its inbox and the SHA-256 of its outbox in CBOR.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepRecord(pub Nanos, pub Vec<Input>, pub [u8; 32]);

impl StepRecord {
    /// The record of a step that answered `outputs`.
    ///
    /// # Errors
    /// When an output cannot be turned into CBOR.
    pub fn new(now: Nanos, inbox: Vec<Input>, outputs: &[Output]) -> Result<Self, InboxError> {
        Ok(Self(now, inbox, digest(outputs)?))
    }
}

/// Why a recorded inbox could not be written or replayed.
#[derive(Debug, Error)]
pub enum InboxError {
    /// A value could not be turned into CBOR.
    #[error("cannot encode: {0}")]
    Encode(String),
    /// The log could not be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The log could not be read.
    #[error("{path}: not a readable log: {reason}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The reader's reason.
        reason: String,
    },
    /// The log holds no inbox of this drone.
    #[error("{path}: no messages on {topic}; the topics ending in /inbox are: {found}")]
    Missing {
        /// The file.
        path: PathBuf,
        /// The topic looked for.
        topic: String,
        /// The inbox topics that are there.
        found: String,
    },
    /// A recorded message has another shape.
    #[error("{path}: message {index} on {topic} is not what this version records: {reason}")]
    Malformed {
        /// The file.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// Which message, from 0.
        index: usize,
        /// The decoder's reason.
        reason: String,
    },
}

/// How a replay went.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Replay {
    /// Steps replayed.
    pub steps: usize,
    /// The first step (from 0) with another outbox, and its moment.
    pub first_difference: Option<(usize, Nanos)>,
}

/// Writes the configuration: the first message on `/{drone}/inbox`.
///
/// # Errors
/// When it cannot be encoded or written.
pub fn record_config(log: &mut impl Log, config: &AgentConfig, at_ns: u64) -> Result<(), InboxError> {
    log.cbor(&topic(&config.drone), at_ns, cbor(config)?)?;
    Ok(())
}

/// Writes one step on `/{drone}/inbox`.
///
/// # Errors
/// When it cannot be encoded or written.
pub fn record_step(log: &mut impl Log, drone: &str, at_ns: u64, step: &StepRecord) -> Result<(), InboxError> {
    log.cbor(&topic(drone), at_ns, cbor(step)?)?;
    Ok(())
}

/// Feeds the recorded inbox of `drone` through a fresh [`Agent`] and compares the outboxes.
///
/// # Errors
/// When the log cannot be read, holds no such inbox, or was written by another version.
// Reading a log is what this function is for; the step itself stays pure.
#[allow(clippy::disallowed_methods)]
pub fn replay(path: &Path, drone: &str) -> Result<Replay, InboxError> {
    let unreadable = |reason: String| InboxError::Read { path: path.to_path_buf(), reason };
    let bytes = std::fs::read(path).map_err(|error| unreadable(error.to_string()))?;
    let wanted = topic(drone);
    let mut found = std::collections::BTreeSet::new();
    let mut agent: Option<Agent> = None;
    let mut replay = Replay { steps: 0, first_difference: None };
    let messages = mcap::MessageStream::new(&bytes).map_err(|error| unreadable(error.to_string()))?;
    for message in messages {
        let message = message.map_err(|error| unreadable(error.to_string()))?;
        if message.channel.topic.ends_with("/inbox") {
            found.insert(message.channel.topic.clone());
        }
        if message.channel.topic != wanted {
            continue;
        }
        let malformed = |index, reason: String| InboxError::Malformed {
            path: path.to_path_buf(),
            topic: wanted.clone(),
            index,
            reason,
        };
        let Some(agent) = agent.as_mut() else {
            let config: AgentConfig = ciborium::from_reader(message.data.as_ref())
                .map_err(|error| malformed(0, error.to_string()))?;
            agent = Some(Agent::new(config));
            continue;
        };
        let StepRecord(now, inbox, recorded): StepRecord = ciborium::from_reader(message.data.as_ref())
            .map_err(|error| malformed(replay.steps + 1, error.to_string()))?;
        let outputs = agent.step(now, &inbox);
        if replay.first_difference.is_none() && digest(&outputs)? != recorded {
            replay.first_difference = Some((replay.steps, now));
        }
        replay.steps += 1;
    }
    if agent.is_none() {
        let found = found.into_iter().collect::<Vec<_>>().join(", ");
        return Err(InboxError::Missing { path: path.to_path_buf(), topic: wanted, found });
    }
    Ok(replay)
}

fn topic(drone: &str) -> String {
    format!("/{drone}/inbox")
}

fn digest(outputs: &[Output]) -> Result<[u8; 32], InboxError> {
    Ok(Sha256::digest(cbor(&outputs)?).into())
}

fn cbor(value: &impl Serialize) -> Result<Vec<u8>, InboxError> {
    let mut bytes = Vec::new();
    ciborium::into_writer(value, &mut bytes).map_err(|error| InboxError::Encode(error.to_string()))?;
    Ok(bytes)
}
