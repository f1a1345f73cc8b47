//! Canonical commands: what a program asks of the machine, in machine coordinates.

use std::fmt;

use super::arc::Arc;
use super::axes::Point;
use super::lexer::Columns;

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
    Coolant(Coolant),
    /// This tool is in the spindle from here on, without a change (M61); 0: none.
    ToolLoaded(u32),
    /// The tool that the next change loads (T).
    SelectTool(u32),
    /// A command for the machine's outputs (M62 … M65, M100 … M199), to be given when the motion
    /// before it is done.
    Output(Output),
    /// How the path is followed from here on (G61, G61.1, G64).
    PathMode(PathMode),
    /// The end of the program (M2, M30, closing `%`, end of file): always the last command.
    End,
}

/// How fast a feed move runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Feed {
    /// G94: mm/s along the path of X Y Z; of U V W if none of X Y Z moves; deg/s of the rotary axes
    /// if only they move.
    Rate(f64),
    /// G93: the whole move takes this time, s.
    Duration(f64),
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
    /// Programmed speed, 1/min.
    pub speed: f64,
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

/// An M-code that the controller hands on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Output {
    /// The M-code's number.
    pub code: u16,
    /// Its P word.
    pub p: Option<f64>,
    /// Its Q word.
    pub q: Option<f64>,
}

impl fmt::Display for Output {
    /// As it is written in a program.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "M{}", self.code)?;
        for (letter, value) in [('P', self.p), ('Q', self.q)] {
            if let Some(value) = value {
                write!(f, " {letter}{value}")?;
            }
        }
        Ok(())
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
