//! The torque that a drive tells, and a drive whose torque is limited while its axis presses against a hard stop.
//!
//! What limited it before is read first, and comes back in every case: behind the search; where that was cut off, once
//! the axes rest; and at the latest before the drive is enabled again, or as the machine goes off.

use super::{DeviceNode, Step};
use syncline_drives::model::{Data, TorqueLimit, Write};

/// What limits a drive's torque.
#[derive(Clone, Copy, Debug)]
pub(super) enum Torque {
    /// What did before.
    Own,
    /// A homing; this brings back what did before.
    Lowered(Write),
    /// The same, and the drive is told that.
    Returning(Write),
}

impl Torque {
    /// What the drive was told, and has not answered yet, is not told it.
    pub(super) fn forget_steps(&mut self) {
        if let Self::Returning(back) = *self {
            *self = Self::Lowered(back);
        }
    }
}

impl DeviceNode {
    /// The torque that it told at the last SYNC, in the positive direction of its axis, if it tells one.
    pub(in crate::control) fn told_torque(&self) -> Option<i16> {
        let torque = self.told_torque.filter(|_| self.age == 0)?;
        Some(self.turned(torque.into()) as i16)
    }

    /// A torque in the positive direction of its axis, in that in which its positions grow, and the other way round.
    pub(in crate::control) fn turned(&self, torque: f64) -> f64 {
        self.scaling().direction().sign() * torque
    }

    fn torque_limit(&self) -> Option<TorqueLimit> {
        self.device.spec().model.torque_limit
    }

    /// The steps that ask what limits its torque now.
    pub(in crate::control) fn ask_torque(&mut self) {
        let by = self.torque_limit();
        let objects = by.into_iter().flat_map(|by| [by.limit, by.continuous]);
        let notes = objects
            .enumerate()
            .map(|(at, object)| Step::Note(at, object));
        self.sequence.extend(notes);
    }

    /// The steps that lower it to a share of the motor's continuous torque, once it is known what limits it now; false if
    /// that is no more.
    pub(in crate::control) fn lower_torque(&mut self, share: f64) -> bool {
        let Some(by) = self.torque_limit() else {
            return false;
        };
        let [own, continuous] = self.sequence.noted();
        let lowered = (share * f64::from(continuous)).clamp(1.0, f64::from(u16::MAX)) as u16;
        // 0 leaves the drive's own.
        if own != 0 && own <= lowered.into() {
            return false;
        }
        let write = |value| Write::new(by.limit.index, by.limit.sub, Data::u16(value));
        self.torque = Torque::Lowered(write(own as u16));
        let lowered = write(lowered);
        self.sequence
            .extend([Step::Write(lowered), Step::ReadBack(lowered)]);
        true
    }

    /// Whether a homing limits its torque.
    pub(in crate::control) fn is_weak(&self) -> bool {
        !matches!(self.torque, Torque::Own)
    }

    /// Whether it is limited by what did before; asks for that if it is not.
    pub(in crate::control) fn returns_torque(&mut self) -> bool {
        match self.torque {
            Torque::Own => {}
            Torque::Lowered(back) => {
                self.torque = Torque::Returning(back);
                self.sequence
                    .extend([Step::Write(back), Step::ReadBack(back)]);
            }
            Torque::Returning(_) if self.is_sequence_done() => self.torque = Torque::Own,
            Torque::Returning(_) => {}
        }
        !self.is_weak()
    }

    /// The same of a drive that may not answer any more; before it is enabled again it is asked once more.
    pub(in crate::control) fn release_torque(&mut self) {
        if let Torque::Lowered(back) = self.torque {
            self.sequence.extend([Step::Release(back)]);
        }
    }
}
