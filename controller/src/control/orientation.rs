//! An oriented spindle (M19): it is brought to an angle, and held there until the program turns it.
//!
//! It first comes to rest, as M5 has it. From there a rest-to-rest profile leads round to the angle; its drive, which follows
//! velocities, is sent those of the profile and what a loop about the measured angle adds, the one by which the
//! axes that are sent velocities are controlled:
//!
//! ```text
//!  velocity = profile in the cycle that it is for + gain · (profile, as late as the drive follows it − measured angle)
//! ```
//!
//! The loop goes on at the angle. Where the spindle is further off than a loop can take back that the drive's ramp bounds
//! (about acceleration / gain², beyond which it would swing), it is braked, and led round anew from where it stands: the way
//! that the program says, or, once it has been there, the shorter one, as what it holds may be in the work.
//!
//! The path rests until the spindle has stood there; one that is turned away from it while the path moves is a fault. A
//! spindle that is not there in time is an operator's pause: cycle start waits for it once more, since nothing that needs an
//! angle is to go on without it.

use super::fault::SpindleCause;
use super::layout::{OrientationSpec, SpindleSpec};
use super::{Controller, Event, Fault, Pause, Phase};
use crate::machine::TURN;
use std::time::Duration;
use syncline_gcode::{Orientation, Way};
use syncline_trajectory::profile::{Profile, State};
use syncline_trajectory::state_to_state;

/// What the spindle is told, and how far that has come.
#[derive(Clone, Copy, Debug)]
struct Orienting {
    told: Orientation,
    /// In this cycle it was told to stand.
    since: u64,
    /// Once it has come to rest: the cycle at whose SYNC it sets off, and its way from there, turns.
    turn: Option<(u64, Profile)>,
    /// For so many cycles in a row it has been there.
    there: u32,
    /// It has stood there since it was told.
    reached: bool,
    /// For so many cycles it has been turned away since.
    off: u64,
}

/// The spindle, as far as it is held at an angle.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Orienter(Option<Orienting>);

impl Orienting {
    fn new(told: Orientation, since: u64) -> Self {
        Self {
            told,
            since,
            turn: None,
            there: 0,
            reached: false,
            off: 0,
        }
    }

    /// How fast it is to turn in the cycle behind the next SYNC, turns/s, where the last SYNC was that of `cycle`, and where the
    /// spindle was so many cycles before it.
    fn velocity(&mut self, cycle: u64, turns: f64, age: u32, following: &Following) -> f64 {
        let Some((since, profile)) = &self.turn else {
            return 0.0;
        };
        let Following {
            period,
            delay,
            gain,
            furthest,
        } = *following;
        let at = |cycles: f64| profile.at((cycles * period).max(0.0));
        let next = (cycle + 1 - since) as f64;
        let velocity_feed_forward = (at(next + 1.0).p - at(next).p) / period;
        let seen = cycle as f64 - *since as f64 - f64::from(age);
        let error = at(seen - delay / period).p - turns;
        if error.abs() > furthest {
            self.turn = None;
            self.since = cycle;
            return 0.0;
        }
        velocity_feed_forward + gain * error
    }

    fn is_over(&self, cycle: u64, period: f64) -> bool {
        let elapsed = |since: u64| cycle.saturating_sub(since) as f64 * period;
        (self.turn.as_ref()).is_some_and(|(since, turn)| elapsed(*since) >= turn.duration())
    }
}

/// How the drive follows what it is sent.
struct Following {
    /// Of a cycle, s.
    period: f64,
    /// So much later it has a velocity, s.
    delay: f64,
    /// Of the loop, 1/s.
    gain: f64,
    /// So far off the loop takes it back, turns.
    furthest: f64,
}

impl<const N: usize> Controller<N> {
    /// What the program has the spindle oriented to; `None` where it turns, or is free.
    fn orientation(&self) -> Option<(Orientation, SpindleSpec, OrientationSpec)> {
        let told = self.switches.functions.spindle.orientation?;
        let spindle = self.layout.spindle?;
        Some((told, spindle, spindle.orientation?))
    }

    /// How far the spindle is from the angle that it was told, degrees, the shorter way round, and what is allowed.
    fn off_angle(&self) -> Option<(f64, f64)> {
        let (told, _, spec) = self.orientation()?;
        let turned = self.sample_spindle()?.turns - told.angle / TURN;
        Some(((turned - turned.round()) * TURN, spec.tolerance))
    }

    /// How fast an oriented spindle is to turn from the next SYNC on, 1/min. Where outputs have their safe values nobody holds
    /// it any more.
    pub(super) fn orient(&mut self, is_safe: bool) -> Option<f64> {
        let Some((told, spindle, spec)) = self.orientation().filter(|_| !is_safe) else {
            self.orienter.0 = None;
            return None;
        };
        let sample = self.sample_spindle()?;
        let node = &self.nodes[spindle.drive];
        let (fresh, still) = (node.is_fresh(), self.still_cycles());
        let gain = node.dynamics().map_or(0.0, |it| it.gain);
        let following = Following {
            period: self.layout.cycle.as_secs_f64(),
            delay: spec.delay,
            gain: if fresh { gain } else { 0.0 },
            furthest: (spec.limits.a_max / gain.powi(2)).max(2.0 * spec.tolerance / TURN),
        };
        let cycle = self.cycle;
        let mut orienting = (self.orienter.0)
            .filter(|it| it.told == told)
            .unwrap_or(Orienting::new(told, cycle));
        let stood = cycle - orienting.since;
        let rests = u64::from(node.still()).min(stood) >= u64::from(still);
        if orienting.turn.is_none() && fresh && rests {
            let from = State::at_rest(sample.turns);
            let way = match orienting.reached {
                true => Way::Shorter,
                false => told.way,
            };
            let turns = way.turns(told.angle / TURN - sample.turns);
            let to = State::at_rest(sample.turns + turns);
            let problem = state_to_state::Problem::new(from, to, spec.limits);
            let turn = state_to_state::plan(&problem, 0.0).ok();
            orienting.turn = turn.map(|turn| (cycle + 1, turn));
        }
        let velocity = orienting.velocity(cycle, sample.turns, sample.age, &following);
        let near = self
            .off_angle()
            .is_some_and(|(off, most)| off.abs() <= most);
        let there = fresh && near && orienting.is_over(cycle, following.period);
        orienting.there = if there { orienting.there + 1 } else { 0 };
        orienting.reached |= orienting.there >= still;
        orienting.off = match orienting.reached && !there {
            true => orienting.off + 1,
            false => 0,
        };
        self.orienter.0 = Some(orienting);
        Some(60.0 * velocity)
    }

    /// How long the spindle may take to its angle.
    pub(super) fn orients_within(&self) -> Option<Duration> {
        let (told, _, spec) = self.orientation()?;
        Some(told.within.unwrap_or(spec.within))
    }

    /// The path rests until the spindle has come to its angle, which may take so long.
    pub(super) fn await_orientation(&mut self, line: u32) {
        let Some(within) = self.orients_within() else {
            return self.executor.pass();
        };
        let is_there = self.orienter.0.is_some_and(|it| it.reached && it.off == 0);
        let (waited, _) = self.rested_for(is_there);
        if is_there {
            self.awaited = None;
            self.executor.pass();
        } else if waited >= within {
            self.awaited = None;
            self.pause_told = true;
            let reason = Pause::NotOriented;
            self.tell(Event::Paused { line, reason });
        }
    }

    /// Looks whether the spindle stays where it was oriented while the path moves.
    ///
    /// # Errors
    /// It was turned away for longer than a cut may go on without its speed.
    pub(super) fn watch_orientation(&self) -> Result<(), Fault> {
        let moves = self.phase == Phase::Program && self.planned.speed > 0.0;
        let most = self.cycles(self.layout.speed_loss);
        let is_off = (self.orienter.0).is_some_and(|it| it.off > most);
        match self.off_angle().filter(|_| moves && is_off) {
            Some((off, allowed)) => Err(Fault::Spindle(SpindleCause::Angle { off, allowed })),
            None => Ok(()),
        }
    }
}
