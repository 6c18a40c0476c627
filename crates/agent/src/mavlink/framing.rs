//! Finds whole, uncorrupted MAVLink frames in a datagram.
//!
//! Framing after mavlink.io, "Packet serialization": start byte, length, flags, header, payload,
//! CRC-16 with the message's extra byte, optional signature.

use mavlink::dialects::common::MavMessage;
use mavlink::{MAV_STX, MAV_STX_V2, MavHeader, MavlinkVersion, Message, calculate_crc};

const V1_HEADER: usize = 6;
const V2_HEADER: usize = 10;
const CHECKSUM: usize = 2;
const SIGNATURE: usize = 13;
/// The only incompatibility flag that is understood here: the frame carries a signature.
const SIGNED: u8 = 0x01;

/// One frame with a valid checksum; its payload is not parsed yet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame<'a> {
    /// Sender and sequence number.
    pub header: MavHeader,
    /// Message id.
    pub id: u32,
    /// MAVLink 1 or 2.
    pub version: MavlinkVersion,
    /// Payload as sent: in MAVLink 2 without its trailing zeros.
    pub payload: &'a [u8],
}

impl Frame<'_> {
    /// The message, when the dialect knows it and every enumeration in it has a known value.
    #[must_use]
    pub fn parse(&self) -> Option<MavMessage> {
        MavMessage::parse(self.version, self.id, self.payload).ok()
    }
}

/// All valid frames in `datagram`, in order. Bytes that belong to no valid frame are skipped one
/// at a time, so that a frame after garbage is found.
#[must_use]
pub fn frames(datagram: &[u8]) -> Vec<Frame<'_>> {
    let mut found = Vec::new();
    let mut rest = datagram;
    while !rest.is_empty() {
        match take_frame(rest) {
            Some((frame, length)) => {
                found.push(frame);
                rest = rest.get(length..).unwrap_or_default();
            }
            None => rest = rest.get(1..).unwrap_or_default(),
        }
    }
    found
}

fn take_frame(bytes: &[u8]) -> Option<(Frame<'_>, usize)> {
    match *bytes.first()? {
        MAV_STX => {
            let header = bytes.get(..V1_HEADER)?;
            let mav =
                MavHeader { system_id: u32::from(header[3]), component_id: header[4], sequence: header[2] };
            let payload = checked_payload(bytes, V1_HEADER, u32::from(header[5]))?;
            let id = u32::from(header[5]);
            let frame = Frame { header: mav, id, version: MavlinkVersion::V1, payload };
            Some((frame, V1_HEADER + payload.len() + CHECKSUM))
        }
        MAV_STX_V2 => {
            let header = bytes.get(..V2_HEADER)?;
            let flags = header[2];
            if flags & !SIGNED != 0 {
                return None;
            }
            let mav =
                MavHeader { system_id: u32::from(header[5]), component_id: header[6], sequence: header[4] };
            let id = u32::from_le_bytes([header[7], header[8], header[9], 0]);
            let payload = checked_payload(bytes, V2_HEADER, id)?;
            let length =
                V2_HEADER + payload.len() + CHECKSUM + if flags & SIGNED == 0 { 0 } else { SIGNATURE };
            let frame = Frame { header: mav, id, version: MavlinkVersion::V2, payload };
            (length <= bytes.len()).then_some((frame, length))
        }
        _ => None,
    }
}

fn checked_payload(bytes: &[u8], header: usize, id: u32) -> Option<&[u8]> {
    let end = header + usize::from(*bytes.get(1)?);
    let checksum = bytes.get(end..end + CHECKSUM)?;
    let sum = calculate_crc(bytes.get(1..end)?, MavMessage::extra_crc(id));
    (checksum == sum.to_le_bytes()).then(|| &bytes[header..end])
}

#[cfg(test)]
mod tests {
    use super::*;
    use mavlink::MAVLinkV2MessageRaw;
    use mavlink::dialects::common::{EXTENDED_SYS_STATE_DATA, MavLandedState};
    use proptest::prelude::*;

    fn landed_frame(sequence: u8) -> Vec<u8> {
        let message = MavMessage::EXTENDED_SYS_STATE(EXTENDED_SYS_STATE_DATA {
            landed_state: MavLandedState::MAV_LANDED_STATE_ON_GROUND,
            ..Default::default()
        });
        let mut raw = MAVLinkV2MessageRaw::new();
        raw.serialize_message(MavHeader { system_id: 7, component_id: 1, sequence }, &message);
        raw.raw_bytes().to_vec()
    }

    proptest! {
        /// Junk before, between and after whole frames never hides them.
        #[test]
        fn frames_survive_surrounding_junk(
            junk in proptest::collection::vec(
                proptest::collection::vec(any::<u8>().prop_filter("no start byte", |b| *b < 0xf0), 0..40), 4)
        ) {
            let mut datagram = junk[0].clone();
            for sequence in 0..3_u8 {
                datagram.extend(landed_frame(sequence));
                datagram.extend(&junk[usize::from(sequence) + 1]);
            }
            let found: Vec<u8> = frames(&datagram).iter().map(|f| f.header.sequence).collect();
            prop_assert_eq!(found, vec![0, 1, 2]);
        }

        #[test]
        fn random_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..600)) {
            for frame in frames(&bytes) {
                let _ = frame.parse();
            }
        }

        /// One flipped bit anywhere makes a frame invalid.
        #[test]
        fn a_flipped_bit_is_noticed(at in 0_usize..14, bit in 0_u8..8) {
            let mut bytes = landed_frame(3);
            prop_assert_eq!(bytes.len(), 14);
            bytes[at] ^= 1 << bit;
            prop_assert!(frames(&bytes).is_empty());
        }

        #[test]
        fn a_cut_frame_is_not_a_frame(length in 0_usize..14) {
            prop_assert!(frames(&landed_frame(3)[..length]).is_empty());
        }
    }

    #[test]
    fn unknown_incompatibility_flags_are_refused() {
        let mut bytes = landed_frame(0);
        bytes[2] = 0x02;
        assert!(frames(&bytes).is_empty());
    }
}
