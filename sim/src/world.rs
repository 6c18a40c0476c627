//! n plants, wind, force pulses, ground truth.
