//! A drive that homes by itself: it leaves the mode in which it follows setpoints, and comes back to it.

use super::{DeviceNode, Step};
use crate::machine::DriveHoming;
use syncline_drives::model::{OwnHoming, PowerCommand};

impl DeviceNode {
    /// Whether it homes by itself, or has not come back from there.
    pub(in crate::control) fn homes(&self) -> bool {
        self.homes
    }

    /// It follows no setpoints from now on: it holds its position, or moves as it likes.
    pub(in crate::control) fn begin_homing(&mut self) {
        self.homes = true;
        self.power = PowerCommand::Enable;
    }

    /// It follows setpoints again.
    pub(in crate::control) fn end_homing(&mut self) {
        self.homes = false;
    }

    /// Has it come to rest where it is.
    pub(in crate::control) fn halt_homing(&mut self) {
        if self.homes && !self.is_quick_stopped() {
            self.power = PowerCommand::Halt;
        }
    }

    /// Ends the mode in which it follows setpoints. What was halted on its way home stays so until it is off: it might go
    /// on.
    pub(in crate::control) fn end_mode(&mut self) {
        if self.power != PowerCommand::Halt {
            self.power = PowerCommand::Enable;
        }
    }

    /// For how many cycles it has moved since it was told to halt, where it stands still after so many cycles at one place.
    pub(in crate::control) fn watch_halt(&mut self, still: u32) -> u64 {
        let moves = self.power == PowerCommand::Halt && self.still() < still;
        self.unhalted = if moves { self.unhalted + 1 } else { 0 };
        self.unhalted
    }

    /// Whether it does not count any more from where it found its place by itself.
    pub(in crate::control) fn is_not_home(&self) -> bool {
        self.is_sampled() && !self.status.is_homed
    }

    /// Its setpoint goes along with where it is while it moves as it likes. While requests travel it stays as it is: it would
    /// follow the encoder's noise, and an answer that is in the way of a burst would make it a late one.
    pub(in crate::control) fn go_along(&mut self) {
        if matches!(self.power, PowerCommand::Home | PowerCommand::Halt) {
            self.hold();
        }
    }

    fn own_homing(&self, how: &DriveHoming) -> Option<OwnHoming> {
        let speeds = [how.speed, how.slow_speed];
        let speeds = speeds.map(|speed| self.scaling().to_increments_per_second(speed).abs());
        self.device.drive()?.homing(how.method, speeds)
    }

    /// The steps to the mode in which it homes by itself.
    pub(in crate::control) fn ask_homing(&mut self, how: &DriveHoming) {
        if let Some(homing) = self.own_homing(how) {
            self.sequence.extend(homing.begin.map(Step::Write));
            self.sequence.extend([Step::Mode(homing.mode)]);
        }
    }

    /// The step that asks how far its index pulse was from the edge of its switch, where it went by both.
    pub(in crate::control) fn ask_index(&mut self, how: &DriveHoming) {
        let index = self.own_homing(how).and_then(|homing| homing.index);
        self.sequence
            .extend(index.map(|index| Step::Note(0, index.object)));
    }

    /// How near to the edge the index pulse was that was asked for, or the one before or behind it: mm, and which part
    /// of a turn that is.
    pub(in crate::control) fn index_distance(&self, how: &DriveHoming) -> Option<(f64, f64)> {
        let index = self.own_homing(how)?.index?;
        let [noted, _] = self.sequence.noted();
        let turn = index.turn.get();
        let behind = i64::from(noted as i32).rem_euclid(turn);
        let near = behind.min(turn - behind) as f64;
        Some((near * self.scaling().resolution(), near / turn as f64))
    }

    /// The steps back from there.
    pub(in crate::control) fn ask_mode_back(&mut self, how: &DriveHoming) {
        let homing = self.own_homing(how);
        self.sequence.extend(homing.map(|it| Step::Write(it.end)));
        self.ask_mode();
    }
}
