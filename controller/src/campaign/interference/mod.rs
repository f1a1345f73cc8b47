//! What a campaign does to drives, buses and the host.
//!
//! - `draw`: at random, each kind by itself, in bursts and together
//! - `port`: the port through which buses are interfered with

mod draw;
mod port;

#[cfg(test)]
pub(super) use draw::one;
pub(super) use draw::{
    answer_wrongly, be_strange, command_besides, draw, of_kind, part, slip, switch_inputs,
};
pub(super) use port::TroubledPort;

use super::When;
use super::machine::MachineSpec;
use serde::{Deserialize, Serialize};
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, CanId, Frame};
use syncline_drives::twin::{Disturbance, ErrorClass};

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
    /// The adapter reports this, by its place in [`BusFault::ALL`](crate::bus::BusFault::ALL).
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
