//! Whatever is planned within the limits that compensation leaves: what is sent keeps those of the machine file.

use super::*;
use crate::machine::{Axis, AxisLimits, Machine};
use proptest::prelude::*;
use std::path::Path;
use syncline_drives::model::{Direction, Scaling};
use syncline_trajectory::limits::Limits;

const XYZ: &str = include_str!("../../../../../examples/xyz/machine.toml");

/// Limits of X, which has 400 mm/s, 2500 mm/s² and 50,000 mm/s³.
const STATED: &str = "soft_limits = [-250.0, 250.0]\n";
const PERIOD: f64 = 0.004;
const RESOLUTION: f64 = 1e-4;

/// X with that backlash, mm, and lead error, mm and µm; `None` if it is refused.
fn axis(backlash: f64, points: &[(f64, f64)]) -> Option<Axis> {
    let points: Vec<_> = points
        .iter()
        .map(|(at, it)| format!("[{at:.3}, {it:.3}]"))
        .collect();
    let mut keys = String::new();
    if backlash > 0.0 {
        keys += &format!("backlash = {backlash}\n");
    }
    if !points.is_empty() {
        keys += &format!("lead_error = [{}]\n", points.join(", "));
    }
    let text = XYZ.replacen(STATED, &(STATED.to_owned() + &keys), 1);
    let machine = Machine::parse(Path::new("machine.toml"), &text).ok()?;
    machine.axes.into_iter().find(|axis| axis.name() == "X")
}

fn compensation(axis: &Axis, placed: bool) -> Compensation {
    let of = axis.compensation.as_ref().expect("one of its keys");
    let mut compensation = Compensation::new(of, RESOLUTION);
    compensation.place(placed);
    compensation
}

/// Its carriage came to the limit on the flank that pushed it there, and its drive is beyond by half of the backlash.
#[test]
fn it_is_found_inside_its_soft_limits_where_its_flank_may_be() {
    let axis = axis(0.1, &[(-250.0, 0.0), (0.0, 8.0), (250.0, 20.0)]).expect("an axis");
    let limits = axis.limits.position;
    let mut found = compensation(&axis, true);
    for (place, direction) in [(limits.0, -1.0), (limits.1, 1.0)] {
        let sent = |part: f64| place - found.error(place).0 + direction * part * 0.05;
        let [flank, between, beyond] = [1.0, 0.4, 1.5].map(sent);
        for told in [flank, between] {
            found.find_inside(told, limits);
            assert!((found.uncorrected(told) - place).abs() < 1e-9, "{told}");
            assert!((place + found.at(place) - told).abs() < 1e-9, "{told}");
        }
        // No flank explains the rest.
        found.find_inside(beyond, limits);
        let outside = direction * (found.uncorrected(beyond) - place);
        assert!((outside - 0.025).abs() < 1e-3, "{outside}");
        // Inside it is in the middle, as ever.
        let inside = place - direction;
        found.find_inside(inside, limits);
        assert_eq!(found.at(inside), -found.error(inside).0);
    }
}

/// At a part of the velocity: a plan from what is faster slows down first.
fn symmetric(limits: &AxisLimits, part: f64) -> Limits {
    Limits::symmetric(part * limits.velocity, limits.acceleration, limits.jerk)
}

/// A stretch of a motion: where to, mm, or how far from here; at which part of the velocity; cut off after so many cycles.
#[derive(Clone, Debug)]
enum Leg {
    To(f64, f64, usize),
    By(f64, f64, usize),
    Rest(usize),
}

/// Positions and velocities that are planned, cycle by cycle.
fn planned(limits: &AxisLimits, legs: &[Leg]) -> Vec<(f64, f64)> {
    let mut state = State::at_rest(0.0);
    let mut motion = vec![(0.0, 0.0)];
    for leg in legs {
        let (to, part, most) = match *leg {
            Leg::To(to, part, most) => (to, part, most),
            Leg::By(by, part, most) => (state.p + by, part, most),
            Leg::Rest(most) => (state.p, 1.0, most),
        };
        let problem = Problem::new(state, State::at_rest(to), symmetric(limits, part));
        let plan = state_to_state::plan(&problem, 0.0).expect("a plan");
        let cycles = match leg {
            Leg::Rest(_) => most,
            _ => most.min((plan.duration() / PERIOD).ceil() as usize + 1),
        };
        for cycle in 1..=cycles {
            let there = plan.at(cycle as f64 * PERIOD);
            motion.push((there.p, there.v));
        }
        state = plan.at(cycles as f64 * PERIOD);
    }
    let problem = Problem::new(state, State::at_rest(state.p), symmetric(limits, 1.0));
    let plan = state_to_state::plan(&problem, 0.0).expect("a plan");
    let cycles = (plan.duration() / PERIOD) as usize + 200;
    motion.extend((1..=cycles).map(|cycle| {
        let there = plan.at(cycle as f64 * PERIOD);
        (there.p, there.v)
    }));
    motion
}

/// What is sent for that.
fn sent(compensation: &mut Compensation, motion: &[(f64, f64)]) -> Vec<(f64, f64)> {
    compensation.rest(motion[0].0);
    let step = |&(position, velocity): &(f64, f64)| {
        let correction = compensation.prepare(position, velocity, PERIOD);
        compensation.go_on();
        (
            position + correction.position,
            velocity + correction.velocity,
        )
    };
    motion.iter().map(step).collect()
}

/// The greatest first, second and third differences by the powers of the cycle.
fn derivatives(positions: &[(f64, f64)]) -> [f64; 3] {
    let mut row: Vec<f64> = positions.iter().map(|(position, _)| *position).collect();
    [(); 3].map(|()| {
        row = row
            .windows(2)
            .map(|pair| (pair[1] - pair[0]) / PERIOD)
            .collect();
        row.iter().fold(0.0, |most: f64, it| most.max(it.abs()))
    })
}

fn leg() -> impl Strategy<Value = Leg> {
    let most = prop_oneof![3 => Just(usize::MAX), 2 => 1..60_usize];
    let part = prop_oneof![Just(1.0), 0.05..1.0_f64];
    prop_oneof![
        4 => (-200.0..200.0_f64, Just(1.0), most.clone()).prop_map(|(to, part, most)| Leg::To(to, part, most)),
        3 => (-0.1..0.1_f64, part.clone(), most.clone()).prop_map(|(by, part, most)| Leg::By(by, part, most)),
        2 => (-3.0..3.0_f64, part, most).prop_map(|(by, part, most)| Leg::By(by, part, most)),
        1 => (1..80_usize).prop_map(Leg::Rest),
    ]
}

/// Points at least 8 mm apart, so that some µm between them are no noise.
fn table() -> impl Strategy<Value = Vec<(f64, f64)>> {
    let interval = (8.0..60.0_f64, -6.0..6.0_f64);
    let intervals = prop::collection::vec(interval, 0..9);
    (intervals, -150.0..50.0_f64, -20.0..20.0_f64).prop_map(|(intervals, from, first)| {
        let mut points = Vec::new();
        let (mut at, mut error) = (from, first);
        for (length, rise) in intervals {
            points.push((at, error));
            (at, error) = (at + length, error + rise);
        }
        points.push((at, error));
        if points.len() < 2 { Vec::new() } else { points }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    /// Every motion that the plan may make, with dwells, with reversals shorter than the backlash and while that is being taken up: what
    /// is sent keeps the limits that the file states, and ends on the flank that the last motion leads to.
    #[test]
    fn what_is_sent_keeps_the_limits(
        backlash in prop_oneof![Just(0.0), 0.001..1.0_f64],
        points in table(),
        legs in prop::collection::vec(leg(), 1..12),
    ) {
        prop_assume!(backlash > 0.0 || !points.is_empty());
        let Some(axis) = axis(backlash, &points) else {
            return Err(TestCaseError::reject("too rough a table"));
        };
        let motion = planned(&axis.limits, &legs);
        let mut compensation = compensation(&axis, true);
        let sent = sent(&mut compensation, &motion);
        let all = derivatives(&sent);
        let limits = axis.sent_limits;
        for (value, limit) in all.into_iter().zip([limits.velocity, limits.acceleration, limits.jerk]) {
            prop_assert!(value <= limit * (1.0 + 1e-3), "{all:?} of {limits:?}, planned {:?}", axis.limits);
        }
        let (position, _) = motion[motion.len() - 1];
        let (there, speed) = sent[sent.len() - 1];
        // Where it has turned round last, by more than an increment.
        let (mut turn, mut side) = (0.0, 0.0);
        for &(at, _) in &motion {
            let went: f64 = at - turn;
            if went * side > 0.0 || went.abs() > RESOLUTION {
                (turn, side) = (at, 1_f64.copysign(went));
            }
        }
        let of = axis.compensation.as_ref().expect("compensated");
        let expected = position - of.lead_error.at(position).0 + side * 0.5 * backlash;
        prop_assert!((there - expected).abs() < 1e-9 && speed.abs() < 1e-9, "{there}, expected {expected}");
        prop_assert!(compensation.rests());
        prop_assert!((compensation.uncorrected(there) - position).abs() < 1e-9);
        let beyond = of.greatest() + 1e-9;
        for ((position, _), (sent, _)) in motion.iter().zip(&sent) {
            prop_assert!((sent - position).abs() <= beyond);
        }
        // The velocity that is told is that of what is sent.
        let steepest = limits.jerk * PERIOD * PERIOD;
        for three in sent.windows(3) {
            let mean = (three[2].0 - three[0].0) / (2.0 * PERIOD);
            prop_assert!((three[1].1 - mean).abs() <= steepest);
        }
    }

    /// A plan's rounding, an encoder's least step and standing still turn nothing round.
    #[test]
    fn what_is_no_motion_is_no_reversal(noise in prop::collection::vec(-0.5..0.5_f64, 1..200)) {
        let axis = axis(0.05, &[]).expect("a machine");
        let mut compensation = compensation(&axis, true);
        let mut motion = planned(&axis.limits, &[Leg::To(5.0, 1.0, usize::MAX)]);
        let rest = motion[motion.len() - 1].0;
        motion.extend(noise.iter().map(|part| (rest + part * RESOLUTION, 0.0)));
        let sent = sent(&mut compensation, &motion);
        prop_assert!((sent[sent.len() - 1].0 - motion[motion.len() - 1].0 - 0.025).abs() < 1e-12);
    }
}

/// What is prepared and not handed over leaves no trace.
#[test]
fn what_is_not_handed_over_is_not_taken_up() {
    let axis = axis(0.1, &[]).expect("a machine");
    let mut compensation = compensation(&axis, false);
    compensation.prepare(1.0, 0.0, PERIOD);
    assert!(compensation.rests());
    assert_eq!(compensation.at(1.0), 0.0);
    for _ in 0..3 {
        compensation.prepare(1.0, 0.0, PERIOD);
        compensation.go_on();
    }
    assert!(!compensation.rests() && compensation.at(1.0) > 0.0);
    compensation.forget_flank();
    assert!(compensation.rests() && compensation.at(1.0) == 0.0);
}

/// A scaling of an axis and its drive, whichever way that counts.
fn scaling() -> impl Strategy<Value = Scaling> {
    let counts = prop_oneof![3 => (8..27_u32).prop_map(|bits| 1 << bits), 1 => 200..1_000_000_u32];
    let direction = prop_oneof![Just(Direction::Positive), Just(Direction::Negative)];
    let zero = -1_000_000_000..1_000_000_000_i32;
    (counts, 0.1..400.0_f64, direction, zero).prop_map(|(counts, travel, direction, zero)| {
        Scaling::new(counts, travel, direction, zero.into())
    })
}

/// Points of a lead error as steep as one may be, mm.
fn steep() -> impl Strategy<Value = Vec<(f64, f64)>> {
    let interval = (0.5..80.0_f64, -0.08..0.08_f64);
    (prop::collection::vec(interval, 2..9), -150.0..50.0_f64).prop_map(|(intervals, from)| {
        let (mut at, mut error) = (from, 0.0);
        let next = |(length, slope): (f64, f64)| {
            (at, error) = (at + length, (error + slope * length).clamp(-1.0, 1.0));
            (at, error)
        };
        intervals.into_iter().map(next).collect()
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    /// Whatever axis it is: from what its drives count back comes the position that the plan had, to one increment, in mid-motion, while
    /// backlash is taken up, and beyond the ends of the table.
    #[test]
    fn what_is_told_is_what_was_planned(
        scaling in scaling(),
        backlash in prop_oneof![1 => Just(0.0), 4 => 0.001..1.0_f64],
        points in steep(),
        placed in prop::bool::weighted(0.8),
        legs in prop::collection::vec(leg(), 1..8),
    ) {
        let lead_error = machine::LeadError::new(&points);
        prop_assume!(lead_error.greatest()[1] <= 0.1);
        let of = machine::Compensation {
            backlash,
            take_up: Limits::symmetric(100.0, 625.0, 12_500.0),
            lead_error,
        };
        let mut compensation = Compensation::new(&of, scaling.resolution());
        compensation.place(placed);
        let limits = AxisLimits { velocity: 400.0, acceleration: 2500.0, jerk: 50_000.0, ..AxisLimits::default() };
        for (position, velocity) in planned(&limits, &legs) {
            let correction = compensation.prepare(position, velocity, PERIOD);
            compensation.go_on();
            let counted = scaling.to_increments(position + correction.position).expect("it is near");
            let told = compensation.uncorrected(scaling.to_mm(counted));
            let off = (told - position).abs();
            prop_assert!(off <= scaling.resolution() + 1e-9, "{} in place of {}: {} increments",
                told, position, off / scaling.resolution());
        }
    }
}
