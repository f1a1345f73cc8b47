//! What a hold costs in the cycle: processor time of `hold` and of every `advance` until rest, on lines,
//! circles and rounded corners, from states all along the path:
//! `cargo bench -p syncline-benches --bench hold`.

use std::hint::black_box;
use syncline_controller::realtime::thread_time;
use syncline_trajectory::path::{
    Curve, Executor, Exit, Feed, Item, Limits, Move, Plane, Planner, curve::ArcDefinition,
};

const N: usize = 6;
const PERIOD: f64 = 0.002;

fn main() {
    let limits = Limits {
        velocity: [500.0; N],
        acceleration: [5_000.0; N],
        jerk: [80_000.0; N],
    };
    let point = |x: f64, y: f64| [x, y, 0.0, 0.0, 0.0, 0.0];
    let line = |a, b| Curve::line(a, b).expect("two points");
    let circle = |radius: f64| {
        Curve::arc(ArcDefinition {
            start: point(0.0, 0.0),
            end: point(0.0, 0.0),
            plane: Plane::Xy,
            centre: (radius, 0.0),
            clockwise: true,
            turns: 0,
        })
        .expect("a circle")
    };
    let zigzag = (0..12)
        .map(|k| {
            let at = |k: i32| point(10.0 * f64::from(k), if k % 2 == 0 { 0.0 } else { 8.0 });
            line(at(k), at(k + 1))
        })
        .collect();
    let paths: [(&str, Vec<Curve<N>>); 4] = [
        ("line", vec![line(point(0.0, 0.0), point(300.0, 200.0))]),
        ("circle 5 mm", vec![circle(5.0)]),
        ("circle 100 mm", vec![circle(100.0)]),
        ("zigzag", zigzag),
    ];
    println!(
        "{:14} {:>9} {:>9} {:>9} {:>9}",
        "µs", "calls", "p50", "p99.9", "max"
    );
    for (name, curves) in paths {
        let mut took = Vec::new();
        for feed in [20.0, 100.0, 400.0] {
            let mut planner = Planner::new(limits, curves[0].start());
            let mut plan = Executor::new(curves[0].start(), PERIOD, 4096);
            for curve in &curves {
                let motion = Move {
                    curve: *curve,
                    feed: Feed::Rate(feed),
                    exit: Exit::Blend(0.1),
                    tag: 0,
                };
                planner.push(Item::Move(motion)).expect("a path");
            }
            planner.finish();
            loop {
                while plan.room() > 0
                    && let Some(command) = planner.pop()
                {
                    plan.accept(command);
                }
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
