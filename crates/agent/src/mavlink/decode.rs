//! MAVLink messages of the autopilot to [`VehicleMsg`].

use super::frames::{attitude, frd_flu, ned_enu};
use super::mode_from_custom;
use crate::io::{VehicleMsg, VehicleRequest};
use fleet_core::types::{Quat, Vec3};
use mavlink::dialects::common::{
    ATTITUDE_QUATERNION_DATA, COMMAND_ACK_DATA, GPS_GLOBAL_ORIGIN_DATA, HEARTBEAT_DATA,
    LOCAL_POSITION_NED_DATA, MavCmd, MavLandedState, MavMessage, MavModeFlag, MavParamType,
    MavSysStatusSensor, PARAM_VALUE_DATA, SYS_STATUS_DATA,
};
use nalgebra::Quaternion;

/// Who an acknowledgement must be addressed to; 0 is everybody.
#[derive(Clone, Copy, Debug)]
pub(super) struct Addressee {
    pub system: u8,
    pub component: u8,
}

/// What `message` means to the agent; none when it means nothing or holds a number that is not
/// finite (such a state counts as not received).
pub(super) fn vehicle_message(message: &MavMessage, own: Addressee) -> Option<VehicleMsg> {
    match message {
        MavMessage::HEARTBEAT(data) => Some(heartbeat(data)),
        MavMessage::CURRENT_MODE(data) => Some(VehicleMsg::Mode {
            actual: mode_from_custom(data.custom_mode),
            intended: mode_from_custom(data.intended_custom_mode),
        }),
        MavMessage::ATTITUDE_QUATERNION(data) => attitude_quaternion(data),
        MavMessage::LOCAL_POSITION_NED(data) => local_position(data),
        MavMessage::ODOMETRY(data) => Some(VehicleMsg::Odometry { reset_counter: data.reset_counter }),
        MavMessage::GPS_GLOBAL_ORIGIN(data) => Some(origin(data)),
        MavMessage::COMMAND_ACK(data) => Some(ack(data, own)),
        MavMessage::PARAM_VALUE(data) => param(data),
        MavMessage::SYS_STATUS(data) => Some(battery(data)),
        MavMessage::EXTENDED_SYS_STATE(data) => match data.landed_state {
            MavLandedState::MAV_LANDED_STATE_UNDEFINED => None,
            state => {
                Some(VehicleMsg::Landed { on_ground: state == MavLandedState::MAV_LANDED_STATE_ON_GROUND })
            }
        },
        MavMessage::STATUSTEXT(data) => Some(VehicleMsg::Text { text: text(&data.text[..]) }),
        _ => None,
    }
}

fn heartbeat(data: &HEARTBEAT_DATA) -> VehicleMsg {
    VehicleMsg::Heartbeat {
        armed: data.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED),
        mode: mode_from_custom(data.custom_mode),
        system_status: data.system_status as u8,
    }
}

fn attitude_quaternion(data: &ATTITUDE_QUATERNION_DATA) -> Option<VehicleMsg> {
    let [w, i, j, k] = [data.q1, data.q2, data.q3, data.q4].map(f64::from);
    let q = Quaternion::new(w, i, j, k);
    // Single precision and a coarse autopilot leave some 1e-3; zero or NaN is no attitude at all.
    if !q.norm().is_finite() || (q.norm() - 1.0).abs() > 0.01 {
        return None;
    }
    let rates = vector(data.rollspeed, data.pitchspeed, data.yawspeed)?;
    Some(VehicleMsg::Attitude {
        boot_ms: data.time_boot_ms,
        q: attitude(&Quat::new_normalize(q)),
        w: frd_flu(rates),
    })
}

fn local_position(data: &LOCAL_POSITION_NED_DATA) -> Option<VehicleMsg> {
    Some(VehicleMsg::LocalPosition {
        boot_ms: data.time_boot_ms,
        p: ned_enu(vector(data.x, data.y, data.z)?),
        v: ned_enu(vector(data.vx, data.vy, data.vz)?),
    })
}

fn origin(data: &GPS_GLOBAL_ORIGIN_DATA) -> VehicleMsg {
    VehicleMsg::Origin {
        latitude: f64::from(data.latitude) * 1e-7,
        longitude: f64::from(data.longitude) * 1e-7,
        altitude: f64::from(data.altitude) * 1e-3,
    }
}

fn ack(data: &COMMAND_ACK_DATA, own: Addressee) -> VehicleMsg {
    // MAVLink 1 and old firmware leave the address out, which reads as 0.
    let ours =
        [0, own.system].contains(&data.target_system) && [0, own.component].contains(&data.target_component);
    let request = match data.command {
        _ if !ours => None,
        MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => Some(VehicleRequest::Arm),
        MavCmd::MAV_CMD_DO_SET_MODE => Some(VehicleRequest::Mode),
        MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => Some(VehicleRequest::Interval),
        MavCmd::MAV_CMD_REQUEST_MESSAGE => Some(VehicleRequest::Message),
        _ => None,
    };
    VehicleMsg::Ack { request, result: data.result as u8 }
}

/// PX4 sends integers as bit patterns in the float ("bytewise" in mavlink.io, Parameter protocol).
fn param(data: &PARAM_VALUE_DATA) -> Option<VehicleMsg> {
    let bits = data.param_value.to_bits();
    let value = match data.param_type {
        MavParamType::MAV_PARAM_TYPE_UINT8 => f64::from(bits as u8),
        MavParamType::MAV_PARAM_TYPE_INT8 => f64::from(bits as u8 as i8),
        MavParamType::MAV_PARAM_TYPE_UINT16 => f64::from(bits as u16),
        MavParamType::MAV_PARAM_TYPE_INT16 => f64::from(bits as u16 as i16),
        MavParamType::MAV_PARAM_TYPE_UINT32 => f64::from(bits),
        MavParamType::MAV_PARAM_TYPE_INT32 => f64::from(bits as i32),
        MavParamType::MAV_PARAM_TYPE_REAL32 => f64::from(data.param_value),
        // 64-bit values do not fit into this message.
        _ => return None,
    };
    value.is_finite().then(|| VehicleMsg::Param { name: text(&data.param_id[..]), value })
}

fn battery(data: &SYS_STATUS_DATA) -> VehicleMsg {
    VehicleMsg::Battery {
        remaining: (0..=100)
            .contains(&data.battery_remaining)
            .then(|| f64::from(data.battery_remaining) / 100.0),
        voltage: (data.voltage_battery != u16::MAX).then(|| f64::from(data.voltage_battery) * 1e-3),
        prearm_ok: data
            .onboard_control_sensors_health
            .contains(MavSysStatusSensor::MAV_SYS_STATUS_PREARM_CHECK),
    }
}

fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

fn vector(x: f32, y: f32, z: f32) -> Option<Vec3> {
    let v = Vec3::new(x.into(), y.into(), z.into());
    v.iter().all(|c| c.is_finite()).then_some(v)
}
