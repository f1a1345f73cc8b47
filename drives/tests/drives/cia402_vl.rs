//! The drive by the profile alone in velocity mode: what its words, limits and ramps do.

use crate::common::{Bench, id, ms};
use syncline_canopen::{CobId, nmt};
use syncline_drives::twin::cia402_csp::{Twin, TwinConfig};
use syncline_drives::twin::{Disturbance, ErrorClass, SimulatedDevice};

const NODE: u8 = 1;

/// In its mode, controlword and 6042h in R_PDO1 at SYNC, to 3000 1/min in 1 s, Operational and enabled.
fn enabled() -> Bench<Twin> {
    let mut bench = Bench::of([Twin::new(TwinConfig {
        mode: 2,
        ..TwinConfig::new(id(NODE))
    })]);
    let writes: [(u16, u8, &[u8]); 14] = [
        (0x6060, 0, &[2]),
        (0x6046, 2, &3000u32.to_le_bytes()),
        (0x6048, 1, &6000u32.to_le_bytes()),
        (0x6048, 2, &2u16.to_le_bytes()),
        (0x6049, 1, &3000u32.to_le_bytes()),
        (0x6049, 2, &2u16.to_le_bytes()),
        (0x1400, 1, &0x8000_0201u32.to_le_bytes()),
        (0x1600, 0, &[0]),
        (0x1600, 1, &0x6040_0010u32.to_le_bytes()),
        (0x1600, 2, &0x6042_0010u32.to_le_bytes()),
        (0x1600, 0, &[2]),
        (0x1400, 2, &[1]),
        (0x1400, 1, &0x0000_0201u32.to_le_bytes()),
        (0x604A, 1, &30_000u32.to_le_bytes()),
    ];
    for (index, sub, data) in writes {
        bench.write(NODE, index, sub, data).unwrap();
    }
    bench.nmt(nmt::Command::Start, NODE);
    cycles(&mut bench, 1, 0x06, 0);
    cycles(&mut bench, 2, 0x3F, 0);
    bench
}

/// Cycles of 10 ms.
fn cycles(bench: &mut Bench<Twin>, count: usize, word: u16, speed: i16) {
    for _ in 0..count {
        let [c0, c1] = word.to_le_bytes();
        let [v0, v1] = speed.to_le_bytes();
        bench.send(CobId::r_pdo(1, id(NODE)).get(), &[c0, c1, v0, v1]);
        bench.wait(ms(1));
        bench.sync();
        bench.wait(ms(9));
    }
}

/// 6043h and 6044h.
fn speeds(bench: &mut Bench<Twin>) -> [i16; 2] {
    [0x6043, 0x6044].map(|index| {
        let bytes = bench.read(NODE, index, 0).unwrap();
        i16::from_le_bytes(bytes.try_into().unwrap())
    })
}

#[track_caller]
fn assert_near(bench: &mut Bench<Twin>, expected: i16) {
    let [demand, actual] = speeds(bench);
    assert!((demand - expected).abs() <= 40, "{demand}, not {expected}");
    assert!((actual - demand).abs() <= 40, "{actual} at {demand}");
}

#[test]
fn ramps_take_their_time_up_down_and_the_other_way() {
    let mut bench = enabled();
    cycles(&mut bench, 50, 0x7F, 3000);
    assert_near(&mut bench, 1500);
    cycles(&mut bench, 60, 0x7F, 3000);
    assert_near(&mut bench, 3000);
    let word = bench.twin().statusword();
    assert!(word.0 & 1 << 10 != 0 && word.0 & 1 << 11 == 0, "{word:?}");
    // Down by 1500 1/min in a second, then up the other way by 3000.
    cycles(&mut bench, 100, 0x7F, -3000);
    assert_near(&mut bench, 1500);
    assert!(bench.twin().statusword().0 & 1 << 10 == 0);
    cycles(&mut bench, 200, 0x7F, -3000);
    assert_near(&mut bench, -3000);
    let turns = bench.twin().observe().velocity;
    assert!((turns + 50.0).abs() < 0.5, "{turns} rev/s");
}

#[test]
fn bits_of_the_controlword_lead_lock_and_halt_the_ramp() {
    for (word, after) in [
        (0x7F, 2000), // all
        (0x3F, 0),    // without bit 6: to zero
        (0x017F, 0),  // halt
        (0x5F, 1000), // without bit 5: where it is
        (0x6F, 1000), // without bit 4
    ] {
        let mut bench = enabled();
        cycles(&mut bench, 100, 0x7F, 1000);
        cycles(&mut bench, 100, word, 2000);
        assert_near(&mut bench, after);
    }
}

#[test]
fn amounts_are_held_within_6046h_and_bit_11_says_so() {
    let mut bench = enabled();
    bench.write(NODE, 0x6046, 1, &100u32.to_le_bytes()).unwrap();
    bench.write(NODE, 0x6046, 2, &900u32.to_le_bytes()).unwrap();
    for (asked, turned, limited) in [
        (5000, 900, true),
        (-5000, -900, true),
        (500, 500, false),
        (-20, -100, true),
        (0, 0, false),
    ] {
        cycles(&mut bench, 150, 0x7F, asked);
        assert_near(&mut bench, turned);
        let bit = bench.twin().statusword().0 & 1 << 11 != 0;
        assert_eq!(bit, limited, "{asked}");
    }
}

#[test]
fn what_a_unit_is_604ch_says() {
    // 60 1/min; a tenth of 1/min.
    for (factor, asked, turns) in [([60i32, 1], 20, 20.0), ([1, 10], 6000, 10.0)] {
        let mut bench = enabled();
        bench
            .write(NODE, 0x604C, 1, &factor[0].to_le_bytes())
            .unwrap();
        bench
            .write(NODE, 0x604C, 2, &factor[1].to_le_bytes())
            .unwrap();
        bench
            .write(NODE, 0x6046, 2, &30_000u32.to_le_bytes())
            .unwrap();
        bench
            .write(NODE, 0x6048, 1, &30_000u32.to_le_bytes())
            .unwrap();
        cycles(&mut bench, 150, 0x7F, asked);
        let velocity = bench.twin().observe().velocity;
        assert!((velocity - turns).abs() < 0.1, "{velocity} rev/s");
        let [_, actual] = speeds(&mut bench);
        assert!((actual - asked).abs() <= 10, "{actual}");
    }
}

#[test]
fn quick_stop_and_faults_brake_by_604ah() {
    let mut bench = enabled();
    cycles(&mut bench, 110, 0x7F, 3000);
    // 30 000 1/min in a second: 100 ms.
    cycles(&mut bench, 5, 0x0B, 3000);
    let [demand, _] = speeds(&mut bench);
    assert!((1440..=1560).contains(&demand), "{demand}");
    cycles(&mut bench, 8, 0x0B, 3000);
    assert!(bench.twin().observe().velocity.abs() < 0.1);

    let mut bench = enabled();
    cycles(&mut bench, 110, 0x7F, 3000);
    let fault = Disturbance::Fault(ErrorClass::StopAndSwitchOff);
    bench.twin().disturb(fault);
    cycles(&mut bench, 15, 0x7F, 3000);
    assert!(bench.twin().observe().velocity.abs() < 0.1);
    assert!(!bench.twin().observe().is_powered);
}

/// 6042h is what it turns at as soon as it is written, and 60FFh in Profile Velocity: no SYNC is needed for that.
#[test]
fn it_turns_without_sync() {
    for (mode, index, speed) in [(2, 0x6042, 600_i32), (3, 0x60FF, 10 * 1_048_576)] {
        let mut bench = Bench::of([Twin::new(TwinConfig {
            mode,
            ..TwinConfig::new(id(NODE))
        })]);
        let target = &speed.to_le_bytes()[..if mode == 2 { 2 } else { 4 }];
        bench.write(NODE, 0x6060, 0, &[mode as u8]).unwrap();
        for word in [0x06, 0x07, 0x7F] {
            bench.controlword(NODE, word);
        }
        bench.write(NODE, index, 0, target).unwrap();
        bench.wait(ms(1000));
        let velocity = bench.twin().observe().velocity;
        assert!(
            (velocity - 10.0).abs() < 0.1,
            "mode {mode}: {velocity} rev/s"
        );
    }
}

/// 604Ah:1 of 0 is no ramp.
#[test]
fn a_quick_stop_without_a_ramp_ends() {
    let mut bench = enabled();
    bench.write(NODE, 0x604A, 1, &[0; 4]).unwrap();
    cycles(&mut bench, 110, 0x7F, 3000);
    cycles(&mut bench, 50, 0x0B, 3000);
    assert!(bench.twin().observe().velocity.abs() < 0.1);
    assert!(!bench.twin().observe().is_powered);
}
