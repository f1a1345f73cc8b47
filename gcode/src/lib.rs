//! RS-274/NGC programs: text in, canonical commands in machine coordinates out.
//!
//! ```
#![doc = include_str!("../examples/interpret.rs")]
//! ```
//!
//! A line's bytes (`source`) become tokens (`lexer`), the tokens a block (`parser`, `block`).
//! Its values are computed (`expression`, `parameters`, `system`, `names`), its words sorted into their
//! modal groups (`words`, `modal`) and executed (`execute`, `saved`, `switches`, `offsets`, `coordinates`,
//! `home`, `motion`, `arc`, `spline`, `rational`, `cycles`); O-words lead on to other blocks (`flow`). Under G41 and G42 the contour becomes the way
//! of the tool's centre (`compensation`). Where a program begins in the middle, outputs are what its first
//! part makes of them (`outputs`, `entry`); behind a mistake the others are looked for (`mistakes`, `lost`). [`Interpreter`] hands out the
//! [`Command`]s that come of it, one block at a time. What a program may not do is refused with an
//! [`Error`] that shows the place, the block, what is wrong and what to do.
#![forbid(unsafe_code)]

mod arc;
mod axes;
mod block;
mod command;
mod compensation;
mod coordinates;
mod cycles;
mod entry;
mod error;
mod execute;
mod expression;
mod flow;
mod home;
mod interpreter;
mod lexer;
mod lost;
mod memory;
mod messages;
mod mistakes;
mod modal;
mod motion;
mod names;
mod offsets;
mod outputs;
mod parameters;
mod parser;
mod probe;
mod rational;
mod read_ahead;
mod saved;
mod source;
mod spline;
mod switches;
mod system;
mod tables;
mod thread;
mod threading_cycle;
mod words;

pub use arc::{Arc, Direction, Plane, RADIUS_RATIO, RADIUS_TOLERANCE};
pub use axes::{AxisLetter, AxisSet, Point};
pub use command::{
    ANALOG_INPUTS, ANALOG_OUTPUTS, Action, Command, Coolant, CoolantChange, DIGITAL_INPUTS,
    DIGITAL_OUTPUTS, Feed, InputWait, Orientation, Output, Outputs, PathMode, Probe, Span, Spindle,
    Stop, Surface, TakenInput, Turning, Until, Way,
};
pub use coordinates::WorkCoordinates;
pub use cycles::Cycle;
pub use entry::{Answer, Entry, InEffect, Place};
pub use error::{Error, Fault};
pub use home::Homed;
pub use interpreter::Interpreter;
pub use lexer::Columns;
pub use memory::{Memory, Unlike};
pub use modal::{Code, FeedMode, Modes, Motion, ProgrammedFeed};
pub use motion::LIMIT_NOISE;
pub use names::MachineNames;
pub use probe::Probed;
pub use source::{Input, MAX_LINE};
pub use spline::Spline;
pub use tables::{Tables, TablesError, Tool};

use std::sync::atomic::{AtomicBool, AtomicU64};

/// Blocks, or moves that they ask for, after which a program that does not end is refused.
pub const MAX_BLOCKS: u64 = 10_000_000;

/// What a program needs to know of the machine and of the operator's switches.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The axes that the machine has; words of others are refused.
    pub axes: AxisSet,
    /// Where the machine stands when the program starts, machine coordinates.
    pub start: Point,
    /// Work offsets, reference points and tools; the interpreter keeps what the program makes of
    /// them, see [`Interpreter::tables`].
    pub tables: Tables,
    /// Soft limits by [`AxisLetter::index`]: least and greatest machine coordinate. A motion that leaves
    /// them anywhere is refused.
    pub limits: [Option<(f64, f64)>; 9],
    /// What the programs before have left; the interpreter keeps what this one makes of it, see
    /// [`Interpreter::memory`].
    pub memory: Memory,
    /// What outputs are as the program begins.
    pub outputs: Outputs,
    /// What coolant runs as the program begins.
    pub coolant: Coolant,
    /// Lines that were typed in: where they end without M2 the modal state goes on.
    pub typed: bool,
    /// Digital inputs that M66 can wait for: bit 0 is P0.
    pub inputs: u64,
    /// Analog inputs that M66 can read: bit 0 is E0.
    pub analog_inputs: u64,
    /// What can be read by name: `#<_hal[…]>`, `#<_ini[…]…>`.
    pub names: std::sync::Arc<MachineNames>,
    /// Whether the spindle's angle is measured, for G33 and G95.
    pub has_spindle_angle: bool,
    /// Whether there is a probe for G38.2 to G38.5.
    pub has_probe: bool,
    /// By [`AxisLetter::index`], what G28.2 does with the axis; `None`: it knows where it is.
    pub homed: [Option<Homed>; 9],
    /// Whether the spindle turns at an S that changes, for G96.
    pub sets_spindle_speed: bool,
    /// Least and greatest S beside 0, 1/min.
    pub spindle_speeds: Option<(f64, f64)>,
    /// Skip blocks that begin with `/`.
    pub block_delete: bool,
    /// Refuse a program that executes more blocks, or asks for more moves by them; `None` for one that runs as
    /// it is read.
    pub max_blocks: Option<u64>,
    /// Refuse a program that executes more blocks without a movement, a dwell or a stop: a loop
    /// that does nothing.
    pub max_idle_blocks: u64,
    /// How many bytes of the program itself have been read, for who watches: the furthest that it has come.
    pub read: std::sync::Arc<AtomicU64>,
    /// Refuse to go on once this is set: nobody wants the program any more.
    pub abandoned: std::sync::Arc<AtomicBool>,
}

impl Setup {
    /// A machine with these axes at its zero, without offsets and limits, switches off.
    pub fn new(axes: AxisSet) -> Setup {
        Setup {
            axes,
            start: Point::ZERO,
            tables: Tables::default(),
            limits: [None; 9],
            memory: Memory::default(),
            outputs: Outputs::default(),
            coolant: Coolant::default(),
            typed: false,
            inputs: 0,
            analog_inputs: 0,
            names: std::sync::Arc::default(),
            has_spindle_angle: false,
            has_probe: false,
            homed: [None; 9],
            sets_spindle_speed: false,
            spindle_speeds: None,
            block_delete: false,
            max_blocks: Some(MAX_BLOCKS),
            max_idle_blocks: MAX_BLOCKS,
            read: std::sync::Arc::default(),
            abandoned: std::sync::Arc::default(),
        }
    }
}
