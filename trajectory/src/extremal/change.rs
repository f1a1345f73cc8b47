//! The fastest change of velocity and acceleration, wherever it leads.

use super::{Phases, VELOCITY_ROUNDING};
use crate::limits::Limits;
use crate::profile::{State, zeros};

/// The fastest change of velocity and acceleration, regardless of the position.
pub(crate) fn fastest_change(v0: f64, a0: f64, vf: f64, af: f64, limits: &Limits) -> Change {
    let base_down = af < a0;
    let ramp = 0.5 * (af - a0) * (af + a0)
        / if base_down {
            limits.j_min
        } else {
            limits.j_max
        };
    let to_gain = (vf - v0) - ramp;
    if to_gain.abs() <= VELOCITY_ROUNDING * (limits.v_max - limits.v_min) {
        let jerk = if base_down {
            limits.j_min
        } else {
            limits.j_max
        };
        return Change {
            t: [(af - a0) / jerk, 0.0, 0.0],
            j: [jerk, 0.0, -jerk],
        };
    }
    // Seen with the axis's direction such that more has to be gained.
    let s = 1.0_f64.copysign(to_gain);
    let (a0, af, to_gain) = (s * a0, s * af, s * to_gain);
    let (j_up, j_down, top) = if s > 0.0 {
        (limits.j_max, -limits.j_min, limits.a_max)
    } else {
        (-limits.j_min, limits.j_max, -limits.a_min)
    };
    let (m, n) = (1.0 / j_up, 1.0 / j_down);
    let Rise { up, hold, down, .. } = Rise::new([a0, af], 0.5 * (m + n), to_gain, top);
    Change {
        t: [up * m, hold, down * n],
        j: [s * j_up, 0.0, -s * j_down],
    }
}

/// A rise of the acceleration above both of its ends, which gains velocity.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rise {
    /// By how much the acceleration goes up.
    pub(super) up: f64,
    /// How long it stays, s.
    pub(super) hold: f64,
    /// By how much it goes down.
    pub(super) down: f64,
    /// The greatest.
    pub(super) peak: f64,
}

impl Rise {
    /// From one acceleration to another, at most to `top` on the way. `to_gain` is the velocity that is gained
    /// besides what a ramp from one to the other does, `k` half the sum of the inverse jerks up and down.
    #[inline]
    pub(super) fn new([a0, af]: [f64; 2], k: f64, to_gain: f64, top: f64) -> Self {
        let base = a0.max(af);
        let extra = to_gain / k;
        let root = (base * base + extra).sqrt();
        let mut above = if base > 0.0 {
            extra / (base + root)
        } else {
            root - base
        };
        let (mut hold, mut peak) = (0.0, base + above);
        if peak > top {
            above = (top - base).max(0.0);
            hold = (to_gain - k * above * (above + 2.0 * base)).max(0.0) / top;
            peak = top;
        }
        let (up, down) = if a0 >= af {
            (above, above + (a0 - af))
        } else {
            (above + (af - a0), above)
        };
        Self {
            up,
            hold,
            down,
            peak,
        }
    }
}

/// A change of velocity and acceleration in three phases.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Change {
    pub(crate) t: [f64; 3],
    pub(crate) j: [f64; 3],
}

impl Change {
    /// The same as phases of an extremal plan.
    pub(crate) fn phases(&self) -> Phases {
        let [up, hold, down] = self.t;
        Phases {
            t: [up, hold, down, 0.0, 0.0, 0.0, 0.0],
            mirrored: self.j[0] < 0.0,
        }
    }

    pub(crate) fn duration(&self) -> f64 {
        self.t[0] + self.t[1] + self.t[2]
    }

    /// The path travelled.
    pub(crate) fn path(&self, v0: f64, a0: f64) -> f64 {
        let (mut path, mut v, mut a) = (0.0, v0, a0);
        for (t, j) in self.t.into_iter().zip(self.j) {
            let begin = State { p: 0.0, v, a };
            let mut last = 0.0;
            let mut turns = zeros(v, a, 0.5 * j);
            turns.sort_unstable_by(f64::total_cmp);
            for turn in turns.into_iter().chain([t]) {
                if turn > 0.0 && turn <= t {
                    let p = begin.displacement(turn, j);
                    path += (p - last).abs();
                    last = p;
                }
            }
            let end = begin.after(t, j);
            (v, a) = (end.v, end.a);
        }
        path
    }

    pub(crate) fn displacement(&self, v0: f64, a0: f64) -> f64 {
        let mut state = State {
            p: 0.0,
            v: v0,
            a: a0,
        };
        for (t, j) in self.t.into_iter().zip(self.j) {
            state = state.after(t, j);
        }
        state.p
    }
}
