//! Where one motion is while another is at a place of its path.
//!
//! A cursor goes along the other's setpoints and never back: to the place ahead that is nearest to the setpoint,
//! and among places that are as near to the one that is as far along. So a path that crosses itself, or goes
//! back on itself, is followed in its order.

use super::motion::{Motion, Station, apart};

/// A place that lies so far ahead is found without a search, mm.
const AHEAD: f64 = 0.5;

/// Where nothing near is found there, as far ahead as this, mm, once every [`AHEAD`].
const FAR: f64 = 100.0;

/// A setpoint further from the other path than that, mm, is off it.
const OFF: f64 = 0.5;

/// What a difference in length counts for beside a distance.
const BY_LENGTH: f64 = 0.05;

/// A place between two stations of a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cursor {
    station: usize,
    /// Of the way to the next one, below 1.
    part: f64,
}

impl Cursor {
    /// At the beginning.
    pub(super) const BEGIN: Self = Self {
        station: 0,
        part: 0.0,
    };

    /// The two stations that it lies between.
    fn between(self, motion: &Motion) -> [&Station; 2] {
        let next = (self.station + 1).min(motion.stations.len() - 1);
        [self.station, next].map(|at| &motion.stations[at])
    }

    /// Length of the path up to here.
    pub(super) fn along(self, motion: &Motion) -> f64 {
        let [one, next] = self.between(motion);
        one.along + self.part * (next.along - one.along)
    }

    /// When the motion is done with it, s.
    pub(super) fn time(self, motion: &Motion) -> f64 {
        let [one, next] = self.between(motion);
        if self.part > 0.0 {
            one.left + self.part * (next.arrived - one.left)
        } else {
            motion.time(self.station)
        }
    }

    /// Setpoint less actual position of an axis.
    pub(super) fn following(self, motion: &Motion, axis: usize) -> f64 {
        let [one, next] = (self.between(motion)).map(|it| it.set[axis] - it.act[axis]);
        one + self.part * (next - one)
    }

    /// Goes on to where the other motion is that came `step` further, to `set`; how far that is away.
    pub(super) fn follow(&mut self, motion: &Motion, set: &[f64], step: f64) -> f64 {
        let reach = 4.0 * step + AHEAD;
        let (mut place, mut away) = self.nearest(motion, set, step, reach);
        if away > OFF {
            let (far, nearer) = self.nearest(motion, set, step, FAR);
            if nearer < 0.5 * away {
                (place, away) = (far, nearer);
            }
        }
        *self = place;
        away
    }

    /// The best place from here on, and its distance.
    fn nearest(self, motion: &Motion, set: &[f64], step: f64, reach: f64) -> (Self, f64) {
        let from = self.along(motion);
        let (mut best, mut cost, mut away) = (self, f64::INFINITY, f64::INFINITY);
        let mut least = self.part;
        for station in self.station..motion.stations.len() {
            let at = Self {
                station,
                part: least,
            };
            if at.along(motion) > from + reach {
                break;
            }
            least = 0.0;
            let [one, next] = at.between(motion);
            let part = foot(&one.set, &next.set, set).clamp(at.part, 1.0);
            let is_next = part >= 1.0 && station + 1 < motion.stations.len();
            let place = match is_next {
                true => Self {
                    station: station + 1,
                    part: 0.0,
                },
                false => Self { station, part },
            };
            let distance = apart(&between(&one.set, &next.set, part), set);
            let lengthwise = (place.along(motion) - from - step).abs();
            let costs = distance + BY_LENGTH * lengthwise;
            if costs < cost {
                (best, cost, away) = (place, costs, distance);
            }
        }
        (best, away)
    }

    /// Distance of a position from the tool's path within `reach` of the setpoints' path around here.
    pub(super) fn beside_tool(self, motion: &Motion, position: &[f64], reach: f64) -> f64 {
        let stations = &motion.stations;
        let here = self.along(motion);
        let before = stations[..=self.station].iter().rev();
        let before = before.take_while(|it| it.along >= here - reach).count();
        let behind = stations[self.station..].iter();
        let behind = behind.take_while(|it| it.along <= here + reach).count();
        let first = (self.station + 1).saturating_sub(before + 1);
        let last = (self.station + behind).min(stations.len() - 1);
        let mut nearest = (apart(&stations[first].tool, position), first);
        for station in first..last {
            let [one, next] = [station, station + 1].map(|at| &stations[at].tool);
            let part = foot(one, next, position).clamp(0.0, 1.0);
            let away = apart(&between(one, next, part), position);
            if away < nearest.0 {
                nearest = (away, station);
            }
        }
        let around = nearest.1.saturating_sub(1)..(nearest.1 + 2).min(last);
        let curves = around.map(|station| from_curve(stations, station, position));
        curves.fold(nearest.0, f64::min)
    }
}

/// Distance of a position from the cubic through a station, the next one and those around them: straight lines
/// between samples would lie beside an arc.
fn from_curve(stations: &[Station], station: usize, position: &[f64]) -> f64 {
    let last = stations.len() - 1;
    let tool = |at: usize| &stations[at.min(last)].tool;
    let around = [
        tool(station.saturating_sub(1)),
        tool(station),
        tool(station + 1),
        tool(station + 2),
    ];
    let away = |t: f64| {
        let weights = [
            t * (t * (2.0 - t) - 1.0),
            t * t * (3.0 * t - 5.0) + 2.0,
            t * (t * (4.0 - 3.0 * t) + 1.0),
            t * t * (t - 1.0),
        ];
        let squares = position.iter().enumerate().map(|(axis, here)| {
            let terms = weights.iter().zip(around).map(|(w, at)| 0.5 * w * at[axis]);
            let difference = terms.sum::<f64>() - here;
            difference * difference
        });
        squares.sum::<f64>().sqrt()
    };
    let (mut from, mut to) = (0.0, 1.0);
    for _ in 0..24 {
        let third = (to - from) / 3.0;
        if away(from + third) < away(to - third) {
            to -= third;
        } else {
            from += third;
        }
    }
    away(0.5 * (from + to))
}

/// Where on the way from one position to another a third is nearest to it, in parts of that way.
fn foot(one: &[f64], other: &[f64], position: &[f64]) -> f64 {
    let (mut onto, mut length) = (0.0, 0.0);
    for ((from, to), here) in one.iter().zip(other).zip(position) {
        onto += (here - from) * (to - from);
        length += (to - from) * (to - from);
    }
    if length > 0.0 { onto / length } else { 0.0 }
}

fn between(one: &[f64], other: &[f64], part: f64) -> Vec<f64> {
    let pairs = one.iter().zip(other);
    pairs.map(|(from, to)| from + part * (to - from)).collect()
}
