//! A whole flight in one process on virtual time: real [`Agent::step`](fleet_agent::Agent::step),
//! real MAVLink bytes, real plant; no socket, no clock, the same bytes of log for the same seed.

mod craft;
mod ground;
mod mail;
mod onboard;

use crate::log;
use crate::world::{ConfigError, Vehicle};
use crate::world::{End, STEP, World, WorldConfig};
use craft::Window;
use fleet_agent::record::{InboxError, Log, MissionMessage, RecordError, Recorder, SchemaName};
use fleet_core::replan::ReplanError;
use fleet_core::types::Nanos;
use fleet_core::wire::{DecodeError, Plan, Status, Up};
use ground::Ground;
use onboard::{Onboard, Published, RADIO};
use rayon::prelude::*;
use std::collections::BTreeMap;
use thiserror::Error;

/// What the virtual clock, and so the log, shows at the launch of the world [ns].
pub const EPOCH: u64 = 1_000_000_000;
/// After the end of the mission, flights may last this long [s].
const OVERTIME: f64 = 90.0;
/// Fewer vehicles are flown faster by one thread.
const WORTH_THREADS: usize = 4;
/// Disarmed for so long is the end of a flight [s].
const SETTLED: f64 = 1.0;

/// Why a virtual flight cannot be flown.
#[derive(Debug, Error)]
pub enum VirtualError {
    /// The world is wrong.
    #[error(transparent)]
    World(#[from] ConfigError),
    /// The plan's bytes are not a plan.
    #[error("plan: {0}")]
    Plan(#[from] DecodeError),
    /// Plan and world do not fit.
    #[error("{0}")]
    Mismatch(String),
    /// A drone refused what the ground asked.
    #[error("{drone} refused {of}: {reason}")]
    Refused {
        /// Which drone.
        drone: String,
        /// What: `plan`, `commit`, `arm` or `start`.
        of: String,
        /// Its words.
        reason: String,
    },
    /// The replanner cannot be made for the plan.
    #[error("{drone}: {reason}")]
    Replanner {
        /// Which drone.
        drone: String,
        /// Why.
        reason: ReplanError,
    },
    /// The log cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The inbox cannot be recorded.
    #[error(transparent)]
    Inbox(#[from] InboxError),
}

/// How a virtual flight ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Simulated time [s].
    pub simulated: f64,
    /// What became of each drone.
    pub end: BTreeMap<String, End>,
}

/// A flight in progress.
#[derive(Debug)]
pub struct VirtualFlight {
    world: World,
    onboard: Vec<Onboard>,
    ground: Ground,
    plan: Plan,
    bytes: Vec<u8>,
}

impl VirtualFlight {
    /// Puts an agent on every vehicle of the world and the plan into the ground's hands.
    ///
    /// # Errors
    /// When world or plan are wrong or do not fit each other.
    pub fn new(config: &WorldConfig, plan: Plan) -> Result<Self, VirtualError> {
        if plan.fleet != config.fleet {
            let text = format!("the plan is for fleet {:?}, the world for {:?}", plan.fleet, config.fleet);
            return Err(VirtualError::Mismatch(text));
        }
        for drone in &plan.drones {
            if !config.vehicles.iter().any(|v| v.id == drone.id) {
                let text = format!("drone {:?} of the plan is not in the world", drone.id);
                return Err(VirtualError::Mismatch(text));
            }
        }
        if let Some(v) = config.vehicles.iter().find(|v| plan.drone(&v.id).is_none()) {
            return Err(VirtualError::Mismatch(format!(
                "vehicle {:?} of the world is not in the plan",
                v.id
            )));
        }
        let bytes = fleet_core::wire::encode(&plan)?;
        let world = World::new(config)?;
        let onboard = config.vehicles.iter().map(|v| Onboard::new(&config.fleet, &v.id, v.system)).collect();
        let drones = config.vehicles.iter().map(|v| v.id.clone()).collect();
        let ground = Ground::new(config.seed, drones, bytes.clone());
        Ok(Self { world, onboard, ground, plan, bytes })
    }

    /// The world, for looking at the truth.
    #[must_use]
    pub fn world(&self) -> &World {
        &self.world
    }

    /// The world, for a test that acts on it as a pilot would.
    pub fn world_mut(&mut self) -> &mut World {
        &mut self.world
    }

    /// Mission time [s], once the start is known.
    #[must_use]
    pub fn mission_time(&self) -> Option<f64> {
        self.world.mission_time()
    }

    /// Flies to the end. `progress` is called once every simulated 0.1 s with the mission time.
    ///
    /// # Errors
    /// When a drone refuses or the log cannot be written.
    pub fn fly(
        &mut self,
        mut recorder: Option<&mut Recorder>,
        mut progress: impl FnMut(&Self),
    ) -> Result<Outcome, VirtualError> {
        if let Some(recorder) = recorder.as_deref_mut() {
            for onboard in &self.onboard {
                onboard.record_config(recorder, EPOCH)?;
            }
        }
        while !self.is_over() {
            self.step(recorder.as_deref_mut())?;
            if self.world.now().0.is_multiple_of(100 * STEP) {
                progress(self);
            }
        }
        Ok(Outcome {
            simulated: self.world.now().since(Nanos(0)),
            end: self.world.vehicles().iter().map(|v| (v.id().to_owned(), v.end())).collect(),
        })
    }

    /// Flies until news can arrive: at most [`RADIO`], in which every craft is on its own, and one period
    /// of the physics when two are so near that they could touch. Gives what the drones published.
    ///
    /// # Errors
    /// When a drone refuses or the log cannot be written.
    pub fn step(&mut self, mut recorder: Option<&mut Recorder>) -> Result<Vec<Up>, VirtualError> {
        let start = self.world.now();
        let time = if self.world.apart_for(RADIO) { RADIO - start.0 % RADIO } else { STEP };
        let mut heard = Vec::new();
        for (i, mut window) in self.windows(start, time, recorder.is_some()).into_iter().enumerate() {
            if let Some(recorder) = recorder.as_deref_mut() {
                window.log.drain_to(recorder)?;
            }
            if let Some(failure) = window.failure {
                return Err(failure);
            }
            heard.extend(window.published.into_iter().map(|published| (i, published)));
        }
        for crash in self.world.pass(time) {
            if let Some(recorder) = recorder.as_deref_mut() {
                log::record_crash(recorder, &crash, crash.at.0 + EPOCH)?;
            }
        }
        heard.sort_by_key(|(_, published)| published.at);
        let now = Nanos(start.0 + EPOCH + time - STEP);
        for (i, published) in &heard {
            self.share(*i, published);
        }
        self.run_ground(now, recorder)?;
        Ok(heard.into_iter().map(|(_, published)| published.message).collect())
    }

    /// Another ground session's message for `drone`: an envelope, as it comes over the wire. False
    /// when there is no such drone.
    pub fn send(&mut self, drone: &str, envelope: Vec<u8>) -> bool {
        let now = self.clock();
        let onboard = self.onboard.iter_mut().find(|onboard| onboard.id() == drone);
        onboard.map(|onboard| onboard.post_ground(now, envelope)).is_some()
    }

    /// What the drone answers to the `status` query; none before it has any.
    #[must_use]
    pub fn status(&self, drone: &str) -> Option<&Status> {
        self.onboard.iter().find(|onboard| onboard.id() == drone)?.status()
    }

    /// The agents' clock.
    #[must_use]
    pub fn now(&self) -> Nanos {
        self.clock()
    }

    fn clock(&self) -> Nanos {
        Nanos(self.world.now().0 + EPOCH)
    }

    /// Every craft's window of `time` [ns] from `start` on, in their order.
    fn windows(&mut self, start: Nanos, time: u64, logged: bool) -> Vec<Window> {
        let span = (start, time / STEP);
        let (environment, vehicles) = self.world.split();
        let fly = |(onboard, vehicle): (&mut Onboard, &mut Vehicle)| {
            let mut window = Window::default();
            window.fly(onboard, vehicle, environment, span, logged);
            window
        };
        if vehicles.len() < WORTH_THREADS || rayon::current_num_threads() == 1 {
            return self.onboard.iter_mut().zip(vehicles).map(fly).collect();
        }
        self.onboard.par_iter_mut().zip(vehicles).map(fly).collect()
    }

    /// Gives one drone's message to the ground and, if peers listen to it, to the others.
    fn share(&mut self, from: usize, published: &Published) {
        self.ground.hear(&published.message);
        if !published.for_peers {
            return;
        }
        for (i, onboard) in self.onboard.iter_mut().enumerate() {
            if i != from {
                onboard.post_peer(published.at, published.bytes.clone());
            }
        }
    }

    /// The ground's turn at `now` of the agents' clock.
    fn run_ground(&mut self, now: Nanos, recorder: Option<&mut Recorder>) -> Result<(), VirtualError> {
        let statuses: Vec<_> = self.onboard.iter().map(Onboard::status).collect();
        let Some(orders) = self.ground.step(now, &statuses)? else { return Ok(()) };
        for (onboard, bytes) in self.onboard.iter_mut().zip(orders.envelopes) {
            onboard.post_ground(now, bytes);
        }
        if let Some(t0) = orders.t0 {
            self.world.set_t0(Nanos(t0.0 - EPOCH));
            if let Some(recorder) = recorder {
                let message = MissionMessage::new(now.0, &self.plan, &self.bytes, t0.0);
                recorder.json("/mission", SchemaName::Mission, now.0, &message)?;
            }
        }
        Ok(())
    }

    /// Whether every drone is down again, or far too late.
    #[must_use]
    pub fn is_over(&self) -> bool {
        let now = self.world.now();
        let Some(t) = self.mission_time() else { return false };
        let settled = self.world.vehicles().iter().all(|v| v.disarmed_for(now) >= SETTLED);
        // Before take-off is due, a vehicle that is not armed yet has not landed.
        let flown = self.world.vehicles().iter().all(Vehicle::was_armed) || t > 0.0;
        (settled && flown) || t > self.plan.horizon + OVERTIME
    }
}
