//! One self-contained HTML file about a run, which needs no network.
//!
//! - `html`: the page and its order
//! - `tables`: what the run came to
//! - `toolpath`: the path from above and in space
//! - `worst`: where the tool was furthest from the path
//! - `circles`: the circular test, with a picture of each circle
//! - `strips`: values over time, which `script.js` draws from what `data` packs
//! - `identified`: a page about an axis that was identified
//! - `plot`, `spectrum`, `distribution`: values over anything else; `scale`: from values to places on the page
//!
//! All that stands still is in the page as it is written. The script draws the strips, so that they can be zoomed, and ties
//! them to the tool path and to the program by one cursor.

mod circles;
mod data;
mod distribution;
mod html;
mod identified;
mod plot;
mod scale;
mod spectrum;
mod strips;
mod tables;
mod toolpath;
mod worst;

use crate::observe::record::{AxisReport, Report, Violation};
use crate::observe::summary::Summary;

impl Report {
    /// The file's text, with what a program's run came to.
    #[must_use]
    pub fn to_html(&self, summary: Option<&Summary>) -> String {
        html::page(self, summary)
    }
}
