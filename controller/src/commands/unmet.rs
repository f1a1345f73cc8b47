//! What a file of events asks for and does not get. A machine that refuses a command, or does not home, is inside
//! its limits all the while: its limits alone would let a day pass on which nothing was done. So each of these is
//! a violation of the result beside what its judges find.
//!
//! A program that `stop` ends, ended as the file says. One that is still held behind the last event, also where lines were
//! typed in its middle, did not end.

use crate::control::{Event as MachineEvent, Layout};
use crate::observe::record::{Place, Violation};
use crate::observe::summary::Summary;
use crate::session::{Event, Refused};

/// Who the commands of a file of events come from, in the log.
pub(super) const SOURCE: &str = "events";

/// See the module.
#[derive(Default)]
pub(super) struct Unmet {
    violations: Vec<Violation>,
}

impl Unmet {
    /// Takes what happens.
    pub(super) fn hear(&mut self, event: &Event, layout: &Layout, at: Place) {
        match event {
            Event::Refused(refused) => self.refused(refused, at),
            Event::Problem(error) => {
                let told = error.to_string();
                self.failed(told.lines().next().unwrap_or_default(), at);
            }
            Event::Machine(
                event @ (MachineEvent::HomingFailed { .. } | MachineEvent::ProbingFailed { .. }),
            ) => {
                self.failed(&event.describe(layout).unwrap_or_default(), at);
            }
            _ => {}
        }
    }

    /// A command was refused.
    pub(super) fn refused(&mut self, refused: &Refused, at: Place) {
        if refused.source == SOURCE {
            self.push(format!("refused: {}", refused.reason), at);
        }
    }

    /// A job is still held behind the last event.
    pub(super) fn held(&mut self, at: Place) {
        self.push("not ended: held behind the last event".to_owned(), at);
    }

    fn failed(&mut self, what: &str, at: Place) {
        self.push(format!("failed: {what}"), at);
    }

    fn push(&mut self, what: String, Place { time, line }: Place) {
        self.violations.push(Violation {
            what,
            axis: None,
            time,
            line,
            value: 1.0,
            limit: 0.0,
            unit: "",
        });
    }

    /// Has a result say so.
    pub(super) fn mark(mut self, summary: &mut Summary) {
        if self.violations.is_empty() {
            return;
        }
        summary.verdict = "fail";
        summary.violations.append(&mut self.violations);
        (summary.violations).sort_by(|one, other| one.time.total_cmp(&other.time));
    }
}
