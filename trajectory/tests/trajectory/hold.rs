//! How short a hold stops: on lines against the closed form, on curves against a dense grid.

use std::collections::VecDeque;

use crate::common::{LIMITS, contour, planned};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use syncline_trajectory::path::{
    Executor, Feed, Move, PathControlMode, PathItem, PathSegment, Planner, Setpoint,
};

const PERIOD: f64 = 0.002;

/// A state on the way, and what the axes allow there.
#[derive(Debug, Clone, Copy)]
struct State {
    s: f64,
    v: f64,
    a: f64,
}

struct Geometry<'a>(&'a [PathSegment<3>]);

impl Geometry<'_> {
    fn path_segment(&self, s: f64) -> &PathSegment<3> {
        &self.0[self
            .0
            .partition_point(|path_segment| path_segment.start <= s)
            .max(1)
            - 1]
    }

    fn at(&self, s: f64) -> [[f64; 3]; 3] {
        let path_segment = self.path_segment(s);
        let at = path_segment.curve.at(s - path_segment.start);
        [at.d1, at.d2, at.d3]
    }

    fn state(&self, now: &Setpoint<3>) -> State {
        let [d1, ..] = self.at(now.distance);
        State {
            s: now.distance,
            v: now.speed,
            a: (0..3).map(|i| now.acceleration[i] * d1[i]).sum(),
        }
    }

    /// The ranges of path acceleration and jerk, by every axis on its own.
    fn allowed(&self, State { s, v, a }: State) -> [[f64; 2]; 2] {
        let [d1, d2, d3] = self.at(s);
        let mut ranges = [[f64::NEG_INFINITY, f64::INFINITY]; 2];
        for i in 0..3 {
            if d1[i] == 0.0 {
                continue;
            }
            let asked = [d2[i] * v * v, (d3[i] * v * v + 3.0 * d2[i] * a) * v];
            let limits = [LIMITS.acceleration[i], LIMITS.jerk[i]];
            for what in 0..2 {
                let ends = [1.0, -1.0].map(|side| (side * limits[what] - asked[what]) / d1[i]);
                ranges[what][0] = ranges[what][0].max(ends[0].min(ends[1]));
                ranges[what][1] = ranges[what][1].min(ends[0].max(ends[1]));
            }
        }
        ranges
    }
}

/// Least distance to rest on a dense grid of speeds: twice the square of the deceleration as high
/// as the axes' jerks allow from the start and towards the rest, where the path is as it was in the
/// round before. None if that does not settle, or some axis is beyond its limits.
fn least_stop(geometry: &Geometry, from: State) -> Option<f64> {
    const CELLS: usize = 400;
    const DT: f64 = 2e-5;
    let mut at = from;
    // The acceleration goes first.
    while at.a > 0.0 {
        let [_, [low, high]] = geometry.allowed(at);
        if low > high * (1.0 + 1e-6) || low >= 0.0 {
            return None;
        }
        let dt = DT.min(at.a / -low);
        let next = State {
            s: at.s + dt * (at.v + dt * (at.a / 2.0 + dt * low / 6.0)),
            v: at.v + dt * (at.a + dt * low / 2.0),
            a: at.a + dt * low,
        };
        at = if dt < DT {
            State { a: 0.0, ..next }
        } else {
            next
        };
    }
    let top = at;
    // Speeds a time of equal jerks apart, denser at both ends.
    let grid: Vec<f64> = (0..=CELLS)
        .map(|k| {
            let x = k as f64 / CELLS as f64;
            let y = if x < 0.5 {
                1.0 - 2.0 * x * x
            } else {
                2.0 * (1.0 - x) * (1.0 - x)
            };
            top.v * y
        })
        .collect();
    let [[_, _], [low, _]] = geometry.allowed(State { a: 0.0, ..top });
    let mut e: Vec<f64> = grid
        .iter()
        .map(|v| 0.3 * -low * v.min(top.v - v + 1e-3 * top.v))
        .collect();
    e[0] = 0.5 * top.a * top.a;
    e[CELLS] = 0.0;
    let mut distance = f64::INFINITY;
    for round in 0..200 {
        let states = ways(&grid, &e, top);
        let ranges: Vec<_> = states.iter().map(|s| geometry.allowed(*s)).collect();
        let mut next = vec![0.0; CELLS + 1];
        for k in (0..CELLS).rev() {
            let high = ranges[k][1][1].min(ranges[k + 1][1][1]);
            let least = ranges[k][0][0].min(0.0);
            next[k] =
                (next[k + 1] + high * (grid[k] - grid[k + 1])).clamp(0.0, 0.5 * least * least);
        }
        if next[0] < 0.5 * top.a * top.a * (1.0 - 1e-3) && round > 100 {
            return None;
        }
        next[0] = 0.5 * top.a * top.a;
        for k in 0..CELLS {
            let low = ranges[k][1][0].max(ranges[k + 1][1][0]);
            next[k + 1] = next[k + 1]
                .min(next[k] - low * (grid[k] - grid[k + 1]))
                .max(0.0);
        }
        let part = if round < 20 { 0.7 } else { 0.3 };
        for (e, next) in e.iter_mut().zip(&next) {
            *e += part * (next - *e);
        }
        let now = ways(&grid, &e, top)[CELLS].s - from.s;
        if (now - distance).abs() < 1e-6 * now && round > 30 {
            let kept = states.iter().zip(&ranges).all(|(at, [_, [low, high]])| {
                at.v < 0.01 * top.v || *low <= *high + 1e-3 * 80_000.0
            });
            return kept.then_some(now);
        }
        distance = now;
    }
    None
}

/// The states at the speeds of the grid.
fn ways(grid: &[f64], e: &[f64], top: State) -> Vec<State> {
    let mut out = vec![top];
    for k in 1..grid.len() {
        let before = out[k - 1];
        let a = -(2.0 * e[k].max(0.0)).sqrt();
        let dt = 2.0 * (grid[k - 1] - grid[k]) / -(before.a + a).min(-1e-6);
        let jerk = (a - before.a) / dt;
        out.push(State {
            s: before.s + dt * (before.v + dt * (before.a / 2.0 + dt * jerk / 6.0)),
            v: grid[k],
            a,
        });
    }
    out
}

/// Who comes to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Rest {
    Hold,
    Stop,
    /// A stop whose planner does not answer.
    Alone,
}

impl Rest {
    /// Cycles after its command in which it begins to show where the path lets it: 6 ms, or 32 ms.
    fn begins(self) -> usize {
        match self {
            Rest::Hold | Rest::Stop => 3,
            Rest::Alone => 16,
        }
    }
}

/// Cycles after which the planner answers: 4 ms.
const ANSWER: usize = 2;

/// Where it comes to rest, and the states from the cycle on in which that may begin to show, or before
/// where it leaves the plan before, until it leaves the plan. Nothing of the limits is exceeded on
/// the way.
fn come_to_rest(
    rest: Rest,
    planner: &Planner<3>,
    plan: &Executor<3>,
    geometry: &Geometry,
) -> (f64, Vec<State>) {
    let mut planner = (rest != Rest::Alone).then(|| planner.clone());
    let mut executor = plan.clone();
    let mut replan_requests = VecDeque::new();
    let mut twin = plan.clone();
    match rest {
        Rest::Hold => executor.feed_hold(),
        Rest::Stop | Rest::Alone => executor.stop(),
    }
    let mut states = vec![geometry.state(&executor.setpoint())];
    let mut together = true;
    while executor.setpoint().speed > 0.0 {
        if let Some(planner) = &mut planner {
            replan_requests.push_back(executor.replan_request());
            if replan_requests.len() > ANSWER
                && let Some(Some(request)) = replan_requests.pop_front()
            {
                planner.replan(&request);
            }
            while executor.room() > 0
                && let Some(command) = planner.pop()
            {
                executor.accept(command);
            }
        }
        let before = executor.setpoint();
        let now = executor.advance();
        for i in 0..3 {
            let change = (now.velocity[i] - before.velocity[i]).abs();
            let most = LIMITS.acceleration[i] * PERIOD * (1.0 + 2e-9);
            assert!(change <= most, "axis {i}: {before:?} {now:?}");
            for (is, limit) in [
                (now.velocity[i], LIMITS.velocity[i]),
                (now.acceleration[i], LIMITS.acceleration[i]),
                (now.jerk[i], LIMITS.jerk[i]),
            ] {
                assert!(is.abs() <= limit * (1.0 + 2e-9), "axis {i}: {now:?}");
            }
        }
        let there = geometry.path_segment(now.distance);
        let there = there.curve.at(now.distance - there.start).q;
        for (is, should) in now.position.iter().zip(there) {
            assert!((is - should).abs() < 1e-9, "{now:?} for {there:?}");
        }
        let planned = twin.advance();
        let (state, planned) = (geometry.state(&now), geometry.state(&planned));
        together &= (state.s - planned.s).abs() < 1e-9
            && (state.v - planned.v).abs() < 1e-6
            && (state.a - planned.a).abs() < 1e-3;
        if together && now.speed > 0.0 {
            states.push(state);
        }
    }
    let begins = rest.begins().min(states.len() - 1);
    (executor.setpoint().distance, states.split_off(begins))
}

/// Holds, or stops, every so many cycles of so many random programs: how much longer than the least their
/// ways to rest are on curves, in ascending order.
fn survey(programs: u32, every: u32, rest: Rest) -> Vec<f64> {
    let mut runner = TestRunner::new_with_rng(
        Config::default(),
        TestRng::deterministic_rng(RngAlgorithm::ChaCha),
    );
    let strategy = (
        contour(5.0..100.0),
        5.0..800.0_f64,
        prop_oneof![Just(0.001), 0.005..0.5_f64],
    );
    let mut factors = Vec::new();
    let (mut unknown, mut straight) = (0, 0);
    for program in 0..programs {
        let tree = strategy.new_tree(&mut runner).unwrap();
        let (curves, feed, tolerance) = tree.current();
        let items: Vec<_> = (curves.iter())
            .map(|curve| {
                PathItem::Move(Move {
                    curve: *curve,
                    feed: Feed::Rate(feed),
                    mode: PathControlMode::Blend(tolerance),
                    tag: 0,
                })
            })
            .collect();
        let start = curves[0].start();
        let mut plan = Executor::new(start, PERIOD);
        let (planner, path_segments) =
            planned(&items, start, |command| assert!(plan.accept(command)));
        let geometry = Geometry(&path_segments);
        for cycle in 1_u32.. {
            plan.advance();
            if plan.is_idle() {
                break;
            }
            if cycle % every != 0 || plan.setpoint().speed < 1.0 {
                continue;
            }
            let (end, states) = come_to_rest(rest, &planner, &plan, &geometry);
            let (first, took) = (states[0], end - states[0].s);
            let path_segment = geometry.path_segment(first.s);
            if path_segment.curve.direction().is_some()
                && end < path_segment.start + path_segment.curve.length()
            {
                straight += 1;
                continue;
            }
            // Where the path does not let it brake at once the plan is the way until it does.
            let least = states
                .iter()
                .step_by(states.len() / 4 + 1)
                .filter_map(|at| Some(at.s - first.s + least_stop(&geometry, *at)?))
                .fold(f64::INFINITY, f64::min);
            if least.is_finite() {
                let factor = took / least;
                if factor > 1.02 {
                    println!(
                        "{program}/{cycle}, {} cycles: {took:.4} mm for {least:.4} from {first:?}",
                        states.len() - 1
                    );
                }
                factors.push(factor);
            } else {
                unknown += 1;
            }
        }
    }
    factors.sort_by(f64::total_cmp);
    println!(
        "{rest:?}: {straight} on lines, {} on curves, and {unknown} of unknown least",
        factors.len()
    );
    for part in [0.5, 0.9, 0.95, 0.98, 0.99, 1.0] {
        println!(
            "{part}: {:.4}",
            factors[((factors.len() - 1) as f64 * part) as usize]
        );
    }
    factors
}

/// Part of the ways to rest that are more than 1.02 of the least.
fn longer(factors: &[f64]) -> f64 {
    let long = factors.iter().filter(|factor| **factor > 1.02).count();
    long as f64 / factors.len() as f64
}

/// As a rule by far less than 1.02 of the least. What is left are holds where the path or the plan
/// leaves hardly a way down; `many_holds_on_curves` counts them: 4 of 2,612.
#[test]
fn a_hold_on_curves_stops_in_nearly_the_least_distance() {
    let factors = survey(8, 41, Rest::Hold);
    assert!(factors[factors.len() / 2] <= 1.0015);
    assert!(longer(&factors) <= 0.02, "{}", longer(&factors));
    assert!(factors.last().is_some_and(|worst| *worst <= 1.2));
}

/// So does a stop for good; without an answer the cycle itself finds a way.
#[test]
fn a_stop_on_curves_needs_no_planner() {
    let factors = survey(4, 41, Rest::Stop);
    assert!(longer(&factors) <= 0.02, "{}", longer(&factors));
    let factors = survey(8, 41, Rest::Alone);
    assert!(factors[factors.len() / 2] <= 1.002);
    assert!(longer(&factors) <= 0.25, "{}", longer(&factors));
}

/// `cargo test --release -p syncline-trajectory --test trajectory hold -- --ignored --nocapture`
#[test]
#[ignore = "takes a minute"]
fn many_holds_on_curves() {
    for (rest, most) in [
        (Rest::Hold, 0.003),
        (Rest::Stop, 0.003),
        (Rest::Alone, 0.06),
    ] {
        let longer = longer(&survey(40, 17, rest));
        println!("above 1.02: {longer:.4}");
        assert!(longer <= most, "{longer}");
    }
}
