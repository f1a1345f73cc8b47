//! A course as phases with their jerks, one after another.

use crate::extremal::{Change, Phases};
use crate::limits::Limits;
use crate::profile::State;

/// Phases with their jerks; `cruise` where the acceleration is to be zero.
#[derive(Clone, Copy, Default)]
pub(super) struct Step {
    pub(super) duration: f64,
    pub(super) jerk: f64,
    pub(super) cruise: bool,
}

pub(super) struct Steps {
    pub(super) steps: [Step; 15],
    pub(super) len: usize,
}

impl Steps {
    pub(super) fn iter(&self) -> impl Iterator<Item = &Step> {
        self.steps[..self.len].iter()
    }

    /// Returns `true`, to go on.
    pub(super) fn push(&mut self, duration: f64, jerk: f64, cruise: bool) -> bool {
        if duration > 0.0 {
            self.steps[self.len] = Step {
                duration,
                jerk,
                cruise,
            };
            self.len += 1;
        }
        true
    }

    pub(super) fn extremal(phases: &Phases, limits: &Limits) -> Self {
        let mut steps = Steps {
            steps: [Step::default(); 15],
            len: 0,
        };
        for (i, (duration, jerk)) in phases.t.into_iter().zip(phases.jerks(limits)).enumerate() {
            steps.push(duration, jerk, i == 3);
        }
        steps
    }

    pub(super) fn via(first: &Phases, hold: f64, second: &Phases, limits: &Limits) -> Self {
        let mut steps = Self::extremal(first, limits);
        for step in &mut steps.steps {
            step.cruise = false;
        }
        steps.push(hold, 0.0, true);
        for (duration, jerk) in second.t.into_iter().zip(second.jerks(limits)) {
            steps.push(duration, jerk, false);
        }
        steps
    }

    pub(super) fn cruise(into: &Change, cruise: f64, out: &Change) -> Self {
        let mut steps = Steps {
            steps: [Step::default(); 15],
            len: 0,
        };
        for (duration, jerk) in into.t.into_iter().zip(into.j) {
            steps.push(duration, jerk, false);
        }
        steps.push(cruise, 0.0, true);
        for (duration, jerk) in out.t.into_iter().zip(out.j) {
            steps.push(duration, jerk, false);
        }
        steps
    }

    pub(super) fn between(up: &Phases, down: &Phases, mix: f64, limits: &Limits) -> Self {
        let mut steps = Steps {
            steps: [Step::default(); 15],
            len: 0,
        };
        let (up_jerks, down_jerks) = (up.jerks(limits), down.jerks(limits));
        let jerk = |i: usize, k: usize| {
            let (x, y) = (up_jerks[i], down_jerks[k]);
            0.5 * ((x + y) + mix * (x - y))
        };
        let sum = |t: &[f64]| t.iter().sum::<f64>();
        let before = sum(&up.t[..3]).max(sum(&down.t[..3]));
        let after = sum(&up.t[4..]).max(sum(&down.t[4..]));
        let cruise = up.duration() - before - after;
        let whole = up.t[3] > 0.0 && down.t[3] > 0.0 && cruise > 0.0;
        if !whole {
            merge(&up.t, &down.t, |i, k, duration| {
                steps.push(duration, jerk(i, k), false)
            });
            return steps;
        }
        // Durations beside a long cruise keep their digits: up to it from the start, after it from
        // the end.
        merge(&up.t, &down.t, |i, k, duration| {
            if i < 3 || k < 3 {
                steps.push(duration, jerk(i, k), false);
            }
            i < 3 || k < 3
        });
        steps.push(cruise, 0.0, true);
        let first = steps.len;
        let reverse = |t: &[f64; 7]| {
            let mut t = *t;
            t.reverse();
            t
        };
        merge(&reverse(&up.t), &reverse(&down.t), |i, k, duration| {
            if i < 3 || k < 3 {
                steps.push(duration, jerk(6 - i, 6 - k), false);
            }
            i < 3 || k < 3
        });
        steps.steps[first..steps.len].reverse();
        steps
    }

    pub(super) fn displacement(&self, v0: f64, a0: f64) -> f64 {
        let mut state = State {
            p: 0.0,
            v: v0,
            a: a0,
        };
        for step in self.iter() {
            if step.cruise {
                state.a = 0.0;
            }
            state = state.after(step.duration, step.jerk);
        }
        state.p
    }
}

/// Hands on each stretch in which neither of two sequences changes: both indices and the duration,
/// until one of them ends or `take` returns `false`.
pub(super) fn merge(a: &[f64; 7], b: &[f64; 7], mut take: impl FnMut(usize, usize, f64) -> bool) {
    let mut elapsed = 0.0;
    let (mut i, mut k) = (0, 0);
    let (mut rest_a, mut rest_b) = (a[0], b[0]);
    while i < 7 && k < 7 {
        let duration = rest_a.min(rest_b);
        if !take(i, k, duration) {
            break;
        }
        rest_a -= duration;
        rest_b -= duration;
        elapsed += duration;
        let together = 4.0 * f64::EPSILON * elapsed;
        if rest_a <= together {
            i += 1;
            rest_a = if i < 7 { a[i] } else { 0.0 };
        }
        if rest_b <= together {
            k += 1;
            rest_b = if k < 7 { b[k] } else { 0.0 };
        }
    }
}
