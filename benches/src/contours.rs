//! Named paths, and what is planned along them.

use syncline_trajectory::path::{
    Command, Curve, Derivatives, Feed, JerkSegment, Limits, Move, PathControlMode, PathItem,
    PathSegment, Plane, Planner, Poly, curve::ArcDefinition,
};

/// A path with the limits of its machine.
pub struct Contour<const N: usize> {
    /// What it is called in tables.
    pub name: &'static str,
    /// What every axis is allowed.
    pub limits: Limits<N>,
    /// mm/s
    pub feed: Feed,
    /// How its moves join.
    pub mode: PathControlMode,
    /// The moves.
    pub curves: Vec<Curve<N>>,
}

impl<const N: usize> Contour<N> {
    /// What the planner is fed with, under another exit if one is given.
    pub fn items(&self, mode: Option<PathControlMode>) -> impl Iterator<Item = PathItem<N>> {
        self.curves.iter().zip(0..).map(move |(&curve, tag)| {
            PathItem::Move(Move {
                curve,
                feed: self.feed,
                mode: mode.unwrap_or(self.mode),
                tag,
            })
        })
    }
}

/// What is executed in the end: one section's geometry and its jerk segments, or those of several one
/// after another.
#[derive(Debug, Clone, Default)]
pub struct Plan<const N: usize> {
    /// Every section's path segments.
    pub sections: Vec<Vec<PathSegment<N>>>,
    /// Every jerk segment with the number of its section.
    pub segments: Vec<(usize, JerkSegment)>,
    /// Windows planned.
    pub windows: usize,
}

impl<const N: usize> Plan<N> {
    /// Plans all of it.
    pub fn of(limits: &Limits<N>, items: impl Iterator<Item = PathItem<N>>) -> Self {
        let mut items = items.peekable();
        let start = match items.peek() {
            Some(PathItem::Move(motion)) => motion.curve.start(),
            _ => [0.0; N],
        };
        let mut planner = Planner::new(*limits, start);
        Plan::by(&mut planner, items)
    }

    /// Plans all of it with `planner`.
    pub fn by(planner: &mut Planner<N>, items: impl Iterator<Item = PathItem<N>>) -> Self {
        let mut plan = Plan::default();
        let mut steps = Vec::new();
        for item in items {
            planner.push(item).expect("the items follow one another");
            plan.take(planner, &mut steps);
        }
        planner.finish();
        plan.take(planner, &mut steps);
        plan.segments = steps.into_iter().flatten().collect();
        plan
    }

    fn take(&mut self, planner: &mut Planner<N>, steps: &mut Vec<Option<(usize, JerkSegment)>>) {
        while let Some(command) = planner.pop() {
            match command {
                Command::Section { .. } => {
                    self.sections.push(Vec::new());
                    steps.push(None);
                }
                Command::PathSegment(path_segment) => self
                    .sections
                    .last_mut()
                    .expect("a section")
                    .push(path_segment),
                Command::ReplaceTail(step) => steps.truncate(step as usize),
                Command::JerkSegment(segment) => {
                    steps.push(Some((self.sections.len() - 1, segment)))
                }
                Command::Dwell { .. }
                | Command::Mark { .. }
                | Command::Waypoint { .. }
                | Command::Hold => steps.push(None),
                Command::Commit => self.windows += 1,
                Command::ReplacePlan { .. } => {}
            }
        }
    }

    /// Motion time, s.
    pub fn time(&self) -> f64 {
        self.segments.iter().map(|(_, p)| p.duration).sum()
    }

    /// Greatest velocity, acceleration and jerk as parts of the limits at `n` instants in every jerk segment.
    pub fn load(&self, limits: &Limits<N>, n: usize) -> [f64; 3] {
        let mut worst = [0.0; 3];
        for (section, segment) in &self.segments {
            let path_segments = &self.sections[*section];
            let after = |s: &PathSegment<N>| s.start <= segment.distance + 1e-9;
            let path_segment = &path_segments[path_segments.partition_point(after).max(1) - 1];
            for k in 0..=n {
                let (ds, v, a) = segment.at(segment.duration * k as f64 / n as f64);
                let at = path_segment
                    .curve
                    .at(segment.distance - path_segment.start + ds);
                worst[0] = f64::max(worst[0], v / path_segment.feed);
                excess(&at, [v, a, segment.jerk], limits, &mut worst);
            }
        }
        worst
    }
}

/// Raises `worst` to what a path state asks of the axes, as parts of their limits.
pub fn excess<const N: usize>(
    at: &Derivatives<N>,
    [v, a, j]: [f64; 3],
    limits: &Limits<N>,
    worst: &mut [f64; 3],
) {
    for i in 0..N {
        let asked = [
            at.d1[i] * v / limits.velocity[i],
            (at.d2[i] * v * v + at.d1[i] * a) / limits.acceleration[i],
            (at.d3[i] * v * v * v + 3.0 * at.d2[i] * v * a + at.d1[i] * j) / limits.jerk[i],
        ];
        for (w, x) in worst.iter_mut().zip(asked) {
            *w = w.max(x.abs());
        }
    }
}

/// The curve of `f`, which gives every axis's value and first three derivatives by a parameter from
/// 0 to 1, in `parts` polynomials that agree with it to the second derivative.
pub fn parametric<const N: usize>(f: impl Fn(f64) -> [[f64; 4]; N], parts: usize) -> Vec<Curve<N>> {
    let tool = N.min(3);
    let rate = |u: f64| {
        let axes = f(u);
        axes[..tool].iter().map(|x| x[1] * x[1]).sum::<f64>().sqrt()
    };
    let at = |u: f64| {
        let axes = f(u);
        let dot = |a: usize, b: usize| axes[..tool].iter().map(|x| x[a] * x[b]).sum::<f64>();
        let square = dot(1, 1);
        let slow = dot(1, 2) / square;
        Derivatives {
            q: axes.map(|x| x[0]),
            d1: axes.map(|x| x[1] / square.sqrt()),
            d2: axes.map(|x| (x[2] - slow * x[1]) / square),
            d3: [0.0; N],
        }
    };
    (0..parts)
        .map(|k| {
            let ends = [k, k + 1].map(|k| k as f64 / parts as f64);
            const FINE: usize = 200;
            // Simpson's rule.
            let step = (ends[1] - ends[0]) / FINE as f64;
            let length: f64 = (0..=FINE)
                .map(|i| {
                    let weight = match i {
                        0 | FINE => 1.0,
                        _ if i % 2 == 1 => 4.0,
                        _ => 2.0,
                    };
                    weight * rate(ends[0] + i as f64 * step) * step / 3.0
                })
                .sum();
            let poly = Poly::joining(&at(ends[0]), &at(ends[1]), length, 0.0);
            Curve::Poly(poly.expect("the curve goes on"))
        })
        .collect()
}

/// Lines through `points`.
pub fn polyline<const N: usize>(points: &[[f64; N]]) -> Vec<Curve<N>> {
    points
        .windows(2)
        .map(|p| Curve::line(p[0], p[1]).expect("points apart"))
        .collect()
}

/// sin(w u + p) and its derivatives by u, times `size`.
fn wave(u: f64, size: f64, w: f64, p: f64) -> [f64; 4] {
    let (s, c) = (w * u + p).sin_cos();
    [
        size * s,
        size * w * c,
        -size * w * w * s,
        -size * w * w * w * c,
    ]
}

const TURN: f64 = std::f64::consts::TAU;

/// Limits of the machine of the three-axis contours but the Lissajous figure.
pub const MILL: Limits<3> = Limits {
    velocity: [500.0, 400.0, 200.0],
    acceleration: [5_000.0, 3_000.0, 2_000.0],
    jerk: [80_000.0, 50_000.0, 40_000.0],
};

/// The named paths of three axes.
pub fn three_axes() -> Vec<Contour<3>> {
    let exact = PathControlMode::Exact(0.001);
    let lissajous = Contour {
        name: "Lissajous figure 2:3:5, all limits 1",
        limits: Limits {
            velocity: [1.0; 3],
            acceleration: [1.0; 3],
            jerk: [1.0; 3],
        },
        feed: Feed::Rapid,
        mode: exact,
        curves: parametric(
            |u| {
                [
                    wave(u, 1.0, TURN, 0.0),
                    wave(u, 1.0, 1.5 * TURN, 0.3),
                    wave(u, 1.0, 2.5 * TURN, 0.7),
                ]
            },
            60,
        ),
    };
    let hexagon: Vec<[f64; 3]> = (0..=6)
        .map(|k| {
            let (s, c) = (f64::from(k) * TURN / 6.0).sin_cos();
            [40.0 * c, 40.0 * s, f64::from(k)]
        })
        .collect();
    let hexagon = Contour {
        name: "rising hexagon, G64 P0.5",
        limits: MILL,
        feed: Feed::Rate(250.0),
        mode: PathControlMode::Blend(0.5),
        curves: polyline(&hexagon),
    };
    let pocket = {
        const RADIUS: f64 = 20.0;
        let mut curves = Vec::new();
        let mut at = [RADIUS, 0.0, 0.0];
        for k in 0..4_u8 {
            let (along, side) = [
                ([1.0, 0.0], 100.0),
                ([0.0, 1.0], 70.0),
                ([-1.0, 0.0], 100.0),
                ([0.0, -1.0], 70.0),
            ][usize::from(k)];
            let straight = side - 2.0 * RADIUS;
            let inwards = [-along[1], along[0]];
            let go = |from: [f64; 3], way: f64, in_way: f64| {
                std::array::from_fn(|i| {
                    if i < 2 {
                        from[i] + way * along[i] + in_way * inwards[i]
                    } else {
                        from[i]
                    }
                })
            };
            let corner: [f64; 3] = go(at, straight, 0.0);
            let centre: [f64; 3] = go(corner, 0.0, RADIUS);
            let end = go(corner, RADIUS, RADIUS);
            curves.push(Curve::line(at, corner).expect("points apart"));
            let arc = Curve::arc(ArcDefinition {
                start: corner,
                end,
                plane: Plane::Xy,
                centre: (centre[0], centre[1]),
                clockwise: false,
                turns: 0,
            });
            curves.push(arc.expect("a quarter of a circle"));
            at = end;
        }
        Contour {
            name: "pocket with corners of radius 20, G64 P0.2",
            limits: MILL,
            feed: Feed::Rate(300.0),
            mode: PathControlMode::Blend(0.2),
            curves,
        }
    };
    let helix = Contour {
        name: "helix, 3 turns of radius 15",
        limits: MILL,
        feed: Feed::Rate(400.0),
        mode: exact,
        curves: vec![
            Curve::arc(ArcDefinition {
                start: [15.0, 0.0, 0.0],
                end: [15.0, 0.0, -12.0],
                plane: Plane::Xy,
                centre: (0.0, 0.0),
                clockwise: false,
                turns: 2,
            })
            .expect("a helix"),
        ],
    };
    let spiral = Contour {
        name: "spiral from radius 2 to 40",
        limits: MILL,
        feed: Feed::Rate(300.0),
        mode: exact,
        curves: parametric(
            |u| {
                let (w, grow) = (4.0 * TURN, 38.0);
                let r = 2.0 + grow * u;
                let (s, c) = (w * u).sin_cos();
                let axis = |f: f64, g: f64| {
                    // r f with f′ = w g and g′ = −w f
                    [
                        r * f,
                        grow * f + r * w * g,
                        2.0 * grow * w * g - r * w * w * f,
                        -3.0 * grow * w * w * f - r * w * w * w * g,
                    ]
                };
                [axis(c, -s), axis(s, c), [0.0; 4]]
            },
            80,
        ),
    };
    vec![lissajous, hexagon, pocket, helix, spiral]
}

/// The named path of six axes, three of them followers.
pub fn six_axes() -> Vec<Contour<6>> {
    vec![Contour {
        name: "wave of six axes",
        limits: Limits {
            velocity: [300.0, 300.0, 200.0, 90.0, 90.0, 180.0],
            acceleration: [3_000.0, 2_000.0, 2_000.0, 900.0, 900.0, 1_800.0],
            jerk: [50_000.0, 40_000.0, 30_000.0, 20_000.0, 20_000.0, 30_000.0],
        },
        feed: Feed::Rate(250.0),
        mode: PathControlMode::Exact(0.001),
        curves: parametric(
            |u| {
                [
                    [200.0 * u, 200.0, 0.0, 0.0],
                    wave(u, 30.0, 2.0 * TURN, 0.2),
                    wave(u, 10.0, 3.0 * TURN, 1.0),
                    wave(u, 12.0, 2.0 * TURN, 0.5),
                    wave(u, 8.0, 4.0 * TURN, 0.1),
                    wave(u, 20.0, 1.5 * TURN, 2.0),
                ]
            },
            60,
        ),
    }]
}
