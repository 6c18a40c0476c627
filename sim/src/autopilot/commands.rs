//! Messages from clients and their answers (NED, FRD).

#![allow(deprecated, reason = "stock clients still send SET_MODE, PING and the old capability request")]

use super::commander::Answer;
use super::frame;
use super::mode::FlightMode;
use super::params::Value;
use super::setpoint::Target;
use super::streams::{LinkId, Refusal, id};
use super::{Autopilot, Outgoing, OutgoingBody};
use fleet_core::types::{Nanos, Vec3};
use mavlink::MavHeader;
use mavlink::Message as _;
use mavlink::dialects::common::*;
use nalgebra::{Quaternion, UnitQuaternion};

/// Component id of an autopilot.
pub const COMPONENT: u8 = 1;
/// `param2` of COMPONENT_ARM_DISARM that stops motors in the air.
const FORCE: f32 = 21196.0;

impl Autopilot {
    /// A message from a client at `now`. One for another system or component is ignored without
    /// an answer.
    pub fn on_message(&mut self, now: Nanos, link: LinkId, from: &MavHeader, message: &MavMessage) {
        self.open_link(now, link);
        let for_us = message.target_system_id().is_none_or(|t| t == 0 || t == self.system)
            && message.target_component_id().is_none_or(|t| t == 0 || t == COMPONENT);
        if !for_us {
            return;
        }
        let asker = (from.system_id as u8, from.component_id);
        match message {
            MavMessage::SET_ATTITUDE_TARGET(m) => self.on_attitude_target(now, m),
            MavMessage::COMMAND_LONG(m) => {
                let p = [m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7];
                self.on_command(now, link, asker, m.command, &p);
            }
            MavMessage::COMMAND_INT(m) => {
                let p = [m.param1, m.param2, m.param3, m.param4, m.x as f32, m.y as f32, m.z];
                self.on_command(now, link, asker, m.command, &p);
            }
            MavMessage::SET_MODE(m) => {
                let [_, _, main, sub] = m.custom_mode.to_le_bytes();
                self.set_mode(now, main, sub);
            }
            MavMessage::PARAM_REQUEST_LIST(_) => {
                for index in 0..self.params.len() {
                    self.send_param(link, index);
                }
            }
            MavMessage::PARAM_REQUEST_READ(m) => self.on_param_read(link, m),
            MavMessage::PARAM_SET(m) => self.on_param_set(link, m),
            other => self.on_protocol(now, link, asker, other),
        }
    }

    /// Clocks and missions: questions that every client may ask and that must be answered.
    fn on_protocol(&mut self, now: Nanos, link: LinkId, asker: (u8, u8), message: &MavMessage) {
        match message {
            MavMessage::TIMESYNC(m) if m.tc1 == 0 => {
                let reply = TIMESYNC_DATA {
                    tc1: self.boot(now).0 as i64,
                    ts1: m.ts1,
                    target_system: asker.0,
                    target_component: asker.1,
                };
                self.send(link, MavMessage::TIMESYNC(reply));
            }
            MavMessage::PING(m) if m.target_system == 0 => {
                let reply = PING_DATA { target_system: asker.0, target_component: asker.1, ..m.clone() };
                self.send(link, MavMessage::PING(reply));
            }
            MavMessage::MISSION_REQUEST_LIST(m) => {
                let reply = MISSION_COUNT_DATA {
                    target_system: asker.0,
                    target_component: asker.1,
                    mission_type: m.mission_type,
                    ..MISSION_COUNT_DATA::DEFAULT
                };
                self.send(link, MavMessage::MISSION_COUNT(reply));
            }
            MavMessage::MISSION_COUNT(m) => {
                let reply = MISSION_ACK_DATA {
                    target_system: asker.0,
                    target_component: asker.1,
                    mavtype: MavMissionResult::MAV_MISSION_UNSUPPORTED,
                    mission_type: m.mission_type,
                    ..MISSION_ACK_DATA::DEFAULT
                };
                self.send(link, MavMessage::MISSION_ACK(reply));
            }
            _ => {}
        }
    }

    /// A command whose number the dialect does not know: answered, so that no client waits.
    pub fn on_unknown_command(&mut self, link: LinkId, asker: (u8, u8), command: u16) {
        self.outbox.push(Outgoing { link, body: OutgoingBody::UnknownCommand { command, asker } });
    }

    /// Type masks as measured: without bit 128 the attitude counts; with it, both roll and pitch
    /// rate must be given; bit 64 is zero thrust.
    fn on_attitude_target(&mut self, now: Nanos, m: &SET_ATTITUDE_TARGET_DATA) {
        use AttitudeTargetTypemask as Mask;
        let mask = m.type_mask;
        let thrust = if mask.contains(Mask::ATTITUDE_TARGET_TYPEMASK_THROTTLE_IGNORE) {
            0.0
        } else {
            f64::from(m.thrust)
        };
        let target = if !mask.contains(Mask::ATTITUDE_TARGET_TYPEMASK_ATTITUDE_IGNORE) {
            let [w, x, y, z] = m.q.map(f64::from);
            let q = Quaternion::new(w, x, y, z);
            if !(0.5..=2.0).contains(&q.norm()) {
                return;
            }
            Target::Attitude(frame::attitude(&UnitQuaternion::new_normalize(q)))
        } else if mask.intersects(
            Mask::ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE
                | Mask::ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE,
        ) {
            return;
        } else {
            let free = mask.contains(Mask::ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE);
            let yaw = if free { f32::NAN } else { m.body_yaw_rate };
            let frd = Vec3::new(m.body_roll_rate.into(), m.body_pitch_rate.into(), yaw.into());
            Target::Rates(frame::body(&frd))
        };
        self.external.set(target, thrust);
        self.commander.setpoint_received(now);
    }

    fn on_command(&mut self, now: Nanos, link: LinkId, asker: (u8, u8), command: MavCmd, p: &[f32; 7]) {
        let result = match command {
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => self.arm_disarm(now, p),
            MavCmd::MAV_CMD_DO_SET_MODE => self.set_mode(now, p[1] as u8, p[2] as u8),
            MavCmd::MAV_CMD_NAV_LAND => self.request(now, FlightMode::Land),
            MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => self.request(now, FlightMode::Rtl),
            MavCmd::MAV_CMD_NAV_TAKEOFF => self.request(now, FlightMode::Takeoff),
            MavCmd::MAV_CMD_RUN_PREARM_CHECKS => MavResult::MAV_RESULT_ACCEPTED,
            MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL => self.set_interval(now, link, p),
            MavCmd::MAV_CMD_REQUEST_MESSAGE => self.request_message(now, link, p[0]),
            MavCmd::MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES => {
                self.request_message(now, link, id::AUTOPILOT_VERSION as f32)
            }
            _ => MavResult::MAV_RESULT_UNSUPPORTED,
        };
        let ack = COMMAND_ACK_DATA {
            command,
            result,
            progress: 0,
            result_param2: 0,
            target_system: asker.0,
            target_component: asker.1,
        };
        self.send(link, MavMessage::COMMAND_ACK(ack));
    }

    fn arm_disarm(&mut self, now: Nanos, p: &[f32; 7]) -> MavResult {
        let answer = if p[0] == 1.0 {
            self.commander.arm(now, &self.params)
        } else if p[0] == 0.0 {
            self.commander.disarm(p[1] == FORCE)
        } else {
            Answer::Unsupported
        };
        result(answer)
    }

    fn set_mode(&mut self, now: Nanos, main: u8, sub: u8) -> MavResult {
        match FlightMode::from_main_sub(main, sub) {
            Some(mode) => self.request(now, mode),
            None => MavResult::MAV_RESULT_TEMPORARILY_REJECTED,
        }
    }

    fn request(&mut self, now: Nanos, mode: FlightMode) -> MavResult {
        result(self.commander.request_mode(now, mode, &self.params))
    }

    fn set_interval(&mut self, now: Nanos, link: LinkId, p: &[f32; 7]) -> MavResult {
        let Some(streams) = self.links.get_mut(&link) else {
            return MavResult::MAV_RESULT_FAILED;
        };
        match streams.set_interval(now, p[0] as u32, f64::from(p[1])) {
            Ok(()) => MavResult::MAV_RESULT_ACCEPTED,
            Err(Refusal::Fixed) => MavResult::MAV_RESULT_FAILED,
            Err(Refusal::Unknown) => MavResult::MAV_RESULT_DENIED,
        }
    }

    fn request_message(&mut self, now: Nanos, link: LinkId, message: f32) -> MavResult {
        if self.send_by_id(now, link, message as u32) {
            MavResult::MAV_RESULT_ACCEPTED
        } else {
            MavResult::MAV_RESULT_DENIED
        }
    }

    fn on_param_read(&mut self, link: LinkId, m: &PARAM_REQUEST_READ_DATA) {
        let name = m.param_id.to_str().unwrap_or_default();
        let index = usize::try_from(m.param_index).ok().or_else(|| self.params.index_of(name));
        match index {
            Some(index) if index < self.params.len() => self.send_param(link, index),
            // A ground station that asks for the hash falls back to the list when none answers.
            _ if name == "_HASH_CHECK" => {}
            _ => self.send_text(link, &format!("unknown param: {name}")),
        }
    }

    fn on_param_set(&mut self, link: LinkId, m: &PARAM_SET_DATA) {
        let name = m.param_id.to_str().unwrap_or_default();
        let Some(index) = self.params.index_of(name) else {
            return self.send_text(link, &format!("unknown param: {name}"));
        };
        let known = self.params.at(index).map(|(_, old)| old);
        let integer = m.param_type == MavParamType::MAV_PARAM_TYPE_INT32;
        if let Some(old) = known.filter(|old| matches!(old, Value::Int(_)) == integer) {
            self.params.set(index, old.with_wire(m.param_value));
        }
        // Always answered; a refused value shows as the unchanged one.
        self.send_param(link, index);
    }

    fn send_param(&mut self, link: LinkId, index: usize) {
        let Some((name, value)) = self.params.at(index) else { return };
        let param_type = match value {
            Value::Int(_) => MavParamType::MAV_PARAM_TYPE_INT32,
            Value::Real(_) => MavParamType::MAV_PARAM_TYPE_REAL32,
        };
        let message = PARAM_VALUE_DATA {
            param_value: value.to_wire(),
            param_count: self.params.len() as u16,
            param_index: index as u16,
            param_id: name.into(),
            param_type,
        };
        self.send(link, MavMessage::PARAM_VALUE(message));
    }

    fn send_text(&mut self, link: LinkId, text: &str) {
        let message = STATUSTEXT_DATA {
            severity: MavSeverity::MAV_SEVERITY_ERROR,
            text: text.into(),
            ..STATUSTEXT_DATA::DEFAULT
        };
        self.send(link, MavMessage::STATUSTEXT(message));
    }
}

fn result(answer: Answer) -> MavResult {
    match answer {
        Answer::Accepted => MavResult::MAV_RESULT_ACCEPTED,
        Answer::TemporarilyRejected => MavResult::MAV_RESULT_TEMPORARILY_REJECTED,
        Answer::Unsupported => MavResult::MAV_RESULT_UNSUPPORTED,
    }
}
