//! Rigid body quadrotor with motors, drag and a rate controller.
