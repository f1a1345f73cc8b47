//! Where an axis is that a weight pulls down as its drives are enabled.
//!
//! A drive that is enabled holds where it was found, but its loops have no torque yet: a weight pulls the axis away, and they bring it back
//! within some tenths of a second. Its setpoints are frozen meanwhile. Taken to be where its drives say then, the axis would be shown
//! off by the sag until it is enabled again. So it is where its drives hold it.
//!
//! Between what a drive says and what it holds there is also the encoder's noise, which is no sag: what it says counts then.

use super::super::node::DeviceNode;
use super::AxisControl;

/// What is no more than so much of a revolution between what a drive holds and what it says is noise of its encoder: but at least two
/// increments, between which it rounds, and at most sixteen.
const NOISE: f64 = 16.0 / 131_072.0;
const INCREMENTS: (f64, f64) = (2.0, 16.0);

impl AxisControl {
    /// Where its drives hold it, of which they say that it is at a position, mm.
    pub(super) fn held(&self, told: f64, nodes: &[DeviceNode]) -> f64 {
        // It is not its drives that hold it.
        if self.loop_encoder().is_some() || self.point_to_point.is_some() {
            return told;
        }
        let sides = self
            .spec
            .drives
            .iter()
            .map(|&drive| nodes[drive].setpoint_mm());
        let held = self.uncorrected(sides.sum::<f64>() / self.sides.len() as f64);
        let scaling = nodes[self.drive()].scaling();
        let resolution = scaling.resolution();
        let noise = NOISE * scaling.travel_per_revolution().abs() / resolution;
        let noise = noise.clamp(INCREMENTS.0, INCREMENTS.1) * resolution;
        if (held - told).abs() > noise {
            held
        } else {
            told
        }
    }
}
