//! The moves of a program: made from its commands, and kept for who follows the machine along them.

use super::feed::{feed, programmed_speed};
use crate::control::PointToPoint;
use crate::machine::{COORDINATES, PathTolerances, Position};
use crossbeam::channel::{self, Receiver, Sender};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Weak};
use syncline_gcode::{self as gcode, Action, Modes, PathMode, Place, WorkCoordinates};
use syncline_trajectory::path::curve::{ArcDefinition, Circle};
use syncline_trajectory::path::segment_fitting::MoveEnd;
use syncline_trajectory::path::{Curve, CurveError, Line, PathControlMode, Plane};

/// Rounding of a setpoint on a curve, mm.
pub(super) const ON_THE_PATH: f64 = 1e-9;

/// So near to the end of a move the path rests at it, mm.
const AT: f64 = 1e-6;

/// How moves are left in this mode.
pub(super) fn path_control_mode(
    mode: PathMode,
    tolerances: PathTolerances,
    scale: f64,
) -> PathControlMode {
    match mode {
        PathMode::ExactStop => PathControlMode::Stop,
        PathMode::ExactPath => PathControlMode::Exact(tolerances.exact),
        PathMode::Blend { tolerance, merge } => {
            let tolerance = tolerance.map_or(tolerances.blend, |programmed| programmed * scale);
            merge.map_or(PathControlMode::Blend(tolerance), |within| {
                PathControlMode::Merge {
                    tolerance,
                    within: within * scale,
                }
            })
        }
    }
}

/// One programmed move, as recorders and checkers need it.
#[derive(Clone, Debug)]
pub struct ProgramMove {
    /// Program line.
    pub line: u32,
    /// A command in that line asks for it, and not the way to where the program is begun.
    pub is_programmed: bool,
    /// How many commands of the program come before it.
    passed: u64,
    shape: Shape,
    /// How far the path may leave it, mm.
    pub tolerance: f64,
    /// Where it ends along the path, mm from the beginning, if that is in the midst of a curve: of one that
    /// stands for many moves, or of a rounding.
    pub end: Option<f64>,
}

/// What a move keeps of its curve. Micro-lines come by the hundred thousand before the first of them is passed, so that
/// a line takes the room of a line, not that of the largest curve.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // most are lines
enum Shape {
    Line(Line<COORDINATES>),
    Bent(Box<Curve<COORDINATES>>),
}

impl ProgramMove {
    /// Of a block in this line, along `curve`, which the path may leave by `tolerance` mm.
    pub(super) fn new(line: u32, place: Place, curve: Curve<COORDINATES>, tolerance: f64) -> Self {
        let shape = match curve {
            Curve::Line(line) => Shape::Line(line),
            Curve::Arc(_) | Curve::Poly(_) => Shape::Bent(Box::new(curve)),
        };
        Self {
            line,
            is_programmed: place
                .known
                .is_some_and(|(number, _)| number == place.passed),
            passed: place.passed,
            shape,
            tolerance,
            end: None,
        }
    }

    /// Its geometry, machine coordinates.
    #[must_use]
    pub fn curve(&self) -> Curve<COORDINATES> {
        match &self.shape {
            Shape::Line(line) => Curve::Line(*line),
            Shape::Bent(curve) => **curve,
        }
    }

    /// The circle that it is all of, or a part: [`Arc::circle`](syncline_trajectory::path::Arc::circle).
    #[must_use]
    pub fn circle(&self, within: f64) -> Option<Circle> {
        match &self.shape {
            Shape::Bent(curve) => match &**curve {
                Curve::Arc(arc) => arc.circle(within),
                Curve::Line(_) | Curve::Poly(_) => None,
            },
            Shape::Line(_) => None,
        }
    }
}

/// Turns motion commands into curves, and into moves of the axes that go point to point: these the path does not
/// know, it stays where they were at its beginning.
pub(super) struct MoveSource {
    /// Of the path.
    at: Position,
    /// By coordinate: whether its axis goes point to point.
    point_to_point: [bool; COORDINATES],
    /// Where these axes are.
    places: Position,
}

/// A move along a path that takes along an axis that goes point to point: the axis.
pub(super) struct Mixed(pub(super) gcode::AxisLetter);

/// Where a command goes.
fn destination(action: &Action) -> Option<Position> {
    match action {
        Action::Rapid { to }
        | Action::Feed { to, .. }
        | Action::Thread { to, .. }
        | Action::Tap { to, .. }
        | Action::Probe { to, .. } => Some(to.0),
        Action::Arc { arc, .. } => Some(arc.to.0),
        Action::Spline { spline, .. } => Some(spline.to.0),
        _ => None,
    }
}

impl MoveSource {
    pub(super) fn new(start: Position, point_to_point: [bool; COORDINATES]) -> Self {
        Self {
            at: start,
            point_to_point,
            places: start,
        }
    }

    /// A place as the path knows it.
    fn on_path(&self, mut to: Position) -> Position {
        for coordinate in (0..COORDINATES).filter(|&at| self.point_to_point[at]) {
            to[coordinate] = self.at[coordinate];
        }
        to
    }

    /// Where a command sends axes point to point, behind its curves; at the part `scale` of its feed.
    ///
    /// # Errors
    /// A feed that goes along a path besides.
    pub(super) fn point_to_point(
        &mut self,
        action: &Action,
        scale: f64,
    ) -> Result<Option<PointToPoint>, Mixed> {
        let Some(to) = destination(action) else {
            return Ok(None);
        };
        let mut targets = [None; COORDINATES];
        let mut places = self.places;
        for at in (0..COORDINATES).filter(|&at| self.point_to_point[at]) {
            if to[at] != places[at] {
                (targets[at], places[at]) = (Some(to[at]), to[at]);
            }
        }
        let Some(first) = targets.iter().position(Option::is_some) else {
            return Ok(None);
        };
        let along = match action {
            Action::Rapid { .. } => false,
            // A probe is looked for, and a thread cut, along a path only.
            Action::Probe { .. } | Action::Thread { .. } | Action::Tap { .. } => true,
            _ => self.on_path(to) != self.at,
        };
        if along {
            return Err(Mixed(gcode::AxisLetter::ALL[first]));
        }
        let line = Curve::line(self.places, places).ok();
        let speed = (line.zip(feed(action)))
            .map(|(line, feed)| scale * programmed_speed(&line, feed, line.length()));
        self.places = places;
        Ok(Some(PointToPoint { targets, speed }))
    }

    /// The line of a probing or a thread.
    pub(super) fn line(&self, to: Position) -> Result<Curve<COORDINATES>, CurveError> {
        Curve::line(self.at, self.on_path(to))
    }

    /// The path goes on from there; where all axes are then.
    pub(super) fn go_on_from(&mut self, at: Position) -> Position {
        self.at = at;
        let beside = self.point_to_point;
        std::array::from_fn(|of| if beside[of] { self.places[of] } else { at[of] })
    }

    /// Axes were homed, and are there now.
    pub(super) fn homed(&mut self, at: Position) {
        (self.at, self.places) = (at, at);
    }

    /// The curves that a command asks for: none, or none as it has no length, or the parts of a spline.
    pub(super) fn curves(
        &mut self,
        command: &gcode::Command,
    ) -> Result<Vec<Curve<COORDINATES>>, CurveError> {
        let one = |curve: Result<_, _>| curve.map(|curve| vec![curve]);
        let (curves, to) = match &command.action {
            Action::Rapid { to } | Action::Feed { to, .. } => {
                (one(Curve::line(self.at, self.on_path(to.0))), to.0)
            }
            Action::Arc { arc, .. } => {
                let definition = ArcDefinition {
                    start: self.at,
                    end: self.on_path(arc.to.0),
                    plane: match arc.plane {
                        gcode::Plane::Xy => Plane::Xy,
                        gcode::Plane::Zx => Plane::Zx,
                        gcode::Plane::Yz => Plane::Yz,
                    },
                    centre: (arc.center[0], arc.center[1]),
                    clockwise: arc.direction() == gcode::Direction::Clockwise,
                    turns: arc.turns,
                };
                (one(Curve::arc(definition)), arc.to.0)
            }
            Action::Spline { spline, .. } => {
                let controls = spline.controls().map(|[x, y]| {
                    let mut point = self.at;
                    (
                        point[gcode::AxisLetter::X.index()],
                        point[gcode::AxisLetter::Y.index()],
                    ) = (x, y);
                    point
                });
                (Curve::spline(controls), spline.to.0)
            }
            _ => return Ok(Vec::new()),
        };
        match curves {
            Ok(curves) => {
                self.at = self.on_path(to);
                Ok(curves)
            }
            Err(CurveError::NoLength) => Ok(Vec::new()),
            Err(source) => Err(source),
        }
    }
}

/// Takes the moves that come up in a program; [`Moves`] has them.
pub struct Upcoming {
    steps: Sender<Step>,
    /// As [`Moves`] has it, as long as there is one.
    first: Weak<AtomicU32>,
    /// What was told last, and how often something was.
    modal: Option<ModalState>,
    told: usize,
}

/// What is in effect in a block.
#[derive(Clone, Debug, PartialEq)]
pub struct ModalState {
    /// The codes.
    pub modes: Modes,
    /// Where the program's coordinates lie in the machine: work offset, tool length, G92 and rotation.
    pub coordinates: WorkCoordinates,
}

/// What becomes known of a program.
#[allow(clippy::large_enum_variant)] // most are moves
pub(super) enum Step {
    /// The program began where the machine stood there, and is begun at that place.
    Begin(Position, Place),
    Move(ProgramMove),
    End(MoveEnd),
    Stop(ProgramStop),
    Message(String),
    /// It is in effect from the move with that tag on.
    Modal(u32, Box<ModalState>),
}

/// Where the path rests for a block.
pub(super) struct ProgramStop {
    /// Of the next move behind it.
    pub(super) tag: u32,
    /// The block's line.
    pub(super) line: u32,
    /// Where the program goes on, or begins the block anew.
    pub(super) place: Place,
    /// How many modal states were told up to it, its own included.
    told: usize,
}

impl Upcoming {
    pub(super) fn tell(&self, step: Step) {
        // Nobody following is fine.
        let _ = self.steps.send(step);
    }

    /// Tells what is in effect from the move with this tag on, where that is something else than before.
    pub(super) fn tell_modal(&mut self, tag: u32, interpreter: &gcode::Interpreter) {
        let (modes, coordinates) = (interpreter.modes(), interpreter.coordinates());
        let is_told = |it: &ModalState| it.modes == *modes && it.coordinates == coordinates;
        if self.modal.as_ref().is_some_and(is_told) {
            return;
        }
        let modes = modes.clone();
        let modal = ModalState { modes, coordinates };
        self.tell(Step::Modal(tag, Box::new(modal.clone())));
        self.modal = Some(modal);
        self.told += 1;
    }

    /// Tells that the path rests for a block in this line before the move with this tag, and what is in effect there.
    pub(super) fn tell_stop(
        &mut self,
        tag: u32,
        line: u32,
        place: Place,
        interpreter: &gcode::Interpreter,
    ) {
        self.tell_modal(tag, interpreter);
        let told = self.told;
        self.tell(Step::Stop(ProgramStop {
            tag,
            line,
            place,
            told,
        }));
    }

    /// The tag of the first move that is not forgotten, if somebody follows the machine along the moves.
    pub(super) fn first(&self) -> Option<u32> {
        Some(self.first.upgrade()?.load(Ordering::Relaxed))
    }
}

/// The moves of a running program that the machine has not passed yet.
pub struct Moves {
    coming: Receiver<Step>,
    moves: VecDeque<ProgramMove>,
    /// Tag of the first of `moves`.
    first: Arc<AtomicU32>,
    /// Those that were not told, in the program's order.
    messages: VecDeque<String>,
    /// Those that are not passed.
    stops: VecDeque<ProgramStop>,
    /// Each with the tag of the first move that it is in effect in.
    modal: VecDeque<(u32, Box<ModalState>)>,
    /// How many of those were passed.
    passed: usize,
    begun: Option<(Position, Place)>,
}

impl Moves {
    /// None yet, and what takes them.
    #[must_use]
    pub fn new() -> (Upcoming, Self) {
        let (steps, coming) = channel::unbounded();
        let first = Arc::new(AtomicU32::new(0));
        let upcoming = Upcoming {
            steps,
            first: Arc::downgrade(&first),
            modal: None,
            told: 0,
        };
        let moves = Self {
            coming,
            moves: VecDeque::new(),
            first,
            messages: VecDeque::new(),
            stops: VecDeque::new(),
            modal: VecDeque::new(),
            passed: 0,
            begun: None,
        };
        (upcoming, moves)
    }

    fn first(&self) -> u32 {
        self.first.load(Ordering::Relaxed)
    }

    /// Takes up what has come.
    pub fn take_up(&mut self) {
        let first = self.first();
        for step in self.coming.try_iter() {
            match step {
                Step::Begin(start, place) => self.begun = Some((start, place)),
                Step::Stop(stop) => self.stops.push_back(stop),
                Step::Move(motion) => self.moves.push_back(motion),
                Step::Message(text) => self.messages.push_back(text),
                Step::Modal(tag, modal) => self.modal.push_back((tag, modal)),
                Step::End(MoveEnd { tag, at }) => {
                    let index = tag.checked_sub(first).map(|index| index as usize);
                    if let Some(motion) = index.and_then(|index| self.moves.get_mut(index)) {
                        motion.end = Some(at);
                    }
                }
            }
        }
    }

    /// The next message, whose place the path has come to.
    pub fn next_message(&mut self) -> Option<String> {
        self.take_up();
        self.messages.pop_front()
    }

    /// The tag of the move at work where the path has come to `distance` under the `tag` of a setpoint: a
    /// curve that stands for many moves has the last one's, a rounding that of the move before it.
    #[must_use]
    pub fn at(&self, mut tag: u32, distance: f64) -> u32 {
        let end = |of: u32| self.motion(of)?.end;
        while let Some(before) = tag.checked_sub(1)
            && end(before).is_some_and(|end| end > distance)
        {
            tag = before;
        }
        while end(tag).is_some_and(|end| end <= distance) && self.motion(tag + 1).is_some() {
            tag += 1;
        }
        tag
    }

    /// The move behind a setpoint's tag, unless it was forgotten.
    #[must_use]
    pub fn motion(&self, tag: u32) -> Option<&ProgramMove> {
        self.moves.get(tag.checked_sub(self.first())? as usize)
    }

    /// What has come into effect since this was asked last, up to the move with this tag, or up to the block in that line
    /// that the path rests for there.
    pub fn next_modal(&mut self, tag: u32, rests_for: Option<u32>) -> Option<ModalState> {
        let stop = rests_for.and_then(|line| self.stop(tag, line));
        let come = match stop {
            Some(stop) => stop.told.saturating_sub(self.passed).min(self.modal.len()),
            None => self
                .modal
                .iter()
                .take_while(|(from, _)| *from <= tag)
                .count(),
        };
        self.passed += come;
        let last = self.modal.drain(..come).next_back();
        last.map(|(_, modal)| *modal)
    }

    /// Where the machine stood when the program began, and where it was begun, as soon as that is known.
    #[must_use]
    pub fn begun(&self) -> Option<(Position, Place)> {
        self.begun
    }

    /// The stop for a block in this line behind the move with this tag, or before it if none has begun.
    fn stop(&self, tag: u32, line: u32) -> Option<&ProgramStop> {
        let of_line = |tag: u32| {
            let mut stops = self.stops.iter();
            stops.find(move |stop| stop.tag == tag && stop.line == line)
        };
        of_line(tag + 1).or_else(|| of_line(tag))
    }

    /// Where the program is to be resumed that rests for a block in this line behind the move with this tag.
    #[must_use]
    pub fn resting(&self, tag: u32, line: u32) -> Option<Place> {
        self.stop(tag, line).map(|stop| stop.place)
    }

    /// A program goes on behind the probing or homing in this line that it rested for behind the move with this tag: where it
    /// is to be resumed from then on.
    pub fn found(&mut self, tag: u32, line: u32) -> Option<Place> {
        let rests = |stop: &ProgramStop| stop.line == line && (tag..=tag + 1).contains(&stop.tag);
        let at = self.stops.iter().position(rests)?;
        let stop = self.stops.drain(..=at).next_back()?;
        let passed = stop.place.passed + 1;
        Some(Place {
            passed,
            ..stop.place
        })
    }

    /// Where the program is to be resumed whose path has come to a place of the move with this tag: at the beginning of
    /// the command that asks for that, or behind it if the path rests `at` its end.
    #[must_use]
    pub fn moving(&self, tag: u32, at: Option<&Position>) -> Option<Place> {
        let motion = self.motion(tag)?;
        let known = motion.is_programmed.then_some((motion.passed, motion.line));
        let mut passed = motion.passed;
        let end = motion.curve().end();
        let ends = at.is_some_and(|at| at.iter().zip(end).all(|(at, end)| (at - end).abs() < AT));
        // A spline may be a command of many curves.
        let is_last = match self.motion(tag + 1) {
            Some(next) => next.passed != motion.passed,
            None => !matches!(motion.curve(), Curve::Poly(_)),
        };
        if ends && is_last && motion.is_programmed {
            passed += 1;
        }
        Some(Place { passed, known })
    }

    /// Forgets the moves before `tag`.
    pub fn passed(&mut self, tag: u32) {
        while self.stops.front().is_some_and(|stop| stop.tag < tag) {
            self.stops.pop_front();
        }
        let mut first = self.first();
        while first < tag && self.moves.pop_front().is_some() {
            first += 1;
        }
        self.first.store(first, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOWHERE: Place = Place {
        passed: 0,
        known: None,
    };

    fn line(number: u32) -> ProgramMove {
        let at = |x: u32| {
            let mut point = Position::default();
            point[0] = f64::from(x) * 1e-3;
            point
        };
        let curve = Curve::line(at(number), at(number + 1));
        ProgramMove::new(number, NOWHERE, curve.unwrap(), ON_THE_PATH)
    }

    /// On its way and kept, a line takes hardly more room than its points and its direction do.
    #[test]
    fn a_line_takes_the_room_of_a_line() {
        let bare = size_of::<Line<COORDINATES>>();
        for kept in [size_of::<Step>(), size_of::<ProgramMove>()] {
            assert!(kept <= bare + 64, "{kept} bytes for a line of {bare}");
        }
    }

    /// Of moves that are told and passed one by one no more are kept than lie between.
    #[test]
    fn what_is_passed_takes_no_room() {
        let (upcoming, mut moves) = Moves::new();
        for number in 0..20_000_u32 {
            upcoming.tell(Step::Move(line(number)));
            moves.take_up();
            moves.passed(number.saturating_sub(100));
            let kept = moves.motion(number).map(|motion| motion.line);
            assert_eq!(kept, Some(number));
        }
        assert_eq!(moves.moves.len(), 101);
        assert!(moves.moves.capacity() <= 256, "{}", moves.moves.capacity());
    }

    /// A move gives back the curve that it was made of.
    #[test]
    fn the_curve_of_a_move_is_kept_to_the_bit() {
        let (a, mut b) = (Position::default(), Position::default());
        b[..4].copy_from_slice(&[1.0 / 3.0, 0.7, -2.0, 11.0]);
        let arc = ArcDefinition {
            start: a,
            end: b,
            plane: Plane::Xy,
            centre: (b[0] / 2.0, b[1] / 2.0),
            clockwise: true,
            turns: 0,
        };
        let spline = Curve::spline([0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|x| {
            let mut point = a;
            (point[0], point[1]) = (x, x * x);
            point
        }));
        let mut curves = vec![Curve::line(a, b).unwrap(), Curve::arc(arc).unwrap()];
        curves.extend(spline.unwrap());
        for curve in curves {
            assert_eq!(
                ProgramMove::new(1, NOWHERE, curve, ON_THE_PATH).curve(),
                curve
            );
        }
    }
}
