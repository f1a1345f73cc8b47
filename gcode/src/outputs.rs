//! What a program has made of outputs up to a line that it begins at: a code that waits for a motion counts from that
//! motion on.

use super::axes::Point;
use super::command::{Action, Output, Outputs};

/// Outputs on the way to a line.
pub(crate) struct PassedOutputs {
    /// What they are there.
    pub(crate) outputs: Outputs,
    /// The codes that still wait for the next motion, of each output the last.
    pub(crate) await_motion: Vec<Output>,
    at: Point,
}

impl PassedOutputs {
    /// Of a program that begins at `start` with these.
    pub(crate) fn new(start: Point, outputs: Outputs) -> Self {
        Self {
            outputs,
            await_motion: Vec::new(),
            at: start,
        }
    }

    /// The position that the commands lead to.
    pub(crate) fn at(&self) -> Point {
        self.at
    }

    /// Passes the next command.
    pub(crate) fn pass(&mut self, action: &Action) {
        let to = match action {
            // What it does is not known, and cannot be made up for.
            Action::Output(Output::User { .. }) => return,
            Action::Output(output) if output.is_with_motion() => {
                return keep_last(&mut self.await_motion, *output);
            }
            Action::Output(output) => return self.outputs.switch(output),
            Action::Rapid { to } | Action::Feed { to, .. } if *to == self.at => return,
            Action::Tap { .. } => self.at,
            action => match action.destination() {
                Some(to) => to,
                None => return,
            },
        };
        self.moved(to);
    }

    /// A motion has led there.
    pub(crate) fn moved(&mut self, to: Point) {
        self.at = to;
        for output in self.await_motion.drain(..) {
            self.outputs.switch(&output);
        }
    }
}

/// A code, instead of an earlier one of the same output.
fn keep_last(outputs: &mut Vec<Output>, output: Output) {
    outputs.retain(|earlier| !earlier.is_of_same_output(&output));
    outputs.push(output);
}
