//! From the shaft to the position value 6004h: code sequence, scaling, preset, work area.
//!
//! No manual prints a formula. With `r` physical steps per turn and `t` turns the disc reads a
//! raw value of 0…t r - 1; the code sequence CCW mirrors it; scaling makes of it
//! `floor(raw u / r) mod m` with `u` steps per turn (6001h) and a range of `m` steps (6002h); the
//! preset's offset is added modulo `m`. Where `m / u` is a power of two up to `t` the value turns
//! over without a jump, as the TWK CRN's manual demands of endless turning (crn S32, S40); elsewhere it jumps
//! where the raw value turns over, as that manual's example with 3600 steps does.

use syncline_canopen::dictionary::Dictionary;

/// Bits of 6000h (crn S25).
pub(in crate::twin) const COUNTER_CLOCKWISE: u16 = 1 << 0;
pub(in crate::twin) const SCALING: u16 = 1 << 2;

/// Bits of 6400h:1 (crn S41).
const OUT_OF_RANGE: u8 = 1 << 0;
const OVERFLOW: u8 = 1 << 1;
const UNDERFLOW: u8 = 1 << 2;

/// What makes a position value of a raw one: 6000h, 6001h, 6002h.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::twin) struct Measure {
    /// Physical steps per turn.
    pub(in crate::twin) resolution: u32,
    /// Turns that it tells apart, above zero.
    pub(in crate::twin) turns: u32,
    /// 6000h.
    pub(in crate::twin) parameters: u16,
    /// 6001h, in effect while 6000h says so.
    pub(in crate::twin) units: u32,
    /// 6002h, in effect while 6000h says so.
    pub(in crate::twin) range: u32,
}

impl Measure {
    /// As the objects have it.
    pub(in crate::twin) fn of(objects: &Dictionary) -> Self {
        let value = |index| objects.value(index, 0).unwrap_or(0);
        Self {
            resolution: value(0x6501) as u32,
            turns: value(0x6502) as u32,
            parameters: value(0x6000) as u16,
            units: value(0x6001) as u32,
            range: value(0x6002) as u32,
        }
    }

    /// Physical steps in all.
    fn whole(&self) -> u64 {
        u64::from(self.resolution) * u64::from(self.turns)
    }

    /// Steps after which the value begins anew, at least 1.
    pub(in crate::twin) fn modulus(&self) -> u64 {
        match self.parameters & SCALING {
            0 => self.whole(),
            _ => u64::from(self.range.max(1)),
        }
    }

    /// The value without a preset of a shaft that stands at so many revolutions from the disc's
    /// zero; positive ones turn clockwise, seen looking at the shaft.
    pub(in crate::twin) fn unshifted(&self, revolutions: f64) -> u64 {
        // A disc knows nothing beyond its turns, and no number is too great to be cut to them.
        let turns = revolutions.rem_euclid(f64::from(self.turns));
        let raw = (turns * f64::from(self.resolution)) as u64 % self.whole();
        let raw = match self.parameters & COUNTER_CLOCKWISE {
            0 => raw,
            _ => self.whole() - 1 - raw,
        };
        match self.parameters & SCALING {
            0 => raw,
            // Both factors have 32 bits at most.
            _ => raw * u64::from(self.units) / u64::from(self.resolution) % self.modulus(),
        }
    }

    /// The offset that makes `preset` of the value without one (crn S40).
    pub(in crate::twin) fn offset(&self, unshifted: u64, preset: u32) -> u64 {
        let modulus = self.modulus();
        (u64::from(preset) % modulus + modulus - unshifted % modulus) % modulus
    }

    /// The position value.
    pub(in crate::twin) fn position(&self, unshifted: u64, offset: u64) -> u32 {
        ((unshifted + offset) % self.modulus()) as u32
    }
}

/// 6400h:1. `reached` says whether a limit counts as outside by itself.
pub(in crate::twin) fn work_area(position: u32, low: i64, high: i64, reached: bool) -> u8 {
    let position = i64::from(position);
    let beyond = |distance: i64| distance > 0 || reached && distance == 0;
    let above = beyond(position - high);
    let below = beyond(low - position);
    match (above, below) {
        (false, false) => 0,
        // Limits that are the wrong way round can both be passed.
        (above, below) => {
            let bit = |holds: bool, bit| if holds { bit } else { 0 };
            OUT_OF_RANGE | bit(above, OVERFLOW) | bit(below, UNDERFLOW)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FINE: Measure = Measure {
        resolution: 0x2000,
        turns: 4096,
        parameters: 0,
        units: 0x2000,
        range: 0x200_0000,
    };

    /// Middle of a raw step, in revolutions.
    fn at(raw: u64) -> f64 {
        (raw as f64 + 0.5) / 8192.0
    }

    /// Crn S32, S40: 1024 steps in 8 turns run through 0…8191 again and again without a jump.
    #[test]
    fn endless_turning_in_the_manuals_example() {
        let eight_turns = Measure {
            parameters: SCALING,
            units: 1024,
            range: 8192,
            ..FINE
        };
        let last = 4096 * 8192 - 1;
        assert_eq!(eight_turns.unshifted(at(8 * 8192 - 1)), 8191);
        assert_eq!(eight_turns.unshifted(at(8 * 8192)), 0);
        assert_eq!(eight_turns.unshifted(at(last)), 8191);
        assert_eq!(eight_turns.unshifted(at(last + 1)), 0);
    }

    /// Crn S40: with 3600 steps the last run is broken off; 4096 turns leave 304 steps of it.
    #[test]
    fn the_jump_in_the_manuals_counterexample() {
        let broken = Measure {
            parameters: SCALING,
            units: 1024,
            range: 3600,
            ..FINE
        };
        let last = 4096 * 8192 - 1;
        assert_eq!(broken.unshifted(at(last)), 303);
        assert_eq!(broken.unshifted(at(last + 1)), 0);
    }

    #[test]
    fn the_work_area_has_three_bits() {
        let state = |position, reached| work_area(position, 100, 200, reached);
        assert_eq!([99, 150, 201].map(|it| state(it, false)), [5, 0, 3]);
        assert_eq!([100, 200].map(|it| state(it, false)), [0, 0]);
        assert_eq!([100, 200].map(|it| state(it, true)), [5, 3]);
    }

    fn measure() -> impl Strategy<Value = Measure> {
        let number = prop_oneof![1u32..20_000, any::<u32>()];
        let parameters = prop::sample::select(vec![0u16, 1, 4, 5]);
        let resolution = prop::sample::select(vec![0x1000u32, 0x2000]);
        (resolution, parameters, number.clone(), number).prop_map(
            |(resolution, parameters, units, range)| Measure {
                resolution,
                turns: 4096,
                parameters,
                units,
                range,
            },
        )
    }

    proptest! {
        /// A position is below the range whatever the parameters, and a preset is what is read back.
        #[test]
        fn a_preset_is_read_back(
            measure in measure(),
            turns in prop_oneof![-5000.0..5000.0f64, -1e300..1e300f64],
            preset in any::<u32>(),
        ) {
            let unshifted = measure.unshifted(turns);
            prop_assert!(unshifted < measure.modulus());
            let position = measure.position(unshifted, measure.offset(unshifted, preset));
            prop_assert_eq!(u64::from(position), u64::from(preset) % measure.modulus());
        }

        /// Over a whole number of turns that is a power of two, the value goes on by one step at a
        /// time, downwards with CCW, and from the last to the first.
        #[test]
        fn endless_turning_never_jumps(
            ccw in any::<bool>(),
            units in 1u32..=8192,
            power in 0u32..=12,
            raw in 0u64..4096 * 8192,
            offset in any::<u32>(),
        ) {
            let measure = Measure {
                parameters: SCALING | u16::from(ccw),
                units,
                range: units << power,
                ..FINE
            };
            let offset = u64::from(offset) % measure.modulus();
            let value = |raw| measure.position(measure.unshifted(at(raw)), offset);
            let (here, next) = (u64::from(value(raw)), u64::from(value(raw + 1)));
            let (from, to) = if ccw { (next, here) } else { (here, next) };
            prop_assert!(to == from || to == (from + 1) % measure.modulus(), "{from} to {to}");
        }
    }
}
