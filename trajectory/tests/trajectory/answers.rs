//! The planner answers whatever it is asked: every call and every path take work in proportion to the path,
//! counted in cells times Newton steps, and motion is never slower than with a stop at every point.

use crate::machine::Machine;
use crate::programs::{Cost, Draw, Program, campaign};
use syncline_trajectory::path::{Feed, Limits, Overrides, PathControlMode};

/// More than a call may spend: its allowance, and a speed profile of as many cells as one may have.
const MOST_OF_A_CALL: usize = 2_000_000 + 9_600 * 80;
/// What a path may take for a segment, and for a second of motion with stops.
const MOST_OF_A_SEGMENT: f64 = 500_000.0;
/// Part by which the optimum may be missed.
const TOLERANCE: f64 = 1e-3;

/// A program in a mode.
#[derive(Debug, Clone)]
struct Case {
    program: Program,
    mode: PathControlMode,
}

impl Case {
    /// Checks what holds for all of them.
    fn check(&self) -> Cost {
        let (stopping, cost) = (self.program.stopping(), self.program.cost(self.mode));
        assert!(
            cost.time <= stopping.time * (1.0 + TOLERANCE),
            "{} s, {} s with stops",
            cost.time,
            stopping.time
        );
        assert!(cost.most <= MOST_OF_A_CALL, "{cost:?}");
        let segments = self.program.curves.len() as f64;
        let most = MOST_OF_A_SEGMENT * (segments + stopping.time);
        assert!((cost.effort.work as f64) < most, "{cost:?}, not {most:e}");
        cost
    }

    /// Checks that the last four setpoints keep the limits, whatever the plan says of them: their differences are means of
    /// the derivatives, which are no greater than these are.
    fn check_differences(&self, sent: &[[f64; 3]; 4], period: f64) {
        let limits = &self.program.limits;
        for i in 0..3 {
            let [a, b, c, d] = sent.map(|position| position[i]);
            let rounding = 8.0 * f64::EPSILON * (a.abs() + d.abs() + 1.0);
            let kinds = [
                ("velocity", d - c, 1, limits.velocity[i]),
                ("acceleration", d - 2.0 * c + b, 2, limits.acceleration[i]),
                ("jerk", d - 3.0 * (c - b) - a, 3, limits.jerk[i]),
            ];
            for (kind, difference, order, limit) in kinds {
                let most = limit * period.powi(order);
                assert!(
                    difference.abs() <= most * (1.0 + 1e-5) + rounding,
                    "{kind} of axis {i} is {} of its limit",
                    difference / most
                );
            }
        }
    }

    /// Executes it while an operator acts, and checks that setpoints keep the limits and that it ends.
    fn execute(&self, acts: &[(u64, Act)]) {
        let period = 0.004;
        let least = acts.iter().map(|(_, act)| match act {
            Act::Override(part) => *part,
            _ => 1.0,
        });
        let slowest = least.fold(1.0, f64::min);
        let patience = 100;
        let once = self.program.stopping().time / period / slowest;
        let times = (1 + acts.len()) as f64;
        let waits = acts.iter().map(|(at, _)| *at + 2 * patience).sum::<u64>() as f64;
        // Each comes to rest and goes on, at most from the block before; with single block at every point.
        let rests = self.program.curves.len() as f64 * patience as f64;
        let most = 2.0 * times * (once + 20.0 + rests) + waits;
        let items = self.program.items(self.mode);
        let mut machine = Machine::new(self.program.limits, &items, self.program.start(), period);
        let mut acts = acts.iter();
        let mut next = acts.next();
        let (mut since, mut held) = (0, 0);
        let mut sent = [self.program.start(); 4];
        loop {
            let executor = &mut machine.executor;
            since += 1;
            if let Some((_, act)) = next.filter(|(later, _)| since > *later) {
                match *act {
                    Act::Override(feed) => {
                        executor.set_overrides(Overrides { feed, rapid: 1.0 });
                    }
                    Act::Hold => executor.feed_hold(),
                    Act::SingleBlock(on) => executor.set_single_block(on),
                    Act::Retrace => executor.retrace(),
                }
                (next, since) = (acts.next(), 0);
            }
            held = if executor.is_held() { held + 1 } else { 0 };
            if held > patience {
                executor.resume();
                held = 0;
            }
            let Some(setpoint) = machine.advance() else {
                return;
            };
            sent.rotate_left(1);
            sent[3] = setpoint.position;
            self.check_differences(&sent, period);
            let cycle = machine.executor.cycle();
            assert!((cycle as f64) < most, "still under way after {most} cycles");
        }
    }
}

/// What an operator does.
#[derive(Debug, Clone, Copy)]
enum Act {
    Override(f64),
    Hold,
    SingleBlock(bool),
    Retrace,
}

impl Draw {
    fn acts(&mut self) -> Vec<(u64, Act)> {
        let count = (self.unit() * 6.0) as usize;
        let mut act = || {
            let act = match (self.unit() * 6.0) as u32 {
                0..3 => Act::Override(self.log(0.1, 2.0)),
                3 => Act::Hold,
                4 => Act::SingleBlock(self.unit() < 0.5),
                _ => Act::Retrace,
            };
            (self.log(1.0, 1_000.0) as u64, act)
        };
        (0..count).map(|_| act()).collect()
    }
}

/// The program of a seed, checked; whoever acts does it where that takes no minutes.
fn check(seed: u64) {
    let mut draw = Draw::of(seed);
    let (program, mode) = draw.short_segments();
    let case = Case { program, mode };
    let cost = case.check();
    println!(
        "seed {seed}: {} curves, {cost:?}",
        case.program.curves.len()
    );
    if case.program.stopping().time < 10.0 {
        case.execute(&draw.acts());
    }
}

#[test]
fn short_segments_by_chance_take_work_in_proportion_and_no_longer_than_with_stops() {
    // Those that take seconds are in the campaign.
    (100..125).for_each(check);
}

/// As long as is wanted: `CASES=1000`, from `SEED=0` on.
#[test]
#[ignore = "a campaign of minutes"]
fn many_short_segments_by_chance() {
    campaign().for_each(check);
}

/// Setpoints keep the limits where turns are tighter than the tolerance.
fn check_tight_turns(seed: u64) {
    let (program, mode) = Draw::of(seed).tight_turns();
    println!("seed {seed}: {} curves", program.curves.len());
    Case { program, mode }.execute(&[]);
}

#[test]
fn tight_turns_by_chance_keep_the_limits() {
    (20..40).for_each(check_tight_turns);
}

/// As long as is wanted: `CASES=1000`, from `SEED=0` on.
#[test]
#[ignore = "a campaign of minutes"]
fn many_tight_turns_by_chance() {
    campaign().for_each(check_tight_turns);
}

const PLAIN: Limits<3> = Limits {
    velocity: [200.0; 3],
    acceleration: [2_000.0; 3],
    jerk: [40_000.0; 3],
};

#[test]
fn a_turn_tighter_than_the_tolerance_is_planned() {
    for (radius, step, tolerances) in [
        (0.05, 0.4, &[0.01, 0.05, 0.1, 0.12, 0.2, 1.0][..]),
        (1.0, 0.3, &[0.1, 1.0, 2.0, 2.54]),
    ] {
        let turn = (0..=40).map(|i| step * f64::from(i));
        let turn = turn.map(|a: f64| [radius * a.sin(), radius - radius * a.cos(), 0.0]);
        let points: Vec<_> = turn.collect();
        for &tolerance in tolerances {
            let case = Case {
                program: Program::polyline(PLAIN, &points, Feed::Rate(100.0)),
                mode: PathControlMode::Blend(tolerance),
            };
            case.check();
            case.execute(&[]);
        }
    }
}

#[test]
fn motion_takes_no_longer_where_an_axis_may_do_more() {
    let points = [
        [0.0; 3],
        [20.0, 20.0, 0.0],
        [60.0, 25.0, 0.0],
        [10.0, 60.0, 0.0],
        [0.0; 3],
    ];
    for mode in [PathControlMode::Exact(0.001), PathControlMode::Blend(0.05)] {
        let time = |limits| {
            Case {
                program: Program::polyline(limits, &points, Feed::Rate(100.0)),
                mode,
            }
            .check()
            .time
        };
        let grows = |limits: &dyn Fn(f64) -> Limits<3>| {
            let mut before = f64::INFINITY;
            for decade in 0..16 {
                let time = time(limits(10_f64.powf(0.5 * f64::from(decade))));
                assert!(
                    time <= before * (1.0 + TOLERANCE),
                    "{time} s, not {before} s"
                );
                before = time;
            }
        };
        let more = |limit: [f64; 3], by: f64| limit.map(|it| it * by);
        grows(&|by| Limits {
            jerk: more([1e4; 3], by),
            ..PLAIN
        });
        grows(&|by| Limits {
            acceleration: more([1e2; 3], by),
            ..PLAIN
        });
        grows(&|by| Limits {
            velocity: more([1.0; 3], by),
            ..PLAIN
        });
    }
}

#[test]
fn limits_that_differ_by_decades_take_no_longer_than_stops() {
    let limits = Limits {
        velocity: [0.1, 73.0, 20.0],
        acceleration: [1_341.0, 1.4, 100.0],
        jerk: [1.4e6, 303.0, 20_000.0],
    };
    for angle in [0.3_f64, 1.0, 1.5, 2.2] {
        let mut at = [0.0; 3];
        let mut points = vec![at];
        for k in 0..8 {
            let heading = angle * f64::from(k % 2);
            at[0] += 0.5 * heading.cos();
            at[1] += 7.0 * heading.sin();
            points.push(at);
        }
        Case {
            program: Program::polyline(limits, &points, Feed::Rate(50.0)),
            mode: PathControlMode::Exact(0.001),
        }
        .check();
    }
}

/// A machine that came to rest in mid-program for ever: its slow Y reached its speed in a small part of the time of
/// a ramp, and a window had more cells than the executor had room for.
#[test]
fn an_axis_with_much_jerk_and_little_acceleration_does_not_stall() {
    let limits = Limits {
        velocity: [24.05, 16.6, 112.6],
        acceleration: [83.83, 20.92, 316.8],
        jerk: [6_756.0, 187_800.0, 7_530.0],
    };
    let points = [[0.0; 3], [0.0, -10.001, 7.226], [0.0, -9.72, 7.238]];
    let case = Case {
        program: Program::polyline(limits, &points, Feed::Rate(10_570.0 / 60.0)),
        mode: PathControlMode::Blend(0.004754),
    };
    case.check();
    case.execute(&[]);
}
