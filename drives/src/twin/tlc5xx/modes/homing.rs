//! Homing by 6098h (3819-3859) and by the manufacturer's 20F0h (13914-13939).
//!
//! The motor runs with 6099h:1 to its switch, brakes, and comes off it with 6099h:2. Where the
//! switch lets go is the edge; the reference point is 20F4h beyond it, or the next index pulse. A
//! search for REF that meets a limit switch turns round once, an assumption.

use super::Movement;
use crate::twin::servo::firmware::ServoFirmware;
use crate::twin::tlc5xx::drive::Drive;
use crate::twin::tlc5xx::fault::DriveError;
use crate::twin::tlc5xx::motion::Motion;
use crate::twin::tlc5xx::settings::{INCREMENTS_PER_REVOLUTION, Settings};
use crate::twin::tlc5xx::signals::{LIMN, LIMP, REF};

/// How a method finds its reference point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Method {
    /// The switch.
    signal: u16,
    /// Direction of the search.
    search: f64,
    /// Whether the reference point is an index pulse.
    index: bool,
}

/// Where a homing movement is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Phase {
    #[default]
    Idle,
    /// Towards the switch in this direction; whether it has turned at a limit switch.
    Search(f64, bool),
    /// On the switch, braking.
    Found,
    /// Off the switch.
    Leave,
    /// On to the next index pulse after this revolution.
    Index(f64),
    /// To the reference point.
    Reach(f64),
}

/// A homing movement and how the last one ended.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::twin::tlc5xx) struct Homing {
    phase: Phase,
    method: Option<Method>,
    /// Where the movement off the switch began.
    began: f64,
    attained: bool,
    failed: bool,
}

impl Homing {
    pub(in crate::twin::tlc5xx) fn is_active(&self) -> bool {
        self.phase != Phase::Idle
    }

    pub(super) fn is_attained(&self) -> bool {
        self.attained
    }

    pub(super) fn has_failed(&self) -> bool {
        self.failed
    }

    const fn succeeded() -> Self {
        Self {
            phase: Phase::Idle,
            method: None,
            began: 0.0,
            attained: true,
            failed: false,
        }
    }

    /// The methods of 6098h (3824-3842); `None` for one that has no movement.
    pub(super) fn of_profile(number: i64) -> Option<Method> {
        let (signal, search) = match number {
            1 | 17 => (LIMN, -1.0),
            2 | 18 => (LIMP, 1.0),
            7 | 23 => (REF, 1.0),
            11 | 27 => (REF, -1.0),
            _ => return None,
        };
        Some(Method {
            signal,
            search,
            index: number < 17,
        })
    }

    /// The methods of 20F0h (13924-13939).
    pub(super) fn of_manufacturer(number: i64) -> Option<Method> {
        let (signal, search) = match number {
            1 | 5 => (LIMP, 1.0),
            2 | 6 => (LIMN, -1.0),
            3 | 7 => (REF, -1.0),
            4 | 8 => (REF, 1.0),
            _ => return None,
        };
        Some(Method {
            signal,
            search,
            index: number > 4,
        })
    }
}

impl Drive {
    /// Starts a homing movement, or sets the zero point where the motor is (method 35).
    pub(super) fn start_homing(&mut self, method: Option<Method>) {
        if self.homing.is_active() {
            return;
        }
        let Some(method) = method else {
            self.set_zero(0);
            return;
        };
        self.end_movement();
        self.movement = Movement::Homing;
        self.homing.method = Some(method);
        self.begin(Motion::Hold);
        let is_fitted = match method.signal {
            LIMP => self.switches.positive_limit.is_some(),
            LIMN => self.switches.negative_limit.is_some(),
            _ => self.switches.reference.is_some(),
        };
        if !is_fitted {
            self.fail_homing();
        } else if self.is_on(method.signal) {
            self.leave(method);
        } else {
            self.search(method.search, false);
        }
    }

    /// The position is `position` user units from now on (14141, 3853-3859); the limits are the
    /// master's to shift.
    pub(super) fn set_zero(&mut self, position: i64) {
        let shift = position as f64 * self.settings.position;
        self.succeed(self.servo.loops.encoder as f64 - shift);
    }

    fn succeed(&mut self, zero: f64) {
        self.reference_at(zero);
        self.homing = Homing::succeeded();
        self.begun |= 1 << Movement::Homing as u8;
        self.movement = Movement::None;
        self.target_reached = true;
    }

    pub(super) fn step_homing(&mut self) {
        let Some(method) = self.homing.method else {
            return;
        };
        let on = self.is_on(method.signal);
        match self.homing.phase {
            Phase::Idle => {}
            Phase::Search(direction, has_turned) => {
                let end = if direction < 0.0 { LIMN } else { LIMP };
                if on {
                    self.homing.phase = Phase::Found;
                    self.stop(self.settings.manufacturer.deceleration);
                } else if self.is_on(end) && has_turned {
                    self.fail_homing();
                } else if self.is_on(end) {
                    self.search(-direction, true);
                }
            }
            Phase::Found if self.motion == Motion::Hold => self.leave(method),
            Phase::Leave if !on => self.pass_edge(method),
            Phase::Leave => self.check_run_out(),
            Phase::Index(revolution) => {
                let now = self.revolution();
                if now != revolution {
                    self.reach(now.max(revolution) * INCREMENTS_PER_REVOLUTION);
                }
            }
            Phase::Reach(point) if self.is_at_rest() => self.succeed(point),
            Phase::Found | Phase::Reach(_) => {}
        }
    }

    fn is_on(&self, signal: u16) -> bool {
        self.active_signals() & signal != 0
    }

    fn revolution(&self) -> f64 {
        (self.servo.loops.encoder as f64 / INCREMENTS_PER_REVOLUTION).floor()
    }

    fn fail_homing(&mut self) {
        self.raise(DriveError::HOMING_FAILED);
        self.homing = Homing {
            failed: true,
            ..Homing::default()
        };
    }

    fn search(&mut self, direction: f64, has_turned: bool) {
        self.homing.phase = Phase::Search(direction, has_turned);
        self.run(direction, 1);
    }

    /// Off the switch, back where the search came from.
    fn leave(&mut self, method: Method) {
        self.homing.began = self.servo.loops.encoder as f64;
        self.homing.phase = Phase::Leave;
        self.run(-method.search, 2);
    }

    /// The switch has let go.
    fn pass_edge(&mut self, method: Method) {
        if method.index {
            self.homing.phase = Phase::Index(self.revolution());
        } else {
            let distance = self.objects.value(0x20F4, 0).unwrap_or(0) as f64;
            let edge = self.servo.loops.encoder as f64;
            self.reach(edge - method.search * distance * self.settings.position);
        }
    }

    fn reach(&mut self, point: f64) {
        self.homing.phase = Phase::Reach(point);
        let limits = Settings::at_most(self.settings.manufacturer, self.homing_velocity(2));
        self.motion = Motion::Position(point, limits);
    }

    fn run(&mut self, direction: f64, sub: u8) {
        let limits = Settings::at_most(self.settings.manufacturer, self.homing_velocity(sub));
        self.motion = Motion::Velocity(direction * limits.velocity, limits);
    }

    fn homing_velocity(&self, sub: u8) -> f64 {
        let velocity = self.objects.value(0x6099, sub).unwrap_or(0);
        velocity.abs() as f64 * self.settings.velocity
    }

    /// 20F3h: the longest way off the switch, 0 for any (14014-14031).
    fn check_run_out(&mut self) {
        let most = self.objects.value(0x20F3, 0).unwrap_or(0) as f64 * self.settings.position;
        let gone = (self.servo.loops.encoder as f64 - self.homing.began).abs();
        if most > 0.0 && gone > most {
            self.fail_homing();
        }
    }
}
