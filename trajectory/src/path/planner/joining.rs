//! Joins moves to sections: fits curves to short segments, rounds corners, and rests where it can do
//! neither.

use super::NOTHING;

use crate::limits::PositionLimits;
use crate::path::blend::{Blend, blend, needed_part, passing_time};
use crate::path::bounds::{Bounds, crawling_time};
use crate::path::segment_fitting::{MoveEnd, Part, ShortSegments};
use crate::path::{Curve, Feed, Limits, Move, PathSegment};
use crate::shaper::{Method, Spread};

/// Tangents, and curvatures by the mm or as parts of the greater, that differ by no more are equal.
const SMOOTH: f64 = 1e-10;
/// Parts of the tolerance that a rounding is tried with, so that it stays between the positions
/// allowed.
const LESSER: [f64; 4] = [1.0, 0.25, 0.0625, 0.015625];

/// Part of the time of a blend in which a gentle one has to be passed to be taken: it is entered at less speed.
const SOONER: f64 = 0.8;
/// Roundings are sized for programmed feeds that are overridden to so many times as much.
pub(super) const FASTEST: f64 = 2.0;
/// How often a rounding that is larger than needed is made smaller, at most, …
const SMALLER: usize = 4;
/// … to how many times what is needed.
const ROOM: f64 = 1.1;
/// Part of a move that is a sliver: no window is solved over what so little of it would be between two roundings.
const SLIVER: f64 = 0.01;
/// No rounding is made so small that it would be passed in less time, s: that does not show.
const SHORTEST_PASSAGE: f64 = 1e-3;

/// What moves are joined to, piece by piece.
#[derive(Debug, Clone)]
pub(super) struct Joiner<const N: usize> {
    pub(super) limits: Limits<N>,
    /// Positions that curves of its own stay between.
    pub(super) bounds: [PositionLimits; N],
    /// What curves in place of short segments stay within at most, mm.
    pub(super) fits_within: f64,
    /// Short segments that may go on.
    pub(super) short_segments: Option<ShortSegments<N>>,
    /// How far a shaper spreads the setpoints, by what method, and by how much it may leave what is joined, mm.
    pub(super) shaper: Option<(Spread, Method)>,
    pub(super) spare: f64,
    pub(super) pending: Option<Pending<N>>,
    /// How far that strays from what was programmed, mm.
    deviation: f64,
    /// Waypoints so far.
    pub(super) waypoints: u32,
    /// What moves became, and nobody has taken yet.
    pub(super) laid: Vec<Laid<N>>,
}

/// The last move, until what comes next tells how it is left.
#[derive(Debug, Clone)]
pub(super) struct Pending<const N: usize> {
    pub(super) motion: Move<N>,
    /// Where on it the moves end that became one with it.
    ends: Vec<MoveEnd>,
    /// How much of its start a blend took, mm.
    pub(super) taken: f64,
    /// Waypoints before it.
    waypoints: u32,
    /// By how much a shaper may leave it, mm.
    pub(super) spare: f64,
}

/// A piece of the path.
#[derive(Debug, Clone, PartialEq)]
#[allow(clippy::large_enum_variant)] // nearly all are curves
pub(super) enum Laid<const N: usize> {
    /// A curve.
    Curve(LaidCurve<N>),
    /// Moves that end on the last so many mm, and where on those.
    Ends(f64, Vec<MoveEnd>),
    /// The path stops.
    Rest,
    /// It rests until shaped setpoints do, under the tag of the last move.
    Settle(u32),
}

/// A curve of the path.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LaidCurve<const N: usize> {
    pub(super) curve: Curve<N>,
    /// Programmed.
    pub(super) feed: Feed,
    pub(super) tag: u32,
    /// Waypoints before it.
    pub(super) waypoints: u32,
    /// Other moves that end on it before the one with the tag.
    pub(super) ends: Vec<MoveEnd>,
    /// By how much a shaper may leave it, mm.
    pub(super) spare: f64,
    /// The path speed that it allows, mm/s; or what it allows where it shapes the clock.
    pub(super) most: f64,
    pub(super) clock: Option<Limits<N>>,
}

impl<const N: usize> From<&LaidCurve<N>> for PathSegment<N> {
    /// As programmed, at the beginning of a section.
    fn from(laid: &LaidCurve<N>) -> Self {
        PathSegment {
            start: 0.0,
            curve: laid.curve,
            feed: laid.feed.speed(),
            turns: laid.feed.turns(),
            most: laid.most,
            clock: laid.clock,
            asked: laid.feed.speed(),
            speed: laid.feed.speed().min(laid.most),
            tag: laid.tag,
            waypoints: laid.waypoints,
        }
    }
}

impl<const N: usize> Joiner<N> {
    pub(super) fn new(limits: Limits<N>) -> Self {
        Joiner {
            limits,
            bounds: [PositionLimits {
                min: f64::NEG_INFINITY,
                max: f64::INFINITY,
            }; N],
            fits_within: f64::INFINITY,
            short_segments: None,
            shaper: None,
            spare: 0.0,
            pending: None,
            deviation: 0.0,
            waypoints: 0,
            laid: Vec::new(),
        }
    }

    /// The path rests where what was joined so far ends.
    pub(super) fn rest_here(&mut self) {
        self.lay_pending(0.0);
        self.laid.push(Laid::Rest);
    }

    /// Goes on with a move that begins where the last one ended, and that a shaper may leave by `spare` mm.
    pub(super) fn push(&mut self, motion: Move<N>, spare: f64) {
        if let Some(segments) = &mut self.short_segments
            && segments.extend(&motion)
        {
            self.join_parts(false);
            return;
        }
        self.join_short_segments();
        self.spare = spare;
        self.short_segments = ShortSegments::begin(&motion, self.fits_within);
        if self.short_segments.is_none() {
            self.join(Part {
                motion,
                ends: Vec::new(),
                deviation: 0.0,
                goes_on: false,
            });
        }
    }

    /// Joins the short segments that were gathered.
    pub(super) fn join_short_segments(&mut self) {
        self.join_parts(true);
        self.short_segments = None;
    }

    /// Joins what the short segments that were gathered give, all of it if there come no more.
    fn join_parts(&mut self, ended: bool) {
        let (bounds, limits) = (self.bounds, self.limits);
        while let Some(segments) = &mut self.short_segments {
            let feed = segments.feed();
            let part = segments.next(ended, |curve, points| {
                inside(curve, &bounds) && is_quick(curve, points, feed, &limits)
            });
            let Some(part) = part else { break };
            self.join(part);
        }
    }

    /// Joins a part of the path to the last one.
    fn join(&mut self, part: Part<N>) {
        let Part {
            motion,
            ends: part_ends,
            deviation,
            goes_on,
        } = part;
        let feed = motion.feed;
        let mut taken = 0.0;
        if let Some(Pending {
            motion: before,
            waypoints,
            spare,
            ..
        }) = &self.pending
        {
            let (before, waypoints) = (*before, *waypoints);
            let spare = spare.min(self.spare);
            match before.mode.rounding() {
                Some(_) if goes_on || smooth(&before.curve, &motion.curve) => {
                    self.lay_pending(0.0);
                }
                Some(rounding) => {
                    let deviation = deviation.max(self.deviation);
                    let left = rounding.min(before.mode.tolerance() - deviation);
                    let there = before.curve.length() - self.taken();
                    let rounding = self.round(&before, &motion, there, left);
                    if let Some((curve, cut)) =
                        rounding.filter(|(curve, _)| self.pays(&before, &motion, curve))
                    {
                        // The rounding takes as much of either side.
                        let scale = curve.length() / (2.0 * cut);
                        let mut ends = self.lay_pending(cut);
                        ends.iter_mut().for_each(|end| end.at *= scale);
                        let joint = (waypoints, self.waypoints);
                        self.lay_rounding(&before, feed, spare, curve, joint, &ends);
                        self.tell_ends_in_rounding(before.tag, curve.length(), cut, &part_ends);
                        taken = cut;
                    } else {
                        self.rest_between(before.tag);
                    }
                }
                None => self.rest_between(before.tag),
            }
        }
        self.pending = Some(Pending {
            motion,
            ends: part_ends,
            taken,
            waypoints: self.waypoints,
            spare: self.spare,
        });
        self.deviation = deviation;
    }

    /// The path rests between two moves, of which the first has this tag; behind a shaper until the axes have come there, which
    /// the executor sees to where that shapes the clock.
    fn rest_between(&mut self, tag: u32) {
        self.rest_here();
        if let Some((_, Method::Coordinates)) = self.shaper {
            self.laid.push(Laid::Settle(tag));
        }
    }

    /// Whether a rounding takes no longer than a stop. Behind a shaper it is passed, and about it the path followed for the
    /// shaper's length on either side, no faster than its curvature allows; at the stop the path rests for that long.
    fn pays(&self, before: &Move<N>, after: &Move<N>, curve: &Curve<N>) -> bool {
        let Some((spread, method)) = self.shaper else {
            return true;
        };
        let spare = self.pending.as_ref().map_or(0.0, |it| it.spare);
        let slow = match method {
            Method::Coordinates => spread.speed(curve.most_curvature(), spare.min(self.spare)),
            Method::Clock => Bounds::along(curve, f64::INFINITY, &self.limits).speed,
        };
        let fast = joint_speed(before, after, 1.0, &self.limits);
        if slow >= fast {
            return true;
        }
        let moves = [before, after];
        let half: f64 = moves.map(|it| 0.5 * it.curve.length()).iter().sum();
        let slowly = half.min(curve.length() + 2.0 * spread.duration * slow);
        let crawling = moves.map(|it| crawling_time(&it.curve, it.feed.speed(), &self.limits));
        let stopping = spread.settling + 0.5 * crawling.iter().sum::<f64>();
        slowly / slow + (half - slowly) / fast <= stopping
    }

    /// What the last rounding took of the pending move, mm.
    fn taken(&self) -> f64 {
        self.pending.as_ref().map_or(0.0, |pending| pending.taken)
    }

    /// The rounding between two moves within a tolerance, and what both give up for it, mm: no more than
    /// it takes to pass it at the speed that the moves have there. So much of the first one is `there`, of which it
    /// leaves nothing or more than a sliver.
    fn round(
        &self,
        before: &Move<N>,
        after: &Move<N>,
        there: f64,
        tolerance: f64,
    ) -> Option<(Curve<N>, f64)> {
        let limits = &self.limits;
        let speed = joint_speed(before, after, FASTEST, limits);
        let length = before.curve.length();
        let is_sliver = |cut: f64| {
            let left = there - cut;
            left > NOTHING * length && left < SLIVER * length
        };
        let all = |most| {
            let within = |part: &f64| self.round_within(before, after, most, tolerance * part);
            LESSER.iter().find_map(within)
        };
        let (mut curve, mut cut) = all(f64::INFINITY)?;
        if is_sliver(cut)
            && let Some(smaller) = all(there - SLIVER * length)
        {
            (curve, cut) = smaller;
        }
        for _ in 0..SMALLER {
            let part = needed_part(&curve, speed, limits) * ROOM;
            let most = (cut * part).max(0.5 * speed * SHORTEST_PASSAGE);
            if most >= cut {
                break;
            }
            let smaller = self.round_within(before, after, most, tolerance);
            let Some(smaller) = smaller.filter(|(it, _)| needed_part(it, speed, limits) <= 1.0)
            else {
                break;
            };
            if is_sliver(smaller.1) {
                break;
            }
            (curve, cut) = smaller;
        }
        Some((curve, cut))
    }

    /// The rounding for which two moves give up `most` mm at most, in the shape that is passed sooner.
    fn round_within(
        &self,
        before: &Move<N>,
        after: &Move<N>,
        most: f64,
        tolerance: f64,
    ) -> Option<(Curve<N>, f64)> {
        let feeds = [before, after].map(|motion| motion.feed.speed());
        let [slow, fast] = [feeds[0].min(feeds[1]), feeds[0].max(feeds[1])];
        let may_be = |curve: &Curve<N>| {
            inside(curve, &self.bounds) && crawling_time(curve, slow, &self.limits).is_finite()
        };
        let time = |curve: &Curve<N>| passing_time(curve, fast, &self.limits);
        let Blend { curve, gentle, cut } = blend(&before.curve, &after.curve, most, tolerance)?;
        let gentle = gentle.filter(|gentle| may_be(gentle));
        let sharp = Some(curve).filter(|sharp| may_be(sharp));
        let curve = match (sharp, gentle) {
            (Some(sharp), Some(gentle)) if time(&gentle) > SOONER * time(&sharp) => sharp,
            (sharp, gentle) => gentle.or(sharp)?,
        };
        Some((curve, cut))
    }

    /// Lays the pending move but for the last `cut` of it. Which moves end in that, from where it begins.
    fn lay_pending(&mut self, cut: f64) -> Vec<MoveEnd> {
        let Some(Pending {
            motion,
            ends,
            taken,
            waypoints,
            spare,
        }) = self.pending.take()
        else {
            return Vec::new();
        };
        let length = motion.curve.length();
        let left = length - taken - cut;
        // Where blends have taken both halves nothing is left.
        let some = left > NOTHING * length;
        let mut laid = ends;
        // The others end in the rounding before it.
        laid.retain(|end| end.at > taken);
        laid.iter_mut().for_each(|end| end.at -= taken);
        let first = laid.partition_point(|end| cut == 0.0 || some && end.at <= left);
        let mut in_cut = laid.split_off(first);
        for end in &mut in_cut {
            end.at = (end.at - left).max(0.0);
        }
        if some {
            let whole = taken == 0.0 && cut == 0.0;
            let curve = if whole {
                motion.curve
            } else {
                motion.curve.part(taken, length - cut)
            };
            self.lay(curve, motion.feed, spare, motion.tag, waypoints, &laid);
        }
        in_cut
    }

    /// Tells that the move before a rounding of that length, which was laid last, ends in the middle of it, and
    /// which of those behind it end in the `cut` that it took of them.
    fn tell_ends_in_rounding(&mut self, before: u32, length: f64, cut: f64, behind: &[MoveEnd]) {
        let half = 0.5 * length;
        let middle = MoveEnd {
            tag: before,
            at: half,
        };
        let behind = behind.iter().take_while(|end| end.at <= cut);
        let behind = behind.map(|end| MoveEnd {
            at: half + end.at * half / cut,
            ..*end
        });
        let told = [middle].into_iter().chain(behind);
        self.laid.push(Laid::Ends(length, told.collect()));
    }

    /// Lays the rounding between a move and one that is programmed with `feed`, with so many waypoints before the one
    /// and the other. Both give up the same length for it, so its middle stands for the joint: there the programmed
    /// feed changes and the waypoints between them are, and the other moves that end on it end before that.
    fn lay_rounding(
        &mut self,
        before: &Move<N>,
        feed: Feed,
        spare: f64,
        curve: Curve<N>,
        (waypoints, behind): (u32, u32),
        ends: &[MoveEnd],
    ) {
        let tag = before.tag;
        if before.feed == feed && waypoints == behind {
            self.lay(curve, feed, spare, tag, waypoints, ends);
            return;
        }
        let length = curve.length();
        let middle = 0.5 * length;
        let halves = [(0.0, middle), (middle, length)].map(|(from, to)| curve.part(from, to));
        self.lay(halves[0], before.feed, spare, tag, waypoints, ends);
        self.lay(halves[1], feed, spare, tag, behind, &[]);
    }

    fn lay(
        &mut self,
        curve: Curve<N>,
        feed: Feed,
        spare: f64,
        tag: u32,
        waypoints: u32,
        ends: &[MoveEnd],
    ) {
        self.laid.push(Laid::Curve(LaidCurve {
            curve,
            feed,
            tag,
            waypoints,
            ends: ends.to_vec(),
            spare,
            most: f64::INFINITY,
            clock: None,
        }));
    }
}

/// The most that the path's speed may be where two moves meet, with their feeds overridden to `part`, but for what their
/// joint asks of it.
fn joint_speed<const N: usize>(
    before: &Move<N>,
    after: &Move<N>,
    part: f64,
    limits: &Limits<N>,
) -> f64 {
    let ends = [(before, before.curve.length()), (after, 0.0)];
    let speeds = ends.map(|(motion, at)| {
        let tangent = motion.curve.at(at).d1;
        (0..N)
            .map(|i| limits.velocity[i] / tangent[i].abs())
            .fold(part * motion.feed.speed(), f64::min)
    });
    speeds[0].min(speeds[1])
}

/// Whether a curve stays between these positions, but for rounding; a coordinate that one of its ends has beyond them goes no further.
fn inside<const N: usize>(curve: &Curve<N>, bounds: &[PositionLimits; N]) -> bool {
    let (low, high) = curve.bounds();
    let ends = [curve.start(), curve.end()];
    (0..N).all(|i| {
        let [from, to] = ends.map(|end| end[i]);
        let least = bounds[i].min.min(from).min(to);
        let most = bounds[i].max.max(from).max(to);
        low[i] >= least - NOTHING && high[i] <= most + NOTHING
    })
}

/// Whether a curve, crawled along from rest to rest, takes no longer than the segments between these points
/// with a stop at each.
fn is_quick<const N: usize>(
    curve: &Curve<N>,
    points: &[([f64; N], u32)],
    feed: f64,
    limits: &Limits<N>,
) -> bool {
    let lines = points
        .windows(2)
        .map(|ends| Curve::line(ends[0].0, ends[1].0));
    let stops: f64 = (lines.flatten())
        .map(|line| crawling_time(&line, feed, limits))
        .sum();
    crawling_time(curve, feed, limits) <= stops
}

/// Whether tangent and curvature go on unbroken from one curve to the next.
fn smooth<const N: usize>(before: &Curve<N>, after: &Curve<N>) -> bool {
    let (b, a) = (before.at(before.length()), after.at(0.0));
    let bend = (0..N)
        .map(|i| b.d2[i].abs().max(a.d2[i].abs()))
        .fold(1.0, f64::max);
    (0..N)
        .all(|i| (b.d1[i] - a.d1[i]).abs() <= SMOOTH && (b.d2[i] - a.d2[i]).abs() <= SMOOTH * bend)
}
