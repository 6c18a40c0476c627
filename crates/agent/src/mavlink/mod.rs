//! The one place that knows NED, FRD and MAVLink: datagrams to vehicle messages and back.
//!
//! Pure: bytes in, messages out. PX4 conventions (custom modes, parameter encoding).

mod decode;
mod encode;
pub mod frames;
pub mod framing;
#[cfg(test)]
mod tests;

use crate::io::{VehicleCmd, VehicleMode, VehicleMsg};
use decode::Addressee;
use mavlink::dialects::common::{MavMessage, TIMESYNC_DATA};
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MessageData};

/// Component id of the agent: MAV_COMP_ID_ONBOARD_COMPUTER.
pub const OWN_COMPONENT: u8 = 191;
/// Component id of an autopilot: MAV_COMP_ID_AUTOPILOT1.
pub const AUTOPILOT_COMPONENT: u8 = 1;

// PX4 px4_custom_mode.h: main mode in bits 16 to 23, sub mode in bits 24 to 31.
const OFFBOARD: u32 = 6 << 16;
const AUTO_LOITER: u32 = 4 << 16 | 3 << 24;
const AUTO_LAND: u32 = 4 << 16 | 6 << 24;

/// Speaks to one autopilot.
#[derive(Clone, Debug)]
pub struct Codec {
    own_system: u8,
    target_system: u8,
    sequence: u8,
}

impl Codec {
    /// Sends as `own_system` (normally the autopilot's own, as a companion computer does) to the
    /// autopilot `target_system`; hears nobody else.
    #[must_use]
    pub fn new(own_system: u8, target_system: u8) -> Self {
        Self { own_system, target_system, sequence: 0 }
    }

    /// What the autopilot says in `datagram`. Corrupt bytes, other senders and messages without
    /// meaning for the agent give nothing.
    #[must_use]
    pub fn decode(&self, datagram: &[u8]) -> Vec<VehicleMsg> {
        let own = Addressee { system: self.own_system, component: OWN_COMPONENT };
        self.heard(datagram).filter_map(|frame| decode::vehicle_message(&frame.parse()?, own)).collect()
    }

    /// One MAVLink 2 frame; `boot_ms` is the agent's clock in milliseconds. Empty when the command
    /// holds a number that is not finite: such a number must never reach a vehicle.
    pub fn encode(&mut self, command: &VehicleCmd, boot_ms: u32) -> Vec<u8> {
        match encode::message(command, self.target_system, boot_ms) {
            Some(message) => self.frame(&message),
            None => Vec::new(),
        }
    }

    /// Answers to the TIMESYNC requests in `datagram`, one frame each; `now_ns` is the agent's
    /// clock (mavlink.io, Time synchronization: a request has tc1 = 0).
    pub fn timesync_replies(&mut self, datagram: &[u8], now_ns: u64) -> Vec<Vec<u8>> {
        let requests: Vec<TIMESYNC_DATA> = self
            .heard(datagram)
            .filter(|frame| frame.id == TIMESYNC_DATA::ID)
            .filter_map(|frame| match frame.parse() {
                Some(MavMessage::TIMESYNC(data)) if data.tc1 == 0 => Some(data),
                _ => None,
            })
            .collect();
        requests
            .into_iter()
            .map(|request| {
                self.frame(&MavMessage::TIMESYNC(TIMESYNC_DATA {
                    tc1: i64::try_from(now_ns).unwrap_or(i64::MAX),
                    ts1: request.ts1,
                    target_system: self.target_system,
                    target_component: AUTOPILOT_COMPONENT,
                }))
            })
            .collect()
    }

    fn heard<'a>(&self, datagram: &'a [u8]) -> impl Iterator<Item = framing::Frame<'a>> {
        let target = u32::from(self.target_system);
        framing::frames(datagram).into_iter().filter(move |frame| {
            frame.header.system_id == target && frame.header.component_id == AUTOPILOT_COMPONENT
        })
    }

    fn frame(&mut self, message: &MavMessage) -> Vec<u8> {
        let header = MavHeader {
            system_id: u32::from(self.own_system),
            component_id: OWN_COMPONENT,
            sequence: self.sequence,
        };
        self.sequence = self.sequence.wrapping_add(1);
        let mut raw = MAVLinkV2MessageRaw::new();
        raw.serialize_message(header, message);
        raw.raw_bytes().to_vec()
    }
}

fn mode_from_custom(custom: u32) -> VehicleMode {
    match custom {
        AUTO_LAND => VehicleMode::Land,
        AUTO_LOITER => VehicleMode::Loiter,
        // OFFBOARD has no sub modes.
        _ if custom & 0x00ff_0000 == OFFBOARD => VehicleMode::Offboard,
        other => VehicleMode::Other(other),
    }
}

fn custom_from_mode(mode: VehicleMode) -> u32 {
    match mode {
        VehicleMode::Offboard => OFFBOARD,
        VehicleMode::Land => AUTO_LAND,
        VehicleMode::Loiter => AUTO_LOITER,
        VehicleMode::Other(custom) => custom,
    }
}
