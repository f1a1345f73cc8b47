//! The table of docs/reliability.md has every piece of unsafe code, with why it is right.

use super::outside::{root, sources};
use std::collections::BTreeMap;
use std::fs;

/// The crates.
const FOLDERS: [&str; 8] = [
    "benches",
    "canopen",
    "controller",
    "drives",
    "gcode",
    "strict-toml",
    "tests",
    "trajectory",
];

/// How often a line begins something unsafe: a block, a function, an implementation, an attribute.
fn begun(line: &str) -> usize {
    let code = line.split("//").next().unwrap_or_default();
    [
        "unsafe {",
        "unsafe fn ",
        "unsafe impl ",
        "unsafe extern ",
        "#[unsafe(",
    ]
    .iter()
    .map(|it| code.matches(it).count())
    .sum()
}

/// What the table says, by file.
fn listed(page: &str) -> BTreeMap<String, usize> {
    let (_, chapter) = page.split_once("\n## Unsafe code\n").unwrap();
    let chapter = chapter.split("\n## ").next().unwrap();
    let mut files = BTreeMap::new();
    let mut file = String::new();
    for line in chapter.lines() {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let &[_, name, count, what, invariant, _] = &cells[..] else {
            continue;
        };
        let Ok(count) = count.parse::<usize>() else {
            continue;
        };
        assert!(!what.is_empty() && !invariant.is_empty(), "{line}");
        if !name.is_empty() {
            file = name.trim_matches('`').to_owned();
        }
        *files.entry(file.clone()).or_default() += count;
    }
    files
}

#[test]
fn all_of_it_is_listed() {
    let this = "controller/tests/controller/unsafe_code.rs";
    let mut there = BTreeMap::new();
    for folder in FOLDERS {
        let mut files = Vec::new();
        sources(&root().join(folder), &mut files);
        for file in files {
            let text = fs::read_to_string(&file).unwrap();
            let name = file.strip_prefix(root()).unwrap().display().to_string();
            let count: usize = text.lines().map(begun).sum();
            if count > 0 && name != this {
                there.insert(name, count);
            }
        }
    }
    let page = fs::read_to_string(root().join("docs/reliability.md")).unwrap();
    assert_eq!(listed(&page), there);
}
