//! Whether a drive stands, as it tells.

use super::DeviceNode;
use syncline_canopen::time::Duration;
use syncline_drives::model::Increments;

impl DeviceNode {
    /// Standing still is moving less than this.
    pub(in crate::control) fn standstill_window(&self) -> Increments {
        self.spec().standstill_window
    }

    /// Cycles in a row that the drive has stood still.
    pub(in crate::control) fn still(&self) -> u32 {
        self.still
    }

    /// Counts the cycles in which the drive has stood within its window, or has told no speed, and those in which it was to come
    /// to rest by itself. A cycle in which it is not heard says nothing, and one that is not heard any more may be anywhere.
    pub(in crate::control) fn watch_standstill(&mut self) {
        self.quick_stopped = self.quick_stopped.map(|cycles| cycles + 1);
        let window = self.standstill_window();
        let turns = self.told_speed.is_some_and(|speed| speed != 0.0);
        if self.age >= self.patience() {
            self.still = 0;
            return;
        }
        if !self.has_answered() {
            return;
        }
        let cycles = match self.is_polled() && !self.answers_sync() {
            true => self.polls.pass_cycle(),
            false => Some(1),
        };
        let Some(cycles) = cycles else { return };
        if !turns && (self.actual - self.still_at).get().abs() <= window.get() {
            self.still = self.still.saturating_add(cycles);
        } else {
            self.still_at = self.actual;
            self.still = 0;
        }
    }

    /// Cycles since it told its position, where it is asked for that.
    pub(in crate::control) fn unknown(&self) -> u32 {
        self.polls.unknown()
    }

    /// How long it takes to answer a request at the most.
    pub(in crate::control) fn sdo_response(&self) -> Duration {
        self.device.spec().sdo_response
    }

    /// Counts anew.
    pub(in crate::control) fn forget_standstill(&mut self) {
        self.still = 0;
    }
}
