//! Names of a machine file: each is one thing's, and leads to what it names. They are looked at in the text itself, whatever else
//! is wrong with the tables that have them, so that a person hears of both at once.

use super::read::{unique, unknown};
use syncline_strict_toml::{Log, nearest};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Keys by which names are given and used. Where the line of one is no TOML nobody knows what leads nowhere.
pub(super) const KEYS: &[&str] = &["name", "bus", "drives", "drive", "io"];

/// Reports every name that is taken, a bus and a drive that is named and is not there, and a drive that is not moved by
/// exactly one thing.
pub(super) fn check(log: &mut Log<'_>, document: &DeTable<'_>) {
    for kind in ["bus", "drive", "encoder", "io", "axis", "input", "output"] {
        unique(
            log,
            kind,
            rows(document, kind)
                .filter_map(name)
                .collect::<Vec<_>>()
                .iter(),
        );
    }
    for kind in ["drive", "encoder", "io"] {
        check_uses(log, document, kind, "bus", "bus");
    }
    for kind in ["input", "output"] {
        check_uses(log, document, kind, "drive", "drive");
        check_uses(log, document, kind, "io", "io");
    }
    if let Some(drives) = all(document, "drive") {
        check_drives(log, document, &drives);
    }
}

/// Whether what tables `[[kind]]` name by a key is there.
fn check_uses(log: &mut Log<'_>, document: &DeTable<'_>, kind: &str, key: &str, used: &str) {
    let Some(names) = all(document, used) else {
        return;
    };
    for row in rows(document, kind) {
        if let (Some(user), Some(other)) = (name(row), row.get(key).and_then(text)) {
            let title = format!("{kind} \"{}\"", user.get_ref());
            known(log, &title, used, &other, &names);
        }
    }
}

/// Whether each drive is moved by exactly one axis, or turns the spindle.
fn check_drives(log: &mut Log<'_>, document: &DeTable<'_>, drives: &[Spanned<String>]) {
    let axes: Vec<_> = rows(document, "axis").collect();
    // What they move, so far.
    let mut moved: Vec<(String, String)> = Vec::new();
    let mut wrong: Vec<String> = Vec::new();
    let all_told = axes.iter().all(|row| named(row).is_some());
    let spindle = document
        .get("spindle")
        .and_then(|it| it.get_ref().as_table());
    let turned = spindle.and_then(|it| it.get("drive")).and_then(text);
    let others: Vec<_> = (drives.iter())
        .filter(|it| {
            turned
                .as_ref()
                .is_none_or(|turned| turned.get_ref() != it.get_ref())
        })
        .cloned()
        .collect();
    for row in axes {
        let title =
            name(row).map_or_else(|| "axis".into(), |it| format!("axis \"{}\"", it.get_ref()));
        for drive in named(row).unwrap_or_default() {
            let of = drive.get_ref();
            let before = moved.iter().find(|(other, _)| other == of);
            if let Some((_, other)) = before {
                wrong.push(of.clone());
                let problem = format!("{title}: drive \"{of}\" already moves {other}");
                log.report(drive.span(), problem, "allowed: each drive once");
            } else if turned.as_ref().is_none_or(|it| it.get_ref() != of)
                && !known(log, &title, "drive", &drive, &others)
            {
                wrong.push(of.clone());
            }
            moved.push((of.clone(), title.clone()));
        }
    }
    if let Some(turned) = &turned {
        let of = turned.get_ref();
        if let Some((_, axis)) = moved.iter().find(|(drive, _)| drive == of) {
            let problem = format!("spindle: drive \"{of}\" already moves {axis}");
            log.report(turned.span(), problem, "allowed: a drive of its own");
        }
        if !known(log, "spindle", "drive", turned, drives) {
            wrong.push(of.clone());
        }
    }
    let is_spare = |it: &&Spanned<String>| moved.iter().all(|(drive, _)| drive != it.get_ref());
    let spare = others
        .iter()
        .filter(is_spare)
        .map(|it| it.get_ref().as_str());
    let spare = not_meant(spare.collect(), wrong.iter().map(String::as_str));
    let is_told = |it: &&Spanned<String>| all_told && spare.contains(&it.get_ref().as_str());
    for drive in others.iter().filter(is_told) {
        log.report(
            drive.span(),
            format!("drive \"{}\": no axis names it", drive.get_ref()),
            "name it in the `drives` of an [[axis]] or as the `drive` of [spindle], or remove it",
        );
    }
}

/// Those of the names that nobody uses that are not meant by a name that leads nowhere: each of these means the one that is
/// most like it.
pub(super) fn not_meant(
    mut unused: Vec<&str>,
    wrong: impl IntoIterator<Item = impl AsRef<str>>,
) -> Vec<&str> {
    for name in wrong {
        let meant = nearest(name.as_ref(), unused.iter().copied());
        unused.retain(|it| Some(*it) != meant);
    }
    unused
}

/// Whether a name is one of those that there are.
fn known(
    log: &mut Log<'_>,
    title: &str,
    kind: &str,
    name: &Spanned<String>,
    names: &[Spanned<String>],
) -> bool {
    let mut all = names.iter().map(|it| it.get_ref().as_str());
    let is_known = all.any(|it| it == name.get_ref());
    if !is_known {
        unknown(
            log,
            title,
            kind,
            name,
            names.iter().map(|it| it.get_ref().as_str()),
        );
    }
    is_known
}

/// The tables `[[kind]]`.
fn rows<'a, 'i>(document: &'a DeTable<'i>, kind: &str) -> impl Iterator<Item = &'a DeTable<'i>> {
    let rows = document.get(kind).and_then(|it| it.get_ref().as_array());
    rows.into_iter()
        .flatten()
        .filter_map(|it| it.get_ref().as_table())
}

/// The names of all of them, if each has one, and there are some where there have to be.
fn all(document: &DeTable<'_>, kind: &str) -> Option<Vec<Spanned<String>>> {
    let names: Option<Vec<_>> = rows(document, kind).map(name).collect();
    names.filter(|names| !names.is_empty() || !["bus", "drive"].contains(&kind))
}

fn name(row: &DeTable<'_>) -> Option<Spanned<String>> {
    text(row.get("name")?)
}

/// The drives of an axis, if there are as many as there can be.
fn named(row: &DeTable<'_>) -> Option<Vec<Spanned<String>>> {
    let drives = row.get("drives")?.get_ref().as_array()?;
    let drives: Option<Vec<_>> = drives.iter().map(text).collect();
    drives.filter(|drives| (1..=2).contains(&drives.len()))
}

fn text(value: &Spanned<DeValue<'_>>) -> Option<Spanned<String>> {
    let text = value.get_ref().as_str()?;
    Some(Spanned::new(value.span(), text.to_owned()))
}
