//! How the path waits for setpoints that come later than it, and knows where it has been meanwhile.
//!
//! A [shaper](crate::path::shaping) of the path's clock sends the axes to where the path was lately, in the mean. That is a
//! place of the path only as long as all that is in the mean is one way: behind a corner, after a jog, and where the path turns
//! back it begins once the axes rest. Which cycle that is has to be known ahead, for a new plan takes over from a state that
//! was told beforehand, so it is counted when the steps are committed.

use std::collections::VecDeque;

use super::{Executor, Step, any_path_segment, touch};
use crate::path::{Derivatives, PathSegment};
use crate::shaper::Spread;

/// What is kept for setpoints that come later; nothing where none do.
#[derive(Debug)]
pub(super) struct Settled<const N: usize> {
    /// How long the axes take to come to rest behind the path, s, and how many cycles of it setpoints are made of.
    pub(super) settling: f64,
    pub(super) cycles: u64,
    /// Path segments that the path has left, each with the cycle in which it did.
    pub(super) passed: VecDeque<(u64, PathSegment<N>)>,
}

impl<const N: usize> Default for Settled<N> {
    fn default() -> Self {
        Self {
            settling: 0.0,
            cycles: 0,
            passed: VecDeque::new(),
        }
    }
}

impl<const N: usize> Settled<N> {
    /// As [`Executor::touch`].
    pub(super) fn touch(&mut self) {
        touch(&mut self.passed, any_path_segment().map(|any| (0, any)));
    }

    /// The path has left a path segment.
    pub(super) fn pass(&mut self, path_segment: PathSegment<N>, cycle: u64) {
        if self.cycles > 0 {
            self.passed.push_back((cycle, path_segment));
        }
    }

    /// A section begins behind so many path segments, from rest or on the way along it.
    pub(super) fn begin(
        &mut self,
        path_segments: &VecDeque<PathSegment<N>>,
        passed: usize,
        moving: bool,
        cycle: u64,
    ) {
        if !moving {
            return self.passed.clear();
        }
        // Those that come have the one under way first, once more.
        let Some(first) = path_segments.get(passed) else {
            return;
        };
        let left = path_segments.iter().take(passed);
        for path_segment in left.take_while(|it| it.start < first.start) {
            self.pass(*path_segment, cycle);
        }
    }

    /// Forgets what no setpoint of that cycle is made of.
    pub(super) fn forget(&mut self, cycle: u64) {
        let is_old = |(left, _): &(u64, _)| left + self.cycles < cycle;
        while self.passed.front().is_some_and(is_old) {
            self.passed.pop_front();
        }
    }
}

/// Where on the path the executor is, and how it moves there.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PathTime {
    /// How many sections began from rest so far, and whether on the last of them the clock is shaped.
    pub section: u64,
    /// See there.
    pub clock: bool,
    /// Where on it that one did, mm.
    pub from: f64,
    /// Where on it the path is, mm.
    pub distance: f64,
    /// mm/s
    pub speed: f64,
    /// mm/s²
    pub acceleration: f64,
    /// mm/s³
    pub jerk: f64,
}

impl<const N: usize> Executor<N> {
    /// From now on a shaper of the path's clock is behind it: where the path has been is known for as long as setpoints are made
    /// of it, and no section begins from rest before the axes rest. Before the first command; allocates.
    pub fn settle(&mut self, spread: Spread) {
        self.settled = Settled {
            settling: spread.settling,
            cycles: (spread.settling / self.period).round() as u64,
            passed: VecDeque::with_capacity(self.path_segments.capacity()),
        };
    }

    /// Where on the path it is.
    #[must_use]
    pub fn path_time(&self) -> PathTime {
        let rest = PathTime {
            section: self.place.sections,
            clock: self.place.clock,
            from: self.place.from,
            distance: self.place.reached,
            ..PathTime::default()
        };
        match self.current() {
            Some(Step::JerkSegment(segment)) => {
                let (ds, speed, acceleration) = self.under_way(segment);
                PathTime {
                    distance: segment.distance + ds,
                    speed,
                    acceleration,
                    jerk: segment.jerk,
                    ..rest
                }
            }
            _ => rest,
        }
    }

    /// The path at that distance on the section under way, where it was within the time that axes take to
    /// [settle](Self::settle).
    #[must_use]
    pub fn path_at(&self, distance: f64) -> Option<Derivatives<N>> {
        let begun = |it: &&PathSegment<N>| it.start <= distance;
        let here = self.path_segments.front().filter(begun).or_else(|| {
            let passed = self.settled.passed.iter().map(|(_, left)| left);
            passed.rev().find(begun)
        });
        // Rounding may put it before the first of them.
        let first = || self.settled.passed.front().map(|(_, left)| left);
        let here = here.or_else(first).or(self.path_segments.front())?;
        Some(here.curve.at(distance - here.start))
    }

    /// The axes do not rest yet from what they moved for last.
    pub(super) fn is_settling(&self) -> bool {
        let moved = self.moved.filter(|_| self.settled.cycles > 0);
        moved.is_some_and(|moved| self.since(moved) < self.settled.settling)
    }

    /// How long the sections that are about to be committed wait for the axes.
    pub(super) fn settle_sections(&mut self) {
        if self.settled.cycles == 0 {
            return;
        }
        let mut rested = self.moved.map_or(f64::INFINITY, |moved| {
            let cycles = self.began.cycle as f64 - moved.cycle as f64;
            cycles * self.period + (self.began.offset - moved.offset)
        });
        let settling = self.settled.settling;
        for step in &mut self.steps {
            match step {
                Step::JerkSegment(_) => rested = 0.0,
                Step::Section { moving: true, .. } => {}
                Step::Section { settle, .. } => {
                    rested += *settle.get_or_insert((settling - rested).max(0.0));
                }
                _ => rested += step.duration(),
            }
        }
    }
}
