//! MCAP recording, shared by agent and simulator.
