//! Jogs that operators order: how far and how fast an axis may go, and how long without a renewal.
//!
//! A continuous jog is *hold-to-run*: it goes on for as long as whoever began it says so again, and
//! ends by a stop inside the axis' limits [`HOLD_TO_RUN`] after the last time. So no source of commands that is
//! lost, with a key held or a button pressed, leaves an axis moving. Cycles count, which no source can
//! hold up; a renewal only prolongs what still goes on, so that one that comes late sets nothing in motion.

use super::{Controller, Event, Phase};
use syncline_canopen::time::Duration;
use syncline_trajectory::limits::{Limits, PositionLimits};
use syncline_trajectory::path::{Jog, JogError, Travel};

/// How long a continuous jog goes on from its order, or from its last renewal, until the axis begins to stop.
pub const HOLD_TO_RUN: Duration = Duration::from_millis(200);

impl<const N: usize> Controller<N> {
    /// What the axes may do off the path that can follow one, and how far each may go.
    pub(super) fn travel(&self) -> [Option<Travel>; N] {
        let mut travel = [None; N];
        let axes = self.layout.axes.iter().zip(&self.axes);
        for (axis, control) in axes.filter(|(axis, _)| !axis.point_to_point) {
            let limits = &axis.limits;
            let here = self.planned.position[axis.coordinate];
            let far = axis.homing.jog_distance;
            let (min, max) = match control.is_referenced() {
                true => limits.position,
                false => (here - far, here + far),
            };
            travel[axis.coordinate] = Some(Travel {
                limits: Limits::symmetric(limits.velocity, limits.acceleration, limits.jerk),
                bounds: PositionLimits { min, max },
            });
        }
        travel
    }

    /// Moves axes inside their soft limits.
    pub(super) fn jog(&mut self, jog: Jog<N>) -> Result<(), JogError> {
        if self.phase != Phase::Program {
            return Err(JogError::Moving);
        }
        let mut travel = self.travel();
        for (axis, control) in self.layout.axes.iter().zip(&self.axes) {
            if let Some(Travel { limits, .. }) = &mut travel[axis.coordinate] {
                limits.v_max = (axis.homing).fastest_jog(&axis.limits, control.is_referenced());
                limits.v_min = -limits.v_max;
            }
        }
        let beside_nothing = self.job.is_none() && !self.executor.is_off_path();
        if beside_nothing {
            // Without a job there is no path to leave: it is held where it ended.
            self.executor.feed_hold();
        }
        let taken = self.executor.jog(jog, &travel);
        if let (Ok(()), Some((axis, end, sign))) = (taken, towards(jog, &travel)) {
            self.jogs_towards[axis] = Some((end, sign));
        }
        match (taken, jog) {
            (Ok(()), Jog::Continuous { axis, .. }) => self.renew_jog(axis),
            (Err(_), _) if beside_nothing => self.rest_here(),
            _ => {}
        }
        taken
    }

    /// Lets a continuous jog go on, if there is one.
    pub(super) fn renew_jog(&mut self, axis: usize) {
        if self.executor.is_jogged_on(axis) {
            let cycles = HOLD_TO_RUN.as_nanos() / self.layout.cycle.as_nanos();
            self.jogs_until[axis] = self.cycle + cycles as u64;
        }
    }

    /// Tells of axes that a jog has taken to the end of their travel, where they go no further.
    pub(super) fn tell_travel_ends(&mut self) {
        for axis in 0..self.axes.len() {
            let at = self.axes[axis].coordinate();
            let Some((end, sign)) = self.jogs_towards[at] else {
                continue;
            };
            let there = self.executor.jogged_to(at);
            // One that stood there may be beyond, by its encoder's noise.
            if there.is_some_and(|there| (there - end) * sign >= 0.0) {
                let referenced = self.axes[axis].is_referenced();
                self.tell(Event::TravelEnds {
                    axis,
                    end,
                    referenced,
                });
            }
            if there.is_some() || !self.executor.is_jogged() {
                self.jogs_towards[at] = None;
            }
        }
    }

    /// Ends continuous jogs that nobody renewed in time. Those of a homing have bounds of their own.
    pub(super) fn end_lost_jogs(&mut self) {
        if self.homing.is_active() {
            return;
        }
        for axis in 0..self.axes.len() {
            let at = self.axes[axis].coordinate();
            if self.executor.is_jogged_on(at) && self.cycle >= self.jogs_until[at] {
                self.executor.end_jog(at);
                self.tell(Event::JogNotRenewed { axis });
            }
        }
    }
}

/// The axis that a jog moves by a distance, or on and on, where its travel ends in that direction, and which that is, 1 or -1.
fn towards<const N: usize>(jog: Jog<N>, travel: &[Option<Travel>; N]) -> Option<(usize, f64, f64)> {
    let (axis, by) = match jog {
        Jog::Continuous { axis, velocity } => (axis, velocity),
        Jog::Step { axis, distance, .. } => (axis, distance),
        Jog::To(_) | Jog::Line { .. } => return None,
    };
    let PositionLimits { min, max } = travel.get(axis).copied().flatten()?.bounds;
    Some(match by > 0.0 {
        true => (axis, max, 1.0),
        false => (axis, min, -1.0),
    })
}
