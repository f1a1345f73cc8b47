//! The loop about the position of an axis whose drive is sent velocities, and what every axis is measured by: where it was
//! planned to be when it was last seen.

use super::super::node::DeviceNode;
use super::history::Planned;
use super::{AxisControl, OUTWARDS};

/// The velocity that a drive was sent last, in whole units of its own, mm/s; `None` if it is sent positions.
pub(super) fn sent_velocity(node: &DeviceNode) -> Option<f64> {
    let quantum = node.dynamics()?.quantum;
    let units = (node.setpoint.velocity / quantum).round();
    Some(units * quantum / node.scaling().to_increments_per_second(1.0))
}

impl AxisControl {
    /// How fast a side is sent to where it has to be: 0 for a drive that is sent positions.
    ///
    /// The velocity that the plan has on the way, led by the drive's lag, and what closes the loop about the
    /// position. The last sample is compared with where the axis should have been at its SYNC. While the
    /// next one is missing the axis is taken to go on as it is sent, which takes the loop's share off their difference
    /// in each cycle. When it is missing for longer than it may the drive follows the plan alone, as it does until it has
    /// made its test move.
    pub(super) fn velocity(&self, cycle: u64, side: usize, nodes: &[DeviceNode]) -> f64 {
        let node = &nodes[self.spec.drives[side]];
        let Some(dynamics) = node.dynamics() else {
            return 0.0;
        };
        let [before, there] = [1.0, 0.0].map(|earlier| {
            let planned = self.history.proposed(node.delay() + earlier);
            planned.of_side(side) + dynamics.lag * planned.velocity
        });
        let planned = (there - before) / self.period;
        let telling = &nodes[self.telling(side)];
        let left = 1.0 - dynamics.gain * self.period;
        let error = if telling.is_fresh() && self.tested {
            let seen = self.following_error(cycle - 1, side, nodes);
            (0..telling.age()).fold(seen, |error, _| error * left)
        } else {
            0.0
        };
        (node.scaling()).to_increments_per_second(planned + dynamics.gain * error)
    }

    /// Where a side is in the plan's frame, mm; `cycle` is that of the last SYNC.
    pub(super) fn actual(&self, cycle: u64, side: usize, nodes: &[DeviceNode]) -> f64 {
        self.told(cycle, side, nodes) - self.sent_to(cycle, side, nodes).correction
    }

    /// Where its drive, or what closes its position loop, has a side, mm: not corrected.
    pub(super) fn told(&self, cycle: u64, side: usize, nodes: &[DeviceNode]) -> f64 {
        if let Some(encoder) = self.loop_encoder() {
            return nodes[encoder].actual_mm();
        }
        nodes[self.spec.drives[side]].plan_mm() - OUTWARDS[side] * self.apart(cycle)
    }

    /// Where a side is taken to be that does not answer every SYNC and did not answer the last, mm: it goes on as it was planned
    /// to, with the error that was seen last.
    pub(super) fn goes_on(&self, cycle: u64, side: usize, nodes: &[DeviceNode]) -> Option<f64> {
        let telling = &nodes[self.telling(side)];
        let between = telling.age() > 0 && telling.has_answered();
        let now = || self.history.planned(cycle, self.lag).position;
        between.then(|| now() - self.following_error(cycle, side, nodes))
    }

    /// Where a side should have been at the SYNC of its last sample, mm; `cycle` is that of the last SYNC.
    pub(super) fn due(&self, cycle: u64, side: usize, nodes: &[DeviceNode]) -> f64 {
        self.sent_to(cycle, side, nodes).position
    }

    /// What that was of.
    pub(super) fn sent_to(&self, cycle: u64, side: usize, nodes: &[DeviceNode]) -> Planned {
        let age = nodes[self.telling(side)].age();
        self.history.planned(cycle, self.lag + f64::from(age))
    }

    /// By how much a side was behind that, mm.
    pub(in crate::control) fn following_error(
        &self,
        cycle: u64,
        side: usize,
        nodes: &[DeviceNode],
    ) -> f64 {
        self.due(cycle, side, nodes) - self.actual(cycle, side, nodes)
    }
}
