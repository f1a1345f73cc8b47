//! Probing: the path leads on until a probe touches, or no longer does, and what that was is measured.
//!
//! A probing begins where the path rests. Its motion is not part of the planned path, as nobody knows where it ends: it
//! is a jog along a straight line, at the programmed feed, to the programmed place at most. With the contact the axes
//! come to rest on that line as soon as their limits allow; the plan then begins anew from there, behind a program
//! that has waited for what was found.
//!
//! ```text
//!  path rests ─► captures armed ─► motion ─► contact ─► at rest ─► captures read ─► result
//!                     (SDO)           └─► the programmed place: no contact ────────────┘
//! ```
//!
//! # How well the contact is known
//!
//! Levels and positions are sampled at every SYNC: the contact lies between the last sample without it and the first
//! one with it. What more is known differs from axis to axis:
//!
//! - A drive that captures the edge has its own position of that instant, as well as its encoder and the jitter of
//!   the capture allow.
//! - Where such a drive's axis moves, the instant follows from where between two samples its captured
//!   position lies. The other axes are taken to be there between their own two samples. They are off by what
//!   they move in the time by which that instant may be off, and by how much their motion bends between samples.
//! - Without any, all are taken in the middle, and off by half of what they move in a cycle.

use super::axis::AxisControl;
use super::{Controller, Event, Fault, Phase};
use crate::machine::InputMeaning;
use std::fmt;
use std::sync::Arc;
use syncline_gcode::Probe;
use syncline_trajectory::path::{Jog, JogError};

/// Samples that are kept: an input's filter may delay the level by less.
const KEPT: usize = 16;
/// So near to where it was to lead, mm, a motion has come there.
const REACHED: f64 = 1e-6;
/// Cycles from the last sample without contact until the setpoints begin to slow down, at most.
const REACTION: f64 = 3.0;

/// A probing, as the program has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeMove<const N: usize> {
    /// Counts those of a job, from 1.
    pub number: u32,
    /// Where it ends at the latest, mm.
    pub to: [f64; N],
    /// The highest along the line there, mm/s.
    pub speed: f64,
    /// What it looks for.
    pub probe: Probe,
}

/// What came of a probing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probed<const N: usize> {
    /// That of its [`ProbeMove`].
    pub number: u32,
    /// Where the contact came or went, mm; `None`: it did not.
    pub contact: Option<[f64; N]>,
    /// Where the plan goes on, mm.
    pub at: [f64; N],
}

/// By what the place of a contact is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KnownBy {
    /// Every axis that moved has it from its drives.
    Captured,
    /// Some have; the others follow from the instant that this gives.
    Inferred,
    /// The samples before and behind it.
    Sampled,
}

impl fmt::Display for KnownBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Captured => "by what the drives captured",
            Self::Inferred => "by what some drives captured",
            Self::Sampled => "by samples",
        })
    }
}

/// Why a probing failed. The axes came to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ProbeFailure {
    /// There was contact before it began.
    Closed,
    /// There was no contact to be lost.
    Open,
    /// No contact came on the whole way.
    NoContact,
    /// The contact stayed on the whole way.
    Stuck,
    /// The probe's level is not known.
    NoSignal,
    /// It would go on too far behind the contact.
    TooFast {
        /// How far, mm.
        overtravel: f64,
        /// How far it may, mm.
        allowed: f64,
    },
    /// A drive captured another edge than the one that the samples saw.
    OtherEdge {
        /// Its axis.
        axis: usize,
    },
    /// The motion is refused.
    Refused(JogError),
}

impl ProbeFailure {
    /// What happened, and what to do next; `axis` names the one of [`ProbeFailure::OtherEdge`].
    pub(super) fn describe(self, axis: impl Fn(usize) -> String) -> String {
        match self {
            Self::Closed => "there is contact before the probing: move away first, and check \
                             `active_low`"
                .into(),
            Self::Open => "there is no contact that could be lost: check the probe's wiring and \
                           `active_low`"
                .into(),
            Self::NoContact => {
                "no contact came on the whole way: check where the work is, and the \
                                probe's wiring; G38.3 goes on without one"
                    .into()
            }
            Self::Stuck => "the contact stayed on the whole way: check whether the probe sticks; \
                            G38.5 goes on with it"
                .into(),
            Self::NoSignal => {
                "the probe's level is not known: check the device that it is wired to".into()
            }
            Self::TooFast {
                overtravel,
                allowed,
            } => format!(
                "the axes would go on for {overtravel:.3} mm behind the contact, {allowed} mm are \
                 allowed: lower F, or raise `overtravel` in [probing] if the probe bears it"
            ),
            Self::OtherEdge { axis: of } => format!(
                "a drive of axis {} captured another place than the one where the contact came: check \
                 whether the probe bounces, and which input it is wired to, or set `latch = false` in [probing]",
                axis(of)
            ),
            Self::Refused(why) => format!("{why}: raise it, or correct where the probing leads"),
        }
    }
}

/// Where a probing is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stage {
    /// None is under way.
    #[default]
    Idle,
    /// Until the drives are told to capture the edge.
    Arming,
    /// Until there is contact.
    Moving,
    /// Coming to rest behind it.
    Stopping,
    /// Until the drives have told what they captured.
    Reading,
    /// Until the program goes on.
    Replanning,
}

/// What was seen at a SYNC.
#[derive(Clone, Copy, Debug)]
struct Sample<const N: usize> {
    /// Actual positions, mm.
    position: [f64; N],
}

/// A probing.
#[derive(Clone, Debug)]
pub(super) struct Probing<const N: usize> {
    stage: Stage,
    line: u32,
    next: Option<ProbeMove<N>>,
    /// An operator holds it.
    paused: bool,
    /// The samples up to the contact, the newest last, and how many there are.
    samples: [Sample<N>; KEPT],
    count: usize,
    probed: Option<Probed<N>>,
}

impl<const N: usize> Probing<N> {
    pub(super) fn new() -> Self {
        Self {
            stage: Stage::Idle,
            line: 0,
            next: None,
            paused: false,
            samples: [Sample { position: [0.0; N] }; KEPT],
            count: 0,
            probed: None,
        }
    }

    /// Whether the axes move, or rest, for one.
    pub(super) fn is_active(&self) -> bool {
        !matches!(self.stage, Stage::Idle | Stage::Replanning)
    }

    /// Whether what comes of the plan is from before it.
    pub(super) fn awaits_plan(&self) -> bool {
        self.stage == Stage::Replanning
    }

    /// Ends it where it is, for good.
    pub(super) fn abort(&mut self) {
        *self = Self::new();
    }

    /// Takes what the program asks for at its next stop.
    pub(super) fn take(&mut self, next: ProbeMove<N>) {
        self.next = Some(next);
        self.probed = None;
    }

    /// The plan behind a probing begins.
    pub(super) fn begin_plan(&mut self, number: u32) {
        if self.awaits_plan() && self.probed.is_some_and(|probed| probed.number == number) {
            self.stage = Stage::Idle;
        }
    }

    fn keep(&mut self, sample: Sample<N>) {
        self.samples.rotate_left(1);
        self.samples[KEPT - 1] = sample;
        self.count = (self.count + 1).min(KEPT);
    }

    /// The pairs of samples in a row of an axis, the newest first.
    fn intervals(&self, at: usize) -> impl Iterator<Item = (f64, f64)> + '_ {
        let kept = &self.samples[KEPT - self.count..];
        let pairs = kept.windows(2).rev();
        pairs.map(move |pair| (pair[0].position[at], pair[1].position[at]))
    }
}

/// Where an axis was at the contact.
#[derive(Clone, Copy, Debug)]
struct Found {
    /// mm
    position: f64,
    /// By how much it may be off, mm.
    uncertainty: f64,
}

/// When between two samples the contact was.
#[derive(Clone, Copy, Debug)]
struct Moment {
    /// How many intervals before the newest.
    back: usize,
    /// The part of the interval before it, and by how much that may be off.
    part: f64,
    uncertainty: f64,
}

impl<const N: usize> Controller<N> {
    /// Whether the probe touches, by any of its inputs; `None` while none tells.
    fn touches(&self) -> Option<bool> {
        let probes = self.layout.inputs.iter();
        let probes = probes.filter(|input| input.meaning == InputMeaning::Probe);
        let levels = probes.map(|input| {
            let level = self.nodes[input.node].signal(input.signal)?;
            Some(level != input.active_low)
        });
        levels.fold(None, |any, level| match (any, level) {
            (None, level) => level,
            (any, None) => any,
            (Some(any), Some(level)) => Some(any || level),
        })
    }

    /// What came of the last probing of the job.
    #[must_use]
    pub fn probed(&self) -> Option<&Probed<N>> {
        self.probing.probed.as_ref()
    }

    /// Something touched the probe while the axes moved, and nobody was probing.
    pub(super) fn touched(&mut self) {
        let moves = self
            .planned
            .velocity
            .iter()
            .any(|velocity| *velocity != 0.0);
        if self.probing.is_active() || !moves || self.phase != Phase::Program {
            return;
        }
        self.tell(Event::Touched);
        if !self.stays_on {
            self.fail(Fault::Touched);
        } else if self.job.is_some() || self.homing.is_active() {
            self.enter(Phase::Stop, &mut []);
        } else {
            self.executor.feed_hold();
        }
    }

    /// The path rests where the program probes.
    pub(super) fn begin_probing(&mut self, line: u32) {
        let Some(next) = self.probing.next.filter(|_| !self.executor.is_held()) else {
            return;
        };
        self.probing.line = line;
        let begun = match self.touches() {
            None => Err(ProbeFailure::NoSignal),
            Some(touches) if touches != next.probe.away => Err(match touches {
                true => ProbeFailure::Closed,
                false => ProbeFailure::Open,
            }),
            Some(_) => self.check_overtravel(&next),
        };
        if let Err(failure) = begun {
            return self.probing_failed(failure);
        }
        let layout = Arc::clone(&self.layout);
        for (node, captures) in self.nodes.iter_mut().zip(&layout.probe_captures) {
            if let Some(captures) = captures {
                node.arm_capture(captures.of(next.probe.away));
            }
        }
        self.probing.paused = false;
        self.probing.count = 0;
        self.probing.stage = Stage::Arming;
    }

    /// Whether the axes come to rest near enough behind the contact.
    fn check_overtravel(&self, next: &ProbeMove<N>) -> Result<(), ProbeFailure> {
        let way: [f64; N] = std::array::from_fn(|at| next.to[at] - self.planned.position[at]);
        let length = way.iter().map(|by| by * by).sum::<f64>().sqrt();
        let (mut speed, mut acceleration, mut jerk) = (next.speed, f64::INFINITY, f64::INFINITY);
        for axis in &self.layout.axes {
            let share = way[axis.coordinate].abs() / length;
            speed = speed.min(axis.limits.velocity / share);
            acceleration = acceleration.min(axis.limits.acceleration / share);
            jerk = jerk.min(axis.limits.jerk / share);
        }
        // The acceleration is reached, or not.
        let stop = match speed * jerk >= acceleration * acceleration {
            true => 0.5 * speed * (speed / acceleration + acceleration / jerk),
            false => speed * (speed / jerk).sqrt(),
        };
        let cycles = REACTION + self.layout.lag;
        let overtravel = stop + speed * cycles * self.layout.cycle.as_secs_f64();
        let allowed = self.layout.probing.overtravel;
        match overtravel > allowed {
            true => Err(ProbeFailure::TooFast {
                overtravel,
                allowed,
            }),
            false => Ok(()),
        }
    }

    /// Goes on with a probing by a cycle.
    pub(super) fn step_probing(&mut self) {
        let answered = self.nodes.iter().all(|node| node.is_sequence_done());
        let rests = self.executor.is_at_rest() && self.shaping.is_settled();
        match self.probing.stage {
            Stage::Idle | Stage::Replanning => {}
            Stage::Arming if answered => {
                self.probing.stage = Stage::Moving;
                self.move_on();
            }
            Stage::Arming => {}
            Stage::Moving => self.look_for_contact(rests),
            Stage::Stopping if rests && self.is_settled() => {
                self.probing.stage = Stage::Reading;
                let layout = Arc::clone(&self.layout);
                let away = self.probing.next.is_some_and(|next| next.probe.away);
                for (node, captures) in self.nodes.iter_mut().zip(&layout.probe_captures) {
                    if let Some(captures) = captures {
                        node.ask_captured(captures.of(away));
                    }
                }
            }
            Stage::Reading if answered => match self.contact() {
                Ok(contact) => self.end_probing(Some(contact)),
                Err(failure) => self.probing_failed(failure),
            },
            Stage::Stopping | Stage::Reading => {}
        }
    }

    fn is_settled(&self) -> bool {
        (self.axes.iter()).all(|axis| axis.is_in_position(&axis.sample(self.cycle, &self.nodes)))
    }

    /// Lets the axes go on, as fast as the program and the feed override have it, but no faster than
    /// the program.
    fn move_on(&mut self) {
        let Some(next) = self.probing.next else {
            return;
        };
        let overrides = self.executor.overrides();
        let speed = next.speed * overrides.feed.min(1.0);
        if self.probing.paused || speed.min(overrides.rapid) == 0.0 {
            return self.executor.feed_hold();
        }
        let mut to = [None; N];
        for axis in &self.layout.axes {
            to[axis.coordinate] = Some(next.to[axis.coordinate]);
        }
        let travel = self.travel();
        if !self.executor.is_off_path() {
            self.executor.feed_hold();
        }
        if let Err(why) = self.executor.jog(Jog::Line { to, speed }, &travel) {
            self.probing_failed(ProbeFailure::Refused(why));
        }
    }

    /// Looks whether there is contact.
    fn look_for_contact(&mut self, rests: bool) {
        let Some(next) = self.probing.next else {
            return;
        };
        let Some(touches) = self.touches() else {
            return self.probing_failed(ProbeFailure::NoSignal);
        };
        let fresh = self
            .nodes
            .iter()
            .all(|node| node.age() == 0 || !node.answers_sync());
        if fresh {
            let mut position = self.planned.position;
            for axis in &self.axes {
                position[axis.coordinate()] = axis.place(&self.nodes);
            }
            self.probing.keep(Sample { position });
        }
        if fresh && touches != next.probe.away {
            self.executor.feed_hold();
            self.probing.stage = Stage::Stopping;
            if std::mem::take(&mut self.held) {
                self.tell(Event::Resumed);
            }
            return;
        }
        let at = &self.planned.position;
        let missing = self.layout.axes.iter().map(|axis| axis.coordinate);
        let far = missing.map(|of| (next.to[of] - at[of]).abs());
        let there = far.fold(0.0, f64::max) < REACHED;
        if rests && there && self.is_settled() {
            self.end_probing(None);
        } else if rests && self.probing.paused && !std::mem::replace(&mut self.held, true) {
            self.tell(Event::Held);
        }
    }

    /// Has it rest on its way, or on the path.
    pub(super) fn hold_path(&mut self) {
        self.probing.paused |= self.probing.is_active();
        self.executor.feed_hold();
    }

    /// Ends that.
    pub(super) fn resume_path(&mut self) {
        if !self.probing.is_active() {
            self.executor.resume();
        } else if std::mem::take(&mut self.probing.paused) {
            if std::mem::take(&mut self.held) {
                self.tell(Event::Resumed);
            }
            self.change_probing_speed();
        }
    }

    /// Whether an operator, or nobody but the override, holds the path.
    pub(super) fn is_path_held(&self) -> bool {
        match self.probing.is_active() {
            true => self.probing.paused,
            false => self.executor.is_held(),
        }
    }

    /// The motion goes on with the overrides as they are now.
    pub(super) fn change_probing_speed(&mut self) {
        if self.probing.stage == Stage::Moving {
            self.move_on();
        }
    }

    /// Where the contact was, by how much that may be off, and by what it is known.
    fn contact(&self) -> Result<([f64; N], f64, KnownBy), ProbeFailure> {
        let speed = self.probing.next.map_or(0.0, |next| next.speed);
        let mut contact = self.planned.position;
        let mut uncertainty = 0.0_f64;
        let captured = |axis: &AxisControl| axis.captured(speed, &self.layout, &self.nodes);
        let mut moment: Option<Moment> = None;
        for (index, axis) in self.axes.iter().enumerate() {
            let Some((position, uncertainty)) = captured(axis) else {
                continue;
            };
            let found = Found {
                position,
                uncertainty,
            };
            if !self.is_near_samples(axis, found) {
                return Err(ProbeFailure::OtherEdge { axis: index });
            }
            let known = self.moment(axis.coordinate(), found, axis.resolution(&self.nodes));
            let better =
                |known: &Moment| moment.is_none_or(|best| known.uncertainty < best.uncertainty);
            moment = known.filter(better).or(moment);
        }
        let mut by = KnownBy::Captured;
        for axis in &self.axes {
            let at = axis.coordinate();
            let resolution = axis.resolution(&self.nodes);
            let moved = self.probing.intervals(at).next();
            let moved = moved.is_some_and(|(before, now)| (now - before).abs() > 2.0 * resolution);
            let (position, off) = match (captured(axis), moment) {
                (Some(found), _) => found,
                (None, Some(moment)) => {
                    by = if moved { KnownBy::Inferred } else { by };
                    self.inferred(at, moment, resolution)
                }
                (None, None) => {
                    by = KnownBy::Sampled;
                    self.sampled(at, resolution)
                }
            };
            contact[at] = position;
            uncertainty = uncertainty.max(off);
        }
        Ok((contact, uncertainty, by))
    }

    /// In which part of which interval a captured position lies; `None` of an axis that rests, or moves so slowly that
    /// its samples do not tell.
    fn moment(&self, at: usize, found: Found, resolution: f64) -> Option<Moment> {
        let off = found.uncertainty + resolution;
        let intervals = self.probing.intervals(at).enumerate();
        intervals.into_iter().find_map(|(back, (before, now))| {
            let step = now - before;
            let part = (found.position - before) / step;
            let uncertainty = off / step.abs();
            let inside = (-uncertainty..=1.0 + uncertainty).contains(&part);
            (inside && step.abs() > 4.0 * off).then_some(Moment {
                back,
                part,
                uncertainty,
            })
        })
    }

    /// Whether a captured position may be one of where an axis was as the samples were taken.
    fn is_near_samples(&self, axis: &AxisControl, found: Found) -> bool {
        let kept = &self.probing.samples[KEPT - self.probing.count..];
        let places = kept.iter().map(|sample| sample.position[axis.coordinate()]);
        let (least, most) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), at| {
            (least.min(at), most.max(at))
        });
        let window = axis.standstill() + found.uncertainty;
        (least - window..=most + window).contains(&found.position)
    }

    /// Where an axis was at a moment.
    fn inferred(&self, at: usize, moment: Moment, resolution: f64) -> (f64, f64) {
        let mut intervals = self.probing.intervals(at).skip(moment.back);
        let Some((before, now)) = intervals.next() else {
            return self.sampled(at, resolution);
        };
        let step = now - before;
        // The middle of a parabola is off its chord by an eighth of the change of its steps.
        let earlier = intervals
            .next()
            .map_or(0.0, |(first, second)| second - first);
        let bend = 0.125 * (step - earlier).abs();
        let off = step.abs() * moment.uncertainty + bend + 2.0 * resolution;
        (before + moment.part * step, off)
    }

    /// Where an axis was between the last two samples.
    fn sampled(&self, at: usize, resolution: f64) -> (f64, f64) {
        let last = self.probing.intervals(at).next();
        let here = self.probing.samples[KEPT - 1].position[at];
        let (before, now) = last.unwrap_or((here, here));
        let off = 0.5 * (now - before).abs() + resolution;
        (f64::midpoint(before, now), off)
    }

    /// The axes rest, and the program goes on with what was found.
    fn end_probing(&mut self, found: Option<([f64; N], f64, KnownBy)>) {
        let Some(next) = self.probing.next else {
            return;
        };
        if found.is_none() && next.probe.required {
            return self.probing_failed(match next.probe.away {
                true => ProbeFailure::Stuck,
                false => ProbeFailure::NoContact,
            });
        }
        self.tell(Event::Probed {
            line: self.probing.line,
            found: found.map(|(_, uncertainty, by)| (uncertainty, by)),
        });
        self.probing.abort();
        self.probing.probed = Some(Probed {
            number: next.number,
            contact: found.map(|(contact, ..)| contact),
            at: self.planned.position,
        });
        self.probing.stage = Stage::Replanning;
        self.stop_point = None;
        self.rest_here();
    }

    fn probing_failed(&mut self, failure: ProbeFailure) {
        let line = self.probing.line;
        self.probing.abort();
        if self.stays_on {
            self.tell(Event::ProbingFailed { line, failure });
            self.enter(Phase::Stop, &mut []);
        } else {
            self.fail(Fault::Probing { line, failure });
        }
    }
}
