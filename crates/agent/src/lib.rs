//! The onboard agent: a pure [`Agent::step`] and, around it, clock, sockets, Zenoh and disk.
#![forbid(unsafe_code)]

pub mod config;
pub mod io;
pub mod mavlink;
pub mod record;
pub mod runtime;
mod step;

pub use fleet_core::replan::{Request as SolveRequest, Solution as SolveResult};
pub use step::{Agent, AgentConfig, Landing, PreflightLimits, VehicleLimits};
