//! The agent as a pure function of time and messages.

mod config;

use crate::io::{Input, Output};
pub use config::{AgentConfig, Landing, PreflightLimits, VehicleLimits};
use fleet_core::types::Nanos;

/// The onboard logic.
#[derive(Debug)]
pub struct Agent {
    config: AgentConfig,
}

impl Agent {
    /// An idle agent.
    #[must_use]
    pub fn new(config: AgentConfig) -> Self {
        Self { config }
    }

    /// Takes the messages that have arrived and gives the ones to send. Calling it with the same
    /// times and messages gives the same answers, byte for byte.
    pub fn step(&mut self, now: Nanos, inbox: &[Input]) -> Vec<Output> {
        let _ = (now, inbox, &self.config);
        Vec::new()
    }
}
