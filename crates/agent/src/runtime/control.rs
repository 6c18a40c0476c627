//! The control thread: gathers what has arrived, steps, hands out what comes out.

use super::Wake;
use super::clock::{Clock, boot_ms};
use super::comms::{Outgoing, channel};
use super::queue::Queue;
use super::recording::Step;
use super::vehicle_link::VehicleLink;
use super::{persist, worker};
use crate::Agent;
use crate::io::{Input, Output, VehicleCmd, VehicleMsg};
use crate::mavlink::Codec;
use fleet_core::types::Nanos;
use fleet_core::wire::Mode;
use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, RecvTimeoutError};

/// Tick of the control loop [ns].
const TICK: u64 = 10_000_000;
/// Arrivals taken before one step; more wait for the next, so that a flood cannot delay a tick for
/// long.
const MAX_WAKES: usize = 256;
/// Three signals within this time end the process even in the air [s].
const FORCE_WINDOW: f64 = 2.0;
/// How long a landed drone stays disarmed before the process ends [s]: events still go out.
const SETTLE: f64 = 1.0;
/// An orphan waits this long without being armed before it ends [s]: longer than any pause of a mission
/// that still runs.
const ORPHAN: f64 = 5.0;

/// Why the control loop ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// A signal came on the ground.
    Signal,
    /// Signals came that could not be refused in the air.
    Forced,
    /// The drone has flown and is disarmed.
    Landed,
    /// Whoever started the process is gone and the drone stays disarmed.
    Orphaned,
}

/// Queues to the other threads.
#[derive(Debug)]
pub struct Outboxes {
    /// To Zenoh.
    pub comms: Queue<Outgoing>,
    /// To the solver.
    pub solver: Queue<worker::Job>,
    /// To the disk.
    pub disk: Queue<persist::Job>,
    /// To the log, when there is one.
    pub record: Option<Queue<Step>>,
}

/// The control loop.
#[derive(Debug)]
pub struct Control {
    agent: Agent,
    codec: Codec,
    clock: Clock,
    link: VehicleLink,
    outboxes: Outboxes,
    watch: Watch,
    prepared: String,
    /// Steps that the log has lost since the last one it took.
    unrecorded: u64,
}

impl Control {
    /// Ready to [`Control::run`].
    #[must_use]
    pub fn new(agent: Agent, codec: Codec, clock: Clock, link: VehicleLink, outboxes: Outboxes) -> Self {
        Self {
            agent,
            codec,
            clock,
            link,
            outboxes,
            watch: Watch::default(),
            prepared: String::new(),
            unrecorded: 0,
        }
    }

    /// Flies until a signal on the ground, or until landed if `exit_when_landed`.
    pub fn run(&mut self, wake: &Receiver<Wake>, exit_when_landed: bool) -> Exit {
        // The step counts its ticks from its first call; both grids must be the same one.
        let mut tick = self.clock.now();
        let mut inbox = Vec::new();
        let outputs = self.agent.step(tick, &inbox);
        inbox = self.finish(tick, inbox, outputs);
        tick.0 += TICK;
        loop {
            match wake.recv_timeout(self.clock.until(tick)) {
                Ok(first) => {
                    self.take(first, &mut inbox);
                    for next in wake.try_iter().take(MAX_WAKES) {
                        self.take(next, &mut inbox);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                // The runtime holds a sender for as long as this runs.
                Err(RecvTimeoutError::Disconnected) => return Exit::Forced,
            }
            let now = self.clock.now();
            let due = now >= tick;
            if due {
                tick.0 += TICK * (1 + (now.0 - tick.0) / TICK);
            }
            if due || !inbox.is_empty() {
                let outputs = self.agent.step(now, &inbox);
                inbox = self.finish(now, inbox, outputs);
            }
            if let Some(exit) = self.watch.exit(now, exit_when_landed) {
                if self.watch.armed && exit == Exit::Signal {
                    let bytes =
                        self.codec.encode(&VehicleCmd::Arm { arm: false, force: false }, boot_ms(now));
                    self.link.send(&bytes);
                }
                return exit;
            }
        }
    }

    /// Hands out and records what a step put out; gives the beginning of the next inbox.
    fn finish(&mut self, now: Nanos, inbox: Vec<Input>, outputs: Vec<Output>) -> Vec<Input> {
        let answers = self.dispatch(now, &outputs);
        if let Some(record) = &self.outboxes.record {
            // What the log lost is noted in it with the next step that fits.
            let step = Step { now, inbox, outputs, lost: self.unrecorded };
            self.unrecorded = if record.offer(step).is_ok() { 0 } else { self.unrecorded + 1 };
        }
        answers
    }

    fn take(&mut self, wake: Wake, inbox: &mut Vec<Input>) {
        match wake {
            Wake::Input(input) => inbox.push(input),
            Wake::Signal => self.watch.signal(self.clock.now()),
            Wake::Orphaned => self.watch.orphaned = true,
            Wake::Datagram { bytes, from } => {
                let now = self.clock.now();
                if !self.link.accepts(from, now) {
                    return;
                }
                let heard = self.codec.decode(&bytes);
                let replies = self.codec.timesync_replies(&bytes, now.0);
                if !heard.is_empty() || !replies.is_empty() {
                    self.link.heard(from, now);
                }
                for reply in replies {
                    self.link.send(&reply);
                }
                for message in heard {
                    self.watch.vehicle(&message);
                    inbox.push(Input::Vehicle(message));
                }
            }
        }
    }

    /// Hands every output to its thread; gives the answers to those that could not be handed on.
    fn dispatch(&mut self, now: Nanos, outputs: &[Output]) -> Vec<Input> {
        let mut answers = Vec::new();
        for output in outputs {
            match output {
                Output::Vehicle(command) => {
                    let bytes = self.codec.encode(command, boot_ms(now));
                    if bytes.is_empty() {
                        tracing::error!(?command, "not sent: a number is not finite");
                    } else {
                        self.link.send(&bytes);
                    }
                }
                Output::Publish { bytes, message } => {
                    let message = Outgoing::Publish { channel: channel(message), bytes: bytes.clone() };
                    let _ = self.outboxes.comms.offer(message);
                }
                Output::Status(status) => {
                    if status.hash != self.prepared {
                        self.prepared.clone_from(&status.hash);
                        let job = worker::Job::Prepare { hash: status.hash.clone() };
                        if !status.hash.is_empty() {
                            // Not prepared is only slower: the first request prepares it too.
                            let _ = self.outboxes.solver.offer(job);
                        }
                    }
                    let _ = self.outboxes.comms.offer(Outgoing::Status(Box::new(status.clone())));
                }
                Output::Solve(request) => {
                    if let Err(worker::Job::Solve(request)) =
                        self.outboxes.solver.offer(worker::Job::Solve(request.clone()))
                    {
                        let reason = "the solver is busy".to_owned();
                        answers.push(Input::Solved(worker::refused(&request, reason)));
                    }
                }
                Output::Persist { id, name, bytes } => {
                    let job = persist::Job { id: *id, name: name.clone(), bytes: bytes.clone() };
                    if self.outboxes.disk.offer(job).is_err() {
                        answers.push(Input::Persisted { id: *id, ok: false });
                    }
                }
                Output::Tick(tick) => self.watch.mode(tick.mode),
            }
        }
        answers
    }
}

/// What decides about the end of the process.
#[derive(Debug, Default)]
struct Watch {
    armed: bool,
    on_ground: bool,
    flown: bool,
    disarmed_since: Option<Nanos>,
    orphaned: bool,
    signals: VecDeque<Nanos>,
    ignored: usize,
}

impl Watch {
    fn vehicle(&mut self, message: &VehicleMsg) {
        match message {
            VehicleMsg::Heartbeat { armed, .. } => self.armed = *armed,
            VehicleMsg::Landed { on_ground } => self.on_ground = *on_ground,
            _ => {}
        }
    }

    fn mode(&mut self, mode: Mode) {
        let flying = !matches!(mode, Mode::Idle | Mode::Armed);
        self.flown |= flying && self.armed;
    }

    fn signal(&mut self, now: Nanos) {
        self.signals.push_back(now);
        while self.signals.front().is_some_and(|first| now.since(*first) > FORCE_WINDOW) {
            self.signals.pop_front();
            self.ignored = self.ignored.saturating_sub(1);
        }
    }

    fn exit(&mut self, now: Nanos, when_landed: bool) -> Option<Exit> {
        if self.armed {
            self.disarmed_since = None;
        } else {
            let since = *self.disarmed_since.get_or_insert(now);
            if when_landed && self.flown && now.since(since) >= SETTLE {
                return Some(Exit::Landed);
            }
            if self.orphaned && now.since(since) >= ORPHAN {
                return Some(Exit::Orphaned);
            }
        }
        if self.signals.is_empty() {
            return None;
        }
        if !self.armed || self.on_ground {
            return Some(Exit::Signal);
        }
        if self.signals.len() >= 3 {
            return Some(Exit::Forced);
        }
        if self.signals.len() > self.ignored {
            self.ignored = self.signals.len();
            tracing::warn!(
                "in the air: the plan is flown on; three signals within 2 s end the process anyway"
            );
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> Nanos {
        Nanos::from_seconds(seconds)
    }

    fn vehicle(armed: bool, on_ground: bool) -> Watch {
        Watch { armed, on_ground, ..Watch::default() }
    }

    #[test]
    fn an_orphan_ends_on_the_ground_but_never_while_armed() {
        let mut watch = vehicle(false, true);
        assert_eq!(watch.exit(at(1.0), false), None);
        assert_eq!(watch.exit(at(60.0), false), None);
        watch.orphaned = true;
        assert_eq!(watch.exit(at(60.0), false), Some(Exit::Orphaned));
        let mut watch = vehicle(true, false);
        watch.orphaned = true;
        assert_eq!(watch.exit(at(60.0), false), None);
        watch.armed = false;
        assert_eq!(watch.exit(at(61.0), false), None);
        assert_eq!(watch.exit(at(61.0).plus(ORPHAN), false), Some(Exit::Orphaned));
    }

    #[test]
    fn a_signal_on_the_ground_ends_at_once() {
        for mut watch in [vehicle(false, true), vehicle(false, false), vehicle(true, true)] {
            assert_eq!(watch.exit(at(1.0), false), None);
            watch.signal(at(1.0));
            assert_eq!(watch.exit(at(1.0), false), Some(Exit::Signal));
        }
    }

    #[test]
    fn in_the_air_only_three_signals_within_two_seconds_end() {
        let mut watch = vehicle(true, false);
        for t in [1.0, 2.5, 4.0, 5.5] {
            watch.signal(at(t));
            assert_eq!(watch.exit(at(t), false), None, "at {t}");
        }
        watch.signal(at(5.6));
        assert_eq!(watch.exit(at(5.6), false), Some(Exit::Forced));
    }

    #[test]
    fn landed_means_flown_and_disarmed_for_a_second() {
        let mut watch = vehicle(false, true);
        watch.mode(Mode::Takeoff);
        assert_eq!(watch.exit(at(0.0), true), None, "not armed, so it has not flown");
        assert_eq!(watch.exit(at(9.0), true), None);
        watch.armed = true;
        watch.mode(Mode::Armed);
        watch.mode(Mode::Track);
        assert_eq!(watch.exit(at(10.0), true), None);
        watch.armed = false;
        assert_eq!(watch.exit(at(20.0), true), None);
        assert_eq!(watch.exit(at(20.9), true), None);
        assert_eq!(watch.exit(at(21.0), false), None);
        assert_eq!(watch.exit(at(21.0), true), Some(Exit::Landed));
    }
}
