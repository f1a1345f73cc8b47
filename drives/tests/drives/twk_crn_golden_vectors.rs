//! Every frame that the encoder's manual prints, executed over the bus: eight, and none of them is
//! suspect. Two bytes of both SDO answers are blank in the manual and are not compared.

use crate::common::{Bench, id, ms};
use syncline_canopen::nmt::State;
use syncline_drives::twin::SimulatedDevice;
use syncline_drives::twin::twk_crn::{Twin, TwinConfig};

/// An encoder whose disc reads 1234h.
fn bench(node: u8) -> Bench<Twin> {
    let mut bench = Bench::of([Twin::new(TwinConfig {
        position: (f64::from(0x1234) + 0.5) / 8192.0,
        ..TwinConfig::new(id(node))
    })]);
    bench.wait(ms(300));
    bench
}

/// 1: crn S36.
#[test]
fn start_node_1() {
    let mut bench = bench(1);
    bench.send(0x000, &[0x01, 0x01]);
    bench.wait(ms(1));
    assert_eq!(bench.twin().observe().nmt_state, State::Operational);
}

/// 2 to 5: crn S28.
#[test]
fn read_the_position_and_preset_it() {
    let mut bench = bench(1);
    let answer = bench.request(1, [0x40, 0x04, 0x60, 0x00, 0, 0, 0, 0]);
    assert_eq!(answer[..6], [0x43, 0x04, 0x60, 0x00, 0x34, 0x12]);
    let answer = bench.request(1, [0x22, 0x03, 0x60, 0x00, 0x00, 0x10, 0, 0]);
    assert_eq!(answer[..6], [0x60, 0x03, 0x60, 0x00, 0x00, 0x10]);
    assert_eq!(bench.number(1, 0x6004, 0), 0x1000);
}

/// 6 and 7: crn S42, with guard time and life time factor 0.
#[test]
fn guarding_toggles() {
    let mut bench = bench(2);
    bench.send(0x000, &[0x01, 0x02]);
    for expected in [0x05, 0x85, 0x05] {
        assert_eq!(bench.remote(0x702), Some(vec![expected]));
        bench.wait(ms(10_000));
    }
}

/// 8: crn S42, S11, with a guard time of 256 ms and a life time factor of 1.
#[test]
fn a_late_request_finds_the_node_pre_operational() {
    let mut bench = bench(2);
    bench.write(2, 0x100C, 0, &[0x00, 0x01]).unwrap();
    bench.write(2, 0x100D, 0, &[0x01]).unwrap();
    bench.send(0x000, &[0x01, 0x02]);
    for expected in [0x05, 0x85, 0x05] {
        bench.wait(ms(200));
        assert_eq!(bench.remote(0x702), Some(vec![expected]));
    }
    bench.wait(ms(300));
    assert_eq!(bench.remote(0x702), Some(vec![0xFF]));
    assert_eq!(bench.twin().observe().nmt_state, State::PreOperational);
}
