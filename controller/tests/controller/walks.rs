//! The walks of `docs/design.md` lead through files and functions that there are.

use super::outside::root;
use std::fs;
use std::path::PathBuf;

/// The hops of the walks: a file, and the function in it with its type.
fn hops() -> Vec<String> {
    let design = fs::read_to_string(root().join("docs/design.md")).unwrap();
    let (_, walks) = design.split_once("## Walks").expect("the walks");
    let (walks, _) = walks.split_once("\n## ").expect("what follows them");
    let quoted = walks.split('`').skip(1).step_by(2);
    let hops = quoted.filter(|it| it.contains(".rs"));
    hops.map(str::to_owned).collect()
}

/// A file without a crate is the controller's.
fn source(file: &str) -> PathBuf {
    let inside = root().join("controller/src").join(file);
    match inside.exists() {
        true => inside,
        false => root().join(file),
    }
}

/// Whether the text has the function, in an `impl` of the type or, without one, outside of any.
fn has(text: &str, of: Option<&str>, function: &str) -> bool {
    let words = |line: &str| -> Vec<String> {
        let words = line.split(|c: char| !c.is_alphanumeric() && c != '_');
        words.map(str::to_owned).collect()
    };
    let mut block = Vec::new();
    text.lines().any(|line| {
        if line.starts_with("impl") || line.starts_with("pub trait") {
            block = words(line);
        } else if line.starts_with('}') {
            block.clear();
        }
        let is_there = words(line)
            .windows(2)
            .any(|it| it[0] == "fn" && it[1] == function);
        is_there && of.map_or(block.is_empty(), |of| block.iter().any(|it| it == of))
    })
}

#[test]
fn each_hop_is_in_its_file() {
    let hops = hops();
    assert!(hops.len() > 40, "{hops:?}");
    let mut wrong = Vec::new();
    for hop in hops {
        let mut parts = hop.split("::");
        let file = source(parts.next().unwrap_or_default());
        let names: Vec<&str> = parts.collect();
        let text = fs::read_to_string(&file).unwrap_or_default();
        let is_there = match names[..] {
            [] => file.exists(),
            [function] => has(&text, None, function),
            [of, function] => has(&text, Some(of), function),
            _ => false,
        };
        if !is_there {
            wrong.push(hop);
        }
    }
    assert!(wrong.is_empty(), "not there:\n{}", wrong.join("\n"));
}
