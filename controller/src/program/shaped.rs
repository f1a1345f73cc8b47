//! What an input shaper takes off the arcs of a program, as far as that is known before anything moves.

use super::feed::{programmed_speed, reached};
use crate::machine::COORDINATES;
use syncline_gcode::{Action, Arc};
use syncline_trajectory::path::{Curve, Limits};

/// Arcs that the shaper has the axes leave by more than their mode allows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CutArcs {
    /// How many.
    pub arcs: u64,
    /// The line of the one that is left furthest.
    pub line: u32,
    /// By how much that is, mm.
    pub off: f64,
    /// What its mode allows, mm.
    pub allowed: f64,
}

impl CutArcs {
    pub(super) fn add(&mut self, line: u32, off: f64, allowed: f64) {
        if off > allowed {
            if off > self.off {
                (self.line, self.off, self.allowed) = (line, off, allowed);
            }
            self.arcs += 1;
        }
    }
}

/// How far an arc is left, mm, with impulses of that variance, s²: κv²σ²/2, at its feed as far as the axes can.
pub(super) fn off_arc(
    (arc, action): (&Arc, &Action),
    curves: &[Curve<COORDINATES>],
    limits: &Limits<COORDINATES>,
    variance: f64,
) -> f64 {
    let length: f64 = curves.iter().map(Curve::length).sum();
    let (Some(curve), Some(feed)) = (curves.first(), super::feed::feed(action)) else {
        return 0.0;
    };
    let part = reached(curves, action, limits).unwrap_or(1.0);
    let speed = programmed_speed(curve, feed, length) * part;
    let radius = arc.start_radius.min(arc.end_radius);
    let [first, second, _] = arc
        .plane
        .axes()
        .map(|axis| limits.acceleration[axis.index()]);
    let towards_the_centre = (speed * speed / radius).min(first.min(second));
    towards_the_centre * variance / 2.0
}
