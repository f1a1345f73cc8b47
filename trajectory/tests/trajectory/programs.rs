//! Programs by chance, and what planning them takes.

use std::f64::consts::{PI, TAU};

use syncline_trajectory::path::{
    Command, Curve, Feed, JerkSegment, Limits, Move, PathControlMode, PathItem, Plane, Planner,
    curve::ArcDefinition, window::Effort,
};

/// What a plan comes to.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct Cost {
    /// Motion time, s.
    pub(crate) time: f64,
    pub(crate) effort: Effort,
    /// The most that a call took, cells times Newton steps.
    pub(crate) most: usize,
}

/// Curves that follow one another.
#[derive(Debug, Clone)]
pub(crate) struct Program<const N: usize = 3> {
    pub(crate) limits: Limits<N>,
    pub(crate) curves: Vec<(Curve<N>, Feed)>,
}

impl<const N: usize> Program<N> {
    /// Lines through points.
    pub(crate) fn polyline(limits: Limits<N>, points: &[[f64; N]], feed: Feed) -> Self {
        let lines = points.windows(2);
        let lines = lines.filter_map(|ends| Curve::line(ends[0], ends[1]).ok());
        Program {
            limits,
            curves: lines.map(|line| (line, feed)).collect(),
        }
    }

    pub(crate) fn start(&self) -> [f64; N] {
        self.curves[0].0.start()
    }

    pub(crate) fn items(&self, mode: PathControlMode) -> Vec<PathItem<N>> {
        self.items_by(|_| mode)
    }

    /// Every move in a mode of its own.
    fn items_by(&self, mode: impl Fn(usize) -> PathControlMode) -> Vec<PathItem<N>> {
        let motion = |(&(curve, feed), tag): (_, u32)| Move {
            curve,
            feed,
            mode: mode(tag as usize),
            tag,
        };
        let moves = self.curves.iter().zip(0..).map(motion);
        moves.map(PathItem::Move).collect()
    }

    /// With a stop at every point.
    pub(crate) fn stopping(&self) -> Cost {
        self.cost(PathControlMode::Stop)
    }

    pub(crate) fn cost(&self, mode: PathControlMode) -> Cost {
        self.cost_by(|_| mode)
    }

    /// With every move in a mode of its own.
    pub(crate) fn cost_by(&self, mode: impl Fn(usize) -> PathControlMode) -> Cost {
        let mut planner = Planner::new(self.limits, self.start());
        let mut cost = Cost::default();
        let mut steps: Vec<f64> = Vec::new();
        let mut drain = |planner: &mut Planner<N>| {
            loop {
                let before = planner.effort().work;
                let Some(command) = planner.pop() else { break };
                cost.most = cost.most.max(planner.effort().work - before);
                match command {
                    Command::Section { .. } => steps.push(0.0),
                    Command::ReplaceTail(step) => steps.truncate(step as usize),
                    Command::JerkSegment(JerkSegment { duration, .. }) => steps.push(duration),
                    _ => {}
                }
            }
        };
        for item in self.items_by(mode) {
            planner.push(item).unwrap();
            drain(&mut planner);
        }
        planner.finish();
        drain(&mut planner);
        cost.time = steps.iter().sum();
        cost.effort = planner.effort();
        cost
    }
}

/// A place that a program has come to.
struct Pen<const N: usize> {
    at: [f64; N],
    heading: f64,
    /// How far the axes beyond the third turn on every curve.
    swing: f64,
    curves: Vec<(Curve<N>, Feed)>,
}

impl<const N: usize> Pen<N> {
    fn new() -> Self {
        Pen {
            at: [0.0; N],
            heading: 0.0,
            swing: 0.0,
            curves: Vec::new(),
        }
    }

    /// Draws a curve if there is one.
    fn draw(&mut self, curve: Option<Curve<N>>, feed: Feed) {
        if let Some(curve) = curve {
            self.at = curve.end();
            self.curves.push((curve, feed));
        }
    }

    /// So far from here.
    fn away(&self, x: f64, y: f64, z: f64) -> [f64; N] {
        let by = [x, y, z];
        std::array::from_fn(|i| self.at[i] + by.get(i).copied().unwrap_or(self.swing))
    }

    /// Turns, then goes straight on.
    fn line(&mut self, turn: f64, length: f64, rise: f64, feed: Feed) {
        self.heading += turn;
        let (sin, cos) = self.heading.sin_cos();
        let end = self.away(length * cos, length * sin, rise);
        self.draw(Curve::line(self.at, end).ok(), feed);
    }

    /// Goes round a circle or helix, to the left with a radius above zero, by an angle above zero.
    fn arc(&mut self, radius: f64, angle: f64, rise: f64, feed: Feed) {
        let (sin, cos) = self.heading.sin_cos();
        self.heading += angle * radius.signum();
        let (sin1, cos1) = self.heading.sin_cos();
        let centre = (self.at[0] - radius * sin, self.at[1] + radius * cos);
        let mut end = self.away(0.0, 0.0, rise);
        (end[0], end[1]) = (centre.0 + radius * sin1, centre.1 - radius * cos1);
        let arc = Curve::arc(ArcDefinition {
            start: self.at,
            end,
            plane: Plane::Xy,
            centre,
            clockwise: radius < 0.0,
            turns: (angle / TAU) as u32,
        });
        self.draw(arc.ok(), feed);
    }
}

/// Random numbers of our own: 0 … 1.
pub(crate) struct Draw(pub(crate) u64);

impl Draw {
    pub(crate) fn of(seed: u64) -> Self {
        Draw(seed.wrapping_mul(0x1234_5678_9abc_def1))
    }

    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub(crate) fn log(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    fn sign(&mut self) -> f64 {
        if self.unit() < 0.5 { -1.0 } else { 1.0 }
    }

    /// Limits of axes that differ from each other by up to so many decades.
    fn limits<const N: usize>(&mut self, decades: f64) -> Limits<N> {
        let spread = 10_f64.powf(0.5 * decades);
        let mut about = |value: f64| [(); N].map(|()| self.log(value / spread, value * spread));
        Limits {
            velocity: about(100.0),
            acceleration: about(1_000.0),
            jerk: about(50_000.0),
        }
    }

    /// Short segments, now and then arcs, that turn with radii of 0.01 to 10 tolerances, each 0.001 to 10 radii
    /// long, and their mode.
    pub(crate) fn short_segments(&mut self) -> (Program, PathControlMode) {
        let tolerance = self.log(0.0005, 3.0);
        let mode = match (self.unit() * 4.0) as u32 {
            0 => PathControlMode::Exact(tolerance),
            1 | 2 => PathControlMode::Blend(tolerance),
            _ => PathControlMode::Merge {
                tolerance,
                within: self.log(0.1, 1.0) * tolerance,
            },
        };
        let decades = if self.unit() < 0.5 { 6.0 } else { 1.0 };
        let limits = self.limits(decades);
        let feed = Feed::Rate(self.log(0.1, 1_000.0));
        let segments = 2 + self.log(1.0, 100.0) as u32;
        let steady = self.unit();
        let arcs = if self.unit() < 0.5 { self.unit() } else { 0.0 };
        let (mut radius, mut length) = (0.0, 0.0);
        let mut pen = Pen::new();
        for k in 0..segments {
            if k == 0 || self.unit() > steady {
                radius = self.sign() * tolerance * self.log(0.01, 10.0);
                length = f64::abs(radius) * self.log(0.001, 10.0);
            }
            let rise = 0.3 * length * (0.1 * f64::from(k)).sin();
            if self.unit() < arcs {
                pen.arc(radius, length / radius.abs(), rise, feed);
            } else {
                pen.line(length / radius, length, rise, feed);
            }
        }
        let curves = pen.curves;
        (Program { limits, curves }, mode)
    }

    /// Helices, trochoids and letters in short lines, whose turns are about as tight as the tolerance or tighter, within which
    /// they are rounded.
    pub(crate) fn tight_turns(&mut self) -> (Program, PathControlMode) {
        let tolerance = self.log(0.05, 2.54);
        let radius = tolerance * self.uniform(0.05, 1.2);
        let (step, kind) = (self.uniform(0.1, 0.9), self.unit());
        let mut points = vec![[0.0; 3]];
        let mut aside = 0.0;
        let mut turn = 0.0;
        for k in 1..=self.log(20.0, 300.0) as u32 {
            turn += step;
            match kind {
                0.0..0.4 => {}
                0.4..0.7 => aside += 0.2 * radius * step,
                _ if self.unit() < 0.1 => {
                    aside += radius * self.uniform(0.5, 3.0);
                    turn = self.uniform(0.0, TAU);
                }
                _ => {}
            }
            let sink = if kind < 0.2 {
                0.002 * f64::from(k)
            } else {
                0.0
            };
            points.push([
                radius * turn.sin() + aside,
                radius - radius * turn.cos(),
                -sink,
            ]);
        }
        let limits = Limits {
            velocity: [400.0, 400.0, 200.0],
            acceleration: [2_500.0, 2_500.0, 2_000.0],
            jerk: [50_000.0, 50_000.0, 40_000.0],
        };
        let feed = Feed::Rate(self.log(5.0, 100.0));
        (
            Program::polyline(limits, &points, feed),
            PathControlMode::Blend(tolerance),
        )
    }

    /// Lines and arcs of any length and turn, all but straight ones and zigzags among them, at up to three feeds.
    pub(crate) fn contour(&mut self) -> Program {
        let decades = self.log(1.0, 30.0).log10();
        let limits = self.limits(decades);
        let size = self.log(0.1, 50.0);
        let mut feed = |_| match self.unit() {
            0.0..0.2 => Feed::Rapid,
            _ => Feed::Rate(self.log(2.0, 300.0)),
        };
        let feeds = [0, 1, 2].map(&mut feed);
        let mut pen = Pen::new();
        for _ in 0..3 + (self.unit() * 10.0) as usize {
            let feed = feeds[(self.unit() * 3.0) as usize];
            let length = size * self.log(0.1, 10.0);
            let turn = 6.0 * (self.unit() - 0.5) * self.unit();
            let rise = 0.3 * length * (self.unit() - 0.5);
            match self.unit() {
                0.0..0.55 => pen.line(turn, length, rise, feed),
                0.55..0.7 => {
                    let kink = self.sign() * self.log(1e-5, 0.1);
                    pen.line(kink, length, 0.0, feed);
                }
                0.7..0.9 => {
                    pen.heading += turn;
                    let angle = self.log(0.05, 6.0);
                    pen.arc(self.sign() * length / angle, angle, rise, feed);
                }
                _ => self.zigzag(&mut pen, size, feed),
            }
        }
        let curves = pen.curves;
        Program { limits, curves }
    }

    /// Whatever a program may hold: lines and arcs of any length and turn, kinks, turns back, helices, runs of short
    /// segments, zigzags, rotary axes beside them and alone where there are more than three, feeds over decades and rapids beside them, axes whose
    /// limits differ by decades.
    pub(crate) fn anything<const N: usize>(&mut self) -> Program<N> {
        let decades = 4.0 * self.unit() * self.unit();
        let limits = self.limits(decades);
        let size = self.log(0.02, 50.0);
        let rotary = self.unit() < 0.4;
        let steady = self.unit();
        let mut pen = Pen::new();
        let mut feed = Feed::Rapid;
        for piece in 0..2 + (self.unit() * 10.0) as usize {
            if piece == 0 || self.unit() > steady {
                feed = match self.unit() {
                    0.0..0.25 => Feed::Rapid,
                    _ => Feed::Rate(self.log(0.2, 500.0)),
                };
            }
            pen.swing = match self.unit() {
                0.0..0.6 if rotary => self.sign() * self.log(1e-3, 90.0),
                _ => 0.0,
            };
            let length = size * self.log(0.01, 10.0);
            let rise = match self.unit() {
                0.0..0.5 => 0.0,
                _ => length * self.uniform(-0.5, 0.5),
            };
            let turn = self.sign() * PI * self.unit();
            match self.unit() {
                0.0..0.3 => pen.line(turn, length, rise, feed),
                0.3..0.5 => pen.line(self.sign() * self.log(1e-5, PI), length, rise, feed),
                0.5..0.55 => pen.line(PI, length, 0.0, feed),
                0.55..0.6 => pen.line(0.0, 0.0, 0.0, feed),
                0.6..0.75 => {
                    pen.heading += if self.unit() < 0.5 { turn } else { 0.0 };
                    let angle = self.log(0.05, 12.0);
                    pen.arc(self.sign() * length / angle, angle, rise, feed);
                }
                0.75..0.9 => self.run(&mut pen, size, feed),
                _ => self.zigzag(&mut pen, size, feed),
            }
        }
        let curves = pen.curves;
        Program { limits, curves }
    }

    /// Short segments along a bend that changes now and then.
    fn run<const N: usize>(&mut self, pen: &mut Pen<N>, size: f64, feed: Feed) {
        let count = self.log(3.0, 40.0);
        pen.swing /= count;
        let steady = self.unit();
        let [mut turn, mut length] = [0.0; 2];
        for segment in 0..count as u32 {
            if segment == 0 || self.unit() > steady {
                turn = self.sign() * self.log(1e-4, 1.0);
                length = size * self.log(1e-3, 0.3);
            }
            pen.line(turn, length, 0.0, feed);
        }
    }

    /// Short lines to and fro.
    fn zigzag<const N: usize>(&mut self, pen: &mut Pen<N>, size: f64, feed: Feed) {
        let length = size * self.log(1e-4, 1e-2);
        let turn = self.uniform(0.1, 2.6);
        pen.heading -= 0.5 * turn;
        for k in 0..(self.log(8.0, 60.0) as u32) {
            let side = if k % 2 == 0 { 1.0 } else { -1.0 };
            pen.line(side * turn, length, 0.0, feed);
        }
    }
}

/// The first seed of a campaign, and how many there are: `CASES=1000` from `SEED=0` on.
pub(crate) fn campaign() -> std::ops::Range<u64> {
    let [seed, cases] = [("SEED", 0), ("CASES", 1_000)].map(|(name, or)| {
        let number = std::env::var(name).ok();
        number.map_or(or, |text| text.parse().expect("a number"))
    });
    seed..seed + cases
}
