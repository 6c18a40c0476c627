//! The plan that was offered, the plan that is committed, and the start time.

use fleet_core::types::Nanos;
use fleet_core::wire::{Command, DronePlan, Plan};
use std::collections::BTreeMap;

/// A decoded and checked plan.
#[derive(Clone, Debug, PartialEq)]
pub struct CheckedPlan {
    /// Id of the mission.
    pub mission_id: String,
    /// Its epoch.
    pub epoch: u64,
    /// SHA-256 of the bytes in hex.
    pub hash: String,
    /// The plan file.
    pub bytes: Vec<u8>,
    /// The plan.
    pub plan: Plan,
    /// This drone's place in it.
    pub index: usize,
}

impl CheckedPlan {
    /// This drone's part.
    #[must_use]
    pub fn own(&self) -> &DronePlan {
        &self.plan.drones[self.index]
    }

    /// Ids of the other drones.
    pub fn peers(&self) -> impl Iterator<Item = &str> {
        let own = self.index;
        self.plan.drones.iter().enumerate().filter(move |(i, _)| *i != own).map(|(_, d)| d.id.as_str())
    }
}

/// Whom an answer is for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Asked {
    /// `plan`, `commit` or the command's name.
    pub of: String,
    /// Epoch of the question.
    pub epoch: u64,
    /// Its sequence number.
    pub seq: u64,
}

/// What waits for the disk.
#[derive(Clone, Debug, PartialEq)]
pub enum Pending {
    /// An offer.
    Offer(Asked, Box<CheckedPlan>),
    /// A commit.
    Commit(Asked, Box<CheckedPlan>),
}

/// Plans and start time of this drone.
#[derive(Clone, Debug, Default)]
pub struct Mission {
    /// Newest epoch accepted.
    pub epoch: u64,
    /// Last sequence number accepted in it.
    pub seq: u64,
    /// Accepted offer.
    pub offered: Option<Box<CheckedPlan>>,
    /// Committed plan.
    pub committed: Option<Box<CheckedPlan>>,
    /// Mission time 0 on this agent's clock.
    pub t0: Option<Nanos>,
    /// Last command accepted, so that a repeated message is answered and not executed twice.
    pub last_command: Option<(u64, u64, Command)>,
    /// Requests to the disk by number.
    pub pending: BTreeMap<u64, Pending>,
    /// Number of the last request to the disk.
    pub last_persist: u64,
}

impl Mission {
    /// Mission time [s] when a start is known.
    #[must_use]
    pub fn time(&self, now: Nanos) -> Option<f64> {
        self.t0.map(|t0| now.since(t0))
    }

    /// Id of the committed, else the offered mission; empty when there is none.
    #[must_use]
    pub fn id(&self) -> &str {
        let plan = self.committed.as_ref().or(self.offered.as_ref());
        plan.map_or("", |plan| plan.mission_id.as_str())
    }

    /// Hash of the committed plan; empty when there is none.
    #[must_use]
    pub fn hash(&self) -> &str {
        self.committed.as_ref().map_or("", |plan| plan.hash.as_str())
    }

    /// Every plan that is known: committed, offered, or on its way to the disk.
    pub fn plans(&self) -> impl Iterator<Item = &CheckedPlan> {
        let pending = self.pending.values().map(|(Pending::Offer(_, plan) | Pending::Commit(_, plan))| plan);
        self.committed.iter().chain(self.offered.iter()).chain(pending).map(AsRef::as_ref)
    }

    /// Number for a new request to the disk.
    pub fn next_persist(&mut self) -> u64 {
        self.last_persist += 1;
        self.last_persist
    }

    /// Takes note of an accepted sequence number.
    pub fn accept(&mut self, epoch: u64, seq: u64) {
        if epoch > self.epoch {
            (self.epoch, self.seq) = (epoch, seq);
        } else if epoch == self.epoch {
            self.seq = self.seq.max(seq);
        }
    }
}
