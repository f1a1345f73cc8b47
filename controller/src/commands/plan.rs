//! `syncline plan`: a batch of state-to-state problems.

use super::output::{Claims, NoOutput};
use super::{Exit, report};
use std::fmt::Write as _;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use syncline_strict_toml::input;
use syncline_trajectory::limits::{Limits, PositionLimits};
use syncline_trajectory::profile::{Profile, State};
use syncline_trajectory::state_to_state::{PlanError, Problem, Target};
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
/// target_breaks_limit, target_outside_position, start_outside_position, not_straight, min_duration,
/// unreachable, too_large (a number beyond ±1e15), too_small (a limit within ±1e-15) or
/// not_certified (the checker finds an error above 1e-9). Every row is answered; the exit code is 2
/// where one is not ok.
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
        let file = input::lines(&self.cases);
        let file = file.map_err(|error| PlanFileError::Read(self.cases.clone(), error.into()))?;
        let cases = Cases::begin(file, &self.cases)?;
        let out = self.out.as_deref().unwrap_or(Path::new("-"));
        let mut claims = Claims::default().reads("CASES", &self.cases);
        let target = claims.target("--out", out)?;
        cases.answer(self.segments, target.begin()?)
    }
}

/// Problems whose columns are known.
struct Cases<'a, R> {
    file: &'a Path,
    reader: csv::Reader<R>,
    columns: Columns,
}

impl<'a, R: Read> Cases<'a, R> {
    /// Reads the first line of what `file` names.
    fn begin(source: R, file: &'a Path) -> Result<Self, PlanFileError> {
        let mut reader = csv::ReaderBuilder::new()
            .flexible(true)
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .from_reader(source);
        let header = reader.byte_headers();
        let header = header.map_err(|error| PlanFileError::Read(file.to_owned(), error))?;
        let columns = Columns::new(header, file)?;
        Ok(Self {
            file,
            reader,
            columns,
        })
    }

    /// Writes an answer to each row; whether all are ok.
    fn answer(self, with_segments: bool, out: impl Write) -> Result<bool, PlanFileError> {
        let Self {
            file,
            reader,
            columns,
        } = self;
        let mut writer = csv::Writer::from_writer(out);
        let write = |error: csv::Error| PlanFileError::Write(error.into());
        let mut header: Vec<String> = ["id", "status", "duration", "end_error", "limit_excess"]
            .map(String::from)
            .into();
        if with_segments {
            header.extend((0..columns.axes.len()).map(|i| format!("seg_{i}")));
        }
        writer.write_record(&header).map_err(write)?;
        let mut all_ok = true;
        for record in reader.into_byte_records() {
            let record = record.map_err(|error| PlanFileError::Read(file.to_owned(), error))?;
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
            if with_segments {
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

/// Any file of problems: every row is answered.
#[cfg(fuzzing)]
pub fn fuzz(text: &[u8]) {
    if let Ok(cases) = Cases::begin(text, Path::new("cases.csv")) {
        let _ = cases.answer(true, io::sink());
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
    axes: Vec<(usize, Problem)>,
    columns: usize,
}

struct Answer {
    duration: f64,
    end_error: f64,
    limit_excess: f64,
    profiles: Vec<Option<Profile>>,
}

const BAD_ROW: &str = "bad_row";

/// Beyond it there is no machine, and what is computed loses its meaning.
const LARGEST: f64 = 1e15;
/// The least that a limit may allow.
const SMALLEST: f64 = 1e-15;
/// The greatest relative error of a plan that is called ok.
const CERTIFIED: f64 = 1e-9;

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
                Problem {
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

    /// Refuses numbers with which no plan means anything. Those that are none, and limits of zero,
    /// are the planner's to refuse.
    fn check_range(&self) -> Result<(), &'static str> {
        let large = |x: &f64| x.is_finite() && x.abs() > LARGEST;
        let small = |x: &f64| *x != 0.0 && x.abs() < SMALLEST;
        for (_, axis) in &self.axes {
            let Limits {
                v_max,
                v_min,
                a_max,
                a_min,
                j_max,
                j_min,
            } = axis.limits;
            let limits = [v_max, v_min, a_max, a_min, j_max, j_min];
            let target = match axis.target {
                Target::State(state) => state,
                Target::Velocity { v, a } => State { p: 0.0, v, a },
            };
            let states = [axis.start, target].map(|state| [state.p, state.v, state.a]);
            let bounds = axis.bounds.map_or([0.0; 2], |it| [it.min, it.max]);
            let mut all = states.iter().flatten().chain(&limits).chain(&bounds);
            if all.any(large) {
                return Err("too_large");
            }
            if limits.iter().any(small) {
                return Err("too_small");
            }
        }
        if large(&self.min_duration) {
            return Err("too_large");
        }
        Ok(())
    }

    fn plan(&self) -> Result<Answer, &'static str> {
        if self.min_duration.is_nan() {
            return Err(status(PlanError::NotANumber));
        }
        self.check_range()?;
        let axes: Vec<Problem> = self.axes.iter().map(|(_, axis)| *axis).collect();
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
            if !certificate.holds(CERTIFIED) {
                return Err("not_certified");
            }
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Numbers as people, programs and fuzzers write them: of every size, and none.
    fn number() -> impl Strategy<Value = String> {
        prop_oneof![
            4 => (-1000.0..1000.0_f64).prop_map(|x| x.to_string()),
            2 => (any::<bool>(), -320.0..308.0_f64).prop_map(|(minus, exponent)| {
                let x = 10_f64.powf(exponent);
                format!("{:e}", if minus { -x } else { x })
            }),
            2 => (any::<bool>(), -16.0..16.0_f64).prop_map(|(minus, exponent)| {
                let x = 10_f64.powf(exponent);
                format!("{:e}", if minus { -x } else { x })
            }),
            1 => Just("0".to_owned()),
            1 => prop::sample::select(vec!["1e308", "-1e308", "5e-324", "inf", "-inf", "nan", "", "x"])
                .prop_map(str::to_owned),
        ]
    }

    /// A limit of either sign, mostly the right one.
    fn limit(sign: f64) -> impl Strategy<Value = String> {
        prop_oneof![
            8 => (-17.0..17.0_f64).prop_map(move |exponent| (sign * 10_f64.powf(exponent)).to_string()),
            8 => (-2.0..4.0_f64).prop_map(move |exponent| (sign * 10_f64.powf(exponent)).to_string()),
            1 => number(),
        ]
    }

    fn axis() -> impl Strategy<Value = String> {
        let states = proptest::collection::vec(number(), 6);
        let limits = (limit(1.0), limit(-1.0), limit(1.0), limit(-1.0), limit(1.0));
        (states, limits).prop_map(|(states, (a, b, c, d, e))| {
            [&states.join(","), &*a, &b, &c, &d, &e].join(",")
        })
    }

    fn row() -> impl Strategy<Value = String> {
        let words = ["", "time", "line", "none", "x"];
        let sync = prop::sample::select(words.to_vec());
        let least = prop_oneof![3 => Just(String::new()), 1 => number()];
        (sync, least, axis(), axis())
            .prop_map(|(sync, least, one, other)| format!("{sync},{least},{one},{other}"))
    }

    const HEADER: &str = "id,sync,min_duration,\
        p0_0,v0_0,a0_0,pf_0,vf_0,af_0,vmax_0,vmin_0,amax_0,amin_0,jmax_0,\
        p0_1,v0_1,a0_1,pf_1,vf_1,af_1,vmax_1,vmin_1,amax_1,amin_1,jmax_1";

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4096))]

        /// Whatever stands in a file of cases, each row is answered, and what is called ok is.
        #[test]
        fn every_row_is_answered_and_what_is_ok_is_certified(row in row()) {
            let text = format!("{HEADER}\nrow,{row}\n");
            let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(text.as_bytes());
            let columns = Columns::new(reader.byte_headers().unwrap(), Path::new("cases.csv")).unwrap();
            let record = reader.byte_records().next().unwrap().unwrap();
            if let Ok(plan) = Row::read(&columns, &record).and_then(|row| row.plan()) {
                prop_assert!(plan.duration.is_finite());
                prop_assert!(plan.end_error <= CERTIFIED && plan.limit_excess <= CERTIFIED);
            }
        }
    }
}
