//! Chooses, of what moves become within their tolerance and within lesser ones, what is passed sooner.
//!
//! More tolerance does not always save time. Short moves may become one curve where roundings between them would be
//! passed sooner, and a rounding beside an arc bends more the larger it is, as it takes over the arc's curvature. No
//! rule tells beforehand, so both are tried: from where what is laid so far ends in the same way, moves are joined
//! within lesser tolerances as well, up to where all end in the same way again: in the midst of one move that nothing
//! was fitted to, or at rest. All of these stretches are planned by a planner of their own, from rest to rest with the
//! whole moves at their ends, and the one that takes the least time is laid.
//!
//! # What it costs
//!
//! Nothing is tried where the tolerance can only help: between two lines, where a larger rounding is the same curve on a
//! larger scale. Nothing is planned where the stretches are the same. What planning takes for a choice is bounded as
//! that of windows is; beyond that what was found so far is taken. A stretch has few moves: of more short segments the
//! tolerance makes a smoother curve, and they are joined within that alone. So no more is kept than that.
//!
//! # What was tried
//!
//! To look at a lesser tolerance only where the next greater one saves time is a fifth quicker, and misses some. To plan a
//! stretch in one window leaves those without a time that need more cells than one has, and those that have a solution only in
//! shorter ones.

use super::joining::{Joiner, Laid, LaidCurve};
use super::{Effort, Planner};
use crate::path::segment_fitting::ShortSegments;
use crate::path::{Command, Move, PathControlMode};

/// Lesser tolerances, in mm, that are tried.
const LESSER: [f64; 7] = [1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001];
/// A lesser tolerance differs by this part at least.
const LESS: f64 = 0.9;
/// Moves of a stretch, at most.
const MOST_MOVES: usize = 64;
/// What choosing may take for a stretch, cells times Newton steps: some twenty windows.
const WORK: usize = 200_000;
/// Part by which a stretch within a lesser tolerance has to be sooner: by which the optimum may be missed.
const SOONER: f64 = 3e-4;

/// What moves become within lesser tolerances.
#[derive(Debug, Clone, Default)]
pub(super) struct Alternatives<const N: usize> {
    /// One for each tolerance that is tried; none where nothing else is.
    joiners: Vec<Joiner<N>>,
    /// What all moves of the stretch ask for.
    asked: Option<PathControlMode>,
    /// Moves since they differ.
    moves: usize,
    /// What choosing took so far.
    effort: Effort,
}

impl<const N: usize> Alternatives<N> {
    pub(super) fn effort(&self) -> Effort {
        self.effort
    }

    /// The joiner whose stretch takes the least time, if that is one of these.
    fn take_soonest(&mut self, joiner: &Joiner<N>) -> Option<Joiner<N>> {
        let (mut soonest, mut least) = (None, None);
        let most = self.effort.work + WORK;
        for (number, other) in self.joiners.iter().enumerate() {
            let mut before = self.joiners[..number].iter().chain([joiner]);
            if before.any(|it| it.laid == other.laid) {
                continue;
            }
            let to_beat = match least {
                Some(least) => least,
                None => stretch_time(joiner, most, &mut self.effort)?,
            };
            let time = stretch_time(other, most, &mut self.effort);
            let time = time.filter(|time| *time < to_beat * (1.0 - SOONER));
            soonest = time.map(|_| number).or(soonest);
            least = Some(time.unwrap_or(to_beat));
        }
        soonest.map(|number| self.joiners.swap_remove(number))
    }
}

impl<const N: usize> Planner<N> {
    /// Goes on with a move that begins where the last one ended.
    pub(super) fn push_move(&mut self, motion: Move<N>) {
        if self.alternatives.asked.is_some_and(|it| it != motion.mode) {
            self.alternatives.joiners.clear();
        }
        if self.alternatives.joiners.is_empty() && self.joiner.short_segments.is_none() {
            self.try_lesser_tolerances(&motion);
        }
        self.joiner.push(motion);
        let alternatives = &mut self.alternatives;
        alternatives.moves += 1;
        for (joiner, mode) in alternatives.joiners.iter_mut().zip(lesser(motion.mode)) {
            joiner.push(Move { mode, ..motion });
        }
        self.take_laid();
    }

    /// From here on moves are joined within lesser tolerances, too, if those may save time.
    fn try_lesser_tolerances(&mut self, motion: &Move<N>) {
        let before = self.joiner.pending.as_ref().map(|it| &it.motion);
        let is_line = |it: &Move<N>| it.curve.direction().is_some();
        let short = ShortSegments::begin(motion).is_some();
        if !short && (before.is_none_or(is_line) && is_line(motion)) {
            return;
        }
        let modes = lesser(motion.mode);
        self.alternatives.joiners.extend(modes.map(|mode| {
            let mut joiner = self.joiner.clone();
            if let Some(pending) = &mut joiner.pending
                && pending.motion.mode == motion.mode
            {
                pending.motion.mode = mode;
            }
            joiner
        }));
        self.alternatives.asked = Some(motion.mode);
        self.alternatives.moves = 0;
    }

    pub(super) fn for_each_joiner(&mut self, act: impl Fn(&mut Joiner<N>)) {
        act(&mut self.joiner);
        self.alternatives.joiners.iter_mut().for_each(act);
    }

    /// Lays what the moves became, once that is known or has gone on for long.
    pub(super) fn take_laid(&mut self) {
        let alternatives = &mut self.alternatives;
        let at_an_end = ends_alike(&self.joiner, &alternatives.joiners);
        if !alternatives.joiners.is_empty() && !at_an_end && alternatives.moves < MOST_MOVES {
            return;
        }
        if at_an_end && let Some(mut soonest) = alternatives.take_soonest(&self.joiner) {
            let asked = self.joiner.pending.as_ref().map(|it| it.motion.mode);
            if let (Some(pending), Some(asked)) = (&mut soonest.pending, asked) {
                pending.motion.mode = asked;
            }
            self.joiner = soonest;
        }
        alternatives.joiners.clear();
        for laid in std::mem::take(&mut self.joiner.laid) {
            self.lay(laid);
        }
    }
}

/// Lesser tolerances, the greatest first.
fn lesser(mode: PathControlMode) -> impl Iterator<Item = PathControlMode> {
    let asked = match mode {
        PathControlMode::Blend(tolerance) | PathControlMode::Merge { tolerance, .. } => tolerance,
        PathControlMode::Stop | PathControlMode::Exact(_) => 0.0,
    };
    let less = LESSER.into_iter().filter(move |it| *it < LESS * asked);
    less.map(move |tolerance| match mode {
        PathControlMode::Merge { within, .. } => PathControlMode::Merge { tolerance, within },
        _ => PathControlMode::Blend(tolerance),
    })
}

/// Whether all go on from the same move, but for what roundings take of it, or from rest.
fn ends_alike<const N: usize>(joiner: &Joiner<N>, others: &[Joiner<N>]) -> bool {
    let end = |it: &Joiner<N>| it.pending.as_ref().map(|pending| pending.motion.curve);
    let ended = |it: &Joiner<N>| it.short_segments.is_none();
    ended(joiner) && (others.iter()).all(|it| ended(it) && end(it) == end(joiner))
}

/// How long it takes along what was laid and what is left of the last move, from rest to rest, s. None if planning
/// that makes the work of all more than `most`.
fn stretch_time<const N: usize>(
    joiner: &Joiner<N>,
    most: usize,
    effort: &mut Effort,
) -> Option<f64> {
    let mut planner = Planner::new(joiner.limits, [0.0; N]);
    let last = joiner.pending.as_ref().map(|pending| {
        let Move {
            curve, feed, tag, ..
        } = pending.motion;
        Laid::Curve(LaidCurve {
            curve: match pending.taken {
                0.0 => curve,
                taken => curve.part(taken, curve.length()),
            },
            feed,
            tag,
            waypoints: 0,
            ends: Vec::new(),
        })
    });
    for laid in joiner.laid.iter().chain(&last).chain([&Laid::Rest]) {
        planner.lay(laid.clone());
    }
    let time = planner.time_of_all(most.checked_sub(effort.work)?);
    *effort = *effort + planner.effort();
    time
}

impl<const N: usize> Planner<N> {
    /// How long all that was laid takes, s. None if planning it takes more work than that.
    fn time_of_all(&mut self, work: usize) -> Option<f64> {
        let mut steps = Vec::new();
        loop {
            let left = work.checked_sub(self.window.effort().work)?;
            self.window.grant(left);
            self.plan_on();
            if self.out.is_empty() {
                return Some(steps.iter().sum());
            }
            for command in self.out.drain(..) {
                match command {
                    Command::Section { .. } => steps.push(0.0),
                    Command::ReplaceTail(step) => steps.truncate(step as usize),
                    Command::JerkSegment(segment) => steps.push(segment.duration),
                    _ => {}
                }
            }
        }
    }
}
