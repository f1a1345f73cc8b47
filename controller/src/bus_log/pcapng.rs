//! The pcapng format, with frames as SocketCAN has them (link type 227).

use std::io::{self, Write};
use std::time::Duration;
use syncline_canopen::{CanId, Frame};

/// LINKTYPE_CAN_SOCKETCAN.
const LINK_TYPE: u16 = 227;
/// Of an identifier with 29 bits.
const EXTENDED: u32 = 1 << 31;
/// Of a remote request.
const REMOTE: u32 = 1 << 30;

/// Begins a file: its head and the buses that the frames come from.
///
/// # Errors
/// It cannot be written.
pub fn begin(file: &mut impl Write, buses: &[impl AsRef<str>]) -> io::Result<()> {
    let mut section = Vec::new();
    section.extend(0x1A2B_3C4Du32.to_le_bytes()); // byte order
    section.extend(1u16.to_le_bytes()); // version 1.0
    section.extend(0u16.to_le_bytes());
    section.extend(u64::MAX.to_le_bytes()); // length of the section is not known
    block(file, 0x0A0D_0D0A, &section)?;
    for bus in buses {
        let mut interface = Vec::new();
        interface.extend(LINK_TYPE.to_le_bytes());
        interface.extend(0u16.to_le_bytes());
        interface.extend(0u32.to_le_bytes()); // no limit to a frame's length
        option(&mut interface, 2, bus.as_ref().as_bytes()); // if_name
        option(&mut interface, 9, &[9]); // if_tsresol: nanoseconds
        option(&mut interface, 0, &[]);
        block(file, 1, &interface)?;
    }
    Ok(())
}

/// Appends a frame of the bus with index `bus`; `at` counts from 1970.
///
/// # Errors
/// It cannot be written.
pub fn append(file: &mut impl Write, bus: usize, at: Duration, frame: &Frame) -> io::Result<()> {
    let mut packet = Vec::with_capacity(48);
    let nanos = at.as_nanos() as u64;
    packet.extend((bus as u32).to_le_bytes());
    packet.extend(((nanos >> 32) as u32).to_le_bytes());
    packet.extend((nanos as u32).to_le_bytes());
    let data = frame.data();
    let length = 8 + data.len() as u32;
    packet.extend(length.to_le_bytes()); // captured
    packet.extend(length.to_le_bytes()); // on the wire
    let flags = match frame.id() {
        CanId::Standard(_) => 0,
        CanId::Extended(_) => EXTENDED,
    };
    let remote = if frame.is_remote() { REMOTE } else { 0 };
    packet.extend((frame.id().raw() | flags | remote).to_be_bytes());
    packet.extend([frame.dlc(), 0, 0, 0]);
    packet.extend(data);
    pad(&mut packet);
    block(file, 6, &packet)
}

fn block(file: &mut impl Write, kind: u32, body: &[u8]) -> io::Result<()> {
    let length = (body.len() as u32 + 12).to_le_bytes();
    let kind = kind.to_le_bytes();
    file.write_all(&[&kind, &length, body, &length].concat())
}

fn option(body: &mut Vec<u8>, code: u16, value: &[u8]) {
    body.extend(code.to_le_bytes());
    body.extend((value.len() as u16).to_le_bytes());
    body.extend(value);
    pad(body);
}

/// Everything is aligned to 4 bytes.
fn pad(body: &mut Vec<u8>) {
    body.resize(body.len().next_multiple_of(4), 0);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Section header, interface description and one enhanced packet, byte by byte.
    #[test]
    fn a_file_with_one_frame() {
        let mut file = Vec::new();
        begin(&mut file, &["can0"]).unwrap();
        let head = file.len();
        let frame = Frame::new(CanId::Standard(0x181), &[0x37, 0x42]);
        append(&mut file, 0, Duration::new(1, 5), &frame).unwrap();
        assert_eq!(file[..4], [0x0A, 0x0D, 0x0D, 0x0A]);
        assert_eq!(file[8..12], [0x4D, 0x3C, 0x2B, 0x1A]);
        assert_eq!(file[28..40], [1, 0, 0, 0, 40, 0, 0, 0, 227, 0, 0, 0]);
        #[rustfmt::skip]
        assert_eq!(file[head..], [
            6, 0, 0, 0, 44, 0, 0, 0, 0, 0, 0, 0,
            0, 0, 0, 0, 0x05, 0xCA, 0x9A, 0x3B, // 1 000 000 005 ns
            10, 0, 0, 0, 10, 0, 0, 0,
            0, 0, 0x01, 0x81, 2, 0, 0, 0, 0x37, 0x42, 0, 0,
            44, 0, 0, 0,
        ]);
        let extended = Frame::remote(CanId::Extended(0x1234_5678), 3).unwrap();
        let mut packet = Vec::new();
        append(&mut packet, 0, Duration::ZERO, &extended).unwrap();
        assert_eq!(packet[28..36], [0xD2, 0x34, 0x56, 0x78, 3, 0, 0, 0]);
    }
}
