//! How soon an override takes effect, and that the speed then goes one way, to what is asked for.
//!
//! Two plans that know nothing of each other are compared: the one that an override changed in motion,
//! and the reference, the same path planned from its beginning with that override. From 10 ms after
//! the command on, until the next one,
//!
//! - where the speed is above what is asked for there, it falls, or its acceleration does, unless no
//!   speed profile from the state after 10 ms on does that: of all that the axes' limits let be reached from there,
//!   on a grid, nothing is left then;
//! - where it is below that and below the reference, it rises, or a deceleration is taken back,
//!   unless the reference falls within the next 10 ms of the way: there the path's own limit comes.

use std::collections::BTreeMap;

use crate::common::{LIMITS, contour, planned};
use crate::machine::Machine;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use syncline_trajectory::path::{
    Curve, Derivatives, Feed, Move, Overrides, PathControlMode, PathItem, PathSegment, Setpoint,
};

/// A command shows after this long, s.
const RESPONSE: f64 = 0.010;
/// Cycle of the reference, s.
const FINE: f64 = 0.001;
/// Speeds that differ by less are the same, mm/s.
const SAME: f64 = 0.05;
/// And by this part of what is asked for above it, or below, where a speed profile may ripple that had to be tightened.
const ABOVE: f64 = 1e-3;
const BELOW: f64 = 0.015;
/// An acceleration below this is none, mm/s²: 0.1 mm/s in a second.
const STEADY: f64 = 0.1;
/// From here on the reference falls, mm/s².
const FALLS: f64 = 0.1;

#[derive(Debug, Clone, Copy)]
struct State {
    s: f64,
    v: f64,
    a: f64,
}

impl State {
    /// After so long with that path jerk.
    fn after(self, t: f64, jerk: f64) -> Self {
        let State { s, v, a } = self;
        State {
            s: s + t * (v + t * (a / 2.0 + t * jerk / 6.0)),
            v: v + t * (a + t * jerk / 2.0),
            a: a + t * jerk,
        }
    }
}

impl From<Setpoint<3>> for State {
    fn from(now: Setpoint<3>) -> Self {
        let along = (0..3).map(|i| now.velocity[i] * now.acceleration[i]);
        State {
            s: now.distance,
            v: now.speed,
            a: along.sum::<f64>() / now.speed.max(1e-9),
        }
    }
}

/// The speeds that are programmed along a path.
struct Programmed(Vec<PathSegment<3>>);

impl Programmed {
    fn along(items: &[PathItem<3>], start: [f64; 3]) -> Self {
        let (_, path_segments) = planned(items, start, |_| ());
        Programmed(path_segments)
    }

    fn path_segment(&self, s: f64) -> &PathSegment<3> {
        &self.0[self.0.partition_point(|x| x.start <= s).max(1) - 1]
    }

    fn goes_on(&self, s: f64) -> bool {
        self.0
            .last()
            .is_some_and(|last| s < last.start + last.curve.length() - 1e-9)
    }

    fn at(&self, s: f64) -> Derivatives<3> {
        let path_segment = self.path_segment(s);
        path_segment.curve.at(s - path_segment.start)
    }

    /// What is asked for after overrides.
    fn asked(&self, s: f64, overrides: Overrides) -> f64 {
        let path_segment = self.path_segment(s);
        if path_segment.feed.is_finite() {
            return path_segment.feed * overrides.feed;
        }
        let along = path_segment.curve.at(s - path_segment.start).d1;
        let axes = (0..3).map(|i| LIMITS.velocity[i] / along[i].abs());
        axes.fold(f64::INFINITY, f64::min) * overrides.rapid
    }
}

/// The path with an override from its beginning, to its end or to where that leaves no way on.
struct Reference(Vec<State>);

impl Reference {
    fn with(overrides: Overrides, items: &[PathItem<3>], start: [f64; 3]) -> Self {
        let mut machine = Machine::new(LIMITS, items, start, FINE);
        machine.executor.set_overrides(overrides);
        let mut states = vec![State::from(machine.executor.setpoint())];
        while let Some(now) = machine.advance()
            && !machine.executor.is_held()
        {
            states.push(now.into());
        }
        Reference(states)
    }

    fn speed(&self, s: f64) -> f64 {
        let next = self.0.partition_point(|state| state.s <= s);
        let (Some(a), Some(b)) = (self.0.get(next.wrapping_sub(1)), self.0.get(next)) else {
            return 0.0;
        };
        let part = (s - a.s) / (b.s - a.s);
        (a.v * a.v + part * (b.v * b.v - a.v * a.v)).sqrt()
    }

    fn falls_between(&self, from: f64, to: f64) -> bool {
        let first = self.0.partition_point(|state| state.s < from);
        let mut there = self.0[first.saturating_sub(1)..].iter();
        there.any(|state| state.a < -FALLS && state.s <= to + state.v * FINE)
            || self.0.last().is_none_or(|last| last.s <= to)
    }
}

/// What the speed must not do.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    /// It is above what is asked for and does not fall.
    StaysAbove,
    /// It is below and falls.
    Dips,
    /// It is below and does not rise.
    StaysBelow,
}

fn fault(before: State, now: State, asked: f64, reference: &Reference) -> Option<Fault> {
    let change = now.a - before.a;
    if now.v > asked * (1.0 + ABOVE) + SAME {
        return (now.a > -STEADY && change > -1e-6).then_some(Fault::StaysAbove);
    }
    let there = reference.speed(now.s).min(asked);
    let near = now.v * RESPONSE + 1e-3;
    if now.v >= there * (1.0 - BELOW) - SAME || reference.falls_between(now.s - near, now.s + near)
    {
        None
    } else if now.a < -STEADY && change < 1e-6 {
        Some(Fault::Dips)
    } else if now.a.abs() <= STEADY {
        Some(Fault::StaysBelow)
    } else {
        None
    }
}

/// By what part a limit may be exceeded on the grid.
const CLOSE: f64 = 2e-3;
/// A step of the search for a speed profile that falls, s, the jerks tried in each, and the looks at every path segment
/// on its way.
const STEP: f64 = 0.000_25;
const JERKS: usize = 9;
const LOOKS: usize = 4;
/// States apart by these parts of speed and of the greatest acceleration are one.
const GRID: [f64; 2] = [4e-3, 2e-3];
/// A speed profile must go on for so long beyond where another one does not fall, or come to rest before, s.
const BEYOND: f64 = 0.05;

/// The path jerks that every axis allows in a state.
fn jerks(d: &Derivatives<3>, State { v, a, .. }: State) -> [f64; 2] {
    let mut range = [f64::NEG_INFINITY, f64::INFINITY];
    for i in 0..3 {
        let asked = (d.d3[i] * v * v + 3.0 * d.d2[i] * a) * v;
        let limit = LIMITS.jerk[i] * (1.0 + CLOSE);
        let ends = [1.0, -1.0].map(|side| (side * limit - asked) / d.d1[i]);
        if d.d1[i].abs() > 1e-9 {
            range[0] = range[0].max(ends[0].min(ends[1]));
            range[1] = range[1].min(ends[0].max(ends[1]));
        } else if asked.abs() > limit {
            return [f64::INFINITY, f64::NEG_INFINITY];
        }
    }
    range
}

/// Whether every axis keeps its limits, looked at some times on each path segment, while the path goes on from a
/// state for so long with constant jerk.
fn keeps(programmed: &Programmed, from: State, jerk: f64, time: f64) -> bool {
    let end = from.after(time, jerk).s;
    let mut s = from.s;
    loop {
        let path_segment = programmed.path_segment(s);
        let until = (path_segment.start + path_segment.curve.length()).min(end);
        for k in 0..=LOOKS {
            let there = s + (until - s) * k as f64 / LOOKS as f64;
            let part = if end > from.s {
                (there - from.s) / (end - from.s)
            } else {
                0.0
            };
            let State { v, a, .. } = from.after(part * time, jerk);
            let d = path_segment
                .curve
                .at((there - path_segment.start).min(path_segment.curve.length()));
            let kept = |i: usize| {
                let acceleration = d.d2[i] * v * v + d.d1[i] * a;
                let jerk = d.d3[i] * v * v * v + 3.0 * d.d2[i] * v * a + d.d1[i] * jerk;
                acceleration.abs() <= LIMITS.acceleration[i] * (1.0 + CLOSE)
                    && jerk.abs() <= LIMITS.jerk[i] * (1.0 + CLOSE)
            };
            if !(0..3).all(kept) {
                return false;
            }
        }
        if until >= end || !programmed.goes_on(until) {
            return until >= end;
        }
        s = until;
    }
}

/// Whether the axes' limits leave any way on from a state for `time` on which the speed falls, or its
/// acceleration does, where it is above what is asked for: all that can be reached, on a grid.
fn may_fall(programmed: &Programmed, overrides: Overrides, from: State, time: f64) -> bool {
    let mut states = vec![from];
    for _ in 0..(time / STEP) as usize {
        let mut next = BTreeMap::new();
        for at in &states {
            let [low, high] = jerks(&programmed.at(at.s), *at);
            for k in 0..JERKS {
                let jerk = low + (high - low) * k as f64 / (JERKS - 1) as f64;
                let there = at.after(STEP, jerk);
                let above = there.v > programmed.asked(there.s, overrides);
                if low > high
                    || there.v < 0.0
                    || above && there.a > 0.0 && jerk > 0.0
                    || !keeps(programmed, *at, jerk, STEP)
                {
                    continue;
                }
                if there.v <= SAME && there.a * there.a <= 2.0 * there.v * LIMITS.jerk[2] {
                    return true;
                }
                let key = [
                    there.v / from.v / GRID[0],
                    there.a / LIMITS.acceleration[0] / GRID[1],
                ];
                next.entry(key.map(|x| x.round() as i64)).or_insert(there);
            }
        }
        states = next.into_values().collect();
    }
    !states.is_empty()
}

/// Overrides of paths in motion.
#[derive(Debug, Default)]
struct Count {
    overrides: usize,
    /// The setpoints are others within 10 ms.
    differ: usize,
    /// The new plan is in force within 10 ms.
    in_force: usize,
    /// The worst of the others, ms.
    latest: f64,
    /// How often the speed rose above what is asked for as the path's own limits leave no other speed profile.
    limited: usize,
    stay_above: usize,
    dip: usize,
    stay_below: usize,
}

/// Random override steps at random instants in random programs, at cycles of 1, 2 and 4 ms.
fn survey(programs: u32) -> Count {
    let mut runner = TestRunner::new_with_rng(
        Config::default(),
        TestRng::deterministic_rng(RngAlgorithm::ChaCha),
    );
    let feed = prop_oneof![1 => Just(0.0), 6 => 0.2..2.0_f64, 1 => Just(1.0), 1 => Just(2.0)];
    let overrides = (feed, prop_oneof![Just(1.0), 0.05..1.0_f64])
        .prop_map(|(feed, rapid)| Overrides { feed, rapid });
    let strategy = (
        contour(5.0..60.0),
        3.0..6.7_f64,
        prop_oneof![Just(0.001), 0.005..0.5_f64],
        prop::collection::vec((0.02..0.5_f64, overrides), 2..10),
        prop::sample::select(vec![0.001, 0.002, 0.004]),
    );
    let mut count = Count::default();
    for program in 0..programs {
        let tree = strategy.new_tree(&mut runner).unwrap();
        let (curves, log_feed, tolerance, acts, period) = tree.current();
        let rapid = |k: usize| k % 3 == 2 && curves[k].direction().is_some();
        let items: Vec<_> = (0..curves.len())
            .map(|k| {
                PathItem::Move(Move {
                    curve: curves[k],
                    feed: if rapid(k) {
                        Feed::Rapid
                    } else {
                        Feed::Rate(log_feed.exp())
                    },
                    mode: PathControlMode::Blend(tolerance),
                    tag: k as u32,
                })
            })
            .collect();
        if std::env::var("ONLY").is_ok_and(|p| p != program.to_string()) {
            continue;
        }
        follow(
            &items,
            curves[0].start(),
            &acts,
            period,
            program,
            &mut count,
        );
    }
    count
}

/// One program; each override stands for its time.
fn follow(
    items: &[PathItem<3>],
    start: [f64; 3],
    acts: &[(f64, Overrides)],
    period: f64,
    program: u32,
    count: &mut Count,
) {
    let programmed = Programmed::along(items, start);
    let response = (RESPONSE / period).round() as u64;
    let mut machine = Machine::new(LIMITS, items, start, period);
    for _ in 0..(acts[0].0 / period) as u64 {
        machine.advance();
    }
    let mut before = State::from(machine.executor.setpoint());
    for &(time, overrides) in acts {
        let news = overrides != machine.executor.overrides();
        let reference = Reference::with(overrides, items, start);
        let mut twin = machine.clone();
        machine.executor.set_overrides(overrides);
        let from = before;
        let (mut differs, mut late, mut limited) = (false, 0, false);
        let mut first = from;
        // The speed when it did last what it should.
        let mut right = (from.v, 0);
        let mut faults = Vec::new();
        for cycle in 1..=(time / period) as u64 {
            let Some(now) = machine.advance() else {
                return;
            };
            if cycle <= response {
                differs |= twin.advance() != Some(now);
            }
            if machine.executor.awaits_replacement() {
                late = cycle;
            }
            let now = State::from(now);
            if cycle <= response {
                (first, right) = (now, (now.v, cycle));
            } else {
                let asked = programmed.asked(now.s, overrides);
                let fault = fault(before, now, asked, &reference);
                if fault != Some(Fault::StaysAbove) {
                    right = (now.v, cycle);
                    faults.extend(fault.map(|fault| (fault, now, asked, reference.speed(now.s))));
                } else if now.v > right.0 + SAME || cycle > right.1 + response {
                    let lasts = (cycle - response) as f64 * period + BEYOND;
                    if faults.is_empty() && !limited {
                        limited = !may_fall(&programmed, overrides, first, lasts);
                    }
                    if !limited {
                        faults.push((Fault::StaysAbove, now, asked, reference.speed(now.s)));
                    }
                }
            }
            before = now;
        }
        if !news || from.v == 0.0 {
            continue;
        }
        let late = late as f64 * period * 1e3;
        count.overrides += 1;
        count.differ += usize::from(differs);
        count.in_force += usize::from(late == 0.0);
        count.limited += usize::from(limited);
        count.latest = count.latest.max(late);
        let has = |what| usize::from(faults.iter().any(|(fault, ..)| *fault == what));
        count.stay_above += has(Fault::StaysAbove);
        count.dip += has(Fault::Dips);
        count.stay_below += has(Fault::StaysBelow);
        if late > 0.0 || limited {
            println!(
                "{program}, {period} s: {overrides:?} in {from:?}, {late} ms late, limited: {limited}"
            );
        }
        if let Some(first) = faults.first() {
            let n = faults.len();
            println!(
                "{program}, {period} s: {overrides:?} in {from:?}, {late} ms late: {n}, {first:?}"
            );
        }
    }
}

/// All but some take effect at once; of the others the old plan slows down for the path by itself.
#[test]
fn an_override_shows_within_ten_milliseconds_and_the_speed_goes_one_way() {
    let count = survey(16);
    println!("{count:?}");
    assert!(count.overrides >= 30);
    assert!(count.in_force * 20 >= count.overrides * 19);
    assert!(count.limited <= 1);
    assert_eq!((count.stay_above, count.dip, count.stay_below), (0, 0, 0));
}

/// `cargo test --release -p syncline-trajectory --test trajectory effect -- --ignored --nocapture`
#[test]
#[ignore = "takes two minutes"]
fn many_overrides() {
    let count = survey(400);
    println!("{count:?}");
    assert!(count.in_force * 100 >= count.overrides * 97);
    assert!(count.limited * 80 <= count.overrides);
    assert_eq!((count.stay_above, count.dip, count.stay_below), (0, 0, 0));
}

/// To rest from a cruise on a line it may, but not where the axes cannot take a deceleration back in time.
#[test]
fn a_speed_that_may_fall_is_told_from_one_that_may_not() {
    let at_rest = Overrides {
        feed: 0.0,
        rapid: 0.0,
    };
    let along = |curve| {
        Programmed(vec![PathSegment {
            start: 0.0,
            curve,
            feed: 100.0,
            turns: None,
            most: f64::INFINITY,
            clock: None,
            asked: 100.0,
            speed: 100.0,
            tag: 0,
            waypoints: 0,
        }])
    };
    let line = along(Curve::line([0.0; 3], [100.0, 0.0, 0.0]).unwrap());
    let cruise = State {
        s: 10.0,
        v: 100.0,
        a: 0.0,
    };
    assert!(may_fall(&line, at_rest, cruise, 0.05));
    // What its jerk can take back only in 25 ms.
    let steep = State {
        s: 99.0,
        v: 30.0,
        a: -2_500.0,
    };
    assert!(!may_fall(&line, at_rest, steep, 0.05));
}

/// The checker itself sees a cruise at the old speed, and a dip.
#[test]
fn faults_are_seen() {
    let cruise = |v: f64| (0..1000).map(move |k| (f64::from(k) * v * FINE, v));
    let reference = Reference(cruise(100.0).map(|(s, v)| State { s, v, a: 0.0 }).collect());
    let at = |v: f64, a: f64| State { s: 20.0, v, a };
    for (before, now, asked, expected) in [
        (
            at(100.0, 0.0),
            at(100.0, 0.0),
            50.0,
            Some(Fault::StaysAbove),
        ),
        (at(100.0, 0.0), at(99.9, -80.0), 50.0, None),
        (at(100.0, 90.0), at(100.1, 10.0), 50.0, None),
        (at(50.0, 0.0), at(50.0, 0.0), 100.0, Some(Fault::StaysBelow)),
        (at(50.0, 0.0), at(50.1, 80.0), 100.0, None),
        (at(90.0, 0.0), at(89.9, -40.0), 100.0, Some(Fault::Dips)),
        (at(90.0, -80.0), at(89.9, -40.0), 100.0, None),
        (at(100.0, 0.0), at(100.0, 0.0), 100.0, None),
    ] {
        assert_eq!(fault(before, now, asked, &reference), expected, "{now:?}");
    }
}
