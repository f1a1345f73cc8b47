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
        let speeding_up = target.abs() > before.abs() && target * before >= 0.0;
        let acceleration = if speeding_up {
            limits.acceleration
        } else {
            limits.deceleration
        };
        let change = acceleration * dt;
        self.velocity += (target - before).clamp(-change, change);
        self.position += 0.5 * (before + self.velocity) * dt;
        self.velocity == target
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
