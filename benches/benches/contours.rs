//! Motion along six named paths beside `copp`'s third-order LP, iterated and refined until its time
//! stands still and then stretched until no limit is exceeded between its points, and beside simpler
//! parametrisations: `cargo bench -p syncline-benches --features measure --bench contours -- [PART OF A NAME]`.

use copp::path::{Path, PathEvaluator2nd, PathEvaluator3rd};
use copp::robot::Robot;
use copp::solver::topp2_ra::{ReachSet2OptionsBuilder, Topp2ProblemBuilder, topp2_ra};
use copp::solver::topp3_lp::{ClarabelOptionsBuilder, Topp3ProblemBuilder, s_to_t_topp3, topp3_lp};
use syncline_benches::contours::{Contour, Plan, excess, six_axes, three_axes};
use syncline_controller::realtime::thread_time;
use syncline_trajectory::path::time_parametrisation::{
    Cell, NodeState, Slope, TimeParametrisation,
};
use syncline_trajectory::path::{Derivatives, Limits, PathControlMode, PathSegment};

/// A section's geometry, by path length.
#[derive(Clone)]
struct Geometry<const N: usize>(Vec<PathSegment<N>>);

impl<const N: usize> Geometry<N> {
    fn path_segment(&self, s: f64) -> &PathSegment<N> {
        let index = self
            .0
            .partition_point(|path_segment| path_segment.start <= s);
        &self.0[index.max(1) - 1]
    }

    fn at(&self, s: f64) -> Derivatives<N> {
        let path_segment = self.path_segment(s);
        path_segment.curve.at(s - path_segment.start)
    }

    fn length(&self) -> f64 {
        self.0.last().map_or(0.0, |s| s.start + s.curve.length())
    }

    /// Greatest path speed by feed and axis velocities.
    fn fast(&self, s: f64, limits: &Limits<N>) -> f64 {
        let at = self.at(s);
        (0..N)
            .map(|i| limits.velocity[i] / at.d1[i].abs())
            .fold(self.path_segment(s).feed, f64::min)
    }

    /// Least time by velocities alone.
    fn velocity_time(&self, limits: &Limits<N>) -> f64 {
        const PARTS: usize = 100_000;
        let step = self.length() / PARTS as f64;
        (0..PARTS)
            .map(|k| step / self.fast((k as f64 + 0.5) * step, limits))
            .sum()
    }
}

impl<const N: usize> PathEvaluator2nd for Geometry<N> {
    fn dim(&self) -> usize {
        N
    }

    fn evaluate_up_to_2nd(
        &self,
        s: &[f64],
        q: &mut [f64],
        dq: &mut [f64],
        ddq: &mut [f64],
    ) -> Result<(), copp::diag::PathError> {
        for (k, &s) in s.iter().enumerate() {
            let at = self.at(s);
            let column = k * N..(k + 1) * N;
            q[column.clone()].copy_from_slice(&at.q);
            dq[column.clone()].copy_from_slice(&at.d1);
            ddq[column].copy_from_slice(&at.d2);
        }
        Ok(())
    }
}

impl<const N: usize> PathEvaluator3rd for Geometry<N> {
    fn evaluate_up_to_3rd(
        &self,
        s: &[f64],
        q: &mut [f64],
        dq: &mut [f64],
        ddq: &mut [f64],
        dddq: &mut [f64],
    ) -> Result<(), copp::diag::PathError> {
        self.evaluate_up_to_2nd(s, q, dq, ddq)?;
        for (k, &s) in s.iter().enumerate() {
            dddq[k * N..(k + 1) * N].copy_from_slice(&self.at(s).d3);
        }
        Ok(())
    }
}

/// Points along the path at equal distances.
fn even<const N: usize>(geometry: &Geometry<N>, points: usize) -> Vec<f64> {
    let length = geometry.length();
    (0..points)
        .map(|k| length * k as f64 / (points - 1) as f64)
        .collect()
}

/// Points along the path, half of them by time and half by length: corners are small and slow.
fn grid<const N: usize>(plan: &Plan<N>, points: usize) -> Vec<f64> {
    let (_, last) = plan.segments[plan.segments.len() - 1];
    let (time, length) = (plan.time(), last.distance + last.at(last.duration).0);
    let mut grid = Vec::with_capacity(points);
    let mut segments = plan.segments.iter().map(|(_, segment)| segment).peekable();
    let (mut since, mut s) = (0.0, 0.0);
    // Where half the share of the time and half that of the length come to k parts.
    for k in 0..points - 1 {
        let wanted = k as f64 / (points - 1) as f64;
        while let Some(segment) = segments.peek() {
            let share = |t: f64| {
                let s = segment.distance + segment.at(t).0;
                (0.5 * ((since + t) / time + s / length), s)
            };
            if share(segment.duration).0 < wanted {
                since += segment.duration;
                segments.next();
                continue;
            }
            let (mut low, mut high) = (0.0, segment.duration);
            for _ in 0..50 {
                let middle = 0.5 * (low + high);
                if share(middle).0 < wanted {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            s = share(low).1;
            break;
        }
        grid.push(if k == 0 { 0.0 } else { s });
    }
    grid.push(length);
    grid
}

/// The reference's parametrisation over a grid: ṡ² and s̈ at its points.
struct Reference {
    s: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    time: f64,
    passes: usize,
    /// Time of its second-order parametrisation.
    second_order: f64,
    /// Wall time from the grid to the parametrisation, s.
    took: f64,
}

fn reference<const N: usize>(
    geometry: &Geometry<N>,
    limits: &Limits<N>,
    s: Vec<f64>,
    most_passes: usize,
) -> Option<Reference> {
    let (points, length) = (s.len(), geometry.length());
    let path = Path::from_evaluator_3rd(geometry.clone(), 0.0, length).ok()?;
    let begin = thread_time();
    let mut robot = Robot::with_capacity(N, points);
    let minus = |x: &[f64; N]| x.map(|x| -x);
    let (v, a, j) = (&limits.velocity, &limits.acceleration, &limits.jerk);
    robot
        .with_s(s.as_slice())
        .ok()?
        .with_q_from_path_3rd(&path, 0, points)
        .ok()?
        .with_axial_velocity((v.as_slice(), points), (minus(v).as_slice(), points), 0)
        .ok()?
        .with_axial_acceleration((a.as_slice(), points), (minus(a).as_slice(), points), 0)
        .ok()?
        .with_axial_jerk((j.as_slice(), points), (minus(j).as_slice(), points), 0)
        .ok()?;
    let fast: Vec<f64> = s
        .iter()
        .map(|&s| geometry.fast(s, limits).powi(2))
        .collect();
    robot.constraints.amax_substitute(&fast, 0).ok()?;
    let second = {
        let problem = Topp2ProblemBuilder::new(&robot, (0, points - 1), (0.0, 0.0))
            .build()
            .ok()?;
        topp2_ra(&problem, &ReachSet2OptionsBuilder::new().build().ok()?).ok()?
    };
    let second_order = s
        .windows(2)
        .zip(second.windows(2))
        .map(|(s, w)| 2.0 * (s[1] - s[0]) / (w[0].sqrt() + w[1].sqrt()))
        .sum();
    robot.constraints.amax_substitute(&second, 0).ok()?;
    let options = ClarabelOptionsBuilder::new()
        .allow_almost_solved(true)
        .build()
        .ok()?;
    let mut about = second;
    let mut best: Option<Reference> = None;
    for passes in 1..=most_passes {
        let problem = Topp3ProblemBuilder::new(&mut robot, 0, &about, (0.0, 0.0), (0.0, 0.0))
            .build_with_linearization()
            .ok()?;
        let Ok(profile) = topp3_lp(&problem, &options) else {
            break;
        };
        let (time, _) = s_to_t_topp3(&s, profile.as_parts(), 0.0).ok()?;
        about.clone_from(&profile.a);
        let still = best.as_ref().is_some_and(|b| (b.time - time).abs() < 1e-6);
        best = Some(Reference {
            s: s.clone(),
            a: profile.a,
            b: profile.b,
            time,
            passes,
            second_order,
            took: (thread_time() - begin).as_secs_f64(),
        });
        if still {
            break;
        }
    }
    best
}

impl Reference {
    /// How much longer it has to last for its limits to hold between its points, too: s̈ is linear
    /// in s there; at the ends, where the path rests, the jerk is constant.
    fn stretch<const N: usize>(&self, geometry: &Geometry<N>, limits: &Limits<N>) -> f64 {
        let mut worst = [0.0; 3];
        let last = self.s.len() - 2;
        for k in 0..=last {
            let ds = self.s[k + 1] - self.s[k];
            let slope = (self.b[k + 1] - self.b[k]) / ds;
            const PARTS: usize = 8;
            for i in 0..=PARTS {
                let x = ds * i as f64 / PARTS as f64;
                let state = if k == 0 || k == last {
                    // ṡ = j t²/2 and s = j t³/6
                    let v = self.a[if k == 0 { 1 } else { k }].sqrt();
                    let t = 3.0 * ds / v;
                    let jerk = 2.0 * v / (t * t);
                    let from = if k == 0 { x } else { ds - x };
                    let since = (6.0 * from / jerk).cbrt();
                    let a = jerk * since * if k == 0 { 1.0 } else { -1.0 };
                    [0.5 * jerk * since * since, a, jerk]
                } else {
                    let w = self.a[k] + 2.0 * self.b[k] * x + slope * x * x;
                    let v = w.max(0.0).sqrt();
                    [v, self.b[k] + slope * x, slope * v]
                };
                let at = self.s[k] + x * (1.0 - 1e-9) + 1e-12 * ds;
                worst[0] = f64::max(worst[0], state[0] / geometry.path_segment(at).feed);
                excess(&geometry.at(at), state, limits, &mut worst);
            }
        }
        worst[0].max(worst[1].sqrt()).max(worst[2].cbrt()).max(1.0)
    }
}

/// Our parametrisation over the reference's grid: its time, and what the solution took.
fn own_parametrisation<const N: usize>(
    geometry: &Geometry<N>,
    limits: &Limits<N>,
    grid: &[f64],
) -> Option<(f64, f64)> {
    let points = grid.len();
    let s = |k: usize| grid[k];
    let begin = thread_time();
    let cells: Vec<Cell<N>> = (0..points - 1)
        .map(|k| {
            let fast = geometry.fast(s(k), limits);
            Cell {
                length: s(k + 1) - s(k),
                ends: [s(k), s(k + 1)].map(|s| Slope::from(geometry.at(s))),
                speed: [fast, fast.min(geometry.fast(s(k + 1), limits))],
                share: [1.0; 2],
                limits: *limits,
            }
        })
        .collect();
    // A slow motion with the shape of one that keeps acceleration.
    let mut parametrisation = TimeParametrisation::default();
    let mut w: Vec<f64> = (0..points)
        .map(|k| {
            let at = geometry.at(s(k));
            let bent = (0..N)
                .map(|i| {
                    let bend = limits.acceleration[i] / at.d2[i].abs();
                    bend.min((limits.jerk[i] / at.d3[i].abs()).powf(2.0 / 3.0))
                })
                .fold(f64::INFINITY, f64::min);
            bent.min(geometry.fast(s(k), limits).powi(2))
        })
        .collect();
    let pull = |k: usize| {
        let d = geometry.at(s(k)).d1;
        (0..N)
            .map(|i| limits.acceleration[i] / d[i].abs())
            .fold(f64::INFINITY, f64::min)
    };
    w[0] = 0.0;
    w[points - 1] = 0.0;
    for k in 1..points {
        w[k] = w[k].min(w[k - 1] + 2.0 * pull(k) * cells[k - 1].length);
    }
    for k in (0..points - 1).rev() {
        w[k] = w[k].min(w[k + 1] + 2.0 * pull(k) * cells[k].length);
    }
    const SLOW: f64 = 0.3;
    let guess = (0..points).map(|k| {
        let a = if k == 0 || k == points - 1 {
            0.0
        } else {
            0.5 * SLOW * (w[k + 1] - w[k - 1]) / (s(k + 1) - s(k - 1))
        };
        NodeState { w: SLOW * w[k], a }
    });
    let outcome = parametrisation.solve(&cells, NodeState::default(), guess, 0.3, 1e-4);
    outcome
        .converged
        .then(|| (outcome.time, (thread_time() - begin).as_secs_f64()))
}

fn row<const N: usize>(contour: &Contour<N>) {
    let limits = &contour.limits;
    let mut took = f64::INFINITY;
    let mut plan = Plan::default();
    for _ in 0..5 {
        let begin = thread_time();
        plan = Plan::of(limits, contour.items(None));
        took = took.min((thread_time() - begin).as_secs_f64());
    }
    assert_eq!(plan.sections.len(), 1, "{} stops on the way", contour.name);
    let load = plan.load(limits, 16);
    let stops = Plan::of(limits, contour.items(Some(PathControlMode::Stop))).time();
    let geometry = Geometry(plan.sections[0].clone());

    let mut points = 501;
    let mut before = f64::INFINITY;
    let mut converged = None;
    let solve = |points, passes| {
        reference(&geometry, limits, even(&geometry, points), passes)
            .or_else(|| reference(&geometry, limits, grid(&plan, points), passes))
    };
    while points <= 4_001 {
        if let Some(r) = solve(points, 20) {
            let change = (before / r.time - 1.0).abs();
            before = r.time;
            let stretch = r.stretch(&geometry, limits);
            eprintln!(
                "  {points} points, {} passes: {:.6} s, stretched by {stretch:.5}, {:.2} s",
                r.passes, r.time, r.took
            );
            converged = Some((points, r, stretch));
            if change < 1e-3 {
                break;
            }
        }
        points = 2 * points - 1;
    }
    let ours = plan.time();
    print!(
        "| {} | {stops:.4} | {ours:.4} | {:.4} |",
        contour.name,
        load.into_iter().fold(0.0, f64::max)
    );
    match converged {
        Some((points, r, stretch)) => println!(
            " {:.4} | {points} | {:.4} | **{:.4}** | {:.4} | {:.4} |",
            r.time,
            r.time * stretch,
            ours / (r.time * stretch),
            r.second_order,
            geometry.velocity_time(limits)
        ),
        None => println!(
            " – | – | – | – | – | {:.4} |",
            geometry.velocity_time(limits)
        ),
    }
    // The least of several.
    let fastest = |times: &mut dyn Iterator<Item = Option<f64>>| {
        times.flatten().fold(f64::INFINITY, f64::min)
    };
    let two = fastest(&mut (0..2).map(|_| solve(1_001, 2).map(|r| r.took)));
    let parametrisation = |points, times: usize| {
        let grid = even(&geometry, points);
        fastest(&mut (0..times).map(|_| own_parametrisation(&geometry, limits, &grid).map(|o| o.1)))
    };
    let (own, fine) = (parametrisation(1_001, 10), parametrisation(5_001, 3));
    eprintln!(
        "| {} | {:.1} | {:.1} | {:.0} | {:.0} | {:.0} | {:.1} |",
        contour.name,
        1e3 * took,
        1e3 * own,
        1e3 * two,
        two / own,
        two / took,
        1e3 * fine,
    );
}

fn main() {
    println!(
        "| path | stops | ours, s | load | LP | points | LP stretched | ratio | acceleration only | velocity only |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    eprintln!(
        "| path | planner, ms | parametrisation, 1,001 | LP, 1,001 | LP / parametrisation | LP / planner | parametrisation, 5,001 |"
    );
    let part = std::env::args()
        .skip(1)
        .find(|a| !a.starts_with('-'))
        .unwrap_or_default();
    for contour in three_axes().iter().filter(|c| c.name.contains(&part)) {
        row(contour);
    }
    for contour in six_axes().iter().filter(|c| c.name.contains(&part)) {
        row(contour);
    }
}
