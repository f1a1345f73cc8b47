//! LXM32Ms on the bench.

use super::id;
use syncline_drives::twin::lxm32m::{Twin, TwinConfig};

pub(crate) type Bench = super::Bench<Twin>;

impl Bench {
    /// Twins with these configurations at 1 Mbit/s, booted.
    pub(crate) fn new(configs: impl IntoIterator<Item = TwinConfig>) -> Self {
        Self::of(configs.into_iter().map(Twin::new))
    }

    pub(crate) fn one() -> Self {
        Self::new([TwinConfig::new(id(1))])
    }
}

/// A drive in Operation Enabled, in this mode.
pub(crate) fn enabled(config: TwinConfig, mode: i8) -> Bench {
    let mut bench = Bench::new([config]);
    for word in [0x0006, 0x000F] {
        bench.controlword(1, word);
    }
    bench.write(1, 0x6060, 0, &[mode as u8]).unwrap();
    assert_eq!(bench.read(1, 0x6061, 0).unwrap(), [mode as u8]);
    bench
}

/// The same with all defaults.
pub(crate) fn drive(mode: i8) -> Bench {
    enabled(TwinConfig::new(id(1)), mode)
}

/// I-01…I-30 of the manual's set-up for Interpolated Position (lxm32m 1604-1636) for a node and
/// a period in milliseconds: index, subindex, bytes.
pub(crate) fn interpolation_setup(node: u8, period: u8) -> Vec<(u16, u8, Vec<u8>)> {
    let cob = |word: u32| (word + u32::from(node)).to_le_bytes().to_vec();
    let u8 = |value: u8| vec![value];
    let u16 = |value: u16| value.to_le_bytes().to_vec();
    let u32 = |value: u32| value.to_le_bytes().to_vec();
    vec![
        (0x1400, 1, cob(0x8000_0200)),
        (0x1800, 1, cob(0x8000_0180)),
        (0x1401, 1, cob(0x0000_0300)),
        (0x1801, 1, cob(0x0000_0280)),
        (0x1402, 1, cob(0x8000_0400)),
        (0x1802, 1, cob(0x8000_0380)),
        (0x1403, 1, cob(0x8000_0500)),
        (0x1803, 1, cob(0x8000_0480)),
        (0x1401, 2, u8(1)),
        (0x1801, 2, u8(1)),
        (0x6040, 0, u16(0)),
        (0x6040, 0, u16(0x80)),
        (0x1601, 0, u8(0)),
        (0x1601, 1, u32(0x6040_0010)),
        (0x1601, 2, u32(0x60C1_0120)),
        (0x1601, 0, u8(2)),
        (0x1A01, 0, u8(0)),
        (0x1A01, 1, u32(0x6041_0010)),
        (0x1A01, 2, u32(0x6064_0020)),
        (0x1A01, 0, u8(2)),
        (0x3006, 0x07, u32(0x2_0000)),
        (0x3006, 0x08, u32(1)),
        (0x6060, 0, u8(7)),
        (0x3006, 0x3D, u16(1)),
        (0x60C2, 1, u8(period)),
        (0x3012, 0x06, u16(1000)),
        (0x3013, 0x06, u16(1000)),
        (0x3006, 0x06, u16(1)),
        (0x3022, 0x04, u16(1)),
        (0x3022, 0x05, u16(2)),
    ]
}
