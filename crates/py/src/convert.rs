//! Between Python's dicts and arrays and the core's types.

use fleet_core::types::Vec3;
use fleet_core::wire::{DecodeError, MAX_DEPTH};
use numpy::ndarray::ArrayView2;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A `ValueError` with the text of a typed error.
pub fn value_error(error: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// A core value from dicts and lists; `what` begins the error text.
pub fn from_python<T: DeserializeOwned>(what: &str, value: &Bound<'_, PyAny>) -> PyResult<T> {
    if depth_exceeds(value, MAX_DEPTH) {
        return Err(value_error(format!("{what}: {}", DecodeError::TooDeep)));
    }
    pythonize::depythonize(value).map_err(|error| value_error(format!("{what}: {error}")))
}

/// Whether dicts, lists and tuples are nested deeper than `limit`; without recursion, because a
/// deeper value would overflow the stack of the conversion.
fn depth_exceeds(value: &Bound<'_, PyAny>, limit: usize) -> bool {
    let mut open = vec![(value.clone(), 0)];
    while let Some((value, depth)) = open.pop() {
        let children = if let Ok(dict) = value.cast::<PyDict>() {
            dict.values()
        } else if let Ok(list) = value.cast::<PyList>() {
            list.clone()
        } else if let Ok(tuple) = value.cast::<PyTuple>() {
            tuple.to_list()
        } else {
            continue;
        };
        if depth == limit {
            return true;
        }
        open.extend(children.iter().map(|child| (child, depth + 1)));
    }
    false
}

/// Dicts and lists from a core value.
pub fn to_python<'py, T: Serialize>(py: Python<'py>, value: &T) -> PyResult<Bound<'py, PyAny>> {
    pythonize::pythonize(py, value).map_err(value_error)
}

/// The rows of an (n, 3) array.
pub fn points(what: &str, array: ArrayView2<'_, f64>) -> PyResult<Vec<Vec3>> {
    if array.ncols() != 3 {
        return Err(value_error(format!("{what} has {} columns; legal is 3", array.ncols())));
    }
    Ok(array.rows().into_iter().map(|row| Vec3::new(row[0], row[1], row[2])).collect())
}
