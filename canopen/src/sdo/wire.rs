//! The bytes of SDO messages (CiA 301): command byte, multiplexer, data.

use super::{AbortCode, crc::crc};
use crate::dictionary::Address;

/// Every SDO message has 8 bytes.
pub(super) type Message = [u8; 8];

pub(super) const ABORT: u8 = 0x80;

/// Blocks in a row of which nothing may arrive. Where one segment in two is lost, that happens to one
/// transfer in 2³².
const MOST_FUTILE: u8 = 32;

/// The object that an initiate message or an abort names.
pub(super) fn address(message: &Message) -> Address {
    Address::new(u16::from_le_bytes([message[1], message[2]]), message[3])
}

/// Bytes 4…7 as a number.
pub(super) fn word(message: &Message) -> u32 {
    u32::from_le_bytes([message[4], message[5], message[6], message[7]])
}

/// A message that names an object and carries up to 4 bytes.
pub(super) fn message(command: u8, address: Address, data: &[u8]) -> Message {
    let [low, high] = address.index.to_le_bytes();
    let mut message = [command, low, high, address.sub, 0, 0, 0, 0];
    message[4..4 + data.len()].copy_from_slice(data);
    message
}

pub(super) fn abort(address: Address, code: AbortCode) -> Message {
    message(ABORT, address, &code.code().to_le_bytes())
}

/// An initiate message with data in it (download request 2xh, upload response 4xh).
pub(super) fn expedited(command: u8, address: Address, data: &[u8]) -> Message {
    message(
        command | ((4 - data.len()) as u8) << 2 | 0x03,
        address,
        data,
    )
}

/// A segment of at most 7 bytes: toggle bit, number of unused bytes, last or not.
pub(super) fn segment(toggle: bool, data: &[u8], last: bool) -> Message {
    let mut message = [0; 8];
    message[0] = u8::from(toggle) << 4 | ((7 - data.len()) as u8) << 1 | u8::from(last);
    message[1..=data.len()].copy_from_slice(data);
    message
}

/// The data bytes of a segment.
pub(super) fn segment_data(message: &Message) -> &[u8] {
    &message[1..8 - usize::from(message[0] >> 1 & 7)]
}

/// The block of at most `block_size` segments that follows the first `confirmed` of an object:
/// each with its number 1…127 and whether it is the last of the whole transfer.
pub(super) fn block(
    object: &[u8],
    confirmed: usize,
    block_size: u8,
) -> impl ExactSizeIterator<Item = Message> {
    let total = segments(object.len());
    let count = (total - confirmed).min(usize::from(block_size)) as u8;
    (1..=count).map(move |number| {
        let end = confirmed + usize::from(number);
        let data = &object[(end - 1) * 7..(end * 7).min(object.len())];
        let mut message = [0; 8];
        message[0] = number | u8::from(end == total) << 7;
        message[1..=data.len()].copy_from_slice(data);
        message
    })
}

/// The end of a block transfer: the last segment's unused bytes, and the CRC if wanted.
pub(super) fn end_of_blocks(object: &[u8], with_crc: bool) -> Message {
    let unused = (segments(object.len()) * 7 - object.len()) as u8;
    let crc = if with_crc { crc(object) } else { 0 };
    let [low, high] = crc.to_le_bytes();
    [0xC1 | unused << 2, low, high, 0, 0, 0, 0, 0]
}

/// The toggle bit of a segment or of its request or acknowledgement.
pub(super) fn toggle(message: &Message) -> bool {
    message[0] & 0x10 != 0
}

/// How many segments of 7 bytes an object takes: at least one.
pub(super) fn segments(size: usize) -> usize {
    size.div_ceil(7).max(1)
}

/// What is to be known of the segment that ended a block, lest it be taken for another one if it comes
/// again: CAN brings a frame twice whose sender saw its last bit fail. A block of which nothing arrived
/// will come again itself.
pub(super) fn end_of_block(segment: &Message, acknowledged: u8) -> Message {
    match acknowledged {
        0 => Message::default(),
        _ => *segment,
    }
}

/// Blocks in a row of which nothing arrived, one more of which `acknowledged` segments have.
pub(super) fn futile(blocks: u8, acknowledged: usize) -> Result<u8, AbortCode> {
    match acknowledged {
        0 if blocks >= MOST_FUTILE => Err(AbortCode::SequenceNumber),
        0 => Ok(blocks + 1),
        _ => Ok(0),
    }
}

/// Whether a number of segments per block is permitted.
pub(super) fn is_block_size(size: u8) -> bool {
    (1..=127).contains(&size)
}
