//! PDO: parameters and mappings written at will, PDOs, SYNCs, remote requests and time.
#![no_main]

use libfuzzer_sys::fuzz_target;
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, Frame};
use syncline_fuzz::Victim;

const INDICES: [u16; 10] = [
    0x1005, 0x1006, 0x1019, 0x1400, 0x1401, 0x1600, 0x1601, 0x1800, 0x1A00, 0x1A01,
];
const MAPPABLE: [u32; 8] = [
    0x6040_0010,
    0x6200_0008,
    0x6201_0040,
    0x6202_0040,
    0x6203_0008,
    0x6203_0001,
    0x0005_0008,
    0x0001_0001,
];

fuzz_target!(|input: (bool, Vec<(u8, u8, [u8; 8])>)| {
    let (lenient, steps) = input;
    let mut victim = Victim::new(lenient);
    victim.receive(&Frame::new(CanId::Standard(0), &[1, 0]));
    for (kind, choice, bytes) in steps {
        let length = usize::from(choice) % 9;
        match kind % 8 {
            0 | 1 => {
                let index = INDICES[usize::from(choice) % INDICES.len()];
                let [low, high] = index.to_le_bytes();
                let mut data = [bytes[4], bytes[5], bytes[6], bytes[7]];
                if kind % 8 == 1 {
                    data = MAPPABLE[usize::from(bytes[4]) % MAPPABLE.len()].to_le_bytes();
                }
                let size = match (index, bytes[0] % 7) {
                    (0x1019, _) | (0x1600..=0x1601 | 0x1A00..=0x1A01, 0) | (_, 2 | 6) => 1,
                    (_, 3 | 5) => 2,
                    _ => 4,
                };
                let command = 0x23 | (4 - size) << 2;
                let request = [
                    command,
                    low,
                    high,
                    bytes[0] % 7,
                    data[0],
                    data[1],
                    data[2],
                    data[3],
                ];
                victim.receive(&Frame::new(CanId::Standard(0x601), &request));
            }
            2 => victim.receive(&Frame::new(CanId::Standard(0x201), &bytes[..length])),
            3 => victim.receive(&Frame::new(CanId::Standard(0x301), &bytes[..length])),
            4 => victim.receive(&Frame::new(CanId::Standard(0x080), &bytes[..length % 2])),
            5 => {
                let id = CanId::Standard(if choice & 1 == 0 { 0x181 } else { 0x281 });
                if let Some(request) = Frame::remote(id, 8) {
                    victim.receive(&request);
                }
            }
            6 => victim.pass(Duration::from_micros(
                u64::from(choice) * u64::from(bytes[0]),
            )),
            _ => {
                let row = [0x6040u16, 0x6201, 0x6203][usize::from(choice) % 3];
                victim.objects.put(row, 0, i64::from_le_bytes(bytes));
                victim.pass(Duration::ZERO);
            }
        }
    }
});
