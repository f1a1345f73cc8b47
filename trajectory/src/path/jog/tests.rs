use super::*;
use crate::state_to_state::Target;
use crate::verify;
use proptest::prelude::*;

const PERIOD: f64 = 0.002;
/// The last coordinate has no axis.
const N: usize = 4;
const HOME: [f64; N] = [10.0, -3.0, 0.0, 1.0];

fn travel(v: f64, a: f64, j: f64, min: f64, max: f64) -> Option<Travel> {
    let limits = Limits::symmetric(v, a, j);
    let bounds = PositionLimits { min, max };
    Some(Travel { limits, bounds })
}

/// The second axis begins outside of its travel.
fn machine() -> [Option<Travel>; N] {
    [
        travel(500.0, 5_000.0, 80_000.0, -20.0, 60.0),
        travel(300.0, 2_000.0, 50_000.0, -2.5, 40.0),
        travel(100.0, 3_000.0, 40_000.0, -5.0, 0.5),
        None,
    ]
}

/// Cycles in which all axes come to rest from anything: twice v/a + a/j of the worst.
const STOP: u32 = 250;

#[derive(Debug, Clone, Copy)]
enum Act {
    /// With such a part of the machine's velocity, acceleration and jerk.
    Order(Jog<N>, f64),
    Hold,
    GoHome,
    Rapid(f64),
}

fn act() -> impl Strategy<Value = Act> {
    let axis = || 0..3_usize;
    let speed = || prop_oneof![Just(f64::INFINITY), 1.0..600.0_f64];
    let place = |axis: usize, share: f64| {
        let bounds = machine()[axis].map(|travel| travel.bounds);
        bounds.map(|b| b.min + share * (b.max - b.min))
    };
    let places = || {
        prop::array::uniform4(prop::option::weighted(0.7, 0.0..=1.0_f64)).prop_map(move |shares| {
            std::array::from_fn(|axis| shares[axis].and_then(|share| place(axis, share)))
        })
    };
    let continuous = (axis(), 1.0..600.0_f64, any::<bool>());
    let order = prop_oneof![
        3 => continuous.prop_map(|(axis, speed, up)| Jog::Continuous {
            axis,
            velocity: if up { speed } else { -speed },
        }),
        3 => (axis(), -20.0..20.0_f64, speed())
            .prop_map(|(axis, distance, speed)| Jog::Step { axis, distance, speed }),
        2 => places().prop_map(Jog::To),
        2 => (places(), speed()).prop_map(|(to, speed)| Jog::Line { to, speed }),
    ];
    let part = prop_oneof![3 => Just(1.0), 1 => 0.1..1.0_f64];
    prop_oneof![
        8 => (order, part).prop_map(|(jog, part)| Act::Order(jog, part)),
        1 => Just(Act::Hold),
        1 => Just(Act::GoHome),
        2 => prop_oneof![Just(0.0), Just(1.0), 0.05..1.0_f64].prop_map(Act::Rapid),
    ]
}

/// Goes on by one cycle; certifies, between the samples too, every plan that begins.
fn advance(axes: &mut Jogging<N>, rapid: f64) -> Result<(), TestCaseError> {
    let before: [State; N] = std::array::from_fn(|axis| axes.motions[axis].at(axes.clock).state);
    axes.advance(rapid);
    for axis in 0..N {
        let Motion {
            plan,
            began,
            aim,
            due,
            ..
        } = axes.motions[axis];
        let now = axes.motions[axis].at(axes.clock).state;
        let Some(Travel { limits, bounds }) = axes.travel[axis] else {
            prop_assert_eq!(now, State::at_rest(HOME[axis]));
            continue;
        };
        if began + 1 == axes.clock.cycle {
            // An axis on a line follows the line's motion, whose sample is rounded in another place.
            let (start, before) = (plan.start(), before[axis]);
            let jump = [start.p - before.p, start.v - before.v, start.a - before.a];
            let small = [1e-11, 1e-6, 1e-1]
                .into_iter()
                .zip(jump)
                .all(|(most, by)| by.abs() <= most);
            prop_assert!(
                start == before || axes.line.is_some() && small,
                "jumps by {jump:?}"
            );
            let target = match aim {
                Aim::At(position) | Aim::Limit(position) if due == Due::No => {
                    Target::State(State::at_rest(position))
                }
                _ => Target::Velocity { v: 0.0, a: 0.0 },
            };
            let problem = Problem {
                start,
                target,
                limits,
                bounds: None,
            };
            let certificate = verify::axis(&plan, &problem);
            // Relative to the path travelled, which may be of next to no length.
            let arrives = certificate.end_error * certificate.path <= 1e-9;
            prop_assert!(
                arrives && certificate.limit_excess <= 1e-11,
                "{certificate:?} {problem:?} {plan:?}"
            );
            let range = plan.extrema().position;
            prop_assert!(range.min >= bounds.min - 3e-9 && range.max <= bounds.max + 3e-9);
        }
        prop_assert!(
            now.p >= bounds.min - 3e-9 && now.p <= bounds.max + 3e-9,
            "{now:?} {:?}",
            axes.motions[axis]
        );
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(200) })]

    #[test]
    fn whatever_is_ordered_whenever_every_plan_rests_inside_limits_and_travel(
        acts in prop::collection::vec((0..120_u32, act()), 1..25),
    ) {
        let mut axes = Jogging::new(HOME, PERIOD, &machine());
        let mut rapid = 1.0;
        for (wait, act) in acts {
            match act {
                Act::Order(jog, part) => {
                    // As the executor does it: what is refused changes nothing.
                    let mut ordered = axes;
                    ordered.allow(&machine().map(|travel| {
                        travel.map(|Travel { limits, bounds }| Travel {
                            limits: limits.projected(1.0 / part),
                            bounds,
                        })
                    }));
                    let taken = ordered.order(jog, rapid);
                    prop_assert!(taken.is_ok() || rapid == 0.0, "{taken:?}");
                    if taken.is_ok() {
                        axes = ordered;
                    }
                }
                Act::Hold => axes.hold(),
                Act::GoHome => axes.go_home(None),
                Act::Rapid(part) => {
                    rapid = part;
                    axes.change_speed();
                }
            }
            for _ in 0..wait {
                advance(&mut axes, rapid)?;
            }
        }
        let mut held = axes;
        held.hold();
        for _ in 0..STOP {
            advance(&mut held, rapid)?;
        }
        prop_assert!(held.rests(), "held for {STOP} cycles");
        if rapid == 0.0 {
            rapid = 1.0;
            axes.change_speed();
        }
        for home in [false, true] {
            if home {
                axes.go_home(None);
            }
            let begun = axes.clock.cycle;
            while !axes.rests() {
                prop_assert!(axes.clock.cycle < begun + 20_000, "never rests");
                advance(&mut axes, rapid)?;
            }
            for (motion, axis) in axes.motions.iter().zip(0..) {
                if let Aim::At(position) | Aim::Limit(position) = motion.aim {
                    prop_assert_eq!(axes.motions[axis].at(axes.clock).state, State::at_rest(position));
                }
            }
        }
        prop_assert!(axes.is_home());
        let there: [State; N] = std::array::from_fn(|axis| axes.motions[axis].at(axes.clock).state);
        prop_assert_eq!(there, HOME.map(State::at_rest));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A rotary axis counts on for a long time: what its positions are rounded by keeps no plan from being right.
    #[test]
    fn an_axis_far_out_gets_where_it_is_to(
        power in 0.0..9.0_f64,
        (side, distance) in (any::<bool>(), -30.0..30.0_f64),
    ) {
        let far = if side { 1.0 } else { -1.0 } * 10.0_f64.powf(power);
        let limits = Limits::symmetric(300.0, 1_500.0, 20_000.0);
        let travel = Travel { limits, bounds: PositionLimits { min: -1e10, max: 1e10 } };
        let resting = travel.plan(State::at_rest(far), Aim::At(far + distance), 300.0);
        let (plan, leads_there) = resting.unwrap();
        prop_assert!(leads_there && plan.at(f64::INFINITY).p == far + distance, "from rest");
        // On the way, too, a plan that is made again leads there.
        let moving = plan.at(0.25 * plan.duration());
        let again = travel.plan(moving, Aim::At(far + distance), 300.0);
        prop_assert!(again.is_some_and(|(_, leads_there)| leads_there), "from {moving:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A rapid override that falls to a thousandth as an axis slows down: it is far outside its limits, and keeps its jerk.
    #[test]
    fn a_jog_slowed_to_a_thousandth_keeps_its_jerk(
        (v, a, j) in (100.0..500.0_f64, 500.0..5_000.0_f64, 5e3..1e5_f64),
        (start_v, start_a) in (0.0..1.0_f64, -1.0..1.0_f64),
        (override_power, way_power) in (prop_oneof![Just(-3.0), -3.0..0.0_f64], -5.0..1.0_f64),
    ) {
        let limits = Limits::symmetric(v, a, j);
        let travel = Travel { limits, bounds: PositionLimits { min: -1e6, max: 1e6 } };
        let start = State { p: 0.0, v: start_v * v, a: start_a * a };
        let goal = stop(start, limits).unwrap().end().p + 10.0_f64.powf(way_power);
        let speed = v * 10.0_f64.powf(override_power);
        let (plan, _) = travel.plan(start, Aim::At(goal), speed).unwrap();
        let jerk = plan.extrema().jerk;
        let most = j * (1.0 + 1e-9);
        prop_assert!(jerk.max <= most && jerk.min >= -most, "{jerk:?} of {j}");
    }
}
