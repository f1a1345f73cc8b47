//! What an operator does to a running path, at random: overrides, feed holds and what ends them, single
//! blocks, retracing. Whatever comes, the axes stay on the path and inside their limits.

use crate::common::{LIMITS, contour, planned};
use crate::machine::Machine;
use proptest::prelude::*;
use syncline_trajectory::path::{
    Curve, Feed, Move, Overrides, PathControlMode, PathItem, PathSegment, Setpoint,
};

/// Short, so that what happens between the cycles of a real machine shows.
const PERIOD: f64 = 0.000_5;
/// Part of a limit by which the plan's own certificate may miss.
const EXCESS: f64 = 1e-8;
/// By how much the length of a blend's parts may be off, mm.
const LENGTH: f64 = 1e-9;
/// By how much an axis may be elsewhere along the path, also on the way back, mm.
const ALONG: f64 = 1e-9;

/// What is asked for where nobody acts any more.
const FAST: Overrides = Overrides {
    feed: 2.0,
    rapid: 1.0,
};

#[derive(Debug, Clone, Copy)]
enum Act {
    Override(Overrides),
    Hold,
    Resume,
    SingleBlock(bool),
    Retrace,
}

fn act() -> impl Strategy<Value = Act> {
    let feed = prop_oneof![Just(0.0), 0.01..2.0_f64, Just(1.0), Just(2.0)];
    let overrides = (feed, prop_oneof![Just(1.0), 0.05..1.0_f64]);
    prop_oneof![
        4 => overrides.prop_map(|(feed, rapid)| Act::Override(Overrides { feed, rapid })),
        2 => Just(Act::Hold),
        1 => Just(Act::Resume),
        1 => prop::bool::ANY.prop_map(Act::SingleBlock),
        1 => Just(Act::Retrace),
    ]
}

/// The path as it is planned when nobody acts.
struct Path {
    path_segments: Vec<PathSegment<3>>,
}

impl Path {
    fn of(items: &[PathItem<3>], start: [f64; 3]) -> Self {
        let (_, path_segments) = planned(items, start, |_| ());
        Path { path_segments }
    }

    fn at(&self, distance: f64) -> [f64; 3] {
        let index = self
            .path_segments
            .partition_point(|s| s.start <= distance)
            .max(1)
            - 1;
        let path_segment = &self.path_segments[index];
        path_segment.curve.at(distance - path_segment.start).q
    }
}

/// Executes items while an operator acts at the given cycles; whoever is held goes on after a while.
fn run(
    items: &[PathItem<3>],
    start: [f64; 3],
    acts: &[(u64, Act)],
) -> Result<Setpoint<3>, TestCaseError> {
    let path = Path::of(items, start);
    let mut machine = Machine::new(LIMITS, items, start, PERIOD);
    let mut acts = acts.iter().peekable();
    let mut held = 0;
    loop {
        let executor = &mut machine.executor;
        if let Some((_, act)) = acts.next_if(|(at, _)| *at <= executor.cycle()) {
            match *act {
                Act::Override(overrides) => executor.set_overrides(overrides),
                Act::Hold => executor.feed_hold(),
                Act::Resume => executor.resume(),
                Act::SingleBlock(on) => executor.set_single_block(on),
                Act::Retrace => executor.retrace(),
            }
        }
        // Nobody waits for ever.
        let waits = executor.is_held() || acts.peek().is_none();
        held = if waits { held + 1 } else { 0 };
        if held > 400 {
            executor.set_overrides(FAST);
            executor.resume();
            held = 0;
        }
        let before = executor.setpoint();
        let Some(now) = machine.advance() else {
            return Ok(before);
        };
        check(&path, &before, &now)?;
    }
}

fn check(path: &Path, before: &Setpoint<3>, now: &Setpoint<3>) -> Result<(), TestCaseError> {
    let there = path.at(now.distance);
    for i in 0..3 {
        prop_assert!(
            (now.position[i] - there[i]).abs() < ALONG,
            "{now:?} for {there:?}"
        );
        let within = |x: f64, limit: f64| x.abs() <= limit * (1.0 + EXCESS);
        prop_assert!(within(now.velocity[i], LIMITS.velocity[i]), "{now:?}");
        prop_assert!(
            within(now.acceleration[i], LIMITS.acceleration[i]),
            "{now:?}"
        );
        prop_assert!(within(now.jerk[i], LIMITS.jerk[i]), "{now:?}");
        // Nothing jumps.
        let moved = now.position[i] - before.position[i];
        let mean = 0.5 * (now.velocity[i] + before.velocity[i]) * PERIOD;
        let slack = LIMITS.jerk[i] * PERIOD * PERIOD * PERIOD / 6.0 + LENGTH;
        prop_assert!((moved - mean).abs() <= slack, "{before:?} {now:?}");
        let gained = now.velocity[i] - before.velocity[i];
        let mean = 0.5 * (now.acceleration[i] + before.acceleration[i]) * PERIOD;
        let slack = LIMITS.jerk[i] * PERIOD * PERIOD / 2.0 + 1e-6;
        prop_assert!((gained - mean).abs() <= slack, "{before:?} {now:?}");
        let change = now.acceleration[i] - before.acceleration[i];
        let slack = LIMITS.jerk[i] * PERIOD * (1.0 + EXCESS) + 1e-3;
        prop_assert!(change.abs() <= slack, "{before:?} {now:?}");
    }
    Ok(())
}

/// What is left of the plan may be less than a rounding of lengths, and the axes still move.
#[test]
fn an_override_right_before_the_end_of_the_path() {
    for k in 0..60 {
        let line = Curve::line([0.0; 3], [10.0 + 0.0137 * f64::from(k), 0.0, 0.0]).unwrap();
        let items = [PathItem::Move(Move {
            curve: line,
            feed: Feed::Rate(50.0),
            mode: PathControlMode::Stop,
            tag: 0,
        })];
        let mut machine = Machine::new(LIMITS, &items, [0.0; 3], PERIOD);
        let mut whole = 0;
        while machine.advance().is_some() {
            whole += 1;
        }
        for cycle in whole - 24..whole {
            let slower = Overrides {
                feed: 0.9,
                rapid: 1.0,
            };
            run(&items, [0.0; 3], &[(cycle, Act::Override(slower))]).unwrap();
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), max_shrink_iters: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn whatever_an_operator_does_the_axes_stay_on_the_path_and_inside_their_limits(
        curves in contour(10.0..100.0),
        feed in 5.0..800.0_f64,
        tolerance in prop_oneof![Just(0.001), 0.005..0.5_f64],
        acts in prop::collection::vec((1..1500_u64, act()), 1..8),
    ) {
        let items: Vec<_> = curves
            .iter()
            .enumerate()
            .map(|(k, curve)| PathItem::Move(Move {
                curve: *curve,
                feed: if k % 3 == 2 && curve.direction().is_some() { Feed::Rapid } else { Feed::Rate(feed) },
                mode: PathControlMode::Blend(tolerance),
                tag: k as u32,
            }))
            .collect();
        let mut at = 0;
        let acts: Vec<_> = acts.into_iter().map(|(wait, act)| { at += wait; (at, act) }).collect();
        let last = run(&items, curves[0].start(), &acts)?;
        let end = curves.last().unwrap().end();
        for (is, should) in last.position.iter().zip(end) {
            prop_assert!((is - should).abs() < 1e-9);
        }
    }
}

/// More with `PROPTEST_CASES`.
fn cases() -> u32 {
    let wanted = std::env::var("PROPTEST_CASES").ok();
    wanted.and_then(|n| n.parse().ok()).unwrap_or(12)
}
