//! The autopilot's MAVLink behaviour.
