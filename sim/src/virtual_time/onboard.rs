//! One drone's computer on virtual time: the agent with its links, its solver and its disk.

use super::VirtualError;
use super::mail::Mail;
use crate::autopilot::LinkId;
use crate::framing::{Encoder, deliver};
use crate::world::Vehicle;
use fleet_agent::io::{Input, Output, PLAN_FILE};
use fleet_agent::mavlink::Codec;
use fleet_agent::record::{Batch, InboxError, Log, StepRecord, record_config, record_outputs, record_step};
use fleet_agent::{Agent, AgentConfig, SolveResult};
use fleet_core::replan::Replanner;
use fleet_core::types::Nanos;
use fleet_core::wire::{Plan, Status, Up, decode};

/// Period of the agent's calls [ns]: its own control tick.
const TICK: u64 = 10_000_000;
/// Phase of the calls [ns]: the autopilot samples on whole periods, and its bytes take [`SERIAL`].
const PHASE: u64 = 2_000_000;
/// One way over the MAVLink link [ns].
const SERIAL: u64 = 1_000_000;
/// One way over the radio between drones and ground [ns].
pub(super) const RADIO: u64 = 5_000_000;
/// What a solve takes [ns] (design.md, Principles 1).
const SOLVE: u64 = 20_000_000;
/// The agent's link; answers to other clients are not for it.
const LINK: LinkId = LinkId(0);

/// A message that a drone published.
#[derive(Debug)]
pub struct Published {
    /// The envelope.
    pub bytes: Vec<u8>,
    /// The same, decoded.
    pub message: Up,
    /// Whether peers listen to it.
    pub for_peers: bool,
    /// When it was sent, on the agent's clock.
    pub at: Nanos,
}

/// An agent and what surrounds it.
#[derive(Debug)]
pub struct Onboard {
    id: String,
    agent: Agent,
    config: AgentConfig,
    codec: Codec,
    encoder: Encoder,
    replanner: Option<Replanner>,
    from_vehicle: Mail<Vec<u8>>,
    to_vehicle: Mail<Vec<u8>>,
    radio: Mail<Input>,
    solved: Mail<SolveResult>,
    inbox: Vec<Input>,
    status: Option<Status>,
}

impl Onboard {
    /// An agent that has just been started on the vehicle with this system id.
    pub fn new(fleet: &str, id: &str, system: u8) -> Self {
        let config = AgentConfig::new(fleet, id);
        Self {
            id: id.to_owned(),
            agent: Agent::new(config.clone()),
            config,
            codec: Codec::new(system, system),
            encoder: Encoder::new(system),
            replanner: None,
            from_vehicle: Mail::new(SERIAL),
            to_vehicle: Mail::new(SERIAL),
            radio: Mail::new(RADIO),
            solved: Mail::new(SOLVE),
            inbox: Vec::new(),
            status: None,
        }
    }

    /// Drone id.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The newest answer to the `status` query.
    pub fn status(&self) -> Option<&Status> {
        self.status.as_ref()
    }

    /// Writes the configuration that a replay needs.
    pub fn record_config(&self, log: &mut impl Log, at_ns: u64) -> Result<(), InboxError> {
        record_config(log, &self.config, at_ns)
    }

    /// A message from the ground.
    pub fn post_ground(&mut self, now: Nanos, bytes: Vec<u8>) {
        self.radio.post(now, Input::Ground { bytes });
    }

    /// A message from a peer.
    pub fn post_peer(&mut self, now: Nanos, bytes: Vec<u8>) {
        self.radio.post(now, Input::Peer { bytes });
    }

    /// Carries bytes between agent and autopilot. The vehicle counts its time from launch, `now` is
    /// the agent's clock; only the vehicle's own stamps tell them apart.
    pub fn exchange(&mut self, now: Nanos, vehicle: &mut Vehicle) {
        let launched = Nanos(now.0 - super::EPOCH);
        let outgoing = vehicle.autopilot_mut().take_outgoing();
        for outgoing in outgoing.into_iter().filter(|outgoing| outgoing.link == LINK) {
            self.from_vehicle.post(now, self.encoder.encode(&outgoing));
        }
        while let Some(bytes) = self.to_vehicle.take(now) {
            deliver(vehicle.autopilot_mut(), launched, LINK, &bytes);
        }
    }

    /// Calls the agent when its tick is due or a solver has finished.
    ///
    /// # Errors
    /// When the log cannot be written or the committed plan does not suit the replanner.
    pub fn step(&mut self, now: Nanos, log: Option<&mut Batch>) -> Result<Vec<Published>, VirtualError> {
        while let Some(bytes) = self.from_vehicle.take(now) {
            self.inbox.extend(self.codec.decode(&bytes).into_iter().map(Input::Vehicle));
        }
        if now.0 % TICK != PHASE && !self.solved.is_due(now) {
            return Ok(Vec::new());
        }
        while let Some(input) = self.radio.take(now) {
            self.inbox.push(input);
        }
        while let Some(solution) = self.solved.take(now) {
            self.inbox.push(Input::Solved(solution));
        }
        let inbox = std::mem::take(&mut self.inbox);
        let outputs = self.agent.step(now, &inbox);
        if let Some(log) = log {
            record_outputs(log, &self.id, now, now.0, &outputs)?;
            let step = StepRecord::new(now, inbox, &outputs)?;
            record_step(log, &self.id, now.0, &step)?;
        }
        self.execute(now, outputs)
    }

    fn execute(&mut self, now: Nanos, outputs: Vec<Output>) -> Result<Vec<Published>, VirtualError> {
        let mut published = Vec::new();
        for output in outputs {
            match output {
                Output::Vehicle(command) => {
                    let frame = self.codec.encode(&command, (now.0 / 1_000_000) as u32);
                    self.to_vehicle.post(now, frame);
                }
                Output::Publish { bytes, message } => {
                    let for_peers = matches!(*message, Up::Heartbeat(_) | Up::Replan(_));
                    published.push(Published { bytes, message: *message, for_peers, at: now });
                }
                Output::Solve(request) => {
                    // A request without a committed plan cannot be; were it one, it would go unanswered.
                    if let Some(replanner) = &mut self.replanner {
                        self.solved.post(now, replanner.solve(&request));
                    }
                }
                Output::Persist { id, name, bytes } => {
                    if name == PLAN_FILE {
                        self.replanner = Some(self.make_replanner(&bytes)?);
                    }
                    self.inbox.push(Input::Persisted { id, ok: true });
                }
                Output::Status(status) => self.status = Some(status),
                Output::Tick(_) => {}
            }
        }
        Ok(published)
    }

    fn make_replanner(&self, plan: &[u8]) -> Result<Replanner, VirtualError> {
        let plan: Plan = decode(plan)?;
        Replanner::new(&plan, &self.id)
            .map_err(|reason| VirtualError::Replanner { drone: self.id.clone(), reason })
    }
}
