//! The page and its parts.

use super::Report;

/// The whole file.
pub(super) fn page(report: &Report) -> String {
    format!(
        "<!doctype html><meta charset=utf-8><title>{}</title>",
        escape(&report.machine)
    )
}

/// Text as HTML shows it.
fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
