//! The test move with which the homing begins of an axis whose drive is sent velocities: out slowly, with no loop closed
//! about it, and back with one.

use super::super::axis::Test;
use super::super::{Controller, Event};
use super::switch::Motion;
use super::{AxisIndex, HomingFailure};
use crate::machine::TestMove;

/// Cycles after which an order to an axis has begun to move it.
const TAKEN: u64 = 10;

impl<const N: usize> Controller<N> {
    /// Goes on with the test move of an axis; whether it is over, or there is none.
    pub(super) fn step_test(&mut self, index: AxisIndex) -> Result<bool, HomingFailure> {
        match self.axes[index].test() {
            Test::Idle => return Ok(true),
            Test::Due => {
                if let Some((to, speed)) = self.axes[index].begin_test(self.cycle, &self.nodes) {
                    self.move_axis(index, Motion::To(to, speed))?;
                }
            }
            Test::Out(_) => {}
            Test::Passed {
                factor,
                back,
                speed,
            } => {
                self.tell(Event::Tested {
                    axis: index,
                    factor,
                });
                self.axes[index].go_on_with_test(Test::Back(0));
                self.move_axis(index, Motion::To(back, speed))?;
            }
            Test::Back(cycles) => {
                let seen = self.seen(index, [false; 2], 0.0);
                let is_over = seen.rests && seen.settled && cycles > TAKEN;
                let next = if is_over {
                    Test::Idle
                } else {
                    Test::Back(cycles + 1)
                };
                self.axes[index].go_on_with_test(next);
            }
        }
        Ok(false)
    }

    /// Cycles that an axis rests at the end of a test move until it is looked how far it came.
    pub(in crate::control) fn test_settling(&self) -> u64 {
        self.cycles(TestMove::SETTLING)
    }
}
