//! Changes a file's text before it is read: one value that somebody sets from outside.

use std::ops::Range;
use thiserror::Error;
use toml::de::{DeTable, DeValue};

/// Why a value cannot be set.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum SetError {
    /// It is no TOML.
    #[error(
        "`{0}` is no `KEY=VALUE` as TOML has it: axis.X.max_jerk=40000, machine.name=\"portal\""
    )]
    Form(String),
    /// There is no table of that name in a list of tables.
    #[error("`{setting}`: there is no {list} \"{name}\"")]
    NoSuchName {
        /// What was to be set.
        setting: String,
        /// The list.
        list: String,
        /// The name that none in it has.
        name: String,
    },
    /// The key leads to a table.
    #[error(
        "`{0}`: that is a table: name the key in it that is to be set, as in axis.X.max_jerk=40000"
    )]
    Table(String),
    /// The file is no TOML, or a key of the path has a value that is no table.
    #[error("`{0}` cannot be set in this file: write it there")]
    NoPlace(String),
}

/// The text with a value set, `KEY=VALUE` as TOML has it. The key leads through tables; in a list of tables the next
/// part of it is the `name` of one: `axis.X.max_jerk=40000`, `input."home X1".debounce_ms=5`. What is there is
/// replaced, what is not is added.
///
/// # Errors
/// If it is no TOML, or has no place in the text.
///
/// ```
/// use syncline_strict_toml::set;
///
/// let text = "[[axis]]\nname = \"X\"\nmax_jerk = 1.0\n";
/// assert_eq!(set(text, "axis.X.max_jerk=40000")?, "[[axis]]\nname = \"X\"\nmax_jerk = 40000\n");
/// assert_eq!(
///     set(text, "path.blend_tolerance = 0.02")?,
///     format!("{text}\n[path]\nblend_tolerance = 0.02\n")
/// );
/// # Ok::<(), syncline_strict_toml::SetError>(())
/// ```
pub fn set(source: &str, setting: &str) -> Result<String, SetError> {
    let form = || SetError::Form(setting.to_owned());
    let no_place = || SetError::NoPlace(setting.to_owned());
    let wanted = DeTable::parse(setting).map_err(|_| form())?;
    let (path, value) = leaf(wanted.get_ref(), setting).ok_or_else(form)?;
    let document = DeTable::parse(source).map_err(|_| no_place())?;
    let mut table = document.get_ref();
    let mut path = &path[..];
    let mut way = Way::default();
    while let [key, rest @ ..] = path
        && let Some((found_key, found)) = table.get_key_value(key.0.as_str())
    {
        path = rest;
        way.header = found_key.span();
        way.tables.push(&key.1);
        table = match (found.get_ref(), rest) {
            (found_there, []) => {
                let is_in_braces = source
                    .get(found.span())
                    .is_some_and(|it| it.starts_with('{'));
                let is_table = found_there.as_table().is_some() && !is_in_braces;
                // Its keys stand in lines of their own.
                if is_table || is_in_header(source, found_key.span().start) {
                    return Err(SetError::Table(setting.to_owned()));
                }
                return Ok(replaced(source, found.span(), value));
            }
            (DeValue::Table(table), _) => table,
            (DeValue::Array(items), [name, rest @ ..]) => {
                path = rest;
                way.is_in_list = true;
                let mut tables = items.iter().filter_map(|item| item.get_ref().as_table());
                let named = tables.find(|table| {
                    let own = table.get("name").map(|own| own.get_ref().as_str());
                    own == Some(Some(&name.0))
                });
                named.ok_or_else(|| SetError::NoSuchName {
                    setting: setting.to_owned(),
                    list: key.0.clone(),
                    name: name.0.clone(),
                })?
            }
            _ => return Err(no_place()),
        };
    }
    if path.is_empty() {
        return Err(SetError::Table(setting.to_owned()));
    }
    let text = added(source, &way, table, path, value).ok_or_else(no_place)?;
    // Where the place that was found is none.
    DeTable::parse(&text).map_err(|_| no_place())?;
    Ok(text)
}

/// How a key leads to a table.
#[derive(Debug, Default)]
struct Way<'s> {
    /// The tables on it, as they are written.
    tables: Vec<&'s str>,
    /// One of them is of a list.
    is_in_list: bool,
    /// Where the last one is named.
    header: Range<usize>,
}

/// A part of a key: its name, and how it is written.
type Part = (String, String);

/// The only value of a document, with the parts of its key.
fn leaf<'s>(document: &DeTable<'_>, source: &'s str) -> Option<(Vec<Part>, &'s str)> {
    let (mut path, mut table) = (Vec::new(), document);
    loop {
        let mut entries = table.iter();
        let (key, value) = entries.next()?;
        let None = entries.next() else {
            return None;
        };
        let written = source.get(key.span())?;
        path.push((key.get_ref().to_string(), written.to_owned()));
        match value.get_ref() {
            // One in braces is a value.
            DeValue::Table(inner) if !source.get(value.span())?.starts_with('{') => table = inner,
            _ => return Some((path, source.get(value.span())?)),
        }
    }
}

fn replaced(source: &str, place: Range<usize>, value: &str) -> String {
    let (before, behind) = (&source[..place.start], &source[place.end..]);
    format!("{before}{value}{behind}")
}

/// The text with what is left of a key in a table of it; `None` where that has no place to add it to.
fn added(
    source: &str,
    way: &Way<'_>,
    table: &DeTable<'_>,
    path: &[Part],
    value: &str,
) -> Option<String> {
    let written: Vec<&str> = path.iter().map(|(_, written)| &written[..]).collect();
    let key = written.join(".");
    let keys = table.iter().map(|(key, _)| key.span().start);
    let first = keys.filter(|at| !is_in_header(source, *at)).min();
    let Some(first) = first.filter(|_| !way.tables.is_empty()) else {
        if table.is_empty() && !way.tables.is_empty() {
            return added_to_empty(source, way, &key, value);
        }
        // Nothing of it stands in a table of its own: that is at the top, or named by the headers of others alone.
        let (last, tables) = written.split_last()?;
        let tables = [&way.tables, tables].concat();
        return match &tables[..] {
            _ if way.is_in_list => None,
            [] => Some(format!("{last} = {value}\n{source}")),
            _ => Some(format!(
                "{source}\n[{}]\n{last} = {value}\n",
                tables.join(".")
            )),
        };
    };
    // In front of its first key, which may not be that of a table of its own.
    let before = source.get(..first)?;
    let line = line_of(source, first);
    // What leads there in the key itself: `simulation.` of `simulation.load = 2`.
    let opened = before[line..].rfind(['{', ',']);
    let begin = opened.map_or(line, |opened| line + opened + 1);
    let leads = before[begin..].trim_start();
    if !(leads.is_empty() || leads.trim_end().ends_with('.')) {
        return None;
    }
    let written = format!("{leads}{key} = {value}");
    Some(match opened {
        None => replaced(source, line..line, &format!("{written}\n")),
        Some(_) => replaced(source, begin..begin, &format!(" {written},")),
    })
}

/// The same where the table has no key: behind its header, or in its braces.
fn added_to_empty(source: &str, way: &Way<'_>, key: &str, value: &str) -> Option<String> {
    let behind = source.get(way.header.end..)?;
    let (at, text) = if is_in_header(source, way.header.start) {
        let end = behind.find('\n').unwrap_or(behind.len());
        (end, format!("\n{key} = {value}"))
    } else {
        (behind.find('{')? + 1, format!(" {key} = {value} "))
    };
    let at = way.header.end + at;
    Some(replaced(source, at..at, &text))
}

/// Where the line begins.
fn line_of(source: &str, at: usize) -> usize {
    source[..at].rfind('\n').map_or(0, |newline| newline + 1)
}

/// Whether a name stands in the header of a table.
fn is_in_header(source: &str, at: usize) -> bool {
    let before = source[line_of(source, at)..at].trim_start();
    before.starts_with('[') && !before.contains(['{', '='])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TEXT: &str = "top = 1\n\n[machine]\nname = \"m\"  # é\n\n[[axis]]\nname = \"X\"\nmax = 1.5\n\
                        simulation = { load = 2.0 }\n\n[[axis]]\nname = \"the Y\"\n\n[axis.simulation]\nload = 3\n\n\
                        [model.tlc]\nlag = 1\n\n[[simulation.workpiece]]\nname = \"w\"\n\n[probing]\n\n\
                        [model.empty]  # { none }\n\n[braces]\none = {}\n";

    /// Settings, and where they lead in the text's tables.
    const SETTINGS: [(&str, &str); 27] = [
        ("top=2", "top"),
        ("new = 'a'", "new"),
        ("machine.name=\"n\"", "machine.name"),
        ("machine.cycle_us=2000", "machine.cycle_us"),
        ("path.exact=0.1", "path.exact"),
        ("model.lxm32m.delay=2", "model.lxm32m.delay"),
        ("model.tsp.delay=5", "model.tsp.delay"),
        ("model.tsp.lag=6", "model.tsp.lag"),
        ("model.empty.delay=5", "model.empty.delay"),
        ("model.tlc.lag=2", "model.tlc.lag"),
        ("simulation.ball=3", "simulation.ball"),
        ("probing.over=2", "probing.over"),
        ("braces.one.key='b'", "braces.one.key"),
        ("braces.one.two.key=7", "braces.one.two.key"),
        ("axis.X.max=9e3", "axis.0.max"),
        ("axis.X.min=[1, 2]", "axis.0.min"),
        ("axis.X.simulation.load=9", "axis.0.simulation.load"),
        ("axis.X.simulation.play=9", "axis.0.simulation.play"),
        ("axis.\"the Y\".simulation.load=9", "axis.1.simulation.load"),
        ("axis.\"the Y\".simulation.play=9", "axis.1.simulation.play"),
        ("axis.\"the Y\".homing.kind='a'", "axis.1.homing.kind"),
        ("axis.\"the Y\".homing.speed=3", "axis.1.homing.speed"),
        ("axis.X.homing.a.b='c'", "axis.0.homing.a.b"),
        ("axis.X.homing.a.d=[4]", "axis.0.homing.a.d"),
        ("axis.X.homing.kind='e'", "axis.0.homing.kind"),
        (
            "axis.X.simulation.gantry.beam=1.5",
            "axis.0.simulation.gantry.beam",
        ),
        (
            "axis.X.simulation.gantry.mass=7",
            "axis.0.simulation.gantry.mass",
        ),
    ];

    proptest! {
        /// Each in turn, however many: the text has them all, and all else as it was.
        #[test]
        fn values_are_replaced_or_added_where_their_keys_lead(
            settings in prop::collection::vec(prop::sample::select(&SETTINGS[..]), 1..12),
        ) {
            let mut text = TEXT.to_owned();
            let mut expected: toml::Value = toml::Value::Table(TEXT.parse().unwrap());
            for (setting, place) in settings {
                text = set(&text, setting).unwrap();
                let mut at = &mut expected;
                for part in place.split('.') {
                    at = match at {
                        toml::Value::Array(items) => &mut items[part.parse::<usize>().unwrap()],
                        toml::Value::Table(table) => table
                            .entry(part)
                            .or_insert(toml::Value::Table(toml::Table::new())),
                        other => panic!("{setting}: {other}"),
                    };
                }
                let (_, value) = setting.split_once('=').unwrap();
                *at = value.trim().parse().unwrap();
                prop_assert_eq!(&toml::Value::Table(text.parse().unwrap()), &expected, "{}", text);
            }
        }
    }

    #[test]
    fn what_cannot_be_set_is_refused() {
        for (setting, why) in [
            ("axis.X.max", "no `KEY=VALUE`"),
            ("axis.X.max=", "no `KEY=VALUE`"),
            ("a=1\nb=2", "no `KEY=VALUE`"),
            ("axis.Z.max=1", "there is no axis \"Z\""),
            ("top.max=1", "cannot be set"),
            ("axis.X=1", "that is a table"),
            ("axis.X.max.most=1", "cannot be set"),
        ] {
            let error = set(TEXT, setting).unwrap_err().to_string();
            assert!(error.contains(why), "{setting}: {error}");
        }
        // Tables whose keys stand in lines of their own.
        for text in [
            "[axis]\nX.max = 1\n[axis.X.simulation]\nload = 2\n",
            "[[axis]]\nname = \"X\"\nsimulation.load = 2\n",
            "[[axis]]\nname = \"X\"\n[axis.simulation]\nload = 2\n",
            "[[axis]]\nname = \"X\"\n[[axis.simulation]]\nload = 2\n",
        ] {
            let error = set(text, "axis.X.simulation={ load = 3 }").unwrap_err();
            assert!(matches!(error, SetError::Table(_)), "{text}: {error}");
        }
        assert!(
            set("no toml", "a=1")
                .unwrap_err()
                .to_string()
                .contains("cannot be set")
        );
    }
}
