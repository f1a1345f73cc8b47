//! Numbers to whole ones, as firmware shows them.

/// The nearest whole number, of two as near the one further from 0; the greatest or the least of those that there are
/// beyond them, 0 of no number. As `libm::round`, of which most processors make a call.
pub(in crate::twin) fn nearest(number: f64) -> i64 {
    let towards_zero = number as i64;
    let rest = number - towards_zero as f64;
    match rest.abs() >= 0.5 {
        true => towards_zero.saturating_add(rest.signum() as i64),
        false => towards_zero,
    }
}

/// All numbers from here on are whole.
const WHOLE: f64 = 4_503_599_627_370_496.0;

/// The greatest whole number that is no more than this one. As [`f64::floor`], of which processors without an instruction for it
/// make a call.
pub(in crate::twin) fn floor(number: f64) -> f64 {
    let towards_zero = number as i64 as f64;
    match number.abs() < WHOLE && towards_zero != number {
        true => towards_zero - f64::from(u8::from(towards_zero > number)),
        false => number,
    }
}

/// Numbers up to here are rounded to whole ones by adding [`ROUNDS`] and taking it away again.
const NEAR: f64 = 2_251_799_813_685_248.0;
const ROUNDS: f64 = 3.0 * NEAR;

/// As [`floor`], for loops that wait for it: two additions where it takes two conversions.
#[inline(always)]
pub(in crate::twin) fn floor_soon(number: f64) -> f64 {
    if number.abs() < NEAR {
        let nearest = number + ROUNDS - ROUNDS;
        nearest - f64::from(u8::from(nearest > number))
    } else {
        floor(number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn ends_and_halves_are_rounded_as_libm_does() {
        let numbers = [
            0.0,
            0.5,
            0.499_999_999_999_999_94,
            1.5,
            2.5,
            4_503_599_627_370_495.5,
            9_007_199_254_740_993.0,
            9.3e18,
            1e300,
            f64::INFINITY,
            f64::NAN,
        ];
        for number in numbers.into_iter().flat_map(|it| [it, -it]) {
            assert_eq!(nearest(number), libm::round(number) as i64, "{number}");
            assert_eq!(
                floor(number).to_bits(),
                number.floor().to_bits(),
                "{number}"
            );
            assert!(
                floor_soon(number) == number.floor() || number.is_nan(),
                "{number}"
            );
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_number_is_rounded_as_libm_does(number in any::<f64>(), near in -1e6..1e6_f64) {
            for number in [number, near, (2.0 * near).floor() / 2.0] {
                prop_assert_eq!(nearest(number), libm::round(number) as i64);
                prop_assert_eq!(floor(number).to_bits(), number.floor().to_bits());
                prop_assert!(floor_soon(number) == number.floor() || number.is_nan());
            }
        }
    }
}
