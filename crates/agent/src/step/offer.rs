//! Messages from the ground: envelope checks, plan offers and commits.

use super::Agent;
use super::mission::{Asked, CheckedPlan, Pending};
use crate::io::{OFFER_FILE, Output, PLAN_FILE};
pub use fleet_core::admission::Refusal;
use fleet_core::admission::{self, admit};
use fleet_core::types::Nanos;
use fleet_core::wire::{
    AckResult, Commit, Down, Envelope, EventKind, Mode, Offer, Plan, RejectCode, decode, plan_hash,
};

/// A message may be valid for at most this long [s].
const VALID_MAX: f64 = 600.0;

impl Agent {
    /// Takes one downward message and answers it, now or when the disk has answered.
    pub(super) fn take_ground(&mut self, now: Nanos, bytes: &[u8]) {
        let envelope = match Envelope::<Down>::from_bytes(bytes) {
            Ok(envelope) => envelope,
            Err(error) => {
                let asked = Asked { of: "unknown".to_owned(), epoch: 0, seq: 0 };
                self.reject(now, &asked, (RejectCode::Malformed, error.to_string()));
                return;
            }
        };
        let of = match &envelope.body {
            Down::Offer(_) => "plan",
            Down::Commit(_) => "commit",
            Down::Command(command) => super::command::name(command),
        };
        let asked = Asked { of: of.to_owned(), epoch: envelope.epoch, seq: envelope.seq };
        if let Err(refusal) = check_validity(now, envelope.valid_until) {
            self.reject(now, &asked, refusal);
            return;
        }
        let result = match &envelope.body {
            Down::Offer(offer) => self.take_offer(&envelope, offer, &asked),
            Down::Commit(commit) => self.take_commit(&envelope, commit, &asked),
            Down::Command(command) => {
                self.take_command(now, &envelope, command).map(|()| self.accept(now, &asked))
            }
        };
        if let Err(refusal) = result {
            self.reject(now, &asked, refusal);
        }
    }

    fn take_offer(&mut self, envelope: &Envelope<Down>, offer: &Offer, asked: &Asked) -> Result<(), Refusal> {
        self.on_the_ground()?;
        let epoch = envelope.epoch;
        let mission = &self.mission;
        let repeated = mission.plans().any(|p| p.epoch == epoch && p.hash == offer.hash);
        let newest = mission.plans().map(|p| p.epoch).fold(mission.epoch, u64::max);
        if epoch <= newest && !repeated {
            let reason = format!("epoch {epoch} is not newer than {newest}: make a new epoch");
            return Err((RejectCode::Stale, reason));
        }
        let checked = self.check_plan(envelope.mission_id.clone(), epoch, offer)?;
        let id = self.mission.next_persist();
        let bytes = checked.bytes.clone();
        self.mission.pending.insert(id, Pending::Offer(asked.clone(), Box::new(checked)));
        self.out.push(Output::Persist { id, name: OFFER_FILE.to_owned(), bytes });
        Ok(())
    }

    /// Everything about a plan that can be checked on board, cheap checks first (safety.md, 2.4).
    fn check_plan(&self, mission_id: String, epoch: u64, offer: &Offer) -> Result<CheckedPlan, Refusal> {
        let hash = plan_hash(&offer.plan);
        if hash != offer.hash {
            let reason = format!("the bytes hash to {hash:.12}, the offer says {:.12}", offer.hash);
            return Err((RejectCode::Hash, reason));
        }
        let plan: Plan = decode(&offer.plan).map_err(|e| (RejectCode::Malformed, e.to_string()))?;
        let id = &self.config.drone;
        let vehicle = admission::VehicleLimits {
            v_max: self.config.vehicle.v_max,
            a_max: self.config.vehicle.a_max,
            psi_rate_max: self.config.vehicle.psi_rate_max,
        };
        admit(&plan, id, &self.config.fleet, &vehicle)?;
        let Some(index) = plan.drones.iter().position(|d| &d.id == id) else {
            return Err((RejectCode::NotInPlan, format!("drone {id} is not in the plan")));
        };
        Ok(CheckedPlan { mission_id, epoch, hash, bytes: offer.plan.clone(), plan, index })
    }

    fn take_commit(
        &mut self,
        envelope: &Envelope<Down>,
        commit: &Commit,
        asked: &Asked,
    ) -> Result<(), Refusal> {
        self.on_the_ground()?;
        let mission = &self.mission;
        let plan = mission.offered.as_ref().or(mission.committed.as_ref());
        let Some(plan) = plan else {
            return Err((RejectCode::Hash, "no plan was offered".to_owned()));
        };
        if plan.mission_id != envelope.mission_id {
            return Err((RejectCode::WrongMission, format!("the offered mission is {}", plan.mission_id)));
        }
        if envelope.epoch != plan.epoch || envelope.seq < mission.seq {
            let reason = format!("expected epoch {} and seq {} or more", plan.epoch, mission.seq);
            return Err((RejectCode::Stale, reason));
        }
        if plan.hash != commit.hash {
            return Err((RejectCode::Hash, format!("the offered plan is {:.12}", plan.hash)));
        }
        let plan = plan.clone();
        let id = self.mission.next_persist();
        let bytes = plan.bytes.clone();
        self.mission.pending.insert(id, Pending::Commit(asked.clone(), plan));
        self.out.push(Output::Persist { id, name: PLAN_FILE.to_owned(), bytes });
        Ok(())
    }

    /// The disk has answered: only now is an offer or a commit accepted.
    pub(super) fn take_persisted(&mut self, now: Nanos, id: u64, ok: bool) {
        let Some(pending) = self.mission.pending.remove(&id) else { return };
        let (asked, commit, plan) = match pending {
            Pending::Offer(asked, plan) => (asked, false, plan),
            Pending::Commit(asked, plan) => (asked, true, plan),
        };
        if !ok {
            let reason = "the plan could not be written to disk: check space and permissions".to_owned();
            self.reject(now, &asked, (RejectCode::Preflight, reason));
            return;
        }
        // The vehicle may have armed while the disk worked.
        if let Err(refusal) = self.on_the_ground() {
            self.reject(now, &asked, refusal);
            return;
        }
        self.mission.accept(asked.epoch, asked.seq);
        if commit {
            let hash = plan.hash.clone();
            self.mission.offered = None;
            self.mission.committed = Some(plan);
            self.mission.t0 = None;
            self.event(now, EventKind::Plan { hash }, "committed");
        } else {
            self.mission.offered = Some(plan);
        }
        self.accept(now, &asked);
    }

    fn on_the_ground(&self) -> Result<(), Refusal> {
        if self.mode == Mode::Idle && self.arming.is_none() {
            Ok(())
        } else {
            let reason = format!("plans change on the ground and disarmed only; mode is {:?}", self.mode);
            Err((RejectCode::Mode, reason))
        }
    }

    pub(super) fn accept(&mut self, now: Nanos, asked: &Asked) {
        self.acknowledge(now, asked, AckResult::Accepted);
    }

    fn reject(&mut self, now: Nanos, asked: &Asked, (code, reason): Refusal) {
        self.acknowledge(now, asked, AckResult::Rejected { code, reason });
    }
}

fn check_validity(now: Nanos, valid_until: Nanos) -> Result<(), Refusal> {
    let left = valid_until.since(now);
    if left < 0.0 {
        return Err((RejectCode::Expired, format!("expired {:.1} s ago on this drone's clock", -left)));
    }
    if left > VALID_MAX {
        return Err((RejectCode::Expired, format!("valid for {left:.0} s more; {VALID_MAX} s is legal")));
    }
    Ok(())
}
