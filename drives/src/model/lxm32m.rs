//! Schneider LXM32M with CANopen module, in operating mode Interpolated Position.
//!
//! Numbers in parentheses are lines of the fieldbus manual 0198441113789.06.

use super::capture::CAPTURE_JITTER;
use super::profile::cia402::{self, INTERPOLATION_DELAY};
use super::profile::communication::{self, SDO_RESPONSE, T_PDO_RESPONSE};
use super::{
    Ability, Address, Assumption, CaptureInput, ClockLock, Data, Drive, DriveStatus, Feedback,
    Identity, Increments, IndexDistance, Io, LoopGains, Make, ModeDisplay, Model, NODES, NodeSpec,
    OwnHoming, PowerCommand, RemoteNode, Sample, Setpoint, Setpoints, Settings, Survey,
    TorqueLimit, Write,
};
use crate::dictionary::{self, lxm32m_units as units};
use core::time::Duration;
use syncline_canopen::{
    CobId, Frame, NodeId,
    cia402::{Controlword, Statusword},
    pdo::CobIdWord,
};

/// The LXM32M.
///
/// Assumed, as the manual at hand does not say: cycles of 1…20 ms in whole milliseconds.
pub(super) static LXM32M: Model = Model {
    name: "lxm32m",
    title: "LXM32M",
    maker: Some("Schneider Electric"),
    bitrates: &[50_000, 125_000, 250_000, 500_000, 1_000_000], // (1266, 1279)
    nodes: NODES,
    cycle_step: Duration::from_millis(1),
    cycles: Duration::from_millis(1)..=Duration::from_millis(20),
    increments_per_revolution: |_| REVOLUTION,
    positions: Increments::MIN..=Increments::MAX,
    abilities: &[
        Ability::CountsWithinTurn,
        Ability::FollowingErrorLimit,
        Ability::SoftLimits,
        Ability::Torque,
    ],
    generic: None,
    r_pdo_values: &[],
    assumptions: &[&[
        INTERPOLATION_DELAY,
        SYNC_LOCKED,
        CAPTURE_JITTER,
        SPEED_UNITS,
        T_PDO_RESPONSE,
        SDO_RESPONSE,
    ]],
    choices: &[],
    dictionary: dictionary::LXM32M,
    reserved,
    inputs: &INPUTS,
    outputs: &OUTPUTS,
    analog_inputs: &[],
    analog_outputs: &[],
    captures: &CAPTURES,
    homing_methods: &HOMING_METHODS,
    torque_limit: Some(TORQUE_LIMIT),
    make: Make::Drive(Setpoints::Positions, |_, settings| {
        Box::new(Lxm32m::new(settings))
    }),
};

/// Taken by the drive family's wider documentation; not in the fieldbus manual.
const SYNC_LOCKED: Assumption = Assumption {
    name: "sync_locked",
    default: 64,
    allowed: 0..=65_535,
    meaning: "value of SyncMechStatus (3022h:6) once the drive's clock follows SYNC",
};

/// A gain that its object holds less exactly than by this part is another one.
const ROUNDED: f64 = 0.03;

/// `SyncMechTol` (3022h:4, 2579) is set to 1 (1635). Of what, the manual at hand does not say: assumed to be
/// a quarter of a millisecond.
const SYNC_TOLERANCE: Duration = Duration::from_micros(250);

/// The scaling of usr_v, in which 6099h is told speeds, the manual at hand does not have.
const SPEED_UNITS: Assumption = Assumption {
    name: "speed_units",
    default: 1,
    allowed: 1..=10_000,
    meaning: "usr_v that are a revolution a minute, in which a homing of its own is told its speeds",
};

const HOMING: i8 = 6;
const INTERPOLATED_POSITION: i8 = 7;

/// `HMmethod` (1676): to a limit switch or the reference switch, with the index pulse or without; to the index pulse;
/// where it stands.
const HOMING_METHODS: [u8; 23] = [
    1, 2, 7, 8, 9, 10, 11, 12, 13, 14, 17, 18, 23, 24, 25, 26, 27, 28, 29, 30, 33, 34, 35,
];

/// Increments of the motor in a revolution (1602).
const REVOLUTION: u32 = 131_072;

/// `_IO_act` (3008h:1) shows the physical state of inputs and outputs (2303); which bit is which it
/// does not say. Assumed: bits 0…7 are inputs, bits 8…15 outputs, from the first one on.
const INPUTS: [&str; 6] = ["DI0", "DI1", "DI2", "DI3", "DI4", "DI5"];

/// `TouchProbeFct` and what belongs to it (2931-2936) as CiA 402 has it. Which inputs the captures see the manual does
/// not say. Assumed: from the first one on.
static CAPTURES: [CaptureInput; 2] = [cia402::touch_probe(0, 0), cia402::touch_probe(1, 1)];

/// `CTRL_I_max` (2416) limits the current, of which `_M_I_0` (2390) brings the continuous stall torque. The manual at hand
/// has units of neither. Assumed: that both count alike, and that 0 leaves the drive's own limit.
const TORQUE_LIMIT: TorqueLimit = TorqueLimit {
    limit: Address::new(0x3011, 0x0C),
    continuous: Address::new(0x300D, 0x13),
};

/// `IO_DQ_set` (3008h:11) sets outputs directly (2310), those whose function `IOfunc_DQn` (3007h:9…B,
/// 2300-2302) is [`FREE`]; which bit is which the manual does not say. Assumed: from the first one on.
const OUTPUTS: [&str; 3] = ["DQ0", "DQ1", "DQ2"];

/// The function of an output that nothing but `IO_DQ_set` sets; the manual at hand has no table of its
/// values. Assumed.
const FREE: u16 = 1;

/// Controlword bit that starts Interpolated Position on top of Enable Operation (1641).
const START_MODE: u16 = Controlword::MODE_4;

const IDENTITY: [Identity; 2] = [
    Identity::new(0x1000, 0, "device type", 0x0042_0192), // (2947-2973)
    Identity::new(0x1018, 1, "vendor id", 0x0800_005A),   // (3348-3354)
];

/// Statusword bit 13, `x_err`: counts only in Operation Enabled, as the manual's own examples show it
/// set at rest in state 4 (1343, 1755).
const X_ERR: u16 = Statusword::BIT_13;
/// The movement of a mode is over, whatever came of it (1347).
const X_END: u16 = Statusword::BIT_14;
/// The zero point is valid (1351).
const REF_OK: u16 = Statusword::BIT_15;

/// The number of the T_PDO that tells the torque, where that is asked for, and its place behind the other one.
const TORQUE_PDO: u8 = 3;
const TORQUE_PLACE: usize = 1;

/// Bytes of a PDO that carries signals behind word and position.
const WITH_SIGNALS: u8 = 8;

/// One LXM32M.
#[derive(Clone, Debug)]
struct Lxm32m {
    spec: NodeSpec,
    interpolation_delay: u32,
    speed_units: u32,
    outputs: u16,
}

impl Lxm32m {
    fn new(settings: &Settings) -> Self {
        let node = settings.node;
        let mut setup = standard_setup(node, settings.cycle).to_vec();
        if settings.io.tells() {
            map_third(&mut setup, 0x1A01, 0x3008_0110);
        }
        if settings.io.outputs != 0 {
            map_third(&mut setup, 0x1601, 0x3008_1110);
        }
        if settings.torque {
            setup.extend(torque_setup(node));
        }
        // MON_p_dif_load (2909), in position units as CiA 402 has it; MON_swLimN, MON_swLimP (2919, 2920).
        setup.extend(cia402::limits(settings));
        setup.extend(&settings.objects);
        let set = (0..OUTPUTS.len() as u8).filter(|output| settings.io.outputs >> output & 1 != 0);
        setup.extend(set.map(|output| Write::new(0x3007, 0x09 + output, Data::u16(FREE))));
        // Heartbeats both ways (3282-3320).
        setup.extend(communication::heartbeats(&settings.heartbeat));

        let bytes = |signals| if signals { WITH_SIGNALS } else { 6 };
        Self {
            spec: NodeSpec {
                identity: IDENTITY.to_vec(),
                // Motor type and encoder type (2372-2373): 1018h has no serial number (3340).
                marks: [2, 3].map(|sub| Some(Address::new(0x300D, sub))),
                history: cia402::HISTORY.to_vec(), // (2900, 3000, 3035)
                clock_lock: Some(ClockLock {
                    address: Address::new(0x3022, 6),
                    locked: settings.assumed.value(&SYNC_LOCKED),
                    tolerance: SYNC_TOLERANCE,
                    assumption: SYNC_LOCKED.name,
                }),
                capture_jitter: settings.assumed.time(&CAPTURE_JITTER),
                // SyncMechStart = 0: the synchronisation mechanism is off (1636, 2580).
                release: vec![Write::new(0x3022, 5, Data::u16(0))],
                // Statusword and position (1620-1625), and signals; and the torque.
                t_pdos: [
                    Some(communication::t_pdo(2, node, bytes(settings.io.tells()))),
                    (settings.torque).then(|| communication::t_pdo(TORQUE_PDO, node, 2)),
                ]
                .into_iter()
                .flatten()
                .collect(),
                // Controlword and setpoint, and outputs.
                r_pdos: vec![communication::r_pdo(
                    2,
                    node,
                    bytes(settings.io.outputs != 0),
                )],
                ..NodeSpec::new(&LXM32M, settings, setup, cia402::is_command)
            },
            interpolation_delay: settings.assumed.value(&INTERPOLATION_DELAY),
            speed_units: settings.assumed.value(&SPEED_UNITS),
            outputs: 0,
        }
    }

    fn tells_signals(&self) -> bool {
        self.spec.t_pdos[0].bytes == WITH_SIGNALS
    }

    fn sets_outputs(&self) -> bool {
        self.spec.r_pdos[0].bytes == WITH_SIGNALS
    }
}

/// The initialisation sequence of Interpolated Position in its printed order (1604-1636), with
/// the node id and the cycle put in.
fn standard_setup(node: NodeId, cycle: Duration) -> [Write; 30] {
    let cob_id = |active: bool, cob_id: CobId| {
        let word = if active {
            CobIdWord::valid
        } else {
            CobIdWord::invalid
        };
        Data::u32(word(cob_id).0)
    };
    let r_pdo = |n, active| cob_id(active, CobId::r_pdo(n, node));
    let t_pdo = |n, active| cob_id(active, CobId::t_pdo(n, node));
    let cycle_ms = cycle.as_millis() as u8; // 1…20, as Model::takes_cycle has it
    let w = Write::new;
    [
        w(0x1400, 1, r_pdo(1, false)),
        w(0x1800, 1, t_pdo(1, false)),
        w(0x1401, 1, r_pdo(2, true)),
        w(0x1801, 1, t_pdo(2, true)),
        w(0x1402, 1, r_pdo(3, false)),
        w(0x1802, 1, t_pdo(3, false)),
        w(0x1403, 1, r_pdo(4, false)),
        w(0x1803, 1, t_pdo(4, false)),
        w(0x1401, 2, Data::u8(1)), // at every SYNC
        w(0x1801, 2, Data::u8(1)),
        cia402::FAULT_RESET[0],
        cia402::FAULT_RESET[1],
        w(0x1601, 0, Data::u8(0)),
        w(0x1601, 1, Data::u32(0x6040_0010)),
        w(0x1601, 2, Data::u32(0x60C1_0120)),
        w(0x1601, 0, Data::u8(2)),
        w(0x1A01, 0, Data::u8(0)),
        w(0x1A01, 1, Data::u32(0x6041_0010)),
        w(0x1A01, 2, Data::u32(0x6064_0020)),
        w(0x1A01, 0, Data::u8(2)),
        w(0x3006, 0x07, Data::u32(REVOLUTION)), // position scaling: denominator …
        w(0x3006, 0x08, Data::u32(1)),          // … and numerator
        w(0x6060, 0, Data::u8(INTERPOLATED_POSITION as u8)),
        w(0x3006, 0x3D, Data::u16(1)), // "for compatibility" (1630)
        w(0x60C2, 1, Data::u8(cycle_ms)),
        w(0x3012, 6, Data::u16(1000)), // velocity feed-forward 100 %, both parameter sets
        w(0x3013, 6, Data::u16(1000)),
        w(0x3006, 0x06, Data::u16(1)), // no error for an active limit switch at enabling
        w(0x3022, 4, Data::u16(1)),    // SyncMechTol
        w(0x3022, 5, Data::u16(2)),    // SyncMechStart
    ]
}

/// Has a T_PDO of its own tell the torque at every SYNC: in the one with the position there may be no room.
fn torque_setup(node: NodeId) -> [Write; 5] {
    let w = Write::new;
    let cob_id = CobIdWord::valid(CobId::t_pdo(TORQUE_PDO, node)).0;
    [
        w(0x1A02, 0, Data::u8(0)),
        w(0x1A02, 1, Data::u32(0x6077_0010)), // _tq_act (2917)
        w(0x1A02, 0, Data::u8(1)),
        w(0x1802, 2, Data::u8(1)), // at every SYNC
        w(0x1802, 1, Data::u32(cob_id)),
    ]
}

/// Maps an object behind the two that a PDO has.
fn map_third(setup: &mut Vec<Write>, mapping: u16, object: u32) {
    let two_mapped = Write::new(mapping, 0, Data::u8(2));
    if let Some(place) = setup.iter().position(|write| *write == two_mapped) {
        let third = Write::new(mapping, 3, Data::u32(object));
        setup.splice(place..=place, [third, Write::new(mapping, 0, Data::u8(3))]);
    }
}

/// The communication profile, the words of the state machine, mode, cycle, scaling and
/// synchronisation are the controller's; tuning is the user's.
fn reserved(Address { index, sub }: Address) -> bool {
    matches!(
        (index, sub),
        (0x1000..=0x1FFF, _)
            | (
                0x6040 | 0x6060 | 0x6065 | 0x607D | 0x60B8 | 0x60C1 | 0x60C2,
                _
            )
            | (0x3006, 0x07 | 0x08 | 0x3D)
            | (0x3022, 5)
    )
}

impl RemoteNode for Lxm32m {
    fn spec(&self) -> &NodeSpec {
        &self.spec
    }

    /// Bytes 6 and 7 are 603Fh. The manual at hand has no table of its values (1953); what is known
    /// is from the vendor's public answer FAQ000270642.
    fn vendor_error(&self, [_, _, _, low, high]: [u8; 5]) -> Option<String> {
        let error = u16::from_le_bytes([low, high]);
        let meaning = match error {
            0xB404 => ": SYNC signal: missing more than twice, or its period deviates",
            _ => "",
        };
        Some(format!("vendor error {error:04X}h{meaning}"))
    }
}

impl Io for Lxm32m {
    fn signals(&self, _: usize, data: &[u8]) -> Option<u32> {
        let &[_, _, _, _, _, _, inputs, outputs] = data else {
            return None;
        };
        let kept = |byte: u8, names: &[&str]| u32::from(byte) & ((1 << names.len()) - 1);
        Some(kept(inputs, &INPUTS) | kept(outputs, &OUTPUTS) << INPUTS.len())
    }

    fn set_outputs(&mut self, on: u32) {
        self.outputs = on as u16;
    }

    fn write(&self, write: &mut dyn FnMut(Write)) {
        if self.sets_outputs() {
            write(Write::new(0x3008, 0x11, Data::u16(self.outputs)));
        }
    }
}

impl Feedback for Lxm32m {
    fn sample(&self, _: usize, data: &[u8]) -> Option<Sample> {
        // The torque's is too short for a position.
        cia402::sample(data)
    }

    fn in_motion(&self, position: Increments) -> Vec<Frame> {
        let mut data = cia402::in_motion(position).to_vec();
        let t_pdo = &self.spec.t_pdos[0];
        data.resize(t_pdo.bytes.into(), 0);
        let torque = self.spec.t_pdos.get(TORQUE_PLACE);
        let torque = torque.map(|t_pdo| Frame::new(t_pdo.cob_id, &[0; 2]));
        [Some(Frame::new(t_pdo.cob_id, &data)), torque]
            .into_iter()
            .flatten()
            .collect()
    }
}

impl Drive for Lxm32m {
    fn clone_box(&self) -> Box<dyn Drive> {
        Box::new(self.clone())
    }

    fn survey(&self) -> Option<Survey> {
        Some(cia402::SURVEY)
    }

    fn mode(&self) -> Option<ModeDisplay> {
        Some(cia402::shows(INTERPOLATED_POSITION))
    }

    /// Statusword bit 12 follows controlword bit 4 (1641, 1650).
    fn ends_mode(&self) -> bool {
        true
    }

    fn latency(&self) -> f64 {
        self.interpolation_delay.into()
    }

    /// In the order of the manual's example (1820-1829). Position 0 is at the reference point (3028h:B, 2615; of method
    /// 35 301Bh:16, 2481).
    fn homing(&self, method: u8, speeds: [f64; 2]) -> Option<OwnHoming> {
        let [search, slow] = speeds.map(|speed| {
            let rpm = 60.0 * speed / f64::from(REVOLUTION);
            let units = (rpm * f64::from(self.speed_units)).round();
            Data::u32(units.max(1.0) as u32)
        });
        Some(OwnHoming {
            begin: [
                Write::new(0x6099, 1, search),
                Write::new(0x6099, 2, slow),
                Write::new(0x3028, 0x0B, Data::i32(0)),
                Write::new(0x301B, 0x16, Data::i32(0)),
                Write::new(0x6098, 0, Data::u8(method)),
                Write::new(0x6060, 0, Data::u8(HOMING as u8)),
            ],
            mode: cia402::shows(HOMING),
            end: Write::new(0x6060, 0, Data::u8(INTERPOLATED_POSITION as u8)),
            // In usr_p (2618), which are increments.
            index: matches!(method, 1..=14).then_some(IndexDistance {
                object: Address::new(0x3028, 0x0F),
                turn: Increments::new(REVOLUTION as i64),
            }),
        })
    }

    /// `CTRL1_KPn`, `CTRL1_TNn`, `CTRL1_KPp` (2438-2440).
    fn tuning(&self, gains: &LoopGains) -> Vec<Write> {
        let scaled = [
            gains.speed / units::SPEED_GAIN * units::RPM,
            gains.integral_time / units::TIME,
            gains.position / units::POSITION_GAIN,
        ];
        let fit =
            |it: &f64| it.round() <= f64::from(u16::MAX) && (it.round() / it - 1.0).abs() < ROUNDED;
        if !scaled.iter().all(fit) {
            return Vec::new();
        }
        let subs = 1..;
        let write =
            |(sub, value): (u8, f64)| Write::new(0x3012, sub, Data::u16(value.round() as u16));
        subs.zip(scaled).map(write).collect()
    }

    fn io(&self) -> Option<&dyn Io> {
        (self.tells_signals() || self.sets_outputs()).then_some(self)
    }

    fn io_mut(&mut self) -> Option<&mut dyn Io> {
        self.sets_outputs().then_some(self)
    }

    fn status(&mut self, t_pdo: usize, data: &[u8]) -> Option<DriveStatus> {
        let (&[s0, s1, ..], true) = (data, t_pdo != TORQUE_PLACE) else {
            return None;
        };
        let statusword = Statusword(u16::from_le_bytes([s0, s1]));
        Some(DriveStatus {
            homing_over: statusword.has(X_END),
            is_homed: statusword.has(REF_OK),
            ..cia402::status(data, Some(X_ERR))?
        })
    }

    /// In 0.1 % of the stall torque `_M_M_0`. That is said of 6071h (1492); assumed of 6077h likewise.
    fn torque(&self, t_pdo: usize, data: &[u8]) -> Option<i16> {
        let (&[low, high], TORQUE_PLACE) = (data, t_pdo) else {
            return None;
        };
        Some(i16::from_le_bytes([low, high]))
    }

    fn encode(&mut self, command: PowerCommand, setpoint: Setpoint, frames: &mut [Frame]) {
        let controlword = cia402::controlword(command, START_MODE);
        let [c0, c1, p0, p1, p2, p3] = cia402::to_position(controlword, setpoint.position);
        let [o0, o1] = self.outputs.to_le_bytes();
        let data = [c0, c1, p0, p1, p2, p3, o0, o1];
        let r_pdo = &self.spec.r_pdos[0];
        frames[0] = Frame::new(r_pdo.cob_id, &data[..r_pdo.bytes.into()]);
    }
}

#[cfg(test)]
mod tests {
    use super::super::{IoSettings, NotFollowing, OutOfRange};
    use super::*;

    fn settings(node: u8, cycle_ms: u64) -> Settings {
        Settings::new(NodeId::new(node).unwrap(), Duration::from_millis(cycle_ms))
    }

    /// The expedited download that a write becomes on the wire (CiA 301), spelled out here so
    /// that the bytes are compared without any SDO client.
    fn request(write: &Write) -> [u8; 8] {
        let data = write.data.bytes();
        let mut frame = [0; 8];
        frame[0] = 0x23 | (4 - data.len() as u8) << 2;
        frame[1..3].copy_from_slice(&write.address.index.to_le_bytes());
        frame[3] = write.address.sub;
        frame[4..4 + data.len()].copy_from_slice(data);
        frame
    }

    /// (1605-1636), as requests to node 1 at 2 ms.
    const SEQUENCE: &str = "\
        23 00 14 01 01 02 00 80, 23 00 18 01 81 01 00 80, 23 01 14 01 01 03 00 00,
        23 01 18 01 81 02 00 00, 23 02 14 01 01 04 00 80, 23 02 18 01 81 03 00 80,
        23 03 14 01 01 05 00 80, 23 03 18 01 81 04 00 80, 2F 01 14 02 01 00 00 00,
        2F 01 18 02 01 00 00 00, 2B 40 60 00 00 00 00 00, 2B 40 60 00 80 00 00 00,
        2F 01 16 00 00 00 00 00, 23 01 16 01 10 00 40 60, 23 01 16 02 20 01 C1 60,
        2F 01 16 00 02 00 00 00, 2F 01 1A 00 00 00 00 00, 23 01 1A 01 10 00 41 60,
        23 01 1A 02 20 00 64 60, 2F 01 1A 00 02 00 00 00, 23 06 30 07 00 00 02 00,
        23 06 30 08 01 00 00 00, 2F 60 60 00 07 00 00 00, 2B 06 30 3D 01 00 00 00,
        2F C2 60 01 02 00 00 00, 2B 12 30 06 E8 03 00 00, 2B 13 30 06 E8 03 00 00,
        2B 06 30 06 01 00 00 00, 2B 22 30 04 01 00 00 00, 2B 22 30 05 02 00 00 00";

    #[test]
    fn set_up_opens_with_the_manuals_thirty_writes() {
        let expected: Vec<Vec<u8>> = SEQUENCE
            .split(',')
            .map(|row| {
                row.split_whitespace()
                    .map(|byte| u8::from_str_radix(byte, 16).unwrap())
                    .collect()
            })
            .collect();
        let drive = Lxm32m::new(&settings(1, 2));
        let requests: Vec<_> = (drive.spec().setup)
            .iter()
            .map(|write| request(write).to_vec())
            .collect();
        assert_eq!(requests[..30], expected);
        // Heartbeats: the drive's own every 100 ms, the controller's watched for 250 ms.
        assert_eq!(requests[30], [0x2B, 0x17, 0x10, 0, 0x64, 0, 0, 0]);
        assert_eq!(requests[31], [0x23, 0x16, 0x10, 1, 0xFA, 0, 0x7F, 0]);
        assert_eq!(requests.len(), 32);
    }

    #[test]
    fn set_up_takes_node_and_cycle() {
        let drive = Lxm32m::new(&settings(0x7E, 20));
        assert_eq!(drive.spec().setup[0].data, Data::u32(0x8000_027E));
        assert_eq!(drive.spec().setup[3].data, Data::u32(0x0000_02FE));
        assert_eq!(drive.spec().setup[24].data, Data::u8(20));
        assert_eq!(drive.spec().r_pdos[0].cob_id.get(), 0x37E);
        assert_eq!(drive.spec().t_pdos[0].cob_id.get(), 0x2FE);
    }

    #[test]
    fn limits_and_own_objects_follow_the_standard_set_up() {
        let own = Write::new(0x3012, 3, Data::u16(5));
        let drive = Lxm32m::new(&Settings {
            following_error_limit: Some(Increments::new(26_214)),
            soft_limits: Some((Increments::new(-10), Increments::new(5_000_000_000))),
            objects: vec![own],
            ..settings(3, 2)
        });
        assert_eq!(
            drive.spec().setup[30..34],
            [
                Write::new(0x6065, 0, Data::u32(26_214)),
                Write::new(0x607D, 1, Data::i32(-10)),
                Write::new(0x607D, 2, Data::i32(i32::MAX)),
                own,
            ]
        );
    }

    #[test]
    fn gains_are_written_as_their_objects_hold_them() {
        let drive = Lxm32m::new(&settings(1, 2));
        let gains = LoopGains {
            speed: 0.6,
            integral_time: 0.02,
            position: 45.7,
        };
        let written = [(1, 100), (2, 2000), (3, 457)];
        let written = written.map(|(sub, value)| Write::new(0x3012, sub, Data::u16(value)));
        assert_eq!(drive.tuning(&gains), written);
        // A count and a half is none, and more than 65,535 neither.
        for speed in [0.009, 400.0] {
            assert_eq!(drive.tuning(&LoopGains { speed, ..gains }), []);
        }
    }

    #[test]
    fn read_back_expects_the_last_value_of_each_object() {
        let drive = Lxm32m::new(&Settings {
            objects: vec![Write::new(0x3012, 6, Data::u16(900))],
            ..settings(1, 2)
        });
        let expected = |index, sub| {
            let mut found = (drive.spec().read_back)
                .iter()
                .filter(|write| write.address == Address::new(index, sub));
            let value = found.next().map(|write| write.data.bits());
            assert!(found.next().is_none());
            value
        };
        assert_eq!(expected(0x1601, 0), Some(2));
        assert_eq!(expected(0x3012, 6), Some(900));
        assert_eq!(expected(0x6040, 0), None);
        // 30 rows less two controlwords and two mappings opened before they are closed; the user's
        // one replaces another; two heartbeats.
        assert_eq!(drive.spec().read_back.len(), 28);
    }

    #[test]
    fn cob_ids_agree_in_bit_31_and_the_identifier_only() {
        let drive = Lxm32m::new(&settings(1, 2));
        let t_pdo2 = drive.spec().setup[3];
        assert!(drive.spec().agrees(&t_pdo2, &0x4000_0281u32.to_le_bytes()));
        assert!(!drive.spec().agrees(&t_pdo2, &0xC000_0281u32.to_le_bytes()));
        assert!(!drive.spec().agrees(&t_pdo2, &0x4000_0282u32.to_le_bytes()));
        assert!(!drive.spec().agrees(&t_pdo2, &[0x81, 0x02]));
        let cycle = drive.spec().setup[24];
        assert!(drive.spec().agrees(&cycle, &[2]));
        assert!(!drive.spec().agrees(&cycle, &[3]));
        assert!(!drive.spec().agrees(&cycle, &[2, 0, 0, 0, 0]));
    }

    fn at(position: i64) -> Setpoint {
        Setpoint::at(Increments::new(position))
    }

    #[test]
    fn process_image() {
        let mut drive = Lxm32m::new(&settings(1, 2));
        let mut frames = [Frame::new(CobId::SYNC, &[])];
        for (command, position, expected) in [
            (PowerCommand::Disable, 0, "301#000000000000"),
            (PowerCommand::Prepare, 1, "301#060001000000"),
            (PowerCommand::Enable, -2, "301#0F00FEFFFFFF"),
            (PowerCommand::Run, -2, "301#1F00FEFFFFFF"),
            (PowerCommand::QuickStop, -2, "301#0B00FEFFFFFF"),
            (PowerCommand::Home, -2, "301#1F00FEFFFFFF"),
            (PowerCommand::Halt, -2, "301#0F01FEFFFFFF"),
            (PowerCommand::Run, 1 << 31, "301#1F00FFFFFF7F"),
        ] {
            drive.encode(command, at(position), &mut frames);
            assert_eq!(format!("{:?}", frames[0]), expected);
        }
        for position in [i64::from(i32::MIN), -2, i64::from(i32::MAX)] {
            assert_eq!(drive.check(at(position)), Ok(()));
        }
        assert_eq!(drive.check(at(1 << 31)), Err(OutOfRange));
        let data = [0x37, 0x12, 0x00, 0x00, 0x02, 0x00];
        let status = drive.status(0, &data).unwrap();
        assert_eq!(status.word, Statusword(0x1237).into());
        let sample = drive.sample(0, &data).unwrap();
        assert_eq!(sample.position, Increments::new(131_072));
        assert_eq!(drive.sample(0, &[0x37, 0x12, 0, 0, 0]), None);
    }

    /// The manual's example (1820-1830).
    #[test]
    fn it_homes_by_itself_as_the_manual_does() {
        let mut drive = Lxm32m::new(&settings(1, 2));
        let rpm = |rpm: f64| rpm * 131_072.0 / 60.0;
        let homing = drive.homing(17, [rpm(100.0), rpm(10.0)]).unwrap();
        let written = homing.begin.map(|write| {
            let Address { index, sub } = write.address;
            (index, sub, write.data.bits())
        });
        let expected = [
            (0x6099, 1, 100),
            (0x6099, 2, 10),
            (0x3028, 0x0B, 0),
            (0x301B, 0x16, 0),
            (0x6098, 0, 17),
            (0x6060, 0, 6),
        ];
        assert_eq!(written, expected);
        assert_eq!(homing.mode.mode, 6);
        assert_eq!(homing.end, Write::new(0x6060, 0, Data::u8(7)));
        let says = |drive: &mut Lxm32m, word: u16| {
            let [low, high] = word.to_le_bytes();
            let status = drive.status(0, &[low, high, 0, 0, 0, 0]).unwrap();
            (status.homing_over, status.mode_runs, status.is_homed)
        };
        assert_eq!(says(&mut drive, 0x0237), (false, false, false));
        assert_eq!(says(&mut drive, 0xD637), (true, true, true));
        // Never no speed at all.
        let slow = drive.homing(17, [0.1, 0.0]).unwrap();
        assert_eq!(
            slow.begin[..2].iter().map(|it| it.data.bits()).max(),
            Some(1)
        );
    }

    #[test]
    fn signals_come_behind_the_position_where_they_are_asked_for() {
        let drive = Lxm32m::new(&Settings {
            io: IoSettings {
                signals: true,
                ..IoSettings::default()
            },
            ..settings(1, 2)
        });
        let mapping: Vec<_> = (drive.spec().setup.iter())
            .filter(|write| write.address.index == 0x1A01)
            .map(|write| (write.address.sub, write.data.bits()))
            .collect();
        let expected = [
            (0, 0),
            (1, 0x6041_0010),
            (2, 0x6064_0020),
            (3, 0x3008_0110),
            (0, 3),
        ];
        assert_eq!(mapping, expected);
        assert_eq!(drive.spec().t_pdos[0].bytes, 8);
        let io = drive.io().unwrap();
        let signals = io.signals(0, &[0, 0, 0, 0, 0, 0, 0b1010_0001, 0b1111_1010]);
        let on = |bit: &usize| signals.unwrap() >> bit & 1 != 0;
        let on: Vec<_> = (0..32)
            .filter(on)
            .filter_map(|bit| LXM32M.signal(bit))
            .collect();
        assert_eq!(on, ["DI0", "DI5", "DQ1"]);
        assert!(Lxm32m::new(&settings(1, 2)).io().is_none());
    }

    #[test]
    fn torque_comes_in_a_pdo_of_its_own_where_it_is_asked_for() {
        let mut drive = Lxm32m::new(&Settings {
            torque: true,
            ..settings(1, 2)
        });
        let requests: Vec<_> = drive.spec().setup[30..35].iter().map(request).collect();
        let expected = [
            [0x2F, 0x02, 0x1A, 0, 0, 0, 0, 0],
            [0x23, 0x02, 0x1A, 1, 0x10, 0, 0x77, 0x60],
            [0x2F, 0x02, 0x1A, 0, 1, 0, 0, 0],
            [0x2F, 0x02, 0x18, 2, 1, 0, 0, 0],
            [0x23, 0x02, 0x18, 1, 0x81, 0x03, 0, 0],
        ];
        assert_eq!(requests, expected);
        let t_pdos = &drive.spec().t_pdos;
        let told = t_pdos.iter().map(|pdo| (pdo.cob_id.get(), pdo.bytes));
        assert_eq!(told.collect::<Vec<_>>(), [(0x281, 6), (0x381, 2)]);
        assert_eq!(drive.in_motion(Increments::ZERO).len(), 2);
        assert_eq!(drive.torque(1, &[0x9C, 0xFF]), Some(-100));
        assert_eq!(drive.torque(0, &[0x37, 0x12, 0, 0, 2, 0]), None);
        // Which is no statusword.
        assert_eq!(drive.status(1, &[0x37, 0x12]), None);
        assert_eq!(drive.sample(1, &[0x37, 0x12]), None);
    }

    #[test]
    fn outputs_come_behind_the_setpoint_where_some_are_set() {
        let mut drive = Lxm32m::new(&Settings {
            io: IoSettings {
                outputs: 0b101,
                ..IoSettings::default()
            },
            ..settings(1, 2)
        });
        let written = |index| -> Vec<_> {
            let setup = drive.spec().setup.iter();
            let here = setup.filter(|write| write.address.index == index);
            here.map(|write| (write.address.sub, write.data.bits()))
                .collect()
        };
        let mapping = [
            (0, 0),
            (1, 0x6040_0010),
            (2, 0x60C1_0120),
            (3, 0x3008_1110),
            (0, 3),
        ];
        assert_eq!(written(0x1601), mapping);
        assert_eq!(written(0x3007), [(0x09, 1), (0x0B, 1)]);
        let mut frames = [Frame::new(CobId::SYNC, &[])];
        drive.io_mut().unwrap().set_outputs(0b100);
        drive.encode(PowerCommand::Disable, Setpoint::default(), &mut frames);
        assert_eq!(frames[0].data(), [0, 0, 0, 0, 0, 0, 0b100, 0]);
        assert!(Lxm32m::new(&settings(1, 2)).io_mut().is_none());
    }

    /// The words that the manual prints (1755-1830), and those of faults by its table.
    #[test]
    fn statuswords() {
        use NotFollowing as N;
        let mut drive = Lxm32m::new(&settings(1, 2));
        for (word, started, expected) in [
            (0x1237, true, Ok(())),
            (0x0237, false, Ok(())),
            (0x1637, true, Ok(())),
            (0x12B7, true, Ok(())), // a warning does not stop
            (0x0237, true, Err(N::ModeEnded)),
            (0x1037, true, Err(N::NotRemote)),
            (0x3237, true, Err(N::Error)),
            (0x6617, true, Err(N::QuickStop)),
            (0x6231, false, Err(N::PowerStageOff)),
            (0x0240, false, Err(N::PowerStageOff)),
            (0x2218, true, Err(N::Fault)),
            (0x221F, true, Err(N::Fault)),
            (0x2238, true, Err(N::Fault)),
        ] {
            let status = drive.status(0, &u16::to_le_bytes(word)).unwrap();
            assert_eq!(status.follows(started), expected, "{word:04X}");
        }
    }

    #[test]
    fn cycles_are_whole_milliseconds_up_to_twenty() {
        for (micros, takes) in [
            (999, false),
            (1000, true),
            (1500, false),
            (2000, true),
            (20_000, true),
            (21_000, false),
        ] {
            assert_eq!(LXM32M.takes_cycle(Duration::from_micros(micros)), takes);
        }
    }
}
