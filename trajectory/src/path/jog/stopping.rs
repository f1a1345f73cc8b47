//! From any motion to rest beside the path: all axes together, so that they leave the direction in which they moved
//! as little as may be.

use super::{Jogging, Travel, stays, stop};
use crate::profile::{Profile, State};
use crate::state_to_state::{self, Problem};

/// A plan lasts no longer than the lead's if by rounding it lasts longer by such a part.
const LONGER: f64 = 1e-9;

/// What the axis does that takes longest to stop.
#[derive(Clone, Copy)]
struct Lead {
    /// s
    duration: f64,
    /// From where it begins to where it rests, mm.
    distance: f64,
    /// With which it begins, mm/s.
    velocity: f64,
}

impl Travel {
    /// A stop that lasts as long as the lead's and goes as far as that does, in proportion to their velocities; the
    /// fastest where that cannot be.
    fn stop_along(&self, start: State, fastest: Profile, lead: Lead) -> Profile {
        let shortest = fastest.end().p - start.p;
        let along = lead.distance * start.v / lead.velocity;
        // Short of where it can stop it would have to come back.
        if !(along.is_finite() && along * shortest > 0.0 && along.abs() > shortest.abs()) {
            return fastest;
        }
        let to = (start.p + along).clamp(self.bounds.min, self.bounds.max);
        let problem = Problem::new(start, State::at_rest(to), self.limits);
        let plan = state_to_state::plan(&problem, lead.duration).ok();
        // Where no plan lasts just so long the next one may last far longer.
        let goes_straight = |plan: &Profile| {
            plan.duration() <= lead.duration * (1.0 + LONGER)
                && stays(plan, &self.limits, start.p.min(to), start.p.max(to))
        };
        plan.filter(goes_straight).unwrap_or(fastest)
    }
}

impl<const N: usize> Jogging<N> {
    /// From a motion to rest, nearly along its direction: the axis that takes longest leads, and the others come to rest
    /// with it, by ways in proportion. One that cannot stops as fast as it can. None leaves its travel, for the
    /// reason that the head of [`jog`](super) gives.
    pub(in crate::path) fn stopping(
        states: [State; N],
        period: f64,
        travel: &[Option<Travel>; N],
    ) -> Self {
        let mut axes = Jogging::new(states.map(|state| state.p), period, travel);
        let stops: [Option<Profile>; N] =
            std::array::from_fn(|i| axes.travel[i].and_then(|it| stop(states[i], it.limits)));
        let mut lead: Option<Lead> = None;
        for (state, stop) in states.iter().zip(&stops) {
            if let Some(stop) = stop
                && lead.is_none_or(|lead| stop.duration() > lead.duration)
            {
                lead = Some(Lead {
                    duration: stop.duration(),
                    distance: stop.end().p - state.p,
                    velocity: state.v,
                });
            }
        }
        for i in 0..N {
            if let (Some(travel), Some(stop), Some(lead)) = (axes.travel[i], stops[i], lead) {
                axes.motions[i].plan = travel.stop_along(states[i], stop, lead);
            }
        }
        axes
    }
}
