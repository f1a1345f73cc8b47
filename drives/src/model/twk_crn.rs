//! The absolute encoder TWK CRN (CiA 406). `crn S12` in comments is the piece of the manual's text
//! that begins with 12.
//!
//! - T_PDO2 brings the position at every SYNC without any set-up, and at every nth where it is asked to; T_PDO1 would send at every change
//!   and flood the bus from a turning shaft, so that it is switched off before anything turns.
//! - A change of code sequence or scaling deletes the preset, and with it the machine's zero. They are
//!   therefore written only where they read otherwise. The preset itself is never written, as it takes
//!   the position of that instant, on a turning shaft too; where the encoder stands at machine position 0
//!   is said in the machine file. Nothing is stored in the encoder.
//! - There is no heartbeat and no boot-up message. The encoder is heard by its T_PDO, which it sends in
//!   Operational alone, so that a missing one tells more, and earlier, than guarding would.

use super::profile::cia406::{self, AbsoluteEncoder, POSITION};
use super::profile::communication;
use super::{
    Address, Assumed, Assumption, Data, Identity, Increments, Make, Mapping, Model, Monitoring,
    NodeSpec, Settings, Write,
};
use crate::dictionary;
use core::time::Duration;
use std::sync::Arc;
use syncline_canopen::{CobId, pdo::CobIdWord};

/// The encoder.
pub(super) static TWK_CRN: Model = Model {
    name: "twk_crn",
    title: "TWK CRN",
    maker: Some("TWK Elektronik"),
    // Crn S35, S15, S26.
    bitrates: &[20_000, 125_000, 500_000, 1_000_000],
    // Six switches, or 2000h (crn S7, S35, S15, S1).
    nodes: 1..=64,
    // It follows any SYNC that its answer fits between.
    cycle_step: Duration::from_micros(1),
    cycles: Duration::from_micros(500)..=Duration::from_secs(1),
    increments_per_revolution: |assumed| Measure::of(assumed).per_turn,
    generic: None,
    r_pdo_values: &[],
    assumptions: &[
        &[STEPS_PER_TURN, UNITS_PER_TURN, TURNS_EXPONENT],
        &communication::responses(300, 3000),
    ],
    // Two discs (crn S37).
    choices: &[(STEPS_PER_TURN.name, &[4096, 8192])],
    dictionary: dictionary::TWK_CRN_8192,
    reserved,
    positions: Increments::MIN..=Increments::MAX,
    abilities: &[],
    inputs: &[],
    outputs: &[],
    analog_inputs: &[],
    analog_outputs: &[],
    captures: &[],
    homing_methods: &[],
    torque_limit: None,
    make: Make::Encoder(|_, settings| Arc::new(encoder(settings))),
};

const STEPS_PER_TURN: Assumption = Assumption {
    name: "steps_per_turn",
    default: 8192,
    allowed: 4096..=8192,
    meaning: "steps of the disc: what 6501h has to read, 4096 or 8192",
};

const UNITS_PER_TURN: Assumption = Assumption {
    name: "units_per_turn",
    default: 0,
    allowed: 0..=8192,
    meaning: "6001h, increments for each turn with scaling on; 0 leaves scaling off",
};

const TURNS_EXPONENT: Assumption = Assumption {
    name: "turns_exponent",
    default: 12,
    allowed: 1..=12,
    meaning: "with scaling on the position begins anew after two to the power of so many turns",
};

/// 6000h: scaling is on; clockwise in any case (crn S25).
const SCALING: u16 = 1 << 2;

/// How it counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Measure {
    /// 6001h, if scaling is on.
    units: Option<u32>,
    /// Increments for each turn.
    per_turn: u32,
    /// Increments after which the position begins anew, 6002h if scaling is on.
    range: u32,
}

impl Measure {
    fn of(assumed: &Assumed) -> Self {
        let units = Some(assumed.value(&UNITS_PER_TURN)).filter(|units| *units > 0);
        let per_turn = units.unwrap_or(assumed.value(&STEPS_PER_TURN));
        // Only after a power of two of turns the value begins anew without a jump (crn S32, S40).
        let exponent = match units {
            Some(_) => assumed.value(&TURNS_EXPONENT),
            None => TURNS_EXPONENT.default,
        };
        Self {
            units,
            per_turn,
            range: per_turn << exponent,
        }
    }
}

/// One encoder. The manual describes none of the bytes that a maker adds to an EMCY (crn S35).
fn encoder(settings: &Settings) -> AbsoluteEncoder {
    let assumed = &settings.assumed;
    let measure = Measure::of(assumed);
    let spec = NodeSpec::new(&TWK_CRN, settings, setup(settings), |_| false);
    AbsoluteEncoder {
        spec: NodeSpec {
            identity: identity(assumed.value(&STEPS_PER_TURN)),
            // Last error (crn S2), alarms (crn S37).
            history: vec![Address::new(0x1003, 1), Address::new(0x6503, 0)],
            ensured: ensured(measure),
            tells_boot_up: false,
            monitoring: Monitoring::TPdos,
            // The position.
            t_pdos: vec![communication::t_pdo(2, settings.node, 4)],
            sync_divider: settings.sync_divider.into(),
            ..spec
        },
        pdo: Mapping::new(0x1A02, &[POSITION]),
        range: Increments::new(measure.range.into()),
    }
}

/// What tells that it is this encoder with this disc, and that it takes SYNC.
fn identity(steps_per_turn: u32) -> Vec<Identity> {
    let reads = Identity::new;
    let turns = dictionary::TWK_CRN_TURNS.into();
    vec![
        // A multiturn encoder of profile 406 (crn S22).
        reads(0x1000, 0, "device type", 0x0002_0196),
        reads(0x6501, 0, "steps per turn", steps_per_turn),
        reads(0x6502, 0, "turns", turns).in_bits(0xFFFF),
        // Would count after store and reset only (crn S44): it has to be so.
        reads(0x1005, 0, "COB-ID SYNC", 0x8000_0080).in_bits(0x8000_07FF),
    ]
}

/// 6000h, 6001h, 6002h, in this order (crn S40).
fn ensured(measure: Measure) -> Vec<Write> {
    let w = Write::new;
    match measure.units {
        None => vec![w(0x6000, 0, Data::u16(0))],
        Some(units) => vec![
            w(0x6000, 0, Data::u16(SCALING)),
            w(0x6001, 0, Data::u32(units)),
            w(0x6002, 0, Data::u32(measure.range)),
        ],
    }
}

/// T_PDO1 off, T_PDO2 at every nth SYNC; no supervision of a master, which would lead an encoder that
/// is not guarded out of Operational.
fn setup(settings: &Settings) -> Vec<Write> {
    let w = Write::new;
    let node = settings.node;
    let off = CobIdWord::valid(CobId::t_pdo(1, node)).0 | CobIdWord::INVALID;
    let mut setup = vec![
        w(0x1800, 1, Data::u32(off)),
        w(0x100C, 0, Data::u16(0)),
        w(0x100D, 0, Data::u8(0)),
    ];
    setup.extend(&settings.objects);
    setup.push(w(0x1802, 3, Data::u16(0)));
    setup.push(w(0x1802, 2, Data::u8(settings.sync_divider)));
    let on = CobIdWord::valid(CobId::t_pdo(2, node)).0;
    setup.push(w(0x1802, 1, Data::u32(on)));
    setup
}

/// What the plug has set (2000h, 2001h) is not the user's to write, too.
fn reserved(address: Address) -> bool {
    cia406::reserved(address) || matches!(address.index, 0x2000 | 0x2001)
}

#[cfg(test)]
mod tests {
    use super::super::Feedback;
    use super::*;
    use proptest::prelude::*;
    use syncline_canopen::NodeId;

    fn encoder(assumed: &[(&'static str, u32)]) -> AbsoluteEncoder {
        let (node, cycle) = (NodeId::new(3).unwrap(), Duration::from_millis(2));
        super::encoder(&Settings {
            objects: vec![Write::new(0x6401, 1, Data::i32(5))],
            assumed: Assumed(assumed.to_vec()),
            ..Settings::new(node, cycle)
        })
    }

    fn shown(writes: &[Write]) -> Vec<String> {
        let shown = |write: &Write| format!("{} = {}", write.address, write.data);
        writes.iter().map(shown).collect()
    }

    /// The floods are off before anything is on, and the user's objects come in between.
    #[test]
    fn the_setup_in_its_order() {
        let encoder = encoder(&[]);
        assert_eq!(
            shown(&encoder.spec.setup),
            [
                "1800h:1 = 80000183h",
                "100Ch:0 = 0000h",
                "100Dh:0 = 00h",
                "6401h:1 = 00000005h",
                "1802h:3 = 0000h",
                "1802h:2 = 01h",
                "1802h:1 = 00000283h",
            ]
        );
        assert_eq!(shown(&encoder.spec.ensured), ["6000h:0 = 0000h"]);
    }

    #[test]
    fn scaling_is_set_in_the_manuals_order() {
        let encoder = encoder(&[("units_per_turn", 1024), ("turns_exponent", 3)]);
        assert_eq!(
            shown(&encoder.spec.ensured),
            [
                "6000h:0 = 0004h",
                "6001h:0 = 00000400h",
                "6002h:0 = 00002000h"
            ]
        );
        assert_eq!(encoder.range(), Some(Increments::new(8192)));
    }

    #[test]
    fn nothing_that_moves_its_zero_is_the_users() {
        for index in [
            0x1010, 0x1800, 0x2000, 0x2001, 0x6000, 0x6001, 0x6002, 0x6003,
        ] {
            assert!(reserved(Address::new(index, 0)), "{index:04X}h");
        }
        assert!(!reserved(Address::new(0x6401, 1)));
    }

    proptest! {
        /// What it sends at a position is that position, within its range.
        #[test]
        fn a_t_pdo_tells_the_position(position: i32) {
            let encoder = encoder(&[]);
            let position = Increments::from(position);
            let frames = encoder.in_motion(position);
            let told = encoder.sample(0, frames[0].data()).unwrap().position;
            let range = encoder.range().unwrap();
            prop_assert!((0..range.get()).contains(&told.get()));
            prop_assert_eq!(super::super::unwrapped(told, Some(range), position), position);
        }

        #[test]
        fn short_data_is_no_position(data in prop::collection::vec(any::<u8>(), 0..4)) {
            prop_assert_eq!(encoder(&[]).sample(0, &data), None);
        }
    }
}
