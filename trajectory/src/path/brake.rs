//! Slowing down along a given path as hard as the axes allow: to rest, or to a lower speed.
//!
//! On a line that is a closed form. On curves the law is laid over speeds instead of times: with
//! E = s̈²/2 the path jerk is dE/dṡ, so between given speeds a piece of constant jerk is a straight
//! line of E, the distance ∫ ṡ dṡ/√(2E) is least where E is greatest, and the greatest E comes of
//! two passes, back from the end and on from the start. What the axes allow depends on where on the
//! path a speed is reached; that is taken from the round before.

mod node;
mod search;

use super::{Curve, JerkSegment, Limits, PathSegment, PathState};
use search::{CAREFUL, HASTY, MOST_CELLS, MOST_RISING, SearchState};

/// Pieces of a braking law at most.
pub(super) const MOST_PIECES: usize = MOST_CELLS + MOST_RISING;
/// Part of the jerk limit that a curve must leave for braking in closed form.
const RESERVE: f64 = 0.4;
/// Excess over a limit that is rounding, as a part of it.
const ROUNDING: f64 = 1e-9;

/// A law that slows down, and where it ends: at the target speed, without acceleration.
#[derive(Debug, Clone)]
pub(super) struct Braking {
    pieces: [JerkSegment; MOST_PIECES],
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
            pieces: [nothing; MOST_PIECES],
            count: 0,
            end: from,
        }
    }

    pub(super) fn pieces(&self) -> &[JerkSegment] {
        &self.pieces[..self.count]
    }

    fn push(&mut self, duration: f64, jerk: f64) -> Option<()> {
        let piece = self.next(duration, jerk);
        *self.pieces.get_mut(self.count)? = piece;
        self.count += 1;
        let (ds, speed, acceleration) = piece.at(duration);
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

/// The hardest slowing down found from `from` to the path speed `target` along the spans that
/// `span` counts out. None if a limit breaks on the way.
pub(super) fn brake<'a, const N: usize>(
    span: impl Fn(usize) -> Option<&'a PathSegment<N>>,
    limits: &Limits<N>,
    from: PathState,
    target: f64,
) -> Option<Braking> {
    let mut search = Search {
        state: SearchState::new(CAREFUL),
        stage: Stage::Begin,
    };
    match search.go_on(span, limits, from, target, usize::MAX) {
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
    /// An acceleration is taken back; after that comes the first guess, or the way down from another
    /// greatest speed than that before.
    Rise { before: Option<f64> },
    /// A round.
    Round,
    /// Whether the cell of that number keeps the limits, as all before did or not.
    Check { cell: usize, kept: bool },
    /// Whether that is certain.
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
            state: SearchState::new(HASTY),
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
        span: impl Fn(usize) -> Option<&'a PathSegment<N>>,
        limits: &Limits<N>,
        from: PathState,
        target: f64,
        work: usize,
    ) -> Outcome {
        let Some(first) = span(0) else {
            return Outcome::Impossible;
        };
        if first.curve.direction().is_some()
            && let Some(closed) = brake_gently(first, limits, from, target)
        {
            return Outcome::Found(closed);
        }
        self.state.work = 0;
        while self.state.work < work {
            match self.step(&span, limits, from, target, work) {
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
        span: &impl Fn(usize) -> Option<&'a PathSegment<N>>,
        limits: &Limits<N>,
        from: PathState,
        target: f64,
        work: usize,
    ) -> Option<Step> {
        let search = &mut self.state;
        Some(Step::Next(match self.stage {
            Stage::Begin => {
                search.begin(target);
                Stage::Rise { before: None }
            }
            Stage::Rise { before } => {
                if !search.rise(span, limits, from, work)? {
                    return Some(Step::Pause);
                }
                match before {
                    None => search.guess(limits)?,
                    Some(before) => {
                        search.shrink(before)?;
                        search.relax(limits)?;
                    }
                }
                Stage::Round
            }
            Stage::Round => {
                let cost = search.round();
                if search.work > 0 && search.work + cost > work {
                    return Some(Step::Pause);
                }
                search.work += cost;
                search.look(span, limits)?;
                if search.is_settled() && !search.refine(span, limits)? {
                    Stage::Check {
                        cell: 0,
                        kept: true,
                    }
                } else {
                    search.relax(limits)?;
                    Stage::Round
                }
            }
            Stage::Check { cell, kept } if cell < search.cells() => Stage::Check {
                cell: cell + 1,
                kept: search.keeps(cell, span, limits)? && kept,
            },
            Stage::Check { .. } if search.ends_beyond(span)? => return None,
            Stage::Check { kept: true, .. } => Stage::Prove {
                cell: 0,
                certain: true,
            },
            Stage::Prove { cell, certain } if cell < search.cells() => Stage::Prove {
                cell: cell + 1,
                certain: search.is_certain(cell, span, limits)? && certain,
            },
            Stage::Prove { certain: true, .. } => return Some(Step::Done(search.law(from)?)),
            Stage::Check { .. } | Stage::Prove { .. } => {
                search.rises = 0;
                Stage::Rise {
                    before: Some(search.falling[0].v),
                }
            }
        }))
    }
}

/// When the piece reaches a distance, s from its start, between its start and its end.
pub(super) fn instant_at(piece: &JerkSegment, distance: f64) -> f64 {
    let way = distance - piece.distance;
    let mut t = 0.0;
    // The speed changes little within a step: Newton's method is there at once.
    for _ in 0..4 {
        let (ds, v, _) = piece.at(t);
        t = (t + (way - ds) / v.max(1e-9)).clamp(0.0, piece.duration);
    }
    t
}

/// A slowing down that leaves room for whatever the span's bends ask of the axes; on a straight span
/// it is the hardest. None if the span leaves too little room, or ends before.
pub(super) fn brake_gently<const N: usize>(
    span: &PathSegment<N>,
    limits: &Limits<N>,
    from: PathState,
    target: f64,
) -> Option<Braking> {
    gentle(span, limits, &Braking::new(from), target)
}

fn gentle<const N: usize>(
    span: &PathSegment<N>,
    limits: &Limits<N>,
    law: &Braking,
    target: f64,
) -> Option<Braking> {
    let (limit, jerk) = reserve(&span.curve, limits, law.end.speed, law.end.acceleration)?;
    let closed = closed_form(law, target, limit, jerk)?;
    (closed.end.distance <= span.start + span.curve.length()).then_some(closed)
}

/// Path acceleration and jerk that slowing down from speed `v` and acceleration `a` may use
/// anywhere on the curve, whatever its bends ask of the axes meanwhile; `None` if they leave too
/// little.
fn reserve<const N: usize>(
    curve: &Curve<N>,
    limits: &Limits<N>,
    v: f64,
    a: f64,
) -> Option<(f64, f64)> {
    let [d1, d2, d3] = match curve.direction() {
        Some(along) => [along.map(f64::abs), [0.0; N], [0.0; N]],
        None => curve.derivative_bounds(),
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
    let enough = acceleration * (1.0 + 1e-9) >= a.abs() && jerk >= whole * RESERVE && kept;
    (enough && acceleration > 0.0).then_some((acceleration, jerk))
}

/// The shortest way from `law`'s end down to the speed `target`: jerk −j, deceleration `limit`
/// held if it is reached, jerk +j. `None` where jerk +j alone would be there no earlier.
fn closed_form(law: &Braking, target: f64, limit: f64, j: f64) -> Option<Braking> {
    let a = law.end.acceleration;
    let above = law.end.speed - target;
    // The speed above the target where the acceleration was, or will be, nothing.
    let reached = above + a * a / (2.0 * j);
    if above <= 0.0 && a <= 0.0 || reached <= 0.0 {
        return None;
    }
    let peak = (j * reached).sqrt().min(limit);
    if a + peak < -1e-9 * peak {
        return None;
    }
    let hold = (reached - peak * peak / j) / peak;
    let mut law = law.clone();
    law.push(((a + peak) / j).max(0.0), -j)?;
    law.end.acceleration = -peak;
    law.push(hold.max(0.0), 0.0)?;
    law.push(peak / j, j)?;
    law.end.speed = target;
    law.end.acceleration = 0.0;
    Some(law)
}
