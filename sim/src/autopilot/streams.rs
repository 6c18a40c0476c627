//! Which message is due on which link, at PX4's rates for an onboard computer.

use fleet_core::types::Nanos;

/// A client's link, as the binary numbers them; every link has its own rates, as on PX4.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LinkId(pub u32);

/// Message ids that are streamed, with their default rate on a companion link [Hz] (measured on
/// PX4; 0 is off until asked for).
pub const DEFAULT_RATES: [(u32, f64); 17] = [
    (id::HEARTBEAT, 1.0),
    (id::SYS_STATUS, 5.0),
    (id::SYSTEM_TIME, 1.0),
    (id::ATTITUDE, 100.0),
    (id::ATTITUDE_QUATERNION, 50.0),
    (id::LOCAL_POSITION_NED, 30.0),
    (id::GLOBAL_POSITION_INT, 50.0),
    (id::GPS_GLOBAL_ORIGIN, 1.0),
    (id::ATTITUDE_TARGET, 10.0),
    (id::TIMESYNC, 10.0),
    (id::HIL_STATE_QUATERNION, 0.0),
    (id::BATTERY_STATUS, 0.5),
    (id::AUTOPILOT_VERSION, 0.0),
    (id::HOME_POSITION, 0.5),
    (id::EXTENDED_SYS_STATE, 5.0),
    (id::ODOMETRY, 30.0),
    (id::CURRENT_MODE, 0.5),
];

/// MAVLink message ids.
#[allow(missing_docs, reason = "each is the number of the message of its name")]
pub mod id {
    pub const HEARTBEAT: u32 = 0;
    pub const SYS_STATUS: u32 = 1;
    pub const SYSTEM_TIME: u32 = 2;
    pub const ATTITUDE: u32 = 30;
    pub const ATTITUDE_QUATERNION: u32 = 31;
    pub const LOCAL_POSITION_NED: u32 = 32;
    pub const GLOBAL_POSITION_INT: u32 = 33;
    pub const GPS_GLOBAL_ORIGIN: u32 = 49;
    pub const ATTITUDE_TARGET: u32 = 83;
    pub const TIMESYNC: u32 = 111;
    pub const HIL_STATE_QUATERNION: u32 = 115;
    pub const BATTERY_STATUS: u32 = 147;
    pub const AUTOPILOT_VERSION: u32 = 148;
    pub const HOME_POSITION: u32 = 242;
    pub const EXTENDED_SYS_STATE: u32 = 245;
    pub const ODOMETRY: u32 = 331;
    pub const CURRENT_MODE: u32 = 436;
}

/// Shortest interval [ns]: physics and IMU of the measured PX4 ran at 250 Hz.
const SHORTEST: u64 = 4_000_000;
/// Shortest interval of the estimator's position [ns]: capped near 125 Hz.
const SHORTEST_POSITION: u64 = 8_000_000;

#[derive(Clone, Copy, Debug)]
struct Stream {
    id: u32,
    /// Interval [ns]; 0 is off.
    period: u64,
    next: u64,
}

/// Why an interval was not set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The message is never streamed.
    Unknown,
    /// HEARTBEAT's interval is fixed.
    Fixed,
}

/// The streams of one link.
#[derive(Clone, Debug)]
pub struct Streams {
    streams: [Stream; DEFAULT_RATES.len()],
}

impl Streams {
    /// The default rates, first messages at once.
    #[must_use]
    pub fn new(now: Nanos) -> Self {
        Self { streams: DEFAULT_RATES.map(|(id, hz)| Stream { id, period: default_period(hz), next: now.0 }) }
    }

    /// MAV_CMD_SET_MESSAGE_INTERVAL: `period_us` -1 stops, 0 gives the default.
    ///
    /// # Errors
    /// See [`Refusal`].
    pub fn set_interval(&mut self, now: Nanos, id: u32, period_us: f64) -> Result<(), Refusal> {
        if id == id::HEARTBEAT {
            return Err(Refusal::Fixed);
        }
        let index = self.streams.iter().position(|s| s.id == id).ok_or(Refusal::Unknown)?;
        let shortest = match id {
            id::LOCAL_POSITION_NED | id::ODOMETRY | id::GLOBAL_POSITION_INT => SHORTEST_POSITION,
            _ => SHORTEST,
        };
        let period = if period_us < 0.0 {
            0
        } else if period_us == 0.0 {
            default_period(DEFAULT_RATES[index].1)
        } else {
            ((period_us * 1e3) as u64).max(shortest)
        };
        let stream = &mut self.streams[index];
        stream.period = period;
        // Whole multiples of the period, so that streams of one rate leave together.
        stream.next = if period == 0 { 0 } else { now.0.div_ceil(period) * period };
        Ok(())
    }

    /// Calls `send` with every message id that is due.
    pub fn due(&mut self, now: Nanos, mut send: impl FnMut(u32)) {
        for stream in &mut self.streams {
            if stream.period > 0 && now.0 >= stream.next {
                stream.next = (now.0 / stream.period + 1) * stream.period;
                send(stream.id);
            }
        }
    }
}

fn default_period(hz: f64) -> u64 {
    if hz > 0.0 { (1e9 / hz).round() as u64 } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(streams: &mut Streams, id: u32, seconds: u64) -> usize {
        let mut n = 0;
        for ms in 0..seconds * 1000 {
            streams.due(Nanos((1_000 + ms) * 1_000_000), |got| n += usize::from(got == id));
        }
        n
    }

    #[test]
    fn default_and_requested_rates_are_kept() {
        let mut streams = Streams::new(Nanos(1_000_000_000));
        assert!((498..=502).contains(&count(&mut streams.clone(), id::ATTITUDE_QUATERNION, 10)));
        assert_eq!(count(&mut streams.clone(), id::HEARTBEAT, 10), 10);
        let now = Nanos(1_000_000_000);
        assert_eq!(streams.set_interval(now, id::ATTITUDE_QUATERNION, 10_000.0), Ok(()));
        assert_eq!(streams.set_interval(now, id::LOCAL_POSITION_NED, 4_000.0), Ok(()));
        assert_eq!(streams.set_interval(now, id::ATTITUDE, -1.0), Ok(()));
        assert_eq!(count(&mut streams.clone(), id::ATTITUDE_QUATERNION, 10), 1000);
        assert_eq!(count(&mut streams.clone(), id::LOCAL_POSITION_NED, 10), 1250);
        assert_eq!(count(&mut streams.clone(), id::ATTITUDE, 10), 0);
    }

    #[test]
    fn heartbeat_is_fixed_and_unknown_messages_are_refused() {
        let mut streams = Streams::new(Nanos(0));
        assert_eq!(streams.set_interval(Nanos(0), 0, 1e4), Err(Refusal::Fixed));
        assert_eq!(streams.set_interval(Nanos(0), 9999, 1e4), Err(Refusal::Unknown));
    }
}
