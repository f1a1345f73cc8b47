//! The table that a sweep comes to, and what stands out in it.

use crate::observe::summary::to_the_millionth;
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

pub(super) const RUN: &str = "run";
pub(super) const SEED: &str = "seed";
pub(super) const VERDICT: &str = "verdict";
pub(super) const CAUSE: &str = "cause";
pub(super) const LINE: &str = "line";
/// Before the name of a key that is varied.
pub(super) const SET: &str = "set.";
/// The verdict on what came to no result with the values of a run.
pub(super) const INVALID: &str = "invalid";

/// Runs that are listed of those that do not pass.
const LISTED: usize = 5;

/// Ends of the names of columns of which the greatest is the worst, or the least.
const WORST: [(&str, bool); 7] = [
    ("times.motion_s", true),
    ("path.max_contour_error_mm", true),
    ("path.max_circular_deviation_mm", true),
    (".max_following_error_mm", true),
    (".rms_torque", true),
    (".max_skew_mm", true),
    (".torque_reserve", false),
];

/// All rows of a sweep, run by run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// The names of the columns.
    pub columns: Vec<String>,
    /// As many cells each.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|it| it == name)
    }

    /// A cell by its column's name; empty where there is none.
    fn cell<'t>(&'t self, row: &'t [String], name: &str) -> &'t str {
        let column = self.column(name);
        column.and_then(|it| row.get(it)).map_or("", String::as_str)
    }

    /// The table as CSV.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, to: impl std::io::Write) -> csv::Result<()> {
        let mut csv = csv::Writer::from_writer(to);
        csv.write_record(&self.columns)?;
        for row in &self.rows {
            csv.write_record(row)?;
        }
        Ok(csv.flush()?)
    }

    /// What stands out, with commands that repeat those runs on this machine and program.
    #[must_use]
    pub fn findings<'t>(&'t self, machine: &'t Path, program: &'t Path) -> Findings<'t> {
        Findings {
            table: self,
            machine,
            program,
        }
    }

    /// The column's worst number and the row that has it, the first of equals.
    fn worst(&self, column: usize, greatest: bool) -> Option<(f64, &[String])> {
        let numbers = self.rows.iter().filter_map(|row| {
            let number: f64 = row.get(column)?.parse().ok()?;
            Some((number, &row[..]))
        });
        numbers.reduce(|worst, it| {
            let worse = if greatest {
                it.0 > worst.0
            } else {
                it.0 < worst.0
            };
            if worse { it } else { worst }
        })
    }
}

/// What stands out in a table, as a person reads it.
#[derive(Clone, Copy, Debug)]
pub struct Findings<'t> {
    table: &'t Table,
    machine: &'t Path,
    program: &'t Path,
}

impl Findings<'_> {
    /// The command that makes the run of a row again.
    fn repeat(&self, row: &[String]) -> String {
        let files = [self.machine, self.program].map(|file| quoted(&file.display().to_string()));
        let seed = self.table.cell(row, SEED);
        let mut command = format!("syncline validate {} --seed {seed}", files.join(" "));
        for (column, value) in self.table.columns.iter().zip(row) {
            if let Some(key) = column.strip_prefix(SET) {
                command += &format!(" --set {}", quoted(&format!("{key}={value}")));
            }
        }
        command
    }
}

impl fmt::Display for Findings<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let table = self.table;
        let mut causes: BTreeMap<(&str, &str), Vec<&[String]>> = BTreeMap::new();
        for row in &table.rows {
            let verdict = table.cell(row, VERDICT);
            if verdict != "pass" {
                let cause = (verdict, table.cell(row, CAUSE));
                causes.entry(cause).or_default().push(row);
            }
        }
        let failed: usize = causes.values().map(Vec::len).sum();
        let runs = table.rows.len();
        writeln!(
            f,
            "runs               {runs}, of which {failed} do not pass"
        )?;
        let mut told: BTreeMap<u64, &[String]> = BTreeMap::new();
        let mut tell = |row| {
            let run = table.cell(row, RUN).parse().unwrap_or_default();
            told.insert(run, row);
            run
        };
        for ((verdict, cause), rows) in &causes {
            let first: Vec<_> = rows
                .iter()
                .take(LISTED)
                .map(|row| tell(row).to_string())
                .collect();
            let more = if rows.len() > LISTED { ", …" } else { "" };
            let (count, first) = (rows.len(), first.join(", "));
            writeln!(f, "{verdict:<18} {count} by {cause}: runs {first}{more}")?;
        }
        for (index, column) in table.columns.iter().enumerate() {
            let kind = WORST.iter().find(|(name, _)| column.ends_with(name));
            if let Some((worst, row)) = kind.and_then(|(_, most)| table.worst(index, *most)) {
                let run = tell(row);
                // The table has all digits.
                let worst = to_the_millionth(worst);
                writeln!(f, "worst              {column} {worst} in run {run}")?;
            }
        }
        for (run, row) in &told {
            writeln!(f, "run {run:<14} {}", self.repeat(row))?;
        }
        Ok(())
    }
}

/// As a shell takes it for one word.
#[must_use]
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-=,:+".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}
