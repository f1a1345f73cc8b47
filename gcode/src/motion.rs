//! Motion: where a block's axis words lead, how fast, and whether the machine may go there.

use std::collections::VecDeque;
use std::f64::consts::{PI, TAU};

use super::arc::{Arc, Direction, Plane};
use super::axes::{AxisLetter, AxisSet, COORDINATE_LIMIT, Point};
use super::block::Block;
use super::command::{Action, Feed, Probe, Spindle, Turning};
use super::coordinates::sum;
use super::cycles::Cycle;
use super::error::{Fault, Refusal};
use super::execute::{Come, Compensated, State};
use super::lexer::Columns;
use super::modal::{Code, FeedMode, Group, Motion};
use super::words::{Words, out_of_range};

/// Arcs beyond this radius are a mistake, or lines. mm.
pub(crate) const RADIUS_LIMIT: f64 = 1e7;
/// Travel below this is rounding of the program's. mm or degrees.
const FEED_ROUNDING: f64 = 1e-7;
/// A position may be outside of the soft limits by this much: what conversions round. mm.
const LIMIT_ROUNDING: f64 = 1e-9;
/// An axis stands where its encoder says: a program that begins outside of its soft limits by no more than this may come back
/// to there. mm or degrees.
pub const LIMIT_NOISE: f64 = 0.01;
/// An axis that no block has sent anywhere may stand so far beside where it is to be, mm: two increments of a usual encoder, and
/// what a display rounds off.
const FOUND_BESIDE: f64 = 0.002;
/// So far beside, mm, nobody means an arc that ends there: it is a circle, or none.
const MOST_BESIDE: f64 = 0.05;

impl State {
    pub(super) fn motion(
        &mut self,
        block: &Block,
        words: &mut Words,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let explicit = words.code(Group::Motion);
        if let Some(code) = explicit {
            self.modes.motion = match code {
                Code::G(0) => Motion::Rapid,
                Code::G(10) => Motion::Feed,
                Code::G(20) => Motion::Arc(Direction::Clockwise),
                Code::G(30) => Motion::Arc(Direction::Counterclockwise),
                Code::G(50) => Motion::Cubic,
                Code::G(51) => Motion::Quadratic,
                Code::G(52) => Motion::Nurbs,
                Code::G(330) => Motion::Thread,
                Code::G(331) => Motion::Tap,
                Code::G(760) => Motion::ThreadingCycle,
                Code::G(tenths @ 382..=385) => Motion::Probe(Probe {
                    away: tenths >= 384,
                    required: tenths % 2 == 0,
                }),
                code => Cycle::of(code.number()).map_or(Motion::None, Motion::Cycle),
            };
        }
        let motion = self.modes.motion;
        let code = motion.code();
        if !matches!(motion, Motion::Cycle(_)) {
            self.end_series();
        }
        let machine = words.code(Group::MachineCoordinates).is_some();
        if machine && !matches!(motion, Motion::Rapid | Motion::Feed) {
            let columns = words.code_columns(Group::MachineCoordinates);
            return Err(Refusal::new(
                columns.unwrap_or_default(),
                Fault::MachineCoordinatesWithout,
            ));
        }
        if motion != Motion::Cubic {
            self.spline_direction = None;
        }
        let arc = matches!(motion, Motion::Arc(_)) && (explicit.is_some() || words.has_arc());
        // Another code that uses the axis words suspends the motion mode for its block.
        let suspended = explicit.is_none()
            && (words.code(Group::ToolLength) == Some(Code::G(431))
                || matches!(
                    words.code(Group::Offsets),
                    Some(Code::G(100 | 280 | 282 | 300 | 520 | 920))
                ));
        let motion_columns = words
            .code_columns(Group::Motion)
            .unwrap_or_else(|| block.columns());
        if explicit == Some(Code::G(53)) {
            self.know_places(words, machine);
            return self.end_nurbs(words, motion_columns, commands);
        }
        let begins_nurbs = explicit == Some(Code::G(52));
        if suspended || !(words.has_axes() || words.has_polar() || arc || begins_nurbs) {
            return match leads_nowhere(motion) {
                Some(fault) if explicit.is_some() => Err(Refusal::new(motion_columns, fault)),
                _ => Ok(()),
            };
        }
        self.know_places(words, machine);
        if !matches!(motion, Motion::Rapid | Motion::Feed | Motion::None)
            && self.compensated == Compensated::Leaving
        {
            return Err(Refusal::new(motion_columns, Fault::CutterLeaving { code }));
        }
        if let Motion::Cycle(cycle) = motion {
            // Also one that goes on by its places alone.
            if self.compensated != Compensated::Off {
                let fault = Fault::WhileCompensated { code };
                return Err(Refusal::new(motion_columns, fault));
            }
            return self.cycle(cycle, words, motion_columns, commands);
        }
        if let Motion::Probe(probe) = motion {
            return self.probe(probe, words, motion_columns, commands);
        }
        if let Motion::Thread | Motion::Tap = motion {
            return self.thread(motion, words, motion_columns, commands);
        }
        if motion == Motion::ThreadingCycle {
            return self.threading_cycle(words, motion_columns, commands);
        }
        if let Motion::Cubic | Motion::Quadratic | Motion::Nurbs = motion {
            return self.spline(motion, words, motion_columns, commands);
        }
        let to = self.target(words, code, machine)?;
        self.come = Come::BehindMotion;
        let moved = self.move_to(to, motion, words, motion_columns, commands);
        // Who looks for further mistakes goes on from where a refused motion was to lead.
        if moved.is_err() {
            self.at = to;
        }
        moved
    }

    /// Straight or on an arc to a point.
    fn move_to(
        &mut self,
        to: Point,
        motion: Motion,
        words: &mut Words,
        motion_columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let code = motion.code();
        let action = match motion {
            Motion::Rapid => Action::Rapid { to },
            Motion::Feed => Action::Feed {
                to,
                feed: self
                    .feed(words, code, to)
                    .map_err(|fault| Refusal::new(motion_columns, fault))?,
            },
            Motion::Arc(direction) => {
                let arc = self.arc(words, code, to, direction, motion_columns)?;
                Action::Arc {
                    arc,
                    feed: self
                        .feed(words, code, to)
                        .map_err(|fault| Refusal::new(motion_columns, fault))?,
                }
            }
            _ => {
                let first = AxisLetter::ALL
                    .iter()
                    .filter_map(|axis| words.columns(axis.letter() as u8))
                    .min_by_key(|columns| columns.start);
                return Err(Refusal::new(
                    first.unwrap_or(motion_columns),
                    Fault::NoMotion,
                ));
            }
        };
        self.go(action, words, motion_columns, commands)
    }

    /// Hands out a motion within the soft limits.
    pub(crate) fn go(
        &mut self,
        action: Action,
        words: &Words,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        // Of a compensated contour the tool's way is judged, when it is known.
        if self.cutter().is_none() {
            self.within_limits(&self.at, &action)
                .map_err(|(axis, fault)| {
                    let word = words.columns(axis.letter() as u8);
                    Refusal::new(word.unwrap_or(columns), fault)
                })?;
        }
        if self.compensated == Compensated::Leaving {
            self.compensated = Compensated::Off;
        }
        let to = action.destination().unwrap_or(self.at);
        // A circle leaves its axes all but where they were found.
        let is_arc = matches!(action, Action::Arc { .. });
        let aside = if is_arc { FOUND_BESIDE } else { 0.0 };
        for axis in AxisLetter::ALL {
            let is_named = !is_arc && words.columns(axis.letter() as u8).is_some();
            if is_named || (to[axis] - self.at[axis]).abs() > aside {
                self.sent.insert(axis);
            }
        }
        self.at = to;
        commands.push_back(action);
        Ok(())
    }

    /// The axes were found there: those that are elsewhere than blocks have sent them.
    pub(crate) fn found_at(&mut self, at: Point) {
        let sent = std::mem::replace(&mut self.sent, AxisSet::NONE);
        for axis in sent.iter() {
            if (at[axis] - self.at[axis]).abs() < LIMIT_ROUNDING {
                self.sent.insert(axis);
            }
        }
        self.at = at;
    }

    /// Comes to where it is from `start`: the [approach](Self::approach) there.
    pub(crate) fn go_from(&mut self, start: Point) -> Result<Vec<Action>, Refusal> {
        let approach = self.approach(start, self.at);
        self.at = start;
        let mut commands = VecDeque::new();
        for action in approach {
            let columns = Columns { start: 1, end: 2 };
            self.go(action, &Words::default(), columns, &mut commands)?;
        }
        Ok(commands.into())
    }

    /// The way from `start` to a place in the midst of a program, last along the axis across the plane when that goes
    /// down.
    pub(crate) fn approach(&self, start: Point, goal: Point) -> Vec<Action> {
        let across = self.modes.plane.axes()[2];
        let down = goal[across] < start[across];
        let mut over = if down { goal } else { start };
        over[across] = start[across].max(goal[across]);
        let feed = self.modes.feed.filter(|feed| feed.number > 0.0);
        let feed = feed.and_then(|feed| self.modal_feed(feed.number * feed.unit, &goal));
        let mut at = start;
        let mut approach = Vec::new();
        for to in [over, goal] {
            let action = match feed {
                // What is below may not have been cut yet.
                Some(feed) if down && to == goal => Action::Feed { to, feed },
                _ => Action::Rapid { to },
            };
            if to != std::mem::replace(&mut at, to) {
                approach.push(action);
            }
        }
        approach
    }

    /// Where the axis words lead, machine coordinates.
    pub(crate) fn target(
        &self,
        words: &mut Words,
        code: Code,
        machine: bool,
    ) -> Result<Point, Refusal> {
        self.target_from(self.at, words, code, machine)
    }

    /// As [`target`](Self::target), with another place to start from.
    pub(crate) fn target_from(
        &self,
        from: Point,
        words: &mut Words,
        code: Code,
        machine: bool,
    ) -> Result<Point, Refusal> {
        let coordinates = self.coordinates();
        let mut to = from;
        if words.has_polar() {
            if machine {
                let letter = if words.has(b'@') { b'@' } else { b'^' };
                return Err(words.refuse(letter, Fault::PolarMachine));
            }
            let place = coordinates.to_machine(self.polar(from, words, code)?);
            for axis in [AxisLetter::X, AxisLetter::Y] {
                to[axis] = place[axis];
            }
        }
        if machine {
            return Ok(self.placed(from, words, code)?.0);
        }
        // What no word moves stays where it is to the last bit.
        let (place, given) = if self.modes.incremental {
            let (by, given) = self.placed(Point::ZERO, words, code)?;
            (sum(from, coordinates.turned(by)), given)
        } else {
            let at = coordinates.to_program(from);
            let (place, given) = self.placed(at, words, code)?;
            (coordinates.to_machine(place), given)
        };
        for axis in coordinates.moved_by(given).iter() {
            to[axis] = place[axis];
        }
        Ok(to)
    }

    /// Where `@` and `^` lead in the program's X and Y, mm: by the distance from its origin and the
    /// angle from X. One that is not written stays; under G91 both are added.
    fn polar(&self, from: Point, words: &mut Words, code: Code) -> Result<Point, Refusal> {
        let letter = if words.has(b'@') { b'@' } else { b'^' };
        if let Some(mixed) = [b'X', b'Y'].into_iter().find(|axis| words.has(*axis)) {
            return Err(words.refuse(mixed, Fault::PolarMixed));
        }
        if self.modes.plane != Plane::Xy {
            return Err(words.refuse(letter, Fault::PolarPlane));
        }
        let axes = self.setup.axes;
        if let Some(axis) = [AxisLetter::X, AxisLetter::Y]
            .into_iter()
            .find(|axis| !axes.contains(*axis))
        {
            return Err(words.refuse(letter, Fault::NoSuchAxis { axis, axes }));
        }
        let mut point = self.coordinates().to_program(from);
        let [x, y] = [point[AxisLetter::X], point[AxisLetter::Y]];
        let (distance, angle) = (libm::hypot(x, y), libm::atan2(y, x).to_degrees());
        let written = words
            .take(b'@', code)?
            .map(|value| value * self.modes.unit());
        let turned = words.take(b'^', code)?;
        if turned.is_none() && distance < FEED_ROUNDING {
            return Err(words.refuse(letter, Fault::PolarOrigin));
        }
        let (distance, angle) = if self.modes.incremental {
            (
                distance + written.unwrap_or(0.0),
                angle + turned.unwrap_or(0.0),
            )
        } else {
            (written.unwrap_or(distance), turned.unwrap_or(angle))
        };
        let (sine, cosine) = libm::sincos(angle.to_radians());
        let place = [distance * cosine, distance * sine];
        for (axis, value) in [AxisLetter::X, AxisLetter::Y].into_iter().zip(place) {
            in_range(axis, value).map_err(|fault| words.refuse(letter, fault))?;
            point[axis] = value;
        }
        Ok(point)
    }

    /// The value of an axis's word, mm or degrees.
    pub(crate) fn coordinate(
        &self,
        words: &mut Words,
        axis: AxisLetter,
        code: Code,
    ) -> Result<Option<f64>, Refusal> {
        let letter = axis.letter() as u8;
        let Some(number) = words.take(letter, code)? else {
            return Ok(None);
        };
        let value = number * self.unit(axis);
        match in_range(axis, value) {
            Ok(()) => Ok(Some(value)),
            Err(fault) => Err(words.refuse(letter, fault)),
        }
    }

    /// The unit of an axis's words, mm or degrees.
    pub(crate) fn unit(&self, axis: AxisLetter) -> f64 {
        if axis.is_linear() {
            self.modes.unit()
        } else {
            1.0
        }
    }

    pub(crate) fn feed(&self, words: &mut Words, code: Code, to: Point) -> Result<Feed, Fault> {
        if self.modes.feed_mode == FeedMode::InverseTime {
            return match words.take_free(b'F') {
                Some(number) if number > 0.0 => Ok(Feed::Duration(60.0 / number)),
                Some(_) => Err(Fault::FeedZero { code }),
                None => Err(Fault::NoInverseTime { code }),
            };
        }
        let feed = self.modes.feed.ok_or(Fault::NoFeed { code })?;
        if feed.number == 0.0 {
            return Err(Fault::FeedZero { code });
        }
        let moves = |axis: AxisLetter| (to[axis] - self.at[axis]).abs() > FEED_ROUNDING;
        let only_rotary = matches!(code, Code::G(10))
            && AxisLetter::ALL.into_iter().any(moves)
            && !AxisLetter::ALL
                .into_iter()
                .any(|axis| axis.is_linear() && moves(axis));
        let unit = if only_rotary { 1.0 } else { feed.unit };
        self.modal_feed(feed.number * unit, &to)
            .ok_or(Fault::FeedPerTurnSpindle { code })
    }

    /// A feed of so many mm, or degrees, a minute or in a turn; none in a turn of a spindle that stands.
    /// On the way to `to` it is told its least speed.
    fn modal_feed(&self, travel: f64, to: &Point) -> Option<Feed> {
        if self.modes.feed_mode != FeedMode::PerTurn {
            return Some(Feed::Rate(travel / 60.0));
        }
        let Spindle { turning, .. } = self.modes.spindle;
        let at = |point: &Point| self.modes.spindle.at(point[AxisLetter::X]).speed;
        let turns = at(&self.at).min(at(to)) / 60.0;
        (turning != Turning::Off && turns > 0.0).then_some(Feed::PerTurn { travel, turns })
    }

    /// The arc about a centre. An axis that no block has sent anywhere stands where it was found, beside what the screen shows
    /// by an encoder's noise: of a circle from there to what is shown nothing would be left but the speck between the two.
    fn arc_about(
        &self,
        mut to: Point,
        center: [f64; 2],
        direction: Direction,
        turns: u32,
    ) -> Result<Arc, Fault> {
        let plane = self.modes.plane;
        let [first, second, _] = plane.axes();
        let arc = Arc::about(plane, self.at, to, center, direction, turns)?;
        let apart = libm::hypot(to[first] - self.at[first], to[second] - self.at[second]);
        let is_found = |axis| !self.sent.contains(axis) && to[axis] != self.at[axis];
        let is_speck = apart < MOST_BESIDE.min(arc.start_radius / 10.0)
            && arc.sweep.abs() - TAU * f64::from(arc.turns) < PI;
        if !is_speck || self.modes.incremental || !(is_found(first) || is_found(second)) {
            return Ok(arc);
        }
        if apart > FOUND_BESIDE {
            return Err(Fault::ArcNearlyClosed { apart });
        }
        (to[first], to[second]) = (self.at[first], self.at[second]);
        Arc::about(plane, self.at, to, center, direction, turns)
    }

    fn arc(
        &self,
        words: &mut Words,
        code: Code,
        to: Point,
        direction: Direction,
        columns: super::Columns,
    ) -> Result<Arc, Refusal> {
        let refuse = |fault| Refusal::new(columns, fault);
        let plane = self.modes.plane;
        let axes = plane.axes();
        self.plane_of_axes(code, columns)?;
        let missing_axes = axes[..2]
            .iter()
            .find(|axis| !self.setup.axes.contains(**axis));
        if let Some(axis) = missing_axes {
            return Err(refuse(Fault::NoSuchAxis {
                axis: *axis,
                axes: self.setup.axes,
            }));
        }
        let turns = words
            .take_whole(b'P', code, 1..=100_000, "whole turns from 1 to 100000")?
            .unwrap_or(1);
        words.offsets_in_plane(plane)?;
        let letters = plane.offset_letters();
        let offsets = [words.take(letters[0], code)?, words.take(letters[1], code)?];
        let radius = words.take(b'R', code)?;
        for letter in [letters[0], letters[1], b'R'] {
            let value = words.take(letter, code)?.unwrap_or_default() * self.modes.unit();
            if value.abs() > RADIUS_LIMIT {
                let allowed = "within 10 km; write a line";
                return Err(words.refuse(letter, out_of_range(char::from(letter), value, allowed)));
            }
        }
        let unit = self.modes.unit();
        let arc = match (radius, offsets) {
            (Some(_), [Some(_), _] | [_, Some(_)]) => {
                return Err(words.refuse(b'R', Fault::ArcOverdefined));
            }
            (Some(radius), _) => {
                Arc::with_radius(plane, self.at, to, radius * unit, direction, turns)
            }
            (None, [None, None]) => {
                return Err(refuse(Fault::ArcUndefined(match plane {
                    Plane::Xy => "I and J, or R",
                    Plane::Zx => "I and K, or R",
                    Plane::Yz => "J and K, or R",
                })));
            }
            (None, offsets) if !self.modes.absolute_centers || !offsets.contains(&None) => {
                let mut written = Point::ZERO;
                for (axis, offset) in axes.into_iter().zip(offsets) {
                    written[axis] = offset.unwrap_or(0.0) * unit;
                }
                let coordinates = self.coordinates();
                let center = if self.modes.absolute_centers {
                    coordinates.to_machine(written)
                } else {
                    sum(self.at, coordinates.turned(written))
                };
                let center = [center[axes[0]], center[axes[1]]];
                self.arc_about(to, center, direction, turns)
            }
            (None, _) => {
                return Err(refuse(Fault::ArcUndefined(
                    "both offsets of the centre, as G90.1 asks for",
                )));
            }
        };
        arc.map_err(refuse)
    }

    /// Refuses a motion that leaves the soft limits anywhere.
    pub(crate) fn within_limits(
        &self,
        from: &Point,
        action: &Action,
    ) -> Result<(), (AxisLetter, Fault)> {
        for axis in self.setup.axes.iter() {
            if let Action::Rapid { to }
            | Action::Feed { to, .. }
            | Action::Thread { to, .. }
            | Action::Tap { to, .. }
            | Action::Probe { to, .. } = action
            {
                in_range(axis, to[axis]).map_err(|fault| (axis, fault))?;
            }
            let Some((least, greatest)) = self.setup.limits[axis.index()] else {
                continue;
            };
            let (low, high) = match action {
                Action::Arc { arc, .. } => arc.extent(axis),
                Action::Spline { spline, .. } => spline.extent(axis),
                Action::Rapid { to }
                | Action::Feed { to, .. }
                | Action::Thread { to, .. }
                | Action::Tap { to, .. }
                | Action::Probe { to, .. } => (to[axis], to[axis]),
                _ => continue,
            };
            // An axis that rests may stand outside: that is for the caller to judge.
            if (low, high) == (from[axis], from[axis]) {
                continue;
            }
            let start = self.setup.start[axis];
            let stands = (least - LIMIT_NOISE..=greatest + LIMIT_NOISE).contains(&start);
            let begin = if stands { start } else { least };
            let value = if low < least.min(begin) - LIMIT_ROUNDING {
                low
            } else if high > greatest.max(begin) + LIMIT_ROUNDING {
                high
            } else {
                continue;
            };
            let fault = Fault::SoftLimit {
                axis,
                value,
                least,
                greatest,
            };
            return Err((axis, fault));
        }
        Ok(())
    }
}

/// Why a motion without a place cannot be, where that is a mistake.
fn leads_nowhere(motion: Motion) -> Option<Fault> {
    let code = motion.code();
    match motion {
        Motion::Cycle(_) => Some(Fault::CycleNowhere { code }),
        Motion::Probe(_) => Some(Fault::ProbeNowhere { code }),
        Motion::Thread | Motion::Tap | Motion::ThreadingCycle => {
            Some(Fault::ThreadNowhere { code })
        }
        _ => None,
    }
}

/// Refuses coordinates beyond every machine, which would lose digits, and what is no number.
pub(crate) fn in_range(axis: AxisLetter, value: f64) -> Result<(), Fault> {
    if value.abs() <= COORDINATE_LIMIT {
        return Ok(());
    }
    Err(Fault::Coordinate {
        axis,
        value,
        allowed: COORDINATE_LIMIT,
    })
}
