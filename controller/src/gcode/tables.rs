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

use serde::{Deserialize, Serialize};

use super::axes::{Axis, COORDINATE_LIMIT, Point};

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
    /// It cannot be read or written.
    #[error("{}: {reason}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: io::Error,
    },
    /// Its text is wrong; the message shows line, column and what is allowed.
    #[error("{}: {reason}{remedy}", file.display())]
    Text {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        reason: Box<toml::de::Error>,
        /// What to do, where that is known.
        remedy: &'static str,
    },
    /// Its values are wrong.
    #[error("{}: {fault}", file.display())]
    Values {
        /// The file.
        file: PathBuf,
        /// What is wrong and what to do.
        fault: String,
    },
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
            Err(reason) => Err(TablesError::Io {
                file: file.to_owned(),
                reason,
            }),
        }
    }

    /// Reads tables from the text of `file`.
    ///
    /// # Errors
    /// The text says what tables do not have.
    pub fn parse(file: &Path, text: &str) -> Result<Tables, TablesError> {
        let document: Document = toml::from_str(text).map_err(|error| TablesError::Text {
            file: file.to_owned(),
            remedy: if ["`1`", "`2`", "`3`"]
                .iter()
                .any(|part| error.message().contains(part))
            {
                "a name with a point stands in quotes: \"G59.3\""
            } else {
                ""
            },
            reason: Box::new(error),
        })?;
        document.into_tables().map_err(|fault| TablesError::Values {
            file: file.to_owned(),
            fault,
        })
    }

    /// Replaces a tables file by these tables at once: after a power cut the file is the old one or
    /// the new one.
    ///
    /// # Errors
    /// The file, or the one beside it that is to replace it, cannot be written.
    pub fn save(&self, file: &Path) -> Result<(), TablesError> {
        let text = toml::to_string(&Document::from(self)).map_err(|error| TablesError::Values {
            file: file.to_owned(),
            fault: error.to_string(),
        })?;
        replace(file, &text).map_err(|reason| TablesError::Io {
            file: file.to_owned(),
            reason,
        })
    }
}

fn replace(file: &Path, text: &str) -> io::Result<()> {
    let new = file.with_extension("toml.new");
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
#[derive(Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct Document {
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    work_offsets: BTreeMap<String, Values>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    reference_points: BTreeMap<String, Values>,
    #[serde(rename = "tool", skip_serializing_if = "Vec::is_empty")]
    tools: Vec<ToolEntry>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ToolEntry {
    number: u32,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    name: String,
    #[serde(default)]
    diameter: f64,
    #[serde(default)]
    offset: Values,
}

impl Document {
    fn into_tables(self) -> Result<Tables, String> {
        let mut tables = Tables::default();
        for (name, values) in self.work_offsets {
            let index = WORK_OFFSETS.iter().position(|known| *known == name);
            let Some(offset) = index.and_then(|index| tables.work_offsets.get_mut(index)) else {
                return Err(format!(
                    "work_offsets.{name} is no work offset: use one of {}",
                    WORK_OFFSETS.join(", ")
                ));
            };
            *offset = point(&format!("work_offsets.{name}"), &values)?;
        }
        for (name, values) in self.reference_points {
            let reference = match name.as_str() {
                "G28" => &mut tables.g28,
                "G30" => &mut tables.g30,
                "G92" => &mut tables.g92,
                _ => {
                    return Err(format!(
                        "reference_points.{name} is no reference point: use G28, G30 or G92"
                    ));
                }
            };
            *reference = point(&format!("reference_points.{name}"), &values)?;
        }
        for entry in self.tools {
            let number = entry.number;
            if !(entry.diameter >= 0.0 && entry.diameter.is_finite()) {
                return Err(format!(
                    "tool {number}: the diameter has to be 0 mm or more"
                ));
            }
            let tool = Tool {
                name: entry.name,
                offset: point(&format!("tool {number}: offset"), &entry.offset)?,
                diameter: entry.diameter,
            };
            if tables.tools.insert(number, tool).is_some() {
                return Err(format!(
                    "tool {number} is there twice: give each its own number"
                ));
            }
        }
        Ok(tables)
    }
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

fn point(what: &str, values: &Values) -> Result<Point, String> {
    let mut point = Point::ZERO;
    for (axis, value) in values {
        if value.is_nan() || value.abs() > COORDINATE_LIMIT {
            return Err(format!(
                "{what}.{axis} has to be a number within ±{COORDINATE_LIMIT}"
            ));
        }
        point[*axis] = *value;
    }
    Ok(point)
}

fn values(point: &Point) -> Values {
    Axis::ALL
        .into_iter()
        .map(|axis| (axis, point[axis]))
        .filter(|(_, value)| *value != 0.0)
        .collect()
}
