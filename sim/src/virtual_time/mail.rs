//! Messages under way: delivered in order, each after its delay.

use fleet_core::types::Nanos;
use std::collections::VecDeque;

/// A queue with one fixed delay.
#[derive(Clone, Debug)]
pub struct Mail<T> {
    delay: u64,
    waiting: VecDeque<(Nanos, T)>,
}

impl<T> Mail<T> {
    /// Everything takes `delay` [ns].
    #[must_use]
    pub fn new(delay: u64) -> Self {
        Self { delay, waiting: VecDeque::new() }
    }

    /// Sends.
    pub fn post(&mut self, now: Nanos, item: T) {
        self.waiting.push_back((Nanos(now.0 + self.delay), item));
    }

    /// The next item that has arrived.
    pub fn take(&mut self, now: Nanos) -> Option<T> {
        match self.waiting.front() {
            Some((due, _)) if *due <= now => self.waiting.pop_front().map(|(_, item)| item),
            _ => None,
        }
    }

    /// Whether something has arrived.
    #[must_use]
    pub fn is_due(&self, now: Nanos) -> bool {
        self.waiting.front().is_some_and(|(due, _)| *due <= now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrives_in_order_after_the_delay() {
        let mut mail = Mail::new(5);
        mail.post(Nanos(10), 'a');
        mail.post(Nanos(12), 'b');
        assert_eq!(mail.take(Nanos(14)), None);
        assert_eq!((mail.take(Nanos(16)), mail.take(Nanos(16))), (Some('a'), None));
        assert!(mail.is_due(Nanos(17)));
        assert_eq!(mail.take(Nanos(99)), Some('b'));
    }
}
