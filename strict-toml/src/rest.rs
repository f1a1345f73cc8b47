//! What of a file is TOML although a line of it is not: its mistakes can be told with those of the line.
//!
//! A line that is no TOML is left out, and so is all of a table whose header is none, as nobody knows whose its keys would be.
//! The places of the rest stay. What is left out is not told to be missing.

use super::diagnostic::char_start;
use super::end_of_table;
use std::ops::Range;
use toml::de::DeTable;

/// Lines that are left out at most: with more of them it is another kind of file.
const MOST: usize = 100;

/// A file without its lines that are no TOML.
#[derive(Debug)]
pub struct Rest {
    text: String,
    gaps: Gaps,
    /// Lines that are no TOML either, which is seen once those before them are left out, and why.
    hidden: Vec<(Range<usize>, String)>,
}

/// Keys that were left out.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gaps(Vec<Gap>);

#[derive(Clone, Debug)]
struct Gap {
    /// The line with the header of the table that it was in; `None` where the table is left out, too.
    table: Option<Range<usize>>,
    key: String,
}

impl Gaps {
    /// Whether that key of a table, whose header is there, was left out.
    pub(crate) fn has(&self, table: &Range<usize>, key: &str) -> bool {
        self.0.iter().any(|gap| {
            let here = gap.table.as_ref();
            gap.key == key && here.is_none_or(|line| line.contains(&table.start))
        })
    }

    /// Whether one of those keys was left out of any table, or a table.
    pub(crate) fn any(&self, keys: &[&str]) -> bool {
        let mut gaps = self.0.iter();
        gaps.any(|gap| gap.table.is_none() || keys.contains(&&*gap.key))
    }
}

impl Rest {
    /// What is left of a text; `None` where nobody can tell what belongs to what.
    #[must_use]
    pub fn of(source: &str) -> Option<Self> {
        let (mut text, mut gaps) = (source.to_owned(), Gaps::default());
        let (_, seen) = DeTable::parse_recoverable(source);
        if seen.len() > MOST {
            return None;
        }
        let mut seen: Vec<_> = seen.iter().filter_map(|it| it.span()).collect();
        let mut hidden = Vec::new();
        for _ in 0..MOST {
            let (_, errors) = DeTable::parse_recoverable(&text);
            let Some(error) = errors.first() else {
                return Some(Self { text, gaps, hidden });
            };
            let span = error.span()?;
            let place = char_start(&text, span.start);
            if !seen.contains(&span) {
                seen.push(span.clone());
                hidden.push((span, error.message().to_owned()));
            }
            let wrong = wrong(&text, place, error.message());
            let lost = text.get(wrong.clone())?.to_owned();
            if lost.trim().is_empty() {
                return None;
            }
            gaps.note(&text, &wrong);
            let blank = |c: char| {
                if c == '\n' {
                    "\n".into()
                } else {
                    " ".repeat(c.len_utf8())
                }
            };
            text.replace_range(wrong, &lost.chars().map(blank).collect::<String>());
        }
        None
    }

    /// It, as long as the whole.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    pub(crate) fn gaps(&self) -> &Gaps {
        &self.gaps
    }

    pub(crate) fn hidden(&self) -> &[(Range<usize>, String)] {
        &self.hidden
    }
}

impl Gaps {
    /// Remembers the keys in a part of a text that is to be left out.
    fn note(&mut self, text: &str, lost: &Range<usize>) {
        let before = &text[..lost.start];
        let mut start = 0;
        let mut table = 0..1;
        for line in before.split_inclusive('\n') {
            if is_header(line) {
                table = start..start + line.len();
            }
            start += line.len();
        }
        let mut table = Some(table);
        for line in text[lost.clone()].lines() {
            if is_header(line) {
                table = None;
                let name = line.split(['#', ']']).next().unwrap_or_default();
                let names = name.trim().trim_start_matches('[').split('.');
                self.0.extend(names.map(|name| Gap {
                    table: None,
                    key: name.trim().to_owned(),
                }));
            } else if let Some(key) = line.split(['=', ' ']).find(|it| !it.trim().is_empty()) {
                self.0.push(Gap {
                    table: table.clone(),
                    key: key.trim().trim_matches('"').to_owned(),
                });
            }
        }
    }
}

/// The lines that a mistake is in.
fn wrong(text: &str, place: usize, message: &str) -> Range<usize> {
    let start = text[..place].rfind('\n').map_or(0, |at| at + 1);
    let line = text[start..]
        .split_inclusive('\n')
        .next()
        .unwrap_or_default();
    let end = start + line.len();
    if is_header(line) {
        let header = line.split('#').next().unwrap_or_default().trim();
        let name = header.trim_start_matches('[').trim_end_matches(']').trim();
        return start..end_of_table(text, start, name).max(end);
    }
    // A list that has no end is noticed at the line behind it.
    let begins = text[start..place].trim().is_empty() && message.contains("array");
    let opened = text[..start].rfind('=').filter(|_| begins);
    let opened = opened.map(|at| text[..at].rfind('\n').map_or(0, |at| at + 1));
    opened.map_or(start..end, |opened| opened..start)
}

/// Whether a line is a header, or was meant to be one, and no row of a list.
fn is_header(line: &str) -> bool {
    let line = line.trim_start();
    let name = line.strip_prefix("[[").or_else(|| line.strip_prefix('['));
    name.is_some_and(|name| name.trim_start().starts_with(char::is_alphabetic))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is left, and which keys are said to be left out.
    fn left(source: &str) -> (Vec<String>, Vec<String>) {
        let rest = Rest::of(source).unwrap();
        assert_eq!(rest.text().len(), source.len());
        let lines = rest.text().lines().map(str::trim);
        let lines = lines.filter(|line| !line.is_empty()).map(str::to_owned);
        let gaps = rest.gaps().0.iter().map(|gap| gap.key.clone());
        (lines.collect(), gaps.collect())
    }

    #[test]
    fn a_line_is_left_out_and_a_table_without_a_header() {
        let lines = |source| left(source).0;
        assert_eq!(lines("[a]\nx = 4 00\ny = 1\n"), ["[a]", "y = 1"]);
        assert_eq!(lines("[a]\nx 3\ny = 3\n"), ["[a]", "y = 3"]);
        assert_eq!(lines("[a]\nx = 1\nx = 2\n"), ["[a]", "x = 1"]);
        assert_eq!(lines("[a]\nx = \"é\ny = 3\n"), ["[a]", "y = 3"]);
        let (rest, gaps) = left("[a]\nx = [1, 2\ny = 3\n[[b]]\nz = 1\n");
        assert_eq!(rest, ["[a]", "y = 3", "[[b]]", "z = 1"]);
        assert_eq!(gaps, ["x"]);
        let (rest, gaps) = left("[[a]\nx = 1\n[b]\ny = 2\n");
        assert_eq!(rest, ["[b]", "y = 2"]);
        assert_eq!(gaps, ["a", "x"]);
        assert_eq!(lines("[a] x = 1\ny = 2\n[b]\nz = 1\n"), ["[b]", "z = 1"]);
        assert!(Rest::of("x = '''\ny = 1\n").is_none());
    }

    #[test]
    fn a_gap_is_of_its_table() {
        let source = "[[a]]\nx = 4 00\n[[a]]\ny = 1\n";
        let rest = Rest::of(source).unwrap();
        let second = source.rfind("[[a]]").unwrap();
        assert!(rest.gaps().has(&(0..5), "x"));
        assert!(!rest.gaps().has(&(second..second + 5), "x"));
        assert!(rest.gaps().any(&["x"]) && !rest.gaps().any(&["y"]));
    }
}
