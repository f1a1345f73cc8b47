//! Curves in N axes, parametrised by path length, with exact derivatives up to the third.
//!
//! Path length is measured on the tool path: the first three axes (fewer if N < 3). The others
//! follow in proportion. A line that moves none of the first three, or next to nothing of them, is
//! measured over all axes.

use thiserror::Error;

/// Arc radii at start and end may differ by this much, mm …
pub const RADIUS_TOLERANCE: f64 = 0.005;
/// … or by this fraction of the radius, whichever is greater.
pub const RADIUS_TOLERANCE_RELATIVE: f64 = 1e-3;

/// After a Newton step this small for a parameter the next one is below rounding.
const CONVERGED: f64 = 1e-9;

/// The same as a part of a polynomial's part.
const CLOSE: f64 = 1e-5;

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

/// A circular arc or helix. Where start and end are not equally far from the centre (within the
/// tolerance), the radius changes in proportion to the angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc<const N: usize> {
    start: [f64; N],
    end: [f64; N],
    plane: (usize, usize),
    centre: (f64, f64),
    /// Angle of the start, rad.
    from: f64,
    /// Angle swept, rad, counterclockwise positive.
    sweep: f64,
    /// Radius at the start, and its change per radian swept (by magnitude).
    radius: f64,
    spiral: f64,
    /// Change of every axis outside the plane per radian swept (by magnitude); zero for the plane's.
    pitch: [f64; N],
    /// Sum of squares of the tool path's share of `pitch`.
    rise: f64,
    length: f64,
}

/// An [`Arc`] as a program states it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArcDefinition<const N: usize> {
    /// Where it begins.
    pub start: [f64; N],
    /// Where it ends; axes outside the plane make it a helix.
    pub end: [f64; N],
    /// The plane of the circle.
    pub plane: Plane,
    /// The centre in the plane's two axes.
    pub centre: (f64, f64),
    /// As seen against the plane's third axis: G2 is clockwise, G3 is not.
    pub clockwise: bool,
    /// Whole turns beyond the first passage of the end (P word minus one). An arc whose end is its
    /// start is a full circle.
    pub turns: u32,
}

impl<const N: usize> Arc<N> {
    /// The arc as a program states it.
    ///
    /// # Errors
    /// See [`CurveError`].
    pub fn new(definition: ArcDefinition<N>) -> Result<Self, CurveError> {
        let ArcDefinition {
            start,
            end,
            plane,
            centre,
            clockwise,
            turns,
        } = definition;
        let plane = plane.axes();
        if plane.0 >= N || plane.1 >= N {
            return Err(CurveError::NoSuchAxis);
        }
        if !start
            .iter()
            .chain(&end)
            .chain([&centre.0, &centre.1])
            .all(|x| x.is_finite())
        {
            return Err(CurveError::NotFinite);
        }
        let arm = |p: &[f64; N]| (p[plane.0] - centre.0, p[plane.1] - centre.1);
        let (sx, sy) = arm(&start);
        let (ex, ey) = arm(&end);
        let (radius, end_radius) = (libm::hypot(sx, sy), libm::hypot(ex, ey));
        if radius <= 0.0 || end_radius <= 0.0 {
            return Err(CurveError::NoRadius);
        }
        let allowed = RADIUS_TOLERANCE.max(RADIUS_TOLERANCE_RELATIVE * radius.max(end_radius));
        if (radius - end_radius).abs() > allowed {
            return Err(CurveError::RadiiDiffer {
                start: radius,
                end: end_radius,
                allowed,
            });
        }
        let from = libm::atan2(sy, sx);
        // Angle from start to end, in (0, 2π] in the sense of rotation. The cross product is
        // exactly zero for a full circle.
        let between = libm::atan2(sx * ey - sy * ex, sx * ex + sy * ey);
        let full = std::f64::consts::TAU;
        let mut swept = if clockwise { -between } else { between };
        if swept <= 0.0 {
            swept += full;
        }
        swept += full * f64::from(turns);
        let spiral = (end_radius - radius) / swept;
        let pitch: [f64; N] = std::array::from_fn(|i| {
            if i == plane.0 || i == plane.1 {
                0.0
            } else {
                (end[i] - start[i]) / swept
            }
        });
        let rise = pitch[..N.min(3)].iter().map(|p| p * p).sum();
        let mut arc = Arc {
            start,
            end,
            plane,
            centre,
            from,
            sweep: if clockwise { -swept } else { swept },
            radius,
            spiral,
            pitch,
            rise,
            length: 0.0,
        };
        arc.length = arc.length_to(swept);
        Ok(arc)
    }

    /// Path length per radian at the angle `t` ≥ 0 from the start.
    fn rate(&self, t: f64) -> f64 {
        let r = self.radius + self.spiral * t;
        (r * r + self.spiral * self.spiral + self.rise).sqrt()
    }

    /// Path length up to the angle `t`. The integrand is constant but for the radius tolerance,
    /// so four Gauss points leave nothing.
    fn length_to(&self, t: f64) -> f64 {
        if self.spiral == 0.0 {
            return t * self.rate(0.0);
        }
        GAUSS4
            .iter()
            .map(|&(x, w)| w * self.rate(t * x))
            .sum::<f64>()
            * t
    }

    fn angle(&self, s: f64) -> f64 {
        let mut t = self.sweep.abs() * (s / self.length);
        if self.spiral != 0.0 {
            for _ in 0..4 {
                let step = (self.length_to(t) - s) / self.rate(t);
                t -= step;
                if step.abs() < CONVERGED {
                    break;
                }
            }
        }
        t
    }

    fn at(&self, s: f64) -> Derivatives<N> {
        let t = self.angle(s);
        let turn = self.sweep.signum();
        let (sin, cos) = libm::sincos(self.from + turn * t);
        let r = self.radius + self.spiral * t;
        let k = self.spiral;
        // By the angle t: radial and tangential parts of the first three derivatives.
        let parts = [(r, 0.0), (k, r), (-r, 2.0 * k), (-3.0 * k, -r)];
        let plane = parts.map(|(radial, tangential)| {
            let along = tangential * turn;
            (radial * cos - along * sin, radial * sin + along * cos)
        });
        let mut by_angle = [[0.0; N]; 4];
        for (order, row) in by_angle.iter_mut().enumerate() {
            row[self.plane.0] = plane[order].0;
            row[self.plane.1] = plane[order].1;
        }
        by_angle[0][self.plane.0] += self.centre.0;
        by_angle[0][self.plane.1] += self.centre.1;
        for (i, pitch) in self.pitch.iter().enumerate() {
            if i != self.plane.0 && i != self.plane.1 {
                by_angle[0][i] = self.start[i] + pitch * t;
                by_angle[1][i] = *pitch;
            }
        }
        let [q, u1, u2, u3] = by_angle;
        // σ = ds/dt and its derivatives by t.
        let sigma = self.rate(t);
        let sigma1 = r * k / sigma;
        let sigma2 = (k * k - sigma1 * sigma1) / sigma;
        let mut out = by_length(q, &u1, &u2, &u3, sigma, sigma1, sigma2);
        if s <= 0.0 {
            out.q = self.start;
        } else if s >= self.length {
            out.q = self.end;
        }
        out
    }
}

impl<const N: usize> Arc<N> {
    /// See [`Curve::growth`]; the parameter is the angle.
    fn growth(&self, from: f64, to: f64) -> Growth<N> {
        let radius = |s: f64| self.radius + self.spiral * self.sweep.abs() * (s / self.length);
        // The radius of a spiral goes nearly with the path; its change is within the tolerance.
        let slack = 1e-3 * (self.spiral * self.sweep).abs();
        let (r0, r1) = (radius(from), radius(to));
        let (least, most) = (r0.min(r1) - slack, r0.max(r1) + slack);
        let k = self.spiral.abs();
        let flat = k * k + self.rise;
        const FACTORIAL: [f64; ORDERS] = [1.0, 1.0, 2.0, 6.0, 24.0, 120.0];
        let first = std::array::from_fn(|i| {
            if i == self.plane.0 || i == self.plane.1 {
                std::array::from_fn(|n| libm::hypot(most, (n + 1) as f64 * k) / FACTORIAL[n])
            } else {
                let mut even = [0.0; ORDERS];
                even[0] = self.pitch[i].abs();
                even
            }
        });
        growth(
            &first,
            least * least + flat,
            &[most * most + flat, 2.0 * most * k, k * k, 0.0, 0.0, 0.0],
        )
    }
}

/// A polynomial of degree five in a parameter from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Poly<const N: usize> {
    start: [f64; N],
    /// Coefficients of u, u² … u⁵.
    terms: [[f64; N]; 5],
    /// Parameters between which the path length is integrated: closer in the middle, where a
    /// sharp corner's rate dips.
    knots: [f64; PARTS + 1],
    /// Path length up to every knot.
    lengths: [f64; PARTS + 1],
}

/// Parts of a polynomial's parameter whose lengths are known.
const PARTS: usize = 8;

impl<const N: usize> Poly<N> {
    /// The curve that leaves `from` and reaches `to` with their tangents and curvatures. The
    /// parameter runs at `rate` at both ends and slows by `brake` per parameter towards the
    /// middle. `None` if it would stand still or turn back on the way.
    pub fn joining(
        from: &Derivatives<N>,
        to: &Derivatives<N>,
        rate: f64,
        brake: f64,
    ) -> Option<Self> {
        let mut terms = [[0.0; N]; 5];
        for i in 0..N {
            let (v, a) = (
                rate * from.d1[i],
                0.5 * (rate * rate * from.d2[i] - brake * from.d1[i]),
            );
            // What the end wants beyond that.
            let p = (to.q[i] - from.q[i]) - (v + a);
            let dv = rate * to.d1[i] - (v + 2.0 * a);
            let da = rate * rate * to.d2[i] + brake * to.d1[i] - 2.0 * a;
            terms[0][i] = v;
            terms[1][i] = a;
            terms[2][i] = 10.0 * p - 4.0 * dv + 0.5 * da;
            terms[3][i] = -15.0 * p + 7.0 * dv - da;
            terms[4][i] = 6.0 * p - 3.0 * dv + 0.5 * da;
        }
        Self::new(from.q, terms)
    }

    /// The curve with these coefficients of u, u² … u⁵. `None` if it would stand still or turn back
    /// on the way.
    pub(super) fn new(start: [f64; N], terms: [[f64; N]; 5]) -> Option<Self> {
        let mut poly = Poly {
            start,
            terms,
            knots: [0.0; PARTS + 1],
            lengths: [0.0; PARTS + 1],
        };
        // The rate is the root of a polynomial with a zero about so far from the middle in the
        // complex plane; parts shorter than their distance from it are integrated to rounding.
        let most = poly.rate(0.0).max(poly.rate(1.0));
        let dip = 0.5 * (poly.rate(0.5) / most).clamp(1e-3, 1.0);
        let scale = libm::asinh(0.5 / dip);
        let middle = PARTS / 2;
        for k in 0..=middle {
            let aside = if k == middle {
                0.5
            } else {
                dip * libm::sinh(scale * k as f64 / middle as f64)
            };
            poly.knots[middle + k] = 0.5 + aside;
            poly.knots[middle - k] = 0.5 - aside;
        }
        for k in 0..PARTS {
            let [from, to] = [poly.knots[k], poly.knots[k + 1]];
            let least = poly.rate(from).min(poly.rate(0.5 * (from + to)));
            if least.is_nan() || least < 1e-3 * most {
                return None;
            }
            poly.lengths[k + 1] = poly.lengths[k] + poly.length_between(from, to);
        }
        Some(poly)
    }

    /// The point at the parameter `u`.
    pub fn point(&self, u: f64) -> [f64; N] {
        std::array::from_fn(|i| {
            self.start[i] + u * self.terms.iter().rev().fold(0.0, |sum, c| sum * u + c[i])
        })
    }

    fn length(&self) -> f64 {
        self.lengths[PARTS]
    }

    /// The same curve with the parameter 1 − u.
    fn reversed(&self) -> Self {
        // Coefficients by powers of 1 − u, by dividing again and again (Horner's scheme).
        let mut terms = [[0.0; N]; 5];
        let mut start = self.start;
        for i in 0..N {
            let mut c = [0.0; 6];
            c[0] = self.start[i];
            for k in 0..5 {
                c[k + 1] = self.terms[k][i];
            }
            for k in 0..5 {
                for n in (k..5).rev() {
                    c[n] += c[n + 1];
                }
            }
            start[i] = c[0];
            for k in 0..5 {
                terms[k][i] = if k % 2 == 0 { -c[k + 1] } else { c[k + 1] };
            }
        }
        let whole = self.length();
        Poly {
            start,
            terms,
            knots: std::array::from_fn(|k| 1.0 - self.knots[PARTS - k]),
            lengths: std::array::from_fn(|k| whole - self.lengths[PARTS - k]),
        }
    }

    /// The derivative by the parameter.
    pub(super) fn first(&self, u: f64) -> [f64; N] {
        let mut d = [0.0; N];
        for k in (0..5).rev() {
            let by = (k + 1) as f64;
            for i in 0..N {
                d[i] = d[i] * u + by * self.terms[k][i];
            }
        }
        d
    }

    /// The second derivative by the parameter.
    pub(super) fn second(&self, u: f64) -> [f64; N] {
        let mut d = [0.0; N];
        for k in (1..5).rev() {
            let by = (k * (k + 1)) as f64;
            for i in 0..N {
                d[i] = d[i] * u + by * self.terms[k][i];
            }
        }
        d
    }

    /// The curve between two parameters.
    fn part(&self, from: f64, to: f64) -> Option<Self> {
        let mut terms = self.terms;
        for i in 0..N {
            // Taylor's shift.
            let mut c = [0.0; 6];
            c[0] = self.start[i];
            for k in 0..5 {
                c[k + 1] = self.terms[k][i];
            }
            for low in 0..5 {
                for k in (low..5).rev() {
                    c[k] += from * c[k + 1];
                }
            }
            let mut scale = 1.0;
            for k in 0..5 {
                scale *= to - from;
                terms[k][i] = scale * c[k + 1];
            }
        }
        Self::new(self.point(from), terms)
    }

    /// The tangent at a knot.
    fn tangent(&self, k: usize) -> [f64; N] {
        let u = self.knots[k];
        let rate = self.rate(u);
        self.first(u).map(|d| d / rate)
    }

    /// Path length per parameter.
    fn rate(&self, u: f64) -> f64 {
        let mut square = 0.0;
        for i in 0..N.min(3) {
            let mut first = 0.0;
            for k in (0..5).rev() {
                first = first * u + (k + 1) as f64 * self.terms[k][i];
            }
            square += first * first;
        }
        square.sqrt()
    }

    /// First and second derivative of the parameter by path length.
    fn pace(&self, u: f64) -> [f64; 2] {
        let (mut square, mut along) = (0.0, 0.0);
        for i in 0..N.min(3) {
            let (mut first, mut second) = (0.0, 0.0);
            for k in (0..5).rev() {
                second = second * u + first;
                first = first * u + (k + 1) as f64 * self.terms[k][i];
            }
            square += first * first;
            along += first * second;
        }
        [1.0 / square.sqrt(), -along / (square * square)]
    }

    fn length_between(&self, from: f64, to: f64) -> f64 {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        half * GAUSS8
            .iter()
            .map(|&(x, w)| w * (self.rate(middle - x * half) + self.rate(middle + x * half)))
            .sum::<f64>()
    }

    fn length_to(&self, u: f64) -> f64 {
        let part = (1..PARTS).find(|&k| u < self.knots[k]).unwrap_or(PARTS) - 1;
        self.lengths[part] + self.length_between(self.knots[part], u)
    }

    fn parameter(&self, s: f64) -> f64 {
        let part = (1..PARTS).find(|&k| s < self.lengths[k]).unwrap_or(PARTS) - 1;
        let [u0, u1] = [self.knots[part], self.knots[part + 1]];
        let (s0, length) = (
            self.lengths[part],
            self.lengths[part + 1] - self.lengths[part],
        );
        let x = (s - s0) / length;
        // Hermite's quintic of the parameter over the length, then Newton's method.
        let [[m0, n0], [m1, n1]] = [u0, u1].map(|u| {
            let [first, second] = self.pace(u);
            [first * length, 0.5 * second * length * length]
        });
        // What the end wants beyond the parabola from the start.
        let p = (u1 - u0) - m0 - n0;
        let (dm, dn) = (m1 - m0 - 2.0 * n0, n1 - n0);
        let (c3, c4, c5) = (
            10.0 * p - 4.0 * dm + dn,
            -15.0 * p + 7.0 * dm - 2.0 * dn,
            6.0 * p - 3.0 * dm + dn,
        );
        let mut u = u0 + x * (m0 + x * (n0 + x * (c3 + x * (c4 + x * c5))));
        for _ in 0..4 {
            let step = (s0 + self.length_between(u0, u) - s) / self.rate(u);
            u -= step;
            if step.abs() < CLOSE * (u1 - u0) {
                break;
            }
        }
        u
    }

    fn at(&self, u: f64) -> Derivatives<N> {
        let (u2, mut u3) = (self.second(u), [0.0; N]);
        for k in (2..5).rev() {
            let by = ((k - 1) * k * (k + 1)) as f64;
            for i in 0..N {
                u3[i] = u3[i] * u + by * self.terms[k][i];
            }
        }
        let u1 = self.first(u);
        let dot = |a: &[f64; N], b: &[f64; N]| (0..N.min(3)).map(|i| a[i] * b[i]).sum::<f64>();
        let sigma = dot(&u1, &u1).sqrt();
        let sigma1 = dot(&u1, &u2) / sigma;
        let sigma2 = (dot(&u2, &u2) + dot(&u1, &u3) - sigma1 * sigma1) / sigma;
        by_length(self.point(u), &u1, &u2, &u3, sigma, sigma1, sigma2)
    }

    /// See [`Curve::growth`]; between two parameters.
    fn growth(&self, u0: f64, u1: f64) -> Growth<N> {
        let (middle, half) = (0.5 * (u0 + u1), 0.5 * (u1 - u0) * (1.0 + 1e-9) + 1e-12);
        // Taylor's coefficients of the derivative by the parameter, about the middle.
        let mut taylor: [[f64; N]; 5] =
            std::array::from_fn(|k| self.terms[k].map(|c| (k + 1) as f64 * c));
        for low in 0..4 {
            for k in (low..4).rev() {
                for i in 0..N {
                    taylor[k][i] += middle * taylor[k + 1][i];
                }
            }
        }
        // The same of σ² = |q′|², a polynomial of degree eight.
        let mut square = [0.0; 9];
        for j in 0..5 {
            for k in 0..5 {
                square[j + k] += (0..N.min(3))
                    .map(|i| taylor[j][i] * taylor[k][i])
                    .sum::<f64>();
            }
        }
        let rest: f64 = square[1..]
            .iter()
            .rev()
            .fold(0.0, |sum, c| (sum + c.abs()) * half);
        growth(
            &std::array::from_fn(|i| spread(&taylor.map(|c| c[i]), half)),
            square[0] - rest,
            &spread(&square, half),
        )
    }
}

/// Bounds of a polynomial's first Taylor coefficients at any point no further than `half` from the
/// one about which it has the coefficients `taylor`.
fn spread(taylor: &[f64], half: f64) -> Jet {
    let mut powers = [0.0; 9];
    for (power, c) in powers.iter_mut().zip(taylor) {
        *power = c.abs();
    }
    // Taylor's shift by `half`, all terms of one sign.
    for low in 0..ORDERS {
        for k in (low..taylor.len() - 1).rev() {
            powers[k] += half * powers[k + 1];
        }
    }
    std::array::from_fn(|k| powers[k])
}

/// Derivatives that are bounded.
pub const ORDERS: usize = 6;
/// Upper bounds of the magnitudes of a function's Taylor coefficients, f⁽ᵏ⁾/k!, at every point of a
/// stretch.
type Jet = [f64; ORDERS];
/// Upper bounds of the magnitudes of the derivatives by path length, the first to the sixth, of
/// every axis.
pub type Growth<const N: usize> = [[f64; N]; ORDERS];

/// Bounds by path length from those of q′ by any parameter; `least` is the least of σ² there and
/// `square` bounds its coefficients. Cauchy's products of bounds bound the product's coefficients.
fn growth<const N: usize>(first: &[Jet; N], least: f64, square: &Jet) -> Growth<N> {
    if least.is_nan() || least <= 0.0 {
        return [[f64::INFINITY; N]; ORDERS];
    }
    // 1/σ = (σ²)^(−1/2): k f_k σ² = −Σ (j/2 + k − j) (σ²)_j f_(k−j).
    let mut slow = [0.0; ORDERS];
    slow[0] = 1.0 / least.sqrt();
    for k in 1..ORDERS {
        let sum: f64 = (1..=k)
            .map(|j| (k as f64 - 0.5 * j as f64) * square[j] * slow[k - j])
            .sum();
        slow[k] = sum / (k as f64 * least);
    }
    let product =
        |a: &Jet| -> Jet { std::array::from_fn(|k| (0..=k).map(|j| a[j] * slow[k - j]).sum()) };
    let mut out = [[0.0; N]; ORDERS];
    for i in (0..N).filter(|&i| first[i] != [0.0; ORDERS]) {
        // d/ds = 1/σ d/du; of every derivative one coefficient fewer is known.
        let mut jet = product(&first[i]);
        for order in 0..ORDERS {
            out[order][i] = jet[0];
            jet = product(&std::array::from_fn(|k| {
                if k + 1 < ORDERS {
                    (k + 1) as f64 * jet[k + 1]
                } else {
                    0.0
                }
            }));
        }
    }
    out
}

/// Derivatives by path length from those by any parameter u, with σ = ds/du, σ′, σ″.
fn by_length<const N: usize>(
    q: [f64; N],
    u1: &[f64; N],
    u2: &[f64; N],
    u3: &[f64; N],
    sigma: f64,
    sigma1: f64,
    sigma2: f64,
) -> Derivatives<N> {
    // u(s): u′ = 1/σ, u″ = −σ′/σ³, u‴ = (3σ′² − σσ″)/σ⁵
    let a = 1.0 / sigma;
    let b = -sigma1 * a * a * a;
    let c = (3.0 * sigma1 * sigma1 - sigma * sigma2) * a * a * a * a * a;
    Derivatives {
        q,
        d1: std::array::from_fn(|i| u1[i] * a),
        d2: std::array::from_fn(|i| u2[i] * a * a + u1[i] * b),
        d3: std::array::from_fn(|i| u3[i] * a * a * a + 3.0 * u2[i] * a * b + u1[i] * c),
    }
}

/// Gauss–Legendre nodes and weights on [0, 1].
const GAUSS4: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// Gauss–Legendre nodes on [0, 1] of [−1, 1], which is symmetric, and their weights.
const GAUSS8: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_3),
];

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

    /// Where the next part begins after `s` if the curve is cut into parts in which its
    /// derivatives change little: circles every `turn` rad or less, polynomials evenly in their
    /// parameter.
    pub fn next_cut(&self, s: f64, turn: f64) -> f64 {
        match self {
            Curve::Line(line) => line.length,
            Curve::Arc(arc) => {
                let parts = (arc.sweep.abs() / turn).ceil();
                let step = arc.length / parts;
                ((s / step + 1e-6).floor() + 1.0) * step
            }
            Curve::Poly(poly) => {
                // Gentle blends need few.
                let chords = (0..PARTS).map(|k| {
                    let [a, b] = [k, k + 1].map(|k| poly.tangent(k));
                    (0..N)
                        .map(|i| (b[i] - a[i]) * (b[i] - a[i]))
                        .sum::<f64>()
                        .sqrt()
                });
                let parts = match chords.sum::<f64>() {
                    bend if bend > 4.0 * turn => 8.0,
                    bend if bend > turn => 4.0,
                    _ => 2.0,
                };
                let next = (poly.parameter(s) * parts + 1e-6).floor() + 1.0;
                if next < parts {
                    poly.length_to(next / parts)
                } else {
                    poly.length()
                }
            }
        }
    }

    /// The first point.
    pub fn start(&self) -> [f64; N] {
        match self {
            Curve::Line(line) => line.start,
            Curve::Arc(arc) => arc.start,
            Curve::Poly(poly) => poly.start,
        }
    }

    /// The last point.
    pub fn end(&self) -> [f64; N] {
        match self {
            Curve::Line(line) => line.end,
            Curve::Arc(arc) => arc.end,
            Curve::Poly(poly) => poly.point(1.0),
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
            Curve::Poly(poly) => poly.at(place.0),
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
            Curve::Poly(poly) => poly.growth(from.0, to.0),
        }
    }

    /// Upper bounds of the magnitudes of every axis's first, second and third derivative on the
    /// curve.
    pub fn derivative_bounds(&self) -> [[f64; N]; 3] {
        let mut most = [[0.0_f64; N]; 3];
        self.raise(0.0, self.length(), 8, &mut most);
        most
    }

    /// Raises `most` to what bounds the derivatives between `from` and `to`, from parts as short as
    /// a bound takes.
    fn raise(&self, from: f64, to: f64, halvings: usize, most: &mut [[f64; N]; 3]) {
        let bounds = self.growth(from, to);
        let coarse = matches!(self, Curve::Poly(_)) && halvings > 3;
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
                Curve::Poly(poly.part(from, to).unwrap_or(poly))
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
                let mut point = poly.start;
                for k in 1..=j {
                    share *= (j + 1 - k) as f64 / (6 - k) as f64;
                    for i in 0..N {
                        point[i] += share * poly.terms[k - 1][i];
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
                    let there = [poly.at(u).q, back.at(back.parameter(poly.length() - s)).q];
                    for (q, back) in there[0].iter().zip(there[1]) {
                        assert!((q - back).abs() <= 1e-12, "{turn}°, {s} mm: {there:?}");
                    }
                    let step = (u - last) / 100.0;
                    for n in 0..100 {
                        let from = last + step * f64::from(n);
                        length += poly.length_between(from, from + step);
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
