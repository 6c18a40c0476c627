//! MCAP recording, shared by agent and simulator.
//!
//! Log and publish time are whatever clock the caller counts in: Unix time in real flight, virtual
//! time in a simulation. The same calls in the same order give the same bytes.

mod batch;
mod inbox;
mod messages;
mod schema;

pub use batch::Batch;
pub use inbox::{InboxError, Replay, StepRecord, record_config, record_step, replay};
pub use messages::{
    EventMessage, MissionMessage, ModeMessage, Pose, PoseMessage, Position, ReplanMessage, SetpointMessage,
    Timestamp, Unit, record_outputs,
};
pub use schema::SchemaName;

use mcap::records::MessageHeader;
use mcap::{Compression, McapError, WriteOptions, Writer};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a log could not be written.
#[derive(Debug, Error)]
pub enum RecordError {
    /// The file could not be created.
    #[error("{path}: cannot create the log: {source}")]
    Create {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file could not be written.
    #[error("{path}: cannot write the log: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's or the format's reason.
        source: McapError,
    },
    /// A message could not be turned into bytes.
    #[error("message on {topic} cannot be encoded: {reason}")]
    Encode {
        /// Its topic.
        topic: String,
        /// The encoder's reason.
        reason: String,
    },
}

/// Where messages are logged to: a file, or a batch that goes to one later.
pub trait Log {
    /// Logs one JSON message; the first one on a topic fixes the topic's schema.
    ///
    /// # Errors
    /// When the message cannot be encoded or written.
    fn json(
        &mut self,
        topic: &str,
        schema: SchemaName,
        at_ns: u64,
        message: &impl Serialize,
    ) -> Result<(), RecordError> {
        let data = serde_json::to_vec(message)
            .map_err(|error| RecordError::Encode { topic: topic.to_owned(), reason: error.to_string() })?;
        self.write(topic, Some(schema), at_ns, data)
    }

    /// Logs one CBOR message on a topic without schema.
    ///
    /// # Errors
    /// When the message cannot be written.
    fn cbor(&mut self, topic: &str, at_ns: u64, data: Vec<u8>) -> Result<(), RecordError> {
        self.write(topic, None, at_ns, data)
    }

    /// Logs the bytes of one message.
    ///
    /// # Errors
    /// When the message cannot be written.
    fn write(
        &mut self,
        topic: &str,
        schema: Option<SchemaName>,
        at_ns: u64,
        data: Vec<u8>,
    ) -> Result<(), RecordError>;
}

#[derive(Debug)]
struct Channel {
    id: u16,
    sequence: u32,
}

/// One MCAP file being written, in chunks of 1 MiB compressed with LZ4.
pub struct Recorder {
    path: PathBuf,
    writer: Writer<BufWriter<File>>,
    // A second handle on the same file, for fsync.
    file: File,
    channels: BTreeMap<String, Channel>,
}

impl std::fmt::Debug for Recorder {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recorder").field("path", &self.path).finish_non_exhaustive()
    }
}

impl Recorder {
    /// Creates or truncates `path`.
    ///
    /// # Errors
    /// When the file cannot be created or its header not written.
    // The recorder is where logs meet the disk; the pure step never sees it.
    #[allow(clippy::disallowed_methods)]
    pub fn create(path: impl AsRef<Path>) -> Result<Self, RecordError> {
        let path = path.as_ref().to_path_buf();
        let create = |source| RecordError::Create { path: path.clone(), source };
        let file = File::create(&path).map_err(create)?;
        let clone = file.try_clone().map_err(create)?;
        let writer = WriteOptions::new()
            .library("fleet")
            .compression(Some(Compression::Lz4))
            .create(BufWriter::new(file))
            .map_err(|source| RecordError::Write { path: path.clone(), source })?;
        Ok(Self { path, writer, file: clone, channels: BTreeMap::new() })
    }

    /// Ends the current chunk and waits until everything is on the disk, so that at most what
    /// follows is lost when the power goes.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn checkpoint(&mut self) -> Result<(), RecordError> {
        self.writer.flush().map_err(|source| self.failed(source))?;
        self.file.sync_data().map_err(|error| self.failed(McapError::Io(error)))
    }

    /// Writes index and footer and waits until everything is on the disk.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn finish(self) -> Result<(), RecordError> {
        let Self { path, mut writer, .. } = self;
        let failed = |source| RecordError::Write { path: path.clone(), source };
        writer.finish().map_err(failed)?;
        let file =
            writer.into_inner().into_inner().map_err(|error| failed(McapError::Io(error.into_error())))?;
        file.sync_all().map_err(|error| failed(McapError::Io(error)))
    }

    fn open(&mut self, topic: &str, schema: Option<SchemaName>) -> Result<u16, RecordError> {
        let (schema_id, encoding) = match schema {
            Some(name) => {
                let text = name.json_schema().to_string();
                let id = self
                    .writer
                    .add_schema(name.as_str(), "jsonschema", text.as_bytes())
                    .map_err(|source| self.failed(source))?;
                (id, "json")
            }
            None => (0, "cbor"),
        };
        let id = self
            .writer
            .add_channel(schema_id, topic, encoding, &BTreeMap::new())
            .map_err(|source| self.failed(source))?;
        self.channels.insert(topic.to_owned(), Channel { id, sequence: 0 });
        Ok(id)
    }

    fn failed(&self, source: McapError) -> RecordError {
        RecordError::Write { path: self.path.clone(), source }
    }
}

impl Log for Recorder {
    fn write(
        &mut self,
        topic: &str,
        schema: Option<SchemaName>,
        at_ns: u64,
        data: Vec<u8>,
    ) -> Result<(), RecordError> {
        let channel_id = match self.channels.get_mut(topic) {
            Some(channel) => {
                channel.sequence = channel.sequence.wrapping_add(1);
                channel.id
            }
            None => self.open(topic, schema)?,
        };
        let sequence = self.channels.get(topic).map_or(0, |channel| channel.sequence);
        let header = MessageHeader { channel_id, sequence, log_time: at_ns, publish_time: at_ns };
        self.writer.write_to_known_channel(&header, &data).map_err(|source| self.failed(source))
    }
}
