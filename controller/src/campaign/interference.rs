//! What a campaign does to drives, buses and the host, at random: each kind by itself, in bursts and
//! together; and the port through which buses are interfered with.

use super::When;
use super::dice::{Dice, rounded};
use super::machine::{EncoderSpec, MachineSpec};
use crate::bus::{Burst, BusFault, Received, Severity};
use crate::port::sim::SimPort;
use crate::port::{Port, PortError};
use serde::{Deserialize, Serialize};
use std::mem::take;
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, CanId, CobId, Frame, nmt};
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_drives::world::{BusId, World};

/// Something that happens to the machine from outside.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trouble {
    /// When.
    pub at: When,
    /// What.
    pub what: Interference,
}

/// What happens. Buses by their places in the machine file, and so drives, behind them encoders and behind those I/O
/// nodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Interference {
    /// A drive or another device.
    Drive(usize, ToDrive),
    /// The coupling of an encoder slips by so many revolutions.
    Slip(usize, f64),
    /// The coupling of an encoder breaks: it goes on saying where it was.
    Part(usize),
    /// It is whole again, and the encoder where it would be.
    Join(usize),
    /// Somebody brings an axis whose drives are off by hand to where it may be enabled: inside its soft limits, with its sides
    /// together.
    Align(usize),
    /// What was wrong is mended: nothing more comes of it once the machine has been started anew.
    Mended,
    /// A bus.
    Bus(usize, ToBus),
    /// The cycle's next wake-up comes so many µs late.
    Late(u32),
    /// The planner does nothing for so many wake-ups.
    StarvePlanner(u32),
}

/// What happens to a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToDrive {
    /// Whether the power stage has its supply.
    Mains(bool),
    /// Whether the shaft is blocked.
    Block(bool),
    /// Whether the motor has lost its torque.
    LoseTorque(bool),
    /// Whether nothing that it sends reaches the bus.
    Mute(bool),
    /// So many T_PDOs are lost.
    LoseTPdos(u32),
    /// Its control supply fails and returns.
    Reset,
    /// It finds an error of this class, 0 to 4.
    Error(u8),
    /// Whether the cause of an error stays.
    ErrorPersists(bool),
    /// Whether the bus has control of it.
    Remote(bool),
    /// How many ms its power stage takes to switch on.
    EnableTime(u32),
    /// What is wired to the input with this number is on.
    Input(u8, bool),
    /// Whether no R_PDO reaches it.
    Deaf(bool),
    /// Its power stage is on, as a master that crashed may have left it.
    FoundEnabled,
    /// It is the device of another maker, with this vendor id.
    Vendor(u32),
    /// It refuses that this object, index and sub-index, is written.
    Refuse(u16, u8),
    /// It lets every object be written again.
    Accept,
}

/// What happens to a bus, at the controller's end of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ToBus {
    /// So many bursts find a full transmit queue.
    DropBursts(u32),
    /// So many bursts leave behind the SYNC that they are meant for.
    DelayBursts(u32),
    /// A burst finds room for its first frame alone.
    TearBurst,
    /// So many SYNCs are lost.
    LoseSyncs(u32),
    /// The interface is gone for so many cycles.
    Unplug(u32),
    /// The adapter reports this, by its place in [`BusFault::ALL`].
    Condition(usize),
    /// Frames that come in are tampered with.
    Incoming(Tampering),
    /// A frame of nobody's comes in so many cycles: its identifier and data.
    Intruder(u16, [u8; 8], u32),
    /// Another master commands devices: the command and the node, 0 for all of the bus.
    Nmt(u8, u8),
    /// There is a second node with this id: behind each of so many frames of the first one comes one of its own.
    SecondNode(u8, u32),
}

/// What becomes of frames that come in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tampering {
    /// Which kind of frames.
    pub traffic: Traffic,
    /// Of which node; 0: of all.
    pub node: u8,
    /// What becomes of them.
    pub change: Change,
    /// Of how many.
    pub count: u32,
}

/// A kind of frames that drives send.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Traffic {
    /// T_PDOs.
    TPdo,
    /// Heartbeats and boot-up messages.
    Heartbeat,
    /// EMCY.
    Emergency,
    /// SDO answers.
    Sdo,
}

/// What becomes of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Change {
    /// It is lost.
    Lose,
    /// It comes a cycle later.
    Delay,
    /// It comes twice.
    Duplicate,
    /// This bit of it is another one.
    Corrupt(u8),
    /// It begins with this byte: in an SDO answer, another command than the one that it answers.
    Begin(u8),
    /// It has no more than so many bytes.
    Cut(u8),
}

impl Traffic {
    /// Whether a frame is of that kind and node.
    fn matches(self, node: u8, frame: &Frame) -> bool {
        let CanId::Standard(id) = frame.id() else {
            return false;
        };
        let is = match id >> 7 {
            0x3 | 0x5 | 0x7 | 0x9 => self == Self::TPdo,
            0x1 => self == Self::Emergency && id != 0x80,
            0xB => self == Self::Sdo,
            0xE => self == Self::Heartbeat,
            _ => false,
        };
        is && (node == 0 || id & 0x7F == u16::from(node))
    }
}

impl ToDrive {
    /// As a twin takes it.
    pub(super) fn disturbance(self) -> Disturbance {
        match self {
            Self::Mains(on) => Disturbance::Mains(on),
            Self::Block(on) => Disturbance::Block(on),
            Self::LoseTorque(on) => Disturbance::LoseTorque(on),
            Self::Mute(on) => Disturbance::Mute(on),
            Self::LoseTPdos(count) => Disturbance::LoseTPdos(count),
            Self::Reset => Disturbance::Reset,
            Self::Error(class) => Disturbance::Fault(match class {
                0 => ErrorClass::Warning,
                1 => ErrorClass::QuickStop,
                2 => ErrorClass::StopAndSwitchOff,
                3 => ErrorClass::SwitchOff,
                _ => ErrorClass::Fatal,
            }),
            Self::ErrorPersists(on) => Disturbance::FaultPersists(on),
            Self::Remote(on) => Disturbance::Remote(on),
            Self::EnableTime(ms) => Disturbance::EnableTime(Duration::from_millis(ms.into())),
            Self::Input(input, on) => Disturbance::Input(input, on),
            Self::Deaf(on) => Disturbance::Deaf(on),
            Self::FoundEnabled => Disturbance::FoundEnabled,
            Self::Vendor(id) => Disturbance::Vendor(id),
            Self::Refuse(index, sub) => {
                Disturbance::RefuseWrite(Address::new(index, sub), AbortCode::ReadOnly)
            }
            Self::Accept => Disturbance::AcceptWrites,
        }
    }

    /// What ends it, if it lasts.
    fn end(self) -> Option<Self> {
        Some(match self {
            Self::Mains(false) => Self::Mains(true),
            Self::Block(true) => Self::Block(false),
            Self::LoseTorque(true) => Self::LoseTorque(false),
            Self::Mute(true) => Self::Mute(false),
            Self::ErrorPersists(true) => Self::ErrorPersists(false),
            Self::Remote(false) => Self::Remote(true),
            Self::Deaf(true) => Self::Deaf(false),
            _ => return None,
        })
    }
}

impl Interference {
    /// What ends it, if it lasts.
    pub(super) fn end(&self) -> Option<Self> {
        match *self {
            Self::Drive(drive, what) => what.end().map(|end| Self::Drive(drive, end)),
            Self::Part(encoder) => Some(Self::Join(encoder)),
            _ => None,
        }
    }

    /// What has to be done about it before the machine can be enabled again, if nothing else ends it: it has to be
    /// ended, a drive with a fatal error to be switched off and on, a device to be exchanged for the right one.
    pub(super) fn remedy(&self, machine: &MachineSpec) -> Option<Self> {
        match *self {
            Self::Drive(drive, ToDrive::Error(class)) if class > 3 => {
                Some(Self::Drive(drive, ToDrive::Reset))
            }
            // What an encoder has found stays.
            Self::Drive(device, ToDrive::Error(_)) if device >= machine.drives() => {
                Some(Self::Drive(device, ToDrive::ErrorPersists(false)))
            }
            Self::Drive(device, ToDrive::Vendor(_)) => {
                let own = ToDrive::Vendor(machine.vendor(device));
                Some(Self::Drive(device, own))
            }
            Self::Drive(device, ToDrive::Refuse(..)) => Some(Self::Drive(device, ToDrive::Accept)),
            Self::Slip(encoder, by) => Some(Self::Slip(encoder, -by)),
            _ => self.end(),
        }
    }

    /// Its kind in a few words, for tables.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Drive(_, what) => match what {
                ToDrive::Mains(false) => "power lost",
                ToDrive::Mains(true) => "power back",
                ToDrive::Block(true) => "axis jammed",
                ToDrive::Block(false) => "axis free again",
                ToDrive::LoseTorque(true) => "torque lost",
                ToDrive::LoseTorque(false) => "torque back",
                ToDrive::Mute(true) => "node mute",
                ToDrive::Mute(false) => "node heard again",
                ToDrive::LoseTPdos(_) => "T_PDOs lost at the drive",
                ToDrive::Reset => "node reset",
                ToDrive::Error(0) => "warning",
                ToDrive::Error(1) => "error of class 1",
                ToDrive::Error(2) => "error of class 2",
                ToDrive::Error(3) => "error of class 3",
                ToDrive::Error(_) => "error of class 4",
                ToDrive::ErrorPersists(true) => "cause of an error stays",
                ToDrive::ErrorPersists(false) => "cause of an error gone",
                ToDrive::Remote(false) => "control taken by another channel",
                ToDrive::Remote(true) => "control given back",
                ToDrive::EnableTime(_) => "enabling takes longer",
                ToDrive::Input(_, true) => "input on",
                ToDrive::Input(_, false) => "input off",
                ToDrive::Deaf(true) => "drive deaf to R_PDOs",
                ToDrive::Deaf(false) => "drive hears again",
                ToDrive::FoundEnabled => "power stage found on",
                ToDrive::Vendor(_) => "another maker's device",
                ToDrive::Refuse(..) => "an SDO write refused",
                ToDrive::Accept => "SDO writes taken again",
            },
            Self::Bus(_, what) => match what {
                ToBus::DropBursts(_) => "bursts dropped",
                ToBus::DelayBursts(_) => "bursts behind their SYNC",
                ToBus::TearBurst => "burst torn",
                ToBus::LoseSyncs(_) => "SYNC missing",
                ToBus::Unplug(_) => "interface gone",
                ToBus::Condition(_) => "adapter reports a condition",
                ToBus::Incoming(Tampering { change, .. }) => match change {
                    Change::Lose => "frames lost",
                    Change::Delay => "frames delayed",
                    Change::Duplicate => "frames duplicated",
                    Change::Corrupt(_) => "frames corrupted",
                    Change::Begin(_) => "SDO answers wrong",
                    Change::Cut(_) => "frames cut short",
                },
                ToBus::Intruder(..) => "frames of a stranger",
                ToBus::Nmt(..) => "NMT command of another master",
                ToBus::SecondNode(..) => "second node with the same id",
            },
            Self::Align(_) => "axis brought in place by hand",
            Self::Mended => "all mended",
            Self::Slip(..) => "coupling of an encoder slips",
            Self::Part(_) => "coupling of an encoder breaks",
            Self::Join(_) => "coupling of an encoder whole again",
            Self::Late(_) => "wake-up late",
            Self::StarvePlanner(_) => "planner starved",
        }
    }
}

/// Random interference with a machine in a case of so many cycles. Three cases in ten have none.
pub(super) fn draw(dice: &mut Dice, machine: &MachineSpec, cycles: u32) -> Vec<Trouble> {
    let count = match dice.weighted(&[3, 4, 2, 1]) {
        0 => 0,
        1 => 1,
        2 => dice.whole(2..=4),
        _ => dice.whole(5..=15),
    };
    let mut troubles = Vec::new();
    for _ in 0..count {
        let at = When::draw(dice, cycles);
        let what = any(dice, machine);
        troubles.push(Trouble {
            at,
            what: what.clone(),
        });
        if let Some(end) = what.end()
            && dice.chance(0.85)
        {
            troubles.push(Trouble {
                at: at.later(dice.whole(1..=cycles / 2)),
                what: end,
            });
        }
    }
    troubles.sort_by_key(|trouble| trouble.at);
    troubles
}

/// Draws for one of a kind: the rarest comes every few hundred.
const DRAWS: usize = 2000;

/// Random interference of this kind, as [`Interference::kind`] names it, if it is one that may come at any
/// time.
pub(super) fn of_kind(dice: &mut Dice, machine: &MachineSpec, kind: &str) -> Option<Interference> {
    let inputs = machine.wires().filter(|(_, wire)| wire.is_digital_input());
    let switched = inputs.flat_map(|(drive, wire)| {
        [true, false].map(|on| Interference::Drive(drive, ToDrive::Input(wire.place, on)))
    });
    let mut switched: Vec<_> = switched.filter(|what| what.kind() == kind).collect();
    if !switched.is_empty() {
        return Some(switched.swap_remove(dice.below(switched.len())));
    }
    let drawn = (0..DRAWS).flat_map(|_| {
        let what = one(dice, machine);
        let end = what.end();
        [Some(what), end].into_iter().flatten()
    });
    let mut drawn = drawn.filter(|what| what.kind() == kind);
    drawn.next()
}

/// Any one, of those that come at any time and of those that few machines have.
pub(super) fn one(dice: &mut Dice, machine: &MachineSpec) -> Interference {
    match dice.below(16) {
        0 => nmt(dice, machine),
        1 => strange(dice, machine).1,
        2 => wrong_answers(dice, machine),
        3 => of_a_coupling(dice, machine).unwrap_or_else(|| any(dice, machine)),
        _ => any(dice, machine),
    }
}

fn any(dice: &mut Dice, machine: &MachineSpec) -> Interference {
    match dice.weighted(&[6, 6, 2, 1]) {
        0 => Interference::Drive(dice.below(machine.nodes().count()), to_drive(dice)),
        1 => Interference::Bus(dice.below(machine.buses.len()), to_bus(dice, machine)),
        2 => {
            // A tenth of a cycle to fifty of them.
            let cycles = *dice.pick(&[0.1, 0.3, 0.6, 0.9, 1.0, 1.3, 2.0, 3.7, 10.0, 50.0]);
            Interference::Late((f64::from(machine.cycle_us) * cycles) as u32)
        }
        _ => Interference::StarvePlanner(dice.whole(1..=400)),
    }
}

fn to_drive(dice: &mut Dice) -> ToDrive {
    match dice.below(12) {
        0 => ToDrive::Mains(false),
        1 => ToDrive::Block(true),
        2 => ToDrive::LoseTorque(true),
        3 => ToDrive::Mute(true),
        4 | 5 => ToDrive::LoseTPdos(*dice.pick(&[1, 1, 2, 3, 20])),
        6 => ToDrive::Reset,
        7 | 8 => ToDrive::Error(dice.whole(0..=4) as u8),
        9 => ToDrive::ErrorPersists(true),
        10 => ToDrive::Remote(false),
        _ => ToDrive::EnableTime(*dice.pick(&[1, 20, 300])),
    }
}

fn to_bus(dice: &mut Dice, machine: &MachineSpec) -> ToBus {
    let count = *dice.pick(&[1, 1, 2, 3, 10]);
    match dice.below(12) {
        0 | 1 => ToBus::DropBursts(count),
        2 => ToBus::DelayBursts(count),
        3 => ToBus::TearBurst,
        4 => ToBus::LoseSyncs(count),
        5 => ToBus::Unplug(*dice.pick(&[1, 5, 100, 1000])),
        6 => ToBus::Condition(dice.below(BusFault::ALL.len())),
        7 => {
            let mut data = [0; 8];
            data.fill_with(|| dice.whole(0..=255) as u8);
            // Sometimes it looks like a drive's.
            let node = nodes(machine)[dice.below(machine.nodes().count())];
            let function = *dice.pick(&[0x080, 0x180, 0x280, 0x580, 0x700, 0x000, 0x480]);
            ToBus::Intruder(function + u16::from(node), data, count)
        }
        _ => {
            let traffic = [
                Traffic::TPdo,
                Traffic::TPdo,
                Traffic::Heartbeat,
                Traffic::Emergency,
                Traffic::Sdo,
            ];
            let change = [
                Change::Lose,
                Change::Delay,
                Change::Duplicate,
                Change::Corrupt(dice.whole(0..=63) as u8),
            ];
            let node = nodes(machine)[dice.below(machine.nodes().count())];
            ToBus::Incoming(Tampering {
                traffic: *dice.pick(&traffic),
                node: if dice.chance(0.8) { node } else { 0 },
                change: *dice.pick(&change),
                count,
            })
        }
    }
}

/// Commands of an SDO server that are no answer to what a drive is asked: an abort, the beginning and the
/// middle of a segmented transfer, a block transfer, the answer to a write, and none that there is.
const WRONG: [u8; 6] = [0x80, 0x41, 0x00, 0xC6, 0x60, 0xE7];

/// Where there is trouble anyway: drives that give wrong SDO answers while the machine comes up.
pub(super) fn answer_wrongly(dice: &mut Dice, machine: &MachineSpec, troubles: &mut Vec<Trouble>) {
    if troubles.is_empty() || !dice.chance(0.12) {
        return;
    }
    let what = wrong_answers(dice, machine);
    troubles.push(Trouble {
        at: When::On(dice.whole(0..=300)),
        what,
    });
    troubles.sort_by_key(|trouble| trouble.at);
}

fn wrong_answers(dice: &mut Dice, machine: &MachineSpec) -> Interference {
    let tampering = Tampering {
        traffic: Traffic::Sdo,
        node: 0,
        change: Change::Begin(*dice.pick(&WRONG)),
        count: *dice.pick(&[1, 1, 2, 10]),
    };
    let bus = dice.below(machine.buses.len());
    Interference::Bus(bus, ToBus::Incoming(tampering))
}

/// What is wired to inputs is switched on and off.
pub(super) fn switch_inputs(
    dice: &mut Dice,
    machine: &MachineSpec,
    cycles: u32,
    troubles: &mut Vec<Trouble>,
) {
    for (drive, wire) in machine.wires().filter(|(_, wire)| wire.is_digital_input()) {
        let seldom = wire.is_enable() || wire.is_home();
        if !dice.chance(if seldom { 0.2 } else { 0.7 }) {
            continue;
        }
        for _ in 0..dice.whole(1..=3) {
            let at = When::draw(dice, cycles);
            let later = at.later(dice.whole(1..=400));
            for (at, on) in [(at, true), (later, false)] {
                let what = Interference::Drive(drive, ToDrive::Input(wire.place, on));
                troubles.push(Trouble { at, what });
            }
        }
    }
    troubles.sort_by_key(|trouble| trouble.at);
}

/// Couplings of encoders slip: by less than what the machine takes, and by more.
pub(super) fn slip(
    dice: &mut Dice,
    machine: &MachineSpec,
    cycles: u32,
    troubles: &mut Vec<Trouble>,
) {
    for (place, encoder) in machine.encoders().enumerate() {
        if dice.chance(0.3) {
            let by = slips(dice, encoder);
            troubles.push(Trouble {
                at: When::draw(dice, cycles),
                what: Interference::Slip(machine.drives() + place, by),
            });
        }
    }
    troubles.sort_by_key(|trouble| trouble.at);
}

/// By how many revolutions a coupling slips.
fn slips(dice: &mut Dice, encoder: &EncoderSpec) -> f64 {
    let allowed = encoder.difference / encoder.pitch;
    rounded(allowed * dice.between(-3.0, 3.0), 4)
}

/// Something that happens to the coupling of an encoder, if the machine has one.
fn of_a_coupling(dice: &mut Dice, machine: &MachineSpec) -> Option<Interference> {
    let encoders: Vec<_> = machine.encoders().collect();
    if encoders.is_empty() {
        return None;
    }
    let place = dice.below(encoders.len());
    let device = machine.drives() + place;
    Some(match dice.chance(0.5) {
        true => Interference::Part(device),
        false => Interference::Slip(device, slips(dice, encoders[place])),
    })
}

/// Couplings of encoders break; of some nobody makes them whole.
pub(super) fn part(
    dice: &mut Dice,
    machine: &MachineSpec,
    cycles: u32,
    troubles: &mut Vec<Trouble>,
) {
    for place in 0..machine.encoders().count() {
        if !dice.chance(0.2) {
            continue;
        }
        let (at, encoder) = (When::draw(dice, cycles), machine.drives() + place);
        let what = Interference::Part(encoder);
        troubles.push(Trouble { at, what });
        if dice.chance(0.5) {
            let at = at.later(dice.whole(1..=cycles / 2));
            let what = Interference::Join(encoder);
            troubles.push(Trouble { at, what });
        }
    }
    troubles.sort_by_key(|trouble| trouble.at);
}

/// Where there is trouble anyway: another master commands devices, one of them or all.
pub(super) fn command_besides(
    dice: &mut Dice,
    machine: &MachineSpec,
    cycles: u32,
    troubles: &mut Vec<Trouble>,
) {
    if troubles.is_empty() || !dice.chance(0.2) {
        return;
    }
    for _ in 0..dice.whole(1..=2) {
        troubles.push(Trouble {
            at: When::draw(dice, cycles),
            what: nmt(dice, machine),
        });
    }
    troubles.sort_by_key(|trouble| trouble.at);
}

fn nmt(dice: &mut Dice, machine: &MachineSpec) -> Interference {
    use nmt::Command::{EnterPreOperational, ResetCommunication, ResetNode, Start, Stop};
    let command = [
        EnterPreOperational,
        Stop,
        Start,
        ResetNode,
        ResetCommunication,
    ];
    let command = command[dice.weighted(&[4, 4, 1, 1, 1])];
    let nodes: Vec<_> = machine.nodes().collect();
    let (bus, node) = *dice.pick(&nodes);
    let all = dice.chance(0.2);
    Interference::Bus(bus, ToBus::Nmt(command as u8, if all { 0 } else { node }))
}

/// Where there is trouble anyway: what few machines have, devices that are not what they should be, and frames that are not whole.
pub(super) fn be_strange(
    dice: &mut Dice,
    machine: &MachineSpec,
    cycles: u32,
    troubles: &mut Vec<Trouble>,
) {
    if troubles.is_empty() || !dice.chance(0.25) {
        return;
    }
    let at = When::draw(dice, cycles);
    let (device, what) = strange(dice, machine);
    let is_cut = matches!(
        what,
        Interference::Bus(
            _,
            ToBus::Incoming(Tampering {
                change: Change::Cut(_),
                ..
            })
        )
    );
    let end = what.end();
    troubles.push(Trouble { at, what });
    if let Some(end) = end {
        let at = at.later(dice.whole(1..=cycles / 2));
        troubles.push(Trouble { at, what: end });
    }
    if is_cut {
        let error = ToDrive::Error(dice.whole(0..=3) as u8);
        troubles.push(Trouble {
            at: at.later(dice.whole(1..=20)),
            what: Interference::Drive(device, error),
        });
    }
    troubles.sort_by_key(|trouble| trouble.at);
}

/// Objects that a set-up writes: the interpolation period, the mode, the SYNC behind which nothing is wrong, a mapping, a heartbeat.
const WRITTEN: [(u16, u8); 6] = [
    (0x60C2, 1),
    (0x6060, 0),
    (0x1006, 0),
    (0x1600, 0),
    (0x1017, 0),
    (0x1400, 1),
];

/// A device, and what is strange about it.
fn strange(dice: &mut Dice, machine: &MachineSpec) -> (usize, Interference) {
    let nodes: Vec<_> = machine.nodes().collect();
    let device = dice.below(nodes.len());
    let (bus, node) = nodes[device];
    let what = match dice.weighted(&[4, 4, 1, 2, 2, 1]) {
        0 => {
            let count = *dice.pick(&[1, 2, 20, 1000]);
            Interference::Bus(bus, ToBus::SecondNode(node, count))
        }
        1 => {
            let tampering = Tampering {
                traffic: Traffic::Emergency,
                node,
                change: Change::Cut(dice.whole(0..=7) as u8),
                count: dice.whole(1..=3),
            };
            Interference::Bus(bus, ToBus::Incoming(tampering))
        }
        2 => Interference::Drive(device, ToDrive::Vendor(dice.whole(1..=999))),
        3 => {
            let (index, sub) = *dice.pick(&WRITTEN);
            Interference::Drive(device, ToDrive::Refuse(index, sub))
        }
        4 => Interference::Drive(device, ToDrive::Deaf(true)),
        _ => Interference::Drive(device, ToDrive::FoundEnabled),
    };
    (device, what)
}

/// The node ids of the devices.
fn nodes(machine: &MachineSpec) -> Vec<u8> {
    machine.nodes().map(|(_, node)| node).collect()
}

/// The controller's port to a simulated bus that is interfered with.
pub(super) struct TroubledPort {
    port: SimPort,
    drop_bursts: u32,
    delay_bursts: u32,
    tear_bursts: u32,
    lose_syncs: u32,
    unplugged: u32,
    condition: Option<BusFault>,
    tampering: Vec<Tampering>,
    intruder: Option<(Frame, u32)>,
    /// What another master puts on the bus.
    nmt: Option<Frame>,
    /// A second node has this id, for so many frames more.
    second: Option<(u8, u32)>,
    /// Bursts that wait for the next SYNC to leave.
    late: Vec<Frame>,
    /// Frames that come a cycle later.
    delayed: Vec<Received>,
}

impl TroubledPort {
    /// Around a port that nothing happens to.
    pub(super) fn new(port: SimPort) -> Self {
        Self {
            port,
            drop_bursts: 0,
            delay_bursts: 0,
            tear_bursts: 0,
            lose_syncs: 0,
            unplugged: 0,
            condition: None,
            tampering: Vec::new(),
            intruder: None,
            nmt: None,
            second: None,
            late: Vec::new(),
            delayed: Vec::new(),
        }
    }

    /// Lets something happen.
    pub(super) fn trouble(&mut self, what: ToBus) {
        match what {
            ToBus::DropBursts(count) => self.drop_bursts = count,
            ToBus::DelayBursts(count) => self.delay_bursts = count,
            ToBus::TearBurst => self.tear_bursts = 1,
            ToBus::LoseSyncs(count) => self.lose_syncs = count,
            ToBus::Unplug(cycles) => self.unplugged = cycles,
            ToBus::Condition(place) => match BusFault::ALL.get(place) {
                // A port tells by an error that its bus carries nothing any more.
                Some(fault) if fault.severity() == Severity::Lose => self.unplugged = 1,
                fault => self.condition = fault.copied(),
            },
            ToBus::Incoming(tampering) => self.tampering.push(tampering),
            ToBus::Intruder(id, data, count) => {
                let frame = Frame::new(CanId::Standard(id & 0x7FF), &data);
                self.intruder = Some((frame, count));
            }
            ToBus::Nmt(command, node) => self.nmt = Some(Frame::new(CobId::NMT, &[command, node])),
            ToBus::SecondNode(node, count) => self.second = Some((node, count)),
        }
    }

    /// Nothing happens to it any more. What waits to be sent or handed on is so with the next.
    pub(super) fn mend(&mut self) {
        (self.drop_bursts, self.delay_bursts, self.tear_bursts) = (0, 0, 0);
        (self.lose_syncs, self.unplugged) = (0, 0);
        self.condition = None;
        self.tampering.clear();
        (self.intruder, self.nmt, self.second) = (None, None, None);
    }

    fn check(&self) -> Result<(), PortError> {
        if self.unplugged == 0 {
            return Ok(());
        }
        Err(PortError {
            bus: "campaign".into(),
            what: "unplugged".into(),
        })
    }

    /// What becomes of a frame that comes in: handed on as often as it says.
    fn tamper(&mut self, received: &mut Received) -> usize {
        let frame = received.frame;
        let ours = |it: &&mut Tampering| it.count > 0 && it.traffic.matches(it.node, &frame);
        let Some(tampering) = self
            .tampering
            .iter_mut()
            .find(ours)
            .filter(|_| !received.echo)
        else {
            return 1;
        };
        tampering.count -= 1;
        match tampering.change {
            Change::Lose => 0,
            Change::Delay => {
                self.delayed.push(*received);
                0
            }
            Change::Duplicate => 2,
            Change::Corrupt(_) | Change::Begin(_) | Change::Cut(_) => {
                let mut data = frame.data().to_vec();
                match tampering.change {
                    Change::Corrupt(bit) if data.len() > usize::from(bit / 8) => {
                        data[usize::from(bit / 8)] ^= 1 << (bit % 8);
                    }
                    Change::Begin(byte) if !data.is_empty() => data[0] = byte,
                    Change::Cut(length) => data.truncate(length.into()),
                    _ => {}
                }
                received.frame = Frame::new(frame.id(), &data);
                1
            }
        }
    }
}

/// What a node sends that has not been set up, with the identifier of that frame.
fn of_another(frame: &Frame) -> Frame {
    let CanId::Standard(id) = frame.id() else {
        return *frame;
    };
    let mut data = vec![0; frame.data().len()];
    let begins: &[u8] = match id >> 7 {
        // Switch On Disabled, Pre-Operational, and a general abort.
        0x3 => &[0x50, 0x02],
        0xE => &[0x7F],
        0xB => &[0x80, 0, 0, 0, 0, 0, 0, 0x08],
        _ => &[],
    };
    for (byte, begin) in data.iter_mut().zip(begins) {
        *byte = *begin;
    }
    Frame::new(frame.id(), &data)
}

/// One less, if there is one.
fn take_one(count: &mut u32) -> bool {
    let some = *count > 0;
    *count = count.saturating_sub(1);
    some
}

impl Port for TroubledPort {
    fn simulated(&self) -> Option<BusId> {
        self.port.simulated()
    }

    fn exchange(&mut self, world: &mut World) {
        if let (Some(frame), Some(bus)) = (self.nmt.take(), self.simulated()) {
            world.intrude(bus, frame);
        }
        self.port.exchange(world);
    }

    fn echoes(&self) -> bool {
        self.port.echoes()
    }

    fn receive(&mut self, sink: &mut dyn FnMut(Received)) -> Result<(), PortError> {
        let gone = self.check();
        take_one(&mut self.unplugged);
        let mut came = take(&mut self.delayed);
        self.port.receive(&mut |received| came.push(received))?;
        gone?;
        if let Some((frame, count)) = &mut self.intruder
            && take_one(count)
            && let Some(last) = came.last()
        {
            came.push(Received {
                at: last.at,
                frame: *frame,
                echo: false,
            });
        }
        for mut received in came {
            let (frame, came_in) = (received.frame, !received.echo);
            for _ in 0..self.tamper(&mut received) {
                sink(received);
            }
            let kinds = [
                Traffic::TPdo,
                Traffic::Heartbeat,
                Traffic::Emergency,
                Traffic::Sdo,
            ];
            if let Some((node, count)) = &mut self.second
                && came_in
                && kinds.iter().any(|kind| kind.matches(*node, &frame))
                && take_one(count)
            {
                sink(Received {
                    frame: of_another(&frame),
                    ..received
                });
            }
        }
        Ok(())
    }

    fn condition(&mut self) -> Option<BusFault> {
        self.condition.take()
    }

    fn send_sync(&mut self, frame: &Frame) -> Result<(), PortError> {
        self.check()?;
        if !take_one(&mut self.lose_syncs) {
            self.port.send_sync(frame)?;
        }
        self.port.send_burst(&take(&mut self.late))?;
        Ok(())
    }

    fn send_burst(&mut self, frames: &[Frame]) -> Result<Burst, PortError> {
        self.check()?;
        if take_one(&mut self.drop_bursts) {
            Ok(Burst::Dropped)
        } else if take_one(&mut self.tear_bursts) && frames.len() > 1 {
            self.port.send_burst(&frames[..1])?;
            Ok(Burst::Torn { queued: 1 })
        } else if take_one(&mut self.delay_bursts) {
            self.late.extend(frames);
            Ok(Burst::Queued)
        } else {
            self.port.send_burst(frames)
        }
    }

    fn send_acyclic(&mut self, frames: &[Frame]) -> Result<(), PortError> {
        self.check()?;
        self.port.send_acyclic(frames)
    }
}
