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
    stuffed.put(stuffed.crc().into(), 15);
    stuffed.bits + stuffed.stuff_bits() + TAIL_BITS + INTERMISSION_BITS
}

/// The polynomial of the CRC, without its highest power.
const POLYNOMIAL: u16 = 0x4599;

/// What eight bits at the head of the register make of the rest of it.
const CRC: [u16; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < table.len() {
        let mut crc = (byte as u16) << 7;
        let mut bit = 0;
        while bit < 8 {
            let feedback = if crc >> 14 & 1 == 1 { POLYNOMIAL } else { 0 };
            crc = crc << 1 & 0x7FFF ^ feedback;
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
};

/// How far a run of equal bits has come on the wire.
#[derive(Clone, Copy)]
struct Run {
    bit: bool,
    /// 1 to 4; a fifth is followed by a stuff bit, with which the next run begins.
    length: u8,
}

impl Run {
    /// Runs that can be told apart.
    const KINDS: usize = 8;

    const fn number(self) -> u8 {
        self.length - 1 + if self.bit { 4 } else { 0 }
    }

    const fn of(number: u8) -> Self {
        Self {
            bit: number >= 4,
            length: number % 4 + 1,
        }
    }

    /// The run that the next bit leaves, and whether a stuff bit follows it.
    const fn then(self, bit: bool) -> (Self, bool) {
        let length = if bit == self.bit { self.length + 1 } else { 1 };
        if length == 5 {
            (
                Self {
                    bit: !bit,
                    length: 1,
                },
                true,
            )
        } else {
            (Self { bit, length }, false)
        }
    }
}

/// What a byte makes of a run: the run behind it, by its number, and how many stuff bits the byte takes.
const STUFFING: [[(u8, u8); 256]; Run::KINDS] = {
    let mut table = [[(0, 0); 256]; Run::KINDS];
    let mut number = 0;
    while number < Run::KINDS {
        let mut byte = 0;
        while byte < 256 {
            let (mut run, mut stuffed) = (Run::of(number as u8), 0);
            let mut shift = 8;
            while shift > 0 {
                shift -= 1;
                let (next, stuff) = run.then(byte >> shift & 1 == 1);
                run = next;
                stuffed += stuff as u8;
            }
            table[number][byte] = (run.number(), stuffed);
            byte += 1;
        }
        number += 1;
    }
    table
};

/// The part of a frame that is stuffed and covered by the CRC: 118 bits at most, the last one lowest.
#[derive(Default)]
struct Stuffed {
    word: u128,
    bits: u32,
}

impl Stuffed {
    fn put(&mut self, value: u64, width: u32) {
        self.word = self.word << width | u128::from(value);
        self.bits += width;
    }

    /// Of all bits so far. The register begins with 0, so that the zeros before the first bit do nothing.
    fn crc(&self) -> u16 {
        let bytes = self.word.to_be_bytes();
        let zeros = self.word.leading_zeros() as usize / 8;
        bytes[zeros..].iter().fold(0, |crc, byte| {
            crc << 8 & 0x7FFF ^ CRC[usize::from((crc >> 7) as u8 ^ byte)]
        })
    }

    /// Five bits of a kind are followed by one of the other, which counts as the first of what comes next.
    fn stuff_bits(&self) -> u32 {
        // Bits that take turns before the first, the last of them the other one, stuff nothing and leave no run.
        let first = self.word >> (self.bits - 1) & 1 == 1;
        let turns = (u128::MAX / 3) << u32::from(first);
        let bytes = (self.word | turns.unbounded_shl(self.bits)).to_be_bytes();
        let (before, bytes) = bytes.split_at((u128::BITS - self.bits) as usize / 8);
        let bit = before.last().is_some_and(|byte| byte & 1 == 1);
        let mut run = Run { bit, length: 1 }.number();
        let mut stuffed = 0;
        for &byte in bytes {
            let (then, more) = STUFFING[usize::from(run)][usize::from(byte)];
            run = then;
            stuffed += u32::from(more);
        }
        stuffed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::collection::vec;
    use proptest::prelude::*;
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

    /// The bits of the stuffed part one by one, stuff bits among them.
    fn sent(stuffed: &Stuffed) -> Vec<bool> {
        let bits = (0..stuffed.bits).rev();
        let mut sent: Vec<bool> = Vec::new();
        for bit in bits.map(|shift| stuffed.word >> shift & 1 == 1) {
            sent.push(bit);
            if sent.len() >= 5 && sent[sent.len() - 5..].iter().all(|&b| b == bit) {
                sent.push(!bit);
            }
        }
        sent
    }

    fn stuffed(parts: &[(u64, u32)]) -> Stuffed {
        let mut stuffed = Stuffed::default();
        for &(value, width) in parts {
            stuffed.put(value & ((1 << width) - 1), width);
        }
        stuffed
    }

    /// The CRC by its definition: the remainder of the bits, a bit at a time.
    fn remainder(stuffed: &Stuffed) -> u16 {
        (0..stuffed.bits).rev().fold(0, |crc, shift| {
            let bit = (stuffed.word >> shift & 1) as u16;
            let feedback = (crc >> 14 & 1 ^ bit) * POLYNOMIAL;
            crc << 1 & 0x7FFF ^ feedback
        })
    }

    proptest! {
        /// Words of long runs, as zeros and ones on the wire are, and of any bits.
        #[test]
        fn crc_and_stuff_bits_are_those_of_single_bits(
            runs in vec((any::<bool>(), 1..20_u32), 1..10),
            values in vec((any::<u64>(), 1..30_u32), 1..4),
        ) {
            let runs: Vec<_> = (runs.iter()).map(|&(on, width)| (if on { u64::MAX } else { 0 }, width)).collect();
            for parts in [&runs[..], &values[..]] {
                let stuffed = stuffed(&parts[..parts.len().min(5)]);
                prop_assert_eq!(stuffed.crc(), remainder(&stuffed));
                let sent = sent(&stuffed).len() as u32;
                prop_assert_eq!(stuffed.bits + stuffed.stuff_bits(), sent);
            }
        }
    }

    /// A SYNC: SOF and 0001 0000000 000 0000 and the CRC of that; counted by hand.
    #[test]
    fn sync_length_by_hand() {
        // 0 00010000000 000 0000 | CRC. Data bits 19: runs of zeros 0 000 1 → 4, then 14 zeros.
        let mut sync = stuffed(&[(0x080 << 7, 19)]);
        sync.put(remainder(&sync).into(), 15);
        let expected = sent(&sync).len() as u32 + TAIL_BITS + INTERMISSION_BITS;
        assert_eq!(frame_bits(&Frame::new(CobId::SYNC, &[])), expected);
    }
}
