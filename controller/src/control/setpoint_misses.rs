//! Bursts that missed their SYNC, by bus: what is counted and what is a fault.
//!
//! While axes stand, drives may be asked by SDO beside SYNC, and on a full bus an answer may be in the way of a burst. That is
//! no miss if the drives have already what came late: if each frame that had not left by SYNC is, byte for byte, the one of the
//! burst before. A burst leaves in its order, so these are its last ones; those before them may be others, as what the position loops
//! of drives at rest are sent follows their encoders' noise.

use super::fault::{BusCause, BusIndex, Fault};
use std::collections::VecDeque;
use std::mem::take;
use syncline_canopen::Frame;

/// Bursts missed within [`WINDOW`] cycles that are a fault.
const MISSES: usize = 3;
/// Cycles over which misses are counted.
const WINDOW: u64 = 1000;

/// One bus' record.
#[derive(Clone, Debug)]
pub(super) struct SetpointMisses {
    bus: BusIndex,
    /// Bursts that missed their SYNC.
    pub(super) count: u64,
    /// The cycles of the last misses.
    last: VecDeque<u64>,
    /// Frames of the last burst whose echo is still to come.
    pub(super) unsent: u32,
    /// An answer to an SDO request has come between the last burst's wake-up and SYNC.
    pub(super) answered: bool,
    /// The last burst, if no axis moved.
    last_burst: Vec<Frame>,
    /// How many frames at its end are as those of the one before.
    repeats: u32,
}

impl SetpointMisses {
    /// Of a bus with so many R_PDOs.
    pub(super) fn new(bus: BusIndex, r_pdos: usize) -> Self {
        Self {
            bus,
            count: 0,
            last: VecDeque::with_capacity(MISSES),
            unsent: 0,
            answered: false,
            last_burst: Vec::with_capacity(r_pdos),
            repeats: 0,
        }
    }

    /// What was missed so far counts towards no fault any more.
    pub(super) fn forgive(&mut self) {
        self.last.clear();
        self.unsent = 0;
    }

    /// Keeps a burst, for whether the next one is another.
    pub(super) fn keep(&mut self, burst: &[Frame], is_moving: bool) {
        let pairs = burst.iter().rev().zip(self.last_burst.iter().rev());
        let alike = pairs.take_while(|(now, before)| now == before).count();
        let is_comparable = !is_moving && burst.len() == self.last_burst.len();
        self.repeats = if is_comparable { alike as u32 } else { 0 };
        self.forget_burst();
        if !is_moving {
            self.last_burst.extend_from_slice(burst);
        }
    }

    /// The last burst has not left.
    pub(super) fn forget_burst(&mut self) {
        self.last_burst.clear();
    }

    /// Whether the last burst missed its SYNC: not all of it has left by now, and it was not an answer in the way of what the drives
    /// have already.
    pub(super) fn has_missed(&mut self) -> bool {
        let (unsent, answered) = (take(&mut self.unsent), take(&mut self.answered));
        let has_missed = unsent > 0 && !(answered && unsent <= self.repeats);
        if has_missed {
            self.forget_burst();
        }
        has_missed
    }

    /// Counts a miss in `cycle`: one is tolerated; two in a row, or three in 1,000 cycles, are
    /// not.
    pub(super) fn miss(&mut self, cycle: u64) -> Result<(), Fault> {
        self.count += 1;
        let in_a_row = self.last.back().is_some_and(|&last| cycle <= last + 1);
        if self.last.len() == MISSES {
            self.last.pop_front();
        }
        self.last.push_back(cycle);
        let crowded = self.last.len() == MISSES && cycle < self.last[0] + WINDOW;
        if in_a_row || crowded {
            let count = self.count;
            return Err(Fault::Bus(self.bus, BusCause::LateSetpoints { count }));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syncline_canopen::{CobId, NodeId};

    fn faults(cycles: &[u64]) -> bool {
        let mut misses = SetpointMisses::new(0, 0);
        let mut outcomes = cycles.iter().map(|&cycle| misses.miss(cycle));
        outcomes.any(|outcome| outcome.is_err())
    }

    #[test]
    fn one_miss_is_counted_two_in_a_row_or_three_in_a_thousand_are_a_fault() {
        assert!(!faults(&[10]));
        assert!(!faults(&[10, 12]));
        assert!(faults(&[10, 11]));
        assert!(faults(&[10, 12, 1009]));
        assert!(!faults(&[10, 12, 1010]));
        assert!(!faults(&[10, 600, 1100, 1700]));
        assert!(faults(&[10, 600, 1100, 1500]));
    }

    /// Bursts of a bus in motion or at rest, in one of which a byte changes, each with an answer in its way or without.
    #[test]
    fn an_answer_is_in_the_way_of_no_burst_that_is_another() {
        let frame = |byte| Frame::new(CobId::r_pdo(1, NodeId::new(1).unwrap()), &[byte]);
        let mut misses = SetpointMisses::new(0, 2);
        let mut missed = |bytes: [u8; 2], is_moving, answered, unsent| {
            misses.keep(&bytes.map(frame), is_moving);
            (misses.unsent, misses.answered) = (unsent, answered);
            misses.has_missed()
        };
        assert!(missed([1, 2], false, true, 1), "the first is another");
        assert!(
            missed([1, 2], false, true, 1),
            "the one before has not come"
        );
        assert!(!missed([1, 2], false, false, 0));
        assert!(!missed([1, 2], false, true, 1));
        assert!(missed([1, 2], false, false, 1), "nothing was in its way");
        assert!(!missed([1, 2], false, false, 0));
        assert!(missed([1, 3], false, true, 2), "an output of it changes");
        assert!(!missed([1, 3], false, false, 0));
        assert!(!missed([2, 3], false, true, 1), "what changes has left");
        assert!(missed([3, 3], false, true, 2), "and here it has not");
        assert!(!missed([1, 3], false, false, 0));
        assert!(missed([1, 3], true, true, 1), "in motion");
        assert!(!missed([1, 3], false, false, 0));
        assert!(!missed([1, 3], false, true, 1));
        misses.forget_burst();
        misses.keep(&[1, 3].map(frame), false);
        (misses.unsent, misses.answered) = (1, true);
        assert!(misses.has_missed(), "the one before was dropped");
    }
}
