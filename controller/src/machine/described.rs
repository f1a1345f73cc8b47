//! A device that a file describes: a name, a data sheet (EDS) and the numbers of a generic model.
//!
//! What is wrong in the file or its data sheet is told where the machine file names it, with the place there.

use super::files::Files;
use super::node::{NodeTable, pair};
use super::read::assumed_of;
use std::{io, path::Path, time::Duration};
use syncline_canopen::eds::Eds;
use syncline_canopen::{Address, NodeId};
use syncline_drives::model::{Assumed, Description, MODELS, Model, Settings};
use syncline_strict_toml::{Log, Table, input, integer};
use toml::Spanned;

/// Rows that a dictionary holds.
const MOST_OBJECTS: usize = 1 << 16;
/// Bytes that a data sheet may have; the largest have some hundred kilobytes.
const LONGEST: u64 = 1 << 22;

/// What files say of a device.
pub(super) struct Described {
    pub(super) assumed: Assumed,
}

/// What is wrong, and what to do.
type Wrong = (String, String);

/// Whether a `model` names a file, not a model that is built in.
pub(super) fn is_file(model: &str) -> bool {
    model.ends_with(".toml")
}

/// The model that the file describes that is the `model` of a table, and what it says of it.
pub(super) fn read(
    log: &mut Log<'_>,
    files: &mut Files,
    table: &mut Table<'_, '_>,
    of_kind: fn(&Model) -> bool,
) -> Option<(&'static Model, Spanned<Described>)> {
    let name = table.text(log, "model", "a file", is_file)?;
    let file = files.named(name.get_ref());
    let wrong = match described(files, &file) {
        Ok((model, described)) if of_kind(model) => {
            return Some((model, Spanned::new(name.span(), described)));
        }
        Ok((model, _)) => vec![(
            format!("{} describes a {}", name.get_ref(), kind(model)),
            "allowed: devices of the table's own kind".to_owned(),
        )],
        Err(wrong) => wrong,
    };
    for (problem, help) in wrong {
        log.report(
            name.span(),
            format!("{}: `model`: {problem}", table.title),
            help,
        );
    }
    None
}

fn kind(model: &Model) -> &'static str {
    if model.is_drive() {
        "drive"
    } else if model.is_encoder() {
        "encoder"
    } else {
        "I/O node"
    }
}

/// The models that files describe, each with what its file says. A name belongs to one of them.
pub(super) fn models(log: &mut Log<'_>, devices: &[&NodeTable]) -> Vec<(&'static Model, Assumed)> {
    let mut models: Vec<(&'static Model, Assumed)> = Vec::new();
    for device in devices {
        let Some(described) = &device.described else {
            continue;
        };
        let (model, of) = (device.model, &described.get_ref().assumed);
        match models.iter().find(|(other, _)| other.name == model.name) {
            Some((same, assumed)) if std::ptr::eq(*same, model) && assumed == of => {}
            Some(_) => log.report(
                described.span(),
                format!(
                    "{}: `model`: another file describes another \"{}\"",
                    device.title(),
                    model.name
                ),
                "allowed: a `name` of its own in each description",
            ),
            None => models.push((model, of.clone())),
        }
    }
    models
}

/// Reads a description.
fn described(files: &mut Files, file: &Path) -> Result<(&'static Model, Described), Vec<Wrong>> {
    let source = syncline_strict_toml::read(file);
    let source = source.map_err(|error| vec![unreadable(file, &error)])?;
    let mut log = Log::new(&source);
    let document = syncline_strict_toml::parse(&mut log, &source);
    let read = log.is_empty().then(|| {
        model(
            &mut log,
            files,
            file,
            Table::new("description", 0..0, document.get_ref()),
        )
    });
    match read.flatten() {
        Some(model) if log.is_empty() => Ok(model),
        _ => {
            let found = log.into_diagnostics().into_iter();
            let told = found.map(|it| {
                let (line, column) = (it.line, it.column);
                let place = format!("{}:{line}:{column}", file.display());
                (format!("{place}: {}", it.problem), it.help)
            });
            Err(told.collect())
        }
    }
}

fn unreadable(file: &Path, error: &io::Error) -> Wrong {
    let problem = format!("cannot read {}: {error}", file.display());
    (
        problem,
        "allowed: a file beside the one that names it".into(),
    )
}

fn model(
    log: &mut Log<'_>,
    files: &mut Files,
    file: &Path,
    mut table: Table<'_, '_>,
) -> Option<(&'static Model, Described)> {
    let free = "a text that is not empty and no built-in model's name";
    let name = table.text(log, "name", free, |name| {
        let is_of_a_model =
            |it: &Model| it.name == name || it.title.eq_ignore_ascii_case(name.trim());
        !name.trim().is_empty() && !MODELS.iter().any(|model| is_of_a_model(model))
    });
    let maker = table.text_if(log, "maker", "a text", |_| true);
    let generic = MODELS.iter().filter(|model| model.is_generic());
    let generic = generic.map(|model| model.name);
    let generic = table.choice(log, "generic", generic);
    let generic = generic.and_then(|name| Model::by_name(name.get_ref()));
    let sheet = table.text(log, "eds", "a file", |_| true);
    let assumed = generic.map(|generic| assumed_of(log, &mut table, generic));
    let r_pdo_values = r_pdo_values(log, &mut table);
    let title = table.title.clone();
    if generic.is_some() {
        table.finish(log);
    }
    let (name, generic, sheet, assumed) = (name?, generic?, sheet?, assumed?);
    let eds = match data_sheet(&files.named_in(file, sheet.get_ref())) {
        Ok(eds) => eds,
        Err((problem, help)) => {
            log.report(sheet.span(), format!("{title}: `eds`: {problem}"), help);
            return None;
        }
    };
    let model = generic.described(Description {
        name: name.into_inner(),
        maker: maker.map(Spanned::into_inner),
        r_pdo_values,
        eds,
    });
    // Which objects a device has to have depends neither on its node id nor on the cycle.
    let settings = Settings {
        assumed: assumed.clone(),
        ..Settings::new(NodeId::new(1)?, Duration::from_millis(1))
    };
    for lack in model.lacks(&settings) {
        let problem = format!("{title}: `eds`: {lack}");
        log.report(sheet.span(), problem, lack.help);
    }
    Some((model, Described { assumed }))
}

/// What further objects of its R_PDO are sent.
fn r_pdo_values(log: &mut Log<'_>, table: &mut Table<'_, '_>) -> Vec<(Address, i64)> {
    const KEY: &str = "r_pdo_values";
    let entries = table.items(
        log,
        KEY,
        "a list of [object, value] pairs such as [\"60FE:1\", 0]",
    );
    let mut values: Vec<(Address, i64)> = Vec::new();
    for entry in entries {
        let Some((object, value)) = pair(log, &table.title, KEY, entry) else {
            continue;
        };
        let (address, span) = (*object.get_ref(), object.span());
        let title = &table.title;
        if values.iter().any(|(other, _)| *other == address) {
            let problem = format!("{title}: `{KEY}`: {address} has a value already");
            log.report(span, problem, "allowed: each object once");
        }
        match integer(value.get_ref()) {
            Some(value) => values.push((address, value)),
            None => log.report(
                value.span(),
                format!("{title}: `{KEY}`: this is no value for {address}"),
                "allowed: a whole number",
            ),
        }
    }
    values
}

/// Reads a data sheet. Those of older tools are in some 8-bit code; names do not matter here.
fn data_sheet(file: &Path) -> Result<Eds, Wrong> {
    let bytes = input::read_to(file, LONGEST).map_err(|error| unreadable(file, &error))?;
    let place = file.display();
    let help = "allowed: a data sheet as CiA 306 has it";
    let eds = Eds::parse(&String::from_utf8_lossy(&bytes));
    let eds = eds.map_err(|error| (format!("{place}: {error}"), help.into()))?;
    match eds.parameters().count() {
        0..=MOST_OBJECTS => Ok(eds),
        count => Err((format!("{place} has {count} objects"), help.into())),
    }
}
