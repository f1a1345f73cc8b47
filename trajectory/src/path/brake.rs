//! Slowing down along a given path as hard as the axes allow: to rest, or to a lower speed.
//!
//! On a line that is a closed form. On curves the law is laid over speeds instead of times: with
//! E = s̈²/2 the path jerk is dE/dṡ, so between given speeds a piece of constant jerk is a straight
//! line of E, the distance ∫ ṡ dṡ/√(2E) is least where E is greatest, and the greatest E comes of
//! two passes, back from the end and on from the start. What the axes allow depends on where on the
//! path a speed is reached; that is taken from the round before.

use super::certify::{self, crest};
use super::{Curve, Departure, Derivatives, Limits, Piece, Span};

/// Cells of the way down from the greatest speed, at most.
const MOST_CELLS: usize = 160;
/// Cells in which an acceleration is taken back, at most.
const MOST_RISING: usize = 120;
/// Pieces of a braking law at most.
pub(super) const MOST_PIECES: usize = MOST_CELLS + MOST_RISING;
/// Angle, in rad, over which the crest of a parabola tells what a circle asks for.
const TURN: f64 = 0.06;
/// By how much that may be too little, as a part of it: a sine's third derivative over half the angle,
/// with room for speeds that change meanwhile.
const TURN_ERROR: f64 = 1.5e-5;
/// Parts of a polynomial that deserve a cell of their own.
const POLY_CELLS: f64 = 6.0;

/// How carefully a way down is searched for.
#[derive(Debug, Clone, Copy)]
struct Care {
    /// Cells that it is cut into at first, and at most where the path changes quickly.
    cells: usize,
    most_cells: usize,
    /// Cells in which an acceleration is taken back, at most.
    rising: usize,
    /// Cells at whose ends the jerks that are allowed differ by more, as a part of what they are where
    /// nothing bends, are cut; and the same where an acceleration is taken back.
    uneven: f64,
    uneven_rise: f64,
    /// A way whose nodes move by no more in a round, as a part of its length, is looked at.
    settled: f64,
    /// Times that a piece on a polynomial is halved, at most, to prove that it keeps the limits.
    halvings: usize,
}

/// Between two setpoints.
const HASTY: Care = Care {
    cells: 24,
    most_cells: 72,
    rising: 60,
    uneven: 0.05,
    uneven_rise: 0.02,
    settled: 1e-2,
    halvings: 3,
};
/// Where there is time.
const CAREFUL: Care = Care {
    cells: 32,
    most_cells: MOST_CELLS,
    rising: MOST_RISING,
    uneven: 0.03,
    uneven_rise: 0.02,
    settled: 5e-3,
    halvings: 5,
};
/// Steps in which an acceleration is taken back where nothing bends …
const RISING_STEPS: f64 = 8.0;
/// … and the shortest ones as a part of those.
const SHORTEST: f64 = 0.03;
/// Part of the jerk limit that a curve must leave for braking in closed form.
const RESERVE: f64 = 0.4;
/// An E that is a smaller part of the one where nothing bends is no way down.
const NO_WAY: f64 = 4e-4;
/// Excess over a limit that is rounding, as a part of it.
const ROUNDING: f64 = 1e-9;

/// A law that slows down, and where it ends: at the target speed, without acceleration.
#[derive(Debug, Clone)]
pub(super) struct Braking {
    pieces: [Piece; MOST_PIECES],
    count: usize,
    pub(super) end: Departure,
}

impl Braking {
    fn new(from: Departure) -> Self {
        let nothing = Piece {
            duration: 0.0,
            distance: 0.0,
            speed: 0.0,
            acceleration: 0.0,
            jerk: 0.0,
        };
        Braking {
            pieces: [nothing; MOST_PIECES],
            count: 0,
            end: from,
        }
    }

    pub(super) fn pieces(&self) -> &[Piece] {
        &self.pieces[..self.count]
    }

    fn push(&mut self, duration: f64, jerk: f64) -> Option<()> {
        let piece = self.next(duration, jerk);
        *self.pieces.get_mut(self.count)? = piece;
        self.count += 1;
        let (ds, speed, acceleration) = piece.at(duration);
        self.end = Departure {
            distance: self.end.distance + ds,
            speed,
            acceleration,
        };
        Some(())
    }

    fn next(&self, duration: f64, jerk: f64) -> Piece {
        Piece {
            duration,
            distance: self.end.distance,
            speed: self.end.speed,
            acceleration: self.end.acceleration,
            jerk,
        }
    }
}

/// Geometry under way: the spans of one section from some distance on.
struct Road<S> {
    span: S,
    index: usize,
}

impl<'a, const N: usize, S: Fn(usize) -> Option<&'a Span<N>>> Road<S> {
    /// The span at `distance`, no earlier than the last one asked for.
    fn span_at(&mut self, distance: f64) -> Option<&'a Span<N>> {
        while let Some(next) = (self.span)(self.index + 1)
            && next.start <= distance
        {
            self.index += 1;
        }
        (self.span)(self.index)
    }
}

/// The hardest slowing down found from `from` to the path speed `target` along the spans that
/// `span` counts out. None if a limit breaks on the way.
pub(super) fn brake<'a, const N: usize>(
    span: impl Fn(usize) -> Option<&'a Span<N>>,
    limits: &Limits<N>,
    from: Departure,
    target: f64,
) -> Option<Braking> {
    let mut search = Search::default();
    search.way.care = CAREFUL;
    search
        .go_on(span, limits, from, target, usize::MAX)
        .flatten()
}

/// Rounds that are worth their while.
const MOST_ROUNDS: usize = 40;
/// What work counts, roughly 0.2 µs each with six axes: a look at the path in a place …
const LOOKING: usize = 2;
/// … a node in a round …
const RELAXING: usize = 1;
/// … and a proof for a cell on a polynomial.
const PROVING: usize = 12;

/// The search for the hardest slowing down, which may go on from cycle to cycle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Search<const N: usize> {
    way: Way<N>,
    stage: Stage,
}

/// What comes next in a search.
#[derive(Debug, Clone, Copy)]
enum Stage {
    /// To begin.
    Begin,
    /// An acceleration is taken back; after that comes the first guess, or the way down from another
    /// greatest speed than that before.
    Rise { before: Option<f64> },
    /// A round.
    Round,
    /// Whether the cell of that number keeps the limits, as all before did or not.
    Check { cell: usize, kept: bool },
    /// Whether that is certain.
    Prove { cell: usize, certain: bool },
}

impl<const N: usize> Default for Search<N> {
    fn default() -> Self {
        let node = Node {
            s: 0.0,
            v: 0.0,
            a: 0.0,
            t: 0.0,
            jerk: 0.0,
            uneven: 0.0,
            index: 0,
            rows: [[0.0; 3]; N],
            looked: [0.0; 2],
            off: 0.0,
            share: [SHARE; 2],
        };
        Search {
            way: Way {
                care: HASTY,
                target: 0.0,
                rising: [node; MOST_RISING + 1],
                rises: 0,
                falling: [node; MOST_CELLS + 1],
                falls: 0,
                work: 0,
                tick: 0.0,
                step: 1.0,
                longest: f64::INFINITY,
                stride: f64::INFINITY,
                rounds: 0,
                refined: 0,
                moved: f64::INFINITY,
            },
            stage: Stage::Begin,
        }
    }
}

impl<const N: usize> Search<N> {
    /// The next search begins anew.
    pub(super) fn reset(&mut self) {
        self.stage = Stage::Begin;
    }

    /// As [`brake`], with so much work more. None if there seems to be no way, of nothing if it has to
    /// go on.
    pub(super) fn go_on<'a>(
        &mut self,
        span: impl Fn(usize) -> Option<&'a Span<N>>,
        limits: &Limits<N>,
        from: Departure,
        target: f64,
        work: usize,
    ) -> Option<Option<Braking>> {
        let first = span(0)?;
        if first.curve.direction().is_some()
            && let Some(closed) = brake_gently(first, limits, from, target)
        {
            return Some(Some(closed));
        }
        let found = self.search(span, limits, from, target, work);
        if !matches!(found, Some(None)) {
            self.reset();
        }
        found
    }

    fn search<'a>(
        &mut self,
        span: impl Fn(usize) -> Option<&'a Span<N>>,
        limits: &Limits<N>,
        from: Departure,
        target: f64,
        work: usize,
    ) -> Option<Option<Braking>> {
        let way = &mut self.way;
        way.work = 0;
        while way.work < work {
            self.stage = match self.stage {
                Stage::Begin => {
                    way.begin(target);
                    Stage::Rise { before: None }
                }
                Stage::Rise { before } => {
                    if !way.rise(&span, limits, from, work)? {
                        break;
                    }
                    match before {
                        None => way.guess(limits)?,
                        Some(before) => {
                            way.shrink(before)?;
                            way.relax(limits)?;
                        }
                    }
                    Stage::Round
                }
                Stage::Round => {
                    let cost = (way.falls + 1) * (LOOKING + RELAXING);
                    if way.work > 0 && way.work + cost > work {
                        break;
                    }
                    way.work += cost;
                    way.look(&span, limits)?;
                    if way.is_settled() && !way.refine(&span, limits)? {
                        Stage::Check {
                            cell: 0,
                            kept: true,
                        }
                    } else {
                        way.relax(limits)?;
                        Stage::Round
                    }
                }
                Stage::Check { cell, kept } if cell < way.cells() => Stage::Check {
                    cell: cell + 1,
                    kept: way.keeps(cell, &span, limits)? && kept,
                },
                Stage::Check { .. } if way.ends_beyond(&span)? => return None,
                Stage::Check { kept: true, .. } => Stage::Prove {
                    cell: 0,
                    certain: true,
                },
                Stage::Prove { cell, certain } if cell < way.cells() => Stage::Prove {
                    cell: cell + 1,
                    certain: way.is_certain(cell, &span, limits)? && certain,
                },
                Stage::Prove { certain: true, .. } => return Some(way.law(from)),
                Stage::Check { .. } | Stage::Prove { .. } => {
                    way.rises = 0;
                    Stage::Rise {
                        before: Some(way.falling[0].v),
                    }
                }
            };
        }
        Some(None)
    }
}

/// A speed on the way, what happens in the cell that follows, and the path there.
#[derive(Debug, Clone, Copy)]
struct Node<const N: usize> {
    s: f64,
    v: f64,
    a: f64,
    /// Duration of the cell, s, and the jerk in it.
    t: f64,
    jerk: f64,
    /// By how much the path jerk that is allowed differs between its ends where that tells its jerk.
    uneven: f64,
    /// The path there: on what span, and how.
    index: usize,
    rows: [Row; N],
    /// Where it was looked up last, and in the round before; what that was off.
    looked: [f64; 2],
    off: f64,
    /// Parts of the acceleration limits here and of the jerk limits in the cell that are used.
    share: [f64; 2],
}

/// A law in the making.
#[derive(Debug, Clone, Copy)]
struct Way<const N: usize> {
    care: Care,
    target: f64,
    /// First the acceleration is taken back, in so many cells.
    rising: [Node<N>; MOST_RISING + 1],
    rises: usize,
    /// Then the speed comes down.
    falling: [Node<N>; MOST_CELLS + 1],
    falls: usize,
    /// What was done in this go, counted in halves of a look at the path.
    work: usize,
    /// Duration of its cells in the first guess, and how often some were cut.
    tick: f64,
    /// Part of the longest step in which an acceleration is taken back, that step and the next one.
    step: f64,
    longest: f64,
    stride: f64,
    rounds: usize,
    refined: usize,
    /// By how far the nodes went in the last round, at most, mm.
    moved: f64,
}

/// Part of a cell that is cut off on either side of a joint.
const SHORT: f64 = 0.05;
/// The plan that is left may be at its limits, so that nothing proves that the first cells keep them
/// closer than this.
const ENTRY: usize = 2;
const ENTRY_SLACK: f64 = 1e-6;
/// What is used of the limits where a law that is closer to them is not certain to keep them.
const UNCERTAIN: f64 = 0.985;
/// What is kept of the limits from the first, for what happens between the nodes.
const SHARE: f64 = 0.9992;

impl<const N: usize> Way<N> {
    fn begin(&mut self, target: f64) {
        (self.target, self.rises, self.refined) = (target, 0, 0);
        (self.falls, self.rounds) = (self.care.cells, 0);
        self.moved = f64::INFINITY;
        self.step = 1.0;
        for node in self.rising.iter_mut().chain(&mut self.falling) {
            node.share = [SHARE; 2];
            node.off = 0.0;
        }
    }

    /// The first guess: the closed form with what the axes allow along the path here.
    fn guess(&mut self, limits: &Limits<N>) -> Option<()> {
        let way = self;
        let (cells, target) = (way.falls, way.target);
        let top = way.falling[0];
        let [limit, j] = top.along(limits);
        let above = top.v - target;
        if above <= 0.0 {
            return None;
        }
        let a = top.a;
        let reached = above + a * a / (2.0 * j);
        let peak = (j * reached).sqrt().min(limit);
        // Durations of the parts; in the last one the rest of the acceleration goes.
        let (down, hold, landing, peak) = if a + peak > 0.0 {
            let hold = (reached - peak * peak / j) / peak;
            ((a + peak) / j, hold.max(0.0), peak / j, peak)
        } else {
            (0.0, 0.0, -2.0 * above / a, -a)
        };
        let whole = down + hold + landing;
        let tick = whole / cells as f64;
        way.tick = tick;
        for (k, node) in way.falling[..=cells].iter_mut().enumerate().skip(1) {
            let gone = tick * k as f64;
            let left = whole - gone;
            // From the end, from the start, or in between.
            (node.v, node.a) = if k == cells {
                (target, 0.0)
            } else if left < landing {
                let jerk = peak / landing;
                (target + 0.5 * jerk * left * left, -jerk * left)
            } else if gone < down {
                (top.v + gone * (a - 0.5 * j * gone), a - j * gone)
            } else {
                (target + peak * (left - 0.5 * landing), -peak)
            };
        }
        for k in 0..cells {
            let (now, next) = (way.falling[k], way.falling[k + 1]);
            let t = -2.0 * (now.v - next.v) / (now.a + next.a);
            way.falling[k].t = t;
            way.falling[k].jerk = (next.a - now.a) / t;
            way.falling[k + 1].s = way.falling[k].end()?.distance;
        }
        for node in &mut way.falling[..=cells] {
            node.looked = [node.s; 2];
        }
        Some(())
    }

    /// The speeds on the way down from another greatest speed than `before`.
    fn shrink(&mut self, before: f64) -> Option<()> {
        let above = self.falling[0].v - self.target;
        for node in &mut self.falling[1..=self.falls] {
            node.v = self.target + (node.v - self.target) * (above / (before - self.target));
        }
        (above > 0.0).then_some(())
    }

    /// Takes back the acceleration as fast as the axes allow, step by step; true when it is gone.
    fn rise<'a>(
        &mut self,
        span: impl Fn(usize) -> Option<&'a Span<N>>,
        limits: &Limits<N>,
        from: Departure,
        work: usize,
    ) -> Option<bool> {
        let mut road = Road { span, index: 0 };
        let mut now = from;
        if self.rises == 0 {
            (self.longest, self.stride) = (f64::INFINITY, f64::INFINITY);
        } else {
            let last = &self.rising[self.rises - 1];
            now = last.end()?;
            road.index = last.index;
        }
        while now.acceleration > 1e-9 * from.acceleration.max(0.0) {
            if self.work >= work {
                return Some(false);
            }
            // Cells that are used before their time make the others longer.
            let used = self.rises as f64 / self.care.rising as f64;
            let gone = 1.0 - now.acceleration / from.acceleration;
            let early = (8.0 * (used - gone).clamp(0.0, 1.0)) as u32;
            let loose = self.care.uneven_rise * f64::from(1_u32 << early);
            let node = self.rising[..self.care.rising].get_mut(self.rises)?;
            node.take(now);
            node.look(&mut road, limits, now.distance)?;
            self.work += LOOKING + RELAXING;
            if self.longest.is_infinite() {
                self.longest = self.step * now.acceleration / node.along(limits)[1] / RISING_STEPS;
            }
            self.stride = self.stride.min(self.longest);
            loop {
                self.work += 2 * (LOOKING + RELAXING);
                let uneven = node.ease(&road, limits, self.stride)?;
                if uneven <= loose || self.stride < SHORTEST * self.longest {
                    break;
                }
                self.stride *= 0.5;
            }
            self.stride *= 1.4;
            now = node.end()?;
            self.rises += 1;
        }
        now.acceleration = now.acceleration.min(0.0);
        let top = &mut self.falling[0];
        top.take(now);
        top.look(&mut road, limits, now.distance)?;
        top.looked = [now.distance; 2];
        Some(true)
    }

    /// The nodes are where the path was looked up.
    fn is_settled(&self) -> bool {
        self.moved <= self.care.settled * (self.falling[self.falls].s - self.falling[0].s)
    }

    /// Looks the path up where the nodes are, or where they seem to be going (Anderson, "Iterative
    /// Procedures for Nonlinear Integral Equations", 1965).
    fn look<'a>(
        &mut self,
        span: impl Fn(usize) -> Option<&'a Span<N>>,
        limits: &Limits<N>,
    ) -> Option<()> {
        let mut road = Road {
            span,
            index: self.falling[0].index,
        };
        self.rounds += 1;
        if self.rounds > MOST_ROUNDS {
            return None;
        }
        let (mut along, mut whole) = (0.0, 0.0);
        for node in &self.falling[..=self.falls] {
            let off = node.s - node.looked[1];
            let change = off - node.off;
            along += off * change;
            whole += change * change;
        }
        let part = if self.moved.is_finite() && !self.is_settled() && whole > 0.0 {
            (along / whole).clamp(-2.0, 0.9)
        } else {
            0.0
        };
        let mut least = self.falling[0].s;
        for node in &mut self.falling[1..=self.falls] {
            let off = node.s - node.looked[1];
            let before = node.looked[0] + node.off;
            let next = (node.s - part * (node.s - before)).max(least);
            least = next;
            node.looked = [node.looked[1], next];
            node.off = off;
            node.look(&mut road, limits, next)?;
        }
        Some(())
    }

    /// The way down anew, for the path where it was looked up.
    fn relax(&mut self, limits: &Limits<N>) -> Option<()> {
        let last = self.falls;
        let nodes = &mut self.falling[..=last];
        // Back from the end: the greatest E from where the end is reached.
        let mut most = [0.0; MOST_CELLS + 1];
        for k in (0..last).rev() {
            let (now, next) = (&nodes[k], &nodes[k + 1]);
            let a = -(2.0_f64 * most[k + 1]).sqrt();
            let highs = [
                jerks(next, now.share[1], a, 0.0)[1],
                jerks(now, now.share[1], a, -now.t)[1],
            ];
            let high = highs[0].min(highs[1]);
            let low = accelerations(now, limits)[0].min(0.0);
            let down = now.v - next.v;
            let mut by_jerk = (most[k + 1] + high * down).max(0.0);
            let mut by_acceleration = 0.5 * low * low;
            // Where there is no way down the path is not passed at that speed: it is soon another one.
            let [straight, jerk] = now.unbent(limits);
            if by_jerk < (NO_WAY * straight).min(most[k + 1]) {
                by_jerk = most[k + 1] + jerk * down;
            }
            if by_acceleration < NO_WAY * straight {
                by_acceleration = straight;
            }
            most[k] = by_jerk.min(by_acceleration);
            nodes[k].uneven = if most[k] < by_jerk {
                0.0
            } else {
                (highs[0] - highs[1]).abs()
            };
        }
        // On from the start: the greatest that the jerk allows.
        let mut e = 0.5 * nodes[0].a * nodes[0].a;
        let mut moved = 0.0_f64;
        for k in 0..last {
            let (now, next) = (&nodes[k], &nodes[k + 1]);
            let down = now.v - next.v;
            let lows = [
                jerks(now, now.share[1], now.a, 0.0)[0],
                jerks(next, now.share[1], now.a, now.t)[0],
            ];
            let low = lows[0].max(lows[1]);
            let [straight, jerk] = now.unbent(limits);
            let mut by_jerk = e - low * down;
            if by_jerk < (NO_WAY * straight).min(e) {
                by_jerk = e + jerk * down;
            }
            let e1 = by_jerk.min(most[k + 1]).max(0.0);
            let a1 = -(2.0 * e1).sqrt();
            let now = &mut nodes[k];
            now.t = -2.0 * down / (now.a + a1);
            now.jerk = (e - e1) / down;
            if e1 < most[k + 1] {
                now.uneven = (lows[0] - lows[1]).abs();
            }
            let end = now.end()?;
            let next = &mut nodes[k + 1];
            next.a = a1;
            next.s = end.distance;
            moved = moved.max((next.s - next.looked[1]).abs());
            e = e1;
        }
        self.moved = moved;
        Some(())
    }

    /// Cuts cells where the path changes quickly: about the joints of spans, and on polynomials.
    /// False where there is nothing to cut.
    fn refine<'a>(
        &mut self,
        span: impl Fn(usize) -> Option<&'a Span<N>>,
        limits: &Limits<N>,
    ) -> Option<bool> {
        if self.refined >= 2 {
            return Some(false);
        }
        self.refined += 1;
        // The old nodes wait at the end of the room, where the new ones do not come before they went.
        let apart = MOST_CELLS - self.falls;
        self.falling.copy_within(..=self.falls, apart);
        let (mut from, mut to) = (0, 0);
        while from < self.falls {
            let (now, next) = (self.falling[apart + from], self.falling[apart + from + 1]);
            let left = self.care.most_cells - to - (self.falls - from);
            let mut cuts = [0.0; 4];
            let mut count = 0;
            if next.index > now.index {
                // A short cell holds the joint.
                let joint = instant_at(&now.piece(), span(now.index + 1)?.start);
                let short = SHORT * now.t;
                if now.t > 0.5 * self.tick {
                    for cut in [joint - short, joint + short] {
                        if cut > short && cut < now.t - short {
                            cuts[count] = cut;
                            count += 1;
                        }
                    }
                }
            } else if now.t > 0.1 * self.tick {
                let quick = match span(now.index)?.curve {
                    ref curve @ Curve::Poly(_) => (next.s - now.s) / curve.length() * POLY_CELLS,
                    _ => 0.0,
                };
                let uneven = now.uneven / now.along(limits)[1] / self.care.uneven;
                let parts = quick.max(uneven).ceil().clamp(1.0, 4.0);
                for k in 1..parts as usize {
                    cuts[count] = now.t * k as f64 / parts;
                    count += 1;
                }
            }
            self.falling[to] = now;
            to += 1;
            if count <= left {
                let mut begin = 0.0;
                for &cut in &cuts[..count] {
                    self.falling[to - 1].t = cut - begin;
                    let mut node = now;
                    let (ds, speed, acceleration) = now.piece().at(cut);
                    let distance = now.s + ds;
                    node.take(Departure {
                        distance,
                        speed,
                        acceleration,
                    });
                    node.looked = [node.s; 2];
                    node.off = 0.0;
                    node.t = now.t - cut;
                    self.falling[to] = node;
                    begin = cut;
                    to += 1;
                }
            }
            from += 1;
        }
        self.falling[to] = self.falling[MOST_CELLS];
        let cut = to > self.falls;
        self.falls = to;
        Some(cut)
    }

    /// How many cells the way has.
    fn cells(&self) -> usize {
        self.rises + self.falls
    }

    /// The nodes at the ends of a cell.
    fn cell(&self, cell: usize) -> [Node<N>; 2] {
        if cell + 1 < self.rises {
            [self.rising[cell], self.rising[cell + 1]]
        } else if cell < self.rises {
            [self.rising[cell], self.falling[0]]
        } else {
            let cell = cell - self.rises;
            [self.falling[cell], self.falling[cell + 1]]
        }
    }

    fn node(&mut self, node: usize) -> &mut Node<N> {
        if node < self.rises {
            &mut self.rising[node]
        } else {
            &mut self.falling[node - self.rises]
        }
    }

    /// Whether every axis keeps its limits in the cell: at both ends and in the middle, and
    /// between them as far as what is asked bends no more than there. Where one does not, less is
    /// used of it.
    fn keeps<'a>(
        &mut self,
        cell: usize,
        span: impl Fn(usize) -> Option<&'a Span<N>>,
        limits: &Limits<N>,
    ) -> Option<bool> {
        let [now, next] = self.cell(cell);
        let over = now.asks(&next, &span, limits, &mut self.work)?;
        let kept = over.iter().all(|over| *over <= 1.0 + ROUNDING);
        if over[1] > 1.0 + ROUNDING {
            for node in [cell, cell + 1] {
                let share = &mut self.node(node).share[0];
                *share /= over[1] * (1.0 + 1e-3);
            }
        }
        if over[2] > 1.0 + ROUNDING {
            self.node(cell).share[1] /= over[2] * (1.0 + 1e-3);
        }
        Some(kept)
    }

    /// Beyond what is known of the path nothing can be kept.
    fn ends_beyond<'a>(&self, span: impl Fn(usize) -> Option<&'a Span<N>>) -> Option<bool> {
        let end = &self.falling[self.falls];
        let span = span(end.index)?;
        Some(end.s > span.start + span.curve.length() + ROUNDING)
    }

    /// Whether that holds between the samples, too, where they may miss something. Where it is not
    /// certain the cell is cut, or less is used of the limits.
    fn is_certain<'a>(
        &mut self,
        cell: usize,
        span: impl Fn(usize) -> Option<&'a Span<N>>,
        limits: &Limits<N>,
    ) -> Option<bool> {
        let [now, next] = self.cell(cell);
        let slack = if cell < ENTRY { ENTRY_SLACK } else { ROUNDING };
        let proof = (slack, self.care.halvings);
        let certain = now.is_certain(&next, &span, limits, proof, &mut self.work)?;
        if !certain {
            if cell < self.rises && self.step > 0.1 {
                self.step *= 0.5;
            } else if cell >= self.rises
                && now.t > 0.1 * self.tick
                && self.falls < self.care.most_cells
            {
                self.halve(cell - self.rises);
            } else {
                self.node(cell).share = now.share.map(|share| share * UNCERTAIN);
            }
        }
        Some(certain)
    }

    /// Cuts a cell on the way down in two.
    fn halve(&mut self, cell: usize) {
        let mut middle = self.falling[cell];
        let t = 0.5 * middle.t;
        let (ds, speed, acceleration) = middle.piece().at(t);
        middle.take(Departure {
            distance: middle.s + ds,
            speed,
            acceleration,
        });
        middle.t = t;
        middle.looked = [middle.s; 2];
        middle.off = 0.0;
        self.falling[cell].t = t;
        self.falling.copy_within(cell + 1..=self.falls, cell + 2);
        self.falling[cell + 1] = middle;
        self.falls += 1;
    }

    fn law(&self, from: Departure) -> Option<Braking> {
        let mut law = Braking::new(from);
        for node in self.rising[..self.rises]
            .iter()
            .chain(&self.falling[..self.falls])
        {
            law.push(node.t, node.jerk)?;
        }
        law.end.speed = self.target;
        law.end.acceleration = 0.0;
        Some(law)
    }
}

impl<const N: usize> Node<N> {
    fn take(&mut self, state: Departure) {
        (self.s, self.v, self.a) = (state.distance, state.speed, state.acceleration);
    }

    /// Looks up the path.
    fn look<'a>(
        &mut self,
        road: &mut Road<impl Fn(usize) -> Option<&'a Span<N>>>,
        limits: &Limits<N>,
        distance: f64,
    ) -> Option<()> {
        let span = road.span_at(distance)?;
        self.rows = rows(&span.curve.at(distance - span.start), limits);
        self.index = road.index;
        Some(())
    }

    /// The path acceleration and jerk that the axes allow where nothing bends.
    fn along(&self, limits: &Limits<N>) -> [f64; 2] {
        let mut most = [0.0_f64; 2];
        for (i, [d1, ..]) in self.rows.iter().enumerate() {
            most[0] = most[0].max(d1.abs() * limits.jerk[i] / limits.acceleration[i]);
            most[1] = most[1].max(d1.abs());
        }
        most.map(|part| 1.0 / part)
    }

    /// The E and the jerk that the axes allow where nothing bends.
    fn unbent(&self, limits: &Limits<N>) -> [f64; 2] {
        let [acceleration, jerk] = self.along(limits);
        [0.5 * acceleration * acceleration, jerk]
    }

    /// Takes the acceleration back for the duration `tick`, or until there is none, with the lowest
    /// jerk that the axes allow at both ends, their accelerations kept. By how much more is allowed at
    /// the start alone, as a part of what is where nothing bends; infinite if that is too much for an
    /// axis.
    fn ease<'a>(
        &mut self,
        road: &Road<impl Fn(usize) -> Option<&'a Span<N>>>,
        limits: &Limits<N>,
        tick: f64,
    ) -> Option<f64> {
        let along = self.along(limits)[1];
        let [low, high] = jerks(self, self.share[1], self.a, 0.0);
        if low > high + 1e-3 * along {
            return None;
        }
        self.jerk = low;
        let mut uneven = 0.0;
        // The end is where the jerk takes it: the second look is close enough.
        for _ in 0..2 {
            let whole = if self.jerk < 0.0 {
                self.a / -self.jerk
            } else {
                f64::INFINITY
            };
            self.t = if whole < 1.5 * tick { whole } else { tick };
            let mut there = *self;
            let end = self.end()?;
            there.take(end);
            let mut scout = Road {
                span: &road.span,
                index: road.index,
            };
            there.look(&mut scout, limits, end.distance)?;
            let [least, most] = jerks(&there, self.share[1], self.a, self.t);
            let steady = (accelerations(&there, limits)[0] - self.a) / self.t;
            let need = low.max(least).max(steady);
            uneven = if need > high.min(most) {
                f64::INFINITY
            } else {
                (need - low.min(least)) / need.abs().clamp(0.1 * along, along)
            };
            self.jerk = need;
        }
        let gone = self.a * (1.0 - 1e-9);
        if self.jerk < 0.0 && self.t * -self.jerk > gone {
            self.t = self.a / -self.jerk;
        }
        Some(uneven)
    }

    fn piece(&self) -> Piece {
        Piece {
            duration: self.t,
            distance: self.s,
            speed: self.v,
            acceleration: self.a,
            jerk: self.jerk,
        }
    }

    /// The state at the end of the cell.
    fn end(&self) -> Option<Departure> {
        let (ds, speed, acceleration) = self.piece().at(self.t);
        let sane = self.t >= 0.0 && self.t.is_finite() && ds.is_finite();
        sane.then_some(Departure {
            distance: self.s + ds,
            speed,
            acceleration,
        })
    }

    /// Whether every axis provably keeps its limits on the polynomials in the cell up to `next`.
    fn is_certain<'a>(
        &self,
        next: &Self,
        span: &impl Fn(usize) -> Option<&'a Span<N>>,
        limits: &Limits<N>,
        (slack, halvings): (f64, usize),
        work: &mut usize,
    ) -> Option<bool> {
        let piece = self.piece();
        let mut begin = 0.0;
        for index in self.index..=next.index {
            let here = span(index)?;
            let until = if index == next.index {
                piece.duration
            } else {
                instant_at(&piece, span(index + 1)?.start)
            };
            if let Curve::Poly(_) = here.curve {
                let (ds, speed, acceleration) = piece.at(begin);
                let part = Piece {
                    duration: until - begin,
                    distance: piece.distance + ds,
                    speed,
                    acceleration,
                    jerk: piece.jerk,
                };
                *work += PROVING;
                if !certify::keeps(&part, here, limits, slack, halvings) {
                    return Some(false);
                }
            }
            begin = until;
        }
        Some(true)
    }

    /// What the cell up to `next` asks of the axes at most, as parts of their limits.
    fn asks<'a>(
        &self,
        next: &Self,
        span: &impl Fn(usize) -> Option<&'a Span<N>>,
        limits: &Limits<N>,
        work: &mut usize,
    ) -> Option<[f64; 3]> {
        let piece = self.piece();
        let mut begin = 0.0;
        let mut first = (self.rows, self.v, self.a);
        let mut over = [0.0_f64; 3];
        for index in self.index..=next.index {
            let here = span(index)?;
            let on = |t: f64| {
                let (ds, v, a) = piece.at(t);
                let at = here.curve.at((piece.distance - here.start) + ds);
                (rows(&at, limits), v, a)
            };
            if index > self.index {
                first = on(begin);
            }
            let (until, end) = if index == next.index {
                (self.t, (next.rows, next.v, next.a))
            } else {
                let until = instant_at(&piece, span(index + 1)?.start);
                (until, on(until))
            };
            // Polynomials change quickly, circles with the angle.
            let way = piece.at(until).0 - piece.at(begin).0;
            let parts = match here.curve {
                Curve::Line(_) => 1.0,
                Curve::Arc(_) => {
                    let bends = first
                        .0
                        .iter()
                        .zip(&limits.jerk)
                        .map(|(row, j)| row[1].abs() * j);
                    (way * bends.fold(0.0, f64::max) / 3.0 / TURN)
                        .ceil()
                        .clamp(1.0, 32.0)
                }
                Curve::Poly(_) => (2.0 * POLY_CELLS * way / here.curve.length())
                    .ceil()
                    .clamp(1.0, 6.0),
            };
            let bent = match here.curve {
                Curve::Arc(_) => 1.0 + TURN_ERROR,
                _ => 1.0,
            };
            *work += 2 * LOOKING * parts as usize + 1;
            let each = (until - begin) / parts;
            let mut last = first;
            for k in 0..parts as usize {
                let t = begin + each * k as f64;
                let next = if k + 1 == parts as usize {
                    end
                } else {
                    on(t + each)
                };
                let load = loads([&last, &on(t + 0.5 * each), &next], piece.jerk, limits);
                for (over, load) in over.iter_mut().zip(load) {
                    *over = over.max(load * bent);
                }
                last = next;
            }
            begin = until;
        }
        Some(over)
    }
}

/// What the path asks of an axis at a point: its derivatives by path length, the second times
/// three, as parts of the axis's jerk limit.
type Row = [f64; 3];

fn rows<const N: usize>(at: &Derivatives<N>, limits: &Limits<N>) -> [Row; N] {
    let mut rows = [[0.0; 3]; N];
    for i in 0..N {
        let part = 1.0 / limits.jerk[i];
        rows[i] = [at.d1[i] * part, 3.0 * at.d2[i] * part, at.d3[i] * part];
    }
    rows
}

fn is_still(row: &Row) -> bool {
    row.iter().all(|x| *x == 0.0)
}

/// Narrows the range of x to where |slope x + offset| ≤ limit.
fn within(range: &mut [f64; 2], slope: f64, offset: f64, limit: f64) {
    if slope != 0.0 {
        let part = 1.0 / slope;
        let (middle, half) = (-offset * part, limit * part.abs());
        *range = [range[0].max(middle - half), range[1].min(middle + half)];
    }
}

/// The range of path jerks j that every axis allows at a node for the path acceleration a + c j,
/// with that part of the limits.
fn jerks<const N: usize>(node: &Node<N>, share: f64, a: f64, c: f64) -> [f64; 2] {
    let v = node.v;
    let mut range = [f64::NEG_INFINITY, f64::INFINITY];
    for [d1, d2, d3] in &node.rows {
        let slope = d1 + d2 * v * c;
        within(&mut range, slope, (d3 * v * v + d2 * a) * v, share);
    }
    range
}

/// The range of path accelerations at a node for which every axis keeps its limit, and for which
/// there is a path jerk so that every axis keeps that.
fn accelerations<const N: usize>(node: &Node<N>, limits: &Limits<N>) -> [f64; 2] {
    let Node { v, share, .. } = *node;
    let mut range = [f64::NEG_INFINITY, f64::INFINITY];
    for (i, row) in node.rows.iter().enumerate() {
        if is_still(row) {
            continue;
        }
        let limit = share[0] * limits.acceleration[i] / limits.jerk[i];
        within(&mut range, row[0], row[1] * v * v / 3.0, limit);
        for other in &node.rows[..i] {
            if is_still(other) {
                continue;
            }
            // Both ask for the same jerk.
            let slope = v * (row[1] * other[0] - other[1] * row[0]);
            let bend = v * v * v * (row[2] * other[0] - other[2] * row[0]);
            let both = other[0].abs() + row[0].abs();
            within(&mut range, slope, bend, share[1] * both);
        }
    }
    range
}

/// An instant of a piece: what the path asks there, speed and acceleration.
type Sample<const N: usize> = ([Row; N], f64, f64);

/// What every axis is asked for at most, as parts of its velocity, acceleration and jerk limits:
/// the crests of the parabolas through three samples the same time apart.
fn loads<const N: usize>(samples: [&Sample<N>; 3], jerk: f64, limits: &Limits<N>) -> [f64; 3] {
    let mut most = [0.0_f64; 3];
    for i in 0..N {
        if samples.iter().all(|(rows, ..)| is_still(&rows[i])) {
            continue;
        }
        let mut asked = [[0.0; 3]; 3];
        for (k, (rows, v, a)) in samples.into_iter().enumerate() {
            let [d1, d2, d3] = rows[i];
            asked[0][k] = d1 * v;
            asked[1][k] = d2 * v * v / 3.0 + d1 * a;
            asked[2][k] = (d3 * v * v + d2 * a) * v + d1 * jerk;
        }
        let by = [
            limits.jerk[i] / limits.velocity[i],
            limits.jerk[i] / limits.acceleration[i],
            1.0,
        ];
        for what in 0..3 {
            most[what] = most[what].max(crest(asked[what]) * by[what]);
        }
    }
    most
}

/// When the piece reaches a distance, s from its start, between its start and its end.
pub(super) fn instant_at(piece: &Piece, distance: f64) -> f64 {
    let way = distance - piece.distance;
    let mut t = 0.0;
    // The speed changes little within a step: Newton's method is there at once.
    for _ in 0..4 {
        let (ds, v, _) = piece.at(t);
        t = (t + (way - ds) / v.max(1e-9)).clamp(0.0, piece.duration);
    }
    t
}

/// A slowing down that leaves room for whatever the span's bends ask of the axes; on a straight span
/// it is the hardest. None if the span leaves too little room, or ends before.
pub(super) fn brake_gently<const N: usize>(
    span: &Span<N>,
    limits: &Limits<N>,
    from: Departure,
    target: f64,
) -> Option<Braking> {
    gentle(span, limits, &Braking::new(from), target)
}

fn gentle<const N: usize>(
    span: &Span<N>,
    limits: &Limits<N>,
    law: &Braking,
    target: f64,
) -> Option<Braking> {
    let (limit, jerk) = reserve(&span.curve, limits, law.end.speed, law.end.acceleration)?;
    let closed = closed_form(law, target, limit, jerk)?;
    (closed.end.distance <= span.start + span.curve.length()).then_some(closed)
}

/// Path acceleration and jerk that slowing down from speed `v` and acceleration `a` may use
/// anywhere on the curve, whatever its bends ask of the axes meanwhile; `None` if they leave too
/// little.
fn reserve<const N: usize>(
    curve: &Curve<N>,
    limits: &Limits<N>,
    v: f64,
    a: f64,
) -> Option<(f64, f64)> {
    let [d1, d2, d3] = match curve.direction() {
        Some(along) => [along.map(f64::abs), [0.0; N], [0.0; N]],
        None => curve.derivative_bounds(),
    };
    let least = |left: &dyn Fn(usize) -> f64| {
        (0..N)
            .filter(|&i| d1[i] > 0.0)
            .map(|i| left(i) / d1[i])
            .fold(f64::INFINITY, f64::min)
    };
    // The speed still rises while an acceleration is taken back.
    let rising = a.max(0.0);
    let highest = |jerk: f64| v + rising * rising / (2.0 * jerk);
    let bent = d2.iter().any(|d| *d > 0.0);
    let whole = least(&|i| limits.jerk[i]);
    let v = highest(if bent { whole * RESERVE } else { whole });
    let acceleration = least(&|i| limits.acceleration[i] - d2[i] * v * v);
    let top = acceleration.max(a.abs());
    let jerk = least(&|i| limits.jerk[i] - d3[i] * v * v * v - 3.0 * d2[i] * v * top);
    // Also what the bends ask where an axis has no part in the path's direction.
    let kept = (0..N).all(|i| {
        d1[i] * v <= limits.velocity[i] * (1.0 + ROUNDING)
            && d2[i] * v * v <= limits.acceleration[i]
            && d3[i] * v * v * v + 3.0 * d2[i] * v * top <= limits.jerk[i]
    });
    let enough = acceleration * (1.0 + 1e-9) >= a.abs() && jerk >= whole * RESERVE && kept;
    (enough && acceleration > 0.0).then_some((acceleration, jerk))
}

/// The shortest way from `law`'s end down to the speed `target`: jerk −j, deceleration `limit`
/// held if it is reached, jerk +j. `None` where jerk +j alone would be there no earlier.
fn closed_form(law: &Braking, target: f64, limit: f64, j: f64) -> Option<Braking> {
    let a = law.end.acceleration;
    let above = law.end.speed - target;
    // The speed above the target where the acceleration was, or will be, nothing.
    let reached = above + a * a / (2.0 * j);
    if above <= 0.0 && a <= 0.0 || reached <= 0.0 {
        return None;
    }
    let peak = (j * reached).sqrt().min(limit);
    if a + peak < -1e-9 * peak {
        return None;
    }
    let hold = (reached - peak * peak / j) / peak;
    let mut law = law.clone();
    law.push(((a + peak) / j).max(0.0), -j)?;
    law.end.acceleration = -peak;
    law.push(hold.max(0.0), 0.0)?;
    law.push(peak / j, j)?;
    law.end.speed = target;
    law.end.acceleration = 0.0;
    Some(law)
}
