//! Slowing down along a given path as hard as the axes allow: to rest, or to a lower speed.
//!
//! # What is solved
//!
//! From a state in motion, distance s, speed ṡ and acceleration s̈ on the path, find the path jerk that
//! brings the speed down to a target on the least distance, with every axis inside its limits of
//! velocity, acceleration and jerk at every instant. On a line that is a closed form. On curves what the
//! axes allow depends on where on the path each speed is reached, and that on the answer.
//!
//! # How
//!
//! The braking is laid over speeds instead of times. With E = s̈²/2 the path jerk is dE/dṡ, because
//! dE/dṡ = s̈ ds̈/dṡ = ds̈/dt. So
//!
//! - between two given speeds a jerk segment is a straight line of E, and the last one ends at the target
//!   exactly, whatever the lines are,
//! - the distance is ∫ ṡ dṡ/√(2E), which is least where E is greatest at every speed,
//! - the greatest E comes of two passes over the speeds, as in the classic method for limits of the
//!   acceleration (Bobrow, Dubowsky and Gibson, 1985), one order higher: back from the target, as steep as the axes'
//!   jerks allow and no higher than their accelerations do, which tells from where the target is reached
//!   at all; then on from the start.
//!
//! Where on the path a speed is reached is taken from the round before; rounds go on until the places
//! settle (`SearchState::look` extrapolates them), mostly three to eight. Before all that an acceleration
//! that speeds the path up is taken back step by step in time (`SearchState::rise`), for speeds do not tell
//! the places apart while they rise.
//!
//! # Why it is right
//!
//! Nothing of the above is trusted: what comes out is sampled in every cell, and bounded between the
//! samples by the [certificate](super::certify) that the planner's own segments pass. Where a limit breaks, less
//! of it is used in that cell; where nothing is proven, the cell is halved; and the rounds go on. So a
//! search that ends with [`Outcome::Found`] keeps the limits, and one that errs does so by being longer than
//! it has to be, or by finding nothing: whoever asked follows the plan, which ends at rest, too.
//!
//! The search is cut into steps with a count of work, so that the cycle can do some of it at a time.
//!
//! - `search`: the cells and what a round does to them,
//! - `node`: a place on the path, what the axes allow there, and what a cell asks of them.

mod node;
mod search;

use super::{JerkSegment, Limits, PathSegment, PathState};
use search::{FINE, MOST_FALLING, MOST_RISING, QUICK, SearchState};

/// Jerk segments of a braking, at most: one a cell.
pub(super) const MOST_SEGMENTS: usize = MOST_FALLING + MOST_RISING;
/// Part of the jerk limit that a curve must leave for braking in closed form. With less, a braking that keeps
/// it throughout is so long that the search is worth its work.
const RESERVE: f64 = 0.4;
/// Excess over a limit that is rounding, as a part of it.
const ROUNDING: f64 = 1e-9;

/// Jerk segments that slow down, and where they end: at the target speed, without acceleration.
#[derive(Debug, Clone)]
pub(super) struct Braking {
    segments: [JerkSegment; MOST_SEGMENTS],
    count: usize,
    pub(super) end: PathState,
}

impl Braking {
    fn new(from: PathState) -> Self {
        let nothing = JerkSegment {
            duration: 0.0,
            distance: 0.0,
            speed: 0.0,
            acceleration: 0.0,
            jerk: 0.0,
        };
        Braking {
            segments: [nothing; MOST_SEGMENTS],
            count: 0,
            end: from,
        }
    }

    pub(super) fn segments(&self) -> &[JerkSegment] {
        &self.segments[..self.count]
    }

    fn push(&mut self, duration: f64, jerk: f64) -> Option<()> {
        let segment = self.next(duration, jerk);
        *self.segments.get_mut(self.count)? = segment;
        self.count += 1;
        let (ds, speed, acceleration) = segment.at(duration);
        self.end = PathState {
            distance: self.end.distance + ds,
            speed,
            acceleration,
        };
        Some(())
    }

    fn next(&self, duration: f64, jerk: f64) -> JerkSegment {
        JerkSegment {
            duration,
            distance: self.end.distance,
            speed: self.end.speed,
            acceleration: self.end.acceleration,
            jerk,
        }
    }
}

/// The hardest slowing down found from `from` to the path speed `target` along the path segments that
/// `path` counts out. None if a limit breaks on the way.
pub(super) fn brake<'a, const N: usize>(
    path: impl Fn(usize) -> Option<&'a PathSegment<N>>,
    limits: &Limits<N>,
    from: PathState,
    target: f64,
) -> Option<Braking> {
    let mut search = Search {
        state: SearchState::new(FINE),
        stage: Stage::Begin,
    };
    match search.go_on(path, limits, from, target, usize::MAX) {
        Outcome::Found(braking) => Some(braking),
        Outcome::Unfinished | Outcome::Impossible => None,
    }
}

/// What a search has come to.
#[allow(clippy::large_enum_variant)] // it lives for a moment, on the stack
pub(super) enum Outcome {
    /// The hardest slowing down that was found.
    Found(Braking),
    /// The work that was allowed is done, and the search is not.
    Unfinished,
    /// There seems to be no way.
    Impossible,
}

/// The search for the hardest slowing down, which may go on from cycle to cycle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Search<const N: usize> {
    state: SearchState<N>,
    stage: Stage,
}

/// What comes next in a search.
#[derive(Debug, Clone, Copy)]
enum Stage {
    /// To begin.
    Begin,
    /// An acceleration that speeds up is taken back, for the first time.
    Rise,
    /// The same again, after less of a limit was used; then the speeds begin at another greatest one than
    /// this.
    RiseAgain { from_speed: f64 },
    /// A round over the speeds.
    Round,
    /// Whether the cell of that number keeps the limits, as all before did or not.
    Check { cell: usize, kept: bool },
    /// Whether that is certain between the samples, too.
    Prove { cell: usize, certain: bool },
}

/// What one step of a search leads to.
#[allow(clippy::large_enum_variant)] // it lives for a moment, on the stack
enum Step {
    /// What comes next.
    Next(Stage),
    /// The next one needs more work than is left.
    Pause,
    /// A braking that provably keeps the limits.
    Done(Braking),
}

impl<const N: usize> Default for Search<N> {
    fn default() -> Self {
        Search {
            state: SearchState::new(QUICK),
            stage: Stage::Begin,
        }
    }
}

impl<const N: usize> Search<N> {
    /// The next search begins anew.
    pub(super) fn reset(&mut self) {
        self.stage = Stage::Begin;
    }

    /// Goes on, as [`brake`], with so much work more.
    pub(super) fn go_on<'a>(
        &mut self,
        path: impl Fn(usize) -> Option<&'a PathSegment<N>>,
        limits: &Limits<N>,
        from: PathState,
        target: f64,
        work: usize,
    ) -> Outcome {
        let Some(first) = path(0) else {
            return Outcome::Impossible;
        };
        if first.direction().is_some()
            && let Some(closed) = brake_gently(first, limits, from, target)
        {
            return Outcome::Found(closed);
        }
        self.state.work = 0;
        while self.state.work < work {
            match self.step(&path, limits, from, target, work) {
                Some(Step::Next(stage)) => self.stage = stage,
                Some(Step::Pause) => break,
                Some(Step::Done(braking)) => {
                    self.reset();
                    return Outcome::Found(braking);
                }
                None => {
                    self.reset();
                    return Outcome::Impossible;
                }
            }
        }
        Outcome::Unfinished
    }

    /// One step of the search; none where that shows that there is no way.
    fn step<'a>(
        &mut self,
        path: &impl Fn(usize) -> Option<&'a PathSegment<N>>,
        limits: &Limits<N>,
        from: PathState,
        target: f64,
        work: usize,
    ) -> Option<Step> {
        let search = &mut self.state;
        Some(Step::Next(match self.stage {
            Stage::Begin => {
                search.begin(target);
                Stage::Rise
            }
            Stage::Rise => {
                if !search.rise(path, limits, from, work)? {
                    return Some(Step::Pause);
                }
                search.guess(path, limits)?;
                Stage::Round
            }
            Stage::RiseAgain { from_speed } => {
                if !search.rise(path, limits, from, work)? {
                    return Some(Step::Pause);
                }
                search.begin_at_another_speed(from_speed)?;
                search.relax(path, limits)?;
                Stage::Round
            }
            Stage::Round => {
                let cost = search.work_of_a_round();
                if search.work > 0 && search.work + cost > work {
                    return Some(Step::Pause);
                }
                search.work += cost;
                search.look(path, limits)?;
                if search.is_settled() && !search.refine(path, limits)? {
                    Stage::Check {
                        cell: 0,
                        kept: true,
                    }
                } else {
                    search.relax(path, limits)?;
                    Stage::Round
                }
            }
            Stage::Check { cell, kept } if cell < search.cells() => Stage::Check {
                cell: cell + 1,
                kept: search.keeps(cell, path, limits)? && kept,
            },
            Stage::Check { .. } if search.ends_beyond(path)? => return None,
            Stage::Check { kept: true, .. } => Stage::Prove {
                cell: 0,
                certain: true,
            },
            Stage::Prove { cell, certain } if cell < search.cells() => Stage::Prove {
                cell: cell + 1,
                certain: search.is_certain(cell, path, limits)? && certain,
            },
            Stage::Prove { certain: true, .. } => return Some(Step::Done(search.braking(from)?)),
            Stage::Check { .. } | Stage::Prove { .. } => {
                search.rising_cells = 0;
                Stage::RiseAgain {
                    from_speed: search.falling[0].v,
                }
            }
        }))
    }
}

/// Steps of Newton's method that bring an instant to rounding.
const NEWTON_STEPS: usize = 4;
/// Below this speed, mm/s, nothing is divided by it.
const SLOWEST: f64 = 1e-9;

/// When the jerk segment reaches a distance, s from its start, between its start and its end.
pub(super) fn instant_at(segment: &JerkSegment, distance: f64) -> f64 {
    let gone = distance - segment.distance;
    let mut t = 0.0;
    // The speed changes little within a step: Newton's method is there at once.
    for _ in 0..NEWTON_STEPS {
        let (ds, v, _) = segment.at(t);
        t = (t + (gone - ds) / v.max(SLOWEST)).clamp(0.0, segment.duration);
    }
    t
}

/// A slowing down that leaves room for whatever the path segment's bends ask of the axes; on a straight path segment
/// it is the hardest. None if the path segment leaves too little room, or ends before.
pub(super) fn brake_gently<const N: usize>(
    path_segment: &PathSegment<N>,
    limits: &Limits<N>,
    from: PathState,
    target: f64,
) -> Option<Braking> {
    let limits = path_segment.limits(limits);
    let (limit, jerk) = reserve(path_segment, limits, from.speed, from.acceleration)?;
    let braking = closed_form(from, target, limit, jerk)?;
    let end = path_segment.start + path_segment.curve.length();
    (braking.end.distance <= end).then_some(braking)
}

/// Path acceleration and jerk that slowing down from speed `v` and acceleration `a` may use
/// anywhere on the curve, whatever its bends ask of the axes meanwhile; `None` if they leave too
/// little.
fn reserve<const N: usize>(
    path_segment: &PathSegment<N>,
    limits: &Limits<N>,
    v: f64,
    a: f64,
) -> Option<(f64, f64)> {
    let [d1, d2, d3] = match path_segment.direction() {
        Some(along) => [along.map(f64::abs), [0.0; N], [0.0; N]],
        None => path_segment.curve.derivative_bounds(),
    };
    let least = |left: &dyn Fn(usize) -> f64| {
        (0..N)
            .filter(|&i| d1[i] > 0.0)
            .map(|i| left(i) / d1[i])
            .fold(f64::INFINITY, f64::min)
    };
    // The speed still rises while an acceleration is taken back.
    let rising = a.max(0.0);
    let highest = |jerk: f64| v + rising * rising / (2.0 * jerk);
    let bent = d2.iter().any(|d| *d > 0.0);
    let whole = least(&|i| limits.jerk[i]);
    let v = highest(if bent { whole * RESERVE } else { whole });
    let acceleration = least(&|i| limits.acceleration[i] - d2[i] * v * v);
    let top = acceleration.max(a.abs());
    let jerk = least(&|i| limits.jerk[i] - d3[i] * v * v * v - 3.0 * d2[i] * v * top);
    // Also what the bends ask where an axis has no part in the path's direction.
    let kept = (0..N).all(|i| {
        d1[i] * v <= limits.velocity[i] * (1.0 + ROUNDING)
            && d2[i] * v * v <= limits.acceleration[i]
            && d3[i] * v * v * v + 3.0 * d2[i] * v * top <= limits.jerk[i]
    });
    let enough = acceleration * (1.0 + ROUNDING) >= a.abs() && jerk >= whole * RESERVE && kept;
    (enough && acceleration > 0.0).then_some((acceleration, jerk))
}

/// The shortest way down to the speed `target`: jerk −j, deceleration `limit` held if it is reached,
/// jerk +j. `None` where jerk +j alone would be there no earlier.
fn closed_form(from: PathState, target: f64, limit: f64, j: f64) -> Option<Braking> {
    let a = from.acceleration;
    let above = from.speed - target;
    // The speed above the target where the acceleration was, or will be, nothing.
    let reached = above + a * a / (2.0 * j);
    if above <= 0.0 && a <= 0.0 || reached <= 0.0 {
        return None;
    }
    let peak = (j * reached).sqrt().min(limit);
    if a + peak < -ROUNDING * peak {
        return None;
    }
    let hold = (reached - peak * peak / j) / peak;
    let mut braking = Braking::new(from);
    braking.push(((a + peak) / j).max(0.0), -j)?;
    braking.end.acceleration = -peak;
    braking.push(hold.max(0.0), 0.0)?;
    braking.push(peak / j, j)?;
    braking.end.speed = target;
    braking.end.acceleration = 0.0;
    Some(braking)
}
