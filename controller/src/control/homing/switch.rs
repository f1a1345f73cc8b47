//! The search for a switch, by one axis with one or two sides.
//!
//! ```text
//!            switch off                │ switch on
//!  ──────────────────────────────────► │ ───► at rest          search, fast
//!            ◄──────────────────────── │ ◄───                  back off
//!            ────────────────────────► │ ► at rest             approach, slow: here the edge is measured
//! ```
//!
//! An axis that stands on its switch leaves it first, against the direction of the search, and goes on
//! with the last two steps. The sides of a gantry move as one: the search ends with the first switch, the
//! approach with the last one, and each side has its own edge.
//!
//! # How well the place of the edge is known
//!
//! The levels of the switch and the drive's position are sampled at every SYNC. The edge lies between the
//! last sample at which the switch was off and the first at which it is on; the middle of the two is taken,
//! so that it is off by half of what the axis moves in a cycle at most, and by what the drive's input
//! filter delays, which is the same each time.
//!
//! # Why it ends
//!
//! Each step has a motion that ends by itself: inside [`SwitchSearch::max_distance`] of where the homing
//! began, or at a position. A step that finds its motion over, and not what it waits for, fails.

use super::HomingFailure;
use crate::machine::SwitchSearch;
use syncline_drives::model::Increments;

/// Cycles after which an order to an axis has begun to move it, whatever other axes are ordered.
const TAKEN: u64 = 10;

/// What an axis shows in a cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Actual position, mm.
    pub(super) position: f64,
    /// Its plan is at rest.
    pub(super) rests: bool,
    /// It has arrived there, too.
    pub(super) settled: bool,
    /// By side: the switch is on.
    pub(super) on: [bool; 2],
    /// By side: what the drive counts.
    pub(super) counts: [Increments; 2],
}

/// What an axis is to do from now on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    /// On and on at this velocity, mm/s.
    Run(f64),
    /// To rest.
    Stop,
    /// To a position, mm, at this speed, mm/s.
    To(f64, f64),
}

/// What a search has come to in a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Progress {
    /// The motion under way goes on.
    Goes,
    /// Another motion begins.
    Moves(Motion),
    /// The axis rests, and all edges are known.
    Found,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Nothing has been ordered.
    Begin,
    /// Off the switch on which it stood.
    Leave,
    /// Towards the switch.
    Search,
    /// Coming to rest, from where it backs off.
    Overrun,
    /// To in front of the switch.
    BackOff,
    /// Slowly onto it.
    Approach,
    /// Coming to rest on it.
    Arrive,
}

/// Where a switch came on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::control) struct Edge {
    /// By the drive's count.
    pub(in crate::control) at: Increments,
    /// By how much it may be off at most.
    pub(in crate::control) uncertainty: Increments,
}

/// A search under way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    step: Step,
    /// Cycles since the step began.
    since: u64,
    sides: usize,
    /// Where a switch changed at speed, mm.
    mark: f64,
    /// By side: the count at the last sample.
    last: [Increments; 2],
    edges: [Option<Edge>; 2],
}

impl Search {
    /// Of an axis with so many sides, before it moves.
    pub(super) fn new(sides: usize) -> Self {
        Self {
            step: Step::Begin,
            since: 0,
            sides,
            mark: 0.0,
            last: [Increments::ZERO; 2],
            edges: [None; 2],
        }
    }

    /// By side, where its switch came on.
    pub(super) fn edges(&self) -> [Option<Edge>; 2] {
        self.edges
    }

    /// Goes on by a cycle.
    ///
    /// # Errors
    /// It cannot succeed.
    pub(super) fn go_on(
        &mut self,
        how: &SwitchSearch,
        seen: &Seen,
    ) -> Result<Progress, HomingFailure> {
        self.since += 1;
        let ended = seen.rests && seen.settled && self.since > TAKEN;
        let any = seen.on[..self.sides].contains(&true);
        let towards = how.direction;
        let progress = match self.step {
            Step::Begin if any => self.enter(Step::Leave, Motion::Run(-towards * how.speed)),
            Step::Begin => self.enter(Step::Search, Motion::Run(towards * how.speed)),
            Step::Leave if !any => self.overrun(seen),
            Step::Leave if ended => return Err(HomingFailure::StaysOn),
            Step::Search if any => self.overrun(seen),
            Step::Search if ended => return Err(HomingFailure::NotFound),
            Step::Overrun if ended => {
                let place = self.mark - towards * how.back_off;
                self.enter(Step::BackOff, Motion::To(place, how.speed))
            }
            Step::BackOff if ended && any => return Err(HomingFailure::StaysOn),
            Step::BackOff if ended => {
                self.enter(Step::Approach, Motion::Run(towards * how.slow_speed))
            }
            Step::Approach => return self.approach(how, seen, ended),
            Step::Arrive if ended => Progress::Found,
            Step::Leave | Step::Search | Step::Overrun | Step::BackOff | Step::Arrive => {
                Progress::Goes
            }
        };
        self.last = seen.counts;
        Ok(progress)
    }

    fn enter(&mut self, step: Step, motion: Motion) -> Progress {
        self.step = step;
        self.since = 0;
        Progress::Moves(motion)
    }

    fn overrun(&mut self, seen: &Seen) -> Progress {
        self.mark = seen.position;
        self.enter(Step::Overrun, Motion::Stop)
    }

    /// Looks for the edges of all sides.
    fn approach(
        &mut self,
        how: &SwitchSearch,
        seen: &Seen,
        ended: bool,
    ) -> Result<Progress, HomingFailure> {
        for side in 0..self.sides {
            if seen.on[side] && self.edges[side].is_none() {
                let (before, now) = (self.last[side].get(), seen.counts[side].get());
                self.edges[side] = Some(Edge {
                    at: Increments::new(before.midpoint(now)),
                    uncertainty: Increments::new((now - before).abs() / 2 + 1),
                });
            }
        }
        self.last = seen.counts;
        let missing = self.edges[..self.sides].iter().position(Option::is_none);
        let passed = (seen.position - self.mark) * how.direction;
        match missing {
            None => Ok(self.enter(Step::Arrive, Motion::Stop)),
            Some(side) if ended || passed > how.back_off => Err(match self.edges {
                [None, None] => HomingFailure::Lost,
                _ => HomingFailure::OneSide { side },
            }),
            Some(_) => Ok(Progress::Goes),
        }
    }
}
