//! Why a job rests: for an operator, who ends a [`Pause`] or a [`Hold`], or by itself, until what it is [`Waiting`] for has
//! come.
//!
//! Whenever a job is at work and nothing moves there is one reason, and it is looked up in what the cycle goes by.

use super::axis::AxisControl;
use super::fault::Names;
use super::inputs::InputIndex;
use super::user_codes::GRACE;
use super::{Controller, Event, Phase, StopPoint};
use crate::machine::{COORDINATES, InputMeaning};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::mem::{Discriminant, discriminant};
use syncline_canopen::time::Duration;
use syncline_gcode::AxisLetter;
use syncline_trajectory::path::Dwell;

/// A rest that lasts so long is told with its reason.
const TOLD_AFTER: Duration = Duration::from_secs(2);

/// Why a program waits for an operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pause {
    /// M0.
    ProgramStop,
    /// M1.
    OptionalStop,
    /// It begins at this line, in the middle.
    Beginning,
    /// It is begun in its middle, and the way there goes on with a leg that was told.
    NextLeg,
    /// M6 with this tool.
    ToolChange(u32),
    /// M66: the input with this number did not come in time.
    NoInput(u8),
    /// The spindle did not reach its speed in time.
    NotAtSpeed,
    /// M19: the spindle did not come to its angle in time.
    NotOriented,
    /// The command of this M-code of the user's failed, or took too long.
    UserCode(u16),
}

/// What holds a path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Hold {
    /// An operator: a feed hold, or a single block.
    #[default]
    Operator,
    /// An input that came on: a door, or a feed hold that is wired.
    Input(InputIndex),
    /// The spindle has lost its speed while it cuts.
    Spindle,
    /// Nothing is left of the programmed speed.
    NoSpeed(ZeroOverrides),
}

/// Which overrides leave nothing of the programmed speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ZeroOverrides {
    /// The feed override is 0.
    pub feed: bool,
    /// The rapid override is 0.
    pub rapid: bool,
}

/// What a job at work waits for while nothing moves and no operator holds it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Waiting {
    /// An override that is raised: nothing is left of the programmed speed.
    Override(ZeroOverrides),
    /// The plan of what comes next.
    Plan,
    /// The end of a dwell.
    Dwell {
        /// How long it still takes, s.
        left: f64,
    },
    /// An input of the machine.
    Input {
        /// Its place in the machine file.
        input: InputIndex,
        /// It is waited for until it is on, or comes on; otherwise off.
        on: bool,
        /// How long it is still waited for, s.
        left: f64,
    },
    /// The spindle is to have its speed.
    SpindleSpeed {
        /// How long it is still waited for, s.
        left: f64,
    },
    /// The spindle is to come to its angle.
    SpindleAngle {
        /// How long it is still waited for, s.
        left: f64,
    },
    /// The spindle is to be where a thread begins.
    Thread,
    /// Drives are to take what a probing asks of them, or to tell what it found.
    Probing,
    /// Axes that go point to point are to be where they go.
    PointToPoint {
        /// By letter: whether the axis goes somewhere.
        axes: [bool; COORDINATES],
    },
    /// The command of an M-code of the user's is to end.
    UserCode {
        /// The code.
        code: u16,
        /// How long that may still take, s.
        left: f64,
    },
    /// Motion that others have planned rests there.
    Samples,
    /// What axes are sent beside the plan is to come to rest: backlash that is taken up, sides that come together.
    Corrections,
}

/// What a job has rested for, and since when.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RestsFor {
    what: Option<Discriminant<Waiting>>,
    since: u64,
}

impl fmt::Display for Pause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ProgramStop => f.write_str("program stop (M0)"),
            Self::OptionalStop => f.write_str("optional stop (M1)"),
            Self::Beginning => f.write_str("the program begins here once it is confirmed"),
            Self::NextLeg => f.write_str("on the way back to the path, waits for cycle start"),
            Self::NoInput(number) => write!(f, "input P{number} did not come in time (M66)"),
            Self::NotAtSpeed => f.write_str("the spindle did not reach its speed in time"),
            Self::NotOriented => f.write_str(
                "the spindle did not come to its angle in time: free it; cycle start waits for it once more",
            ),
            Self::UserCode(code) => {
                write!(
                    f,
                    "the command of M{code} failed or took too long; cycle start goes on without it"
                )
            }
            Self::ToolChange(0) => f.write_str("tool change (M6): remove the tool"),
            Self::ToolChange(tool) => write!(f, "tool change (M6): load tool {tool}"),
        }
    }
}

impl fmt::Display for ZeroOverrides {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match (self.feed, self.rapid) {
            (true, true) => "the feed and the rapid override are 0: raise them to go on",
            (false, true) => "the rapid override is 0: raise it to go on",
            (true, false) | (false, false) => "the feed override is 0: raise it to go on",
        })
    }
}

impl Hold {
    /// That the path is held, and what to do.
    pub(super) fn describe(self, names: &impl Names) -> String {
        match self {
            Self::Operator => "feed hold: held on the path".to_owned(),
            Self::Input(input) => format!(
                "input \"{}\" holds the path: once it is off, resume goes on",
                names.input(input)
            ),
            Self::Spindle => {
                "the spindle has lost its speed: the path is held; resume goes on, also without it"
                    .to_owned()
            }
            Self::NoSpeed(overrides) => format!("held on the path: {overrides}"),
        }
    }
}

impl Waiting {
    /// What it is, in words: `waits for input "clamped" on, 2.4 s left`. `input` names an input by its place in the machine file.
    #[must_use]
    pub fn describe<'a>(&self, input: impl FnOnce(InputIndex) -> &'a str) -> String {
        let on = |on: bool| if on { "on" } else { "off" };
        let what = match *self {
            Self::Override(overrides) => return overrides.to_string(),
            Self::Dwell { left } => return format!("dwells, {left:.1} s left"),
            Self::Plan => "the plan of what comes next".to_owned(),
            Self::Input {
                input: at,
                on: level,
                left,
            } => format!("input \"{}\" {}, {left:.1} s left", input(at), on(level)),
            Self::SpindleSpeed { left } => format!("the spindle's speed, {left:.1} s left"),
            Self::SpindleAngle { left } => format!("the spindle's angle, {left:.1} s left"),
            Self::Thread => "the spindle, where the thread begins".to_owned(),
            Self::Probing => "the drives, for the probing".to_owned(),
            Self::PointToPoint { axes } => {
                let axes = AxisLetter::ALL.iter().zip(axes).filter(|(_, goes)| *goes);
                let axes: Vec<_> = axes.map(|(axis, _)| axis.letter().to_string()).collect();
                format!("{}, point to point", axes.join(" "))
            }
            Self::UserCode { code, left } => {
                format!("the command of M{code}, {left:.1} s left")
            }
            Self::Samples => "its samples, which rest here".to_owned(),
            Self::Corrections => {
                "backlash that is taken up, or sides that come together".to_owned()
            }
        };
        format!("waits for {what}")
    }

    /// Whether a program that is well waits like this, so that it is no news.
    #[must_use]
    pub fn is_routine(&self) -> bool {
        matches!(self, Self::Dwell { .. } | Self::Samples | Self::Corrections)
    }
}

impl<const N: usize> Controller<N> {
    /// What the job at work waits for, where nothing moves and no operator holds it.
    pub(super) fn waits_for(&self) -> Option<Waiting> {
        let at_work = self.job.is_some() && self.phase == Phase::Program;
        let moves = self.planned.velocity.iter().any(|by| *by != 0.0);
        let overrides = self.zero_overrides();
        // Jogged, or on the way back to the path.
        if self.phase == Phase::Program && overrides.rapid && !moves && self.executor.is_jogged() {
            return Some(Waiting::Override(ZeroOverrides {
                feed: false,
                ..overrides
            }));
        }
        if !at_work || moves || self.pause_told || self.homing.is_active() {
            return None;
        }
        if self.probing.is_active() {
            return match overrides.feed || overrides.rapid {
                _ if self.probing.is_paused() => None,
                true => Some(Waiting::Override(overrides)),
                false => Some(Waiting::Probing),
            };
        }
        if self.threading.is_active() {
            return (!self.threading.is_paused()).then_some(Waiting::Thread);
        }
        if self.along_samples.is_active() {
            return Some(Waiting::Samples);
        }
        let corrects = !self.axes.iter().all(AxisControl::is_compensated);
        if self.executor.is_held() {
            return match self.executor.wants_speed() {
                true => Some(Waiting::Override(overrides)),
                false => corrects.then_some(Waiting::Corrections),
            };
        }
        if self.executor.is_off_path() || !self.shaping.is_settled() {
            return None;
        }
        if self.executor.mark().is_some() && corrects {
            return Some(Waiting::Corrections);
        }
        match self.reached() {
            Some(stop) => self.waits_at(stop),
            None => match self.executor.dwell() {
                Some(Dwell { left, .. }) => Some(Waiting::Dwell { left }),
                None => (self.executor.wants_plan()).then_some(Waiting::Plan),
            },
        }
    }

    /// The same at a mark of the plan.
    fn waits_at(&self, stop: StopPoint) -> Option<Waiting> {
        let period = self.layout.cycle.as_secs_f64();
        let left = |within: Duration, since: Option<u64>| {
            let waited = since.map_or(0, |since| self.cycle.saturating_sub(since));
            (within.as_secs_f64() - waited as f64 * period).max(0.0)
        };
        match stop {
            StopPoint::AwaitInput { wait, .. } => {
                let left = left(wait.within, self.awaited_since());
                let named = |it: &crate::machine::Input| it.meaning == wait.input;
                let input = self.layout.inputs.iter().position(named);
                Some(match (wait.input, input) {
                    (InputMeaning::Program(_), Some(input)) => Waiting::Input {
                        input,
                        on: wait.until.is_on(),
                        left,
                    },
                    _ => Waiting::SpindleSpeed { left },
                })
            }
            StopPoint::Orient { .. } => {
                let within = self.orients_within()?;
                let left = left(within, self.awaited_since());
                Some(Waiting::SpindleAngle { left })
            }
            StopPoint::UserCode { call, within, .. } => {
                let left = left(within + GRACE, self.calls.since());
                let code = call.code;
                Some(Waiting::UserCode { code, left })
            }
            StopPoint::PointToPoint { motion, .. } => {
                let overrides = self.zero_overrides();
                let zero = match motion.speed {
                    Some(_) => overrides.feed,
                    None => overrides.rapid,
                };
                Some(match self.positioning.is_none() && zero {
                    true => Waiting::Override(overrides),
                    false => Waiting::PointToPoint {
                        axes: motion.targets.map(|target| target.is_some()),
                    },
                })
            }
            _ => None,
        }
    }

    pub(super) fn zero_overrides(&self) -> ZeroOverrides {
        let set = self.executor.overrides();
        ZeroOverrides {
            feed: set.feed == 0.0,
            rapid: set.rapid == 0.0,
        }
    }

    /// The overrides that have the job rest, if it is they.
    pub(super) fn rests_for_speed(&self) -> Option<ZeroOverrides> {
        match self.waits_for()? {
            Waiting::Override(overrides) => Some(overrides),
            _ => None,
        }
    }

    /// What holds the path that has come to rest.
    pub(super) fn holds(&self) -> Hold {
        match self.executor.wants_speed() {
            true => Hold::NoSpeed(self.zero_overrides()),
            false => self.held_by,
        }
    }

    /// Tells that the path is held, and by what, or that it goes on.
    pub(super) fn tell_hold(&mut self, rests: bool) {
        let hold = self.holds();
        if rests && (!self.held || hold != self.told_hold) {
            self.told_hold = hold;
            self.tell(Event::Held(hold));
        } else if !rests && self.held {
            self.held_by = Hold::Operator;
            let pause = self.reached().filter(|_| self.pause_told);
            self.tell(match pause {
                Some(StopPoint::Pause { reason, line }) => Event::StillPaused { line, reason },
                _ if self.executor.retraces() => Event::Retracing,
                _ => Event::Resumed,
            });
        }
        self.held = rests;
    }

    /// Tells what the job rests for, once that has lasted. A hold tells that itself.
    pub(super) fn tell_waiting(&mut self) {
        let reads = self.job.is_some_and(|job| job.waits_for_input);
        let waiting = self.waits_for().filter(|it| match it {
            // It comes when it comes.
            Waiting::Plan => !reads,
            _ => !self.held,
        });
        let what = waiting.as_ref().map(discriminant);
        if what != self.rests_for.what {
            let since = self.cycle;
            self.rests_for = RestsFor { what, since };
        }
        if let Some(waiting) = waiting
            && self.cycle - self.rests_for.since == self.cycles(TOLD_AFTER)
        {
            self.tell(Event::Waits(waiting));
        }
    }
}
