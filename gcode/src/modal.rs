//! G- and M-codes in their modal groups, and the modal state.

use std::fmt;

use super::arc::{Direction, Plane};
use super::command::{Coolant, PathMode, Probe, Spindle, Surface, Turning};
use super::cycles::Cycle;

/// A G- or M-code, in tenths: G91.1 is `Code::G(911)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Code {
    /// A G-code in tenths.
    G(u16),
    /// An M-code.
    M(u16),
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Code::G(tenths) if tenths % 10 == 0 => write!(f, "G{}", tenths / 10),
            Code::G(tenths) => write!(f, "G{}.{}", tenths / 10, tenths % 10),
            Code::M(number) => write!(f, "M{number}"),
        }
    }
}

impl Code {
    /// The code's number: of a G-code in tenths.
    pub(crate) fn number(self) -> u16 {
        match self {
            Code::G(number) | Code::M(number) => number,
        }
    }
}

/// A set of codes of which a block may have one (RS-274/NGC tables of modal groups).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Group {
    Dwell,
    /// G53
    MachineCoordinates,
    /// The non-modal codes that use axis words: G10, G28, G30, G92 …
    Offsets,
    Motion,
    Plane,
    Distance,
    ArcDistance,
    FeedMode,
    Units,
    CutterCompensation,
    ToolLength,
    CycleReturn,
    WorkOffset,
    PathMode,
    SpindleMode,
    /// G8
    Diameters,
    Stopping,
    ToolChange,
    Spindle,
    /// M7
    Mist,
    /// M8, M9
    Coolant,
    Overrides,
    /// M62 … M68, M100 … M199
    Output,
    /// M70 … M73
    SavedModes,
}

impl Group {
    pub(crate) const COUNT: usize = Group::SavedModes as usize + 1;

    pub(crate) fn name(self) -> &'static str {
        match self {
            Group::Dwell => "dwells",
            Group::MachineCoordinates => "machine coordinates",
            Group::Offsets => "offsets and reference points",
            Group::Motion => "motions",
            Group::Plane => "planes",
            Group::Distance => "distance modes",
            Group::ArcDistance => "arc distance modes",
            Group::FeedMode => "feed modes",
            Group::Units => "units",
            Group::CutterCompensation => "cutter compensation",
            Group::ToolLength => "tool length offsets",
            Group::CycleReturn => "return modes of cycles",
            Group::WorkOffset => "work offsets",
            Group::PathMode => "path modes",
            Group::SpindleMode => "spindle speed modes",
            Group::Diameters => "diameter modes",
            Group::Stopping => "stops and subprograms",
            Group::ToolChange => "tool changes",
            Group::Spindle => "spindle commands",
            Group::Mist | Group::Coolant => "coolant commands",
            Group::Overrides => "override switches",
            Group::Output => "commands to inputs and outputs",
            Group::SavedModes => "commands that save and restore modes",
        }
    }
}

/// What is known of a code.
pub(crate) enum Standing {
    /// It belongs to a group.
    Supported(Group),
    /// It is a code of RS-274/NGC or LinuxCNC that this controller refuses, for a reason.
    Refused(&'static str),
    /// It is none.
    Unknown,
}

const NO_POLAR: &str =
    "polar coordinates are written with `@` for the radius and `^` for the angle, in each block";
const NO_LATHE: &str = "it is for lathes";
const NO_SCALING: &str =
    "have the program scaled where it is made: write G50 away if it only ends that";
const NO_ROTATION: &str =
    "turn the work offset with G10 L2 P0 and R, or remove G69 if it only ends a rotation";
const NO_CIRCLES: &str = "write the circle with G2 or G3 and its radius's compensation with G41";

impl Code {
    /// The code's group, or why it is refused.
    pub(crate) fn standing(self) -> Standing {
        use Standing::{Refused, Supported, Unknown};
        match self {
            Code::G(tenths) => match tenths {
                0 | 10 | 20 | 30 | 50..=53 | 382..=385 => Supported(Group::Motion),
                730 | 740 | 800..=830 | 840 | 850 | 860 | 890 if tenths % 10 == 0 => {
                    Supported(Group::Motion)
                }
                870 | 880 => Refused("write the moves out"),
                980 | 990 => Supported(Group::CycleReturn),
                40 => Supported(Group::Dwell),
                100 | 280..=282 | 300 | 301 | 520 | 920..=923 => Supported(Group::Offsets),
                70 => Refused(NO_LATHE),
                80 => Supported(Group::Diameters),
                120 | 130 => Refused(NO_CIRCLES),
                150 | 160 => Refused(NO_POLAR),
                170 | 180 | 190 => Supported(Group::Plane),
                171 | 181 | 191 => Refused("planes of U V W have no arcs: use G17, G18 or G19"),
                200 | 210 => Supported(Group::Units),
                330 | 331 | 760 => Supported(Group::Motion),
                400 | 410 | 411 | 420 | 421 => Supported(Group::CutterCompensation),
                430..=432 | 490 => Supported(Group::ToolLength),
                500 | 510 => Refused(NO_SCALING),
                680 | 690 => Refused(NO_ROTATION),
                530 => Supported(Group::MachineCoordinates),
                540 | 550 | 560 | 570 | 580 | 590..=593 => Supported(Group::WorkOffset),
                610 | 611 | 640 => Supported(Group::PathMode),
                700 => Refused("it is for lathes: write G20, if it is for inches"),
                710 => Refused("it is for lathes: write G21, if it is for millimetres"),
                711 | 712 | 720 | 721 | 722 => Refused(NO_LATHE),
                900 | 910 => Supported(Group::Distance),
                901 | 911 => Supported(Group::ArcDistance),
                930 | 940 | 950 => Supported(Group::FeedMode),
                960 | 970 => Supported(Group::SpindleMode),
                _ => Unknown,
            },
            Code::M(number) => match number {
                0 | 1 | 2 | 30 | 98 | 99 => Supported(Group::Stopping),
                3..=5 | 19 => Supported(Group::Spindle),
                6 => Supported(Group::ToolChange),
                7 => Supported(Group::Mist),
                8 | 9 => Supported(Group::Coolant),
                48 | 50..=53 => Supported(Group::Overrides),
                61 => Supported(Group::ToolChange),
                62..=68 => Supported(Group::Output),
                100..=199 => Supported(Group::Output),
                49 => Refused("the overrides stay with the operator"),
                60 => Refused("there is no pallet changer: write M0"),
                70..=73 => Supported(Group::SavedModes),
                _ => Unknown,
            },
        }
    }
}

/// The motion that axis words alone go on with (group 1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Motion {
    /// G80
    #[default]
    None,
    /// G0
    Rapid,
    /// G1
    Feed,
    /// G2, G3
    Arc(Direction),
    /// G5
    Cubic,
    /// G5.1
    Quadratic,
    /// G5.2, until G5.3.
    Nurbs,
    /// G33
    Thread,
    /// G33.1
    Tap,
    /// G76
    ThreadingCycle,
    /// G38.2 … G38.5
    Probe(Probe),
    /// G73, G81 …
    Cycle(Cycle),
}

impl Motion {
    /// The code of the motion.
    pub fn code(self) -> Code {
        Code::G(match self {
            Motion::None => 800,
            Motion::Rapid => 0,
            Motion::Feed => 10,
            Motion::Arc(Direction::Clockwise) => 20,
            Motion::Arc(Direction::Counterclockwise) => 30,
            Motion::Cubic => 50,
            Motion::Quadratic => 51,
            Motion::Nurbs => 52,
            Motion::Thread => 330,
            Motion::Tap => 331,
            Motion::ThreadingCycle => 760,
            Motion::Probe(Probe { away, required }) => {
                382 + 2 * u16::from(away) + u16::from(!required)
            }
            Motion::Cycle(cycle) => cycle.tenths(),
        })
    }
}

/// What F counts (group 5).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FeedMode {
    /// G93: how often a minute has the time of the block.
    InverseTime,
    /// G94: the way in a minute.
    #[default]
    PerMinute,
    /// G95: the way in a turn of the spindle.
    PerTurn,
}

impl FeedMode {
    /// The mode that a code sets.
    pub(crate) fn of(code: Code) -> FeedMode {
        match code {
            Code::G(930) => FeedMode::InverseTime,
            Code::G(950) => FeedMode::PerTurn,
            _ => FeedMode::PerMinute,
        }
    }

    /// The code that sets it.
    pub fn code(self) -> Code {
        Code::G(match self {
            FeedMode::InverseTime => 930,
            FeedMode::PerMinute => 940,
            FeedMode::PerTurn => 950,
        })
    }
}

/// The unit of S under G96, a metre or a foot per minute, mm/s.
pub(crate) fn surface_unit(inches: bool) -> f64 {
    if inches { 304.8 / 60.0 } else { 1000.0 / 60.0 }
}

/// An F word under G94 or G95.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProgrammedFeed {
    /// As written: units of length or degrees, in a minute or a turn of the spindle.
    pub number: f64,
    /// The unit of length that it was written in, mm.
    pub unit: f64,
}

/// The modal state between two blocks. `Default` is the state at the start of a program: G17 G21
/// G40 G49 G54 G61 G80 G90 G91.1 G94 G98, spindle and coolant off.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Modes {
    /// Group 1.
    pub motion: Motion,
    /// Group 2.
    pub plane: Plane,
    /// G91 instead of G90.
    pub incremental: bool,
    /// G90.1 instead of G91.1.
    pub absolute_centers: bool,
    /// What F counts.
    pub feed_mode: FeedMode,
    /// G20 instead of G21.
    pub inches: bool,
    /// G99 instead of G98.
    pub retract_to_r: bool,
    /// Work offset: 0 is G54, 8 is G59.3.
    pub work_offset: usize,
    /// G43 or G43.1 instead of G49.
    pub tool_length: bool,
    /// G41, G42, G41.1 or G42.1 instead of G40.
    pub compensation: Option<Code>,
    /// G61, G61.1 or G64; at the start the machine's own.
    pub path_mode: PathMode,
    /// F under G94 or G95.
    pub feed: Option<ProgrammedFeed>,
    /// M3, M4, M5 and S.
    pub spindle: Spindle,
    /// M7, M8, M9.
    pub coolant: Coolant,
    /// T: the tool that the next M6 loads.
    pub selected_tool: u32,
    /// The tool that the last M6 loaded; 0: none.
    pub tool: u32,
}

impl Modes {
    /// The unit of length, mm.
    pub fn unit(&self) -> f64 {
        if self.inches { 25.4 } else { 1.0 }
    }

    /// The code of the work offset.
    pub fn work_offset_code(&self) -> Code {
        Code::G(match self.work_offset {
            index @ 0..=5 => 540 + 10 * index as u16,
            index => 585 + index as u16,
        })
    }
}

/// As a person writes it: to the millionth, without the dust of arithmetic below, as of what was converted from inches and back.
pub(crate) fn to_the_millionth(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

impl fmt::Display for Modes {
    /// The codes that set this state.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plane = self.plane.code();
        let pick = |second: bool, codes: [&'static str; 2]| codes[usize::from(second)];
        write!(
            f,
            "{} {plane} {} {} {} {} {} {} {} {}",
            self.motion.code(),
            pick(self.inches, ["G21", "G20"]),
            self.compensation.unwrap_or(Code::G(400)),
            pick(self.tool_length, ["G49", "G43"]),
            self.work_offset_code(),
            pick(self.incremental, ["G90", "G91"]),
            pick(self.absolute_centers, ["G91.1", "G90.1"]),
            self.feed_mode.code(),
            pick(self.retract_to_r, ["G98", "G99"]),
        )?;
        match self.path_mode {
            PathMode::ExactPath => f.write_str(" G61")?,
            PathMode::ExactStop => f.write_str(" G61.1")?,
            PathMode::Blend { tolerance, merge } => {
                f.write_str(" G64")?;
                for (letter, value) in [('P', tolerance), ('Q', merge)] {
                    if let Some(value) = value {
                        write!(f, " {letter}{}", to_the_millionth(value / self.unit()))?;
                    }
                }
            }
        }
        if let Some(feed) = self.feed {
            let feed = to_the_millionth(feed.number * feed.unit / self.unit());
            write!(f, " F{feed}")?;
        }
        let turning = match self.spindle.turning {
            Turning::Off => "M5",
            Turning::Clockwise => "M3",
            Turning::Counterclockwise => "M4",
        };
        let spindle = match self.spindle.orientation {
            Some(orientation) => orientation.to_string(),
            None => turning.to_owned(),
        };
        match self.spindle.surface {
            Some(Surface { speed, within, .. }) => {
                let speed = to_the_millionth(speed / surface_unit(self.inches));
                write!(f, " G96 D{} S{speed} {spindle}", within.1)?;
            }
            None => write!(f, " S{} {spindle}", self.spindle.speed)?,
        }
        match self.coolant {
            Coolant {
                mist: false,
                flood: false,
            } => f.write_str(" M9")?,
            Coolant { mist, flood } => {
                f.write_str(if mist { " M7" } else { "" })?;
                f.write_str(if flood { " M8" } else { "" })?;
            }
        }
        if self.tool != 0 {
            write!(f, " T{} M6", self.tool)?;
        }
        if self.selected_tool != self.tool {
            write!(f, " T{}", self.selected_tool)?;
        }
        Ok(())
    }
}
