//! Jogs: single axes while the path rests, from any state, and the way back to the path.

use proptest::prelude::*;
use syncline_trajectory::limits::{Limits as AxisLimits, PositionLimits};
use syncline_trajectory::path::{
    Curve, Executor, Feed, Jog, JogError, Limits, Move, Overrides, PathControlMode, PathItem,
    Planner, Retraction, Setpoint, Travel,
};
use syncline_trajectory::profile::State;
use syncline_trajectory::state_to_state::{Problem, plan};
use syncline_trajectory::verify;

const LIMITS: Limits<3> = Limits {
    velocity: [500.0, 400.0, 200.0],
    acceleration: [5_000.0, 3_000.0, 2_000.0],
    jerk: [80_000.0, 50_000.0, 40_000.0],
};
const PERIOD: f64 = 0.001;
const ENDS: [(f64, f64); 3] = [(-50.0, 150.0), (-50.0, 150.0), (-30.0, 5.0)];

fn axis_limits(axis: usize) -> AxisLimits {
    AxisLimits::symmetric(
        LIMITS.velocity[axis],
        LIMITS.acceleration[axis],
        LIMITS.jerk[axis],
    )
}

fn travel() -> [Option<Travel>; 3] {
    std::array::from_fn(|axis| {
        let (min, max) = ENDS[axis];
        let bounds = PositionLimits { min, max };
        let limits = axis_limits(axis);
        Some(Travel { limits, bounds })
    })
}

/// An executor, its planner, and all setpoints so far.
struct Machine {
    planner: Planner<3>,
    executor: Executor<3>,
    rows: Vec<Setpoint<3>>,
}

impl Machine {
    /// Along a right angle of 100 mm and 60 mm.
    fn on_a_path() -> Self {
        let mut machine = Self::at_rest([0.0; 3]);
        for (from, to) in [
            ([0.0; 3], [100.0, 0.0, 0.0]),
            ([100.0, 0.0, 0.0], [100.0, 60.0, 0.0]),
        ] {
            let item = PathItem::Move(Move {
                curve: Curve::line(from, to).unwrap(),
                feed: Feed::Rate(100.0),
                mode: PathControlMode::Exact(0.001),
                tag: 0,
            });
            machine.planner.push(item).unwrap();
        }
        machine.planner.finish();
        machine
    }

    fn at_rest(position: [f64; 3]) -> Self {
        let executor = Executor::new(position, PERIOD);
        Machine {
            planner: Planner::new(LIMITS, position),
            rows: vec![executor.setpoint()],
            executor,
        }
    }

    fn cycles(&mut self, count: usize) {
        for _ in 0..count {
            if let Some(request) = self.executor.replan_request() {
                self.planner.replan(&request);
            }
            while self.executor.room() > 0
                && let Some(command) = self.planner.pop()
            {
                assert!(self.executor.accept(command));
            }
            self.rows.push(self.executor.advance());
        }
    }

    fn until(&mut self, is_so: impl Fn(&Setpoint<3>) -> bool) {
        while !is_so(self.now()) {
            assert!(self.rows.len() < 100_000, "never: {:?}", self.now());
            self.cycles(1);
        }
    }

    fn now(&self) -> &Setpoint<3> {
        self.rows.last().unwrap()
    }

    fn jog(&mut self, jog: Jog<3>) -> Result<(), JogError> {
        self.executor.jog(jog, &travel())
    }

    fn end(&mut self) {
        for _ in 0..100_000 {
            self.cycles(1);
            if self.executor.is_idle() {
                return self.assert_well();
            }
        }
        panic!("never ends: {:?}", self.now());
    }

    /// Every setpoint inside the limits and the travel, and none jumps.
    fn assert_well(&self) {
        for (axis, (min, max)) in ENDS.into_iter().enumerate() {
            let within = |x: f64, limit: f64| x.abs() <= limit * (1.0 + 1e-9);
            for now in &self.rows {
                assert!(within(now.velocity[axis], LIMITS.velocity[axis]), "{now:?}");
                assert!(
                    within(now.acceleration[axis], LIMITS.acceleration[axis]),
                    "{now:?}"
                );
                assert!(within(now.jerk[axis], LIMITS.jerk[axis]), "{now:?}");
                let bounds = min - 1e-12..=max + 1e-12;
                assert!(bounds.contains(&now.position[axis]), "{now:?}");
            }
            for window in self.rows.windows(4) {
                let [a, b, c, d] = [0, 1, 2, 3].map(|k| window[k].position[axis]);
                let jerk = ((d - a) - 3.0 * (c - b)) / (PERIOD * PERIOD * PERIOD);
                assert!(
                    jerk.abs() <= LIMITS.jerk[axis] * (1.0 + 1e-6) + 1e-2,
                    "{window:?}"
                );
            }
        }
    }

    /// Of the rows on the path, the greatest distance from the right angle.
    fn off_the_path(&self) -> f64 {
        let off = |row: &Setpoint<3>| {
            let [x, y, z] = row.position;
            let along_x = (x - x.clamp(0.0, 100.0)).hypot(y);
            let along_y = (x - 100.0).hypot(y - y.clamp(0.0, 60.0));
            along_x.min(along_y).hypot(z)
        };
        let on_it = self.rows.iter().filter(|row| !row.off_path);
        on_it.map(off).fold(0.0, f64::max)
    }
}

fn step(axis: usize, distance: f64) -> Jog<3> {
    Jog::Step {
        axis,
        distance,
        speed: f64::INFINITY,
    }
}

#[test]
fn hold_jog_away_and_resume_where_the_path_was_left() {
    let mut undisturbed = Machine::on_a_path();
    undisturbed.end();
    // Held in mid-speed, and held at the very beginning.
    for held_at in [0.0, 40.0] {
        let mut machine = Machine::on_a_path();
        machine.until(|now| now.distance >= held_at);
        machine.executor.feed_hold();
        if held_at > 0.0 {
            assert_eq!(machine.jog(step(2, 3.0)), Err(JogError::Moving), "braking");
        }
        machine.until(|now| now.speed == 0.0);
        let left = *machine.now();
        machine.jog(step(2, 3.0)).unwrap();
        machine.cycles(30);
        machine.jog(Jog::To([Some(0.0), Some(77.0), None])).unwrap();
        machine.cycles(40);
        assert!(machine.now().off_path && machine.now().speed > 0.0);
        assert_eq!(machine.now().distance, left.distance);
        machine.until(|now| now.speed == 0.0);
        assert_eq!(machine.now().position, [0.0, 77.0, 3.0]);
        let out = machine.rows.len();
        machine.executor.resume();
        machine.cycles(1);
        machine.until(|now| !now.off_path);
        assert_eq!(machine.now().position, left.position);
        // The way back is straight.
        let from = machine.rows[out - 1].position;
        let back = &machine.rows[out..];
        let way: [f64; 3] = std::array::from_fn(|i| left.position[i] - from[i]);
        for row in back {
            let gone: [f64; 3] = std::array::from_fn(|i| row.position[i] - from[i]);
            for (i, k) in [(0, 1), (1, 2), (2, 0)] {
                let cross = gone[i] * way[k] - gone[k] * way[i];
                assert!(cross.abs() < 1e-9, "{row:?}");
            }
        }
        machine.end();
        assert_eq!(machine.now().position, [100.0, 60.0, 0.0]);
        let whole = undisturbed.now().distance;
        assert!((machine.now().distance - whole).abs() <= 1e-12 * whole);
        // What G61 allows at the corner.
        let off = machine.off_the_path();
        assert!(off <= 0.001, "{off}");
    }
}

#[test]
fn a_jog_is_refused_while_the_path_moves_and_where_it_cannot_be() {
    let mut machine = Machine::on_a_path();
    machine.cycles(1);
    machine.until(|now| now.distance >= 5.0);
    for jog in [
        step(1, 1.0),
        Jog::To([Some(1.0), None, None]),
        Jog::Continuous {
            axis: 0,
            velocity: 1.0,
        },
    ] {
        assert_eq!(machine.jog(jog), Err(JogError::Moving));
    }
    machine.executor.feed_hold();
    machine.until(|now| now.speed == 0.0);
    for (jog, error) in [
        (step(3, 1.0), JogError::NoAxis(3)),
        (step(0, f64::NAN), JogError::NotANumber),
        (
            Jog::Continuous {
                axis: 0,
                velocity: f64::NAN,
            },
            JogError::NotANumber,
        ),
        (
            Jog::Continuous {
                axis: 0,
                velocity: 0.0,
            },
            JogError::NoSpeed,
        ),
        (
            Jog::Line {
                to: [None, None, Some(6.0)],
                speed: f64::INFINITY,
            },
            JogError::OutsideTravel {
                axis: 2,
                to: 6.0,
                min: ENDS[2].0,
                max: ENDS[2].1,
            },
        ),
        (
            Jog::To([Some(0.0), Some(-51.0), None]),
            JogError::OutsideTravel {
                axis: 1,
                to: -51.0,
                min: ENDS[1].0,
                max: ENDS[1].1,
            },
        ),
    ] {
        assert_eq!(machine.jog(jog), Err(error));
    }
    machine.executor.set_overrides(Overrides {
        feed: 1.0,
        rapid: 0.0,
    });
    assert_eq!(machine.jog(step(0, 1.0)), Err(JogError::NoSpeed));
    assert!(!machine.executor.is_off_path());
    machine.executor.set_overrides(Overrides::default());
    machine.executor.resume();
    machine.end();
    assert_eq!(machine.now().position, [100.0, 60.0, 0.0]);
}

#[test]
fn a_long_jog_ends_at_the_soft_limit_and_a_hold_stops_it_before() {
    let mut machine = Machine::at_rest([0.0; 3]);
    machine
        .jog(Jog::Continuous {
            axis: 0,
            velocity: -90.0,
        })
        .unwrap();
    machine.jog(step(2, 100.0)).unwrap();
    machine.cycles(300);
    assert!((machine.now().velocity[0] + 90.0).abs() < 1e-9);
    machine.until(|now| !now.busy);
    assert_eq!(machine.now().position, [-50.0, 0.0, 5.0]);
    machine
        .jog(Jog::Continuous {
            axis: 0,
            velocity: 400.0,
        })
        .unwrap();
    machine.cycles(150);
    let braked = *machine.now();
    machine.executor.feed_hold();
    machine.until(|now| !now.busy);
    let start = State {
        p: braked.position[0],
        v: braked.velocity[0],
        a: braked.acceleration[0],
    };
    let stop = plan(&Problem::to_velocity(start, 0.0, axis_limits(0)), 0.0).unwrap();
    assert!((machine.now().position[0] - stop.end().p).abs() < 1e-9);
    machine.assert_well();
}

#[test]
fn the_rapid_override_holds_for_what_is_under_way() {
    let (from, to) = ([-45.0, -45.0, -25.0], [145.0, 105.0, 3.5]);
    let rapid = |machine: &mut Machine, rapid: f64| {
        machine
            .executor
            .set_overrides(Overrides { feed: 1.0, rapid });
    };
    for jog in [
        Jog::Line {
            to: to.map(Some),
            speed: f64::INFINITY,
        },
        Jog::To(to.map(Some)),
    ] {
        let mut machine = Machine::at_rest(from);
        machine.jog(jog).unwrap();
        machine.cycles(100);
        let fast = machine.now().velocity[0];
        rapid(&mut machine, 0.2);
        machine.cycles(250);
        let slow = machine.now().velocity[0];
        assert!(
            fast > 200.0 && slow > 50.0 && slow <= 100.0 + 1e-9,
            "{fast} {slow}"
        );
        rapid(&mut machine, 0.0);
        machine.cycles(300);
        assert_eq!(machine.now().speed, 0.0);
        assert!(machine.now().busy && machine.now().position[0] < 145.0);
        rapid(&mut machine, 1.0);
        machine.until(|now| !now.busy);
        assert_eq!(machine.now().position, to);
        machine.assert_well();
        let off_the_line = |row: &Setpoint<3>| {
            let part: [f64; 3] =
                std::array::from_fn(|i| (row.position[i] - from[i]) / (to[i] - from[i]));
            (part[0] - part[1]).abs().max((part[0] - part[2]).abs())
        };
        let off = machine.rows.iter().map(off_the_line).fold(0.0, f64::max);
        assert!((off < 1e-9) == matches!(jog, Jog::Line { .. }), "{off}");
    }
}

/// The stop from k cycles of jerk takes 3k, so it ends with a cycle, to rounding. A new speed that comes a few
/// cycles before meets the axis all but at rest, where the rounding of its position is a microsecond of its
/// motion.
#[test]
fn a_new_speed_about_the_end_of_a_stop_keeps_the_jerk() {
    let rapid = |machine: &mut Machine, rapid: f64| {
        machine
            .executor
            .set_overrides(Overrides { feed: 1.0, rapid });
    };
    let from = [20.0, -30.0, 1.0];
    for to in [
        [20.0, 19.5, 1.0],
        [20.0, -49.0, 1.0],
        [-50.0, -30.0, 1.0],
        [77.7, 19.5, -13.0],
    ] {
        for k in 2..30 {
            for before in 0..3 {
                let mut machine = Machine::at_rest(from);
                machine
                    .jog(Jog::Line {
                        to: to.map(Some),
                        speed: f64::INFINITY,
                    })
                    .unwrap();
                machine.cycles(k);
                rapid(&mut machine, 0.0);
                machine.cycles(3 * k - before);
                for more in 0..3 {
                    rapid(&mut machine, 0.05 + 0.01 * f64::from(more));
                    machine.cycles(1);
                }
                machine.executor.feed_hold();
                machine.until(|now| now.speed == 0.0 && !now.busy);
                machine.assert_well();
            }
        }
    }
}

#[test]
fn steps_add_up_and_cancel() {
    let mut machine = Machine::at_rest([0.0; 3]);
    for _ in 0..5 {
        machine.jog(step(1, 2.5)).unwrap();
        machine.cycles(20);
    }
    machine.jog(step(1, -5.0)).unwrap();
    machine.until(|now| !now.busy);
    assert_eq!(machine.now().position, [0.0, 7.5, 0.0]);
    machine.assert_well();
}

#[test]
fn a_jog_after_a_stop_after_the_block_and_before_a_retrace() {
    let mut machine = Machine::on_a_path();
    machine.cycles(1);
    machine.until(|now| now.distance >= 20.0);
    machine.executor.set_single_block(true);
    machine.cycles(50);
    machine.until(|now| now.speed == 0.0);
    let corner = machine.now().position;
    machine.jog(step(0, 20.0)).unwrap();
    // Neither changes what comes after the way back.
    machine.executor.set_overrides(Overrides {
        feed: 0.0,
        rapid: 0.5,
    });
    machine.executor.set_single_block(true);
    machine.cycles(1000);
    assert_eq!(machine.now().position[0], corner[0] + 20.0);
    machine.executor.set_overrides(Overrides {
        feed: 1.5,
        rapid: 0.5,
    });
    machine.executor.retrace();
    machine.cycles(10);
    assert!(!machine.executor.is_held());
    // In mid-return the operator wants to look again.
    machine.executor.feed_hold();
    machine.cycles(500);
    assert!(machine.executor.is_held() && machine.now().off_path);
    machine
        .jog(Jog::Continuous {
            axis: 1,
            velocity: 50.0,
        })
        .unwrap();
    machine.cycles(20);
    machine.executor.retrace();
    machine.cycles(3000);
    assert_eq!(machine.now().position, [0.0; 3]);
    assert!(machine.executor.is_held() && !machine.executor.is_off_path());
    machine.executor.set_single_block(false);
    machine.executor.resume();
    machine.end();
    assert_eq!(machine.now().position, [100.0, 60.0, 0.0]);
}

/// What an operator wants on the way back from a jog is done once it is over.
#[test]
fn orders_on_the_way_back_count() {
    let away = || {
        let mut machine = Machine::on_a_path();
        machine.cycles(1);
        machine.until(|now| now.distance >= 20.0);
        machine.executor.feed_hold();
        machine.until(|now| now.speed == 0.0);
        machine.jog(step(0, 20.0)).unwrap();
        machine.cycles(500);
        machine
    };
    let mut machine = away();
    machine.executor.resume();
    machine.cycles(10);
    machine.executor.set_single_block(true);
    machine.cycles(3000);
    assert!(machine.executor.is_held() && !machine.executor.is_off_path());
    // Both lines are one block.
    assert_eq!(machine.now().position, [100.0, 60.0, 0.0]);
    machine.executor.resume();
    machine.end();

    let mut machine = away();
    machine.executor.retrace();
    machine.cycles(10);
    machine.executor.resume();
    machine.end();
    assert_eq!(machine.now().position, [100.0, 60.0, 0.0]);

    // The last one counts, also where the path was retraced before.
    let mut machine = away();
    machine.executor.retrace();
    machine.cycles(3000);
    machine.jog(step(1, 5.0)).unwrap();
    machine.cycles(500);
    machine.executor.resume();
    machine.cycles(10);
    machine.executor.retrace();
    machine.cycles(3000);
    assert!(machine.executor.is_held() && !machine.executor.is_off_path());
    assert_eq!(machine.now().position, [0.0; 3]);
    machine.executor.resume();
    machine.end();
    assert_eq!(machine.now().position, [100.0, 60.0, 0.0]);
}

#[test]
fn a_stop_away_from_the_path_ends_there() {
    let mut machine = Machine::on_a_path();
    machine.cycles(1);
    machine.until(|now| now.distance >= 20.0);
    machine.executor.feed_hold();
    machine.until(|now| now.speed == 0.0);
    machine
        .jog(Jog::Line {
            to: [Some(0.0), Some(50.0), Some(-20.0)],
            speed: f64::INFINITY,
        })
        .unwrap();
    machine.cycles(100);
    let at = *machine.now();
    assert!(at.speed > 0.0);
    machine.executor.stop();
    assert!(!machine.executor.is_idle());
    machine.cycles(1);
    machine.end();
    assert!(machine.now().off_path && machine.now().speed == 0.0);
    assert_eq!(machine.jog(step(0, 1.0)), Err(JogError::Moving));
    // On the line, as far as the stop needs.
    let end = machine.now().position;
    assert!((end[1] / 50.0 - end[2] / -20.0).abs() < 1e-9, "{end:?}");
    assert!(end[1] > at.position[1] && end[1] < 50.0);
    machine.executor.restart([1.0; 3]);
    assert_eq!(machine.executor.setpoint().position, [1.0; 3]);
}

/// Along a line from a fixed place, with these speeds for so many cycles each.
fn assert_a_line_stays_a_line(to: [f64; 3], changes: &[(usize, f64)]) {
    let from = [20.0, -30.0, 1.0];
    let mut machine = Machine::at_rest(from);
    machine
        .jog(Jog::Line {
            to: to.map(Some),
            speed: f64::INFINITY,
        })
        .unwrap();
    for &(cycles, rapid) in changes {
        machine.cycles(cycles);
        machine
            .executor
            .set_overrides(Overrides { feed: 1.0, rapid });
    }
    machine.cycles(100);
    machine.executor.feed_hold();
    machine.until(|now| now.speed == 0.0 && !now.busy);
    machine.assert_well();
    for row in &machine.rows {
        let gone: [f64; 3] = std::array::from_fn(|i| row.position[i] - from[i]);
        let way: [f64; 3] = std::array::from_fn(|i| to[i] - from[i]);
        let length = way.iter().map(|x| x * x).sum::<f64>().sqrt();
        for (i, k) in [(0, 1), (1, 2), (2, 0)] {
            let off = (gone[i] * way[k] - gone[k] * way[i]) / length;
            assert!(off.abs() < 1e-9, "{off}: {row:?}");
        }
    }
}

/// A speed is asked for where the stop before all but ends in a cycle.
#[test]
fn a_line_stays_a_line_where_a_speed_comes_with_its_rest() {
    assert_a_line_stays_a_line(
        [0.0, 53.538_023_395_885_205, 0.0],
        &[(65, 0.727_516_531_325_710_6), (92, 0.0), (157, 0.05)],
    );
}

/// How long the motion from a state takes for one more unit in the last place of the position, at most, s: a new
/// plan begins so much later.
fn position_rounding(state: State) -> f64 {
    let unit = 2.0 * f64::EPSILON * state.p.abs();
    (unit / state.v.abs())
        .min((2.0 * unit / state.a.abs()).sqrt())
        .min((6.0 * unit / LIMITS.jerk[0]).cbrt())
}

/// A jog at that velocity is after so many cycles sent to a point.
fn assert_fastest(velocity: f64, after: usize, to: f64) {
    let mut machine = Machine::at_rest([50.0, 0.0, 0.0]);
    machine.jog(Jog::Continuous { axis: 0, velocity }).unwrap();
    machine.cycles(after);
    let now = *machine.now();
    let start = State {
        p: now.position[0],
        v: now.velocity[0],
        a: now.acceleration[0],
    };
    let problem = Problem::new(start, State::at_rest(to), axis_limits(0));
    let fastest = plan(&problem, 0.0).unwrap();
    assert!(verify::axis(&fastest, &problem).holds(1e-12));
    machine.jog(Jog::To([Some(to), None, None])).unwrap();
    let later = if now.speed == 0.0 {
        0.0
    } else {
        position_rounding(start)
    };
    let mut cycles = 0;
    while machine.executor.setpoint().busy {
        machine.cycles(1);
        cycles += 1;
        let State { p, v, a } = fastest.at(cycles as f64 * PERIOD);
        let now = machine.now();
        let room = v.abs() * later + a.abs() * later * later;
        assert!((now.position[0] - p).abs() < 1e-9 + room, "{now:?}");
        let room = a.abs() * later + LIMITS.jerk[0] * later * later;
        assert!((now.velocity[0] - v).abs() < 1e-6 + room, "{now:?}");
    }
    let least = (fastest.duration() / PERIOD).ceil() as usize;
    let most = ((fastest.duration() + later) / PERIOD).ceil() as usize;
    assert!((least..=most).contains(&cycles), "{cycles}");
    assert_eq!(machine.now().position, [to, 0.0, 0.0]);
    machine.assert_well();
}

/// The axis all but rests, and its position's rounding is a time that shows.
#[test]
fn from_all_but_rest_to_a_point_as_fast_as_the_axis_can() {
    assert_fastest(486.111_940_493_041_7, 365, 0.0);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(200) })]

    /// Whatever becomes of its speed on the way: slower, faster, a stop.
    #[test]
    fn a_line_stays_a_line(
        to in [ENDS[0].0..ENDS[0].1, ENDS[1].0..ENDS[1].1, ENDS[2].0..ENDS[2].1],
        changes in prop::collection::vec((0..300_usize, prop_oneof![Just(0.0), 0.05..=1.0_f64]), 1..5),
    ) {
        assert_a_line_stays_a_line(to, &changes);
    }

    /// From any running state, a jog reversed in mid-acceleration too: the fastest motion there is.
    #[test]
    fn from_any_state_to_a_point_as_fast_as_the_axis_can(
        velocity in prop_oneof![-500.0..-1.0_f64, 1.0..500.0_f64],
        after in 1..400_usize,
        to in ENDS[0].0..ENDS[0].1,
    ) {
        assert_fastest(velocity, after, to);
    }
}

/// What an operator does on the way back to the path.
#[derive(Debug, Clone, Copy)]
enum OnTheWay {
    Jog(Jog<3>),
    GoOn,
    Hold,
    Rapid(f64),
}

fn on_the_way() -> impl Strategy<Value = OnTheWay> {
    let at = |axis: usize| prop::option::weighted(0.7, ENDS[axis].0..=ENDS[axis].1);
    let places = (at(0), at(1), at(2)).prop_map(|(x, y, z)| [x, y, z]);
    let jog = prop_oneof![
        (0..3_usize, -20.0..20.0_f64).prop_map(|(axis, distance)| step(axis, distance)),
        places.clone().prop_map(Jog::To),
        places.prop_map(|to| Jog::Line {
            to,
            speed: f64::INFINITY,
        }),
    ];
    prop_oneof![
        3 => jog.prop_map(OnTheWay::Jog),
        5 => Just(OnTheWay::GoOn),
        1 => Just(OnTheWay::Hold),
        1 => prop_oneof![Just(1.0), 0.05..1.0_f64].prop_map(OnTheWay::Rapid),
    ]
}

/// The setpoints of a leg go sideways at the clearance or above it, and down no faster than they may, over
/// the place where the path was left.
fn assert_legs(rows: &[Setpoint<3>], left: &[f64; 3], retraction: &Retraction) {
    let clear = retraction.clearance.max(left[2]);
    for pair in rows.windows(2) {
        let [a, b] = [&pair[0], &pair[1]];
        let sideways = a.position[..2] != b.position[..2];
        let height = a.position[2].min(b.position[2]);
        assert!(!sideways || height >= clear - 1e-9, "{pair:?}");
        let down = b.position[2] < a.position[2] - 1e-12;
        if down {
            assert_eq!(b.position[..2], left[..2], "{pair:?}");
            assert!(b.velocity[2] >= -retraction.approach * (1.0 + 1e-9));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(100) })]

    #[test]
    fn the_way_back_lifts_off_goes_over_and_comes_down(
        held_at in 0.0..160.0_f64,
        clearance in -10.0..5.0_f64,
        approach in 1.0..50.0_f64,
        first in (0..3_usize, -20.0..20.0_f64),
        acts in prop::collection::vec((on_the_way(), 1..400_usize), 0..8),
    ) {
        let mut machine = Machine::on_a_path();
        let retraction = Retraction { axis: 2, clearance, approach };
        machine.executor.set_retraction(Some(retraction));
        machine.until(|now| now.distance >= held_at.min(159.0));
        machine.executor.feed_hold();
        machine.until(|now| now.speed == 0.0);
        let left = machine.now().position;
        machine.jog(step(first.0, first.1)).unwrap();
        for (act, cycles) in acts {
            let begun = machine.rows.len();
            let on_path = !machine.executor.is_off_path();
            match act {
                // What rests on the path again has been left for good.
                _ if on_path => break,
                OnTheWay::Jog(jog) => machine.jog(jog).unwrap(),
                // The leg that was shown is the one that comes.
                OnTheWay::GoOn => {
                    let shown = machine.executor.next_leg();
                    machine.executor.resume();
                    for _ in 0..cycles {
                        machine.cycles(1);
                        if machine.executor.next_leg().is_some() || !machine.now().off_path {
                            break;
                        }
                    }
                    let leads_on = shown.filter(|_| machine.executor.is_held());
                    if let Some(leg) = leads_on.filter(|_| machine.executor.is_off_path()) {
                        prop_assert!(!leg.last);
                        for axis in 0..3 {
                            let to = leg.to[axis].unwrap_or(machine.rows[begun - 1].position[axis]);
                            prop_assert_eq!(machine.now().position[axis], to);
                        }
                    }
                    if shown.is_some() {
                        let off = machine.rows[begun - 1..].iter().take_while(|row| row.off_path);
                        assert_legs(&off.copied().collect::<Vec<_>>(), &left, &retraction);
                    }
                }
                OnTheWay::Hold => machine.executor.feed_hold(),
                OnTheWay::Rapid(rapid) => machine.executor.set_overrides(Overrides {
                    rapid,
                    ..Overrides::default()
                }),
            }
            machine.cycles(cycles);
        }
        // From wherever that led to, three legs lead back at most.
        machine.executor.feed_hold();
        machine.until(|now| now.speed == 0.0);
        for legs in 0.. {
            machine.cycles(3);
            let shown = machine.executor.next_leg();
prop_assert!(shown.is_none() || legs < 3);
            let aside = machine.executor.is_off_path() && machine.now().position != left;
            prop_assert_eq!(shown.is_some(), aside, "{:?}", shown);
            let begun = machine.rows.len();
            machine.executor.resume();
            if shown.is_none() {
                break;
            }
            machine.cycles(3);
            machine.until(|now| now.speed == 0.0 || !now.off_path);
            machine.cycles(3);
            let off = machine.rows[begun - 1..].iter().take_while(|row| row.off_path);
            assert_legs(&off.copied().collect::<Vec<_>>(), &left, &retraction);
        }
        machine.end();
        prop_assert_eq!(machine.now().position, [100.0, 60.0, 0.0]);
        // What G61 allows at the corner.
        prop_assert!(machine.off_the_path() < 0.002, "{}", machine.off_the_path());
    }
}

/// What an operator does to a path with rests in it.
#[derive(Debug, Clone, Copy)]
enum Deed {
    Hold,
    Resume,
    Retrace,
    Pass,
    Jog(Jog<3>),
    EndJog(usize),
    Overrides(f64, f64),
    SingleBlock(bool),
}

fn deed() -> impl Strategy<Value = Deed> {
    let speed = prop_oneof![-200.0..-1.0_f64, 1.0..200.0_f64];
    let part = || prop_oneof![Just(0.0), Just(1.0), 0.05..1.0_f64];
    prop_oneof![
        4 => Just(Deed::Hold),
        5 => Just(Deed::Resume),
        1 => Just(Deed::Retrace),
        2 => Just(Deed::Pass),
        3 => (0..3_usize, -8.0..8.0_f64).prop_map(|(axis, distance)| Deed::Jog(step(axis, distance))),
        1 => (0..3_usize, speed).prop_map(|(axis, velocity)| Deed::Jog(Jog::Continuous { axis, velocity })),
        1 => (0..3_usize).prop_map(Deed::EndJog),
        1 => (part(), part()).prop_map(|(feed, rapid)| Deed::Overrides(feed, rapid)),
        1 => any::<bool>().prop_map(Deed::SingleBlock),
    ]
}

/// A rest between two moves of a path.
#[derive(Debug, Clone, Copy)]
enum Rest {
    Dwell(f64),
    Mark,
}

fn rests() -> impl Strategy<Value = Vec<Rest>> {
    let rest = prop_oneof![2 => (0.0..0.4_f64).prop_map(Rest::Dwell), 1 => Just(Rest::Mark)];
    prop::collection::vec(rest, 0..3)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(100) })]

    /// Nothing that is done beside a path, for however long, in a dwell or at a mark, has it jump or lose its end.
    #[test]
    fn a_path_with_rests_is_gone_to_its_end_whatever_is_done_in_them(
        moves in prop::collection::vec(([0.0..100.0_f64, 0.0..100.0, -20.0..0.0], rests()), 1..4),
        deeds in prop::collection::vec((deed(), 0..600_usize), 0..12),
    ) {
        let mut machine = Machine::at_rest([0.0; 3]);
        let mut end = [0.0; 3];
        let mut marks = 0;
        for (to, rests) in moves {
            let Ok(curve) = Curve::line(end, to) else { continue };
            machine.planner.push(PathItem::Move(Move {
                curve,
                feed: Feed::Rate(150.0),
                mode: PathControlMode::Exact(0.001),
                tag: 0,
            })).unwrap();
            end = to;
            for rest in rests {
                match rest {
                    Rest::Dwell(duration) => machine.planner.push(PathItem::Dwell { duration, tag: 0, block: None }).unwrap(),
                    Rest::Mark => {
                        marks += 1;
                        machine.planner.mark(marks);
                    }
                }
            }
        }
        machine.planner.finish();
        for (deed, cycles) in deeds {
            match deed {
                Deed::Hold => machine.executor.feed_hold(),
                Deed::Resume => machine.executor.resume(),
                Deed::Retrace => machine.executor.retrace(),
                Deed::Pass => machine.executor.pass(),
                // Refused where the path moves.
                Deed::Jog(jog) => drop(machine.jog(jog)),
                Deed::EndJog(axis) => machine.executor.end_jog(axis),
                Deed::Overrides(feed, rapid) => machine.executor.set_overrides(Overrides { feed, rapid }),
                Deed::SingleBlock(on) => machine.executor.set_single_block(on),
            }
            machine.cycles(cycles);
        }
        machine.executor.set_overrides(Overrides::default());
        machine.executor.set_single_block(false);
        for _ in 0..=2 * marks + 20 {
            machine.executor.resume();
            machine.executor.pass();
            machine.cycles(3_000);
        }
        machine.assert_well();
        prop_assert_eq!(machine.now().position, end);
        prop_assert!(!machine.now().busy, "{:?}", machine.now());
    }
}
