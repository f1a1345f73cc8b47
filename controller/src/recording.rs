//! Numbers over time from a file: traces of `run` and `validate`, and motion that others have planned or sampled.
//!
//! A file is a table of rows: with a header and commas (CSV), or with white space between the fields and no header,
//! as LinuxCNC's halsampler writes it.

use std::io::{self, BufRead};
use std::path::{Path, PathBuf};
use syncline_strict_toml::input;

/// By this part of the step two instants may be further apart: the last digit that is written.
const EVEN: f64 = 3e-3;

/// Numbers of a recording: 1 GiB of them, two hours and more of a trace with 16 columns at 1 ms.
const MOST_NUMBERS: usize = 1 << 27;

/// A table of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    file: PathBuf,
    columns: Vec<Column>,
    rows: usize,
}

/// A column that was read.
#[derive(Clone, Debug, PartialEq)]
struct Column {
    name: String,
    values: Vec<f64>,
    /// The finest decimal that is written in it.
    decimal: f64,
    /// The first row, counted from 1 without the header, and field that is no number.
    wrong: Option<(usize, String)>,
}

/// Why a file is no recording, or has not what is asked of it.
#[derive(Debug, thiserror::Error)]
pub enum NotRecorded {
    /// It cannot be read.
    #[error("cannot read {}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It has no rows.
    #[error("{} is empty: it has no row of numbers", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
    /// Its columns have no names.
    #[error("{} has no header: name its {count} columns in their order", file.display())]
    Unnamed {
        /// The file.
        file: PathBuf,
        /// How many there are.
        count: usize,
    },
    /// A row has other fields than the first.
    #[error("{}, row {row}: {found} fields, not {expected}", file.display())]
    Fields {
        /// The file.
        file: PathBuf,
        /// Counted from 1, without the header.
        row: usize,
        /// How many it has.
        found: usize,
        /// How many columns there are.
        expected: usize,
    },
    /// It has more rows than are kept.
    #[error("{} has more than {most} rows: give a part of it", file.display())]
    Long {
        /// The file.
        file: PathBuf,
        /// How many there may be, of as many columns as it has.
        most: usize,
    },
    /// It lacks a column.
    #[error("{}: no column `{column}`; there are {has}", file.display())]
    Column {
        /// The file.
        file: PathBuf,
        /// What is missing.
        column: String,
        /// What is there.
        has: String,
    },
    /// A field of a column that is needed is no number.
    #[error("{}, row {row}: `{field}` is no number", file.display())]
    Number {
        /// The file.
        file: PathBuf,
        /// Counted from 1, without the header.
        row: usize,
        /// What stands there.
        field: String,
    },
    /// Its samples are not a fixed step apart.
    #[error(
        "{}, row {row}: {found} s after the row before, not {step} s: samples must be a fixed step apart",
        file.display()
    )]
    Uneven {
        /// The file.
        file: PathBuf,
        /// Counted from 1, without the header.
        row: usize,
        /// The time since the row before, s.
        found: f64,
        /// The step of the whole, s.
        step: f64,
    },
}

impl Recording {
    /// Reads a file, whose columns have these names in their order, or those of its header.
    ///
    /// # Errors
    /// It cannot be read, has no row, no names, or rows of different lengths.
    pub fn read(file: &Path, names: Option<&[String]>) -> Result<Self, NotRecorded> {
        let file = file.to_owned();
        let cannot_read = |source| NotRecorded::Read {
            file: file.clone(),
            source,
        };
        let lines = input::lines(&file).map_err(cannot_read)?.lines();
        let is_blank =
            |line: &io::Result<String>| line.as_ref().is_ok_and(|it| it.trim().is_empty());
        let mut lines = lines.filter(|line| !is_blank(line));
        let Some(first) = lines.next() else {
            return Err(NotRecorded::Empty { file });
        };
        let first = first.map_err(cannot_read)?;
        let by_commas = first.contains(',');
        let header = fields(&first, by_commas);
        let is_header = header.iter().all(|it| it.parse::<f64>().is_err());
        let names = match names {
            Some(names) => names.to_vec(),
            None if is_header => header.iter().map(|&it| it.to_owned()).collect(),
            None => {
                let count = header.len();
                return Err(NotRecorded::Unnamed { file, count });
            }
        };
        let mut columns: Vec<Column> = names.into_iter().map(Column::new).collect();
        let most = MOST_NUMBERS / columns.len().max(1);
        let first = (!is_header).then(|| Ok(first.clone()));
        let mut rows = 0;
        for line in first.into_iter().chain(lines) {
            let line = line.map_err(cannot_read)?;
            let fields = fields(&line, by_commas);
            rows += 1;
            if rows > most {
                return Err(NotRecorded::Long { file, most });
            }
            // A line of halsampler that tells of lost samples is told as what it is.
            if fields.len() != columns.len() && fields.len() > 1 {
                return Err(NotRecorded::Fields {
                    file,
                    row: rows,
                    found: fields.len(),
                    expected: columns.len(),
                });
            }
            for (at, column) in columns.iter_mut().enumerate() {
                let field = fields.get(at).or(fields.first());
                column.push(rows, field.copied().unwrap_or_default());
            }
        }
        if rows == 0 {
            return Err(NotRecorded::Empty { file });
        }
        Ok(Self {
            file,
            columns,
            rows,
        })
    }

    /// Where it is from.
    #[must_use]
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// How many rows it has.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The names of its columns, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|column| column.name.as_str())
    }

    /// The numbers of a column.
    ///
    /// # Errors
    /// There is none of that name, or it has something else.
    pub fn column(&self, name: &str) -> Result<&[f64], NotRecorded> {
        Ok(&self.find(name)?.values)
    }

    /// The finest decimal that is written in a column: 0.001 of a column that has 1.5 and 2.125.
    ///
    /// # Errors
    /// As [`column`](Self::column).
    pub fn decimal(&self, name: &str) -> Result<f64, NotRecorded> {
        Ok(self.find(name)?.decimal)
    }

    fn find(&self, name: &str) -> Result<&Column, NotRecorded> {
        let Some(column) = self.columns.iter().find(|column| column.name == name) else {
            let has: Vec<&str> = self.names().collect();
            return Err(NotRecorded::Column {
                file: self.file.clone(),
                column: name.to_owned(),
                has: has.join(", "),
            });
        };
        match &column.wrong {
            None => Ok(column),
            Some((row, field)) => Err(NotRecorded::Number {
                file: self.file.clone(),
                row: *row,
                field: field.clone(),
            }),
        }
    }

    /// The fixed step of a column of times, s; `None` of a single row.
    ///
    /// # Errors
    /// As [`column`](Self::column); the step is not fixed.
    pub fn step(&self, name: &str) -> Result<Option<f64>, NotRecorded> {
        let times = self.column(name)?;
        let [first, .., last] = *times else {
            return Ok(None);
        };
        let step = (last - first) / (times.len() - 1) as f64;
        for (at, pair) in times.windows(2).enumerate() {
            let found = pair[1] - pair[0];
            let is_even = (found - step).abs() <= EVEN * step && found > 0.0;
            if !is_even {
                return Err(NotRecorded::Uneven {
                    file: self.file.clone(),
                    row: at + 2,
                    found,
                    step,
                });
            }
        }
        Ok(Some(step))
    }
}

impl Column {
    fn new(name: String) -> Self {
        Self {
            name,
            values: Vec::new(),
            decimal: 1.0,
            wrong: None,
        }
    }

    fn push(&mut self, row: usize, field: &str) {
        let number = field.parse().ok().filter(|it: &f64| it.is_finite());
        if number.is_none() && self.wrong.is_none() {
            self.wrong = Some((row, field.to_owned()));
        }
        self.values.push(number.unwrap_or_default());
        self.decimal = self.decimal.min(decimal(field));
    }
}

/// The fields of a line.
fn fields(line: &str, by_commas: bool) -> Vec<&str> {
    if by_commas {
        let fields = line.split(',');
        return fields.map(|it| it.trim().trim_matches('"')).collect();
    }
    line.split_whitespace().collect()
}

/// What the last digit of a number counts.
fn decimal(number: &str) -> f64 {
    let (digits, power) = number.split_once(['e', 'E']).unwrap_or((number, "0"));
    let behind = digits.split_once('.').map_or(0, |(_, behind)| behind.len());
    let power: i32 = power.parse().unwrap_or_default();
    10_f64.powi(power.saturating_sub(i32::try_from(behind).unwrap_or(i32::MAX)))
}
