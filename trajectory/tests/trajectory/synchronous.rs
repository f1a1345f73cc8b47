//! Threads: setpoints that follow a spindle which is sampled, is not even, and has an encoder of some lines.

use core::f64::consts::TAU;
use proptest::prelude::*;
use proptest::sample::select;
use syncline_trajectory::limits::Limits;
use syncline_trajectory::profile::State;
use syncline_trajectory::state_to_state::{Problem, plan};
use syncline_trajectory::synchronous::{
    AngleObserver, BEYOND, Follower, LostStep, Tapping, Thread,
};

/// A spindle that turns unevenly: an amplitude of its speed, a part of that, so often a turn.
#[derive(Clone, Copy, Debug)]
struct Spindle {
    /// 1/min, negative the other way.
    speed: f64,
    ripple: f64,
    harmonic: u32,
    phase: f64,
    counts: f64,
    start: f64,
}

impl Spindle {
    /// True angle, turns.
    fn turns(&self, t: f64) -> f64 {
        let even = self.start + self.mean(t);
        let rate = TAU * f64::from(self.harmonic);
        even + self.ripple / rate * libm::sin(rate * even + self.phase)
    }

    /// How far it has turned from rest: by a ramp, behind which it swings to its speed.
    fn mean(&self, t: f64) -> f64 {
        let speed = self.speed / 60.0;
        let ramp = speed.abs() / RAMP;
        if t < ramp {
            return 0.5 * RAMP * t * t * speed.signum();
        }
        let (rate, decay) = (60.0, 20.0);
        let t = t - ramp;
        let swing = 0.01 * speed / rate * libm::exp(-decay * t) * libm::sin(rate * t);
        speed * (0.5 * ramp + t) + swing
    }

    /// As its encoder tells it.
    fn told(&self, t: f64) -> f64 {
        (self.turns(t) * self.counts).floor() / self.counts
    }
}

/// Turns/s².
const RAMP: f64 = 3000.0 / 60.0 / 0.3;

/// What a thread came to.
struct Cut {
    /// By setpoint, from the first.
    states: Vec<State>,
    /// Greatest distance of the setpoint from where the spindle wants it, mm, from 50 setpoints behind the ramp on.
    error: f64,
    in_step: usize,
    lost: Option<LostStep>,
}

/// Of velocity, acceleration and jerk, mm and s.
const LIMITS: [f64; 3] = [250.0, 3000.0, 80_000.0];

fn cut(spindle: &Spindle, thread: Thread, period: f64, cycles_ahead: f64) -> Cut {
    let [v, a, j] = LIMITS;
    let mut follower = Follower::new(thread, Limits::symmetric(v, a, j), period);
    let mut observer = AngleObserver::new(period, spindle.counts.recip());
    let after = cycles_ahead * period;
    let (mut states, mut error, mut in_step, mut turn) = (vec![State::default()], 0.0_f64, 0, None);
    for cycle in 0..100_000_u32 {
        let now = f64::from(cycle) * period;
        observer.advance(period);
        observer.measure(spindle.told(now));
        // The spindle is told to be at speed before the thread is begun.
        if now < spindle.speed.abs() / 60.0 / RAMP + 0.05 {
            continue;
        }
        let lost = follower
            .advance(&mut observer, period, after - period)
            .err();
        let state = follower.state();
        states.push(state);
        // As it says, and not by differences alone.
        assert!(
            follower.jerk().abs() <= j,
            "{} at {state:?}",
            follower.jerk()
        );
        if follower.is_in_step() {
            let sign = if thread.reverse { -1.0 } else { 1.0 };
            let off = sign * spindle.turns(now + after) - state.p / thread.lead;
            // Where the thread begins is a whole turn.
            let turn = *turn.get_or_insert(off.round());
            in_step += 1;
            if in_step >= 50 {
                error = error.max((off - turn).abs() * thread.lead);
            }
        }
        if lost.is_some() || follower.is_over() {
            return Cut {
                states,
                error,
                in_step,
                lost,
            };
        }
    }
    panic!("it never ends: {spindle:?}, {thread:?}");
}

/// Velocity, acceleration and jerk of the setpoints' differences stay within the limits.
fn assert_within_limits(states: &[State], period: f64) {
    let positions: Vec<f64> = states.iter().map(|state| state.p).collect();
    let mut differences = positions;
    for limit in LIMITS {
        differences = differences
            .windows(2)
            .map(|pair| (pair[1] - pair[0]) / period)
            .collect();
        let most = differences
            .iter()
            .fold(0.0_f64, |most, it| most.max(it.abs()));
        assert!(most <= limit * (1.0 + 1e-6), "{most} beyond {limit}");
    }
}

fn thread(length: f64, lead: f64, reverse: bool) -> Thread {
    Thread {
        length,
        lead,
        reverse,
        tolerance: 0.05,
        tapping: None,
    }
}

/// What a tool may be off by, mm: of a spindle whose speed is uneven by 2 % and whose encoder has 4,096 lines.
const ALLOWED: f64 = 0.007;

/// How long a thread lasts about a second in step.
fn length(spindle: &Spindle, lead: f64) -> f64 {
    1.3 * lead * spindle.speed.abs() / 60.0 + 2.0
}

fn spindle() -> impl Strategy<Value = Spindle> {
    let speed = (100.0..1500.0f64, any::<bool>());
    let speed = speed.prop_map(|(speed, reverse)| if reverse { -speed } else { speed });
    let ripple = prop_oneof![Just(0.0), Just(0.02), 0.0..0.02f64];
    let counts = select(vec![4096.0, 10_000.0, 1_048_576.0]);
    (speed, ripple, 1..=3u32, 0.0..TAU, counts, -500.0..500.0f64).prop_map(
        |(speed, ripple, harmonic, phase, counts, start)| Spindle {
            speed,
            ripple,
            harmonic,
            phase,
            counts,
            start,
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    /// From half of what is allowed of the tool on the setpoints are in step, within the limits, and end where the thread
    /// does, whatever the cycle.
    #[test]
    fn a_thread_is_in_step_from_a_whole_turn_of_the_spindle_to_its_end(
        spindle in spindle(), lead in 0.5..3.0f64, period in select(vec![1e-3, 2e-3]), ahead in 1.0..3.0f64,
    ) {
        let length = length(&spindle, lead);
        let cut = cut(&spindle, thread(length, lead, spindle.speed < 0.0), period, ahead);
        prop_assert_eq!(cut.lost, None);
        assert_within_limits(&cut.states, period);
        prop_assert!(cut.error < ALLOWED, "{} mm", cut.error);
        prop_assert!(cut.in_step > 200, "{}", cut.in_step);
        let last = cut.states.last().unwrap();
        prop_assert!((last.p - length).abs() < 1e-9 && last.v == 0.0 && last.a == 0.0, "{:?}", last);
        // Never back, and never beyond.
        prop_assert!(cut.states.windows(2).all(|pair| pair[1].p >= pair[0].p - 1e-9));
    }

    /// At every setpoint of a thread the shortest stop ends before the thread does.
    #[test]
    fn there_is_always_a_stop_before_the_end(spindle in spindle(), lead in 0.5..3.0f64) {
        let length = length(&spindle, lead);
        let cut = cut(&spindle, thread(length, lead, spindle.speed < 0.0), 2e-3, 3.0);
        let [v, a, j] = LIMITS;
        for state in cut.states {
            let stop = Problem::to_velocity(state, 0.0, Limits::symmetric(v, a, j));
            let stop = plan(&stop, 0.0).unwrap();
            prop_assert!(stop.end().p <= length + 1e-6, "{:?}", state);
        }
    }
}

/// A tap with a spindle that turns as it is told from each SYNC on, or goes on as before: setpoints, the greatest distance
/// from where it wants them, mm, and what was lost.
fn tap(
    thread: Thread,
    speed: f64,
    obeys: bool,
    period: f64,
) -> (Vec<State>, f64, Option<LostStep>) {
    let [v, a, j] = LIMITS;
    let mut follower = Follower::new(thread, Limits::symmetric(v, a, j), period);
    let mut observer = AngleObserver::new(period, 1e-6);
    let straight = if thread.reverse { -speed } else { speed };
    let (mut turns, mut told) = (0.3, straight);
    let (mut states, mut error, mut in_step) = (vec![State::default()], 0.0_f64, 0);
    for _ in 0..100_000_u32 {
        observer.advance(period);
        observer.measure(turns);
        let lost = match follower.advance(&mut observer, period, 0.0) {
            Ok(state) => {
                states.push(state);
                None
            }
            Err(lost) => Some(lost),
        };
        // Where it is when that takes effect.
        turns += told * period;
        if follower.is_in_step() {
            in_step += 1;
            if in_step >= 50 {
                error = error.max((follower.wanted_at(turns) - follower.state().p).abs());
            }
        }
        if lost.is_some() || follower.is_over() {
            return (states, error, lost);
        }
        let next = follower.spindle_speed().filter(|_| obeys);
        told = next.unwrap_or(straight);
    }
    panic!("it never ends: {speed}, {thread:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 100, ..ProptestConfig::default() })]

    /// In step there and back to where it began; from every setpoint there is a stop inside what the tap may need, whatever
    /// the spindle does.
    #[test]
    fn a_tap_is_in_step_and_always_stops_in_time(
        speed in 100.0..1500.0f64, lead in 0.5..3.0f64, reverse: bool, obeys: bool, more in 1.01..3.0f64,
        period in select(vec![1e-3, 2e-3]), ramp in 20.0..500.0f64,
    ) {
        let speed = speed / 60.0;
        let tapping = Some(Tapping { speed, ramp, delay: 0.0 });
        let [v, a, j] = LIMITS;
        let limits = Limits::symmetric(v, a, j);
        let least = Thread { tapping, ..thread(0.0, lead, reverse) }.least_length(&limits, speed).unwrap();
        let thread = Thread { tapping, ..thread(more * least + lead, lead, reverse) };
        let (states, error, lost) = tap(thread, speed, obeys, period);
        assert_within_limits(&states, period);
        let most = thread.length + BEYOND * lead;
        for &state in &states {
            let stop = plan(&Problem::to_velocity(state, 0.0, limits), 0.0).unwrap();
            prop_assert!((-1e-6..=most + 1e-6).contains(&stop.end().p), "{:?}", state);
        }
        if obeys {
            prop_assert_eq!(lost, None);
            let deepest = states.iter().map(|state| state.p).fold(0.0, f64::max);
            prop_assert!((deepest - thread.length).abs() < 0.05, "{} of {}", deepest, thread.length);
            prop_assert!(error < ALLOWED, "{} mm", error);
            prop_assert_eq!(states.last().unwrap().p, 0.0);
        } else {
            prop_assert!(lost.is_some());
        }
    }
}

/// A spindle that asks for more than the greatest velocity, or is stopped by force.
#[test]
fn what_the_axis_cannot_follow_is_told() {
    let even = Spindle {
        speed: 1200.0,
        ripple: 0.0,
        harmonic: 1,
        phase: 0.0,
        counts: 1_048_576.0,
        start: 0.0,
    };
    // 20 turns in a second by 13 mm.
    let fast = thread(100.0, 12.4, false);
    assert_eq!(cut(&even, fast, 2e-3, 3.0).lost, None);
    let uneven = Spindle {
        ripple: 0.02,
        ..even
    };
    let lost = cut(&uneven, fast, 2e-3, 3.0).lost;
    assert!(matches!(lost, Some(LostStep::TooFast { .. })), "{lost:?}");
}

#[test]
fn a_thread_needs_a_way_to_come_in_step_and_to_rest() {
    let [v, a, j] = LIMITS;
    let limits = Limits::symmetric(v, a, j);
    let thread = thread(10.0, 2.0, false);
    let needed = thread.least_length(&limits, 10.0).unwrap();
    assert!((0.5..3.0).contains(&needed), "{needed}");
    assert!(thread.least_length(&limits, 60.0).unwrap() > needed);
    assert_eq!(thread.least_length(&limits, 126.0), None);
}

/// Where a stop ends within less than a microsecond behind a setpoint, that one is at rest already: its acceleration less the one before is more
/// than the jerk of the stop.
#[test]
fn a_thread_that_ends_just_behind_a_setpoint_keeps_its_jerk() {
    let spindle = Spindle {
        speed: -677.1050816036434,
        ripple: 0.0,
        harmonic: 1,
        phase: 0.0,
        counts: 10_000.0,
        start: -89.04456149423834,
    };
    let lead = 1.6271742425764266;
    let length = length(&spindle, lead);
    let cut = cut(
        &spindle,
        thread(length, lead, true),
        2e-3,
        1.5035105821601642,
    );
    assert_eq!(cut.lost, None);
}
