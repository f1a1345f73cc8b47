//! Motion that is known by samples alone, against the limits of a machine.
//!
//! Nothing of a plan is known, so what can be said are means: of the velocity over a step, of the
//! acceleration over two, of the jerk over three, and over as many steps at longer strides.
//! Positions are known to ±u only, and so are these means. What follows is certain:
//!
//! - a mean that is above its limit by more than its uncertainty was *exceeded* in that window: no motion inside the limits has
//!   these samples,
//! - where no mean reaches it, with the uncertainty added, the limit is *kept* by all that lasts a step longer than
//!   the window,
//! - in between it is *undecidable* by these samples. What lasts longer may be decided, by a longer stride.
//!
//! The axes rest before the first sample and behind the last one.
//!
//! What simulated drives make of the samples is a [`Summary`] beside that.

use super::differences::{Differences, STRIDES, Uncertainty};
use super::summary::Summary;
use serde::Serialize;
use std::fmt;

/// By this part of a limit more is no excess that can be told.
const TELLS: f64 = 1e-3;

/// A position so far beyond a soft limit, mm, is still on it.
const BEYOND: f64 = 1e-6;

/// One axis by its samples, and its limits; mm and s, or degrees.
#[derive(Clone, Debug, PartialEq)]
pub struct Samples {
    /// As the machine file names it.
    pub name: String,
    /// Of its position, velocity, acceleration and jerk.
    pub units: [&'static str; 4],
    /// Where it was at each step.
    pub positions: Vec<f64>,
    /// By how much each may be off.
    pub uncertainty: f64,
    /// The least and the greatest position that it may have.
    pub range: (f64, f64),
    /// What velocity, acceleration and jerk it may have.
    pub limits: [f64; 3],
}

/// What samples say of a limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Judgement {
    /// It is kept.
    Kept,
    /// It may be exceeded by what the samples are uncertain by.
    Undecidable,
    /// It is exceeded for certain.
    Exceeded,
}

/// A limit of an axis, and what samples say of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// Whose.
    pub axis: String,
    /// `position`, `velocity`, `acceleration` or `jerk`.
    pub what: &'static str,
    /// What can be said.
    pub judgement: Judgement,
    /// The mean that says it: the greatest over a stride of one step or, of a limit that is exceeded, the one that is
    /// furthest above it; of positions the one that is furthest out.
    pub value: f64,
    /// By how much that may be off.
    pub uncertainty: f64,
    /// What is allowed.
    pub limit: f64,
    /// Of all three.
    pub unit: &'static str,
    /// The window of that mean, s from the first sample.
    pub window_s: [f64; 2],
    /// An excess that lasts as long as this, s, is excluded; `None` where not even the longest stride excludes one.
    pub kept_from_s: Option<f64>,
}

/// A motion by its samples, and what they say.
#[derive(Clone, Debug, Serialize)]
pub struct SampledMotion {
    /// `pass` where every limit is kept and the drives follow, `fail` where one is exceeded or they do not, else
    /// `undecidable`.
    pub verdict: &'static str,
    /// Between two samples, s.
    pub step_s: f64,
    /// How many there are.
    pub samples: usize,
    /// Every limit of every axis.
    pub limits: Vec<Judged>,
    /// What the simulated drives make of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub response: Option<Box<Summary>>,
    /// Why that is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_simulated: Option<String>,
}

impl SampledMotion {
    /// Judges samples of axes that are so many seconds apart, as many of each.
    #[must_use]
    pub fn judge(axes: &[Samples], step: f64) -> Self {
        let limits: Vec<Judged> = axes.iter().flat_map(|axis| axis.judge(step)).collect();
        let worst = limits.iter().map(|it| it.judgement).max();
        Self {
            verdict: match worst {
                Some(Judgement::Exceeded) => "fail",
                Some(Judgement::Undecidable) => "undecidable",
                Some(Judgement::Kept) | None => "pass",
            },
            step_s: step,
            samples: axes.iter().map(|it| it.positions.len()).max().unwrap_or(0),
            limits,
            response: None,
            not_simulated: None,
        }
    }

    /// With what simulated drives make of it, or why that is not known. Where the controller refuses samples that
    /// do not decide whether a limit is kept, neither does that.
    #[must_use]
    pub fn followed(self, response: Result<Summary, String>) -> Self {
        let undecided = self.verdict == "undecidable";
        let told = response.as_ref().ok();
        let told = told.filter(|it| !(undecided && it.refused_a_sample_alone()));
        let follows = told.map(|it| it.verdict == "pass");
        let verdict = match (self.verdict, follows) {
            ("fail", _) | (_, Some(false)) => "fail",
            ("pass", Some(true)) => "pass",
            _ => "undecidable",
        };
        let (response, not_simulated) = match response {
            Ok(summary) => (Some(Box::new(summary)), None),
            Err(why) => (None, Some(why)),
        };
        Self {
            verdict,
            response,
            not_simulated,
            ..self
        }
    }
}

/// Of one stride: the greatest mean and when its window ended, by how much it may be off.
#[derive(Clone, Copy, Debug, Default)]
struct Greatest {
    mean: f64,
    off: f64,
    row: usize,
}

impl Samples {
    fn judge(&self, step: f64) -> Vec<Judged> {
        let mut greatest = [[Greatest::default(); STRIDES.len()]; 3];
        let mut differences = Differences::new(step, Uncertainty::Within(self.uncertainty));
        let rest = self.positions.last().copied().unwrap_or_default();
        let behind = std::iter::repeat_n(rest, 3 * STRIDES[STRIDES.len() - 1]);
        for (row, position) in self.positions.iter().copied().chain(behind).enumerate() {
            differences.take(row as u64, position);
            for (at, &stride) in STRIDES.iter().enumerate() {
                for (order, it) in differences.at_stride(stride).into_iter().enumerate() {
                    let greatest = &mut greatest[order][at];
                    if it.mean() > greatest.mean {
                        let (mean, off) = (it.mean(), it.off());
                        *greatest = Greatest { mean, off, row };
                    } else if greatest.mean == 0.0 {
                        greatest.off = it.off();
                    }
                }
            }
        }
        let mut judged = vec![self.judge_positions(step)];
        for (order, greatest) in greatest.iter().enumerate() {
            judged.push(self.judge_means(step, order, greatest));
        }
        judged
    }

    /// Of a derivative, by the greatest means over each stride.
    fn judge_means(&self, step: f64, order: usize, greatest: &[Greatest]) -> Judged {
        let limit = self.limits[order];
        let steps = |at: usize| (order + 1) * STRIDES[at];
        let kept = greatest
            .iter()
            .position(|it| it.mean + it.off <= limit * (1.0 + TELLS));
        let excess = |at: usize| greatest[at].mean - greatest[at].off - limit * (1.0 + TELLS);
        let worst =
            (0..greatest.len()).max_by(|&one, &other| excess(one).total_cmp(&excess(other)));
        let exceeded = worst.filter(|&at| excess(at) > 0.0);
        let at = exceeded.unwrap_or(0);
        let Greatest { mean, off, row } = greatest[at];
        Judged {
            axis: self.name.clone(),
            what: ["velocity", "acceleration", "jerk"][order],
            judgement: match (exceeded, kept) {
                (Some(_), _) => Judgement::Exceeded,
                (None, Some(0)) => Judgement::Kept,
                _ => Judgement::Undecidable,
            },
            value: mean,
            uncertainty: off,
            limit,
            unit: self.units[order + 1],
            window_s: [row as f64 - steps(at) as f64, row as f64].map(|it| it.max(0.0) * step),
            kept_from_s: kept.map(|at| (steps(at) + 1) as f64 * step),
        }
    }

    /// Of the position: the one that is furthest out, or nearest to being so.
    fn judge_positions(&self, step: f64) -> Judged {
        let (least, most) = self.range;
        let out = |position: f64| (least - position).max(position - most);
        let rows = self.positions.iter().copied().enumerate();
        let worst = rows.max_by(|one, other| out(one.1).total_cmp(&out(other.1)));
        let (row, position) = worst.unwrap_or((0, least));
        let out = out(position);
        Judged {
            axis: self.name.clone(),
            what: "position",
            judgement: if out - self.uncertainty > BEYOND {
                Judgement::Exceeded
            } else if out + self.uncertainty > BEYOND {
                Judgement::Undecidable
            } else {
                Judgement::Kept
            },
            value: position,
            uncertainty: self.uncertainty,
            limit: if least - position > position - most {
                least
            } else {
                most
            },
            unit: self.units[0],
            window_s: [row as f64 * step; 2],
            kept_from_s: Some(step),
        }
    }
}

/// As a person reads it, a line for each limit, the worst first, then what the drives make of it.
impl fmt::Display for SampledMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            verdict,
            step_s,
            samples,
            ..
        } = self;
        writeln!(f, "verdict            {verdict}")?;
        let ms = step_s * 1e3;
        let duration = samples.saturating_sub(1) as f64 * step_s;
        writeln!(
            f,
            "samples            {samples}, {ms:.6} ms apart: {duration:.3} s"
        )?;
        let mut limits: Vec<&Judged> = self.limits.iter().collect();
        limits.sort_by_key(|it| std::cmp::Reverse(it.judgement));
        limits.iter().try_for_each(|it| writeln!(f, "{it}"))?;
        if let Some(why) = &self.not_simulated {
            writeln!(f, "response           not simulated: {why}")?;
        }
        let Some(response) = &self.response else {
            return Ok(());
        };
        writeln!(f, "response           {}", response.verdict)?;
        // The verdict of both stands above.
        let told = response.to_string();
        f.write_str(told.split_once('\n').map_or("", |(_, rest)| rest))
    }
}

impl fmt::Display for Judged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let told = match self.judgement {
            Judgement::Kept => "kept",
            Judgement::Undecidable => "UNDECIDABLE",
            Judgement::Exceeded => "EXCEEDED",
        };
        let decimals = if self.what == "position" { 4 } else { 1 };
        let name = format!("axis {}", self.axis);
        write!(
            f,
            "{name:<18} {} {told}: {:.decimals$} ± {:.decimals$} of {} {} ",
            self.what, self.value, self.uncertainty, self.limit, self.unit
        )?;
        match self.window_s {
            [from, to] if from < to => write!(f, "from {from:.4} s to {to:.4} s")?,
            [at, _] => write!(f, "at {at:.4} s")?,
        }
        match (self.judgement, self.kept_from_s) {
            (Judgement::Undecidable, Some(from)) if self.what != "position" => {
                write!(f, "; what lasts {:.3} ms keeps it", from * 1e3)
            }
            _ => Ok(()),
        }
    }
}
