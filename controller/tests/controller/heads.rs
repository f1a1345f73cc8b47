//! A source file belongs to a module, and a head that lists most of a module's parts lists all of them.

use super::outside::{root, sources};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Where the sources of the workspace are.
const FOLDERS: [&str; 12] = [
    "canopen/src",
    "canopen/tests/canopen",
    "controller/src",
    "controller/tests/controller",
    "drives/src",
    "drives/tests/drives",
    "gcode/src",
    "gcode/tests/gcode",
    "tests/src",
    "tests/tests/machine",
    "trajectory/src",
    "trajectory/tests/trajectory",
];

/// Files that are the root of what is in their folder.
const ROOTS: [&str; 3] = ["lib.rs", "main.rs", "mod.rs"];

fn texts() -> BTreeMap<PathBuf, String> {
    let mut files = Vec::new();
    for folder in FOLDERS {
        sources(&root().join(folder), &mut files);
    }
    let text = |file: PathBuf| {
        let text = fs::read_to_string(&file).unwrap();
        (file, text)
    };
    files.into_iter().map(text).collect()
}

/// The modules that a file declares, each with whether it is for tests alone.
fn declared(text: &str) -> Vec<(String, bool)> {
    let mut modules = Vec::new();
    let mut for_tests = false;
    for line in text.lines() {
        let name = line.split_once("mod ").filter(|(before, _)| {
            before.is_empty() || before.starts_with("pub") && before.ends_with(' ')
        });
        if let Some(name) = name.and_then(|(_, name)| name.strip_suffix(';')) {
            modules.push((name.to_owned(), for_tests));
        }
        for_tests = line == "#[cfg(test)]";
    }
    modules
}

/// The file that has to declare it, if it is there.
fn parent(file: &Path, texts: &BTreeMap<PathBuf, String>) -> Option<PathBuf> {
    let folder = file.parent()?;
    let roots = ROOTS.iter().map(|root| folder.join(root));
    let mut parents = roots.chain([folder.with_extension("rs")]);
    parents.find(|parent| parent != file && texts.contains_key(parent))
}

#[test]
fn no_source_file_is_forgotten() {
    let texts = texts();
    let forgotten = texts.keys().filter(|file| {
        let name = file.file_name().unwrap().to_string_lossy();
        let module = file.file_stem().unwrap().to_string_lossy();
        let declares = |parent: PathBuf| {
            let declared = declared(&texts[&parent]);
            declared.iter().any(|(name, _)| *name == module)
        };
        !ROOTS.contains(&&*name) && !parent(file, &texts).is_some_and(declares)
    });
    let forgotten: Vec<_> = forgotten.collect();
    assert!(texts.len() > 500, "{} files", texts.len());
    assert!(forgotten.is_empty(), "in no module: {forgotten:#?}");
}

#[test]
fn a_list_of_modules_is_whole() {
    let mut incomplete = Vec::new();
    let mut lists = 0;
    for (file, text) in &texts() {
        let head: Vec<&str> = text
            .lines()
            .filter(|line| line.starts_with("//!"))
            .collect();
        let head = head.join("\n");
        let named = |module: &str| {
            let path = format!("{module}::");
            // By its name, or by what is used from it.
            let exports = text.lines().filter(|line| line.starts_with("pub use "));
            let exports = exports.filter(|line| line.contains(&path));
            let mut names = exports.flat_map(|line| {
                let words = line.split(|c: char| !c.is_alphanumeric() && c != '_');
                words.filter(|word| word.starts_with(char::is_uppercase))
            });
            [format!("`{module}`"), format!("`{path}")]
                .iter()
                .any(|it| head.contains(it))
                || names.any(|name| head.contains(&format!("[`{name}`]")))
        };
        let modules = declared(text).into_iter().filter(|(_, tests)| !tests);
        let (listed, missing): (Vec<_>, Vec<_>) = modules.partition(|(name, _)| named(name));
        if head.contains("\n//! - ") && listed.len() > missing.len() {
            lists += 1;
            let missing = missing.into_iter();
            incomplete.extend(missing.map(|(name, _)| format!("{}: {name}", file.display())));
        }
    }
    assert!(lists > 10, "{lists}");
    assert!(incomplete.is_empty(), "not in the head: {incomplete:#?}");
}
