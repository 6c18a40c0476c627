//! What the other drones of the fleet say about themselves.

use fleet_core::types::Nanos;
use fleet_core::wire::{Envelope, Heartbeat, Mode, Up};
use std::collections::BTreeMap;

/// Largest difference between a peer's mission time and ours [s]: the clocks agree within 20 ms
/// (design.md, Start), a heartbeat may wait one period of 0.2 s.
const MISSION_TIME: f64 = 0.5;
/// Oldest heartbeat that counts [s]: five may be lost.
const AGE: f64 = 1.2;
/// Drones that are remembered; whoever can publish could name any number of them.
const MOST: usize = 256;

/// Newest heartbeat of every drone heard, with its arrival.
#[derive(Clone, Debug, Default)]
pub struct Peers {
    heard: BTreeMap<String, (Nanos, Heartbeat)>,
}

impl Peers {
    /// Takes the bytes of a peer's envelope; what is not a heartbeat of this schema is ignored here.
    pub fn take(&mut self, now: Nanos, bytes: &[u8]) {
        let Ok(envelope) = Envelope::<Up>::from_bytes(bytes) else { return };
        let Up::Heartbeat(heartbeat) = envelope.body else { return };
        if self.heard.len() < MOST || self.heard.contains_key(&heartbeat.drone) {
            self.heard.insert(heartbeat.drone.clone(), (now, heartbeat));
        }
    }

    /// Why `drone` is not ready to fly the plan `hash` with us at mission time `t`, if it is not.
    pub fn complaint(&self, now: Nanos, drone: &str, hash: &str, t: f64, modes: &[Mode]) -> Option<String> {
        let Some((at, heartbeat)) = self.heard.get(drone) else {
            return Some(format!("{drone}: never heard"));
        };
        let age = now.since(*at);
        if age > AGE {
            return Some(format!("{drone}: silent for {age:.1} s"));
        }
        if heartbeat.hash != hash {
            return Some(format!("{drone}: has another plan ({:.8})", heartbeat.hash));
        }
        let Some(theirs) = heartbeat.mission_time else {
            return Some(format!("{drone}: knows no start time"));
        };
        let offset = theirs + age - t;
        if offset.abs() > MISSION_TIME {
            return Some(format!("{drone}: its mission time is {offset:+.2} s off"));
        }
        (!modes.contains(&heartbeat.mode)).then(|| format!("{drone}: is in mode {:?}", heartbeat.mode))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fleet_core::wire::{SCHEMA, encode};

    fn heard(change: impl Fn(&mut Heartbeat)) -> Peers {
        let mut peers = Peers::default();
        peers.take(Nanos(0), &message(change));
        peers
    }

    fn message(change: impl Fn(&mut Heartbeat)) -> Vec<u8> {
        let mut heartbeat = Heartbeat {
            drone: "d2".into(),
            now: Nanos(7),
            mode: Mode::Armed,
            hash: "aa".into(),
            mission_time: Some(-10.1),
            armed: true,
            battery: None,
            state_age: Some(0.0),
        };
        change(&mut heartbeat);
        let envelope = Envelope {
            schema: SCHEMA,
            mission_id: "0".repeat(32),
            epoch: 1,
            seq: 1,
            issued: Nanos(7),
            valid_until: Nanos(8),
            body: Up::Heartbeat(heartbeat),
        };
        encode(&envelope).expect("encodes")
    }

    #[test]
    fn a_flood_of_names_is_forgotten_and_known_drones_are_heard() {
        let mut peers = heard(|_| ());
        for k in 0..2 * MOST {
            peers.take(Nanos(1), &message(|h| h.drone = format!("x{k}")));
        }
        assert_eq!(peers.heard.len(), MOST);
        peers.take(Nanos(2), &message(|h| h.mode = Mode::Abort));
        assert_eq!(peers.heard["d2"].0, Nanos(2));
    }

    #[test]
    fn each_condition_is_needed() {
        let now = Nanos(100_000_000);
        let ask = |peers: &Peers, now| peers.complaint(now, "d2", "aa", -10.0, &[Mode::Armed]);
        assert_eq!(ask(&heard(|_| ()), now), None);
        for (peers, now, word) in [
            (Peers::default(), now, "never"),
            (heard(|_| ()), Nanos(2_000_000_000), "silent"),
            (heard(|h| h.hash = "bb".into()), now, "another plan"),
            (heard(|h| h.mission_time = None), now, "no start"),
            (heard(|h| h.mission_time = Some(-12.0)), now, "off"),
            (heard(|h| h.mode = Mode::Abort), now, "mode"),
        ] {
            let complaint = ask(&peers, now).expect("a complaint");
            assert!(complaint.contains(word), "{complaint}");
        }
    }

    #[test]
    fn junk_is_ignored() {
        let mut peers = Peers::default();
        peers.take(Nanos(0), &[0xff, 0, 1]);
        assert!(peers.heard.is_empty());
    }
}
