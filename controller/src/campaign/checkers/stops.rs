//! After every cause the setpoints come to rest in time, and stay there until a person acted.
//!
//! The bound is the checker's own. On a line the path's speed, acceleration and jerk are each held by some
//! axis, so that a stop takes no longer than v/a + a/j of the axes that are worst at each; curves take part
//! of an acceleration for the bend, so that [`CURVED`] times that is allowed. Where the planner has to
//! answer first, or does nothing because it is starved, the path goes on meanwhile.
//!
//! A continuous jog that nobody renews is such a cause, and so is a door that is opened, or the input for feed hold, while
//! axes may move. Where an operator stops a job, and nothing is wrong, the axes stay on its path: by what operators are shown, and as
//! long as they are shown that, the verdict holds the path against the program.

use super::super::interference::{Interference, ToDrive};
use super::super::machine::Wire;
use super::super::stage::Played;
use super::carriage::taken_up;
use super::{Checker, Found, Scene};
use crate::control::{self, State};
use crate::session::{Command, Event, Jog};
use syncline_canopen::Instant;
use syncline_canopen::time::Duration;
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

/// What a door, or the input for feed hold, is to the table of causes.
const INPUT: &str = "an input";
/// An input that goes off sooner need not have been seen: a door is debounced for 20 ms, s.
const SEEN: f64 = 0.1;
/// How long a continuous jog goes on without being renewed ([guide.md](../../../../docs/guide.md)).
const HOLD_TO_RUN: Duration = Duration::from_millis(200);

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
    /// The axis that is jogged on and on, and when somebody last said so.
    jog: Option<(usize, Instant)>,
    /// The inputs that hold the path and are on: device, and place there.
    holding: Vec<(usize, u8)>,
    /// A job was stopped on its path, and does not rest yet.
    stays: bool,
    /// Another command took effect in this wake-up.
    commanded: bool,
}

/// How long the stops of a case took.
#[derive(Clone, Debug, Default)]
pub struct StopTimes(pub Vec<StopTime>);

/// How long one took.
#[derive(Clone, Copy, Debug)]
pub struct StopTime {
    /// Its cause.
    pub cause: &'static str,
    /// When that was.
    pub since: Instant,
    /// Cycles from there to the last setpoint that changed.
    pub cycles: u64,
}

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
            jog: None,
            holding: Vec::new(),
            stays: false,
            commanded: false,
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
        self.end(scene, |stop| {
            ["feed hold", "stop", INPUT].contains(&stop.cause)
        });
    }

    /// A stop of this kind is over; how long it took is known if the setpoints rest.
    fn end(&mut self, scene: &Scene<'_>, is_over: impl Fn(&Stop) -> bool) {
        let stop = self.stop.take_if(|stop| is_over(stop));
        if let Some(stop) = stop.filter(|stop| scene.since(stop.moved) > RESTS * scene.period()) {
            let (cause, since) = (stop.cause, stop.since);
            let took = stop.moved.saturating_since(since).as_nanos();
            let cycles = (took / scene.machine.cycle.as_nanos()) as u64;
            self.times.0.push(StopTime {
                cause,
                since,
                cycles,
            });
        }
    }

    /// How long a stop takes at the most, s.
    fn bound(&self, scene: &Scene<'_>) -> f64 {
        let smooth = CURVED * self.line + self.shaped + self.taken_up;
        smooth + ANSWER + CYCLES * scene.period()
    }

    /// An axis moves that nobody has jogged on for too long.
    fn jogged_on(&mut self, scene: &Scene<'_>, moved: &[usize], found: &mut Found) {
        let Some((axis, since)) = self.jog else {
            return;
        };
        let spec = &scene.machine.axes[axis];
        let (goes_on, bound) = (
            scene.since(since),
            HOLD_TO_RUN.as_secs_f64() + self.bound(scene),
        );
        if goes_on > bound && spec.drives.iter().any(|drive| moved.contains(drive)) {
            found.violate(NAME, scene, "a jog that nobody renews goes on", || {
                let name = spec.name();
                format!("axis {name} moves {goes_on} s later; allowed {bound} s")
            });
        }
    }

    /// What an operator's command is to a jog that goes on and on.
    fn jogs(&mut self, scene: &Scene<'_>, command: &Command) {
        let place = |letter| (scene.machine.axes.iter()).position(|axis| axis.letter == letter);
        match *command {
            Command::Jog(Jog::Continuous { axis, .. }) => {
                self.jog = place(axis).map(|axis| (axis, scene.now));
            }
            Command::RenewJog(letter) => {
                if let Some((axis, since)) = &mut self.jog
                    && place(letter) == Some(*axis)
                {
                    *since = scene.now;
                }
            }
            ref other if moves_nothing(other) => {}
            _ => self.jog = None,
        }
    }

    /// An input is switched: one that holds the path is a cause like any other where it can have been seen.
    fn switched(&mut self, scene: &Scene<'_>, device: usize, place: u8, on: bool) {
        if !(scene.case.machine).has_wire(device, place, Wire::holds) {
            // A person may go on by an input too.
            self.set_in_motion(scene);
            self.jog = None;
            return;
        }
        let known = self.holding.iter().position(|it| *it == (device, place));
        match (known, on) {
            (None, true) => {
                self.holding.push((device, place));
                if scene.bursts_are_on_time() && may_move(scene.state) {
                    self.begin(scene, INPUT);
                }
            }
            (Some(known), false) => {
                self.holding.swap_remove(known);
                self.end(scene, |stop| {
                    stop.cause == INPUT && scene.since(stop.since) < SEEN
                });
            }
            _ => {}
        }
    }
}

/// Whether a command sets nothing in motion that rests, nor stops what moves.
fn moves_nothing(command: &Command) -> bool {
    matches!(
        command,
        Command::RenewJog(_)
            | Command::EndJog(_)
            | Command::JogStep(_)
            | Command::FeedOverride(_)
            | Command::RapidOverride(_)
            | Command::SingleBlock(_)
            | Command::OptionalStop(_)
            | Command::Load(_)
    )
}

/// Whether an operator's feed hold does something.
fn may_move(state: State) -> bool {
    use State::{Held, Homing, Jogging, Mdi, Running};
    matches!(state, Homing | Jogging | Mdi | Running | Held)
}

impl Checker for Stops {
    fn sync(&mut self, scene: &Scene<'_>, bus: usize, found: &mut Found) {
        let mut moved = Vec::new();
        for &drive in scene.drives_of(bus) {
            let it = &scene.drives[drive];
            let latched = it.latched.filter(|_| it.in_effect);
            let before = std::mem::replace(&mut self.latched[drive], latched);
            // One without power goes nowhere, whatever it latches: as its bus is back, what came before that was gone.
            let has_power = (scene.plants.get(drive)).is_some_and(|plant| plant.is_powered);
            if latched.is_some() && before.is_some() && latched != before && has_power {
                moved.push(drive);
            }
        }
        self.jogged_on(scene, &moved, found);
        let Some(&drive) = moved.last() else {
            return;
        };
        let Some(mut stop) = self.stop.take() else {
            return;
        };
        stop.moved = scene.now;
        let took = scene.since(stop.since);
        let bound = self.bound(scene) + stop.longer;
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
            Interference::Drive(device, ToDrive::Input(place, on)) => {
                self.switched(scene, *device, *place, *on);
                0.0
            }
            _ => 0.0,
        };
        if !scene.bursts_are_on_time() {
            // It may not have been heard of.
            self.end(scene, |stop| stop.cause == INPUT);
            self.jog = None;
        }
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
                (self.jog, self.stays) = (None, false);
            }
            Event::Accepted(it) => {
                self.jogs(scene, &it.command);
                let on_path = matches!(scene.state, State::Running | State::Mdi)
                    && !scene.off_path
                    && !self.commanded;
                match it.command {
                    Command::Stop | Command::Disable | Command::SwitchOff => {
                        self.stays |= on_path && !scene.faulted;
                    }
                    _ => self.commanded = true,
                }
                match it.command {
                    Command::Stop if !scene.faulted => self.begin(scene, "stop"),
                    Command::Disable => self.begin(scene, "disable"),
                    Command::SwitchOff => self.begin(scene, "switch off"),
                    Command::FeedHold => self.begin(scene, "feed hold"),
                    Command::Reset | Command::Enable => self.end(scene, |_| true),
                    ref other if moves_nothing(other) => {}
                    _ => self.set_in_motion(scene),
                }
            }
            Event::State(State::Stopping) => {}
            Event::State(_) => self.stays = false,
            _ => {}
        }
    }

    fn woken(&mut self, scene: &Scene<'_>, found: &mut Found) {
        self.commanded = false;
        if self.stays && scene.off_path {
            self.stays = false;
            found.violate(NAME, scene, "an operator's stop leaves the path", || {
                format!("machine {}", scene.state)
            });
        }
    }

    fn ended(&mut self, scene: &Scene<'_>, _: &Played, _: &mut Found) {
        self.end(scene, |_| true);
    }
}
