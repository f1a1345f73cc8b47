//! Encoders on shafts of their own, which are not an axis' feedback: a conveyor, a shaft that somebody turns by hand.
//!
//! One is a device like the others: it goes up and down with them, is supervised with them, and what it does wrong is a
//! fault by the same table. It has no place on the path, and may turn whenever it likes. Where it is at each SYNC, counted on
//! beyond its range, is told with the row of that SYNC.

use super::Controller;
use crate::machine::MEASURED;
use serde::{Deserialize, Serialize};

/// What an encoder on a shaft of its own measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MeasuredSample {
    /// How far it is from its `zero`, mm or degrees as its `pitch` counts, whole turns and ranges too.
    pub position: f64,
    /// SYNCs since the one at which it was there.
    pub age: u32,
}

impl<const N: usize> Controller<N> {
    /// What was measured of each last, in the order of the machine file.
    pub(super) fn sample_measured(&self) -> [Option<MeasuredSample>; MEASURED] {
        let mut samples = [None; MEASURED];
        for (sample, &device) in samples.iter_mut().zip(&self.layout.measured) {
            let node = &self.nodes[device];
            *sample = node.is_sampled().then(|| MeasuredSample {
                position: node.actual_mm(),
                age: node.age(),
            });
        }
        samples
    }
}
