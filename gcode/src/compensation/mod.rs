//! Cutter compensation: G41 and G42 (G41.1, G42.1) to G40.
//!
//! The program gives the contour; the centre of a tool of radius R has to stay R beside it, left of
//! it for G41, right for G42. So each block of the contour has a **parallel**: a line moved aside,
//! or an arc about the same centre with a radius that is R longer or shorter. What is left to find
//! is how two parallels join, and that depends on the corner between their blocks:
//!
//! ```text
//!     outside: away from the tool         inside: towards the tool
//!      ────────╮ R                               │   │
//!      ──────┐  │                         ───────┘   │   the parallels are cut
//!    contour │  │ path                    ───────────┘   where they cross
//! ```
//!
//! - **Smooth**: the parallels meet as the blocks do.
//! - **Outside**: the tool rolls around the corner, on an arc of radius R about it. Where lines
//!   turn so little that their crossing is no farther from the corner than a fraction of a
//!   micrometre, they are lengthened to that instead, so that a curve of short lines stays one.
//! - **Inside**: both parallels end where they cross. That is the first place where the tool on
//!   its way along the one touches the other: of two crossings with an arc the one nearest to the
//!   corner, because just before it the tool is still free.
//!
//! A join needs the block behind it, so one block is always held back, together with what stands
//! behind it without moving in the plane (a plunge, a dwell, an M-code): they take place at its end.
//!
//! **Why nothing is cut beyond the contour.** A parallel is R away from its block, and after its
//! cuts it begins and ends where it touches its neighbours. A block whose parallel has nothing left
//! between two cuts, or that would have to be gone through backwards, is one that the tool does not
//! fit into, and is refused: an arc that is narrower than the tool, a step lower than R. All else
//! that the tool may cut into, wherever it is along the contour, is found by measuring the whole of
//! its way against the whole of the contour: `gouge` says what counts. A part of the contour is known
//! to that as soon as its block is read, a part of the way before it is handed out.
//!
//! **The ways on and off** are straight. The move behind G41 ends beside its end point, as if it
//! were the contour's first block; being longer than R, it begins outside of the tool's reach of
//! it. The move behind G40 leads from beside the last block to its own end point.

mod gouge;
mod nearby;
mod segment;
mod words;

use std::collections::VecDeque;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::arc::{Arc, Direction, Plane};
use super::axes::{AxisLetter, Point};
use super::command::{Action, Command, Feed, Span};
use super::error::{Fault, Origin, Refusal};
use gouge::GougeCheck;
use segment::{CircularArc, ROUNDING, Segment, Vector, along, cross, distance, dot, left_of};

/// How far a joint may cut beyond the contour, where programs round their digits, mm.
const NEGLIGIBLE: f64 = 0.001;
/// Moves in the plane, gaps and arcs shorter than this are rounding of the program's, mm.
const SHORT: f64 = 1e-6;
/// How many commands may wait for the next move in the plane.
const MAX_WAITING: usize = 1000;

/// What G41 and G42 ask for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Cutter {
    pub(crate) plane: Plane,
    /// Above zero, mm.
    pub(crate) radius: f64,
    pub(crate) left: bool,
}

/// Where a refused motion is looked up: the machine's limits, from a point on.
pub(crate) type Judge<'a> = &'a dyn Fn(&Point, &Action) -> Result<(), (AxisLetter, Fault)>;

/// How fast a block is gone along.
#[derive(Clone, Copy, Debug)]
enum Speed {
    Rapid,
    Feed(Feed),
}

/// A block of the contour, held back until the next is known.
#[derive(Debug)]
struct Held {
    origin: Origin,
    speed: Speed,
    contour: Segment,
    /// Its parallel, as far as it is cut.
    path: Segment,
    /// Its programmed end: the axes out of the plane go there.
    end: Point,
    /// Whether it is the way onto the contour.
    entering: bool,
    /// How far the contour has turned to its start, rad, positive to the left.
    turned: f64,
    /// Where it begins and ends across the plane, mm.
    heights: [f64; 2],
}

/// What stands between two moves in the plane.
#[derive(Debug)]
enum Waiting {
    Command(Span, Action),
    /// A move of other axes.
    Across(Origin, Speed, Point),
}

/// How one block's path goes over into the next one's.
enum Joint {
    /// Both are cut, or lengthened, to one point.
    Meet { behind: f64, ahead: f64 },
    /// Around the corner.
    Around(Segment),
    /// They meet but for a gap, which is bridged.
    Gap,
}

/// Turns the contour of a program into the way of the tool's centre.
#[derive(Debug)]
pub(crate) struct Compensation {
    cutter: Cutter,
    /// Where what was handed out has led the tool.
    at: Point,
    /// Where the program is.
    programmed: Point,
    held: Option<Held>,
    waiting: Vec<Waiting>,
    check: GougeCheck,
}

impl Compensation {
    /// Compensation that begins with the tool at a point of the program's.
    pub(crate) fn new(cutter: Cutter, at: Point) -> Compensation {
        Compensation {
            cutter,
            at,
            programmed: at,
            held: None,
            waiting: Vec::new(),
            check: GougeCheck::new(cutter.radius),
        }
    }

    pub(crate) fn cutter(&self) -> Cutter {
        self.cutter
    }

    /// Where what was handed out leads the tool.
    pub(crate) fn at(&self) -> Point {
        self.at
    }

    /// Takes the next command of the program; what is settled by it goes to `commands`.
    pub(crate) fn take(
        &mut self,
        action: Action,
        origin: &Origin,
        judge: Judge<'_>,
        commands: &mut VecDeque<Command>,
    ) -> Result<(), Refusal> {
        let (speed, to) = match action {
            Action::Rapid { to } => (Speed::Rapid, to),
            Action::Feed { to, feed } => (Speed::Feed(feed), to),
            Action::Arc { arc, feed } => (Speed::Feed(feed), arc.to),
            action => return self.wait(Waiting::Command(origin.span, action), origin, commands),
        };
        let mut out = Out { judge, commands };
        let contour = match action {
            Action::Arc { arc, .. } => {
                if (arc.start_radius - arc.end_radius).abs() > SHORT {
                    return Err(origin.refuse(Fault::CutterSpiral));
                }
                Segment::Arc(CircularArc {
                    center: arc.center,
                    radius: arc.start_radius,
                    start: arc.start_angle,
                    sweep: arc.sweep,
                })
            }
            _ => Segment::Line {
                from: self.in_plane(&self.programmed),
                to: self.in_plane(&to),
            },
        };
        if contour.length() < SHORT {
            let [first, second, _] = self.cutter.plane.axes();
            let (kept, kept_second) = (self.programmed[first], self.programmed[second]);
            self.programmed = to;
            (self.programmed[first], self.programmed[second]) = (kept, kept_second);
            if self.held.is_none() {
                return out.go(&mut self.at, line(speed, to), origin);
            }
            return self.wait(
                Waiting::Across(origin.clone(), speed, to),
                origin,
                out.commands,
            );
        }
        let next = self.block(contour, speed, to, origin)?;
        self.programmed = to;
        match self.held.take() {
            Some(held) => self.join(held, next, &mut out),
            None => {
                self.held = Some(next);
                Ok(())
            }
        }
    }

    /// Ends the contour: hands out what was held back. The tool stays beside the last block's end.
    pub(crate) fn finish(
        &mut self,
        judge: Judge<'_>,
        commands: &mut VecDeque<Command>,
    ) -> Result<(), Refusal> {
        if let Some(held) = self.held.take() {
            self.hand_out(held, &mut Out { judge, commands })?;
        }
        self.check.finish()
    }

    /// Judges the move behind G40, which leads off the contour.
    pub(crate) fn leave(&self, to: &Point, origin: &Origin) -> Result<(), Refusal> {
        let (from, ends) = (self.in_plane(&self.at), self.in_plane(to));
        let across = self.cutter.plane.axes()[2];
        let line = Segment::Line { from, to: ends };
        (self.check).tool_path_off(line, [self.at[across], to[across]], origin)
    }

    /// Keeps what stands between two moves in the plane; before the first there is nothing to wait
    /// for.
    fn wait(
        &mut self,
        waiting: Waiting,
        origin: &Origin,
        commands: &mut VecDeque<Command>,
    ) -> Result<(), Refusal> {
        match waiting {
            Waiting::Command(span, action) if self.held.is_none() => {
                commands.push_back(Command { span, action });
            }
            _ if self.waiting.len() >= MAX_WAITING => {
                let allowed = MAX_WAITING;
                return Err(origin.refuse(Fault::CutterWaits { allowed }));
            }
            waiting => self.waiting.push(waiting),
        }
        Ok(())
    }

    /// A block with its parallel.
    fn block(
        &self,
        contour: Segment,
        speed: Speed,
        end: Point,
        origin: &Origin,
    ) -> Result<Held, Refusal> {
        let radius = self.cutter.radius;
        let entering = self.held.is_none();
        if entering {
            let length = contour.length();
            if matches!(contour, Segment::Arc(_)) {
                return Err(origin.refuse(Fault::CutterEntryArc));
            }
            if length <= radius {
                return Err(origin.refuse(Fault::CutterEntry { length, radius }));
            }
        }
        let across = self.cutter.plane.axes()[2];
        let Some(path) = contour.parallel(self.side() * radius) else {
            return Err(origin.refuse(Fault::CutterArc {
                radius: contour.curvature().recip().abs(),
                cutter: radius,
            }));
        };
        Ok(Held {
            origin: origin.clone(),
            speed,
            contour,
            path,
            end,
            entering,
            turned: 0.0,
            heights: [self.programmed[across], end[across]],
        })
    }

    /// 1 for a tool left of the contour, -1 for one right of it.
    fn side(&self) -> f64 {
        if self.cutter.left { 1.0 } else { -1.0 }
    }

    /// Hands out the held block up to its joint with the next, which is held in its place.
    fn join(&mut self, mut held: Held, mut next: Held, out: &mut Out<'_>) -> Result<(), Refusal> {
        let [_, before] = held.contour.directions();
        let [behind, _] = next.contour.directions();
        let turn = libm::atan2(cross(before, behind), dot(before, behind));
        let Some(joint) = self.joint(&held, &next, turn) else {
            let line = held.origin.span.line;
            return Err(next.origin.refuse(Fault::CutterCorner { line }));
        };
        if let Joint::Meet { behind: cut, ahead } = joint {
            held.path = held.path.without_end_along(cut, before);
            next.path = next.path.without_start_along(ahead, behind);
        }
        next.turned = held.turned + held.contour.turning();
        next.turned += match &joint {
            Joint::Around(corner) => corner.turning(),
            Joint::Meet { .. } | Joint::Gap => turn,
        };
        (self.check).contour(next.contour, next.turned, next.heights, &next.origin)?;
        let (end, origin, speed) = (held.end, held.origin.clone(), held.speed);
        self.hand_out(held, out)?;
        match joint {
            Joint::Meet { .. } => {}
            Joint::Around(corner) => {
                let speed = match speed {
                    Speed::Rapid => next.speed,
                    feed => feed,
                };
                self.follow(corner, speed, self.at, &origin, out)?;
            }
            Joint::Gap => {
                let to = self.out_of_plane(next.path.from(), end);
                let (from, ends) = (self.in_plane(&self.at), next.path.from());
                if distance(from, ends) > SHORT {
                    self.go(line(next.speed, to), &origin, out)?;
                }
            }
        }
        self.held = Some(next);
        Ok(())
    }

    /// How the paths of two blocks join, whose contours turn by an angle between them; `None` if
    /// the tool does not fit.
    fn joint(&self, held: &Held, next: &Held, turn: f64) -> Option<Joint> {
        let radius = self.cutter.radius;
        let inward = turn * self.side();
        let lines = matches!(
            (held.contour, next.contour),
            (Segment::Line { .. }, Segment::Line { .. })
        );
        let shorter = held.contour.length().min(next.contour.length());
        if (PI - turn.abs()) * shorter < SHORT {
            // Straight back. Which of the two lies on the tool's side, their curvatures tell.
            let apart = held.contour.curvature() + next.contour.curvature();
            if apart * self.side() < -ROUNDING {
                return None;
            }
            let turn = if inward > 0.0 {
                TAU - turn.abs()
            } else {
                turn.abs()
            };
            return Some(Joint::Around(self.corner(held, turn)));
        }
        let beyond = radius * (1.0 / libm::cos(turn / 2.0) - 1.0);
        if lines && (inward > 0.0 || beyond < NEGLIGIBLE / 2.0) {
            let length = radius * libm::tan(inward / 2.0);
            let fits =
                length <= held.path.length() + ROUNDING && length <= next.path.length() + ROUNDING;
            let (behind, ahead) = (length, length);
            if fits {
                return Some(Joint::Meet { behind, ahead });
            }
        } else if radius * turn.abs() < SHORT {
            return Some(Joint::Gap);
        } else if inward < 0.0 {
            return Some(Joint::Around(self.corner(held, turn.abs())));
        } else {
            let crossings = held.path.crossings(&next.path).into_iter().flatten();
            let nearest = crossings
                .map(|point| (held.path.behind(point), next.path.ahead(point)))
                .filter(|(behind, ahead)| {
                    (-ROUNDING..=held.path.length() + ROUNDING).contains(behind)
                        && (-ROUNDING..=next.path.length() + ROUNDING).contains(ahead)
                })
                .min_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((behind, ahead)) = nearest {
                return Some(Joint::Meet { behind, ahead });
            }
        }
        // Too short to be cut, but so little turned that no more than digits are lost.
        (radius * (1.0 - libm::cos(inward)) < NEGLIGIBLE).then_some(Joint::Gap)
    }

    /// The tool's way around the corner at a block's end, by an angle away from the tool.
    fn corner(&self, held: &Held, turn: f64) -> Segment {
        let center = held.contour.to();
        let [_, direction] = held.contour.directions();
        let aside = left_of(direction);
        let start = libm::atan2(self.side() * aside[1], self.side() * aside[0]);
        Segment::Arc(CircularArc {
            center,
            radius: self.cutter.radius,
            start,
            sweep: -self.side() * turn,
        })
    }

    /// Hands out a block along its path, and what waited for its end.
    fn hand_out(&mut self, held: Held, out: &mut Out<'_>) -> Result<(), Refusal> {
        if held.entering {
            let to = self.out_of_plane(held.path.to(), held.end);
            let (from, ends) = (self.in_plane(&self.at), held.path.to());
            let heights = self.heights_to(&to);
            (self.check).tool_path(
                Segment::Line { from, to: ends },
                heights,
                true,
                &held.origin,
            )?;
            out.go(&mut self.at, line(held.speed, to), &held.origin)?;
        } else {
            self.follow(held.path, held.speed, held.end, &held.origin, out)?;
        }
        for waiting in std::mem::take(&mut self.waiting) {
            match waiting {
                Waiting::Command(span, action) => out.commands.push_back(Command { span, action }),
                Waiting::Across(origin, speed, to) => {
                    let to = self.out_of_plane(self.in_plane(&self.at), to);
                    out.go(&mut self.at, self::line(speed, to), &origin)?;
                }
            }
        }
        Ok(())
    }

    /// Hands out the motion along a segment; the axes out of the plane go to `end` meanwhile.
    fn follow(
        &mut self,
        path: Segment,
        speed: Speed,
        end: Point,
        origin: &Origin,
        out: &mut Out<'_>,
    ) -> Result<(), Refusal> {
        let to = self.out_of_plane(path.to(), end);
        match (path, speed) {
            (Segment::Arc(circular), Speed::Feed(feed)) if path.length() > 10.0 * SHORT => {
                let CircularArc { center, sweep, .. } = circular;
                let direction = if sweep > 0.0 {
                    Direction::Counterclockwise
                } else {
                    Direction::Clockwise
                };
                let whole = sweep.abs() / TAU;
                let turns = if distance(self.in_plane(&self.at), path.to()) < SHORT {
                    whole.round()
                } else {
                    whole.floor() + 1.0
                };
                let arc = Arc::about(
                    self.cutter.plane,
                    self.at,
                    to,
                    center,
                    direction,
                    turns as u32,
                );
                let arc = arc.map_err(|fault| origin.refuse(fault))?;
                let heights = self.heights_to(&to);
                self.check.tool_path(path, heights, false, origin)?;
                out.go(&mut self.at, Action::Arc { arc, feed }, origin)
            }
            // At rapid around a corner on tangents to the arc, which stay clear of the contour.
            (Segment::Arc(_), Speed::Rapid) => {
                let quarters = (path.turning().abs() / FRAC_PI_2).ceil().max(1.0);
                for part in path.parts(quarters as u32) {
                    let [direction, _] = part.directions();
                    let tangent = part.length() / part.turning().abs()
                        * libm::tan(part.turning().abs() / 2.0);
                    let over = along(part.from(), direction, tangent);
                    for point in [over, part.to()] {
                        let to = self.out_of_plane(point, end);
                        self.go(Action::Rapid { to }, origin, out)?;
                    }
                }
                Ok(())
            }
            _ => self.go(line(speed, to), origin, out),
        }
    }

    /// Hands out a straight move along the contour.
    fn go(&mut self, action: Action, origin: &Origin, out: &mut Out<'_>) -> Result<(), Refusal> {
        if let Some(to) = action.destination() {
            let line = Segment::Line {
                from: self.in_plane(&self.at),
                to: self.in_plane(&to),
            };
            if line.length() > SHORT {
                (self.check).tool_path(line, self.heights_to(&to), false, origin)?;
            }
        }
        out.go(&mut self.at, action, origin)
    }

    /// Where the tool is across the plane, and where it goes, mm.
    fn heights_to(&self, to: &Point) -> [f64; 2] {
        let across = self.cutter.plane.axes()[2];
        [self.at[across], to[across]]
    }

    fn in_plane(&self, point: &Point) -> Vector {
        let [first, second, _] = self.cutter.plane.axes();
        [point[first], point[second]]
    }

    /// A point in the plane with the other axes of `others`.
    fn out_of_plane(&self, point: Vector, others: Point) -> Point {
        let [first, second, _] = self.cutter.plane.axes();
        let mut to = others;
        (to[first], to[second]) = (point[0], point[1]);
        to
    }
}

/// Where motions go that are settled.
struct Out<'a> {
    judge: Judge<'a>,
    commands: &'a mut VecDeque<Command>,
}

impl Out<'_> {
    fn go(&mut self, at: &mut Point, action: Action, origin: &Origin) -> Result<(), Refusal> {
        (self.judge)(at, &action).map_err(|(_, fault)| origin.refuse(fault))?;
        if let Action::Rapid { to } | Action::Feed { to, .. } = action {
            *at = to;
        } else if let Action::Arc { arc, .. } = &action {
            *at = arc.to;
        }
        let span = origin.span;
        self.commands.push_back(Command { span, action });
        Ok(())
    }
}

fn line(speed: Speed, to: Point) -> Action {
    match speed {
        Speed::Rapid => Action::Rapid { to },
        Speed::Feed(feed) => Action::Feed { to, feed },
    }
}
