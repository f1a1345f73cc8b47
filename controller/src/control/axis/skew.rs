//! How far the sides of a gantry are from where they are planned to be against each other.

use super::super::fault::{AxisCause, Fault};
use super::super::node::DeviceNode;
use super::AxisControl;

/// A T_PDO of each side of a gantry may be missing, one behind the other, without their being compared in between; then
/// they are where no more SYNCs are between them.
const BY_TURNS: u32 = 2;

impl AxisControl {
    /// Whether the two sides of a gantry are further apart than allowed.
    pub(super) fn skewed(&self, difference: f64) -> bool {
        (self.spec.limits.skew).is_some_and(|allowed| difference > allowed)
    }

    /// Checks how far the sides of a gantry are from where they are planned to be against each other. Positions of
    /// different SYNCs are compared by how far the axis was planned to go from one to the other. That is off by what its lag
    /// changes meanwhile, and counts where they are near to each other and have not come to one SYNC for longer.
    pub(super) fn check_skew(
        &mut self,
        cycle: u64,
        apart: f64,
        nodes: &[DeviceNode],
    ) -> Result<(), Fault> {
        let [one, other] = self.spec.drives[..] else {
            return Ok(());
        };
        let (one, other) = (&nodes[one], &nodes[other]);
        self.apart_seen = match one.age() == other.age() {
            true => 0,
            false => self.apart_seen.saturating_add(1),
        };
        let planned = |node: &DeviceNode| {
            let age = f64::from(node.age());
            self.history.planned(cycle, self.lag + age).sent()
        };
        let went = planned(other) - planned(one);
        let difference = (other.actual_mm() - one.actual_mm() - apart - went).abs();
        let by_turns = self.apart_seen > BY_TURNS && one.age().abs_diff(other.age()) <= BY_TURNS;
        let counts = self.apart_seen == 0 || by_turns;
        if counts && self.skewed(difference) {
            let axis = self.index;
            return Err(Fault::Axis(axis, AxisCause::Skew { difference }));
        }
        Ok(())
    }
}
