//! The path from outside: items in, setpoints out.

use crate::machine::Machine;
use proptest::prelude::*;
use syncline_trajectory::limits::PositionLimits;
use syncline_trajectory::path::{
    Command, Curve, Executor, Feed, Limits, Move, Overrides, PathControlMode, PathItem, Plane,
    Planner, Setpoint, blend::blend, curve::ArcDefinition,
};

const LIMITS: Limits<3> = Limits {
    velocity: [500.0, 400.0, 200.0],
    acceleration: [5_000.0, 3_000.0, 2_000.0],
    jerk: [80_000.0, 50_000.0, 40_000.0],
};
const PERIOD: f64 = 0.002;

fn go(curve: Curve<3>, feed: f64, tag: u32) -> PathItem<3> {
    PathItem::Move(Move {
        curve,
        feed: Feed::Rate(feed),
        mode: PathControlMode::Stop,
        tag,
    })
}

fn execute(start: [f64; 3], items: &[PathItem<3>], period: f64) -> (Executor<3>, Vec<Setpoint<3>>) {
    let mut planner = Planner::new(LIMITS, start);
    let mut executor = Executor::new(start, period);
    let mut rows = vec![executor.setpoint()];
    let mut items = items.iter();
    let mut finished = false;
    loop {
        while executor.room() > 0 {
            if let Some(command) = planner.pop() {
                assert!(executor.accept(command));
            } else if let Some(item) = items.next() {
                planner.push(*item).unwrap();
            } else if !finished {
                planner.finish();
                finished = true;
            } else {
                break;
            }
        }
        if executor.is_idle() {
            return (executor, rows);
        }
        rows.push(executor.advance());
        assert!(rows.len() < 5_000_000, "never ends");
    }
}

fn inside_limits(p: &Setpoint<3>) -> Result<(), TestCaseError> {
    for i in 0..3 {
        prop_assert!(
            p.velocity[i].abs() <= LIMITS.velocity[i] * (1.0 + 1e-12),
            "{p:?}"
        );
        prop_assert!(
            p.acceleration[i].abs() <= LIMITS.acceleration[i] * (1.0 + 1e-12),
            "{p:?}"
        );
        prop_assert!(p.jerk[i].abs() <= LIMITS.jerk[i] * (1.0 + 1e-12), "{p:?}");
    }
    Ok(())
}

fn point() -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-300.0..300.0)
}

/// An arc or helix whose radii differ by what is allowed, or not at all.
fn arc() -> impl Strategy<Value = Curve<3>> {
    let plane = prop_oneof![Just(Plane::Xy), Just(Plane::Zx), Just(Plane::Yz)];
    (
        plane,
        point(),
        -2.0..2.3_f64,
        0.05..6.25_f64,
        -40.0..40.0_f64,
        any::<bool>(),
        0..3_u32,
        prop_oneof![Just(0.0), -1.0..1.0],
    )
        .prop_map(
            |(plane, start, log_radius, angle, rise, clockwise, turns, uneven)| {
                let (a, b) = plane.axes();
                let radius = 10.0_f64.powf(log_radius);
                let centre = (start[a] - radius, start[b]);
                let end_radius = radius + uneven * 0.005;
                let mut end = start;
                end[a] = centre.0 + end_radius * angle.cos();
                end[b] = centre.1 + end_radius * angle.sin();
                end[3 - a - b] += rise;
                Curve::arc(ArcDefinition {
                    start,
                    end,
                    plane,
                    centre,
                    clockwise,
                    turns,
                })
            },
        )
        .prop_filter_map("radius too small to be uneven", |arc| arc.ok())
}

fn curve() -> impl Strategy<Value = Curve<3>> {
    let line = (point(), point()).prop_filter_map("no length", |(a, b)| Curve::line(a, b).ok());
    prop_oneof![line, arc()]
}

/// The blend of two lines at any angle, or of two arcs.
fn rounded() -> impl Strategy<Value = Curve<3>> {
    let corner = (point(), point(), point()).prop_filter_map("no blend", |(a, b, c)| {
        let (before, after) = (Curve::line(a, b).ok()?, Curve::line(b, c).ok()?);
        Some(blend(&before, &after, f64::INFINITY, 0.3)?.curve)
    });
    let arcs = (arc(), point(), 0.2..2.0_f64).prop_filter_map("no blend", |(before, to, turn)| {
        let start = before.end();
        let (mx, my) = (0.5 * (start[0] + to[0]), 0.5 * (start[1] + to[1]));
        let centre = (
            mx - turn * (to[1] - start[1]),
            my + turn * (to[0] - start[0]),
        );
        let after = Curve::arc(ArcDefinition {
            start,
            end: to,
            plane: Plane::Xy,
            centre,
            clockwise: false,
            turns: 0,
        });
        Some(blend(&before, &after.ok()?, f64::INFINITY, 0.05)?.curve)
    });
    prop_oneof![corner, arcs]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn derivatives_are_those_of_the_position(curve in prop_oneof![curve(), rounded()], at in 0.01..0.99_f64) {
        let length = curve.length();
        let s = at * length;
        let here = curve.at(s);
        let greatest = |d: [f64; 3]| d.iter().fold(1e-300_f64, |m, x| m.max(x.abs()));
        let turn = greatest(here.d3) / greatest(here.d2); // rad/mm
        // Blends change quickly all along.
        let (fine, off) = if matches!(curve, Curve::Poly(_)) { (1e-4, 1e-3) } else { (1e-3, 1e-6) };
        let h = (fine * length).min(1e-3 / turn);
        let tool: f64 = here.d1.iter().map(|x| x * x).sum();
        prop_assert!((tool - 1.0).abs() < 1e-12, "|q'|² = {tool}");
        let (before, after) = (curve.at(s - h), curve.at(s + h));
        for i in 0..3 {
            let scale = |f: fn(&syncline_trajectory::path::Derivatives<3>) -> [f64; 3]| {
                [before, here, after].iter().flat_map(f).fold(0.0_f64, |m, x| m.max(x.abs()))
            };
            let noise = 1e-13 * scale(|d| d.q) / h;
            // Central differences are off by h²/6 of the derivative two orders higher.
            let close = |d: f64, e: f64, size: f64, noise: f64| (d - e).abs() <= off * size + noise;
            prop_assert!(close((after.q[i] - before.q[i]) / (2.0 * h), here.d1[i], 1.0, noise));
            prop_assert!(close((after.d1[i] - before.d1[i]) / (2.0 * h), here.d2[i], scale(|d| d.d2), 1e-12 / h));
            prop_assert!(close((after.d2[i] - before.d2[i]) / (2.0 * h), here.d3[i], scale(|d| d.d3), 1e-12 * scale(|d| d.d2) / h));
        }
        let [m1, m2, m3] = curve.derivative_bounds();
        for i in 0..3 {
            prop_assert!(here.d1[i].abs() <= m1[i] * (1.0 + 1e-12));
            prop_assert!(here.d2[i].abs() <= m2[i] * (1.0 + 1e-12));
            prop_assert!(here.d3[i].abs() <= m3[i] * (1.0 + 1e-12));
        }
        // The next two by differences, against the bounds of the stretch.
        let h = 1e-3 * length;
        let (before, after) = (curve.at(s - h), curve.at(s + h));
        let bounds = curve.growth(s - h, s + h);
        for i in 0..3 {
            let d4 = (after.d3[i] - before.d3[i]) / (2.0 * h);
            let d5 = (after.d3[i] - 2.0 * here.d3[i] + before.d3[i]) / (h * h);
            let noise = 1e-9 * greatest(here.d3) / h;
            prop_assert!(d4.abs() <= bounds[3][i] * (1.0 + 1e-9) + noise, "{d4} {}", bounds[3][i]);
            prop_assert!(d5.abs() <= bounds[4][i] * (1.0 + 1e-9) + noise / h, "{d5} {}", bounds[4][i]);
            for at in [&before, &here, &after] {
                for (d, bound) in [at.d1, at.d2, at.d3].iter().zip(bounds) {
                    prop_assert!(d[i].abs() <= bound[i] * (1.0 + 1e-9) + 1e-12, "{} {}", d[i], bound[i]);
                }
            }
        }
        // And the sixth.
        let h = 6e-3 * length;
        let [a, b, c, d] = [-1.5, -0.5, 0.5, 1.5].map(|k| curve.at(s + k * h).d3);
        let bounds = curve.growth(s - 1.5 * h, s + 1.5 * h);
        for i in 0..3 {
            let d6 = ((d[i] - a[i]) - 3.0 * (c[i] - b[i])) / (h * h * h);
            let noise = 1e-11 * greatest(here.d3) / (h * h * h);
            prop_assert!(d6.abs() <= bounds[5][i] * (1.0 + 1e-9) + noise, "{d6} {}", bounds[5][i]);
        }
        let (low, high) = curve.bounds();
        for i in 0..3 {
            prop_assert!(low[i] - 1e-9 <= here.q[i] && here.q[i] <= high[i] + 1e-9);
        }
    }

    #[test]
    fn a_move_keeps_every_limit_and_ends_in_its_end(curve in curve(), feed in 1.0..1000.0_f64) {
        let (executor, rows) = execute(curve.start(), &[go(curve, feed, 7)], PERIOD);
        for row in &rows {
            inside_limits(row)?;
            prop_assert!(row.speed <= feed * (1.0 + 1e-12));
        }
        let last = executor.setpoint();
        prop_assert_eq!(last.position, curve.end());
        prop_assert_eq!(last.tag, 7);
        prop_assert!((last.distance - curve.length()).abs() <= 1e-9 * curve.length());
    }

    #[test]
    fn setpoints_are_a_function_of_the_cycle_number(curve in curve()) {
        let (_, coarse) = execute(curve.start(), &[go(curve, 300.0, 1)], PERIOD);
        let (_, fine) = execute(curve.start(), &[go(curve, 300.0, 1)], PERIOD / 2.0);
        for (c, f) in coarse.iter().zip(fine.iter().step_by(2)) {
            for i in 0..3 {
                prop_assert!((c.position[i] - f.position[i]).abs() <= 1e-9);
            }
        }
    }

    #[test]
    fn a_stop_at_any_instant_ends_at_rest_on_the_path(curve in curve(), feed in 1.0..1000.0_f64, when in 0.0..1.0_f64) {
        let items = [go(curve, feed, 1)];
        let (_, rows) = execute(curve.start(), &items, PERIOD);
        let mut planner = Planner::new(LIMITS, curve.start());
        let mut executor = Executor::new(curve.start(), PERIOD);
        planner.push(items[0]).unwrap();
        planner.finish();
        while let Some(command) = planner.pop() {
            executor.accept(command);
        }
        for _ in 0..(when * rows.len() as f64) as usize {
            executor.advance();
        }
        executor.stop();
        let mut before = executor.setpoint();
        let mut cycles = 0;
        while !executor.is_idle() {
            let now = executor.advance();
            inside_limits(&now)?;
            prop_assert!(now.distance >= before.distance - 1e-12, "{:?} {:?}", before, now);
            let on_curve = curve.at(now.distance).q;
            for (is, should) in now.position.iter().zip(on_curve) {
                prop_assert!((is - should).abs() < 1e-8);
            }
            before = now;
            cycles += 1;
            prop_assert!(cycles <= rows.len());
        }
        prop_assert_eq!(executor.setpoint().speed, 0.0);
        prop_assert_eq!(executor.advance().position, before.position);
    }
}

#[test]
fn smooth_joints_are_passed_without_a_stop() {
    // Two half circles and back, many times over: several windows, no rest in between.
    let half = |from: f64, turns| {
        let (start, end) = ([from, 0.0, 0.0], [-from, 0.0, 0.0]);
        Curve::arc(ArcDefinition {
            start,
            end,
            plane: Plane::Xy,
            centre: (0.0, 0.0),
            clockwise: false,
            turns,
        })
        .unwrap()
    };
    let items: Vec<PathItem<3>> = (0..40)
        .map(|k| {
            PathItem::Move(Move {
                curve: half(if k % 2 == 0 { 20.0 } else { -20.0 }, 0),
                feed: Feed::Rate(150.0),
                mode: PathControlMode::Exact(0.001),
                tag: k,
            })
        })
        .collect();
    let (executor, rows) = execute([20.0, 0.0, 0.0], &items, PERIOD);
    let length = 40.0 * 20.0 * std::f64::consts::PI;
    assert!((executor.setpoint().distance - length).abs() < 1e-6);
    assert_eq!(executor.setpoint().position, [20.0, 0.0, 0.0]);
    let resting = rows.iter().filter(|r| r.speed == 0.0).count();
    assert!(resting <= 2, "{resting} setpoints at rest");
    // The whole at the programmed feed but for the ramps: windows do not show.
    let time = rows.len() as f64 * PERIOD;
    assert!(time < length / 150.0 + 0.15, "{time} s");
    for row in &rows {
        inside_limits(row).unwrap();
    }
    for pair in rows.windows(2) {
        assert!(pair[0].tag <= pair[1].tag && pair[0].distance <= pair[1].distance);
    }
}

#[test]
fn a_dwell_rests_for_its_time_under_its_tag() {
    let a = Curve::line([0.0; 3], [10.0, 0.0, 0.0]).unwrap();
    let b = Curve::line([10.0, 0.0, 0.0], [10.0, 20.0, 0.0]).unwrap();
    let items = [
        go(a, 100.0, 1),
        PathItem::Dwell {
            duration: 0.5,
            tag: 2,
            block: None,
        },
        go(b, 100.0, 3),
    ];
    let (executor, rows) = execute([0.0; 3], &items, PERIOD);
    let resting = rows.iter().filter(|r| r.tag == 2).count();
    assert!((249..=251).contains(&resting), "{resting} cycles");
    assert!(
        rows.iter()
            .filter(|r| r.tag == 2)
            .all(|r| r.position == [10.0, 0.0, 0.0])
    );
    assert_eq!(executor.setpoint().position, [10.0, 20.0, 0.0]);
}

/// From a cruise on a line the closed form: the stop begins in the next cycle and takes v/a + a/j,
/// or 2·√(v/j) where the deceleration is not reached. On a gentle curve a little longer, as the planner
/// answers.
#[test]
fn a_stop_in_a_cruise_begins_at_once() {
    let line = Curve::line([0.0; 3], [900.0, 0.0, 0.0]).unwrap();
    let circle = Curve::arc(ArcDefinition {
        start: [0.0; 3],
        end: [0.0; 3],
        plane: Plane::Xy,
        centre: (150.0, 0.0),
        clockwise: true,
        turns: 0,
    });
    for (curve, feed, expected, slower) in [
        (line, 400.0, 400.0 / 5_000.0 + 5_000.0 / 80_000.0, 1.0),
        (line, 100.0, 2.0 * (100.0_f64 / 80_000.0).sqrt(), 1.0),
        (
            circle.unwrap(),
            100.0,
            // Two axes together allow up to this jerk along a slope.
            2.0 * (100.0_f64 / 94_340.0).sqrt(),
            1.4,
        ),
    ] {
        let mut planner = Planner::new(LIMITS, [0.0; 3]);
        let mut executor = Executor::new([0.0; 3], PERIOD);
        planner.push(go(curve, feed, 1)).unwrap();
        planner.finish();
        while let Some(command) = planner.pop() {
            executor.accept(command);
        }
        while executor.setpoint().distance < 300.0 {
            executor.advance();
        }
        assert!((executor.setpoint().speed - feed).abs() < 1e-2 * feed);
        executor.stop();
        let mut cycles = 0;
        while !executor.is_idle() {
            if let Some(request) = executor.replan_request() {
                planner.replan(&request);
            }
            while executor.room() > 0
                && let Some(command) = planner.pop()
            {
                executor.accept(command);
            }
            executor.advance();
            cycles += 1;
        }
        let took = f64::from(cycles) * PERIOD;
        let allowed = expected - PERIOD..expected * slower + PERIOD;
        assert!(allowed.contains(&took), "{took} s for {expected} s");
    }
}

/// However late its answers to an override came before, whether it answers now or not.
#[test]
fn a_hold_begins_soon_behind_a_slow_planner() {
    let circle = Curve::arc(ArcDefinition {
        start: [0.0; 3],
        end: [0.0; 3],
        plane: Plane::Xy,
        centre: (50.0, 0.0),
        clockwise: true,
        turns: 2,
    });
    for (answers, most) in [(true, 5), (false, 20)] {
        let mut planner = Planner::new(LIMITS, [0.0; 3]);
        let mut executor = Executor::new([0.0; 3], PERIOD);
        planner.push(go(circle.unwrap(), 200.0, 1)).unwrap();
        planner.finish();
        let supply = |planner: &mut Planner<3>, executor: &mut Executor<3>| {
            while executor.room() > 0
                && let Some(command) = planner.pop()
            {
                executor.accept(command);
            }
        };
        supply(&mut planner, &mut executor);
        while executor.setpoint().distance < 100.0 {
            executor.advance();
        }
        executor.set_overrides(Overrides {
            feed: 0.9,
            rapid: 1.0,
        });
        // Each answer comes a cycle too late.
        for _ in 0..4 {
            let request = executor.replan_request().unwrap();
            while executor.cycle() <= request.cycle {
                executor.advance();
            }
            planner.replan(&request);
            supply(&mut planner, &mut executor);
            executor.advance();
        }
        executor.feed_hold();
        let cruise = executor.setpoint().speed;
        let mut cycles = 0;
        while executor.setpoint().speed > cruise - 0.1 {
            if answers && let Some(request) = executor.replan_request() {
                planner.replan(&request);
                supply(&mut planner, &mut executor);
            }
            executor.advance();
            cycles += 1;
        }
        assert!(cycles <= most, "{cycles} cycles");
    }
}

/// So many lines of a zigzag whose corners are rounded, so that the path has no rest of its own, and
/// an executor where it begins.
fn zigzag(lines: u32) -> (Planner<3>, Executor<3>) {
    let corner = |n: u32| [f64::from(n) * 20.0, f64::from(n % 2) * 5.0, 0.0];
    let mut planner = Planner::new(LIMITS, [0.0; 3]);
    for n in 0..lines {
        planner
            .push(PathItem::Move(Move {
                curve: Curve::line(corner(n), corner(n + 1)).unwrap(),
                feed: Feed::Rate(300.0),
                mode: PathControlMode::Blend(0.5),
                tag: n,
            }))
            .unwrap();
    }
    planner.finish();
    (planner, Executor::new([0.0; 3], PERIOD))
}

/// An axis that stands, or begins, a little beyond its soft limit takes no rounding and no curve away from the others.
#[test]
fn an_axis_beside_its_soft_limit_takes_no_curve_away() {
    let far = PositionLimits {
        min: -1e3,
        max: 1e3,
    };
    let most = PositionLimits {
        min: -300.0,
        max: 0.0,
    };
    for short in [false, true] {
        let motion = |z: f64, leads_in: f64| {
            let place = |n: u32| match short {
                true => {
                    let angle = 0.05 * f64::from(n);
                    [
                        20.0 * angle.cos(),
                        20.0 * angle.sin(),
                        z - f64::from(n) * leads_in,
                    ]
                }
                false => [
                    f64::from(n) * 20.0,
                    f64::from(n % 2) * 5.0,
                    z - f64::from(n) * leads_in,
                ],
            };
            let mut planner = Planner::new(LIMITS, place(0));
            planner.keep_within([far, far, most]);
            let mut executor = Executor::new(place(0), PERIOD);
            for n in 0..60 {
                let line = Move {
                    curve: Curve::line(place(n), place(n + 1)).unwrap(),
                    feed: Feed::Rate(100.0),
                    mode: PathControlMode::Blend(0.05),
                    tag: n,
                };
                planner.push(PathItem::Move(line)).unwrap();
                while let Some(command) = planner.pop() {
                    assert!(executor.accept(command));
                }
            }
            planner.finish();
            let mut cycles = 0;
            loop {
                while let Some(command) = (executor.room() > 0).then(|| planner.pop()).flatten() {
                    assert!(executor.accept(command));
                }
                if executor.is_idle() {
                    return cycles;
                }
                executor.advance();
                cycles += 1;
            }
        };
        for leads_in in [0.0, 1e-3] {
            let inside = motion(-1.0, leads_in);
            for beyond in [2e-8, 2e-5, 0.01] {
                let beside = motion(beyond, leads_in);
                assert!(
                    beside <= inside + 1,
                    "{beside} cycles beside, {inside} inside"
                );
            }
        }
    }
}

/// A planner so slow that what it plans comes too late: the path rests on the way where it has to,
/// goes on as soon as there is a plan, and is followed to its end.
#[test]
fn a_late_plan_is_waited_for_at_rest() {
    let (mut planner, mut executor) = zigzag(90);
    let mut replan_requests = std::collections::VecDeque::new();
    let (mut rests, mut cycle) = (0, 0_u64);
    while executor.setpoint().position[0] < 1800.0 || !executor.is_idle() {
        let moved = executor.setpoint().speed > 0.0;
        let now = executor.advance();
        rests += u32::from(moved && now.speed == 0.0);
        assert_eq!(now.velocity == [0.0; 3], now.speed == 0.0);
        cycle += 1;
        assert!(cycle < 200_000, "never ends");
        // Every answer takes 80 cycles, and the next window 4,000.
        replan_requests.push_back((cycle + 80, executor.replan_request()));
        if cycle % 80 == 1 && executor.awaits_replacement() || cycle % 4000 == 1 {
            while replan_requests
                .front()
                .is_some_and(|(due, _)| *due <= cycle)
            {
                if let Some((_, Some(request))) = replan_requests.pop_front() {
                    planner.replan(&request);
                }
            }
            // A window at a time.
            while let Some(command) = planner.pop() {
                let whole = matches!(command, Command::Commit);
                assert!(executor.accept(command));
                if whole {
                    break;
                }
            }
        }
    }
    assert!(executor.late_plans() > 0, "it was late");
    let end = executor.setpoint().position;
    assert!(
        (end[0] - 1800.0).abs() < 1e-9 && end[1].abs() < 1e-9,
        "{end:?}"
    );
    assert!(rests > 0);
}

/// However late a planner answers: the path rests on the way where it has to, and goes on whenever
/// there is a plan.
#[test]
fn progress_is_certain_however_late_the_plans_come() {
    for late in [1, 30, 300, 1_000] {
        let (mut planner, mut executor) = zigzag(60);
        let mut due = 0;
        let (mut request, mut plan) = (None, Vec::new());
        for cycle in 0_u64.. {
            assert!(cycle < 200_000, "{late} cycles late: never ends");
            // One window at a time is worked on, and ready so much later.
            if cycle >= due {
                for command in plan.drain(..) {
                    assert!(executor.accept(command));
                }
                if let Some(request) = &request {
                    planner.replan(request);
                }
                while let Some(command) = planner.pop() {
                    plan.push(command);
                    if matches!(command, Command::Commit) {
                        break;
                    }
                }
                request = None;
                due = cycle + late;
            }
            if plan.is_empty() && executor.is_idle() {
                break;
            }
            let before = executor.setpoint();
            let now = executor.advance();
            inside_limits(&now).unwrap();
            for i in 0..3 {
                let moved = (now.position[i] - before.position[i]).abs();
                assert!(moved <= LIMITS.velocity[i] * PERIOD, "{before:?} {now:?}");
            }
            request = executor.replan_request().or(request);
        }
        let end = executor.setpoint().position;
        assert!(
            (end[0] - 1200.0).abs() < 1e-9 && end[1].abs() < 1e-9,
            "{late} cycles late: {end:?}"
        );
    }
}

/// A stop while the way back is still being handed over leaves nothing of it.
#[test]
fn a_stop_drops_what_is_not_committed() {
    let line = Curve::line([0.0; 3], [100.0, 0.0, 0.0]).unwrap();
    let mut planner = Planner::new(LIMITS, [0.0; 3]);
    let mut executor = Executor::new([0.0; 3], PERIOD);
    planner.push(go(line, 100.0, 1)).unwrap();
    planner.finish();
    while let Some(command) = planner.pop() {
        executor.accept(command);
    }
    for _ in 0..200 {
        executor.advance();
    }
    executor.retrace();
    while executor.setpoint().speed > 0.0 {
        executor.advance();
    }
    planner.replan(&executor.replan_request().unwrap());
    for _ in 0..3 {
        assert!(executor.accept(planner.pop().unwrap()));
    }
    let rest = executor.setpoint().position;
    executor.stop();
    while let Some(command) = planner.pop() {
        executor.accept(command);
    }
    executor.advance();
    assert!(executor.is_idle());
    assert_eq!(executor.advance().position, rest);
}

/// Executes items with an operator who acts before each cycle, and checks every setpoint.
fn act(
    items: &[PathItem<3>],
    start: [f64; 3],
    mut operator: impl FnMut(&mut Executor<3>) -> bool,
) -> Vec<Setpoint<3>> {
    let mut machine = Machine::new(LIMITS, items, start, PERIOD);
    let mut rows = vec![machine.executor.setpoint()];
    while operator(&mut machine.executor)
        && let Some(now) = machine.advance()
    {
        rows.push(now);
    }
    rows
}

#[test]
fn feed_override_takes_effect_within_ten_milliseconds() {
    let line = Curve::line([0.0; 3], [900.0, 0.0, 0.0]).unwrap();
    for (to, expected) in [(0.5, 100.0), (1.5, 300.0), (0.0, 0.0), (0.1, 20.0)] {
        let mut cycle = 0;
        let rows = act(&[go(line, 200.0, 1)], [0.0; 3], |executor| {
            cycle += 1;
            if cycle == 500 {
                executor.set_overrides(Overrides {
                    feed: to,
                    rapid: 1.0,
                });
            }
            cycle < 1000
        });
        for row in &rows {
            inside_limits(row).unwrap();
        }
        let before = rows[499].speed;
        assert!((before - 200.0).abs() < 0.1, "{before}");
        assert!(
            (rows[505].speed - before).abs() > 1e-3,
            "{to}: {}",
            rows[505].speed
        );
        let now = rows[700].speed;
        assert!((now - expected).abs() <= 1e-3 * expected, "{to}: {now}");
        for pair in rows[499..750].windows(2) {
            let rise = (pair[1].speed - pair[0].speed) * (expected - before).signum();
            assert!(rise >= -1e-4 * before, "{to}: {rise}");
        }
    }
}

#[test]
fn a_hold_rests_and_resumes() {
    let line = Curve::line([0.0; 3], [300.0, 0.0, 0.0]).unwrap();
    let mut cycle = 0;
    let rows = act(&[go(line, 200.0, 1)], [0.0; 3], |executor| {
        cycle += 1;
        match cycle {
            300 => executor.feed_hold(),
            600 => {
                assert!(executor.is_held());
                executor.resume();
            }
            _ => {}
        }
        true
    });
    for row in &rows {
        inside_limits(row).unwrap();
    }
    assert_eq!(rows[550].speed, 0.0);
    assert!(rows[606].speed > 0.0);
    assert_eq!(rows.last().unwrap().position, [300.0, 0.0, 0.0]);
}

/// A dwell is rest already: a hold in it changes nothing about how long it takes, and one that lasts longer
/// has the path go on as soon as it is resumed.
#[test]
fn a_hold_in_a_dwell_does_not_run_it_again() {
    let a = Curve::line([0.0; 3], [10.0, 0.0, 0.0]).unwrap();
    let b = Curve::line([10.0, 0.0, 0.0], [10.0, 20.0, 0.0]).unwrap();
    let dwell = PathItem::Dwell {
        duration: 1.0,
        tag: 2,
        block: None,
    };
    let items = [go(a, 100.0, 1), dwell, go(b, 100.0, 3)];
    // Held after so many cycles of the dwell for so many; how many the path rests there.
    let rests = |holds: &[(usize, usize)]| {
        let mut dwelt = 0;
        let rows = act(&items, [0.0; 3], |executor| {
            dwelt += usize::from(executor.setpoint().tag == 2);
            for &(after, cycles) in holds {
                if dwelt == after {
                    executor.feed_hold();
                    assert!(executor.is_held());
                } else if dwelt == after + cycles {
                    executor.resume();
                }
            }
            true
        });
        assert_eq!(rows.last().unwrap().position, [10.0, 20.0, 0.0]);
        let resting = rows.iter().filter(|row| row.tag == 2);
        assert!(resting.clone().all(|row| row.position == [10.0, 0.0, 0.0]));
        resting.count()
    };
    let whole = rests(&[]);
    assert!((499..=501).contains(&whole), "{whole} cycles");
    for holds in [
        &[(50, 100)][..],
        &[(1, 30), (200, 50), (300, 150)],
        &[(400, 90)],
    ] {
        let rested = rests(holds);
        assert!(
            rested.abs_diff(whole) <= 1,
            "{holds:?}: {rested}, not {whole}"
        );
    }
    for hold in [(50, 800), (400, 120)] {
        let rested = rests(&[hold]);
        let resumed = hold.0 + hold.1;
        assert!(
            (resumed..resumed + 12).contains(&rested),
            "{hold:?}: {rested}"
        );
    }
}

#[test]
fn a_stop_after_the_block_rests_in_its_end() {
    let square = [
        [0.0; 3],
        [50.0, 0.0, 0.0],
        [50.0, 50.0, 0.0],
        [0.0, 50.0, 0.0],
    ];
    let items: Vec<_> = square
        .windows(2)
        .enumerate()
        .map(|(k, p)| {
            PathItem::Move(Move {
                curve: Curve::line(p[0], p[1]).unwrap(),
                feed: Feed::Rate(100.0),
                mode: PathControlMode::Blend(0.1),
                tag: k as u32,
            })
        })
        .collect();
    let mut cycle = 0;
    let mut rested = None;
    let rows = act(&items, [0.0; 3], |executor| {
        cycle += 1;
        if cycle == 100 {
            assert_eq!(executor.setpoint().tag, 0);
            executor.set_single_block(true);
        }
        if executor.is_held() && rested.is_none() {
            rested = Some(cycle);
        }
        if rested.is_some_and(|r| cycle == r + 50) {
            executor.set_single_block(false);
            executor.resume();
        }
        true
    });
    let row = &rows[rested.unwrap() + 10];
    assert_eq!((row.speed, row.tag), (0.0, 0));
    // In the middle of its rounding.
    let [x, y, _] = row.position;
    assert!((x - 50.0).hypot(y) <= 0.1, "{:?}", row.position);
    assert_eq!(rows.last().unwrap().position, [0.0, 50.0, 0.0]);
    for row in &rows {
        inside_limits(row).unwrap();
    }
}

/// Retraced, too: going on from there ends at the same place once more.
#[test]
fn single_block_rests_at_the_end_of_every_block() {
    let corners = [
        [0.0; 3],
        [20.0, 0.0, 0.0],
        [20.0, 20.0, 0.0],
        [0.0, 20.0, 0.0],
    ];
    let items: Vec<_> = corners
        .windows(2)
        .enumerate()
        .map(|(k, p)| {
            PathItem::Move(Move {
                curve: Curve::line(p[0], p[1]).unwrap(),
                feed: Feed::Rate(100.0),
                mode: PathControlMode::Exact(0.01),
                tag: k as u32,
            })
        })
        .collect();
    let mut rests = Vec::new();
    let mut held = 0;
    let rows = act(&items, [0.0; 3], |executor| {
        executor.set_single_block(true);
        held = if executor.is_held() { held + 1 } else { 0 };
        if held == 20 {
            rests.push(executor.setpoint().tag);
            match rests.len() {
                2 => executor.retrace(),
                _ => executor.resume(),
            }
        }
        true
    });
    // Back at the beginning of the second block, that is at the end of the first.
    assert_eq!(rests[..2], [0, 1]);
    assert_eq!(rests.len(), 5, "{rests:?}");
    assert_eq!(rests[3..], [1, 2]);
    assert_eq!(rows.last().unwrap().position, [0.0, 20.0, 0.0]);
}

/// Whoever switches single block off at a rest has not asked to go on yet: no override does, which ends a rest
/// for want of speed.
#[test]
fn a_rest_of_single_block_waits_for_a_resume_though_it_is_off() {
    let line = |to: f64, tag| {
        PathItem::Move(Move {
            curve: Curve::line([to - 20.0, 0.0, 0.0], [to, 0.0, 0.0]).unwrap(),
            feed: Feed::Rate(100.0),
            mode: PathControlMode::Blend(0.1),
            tag,
        })
    };
    for change in [0.0, 0.5, 1.5] {
        let (mut held, mut rested) = (0, None);
        let rows = act(&[line(20.0, 0), line(40.0, 1)], [0.0; 3], |executor| {
            if rested.is_none() {
                executor.set_single_block(true);
            }
            held = if executor.is_held() { held + 1 } else { 0 };
            let feed = |feed| Overrides { feed, rapid: 1.0 };
            match held {
                20 => {
                    rested = Some(executor.setpoint().position);
                    executor.set_single_block(false);
                }
                40 => executor.set_overrides(feed(change)),
                60 => executor.set_overrides(feed(1.0)),
                500 => executor.resume(),
                _ => {}
            }
            if (1..=500).contains(&held) && rested.is_some() {
                assert_eq!(Some(executor.setpoint().position), rested);
            }
            true
        });
        assert!(rested.is_some_and(|it| it[0] < 21.0), "{rested:?}");
        assert_eq!(rows.last().unwrap().position, [40.0, 0.0, 0.0]);
        assert!(rows.len() > 500, "it went on by itself");
    }
}

#[test]
fn steps_back_and_forwards_again() {
    let corners = [
        [0.0; 3],
        [50.0, 0.0, 0.0],
        [50.0, 50.0, 0.0],
        [0.0, 50.0, 0.0],
    ];
    let items: Vec<_> = corners
        .windows(2)
        .enumerate()
        .map(|(k, p)| {
            PathItem::Move(Move {
                curve: Curve::line(p[0], p[1]).unwrap(),
                feed: Feed::Rate(100.0),
                mode: PathControlMode::Blend(0.5),
                tag: k as u32,
            })
        })
        .collect();
    let mut cycle = 0;
    let mut phase = 0;
    let mut at = Vec::new();
    let rows = act(&items, [0.0; 3], |executor| {
        cycle += 1;
        let held = executor.is_held();
        if cycle == 400 || held && phase == 1 || held && phase == 2 {
            at.push(executor.setpoint());
            executor.retrace();
            phase += 1;
        } else if held && phase == 3 {
            at.push(executor.setpoint());
            executor.resume();
            phase += 1;
        }
        true
    });
    assert_eq!(at[0].tag, 1);
    // To the middle of the blend that begins its block, to the beginning of the one before, no further.
    let [x, y, _] = at[1].position;
    assert!((x - 50.0).hypot(y) <= 0.5, "{:?}", at[1]);
    assert_eq!(at[2].position, [0.0; 3]);
    assert_eq!(at[3].position, [0.0; 3]);
    assert_eq!(rows.last().unwrap().position, [0.0, 50.0, 0.0]);
    for pair in rows.windows(2) {
        inside_limits(&pair[1]).unwrap();
        for i in 0..3 {
            let moved = (pair[1].position[i] - pair[0].position[i]) / PERIOD;
            assert!((moved - pair[1].velocity[i]).abs() < 15.0, "{:?}", pair[1]);
        }
    }
}

/// Overrides that come while it rests behind a retrace lead nowhere: neither further back nor on.
/// The same in the midst of the way back, and in the last cycles of it.
#[test]
fn overrides_change_nothing_of_where_a_retrace_leads() {
    let corners = [0.0, 50.0, 100.0, 150.0].map(|x| [x, 0.0, 0.0]);
    let lines = corners.windows(2).enumerate();
    let items: Vec<_> = lines
        .map(|(k, p)| go(Curve::line(p[0], p[1]).unwrap(), 50.0, k as u32))
        .collect();
    let part = |feed| Overrides {
        feed,
        ..Overrides::default()
    };
    // Cycles from the retrace on: at 500 it rests.
    let times = [vec![500, 600], vec![100], vec![500, 501, 502]];
    let ends = (150..350).step_by(3).map(|at| vec![at, at + 1]);
    for times in times.into_iter().chain(ends) {
        let mut cycle = 0;
        let mut rests = Vec::new();
        let rows = act(&items, [0.0; 3], |executor| {
            cycle += 1;
            assert!(cycle < 100_000, "{times:?}: never ends");
            match cycle {
                700 | 1850 => executor.retrace(),
                1500 | 1800 | 2500 => rests.push(executor.setpoint()),
                _ => {}
            }
            if cycle == 1501 {
                executor.resume();
            }
            if cycle == 2501 {
                // Twice: the second one does not wait for the plan of the first.
                executor.set_overrides(part(0.9));
                executor.resume();
                executor.set_overrides(part(0.8));
            }
            if let Some(k) = times.iter().position(|at| cycle == 700 + at) {
                executor.set_overrides(part(0.5 + 0.1 * k as f64));
            }
            true
        });
        assert_eq!(rests[0].position, [50.0, 0.0, 0.0], "{times:?}");
        assert!(rests[1].position[0] > 55.0, "{times:?}: {:?}", rests[1]);
        assert_eq!(rests[2].position, [50.0, 0.0, 0.0], "{times:?}");
        assert_eq!(rows.last().unwrap().position, [150.0, 0.0, 0.0]);
    }
}

/// Least distance to rest along a curve from a state, on a dense grid of time: jerk as low as the
/// axes allow and their accelerations permit, then as high, switched where that comes to rest.
fn least_stop(curve: &Curve<3>, s: f64, v: f64, a: f64) -> f64 {
    const DT: f64 = 2e-5;
    let drive = |switch: f64| {
        let (mut s, mut v, mut a, mut t) = (s, v, a, 0.0);
        loop {
            let here = curve.at(s);
            let ahead = curve.at(s + v * DT);
            let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
            let mut least = f64::NEG_INFINITY;
            for i in 0..3 {
                let d = here.d1[i];
                if d != 0.0 {
                    let bend = here.d3[i] * v * v * v + 3.0 * here.d2[i] * v * a;
                    let ends = [1.0, -1.0].map(|side| (side * LIMITS.jerk[i] - bend) / d);
                    low = low.max(ends[0].min(ends[1]));
                    high = high.min(ends[0].max(ends[1]));
                }
                let d = ahead.d1[i];
                if d != 0.0 {
                    let bend = ahead.d2[i] * v * v;
                    let ends = [1.0, -1.0].map(|side| (side * LIMITS.acceleration[i] - bend) / d);
                    least = least.max(ends[0].min(ends[1]));
                }
            }
            let j = if t < switch {
                low.max((least - a) / DT).min(high)
            } else {
                high
            };
            s += DT * (v + DT * (a / 2.0 + DT * j / 6.0));
            v += DT * (a + DT * j / 2.0);
            a += DT * j;
            t += DT;
            if v <= 0.0 || t > switch && a >= 0.0 {
                return (s, v, t);
            }
        }
    };
    let (mut early, mut late) = (0.0, 2.0);
    for _ in 0..40 {
        let switch = 0.5 * (early + late);
        if drive(switch).1 <= 0.0 {
            late = switch;
        } else {
            early = switch;
        }
    }
    drive(late).0 - s
}

#[test]
fn a_hold_stops_in_the_least_distance() {
    let line = Curve::line([0.0; 3], [300.0, 200.0, 0.0]).unwrap();
    let circle = |radius: f64| {
        Curve::arc(ArcDefinition {
            start: [0.0; 3],
            end: [0.0; 3],
            plane: Plane::Xy,
            centre: (radius, 0.0),
            clockwise: true,
            turns: 0,
        })
        .unwrap()
    };
    // Where the bends themselves take the limits up, only that it rests where the plan does, or
    // before.
    for (curve, feed, allowed) in [
        (line, 30.0, 1.001),
        (line, 400.0, 1.001),
        (circle(5.0), 20.0, 1.04),
        (circle(5.0), 400.0, f64::INFINITY),
        (circle(20.0), 50.0, 1.04),
        (circle(20.0), 400.0, f64::INFINITY),
        (circle(150.0), 100.0, 1.04),
        (circle(150.0), 400.0, 1.06),
    ] {
        let (_, rows) = execute(curve.start(), &[go(curve, feed, 1)], PERIOD);
        for part in 1..9 {
            let at = rows.len() * part / 9;
            let mut planner = Planner::new(LIMITS, curve.start());
            let mut executor = Executor::new(curve.start(), PERIOD);
            planner.push(go(curve, feed, 1)).unwrap();
            planner.finish();
            while let Some(command) = planner.pop() {
                executor.accept(command);
            }
            for _ in 0..at {
                executor.advance();
            }
            executor.feed_hold();
            // On a line at once, on a curve when the planner has answered.
            let begins = if curve.direction().is_some() { 0 } else { 3 };
            let mut from = executor.setpoint();
            for cycle in 1.. {
                if let Some(request) = executor.replan_request() {
                    planner.replan(&request);
                }
                while executor.room() > 0
                    && let Some(command) = planner.pop()
                {
                    executor.accept(command);
                }
                let now = executor.advance();
                inside_limits(&now).unwrap();
                if cycle == begins {
                    from = now;
                }
                if now.speed == 0.0 {
                    break;
                }
            }
            let along = curve.at(from.distance).d1;
            let a: f64 = (0..3).map(|i| from.acceleration[i] * along[i]).sum();
            let took = executor.setpoint().distance - from.distance;
            assert!(took <= curve.length() - from.distance + 1e-9);
            if allowed.is_finite() {
                let least = least_stop(&curve, from.distance, from.speed, a);
                assert!(
                    took <= allowed * least + 1e-3,
                    "{took} mm for {least} at feed {feed}: {from:?}"
                );
            }
        }
    }
}
