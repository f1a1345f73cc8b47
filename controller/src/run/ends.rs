//! Two threads tell of a job that is over: the cycle that it is, the planner what it has left. What it has left says that
//! nothing more comes of it, so each is told behind the cycle's own report of that end, whichever of the two was faster.

use crate::control::Outcome;
use crate::program::Left;
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

#[cfg(test)]
mod tests {
    use super::*;

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
