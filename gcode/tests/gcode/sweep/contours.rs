//! Random contours: lines and arcs with slits, spikes, short edges, and corners that hardly turn or turn back.

use std::f64::consts::{FRAC_PI_8, PI, TAU};
use std::fmt::Write;

pub(super) type Vector = [f64; 2];

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

pub(super) fn minus(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn distance(a: Vector, b: Vector) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// A line, or the arc with a bulge: the tangent of a quarter of its angle, positive to the left.
#[derive(Clone, Copy, Debug)]
pub(super) struct Edge {
    pub(super) from: Vector,
    pub(super) to: Vector,
    pub(super) bulge: f64,
}

impl Edge {
    /// Centre and radius of an arc.
    pub(super) fn circle(&self) -> (Vector, f64) {
        let chord = minus(self.to, self.from);
        let length = chord[0].hypot(chord[1]);
        let angle = 4.0 * self.bulge.atan();
        let radius = length / 2.0 / (angle / 2.0).sin();
        let height = radius * (angle / 2.0).cos() / length;
        let middle = [0, 1].map(|k| (self.from[k] + self.to[k]) / 2.0);
        let center = [middle[0] - chord[1] * height, middle[1] + chord[0] * height];
        (center, radius.abs())
    }

    pub(super) fn length(&self) -> f64 {
        match self.bulge {
            0.0 => distance(self.from, self.to),
            bulge => self.circle().1 * 4.0 * bulge.atan().abs(),
        }
    }

    /// The point at a part of the edge, and the direction there.
    pub(super) fn at(&self, part: f64) -> (Vector, Vector) {
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

    /// How much of the edge is before a point of it.
    pub(super) fn ahead(&self, point: Vector) -> f64 {
        if self.bulge == 0.0 {
            return distance(self.from, point) / self.length();
        }
        let (center, _) = self.circle();
        let (start, here) = (minus(self.from, center), minus(point, center));
        let turn = self.bulge.signum() * (here[1].atan2(here[0]) - start[1].atan2(start[0]));
        turn.rem_euclid(TAU) / (4.0 * self.bulge.atan().abs())
    }

    pub(super) fn distance(&self, point: Vector) -> f64 {
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

pub(super) fn to_all(edges: &[Edge], point: Vector) -> f64 {
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
pub(super) fn turn(edge: &Edge, next: &Edge) -> f64 {
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

/// Whether no edge of an open chain meets another but at their common corner.
fn simple_chain(edges: &[Edge]) -> bool {
    (0..edges.len()).all(|i| {
        (i + 1..edges.len()).all(|j| {
            let (a, b) = (&edges[i], &edges[j]);
            match j - i {
                1 => parts(a, b),
                _ => !meets(a, b) && !meets(b, a),
            }
        })
    })
}

/// A chain of edges with two ends: a walk, a spiral, or a comb of slots.
fn chain(random: &mut Random, radius: f64) -> Vec<Edge> {
    let mut edges = Vec::new();
    let (mut at, mut direction) = ([0.0; 2], random.between(0.0, TAU));
    let mut go = |turn: f64, length: f64, angle: f64| {
        direction += turn;
        let chord = direction + angle / 2.0;
        let to = [at[0] + length * chord.cos(), at[1] + length * chord.sin()];
        edges.push(Edge {
            from: at,
            to,
            bulge: (angle / 4.0).tan(),
        });
        (at, direction) = (to, direction + angle);
    };
    let sense = if random.chance(0.5) { 1.0 } else { -1.0 };
    let count = random.between(3.0, 16.0) as u32;
    let gap = radius * random.scaled(0.5, 6.0);
    match random.between(0.0, 4.0) as u32 {
        // Half circles that grow or shrink.
        0 => {
            let grows = if random.chance(0.5) { 1.0 } else { -1.0 };
            let start = radius * random.between(0.5, 4.0) + gap * f64::from(count);
            for k in 0..count {
                let reach = start + grows * gap * f64::from(k) / 2.0;
                go(0.0, 2.0 * reach, sense * PI);
            }
        }
        // Lines that grow, around corners.
        1 => {
            let corner = sense * random.between(0.8, 2.2);
            let grows = random.chance(0.5);
            for k in 0..count {
                let step = if grows { k + 1 } else { count - k };
                go(corner, gap * f64::from(step) + radius, 0.0);
            }
        }
        // There and back again.
        2 => {
            let (deep, round) = (radius * random.between(2.0, 20.0), random.chance(0.5));
            for k in 0..count {
                let turn = if k % 2 == 0 { sense } else { -sense };
                go(0.0, deep * random.between(0.7, 1.0), 0.0);
                if round {
                    go(0.0, gap, turn * PI);
                } else {
                    go(turn * PI / 2.0, gap, 0.0);
                    go(turn * PI / 2.0, radius, 0.0);
                }
            }
        }
        _ => {
            for _ in 0..count {
                let turn = random.between(-2.6, 2.6) * f64::from(random.chance(0.7));
                let angle = random.between(-3.0, 3.0) * f64::from(random.chance(0.5));
                go(turn, radius * random.scaled(0.02, 20.0), angle);
            }
        }
    }
    edges
}

/// A contour, the tool, and its ways on and off.
pub(super) struct Case {
    /// What is programmed: what leads onto the contour, the contour, what leads off it.
    pub(super) edges: Vec<Edge>,
    /// What is to be left of it, and which edge leads along which of it.
    pub(super) walls: Vec<Edge>,
    pub(super) wall_of: Vec<Option<usize>>,
    /// The edges at whose start there is a plunge.
    plunges: Vec<usize>,
    /// Where the way onto the contour begins, and where the way off it ends.
    pub(super) from: Vector,
    pub(super) to: Vector,
    pub(super) closed: bool,
    pub(super) radius: f64,
    pub(super) left: bool,
    /// In G18.
    pub(super) upright: bool,
}

impl Case {
    /// `None` where chance made no contour.
    pub(super) fn new(seed: u64) -> Option<Case> {
        let mut random = Random(seed);
        if random.chance(0.7) {
            Case::around(&mut random)
        } else {
            Case::open(&mut random)
        }
    }

    fn open(random: &mut Random) -> Option<Case> {
        let radius = random.scaled(0.05, 8.0);
        let edges = chain(random, radius);
        if !simple_chain(&edges) || edges.iter().any(|edge| edge.length() < 1e-5) {
            return None;
        }
        let mut case = Case {
            walls: edges.clone(),
            wall_of: (0..edges.len()).map(Some).collect(),
            edges,
            plunges: Vec::new(),
            from: [0.0; 2],
            to: [0.0; 2],
            closed: false,
            radius,
            left: random.chance(0.5),
            upright: random.chance(0.3),
        };
        case.lead_straight(random, 0.0);
        Some(case)
    }

    /// Once around a region or more, inside or outside.
    fn around(random: &mut Random) -> Option<Case> {
        let mut walls = region(random);
        if random.chance(0.25) {
            let digits = |x: f64| (x * 1e3).round() / 1e3;
            for edge in &mut walls {
                (edge.from, edge.to) = (edge.from.map(digits), edge.to.map(digits));
            }
        }
        if !simple(&walls) || walls.iter().any(|edge| edge.length() < 1e-5) {
            return None;
        }
        if random.chance(0.5) {
            walls.reverse();
            for edge in &mut walls {
                (edge.from, edge.to, edge.bulge) = (edge.to, edge.from, -edge.bulge);
            }
        }
        let radius = random.scaled(0.005, 8.0);
        if random.chance(0.7) {
            let longest = (0..walls.len())
                .filter(|k| walls[*k].bulge == 0.0)
                .max_by(|a, b| walls[*a].length().total_cmp(&walls[*b].length()))?;
            walls.rotate_left(longest);
            let whole = walls[0];
            let middle = whole.at(random.between(0.1, 0.9)).0;
            walls[0].from = middle;
            walls.push(Edge {
                to: middle,
                ..whole
            });
        } else {
            let count = walls.len() as f64;
            walls.rotate_left(random.between(0.0, count) as usize);
        }
        let count = walls.len();
        let mut case = Case {
            edges: walls.clone(),
            wall_of: (0..count).map(Some).collect(),
            walls,
            plunges: Vec::new(),
            from: [0.0; 2],
            to: [0.0; 2],
            closed: true,
            radius,
            left: random.chance(0.5),
            upright: random.chance(0.3),
        };
        case.lead(random);
        case.leads_are_free().then_some(case)
    }

    pub(super) fn side(&self) -> f64 {
        if self.left { 1.0 } else { -1.0 }
    }

    /// Towards the tool from where a direction leads along.
    pub(super) fn aside(&self, along: Vector) -> Vector {
        [-along[1] * self.side(), along[0] * self.side()]
    }

    /// What leads onto a closed contour, and off it.
    fn lead(&mut self, random: &mut Random) {
        let count = self.walls.len();
        let (first, last) = (self.walls[0], self.walls[count - 1]);
        let outside = turn(&last, &first) * self.side() < -0.01;
        if outside && first.bulge == 0.0 && last.bulge == 0.0 && random.chance(0.7) {
            // Straight on at the corner, where the contour begins and ends.
            let far = self.radius * random.scaled(0.1, 4.0);
            let ((_, along), (_, behind)) = (first.at(0.0), last.at(1.0));
            self.edges[0].from = [0, 1].map(|k| first.from[k] - along[k] * far);
            self.edges[count - 1].to = [0, 1].map(|k| last.to[k] + behind[k] * far);
            self.lead_straight(random, 0.0);
            return;
        }
        if random.chance(0.15) {
            // Once more, maybe deeper.
            self.plunges.extend(random.chance(0.5).then_some(count));
            self.edges.extend_from_within(..);
            self.wall_of.extend_from_within(..);
        }
        if random.chance(0.5) {
            // Farther than to the start.
            let part = random.between(0.05, 1.0);
            self.edges.push(Edge {
                to: first.at(part).0,
                bulge: (first.bulge.atan() * part).tan(),
                ..first
            });
            self.wall_of.push(Some(0));
        }
        let Some(end) = self.edges.last().copied() else {
            return;
        };
        let style = random.between(0.0, 10.0) as u32;
        let ((at, along), (out, behind)) = (first.at(0.0), end.at(1.0));
        let (aside, aside_out) = (self.aside(along), self.aside(behind));
        let point = |at: Vector, a: Vector, x: f64, b: Vector, y: f64| {
            [0, 1].map(|k| at[k] + a[k] * x + b[k] * y)
        };
        match style {
            0..=4 => {
                let round = self.radius * random.between(0.9, 3.0);
                let bulge = (FRAC_PI_8 * self.side().signum()).tan();
                let begin = point(at, along, -round, aside, round);
                let stop = point(out, behind, round, aside_out, round);
                self.frame(
                    Edge {
                        from: begin,
                        to: at,
                        bulge,
                    },
                    Edge {
                        from: out,
                        to: stop,
                        bulge,
                    },
                );
                self.lead_straight(random, 0.2);
            }
            5..=6 => {
                let angle = random.between(0.2, 1.5);
                let far = self.radius * random.between(1.0, 4.0);
                let (x, y) = (far * angle.cos(), far * angle.sin());
                let begin = point(at, along, -x, aside, y);
                let stop = point(out, behind, x, aside_out, y);
                let bulge = 0.0;
                self.frame(
                    Edge {
                        from: begin,
                        to: at,
                        bulge,
                    },
                    Edge {
                        from: out,
                        to: stop,
                        bulge,
                    },
                );
                self.lead_straight(random, 0.0);
            }
            _ => {
                let least = if style == 9 { -1.0 } else { 0.3 };
                self.lead_straight(random, least);
            }
        }
    }

    /// Whether what leads onto the contour and off it does not cross it.
    fn leads_are_free(&self) -> bool {
        let leads = self.edges.iter().zip(&self.wall_of);
        let leads = leads.filter(|(_, wall)| wall.is_none());
        leads.enumerate().all(|(k, (lead, _))| {
            let (from, to) = if k == 0 { (0.0, 0.95) } else { (0.05, 1.0) };
            let cut = Edge {
                from: lead.at(from).0,
                to: lead.at(to).0,
                bulge: (lead.bulge.atan() * 0.95).tan(),
            };
            (self.walls.iter()).all(|wall| !meets(&cut, wall) && !meets(wall, &cut))
        })
    }

    /// Puts edges in front of the contour and behind it.
    fn frame(&mut self, before: Edge, behind: Edge) {
        self.edges.insert(0, before);
        self.edges.push(behind);
        self.wall_of.insert(0, None);
        self.wall_of.push(None);
        for plunge in &mut self.plunges {
            *plunge += 1;
        }
    }

    /// Ways on and off that come from the tool's side by an angle of at least so much.
    fn lead_straight(&mut self, random: &mut Random, least: f64) {
        let (Some(first), Some(last)) = (self.edges.first(), self.edges.last()) else {
            return;
        };
        let ((at, along), (out, behind)) = (first.at(0.0), last.at(1.0));
        let mut angle = || random.between(least, least.max(0.0) + 1.5);
        let (on, off) = (angle(), angle());
        let far = self.radius * random.between(1.05, 3.0) + 0.01;
        let (aside, aside_out) = (self.aside(along), self.aside(behind));
        let put = |at: Vector, a: Vector, x: f64, b: Vector, y: f64| {
            [0, 1].map(|k| at[k] + (a[k] * x + b[k] * y) * far)
        };
        self.from = put(at, along, -on.cos(), aside, on.sin());
        self.to = put(out, behind, off.cos(), aside_out, off.sin() + 1.0);
    }

    /// The program, and the line of each edge: the way on is in line 2, the way off in the last.
    pub(super) fn program(&self) -> (String, Vec<u32>) {
        let [x, y, i, j] = if self.upright {
            ['Z', 'X', 'K', 'I']
        } else {
            ['X', 'Y', 'I', 'J']
        };
        let (plane, across) = if self.upright { (18, 'Y') } else { (17, 'Z') };
        let code = if self.left { "G41.1" } else { "G42.1" };
        let mut text = format!("G{plane} F600 G0 {x}{} {y}{}\n", self.from[0], self.from[1]);
        let (start, diameter) = (self.edges[0].from, 2.0 * self.radius);
        writeln!(
            text,
            "{code} D{diameter} G1 {x}{} {y}{}",
            start[0], start[1]
        )
        .unwrap();
        let (mut line, mut lines) = (2, Vec::new());
        for (k, edge) in self.edges.iter().enumerate() {
            if self.plunges.contains(&k) {
                writeln!(text, "G1 {across}-1").unwrap();
                line += 1;
            }
            let to = edge.to;
            if edge.bulge == 0.0 {
                writeln!(text, "G1 {x}{} {y}{}", to[0], to[1]).unwrap();
            } else {
                let (center, _) = edge.circle();
                let center = minus(center, edge.from);
                let code = if edge.bulge > 0.0 { "G3" } else { "G2" };
                let [ci, cj] = center;
                writeln!(text, "{code} {x}{} {y}{} {i}{ci} {j}{cj}", to[0], to[1]).unwrap();
            }
            line += 1;
            lines.push(line);
        }
        writeln!(text, "G40 G1 {x}{} {y}{}\nM2", self.to[0], self.to[1]).unwrap();
        (text, lines)
    }
}
