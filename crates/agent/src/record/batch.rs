//! Messages that were logged on another thread, on their way to the file.

use super::{Log, RecordError, SchemaName};

#[derive(Debug)]
struct Entry {
    topic: String,
    schema: Option<SchemaName>,
    at_ns: u64,
    data: Vec<u8>,
}

/// Encoded messages in the order in which they were logged.
#[derive(Debug, Default)]
pub struct Batch(Vec<Entry>);

impl Batch {
    /// Logs everything to `log` and is empty then.
    ///
    /// # Errors
    /// When a message cannot be written.
    pub fn drain_to(&mut self, log: &mut impl Log) -> Result<(), RecordError> {
        self.0.drain(..).try_for_each(|entry| log.write(&entry.topic, entry.schema, entry.at_ns, entry.data))
    }
}

impl Log for Batch {
    fn write(
        &mut self,
        topic: &str,
        schema: Option<SchemaName>,
        at_ns: u64,
        data: Vec<u8>,
    ) -> Result<(), RecordError> {
        self.0.push(Entry { topic: topic.to_owned(), schema, at_ns, data });
        Ok(())
    }
}
