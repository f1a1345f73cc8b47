//! `[[simulation.cutting]]`: the force of each tool that cuts.
//!
//! The model is that by which feed drives and spindles are sized, the specific cutting force:
//!
//! ```text
//! F = k_c b f
//! ```
//!
//! with the feed f of a turn and the width b of what is cut. It is the mean force: teeth that come and go,
//! chips whose thickness changes k_c (Kienzle's exponent), and what an edge rubs with however small the feed is, are left out.

use super::simulation::{number, number_or};
use syncline_strict_toml::{Log, Table};

/// How a tool cuts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// Its number; `None`: that of every tool that has none of its own.
    pub tool: Option<u32>,
    /// Specific cutting force, N/mm².
    specific: f64,
    /// Width of what is cut, mm.
    width: f64,
    /// What part of the force acts across the feed, to the left of it where positive, besides what acts against it.
    pub across: f64,
}

impl Cut {
    /// The force against the feed, N, at one of so many mm a turn.
    #[must_use]
    pub fn force(&self, feed: f64) -> f64 {
        self.specific * self.width * feed
    }

    /// How the tool with that number cuts, if it does.
    #[must_use]
    pub fn of(cuts: &[Self], tool: u32) -> Option<&Self> {
        let own = cuts.iter().find(|cut| cut.tool == Some(tool));
        own.or_else(|| cuts.iter().find(|cut| cut.tool.is_none()))
    }
}

/// The tables `[[simulation.cutting]]`.
pub(super) fn read(log: &mut Log<'_>, tables: Vec<Table<'_, '_>>) -> Vec<Cut> {
    let mut cuts: Vec<Cut> = Vec::new();
    for mut table in tables {
        let tool = table.integer_if(log, "tool", 0..=99_999, "");
        let specific = number(log, &mut table, "specific_force", 1.0..=50_000.0, "(N/mm²)");
        let width = number(log, &mut table, "width", 1e-3..=1e3, "(mm)");
        let across = number_or(
            log,
            &mut table,
            "across",
            0.0,
            -2.0..=2.0,
            "(a part of the force)",
        );
        let span = tool.as_ref().map_or(table.span.clone(), |tool| tool.span());
        let title = table.title.clone();
        table.finish(log);
        let tool = tool.map(|tool| tool.into_inner() as u32);
        if cuts.iter().any(|cut| cut.tool == tool) {
            let which = tool.map_or("every tool".to_owned(), |tool| format!("tool {tool}"));
            let problem = format!("{title}: a second one of {which}");
            log.report(
                span,
                problem,
                "allowed: one for each `tool`, and one without `tool`",
            );
            continue;
        }
        if let (Some(specific), Some(width)) = (specific, width) {
            cuts.push(Cut {
                tool,
                specific,
                width,
                across,
            });
        }
    }
    cuts
}
