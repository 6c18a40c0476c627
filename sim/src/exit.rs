//! How the program fails (design.md, Exit codes).

use fleet_agent::record::RecordError;
use std::process::ExitCode;
use thiserror::Error;

/// Why the program ends early.
#[derive(Debug, Error)]
pub enum Failure {
    /// Bad input.
    #[error("{0}")]
    Input(String),
    /// The machine does not give what is needed.
    #[error("{0}")]
    Environment(String),
}

impl Failure {
    /// The exit code.
    pub fn code(&self) -> ExitCode {
        match self {
            Self::Input(_) => ExitCode::from(2),
            Self::Environment(_) => ExitCode::from(4),
        }
    }
}

impl From<RecordError> for Failure {
    fn from(error: RecordError) -> Self {
        Self::Environment(error.to_string())
    }
}
