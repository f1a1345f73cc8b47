//! How long a program takes from any place on its path to its end.
//!
//! The plan is the program's own, made by the planner that runs it and walked with nobody following. A place is its
//! distance along the path, so that holds, overrides and steps back change nothing. What is kept does not grow with
//! the program: stretches of it, of some tenths of a second, and longer ones where there would be too many.

use super::{Moves, Program, ProgramError};
use crate::control::{Instruction, StopPoint};
use crate::machine::{COORDINATES, Position};
use std::collections::VecDeque;
use syncline_trajectory::path::{Command as PathCommand, Executor, JerkSegment, Overrides};

/// Stretches are kept that are so long at first, s.
const STRETCH: f64 = 0.1;
/// Stretches that are kept at most.
const MOST_STRETCHES: usize = 1 << 16;
/// Steps of the plan that may still be replaced.
const REPLACEABLE: usize = Executor::<COORDINATES>::MOST_STEPS;
/// A step during which the speed changes is cut into so many parts at most.
const MOST_PARTS: f64 = 1000.0;
/// Instructions that are walked at most: a program may never end. So many are some million blocks.
const MOST_INSTRUCTIONS: usize = 1 << 28;
/// By so much the setpoint may be off the place where it rests, mm.
const SAME_PLACE: f64 = 1e-6;

/// What a stretch of the path takes, s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Times {
    /// At programmed feeds.
    feed: f64,
    /// In rapids.
    rapid: f64,
    /// At rest.
    rest: f64,
}

impl Times {
    fn sum(self) -> f64 {
        self.feed + self.rapid + self.rest
    }

    /// Whether both are only at feeds, only rapids, or only rests.
    fn is_like(self, other: Self) -> bool {
        let kinds = |it: Self| [it.feed > 0.0, it.rapid > 0.0, it.rest > 0.0];
        kinds(self) == kinds(other)
    }

    fn add(&mut self, other: Self) {
        self.feed += other.feed;
        self.rapid += other.rapid;
        self.rest += other.rest;
    }
}

/// How long a program takes, place by place.
#[derive(Clone, Debug, Default)]
pub struct Timetable {
    /// Ends of stretches, mm from the beginning of the path, and what it takes to get there.
    ends: Vec<(f64, Times)>,
    /// The stretch that has not ended.
    open: (f64, Times),
    /// Of a stretch at most, unless a single step takes longer, s.
    stretch: f64,
    /// Of all that was walked so far.
    total: Times,
    is_whole: bool,
}

impl Program {
    /// How long it takes from `start`, as far as it is known before it runs.
    ///
    /// # Errors
    /// A block cannot be run.
    pub fn timetable(&self, start: Position) -> Result<Timetable, ProgramError> {
        let mut feeder = self.feeder(start, Moves::new().0)?;
        let settling = self.shaper.map_or(0.0, |(spread, _)| spread.settling);
        let mut walk = Walk {
            settling,
            ..Walk::default()
        };
        walk.table.stretch = STRETCH;
        for _ in 0..MOST_INSTRUCTIONS {
            let Some(instruction) = feeder.next_instruction()? else {
                break;
            };
            walk.take(&instruction);
        }
        Ok(walk.finish())
    }
}

impl Timetable {
    /// All its motion, s.
    #[must_use]
    pub fn motion(&self) -> f64 {
        self.total.feed + self.total.rapid
    }

    /// Whether it goes to the end of the program: behind a probing, a homing or a thread nothing is known before the machine has been there, and
    /// some programs have none.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.is_whole
    }

    /// How long the program takes from a place on its path, mm from the beginning, s; stops for an operator take no
    /// time. What overrides do to accelerations is left out. `None` where an override has what is left stand still.
    #[must_use]
    pub fn remaining(&self, distance: f64, overrides: Overrides) -> Option<f64> {
        let passed = self.passed(distance);
        let left = |total: f64, passed: f64, part: f64| match total - passed {
            left if left <= 0.0 => Some(0.0),
            left => (part > 0.0).then(|| left / part),
        };
        let feed = left(self.total.feed, passed.feed, overrides.feed)?;
        let rapid = left(self.total.rapid, passed.rapid, overrides.rapid)?;
        Some(feed + rapid + left(self.total.rest, passed.rest, 1.0)?)
    }

    /// What it took to get to a place; where the path rests there, to come to rest.
    fn passed(&self, distance: f64) -> Times {
        let behind = (self.ends).partition_point(|&(end, _)| end < distance - SAME_PLACE);
        let Some(&(to, after)) = self.ends.get(behind) else {
            return self.total;
        };
        let (from, before) = match behind {
            0 => (0.0, Times::default()),
            _ => self.ends[behind - 1],
        };
        let part = match to > from {
            true => ((distance - from) / (to - from)).clamp(0.0, 1.0),
            false => 0.0,
        };
        let between = |before: f64, after: f64| before + part * (after - before);
        Times {
            feed: between(before.feed, after.feed),
            rapid: between(before.rapid, after.rapid),
            rest: between(before.rest, after.rest),
        }
    }

    /// The path goes on to there.
    fn go_on(&mut self, to: f64, times: Times) {
        if times == Times::default() {
            return;
        }
        if !self.open.1.is_like(times) || self.open.1.sum() + times.sum() > self.stretch {
            self.end_stretch();
        }
        self.total.add(times);
        self.open.0 = to;
        self.open.1.add(times);
    }

    fn end_stretch(&mut self) {
        if std::mem::take(&mut self.open.1) == Times::default() {
            return;
        }
        self.ends.push((self.open.0, self.total));
        if self.ends.len() == MOST_STRETCHES {
            let mut place = 0;
            self.ends.retain(|_| {
                place += 1;
                place % 2 == 0
            });
            self.stretch *= 2.0;
        }
    }
}

/// A step of a plan.
#[derive(Clone, Copy, Debug)]
enum Step {
    /// From a place on the path, mm from its beginning, where its section begins.
    Follow {
        origin: f64,
        segment: JerkSegment,
        is_rapid: bool,
    },
    /// At a place on the path, s.
    Rest(f64, f64),
}

impl Step {
    /// Where it ends, mm from the beginning of the path.
    fn end(&self) -> f64 {
        match *self {
            Self::Follow {
                origin, segment, ..
            } => origin + segment.end(),
            Self::Rest(at, _) => at,
        }
    }
}

/// A walk along a plan.
#[derive(Default)]
struct Walk {
    table: Timetable,
    /// How long the axes take to rest behind the path, where a shaper delays them, s: no section begins before.
    settling: f64,
    /// Of the section, mm from the beginning of the path.
    origin: f64,
    /// Where path segments begin, mm from the beginning of the path, and whether they are rapids.
    rapids: VecDeque<(f64, bool)>,
    /// The latest steps.
    steps: VecDeque<Step>,
    /// How many steps came before these.
    first: u64,
}

impl Walk {
    fn take(&mut self, instruction: &Instruction<COORDINATES>) {
        match instruction {
            Instruction::Plan(command) => match *command {
                PathCommand::ReplaceTail(step) => {
                    self.steps
                        .truncate(step.saturating_sub(self.first) as usize);
                }
                PathCommand::Section { origin, .. } => {
                    self.origin = origin;
                    self.step(Step::Rest(origin, self.settles()));
                }
                PathCommand::PathSegment(segment) => {
                    let begin = self.origin + segment.start;
                    self.rapids.push_back((begin, segment.feed.is_infinite()));
                }
                PathCommand::JerkSegment(segment) => self.follow(&segment),
                PathCommand::Dwell { duration, .. } => {
                    self.step(Step::Rest(self.here(), duration));
                }
                PathCommand::Waypoint { .. } => self.step(Step::Rest(self.here(), 0.0)),
                _ => {}
            },
            Instruction::Mark { stop, .. } => {
                self.table.is_whole |= *stop == StopPoint::End;
                self.step(Step::Rest(self.here(), 0.0));
            }
            Instruction::Switch { .. }
            | Instruction::Probe(_)
            | Instruction::Thread(_)
            | Instruction::Home { .. }
            | Instruction::Found(_) => {}
        }
    }

    fn follow(&mut self, segment: &JerkSegment) {
        let middle = self.origin + (segment.distance + segment.end()) / 2.0;
        let begun = self.rapids.partition_point(|&(begin, _)| begin <= middle);
        self.step(Step::Follow {
            origin: self.origin,
            segment: *segment,
            is_rapid: begun > 0 && self.rapids[begun - 1].1,
        });
    }

    /// How long the axes still move behind the rests of the plan so far, s.
    fn settles(&self) -> f64 {
        let mut rested = 0.0;
        for step in self.steps.iter().rev() {
            match step {
                Step::Rest(_, time) => rested += time,
                Step::Follow { .. } => return (self.settling - rested).max(0.0),
            }
        }
        0.0
    }

    /// Where the plan ends so far.
    fn here(&self) -> f64 {
        (self.steps.back()).map_or(self.table.open.0, Step::end)
    }

    /// The plan goes on with a step.
    fn step(&mut self, step: Step) {
        self.steps.push_back(step);
        if self.steps.len() > REPLACEABLE {
            self.pass();
        }
    }

    /// The first step will not be replaced any more.
    fn pass(&mut self) {
        let Some(step) = self.steps.pop_front() else {
            return;
        };
        self.first += 1;
        let end = step.end();
        match step {
            Step::Follow {
                origin,
                segment,
                is_rapid,
            } => {
                // While the speed changes, places between two are not where they would be at an even one.
                let parts = match (segment.acceleration, segment.jerk) {
                    (0.0, 0.0) => 1.0,
                    _ => (segment.duration / STRETCH).ceil().clamp(1.0, MOST_PARTS),
                };
                let time = segment.duration / parts;
                for part in 1..=parts as u32 {
                    let to = segment.distance + segment.at(time * f64::from(part)).0;
                    let times = match is_rapid {
                        true => Times {
                            rapid: time,
                            ..Times::default()
                        },
                        false => Times {
                            feed: time,
                            ..Times::default()
                        },
                    };
                    self.table.go_on(origin + to, times);
                }
            }
            Step::Rest(at, rest) => {
                let times = Times {
                    rest,
                    ..Times::default()
                };
                self.table.go_on(at, times);
            }
        }
        while self.rapids.get(1).is_some_and(|&(begin, _)| begin <= end) {
            self.rapids.pop_front();
        }
    }

    fn finish(mut self) -> Timetable {
        while !self.steps.is_empty() {
            self.pass();
        }
        self.table.end_stretch();
        self.table
    }
}
