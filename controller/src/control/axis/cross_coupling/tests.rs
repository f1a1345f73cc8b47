//! The law alone: the limits that it keeps whatever it is told, and loops about it that come to rest.

use super::*;
use proptest::prelude::*;
use std::collections::VecDeque;

/// What is rounded, of a difference over a cycle.
const ROUNDING: f64 = 1e-9;

/// Of an axis whose sides take `time` to follow, at a part of the greatest gain, with a slew and a limit.
fn drawn(time: f64, part: f64, slew: f64, limit: f64) -> CrossCoupling {
    CrossCoupling {
        gain: part * 0.25 / time,
        greatest_gain: 0.25 / time,
        lead: 0.0,
        limit,
        dead_zone: 1e-3,
        rate: slew / (part * 0.25 / time),
        slew,
        smoothing: 2.0 / time,
    }
}

/// Holds what the sides are sent apart at the end of each cycle against all bounds; a mean of a derivative is no more than the greatest.
fn judge(of: &CrossCoupling, sent: &[f64], period: f64) -> Result<(), TestCaseError> {
    let mut differences = sent.to_vec();
    let mut over = 1.0;
    for (order, bound) in [of.limit, of.rate, of.slew, of.jerk()]
        .into_iter()
        .enumerate()
    {
        let allowed = bound * over * (1.0 + 1e-9) + f64::powi(2.0, order as i32) * ROUNDING;
        for (place, it) in differences.iter().enumerate() {
            prop_assert!(
                it.abs() <= allowed,
                "order {order} at {place}: {it}, allowed {allowed}"
            );
        }
        let pairs = differences.windows(2);
        differences = pairs.map(|pair| pair[1] - pair[0]).collect();
        over *= period;
    }
    Ok(())
}

/// A stretch of cycles: what the difference is from one to the next, mm, whether it is known, something may be done, and the plan moves.
type Stretch = (f64, f64, usize, bool, bool, bool);

fn stretches() -> impl Strategy<Value = Vec<Stretch>> {
    let sign = prop_oneof![Just(1.0), Just(-1.0), Just(0.0)];
    let size = prop_oneof![0.0..0.01_f64, 0.0..1.0_f64, 0.0..100.0_f64];
    let stretch = (
        (sign, size).prop_map(|(sign, size)| sign * size),
        prop_oneof![Just(0.0), -1.0..1.0_f64],
        1..80_usize,
        prop::bool::weighted(0.9),
        prop::bool::weighted(0.8),
        prop::bool::weighted(0.8),
    );
    prop::collection::vec(stretch, 1..12)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever it is told, and wherever it is told to do nothing more, which ends at rest.
    #[test]
    fn its_limits_hold_at_every_instant(
        stretches in stretches(),
        (cycles, period) in (2.0..30.0_f64, 1e-3..1e-2_f64),
        (part, lead) in (0.01..1.0_f64, 0.0..1.0_f64),
        (slew, limit) in (1.0..1e4_f64, 1e-2..2.0_f64),
    ) {
        let of = CrossCoupling {
            lead: lead * cycles * period,
            ..drawn(cycles * period, part, slew, limit)
        };
        let mut it = Coupling::new(of, period);
        let mut sent = vec![0.0; 4];
        let mut go = |it: &mut Coupling, difference, may, moves| {
            it.prepare(difference, may, moves);
            it.go_on();
            sent.push(it.next());
        };
        for &(from, slope, length, is_known, may, moves) in &stretches {
            for cycle in 0..length {
                let difference = from + slope * cycle as f64 * period;
                go(&mut it, Some(difference).filter(|_| is_known), may, moves);
            }
        }
        // A fault stops the machine: nothing is asked of it any more, also while the plan still moves.
        let before = it.state.aim;
        for cycle in 0..20_000 {
            if it.rests() {
                break;
            }
            go(&mut it, Some(10.0), false, cycle < 10);
        }
        prop_assert!(it.rests());
        // It ran on by no more than it had to.
        let ran_on = (it.state.aim - before).abs();
        let has_to = 0.5 * of.rate * of.rate / of.slew + of.rate * period;
        prop_assert!(ran_on <= has_to * (1.0 + 1e-9), "{ran_on}, {has_to}");
        judge(&of, &sent, period)?;
    }

    /// About sides that answer late, slowly, or more slowly than is stated, it comes to rest with them together, and on the way nothing is
    /// further apart than it was without by more than a part of it.
    #[test]
    fn its_loop_comes_to_rest(
        period in 1e-3..1e-2_f64,
        latency in 0..4_usize,
        position_gain in 10.0..200.0_f64,
        slower in prop_oneof![Just(1.0), 0.1..3.0_f64],
        part in 0.05..1.0_f64,
        step in 0.01..0.5_f64,
        slew in 50.0..1000.0_f64,
    ) {
        let lead = 0.5 / position_gain;
        let time = (1 + latency) as f64 * period + lead;
        let of = CrossCoupling {
            lead,
            ..drawn(time, part, slew, 1.0)
        };
        let mut it = Coupling::new(of, period);
        let follows = 1.0 - libm::exp(-period * position_gain / slower);
        // What was sent and is not there yet, and where the sides are.
        let mut under_way: VecDeque<f64> = std::iter::repeat_n(0.0, latency + 1).collect();
        let (mut apart, mut worst) = (0.0, 0.0_f64);
        let cycles = (20.0 / (of.gain * period)) as usize;
        for cycle in 0..cycles {
            let difference: f64 = step + apart;
            worst = worst.max(difference.abs());
            it.prepare(Some(difference), true, true);
            it.go_on();
            under_way.push_back(it.next());
            apart += follows * (under_way.pop_front().unwrap_or_default() - apart);
            // What is left of it decays.
            let left = difference.abs();
            prop_assert!(cycle < cycles / 2 || left <= 0.1 * step + 1.5e-3, "{left} of {step} in {cycle} of {cycles}");
        }
        prop_assert!(worst <= 1.05 * step, "{worst} of {step}");
    }
}

/// A difference to either side is taken out to where it came from.
#[test]
fn it_pushes_back() {
    for side in [1.0, -1.0] {
        let mut it = Coupling::new(drawn(0.02, 0.5, 300.0, 0.1), 2e-3);
        for _ in 0..10 {
            it.prepare(Some(0.05 * side), true, true);
            it.go_on();
        }
        assert!(it.next() * side < 0.0, "{}", it.next());
    }
}

/// At rest it waits for sides that it moved as long as they come nearer, and gives up those that do not; then it is held.
#[test]
fn it_is_held_at_rest() {
    let rests_after = |apart: &dyn Fn(usize) -> f64, moved: bool| {
        let of = drawn(0.02, 0.5, 300.0, 0.1);
        let mut it = Coupling::new(of, 2e-3);
        let go = |it: &mut Coupling, difference, moves| {
            it.prepare(Some(difference), true, moves);
            it.go_on();
        };
        for _ in 0..200 {
            go(&mut it, if moved { 0.02 } else { 0.0 }, true);
        }
        let rests = (0..5000).position(|cycle| {
            go(&mut it, apart(cycle), false);
            it.rests()
        });
        let held = it.next();
        for _ in 0..100 {
            go(&mut it, 1.0, false);
        }
        assert_eq!(it.next(), held);
        let given_up =
            std::iter::from_fn(|| it.tells()).any(|it| matches!(it, SidesApart::GivenUp(_)));
        (rests.expect("it comes to rest") as f64 * 2e-3, given_up)
    };
    assert_eq!(rests_after(&|_| 0.0, false), (0.0, false));
    let (caught_up, given_up) = rests_after(&|_| 0.0, true);
    assert!((0.03..0.3).contains(&caught_up) && !given_up, "{caught_up}");
    // 2 / gain are 0.32 s.
    let (jammed, given_up) = rests_after(&|_| 0.05, true);
    assert!((0.32..0.8).contains(&jammed) && given_up, "{jammed}");
    let (nearer, given_up) =
        rests_after(&|cycle| 0.05 * libm::exp(-6.25 * 2e-3 * cycle as f64), true);
    assert!((0.5..0.9).contains(&nearer) && !given_up, "{nearer}");
    // What comes nearer slowly is waited for, and not for ever.
    let (slowly, given_up) =
        rests_after(&|cycle| 0.05 * libm::exp(-2.0 * 2e-3 * cycle as f64), true);
    assert!((1.2..1.6).contains(&slowly) && given_up, "{slowly}");
    // Noise about nothing, by far more than the dead zone.
    let (noisy, _) = rests_after(&|cycle| [0.01, -0.012, 0.008, -0.006][cycle % 4], true);
    assert!(noisy < 0.6, "{noisy}");
}

/// That its limit is used up is told once, until it begins anew.
#[test]
fn its_end_is_told_once() {
    let mut it = Coupling::new(drawn(0.02, 1.0, 300.0, 0.02), 2e-3);
    for _ in 0..2 {
        let told = (0..1000).filter(|_| {
            it.prepare(Some(1.0), true, true);
            it.go_on();
            it.tells() == Some(SidesApart::AtLimit(0.02))
        });
        assert_eq!(told.count(), 1);
        it.begin(0.0);
    }
}
