//! Bytes from clients to the autopilot and back.

use crate::autopilot::{Autopilot, LinkId, Outgoing, OutgoingBody};
use fleet_agent::mavlink::framing::{Frame, frames};
use fleet_core::types::Nanos;
use mavlink::dialects::common::{
    COMMAND_ACK_DATA, COMMAND_INT_DATA, COMMAND_LONG_DATA, MavMessage, MavResult,
};
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MessageData, calculate_crc};

/// Where the command number lies in the payload of COMMAND_LONG and COMMAND_INT alike.
const COMMAND_AT: usize = 28;
/// Length of a MAVLink 2 header with its start byte.
const HEADER: usize = 10;

/// Gives a client's datagram to the autopilot. Corrupt bytes and messages without meaning for an
/// autopilot are skipped, as the real one does.
pub fn deliver(autopilot: &mut Autopilot, now: Nanos, link: LinkId, datagram: &[u8]) {
    for frame in frames(datagram) {
        match frame.parse() {
            Some(message) => autopilot.on_message(now, link, &frame.header, &message),
            None => deliver_unknown_command(autopilot, link, &frame),
        }
    }
}

fn deliver_unknown_command(autopilot: &mut Autopilot, link: LinkId, frame: &Frame<'_>) {
    if frame.id != COMMAND_LONG_DATA::ID && frame.id != COMMAND_INT_DATA::ID {
        return;
    }
    // Trailing zeros are not sent.
    let byte = |at: usize| frame.payload.get(at).copied().unwrap_or_default();
    let target = byte(COMMAND_AT + 2);
    if target == 0 || target == autopilot.system() {
        let command = u16::from_le_bytes([byte(COMMAND_AT), byte(COMMAND_AT + 1)]);
        let asker = (frame.header.system_id as u8, frame.header.component_id);
        autopilot.on_unknown_command(link, asker, command);
    }
}

/// Writes the frames of one autopilot.
#[derive(Clone, Debug)]
pub struct Encoder {
    header: MavHeader,
}

impl Encoder {
    /// For the autopilot with this system id.
    #[must_use]
    pub fn new(system: u8) -> Self {
        Self { header: MavHeader { system_id: u32::from(system), component_id: 1, sequence: 0 } }
    }

    /// One MAVLink 2 frame.
    pub fn encode(&mut self, outgoing: &Outgoing) -> Vec<u8> {
        self.header.sequence = self.header.sequence.wrapping_add(1);
        let mut raw = MAVLinkV2MessageRaw::new();
        match &outgoing.body {
            OutgoingBody::Message(message) => {
                raw.serialize_message(self.header, message.as_ref());
                raw.raw_bytes().to_vec()
            }
            OutgoingBody::UnknownCommand { command, asker } => {
                let ack = COMMAND_ACK_DATA {
                    result: MavResult::MAV_RESULT_UNSUPPORTED,
                    target_system: asker.0,
                    target_component: asker.1,
                    ..COMMAND_ACK_DATA::DEFAULT
                };
                raw.serialize_message(self.header, &MavMessage::COMMAND_ACK(ack));
                with_command(raw.raw_bytes().to_vec(), *command)
            }
        }
    }
}

/// Puts a command number that the dialect has no name for into the frame of a COMMAND_ACK.
fn with_command(mut frame: Vec<u8>, command: u16) -> Vec<u8> {
    frame[HEADER..HEADER + 2].copy_from_slice(&command.to_le_bytes());
    let end = frame.len() - 2;
    let sum = calculate_crc(&frame[1..end], COMMAND_ACK_DATA::EXTRA_CRC);
    frame[end..].copy_from_slice(&sum.to_le_bytes());
    frame
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::autopilot::Params;
    use crate::plant::{Airframe, Plant};
    use fleet_core::types::Vec3;
    use mavlink::dialects::common::MavCmd;

    #[test]
    fn a_command_without_a_name_is_answered_unsupported() {
        let plant = Plant::new(Airframe::F450, Vec3::zeros(), 0.0);
        let mut autopilot = Autopilot::new(7, plant.truth(), Params::new(7), 0);
        let named = COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_DO_SET_MODE,
            target_system: 7,
            target_component: 1,
            ..COMMAND_LONG_DATA::DEFAULT
        };
        let mut raw = MAVLinkV2MessageRaw::new();
        let from = MavHeader { system_id: 245, component_id: 190, sequence: 0 };
        raw.serialize_message(from, &MavMessage::COMMAND_LONG(named));
        let mut bytes = raw.raw_bytes().to_vec();
        bytes[HEADER + COMMAND_AT..HEADER + COMMAND_AT + 2].copy_from_slice(&60_000_u16.to_le_bytes());
        let end = bytes.len() - 2;
        let sum = calculate_crc(&bytes[1..end], COMMAND_LONG_DATA::EXTRA_CRC);
        bytes[end..].copy_from_slice(&sum.to_le_bytes());

        deliver(&mut autopilot, Nanos(0), LinkId(0), &bytes);
        let outgoing = autopilot.take_outgoing();
        assert_eq!(outgoing.len(), 1);
        let answer = Encoder::new(7).encode(&outgoing[0]);
        let found = frames(&answer);
        assert_eq!(found.len(), 1, "the checksum fits");
        assert_eq!(found[0].id, COMMAND_ACK_DATA::ID);
        assert_eq!(found[0].payload[..3], [0x60, 0xea, 3]);
        assert_eq!(found[0].payload[8..10], [245, 190]);
    }
}
