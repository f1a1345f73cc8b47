//! `backlash` and `lead_error` of an axis: what its setpoints are corrected by, so that its carriage is where the program has it.
//!
//! # What is solved
//!
//! Where the motor's encoder closes the position loop, what lies between motor and carriage is open: a screw whose lead is off
//! takes the carriage to q + e(q) where its drive is sent to q, and one with backlash b leaves it b/2 behind, on the flank that
//! pushes. Both can be measured, with a laser or a dial gauge, and repeat. So a drive is sent
//!
//! s = q − e(q) + β,
//!
//! with β = b/2 while the axis goes forward and −b/2 while it goes back. (That e is taken at q and not at s is off by e·e′, which is
//! nothing.)
//!
//! # How
//!
//! *The lead error* is a curve through the points of the table, the natural cubic spline: it has a third derivative, which is
//! bounded. Beyond the ends it runs out to a constant, along two pieces of the length of the last interval that take its slope to zero;
//! a natural spline, which has no curvature at its ends, goes on into them with its first two derivatives. Straight lines
//! between the points would be a step of the velocity at each of them; a constant right behind the last one, too.
//!
//! *β* changes along a profile of bounded jerk, which begins as the axis turns round (`control/axis/compensation.rs`). A backlash is so
//! short that the jerk tells how long that takes, (32 b / j)^⅓: so it has a quarter of it, [`SHARE`], and of velocity and acceleration
//! only what it comes to with that. A tenth was tried: it takes a third longer, and leaves spikes half as high again at the reversals of
//! circles.
//!
//! # Why the limits hold
//!
//! With e₁, e₂ and e₃ the greatest slope, curvature and third derivative of the curve, and the share of β, what a drive is
//! sent keeps V, A and J where the plan keeps V′, A′ and J′ with
//!
//! - V′ (1 + e₁) + v ≤ V,
//! - A′ (1 + e₁) + e₂ V′² + a ≤ A,
//! - J′ (1 + e₁) + 3 e₂ V′ A′ + e₃ V′³ + j ≤ J,
//!
//! since s̈ = q̈ (1 − e′) − e″ q̇² and s⃛ = q⃛ (1 − e′) − 3 e″ q̇ q̈ − e‴ q̇³. Whatever plans the axis is given V′, A′ and J′, found here
//! once; the drive, and what looks at what it is sent, has V, A and J. A table so rough that less than half of a limit is left
//! is refused: it has noise, or points too near to each other, and no axis should be slow for that.

use super::AxisLimits;
use std::ops::Range;
use syncline_strict_toml::{Log, Table};
use syncline_trajectory::limits::Limits;
use syncline_trajectory::profile::State;
use syncline_trajectory::state_to_state::{self, Problem};

/// The part of each limit of an axis that taking up its backlash has at the most.
const SHARE: f64 = 0.25;

/// The least part of a limit that compensation leaves the plan.
const LEAST: f64 = 0.5;

/// A steeper lead error is none of a screw.
const STEEPEST: f64 = 0.1;

/// What the setpoints of an axis are corrected by. Of A, B and C every mm is a degree.
#[derive(Clone, Debug, PartialEq)]
pub struct Compensation {
    /// From flank to flank, mm.
    pub backlash: f64,
    /// What taking it up keeps.
    pub take_up: Limits,
    /// Where the carriage is off from where it is sent.
    pub lead_error: LeadError,
}

impl Compensation {
    /// The greatest correction, mm; no less than it is.
    #[must_use]
    pub fn greatest(&self) -> f64 {
        0.5 * self.backlash + self.lead_error.greatest()[0]
    }
}

/// A lead error over the positions of an axis, mm: twice continuously differentiable.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LeadError {
    pieces: Vec<Piece>,
}

/// A cubic from a position on.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    from: f64,
    /// Value and derivatives there.
    value: f64,
    derivatives: [f64; 3],
}

impl Piece {
    /// So far from where it begins: value, slope and curvature.
    fn at(&self, t: f64) -> [f64; 3] {
        let [d1, d2, d3] = self.derivatives;
        [
            self.value + t * (d1 + t * (d2 / 2.0 + t * d3 / 6.0)),
            d1 + t * (d2 + t * d3 / 2.0),
            d2 + t * d3,
        ]
    }

    /// The one behind it, of that length, along which the curvature changes by `d3`.
    fn next(&self, length: f64, d3: f64) -> Self {
        let [value, d1, d2] = self.at(length);
        Self {
            from: self.from + length,
            value,
            derivatives: [d1, d2, d3],
        }
    }
}

impl LeadError {
    /// Through two points or more, position and error in mm, in ascending order of position; none through fewer.
    #[must_use]
    pub fn new(points: &[(f64, f64)]) -> Self {
        let (&[first, second, ..], &[.., before, last]) = (points, points) else {
            return Self::default();
        };
        let constant = |(from, value): (f64, f64)| Piece {
            from,
            value,
            derivatives: [0.0; 3],
        };
        let curvatures = natural(points);
        let inner = points.windows(2).zip(curvatures.windows(2));
        let inner = inner.map(|(points, curvatures)| {
            let (length, rise) = (points[1].0 - points[0].0, points[1].1 - points[0].1);
            let (here, there) = (curvatures[0], curvatures[1]);
            let slope = rise / length - length * (2.0 * here + there) / 6.0;
            Piece {
                from: points[0].0,
                value: points[0].1,
                derivatives: [slope, here, (there - here) / length],
            }
        });
        let inner: Vec<Piece> = inner.collect();
        let length = second.0 - first.0;
        let slope = inner[0].derivatives[0];
        let run_in = Piece {
            derivatives: [0.0, 0.0, slope / (length * length)],
            ..constant((first.0 - 2.0 * length, first.1 - slope * length))
        };
        let mut pieces = vec![run_in, run_in.next(length, -slope / (length * length))];
        pieces.extend(inner);
        let length = last.0 - before.0;
        if let Some(end) = pieces.last() {
            let [_, slope, _] = end.at(length);
            let bend = slope / (length * length);
            let leaves = Piece {
                from: last.0,
                value: last.1,
                derivatives: [slope, 0.0, -bend],
            };
            let levels = leaves.next(length, bend);
            let rest = (last.0 + 2.0 * length, last.1 + slope * length);
            pieces.extend([leaves, levels, constant(rest)]);
        }
        Self { pieces }
    }

    /// At a position, mm: the error, mm, and its slope.
    #[must_use]
    pub fn at(&self, position: f64) -> (f64, f64) {
        let above = self.pieces.partition_point(|piece| piece.from <= position);
        match (above.checked_sub(1), self.pieces.first()) {
            (Some(piece), _) => {
                let piece = &self.pieces[piece];
                let [error, slope, _] = piece.at(position - piece.from);
                (error, slope)
            }
            (None, first) => (first.map_or(0.0, |first| first.value), 0.0),
        }
    }

    /// The greatest magnitudes of the error, mm, of its slope, its curvature, 1/mm, and its third derivative, 1/mm²; of the error no
    /// less than it is.
    #[must_use]
    pub fn greatest(&self) -> [f64; 4] {
        let mut greatest = [0.0_f64; 4];
        let ends = self.pieces.iter().skip(1).map(|piece| piece.from);
        let lengths = self.pieces.iter().zip(ends);
        for (piece, length) in lengths.map(|(piece, end)| (piece, end - piece.from)) {
            let [_, d2, d3] = piece.derivatives;
            let (begin, end) = (piece.at(0.0), piece.at(length));
            let curvature = begin[2].abs().max(end[2].abs());
            let steepest = Some(-d2 / d3).filter(|t| (0.0..length).contains(t));
            let inside = steepest.map_or(0.0, |t| piece.at(t)[1].abs());
            // A curve is off the chord by an eighth of its curvature at the most.
            let bulge = curvature * length * length / 8.0;
            for (greatest, it) in greatest.iter_mut().zip([
                begin[0].abs().max(end[0].abs()) + bulge,
                begin[1].abs().max(end[1].abs()).max(inside),
                curvature,
                d3.abs(),
            ]) {
                *greatest = greatest.max(it);
            }
        }
        greatest
    }
}

/// The curvatures of the natural spline at its points, two at the least: by elimination, as each has two neighbours.
fn natural(points: &[(f64, f64)]) -> Vec<f64> {
    let (mut factors, mut curvatures) = (vec![0.0; points.len()], vec![0.0; points.len()]);
    for (at, three) in points.windows(3).enumerate() {
        let (left, right) = (three[1].0 - three[0].0, three[2].0 - three[1].0);
        let bend = (three[2].1 - three[1].1) / right - (three[1].1 - three[0].1) / left;
        let pivot = 2.0 * (left + right) - left * factors[at];
        factors[at + 1] = right / pivot;
        curvatures[at + 1] = (6.0 * bend - left * curvatures[at]) / pivot;
    }
    for at in (1..points.len() - 1).rev() {
        curvatures[at] -= factors[at] * curvatures[at + 1];
    }
    curvatures
}

/// What an `[[axis]]` says of it.
#[derive(Clone)]
pub(super) struct CompensationTable {
    backlash: f64,
    lead_error: LeadError,
    /// By which key, and where.
    place: (&'static str, Range<usize>),
}

impl CompensationTable {
    pub(super) fn read(log: &mut Log<'_>, table: &mut Table<'_, '_>, rotary: bool) -> Option<Self> {
        let (unit, micro) = if rotary {
            ("°", "0.001°")
        } else {
            ("mm", "µm")
        };
        let allowed = format!("a number above 0, at most 1 ({unit})");
        let is_backlash = |it: f64| it > 0.0 && it <= 1.0;
        let backlash = table.number_if(log, "backlash", &allowed, is_backlash);
        let allowed = format!(
            "[[position, error], …] ({unit} and {micro}), two points or more in ascending order of position, errors of at most 1000"
        );
        let accept = |[_, error]: [f64; 2]| error.abs() <= 1e3;
        let points = table.points_if(log, "lead_error", &allowed, accept);
        let place = match (&backlash, &points) {
            (Some(backlash), _) => ("backlash", backlash.span()),
            (None, Some(points)) => ("lead_error", points.span()),
            (None, None) => return None,
        };
        let mut lead_error = LeadError::default();
        if let Some(points) = points {
            let of = |&[position, error]: &[f64; 2]| (position, error * 1e-3);
            let mm: Vec<_> = points.get_ref().iter().map(of).collect();
            lead_error = LeadError::new(&mm);
            let slope = lead_error.greatest()[1];
            let problem = if mm.len() < 2 {
                "`lead_error` of one point".to_owned()
            } else if slope > STEEPEST {
                let per = 1e3 * slope;
                format!("`lead_error` changes by {per:.0} {micro} within 1 {unit}")
            } else {
                String::new()
            };
            if !problem.is_empty() {
                let most = 1e3 * STEEPEST;
                log.report(
                    points.span(),
                    format!("{}: {problem}", table.title),
                    format!(
                        "allowed: {allowed}, that change by up to {most} {micro} within 1 {unit}"
                    ),
                );
                lead_error = LeadError::default();
            }
        }
        Some(Self {
            backlash: backlash.map_or(0.0, |it| it.into_inner()),
            lead_error,
            place,
        })
    }

    /// What is compensated on an axis of these limits, and what that leaves the plan, and has its drives be sent. `units` are those
    /// of the limits.
    pub(super) fn join(
        &self,
        log: &mut Log<'_>,
        title: &str,
        limits: &AxisLimits,
        units: [&str; 3],
    ) -> (Compensation, [AxisLimits; 2]) {
        let all = [limits.velocity, limits.acceleration, limits.jerk];
        let [velocity, acceleration, jerk] = self.take_up(limits);
        let [_, e1, e2, e3] = self.lead_error.greatest();
        let v = (limits.velocity - velocity) / (1.0 + e1);
        let a = (limits.acceleration - acceleration - e2 * v * v) / (1.0 + e1);
        let j = (limits.jerk - jerk - 3.0 * e2 * v * a - e3 * v * v * v) / (1.0 + e1);
        let mut each = [v, a, j].into_iter().zip(all).zip(units);
        if let Some(((left, limit), unit)) = each.find(|((left, limit), _)| *left < LEAST * limit) {
            let (left, unit) = (left.max(0.0), unit.trim_matches(['(', ')']));
            log.report(
                self.place.1.clone(),
                format!("{title}: `lead_error` leaves the plan {left:.3} of {limit} {unit}"),
                "allowed: what leaves half of each limit: fewer and smoother points, or a lower `max_velocity`",
            );
        }
        let compensation = Compensation {
            backlash: self.backlash,
            take_up: Limits::symmetric(velocity, acceleration, jerk),
            lead_error: self.lead_error.clone(),
        };
        let planned = AxisLimits {
            velocity: v,
            acceleration: a,
            jerk: j,
            ..*limits
        };
        let (least, most) = limits.position;
        let beyond = compensation.greatest();
        let sent = AxisLimits {
            position: (least - beyond, most + beyond),
            ..*limits
        };
        (compensation, [planned, sent])
    }

    /// Velocity, acceleration and jerk with which its backlash is taken up, of an axis of these limits.
    fn take_up(&self, limits: &AxisLimits) -> [f64; 3] {
        let [velocity, acceleration, jerk] =
            [limits.velocity, limits.acceleration, limits.jerk].map(|limit| SHARE * limit);
        let (from, to) = (State::at_rest(0.0), State::at_rest(self.backlash));
        let shares = Limits::symmetric(velocity, acceleration, jerk);
        let plan = state_to_state::plan(&Problem::new(from, to, shares), 0.0);
        plan.map_or([velocity, acceleration, jerk], |plan| {
            let most = plan.extrema();
            [most.velocity.max, most.acceleration.max, most.jerk.max]
        })
    }

    /// Reports that an axis like this cannot be compensated.
    pub(super) fn refuse(&self, log: &mut Log<'_>, title: &str, what: &str, help: &str) {
        let (key, span) = &self.place;
        log.report(
            span.clone(),
            format!("{title}: `{key}` of an axis {what}"),
            help,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Positions in ascending order, errors in µm.
    fn points() -> impl Strategy<Value = Vec<(f64, f64)>> {
        let rows = prop::collection::vec((1.0..80.0_f64, -40.0..40.0_f64), 2..12);
        (rows, -500.0..500.0_f64).prop_map(|(rows, mut at)| {
            let row = |(length, error): (f64, f64)| {
                at += length;
                (at, error * 1e-3)
            };
            rows.into_iter().map(row).collect()
        })
    }

    proptest! {
        /// It goes through its points, has two derivatives everywhere and a third that is bounded, and is constant far beyond its ends.
        #[test]
        fn it_is_smooth(points in points()) {
            let curve = LeadError::new(&points);
            for &(at, error) in &points {
                prop_assert!((curve.at(at).0 - error).abs() < 1e-9);
            }
            let joints = curve.pieces.windows(2);
            for (before, behind) in joints.map(|pair| (pair[0], pair[1])) {
                let end = before.at(behind.from - before.from);
                for (end, begin) in end.into_iter().zip(behind.at(0.0)) {
                    prop_assert!((end - begin).abs() < 1e-9, "{before:?} {behind:?}");
                }
            }
            let (first, last) = (points[0].0, points[points.len() - 1].0);
            let ends = curve.pieces[0].from..=curve.pieces[curve.pieces.len() - 1].from;
            prop_assert!(*ends.start() < first && *ends.end() > last);
            for (end, beyond) in [(*ends.start(), -1e5), (*ends.end(), 1e5)] {
                prop_assert!((curve.at(end).0 - curve.at(end + beyond).0).abs() < 1e-9);
                prop_assert!(curve.at(end + beyond).1 == 0.0);
            }
        }

        /// The bounds are those of what it is anywhere; that of the error may be wider.
        #[test]
        fn its_bounds_hold_and_are_met(points in points()) {
            let curve = LeadError::new(&points);
            let bounds = curve.greatest();
            let mut met = [0.0_f64; 4];
            for pair in curve.pieces.windows(2) {
                let length = pair[1].from - pair[0].from;
                for step in 0..=200 {
                    let t = length * f64::from(step) / 200.0;
                    let [error, slope, curvature] = pair[0].at(t);
                    let third = pair[0].derivatives[2];
                    for (met, it) in met.iter_mut().zip([error, slope, curvature, third]) {
                        *met = met.max(it.abs());
                    }
                }
            }
            for (order, (met, bound)) in met.into_iter().zip(bounds).enumerate() {
                prop_assert!(met <= bound + 1e-12, "{order}: {met} > {bound}");
                prop_assert!(order == 0 || met >= 0.999 * bound, "{order}: {met} of {bound}");
            }
        }
    }

    #[test]
    fn no_points_are_no_error() {
        assert_eq!(LeadError::new(&[]).at(3.0), (0.0, 0.0));
        assert_eq!(LeadError::default().greatest(), [0.0; 4]);
    }
}
