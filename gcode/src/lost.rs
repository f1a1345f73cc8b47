//! What is not known any more behind blocks that were refused, and which faults hang on it.
//!
//! A block that was refused may have been meant to set what later blocks rely on: each such thing is a bit of [`Things`], beside the
//! axes whose place is not known. What a later block sets rightly is known again. A fault that hangs on what is lost may be none,
//! and is not told ([`Fault::hangs_on`]). As long as no block was refused nothing is lost, and all of this does nothing.

use std::ops::{BitAnd, BitOr, BitOrAssign};

use super::axes::{AxisLetter, AxisSet};
use super::block::{Block, Target};
use super::cycles::Cycle;
use super::error::Fault;
use super::execute::{Compensated, State};
use super::expression::{Operation, Value};
use super::modal::{Code, Group, Motion, Standing};
use super::parser::{CUT, Unread};
use super::words::{Letters, Words};

/// A set of what blocks set and later ones rely on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Things(u32);

impl Things {
    pub(crate) const NONE: Things = Things(0);
    pub(crate) const FEED: Things = Things(1);
    pub(crate) const FEED_MODE: Things = Things(1 << 1);
    pub(crate) const UNITS: Things = Things(1 << 2);
    pub(crate) const DISTANCE: Things = Things(1 << 3);
    pub(crate) const ARC_DISTANCE: Things = Things(1 << 4);
    pub(crate) const PLANE: Things = Things(1 << 5);
    /// Which motion goes on.
    pub(crate) const MOTION: Things = Things(1 << 6);
    pub(crate) const CYCLE_RETURN: Things = Things(1 << 7);
    /// G54 …, or by an unread G any other offset.
    pub(crate) const WORK_OFFSET: Things = Things(1 << 8);
    pub(crate) const TOOL_LENGTH: Things = Things(1 << 9);
    /// G52, G92
    pub(crate) const SHIFT: Things = Things(1 << 10);
    /// G10
    pub(crate) const TABLE: Things = Things(1 << 11);
    /// Where G28 and G30 lead.
    pub(crate) const REFERENCES: Things = Things(1 << 12);
    /// S
    pub(crate) const SPEED: Things = Things(1 << 13);
    /// M3, M4, M5, M19
    pub(crate) const TURNING: Things = Things(1 << 14);
    /// G96, G97
    pub(crate) const SURFACE: Things = Things(1 << 15);
    /// T
    pub(crate) const SELECTED: Things = Things(1 << 16);
    /// M6, M61
    pub(crate) const TOOL: Things = Things(1 << 17);
    /// G40, G41, G42
    pub(crate) const COMPENSATION: Things = Things(1 << 18);
    /// The radius that a contour is compensated for.
    pub(crate) const CUTTER: Things = Things(1 << 19);
    /// What cycles and G5 keep for those behind them.
    pub(crate) const SERIES: Things = Things(1 << 20);
    /// What G5.2 began.
    pub(crate) const NURBS: Things = Things(1 << 21);
    /// M70, M73
    pub(crate) const SAVED: Things = Things(1 << 22);
    pub(crate) const PARAMETERS: Things = Things(1 << 23);
    /// Whether the program ends, or goes on elsewhere.
    pub(crate) const FLOW: Things = Things(1 << 24);

    pub(crate) const OFFSETS: Things = Self::WORK_OFFSET
        .and(Self::TOOL_LENGTH)
        .and(Self::SHIFT)
        .and(Self::TABLE);
    pub(crate) const SPINDLE: Things = Self::SPEED.and(Self::TURNING).and(Self::SURFACE);
    /// What says which places words of axes mean.
    const MEANING: Things = Self::DISTANCE.and(Self::UNITS).and(Self::OFFSETS);
    /// What says how a curve goes.
    const CURVE: Things = Self::MEANING.and(Self::ARC_DISTANCE).and(Self::PLANE);
    /// What M72 restores.
    pub(crate) const MODES: Things = Self::FEED
        .and(Self::FEED_MODE)
        .and(Self::UNITS)
        .and(Self::DISTANCE)
        .and(Self::ARC_DISTANCE)
        .and(Self::PLANE)
        .and(Self::CYCLE_RETURN)
        .and(Self::WORK_OFFSET)
        .and(Self::TOOL_LENGTH)
        .and(Self::SHIFT)
        .and(Self::SPINDLE)
        .and(Self::COMPENSATION);
    /// What an unread G may have set, whatever its number.
    const ANY_G: Things = Self::FEED_MODE
        .and(Self::DISTANCE)
        .and(Self::PLANE)
        .and(Self::MOTION)
        .and(Self::CYCLE_RETURN)
        .and(Self::WORK_OFFSET)
        .and(Self::SURFACE)
        .and(Self::COMPENSATION)
        .and(Self::SERIES)
        .and(Self::NURBS);
    /// What a block in a contour, where it is not possible, may have been meant to set.
    pub(crate) const IN_CONTOUR: Things = Self::MODES
        .without(Self::COMPENSATION)
        .and(Self::MOTION)
        .and(Self::TABLE)
        .and(Self::REFERENCES)
        .and(Self::TOOL)
        .and(Self::SELECTED);
    const ALL: Things = Things((1 << 25) - 1);

    const fn without(self, other: Things) -> Things {
        Things(self.0 & !other.0)
    }

    pub(crate) fn contains(self, things: Things) -> bool {
        self & things == things
    }

    pub(crate) const fn and(self, more: Things) -> Things {
        Things(self.0 | more.0)
    }

    fn has_any_of(self, things: Things) -> bool {
        self & things != Self::NONE
    }

    /// What a code sets.
    fn set_by(code: Code) -> Things {
        let Standing::Supported(group) = code.standing() else {
            return Self::NONE;
        };
        match (group, code) {
            (Group::Motion, _) => Self::MOTION,
            (Group::Plane, _) => Self::PLANE,
            (Group::Distance, _) => Self::DISTANCE,
            (Group::ArcDistance, _) => Self::ARC_DISTANCE,
            (Group::FeedMode, _) => Self::FEED_MODE,
            (Group::Units, _) => Self::UNITS,
            (Group::CutterCompensation, _) => Self::COMPENSATION,
            (Group::ToolLength, _) => Self::TOOL_LENGTH,
            (Group::CycleReturn, _) => Self::CYCLE_RETURN,
            (Group::WorkOffset, _) => Self::WORK_OFFSET,
            (Group::SpindleMode, _) => Self::SURFACE,
            (Group::ToolChange, _) => Self::TOOL,
            (Group::Spindle, _) => Self::TURNING,
            (Group::Offsets, Code::G(100)) => Self::TABLE,
            (Group::Offsets, Code::G(281 | 301)) => Self::REFERENCES,
            (Group::Offsets, Code::G(520 | 920..=923)) => Self::SHIFT,
            (Group::SavedModes, Code::M(72)) => Self::MODES,
            (Group::SavedModes, _) => Self::SAVED,
            _ => Self::NONE,
        }
    }

    /// What the words of a block set.
    pub(crate) fn set_by_words(words: &Words) -> Things {
        let letters = [
            (b'F', Self::FEED),
            (b'S', Self::SPEED),
            (b'T', Self::SELECTED),
        ];
        let by_letters = letters.into_iter().filter(|(it, _)| words.has(*it));
        let by_codes = words.codes().map(Self::set_by);
        let all = by_letters.map(|(_, things)| things).chain(by_codes);
        all.fold(Self::NONE, Self::and)
    }
}

impl BitOr for Things {
    type Output = Self;

    fn bitor(self, more: Things) -> Things {
        self.and(more)
    }
}

impl BitOrAssign for Things {
    fn bitor_assign(&mut self, more: Things) {
        *self = self.and(more);
    }
}

impl BitAnd for Things {
    type Output = Self;

    fn bitand(self, other: Things) -> Things {
        Things(self.0 & other.0)
    }
}

/// The places that a fault hangs on.
pub(crate) enum Places {
    None,
    /// Where an axis goes.
    Of(AxisLetter),
    /// How the way of the block goes.
    Way,
}

/// What is not known behind blocks that were refused.
#[derive(Debug, Default)]
pub(crate) struct Lost {
    pub(crate) things: Things,
    /// Where these axes are.
    pub(crate) axes: AxisSet,
    /// What was lost when modes were saved: it is lost again when these are restored.
    saved: Things,
    /// Of the block: words whose value is not known.
    pub(crate) letters: Letters,
    /// Of the block: how it goes to where it ends.
    way: bool,
}

impl Lost {
    /// Whether all is known.
    pub(crate) fn is_nothing(&self) -> bool {
        !self.way && self.things == Things::NONE && self.axes.is_empty()
    }

    /// Another block is read.
    pub(crate) fn begin_block(&mut self) {
        (self.letters, self.way) = (Letters::default(), false);
    }

    pub(crate) fn lose(&mut self, things: Things) {
        self.things |= things;
    }

    pub(crate) fn lose_axes(&mut self) {
        self.axes = AxisLetter::ALL.into_iter().collect();
    }

    pub(crate) fn lose_all(&mut self) {
        self.things = Things::ALL;
        self.lose_axes();
    }

    pub(crate) fn has(&self, things: Things) -> bool {
        self.things.has_any_of(things)
    }

    fn find(&mut self, things: Things) {
        self.things = self.things.without(things);
    }

    fn set(&mut self, things: Things, is_lost: bool) {
        match is_lost {
            true => self.lose(things),
            false => self.find(things),
        }
    }

    /// Modes are as they were when they were saved.
    pub(crate) fn restore(&mut self) {
        self.lose(self.saved);
        if self.has(Things::SAVED) {
            self.lose(Things::MODES);
        }
    }

    /// Whether it is not known where a compensated contour goes.
    pub(crate) fn loses_contours(&self) -> bool {
        let things = Things::CURVE | Things::MOTION | Things::COMPENSATION | Things::CUTTER;
        self.way || !self.axes.is_empty() || self.has(things)
    }

    /// Whether a fault may be none.
    pub(crate) fn is_behind(&self, fault: &Fault) -> bool {
        let (things, places) = fault.hangs_on();
        let is_lost = match places {
            Places::None => false,
            Places::Of(axis) => self.way || self.axes.contains(axis),
            Places::Way => self.way || !self.axes.is_empty(),
        };
        is_lost || self.has(things)
    }

    /// A code or what it belongs to was not read: `written` is what there is of its number.
    fn lose_code(&mut self, letter: u8, written: &str, unread: Letters) {
        let (digits, is_whole) = match written.strip_suffix(CUT) {
            Some(digits) => (digits, digits.len() > 1),
            None => (written, !written.is_empty()),
        };
        let may_be = |code: &str| {
            let mut both = digits.bytes().zip(code.bytes());
            (!is_whole || digits.len() == code.len())
                && both.all(|(written, digit)| written == digit || !written.is_ascii_digit())
        };
        let any = |codes: &[&str]| codes.iter().any(|code| may_be(code));
        let mut lose = |codes: &[&str], things| {
            if any(codes) {
                self.things |= things;
            }
        };
        if letter == b'M' {
            lose(&["3", "4", "5", "19"], Things::TURNING);
            lose(&["6", "61"], Things::TOOL);
            lose(&["70", "71", "72", "73"], Things::SAVED);
            lose(&["72"], Things::MODES);
            lose(&["2", "30", "98", "99"], Things::FLOW);
            return;
        }
        lose(&["20", "21"], Things::UNITS);
        lose(&["90", "91"], Things::ARC_DISTANCE);
        lose(&["10"], Things::TABLE);
        lose(&["52", "92"], Things::SHIFT);
        lose(&["28", "30"], Things::REFERENCES);
        lose(&["43", "49"], Things::TOOL_LENGTH);
        if unread.has(b'H') {
            self.things |= Things::TOOL_LENGTH;
        }
        self.things |= Things::ANY_G;
        // By G28, or a cycle.
        self.lose_axes();
    }
}

impl Fault {
    /// What the fault hangs on: it is none if that is otherwise.
    pub(crate) fn hangs_on(&self) -> (Things, Places) {
        use Things as T;
        let cycle = T::MOTION | T::PLANE | T::SERIES;
        match self {
            Fault::SoftLimit { axis, .. } => (T::NONE, Places::Of(*axis)),
            Fault::Coordinate { axis, .. } => (T::UNITS, Places::Of(*axis)),
            Fault::PolarOrigin
            | Fault::ProbeTooShort { .. }
            | Fault::ThreadingAxis { .. }
            | Fault::ThreadNowhere { .. }
            | Fault::ThreadAxis { .. }
            | Fault::ProbeTurns { .. }
            | Fault::SplineNowhere => (T::MEANING | T::MOTION | T::PLANE, Places::Way),
            Fault::ArcNearlyClosed { .. }
            | Fault::ArcRadii { .. }
            | Fault::ArcNoRadius
            | Fault::ArcRadiusSamePoint
            | Fault::ArcTooFar { .. } => (T::MOTION | T::CURVE, Places::Way),
            Fault::ArcUndefined(_) => (T::MOTION | T::PLANE | T::ARC_DISTANCE, Places::None),
            Fault::ArcOffsetPlane { .. } | Fault::ArcOverdefined => {
                (T::MOTION | T::PLANE, Places::None)
            }
            Fault::CycleBelow { .. } => (cycle | T::DISTANCE | T::UNITS, Places::None),
            Fault::CycleTooLong { .. } => (cycle | T::MEANING, Places::Way),
            Fault::CycleAxis { .. }
            | Fault::ThreadingPlane { .. }
            | Fault::SplinePlane { .. }
            | Fault::SplineAxis { .. } => (T::MOTION | T::PLANE | T::NURBS, Places::None),
            Fault::PolarPlane => (T::PLANE, Places::None),
            Fault::NoFeed { .. } | Fault::FeedZero { .. } => {
                (T::FEED | T::FEED_MODE | T::MOTION, Places::None)
            }
            Fault::NoInverseTime { .. }
            | Fault::CycleInverseTime { .. }
            | Fault::ProbeFeedMode { .. } => (T::FEED_MODE | T::MOTION, Places::None),
            Fault::FeedPerTurnSpindle { .. } => (
                T::FEED | T::FEED_MODE | T::SPINDLE | T::MOTION,
                Places::None,
            ),
            Fault::CycleSpindle { .. }
            | Fault::ThreadSpindle { .. }
            | Fault::ThreadSurface { .. }
            | Fault::TapDirection { .. } => (T::SPINDLE | T::MOTION, Places::None),
            Fault::TapFeed { .. } => (
                T::SPINDLE | T::FEED | T::FEED_MODE | T::UNITS | cycle,
                Places::None,
            ),
            Fault::SpindleSpeed { .. } => (T::SURFACE, Places::None),
            Fault::SurfaceTurned => (T::SURFACE | T::OFFSETS, Places::None),
            Fault::TurnedPlane { .. } => (T::PLANE | T::OFFSETS | T::MOTION, Places::None),
            Fault::TurnedWithout { .. } => (T::OFFSETS, Places::None),
            Fault::Value { letter, value, .. } => match letter {
                'G' | 'M' | 'F' | 'T' => (T::NONE, Places::None),
                'S' if *value < 0.0 => (T::NONE, Places::None),
                'S' => (T::SURFACE, Places::None),
                // What it is a value of.
                _ => (cycle | T::NURBS | T::UNITS, Places::None),
            },
            Fault::UnusedWord { letter: 'P' | 'L' } => (T::MOTION | T::NURBS, Places::None),
            Fault::UnusedWord { .. } | Fault::SharedWord { .. } => (T::MOTION, Places::None),
            Fault::MissingWord { code, .. } => match code.standing() {
                Standing::Supported(Group::Motion) => {
                    (cycle | T::FEED | T::FEED_MODE | T::SPEED, Places::None)
                }
                Standing::Supported(Group::SpindleMode) => (T::SURFACE, Places::None),
                _ => (T::NONE, Places::None),
            },
            Fault::NoMotion
            | Fault::MachineCoordinatesWithout
            | Fault::NoProbe { .. }
            | Fault::NoSpindleAngle { .. }
            | Fault::ThreadingTaper { .. }
            | Fault::TooManyPasses { .. } => (T::MOTION, Places::None),
            _ => self.hangs_on_beside_motion(),
        }
    }

    /// What those hang on that are of no motion's words: of tools, contours, splines that are open, parameters and the flow.
    fn hangs_on_beside_motion(&self) -> (Things, Places) {
        use Things as T;
        match self {
            Fault::NoSuchTool { .. } | Fault::CutterNoTool { .. } => {
                (T::TOOL | T::TABLE, Places::None)
            }
            Fault::WhileCompensated { code } => match code.standing() {
                Standing::Supported(Group::Motion) => (T::COMPENSATION | T::MOTION, Places::None),
                _ => (T::COMPENSATION, Places::None),
            },
            Fault::HomeCompensated { .. }
            | Fault::ReadCompensated
            | Fault::ParameterWhileCompensated(_)
            | Fault::CompensationTyped { .. } => (T::COMPENSATION, Places::None),
            Fault::ThreadCompensated { .. }
            | Fault::ProbeCompensated { .. }
            | Fault::CutterLeaving { .. } => (T::COMPENSATION | T::MOTION, Places::None),
            Fault::RestoreCompensated { .. } => {
                (T::COMPENSATION | T::SAVED | T::MODES, Places::None)
            }
            Fault::CutterEntryArc
            | Fault::CutterEntry { .. }
            | Fault::CutterArc { .. }
            | Fault::CutterSpiral
            | Fault::CutterCorner { .. }
            | Fault::CutterCuts { .. }
            | Fault::CutterHasCut { .. }
            | Fault::CutterWaits { .. } => (
                T::CURVE | T::MOTION | T::COMPENSATION | T::CUTTER,
                Places::Way,
            ),
            Fault::NothingSaved => (T::SAVED, Places::None),
            Fault::NurbsWeights
            | Fault::NurbsTooLong { .. }
            | Fault::NurbsTooFew { .. }
            | Fault::NurbsNotBegun
            | Fault::NurbsOpen { .. }
            | Fault::NurbsNotEnded => (T::NURBS, Places::None),
            Fault::ParameterUnset(_) => (T::PARAMETERS, Places::None),
            Fault::RunsInto { .. }
            | Fault::BeginsAnew { .. }
            | Fault::TooManyBlocks { .. }
            | Fault::IdleLoop { .. }
            | Fault::NotOpen { .. }
            | Fault::SubprogramEndInSub => (T::FLOW | T::PARAMETERS, Places::None),
            _ => (T::NONE, Places::None),
        }
    }
}

impl State {
    /// Whether it is not known what a value of a block is.
    pub(crate) fn is_lost(&self, block: &Block, value: &Value) -> bool {
        let has_lost = !self.lost.is_nothing();
        has_lost
            && !block.is_constant(value)
            && (self.lost.has(Things::PARAMETERS) || block.reads_state(value))
    }

    /// What a block sets is known from here on, and what it sets by what is lost is not.
    pub(crate) fn know(&mut self, block: &Block, words: &Words) {
        if self.lost.is_nothing() {
            return;
        }
        for word in &block.words {
            if self.is_lost(block, &word.value) {
                self.lost.letters.insert(word.letter);
            }
        }
        for setting in &block.settings {
            let is_own = match &setting.target {
                Target::Named(_) => true,
                Target::Numbered(index) => block.is_constant(index) && !self.is_place(block, index),
            };
            if self.is_lost(block, &setting.value) {
                self.lost.lose(Things::PARAMETERS);
                self.lost.things |= if is_own { Things::NONE } else { Things::TABLE };
            }
        }
        let codes = Things::set_by_words(words);
        let motion = words.code(Group::Motion);
        let plain = Things::UNITS
            | Things::DISTANCE
            | Things::ARC_DISTANCE
            | Things::PLANE
            | Things::MOTION
            | Things::CYCLE_RETURN
            | Things::WORK_OFFSET
            | Things::TURNING;
        let [feed_mode, surface] = [
            (Group::FeedMode, Things::FEED_MODE),
            (Group::SpindleMode, Things::SURFACE),
        ];
        self.know_in_mode(words, feed_mode, (b'F', Things::FEED));
        self.know_in_mode(words, surface, (b'S', Things::SPEED));
        self.know_tool(words);
        self.know_offsets(words);
        self.know_compensation(words);
        self.lost.find(codes & plain);
        match words.code(Group::SavedModes) {
            Some(Code::M(70 | 73)) => {
                self.lost.saved |= self.lost.things & Things::MODES;
                self.lost.find(Things::SAVED);
            }
            Some(Code::M(71)) => self.lost.find(Things::SAVED),
            _ => {}
        }
        if let Some(code) = motion {
            self.know_series(code, words);
        }
        for letter in [b'G', b'M'] {
            if self.lost.letters.has(letter) {
                self.lost.lose_code(letter, "", Letters::default());
            }
        }
    }

    fn is_place(&self, block: &Block, index: &Value) -> bool {
        let mut steps = block.steps[index.steps.clone()].iter();
        !steps.all(|it| matches!(it.operation, Operation::Number(number) if number <= 5000.0))
    }

    /// What a letter gives in a mode, which has a group of its own: one of another mode is none in this.
    fn know_in_mode(
        &mut self,
        words: &Words,
        (group, mode): (Group, Things),
        (letter, given): (u8, Things),
    ) {
        let lost = &mut self.lost;
        if words.code(group).is_some() {
            if lost.has(mode) {
                lost.lose(given);
            }
            lost.find(mode);
        }
        if lost.letters.has(letter) {
            lost.lose(given);
        } else if words.has(letter) && !lost.has(mode) {
            lost.find(given);
        }
    }

    fn know_tool(&mut self, words: &Words) {
        let lost = &mut self.lost;
        if words.has(b'T') {
            lost.set(Things::SELECTED, lost.letters.has(b'T'));
        }
        let by_unknown = match words.code(Group::ToolChange) {
            Some(Code::M(61)) => lost.letters.has(b'Q'),
            Some(_) => lost.has(Things::SELECTED),
            None => return,
        };
        lost.set(Things::TOOL, by_unknown);
    }

    fn know_offsets(&mut self, words: &Words) {
        let lost = &mut self.lost;
        let by_tool = lost.has(Things::TABLE)
            || match words.has(b'H') {
                true => lost.letters.has(b'H'),
                false => lost.has(Things::TOOL),
            };
        match words.code(Group::ToolLength) {
            Some(Code::G(490)) => lost.find(Things::TOOL_LENGTH),
            Some(Code::G(430)) => lost.set(Things::TOOL_LENGTH, by_tool),
            Some(Code::G(432)) if by_tool => lost.lose(Things::TOOL_LENGTH),
            Some(Code::G(431)) if lost.letters != Letters::default() => {
                lost.lose(Things::TOOL_LENGTH);
            }
            _ => {}
        }
        let by_words = lost.letters != Letters::default() || lost.has(Things::UNITS);
        let by_place = !lost.axes.is_empty() || lost.has(Things::OFFSETS);
        match words.code(Group::Offsets) {
            // What is set by words alone is lost with these, what is set by a place with that as well.
            Some(Code::G(100)) if by_words || by_place => lost.lose(Things::TABLE),
            Some(Code::G(520)) if by_words => lost.lose(Things::SHIFT),
            Some(Code::G(920)) if by_words || by_place => lost.lose(Things::SHIFT),
            Some(Code::G(921)) => lost.find(Things::SHIFT),
            Some(Code::G(281 | 301)) => lost.set(Things::REFERENCES, by_place),
            _ => {}
        }
    }

    /// A contour that may have ended long ago has ended where another begins, or G40 stands.
    fn know_compensation(&mut self, words: &Words) {
        let Some(code) = words.code(Group::CutterCompensation) else {
            return;
        };
        if self.lost.has(Things::COMPENSATION) {
            self.compensated = Compensated::Off;
            self.modes.compensation = None;
        }
        self.lost.find(Things::COMPENSATION | Things::CUTTER);
        let by_unknown = match words.has(b'D') {
            true => self.lost.letters.has(b'D'),
            false => self.lost.has(Things::TOOL),
        };
        // Where it begins is not known either.
        let is_elsewhere = !self.lost.axes.is_empty() || self.lost.has(Things::TABLE);
        if code != Code::G(400) && (by_unknown || is_elsewhere) {
            self.lost.lose(Things::CUTTER);
        }
    }

    fn know_series(&mut self, code: Code, words: &Words) {
        let is_given = |letters: &[u8]| {
            let unknown = self.lost.letters.has_any_of(letters);
            !unknown && letters.iter().all(|letter| words.has(*letter))
        };
        let is_known = match (code, Cycle::of(code.number())) {
            (Code::G(50), _) => is_given(b"IJ"),
            (_, None) => true,
            // What else some of them need.
            (_, Some(_)) => {
                let depth = self.modes.plane.axes()[2].letter() as u8;
                is_given(&[depth, b'R']) && (is_given(b"QPK") || code == Code::G(810))
            }
        };
        if is_known {
            self.lost.find(Things::SERIES);
        }
        if code == Code::G(52) && self.lost.has(Things::NURBS) {
            (self.nurbs, self.nurbs_start) = (None, None);
            self.lost.find(Things::NURBS);
        }
    }

    /// The axes that a block sends to places are there, as far as these are known.
    pub(crate) fn know_places(&mut self, words: &Words, machine: bool) {
        if self.lost.is_nothing() {
            return;
        }
        let before = self.lost.axes;
        let motion = self.modes.motion;
        if self.lost.has(Things::MOTION) {
            self.lost.lose_axes();
            self.lost.way = true;
            return;
        }
        let meaning = match machine {
            true => Things::UNITS,
            false => Things::MEANING,
        };
        let is_meant_otherwise = self.lost.has(meaning);
        let is_absolute = machine || !self.modes.incremental;
        for axis in AxisLetter::ALL {
            let letter = axis.letter() as u8;
            if !words.has(letter) {
                continue;
            }
            if is_meant_otherwise || self.lost.letters.has(letter) {
                self.lost.axes.insert(axis);
            } else if is_absolute {
                self.lost.axes.remove(axis);
            }
        }
        let plane = [AxisLetter::X, AxisLetter::Y];
        let named = |axis: &AxisLetter| words.has(axis.letter() as u8);
        if words.has_polar() {
            let is_whole = is_absolute && words.has(b'@') && words.has(b'^');
            let from_lost = !is_whole && plane.iter().any(|it| before.contains(*it));
            if is_meant_otherwise || from_lost || self.lost.letters.has_any_of(b"@^") {
                plane.iter().for_each(|it| self.lost.axes.insert(*it));
            } else {
                plane.iter().for_each(|it| self.lost.axes.remove(*it));
            }
        } else if !machine
            && self.coordinates().rotation != 0.0
            && plane.iter().any(named)
            && plane.iter().any(|it| self.lost.axes.contains(*it))
        {
            plane.iter().for_each(|it| self.lost.axes.insert(*it));
        }
        if matches!(motion, Motion::Rapid | Motion::Feed | Motion::Probe(_)) {
            return;
        }
        let axes = self.modes.plane.axes();
        let ends = axes
            .iter()
            .any(|it| before.contains(*it) || self.lost.axes.contains(*it));
        let others = match motion {
            Motion::Arc(_) => Things::CURVE,
            Motion::Cycle(_) => Things::CURVE | Things::SERIES | Things::CYCLE_RETURN,
            _ => Things::CURVE | Things::SERIES | Things::NURBS,
        };
        self.lost.way = ends || self.lost.letters != Letters::default() || self.lost.has(others);
        if matches!(motion, Motion::Cycle(_)) {
            // Its end across the plane is no word's.
            if self.lost.way {
                axes.iter().for_each(|it| self.lost.axes.insert(*it));
            }
            if self.lost.letters != Letters::default() {
                self.lost.lose(Things::SERIES);
            }
        }
    }

    /// These axes have gone to where the machine knows, all if none is named.
    pub(crate) fn know_axes(&mut self, axes: AxisSet) {
        if !self.lost.has(Things::REFERENCES) {
            axes.iter().for_each(|axis| self.lost.axes.remove(axis));
        }
    }

    /// What could not be read of a block is lost, but for the places of axes.
    pub(crate) fn lose_unread(&mut self, unread: &Unread, words: &Words) {
        for (letter, written) in &unread.codes {
            self.lost.lose_code(*letter, written, unread.letters);
        }
        let unread_axes = AxisLetter::ALL.into_iter();
        let has_axis = unread_axes
            .map(|axis| axis.letter() as u8)
            .any(|letter| unread.letters.has(letter));
        let has_polar = unread.letters.has_any_of(b"@^");
        let others = unread.letters.has_any_of(b"IJKRPQLDH");
        let mut lose = |letters: &[u8], things| {
            if unread.letters.has_any_of(letters) {
                self.lost.lose(things);
            }
        };
        lose(b"F", Things::FEED);
        lose(b"S", Things::SPEED);
        lose(b"T", Things::SELECTED);
        lose(b"D", Things::CUTTER);
        if unread.letters.has(b'T') && words.code(Group::ToolChange).is_some() {
            self.lost.lose(Things::TOOL);
        }
        if words.code(Group::ToolChange) == Some(Code::M(61)) && unread.letters.has(b'Q') {
            self.lost.lose(Things::TOOL);
        }
        if has_axis || has_polar || others {
            let with_words = Things::TOOL_LENGTH | Things::SHIFT | Things::TABLE;
            self.lost.lose(Things::set_by_words(words) & with_words);
            let motion = words.code(Group::Motion);
            let keeps = match motion {
                Some(code) => Cycle::of(code.number()).is_some() || code == Code::G(50),
                None => matches!(self.modes.motion, Motion::Cycle(_) | Motion::Cubic),
            };
            if keeps {
                self.lost.lose(Things::SERIES);
            }
            let is_nurbs = match motion {
                Some(code) => code == Code::G(52),
                None => self.nurbs.is_some(),
            };
            if is_nurbs {
                self.lost.lose(Things::NURBS);
            }
        }
        if unread.settings > 0 {
            self.lost.lose(Things::PARAMETERS);
        }
    }
}
