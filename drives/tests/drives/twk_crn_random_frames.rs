//! Random frames at the encoder: no panic, and what it says of itself stays within what the manual
//! allows.

use crate::common::{Bench, id, ms};
use proptest::prelude::*;
use syncline_canopen::{CanId, Frame};
use syncline_drives::bus::Band;
use syncline_drives::twin::node::Processor;
use syncline_drives::twin::twk_crn::{EncoderError, Policies, Twin, TwinConfig, Version};
use syncline_drives::twin::{Disturbance, SimulatedDevice};

#[derive(Clone, Debug)]
enum Step {
    Frame(Frame),
    Turn(f64),
    Error(EncoderError, bool),
    Disturb(Disturbance),
}

/// Frames that the encoder could take for its own more often than not.
fn frame() -> impl Strategy<Value = Frame> {
    let ids = prop_oneof![
        6 => Just(0x601u16),
        2 => Just(0x080),
        2 => Just(0x000),
        1 => prop::sample::select(vec![0x701u16, 0x181, 0x281]),
        1 => 0u16..0x800,
    ];
    let indices = prop::sample::select(vec![
        0x1000u16, 0x1003, 0x1005, 0x1006, 0x1008, 0x100C, 0x100D, 0x100E, 0x1010, 0x1011, 0x1014,
        0x1800, 0x1802, 0x1A00, 0x2000, 0x2001, 0x6000, 0x6001, 0x6002, 0x6003, 0x6004, 0x6200,
        0x6400, 0x6401, 0x6402, 0x6509, 0x650A,
    ]);
    let commands = prop::sample::select(vec![
        0x22u8, 0x23, 0x2B, 0x2F, 0x40, 0x60, 0x70, 0x21, 0x00, 0x10, 0x80, 0xA4,
    ]);
    let data = prop_oneof![
        Just(*b"save"),
        Just(*b"load"),
        (0u32..300).prop_map(u32::to_le_bytes),
        any::<[u8; 4]>(),
    ];
    let sdo = (commands, indices, 0u8..4, data).prop_map(|(command, index, sub, data)| {
        let [low, high] = index.to_le_bytes();
        [&[command, low, high, sub][..], &data].concat()
    });
    let nmt = prop::sample::select(vec![0x01u8, 0x02, 0x80, 0x81, 0x82])
        .prop_map(|command| vec![command, 0]);
    let data = prop_oneof![6 => sdo, 2 => nmt, 1 => prop::collection::vec(any::<u8>(), 0..9)];
    (ids, data, 0u8..12).prop_map(|(id, data, kind)| {
        let id = CanId::Standard(id);
        match kind {
            0 => Frame::remote(id, 1).unwrap(),
            _ => Frame::new(id, &data),
        }
    })
}

fn step() -> impl Strategy<Value = Step> {
    let errors = prop::sample::select(vec![
        EncoderError::Hardware,
        EncoderError::Memory,
        EncoderError::Communication,
        EncoderError::Eeprom,
        EncoderError::EepromCrc,
        EncoderError::Xram,
    ]);
    prop_oneof![
        12 => frame().prop_map(Step::Frame),
        1 => (-50.0..50.0f64).prop_map(Step::Turn),
        1 => (errors, any::<bool>()).prop_map(|(error, there)| Step::Error(error, there)),
        1 => any::<bool>().prop_map(|muted| Step::Disturb(Disturbance::Mute(muted))),
        1 => Just(Step::Disturb(Disturbance::Reset)),
    ]
}

proptest! {
    #[test]
    fn no_panic_and_no_value_that_the_manual_excludes(
        cap in any::<bool>(),
        revolutions in -5000.0..5000.0f64,
        lax in any::<bool>(),
        steps in prop::collection::vec((step(), 0u64..3000), 1..120),
    ) {
        let mut bench = Bench::of([Twin::new(TwinConfig {
            position: revolutions,
            version: if cap { Version::ConnectingCap } else { Version::Plug },
            policies: Policies {
                preset_wraps: lax,
                takes_type_255: lax,
                ..Policies::default()
            },
            processor: Processor::prompt(id(1)),
            ..TwinConfig::new(id(1))
        })]);
        for (step, wait) in steps {
            match step {
                Step::Frame(frame) => bench.bus.send(Band::Acyclic, frame),
                Step::Turn(velocity) => bench.twin().turn(velocity),
                Step::Error(error, there) => bench.twin().set_error(error, there),
                Step::Disturb(disturbance) => bench.twin().disturb(disturbance),
            }
            bench.wait(std::time::Duration::from_micros(wait));
            prop_assert!(bench.twin().observe().position.is_finite());
        }
        // It still answers, with values that fit each other.
        bench.twin().disturb(Disturbance::Mute(false));
        bench.send(0x000, &[0x80, 0]);
        bench.wait(ms(5));
        let node = bench.twin().node().get();
        prop_assert!((1..=64).contains(&node));
        // A transfer under way is given up, and an identifier that answers SDOs as well does no harm.
        bench.send(0x600 + u16::from(node), &[0x80, 0, 0, 0, 0, 0, 0, 0]);
        bench.wait(ms(2));
        let value = |bench: &mut Bench<Twin>, index, sub| bench.number(node, index, sub);
        prop_assert_eq!(value(&mut bench, 0x1000, 0), 0x0002_0196);
        let parameters = value(&mut bench, 0x6000, 0);
        prop_assert!(matches!(parameters, 0 | 1 | 4 | 5));
        let range = match parameters & 4 {
            0 => 0x200_0000,
            _ => value(&mut bench, 0x6002, 0),
        };
        prop_assert!(value(&mut bench, 0x6004, 0) < range);
        prop_assert!(value(&mut bench, 0x1003, 0) <= 1);
        prop_assert_eq!(value(&mut bench, 0x6503, 0) & !0x7000, 0);
        prop_assert!(matches!(value(&mut bench, 0x6400, 1), 0 | 3 | 5 | 7));
        for index in [0x1800, 0x1802] {
            let kind = value(&mut bench, index, 2);
            prop_assert!(kind <= 240 || (252..=254).contains(&kind) || lax && kind == 255);
        }
    }
}
