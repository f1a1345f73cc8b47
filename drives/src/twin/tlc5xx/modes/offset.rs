//! Offset positioning on top of the electronic gear (4419-4535, 12563-12700): a movement of its own that is added to
//! what follows the pulses. It counts in increments, as the gear does (4980-4984).

use super::manufacturer::{ENDED, FAILED, REACHED};
use crate::twin::servo::cascade::POSITION_STEP;
use crate::twin::servo::ramp::{Limits, Ramp};
use crate::twin::tlc5xx::drive::Drive;
use crate::twin::tlc5xx::motion::Motion;
use crate::twin::tlc5xx::policy::OffsetSpeed;
use crate::twin::tlc5xx::settings::RPM;

/// How far the gear's reference is beside its pulses, and where that goes.
#[derive(Clone, Copy, Debug)]
pub(in crate::twin::tlc5xx) struct Offset {
    /// From the reference point that 20A8h sets.
    ramp: Ramp,
    target: Option<f64>,
    /// 20A5h.
    state: u16,
}

impl Default for Offset {
    fn default() -> Self {
        Self {
            ramp: Ramp::at(0.0),
            target: None,
            state: 0,
        }
    }
}

impl Offset {
    /// The gear is over, and so is what moves on top of it: not where it was to go.
    pub(super) fn interrupt(&mut self) {
        self.ramp.velocity = 0.0;
        if self.target.take().is_some() {
            self.state = ENDED | FAILED;
        }
    }

    pub(super) fn state(&self) -> u16 {
        self.state
    }
}

impl Drive {
    /// 20A4h or 20A6h was written. Without the gear nothing starts, and a second movement takes over from the first: both
    /// are assumptions. A relative one counts from the target before, while it goes there.
    pub(super) fn start_offset(&mut self, value: i64, is_absolute: bool) {
        if self.motion != Motion::Gear {
            return;
        }
        let offset = &mut self.offset;
        let base = match is_absolute {
            true => 0.0,
            false => offset.target.unwrap_or(offset.ramp.position),
        };
        offset.target = Some(base + value as f64);
        offset.state = 0;
    }

    /// 20A8h: where it is has this number now. While it moves that does nothing, an assumption.
    pub(super) fn set_offset(&mut self, value: i64) {
        if self.offset.target.is_none() {
            self.offset.ramp = Ramp::at(value as f64);
        }
    }

    /// How far, in increments, and how fast it goes in a step.
    pub(super) fn step_offset(&mut self) -> (f64, f64) {
        let value = |index| self.objects.value(index, 0).unwrap_or(0) as f64;
        let unit = match self.policies.offset_speed {
            OffsetSpeed::IncrementsPerSecond => 1.0,
            OffsetSpeed::RevolutionsPerMinute => RPM,
        };
        let limits = Limits {
            velocity: value(0x20A7).abs() * unit,
            acceleration: value(0x20F8) * RPM,
            deceleration: value(0x20F9) * RPM,
        };
        let offset = &mut self.offset;
        let Some(target) = offset.target else {
            return (0.0, 0.0);
        };
        let before = offset.ramp.position;
        if offset.ramp.towards_position(target, &limits, POSITION_STEP) {
            offset.target = None;
            offset.state = ENDED | REACHED;
        }
        (offset.ramp.position - before, offset.ramp.velocity)
    }
}
