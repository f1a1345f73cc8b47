//! Connection monitoring: heartbeat both ways, node and life guarding (lxm32m 1027-1104).

use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, CobId, Frame, Instant, NodeId, nmt};

/// Heartbeats of other nodes that the drive watches (1016h).
const CONSUMERS: usize = 3;

/// A node whose heartbeat is watched.
#[derive(Clone, Copy, Debug)]
struct Watched {
    node: NodeId,
    time: Duration,
    /// `None` until its first heartbeat (lxm32m 1102).
    due: Option<Instant>,
}

/// Who has to hear from whom, and when.
#[derive(Clone, Debug)]
pub(super) struct Monitoring {
    node: NodeId,
    produce_every: Duration,
    produce_at: Option<Instant>,
    watched: [Option<Watched>; CONSUMERS],
    life_time: Duration,
    guard_due: Option<Instant>,
    toggle: bool,
}

impl Monitoring {
    /// As the objects say.
    pub(super) fn new(node: NodeId, objects: &Dictionary, now: Instant) -> Self {
        let mut monitoring = Self {
            node,
            produce_every: Duration::ZERO,
            produce_at: None,
            watched: [None; CONSUMERS],
            life_time: Duration::ZERO,
            guard_due: None,
            toggle: false,
        };
        for index in [0x1016, 0x1017, 0x100C] {
            monitoring.reconfigure(objects, index, now);
        }
        monitoring
    }

    /// Takes over changed parameters.
    pub(super) fn reconfigure(&mut self, objects: &Dictionary, index: u16, now: Instant) {
        let number = |index, sub| objects.value(index, sub).unwrap_or(0) as u32;
        match index {
            0x1017 => {
                self.produce_every = Duration::from_millis(number(0x1017, 0).into());
                self.produce_at = (!self.produce_every.is_zero()).then_some(now);
            }
            0x1016 => {
                for (place, watched) in self.watched.iter_mut().enumerate() {
                    let entry = number(0x1016, place as u8 + 1);
                    let time = Duration::from_millis((entry & 0xFFFF).into());
                    *watched = NodeId::new((entry >> 16) as u8)
                        .filter(|_| !time.is_zero())
                        .map(|node| Watched {
                            node,
                            time,
                            due: None,
                        });
                }
            }
            0x100C | 0x100D => {
                let millis = u64::from(number(0x100C, 0)) * u64::from(number(0x100D, 0));
                self.life_time = Duration::from_millis(millis);
                self.guard_due = None;
            }
            _ => {}
        }
    }

    /// A frame of error control: another node's heartbeat, or a guarding request, which is
    /// answered.
    pub(super) fn on_frame(
        &mut self,
        now: Instant,
        frame: &Frame,
        state: nmt::State,
    ) -> Option<Frame> {
        let own = CobId::error_control(self.node);
        if frame.is_remote() {
            if frame.id() != own.into() {
                return None;
            }
            self.guard_due = (!self.life_time.is_zero()).then(|| now + self.life_time);
            let toggle = self.toggle;
            self.toggle = !toggle;
            return Some(Frame::new(own, &[state as u8 | u8::from(toggle) << 7]));
        }
        for watched in self.watched.iter_mut().flatten() {
            if frame.id() == CanId::from(CobId::error_control(watched.node)) {
                watched.due = Some(now + watched.time);
            }
        }
        None
    }

    /// The heartbeat if it is due.
    pub(super) fn produce(&mut self, now: Instant, state: nmt::State) -> Option<Frame> {
        if self.produce_at? > now {
            return None;
        }
        self.produce_at = Some(now + self.produce_every);
        Some(Frame::new(CobId::error_control(self.node), &[state as u8]))
    }

    /// Whether somebody who should be heard has fallen silent; told once.
    pub(super) fn lost(&mut self, now: Instant) -> bool {
        let late = |due: &mut Option<Instant>| due.take_if(|due| *due <= now).is_some();
        let mut lost = late(&mut self.guard_due);
        for watched in self.watched.iter_mut().flatten() {
            lost |= late(&mut watched.due);
        }
        lost
    }

    /// When [`Self::produce`] or [`Self::lost`] has something to say at the latest.
    pub(super) fn deadline(&self) -> Option<Instant> {
        let watched = self
            .watched
            .iter()
            .flatten()
            .filter_map(|watched| watched.due);
        watched.chain(self.produce_at).chain(self.guard_due).min()
    }
}
