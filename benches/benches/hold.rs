//! What coming to rest costs in the cycle, on lines, circles, rounded corners and smoothed short segments, from
//! states all along the path: processor time of `hold`, with a planner that answers after 4 ms, or of `stop` without
//! one, and of every cycle until rest; and what the planner's answers cost it:
//! `cargo bench -p syncline-benches --bench hold`.

use std::collections::VecDeque;
use std::hint::black_box;
use syncline_benches::paths::{begin, circle, lines, point, supply, zigzag};
use syncline_controller::realtime::thread_time;
use syncline_trajectory::path::Curve;

const N: usize = 6;
/// Cycles after which the planner answers.
const ANSWER: usize = 2;

fn main() {
    let line = lines([point(0.0, 0.0), point(300.0, 200.0)].into_iter());
    // A wave in chords of 0.5 mm.
    let short_segments = lines((0..400).map(|k| {
        let x = 0.5 * f64::from(k);
        point(x, 20.0 * (x / 15.0).sin())
    }));
    let paths: [(&str, Vec<Curve<N>>); 5] = [
        ("line", line),
        ("circle 5 mm", circle(5.0)),
        ("circle 100 mm", circle(100.0)),
        ("zigzag", zigzag(12)),
        ("short segments", short_segments),
    ];
    println!(
        "{:6} {:14} {:>9} {:>9} {:>9} {:>9}",
        "µs", "", "calls", "p50", "p99.9", "max"
    );
    for ((name, curves), holds) in paths
        .iter()
        .flat_map(|path| [true, false].map(|holds| (path, holds)))
    {
        let (mut took, mut answered) = (Vec::new(), Vec::new());
        for feed in [20.0, 100.0, 400.0] {
            let (mut planner, mut plan) = begin(curves, feed, 0.1);
            loop {
                supply(&mut planner, &mut plan);
                if plan.is_idle() {
                    break;
                }
                let mut executor = plan.clone();
                let mut answers = planner.clone();
                let mut replan_requests = VecDeque::new();
                let begin = thread_time();
                if holds {
                    executor.feed_hold();
                } else {
                    executor.stop();
                }
                took.push(thread_time() - begin);
                while executor.setpoint().speed > 0.0 {
                    let mut commands = Vec::new();
                    if holds {
                        replan_requests.push_back(executor.replan_request());
                        if replan_requests.len() > ANSWER
                            && let Some(Some(request)) = replan_requests.pop_front()
                        {
                            let begin = thread_time();
                            answers.replan(&request);
                            answered.push(thread_time() - begin);
                        }
                        commands.extend(std::iter::from_fn(|| answers.pop()).take(executor.room()));
                    }
                    let begin = thread_time();
                    for command in commands {
                        executor.accept(command);
                    }
                    black_box(executor.advance());
                    took.push(thread_time() - begin);
                }
                for _ in 0..5 {
                    plan.advance();
                }
            }
        }
        let what = if holds { "hold" } else { "stop" };
        for (what, mut took) in [(what, took), ("answer", answered)] {
            if took.is_empty() {
                continue;
            }
            took.sort_unstable();
            let at =
                |part: f64| took[((took.len() - 1) as f64 * part) as usize].as_secs_f64() * 1e6;
            println!(
                "{what:6} {name:14} {:>9} {:>9.2} {:>9.2} {:>9.2}",
                took.len(),
                at(0.5),
                at(0.999),
                at(1.0)
            );
        }
    }
}
