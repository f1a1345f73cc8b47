//! Frames on their way from the drive's processor to its CAN controller.

use crate::twin::random::Random;
use core::ops::Range;
use syncline_canopen::time::Duration;
use syncline_canopen::{Frame, Instant, Transmit};

/// Frames that leave after a delay.
#[derive(Clone, Debug)]
pub(super) struct Outbox {
    random: Random,
    /// In the order in which they leave.
    frames: Vec<(Instant, Frame)>,
    muted: bool,
}

impl Outbox {
    pub(super) fn new(random: Random) -> Self {
        Self {
            random,
            frames: Vec::with_capacity(32),
            muted: false,
        }
    }

    /// Loses every frame from now on, or no longer.
    pub(super) fn mute(&mut self, muted: bool) {
        self.muted = muted;
        self.frames.clear();
    }

    /// Forgets what has not left.
    pub(super) fn clear(&mut self) {
        self.frames.clear();
    }

    /// Sends a frame after a random delay within `delay`, not before an earlier one of the same
    /// identifier.
    pub(super) fn send_within(&mut self, now: Instant, delay: &Range<Duration>, frame: Frame) {
        let earlier = self
            .frames
            .iter()
            .filter(|(_, waiting)| waiting.id() == frame.id())
            .map(|(due, _)| *due)
            .max();
        let due = now + self.pick(delay);
        self.queue(earlier.map_or(due, |earlier| earlier.max(due)), frame);
    }

    /// Sends a frame a random delay within `delay` after everything that waits: an event is told
    /// after the SDO answer that confirms its cause (the order of the manual's examples).
    pub(super) fn send_behind(&mut self, now: Instant, delay: &Range<Duration>, frame: Frame) {
        let last = self.frames.last().map_or(now, |(due, _)| *due);
        let due = last.max(now) + self.pick(delay);
        self.queue(due, frame);
    }

    fn pick(&mut self, delay: &Range<Duration>) -> Duration {
        let span = delay.end.saturating_sub(delay.start).as_nanos() as f64;
        delay.start + Duration::from_nanos((self.random.unit() * span) as u64)
    }

    fn queue(&mut self, due: Instant, frame: Frame) {
        if self.muted {
            return;
        }
        let place = self.frames.partition_point(|(other, _)| *other <= due);
        self.frames.insert(place, (due, frame));
    }

    /// Hands over what is due.
    pub(super) fn flush(&mut self, now: Instant, tx: &mut dyn Transmit) {
        let due = self.frames.partition_point(|(due, _)| *due <= now);
        for (_, frame) in self.frames.drain(..due) {
            tx.transmit(frame);
        }
    }

    pub(super) fn deadline(&self) -> Option<Instant> {
        self.frames.first().map(|(due, _)| *due)
    }
}
