//! What else is wired to the drive: limit and reference switches, the index pulse, a pulse source.

use super::signals::CAPTURES;
use crate::twin::device::Sensor;
use core::ops::Range;

/// Switches along the axis, in revolutions from the encoder's zero, which what it moves trips: behind the shaft by twist and play.
/// The index pulse comes at every whole revolution of the shaft. By default none is fitted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Switches {
    /// LIMN: active below this position.
    pub negative_limit: Option<f64>,
    /// LIMP: active above this position.
    pub positive_limit: Option<f64>,
    /// REF: active within.
    pub reference: Option<Range<f64>>,
    /// Capture inputs 1 and 2: active within.
    pub captures: [Option<Range<f64>>; CAPTURES],
    /// DI0 to DI5 that other sensors switch on: bit n is DIn.
    pub sensors: u8,
    /// Sensors along the axis at any of the inputs, besides.
    pub along: Vec<Sensor>,
}

/// One of the switches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Switch {
    NegativeLimit,
    PositiveLimit,
    Reference,
}

impl Switches {
    pub(super) fn is_fitted(&self, switch: Switch) -> bool {
        match switch {
            Switch::NegativeLimit => self.negative_limit.is_some(),
            Switch::PositiveLimit => self.positive_limit.is_some(),
            Switch::Reference => self.reference.is_some(),
        }
    }

    pub(super) fn is_active(&self, switch: Switch, position: f64) -> bool {
        match switch {
            Switch::NegativeLimit => self.negative_limit_active(position),
            Switch::PositiveLimit => self.positive_limit_active(position),
            Switch::Reference => self.reference_active(position),
        }
    }

    /// The sensors along the axis at DIn.
    fn along(&self, input: usize) -> impl Iterator<Item = &Sensor> {
        (self.along.iter()).filter(move |sensor| usize::from(sensor.input) == input)
    }

    /// Whether a sensor at DIn is on while the load is there.
    pub(super) fn is_sensed(&self, input: usize, position: f64) -> bool {
        let sensed = self.sensors >> input & 1 != 0;
        sensed || self.along(input).any(|sensor| sensor.level(position))
    }

    /// Where along the axis a capture input changes.
    pub(super) fn edges(&self, input: usize) -> impl Iterator<Item = f64> {
        let own = self.captures[input].iter();
        let ranges = own.chain(self.along(input).map(|sensor| &sensor.range));
        ranges.flat_map(|range| [range.start, range.end])
    }

    /// A sensor at DIn is on or off.
    pub(super) fn sense(&mut self, input: u8, on: bool) {
        let bit = 1_u8.checked_shl(input.into()).unwrap_or(0);
        self.sensors = self.sensors & !bit | if on { bit } else { 0 };
    }

    pub(super) fn reference_active(&self, position: f64) -> bool {
        let range = self.reference.as_ref();
        range.is_some_and(|range| range.contains(&position))
    }

    pub(super) fn negative_limit_active(&self, position: f64) -> bool {
        self.negative_limit.is_some_and(|limit| position < limit)
    }

    pub(super) fn positive_limit_active(&self, position: f64) -> bool {
        self.positive_limit.is_some_and(|limit| position > limit)
    }
}

/// The simulated pulse source at the PTI interface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pulses {
    /// Pulses counted.
    pub(super) position: f64,
    /// Pulses/s.
    pub(super) frequency: f64,
}

impl Pulses {
    pub(super) fn advance(&mut self, dt: f64) {
        self.position += self.frequency * dt;
    }
}
