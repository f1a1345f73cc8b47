//! From outside of the limits back into them.

use crate::extremal::{VELOCITY_ROUNDING, fastest_change};
use crate::limits::Limits;
use crate::profile::{Exact, Segment, State};

/// A miss of a velocity limit, by the range of velocities, that is worth setting right.
const MISS: f64 = 2e-15;
/// What is taken from the hold, as a multiple of what it is to make up for and of the durations' rounding: enough
/// to be given back exactly.
const SPARE: f64 = 4.0;
/// The part of the last ramp behind the very short hold; there the acceleration of that hold is.
const LAST_PART: f64 = 0.25;

/// The segments that lead back into the limits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    pub(super) segments: [Segment; 6],
    pub(super) duration: f64,
    pub(super) displacement: f64,
}

/// Brings a start outside the limits, or bound to leave them, back into them: the acceleration at
/// full jerk, then the velocity to its limit at acceleration 0, as fast as the limits allow. The
/// state that is reached, with the displacement for its position.
pub(super) fn enter(start: State, limits: &Limits) -> (Entry, State) {
    let l = limits;
    let mut entry = Entry {
        segments: [Segment::default(); 6],
        duration: 0.0,
        displacement: 0.0,
    };
    let mut state = State { p: 0.0, ..start };
    let a_slack = VELOCITY_ROUNDING * (l.a_max - l.a_min);
    let mut ramp = |to: f64, jerk: f64| {
        let duration = (to - state.a) / jerk;
        entry.segments[0] = Segment { duration, jerk };
        state = State {
            a: to,
            ..state.after(duration, jerk)
        };
    };
    if start.a > l.a_max + a_slack {
        ramp(l.a_max, l.j_min);
    } else if start.a < l.a_min - a_slack {
        ramp(l.a_min, l.j_max);
    }
    // The velocity at which full jerk makes the acceleration zero.
    let stop = state.v - 0.5 * state.a * state.a / if state.a > 0.0 { l.j_min } else { l.j_max };
    let v_slack = VELOCITY_ROUNDING * (l.v_max - l.v_min);
    let limit = if stop > l.v_max + v_slack {
        Some(l.v_max)
    } else if stop < l.v_min - v_slack {
        Some(l.v_min)
    } else {
        None
    };
    if let Some(v) = limit {
        let change = fastest_change(state.v, state.a, v, 0.0, l);
        let segments = &mut entry.segments;
        for i in 0..3 {
            segments[1 + i] = Segment {
                duration: change.t[i],
                jerk: change.j[i],
            };
        }
        // From far outside, the rounding of the durations is more than the limit is to be met by:
        // what the hold, or both ramps, are a little short of, a very short hold in the last ramp makes
        // up for.
        let miss = v - exact_velocity(start, segments);
        let [up, hold, down] = change.t;
        let held = state.a + up * change.j[0];
        let short = SPARE * (miss / held).abs() + SPARE * f64::EPSILON * up.max(hold).max(down);
        let last = down * LAST_PART;
        // Of both ramps no more can be taken than there is of either. Where rounding decides that the last ramp is all
        // that is left, there is none: what that misses, it misses by the rounding of the velocity at the start.
        let room = if hold > 0.0 {
            hold.max(up)
        } else {
            up.min((down - last) * (change.j[2] / change.j[0]).abs())
        };
        if miss.abs() > MISS * (l.v_max - l.v_min) && room > short {
            if hold > 0.0 {
                segments[2].duration = (hold - short).max(0.0);
            } else {
                segments[1].duration -= short;
                segments[3].duration += short * change.j[0] / change.j[2];
            }
            segments[3].duration -= last;
            segments[5] = Segment {
                duration: last,
                jerk: change.j[2],
            };
            let miss = v - exact_velocity(start, segments);
            segments[4].duration = (miss / (-last * change.j[2])).max(0.0);
        }
        for segment in &segments[1..] {
            state = state.after(segment.duration, segment.jerk);
        }
        state = State {
            p: state.p,
            v,
            a: 0.0,
        };
    }
    entry.duration = entry.segments.iter().map(|s| s.duration).sum();
    entry.displacement = state.p;
    (entry, state)
}

pub(super) fn exact_velocity(start: State, segments: &[Segment]) -> f64 {
    let state = Exact::leaving(start);
    let end = segments
        .iter()
        .fold(state, |state, s| state.after(s.duration, s.jerk));
    end.v.value()
}
