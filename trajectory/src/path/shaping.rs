//! Setpoints through an [input shaper](crate::shaper), one a cycle, on their way from the executor to the axes.
//!
//! Every coordinate is the mean of what the executor had for it over the shaper's length. Whatever the executor does,
//! an override, a feed hold, another plan, a jog, the shaper's state goes on with it, and no limit of an axis that
//! the executor keeps is exceeded. What comes to rest does so later by the shaper's length ([`Shaping::is_settled`]).
//!
//! What is no position is that of the mean delay: the tag, the programmed speed, and the waypoints, so that M-codes
//! are executed where they stand.

use super::Setpoint;
use crate::shaper::Shaper;

/// What the executor had in a cycle.
#[derive(Clone, Copy, Debug)]
struct Sample<const N: usize> {
    setpoint: Setpoint<N>,
    waypoints: u32,
}

/// Shapes setpoints. Allocates only in [`Shaping::new`].
#[derive(Clone, Debug)]
pub struct Shaping<const N: usize> {
    /// How many cycles ago counts with which weight, ascending.
    weights: Vec<(usize, f64)>,
    /// The mean of that, to the nearest cycle.
    mean: usize,
    /// The samples since the last rest, newest at `count` less 1, modulo the length.
    samples: Vec<Sample<N>>,
    count: usize,
    /// Before those.
    rest: Sample<N>,
    /// For so many cycles each coordinate has not changed.
    unchanged: [usize; N],
    /// Setpoints go by it.
    bypassed: bool,
}

impl<const N: usize> Shaping<N> {
    /// By a shaper, with a cycle of `period` s, from rest.
    #[must_use]
    pub fn new(shaper: &Shaper, period: f64, rest: Setpoint<N>) -> Self {
        let weights = shaper.weights(period);
        let length = weights.last().map_or(0, |last| last.0) + 1;
        let rest = Sample {
            setpoint: rest,
            waypoints: 0,
        };
        Self {
            weights,
            mean: (shaper.mean() / period).round() as usize,
            samples: vec![rest; length],
            count: 0,
            rest,
            unchanged: [length; N],
            bypassed: false,
        }
    }

    /// Goes on from rest there, with the count of waypoints at zero.
    pub fn restart(&mut self, rest: Setpoint<N>) {
        self.rest = Sample {
            setpoint: rest,
            waypoints: 0,
        };
        self.count = 0;
        self.unchanged = [self.samples.len(); N];
        self.bypassed = false;
    }

    /// From now on setpoints go by it, until the next [`restart`](Self::restart): whoever asks for that goes on from
    /// the last shaped setpoint, not from the executor's.
    pub fn bypass(&mut self) {
        self.bypassed = true;
    }

    /// The setpoint of the next cycle, of what the executor has for it and of the waypoints that it has come to.
    pub fn shape(&mut self, setpoint: Setpoint<N>, waypoints: u32) -> Setpoint<N> {
        let before = self.ago(0).setpoint.position;
        for (axis, unchanged) in self.unchanged.iter_mut().enumerate() {
            let stays = setpoint.position[axis] == before[axis];
            *unchanged = if stays {
                unchanged.saturating_add(1)
            } else {
                0
            };
        }
        let length = self.samples.len();
        self.samples[self.count % length] = Sample {
            setpoint,
            waypoints,
        };
        self.count += 1;
        if self.bypassed || length == 1 {
            return setpoint;
        }
        let moving = !self.is_settled();
        Setpoint {
            position: self.mean_of(|it| &it.position),
            velocity: self.mean_of(|it| &it.velocity),
            acceleration: self.mean_of(|it| &it.acceleration),
            jerk: self.mean_of(|it| &it.jerk),
            distance: self.mean(|it| it.distance),
            speed: self.mean(|it| it.speed),
            busy: moving || setpoint.busy,
            off_path: self.any(|it| it.off_path),
            ..self.ago(self.mean).setpoint
        }
    }

    /// What the executor had so many cycles ago.
    fn ago(&self, ago: usize) -> &Sample<N> {
        match self.count.checked_sub(ago + 1) {
            Some(place) => &self.samples[place % self.samples.len()],
            None => &self.rest,
        }
    }

    /// The mean of a number; exactly that number where it does not change.
    fn mean(&self, of: impl Fn(&Setpoint<N>) -> f64) -> f64 {
        let newest = of(&self.ago(0).setpoint);
        let weighted =
            |&(ago, weight): &(usize, f64)| weight * (of(&self.ago(ago).setpoint) - newest);
        newest + self.weights.iter().map(weighted).sum::<f64>()
    }

    fn mean_of(&self, of: impl Fn(&Setpoint<N>) -> &[f64; N]) -> [f64; N] {
        std::array::from_fn(|axis| self.mean(|it| of(it)[axis]))
    }

    fn any(&self, of: impl Fn(&Setpoint<N>) -> bool) -> bool {
        let mut weights = self.weights.iter();
        weights.any(|&(ago, _)| of(&self.ago(ago).setpoint))
    }

    /// How many waypoints the shaped path has come to.
    #[must_use]
    pub fn waypoints(&self) -> u32 {
        self.ago(if self.bypassed { 0 } else { self.mean })
            .waypoints
    }

    /// Every axis is where the executor has it.
    #[must_use]
    pub fn is_settled(&self) -> bool {
        (0..N).all(|axis| self.has_settled(axis))
    }

    /// This one is.
    #[must_use]
    pub fn has_settled(&self, axis: usize) -> bool {
        self.bypassed || self.unchanged[axis] + 1 >= self.samples.len()
    }
}
