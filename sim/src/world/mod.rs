//! The world: n vehicles, wind, force pulses, obstacles and the ground truth.

mod config;
mod vehicle;

pub use config::{ConfigError, Obstacle, Pulse, VehicleConfig, Wind, WorldConfig};
pub use vehicle::{Crash, End, Vehicle};

use crate::autopilot::{Autopilot, ParamError, Params};
use crate::plant::{Airframe, DT, Plant};
use fleet_core::types::{Nanos, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Period of the physics [ns].
pub const STEP: u64 = 1_000_000;
/// Touching the ground faster than this is a crash [m/s]: several times PX4's landing speed.
const HARD_LANDING: f64 = 3.0;

/// The simulated world.
#[derive(Clone, Debug)]
pub struct World {
    now: Nanos,
    t0: Option<Nanos>,
    wind: Vec3,
    pulses: Vec<(usize, Pulse)>,
    obstacles: Vec<Obstacle>,
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
            vehicles.push(Vehicle::new(v.id.clone(), plant, autopilot));
        }
        let index = |id: &str| config.vehicles.iter().position(|v| v.id == id);
        let pulses = config.pulses.iter().filter_map(|p| index(&p.drone).map(|i| (i, p.clone()))).collect();
        Ok(Self {
            now: Nanos(0),
            t0: None,
            wind: config.wind.velocity,
            pulses,
            obstacles: config.obstacles.clone(),
            vehicles,
        })
    }

    /// Simulated time since launch.
    #[must_use]
    pub fn now(&self) -> Nanos {
        self.now
    }

    /// Sets mission time 0 on the clock of [`World::now`].
    pub fn set_t0(&mut self, t0: Nanos) {
        self.t0 = Some(t0);
    }

    /// Mission time [s], when a start is known.
    #[must_use]
    pub fn mission_time(&self) -> Option<f64> {
        self.t0.map(|t0| self.now.since(t0))
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
        let mission_time = self.mission_time();
        for (i, vehicle) in self.vehicles.iter_mut().enumerate() {
            let force = match mission_time {
                Some(t) => pulse_force(&self.pulses, i, t),
                None => Vec3::zeros(),
            };
            vehicle.step(self.now, &self.wind, &force, DT);
        }
        self.now.0 += STEP;
        self.find_crashes()
    }

    fn find_crashes(&mut self) -> Vec<Crash> {
        let mut crashes = Vec::new();
        for i in 0..self.vehicles.len() {
            let p = self.vehicles[i].truth().p;
            let impact = self.vehicles[i].take_impact().filter(|speed| *speed > HARD_LANDING);
            let what = if let Some(speed) = impact {
                Some(format!("hit the ground at {speed:.1} m/s"))
            } else if let Some(o) = self.obstacles.iter().find(|o| o.faces.inside(&p) >= 0.0) {
                Some(format!("touched obstacle {}", o.name))
            } else {
                self.touching(i).map(|other| format!("touched {other}"))
            };
            let (now, t) = (self.now, self.mission_time());
            if let Some(what) = what {
                crashes.extend(self.vehicles[i].crash(now, t, what));
            }
        }
        crashes
    }

    fn touching(&self, i: usize) -> Option<&str> {
        let one = &self.vehicles[i];
        let span = one.airframe().rotor_span;
        self.vehicles
            .iter()
            .enumerate()
            .find(|(j, other)| *j != i && (other.truth().p - one.truth().p).norm() < span)
            .map(|(_, other)| other.id())
    }
}

fn pulse_force(pulses: &[(usize, Pulse)], vehicle: usize, t: f64) -> Vec3 {
    pulses
        .iter()
        .filter(|(i, p)| *i == vehicle && t >= p.t && t < p.t + p.duration)
        .fold(Vec3::zeros(), |sum, (_, p)| sum + p.force)
}

#[cfg(test)]
mod tests;
