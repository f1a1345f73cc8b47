//! A servo drive as the profile has it: CiA 402 (IEC 61800-7-201) in Cyclic Synchronous Position, or in Interpolated
//! Position, by the profile's own objects. Drives that a file describes are instances of it.
//!
//! Cyclic Synchronous Position has no start: an enabled drive runs to 607Ah within the cycle after each SYNC, and
//! statusword bit 12 says so. Interpolated Position runs to 60C1h:1, from controlword bit 4 on. Nothing that a maker adds is used, no clock that follows SYNC
//! either; what the profile leaves to the maker is an [`Assumption`].
//!
//! Positions are encoder increments at the motor's shaft. What a revolution counts (608Fh) and that
//! the drive reckons with no gear of its own (6091h) is read before anything is written: the travel
//! per motor revolution stands in the machine file. What a drive does not have of this, or does in another way, is an
//! assumption as well.

use super::profile::cia402::{self, INTERPOLATION_DELAY};
use super::profile::communication::{self, SDO_RESPONSE, T_PDO_RESPONSE};
use super::{
    Ability, Address, Assumed, Assumption, Data, Drive, DriveStatus, Feedback, Identity,
    Increments, Make, ModeDisplay, Model, NodeSpec, PowerCommand, PowerState, RemoteNode, Sample,
    Setpoint, Setpoints, Settings, Survey, Write,
};
use crate::dictionary;
use core::time::Duration;
use syncline_canopen::{
    CobId, Frame,
    cia402::{Controlword, Statusword},
    pdo::CobIdWord,
};

/// The drive.
///
/// Cycles are those that 60C2h holds in milliseconds or tenths of them.
pub(super) static CIA402_CSP: Model = Model {
    name: "cia402_csp",
    title: "CiA 402 CSP",
    maker: None,
    bitrates: &[
        10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000,
    ],
    cycle_step: Duration::from_micros(500),
    cycles: Duration::from_micros(500)..=Duration::from_millis(20),
    increments_per_revolution: |assumed| assumed.value(&ENCODER_INCREMENTS),
    positions: Increments::MIN..=Increments::MAX,
    abilities: &[Ability::FollowingErrorLimit, Ability::SoftLimits],
    generic: None,
    assumptions: &[
        MODE,
        ENCODER_INCREMENTS,
        HAS_RESOLUTION,
        HAS_PERIOD,
        TELLS_FOLLOWING,
        VENDOR_ID,
        PRODUCT_CODE,
        PDOS,
        R_PDO,
        T_PDO,
        INTERPOLATION_DELAY,
        T_PDO_RESPONSE,
        SDO_RESPONSE,
    ],
    dictionary: dictionary::CIA402_CSP,
    reserved,
    inputs: &[],
    outputs: &[],
    analog_outputs: &[],
    captures: &[],
    homing_methods: &[],
    make: Make::Drive(Setpoints::Positions, |model, settings| {
        Box::new(Cia402Csp::new(model, settings))
    }),
};

const MODE: Assumption = Assumption {
    name: "mode",
    default: CYCLIC_SYNCHRONOUS_POSITION,
    allowed: INTERPOLATED_POSITION..=CYCLIC_SYNCHRONOUS_POSITION,
    meaning: "6060h, the operating mode: 8, Cyclic Synchronous Position, or 7, Interpolated Position",
};

const ENCODER_INCREMENTS: Assumption = Assumption {
    name: "encoder_increments",
    default: 1_048_576,
    allowed: 1..=1 << 30,
    meaning: "increments for each motor revolution: what 608Fh:1 has to read, with 608Fh:2 = 1",
};

const HAS_RESOLUTION: Assumption = Assumption {
    name: "has_resolution",
    default: 1,
    allowed: 0..=1,
    meaning: "1: it has 608Fh and 6091h, which are read; 0: it has neither, and counts as encoder_increments says",
};

const HAS_PERIOD: Assumption = Assumption {
    name: "has_period",
    default: 1,
    allowed: 0..=1,
    meaning: "1: 60C2h is set to the cycle; 0: it has no such object, and goes by the time between two SYNCs",
};

const TELLS_FOLLOWING: Assumption = Assumption {
    name: "tells_following",
    default: 1,
    allowed: 0..=1,
    meaning: "1: statusword bit 12 says that it follows; 0: it leaves the bit off, and follows while it is enabled",
};

const VENDOR_ID: Assumption = Assumption {
    name: "vendor_id",
    default: 0,
    allowed: 0..=u32::MAX,
    meaning: "what 1018h:1 has to read; 0: whatever it reads",
};

const PRODUCT_CODE: Assumption = Assumption {
    name: "product_code",
    default: 0,
    allowed: 0..=u32::MAX,
    meaning: "what 1018h:2 has to read; 0: whatever it reads",
};

const PDOS: Assumption = Assumption {
    name: "pdos",
    default: 4,
    allowed: 1..=4,
    meaning: "PDOs that the drive has in each direction; those without use are switched off",
};

const R_PDO: Assumption = Assumption {
    name: "r_pdo",
    default: 1,
    allowed: 1..=4,
    meaning: "number of the R_PDO that brings controlword and target position",
};

const T_PDO: Assumption = Assumption {
    name: "t_pdo",
    default: 1,
    allowed: 1..=4,
    meaning: "number of the T_PDO that brings statusword and actual position",
};

const INTERPOLATED_POSITION: u32 = 7;
const CYCLIC_SYNCHRONOUS_POSITION: u32 = 8;

/// Statusword bit 13 in Cyclic Synchronous Position: the following error is beyond 6065h.
const FOLLOWING_ERROR: u16 = Statusword::BIT_13;

/// What tells a drive that does as this file says.
fn identity(assumed: &Assumed) -> Vec<Identity> {
    let reads = Identity::new;
    // Bit 0 of 6502h is mode 1.
    let mode = 1 << (assumed.value(&MODE) - 1);
    // What stands above CiA 402 tells a servo from other drives.
    let mut identity = vec![reads(0x1000, 0, "device type", 402).in_bits(0xFFFF)];
    for (sub, name, assumption) in [
        (1, "vendor ID", &VENDOR_ID),
        (2, "product code", &PRODUCT_CODE),
    ] {
        let value = assumed.value(assumption);
        identity.extend((value != 0).then(|| reads(0x1018, sub, name, value)));
    }
    identity.push(reads(0x6502, 0, "supported drive modes", mode).in_bits(mode));
    if assumed.value(&HAS_RESOLUTION) != 0 {
        let encoder_increments = assumed.value(&ENCODER_INCREMENTS);
        identity.extend([
            reads(0x608F, 1, "encoder increments", encoder_increments),
            reads(0x608F, 2, "motor revolutions", 1),
            reads(0x6091, 1, "gear ratio, motor shaft", 1),
            reads(0x6091, 2, "gear ratio, driving shaft", 1),
        ]);
    }
    identity
}

/// One drive.
#[derive(Clone, Debug)]
struct Cia402Csp {
    spec: NodeSpec,
    interpolation_delay: u32,
    is_interpolated: bool,
    tells_following: bool,
}

/// The number of a PDO, 1…4.
fn number(assumed: &Assumed, assumption: &Assumption) -> u8 {
    assumed.value(assumption) as u8
}

impl Cia402Csp {
    fn new(model: &'static Model, settings: &Settings) -> Self {
        let (node, assumed) = (settings.node, &settings.assumed);
        let (r_pdo, t_pdo) = (number(assumed, &R_PDO), number(assumed, &T_PDO));
        let setup = setup(settings, r_pdo, t_pdo);
        Self {
            spec: NodeSpec {
                identity: identity(assumed),
                history: cia402::HISTORY.to_vec(),
                // Statusword and actual position.
                t_pdos: vec![communication::t_pdo(t_pdo, node, 6)],
                // Controlword and target position.
                r_pdos: vec![communication::r_pdo(r_pdo, node, 6)],
                ..NodeSpec::new(model, settings, setup, cia402::is_command)
            },
            interpolation_delay: assumed.value(&INTERPOLATION_DELAY),
            is_interpolated: assumed.value(&MODE) == INTERPOLATED_POSITION,
            tells_following: assumed.value(&TELLS_FOLLOWING) != 0,
        }
    }
}

/// Every PDO off; mode, cycle and limits; the two that are used mapped, and on.
fn setup(settings: &Settings, r_pdo: u8, t_pdo: u8) -> Vec<Write> {
    let Settings {
        node,
        cycle,
        assumed,
        ..
    } = settings;
    let w = Write::new;
    let pdos = number(assumed, &PDOS);
    let r_pdo_word = |n| CobIdWord::valid(CobId::r_pdo(n, *node)).0;
    // Not to be asked for by remote requests, which many devices do not know.
    let t_pdo_word = |n| CobIdWord::valid(CobId::t_pdo(n, *node)).0 | CobIdWord::NO_RTR;
    let off = |word| Data::u32(word | CobIdWord::INVALID);

    let mut setup = Vec::new();
    for n in 1..=pdos.max(r_pdo) {
        setup.push(w(parameter(0x1400, n), 1, off(r_pdo_word(n))));
    }
    for n in 1..=pdos.max(t_pdo) {
        setup.push(w(parameter(0x1800, n), 1, off(t_pdo_word(n))));
    }
    setup.push(w(0x6040, 0, Data::u16(0)));
    setup.push(w(0x6040, 0, Data::u16(0x80))); // Fault Reset
    setup.push(w(0x6060, 0, Data::u8(assumed.value(&MODE) as u8)));
    if assumed.value(&HAS_PERIOD) != 0 {
        let (mantissa, exponent) = interpolation_period(*cycle);
        setup.push(w(0x60C2, 1, Data::u8(mantissa)));
        setup.push(w(0x60C2, 2, Data::u8(exponent as u8)));
    }
    setup.extend(cia402::limits(settings));
    setup.extend(&settings.objects);
    let target = match assumed.value(&MODE) {
        INTERPOLATED_POSITION => 0x60C1_0120,
        _ => 0x607A_0020,
    };
    for (from, n, mapped) in [
        (0x1600, r_pdo, [0x6040_0010, target]),
        (0x1A00, t_pdo, [0x6041_0010, 0x6064_0020]),
    ] {
        let index = parameter(from, n);
        setup.push(w(index, 0, Data::u8(0)));
        setup.push(w(index, 1, Data::u32(mapped[0])));
        setup.push(w(index, 2, Data::u32(mapped[1])));
        setup.push(w(index, 0, Data::u8(2)));
    }
    let (receive, transmit) = (parameter(0x1400, r_pdo), parameter(0x1800, t_pdo));
    setup.push(w(receive, 2, Data::u8(1))); // at every SYNC
    setup.push(w(transmit, 2, Data::u8(1)));
    setup.push(w(receive, 1, Data::u32(r_pdo_word(r_pdo))));
    setup.push(w(transmit, 1, Data::u32(t_pdo_word(t_pdo))));
    setup.extend(communication::heartbeats(&settings.heartbeat));
    setup
}

/// The index of PDO `n`'s object in the block that begins with PDO 1's.
const fn parameter(first: u16, n: u8) -> u16 {
    first + n as u16 - 1
}

/// 60C2h, mantissa and power of ten in seconds: of a whole millisecond -3, which every drive knows,
/// otherwise -4. A cycle that [`Model::takes_cycle`] takes fits.
fn interpolation_period(cycle: Duration) -> (u8, i8) {
    let tenths = cycle.as_micros() / 100;
    if tenths.is_multiple_of(10) {
        ((tenths / 10) as u8, -3)
    } else {
        (tenths as u8, -4)
    }
}

/// The communication profile, the words of the state machine, mode, cycle and scaling are the
/// controller's; tuning is the user's.
fn reserved(Address { index, .. }: Address) -> bool {
    matches!(
        index,
        0x1000
            ..=0x1FFF
                | 0x6040
                | 0x6060
                | 0x6065
                | 0x607A
                | 0x607D
                | 0x608F
                | 0x6091
                | 0x60C1
                | 0x60C2
    )
}

/// What the bytes of its EMCY mean is the maker's affair, and nobody knows who that is.
impl RemoteNode for Cia402Csp {
    fn spec(&self) -> &NodeSpec {
        &self.spec
    }
}

impl Feedback for Cia402Csp {
    fn sample(&self, _: usize, data: &[u8]) -> Option<Sample> {
        cia402::sample(data)
    }

    fn in_motion(&self, position: Increments) -> Vec<Frame> {
        let data = cia402::in_motion(position);
        vec![Frame::new(self.spec.t_pdos[0].cob_id, &data)]
    }
}

impl Drive for Cia402Csp {
    fn clone_box(&self) -> Box<dyn Drive> {
        Box::new(self.clone())
    }

    fn survey(&self) -> Option<Survey> {
        Some(cia402::SURVEY)
    }

    fn mode(&self) -> Option<ModeDisplay> {
        Some(cia402::shows(match self.is_interpolated {
            true => INTERPOLATED_POSITION as i8,
            false => CYCLIC_SYNCHRONOUS_POSITION as i8,
        }))
    }

    fn ends_mode(&self) -> bool {
        self.is_interpolated && self.tells_following
    }

    fn latency(&self) -> f64 {
        self.interpolation_delay.into()
    }

    fn status(&mut self, _: usize, data: &[u8]) -> Option<DriveStatus> {
        let error = (!self.is_interpolated).then_some(FOLLOWING_ERROR);
        let status = cia402::status(data, error)?;
        let enabled = status.power == PowerState::Enabled;
        Some(DriveStatus {
            mode_runs: status.mode_runs || enabled && !self.tells_following,
            ..status
        })
    }

    fn encode(&mut self, command: PowerCommand, setpoint: Setpoint, frames: &mut [Frame]) {
        let start = match self.is_interpolated {
            true => Controlword::MODE_4,
            false => 0,
        };
        let data = cia402::to_position(cia402::controlword(command, start), setpoint.position);
        frames[0] = Frame::new(self.spec.r_pdos[0].cob_id, &data);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{NotFollowing, OutOfRange};
    use super::*;
    use syncline_canopen::NodeId;

    fn csp(settings: &Settings) -> Cia402Csp {
        Cia402Csp::new(&CIA402_CSP, settings)
    }

    fn settings(cycle_us: u64, assumed: &[(&'static str, u32)]) -> Settings {
        let (node, cycle) = (NodeId::new(3).unwrap(), Duration::from_micros(cycle_us));
        Settings {
            assumed: Assumed(assumed.to_vec()),
            ..Settings::new(node, cycle)
        }
    }

    /// As a table: `index:sub bytes value`, hexadecimal.
    fn writes(drive: &Cia402Csp) -> Vec<String> {
        let row = |write: &Write| {
            let Address { index, sub } = write.address;
            let (len, bits) = (write.data.bytes().len(), write.data.bits());
            format!("{index:04X}:{sub:X} {len} {bits:X}")
        };
        drive.spec().setup.iter().map(row).collect()
    }

    #[test]
    fn the_set_up_write_for_write() {
        let drive = csp(&settings(2000, &[]));
        let expected = "
            1400:1 4 80000203, 1401:1 4 80000303, 1402:1 4 80000403, 1403:1 4 80000503,
            1800:1 4 C0000183, 1801:1 4 C0000283, 1802:1 4 C0000383, 1803:1 4 C0000483,
            6040:0 2 0, 6040:0 2 80, 6060:0 1 8, 60C2:1 1 2, 60C2:2 1 FD,
            1600:0 1 0, 1600:1 4 60400010, 1600:2 4 607A0020, 1600:0 1 2,
            1A00:0 1 0, 1A00:1 4 60410010, 1A00:2 4 60640020, 1A00:0 1 2,
            1400:2 1 1, 1800:2 1 1, 1400:1 4 203, 1800:1 4 40000183,
            1017:0 2 64, 1016:1 4 7F00FA";
        let expected: Vec<&str> = expected.split(',').map(str::trim).collect();
        assert_eq!(writes(&drive), expected);
    }

    #[test]
    fn limits_and_own_objects_come_while_the_pdos_are_off() {
        let own = Write::new(0x6085, 0, Data::u32(5));
        let drive = csp(&Settings {
            following_error_limit: Some(Increments::new(26_214)),
            soft_limits: Some((Increments::new(-10), Increments::new(5_000_000_000))),
            objects: vec![own],
            ..settings(2000, &[])
        });
        assert_eq!(
            drive.spec().setup[13..17],
            [
                Write::new(0x6065, 0, Data::u32(26_214)),
                Write::new(0x607D, 1, Data::i32(-10)),
                Write::new(0x607D, 2, Data::i32(i32::MAX)),
                own,
            ]
        );
    }

    #[test]
    fn pdos_have_the_numbers_that_the_machine_file_says() {
        let drive = csp(&settings(2000, &[("r_pdo", 4), ("t_pdo", 2), ("pdos", 1)]));
        assert_eq!(drive.spec().r_pdos[0].cob_id.get(), 0x503);
        assert_eq!(drive.spec().t_pdos[0].cob_id.get(), 0x283);
        let writes = writes(&drive);
        let count = |object: &str| writes.iter().filter(|row| row.starts_with(object)).count();
        // Those below are switched off, those above the drive does not have.
        assert_eq!([count("1402:1"), count("1403:1")], [1, 2]);
        assert_eq!([count("1801:1"), count("1802:1")], [2, 0]);
        assert!(writes.contains(&"1403:1 4 503".into()));
        assert!(writes.contains(&"1603:2 4 607A0020".into()));
        assert!(writes.contains(&"1A01:2 4 60640020".into()));
        assert!(writes.contains(&"1801:1 4 40000283".into()));
    }

    #[test]
    fn the_period_is_a_mantissa_and_a_power_of_ten() {
        for (micros, expected) in [
            (500, (5, -4)),
            (1000, (1, -3)),
            (1500, (15, -4)),
            (2000, (2, -3)),
            (10_000, (10, -3)),
            (19_500, (195, -4)),
            (20_000, (20, -3)),
        ] {
            let cycle = Duration::from_micros(micros);
            assert!(CIA402_CSP.takes_cycle(cycle));
            assert_eq!(interpolation_period(cycle), expected, "{micros} µs");
        }
        for micros in [250, 750, 20_500] {
            assert!(!CIA402_CSP.takes_cycle(Duration::from_micros(micros)));
        }
    }

    #[test]
    fn what_a_revolution_counts_is_the_machine_files() {
        let assumed = [("encoder_increments", 10_000)];
        let drive = csp(&settings(2000, &assumed));
        let expects = |index, sub| {
            let mut identity = drive.spec().identity.iter();
            let found = identity.find(|it| it.address == Address::new(index, sub));
            found.map(|it| it.value)
        };
        assert_eq!(expects(0x608F, 1), Some(10_000));
        assert_eq!(expects(0x6091, 1), Some(1));
        let counts = CIA402_CSP.increments_per_revolution;
        assert_eq!(counts(&Assumed(assumed.to_vec())), 10_000);
        assert_eq!(counts(&Assumed::default()), 1_048_576);
    }

    #[test]
    fn what_a_drive_does_not_have_is_left_alone() {
        let drive = csp(&settings(
            2000,
            &[("has_resolution", 0), ("has_period", 0), ("vendor_id", 7)],
        ));
        let identity = drive.spec().identity.iter();
        let read: Vec<_> = identity.map(|it| it.address.to_string()).collect();
        assert_eq!(read, ["1000h:0", "1018h:1", "6502h:0"]);
        assert!(!writes(&drive).iter().any(|row| row.starts_with("60C2")));
    }

    #[test]
    fn a_drive_that_leaves_bit_12_off_follows_while_it_is_enabled() {
        let mut drive = csp(&settings(2000, &[("tells_following", 0)]));
        let mut runs = |word: u16| {
            let status = drive.status(0, &word.to_le_bytes()).unwrap();
            status.mode_runs
        };
        assert_eq!(
            [0x0237, 0x0231, 0x0218].map(&mut runs),
            [true, false, false]
        );
    }

    #[test]
    fn in_interpolated_position_it_is_started_and_ends() {
        let mut drive = csp(&settings(2000, &[("mode", 7)]));
        let writes = writes(&drive);
        for row in ["6060:0 1 7", "1600:2 4 60C10120"] {
            assert!(writes.contains(&row.into()), "{row}");
        }
        let mut modes = drive.spec().identity.iter();
        let modes = modes.find(|it| it.address.index == 0x6502).unwrap();
        assert_eq!((modes.mask, modes.value), (0x40, 0x40));
        assert_eq!(drive.mode().unwrap().mode, 7);
        assert!(drive.ends_mode());
        let mut frames = [Frame::new(CobId::SYNC, &[])];
        for (command, expected) in [
            (PowerCommand::Enable, "203#0F00FEFFFFFF"),
            (PowerCommand::Run, "203#1F00FEFFFFFF"),
            (PowerCommand::QuickStop, "203#0B00FEFFFFFF"),
        ] {
            drive.encode(command, Setpoint::at(Increments::new(-2)), &mut frames);
            assert_eq!(format!("{:?}", frames[0]), expected);
        }
        // Bit 13 says nothing in this mode.
        let status = drive.status(0, &0x3237u16.to_le_bytes()).unwrap();
        assert!(status.mode_runs && !status.error);
    }

    #[test]
    fn process_image() {
        let mut drive = csp(&settings(2000, &[]));
        let mut frames = [Frame::new(CobId::SYNC, &[])];
        for (command, position, expected) in [
            (PowerCommand::Disable, 0, "203#000000000000"),
            (PowerCommand::Prepare, 1, "203#060001000000"),
            (PowerCommand::Enable, -2, "203#0F00FEFFFFFF"),
            (PowerCommand::Run, -2, "203#0F00FEFFFFFF"),
            (PowerCommand::QuickStop, -2, "203#0B00FEFFFFFF"),
            (PowerCommand::Run, 1 << 31, "203#0F00FFFFFF7F"),
        ] {
            let position = Increments::new(position);
            drive.encode(command, Setpoint::at(position), &mut frames);
            assert_eq!(format!("{:?}", frames[0]), expected);
        }
        let position = |position| Setpoint::at(Increments::new(position));
        assert_eq!(drive.check(position(-2)), Ok(()));
        assert_eq!(drive.check(position(1 << 31)), Err(OutOfRange));
        let data = [0x37, 0x12, 0x00, 0x00, 0x02, 0x00];
        let sample = drive.sample(0, &data).unwrap();
        assert_eq!(sample.position, Increments::new(131_072));
        assert_eq!(drive.sample(0, &data[..5]), None);
    }

    #[test]
    fn statuswords() {
        use NotFollowing as N;
        let mut drive = csp(&settings(2000, &[]));
        for (word, in_mode, expected) in [
            (0x1237, true, Ok(())),
            (0x0237, false, Ok(())),
            (0x12B7, true, Ok(())), // a warning does not stop
            (0x0237, true, Err(N::ModeEnded)),
            (0x1037, true, Err(N::NotRemote)),
            (0x3237, true, Err(N::Error)),
            (0x0217, true, Err(N::QuickStop)),
            (0x0231, true, Err(N::PowerStageOff)),
            (0x0218, true, Err(N::Fault)),
            (0x021F, true, Err(N::Fault)),
        ] {
            let status = drive.status(0, &u16::to_le_bytes(word)).unwrap();
            assert_eq!(status.follows(in_mode), expected, "{word:04X}");
        }
        // Off, bit 13 is no following error.
        let status = drive.status(0, &0x2231u16.to_le_bytes()).unwrap();
        assert!(!status.error);
    }
}
