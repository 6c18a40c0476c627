//! Hover thrust, estimated in flight.
