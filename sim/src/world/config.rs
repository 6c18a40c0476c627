//! WORLD.toml: what the simulator is told.

use fleet_core::geometry::Polyhedron;
use fleet_core::types::Vec3;
use fleet_core::wire::keys::is_name;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::net::SocketAddr;
use thiserror::Error;

/// A world.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldConfig {
    /// Seed of every random choice.
    pub seed: u64,
    /// Name of the fleet.
    pub fleet: String,
    /// Steady wind.
    #[serde(default)]
    pub wind: Wind,
    /// The vehicles.
    #[serde(rename = "vehicle")]
    pub vehicles: Vec<VehicleConfig>,
    /// Single gusts.
    #[serde(default, rename = "gust")]
    pub gusts: Vec<Gust>,
    /// Force pulses.
    #[serde(default, rename = "pulse")]
    pub pulses: Vec<Pulse>,
    /// What can be hit.
    #[serde(default, rename = "obstacle")]
    pub obstacles: Vec<Obstacle>,
}

/// Wind that blows all the time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Wind {
    /// Mean velocity of the air [m/s; ENU].
    #[serde(default)]
    pub velocity: Vec3,
    /// Dryden turbulence for this wind speed at 20 ft [m/s]; 0 is none.
    #[serde(default)]
    pub turbulence: f64,
}

/// A gust that swells and fades as `1 - cos` (EASA CS-25.341) over all vehicles.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gust {
    /// Mission time at which it begins [s].
    pub t: f64,
    /// How long it lasts [s].
    pub duration: f64,
    /// Velocity that it adds to the wind at its height [m/s; ENU].
    pub velocity: Vec3,
}

impl Gust {
    /// What it adds to the wind at mission time `t` [m/s; ENU].
    #[must_use]
    pub fn at(&self, t: f64) -> Vec3 {
        let share = (t - self.t) / self.duration;
        if !(0.0..=1.0).contains(&share) {
            return Vec3::zeros();
        }
        0.5 * (1.0 - (std::f64::consts::TAU * share).cos()) * self.velocity
    }
}

/// One vehicle.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VehicleConfig {
    /// Drone id.
    pub id: String,
    /// MAVLink system id, 1 to 250.
    pub system: u8,
    /// Position of its centre at rest [m; ENU].
    pub pad: Vec3,
    /// Heading at rest [rad], counter-clockwise from east.
    #[serde(default)]
    pub psi: f64,
    /// Address that the autopilot listens on; port 0 takes a free one.
    #[serde(default = "any_port")]
    pub mavlink: SocketAddr,
    /// Parameters that differ from PX4's defaults.
    #[serde(default)]
    pub params: BTreeMap<String, f64>,
}

/// A force on one vehicle for some time.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pulse {
    /// Drone id.
    pub drone: String,
    /// Mission time at which it begins [s].
    pub t: f64,
    /// How long it lasts [s].
    pub duration: f64,
    /// Force [N; ENU].
    pub force: Vec3,
}

/// A body that a vehicle's centre must not enter (it is already inflated by the vehicle).
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Obstacle {
    /// Name.
    pub name: String,
    /// Its faces.
    pub faces: Polyhedron,
}

/// Why a configuration is refused.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum ConfigError {
    /// Not TOML, a field is missing, unknown or of the wrong type.
    #[error("{0}")]
    Toml(String),
    /// A field has a value that is not legal.
    #[error("{field}: {problem}")]
    Field {
        /// Which field.
        field: String,
        /// What is wrong and what is legal.
        problem: String,
    },
}

fn any_port() -> SocketAddr {
    SocketAddr::from(([127, 0, 0, 1], 0))
}

impl WorldConfig {
    /// Reads and checks a configuration.
    ///
    /// # Errors
    /// See [`ConfigError`].
    pub fn parse(text: &str) -> Result<Self, ConfigError> {
        let config: Self = toml::from_str(text).map_err(|error| ConfigError::Toml(error.to_string()))?;
        config.check()?;
        Ok(config)
    }

    fn check(&self) -> Result<(), ConfigError> {
        let refuse = |field: String, problem: String| Err(ConfigError::Field { field, problem });
        let finite = |v: &Vec3| v.iter().all(|x| x.is_finite());
        if self.vehicles.is_empty() {
            return refuse("vehicle".into(), "at least one is needed".into());
        }
        if !finite(&self.wind.velocity) {
            return refuse("wind.velocity".into(), "must be finite".into());
        }
        let mut ids = BTreeSet::new();
        let mut systems = BTreeSet::new();
        for (i, v) in self.vehicles.iter().enumerate() {
            if !is_name(&v.id) || !ids.insert(&v.id) {
                let problem = format!("{:?} must be a unique letter-first name of at most 32", v.id);
                return refuse(format!("vehicle[{i}].id"), problem);
            }
            if !(1..=250).contains(&v.system) || !systems.insert(v.system) {
                let problem = format!("{} must be unique and 1 to 250", v.system);
                return refuse(format!("vehicle[{i}].system"), problem);
            }
            if !finite(&v.pad) || !v.psi.is_finite() {
                return refuse(format!("vehicle[{i}].pad"), "pad and psi must be finite".into());
            }
            if !v.mavlink.ip().is_loopback() {
                let problem = format!("{} is not a loopback address; MAVLink is not signed", v.mavlink);
                return refuse(format!("vehicle[{i}].mavlink"), problem);
            }
            if let Some(hit) = self.obstacles.iter().find(|o| o.faces.inside(&v.pad) >= 0.0) {
                return refuse(format!("vehicle[{i}].pad"), format!("lies inside obstacle {:?}", hit.name));
            }
        }
        let blows = |v: f64| v.is_finite() && v >= 0.0;
        if !(finite(&self.wind.velocity) && blows(self.wind.turbulence)) {
            let problem = "velocity must be finite, turbulence finite and not negative";
            return refuse("wind".into(), problem.into());
        }
        for (i, g) in self.gusts.iter().enumerate() {
            let sound = g.t.is_finite() && g.duration.is_finite() && g.duration > 0.0;
            if !(sound && finite(&g.velocity)) {
                let problem = "t and velocity must be finite, duration positive";
                return refuse(format!("gust[{i}]"), problem.into());
            }
        }
        for (i, p) in self.pulses.iter().enumerate() {
            if !ids.contains(&p.drone) {
                return refuse(format!("pulse[{i}].drone"), format!("{:?} is not a vehicle", p.drone));
            }
            let sound = p.t.is_finite() && p.duration.is_finite() && p.duration > 0.0;
            if !(sound && finite(&p.force)) {
                let problem = "t and force must be finite, duration positive";
                return refuse(format!("pulse[{i}]"), problem.into());
            }
        }
        Ok(())
    }
}
