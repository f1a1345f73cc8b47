//! What a drive captures at the edges of its inputs, as it is told to and asked for by SDO.

use super::{DeviceNode, Step};
use crate::control::homing::Edge;
use syncline_drives::model::{Capture, Increments};

impl DeviceNode {
    /// The steps that let the drive capture the next edge of an input.
    pub(in crate::control) fn arm_capture(&mut self, capture: &Capture) {
        self.sequence.extend(capture.arm.map(Step::Write));
    }

    /// The same of the inputs that there are; of two at once.
    pub(in crate::control) fn arm_captures(&mut self, captures: [Option<&'static Capture>; 2]) {
        let arm = match captures {
            [Some(one), Some(other)] => one.armed_with(other),
            [Some(one), None] | [None, Some(one)] => one.arm,
            [None, None] => return,
        };
        self.sequence.extend(arm.map(Step::Write));
    }

    /// The steps that ask for the edge that was captured, of the first one of these that has captured any.
    pub(in crate::control) fn ask_first_captured(
        &mut self,
        captures: [Option<&'static Capture>; 2],
    ) {
        let [one, other] = captures;
        self.sequence.ask_captured(one.or(other), one.and(other));
    }

    /// The steps that ask for the edge that was captured.
    pub(in crate::control) fn ask_captured(&mut self, capture: &'static Capture) {
        self.sequence.ask_captured(Some(capture), None);
    }

    /// Where the edge was that was asked for last, if one was captured, passed at `speed`, mm/s.
    pub(in crate::control) fn captured(&self, speed: f64) -> Option<Edge> {
        let jitter = self.device.spec().capture_jitter.as_secs_f64();
        let moved = self.scaling().magnitude(speed * jitter);
        self.sequence.captured().map(|at| Edge {
            at,
            uncertainty: moved + Increments::new(1),
        })
    }
}
