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
//! A drive that captures the edge knows it better, whatever the speed. It is told to before the approach, and asked
//! after it, by SDO: so while no axis of the group moves, and axes that come there wait for each other. The
//! samples say what it may have captured: an edge far from theirs is not that of the switch.
//!
//! # Why it ends
//!
//! Each step has a motion that ends by itself: inside [`SwitchSearch::max_distance`] of where the homing
//! began, or at a position. A step that finds its motion over, and not what it waits for, fails.

use super::{HomingFailure, is_near, too_near};
use crate::machine::SwitchSearch;
use syncline_drives::model::Increments;

/// Cycles after which an order to an axis has begun to move it, whatever other axes are ordered.
const TAKEN: u64 = 10;

/// So many times the error of an edge by samples, four cycles of motion, may their levels come later than the edge
/// that the drive captured: what filters of inputs delay.
const LATER: i64 = 8;

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
    /// By side: what is no motion of the drive.
    pub(super) window: [Increments; 2],
    /// No axis of the group moves, or will before this one has gone on.
    pub(super) quiet: bool,
    /// The drives have answered what they were asked.
    pub(super) answered: bool,
    /// By side: the edge that its drive said that it has captured.
    pub(super) captured: [Option<Edge>; 2],
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
    /// It rests until no axis of the group moves.
    Waits,
    /// The drives are to capture the next edges.
    Arms,
    /// They are to tell what they captured.
    Reads,
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
    /// There, until drives may be told to capture its edge.
    Backed,
    /// Until they have been.
    Arming,
    /// Slowly onto it.
    Approach,
    /// Coming to rest on it.
    Arrive,
    /// There, until drives may be asked for its edge.
    Arrived,
    /// Until they have told it.
    Reading,
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

    /// From now on the index behind the edge of a single side counts, where its drive counts a whole number of turns of so
    /// many increments, upwards or downwards as the sign of `towards` has it; how near to the edge it, or the one before it,
    /// is if that is to be told.
    ///
    /// # Errors
    /// It is too near, also where the edge may be off by that much.
    pub(super) fn take_index(
        &mut self,
        turn: Increments,
        towards: f64,
    ) -> Result<Option<Increments>, HomingFailure> {
        let Some(edge) = &mut self.edges[0] else {
            return Ok(None);
        };
        let (at, turn) = (edge.at.get(), turn.get());
        let index = match towards > 0.0 {
            true => at + (-at).rem_euclid(turn),
            false => at - at.rem_euclid(turn),
        };
        let behind = (index - at).abs();
        let near = behind.min(turn - behind);
        let part = near as f64 / turn as f64;
        if near <= edge.uncertainty.get() {
            return Err(too_near(part));
        }
        let is_near = is_near(part)?;
        *edge = Edge {
            at: Increments::new(index),
            uncertainty: Increments::new(1),
        };
        Ok(is_near.then_some(Increments::new(near)))
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
            Step::Leave if ended => return Err(HomingFailure::NeverOff),
            Step::Search if any => self.overrun(seen),
            Step::Search if ended => return Err(HomingFailure::NotFound),
            Step::Overrun if ended => {
                let place = self.mark - towards * how.back_off;
                self.enter(Step::BackOff, Motion::To(place, how.speed))
            }
            Step::BackOff if ended && any => return Err(HomingFailure::StaysOn),
            Step::BackOff if ended && !how.captures.is_empty() => {
                self.at(Step::Backed, Progress::Waits)
            }
            Step::Backed if seen.quiet => self.at(Step::Arming, Progress::Arms),
            Step::Arming if !seen.answered => Progress::Goes,
            Step::BackOff if !ended => Progress::Goes,
            Step::BackOff | Step::Arming => {
                self.enter(Step::Approach, Motion::Run(towards * how.slow_speed))
            }
            Step::Approach => return self.approach(how, seen, ended),
            Step::Arrive if ended && !how.captures.is_empty() => {
                self.at(Step::Arrived, Progress::Waits)
            }
            Step::Arrived if seen.quiet => self.at(Step::Reading, Progress::Reads),
            Step::Backed | Step::Arrived => Progress::Waits,
            Step::Reading if seen.answered => {
                self.take_captured(seen)?;
                Progress::Found
            }
            Step::Arrive if ended => Progress::Found,
            Step::Leave | Step::Search | Step::Overrun | Step::Arrive | Step::Reading => {
                Progress::Goes
            }
        };
        self.last = seen.counts;
        Ok(progress)
    }

    fn enter(&mut self, step: Step, motion: Motion) -> Progress {
        self.at(step, Progress::Moves(motion))
    }

    fn at(&mut self, step: Step, progress: Progress) -> Progress {
        self.step = step;
        self.since = 0;
        progress
    }

    /// Why its axis may not have followed, if the switch has to do with it.
    pub(super) fn blocked(&self) -> Option<HomingFailure> {
        match self.step {
            Step::Search => Some(HomingFailure::BlockedBefore),
            Step::Leave => Some(HomingFailure::BlockedOnSwitch),
            _ => None,
        }
    }

    /// Whether it rests until no axis of the group moves.
    pub(super) fn waits(&self) -> bool {
        matches!(self.step, Step::Backed | Step::Arrived)
    }

    /// Takes the edges that the drives captured for those of the samples.
    fn take_captured(&mut self, seen: &Seen) -> Result<(), HomingFailure> {
        let sides = self.edges[..self.sides].iter_mut().enumerate();
        for (side, sampled) in sides {
            let captured = seen.captured[side].ok_or(HomingFailure::NotCaptured { side })?;
            if let Some(sampled) = sampled.replace(captured) {
                let apart = (captured.at - sampled.at).get().abs();
                let most = LATER * sampled.uncertainty.get() + seen.window[side].get();
                if apart > most {
                    return Err(HomingFailure::OtherEdge { side });
                }
            }
        }
        Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;
    use syncline_drives::model::REFERENCE;

    const ONE: Increments = Increments::new(1);

    /// A search from −50 to a switch at 0 that a drive captures, at 1000 increments a millimetre and 1 ms.
    fn how() -> SwitchSearch {
        SwitchSearch {
            inputs: vec![0],
            captures: REFERENCE.capture(0, true).into_iter().collect(),
            is_shared: false,
            by_index: false,
            direction: 1.0,
            speed: 20.0,
            slow_speed: 2.0,
            back_off: 1.0,
            max_distance: 100.0,
            max_time: Duration::from_secs(60),
            position: 0.0,
            final_position: 0.0,
        }
    }

    /// Lets an axis do at once what the search says, with a drive that says it has captured that.
    fn search(captured: Option<i64>) -> (Result<Progress, HomingFailure>, Search, u32) {
        let (how, mut search) = (how(), Search::new(1));
        let (mut position, mut motion, mut asked) = (-50.0_f64, Motion::Stop, 0);
        for _ in 0..100_000 {
            let rests = !matches!(motion, Motion::Run(_));
            let there = Increments::new((position * 1000.0) as i64);
            let seen = Seen {
                position,
                rests,
                settled: true,
                on: [position >= 0.0, false],
                counts: [there; 2],
                window: [ONE; 2],
                quiet: search.waits(),
                answered: true,
                captured: [
                    captured.map(|at| Edge {
                        at: Increments::new(at),
                        uncertainty: ONE,
                    }),
                    None,
                ],
            };
            match search.go_on(&how, &seen) {
                Ok(Progress::Goes | Progress::Waits) => {}
                Ok(Progress::Moves(next)) => motion = next,
                Ok(Progress::Arms | Progress::Reads) => {
                    asked += 1;
                    assert!(rests, "asked in motion");
                }
                end => return (end, search, asked),
            }
            match motion {
                Motion::Run(speed) => position += 1e-3 * speed,
                Motion::Stop => {}
                Motion::To(there, _) => position = there,
            }
        }
        panic!("it does not end");
    }

    #[test]
    fn the_captured_edge_counts() {
        let (end, search, asked) = search(Some(-1));
        assert_eq!((end, asked), (Ok(Progress::Found), 2));
        let edge = search.edges()[0].unwrap();
        assert_eq!((edge.at.get(), edge.uncertainty), (-1, ONE));
    }

    #[test]
    fn an_edge_that_was_not_captured_or_is_elsewhere_is_none() {
        let missing = HomingFailure::NotCaptured { side: 0 };
        assert_eq!(search(None).0, Err(missing));
        let elsewhere = HomingFailure::OtherEdge { side: 0 };
        for at in [-500, 500] {
            assert_eq!(search(Some(at)).0, Err(elsewhere));
        }
    }
}
