//! A place on the path, what the axes allow there, and what a cell asks of them.

use super::search::{LOOKING, POLY_CELLS, PROVING, SHARE};
use super::{ROUNDING, instant_at};
use crate::path::certify::{self, crest};
use crate::path::time_parametrisation::Slope;
use crate::path::{Curve, JerkSegment, Limits, PathSegment, PathState};

/// Angle, in rad, over which the crest of a parabola tells what a circle asks for.
const TURN: f64 = 0.06;
/// By how much that may be too little, as a part of it: a sine's third derivative over half the angle,
/// with room for speeds that change meanwhile.
const TURN_ERROR: f64 = 1.5e-5;
/// Parts that a cell is sampled in at most on a circle, and on a polynomial, so that its work is bounded.
const MOST_TURNS: f64 = 32.0;
const MOST_POLY_PARTS: f64 = 6.0;
/// What is left of an acceleration goes in one cell that is up to this longer than the others.
const WHOLE: f64 = 1.5;
/// Looks at the path where a cell in which an acceleration is taken back ends: the first tells the jerk,
/// which tells the end, and the second is close enough.
const LOOKS: usize = 2;
/// Lowest and highest jerk that contradict each other by no more, as a part of what is allowed where
/// nothing bends, do so by rounding.
const CONTRADICTION: f64 = 1e-3;
/// A jerk is compared with no less than this part of what is allowed where nothing bends.
const LITTLE: f64 = 0.1;

/// Geometry under way: the path segments of one section from some distance on.
pub(super) struct PathCursor<S> {
    pub(super) path: S,
    pub(super) index: usize,
}

impl<'a, const N: usize, S: Fn(usize) -> Option<&'a PathSegment<N>>> PathCursor<S> {
    /// The path segment at `distance`, no earlier than the last one asked for.
    fn path_segment_at(&mut self, distance: f64) -> Option<&'a PathSegment<N>> {
        while let Some(next) = (self.path)(self.index + 1)
            && next.start <= distance
        {
            self.index += 1;
        }
        (self.path)(self.index)
    }
}

/// A state on the path, what happens in the cell that follows, and the path there.
#[derive(Debug, Clone, Copy)]
pub(super) struct BrakingNode<const N: usize> {
    pub(super) s: f64,
    pub(super) v: f64,
    pub(super) a: f64,
    /// Duration of the cell, s, and the jerk in it.
    pub(super) t: f64,
    pub(super) jerk: f64,
    /// By how much the path jerk that is allowed differs between its ends where that tells its jerk.
    pub(super) uneven: f64,
    /// The path there: on what path segment, and how.
    pub(super) index: usize,
    pub(super) rows: [Row; N],
    /// Where it was looked up last, and in the round before; what that was off.
    pub(super) looked: [f64; 2],
    pub(super) off: f64,
    /// Parts of the acceleration limits here and of the jerk limits in the cell that are used.
    pub(super) share: [f64; 2],
}

impl<const N: usize> BrakingNode<N> {
    pub(super) fn nowhere() -> Self {
        BrakingNode {
            s: 0.0,
            v: 0.0,
            a: 0.0,
            t: 0.0,
            jerk: 0.0,
            uneven: 0.0,
            index: 0,
            rows: [[0.0; 3]; N],
            looked: [0.0; 2],
            off: 0.0,
            share: [SHARE; 2],
        }
    }

    pub(super) fn take(&mut self, state: PathState) {
        (self.s, self.v, self.a) = (state.distance, state.speed, state.acceleration);
    }

    /// Looks up the path.
    pub(super) fn look<'a>(
        &mut self,
        cursor: &mut PathCursor<impl Fn(usize) -> Option<&'a PathSegment<N>>>,
        limits: &Limits<N>,
        distance: f64,
    ) -> Option<()> {
        let path_segment = cursor.path_segment_at(distance)?;
        let slope = path_segment.slope(distance - path_segment.start);
        self.rows = rows(&slope, path_segment.limits(limits));
        self.index = cursor.index;
        Some(())
    }

    /// The path acceleration and jerk that the axes allow where nothing bends.
    pub(super) fn along(&self, limits: &Limits<N>) -> [f64; 2] {
        let mut most = [0.0_f64; 2];
        for (i, [d1, ..]) in self.rows.iter().enumerate() {
            most[0] = most[0].max(d1.abs() * limits.jerk[i] / limits.acceleration[i]);
            most[1] = most[1].max(d1.abs());
        }
        most.map(|part| 1.0 / part)
    }

    /// The E and the jerk that the axes allow where nothing bends.
    pub(super) fn unbent(&self, limits: &Limits<N>) -> [f64; 2] {
        let [acceleration, jerk] = self.along(limits);
        [0.5 * acceleration * acceleration, jerk]
    }

    /// Takes the acceleration back for the duration `tick`, or until there is none, with the lowest
    /// jerk that the axes allow at both ends, their accelerations kept. By how much more is allowed at
    /// the start alone, as a part of what is where nothing bends; infinite if that is too much for an
    /// axis.
    pub(super) fn ease<'a>(
        &mut self,
        cursor: &PathCursor<impl Fn(usize) -> Option<&'a PathSegment<N>>>,
        limits: &Limits<N>,
        tick: f64,
    ) -> Option<f64> {
        let along = self.along((cursor.path)(self.index)?.limits(limits))[1];
        let [low, high] = jerks(self, self.share[1], self.a, 0.0);
        if low > high + CONTRADICTION * along {
            return None;
        }
        self.jerk = low;
        let mut uneven = 0.0;
        for _ in 0..LOOKS {
            let whole = if self.jerk < 0.0 {
                self.a / -self.jerk
            } else {
                f64::INFINITY
            };
            self.t = if whole < WHOLE * tick { whole } else { tick };
            let mut there = *self;
            let end = self.end()?;
            there.take(end);
            let mut scout = PathCursor {
                path: &cursor.path,
                index: cursor.index,
            };
            there.look(&mut scout, limits, end.distance)?;
            let [least, most] = jerks(&there, self.share[1], self.a, self.t);
            let limits = (cursor.path)(there.index)?.limits(limits);
            let steady = (accelerations(&there, limits)[0] - self.a) / self.t;
            let need = low.max(least).max(steady);
            uneven = if need > high.min(most) {
                f64::INFINITY
            } else {
                (need - low.min(least)) / need.abs().clamp(LITTLE * along, along)
            };
            self.jerk = need;
        }
        let gone = self.a * (1.0 - ROUNDING);
        if self.jerk < 0.0 && self.t * -self.jerk > gone {
            self.t = self.a / -self.jerk;
        }
        Some(uneven)
    }

    pub(super) fn segment(&self) -> JerkSegment {
        JerkSegment {
            duration: self.t,
            distance: self.s,
            speed: self.v,
            acceleration: self.a,
            jerk: self.jerk,
        }
    }

    /// The state at the end of the cell.
    pub(super) fn end(&self) -> Option<PathState> {
        let (ds, speed, acceleration) = self.segment().at(self.t);
        let sane = self.t >= 0.0 && self.t.is_finite() && ds.is_finite();
        sane.then_some(PathState {
            distance: self.s + ds,
            speed,
            acceleration,
        })
    }

    /// Whether every axis provably keeps its limits on the polynomials in the cell up to `next`.
    pub(super) fn is_certain<'a>(
        &self,
        next: &Self,
        path: &impl Fn(usize) -> Option<&'a PathSegment<N>>,
        limits: &Limits<N>,
        (slack, halvings): (f64, usize),
        work: &mut usize,
    ) -> Option<bool> {
        let segment = self.segment();
        let mut begin = 0.0;
        for index in self.index..=next.index {
            let here = path(index)?;
            let until = if index == next.index {
                segment.duration
            } else {
                instant_at(&segment, path(index + 1)?.start)
            };
            if here.clock.is_none()
                && let Curve::Poly(_) = here.curve
            {
                let (ds, speed, acceleration) = segment.at(begin);
                let part = JerkSegment {
                    duration: until - begin,
                    distance: segment.distance + ds,
                    speed,
                    acceleration,
                    jerk: segment.jerk,
                };
                *work += PROVING;
                if !certify::keeps(&part, here, limits, slack, halvings) {
                    return Some(false);
                }
            }
            begin = until;
        }
        Some(true)
    }

    /// What the cell up to `next` asks of the axes at most, as parts of their limits.
    pub(super) fn asks<'a>(
        &self,
        next: &Self,
        path: &impl Fn(usize) -> Option<&'a PathSegment<N>>,
        limits: &Limits<N>,
        work: &mut usize,
    ) -> Option<[f64; 3]> {
        let segment = self.segment();
        let mut begin = 0.0;
        let mut first = (self.rows, self.v, self.a);
        let mut over = [0.0_f64; 3];
        for index in self.index..=next.index {
            let here = path(index)?;
            let limits = here.limits(limits);
            let on = |t: f64| {
                let (ds, v, a) = segment.at(t);
                let at = here.slope((segment.distance - here.start) + ds);
                (rows(&at, limits), v, a)
            };
            if index > self.index {
                first = on(begin);
            }
            let (until, end) = if index == next.index {
                (self.t, (next.rows, next.v, next.a))
            } else {
                let until = instant_at(&segment, path(index + 1)?.start);
                (until, on(until))
            };
            // Polynomials change quickly, circles with the angle.
            let travel = segment.at(until).0 - segment.at(begin).0;
            let parts = match here.curve {
                _ if here.clock.is_some() => 1.0,
                Curve::Line(_) => 1.0,
                Curve::Arc(_) => {
                    let bends = first
                        .0
                        .iter()
                        .zip(&limits.jerk)
                        .map(|(row, j)| row[1].abs() * j);
                    (travel * bends.fold(0.0, f64::max) / 3.0 / TURN)
                        .ceil()
                        .clamp(1.0, MOST_TURNS)
                }
                Curve::Poly(_) => (2.0 * POLY_CELLS * travel / here.curve.length())
                    .ceil()
                    .clamp(1.0, MOST_POLY_PARTS),
            };
            let bent = match here.curve {
                Curve::Arc(_) if here.clock.is_none() => 1.0 + TURN_ERROR,
                _ => 1.0,
            };
            *work += 2 * LOOKING * parts as usize + 1;
            let each = (until - begin) / parts;
            let mut last = first;
            for k in 0..parts as usize {
                let t = begin + each * k as f64;
                let next = if k + 1 == parts as usize {
                    end
                } else {
                    on(t + each)
                };
                let load = loads([&last, &on(t + 0.5 * each), &next], segment.jerk, limits);
                for (over, load) in over.iter_mut().zip(load) {
                    *over = over.max(load * bent);
                }
                last = next;
            }
            begin = until;
        }
        Some(over)
    }
}

/// What the path asks of an axis at a point: its derivatives by path length, the second times
/// three, as parts of the axis's jerk limit.
type Row = [f64; 3];

fn rows<const N: usize>(at: &Slope<N>, limits: &Limits<N>) -> [Row; N] {
    let mut rows = [[0.0; 3]; N];
    for i in 0..N {
        let part = 1.0 / limits.jerk[i];
        rows[i] = [at.d1[i] * part, 3.0 * at.d2[i] * part, at.d3[i] * part];
    }
    rows
}

fn is_still(row: &Row) -> bool {
    row.iter().all(|x| *x == 0.0)
}

/// Narrows the range of x to where |slope x + offset| ≤ limit.
fn within(range: &mut [f64; 2], slope: f64, offset: f64, limit: f64) {
    if slope != 0.0 {
        let part = 1.0 / slope;
        let (middle, half) = (-offset * part, limit * part.abs());
        *range = [range[0].max(middle - half), range[1].min(middle + half)];
    }
}

/// The range of path jerks j that every axis allows at a node for the path acceleration a + c j,
/// with that part of the limits.
pub(super) fn jerks<const N: usize>(node: &BrakingNode<N>, share: f64, a: f64, c: f64) -> [f64; 2] {
    let v = node.v;
    let mut range = [f64::NEG_INFINITY, f64::INFINITY];
    for [d1, d2, d3] in &node.rows {
        let slope = d1 + d2 * v * c;
        within(&mut range, slope, (d3 * v * v + d2 * a) * v, share);
    }
    range
}

/// The range of path accelerations at a node for which every axis keeps its limit, and for which
/// there is a path jerk so that every axis keeps that.
pub(super) fn accelerations<const N: usize>(node: &BrakingNode<N>, limits: &Limits<N>) -> [f64; 2] {
    let BrakingNode { v, share, .. } = *node;
    let mut range = [f64::NEG_INFINITY, f64::INFINITY];
    for (i, row) in node.rows.iter().enumerate() {
        if is_still(row) {
            continue;
        }
        let limit = share[0] * limits.acceleration[i] / limits.jerk[i];
        within(&mut range, row[0], row[1] * v * v / 3.0, limit);
        for other in &node.rows[..i] {
            if is_still(other) {
                continue;
            }
            // Both ask for the same jerk.
            let slope = v * (row[1] * other[0] - other[1] * row[0]);
            let bend = v * v * v * (row[2] * other[0] - other[2] * row[0]);
            let both = other[0].abs() + row[0].abs();
            within(&mut range, slope, bend, share[1] * both);
        }
    }
    range
}

/// An instant of a jerk segment: what the path asks there, speed and acceleration.
type Sample<const N: usize> = ([Row; N], f64, f64);

/// What every axis is asked for at most, as parts of its velocity, acceleration and jerk limits:
/// the crests of the parabolas through three samples the same time apart.
fn loads<const N: usize>(samples: [&Sample<N>; 3], jerk: f64, limits: &Limits<N>) -> [f64; 3] {
    let mut most = [0.0_f64; 3];
    for i in 0..N {
        if samples.iter().all(|(rows, ..)| is_still(&rows[i])) {
            continue;
        }
        let mut asked = [[0.0; 3]; 3];
        for (k, (rows, v, a)) in samples.into_iter().enumerate() {
            let [d1, d2, d3] = rows[i];
            asked[0][k] = d1 * v;
            asked[1][k] = d2 * v * v / 3.0 + d1 * a;
            asked[2][k] = (d3 * v * v + d2 * a) * v + d1 * jerk;
        }
        let by = [
            limits.jerk[i] / limits.velocity[i],
            limits.jerk[i] / limits.acceleration[i],
            1.0,
        ];
        for what in 0..3 {
            most[what] = most[what].max(crest(asked[what]) * by[what]);
        }
    }
    most
}
