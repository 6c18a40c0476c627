//! Geometric tracking control on SO(3): state and reference to body rates and thrust.
