//! `syncline plan`: a batch of state-to-state problems.

use super::output::{Claims, NoOutput};
use super::{Exit, report};
use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};
use syncline_trajectory::limits::{Limits, PositionLimits};
use syncline_trajectory::profile::{Profile, State};
use syncline_trajectory::state_to_state::{Axis, PlanError, Target};
use syncline_trajectory::synchronise::{self, MAX_AXES, Synchronisation};
use syncline_trajectory::verify;

/// Plan a batch of state-to-state moves, one a row, and certify each plan.
///
/// CASES is CSV with its columns named in the first line: `id`, `sync` (line, time, none; empty is
/// time), `min_duration` in s (may be empty), optionally `interface` (position, the default, or
/// velocity), and for each axis i = 0, 1, … `p0_i, v0_i, a0_i` (start), `pf_i, vf_i, af_i` (target),
/// `vmax_i, vmin_i, amax_i, amin_i, jmax_i` (limits; the minima are negative) and optionally
/// `jmin_i` (empty: −jmax), `pmin_i, pmax_i` (empty: none). An axis whose fields are all empty is
/// absent. The velocity interface leaves `pf_i` out of account.
///
/// The answer is CSV: `id, status, duration, end_error, limit_excess`, the last two from the
/// checker, which does not trust the planner. `status` is ok, bad_row, nan, zero_limit,
/// target_breaks_limit, target_outside_position, start_outside_position, not_straight, min_duration
/// or unreachable. Every row is answered; the exit code is 2 where one is not ok.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Problems, one a row
    cases: PathBuf,
    /// Add a column `seg_i` for each axis: its plan as `duration:jerk` pairs joined by `;`
    #[arg(long)]
    segments: bool,
    /// Write the answers to FILE instead of standard output
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Why a file of cases has no answer at all.
#[derive(Debug, thiserror::Error)]
enum PlanFileError {
    #[error("cannot read {0}")]
    Read(PathBuf, #[source] csv::Error),
    #[error(transparent)]
    NoOutput(#[from] NoOutput),
    #[error(transparent)]
    Write(#[from] io::Error),
    #[error("{file}: no column {column}: name it in the first line")]
    NoColumn { file: PathBuf, column: String },
    #[error("{file}: {axes} axes, more than the {MAX_AXES} that are planned together")]
    TooManyAxes { file: PathBuf, axes: usize },
}

impl Args {
    /// Answers every row.
    pub(super) fn execute(&self) -> Exit {
        match self.answer() {
            Ok(true) => Exit::Finished,
            Ok(false) => Exit::BadInput,
            Err(error) => {
                report(&error);
                match error {
                    PlanFileError::Write(_) => Exit::Stopped,
                    _ => Exit::BadInput,
                }
            }
        }
    }

    /// Whether every row is ok.
    fn answer(&self) -> Result<bool, PlanFileError> {
        let read = |e| PlanFileError::Read(self.cases.clone(), e);
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .from_path(&self.cases)
            .map_err(read)?;
        let columns = Columns::new(reader.byte_headers().map_err(read)?, &self.cases)?;
        let out = self.out.as_deref().unwrap_or(Path::new("-"));
        let mut claims = Claims::default().reads("CASES", &self.cases);
        let target = claims.target("--out", out)?;
        let mut writer = csv::Writer::from_writer(target.begin()?);
        let write = |error: csv::Error| PlanFileError::Write(error.into());
        let mut header: Vec<String> = ["id", "status", "duration", "end_error", "limit_excess"]
            .map(String::from)
            .into();
        if self.segments {
            header.extend((0..columns.axes.len()).map(|i| format!("seg_{i}")));
        }
        writer.write_record(&header).map_err(write)?;
        let mut all_ok = true;
        for record in reader.byte_records() {
            let record = record.map_err(read)?;
            let row = Row::read(&columns, &record);
            let answer = row.and_then(|row| row.plan());
            all_ok &= answer.is_ok();
            let id = String::from_utf8_lossy(record.get(columns.id).unwrap_or_default());
            let mut fields = vec![id.into_owned()];
            match &answer {
                Ok(plan) => {
                    fields.push("ok".into());
                    fields.push(plan.duration.to_string());
                    fields.push(format!("{:e}", plan.end_error));
                    fields.push(format!("{:e}", plan.limit_excess));
                }
                Err(status) => {
                    fields.push((*status).into());
                    fields.extend([const { String::new() }; 3]);
                }
            }
            if self.segments {
                for i in 0..columns.axes.len() {
                    let profile = answer.as_ref().ok().and_then(|a| a.profiles[i].as_ref());
                    fields.push(profile.map(segments).unwrap_or_default());
                }
            }
            writer.write_record(&fields).map_err(write)?;
        }
        writer.flush()?;
        Ok(all_ok)
    }
}

fn segments(profile: &Profile) -> String {
    let mut text = String::new();
    for (i, s) in profile.segments().iter().enumerate() {
        let joint = if i == 0 { "" } else { ";" };
        // The shortest decimals that read back as the same number.
        let _ = write!(text, "{joint}{}:{}", Short(s.duration), Short(s.jerk));
    }
    text
}

/// A number in the shorter of its plain and its exponent notation.
struct Short(f64);

impl std::fmt::Display for Short {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let x = self.0;
        if x != 0.0 && !(1e-5..1e16).contains(&x.abs()) {
            write!(f, "{x:e}")
        } else {
            write!(f, "{x}")
        }
    }
}

/// Where each value stands in a row.
struct Columns {
    id: usize,
    sync: usize,
    min_duration: Option<usize>,
    interface: Option<usize>,
    axes: Vec<AxisColumns>,
    /// Number of columns, known or not.
    width: usize,
}

/// `p0, v0, a0, pf, vf, af, vmax, vmin, amax, amin, jmax`, and the optional `jmin, pmin, pmax`.
struct AxisColumns {
    required: [usize; 11],
    optional: [Option<usize>; 3],
}

impl Columns {
    fn new(header: &csv::ByteRecord, file: &Path) -> Result<Self, PlanFileError> {
        let find = |name: &str| header.iter().position(|h| h == name.as_bytes());
        let need = |column: String| {
            find(&column).ok_or(PlanFileError::NoColumn {
                file: file.into(),
                column,
            })
        };
        let required = [
            "p0", "v0", "a0", "pf", "vf", "af", "vmax", "vmin", "amax", "amin", "jmax",
        ];
        let mut axes = Vec::new();
        loop {
            let i = axes.len();
            let any = required.iter().any(|n| find(&format!("{n}_{i}")).is_some());
            if i > 0 && !any {
                break;
            }
            let mut columns = AxisColumns {
                required: [0; 11],
                optional: ["jmin", "pmin", "pmax"].map(|n| find(&format!("{n}_{i}"))),
            };
            for (column, name) in columns.required.iter_mut().zip(required) {
                *column = need(format!("{name}_{i}"))?;
            }
            axes.push(columns);
        }
        if axes.len() > MAX_AXES {
            return Err(PlanFileError::TooManyAxes {
                file: file.into(),
                axes: axes.len(),
            });
        }
        Ok(Columns {
            id: need("id".into())?,
            sync: need("sync".into())?,
            min_duration: find("min_duration"),
            interface: find("interface"),
            axes,
            width: header.len(),
        })
    }
}

/// A problem as read.
struct Row {
    synchronisation: Synchronisation,
    min_duration: f64,
    /// With the index of the axis's columns.
    axes: Vec<(usize, Axis)>,
    columns: usize,
}

struct Answer {
    duration: f64,
    end_error: f64,
    limit_excess: f64,
    profiles: Vec<Option<Profile>>,
}

const BAD_ROW: &str = "bad_row";

impl Row {
    fn read(columns: &Columns, record: &csv::ByteRecord) -> Result<Self, &'static str> {
        let text = |i: usize| -> Result<&str, &'static str> {
            std::str::from_utf8(record.get(i).unwrap_or_default()).map_err(|_| BAD_ROW)
        };
        let number = |i: usize| text(i)?.parse::<f64>().map_err(|_| BAD_ROW);
        let optional = |i: Option<usize>| match i.map(text).transpose()? {
            None | Some("") => Ok(None),
            Some(t) => t.parse::<f64>().map(Some).map_err(|_| BAD_ROW),
        };
        let synchronisation = match text(columns.sync)? {
            "" | "time" => Synchronisation::Time,
            "line" => Synchronisation::Line,
            "none" => Synchronisation::None,
            _ => return Err(BAD_ROW),
        };
        let velocity = match columns.interface.map_or(Ok(""), text)? {
            "" | "position" => false,
            "velocity" => true,
            _ => return Err(BAD_ROW),
        };
        let min_duration = optional(columns.min_duration)?.unwrap_or(0.0);
        let mut axes = Vec::new();
        for (index, c) in columns.axes.iter().enumerate() {
            let fields = c
                .required
                .into_iter()
                .chain(c.optional.into_iter().flatten());
            let mut empty = true;
            for field in fields {
                empty &= text(field)?.is_empty();
            }
            if empty {
                continue;
            }
            let r = c.required;
            let (v_max, v_min) = (number(r[6])?, number(r[7])?);
            let (a_max, a_min) = (number(r[8])?, number(r[9])?);
            let j_max = number(r[10])?;
            let [j_min, p_min, p_max] = c.optional.map(optional);
            let j_min = j_min?.unwrap_or(-j_max);
            let bounds = match (p_min?, p_max?) {
                (None, None) => None,
                (min, max) => Some(PositionLimits {
                    min: min.unwrap_or(f64::NEG_INFINITY),
                    max: max.unwrap_or(f64::INFINITY),
                }),
            };
            let (v, a) = (number(r[4])?, number(r[5])?);
            let target = if velocity {
                optional(Some(r[3]))?;
                Target::Velocity { v, a }
            } else {
                Target::State(State {
                    p: number(r[3])?,
                    v,
                    a,
                })
            };
            axes.push((
                index,
                Axis {
                    start: State {
                        p: number(r[0])?,
                        v: number(r[1])?,
                        a: number(r[2])?,
                    },
                    target,
                    limits: Limits {
                        v_max,
                        v_min,
                        a_max,
                        a_min,
                        j_max,
                        j_min,
                    },
                    bounds,
                },
            ));
        }
        if axes.is_empty() || record.len() != columns.width {
            return Err(BAD_ROW);
        }
        Ok(Row {
            synchronisation,
            min_duration,
            axes,
            columns: columns.axes.len(),
        })
    }

    fn plan(&self) -> Result<Answer, &'static str> {
        if self.min_duration.is_nan() {
            return Err(status(PlanError::NotANumber));
        }
        let axes: Vec<Axis> = self.axes.iter().map(|(_, axis)| *axis).collect();
        let mut profiles: Vec<Profile> = axes.iter().map(|a| Profile::new(a.start)).collect();
        let duration = synchronise::plan(
            &axes,
            self.synchronisation,
            self.min_duration,
            &mut profiles,
        )
        .map_err(status)?;
        let mut answer = Answer {
            duration,
            end_error: 0.0,
            limit_excess: 0.0,
            profiles: vec![None; self.columns],
        };
        for ((index, axis), profile) in self.axes.iter().zip(profiles) {
            let certificate = verify::axis(&profile, axis);
            answer.end_error = answer.end_error.max(certificate.end_error);
            answer.limit_excess = answer.limit_excess.max(certificate.limit_excess);
            answer.profiles[*index] = Some(profile);
        }
        Ok(answer)
    }
}

fn status(error: PlanError) -> &'static str {
    match error {
        PlanError::NotANumber => "nan",
        PlanError::ZeroLimit => "zero_limit",
        PlanError::TargetBreaksLimit => "target_breaks_limit",
        PlanError::TargetOutsidePosition => "target_outside_position",
        PlanError::StartOutsidePosition => "start_outside_position",
        PlanError::NotStraight => "not_straight",
        PlanError::MinDuration => "min_duration",
        PlanError::Unreachable => "unreachable",
    }
}
