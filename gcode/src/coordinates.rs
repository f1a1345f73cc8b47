//! How the coordinates of a program lie in the machine.
//!
//! A point of the program is shifted by G92 or G52, turned in X and Y about the origin of the work offset
//! (G10 L2 R), and shifted by the work offset and the tool: the order of RS-274/NGC. [`WorkCoordinates`] say the
//! same as one turn and one shift behind it.

use super::axes::{AxisLetter, AxisSet, Point};

/// The greatest angle by which work is turned, either way, degrees.
pub(crate) const ROTATION_LIMIT: f64 = 360.0;

/// The coordinates that a program writes, in those of the machine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorkCoordinates {
    /// Where their origin is, machine coordinates, mm and degrees.
    pub origin: Point,
    /// By how much X and Y are turned about it, degrees, counterclockwise.
    pub rotation: f64,
}

impl WorkCoordinates {
    /// Machine coordinates of a point that is given in these.
    #[must_use]
    pub fn to_machine(&self, program: Point) -> Point {
        sum(self.turned(program), self.origin)
    }

    /// What a point of machine coordinates is in these.
    #[must_use]
    pub fn to_program(&self, machine: Point) -> Point {
        turned(less(machine, self.origin), -self.rotation)
    }

    /// A distance that is given in these, in machine coordinates.
    #[must_use]
    pub fn turned(&self, distance: Point) -> Point {
        turned(distance, self.rotation)
    }

    /// Where single coordinates in these lead from a place in the machine, machine coordinates: `None` for axes
    /// that do not move.
    #[must_use]
    pub fn place(&self, given: &[Option<f64>; 9], from: Point) -> [Option<f64>; 9] {
        let mut place = self.to_program(from);
        let mut words = AxisSet::default();
        for (axis, value) in AxisLetter::ALL.into_iter().zip(given) {
            if let Some(value) = value {
                place[axis] = *value;
                words.insert(axis);
            }
        }
        let place = self.to_machine(place);
        let moved = self.moved_by(words);
        AxisLetter::ALL.map(|axis| moved.contains(axis).then(|| place[axis]))
    }

    /// The axes of the machine that words of these axes move: X and Y together where they are turned.
    pub(crate) fn moved_by(&self, mut words: AxisSet) -> AxisSet {
        let plane = [AxisLetter::X, AxisLetter::Y];
        if self.rotation != 0.0 && plane.into_iter().any(|axis| words.contains(axis)) {
            plane.into_iter().for_each(|axis| words.insert(axis));
        }
        words
    }
}

/// A point turned in X and Y about the origin, counterclockwise; by 0 it stays as it is to the last bit.
fn turned(point: Point, degrees: f64) -> Point {
    let (sine, cosine) = libm::sincos(degrees.to_radians());
    let (x, y) = (point[AxisLetter::X], point[AxisLetter::Y]);
    let mut turned = point;
    turned[AxisLetter::X] = x * cosine - y * sine;
    turned[AxisLetter::Y] = x * sine + y * cosine;
    turned
}

pub(crate) fn sum(mut a: Point, b: Point) -> Point {
    a.0.iter_mut().zip(b.0).for_each(|(a, b)| *a += b);
    a
}

pub(crate) fn less(mut a: Point, b: Point) -> Point {
    a.0.iter_mut().zip(b.0).for_each(|(a, b)| *a -= b);
    a
}
