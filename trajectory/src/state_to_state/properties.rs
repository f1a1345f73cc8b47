//! What every plan keeps, from starts that are hard to compute with.

use super::*;
use crate::verify;
use proptest::prelude::*;

/// Ten to a power by chance.
fn decades(from: f64, to: f64) -> impl Strategy<Value = f64> {
    (from..to).prop_map(|power| 10.0_f64.powf(power))
}

/// Up to so much next to 1, on either side, or just 1.
fn nearly_one() -> impl Strategy<Value = f64> {
    prop_oneof![
        2 => Just(1.0),
        1 => (decades(-16.0, -2.0), any::<bool>())
            .prop_map(|(off, less)| if less { 1.0 - off } else { 1.0 + off }),
    ]
}

prop_compose! {
    /// A start that full jerk brings to the limit of the velocity, but for rounding, from far beyond it.
    fn landing()(
        v in decades(-1.5, 1.5),
        far in decades(2.0, 4.0),
        j in decades(1.0, 5.0),
        (skew, room, beside) in (decades(-1.5, 1.5), 1.0..2.0_f64, nearly_one()),
        along in any::<bool>(),
    ) -> (State, Limits) {
        let a = -(2.0 * j * v * (far - 1.0)).sqrt();
        let sign = if along { 1.0 } else { -1.0 };
        let start = State { p: 0.0, v: sign * (v + 0.5 * a * a / j) * beside, a: sign * a };
        let (most, other) = (room * -a, -a * skew.max(1.0));
        let limits = if along {
            Limits { v_max: v, v_min: -v * skew, a_max: other, a_min: -most, j_max: j, j_min: -j * skew }
        } else {
            Limits { v_max: v * skew, v_min: -v, a_max: most, a_min: -other, j_max: j * skew, j_min: -j }
        };
        (start, limits)
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A rounding of the velocity decides whether such a start is over the limit: either way it is brought back.
    #[test]
    fn a_start_on_its_last_ramp_lands((start, limits) in landing(), way in -1e3..1e3_f64) {
        let problem = Problem::new(start, State::at_rest(way), limits);
        let plan = plan(&problem, 0.0).unwrap();
        prop_assert!(verify::axis(&plan, &problem).holds(1e-10), "{:?}", verify::axis(&plan, &problem));
    }
}
