//! Where waypoints are passed: what an M-code switches has its place where two moves meet, also where that is rounded.

use crate::programs::Draw;
use proptest::prelude::*;
use syncline_trajectory::path::{
    Curve, Executor, Feed, Limits, Move, PathControlMode, PathItem, Planner,
};

const LIMITS: Limits<3> = Limits {
    velocity: [500.0, 400.0, 200.0],
    acceleration: [5_000.0, 3_000.0, 2_000.0],
    jerk: [80_000.0, 50_000.0, 40_000.0],
};

/// Lines whose joints are kinks from a thousandth of a radian on, each with its feed and its way of leaving it.
fn moves(draw: &mut Draw) -> Vec<(Move<3>, f64)> {
    let (mut here, mut heading) = ([0.0; 3], 0.0_f64);
    let feed = draw.log(2.0, 800.0);
    let same_feed = draw.unit() < 0.7;
    let count = 2 + (draw.unit() * 4.0) as u32;
    (0..count)
        .map(|tag| {
            let kink = draw.log(1e-3, 2.5);
            heading += if draw.unit() < 0.5 { kink } else { -kink };
            let length = draw.log(0.05, 200.0);
            let mut end = here;
            end[0] += length * heading.cos();
            end[1] += length * heading.sin();
            let curve = Curve::line(here, end).unwrap();
            here = end;
            let tolerance = draw.log(0.001, 3.0);
            let mode = match (draw.unit() * 4.0) as u32 {
                0 => PathControlMode::Exact(tolerance),
                1 => PathControlMode::Stop,
                _ => PathControlMode::Blend(tolerance),
            };
            let feed = if same_feed {
                feed
            } else {
                draw.log(2.0, 800.0)
            };
            let motion = Move {
                curve,
                feed: Feed::Rate(feed),
                mode,
                tag,
            };
            let may_leave = match mode {
                PathControlMode::Stop => 0.0,
                _ => tolerance,
            };
            (motion, may_leave)
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    /// The first setpoint behind a waypoint is no farther from where its moves meet than the tolerance there and what a
    /// cycle goes.
    #[test]
    fn a_waypoint_is_passed_where_two_moves_meet(seed in any::<u64>(), period in 0.0005..0.02_f64) {
        let mut draw = Draw::of(seed);
        let moves = moves(&mut draw);
        let mut planner = Planner::new(LIMITS, [0.0; 3]);
        // Of each waypoint: its place, and how far the path may be from it.
        let mut places = Vec::new();
        for (motion, may_leave) in &moves {
            planner.push(PathItem::Move(*motion)).unwrap();
            // Some joints have none, some have several.
            for _ in 0..(draw.unit() * 3.0) as u32 {
                planner.waypoint();
                places.push((motion.curve.end(), *may_leave));
            }
        }
        planner.finish();
        let mut executor = Executor::new([0.0; 3], period);
        let mut before = executor.setpoint();
        let mut passed = 0;
        loop {
            while executor.room() > 0 && let Some(command) = planner.pop() {
                prop_assert!(executor.accept(command));
            }
            if executor.is_idle() {
                break;
            }
            let setpoint = executor.advance();
            let apart = |one: [f64; 3], other: [f64; 3]| {
                (0..3).map(|i| (one[i] - other[i]).powi(2)).sum::<f64>().sqrt()
            };
            let way = setpoint.distance - before.distance;
            while passed < executor.waypoints() {
                let (place, may_leave) = places[passed as usize];
                let away = apart(setpoint.position, place);
                prop_assert!(
                    away <= may_leave + way + 1e-9,
                    "waypoint {passed}: {away} mm away, {may_leave} mm may be left, {way} mm a cycle"
                );
                passed += 1;
            }
            before = setpoint;
        }
        prop_assert_eq!(passed as usize, places.len());
    }
}
