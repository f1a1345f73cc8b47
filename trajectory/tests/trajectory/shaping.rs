//! What input shaping leaves of a vibration, and that nothing which an operator or a fault does to a shaped motion
//! breaks a limit.

use crate::common::{LIMITS, contour};
use crate::machine::Machine;
use proptest::prelude::*;
use std::f64::consts::TAU;
use syncline_trajectory::limits::{Limits as AxisLimits, PositionLimits};
use syncline_trajectory::path::Plane;
use syncline_trajectory::path::curve::ArcDefinition;
use syncline_trajectory::path::{
    Command, Curve, Executor, Feed, Limits, Move, Overrides, PathControlMode, PathItem, Planner,
    Setpoint, Shaping, Travel,
};
use syncline_trajectory::shaper::{Kind, Method, Shaper, Vibration};

pub(crate) const PERIOD: f64 = 0.002;

const KINDS: [Kind; 4] = [Kind::Zv, Kind::Zvd, Kind::Ei, Kind::TwoHumpEi];

/// Amplitude of a vibration, mm, that is carried along by these positions, at their end: exact for what is linear
/// between them.
pub(crate) fn left(positions: &[f64], of: Vibration) -> f64 {
    let (natural, damping) = (TAU * of.frequency, of.damping);
    let turning = natural * (1.0 - damping * damping).sqrt();
    let decay = (-damping * natural * PERIOD).exp();
    let (sin, cos) = (turning * PERIOD).sin_cos();
    // What is ahead of the setpoint, and its rate: relative to following a ramp evenly, which lags by 2ζ/ω of its speed.
    let (mut away, mut rate, mut speed) = (0.0_f64, 0.0_f64, 0.0);
    for pair in positions.windows(2) {
        let slope = (pair[1] - pair[0]) / PERIOD;
        away += 2.0 * damping / natural * (slope - speed);
        rate -= slope - speed;
        speed = slope;
        let quadrature = (rate + damping * natural * away) / turning;
        let turned = decay * (cos * away + sin * quadrature);
        let quadrature = decay * (cos * quadrature - sin * away);
        rate = turning * quadrature - damping * natural * turned;
        away = turned;
    }
    away -= 2.0 * damping / natural * speed;
    rate += speed;
    away.hypot((rate + damping * natural * away) / turning)
}

/// The first coordinate of a straight move over that length, unshaped, and by each shaper; each to its own end.
fn moved(length: f64, shapers: &[Shaper], method: Method) -> (Vec<f64>, Vec<Vec<f64>>) {
    let limits = Limits {
        velocity: [500.0; 3],
        acceleration: [3_000.0; 3],
        jerk: [60_000.0; 3],
    };
    let items = [PathItem::Move(Move {
        curve: Curve::line([0.0; 3], [length, 0.0, 0.0]).unwrap(),
        feed: Feed::Rapid,
        mode: PathControlMode::Stop,
        tag: 0,
    })];
    let machine = Machine::new(limits, &items, [0.0; 3], PERIOD);
    let mut unshaped = vec![machine.executor.setpoint()];
    let mut alone = machine.clone();
    while let Some(setpoint) = alone.advance() {
        unshaped.push(setpoint);
    }
    let shaped = shapers.iter().map(|shaper| {
        let mut machine = machine.clone();
        machine.shape_by(shaper.spread(PERIOD).unwrap(), Some(method), EXACT);
        let mut shaping = Shaping::new(shaper, PERIOD, unshaped[0]);
        let mut shaped = vec![0.0];
        while shaped.len() < unshaped.len() || !shaping.is_settled() {
            let planned = machine.advance();
            let planned = planned.unwrap_or_else(|| machine.executor.advance());
            let setpoint = shaping.shape(planned, &machine.executor);
            shaped.push(setpoint.position[0]);
        }
        assert_eq!(shaped.last(), Some(&length));
        let longer = (shaped.len() - unshaped.len()) as f64 * PERIOD;
        assert!((longer - shaper.duration()).abs() <= PERIOD, "{longer}");
        shaped
    });
    let shaped = shaped.collect();
    (unshaped.iter().map(|it| it.position[0]).collect(), shaped)
}

/// 60 lengths of moves, a mode of 8 Hz with a damping ratio of 2 %, and such that are off by up to as much as each kind
/// is for: what is left at the end of the shaped move, as a part of what an unshaped one leaves at its own.
#[test]
fn moves_of_sixty_lengths_leave_of_a_vibration_what_theory_says() {
    let made_for = Vibration {
        frequency: 8.0,
        damping: 0.02,
    };
    let kinds = [
        (Kind::Zv, 0.03),
        (Kind::Zvd, 0.14),
        (Kind::Ei, 0.19),
        (Kind::TwoHumpEi, 0.34),
    ];
    let shapers = kinds.map(|(kind, _)| Shaper::new(kind, &[made_for]));
    let mut worst = [(0.0_f64, 0.0_f64); 4];
    let each = (0..60).flat_map(|step| [Method::Clock, Method::Coordinates].map(|it| (step, it)));
    for (step, method) in each {
        let length = 0.5 * 1000.0_f64.powf(f64::from(step) / 59.0);
        let (unshaped, shaped) = moved(length, &shapers, method);
        for (at, (kind, off)) in kinds.into_iter().enumerate() {
            for part in [-1.0, -0.5, 0.0, 0.5, 1.0] {
                let vibration = Vibration {
                    frequency: 8.0 * (1.0 + part * off),
                    ..made_for
                };
                let (before, after) = (left(&unshaped, vibration), left(&shaped[at], vibration));
                let (ratio, theory) = (after / before, shapers[at].residual(&vibration));
                if before < 1e-3 {
                    assert!(after <= 1e-4, "{kind:?} {length} mm {part}: {after} mm");
                    continue;
                }
                assert!(
                    (ratio - theory).abs() <= 0.005,
                    "{kind:?} {length} mm {part}: {ratio} {theory}"
                );
                assert!(ratio <= 0.05, "{kind:?} {length} mm {part}: {ratio}");
                let (most, away) = &mut worst[at];
                *most = most.max(ratio);
                *away = away.max((ratio - theory).abs());
            }
        }
    }
    for ((kind, off), (most, away)) in kinds.iter().zip(worst) {
        println!(
            "| {kind:?} | ±{off} | {:.2} % | {:.3} points |",
            100.0 * most,
            100.0 * away
        );
    }
}

/// What is done to a shaped motion.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Act {
    Hold,
    Resume,
    Override(f64),
    Retrace,
}

fn act() -> impl Strategy<Value = (u32, Act)> {
    let act = prop_oneof![
        1 => Just(Act::Hold),
        2 => Just(Act::Resume),
        2 => (0.1..2.0_f64).prop_map(Act::Override),
        1 => Just(Act::Retrace),
    ];
    (0..150_u32, act)
}

fn shaper() -> impl Strategy<Value = Shaper> {
    let mode = (4.0..50.0_f64, 0.0..0.2_f64);
    let modes = prop::collection::vec(mode, 1..3);
    (prop::sample::select(KINDS.to_vec()), modes).prop_map(|(kind, modes)| {
        let modes = modes.into_iter();
        let modes: Vec<_> = modes
            .map(|(frequency, damping)| Vibration { frequency, damping })
            .collect();
        Shaper::new(kind, &modes)
    })
}

fn mode() -> impl Strategy<Value = PathControlMode> {
    prop_oneof![
        Just(PathControlMode::Stop),
        Just(PathControlMode::Exact(0.001)),
        (0.01..1.0_f64).prop_map(PathControlMode::Blend),
    ]
}

/// By how much a shaper may leave what ends at rest, mm.
pub(crate) const EXACT: f64 = 0.005;

fn tolerated() -> impl Strategy<Value = PathControlMode> {
    prop_oneof![
        Just(PathControlMode::Stop),
        Just(PathControlMode::Exact(0.01)),
        Just(PathControlMode::Blend(0.0)),
        (0.01..1.0_f64).prop_map(PathControlMode::Blend),
    ]
}

/// Every setpoint, and the differences of the positions, inside the limits, but for those parts of them.
fn check(setpoints: &[Setpoint<3>], rounding: [f64; 3]) -> Result<(), TestCaseError> {
    for axis in 0..3 {
        let limits = [LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk].map(|of| of[axis]);
        for now in setpoints {
            let rates = [now.velocity, now.acceleration, now.jerk].map(|of| of[axis]);
            for ((rate, limit), part) in rates.into_iter().zip(limits).zip(rounding) {
                prop_assert!(
                    rate.abs() <= limit * (1.0 + part),
                    "axis {axis}: {rate} {limit}"
                );
            }
        }
        let mut differences: Vec<f64> = setpoints.iter().map(|it| it.position[axis]).collect();
        // A position's rounding, through three differences.
        let mut noise = 1e-12;
        for (limit, part) in limits.into_iter().zip(rounding) {
            noise *= 2.0 / PERIOD;
            differences = (differences.windows(2))
                .map(|pair| (pair[1] - pair[0]) / PERIOD)
                .collect();
            for difference in &differences {
                prop_assert!(
                    difference.abs() <= limit * (1.0 + part) + noise,
                    "axis {axis}: {difference} {limit}"
                );
            }
        }
    }
    Ok(())
}

/// Who does one thing after the other, each so many cycles behind the one before, and resumes in the end what is held.
struct Operator<'a> {
    acts: &'a [(u32, Act)],
    waited: u32,
}

impl Operator<'_> {
    /// What is done in this cycle.
    fn act(&mut self, executor: &mut Executor<3>) {
        self.waited += 1;
        match *self.acts {
            [(wait, act), ref later @ ..] if self.waited > wait => {
                match act {
                    Act::Hold => executor.feed_hold(),
                    Act::Resume => executor.resume(),
                    Act::Override(feed) => {
                        executor.set_overrides(Overrides { feed, rapid: 1.0 });
                    }
                    Act::Retrace => executor.retrace(),
                }
                (self.acts, self.waited) = (later, 0);
            }
            [] if executor.is_held() && self.waited > 200 => {
                executor.resume();
                self.waited = 0;
            }
            _ => {}
        }
    }
}

/// Goes along a path through a shaper, whatever an operator does; a stop past it begins at that setpoint. By the clock it stays
/// on the path; by each mode's method every other move is exact.
pub(crate) fn stays_inside(
    curves: &[Curve<3>],
    mode: PathControlMode,
    feed: f64,
    (shaper, method): (&Shaper, Option<Method>),
    acts: &[(u32, Act)],
    stopped: Option<usize>,
) -> Result<(), TestCaseError> {
    let items: Vec<_> = curves
        .iter()
        .zip(0..)
        .map(|(&curve, tag)| {
            PathItem::Move(Move {
                curve,
                feed: Feed::Rate(feed),
                mode: match method {
                    None if tag % 2 == 1 => PathControlMode::Exact(0.01),
                    _ => mode,
                },
                tag,
            })
        })
        .collect();
    let start = curves[0].start();
    let mut machine = Machine::new(LIMITS, &items, start, PERIOD);
    if method != Some(Method::Coordinates) {
        machine.shape_by(shaper.spread(PERIOD).unwrap(), method, EXACT);
    }
    let mut shaping = Shaping::new(shaper, PERIOD, machine.executor.setpoint());
    let mut setpoints = vec![machine.executor.setpoint()];
    let mut operator = Operator { acts, waited: 0 };
    loop {
        let planned = match machine.advance() {
            Some(planned) => planned,
            None if shaping.is_settled() => break,
            None => machine.executor.advance(),
        };
        let shaped = shaping.shape(planned, &machine.executor);
        setpoints.push(shaped);
        if method == Some(Method::Clock) && setpoints.len() % 5 == 0 {
            let about = |tag: u32| tag.abs_diff(shaped.tag) <= 1;
            let near = machine.path.iter().filter(|(tag, _)| about(*tag));
            let near: Vec<_> = near.map(|(_, curve)| *curve).collect();
            let all: Vec<_> = machine.path.iter().map(|(_, curve)| *curve).collect();
            let away = off(&near, &shaped.position);
            let away = if away > 1e-9 {
                off(&all, &shaped.position)
            } else {
                away
            };
            prop_assert!(
                away <= 1e-9 || machine.path.is_empty(),
                "{away} mm off the path"
            );
        }
        if Some(setpoints.len()) == stopped {
            break;
        }
        operator.act(&mut machine.executor);
    }
    let last = *setpoints.last().unwrap();
    if stopped.is_some() && !shaping.is_settled() {
        let travel = std::array::from_fn(|axis| {
            let of = [LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk].map(|of| of[axis]);
            let limits = AxisLimits::symmetric(of[0], of[1], of[2]);
            Some(Travel {
                limits,
                bounds: PositionLimits {
                    min: -1e3,
                    max: 1e3,
                },
            })
        });
        machine.executor.stop_beside(&last, &travel);
        shaping.bypass();
        let begun = setpoints.len();
        while !machine.executor.is_idle() {
            let planned = machine.executor.advance();
            setpoints.push(shaping.shape(planned, &machine.executor));
            prop_assert!(setpoints.len() < begun + 5_000, "never rests");
        }
        let [v, a, j] = [500.0, 2_000.0, 40_000.0];
        let longest = v / a + 3.0 * a / j;
        prop_assert!(
            ((setpoints.len() - begun) as f64) * PERIOD <= longest,
            "{}",
            setpoints.len() - begun
        );
    }
    let last = setpoints.last().unwrap();
    prop_assert_eq!((last.velocity, last.acceleration), ([0.0; 3], [0.0; 3]));
    let rounding = match method {
        Some(Method::Coordinates) => [1e-9; 3],
        _ => [1e-6, 1e-6, 1e-3],
    };
    check(&setpoints, rounding)
}

/// No stop of one axis lasts just as long as the lead's: the next longer one lasted twice that.
#[test]
fn a_stop_that_cannot_last_as_long_as_the_leads_is_the_fastest() {
    let corner = [-11.88858216644726, -12.634023081141313, -10.679713611729904];
    let next = [0.0, 12.58691281213092, -8.997750649415686];
    let arc = Curve::arc(ArcDefinition {
        start: [4.008498594567782, 11.49063845831519, 9.93653526118502],
        end: corner,
        plane: Plane::Xy,
        centre: (-39.4644896486363, 22.837341458454212),
        clockwise: true,
        turns: 0,
    });
    let lines = [(corner, next), (next, [0.0; 3])].map(|(from, to)| Curve::line(from, to).unwrap());
    let curves = [arc.unwrap(), lines[0], lines[1]];
    let modes = [
        (40.668364270149404, 0.1913620604686285),
        (11.124373489128192, 0.18005269911757024),
    ];
    let modes = modes.map(|(frequency, damping)| Vibration { frequency, damping });
    let shaper = Shaper::new(Kind::Zvd, &modes);
    let mode = PathControlMode::Blend(0.3949298986028653);
    let by = (&shaper, Some(Method::Coordinates));
    stays_inside(&curves, mode, 196.8929797009274, by, &[], Some(151)).unwrap();
}

/// How far a point is from the nearest of these curves, mm.
fn off(curves: &[Curve<3>], point: &[f64; 3]) -> f64 {
    let starts = |curve: &Curve<3>| {
        let part = match curve.direction() {
            Some(_) => 1,
            None => 16,
        };
        let length = curve.length();
        (0..=part).map(move |n| length * f64::from(n) / f64::from(part))
    };
    let each = curves
        .iter()
        .flat_map(|curve| starts(curve).map(|near| curve.distance_near(point, near)));
    each.fold(f64::INFINITY, f64::min)
}

/// How far apart two places are, mm.
fn apart(one: &[f64; 3], other: &[f64; 3]) -> f64 {
    let squares = one.iter().zip(other).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}

/// Goes along a path that is planned for a shaper behind it, whatever an operator does: the greatest distance of a shaped
/// setpoint from the curves about it, of a joint from the shaped path, and how long it takes, s.
fn strays(
    curves: &[Curve<3>],
    (mode, exact): (PathControlMode, f64),
    feed: f64,
    shaper: &Shaper,
    acts: &[(u32, Act)],
) -> (f64, f64, f64) {
    let item = |(tag, &curve): (usize, &Curve<3>)| {
        PathItem::Move(Move {
            curve,
            feed: Feed::Rate(feed),
            mode,
            tag: tag as u32,
        })
    };
    let items: Vec<_> = curves.iter().enumerate().map(item).collect();
    let mut machine = Machine::new(LIMITS, &items, curves[0].start(), PERIOD);
    machine.shape_by(
        shaper.spread(PERIOD).unwrap(),
        Some(Method::Coordinates),
        exact,
    );
    let mut shaping = Shaping::new(shaper, PERIOD, machine.executor.setpoint());
    let mut operator = Operator { acts, waited: 0 };
    let mut cycles = 0;
    let mut most = 0.0_f64;
    let mut nearest = vec![f64::INFINITY; curves.len() - 1];
    let mut tags = std::collections::VecDeque::new();
    let length = (shaper.duration() / PERIOD) as usize + 2;
    loop {
        let planned = match machine.advance() {
            Some(planned) => planned,
            None if shaping.is_settled() => break,
            None => machine.executor.advance(),
        };
        let shaped = shaping.shape(planned, &machine.executor).position;
        tags.push_back(planned.tag as usize);
        if tags.len() > length {
            tags.pop_front();
        }
        let (first, last) = (tags.iter().min().unwrap(), tags.iter().max().unwrap());
        let about = first.saturating_sub(1)..(last + 2).min(curves.len());
        most = most.max(off(&curves[about], &shaped));
        for (nearest, curve) in nearest.iter_mut().zip(curves) {
            *nearest = nearest.min(apart(&curve.end(), &shaped) - planned.speed * PERIOD);
        }
        operator.act(&mut machine.executor);
        cycles += 1;
    }
    let missed = nearest.into_iter().fold(0.0, f64::max);
    (most, missed, f64::from(cycles) * PERIOD)
}

/// Arcs that follow one another with the least and the greatest radius by turns, as the curves do that short lines become: none is
/// cut into more than a few parts, however many there are.
#[test]
fn curves_are_cut_into_a_few_parts_however_many_there_are() {
    let shaper = Shaper::new(
        Kind::Zvd,
        &[Vibration {
            frequency: 8.0,
            damping: 0.02,
        }],
    );
    for (radii, length) in [
        ([10.0, 10.0], 2.0),
        ([8.0, 12.0], 2.0),
        ([3.0, 50.0], 5.0),
        ([20.0, 21.0], 0.3),
    ] {
        for (count, method) in [20, 80, 320]
            .into_iter()
            .flat_map(|count| [Method::Clock, Method::Coordinates].map(|it| (count, it)))
        {
            let mut planner = Planner::new(LIMITS, [0.0; 3]);
            planner.shape_by(shaper.spread(PERIOD).unwrap(), Some(method), EXACT);
            let (mut heading, mut at) = (0.0_f64, [0.0; 3]);
            let mut parts = 0;
            let mut drain = |planner: &mut Planner<3>| {
                while let Some(command) = planner.pop() {
                    parts += usize::from(matches!(command, Command::PathSegment(_)));
                }
            };
            for tag in 0..count {
                let share = f64::from(tag % 16) / 15.0;
                let radius = radii[0] + share * (radii[1] - radii[0]);
                let centre = (
                    at[0] - radius * heading.sin(),
                    at[1] + radius * heading.cos(),
                );
                heading += length / radius;
                let end = [
                    centre.0 + radius * heading.sin(),
                    centre.1 - radius * heading.cos(),
                    0.0,
                ];
                let curve = Curve::arc(ArcDefinition {
                    start: at,
                    end,
                    plane: Plane::Xy,
                    centre,
                    clockwise: false,
                    turns: 0,
                })
                .unwrap();
                at = end;
                let motion = Move {
                    curve,
                    feed: Feed::Rate(50.0),
                    mode: PathControlMode::Blend(0.05),
                    tag,
                };
                planner.push(PathItem::Move(motion)).unwrap();
                drain(&mut planner);
            }
            planner.finish();
            drain(&mut planner);
            let each = parts as f64 / f64::from(count);
            println!("{radii:?} {length} mm, {count} arcs, {method:?}: {each:.2} parts each");
            assert!(each < 5.0, "{parts} parts of {count} arcs");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(24) })]

    /// Any path that is planned for a shaper stays within its tolerance, with what is rounded off, whatever an operator does.
    #[test]
    fn a_shaped_path_keeps_within_its_tolerance(
        curves in contour(0.5..30.0),
        mode in tolerated(),
        feed in 10.0..400.0_f64,
        shaper in shaper(),
        acts in prop::collection::vec(act(), 0..5),
    ) {
        let tolerance = mode.rounding().filter(|it| *it > 0.0).unwrap_or(EXACT);
        let (off, missed, _) = strays(&curves, (mode, EXACT), feed, &shaper, &acts);
        prop_assert!(off <= tolerance * (1.0 + 1e-6) + 1e-9, "{off} of {tolerance} mm");
        prop_assert!(missed <= tolerance * (1.0 + 1e-6) + 1e-9, "{missed} of {tolerance} mm");
    }
}

/// A fast line into arcs and out of them, and corners: as far off as the tolerance at most, and not much less where that is what
/// bounds the speed.
#[test]
fn a_fast_line_into_a_tight_arc_is_slowed_before_it() {
    let shaper = Shaper::new(
        Kind::Zvd,
        &[Vibration {
            frequency: 8.0,
            damping: 0.02,
        }],
    );
    for radius in [2.0, 20.0] {
        let arc = |start: [f64; 3], end: [f64; 3], centre| {
            let plane = Plane::Xy;
            Curve::arc(ArcDefinition {
                start,
                end,
                plane,
                centre,
                clockwise: false,
                turns: 0,
            })
            .unwrap()
        };
        let turned = [60.0 + radius, radius, 0.0];
        let curves = [
            Curve::line([0.0; 3], [60.0, 0.0, 0.0]).unwrap(),
            arc([60.0, 0.0, 0.0], turned, (60.0, radius)),
            Curve::line(turned, [60.0 + radius, radius + 60.0, 0.0]).unwrap(),
        ];
        for tolerance in [0.01, 0.1] {
            let mode = PathControlMode::Blend(tolerance);
            let (off, _, seconds) = strays(&curves, (mode, EXACT), 200.0, &shaper, &[]);
            println!("| {radius} | {tolerance} | {off:.5} | {seconds:.2} |");
            assert!(
                off <= tolerance && off >= 0.3 * tolerance,
                "{radius} {tolerance}: {off}"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(32) })]

    /// Any path, any shaper, whatever an operator does, and a stop past the shaper from any of its states.
    #[test]
    fn shaped_motions_keep_every_limit_whatever_happens(
        curves in contour(0.5..30.0),
        mode in mode(),
        feed in 10.0..400.0_f64,
        shaper in shaper(),
        acts in prop::collection::vec(act(), 0..5),
        stopped in prop::option::of(1..600_usize),
        method in prop::sample::select(vec![Some(Method::Clock), Some(Method::Coordinates), None]),
    ) {
        stays_inside(&curves, mode, feed, (&shaper, method), &acts, stopped)?;
    }

    /// A straight line stays straight, and a stop from the middle of it nearly so.
    #[test]
    fn a_stop_from_a_straight_move_stays_near_its_line(
        end in prop::array::uniform3(20.0..200.0_f64),
        feed in 20.0..300.0_f64,
        shaper in shaper(),
        stopped in 1..400_usize,
        method in prop::sample::select(vec![Method::Clock, Method::Coordinates]),
    ) {
        let items = [PathItem::Move(Move {
            curve: Curve::line([0.0; 3], end).unwrap(),
            feed: Feed::Rate(feed),
            mode: PathControlMode::Stop,
            tag: 0,
        })];
        let mut machine = Machine::new(LIMITS, &items, [0.0; 3], PERIOD);
        machine.shape_by(shaper.spread(PERIOD).unwrap(), Some(method), EXACT);
        let mut shaping = Shaping::new(&shaper, PERIOD, machine.executor.setpoint());
        let length = end.iter().map(|x| x * x).sum::<f64>().sqrt();
        let off = |at: &[f64; 3]| {
            let along = at.iter().zip(end).map(|(x, e)| x * e).sum::<f64>() / length;
            let across = (0..3).map(|axis| at[axis] - along * end[axis] / length);
            across.map(|x| x * x).sum::<f64>().sqrt()
        };
        let mut last = machine.executor.setpoint();
        for _ in 0..stopped {
            let planned = machine.advance().unwrap_or_else(|| machine.executor.advance());
            last = shaping.shape(planned, &machine.executor);
            prop_assert!(off(&last.position) <= 1e-10, "{}", off(&last.position));
        }
        if shaping.is_settled() {
            return Ok(());
        }
        let travel = std::array::from_fn(|axis| {
            let of = [LIMITS.velocity, LIMITS.acceleration, LIMITS.jerk].map(|of| of[axis]);
            let limits = AxisLimits::symmetric(of[0], of[1], of[2]);
            Some(Travel { limits, bounds: PositionLimits { min: -1e3, max: 1e3 } })
        });
        machine.executor.stop_beside(&last, &travel);
        let from = last.position;
        while !machine.executor.is_idle() {
            last = machine.executor.advance();
        }
        let way = (0..3).map(|axis| last.position[axis] - from[axis]);
        let way = way.map(|x| x * x).sum::<f64>().sqrt();
        prop_assert!(off(&last.position) <= 0.2 * way + 1e-9, "{} of {way}", off(&last.position));
    }
}

/// A section that waits for the axes is planned anew: it begins from rest, however little the speed is that rounding leaves of the
/// motion before.
#[test]
fn a_new_plan_waits_for_the_axes_as_the_old_one_did() {
    let places = [
        [0.0, 0.0, -0.2971068606248578],
        [0.0, 0.0, 0.052045677419308836],
        [0.0, 0.05043950180925821, -0.19756891061223728],
        [
            -0.024010238648859702,
            -0.30941885098551025,
            0.03632837152086332,
        ],
        [0.0, 0.0, 0.0],
    ];
    let lines = places
        .windows(2)
        .map(|it| Curve::line(it[0], it[1]).unwrap());
    let vibration = Vibration {
        frequency: 26.0,
        damping: 0.1,
    };
    let shaper = Shaper::new(Kind::Zvd, &[vibration]);
    let (by, acts) = ((&shaper, Some(Method::Clock)), [(130, Act::Override(0.1))]);
    let curves: Vec<_> = lines.collect();
    let feed = 232.87158186928312;
    stays_inside(&curves, PathControlMode::Stop, feed, by, &acts, None).unwrap();
}
