//! The moves of a program: made from its commands, and kept for who follows the machine along them.

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

/// Turns motion commands into curves.
pub(super) struct MoveSource {
    pub(super) at: Position,
}

impl MoveSource {
    /// The curves that a command asks for: none, or none as it has no length, or the parts of a spline.
    pub(super) fn curves(
        &mut self,
        command: &gcode::Command,
    ) -> Result<Vec<Curve<COORDINATES>>, CurveError> {
        let one = |curve: Result<_, _>| curve.map(|curve| vec![curve]);
        let (curves, to) = match &command.action {
            Action::Rapid { to } | Action::Feed { to, .. } => {
                (one(Curve::line(self.at, to.0)), to.0)
            }
            Action::Arc { arc, .. } => {
                let definition = ArcDefinition {
                    start: self.at,
                    end: arc.to.0,
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
                self.at = to;
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
