//! Random frames at the controller in every state: no panic, no motion without a valid enable, and
//! what it shows stays legal.

use crate::common::{Bench, frames, id};
use proptest::prelude::*;
use syncline_canopen::Frame;
use syncline_canopen::cia402::State;
use syncline_canopen::nmt::Command;
use syncline_drives::bus::Band;
use syncline_drives::twin::node::Processor;
use syncline_drives::twin::tlc5xx::{DriveError, Switches, Twin, TwinConfig};
use syncline_drives::twin::{Disturbance, ErrorClass, SimulatedDevice};

/// Frames that a node could take for its own more often than not.
fn frame() -> impl Strategy<Value = Frame> {
    let ids = prop_oneof![
        6 => Just(0x601u16),
        3 => prop::sample::select(vec![0x201u16, 0x301, 0x401, 0x501]),
        2 => Just(0x080),
        1 => Just(0x000),
        1 => prop::sample::select(vec![0x701u16, 0x77F]),
        1 => 0u16..0x800,
    ];
    let indices = prop::sample::select(vec![
        0x6040u16, 0x6060, 0x607A, 0x607D, 0x607F, 0x6081, 0x6083, 0x6085, 0x6093, 0x6094, 0x6097,
        0x6098, 0x6099, 0x60FB, 0x60FE, 0x60FF, 0x2008, 0x2009, 0x2010, 0x2016, 0x2019, 0x2040,
        0x2045, 0x2046, 0x2052, 0x2053, 0x2054, 0x205A, 0x205E, 0x2090, 0x2092, 0x2093, 0x2094,
        0x2095, 0x209D, 0x20A1, 0x20A2, 0x20A9, 0x20AA, 0x20E8, 0x20F0, 0x20F6, 0x2100, 0x2400,
        0x1003, 0x1005, 0x100C, 0x100D, 0x1016, 0x1017, 0x1400, 0x1401, 0x1403, 0x1600, 0x1601,
        0x1800, 0x1803, 0x1A01,
    ]);
    let commands = prop::sample::select(vec![
        0x23u8, 0x2B, 0x2F, 0x40, 0x60, 0x70, 0x21, 0x00, 0x10, 0x80,
    ]);
    let data = prop_oneof![
        2 => (0u32..0x100).prop_map(u32::to_le_bytes),
        1 => any::<[u8; 4]>(),
    ];
    let sdo = (commands, indices, 0u8..4, data).prop_map(|(command, index, sub, data)| {
        let [low, high] = index.to_le_bytes();
        [&[command, low, high, sub][..], &data].concat()
    });
    let small = prop::collection::vec(
        prop_oneof![
            Just(0u8),
            Just(6),
            Just(7),
            Just(0x0F),
            Just(0x1F),
            0u8..0x80
        ],
        0..9,
    );
    let data = prop_oneof![5 => sdo, 3 => small, 1 => prop::collection::vec(any::<u8>(), 0..9)];
    frames(ids, data)
}

/// Whether a frame may enable: by a controlword, or by bit 1 of the manufacturer's.
fn may_enable(frame: &Frame) -> bool {
    let words = |data: &[u8]| data.windows(2).any(|word| word[0] & 0x8F == 0x0F);
    let manufacturer = |data: &[u8]| {
        data.windows(3)
            .any(|sdo| sdo[0] == 0x2B && sdo[1] == 0x40 && sdo[2] == 0x20)
    };
    // A mapping may bring 2040h as well.
    words(frame.data()) || manufacturer(frame.data()) || frame.data().contains(&0x20)
}

proptest! {
    #[test]
    fn no_panic_and_no_motion_without_enable(
        begins in 0u8..5,
        mode in prop::sample::select(vec![1i8, 3, 6, -1]),
        node in prop::sample::select(vec![Command::Start, Command::EnterPreOperational, Command::Stop]),
        fitted in any::<bool>(),
        frames in prop::collection::vec((frame(), 0u64..3000), 1..80),
    ) {
        let switches = Switches {
            negative_limit: fitted.then_some(-0.5),
            positive_limit: fitted.then_some(0.5),
            reference: fitted.then_some(0.1..0.2),
        };
        let mut bench = Bench::of([Twin::new(TwinConfig {
            switches,
            processor: Processor::prompt(id(1)),
            ..TwinConfig::new(id(1))
        }).unwrap()]);
        bench.write(1, 0x6060, 0, &[mode as u8]).unwrap();
        match begins {
            0 => {}
            1 => bench.controlword(1, 0x06),
            2 => bench.twin().disturb(Disturbance::FoundEnabled),
            3 => bench.twin().raise(DriveError::CONNECTION_LOST),
            _ => {
                bench.twin().disturb(Disturbance::FoundEnabled);
                bench.twin().disturb(Disturbance::Fault(ErrorClass::QuickStop));
            }
        }
        bench.nmt(node, 1);
        let mut enabled = bench.twin().state().is_powered();
        let rest = bench.twin().observe().position;
        for (frame, wait) in frames {
            enabled |= may_enable(&frame);
            bench.bus.send(Band::Acyclic, frame);
            bench.wait(std::time::Duration::from_micros(wait));
            let seen = bench.twin().observe();
            prop_assert!(seen.position.is_finite() && seen.velocity.is_finite());
            // 205Ah and 60FBh:3 bound the profile; the loop overshoots a little.
            prop_assert!(seen.velocity.abs() * 60.0 < 12_600.0, "{}", seen.velocity);
            let word = bench.twin().statusword();
            let state = bench.twin().state();
            prop_assert_eq!(word.0 & 8 != 0, matches!(state, State::Fault | State::FaultReactionActive));
            if !enabled {
                prop_assert!(!state.is_powered(), "{:?}", state);
                prop_assert_eq!(seen.position, rest);
            }
        }
    }
}
