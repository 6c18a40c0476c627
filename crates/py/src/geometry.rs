//! Signed distances to convex polyhedra.

use crate::convert::{from_python, points};
use fleet_core::geometry::Polyhedron;
use fleet_core::types::Vec3;
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

fn each<'py>(
    faces: &Bound<'py, PyAny>,
    positions: &PyReadonlyArray2<'py, f64>,
    distance: impl Fn(&Polyhedron, &Vec3) -> f64,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let polyhedron: Polyhedron = from_python("faces", faces)?;
    let values: Vec<f64> =
        points("points", positions.as_array())?.iter().map(|x| distance(&polyhedron, x)).collect();
    Ok(values.into_pyarray(faces.py()))
}

/// Robustness of being inside {x : a_i . x <= b_i}, min_i (b_i - a_i . x) [m], of points (m, 3) -> (m,).
///
/// Rows are brought to unit length. ValueError: no face, a zero normal, or the wrong shape.
#[pyfunction]
pub fn inside<'py>(
    faces: &Bound<'py, PyAny>,
    points: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    each(faces, &points, Polyhedron::inside)
}

/// Robustness of being outside, max_i (a_i . x - b_i) [m], of points (m, 3) -> (m,); never more than the distance.
///
/// Rows are brought to unit length. ValueError: no face, a zero normal, or the wrong shape.
#[pyfunction]
pub fn outside<'py>(
    faces: &Bound<'py, PyAny>,
    points: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    each(faces, &points, Polyhedron::outside)
}
