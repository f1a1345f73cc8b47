//! Where a replay is: the controller, and what of the log and of the plan it has taken.

use super::log::Band;
use super::{Difference, Logged};
use crate::bus::Outbox;
use crate::control::fault::BusIndex;
use crate::control::{Controller, Event, Layout};
use crate::machine::COORDINATES;
use std::collections::VecDeque;
use std::sync::Arc;
use syncline_canopen::{Frame, Instant};

/// What the machine waits for and no frame tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Waits {
    /// For nothing: the plan is kept full.
    No,
    /// That many cycles until the plan comes.
    ForPlan(u64),
    /// That many cycles until an operator goes on.
    ForOperator(u64),
}

/// Everything that changes in a replay; a copy of it is a trial.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) controller: Controller<COORDINATES>,
    /// The first frame of the log that has not been taken.
    pub(super) next: usize,
    /// By bus and band: sent, and not met in the log yet.
    pub(super) sent: Vec<[VecDeque<(Instant, Frame)>; 3]>,
    pub(super) outboxes: Vec<Outbox>,
    /// The last setpoints, of all buses.
    pub(super) burst: Vec<Frame>,
    /// The job that has begun last …
    pub(super) job: Option<u64>,
    /// … and the first of its instructions that has not been taken.
    pub(super) instruction: usize,
    pub(super) waits: Waits,
    /// Told in the last cycle that the program pauses.
    pub(super) paused: bool,
    /// A trial; the plan is never replaced in one.
    pub(super) trial: bool,
    /// What the controller told and is not reported.
    pub(super) told: Vec<Event>,
    pub(super) cycle: u64,
    pub(super) same: u64,
    pub(super) dropped: u64,
    pub(super) last_wake: Instant,
}

/// A difference without where the controller was.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mismatch {
    pub(super) at: Instant,
    bus: BusIndex,
    logged: Option<Frame>,
    sent: Option<Frame>,
}

impl Mismatch {
    pub(super) fn in_state(self, state: &State) -> Difference {
        Difference {
            at: self.at,
            bus: self.bus,
            cycle: state.cycle,
            phase: state.controller.phase(),
            logged: self.logged,
            sent: self.sent,
        }
    }
}

impl State {
    pub(super) fn new(start: Instant, layout: &Arc<Layout>) -> Self {
        let buses = layout.buses.len();
        Self {
            controller: Controller::new(Arc::clone(layout), start),
            next: 0,
            sent: vec![Default::default(); buses],
            outboxes: vec![Outbox::default(); buses],
            burst: Vec::new(),
            job: None,
            instruction: 0,
            waits: Waits::No,
            paused: false,
            trial: false,
            told: Vec::new(),
            cycle: 0,
            same: 0,
            dropped: 0,
            last_wake: start,
        }
    }

    /// Wakes the controller at `now`, which was `due`, and keeps what it sends.
    pub(super) fn wake(&mut self, due: Instant, now: Instant) {
        self.outboxes.iter_mut().for_each(Outbox::clear);
        self.controller.wake(now, &mut self.outboxes);
        for (sent, outbox) in self.sent.iter_mut().zip(&self.outboxes) {
            let keep = |frame: &Frame| (due, *frame);
            sent[Band::Sync as usize].extend(outbox.sync.iter().map(keep));
            sent[Band::Burst as usize].extend(outbox.burst.as_slice().iter().map(keep));
            sent[Band::Acyclic as usize].extend(outbox.acyclic.as_slice().iter().map(keep));
        }
    }

    /// A copy to try something with.
    pub(super) fn trial(&self) -> Self {
        Self {
            trial: true,
            ..self.clone()
        }
    }

    /// Hears what the controller tells.
    pub(super) fn hear(&mut self) {
        while let Some(event) = self.controller.event() {
            self.paused |= matches!(event, Event::Paused { .. });
            self.told.push(event);
        }
    }

    /// Compares a frame of the log with what the controller sent.
    pub(super) fn meet(&mut self, logged: &Logged, band: Band) -> Result<(), Mismatch> {
        let sent = self.sent[logged.bus][band as usize].pop_front();
        let sent = sent.map(|(_, frame)| frame);
        if sent == Some(logged.frame) {
            self.same += 1;
            return Ok(());
        }
        Err(Mismatch {
            at: logged.at,
            bus: logged.bus,
            logged: Some(logged.frame),
            sent,
        })
    }

    /// Whether the log has all that the controller has sent.
    pub(super) fn is_met(&self) -> bool {
        self.sent.iter().flatten().all(VecDeque::is_empty)
    }

    /// A frame that was sent before `before` and never came.
    pub(super) fn overdue(&self, before: Instant) -> Option<Mismatch> {
        let sent = self.sent.iter().enumerate();
        let heads = sent.flat_map(|(bus, bands)| bands.iter().map(move |it| (bus, it.front())));
        let oldest = heads.filter_map(|(bus, head)| Some((*head?, bus)));
        let oldest = oldest.min_by_key(|((at, _), _)| *at);
        let ((at, frame), bus) = oldest.filter(|((at, _), _)| *at < before)?;
        Some(Mismatch {
            at,
            bus,
            logged: None,
            sent: Some(frame),
        })
    }
}
