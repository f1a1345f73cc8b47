//! TOML files, read strictly: what is unknown, missing, doubled, out of range or contradictory is an
//! [`Invalid`] that says for each mistake where it stands, what is allowed and what was probably
//! meant.

mod diagnostic;
mod table;

pub(crate) use diagnostic::Log;
pub use diagnostic::{Diagnostic, Invalid};
pub(crate) use table::{Table, integer, nearest, one_of};

use toml::Spanned;
use toml::de::DeTable;

/// Reads a file's text as TOML; what of it is none goes to the log.
pub(crate) fn toml<'s>(log: &mut Log<'_>, source: &'s str) -> Spanned<DeTable<'s>> {
    let (document, errors) = DeTable::parse_recoverable(source);
    for error in errors {
        log.report(
            error.span().unwrap_or(0..0),
            format!("not TOML: {}", error.message()),
            "allowed: tables, keys and values as on https://toml.io",
        );
    }
    document
}
