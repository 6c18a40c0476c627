//! One vehicle of the world: body, autopilot and what became of them.

use super::STEP;
use super::environment::{ClearBall, Environment};
use super::turbulence::{PERIOD, Turbulence};
use crate::autopilot::Autopilot;
use crate::plant::{Airframe, DT, Plant, Truth};
use fleet_core::types::{Nanos, Vec3};
use serde::Serialize;

/// Period of the turbulence [ns].
const TURBULENCE_PERIOD: u64 = (PERIOD * 1e9) as u64;
/// Touching the ground faster than this is a crash [m/s]: several times PX4's landing speed.
const HARD_LANDING: f64 = 3.0;

/// Something was touched that must not be.
#[derive(Clone, Debug, PartialEq)]
pub struct Crash {
    /// Drone id.
    pub drone: String,
    /// When, since launch of the simulator.
    pub at: Nanos,
    /// When in mission time [s], if a start is known.
    pub mission_time: Option<f64>,
    /// Where [m; ENU].
    pub p: Vec3,
    /// What, for people.
    pub what: String,
}

/// What became of a vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// Never armed.
    Idle,
    /// Armed still.
    Armed,
    /// It has flown, stands on the ground and is disarmed.
    Landed,
    /// Disarmed above the ground.
    Falling,
    /// It touched something.
    Crashed,
}

/// A vehicle.
#[derive(Clone, Debug)]
pub struct Vehicle {
    index: usize,
    id: String,
    plant: Plant,
    autopilot: Autopilot,
    crash: Option<Crash>,
    was_armed: bool,
    disarmed_at: Nanos,
    clear: ClearBall,
    turbulence: Option<Turbulence>,
}

impl Vehicle {
    pub(super) fn new(
        index: usize,
        id: String,
        plant: Plant,
        autopilot: Autopilot,
        turbulence: Option<Turbulence>,
    ) -> Self {
        Self {
            index,
            id,
            plant,
            autopilot,
            crash: None,
            was_armed: false,
            disarmed_at: Nanos(0),
            clear: ClearBall::default(),
            turbulence,
        }
    }

    /// Drone id.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Ground truth.
    #[must_use]
    pub fn truth(&self) -> &Truth {
        self.plant.truth()
    }

    /// Its constants.
    #[must_use]
    pub fn airframe(&self) -> &Airframe {
        self.plant.airframe()
    }

    /// Its autopilot.
    #[must_use]
    pub fn autopilot(&self) -> &Autopilot {
        &self.autopilot
    }

    /// Its autopilot, for messages.
    pub fn autopilot_mut(&mut self) -> &mut Autopilot {
        &mut self.autopilot
    }

    /// Its body, for tests that place it.
    pub fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }

    /// Whether motors may turn.
    #[must_use]
    pub fn armed(&self) -> bool {
        self.autopilot.commander().armed()
    }

    /// Whether it was ever armed.
    #[must_use]
    pub fn was_armed(&self) -> bool {
        self.was_armed
    }

    /// For how long it has been disarmed [s]; 0 while armed.
    #[must_use]
    pub fn disarmed_for(&self, now: Nanos) -> f64 {
        if self.armed() { 0.0 } else { now.since(self.disarmed_at) }
    }

    /// The first crash, if any.
    #[must_use]
    pub fn first_crash(&self) -> Option<&Crash> {
        self.crash.as_ref()
    }

    /// What became of it so far.
    #[must_use]
    pub fn end(&self) -> End {
        match (self.crash.is_some(), self.armed(), self.was_armed, self.truth().on_ground) {
            (true, ..) => End::Crashed,
            (_, true, ..) => End::Armed,
            (_, _, false, _) => End::Idle,
            (.., true) => End::Landed,
            (.., false) => End::Falling,
        }
    }

    /// One period of the physics from `now` on. Gives the crash that happened in it; touching other
    /// vehicles is the world's to see.
    pub fn step(&mut self, now: Nanos, environment: &Environment) -> Option<Crash> {
        let motors = self.autopilot.step(now, self.plant.truth());
        if self.armed() {
            self.was_armed = true;
            self.disarmed_at = now;
        }
        let force = environment.force(self.index, now);
        let wind = self.air(now, environment.wind(now));
        self.plant.step(motors, &wind, &force, DT);
        let what = match self.plant.take_impact().filter(|speed| *speed > HARD_LANDING) {
            Some(speed) => format!("hit the ground at {speed:.1} m/s"),
            None => format!("touched obstacle {}", environment.hit(&self.plant.truth().p, &mut self.clear)?),
        };
        let then = Nanos(now.0 + STEP);
        self.crash(then, environment.mission_time(then), what)
    }

    /// Velocity of the air here [m/s; ENU]: the wind and the turbulence in it.
    fn air(&mut self, now: Nanos, wind: Vec3) -> Vec3 {
        let Some(turbulence) = &mut self.turbulence else { return wind };
        if now.0.is_multiple_of(TURBULENCE_PERIOD) {
            let truth = self.plant.truth();
            turbulence.advance(self.plant.height(), (truth.v - wind).norm(), &wind);
        }
        wind + turbulence.gust()
    }

    /// Notes the first crash and stops the motors for good; later ones change nothing.
    pub(super) fn crash(&mut self, at: Nanos, mission_time: Option<f64>, what: String) -> Option<Crash> {
        if self.crash.is_some() {
            return None;
        }
        let p = self.truth().p;
        self.crash = Some(Crash { drone: self.id.clone(), at, mission_time, p, what });
        self.autopilot.terminate();
        self.crash.clone()
    }
}
