//! Circular and helical arcs in machine coordinates.

use std::f64::consts::{PI, TAU};

use super::axes::{Axis, Point};
use super::error::Fault;
use super::modal::Code;

/// Radii of start and end may differ by this, or by [`RADIUS_RATIO`] if that is more. mm.
pub const RADIUS_TOLERANCE: f64 = 0.005;
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
    pub const fn axes(self) -> [Axis; 3] {
        match self {
            Plane::Xy => [Axis::X, Axis::Y, Axis::Z],
            Plane::Zx => [Axis::Z, Axis::X, Axis::Y],
            Plane::Yz => [Axis::Y, Axis::Z, Axis::X],
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
/// distance from it and every other axis go linearly from their start to their end. With equal
/// radii it is a circle or a helix; a program whose radii differ by its rounding gives a spiral so
/// slight that both ends are met exactly.
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
}

impl Arc {
    /// An arc about a centre. `turns` ≥ 1 counts the last, possibly partial, turn. Start and end at
    /// one point make full circles.
    pub(crate) fn about(
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
        let end = [to[first] - center[0], to[second] - center[1]];
        let start_radius = libm::hypot(start[0], start[1]);
        let end_radius = libm::hypot(end[0], end[1]);
        if start_radius < SAME_POINT {
            return Err(Fault::ArcNoRadius);
        }
        let difference = (end_radius - start_radius).abs();
        let allowed = RADIUS_TOLERANCE.max(RADIUS_RATIO * start_radius);
        if difference > allowed {
            return Err(Fault::ArcRadii {
                start: start_radius,
                end: end_radius,
                difference,
                allowed,
            });
        }
        let start_angle = libm::atan2(start[1], start[0]);
        // The angle between the two rays, by cross and dot product: exact for equal points.
        let between = libm::atan2(
            start[0] * end[1] - start[1] * end[0],
            start[0] * end[0] + start[1] * end[1],
        );
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
    pub fn extent(&self, axis: Axis) -> (f64, f64) {
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
