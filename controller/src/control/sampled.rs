//! Motion that others have planned: behind the end of the job's program the axes go along samples.
//!
//! Like a thread that is no part of the planned path, and nothing of it can be planned anew: an operator can only stop it.
//! What stops the machine brings the axes to rest from wherever they are as soon as their limits allow. The samples are
//! what they are: no shaper changes them, and the guard of the setpoints refuses those that no motion inside an axis'
//! limits can have.

use super::Controller;
use std::sync::Arc;
use syncline_trajectory::path::Setpoint;
use syncline_trajectory::sampled::Sampled;

/// Coordinates of the tool's path.
const TOOL: usize = 3;

/// Samples behind the end of the program.
#[derive(Clone, Debug, Default)]
pub(super) struct AlongSamples<const N: usize> {
    motion: Option<Arc<Sampled<N>>>,
    /// The cycle in which the axes were at the first sample.
    begun: Option<u64>,
    /// They have been at the last one.
    over: bool,
    /// Length of the path along them, mm, once they are over.
    length: f64,
}

impl<const N: usize> AlongSamples<N> {
    /// A state of the path that goes on behind them.
    pub(super) fn behind(&self, planned: Setpoint<N>) -> Setpoint<N> {
        let distance = planned.distance + self.length;
        Setpoint {
            distance,
            ..planned
        }
    }

    /// Whether the axes are on their way along the samples.
    pub(super) fn is_active(&self) -> bool {
        self.begun.is_some() && !self.over
    }

    /// Whether what drives are sent is what the samples ask for: on the way, and where they end, from which on the axes rest.
    pub(super) fn leads(&self) -> bool {
        self.begun.is_some() && self.motion.is_some()
    }

    /// Ends it where it is, for good.
    pub(super) fn abort(&mut self) {
        self.over = true;
        self.motion = None;
    }

    /// How many cycles ago the axes were at the first sample, in a cycle.
    pub(super) fn since(&self, cycle: u64) -> Option<u64> {
        Some(cycle - self.begun?)
    }
}

fn norm(rates: &[f64]) -> f64 {
    rates.iter().map(|rate| rate * rate).sum::<f64>().sqrt()
}

/// Of the tool where that moves, otherwise of all axes.
fn path_norm<const N: usize>(rates: &[f64; N]) -> f64 {
    let tool = norm(&rates[..N.min(TOOL)]);
    if tool > 0.0 { tool } else { norm(rates) }
}

impl<const N: usize> Controller<N> {
    /// Behind the end of the job's program, which has to end where the first of them is, the axes go along samples.
    pub fn go_along(&mut self, motion: Arc<Sampled<N>>) {
        self.along_samples = AlongSamples {
            motion: Some(motion),
            ..AlongSamples::default()
        };
    }

    /// Begins with the samples that there are behind the end of the program; whether there are some.
    pub(super) fn begin_samples(&mut self) -> bool {
        let samples = &mut self.along_samples;
        let begins = samples.motion.is_some() && samples.begun.is_none();
        if begins {
            samples.begun = Some(self.cycle);
            self.planned.distance = 0.0;
        }
        begins
    }

    /// The setpoint of a SYNC that is so many cycles ahead, if the axes go along samples.
    pub(super) fn follow_samples(&mut self, ahead: f64) -> Option<Setpoint<N>> {
        let samples = &self.along_samples;
        let since = samples.since(self.cycle).filter(|_| samples.is_active())?;
        let motion = samples.motion.as_ref()?;
        let time = (since as f64 + ahead) * self.layout.cycle.as_secs_f64();
        let rest = self.executor.setpoint();
        let mut next = Setpoint { busy: true, ..rest };
        for axis in 0..N {
            if let Some((state, jerk)) = motion.at(axis, time) {
                next.position[axis] = state.p;
                next.velocity[axis] = state.v;
                next.acceleration[axis] = state.a;
                next.jerk[axis] = jerk;
            }
        }
        let displacement =
            std::array::from_fn(|axis| next.position[axis] - self.planned.position[axis]);
        next.distance = self.planned.distance + path_norm::<N>(&displacement);
        if !motion.rests(time) {
            next.speed = path_norm(&next.velocity);
        }
        next.feed = f64::INFINITY;
        Some(next)
    }

    /// Whether the axes have been at the last sample: the plan goes on from there.
    pub(super) fn end_samples(&mut self) -> bool {
        let samples = &self.along_samples;
        let (Some(since), Some(motion)) = (samples.since(self.cycle), &samples.motion) else {
            return false;
        };
        let is_over = since as f64 * self.layout.cycle.as_secs_f64() >= motion.duration();
        if is_over {
            let length = self.planned.distance;
            self.along_samples.over = true;
            self.rest_here();
            self.along_samples.length = length;
        }
        is_over
    }

    /// The axes come to rest from wherever they are along samples.
    pub(super) fn leave_samples(&mut self) {
        if self.along_samples.is_active() {
            let travel = self.travel();
            self.executor.stop_beside(&self.planned, &travel);
            self.shaping.bypass();
            self.along_samples.length = self.planned.distance;
        }
        self.along_samples.abort();
    }
}
