//! Drives that are found with power as the machine comes up.
//!
//! The controller that left them so may be gone, or may be at work: then whoever takes the power of its drives stops
//! its axes in motion. A controller of synchronised drives shows by its SYNC. So the drives' states are read, which
//! changes nothing, and where one has power the bus is listened to for [`LISTENS`], longer than the period of a SYNC can
//! be. A SYNC, an NMT command and a heartbeat with this controller's own node number come of another controller, and are a
//! fault (`Layout::second_master`); until then no node has been commanded, and none is on the way down, also behind a reset of this controller, which may have commanded them before. A controller that
//! sends none of these in that time is not heard.

use super::node::DeviceNode;
use super::reaction::Cause;
use super::{Controller, Outbox, Phase};
use crate::machine::LONGEST_CYCLE;
use syncline_canopen::time::Duration;

/// The longest period of a SYNC that a machine file can state, and a tenth: the other's clock is another, and its frames are late at times.
/// An object 1006h could hold a period of an hour, but no drive follows setpoints that come once in more than this.
const LISTENS: Duration = Duration::from_millis(LONGEST_CYCLE.as_millis() as u64 / 10 * 11);

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

    /// How it goes on where the survey is broken off. Where another controller was heard its nodes stay as they are, also those that this
    /// one has commanded before a reset.
    pub(super) fn leave_survey(&mut self) -> Phase {
        self.left_to_another =
            (self.faults.iter()).any(|fault| fault.cause() == Cause::SecondMaster);
        if !self.left_to_another {
            return Phase::Release;
        }
        self.commands_nodes = false;
        self.nodes.iter_mut().for_each(DeviceNode::leave);
        Phase::PreOperational
    }
}
