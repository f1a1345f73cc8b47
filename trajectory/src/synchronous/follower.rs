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
//! # Down and up again
//!
//! Where a thread is tapped the spindle is turned round by a speed that changes as smoothly as the axes can follow: an
//! acceleration that comes and goes with a limited jerk. So its way to standstill is known before, and the reversal begins
//! where that leads just to the thread's end. The observer expects the change, and the tool stays in step through the
//! standstill, and up to where it began.
//!
//! # There is always a stop
//!
//! The state of each setpoint is inside the limits, and the shortest stop from it ends before the thread's end: what
//! would not is not gone to, but the stop to the thread's end begins there. A tap may go [a part of a lead](BEYOND)
//! beyond, and what would go further is out of step.
//!
//! Back beyond the thread's beginning nothing here keeps the tool while no reversal is under way: a spindle that turns
//! backwards takes it along. The controller's watch bounds that, which lets a spindle turn too slowly for some
//! hundredths of a second only.

use super::{AngleObserver, RippleLimits, Turning};
use crate::limits::Limits;
use crate::profile::{Profile, State};
use crate::state_to_state::{Problem, plan};
use core::ops::Neg;

/// By this part of a cycle a ramp may begin late.
const LATE: f64 = 0.5;
/// The parts of acceleration and jerk that the ramp has, and that a spindle's unevenness may have.
const RAMP: [f64; 2] = [0.7, 0.5];
const RIPPLE: [f64; 2] = [0.2, 0.4];
/// Part of the jerk by which a mean of jerks may be beyond it.
const ROUNDING: f64 = 1e-9;
/// How fast the setpoint is drawn to where it is wanted, rad/s; and no faster than this part of a cycle's inverse.
const DRAWN: f64 = 150.0;
const DRAWN_PART: f64 = 0.3;
/// The parts of the axes' acceleration and jerk that a reversal of the spindle may ask for.
const REVERSAL: [f64; 2] = [0.5, 0.3];
/// The part of the spindle's own ramp that a speed may ask for that changes smoothly.
pub const RAMP_PART: f64 = 0.7;
/// In no less than so long, s, it comes to that.
pub const LEAST_RISE: f64 = 0.08;
/// A tap may go by this part of a lead beyond its end, where the spindle turns further until it stands than it should.
pub const BEYOND: f64 = 0.25;

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
    /// The spindle is turned round at its end, and the tool goes back in step to where it began.
    pub tapping: Option<Tapping>,
}

/// How a spindle is turned round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tapping {
    /// How fast it is told to turn, turns/s, above 0.
    pub speed: f64,
    /// Its drive's own ramp, turns/s².
    pub ramp: f64,
    /// So much later than its drive is sent a speed it has it, s.
    pub delay: f64,
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
    /// The spindle does not stand where the thread ends.
    TooDeep,
}

/// The change of the spindle's speed that turns it round.
#[derive(Clone, Copy, Debug)]
struct Reversal {
    /// From rest: turns that come on top, as the thread counts them.
    change: Profile,
    /// It began so long before the next SYNC, s.
    elapsed: f64,
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
    reversal: Option<Reversal>,
    /// The turn of the spindle at which the thread begins.
    turn: f64,
}

impl Thread {
    /// The way that an axis with these limits needs in any case at that speed of the spindle, turns/s, to come in step
    /// and to rest, mm; `None` where it cannot be as fast.
    pub fn least_length(&self, limits: &Limits, speed: f64) -> Option<f64> {
        let ramp = ramp(self.lead * speed, limits)?;
        match self.tapping {
            None => Some(stop(ramp.end(), limits)?.end().p),
            Some(tapping) => {
                let tapping = Tapping { speed, ..tapping };
                let reversal = self.reversal(&tapping, limits)?;
                Some(ramp.end().p + self.lead * turns_to_rest(&reversal, speed))
            }
        }
    }

    /// How the spindle's speed changes from one direction to the other, as its angle counts in the thread.
    fn reversal(&self, tapping: &Tapping, limits: &Limits) -> Option<Profile> {
        let Tapping { speed, ramp, .. } = *tapping;
        let [a, j] = REVERSAL;
        let acceleration = (RAMP_PART * ramp).min(a * limits.a_max / self.lead);
        let jerk = (acceleration / LEAST_RISE).min(j * limits.j_max / self.lead);
        let limits = Limits::symmetric(3.0 * speed, acceleration, jerk);
        plan(
            &Problem::to_velocity(State::default(), -2.0 * speed, limits),
            0.0,
        )
        .ok()
    }

    /// As the thread counts what the spindle's angle counts, or the other way about.
    fn signed<T: Neg<Output = T>>(&self, value: T) -> T {
        if self.reverse { -value } else { value }
    }
}

/// How far a spindle turns until a reversal has brought it to rest. It has the same shape before and behind that.
fn turns_to_rest(reversal: &Profile, speed: f64) -> f64 {
    let half = 0.5 * reversal.duration();
    speed * half + reversal.at(half).p
}

impl Follower {
    /// At rest at the beginning of a thread along which these limits hold, with a setpoint every `period` s.
    ///
    /// Of the limits the greatest values count, in both directions.
    pub fn new(thread: Thread, limits: Limits, period: f64) -> Self {
        Self {
            thread,
            limits,
            period,
            state: State::at_rest(0.0),
            jerk: 0.0,
            stage: Stage::Waiting,
            reversal: None,
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
        self.thread.lead * (self.thread.signed(turns) - self.turn)
    }

    /// The tool rests at the end.
    pub fn is_over(&self) -> bool {
        let Stage::Leaving { stop, elapsed } = self.stage else {
            return false;
        };
        elapsed >= stop.duration()
    }

    /// How fast the spindle is to be told to turn with the last setpoint, turns/s, where that is not as before.
    pub fn spindle_speed(&self) -> Option<f64> {
        let Reversal { change, elapsed } = self.reversal?;
        let speed = self.thread.tapping?.speed;
        // In the middle of the cycle that it is for.
        let at = change.at(elapsed + 0.5 * self.period).v;
        Some(self.thread.signed(speed + at))
    }

    /// The next setpoint: it is sent for the SYNC that is `next` seconds behind the observer's last sample, and takes
    /// effect `lag` seconds later.
    ///
    /// # Errors
    /// The tool cannot stay in step; the setpoint is the one before, and from its state there is a stop.
    pub fn advance(
        &mut self,
        observer: &mut AngleObserver,
        next: f64,
        lag: f64,
    ) -> Result<State, LostStep> {
        self.turn_round(observer, next);
        let after = next + lag;
        match self.stage {
            Stage::Waiting => self.wait(observer, after),
            Stage::PickingUp { .. } => self.pick_up(observer, after)?,
            Stage::Following => self.follow(observer, after)?,
            Stage::Leaving { stop, elapsed } => self.leave(stop, elapsed),
        }
        Ok(self.state)
    }

    /// Goes on with the spindle's reversal, or begins it where it leads to the thread's end.
    fn turn_round(&mut self, observer: &mut AngleObserver, next: f64) {
        if let Some(reversal) = &mut self.reversal {
            reversal.elapsed += self.period;
            return;
        }
        let thread = &self.thread;
        let Some(tapping) = thread.tapping.filter(|_| self.is_in_step()) else {
            return;
        };
        let Some(change) = thread.reversal(&tapping, &self.limits) else {
            return;
        };
        // Where it comes to rest if that begins with the next SYNC.
        let begins = next + tapping.delay;
        let mean = observer.after(begins, RippleLimits::NONE);
        let turns = thread.signed(mean.turns) + turns_to_rest(&change, tapping.speed);
        let left = thread.length - thread.lead * (turns - self.turn);
        let wait = (left / (thread.lead * tapping.speed)).max(0.0);
        if wait < self.period {
            self.reversal = Some(Reversal {
                change,
                elapsed: -wait,
            });
            let signed = if thread.reverse {
                change.mirrored()
            } else {
                change
            };
            observer.expect(signed, begins + wait);
        }
    }

    fn wait(&mut self, observer: &AngleObserver, after: f64) {
        if !observer.is_settled() {
            return;
        }
        let mean = observer.after(after, RippleLimits::NONE);
        let [turns, speed] = [mean.turns, mean.speed].map(|it| self.thread.signed(it));
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
        let sign = self.thread.signed(lead);
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
        let rests = stop(next, &self.limits).map(|stop| stop.end().p);
        let Thread { length, lead, .. } = self.thread;
        let is_tapped = self.thread.tapping.is_some();
        let deepest = if is_tapped {
            length + BEYOND * lead
        } else {
            length
        };
        let returns = self.reversal.is_some();
        if rests.is_some_and(|at| at <= deepest && (!returns || at >= 0.0)) {
            (self.state, self.jerk) = (next, jerk);
            return Ok(());
        }
        if is_tapped && rests.is_none_or(|at| at > deepest) {
            return Err(LostStep::TooDeep);
        }
        let end = if returns { 0.0 } else { length };
        let to_end = Problem::new(self.state, State::at_rest(end), self.limits);
        let distance = (end - self.state.p).abs();
        let stop = plan(&to_end, 0.0).map_err(|_| LostStep::Behind { distance })?;
        self.leave(stop, 0.0);
        Ok(())
    }

    fn leave(&mut self, stop: Profile, elapsed: f64) {
        let jerk = mean_jerk(&stop, elapsed, self.period);
        let elapsed = elapsed + self.period;
        self.state = stop.at(elapsed);
        // A sum is rounded.
        let most = self.limits.j_max;
        self.jerk = match jerk.abs() <= most * (1.0 + ROUNDING) {
            true => jerk.clamp(-most, most),
            false => jerk,
        };
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

/// The jerk of a profile in the mean over `time` s from an instant on. Not the difference of its states' accelerations: near
/// rest a [state](Profile::sample) may be that of an instant up to a microsecond later.
fn mean_jerk(profile: &Profile, from: f64, time: f64) -> f64 {
    let mut begin = 0.0;
    let mut change = 0.0;
    for segment in profile.segments() {
        let end = begin + segment.duration;
        let lasts = (end.min(from + time) - begin.max(from)).max(0.0);
        change += segment.jerk * lasts;
        begin = end;
    }
    change / time
}

/// The shortest stop.
fn stop(from: State, limits: &Limits) -> Option<Profile> {
    plan(&Problem::to_velocity(from, 0.0, *limits), 0.0).ok()
}

/// From rest to a speed, mm/s.
fn ramp(speed: f64, limits: &Limits) -> Option<Profile> {
    let limits = Limits::symmetric(limits.v_max, RAMP[0] * limits.a_max, RAMP[1] * limits.j_max);
    plan(&Problem::to_velocity(State::default(), speed, limits), 0.0).ok()
}
