//! How deep windows are shows neither in the motion time nor in how soon an operator is answered.

use std::mem::take;

use proptest::prelude::*;

use super::windows::CREDIT;
use super::*;
use crate::path::{Curve, Executor, Feed, Move, PathControlMode, Plane, curve::ArcDefinition};

const LIMITS: Limits<3> = Limits {
    velocity: [500.0, 400.0, 200.0],
    acceleration: [5_000.0, 3_000.0, 2_000.0],
    jerk: [80_000.0, 50_000.0, 40_000.0],
};

/// Motion time when windows are so many times deeper, and how many there were.
fn time(curves: &[Curve<3>], feed: f64, depth: u8) -> (f64, usize) {
    let mut planner = Planner::new(LIMITS, curves[0].start());
    planner.lookahead *= f64::from(depth);
    planner.horizon *= f64::from(depth);
    planner.window.most_cells *= usize::from(depth);
    let (mut steps, mut windows) = (Vec::new(), 0);
    let mut take = |planner: &mut Planner<3>| {
        while let Some(command) = planner.pop() {
            match command {
                Command::ReplaceTail(step) => steps.truncate(step as usize),
                Command::Section { .. } => steps.push(0.0),
                Command::JerkSegment(segment) => steps.push(segment.duration),
                Command::Commit => windows += 1,
                _ => {}
            }
        }
    };
    for &curve in curves {
        planner
            .push(PathItem::Move(Move {
                curve,
                feed: Feed::Rate(feed),
                mode: PathControlMode::Blend(0.02),
                tag: 0,
            }))
            .unwrap();
        take(&mut planner);
    }
    planner.finish();
    take(&mut planner);
    (steps.iter().sum(), windows)
}

#[test]
fn the_depth_of_the_window_does_not_show() {
    let lines = |points: Vec<[f64; 3]>| -> Vec<Curve<3>> {
        points
            .windows(2)
            .map(|p| Curve::line(p[0], p[1]).unwrap())
            .collect()
    };
    let zigzag = (0..12).map(|k| [4.0 * f64::from(k), 14.0 * f64::from(k % 2), 0.0]);
    let short_segments = (0..3_000).map(|k| {
        let angle = 0.005 * f64::from(k);
        let radius = 10.0 + angle;
        [radius * libm::cos(angle), radius * libm::sin(angle), 0.0]
    });
    let waves = (0..10).map(|k| {
        let x = 20.0 * f64::from(k);
        Curve::arc(ArcDefinition {
            start: [x, 0.0, 0.0],
            end: [x + 20.0, 0.0, 0.0],
            plane: Plane::Xy,
            centre: (x + 10.0, 0.0),
            clockwise: k % 2 == 0,
            turns: 0,
        })
        .unwrap()
    });
    // As on a flute, a cone, a rosette and in a pocket.
    let helix = Curve::arc(ArcDefinition {
        start: [20.0, 0.0, 0.0],
        end: [20.0, 0.0, -15.0],
        plane: Plane::Xy,
        centre: (0.0, 0.0),
        clockwise: false,
        turns: 4,
    });
    let cone = (0..200).map(|k| {
        let angle = 0.2 * f64::from(k);
        let radius = 2.0 + 0.1 * f64::from(k);
        [
            radius * libm::cos(angle),
            radius * libm::sin(angle),
            0.5 * angle,
        ]
    });
    let rosette = (0..400).map(|k| {
        let angle = 0.02 * f64::from(k);
        let radius = 30.0 + 10.0 * libm::cos(5.0 * angle);
        [radius * libm::cos(angle), radius * libm::sin(angle), 0.0]
    });
    let pocket = (0..8).flat_map(|k| {
        let out = 4.0 + 3.0 * f64::from(k);
        let (side, top) = (out, 0.6 * out);
        [
            [-side, -top, 0.0],
            [side, -top, 0.0],
            [side, top, 0.0],
            [-side, top, 0.0],
        ]
    });
    for (curves, feed) in [
        (lines(zigzag.collect()), 300.0),
        (lines(short_segments.collect()), 120.0),
        (waves.collect(), 200.0),
        (vec![helix.unwrap()], 150.0),
        (lines(cone.collect()), 120.0),
        (lines(rosette.collect()), 100.0),
        (lines(pocket.collect()), 250.0),
    ] {
        let (once, windows) = time(&curves, feed, 1);
        let (twice, fewer) = time(&curves, feed, 2);
        assert!(
            windows > 2 && fewer < windows,
            "{windows} and {fewer} windows"
        );
        println!("{once} s in {windows} windows, {twice} s in {fewer}");
        let longer = once / twice - 1.0;
        assert!(longer.abs() < 1e-3, "{once} s instead of {twice} s");
    }
}

/// Executes a zigzag; at the given cycle an operator changes nothing worth mentioning. Returns
/// how many cycles it took, and of how many jerk segments each window was from then on.
fn execute(points: &[[f64; 3]], acts: u64) -> (u64, Vec<usize>) {
    let mut planner = Planner::new(LIMITS, points[0]);
    for ends in points.windows(2) {
        let motion = Move {
            curve: Curve::line(ends[0], ends[1]).unwrap(),
            feed: Feed::Rate(150.0),
            mode: PathControlMode::Blend(0.02),
            tag: 0,
        };
        planner.push(PathItem::Move(motion)).unwrap();
    }
    planner.finish();
    let mut executor = Executor::new(points[0], 0.001);
    let (mut windows, mut segments) = (Vec::new(), 0);
    loop {
        if executor.cycle() == acts {
            let feed = 1.0 + 1e-9;
            executor.set_overrides(Overrides { feed, rapid: 1.0 });
        }
        if let Some(request) = executor.replan_request() {
            planner.replan(&request);
            windows.clear();
        }
        while executor.room() > 0
            && let Some(command) = planner.pop()
        {
            match command {
                Command::JerkSegment(_) => segments += 1,
                Command::Commit => windows.push(take(&mut segments)),
                _ => {}
            }
            assert!(executor.accept(command));
        }
        if executor.is_idle() {
            assert_eq!(executor.late_plans(), 0);
            return (executor.cycle(), windows);
        }
        executor.advance();
    }
}

#[test]
fn a_short_window_answers_a_person_and_costs_little_time() {
    let points: Vec<_> = (0..12)
        .map(|k| [4.0 * f64::from(k), 25.0 * f64::from(k % 2), 0.0])
        .collect();
    let (cycles, _) = execute(&points, u64::MAX);
    for acts in [100, 400, 700] {
        let (with, windows) = execute(&points, acts);
        assert!(windows[0] < MOST_CELLS / 3, "{windows:?}");
        assert!(with <= cycles + cycles / 300, "{with}, not {cycles}");
    }
}

/// What planning a zigzag takes, and how much of it is left in the end; `vain` as if none of the work had
/// brought the path forward.
fn zigzag(vain: bool) -> (Effort, f64) {
    let point = |k: u32| [4.0 * f64::from(k), 14.0 * f64::from(k % 2), 0.0];
    let mut planner = Planner::new(LIMITS, point(0));
    for k in 0..300 {
        let motion = Move {
            curve: Curve::line(point(k), point(k + 1)).unwrap(),
            feed: Feed::Rate(150.0),
            mode: PathControlMode::Blend(0.02),
            tag: 0,
        };
        planner.push(PathItem::Move(motion)).unwrap();
    }
    planner.finish();
    let mut rest = 0.0;
    while let Some(command) = planner.pop() {
        if let Command::JerkSegment(segment) = command {
            rest = segment.end();
        }
        if vain {
            planner.account.work = 0;
            planner.account.distance = planner.cursor.departure.distance;
        }
    }
    (planner.effort(), planner.length - rest)
}

#[test]
fn a_path_that_is_not_worth_the_work_is_crawled_along() {
    let (effort, left) = zigzag(false);
    assert!(
        effort.work > 2 * CREDIT && left < 1e-9,
        "{effort:?}, {left} mm left"
    );
    let (effort, left) = zigzag(true);
    assert!(
        effort.work < CREDIT + CREDIT / 10 && left < 1e-9,
        "{effort:?}, {left} mm left"
    );
}

/// Where no speed is asked for the path is held, also if it rests in front of that by what distances are rounded by: as where an operator
/// held it there, and lets it go on.
#[test]
fn a_rest_beside_where_no_speed_is_asked_for_is_held() {
    let mut planner = Planner::new(LIMITS, [0.0; 3]);
    let overrides = Overrides {
        feed: 0.0,
        rapid: 1.0,
    };
    planner.override_speeds(overrides, None);
    let ends = [[0.0; 3], [10.0, 0.0, 0.0], [20.0, 0.0, 0.0]];
    for (ends, feed) in ends.windows(2).zip([Feed::Rapid, Feed::Rate(50.0)]) {
        let motion = Move {
            curve: Curve::line(ends[0], ends[1]).unwrap(),
            feed,
            mode: PathControlMode::Blend(0.02),
            tag: 0,
        };
        planner.push(PathItem::Move(motion)).unwrap();
    }
    planner.finish();
    let mut held = false;
    while let Some(command) = planner.pop() {
        held |= matches!(command, Command::Hold);
    }
    assert!(held);
    for off in [0.0, 1e-15, 1e-13, 9e-10] {
        planner.cursor.departure = PathState {
            distance: 10.0 - off,
            ..PathState::default()
        };
        planner.cursor.holds = false;
        assert!(!planner.plan_window(None));
        let out: Vec<_> = planner.out.drain(..).collect();
        assert!(
            matches!(out[..], [Command::Hold, Command::Commit]),
            "{off}: {out:?}"
        );
    }
}

/// Goes block by block along lines that come one every `every` cycles, and leaves each hold at once. Whatever the plan goes along
/// has to be handed over with it.
fn block_by_block(
    points: &[[f64; 3]],
    modes: &[PathControlMode],
    feed: f64,
    every: u64,
    crawls: bool,
) -> Result<(), TestCaseError> {
    let mut planner = Planner::new(LIMITS, points[0]);
    if crawls {
        planner.most_work = 0;
    }
    let mut executor = Executor::new(points[0], 0.004);
    executor.set_single_block(true);
    let mut lines = points.windows(2).enumerate();
    let (mut laid, mut end) = (0.0, 0.0);
    // What is crawled along may take longer.
    for cycle in 0..20_000 {
        if cycle % every == 0 {
            match lines.next() {
                Some((tag, ends)) => {
                    let motion = Move {
                        curve: Curve::line(ends[0], ends[1]).expect("points apart"),
                        feed: Feed::Rate(feed),
                        mode: modes[tag],
                        tag: tag as u32,
                    };
                    planner.push(PathItem::Move(motion)).expect("it leads on");
                }
                None => planner.finish(),
            }
        }
        if executor.is_held() && executor.setpoint().speed == 0.0 {
            executor.resume();
        }
        if let Some(request) = executor.replan_request() {
            planner.replan(&request);
        }
        while executor.room() > 0
            && let Some(command) = planner.pop()
        {
            match command {
                Command::Section { .. } => laid = 0.0,
                Command::PathSegment(it) => laid = it.start + it.curve.length(),
                Command::JerkSegment(segment) => end = segment.end(),
                Command::Commit => {
                    prop_assert!(end <= laid + NOTHING, "to {end} along {laid} mm");
                }
                _ => {}
            }
            prop_assert!(executor.accept(command));
        }
        executor.advance();
        let (at, last) = (executor.setpoint().position, points[points.len() - 1]);
        let off = at.iter().zip(last).map(|(at, last)| (at - last).abs());
        if lines.len() == 0 && off.fold(0.0, f64::max) < NOTHING {
            break;
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Also where the path is known to the end of a rounding, and what comes behind it begins there but for rounding.
    #[test]
    fn what_a_plan_goes_along_is_handed_over(
        steps in prop::collection::vec(
            ([-1.0..1.0_f64, -1.0..1.0_f64], -3.0..0.0_f64, any::<bool>()), 2..8),
        feed in 1.0..50.0_f64,
        tolerance in -4.0..-0.3_f64,
        every in 1..1000_u64,
        crawls in prop::bool::weighted(0.8),
    ) {
        let (mut at, tolerance) = ([0.0; 3], 10_f64.powf(tolerance));
        let (mut points, mut modes) = (vec![at], Vec::new());
        for ([x, y], decades, rests) in steps {
            let length = 10_f64.powf(decades);
            at = [at[0] + x * length, at[1] + y * length + 1e-3, 0.0];
            points.push(at);
            modes.push(match rests {
                true => PathControlMode::Stop,
                false => PathControlMode::Blend(tolerance),
            });
        }
        block_by_block(&points, &modes, feed, every, crawls)?;
    }
}
