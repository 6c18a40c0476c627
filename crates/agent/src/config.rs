//! Configuration of the agent binary: TOML file and flags.
