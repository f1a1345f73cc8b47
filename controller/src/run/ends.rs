//! Two threads tell of a job that is over: the cycle that it is, the planner what it has left. What it has left says that
//! nothing more comes of it, so each is told behind the cycle's own report of that end, whichever of the two was faster.

use super::CycleReport;
use crate::control::{Event, Order, Outcome};
use crate::program::{Left, Program};
use std::collections::VecDeque;

/// What the planner has told of jobs that are over, until the cycle has reported their ends.
#[derive(Default)]
pub(super) struct Ends {
    /// The last job whose end the cycle has reported.
    reported: Option<u64>,
    left: VecDeque<(u64, Outcome, Option<Left>)>,
}

impl Ends {
    /// The cycle has reported that a job is over.
    pub(super) fn reported(&mut self, job: u64) {
        self.reported = self.reported.max(Some(job));
    }

    /// The cycle is over and reports nothing more.
    pub(super) fn all_reported(&mut self) {
        self.reported = Some(u64::MAX);
    }

    /// The planner has told what a job has left.
    pub(super) fn left(&mut self, job: u64, outcome: Outcome, left: Option<Left>) {
        self.left.push_back((job, outcome, left));
    }

    /// What can be told now.
    pub(super) fn next(&mut self) -> Option<(u64, Outcome, Option<Left>)> {
        let (job, ..) = self.left.front()?;
        let is_due = Some(*job) <= self.reported;
        is_due.then(|| self.left.pop_front()).flatten()
    }

    pub(super) fn is_empty(&self) -> bool {
        self.left.is_empty()
    }
}

/// The jobs that the planner was handed and that are not over, the oldest first.
#[derive(Default)]
pub(super) struct HandedOver {
    jobs: Vec<(u64, Program)>,
    /// The orders to begin them that the cycle has not answered: the number of each, and the job's.
    begins: VecDeque<(u64, u64)>,
}

impl HandedOver {
    /// The planner is handed a job.
    pub(super) fn hand_over(&mut self, job: u64, program: Program) {
        self.jobs.push((job, program));
    }

    /// The last of them.
    pub(super) fn last(&self) -> Option<u64> {
        self.jobs.last().map(|(job, _)| *job)
    }

    /// The cycle is given this order.
    pub(super) fn ordered(&mut self, number: u64, order: &Order) {
        if let Order::Begin(job) | Order::TakeUp(job) = order {
            self.begins.push_back((number, job.number));
        }
    }

    /// The cycle reports something: a job that it refuses is nobody's any more, and one that is over.
    pub(super) fn reported(&mut self, report: &CycleReport) {
        match report {
            CycleReport::Event(Event::JobOver { job, .. }) => self.over(*job),
            CycleReport::Obeyed { number, .. } => {
                // Also those before it, whose report may be lost.
                self.begins.retain(|(order, _)| order > number);
            }
            CycleReport::Refused { number, .. } => {
                let refused = self.begins.iter().find(|(order, _)| order == number);
                if let Some((_, job)) = refused.copied() {
                    self.drop_those(|number| number == job);
                }
                self.begins.retain(|(order, _)| order > number);
            }
            _ => {}
        }
    }

    /// A job is over, and so are all that were handed over before it, or never began: nobody wants them any more. Without
    /// that one that computes without end would keep the planner from those behind it.
    pub(super) fn over(&mut self, job: u64) {
        self.drop_those(|number| number <= job);
    }

    fn drop_those(&mut self, is_over: impl Fn(u64) -> bool) {
        self.jobs.retain(|(number, program)| {
            let is_over = is_over(*number);
            if is_over {
                program.abandon();
            }
            !is_over
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::MachineFunctions;
    use crate::control::{Job, Refusal};
    use crate::machine::Machine;
    use std::path::Path;

    /// Whatever was handed over, and began or did not: what comes before a job that is over, and that itself, is wanted no more,
    /// and what comes behind it still is.
    #[test]
    fn a_job_that_is_over_takes_those_before_it_along() {
        let portal = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/portal/machine.toml");
        let machine = Machine::load(&portal).unwrap();
        let program = Program::new(Path::new("p.ngc"), &machine, &portal).unwrap();
        for over in 0..=6 {
            let mut jobs = HandedOver::default();
            let programs = [1, 2, 4, 5].map(|job| (job, program.apart()));
            for (job, program) in &programs {
                jobs.hand_over(*job, program.clone());
            }
            jobs.over(over);
            for (job, program) in &programs {
                assert_eq!(program.is_abandoned(), *job <= over, "{job} {over}");
            }
            assert_eq!(jobs.last(), Some(5).filter(|last| *last > over));
        }
    }

    /// A job that the cycle refuses is wanted no more, whichever of several it is; all others still are.
    #[test]
    fn a_job_that_is_refused_is_dropped() {
        let portal = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/portal/machine.toml");
        let machine = Machine::load(&portal).unwrap();
        let program = Program::new(Path::new("p.ngc"), &machine, &portal).unwrap();
        for refused in 0..3 {
            let mut jobs = HandedOver::default();
            let programs = [1, 2, 3].map(|job| (job, program.apart()));
            for (job, program) in &programs {
                jobs.hand_over(*job, program.clone());
                let begins = Job {
                    number: *job,
                    ..Job::ONLY
                };
                jobs.ordered(10 * job, &Order::Begin(begins));
                jobs.ordered(10 * job + 1, &Order::FeedHold);
            }
            for (place, (job, _)) in programs.iter().enumerate() {
                let (number, cycle) = (10 * job, 0);
                jobs.reported(&match place == refused {
                    true => CycleReport::Refused {
                        number,
                        cycle,
                        refusal: Refusal::DoorOpen,
                    },
                    false => CycleReport::Obeyed {
                        number,
                        cycle,
                        functions: MachineFunctions::default(),
                    },
                });
                // An order of another kind drops none.
                jobs.reported(&CycleReport::Refused {
                    number: number + 1,
                    cycle,
                    refusal: Refusal::DoorOpen,
                });
            }
            for (place, (_, program)) in programs.iter().enumerate() {
                assert_eq!(program.is_abandoned(), place == refused);
            }
            assert_eq!(jobs.jobs.len(), 2);
            assert!(jobs.begins.is_empty());
        }
    }

    /// Each end is told once, in order, and behind the cycle's report of it, however the two threads are interleaved.
    #[test]
    fn what_a_job_has_left_comes_behind_its_end() {
        for choices in 0..1_u32 << 8 {
            let mut ends = Ends::default();
            let (mut reported, mut left, mut told) = (0, 0, 0);
            for step in 0..8 {
                if choices >> step & 1 == 0 {
                    reported += 1;
                    ends.reported(reported);
                } else {
                    left += 1;
                    ends.left(left, Outcome::Stopped, None);
                }
                while let Some((job, ..)) = ends.next() {
                    told += 1;
                    assert_eq!(job, told);
                }
                assert_eq!(told, reported.min(left), "{choices:b}");
            }
            ends.all_reported();
            while let Some((job, ..)) = ends.next() {
                told += 1;
                assert_eq!(job, told);
            }
            assert!(told == left && ends.is_empty(), "{choices:b}");
        }
    }
}
