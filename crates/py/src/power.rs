//! The power model of the vehicle as arrays.

use crate::convert::{points, value_error};
use fleet_core::power::Vehicle;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

/// Electrical power (n,) [W] of flying with velocities (n, 3) [m/s] and accelerations (n, 3) [m/s^2; ENU] in still
/// air: the DJI F450 of the simulator. ValueError: shapes that do not fit, or a number that is not finite.
#[pyfunction]
pub fn flight_power<'py>(
    py: Python<'py>,
    velocities: PyReadonlyArray2<'py, f64>,
    accelerations: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let v = points("velocities", velocities.as_array())?;
    let a = points("accelerations", accelerations.as_array())?;
    if v.len() != a.len() {
        return Err(value_error(format!(
            "{} velocities and {} accelerations; need as many",
            v.len(),
            a.len()
        )));
    }
    if v.iter().chain(&a).any(|row| row.iter().any(|x| !x.is_finite())) {
        return Err(value_error("a velocity or acceleration is not a finite number"));
    }
    let power: Vec<f64> = v.iter().zip(&a).map(|(v, a)| Vehicle::F450.flight_power(a, v)).collect();
    Ok(power.into_pyarray(py))
}

/// Electrical power of hovering [W].
#[pyfunction]
pub fn hover_power() -> f64 {
    Vehicle::F450.hover_power()
}
