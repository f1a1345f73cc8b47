//! Bursts that missed their SYNC, by bus: what is counted and what is a fault.

use super::fault::{BusCause, BusIndex, Fault};
use std::collections::VecDeque;

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
    /// An answer to an SDO request has come since then.
    pub(super) answered: bool,
}

impl SetpointMisses {
    pub(super) fn new(bus: BusIndex) -> Self {
        Self {
            bus,
            count: 0,
            last: VecDeque::with_capacity(MISSES),
            unsent: 0,
            answered: false,
        }
    }

    /// What was missed so far counts towards no fault any more.
    pub(super) fn forgive(&mut self) {
        self.last.clear();
        self.unsent = 0;
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

    fn faults(cycles: &[u64]) -> bool {
        let mut misses = SetpointMisses::new(0);
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
}
