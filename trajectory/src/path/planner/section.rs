//! A stretch of path without a stop, and how far a window on it may go.

use std::collections::VecDeque;

use super::{KEPT, NOTHING};
use crate::path::bounds::{Bounds, time_inside};
use crate::path::segment_fitting::MoveEnd;
use crate::path::window::room_to_stop;
use crate::path::{Curve, Limits, PathSegment, PathState};

/// Path segments in a window, at most.
const WINDOW_PATH_SEGMENTS: usize = 1024;

/// What planning may take for a segment, and for a second of crawling along it, cells times Newton steps.
const WORTH_OF_SEGMENT: f64 = 2e5;
const WORTH_OF_SECOND: f64 = 2e5;

/// A path segment that takes no longer than this, by the time that is left, goes with the window.
const WORTH_A_WINDOW: f64 = 1.25;
/// Part of the room to stop in which the path is likely to come to rest; if it does not, the block's end is
/// not where it rests.
const LIKELY: f64 = 0.8;
/// Ends of moves nearer to each other than this, mm, are one: rounding of lengths.
const SAME_END: f64 = 1e-7;

/// Path without a stop.
#[derive(Debug, Clone)]
pub(super) struct Section<const N: usize> {
    /// Those not forgotten yet.
    pub(super) path_segments: Vec<PathSegment<N>>,
    /// Where on the section the moves of those end, in order; the last one's may still be further on.
    pub(super) ends: VecDeque<MoveEnd>,
    /// Path length from the beginning of everything.
    pub(super) origin: f64,
    pub(super) length: f64,
    /// No more path segments come.
    pub(super) closed: bool,
}

impl<const N: usize> Section<N> {
    /// Goes on with a path segment; on it other moves end, at these distances from its start, before the one with its
    /// tag.
    pub(super) fn push(&mut self, path_segment: PathSegment<N>, ends: &[MoveEnd]) {
        let start = self.length;
        self.path_segments.push(PathSegment {
            start,
            ..path_segment
        });
        self.length += path_segment.curve.length();
        // Its move goes on, though others of that curve end first.
        let goes_on = |end: &MoveEnd| end.tag == path_segment.tag;
        if self.ends.back().is_some_and(goes_on) {
            self.ends.pop_back();
        }
        let at = |end: &MoveEnd| MoveEnd {
            at: start + end.at,
            ..*end
        };
        self.ends.extend(ends.iter().map(at));
        self.ends.push_back(MoveEnd {
            tag: path_segment.tag,
            at: self.length,
        });
    }

    /// The last so many mm are the rounding behind a move: that one ends in it, and others besides, at these distances from
    /// where it begins.
    pub(super) fn end_in_rounding(&mut self, length: f64, ends: &[MoveEnd]) {
        let start = self.length - length;
        self.ends.pop_back();
        self.ends.extend(ends.iter().map(|end| MoveEnd {
            at: start + end.at,
            ..*end
        }));
    }

    /// No more path segments come. It is kept for as long as it can be retraced, without room for others.
    pub(super) fn close(&mut self) {
        self.closed = true;
        self.path_segments.shrink_to_fit();
    }

    /// Where the move begins in which the path is that has come to `distance`, or ended.
    pub(super) fn move_start(&self, distance: f64) -> f64 {
        let ended = self
            .ends
            .partition_point(|end| end.at < distance - SAME_END);
        let before = ended.checked_sub(1).and_then(|last| self.ends.get(last));
        before.map_or(self.known_from(), |end| end.at)
    }

    /// Where the path segments begin that are not forgotten.
    fn known_from(&self) -> f64 {
        self.path_segments
            .first()
            .map_or(0.0, |path_segment| path_segment.start)
    }

    /// Forgets what is long passed at `distance`; returns how many path segments.
    pub(super) fn forget_before(&mut self, distance: f64) -> usize {
        let passed = self.path_segments.partition_point(|s| s.start <= distance);
        let surplus = passed.saturating_sub(KEPT);
        if surplus < KEPT {
            return 0;
        }
        self.path_segments.drain(..surplus);
        let from = self.known_from();
        let ended = self.ends.partition_point(|end| end.at <= from);
        self.ends.drain(..ended);
        surplus
    }

    /// The path segments from the one at `distance` on.
    pub(super) fn from(&self, distance: f64) -> &[PathSegment<N>] {
        let passed = self.path_segments.partition_point(|s| s.start <= distance);
        &self.path_segments[passed.saturating_sub(1)..]
    }

    /// The path rests there.
    pub(super) fn ends_at(&self, distance: f64) -> bool {
        self.closed && self.reaches_end(distance)
    }

    pub(super) fn reaches_end(&self, distance: f64) -> bool {
        distance >= self.length - NOTHING
    }

    /// What planning may take for the path between two distances, cells times Newton steps: in proportion to
    /// its segments and to the time that crawling along them takes.
    pub(super) fn worth(&self, from: f64, to: f64, limits: &Limits<N>) -> f64 {
        let ahead = self
            .from(from)
            .iter()
            .take_while(|path_segment| path_segment.start < to);
        let worth = |path_segment: &PathSegment<N>| {
            let length = path_segment.curve.length();
            let passed =
                (to - path_segment.start).min(length) - (from - path_segment.start).max(0.0);
            let crawl = time_inside(length, Bounds::of(path_segment, limits));
            passed / length * (WORTH_OF_SEGMENT + WORTH_OF_SECOND * crawl)
        };
        ahead.map(worth).sum()
    }

    /// Least time of travel from `distance` to the end of what is known, s.
    pub(super) fn time_from(&self, distance: f64, limits: &Limits<N>) -> f64 {
        let path_segments = self.from(distance);
        if path_segments.len() > WINDOW_PATH_SEGMENTS {
            return f64::INFINITY;
        }
        let left = |path_segment: &PathSegment<N>| {
            let end = path_segment.start + path_segment.curve.length();
            (end - path_segment.start.max(distance)).max(0.0) / top_speed(path_segment, limits)
        };
        path_segments.iter().map(left).sum()
    }
}

/// The distance that is reached from `from` within `time`, at the earliest.
pub(super) fn reach<const N: usize>(
    path_segments: &[PathSegment<N>],
    from: f64,
    time: f64,
    limits: &Limits<N>,
) -> f64 {
    let mut left = time;
    let mut at = from;
    for path_segment in path_segments.iter().take(WINDOW_PATH_SEGMENTS) {
        let end = path_segment.start + path_segment.curve.length();
        if end <= at {
            continue;
        }
        let speed = top_speed(path_segment, limits);
        let needed = (end - at) / speed;
        // A rest of the path segment that is not worth a window of its own goes with it.
        if needed > WORTH_A_WINDOW * left {
            return at + left * speed;
        }
        at = end;
        left -= needed;
        if left <= 0.0 {
            break;
        }
    }
    at
}

fn top_speed<const N: usize>(path_segment: &PathSegment<N>, limits: &Limits<N>) -> f64 {
    let most = match path_segment.clock {
        Some(clock) => clock.velocity[0],
        None => most_speed(&path_segment.curve, limits),
    };
    most.min(path_segment.speed)
}

/// No axis lets the path along a curve be faster, mm/s.
pub(super) fn most_speed<const N: usize>(curve: &Curve<N>, limits: &Limits<N>) -> f64 {
    match curve.direction() {
        Some(along) => (0..N)
            .map(|i| limits.velocity[i] / along[i].abs())
            .fold(f64::INFINITY, f64::min),
        None => {
            let squares = limits.velocity.iter().map(|most| most * most);
            squares.sum::<f64>().sqrt()
        }
    }
}

/// The end of the block that is under way at `from`, or of the first one where it is likely that
/// the path can rest from there.
pub(super) fn block_end<const N: usize>(
    section: &Section<N>,
    path_segments: &[PathSegment<N>],
    from: PathState,
    limits: &Limits<N>,
) -> f64 {
    let room = (LIKELY * room_to_stop(path_segments, limits, from)).max(NOTHING);
    let first = (section.ends).partition_point(|end| end.at - from.distance < room);
    // What comes next may yet end in a rounding, but where the path is laid beyond it.
    let is_known = |end: &&MoveEnd| section.closed || end.at < section.length - NOTHING;
    let end = section.ends.get(first).filter(is_known);
    end.map_or(f64::INFINITY, |end| end.at)
}
