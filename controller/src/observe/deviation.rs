//! Setpoint and tool against the programmed geometry.
//!
//! The contour error is the distance of the tool from the program's moves. It has three parts: what the planner
//! rounds off, which is how far the setpoint is from them; what the drives make of the setpoints, which
//! is how far the axes are off the path of those (`trail`); and what lies between the motors and the tool: what twists,
//! has play or a lead error, or grows with warmth (`transmission`), and the sway of the structure (`structure`). In the worst
//! case they add up.
//!
//! A program crosses itself, and where a corner is rounded another move may be nearer than the two that meet there. The places are
//! therefore sought along the program's moves: from where the path has come to by its own distance, the setpoint's no
//! farther than a few times of what it is away from there, and from that the tool's no farther than it can lag. The nearest of the
//! last eight moves and the next eight, as it was once, hid roundings that another move crossed, and made a contour error of the
//! tool's distance from that move.

use super::Observed;
use super::circles::Circles;
use super::kept::Kept;
use super::limits::Watch;
use super::record::{Greatest, Place, Violation};
use super::summary::PathSummary;
use super::trail::{Trail, norm};
use super::travel::Travel;
use crate::machine::{COORDINATES, Machine, Position};
use crate::program::Moves;
use std::ops::Range;
use syncline_trajectory::path::Curve;

/// Angle of the tangent between two places from which the nearest one is searched, rad.
const SWEEP: f64 = 0.5;
/// Steps of Newton's method.
const STEPS: usize = 12;
/// A setpoint so near, mm, is on its move.
const NEAREST: f64 = 1e-9;
/// Where a rounding leads from one move to the next, its foot jumps by up to so many times its distance.
const CORNER: f64 = 4.0;

/// How far setpoint and tool were from the program's moves so far.
#[derive(Debug)]
pub(super) struct Deviation {
    /// Of the setpoint, mm: what rounding makes of the contour error.
    setpoint: Greatest,
    /// Of the tool, mm: the contour error.
    tool: Greatest,
    /// Of the actual position from the path of the setpoints, mm: the drives' part of it.
    drives: Greatest,
    course: Course,
    trail: Trail,
    /// The path of the setpoints is all that there is.
    without_moves: bool,
    /// By coordinate: whether its axis goes point to point, beside the path.
    beside: [bool; COORDINATES],
    watch: Watch,
    /// What of the contour error `[validation]` allows, mm.
    tolerance: f64,
    contour: Watch,
}

/// How far setpoint and tool were from the program's moves.
#[derive(Clone, Copy, Debug)]
pub(super) struct OffPath {
    /// The setpoint, mm.
    pub(super) setpoint: f64,
    /// The tool, mm: the contour error.
    pub(super) tool: f64,
    /// From the program's moves to the tool, mm, in X, Y and Z.
    pub(super) by: [f64; 3],
}

/// The nearest place of the program's moves.
struct Foot {
    /// How far it is, mm.
    away: f64,
    /// Of its move.
    tag: u32,
    /// Where on that, mm.
    along: f64,
}

/// A distance that is greater than allowed, mm.
fn violation(what: &str, at: Place, value: f64, limit: f64) -> Violation {
    Violation {
        what: what.to_owned(),
        axis: None,
        time: at.time,
        line: at.line,
        value,
        limit,
        unit: "mm",
    }
}

impl Deviation {
    /// Nothing yet.
    pub(super) fn new(machine: &Machine) -> Self {
        Self {
            setpoint: Greatest::default(),
            tool: Greatest::default(),
            drives: Greatest::default(),
            course: Course::default(),
            trail: Trail::new(machine.cycle.as_secs_f64()),
            without_moves: false,
            beside: machine.point_to_point(),
            watch: Watch::default(),
            tolerance: machine.validation.contour_error,
            contour: Watch::default(),
        }
    }

    /// No moves of a program say where the tool is to be, but the setpoints alone.
    pub(super) fn has_no_moves(&mut self) {
        self.without_moves = true;
    }

    /// Takes what is seen at one SYNC, and where the tool is; how far setpoint and tool are from the program's moves,
    /// unless the axes are off the path.
    pub(super) fn observe(
        &mut self,
        observed: &Observed,
        tool: &Position,
        time: f64,
        violations: &mut Kept<Violation>,
    ) -> Option<OffPath> {
        let Observed {
            row, actual, line, ..
        } = observed;
        let plan = &row.plan;
        if self.without_moves {
            return self.observe_trail(observed, tool, time, violations);
        }
        let at_work = (observed.tag).zip(observed.moves.motion(plan.tag));
        let Some((tag, motion)) = at_work else {
            self.trail.clear();
            return None;
        };
        let on_path = |mut at: Position| {
            for coordinate in (0..COORDINATES).filter(|&at| self.beside[at]) {
                at[coordinate] = motion.curve().start()[coordinate];
            }
            at
        };
        let (position, actual) = (on_path(plan.position), &on_path(*actual));
        let at_tool = &on_path(*tool);
        let foot = self.course.nearest(observed, tag, &position);
        let deviation = foot.as_ref().map_or(f64::INFINITY, |foot| foot.away);
        (self.trail).push(row.cycle, position, plan.velocity, at_tool);
        let reach = self.trail.reach() + CORNER * deviation;
        let of_tool = foot.as_ref().and_then(|foot| {
            let found = from_stretch(observed.moves, foot, [reach, reach], at_tool)?;
            let curve = observed.moves.motion(found.tag)?.curve();
            Some((found.away, curve.at(found.along).q))
        });
        let (tool, place) = of_tool.unwrap_or((f64::INFINITY, *at_tool));
        let at = Place { time, line: *line };
        self.setpoint.look(deviation, at);
        self.tool.look(tool, at);
        let mut off = self.trail.distance(actual);
        // Axes that lead are where no setpoint has been yet: there the setpoints' path is the program's.
        if off > self.drives.value
            && let Some(foot) = &foot
            && let Some(ahead) = from_stretch(observed.moves, foot, [0.0, reach], actual)
        {
            off = off.min(ahead.away);
        }
        self.drives.look(off, at);
        // A rounding is all of it the move's before it.
        let allowed = motion.tolerance;
        (self.watch).look(violations, at, deviation, allowed, |_| {
            violation("path_deviation", at, deviation, allowed)
        });
        let allowed = self.tolerance;
        (self.contour).look(violations, at, tool, allowed, |_| {
            violation("contour_error", at, tool, allowed)
        });
        Some(OffPath {
            setpoint: deviation,
            tool,
            by: [0, 1, 2].map(|at| at_tool[at] - place[at]),
        })
    }

    /// Takes what is seen at one SYNC where the contour error is the drives' and the structure's alone.
    fn observe_trail(
        &mut self,
        observed: &Observed,
        at_tool: &Position,
        time: f64,
        violations: &mut Kept<Violation>,
    ) -> Option<OffPath> {
        let Observed {
            row, actual, line, ..
        } = observed;
        if row.plan.off_path {
            self.trail.clear();
            return None;
        }
        (self.trail).push(row.cycle, row.plan.position, row.plan.velocity, at_tool);
        let tool = self.trail.distance(at_tool);
        let at = Place { time, line: *line };
        self.tool.look(tool, at);
        self.drives.look(self.trail.distance(actual), at);
        let limit = self.tolerance;
        (self.contour).look(violations, at, tool, limit, |_| {
            violation("contour_error", at, tool, limit)
        });
        Some(OffPath {
            setpoint: 0.0,
            tool,
            by: [0, 1, 2].map(|at| at_tool[at] - row.plan.position[at]),
        })
    }

    /// Ends violations that go on.
    pub(super) fn close(&mut self, violations: &mut Kept<Violation>) {
        self.watch.close(violations);
        self.contour.close(violations);
    }

    /// With how far the tool came, the path of the run.
    pub(super) fn path(&self, travel: &Travel, circles: &Circles) -> PathSummary {
        PathSummary {
            length_mm: travel.length_mm,
            turned_deg: travel.turned_deg,
            max_deviation_mm: self.setpoint.value,
            max_deviation_at: self.setpoint.at,
            max_contour_error_mm: self.tool.value,
            max_contour_error_at: self.tool.at,
            max_drive_deviation_mm: self.drives.value,
            max_drive_deviation_at: self.drives.at,
            max_circular_deviation_mm: circles.greatest,
        }
    }
}

/// Where on the program's moves the path is.
#[derive(Clone, Copy, Debug, Default)]
struct Course {
    /// Of which job.
    job: u64,
    /// Of the move that the path has come to.
    tag: u32,
    /// Where that begins by the path's distance, mm.
    from: f64,
    /// The path's distance when this was last asked for, mm.
    distance: f64,
}

impl Course {
    /// The nearest place to a setpoint at that distance of the path, whose move has this tag. It is sought from where the path is
    /// on that, so far along it as a rounding or a shaper may have the setpoint aside: what crosses there from elsewhere, also a
    /// later part of the same move, does not count.
    fn nearest(&mut self, observed: &Observed, tag: u32, point: &Position) -> Option<Foot> {
        let (job, moves) = (observed.job, observed.moves);
        if job != self.job {
            *self = Self {
                job,
                ..Self::default()
            };
        }
        let distance = observed.row.plan.distance;
        let curve = moves.motion(tag)?.curve();
        let length = curve.length();
        if tag != self.tag {
            let entered = if tag > self.tag { 0.0 } else { length };
            // A plan behind a probing or a homing counts from 0, too.
            let gone = (distance - self.distance).abs().min(distance.abs());
            let near = gone + CORNER * norm(&curve.at(entered).q, point);
            let range = (entered - near).max(0.0)..(entered + near).min(length);
            (self.tag, self.from) = (tag, distance - foot(&curve, point, &range).1);
        }
        self.distance = distance;
        let along = (distance - self.from).clamp(0.0, length);
        let away = norm(&curve.at(along).q, point);
        let path = Foot { away, tag, along };
        if away <= NEAREST {
            return Some(path);
        }
        let found = from_stretch(moves, &path, [CORNER * away; 2], point)?;
        if found.tag == tag {
            self.from = distance - found.along;
        }
        Some(found)
    }
}

/// The place of the program's moves, up to so many mm back from a foot and so many on from it, that is nearest to a point.
fn from_stretch(
    moves: &Moves,
    from: &Foot,
    [back, on]: [f64; 2],
    point: &Position,
) -> Option<Foot> {
    let curve = moves.motion(from.tag)?.curve();
    let length = curve.length();
    let (before, behind) = (from.along - back, from.along + on);
    let (away, along) = foot(&curve, point, &(before.max(0.0)..behind.min(length)));
    let tag = from.tag;
    let mut nearest = Foot { away, tag, along };
    let mut look = |tag: u32, curve: &Curve<COORDINATES>, range: Range<f64>| {
        // Nothing of a line is nearer than its start by more than its end is from there.
        let start = curve.start();
        let skipped = matches!(curve, Curve::Line(_))
            && norm(&start, point) - norm(&start, &curve.end()) >= nearest.away;
        if !skipped {
            let (away, along) = foot(curve, point, &range);
            if away < nearest.away {
                nearest = Foot { away, tag, along };
            }
        }
    };
    let (mut tag, mut left) = (from.tag, -before);
    while left > 0.0
        && let Some(motion) = tag.checked_sub(1).and_then(|tag| moves.motion(tag))
    {
        let curve = motion.curve();
        let length = curve.length();
        tag -= 1;
        look(tag, &curve, (length - left).max(0.0)..length);
        left -= length;
    }
    let (mut tag, mut left) = (from.tag, behind - length);
    while left > 0.0
        && let Some(motion) = moves.motion(tag + 1)
    {
        let curve = motion.curve();
        let length = curve.length();
        tag += 1;
        look(tag, &curve, 0.0..left.min(length));
        left -= length;
    }
    Some(nearest)
}

/// Distance of `point` from `curve`, mm; exact for points nearer than the curve's radius.
///
/// Independent of what the planner made of the curve: only its definition by length is used.
#[must_use]
pub fn distance(curve: &Curve<COORDINATES>, point: &Position) -> f64 {
    foot(curve, point, &(0.0..curve.length())).0
}

/// The same from a stretch of the curve, and where on it the nearest place is.
fn foot(curve: &Curve<COORDINATES>, point: &Position, range: &Range<f64>) -> (f64, f64) {
    let length = range.end - range.start;
    let bend = norm(&curve.at(0.0).d2, &Position::default()) * length;
    let places = 1 + (bend / SWEEP).ceil() as usize;
    let place = |index: usize| range.start + length * index as f64 / places as f64;
    let apart = |s: f64| norm(&curve.at(s).q, point);
    let nearer = |one: (f64, f64), other: (f64, f64)| if other.0 < one.0 { other } else { one };
    let nearest = (0..=places).map(|index| (apart(place(index)), place(index)));
    let nearest = nearest.fold((f64::INFINITY, 0.0), nearer);
    // A foot nearer than that lies within half a step of a place that is hardly further.
    let step = length / places as f64;
    (0..=places)
        .filter(|&index| apart(place(index)) <= nearest.0 + step)
        .map(|index| descend(curve, point, place(index), range))
        .fold(nearest, nearer)
}

/// Distance at the foot of the perpendicular that is found from `s`, (q − p)·q′ = 0, and where that is.
fn descend(
    curve: &Curve<COORDINATES>,
    point: &Position,
    mut s: f64,
    range: &Range<f64>,
) -> (f64, f64) {
    let length = curve.length();
    for _ in 0..STEPS {
        let at = curve.at(s);
        let (mut slope, mut change) = (0.0, 0.0);
        for (i, (q, p)) in at.q.iter().zip(point).enumerate() {
            slope += (q - p) * at.d1[i];
            change += at.d1[i] * at.d1[i] + (q - p) * at.d2[i];
        }
        let step = if change > 0.0 { slope / change } else { slope };
        let next = (s - step).clamp(range.start, range.end);
        let arrived = (next - s).abs() <= length * 1e-15;
        s = next;
        if arrived {
            break;
        }
    }
    (norm(&curve.at(s).q, point), s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use syncline_trajectory::path::Plane;
    use syncline_trajectory::path::curve::ArcDefinition;

    fn at(x: f64, y: f64, z: f64) -> Position {
        let mut position = Position::default();
        position[..3].copy_from_slice(&[x, y, z]);
        position
    }

    #[test]
    fn distance_from_a_line() {
        let line = Curve::line(at(0.0, 0.0, 0.0), at(10.0, 0.0, 0.0)).unwrap();
        assert!((distance(&line, &at(4.0, 3.0, 4.0)) - 5.0).abs() < 1e-12);
        assert!((distance(&line, &at(13.0, 4.0, 0.0)) - 5.0).abs() < 1e-12);
        assert!((distance(&line, &at(-3.0, 4.0, 0.0)) - 5.0).abs() < 1e-12);
    }

    #[test]
    fn distance_from_an_arc() {
        let arc = Curve::arc(ArcDefinition {
            start: at(10.0, 0.0, 0.0),
            end: at(10.0, 0.0, 0.0),
            plane: Plane::Xy,
            centre: (0.0, 0.0),
            clockwise: false,
            turns: 0,
        })
        .unwrap();
        for degrees in 0..360 {
            let (y, x) = f64::from(degrees).to_radians().sin_cos();
            for radius in [7.0, 10.0, 12.5] {
                let found = distance(&arc, &at(radius * x, radius * y, 0.0));
                assert!(
                    (found - (radius - 10.0).abs()).abs() < 1e-9,
                    "{degrees}: {found}"
                );
            }
        }
    }
}
