//! What an axis did that goes point to point: its moves, how long they took, and how far from their targets it came to rest.
//!
//! It follows no plan that it could be held against; where and when it arrives is what a program waits for.

use super::record::Place;
use super::summary::PositioningSummary;
use crate::control::AxisSample;

/// What is seen of one axis.
#[derive(Debug, Default)]
pub(super) struct Positioning {
    /// When the move under way began, s, and the cycle and the line of its last row.
    under_way: Option<(f64, u64, u32)>,
    seen: Option<PositioningSummary>,
}

impl Positioning {
    /// Takes what it did at one SYNC. It has arrived in the cycle in which it is held against its target again: at rest, which
    /// it takes a while to see.
    pub(super) fn observe(&mut self, sample: &AxisSample, cycle: u64, at: Place) {
        if sample.by_itself {
            let began = self.under_way.map_or(at.time, |(began, ..)| began);
            self.under_way = (!sample.in_homing).then_some((began, cycle, at.line));
            return;
        }
        let Some((began, last, line)) = self.under_way.take() else {
            return;
        };
        // Behind a gap it was brought to rest by something else.
        if cycle != last + 1 {
            return;
        }
        let at = Place { line, ..at };
        let seen = self.seen.get_or_insert_default();
        seen.moves += 1;
        seen.position_mm = sample.act;
        let (takes, error) = (at.time - began, (sample.set - sample.act).abs());
        if takes > seen.longest_s {
            (seen.longest_s, seen.longest_at) = (takes, at);
        }
        if error >= seen.max_error_mm {
            (seen.max_error_mm, seen.max_error_at) = (error, at);
        }
    }

    /// All of it; `None` without a move.
    pub(super) fn summary(&self) -> Option<PositioningSummary> {
        self.seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An axis that goes to 10 mm by itself in these cycles, and is 0.01 mm short of it.
    fn went(by_itself: &[(u64, bool)]) -> Option<PositioningSummary> {
        let mut positioning = Positioning::default();
        for &(cycle, by_itself) in by_itself {
            let sample = AxisSample {
                by_itself,
                set: 10.0,
                act: 9.99,
                ..AxisSample::default()
            };
            let time = cycle as f64 * 0.002;
            positioning.observe(&sample, cycle, Place { time, line: 3 });
        }
        positioning.summary()
    }

    #[test]
    fn a_move_ends_where_it_is_held_against_its_target() {
        assert_eq!(went(&[(1, false), (2, false)]), None);
        assert_eq!(went(&[(1, true), (2, true)]), None);
        let seen = went(&[
            (1, true),
            (2, true),
            (3, false),
            (4, false),
            (5, true),
            (6, false),
        ]);
        let seen = seen.unwrap();
        assert_eq!((seen.moves, seen.position_mm), (2, 9.99));
        assert!((seen.longest_s - 0.004).abs() < 1e-12);
        assert!((seen.max_error_mm - 0.01).abs() < 1e-12);
        // Something else brought it to rest.
        assert_eq!(went(&[(1, true), (2, true), (9, false)]), None);
    }
}
