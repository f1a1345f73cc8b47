//! What a simulated bus carries, whatever its model.

use super::servo::cascade::Gains;
use super::servo::encoder::{EncoderErrors, Scale};
use super::servo::motor::Motor;
use super::servo::power_stage::PowerStage;
use super::servo::shaft::Shaft;
use crate::bus::{BitRate, BusNode};
use crate::mechanics::drive_train::DriveTrain;
use core::any::Any;
use core::ops::Range;
use syncline_canopen::dictionary::Entry;
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, Instant, NodeId, nmt};

/// A device on a bus that stands in for a real one.
///
/// To the bus it is a [`BusNode`], switched on at the origin of time. To the [world](crate::world) it
/// is a shaft that mechanics may couple to others. Observers see it without noise and change
/// nothing; tests interfere with it by a [`Disturbance`]. What only one model has is reached by a
/// downcast from [`Any`], in that model's own tests.
pub trait SimulatedDevice: BusNode + Any + Send {
    /// Its node id.
    fn node(&self) -> NodeId;

    /// What a master cannot know.
    fn observe(&self) -> Observation;

    /// The gains of its loops, as its objects set them; of a servo drive.
    fn gains(&self) -> Option<&Gains>;

    /// Interferes with it.
    fn disturb(&mut self, disturbance: Disturbance);

    /// A digital input of it is on or off from now on, as something touches where its shaft was at `place`,
    /// revolutions.
    fn touch(&mut self, input: u8, on: bool, place: f64);

    /// The levels of its digital outputs that a controller may set, one bit each from the first one on.
    fn outputs(&self) -> u16;

    /// The shaft that its motor turns, if it has a motor.
    fn shaft_mut(&mut self) -> Option<&mut Shaft>;

    /// Its power stage, where one is simulated.
    fn power_stage_mut(&mut self) -> Option<&mut PowerStage>;

    /// Lets its loops run up to `now`; the bus hears of it when the node is polled.
    fn run_until(&mut self, now: Instant);
}

/// What is true of a device at its last step, without noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// NMT state.
    pub nmt_state: nmt::State,
    /// Whether the power stage is on.
    pub is_powered: bool,
    /// Position of the shaft, revolutions from the encoder's zero.
    pub position: f64,
    /// Velocity of the shaft, rev/s.
    pub velocity: f64,
    /// Position of what it moves, revolutions of the shaft: behind it by twist and play, off by lead error and expansion.
    pub load_position: f64,
    /// Velocity of what it moves, rev/s of the shaft: another one where something gives way in between.
    pub load_velocity: f64,
    /// When these were; of a device with a shaft.
    pub at: Option<Instant>,
    /// Torque of the motor, N·m.
    pub torque: f64,
    /// Torque from outside on what it moves, N·m at the shaft.
    pub outside: f64,
    /// What its power stage is loaded with, where one is simulated.
    pub supply: Option<Supply>,
}

/// What a power stage is loaded with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supply {
    /// I²t of motor and drive, of 1.
    pub overloads: [f64; 2],
    /// Of the DC bus, V.
    pub voltage: f64,
    /// Energy in the DC bus beyond what the mains charge it to, J.
    pub stored: f64,
    /// Energy that the braking resistor has taken, J.
    pub braked: f64,
}

/// How unevenly a drive turns a spindle: the reference of its speed is off by a part of it, as a sine of the shaft's
/// angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ripple {
    /// Amplitude, as a part of the speed.
    pub part: f64,
    /// Periods in a revolution of the shaft.
    pub periods: u32,
}

/// Something that happens to a device from outside. Each lasts until its opposite comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Disturbance {
    /// Whether the power stage has its supply.
    Mains(bool),
    /// Whether the shaft is blocked mechanically.
    Block(bool),
    /// Whether the motor has lost its torque, as with a broken cable.
    LoseTorque(bool),
    /// Whether nothing that it sends reaches the bus.
    Mute(bool),
    /// Whether no R_PDO reaches it.
    Deaf(bool),
    /// The next so many T_PDOs are lost.
    LoseTPdos(u32),
    /// The control supply fails and returns: the device starts anew.
    Reset,
    /// The device's monitoring finds an error of this class.
    Fault(ErrorClass),
    /// Whether the cause of an error is still there, so that its reset is in vain.
    FaultPersists(bool),
    /// The power stage is on, as a master that crashed may have left it.
    FoundEnabled,
    /// Time from the command to enable until the power stage is on.
    EnableTime(Duration),
    /// Whether the fieldbus has control of the device, not another access channel.
    Remote(bool),
    /// SDO writes to this object are refused.
    RefuseWrite(Address, AbortCode),
    /// SDO writes are let through again.
    AcceptWrites,
    /// Whether a sensor wired to the digital input with this number, from 0, is on.
    Input(u8, bool),
    /// It is another maker's: 1018h:1.
    Vendor(u32),
    /// It, or the motor on it, is another one of its kind: what its model tells them apart by.
    Replaced(u8),
}

/// How a drive reacts to an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ErrorClass {
    /// A warning; the movement goes on.
    Warning = 0,
    /// Quick Stop, the power stage stays on (state 7).
    QuickStop = 1,
    /// Quick Stop, then power stage off (states 8, 9).
    StopAndSwitchOff = 2,
    /// Power stage off at once (state 9).
    SwitchOff = 3,
    /// As class 3, and only a power cycle leaves state 9.
    Fatal = 4,
}

/// A motor with the feed axis behind it.
#[derive(Clone, Debug, PartialEq)]
pub struct DrivenAxis {
    /// The motor.
    pub motor: Motor,
    /// The axis at its shaft.
    pub train: DriveTrain,
}

/// A switch along an axis, wired to a digital input.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// The input's number, from 0.
    pub input: u8,
    /// Where what the shaft moves is while it is on, revolutions from the encoder's zero.
    pub range: Range<f64>,
    /// The input is on outside of that range instead.
    pub inverted: bool,
}

impl Sensor {
    /// The level of its input while that is there.
    #[must_use]
    pub fn level(&self, position: f64) -> bool {
        self.range.contains(&position) != self.inverted
    }
}

/// A value over time: points of seconds since the device was switched on, ascending, and the value then, with straight
/// lines between them; before the first and behind the last it stays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Course(pub Vec<(f64, f64)>);

impl Course {
    /// The value so many seconds after the device was switched on; `None` without points.
    #[must_use]
    pub fn at(&self, seconds: f64) -> Option<f64> {
        let next = self.0.partition_point(|&(at, _)| at <= seconds);
        let before = next.checked_sub(1).map(|place| self.0[place]);
        let behind = self.0.get(next).copied();
        Some(match (before, behind) {
            (Some((from, start)), Some((to, end))) => {
                start + (end - start) * ((seconds - from) / (to - from))
            }
            (Some((_, value)), None) | (None, Some((_, value))) => value,
            (None, None) => return None,
        })
    }
}

/// What a twin is made of, whatever its model.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Node id.
    pub node: NodeId,
    /// Seed of encoder noise, delays and oscillator.
    pub seed: u64,
    /// Where the shaft stands, revolutions from the encoder's zero.
    pub position: f64,
    /// Time from a reset to the boot-up message; `None`: the model's own.
    pub boot_time: Option<Duration>,
    /// Bit rate of its bus. A device that has to be set to one has been set to this; `None`: to
    /// whatever the bus has.
    pub bit_rate: Option<BitRate>,
    /// Made for masters on ordinary computers: SYNC may come when it likes, missing setpoints are
    /// ridden out by holding the last one, the first setpoint may be anywhere.
    pub tolerant: bool,
    /// Answers at once, not after the time that a drive's processor takes.
    pub prompt: bool,
    /// What its motor moves, and the motor; `None`: the model's own.
    pub axis: Option<DrivenAxis>,
    /// How unevenly it turns in Profile Velocity; `None`: evenly.
    pub ripple: Option<Ripple>,
    /// What makes its encoder's reading wrong; `None`: the model's own.
    pub encoder: Option<EncoderErrors>,
    /// What sees its load and closes its position loop; `None`: its encoder does.
    pub scale: Option<Scale>,
    /// The switches along its axis, of a device that has digital inputs.
    pub sensors: Vec<Sensor>,
    /// Its reference switch is on within, revolutions from the encoder's zero, of a device that homes by itself.
    pub reference_switch: Option<Range<f64>>,
    /// Its limit switches are on outside of this, likewise.
    pub limit_switches: Option<Range<f64>>,
    /// What its analog inputs are over time, by their numbers from 0 on, of a device that has some.
    pub analog_inputs: Vec<(u8, Course)>,
    /// What is known of the real device where its manual is silent, by the names that its model has
    /// for it, such as a resolution; a twin takes what it is made of.
    pub assumed: Vec<(&'static str, u32)>,
    /// The objects of a drive that a file describes; `None`: its kind's own.
    pub dictionary: Option<&'static [Entry]>,
    /// What its maker has mapped into its PDOs, of one that a file describes, where its data sheet does not have it.
    pub mapped: Vec<(Address, i64)>,
}

impl Config {
    /// A device with all defaults, at its encoder's zero.
    #[must_use]
    pub fn new(node: NodeId) -> Self {
        Self {
            node,
            seed: 0,
            position: 0.0,
            boot_time: None,
            bit_rate: None,
            tolerant: false,
            prompt: false,
            axis: None,
            ripple: None,
            encoder: None,
            scale: None,
            sensors: Vec::new(),
            reference_switch: None,
            limit_switches: None,
            analog_inputs: Vec::new(),
            assumed: Vec::new(),
            dictionary: None,
            mapped: Vec::new(),
        }
    }

    /// What is known by that name, if anything is.
    #[must_use]
    pub fn assumed(&self, name: &str) -> Option<u32> {
        let mut known = self.assumed.iter();
        known
            .find(|(known, _)| *known == name)
            .map(|(_, value)| *value)
    }
}

/// A kind of twin: what its data sheet says, and how one is made.
#[derive(Debug)]
pub struct Kind {
    /// The name of the model that it stands for.
    pub name: &'static str,
    /// As its maker writes it.
    pub title: &'static str,
    /// Bit rates in bit/s, ascending.
    pub bitrates: &'static [u32],
    /// Its object dictionary.
    pub dictionary: &'static [Entry],
    /// Makes one, switched on at the origin of time.
    pub make: fn(&Config) -> Box<dyn SimulatedDevice>,
}
