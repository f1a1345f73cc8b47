//! Work offsets, reference points and tools: one TOML file beside the machine file.
//!
//! ```toml
//! [work_offsets]
//! G54 = { X = 400.0, Y = 300.0, Z = -250.0 }
//!
//! [reference_points]
//! G28 = { Z = 0.0 }
//!
//! [[tool]]
//! number = 1
//! name = "end mill 6 mm"
//! diameter = 6.0
//! offset = { Z = 52.3 }
//! ```
//!
//! All lengths in mm, in machine coordinates; an axis that is not named is zero.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use toml::Spanned;

use super::axes::{Axis, COORDINATE_LIMIT, Point};
use syncline_strict_toml::{Invalid, Log, Table};

/// The names of the work offsets, in the order of their numbers 1 to 9.
const WORK_OFFSETS: [&str; 9] = [
    "G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3",
];

/// What programs read and set beyond their own end. mm and degrees, machine coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tables {
    /// Origins of G54 … G59.3.
    pub work_offsets: [Point; 9],
    /// Where G28 goes.
    pub g28: Point,
    /// Where G30 goes.
    pub g30: Point,
    /// What G92 last set; in effect only from G92 or G92.3 to the end of the program.
    pub g92: Point,
    /// The tools by number.
    pub tools: BTreeMap<u32, Tool>,
}

/// A tool.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tool {
    /// What it is.
    pub name: String,
    /// What G43 adds to the axes: for a tool along Z its length.
    pub offset: Point,
    /// Its diameter, mm.
    pub diameter: f64,
}

/// A tables file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TablesError {
    /// It cannot be read.
    #[error("cannot read {}", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It cannot be written.
    #[error("cannot write {}", file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// It says what tables do not have.
    #[error(transparent)]
    Invalid(#[from] Invalid),
}

impl Tables {
    /// Where the tables of a machine file are: `portal.toml` has `portal.tables.toml`.
    pub fn beside(machine: &Path) -> PathBuf {
        machine.with_extension("tables.toml")
    }

    /// Reads a tables file; none at all is empty tables.
    ///
    /// # Errors
    /// The file cannot be read, or says what tables do not have.
    pub fn load(file: &Path) -> Result<Tables, TablesError> {
        match fs::read_to_string(file) {
            Ok(text) => Tables::parse(file, &text),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Tables::default()),
            Err(source) => Err(TablesError::Read {
                file: file.to_owned(),
                source,
            }),
        }
    }

    /// Reads tables from the text of `file`.
    ///
    /// # Errors
    /// Everything in the text that tables do not have.
    pub fn parse(file: &Path, text: &str) -> Result<Tables, TablesError> {
        let mut log = Log::new(text);
        let document = syncline_strict_toml::parse(&mut log, text);
        let mut tables = Tables::default();
        if log.is_empty() {
            let file = Table::new("tables file", 0..0, document.get_ref());
            tables.read(&mut log, file);
        }
        if log.is_empty() {
            return Ok(tables);
        }
        Err(Invalid {
            file: file.to_owned(),
            diagnostics: log.into_diagnostics(),
        }
        .into())
    }

    fn read(&mut self, log: &mut Log<'_>, mut file: Table<'_, '_>) {
        let work_offsets = file.table(log, "work_offsets", false);
        let reference_points = file.table(log, "reference_points", false);
        let tools = file.tables_if(log, "tool", "number");
        file.finish(log);
        if let Some(mut table) = work_offsets {
            for (name, offset) in WORK_OFFSETS.into_iter().zip(&mut self.work_offsets) {
                *offset = point(log, &mut table, name);
            }
            table.finish(log);
        }
        if let Some(mut table) = reference_points {
            self.g28 = point(log, &mut table, "G28");
            self.g30 = point(log, &mut table, "G30");
            self.g92 = point(log, &mut table, "G92");
            table.finish(log);
        }
        for mut table in tools {
            let number = table.integer(log, "number", 0..=u32::MAX.into(), "");
            let tool = Tool {
                name: table.text_or(log, "name", "", "a text", |_| true),
                diameter: (table
                    .number_if(log, "diameter", "a number from 0 on (mm)", |mm| mm >= 0.0))
                .map_or(0.0, Spanned::into_inner),
                offset: point(log, &mut table, "offset"),
            };
            let title = table.title.clone();
            table.finish(log);
            let Some(number) = number else { continue };
            // It is in the range of an u32.
            if (self.tools.insert(*number.get_ref() as u32, tool)).is_some() {
                log.report(
                    number.span(),
                    format!("{title} is there already"),
                    "allowed: each `number` once",
                );
            }
        }
    }

    /// Makes sure that a tables file could be replaced.
    ///
    /// # Errors
    /// The one beside it that would replace it cannot be written.
    pub fn probe(file: &Path) -> Result<(), TablesError> {
        let new = beside(file);
        let tried = File::create(&new).and_then(|_| fs::remove_file(&new));
        tried.map_err(|source| TablesError::Write { file: new, source })
    }

    /// Replaces a tables file by these tables at once: after a power cut the file is the old one or
    /// the new one.
    ///
    /// # Errors
    /// The file, or the one beside it that is to replace it, cannot be written.
    pub fn save(&self, file: &Path) -> Result<(), TablesError> {
        let text = toml::to_string(&Document::from(self)).map_err(io::Error::other);
        text.and_then(|text| replace(file, &text))
            .map_err(|source| TablesError::Write {
                file: file.to_owned(),
                source,
            })
    }
}

/// Where the file is written that is to replace a tables file.
fn beside(file: &Path) -> PathBuf {
    file.with_extension("toml.new")
}

fn replace(file: &Path, text: &str) -> io::Result<()> {
    let new = beside(file);
    let mut writer = File::create(&new)?;
    writer.write_all(
        b"# Work offsets, reference points and tools. Rewritten by programs that set them.\n\n",
    )?;
    writer.write_all(text.as_bytes())?;
    writer.sync_all()?;
    fs::rename(&new, file)?;
    // The rename itself is on disk only when the directory is.
    match file.parent() {
        Some(directory) if directory.as_os_str().is_empty() => File::open(".")?.sync_all(),
        Some(directory) => File::open(directory)?.sync_all(),
        None => Ok(()),
    }
}

/// Values by axis.
type Values = BTreeMap<Axis, f64>;

/// The file as it is written.
#[derive(Serialize)]
struct Document {
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    work_offsets: BTreeMap<String, Values>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    reference_points: BTreeMap<String, Values>,
    #[serde(rename = "tool", skip_serializing_if = "Vec::is_empty")]
    tools: Vec<ToolEntry>,
}

#[derive(Serialize)]
struct ToolEntry {
    number: u32,
    #[serde(skip_serializing_if = "String::is_empty")]
    name: String,
    diameter: f64,
    offset: Values,
}

impl From<&Tables> for Document {
    fn from(tables: &Tables) -> Document {
        let work_offsets = WORK_OFFSETS
            .into_iter()
            .zip(&tables.work_offsets)
            .filter(|(_, offset)| **offset != Point::ZERO)
            .map(|(name, offset)| (name.to_owned(), values(offset)))
            .collect();
        let reference_points = [
            ("G28", &tables.g28),
            ("G30", &tables.g30),
            ("G92", &tables.g92),
        ]
        .into_iter()
        .filter(|(_, reference)| **reference != Point::ZERO)
        .map(|(name, reference)| (name.to_owned(), values(reference)))
        .collect();
        let tools = tables
            .tools
            .iter()
            .map(|(number, tool)| ToolEntry {
                number: *number,
                name: tool.name.clone(),
                diameter: tool.diameter,
                offset: values(&tool.offset),
            })
            .collect();
        Document {
            work_offsets,
            reference_points,
            tools,
        }
    }
}

/// The point `key` of a table; zero without it.
fn point(log: &mut Log<'_>, table: &mut Table<'_, '_>, key: &'static str) -> Point {
    let mut point = Point::ZERO;
    let allowed = "axes with their positions: { X = 400.0, Z = -250.0 }";
    let Some(mut values) = table.table_if(log, key, allowed) else {
        return point;
    };
    values.title = format!("{}: {key}", table.title);
    if key == "G59" {
        for (part, name) in [("1", "G59.1"), ("2", "G59.2"), ("3", "G59.3")] {
            values.misread(log, part, &format!("\"{name}\", in quotes"));
        }
    }
    for axis in Axis::ALL {
        let (name, unit) = (axis.name(), axis.units()[0]);
        let allowed = format!("a number within ±{COORDINATE_LIMIT} ({unit})");
        let within = |value: f64| value.abs() <= COORDINATE_LIMIT;
        let value = values.number_if(log, name, &allowed, within);
        point[axis] = value.map_or(0.0, Spanned::into_inner);
    }
    values.finish(log);
    point
}

fn values(point: &Point) -> Values {
    Axis::ALL
        .into_iter()
        .map(|axis| (axis, point[axis]))
        .filter(|(_, value)| *value != 0.0)
        .collect()
}
