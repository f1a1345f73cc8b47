//! The encoder of an axis beside its drives: what these learn from it, and whether both say the same.
//!
//! Positions of different SYNCs say nothing about each other. What a drive tells that is asked for its position is of an
//! instant before. So it is held against its encoder once that has stood since, and besides for as long as an answer may have
//! been on its way, [`STILL`] at the least: within a [part](STEADY) of the difference that is allowed, so that both are of one place. A drive
//! that goes to targets by itself and has none does not set off: where it rests, whatever the encoder does is not its doing.
//! That each stands within `standstill_window` is not enough: both may creep by twice that, and one that sets off, or falls
//! silent as it does, was told to have lost steps.

use super::super::STILL;
use super::super::fault::{AxisCause, Fault};
use super::super::layout::{AxisFeedback, Teaches};
use super::super::node::DeviceNode;
use super::AxisControl;

/// The part of the difference that is allowed by which an encoder may move and still stands.
pub(in crate::control) const STEADY: f64 = 0.25;

impl AxisControl {
    /// Without a reference, counts from where each side stands, or from where the axis' encoder says, where that
    /// [teaches](AxisFeedback::teaches) them.
    pub(in crate::control) fn count_from_here(
        &self,
        nodes: &mut [DeviceNode],
    ) -> Result<(), Fault> {
        for &drive in &self.spec.drives {
            let teaches = |it: &AxisFeedback| it.teaches != Teaches::Never;
            let there = match self.spec.feedback.filter(teaches) {
                Some(it) => {
                    let there = nodes[it.encoder].actual_mm();
                    nodes[drive].increments(there + self.correction_at(there))?
                }
                None if self.is_placed() => continue,
                None => nodes[drive].scaling().zero(),
            };
            let node = &mut nodes[drive];
            node.set_origin(node.actual() - there);
        }
        Ok(())
    }

    /// Drives that do not see how they are moved without power learn their place anew before they are enabled.
    pub(in crate::control) fn learn_place(&self, nodes: &mut [DeviceNode]) -> Result<(), Fault> {
        match self.spec.feedback.map(|it| it.teaches) {
            Some(Teaches::AtEnabling) => self.count_from_here(nodes),
            _ => Ok(()),
        }
    }

    /// Whether the encoder of the axis says what its drives say, of a gantry pair the mean of both.
    ///
    /// Both absolute positions are compared, so that what slipped while the machine was off shows too, unless the drives learned
    /// their place from the encoder since.
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
        let is_told = |drive: &DeviceNode| match drive.answers_sync() {
            true => drive.age() == encoder.age(),
            false => self.has_stood(encoder, drive) || self.stays() && self.rests(drive),
        };
        if !drives.clone().all(is_told) {
            return Ok(());
        }
        let count = drives.len() as f64;
        let mean = drives.map(DeviceNode::actual_mm).sum::<f64>() / count;
        let difference = encoder.actual_mm() - self.uncorrected(mean);
        if difference.abs() > allowed {
            let axis = self.index;
            let cause = AxisCause::FeedbackDifference { difference };
            return Err(Fault::Axis(axis, cause));
        }
        Ok(())
    }

    /// Whether its encoder is still to be held against a drive that has told that it stands.
    pub(super) fn awaits_comparison(&self, nodes: &[DeviceNode]) -> bool {
        let drive = &nodes[self.drive()];
        let awaits = |it: AxisFeedback| !self.has_stood(&nodes[it.encoder], drive);
        !drive.answers_sync() && self.compared().is_some_and(awaits)
    }

    /// Whether its drive goes to targets, and has none.
    fn stays(&self) -> bool {
        self.point_to_point.is_some() && !self.goes()
    }

    /// Whether an encoder, which was heard since, has stood since a drive was asked for the position that it told last.
    fn has_stood(&self, encoder: &DeviceNode, drive: &DeviceNode) -> bool {
        let before = f64::from(encoder.steady().saturating_sub(drive.unknown()));
        let under_way = drive.sdo_response().max(STILL);
        encoder.age() <= drive.unknown() && before * self.period >= under_way.as_secs_f64()
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
