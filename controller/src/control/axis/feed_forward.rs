//! What an axis's motors take to follow its plan, sent to drives that add it to what their loops ask for (60B2h).
//!
//! A drive's loops make a torque of an error alone: a following error that grows with the acceleration, with friction at each
//! reversal and with what hangs on the axis as it is enabled. The plan knows the acceleration before any error shows it, so
//! of the torque
//!
//! ```text
//! inertia × acceleration + viscous × velocity + Coulomb × direction + gravity
//! ```
//!
//! the loops have to make up for what the machine file does not have right, and for the vibrations. It changes no setpoint: a
//! torque that is wrong is a following error, which is supervised as ever.
//!
//! A setpoint that a SYNC latches is where the drive's reference is one cycle later, in a straight line from the one before.
//! The torque goes with that line: the acceleration is by how much the plan's velocity differs at its ends, the velocity its slope.
//!
//! *While backlash is taken up* the motor goes on and the carriage does not. So acceleration and velocity are those of the
//! carriage, without the take-up; for that the motor gets what it takes to speed up what turns on its own side, `motor_inertia`. The
//! inertia of the whole axis would have it run ahead into the other flank, by as much as the load has of it. Of a machine file that does
//! not say what is the motor's the loops make that torque, as they make all of it without any. On which flank the carriage is
//! while the motor crosses the play nobody knows; its part of the torque goes on all the same, since one that is taken off and
//! put on again would be two jumps at instants that are guessed.

use super::super::node::DeviceNode;
use super::AxisControl;
use super::history::Planned;
use crate::machine;
use std::f64::consts::TAU;

/// Below that speed friction grows with it: a plan that creeps or trembles about a standstill makes no torque jump by all of the
/// friction. Revolutions of the motor a second; as slow as drives have it that compensate for friction themselves.
const FULL_FRICTION: f64 = 5.0 / 60.0;

/// Torques in thousandths of the motor's rated one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisTorque {
    /// For a mm/s² of the carriage …
    inertia: f64,
    /// … and for one of the motor alone.
    motor_inertia: f64,
    /// For a mm/s.
    viscous_friction: f64,
    coulomb_friction: f64,
    /// For a mm/s, up to all of it.
    slow_friction: f64,
    /// Positive in the axis's positive direction.
    gravity: f64,
}

impl AxisTorque {
    /// Of an axis that goes so many mm for each revolution of its motors.
    #[must_use]
    pub fn new(of: &machine::FeedForward, mm_per_revolution: f64) -> Self {
        let thousandths = 1000.0 / of.rated_torque;
        let radians = TAU / mm_per_revolution;
        Self {
            inertia: of.inertia * radians * thousandths,
            motor_inertia: of.motor_inertia * radians * thousandths,
            viscous_friction: of.viscous_friction * radians * thousandths,
            coulomb_friction: of.coulomb_friction * thousandths,
            slow_friction: of.coulomb_friction * thousandths / (FULL_FRICTION * mm_per_revolution),
            gravity: of.gravity * thousandths,
        }
    }

    /// On the way from one step of the plan of a side to the next.
    fn torque(&self, [before, there]: [Planned; 2], side: usize, period: f64) -> f64 {
        let take_up = (there.take_up - before.take_up) / period;
        let velocity = (there.of_side(side) - before.of_side(side)) / period
            - f64::midpoint(before.take_up, there.take_up);
        let acceleration = (there.velocity - before.velocity) / period - take_up;
        let friction =
            (self.slow_friction * velocity).clamp(-self.coulomb_friction, self.coulomb_friction);
        self.inertia * acceleration
            + self.motor_inertia * take_up
            + self.viscous_friction * velocity
            + friction
            + self.gravity
    }
}

impl AxisControl {
    /// What the drive of a side takes on the way to the setpoint that it is handed next, in the direction in which its
    /// positions grow; 0 for a drive that is sent none.
    pub(super) fn torque(&self, side: usize, nodes: &[DeviceNode]) -> f64 {
        let Some(feed_forward) = &self.spec.feed_forward else {
            return 0.0;
        };
        let node = &nodes[self.spec.drives[side]];
        let ends = [1.0, 0.0].map(|earlier| self.history.proposed(node.delay() + earlier));
        node.turned(feed_forward.torque(ends, side, self.period))
    }

    /// Has its drives, which are told to stay where they are, hold it up, also as they are enabled.
    pub(in super::super) fn hold_up(&self, nodes: &mut [DeviceNode]) {
        if let Some(feed_forward) = &self.spec.feed_forward {
            for &drive in &self.spec.drives {
                let node = &mut nodes[drive];
                node.setpoint.torque = node.turned(feed_forward.gravity);
            }
        }
    }
}
