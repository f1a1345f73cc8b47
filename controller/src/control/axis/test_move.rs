//! The test move of an axis whose drive is sent velocities: whether it goes as fast as it is sent.
//!
//! What 60FFh counts is the maker's affair, and where a machine file has it wrong the loop about the position is none: its gain
//! is so many times what it should be, or it runs away. So nothing closes it before the move. The drive is sent what
//! the plan has, slowly, and its position shows how far it goes for that. An axis that is further from where it was sent
//! than a quarter of the move is stopped at once; at the end of it the ratio of both ways tells whether it is trusted.

use super::super::fault::{AxisCause, Fault};
use super::super::node::DeviceNode;
use super::AxisControl;
use super::position_loop::sent_velocity;
use crate::machine::TestMove;

/// Where the test move of an axis is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::control) enum Test {
    /// None is under way.
    #[default]
    Idle,
    /// One is to be made.
    Due,
    /// It goes there.
    Out(Stroke),
    /// It went there, which is near enough.
    Passed {
        /// So many times as far as it was sent.
        factor: f64,
        /// Where it began, mm.
        back: f64,
        /// How fast it goes back, mm/s.
        speed: f64,
    },
    /// It goes back, for so many cycles.
    Back(u64),
}

/// A move under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::control) struct Stroke {
    /// Where the plan was as it began, mm.
    from: f64,
    /// Where it leads, mm.
    to: f64,
    /// By side: where that was as it began, mm.
    began: [f64; 2],
    /// By side: how far it has been sent since, mm.
    sent: [f64; 2],
    /// Cycles for which the plan has rested there.
    rests: u64,
}

impl AxisControl {
    /// Where its test move is.
    pub(in crate::control) fn test(&self) -> Test {
        self.test
    }

    /// Whether no test move of it is to be made.
    pub(in crate::control) fn is_tested(&self) -> bool {
        self.tested
    }

    /// Has it make its test move, if it has one, before it is homed.
    pub(in crate::control) fn await_test(&mut self) {
        if self.spec.homing.test_move.is_some() {
            (self.tested, self.test) = (false, Test::Due);
        }
    }

    /// Its test move goes on so, or ends.
    pub(in crate::control) fn go_on_with_test(&mut self, test: Test) {
        self.test = test;
    }

    /// Begins the move, to the other side where its soft limits do not allow it: where to, mm, and how fast, mm/s; `None`
    /// if it is to make none.
    pub(in crate::control) fn begin_test(
        &mut self,
        cycle: u64,
        nodes: &[DeviceNode],
    ) -> Option<(f64, f64)> {
        let test = self.spec.homing.test_move?;
        let distance = test.distance;
        let from = self.history.planned(cycle, 0.0).position;
        let (least, most) = self.spec.limits.position;
        let is_inside = (least..=most).contains(&(from + distance)) || !self.is_placed();
        let mut began = [0.0; 2];
        for (side, began) in began.iter_mut().enumerate().take(self.sides.len()) {
            *began = self.told(cycle, side, nodes);
        }
        let stroke = Stroke {
            from,
            to: from + if is_inside { distance } else { -distance },
            began,
            sent: [0.0; 2],
            rests: 0,
        };
        self.test = Test::Out(stroke);
        Some((stroke.to, test.speed()))
    }

    /// Looks how far its sides have gone of what they have been sent; `settling` cycles behind the end of the move that
    /// decides.
    pub(in crate::control) fn watch_test(
        &mut self,
        cycle: u64,
        settling: u64,
        nodes: &[DeviceNode],
    ) -> Result<(), Fault> {
        let (Test::Out(mut stroke), Some(test)) = (self.test, self.spec.homing.test_move) else {
            return Ok(());
        };
        let planned = self.history.planned(cycle, 0.0);
        let rests = planned.velocity == 0.0 && (planned.position - stroke.to).abs() < 1e-6;
        stroke.rests = if rests { stroke.rests + 1 } else { 0 };
        let mut worst = 1.0_f64;
        for side in 0..self.sides.len() {
            let node = &nodes[self.spec.drives[side]];
            let Some(velocity) = sent_velocity(node) else {
                continue;
            };
            let went = self.told(cycle, side, nodes) - stroke.began[side];
            let factor = went / nonzero(stroke.sent[side], node.scaling().resolution());
            if (went - stroke.sent[side]).abs() > test.most_off() {
                return Err(Fault::Axis(self.index, AxisCause::TestMove { factor }));
            }
            stroke.sent[side] += velocity * self.period;
            if (factor - 1.0).abs() > (worst - 1.0).abs() {
                worst = factor;
            }
        }
        self.test = Test::Out(stroke);
        if stroke.rests > settling {
            if (worst - 1.0).abs() > TestMove::TOLERANCE {
                let cause = AxisCause::TestMove { factor: worst };
                return Err(Fault::Axis(self.index, cause));
            }
            let (factor, back, speed) = (worst, stroke.from, test.speed());
            (self.tested, self.test) = (
                true,
                Test::Passed {
                    factor,
                    back,
                    speed,
                },
            );
        }
        Ok(())
    }

    /// Ends the move where it is.
    pub(in crate::control) fn cut_test_off(&mut self) {
        self.test = Test::Idle;
    }

    /// It has made its test move, and its encoder tells where it is.
    pub(in crate::control) fn trust(&mut self) {
        self.referenced = self.tested;
    }
}

/// The number, or the least with its sign.
fn nonzero(number: f64, least: f64) -> f64 {
    number.abs().max(least.abs()).copysign(number)
}
