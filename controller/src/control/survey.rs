//! Drives that are found with power as the machine comes up.
//!
//! The controller that left them so may be gone, or may be at work: then whoever takes the power of its drives stops
//! its axes in motion. A controller of synchronised drives shows by its SYNC. So the drives' states are read, which
//! changes nothing, and where one has power the bus is listened to for [`LISTENS`], as long as the period of a SYNC can
//! be. A SYNC of another controller, as any frame that only a controller sends, is a fault (`Layout::second_master`);
//! until then no node has been commanded, and so none is on the way down.

use super::node::DeviceNode;
use super::{Controller, Outbox, Phase};
use crate::machine::LONGEST_CYCLE;
use syncline_canopen::time::Duration;

/// The longest period of a SYNC that a machine file can state. An object 1006h could hold one of an hour, but no drive follows setpoints
/// that come once in more than this.
const LISTENS: Duration = LONGEST_CYCLE;

impl<const N: usize> Controller<N> {
    /// Once the drives' states are read, has those switched off that have power, unless another controller is heard.
    pub(super) fn step_survey(&mut self, out: &mut [Outbox]) {
        if !self.sequences_done() {
            return;
        }
        if !self.nodes.iter().any(DeviceNode::is_found_on) {
            return self.enter(Phase::Boot, out);
        }
        if self.timed_out(LISTENS) {
            self.commands_nodes = true;
            self.nodes.iter_mut().for_each(DeviceNode::switch_found_off);
        }
    }
}
