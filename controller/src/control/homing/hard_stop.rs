//! The search for a hard stop, by an axis of one drive whose torque is limited meanwhile.
//!
//! ```text
//!                                     ▐ stop
//!  ─────────────────────────────────► ▐ stands, while its plan goes on     search
//!                                     ▐ pressed on it, at rest: its place is measured
//!            ◄─────────────────────── ▐                                    back off
//! ```
//!
//! The drive is told by SDO what limits its torque, and that is read back, before the axis moves, while no axis of the
//! group does. What limited it before comes back once the axis stands off the stop again (`node::torque`). Where the search is
//! cut off while the axis presses against what it met, the drives are switched off first: with its own torque the drive
//! would press on.
//!
//! # When it is a stop
//!
//! An axis that has stood within its standstill window for [`HardStopSearch::contact`], while its plan went on by
//! several times that window, has met something. The machine file is held to it that by then, and once the plan is at
//! rest, the axis lags by less than what is a following error at rest: so that this is supervised as always, and what
//! is slow for want of torque or falls is a fault. Where it rests in position instead, what it met has given way.

use super::super::{Controller, Event, Goal};
use super::switch::{Motion, Seen};
use super::{AxisIndex, Edge, HomingFailure};
use crate::machine::HardStopSearch;
use syncline_drives::model::Increments;

/// Cycles after which an order to an axis has begun to move it.
const TAKEN: u64 = 10;
/// An axis that stands so many times as long as on a stop, and is not where it was to back off to, does not come off.
const HELD: u64 = 10;

/// Where the search is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Step {
    /// None is under way.
    #[default]
    Idle,
    /// Until drives may be asked.
    Begin,
    /// Until it is known what limits the torque.
    Asking,
    /// Until that is less.
    Lowering,
    /// Towards the stop.
    Search,
    /// Coming to rest against it.
    Press,
    /// Off it.
    BackOff,
    /// There, until drives may be asked.
    Backed,
    /// Until its torque is limited as it was before.
    Returning,
}

/// A search under way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct HardStop {
    step: Step,
    /// Cycles since the step began.
    since: u64,
    /// Cycles that it has taken so far, without those that it waited for others.
    worked: u64,
    /// Where it began, mm.
    from: f64,
    /// Where it came to stand, mm, where its plan was then, and cycles since.
    stands: (f64, f64, u64),
    /// The counts between which it stood on the stop.
    pressed: Option<(Increments, Increments)>,
    /// It is nearer to where the search began than a stop can be.
    is_early: bool,
}

/// What a search has come to in a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Progress {
    /// What is under way goes on.
    Goes,
    /// A motion begins.
    Moves(Motion),
    /// The drive is to tell what limits its torque.
    Asks,
    /// That is to be lowered.
    Lowers,
    /// It is to be as before.
    Returns,
    /// The axis rests, and its stop is known.
    Found,
}

impl HardStop {
    /// Before the axis moves.
    pub(super) fn new() -> Self {
        Self {
            step: Step::Begin,
            ..Self::default()
        }
    }

    /// Whether it rests until no axis of the group moves.
    pub(super) fn waits(&self) -> bool {
        matches!(self.step, Step::Begin | Step::Backed)
    }

    /// Whether it stands against something.
    pub(super) fn presses(&self) -> bool {
        self.step == Step::Press
    }

    /// Cycles that it has taken so far, without those that it waited for others.
    pub(super) fn worked(&self) -> u64 {
        self.worked
    }

    /// Why its axis may not have followed.
    pub(super) fn blocked(&self) -> Option<HomingFailure> {
        match self.step {
            Step::Lowering | Step::Search | Step::Press => Some(HomingFailure::Weak),
            Step::BackOff => Some(HomingFailure::Holds),
            _ => None,
        }
    }

    /// Where the stop is.
    pub(super) fn edge(&self) -> Option<Edge> {
        self.pressed.map(|(least, most)| Edge {
            at: Increments::new(least.get().midpoint(most.get())),
            uncertainty: Increments::new((most - least).get() / 2 + 1),
        })
    }

    fn enter(&mut self, step: Step, progress: Progress) -> Progress {
        (self.step, self.since) = (step, 0);
        progress
    }

    fn moves(&mut self, step: Step, motion: Motion) -> Progress {
        self.enter(step, Progress::Moves(motion))
    }

    /// Whether the axis, whose plan is at `planned`, has stood for so many cycles while that went on.
    fn meets(&mut self, seen: &Seen, planned: f64, (cycles, window): (u64, f64)) -> bool {
        let (stands_at, planned_at, since) = &mut self.stands;
        *since += 1;
        if (seen.position - *stands_at).abs() > window {
            self.stands = (seen.position, planned, 0);
            return false;
        }
        *since >= cycles && (planned - *planned_at).abs() > HardStopSearch::WINDOWS * window
    }

    /// Goes on by a cycle; `contact` is how many the axis has to stand, and within what.
    fn go_on(
        &mut self,
        how: &HardStopSearch,
        seen: &Seen,
        planned: f64,
        contact: (u64, f64),
    ) -> Result<Progress, HomingFailure> {
        self.since += 1;
        self.worked += u64::from(!self.waits());
        let (towards, rests) = (how.direction, seen.rests && self.since > TAKEN);
        let step = self.step;
        Ok(match step {
            Step::Begin if seen.quiet => self.enter(Step::Asking, Progress::Asks),
            Step::Asking if seen.answered => self.enter(Step::Lowering, Progress::Lowers),
            Step::Lowering if seen.answered => {
                self.from = seen.position;
                self.stands = (seen.position, planned, 0);
                self.moves(Step::Search, Motion::Run(towards * how.speed))
            }
            Step::Search if self.meets(seen, planned, contact) => {
                self.is_early = (seen.position - self.from).abs() < how.min_distance;
                self.moves(Step::Press, Motion::Stop)
            }
            Step::Search if rests && (seen.settled || self.stands.2 >= contact.0) => {
                return Err(HomingFailure::NoStop);
            }
            Step::Press if rests && seen.settled => return Err(HomingFailure::GaveWay),
            Step::Press if rests => {
                if self.meets_still(seen, contact) {
                    let place = match self.is_early {
                        true => self.from,
                        false => seen.position - towards * how.back_off,
                    };
                    self.stands = (seen.position, planned, 0);
                    return Ok(self.moves(Step::BackOff, Motion::To(place, how.speed)));
                }
                Progress::Goes
            }
            Step::BackOff if rests && seen.settled => self.enter(Step::Backed, Progress::Goes),
            Step::BackOff if rests => {
                let (cycles, window) = contact;
                match self.has_stood(seen, window) >= HELD * cycles {
                    true => return Err(HomingFailure::Holds),
                    false => Progress::Goes,
                }
            }
            Step::Backed if seen.quiet => self.enter(Step::Returning, Progress::Returns),
            Step::Returning if seen.answered && self.is_early => {
                return Err(HomingFailure::TooEarly);
            }
            Step::Returning if seen.answered => Progress::Found,
            _ => Progress::Goes,
        })
    }

    /// For how many cycles the axis has stood at one place, within a window.
    fn has_stood(&mut self, seen: &Seen, window: f64) -> u64 {
        let (stands_at, _, since) = &mut self.stands;
        *since += 1;
        if (seen.position - *stands_at).abs() > window {
            (*stands_at, *since) = (seen.position, 0);
        }
        *since
    }

    /// Whether the axis has stood on its stop for so many cycles, in all of which its place is measured.
    fn meets_still(&mut self, seen: &Seen, (cycles, window): (u64, f64)) -> bool {
        let (stands_at, _, since) = &mut self.stands;
        if (seen.position - *stands_at).abs() > window {
            (*stands_at, *since) = (seen.position, 0);
            self.pressed = None;
        }
        if self.pressed.is_none() {
            *since = 0;
        }
        *since += 1;
        let at = seen.counts[0];
        let (least, most) = self.pressed.unwrap_or((at, at));
        self.pressed = Some((least.min(at), most.max(at)));
        *since >= cycles
    }
}

impl<const N: usize> Controller<N> {
    /// Goes on with the search for a hard stop; whether it is over. `quiet` and `answered`, as in [`Seen`], are of all
    /// axes of the group.
    pub(super) fn home_on_stop(
        &mut self,
        index: AxisIndex,
        how: &HardStopSearch,
        (quiet, answered): (bool, bool),
    ) -> Result<bool, HomingFailure> {
        let axis = &self.axes[index];
        let (at, drive) = (axis.coordinate(), axis.drive());
        let contact = (self.cycles(how.contact), axis.limits().standstill);
        let planned = self.planned.position[at];
        let seen = Seen {
            quiet,
            answered,
            ..self.seen(index, [false; 2], how.speed)
        };
        let search = &mut self.homing.hard_stops[index];
        let progress = search.go_on(how, &seen, planned, contact)?;
        let node = &mut self.nodes[drive];
        match progress {
            Progress::Goes => {}
            Progress::Moves(motion) => self.move_axis(index, motion)?,
            Progress::Asks => node.ask_torque(),
            Progress::Lowers => {
                if !node.lower_torque(how.torque) {
                    return Err(HomingFailure::WeakAlready);
                }
            }
            Progress::Returns => {
                node.returns_torque();
            }
            Progress::Found => return Ok(node.returns_torque()),
        }
        Ok(false)
    }

    /// Whether what limits the torque of every drive is what did before a homing; asks for it where it is not.
    pub(in crate::control) fn torque_returns(&mut self) -> bool {
        let mut all = true;
        for node in &mut self.nodes {
            all &= node.returns_torque();
        }
        all
    }

    /// Where axes have come to rest behind a search that was cut off: whether they may stay enabled, or go off. One that is
    /// not `settled` presses against what it met, and goes off before its torque comes back.
    pub(in crate::control) fn let_go_of_stops(&mut self, settled: bool) -> bool {
        let is_weak = |axis: &AxisIndex| self.nodes[self.axes[*axis].drive()].is_weak();
        match (0..self.axes.len()).find(is_weak) {
            Some(axis) if !settled => {
                self.tell(Event::Presses { axis });
                self.goal = Goal::Disabled;
                true
            }
            Some(_) => self.torque_returns(),
            None => true,
        }
    }
}
