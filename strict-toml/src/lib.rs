//! TOML files, read strictly: what is unknown, missing, doubled, out of range or contradictory is
//! reported with its place, what is allowed and what was probably meant.
//!
//! [`parse`] turns the text into TOML. A [`Table`] is then asked for every key it may have, and
//! [`Table::finish`] reports the keys that nobody asked for and the required ones that are absent.
//! All mistakes of a file gather in one [`Log`], so that a person mends them in one go; [`Invalid`]
//! shows them, each with its line. [`input`] reads files, these and any other, to a bound; [`replace`] writes one as a whole.
//!
//! ```
//! use std::path::Path;
//! use syncline_strict_toml::{Invalid, Log, Table, parse};
//!
//! let text = "[pump]\nflow = 0.0\npresure = 3.5\n";
//! let mut log = Log::new(text);
//! let document = parse(&mut log, text);
//! let mut file = Table::new("pump file", 0..0, document.get_ref());
//! if let Some(mut pump) = file.table(&mut log, "pump", true) {
//!     pump.positive(&mut log, "flow", "(l/min)");
//!     pump.positive(&mut log, "pressure", "(bar)");
//!     pump.finish(&mut log);
//! }
//! file.finish(&mut log);
//!
//! let invalid = Invalid { file: Path::new("pump.toml").into(), diagnostics: log.into_diagnostics() };
//! assert_eq!(
//!     invalid.to_string(),
//!     "\
//! pump.toml:2:8: pump: `flow` is 0.0
//!   2 | flow = 0.0
//!     |        ^^^
//!     = allowed: a number above 0 (l/min)
//! pump.toml:3:1: pump: unknown key `presure`
//!   3 | presure = 3.5
//!     | ^^^^^^^
//!     = nearest valid key: `pressure`; allowed: flow, pressure"
//! );
//! ```
#![forbid(unsafe_code)]

mod diagnostic;
pub mod input;
pub mod replace;
mod rest;
mod set;
mod table;
mod values;

pub use diagnostic::{Diagnostic, Invalid, Log};
pub use rest::Rest;
pub use set::{SetError, set};
pub use table::{Found, Table, integer, nearest, one_of};
pub use values::values;

use std::io;
use std::path::Path;
use toml::Spanned;
use toml::de::DeTable;

/// Bytes that a file may have: thousands of tables.
const LONGEST: u64 = 1 << 20;

/// What a line of such a file may be.
const TOML: &str = "allowed: tables, keys and values as on https://toml.io";

/// Reads a file's text.
///
/// # Errors
/// It cannot be read, is no UTF-8, or is longer than such a file can be: then it is another kind of
/// file, and is not read to its end.
pub fn read(file: &Path) -> io::Result<String> {
    let text = input::text(input::read_to(file, LONGEST)?)?;
    let long = text.lines().position(|line| line.len() > input::LINE);
    let Some(index) = long else {
        return Ok(text);
    };
    // Messages show lines.
    let (line, most) = (index + 1, input::LINE);
    Err(input::too_large(format!(
        "line {line} has more than {most} bytes"
    )))
}

/// Reads a file's text as TOML. What of it is none goes to the log.
pub fn parse<'s>(log: &mut Log<'_>, source: &'s str) -> Spanned<DeTable<'s>> {
    let (document, errors) = DeTable::parse_recoverable(source);
    // What stands in a table that comes again comes again with it.
    let mut told_with = 0;
    for error in errors {
        let place = error.span().unwrap_or(0..0);
        if place.start < told_with && error.message() == "duplicate key" {
            continue;
        }
        let told = format!("not TOML: {}", error.message());
        let allowed = match table_again(source, place.start) {
            Some(name) => {
                told_with = end_of_table(source, place.start, name);
                format!("allowed: each table once; `[[{name}]]` where it is one of several")
            }
            None => TOML.to_owned(),
        };
        log.report(place, told, allowed);
    }
    document
}

/// The name of a table whose header `[name]` comes a second time and begins before `place`.
fn table_again(source: &str, place: usize) -> Option<&str> {
    let before = source.get(..place)?;
    let start = before.rfind('\n').map_or(0, |at| at + 1);
    let header = source[start..].lines().next()?;
    let header = header.split('#').next().unwrap_or_default().trim();
    let name = header.strip_prefix('[')?.strip_suffix(']')?;
    let is_header = |line: &str| line.split('#').next().unwrap_or_default().trim() == header;
    (!name.starts_with('[') && source[..start].lines().any(is_header)).then_some(name)
}

/// Where the table `name`, whose header is at `place`, ends with the tables in it.
fn end_of_table(source: &str, place: usize, name: &str) -> usize {
    let mut end = place;
    for line in source
        .get(place..)
        .unwrap_or_default()
        .split_inclusive('\n')
    {
        let header = line.trim_start().strip_prefix('[');
        let inside = |header: &str| {
            let header = header.trim_start_matches('[').trim_start();
            header
                .strip_prefix(name)
                .is_some_and(|it| it.trim_start().starts_with('.'))
        };
        if end > place && header.is_some_and(|it| !inside(it)) {
            break;
        }
        end += line.len();
    }
    end
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_that_comes_again_wants_two_brackets() {
        let told = |text: &str| {
            let mut log = Log::new(text);
            parse(&mut log, text);
            let invalid = Invalid {
                file: Path::new("a.toml").into(),
                diagnostics: log.into_diagnostics(),
            };
            invalid.to_string()
        };
        let text = told("[axis]  # X\na = 1\n\n[axis]\na = 2\n");
        let expected = "a.toml:4:2: not TOML: duplicate key\n  4 | [axis]\n    |  ^^^^\n    \
                        = allowed: each table once; `[[axis]]` where it is one of several\n";
        assert_eq!(text, expected.trim_end());
        let text = told(
            "[axis]\na = 1\n[axis.b]\nc = 1\n[axis]\na = 2\n[axis.b]\nc = 1\n[d]\ne = 1\ne = 2\n",
        );
        assert_eq!(text.matches("duplicate key").count(), 2, "{text}");
        assert!(text.contains(":5:2:") && text.contains(":11:1:"), "{text}");
        for other in ["a = 1\na = 2\n", "[b]\na = 1\na = 2\n", "a = \n", "[a\n"] {
            assert!(told(other).contains("https://toml.io"), "{other:?}");
        }
    }
}
