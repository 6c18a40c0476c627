//! The pure core of fleet: everything that must give the same answer on the ground, on board,
//! in simulation and in replay.
//!
//! No clock, socket, thread, file or random number is used here; time and messages are arguments.
//! World frame is ENU, body frame FLU, SI units and radians throughout.
#![forbid(unsafe_code)]

pub mod admission;
pub mod control;
pub mod formula;
pub mod geometry;
pub mod hover;
pub mod monitor;
pub mod power;
pub mod replan;
pub mod trajectory;
pub mod types;
pub mod wire;
