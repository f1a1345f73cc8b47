//! What a hold costs in the cycle: processor time of `hold` and of every `advance` until rest, on lines,
//! circles and rounded corners, from states all along the path:
//! `cargo bench -p syncline-benches --bench hold`.

use std::hint::black_box;
use syncline_benches::paths::{begin, circle, lines, point, supply, zigzag};
use syncline_controller::realtime::thread_time;
use syncline_trajectory::path::Curve;

const N: usize = 6;

fn main() {
    let line = lines([point(0.0, 0.0), point(300.0, 200.0)].into_iter());
    let paths: [(&str, Vec<Curve<N>>); 4] = [
        ("line", line),
        ("circle 5 mm", circle(5.0)),
        ("circle 100 mm", circle(100.0)),
        ("zigzag", zigzag(12)),
    ];
    println!(
        "{:14} {:>9} {:>9} {:>9} {:>9}",
        "µs", "calls", "p50", "p99.9", "max"
    );
    for (name, curves) in paths {
        let mut took = Vec::new();
        for feed in [20.0, 100.0, 400.0] {
            let (mut planner, mut plan) = begin(&curves, feed, 0.1);
            loop {
                supply(&mut planner, &mut plan);
                if plan.is_idle() {
                    break;
                }
                let mut executor = plan.clone();
                let begin = thread_time();
                executor.hold();
                took.push(thread_time() - begin);
                while executor.setpoint().speed > 0.0 {
                    let begin = thread_time();
                    black_box(executor.advance());
                    took.push(thread_time() - begin);
                }
                for _ in 0..5 {
                    plan.advance();
                }
            }
        }
        took.sort_unstable();
        let at = |part: f64| took[((took.len() - 1) as f64 * part) as usize].as_secs_f64() * 1e6;
        println!(
            "{name:14} {:>9} {:>9.2} {:>9.2} {:>9.2}",
            took.len(),
            at(0.5),
            at(0.999),
            at(1.0)
        );
    }
}
