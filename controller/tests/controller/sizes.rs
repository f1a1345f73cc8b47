//! Where the code is deep, functions and files stay short enough to be read at one sitting.

use super::outside::{root, sources};
use std::fs;

/// The folders that the rule is for.
const FOLDERS: [&str; 9] = [
    "gcode/src",
    "trajectory/src/path",
    "controller/src/control",
    "controller/src/program",
    "controller/src/run",
    "controller/src/session",
    "controller/src/observe",
    "controller/src/commands",
    "controller/src/campaign",
];

/// Lines of a file.
const FILE: usize = 800;

/// Lines of a function.
const FUNCTION: usize = 100;

/// The functions of a text as `rustfmt` writes it, each with its first line and how many it has.
fn functions(text: &str) -> Vec<(usize, String, usize)> {
    let lines: Vec<&str> = text.lines().collect();
    let begins = lines.iter().enumerate().filter_map(|(number, line)| {
        let words: Vec<&str> = line.split_whitespace().collect();
        let place = words.iter().position(|word| *word == "fn")?;
        let is_one = (words[..place].iter()).all(|word| {
            word.starts_with("pub") || word.ends_with(')') || ["const", "unsafe"].contains(word)
        });
        let name = words.get(place + 1)?.split(['(', '<']).next()?;
        is_one.then(|| (number, name.to_owned()))
    });
    begins
        .filter_map(|(begin, name)| {
            let line = lines[begin];
            let indent = &line[..line.len() - line.trim_start().len()];
            // One of a trait may have no body.
            let ends = |line: &&str| {
                line.strip_prefix(indent)
                    .is_some_and(|it| it == "}" || it.ends_with(';') && !it.starts_with(' '))
            };
            let length = lines[begin..].iter().position(ends)?;
            Some((begin + 1, name, length + 1))
        })
        .collect()
}

#[test]
fn functions_and_files_are_short() {
    let mut long = Vec::new();
    let mut seen = 0;
    for folder in FOLDERS {
        let mut files = Vec::new();
        sources(&root().join(folder), &mut files);
        for file in files {
            let text = fs::read_to_string(&file).unwrap();
            let length = text.lines().count();
            if length > FILE {
                long.push(format!("{}: {length} lines", file.display()));
            }
            for (line, name, length) in functions(&text) {
                seen += 1;
                if length > FUNCTION {
                    long.push(format!("{}:{line}: {name}: {length} lines", file.display()));
                }
            }
        }
    }
    assert!(seen > 1_000, "{seen} functions");
    assert!(long.is_empty(), "too long:\n{}", long.join("\n"));
}
