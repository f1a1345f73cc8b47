//! How a shaper slows down the arcs of a program, as far as that is known before anything moves.

use super::feed::{feed, programmed_speed, reached};
use crate::machine::COORDINATES;
use syncline_gcode::{Action, Arc};
use syncline_trajectory::path::{Curve, Limits, PathControlMode};
use syncline_trajectory::shaper::{Method, Spread};

/// Whether moves under that mode are shaped by coordinates, where that method is chosen or none.
pub(super) fn is_by_coordinates(method: Option<Method>, mode: PathControlMode) -> bool {
    method.unwrap_or(mode.method()) == Method::Coordinates
}

/// The part of its speed, which is its feed as far as the axes can, that an arc has where a shaper may leave it by no more than
/// `spare` mm; `None` if that is all of it.
pub(super) fn slowed(
    (arc, action): (&Arc, &Action),
    curves: &[Curve<COORDINATES>],
    limits: &Limits<COORDINATES>,
    spread: &Spread,
    spare: f64,
) -> Option<f64> {
    let length: f64 = curves.iter().map(Curve::length).sum();
    let (curve, feed) = (curves.first()?, feed(action)?);
    let part = reached(curves, action, limits).unwrap_or(1.0);
    let axes = arc.plane.axes().map(|axis| axis.index());
    let towards_the_centre = limits.acceleration[axes[0]].min(limits.acceleration[axes[1]]);
    let radius = arc.start_radius.min(arc.end_radius);
    let speed =
        (part * programmed_speed(curve, feed, length)).min((towards_the_centre * radius).sqrt());
    let curvature = curves.iter().map(Curve::most_curvature);
    let part = spread.speed(curvature.fold(0.0, f64::max), spare) / speed;
    (part < 1.0).then_some(part)
}
