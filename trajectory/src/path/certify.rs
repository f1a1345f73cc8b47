//! What a piece of the plan asks of the axes, between the samples too.

use super::{Limits, Piece, Span};

/// The greatest values as parts of their limits: 1 is the limit.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Load {
    /// Path speed against the feed and axis velocities against theirs.
    pub velocity: f64,
    /// Axis accelerations.
    pub acceleration: f64,
    /// Axis jerks.
    pub jerk: f64,
}

impl Load {
    /// Of both.
    pub fn max(self, other: Load) -> Load {
        Load {
            velocity: self.velocity.max(other.velocity),
            acceleration: self.acceleration.max(other.acceleration),
            jerk: self.jerk.max(other.jerk),
        }
    }
}

/// Intervals that a piece on a curve is sampled in.
const INTERVALS: usize = 4;

/// Upper bounds of what `piece` on `span` asks of the axes.
///
/// On a line the bounds are exact. On a curve they hold the greatest of five samples plus an eighth
/// of the greatest second difference, the most that a curve which bends no more than between the
/// samples rises above them.
pub fn load<const N: usize>(piece: &Piece, span: &Span<N>, limits: &Limits<N>) -> Load {
    let mut top = piece.speed.max(piece.at(piece.duration).1);
    if piece.acceleration * piece.jerk < 0.0 {
        let turn = -piece.acceleration / piece.jerk;
        if turn < piece.duration {
            top = top.max(piece.at(turn).1);
        }
    }
    let mut load = Load {
        velocity: top / span.speed,
        ..Load::default()
    };
    if let Some(direction) = span.curve.direction() {
        let last = piece.at(piece.duration).2;
        let steepest = piece.acceleration.abs().max(last.abs());
        for i in 0..N {
            let d = direction[i].abs();
            load.velocity = load.velocity.max(d * top / limits.velocity[i]);
            load.acceleration = load.acceleration.max(d * steepest / limits.acceleration[i]);
            load.jerk = load.jerk.max(d * piece.jerk.abs() / limits.jerk[i]);
        }
        return load;
    }
    let mut samples = [[[0.0; N]; 3]; INTERVALS + 1];
    for (k, sample) in samples.iter_mut().enumerate() {
        let (ds, v, a) = piece.at(piece.duration * k as f64 / INTERVALS as f64);
        let at = span.curve.at((piece.distance - span.start) + ds);
        for i in 0..N {
            sample[0][i] = at.d1[i] * v / limits.velocity[i];
            sample[1][i] = (at.d2[i] * v * v + at.d1[i] * a) / limits.acceleration[i];
            sample[2][i] = (at.d3[i] * v * v * v + 3.0 * at.d2[i] * v * a + at.d1[i] * piece.jerk)
                / limits.jerk[i];
        }
    }
    let bound = |what: usize| {
        let mut greatest = 0.0_f64;
        for i in 0..N {
            let y = |k: usize| samples[k][what][i];
            let peak = (0..=INTERVALS).map(|k| y(k).abs()).fold(0.0, f64::max);
            let bend = (1..INTERVALS)
                .map(|k| (y(k - 1) - 2.0 * y(k) + y(k + 1)).abs())
                .fold(0.0, f64::max);
            greatest = greatest.max(peak + bend / 8.0);
        }
        greatest
    };
    load.max(Load {
        velocity: bound(0),
        acceleration: bound(1),
        jerk: bound(2),
    })
}
