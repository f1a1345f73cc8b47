//! The ten digital inputs, their functions (586-621), and 1002h (231-241).

use super::drive::Drive;
use crate::twin::node::Firmware;
use core::ops::Range;

/// Functions of an input that the manual explains and the twin has.
pub(super) const LOWER_LIMIT: i64 = 1;
pub(super) const UPPER_LIMIT: i64 = 2;
pub(super) const REFERENCE: i64 = 3;
pub(super) const STOP: i64 = 4;
pub(super) const START_HOMING: i64 = 9;
pub(super) const ENABLE: i64 = 10;

/// Switches along the axis, in revolutions, on the inputs that the manual has for them (605-607): the
/// limit switches open their inputs, DE2 and DE3, where they are active, the reference switch closes
/// DE4. By default none is fitted, and its input rests.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Switches {
    /// Active below this position.
    pub lower_limit: Option<f64>,
    /// Active above this position.
    pub upper_limit: Option<f64>,
    /// Active within.
    pub reference: Option<Range<f64>>,
}

impl Drive {
    /// Levels of DE1 to DE10, from bit 0.
    pub(super) fn levels(&self) -> u16 {
        let position = self.shaft.position();
        let switches = &self.switches;
        let is_below = switches.lower_limit.is_some_and(|limit| position < limit);
        let is_above = switches.upper_limit.is_some_and(|limit| position > limit);
        let reference = switches.reference.as_ref();
        let is_within = reference.is_some_and(|range| range.contains(&position));
        let driven = [(1, !is_below), (2, !is_above), (3, is_within)];
        let mut levels = self.inputs & 0x3FF & !0b1110;
        for (input, level) in driven {
            levels |= u16::from(level) << input;
        }
        levels
    }

    /// Whether an input with this function is active; `None` if there is none.
    fn input(&self, function: i64) -> Option<bool> {
        let levels = self.levels();
        let mut inputs = (1..=10_u8).filter_map(|input| {
            let assigned = self.objects.value(0x2003, input)?;
            (assigned.abs() == function).then(|| {
                // Limit switches are active low; a negative value inverts.
                let high = !matches!(function, LOWER_LIMIT | UPPER_LIMIT) != (assigned < 0);
                (levels >> (input - 1) & 1 != 0) == high
            })
        });
        let first = inputs.next()?;
        Some(first | inputs.any(|active| active))
    }

    /// Whether an input with this function is active.
    pub(super) fn is_active(&self, function: i64) -> bool {
        self.input(function) == Some(true)
    }

    /// Whether an input has this function.
    pub(super) fn is_assigned(&self, function: i64) -> bool {
        self.input(function).is_some()
    }

    /// 1002h: rotary switches, homing, switches, outputs, inputs.
    pub(super) fn manufacturer_status(&self) -> u32 {
        let flags = [
            (self.is_referenced, 8),
            (self.is_active(LOWER_LIMIT), 9),
            (self.is_active(UPPER_LIMIT), 10),
            (self.is_active(REFERENCE), 11),
            (self.is_active(STOP), 12),
            (self.is_powered(), 17),
            (self.is_active(ENABLE), 28),
        ];
        let flags = flags.iter().map(|&(set, bit)| u32::from(set) << bit);
        // S1 in bits 3..0 is the right one: the node id is left x 16 + right (108-112).
        let switches = u32::from(self.node.get());
        switches | u32::from(self.levels()) << 18 | flags.sum::<u32>()
    }
}
