//! Circles whose errors have a closed form.

use super::*;
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};
use syncline_trajectory::path::curve::ArcDefinition;
use syncline_trajectory::path::{Arc, Plane};

/// s
const CYCLE: f64 = 0.001;
/// Of the straight ways to the circle and from it, mm.
const STRAIGHT: f64 = 5.0;

/// A program: along a tangent onto a circle, round it, and away along a tangent.
#[derive(Clone, Debug)]
struct Test {
    plane: Plane,
    clockwise: bool,
    centre: (f64, f64),
    radius: f64,
    /// mm/s
    feed: f64,
    /// Where the circle begins, rad.
    from: f64,
    /// By how much its arcs turn, in parts of a turn.
    arcs: Vec<f64>,
    /// How far the tool is behind along the path, s.
    lag: f64,
}

impl Test {
    fn sense(&self) -> f64 {
        if self.clockwise { -1.0 } else { 1.0 }
    }

    fn place(&self, x: f64, y: f64) -> Position {
        let (one, other) = self.plane.axes();
        let mut place = Position::default();
        (place[one], place[other]) = (self.centre.0 + x, self.centre.1 + y);
        place
    }

    /// A place on the circle.
    fn on(&self, gone: f64) -> Position {
        let (sin, cos) = (self.from + self.sense() * gone).sin_cos();
        self.place(self.radius * cos, self.radius * sin)
    }

    /// The arcs, as a program states them.
    fn circles(&self) -> Vec<Circle> {
        let mut gone = 0.0;
        let each = self.arcs.iter().map(|&part| {
            let start = self.on(gone);
            gone += part * TAU;
            let whole = (part - 1e-9).floor();
            let end = if part == whole + 1.0 {
                start
            } else {
                self.on(gone)
            };
            let (one, other) = self.plane.axes();
            let centre = self.place(0.0, 0.0);
            let arc = Arc::new(ArcDefinition {
                start,
                end,
                plane: self.plane,
                centre: (centre[one], centre[other]),
                clockwise: self.clockwise,
                turns: whole as u32,
            });
            arc.unwrap().circle(SAME).unwrap()
        });
        each.collect()
    }

    /// Where the path is so far from the circle's beginning, mm.
    fn path(&self, along: f64) -> Position {
        let length = self.radius * TAU * self.arcs.iter().sum::<f64>();
        let on = self.on(along.clamp(0.0, length) / self.radius);
        let beyond = along - along.clamp(0.0, length);
        let (sin, cos) =
            (self.from + self.sense() * along.clamp(0.0, length) / self.radius).sin_cos();
        let (one, other) = self.plane.axes();
        let mut place = on;
        place[one] -= self.sense() * beyond * sin;
        place[other] += self.sense() * beyond * cos;
        place
    }

    /// Takes it up, with what the machine makes of a place of the path, as a function of the coordinates from the centre; what is wrong
    /// with it.
    fn run(
        &self,
        circles: &mut Circles,
        mut machine: impl FnMut([f64; 2]) -> [f64; 2],
    ) -> Vec<Violation> {
        let mut violations = Kept::default();
        let arcs = self.circles();
        let mut ends = vec![0.0];
        for part in &self.arcs {
            ends.push(ends[ends.len() - 1] + part * TAU * self.radius);
        }
        let length = ends[self.arcs.len()];
        let (one, other) = self.plane.axes();
        let mut move_at_work = usize::MAX;
        // Until the tool, too, has left it.
        let steps = ((length + 2.0 * STRAIGHT) / self.feed + self.lag) / CYCLE;
        for step in 0..steps as u64 {
            let time = step as f64 * CYCLE;
            let along = time * self.feed - STRAIGHT;
            let setpoint = self.path(along);
            let at_work = ends.partition_point(|it| *it <= along);
            if at_work != move_at_work {
                move_at_work = at_work;
                let circle = at_work.checked_sub(1).and_then(|it| arcs.get(it)).copied();
                circles.go_on(circle, &setpoint, time, &mut violations);
            }
            let mut tool = self.path(along - self.feed * self.lag);
            let from = [tool[one] - self.centre.0, tool[other] - self.centre.1];
            let made = machine(from);
            (tool[one], tool[other]) = (self.centre.0 + made[0], self.centre.1 + made[1]);
            let at = Place {
                time,
                line: at_work as u32,
            };
            let cycle = Cycle {
                at,
                feed: self.feed,
                speed: self.feed,
            };
            circles.look(&setpoint, &tool, &cycle, &mut violations);
        }
        circles.close(&mut violations);
        violations.end().0
    }

    /// What it comes to.
    fn told(&self, machine: impl FnMut([f64; 2]) -> [f64; 2]) -> Vec<CircleSummary> {
        let mut circles = unlimited();
        self.run(&mut circles, machine);
        circles.told.end().0
    }
}

fn unlimited() -> Circles {
    Circles {
        tolerance: f64::INFINITY,
        ..Circles::default()
    }
}

/// Backlash of each axis: the tool stays until the drive has gone through it.
fn play(of: [f64; 2]) -> impl FnMut([f64; 2]) -> [f64; 2] {
    let mut held: Option<[f64; 2]> = None;
    move |at| {
        let last = held.unwrap_or(at);
        let now = [0, 1].map(|n| last[n].clamp(at[n] - 0.5 * of[n], at[n] + 0.5 * of[n]));
        held = Some(now);
        now
    }
}

fn near(one: f64, other: f64, within: f64) -> Result<(), TestCaseError> {
    prop_assert!(
        (one - other).abs() <= within,
        "{one} is not {other} ± {within}"
    );
    Ok(())
}

/// Whole turns, as one arc or as many.
fn whole() -> impl Strategy<Value = Vec<f64>> {
    prop_oneof![
        (1..4_u32).prop_map(|turns| vec![f64::from(turns)]),
        Just(vec![0.5; 2]),
        Just(vec![0.25; 4]),
        Just(vec![0.25; 8]),
        Just(vec![0.7, 0.3]),
    ]
}

fn tests(arcs: impl Strategy<Value = Vec<f64>>) -> impl Strategy<Value = Test> {
    let plane = prop_oneof![Just(Plane::Xy), Just(Plane::Zx), Just(Plane::Yz)];
    let centre = (-200.0..200.0_f64, -200.0..200.0_f64);
    // Up to 3° a cycle.
    let size = (1.0..150.0_f64, 0.02..3.0_f64).prop_map(|(radius, degrees)| {
        let feed = (radius * degrees.to_radians() / CYCLE).min(400.0);
        (radius, feed)
    });
    let lag = prop_oneof![Just(0.0), 0.0..0.02_f64];
    (plane, any::<bool>(), centre, size, 0.0..TAU, arcs, lag).prop_map(
        |(plane, clockwise, centre, (radius, feed), from, arcs, lag)| Test {
            plane,
            clockwise,
            centre,
            radius,
            feed,
            from,
            arcs,
            // No more than half a turn.
            lag: lag.min(2.5 * radius / feed),
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    /// A tool that is late on the path, and nothing else, goes round each turn of it, whatever it is and however it is programmed. About
    /// another centre and with another radius it is as round.
    #[test]
    fn an_ideal_circle_has_no_errors(
        test in tests(whole()), aside in (-0.1..0.1_f64, -0.1..0.1_f64), greater in -0.05..0.05_f64,
    ) {
        let turns = test.arcs.iter().sum::<f64>().round() as usize;
        let (one, other) = test.plane.axes();
        for (x, y, greater) in [(0.0, 0.0, 0.0), (aside.0, aside.1, greater)] {
            let scale = 1.0 + greater / test.radius;
            let told = test.told(|at| [scale * at[0] + x, scale * at[1] + y]);
            prop_assert_eq!(told.len(), turns);
            for (n, it) in told.iter().enumerate() {
                prop_assert_eq!((it.turn, it.clockwise), (n as u64 + 1, test.clockwise));
                prop_assert_eq!(it.plane.chars().map(|it| it as usize - 'X' as usize).collect::<Vec<_>>(), [one, other]);
                near(it.radius_mm, test.radius, 1e-9)?;
                near(it.feed_mm_min, 60.0 * test.feed, 1e-6)?;
                near(it.speed_mm_min, 60.0 * test.feed, 1e-6)?;
                near(it.centre_mm[0], test.centre.0, 1e-9)?;
                // Of the second order, and half of a chord's rise between samples that are far apart.
                let shift = x.hypot(y);
                let within = 1e-9 + shift * shift / test.radius + 1e-3 * shift;
                near(it.circular_deviation_mm, 0.0, within)?;
                near(it.mean_deviation_mm, greater, within)?;
                near(it.centre_off_mm[0], x, within)?;
                near(it.centre_off_mm[1], y, within)?;
                near(it.radial_deviation_mm[0], greater - shift, within)?;
                near(it.radial_deviation_mm[1], greater + shift, within)?;
                for it in &it.reversals {
                    near(it.error_mm, 0.0, within)?;
                }
                // One turn has as much of its circle before and behind as it takes for all but one.
                prop_assert!(it.reversals.len() >= 3, "{:?}", it.reversals);
                prop_assert!(it.both_ways.is_none());
            }
            // In the middle of three turns all of it is seen.
            prop_assert!(turns < 3 || told[1].reversals.len() == 4);
        }
    }

    /// The tool stays out where an axis turns back, by its backlash; a quarter of a turn further it is as far in, so that both ways
    /// are apart by that.
    #[test]
    fn backlash_is_what_reversals_and_hysteresis_tell(
        mut test in tests(Just(vec![3.0])), of in (0.0..0.04_f64, 0.0..0.04_f64),
    ) {
        test.radius = test.radius.max(20.0);
        test.feed = test.feed.max(0.02 * test.radius);
        let of = [of.0, of.1];
        let (one, other) = test.plane.axes();
        let mut circles = unlimited();
        for clockwise in [true, false] {
            test.clockwise = clockwise;
            test.run(&mut circles, play(of));
        }
        let told = circles.told.end().0;
        prop_assert_eq!(told.len(), 6);
        let most = of[0].max(of[1]);
        for it in told.iter().filter(|it| it.turn == 2) {
            prop_assert_eq!(it.reversals.len(), 4);
            for it in &it.reversals {
                let own = if it.axis == ["X", "Y", "Z"][one] { of[0] } else { of[1] };
                prop_assert!(it.axis == ["X", "Y", "Z"][one] || it.axis == ["X", "Y", "Z"][other]);
                // The other axis's play makes a slope of what this one's leaves, and the way before bends.
                near(it.error_mm, own, 1e-6 + 0.02 * own + 0.05 * most)?;
            }
            // A half of each, at most both.
            let [least, out] = it.radial_deviation_mm;
            prop_assert!(out <= 0.5 * of[0].hypot(of[1]) + 1e-6 && out >= 0.45 * most, "{it}");
            prop_assert!(least >= -0.5 * of[0].hypot(of[1]) - 1e-6, "{it}");
        }
        let both = told[4].both_ways.unwrap();
        // Until one axis has gone through its play the other goes on.
        let within = of[0].min(of[1]) * (2.0 * most / test.radius).sqrt();
        near(both.hysteresis_mm, most, 1e-6 + 0.02 * most + 1.5 * within)?;
        prop_assert!(told[1].both_ways.is_none() && both.with_time_s == told[1].at.time);
        // Both ways are symmetrical about the circle.
        near(both.mean_deviation_mm, 0.0, 0.03 * most + 1e-6)?;
        // But for what the other centre makes of it.
        let one = told[4].circular_deviation_mm;
        prop_assert!(both.circular_deviation_mm >= one - 0.1 * most - 1e-9);
    }

    /// Axes that are out of square by an angle, or of which one goes too far, make an ellipse, whose axes differ by that part of the
    /// diameter; the same both ways.
    #[test]
    fn an_ellipse_is_as_wide_as_its_axes_differ(
        test in tests(Just(vec![1.0])), part in 1e-6..2e-4_f64, greater in any::<bool>(),
    ) {
        let machine = |at: [f64; 2]| match greater {
            true => [(1.0 + part) * at[0], at[1]],
            false => [at[0] + part * at[1], at[1]],
        };
        let mut circles = unlimited();
        for clockwise in [false, true] {
            Test { clockwise, ..test.clone() }.run(&mut circles, machine);
        }
        let told = circles.told.end().0;
        let wide = part * test.radius;
        // Up to 3° are not seen at either end, which pulls the centre; and of the second order.
        let within = wide * (0.03 + 2.0 * part);
        for it in &told {
            near(it.circular_deviation_mm, wide, within)?;
            let [least, most] = it.radial_deviation_mm;
            let from = if greater { 0.0 } else { -0.5 * wide };
            near(least, from, within)?;
            near(most, from + wide, within)?;
            near(it.mean_deviation_mm, from + 0.5 * wide, within)?;
            // It is smooth: what bends of it within 15°.
            for it in &it.reversals {
                near(it.error_mm, 0.0, 0.16 * wide)?;
            }
        }
        near(told[1].both_ways.unwrap().hysteresis_mm, 0.0, within)?;
    }

    /// Axes that lag by a first order each go round a circle that is smaller by R (1 − 1 / √(1 + (v T / R)²)), with no other error.
    #[test]
    fn a_lag_makes_the_radius_less(test in tests(Just(vec![3.0])), lag in 0.001..0.02_f64) {
        let turning = test.feed / test.radius * lag;
        let part = 1.0 / turning.hypot(1.0);
        let (sin, cos) = (turning.atan() * test.sense()).sin_cos();
        let told = Test { lag: 0.0, ..test.clone() }.told(|at| {
            [part * (cos * at[0] + sin * at[1]), part * (cos * at[1] - sin * at[0])]
        });
        let less = test.radius * (1.0 - part);
        prop_assert!(!told.is_empty());
        for it in told.iter().filter(|it| it.turn == 2) {
            near(it.mean_deviation_mm, -less, 1e-9)?;
            near(it.circular_deviation_mm, 0.0, 1e-9)?;
        }
    }

    /// Less than a turn is none, and what is behind the last whole one is not either.
    #[test]
    fn arcs_that_do_not_come_round_are_none(
        test in tests(Just(vec![1.0])), parts in prop::collection::vec(0.05..0.45_f64, 1..8),
    ) {
        let turns = parts.iter().sum::<f64>();
        prop_assume!((turns - turns.round()).abs() > 0.01);
        let told = Test { arcs: parts, ..test }.told(|at| at);
        prop_assert_eq!(told.len(), turns as usize);
    }
}

/// What a spike does that is between two parts, and where it is told.
#[test]
fn a_spike_behind_a_reversal_is_told_there() {
    for (clockwise, quarter) in [false, true]
        .into_iter()
        .flat_map(|it| (0..4).map(move |n| (it, n)))
    {
        let test = Test {
            plane: Plane::Xy,
            clockwise,
            centre: (10.0, -20.0),
            radius: 50.0,
            feed: 50.0,
            from: PI / 4.0,
            arcs: vec![1.0],
            lag: 0.01,
        };
        let sense = test.sense();
        let told = test.told(|at| {
            let behind = wrapped(at[1].atan2(at[0]) - f64::from(quarter) * FRAC_PI_2) * sense;
            let off = if (0.001..0.01).contains(&behind) {
                0.008
            } else {
                0.0
            };
            at.map(|it| it * (1.0 + off / 50.0))
        });
        let names = ["X+", "Y+", "X-", "Y-"];
        assert_eq!(told[0].reversals.len(), 4);
        for it in &told[0].reversals {
            let is_there = format!("{}{}", it.axis, it.side) == names[quarter as usize];
            let spike = if is_there { 0.008 } else { 0.0 };
            assert!(
                (it.error_mm - spike).abs() < 1e-5,
                "{clockwise} {quarter} {it:?}"
            );
        }
        assert!(
            (told[0].circular_deviation_mm - 0.008).abs() < 1e-4,
            "{}",
            told[0]
        );
    }
}

/// A deviation beyond the tolerance is a violation, each in its place.
#[test]
fn a_tolerance_is_kept_or_not() {
    let test = Test {
        plane: Plane::Zx,
        clockwise: true,
        centre: (0.0, 0.0),
        radius: 30.0,
        feed: 40.0,
        from: 1.0,
        arcs: vec![0.5; 4],
        lag: 0.0,
    };
    for (tolerance, count) in [(0.0301, 0), (0.0299, 2)] {
        let mut circles = Circles {
            tolerance,
            ..Circles::default()
        };
        // Out of square by 1 mrad.
        let told = test.run(&mut circles, |at| [at[0] + 1e-3 * at[1], at[1]]);
        assert_eq!(told.len(), count, "{told:?}");
        for it in told {
            assert_eq!((&*it.what, it.limit), ("circular_deviation", tolerance));
            assert!((it.value - 0.03).abs() < 1e-4);
        }
    }
}
