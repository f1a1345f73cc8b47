//! What programs have done beside the plan: probings, homings and threads.
//!
//! They begin where the path rests, and nobody knows before where they end, or when. So the plan ends before each, and one that
//! begins where the axes rest then follows, once the program knows what came of it. What an operator wants of the path
//! meanwhile is said to what is under way.

use super::{Controller, Event, Fault, Hold};
use std::mem::take;

/// What came of a probing, of a homing that a program asked for, or of a thread.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found<const N: usize> {
    /// That of its [`ProbeMove`](super::ProbeMove), of the homing, or of the thread.
    pub number: u32,
    /// Of a probing: where the contact came or went, mm; `None`: it did not.
    pub contact: Option<[f64; N]>,
    /// Where the plan goes on, mm.
    pub at: [f64; N],
}

/// What is known of it.
#[derive(Clone, Debug)]
pub(super) struct BesidePath<const N: usize> {
    found: Option<Found<N>>,
    /// Until the plan behind what was found begins.
    awaits_plan: bool,
    /// The next homing: its number, and which axes, by coordinate.
    home: Option<(u32, [bool; N])>,
    /// The number of the homing under way, and its program line.
    homes: Option<(u32, u32)>,
}

impl<const N: usize> BesidePath<N> {
    pub(super) fn new() -> Self {
        Self {
            found: None,
            awaits_plan: false,
            home: None,
            homes: None,
        }
    }

    /// Whether what comes of the plan is from before it.
    pub(super) fn awaits_plan(&self) -> bool {
        self.awaits_plan
    }

    /// The program line of the homing that is under way.
    pub(super) fn line(&self) -> Option<u32> {
        self.homes.map(|(_, line)| line)
    }

    /// The program asks for the next, and knows what was found before.
    pub(super) fn forget_found(&mut self) {
        self.found = None;
    }

    /// Takes which axes the program homes at its next stop.
    pub(super) fn take_home(&mut self, number: u32, axes: [bool; N]) {
        self.home = Some((number, axes));
        self.forget_found();
    }

    /// The plan behind the one with that number begins.
    pub(super) fn begin_plan(&mut self, number: u32) {
        if self.found.is_some_and(|found| found.number == number) {
            self.awaits_plan = false;
        }
    }
}

impl<const N: usize> Controller<N> {
    /// What came of the last probing, homing or thread of the job.
    #[must_use]
    pub fn found(&self) -> Option<&Found<N>> {
        self.beside_path.found.as_ref()
    }

    /// Has it rest on its way, or on the path; a thread is cut before.
    pub(super) fn hold_path(&mut self, by: Hold) {
        self.held_by = by;
        if self.threading.is_active() {
            return self.threading.pause(true);
        }
        self.probing.pause();
        self.executor.feed_hold();
    }

    /// Ends that.
    pub(super) fn resume_path(&mut self) {
        self.held_by = Hold::Operator;
        if self.threading.is_active() {
            self.threading.pause(false);
        } else if !self.probing.is_active() {
            self.executor.resume();
        } else if self.probing.go_on() {
            if take(&mut self.held) {
                self.tell(Event::Resumed);
            }
            self.change_probing_speed();
        }
    }

    /// Whether an operator, or nobody but the override, holds the path.
    pub(super) fn is_path_held(&self) -> bool {
        match self.probing.is_active() {
            _ if self.threading.is_active() => self.threading.is_paused(),
            true => self.probing.is_paused(),
            false => self.executor.is_held(),
        }
    }

    /// The program goes on from where the axes rest, behind its search with that number; held if it `rests`.
    pub(super) fn replan_behind(&mut self, number: u32, contact: Option<[f64; N]>, rests: bool) {
        let rests = rests || self.executor.is_single_block();
        self.probing.abort();
        self.beside_path = BesidePath::new();
        self.beside_path.found = Some(Found {
            number,
            contact,
            at: self.planned.position,
        });
        self.beside_path.awaits_plan = true;
        self.stop_point = None;
        self.rest_here();
        if rests {
            self.executor.feed_hold();
        }
    }

    /// The path rests where the program homes axes.
    pub(super) fn begin_program_homing(&mut self, line: u32) {
        let held = self.executor.is_held();
        let Some((number, axes)) = self.beside_path.home.take_if(|_| !held) else {
            return;
        };
        self.beside_path.homes = Some((number, line));
        // Which axes can be homed the program was held against as it was read.
        if self.home(axes).is_err() {
            self.fail(Fault::Program);
        }
    }

    /// All axes that were to be homed have been: so the program goes on that asked for it.
    pub(super) fn end_program_homing(&mut self) {
        if let Some((number, line)) = self.beside_path.homes {
            self.tell(Event::ProgramHomed { line });
            self.replan_behind(number, None, false);
        }
    }
}
