//! The encoder of an axis beside its drives: what these learn from it, and whether both say the same.
//!
//! Positions of different SYNCs say nothing about each other. A drive that tells its position when it is asked is compared
//! where it rests. Where it goes to a target by itself the encoder has to rest as well, as what was asked for is of an instant
//! before. Where it has none, it does not set off: what the encoder does meanwhile is not the drive's doing.

use super::super::STILL;
use super::super::fault::{AxisCause, Fault};
use super::super::layout::AxisFeedback;
use super::super::node::DeviceNode;
use super::AxisControl;

impl AxisControl {
    /// Without a reference, counts from where each side stands, or from where the axis' encoder says, where that
    /// [teaches](AxisFeedback::teaches) them.
    pub(in crate::control) fn count_from_here(
        &self,
        nodes: &mut [DeviceNode],
    ) -> Result<(), Fault> {
        for &drive in &self.spec.drives {
            let there = match self.spec.feedback.filter(|it| it.teaches) {
                Some(it) => nodes[drive].increments(nodes[it.encoder].actual_mm())?,
                None if self.is_placed() => continue,
                None => nodes[drive].scaling().zero(),
            };
            let node = &mut nodes[drive];
            node.origin = node.actual() - there;
        }
        Ok(())
    }

    /// What its encoder teaches its drives they learn anew before they are enabled: without power they may have been moved.
    pub(in crate::control) fn learn_place(&self, nodes: &mut [DeviceNode]) -> Result<(), Fault> {
        match self.spec.feedback.is_some_and(|it| it.teaches) {
            true => self.count_from_here(nodes),
            false => Ok(()),
        }
    }

    /// Whether the encoder of the axis says what its drives say, of a gantry pair the mean of both.
    ///
    /// Both absolute positions are compared, so that what slipped while the machine was off shows too.
    pub(in crate::control) fn check_feedback(&self, nodes: &[DeviceNode]) -> Result<(), Fault> {
        let Some(AxisFeedback {
            encoder,
            difference: allowed,
            ..
        }) = self.compared()
        else {
            return Ok(());
        };
        let encoder = &nodes[encoder];
        let drives = self.spec.drives.iter().map(|&drive| &nodes[drive]);
        let stays = self.point_to_point.is_some() && !self.goes();
        let is_told = |drive: &DeviceNode| match drive.answers_sync() {
            true => drive.age() == encoder.age(),
            false => self.rests(drive) && (stays || self.rests(encoder)),
        };
        if !drives.clone().all(is_told) {
            return Ok(());
        }
        let count = drives.len() as f64;
        let mean = drives.map(DeviceNode::actual_mm).sum::<f64>() / count;
        let difference = encoder.actual_mm() - mean;
        if difference.abs() > allowed {
            let axis = self.index;
            let cause = AxisCause::FeedbackDifference { difference };
            return Err(Fault::Axis(axis, cause));
        }
        Ok(())
    }

    /// Whether its encoder moves still, which is to be held against a drive that has told that it stands.
    pub(super) fn awaits_comparison(&self, nodes: &[DeviceNode]) -> bool {
        let polled = !nodes[self.drive()].answers_sync();
        polled
            && self
                .compared()
                .is_some_and(|it| !self.rests(&nodes[it.encoder]))
    }

    /// What is held against its drives.
    fn compared(&self) -> Option<AxisFeedback> {
        self.spec.feedback.filter(|_| self.is_placed())
    }

    /// Whether a device has stood for long.
    fn rests(&self, node: &DeviceNode) -> bool {
        f64::from(node.still()) * self.period >= STILL.as_secs_f64()
    }
}
