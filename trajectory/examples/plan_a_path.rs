//! Plans a path with a blended corner and follows it cycle by cycle, as a controller does.
//! `cargo run -p syncline-trajectory --example plan_a_path`

use std::error::Error;
use syncline_trajectory::path::{
    Curve, Executor, Feed, Limits, Move, PathControlMode, PathItem, Planner,
};

const LIMITS: Limits<2> = Limits {
    velocity: [300.0; 2],
    acceleration: [3_000.0; 2],
    jerk: [60_000.0; 2],
};
/// s
const CYCLE: f64 = 0.002;

fn main() -> Result<(), Box<dyn Error>> {
    // Along X, round the corner within 0.2 mm, along Y, at 100 mm/s.
    let corners = [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0]];
    let mut planner = Planner::new(LIMITS, corners[0]);
    for ends in corners.windows(2) {
        planner.push(PathItem::Move(Move {
            curve: Curve::line(ends[0], ends[1])?,
            feed: Feed::Rate(100.0),
            mode: PathControlMode::Blend(0.2),
            tag: 0,
        }))?;
    }
    planner.finish();

    // The planner's commands go to the executor, which gives one setpoint a cycle.
    let mut executor = Executor::new(corners[0], CYCLE);
    while let Some(command) = planner.pop() {
        assert!(executor.accept(command), "room for 1024 commands");
    }
    let mut nearest = f64::INFINITY;
    while !executor.is_idle() {
        let setpoint = executor.advance();
        let [x, y] = setpoint.position;
        nearest = nearest.min((x - 20.0).hypot(y));
        if executor.cycle() % 20 == 0 {
            println!(
                "{:4} ms  X{x:7.3} Y{y:7.3}  {:5.1} mm/s",
                executor.cycle() * 2,
                setpoint.speed
            );
        }
    }
    println!(
        "{nearest:.3} mm past the corner, {:.3} s",
        executor.cycle() as f64 * CYCLE
    );
    assert!(nearest <= 0.2);
    assert_eq!(executor.setpoint().position, corners[2]);
    Ok(())
}
