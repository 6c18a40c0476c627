//! The ground station's script: offer, commit, arm, start; with the real one's envelopes.

use super::VirtualError;
use fleet_core::types::Nanos;
use fleet_core::wire::{
    Ack, AckResult, Command, Commit, Down, Envelope, Mode, Offer, SCHEMA, Status, Up, encode, plan_hash,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;

/// From the start command to mission time 0 [s], as the real ground's.
const LEAD: f64 = 12.0;
/// Messages are valid for so long [s].
const VALID: f64 = 5.0;
/// The slowest step (arming with its checks) must be done by then [s].
const PATIENCE: f64 = 30.0;

/// Where the script stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Waits until every agent answers.
    Appear,
    /// The plan is offered.
    Offered,
    /// The plan is committed on every drone's word.
    Committed,
    /// Waits until all pre-flight checks pass.
    Preflight,
    /// Arming.
    Arming,
    /// The start is commanded.
    Started,
    /// Nothing more to do.
    Done,
}

/// What is sent in one step: one envelope for each drone.
#[derive(Clone, Debug)]
pub struct Orders {
    /// Envelopes in order of the drones.
    pub envelopes: Vec<Vec<u8>>,
    /// Mission time 0 on the agents' clock, when this is the start.
    pub t0: Option<Nanos>,
}

/// The ground station.
#[derive(Clone, Debug)]
pub struct Ground {
    drones: Vec<String>,
    plan: Vec<u8>,
    hash: String,
    mission_id: String,
    seq: u64,
    phase: Phase,
    since: Option<Nanos>,
    acks: BTreeMap<String, Ack>,
    modes: BTreeMap<String, Mode>,
}

impl Ground {
    /// With a plan for these drones; the mission's id comes from the seed.
    pub fn new(seed: u64, drones: Vec<String>, plan: Vec<u8>) -> Self {
        let id: u128 = ChaCha8Rng::seed_from_u64(seed ^ 0x6d69_7373_696f_6e00).random();
        Self {
            drones,
            hash: plan_hash(&plan),
            plan,
            mission_id: format!("{id:032x}"),
            seq: 0,
            phase: Phase::Appear,
            since: None,
            acks: BTreeMap::new(),
            modes: BTreeMap::new(),
        }
    }

    /// Hears what a drone publishes.
    pub fn hear(&mut self, message: &Up) {
        match message {
            Up::Ack(ack) if ack.seq == self.seq => {
                self.acks.insert(ack.drone.clone(), ack.clone());
            }
            Up::Heartbeat(beat) => {
                self.modes.insert(beat.drone.clone(), beat.mode);
            }
            _ => {}
        }
    }

    /// Goes on with the script; gives what is to be sent.
    ///
    /// # Errors
    /// When a drone refuses, or a step takes too long.
    pub fn step(&mut self, now: Nanos, statuses: &[Option<&Status>]) -> Result<Option<Orders>, VirtualError> {
        if self.phase == Phase::Done {
            return Ok(None);
        }
        let since = *self.since.get_or_insert(now);
        if now.since(since) > PATIENCE {
            return Err(self.too_slow(statuses));
        }
        let answered = self.answered()?;
        let ready = |check: fn(&Status) -> bool| statuses.iter().all(|s| s.is_some_and(check));
        let all_armed = self.drones.iter().all(|d| self.modes.get(d) == Some(&Mode::Armed));
        match self.phase {
            Phase::Appear if ready(|_| true) => {
                let offer = Offer { hash: self.hash.clone(), plan: self.plan.clone() };
                self.send(now, Phase::Offered, &Down::Offer(offer), None).map(Some)
            }
            Phase::Offered if answered => {
                let commit = Commit { hash: self.hash.clone() };
                self.send(now, Phase::Committed, &Down::Commit(commit), None).map(Some)
            }
            Phase::Committed if answered => {
                self.enter(now, Phase::Preflight);
                Ok(None)
            }
            Phase::Preflight if ready(|s| s.preflight.is_empty()) => {
                self.send(now, Phase::Arming, &Down::Command(Command::Arm), None).map(Some)
            }
            Phase::Arming if answered && all_armed => {
                let t0 = now.plus(LEAD);
                let start = Command::Start { t0, hash: self.hash.clone() };
                self.send(now, Phase::Started, &Down::Command(start), Some(t0)).map(Some)
            }
            Phase::Started if answered => {
                self.enter(now, Phase::Done);
                Ok(None)
            }
            _ => Ok(None),
        }
    }

    fn enter(&mut self, now: Nanos, phase: Phase) {
        self.phase = phase;
        self.since = Some(now);
        self.acks.clear();
    }

    fn send(
        &mut self,
        now: Nanos,
        phase: Phase,
        body: &Down,
        t0: Option<Nanos>,
    ) -> Result<Orders, VirtualError> {
        self.enter(now, phase);
        self.seq += 1;
        let envelope = Envelope {
            schema: SCHEMA,
            mission_id: self.mission_id.clone(),
            epoch: 1,
            seq: self.seq,
            issued: now,
            valid_until: now.plus(VALID),
            body,
        };
        let bytes = encode(&envelope)?;
        Ok(Orders { envelopes: vec![bytes; self.drones.len()], t0 })
    }

    /// Whether every drone has accepted the last message.
    fn answered(&self) -> Result<bool, VirtualError> {
        for ack in self.acks.values() {
            if let AckResult::Rejected { code, reason } = &ack.outcome {
                return Err(VirtualError::Refused {
                    drone: ack.drone.clone(),
                    of: ack.of.clone(),
                    reason: format!("{reason} ({code:?})"),
                });
            }
        }
        Ok(self.acks.len() == self.drones.len())
    }

    fn too_slow(&self, statuses: &[Option<&Status>]) -> VirtualError {
        let mut reasons = Vec::new();
        let mut who = None;
        for (drone, status) in self.drones.iter().zip(statuses) {
            let failing = status.map_or_else(Vec::new, |s| s.preflight.clone());
            let silent = status.is_none() || !self.acks.contains_key(drone);
            if !failing.is_empty() || silent {
                who.get_or_insert(drone);
                reasons.push(format!("{drone}: {}", failing.join(", ")));
            }
        }
        VirtualError::Refused {
            drone: who.cloned().unwrap_or_default(),
            of: format!("{:?}", self.phase).to_lowercase(),
            reason: format!("not done after {PATIENCE} s; {}", reasons.join("; ")),
        }
    }
}
