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
//! fit into, and is refused: an arc that is narrower than the tool, a step lower than R. What
//! remains are contours that close in on themselves behind a wider place, as the neck of a bottle.
//! There, and only there, two walls face each other across the tool: seen along the contour it has
//! turned towards the tool by a half turn, more or less. So the tool's way along each block is
//! measured against every one of the last [`REMEMBERED`] blocks that faces it, by the exact
//! distance of lines and arcs. A way onto a contour that crosses the way off it, as it does behind
//! a full circle, has turned by a whole turn or more, and is none of that.
//!
//! **The ways on and off** are straight. The move behind G41 ends beside its end point, as if it
//! were the contour's first block; being longer than R, it begins outside of the tool's reach of
//! it. The move behind G40 leads from beside the last block to its own end point. What the tool
//! meets on these two is the program's affair.
//!
//! Measuring every block against all others of the contour, whichever way they face, was tried on
//! paper and refused what everybody writes: an arc onto a pocket's wall lies inside the pocket, and
//! is cut when the tool comes round.

mod segment;
mod words;

use std::collections::VecDeque;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use super::arc::{Arc, Direction, Plane};
use super::axes::{AxisLetter, Point};
use super::command::{Action, Command, Feed, Span};
use super::error::{Fault, Origin, Refusal};
use segment::{CircularArc, ROUNDING, Segment, Vector, along, cross, distance, dot, left_of};

/// How far the tool may cut beyond the contour, where programs round their digits, mm.
const NEGLIGIBLE: f64 = 0.001;
/// Moves in the plane, gaps and arcs shorter than this are rounding of the program's, mm.
const SHORT: f64 = 1e-6;
/// How many parts of the contour and of the tool's way are remembered to find walls that are too
/// near to each other.
const REMEMBERED: usize = 1000;
/// Arcs are remembered in parts that turn by this much, rad: few, and each with one way to face.
const PART: f64 = PI / 8.0;
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
    /// How much of that, towards the tool, lies in gaps within reach of it.
    in_gaps: f64,
    corner: InsideCorner,
}

/// The last inside corner before the end of a block's path: what goes back so far cuts into its
/// other block.
#[derive(Clone, Copy, Debug)]
struct InsideCorner {
    /// How far it is behind, mm.
    behind: f64,
    /// How far the contour turns there towards the tool, rad.
    turn: f64,
}

impl InsideCorner {
    /// There is none, or an outside corner parts the tool from it.
    const NONE: InsideCorner = InsideCorner {
        behind: f64::INFINITY,
        turn: 0.0,
    };

    /// How deep the tool cuts in where it goes back, mm.
    fn depth(&self, back: f64) -> f64 {
        (back - self.behind).max(0.0) * libm::sin(self.turn.min(FRAC_PI_2))
    }
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

/// A part of the contour or of the tool's way, as it is remembered.
#[derive(Clone, Copy, Debug)]
struct Part {
    segment: Segment,
    extent: [Vector; 2],
    /// How far the contour has turned at its start and end, rad.
    turned: [f64; 2],
    /// Its least and greatest coordinate across the plane, mm.
    height: [f64; 2],
    line: u32,
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
    contours: VecDeque<Part>,
    paths: VecDeque<Part>,
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
            contours: VecDeque::new(),
            paths: VecDeque::new(),
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
        match self.held.take() {
            Some(held) => self.hand_out(held, &mut Out { judge, commands }),
            None => Ok(()),
        }
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
            in_gaps: 0.0,
            corner: InsideCorner::NONE,
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
        if let Joint::Meet { behind, ahead } = joint {
            held.path = held.path.without_end(behind);
            next.path = next.path.without_start(ahead);
        }
        let turned = held.turned + held.contour.turning();
        let (in_gaps, corner) = (held.in_gaps, held.corner);
        let inward = turn * self.side();
        let short = held.path.length() < self.cutter.radius;
        let (end, line) = (held.end, held.origin.span.line);
        let (origin, speed) = (held.origin.clone(), held.speed);
        self.hand_out(held, out)?;
        next.turned = turned + turn;
        match joint {
            Joint::Meet { .. } => {
                next.corner = if inward > 0.0 {
                    InsideCorner {
                        behind: 0.0,
                        turn: inward,
                    }
                } else {
                    corner
                };
            }
            Joint::Around(corner) => {
                next.turned = turned + corner.turning();
                let speed = match speed {
                    Speed::Rapid => next.speed,
                    feed => feed,
                };
                let height = self.at[self.cutter.plane.axes()[2]];
                let parts = Part::of(corner, turned, [height; 2], line);
                self.measure(parts, false, &origin)?;
                self.follow(corner, speed, self.at, &origin, out)?;
            }
            Joint::Gap => {
                next.in_gaps = inward.max(0.0);
                next.corner = corner;
                next.corner.behind -= self.step_back(inward);
                if short {
                    next.in_gaps += in_gaps;
                }
                let to = self.out_of_plane(next.path.from(), end);
                if distance(self.in_plane(&self.at), next.path.from()) > SHORT {
                    out.go(&mut self.at, self::line(next.speed, to), &origin)?;
                }
            }
        }
        next.corner.behind += next.path.length();
        self.held = Some(next);
        Ok(())
    }

    /// How far the tool goes back in a gap where the contour turns towards it, mm.
    fn step_back(&self, inward: f64) -> f64 {
        2.0 * self.cutter.radius * libm::sin(inward.max(0.0) / 2.0)
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
        let turned = held.in_gaps + inward;
        let depth = radius * (1.0 - libm::cos(turned)) + held.corner.depth(self.step_back(inward));
        (depth < NEGLIGIBLE).then_some(Joint::Gap)
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
        let across = self.cutter.plane.axes()[2];
        let (from, to) = (self.at[across], held.end[across]);
        let height = [from.min(to), from.max(to)];
        let line = held.origin.span.line;
        if held.entering {
            let to = self.out_of_plane(held.path.to(), held.end);
            out.go(&mut self.at, self::line(held.speed, to), &held.origin)?;
        } else {
            let before_path = match (held.path, held.contour) {
                (Segment::Arc(path), Segment::Arc(contour)) => path.start - contour.start,
                _ => 0.0,
            };
            let path = Part::of(held.path, held.turned + before_path, height, line);
            let contour = Part::of(held.contour, held.turned, height, line);
            self.measure(path, false, &held.origin)?;
            self.measure(contour, true, &held.origin)?;
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
                out.go(&mut self.at, Action::Arc { arc, feed }, origin)
            }
            // At rapid around a corner on tangents to the arc, which stay clear of the contour.
            (Segment::Arc(_), Speed::Rapid) => {
                for part in path.parts(FRAC_PI_2) {
                    let [direction, _] = part.directions();
                    let tangent = part.length() / part.turning().abs()
                        * libm::tan(part.turning().abs() / 2.0);
                    let over = along(part.from(), direction, tangent);
                    for point in [over, part.to()] {
                        let to = self.out_of_plane(point, end);
                        out.go(&mut self.at, Action::Rapid { to }, origin)?;
                    }
                }
                Ok(())
            }
            _ => out.go(&mut self.at, line(speed, to), origin),
        }
    }

    /// Measures parts of the contour, or of the tool's way, against all that was remembered of the
    /// other and faces them, and remembers them too.
    fn measure(
        &mut self,
        parts: impl Iterator<Item = Part>,
        are_contour: bool,
        origin: &Origin,
    ) -> Result<(), Refusal> {
        let (cutter, side) = (self.cutter, self.side());
        let (own, others) = if are_contour {
            (&mut self.contours, &self.paths)
        } else {
            (&mut self.paths, &self.contours)
        };
        for part in parts {
            let met = others
                .iter()
                .find(|other| part.cuts_into(other, cutter.radius, side));
            if let Some(met) = met {
                let (line, radius) = (met.line, cutter.radius);
                return Err(origin.refuse(Fault::CutterGouge { line, radius }));
            }
            if own.len() == REMEMBERED {
                own.pop_front();
            }
            own.push_back(part);
        }
        Ok(())
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

impl Part {
    fn of(
        segment: Segment,
        turned: f64,
        height: [f64; 2],
        line: u32,
    ) -> impl Iterator<Item = Part> {
        let mut turned = turned;
        segment.parts(PART).map(move |segment| {
            let start = turned;
            turned += segment.turning();
            Part {
                segment,
                extent: segment.extent(),
                turned: [start, turned],
                height,
                line,
            }
        })
    }

    /// Whether the tool on one of the two cuts into the other: the contour has turned towards the
    /// tool by about half a turn from the earlier to this one, they are at one height, and nearer
    /// to each other than the tool's radius.
    fn cuts_into(&self, earlier: &Part, radius: f64, side: f64) -> bool {
        let turns = [0, 1].map(|i| [0, 1].map(|j| side * (self.turned[i] - earlier.turned[j])));
        let turns = turns.as_flattened().iter();
        let least = turns.clone().fold(f64::INFINITY, |a, b| a.min(*b));
        let most = turns.fold(f64::NEG_INFINITY, |a, b| a.max(*b));
        if most <= FRAC_PI_2 || least >= 3.0 * FRAC_PI_2 {
            return false;
        }
        let reach = radius - NEGLIGIBLE;
        let apart = |k: usize| {
            let [low, high] = self.extent;
            let [other_low, other_high] = earlier.extent;
            (other_low[k] - high[k]).max(low[k] - other_high[k])
        };
        let level = self.height[0] <= earlier.height[1] + SHORT
            && earlier.height[0] <= self.height[1] + SHORT;
        level
            && apart(0) < reach
            && apart(1) < reach
            && self.segment.distance(&earlier.segment) < reach
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
