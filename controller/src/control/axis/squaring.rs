//! The sides of a gantry axis against each other: how far they are planned apart, and how that goes to zero.

use super::{AxisControl, DeviceNode, Fault};
use crate::machine::Square;
use syncline_trajectory::limits::Limits;
use syncline_trajectory::profile::{Profile, State};
use syncline_trajectory::state_to_state::{self, Problem};

/// The part of the axis' limits of acceleration and jerk with which its sides move against each other.
const GENTLE: f64 = 0.1;

/// So many increments the sides of a square axis may be counted apart, for rounding and noise. Of each side half an increment is
/// rounding, and one with friction rests where its loop leaves it, up to an increment or two beside its setpoint.
const COUNTED: f64 = 5.0;

/// A motion of an axis' sides against each other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Squaring {
    plan: Profile,
    /// The cycle in which it began …
    began: u64,
    /// … and how much later than its SYNC, s, as the motion before came to the plan's first state then.
    later: f64,
}

impl Squaring {
    /// How long it has been under way at SYNC `cycle`, s.
    fn since(&self, cycle: u64, period: f64) -> f64 {
        cycle.saturating_sub(self.began) as f64 * period - self.later
    }

    /// Goes on so many cycles later, from where it is.
    pub(super) fn wait(&mut self, cycles: u64) {
        self.began += cycles;
    }

    /// How far the sides are apart at SYNC `cycle`, mm.
    pub(super) fn apart(&self, cycle: u64, period: f64) -> f64 {
        self.plan.at(self.since(cycle, period)).p
    }
}

impl AxisControl {
    /// Whether its sides are planned further apart than they may be.
    pub(in super::super) fn askew(&self, cycle: u64) -> Option<f64> {
        let apart = self.apart(cycle);
        self.skewed(apart.abs()).then_some(apart)
    }

    /// How far its sides are planned apart, where that is taken out as it is enabled: no further than they may be.
    pub(in super::super) fn out_of_square(&self, cycle: u64, nodes: &[DeviceNode]) -> Option<f64> {
        let apart = self.apart(cycle);
        let told = self.is_out_of_square(apart, nodes) && !self.skewed(apart.abs());
        told.then_some(apart)
    }

    /// Whether sides that are so far apart, mm, are not where they belong, which is known.
    pub(super) fn is_out_of_square(&self, apart: f64, nodes: &[DeviceNode]) -> bool {
        let drives = self.spec.drives.iter();
        let resolution = drives.map(|&drive| nodes[drive].scaling().resolution());
        let least = COUNTED * resolution.fold(0.0, f64::max);
        self.referenced && self.tested && apart.abs() > least
    }

    /// Its sides stay as far apart as they are planned to rest now, and count from there.
    pub(in super::super) fn keep_apart(
        &mut self,
        cycle: u64,
        nodes: &mut [DeviceNode],
    ) -> Result<(), Fault> {
        self.seat(self.history.planned(cycle, 0.0).position, nodes)
    }

    fn square_limits(&self) -> Option<(Square, Limits)> {
        let square = self.spec.homing.square?;
        let limits = &self.spec.limits;
        let (acceleration, jerk) = (GENTLE * limits.acceleration, GENTLE * limits.jerk);
        Some((square, Limits::symmetric(square.speed, acceleration, jerk)))
    }

    /// From the setpoint that SYNC `cycle` latches on its sides move to where they belong, each by half
    /// of the way, and the middle between them stays. How far they are apart, mm.
    pub(in super::super) fn square(&mut self, cycle: u64) -> f64 {
        let apart = self.apart(cycle - 1);
        if let Some((_, limits)) = self.square_limits()
            && apart != 0.0
        {
            let (from, to) = (State::at_rest(apart), State::at_rest(0.0));
            let plan = state_to_state::plan(&Problem::new(from, to, limits), 0.0);
            self.squaring = plan.ok().map(|plan| Squaring {
                plan,
                began: cycle - 1,
                later: 0.0,
            });
        }
        apart
    }

    /// Its sides come to rest against each other.
    pub(in super::super) fn stop_squaring(&mut self, cycle: u64) {
        if let (Some(squaring), Some((_, limits))) = (&self.squaring, self.square_limits()) {
            let began = cycle - 1;
            let (now, later) = squaring.plan.sample(squaring.since(began, self.period));
            let stop = state_to_state::plan(&Problem::to_velocity(now, 0.0, limits), 0.0);
            self.squaring = stop.ok().map(|plan| Squaring { plan, began, later });
        }
    }

    /// Whether its sides move against each other at SYNC `cycle`.
    pub(in super::super) fn squares(&self, cycle: u64) -> bool {
        let under_way = |it: &Squaring| it.since(cycle, self.period) < it.plan.duration();
        self.squaring.as_ref().is_some_and(under_way)
    }

    /// How far its sides are planned apart at SYNC `cycle`, one of the newest.
    pub(super) fn apart(&self, cycle: u64) -> f64 {
        self.history.planned(cycle, 0.0).apart
    }
}
