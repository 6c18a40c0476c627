//! `fleet._core`: the core as Python sees it. Messages are dicts with the serde names.

mod convert;
mod formula;
mod geometry;
mod keys;
mod power;
mod trajectory;
mod wire;

use pyo3::prelude::*;

/// Wire messages, key names, trajectories, geometry and robustness of fleet, from the Rust core.
///
/// SI units, radians, world frame ENU. Messages are dicts as the TypedDicts of the stub say.
#[pymodule]
mod _core {
    #[pymodule_export]
    use crate::formula::Fleet;
    #[pymodule_export]
    use crate::geometry::{inside, outside};
    #[pymodule_export]
    use crate::keys::{is_name, key_alive, key_down, key_query, key_up};
    #[pymodule_export]
    use crate::power::{flight_power, hover_power};
    #[pymodule_export]
    use crate::trajectory::Trajectory;
    #[pymodule_export]
    use crate::wire::{
        decode_down, decode_plan, decode_status, decode_time, decode_up, encode_down, encode_plan,
        encode_status, encode_time, encode_up, plan_hash,
    };

    /// Version of the wire format; another version is refused.
    #[pymodule_export]
    const SCHEMA: u16 = fleet_core::wire::SCHEMA;
    /// Largest message or plan file [bytes].
    #[pymodule_export]
    const MAX_BYTES: usize = fleet_core::wire::MAX_BYTES;
}
