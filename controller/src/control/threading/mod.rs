//! Threads: the axes go along a line in step with the spindle, whose angle its drive measures.
//!
//! A thread begins where the path rests, and is no part of the planned path, as nobody knows when it will be where: in
//! each cycle the observer of the spindle (`SpindleWatch`) is asked where that will be when the next setpoint takes effect,
//! and a [`Follower`] makes the setpoint of it. At the thread's end the axes rest, and the plan begins anew from there.
//!
//! ```text
//!  position at SYNC k ─► observer ─► setpoint, latched at SYNC k+1 ─► in effect `lag` cycles later
//! ```
//!
//! A tap is the same there and back: at its end the [`Follower`] has the spindle turned round, by speeds that are sent
//! with the setpoints, and it is told its own speed again when the axes are back.
//!
//! What an operator wants of the path meanwhile waits for the thread's end; before the axes have set off a feed hold
//! has effect at once. What stops the machine brings them to rest on the line as soon as their limits allow.

mod failure;

pub use failure::ThreadFailure;

use super::fault::BlockCause;
use super::spindle::turning;
use super::{Controller, Event, Fault};
use syncline_canopen::time::Duration;
use syncline_gcode::Turning;
use syncline_trajectory::limits::Limits;
use syncline_trajectory::path::Setpoint;
use syncline_trajectory::synchronous::{Follower, LostStep, RippleLimits, Thread};

/// In so many turns a spindle is known, and comes to where a thread begins.
const TURNS: f64 = 8.0;
/// What it may take besides, s.
const SETTLING: f64 = 1.0;
/// So long after the first setpoint in step the drives have settled, and what is measured counts.
const SETTLED: Duration = Duration::from_millis(100);

/// For so long a spindle may turn with less than half of its speed, or the other way, while a thread is cut: it would lead
/// the axes to rest, or back.
const SLOW: Duration = Duration::from_millis(40);

/// A thread, as the program has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThreadMove<const N: usize> {
    /// Counts threads, probings and homings of a job, from 1.
    pub number: u32,
    /// Where it ends, mm.
    pub to: [f64; N],
    /// Which way that is, of length 1.
    pub direction: [f64; N],
    /// Length, lead and the spindle's direction.
    pub thread: Thread,
    /// What the axes' limits leave along the line.
    pub limits: Limits,
}

impl<const N: usize> ThreadMove<N> {
    /// Whether the spindle is turned round at its end.
    fn taps(&self) -> bool {
        self.thread.tapping.is_some()
    }
}

/// The axes along a thread.
#[derive(Clone, Copy, Debug)]
struct Motion<const N: usize> {
    begun: ThreadMove<N>,
    follower: Follower,
    /// Where it begins, mm.
    from: [f64; N],
    /// For so many cycles it may still wait for the spindle.
    patience: u64,
    /// Setpoints in step so far.
    in_step: u32,
    /// For so many cycles the spindle has not turned as it was told to.
    slow: u64,
    /// By how much the axes were out of step with the spindle at most, as both were measured, mm; `None` while that
    /// cannot be told.
    off: Option<f64>,
}

/// What is known of threads.
#[derive(Clone, Copy, Debug)]
pub(super) struct Threading<const N: usize> {
    next: Option<ThreadMove<N>>,
    line: u32,
    motion: Option<Motion<N>>,
    /// An operator holds the path, once the thread is over.
    paused: bool,
    /// Why the setpoints went on without the spindle.
    lost: Option<LostStep>,
}

impl<const N: usize> Threading<N> {
    pub(super) fn new() -> Self {
        Self {
            next: None,
            line: 0,
            motion: None,
            paused: false,
            lost: None,
        }
    }

    /// Whether the axes are on their way along one.
    pub(super) fn has_begun(&self) -> bool {
        self.motion.is_some_and(|it| it.follower.has_begun())
    }

    /// Whether the axes move, or rest, for one.
    pub(super) fn is_active(&self) -> bool {
        self.motion.is_some()
    }

    /// Its program line while it is under way.
    pub(super) fn line(&self) -> Option<u32> {
        self.is_active().then_some(self.line)
    }

    /// Ends it where it is, for good.
    pub(super) fn abort(&mut self) {
        *self = Self::new();
    }

    /// Its line, if it has begun to tap.
    pub(super) fn taps(&self) -> Option<u32> {
        let motion = self.motion.as_ref().filter(|it| it.begun.taps());
        motion
            .filter(|it| it.follower.has_begun())
            .map(|_| self.line)
    }

    /// Takes what the program asks for at its next stop.
    pub(super) fn take(&mut self, next: ThreadMove<N>) {
        self.next = Some(next);
    }

    /// Whether the path is to be held at its end.
    pub(super) fn is_paused(&self) -> bool {
        self.paused
    }

    /// Has the path held at its end, or not.
    pub(super) fn pause(&mut self, paused: bool) {
        self.paused = paused;
    }
}

impl<const N: usize> Motion<N> {
    /// The state of the follower as the axes have it, of a path that rests in `here`.
    fn setpoint(&self, here: Setpoint<N>) -> Setpoint<N> {
        let ThreadMove { to, direction, .. } = self.begun;
        let (state, jerk) = (self.follower.state(), self.follower.jerk());
        let along = |by: f64| direction.map(|share| share * by);
        let position = |at: usize| match direction[at] {
            0.0 => self.from[at],
            _ if self.follower.is_over() && !self.begun.taps() => to[at],
            _ if self.follower.is_over() => self.from[at],
            share => self.from[at] + share * state.p,
        };
        Setpoint {
            position: std::array::from_fn(position),
            velocity: along(state.v),
            acceleration: along(state.a),
            jerk: along(jerk),
            speed: state.v.abs(),
            busy: true,
            off_path: true,
            ..here
        }
    }
}

impl<const N: usize> Controller<N> {
    /// The path rests where the program cuts a thread.
    pub(super) fn begin_thread(&mut self, line: u32) {
        let held = self.executor.is_held();
        let Some(begun) = self.threading.next.filter(|_| !held) else {
            return;
        };
        let speed = turning(self.switches.functions.spindle).abs() / 60.0;
        let patience = Duration::from_secs_f64(SETTLING + TURNS / speed.max(1e-3));
        let period = self.layout.cycle.as_secs_f64();
        self.threading.line = line;
        self.threading.lost = None;
        self.threading.motion = Some(Motion {
            begun,
            follower: Follower::new(begun.thread, begun.limits, period),
            from: self.planned.position,
            patience: self.cycles(patience),
            in_step: 0,
            slow: 0,
            off: None,
        });
    }

    /// The setpoint of a SYNC that is so many cycles ahead, if the axes are on a thread. Where they cannot stay in step they
    /// come to rest as soon as they can, and [`lost_step`](Self::lost_step) tells why.
    pub(super) fn follow_spindle(&mut self, ahead: f64) -> Option<Setpoint<N>> {
        let motion = self.threading.motion.as_mut()?;
        let period = self.layout.cycle.as_secs_f64();
        let [next, lag] = [ahead, self.layout.lag].map(|cycles| cycles * period);
        let spindle = self.spindle.angle_mut();
        let lost = motion.follower.advance(spindle, next, lag).err();
        motion.in_step += u32::from(motion.follower.is_in_step());
        if lost.is_none() {
            return Some(motion.setpoint(self.executor.setpoint()));
        }
        self.threading.lost = lost;
        self.leave_thread();
        None
    }

    /// How fast the spindle is told to turn, 1/min, negative counterclockwise: by the program, or turned round by a tap.
    pub(super) fn spindle_speed(&self) -> f64 {
        let motion = self.threading.motion.as_ref();
        let turned_round = motion.and_then(|it| it.follower.spindle_speed());
        let by_program = || turning(self.switches.functions.spindle);
        turned_round.map_or_else(by_program, |turns| 60.0 * turns)
    }

    /// The axes come to rest from wherever they are on a thread.
    pub(super) fn leave_thread(&mut self) {
        self.tell_tap_left();
        let travel = self.travel();
        self.executor.stop_beside(&self.planned, &travel);
        self.shaping.bypass();
        self.threading.motion = None;
    }

    /// Tells an operator who may have a tap in the work that it stays there.
    pub(super) fn tell_tap_left(&mut self) {
        if let Some(line) = self.threading.taps() {
            self.tell(Event::TapLeft { line });
        }
    }

    /// Why the setpoints of this cycle went on without the spindle, if they did.
    pub(super) fn lost_step(&mut self) -> Option<Fault> {
        let failure = ThreadFailure::LostStep(self.threading.lost.take()?);
        let line = self.threading.line;
        Some(Fault::Block(line, BlockCause::Thread(failure)))
    }

    /// Goes on with a thread by a cycle, as far as that is not a matter of setpoints.
    ///
    /// # Errors
    /// The spindle does not turn as it is told to.
    pub(super) fn step_thread(&mut self) -> Result<(), Fault> {
        let off = self.out_of_step();
        let told = self.spindle_speed() / 60.0;
        let fastest = turning(self.switches.functions.spindle).abs() / 60.0;
        let turned = self.spindle.angle().after(0.0, RippleLimits::NONE).speed;
        let most_slow = self.cycles(SLOW);
        let paused = self.threading.paused;
        let turns = self.switches.functions.spindle.turning;
        let Some(motion) = &mut self.threading.motion else {
            return Ok(());
        };
        if let Some(off) = off {
            motion.off = Some(motion.off.map_or(off, |most| most.max(off)));
        }
        // One that is too fast is followed up to what the axes can; in a tap it may be one that does not turn round.
        let behind = match motion.begun.taps() {
            true => (told - turned).abs(),
            false => (told - turned) * told.signum(),
        };
        let is_slow = behind > 0.5 * fastest;
        motion.slow = if is_slow { motion.slow + 1 } else { 0 };
        let Motion {
            begun,
            follower,
            patience,
            slow,
            off,
            ..
        } = motion;
        if follower.is_over() {
            let (line, number, off) = (self.threading.line, begun.number, *off);
            self.tell(Event::Threaded { line, off });
            self.threading.abort();
            self.replan_behind(number, None, paused);
            return Ok(());
        }
        let not_turning = Fault::Block(
            self.threading.line,
            BlockCause::Thread(ThreadFailure::NotTurning),
        );
        if follower.has_begun() {
            return match *slow > most_slow {
                true => Err(not_turning),
                false => Ok(()),
            };
        }
        if paused {
            self.threading.motion = None;
            self.threading.paused = false;
            self.executor.feed_hold();
            return Ok(());
        }
        *patience = patience.saturating_sub(1);
        if *patience == 0 || turns == Turning::Off {
            return Err(not_turning);
        }
        Ok(())
    }

    /// By how much the measured axes are away from where the measured spindle wants them, mm, where that can be told.
    fn out_of_step(&self) -> Option<f64> {
        let motion = self.threading.motion?;
        let spindle = self.sample_spindle().filter(|it| it.age == 0)?;
        let settled = self.cycles(SETTLED) as u32;
        if motion.in_step < settled || !motion.follower.is_in_step() {
            return None;
        }
        let mut along = 0.0;
        for axis in self.layout.path_axes() {
            let at = axis.coordinate;
            along += (self.row?.axes[at].act - motion.from[at]) * motion.begun.direction[at];
        }
        Some((motion.follower.wanted_at(spindle.turns) - along).abs())
    }
}
