//! A spindle that a drive on a bus turns: what it is told, how far and how fast it turns.
//!
//! Its drive is a device like the others: it goes up and down with them, is supervised with them, and what it does wrong
//! is a fault by the same table. It has no place on the path. What the program says of the spindle is sent with the
//! setpoints of the same SYNC, and the drive goes there by a ramp of its own. Where outputs have their safe values the
//! spindle is told to stand; before power is taken off its drive it is given the time to.
//!
//! Its speed is that of its actual positions, which count increments, not what the drive says of its velocity: that
//! counts in the unit in which it was sent, and so would agree where the unit is another one than the machine file says.
//! Only where the drive tells no position it is what the drive says.
//!
//! A spindle that has had its speed has to keep it while the path cuts, be it turned by a drive or by something that tells by an
//! input whether it is at speed.

use super::fault::SpindleCause;
use super::inputs::AT_SPEED_BEFORE;
use super::layout::{Layout, SpindleSpec};
use super::{Controller, Event, Fault, Hold, Phase, Request};
use crate::machine::{TURN, degrees_per_second};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use syncline_canopen::time::Duration;
use syncline_drives::model::PowerState;
use syncline_gcode::{Spindle, Turning};
use syncline_trajectory::synchronous::{AngleObserver, RippleLimits};

/// A feed by turns is planned anew where the spindle's speed differs by this part from the one that it is planned with, and
/// no sooner after the last time.
const FEED_STEP: f64 = 0.005;
const FEED_STEPS_APART: Duration = Duration::from_millis(60);

/// So much later is a feed by turns as fast as it is planned anew, s, in the mean.
const FEED_AHEAD: f64 = 0.06;

/// A spindle comes after a speed that changes with X with this time constant, s, and no faster than its drive's ramp.
const COMES_AFTER: f64 = 0.1;

/// A speed is the mean over this time, so that an encoder of some thousand increments tells it to 1/min.
const AVERAGED: Duration = Duration::from_millis(20);

/// What was measured of a spindle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SpindleSample {
    /// How fast it turns, 1/min, negative counterclockwise: the mean of the last 20 ms.
    pub speed: f64,
    /// How far it has turned from the drive's `zero`, revolutions, whole ones too; 0 where its drive tells no position.
    pub turns: f64,
    /// SYNCs since the one at which it was there.
    pub age: u32,
}

/// How fast a spindle is told to turn, 1/min, negative counterclockwise.
#[must_use]
pub fn turning(spindle: Spindle) -> f64 {
    match spindle.turning {
        Turning::Clockwise => spindle.speed,
        Turning::Counterclockwise => -spindle.speed,
        Turning::Off => 0.0,
    }
}

/// Whether the spindle keeps the speed that it was told.
#[derive(Clone, Copy, Debug, Default)]
struct KeptSpeed {
    /// That speed, 1/min, negative counterclockwise.
    told: f64,
    /// Since this cycle.
    since: u64,
    /// Where a drive is that comes after it, 1/min.
    followed: f64,
    /// It has had it since.
    reached: bool,
    /// For so many cycles it has not had it any more.
    off: u64,
}

impl KeptSpeed {
    /// Another speed is told in a cycle, unless it is one that changes with X: a drive comes after that by this part of
    /// what is left, or by so much.
    fn tell(&mut self, cycle: u64, told: f64, comes_after: Option<(f64, f64)>) {
        match comes_after {
            Some((part, step)) if told * self.told > 0.0 => {
                let behind = told - self.followed;
                self.followed += (behind * part).clamp(-step, step);
                self.told = told;
            }
            _ if told != self.told => {
                *self = Self {
                    told,
                    followed: told,
                    since: cycle,
                    ..Self::default()
                };
            }
            _ => self.followed = told,
        }
    }

    /// By how much a measured speed is off what is told, or what came of that so far, 1/min.
    fn off_by(&self, speed: f64) -> f64 {
        let (least, most) = (self.told.min(self.followed), self.told.max(self.followed));
        (speed - speed.clamp(least, most)).abs()
    }

    /// Takes whether it turns as it is told; for how many cycles it has not, after it has.
    fn take(&mut self, reaches: bool, has: bool) -> u64 {
        let told = self.told;
        if reaches {
            self.followed = told;
        }
        self.reached |= reaches && told != 0.0;
        self.off = if self.reached && !has {
            self.off + 1
        } else {
            0
        };
        self.off
    }
}

/// How the spindle has turned lately.
#[derive(Clone, Debug)]
pub(super) struct SpindleWatch {
    /// In which cycle it was how far, revolutions, the oldest first; never more than there was room for at first. Where the
    /// drive tells a speed alone, how far that has taken it.
    turns: VecDeque<(u64, f64)>,
    most: usize,
    /// Of a cycle, s.
    period: f64,
    /// Cycles in a row in which it has turned as it was told.
    at_speed: u32,
    kept: KeptSpeed,
    /// How it turns, as of the SYNC of this cycle.
    angle: AngleObserver,
    angle_cycle: u64,
    /// When a feed by turns was planned anew last.
    fed: u64,
}

impl SpindleWatch {
    pub(super) fn new(layout: &Layout) -> Self {
        let cycles = AVERAGED.as_nanos().div_ceil(layout.cycle.as_nanos());
        let most = cycles as usize + 1;
        Self {
            turns: VecDeque::with_capacity(most),
            most,
            period: layout.cycle.as_secs_f64(),
            at_speed: 0,
            kept: KeptSpeed::default(),
            angle: AngleObserver::new(layout.cycle.as_secs_f64(), layout.spindle_resolution()),
            angle_cycle: 0,
            fed: 0,
        }
    }

    /// How it turns, as of the SYNC of this cycle.
    pub(super) fn angle(&self) -> &AngleObserver {
        &self.angle
    }

    /// The same, to tell it what the shaft is told.
    pub(super) fn angle_mut(&mut self) -> &mut AngleObserver {
        &mut self.angle
    }

    /// Comes to the SYNC of a cycle, at which it was there, if that is known.
    fn observe(&mut self, cycle: u64, turns: Option<f64>) {
        let cycles = cycle.saturating_sub(self.angle_cycle);
        self.angle.advance(cycles as f64 * self.period);
        self.angle_cycle = cycle;
        if let Some(turns) = turns {
            self.angle.measure(turns);
        }
    }

    /// How far it has come by a cycle with that speed since the last one, degrees/s.
    fn turned(&self, cycle: u64, speed: f64) -> f64 {
        self.turns.back().map_or(0.0, |(before, turns)| {
            let cycles = cycle.saturating_sub(*before);
            turns + speed / TURN * cycles as f64 * self.period
        })
    }

    fn take(&mut self, cycle: u64, turns: f64) {
        if self.turns.len() == self.most {
            self.turns.pop_front();
        }
        self.turns.push_back((cycle, turns));
    }

    /// 1/min; 0 before there are two samples.
    fn speed(&self) -> f64 {
        match (self.turns.front(), self.turns.back()) {
            (Some((from, before)), Some((to, now))) if to > from => {
                (now - before) / ((to - from) as f64 * self.period) * 60.0
            }
            _ => 0.0,
        }
    }
}

impl<const N: usize> Controller<N> {
    /// Tells its drive how fast the spindle is to turn from the next SYNC on, 1/min.
    pub(super) fn turn_spindle(&mut self, speed: f64) {
        if let Some(spindle) = self.layout.spindle {
            let node = &mut self.nodes[spindle.drive];
            let speed = degrees_per_second(speed);
            node.setpoint.velocity = node.scaling().to_increments_per_second(speed);
        }
    }

    /// What was measured of it last.
    pub(super) fn sample_spindle(&self) -> Option<SpindleSample> {
        let node = &self.nodes[self.layout.spindle?.drive];
        Some(SpindleSample {
            speed: self.spindle.speed(),
            turns: node.actual_mm() / TURN,
            age: node.age(),
        })
    }

    /// Takes where it was at the last SYNC, and counts the cycles in which it has turned as the program has it.
    pub(super) fn watch_spindle(&mut self) {
        let Some(SpindleSpec { drive, .. }) = self.layout.spindle else {
            return;
        };
        let node = &self.nodes[drive];
        let turns = (node.age() == 0).then(|| match node.told_speed() {
            Some(speed) => self.spindle.turned(self.cycle, speed),
            None => node.actual_mm() / TURN,
        });
        if !self.sync_on || !node.is_sampled() {
            self.spindle.turns.clear();
            self.spindle.angle.reset();
        } else {
            self.spindle.observe(self.cycle, turns);
            if let Some(turns) = turns {
                self.spindle.take(self.cycle, turns);
            }
        }
        self.spindle.at_speed = match self.turns_as_told() {
            true => self.spindle.at_speed.saturating_add(1),
            false => 0,
        };
    }

    /// Whether the spindle has its speed, and does not swing through it.
    pub(super) fn is_spindle_at_speed(&self) -> bool {
        self.spindle.at_speed >= self.still_cycles()
    }

    fn turns_as_told(&self) -> bool {
        let Some((spindle, sample)) = self.layout.spindle.zip(self.sample_spindle()) else {
            return false;
        };
        let speed = turning(self.switches.functions.spindle);
        let fresh = self.nodes[spindle.drive].is_fresh();
        fresh && (sample.speed - speed).abs() <= spindle.window(speed)
    }

    /// Looks whether the spindle keeps its speed where the path cuts. Where an input tells that it does not, the path is held.
    ///
    /// # Errors
    /// Its drive has measured for too long that it does not.
    pub(super) fn watch_cutting_speed(&mut self) -> Result<(), Fault> {
        let program = self.switches.functions.spindle;
        let told = turning(program);
        let period = self.spindle.period;
        let step = self
            .layout
            .spindle
            .map_or(f64::INFINITY, |it| it.ramp * period);
        let comes_after = program.surface.map(|_| (period / COMES_AFTER, step));
        self.spindle.kept.tell(self.cycle, told, comes_after);
        let (reaches, has) = match self.layout.spindle {
            Some(spindle) => {
                let off = (self.sample_spindle()).map(|it| self.spindle.kept.off_by(it.speed));
                let near = off.is_some_and(|off| off <= spindle.window(told));
                let fresh = self.nodes[spindle.drive].is_fresh();
                (self.is_spindle_at_speed(), fresh && near)
            }
            None => {
                let on = self.tells_at_speed();
                let since = self.cycle.saturating_sub(self.spindle.kept.since);
                (on && since >= self.cycles(AT_SPEED_BEFORE), on)
            }
        };
        let off = self.spindle.kept.take(reaches, has);
        if off <= self.cycles(self.layout.speed_loss) || !self.cuts() {
            return Ok(());
        }
        if let Some((spindle, sample)) = self.layout.spindle.zip(self.sample_spindle()) {
            return Err(Fault::Spindle(SpindleCause::Speed {
                speed: sample.speed,
                told,
                allowed: spindle.window(told),
            }));
        }
        if self.state().allows(Request::FeedHold) {
            // Who goes on without it does so until it comes again.
            self.spindle.kept.reached = false;
            self.tell(Event::SpeedLost);
            self.hold_path(Hold::Spindle);
        }
        Ok(())
    }

    /// Has a feed by turns (G95) go by those that are measured: as far as the spindle has its speed, which it
    /// [has to keep](Self::watch_cutting_speed).
    pub(super) fn feed_by_turns(&mut self) {
        let Some(spindle) = self.layout.spindle else {
            return;
        };
        let program = self.switches.functions.spindle;
        let told = turning(program);
        let apart = self.cycles(FEED_STEPS_APART);
        if told == 0.0 || self.cycle < self.spindle.fed + apart {
            return;
        }
        let Some(planned) = self.executor.planned_turns() else {
            return;
        };
        // What changes with X has changed further by when the next plan takes over.
        let ahead = program.surface.map_or(0.0, |_| FEED_AHEAD);
        let measured = self.spindle.angle.after(ahead, RippleLimits::NONE).speed;
        let kept = &self.spindle.kept;
        let (slow, fast) = (
            told.abs().min(kept.followed.abs()),
            told.abs().max(kept.followed.abs()),
        );
        let window = spindle.window(told);
        let speed = (60.0 * measured * told.signum()).clamp(slow - window, fast + window);
        let turns = speed / 60.0;
        if (turns - planned).abs() > FEED_STEP * planned {
            self.executor.set_turns(Some(turns));
            self.spindle.fed = self.cycle;
        }
    }

    /// Whether the path moves at a feed.
    fn cuts(&self) -> bool {
        let plan = &self.planned;
        self.phase == Phase::Program && plan.speed > 0.0 && plan.feed.is_finite() && !plan.off_path
    }

    /// Whether the spindle stands, or nobody is to wait for it any longer.
    pub(super) fn spindle_rests(&self) -> bool {
        let Some(SpindleSpec {
            drive, reversal, ..
        }) = self.layout.spindle
        else {
            return true;
        };
        let node = &self.nodes[drive];
        let is_told = node.status().power == PowerState::Enabled || node.is_quick_stopped();
        let heard = self.is_in_reach(drive) && node.is_fresh();
        !(is_told && heard) || node.still() >= self.still_cycles() || self.timed_out(reversal)
    }
}
