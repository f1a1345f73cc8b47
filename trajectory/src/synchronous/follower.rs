//! Setpoints along a thread.
//!
//! # In step from rest
//!
//! The tool rests at the thread's beginning, and is to be where spindle and lead want it, at the spindle's speed. A ramp
//! from rest to that speed takes a time t and leads half as far as the spindle wants in that time. So it begins t/2
//! before the spindle comes to a whole turn, at an instant between two setpoints: where the ramp ends, the tool is in
//! step, and never had to be faster than the spindle.
//!
//! # Along
//!
//! What the observer tells changes a little with each sample. The setpoint is therefore a state of its own, of position,
//! velocity and acceleration, which goes from each cycle to the next with a constant jerk inside the limits, led by
//! what the spindle will do and drawn to where that wants it.
//!
//! # There is always a stop
//!
//! The state of each setpoint is inside the limits, and the shortest stop from it ends before the thread's end: what
//! would not is not gone to, but the stop to the thread's end begins there.

use super::{AngleObserver, RippleLimits, Turning};
use crate::limits::Limits;
use crate::profile::{Profile, State};
use crate::state_to_state::{Axis, plan};

/// By this part of a cycle a ramp may begin late.
const LATE: f64 = 0.5;
/// The parts of acceleration and jerk that the ramp has, and that a spindle's unevenness may have.
const RAMP: [f64; 2] = [0.7, 0.5];
const RIPPLE: [f64; 2] = [0.2, 0.4];
/// How fast the setpoint is drawn to where it is wanted, rad/s; and no faster than this part of a cycle's inverse.
const DRAWN: f64 = 150.0;
const DRAWN_PART: f64 = 0.3;

/// A thread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thread {
    /// From its beginning to its end, mm.
    pub length: f64,
    /// In a turn of the spindle, mm, above 0.
    pub lead: f64,
    /// The spindle's angle falls while it is cut.
    pub reverse: bool,
    /// How far the tool may be from where the spindle wants it, mm.
    pub tolerance: f64,
}

/// Why the tool cannot stay in step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LostStep {
    /// The spindle wants more than the greatest velocity.
    TooFast {
        /// mm/s
        wanted: f64,
        /// mm/s
        allowed: f64,
    },
    /// The limits do not let it follow what the spindle does.
    Behind {
        /// By how much, mm.
        distance: f64,
    },
}

#[derive(Clone, Copy, Debug)]
enum Stage {
    /// At rest until the spindle is where the ramp begins.
    Waiting,
    /// On the ramp, which began so long ago; so long that the spindle would go from `from` at `speed`.
    PickingUp {
        ramp: Profile,
        elapsed: f64,
        since: f64,
        from: f64,
        speed: f64,
    },
    Following,
    /// On the way to rest at the end, for so long.
    Leaving {
        stop: Profile,
        elapsed: f64,
    },
}

/// Follows a spindle along a thread.
#[derive(Clone, Copy, Debug)]
pub struct Follower {
    thread: Thread,
    limits: Limits,
    period: f64,
    state: State,
    jerk: f64,
    stage: Stage,
    /// The turn of the spindle at which the thread begins.
    turn: f64,
}

impl Thread {
    /// The way that an axis with these limits needs in any case at that speed of the spindle, turns/s, to come in step
    /// and to rest, mm; `None` where it cannot be as fast.
    pub fn least_length(&self, limits: &Limits, speed: f64) -> Option<f64> {
        let ramp = ramp(self.lead * speed, limits)?;
        let stop = stop(ramp.end(), limits)?;
        Some(stop.end().p)
    }
}

impl Follower {
    /// At rest at the beginning of a thread along which these limits hold, with a setpoint every `period` s.
    pub fn new(thread: Thread, limits: Limits, period: f64) -> Self {
        Self {
            thread,
            limits,
            period,
            state: State::at_rest(0.0),
            jerk: 0.0,
            stage: Stage::Waiting,
            turn: 0.0,
        }
    }

    /// Position (mm from the beginning), velocity and acceleration of the last setpoint.
    pub fn state(&self) -> State {
        self.state
    }

    /// The jerk that led there, mm/s³.
    pub fn jerk(&self) -> f64 {
        self.jerk
    }

    /// The tool has left the beginning.
    pub fn has_begun(&self) -> bool {
        !matches!(self.stage, Stage::Waiting)
    }

    /// The tool is where the spindle wants it.
    pub fn is_in_step(&self) -> bool {
        matches!(self.stage, Stage::Following)
    }

    /// Where the spindle wants the tool that has turned so far, mm from the beginning, once the tool has set off.
    pub fn wanted_at(&self, turns: f64) -> f64 {
        let turns = if self.thread.reverse { -turns } else { turns };
        self.thread.lead * (turns - self.turn)
    }

    /// The tool rests at the end.
    pub fn is_over(&self) -> bool {
        let Stage::Leaving { stop, elapsed } = self.stage else {
            return false;
        };
        elapsed >= stop.duration()
    }

    /// The next setpoint, which takes effect so many seconds after the observer's last sample.
    ///
    /// # Errors
    /// The tool cannot stay in step; the setpoint is the one before, and from its state there is a stop.
    pub fn advance(&mut self, observer: &AngleObserver, after: f64) -> Result<State, LostStep> {
        match self.stage {
            Stage::Waiting => self.wait(observer, after),
            Stage::PickingUp { .. } => self.pick_up(observer, after)?,
            Stage::Following => self.follow(observer, after)?,
            Stage::Leaving { stop, elapsed } => self.leave(stop, elapsed),
        }
        Ok(self.state)
    }

    fn wait(&mut self, observer: &AngleObserver, after: f64) {
        if !observer.is_settled() {
            return;
        }
        let mean = observer.after(after, RippleLimits::NONE);
        let [turns, speed] = [mean.turns, mean.speed].map(|it| match self.thread.reverse {
            true => -it,
            false => it,
        });
        let lead = self.thread.lead;
        let Some(ramp) = ramp(lead * speed, &self.limits).filter(|_| speed > 0.0) else {
            return;
        };
        // So much before a whole turn.
        let before = 0.5 * speed * ramp.duration();
        // What the observer tells may step over it by a part of a cycle: so little late the ramp has not led anywhere.
        let turn = (turns + before - LATE * self.period * speed).ceil();
        let left = (turn - before - turns) / speed;
        if left < self.period {
            self.turn = turn;
            self.stage = Stage::PickingUp {
                ramp,
                elapsed: -left,
                since: 0.0,
                from: lead * (turns - turn),
                speed: lead * speed,
            };
        }
    }

    /// Where the spindle wants the tool, and how that changes.
    fn wanted(&self, observer: &AngleObserver, after: f64) -> Result<(State, f64), LostStep> {
        let lead = self.thread.lead;
        let Limits {
            v_max,
            a_max,
            j_max,
            ..
        } = self.limits;
        let Turning {
            turns,
            speed,
            acceleration,
            jerk,
        } = observer.after(
            after,
            RippleLimits {
                acceleration: RIPPLE[0] * a_max / lead,
                jerk: RIPPLE[1] * j_max / lead,
            },
        );
        let sign = if self.thread.reverse { -lead } else { lead };
        let wanted = State {
            p: sign * turns - lead * self.turn,
            v: sign * speed,
            a: sign * acceleration,
        };
        match wanted.v.abs() > v_max {
            true => Err(LostStep::TooFast {
                wanted: wanted.v.abs(),
                allowed: v_max,
            }),
            false => Ok((wanted, sign * jerk)),
        }
    }

    fn pick_up(&mut self, observer: &AngleObserver, after: f64) -> Result<(), LostStep> {
        let (wanted, jerk) = self.wanted(observer, after)?;
        let Stage::PickingUp {
            ramp,
            elapsed,
            since,
            from,
            speed,
        } = &mut self.stage
        else {
            return Ok(());
        };
        let before = ramp.at(elapsed.max(0.0));
        *elapsed += self.period;
        *since += self.period;
        let at = ramp.at(elapsed.max(0.0));
        let ramped = (at.a - before.a) / self.period;
        // The ramp was made for an even spindle. What it does beside that comes in with the speed.
        let off = State {
            p: wanted.p - (*from + *speed * *since),
            v: wanted.v - *speed,
            a: wanted.a,
        };
        let [part, rate, change] = [at.v, at.a, ramped].map(|it| it / *speed);
        let target = State {
            p: at.p + part * off.p,
            v: at.v + part * off.v + rate * off.p,
            a: at.a + part * off.a + 2.0 * rate * off.v + change * off.p,
        };
        let jerk = ramped + part * jerk + 3.0 * (rate * off.a + change * off.v);
        if *elapsed >= ramp.duration() {
            self.stage = Stage::Following;
        }
        self.go_towards(target, jerk)
    }

    fn follow(&mut self, observer: &AngleObserver, after: f64) -> Result<(), LostStep> {
        let (wanted, jerk) = self.wanted(observer, after)?;
        let distance = (self.state.after(self.period, self.jerk).p - wanted.p).abs();
        if distance > self.thread.tolerance {
            return Err(LostStep::Behind { distance });
        }
        self.go_towards(wanted, jerk)
    }

    /// The next state, as near to the wanted one as the limits allow; or the first one on the way to rest at the end.
    fn go_towards(&mut self, wanted: State, jerk: f64) -> Result<(), LostStep> {
        let time = self.period;
        let rate = DRAWN.min(DRAWN_PART / time);
        let led = self.state.after(time, jerk);
        let drawn = rate * rate * rate * (led.p - wanted.p)
            + 3.0 * rate * rate * (led.v - wanted.v)
            + 3.0 * rate * (led.a - wanted.a);
        let jerk = self.allowed(jerk - drawn);
        let next = self.state.after(time, jerk);
        let goes_on =
            stop(next, &self.limits).is_some_and(|stop| stop.end().p <= self.thread.length);
        if goes_on {
            (self.state, self.jerk) = (next, jerk);
            return Ok(());
        }
        let length = self.thread.length;
        let to_end = Axis::new(self.state, State::at_rest(length), self.limits);
        let distance = length - self.state.p;
        let stop = plan(&to_end, 0.0).map_err(|_| LostStep::Behind { distance })?;
        self.leave(stop, 0.0);
        Ok(())
    }

    fn leave(&mut self, stop: Profile, elapsed: f64) {
        let elapsed = elapsed + self.period;
        let before = self.state.a;
        self.state = stop.at(elapsed);
        self.jerk = (self.state.a - before) / self.period;
        self.stage = Stage::Leaving { stop, elapsed };
    }

    /// The nearest jerk with which velocity and acceleration stay within the limits from here on.
    fn allowed(&self, jerk: f64) -> f64 {
        let (time, State { v, a, .. }) = (self.period, self.state);
        let Limits {
            v_max,
            a_max,
            j_max,
            ..
        } = self.limits;
        let least = ((-a_max - a) / time).clamp(-j_max, j_max);
        let most = ((a_max - a) / time).clamp(-j_max, j_max);
        let jerk = jerk.clamp(least, most);
        // Where the velocity ends if the acceleration goes to 0 as fast as it can.
        let next = self.state.after(time, jerk);
        let ends = next.v + next.a * next.a.abs() / (2.0 * j_max);
        match ends.abs() > v_max && ends.abs() > (v + a * a.abs() / (2.0 * j_max)).abs() {
            true if ends > 0.0 => least,
            true => most,
            false => jerk,
        }
    }
}

/// The shortest stop.
fn stop(from: State, limits: &Limits) -> Option<Profile> {
    plan(&Axis::to_velocity(from, 0.0, *limits), 0.0).ok()
}

/// From rest to a speed, mm/s.
fn ramp(speed: f64, limits: &Limits) -> Option<Profile> {
    let limits = Limits::symmetric(limits.v_max, RAMP[0] * limits.a_max, RAMP[1] * limits.j_max);
    plan(&Axis::to_velocity(State::default(), speed, limits), 0.0).ok()
}
