//! Setpoint and tool against the programmed geometry.

use super::Observed;
use super::limits::Watch;
use super::record::Violation;
use super::summary::PathSummary;
use super::travel::Travel;
use crate::machine::{COORDINATES, Position};
use crate::program::ProgramMove;
use syncline_trajectory::path::Curve;

/// Angle of the tangent between two places from which the nearest one is searched, rad.
const SWEEP: f64 = 0.5;
/// Steps of Newton's method.
const STEPS: usize = 12;
/// Moves farther away than the ones before, in a row, after which nearer ones are not expected.
pub const AHEAD: u32 = 8;

/// How far setpoint and tool were from the program's moves so far.
#[derive(Debug, Default)]
pub(super) struct Deviation {
    /// Of the setpoint, mm.
    setpoint: f64,
    /// Of the actual position, mm.
    tool: f64,
    watch: Watch,
}

impl Deviation {
    /// Takes what is seen at one SYNC.
    pub(super) fn observe(
        &mut self,
        observed: &Observed,
        time: f64,
        violations: &mut Vec<Violation>,
    ) {
        let plan = &observed.row.plan;
        let Some(motion) = observed.tags.and(observed.moves.motion(plan.tag)) else {
            return;
        };
        let deviation = nearest(observed, &plan.position, 1e-9);
        let tool = nearest(observed, &observed.actual, 0.0);
        self.setpoint = self.setpoint.max(deviation);
        self.tool = self.tool.max(tool);
        (self.watch).look(violations, deviation, motion.tolerance, || Violation {
            what: "path_deviation".to_owned(),
            axis: None,
            time,
            line: observed.line,
            value: deviation,
            limit: motion.tolerance,
            unit: "mm",
        });
    }

    /// Ends a violation that goes on.
    pub(super) fn close(&mut self, violations: &mut Vec<Violation>) {
        self.watch.close(violations);
    }

    /// With how far the tool came, the path of the run.
    pub(super) fn path(&self, travel: &Travel) -> PathSummary {
        PathSummary {
            length_mm: travel.length_mm,
            turned_deg: travel.turned_deg,
            max_deviation_mm: self.setpoint,
            max_contour_error_mm: self.tool,
        }
    }
}

/// Distance of a point from the moves that it may be on, mm; at once where it is `good_enough`.
fn nearest(observed: &Observed, point: &Position, good_enough: f64) -> f64 {
    let Some(tags) = observed.tags else {
        return f64::INFINITY;
    };
    let (first, last) = (*tags.start(), *tags.end());
    let mut nearest = f64::INFINITY;
    let mut farther = 0;
    // Where this stretch passes into the next one it may be near to any move of that.
    for tag in (first..=last).rev().chain(last + 1..) {
        let Some(ProgramMove { curve, .. }) = observed.moves.motion(tag) else {
            if tag > last {
                break;
            }
            continue;
        };
        let away = distance(curve, point);
        // Counted among those only that are ahead.
        let nearer = away < nearest || tag <= last;
        farther = if nearer { 0 } else { farther + 1 };
        nearest = nearest.min(away);
        if nearest <= good_enough || farther > AHEAD {
            break;
        }
    }
    nearest
}

/// Distance of `point` from `curve`, mm; exact for points nearer than the curve's radius.
///
/// Independent of what the planner made of the curve: only its definition by length is used.
#[must_use]
pub fn distance(curve: &Curve<COORDINATES>, point: &Position) -> f64 {
    let length = curve.length();
    let bend = norm(&curve.at(0.0).d2, &Position::default()) * length;
    let places = 1 + (bend / SWEEP).ceil() as usize;
    let place = |index: usize| length * index as f64 / places as f64;
    let apart = |s: f64| norm(&curve.at(s).q, point);
    let nearest = (0..=places).map(|index| apart(place(index)));
    let nearest = nearest.fold(f64::INFINITY, f64::min);
    // A foot nearer than that lies within half a step of a place that is hardly further.
    let step = length / places as f64;
    (0..=places)
        .filter(|&index| apart(place(index)) <= nearest + step)
        .map(|index| descend(curve, point, place(index)))
        .fold(nearest, f64::min)
}

/// Distance at the foot of the perpendicular that is found from `s`, (q − p)·q′ = 0.
fn descend(curve: &Curve<COORDINATES>, point: &Position, mut s: f64) -> f64 {
    let length = curve.length();
    for _ in 0..STEPS {
        let at = curve.at(s);
        let (mut slope, mut change) = (0.0, 0.0);
        for (i, (q, p)) in at.q.iter().zip(point).enumerate() {
            slope += (q - p) * at.d1[i];
            change += at.d1[i] * at.d1[i] + (q - p) * at.d2[i];
        }
        let step = if change > 0.0 { slope / change } else { slope };
        let next = (s - step).clamp(0.0, length);
        let arrived = (next - s).abs() <= length * 1e-15;
        s = next;
        if arrived {
            break;
        }
    }
    norm(&curve.at(s).q, point)
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
