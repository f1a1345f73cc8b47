//! List processing in the background of a movement, and teach-in (4649-4921).
//!
//! A list has 64 places, each a position with a level of the output TRIGGER or with a velocity. While
//! it runs, the next place is due when the motor passes its position, in either direction.

use crate::twin::servo::ramp::Limits;
use crate::twin::tlc5xx::drive::Drive;
use crate::twin::tlc5xx::motion::Motion;

/// A place switches TRIGGER or loads a velocity (14507-14513).
const SWITCHES: i64 = 1;

/// Bits of 20B1h and 20B5h (13011-13017, 13182-13188).
const ENDED: i64 = 1 << 14;
const FAILED: i64 = 1 << 15;

/// A list under way.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::twin::tlc5xx) struct List {
    /// 1 or 2; 0 is none.
    number: u16,
    /// The place that is due next, and the last one.
    next: i64,
    last: i64,
    /// The position at the step before, user units.
    before: i64,
    /// Level of TRIGGER.
    trigger: bool,
}

impl List {
    pub(in crate::twin::tlc5xx) fn trigger(&self) -> bool {
        self.trigger
    }

    /// Where its objects begin: types, positions, signals and velocities, and what controls it.
    fn places(self) -> u16 {
        0x2100 + self.number * 0x100
    }

    fn control(self) -> u16 {
        if self.number == 1 { 0x20B7 } else { 0x20BD }
    }
}

impl Drive {
    /// 20B4h: a list that runs is stopped first (13111).
    pub(super) fn start_list(&mut self, number: i64) {
        let (before, _) = self.settings.user(self.position());
        self.list = List {
            number: number as u16,
            before,
            trigger: self.list.trigger,
            ..List::default()
        };
        if self.list.number == 0 {
            self.objects.put(0x20B5, 0, ENDED);
            return;
        }
        let control = self.list.control();
        let value = |offset| self.objects.value(control + offset, 0).unwrap_or(0);
        let (first, last) = (value(1), value(2));
        self.list.next = first;
        self.list.last = last;
        self.objects.put(control + 3, 0, -1);
        // The first place comes before the last (13243-13279).
        if first > last {
            self.list.number = 0;
            self.objects.put(0x20B5, 0, FAILED | ENDED);
        } else {
            self.objects.put(0x20B5, 0, number);
        }
    }

    /// The list's part of a step of the position loop.
    pub(in crate::twin::tlc5xx) fn step_list(&mut self) {
        if self.list.number == 0 {
            return;
        }
        let (at, _) = self.settings.user(self.position());
        let before = core::mem::replace(&mut self.list.before, at);
        let place = self.list.next as u8 + 1;
        let places = self.list.places();
        let value = |offset: u16| self.objects.value(places + offset, place).unwrap_or(0);
        let (kind, position, signal, velocity) = (value(0), value(1), value(2), value(3));
        let passes = before.min(at) <= position && position <= before.max(at) && before != at;
        if !passes {
            return;
        }
        if kind == SWITCHES {
            self.list.trigger = signal == 1;
        } else {
            self.load_velocity(velocity as f64 * self.settings.velocity);
        }
        let control = self.list.control();
        self.objects.put(control + 3, 0, self.list.next);
        self.list.next += 1;
        if self.list.next > self.list.last {
            self.list.number = 0;
            self.objects.put(0x20B5, 0, ENDED);
        }
    }

    /// The movement goes on with another velocity, in increments/s.
    fn load_velocity(&mut self, velocity: f64) {
        let at_most = |limits: Limits| Limits {
            velocity: velocity.abs().min(self.settings.manufacturer.velocity),
            ..limits
        };
        self.motion = match self.motion {
            Motion::Position(target, limits) => Motion::Position(target, at_most(limits)),
            Motion::Velocity(target, limits) => {
                let greatest = self.settings.manufacturer.velocity;
                Motion::Velocity(velocity.abs().min(greatest).copysign(target), limits)
            }
            motion => motion,
        };
    }

    /// 20B0h: the present position becomes that of a place (4887-4921). Records (20B2h = 3) are of
    /// other devices alone.
    pub(super) fn teach(&mut self, place: i64) {
        let (position, _) = self.settings.user(self.position());
        let positions = match self.objects.value(0x20B2, 0) {
            Some(1) => Some(0x2201),
            Some(2) => Some(0x2301),
            _ => None,
        };
        let is_stored = positions
            .is_some_and(|index| self.objects.put(index, (place & 0x3F) as u8 + 1, position));
        let state = if is_stored { ENDED } else { FAILED | ENDED };
        self.objects.put(0x20B1, 0, state);
    }
}
