//! The world: n vehicles, wind, force pulses, obstacles and the ground truth.

mod config;
mod environment;
mod turbulence;
mod vehicle;

pub use config::{ConfigError, Gust, Obstacle, Pulse, VehicleConfig, Wind, WorldConfig};
pub use environment::Environment;
pub use vehicle::{Crash, End, Vehicle};

use crate::autopilot::{Autopilot, ParamError, Params};
use crate::plant::{Airframe, Plant};
use fleet_core::types::Nanos;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use turbulence::Turbulence;

/// Period of the physics [ns].
pub const STEP: u64 = 1_000_000;
/// What a vehicle's speed can change by in a few periods at most [m/s].
const CHANGE: f64 = 1.0;

/// The simulated world.
#[derive(Clone, Debug)]
pub struct World {
    now: Nanos,
    environment: Environment,
    vehicles: Vec<Vehicle>,
}

impl World {
    /// All vehicles at rest on their pads at time 0.
    ///
    /// # Errors
    /// When a parameter of a vehicle does not exist or has a wrong value.
    pub fn new(config: &WorldConfig) -> Result<Self, ConfigError> {
        let mut rng = ChaCha8Rng::seed_from_u64(config.seed);
        let mut vehicles = Vec::with_capacity(config.vehicles.len());
        for (i, v) in config.vehicles.iter().enumerate() {
            let mut params = Params::new(v.system);
            for (name, value) in &v.params {
                params.set_by_name(name, *value).map_err(|error: ParamError| ConfigError::Field {
                    field: format!("vehicle[{i}].params"),
                    problem: error.to_string(),
                })?;
            }
            // Every autopilot was switched on at its own time: clocks of vehicles differ.
            let boot_offset = rng.random_range(1_000_000_000..60_000_000_000);
            let plant = Plant::new(Airframe::F450, v.pad, v.psi);
            let autopilot = Autopilot::new(v.system, plant.truth(), params, boot_offset);
            let air_seed = rng.random();
            let turbulence =
                (config.wind.turbulence > 0.0).then(|| Turbulence::new(air_seed, config.wind.turbulence));
            vehicles.push(Vehicle::new(i, v.id.clone(), plant, autopilot, turbulence));
        }
        Ok(Self { now: Nanos(0), environment: Environment::new(config), vehicles })
    }

    /// Simulated time since launch.
    #[must_use]
    pub fn now(&self) -> Nanos {
        self.now
    }

    /// Sets mission time 0 on the clock of [`World::now`].
    pub fn set_t0(&mut self, t0: Nanos) {
        self.environment.set_t0(t0);
    }

    /// Mission time [s], when a start is known.
    #[must_use]
    pub fn mission_time(&self) -> Option<f64> {
        self.environment.mission_time(self.now)
    }

    /// The vehicles in order of the configuration.
    #[must_use]
    pub fn vehicles(&self) -> &[Vehicle] {
        &self.vehicles
    }

    /// The vehicles, for delivering and collecting messages.
    pub fn vehicles_mut(&mut self) -> &mut [Vehicle] {
        &mut self.vehicles
    }

    /// One period of the physics. Gives the crashes that happened in it.
    pub fn step(&mut self) -> Vec<Crash> {
        let mut crashes = Vec::new();
        for vehicle in &mut self.vehicles {
            crashes.extend(vehicle.step(self.now, &self.environment));
        }
        crashes.extend(self.pass(STEP));
        crashes
    }

    /// What the vehicles live in, and the vehicles: to be stepped one by one, each at its own pace,
    /// from [`World::now`] for as long as [`World::apart_for`] says, before [`World::pass`].
    pub fn split(&mut self) -> (&Environment, &mut [Vehicle]) {
        (&self.environment, &mut self.vehicles)
    }

    /// Whether no two vehicles can touch each other within `time` [ns].
    #[must_use]
    pub fn apart_for(&self, time: u64) -> bool {
        let time = time as f64 * 1e-9;
        self.vehicles.iter().enumerate().all(|(i, one)| {
            self.vehicles[..i].iter().all(|other| {
                let speed = one.truth().v.norm() + other.truth().v.norm() + 2.0 * CHANGE;
                let span = one.airframe().rotor_span.max(other.airframe().rotor_span);
                (one.truth().p - other.truth().p).norm() > span + speed * time
            })
        })
    }

    /// Time goes on by `time` [ns], which the vehicles have been stepped for. Gives the crashes of
    /// vehicles into each other, as they stand now.
    pub fn pass(&mut self, time: u64) -> Vec<Crash> {
        self.now.0 += time;
        let touching: Vec<_> = (0..self.vehicles.len()).map(|i| self.touching(i)).collect();
        let (now, t) = (self.now, self.mission_time());
        let crash = |(vehicle, other): (&mut Vehicle, Option<String>)| {
            other.and_then(|other| vehicle.crash(now, t, format!("touched {other}")))
        };
        self.vehicles.iter_mut().zip(touching).filter_map(crash).collect()
    }

    fn touching(&self, i: usize) -> Option<String> {
        let one = &self.vehicles[i];
        let span = one.airframe().rotor_span;
        self.vehicles
            .iter()
            .enumerate()
            .find(|(j, other)| *j != i && (other.truth().p - one.truth().p).norm() < span)
            .map(|(_, other)| other.id().to_owned())
    }
}

#[cfg(test)]
mod tests;
