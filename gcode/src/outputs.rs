//! What a program has made of outputs up to a line that it begins at: of each the last code counts, and one
//! that waits for a motion counts from that motion on.

use super::axes::Point;
use super::command::{Action, Output};

/// Outputs on the way to a line.
pub(crate) struct PassedOutputs {
    /// The last code of each output, the oldest first.
    pub(crate) switched: Vec<Output>,
    /// Those that still wait for the next motion.
    pub(crate) await_motion: Vec<Output>,
    at: Point,
}

impl PassedOutputs {
    /// None yet, of a program that begins at `start`.
    pub(crate) fn new(start: Point) -> Self {
        Self {
            switched: Vec::new(),
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
            Action::Output(output) => return keep_last(&mut self.switched, *output),
            Action::Rapid { to } | Action::Feed { to, .. } if *to == self.at => return,
            Action::Tap { .. } => self.at,
            action => match action.destination() {
                Some(to) => to,
                None => return,
            },
        };
        self.at = to;
        for output in std::mem::take(&mut self.await_motion) {
            keep_last(&mut self.switched, output.at_once());
        }
    }
}

/// A code, instead of an earlier one of the same output.
fn keep_last(outputs: &mut Vec<Output>, output: Output) {
    outputs.retain(|earlier| !earlier.is_of_same_output(&output));
    outputs.push(output);
}
