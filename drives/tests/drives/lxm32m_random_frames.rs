//! Random frames at a twin in every state: no panic, and no motion without a valid enable.

use crate::common::lxm32m::Bench;
use crate::common::{frames, id, ms};
use proptest::prelude::*;
use syncline_canopen::cia402::State;
use syncline_canopen::nmt::Command;
use syncline_canopen::{CanId, Frame};
use syncline_drives::bus::Band;
use syncline_drives::twin::SimulatedDevice;
use syncline_drives::twin::lxm32m::{DriveError, Policies, TwinConfig};

const STATES: [State; 7] = [
    State::SwitchOnDisabled,
    State::ReadyToSwitchOn,
    State::SwitchedOn,
    State::OperationEnabled,
    State::QuickStopActive,
    State::FaultReactionActive,
    State::Fault,
];

/// A drive in `state`, its node in a state of its own.
fn bench_in(state: State, node: Command, policies: Policies) -> Bench {
    let mut bench = Bench::new([TwinConfig {
        policies,
        ..TwinConfig::new(id(1))
    }]);
    bench.nmt(Command::Start, 1);
    match state {
        State::SwitchOnDisabled => {
            bench.write(1, 0x301B, 0x13, &[1, 0]).unwrap();
            bench.controlword(1, 0);
        }
        State::SwitchedOn => bench.controlword(1, 0x0007),
        State::OperationEnabled => bench.controlword(1, 0x000F),
        State::QuickStopActive => {
            bench.controlword(1, 0x000F);
            bench.controlword(1, 0x000B);
        }
        State::FaultReactionActive => {
            bench.controlword(1, 0x000F);
            bench.write(1, 0x6060, 0, &[3]).unwrap();
            bench.write(1, 0x60FF, 0, &600u32.to_le_bytes()).unwrap();
            bench.wait(ms(700));
            bench.twin().raise(DriveError::SYNC_LOST);
        }
        State::Fault => bench.twin().raise(DriveError::FOLLOWING_ERROR),
        _ => {}
    }
    assert_eq!(bench.twin().state(), state);
    bench.nmt(node, 1);
    bench
}

/// Frames that a node could take for its own more often than not.
fn frame() -> impl Strategy<Value = Frame> {
    let ids = prop_oneof![
        4 => Just(0x601u16),
        2 => prop::sample::select(vec![0x201u16, 0x301, 0x401, 0x501]),
        2 => Just(0x080),
        1 => Just(0x000),
        1 => Just(0x701),
        1 => 0u16..0x800,
    ];
    let indices = prop::sample::select(vec![
        0x6040u16, 0x6060, 0x6098, 0x60FF, 0x607A, 0x6071, 0x60C1, 0x60C2, 0x3022, 0x301B, 0x3006,
        0x1003, 0x1005, 0x1016, 0x1017, 0x100C, 0x1201, 0x1400, 0x1401, 0x1600, 0x1601, 0x1801,
        0x1A01, 0x1A03, 0x3026, 0x3028, 0x3029, 0x302D, 0x3004,
    ]);
    let commands = prop::sample::select(vec![
        0x23u8, 0x2B, 0x2F, 0x40, 0x60, 0x70, 0x21, 0x00, 0x10, 0x80, 0xA4, 0xC6,
    ]);
    let sdo =
        (commands, indices, 0u8..0x20, any::<[u8; 4]>()).prop_map(|(command, index, sub, data)| {
            let [low, high] = index.to_le_bytes();
            let mut bytes = vec![command, low, high, sub];
            bytes.extend(data);
            bytes
        });
    let small = prop::collection::vec(prop_oneof![Just(0u8), Just(6), Just(7), 0u8..0x20], 0..9);
    let data = prop_oneof![4 => sdo, 3 => small, 1 => prop::collection::vec(any::<u8>(), 0..9)];
    frames(ids, data)
}

/// Whether some word in a frame, taken for a controlword, enables operation.
fn may_enable(frame: &Frame) -> bool {
    frame.data().windows(2).any(|word| word[0] & 0x8F == 0x0F)
}

proptest! {

    #[test]
    fn no_panic_and_no_motion_without_enable(
        state in prop::sample::select(STATES.to_vec()),
        node in prop::sample::select(vec![Command::Start, Command::EnterPreOperational, Command::Stop]),
        tolerant in any::<bool>(),
        frames in prop::collection::vec((frame(), 0u64..3000), 1..80),
    ) {
        let policies = if tolerant { Policies::tolerant() } else { Policies::default() };
        let mut bench = bench_in(state, node, policies);
        let mut enabled = bench.twin().state().is_powered();
        let rest = bench.twin().observe().position;
        for (frame, wait) in frames {
            enabled |= may_enable(&frame);
            bench.bus.send(Band::Acyclic, frame);
            bench.wait(std::time::Duration::from_micros(wait));
            let twin = bench.twin();
            prop_assert!(twin.observe().position.is_finite() && twin.observe().velocity.is_finite());
            if !enabled {
                prop_assert!(!twin.state().is_powered(), "{:?}", twin.state());
                prop_assert_eq!(twin.observe().torque, 0.0);
                prop_assert_eq!(twin.observe().position, rest);
            }
        }
    }
}

/// The check above sees a motion: without its premise it fails.
#[test]
fn an_enable_is_recognised_as_one() {
    assert!(may_enable(&Frame::new(
        CanId::Standard(0x201),
        &[0x0F, 0x00]
    )));
    assert!(may_enable(&Frame::new(
        CanId::Standard(0x601),
        &[0x2B, 0x40, 0x60, 0, 0x1F, 0, 0, 0]
    )));
    assert!(!may_enable(&Frame::new(
        CanId::Standard(0x201),
        &[0x07, 0x00]
    )));
}
