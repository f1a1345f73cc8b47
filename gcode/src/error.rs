//! Why a program is refused: where, the block, what is wrong and what to do.

use std::io;

use super::axes::{AxisLetter, AxisSet};
use super::command::Span;
use super::lexer::Columns;
use super::modal::Code;

/// A refused program.
#[derive(Debug, thiserror::Error)]
#[error("{file}:{line}:{}: {fault}{}", columns.start, excerpt(block, *columns))]
pub struct Error {
    /// The program's name, or that of a subroutine file.
    pub file: String,
    /// Line number, from 1.
    pub line: u32,
    /// The columns of what is wrong.
    pub columns: Columns,
    /// The line's text.
    pub block: String,
    /// What is wrong and what to do.
    pub fault: Fault,
}

impl Error {
    /// The block as it can be shown.
    pub fn shown_block(&self) -> String {
        shown(&self.block)
    }
}

/// The block without what a terminal would act upon.
fn shown(block: &str) -> String {
    let shown = |c: char| if c.is_control() { ' ' } else { c };
    block.chars().map(shown).collect()
}

/// The block and a mark under what is wrong, each on a line of its own.
fn excerpt(block: &str, columns: Columns) -> String {
    if block.is_empty() {
        return String::new();
    }
    let text = shown(block);
    let room = block.chars().count() + 1;
    let start = (columns.start as usize).clamp(1, room);
    let length = (columns.end as usize).clamp(start + 1, room + 1) - start;
    let mark = "^".repeat(length);
    format!("\n  {text}\n  {:indent$}{mark}", "", indent = start - 1)
}

/// A fault and its columns, before it is known in which line.
#[derive(Debug)]
pub(crate) struct Refusal {
    pub(crate) columns: Columns,
    pub(crate) fault: Box<Fault>,
    /// The block, if it is not the one that was read last.
    pub(crate) origin: Option<Box<Origin>>,
}

impl Refusal {
    pub(crate) fn new(columns: Columns, fault: Fault) -> Refusal {
        Refusal {
            columns,
            fault: Box::new(fault),
            origin: None,
        }
    }
}

/// A block that something is still to be done for when others have been read.
#[derive(Clone, Debug)]
pub(crate) struct Origin {
    pub(crate) span: Span,
    pub(crate) text: std::sync::Arc<str>,
}

impl Origin {
    /// A refusal of this block.
    pub(crate) fn refuse(&self, fault: Fault) -> Refusal {
        Refusal {
            origin: Some(Box::new(self.clone())),
            ..Refusal::new(self.span.columns, fault)
        }
    }
}

impl Fault {
    /// So many blocks are more than are allowed, as M99 has the program begin anew or for another reason.
    pub(crate) fn without_end(allowed: u64, begins_anew: bool) -> Self {
        match begins_anew {
            true => Self::BeginsAnew { allowed },
            false => Self::TooManyBlocks { allowed },
        }
    }

    /// Whether nothing can be said of the program behind it.
    pub(crate) fn ends_reading(&self) -> bool {
        matches!(
            self,
            Fault::Read(_)
                | Fault::Encoding
                | Fault::NoEnd
                | Fault::NoSuchLine { .. }
                | Fault::TooManyBlocks { .. }
                | Fault::BeginsAnew { .. }
                | Fault::IdleLoop { .. }
                | Fault::Abandoned
        )
    }

    /// Whether it is not known which blocks come next.
    pub(crate) fn loses_the_flow(&self) -> bool {
        matches!(
            self,
            Fault::NoEndOf { .. }
                | Fault::NotOpen { .. }
                | Fault::NoSubprogram { .. }
                | Fault::NoSubprogramEnd
                | Fault::SubprogramEndInSub
                | Fault::RunsInto { .. }
                | Fault::CallsTooDeep { .. }
        )
    }
}

/// Whether words that are named so are more than one.
fn is_plural(words: &str) -> bool {
    let (named, _) = words.split_once(',').unwrap_or((words, ""));
    named.ends_with("words") || named.contains(" and ")
}

/// What is wrong with a block. The text says what to do.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "each variant's message is its documentation")]
pub enum Fault {
    // The text.
    #[error("cannot read the program: {0}")]
    Read(#[from] io::Error),
    #[error("the line has more than {allowed} bytes: break it up; is this a program?")]
    LineTooLong { allowed: usize },
    #[error("{0:?} means nothing here: remove it")]
    Character(char),
    #[error("bytes of 0 are in no text: is the file UTF-16? Save it as UTF-8")]
    Encoding,
    #[error("a comma is no decimal point: write `{0}`")]
    Comma(String),
    #[error("a number has one point at most, before its decimals, and no commas: write it so")]
    Commas,
    #[error("`{0}` is not a number: digits with at most one point, and not beyond 1e308")]
    Number(String),
    #[error("the comment has no end: add `)`")]
    UnclosedComment,
    #[error("comments do not nest: remove this `(`")]
    NestedComment,
    #[error("the name has no end: add `>`")]
    UnclosedName,
    #[error("the name is empty: write it between `<` and `>`")]
    EmptyName,
    #[error("{written} is not a statement: write {nearest}, if that is meant")]
    Statement {
        written: String,
        nearest: &'static str,
    },
    #[error("{written} is a statement of another controller's macros: write {instead}")]
    Macro {
        written: &'static str,
        instead: &'static str,
    },
    #[error("found {found}: write {what}")]
    Expected { what: &'static str, found: String },
    #[error("nested deeper than {allowed}: compute a part in a block of its own")]
    TooDeep { allowed: u32 },
    #[error("the line number must be first: move N to the front of the block")]
    LineNumberPlace,
    #[error("an O-word stands alone in its block: give it a line of its own")]
    FlowPlace,
    #[error("`O` is a letter here: write 0, if that is meant")]
    LetterO,

    // Values.
    #[error("no parameter #{0}: numbers from 1 to 5602 can be used")]
    ParameterIndex(f64),
    #[error("parameter #<{0}> has no value: set it first")]
    ParameterUnset(String),
    #[error("the machine file has no {name}: {nearest}")]
    NoSuchName { name: String, nearest: String },
    #[error("{0} is no number in the machine file: only numbers, true and false can be read")]
    NoNumber(String),
    #[error("the machine file has several {0}, in which case means nothing: rename all but one")]
    SeveralNamed(String),
    #[error(
        "{0} cannot be set: switch an output with M62 to M65 P, M67 or M68 E, by its number in the machine file"
    )]
    SignalSet(String),
    #[error(
        "what #<_hal[…]> and #5399 are cannot be known while G41 or G42 is on, as that reads ahead: set a parameter to it \
         before"
    )]
    ReadCompensated,
    #[error(
        "what M66 found is known only where a block names #5399 itself: write it so, or set a parameter to it before"
    )]
    InputResult,
    #[error(
        "#5399 is of an M66 before the line at which the program was begun, and was not executed: begin before it"
    )]
    InputPassed,
    #[error("parameter {0} cannot be set: it shows the machine's state")]
    ParameterReadOnly(String),
    #[error("no result: a division by zero, or a value that the function is not defined for")]
    NoResult,
    #[error("{letter}{value} is out of range: {allowed}")]
    Value {
        letter: char,
        value: f64,
        allowed: &'static str,
    },
    #[error("{axis} would go to {value}: coordinates end at ±{allowed}")]
    Coordinate {
        axis: AxisLetter,
        value: f64,
        allowed: f64,
    },

    // Words.
    #[error("the machine has no axis {axis}: use {axes}")]
    NoSuchAxis { axis: AxisLetter, axes: AxisSet },
    #[error("{0} is not a code of this controller: remove it")]
    UnknownCode(Code),
    #[error("{code} is not supported: {reason}")]
    Unsupported { code: Code, reason: &'static str },
    #[error("{letter} is written twice: keep one")]
    DuplicateWord { letter: char },
    #[error("{second} contradicts {first} (both are {group}): write them in two blocks")]
    Conflict {
        first: Code,
        second: Code,
        group: &'static str,
    },
    #[error("nothing in this block uses {letter}: remove it, or add the code that it belongs to")]
    UnusedWord { letter: char },
    #[error("both {first} and {second} use {letter}: write them in two blocks")]
    SharedWord {
        letter: char,
        first: Code,
        second: Code,
    },
    #[error("{code} needs {words}: add {}", if is_plural(words) { "them" } else { "it" })]
    MissingWord { code: Code, words: &'static str },

    #[error("S{speed} is not a speed of the spindle: {least} to {most}, or 0")]
    SpindleSpeed { speed: f64, least: f64, most: f64 },

    #[error("the machine has no input {number}: give one `number = {number}` in the machine file")]
    NoSuchInput { number: u32 },

    #[error(
        "the machine has no analog input {number}: give one `number = {number}` and `full_scale` in the machine file"
    )]
    NoSuchAnalogInput { number: u32 },

    #[error("tool {number} is not in the tool table: add it, or set it with G10 L1 P{number}")]
    NoSuchTool { number: u32 },

    #[error("{code} P0 would take the override from the operator, who keeps it: remove it")]
    OperatorsOverride { code: Code },

    #[error(
        "{code} in the plane of G18 or G19 while the work is turned in X and Y: write G17, or G10 L2 P0 R0 before"
    )]
    TurnedPlane { code: Code },

    #[error(
        "the tables turn X and Y by {rotation}°, and the machine has no {axis}: write G10 L2 P0 R0 before, or remove R there"
    )]
    TurnedWithout { axis: AxisLetter, rotation: f64 },

    #[error("nothing is saved here: write M70 or M73 before, in this subroutine")]
    NothingSaved,
    #[error(
        "{code} would restore {restored}, whose contour has ended: write G40 before M70 or M73, or \
         {restored} behind"
    )]
    RestoreCompensated { code: Code, restored: Code },

    // Motion.
    #[error("{code} does not move at F0: write a feed above 0 in this block or before")]
    FeedZero { code: Code },
    #[error("{code} has no feed: write F in this block or before")]
    NoFeed { code: Code },
    #[error("{code} under G93 has no time: write F in this block (F2 is half a minute)")]
    NoInverseTime { code: Code },
    #[error(
        "G95 moves by the turns of the spindle, whose angle the controller does not measure: write G94, and F as that \
         feed times S, or give [spindle] of the machine file a `drive`"
    )]
    NoFeedPerTurn,
    #[error(
        "{code} under G95 goes as far as the spindle turns, which stands: write M3 or M4 and S before"
    )]
    FeedPerTurnSpindle { code: Code },
    #[error(
        "G96 turns the spindle as fast as X asks for, and nothing here tells it how fast: write G97 and S in 1/min, or \
         give [spindle] of the machine file a `drive`, or an [[output]] `function = \"spindle_speed\"`"
    )]
    NoSurfaceSpeed,
    #[error("under G96 X is the radius, and X and Y are turned: write G97, or G10 L2 P0 R0 before")]
    SurfaceTurned,
    #[error("{code} needs a spindle at one speed: write G97 and S before")]
    ThreadSurface { code: Code },
    #[error(
        "axis words without a motion: write G0, G1, G2 or G3 in this block, or before it with no G80 in between"
    )]
    NoMotion,
    #[error("polar coordinates give X and Y: leave either these or `@` and `^` out")]
    PolarMixed,
    #[error("polar coordinates are of X and Y: write G17 before")]
    PolarPlane,
    #[error("there is no angle at the origin: write `^` beside `@`")]
    PolarOrigin,
    #[error("polar coordinates are the program's, not the machine's: write X and Y under G53")]
    PolarMachine,
    #[error("G53 goes with G0 or G1 only: add one of them")]
    MachineCoordinatesWithout,
    #[error("the arc has neither centre nor radius: write {0}")]
    ArcUndefined(&'static str),
    #[error("{letter} is not in the plane of the arc: use {allowed}, or select the plane")]
    ArcOffsetPlane { letter: char, allowed: &'static str },
    #[error("the arc has both a radius and a centre: keep one")]
    ArcOverdefined,
    #[error("the arc's centre is its start: correct the offsets")]
    ArcNoRadius,
    #[error(
        "the arc ends {apart:.4} mm beside where the axes stand, and no block has sent them there: move to its start \
         before, so that it is a full circle or none"
    )]
    ArcNearlyClosed { apart: f64 },
    #[error(
        "the arc's end is {end:.4} mm from the centre, its start {start:.4} mm: {difference:.4} mm \
         apart, {allowed:.4} mm allowed: correct the end or the centre"
    )]
    ArcRadii {
        start: f64,
        end: f64,
        difference: f64,
        allowed: f64,
    },
    #[error("an arc of a radius cannot end where it starts: write the centre for a full circle")]
    ArcRadiusSamePoint,
    #[error("radius {radius} mm does not reach the end {length:.4} mm away: correct R or the end")]
    ArcTooFar { radius: f64, length: f64 },
    #[error("{code} has no axis words: write where, or G80 to end the cycle")]
    CycleNowhere { code: Code },
    #[error("{code} is not possible under G93: write G94 and a feed per minute")]
    CycleInverseTime { code: Code },
    #[error("{code} stops a spindle that does not turn: write M3 or M4 before")]
    CycleSpindle { code: Code },
    #[error("{code} does not move {axis}: use the axes of the plane and the one across it")]
    CycleAxis { code: Code, axis: AxisLetter },
    #[error("{code} would start below its end: raise R, or lower {axis}")]
    CycleBelow { code: Code, axis: AxisLetter },
    #[error("the block makes more than {allowed} moves: correct Q or L")]
    CycleTooLong { allowed: usize },
    #[error(
        "{axis} would go to {value:.6}, its soft limits are {least} to {greatest} (machine \
         coordinates): move the work, the offset or the limit"
    )]
    SoftLimit {
        axis: AxisLetter,
        value: f64,
        least: f64,
        greatest: f64,
    },

    // Homing.
    #[error("{code} is not possible while G41 or G42 is on: write G40 and a line before")]
    HomeCompensated { code: Code },
    #[error(
        "{code} does not home {axis}: it has no [axis.homing] in the machine file, and knows where it is"
    )]
    HomeAbsolute { code: Code, axis: AxisLetter },
    #[error(
        "{code} homes no axis without its name: name those that an operator homes by hand, or remove it where all know \
         where they are"
    )]
    HomeNothing { code: Code },

    // Threads.
    #[error(
        "{code} needs a spindle whose angle is measured: name the `drive` that turns it in [spindle] of the machine \
         file, or mill the thread with G2 or G3 and Z"
    )]
    NoSpindleAngle { code: Code },
    #[error(
        "M19 needs a spindle whose angle is measured: name the `drive` that turns it in [spindle] of the machine file, \
         or write M5 and M0, and turn it by hand"
    )]
    NoOrientation,
    #[error("{code} needs a spindle that turns: write M3 or M4 and S before")]
    ThreadSpindle { code: Code },
    #[error("{code} needs a spindle that turns {needs}")]
    TapDirection { code: Code, needs: &'static str },
    #[error("{code} has both K and F, and F is not K times S: write F{feed}, or no F")]
    TapFeed { code: Code, feed: f64 },
    #[error("{code} is for X and Z: write G18 before")]
    ThreadingPlane { code: Code },
    #[error("{code} goes along Z from where the axes are: move {axis} there before")]
    ThreadingAxis { code: Code, axis: AxisLetter },
    #[error(
        "{code} cuts straight passes: remove E and L, and begin and end beside the work, or in a groove"
    )]
    ThreadingTaper { code: Code },
    #[error("{code} would take more than {allowed} passes: correct J or R")]
    TooManyPasses { code: Code, allowed: usize },
    #[error("{code} leads nowhere: write where the thread ends")]
    ThreadNowhere { code: Code },
    #[error("{code} moves along X Y Z only: move {axis} there before")]
    ThreadAxis { code: Code, axis: AxisLetter },
    #[error("{code} is not possible while G41 or G42 is on: write G40 and a line before")]
    ThreadCompensated { code: Code },

    // Probing.
    #[error(
        "{code} needs a probe or a tool setter: give an [[input]] of the machine file `function = \"probe\"` or `\"tool_setter\"`"
    )]
    NoProbe { code: Code },
    #[error("{code} has no axis words: write where the probing ends at the latest")]
    ProbeNowhere { code: Code },
    #[error("{code} ends where it begins: write a place at least 0.254 mm (0.01 inch) away")]
    ProbeTooShort { code: Code },
    #[error("{code} does not turn {axis}: move it there before")]
    ProbeTurns { code: Code, axis: AxisLetter },
    #[error("{code} is not possible under {mode}: write G94 and a feed per minute")]
    ProbeFeedMode { code: Code, mode: Code },
    #[error("{code} is not possible while G41 or G42 is on: write G40 and a line before")]
    ProbeCompensated { code: Code },
    #[error(
        "line {line} is behind a probing, and what that would find is not known: begin where the probing is, \
         or before"
    )]
    BeginProbed { line: u32 },
    #[error(
        "the program does not come to line {line} as it did when it was interrupted: it was changed, or offsets and \
         tools lead it elsewhere: begin at a line that you choose"
    )]
    ResumeElsewhere { line: u32 },
    #[error(
        "line {line} is behind a block with #<_hal[…]> or #5399, and what that would read is not known: begin where that \
         is, or before"
    )]
    BeginRead { line: u32 },

    // Splines.
    #[error("{code} is a curve in X and Y: write G17 before")]
    SplinePlane { code: Code },
    #[error("{code} does not move {axis}: it is a curve in X and Y")]
    SplineAxis { code: Code, axis: AxisLetter },
    #[error("the spline is a point: correct its end or its control points")]
    SplineNowhere,
    #[error("its weights turn the curve too sharply: correct P, or write lines and arcs")]
    NurbsWeights,
    #[error("G5.2 has more than {allowed} points: write G5.3 and begin another")]
    NurbsTooLong { allowed: usize },
    #[error(
        "{points} points are too few for L{order}: write as many as its order, the start among them"
    )]
    NurbsTooFew { points: usize, order: usize },
    #[error("no G5.2 is open here: write it, and a block for each point")]
    NurbsNotBegun,
    #[error("{code} between G5.2 and G5.3: only points and F may stand there, write G5.3 before")]
    NurbsOpen { code: Code },
    #[error("G5.2 has no G5.3: add it")]
    NurbsNotEnded,
    #[error("line {line} is between G5.2 and G5.3: begin where G5.2 is, or before")]
    BeginNurbs { line: u32 },

    // Cutter compensation.
    #[error(
        "{code} is not possible while G41 or G42 is on: write it before, or G40 and a line first"
    )]
    WhileCompensated { code: Code },
    #[error("{0} cannot be set while G41 or G42 is on: set it before, or behind G40")]
    ParameterWhileCompensated(String),
    #[error(
        "{code} behind G40: write a line first (G0 or G1), on which the tool leaves the contour"
    )]
    CutterLeaving { code: Code },
    #[error("{code} has no tool: write D, or load one with T and M6")]
    CutterNoTool { code: Code },
    #[error("the move behind G41 or G42 cannot be an arc: write a line to the contour's start")]
    CutterEntryArc,
    #[error(
        "the move behind G41 or G42 is {length:.4} mm long in the plane, the tool's radius \
         {radius:.4} mm: begin farther away from the contour"
    )]
    CutterEntry { length: f64, radius: f64 },
    #[error(
        "the tool does not fit into this arc: its radius is {cutter:.4} mm, the arc's {radius:.4} \
         mm: take a smaller tool"
    )]
    CutterArc { radius: f64, cutter: f64 },
    #[error(
        "the radii of the arc's start and end differ too much for G41 and G42: write more digits"
    )]
    CutterSpiral,
    #[error(
        "the tool does not fit into the corner between line {line} and this block: one of them is \
         too short for it: take a smaller tool, or leave the step out"
    )]
    CutterCorner { line: u32 },
    #[error(
        "on its way along this block the tool cuts {depth:.4} mm into the contour of line {line}: its radius is \
         {radius:.4} mm: take a smaller tool, or part the contours by G40 and G41"
    )]
    CutterCuts { line: u32, depth: f64, radius: f64 },
    #[error(
        "on its way along line {line} the tool cuts {depth:.4} mm into the contour of this block: its radius is \
         {radius:.4} mm: take a smaller tool, or part the contours by G40 and G41"
    )]
    CutterHasCut { line: u32, depth: f64, radius: f64 },
    #[error(
        "{allowed} blocks without a move in the plane while G41 or G42 is on, which has to know \
         the next: write G40 before them"
    )]
    CutterWaits { allowed: usize },
    #[error(
        "the typed lines end with {code} on, which has to know the block behind: type the whole contour in one go, with G40 and a \
         straight move at its end"
    )]
    CompensationTyped { code: Code },
    #[error("line {line} is on a compensated contour: begin where G41 or G42 is, or before")]
    BeginCompensated { line: u32 },

    // The program as a whole.
    #[error("O{label} has no {missing}: add it")]
    NoEndOf {
        label: String,
        missing: &'static str,
    },
    #[error("no {what} O{label} is open here: correct the label, or how they nest")]
    NotOpen { label: String, what: &'static str },
    #[error("O{label} is in use by a construct around this one: give each its own label")]
    LabelInUse { label: String },
    #[error("loops and branches nest deeper than {allowed}: move a part into a subroutine")]
    NestedTooDeep { allowed: usize },
    #[error("a SUB inside a SUB: end the one before")]
    NestedSub,
    #[error("O{label} is defined twice: give each subroutine its own label")]
    DefinedTwice { label: String },
    #[error("there is no subroutine O{label}: {remedy}")]
    NoSubroutine { label: String, remedy: String },
    #[error("there is no subprogram O{number}: {remedy}")]
    NoSubprogram { number: u32, remedy: String },
    #[error("the subprogram has no M99: add it")]
    NoSubprogramEnd,
    #[error("M99 ends subprograms of M98: write ENDSUB or RETURN here")]
    SubprogramEndInSub,
    #[error(
        "the program runs into subprogram O{label}: end it with M2 or M30, a subprogram with M99"
    )]
    RunsInto { label: String },
    #[error("subroutines call each other deeper than {allowed}: does a recursion not end?")]
    CallsTooDeep { allowed: usize },
    #[error("a computed O-word can only be called: write the number or `<name>`")]
    ComputedLabel,
    #[error("O{0} is no label: it has to be a whole number")]
    LabelNumber(f64),
    #[error("{0} is not a number of repetitions: it has to be whole")]
    RepeatCount(f64),
    #[error("the program begins with `%` and ends without: is the file complete? Add `%` or M30")]
    NoEnd,
    #[error("the program ends before line {line}: name a line that it comes to")]
    NoSuchLine { line: u32 },
    #[error(
        "{allowed} blocks were executed, or moves of theirs, without an end: end the loop, or run it with --stream"
    )]
    TooManyBlocks { allowed: u64 },
    #[error(
        "{allowed} blocks were executed without an end, as M99 begins the program anew: write M30 in its place, or run it \
         with --stream"
    )]
    BeginsAnew { allowed: u64 },
    #[error(
        "{allowed} blocks were executed and nothing moved: end the loop, or let it move or dwell"
    )]
    IdleLoop { allowed: u64 },
    #[error("nobody wants the program any more: run it again")]
    Abandoned,
}

impl Fault {
    /// Whether a block is wrong by how it is written, whatever was before it.
    #[must_use]
    pub fn is_misspelling(&self) -> bool {
        matches!(
            self,
            Self::LineTooLong { .. }
                | Self::Character(_)
                | Self::Comma(_)
                | Self::Commas
                | Self::Number(_)
                | Self::UnclosedComment
                | Self::NestedComment
                | Self::UnclosedName
                | Self::EmptyName
                | Self::Statement { .. }
                | Self::Macro { .. }
                | Self::Expected { .. }
                | Self::TooDeep { .. }
                | Self::LineNumberPlace
                | Self::FlowPlace
                | Self::LetterO
                | Self::NoSuchAxis { .. }
                | Self::UnknownCode(_)
                | Self::Unsupported { .. }
                | Self::DuplicateWord { .. }
                | Self::Conflict { .. }
                | Self::CompensationTyped { .. }
        )
    }
}
