//! Axis letters, sets of them, and points over them.

use std::fmt;
use std::ops::{Index, IndexMut};

/// An axis by its program letter. X Y Z U V W are linear (mm), A B C rotary (degrees).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize)]
pub enum AxisLetter {
    /// Linear.
    X,
    /// Linear.
    Y,
    /// Linear.
    Z,
    /// Rotary about X.
    A,
    /// Rotary about Y.
    B,
    /// Rotary about Z.
    C,
    /// Linear, parallel to X.
    U,
    /// Linear, parallel to Y.
    V,
    /// Linear, parallel to Z.
    W,
}

impl AxisLetter {
    /// All axes in the order in which RS-274/NGC numbers them.
    pub const ALL: [AxisLetter; 9] = [
        AxisLetter::X,
        AxisLetter::Y,
        AxisLetter::Z,
        AxisLetter::A,
        AxisLetter::B,
        AxisLetter::C,
        AxisLetter::U,
        AxisLetter::V,
        AxisLetter::W,
    ];

    /// The axis's place in [`AxisLetter::ALL`].
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The upper-case program letter.
    pub const fn letter(self) -> char {
        self.name().as_bytes()[0] as char
    }

    /// The same as a text.
    pub const fn name(self) -> &'static str {
        match self {
            AxisLetter::X => "X",
            AxisLetter::Y => "Y",
            AxisLetter::Z => "Z",
            AxisLetter::A => "A",
            AxisLetter::B => "B",
            AxisLetter::C => "C",
            AxisLetter::U => "U",
            AxisLetter::V => "V",
            AxisLetter::W => "W",
        }
    }

    /// The axis of a letter in either case.
    pub fn from_letter(letter: char) -> Option<AxisLetter> {
        let letter = letter.to_ascii_uppercase();
        AxisLetter::ALL
            .into_iter()
            .find(|axis| axis.letter() == letter)
    }

    /// Whether the axis is measured in mm; otherwise in degrees.
    pub const fn is_linear(self) -> bool {
        !matches!(self, AxisLetter::A | AxisLetter::B | AxisLetter::C)
    }
}

impl AxisLetter {
    /// Units of its position, velocity, acceleration and jerk.
    pub const fn units(self) -> [&'static str; 4] {
        if self.is_linear() {
            ["mm", "mm/s", "mm/s²", "mm/s³"]
        } else {
            ["°", "°/s", "°/s²", "°/s³"]
        }
    }
}

impl fmt::Display for AxisLetter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.letter())
    }
}

/// The axes that a machine has.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct AxisSet(u16);

impl AxisSet {
    /// No axis.
    pub const NONE: AxisSet = AxisSet(0);
    /// X, Y and Z.
    pub const XYZ: AxisSet = AxisSet(0b111);

    /// Whether the set has the axis.
    pub const fn contains(self, axis: AxisLetter) -> bool {
        self.0 & (1 << axis.index()) != 0
    }

    /// Whether the set has the axis with that place in [`AxisLetter::ALL`].
    pub fn contains_index(self, index: usize) -> bool {
        (AxisLetter::ALL.get(index)).is_some_and(|&axis| self.contains(axis))
    }

    /// Adds an axis.
    pub fn insert(&mut self, axis: AxisLetter) {
        self.0 |= 1 << axis.index();
    }

    /// Takes an axis out.
    pub(crate) fn remove(&mut self, axis: AxisLetter) {
        self.0 &= !(1 << axis.index());
    }

    /// Whether there is no axis in the set.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The axes in the order of [`AxisLetter::ALL`].
    pub fn iter(self) -> impl Iterator<Item = AxisLetter> {
        AxisLetter::ALL
            .into_iter()
            .filter(move |axis| self.contains(*axis))
    }
}

impl FromIterator<AxisLetter> for AxisSet {
    fn from_iter<T: IntoIterator<Item = AxisLetter>>(axes: T) -> Self {
        let mut set = AxisSet::default();
        axes.into_iter().for_each(|axis| set.insert(axis));
        set
    }
}

impl fmt::Display for AxisSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut separator = "";
        for axis in self.iter() {
            write!(f, "{separator}{axis}")?;
            separator = " ";
        }
        Ok(())
    }
}

impl fmt::Debug for AxisSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "AxisSet({self})")
    }
}

/// The greatest coordinate that is taken for one, mm or degrees.
pub(crate) const COORDINATE_LIMIT: f64 = 1e9;

/// A position or an offset: one value per axis, mm or degrees. Axes that the machine does not have
/// stay at zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point(pub [f64; 9]);

impl Point {
    /// The origin.
    pub const ZERO: Point = Point([0.0; 9]);

    /// A point with X, Y and Z given.
    pub const fn xyz(x: f64, y: f64, z: f64) -> Point {
        Point([x, y, z, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    }
}

impl Index<AxisLetter> for Point {
    type Output = f64;

    fn index(&self, axis: AxisLetter) -> &f64 {
        &self.0[axis.index()]
    }
}

impl IndexMut<AxisLetter> for Point {
    fn index_mut(&mut self, axis: AxisLetter) -> &mut f64 {
        &mut self.0[axis.index()]
    }
}
