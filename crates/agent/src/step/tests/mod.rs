//! Flights of the agent in virtual time, against a vehicle small enough to be obvious.

mod admission;
mod failures;
mod flight;
pub mod plans;
mod rig;
