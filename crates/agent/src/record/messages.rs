//! The logged messages and how they follow from what a step puts out.

use super::{Log, RecordError, SchemaName};
use crate::io::{Output, Tick};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use fleet_core::types::{Nanos, Quat, Vec3};
use fleet_core::wire::{Event, EventKind, Mode, Plan, ReplanNotice, Up};
use serde::Serialize;

const FRAME: &str = "map";

/// A moment of the log's clock as Foxglove writes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Timestamp {
    sec: u64,
    nsec: u32,
}

impl From<u64> for Timestamp {
    fn from(ns: u64) -> Self {
        Self { sec: ns / 1_000_000_000, nsec: (ns % 1_000_000_000) as u32 }
    }
}

/// A position [m; ENU].
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Position {
    x: f64,
    y: f64,
    z: f64,
}

/// A unit quaternion, body FLU to ENU.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Unit {
    x: f64,
    y: f64,
    z: f64,
    w: f64,
}

/// Position and orientation.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Pose {
    position: Position,
    orientation: Unit,
}

/// `foxglove.PoseInFrame` with what else is known of the motion.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PoseMessage {
    timestamp: Timestamp,
    frame_id: &'static str,
    pose: Pose,
    v: Vec3,
    #[serde(skip_serializing_if = "Option::is_none")]
    w: Option<Vec3>,
    #[serde(skip_serializing_if = "Option::is_none")]
    a: Option<Vec3>,
    mission_time: Option<f64>,
}

impl PoseMessage {
    /// A state or a ground truth: `p` [m], `v` [m/s] in ENU, `q` body FLU to ENU, `w` [rad/s; FLU].
    #[must_use]
    pub fn motion(at_ns: u64, p: Vec3, v: Vec3, q: Quat, w: Vec3, mission_time: Option<f64>) -> Self {
        Self {
            timestamp: at_ns.into(),
            frame_id: FRAME,
            pose: Pose::new(p, q),
            v,
            w: Some(w),
            a: None,
            mission_time,
        }
    }

    /// A reference: `p` [m], `v` [m/s], `a` [m/s^2] in ENU, level with heading `psi` [rad].
    #[must_use]
    pub fn reference(at_ns: u64, p: Vec3, v: Vec3, a: Vec3, psi: f64, mission_time: Option<f64>) -> Self {
        Self {
            timestamp: at_ns.into(),
            frame_id: FRAME,
            pose: Pose::new(p, Quat::from_axis_angle(&Vec3::z_axis(), psi)),
            v,
            w: None,
            a: Some(a),
            mission_time,
        }
    }
}

impl Pose {
    fn new(p: Vec3, q: Quat) -> Self {
        Self {
            position: Position { x: p.x, y: p.y, z: p.z },
            orientation: Unit { x: q.i, y: q.j, z: q.k, w: q.w },
        }
    }
}

/// `fleet.Setpoint`.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SetpointMessage {
    timestamp: Timestamp,
    rates: Vec3,
    thrust: f64,
    hover_thrust: f64,
    deviation: Option<f64>,
    mission_time: Option<f64>,
}

/// `fleet.Mode`.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ModeMessage<'a> {
    timestamp: Timestamp,
    mode: Mode,
    cause: &'a str,
    mission_time: Option<f64>,
}

/// `fleet.Replan`.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ReplanMessage<'a> {
    timestamp: Timestamp,
    notice: &'a ReplanNotice,
}

/// `fleet.Event`.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct EventMessage<'a> {
    timestamp: Timestamp,
    drone: &'a str,
    event: &'a Event,
}

impl<'a> EventMessage<'a> {
    /// An event of `drone`; the simulator reports crashes as such.
    #[must_use]
    pub fn new(at_ns: u64, drone: &'a str, event: &'a Event) -> Self {
        Self { timestamp: at_ns.into(), drone, event }
    }
}

/// `fleet.Mission`.
#[derive(Clone, Debug, Serialize)]
pub struct MissionMessage {
    timestamp: Timestamp,
    scenario: String,
    hash: String,
    seed: u64,
    t0_ns: u64,
    plan_cbor_base64: String,
}

impl MissionMessage {
    /// `bytes` is the plan file of `plan`; mission time 0 is at `t0_ns` of the log's clock.
    #[must_use]
    pub fn new(at_ns: u64, plan: &Plan, bytes: &[u8], t0_ns: u64) -> Self {
        Self {
            timestamp: at_ns.into(),
            scenario: plan.scenario.clone(),
            hash: fleet_core::wire::plan_hash(bytes),
            seed: plan.seed,
            t0_ns,
            plan_cbor_base64: STANDARD.encode(bytes),
        }
    }
}

/// Logs what a step at `now` put out: state, reference and setpoint of its tick, mode changes,
/// replans and events. `at_ns` is `now` on the log's clock.
///
/// # Errors
/// When the log cannot be written.
pub fn record_outputs(
    log: &mut impl Log,
    drone: &str,
    now: Nanos,
    at_ns: u64,
    outputs: &[Output],
) -> Result<(), RecordError> {
    for output in outputs {
        match output {
            Output::Tick(tick) => record_tick(log, drone, now, at_ns, tick)?,
            Output::Publish { message, .. } => match message.as_ref() {
                Up::Event(event) => record_event(log, drone, at_ns, event)?,
                Up::Replan(notice) => {
                    let message = ReplanMessage { timestamp: at_ns.into(), notice };
                    log.json(&format!("/{drone}/replan"), SchemaName::Replan, at_ns, &message)?;
                }
                Up::Heartbeat(_) | Up::Telemetry(_) | Up::Ack(_) => {}
            },
            Output::Vehicle(_) | Output::Solve(_) | Output::Persist { .. } | Output::Status(_) => {}
        }
    }
    Ok(())
}

fn record_tick(
    log: &mut impl Log,
    drone: &str,
    now: Nanos,
    at_ns: u64,
    tick: &Tick,
) -> Result<(), RecordError> {
    if let Some(state) = &tick.state {
        // The state is some milliseconds older than the tick; its own stamps say so.
        let age = now.since(state.at).max(0.0);
        let measured_ns = at_ns.saturating_sub((age * 1e9).round() as u64);
        let mission_time = tick.mission_time.map(|t| t - age);
        let message = PoseMessage::motion(measured_ns, state.p, state.v, state.q, state.w, mission_time);
        log.json(&format!("/{drone}/state"), SchemaName::Pose, at_ns, &message)?;
    }
    if let Some(reference) = &tick.reference {
        let message = PoseMessage::reference(
            at_ns,
            reference.p,
            reference.v,
            reference.a,
            reference.psi,
            tick.mission_time,
        );
        log.json(&format!("/{drone}/reference"), SchemaName::Pose, at_ns, &message)?;
    }
    if let Some(setpoint) = &tick.setpoint {
        let message = SetpointMessage {
            timestamp: at_ns.into(),
            rates: setpoint.rates,
            thrust: setpoint.thrust,
            hover_thrust: tick.hover_thrust,
            deviation: tick.deviation,
            mission_time: tick.mission_time,
        };
        log.json(&format!("/{drone}/setpoint"), SchemaName::Setpoint, at_ns, &message)?;
    }
    Ok(())
}

fn record_event(log: &mut impl Log, drone: &str, at_ns: u64, event: &Event) -> Result<(), RecordError> {
    let message = EventMessage::new(at_ns, drone, event);
    log.json("/event", SchemaName::Event, at_ns, &message)?;
    if let EventKind::Mode { to, .. } = event.kind {
        let message = ModeMessage {
            timestamp: at_ns.into(),
            mode: to,
            cause: &event.cause,
            mission_time: event.mission_time,
        };
        log.json(&format!("/{drone}/mode"), SchemaName::Mode, at_ns, &message)?;
    }
    Ok(())
}
