//! How far a point is from the programmed geometry.

use crate::program::{COORDINATES, Position};
use syncline_trajectory::path::Curve;

/// Places on a curve from which the nearest one is searched.
const STARTS: usize = 8;
/// Steps of Newton's method from each.
const STEPS: usize = 12;

/// Distance of `point` from `curve`, mm.
///
/// Independent of what the planner made of the curve: only its definition by length is used.
#[must_use]
pub fn distance(curve: &Curve<COORDINATES>, point: &Position) -> f64 {
    let length = curve.length();
    let mut nearest = f64::INFINITY;
    for start in 0..=STARTS {
        let mut s = length * start as f64 / STARTS as f64;
        for _ in 0..STEPS {
            let at = curve.at(s);
            nearest = nearest.min(norm(&at.q, point));
            // The foot of the perpendicular: (q − p)·q′ = 0.
            let (mut slope, mut curvature) = (0.0, 0.0);
            for (i, (q, p)) in at.q.iter().zip(point).enumerate() {
                let apart = q - p;
                slope += apart * at.d1[i];
                curvature += at.d1[i] * at.d1[i] + apart * at.d2[i];
            }
            let step = if curvature > 0.0 {
                slope / curvature
            } else {
                slope
            };
            let next = (s - step).clamp(0.0, length);
            if (next - s).abs() <= length * 1e-15 {
                break;
            }
            s = next;
        }
        nearest = nearest.min(norm(&curve.at(s).q, point));
        // A line has one foot only, and so has whatever lies this near.
        if matches!(curve, Curve::Line(_)) || nearest < 1e-9 {
            break;
        }
    }
    nearest
}

fn norm(a: &Position, b: &Position) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
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
