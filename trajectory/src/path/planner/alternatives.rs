//! Chooses, of what moves become within their tolerance and within lesser ones, what is passed sooner.
//!
//! More tolerance does not always save time. Short moves may become one curve where roundings between them would be
//! passed sooner, and a rounding beside an arc bends more the larger it is, as it takes over the arc's curvature. No
//! rule tells beforehand, so both are tried: from where what is laid so far ends in the same way, moves are joined
//! within lesser tolerances as well, up to where all end in the same way again: in the midst of one move that nothing
//! was fitted to, or at rest. All of these stretches are planned by a planner of their own, from rest to rest with the
//! whole moves at their ends, and the one that takes the least time is laid.
//!
//! Two kinds of trials are made. Curves in place of short segments stay within a lesser tolerance, with all of the
//! tolerance left to the roundings beside them; and both stay within a lesser one. Curves are only ever fitted within
//! [`grades`], the same for every tolerance: so what is tried within one is tried within every greater one, too,
//! with roundings that are no smaller. (With curves fitted within the tolerance itself two tolerances had few curves in
//! common.)
//!
//! A trial goes on where the mode changes, and begins where a run of short segments does, whatever comes before it. In
//! each a move keeps its own mode as far as that rounds off no more. The least is a stop at every point, which is the only
//! one under G61: beside an arc even a rounding within a micrometre may take longer.
//!
//! # What it costs
//!
//! Nothing is tried where the tolerance can only help: between two lines, where a larger rounding is the same curve on a
//! larger scale. Nothing is planned where the stretches are the same, and none within still lesser tolerances once one takes
//! much longer than the least. What planning takes for a choice is bounded as that of windows is; beyond that stretches are
//! compared up to where they are planned, another one has to be clearly sooner, and one that is not planned to its end is not
//! taken in place of one that is. A stretch has a bounded number of moves: of more short segments the tolerance makes a
//! smoother curve, and they are joined within that alone. So no more is kept than that.
//!
//! # What was tried
//!
//! To look at a lesser tolerance only where the next greater one saves time is a fifth quicker, and misses some. To plan a
//! stretch in one window leaves those without a time that need more cells than one has, and those that have a solution only in
//! shorter ones. Counted as endless, a stretch that is not planned to its end lost to a lesser tolerance although it was 13 %
//! sooner; counted as no time at all, it won with slivers between roundings, which a stop at every point passes up to 53 times
//! as soon; taken to be as fast in all as where it was planned, it won before a slow arc, 16 % later than what was known.
//! Stretches of 64 moves cost a tenth less than those of 512, and miss what these give: a run of 82 short segments is passed
//! 20 % sooner within a lesser tolerance. Where short segments go on for more moves than a stretch has: to go on within the
//! tolerance whose curves have come further in the time that they take by then; that changed nothing in the programs that it
//! was meant for. Where lines may be merged a long line is gathered, too; a stretch that could not end in one had no end but
//! that of the path, and took up to 32 % longer than without.

use super::joining::{Joiner, Laid, LaidCurve};
use super::shaped::Shaped;
use super::{Effort, Planner};
use crate::path::segment_fitting::{ShortSegments, grades};
use crate::path::{Command, Move, PathControlMode};

/// Lesser tolerances, in mm, that are tried; the last is a stop.
const LESSER: [f64; 9] = [3.0, 1.0, 0.3, 0.1, 0.03, 0.01, 0.003, 0.001, 0.0];
/// The least within which curves are tried.
const LEAST: f64 = 0.001;
/// Moves of a stretch, at most.
const MOST_MOVES: usize = 512;
/// What choosing may take for a stretch, cells times Newton steps: some sixty windows.
const WORK: usize = 600_000;
/// What planning it once may take of that.
const SHARE: usize = 200_000;
/// No lesser tolerances are tried once a stretch takes so many times the least.
const HOPELESS: f64 = 1.05;
/// Windows that are planned only to compare are this many times as long: fewer overlap.
const LONGER: f64 = 2.0;
/// Part by which a stretch within a lesser tolerance has to be sooner: by which the optimum may be missed.
const SOONER: f64 = 3e-4;
/// The same where the other one was not planned to its end.
const CLEARLY: f64 = 0.1;

/// What moves become within lesser tolerances.
#[derive(Debug, Clone, Default)]
pub(super) struct Alternatives<const N: usize> {
    /// None where nothing else is tried.
    trials: Vec<Trial<N>>,
    /// Moves since they differ.
    moves: usize,
    /// What choosing took so far.
    effort: Effort,
}

/// Moves joined within lesser tolerances.
#[derive(Debug, Clone)]
struct Trial<const N: usize> {
    /// Corners are rounded off by no more than that, mm.
    most: f64,
    joiner: Joiner<N>,
}

impl<const N: usize> Alternatives<N> {
    pub(super) fn effort(&self) -> Effort {
        self.effort
    }

    /// The joiner whose stretch takes the least time, if that is one of these.
    fn take_soonest(&mut self, joiner: &Joiner<N>) -> Option<Joiner<N>> {
        let (mut soonest, mut least) = (None, None);
        let mut given_up = [false; 2];
        let most = self.effort.work + WORK;
        for (number, trial) in self.trials.iter().enumerate() {
            let kind = usize::from(trial.most.is_finite());
            let before = self.trials[..number].iter().map(|trial| &trial.joiner);
            let mut before = before.chain([joiner]);
            if given_up[kind] || before.any(|it| it.laid == trial.joiner.laid) {
                continue;
            }
            // A stop always has its share.
            let mut time = |joiner, is_stop| {
                let share = self.effort.work + SHARE;
                let most = if is_stop { share } else { share.min(most) };
                stretch_time(joiner, most, &mut self.effort)
            };
            let to_beat = least.take().unwrap_or_else(|| time(joiner, false));
            let time = time(&trial.joiner, trial.most == 0.0);
            given_up[kind] = time.over(&to_beat) > HOPELESS;
            least = match time.is_sooner(&to_beat) {
                true => {
                    soonest = Some(number);
                    Some(time)
                }
                false => Some(to_beat),
            };
        }
        soonest.map(|number| self.trials.swap_remove(number).joiner)
    }
}

impl<const N: usize> Planner<N> {
    /// Goes on with a move that begins where the last one ended.
    pub(super) fn push_move(&mut self, motion: Move<N>) {
        // What begins under G61 is not in the way of what G64 gives more to choose from.
        let is_exact = matches!(motion.mode, PathControlMode::Exact(_));
        if matches!(self.alternatives.trials[..], [Trial { most: 0.0, .. }]) && !is_exact {
            self.alternatives.trials.clear();
        }
        self.shape_as(motion.mode);
        let gathered = self.joiner.short_segments.as_ref();
        if gathered.is_none_or(|it| !it.may_go_on(&motion)) {
            if gathered.is_some_and(ShortSegments::is_long_line) {
                // What nothing was merged with is a move like any other.
                self.for_each_joiner(Joiner::join_short_segments);
                self.take_laid();
            }
            if self.alternatives.trials.is_empty() {
                self.try_lesser_tolerances(&motion);
            }
        }
        let (motion, spare) = self.share(motion);
        self.joiner.push(motion, spare);
        let alternatives = &mut self.alternatives;
        alternatives.moves += 1;
        for Trial { most, joiner } in &mut alternatives.trials {
            let mode = motion.mode.within(*most);
            joiner.push(Move { mode, ..motion }, spare);
        }
        self.take_laid();
    }

    /// From here on moves are joined within lesser tolerances, too, if those may save time.
    fn try_lesser_tolerances(&mut self, motion: &Move<N>) {
        let before = self.joiner.pending.as_ref().map(|it| &it.motion);
        let is_line = |it: &Move<N>| it.curve.direction().is_some();
        let begun = ShortSegments::begin(motion, f64::INFINITY);
        let short =
            self.joiner.short_segments.is_some() || begun.is_some_and(|it| !it.is_long_line());
        if !short && (before.is_none_or(is_line) && is_line(motion)) {
            return;
        }
        let (asked, exact) = match motion.mode {
            PathControlMode::Blend(tolerance) | PathControlMode::Merge { tolerance, .. } => {
                (tolerance, false)
            }
            PathControlMode::Exact(tolerance) => (tolerance, true),
            PathControlMode::Stop => return,
        };
        let trial = |fits_within, most| {
            let mut joiner = self.joiner.clone();
            joiner.fits_within = fits_within;
            if let Some(pending) = &mut joiner.pending {
                pending.motion.mode = pending.motion.mode.within(most);
            }
            Trial { most, joiner }
        };
        let grades = grades(asked).skip(1).take_while(|it| *it >= LEAST);
        let grades = grades.filter(|_| short && !exact);
        let fits = grades.map(|it| trial(it, f64::INFINITY));
        let less = LESSER.into_iter().filter(|it| *it < asked);
        let less = less.filter(|it| !exact || *it == 0.0);
        let both = less.map(|it| trial(f64::INFINITY, it));
        self.alternatives.trials = fits.chain(both).collect();
        self.alternatives.moves = 0;
    }

    pub(super) fn for_each_joiner(&mut self, act: impl Fn(&mut Joiner<N>)) {
        act(&mut self.joiner);
        (self.alternatives.trials.iter_mut()).for_each(|trial| act(&mut trial.joiner));
    }

    /// Lays what the moves became, once that is known or has gone on for long.
    pub(super) fn take_laid(&mut self) {
        let alternatives = &mut self.alternatives;
        let at_an_end = ends_alike(&self.joiner, &alternatives.trials);
        if !alternatives.trials.is_empty() && !at_an_end && alternatives.moves < MOST_MOVES {
            return;
        }
        if at_an_end && let Some(mut soonest) = alternatives.take_soonest(&self.joiner) {
            let asked = self.joiner.pending.as_ref().map(|it| it.motion.mode);
            if let (Some(pending), Some(asked)) = (&mut soonest.pending, asked) {
                pending.motion.mode = asked;
            }
            soonest.fits_within = f64::INFINITY;
            self.joiner = soonest;
        }
        alternatives.trials.clear();
        for laid in std::mem::take(&mut self.joiner.laid) {
            self.lay(laid);
        }
    }
}

impl PathControlMode {
    /// The same, but for corners that may be rounded off by no more than that, mm; G61's may be as before.
    fn within(self, most: f64) -> Self {
        match self {
            _ if most == 0.0 => Self::Stop,
            Self::Blend(tolerance) => Self::Blend(tolerance.min(most)),
            Self::Merge { tolerance, within } => Self::Merge {
                tolerance: tolerance.min(most),
                within,
            },
            Self::Stop | Self::Exact(_) => self,
        }
    }
}

/// Whether all go on from the same move, but for what roundings take of it, or from rest.
fn ends_alike<const N: usize>(joiner: &Joiner<N>, others: &[Trial<N>]) -> bool {
    let end = |it: &Joiner<N>| it.pending.as_ref().map(|pending| pending.motion.curve);
    let ended = |it: &Joiner<N>| it.short_segments.is_none();
    let others = others.iter().map(|trial| &trial.joiner);
    ended(joiner)
        && others
            .into_iter()
            .all(|it| ended(it) && end(it) == end(joiner))
}

/// How long a stretch takes.
#[derive(Debug, Clone)]
struct StretchTime {
    /// At which part of its length the path is, and when, s; from its beginning as far as it was planned.
    progress: Vec<(f64, f64)>,
    /// It was planned to its end.
    is_known: bool,
}

impl StretchTime {
    /// Up to which part of its length it was planned.
    fn covered(&self) -> f64 {
        self.progress.last().map_or(0.0, |(place, _)| *place)
    }

    /// When the path is at a part of its length, s; as far as it was planned.
    fn at(&self, place: f64) -> f64 {
        let next = self.progress.partition_point(|(it, _)| *it < place);
        self.progress
            .get(next)
            .map_or(f64::INFINITY, |(_, time)| *time)
    }

    /// How many times as long it takes as another one: up to where both are planned, which is nearly the same place in both.
    fn over(&self, than: &Self) -> f64 {
        let place = match (self.is_known, than.is_known) {
            (true, true) => 1.0,
            _ => self.covered().min(than.covered()),
        };
        match place > 0.0 {
            true => self.at(place) / than.at(place),
            // Where nothing is found of one of them the other one is sooner.
            false if self.covered() > 0.0 => 0.0,
            false => f64::INFINITY,
        }
    }

    /// Whether it is sooner by more than the times may be off. What is not known to its end is not sooner than what is.
    fn is_sooner(&self, than: &Self) -> bool {
        let part = match (self.is_known, than.is_known) {
            (true, true) => SOONER,
            (_, false) => CLEARLY,
            (false, true) => return false,
        };
        self.over(than) < 1.0 - part
    }
}

/// How long it takes along what was laid and what is left of the last move, from rest to rest, planned with no more work
/// than makes that of all `most`.
fn stretch_time<const N: usize>(
    joiner: &Joiner<N>,
    most: usize,
    effort: &mut Effort,
) -> StretchTime {
    let mut planner = Planner::new(joiner.limits, [0.0; N]);
    planner.horizon *= LONGER;
    planner.shaped = joiner
        .shaper
        .map(|(spread, method)| Shaped::new(spread, method));
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
            spare: pending.spare,
            most: f64::INFINITY,
            clock: None,
        })
    });
    for laid in joiner.laid.iter().chain(&last).chain([&Laid::Rest]) {
        planner.lay(laid.clone());
    }
    let time = planner.time_of_all(most.saturating_sub(effort.work));
    *effort = *effort + planner.effort();
    time
}

impl<const N: usize> Planner<N> {
    /// How long all that was laid takes, planned with no more than that much work.
    fn time_of_all(&mut self, work: usize) -> StretchTime {
        // How long each step takes, and where on the whole path it ends.
        let mut steps: Vec<(f64, f64)> = Vec::new();
        let (mut section, mut is_known) = (0.0, false);
        while let left @ 1.. = work.saturating_sub(self.window.effort().work) {
            self.window.grant(left);
            self.plan_on();
            is_known = self.out.is_empty();
            // What the last of the work gave is not what more would have.
            if is_known || self.window.effort().work >= work {
                break;
            }
            for command in self.out.drain(..) {
                match command {
                    Command::Section { .. } => {
                        let before = steps.last().map(|(_, end)| *end);
                        section = before.unwrap_or(0.0);
                        let waits = before.and(self.shaped.as_ref());
                        steps.push((waits.map_or(0.0, Shaped::waits), section));
                    }
                    Command::ReplaceTail(step) => steps.truncate(step as usize),
                    Command::JerkSegment(segment) => {
                        let (length, ..) = segment.at(segment.duration);
                        steps.push((segment.duration, section + segment.distance + length));
                    }
                    Command::Dwell { duration, .. } => {
                        let at = steps.last().map_or(section, |(_, end)| *end);
                        steps.push((duration, at));
                    }
                    _ => {}
                }
            }
        }
        let mut time = 0.0;
        let step = |(duration, end): (f64, f64)| {
            time += duration;
            ((end / self.length).min(1.0), time)
        };
        let mut progress: Vec<_> = steps.into_iter().map(step).collect();
        if let Some((place, _)) = progress.last_mut().filter(|_| is_known) {
            *place = 1.0;
        }
        StretchTime { progress, is_known }
    }
}
