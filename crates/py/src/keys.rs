//! Zenoh key names.

use crate::convert::value_error;
use fleet_core::wire::keys::{self, DownChannel, Query, UpChannel};
use pyo3::prelude::*;

fn segment(what: &str, name: &str, wildcard: bool) -> PyResult<()> {
    if keys::is_name(name) || (wildcard && name == "*") {
        return Ok(());
    }
    Err(value_error(format!(
        "{what} `{name}`: legal is a letter, then up to 31 letters, digits or `_`{}",
        if wildcard { ", or `*` for all" } else { "" }
    )))
}

fn segments(fleet: &str, drone: &str) -> PyResult<()> {
    segment("fleet", fleet, false)?;
    segment("drone", drone, true)
}

/// Key of what the ground sends: channel is plan, commit or cmd; drone may be `*`. ValueError: a name is not legal.
#[pyfunction]
pub fn key_down(fleet: &str, drone: &str, channel: &str) -> PyResult<String> {
    segments(fleet, drone)?;
    let channel = match channel {
        "plan" => DownChannel::Plan,
        "commit" => DownChannel::Commit,
        "cmd" => DownChannel::Cmd,
        _ => return Err(value_error(format!("channel `{channel}`: legal is plan, commit, cmd"))),
    };
    Ok(keys::down(fleet, drone, channel))
}

/// Key of what a drone sends: channel is heartbeat, telemetry, event, ack or replan; drone may be `*`. ValueError: a
/// name is not legal.
#[pyfunction]
pub fn key_up(fleet: &str, drone: &str, channel: &str) -> PyResult<String> {
    segments(fleet, drone)?;
    let channel = match channel {
        "heartbeat" => UpChannel::Heartbeat,
        "telemetry" => UpChannel::Telemetry,
        "event" => UpChannel::Event,
        "ack" => UpChannel::Ack,
        "replan" => UpChannel::Replan,
        _ => {
            return Err(value_error(format!(
                "channel `{channel}`: legal is heartbeat, telemetry, event, ack, replan"
            )));
        }
    };
    Ok(keys::up(fleet, drone, channel))
}

/// Key of what a drone answers: query is time, status or plan; drone may be `*`. ValueError: a name is not legal.
#[pyfunction]
pub fn key_query(fleet: &str, drone: &str, query: &str) -> PyResult<String> {
    segments(fleet, drone)?;
    let query = match query {
        "time" => Query::Time,
        "status" => Query::Status,
        "plan" => Query::Plan,
        _ => return Err(value_error(format!("query `{query}`: legal is time, status, plan"))),
    };
    Ok(keys::query(fleet, drone, query))
}

/// Key of an agent's liveliness token; drone may be `*`. ValueError: a name is not legal.
#[pyfunction]
pub fn key_alive(fleet: &str, drone: &str) -> PyResult<String> {
    segments(fleet, drone)?;
    Ok(keys::alive(fleet, drone))
}

/// Whether a name may stand in a key and a formula: a letter, then up to 31 letters, digits or `_`.
#[pyfunction]
pub fn is_name(name: &str) -> bool {
    keys::is_name(name)
}
