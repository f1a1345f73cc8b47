//! Circular and helical arcs in machine coordinates.

use std::f64::consts::{PI, TAU};

use super::axes::{AxisLetter, Point};
use super::error::Fault;
use super::modal::Code;

/// Radii of start and end may differ by this, or by [`RADIUS_RATIO`] if that is more. mm. It is what
/// post-processors make of three decimals of an inch.
pub const RADIUS_TOLERANCE: f64 = 0.028;
/// Radii that differ by less than this are equal but for rounding. mm.
const RADIUS_ROUNDING: f64 = 1e-6;
/// Where the centre cannot be moved, as nearly all around a circle, the radius may change by this
/// along the arc, or by [`RADIUS_RATIO`]. mm.
const SPIRAL_TOLERANCE: f64 = 0.005;
/// Radii of start and end may differ by this part of the radius.
pub const RADIUS_RATIO: f64 = 0.001;
/// Start and end of an arc closer than this are the same point: a full circle. mm.
const SAME_POINT: f64 = 1e-6;

/// A plane for arcs and canned cycles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Plane {
    /// G17
    #[default]
    Xy,
    /// G18
    Zx,
    /// G19
    Yz,
}

impl Plane {
    /// First and second axis of the plane, right-handed, and the one perpendicular to it.
    pub const fn axes(self) -> [AxisLetter; 3] {
        match self {
            Plane::Xy => [AxisLetter::X, AxisLetter::Y, AxisLetter::Z],
            Plane::Zx => [AxisLetter::Z, AxisLetter::X, AxisLetter::Y],
            Plane::Yz => [AxisLetter::Y, AxisLetter::Z, AxisLetter::X],
        }
    }

    /// The code that selects the plane.
    pub(crate) const fn code(self) -> Code {
        Code::G(match self {
            Plane::Xy => 170,
            Plane::Zx => 180,
            Plane::Yz => 190,
        })
    }

    /// The letters of the centre's offsets along the first and second axis.
    pub(crate) const fn offset_letters(self) -> [u8; 2] {
        match self {
            Plane::Xy => [b'I', b'J'],
            Plane::Zx => [b'K', b'I'],
            Plane::Yz => [b'J', b'K'],
        }
    }
}

/// The sense of an arc, seen from the positive end of the axis perpendicular to its plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// G2
    Clockwise,
    /// G3
    Counterclockwise,
}

/// An arc, helix or full circle in machine coordinates.
///
/// The defining curve: over the fraction of the sweep, from 0 to 1, the angle about the centre, the
/// distance from it and every other axis go linearly from their start to their end: a circle or a
/// helix. Where the digits of a program make the radii of start and end differ, the centre is moved
/// so that they agree and both ends are met exactly; [`deviation`](Arc::deviation) tells what that
/// changes. Where that changes too much, the arc is a spiral that is as slight as the digits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// The plane of the circle.
    pub plane: Plane,
    /// Where the arc starts, machine coordinates.
    pub from: Point,
    /// Where it ends, machine coordinates.
    pub to: Point,
    /// Centre along the plane's first and second axis, machine coordinates, mm.
    pub center: [f64; 2],
    /// Distance of the start from the centre, mm.
    pub start_radius: f64,
    /// Distance of the end from the centre, mm; all but `start_radius`.
    pub end_radius: f64,
    /// Whole turns before the last, possibly partial, one.
    pub turns: u32,
    /// Angle of the start about the centre from the plane's first axis, rad.
    pub start_angle: f64,
    /// Angle swept, rad: positive counterclockwise; beyond a full circle for turns.
    pub sweep: f64,
    /// How far the arc is from what the program's own centre and radii describe, mm.
    pub deviation: f64,
}

impl Arc {
    /// An arc about a centre. `turns` ≥ 1 counts the last, possibly partial, turn. Start and end at
    /// one point make full circles.
    pub(crate) fn about(
        plane: Plane,
        from: Point,
        to: Point,
        center: [f64; 2],
        direction: Direction,
        turns: u32,
    ) -> Result<Arc, Fault> {
        let spiral = Arc::spiral(plane, from, to, center, direction, turns)?;
        let [start, end] = [spiral.start_radius, spiral.end_radius];
        let difference = (end - start).abs();
        if difference < RADIUS_ROUNDING {
            return Ok(spiral);
        }
        let allowed = RADIUS_TOLERANCE.max(RADIUS_RATIO * start);
        let moved = Arc::spiral(plane, from, to, spiral.middle_center(), direction, turns);
        if let Ok(mut moved) = moved
            && difference <= allowed
        {
            moved.deviation = moved.distance_from(&spiral);
            if moved.deviation <= allowed {
                return Ok(moved);
            }
        }
        let slight = SPIRAL_TOLERANCE.max(RADIUS_RATIO * start);
        if difference <= slight {
            return Ok(spiral);
        }
        let allowed = if difference > allowed {
            allowed
        } else {
            slight
        };
        Err(Fault::ArcRadii {
            start,
            end,
            difference,
            allowed,
        })
    }

    /// The centre that is nearest to this one and as far from the start as from the end.
    fn middle_center(&self) -> [f64; 2] {
        let [first, second, _] = self.plane.axes();
        let (from, to) = (self.from, self.to);
        let chord = [to[first] - from[first], to[second] - from[second]];
        let square = chord[0] * chord[0] + chord[1] * chord[1];
        let [start, end] = [self.start_radius, self.end_radius];
        // By the difference of the squares of both radii.
        let part = (end - start) * (end + start) / (2.0 * square);
        [
            self.center[0] + chord[0] * part,
            self.center[1] + chord[1] * part,
        ]
    }

    /// How far this arc is from another between the same ends, and that one from this one: each is measured from the
    /// other's centre, as nearly all of a circle is near a speck at its start.
    fn distance_from(&self, other: &Arc) -> f64 {
        // Of circles that are narrower than what is allowed, none is lost.
        if other.sweep.abs() - self.sweep.abs() > PI / 2.0 {
            return f64::INFINITY;
        }
        // Turns in between are between the first and the last one.
        let rounds = f64::from(self.turns) + 1.0;
        let of_turn = |turn: f64| (0..=32).map(move |k| (turn + f64::from(k) / 32.0) / rounds);
        let places = of_turn(0.0).chain(of_turn(rounds - 1.0));
        let apart = |fraction| f64::max(self.off(other, fraction), other.off(self, fraction));
        places.map(apart).fold(0.0, f64::max)
    }

    /// How far this arc is nearer to the other's centre, or farther from it, than that one is, there.
    fn off(&self, other: &Arc, fraction: f64) -> f64 {
        let [first, second, _] = self.plane.axes();
        let point = self.at(fraction);
        let away = libm::hypot(
            point[first] - other.center[0],
            point[second] - other.center[1],
        );
        (away - other.radius(fraction)).abs()
    }

    /// An arc about a centre whose radius goes from that of the start to that of the end.
    fn spiral(
        plane: Plane,
        from: Point,
        mut to: Point,
        center: [f64; 2],
        direction: Direction,
        turns: u32,
    ) -> Result<Arc, Fault> {
        let [first, second, _] = plane.axes();
        // What the conversions rounded must not make a full circle of nothing, or the reverse.
        let chord = libm::hypot(to[first] - from[first], to[second] - from[second]);
        if chord < SAME_POINT {
            (to[first], to[second]) = (from[first], from[second]);
        }
        let start = [from[first] - center[0], from[second] - center[1]];
        let mut end = [to[first] - center[0], to[second] - center[1]];
        let start_radius = libm::hypot(start[0], start[1]);
        if start_radius < SAME_POINT {
            return Err(Fault::ArcNoRadius);
        }
        let start_angle = libm::atan2(start[1], start[0]);
        // The angle between the two rays, by cross and dot product: exact for equal points.
        let angle = |end: [f64; 2]| {
            libm::atan2(
                start[0] * end[1] - start[1] * end[0],
                start[0] * end[0] + start[1] * end[1],
            )
        };
        let mut between = angle(end);
        let ahead = match direction {
            Direction::Counterclockwise => between,
            Direction::Clockwise => -between,
        };
        // Nor does rounding make a speck of a circle that ends off its start.
        if ahead > 0.0 && ahead * start_radius < SAME_POINT && chord >= SAME_POINT {
            let aside = SAME_POINT * between.signum() / start_radius;
            let [x, y] = end;
            end = [x + y * aside, y - x * aside];
            (to[first], to[second]) = (center[0] + end[0], center[1] + end[1]);
            end = [to[first] - center[0], to[second] - center[1]];
            between = angle(end);
        }
        let end_radius = libm::hypot(end[0], end[1]);
        let part = match direction {
            Direction::Counterclockwise if between <= 0.0 => between + TAU,
            Direction::Clockwise if between >= 0.0 => TAU - between,
            _ => between.abs(),
        };
        let turns = turns.saturating_sub(1);
        let whole = part + TAU * f64::from(turns);
        Ok(Arc {
            plane,
            from,
            to,
            center,
            start_radius,
            end_radius,
            turns,
            start_angle,
            sweep: match direction {
                Direction::Counterclockwise => whole,
                Direction::Clockwise => -whole,
            },
            deviation: 0.0,
        })
    }

    /// An arc of a radius: its shorter part if `radius` > 0, its longer if `radius` < 0.
    pub(crate) fn with_radius(
        plane: Plane,
        from: Point,
        to: Point,
        radius: f64,
        direction: Direction,
        turns: u32,
    ) -> Result<Arc, Fault> {
        let [first, second, _] = plane.axes();
        let chord = [to[first] - from[first], to[second] - from[second]];
        let length = libm::hypot(chord[0], chord[1]);
        if length < SAME_POINT {
            return Err(Fault::ArcRadiusSamePoint);
        }
        let half = length / 2.0;
        let size = radius.abs();
        if half - size > RADIUS_TOLERANCE.max(RADIUS_RATIO * size) {
            return Err(Fault::ArcTooFar { radius, length });
        }
        let height = ((size - half) * (size + half)).max(0.0).sqrt();
        // The centre lies left of the chord for a short counterclockwise arc.
        let left = (direction == Direction::Counterclockwise) == (radius > 0.0);
        let side = if left { height } else { -height } / length;
        let center = [
            from[first] + chord[0] / 2.0 - chord[1] * side,
            from[second] + chord[1] / 2.0 + chord[0] * side,
        ];
        Arc::about(plane, from, to, center, direction, turns)
    }

    /// The sense of the arc.
    pub fn direction(&self) -> Direction {
        if self.sweep < 0.0 {
            Direction::Clockwise
        } else {
            Direction::Counterclockwise
        }
    }

    /// The point at a fraction of the sweep, from 0 to 1. Exact at both ends.
    pub fn at(&self, fraction: f64) -> Point {
        if fraction <= 0.0 {
            return self.from;
        }
        if fraction >= 1.0 {
            return self.to;
        }
        let mut point = self.from;
        for (value, end) in point.0.iter_mut().zip(self.to.0) {
            *value += (end - *value) * fraction;
        }
        let [first, second, _] = self.plane.axes();
        let angle = self.start_angle + self.sweep * fraction;
        let radius = self.radius(fraction);
        point[first] = self.center[0] + radius * libm::cos(angle);
        point[second] = self.center[1] + radius * libm::sin(angle);
        point
    }

    /// Least and greatest value that an axis takes on the whole arc.
    pub fn extent(&self, axis: AxisLetter) -> (f64, f64) {
        let (from, to) = (self.from[axis], self.to[axis]);
        let (mut least, mut greatest) = (from.min(to), from.max(to));
        let [first, second, _] = self.plane.axes();
        // Angle at which the axis is greatest on a circle.
        let crest = if axis == first {
            0.0
        } else if axis == second {
            PI / 2.0
        } else {
            return (least, greatest);
        };
        // Extremes lie a half turn apart, one near each `crest + k·π`. The radius is monotone, so
        // the outermost of them are in the first or the last turn.
        let (begin, end) = (self.start_angle, self.start_angle + self.sweep);
        let (low, high) = (begin.min(end), begin.max(end));
        let (first_k, last_k) = (
            ((low - crest) / PI).ceil() - 1.0,
            ((high - crest) / PI).floor() + 1.0,
        );
        for (from_k, to_k) in [
            (first_k, last_k.min(first_k + 4.0)),
            (first_k.max(last_k - 4.0), last_k),
        ] {
            let mut k = from_k;
            while k <= to_k {
                let angle = self.turning_angle(crest + k * PI);
                if angle > low && angle < high {
                    let fraction = (angle - begin) / self.sweep;
                    let offset = self.radius(fraction) * libm::cos(angle - crest);
                    let center = self.center[usize::from(axis == second)];
                    least = least.min(center + offset);
                    greatest = greatest.max(center + offset);
                }
                k += 1.0;
            }
        }
        (least, greatest)
    }

    fn radius(&self, fraction: f64) -> f64 {
        self.start_radius + (self.end_radius - self.start_radius) * fraction
    }

    /// Where r(φ)·cos(φ − crest) turns, within a quarter turn of `near`: on a circle at `near`
    /// itself, on a spiral where r·tan(φ − near) = dr/dφ. That has one root, found by halving.
    fn turning_angle(&self, near: f64) -> f64 {
        let slope = (self.end_radius - self.start_radius) / self.sweep;
        if slope == 0.0 {
            return near;
        }
        let rising = |beside: f64| {
            let fraction = (near + beside - self.start_angle) / self.sweep;
            self.radius(fraction) * libm::sin(beside) > slope * libm::cos(beside)
        };
        let (mut low, mut high) = (-PI / 2.0, PI / 2.0);
        for _ in 0..64 {
            let middle = (low + high) / 2.0;
            if rising(middle) {
                high = middle;
            } else {
                low = middle;
            }
        }
        near + (low + high) / 2.0
    }
}
