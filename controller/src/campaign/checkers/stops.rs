//! After every cause the setpoints come to rest in time, and stay there until a person acted.
//!
//! The bound is the checker's own. On a line the path's speed, acceleration and jerk are each held by some
//! axis, so that a stop takes no longer than v/a + a/j of the axes that are worst at each; curves take part
//! of an acceleration for the bend, so that [`CURVED`] times that is allowed. Where the planner has to
//! answer first, or does nothing because it is starved, the path goes on meanwhile.

use super::super::interference::{Interference, ToDrive};
use super::super::stage::Played;
use super::carriage::taken_up;
use super::{Checker, Found, Scene};
use crate::control;
use crate::session::{Command, Event};
use syncline_canopen::Instant;
use syncline_drives::model::Increments;

const NAME: &str = "stops";

/// Times of a stop on a line that one on a curve may take.
const CURVED: f64 = 3.0;
/// Periods of a mode that the longest shaper takes, with damping: one and a half without.
const PERIODS: f64 = 1.7;
/// What a stop may take besides, s: until the planner has answered, and cycles of many milliseconds.
const ANSWER: f64 = 0.3;
/// The same, cycles.
const CYCLES: f64 = 12.0;

/// Setpoints that have not changed for so long rest, cycles.
const RESTS: f64 = 3.0;

/// What is to stop, and where a stop takes how long.
pub(super) struct Stops {
    /// v/a + a/j of the worst axes, s.
    line: f64,
    /// The longest that a shaper of these modes goes on, s.
    shaped: f64,
    /// The longest that a backlash is taken up, s.
    taken_up: f64,
    stop: Option<Stop>,
    /// How long they took.
    pub(super) times: StopTimes,
    /// By drive: what it latched last.
    latched: Vec<Option<Increments>>,
}

/// From a cause to the last setpoint that changed, in cycles, by the cause.
#[derive(Clone, Debug, Default)]
pub struct StopTimes(pub Vec<(&'static str, u64)>);

struct Stop {
    cause: &'static str,
    since: Instant,
    /// When a setpoint changed last.
    moved: Instant,
    /// May take so much longer, s.
    longer: f64,
}

impl Stops {
    pub(super) fn new(scene: &Scene<'_>) -> Self {
        let (case, machine) = (scene.case, scene.machine);
        let modes = case.machine.shaper.iter().flat_map(|it| &it.modes);
        let worst = |of: fn(&crate::machine::AxisLimits) -> f64| {
            let axes = machine.axes.iter().map(|axis| of(&axis.limits));
            axes.fold(0.0, f64::max)
        };
        Self {
            line: worst(|limits| limits.velocity / limits.acceleration)
                + worst(|limits| limits.acceleration / limits.jerk),
            shaped: modes.map(|(frequency, _)| PERIODS / frequency).sum(),
            taken_up: (0..machine.axes.len())
                .map(|axis| taken_up(scene, axis))
                .fold(0.0, f64::max),
            stop: None,
            times: StopTimes::default(),
            latched: vec![None; machine.drives.len()],
        }
    }

    fn begin(&mut self, scene: &Scene<'_>, cause: &'static str) {
        if self.stop.is_none() {
            let starved = scene
                .interferences
                .iter()
                .filter_map(|(at, what)| match what {
                    Interference::StarvePlanner(wake_ups) => {
                        let lasts = f64::from(*wake_ups) * scene.period();
                        (scene.since(*at) < lasts).then_some(lasts)
                    }
                    _ => None,
                });
            self.stop = Some(Stop {
                cause,
                since: scene.now,
                moved: scene.now,
                longer: starved.sum(),
            });
        }
    }

    /// What only rests may be set in motion again.
    fn set_in_motion(&mut self, scene: &Scene<'_>) {
        self.end(scene, |stop| ["feed hold", "stop"].contains(&stop.cause));
    }

    /// A stop of this kind is over; how long it took is known if the setpoints rest.
    fn end(&mut self, scene: &Scene<'_>, is_over: impl Fn(&Stop) -> bool) {
        let stop = self.stop.take_if(|stop| is_over(stop));
        if let Some(stop) = stop.filter(|stop| scene.since(stop.moved) > RESTS * scene.period()) {
            let took = stop.moved.saturating_since(stop.since).as_nanos();
            let cycles = took / scene.machine.cycle.as_nanos();
            self.times.0.push((stop.cause, cycles as u64));
        }
    }

    fn bound(&self, scene: &Scene<'_>, stop: &Stop) -> f64 {
        let smooth = CURVED * self.line + self.shaped + self.taken_up;
        smooth + ANSWER + CYCLES * scene.period() + stop.longer
    }
}

impl Checker for Stops {
    fn sync(&mut self, scene: &Scene<'_>, bus: usize, found: &mut Found) {
        let mut moved = None;
        for &drive in scene.drives_of(bus) {
            let it = &scene.drives[drive];
            let latched = it.latched.filter(|_| it.in_effect);
            let before = std::mem::replace(&mut self.latched[drive], latched);
            if latched.is_some() && before.is_some() && latched != before {
                moved = Some(drive);
            }
        }
        let Some(drive) = moved else {
            return;
        };
        let Some(mut stop) = self.stop.take() else {
            return;
        };
        stop.moved = scene.now;
        let (took, bound) = (scene.since(stop.since), self.bound(scene, &stop));
        if took > bound {
            found.violate(
                NAME,
                scene,
                "not at rest in time, or in motion again",
                || {
                    let name = &scene.machine.drives[drive].name;
                    format!(
                        "drive {name} moves {took} s after: {}; allowed {bound} s",
                        stop.cause
                    )
                },
            );
        }
        self.stop = Some(stop);
    }

    fn interfered(&mut self, scene: &Scene<'_>, what: &Interference, _: &mut Found) {
        let longer = match what {
            Interference::Late(micros) => f64::from(*micros) * 1e-6,
            Interference::StarvePlanner(wake_ups) => f64::from(*wake_ups) * scene.period(),
            Interference::Drive(_, ToDrive::Input(..)) => {
                // A person may go on by an input too.
                self.set_in_motion(scene);
                0.0
            }
            _ => 0.0,
        };
        if let Some(stop) = &mut self.stop {
            stop.longer += longer;
        }
    }

    fn told(&mut self, scene: &Scene<'_>, event: &Event, _: &mut Found) {
        match event {
            Event::Machine(control::Event::Fault(_)) => {
                // It stops more than a feed hold does: nobody resumes it.
                self.end(scene, |stop| stop.cause == "feed hold");
                self.begin(scene, "fault");
            }
            Event::Accepted(it) => match it.command {
                Command::Stop if !scene.faulted => self.begin(scene, "stop"),
                Command::Disable => self.begin(scene, "disable"),
                Command::SwitchOff => self.begin(scene, "switch off"),
                Command::FeedHold => self.begin(scene, "feed hold"),
                Command::Reset | Command::Enable => self.end(scene, |_| true),
                _ => self.set_in_motion(scene),
            },
            _ => {}
        }
    }

    fn ended(&mut self, scene: &Scene<'_>, _: &Played, _: &mut Found) {
        self.end(scene, |_| true);
    }
}
