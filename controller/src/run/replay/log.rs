//! The log of a recorded run: whose frames are in it, and what its stamps say of the controller's clock.

use super::{Logged, NoReplay, ReplayBus};
use crate::control::Layout;
use crate::control::fault::DeviceIndex;
use std::collections::BTreeMap;
use std::sync::Arc;
use syncline_canopen::response_time::bit_time;
use syncline_canopen::{CanId, CobId, Frame, Instant};
use syncline_drives::bus::frame_bits;

/// Priority band of a frame of the controller's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Band {
    Sync,
    Burst,
    Acyclic,
}

/// The frames of a machine's buses, by their stamps.
pub(super) struct Log {
    pub(super) layout: Arc<Layout>,
    pub(super) buses: Vec<ReplayBus>,
    pub(super) frames: Vec<Logged>,
    /// The devices that are sent torques with their setpoints.
    torques: Vec<DeviceIndex>,
}

impl Log {
    pub(super) fn new(layout: Arc<Layout>, buses: Vec<ReplayBus>, frames: Vec<Logged>) -> Self {
        let devices = layout.devices.iter().enumerate();
        let torques = devices.filter(|(_, it)| it.device.takes_torque());
        Self {
            torques: torques.map(|(index, _)| index).collect(),
            layout,
            buses,
            frames,
        }
    }

    /// When the controller was first woken.
    pub(super) fn first_wake(&self) -> Result<Instant, NoReplay> {
        let cycle = self.layout.cycle.as_nanos() as i128;
        let heartbeat = CanId::from(CobId::error_control(self.layout.node));
        // A machine that was switched off before it had SYNC: its heartbeats leave where SYNC would.
        let is_mark = |it: &&Logged| match self.frames.iter().any(is_sync) {
            true => is_sync(it),
            false => it.frame.id() == heartbeat,
        };
        let starts = self.frames.iter().filter(is_mark);
        let starts = starts.map(|it| i128::from(self.start_of(it).as_nanos()));
        let mut starts = starts.peekable();
        let first = *starts.peek().ok_or(NoReplay::NoRun)?;
        // Each is some time late; the least late has the phase.
        let phase = starts
            .map(|start| start - (start - first + cycle / 2).div_euclid(cycle) * cycle)
            .min()
            .unwrap_or(first);
        // Whole microseconds, as all instants of a run; the stamps were rounded up to them.
        let phase = phase.div_euclid(1000) * 1000;
        let own = self.frames.iter().find(|it| self.band(it).is_some());
        let own = own.ok_or(NoReplay::NoBeginning)?;
        if own.frame.id() != heartbeat {
            return Err(NoReplay::NoBeginning);
        }
        // It may have been less late than every SYNC, by whose lateness the phase is off.
        let own = i128::from(self.start_of(own).as_nanos()) + cycle / 4;
        let before = (phase - own).div_euclid(cycle) + i128::from((phase - own) % cycle != 0);
        Ok(Instant::from_nanos((phase - before * cycle) as u64))
    }

    /// The instant at which a frame's first bit was on the bus.
    pub(super) fn start_of(&self, logged: &Logged) -> Instant {
        /// Behind the end of frame, before the bus is free.
        const INTERMISSION_BITS: u32 = 3;
        let bits = frame_bits(&logged.frame) - INTERMISSION_BITS;
        let length = bit_time(bits, self.buses[logged.bus].bitrate);
        Instant::from_nanos(
            logged
                .at
                .as_nanos()
                .saturating_sub(length.as_nanos() as u64),
        )
    }

    /// The band of a frame that only the controller sends.
    pub(super) fn band(&self, logged: &Logged) -> Option<Band> {
        let id = logged.frame.id();
        let is = |cob_id: CobId| id == CanId::from(cob_id);
        if is(CobId::SYNC) {
            return Some(Band::Sync);
        }
        if is(CobId::NMT) || is(CobId::error_control(self.layout.node)) {
            return Some(Band::Acyclic);
        }
        let mut devices = self.layout.buses[logged.bus].devices.iter();
        devices.find_map(|&index| {
            let device = &self.layout.devices[index].device;
            if device.spec().r_pdos.iter().any(|pdo| is(pdo.cob_id)) {
                Some(Band::Burst)
            } else {
                is(CobId::r_sdo(device.spec().node)).then_some(Band::Acyclic)
            }
        })
    }

    /// The place of the first frame that ended after `at`.
    pub(super) fn until(&self, at: Instant) -> usize {
        self.frames.partition_point(|it| it.at <= at)
    }

    /// A setpoint without the torque that a drive is sent with it: where the path comes to rest that changes once more.
    pub(super) fn aim(&self, frame: Frame) -> Frame {
        let mut devices = self
            .torques
            .iter()
            .map(|it| &self.layout.devices[*it].device);
        let aim = devices.find_map(|it| it.without_torque(&frame));
        aim.unwrap_or(frame)
    }

    /// When the first setpoint from `place` on is another than the one before it.
    pub(super) fn next_change(&self, place: usize) -> Option<Instant> {
        let mut last: BTreeMap<(usize, u32), Frame> = BTreeMap::new();
        let from = place.saturating_sub(16 * self.layout.devices.len() + 16);
        for (index, logged) in self.frames.iter().enumerate().skip(from) {
            if self.band(logged) != Some(Band::Burst) {
                continue;
            }
            let Logged { bus, frame, .. } = *logged;
            let frame = self.aim(frame);
            let before = last.insert((bus, frame.id().raw()), frame);
            if index >= place && before.is_some_and(|before| before != frame) {
                return Some(logged.at);
            }
        }
        None
    }

    /// Whether the cycle waited for its plan.
    pub(super) fn is_simulated(&self) -> bool {
        self.buses.iter().all(|bus| bus.simulated)
    }
}

pub(super) fn is_sync(logged: &Logged) -> bool {
    logged.frame.id() == CanId::from(CobId::SYNC)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;
    use proptest::prelude::*;
    use std::path::Path;
    use std::time::Duration;

    /// How late a wake-up comes, in thousandths of the cycle: a little, as nearly all do.
    const LATE: std::ops::Range<u32> = 0..240;

    proptest! {
        /// Each wake-up is some time late, another one each time; the first one is found where the least late SYNC
        /// has it, also where it was less late than that.
        #[test]
        fn the_first_wake_up_is_found_however_late_any_is(
            first in 10_000_u64..1_000_000,
            before in 1_u32..50,
            heartbeat in 0_u32..700,
            syncs in prop::collection::vec(LATE, 1..20),
        ) {
            let portal = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/portal/machine.toml");
            let layout = Arc::new(Layout::new(&Machine::load(&portal).unwrap()).unwrap());
            let cycle = layout.cycle;
            let first = Instant::from_nanos(1000 * first);
            let bitrate = 1_000_000;
            let sent = |frame: Frame, cycles: u32, late: u32| {
                let length = bit_time(frame_bits(&frame) - 3, bitrate);
                // Stamps are whole microseconds, rounded up.
                let at = (first + cycles * cycle + late * cycle / 1000 + length).as_nanos();
                Logged { at: Instant::from_nanos(at.next_multiple_of(1000)), bus: 0, frame }
            };
            let mut frames = vec![sent(
                Frame::new(CobId::error_control(layout.node), &[0x05]),
                0,
                heartbeat,
            )];
            let numbered = (before..).zip(&syncs);
            frames.extend(numbered.map(|(cycles, &late)| sent(Frame::new(CobId::SYNC, &[]), cycles, late)));
            let buses = vec![ReplayBus { bitrate, echoes: true, simulated: false }];
            let found = Log::new(layout, buses, frames).first_wake().unwrap();
            let least = syncs.iter().min().map_or(Duration::ZERO, |&late| late * cycle / 1000);
            prop_assert_eq!(
                found.as_nanos() / 1000,
                (first + least).as_nanos() / 1000,
                "where the least late SYNC has it"
            );
        }
    }
}
