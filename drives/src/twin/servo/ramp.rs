//! The drive's own profile generator: ramps of constant acceleration.

/// A reference in motion: increments from the encoder's zero and increments/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ramp {
    /// Increments.
    pub position: f64,
    /// Increments/s.
    pub velocity: f64,
}

/// How fast a profile may go: increments/s and increments/s².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Increments/s.
    pub velocity: f64,
    /// Increments/s².
    pub acceleration: f64,
    /// Increments/s².
    pub deceleration: f64,
}

impl Ramp {
    /// At rest at `position`.
    #[must_use]
    pub fn at(position: f64) -> Self {
        Self {
            position,
            velocity: 0.0,
        }
    }

    /// Approaches a velocity for `dt` seconds; true once it is reached.
    pub fn towards_velocity(&mut self, target: f64, limits: &Limits, dt: f64) -> bool {
        let before = self.velocity;
        let change = self.acceleration_towards(target, limits) * dt;
        self.velocity += (target - before).clamp(-change, change);
        self.position += 0.5 * (before + self.velocity) * dt;
        self.velocity == target
    }

    /// Approaches a velocity for `dt` seconds by an acceleration that takes `time` seconds to come to its limit, and as
    /// long to end; `acceleration` is what it is now, increments/s². True once the velocity is reached. Where the limits
    /// are none, the velocity is there at once.
    pub fn towards_velocity_smoothly(
        &mut self,
        acceleration: &mut f64,
        target: f64,
        limits: &Limits,
        time: f64,
        dt: f64,
    ) -> bool {
        let most = self.acceleration_towards(target, limits);
        if most.is_infinite() {
            return self.towards_velocity(target, limits, dt);
        }
        // The same as a position that is approached, one derivative further.
        let mut slope = Self {
            position: self.velocity,
            velocity: *acceleration,
        };
        let limits = Limits {
            velocity: most,
            acceleration: most / time,
            deceleration: most / time,
        };
        let reached = slope.towards_position(target, &limits, dt);
        self.position += 0.5 * (self.velocity + slope.position) * dt;
        (self.velocity, *acceleration) = (slope.position, slope.velocity);
        reached
    }

    /// The limit of the acceleration on the way to a velocity.
    fn acceleration_towards(&self, target: f64, limits: &Limits) -> f64 {
        let before = self.velocity;
        let speeding_up = target.abs() > before.abs() && target * before >= 0.0;
        if speeding_up {
            limits.acceleration
        } else {
            limits.deceleration
        }
    }

    /// Brakes for `dt` seconds; true once at rest. A deceleration of 0 is none: it stops at once, as what is to brake has to
    /// come to an end.
    pub fn brake(&mut self, deceleration: f64, dt: f64) -> bool {
        let deceleration = match deceleration {
            0.0 => f64::INFINITY,
            ramp => ramp,
        };
        let limits = Limits {
            velocity: 0.0,
            acceleration: deceleration,
            deceleration,
        };
        self.towards_velocity(0.0, &limits, dt)
    }

    /// Approaches a position for `dt` seconds, to rest there; true once it does.
    pub fn towards_position(&mut self, target: f64, limits: &Limits, dt: f64) -> bool {
        let distance = target - self.position;
        let brake = limits.deceleration;
        // The velocity after this step that still leaves room to brake.
        let step = 0.5 * brake * dt;
        let travelled = 0.5 * self.velocity * dt * distance.signum();
        let left = (distance.abs() - travelled).max(0.0);
        let room = (step * step + 2.0 * brake * left).sqrt() - step;
        if distance.abs() <= brake * dt * dt && self.velocity.abs() <= 2.0 * brake * dt {
            *self = Self::at(target);
            return true;
        }
        let velocity = room.min(limits.velocity).copysign(distance);
        self.towards_velocity(velocity, limits, dt);
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 250e-6;

    fn limits() -> Limits {
        Limits {
            velocity: 1e6,
            acceleration: 5e6,
            deceleration: 8e6,
        }
    }

    #[test]
    fn arrives_exactly_without_overshoot_within_its_limits() {
        for target in [3.0, -250.0, 40_000.0, -2_000_000.0] {
            let mut ramp = Ramp::at(0.0);
            let mut last = ramp;
            let arrived = (0..40_000).find(|_| {
                let done = ramp.towards_position(target, &limits(), DT);
                assert!(ramp.velocity.abs() <= 1e6 + 1e-6);
                assert!((ramp.velocity - last.velocity).abs() <= 2.0 * 8e6 * DT + 1e-6);
                assert!(ramp.position.abs() <= target.abs() + 1.0, "{ramp:?}");
                last = ramp;
                done
            });
            assert!(arrived.is_some(), "{target} {ramp:?}");
            assert_eq!(ramp, Ramp::at(target));
        }
    }

    /// A ramp of constant acceleration takes `change / acceleration`; one that is smoothed takes as much longer as
    /// the acceleration takes to come, if it comes to its limit.
    #[test]
    fn a_smooth_ramp_takes_as_much_longer_as_its_acceleration_takes_to_come() {
        for (from, to) in [(0.0, 1e6), (1e6, 2e5), (-3e5, -1e6), (5e5, 0.0)] {
            for time in [0.001, 0.01, 0.05] {
                let mut ramp = Ramp {
                    position: 0.0,
                    velocity: from,
                };
                let most = ramp.acceleration_towards(to, &limits());
                let (mut acceleration, mut before, mut steps) = (0.0_f64, 0.0_f64, 0);
                let mut last = from;
                while !ramp.towards_velocity_smoothly(&mut acceleration, to, &limits(), time, DT) {
                    let change = (acceleration - before).abs();
                    assert!(change <= most / time * DT * (1.0 + 1e-9), "{change}");
                    assert!(acceleration.abs() <= most * (1.0 + 1e-9));
                    // It goes straight there.
                    assert!((ramp.velocity - last) * (to - from) >= 0.0, "{ramp:?}");
                    assert!((to - ramp.velocity) * (to - from) >= 0.0, "{ramp:?}");
                    (before, last, steps) = (acceleration, ramp.velocity, steps + 1);
                    assert!(steps < 10_000);
                }
                let took = f64::from(steps) * DT;
                let expected = (to - from).abs() / most + time;
                assert!((took - expected).abs() <= 3.0 * DT, "{took} of {expected}");
                assert_eq!((ramp.velocity, acceleration), (to, 0.0));
            }
        }
    }

    #[test]
    fn a_smooth_ramp_without_limits_is_a_step() {
        let limits = Limits {
            velocity: 1e6,
            acceleration: f64::INFINITY,
            deceleration: f64::INFINITY,
        };
        let mut ramp = Ramp::at(0.0);
        assert!(ramp.towards_velocity_smoothly(&mut 0.0, 1e5, &limits, 0.1, DT));
        assert_eq!(ramp.velocity, 1e5);
    }

    #[test]
    fn turns_round_when_it_cannot_stop_in_time() {
        let mut ramp = Ramp {
            position: 0.0,
            velocity: 1e6,
        };
        assert!((0..40_000).any(|_| ramp.towards_position(1000.0, &limits(), DT)));
        assert_eq!(ramp, Ramp::at(1000.0));
    }
}
