//! Setpoints through an [input shaper](crate::shaper), one a cycle, on their way from the executor to the axes.
//!
//! By [coordinates](Method::Coordinates) every one is the mean of what the executor had for it over the shaper's length. Whatever
//! the executor does, an override, a feed hold, another plan, a jog, the shaper's state goes on with it, and no limit of an axis
//! that the executor keeps is exceeded. By the [clock](Method::Clock) the mean is taken of the distance along the path, and the axes
//! are sent to the path there:
//!
//! ```text
//! s̃ = Σ Aᵢ s(t − tᵢ)     q = γ(s̃)     q′ = γ′s̃′     q″ = γ′s̃″ + γ″s̃′²     q‴ = γ′s̃‴ + 3γ″s̃′s̃″ + γ‴s̃′³
//! ```
//!
//! That s̃′, s̃″ and s̃‴ keep the axes' limits at that place is what the path was [planned](Planner::shape_by) for; that all in a mean
//! lies on one way, what the executor [waits](Executor::settle) for. What is not on the path, as a jog, goes by coordinates, and
//! neither begins before the other rests.
//!
//! What comes to rest does so later by the shaper's length ([`Shaping::is_settled`]).
//!
//! What is no position is that of the mean delay: the tag, the programmed speed, and the waypoints, so that M-codes
//! are executed where they stand.

#[cfg(doc)]
use super::Planner;
use super::{Executor, PathTime, Setpoint};
#[cfg(doc)]
use crate::shaper::Method;
use crate::shaper::Shaper;

/// What the executor had in a cycle.
#[derive(Clone, Copy, Debug)]
struct Sample<const N: usize> {
    setpoint: Setpoint<N>,
    waypoints: u32,
    time: PathTime,
}

impl<const N: usize> Sample<N> {
    /// On no path yet.
    fn at_rest(setpoint: Setpoint<N>) -> Self {
        Self {
            setpoint,
            waypoints: 0,
            time: PathTime::default(),
        }
    }
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
        let rest = Sample::at_rest(rest);
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
        self.rest = Sample::at_rest(rest);
        self.count = 0;
        self.unchanged = [self.samples.len(); N];
        self.bypassed = false;
    }

    /// From now on setpoints go by it, until the next [`restart`](Self::restart): whoever asks for that goes on from
    /// the last shaped setpoint, not from the executor's.
    pub fn bypass(&mut self) {
        self.bypassed = true;
    }

    /// The setpoint of the next cycle, of what the executor has for it.
    pub fn shape(&mut self, setpoint: Setpoint<N>, executor: &Executor<N>) -> Setpoint<N> {
        let time = executor.path_time();
        if time.section != self.ago(0).time.section {
            self.begin_section(time);
        }
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
            waypoints: executor.waypoints(),
            time,
        };
        self.count += 1;
        if self.bypassed || length == 1 {
            return setpoint;
        }
        let moving = !self.is_settled();
        let off_path = self.any(|it| it.off_path);
        let shaped = Setpoint {
            distance: self.mean(|it| it.setpoint.distance),
            speed: self.mean(|it| it.setpoint.speed),
            busy: moving || setpoint.busy,
            off_path,
            ..self.ago(self.mean).setpoint
        };
        let on_path = moving && !off_path && time.clock;
        match on_path.then(|| self.on_path(executor, shaped)) {
            Some(Some(on_path)) => on_path,
            _ => Setpoint {
                position: self.mean_of(|it| &it.position),
                velocity: self.mean_of(|it| &it.velocity),
                acceleration: self.mean_of(|it| &it.acceleration),
                jerk: self.mean_of(|it| &it.jerk),
                ..shaped
            },
        }
    }

    /// A section begins from rest, on which distances begin anew.
    fn begin_section(&mut self, time: PathTime) {
        let rest = PathTime {
            distance: time.from,
            speed: 0.0,
            acceleration: 0.0,
            jerk: 0.0,
            ..time
        };
        for sample in self.samples.iter_mut().chain([&mut self.rest]) {
            sample.time = rest;
        }
    }

    /// That setpoint where the path is at the shaped distance.
    fn on_path(&self, executor: &Executor<N>, shaped: Setpoint<N>) -> Option<Setpoint<N>> {
        let at = executor.path_at(self.mean(|it| it.time.distance))?;
        let v = self.mean(|it| it.time.speed);
        let a = self.mean(|it| it.time.acceleration);
        let j = self.mean(|it| it.time.jerk);
        Some(Setpoint {
            position: at.q,
            velocity: at.d1.map(|x| x * v),
            acceleration: std::array::from_fn(|i| at.d2[i] * v * v + at.d1[i] * a),
            jerk: std::array::from_fn(|i| {
                at.d3[i] * v * v * v + 3.0 * at.d2[i] * v * a + at.d1[i] * j
            }),
            ..shaped
        })
    }

    /// What the executor had so many cycles ago.
    fn ago(&self, ago: usize) -> &Sample<N> {
        match self.count.checked_sub(ago + 1) {
            Some(place) => &self.samples[place % self.samples.len()],
            None => &self.rest,
        }
    }

    /// The mean of a number; exactly that number where it does not change.
    fn mean(&self, of: impl Fn(&Sample<N>) -> f64) -> f64 {
        let newest = of(self.ago(0));
        let weighted = |&(ago, weight): &(usize, f64)| weight * (of(self.ago(ago)) - newest);
        newest + self.weights.iter().map(weighted).sum::<f64>()
    }

    fn mean_of(&self, of: impl Fn(&Setpoint<N>) -> &[f64; N]) -> [f64; N] {
        std::array::from_fn(|axis| self.mean(|it| of(&it.setpoint)[axis]))
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
