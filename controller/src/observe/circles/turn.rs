//! One turn of the tool round a circle, and what it comes to.
//!
//! It is kept in parts of 1° of the tool's angle, of each the innermost and the outermost sample: so it takes as much memory at any
//! feed, and a spike counts whole. Parts that the tool passed between two samples are on the straight line between them, and all parts weigh the
//! same in a fit, however long the tool was in them.

use super::{BothWays, CircleSummary, Cycle, Reversal};
use crate::observe::record::Place;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::{FRAC_PI_2, TAU};
use syncline_trajectory::path::curve::Circle;

/// Parts of a turn.
const PARTS: usize = 360;
const PART: f64 = TAU / PARTS as f64;
/// Parts before and behind a place where an axis turns back that count to it; so many before and behind a turn are kept with it.
const AROUND: usize = 15;
/// The same, rad.
pub(super) const MARGIN: f64 = AROUND as f64 * PART;
/// Of a turn with fewer samples nothing can be said: they are more than 5° apart.
const LEAST_SAMPLES: u32 = 72;
/// Parts that have to be seen of a turn: the tool is not on the circle in the first and in the last cycle.
const LEAST_PARTS: usize = 350;
/// Names of the coordinates that arcs are in.
const NAMES: [&str; 3] = ["X", "Y", "Z"];

/// Where the tool is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// How far it has come round, rad.
    pub(super) gone: f64,
    /// From the programmed circle, positive outside, mm.
    pub(super) off: f64,
}

/// See the module.
#[derive(Clone, Debug)]
pub(super) struct Turn {
    pub(super) circle: Circle,
    /// From 0.
    pub(super) index: u64,
    at: Option<Place>,
    until: f64,
    /// Greatest of the setpoint on it, mm/s.
    feed: f64,
    speed: f64,
    samples: u32,
    /// Innermost and outermost samples, from `MARGIN` before its beginning to as much behind its end.
    parts: Vec<Option<[Sample; 2]>>,
}

/// The circle that fits best: from the programmed centre to its own, and how much greater its radius is, mm.
struct Fit {
    centre: [f64; 2],
    radius: f64,
}

impl Fit {
    /// By least squares of `off` = radius + centre · u over samples of angle and deviation, u the direction. `None`: they are too few, or
    /// on one side.
    fn of(samples: impl Iterator<Item = (f64, f64)>) -> Option<Self> {
        let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
        for (angle, off) in samples {
            let row = Vector3::new(angle.cos(), angle.sin(), 1.0);
            normal += row * row.transpose();
            right += row * off;
        }
        let found = normal.cholesky()?.solve(&right);
        Some(Self {
            centre: [found.x, found.y],
            radius: found.z,
        })
    }

    /// A deviation as it is seen from its centre, mm.
    fn off(&self, (angle, off): (f64, f64)) -> f64 {
        let [x, y] = self.centre;
        off - x * angle.cos() - y * angle.sin()
    }

    /// How far apart two circles about its centre are that samples stay between.
    fn width(&self, samples: impl Iterator<Item = (f64, f64)>) -> f64 {
        let [least, most] = extent(samples.map(|it| self.off(it)));
        most - least
    }
}

/// The least and the greatest.
fn extent(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], it| {
        [least.min(it), most.max(it)]
    })
}

fn middle([one, other]: [Sample; 2]) -> Sample {
    Sample {
        gone: 0.5 * (one.gone + other.gone),
        off: 0.5 * (one.off + other.off),
    }
}

impl Turn {
    pub(super) fn new(circle: Circle, index: u64) -> Self {
        Self {
            circle,
            index,
            at: None,
            until: 0.0,
            feed: 0.0,
            speed: 0.0,
            samples: 0,
            parts: vec![None; PARTS + 2 * AROUND],
        }
    }

    /// Where it begins, rad.
    fn begins(&self) -> f64 {
        self.index as f64 * TAU
    }

    /// Behind which nothing counts to it any more, rad.
    pub(super) fn ends(&self) -> f64 {
        self.begins() + TAU + MARGIN
    }

    /// Takes where the tool is, and where it was before, if it was on the circle then.
    pub(super) fn push(&mut self, before: Option<Sample>, now: Sample, cycle: &Cycle) {
        let begins = self.begins() - MARGIN;
        // Below 0 it is not on the turn yet.
        let part = |it: Sample| ((it.gone - begins) / PART).floor();
        let at = part(now);
        if let Some(before) = before {
            let first = (part(before) + 1.0).max(0.0) as usize;
            let slope = (now.off - before.off) / (now.gone - before.gone);
            for n in first..(at.max(0.0) as usize).min(self.parts.len()) {
                let gone = begins + (n as f64 + 0.5) * PART;
                let off = before.off + slope * (gone - before.gone);
                self.parts[n].get_or_insert([Sample { gone, off }; 2]);
            }
        }
        let kept = self.parts.get_mut(at as usize).filter(|_| at >= 0.0);
        let Some(kept) = kept else {
            return;
        };
        *kept = Some(kept.map_or([now; 2], |[inner, outer]| {
            let inner = if now.off < inner.off { now } else { inner };
            let outer = if now.off > outer.off { now } else { outer };
            [inner, outer]
        }));
        if (AROUND..AROUND + PARTS).contains(&(at as usize)) {
            self.at.get_or_insert(cycle.at);
            self.until = cycle.at.time;
            self.samples += 1;
            self.feed = self.feed.max(cycle.feed);
            self.speed = self.speed.max(cycle.speed);
        }
    }

    /// What was seen of the turn itself, part by part.
    fn seen(&self) -> impl Iterator<Item = [Sample; 2]> {
        self.parts[AROUND..AROUND + PARTS].iter().flatten().copied()
    }

    /// Whether the tool was seen all round, and often enough.
    pub(super) fn is_whole(&self) -> bool {
        self.samples >= LEAST_SAMPLES && self.seen().count() >= LEAST_PARTS
    }

    /// Whether it goes the other way, in the same turn of its circle and at the same feed.
    pub(super) fn is_reverse_of(&self, other: &Self) -> bool {
        self.index == other.index
            && self.circle.sweep.signum() != other.circle.sweep.signum()
            && (self.feed - other.feed).abs() <= 1e-6 * self.feed
    }

    /// The angle about the centre where it has come so far.
    fn angle(&self, gone: f64) -> f64 {
        self.circle.from + gone * self.circle.sweep.signum()
    }

    /// Angles and deviations, two of each part.
    fn samples(&self) -> impl Iterator<Item = (f64, f64)> {
        let samples = self.seen().flatten();
        samples.map(|it| (self.angle(it.gone), it.off))
    }

    /// The same in the order in which the tool went.
    pub(super) fn profile(&self) -> Vec<(f64, f64)> {
        let in_order = self.seen().flat_map(|[one, other]| {
            if one.gone <= other.gone {
                [one, other]
            } else {
                [other, one]
            }
        });
        let profile = in_order.map(|it| (self.angle(it.gone), it.off));
        profile.collect()
    }

    /// How far it is from the programmed circle in a direction, mm, linear between the middles of parts.
    fn off_at(&self, angle: f64) -> Option<f64> {
        let ahead = (angle - self.circle.from) * self.circle.sweep.signum();
        let at = ahead.rem_euclid(TAU) / PART - 0.5 + AROUND as f64;
        let part = |n: f64| self.parts.get(n as usize).copied().flatten().map(middle);
        match (part(at.floor()), part(at.floor() + 1.0)) {
            (Some(one), Some(other)) => Some(one.off + (other.off - one.off) * at.fract()),
            (one, other) => one.or(other).map(|it| it.off),
        }
    }

    /// What the tool does behind a place, as seen from the centre that fits: how far it is at most off the straight line on which it
    /// came there. `None` where it was not seen all the way.
    fn reversal(&self, fit: &Fit, gone: f64) -> Option<f64> {
        let place = ((gone - self.begins() + MARGIN) / PART).round() as usize;
        let around = self
            .parts
            .get(place.checked_sub(AROUND)?..place + AROUND)?
            .iter()
            .copied()
            .collect::<Option<Vec<_>>>()?;
        let (before, behind) = around.split_at(AROUND);
        let count = before.len() as f64;
        let centred = |it: Sample| Sample {
            off: fit.off((self.angle(it.gone), it.off)),
            ..it
        };
        let middles = || before.iter().copied().map(middle).map(centred);
        let gone = middles().map(|it| it.gone).sum::<f64>() / count;
        let off = middles().map(|it| it.off).sum::<f64>() / count;
        let squares: f64 = middles().map(|it| (it.gone - gone).powi(2)).sum();
        let products = middles().map(|it| (it.gone - gone) * (it.off - off));
        let slope = products.sum::<f64>() / squares;
        let errors = behind.iter().flatten().copied().map(centred);
        let errors = errors.map(|it| it.off - off - slope * (it.gone - gone));
        errors.reduce(|worst, it| if it.abs() > worst.abs() { it } else { worst })
    }

    /// What the tool does where the plane's axes turn back, that it came to and went on from.
    fn reversals(&self, fit: &Fit) -> Vec<Reversal> {
        let (one, other) = self.circle.plane;
        let places = [(one, '+'), (other, '+'), (one, '-'), (other, '-')];
        let all = places.into_iter().enumerate().filter_map(|(n, it)| {
            let ahead = (n as f64 * FRAC_PI_2 - self.circle.from) * self.circle.sweep.signum();
            let gone = self.begins() + ahead.rem_euclid(TAU);
            Some(Reversal {
                axis: NAMES.get(it.0)?,
                side: it.1,
                error_mm: self.reversal(fit, gone)?,
            })
        });
        all.collect()
    }

    /// What it comes to with one the other way round.
    fn both_ways(&self, other: &Self) -> Option<BothWays> {
        let both = || self.samples().chain(other.samples());
        let fit = Fit::of(both())?;
        let apart = self.seen().map(middle).filter_map(|it| {
            let there = other.off_at(self.angle(it.gone))?;
            Some((it.off - there).abs())
        });
        let at = other.at?;
        Some(BothWays {
            with_line: at.line,
            with_time_s: at.time,
            hysteresis_mm: apart.fold(0.0, f64::max),
            circular_deviation_mm: fit.width(both()),
            mean_deviation_mm: fit.radius,
        })
    }

    /// What it comes to, with one the other way round where there was one.
    pub(super) fn summary(&self, other: Option<&Self>) -> Option<CircleSummary> {
        let fit = Fit::of(self.samples())?;
        let circle = &self.circle;
        Some(CircleSummary {
            at: self.at?,
            until_s: self.until,
            turn: self.index + 1,
            plane: match circle.plane {
                (0, 1) => "XY",
                (2, 0) => "ZX",
                _ => "YZ",
            },
            clockwise: circle.sweep < 0.0,
            centre_mm: circle.centre,
            radius_mm: circle.radius,
            feed_mm_min: 60.0 * self.feed,
            speed_mm_min: 60.0 * self.speed,
            circular_deviation_mm: fit.width(self.samples()),
            radial_deviation_mm: extent(self.samples().map(|(_, off)| off)),
            mean_deviation_mm: fit.radius,
            centre_off_mm: fit.centre,
            reversals: self.reversals(&fit),
            both_ways: other.and_then(|other| self.both_ways(other)),
            profile: Vec::new(),
        })
    }
}
