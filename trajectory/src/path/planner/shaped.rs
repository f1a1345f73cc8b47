//! How fast curves are followed whose setpoints go through a [shaper](crate::shaper) on their way to the axes.
//!
//! # Coordinates
//!
//! By coordinates what the axes are sent is a mean of where the path was lately, p̃ = Σ Aᵢ γ(sᵢ), so it cuts curves. Let s̄ = Σ Aᵢ sᵢ. By
//! Taylor's theorem about s̄ the terms of first order cancel, and
//!
//! ```text
//! |p̃ − γ(s̄)| ≤ κ/2 · Σ Aᵢ (sᵢ − s̄)² ≤ κ v² σ² / 2
//! ```
//!
//! with the greatest curvature κ and the greatest speed v of all that the path has passed within the shaper's length T, and
//! the [variance](Spread::variance) σ² of the delays: what depends on a delay by no more than v varies by no more than v²σ².
//! Going back along the path changes nothing of that, nor does a rest. As s̄ comes to every place, each place of the path has
//! a shaped setpoint within that distance, too.
//!
//! # The clock
//!
//! By the clock the axes are sent γ(s̃), s̃ = Σ Aᵢ sᵢ, with `q″ = γ′s̃″ + γ″s̃′²` and `q‴ = γ′s̃‴ + 3γ″s̃′s̃″ + γ‴s̃′³`. A curve's
//! [bounds](Bounds) of path speed, acceleration and jerk keep the axes' limits on it in any combination, so also those of s̃′, s̃″ and
//! s̃‴, which are means of the plan's: as long as all that is in a mean with a place of the curve was inside them. What is on the curve
//! in the mean, was on it once within the shaper's length T, so nothing in that mean is further from it than VT, with the bounds'
//! speed V. Therefore the bounds hold in a zone of that length before the curve and behind it, and each piece of the path is
//! followed inside the least of all bounds in whose zones it lies; lines have bounds and zones as well, for not all directions
//! have the same. To everything behind this module such a piece is a line along the first axis, with the bounds as its limits
//! ([`PathSegment::clock`](crate::path::PathSegment::clock)): what an override, a hold or a new plan does inside them is as good as
//! the plan was. Limits of the plan alone would not do, as a feed hold brakes as hard as the axes allow.
//!
//! A mean over a rest is on one way only if the path goes on along it, so no section begins before the axes rest, which is the executor's
//! affair ([`Executor::settle`](crate::path::Executor::settle)).
//!
//! # Zones
//!
//! By coordinates a curve on which κv²σ²/2 is to be no more than what is spare of the tolerance has a greatest speed, and that has to hold
//! for as long as any of the delays is on it. It is therefore the greatest speed in a zone of the length vT before the curve and
//! behind it, too: it takes T to pass, so all that is in the mean together with a place of the curve lies in the zone. (Without
//! zones, a curve is left by up to three times as much where the line before it is fast.) The least of what is
//! spare in the zone counts: a line that has to be exact is left where a curve behind it is in the mean.
//!
//! Where a zone ends in the midst of a curve, that is cut. It is not where its own zone slows it down as much at least: each part
//! of it would have a zone of its own and cut what is behind, so that a run of short lines became a number of parts that grew with the
//! square of its length, a hundred for each curve in a minute of motion. Nor are parts cut off that are a small part of a zone.
//!
//! A zone reaches back, so what was laid is kept until nothing that may come can slow it down: as long as it takes
//! to pass what is behind it at the greatest speeds that any override allows.
//!
//! # Halves
//!
//! One half of a tolerance is for roundings and for curves in place of short segments, the other for the shaper
//! ([`shared`](crate::path::PathControlMode::shared)). Where a rounding would have to be passed so slowly that a stop takes less time, the path stops, and rests
//! until the axes have come to the corner ([`Joiner::pays`](super::joining::Joiner)).

use super::Planner;
use super::joining::{FASTEST, Laid, LaidCurve};
use super::section::most_speed;
use crate::path::bounds::Bounds;
use crate::path::segment_fitting::MoveEnd;
use crate::path::{Feed, Limits, Move, PathControlMode};
use crate::shaper::{Method, Spread};
use std::collections::VecDeque;

/// No part that is cut off is less than that, by the length of the zone: it reaches so much further, or to the curve's end.
const LEAST: f64 = 0.2;
/// By such a part of its length a curve's parts may be off it together, for rounding.
const NOTHING: f64 = 1e-6;
/// Bounds of which no less than that part would be left behind a cut hold before it, too.
const NEARLY: f64 = 0.8;

/// Slows down what is laid.
#[derive(Debug, Clone)]
pub(super) struct Shaped<const N: usize> {
    spread: Spread,
    method: Method,
    /// What may still be slowed down, in order.
    kept: VecDeque<Kept<N>>,
    /// How many of them have their own zones: what may lie in those was known.
    zoned: usize,
    /// What goes on as it is now.
    slowed: VecDeque<Laid<N>>,
}

/// A piece of the path that is kept.
#[derive(Debug, Clone)]
struct Kept<const N: usize> {
    laid: Laid<N>,
    /// mm; 0 of what is no curve.
    length: f64,
    /// At most, 1/mm.
    curvature: f64,
    /// The time in which it is passed, at least, s.
    time: f64,
    /// What keeps the axes' limits in any combination, on it alone and with what its zones have: by the clock.
    own: Bounds,
    bounds: Bounds,
}

/// Bounds of nothing but the speed.
fn of_speed(speed: f64) -> Bounds {
    Bounds {
        speed,
        acceleration: f64::INFINITY,
        jerk: f64::INFINITY,
    }
}

impl<const N: usize> Kept<N> {
    fn new(laid: Laid<N>, method: Method, limits: &Limits<N>) -> Self {
        let any = of_speed(f64::INFINITY);
        let (length, curvature, fastest, own) = match &laid {
            Laid::Curve(laid) => {
                let (curve, fastest) = (&laid.curve, fastest(laid, limits));
                let curvature = curve.most_curvature();
                let own = match method {
                    Method::Coordinates => any,
                    // What a bend is not passed faster than leaves it the more acceleration.
                    Method::Clock if curvature > 0.0 => Bounds::along(curve, fastest, limits),
                    Method::Clock => Bounds::along(curve, f64::INFINITY, limits),
                };
                (curve.length(), curvature, fastest.min(own.speed), own)
            }
            Laid::Ends(..) | Laid::Rest | Laid::Settle(_) => (0.0, 0.0, f64::INFINITY, any),
        };
        Self {
            laid,
            length,
            curvature,
            time: length / fastest,
            own,
            bounds: own,
        }
    }

    /// Its first `at` mm and the rest of it.
    fn split(&self, at: f64) -> Option<[Self; 2]> {
        let Laid::Curve(laid) = &self.laid else {
            return None;
        };
        let ends = [(0.0, at), (at, self.length)];
        let [first, second] = ends.map(|(from, to)| {
            let ends = laid.ends.iter().filter(|end| end.at > from || from == 0.0);
            let ends = ends.filter(|end| end.at <= to || to == self.length);
            let by = |end: &MoveEnd| MoveEnd {
                at: end.at - from,
                ..*end
            };
            let part = LaidCurve {
                curve: laid.curve.part(from, to),
                ends: ends.map(by).collect(),
                ..*laid
            };
            Self {
                length: part.curve.length(),
                laid: Laid::Curve(part),
                time: self.time * (to - from) / self.length,
                ..*self
            }
        });
        let joined = first.length + second.length;
        ((joined - self.length).abs() <= NOTHING * self.length).then_some([first, second])
    }

    /// How much of the tolerance the shaper has there, mm.
    fn spare(&self) -> f64 {
        match &self.laid {
            Laid::Curve(laid) => laid.spare,
            Laid::Ends(..) | Laid::Rest | Laid::Settle(_) => f64::INFINITY,
        }
    }

    /// It is followed inside these.
    fn slow_down(&mut self, to: Bounds) {
        self.bounds = self.bounds.least(to);
    }

    /// As it goes on.
    fn slowed(mut self, method: Method) -> Laid<N> {
        if let Laid::Curve(laid) = &mut self.laid {
            let Bounds {
                speed,
                acceleration,
                jerk,
            } = self.bounds;
            match method {
                Method::Coordinates => laid.most = speed,
                Method::Clock => {
                    laid.clock = Some(Limits {
                        velocity: [speed; N],
                        acceleration: [acceleration; N],
                        jerk: [jerk; N],
                    });
                }
            }
        }
        self.laid
    }
}

/// The greatest path speed along a curve with any override, mm/s.
fn fastest<const N: usize>(laid: &LaidCurve<N>, limits: &Limits<N>) -> f64 {
    let feed = match laid.feed {
        Feed::Rate(speed) => FASTEST * speed,
        Feed::Rapid | Feed::PerTurn { .. } => f64::INFINITY,
    };
    most_speed(&laid.curve, limits).min(feed)
}

impl<const N: usize> Shaped<N> {
    pub(super) fn new(spread: Spread, method: Method) -> Self {
        Self {
            spread,
            method,
            kept: VecDeque::new(),
            zoned: 0,
            slowed: VecDeque::new(),
        }
    }

    /// How long the path rests until the axes do, s.
    pub(super) fn settling(&self) -> f64 {
        self.spread.settling
    }

    /// How long a path that goes on behind a stop waits for the axes, s.
    pub(super) fn waits(&self) -> f64 {
        match self.method {
            Method::Clock => self.spread.settling,
            Method::Coordinates => 0.0,
        }
    }

    /// Goes on with what was laid.
    pub(super) fn take(&mut self, laid: Laid<N>, limits: &Limits<N>) {
        if self.kept.is_empty() && !matches!(laid, Laid::Curve(_)) {
            return self.slowed.push_back(laid);
        }
        let rests = matches!(laid, Laid::Rest);
        self.kept.push_back(Kept::new(laid, self.method, limits));
        // What is in a mean with a curve is known once it takes the shaper's length to pass what is behind.
        while self.zoned < self.kept.len()
            && (rests || self.passed_from(self.zoned + 1) >= self.spread.duration)
        {
            self.lay_zone();
            self.zoned += 1;
        }
        while rests && !self.kept.is_empty() || self.is_out_of_reach() {
            let passed = self.kept.pop_front();
            self.slowed.extend(passed.map(|it| it.slowed(self.method)));
            self.zoned -= 1;
        }
    }

    /// What goes on, one by one.
    pub(super) fn next(&mut self) -> Option<Laid<N>> {
        self.slowed.pop_front()
    }

    /// How long it takes at least to pass what is kept from so many on.
    fn passed_from(&self, first: usize) -> f64 {
        self.kept.iter().skip(first).map(|kept| kept.time).sum()
    }

    /// No zone that is still to be laid reaches the first that is kept.
    fn is_out_of_reach(&self) -> bool {
        let behind = self.kept.iter().take(self.zoned).skip(1);
        self.zoned > 0 && behind.map(|kept| kept.time).sum::<f64>() >= self.spread.duration
    }

    /// What lies within `reach` mm and the shaper's length of time of one that is kept, before it or behind it, nearest first,
    /// each with how far it is away, mm.
    fn near(
        &self,
        places: impl Iterator<Item = usize>,
        reach: f64,
    ) -> impl Iterator<Item = (usize, f64)> {
        let (mut away, mut time) = (0.0, 0.0);
        let near = places.map_while(move |place| {
            let here = away;
            let is_near = here < reach && time < self.spread.duration;
            away += self.kept[place].length;
            time += self.kept[place].time;
            is_near.then_some((place, here))
        });
        near.filter(|&(place, _)| self.kept[place].length > 0.0)
    }

    /// What bounds the motion along a curve, and along what is in a mean with it; none of what is no curve, or lets any.
    fn bounds_about(&self, own: usize) -> Option<Bounds> {
        let Kept {
            curvature, length, ..
        } = self.kept[own];
        if self.method == Method::Clock {
            return (length > 0.0).then_some(self.kept[own].own);
        }
        if curvature == 0.0 {
            return None;
        }
        let spare = self.kept[own].spare();
        let reach = self.spread.speed(curvature, spare) * self.spread.duration;
        let before = self.near((0..own).rev(), reach);
        let spare = before
            .chain(self.near(own + 1..self.kept.len(), reach))
            .map(|(place, _)| self.kept[place].spare())
            .fold(spare, f64::min);
        Some(of_speed(self.spread.speed(curvature, spare)))
    }

    /// Slows down the curve that has none yet, and what may be in a mean with it.
    fn lay_zone(&mut self) {
        let own = self.zoned;
        let Some(bounds) = self.bounds_about(own) else {
            return;
        };
        let reach = bounds.speed * self.spread.duration;
        self.kept[own].slow_down(bounds);
        let behind: Vec<_> = self.near(own + 1..self.kept.len(), reach).collect();
        let before: Vec<_> = self.near((0..own).rev(), reach).collect();
        // The last first: what is split moves those behind it on.
        let least = LEAST * reach;
        for (place, away) in behind.into_iter().rev() {
            self.slow_down(place, (reach - away).max(least), least, bounds, true);
        }
        for (place, away) in before {
            if self.slow_down(place, (reach - away).max(least), least, bounds, false) {
                self.zoned += 1;
            }
        }
    }

    /// Slows down the first, or the last, so many mm of what is kept there, if it could be faster, and cuts off no less than
    /// `least` mm. Whether it was split.
    fn slow_down(
        &mut self,
        place: usize,
        length: f64,
        least: f64,
        bounds: Bounds,
        first: bool,
    ) -> bool {
        let kept = &mut self.kept[place];
        let fastest = kept.length / kept.time;
        let own = self.spread.speed(kept.curvature, kept.spare());
        let (is_slow, is_nearly) = match self.method {
            Method::Coordinates => {
                let top = kept.bounds.speed.min(fastest).min(own);
                (top <= bounds.speed, false)
            }
            Method::Clock => (
                bounds.are_at_least(1.0, kept.bounds),
                bounds.are_at_least(NEARLY, kept.bounds),
            ),
        };
        if is_slow {
            return false;
        }
        let left = kept.length - length;
        if left <= least || is_nearly {
            kept.slow_down(bounds);
            return false;
        }
        let at = if first { length } else { left };
        let Some([mut one, mut other]) = kept.split(at) else {
            kept.slow_down(bounds);
            return false;
        };
        if first { &mut one } else { &mut other }.slow_down(bounds);
        self.kept[place] = one;
        self.kept.insert(place + 1, other);
        true
    }
}

impl<const N: usize> Planner<N> {
    /// From here on by the method of that mode, unless that is chosen; behind a stop where it is another one than before.
    pub(super) fn shape_as(&mut self, mode: PathControlMode) {
        let method = self.method.unwrap_or(mode.method());
        let other = |(_, now): &(Spread, Method)| *now != method;
        let Some((spread, _)) = self.joiner.shaper.filter(other) else {
            return;
        };
        self.close();
        self.for_each_joiner(|joiner| joiner.shaper = Some((spread, method)));
        self.shaped = Some(Shaped::new(spread, method));
    }

    /// A move as it is joined, with its half of the tolerance where a shaper has the other one, and that.
    pub(super) fn share(&self, motion: Move<N>) -> (Move<N>, f64) {
        let Some((_, Method::Coordinates)) = self.joiner.shaper else {
            return (motion, 0.0);
        };
        let (mode, spare) = motion.mode.shared(self.exact);
        (Move { mode, ..motion }, spare)
    }
}
