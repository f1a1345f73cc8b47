//! The drive's own profile generator: ramps of constant acceleration.

/// A reference in motion: increments from the encoder's zero and increments/s.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Ramp {
    pub(super) position: f64,
    pub(super) velocity: f64,
}

impl Ramp {
    /// At rest at `position`.
    pub(super) fn at(position: f64) -> Self {
        Self {
            position,
            velocity: 0.0,
        }
    }

    /// Approaches a velocity for `dt` seconds; true once it is reached.
    pub(super) fn towards_velocity(&mut self, target: f64, acceleration: f64, dt: f64) -> bool {
        let before = self.velocity;
        let change = (acceleration * dt).max(f64::MIN_POSITIVE);
        self.velocity += (target - before).clamp(-change, change);
        self.position += 0.5 * (before + self.velocity) * dt;
        self.velocity == target
    }
}
