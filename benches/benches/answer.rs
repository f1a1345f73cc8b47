//! How long an operator waits for the planner: its processor time from an override in motion until the
//! executor can have the first part of the new plan, from states all along some paths:
//! `cargo bench -p syncline-benches --bench answer`.

use std::f64::consts::TAU;
use syncline_benches::paths::{begin, circle, lines, point, supply, zigzag};
use syncline_controller::machine::COORDINATES;
use syncline_controller::realtime::thread_time;
use syncline_trajectory::path::{Curve, Overrides};

const N: usize = COORDINATES;
/// Cycles between two overrides that are tried.
const STEP: usize = 7;
/// Overrides tried per path and feed at most.
const MOST: usize = 400;

fn main() {
    let rosette = (0..=240).map(|k| {
        let angle = f64::from(k) * TAU / 240.0;
        let radius = 40.0 + 8.0 * (6.0 * angle).cos();
        let rounded = |x: f64| (x * 1e3).round() / 1e3;
        point(rounded(radius * angle.cos()), rounded(radius * angle.sin()))
    });
    let paths: [(_, Vec<Curve<N>>); 4] = [
        ("circle 5 mm", circle(5.0)),
        ("circle 100 mm", circle(100.0)),
        ("zigzag", zigzag(59)),
        ("rosette of lines", lines(rosette)),
    ];
    println!(
        "{:17} {:>5} {:>6} {:>7} {:>7} {:>7}",
        "ms", "mm/s", "n", "p50", "p90", "max"
    );
    for (name, curves) in paths {
        for feed in [20.0, 100.0, 400.0] {
            let mut took = answers(&curves, feed);
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
fn answers(curves: &[Curve<N>], feed: f64) -> Vec<std::time::Duration> {
    let (mut planner, mut plan) = begin(curves, feed, 0.02);
    let mut took = Vec::new();
    while took.len() < MOST {
        supply(&mut planner, &mut plan);
        if plan.is_idle() {
            break;
        }
        for feed in [0.5, 1.5] {
            let (mut executor, mut planner) = (plan.clone(), planner.clone());
            executor.set_overrides(Overrides { feed, rapid: 1.0 });
            if let Some(request) = executor.replan_request() {
                let begin = thread_time();
                planner.replan(&request);
                took.push(thread_time() - begin);
            }
        }
        for _ in 0..STEP {
            plan.advance();
        }
    }
    took
}
