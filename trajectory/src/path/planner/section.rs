//! A stretch of path without a stop, and how far a window on it may go.

use super::{KEPT, NOTHING};
use crate::path::bounds::crawling_time;
use crate::path::window::room_to_stop;
use crate::path::{Limits, PathSegment, PathState};

/// Spans in a window, at most.
const WINDOW_SPANS: usize = 1024;

/// What planning may take for a segment, and for a second of crawling along it, cells times Newton steps.
const WORTH_OF_SEGMENT: f64 = 2e5;
const WORTH_OF_SECOND: f64 = 2e5;

/// Path without a stop.
#[derive(Debug, Clone)]
pub(super) struct Section<const N: usize> {
    /// Those not forgotten yet.
    pub(super) spans: Vec<PathSegment<N>>,
    /// Path length from the beginning of everything.
    pub(super) origin: f64,
    pub(super) length: f64,
    /// No more spans come.
    pub(super) closed: bool,
}

impl<const N: usize> Section<N> {
    pub(super) fn push(&mut self, span: PathSegment<N>) {
        self.spans.push(PathSegment {
            start: self.length,
            ..span
        });
        self.length += span.curve.length();
    }

    /// Forgets what is long passed at `distance`; returns how many spans.
    pub(super) fn forget_before(&mut self, distance: f64) -> usize {
        let passed = self.spans.partition_point(|s| s.start <= distance);
        let surplus = passed.saturating_sub(KEPT);
        if surplus < KEPT {
            return 0;
        }
        self.spans.drain(..surplus);
        surplus
    }

    /// The spans from the one at `distance` on.
    pub(super) fn from(&self, distance: f64) -> &[PathSegment<N>] {
        let passed = self.spans.partition_point(|s| s.start <= distance);
        &self.spans[passed.saturating_sub(1)..]
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
        let ahead = self.from(from).iter().take_while(|span| span.start < to);
        let worth = |span: &PathSegment<N>| {
            let length = span.curve.length();
            let passed = (to - span.start).min(length) - (from - span.start).max(0.0);
            let crawl = crawling_time(&span.curve, span.speed, limits);
            passed / length * (WORTH_OF_SEGMENT + WORTH_OF_SECOND * crawl)
        };
        ahead.map(worth).sum()
    }

    /// Least time of travel from `distance` to the end of what is known, s.
    pub(super) fn time_from(&self, distance: f64, limits: &Limits<N>) -> f64 {
        let spans = self.from(distance);
        if spans.len() > WINDOW_SPANS {
            return f64::INFINITY;
        }
        let left = |span: &PathSegment<N>| {
            let end = span.start + span.curve.length();
            (end - span.start.max(distance)).max(0.0) / top_speed(span, limits)
        };
        spans.iter().map(left).sum()
    }
}

/// The distance that is reached from `from` within `time`, at the earliest.
pub(super) fn reach<const N: usize>(
    spans: &[PathSegment<N>],
    from: f64,
    time: f64,
    limits: &Limits<N>,
) -> f64 {
    let mut left = time;
    let mut at = from;
    for span in spans.iter().take(WINDOW_SPANS) {
        let end = span.start + span.curve.length();
        if end <= at {
            continue;
        }
        let speed = top_speed(span, limits);
        let needed = (end - at) / speed;
        // A rest of the span that is not worth a window of its own goes with it.
        if needed > 1.25 * left {
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

fn top_speed<const N: usize>(span: &PathSegment<N>, limits: &Limits<N>) -> f64 {
    let axes = (0..N)
        .map(|i| limits.velocity[i] * limits.velocity[i])
        .sum::<f64>()
        .sqrt();
    let along = span.curve.direction().map_or(axes, |d| {
        (0..N)
            .map(|i| limits.velocity[i] / d[i].abs())
            .fold(f64::INFINITY, f64::min)
    });
    along.min(span.speed)
}

/// The end of the block that is under way at `from`, or of the first one where it is likely that
/// the path can rest from there.
pub(super) fn block_end<const N: usize>(
    spans: &[PathSegment<N>],
    closed: bool,
    from: PathState,
    limits: &Limits<N>,
) -> f64 {
    let room = room_to_stop(spans, limits, from);
    let last = spans.len() - 1;
    (0..=last)
        .filter(|&k| {
            if k < last {
                spans[k + 1].tag != spans[k].tag
            } else {
                closed
            }
        })
        .map(|k| spans[k].start + spans[k].curve.length())
        .find(|end| end - from.distance >= 0.8 * room)
        .unwrap_or(f64::INFINITY)
}
