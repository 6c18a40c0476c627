//! What acts on every vehicle, and what a vehicle can hit.

use super::config::{Gust, Obstacle, Pulse, WorldConfig};
use fleet_core::types::{Nanos, Vec3};

/// The air, the pushes and the solid bodies; the same for all vehicles, unchanged by any of them.
#[derive(Clone, Debug)]
pub struct Environment {
    t0: Option<Nanos>,
    wind: Vec3,
    gusts: Vec<Gust>,
    pulses: Vec<Vec<Pulse>>,
    obstacles: Vec<Obstacle>,
}

/// The ball around a vehicle in which there is no obstacle: as long as it stays in there, none has
/// to be looked at.
#[derive(Clone, Copy, Debug, Default)]
pub struct ClearBall {
    centre: Vec3,
    radius: f64,
}

impl Environment {
    /// From a checked configuration.
    #[must_use]
    pub fn new(config: &WorldConfig) -> Self {
        let of = |id: &str| config.pulses.iter().filter(|p| p.drone == id).cloned().collect();
        Self {
            t0: None,
            wind: config.wind.velocity,
            gusts: config.gusts.clone(),
            pulses: config.vehicles.iter().map(|v| of(&v.id)).collect(),
            obstacles: config.obstacles.clone(),
        }
    }

    /// Sets mission time 0.
    pub fn set_t0(&mut self, t0: Nanos) {
        self.t0 = Some(t0);
    }

    /// Mission time at `now` [s], when a start is known.
    #[must_use]
    pub fn mission_time(&self, now: Nanos) -> Option<f64> {
        self.t0.map(|t0| now.since(t0))
    }

    /// Mean wind and single gusts at `now` [m/s; ENU]; turbulence differs from vehicle to vehicle.
    #[must_use]
    pub fn wind(&self, now: Nanos) -> Vec3 {
        let gusts = |t| self.gusts.iter().fold(Vec3::zeros(), |sum, gust| sum + gust.at(t));
        self.wind + self.mission_time(now).map_or_else(Vec3::zeros, gusts)
    }

    /// What pushes the vehicle with this index [N; ENU].
    #[must_use]
    pub fn force(&self, vehicle: usize, now: Nanos) -> Vec3 {
        let Some(t) = self.mission_time(now) else { return Vec3::zeros() };
        self.pulses[vehicle]
            .iter()
            .filter(|p| t >= p.t && t < p.t + p.duration)
            .fold(Vec3::zeros(), |sum, p| sum + p.force)
    }

    /// The obstacle that the point lies in, if any. The clearance along the faces is at most the true
    /// distance, so a ball of that radius is clear.
    pub fn hit(&self, p: &Vec3, clear: &mut ClearBall) -> Option<&str> {
        if (p - clear.centre).norm() < clear.radius {
            return None;
        }
        let mut nearest = f64::INFINITY;
        for obstacle in &self.obstacles {
            let clearance = obstacle.faces.outside(p);
            if clearance <= 0.0 {
                *clear = ClearBall::default();
                return Some(&obstacle.name);
            }
            nearest = nearest.min(clearance);
        }
        *clear = ClearBall { centre: *p, radius: nearest };
        None
    }
}
