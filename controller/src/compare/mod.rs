//! Two motions along about the same path, place by place: where the one takes longer, where its tool is elsewhere,
//! and where its axes follow otherwise.
//!
//! The one is followed through the other's path (`alignment`), so that it does not matter when either was
//! where. Of a recorded run and the simulation of its program, the difference of following errors is what the model of
//! the machine is wrong by.

mod alignment;
mod motion;

pub use motion::{Motion, NotATrace};

use crate::observe::record::{Greatest, Place};
use alignment::Cursor;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;

/// A setpoint that is further from the other path than that, mm, is on another one: no rounding and no shaper
/// leads so far off.
const ELSEWHERE: f64 = 10.0;

/// As many of the worst lines are told a person, of those that differ in what is told.
const TOLD: usize = 10;

/// Two motions side by side. Differences are the second less the first; places are those of the first.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// What the first is of.
    pub first: String,
    /// What the second is of.
    pub second: String,
    /// From the first to the last motion, s, of each.
    pub duration_s: [f64; 2],
    /// How much longer the second takes, s.
    pub difference_s: f64,
    /// Greatest distance of the first's setpoints from the second's path, mm.
    pub max_path_difference_mm: f64,
    /// Where that was.
    pub max_path_difference_at: Place,
    /// Where the first is more than 10 mm off the second's path for the first time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub off_path_at: Option<Place>,
    /// How far the second's path goes on behind the end of the first's, mm.
    pub beyond_mm: f64,
    /// Greatest distance of the first's tool from the way of the second's, mm.
    pub max_contour_difference_mm: f64,
    /// Where that was.
    pub max_contour_difference_at: Place,
    /// The axes that both have.
    pub axes: Vec<AxisComparison>,
    /// The lines of the first, in order.
    pub lines: Vec<LineComparison>,
}

/// Nothing of two motions can be compared.
#[derive(Debug, thiserror::Error)]
#[error(
    "no axis is in both: {} has {}, {} has {}; give motions of the same machine, or of machines with axes of the same name",
    first.0, first.1, second.0, second.1
)]
pub struct NoCommonAxis {
    /// What the first is of, and its axes.
    pub first: (String, String),
    /// What the second is of, and its axes.
    pub second: (String, String),
}

/// How an axis follows in both.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AxisComparison {
    /// As the machine file names it.
    pub name: String,
    /// Root mean square of setpoint less actual position over the places of the first, mm or degrees, of each.
    pub rms_following_mm: [f64; 2],
    /// Root mean square of the difference of both.
    pub rms_difference_mm: f64,
    /// Greatest difference.
    pub max_difference_mm: f64,
    /// Where that was.
    pub max_difference_at: Place,
}

/// A line of the program in both.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LineComparison {
    /// Of the first; 0 where none.
    pub line: u32,
    /// How long the path of it takes, s, of each.
    pub time_s: [f64; 2],
    /// How much longer in the second, s.
    pub difference_s: f64,
    /// Greatest distance of the first's tool from the way of the second's, mm.
    pub max_contour_difference_mm: f64,
    /// When that was in the first, s.
    pub at_s: f64,
}

/// What is summed up of an axis.
#[derive(Clone, Default)]
struct OfAxis {
    squares: [f64; 3],
    greatest: Greatest,
}

/// What is summed up of a line.
#[derive(Clone, Default)]
struct OfLine {
    time: [f64; 2],
    contour: Greatest,
}

impl Comparison {
    /// Of two motions, by the axes that both have.
    ///
    /// # Errors
    /// They have none.
    pub fn of(first: &Motion, second: &Motion) -> Result<Self, NoCommonAxis> {
        let mut axes = first.axes.clone();
        axes.retain(|name| second.axes.contains(name));
        if axes.is_empty() {
            let told = |it: &Motion| (it.name.clone(), it.axes.join(", "));
            return Err(NoCommonAxis {
                first: told(first),
                second: told(second),
            });
        }
        let [one, other] = [first, second].map(|it| it.with_axes(&axes));
        let mut by_axis = vec![OfAxis::default(); axes.len()];
        let mut lines: BTreeMap<u32, OfLine> = BTreeMap::new();
        let (mut path, mut contour) = (Greatest::default(), Greatest::default());
        let mut off_path_at = None;
        let mut cursor = Cursor::BEGIN;
        let mut before = [one.time(0), cursor.time(&other)];
        let mut along = 0.0;
        for (station, it) in one.stations.iter().enumerate() {
            let off = cursor.follow(&other, &it.set, it.along - along);
            along = it.along;
            let now = [one.time(station), cursor.time(&other)];
            let place = Place {
                time: now[0],
                line: it.line,
            };
            let mut lag = 0.0_f64;
            for (axis, of) in by_axis.iter_mut().enumerate() {
                let following = [it.set[axis] - it.act[axis], cursor.following(&other, axis)];
                let difference = following[1] - following[0];
                let squares = [following[0], following[1], difference].map(|it| it * it);
                for (sum, square) in of.squares.iter_mut().zip(squares) {
                    *sum += square;
                }
                of.greatest.look(difference.abs(), place);
                lag = following.iter().fold(lag, |most, it| most.max(it.abs()));
            }
            let away = cursor.beside_tool(&other, &it.tool, 2.0 * lag + REACH);
            path.look(off, place);
            if off > ELSEWHERE {
                off_path_at.get_or_insert(place);
            }
            contour.look(away, place);
            let line = lines.entry(it.line).or_default();
            for (sum, (now, before)) in line.time.iter_mut().zip(now.iter().zip(before)) {
                *sum += now - before;
            }
            line.contour.look(away, place);
            before = now;
        }
        let duration = [&one, &other].map(|it| it.time(it.stations.len() - 1) - it.time(0));
        let rows = one.stations.len() as f64;
        let end = other.stations.last().map_or(0.0, |it| it.along);
        Ok(Self {
            first: one.name.clone(),
            second: other.name.clone(),
            duration_s: duration,
            difference_s: duration[1] - duration[0],
            max_path_difference_mm: path.value,
            max_path_difference_at: path.at,
            off_path_at,
            beyond_mm: end - cursor.along(&other),
            max_contour_difference_mm: contour.value,
            max_contour_difference_at: contour.at,
            axes: (axes.into_iter().zip(by_axis))
                .map(|(name, of)| of.result(name, rows))
                .collect(),
            lines: lines
                .into_iter()
                .map(|(line, of)| of.result(line))
                .collect(),
        })
    }
}

/// The other's tool is looked for so much further than both lag, mm.
const REACH: f64 = 0.5;

impl OfAxis {
    fn result(self, name: String, rows: f64) -> AxisComparison {
        let [first, second, difference] = self.squares.map(|sum| (sum / rows).sqrt());
        AxisComparison {
            name,
            rms_following_mm: [first, second],
            rms_difference_mm: difference,
            max_difference_mm: self.greatest.value,
            max_difference_at: self.greatest.at,
        }
    }
}

impl OfLine {
    fn result(self, line: u32) -> LineComparison {
        LineComparison {
            line,
            time_s: self.time,
            difference_s: self.time[1] - self.time[0],
            max_contour_difference_mm: self.contour.value,
            at_s: self.contour.at.time,
        }
    }
}

/// As a person reads it.
impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "first              {}", self.first)?;
        writeln!(f, "second             {}", self.second)?;
        let [first, second] = self.duration_s;
        writeln!(
            f,
            "motion             {first:.3} s and {second:.3} s, difference {:+.3} s",
            self.difference_s
        )?;
        writeln!(
            f,
            "path               setpoints differ by up to {:.4} mm in {}",
            self.max_path_difference_mm, self.max_path_difference_at
        )?;
        if let Some(place) = self.off_path_at {
            writeln!(
                f,
                "OTHER PATH         from {place} on the first is more than {ELSEWHERE} mm off the second's path: \
                 nothing counts from there on; give two motions along one path"
            )?;
        }
        if self.beyond_mm > ELSEWHERE {
            writeln!(
                f,
                "OTHER END          the second's path goes on for {:.3} mm behind the first's end",
                self.beyond_mm
            )?;
        }
        writeln!(
            f,
            "contour            tools differ by up to {:.4} mm in {}",
            self.max_contour_difference_mm, self.max_contour_difference_at
        )?;
        for axis in &self.axes {
            let [first, second] = axis.rms_following_mm;
            writeln!(
                f,
                "axis {:<13} lags by {first:.4} and {second:.4} rms; they differ by {:.4} rms, {:.4} in {}",
                axis.name, axis.rms_difference_mm, axis.max_difference_mm, axis.max_difference_at
            )?;
        }
        let mut lines: Vec<_> = self.lines.iter().collect();
        lines.sort_by(|one, other| {
            let by = |it: &LineComparison| it.max_contour_difference_mm;
            by(other).total_cmp(&by(one))
        });
        let tells = |it: &&&LineComparison| it.max_contour_difference_mm >= 1e-4;
        for it in lines.iter().filter(tells).take(TOLD) {
            writeln!(
                f,
                "worst contour      line {}: {:.4} mm at {:.3} s",
                it.line, it.max_contour_difference_mm, it.at_s
            )?;
        }
        lines.sort_by(|one, other| other.difference_s.abs().total_cmp(&one.difference_s.abs()));
        let tells = |it: &&&LineComparison| it.difference_s.abs() >= 1e-3;
        for it in lines.iter().filter(tells).take(TOLD) {
            let [first, second] = it.time_s;
            writeln!(
                f,
                "worst time         line {}: {first:.3} s and {second:.3} s, difference {:+.3} s",
                it.line, it.difference_s
            )?;
        }
        Ok(())
    }
}
