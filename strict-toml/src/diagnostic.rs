//! What is wrong with a file, and where.

use super::rest::{Gaps, Rest};
use std::{fmt, ops::Range, path::PathBuf};
use thiserror::Error;

/// One thing wrong at one place of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// 1-based.
    pub line: usize,
    /// 1-based, in characters.
    pub column: usize,
    /// What is wrong: the table, the key, the value.
    pub problem: String,
    /// What is allowed, and what to do.
    pub help: String,
    text: String,
    width: usize,
}

impl Diagnostic {
    fn new(source: &str, span: Range<usize>, problem: String, help: String) -> Self {
        let at = char_start(source, span.start);
        let line_start = source[..at].rfind('\n').map_or(0, |newline| newline + 1);
        let text = source[line_start..].lines().next().unwrap_or_default();
        let column = source[line_start..at].chars().count() + 1;
        let end = char_start(source, span.end.max(at));
        let marked = source[at..end].lines().next().unwrap_or_default();
        Self {
            line: source[..line_start].matches('\n').count() + 1,
            column,
            problem,
            help,
            text: text.into(),
            width: marked.chars().count().max(1),
        }
    }
}

/// The start of the character that `index` is in, or the end.
pub(crate) fn char_start(source: &str, index: usize) -> usize {
    let mut at = index.min(source.len());
    while !source.is_char_boundary(at) {
        at -= 1;
    }
    at
}

/// Everything wrong with a file, in the order of its lines.
#[derive(Clone, Debug, Error)]
pub struct Invalid {
    /// The file as it was named.
    pub file: PathBuf,
    /// At least one.
    pub diagnostics: Vec<Diagnostic>,
}

/// `file:line:column: problem`, the line with the place marked, and the help.
impl fmt::Display for Invalid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, diagnostic) in self.diagnostics.iter().enumerate() {
            let Diagnostic {
                line,
                column,
                problem,
                help,
                text,
                width,
            } = diagnostic;
            if n > 0 {
                writeln!(f)?;
            }
            writeln!(f, "{}:{line}:{column}: {problem}", self.file.display())?;
            let number = line.to_string();
            let margin = " ".repeat(number.len());
            let indent: String = text
                .chars()
                .take(column - 1)
                .map(|c| if c == '\t' { c } else { ' ' })
                .collect();
            writeln!(f, "  {number} | {text}")?;
            writeln!(f, "  {margin} | {indent}{}", "^".repeat(*width))?;
            write!(f, "  {margin} = {help}")?;
        }
        Ok(())
    }
}

/// Collects diagnostics while a file is read.
#[derive(Debug)]
pub struct Log<'s> {
    source: &'s str,
    found: Vec<(usize, Diagnostic)>,
    gaps: Gaps,
    is_of_rest: bool,
}

impl<'s> Log<'s> {
    /// Nothing is wrong yet with the file of this text.
    pub fn new(source: &'s str) -> Self {
        Self {
            source,
            found: Vec::new(),
            gaps: Gaps::default(),
            is_of_rest: false,
        }
    }

    /// Nothing is wrong yet with what is left of a file, whose whole text is `source`, but for the lines of it that are no
    /// TOML either.
    pub fn of_rest(source: &'s str, rest: &Rest) -> Self {
        let mut log = Self {
            gaps: rest.gaps().clone(),
            is_of_rest: true,
            ..Self::new(source)
        };
        for (span, why) in rest.hidden() {
            log.report(span.clone(), format!("not TOML: {why}"), super::TOML);
        }
        log
    }

    /// Whether that key of the table whose header is there is missing because its line was left out.
    pub(crate) fn is_left_out(&self, table: &Range<usize>, key: &str) -> bool {
        self.gaps.has(table, key)
    }

    /// Whether one of those keys was left out of any table, or a whole table.
    pub fn lacks(&self, keys: &[&str]) -> bool {
        self.gaps.any(keys)
    }

    /// Adds what is wrong with what is left of the same file.
    pub fn append(&mut self, rest: Log<'_>) {
        self.found.extend(rest.found);
    }

    /// Adds a mistake at a place, given in bytes of the text.
    pub fn report(
        &mut self,
        span: Range<usize>,
        problem: impl Into<String>,
        help: impl Into<String>,
    ) {
        let start = span.start;
        let diagnostic = Diagnostic::new(self.source, span, problem.into(), help.into());
        self.found.push((start, diagnostic));
    }

    /// Whether it is of what is left of a file, of which something is wrong already.
    pub fn is_of_rest(&self) -> bool {
        self.is_of_rest
    }

    /// Whether nothing is wrong so far.
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// Everything that is wrong, in the order of the text.
    pub fn into_diagnostics(mut self) -> Vec<Diagnostic> {
        self.found.sort_by_key(|(start, _)| *start);
        self.found.into_iter().map(|(_, found)| found).collect()
    }
}
