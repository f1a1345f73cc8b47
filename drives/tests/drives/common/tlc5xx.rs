//! A TLC53x on the bench.

use super::{Bench, TARGET_REACHED, id, ms, status};
use syncline_canopen::cia402::State;
use syncline_drives::twin::node::Processor;
use syncline_drives::twin::tlc5xx::{Policies, Switches, Twin, TwinConfig};

pub(crate) const INVALID: u32 = 0x0609_0030;
pub(crate) const TOO_HIGH: u32 = 0x0609_0031;
pub(crate) const MAXIMUM_BELOW_MINIMUM: u32 = 0x0609_0036;
pub(crate) const LOCAL_CONTROL: u32 = 0x0800_0021;
pub(crate) const DEVICE_STATE: u32 = 0x0800_0022;
pub(crate) const INCOMPATIBLE: u32 = 0x0604_0043;

pub(crate) const ACKNOWLEDGED: u16 = 1 << 12;
pub(crate) const BIT_13: u16 = 1 << 13;
pub(crate) const ENDED: u32 = 1 << 14;
pub(crate) const FAILED: u32 = 1 << 15;

pub(crate) fn config() -> TwinConfig {
    TwinConfig {
        processor: Processor::prompt(id(1)),
        ..TwinConfig::new(id(1))
    }
}

pub(crate) fn of(config: TwinConfig) -> Bench<Twin> {
    Bench::of([Twin::new(config).unwrap()])
}

pub(crate) fn with(policies: Policies) -> Bench<Twin> {
    of(TwinConfig {
        policies,
        ..config()
    })
}

pub(crate) fn set(bench: &mut Bench<Twin>, index: u16, sub: u8, value: i32) -> Result<(), u32> {
    let entry = syncline_drives::dictionary::TLC5XX
        .iter()
        .find(|entry| (entry.address.index, entry.address.sub) == (index, sub))
        .unwrap();
    let bytes = value.to_le_bytes();
    bench.write(1, index, sub, &bytes[..entry.data_type.size()])
}

/// In Operation Enabled with this mode, at position 0, quick ramps.
pub(crate) fn enabled(bench: &mut Bench<Twin>, mode: i8) {
    for word in [0x0006, 0x000F] {
        bench.controlword(1, word);
    }
    assert_eq!(bench.twin().state(), State::OperationEnabled);
    for index in [0x6083, 0x6084, 0x6085, 0x205E, 0x205F] {
        set(bench, index, 0, 6000).unwrap();
    }
    // The position becomes 0: absolute targets need a reference point.
    bench.write(1, 0x6060, 0, &[6]).unwrap();
    set(bench, 0x6098, 0, 35).unwrap();
    bench.controlword(1, 0x1F);
    bench.controlword(1, 0x0F);
    set(bench, 0x6098, 0, 18).unwrap();
    bench.write(1, 0x6060, 0, &[mode as u8]).unwrap();
    bench.wait(ms(2));
    assert_eq!(bench.read(1, 0x6061, 0).unwrap(), [mode as u8]);
}

pub(crate) fn drive(mode: i8) -> Bench<Twin> {
    let mut bench = of(config());
    enabled(&mut bench, mode);
    bench
}

/// Waits until a condition holds, at most some seconds.
pub(crate) fn until(
    bench: &mut Bench<Twin>,
    seconds: u64,
    what: &str,
    holds: impl Fn(&mut Bench<Twin>) -> bool,
) {
    for _ in 0..seconds * 200 {
        if holds(bench) {
            return;
        }
        bench.wait(ms(5));
    }
    panic!(
        "not within {seconds} s: {what}; statusword {:04X}",
        status(bench)
    );
}

pub(crate) fn reach(bench: &mut Bench<Twin>) {
    until(bench, 20, "target reached", |bench| {
        status(bench) & TARGET_REACHED != 0
    });
}

pub(crate) fn position(bench: &mut Bench<Twin>) -> i32 {
    bench.read_i32(1, 0x6064, 0)
}

/// Whether a position is that, to some increments.
pub(crate) fn is_at(bench: &mut Bench<Twin>, expected: i32) -> bool {
    (position(bench) - expected).abs() <= 10
}

/// One of each along the axis.
pub(crate) fn switches() -> Switches {
    Switches {
        negative_limit: Some(-2.25),
        positive_limit: Some(2.25),
        reference: Some(0.75..1.25),
    }
}
