//! `syncline doctor`: can this host hold a cycle, and what would help?

use super::Exit;
use crate::doctor::{Host, Weight, try_realtime};
use serde_json::json;

/// Inspect this host for what helps or hurts a cycle, with what each shortcoming costs and what to
/// type against it.
///
/// Reads /proc and /sys and asks the kernel for what a run asks for; changes nothing. Exit code 1
/// if something is found with which no cycle of a few milliseconds is safe.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The core that the cycle is to run on
    #[arg(long)]
    core: Option<usize>,
    /// Print JSON instead of text
    #[arg(long)]
    json: bool,
}

impl Args {
    /// Prints the findings.
    pub(super) fn execute(&self) -> Exit {
        let mut findings = Host::here(self.core).examine();
        findings.extend(try_realtime(self.core));
        let worst = findings.iter().map(|finding| finding.weight).max();
        if self.json {
            let rows = findings.iter().map(|finding| {
                json!({
                    "what": finding.what,
                    "found": finding.found,
                    "weight": match finding.weight {
                        Weight::Good => "good",
                        Weight::Unknown => "unknown",
                        Weight::Costly => "costly",
                        Weight::Bad => "bad",
                    },
                    "advice": finding.advice,
                })
            });
            println!("{:#}", json!({ "findings": rows.collect::<Vec<_>>() }));
        } else {
            for finding in &findings {
                println!("{finding}");
            }
        }
        if worst == Some(Weight::Bad) {
            Exit::Stopped
        } else {
            Exit::Finished
        }
    }
}
