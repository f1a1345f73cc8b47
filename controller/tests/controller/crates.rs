//! Each crate says what it is: on a page, in its metadata, and by an example that opens its documentation and runs as a test.

use super::outside::root;
use std::fs;

#[test]
fn each_crate_says_what_it_is() {
    let workspace = fs::read_to_string(root().join("Cargo.toml")).unwrap();
    let (_, members) = workspace.split_once("members = [").expect("members");
    let (members, _) = members.split_once(']').expect("their end");
    let members: Vec<&str> = members.split('"').skip(1).step_by(2).collect();
    assert!(members.len() > 5, "{members:?}");
    let mut missing = Vec::new();
    for member in members {
        let read =
            |file: &str| fs::read_to_string(root().join(member).join(file)).unwrap_or_default();
        if read("README.md").is_empty() {
            missing.push(format!("{member}: a README.md"));
        }
        let metadata = read("Cargo.toml");
        for key in [
            "description",
            "version",
            "edition",
            "rust-version",
            "license",
            "authors",
            "readme",
        ] {
            let has = metadata.lines().any(|line| {
                let rest = line.strip_prefix(key).unwrap_or_default();
                rest.starts_with(" = ") || rest.starts_with(".workspace = true")
            });
            if !has {
                missing.push(format!("{member}: `{key}` in its Cargo.toml"));
            }
        }
        let lib = read("src/lib.rs");
        let mut head = lib
            .lines()
            .take_while(|line| line.starts_with("//!") || line.starts_with("#![doc"));
        if !head.any(|line| line == "//! ```") {
            missing.push(format!("{member}: an example at the head of its lib.rs"));
        }
    }
    assert!(missing.is_empty(), "missing:\n{}", missing.join("\n"));
}
