//! Flights of the agent in virtual time, against a vehicle small enough to be obvious.

mod flight;
mod rig;
