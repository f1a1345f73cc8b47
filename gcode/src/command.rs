//! Canonical commands: what a program asks of the machine, in machine coordinates.

use std::fmt;
use std::time::Duration;

use super::arc::Arc;
use super::axes::{AxisLetter, AxisSet, Point};
use super::lexer::Columns;
use super::spline::Spline;

/// One command and the block that asked for it.
#[derive(Clone, Debug, PartialEq)]
pub struct Command {
    /// Where in the program it stands.
    pub span: Span,
    /// What is to be done.
    pub action: Action,
}

/// A stretch of one line of a program or of one of its subroutine files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Span {
    /// Which file: 0 is the program, see `Interpreter::file`.
    pub file: u16,
    /// Line number, from 1.
    pub line: u32,
    /// Columns in the line.
    pub columns: Columns,
}

/// What is to be done. Points are machine coordinates: mm, rotary axes degrees.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Straight to a point as fast as the axes allow (G0). May be of zero length.
    Rapid {
        /// Where to.
        to: Point,
    },
    /// Straight to a point at a feed (G1). May be of zero length.
    Feed {
        /// Where to.
        to: Point,
        /// How fast.
        feed: Feed,
    },
    /// Along an arc, helix or full circle at a feed (G2, G3).
    Arc {
        /// The curve.
        arc: Arc,
        /// How fast.
        feed: Feed,
    },
    /// Along a spline at a feed (G5, G5.1; of G5.2 to G5.3 one for each polynomial).
    Spline {
        /// The curve.
        spline: Spline,
        /// How fast.
        feed: Feed,
    },
    /// Straight to a point in step with the spindle, from where its angle is a whole number of turns (G33).
    Thread {
        /// Where to.
        to: Point,
        /// How far along the way there in a turn, mm.
        lead: f64,
    },
    /// Straight to a point in step with the spindle, which is turned round there, and back in step to where it began
    /// (G33.1, G74, G84).
    Tap {
        /// Where to.
        to: Point,
        /// How far along the way there in a turn, mm.
        lead: f64,
    },
    /// Straight towards a point at a feed until the probe's contact changes (G38.2 … G38.5). The program goes on
    /// once it is known what came of it.
    Probe {
        /// Where to at most.
        to: Point,
        /// How fast.
        feed: Feed,
        /// What is looked for.
        probe: Probe,
    },
    /// Home axes (G28.2). The program goes on once it is known where they are.
    Home {
        /// Which.
        axes: AxisSet,
        /// Where the machine is expected to be then.
        to: Point,
    },
    /// Rest for a time (G4), s.
    Dwell {
        /// How long, s; may be zero.
        seconds: f64,
    },
    /// Rest with the drives enabled until the operator goes on (M0, M1, M6).
    Stop(Stop),
    /// The spindle is to be in this state from here on (M3, M4, M5, S).
    Spindle(Spindle),
    /// The coolant is to be in this state from here on (M7, M8, M9).
    Coolant(CoolantChange),
    /// This tool is in the spindle from here on, without a change (M61); 0: none.
    ToolLoaded(u32),
    /// The tool that the next change loads (T).
    SelectTool(u32),
    /// A command for the machine's outputs (M62 … M65, M67, M68, M100 … M199).
    Output(Output),
    /// Tell the operator something (MSG, DEBUG, PRINT, a comment beside a stop).
    Message(String),
    /// Rest until an input of the machine is there (M66).
    AwaitInput(InputWait),
    /// Rest, and keep what an input of the machine is there (M66 L0).
    TakeInput(TakenInput),
    /// Come to rest and tell what the inputs and outputs of the machine are (`#<_hal[…]>`), and what the last M66 found
    /// (`#5399`). The program goes on once that is known.
    ReadSignals {
        /// It is the latter that is asked for.
        input_result: bool,
    },
    /// How the path is followed from here on (G61, G61.1, G64).
    PathMode(PathMode),
    /// The end of the program (M2, M30, closing `%`, end of file): always the last command.
    End,
}

impl Action {
    /// Where it leads the machine, if it is a motion that ends elsewhere than where it begins.
    pub(crate) fn destination(&self) -> Option<Point> {
        match self {
            Action::Rapid { to }
            | Action::Feed { to, .. }
            | Action::Thread { to, .. }
            | Action::Probe { to, .. }
            | Action::Home { to, .. } => Some(*to),
            Action::Arc { arc, .. } => Some(arc.to),
            Action::Spline { spline, .. } => Some(spline.to),
            _ => None,
        }
    }

    /// Where it leads the machine, also where it comes back from there.
    pub fn leads_to(&self) -> Option<Point> {
        match self {
            Action::Tap { to, .. } => Some(*to),
            action => action.destination(),
        }
    }

    /// The same with an axis at this coordinate wherever it begins and leads.
    #[must_use]
    pub fn with_axis_at(mut self, axis: AxisLetter, at: f64) -> Self {
        let points = match &mut self {
            Action::Rapid { to }
            | Action::Feed { to, .. }
            | Action::Thread { to, .. }
            | Action::Tap { to, .. }
            | Action::Probe { to, .. }
            | Action::Home { to, .. } => [Some(to), None],
            Action::Arc { arc, .. } => [Some(&mut arc.from), Some(&mut arc.to)],
            Action::Spline { spline, .. } => [Some(&mut spline.from), Some(&mut spline.to)],
            _ => [None, None],
        };
        for point in points.into_iter().flatten() {
            point[axis] = at;
        }
        self
    }
}

/// How fast a feed move runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Feed {
    /// G94: mm/s along the path of X Y Z; of U V W if none of X Y Z moves; deg/s of the rotary axes
    /// if only they move.
    Rate(f64),
    /// G93: the whole move takes this time, s.
    Duration(f64),
    /// G95: by the turns of the spindle.
    PerTurn {
        /// The way in each, mm or degrees of what `Rate` counts.
        travel: f64,
        /// How many turns a second the spindle is told to make, above 0.
        turns: f64,
    },
}

impl Feed {
    /// How fast a path of that length is to be gone along where the spindle turns as it is told, mm/s or deg/s.
    pub fn speed(self, length: f64) -> f64 {
        match self {
            Feed::Rate(rate) => rate,
            Feed::Duration(seconds) => length / seconds,
            Feed::PerTurn { travel, turns } => travel * turns,
        }
    }
}

/// What a probing looks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Probe {
    /// The loss of contact (G38.4, G38.5), not contact (G38.2, G38.3).
    pub away: bool,
    /// Not to find it is an error (G38.2, G38.4).
    pub required: bool,
}

/// Why a program stops in the middle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// M0
    Program,
    /// M1: where the machine's optional stop is on.
    Optional,
    /// M6: the operator loads this tool (0: none).
    ToolChange {
        /// The tool number.
        tool: u32,
    },
}

/// What the spindle does.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Spindle {
    /// Whether and how it turns.
    pub turning: Turning,
    /// Programmed speed, 1/min; at a constant surface speed what that asks for where the tool is.
    pub speed: f64,
    /// A constant surface speed (G96).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<Surface>,
    /// Where one that does not turn is held (M19); `None`: it is free.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation: Option<Orientation>,
}

impl Spindle {
    /// As the program has it, whatever a constant surface speed has come to.
    #[must_use]
    pub fn as_programmed(self) -> Self {
        let speed = self.surface.map_or(self.speed, |_| 0.0);
        Spindle { speed, ..self }
    }

    /// As M5 leaves it.
    #[must_use]
    pub fn stopped(self) -> Self {
        Spindle {
            turning: Turning::Off,
            orientation: None,
            ..self
        }
    }

    /// How fast it is to turn where X is at that machine coordinate, mm.
    #[must_use]
    pub fn at(self, x: f64) -> Self {
        let speed = self.surface.map_or(self.speed, |it| it.speed_at(x));
        Spindle { speed, ..self }
    }
}

/// An angle at which the spindle is held.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Orientation {
    /// Clockwise from where the spindle's angle is 0, degrees, from 0 to below 360.
    pub angle: f64,
    /// Which way round it is to come there from rest.
    pub way: Way,
    /// Within this time; `None`: within what the machine takes at most.
    pub within: Option<Duration>,
}

impl fmt::Display for Orientation {
    /// The code that asks for it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "M19 R{}", self.angle)?;
        match self.way {
            Way::Shorter => {}
            Way::Clockwise => f.write_str(" P1")?,
            Way::Counterclockwise => f.write_str(" P2")?,
        }
        match self.within {
            Some(within) => write!(f, " Q{}", within.as_secs_f64()),
            None => Ok(()),
        }
    }
}

/// Which way round a spindle comes to an angle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Way {
    /// The shorter way.
    #[default]
    Shorter,
    /// As M3 turns it.
    Clockwise,
    /// As M4 turns it.
    Counterclockwise,
}

impl Way {
    /// What is left to turn to an angle that is so much further on clockwise, both in turns.
    #[must_use]
    pub fn turns(self, further: f64) -> f64 {
        let clockwise = further.rem_euclid(1.0);
        match self {
            Way::Clockwise => clockwise,
            Way::Counterclockwise if clockwise > 0.0 => clockwise - 1.0,
            Way::Shorter if clockwise > 0.5 => clockwise - 1.0,
            Way::Counterclockwise | Way::Shorter => clockwise,
        }
    }
}

/// A surface that is to pass the tool at one speed: the spindle is the faster the nearer X is to its axis.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Surface {
    /// mm/s
    pub speed: f64,
    /// Where the spindle's axis is along X, machine coordinate, mm.
    pub centre: f64,
    /// The least and the greatest speed of the spindle, 1/min.
    pub within: (f64, f64),
}

impl Surface {
    /// The speed of the spindle where X is at that machine coordinate, 1/min.
    #[must_use]
    pub fn speed_at(&self, x: f64) -> f64 {
        let around = core::f64::consts::TAU * (x - self.centre).abs();
        let (least, most) = self.within;
        match self.speed {
            0.0 => 0.0,
            speed => (60.0 * speed / around).clamp(least, most),
        }
    }
}

/// How the spindle turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Turning {
    /// M5
    #[default]
    Off,
    /// M3
    Clockwise,
    /// M4
    Counterclockwise,
}

/// Digital inputs that a program can name: P 0 … 63.
pub const DIGITAL_INPUTS: usize = 64;
/// Digital outputs that a program can name: P 0 … 63.
pub const DIGITAL_OUTPUTS: usize = 64;
/// Analog outputs that a program can name: E 0 … 3.
pub const ANALOG_OUTPUTS: usize = 4;
/// Analog inputs of M66: E0 to E7.
pub const ANALOG_INPUTS: usize = 8;

/// What an M-code does to the machine's outputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Output {
    /// A digital output is switched: M62, M63 with the next motion, M64, M65 without.
    Digital {
        /// Which one, below [`DIGITAL_OUTPUTS`].
        number: u8,
        /// On: M62, M64.
        on: bool,
        /// When the next motion begins; never, if none does.
        with_motion: bool,
    },
    /// An analog output is set: M67 with the next motion, M68 without.
    Analog {
        /// Which one, below [`ANALOG_OUTPUTS`].
        number: u8,
        /// To what.
        value: f64,
        /// As above.
        with_motion: bool,
    },
    /// An M-code of the user's, that is handed on.
    User {
        /// Its number, 100 … 199.
        code: u16,
        /// Its P word.
        p: Option<f64>,
        /// Its Q word.
        q: Option<f64>,
    },
}

/// What the outputs of a machine are, by the numbers that programs have for them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outputs {
    /// The digital outputs that are on: bit 0 is P0.
    pub digital: u64,
    /// The analog outputs, from E0 on.
    pub analog: [f64; ANALOG_OUTPUTS],
}

impl Outputs {
    /// Switches a digital output.
    pub fn put(&mut self, number: u8, on: bool) {
        let bit = 1 << number;
        self.digital = self.digital & !bit | if on { bit } else { 0 };
    }

    /// Does what a code does, whenever that is to be; one of the user's is nothing to outputs.
    pub fn switch(&mut self, output: &Output) {
        match *output {
            Output::Digital { number, on, .. } => self.put(number, on),
            Output::Analog { number, value, .. } => self.analog[usize::from(number)] = value,
            Output::User { .. } => {}
        }
    }

    /// The codes that make these outputs of `others`, at once and in the order of their numbers.
    pub(crate) fn unlike(self, others: &Outputs) -> impl Iterator<Item = Output> {
        let differ = self.digital ^ others.digital;
        let digital = (0..u64::BITS as u8).filter(move |number| differ >> number & 1 != 0);
        let digital = digital.map(move |number| Output::Digital {
            number,
            on: self.digital >> number & 1 != 0,
            with_motion: false,
        });
        let pairs = self.analog.into_iter().zip(others.analog);
        let analog = (0..)
            .zip(pairs)
            .filter(|(_, (value, other))| value != other);
        let analog = analog.map(|(number, (value, _))| Output::Analog {
            number,
            value,
            with_motion: false,
        });
        digital.chain(analog)
    }
}

impl Output {
    /// Whether it waits for the next motion.
    pub fn is_with_motion(&self) -> bool {
        match *self {
            Output::Digital { with_motion, .. } | Output::Analog { with_motion, .. } => with_motion,
            Output::User { .. } => false,
        }
    }

    /// Whether another code switches the same output; one of the user's switches none.
    pub(crate) fn is_of_same_output(&self, other: &Output) -> bool {
        match (self, other) {
            (Output::Digital { number, .. }, Output::Digital { number: other, .. })
            | (Output::Analog { number, .. }, Output::Analog { number: other, .. }) => {
                number == other
            }
            _ => false,
        }
    }
}

impl fmt::Display for Output {
    /// As it is written in a program.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Output::Digital {
                number,
                on,
                with_motion,
            } => {
                let code = if with_motion { 62 } else { 64 } + u8::from(!on);
                write!(f, "M{code} P{number}")
            }
            Output::Analog {
                number,
                value,
                with_motion,
            } => write!(
                f,
                "M{} E{number} Q{value}",
                if with_motion { 67 } else { 68 }
            ),
            Output::User { code, p, q } => {
                write!(f, "M{code}")?;
                for (letter, value) in [('P', p), ('Q', q)] {
                    if let Some(value) = value {
                        write!(f, " {letter}{value}")?;
                    }
                }
                Ok(())
            }
        }
    }
}

/// What M66 waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputWait {
    /// The digital input, below [`DIGITAL_INPUTS`].
    pub number: u8,
    /// What it has to do.
    pub until: Until,
    /// Within this time; Q.
    pub within: Duration,
}

/// An input of which M66 L0 keeps what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TakenInput {
    /// P: a digital one, below [`DIGITAL_INPUTS`].
    Digital(u8),
    /// E: an analog one, below [`ANALOG_INPUTS`].
    Analog(u8),
}

/// What an input has to do; L of M66.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Until {
    /// L1: come on.
    Rise,
    /// L2: go off.
    Fall,
    /// L3: be on.
    High,
    /// L4: be off.
    Low,
}

impl Until {
    /// Whether it is on then.
    #[must_use]
    pub fn is_on(self) -> bool {
        matches!(self, Self::Rise | Self::High)
    }
}

/// Which coolant runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Coolant {
    /// M7
    pub mist: bool,
    /// M8
    pub flood: bool,
}

/// What a code makes of the coolant; `None` leaves it as it is, whoever has switched it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CoolantChange {
    /// M7, M9
    pub mist: Option<bool>,
    /// M8, M9
    pub flood: Option<bool>,
}

impl CoolantChange {
    /// M9
    pub const OFF: Self = Self {
        mist: Some(false),
        flood: Some(false),
    };

    /// What makes one of the other: no more than that.
    pub(crate) fn between(before: Coolant, then: Coolant) -> Self {
        let unlike = |before, then| (before != then).then_some(then);
        Self {
            mist: unlike(before.mist, then.mist),
            flood: unlike(before.flood, then.flood),
        }
    }

    /// What runs behind it.
    #[must_use]
    pub fn of(self, before: Coolant) -> Coolant {
        Coolant {
            mist: self.mist.unwrap_or(before.mist),
            flood: self.flood.unwrap_or(before.flood),
        }
    }
}

/// That and nothing else is to run.
impl From<Coolant> for CoolantChange {
    fn from(Coolant { mist, flood }: Coolant) -> Self {
        Self {
            mist: Some(mist),
            flood: Some(flood),
        }
    }
}

/// How the path is followed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PathMode {
    /// G61: through every programmed point without a stop where the path allows it.
    #[default]
    ExactPath,
    /// G61.1: a stop at the end of every block.
    ExactStop,
    /// G64: corners blended.
    Blend {
        /// P: greatest distance from the programmed path, mm; the machine's default if absent.
        tolerance: Option<f64>,
        /// Q: moves whose points lie within this of a line are merged, mm.
        merge: Option<f64>,
    },
}
