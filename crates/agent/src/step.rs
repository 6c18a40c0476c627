//! The agent as a pure function of time and messages.

use crate::io::{Input, Output};
use fleet_core::types::Nanos;
use serde::{Deserialize, Serialize};

/// What the step needs to know before the first message.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AgentConfig {
    /// Name of the fleet.
    pub fleet: String,
    /// Id of this drone.
    pub drone: String,
}

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
