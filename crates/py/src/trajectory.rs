//! Piecewise quintic trajectories as arrays.

use crate::convert::{from_python, to_python, value_error};
use fleet_core::power::Vehicle;
use fleet_core::trajectory::{self, Knot};
use fleet_core::types::Vec3;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, ToPyArray};
use pyo3::prelude::*;

/// A piecewise quintic trajectory in mission time [s], made of knots.
///
/// knots: (n, 13) rows t, p (3), v (3), a (3), psi, psi_rate, psi_acc [s, m, rad; ENU]. Between two knots each axis
/// is the quintic that meets both ends. ValueError: the wrong shape, a number that is not finite, or a segment that
/// is not 0.05 to 10 s long.
#[pyclass(frozen, module = "fleet._core", name = "Trajectory")]
pub struct Trajectory(pub trajectory::Trajectory);

/// Velocity and acceleration bounds.
type Bounds<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>);

#[pymethods]
impl Trajectory {
    #[new]
    fn new(knots: PyReadonlyArray2<'_, f64>) -> PyResult<Self> {
        let rows = knots.as_array();
        if rows.ncols() != 13 {
            return Err(value_error(format!("knots have {} columns; legal is 13", rows.ncols())));
        }
        let vector = |r: &numpy::ndarray::ArrayView1<'_, f64>, i: usize| Vec3::new(r[i], r[i + 1], r[i + 2]);
        let knots: Vec<Knot> = rows
            .rows()
            .into_iter()
            .map(|r| Knot {
                t: r[0],
                p: vector(&r, 1),
                v: vector(&r, 4),
                a: vector(&r, 7),
                psi: r[10],
                psi_rate: r[11],
                psi_acc: r[12],
            })
            .collect();
        trajectory::Trajectory::try_from(knots).map(Self).map_err(value_error)
    }

    /// The trajectory of a plan: from its list of knot dicts. ValueError: as the constructor.
    #[staticmethod]
    fn from_list(knots: &Bound<'_, PyAny>) -> PyResult<Self> {
        from_python("trajectory", knots).map(Self)
    }

    /// The knots as a plan holds them: a list of dicts.
    fn to_list<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.0)
    }

    /// The knots, (n, 13) as given to the constructor.
    #[getter]
    fn knots<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let knots = self.0.knots();
        let mut rows = Array2::zeros((knots.len(), 13));
        for (mut row, k) in rows.rows_mut().into_iter().zip(knots) {
            let values = [k.t]
                .into_iter()
                .chain(k.p.iter().copied())
                .chain(k.v.iter().copied())
                .chain(k.a.iter().copied())
                .chain([k.psi, k.psi_rate, k.psi_acc]);
            for (cell, value) in row.iter_mut().zip(values) {
                *cell = value;
            }
        }
        rows.into_pyarray(py)
    }

    /// First mission time [s].
    #[getter]
    fn start(&self) -> f64 {
        self.0.start()
    }

    /// Last mission time [s].
    #[getter]
    fn end(&self) -> f64 {
        self.0.end()
    }

    /// States at times (m,) [s] -> (m, 14) rows p (3), v (3), a (3), j (3), psi, psi_rate.
    ///
    /// Outside of start..end it rests at the first or last position. ValueError: a time that is not finite.
    fn sample<'py>(
        &self,
        py: Python<'py>,
        times: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let times = times.as_array();
        if times.iter().any(|t| !t.is_finite()) {
            return Err(value_error("a time is not a finite number"));
        }
        let mut rows = Array2::zeros((times.len(), 14));
        for (mut row, t) in rows.rows_mut().into_iter().zip(times) {
            let r = self.0.sample(*t);
            let values = r.p.iter().chain(&r.v).chain(&r.a).chain(&r.j).chain([&r.psi, &r.psi_rate]);
            for (cell, value) in row.iter_mut().zip(values) {
                *cell = *value;
            }
        }
        Ok(rows.into_pyarray(py))
    }

    /// Upper bounds of |v| [m/s] and |a| [m/s^2] per axis over continuous time, (3,) each: never below the true
    /// maximum, at most 1e-7 above it (Bernstein control points with subdivision).
    fn bounds<'py>(&self, py: Python<'py>) -> Bounds<'py> {
        let (v, a) = self.0.bounds();
        (v.as_slice().to_pyarray(py), a.as_slice().to_pyarray(py))
    }

    /// Electrical energy [J] of flying it in still air, and of hovering for as long (see `flight_power`).
    fn energy(&self) -> (f64, f64) {
        let energy = Vehicle::F450.energy(&self.0);
        (energy.total, energy.hover)
    }

    fn __repr__(&self) -> String {
        format!("Trajectory({} segments, {} s to {} s)", self.0.segments(), self.0.start(), self.0.end())
    }
}
