//! How long a person waits for the planner: its processor time from an override in motion until the
//! executor can have the first part of the new plan, from states all along some paths:
//! `cargo bench -p syncline-benches --bench answer`.

use std::f64::consts::TAU;
use syncline_controller::program::COORDINATES;
use syncline_controller::realtime::thread_time;
use syncline_trajectory::path::{
    Curve, Executor, Exit, Feed, Item, Limits, Move, Overrides, Plane, Planner,
    curve::ArcDefinition,
};

const N: usize = COORDINATES;
const PERIOD: f64 = 0.002;
/// Cycles between two overrides that are tried.
const STEP: usize = 7;
/// Overrides tried per path and feed at most.
const MOST: usize = 400;

fn point(x: f64, y: f64) -> [f64; N] {
    let mut point = [0.0; N];
    (point[0], point[1]) = (x, y);
    point
}

fn lines(points: impl Iterator<Item = [f64; N]>) -> Vec<Curve<N>> {
    let points: Vec<_> = points.collect();
    let line = |ends: &[[f64; N]]| Curve::line(ends[0], ends[1]).expect("two points");
    points.windows(2).map(line).collect()
}

fn circle(radius: f64) -> Vec<Curve<N>> {
    let circle = Curve::arc(ArcDefinition {
        start: point(0.0, 0.0),
        end: point(0.0, 0.0),
        plane: Plane::Xy,
        centre: (radius, 0.0),
        clockwise: true,
        turns: 0,
    });
    vec![circle.expect("a circle")]
}

fn main() {
    let limits = Limits {
        velocity: [500.0; N],
        acceleration: [5_000.0; N],
        jerk: [80_000.0; N],
    };
    let zigzag = (0..60).map(|k| point(10.0 * f64::from(k), 8.0 * f64::from(k % 2)));
    let rosette = (0..=240).map(|k| {
        let angle = f64::from(k) * TAU / 240.0;
        let radius = 40.0 + 8.0 * (6.0 * angle).cos();
        let rounded = |x: f64| (x * 1e3).round() / 1e3;
        point(rounded(radius * angle.cos()), rounded(radius * angle.sin()))
    });
    let paths = [
        ("circle 5 mm", circle(5.0)),
        ("circle 100 mm", circle(100.0)),
        ("zigzag", lines(zigzag)),
        ("rosette of lines", lines(rosette)),
    ];
    println!(
        "{:17} {:>5} {:>6} {:>7} {:>7} {:>7}",
        "ms", "mm/s", "n", "p50", "p90", "max"
    );
    for (name, curves) in paths {
        for feed in [20.0, 100.0, 400.0] {
            let mut took = answers(&curves, feed, limits);
            took.sort_unstable();
            let at =
                |part: f64| took[((took.len() - 1) as f64 * part) as usize].as_secs_f64() * 1e3;
            println!(
                "{name:17} {feed:>5} {:>6} {:>7.2} {:>7.2} {:>7.2}",
                took.len(),
                at(0.5),
                at(0.9),
                at(1.0)
            );
        }
    }
}

/// Processor time of every answer along the path.
fn answers(curves: &[Curve<N>], feed: f64, limits: Limits<N>) -> Vec<std::time::Duration> {
    let mut planner = Planner::new(limits, curves[0].start());
    for curve in curves {
        let motion = Move {
            curve: *curve,
            feed: Feed::Rate(feed),
            exit: Exit::Blend(0.02),
            tag: 0,
        };
        planner.push(Item::Move(motion)).expect("a path");
    }
    planner.finish();
    let mut plan = Executor::new(curves[0].start(), PERIOD, 4096);
    let mut took = Vec::new();
    while took.len() < MOST {
        while plan.room() > 0
            && let Some(command) = planner.pop()
        {
            plan.accept(command);
        }
        if plan.is_idle() {
            break;
        }
        for feed in [0.5, 1.5] {
            let (mut executor, mut planner) = (plan.clone(), planner.clone());
            executor.set_overrides(Overrides { feed, rapid: 1.0 });
            if let Some(outlook) = executor.outlook() {
                let begin = thread_time();
                planner.observe(&outlook);
                took.push(thread_time() - begin);
            }
        }
        for _ in 0..STEP {
            plan.advance();
        }
    }
    took
}
