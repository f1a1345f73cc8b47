//! Arcs, helices and spirals.

use super::length::{GAUSS4, Growth, ORDERS, by_length, growth};
use super::{
    CONVERGED, CurveError, Derivatives, Plane, RADIUS_TOLERANCE, RADIUS_TOLERANCE_RELATIVE,
};

/// A circular arc or helix. Where start and end are not equally far from the centre (within the
/// tolerance), the radius changes in proportion to the angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arc<const N: usize> {
    pub(super) start: [f64; N],
    pub(super) end: [f64; N],
    pub(super) plane: (usize, usize),
    pub(super) centre: (f64, f64),
    /// Angle of the start, rad.
    pub(super) from: f64,
    /// Angle swept, rad, counterclockwise positive.
    pub(super) sweep: f64,
    /// Radius at the start, and its change per radian swept (by magnitude).
    pub(super) radius: f64,
    pub(super) spiral: f64,
    /// Change of every axis outside the plane per radian swept (by magnitude); zero for the plane's.
    pub(super) pitch: [f64; N],
    /// Sum of squares of the tool path's share of `pitch`.
    pub(super) rise: f64,
    pub(super) length: f64,
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

/// A circle in the plane of two axes, or a part of one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Circle {
    /// Indices of the axes: from the first towards the second is counterclockwise.
    pub plane: (usize, usize),
    /// In these axes, mm.
    pub centre: [f64; 2],
    /// mm
    pub radius: f64,
    /// Angle of its start, rad, from the first axis towards the second.
    pub from: f64,
    /// Angle swept, rad, counterclockwise positive.
    pub sweep: f64,
}

/// The radius of a spiral is taken to go with the path length, as it nearly does: by this part of its change it may be elsewhere,
/// which is little, as the whole change is within [`RADIUS_TOLERANCE_RELATIVE`](super::RADIUS_TOLERANCE_RELATIVE).
const SPIRAL_SLACK: f64 = 1e-3;

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

    /// The circle that it is all of, or a part; `None` of a helix or a spiral that goes further than `within` off one, mm or
    /// degrees.
    #[must_use]
    pub fn circle(&self, within: f64) -> Option<Circle> {
        let off = self.pitch.iter().chain([&self.spiral]);
        let is_flat = off.into_iter().all(|it| (it * self.sweep).abs() <= within);
        is_flat.then_some(Circle {
            plane: self.plane,
            centre: [self.centre.0, self.centre.1],
            radius: self.radius,
            from: self.from,
            sweep: self.sweep,
        })
    }

    /// Path length per radian at the angle `t` ≥ 0 from the start.
    pub(super) fn rate(&self, t: f64) -> f64 {
        let r = self.radius + self.spiral * t;
        (r * r + self.spiral * self.spiral + self.rise).sqrt()
    }

    /// Path length up to the angle `t`. The integrand is constant but for the radius tolerance,
    /// so four Gauss points leave nothing.
    pub(super) fn length_to(&self, t: f64) -> f64 {
        if self.spiral == 0.0 {
            return t * self.rate(0.0);
        }
        GAUSS4
            .iter()
            .map(|&(x, w)| w * self.rate(t * x))
            .sum::<f64>()
            * t
    }

    pub(super) fn angle(&self, s: f64) -> f64 {
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

    pub(super) fn at(&self, s: f64) -> Derivatives<N> {
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
    /// See [`Curve::most_curvature`].
    pub(super) fn most_curvature(&self) -> f64 {
        // What bounds either axis of the plane bounds both together: a point of it is a complex number.
        let [_, mut bounds, ..] = self.growth(0.0, self.length);
        bounds[self.plane.1] = 0.0;
        super::norm(&bounds)
    }

    /// See [`Curve::growth`]; the parameter is the angle.
    pub(super) fn growth(&self, from: f64, to: f64) -> Growth<N> {
        let radius = |s: f64| self.radius + self.spiral * self.sweep.abs() * (s / self.length);
        let slack = SPIRAL_SLACK * (self.spiral * self.sweep).abs();
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
