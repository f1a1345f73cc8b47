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
//! diameter_wear = -0.02
//! offset = { Z = 52.3 }
//! ```
//!
//! All lengths in mm, in machine coordinates; an axis that is not named is zero. R of a work offset are the degrees by
//! which its X and Y are turned, counterclockwise.

mod save;

pub(crate) use save::Places;

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use toml::Spanned;

use super::axes::{AxisLetter, COORDINATE_LIMIT, Point};
use super::coordinates::{ROTATION_LIMIT, WorkCoordinates, sum};
use syncline_strict_toml::{Invalid, Log, Table};

/// The greatest number of a tool.
pub(crate) const MOST_TOOLS: u32 = 99_999;

/// The names of the work offsets, in the order of their numbers 1 to 9.
const WORK_OFFSETS: [&str; 9] = [
    "G54", "G55", "G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3",
];

/// The key of how a work offset's X and Y are turned, as G10's word.
const ROTATION: &str = "R";

/// What programs read and set beyond their own end. mm and degrees, machine coordinates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tables {
    /// Origins of G54 … G59.3.
    pub work_offsets: [Point; 9],
    /// By how much X and Y of each are turned about its origin, degrees, counterclockwise.
    pub rotations: [f64; 9],
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
    /// Its diameter, mm. One below zero compensates on the other side of the contour.
    pub diameter: f64,
    /// What its diameter has gained, mm: below zero for a tool that has worn.
    pub diameter_wear: f64,
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
    /// Somebody else has set what the program set, since the program began.
    #[error(
        "{}: {place} was {was} at the start, is {is} now, and the program sets {set}: \
         none of what the program set is written; set it by hand", file.display()
    )]
    Changed {
        /// The file.
        file: PathBuf,
        /// Which value, as `G54 X`.
        place: String,
        /// Its value at the start.
        was: f64,
        /// Its value now.
        is: f64,
        /// What the program set.
        set: f64,
    },
    /// It says what tables do not have.
    #[error(transparent)]
    Invalid(#[from] Invalid),
}

impl Tables {
    /// The coordinates of a work offset (0 is G54), with the shift of G92 or without, and a tool's
    /// offset.
    pub(crate) fn coordinates(
        &self,
        work_offset: usize,
        g92: bool,
        tool: Point,
    ) -> WorkCoordinates {
        let mut coordinates = WorkCoordinates {
            origin: self.work_offsets[work_offset],
            rotation: self.rotations[work_offset],
        };
        if g92 {
            coordinates.origin = coordinates.to_machine(self.g92);
        }
        coordinates.origin = sum(coordinates.origin, tool);
        coordinates
    }

    /// Where the tables of a machine file are: `portal.toml` has `portal.tables.toml`.
    pub fn beside(machine: &Path) -> PathBuf {
        machine.with_extension("tables.toml")
    }

    /// Reads a tables file; none at all is empty tables.
    ///
    /// # Errors
    /// The file cannot be read, or says what tables do not have.
    pub fn load(file: &Path) -> Result<Tables, TablesError> {
        match read(file)? {
            Some(text) => Tables::parse(file, &text),
            None => Ok(Tables::default()),
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
            let rows = self.work_offsets.iter_mut().zip(&mut self.rotations);
            for (name, (offset, rotation)) in WORK_OFFSETS.into_iter().zip(rows) {
                if let Some(mut values) = row(log, &mut table, name) {
                    *offset = point(log, &mut values);
                    *rotation = angle(log, &mut values, ROTATION);
                    values.finish(log);
                }
            }
            table.finish(log);
        }
        if let Some(mut table) = reference_points {
            self.g28 = place(log, &mut table, "G28");
            self.g30 = place(log, &mut table, "G30");
            self.g92 = place(log, &mut table, "G92");
            table.finish(log);
        }
        for mut table in tools {
            let number =
                table.integer(log, "number", 1..=MOST_TOOLS.into(), " (T, H and G10 L1 P)");
            let tool = Tool {
                name: table.text_or(log, "name", "", "a text", |_| true),
                diameter: length(log, &mut table, "diameter"),
                diameter_wear: length(log, &mut table, "diameter_wear"),
                offset: place(log, &mut table, "offset"),
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
        save::probe(file)
    }
}

/// The text of a tables file, if there is one.
fn read(file: &Path) -> Result<Option<String>, TablesError> {
    match syncline_strict_toml::read(file) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        text => text.map(Some).map_err(|source| TablesError::Read {
            file: file.to_owned(),
            source,
        }),
    }
}

/// The length `key` of a table, mm; zero without it.
fn length(log: &mut Log<'_>, table: &mut Table<'_, '_>, key: &'static str) -> f64 {
    let allowed = format!("a number within ±{COORDINATE_LIMIT} (mm)");
    let within = |mm: f64| mm.abs() <= COORDINATE_LIMIT;
    (table.number_if(log, key, &allowed, within)).map_or(0.0, Spanned::into_inner)
}

/// The angle `key` of a table, degrees; zero without it.
fn angle(log: &mut Log<'_>, table: &mut Table<'_, '_>, key: &'static str) -> f64 {
    let allowed = format!("a number within ±{ROTATION_LIMIT} (°)");
    let within = |degrees: f64| degrees.abs() <= ROTATION_LIMIT;
    (table.number_if(log, key, &allowed, within)).map_or(0.0, Spanned::into_inner)
}

/// The row `key` of a table, if it is there.
fn row<'t, 'd>(
    log: &mut Log<'_>,
    table: &mut Table<'t, 'd>,
    key: &'static str,
) -> Option<Table<'t, 'd>> {
    let allowed = "axes with their positions: { X = 400.0, Z = -250.0 }";
    let mut values = table.table_if(log, key, allowed)?;
    values.title = format!("{}: {key}", table.title);
    if key == "G59" {
        for (part, name) in [("1", "G59.1"), ("2", "G59.2"), ("3", "G59.3")] {
            values.misread(log, part, &format!("\"{name}\", in quotes"));
        }
    }
    Some(values)
}

/// The point of the row `key` of a table; zero without it.
fn place(log: &mut Log<'_>, table: &mut Table<'_, '_>, key: &'static str) -> Point {
    let Some(mut values) = row(log, table, key) else {
        return Point::ZERO;
    };
    let place = point(log, &mut values);
    values.finish(log);
    place
}

/// The point that a row's axes give; zero where it names none.
fn point(log: &mut Log<'_>, values: &mut Table<'_, '_>) -> Point {
    let mut point = Point::ZERO;
    for axis in AxisLetter::ALL {
        let (name, unit) = (axis.name(), axis.units()[0]);
        let allowed = format!("a number within ±{COORDINATE_LIMIT} ({unit})");
        let within = |value: f64| value.abs() <= COORDINATE_LIMIT;
        let value = values.number_if(log, name, &allowed, within);
        point[axis] = value.map_or(0.0, Spanned::into_inner);
    }
    point
}
