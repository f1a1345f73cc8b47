//! Homing (835-923).
//!
//! The carriage runs in the method's first direction to its switch, and turns round once at a limit
//! switch on the way. A home switch is left on the side of the edge that counts and met again from
//! there; a limit switch is left inwards. At the edge the demand brakes, goes back to it, and the
//! counter becomes 607Ch.

use super::drive::Drive;
use super::modes::Motion;
use super::signals::{LOWER_LIMIT, REFERENCE, START_HOMING, UPPER_LIMIT};
use crate::twin::ErrorClass;
use crate::twin::tsp10::modes::Mode;
use syncline_canopen::cia402::{Controlword, State};
use syncline_canopen::emcy::register;

/// Where a homing movement is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Phase {
    #[default]
    Idle,
    /// Towards the switch in this direction; whether it has turned.
    Search(f64, bool),
    /// Off the switch, to the side of the edge that counts.
    Leave,
    /// Onto the home switch again.
    Meet,
    /// Back to the edge after braking.
    Return(f64),
    /// On the edge.
    Reach(f64),
}

/// A homing movement and how the last one ended.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Homing {
    phase: Phase,
    attained: bool,
    failed: bool,
}

/// Methods of 6098h (853-869): the switch, the first direction, and the side of the edge that counts.
fn method(number: i64) -> Option<(i64, f64, f64)> {
    Some(match number {
        17 => (LOWER_LIMIT, -1.0, 1.0),
        18 => (UPPER_LIMIT, 1.0, -1.0),
        24 => (REFERENCE, 1.0, -1.0),
        25 => (REFERENCE, 1.0, 1.0),
        28 => (REFERENCE, -1.0, 1.0),
        29 => (REFERENCE, -1.0, -1.0),
        _ => return None,
    })
}

/// Whether 6098h takes this number.
pub(super) fn is_method(number: i64) -> bool {
    matches!(number, 35 | 37) || method(number).is_some()
}

impl Homing {
    pub(super) fn is_active(&self) -> bool {
        self.phase != Phase::Idle
    }

    pub(super) fn is_attained(&self) -> bool {
        self.attained
    }

    pub(super) fn has_failed(&self) -> bool {
        self.failed
    }

    /// No movement any more; that one failed is known until the next begins.
    pub(super) fn ended(self) -> Self {
        Self {
            failed: self.failed,
            ..Self::default()
        }
    }
}

impl Drive {
    pub(super) fn start_homing(&mut self) {
        if self.homing.is_active() || self.motion != Motion::Hold {
            return;
        }
        self.abandon_homing();
        self.is_referenced = false;
        self.target_reached = false;
        match self.method() {
            None => self.attain(),
            Some((switch, ..)) if self.is_active(switch) => self.leave(),
            Some((_, direction, _)) => self.search(direction, false),
        }
    }

    /// An input with the function "start homing" (596) does it by its edge.
    pub(super) fn watch_homing_input(&mut self) {
        let is_on = self.is_active(START_HOMING);
        let rises = is_on && !core::mem::replace(&mut self.homing_input, is_on);
        if rises && self.mode == Mode::Homing && self.state == State::OperationEnabled {
            self.start_homing();
        }
    }

    fn method(&self) -> Option<(i64, f64, f64)> {
        method(self.objects.value(0x6098, 0).unwrap_or(0))
    }

    pub(super) fn step_homing(&mut self) {
        let Some((switch, _, side)) = self.method() else {
            return;
        };
        let on = self.is_active(switch);
        match self.homing.phase {
            Phase::Idle => {}
            Phase::Search(..) if on => self.leave(),
            Phase::Search(direction, has_turned) => {
                let end = if direction < 0.0 {
                    LOWER_LIMIT
                } else {
                    UPPER_LIMIT
                };
                if self.is_active(end) && has_turned {
                    // The second limit switch: the switch was not found (912).
                    self.homing = Homing {
                        failed: true,
                        ..Homing::default()
                    };
                    self.raise(ErrorClass::StopAndSwitchOff, register::PROFILE);
                } else if self.is_active(end) {
                    self.search(-direction, true);
                }
            }
            Phase::Leave if !on && switch == REFERENCE => {
                self.homing.phase = Phase::Meet;
                self.run_homing(-side);
            }
            Phase::Leave if !on => self.brake_at_edge(),
            Phase::Meet if on => self.brake_at_edge(),
            Phase::Return(edge) if self.motion == Motion::Hold => {
                self.homing.phase = Phase::Reach(edge);
                let limits = self.limits(self.value(0x6099, 1), 0x609A, 0x609A);
                self.go_homing(Motion::Position(edge, limits));
            }
            Phase::Reach(edge) if self.motion == Motion::Hold && self.halted.is_none() => {
                self.ramp.position = edge;
                self.attain();
            }
            Phase::Leave | Phase::Meet | Phase::Return(_) | Phase::Reach(_) => {}
        }
    }

    /// The carriage stands on the reference point: its position is 607Ch (912).
    fn attain(&mut self) {
        self.count_from(self.value(0x607C, 0));
        self.is_referenced = true;
        self.target_reached = true;
        self.homing = Homing {
            attained: true,
            ..Homing::default()
        };
    }

    fn search(&mut self, direction: f64, has_turned: bool) {
        self.homing.phase = Phase::Search(direction, has_turned);
        self.run_homing(direction);
    }

    fn leave(&mut self) {
        if let Some((.., side)) = self.method() {
            self.homing.phase = Phase::Leave;
            self.run_homing(side);
        }
    }

    fn brake_at_edge(&mut self) {
        self.homing.phase = Phase::Return(self.ramp.position);
        self.halted = None;
        self.stop(self.value(0x609A, 0));
    }

    fn run_homing(&mut self, direction: f64) {
        let limits = self.limits(self.value(0x6099, 1), 0x609A, 0x609A);
        self.go_homing(Motion::Velocity(direction * limits.velocity, limits));
    }

    /// The next way of the homing movement: at once, or when bit 8 falls.
    fn go_homing(&mut self, motion: Motion) {
        match self.controlword.has(Controlword::HALT) {
            true => self.halted = Some(motion),
            false => self.motion = motion,
        }
    }
}
