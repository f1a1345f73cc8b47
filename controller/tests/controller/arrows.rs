//! Inside the controller a module uses only what stands below it, by the table of `docs/design.md`; among the drives twins and
//! models know nothing of each other.

use super::outside::{root, sources};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use syncline_drives::model::MODELS;

/// What each module may use, in the order of the table.
fn table() -> Vec<(String, BTreeSet<String>)> {
    let design = fs::read_to_string(root().join("docs/design.md")).unwrap();
    let begin = design.find("| module | uses |").expect("the table");
    let rows = design[begin..].lines().skip(2);
    let rows = rows.take_while(|line| line.starts_with('|'));
    let names = |cell: &str| -> Vec<String> {
        let quoted = cell.split('`').skip(1).step_by(2);
        quoted.map(str::to_owned).collect()
    };
    rows.map(|row| {
        let cells: Vec<&str> = row.trim_matches('|').split('|').collect();
        (
            names(cells[0]).remove(0),
            names(cells[1]).into_iter().collect(),
        )
    })
    .collect()
}

/// A file's lines but for comments and for what only tests use: the item behind each `#[cfg(test)]`.
pub(super) fn code(text: &str) -> String {
    let mut code = String::new();
    // How deep in braces the item for tests is, once it has begun.
    let mut item: Option<i32> = None;
    let lines = text.lines().map(str::trim_end);
    for line in lines.filter(|line| !line.trim_start().starts_with("//")) {
        if line.trim_start() == "#[cfg(test)]" {
            item = item.or(Some(0));
            continue;
        }
        let Some(depth) = &mut item else {
            code += line;
            code += "\n";
            continue;
        };
        let of = |c| line.matches(c).count() as i32;
        *depth += of('{') - of('}');
        let is_attribute = line.trim_start().starts_with("#[");
        if *depth <= 0 && !is_attribute && line.ends_with([';', '}', ',']) {
            item = None;
        }
    }
    code
}

/// The modules of the crate that a file so many modules below its root names behind `crate::` or as many `super::`, but for
/// comments and what only tests use.
fn used(text: &str, depth: usize) -> BTreeSet<String> {
    let code = code(text);
    let up = "super::".repeat(depth);
    ["crate::", &up]
        .iter()
        .flat_map(|root| code.split(root).skip(1).flat_map(named))
        .filter(|name| !name.is_empty() && name != "super")
        .collect()
}

/// The names that a path goes on with: one, or those of a list in braces.
fn named(rest: &str) -> Vec<String> {
    let name = |text: &str| -> String {
        let letters = text.trim_start().chars();
        letters
            .take_while(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || *c == '_')
            .collect()
    };
    let Some(list) = rest.strip_prefix('{') else {
        return vec![name(rest)];
    };
    let mut names = vec![name(list)];
    let mut level = 0;
    for (at, c) in list.char_indices() {
        match c {
            '{' => level += 1,
            '}' if level == 0 => break,
            '}' => level -= 1,
            ',' if level == 0 => names.push(name(&list[at + 1..])),
            _ => {}
        }
    }
    names
}

#[test]
fn modules_are_found_however_they_are_named() {
    let text = "\
//! Not crate::comment.
use crate::{alpha::{Inner, deep}, beta};
use super::super::{
    gamma::Gamma,
    delta,
};
use super::sister::Sister;
pub(in crate::alpha) fn f(it: super::super::epsilon::Epsilon) {}
#[cfg(test)]
use crate::tests_alone;
#[cfg(test)]
mod tests;
use crate::zeta2::Zeta;
#[cfg(test)]
#[allow(dead_code)]
mod more {
    fn f() {
        use crate::tests_alone_too;
    }
}
fn last() -> crate::eta::Eta {}
";
    let expected = ["alpha", "beta", "delta", "epsilon", "eta", "gamma", "zeta2"];
    assert_eq!(used(text, 2), expected.map(str::to_owned).into());
}

/// How many modules below its crate's root the module of a file is.
fn depth(inside: &Path) -> usize {
    inside.components().count() - usize::from(inside.ends_with("mod.rs"))
}

#[test]
fn arrows_go_down_only() {
    let table = table();
    for (place, (module, uses)) in table.iter().enumerate() {
        let below: BTreeSet<_> = table[place + 1..].iter().map(|(name, _)| name).collect();
        for used in uses {
            assert!(
                below.contains(used),
                "`{used}` does not stand below `{module}`"
            );
        }
    }
    let table: BTreeMap<_, _> = table.into_iter().collect();
    let src = root().join("controller/src");
    let mut files = Vec::new();
    sources(&src, &mut files);
    let mut seen = BTreeSet::new();
    let mut wrong = Vec::new();
    for file in files {
        let inside = file.strip_prefix(&src).unwrap();
        let top = inside.components().next().unwrap().as_os_str();
        let module = Path::new(top).file_stem().unwrap().to_str().unwrap();
        // The list of modules, the command's one line, and what only tests use.
        if ["lib", "main"].contains(&module) || inside.ends_with("tests.rs") {
            continue;
        }
        let Some(allowed) = table.get(module) else {
            panic!("the table has no `{module}`");
        };
        seen.insert(module.to_owned());
        let used = used(&fs::read_to_string(&file).unwrap(), depth(inside));
        for name in used.iter().filter(|name| *name != module) {
            if !allowed.contains(name) {
                wrong.push(format!("{}: `{name}`", inside.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "not by the table:\n{}", wrong.join("\n"));
    let listed: BTreeSet<_> = table.into_keys().collect();
    assert_eq!(seen, listed, "modules that there are, and the table's");
}

/// What the drives' crate promises: a twin and what carries it never see the model that they are held against, nor does the
/// model see them.
#[test]
fn twins_and_models_know_nothing_of_each_other() {
    let src = root().join("drives/src");
    let mut files = Vec::new();
    sources(&src, &mut files);
    let mut seen = BTreeSet::new();
    for file in files {
        let inside = file.strip_prefix(&src).unwrap();
        let top = inside.components().next().unwrap().as_os_str();
        let module = Path::new(top).file_stem().unwrap().to_str().unwrap();
        let used = used(&fs::read_to_string(&file).unwrap(), depth(inside));
        match module {
            "lib" => continue,
            "model" => {
                let known = ["dictionary", "model"].map(str::to_owned);
                let other: Vec<_> = used.difference(&known.into()).cloned().collect();
                assert!(other.is_empty(), "{}: {other:?}", inside.display());
            }
            _ => assert!(!used.contains("model"), "{}: `model`", inside.display()),
        }
        seen.insert(module.to_owned());
    }
    let expected = ["bus", "dictionary", "mechanics", "model", "twin", "world"];
    assert_eq!(seen, expected.map(str::to_owned).into());
}

/// What is known of a device stands in its own files: the rest finds it by the name in a machine file. The campaign writes such files.
#[test]
fn nothing_names_a_model() {
    let mut files = Vec::new();
    for folder in ["controller/src", "benches", "tests/src"] {
        sources(&root().join(folder), &mut files);
    }
    let mut wrong = Vec::new();
    for file in files {
        let inside = file.strip_prefix(root()).unwrap();
        if inside.starts_with("controller/src/campaign") || inside.ends_with("tests.rs") {
            continue;
        }
        let text = fs::read_to_string(&file).unwrap();
        for line in code(&text).lines() {
            let named = MODELS
                .iter()
                .find(|model| line.contains(&format!("\"{}", model.name)));
            wrong.extend(named.map(|model| format!("{}: {}", inside.display(), model.name)));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
