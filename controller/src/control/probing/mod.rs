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

mod contact;
mod failure;

pub use contact::KnownBy;
pub use failure::ProbeFailure;

use super::axis::AxisControl;
use super::fault::BlockCause;
use super::node::DeviceNode;
use super::{Controller, Event, Fault, Phase};
use crate::machine::stopping_distance;
use contact::{Contact, Samples};
use std::array;
use syncline_drives::model::Capture;
use syncline_gcode::Probe;
use syncline_trajectory::path::Jog;

/// So near to where it was to lead, mm, a motion has come there.
const REACHED: f64 = 1e-6;
/// Cycles from the last sample without contact until the setpoints begin to slow down, at most.
const REACTION: f64 = 3.0;
/// Contacts that are no further apart, cycles, are told as one.
const ONE_CONTACT: u64 = 50;

/// A probing, as the program has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeMove<const N: usize> {
    /// Counts probings, homings and threads of a job, from 1.
    pub number: u32,
    /// Where it ends at the latest, mm.
    pub to: [f64; N],
    /// The highest along the line there, mm/s.
    pub speed: f64,
    /// What it looks for.
    pub probe: Probe,
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
}

/// A probing.
#[derive(Clone, Debug)]
pub(super) struct Probing<const N: usize> {
    stage: Stage,
    line: u32,
    next: Option<ProbeMove<N>>,
    /// An operator holds it.
    paused: bool,
    /// Where it begins, mm.
    from: [f64; N],
    samples: Samples<N>,
    /// There has been contact, and where is known with the next sample of all axes.
    touched: bool,
    /// The cycle of the last contact while nobody was probing.
    touched_last: Option<u64>,
    /// Where the contact that there is began while the axes moved, mm, and how fast they went, mm/s.
    contact: Option<([f64; N], [f64; N])>,
    /// The axes go too far from there, which has been told.
    pressed: bool,
    /// Cycles that the axes had to settle, where the motion is over.
    settling: u64,
}

impl<const N: usize> Probing<N> {
    pub(super) fn new() -> Self {
        Self {
            stage: Stage::Idle,
            line: 0,
            next: None,
            paused: false,
            from: [0.0; N],
            samples: Samples::none(),
            touched: false,
            touched_last: None,
            contact: None,
            pressed: false,
            settling: 0,
        }
    }

    /// Whether the axes move, or rest, for one.
    pub(super) fn is_active(&self) -> bool {
        self.stage != Stage::Idle
    }

    /// Its program line, while it is under way.
    pub(super) fn line(&self) -> Option<u32> {
        self.is_active().then_some(self.line)
    }

    /// Ends it where it is, for good.
    pub(super) fn abort(&mut self) {
        *self = Self {
            touched_last: self.touched_last,
            contact: self.contact,
            ..Self::new()
        };
    }

    /// Takes what the program asks for at its next stop.
    pub(super) fn take(&mut self, next: ProbeMove<N>) {
        self.next = Some(next);
    }

    /// Whether an operator holds it.
    pub(super) fn is_paused(&self) -> bool {
        self.paused
    }

    /// Has it rest on its way.
    pub(super) fn pause(&mut self) {
        self.paused |= self.is_active();
    }

    /// Ends that; whether it was.
    pub(super) fn go_on(&mut self) -> bool {
        std::mem::take(&mut self.paused)
    }
}

impl<const N: usize> Controller<N> {
    /// Whether the probe touches, or a tool the tool setter, by any of their inputs; `None` while none tells.
    fn touches(&self) -> Option<bool> {
        let probes = self.layout.inputs.iter();
        let probes = probes.filter(|input| input.meaning.is_probed());
        let levels = probes.map(|input| self.level(input));
        levels.fold(None, |any, level| match (any, level) {
            (None, level) => level,
            (any, None) => any,
            (Some(any), Some(level)) => Some(any || level),
        })
    }

    /// Something touched the probe while the axes moved, and nobody was probing. An axis may still move for a while after
    /// its setpoints.
    pub(super) fn touched(&mut self) {
        let rests = self.cycle - self.moved > self.still_cycles().into() && self.goers_rest();
        if rests {
            return;
        }
        self.probing.contact = Some((self.planned.position, self.planned.velocity));
        if self.probes() || self.phase != Phase::Program {
            return;
        }
        let last = self.probing.touched_last.replace(self.cycle);
        // What touches bounces, and several drives may hear of it.
        if last.is_none_or(|last| self.cycle - last > ONE_CONTACT) {
            self.tell(Event::Touched);
        }
        self.stop_at_contact(Fault::Touched);
    }

    /// A contact that stays has to open: nobody drives the probe further than `overtravel` from where the contact began,
    /// also by jogs that begin in it. Straight back from there is no further, however late the probe tells that it is off.
    pub(super) fn watch_contact(&mut self) {
        let Some((began, approach)) = self.probing.contact else {
            return;
        };
        if self.touches() == Some(false) || self.homing.is_active() {
            self.forget_contact();
            return;
        }
        let along =
            |a: &[f64; N], b: &[f64; N]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
        let plan = &self.planned;
        let mut displacement: [f64; N] = array::from_fn(|at| plan.position[at] - began[at]);
        let speed = along(&approach, &approach);
        let back = along(&displacement, &approach).min(0.0) / speed.max(f64::MIN_POSITIVE);
        for (displacement, approach) in displacement.iter_mut().zip(&approach) {
            *displacement -= back * approach;
        }
        let is_further =
            along(&displacement, &displacement).sqrt() > self.layout.probing.overtravel;
        let goes_on = along(&displacement, &plan.velocity) > 0.0;
        let presses = is_further && goes_on && !self.probes() && self.phase == Phase::Program;
        if presses && !self.probing.pressed {
            self.tell(Event::Pressed);
            self.stop_at_contact(Fault::Pressed);
        }
        self.probing.pressed = presses;
    }

    /// A contact is none that axes moved into: it opened, or they are elsewhere by now.
    pub(super) fn forget_contact(&mut self) {
        (self.probing.contact, self.probing.pressed) = (None, false);
    }

    /// Whether the program probes, so that contact is what it looks for.
    fn probes(&self) -> bool {
        self.probing.is_active() || self.beside_path.awaits_plan()
    }

    /// What moves comes to rest, as nobody is probing.
    fn stop_at_contact(&mut self, fault: Fault) {
        if !self.stays_on {
            self.fail(fault);
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
        self.tell_captures(next.probe, DeviceNode::arm_captures);
        self.probing.paused = false;
        self.probing.from = self.planned.position;
        self.probing.samples = Samples::none();
        self.probing.settling = 0;
        self.probing.stage = Stage::Arming;
    }

    /// Has every drive that captures what the probing looks for do `what` about it.
    fn tell_captures(
        &mut self,
        probe: Probe,
        what: fn(&mut DeviceNode, [Option<&'static Capture>; 2]),
    ) {
        for (node, captures) in self.nodes.iter_mut().zip(&self.layout.probe_captures) {
            if let Some(captures) = captures {
                what(node, captures.of(probe.away));
            }
        }
    }

    /// Whether the axes come to rest near enough behind the contact.
    fn check_overtravel(&self, next: &ProbeMove<N>) -> Result<(), ProbeFailure> {
        let displacement: [f64; N] =
            std::array::from_fn(|at| next.to[at] - self.planned.position[at]);
        let along = self
            .layout
            .path_axes()
            .map(|axis| displacement[axis.coordinate]);
        let length = along.map(|by| by * by).sum::<f64>().sqrt();
        let (mut speed, mut acceleration, mut jerk) = (next.speed, f64::INFINITY, f64::INFINITY);
        for axis in self.layout.path_axes() {
            let share = displacement[axis.coordinate].abs() / length;
            speed = speed.min(axis.limits.velocity / share);
            acceleration = acceleration.min(axis.limits.acceleration / share);
            jerk = jerk.min(axis.limits.jerk / share);
        }
        let stop = stopping_distance(speed, acceleration, jerk);
        let cycles = REACTION + self.layout.lag;
        let late = cycles * self.layout.cycle.as_secs_f64() + self.layout.shaper.mean();
        let overtravel = stop + speed * late;
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
        let Some(next) = self.probing.next else {
            return;
        };
        let answered = self.nodes.iter().all(|node| node.is_sequence_done());
        let rests = self.executor.is_at_rest() && self.axes_rest();
        match self.probing.stage {
            Stage::Idle => {}
            Stage::Arming if answered => {
                self.probing.stage = Stage::Moving;
                self.probing.touched = false;
                self.move_on(&next);
            }
            Stage::Arming => {}
            Stage::Moving => self.look_for_contact(&next, rests),
            Stage::Stopping if rests => match self.settle() {
                Ok(true) => {
                    self.probing.stage = Stage::Reading;
                    self.tell_captures(next.probe, DeviceNode::ask_first_captured);
                }
                Ok(false) => {}
                Err(failure) => self.probing_failed(failure),
            },
            Stage::Reading if answered => match self.contact(&next) {
                Ok(contact) => self.end_probing(&next, Some(contact)),
                Err(failure) => self.probing_failed(failure),
            },
            Stage::Stopping | Stage::Reading => {}
        }
    }

    /// Whether all axes are where the motion ended.
    ///
    /// # Errors
    /// One was not there in as long as a drive may take for a change of its state.
    fn settle(&mut self) -> Result<bool, ProbeFailure> {
        let away = |axis: &AxisControl| !axis.is_in_position(&axis.sample(self.cycle, &self.nodes));
        let Some(axis) = self.axes.iter().position(away) else {
            return Ok(true);
        };
        self.probing.settling += 1;
        match self.probing.settling > self.cycles(self.layout.state_timeout) {
            true => Err(ProbeFailure::NotSettled { axis }),
            false => Ok(false),
        }
    }

    /// Lets the axes go on, as fast as the program and the feed override have it, but no faster than
    /// the program.
    fn move_on(&mut self, next: &ProbeMove<N>) {
        let overrides = self.executor.overrides();
        let speed = next.speed * overrides.feed.min(1.0);
        let rests = self.probing.paused || self.probing.touched;
        if rests || speed.min(overrides.rapid) == 0.0 {
            return self.executor.feed_hold();
        }
        let mut to = [None; N];
        for axis in self.layout.path_axes() {
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
    fn look_for_contact(&mut self, next: &ProbeMove<N>, rests: bool) {
        let Some(touches) = self.touches() else {
            return self.probing_failed(ProbeFailure::NoSignal);
        };
        let fresh = self.nodes.iter().all(DeviceNode::has_answered);
        if fresh {
            self.sample_places();
        }
        // It stops for the probe alone; where it was takes what every device answers.
        self.probing.touched |= touches != next.probe.away;
        if self.probing.touched {
            self.executor.feed_hold();
            if fresh {
                self.probing.stage = Stage::Stopping;
            }
            return;
        }
        let at = &self.planned.position;
        let missing = self.layout.path_axes().map(|axis| axis.coordinate);
        let far = missing.map(|of| (next.to[of] - at[of]).abs());
        let there = far.fold(0.0, f64::max) < REACHED;
        if rests && there {
            match self.settle() {
                Ok(true) => self.end_probing(next, None),
                Ok(false) => {}
                Err(failure) => self.probing_failed(failure),
            }
        } else if rests && self.probing.paused && !std::mem::replace(&mut self.held, true) {
            self.tell(Event::Held(self.held_by));
        }
    }

    /// A probing goes on with the overrides as they are now.
    pub(super) fn change_probing_speed(&mut self) {
        let next = self.probing.next;
        if let Some(next) = next.filter(|_| self.probing.stage == Stage::Moving) {
            self.move_on(&next);
        }
    }

    /// The axes rest, and the program goes on with what was found.
    fn end_probing(&mut self, next: &ProbeMove<N>, contact: Option<Contact<N>>) {
        if contact.is_none() && next.probe.required {
            return self.probing_failed(match next.probe.away {
                true => ProbeFailure::Stuck,
                false => ProbeFailure::NoContact,
            });
        }
        self.tell(Event::Probed {
            line: self.probing.line,
            found: contact.map(|contact| (contact.uncertainty, contact.by)),
        });
        let rests = self.probing.paused;
        self.replan_behind(next.number, contact.map(|contact| contact.at), rests);
    }

    fn probing_failed(&mut self, failure: ProbeFailure) {
        let line = self.probing.line;
        self.probing.abort();
        if self.stays_on {
            self.tell(Event::ProbingFailed { line, failure });
            self.enter(Phase::Stop, &mut []);
        } else {
            self.fail(Fault::Block(line, BlockCause::Probing(failure)));
        }
    }
}
