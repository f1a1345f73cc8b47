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

prop_compose! {
    /// A start inside the limits that its acceleration leads far out of them.
    fn leaving()(
        v in decades(-1.0, 1.0),
        a in decades(1.0, 4.0),
        far in decades(2.0, 4.0),
        (inside, up) in (-1.0..1.0_f64, any::<bool>()),
    ) -> (State, Limits) {
        let j = 0.5 * a * a / (v * far);
        let start = State { p: 0.0, v: v * inside, a: if up { a } else { -a } };
        (start, Limits::symmetric(v, a, j))
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A rounding of the velocity decides whether such a start is over the limit: either way it is brought back.
    #[test]
    fn a_start_on_its_last_ramp_lands((start, limits) in landing(), distance in -1e3..1e3_f64) {
        let problem = Problem::new(start, State::at_rest(distance), limits);
        let plan = plan(&problem, 0.0).unwrap();
        prop_assert!(verify::axis(&plan, &problem).holds(1e-10), "{:?}", verify::axis(&plan, &problem));
    }

    /// The jerk by which the distance is met after the way back is inside the limits as any other is.
    #[test]
    fn what_meets_the_distance_keeps_the_jerk(
        (start, limits) in leaving(),
        cruise in decades(-4.0, 3.0),
    ) {
        let stop = plan(&Problem::to_velocity(start, 0.0, limits), 0.0).unwrap();
        let beyond = start.a.signum() * cruise * limits.v_max;
        let problem = Problem::new(start, State::at_rest(stop.end().p + beyond), limits);
        let plan = plan(&problem, 0.0).unwrap();
        let jerk = plan.extrema().jerk;
        prop_assert!(jerk.max <= limits.j_max * (1.0 + 1e-12), "{} of {}", jerk.max, limits.j_max);
        prop_assert!(jerk.min >= limits.j_min * (1.0 + 1e-12), "{} of {}", jerk.min, limits.j_min);
        prop_assert!(verify::axis(&plan, &problem).holds(1e-11), "{:?}", verify::axis(&plan, &problem));
    }

    /// So does that of a stated duration, where nothing comes near the acceleration that is allowed.
    #[test]
    fn a_stated_duration_keeps_the_jerk(
        v in decades(1.0, 3.0),
        a in decades(6.0, 10.0),
        j in decades(3.0, 5.0),
        distance in decades(-3.0, 3.0),
        longer in decades(-6.0, 0.0),
    ) {
        let problem = Problem::new(State::at_rest(100.0), State::at_rest(100.0 + distance), Limits::symmetric(v, a, j));
        let duration = plan(&problem, 0.0).unwrap().duration() * (1.0 + longer);
        let plan = plan(&problem, duration).unwrap();
        let jerk = plan.extrema().jerk;
        prop_assert!(jerk.max <= j * (1.0 + 1e-12) && jerk.min >= -j * (1.0 + 1e-12), "{jerk:?} of {j}");
        prop_assert!(verify::axis(&plan, &problem).holds(1e-10), "{:?}", verify::axis(&plan, &problem));
    }
}

/// Limits are any numbers above zero; a plan that no number can tell is refused.
#[test]
fn what_no_number_can_tell_is_refused() {
    let limits = Limits::symmetric(8.97e129, 3.15e-291, 4.76e11);
    let problem = Problem::new(State::at_rest(0.0), State::at_rest(1e130), limits);
    assert_eq!(plan(&problem, 0.0).unwrap_err(), PlanError::NotANumber);
}
