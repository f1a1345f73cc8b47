//! Where a run was worst: blocks in which the tool was furthest from the path, and blocks that took longer than their feed
//! asks for.
//!
//! A block is a stretch of rows of one line. Its greatest contour error stands for it, and the time that it lost: what of each cycle
//! at a programmed feed was not reached of that. Only the worst blocks are kept, so that a program of any length takes as much
//! memory. Of places that are hardly apart the worst alone is told, as one error at a joint is an error of both its blocks.

use super::record::Place;
use serde::Serialize;

/// So many are kept of each kind.
const KEPT: usize = 100;
/// Errors nearer to each other in time, s, are one.
const APART: f64 = 0.1;
/// An error below, mm, or a time below, s, is none.
const LEAST: f64 = 1e-6;

/// A block in which the tool was far from the path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WorstPlace {
    /// Where the error was greatest.
    #[serde(flatten)]
    pub at: Place,
    /// Distance of the tool from the program's moves, mm.
    pub contour_error_mm: f64,
    /// What of it was the setpoint's, mm.
    pub rounding_mm: f64,
    /// Speed along the path then, mm/s.
    pub feed_mm_s: f64,
}

/// A block that was slower than programmed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SlowestPlace {
    /// Where it began.
    #[serde(flatten)]
    pub at: Place,
    /// At a feed, s.
    pub feed_s: f64,
    /// What of that would not have been needed at the programmed feed all the way, s.
    pub lost_s: f64,
}

/// What is seen of a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub(super) at: Place,
    /// Distances of setpoint and tool from the path, mm; nothing while the axes are off it.
    pub(super) off_path: Option<[f64; 2]>,
    /// Speed along the path, mm/s or °/s.
    pub(super) feed: f64,
    /// What part of the speed that is asked for was reached: 0 of a rapid's, which is infinite, and no number at rest.
    pub(super) reached: f64,
    /// Of the row, s.
    pub(super) lasts: f64,
}

/// The block at work, and the worst ones before it.
#[derive(Debug, Default)]
pub(super) struct Places {
    worst: Vec<WorstPlace>,
    slowest: Vec<SlowestPlace>,
    block: Option<(WorstPlace, SlowestPlace)>,
}

impl Places {
    /// Takes a row.
    pub(super) fn observe(&mut self, seen: &Seen) {
        if (self.block).is_some_and(|(_, slow)| slow.at.line != seen.at.line) {
            self.end_block();
        }
        let (worst, slow) = self.block.get_or_insert((
            WorstPlace {
                at: seen.at,
                contour_error_mm: 0.0,
                rounding_mm: 0.0,
                feed_mm_s: 0.0,
            },
            SlowestPlace {
                at: seen.at,
                feed_s: 0.0,
                lost_s: 0.0,
            },
        ));
        if let Some([rounding_mm, contour_error_mm]) = seen.off_path
            && contour_error_mm.is_finite()
            && contour_error_mm > worst.contour_error_mm
        {
            *worst = WorstPlace {
                at: seen.at,
                contour_error_mm,
                rounding_mm,
                feed_mm_s: seen.feed,
            };
        }
        if seen.reached > 0.0 {
            slow.feed_s += seen.lasts;
            slow.lost_s += seen.lasts * (1.0 - seen.reached).max(0.0);
        }
    }

    fn end_block(&mut self) {
        let Some((worst, slow)) = self.block.take() else {
            return;
        };
        if worst.contour_error_mm > LEAST {
            let near = |it: &WorstPlace| (it.at.time - worst.at.time).abs() < APART;
            match self.worst.iter().position(near) {
                Some(same) if self.worst[same].contour_error_mm >= worst.contour_error_mm => {}
                Some(same) => {
                    self.worst.remove(same);
                    keep(&mut self.worst, worst, |it| it.contour_error_mm);
                }
                None => keep(&mut self.worst, worst, |it| it.contour_error_mm),
            }
        }
        if slow.lost_s > LEAST {
            keep(&mut self.slowest, slow, |it| it.lost_s);
        }
    }

    /// The worst ones, worst first.
    pub(super) fn result(mut self) -> (Vec<WorstPlace>, Vec<SlowestPlace>) {
        self.end_block();
        (self.worst, self.slowest)
    }
}

/// Puts a place among the [`KEPT`] that are kept, greatest first.
pub(super) fn keep<T>(kept: &mut Vec<T>, place: T, of: impl Fn(&T) -> f64) {
    let at = kept.partition_point(|it| of(it) >= of(&place));
    kept.insert(at, place);
    kept.truncate(KEPT);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ROW: f64 = 0.002;

    /// Rows of blocks: lines with what is seen of each of their rows.
    fn seen(blocks: &[(u32, Vec<(f64, f64)>)]) -> Vec<Seen> {
        let rows = blocks
            .iter()
            .flat_map(|(line, rows)| rows.iter().map(|it| (*line, *it)));
        rows.enumerate()
            .map(|(n, (line, (error, feed)))| Seen {
                at: Place {
                    time: n as f64 * ROW,
                    line,
                },
                off_path: Some([0.5 * error, error]),
                feed,
                reached: feed / 10.0,
                lasts: ROW,
            })
            .collect()
    }

    fn blocks() -> impl Strategy<Value = Vec<(u32, Vec<(f64, f64)>)>> {
        let row = (0.0..1.0_f64, 0.1..12.0_f64);
        let block = prop::collection::vec(row, 1..120);
        prop::collection::vec(block, 1..300).prop_map(|all| {
            let lines = 1..;
            lines.zip(all).collect()
        })
    }

    proptest! {
        #[test]
        fn the_worst_are_kept_and_are_apart(blocks in blocks()) {
            let all = seen(&blocks);
            let mut places = Places::default();
            all.iter().for_each(|it| places.observe(it));
            let (worst, slowest) = places.result();
            prop_assert!(worst.len() <= KEPT && slowest.len() <= KEPT);
            prop_assert!(worst.is_sorted_by(|a, b| a.contour_error_mm >= b.contour_error_mm));
            let most = all.iter().map(|it| it.off_path.unwrap()[1]).fold(0.0, f64::max);
            prop_assert_eq!(worst[0].contour_error_mm, most);
            for (n, one) in worst.iter().enumerate() {
                let row = &all[(one.at.time / ROW).round() as usize];
                prop_assert_eq!((row.at.line, row.off_path), (one.at.line, Some([one.rounding_mm, one.contour_error_mm])));
                for other in &worst[n + 1..] {
                    prop_assert!((one.at.time - other.at.time).abs() >= APART);
                }
            }
            // The time lost in each block, by hand.
            let mut lost: Vec<f64> = blocks
                .iter()
                .map(|(_, rows)| rows.iter().map(|(_, feed)| ROW * (1.0 - feed / 10.0).max(0.0)).sum())
                .collect();
            lost.sort_by(|a: &f64, b| b.total_cmp(a));
            for (one, other) in slowest.iter().zip(&lost) {
                prop_assert!((one.lost_s - other).abs() < 1e-9, "{} {other}", one.lost_s);
            }
        }
    }

    #[test]
    fn rapids_and_rests_lose_nothing() {
        let mut places = Places::default();
        for reached in [0.0, f64::NAN] {
            places.observe(&Seen {
                at: Place { time: 0.0, line: 1 },
                off_path: None,
                feed: 1.0,
                reached,
                lasts: ROW,
            });
        }
        assert_eq!(places.result(), (vec![], vec![]));
    }
}
