//! Simulated rate-controlled quadrotors that speak MAVLink as a PX4 does, in real and in virtual
//! time.
#![forbid(unsafe_code)]

pub mod autopilot;
pub mod framing;
pub mod log;
pub mod plant;
pub mod virtual_time;
pub mod world;
