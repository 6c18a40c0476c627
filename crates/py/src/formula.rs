//! Robustness of formulas over the fleet's positions.

use crate::convert::{from_python, points, value_error};
use crate::trajectory::Trajectory;
use fleet_core::formula::{Compiled, Formula, FormulaError, Names, bound, compile, exact};
use fleet_core::types::Vec3;
use numpy::ndarray::Axis;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray3};
use pyo3::prelude::*;

/// The drones and regions that formulas name, in the order of the tracks.
///
/// drones: ids. regions: dicts {name, shape} as in a plan. ValueError: a name is given twice, or a shape is not legal.
#[pyclass(frozen, module = "fleet._core", name = "Fleet")]
pub struct Fleet {
    names: Names,
}

impl Fleet {
    fn compile(&self, formula: &Bound<'_, PyAny>, sample: f64) -> PyResult<Compiled> {
        let formula: Formula = from_python("formula", formula)?;
        compile(&formula, &self.names, sample).map_err(value_error)
    }
}

fn tracks(positions: &PyReadonlyArray3<'_, f64>) -> PyResult<Vec<Vec<Vec3>>> {
    positions.as_array().axis_iter(Axis(0)).map(|track| points("positions", track)).collect()
}

#[pymethods]
impl Fleet {
    #[new]
    fn new(drones: Vec<String>, regions: &Bound<'_, PyAny>) -> PyResult<Self> {
        let names = Names::new(drones, from_python("regions", regions)?).map_err(value_error)?;
        Ok(Self { names })
    }

    /// Drone ids in the order of the tracks.
    #[getter]
    fn drones(&self) -> Vec<String> {
        self.names.drones().to_vec()
    }

    /// How far a formula looks ahead [s], after checking its names and windows on the sample grid [s].
    ///
    /// ValueError: an unknown name, a window that is not legal, a constant that is not finite, or a horizon beyond
    /// `end` [s] when that is given.
    #[pyo3(signature = (formula, sample, end=None))]
    fn check(&self, formula: &Bound<'_, PyAny>, sample: f64, end: Option<f64>) -> PyResult<f64> {
        let needed = self.compile(formula, sample)?.horizon();
        match end {
            // Half a sample: both are multiples of the sample period up to rounding.
            Some(available) if needed > available + 0.5 * sample => {
                Err(value_error(FormulaError::Horizon { needed, available }))
            }
            _ => Ok(needed),
        }
    }

    /// Exact robustness [m] at each sample at which the formula's horizon fits, (n - horizon,).
    ///
    /// positions: (d, n, 3) [m; ENU], drone, sample, axis; sample: sample period [s]. ValueError: as check, and when
    /// the trace ends before the horizon or does not match the fleet.
    fn robustness<'py>(
        &self,
        py: Python<'py>,
        formula: &Bound<'py, PyAny>,
        positions: PyReadonlyArray3<'py, f64>,
        sample: f64,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let compiled = self.compile(formula, sample)?;
        let tracks = tracks(&positions)?;
        let trace = py.detach(|| exact::robustness(&compiled, &tracks)).map_err(value_error)?;
        Ok(trace.into_iter().map(|p| p.rho).collect::<Vec<f64>>().into_pyarray(py))
    }

    /// Exact robustness [m] at time 0 and the time [s] of the sample that attains it.
    ///
    /// positions, sample and errors as robustness.
    fn evaluate(
        &self,
        py: Python<'_>,
        formula: &Bound<'_, PyAny>,
        positions: PyReadonlyArray3<'_, f64>,
        sample: f64,
    ) -> PyResult<(f64, f64)> {
        let compiled = self.compile(formula, sample)?;
        let tracks = tracks(&positions)?;
        let point = py.detach(|| exact::evaluate(&compiled, &tracks)).map_err(value_error)?;
        Ok((point.rho, point.at as f64 * sample))
    }

    /// Guaranteed lower bound [m] at time 0 over continuous time, and the time [s] of the sample at which, or after
    /// which, it is attained; never above the exact robustness.
    ///
    /// trajectories: one for each drone, covering 0 to the horizon; sample: sample period [s], witnesses of eventually
    /// and until lie on it. ValueError: as check, and when a trajectory is missing or too short.
    fn lower_bound(
        &self,
        py: Python<'_>,
        formula: &Bound<'_, PyAny>,
        trajectories: Vec<Py<Trajectory>>,
        sample: f64,
    ) -> PyResult<(f64, f64)> {
        let compiled = self.compile(formula, sample)?;
        let point = py
            .detach(|| {
                let trajectories: Vec<_> = trajectories.iter().map(|t| &t.get().0).collect();
                bound::lower_bound(&compiled, &trajectories)
            })
            .map_err(value_error)?;
        Ok((point.rho, point.at as f64 * sample))
    }
}
