//! How an axis follows the velocities that its drive is sent: how much later, and how slowly.
//!
//! # What is solved
//!
//! At each SYNC tₖ the drive latches a velocity vₖ, which holds until the next one. Their sum over time is a
//! position p(t), a polyline with its corners at the SYNCs. A drive whose delay is D and whose lag is τ follows it so:
//!
//! ```text
//! τ ẏ(t) = p(t) − y(t),     x(t) = c + K y(t − D)
//! ```
//!
//! K is 1 where the drive's unit of velocity is what the machine file has it to be. x is seen at the SYNCs, and D, τ and K are
//! looked for with which it is explained best. Nothing of how the controller came to what it sent is needed, so that its
//! loop may be closed about the axis meanwhile, with settings that are wrong.
//!
//! # How
//!
//! y has a closed form between two corners, so that it is exact for any D and τ at one exponential a cycle. The offset c is one
//! for each window of half a second: what an axis loses on its way, by a torque that its speed loop gives way to, is no
//! delay. What is left over is made least by Gauss-Newton steps in D, τ and K (their derivatives are differences), from the best
//! of a grid.
//!
//! At a constant velocity D and τ do the same, a distance of K v (D + τ), and swings alone tell them apart. So their sum is
//! known far better than each of them, and is what is looked for beside τ. Where τ is short beside the cycle no log tells it apart
//! from D, as all that is seen is where the axis is at the SYNCs: then the sum alone is told.
//!
//! An interval has two parts, as those of the [estimate](super::estimate) have: what the figures change by as twentieths of the
//! windows are left out, and by how much windows of half and of twice the length say otherwise. The second is that of a
//! drive that does not follow as the equation has it.

use super::AxisSample;
use super::estimate::Figure;
use super::fit::jackknife;
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

/// Length of the windows that have an offset of their own, s.
const WINDOW: f64 = 0.5;
/// The others by which it is judged how well the equation holds, parts of it.
const OTHERS: [f64; 2] = [0.5, 2.0];
/// So many parts of all windows are left out in turn.
const PARTS: usize = 20;
/// Least of what has to be seen in motion, s.
const LEAST: f64 = 2.0;
/// Gauss-Newton steps at the most.
const STEPS: usize = 40;
/// A lag that is less certain than by this part of the whole is not told apart from the delay.
const APART: f64 = 0.25;
/// What keeps columns that hardly differ from being an obstacle, parts of their squares.
const RIDGE: f64 = 1e-9;
/// Differences by which derivatives are taken, s.
const NUDGE: f64 = 1e-6;
/// Lags that are tried first, s.
const LAGS: [f64; 9] = [0.0, 0.3e-3, 1e-3, 3e-3, 6e-3, 12e-3, 25e-3, 50e-3, 100e-3];
/// Delays that are tried first, cycles.
const DELAYS: [f64; 5] = [-1.0, 0.0, 0.5, 1.0, 3.0];

/// How a drive follows what it is sent.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Following {
    /// How much later it is somewhere at a constant velocity, s.
    pub in_all: Figure,
    /// What of that is delay and what is lag, where the log tells them apart.
    pub parts: Option<Parts>,
    /// How far it goes, of what it is sent.
    pub factor: Figure,
    /// For how long it moved, s.
    pub moving_s: f64,
}

/// Delay and lag.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Parts {
    /// From the SYNC that latches a velocity until the drive begins to go there, s.
    pub delay: Figure,
    /// Time constant with which it goes there, s.
    pub lag: Figure,
}

/// Why a log does not tell it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the axis does not move enough in this log to tell how it follows what it is sent: it takes strokes at several speeds, and \
     velocities that change on the way"
)]
pub struct NotSeen;

/// D + τ, τ and K.
type Parameters = Vector3<f64>;

/// How the axis follows, from a log of so many seconds a cycle.
///
/// # Errors
/// It shows too little.
pub fn following(samples: &[AxisSample], cycle: f64) -> Result<Following, NotSeen> {
    let track = Track::of(samples);
    let windows = track.windows(WINDOW);
    let moving_s: f64 = windows.iter().map(|window| window.length).sum();
    if moving_s < LEAST {
        return Err(NotSeen);
    }
    let first = track.first(&windows, cycle);
    let best = track.solve(&windows, first).ok_or(NotSeen)?;
    let others = OTHERS.map(|part| {
        let windows = track.windows(part * WINDOW);
        track.solve(&windows, best).unwrap_or(best)
    });
    let left_out = track.left_out(&windows, best).ok_or(NotSeen)?;
    let figure = |read: &dyn Fn(&Parameters) -> f64| {
        let left_out: Vec<f64> = left_out.iter().map(read).collect();
        let figure = jackknife(read(&best), &left_out);
        let off = others
            .iter()
            .map(|other| (read(other) - figure.value).abs());
        figure.widened(off.fold(0.0, f64::max))
    };
    let in_all = figure(&|it| it[0]);
    let parts = Parts {
        delay: figure(&|it| it[0] - it[1]),
        lag: figure(&|it| it[1]),
    };
    Ok(Following {
        in_all,
        parts: Some(parts).filter(|parts| parts.lag.uncertainty < APART * in_all.value),
        factor: figure(&|it| it[2]),
        moving_s,
    })
}

/// What was sent and seen, by SYNC.
struct Track {
    times: Vec<f64>,
    /// The velocity from here on.
    velocities: Vec<f64>,
    /// The position that they come to here.
    sent: Vec<f64>,
    /// Where the axis was, where that is known.
    seen: Vec<Option<f64>>,
}

/// SYNCs one behind the other, with an offset of their own.
struct Window {
    begin: usize,
    end: usize,
    /// s
    length: f64,
}

/// What a window says of parameters: products of the derivatives, and of those and what is left over.
#[derive(Clone, Copy)]
struct Products {
    squares: Matrix3<f64>,
    left: Vector3<f64>,
    /// Squares of what is left over.
    cost: f64,
}

impl Track {
    fn of(samples: &[AxisSample]) -> Self {
        let mut track = Self {
            times: Vec::with_capacity(samples.len()),
            velocities: Vec::with_capacity(samples.len()),
            sent: Vec::with_capacity(samples.len()),
            seen: Vec::with_capacity(samples.len()),
        };
        let (mut velocity, mut at) = (0.0, 0.0);
        for sample in samples {
            at += velocity * (sample.time - track.times.last().unwrap_or(&sample.time));
            // Where it is not known it goes on as before.
            velocity = sample.velocity.unwrap_or(velocity);
            track.times.push(sample.time);
            track.velocities.push(velocity);
            track.sent.push(at);
            track.seen.push(sample.velocity.map(|_| sample.act));
        }
        track
    }

    /// Those in which it moves.
    fn windows(&self, length: f64) -> Vec<Window> {
        let mut windows = Vec::new();
        let mut begin = 0;
        for end in 1..self.times.len() {
            let lasts = self.times[end] - self.times[begin];
            if lasts < length {
                continue;
            }
            if self.velocities[begin..end].iter().any(|it| *it != 0.0) {
                windows.push(Window {
                    begin,
                    end,
                    length: lasts,
                });
            }
            begin = end;
        }
        windows
    }

    /// Where a drive of that delay and lag is at the SYNCs, if K is 1.
    fn followed(&self, delay: f64, lag: f64) -> Vec<f64> {
        // From the corner at `from` on, `time` later: the line goes on, and what it is ahead by decays.
        let after = |from: usize, at: f64, time: f64| {
            let ahead = self.velocities[from] * lag;
            let decay = if lag > 0.0 { (-time / lag).exp() } else { 0.0 };
            let line = self.sent[from] + self.velocities[from] * time;
            line - ahead + (at - self.sent[from] + ahead) * decay
        };
        let mut corner = 0;
        let mut at_corner = self.sent.first().copied().unwrap_or_default();
        let place = |&time: &f64| {
            let time = time - delay;
            while corner + 1 < self.times.len() && self.times[corner + 1] <= time {
                let lasts = self.times[corner + 1] - self.times[corner];
                at_corner = after(corner, at_corner, lasts);
                corner += 1;
            }
            after(corner, at_corner, (time - self.times[corner]).max(0.0))
        };
        self.times.iter().map(place).collect()
    }

    /// What each window says of parameters.
    fn products(&self, windows: &[Window], at: Parameters) -> Vec<Products> {
        let [in_all, lag, factor] = [at[0], at[1], at[2]];
        let delay = in_all - lag;
        let here = self.followed(delay, lag);
        let later = self.followed(delay + NUDGE, lag);
        let slower = self.followed(delay - NUDGE, lag + NUDGE);
        let columns = |at: usize| {
            let by = |other: &[f64]| factor * (other[at] - here[at]) / NUDGE;
            let seen = self.seen[at]?;
            let left = seen - factor * here[at];
            Some((Vector3::new(by(&later), by(&slower), here[at]), left))
        };
        let of = |window: &Window| {
            let rows = (window.begin..window.end).filter_map(columns);
            let (mut squares, mut products) = (Matrix3::zeros(), Vector3::zeros());
            let (mut sums, mut left, mut cost, mut count) = (Vector3::zeros(), 0.0, 0.0, 0.0);
            // Products may be far from zero: about the first row there is no loss of digits.
            let mut first = None;
            for (columns, rest) in rows {
                let (about, zero) = *first.get_or_insert((columns, rest));
                let (columns, rest) = (columns - about, rest - zero);
                squares += columns * columns.transpose();
                products += columns * rest;
                sums += columns;
                left += rest;
                cost += rest * rest;
                count += 1.0;
            }
            let count = f64::max(count, 1.0);
            Products {
                squares: squares - sums * sums.transpose() / count,
                left: products - sums * left / count,
                cost: cost - left * left / count,
            }
        };
        windows.iter().map(of).collect()
    }

    /// The best of the grid.
    fn first(&self, windows: &[Window], cycle: f64) -> Parameters {
        let delays = DELAYS.map(|cycles| cycles * cycle);
        let grid = delays
            .iter()
            .flat_map(|&delay| LAGS.map(|lag| Vector3::new(delay + lag, lag, 1.0)));
        let costs = grid.map(|at| (cost(&self.products(windows, at)), at));
        let best = costs.min_by(|one, other| one.0.total_cmp(&other.0));
        best.map_or(Vector3::new(0.0, 0.0, 1.0), |it| it.1)
    }

    /// Goes on from parameters to the best; `None` where they cannot be told apart.
    fn solve(&self, windows: &[Window], from: Parameters) -> Option<Parameters> {
        let mut at = from;
        let mut products = self.products(windows, at);
        for _ in 0..STEPS {
            let step = step(&products, at)?;
            let mut part = 1.0;
            let next = loop {
                let mut next = at + step * part;
                next[1] = next[1].max(0.0);
                let tried = self.products(windows, next);
                if cost(&tried) <= cost(&products) {
                    products = tried;
                    break next;
                }
                part /= 4.0;
                if part < 1e-3 {
                    return Some(at);
                }
            };
            let moved = (next - at).abs();
            at = next;
            if moved[0].max(moved[1]) < 1e-9 && moved[2] < 1e-9 {
                break;
            }
        }
        Some(at)
    }

    /// The parameters without a part of the windows, each in turn, to the first order.
    fn left_out(&self, windows: &[Window], best: Parameters) -> Option<Vec<Parameters>> {
        let products = self.products(windows, best);
        let parts = PARTS.min(products.len());
        let without = (0..parts).map(|part| {
            let rest = products.iter().enumerate();
            let rest = rest.filter(|(at, _)| at * parts / products.len() != part);
            let rest: Vec<Products> = rest.map(|it| *it.1).collect();
            Some(best + step(&rest, best)?)
        });
        without.collect()
    }
}

/// What is left over of all windows.
fn cost(products: &[Products]) -> f64 {
    products.iter().map(|it| it.cost).sum()
}

/// Where from parameters the least is, as far as their derivatives tell; a lag that would fall below 0 stays.
fn step(products: &[Products], at: Parameters) -> Option<Parameters> {
    let squares: Matrix3<f64> = products.iter().map(|it| it.squares).sum();
    let left: Vector3<f64> = products.iter().map(|it| it.left).sum();
    let scale = squares.diagonal().map(|it| it.sqrt().recip());
    if !scale.iter().all(|it| it.is_finite()) {
        return None;
    }
    let solve = |squares: Matrix3<f64>, left: Vector3<f64>| {
        let scaled = Matrix3::from_diagonal(&scale) * squares * Matrix3::from_diagonal(&scale);
        let solution = (scaled + Matrix3::identity() * RIDGE)
            .cholesky()?
            .solve(&left.component_mul(&scale));
        Some(solution.component_mul(&scale))
    };
    let step = solve(squares, left)?;
    if at[1] + step[1] >= 0.0 || at[1] > 0.0 {
        return Some(step);
    }
    let (mut squares, mut left) = (squares, left);
    for other in [0, 2] {
        (squares[(1, other)], squares[(other, 1)]) = (0.0, 0.0);
    }
    left[1] = 0.0;
    solve(squares, left)
}
