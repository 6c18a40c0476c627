//! One vehicle with its onboard computer, stepped on its own for as long as nothing from elsewhere
//! can reach it.

use super::onboard::{Onboard, Published};
use super::{EPOCH, VirtualError};
use crate::log;
use crate::world::{Environment, STEP, Vehicle};
use fleet_agent::record::Batch;
use fleet_core::types::Nanos;

/// What one craft did in a window of time: to be shared and logged in the order of the crafts,
/// whichever thread it flew on.
#[derive(Debug, Default)]
pub struct Window {
    /// What it published.
    pub published: Vec<Published>,
    /// What it logged.
    pub log: Batch,
    /// Why it could not go on.
    pub failure: Option<VirtualError>,
}

impl Window {
    /// Flies `steps` periods of the physics from `start` of the world's clock on.
    pub fn fly(
        &mut self,
        onboard: &mut Onboard,
        vehicle: &mut Vehicle,
        environment: &Environment,
        (start, steps): (Nanos, u64),
        logged: bool,
    ) {
        for k in 0..steps {
            let now = Nanos(start.0 + k * STEP);
            if let Err(error) = self.step(onboard, vehicle, environment, now, logged) {
                self.failure = Some(error);
                return;
            }
        }
    }

    fn step(
        &mut self,
        onboard: &mut Onboard,
        vehicle: &mut Vehicle,
        environment: &Environment,
        now: Nanos,
        logged: bool,
    ) -> Result<(), VirtualError> {
        let clock = Nanos(now.0 + EPOCH);
        if logged && let Some(truth) = log::truth(vehicle, now, environment.mission_time(now), clock.0) {
            truth.record(&mut self.log)?;
        }
        onboard.exchange(clock, vehicle);
        self.published.extend(onboard.step(clock, logged.then_some(&mut self.log))?);
        if let Some(crash) = vehicle.step(now, environment).filter(|_| logged) {
            log::record_crash(&mut self.log, &crash, crash.at.0 + EPOCH)?;
        }
        Ok(())
    }
}
