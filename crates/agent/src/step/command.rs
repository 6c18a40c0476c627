//! Commands from the ground.

use super::Agent;
use super::arming::Arming;
use super::modes::{Next, Trigger, next};
use super::offer::Refusal;
use super::phases::TAKEOFF_LEAD;
use super::preflight;
use fleet_core::types::Nanos;
use fleet_core::wire::{Command, Down, Envelope, Mode, RejectCode};

/// A start may lie at most this far ahead [s].
const START_MAX: f64 = 600.0;

/// Name of a command on the wire.
pub fn name(command: &Command) -> &'static str {
    match command {
        Command::Arm => "arm",
        Command::Start { .. } => "start",
        Command::Hold => "hold",
        Command::Resume => "resume",
        Command::Return => "return",
        Command::Land => "land",
        Command::Abort => "abort",
        Command::Disarm => "disarm",
    }
}

fn trigger(command: &Command) -> Trigger {
    match command {
        Command::Arm => Trigger::Arm,
        Command::Start { .. } => Trigger::Start,
        Command::Hold => Trigger::Hold,
        Command::Resume => Trigger::Resume,
        Command::Return => Trigger::Return,
        Command::Land => Trigger::Land,
        Command::Abort => Trigger::Abort,
        Command::Disarm => Trigger::Disarm,
    }
}

impl Agent {
    /// Executes a command, or says why not.
    pub(super) fn take_command(
        &mut self,
        now: Nanos,
        envelope: &Envelope<Down>,
        command: &Command,
    ) -> Result<(), Refusal> {
        // What makes things safer is taken from any ground client without a sequence (safety.md).
        let safer = matches!(
            command,
            Command::Hold | Command::Return | Command::Land | Command::Abort | Command::Disarm
        );
        if !safer && self.is_repeated(envelope, command)? {
            return Ok(());
        }
        let trigger = trigger(command);
        if next(self.mode, trigger) == Next::No {
            let reason = format!("{} is not possible in mode {:?}", name(command), self.mode);
            return Err((RejectCode::Mode, reason));
        }
        match command {
            Command::Arm => self.command_arm(now)?,
            Command::Start { t0, hash } => self.command_start(now, *t0, hash)?,
            Command::Resume => self.command_resume(now)?,
            Command::Disarm => self.command_disarm(now)?,
            Command::Hold | Command::Return | Command::Land | Command::Abort => {
                if self.mode == Mode::Idle {
                    self.arming = None;
                    self.disarm(now);
                }
                self.fire(now, trigger, "commanded");
            }
        }
        // A session that only knows how to stop the fleet must not make the mission's own stale.
        if safer && (envelope.mission_id != self.mission.id() || envelope.epoch != self.mission.epoch) {
            return Ok(());
        }
        self.mission.accept(envelope.epoch, envelope.seq);
        self.mission.last_command = Some((envelope.epoch, envelope.seq, command.clone()));
        Ok(())
    }

    /// Whether this very message was executed before; refuses what is out of order.
    fn is_repeated(&self, envelope: &Envelope<Down>, command: &Command) -> Result<bool, Refusal> {
        let mission = &self.mission;
        let last = mission.last_command.as_ref();
        if last.is_some_and(|(e, s, c)| (*e, *s) == (envelope.epoch, envelope.seq) && c == command) {
            return Ok(true);
        }
        if mission.committed.is_none() {
            let reason = "no plan is committed: offer and commit one".to_owned();
            return Err((RejectCode::Preflight, reason));
        }
        if envelope.mission_id != mission.id() {
            return Err((RejectCode::WrongMission, format!("the committed mission is {}", mission.id())));
        }
        if envelope.epoch != mission.epoch || envelope.seq <= mission.seq {
            let reason = format!("expected epoch {} and a seq above {}", mission.epoch, mission.seq);
            return Err((RejectCode::Stale, reason));
        }
        Ok(false)
    }

    fn command_arm(&mut self, now: Nanos) -> Result<(), Refusal> {
        if self.mode == Mode::Armed || self.arming.is_some() {
            return Ok(());
        }
        let mut failures = self.preflight(now);
        if self.vehicle.armed {
            failures.push("the vehicle is armed by someone else: disarm it first".to_owned());
        }
        if !failures.is_empty() {
            return Err((RejectCode::Preflight, failures.join("; ")));
        }
        self.disarming = None;
        self.arming = Some(Arming::begin(now));
        Ok(())
    }

    /// Pre-flight checks that fail now.
    pub(super) fn preflight(&self, now: Nanos) -> Vec<String> {
        let pad = self.mission.committed.as_ref().map(|plan| plan.own().pad.p);
        preflight::failures(&self.vehicle, &self.config.preflight, pad, now)
    }

    fn command_start(&mut self, now: Nanos, t0: Nanos, hash: &str) -> Result<(), Refusal> {
        if hash != self.mission.hash() {
            let reason = format!("the committed plan is {:.12}", self.mission.hash());
            return Err((RejectCode::Hash, reason));
        }
        let ahead = t0.since(now);
        if !(TAKEOFF_LEAD..=START_MAX).contains(&ahead) {
            let reason = format!("t0 is {ahead:.2} s ahead; legal is {TAKEOFF_LEAD} to {START_MAX} s");
            return Err((RejectCode::StartTime, reason));
        }
        self.mission.t0 = Some(t0);
        Ok(())
    }

    fn command_resume(&mut self, now: Nanos) -> Result<(), Refusal> {
        match self.mode {
            Mode::Released => {
                self.fire(now, Trigger::Resume, "commanded");
                Ok(())
            }
            Mode::Hold => self.resume_plan(now),
            _ => Ok(()),
        }
    }

    fn command_disarm(&mut self, now: Nanos) -> Result<(), Refusal> {
        if self.lifted {
            return Err((RejectCode::Mode, "the vehicle is in the air: land it".to_owned()));
        }
        self.arming = None;
        self.disarm(now);
        self.fire(now, Trigger::Disarm, "commanded");
        Ok(())
    }
}
