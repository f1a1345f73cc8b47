//! What the count of a device means: from which position it counts, and whether that still holds.

use super::DeviceNode;
use crate::machine::{Kept, OtherMark};
use syncline_canopen::{Instant, nmt};
use syncline_drives::model::{Increments, Monitoring, unwrapped};

impl DeviceNode {
    /// Takes up where it counted when the machine was on last: how far it has moved since, increments.
    pub(in crate::control) fn recall(&mut self, kept: &Kept) -> Increments {
        let range = self.device.feedback().and_then(|feedback| feedback.range());
        let counts = unwrapped(self.place.counts(), range, kept.position);
        self.place.move_to(counts);
        self.place.set_origin(kept.origin);
        counts - kept.position
    }

    /// What shows that it, or the motor that counts for it, is another one than the one whose count was kept: an object, and what
    /// that reads now and read before.
    pub(in crate::control) fn other_mark(&self, kept: &Kept) -> Option<OtherMark> {
        let read = self.sequence.marks();
        let marks = (self.device.spec().marks.into_iter()).zip(read.into_iter().zip(kept.marks));
        let mut others = marks.filter_map(|(object, (now, before))| {
            let (object, before) = (object?, before?);
            (now != Some(before)).then_some(OtherMark {
                object,
                before,
                now,
            })
        });
        others.next()
    }

    /// What is to be kept of it.
    pub(in crate::control) fn kept(&self) -> Kept {
        Kept {
            origin: self.place.origin(),
            position: self.place.counts(),
            marks: self.sequence.marks(),
        }
    }

    /// Whether it may count otherwise than when its count was last known.
    pub(in crate::control) fn has_lost_count(&self) -> bool {
        self.lost_count
    }

    /// Notices that it may have begun anew without a word of it: it told by signs of life that it runs, and does so no more, or
    /// by its T_PDOs, while it `runs`. Also of one of which nothing else is expected any more.
    pub(in crate::control) fn watch_count(&mut self, now: Instant, runs: bool) {
        self.lost_count |= match self.monitoring() {
            Monitoring::Heartbeat | Monitoring::Guarding { .. } => {
                let ran = self.heartbeat.state() == Some(nmt::State::Operational);
                ran && !self.heartbeat.is_alive(now)
            }
            Monitoring::TPdos => runs && self.is_sampled() && !self.is_fresh(),
            Monitoring::Poll(_) => false,
        };
    }

    /// Its reset is over: it begins anew by itself from now on.
    pub(in crate::control) fn end_reset(&mut self) {
        self.resetting = false;
    }

    /// It may count otherwise from now on.
    pub(in crate::control) fn lose_count(&mut self) {
        self.lost_count = true;
    }

    /// Its count is known from now on.
    pub(in crate::control) fn keep_count(&mut self) {
        self.lost_count = false;
    }
}
