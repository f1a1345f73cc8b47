//! Curves in N axes, parametrised by path length, with exact derivatives up to the third.
//!
//! Path length is measured on the tool path: the first three axes (fewer if N < 3). The others
//! follow in proportion. A line that moves none of the first three, or next to nothing of them, is
//! measured over all axes.
//!
//! Lines, arcs with helices and spirals, and polynomials of the fifth degree, which blends and fitted segments are.
//! Each gives its position and first three derivatives by path length at any length in closed form; what is not
//! in closed form is the parameter of a given length, found by Newton's method, its integral by Gauss and
//! Legendre's quadrature.
//!
//! - `arc`: where the radii at start and end differ inside the tolerance the radius goes with the angle, so that both end
//!   points are met,
//! - `quintic`: polynomials by their parameter,
//! - `polynomial`: the same by their length, measured in parts that are closer where the rate dips,
//! - `spline`: polynomials by their control points, cut into parts that bend little,
//! - `length`: derivatives by length from those by any parameter, and upper bounds of the first six on a stretch, as
//!   the [certificate](super::certify) needs them: bounds of Taylor coefficients, of which Cauchy's product bounds those of
//!   products.

mod arc;
mod length;
mod polynomial;
mod quintic;
mod spline;

use thiserror::Error;

pub use arc::{Arc, ArcDefinition, Circle};
pub use length::{Growth, ORDERS};
pub use polynomial::Poly;
pub(in crate::path) use quintic::Quintic;

/// Arc radii at start and end may differ by this much, mm …
pub const RADIUS_TOLERANCE: f64 = 0.005;
/// … or by this fraction of the radius, whichever is greater.
pub const RADIUS_TOLERANCE_RELATIVE: f64 = 1e-3;

/// After a Newton step this small for a parameter the next one is below rounding.
const CONVERGED: f64 = 1e-9;

/// The same as a part of a polynomial's part.
const CLOSE: f64 = 1e-5;

/// A place that is by so much of a part, or less, before its end counts as at the end, so that rounding of lengths and parameters
/// makes no part that has nothing left.
const AT_ITS_END: f64 = 1e-6;
/// What bounds a curve's derivatives is taken from parts, each of them a half of one so often at most, …
const MOST_HALVINGS: usize = 8;
/// … and of a polynomial so that no more halvings are left.
const FINE_ENOUGH: usize = 3;

/// Position and its derivatives by path length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Derivatives<const N: usize> {
    /// Position, mm.
    pub q: [f64; N],
    /// First derivative (tangent), 1.
    pub d1: [f64; N],
    /// Second derivative (curvature), 1/mm.
    pub d2: [f64; N],
    /// Third derivative, 1/mm².
    pub d3: [f64; N],
}

/// The plane of an arc, by the two axes that span it: from the first towards the second is
/// counterclockwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Plane {
    /// G17
    Xy,
    /// G18
    Zx,
    /// G19
    Yz,
}

impl Plane {
    /// Indices of the two axes.
    pub fn axes(self) -> (usize, usize) {
        match self {
            Plane::Xy => (0, 1),
            Plane::Zx => (2, 0),
            Plane::Yz => (1, 2),
        }
    }
}

/// Why there is no such curve.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum CurveError {
    /// The curve has no length.
    #[error("the curve has no length")]
    NoLength,
    /// A coordinate is not finite.
    #[error("a coordinate is not a finite number")]
    NotFinite,
    /// The start or the end lies in the centre.
    #[error("the arc's radius is zero")]
    NoRadius,
    /// Start and end are not equally far from the centre.
    #[error(
        "the arc's radius is {start} mm at its start and {end} mm at its end; they may differ by {allowed} mm"
    )]
    RadiiDiffer {
        /// mm
        start: f64,
        /// mm
        end: f64,
        /// mm
        allowed: f64,
    },
    /// The parameter of a spline runs ahead of no path.
    #[error("the spline stands still or turns back on its way: move its control points apart")]
    StandsStill,
    /// The plane names an axis that the machine does not have.
    #[error("the arc's plane needs more axes than there are")]
    NoSuchAxis,
}

/// A straight line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line<const N: usize> {
    start: [f64; N],
    end: [f64; N],
    direction: [f64; N],
    length: f64,
}

impl<const N: usize> Line<N> {
    /// The line between two points.
    ///
    /// # Errors
    /// The points coincide, or a coordinate is not finite.
    pub fn new(start: [f64; N], end: [f64; N]) -> Result<Self, CurveError> {
        if !start.iter().chain(&end).all(|x| x.is_finite()) {
            return Err(CurveError::NotFinite);
        }
        let delta: [f64; N] = std::array::from_fn(|i| end[i] - start[i]);
        let length = path_norm(&delta);
        if length <= 0.0 || !length.is_finite() {
            return Err(CurveError::NoLength);
        }
        Ok(Line {
            start,
            end,
            direction: delta.map(|d| d / length),
            length,
        })
    }

    fn at(&self, s: f64) -> Derivatives<N> {
        // From the nearer end, so that both end points are met to the bit.
        let q = if s + s <= self.length {
            std::array::from_fn(|i| self.start[i] + self.direction[i] * s)
        } else {
            std::array::from_fn(|i| self.end[i] - self.direction[i] * (self.length - s))
        };
        Derivatives {
            q,
            d1: self.direction,
            d2: [0.0; N],
            d3: [0.0; N],
        }
    }
}

/// Path length of a straight displacement.
fn path_norm<const N: usize>(delta: &[f64; N]) -> f64 {
    let norm = |part: &[f64]| {
        let scale = part.iter().fold(0.0_f64, |m, d| m.max(d.abs()));
        if scale == 0.0 {
            return 0.0;
        }
        scale
            * part
                .iter()
                .map(|d| (d / scale) * (d / scale))
                .sum::<f64>()
                .sqrt()
    };
    let (tool, all) = (norm(&delta[..N.min(3)]), norm(delta));
    if tool > LED * all { tool } else { all }
}

/// Part of a displacement that has to be the tool's, so that the followers follow that.
const LED: f64 = 1e-4;

/// Any of the curves.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::large_enum_variant)] // it goes through the cycle's rings, whose slots are all of one size
pub enum Curve<const N: usize> {
    /// A straight line.
    Line(Line<N>),
    /// A circular arc or helix.
    Arc(Arc<N>),
    /// A polynomial, as blends are.
    Poly(Poly<N>),
}

/// A place on a curve: the path length, on polynomials the parameter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place(f64);

/// The length of a vector.
fn norm<const N: usize>(of: &[f64; N]) -> f64 {
    of.iter().map(|x| x * x).sum::<f64>().sqrt()
}

impl<const N: usize> Curve<N> {
    /// A straight line; see [`Line::new`].
    ///
    /// # Errors
    /// The points coincide, or a coordinate is not finite.
    pub fn line(start: [f64; N], end: [f64; N]) -> Result<Self, CurveError> {
        Line::new(start, end).map(Curve::Line)
    }

    /// A circular arc or helix; see [`Arc::new`].
    ///
    /// # Errors
    /// See [`CurveError`].
    pub fn arc(definition: ArcDefinition<N>) -> Result<Self, CurveError> {
        Arc::new(definition).map(Curve::Arc)
    }

    /// Path length, mm.
    pub fn length(&self) -> f64 {
        match self {
            Curve::Line(line) => line.length,
            Curve::Arc(arc) => arc.length,
            Curve::Poly(poly) => poly.length(),
        }
    }

    /// The tangent, if it is the same everywhere.
    pub fn direction(&self) -> Option<[f64; N]> {
        match self {
            Curve::Line(line) => Some(line.direction),
            Curve::Arc(_) | Curve::Poly(_) => None,
        }
    }

    /// Into how many parts the curve is cut so that its derivatives change little in each: circles every
    /// `turn` rad or less, polynomials evenly in their parameter.
    pub(super) fn parts(&self, turn: f64) -> f64 {
        match self {
            Curve::Line(_) => 1.0,
            Curve::Arc(arc) => (arc.sweep.abs() / turn).ceil(),
            Curve::Poly(poly) => {
                // Gentle blends need few.
                let chords = (0..poly.parts).map(|k| {
                    let [a, b] = [k, k + 1].map(|k| poly.tangent(k));
                    (0..N)
                        .map(|i| (b[i] - a[i]) * (b[i] - a[i]))
                        .sum::<f64>()
                        .sqrt()
                });
                match chords.sum::<f64>() {
                    bend if bend > 4.0 * turn => 8.0,
                    bend if bend > turn => 4.0,
                    _ => 2.0,
                }
            }
        }
    }

    /// How many of so many [`parts`](Self::parts) begin at the path length `s` or before.
    pub(super) fn parts_begun(&self, s: f64, parts: f64) -> f64 {
        let passed = match self {
            Curve::Line(_) => 0.0,
            Curve::Arc(arc) => s / (arc.length / parts),
            Curve::Poly(poly) => poly.parameter(s) * parts,
        };
        (passed + AT_ITS_END).floor() + 1.0
    }

    /// The path length at which the last of the first `k` of so many [`parts`](Self::parts) ends.
    pub(super) fn parts_end(&self, k: f64, parts: f64) -> f64 {
        match self {
            Curve::Arc(arc) => k * (arc.length / parts),
            Curve::Poly(poly) if k < parts => poly.length_to(k / parts),
            _ => self.length(),
        }
    }

    /// The first point.
    pub fn start(&self) -> [f64; N] {
        match self {
            Curve::Line(line) => line.start,
            Curve::Arc(arc) => arc.start,
            Curve::Poly(poly) => poly.quintic.start,
        }
    }

    /// The last point.
    pub fn end(&self) -> [f64; N] {
        match self {
            Curve::Line(line) => line.end,
            Curve::Arc(arc) => arc.end,
            Curve::Poly(poly) => poly.quintic.point(1.0),
        }
    }

    /// Position and derivatives at the path length `s` from the start, which is brought into
    /// [0, [`length`](Self::length)].
    pub fn at(&self, s: f64) -> Derivatives<N> {
        self.at_place(self.place(s))
    }

    /// The place at the path length `s`: what is found once for several questions about it.
    pub(super) fn place(&self, s: f64) -> Place {
        let s = s.clamp(0.0, self.length());
        Place(match self {
            Curve::Line(_) | Curve::Arc(_) => s,
            Curve::Poly(poly) => poly.parameter(s),
        })
    }

    /// As [`at`](Self::at).
    pub(super) fn at_place(&self, place: Place) -> Derivatives<N> {
        match self {
            Curve::Line(line) => line.at(place.0),
            Curve::Arc(arc) => arc.at(place.0),
            Curve::Poly(poly) => poly.quintic.at(place.0),
        }
    }

    /// Upper bounds of the magnitudes of every axis's derivatives by path length, the first to the
    /// sixth, between the path lengths `from` and `to`. They hold everywhere in between and come
    /// closer to the greatest values the shorter the stretch is.
    pub fn growth(&self, from: f64, to: f64) -> Growth<N> {
        self.growth_between(self.place(from), self.place(to))
    }

    /// As [`growth`](Self::growth).
    pub(super) fn growth_between(&self, from: Place, to: Place) -> Growth<N> {
        match self {
            Curve::Line(line) => {
                let mut out = [[0.0; N]; ORDERS];
                out[0] = line.direction.map(f64::abs);
                out
            }
            Curve::Arc(arc) => arc.growth(from.0, to.0),
            Curve::Poly(poly) => poly.quintic.growth(from.0, to.0),
        }
    }

    /// Upper bounds of the magnitudes of every axis's first, second and third derivative on the
    /// curve.
    pub fn derivative_bounds(&self) -> [[f64; N]; 3] {
        let mut most = [[0.0_f64; N]; 3];
        self.raise(0.0, self.length(), MOST_HALVINGS, &mut most);
        most
    }

    /// Raises `most` to what bounds the derivatives between `from` and `to`, from parts as short as
    /// a bound takes.
    fn raise(&self, from: f64, to: f64, halvings: usize, most: &mut [[f64; N]; 3]) {
        let bounds = self.growth(from, to);
        let coarse = matches!(self, Curve::Poly(_)) && halvings > FINE_ENOUGH;
        if halvings > 0 && (coarse || !bounds[2].iter().all(|b| b.is_finite())) {
            let middle = 0.5 * (from + to);
            self.raise(from, middle, halvings - 1, most);
            self.raise(middle, to, halvings - 1, most);
            return;
        }
        for (most, bounds) in most.iter_mut().zip(bounds) {
            for i in 0..N {
                most[i] = most[i].max(bounds[i]);
            }
        }
    }

    /// No less than the curvature anywhere on it, 1/mm, of all axes together.
    pub fn most_curvature(&self) -> f64 {
        match self {
            Curve::Line(_) => 0.0,
            Curve::Arc(arc) => arc.most_curvature(),
            Curve::Poly(_) => self.curvature_between(0.0, self.length(), MOST_HALVINGS),
        }
    }

    /// As [`most_curvature`](Self::most_curvature), from parts as short as a bound takes.
    fn curvature_between(&self, from: f64, to: f64, halvings: usize) -> f64 {
        let [_, bounds, ..] = self.growth(from, to);
        let most = norm(&bounds);
        if halvings == 0 || most.is_finite() && halvings <= FINE_ENOUGH {
            return most;
        }
        let middle = 0.5 * (from + to);
        let halves = [(from, middle), (middle, to)];
        let halves = halves.map(|(from, to)| self.curvature_between(from, to, halvings - 1));
        halves[0].max(halves[1])
    }

    /// The stretch of the curve from `from` to `to`, distances from its start.
    pub fn part(&self, from: f64, to: f64) -> Self {
        match *self {
            Curve::Line(line) => Curve::Line(Line {
                start: line.at(from).q,
                end: line.at(to).q,
                direction: line.direction,
                length: to - from,
            }),
            Curve::Arc(arc) => {
                let (a, b) = (arc.angle(from), arc.angle(to));
                let turn = arc.sweep.signum();
                Curve::Arc(Arc {
                    start: arc.at(from).q,
                    end: arc.at(to).q,
                    from: arc.from + turn * a,
                    sweep: turn * (b - a),
                    radius: arc.radius + arc.spiral * a,
                    length: to - from,
                    ..arc
                })
            }
            Curve::Poly(poly) => {
                let (from, to) = (poly.parameter(from), poly.parameter(to));
                Curve::Poly(poly.part(from, to))
            }
        }
    }

    /// The same curve from its end to its start.
    pub fn reversed(&self) -> Self {
        match *self {
            Curve::Line(line) => Curve::Line(Line {
                start: line.end,
                end: line.start,
                direction: line.direction.map(|d| -d),
                length: line.length,
            }),
            Curve::Arc(arc) => Curve::Arc(Arc {
                start: arc.end,
                end: arc.start,
                from: arc.from + arc.sweep,
                sweep: -arc.sweep,
                radius: arc.radius + arc.spiral * arc.sweep.abs(),
                spiral: -arc.spiral,
                pitch: arc.pitch.map(|p| -p),
                ..arc
            }),
            Curve::Poly(poly) => Curve::Poly(poly.reversed()),
        }
    }

    /// Distance of the tool path from `point`, looked for from the path length `near` on.
    pub fn distance_near(&self, point: &[f64; N], near: f64) -> f64 {
        let mut s = near;
        for _ in 0..5 {
            let at = self.at(s);
            let dot = |d: &[f64; N]| {
                (0..N.min(3))
                    .map(|i| (at.q[i] - point[i]) * d[i])
                    .sum::<f64>()
            };
            s = (s - dot(&at.d1) / (1.0 + dot(&at.d2)).max(0.5)).clamp(0.0, self.length());
        }
        super::blend::distance(&self.at(s).q, point)
    }

    /// A box that holds the curve, of lines and circles the smallest: lower and upper corner. Soft
    /// limits are checked on it.
    pub fn bounds(&self) -> ([f64; N], [f64; N]) {
        let (start, end) = (self.start(), self.end());
        let mut low: [f64; N] = std::array::from_fn(|i| start[i].min(end[i]));
        let mut high: [f64; N] = std::array::from_fn(|i| start[i].max(end[i]));
        if let Curve::Poly(poly) = self {
            // The hull of the control points of Bernstein's form.
            for j in 0..=5 {
                // C(j, k) / C(5, k)
                let mut share = 1.0;
                let mut point = poly.quintic.start;
                for k in 1..=j {
                    share *= (j + 1 - k) as f64 / (6 - k) as f64;
                    for i in 0..N {
                        point[i] += share * poly.quintic.terms[k - 1][i];
                    }
                }
                for i in 0..N {
                    low[i] = low[i].min(point[i]);
                    high[i] = high[i].max(point[i]);
                }
            }
        }
        if let Curve::Arc(arc) = self {
            // Extremes of a circle lie at whole quarter turns, those of a spiral a little off; the
            // larger radius covers them.
            let quarter = std::f64::consts::FRAC_PI_2;
            let (a, b) = (arc.from, arc.from + arc.sweep);
            let least = arc.radius.min(arc.radius + arc.spiral * arc.sweep.abs());
            let slack = libm::atan2(arc.spiral.abs(), least);
            let first = ((a.min(b) - slack) / quarter).ceil() as i64;
            let last = ((a.max(b) + slack) / quarter).floor() as i64;
            let radius = arc.radius.max(arc.radius + arc.spiral * arc.sweep.abs());
            for n in first..=last.min(first + 3) {
                let (axis, centre, sign) = match n.rem_euclid(4) {
                    0 => (arc.plane.0, arc.centre.0, 1.0),
                    1 => (arc.plane.1, arc.centre.1, 1.0),
                    2 => (arc.plane.0, arc.centre.0, -1.0),
                    _ => (arc.plane.1, arc.centre.1, -1.0),
                };
                let extreme = centre + sign * radius;
                low[axis] = low[axis].min(extreme);
                high[axis] = high[axis].max(extreme);
            }
        }
        (low, high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A corner's length, integrated over many more parts, agrees with the length that it is
    /// measured by, up to turns whose rate all but vanishes; the other way round it is the same.
    #[test]
    fn sharp_corners_are_measured_by_their_length() {
        for turn in [1.0_f64, 30.0, 90.0, 120.0, 150.0, 160.0, 165.9] {
            let (sin, cos) = libm::sincos(turn.to_radians());
            let before = Line::new([0.0, 0.0], [8.0, 0.0]).unwrap();
            let after = Line::new([8.0, 0.0], [8.0 + 8.0 * cos, 8.0 * sin]).unwrap();
            for (cut, rate, brake) in [(0.5, 3.0, 6.0), (4.0, 2.0, 0.0)] {
                let ends = [before.at(8.0 - cut), after.at(cut)];
                let [rate, brake] = [rate, brake].map(|x| x * cut);
                let poly = Poly::joining(&ends[0], &ends[1], rate, brake).unwrap();
                let back = poly.reversed();
                let (mut length, mut last) = (0.0, 0.0);
                for k in 1..=100 {
                    let s = poly.length() * f64::from(k) / 100.0;
                    let u = poly.parameter(s);
                    let there = [
                        poly.quintic.at(u).q,
                        back.quintic.at(back.parameter(poly.length() - s)).q,
                    ];
                    for (q, back) in there[0].iter().zip(there[1]) {
                        assert!((q - back).abs() <= 1e-12, "{turn}°, {s} mm: {there:?}");
                    }
                    let step = (u - last) / 100.0;
                    for n in 0..100 {
                        let from = last + step * f64::from(n);
                        length += poly.quintic.length_between(from, from + step);
                    }
                    last = u;
                    let off = (length - s).abs();
                    assert!(
                        off <= 1e-10 * poly.length(),
                        "{turn}°, {s} mm: {off} mm off"
                    );
                }
            }
        }
    }
}
