//! Canned cycles: G73, G74, G81, G82, G83, G84, G85, G86, G89 with G98 and G99.
//!
//! Written for G17; under another plane the axes take each other's places.

use std::collections::VecDeque;

use super::arc::Plane;
use super::axes::AxisLetter;
use super::command::{Action, PathMode, Turning};
use super::error::{Fault, Refusal};
use super::execute::{DWELL_LIMIT, State};
use super::lexer::Columns;
use super::modal::{Code, FeedMode, Motion};
use super::words::{Words, out_of_range};

/// What a peck backs off by, and stops short of the last depth by (RS-274/NGC: 0.010 inch), mm.
const PECK_CLEARANCE: f64 = 0.254;
/// How many commands one block may make: a slip in Q or L, not a part.
const MAX_COMMANDS: usize = 100_000;

/// A canned cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cycle {
    /// G73: drilling that backs off a little to break chips.
    ChipBreaking,
    /// G81
    Drilling,
    /// G82: drilling with a dwell at the bottom.
    DrillingWithDwell,
    /// G83: drilling that backs out to clear chips.
    Pecking,
    /// G84: tapping with the spindle clockwise, a right-hand thread.
    Tapping,
    /// G74: tapping with the spindle counterclockwise, a left-hand thread.
    LeftTapping,
    /// G85: boring, feed out.
    Boring,
    /// G86: boring, spindle stop, rapid out.
    BoringWithStop,
    /// G89: boring, dwell, feed out.
    BoringWithDwell,
}

impl Cycle {
    /// The cycle of a G-code in tenths.
    pub(crate) fn of(tenths: u16) -> Option<Cycle> {
        Some(match tenths {
            730 => Cycle::ChipBreaking,
            740 => Cycle::LeftTapping,
            810 => Cycle::Drilling,
            820 => Cycle::DrillingWithDwell,
            830 => Cycle::Pecking,
            840 => Cycle::Tapping,
            850 => Cycle::Boring,
            860 => Cycle::BoringWithStop,
            890 => Cycle::BoringWithDwell,
            _ => return None,
        })
    }

    /// The G-code in tenths.
    pub(crate) fn tenths(self) -> u16 {
        match self {
            Cycle::ChipBreaking => 730,
            Cycle::LeftTapping => 740,
            Cycle::Drilling => 810,
            Cycle::DrillingWithDwell => 820,
            Cycle::Pecking => 830,
            Cycle::Tapping => 840,
            Cycle::Boring => 850,
            Cycle::BoringWithStop => 860,
            Cycle::BoringWithDwell => 890,
        }
    }

    fn pecks(self) -> bool {
        matches!(self, Cycle::ChipBreaking | Cycle::Pecking)
    }

    /// How the spindle has to turn for it, where it taps.
    fn taps(self) -> Option<Turning> {
        match self {
            Cycle::Tapping => Some(Turning::Clockwise),
            Cycle::LeftTapping => Some(Turning::Counterclockwise),
            _ => None,
        }
    }

    fn dwells(self) -> bool {
        use Cycle::{BoringWithDwell, BoringWithStop, DrillingWithDwell};
        matches!(self, DrillingWithDwell | BoringWithStop | BoringWithDwell)
    }
}

/// What a series of cycles keeps from block to block. Lengths in mm as programmed.
#[derive(Debug, Default)]
pub(crate) struct Series {
    /// The cycle that the numbers were given for.
    cycle: Option<Cycle>,
    /// The plane that they were given in.
    plane: Plane,
    /// Depth: the word of the axis across the plane.
    depth: Option<f64>,
    retract: Option<f64>,
    peck: Option<f64>,
    dwell: Option<f64>,
    /// Of a thread, mm in a turn.
    lead: Option<f64>,
    /// Where that axis stood before the series, and where the program's origin was then, machine coordinates: it is a level
    /// of the program.
    initial: Option<(f64, f64)>,
}

/// The levels of one block's cycles along the axis across the plane, machine coordinates.
struct Levels {
    axis: AxisLetter,
    bottom: f64,
    retract: f64,
    clear: f64,
    /// At least as high it goes across to the hole.
    across: f64,
    peck: f64,
    dwell: f64,
    lead: f64,
}

impl State {
    /// Ends a series of cycles: any other motion does.
    pub(crate) fn end_series(&mut self) {
        self.series = Series::default();
    }

    /// Executes a cycle at each of the block's places.
    pub(crate) fn cycle(
        &mut self,
        cycle: Cycle,
        words: &mut Words,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let code = Motion::Cycle(cycle).code();
        if self.modes.feed_mode == FeedMode::InverseTime {
            return Err(Refusal::new(columns, Fault::CycleInverseTime { code }));
        }
        if cycle == Cycle::BoringWithStop && self.modes.spindle.turning == Turning::Off {
            return Err(Refusal::new(columns, Fault::CycleSpindle { code }));
        }
        if let Some(turning) = cycle.taps() {
            self.may_follow_spindle(code, columns)?;
            if self.modes.spindle.turning != turning {
                let needs = match turning {
                    Turning::Counterclockwise => "counterclockwise: write M4 before, or G84",
                    _ => "clockwise: write M3 before, or G74 for a left-hand thread",
                };
                return Err(Refusal::new(columns, Fault::TapDirection { code, needs }));
            }
        }
        self.plane_of_axes(code, columns)?;
        let plane = self.modes.plane.axes();
        for axis in self.setup.axes.iter() {
            let letter = axis.letter() as u8;
            if words.has(letter) && !plane.contains(&axis) {
                return Err(words.refuse(letter, Fault::CycleAxis { code, axis }));
            }
        }
        let levels = self.levels(cycle, code, words, columns)?;
        let allowed = "a whole number of holes from 1";
        let repeats = words
            .take_whole(b'L', code, 1..=u32::MAX, allowed)?
            .unwrap_or(1);
        // A blend would cut the corner at the bottom of a hole and under its rim.
        let blends = matches!(self.modes.path_mode, PathMode::Blend { .. });
        if blends {
            commands.push_back(Action::PathMode(PathMode::ExactPath));
        }
        let mut place = self.at;
        for _ in 0..repeats {
            // Under G91 each repetition goes on by the words; under G90 it is the same place.
            let to = self.target_from(place, words, code, false)?;
            for axis in [plane[0], plane[1]] {
                place[axis] = to[axis];
            }
            let mut hole = Hole {
                state: self,
                words,
                columns,
                commands,
                code,
                axis: levels.axis,
            };
            if hole.state.at[levels.axis] < levels.across {
                hole.rapid(levels.across)?;
            }
            let mut over = place;
            over[levels.axis] = hole.state.at[levels.axis];
            hole.go(Action::Rapid { to: over })?;
            hole.rapid(levels.retract)?;
            hole.make(cycle, &levels)?;
        }
        if blends {
            commands.push_back(Action::PathMode(self.modes.path_mode));
        }
        Ok(())
    }

    /// Takes the words of the axis across the plane and keeps them for the series.
    fn levels(
        &mut self,
        cycle: Cycle,
        code: Code,
        words: &mut Words,
        columns: Columns,
    ) -> Result<Levels, Refusal> {
        let plane = self.modes.plane;
        let axis = plane.axes()[2];
        let need = |words| Refusal::new(columns, Fault::MissingWord { code, words });
        let unit = self.modes.unit();
        if self.series.plane != plane {
            self.end_series();
            self.series.plane = plane;
        }
        if self.series.cycle != Some(cycle) {
            self.series.cycle = Some(cycle);
            self.series.depth = None;
            self.series.peck = None;
            self.series.dwell = None;
            self.series.lead = None;
        }
        let origin = self.coordinates().origin[axis];
        let (initial, below) = *(self.series.initial).get_or_insert((self.at[axis], origin));
        let initial = initial + (origin - below);
        let mut sticky = |letter, kept: Option<f64>, unit: f64| -> Result<Option<f64>, Refusal> {
            let given = words.take(letter, code)?;
            Ok(given.map(|value| value * unit).or(kept))
        };
        let letter = axis.letter() as u8;
        self.series.depth = sticky(letter, self.series.depth, unit)?;
        self.series.retract = sticky(b'R', self.series.retract, unit)?;
        if cycle.pecks() {
            self.series.peck = sticky(b'Q', self.series.peck, unit)?;
        }
        if cycle.dwells() {
            self.series.dwell = sticky(b'P', self.series.dwell, 1.0)?;
        }
        let depth = self
            .series
            .depth
            .ok_or_else(|| need("the depth, the word of the axis across the plane"))?;
        let retract = self
            .series
            .retract
            .ok_or_else(|| need("R, where it starts and backs out to"))?;
        let peck = match self.series.peck {
            Some(peck) if peck <= 0.0 => {
                return Err(words.refuse(b'Q', out_of_range('Q', peck, "a depth above 0")));
            }
            None if cycle.pecks() => return Err(need("Q, the depth of a peck")),
            peck => peck.unwrap_or_default(),
        };
        let dwell = match self.series.dwell {
            Some(dwell) if !(0.0..=DWELL_LIMIT).contains(&dwell) => {
                return Err(
                    words.refuse(b'P', out_of_range('P', dwell, "a time from 0 to 1000000 s"))
                );
            }
            None if cycle.dwells() && cycle != Cycle::BoringWithStop => {
                return Err(need("P, the dwell in seconds"));
            }
            dwell => dwell.unwrap_or_default(),
        };
        let lead = match cycle.taps() {
            Some(_) => self.tapped_lead(code, words, columns)?,
            None => 0.0,
        };
        let (retract, bottom) = if self.modes.incremental {
            let retract = initial + retract;
            (retract, retract + depth)
        } else {
            (retract + origin, depth + origin)
        };
        if retract < bottom {
            return Err(Refusal::new(columns, Fault::CycleBelow { code, axis }));
        }
        let clear = if self.modes.retract_to_r {
            retract
        } else {
            initial.max(retract)
        };
        Ok(Levels {
            axis,
            bottom,
            retract,
            clear,
            // Work with a higher origin has its own level from the first hole on.
            across: if origin == below { retract } else { clear },
            peck,
            dwell,
            lead,
        })
    }

    /// What a tap goes by in a turn, mm: K, or else F over S.
    fn tapped_lead(
        &mut self,
        code: Code,
        words: &mut Words,
        columns: Columns,
    ) -> Result<f64, Refusal> {
        if let Some(written) = words.take(b'K', code)? {
            self.series.lead = Some(self.lead(written, b'K', words)?);
        }
        // F is the lead itself where it counts turns.
        let speed = match self.modes.feed_mode {
            FeedMode::PerTurn => 1.0,
            _ => self.modes.spindle.speed,
        };
        let feed = self.modes.feed.filter(|feed| feed.number > 0.0);
        let by_feed = feed.map(|feed| feed.number * feed.unit / speed);
        match (self.series.lead, by_feed) {
            (Some(lead), Some(by_feed)) if words.has(b'F') && differ(lead, by_feed) => {
                let feed = lead * speed / self.modes.unit();
                Err(words.refuse(b'F', Fault::TapFeed { code, feed }))
            }
            (Some(lead), _) => Ok(lead),
            (None, Some(by_feed)) => self.lead(by_feed / self.modes.unit(), b'F', words),
            (None, None) => {
                let words = "K, the distance in a turn of the spindle, or F, that times S";
                Err(Refusal::new(columns, Fault::MissingWord { code, words }))
            }
        }
    }
}

/// Whether two leads are not the same thread: a feed is often written with few digits.
fn differ(lead: f64, other: f64) -> bool {
    (lead - other).abs() > 1e-3 * lead
}

/// One hole in the making.
struct Hole<'a> {
    state: &'a mut State,
    words: &'a mut Words,
    columns: Columns,
    commands: &'a mut VecDeque<Action>,
    code: Code,
    axis: AxisLetter,
}

impl Hole<'_> {
    fn make(&mut self, cycle: Cycle, levels: &Levels) -> Result<(), Refusal> {
        if cycle.pecks() {
            let mut depth = levels.retract - levels.peck;
            while depth > levels.bottom {
                self.feed(depth)?;
                let above = (depth + PECK_CLEARANCE).min(levels.retract);
                if cycle == Cycle::Pecking {
                    self.rapid(levels.retract)?;
                }
                self.rapid(above)?;
                depth -= levels.peck;
            }
        }
        if cycle.taps().is_some() {
            let mut to = self.state.at;
            to[self.axis] = levels.bottom;
            let lead = levels.lead;
            self.go(Action::Tap { to, lead })?;
            return self.rapid(levels.clear);
        }
        self.feed(levels.bottom)?;
        if cycle.dwells() {
            let seconds = levels.dwell;
            self.commands.push_back(Action::Dwell { seconds });
        }
        match cycle {
            Cycle::Boring => self.feed(levels.retract)?,
            Cycle::BoringWithDwell => self.feed(levels.clear)?,
            Cycle::BoringWithStop => {
                let turning = self.state.modes.spindle;
                (self.commands).push_back(Action::Spindle(turning.stopped()));
                self.rapid(levels.clear)?;
                self.commands.push_back(Action::Spindle(turning));
            }
            _ => {}
        }
        self.rapid(levels.clear)
    }

    /// Along the axis across the plane, if it is not there yet.
    fn rapid(&mut self, level: f64) -> Result<(), Refusal> {
        let mut to = self.state.at;
        to[self.axis] = level;
        self.go(Action::Rapid { to })
    }

    fn feed(&mut self, level: f64) -> Result<(), Refusal> {
        let mut to = self.state.at;
        to[self.axis] = level;
        let feed = self
            .state
            .feed(self.words, self.code, to)
            .map_err(|fault| Refusal::new(self.columns, fault))?;
        self.go(Action::Feed { to, feed })
    }

    fn go(&mut self, action: Action) -> Result<(), Refusal> {
        if self.commands.len() >= MAX_COMMANDS {
            let allowed = MAX_COMMANDS;
            return Err(Refusal::new(self.columns, Fault::CycleTooLong { allowed }));
        }
        if matches!(&action, Action::Rapid { to } if *to == self.state.at) {
            return Ok(());
        }
        self.state
            .go(action, self.words, self.columns, self.commands)
    }
}
