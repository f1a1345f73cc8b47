//! Generated programs with the geometry that they stand for: what a path planner has to get right.
//!
//! The geometry is the generator's own, by line of the program; nothing of the controller's is used.

use std::f64::consts::{PI, TAU};
use std::fmt::Write;

/// A place, X Y Z, mm.
pub type Point = [f64; 3];

/// What one line of a program moves along.
#[derive(Clone, Copy, Debug)]
pub enum Shape {
    /// Straight.
    Line(Point, Point),
    /// An arc or helix about `centre`; radius, and what is across the plane, go linearly with the
    /// angle.
    Arc {
        /// The axes of the plane, and the one across it.
        axes: [usize; 3],
        /// In the plane.
        centre: [f64; 2],
        /// Radius, angle, and height at the start.
        from: [f64; 3],
        /// The same at the end.
        to: [f64; 3],
    },
}

impl Shape {
    /// Where it is after the part `u` of its angle or way.
    #[must_use]
    pub fn at(&self, u: f64) -> Point {
        match self {
            Self::Line(from, to) => std::array::from_fn(|i| from[i] + u * (to[i] - from[i])),
            Self::Arc {
                axes,
                centre,
                from,
                to,
            } => {
                let [radius, angle, height] =
                    std::array::from_fn(|i| from[i] + u * (to[i] - from[i]));
                let mut point = [0.0; 3];
                point[axes[0]] = centre[0] + radius * angle.cos();
                point[axes[1]] = centre[1] + radius * angle.sin();
                point[axes[2]] = height;
                point
            }
        }
    }

    /// Its length, about, and its least radius, mm.
    fn size(&self) -> (f64, f64) {
        match self {
            Self::Line(from, to) => (norm(from, to), f64::INFINITY),
            Self::Arc { from, to, .. } => {
                let round = from[0].max(to[0]) * (to[1] - from[1]).abs();
                (round.hypot(to[2] - from[2]), from[0].min(to[0]))
            }
        }
    }

    /// How far a point is from it, mm.
    #[must_use]
    pub fn distance(&self, point: &Point) -> f64 {
        let apart = |u: f64| norm(&self.at(u), point);
        let places = match self {
            Self::Line(from, to) => {
                let along = |p: &Point| (0..3).map(|i| (p[i] - from[i]) * (to[i] - from[i])).sum();
                let (part, whole): (f64, f64) = (along(point), along(to));
                return apart((part / whole.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0));
            }
            Self::Arc { from, to, .. } => 2 + ((to[1] - from[1]).abs() / 0.7) as usize,
        };
        let place = |k: usize| k as f64 / places as f64;
        let nearest = (0..=places).map(|k| apart(place(k)));
        let nearest = nearest.fold(f64::INFINITY, f64::min);
        // A circle's end is as near as its start.
        (0..=places)
            .filter(|&k| apart(place(k)) <= nearest * 1.01 + 1e-9)
            .map(|k| {
                let mut low = place(k.saturating_sub(1));
                let mut high = place((k + 1).min(places));
                for _ in 0..90 {
                    let third = (high - low) / 3.0;
                    if apart(low + third) < apart(high - third) {
                        high -= third;
                    } else {
                        low += third;
                    }
                }
                apart(0.5 * (low + high))
            })
            .fold(nearest, f64::min)
    }
}

fn norm(a: &Point, b: &Point) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

/// A program and what it stands for.
pub struct Sample {
    /// For messages.
    pub name: String,
    /// The program.
    pub text: String,
    /// Where each line moves; `None` for lines without motion.
    pub shapes: Vec<Option<Shape>>,
    /// How far the path may leave them, mm.
    pub tolerance: f64,
    /// Where it ends.
    pub end: Point,
    /// How many lines further, on or back, a setpoint may be than the line that it is said to be on: those
    /// of a rounded corner, or of a curve that was taken for one.
    pub neighbours: usize,
    /// Feed, mm/s.
    feed: f64,
}

impl Sample {
    /// How long it may take at most, s, by a wide margin: what moves do that stop at their ends, at
    /// the pace of an axis of 2,000 mm/s² and 40,000 mm/s³.
    #[must_use]
    pub fn patience(&self) -> f64 {
        let (a, j) = (2_000.0_f64, 40_000.0_f64);
        let time = |shape: &Shape| {
            let (way, bend) = shape.size();
            let speed = (self.feed.min((a * bend).sqrt())).min((j * bend * bend).cbrt());
            way / speed + 4.0 * (way / j).cbrt() + (speed / a).min((way / a).sqrt())
        };
        5.0 + 1.5 * self.shapes.iter().flatten().map(time).sum::<f64>()
    }
}

/// Writes a program move by move.
struct Writer {
    sample: Sample,
}

/// Six decimals, as they are written.
fn round(x: f64) -> f64 {
    (x * 1e6).round() / 1e6
}

impl Writer {
    /// Goes to `start` and sets mode and feed (mm/min).
    fn new(name: impl Into<String>, mode: &str, tolerance: f64, feed: f64, start: Point) -> Self {
        let mut writer = Self {
            sample: Sample {
                name: name.into() + " " + mode,
                text: String::new(),
                shapes: vec![None],
                tolerance,
                end: [0.0; 3],
                neighbours: 24,
                feed: feed / 60.0,
            },
        };
        writer.word(&format!("G17 G21 G90 G91.1 G94 G61.1 F{feed}"));
        writer.go("G0", start);
        // Where the machine stands before is not the program's affair.
        writer.sample.shapes.pop();
        writer.sample.shapes.push(None);
        writer.word(mode);
        writer
    }

    fn word(&mut self, line: &str) {
        self.sample.text += line;
        self.sample.text.push('\n');
        self.sample.shapes.push(None);
    }

    fn go(&mut self, code: &str, to: Point) {
        let to = to.map(round);
        let _ = writeln!(self.sample.text, "{code} X{} Y{} Z{}", to[0], to[1], to[2]);
        let shape = Shape::Line(self.sample.end, to);
        self.sample.shapes.push(Some(shape));
        self.sample.end = to;
    }

    /// Straight on.
    fn to(&mut self, to: Point) {
        self.go("G1", to);
    }

    /// Straight on by so much.
    fn by(&mut self, by: Point) {
        let at = self.sample.end;
        self.to(std::array::from_fn(|i| at[i] + by[i]));
    }

    /// An arc of `radius` in a plane (17, 18, 19) that begins where the circle has the angle
    /// `from` and goes on by `sweep`, rising by `rise` across the plane; end and centre are written
    /// with `decimals`.
    fn arc(&mut self, plane: u8, radius: f64, from: f64, sweep: f64, rise: f64, decimals: i32) {
        let axes = match plane {
            17 => [0, 1, 2],
            18 => [2, 0, 1],
            _ => [1, 2, 0],
        };
        let grain = 10_f64.powi(decimals);
        let near = |x: f64| (x * grain).round() / grain;
        let start = self.sample.end;
        let offset = [near(-radius * from.cos()), near(-radius * from.sin())];
        let centre = [start[axes[0]] + offset[0], start[axes[1]] + offset[1]];
        let mut end = start;
        if sweep.abs() < TAU {
            end[axes[0]] = round(near(centre[0] + radius * (from + sweep).cos()));
            end[axes[1]] = round(near(centre[1] + radius * (from + sweep).sin()));
        }
        end[axes[2]] = round(start[axes[2]] + rise);
        let letters = ["I", "J", "K"];
        let _ = writeln!(
            self.sample.text,
            "G{plane} G{} X{} Y{} Z{} {}{} {}{}",
            if sweep > 0.0 { 3 } else { 2 },
            end[0],
            end[1],
            end[2],
            letters[axes[0]],
            offset[0],
            letters[axes[1]],
            offset[1],
        );
        let polar = |p: &Point| {
            let (a, b) = (p[axes[0]] - centre[0], p[axes[1]] - centre[1]);
            (a.hypot(b), b.atan2(a))
        };
        let ((r0, a0), (r1, mut a1)) = (polar(&start), polar(&end));
        while (a1 - a0) * sweep.signum() <= 1e-12 {
            a1 += TAU * sweep.signum();
        }
        if sweep.abs() >= TAU {
            a1 = a0 + TAU * sweep.signum();
        }
        self.sample.shapes.push(Some(Shape::Arc {
            axes,
            centre,
            from: [r0, a0, start[axes[2]]],
            to: [r1, a1, end[axes[2]]],
        }));
        self.sample.end = end;
    }

    fn end(mut self) -> Sample {
        self.word("M2");
        self.sample
    }
}

/// Path modes and what they allow, mm.
const MODES: [(&str, f64); 4] = [
    ("G61.1", 1e-9),
    ("G61", 0.001),
    ("G64 P0.01", 0.01),
    ("G64 P0.2", 0.2),
];

/// Where the programs work on the portal.
const START: Point = [400.0, 400.0, -150.0];

/// Corners of every angle, `step` degrees apart, reversals included.
#[must_use]
pub fn corners(step: usize) -> Vec<Sample> {
    let in_mode = |(mode, tolerance)| {
        let mut path = Writer::new("corners", mode, tolerance, 12_000.0, START);
        for turn in (0..=180).step_by(step) {
            let turn = f64::from(turn as u16).to_radians();
            path.by([8.0, 0.0, 0.0]);
            path.by([8.0 * turn.cos(), 8.0 * turn.sin(), 0.0]);
            path.to([
                START[0] + 0.1 * turn,
                START[1] - 2.0 * turn,
                START[2] - turn,
            ]);
        }
        path.end()
    };
    MODES.map(in_mode).into()
}

/// Arcs to the left and to the right in turn, tangent or nearly so (`kink` degrees), in the given
/// decimals, with and without lines between.
#[must_use]
pub fn s_bends(kink: f64, decimals: i32) -> Vec<Sample> {
    let in_mode = |(mode, tolerance)| {
        let name = format!("s-bends {kink}° {decimals} decimals");
        let mut path = Writer::new(name, mode, tolerance, 9_000.0, START);
        let mut heading: f64 = 0.3;
        for (k, radius) in [40.0, 10.0, 3.0, 1.0, 0.3, 1.0, 20.0, 100.0]
            .into_iter()
            .enumerate()
        {
            let side = if k % 2 == 0 { 1.0 } else { -1.0 };
            let sweep = side * f64::min(40.0 / radius, 2.0 - 0.1 * k as f64);
            heading += kink.to_radians();
            path.arc(17, radius, heading - side * PI / 2.0, sweep, 0.0, decimals);
            heading += sweep;
            if k % 3 == 1 {
                let way = 2.0 + k as f64;
                path.by([way * heading.cos(), way * heading.sin(), 0.0]);
            }
        }
        path.end()
    };
    MODES[1..].iter().copied().map(in_mode).collect()
}

/// `count` segments of `length` mm along a spiral, as CAM writes curves.
#[must_use]
pub fn segments(count: usize, length: f64, mode: (&str, f64)) -> Sample {
    let name = format!("{count} segments of {length} mm");
    let mut path = Writer::new(name, mode.0, mode.1, 6_000.0, START);
    // As many as are gathered, at most, and what is before and behind.
    path.sample.neighbours += 96;
    let mut angle: f64 = 0.0;
    let pitch = 2.0;
    for _ in 0..count {
        let radius = 5.0 + pitch * angle / TAU;
        angle += length / radius;
        let radius = 5.0 + pitch * angle / TAU;
        let wave = 0.5 * (7.0 * angle).sin();
        let (x, y) = (radius * angle.cos() - 5.0, radius * angle.sin());
        path.to([START[0] + x, START[1] + y, START[2] + wave]);
    }
    path.end()
}

/// Full circles of these diameters, mm, each in every plane that `planes` names.
#[must_use]
pub fn circles(diameters: &[f64], planes: &[u8]) -> Sample {
    let mut path = Writer::new("circles", "G61", 0.001, 24_000.0, START);
    for diameter in diameters {
        for plane in planes {
            let turn = if (diameter.log10() as i64) % 2 == 0 {
                TAU
            } else {
                -TAU
            };
            path.arc(*plane, diameter / 2.0, 0.4, turn, 0.0, 6);
        }
        path.by([0.5, 0.25, -0.125]);
    }
    path.end()
}

/// Points that come twice, moves of nearly no length, and lines that merely go on.
#[must_use]
pub fn duplicates() -> Vec<Sample> {
    let in_mode = |(mode, tolerance)| {
        let mut path = Writer::new("duplicates", mode, tolerance, 12_000.0, START);
        for tiny in [0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2] {
            path.by([10.0, 5.0, 0.0]);
            path.by([tiny, 0.0, 0.0]);
            path.by([0.0, tiny, 0.0]);
            path.by([0.0; 3]);
            path.by([-10.0, 5.0, 1.0]);
            path.by([-10.0, 5.0, 1.0]);
            path.by([tiny, 0.0, -tiny]);
            path.by([0.0; 3]);
            path.by([10.0, -14.0, -2.0]);
        }
        path.end()
    };
    MODES.map(in_mode).into()
}

/// One axis there and back, from a micrometre to a decimetre.
#[must_use]
pub fn reversals() -> Vec<Sample> {
    let in_mode = |(mode, tolerance)| {
        let mut path = Writer::new("reversals", mode, tolerance, 30_000.0, START);
        for length in [1e-3, 0.01, 0.1, 1.0, 10.0, 100.0] {
            for axis in 0..3 {
                for sign in [1.0, -1.0, 1.0, -1.0] {
                    let mut by = [0.0; 3];
                    by[axis] = sign * length;
                    path.by(by);
                }
            }
        }
        path.end()
    };
    MODES.map(in_mode).into()
}

/// Half turns whose radius grows by a pitch each, as spirals are written with arcs, out and in
/// again: tangent joints at which the curvature steps; in the plane, and rising.
#[must_use]
pub fn spirals() -> Vec<Sample> {
    let in_mode = |(mode, tolerance)| {
        let mut path = Writer::new("spirals", mode, tolerance, 12_000.0, START);
        for (pitch, rise) in [(0.05, 0.0), (1.0, 0.0), (1.0, 0.5)] {
            let radii = (1..=12).chain((1..=12).rev());
            for (k, turns) in radii.enumerate() {
                let radius = f64::from(turns) * pitch;
                let from = if k % 2 == 0 { 0.0 } else { PI };
                path.arc(17, radius, from, PI, rise, 6);
            }
            path.by([1.0, 0.0, 0.0]);
        }
        path.end()
    };
    MODES.map(in_mode).into()
}

/// A part of everything, in seconds.
#[must_use]
pub fn excerpt() -> Vec<Sample> {
    let mut samples = corners(120);
    samples.push(s_bends(0.5, 3).swap_remove(1));
    samples.push(segments(500, 0.05, ("G64 P0.01", 0.01)));
    samples.push(circles(&[0.01, 1.0, 100.0], &[17, 18, 19]));
    samples.push(circles(&[10_000.0], &[17]));
    samples.push(spirals().swap_remove(2));
    samples.push(duplicates().swap_remove(0));
    samples.push(duplicates().swap_remove(2));
    samples.push(reversals().swap_remove(2));
    samples.push(planes().swap_remove(3));
    samples.push(zigzags().swap_remove(2));
    samples
}

/// Everything but the programs of many segments.
#[must_use]
pub fn whole() -> Vec<Sample> {
    let mut samples = corners(1);
    for kink in [0.0, 0.01, 0.1, 0.5, 2.0, 10.0] {
        for decimals in [6, 4, 3] {
            samples.extend(s_bends(kink, decimals));
        }
    }
    samples.push(circles(
        &[0.01, 0.02, 0.1, 0.5, 1.0, 5.0, 10.0, 50.0, 100.0],
        &[17, 18, 19],
    ));
    samples.push(circles(&[500.0, 1_000.0, 10_000.0], &[17]));
    samples.extend(
        [spirals(), duplicates(), reversals(), planes(), zigzags()]
            .into_iter()
            .flatten(),
    );
    samples
}

/// Curves of very many segments.
#[must_use]
pub fn many_segments() -> Vec<Sample> {
    let in_mode = |mode| [segments(2_000, 0.5, mode), segments(150_000, 0.05, mode)];
    [("G61", 0.001), ("G64 P0.01", 0.01)]
        .into_iter()
        .flat_map(in_mode)
        .collect()
}

/// Arcs and helices in all planes, one into the other.
#[must_use]
pub fn planes() -> Vec<Sample> {
    let in_mode = |(mode, tolerance)| {
        let mut path = Writer::new("planes", mode, tolerance, 15_000.0, START);
        for k in 0..4 {
            let k = f64::from(k);
            let radius = 4.0 + 7.0 * k;
            path.arc(17, radius, 0.0, PI / 2.0 + 0.2 * k, 0.0, 6);
            path.arc(18, radius, PI, -PI / 2.0, 3.0, 6);
            path.by([3.0, 0.0, 1.0]);
            path.arc(19, radius / 2.0, 0.3, 2.5, -2.0, 6);
            path.arc(17, radius, 1.0, -TAU, 2.0, 6);
            path.arc(18, 2.0, 2.0, 1.0 + k, 0.0, 6);
        }
        path.end()
    };
    MODES.map(in_mode).into()
}

/// Zigzags whose items are shorter than what their blends would like to have.
#[must_use]
pub fn zigzags() -> Vec<Sample> {
    let in_mode = |(mode, tolerance)| {
        let mut path = Writer::new("zigzags", mode, tolerance, 12_000.0, START);
        for item in [2.0, 0.5, 0.1, 0.02, 0.005] {
            for k in 0..12 {
                let side = if k % 2 == 0 { 1.0 } else { -1.0 };
                path.by([item, side * item * (1.0 + 0.1 * f64::from(k)), 0.0]);
            }
            path.by([3.0, 0.0, 0.0]);
            path.by([item, 0.0, 0.0]);
            path.by([0.0, item, 0.0]);
            path.by([0.0, 5.0, 0.0]);
        }
        path.end()
    };
    MODES.map(in_mode).into()
}
