//! One self-contained HTML file about a run: verdict, tool path, every axis against its limits,
//! following error, distribution of cycle times. No network, no script.

mod chart;
mod distribution;
mod html;
mod scale;
mod toolpath;

use crate::observe::record::{AxisReport, Report, Violation};

impl Report {
    /// The file's text.
    #[must_use]
    pub fn to_html(&self) -> String {
        html::page(self)
    }
}
