//! The reference planner, rsruckig, behind the types of this project.

use crate::cases::Case;
use rsruckig::prelude::*;
use syncline_trajectory::profile::{Profile as Own, Segment};

/// A reference planner for `N` axes.
pub struct Peer<const N: usize> {
    planner: Ruckig<N, ThrowErrorHandler>,
    /// The last plan.
    pub trajectory: Trajectory<N>,
}

impl<const N: usize> Default for Peer<N> {
    fn default() -> Self {
        Peer {
            planner: Ruckig::new(None, 0.001),
            trajectory: Trajectory::new(None),
        }
    }
}

/// A problem in the reference's own form. It knows one jerk limit for both directions.
pub fn input<const N: usize>(cases: &[Case; N]) -> InputParameter<N> {
    let mut input = InputParameter::new(None);
    let mut v_min = DataArrayOrVec::new(None, 0.0);
    let mut a_min = DataArrayOrVec::new(None, 0.0);
    for (i, case) in cases.iter().enumerate() {
        input.current_position[i] = case.start.p;
        input.current_velocity[i] = case.start.v;
        input.current_acceleration[i] = case.start.a;
        input.target_position[i] = case.target.p;
        input.target_velocity[i] = case.target.v;
        input.target_acceleration[i] = case.target.a;
        input.max_velocity[i] = case.limits.v_max;
        input.max_acceleration[i] = case.limits.a_max;
        input.max_jerk[i] = case.limits.j_max;
        v_min[i] = case.limits.v_min;
        a_min[i] = case.limits.a_min;
    }
    input.min_velocity = Some(v_min);
    input.min_acceleration = Some(a_min);
    input
}

impl<const N: usize> Peer<N> {
    /// Plans; the duration, or `None` where the reference fails.
    pub fn plan(&mut self, input: &InputParameter<N>) -> Option<f64> {
        match self.planner.calculate(input, &mut self.trajectory) {
            Ok(RuckigResult::Working | RuckigResult::Finished) => {
                Some(self.trajectory.get_duration())
            }
            _ => None,
        }
    }

    /// The last plan of one axis as segments.
    pub fn profile(&self, axis: usize, case: &Case) -> Option<Own> {
        let p = &self.trajectory.get_profiles()[0][axis];
        let mut own = Own::new(case.start);
        let phases = (p.brake.t.into_iter().zip(p.brake.j))
            .chain(p.t.into_iter().zip(p.j))
            .chain(p.accel.t.into_iter().zip(p.accel.j));
        for (duration, jerk) in phases {
            if duration.is_nan() || duration < 0.0 || !own.push(Segment { duration, jerk }) {
                return None;
            }
        }
        Some(own)
    }
}
