//! What comes from outside is read to a bound: files by `syncline_strict_toml::input`, and by nothing else.

use super::arrows::code;
use super::outside::{root, sources};
use std::collections::BTreeMap;
use std::fs;

/// Sources of what is built.
const FOLDERS: [&str; 6] = [
    "canopen/src",
    "controller/src",
    "drives/src",
    "gcode/src",
    "strict-toml/src",
    "trajectory/src",
];

/// Where files are read.
const INPUT: &str = "strict-toml/src/input.rs";

/// What reads without a bound, or opens what could be read so.
const UNBOUNDED: [&str; 8] = [
    "File::open(",
    "OpenOptions::new().read(",
    "fs::read(",
    "read_to_string(",
    "read_to_end(",
    "from_path(",
    "stdin().read_line(",
    "stdin().lines(",
];

/// Elsewhere, how often, and why that is no unbounded read.
const ELSEWHERE: [(&str, usize, &str); 6] = [
    (
        "controller/src/doctor.rs",
        1,
        "of the kernel, in /proc and /sys",
    ),
    (
        "controller/src/session/jobs.rs",
        1,
        "whether it can be opened",
    ),
    (
        "gcode/src/flow.rs",
        1,
        "a program, of which `Lines` keeps one line",
    ),
    (
        "gcode/src/interpreter.rs",
        1,
        "a program, of which `Lines` keeps one line",
    ),
    ("gcode/src/tables/save.rs", 1, "a folder that is locked"),
    ("strict-toml/src/replace.rs", 1, "a folder"),
];

/// How often a text reads so, but for the kernel's own files.
fn unbounded(text: &str) -> usize {
    let code = code(text);
    let lines = code.lines().filter(|line| !line.contains("(\"/proc/"));
    let found = |line: &str| -> usize { UNBOUNDED.iter().map(|it| line.matches(it).count()).sum() };
    lines.map(found).sum()
}

#[test]
fn all_that_is_read_is_bounded() {
    let mut found = BTreeMap::new();
    for folder in FOLDERS {
        let mut files = Vec::new();
        sources(&root().join(folder), &mut files);
        for file in files {
            let name = file.strip_prefix(root()).unwrap().display().to_string();
            let count = unbounded(&fs::read_to_string(&file).unwrap());
            if count > 0 && name != INPUT {
                found.insert(name, count);
            }
        }
    }
    let known: BTreeMap<_, _> = ELSEWHERE
        .iter()
        .map(|(name, count, _)| ((*name).to_owned(), *count))
        .collect();
    assert_eq!(found, known, "read with {INPUT}, which knows of bounds");
}

#[test]
fn an_unbounded_read_is_seen() {
    let planted = [
        "let text = fs::read_to_string(file)?;",
        "let mut file = BufReader::new(File::open(file)?);",
        "let bytes = std::fs::read(&file)?;",
        "let csv = csv::Reader::from_path(file)?;",
        "io::stdin().read_line(&mut line)?;",
    ];
    for line in planted {
        assert_eq!(unbounded(line), 1, "{line}");
    }
    assert_eq!(unbounded("let text = input::read(file)?;"), 0);
    assert_eq!(
        unbounded("#[cfg(test)]\nmod tests {\n    fs::read(file);\n}\n"),
        0
    );
}
