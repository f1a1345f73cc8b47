//! The I/O node from the bus: what each object and each frame makes it do.

use crate::common::{Bench, frames, id, ms, set};
use proptest::prelude::*;
use syncline_canopen::nmt::{Command, State};
use syncline_drives::bus::Band;
use syncline_drives::twin::cia401::{Twin, TwinConfig};
use syncline_drives::twin::node::Processor;
use syncline_drives::twin::{Disturbance, ErrorClass, SimulatedDevice};

const R_PDO1: u16 = 0x201;
const R_PDO2: u16 = 0x301;
const T_PDO1: u16 = 0x181;
const T_PDO2: u16 = 0x281;
const EMCY: u16 = 0x081;

/// Node 1, answering at once.
fn io() -> Bench<Twin> {
    Bench::of([Twin::new(TwinConfig {
        processor: Processor::prompt(id(1)),
        ..TwinConfig::new(id(1))
    })])
}

/// The same in Operational, with what it sends at first behind it.
fn operational() -> Bench<Twin> {
    let mut bench = io();
    bench.nmt(Command::Start, 1);
    bench.wait(ms(5));
    bench
}

/// What comes with an identifier while 10 ms pass.
fn told(bench: &mut Bench<Twin>, id: u16) -> Vec<Vec<u8>> {
    let from = bench.log.len();
    bench.wait(ms(10));
    bench.received(from, id)
}

#[test]
fn digital_signals_stand_in_the_dictionary_by_bytes_and_by_words() {
    let mut bench = io();
    for input in [0, 9, 15] {
        bench.twin().set_input(input, true);
    }
    assert_eq!(bench.number(1, 0x6000, 1), 0x01);
    assert_eq!(bench.number(1, 0x6000, 2), 0x82);
    assert_eq!(bench.number(1, 0x6100, 1), 0x8201);
    set(&mut bench, 0x6102, 1, 0x0101);
    assert_eq!(bench.number(1, 0x6002, 2), 0x01);
    assert_eq!(bench.number(1, 0x6100, 1), 0x8300);

    set(&mut bench, 0x6200, 2, 0x12);
    assert_eq!(bench.number(1, 0x6300, 1), 0x1200);
    set(&mut bench, 0x6300, 1, 0x0034);
    assert_eq!(
        (bench.number(1, 0x6200, 1), bench.number(1, 0x6200, 2)),
        (0x34, 0)
    );
    assert_eq!(bench.twin().outputs(), 0x0034);
    set(&mut bench, 0x6202, 1, 0x0F);
    assert_eq!(bench.twin().outputs(), 0x003B);
    set(&mut bench, 0x6208, 1, 0x01);
    set(&mut bench, 0x6200, 1, 0x35);
    assert_eq!(
        bench.twin().outputs(),
        0x003A,
        "the filter lets one through"
    );
}

#[test]
fn outputs_come_by_pdo_and_with_sync_where_they_are_synchronous() {
    let mut bench = operational();
    bench.send(R_PDO1, &[0x81, 0x01]);
    bench.send(R_PDO2, &[0x34, 0x12, 0xFF, 0xFF, 0, 0, 0x00, 0x80]);
    bench.wait(ms(2));
    assert_eq!(bench.twin().outputs(), 0x0181);
    assert_eq!(bench.twin().analog_outputs(), [0x1234, -1, 0, i16::MIN]);
    bench.nmt(Command::EnterPreOperational, 1);
    set(&mut bench, 0x1400, 2, 1);
    bench.nmt(Command::Start, 1);
    bench.send(R_PDO1, &[0xFF, 0xFF]);
    bench.wait(ms(2));
    assert_eq!(bench.twin().outputs(), 0x0181, "no SYNC yet");
    bench.sync();
    bench.wait(ms(2));
    assert_eq!(bench.twin().outputs(), 0xFFFF);
}

#[test]
fn a_change_of_a_digital_input_is_an_event_by_its_mask() {
    let mut bench = operational();
    assert!(told(&mut bench, T_PDO1).is_empty());
    bench.twin().set_input(10, true);
    assert_eq!(told(&mut bench, T_PDO1), [[0, 4]]);
    set(&mut bench, 0x6006, 2, 0);
    bench.twin().set_input(10, false);
    assert!(told(&mut bench, T_PDO1).is_empty());
    set(&mut bench, 0x6007, 2, 0x04);
    bench.twin().set_input(10, true);
    bench.wait(ms(10));
    bench.twin().set_input(10, false);
    assert!(told(&mut bench, T_PDO1).is_empty(), "it rose before");
    set(&mut bench, 0x6107, 1, 0);
    set(&mut bench, 0x6108, 1, 0x0400);
    bench.twin().set_input(10, true);
    assert!(told(&mut bench, T_PDO1).is_empty(), "it is to fall");
    bench.twin().set_input(10, false);
    assert_eq!(told(&mut bench, T_PDO1).len(), 1);
    set(&mut bench, 0x6005, 0, 0);
    bench.twin().set_input(0, true);
    assert!(told(&mut bench, T_PDO1).is_empty());
}

#[test]
fn analog_inputs_are_told_once_they_are_enabled() {
    let mut bench = operational();
    bench.twin().set_analog_input(2, 500);
    assert!(told(&mut bench, T_PDO2).is_empty());
    set(&mut bench, 0x6423, 0, 1);
    bench.twin().set_analog_input(2, 501);
    assert_eq!(told(&mut bench, T_PDO2), [[0, 0, 0, 0, 0xF5, 0x01, 0, 0]]);
    assert_eq!(bench.number(1, 0x6422, 1), 0b100);
    assert_eq!(bench.number(1, 0x6422, 1), 0, "it was read");

    // By a delta alone.
    set(&mut bench, 0x6421, 1, 0x04);
    set(&mut bench, 0x6426, 1, 10);
    for (value, is_told) in [(10, false), (11, true), (2, false), (1, false), (0, true)] {
        bench.twin().set_analog_input(0, value);
        assert_eq!(!told(&mut bench, T_PDO2).is_empty(), is_told, "{value}");
    }
    // Beyond limits alone.
    set(&mut bench, 0x6421, 1, 0x03);
    set(&mut bench, 0x6424, 1, 100);
    set(&mut bench, 0x6425, 1, -100);
    for (value, is_told) in [
        (99, false),
        (100, true),
        (101, true),
        (-100, false),
        (-101, true),
    ] {
        bench.twin().set_analog_input(0, value);
        assert_eq!(!told(&mut bench, T_PDO2).is_empty(), is_told, "{value}");
    }
}

#[test]
fn inputs_come_at_sync_as_they_are_then() {
    let mut bench = io();
    set(&mut bench, 0x1800, 2, 1);
    bench.nmt(Command::Start, 1);
    bench.wait(ms(2));
    bench.twin().set_input(3, true);
    assert!(told(&mut bench, T_PDO1).is_empty());
    bench.bus.send(
        Band::Sync,
        syncline_canopen::Frame::new(syncline_canopen::CobId::SYNC, &[]),
    );
    assert_eq!(told(&mut bench, T_PDO1), [[8, 0]]);
}

/// Outputs that are on, one of which keeps its state in an error and two of which do not.
fn with_error_values() -> Bench<Twin> {
    let mut bench = io();
    set(&mut bench, 0x6206, 1, 0b0110);
    set(&mut bench, 0x6207, 1, 0b0100);
    set(&mut bench, 0x6443, 2, 0);
    set(&mut bench, 0x6444, 1, -77);
    bench
        .write(1, 0x1016, 1, &0x007F_0032_u32.to_le_bytes())
        .unwrap();
    bench.nmt(Command::Start, 1);
    bench.send(0x77F, &[5]);
    bench.send(R_PDO1, &[0b0011, 0]);
    bench.send(R_PDO2, &[1, 0, 2, 0, 3, 0, 4, 0]);
    bench.wait(ms(2));
    assert_eq!(bench.twin().outputs(), 0b0011);
    bench
}

/// What such a node puts out in an error.
fn assert_fell_back(bench: &mut Bench<Twin>) {
    assert_eq!(bench.twin().outputs(), 0b0101);
    assert_eq!(bench.twin().analog_outputs(), [-77, 2, 0, 0]);
}

#[test]
fn without_the_masters_heartbeat_outputs_take_their_error_values() {
    let mut bench = with_error_values();
    bench.wait(ms(40));
    assert_eq!(bench.twin().outputs(), 0b0011);
    let from = bench.log.len();
    bench.wait(ms(15));
    assert_fell_back(&mut bench);
    assert_eq!(bench.received(from, EMCY)[0][..2], [0x30, 0x81]);
    assert_eq!(bench.twin().observe().nmt_state, State::PreOperational);
    bench.send(R_PDO1, &[0b1000, 0]);
    bench.wait(ms(2));
    assert_fell_back(&mut bench);
    bench.nmt(Command::Start, 1);
    bench.send(R_PDO1, &[0b1000, 0]);
    bench.wait(ms(2));
    assert_eq!(bench.twin().outputs(), 0b1000);
}

#[test]
fn a_node_that_is_stopped_takes_its_error_values() {
    let mut bench = with_error_values();
    bench.nmt(Command::Stop, 1);
    assert_fell_back(&mut bench);
}

#[test]
fn an_error_of_the_device_holds_its_error_values() {
    let mut bench = with_error_values();
    let from = bench.log.len();
    bench
        .twin()
        .disturb(Disturbance::Fault(ErrorClass::SwitchOff));
    bench.wait(ms(3));
    assert_fell_back(&mut bench);
    bench.send(R_PDO1, &[0b1000, 0]);
    bench.wait(ms(2));
    assert_fell_back(&mut bench);
    bench.twin().disturb(Disturbance::FaultPersists(false));
    bench.wait(ms(3));
    assert_eq!(bench.twin().outputs(), 0b1000);
    let codes: Vec<_> = bench.received(from, EMCY);
    assert_eq!(
        codes.iter().map(|it| [it[0], it[1]]).collect::<Vec<_>>(),
        [[0x20, 0x23], [0, 0]]
    );
}

#[test]
fn a_reset_of_the_node_switches_everything_off() {
    let mut bench = with_error_values();
    bench.nmt(Command::ResetNode, 1);
    bench.wait(ms(5));
    assert_eq!(bench.twin().outputs(), 0);
    assert_eq!(bench.twin().analog_outputs(), [0; 4]);
}

proptest! {
    /// Whatever comes, and whatever inputs do: no panic, both views of the signals agree, and an output that no error
    /// value was given for changes only by what is written to it.
    #[test]
    fn random_frames(
        steps in prop::collection::vec(
            (
                frames(
                    prop::sample::select(vec![0x601u16, 0x000, 0x080, 0x201, 0x301, 0x77F]),
                    prop_oneof![
                        (
                            prop::sample::select(vec![0x23u8, 0x2B, 0x2F, 0x40, 0x60]),
                            prop::sample::select(vec![
                                0x1005u16, 0x1016, 0x1029, 0x1400, 0x1600, 0x1800, 0x1A00, 0x6000, 0x6002, 0x6005,
                                0x6006, 0x6102, 0x6200, 0x6202, 0x6206, 0x6207, 0x6208, 0x6300, 0x6306, 0x6307, 0x6401,
                                0x6411, 0x6421, 0x6422, 0x6423, 0x6424, 0x6426, 0x6443, 0x6444,
                            ]),
                            0u8..5,
                            any::<[u8; 4]>(),
                        )
                            .prop_map(|(command, index, sub, data)| {
                                let [low, high] = index.to_le_bytes();
                                [&[command, low, high, sub][..], &data].concat()
                            }),
                        (prop::sample::select(vec![1u8, 2, 0x80, 0x81, 0x82]), 0u8..2).prop_map(|(a, b)| vec![a, b]),
                        prop::collection::vec(any::<u8>(), 0..9),
                    ],
                ),
                0u8..20,
                any::<bool>(),
                any::<i16>(),
            ),
            1..60,
        ),
    ) {
        let mut bench = operational();
        for (frame, input, level, value) in steps {
            bench.twin().set_input(input, level);
            bench.twin().set_analog_input(input, value);
            bench.bus.send(Band::Acyclic, frame);
            bench.wait(ms(2));
        }
        // A transfer that was left open is over.
        bench.nmt(Command::ResetCommunication, 1);
        bench.wait(ms(5));
        for (bytes, words) in [(0x6000, 0x6100), (0x6200, 0x6300), (0x6206, 0x6306), (0x6207, 0x6307)] {
            let [low, high] = [1, 2].map(|sub| bench.number(1, bytes, sub));
            prop_assert_eq!(bench.number(1, words, 1), high << 8 | low, "{:04X}h", words);
        }
    }
}
