//! An absolute rotary encoder as the profile has it: CiA 406, by the profile's own objects. Encoders that a file describes
//! are instances of it.
//!
//! One T_PDO brings the position value (6004h) at every SYNC, or every nth; all others are switched off before anything turns. The
//! encoder counts as its disc does: scaling is off (6000h), which is written only where it reads otherwise, as a change of
//! it may delete the preset, and with it the machine's zero. The preset itself (6003h) is never written, and nothing is
//! stored. What the encoder does not have is an [`Assumption`].

use super::profile::cia406::{self, AbsoluteEncoder, POSITION};
use super::profile::communication::{self, SDO_RESPONSE, T_PDO_RESPONSE};
use super::profile::generic::{self, FIXED_MAPPING, PDOS, PRODUCT_CODE, VENDOR_ID};
use super::{
    Address, Assumed, Assumption, Data, Identity, Increments, Make, Mapping, Model, Monitoring,
    NODES, NodeSpec, Settings, Write,
};
use crate::dictionary;
use core::time::Duration;
use std::sync::Arc;
use syncline_canopen::BIT_RATES;

/// The encoder.
pub(super) static CIA406: Model = Model {
    name: "cia406",
    title: "CiA 406",
    maker: None,
    bitrates: BIT_RATES,
    nodes: NODES,
    // It follows any SYNC that its answer fits between.
    cycle_step: Duration::from_micros(1),
    cycles: Duration::from_micros(500)..=Duration::from_secs(1),
    increments_per_revolution: |assumed| assumed.value(&STEPS_PER_TURN),
    generic: None,
    r_pdo_values: &[],
    assumptions: &[&[
        STEPS_PER_TURN,
        TURNS,
        HAS_RESOLUTION,
        HAS_SCALING,
        HAS_HEARTBEAT,
        VENDOR_ID,
        PRODUCT_CODE,
        PDOS,
        T_PDO,
        FIXED_MAPPING,
        T_PDO_RESPONSE,
        SDO_RESPONSE,
    ]],
    choices: &[],
    dictionary: dictionary::CIA406,
    reserved: cia406::reserved,
    positions: Increments::MIN..=Increments::MAX,
    abilities: &[],
    inputs: &[],
    outputs: &[],
    analog_inputs: &[],
    analog_outputs: &[],
    captures: &[],
    homing_methods: &[],
    torque_limit: None,
    make: Make::Encoder(|model, settings| Arc::new(encoder(model, settings))),
};

const STEPS_PER_TURN: Assumption = Assumption {
    name: "steps_per_turn",
    default: 8192,
    allowed: 2..=1 << 24,
    meaning: "steps of the disc: what 6501h has to read",
};

const TURNS: Assumption = Assumption {
    name: "turns",
    default: 4096,
    allowed: 1..=0xFFFF,
    meaning: "turns that it tells apart: what 6502h has to read; the position begins anew behind them, at the latest after 32 bits",
};

const HAS_RESOLUTION: Assumption = Assumption {
    meaning: "1: it has 6501h and 6502h, which are read; 0: it has neither, and counts as steps_per_turn and turns say",
    ..generic::HAS_RESOLUTION
};

const HAS_SCALING: Assumption = Assumption {
    name: "has_scaling",
    default: 1,
    allowed: 0..=1,
    meaning: "1: it has 6000h, which has to read 0: clockwise, and no scaling; 0: it has no such object",
};

const HAS_HEARTBEAT: Assumption = Assumption {
    meaning: "1: it sends a heartbeat (1017h), and a message when it has booted; 0: it shows by its T_PDOs alone that it is there",
    ..communication::HAS_HEARTBEAT
};

const T_PDO: Assumption = Assumption {
    meaning: "number of the T_PDO that brings the position",
    ..generic::T_PDO
};

/// One encoder. What the bytes of its EMCY mean is the maker's affair, and nobody knows who that is.
fn encoder(model: &'static Model, settings: &Settings) -> AbsoluteEncoder {
    let assumed = &settings.assumed;
    let has_heartbeat = assumed.value(&HAS_HEARTBEAT) != 0;
    let t_pdo = generic::number(assumed, &T_PDO);
    let pdo = Mapping::by_maker(
        model,
        generic::is_mapped_by_the_maker(assumed),
        generic::parameter(0x1A00, t_pdo),
        [&[POSITION], &[]],
        Vec::new(),
    );
    let setup = setup(model, settings, t_pdo, &pdo);
    let has_scaling = assumed.value(&HAS_SCALING) != 0;
    let unscaled = Write::new(0x6000, 0, Data::u16(0));
    let steps = u64::from(assumed.value(&STEPS_PER_TURN));
    let range = (steps * u64::from(assumed.value(&TURNS))).min(1 << 32);
    AbsoluteEncoder {
        spec: NodeSpec {
            identity: identity(assumed, &pdo),
            history: vec![Address::new(0x1003, 1)],
            ensured: has_scaling.then_some(unscaled).into_iter().collect(),
            tells_boot_up: has_heartbeat,
            monitoring: match has_heartbeat {
                true => Monitoring::Heartbeat,
                false => Monitoring::TPdos,
            },
            t_pdos: vec![communication::t_pdo(t_pdo, settings.node, pdo.bytes())],
            sync_divider: settings.sync_divider.into(),
            ..NodeSpec::new(model, settings, setup, |_| false)
        },
        pdo,
        range: Increments::new(range as i64),
    }
}

/// What tells an encoder that counts as is assumed.
fn identity(assumed: &Assumed, pdo: &Mapping) -> Vec<Identity> {
    let reads = Identity::new;
    // What stands above CiA 406 tells rotary encoders of one turn and of several apart.
    let mut identity = vec![reads(0x1000, 0, "device type", 406).in_bits(0xFFFF)];
    identity.extend(generic::maker(assumed));
    if assumed.value(&HAS_RESOLUTION) != 0 {
        let [steps, turns] = [&STEPS_PER_TURN, &TURNS].map(|it| assumed.value(it));
        identity.push(reads(0x6501, 0, "steps per turn", steps));
        identity.push(reads(0x6502, 0, "turns", turns).in_bits(0xFFFF));
    }
    identity.extend(pdo.identity());
    identity
}

/// Every T_PDO off; the one that is used mapped, and on at every nth SYNC. It has no setpoints to miss: that the controller dies
/// is nothing to it.
fn setup(model: &'static Model, settings: &Settings, t_pdo: u8, pdo: &Mapping) -> Vec<Write> {
    let (node, assumed) = (settings.node, &settings.assumed);
    let mut setup = generic::t_pdos_off(model, node, assumed, t_pdo);
    setup.extend(&settings.objects);
    setup.extend(pdo.writes());
    let index = generic::parameter(0x1800, t_pdo);
    setup.push(Write::new(index, 2, Data::u8(settings.sync_divider)));
    let on = Data::u32(generic::t_pdo_word(t_pdo, node));
    setup.push(Write::new(index, 1, on));
    if assumed.value(&HAS_HEARTBEAT) != 0 {
        let [producer, _] = communication::heartbeats(&settings.heartbeat);
        setup.push(producer);
    }
    setup
}

#[cfg(test)]
mod tests {
    use super::super::{Feedback, unwrapped};
    use super::*;
    use proptest::prelude::*;
    use syncline_canopen::NodeId;

    fn encoder(assumed: &[(&'static str, u32)]) -> AbsoluteEncoder {
        let (node, cycle) = (NodeId::new(3).unwrap(), Duration::from_millis(2));
        let settings = Settings {
            objects: vec![Write::new(0x6401, 1, Data::i32(5))],
            assumed: Assumed(assumed.to_vec()),
            ..Settings::new(node, cycle)
        };
        super::encoder(&CIA406, &settings)
    }

    fn shown(writes: &[Write]) -> Vec<String> {
        let shown = |write: &Write| format!("{} = {}", write.address, write.data);
        writes.iter().map(shown).collect()
    }

    #[test]
    fn the_set_up_in_its_order() {
        let encoder = encoder(&[("pdos", 2), ("t_pdo", 2)]);
        assert_eq!(
            shown(&encoder.spec.setup),
            [
                "1800h:1 = C0000183h",
                "1801h:1 = C0000283h",
                "6401h:1 = 00000005h",
                "1A01h:0 = 00h",
                "1A01h:1 = 60040020h",
                "1A01h:0 = 01h",
                "1801h:2 = 01h",
                "1801h:1 = 40000283h",
                "1017h:0 = 0064h",
            ]
        );
        assert_eq!(shown(&encoder.spec.ensured), ["6000h:0 = 0000h"]);
        assert_eq!(encoder.spec.monitoring, Monitoring::Heartbeat);
    }

    #[test]
    fn what_an_encoder_does_not_have_is_left_alone() {
        let encoder = encoder(&[
            ("pdos", 1),
            ("has_resolution", 0),
            ("has_scaling", 0),
            ("has_heartbeat", 0),
            ("fixed_mapping", 1),
        ]);
        assert_eq!(
            shown(&encoder.spec.setup),
            [
                "1800h:1 = C0000183h",
                "6401h:1 = 00000005h",
                "1800h:2 = 01h",
                "1800h:1 = 40000183h",
            ]
        );
        assert!(encoder.spec.ensured.is_empty() && !encoder.spec.tells_boot_up);
        assert_eq!(encoder.spec.monitoring, Monitoring::TPdos);
        let identity = encoder.spec.identity.iter();
        let read: Vec<_> = identity.map(|it| it.address.to_string()).collect();
        assert_eq!(read, ["1000h:0", "1A00h:0", "1A00h:1"]);
    }

    proptest! {
        /// What it sends at a position is that position, within its range, which 32 bits hold.
        #[test]
        fn a_t_pdo_tells_the_position(position: i32, steps in 2..=1u32 << 24, turns in 1..=0xFFFFu32) {
            let encoder = encoder(&[("steps_per_turn", steps), ("turns", turns)]);
            let position = Increments::from(position);
            let frames = encoder.in_motion(position);
            let told = encoder.sample(0, frames[0].data()).unwrap().position;
            let range = encoder.range().unwrap();
            prop_assert!(range.get() <= 1 << 32 && (0..range.get()).contains(&told.get()));
            prop_assert_eq!(unwrapped(told, Some(range), position), position);
        }
    }
}
