//! Bits on the wire (ISO 11898-1).

use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, Frame};

/// Recessive bits between two frames.
pub(super) const INTERMISSION_BITS: u32 = 3;

/// Bits after the stuffed part: CRC delimiter, ACK slot and delimiter, end of frame.
const TAIL_BITS: u32 = 1 + 2 + 7;

/// A bit rate of classical CAN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitRate {
    kbit: u32,
}

impl BitRate {
    /// A rate in kbit/s whose bit time is a whole number of nanoseconds, or `None`.
    #[must_use]
    pub const fn from_kbit(kbit: u32) -> Option<Self> {
        if kbit > 0 && 1_000_000 % kbit == 0 {
            Some(Self { kbit })
        } else {
            None
        }
    }

    /// The rate in kbit/s.
    #[must_use]
    pub const fn kbit(self) -> u32 {
        self.kbit
    }

    /// The time that `bits` bits take.
    #[must_use]
    pub const fn time(self, bits: u32) -> Duration {
        Duration::from_nanos(bits as u64 * (1_000_000 / self.kbit) as u64)
    }
}

/// Bits of a frame from its first through the intermission, with its actual stuff bits.
#[must_use]
pub fn frame_bits(frame: &Frame) -> u32 {
    let mut stuffed = Stuffed::default();
    let remote = u64::from(frame.is_remote());
    stuffed.put(0, 1); // start of frame
    match frame.id() {
        CanId::Standard(id) => {
            stuffed.put(id.into(), 11);
            stuffed.put(remote << 2, 3); // RTR, IDE, r0
        }
        CanId::Extended(id) => {
            stuffed.put(u64::from(id >> 18), 11);
            stuffed.put(0b11, 2); // SRR, IDE
            stuffed.put(u64::from(id & 0x3_FFFF), 18);
            stuffed.put(remote << 2, 3); // RTR, r1, r0
        }
    }
    stuffed.put(frame.dlc().into(), 4);
    for &byte in frame.data() {
        stuffed.put(byte.into(), 8);
    }
    stuffed.put(stuffed.crc.into(), 15);
    stuffed.bits + TAIL_BITS + INTERMISSION_BITS
}

/// The part of a frame that is stuffed and covered by the CRC.
#[derive(Default)]
struct Stuffed {
    bits: u32,
    crc: u16,
    last: Option<bool>,
    run: u32,
}

impl Stuffed {
    fn put(&mut self, value: u64, width: u32) {
        for shift in (0..width).rev() {
            let bit = value >> shift & 1 == 1;
            self.bits += 1;
            let next = bit != (self.crc >> 14 & 1 == 1);
            self.crc = self.crc << 1 & 0x7FFF;
            if next {
                self.crc ^= 0x4599;
            }
            self.run = if self.last == Some(bit) {
                self.run + 1
            } else {
                1
            };
            self.last = Some(bit);
            if self.run == 5 {
                self.bits += 1;
                self.last = Some(!bit);
                self.run = 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syncline_canopen::CobId;

    #[test]
    fn length_lies_between_no_stuffing_and_the_worst_case() {
        for dlc in 0..=8u32 {
            for fill in [0x00, 0xFF, 0x55, 0x0F, 0xA7] {
                let data = [fill; 8];
                for id in [0x000, 0x080, 0x181, 0x555, 0x7FF] {
                    let id = CobId::new(id).unwrap();
                    let bits = frame_bits(&Frame::new(id, &data[..dlc as usize]));
                    assert!((47 + 8 * dlc..=55 + 10 * dlc).contains(&bits));
                }
            }
        }
    }

    /// A SYNC: SOF and 0001 0000000 000 0000 and the CRC of that; counted by hand.
    #[test]
    fn sync_length_by_hand() {
        // 0 00010000000 000 0000 | CRC. Data bits 19: runs of zeros 0 000 1 → 4, then 14 zeros.
        let crc = {
            let mut stuffed = Stuffed::default();
            stuffed.put(0x080 << 7, 19);
            stuffed.crc
        };
        let bits: Vec<bool> = (0..19)
            .rev()
            .map(|shift| (0x080u32 << 7) >> shift & 1 == 1)
            .chain((0..15).rev().map(|shift| crc >> shift & 1 == 1))
            .collect();
        let mut sent = vec![];
        for bit in bits {
            sent.push(bit);
            if sent.len() >= 5 && sent[sent.len() - 5..].iter().all(|&b| b == bit) {
                sent.push(!bit);
            }
        }
        let expected = sent.len() as u32 + TAIL_BITS + INTERMISSION_BITS;
        assert_eq!(frame_bits(&Frame::new(CobId::SYNC, &[])), expected);
    }
}
