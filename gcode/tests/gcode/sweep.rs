//! Proof of cutter compensation by sweeping the tool: random closed contours, with short lines, tiny
//! arcs, slits, spikes and corners that hardly turn or turn back, gone around inside and outside.
//!
//! Nothing here knows how a path is made: a contour is measured by its own lines and arcs, and the
//! tool is a disc that is put on every point of what came out.

use std::f64::consts::{PI, TAU};
use std::fmt::Write;

use syncline_gcode::{Action, Command, Fault, Point};

use super::listing::{run, run_with, xyz};

type Vector = [f64; 2];

/// How deep the tool may cut into the contour, mm.
const DEPTH: f64 = 0.002;

/// Numbers that look random, and are the same for a seed.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// From 0 to 1.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((bits ^ (bits >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Over the decades between two numbers.
    pub(crate) fn scaled(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    pub(crate) fn chance(&mut self, of: f64) -> bool {
        self.unit() < of
    }
}

fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1]]
}

fn distance(a: Vector, b: Vector) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// A line, or the arc with a bulge: the tangent of a quarter of its angle, positive to the left.
#[derive(Clone, Copy, Debug)]
struct Edge {
    from: Vector,
    to: Vector,
    bulge: f64,
}

impl Edge {
    /// Centre and radius of an arc.
    fn circle(&self) -> (Vector, f64) {
        let chord = minus(self.to, self.from);
        let length = chord[0].hypot(chord[1]);
        let angle = 4.0 * self.bulge.atan();
        let radius = length / 2.0 / (angle / 2.0).sin();
        let height = radius * (angle / 2.0).cos() / length;
        let middle = [0, 1].map(|k| (self.from[k] + self.to[k]) / 2.0);
        let center = [middle[0] - chord[1] * height, middle[1] + chord[0] * height];
        (center, radius.abs())
    }

    fn length(&self) -> f64 {
        match self.bulge {
            0.0 => distance(self.from, self.to),
            bulge => self.circle().1 * 4.0 * bulge.atan().abs(),
        }
    }

    /// The point at a part of the edge, and the direction there.
    fn at(&self, part: f64) -> (Vector, Vector) {
        if self.bulge == 0.0 {
            let along = minus(self.to, self.from);
            let length = along[0].hypot(along[1]);
            let point = [0, 1].map(|k| self.from[k] + along[k] * part);
            return (point, along.map(|x| x / length));
        }
        let (center, radius) = self.circle();
        let start = minus(self.from, center);
        let angle = start[1].atan2(start[0]) + 4.0 * self.bulge.atan() * part;
        let out = [angle.cos(), angle.sin()];
        let left = self.bulge.signum();
        let point = [0, 1].map(|k| center[k] + out[k] * radius);
        (point, [-out[1] * left, out[0] * left])
    }

    fn distance(&self, point: Vector) -> f64 {
        let ends = distance(point, self.from).min(distance(point, self.to));
        if self.bulge == 0.0 {
            let along = minus(self.to, self.from);
            let square = along[0] * along[0] + along[1] * along[1];
            let away = minus(point, self.from);
            let part = (away[0] * along[0] + away[1] * along[1]) / square;
            if (0.0..=1.0).contains(&part) {
                let aside = along[0] * away[1] - along[1] * away[0];
                return ends.min(aside.abs() / square.sqrt());
            }
            return ends;
        }
        let (center, radius) = self.circle();
        let (start, here) = (minus(self.from, center), minus(point, center));
        let turn = self.bulge.signum() * (here[1].atan2(here[0]) - start[1].atan2(start[0]));
        if turn.rem_euclid(TAU) <= 4.0 * self.bulge.atan().abs() {
            return ends.min((distance(point, center) - radius).abs());
        }
        ends
    }

    /// Points along the edge, its ends among them.
    fn points(&self, step: f64) -> impl Iterator<Item = Vector> {
        let count = (self.length() / step).ceil().clamp(2.0, 4000.0) as u32;
        (0..=count).map(move |k| self.at(f64::from(k) / f64::from(count)).0)
    }
}

fn to_all(edges: &[Edge], point: Vector) -> f64 {
    let distances = edges.iter().map(|edge| edge.distance(point));
    distances.fold(f64::INFINITY, f64::min)
}

/// The corners of a region around the origin, to the left: with slits, spikes and short edges.
fn region(random: &mut Random) -> Vec<Edge> {
    let corners = random.between(3.0, 24.0) as usize;
    let rough = random.scaled(0.02, 1.5);
    let mut points: Vec<Vector> = Vec::new();
    for corner in 0..corners {
        let angle = TAU * (corner as f64 + random.between(0.0, 0.9)) / corners as f64;
        let reach = 30.0 * (1.0 + rough * random.between(-0.5, 0.5)).max(0.1);
        let at = [reach * angle.cos(), reach * angle.sin()];
        points.push(at);
        // Something small beside it: a short edge, one that hardly turns, or a spike or slit.
        if random.chance(0.4) {
            let aside = random.scaled(1e-3, 5.0);
            let towards = angle + PI / 2.0 + random.between(-0.5, 0.5);
            points.push([at[0] + aside * towards.cos(), at[1] + aside * towards.sin()]);
        } else if random.chance(0.15) {
            let deep = reach * random.between(0.6, 1.6);
            points.push([deep * angle.cos(), deep * angle.sin()]);
            let back = angle + random.scaled(1e-5, 0.1);
            points.push([reach * back.cos(), reach * back.sin()]);
        }
    }
    let mut edges = Vec::new();
    for (k, from) in points.iter().enumerate() {
        let to = points[(k + 1) % points.len()];
        let arc = random.chance(0.35);
        let size = random.scaled(1e-3, 1.2);
        let bulge = match (arc, random.chance(0.5)) {
            (false, _) => 0.0,
            (true, true) => size,
            (true, false) => -size,
        };
        edges.push(Edge {
            from: *from,
            to,
            bulge,
        });
    }
    round_corners(random, edges)
}

/// Puts arcs that touch both sides into some corners between lines, exactly or to three digits.
fn round_corners(random: &mut Random, edges: Vec<Edge>) -> Vec<Edge> {
    let mut rounded = edges.clone();
    let mut arcs = Vec::new();
    for k in 0..edges.len() {
        let next = (k + 1) % edges.len();
        let lines = edges[k].bulge == 0.0 && edges[next].bulge == 0.0;
        if !lines || random.chance(0.6) {
            continue;
        }
        let ((_, before), (_, behind)) = (edges[k].at(1.0), edges[next].at(0.0));
        let turn = turn(&edges[k], &edges[next]);
        let room = edges[k].length().min(edges[next].length()) * 0.45;
        let cut = room.min(random.scaled(1e-3, 20.0));
        if turn.abs() < 0.01 || turn.abs() > 2.8 {
            continue;
        }
        let corner = edges[k].to;
        let digits = |x: f64| (x * 1e5).round() / 1e5;
        let mut from = [0, 1].map(|i| corner[i] - before[i] * cut);
        let mut to = [0, 1].map(|i| corner[i] + behind[i] * cut);
        if random.chance(0.5) {
            (from, to) = (from.map(digits), to.map(digits));
        }
        rounded[k].to = from;
        rounded[next].from = to;
        arcs.push((
            k,
            Edge {
                from,
                to,
                bulge: (turn / 4.0).tan(),
            },
        ));
    }
    for (k, arc) in arcs.into_iter().rev() {
        rounded.insert(k + 1, arc);
    }
    rounded
}

/// How far the direction turns from one edge to the next, positive to the left.
fn turn(edge: &Edge, next: &Edge) -> f64 {
    let ((_, before), (_, behind)) = (edge.at(1.0), next.at(0.0));
    (before[0] * behind[1] - before[1] * behind[0])
        .atan2(before[0] * behind[0] + before[1] * behind[1])
}

/// Whether no edge meets another but at their common corner. An arc is judged by points along it,
/// and left out where those do not tell.
fn simple(edges: &[Edge]) -> bool {
    let count = edges.len();
    (0..count).all(|i| {
        (i + 1..count).all(|j| {
            let (a, b) = (&edges[i], &edges[j]);
            match (j - i, i + count - j) {
                (1, _) => parts(a, b),
                (_, 1) => parts(b, a),
                _ => !meets(a, b) && !meets(b, a),
            }
        })
    })
}

/// Whether an edge meets the next at their corner alone; arcs may be back at once.
fn parts(edge: &Edge, next: &Edge) -> bool {
    let lines = edge.bulge == 0.0 && next.bulge == 0.0;
    let away = |edge: &Edge, from, to, other| {
        let cut = Edge {
            from: edge.at(from).0,
            to: edge.at(to).0,
            bulge: (edge.bulge.atan() * (to - from)).tan(),
        };
        !meets(&cut, other)
    };
    let apart = || away(edge, 0.0, 0.9, next) && away(next, 0.1, 1.0, edge);
    lines || (turn(edge, next).abs() < 2.8 && apart())
}

/// Whether an edge meets another, or may.
fn meets(edge: &Edge, other: &Edge) -> bool {
    if edge.bulge == 0.0 && other.bulge == 0.0 {
        let apart = |a: &Edge, b: &Edge| {
            let along = minus(a.to, a.from);
            let [from, to] = [b.from, b.to].map(|point| {
                let away = minus(point, a.from);
                along[0] * away[1] - along[1] * away[0]
            });
            from * to > 0.0
        };
        return !apart(edge, other) && !apart(other, edge);
    }
    if edge.bulge == 0.0 {
        return false;
    }
    let step = edge.length() / 256.0;
    edge.points(step).any(|point| other.distance(point) < step)
}

/// A contour, and the tool on its way around it.
struct Case {
    edges: Vec<Edge>,
    radius: f64,
    left: bool,
}

impl Case {
    /// A contour that begins in the middle of a line; `None` where chance made no region.
    fn new(seed: u64) -> Option<Case> {
        let mut random = Random(seed);
        let mut edges = region(&mut random);
        if !simple(&edges) || edges.iter().any(|edge| edge.length() < 1e-5) {
            return None;
        }
        if random.chance(0.5) {
            edges.reverse();
            for edge in &mut edges {
                (edge.from, edge.to, edge.bulge) = (edge.to, edge.from, -edge.bulge);
            }
        }
        let longest = (0..edges.len())
            .filter(|k| edges[*k].bulge == 0.0)
            .max_by(|a, b| edges[*a].length().total_cmp(&edges[*b].length()))?;
        edges.rotate_left(longest);
        let whole = edges[0];
        let middle = whole.at(0.5).0;
        edges[0].from = middle;
        edges.push(Edge {
            to: middle,
            ..whole
        });
        let (radius, left) = (random.scaled(0.005, 8.0), random.chance(0.5));
        Some(Case {
            edges,
            radius,
            left,
        })
    }

    /// The contour is in lines 3 and on.
    fn program(&self) -> String {
        let (start, along) = self.edges[0].at(0.0);
        let before = 2.0 * self.radius + 1.0;
        let from = [0, 1].map(|k| start[k] - along[k] * before);
        let code = if self.left { "G41.1" } else { "G42.1" };
        let mut text = format!("F600 G0 X{} Y{}\n", from[0], from[1]);
        let diameter = 2.0 * self.radius;
        writeln!(text, "{code} D{diameter} G1 X{} Y{}", start[0], start[1]).unwrap();
        for edge in &self.edges {
            let [x, y] = edge.to;
            if edge.bulge == 0.0 {
                writeln!(text, "G1 X{x} Y{y}").unwrap();
            } else {
                let (center, _) = edge.circle();
                let [i, j] = minus(center, edge.from);
                let code = if edge.bulge > 0.0 { "G3" } else { "G2" };
                writeln!(text, "{code} X{x} Y{y} I{i} J{j}").unwrap();
            }
        }
        text + "G40 G0 Z10\nM2\n"
    }

    /// Points to the tool's side of the contour, one radius away, each with its point on the edge.
    fn beside(&self, edge: &Edge, step: f64) -> Vec<(Vector, Vector)> {
        let count = (edge.length() / step).ceil().clamp(2.0, 400.0) as u32;
        let side = if self.left { self.radius } else { -self.radius };
        let even = (0..count).map(|k| (f64::from(k) + 0.5) / f64::from(count));
        // And ever closer to both ends.
        let start = (1..14).map(|k| 0.5f64.powi(k));
        let end = start.clone().map(|part| 1.0 - part);
        (even.chain(start).chain(end))
            .map(|part| {
                let (point, along) = edge.at(part);
                (
                    point,
                    [point[0] - along[1] * side, point[1] + along[0] * side],
                )
            })
            .collect()
    }

    /// Where the tool's centre is that touches a corner at an end of an edge, and cuts into neither of the blocks there.
    fn around_corners(&self, index: usize) -> impl Iterator<Item = Vector> + '_ {
        let count = self.edges.len();
        let near = [count - 1, 0, 1].map(|k| self.edges[(index + k) % count]);
        let corners = [self.edges[index].from, self.edges[index].to];
        let angles = (0..720).map(|k| TAU * f64::from(k) / 720.0);
        let centers = angles.flat_map(move |angle| {
            corners.map(|[x, y]| [x + self.radius * angle.cos(), y + self.radius * angle.sin()])
        });
        centers.filter(move |center| to_all(&near, *center) > self.radius - 1e-9)
    }

    /// Whether the tool can stand there without cutting into the contour.
    fn stands(&self, center: Vector, depth: f64) -> bool {
        to_all(&self.edges, center) > self.radius - depth
    }
}

/// What the tool's centre goes along between the moves on and off.
fn path(commands: &[Command]) -> Vec<Edge> {
    let flat = |point: &Point| [point.0[0], point.0[1]];
    let mut at = [0.0; 2];
    let mut path = Vec::new();
    for command in commands {
        let to = match &command.action {
            Action::Rapid { to } | Action::Feed { to, .. } => {
                path.push(Edge {
                    from: at,
                    to: flat(to),
                    bulge: 0.0,
                });
                flat(to)
            }
            Action::Arc { arc, .. } => {
                // In halves, so that none is a full circle.
                let mut from = at;
                for part in 1..=4 {
                    let to = flat(&arc.at(f64::from(part) / 4.0));
                    path.push(Edge {
                        from,
                        to,
                        bulge: (arc.sweep / 16.0).tan(),
                    });
                    from = to;
                }
                flat(&arc.to)
            }
            _ => at,
        };
        at = to;
    }
    path.retain(|edge| distance(edge.from, edge.to) > 1e-12);
    // The way to the start, on and off.
    path[2..path.len() - 1].to_vec()
}

/// How deep a tool on this edge cuts into the contour at most.
fn depth(case: &Case, edge: &Edge) -> f64 {
    let near: Vec<Edge> = (case.edges.iter())
        .filter(|other| other.distance(edge.at(0.5).0) < case.radius + edge.length())
        .copied()
        .collect();
    let cut = |part: f64| case.radius - to_all(&near, edge.at(part).0);
    let count = (edge.length() / (0.02 * case.radius).max(0.02))
        .ceil()
        .clamp(4.0, 400.0);
    let mut deepest = f64::NEG_INFINITY;
    for k in 0..=count as u32 {
        // The nearest of the deepest, by thirds.
        let middle = f64::from(k) / count;
        deepest = deepest.max(cut(middle));
        if cut(middle) > -0.01 * case.radius {
            let (mut low, mut high) = (
                (middle - 1.0 / count).max(0.0),
                (middle + 1.0 / count).min(1.0),
            );
            for _ in 0..12 {
                let third = (high - low) / 3.0;
                if cut(low + third) > cut(high - third) {
                    high -= third;
                } else {
                    low += third;
                }
            }
            deepest = deepest.max(cut((low + high) / 2.0));
        }
    }
    deepest
}

fn judge_path(case: &Case, commands: &[Command], seed: u64) {
    let path = path(commands);
    for edge in &path {
        let depth = depth(case, edge);
        assert!(
            depth < DEPTH,
            "seed {seed}: {depth} mm deep at {edge:?}\n{}",
            case.program()
        );
    }
    for edge in &case.edges {
        for (point, center) in case.beside(edge, 0.3) {
            if case.stands(center, 1e-10) {
                let left = to_all(&path, point) - case.radius;
                assert!(
                    left < DEPTH,
                    "seed {seed}: {left} mm left at {point:?}\n{}",
                    case.program()
                );
            }
        }
    }
}

/// A refusal is right if the tool cannot touch one of the two blocks anywhere, or cannot stand
/// beside one of them, or at its corners, where the other is.
fn judge_refusal(case: &Case, line: u32, fault: &Fault, seed: u64) {
    let other = match fault {
        Fault::CutterArc { .. } => line,
        Fault::CutterCorner { line } | Fault::CutterGouge { line, .. } => *line,
        other => panic!("seed {seed}: {other}\n{}", case.program()),
    };
    let indices = [line, other].map(|line| (line as usize).saturating_sub(3));
    let edges = indices.map(|index| case.edges[index]);
    let right = indices.iter().zip(&edges).any(|(index, edge)| {
        let step = edge.length() / 300.0;
        let beside = case.beside(edge, step);
        match fault {
            Fault::CutterGouge { .. } => {
                let cuts = |center| {
                    let depths = edges.iter().map(|edge| case.radius - edge.distance(center));
                    depths.fold(0.0, f64::max) > 0.0005
                };
                let beside = beside.into_iter().map(|(_, center)| center);
                beside.chain(case.around_corners(*index)).any(cuts)
            }
            _ => beside
                .iter()
                .all(|(_, center)| !case.stands(*center, 1e-10)),
        }
    });
    assert!(
        right,
        "seed {seed}: {fault} in line {line} is no reason\n{}",
        case.program()
    );
}

/// Judges so many contours from a seed on; how many of them the tool fits into.
fn sweep(first: u64, wanted: u32) -> u32 {
    let (mut contours, mut accepted) = (0, 0);
    for seed in first.. {
        let Some(case) = Case::new(seed) else {
            continue;
        };
        match run_with(xyz(), &case.program()) {
            Ok(commands) => {
                judge_path(&case, &commands, seed);
                accepted += 1;
            }
            Err(error) => judge_refusal(&case, error.line, &error.fault, seed),
        }
        contours += 1;
        if contours == wanted {
            break;
        }
    }
    println!("{accepted} of {contours} contours are accepted");
    accepted
}

#[test]
fn nothing_is_cut_and_all_in_reach_is_touched() {
    assert!(sweep(0, 100) > 25);
}

/// The tool went back behind an arc that is all but cut away, into the line before it.
#[test]
fn a_short_arc_between_two_inside_corners() {
    sweep(1_019_237, 1);
}

/// The tool rolls around a corner into another one across the neck of a bottle.
#[test]
fn a_neck_between_two_corners() {
    sweep(1_051_592, 1);
}

/// Takes minutes: `cargo test -p syncline-gcode -- --ignored ten_thousand`.
#[test]
#[ignore = "takes minutes"]
fn of_ten_thousand_contours_nothing_is_cut_and_all_in_reach_is_touched() {
    assert!(sweep(1_000_000, 10_000) > 2_500);
}

/// Whatever the contour, also one that crosses itself: an answer, and moves that hang together.
#[test]
fn any_contour_has_an_answer() {
    for seed in 0..2000 {
        let mut random = Random(seed);
        let mut text = "F600 G1 X-50 Y-50\nG41.1 D6 G91 X50 Y50\n".to_owned();
        for _ in 0..12 {
            let [x, y, i, j] =
                [(); 4].map(|()| random.scaled(1e-6, 30.0) * random.between(-1.0, 1.0));
            match random.between(0.0, 5.0) as u32 {
                0..=2 => writeln!(text, "G1 X{x} Y{y}").unwrap(),
                3 => writeln!(text, "G2 I{i} J{j}").unwrap(),
                _ => writeln!(text, "G3 X{} Y{} I{i} J{j} Z1", 2.0 * i, 2.0 * j).unwrap(),
            }
        }
        let Ok(commands) = run(&(text + "G40 G1 X10\nM2")) else {
            continue;
        };
        let mut at = Point::ZERO;
        for command in &commands {
            match &command.action {
                Action::Rapid { to } | Action::Feed { to, .. } => at = *to,
                Action::Arc { arc, .. } => {
                    assert_eq!(arc.from, at, "seed {seed}");
                    at = arc.to;
                }
                _ => {}
            }
        }
    }
}
