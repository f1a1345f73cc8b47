//! Inside the controller a module uses only what stands below it, by the table of `docs/design.md`.

use super::outside::{root, sources};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

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

/// The modules that a file names behind `crate::`, but for comments and what only tests use.
fn used(text: &str) -> BTreeSet<String> {
    let code = text.split("#[cfg(test)]").next().unwrap_or(text);
    let lines = code
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"));
    lines
        .flat_map(|line| line.split("crate::").skip(1))
        .map(|rest| {
            let end = rest.find(|c: char| !c.is_ascii_lowercase() && c != '_');
            rest[..end.unwrap_or(rest.len())].to_owned()
        })
        .filter(|name| !name.is_empty())
        .collect()
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
        let used = used(&fs::read_to_string(&file).unwrap());
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
