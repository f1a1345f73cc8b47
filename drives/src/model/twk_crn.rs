//! The absolute encoder TWK CRN (CiA 406). `crn S12` in comments is the piece of the manual's text
//! that begins with 12.
//!
//! - T_PDO2 brings the position at every SYNC without any set-up; T_PDO1 would send at every change
//!   and flood the bus from a turning shaft, so that it is switched off before anything turns.
//! - A change of code sequence or scaling deletes the preset, and with it the machine's zero. They are
//!   therefore written only where they read otherwise. The preset itself is never written, as it takes
//!   the position of that instant, on a turning shaft too; where the encoder stands at machine position 0
//!   is said in the machine file. Nothing is stored in the encoder.
//! - There is no heartbeat and no boot-up message. The encoder is heard by its T_PDO, which it sends in
//!   Operational alone, so that a missing one tells more, and earlier, than guarding would.

use super::profile::communication;
use super::{
    Address, Assumed, Assumption, ClockLock, Data, Feedback, Identity, Increments, Make, Model,
    Monitoring, OutOfRange, RemoteNode, Sample, Settings, Write,
};
use crate::dictionary;
use core::{slice, time::Duration};
use std::sync::Arc;
use syncline_canopen::{
    CobId, Frame, NodeId,
    budget::{Direction, Pdo},
    pdo::CobIdWord,
};

/// The encoder.
pub(super) static TWK_CRN: Model = Model {
    name: "twk_crn",
    title: "TWK CRN",
    // Crn S35, S15, S26.
    bitrates: &[20_000, 125_000, 500_000, 1_000_000],
    // It follows any SYNC that its answer fits between.
    cycle_step: Duration::from_micros(1),
    cycles: Duration::from_micros(500)..=Duration::from_secs(1),
    increments_per_revolution: |assumed| Measure::of(assumed).per_turn,
    assumptions: &[
        STEPS_PER_TURN,
        UNITS_PER_TURN,
        TURNS_EXPONENT,
        T_PDO_RESPONSE,
        SDO_RESPONSE,
    ],
    dictionary: &dictionary::TWK_CRN_8192,
    reserved,
    inputs: &[],
    outputs: &[],
    make: Make::Encoder(|settings| Arc::new(TwkCrn::new(settings))),
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

const T_PDO_RESPONSE: Assumption = Assumption {
    name: "t_pdo_response_us",
    default: 300,
    allowed: 0..=1_000_000,
    meaning: "longest time in µs from the end of SYNC until the encoder queues its T_PDO",
};

const SDO_RESPONSE: Assumption = Assumption {
    name: "sdo_response_us",
    default: 3000,
    allowed: 0..=1_000_000,
    meaning: "longest time in µs from the end of an SDO request until the encoder queues its answer",
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

/// Last error (crn S2), alarms (crn S37).
const HISTORY: [Address; 2] = [Address::new(0x1003, 1), Address::new(0x6503, 0)];

/// One encoder.
#[derive(Clone, Debug)]
struct TwkCrn {
    node: NodeId,
    identity: [Identity; 4],
    ensured: Vec<Write>,
    setup: Vec<Write>,
    read_back: Vec<Write>,
    range: Increments,
    t_pdo_response: Duration,
    sdo_response: Duration,
    /// The position.
    t_pdo: Pdo,
}

impl TwkCrn {
    fn new(settings: &Settings) -> Self {
        let (node, assumed) = (settings.node, &settings.assumed);
        let measure = Measure::of(assumed);
        let setup = setup(settings);
        let micros = |assumption| Duration::from_micros(assumed.value(assumption).into());
        Self {
            node,
            identity: identity(assumed.value(&STEPS_PER_TURN)),
            ensured: ensured(measure),
            read_back: communication::read_back(&setup, |_| false),
            setup,
            range: Increments::new(measure.range.into()),
            t_pdo_response: micros(&T_PDO_RESPONSE),
            sdo_response: micros(&SDO_RESPONSE),
            t_pdo: Pdo {
                direction: Direction::Transmit,
                cob_id: CobId::t_pdo(2, node),
                bytes: 4,
            },
        }
    }
}

/// What tells that it is this encoder with this disc, and that it takes SYNC.
fn identity(steps_per_turn: u32) -> [Identity; 4] {
    let reads = |index, name, mask, value| Identity {
        address: Address::new(index, 0),
        name,
        mask,
        value,
    };
    [
        // A multiturn encoder of profile 406 (crn S22).
        reads(0x1000, "device type", u32::MAX, 0x0002_0196),
        reads(0x6501, "steps per turn", u32::MAX, steps_per_turn),
        reads(0x6502, "turns", 0xFFFF, dictionary::TWK_CRN_TURNS.into()),
        // Would count after store and reset only (crn S44): it has to be so.
        reads(0x1005, "COB-ID SYNC", 0x8000_07FF, 0x8000_0080),
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

/// T_PDO1 off, T_PDO2 at every SYNC; no supervision of a master, which would lead an encoder that
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
    setup.push(w(0x1802, 2, Data::u8(1)));
    let on = CobIdWord::valid(CobId::t_pdo(2, node)).0;
    setup.push(w(0x1802, 1, Data::u32(on)));
    setup
}

/// Communication, what the plug has set (2000h, 2001h), how it counts and the preset are not the
/// user's to write on a machine that is being switched on.
fn reserved(Address { index, .. }: Address) -> bool {
    matches!(index, 0x1000..=0x1FFF | 0x2000 | 0x2001 | 0x6000..=0x6003 | 0x6200)
}

impl RemoteNode for TwkCrn {
    fn model(&self) -> &'static Model {
        &TWK_CRN
    }

    fn node(&self) -> NodeId {
        self.node
    }

    fn identity(&self) -> &[Identity] {
        &self.identity
    }

    fn history(&self) -> &[Address] {
        &HISTORY
    }

    fn ensured(&self) -> &[Write] {
        &self.ensured
    }

    fn setup(&self) -> &[Write] {
        &self.setup
    }

    fn read_back(&self) -> &[Write] {
        &self.read_back
    }

    fn agrees(&self, written: &Write, read: &[u8]) -> bool {
        communication::agrees(written, read)
    }

    fn monitoring(&self) -> Monitoring {
        Monitoring::TPdos
    }

    fn clock_lock(&self) -> Option<ClockLock> {
        None
    }

    fn release(&self) -> &[Write] {
        &[]
    }

    fn t_pdos(&self) -> &[Pdo] {
        slice::from_ref(&self.t_pdo)
    }

    fn r_pdos(&self) -> &[Pdo] {
        &[]
    }

    fn t_pdo_response(&self) -> Duration {
        self.t_pdo_response
    }

    fn sdo_response(&self) -> Duration {
        self.sdo_response
    }

    /// The manual describes none of these bytes (crn S35).
    fn vendor_error(&self, _: [u8; 5]) -> Option<String> {
        None
    }
}

impl Feedback for TwkCrn {
    fn sample(&self, _: usize, data: &[u8]) -> Option<Sample> {
        let &[p0, p1, p2, p3, ..] = data else {
            return None;
        };
        let position = u32::from_le_bytes([p0, p1, p2, p3]);
        Some(Sample {
            position: Increments::new(position.into()),
        })
    }

    fn range(&self) -> Option<Increments> {
        Some(self.range)
    }

    fn in_motion(&self, position: Increments) -> Result<Vec<Frame>, OutOfRange> {
        let position = position.get().rem_euclid(self.range.get()) as u32;
        Ok(vec![Frame::new(
            self.t_pdo.cob_id,
            &position.to_le_bytes(),
        )])
    }
}
