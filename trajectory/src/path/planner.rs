//! Plans the time law along the path.

use std::collections::VecDeque;

use thiserror::Error;

use super::{Brake, Command, Curve, Item, Limits, Move, Piece, Span};

/// Why an item cannot be planned.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum PathError {
    /// The curve does not begin where the last one ended.
    #[error("the move begins {0} mm away from the end of the last one")]
    Gap(f64),
    /// The feed is not a positive number.
    #[error("a feed of {0} mm/s moves nothing")]
    Feed(f64),
    /// The dwell is negative or not a number.
    #[error("a dwell of {0} s")]
    Dwell(f64),
}

/// Turns items into commands. Everything that it has given out up to a [`Command::Commit`] ends
/// at rest.
#[derive(Debug, Clone)]
pub struct Planner<const N: usize> {
    limits: Limits<N>,
    position: [f64; N],
    out: VecDeque<Command<N>>,
}

/// Gaps up to this are rounding of the caller's, mm.
const GAP: f64 = 1e-6;

impl<const N: usize> Planner<N> {
    /// For a machine with `limits` that rests in `position`.
    pub fn new(limits: Limits<N>, position: [f64; N]) -> Self {
        Planner {
            limits,
            position,
            out: VecDeque::new(),
        }
    }

    /// Takes the next item.
    ///
    /// # Errors
    /// See [`PathError`]; the item is not taken then.
    pub fn push(&mut self, item: Item<N>) -> Result<(), PathError> {
        match item {
            Item::Dwell { duration, .. } if !(duration >= 0.0 && duration.is_finite()) => {
                Err(PathError::Dwell(duration))
            }
            Item::Dwell { duration, tag } => {
                self.out
                    .extend([Command::Dwell { duration, tag }, Command::Commit]);
                Ok(())
            }
            Item::Move(motion) => self.push_move(motion),
        }
    }

    /// No further item comes for now: whatever was taken is planned to rest.
    pub fn finish(&mut self) {}

    /// The next command, if one is ready.
    pub fn pop(&mut self) -> Option<Command<N>> {
        self.out.pop_front()
    }

    /// Commands that are ready.
    pub fn ready(&self) -> usize {
        self.out.len()
    }

    fn push_move(&mut self, motion: Move<N>) -> Result<(), PathError> {
        let speed = motion.feed.speed();
        if speed.is_nan() || speed <= 0.0 {
            return Err(PathError::Feed(speed));
        }
        let start = motion.curve.start();
        let gap = (0..N)
            .map(|i| (start[i] - self.position[i]).abs())
            .fold(0.0, f64::max);
        if gap.is_nan() || gap > GAP {
            return Err(PathError::Gap(gap));
        }
        let bounds = Bounds::along(&motion.curve, &self.limits, speed);
        let span = Span {
            start: 0.0,
            curve: motion.curve,
            feed: speed,
            tag: motion.tag,
            brake: Brake {
                acceleration: bounds.acceleration,
                jerk: bounds.jerk,
            },
        };
        self.out.extend([Command::Section, Command::Span(span)]);
        self.out
            .extend(rest_to_rest(motion.curve.length(), bounds).map(Command::Piece));
        self.out.push_back(Command::Commit);
        self.position = motion.curve.end();
        Ok(())
    }
}

/// Path speed, acceleration and jerk that, together and in any combination, keep every axis inside
/// its limits.
#[derive(Debug, Clone, Copy)]
struct Bounds {
    speed: f64,
    acceleration: f64,
    jerk: f64,
}

impl Bounds {
    fn along<const N: usize>(curve: &Curve<N>, limits: &Limits<N>, feed: f64) -> Self {
        // |q′|, |q″|, |q‴| of every axis, at most.
        let [d1, d2, d3] = curve.derivative_bounds();
        let least = |f: &dyn Fn(usize) -> f64| (0..N).map(f).fold(f64::INFINITY, f64::min);
        // Curved paths: 0.7 of the acceleration and 0.3 of the jerk for the curvature's own terms.
        let speed = least(&|i| {
            (limits.velocity[i] / d1[i])
                .min((0.7 * limits.acceleration[i] / d2[i]).sqrt())
                .min(libm::cbrt(0.3 * limits.jerk[i] / d3[i]))
        })
        .min(feed);
        let acceleration = least(&|i| {
            let left = limits.acceleration[i] - d2[i] * speed * speed;
            (left / d1[i]).min(0.35 * limits.jerk[i] / (3.0 * d2[i] * speed))
        });
        let jerk = least(&|i| {
            let used = d3[i] * speed * speed * speed + 3.0 * d2[i] * speed * acceleration;
            (limits.jerk[i] - used) / d1[i]
        });
        Bounds {
            speed,
            acceleration,
            jerk,
        }
    }
}

/// The shortest profile over `length` from rest to rest: seven pieces, some of no duration.
fn rest_to_rest(length: f64, bounds: Bounds) -> [Piece; 7] {
    let Bounds {
        speed: vmax,
        acceleration: amax,
        jerk: j,
    } = bounds;
    // Time of constant jerk and of constant acceleration on the way to the speed `v`.
    let ramp = |v: f64| {
        if v * j >= amax * amax {
            (amax / j, v / amax - amax / j)
        } else {
            ((v / j).sqrt(), 0.0)
        }
    };
    let way = |v: f64| {
        let (tj, ta) = ramp(v);
        v * (2.0 * tj + ta) // up and down again
    };
    let mut v = vmax;
    if way(v) > length {
        // Without constant acceleration: length = 2 v √(v/j); with it: length = v (a/j + v/a).
        let short = libm::cbrt(length * length * j / 4.0);
        v = if short * j <= amax * amax {
            short
        } else {
            let b = amax * amax / j;
            ((b * b + 4.0 * amax * length).sqrt() - b) / 2.0
        };
        v = v.min(vmax);
    }
    let (tj, ta) = ramp(v);
    let cruise = ((length - way(v)) / v).max(0.0);
    let a = j * tj;
    let shape = [
        (tj, j, 0.0),
        (ta, 0.0, a),
        (tj, -j, a),
        (cruise, 0.0, 0.0),
        (tj, -j, 0.0),
        (ta, 0.0, -a),
        (tj, j, -a),
    ];
    let mut distance = 0.0;
    let mut speed = 0.0;
    shape.map(|(duration, jerk, acceleration)| {
        let piece = Piece {
            duration,
            distance,
            speed,
            acceleration,
            jerk,
        };
        let (ds, v, _) = piece.at(duration);
        distance += ds;
        speed = v;
        piece
    })
}
