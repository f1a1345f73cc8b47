//! The circular test: how round the tool goes where a program has it go round full circles, by the figures of ISO 230-4.
//!
//! A full circle is one arc, or several that follow each other on the same circle, in one direction, until they have come round; helices
//! and spirals are none. Each turn is judged by itself (`turn`), so that of three the middle one is at an even feed.
//!
//! What counts is where the tool is, by its own angle about the programmed centre. It lags behind the setpoint, so that it is not on the
//! circle yet as the setpoint begins it, and still is as the setpoint has left it: it counts from where it goes along the circle rather
//! than across until it leaves it in the same way, or has come to where the setpoint left. What a rounding at either end cuts off is in
//! it, as it is in the part.

mod turn;

use super::Observed;
use super::kept::Kept;
use super::record::{Place, Violation};
use crate::machine::{Machine, Position};
use serde::Serialize;
use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::fmt;
use syncline_trajectory::path::curve::Circle;
use turn::{MARGIN, Sample, Turn};

/// Circles are the same whose centres and radii differ by less, mm.
const SAME: f64 = 1e-3;
/// Arcs have come round that lack no more, rad: their ends are rounded to what a program writes.
const CLOSED: f64 = 0.01;
/// So long the tool may go on behind the setpoint, s.
const BEHIND: f64 = 0.5;
/// A turn is held against so many before it, those the other way round among them.
const LAST: usize = 32;
/// So many have a picture in the report.
const PICTURES: usize = 100;

/// How round the tool went, one turn round a full circle.
#[derive(Clone, Debug, Serialize)]
pub struct CircleSummary {
    /// Where it began.
    #[serde(flatten)]
    pub at: Place,
    /// When it ended, s.
    pub until_s: f64,
    /// Which of the turns round the same circle in the same direction it is, from 1.
    pub turn: u64,
    /// `XY`, `ZX` or `YZ`.
    pub plane: &'static str,
    /// As G2 goes.
    pub clockwise: bool,
    /// The programmed centre, machine coordinates in the order of the plane, mm.
    pub centre_mm: [f64; 2],
    /// The programmed radius, mm.
    pub radius_mm: f64,
    /// What was asked for, after overrides, mm/min.
    pub feed_mm_min: f64,
    /// What the setpoint reached of it, mm/min.
    pub speed_mm_min: f64,
    /// G: how far apart two circles are that the tool stays between, about the centre that fits its way best by least squares, mm.
    pub circular_deviation_mm: f64,
    /// F: its least and its greatest deviation from the programmed circle, positive outside, mm.
    pub radial_deviation_mm: [f64; 2],
    /// How much greater the radius is that fits best, mm.
    pub mean_deviation_mm: f64,
    /// From the programmed centre to the one that fits best, mm.
    pub centre_off_mm: [f64; 2],
    /// What the tool does behind the places where an axis turns back, those that it came to and went on from.
    pub reversals: Vec<Reversal>,
    /// What both directions come to, of the second one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub both_ways: Option<BothWays>,
    /// Angles, rad, and deviations from the programmed circle, mm, in the order in which the tool went; of the first 100.
    #[serde(skip)]
    pub profile: Vec<(f64, f64)>,
}

/// What the tool does where an axis turns back.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Reversal {
    /// The axis.
    pub axis: &'static str,
    /// `+` where it turns back from its greatest position, `-` from its least.
    pub side: char,
    /// How far the tool is off the way on which it came there, at most within 15° behind, positive outside, mm.
    pub error_mm: f64,
}

/// How far both directions round the same circle, at the same feed, are apart.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BothWays {
    /// Line of the other one.
    pub with_line: u32,
    /// When that began, s.
    pub with_time_s: f64,
    /// H: greatest difference of their radial deviations in a direction, mm.
    pub hysteresis_mm: f64,
    /// G of both: how far apart two circles are that the tool stays between both ways, mm.
    pub circular_deviation_mm: f64,
    /// D: how much greater the radius is that fits both best, mm.
    pub mean_deviation_mm: f64,
}

/// As a person reads it, but for the line.
impl fmt::Display for CircleSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [least, most] = self.radial_deviation_mm;
        write!(
            f,
            "turn {} of {} in {}, radius {:.3} mm, at {:.0} of {:.0} mm/min: circular deviation {:.4} mm, radial {least:+.4} to \
             {most:+.4} mm, mean {:+.4} mm",
            self.turn,
            self.direction(),
            self.plane,
            self.radius_mm,
            self.speed_mm_min,
            self.feed_mm_min,
            self.circular_deviation_mm,
            self.mean_deviation_mm
        )?;
        for (n, it) in self.reversals.iter().enumerate() {
            let before = if n == 0 { "; reversals" } else { "," };
            let Reversal {
                axis,
                side,
                error_mm: error,
            } = it;
            write!(f, "{before} {axis}{side} {error:+.4} mm")?;
        }
        match &self.both_ways {
            Some(both) => write!(
                f,
                "; with line {} hysteresis {:.4} mm, circular deviation {:.4} mm, mean {:+.4} mm",
                both.with_line,
                both.hysteresis_mm,
                both.circular_deviation_mm,
                both.mean_deviation_mm
            ),
            None => Ok(()),
        }
    }
}

impl CircleSummary {
    /// The G-code that goes round it so.
    #[must_use]
    pub fn direction(&self) -> &'static str {
        if self.clockwise { "G2" } else { "G3" }
    }
}

/// What is watched of all circles.
#[derive(Debug, Default)]
pub(super) struct Circles {
    /// What of the circular deviation `[validation]` allows, mm.
    tolerance: f64,
    /// Of the move at work.
    tag: Option<u32>,
    /// The circle that the setpoint is on.
    at_work: Option<Round>,
    /// The one that it has left, where the tool still is, and until when, s.
    left: Option<(Round, f64)>,
    /// The last ones, to be held against those in the other direction.
    turns: VecDeque<Turn>,
    pictured: usize,
    /// The greatest circular deviation of a turn, also of those that are left off, mm.
    pub(super) greatest: Option<f64>,
    pub(super) told: Kept<CircleSummary>,
}

/// The tool's way along arcs of one circle.
#[derive(Debug)]
struct Round {
    /// That of the first arc.
    circle: Circle,
    /// What the arcs sweep so far, rad.
    sweep: f64,
    /// Where the setpoint was last: its angle about the centre, and how far it has come round, rad.
    setpoint: (f64, f64),
    /// The tool's last place.
    last: Option<Sample>,
    /// It goes along the circle rather than across.
    is_along: bool,
    /// It has come to the circle.
    counts: bool,
    /// Turns that have begun; their beginnings and ends overlap.
    turns: Vec<Turn>,
    begun: u64,
}

/// What is known of a cycle beside where the tool is.
#[derive(Clone, Copy, Debug)]
struct Cycle {
    at: Place,
    /// mm/s, of the setpoint on the circle.
    feed: f64,
    speed: f64,
}

impl Circles {
    /// None yet.
    pub(super) fn new(machine: &Machine) -> Self {
        Self {
            tolerance: machine.validation.circular_deviation,
            ..Self::default()
        }
    }

    /// Takes what is seen at one SYNC, and where the tool is.
    pub(super) fn observe(
        &mut self,
        observed: &Observed,
        tool: &Position,
        time: f64,
        violations: &mut Kept<Violation>,
    ) {
        let plan = &observed.row.plan;
        if observed.tag != self.tag {
            self.tag = observed.tag;
            let motion = self.tag.and_then(|tag| observed.moves.motion(tag));
            let circle = motion.and_then(|it| it.circle(SAME));
            if plan.off_path {
                // Jogging: what the tool had come to is no circle.
                (self.at_work, self.left) = (None, None);
            }
            self.go_on(circle, &plan.position, time, violations);
        }
        let line = observed.line;
        let cycle = Cycle {
            at: Place { time, line },
            feed: if plan.feed.is_finite() {
                plan.feed
            } else {
                0.0
            },
            speed: plan.speed,
        };
        self.look(&plan.position, tool, &cycle, violations);
    }

    /// Takes where setpoint and tool are.
    fn look(
        &mut self,
        setpoint: &Position,
        tool: &Position,
        cycle: &Cycle,
        violations: &mut Kept<Violation>,
    ) {
        if let Some((mut round, until)) = self.left.take() {
            // How fast the setpoint is elsewhere is no matter.
            let rest = Cycle {
                feed: 0.0,
                speed: 0.0,
                ..*cycle
            };
            if let Some(turn) = round.look(tool, &rest, round.setpoint.1) {
                self.tell(&turn, round.sweep, violations);
            }
            let goes_on = round.is_behind() && cycle.at.time < until;
            self.left = Some((round, until));
            if !goes_on {
                self.close_left(violations);
            }
        }
        if let Some(round) = &mut self.at_work {
            round.go_to(setpoint);
            let sweep = round.sweep;
            if let Some(turn) = round.look(tool, cycle, f64::INFINITY) {
                self.tell(&turn, sweep, violations);
            }
        }
    }

    /// The setpoint is on another move, which may be on a circle.
    fn go_on(
        &mut self,
        circle: Option<Circle>,
        setpoint: &Position,
        time: f64,
        violations: &mut Kept<Violation>,
    ) {
        if let (Some(round), Some(circle)) = (&mut self.at_work, &circle)
            && round.circle.sweep.signum() == circle.sweep.signum()
            && is_same(&round.circle, circle)
        {
            round.sweep += circle.sweep.abs();
            return;
        }
        if let Some(round) = self.at_work.take() {
            self.close_left(violations);
            self.left = Some((round, time + BEHIND));
        }
        self.at_work = circle.map(|it| Round::new(it, setpoint));
    }

    fn close_left(&mut self, violations: &mut Kept<Violation>) {
        if let Some((round, _)) = self.left.take() {
            self.end(round, violations);
        }
    }

    fn end(&mut self, mut round: Round, violations: &mut Kept<Violation>) {
        for turn in std::mem::take(&mut round.turns) {
            self.tell(&turn, round.sweep, violations);
        }
    }

    /// Takes a turn that is over, of arcs that sweep so much, if it is one.
    fn tell(&mut self, turn: &Turn, sweep: f64, violations: &mut Kept<Violation>) {
        let programmed = ((sweep + CLOSED) / TAU) as u64;
        if turn.index >= programmed || !turn.is_whole() {
            return;
        }
        let is_other_way = |it: &&Turn| it.is_reverse_of(turn) && is_same(&it.circle, &turn.circle);
        let other = self.turns.iter().rev().find(is_other_way);
        if let Some(mut summary) = turn.summary(other) {
            if self.pictured < PICTURES {
                self.pictured += 1;
                summary.profile = turn.profile();
            }
            let (value, limit) = (summary.circular_deviation_mm, self.tolerance);
            self.greatest = Some(self.greatest.map_or(value, |it| it.max(value)));
            if value > limit {
                violations.push(Violation {
                    what: "circular_deviation".to_owned(),
                    axis: None,
                    time: summary.at.time,
                    line: summary.at.line,
                    value,
                    limit,
                    unit: "mm",
                });
            }
            self.told.push(summary);
        }
        if self.turns.len() == LAST {
            self.turns.pop_front();
        }
        self.turns.push_back(turn.clone());
    }

    /// Ends the circles that go on.
    pub(super) fn close(&mut self, violations: &mut Kept<Violation>) {
        self.close_left(violations);
        if let Some(round) = self.at_work.take() {
            self.end(round, violations);
        }
    }
}

/// Whether arcs are of one circle, in either direction.
fn is_same(one: &Circle, other: &Circle) -> bool {
    let near = |one: f64, other: f64| (one - other).abs() < SAME;
    one.plane == other.plane
        && near(one.radius, other.radius)
        && near(one.centre[0], other.centre[0])
        && near(one.centre[1], other.centre[1])
}

/// An angle between −π and π.
fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

impl Round {
    fn new(circle: Circle, setpoint: &Position) -> Self {
        let mut round = Self {
            circle,
            sweep: circle.sweep.abs(),
            setpoint: (circle.from, 0.0),
            last: None,
            is_along: false,
            counts: false,
            turns: Vec::new(),
            begun: 0,
        };
        round.go_to(setpoint);
        round
    }

    /// Angle about the centre and distance from it.
    fn polar(&self, place: &Position) -> (f64, f64) {
        let (one, other) = self.circle.plane;
        let x = place[one] - self.circle.centre[0];
        let y = place[other] - self.circle.centre[1];
        (y.atan2(x), x.hypot(y))
    }

    /// An angle, as it is gone through.
    fn forward(&self, angle: f64) -> f64 {
        wrapped(angle * self.circle.sweep.signum())
    }

    /// Takes where the setpoint is, on the circle.
    fn go_to(&mut self, setpoint: &Position) {
        let (angle, _) = self.polar(setpoint);
        let (last, gone) = self.setpoint;
        self.setpoint = (angle, gone + self.forward(angle - last));
    }

    /// The tool may come further, and still goes along the circle.
    fn is_behind(&self) -> bool {
        self.is_along && self.last.is_some_and(|it| it.gone < self.setpoint.1)
    }

    /// Takes where the tool is, which counts until it has come round so far, rad; a turn that it has ended by that, with what is
    /// behind its end.
    fn look(&mut self, tool: &Position, cycle: &Cycle, until: f64) -> Option<Turn> {
        let (angle, distance) = self.polar(tool);
        let (setpoint, gone) = self.setpoint;
        let sample = Sample {
            gone: gone - self.forward(setpoint - angle),
            off: distance - self.circle.radius,
        };
        let radius = self.circle.radius;
        let before = self.last.replace(sample);
        self.is_along = before.is_some_and(|before| {
            radius * (sample.gone - before.gone) > (sample.off - before.off).abs()
        });
        let counted = self.counts;
        self.counts |= self.is_along && sample.gone >= 0.0;
        if !self.counts || sample.gone > until {
            return None;
        }
        let turn = ((sample.gone + MARGIN) / TAU).max(0.0) as u64;
        while self.begun <= turn {
            self.turns.push(Turn::new(self.circle, self.begun));
            self.begun += 1;
        }
        let before = before.filter(|_| counted);
        for turn in &mut self.turns {
            turn.push(before, sample, cycle);
        }
        let first = self.turns.first()?;
        (first.ends() < sample.gone).then(|| self.turns.remove(0))
    }
}

#[cfg(test)]
mod tests;
