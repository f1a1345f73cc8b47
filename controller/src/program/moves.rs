//! The moves of a program: made from its commands, and kept for who follows the machine along them.

use super::feed::{feed, path_speed};
use crate::control::PointToPoint;
use crate::machine::{COORDINATES, Position};
use crossbeam::channel::{self, Receiver, Sender};
use std::collections::VecDeque;
use syncline_gcode::{self as gcode, Action};
use syncline_trajectory::path::curve::ArcDefinition;
use syncline_trajectory::path::segment_fitting::MoveEnd;
use syncline_trajectory::path::{Curve, CurveError, Plane};

/// Rounding of a setpoint on a curve, mm.
pub(super) const ON_THE_PATH: f64 = 1e-9;

/// One programmed move, as recorders and checkers need it.
#[derive(Clone, Debug)]
pub struct ProgramMove {
    /// Program line.
    pub line: u32,
    /// Its geometry, machine coordinates.
    pub curve: Curve<COORDINATES>,
    /// How far the path may leave it, mm.
    pub tolerance: f64,
    /// Where it ends along the path, mm from the beginning, if that is in the midst of a curve: of one that
    /// stands for many moves, or of a rounding.
    pub end: Option<f64>,
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
pub(super) struct Mixed(pub(super) gcode::Axis);

/// Where a command goes.
fn destination(action: &Action) -> Option<Position> {
    match action {
        Action::Rapid { to } | Action::Feed { to, .. } => Some(to.0),
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
        if !matches!(action, Action::Rapid { .. }) && self.on_path(to) != self.at {
            return Err(Mixed(gcode::Axis::ALL[first]));
        }
        let line = Curve::line(self.places, places).ok();
        let speed = line.zip(feed(action)).map(|(line, feed)| match feed {
            gcode::Feed::Rate(rate) => scale * path_speed(&line, rate),
            gcode::Feed::Duration(seconds) => scale * line.length() / seconds,
        });
        self.places = places;
        Ok(Some(PointToPoint { targets, speed }))
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
                    (point[gcode::Axis::X.index()], point[gcode::Axis::Y.index()]) = (x, y);
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
pub struct Upcoming(Sender<Step>);

/// What becomes known of a program.
#[allow(clippy::large_enum_variant)] // most are moves
pub(super) enum Step {
    Move(ProgramMove),
    End(MoveEnd),
    Message(String),
}

impl Upcoming {
    pub(super) fn tell(&self, step: Step) {
        // Nobody following is fine.
        let _ = self.0.send(step);
    }
}

/// The moves of a running program that the machine has not passed yet.
pub struct Moves {
    coming: Receiver<Step>,
    moves: VecDeque<ProgramMove>,
    /// Tag of the first of `moves`.
    first: u32,
    /// Those that were not told, in the program's order.
    messages: VecDeque<String>,
}

impl Moves {
    /// None yet, and what takes them.
    #[must_use]
    pub fn new() -> (Upcoming, Self) {
        let (sender, coming) = channel::unbounded();
        let moves = Self {
            coming,
            moves: VecDeque::new(),
            first: 0,
            messages: VecDeque::new(),
        };
        (Upcoming(sender), moves)
    }

    /// Takes up what has come.
    pub fn take_up(&mut self) {
        for step in self.coming.try_iter() {
            match step {
                Step::Move(motion) => self.moves.push_back(motion),
                Step::Message(text) => self.messages.push_back(text),
                Step::End(MoveEnd { tag, at }) => {
                    let index = tag.checked_sub(self.first).map(|index| index as usize);
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
        self.moves.get(tag.checked_sub(self.first)? as usize)
    }

    /// Forgets the moves before `tag`.
    pub fn passed(&mut self, tag: u32) {
        while self.first < tag && self.moves.pop_front().is_some() {
            self.first += 1;
        }
    }
}
