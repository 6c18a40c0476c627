//! The one place that reads clocks.

use fleet_core::types::Nanos;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Agent time at process start [ns]: not 0, so that moments shortly before the start exist.
const AT_START: u64 = 1_000_000_000;

/// The agent's monotonic clock; Unix time is only derived from it, for logs.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    start: Instant,
    unix_at_start: u64,
}

impl Clock {
    /// A clock that starts now.
    #[must_use]
    // Time enters the agent here and nowhere else.
    #[allow(clippy::disallowed_methods)]
    pub fn start() -> Self {
        let unix = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self { start: Instant::now(), unix_at_start: nanos(unix) }
    }

    /// Now. A jump of the wall clock does not move it.
    #[must_use]
    pub fn now(&self) -> Nanos {
        Nanos(AT_START.saturating_add(nanos(self.start.elapsed())))
    }

    /// How long until `moment`; zero when it has passed.
    #[must_use]
    pub fn until(&self, moment: Nanos) -> Duration {
        Duration::from_nanos(moment.0.saturating_sub(self.now().0))
    }

    /// Unix time [ns] of `moment`, by the wall clock as it was at the start.
    #[must_use]
    pub fn unix(&self, moment: Nanos) -> u64 {
        self.unix_at_start.saturating_add(moment.0).saturating_sub(AT_START)
    }
}

/// Milliseconds for MAVLink's 32-bit boot clock; wraps after 49 days as the field does.
#[must_use]
pub fn boot_ms(now: Nanos) -> u32 {
    (now.0 / 1_000_000) as u32
}

fn nanos(duration: Duration) -> u64 {
    u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX)
}
