//! Bounded queues whose sender never waits.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

/// Sending end of a bounded queue. What does not fit is dropped and counted: the control thread
/// must never wait for another one.
#[derive(Debug)]
pub struct Queue<T> {
    name: &'static str,
    sender: SyncSender<T>,
    dropped: Arc<AtomicU64>,
}

impl<T> Clone for Queue<T> {
    fn clone(&self) -> Self {
        Self { name: self.name, sender: self.sender.clone(), dropped: Arc::clone(&self.dropped) }
    }
}

impl<T> Queue<T> {
    /// A queue of at most `capacity` messages; `name` stands in the log.
    #[must_use]
    pub fn bounded(name: &'static str, capacity: usize) -> (Self, Receiver<T>) {
        let (sender, receiver) = sync_channel(capacity);
        (Self { name, sender, dropped: Arc::default() }, receiver)
    }

    /// Puts `message` in, or gives it back when the queue is full or nobody reads it any more.
    ///
    /// # Errors
    /// The message itself, when it was dropped.
    pub fn offer(&self, message: T) -> Result<(), T> {
        match self.sender.try_send(message) {
            Ok(()) => Ok(()),
            Err(TrySendError::Full(message) | TrySendError::Disconnected(message)) => {
                let dropped = self.dropped.fetch_add(1, Ordering::Relaxed) + 1;
                // At powers of two: the log must not drown in what it reports.
                if dropped.is_power_of_two() {
                    tracing::warn!(queue = self.name, dropped, "queue is full, messages are dropped");
                }
                Err(message)
            }
        }
    }

    /// How many messages were dropped so far.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_queue_gives_back_counts_and_recovers() {
        let (queue, receiver) = Queue::bounded("test", 2);
        assert_eq!([queue.offer(1), queue.offer(2), queue.offer(3)], [Ok(()), Ok(()), Err(3)]);
        assert_eq!(queue.dropped(), 1);
        assert_eq!(receiver.recv(), Ok(1));
        assert_eq!(queue.offer(4), Ok(()));
        drop(receiver);
        assert_eq!(queue.offer(5), Err(5));
    }
}
