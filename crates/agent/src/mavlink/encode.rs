//! [`VehicleCmd`] to MAVLink messages.

use super::frames::frd_flu;
use super::{AUTOPILOT_COMPONENT, custom_from_mode};
use crate::io::{Stream, VehicleCmd};
use fleet_core::types::Setpoint;
use mavlink::MessageData;
use mavlink::dialects::common::{
    ATTITUDE_QUATERNION_DATA, AttitudeTargetTypemask, COMMAND_LONG_DATA, EXTENDED_SYS_STATE_DATA,
    GPS_GLOBAL_ORIGIN_DATA, HEARTBEAT_DATA, LOCAL_POSITION_NED_DATA, MavAutopilot, MavCmd, MavMessage,
    MavModeFlag, MavState, MavType, ODOMETRY_DATA, PARAM_REQUEST_READ_DATA, SET_ATTITUDE_TARGET_DATA,
    SYS_STATUS_DATA,
};
use mavlink::types::CharArray;

/// param2 of COMPONENT_ARM_DISARM that disarms in the air (mavlink.io, MAV_CMD 400).
const FORCE_DISARM: f32 = 21196.0;
/// param1 of DO_SET_MODE: MAV_MODE_FLAG_CUSTOM_MODE_ENABLED.
const CUSTOM_MODE_ENABLED: f32 = 1.0;

/// The message that asks `target` for `command`; none when a number in it is not finite, for such
/// a number must never reach a vehicle.
pub(super) fn message(command: &VehicleCmd, target: u8, boot_ms: u32) -> Option<MavMessage> {
    match command {
        VehicleCmd::Rates(setpoint) => rates(setpoint, target, boot_ms),
        VehicleCmd::Heartbeat => Some(MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            custom_mode: 0,
            mavtype: MavType::MAV_TYPE_ONBOARD_CONTROLLER,
            autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
            base_mode: MavModeFlag::empty(),
            system_status: MavState::MAV_STATE_ACTIVE,
            mavlink_version: 3,
        })),
        VehicleCmd::SetMode { mode } => {
            let custom = custom_from_mode(*mode);
            let (main, sub) = ((custom >> 16) & 0xff, custom >> 24);
            let params = [CUSTOM_MODE_ENABLED, main as f32, sub as f32];
            Some(long(MavCmd::MAV_CMD_DO_SET_MODE, target, params))
        }
        VehicleCmd::Arm { arm, force } => {
            let params = [if *arm { 1.0 } else { 0.0 }, if *force { FORCE_DISARM } else { 0.0 }, 0.0];
            Some(long(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, target, params))
        }
        VehicleCmd::Interval { stream, period_us } => {
            let params = [message_id(*stream) as f32, *period_us as f32, 0.0];
            Some(long(MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL, target, params))
        }
        VehicleCmd::Request { stream } => {
            let params = [message_id(*stream) as f32, 0.0, 0.0];
            Some(long(MavCmd::MAV_CMD_REQUEST_MESSAGE, target, params))
        }
        VehicleCmd::ReadParam { name } => Some(MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
            param_index: -1,
            target_system: target,
            target_component: AUTOPILOT_COMPONENT,
            param_id: param_id(name),
        })),
    }
}

fn rates(setpoint: &Setpoint, target: u8, boot_ms: u32) -> Option<MavMessage> {
    let frd = frd_flu(setpoint.rates);
    if !frd.iter().all(|rate| rate.is_finite()) || !setpoint.thrust.is_finite() {
        return None;
    }
    Some(MavMessage::SET_ATTITUDE_TARGET(SET_ATTITUDE_TARGET_DATA {
        time_boot_ms: boot_ms,
        q: [1.0, 0.0, 0.0, 0.0],
        body_roll_rate: frd.x as f32,
        body_pitch_rate: frd.y as f32,
        body_yaw_rate: frd.z as f32,
        thrust: setpoint.thrust.clamp(0.0, 1.0) as f32,
        target_system: target,
        target_component: AUTOPILOT_COMPONENT,
        type_mask: AttitudeTargetTypemask::ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE,
        thrust_body: [0.0; 3],
    }))
}

fn long(command: MavCmd, target: u8, [param1, param2, param3]: [f32; 3]) -> MavMessage {
    MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        param1,
        param2,
        param3,
        command,
        target_system: target,
        target_component: AUTOPILOT_COMPONENT,
        ..COMMAND_LONG_DATA::DEFAULT
    })
}

fn message_id(stream: Stream) -> u32 {
    match stream {
        Stream::Attitude => ATTITUDE_QUATERNION_DATA::ID,
        Stream::LocalPosition => LOCAL_POSITION_NED_DATA::ID,
        Stream::Odometry => ODOMETRY_DATA::ID,
        Stream::Landed => EXTENDED_SYS_STATE_DATA::ID,
        Stream::Battery => SYS_STATUS_DATA::ID,
        Stream::Origin => GPS_GLOBAL_ORIGIN_DATA::ID,
    }
}

/// 16 bytes, NUL only when the name is shorter (mavlink.io, Parameter protocol).
fn param_id(name: &str) -> CharArray<16> {
    let mut id = [0; 16];
    for (to, from) in id.iter_mut().zip(name.bytes()) {
        *to = from;
    }
    CharArray::new(id)
}
