//! Devices that move an axis: what they are told, what they say of themselves.

use super::profile::cia402;
use super::{Address, Assumption, Data, Feedback, Increments, Io, OutOfRange, Write};
use core::fmt;
use serde::{Deserialize, Serialize};
use syncline_canopen::Frame;

/// A device that takes a setpoint every cycle, latched at SYNC: a position, or a velocity.
///
/// The words and bits by which it is told and tells are the model's own affair: outside of it there
/// are a [`PowerCommand`] and a [`DriveStatus`]. What changes from frame to frame, a toggle bit, a
/// counter, a handshake, is the model's own too: [`Drive::encode`] is called once for each cycle
/// whose frames are handed to the bus, and never to try something. What the bus has no room for is
/// to the drive as if it were lost on the wire.
pub trait Drive: Feedback {
    /// A copy in the same state.
    fn clone_box(&self) -> Box<dyn Drive>;

    /// How to find out, by SDO, whether a drive in an unknown state is on, and to switch it off.
    /// `None` for a drive that has no such object: a reset of its communication has to switch it off.
    fn survey(&self) -> Option<Survey>;

    /// Which operating mode the drive must say that it runs, once it is started; `None` for a drive
    /// that has but one.
    fn mode(&self) -> Option<ModeDisplay>;

    /// Whether the mode ends when it is no longer commanded ([`PowerCommand::Run`]). Where it does
    /// not, it runs as long as the drive is enabled, and there is no end to wait for.
    fn ends_mode(&self) -> bool;

    /// Cycles from the SYNC that latches a setpoint until the drive's position reference has
    /// reached its position, parts of a cycle included.
    fn latency(&self) -> f64;

    /// How it moves, if it is sent velocities: the controller closes the position loop.
    fn dynamics(&self) -> Option<Dynamics> {
        None
    }

    /// The writes after which it goes to the next target at that velocity, increments/s, and with ramps of that
    /// acceleration, increments/s², or as little less as its units allow; `None` unless its axis goes
    /// [point to point](super::Settings::point_to_point). Then a setpoint is a target: the drive sets off when it
    /// changes under [`PowerCommand::Run`], rests on its way under [`PowerCommand::Enable`], and goes on
    /// under [`PowerCommand::Run`].
    fn profile(&self, velocity: f64, acceleration: f64) -> Option<[Write; 3]> {
        let _ = (velocity, acceleration);
        None
    }

    /// How it is told to home by itself by one of [`Model::homing_methods`](super::Model::homing_methods), as fast as
    /// that to its switch and as slowly over the edge, increments/s, or as near to that as its units allow. `None` if it
    /// cannot. Under [`PowerCommand::Home`] it sets off.
    fn homing(&self, method: u8, speeds: [f64; 2]) -> Option<OwnHoming> {
        let _ = (method, speeds);
        None
    }

    /// The flattest ramp of that profile that it takes, increments/s²; what is less is gone with this.
    fn least_ramp(&self) -> f64 {
        0.0
    }

    /// The greatest velocity that its axis may have, increments/s, by what its objects hold; what is more is gone with this.
    fn most_velocity(&self) -> f64 {
        f64::INFINITY
    }

    /// Whether it has still to acknowledge the target that it was sent last, or that it is ready for the next one; of a
    /// drive whose axis goes [point to point](super::Settings::point_to_point). One that acknowledges the setpoints of every
    /// cycle and did not take them says so by [`DriveStatus::mode_runs`].
    fn owes_acknowledgement(&self) -> bool {
        false
    }

    /// Takes what the drive says of its state when it is [asked](Self::survey), which no T_PDO has told.
    fn answers(&mut self, said: &DriveStatus) {
        let _ = said;
    }

    /// Whether it has not told yet that it has come to the target that it was sent last; of a drive whose axis goes point to
    /// point.
    fn is_under_way(&self) -> bool {
        false
    }

    /// Its digital inputs and outputs, if its PDOs carry them.
    fn io(&self) -> Option<&dyn Io> {
        None
    }

    /// The same, to set its outputs.
    fn io_mut(&mut self) -> Option<&mut dyn Io> {
        None
    }

    /// What the data of a T_PDO, all its mapped bytes, say of the drive; `None` if that PDO says
    /// nothing of it. What a handshake goes on with, the model keeps.
    fn status(&mut self, t_pdo: usize, data: &[u8]) -> Option<DriveStatus>;

    /// What the data of a T_PDO, all its mapped bytes, say of the actual torque, in thousandths of the motor's rated
    /// torque, in the direction in which its positions grow; `None` if that PDO carries none, as none does unless
    /// [`Settings::torque`](super::Settings::torque) asks for it.
    fn torque(&self, t_pdo: usize, data: &[u8]) -> Option<i16> {
        let _ = (t_pdo, data);
        None
    }

    /// What the data of a T_PDO, all its mapped bytes, say of how fast it turns, increments/s; `None` unless it is a
    /// drive that is sent [speeds](super::Setpoints::Speeds), which tells no position.
    fn speed(&self, t_pdo: usize, data: &[u8]) -> Option<f64> {
        let _ = (t_pdo, data);
        None
    }

    /// The smallest difference of two speeds that it can tell, increments/s; `None` unless it tells speeds.
    fn speed_step(&self) -> Option<f64> {
        None
    }

    /// Whether the drive can be sent to `setpoint`: a matter of range, not of state.
    ///
    /// # Errors
    /// If it is outside [`Model::positions`](super::Model::positions).
    fn check(&self, setpoint: Setpoint) -> Result<(), OutOfRange> {
        let positions = &self.spec().model.positions;
        let inside = positions.contains(&setpoint.position);
        inside.then_some(()).ok_or(OutOfRange)
    }

    /// The objects of its R_PDOs that are a position to go to, for who reads off the bus what it was
    /// sent: by default CiA 402's, 60C1h:1 and 607Ah.
    fn position_objects(&self) -> &'static [Address] {
        &cia402::POSITIONS
    }

    /// After so many increments the position in its R_PDOs begins anew, where they hold the low bits of
    /// a position alone, or its place in a turn; above zero. `None`: they hold all of it. Of all positions
    /// that read so the drive goes to the one nearest to the setpoint before, see
    /// [`unwrapped`](super::unwrapped): a machine in which that may be the wrong one is refused.
    fn setpoint_range(&self) -> Option<Increments> {
        None
    }

    /// What sets the gains of its loops; empty where its objects for them are not known, or do not hold such a
    /// gain.
    fn tuning(&self, gains: &LoopGains) -> Vec<Write> {
        let _ = gains;
        Vec::new()
    }

    /// Its R_PDOs of this cycle, one each in `frames`. What [`Drive::check`] refuses goes to the end
    /// of the range.
    fn encode(&mut self, command: PowerCommand, setpoint: Setpoint, frames: &mut [Frame]);
}

/// Gains of the loops of a drive, as amplifiers have them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoopGains {
    /// Speed loop, A for a revolution a second.
    pub speed: f64,
    /// Its integral time, s.
    pub integral_time: f64,
    /// Position loop, 1/s.
    pub position: f64,
}

impl Clone for Box<dyn Drive> {
    fn clone(&self) -> Self {
        self.clone_box()
    }
}

/// Where a drive shall be when it has carried out a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    /// As the drive counts.
    pub position: Increments,
    /// How fast it goes there, increments/s, for one that is sent velocities.
    pub velocity: f64,
    /// What it takes to go there, in thousandths of the motor's rated torque, in the direction in which its positions
    /// grow, for one that is sent [torque offsets](super::Settings::torque_offset).
    pub torque: f64,
}

impl Setpoint {
    /// At rest there.
    #[must_use]
    pub const fn at(position: Increments) -> Self {
        Self {
            position,
            velocity: 0.0,
            torque: 0.0,
        }
    }
}

/// How a drive moves that is sent velocities: after its [latency](Drive::latency) its position follows
/// the integral of the velocity with a first-order lag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dynamics {
    /// Time constant of that lag, s.
    pub lag: f64,
    /// Gain of the controller's position loop, 1/s.
    pub gain: f64,
    /// The smallest difference of two velocities that it is sent, increments/s.
    pub quantum: f64,
    /// What says how much later than a velocity is latched the drive goes there, µs: a part of [`Drive::latency`].
    pub told_delay: &'static Assumption,
    /// What says the lag, µs; `None` of a drive that has none.
    pub told_lag: Option<&'static Assumption>,
}

impl Dynamics {
    /// How much older than the last SYNC a position may be, by which the loop is closed, of a device with that
    /// [divider](super::Settings::sync_divider), s.
    #[must_use]
    pub fn oldest(settings: &super::Settings) -> f64 {
        settings.cycle.as_secs_f64() * f64::from(settings.sync_divider - 1)
    }

    /// The gain of a loop with so much delay and lag in all, s. A quarter of its inverse is where a loop
    /// about an integrator with a first-order lag begins to overshoot.
    #[must_use]
    pub fn gain(delay: f64) -> f64 {
        0.25 / delay
    }
}

/// What a drive is told to do with its power stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PowerCommand {
    /// Power off, at once.
    Disable,
    /// Be ready to be enabled; power off if it is on, with the brake first where there is one.
    Prepare,
    /// Power on, and hold the position.
    Enable,
    /// Power on, and follow the setpoints in the operating mode.
    Run,
    /// Power on, and home by itself, in the operating mode that is for that.
    Home,
    /// Power on, and come to rest on the way there.
    Halt,
    /// Come to rest by the drive's own quick stop ramp, whatever the setpoints are; power stays on unless
    /// the drive is set up to switch it off at rest.
    QuickStop,
}

/// How far a drive is from following setpoints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PowerState {
    /// Off.
    #[default]
    Off,
    /// Off, and can be enabled.
    Ready,
    /// On, and in control.
    Enabled,
    /// On, braking or at rest after a quick stop.
    QuickStop,
    /// On, braking after an error.
    FaultReaction,
    /// Off after an error.
    Fault,
    /// What the drive says means no state: it may be on.
    Unknown,
}

impl PowerState {
    /// Whether the power stage is on, or might be.
    #[must_use]
    pub const fn may_be_on(self) -> bool {
        matches!(
            self,
            Self::Enabled | Self::QuickStop | Self::FaultReaction | Self::Unknown
        )
    }

    /// Whether an error has switched the drive off, or is doing so.
    #[must_use]
    pub const fn is_fault(self) -> bool {
        matches!(self, Self::FaultReaction | Self::Fault)
    }
}

impl fmt::Display for PowerState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Off => "off",
            Self::Ready => "ready",
            Self::Enabled => "enabled",
            Self::QuickStop => "quick stop",
            Self::FaultReaction => "fault reaction",
            Self::Fault => "fault",
            Self::Unknown => "unknown",
        })
    }
}

/// What a drive says of itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriveStatus {
    /// Its power stage.
    pub power: PowerState,
    /// Its operating mode runs: it follows the setpoints, and takes them where it says so.
    pub mode_runs: bool,
    /// It takes commands from the bus, and from nobody else.
    pub remote: bool,
    /// A warning is pending, which does not stop it.
    pub warning: bool,
    /// An error is pending that has to be dealt with, although the power stage is on.
    pub error: bool,
    /// In the mode in which it homes by itself it has come to rest, at home or not.
    pub homing_over: bool,
    /// It has been homed by itself, and counts from there since.
    pub is_homed: bool,
    /// The word that it said this by.
    pub word: StatusWord,
}

/// The word by which a drive tells its state, for messages: `statusword 0237h (Operation Enabled)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StatusWord {
    /// As the drive's manual calls it.
    pub name: &'static str,
    /// Its bits.
    pub value: Data,
    /// The state that it tells, or what else a person has to know to see why the drive does not follow.
    pub meaning: &'static str,
}

/// Of a drive that has not said anything yet.
impl Default for StatusWord {
    fn default() -> Self {
        Self {
            name: "status",
            value: Data::u16(0),
            meaning: "not told yet",
        }
    }
}

impl fmt::Display for StatusWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} ({})", self.name, self.value, self.meaning)
    }
}

impl DriveStatus {
    /// What a drive says that tells the state of its power stage and no more: it follows its
    /// setpoints while it is on, and takes commands from the bus alone.
    #[must_use]
    pub fn of(power: PowerState, word: StatusWord) -> Self {
        Self {
            power,
            mode_runs: power == PowerState::Enabled,
            remote: true,
            warning: false,
            error: false,
            homing_over: false,
            is_homed: false,
            word,
        }
    }

    /// Whether a drive that was enabled, in its mode if `in_mode`, still follows.
    ///
    /// # Errors
    /// Why it does not.
    pub fn follows(&self, in_mode: bool) -> Result<(), NotFollowing> {
        match self.power {
            PowerState::Enabled => {}
            PowerState::QuickStop => return Err(NotFollowing::QuickStop),
            PowerState::FaultReaction | PowerState::Fault => return Err(NotFollowing::Fault),
            PowerState::Off | PowerState::Ready | PowerState::Unknown => {
                return Err(NotFollowing::PowerStageOff);
            }
        }
        if !self.remote {
            Err(NotFollowing::NotRemote)
        } else if self.error {
            Err(NotFollowing::Error)
        } else if in_mode && !self.mode_runs {
            Err(NotFollowing::ModeEnded)
        } else {
            Ok(())
        }
    }
}

/// Why a drive that was enabled does not follow its setpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotFollowing {
    /// The drive has an error and stops or has stopped.
    Fault,
    /// A quick stop that the controller did not ask for.
    QuickStop,
    /// The power stage is off.
    PowerStageOff,
    /// Another access channel has control.
    NotRemote,
    /// The operating mode has ended.
    ModeEnded,
    /// An error has to be fixed before going on.
    Error,
}

impl fmt::Display for NotFollowing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Fault => "fault",
            Self::QuickStop => "quick stop active",
            Self::PowerStageOff => "power stage off",
            Self::NotRemote => "not under fieldbus control",
            Self::ModeEnded => "operating mode ended",
            Self::Error => "error pending",
        })
    }
}

/// How a drive in an unknown state is found out about by SDO, brought to rest, and switched off.
#[derive(Clone, Copy, Debug)]
pub struct Survey {
    /// Where its status stands.
    pub address: Address,
    /// What a value read there says.
    pub status: fn(u32) -> DriveStatus,
    /// Switches the power stage off.
    pub disable: Write,
    /// Has it brake by its quick stop.
    pub quick_stop: Write,
}

/// How a drive homes by itself: it searches for its switch or its index pulse, and counts from there.
#[derive(Clone, Copy, Debug)]
pub struct OwnHoming {
    /// Select the method and its speeds, and the operating mode last; where it ends there it counts zero.
    pub begin: [Write; 6],
    /// What then runs.
    pub mode: ModeDisplay,
    /// Selects the mode again in which it follows setpoints.
    pub end: Write,
    /// Where it says how far from the edge of its switch the index pulse was, if it goes by both.
    pub index: Option<IndexDistance>,
}

/// How far from the edge of a switch the index pulse was that a drive took.
#[derive(Clone, Copy, Debug)]
pub struct IndexDistance {
    /// Reads it, in increments.
    pub object: Address,
    /// From one index pulse to the next.
    pub turn: Increments,
}

/// The object that says which operating mode runs, and what it must say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModeDisplay {
    /// Where it stands.
    pub address: Address,
    /// The mode's number.
    pub mode: i8,
}
