//! Whether a drive stands, as it tells.

use super::DeviceNode;
use syncline_canopen::time::Duration;
use syncline_drives::model::Increments;

/// For how many cycles in a row a device has stayed within a window of where it was at their beginning.
#[derive(Clone, Copy, Debug)]
pub(super) struct Standstill {
    /// `None`: from what it tells next on.
    at: Option<Increments>,
    cycles: u32,
}

impl Standstill {
    pub(super) const NONE: Self = Self {
        at: Some(Increments::ZERO),
        cycles: 0,
    };

    /// It has to stay where it is for as long once more.
    pub(super) fn restart(&mut self) {
        self.cycles = 0;
    }

    /// So many cycles later it is there.
    fn go_on(&mut self, actual: Increments, window: Increments, cycles: u32) {
        match self.at {
            Some(at) if (actual - at).get().abs() <= window.get() => {
                self.cycles = self.cycles.saturating_add(cycles);
            }
            _ => {
                let at = Some(actual);
                *self = Self { at, cycles: 0 };
            }
        }
    }
}

impl DeviceNode {
    /// Standing still is moving less than this.
    pub(in crate::control) fn standstill_window(&self) -> Increments {
        self.spec().standstill_window
    }

    /// Cycles in a row that the drive has stood still.
    pub(in crate::control) fn still(&self) -> u32 {
        self.still.cycles
    }

    /// The same within what leaves it to be compared with what another device tells of a time nearby.
    pub(in crate::control) fn steady(&self) -> u32 {
        self.steady.cycles
    }

    /// Counts the cycles in which the drive has stood within its window, or has told no speed, and those in which it was to come
    /// to rest by itself. A cycle in which it is not heard says nothing, and one that is not heard any more may be anywhere.
    pub(in crate::control) fn watch_standstill(&mut self) {
        self.quick_stopped = self.quick_stopped.map(|cycles| cycles + 1);
        let turns = self.told_speed.is_some_and(|speed| speed != 0.0);
        if self.age >= self.patience() {
            self.forget_standstill();
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
        if turns {
            self.leave_standstill();
        }
        let spec = &self.layout.devices[self.index];
        self.still
            .go_on(self.place.counts(), spec.standstill_window, cycles);
        self.steady
            .go_on(self.place.counts(), spec.steady_window, cycles);
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
        self.still.restart();
        self.steady.restart();
    }

    /// Counts anew from where it next tells that it is.
    pub(in crate::control) fn leave_standstill(&mut self) {
        let anew = Standstill {
            at: None,
            cycles: 0,
        };
        (self.still, self.steady) = (anew, anew);
    }
}
