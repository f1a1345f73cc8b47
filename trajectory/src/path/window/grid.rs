//! Where the cells of a window are: about equal times apart, by an estimate of the speed along it.

use super::{CURVE_SHARE, SPEED_SHARE, Window, asked};
use crate::path::time_parametrisation::{Cell, Slope};
use crate::path::{Limits, PathSegment, PathState};
use std::mem::replace;

/// Part of the path over which the estimate of the speed is one formula.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stretch {
    pub(super) from: f64,
    pub(super) to: f64,
    /// Greatest ṡ² by feed, axis speeds and curvature.
    pub(super) cap: f64,
    /// Greatest acceleration and jerk along the tangent.
    pub(super) acceleration: f64,
    pub(super) jerk: f64,
    /// The part of the path about it over which the cap is the same.
    pub(super) level: [f64; 2],
    /// Estimate of ṡ² at both ends.
    pub(super) w: [f64; 2],
    /// Duration of a cell within, and at the end at most, s.
    pub(super) tick: f64,
    pub(super) last_tick: f64,
}

/// What the axes allow at a point of the path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rates {
    pub(super) fast: f64,
    pub(super) cap: f64,
    pub(super) acceleration: f64,
    pub(super) jerk: f64,
}

impl Rates {
    pub(super) fn at<const N: usize>(slope: &Slope<N>, limits: &Limits<N>, feed: f64) -> Self {
        let mut r = Rates {
            fast: feed * feed,
            cap: f64::INFINITY,
            acceleration: f64::INFINITY,
            jerk: f64::INFINITY,
        };
        for i in 0..N {
            let (d1, d2, d3) = (slope.d1[i].abs(), slope.d2[i].abs(), slope.d3[i].abs());
            let v = limits.velocity[i] / d1;
            r.fast = r.fast.min(v * v);
            let bend = match d3 > 0.0 {
                true => libm::cbrt(limits.jerk[i] / d3),
                false => f64::INFINITY,
            };
            r.cap = r.cap.min(limits.acceleration[i] / d2).min(bend * bend);
            r.acceleration = r.acceleration.min(limits.acceleration[i] / d1);
            r.jerk = r.jerk.min(limits.jerk[i] / d1);
        }
        r.cap = r.cap.min(r.fast);
        r
    }

    pub(super) fn least(self, other: Rates) -> Rates {
        Rates {
            fast: self.fast.min(other.fast),
            cap: self.cap.min(other.cap),
            acceleration: self.acceleration.min(other.acceleration),
            jerk: self.jerk.min(other.jerk),
        }
    }
}

impl Stretch {
    /// Time in which an axis builds up the acceleration that it comes to there where ṡ² is `top` at most;
    /// no less than a part of the time that it accelerates for: what a quicker ramp would save does
    /// not show, and what it would take in cells has no bound.
    pub(super) fn ramp(&self, top: f64) -> f64 {
        let v = top.sqrt();
        let ramp = (self.acceleration / self.jerk).min((v / self.jerk).sqrt());
        ramp.max(QUICKEST * v / self.acceleration)
    }

    /// What is travelled from rest in a first cell of that duration.
    fn tip(&self, duration: f64) -> f64 {
        let jerk = self.jerk.min(self.acceleration / duration);
        (jerk * duration * duration * duration / 6.0).max(SHORTEST)
    }

    /// Estimate of ṡ² at the distance `s`.
    pub(super) fn estimate(&self, s: f64) -> f64 {
        let up = self.climb(self.w[0], (s - self.from).max(0.0));
        let down = self.climb(self.w[1], (self.to - s).max(0.0));
        up.min(down).min(self.cap)
    }

    /// ṡ² a distance `s` after it was `w`, at most: under constant jerk ṡ^(3/2) goes in proportion
    /// to the distance (from rest, s = j t³/6 and ṡ = j t²/2), from ṡ = a²/2j on ṡ² does.
    pub(super) fn climb(&self, w: f64, s: f64) -> f64 {
        let knee = self.acceleration * self.acceleration / (2.0 * self.jerk);
        let rate = (THREE_HALVES * self.jerk).sqrt();
        let v = w.sqrt();
        let to_knee = (knee * knee.sqrt() - v * v.sqrt()) / rate;
        if s < to_knee {
            let x = v * v.sqrt() + rate * s;
            x * libm::cbrt(x)
        } else {
            w.max(knee * knee) + 2.0 * self.acceleration * (s - to_knee.max(0.0))
        }
    }
}

/// Part of the time in which a speed is reached that is resolved, as that of a ramp, at least.
const QUICKEST: f64 = 0.1;

/// Ramps of the acceleration are cut into this many cells.
pub(super) const CELLS_PER_RAMP: f64 = 10.0;

/// Cells shorter than this would be nothing but rounding, mm.
pub(super) const SHORTEST: f64 = 1e-9;

/// By how much of the time up to them cells may be longer than later ones.
pub(super) const FINER: f64 = 0.4;

/// Greatest turn of the tangent within a cell, rad.
pub(super) const CELL_TURN: f64 = 0.1;
/// 9/2: from rest under constant jerk s = j t³/6 and ṡ = j t²/2, so that ṡ^(3/2) = √(9j/2) s.
const THREE_HALVES: f64 = 4.5;
/// A part of a curve that lacks this share of itself to the end goes to the end.
const NEARLY: f64 = 0.1;
/// Caps that differ by less, as a part, are one level.
const LEVEL: f64 = 1e-3;
/// A cell lasts no longer than this by the one before.
const LONGER: f64 = 1.5;
/// Ramps of the acceleration, at the cap's speed, that a long cell keeps from where the cap changes …
const CLEAR: f64 = 3.0;
/// … and the part of the cap that ṡ² has to be at for one.
const AT_CAP: f64 = 0.999;
/// In the last three cells time to the end goes 3, 2, 1, so that the distance goes 27, 8, 1; they begin where
/// no more than that is left, with room for rounding.
const LANDING: f64 = 27.0;
const SPARE: f64 = 1.01;
/// Nodes of the last three cells are this far apart, by the last cell, or left out.
const APART: f64 = 0.2;
/// What is left of a stretch is one cell if it is no longer than this by the cell.
const WITH_LAST: f64 = 1.5;
/// The solver needs three cells; four leave one between the first and the last two.
const FEWEST_NODES: usize = 5;

impl<const N: usize> Window<N> {
    /// Estimates the speed along the stretch, for the grid and the first guess only.
    pub(super) fn survey(
        &mut self,
        path_segments: &[PathSegment<N>],
        limits: &Limits<N>,
        departure: PathState,
        end: f64,
    ) {
        self.stretches.clear();
        for path_segment in path_segments {
            let length = path_segment.curve.length();
            let (from, to) = (
                (departure.distance - path_segment.start).max(0.0),
                (end - path_segment.start).min(length),
            );
            if from >= to {
                continue;
            }
            let straight = path_segment.direction().is_some();
            let limits = path_segment.limits(limits);
            let speed = |s: f64| asked(&self.faster, path_segment, path_segment.start + s);
            let mut before = Rates::at(&path_segment.slope(from), limits, speed(from));
            let mut s0 = from;
            let parts = match straight {
                true => 1.0,
                false => path_segment.curve.parts(CELL_TURN),
            };
            let mut part = path_segment.curve.parts_begun(from, parts);
            while s0 < to {
                let next = if part < parts {
                    path_segment.curve.parts_end(part, parts)
                } else {
                    to
                };
                part += 1.0;
                if next <= s0 {
                    continue;
                }
                // A part that is nearly all there is is all there is.
                let s1 = if next < to - NEARLY * (next - s0) {
                    next
                } else {
                    to
                };
                let after = if straight && self.faster.is_empty() {
                    before
                } else {
                    Rates::at(&path_segment.slope(s1), limits, speed(s1))
                };
                let rates = before.least(after);
                self.stretches.push(Stretch {
                    from: path_segment.start + s0,
                    to: path_segment.start + s1,
                    cap: rates.cap,
                    acceleration: rates.acceleration,
                    jerk: rates.jerk,
                    level: [path_segment.start + s0, path_segment.start + s1],
                    w: [rates.cap; 2],
                    tick: 0.0,
                    last_tick: f64::INFINITY,
                });
                before = after;
                s0 = s1;
            }
        }
        let level = |a: f64, b: f64| (a - b).abs() <= LEVEL * b;
        for k in 1..self.stretches.len() {
            if level(self.stretches[k - 1].cap, self.stretches[k].cap) {
                self.stretches[k].level[0] = self.stretches[k - 1].level[0];
            }
        }
        for k in (1..self.stretches.len()).rev() {
            if level(self.stretches[k - 1].cap, self.stretches[k].cap) {
                self.stretches[k - 1].level[1] = self.stretches[k].level[1];
            }
        }
        let mut w = departure.speed * departure.speed;
        for s in &mut self.stretches {
            s.w[0] = s.w[0].min(w);
            w = s.climb(w, s.to - s.from).min(s.cap);
            s.w[1] = w;
        }
        let mut w = 0.0;
        for s in self.stretches.iter_mut().rev() {
            s.w[1] = s.w[1].min(w);
            w = s.climb(s.w[1], s.to - s.from).min(s.w[0]);
            s.w[0] = w;
        }
        let mut next = f64::INFINITY;
        for s in self.stretches.iter_mut().rev() {
            let middle = s.estimate(0.5 * (s.from + s.to));
            let top = s.w[0].max(s.w[1]).max(middle);
            s.tick = s.ramp(top) / CELLS_PER_RAMP;
            s.last_tick = next;
            let duration = 2.0 * (s.to - s.from) / (s.w[0].sqrt() + s.w[1].sqrt());
            next = s.tick.min(next + FINER * duration);
        }
    }

    /// Lays the nodes: about equal times apart, by the estimate. False where they are more than so many,
    /// and those behind are missing.
    pub(super) fn cut(&mut self, departure: PathState, most: usize) -> bool {
        self.nodes.clear();
        self.estimate.clear();
        let mut s = departure.distance;
        self.nodes.push(s);
        self.estimate.push(departure.speed * departure.speed);
        for &(next, w, _) in &self.kept {
            s = next;
            self.nodes.push(s);
            self.estimate.push(w);
        }
        let last = self.stretches.len() - 1;
        let mut pace = f64::INFINITY;
        for k in 0..self.stretches.len() {
            let stretch = self.stretches[k];
            if stretch.to <= s && k < last {
                continue;
            }
            let tick = stretch.tick;
            let ramp = CELLS_PER_RAMP * tick;
            loop {
                if self.nodes.len() > most {
                    return false;
                }
                let remaining = stretch.to - s;
                let v = stretch.estimate(s).sqrt();
                let left = remaining / (0.5 * (v + stretch.w[1].sqrt()));
                pace = tick
                    .min(LONGER * pace)
                    .min(stretch.last_tick + FINER * left);
                // What is travelled in that time from rest, and to rest.
                let tip = stretch.tip(pace);
                let ahead = stretch.estimate(s + (v * pace).max(tip)).sqrt();
                let mut step = (0.5 * (v + ahead) * pace).max(tip);
                // Far from where the speed has to change, long cells do.
                let cruise = v * ramp;
                let [from, to] = stretch.level;
                let clear = (s - from).min(to - s - step) - CLEAR * cruise;
                if clear > 0.0 && v * v >= AT_CAP * stretch.cap {
                    step = step.max(clear.min(cruise));
                }
                if k == last && remaining <= LANDING * tip * SPARE {
                    // t³ apart from the end: 27, 8, 1.
                    for cubes in [8.0, 1.0] {
                        let next = stretch.to - cubes * tip;
                        if next > s + APART * tip {
                            self.push(next, stretch.estimate(next));
                            s = next;
                        }
                    }
                }
                if remaining <= WITH_LAST * step || k == last && remaining <= LANDING * tip * SPARE
                {
                    self.push(stretch.to, stretch.w[1]);
                    s = stretch.to;
                    break;
                }
                if remaining < 2.0 * step && k != last {
                    step = 0.5 * remaining;
                }
                s += step;
                self.push(s, stretch.estimate(s));
            }
        }
        self.lead_over();
        while self.nodes.len() < FEWEST_NODES {
            let (i, _) = (0..self.nodes.len() - 1)
                .map(|i| (i, self.nodes[i + 1] - self.nodes[i]))
                .fold((0, 0.0), |best, x| if x.1 > best.1 { x } else { best });
            let middle = 0.5 * (self.nodes[i] + self.nodes[i + 1]);
            let w = 0.5 * (self.estimate[i] + self.estimate[i + 1]);
            self.nodes.insert(i + 1, middle);
            self.estimate.insert(i + 1, w);
        }
        self.nodes.len() <= most
    }

    /// Leads the estimate over from what is kept of the last solution to the survey's, within what is
    /// travelled in two ramps of the acceleration.
    pub(super) fn lead_over(&mut self) {
        let Some(&(from, w, _)) = self.kept.last() else {
            return;
        };
        let Some(stretch) = self.stretches.iter().find(|s| s.to >= from) else {
            return;
        };
        let above = w / stretch.estimate(from) - 1.0;
        let distance = 2.0 * w.sqrt() * stretch.ramp(stretch.cap);
        if !above.is_finite() {
            return;
        }
        let first = self.kept.len() + 1;
        for (s, estimate) in self.nodes[first..].iter().zip(&mut self.estimate[first..]) {
            let left = 1.0 - (s - from) / distance;
            if left.is_nan() || left <= 0.0 {
                break;
            }
            *estimate *= 1.0 + above * left * left;
        }
    }

    /// Takes the geometry and the limits of every cell.
    pub(super) fn fill(&mut self, path_segments: &[PathSegment<N>], limits: &Limits<N>) {
        self.cells.clear();
        self.path_segment_of.clear();
        let mut index = 0;
        let (mut before, mut steepest) = (f64::INFINITY, f64::INFINITY);
        for ends in self.nodes.windows(2) {
            // By the middle: the ends may be off by rounding.
            let middle = 0.5 * (ends[0] + ends[1]);
            while middle >= path_segments[index].start + path_segments[index].curve.length()
                && index + 1 < path_segments.len()
            {
                index += 1;
            }
            let path_segment = &path_segments[index];
            let limits = path_segment.limits(limits);
            let slopes: [Slope<N>; 2] =
                [ends[0], ends[1]].map(|s| path_segment.slope(s - path_segment.start));
            let [first, second] =
                slopes.map(|slope| Rates::at(&slope, limits, f64::INFINITY).fast.sqrt());
            let [begin, within] = [ends[0], middle].map(|s| asked(&self.faster, path_segment, s));
            self.cells.push(Cell {
                length: ends[1] - ends[0],
                ends: slopes,
                speed: [
                    SPEED_SHARE * before.min(first).min(begin),
                    SPEED_SHARE * first.min(second).min(within),
                ],
                share: match (path_segment.clock, path_segment.curve.direction()) {
                    // The node belongs to the cell before, too.
                    (Some(clock), _) => {
                        let most = clock.acceleration[0];
                        let before = replace(&mut steepest, most);
                        [(before / most).min(1.0), 1.0]
                    }
                    (None, Some(_)) => [1.0; 2],
                    (None, None) => [1.0 - CURVE_SHARE; 2],
                },
                limits: *limits,
            });
            self.path_segment_of.push(index);
            before = second.min(asked(&self.faster, path_segment, ends[1]));
        }
        for (cell, &(_, _, share)) in self.cells.iter_mut().zip(&self.kept) {
            cell.share = share;
        }
    }

    pub(super) fn push(&mut self, s: f64, w: f64) {
        self.nodes.push(s);
        self.estimate.push(w);
    }
}
