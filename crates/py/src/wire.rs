//! Encode and decode of every message.

use crate::convert::{from_python, to_python, value_error};
use fleet_core::wire::{self, DecodeError, Down, Envelope, Plan, SCHEMA, Status, TimeReply, Up};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde::Serialize;

fn encoded<'py, T: Serialize>(py: Python<'py>, value: &T) -> PyResult<Bound<'py, PyBytes>> {
    wire::encode(value).map(|bytes| PyBytes::new(py, &bytes)).map_err(value_error)
}

fn checked<T>(value: T, schema: u16) -> PyResult<T> {
    if schema == SCHEMA { Ok(value) } else { Err(value_error(DecodeError::Schema(schema))) }
}

/// The bytes of a plan file. ValueError: a field is missing, unknown or not legal, or the plan is too large.
#[pyfunction]
pub fn encode_plan<'py>(py: Python<'py>, plan: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyBytes>> {
    let plan: Plan = from_python("plan", plan)?;
    let schema = plan.schema;
    encoded(py, &checked(plan, schema)?)
}

/// The plan in the bytes of a plan file. ValueError: not a plan, trailing bytes, another schema, a number that is
/// not finite, or too large.
#[pyfunction]
pub fn decode_plan<'py>(py: Python<'py>, data: &[u8]) -> PyResult<Bound<'py, PyAny>> {
    to_python(py, &Plan::from_bytes(data).map_err(value_error)?)
}

/// SHA-256 of the bytes of a plan file, in hex.
#[pyfunction]
pub fn plan_hash(data: &[u8]) -> String {
    wire::plan_hash(data)
}

/// The bytes of a message to a drone. ValueError: as encode_plan.
#[pyfunction]
pub fn encode_down<'py>(py: Python<'py>, envelope: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyBytes>> {
    let envelope: Envelope<Down> = from_python("envelope", envelope)?;
    let schema = envelope.schema;
    encoded(py, &checked(envelope, schema)?)
}

/// The message to a drone in these bytes. ValueError: as decode_plan.
#[pyfunction]
pub fn decode_down<'py>(py: Python<'py>, data: &[u8]) -> PyResult<Bound<'py, PyAny>> {
    to_python(py, &Envelope::<Down>::from_bytes(data).map_err(value_error)?)
}

/// The bytes of a message from a drone. ValueError: as encode_plan.
#[pyfunction]
pub fn encode_up<'py>(py: Python<'py>, envelope: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyBytes>> {
    let envelope: Envelope<Up> = from_python("envelope", envelope)?;
    let schema = envelope.schema;
    encoded(py, &checked(envelope, schema)?)
}

/// The message from a drone in these bytes. ValueError: as decode_plan.
#[pyfunction]
pub fn decode_up<'py>(py: Python<'py>, data: &[u8]) -> PyResult<Bound<'py, PyAny>> {
    to_python(py, &Envelope::<Up>::from_bytes(data).map_err(value_error)?)
}

/// The bytes of an answer to the status query. ValueError: as encode_plan.
#[pyfunction]
pub fn encode_status<'py>(py: Python<'py>, status: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyBytes>> {
    encoded(py, &from_python::<Status>("status", status)?)
}

/// The answer to the status query in these bytes. ValueError: as decode_plan.
#[pyfunction]
pub fn decode_status<'py>(py: Python<'py>, data: &[u8]) -> PyResult<Bound<'py, PyAny>> {
    to_python(py, &wire::decode::<Status>(data).map_err(value_error)?)
}

/// The bytes of an answer to the time query. ValueError: as encode_plan.
#[pyfunction]
pub fn encode_time<'py>(py: Python<'py>, time: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyBytes>> {
    encoded(py, &from_python::<TimeReply>("time", time)?)
}

/// The answer to the time query in these bytes. ValueError: as decode_plan.
#[pyfunction]
pub fn decode_time<'py>(py: Python<'py>, data: &[u8]) -> PyResult<Bound<'py, PyAny>> {
    to_python(py, &wire::decode::<TimeReply>(data).map_err(value_error)?)
}
