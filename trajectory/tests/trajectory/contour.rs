//! Contours of many moves: the plan's jerk segments, checked between the samples, against the programmed
//! geometry.

use crate::programs::Draw;
use proptest::prelude::*;
use syncline_trajectory::path::{
    Command, Curve, Feed, JerkSegment, Limits, Move, PathControlMode, PathItem, PathSegment, Plane,
    Planner, curve::ArcDefinition,
};

const LIMITS: Limits<3> = Limits {
    velocity: [500.0, 400.0, 200.0],
    acceleration: [5_000.0, 3_000.0, 2_000.0],
    jerk: [80_000.0, 50_000.0, 40_000.0],
};

fn go(curve: Curve<3>, feed: f64, mode: PathControlMode, tag: usize) -> PathItem<3> {
    PathItem::Move(Move {
        curve,
        feed: Feed::Rate(feed),
        mode,
        tag: tag as u32,
    })
}

/// What is executed in the end: jerk segments with the path segments of their section.
#[derive(Default)]
struct Plan {
    sections: Vec<Vec<PathSegment<3>>>,
    /// Section and jerk segment.
    segments: Vec<(usize, JerkSegment)>,
    windows: usize,
    effort: syncline_trajectory::path::window::Effort,
}

impl Plan {
    fn of(items: &[PathItem<3>], start: [f64; 3]) -> Self {
        let mut planner = Planner::new(LIMITS, start);
        let mut plan = Plan::default();
        // Steps as the executor counts them: None for those that are no jerk segments.
        let mut steps: Vec<Option<(usize, JerkSegment)>> = Vec::new();
        let mut drain = |planner: &mut Planner<3>| {
            while let Some(command) = planner.pop() {
                match command {
                    Command::Section { .. } => {
                        plan.sections.push(Vec::new());
                        steps.push(None);
                    }
                    Command::PathSegment(path_segment) => {
                        plan.sections.last_mut().unwrap().push(path_segment)
                    }
                    Command::ReplaceTail(step) => steps.truncate(step as usize),
                    Command::JerkSegment(segment) => {
                        steps.push(Some((plan.sections.len() - 1, segment)))
                    }
                    Command::Dwell { .. } => steps.push(None),
                    Command::Commit => plan.windows += 1,
                    other => panic!("{other:?}"),
                }
            }
        };
        for item in items {
            planner.push(*item).unwrap();
            drain(&mut planner);
        }
        planner.finish();
        drain(&mut planner);
        plan.effort = planner.effort();
        plan.segments = steps.into_iter().flatten().collect();
        plan
    }

    fn time(&self) -> f64 {
        self.segments.iter().map(|(_, p)| p.duration).sum()
    }

    /// Calls `f` with position, axis accelerations and jerks, path speed and feed, `n` times a jerk segment.
    fn sample(&self, n: usize, mut f: impl FnMut([f64; 3], [f64; 3], [f64; 3], f64, f64)) {
        for (section, segment) in &self.segments {
            let path_segments = &self.sections[*section];
            let index = path_segments.partition_point(|s| s.start <= segment.distance + 1e-9) - 1;
            let path_segment = &path_segments[index];
            for k in 0..=n {
                let (ds, v, a) = segment.at(segment.duration * k as f64 / n as f64);
                let at = path_segment
                    .curve
                    .at(segment.distance - path_segment.start + ds);
                let acceleration = std::array::from_fn(|i| at.d2[i] * v * v + at.d1[i] * a);
                let jerk = std::array::from_fn(|i| {
                    at.d3[i] * v * v * v + 3.0 * at.d2[i] * v * a + at.d1[i] * segment.jerk
                });
                f(at.q, acceleration, jerk, v, path_segment.feed);
            }
        }
    }

    fn check(&self, moves: &[PathItem<3>], tolerance: f64) -> Result<(), TestCaseError> {
        let mut worst = [0.0_f64; 4];
        let mut near = 0;
        self.sample(16, |q, a, j, v, feed| {
            for i in 0..3 {
                worst[0] = worst[0].max(a[i].abs() / LIMITS.acceleration[i]);
                worst[1] = worst[1].max(j[i].abs() / LIMITS.jerk[i]);
            }
            worst[2] = worst[2].max(v / feed);
            // The next sample is not far from the last one.
            let mut nearest = f64::INFINITY;
            let order = (near..moves.len()).chain((0..near).rev());
            for k in order {
                let far = deviation(&moves[k], &q);
                if far < nearest {
                    (nearest, near) = (far, k);
                }
                if nearest <= tolerance {
                    break;
                }
            }
            worst[3] = worst[3].max(nearest);
        });
        prop_assert!(
            worst[0] <= 1.0 + 1e-6,
            "acceleration {} of its limit",
            worst[0]
        );
        prop_assert!(worst[1] <= 1.0 + 1e-6, "jerk {} of its limit", worst[1]);
        prop_assert!(
            worst[2] <= 1.0 + 1e-9,
            "feed {} of what was programmed",
            worst[2]
        );
        prop_assert!(worst[3] <= tolerance + 1e-9, "{} mm off the path", worst[3]);
        // Continuous, and at rest at both ends.
        for pair in self.segments.windows(2) {
            let ((s0, before), (s1, after)) = (pair[0], pair[1]);
            let (ds, v, a) = before.at(before.duration);
            prop_assert!(
                (v - after.speed).abs() <= 1e-7,
                "speed {v} then {}",
                after.speed
            );
            prop_assert!(
                (a - after.acceleration).abs() <= 1e-5,
                "acceleration {a} then {}",
                after.acceleration
            );
            if s0 == s1 {
                let gap = before.distance + ds - after.distance;
                prop_assert!(gap.abs() <= 1e-8, "{gap} mm between segments");
            }
        }
        Ok(())
    }
}

/// Distance of a point from a move, by brute force and then closer.
fn deviation(item: &PathItem<3>, q: &[f64; 3]) -> f64 {
    let PathItem::Move(motion) = item else {
        return f64::INFINITY;
    };
    let curve = &motion.curve;
    let far = |s: f64| {
        let p = curve.at(s).q;
        (0..3)
            .map(|i| (p[i] - q[i]) * (p[i] - q[i]))
            .sum::<f64>()
            .sqrt()
    };
    let n = if curve.direction().is_some() { 1 } else { 24 };
    let near = (0..=n)
        .map(|k| curve.length() * k as f64 / n as f64)
        .min_by(|a, b| far(*a).total_cmp(&far(*b)))
        .unwrap();
    // A full circle's start is its end.
    [near, curve.length() - near]
        .map(|s| curve.distance_near(q, s))
        .into_iter()
        .fold(f64::INFINITY, f64::min)
}

fn point(size: f64) -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-size..size)
}

/// Connected lines, and now and then an arc.
fn contour() -> impl Strategy<Value = Vec<Curve<3>>> {
    (0.5..100.0_f64)
        .prop_flat_map(|size| {
            prop::collection::vec(
                (point(size), prop::option::weighted(0.3, -1.5..1.5_f64)),
                2..8,
            )
        })
        .prop_map(|points| {
            let mut curves = Vec::new();
            for pair in points.windows(2) {
                let (start, end) = (pair[0].0, pair[1].0);
                let curve = match pair[0].1 {
                    None => Curve::line(start, end),
                    // Centre beside the middle of the chord.
                    Some(bulge) => {
                        let (mx, my) = ((start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0);
                        let centre = (
                            mx - bulge * (end[1] - start[1]),
                            my + bulge * (end[0] - start[0]),
                        );
                        Curve::arc(ArcDefinition {
                            start,
                            end,
                            plane: Plane::Xy,
                            centre,
                            clockwise: bulge < 0.0,
                            turns: 0,
                        })
                    }
                };
                curves.push(curve.unwrap());
            }
            curves
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn contours_keep_limits_and_tolerance(
        curves in contour(), feed in 5.0..800.0_f64, tolerance in prop_oneof![Just(0.001), 0.005..0.5_f64]
    ) {
        let items: Vec<_> = curves.iter().enumerate().map(|(k, c)| go(*c, feed, PathControlMode::Blend(tolerance), k)).collect();
        let plan = Plan::of(&items, curves[0].start());
        plan.check(&items, tolerance)?;
        let (section, last) = plan.segments.last().unwrap();
        let path_segment = plan.sections[*section].last().unwrap();
        let end = path_segment.curve.at(last.distance + last.at(last.duration).0 - path_segment.start).q;
        let programmed = curves.last().unwrap().end();
        for (is, should) in end.iter().zip(programmed) {
            prop_assert!((is - should).abs() < 1e-9);
        }
    }
}

#[test]
fn rounding_a_corner_is_faster_than_stopping_in_it() {
    let square = [
        [0.0, 0.0, 0.0],
        [50.0, 0.0, 0.0],
        [50.0, 50.0, 0.0],
        [0.0, 50.0, 0.0],
        [0.0, 0.0, 0.0],
    ];
    let time = |mode| {
        let items: Vec<_> = square
            .windows(2)
            .map(|p| go(Curve::line(p[0], p[1]).unwrap(), 200.0, mode, 0))
            .collect();
        Plan::of(&items, square[0]).time()
    };
    let times = [
        time(PathControlMode::Stop),
        time(PathControlMode::Exact(0.001)),
        time(PathControlMode::Blend(0.01)),
        time(PathControlMode::Blend(0.1)),
        time(PathControlMode::Blend(1.0)),
    ];
    for pair in times.windows(2) {
        assert!(pair[1] < pair[0], "{times:?}");
    }
}

/// A rapid after a slow move, and before one, round a kink that the tolerance lets take half of them: each
/// side has its own feed, so it takes no longer than with a stop.
#[test]
fn the_feed_changes_in_the_middle_of_a_rounding() {
    let points = [[0.0; 3], [0.002, 50.0, 0.0], [0.0, 100.0, 0.0]];
    let lines = [0, 1].map(|k| Curve::line(points[k], points[k + 1]).unwrap());
    let feeds = [Feed::Rate(1.0), Feed::Rapid];
    for order in [[0, 1], [1, 0]] {
        let time = |mode| {
            let moves = order.map(|k| feeds[k]).into_iter().zip(lines);
            let moves = moves.map(|(feed, curve)| Move {
                curve,
                feed,
                mode,
                tag: 0,
            });
            let items: Vec<_> = moves.map(PathItem::Move).collect();
            let plan = Plan::of(&items, points[0]);
            plan.check(&items, 0.01).unwrap();
            plan.time()
        };
        let (through, stop) = (
            time(PathControlMode::Blend(0.01)),
            time(PathControlMode::Stop),
        );
        assert!(through < stop, "{through} s, {stop} s with a stop");
    }
}

/// Lines and arcs one after another, by chance, and their tolerance.
fn wander(draw: &mut Draw) -> (Vec<PathItem<3>>, f64) {
    let size = draw.log(0.02, 200.0);
    let feed = draw.log(2.0, 800.0);
    let tolerance = if draw.unit() < 0.3 {
        0.001
    } else {
        draw.log(0.003, 1.0)
    };
    let mut here = [0.0; 3];
    let mut items = Vec::new();
    let moves = 3 + (draw.unit() * 12.0) as usize;
    let mut heading = 0.0_f64;
    while items.len() < moves {
        heading += draw.uniform(-3.1, 3.1);
        let length = draw.log(0.02, 2.0) * size;
        let mut end = here;
        end[0] += length * heading.cos();
        end[1] += length * heading.sin();
        if draw.unit() < 0.3 {
            end[2] += draw.uniform(-0.5, 0.5) * length;
        }
        let curve = if draw.unit() < 0.6 {
            Curve::line(here, end)
        } else {
            let bulge = draw.uniform(-1.5, 1.5);
            let centre = (
                0.5 * (here[0] + end[0]) - bulge * (end[1] - here[1]),
                0.5 * (here[1] + end[1]) + bulge * (end[0] - here[0]),
            );
            Curve::arc(ArcDefinition {
                start: here,
                end,
                plane: Plane::Xy,
                centre,
                clockwise: bulge < 0.0,
                turns: 0,
            })
        };
        if let Ok(curve) = curve {
            items.push(go(
                curve,
                feed,
                PathControlMode::Blend(tolerance),
                items.len(),
            ));
            here = end;
        }
    }
    (items, tolerance)
}

/// Programs by chance, every one checked; stops where none was programmed are as good as none.
fn wander_all(seeds: std::ops::Range<u64>) {
    let mut total = syncline_trajectory::path::window::Effort::default();
    let (mut rests, mut sections, mut time) = (0, 0, 0.0);
    for seed in seeds {
        let (items, tolerance) = wander(&mut Draw(seed));
        let plan = Plan::of(&items, [0.0; 3]);
        if let Err(error) = plan.check(&items, tolerance) {
            panic!("program {seed}: {error}");
        }
        let begun = plan
            .segments
            .iter()
            .filter(|(_, p)| p.speed == 0.0 && p.jerk > 0.0);
        rests += begun.count() - plan.sections.len();
        sections += plan.sections.len();
        time += plan.time();
        let effort = plan.effort;
        total.stretches += effort.stretches;
        total.cells += effort.cells;
        total.solves += effort.solves;
        total.steps += effort.steps;
        total.unsolved += effort.unsolved;
    }
    println!("{time} s, {sections} sections, {rests} rests in them, {total:?}");
    assert!(
        rests * 50 <= sections,
        "{rests} rests in {sections} sections"
    );
}

#[test]
fn programs_by_chance_keep_limits_and_tolerance() {
    wander_all(0..6);
}

#[test]
#[ignore = "a campaign of minutes"]
fn many_programs_by_chance_keep_limits_and_tolerance() {
    wander_all(0..400);
}

/// Short segments of about `length` along a spiral from radius `from` by `grow` per turn, coordinates
/// rounded to `digits` of a millimetre; `climb` is the slope of a third axis.
fn short_segments(
    count: usize,
    length: f64,
    (from, grow): (f64, f64),
    climb: f64,
    digits: f64,
) -> Vec<Curve<3>> {
    let (mut angle, mut points) = (0.0_f64, Vec::new());
    for k in 0..=count {
        let radius = from + grow * angle / std::f64::consts::TAU;
        let round = |x: f64| (x / digits).round() * digits;
        let z = climb * length * k as f64;
        points.push([
            round(radius * angle.cos()),
            round(radius * angle.sin()),
            round(z),
        ]);
        angle += length / radius;
    }
    points
        .windows(2)
        .map(|p| Curve::line(p[0], p[1]).unwrap())
        .collect()
}

#[test]
fn short_segments_are_passed_like_the_curve_they_were_made_from() {
    for (spiral, climb, tolerance, feed, slower) in [
        ((5.0, 1.0), 0.0, 0.01, 60.0, 1.1),
        ((5.0, 1.0), 0.1, 0.01, 60.0, 1.1),
        ((20.0, 0.0), 0.0, 0.02, 100.0, 1.1),
        ((8.0, 2.0), 0.0, 0.002, 40.0, 1.6),
    ] {
        let curves = short_segments(600, 0.05, spiral, climb, 1e-3);
        let length: f64 = curves.iter().map(Curve::length).sum();
        let items: Vec<_> = curves
            .iter()
            .enumerate()
            .map(|(k, c)| go(*c, feed, PathControlMode::Blend(tolerance), k))
            .collect();
        let plan = Plan::of(&items, curves[0].start());
        let path_segments: usize = plan.sections.iter().map(Vec::len).sum();
        println!(
            "{path_segments} path segments, {} s for {} s, {:?}",
            plan.time(),
            length / feed,
            plan.effort
        );
        plan.check(&items, tolerance).unwrap();
        assert!(path_segments < 150, "{path_segments} path segments");
        assert!(
            plan.time() < slower * length / feed + 0.1,
            "{} s",
            plan.time()
        );
    }
}

/// Short lines along a curve that bends by chance, with corners, noise and long lines among them,
/// by chance, and the mode.
fn crumbs(draw: &mut Draw) -> (Vec<PathItem<3>>, PathControlMode) {
    let tolerance = draw.log(0.001, 0.1);
    let mode = match draw.uniform(0.0, 3.0) as u32 {
        0 => PathControlMode::Exact(tolerance),
        1 => PathControlMode::Blend(tolerance),
        _ => PathControlMode::Merge {
            tolerance,
            within: draw.log(0.1, 1.0) * tolerance,
        },
    };
    let length = tolerance * draw.log(0.5, 120.0);
    let (noise, straight) = (
        draw.uniform(-0.5, 1.0).max(0.0) * tolerance,
        draw.unit() < 0.2,
    );
    let feed = draw.log(5.0, 300.0);
    let (mut heading, mut bend, mut rise) = (0.0_f64, 0.0, 0.0);
    let mut at = [0.0; 3];
    let mut points = vec![at];
    for _ in 0..20 + (draw.unit() * 300.0) as usize {
        let mut way = length * draw.uniform(0.5, 1.5);
        if !straight {
            bend = 0.98 * bend + draw.uniform(-0.02, 0.02);
            rise = 0.98 * rise + draw.uniform(-0.02, 0.02);
        }
        heading += bend;
        if draw.unit() < 0.01 {
            heading += draw.uniform(-2.0, 2.0);
        }
        if draw.unit() < 0.01 {
            way *= draw.log(10.0, 1000.0);
        }
        at[0] += way * heading.cos();
        at[1] += way * heading.sin();
        at[2] += way * rise;
        let off = || 0.5 * noise;
        let off = [(); 3].map(|()| off() * draw.uniform(-1.0, 1.0));
        points.push(std::array::from_fn(|i| at[i] + off[i]));
    }
    let lines = points
        .windows(2)
        .filter_map(|p| Curve::line(p[0], p[1]).ok());
    let items = lines.zip(0..).map(|(line, k)| go(line, feed, mode, k));
    (items.collect(), mode)
}

/// How far the path stays away from the ends of the moves, which it is to pass in their order.
fn missed(plan: &Plan, items: &[PathItem<3>], enough: f64) -> f64 {
    let path_segments: Vec<_> = plan.sections.iter().flatten().collect();
    let mut first = 0;
    let mut worst = 0.0_f64;
    for item in items {
        let PathItem::Move(motion) = item else {
            continue;
        };
        let end = motion.curve.end();
        let mut nearest = f64::INFINITY;
        for (index, path_segment) in path_segments.iter().enumerate().skip(first) {
            let start = path_segment.curve.start();
            let away = (0..3)
                .map(|i| (end[i] - start[i]).powi(2))
                .sum::<f64>()
                .sqrt();
            // No way of that length leads there.
            if away - path_segment.curve.length() > enough {
                continue;
            }
            for k in 0..=8 {
                let s = path_segment.curve.length() * f64::from(k) / 8.0;
                nearest = nearest.min(path_segment.curve.distance_near(&end, s));
                if nearest <= enough {
                    break;
                }
            }
            if nearest <= enough {
                first = index;
                break;
            }
        }
        worst = worst.max(nearest);
    }
    worst
}

fn crumbs_keep_limits_and_tolerance(seeds: std::ops::Range<u64>) {
    let (mut path_segments, mut moves) = (0, 0);
    for seed in seeds {
        let (items, mode) = crumbs(&mut Draw(seed));
        let plan = Plan::of(&items, [0.0; 3]);
        let tolerance = mode.tolerance();
        if let Err(error) = plan.check(&items, tolerance) {
            panic!("program {seed}, {mode:?}: {error}");
        }
        let missed = missed(&plan, &items, tolerance + 1e-9);
        assert!(
            missed <= tolerance + 1e-9,
            "program {seed} misses a point by {missed} mm"
        );
        let stops: Vec<_> = (items.iter())
            .map(|item| match item {
                PathItem::Move(motion) => PathItem::Move(Move {
                    mode: PathControlMode::Stop,
                    ..*motion
                }),
                dwell => *dwell,
            })
            .collect();
        let patience = Plan::of(&stops, [0.0; 3]).time();
        assert!(
            plan.time() < patience,
            "program {seed}: {} s, {patience} s with stops",
            plan.time()
        );
        path_segments += plan.sections.iter().map(Vec::len).sum::<usize>();
        moves += items.len();
    }
    println!("{moves} moves in {path_segments} path segments");
}

#[test]
fn short_lines_by_chance_keep_limits_and_tolerance() {
    crumbs_keep_limits_and_tolerance(0..12);
}

#[test]
#[ignore = "a campaign of minutes"]
fn many_short_lines_by_chance_keep_limits_and_tolerance() {
    crumbs_keep_limits_and_tolerance(0..200);
}

#[test]
#[ignore = "a measurement"]
fn many_short_segments() {
    let curves = short_segments(150_000, 0.05, (5.0, 1.0), 0.0, 1e-3);
    for mode in [
        PathControlMode::Blend(0.01),
        PathControlMode::Exact(0.001),
        PathControlMode::Stop,
    ] {
        let begin = std::time::Instant::now();
        let items: Vec<_> = curves.iter().map(|c| go(*c, 60.0, mode, 0)).collect();
        let plan = Plan::of(&items, curves[0].start());
        let took = begin.elapsed().as_secs_f64();
        let path_segments: usize = plan.sections.iter().map(Vec::len).sum();
        println!(
            "{mode:?}: {:.0}/s, {path_segments} path segments, {} s for {}, {:?}",
            150_000.0 / took,
            plan.time(),
            7500.0 / 60.0,
            plan.effort
        );
    }
}

#[test]
fn edge_cases_keep_limits_and_tolerance() {
    let line = |a, b| Curve::line(a, b).unwrap();
    let arc = |start: [f64; 3], end: [f64; 3], plane, centre, clockwise| {
        Curve::arc(ArcDefinition {
            start,
            end,
            plane,
            centre,
            clockwise,
            turns: 0,
        })
        .unwrap()
    };
    let mut programs: Vec<(Vec<Curve<3>>, f64)> = Vec::new();
    // Corners of every angle, the last one a reversal; their second item short.
    for k in 1..=12 {
        let angle = f64::from(k) * 15.0_f64.to_radians();
        let corner = [20.0, 0.0, 0.0];
        let end = [20.0 + 3.0 * angle.cos(), 3.0 * angle.sin(), 0.0];
        programs.push((vec![line([0.0; 3], corner), line(corner, end)], 0.05));
    }
    // Full circles of every size, with a tangent line before; the largest only in part.
    for radius in [0.005, 0.1, 2.0, 40.0] {
        let start = [10.0, 0.0, 0.0];
        let circle = arc(start, start, Plane::Xy, (10.0, radius), false);
        programs.push((vec![line([0.0; 3], start), circle], 0.002));
    }
    let far = 5_000.0;
    let on = |a: f64| [far * a.sin(), far - far * a.cos(), 0.0];
    programs.push((
        vec![arc(on(0.0), on(0.02), Plane::Xy, (0.0, far), false)],
        0.01,
    ));
    // S-bends; a joint that is nearly tangent; mixed planes.
    let (a, b, c) = ([0.0; 3], [20.0, 0.0, 0.0], [40.0, 0.0, 0.0]);
    let bend = [
        arc(a, b, Plane::Xy, (10.0, 0.0), true),
        arc(b, c, Plane::Xy, (30.0, 0.0), false),
    ];
    programs.push((bend.to_vec(), 0.02));
    let off = arc(
        [20.0, 1e-3, 0.0],
        [30.0, 10.0, 0.0],
        Plane::Xy,
        (20.0, 10.0),
        false,
    );
    programs.push((vec![line(a, [20.0, 1e-3, 0.0]), off], 0.01));
    let up = arc(b, [20.0, 5.0, 5.0], Plane::Yz, (0.0, 5.0), true);
    let over = arc(
        [20.0, 5.0, 5.0],
        [25.0, 5.0, 10.0],
        Plane::Zx,
        (10.0, 20.0),
        false,
    );
    programs.push((vec![line(a, b), up, over], 0.05));
    // Three joints that want the same short line.
    let points = [a, b, [20.0, 0.2, 0.0], [0.0, 0.2, 0.0], [0.0, 0.2, 9.0]];
    programs.push((points.windows(2).map(|p| line(p[0], p[1])).collect(), 0.5));
    for (number, (curves, tolerance)) in programs.iter().enumerate() {
        for mode in [
            PathControlMode::Stop,
            PathControlMode::Exact(0.001),
            PathControlMode::Blend(*tolerance),
        ] {
            let items: Vec<_> = curves.iter().map(|c| go(*c, 150.0, mode, number)).collect();
            let plan = Plan::of(&items, curves[0].start());
            let within = mode.tolerance();
            if let Err(error) = plan.check(&items, within) {
                panic!("program {number}, {mode:?}: {error}");
            }
        }
    }
}

/// The third-order optimum of this helix by a linear program over 1,001 points is 1.4317 s.
#[test]
fn a_helix_is_passed_in_little_more_than_the_least_time() {
    let helix = Curve::arc(ArcDefinition {
        start: [15.0, 0.0, 0.0],
        end: [15.0, 0.0, -12.0],
        plane: Plane::Xy,
        centre: (0.0, 0.0),
        clockwise: false,
        turns: 2,
    });
    let items = [go(helix.unwrap(), 400.0, PathControlMode::Exact(0.001), 0)];
    let plan = Plan::of(&items, [15.0, 0.0, 0.0]);
    println!("{:?}", plan.effort);
    plan.check(&items, 1e-6).unwrap();
    assert!(plan.time() < 1.01 * 1.4317, "{} s", plan.time());
}

#[test]
fn a_move_of_nearly_no_length_takes_nearly_no_time() {
    // In these places rounding leaves the closed form with a speed of -1e-19.
    let mut here = [400.0, 400.0, -150.0];
    for tiny in [1e-6, 1e-5, 1e-4] {
        for by in [[10.0, 5.0, 0.0], [tiny, 0.0, 0.0], [0.0, tiny, 0.0]] {
            let to: [f64; 3] = std::array::from_fn(|i| ((here[i] + by[i]) * 1e6_f64).round() / 1e6);
            let line = Curve::line(here, to).unwrap();
            let plan = Plan::of(&[go(line, 200.0, PathControlMode::Stop, 0)], here);
            let time = plan.time();
            assert!(
                time < 0.01 + 0.02 * line.length(),
                "{} mm in {time} s",
                line.length()
            );
            here = to;
        }
    }
}

#[test]
fn a_bridged_joint_takes_no_longer_than_a_stop_in_it() {
    for turn in [
        0.5_f64, 3.0, 10.0, 45.0, 90.0, 120.0, 140.0, 150.0, 158.0, 160.0,
    ] {
        for before in [1e-3, 0.05, 1.0, 10.0] {
            for after in [1e-3, 0.05, 1.0, 10.0] {
                let (sin, cos) = turn.to_radians().sin_cos();
                let points = [
                    [0.0; 3],
                    [before, 0.0, 0.0],
                    [before + after * cos, after * sin, 0.0],
                ];
                let time = |mode| {
                    let items: Vec<_> = points
                        .windows(2)
                        .map(|p| go(Curve::line(p[0], p[1]).unwrap(), 200.0, mode, 0))
                        .collect();
                    Plan::of(&items, points[0]).time()
                };
                let (through, stop) = (
                    time(PathControlMode::Exact(0.001)),
                    time(PathControlMode::Stop),
                );
                assert!(
                    through <= stop,
                    "{turn}°, {before} and {after} mm: {through} s, {stop} s with a stop"
                );
            }
        }
    }
}

/// Short segments too long for arcs: every joint is a blend of micrometres, and the certificate has the
/// speed profile mended in nearly every window.
#[test]
fn laws_are_found_along_joints_of_micrometres() {
    let mut angle: f64 = 20.0;
    let points: Vec<_> = (0..150)
        .map(|_| {
            let radius = 5.0 + angle / std::f64::consts::PI;
            angle += 0.5 / radius;
            let (sin, cos) = angle.sin_cos();
            let wave = 0.5 * (7.0 * angle).sin();
            [radius * cos, radius * sin, wave].map(|x| (x * 1e6).round() / 1e6)
        })
        .collect();
    let items: Vec<_> = (points.windows(2))
        .map(|p| {
            let line = Curve::line(p[0], p[1]).unwrap();
            go(line, 100.0, PathControlMode::Exact(0.001), 0)
        })
        .collect();
    let plan = Plan::of(&items, points[0]);
    println!("{} s, {:?}", plan.time(), plan.effort);
    plan.check(&items, 0.001).unwrap();
    assert_eq!(plan.effort.unsolved, 0);
}

/// Accelerations that take minutes beside jerks that take none: rounded corners are laid in so many cells and
/// no more.
#[test]
fn limits_that_differ_by_far_take_no_more_cells() {
    let slow = Limits {
        velocity: [400.0; 3],
        acceleration: [0.01; 3],
        jerk: [60_000.0; 3],
    };
    let corners = [
        [0.0; 3],
        [40.0, 5.0, 0.0],
        [40.0, 0.0, 30.0],
        [90.0, 0.0, 30.0],
    ];
    let mut planner = Planner::new(slow, corners[0]);
    for ends in corners.windows(2) {
        let line = Curve::line(ends[0], ends[1]).unwrap();
        planner
            .push(go(line, 60.0, PathControlMode::Blend(0.02), 1))
            .unwrap();
    }
    planner.finish();
    let commands = std::iter::from_fn(|| planner.pop()).take(100_000);
    let segments = commands.filter(|command| matches!(command, Command::JerkSegment(_)));
    assert!((100..100_000).contains(&segments.count()));
}
