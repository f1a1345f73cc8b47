//! Writes what a program has set into the tables file as it is now.
//!
//! The file is a person's, and perhaps another run's: it is read again, comments, order and layout
//! stay, and only values that the program has set are written, be they others than at the start or
//! the same. One that somebody else has changed meanwhile is nobody's to choose: then nothing is
//! written, and the error names it.
//! A lock on the folder keeps two runs from doing this at once; the file is replaced as a whole, so
//! that after a power cut it is the old one or the new one.

use super::{ROTATION, Tables, TablesError, WORK_OFFSETS, read};
use crate::Interpreter;
use crate::axes::{AxisLetter, Point};
use crate::modal::to_the_millionth;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use syncline_strict_toml::replace::{beside, create, folder, replace};
use toml_edit::{ArrayOfTables, DocumentMut, InlineTable, Item, Table, TableLike, Value};

/// The head of a file that was not there.
const HEAD: &str =
    "# Work offsets, reference points and tools. Programs that set them write here.\n";

/// Makes sure that `file` could be replaced.
pub(super) fn probe(file: &Path) -> Result<(), TablesError> {
    let file = real(file);
    let new = beside(&file);
    let tried = lock(&file).and_then(|_lock| {
        create(&new)?;
        fs::remove_file(&new)
    });
    tried.map_err(|source| TablesError::Write { file: new, source })
}

impl Interpreter {
    /// Writes what the program has set in its [`tables`](Self::tables), which were `since` at its start, into their file: also
    /// what it has set to the value that was there. All else stays in the file as it is now. The file is replaced at once: after a
    /// power cut it is the old one or the new one.
    ///
    /// # Errors
    /// Somebody else has changed one of these values; the file cannot be read, or it, or the one beside it that is to
    /// replace it, cannot be written.
    pub fn save_tables(&self, file: &Path, since: &Tables) -> Result<(), TablesError> {
        let mut changes = Changes::between(since, self.tables(), &self.state.set);
        if changes.set.is_empty() {
            return Ok(());
        }
        let file = &real(file);
        let cannot_write = |source| TablesError::Write {
            file: file.to_owned(),
            source,
        };
        let _lock = lock(file).map_err(cannot_write)?;
        let text = read(file)?.unwrap_or_else(|| HEAD.to_owned());
        let now = Tables::parse(file, &text)?;
        let broken = |error| cannot_write(io::Error::other(error));
        let mut document: DocumentMut = text.parse().map_err(broken)?;
        let there = Changes::values(&now);
        changes.check(file, &there)?;
        changes.leave_out(&there);
        changes.write(&mut document);
        match document.to_string() {
            same if same == text => Ok(()),
            changed => replace(file, &changed).map_err(cannot_write),
        }
    }
}

/// Values of tables that a program has set, be they others than before or the same.
#[derive(Clone, Debug, Default)]
pub(crate) struct Places(BTreeSet<(Row, Column)>);

impl Places {
    /// An axis of a work offset, 0 for G54.
    pub(crate) fn work(&mut self, index: usize, axis: AxisLetter) {
        self.0
            .insert((Row::Work(WORK_OFFSETS[index]), Column::Axis(axis)));
    }

    /// By how much a work offset is turned.
    pub(crate) fn rotation(&mut self, index: usize) {
        self.0
            .insert((Row::Work(WORK_OFFSETS[index]), Column::Rotation));
    }

    /// An axis of `G28`, `G30` or `G92`.
    pub(crate) fn reference(&mut self, name: &'static str, axis: AxisLetter) {
        self.0.insert((Row::Reference(name), Column::Axis(axis)));
    }

    /// An axis of a tool.
    pub(crate) fn tool(&mut self, number: u32, axis: AxisLetter) {
        self.0.insert((Row::Tool(number), Column::Axis(axis)));
    }

    /// The diameter of a tool.
    pub(crate) fn diameter(&mut self, number: u32) {
        self.0.insert((Row::Tool(number), Column::Diameter));
    }
}

/// The file itself where `file` is a link to it.
fn real(file: &Path) -> PathBuf {
    let target = file.is_symlink().then(|| fs::canonicalize(file).ok());
    target.flatten().unwrap_or_else(|| file.to_owned())
}

/// Keeps other runs out of the folder's tables until the value goes.
fn lock(file: &Path) -> io::Result<File> {
    let folder = File::open(folder(file))?;
    folder.lock()?;
    Ok(folder)
}

/// What a value belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Row {
    Work(&'static str),
    Reference(&'static str),
    Tool(u32),
}

/// Which of its values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Column {
    Diameter,
    Rotation,
    Axis(AxisLetter),
}

/// As a person names the value: `G54 X`, `tool 3 diameter`.
struct Place(Row, Column);

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Row::Work(name) | Row::Reference(name) => f.write_str(name)?,
            Row::Tool(number) => write!(f, "tool {number}")?,
        }
        match self.1 {
            Column::Axis(axis) => write!(f, " {}", axis.name()),
            Column::Diameter => f.write_str(" diameter"),
            Column::Rotation => write!(f, " {ROTATION}"),
        }
    }
}

/// Values by their places; zeros of axes are left out.
type Values = BTreeMap<(Row, Column), f64>;

/// What a program has set.
struct Changes<'a> {
    before: Values,
    set: Values,
    /// Names of new tools.
    names: BTreeMap<u32, &'a str>,
}

impl<'a> Changes<'a> {
    fn between(before: &Tables, after: &'a Tables, explicit: &Places) -> Self {
        let new = after.tools.iter();
        let new = new
            .filter(|(number, tool)| !before.tools.contains_key(number) && !tool.name.is_empty());
        let names = new.map(|(&number, tool)| (number, &*tool.name)).collect();
        let (before, after) = (Self::values(before), Self::values(after));
        let set = after
            .iter()
            .filter(|(place, value)| before.get(place) != Some(value));
        // What is gone has become zero.
        let gone = before.keys().filter(|place| !after.contains_key(place));
        let gone = gone.map(|&place| (place, 0.0));
        let set = set.map(|(&place, &value)| (place, value)).chain(gone);
        let value = |place| after.get(place).copied().unwrap_or(0.0);
        let explicit = explicit.0.iter().map(|place| (*place, value(place)));
        let set = set.chain(explicit).collect();
        Self { before, set, names }
    }

    /// All values of tables, without the dust of arithmetic below a millionth of a mm or degree. A tool has its
    /// diameter always, so that it is seen to be there.
    fn values(tables: &Tables) -> Values {
        let mut values = Values::new();
        let mut put_one = |row, column, value: f64| {
            let value = to_the_millionth(value);
            if value != 0.0 {
                values.insert((row, column), value);
            }
        };
        for (name, &degrees) in WORK_OFFSETS.into_iter().zip(&tables.rotations) {
            put_one(Row::Work(name), Column::Rotation, degrees);
        }
        let mut put = |row, point: &Point| {
            for axis in AxisLetter::ALL {
                put_one(row, Column::Axis(axis), point[axis]);
            }
        };
        for (name, offset) in WORK_OFFSETS.into_iter().zip(&tables.work_offsets) {
            put(Row::Work(name), offset);
        }
        for (name, point) in [
            ("G28", &tables.g28),
            ("G30", &tables.g30),
            ("G92", &tables.g92),
        ] {
            put(Row::Reference(name), point);
        }
        for (&number, tool) in &tables.tools {
            put(Row::Tool(number), &tool.offset);
        }
        let diameters = tables.tools.iter();
        values.extend(
            diameters.map(|(&number, tool)| ((Row::Tool(number), Column::Diameter), tool.diameter)),
        );
        values
    }

    /// Whether all that is to be changed still is as it was, or already as it is to be.
    fn check(&self, file: &Path, now: &Values) -> Result<(), TablesError> {
        let value = |values: &Values, place| values.get(place).copied().unwrap_or(0.0);
        for (place, &set) in &self.set {
            let (was, is) = (value(&self.before, place), value(now, place));
            if is != was && is != set {
                return Err(TablesError::Changed {
                    file: file.to_owned(),
                    place: Place(place.0, place.1).to_string(),
                    was,
                    is,
                    set,
                });
            }
        }
        Ok(())
    }

    /// Leaves out what the file has already, zeros of what it does not name among it.
    fn leave_out(&mut self, there: &Values) {
        self.set.retain(|place, value| match there.get(place) {
            Some(is) => is != value,
            None => *value != 0.0 || place.1 == Column::Diameter,
        });
    }

    fn write(&self, document: &mut DocumentMut) {
        let there: Vec<String> = document.iter().map(|(key, _)| key.to_owned()).collect();
        for (&(row, column), &value) in &self.set {
            let Some(table) = table_of(document, row) else {
                continue;
            };
            if let Row::Tool(number) = row
                && let Some(&name) = self.names.get(&number)
            {
                table.insert("name", toml_edit::value(name));
            }
            match (row, column) {
                (_, Column::Diameter) => put(table, "diameter", value),
                (Row::Tool(_), Column::Axis(axis)) => {
                    if let Some(offset) = child(table, "offset", inline()) {
                        put(offset, axis.name(), value);
                    }
                }
                (_, Column::Rotation) => put(table, ROTATION, value),
                (_, Column::Axis(axis)) => put(table, axis.name(), value),
            }
        }
        // What stood last, such as a comment, stays before a table that is new.
        let last = document.trailing().as_str().unwrap_or_default().to_owned();
        let new = (document.iter_mut()).find(|(key, _)| there.iter().all(|it| it != key.get()));
        let decor = new.and_then(|(_, item)| match item {
            Item::Table(table) => Some(table.decor_mut()),
            Item::ArrayOfTables(tables) => tables.get_mut(0).map(Table::decor_mut),
            _ => None,
        });
        if let Some(decor) = decor {
            let gap = if last.is_empty() && there.is_empty() {
                ""
            } else {
                "\n"
            };
            decor.set_prefix(last + gap);
            document.set_trailing("");
        }
    }
}

fn inline() -> Item {
    Item::Value(InlineTable::new().into())
}

/// The table `key` of a table, made of `new` if there is none; `None` if it is something else,
/// which a tables file that was read does not have.
fn child<'a>(table: &'a mut dyn TableLike, key: &str, new: Item) -> Option<&'a mut dyn TableLike> {
    table.entry(key).or_insert(new).as_table_like_mut()
}

/// The table of a row's values, made if there is none.
fn table_of(document: &mut Table, row: Row) -> Option<&mut dyn TableLike> {
    match row {
        Row::Work(name) => child(
            child(document, "work_offsets", Item::Table(Table::new()))?,
            name,
            inline(),
        ),
        Row::Reference(name) => child(
            child(document, "reference_points", Item::Table(Table::new()))?,
            name,
            inline(),
        ),
        Row::Tool(number) => tool(document, number),
    }
}

/// The table of a tool: of `[[tool]]`, or in an array.
fn tool(document: &mut Table, number: u32) -> Option<&mut dyn TableLike> {
    let is = |table: &dyn TableLike| {
        table.get("number").and_then(Item::as_integer) == Some(number.into())
    };
    let none = Item::ArrayOfTables(ArrayOfTables::new());
    match document.entry("tool").or_insert(none) {
        Item::ArrayOfTables(tools) => {
            let place = tools.iter().position(|table| is(table));
            if place.is_none() {
                let mut table = Table::new();
                table.insert("number", toml_edit::value(i64::from(number)));
                tools.push(table);
            }
            let tool = tools.get_mut(place.unwrap_or(tools.len() - 1));
            tool.map(|table| table as &mut dyn TableLike)
        }
        Item::Value(Value::Array(tools)) => {
            let is = |value: &Value| value.as_inline_table().is_some_and(|table| is(table));
            let place = tools.iter().position(is);
            if place.is_none() {
                let mut table = InlineTable::new();
                table.insert("number", i64::from(number).into());
                tools.push(table);
            }
            let tool = tools.get_mut(place.unwrap_or(tools.len() - 1));
            let tool = tool.and_then(Value::as_inline_table_mut);
            tool.map(|table| table as &mut dyn TableLike)
        }
        _ => None,
    }
}

/// Sets a number in its place; a new one comes last, and zero is not worth a place of its own but
/// for a tool's diameter.
fn put(table: &mut dyn TableLike, key: &str, number: f64) {
    if let Some(value) = table.get_mut(key).and_then(Item::as_value_mut) {
        let decor = value.decor().clone();
        *value = number.into();
        *value.decor_mut() = decor;
    } else if number != 0.0 || key == "diameter" {
        table.insert(key, toml_edit::value(number));
        // A table on one line: gaps as they are usual.
        table.fmt();
    }
}
