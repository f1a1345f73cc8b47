//! Homing (lxm32m 1662-1700): 23 methods against limit switches, reference switch, index pulse.

use crate::twin::lxm32m::drive::Drive;
use crate::twin::lxm32m::fault::DriveError;
use crate::twin::lxm32m::motion::Motion;
use crate::twin::lxm32m::switches::Switch;
use crate::twin::lxm32m::units::INCREMENTS_PER_REVOLUTION;
use crate::twin::rounding::nearest;
use crate::twin::servo::firmware::ServoFirmware;
use syncline_canopen::dictionary::Row;

/// How a method finds its reference point.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Method {
    /// The switch to be found and the direction of the search; none for the index pulse alone.
    switch: Option<(Switch, f64)>,
    /// Direction in which the reference point is approached.
    approach: f64,
    /// Whether the switch is entered in that direction, or left.
    entering: bool,
    /// Whether the reference point is the next index pulse, not a distance from the edge.
    index: bool,
}

impl Method {
    /// 6098h (lxm32m 1676). "Inverted" methods use the edge at which the search enters the switch,
    /// the others the edge at which it would leave it.
    fn of(number: i64) -> Option<Self> {
        let index = !(17..=30).contains(&number);
        let (switch, approach, entering) = match number {
            1 | 17 => (Some((Switch::NegativeLimit, -1.0)), 1.0, false),
            2 | 18 => (Some((Switch::PositiveLimit, 1.0)), -1.0, false),
            7..=14 | 23..=30 => {
                let variant = (number - if index { 7 } else { 23 }) as u8;
                let search = if variant < 4 { 1.0 } else { -1.0 };
                let (approach, entering) = match variant % 4 {
                    0 => (-search, false), // inverted, outside
                    1 => (search, true),   // inverted, inside
                    2 => (-search, true),  // not inverted, inside
                    _ => (search, false),  // not inverted, outside
                };
                (Some((Switch::Reference, search)), approach, entering)
            }
            33 => (None, -1.0, false),
            34 => (None, 1.0, false),
            _ => return None,
        };
        Some(Self {
            switch,
            approach,
            entering,
            index,
        })
    }
}

/// Where a homing movement is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Phase {
    #[default]
    Idle,
    /// Towards the switch in this direction; whether it has turned at a limit switch.
    Search(f64, bool),
    /// On the switch, braking.
    Found(f64),
    /// Off the switch against the approach, to enter it then.
    BackOff,
    /// Off the switch, braking.
    Outside,
    /// At low speed over the edge that counts.
    Edge,
    /// On to the next index pulse after this revolution.
    Index(f64),
    /// To the reference point.
    Reach(f64),
}

/// A homing movement.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::twin::lxm32m) struct Homing {
    phase: Phase,
    method: Option<Method>,
    /// Where the edge was, increments.
    edge: f64,
    /// Where the movement off the switch began.
    began: f64,
}

impl Homing {
    pub(in crate::twin::lxm32m) fn is_active(&self) -> bool {
        self.phase != Phase::Idle
    }
}

impl Drive {
    /// Bit 4 rose.
    pub(super) fn start_homing(&mut self) {
        if self.homing.is_active() {
            return;
        }
        self.bit_12 = false;
        let number = self.objects.get(self.rows.home_method);
        if number == 35 {
            let position = self.increments_of(self.objects.get(self.rows.set_position));
            self.reference_at(self.servo.loops.encoder as f64 - position);
            return;
        }
        let method = Method::of(number);
        let fitted = method.is_some_and(|method| {
            method
                .switch
                .is_none_or(|(switch, _)| self.switches.is_fitted(switch))
        });
        let Some(method) = method.filter(|_| fitted) else {
            self.raise(DriveError::HOMING_FAILED);
            return;
        };
        self.homing = Homing {
            method: Some(method),
            ..Homing::default()
        };
        self.x_end = false;
        self.target_reached = false;
        self.ref_ok = false;
        self.note_status();
        match method.switch {
            None => self.seek_index(method),
            Some((switch, _)) if self.is_on(switch) => self.leave_or_enter(method),
            Some((_, direction)) => self.search(direction, false),
        }
    }

    pub(super) fn step_homing(&mut self) {
        let Some(method) = self.homing.method else {
            return;
        };
        let standing = self.motion == Motion::Hold;
        let on = method.switch.is_some_and(|(switch, _)| self.is_on(switch));
        match self.homing.phase {
            Phase::Idle => {}
            Phase::Search(direction, turned) => {
                if on {
                    self.brake_then(Phase::Found(direction));
                } else if self.is_on(if direction < 0.0 {
                    Switch::NegativeLimit
                } else {
                    Switch::PositiveLimit
                }) {
                    if turned {
                        self.raise(DriveError::HOMING_FAILED);
                    } else {
                        self.search(-direction, true);
                    }
                }
            }
            Phase::Found(direction) if standing => {
                if on {
                    self.leave_or_enter(method);
                } else {
                    // It ran over a narrow switch: back, slowly.
                    self.homing.phase = Phase::Search(-direction, true);
                    self.run(-direction, self.rows.home_clear_velocity);
                }
            }
            Phase::BackOff => {
                if on {
                    self.check_clear_limit();
                } else {
                    self.brake_then(Phase::Outside);
                }
            }
            Phase::Outside if standing => self.seek_edge(method),
            Phase::Edge => {
                if on == method.entering {
                    self.homing.edge = self.servo.loops.encoder as f64;
                    if method.index {
                        self.seek_index(method);
                    } else {
                        let distance =
                            self.increments_of(self.objects.get(self.rows.home_distance));
                        self.reach(self.homing.edge + method.approach * distance);
                    }
                } else {
                    self.check_clear_limit();
                }
            }
            Phase::Index(revolution) => {
                let now = (self.servo.loops.encoder as f64 / INCREMENTS_PER_REVOLUTION).floor();
                if now != revolution {
                    let pulse = now.max(revolution) * INCREMENTS_PER_REVOLUTION;
                    if method.switch.is_some() {
                        let distance = (pulse - self.homing.edge) as i64;
                        let distance = self.user_position(distance);
                        self.objects.set(self.rows.home_index_distance, distance);
                    }
                    self.reach(pulse);
                }
            }
            Phase::Reach(point) if self.is_at_rest() => {
                let home = self.increments_of(self.objects.get(self.rows.home_position));
                self.reference_at(point - home);
            }
            Phase::Found(_) | Phase::Outside | Phase::Reach(_) => {}
        }
    }

    /// Homing has succeeded: user position 0 is at `zero` increments.
    fn reference_at(&mut self, zero: f64) {
        self.homing = Homing::default();
        self.zero = nearest(zero);
        self.ref_ok = true;
        self.bit_12 = true;
        self.target_reached = true;
        self.x_end = true;
        self.note_status();
    }

    fn is_on(&self, switch: Switch) -> bool {
        self.switches.is_active(switch, self.carriage())
    }

    fn search(&mut self, direction: f64, turned: bool) {
        self.homing.phase = Phase::Search(direction, turned);
        self.run(direction, self.rows.home_search_velocity);
    }

    fn leave_or_enter(&mut self, method: Method) {
        self.homing.began = self.servo.loops.encoder as f64;
        if method.entering {
            self.homing.phase = Phase::BackOff;
            self.run(-method.approach, self.rows.home_clear_velocity);
        } else {
            self.seek_edge(method);
        }
    }

    fn seek_edge(&mut self, method: Method) {
        self.homing.began = self.servo.loops.encoder as f64;
        self.homing.phase = Phase::Edge;
        self.run(method.approach, self.rows.home_clear_velocity);
    }

    fn seek_index(&mut self, method: Method) {
        let revolution = (self.servo.loops.encoder as f64 / INCREMENTS_PER_REVOLUTION).floor();
        self.homing.phase = Phase::Index(revolution);
        self.run(method.approach, self.rows.home_clear_velocity);
    }

    fn reach(&mut self, point: f64) {
        self.homing.phase = Phase::Reach(point);
        let limits = self.profile_limits(self.objects.get(self.rows.home_clear_velocity));
        self.motion = Motion::Position(point, limits);
    }

    fn run(&mut self, direction: f64, velocity: Row) {
        let limits = self.profile_limits(self.objects.get(velocity));
        self.motion = Motion::Velocity(direction * limits.velocity, limits);
    }

    fn brake_then(&mut self, phase: Phase) {
        self.homing.phase = phase;
        self.stop(self.profile_deceleration());
    }

    /// 3028h:6: greatest distance for coming off or onto the switch, 0 for any.
    fn check_clear_limit(&mut self) {
        let limit = self.increments_of(self.objects.get(self.rows.home_clear_limit));
        let moved = (self.servo.loops.encoder as f64 - self.homing.began).abs();
        if limit > 0.0 && moved > limit {
            self.raise(DriveError::HOMING_FAILED);
        }
    }
}
