//! Properties of the planner that need no reference planner.

use crate::cases::{Case, Class, Rng, inside, is_inside};
use syncline_trajectory::limits::Limits;
use syncline_trajectory::profile::{Profile, State};
use syncline_trajectory::state_to_state::{Problem, plan};
use syncline_trajectory::synchronise::{self, Synchronisation};
use syncline_trajectory::verify;

/// How many cases a property held for, and how many not.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Count {
    /// Looked at.
    pub cases: u64,
    /// Against the property.
    pub broken: u64,
    /// Counted apart: see the property.
    pub apart: u64,
    /// The worst deviation among the others.
    pub worst: f64,
}

impl Count {
    fn take(&mut self, deviation: f64, tolerance: f64, apart: impl FnOnce() -> bool) {
        self.cases += 1;
        if deviation <= tolerance {
            self.worst = self.worst.max(deviation);
        } else if apart() {
            self.apart += 1;
        } else {
            self.broken += 1;
        }
    }
}

fn duration(case: &Case) -> f64 {
    plan(&Problem::new(case.start, case.target, case.limits), 0.0)
        .map_or(f64::NAN, |p| p.duration())
}

fn each(case: &Case, length: f64, time: f64) -> Case {
    let (v, a, j) = (
        length / time,
        length / time / time,
        length / time / time / time,
    );
    let state = |s: State| State {
        p: s.p * length,
        v: s.v * v,
        a: s.a * a,
    };
    let l = case.limits;
    Case {
        start: state(case.start),
        target: state(case.target),
        limits: Limits {
            v_max: l.v_max * v,
            v_min: l.v_min * v,
            a_max: l.a_max * a,
            a_min: l.a_min * a,
            j_max: l.j_max * j,
            j_min: l.j_min * j,
        },
    }
}

/// How durations answer a change of the question.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Metamorphic {
    /// Lengths and times scaled by powers of two: the same bits.
    pub powers: Count,
    /// Other scales: 1e-12 relative.
    pub scales: Count,
    /// Seen from the other side: 1e-12.
    pub mirror: Count,
    /// Elsewhere: 1e-9.
    pub shift: Count,
    /// Backwards in time, both ends inside the limits: 1e-12.
    pub reversal: Count,
}

/// Compares durations of related problems. Apart are cases whose duration itself moves by more than
/// the tolerance when the inputs move by one unit in the last place.
pub fn metamorphic(cases: u64, seed: u64) -> Metamorphic {
    let mut rng = Rng::new(seed);
    let mut m = Metamorphic::default();
    for i in 0..cases {
        let case = Class::ALL[(i % 12) as usize].draw(&mut rng);
        let t = duration(&case);
        // Every input is rounded anew where all are multiplied: what each moves adds up.
        let moves = |tolerance: f64| {
            let changes: [fn(&mut Case) -> &mut f64; 12] = [
                |c| &mut c.start.p,
                |c| &mut c.target.p,
                |c| &mut c.start.v,
                |c| &mut c.target.v,
                |c| &mut c.start.a,
                |c| &mut c.target.a,
                |c| &mut c.limits.v_max,
                |c| &mut c.limits.v_min,
                |c| &mut c.limits.a_max,
                |c| &mut c.limits.a_min,
                |c| &mut c.limits.j_max,
                |c| &mut c.limits.j_min,
            ];
            let moved = changes.iter().map(|change| {
                let moved = [true, false].map(|upwards| {
                    let mut near = case;
                    let x = change(&mut near);
                    *x = if upwards { x.next_up() } else { x.next_down() };
                    let moved = (duration(&near) - t).abs();
                    if moved.is_nan() { f64::INFINITY } else { moved }
                });
                moved[0].max(moved[1])
            });
            moved.sum::<f64>() > tolerance * t
        };
        let off = |other: f64, tolerance: f64, count: &mut Count| {
            let deviation = if other == t {
                0.0
            } else {
                ((other - t) / t).abs()
            };
            let deviation = if deviation.is_nan() {
                f64::INFINITY
            } else {
                deviation
            };
            count.take(deviation, tolerance, || moves(tolerance));
        };
        let power = |rng: &mut Rng| 2.0_f64.powi(rng.below(61) as i32 - 30);
        let (length, time) = (power(&mut rng), power(&mut rng));
        let scaled = duration(&each(&case, length, time)) / time;
        m.powers.take(
            if scaled.to_bits() == t.to_bits() {
                0.0
            } else {
                1.0
            },
            0.0,
            || false,
        );
        let (length, time) = (rng.log(1e-3, 1e3), rng.log(1e-3, 1e3));
        off(
            duration(&each(&case, length, time)) / time,
            1e-12,
            &mut m.scales,
        );
        let l = case.limits;
        let mirrored = Case {
            limits: Limits {
                v_max: -l.v_min,
                v_min: -l.v_max,
                a_max: -l.a_min,
                a_min: -l.a_max,
                j_max: -l.j_min,
                j_min: -l.j_max,
            },
            ..each(&case, -1.0, 1.0)
        };
        off(duration(&mirrored), 1e-12, &mut m.mirror);
        let by = rng.uniform(-10.0, 10.0);
        let mut shifted = case;
        shifted.start.p += by;
        shifted.target.p += by;
        // Only what the shift itself leaves of the distance is compared.
        let mut exact = shifted;
        exact.target.p = exact.start.p + (case.target.p - case.start.p);
        if exact.target.p - exact.start.p == case.target.p - case.start.p {
            off(duration(&exact), 1e-9, &mut m.shift);
        }
        if is_inside(&case.start, &case.limits) {
            let reversed = Case {
                start: State {
                    p: 0.0,
                    v: case.target.v,
                    a: -case.target.a,
                },
                target: State {
                    p: case.target.p - case.start.p,
                    v: case.start.v,
                    a: -case.start.a,
                },
                limits: Limits {
                    a_max: -l.a_min,
                    a_min: -l.a_max,
                    ..l
                },
            };
            let forward = Case {
                start: State {
                    p: 0.0,
                    ..case.start
                },
                target: State {
                    p: case.target.p - case.start.p,
                    ..case.target
                },
                ..case
            };
            let (a, b) = (duration(&forward), duration(&reversed));
            if b.is_nan() {
                // The start is inside by rounding only.
                m.reversal.apart += 1;
            } else {
                let deviation = if a == b { 0.0 } else { ((a - b) / a).abs() };
                m.reversal.take(deviation, 1e-12, || moves(1e-12));
            }
        }
    }
    m
}

/// Plans again from random points of own plans to targets at rest: how many arrive later than the
/// plan that they are on, by more than 1e-9 of its duration.
pub fn replanning(points: u64, seed: u64) -> Count {
    let mut rng = Rng::new(seed);
    let mut count = Count::default();
    while count.cases < points {
        let mut case = [Class::Generic, Class::RestToRest, Class::Asymmetric]
            [rng.below(3) as usize]
            .draw(&mut rng);
        (case.target.v, case.target.a) = (0.0, 0.0);
        let Ok(first) = plan(&Problem::new(case.start, case.target, case.limits), 0.0) else {
            continue;
        };
        let whole = first.duration();
        for _ in 0..20 {
            let t = rng.unit() * whole;
            let Ok(second) = plan(&Problem::new(first.at(t), case.target, case.limits), 0.0) else {
                count.cases += 1;
                count.broken += 1;
                continue;
            };
            let later = (t + second.duration() - whole) / whole;
            count.take(later.max(0.0), 1e-9, || false);
        }
    }
    count
}

/// Lowers the velocity limit in motion, at random cruise and accelerating states, the target beyond
/// the stopping distance: the velocity must come down to the limit without a dip below, and not
/// leave it until the last deceleration.
pub fn lowering(cases: u64, seed: u64) -> Count {
    let mut rng = Rng::new(seed);
    let mut count = Count::default();
    while count.cases < cases {
        let mut limits =
            Limits::symmetric(rng.log(0.1, 10.0), rng.log(0.1, 10.0), rng.log(0.1, 10.0));
        let share = if rng.chance(0.5) { 0.0 } else { 1.0 };
        let state = inside(&limits, &mut rng, share);
        let start = State {
            p: 0.0,
            v: state.v.abs(),
            a: state.a.abs(),
        };
        let lowered = start.v * rng.uniform(0.01, 0.99);
        if start.v + 0.5 * start.a * start.a / limits.j_max > limits.v_max {
            continue;
        }
        limits.v_max = lowered;
        let stop = |from: State| {
            plan(&Problem::to_velocity(from, 0.0, limits), 0.0).map_or(f64::NAN, |p| p.end().p)
        };
        let cruising = State {
            p: 0.0,
            v: lowered,
            a: 0.0,
        };
        let beyond = 4.0 * (stop(start) + stop(cruising)) + lowered;
        let problem = Problem::new(start, State::at_rest(beyond), limits);
        let Ok(profile) = plan(&problem, 0.0) else {
            count.take(f64::INFINITY, 0.0, || false);
            continue;
        };
        let certificate = verify::axis(&profile, &problem);
        // From the first instant at the limit to the last, nothing below it.
        let (mut t, mut lowest) = (0.0, f64::INFINITY);
        let mut last = 0.0;
        for (begin, segment) in profile.pieces() {
            if begin.v >= lowered * (1.0 - 1e-9) {
                last = t;
            }
            t += segment.duration;
        }
        let mut t = 0.0;
        for (begin, segment) in profile.pieces() {
            if t < last {
                for i in 0..=8 {
                    let s = begin.after(segment.duration * f64::from(i) / 8.0, segment.jerk);
                    lowest = lowest.min(s.v);
                }
            }
            t += segment.duration;
        }
        let dip = ((lowered - lowest) / start.v.max(-limits.v_min)).max(0.0);
        count.take(
            if certificate.holds(1e-12) {
                dip
            } else {
                f64::INFINITY
            },
            1e-12,
            || false,
        );
    }
    count
}

/// Random moves of three axes on a line, at rest or moving along it: straight to 1e-12, and as fast
/// as the one-dimensional problem on the narrowest limits.
pub fn lines(cases: u64, seed: u64) -> Count {
    let mut rng = Rng::new(seed);
    let mut count = Count::default();
    for _ in 0..cases {
        let along = [(); 3].map(|()| rng.uniform(-100.0, 100.0));
        let limits = [(); 3].map(|()| Limits {
            v_min: -rng.log(0.1, 10.0),
            a_min: -rng.log(0.1, 10.0),
            ..Limits::symmetric(rng.log(0.1, 10.0), rng.log(0.1, 10.0), rng.log(0.1, 10.0))
        });
        let narrow = (0..3)
            .map(|i| limits[i].projected(along[i]))
            .reduce(|a, b| a.intersection(&b))
            .unwrap_or(limits[0]);
        let rest = rng.chance(0.3);
        let s = inside(&narrow, &mut rng, if rest { 0.0 } else { 1.0 });
        let (v, a) = if rest { (0.0, 0.0) } else { (s.v, s.a) };
        let target = if rng.chance(0.5) {
            0.0
        } else {
            0.5 * narrow.v_max
        };
        let axes: [Problem; 3] = [0, 1, 2].map(|i| {
            let p = rng.uniform(-100.0, 100.0);
            let start = State {
                p,
                v: v * along[i],
                a: a * along[i],
            };
            let target = State {
                p: p + along[i],
                v: target * along[i],
                a: 0.0,
            };
            Problem::new(start, target, limits[i])
        });
        let mut profiles = axes.map(|a| Profile::new(a.start));
        let Ok(duration) = synchronise::plan(&axes, Synchronisation::Line, 0.0, &mut profiles)
        else {
            count.take(f64::INFINITY, 0.0, || false);
            continue;
        };
        let one = Problem::new(
            State { p: 0.0, v, a },
            State {
                p: 1.0,
                v: target,
                a: 0.0,
            },
            narrow,
        );
        let shortest = plan(&one, 0.0).map_or(f64::NAN, |p| p.duration());
        let targets = axes.map(|a| match a.target {
            syncline_trajectory::state_to_state::Target::State(s) => s,
            syncline_trajectory::state_to_state::Target::Velocity { .. } => a.start,
        });
        let bent = verify::straightness(&profiles, &targets);
        let sound = axes
            .iter()
            .zip(&profiles)
            .all(|(a, p)| verify::axis(p, a).holds(1e-12));
        let slow = ((duration - shortest) / shortest).abs();
        let worst = if sound && slow <= 1e-9 {
            bent
        } else {
            f64::INFINITY
        };
        count.take(worst, 1e-12, || false);
    }
    count
}

/// Durations beside brute force: on a lattice of whole time steps with jerk −1, 0 or 1 in each,
/// accelerations and velocities are whole numbers, and dynamic programming finds for each number of
/// steps and every end state the greatest and the smallest displacement of all sequences there are.
/// Broken is a case for which some sequence arrives before our plan; `worst` is by how much of its
/// duration our plan was ahead of the first sequence that arrives, at most.
pub fn brute_force(cases: u64, seed: u64) -> (Count, f64) {
    const STEPS: usize = 48;
    let mut rng = Rng::new(seed);
    let mut count = Count::default();
    let mut ahead = 0.0;
    while count.cases < cases {
        // Velocities in halves, displacements in sixths.
        let a_max = 1 + rng.below(4) as i64;
        let w_max = 4 + rng.below(40) as i64;
        let draw = |rng: &mut Rng| {
            let a = rng.below(2 * a_max as u64 + 1) as i64 - a_max;
            let w = rng.below(2 * w_max as u64 + 1) as i64 - w_max;
            (a, w)
        };
        // Full jerk keeps a start inside: v ± a²/2 in halves is w ± a².
        let fits = |a: i64, w: i64| (w + a * a.abs()).abs() <= w_max;
        let (start, target) = (draw(&mut rng), draw(&mut rng));
        if !fits(start.0, start.1) || !fits(-target.0, target.1) {
            continue;
        }
        let width = (2 * w_max + 1) as usize;
        let index = |a: i64, w: i64| (a + a_max) as usize * width + (w + w_max) as usize;
        let size = (2 * a_max + 1) as usize * width;
        let mut reach = vec![None; size];
        reach[index(start.0, start.1)] = Some((0_i64, 0_i64));
        let mut ranges = [None; STEPS + 1];
        ranges[0] = reach[index(target.0, target.1)];
        for range in ranges.iter_mut().skip(1) {
            let mut next: Vec<Option<(i64, i64)>> = vec![None; size];
            for a in -a_max..=a_max {
                for w in -w_max..=w_max {
                    let Some((low, high)) = reach[index(a, w)] else {
                        continue;
                    };
                    for j in -1..=1 {
                        let (b, x) = (a + j, w + 2 * a + j);
                        if b.abs() > a_max || x.abs() > w_max {
                            continue;
                        }
                        let step = 3 * w + 3 * a + j;
                        let slot = &mut next[index(b, x)];
                        let (l, h) = slot.unwrap_or((i64::MAX, i64::MIN));
                        *slot = Some((l.min(low + step), h.max(high + step)));
                    }
                }
            }
            reach = next;
            *range = reach[index(target.0, target.1)];
        }
        let chosen = 1 + rng.below(STEPS as u64) as usize;
        let Some((low, high)) = ranges[chosen] else {
            continue;
        };
        let distance = low + rng.below((high - low + 1) as u64) as i64;
        let Some(first) = ranges
            .iter()
            .position(|r| r.is_some_and(|(low, high)| low <= distance && distance <= high))
        else {
            continue;
        };
        let state = |p: i64, (a, w): (i64, i64)| State {
            p: p as f64 / 6.0,
            v: w as f64 / 2.0,
            a: a as f64,
        };
        let limits = Limits::symmetric(w_max as f64 / 2.0, a_max as f64, 1.0);
        let case = Case {
            start: state(0, start),
            target: state(distance, target),
            limits,
        };
        let ours = duration(&case);
        let late = (ours - first as f64) / (first as f64).max(1.0);
        count.take(
            if late.is_nan() {
                f64::INFINITY
            } else {
                late.max(0.0)
            },
            1e-9,
            || false,
        );
        ahead += (-late).max(0.0);
    }
    (count, ahead / count.cases as f64)
}
