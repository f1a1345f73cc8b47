//! What pages quote of the code stands in the code, word for word, so that it is compiled and run.

use std::fs;
use std::path::{Path, PathBuf};

/// What pages name and a build writes.
const WRITTEN_LATER: &str = "python/THIRD-PARTY.txt";

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// The pages of a person who comes anew.
fn pages() -> Vec<PathBuf> {
    let docs = fs::read_dir(root().join("docs")).unwrap();
    let mut pages: Vec<_> = docs
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|it| it == "md"))
        .collect();
    pages.extend(["README.md", "CONTRIBUTING.md"].map(|page| root().join(page)));
    pages
}

/// A quotation: the file that the line before it links to last, and its lines.
#[derive(Debug)]
struct Quotation {
    source: Option<String>,
    parts: Vec<Vec<String>>,
}

/// The quotations of a page. `// …` stands for lines that are left out.
fn quotations(page: &str) -> Vec<Quotation> {
    let mut found = Vec::new();
    let mut above = "";
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        if line == "```rust" {
            let quoted: Vec<_> = lines.by_ref().take_while(|it| *it != "```").collect();
            let parts = quoted.split(|it| it.trim() == "// …");
            found.push(Quotation {
                source: above
                    .rsplit_once("](")
                    .and_then(|(_, rest)| rest.split_once(')'))
                    .map(|(path, _)| path.to_owned()),
                parts: parts.map(dedented).collect(),
            });
        } else if !line.is_empty() {
            above = line;
        }
    }
    found
}

/// The lines without the indentation that all of them have.
fn dedented(lines: &[&str]) -> Vec<String> {
    let indent = |line: &&&str| line.len() - line.trim_start().len();
    let least = lines
        .iter()
        .filter(|it| !it.is_empty())
        .map(|it| indent(&it));
    let least = least.min().unwrap_or(0);
    lines
        .iter()
        .map(|line| line.get(least..).unwrap_or_default().to_owned())
        .collect()
}

/// Whether the parts stand in the source one after the other, each without a gap.
fn stands_in(parts: &[Vec<String>], source: &str) -> bool {
    let lines: Vec<&str> = source.lines().collect();
    let mut from = 0;
    parts.iter().all(|part| {
        let mut windows = lines[from..].windows(part.len().max(1));
        let place = windows.position(|window| dedented(window) == *part);
        from += place.unwrap_or(0) + part.len();
        place.is_some()
    })
}

#[test]
fn what_pages_quote_is_code_that_is_compiled() {
    let mut count = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for quotation in quotations(&text) {
            let page = page.file_name().unwrap().display();
            let Some(source) = &quotation.source else {
                panic!("{page}: link to the file before it is quoted: {quotation:?}");
            };
            let source = source.trim_start_matches("../");
            let code = fs::read_to_string(root().join(source))
                .unwrap_or_else(|error| panic!("{page}: {source}: {error}"));
            assert!(
                stands_in(&quotation.parts, &code),
                "{page}: not in {source}: {:#?}",
                quotation.parts
            );
            count += 1;
        }
    }
    assert!(count > 3, "{count} quotations");
}

/// Links to files and folders of the repository lead somewhere.
#[test]
fn links_lead_somewhere() {
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        let mut rest = text.as_str();
        while let Some((_, after)) = rest.split_once("](") {
            let (link, after) = after.split_once(')').unwrap();
            rest = after;
            let path = link.split('#').next().unwrap_or_default();
            if path.is_empty() || link.contains("://") || link.contains(' ') {
                continue;
            }
            let target = page.parent().unwrap().join(path);
            assert!(target.exists(), "{}: {link}", page.display());
        }
    }
}

/// Files and folders of the repository that pages name in full are there.
#[test]
fn paths_are_those_of_files() {
    let folders = fs::read_dir(root()).unwrap();
    let folders: Vec<String> = folders
        .filter_map(|entry| entry.unwrap().file_name().into_string().ok())
        .filter(|name| !name.starts_with('.') && root().join(name).is_dir())
        .collect();
    let mut count = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for named in text.split('`').skip(1).step_by(2) {
            let is_path = |it: char| it.is_ascii_alphanumeric() || "._-/".contains(it);
            let folder = named.split_once('/').map(|(folder, _)| folder);
            let is_ours = folder.is_some_and(|it| folders.iter().any(|own| own == it));
            if !is_ours || !named.chars().all(is_path) || named == WRITTEN_LATER {
                continue;
            }
            count += 1;
            let path = root().join(named);
            assert!(path.exists(), "{}: {named}", page.display());
        }
    }
    assert!(count > 50, "{count} paths");
}
