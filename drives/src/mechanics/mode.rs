//! A mode of vibration, stepped exactly: one inertia on one spring with one damper.
//!
//! Linear mechanics come apart into modes that know nothing of each other, each with a coordinate
//! `q` of its own:
//!
//! ```text
//! q̈ + 2δ q̇ + ω₀² q = a
//! ```
//!
//! with the decay δ, the natural frequency ω₀ and an acceleration `a` from outside. While `a` is
//! constant, position and velocity after a time are linear in those before and in `a`: the matrix
//! exponential of a 2 × 2 block, which has a closed form. It is worked out once for a length of
//! step; a step then costs six multiplications and errs by rounding only, however long it is. An
//! integrator would err with each step, and would have to be short beside the fastest vibration.

use nalgebra::{Matrix2, Vector2};

/// A mode by its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mode {
    /// Natural angular frequency without damping, squared: ω₀², 1/s². 0 for a mode without a spring.
    pub stiffness: f64,
    /// Decay δ of the amplitude, 1/s. 0 for a mode without a damper.
    pub decay: f64,
}

/// What a step of one length does to a mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transition {
    /// Of position and velocity.
    pub state: Matrix2<f64>,
    /// Of a constant acceleration, upon position and velocity.
    pub input: Vector2<f64>,
}

impl Mode {
    /// An inertia alone.
    pub const FREE: Self = Self {
        stiffness: 0.0,
        decay: 0.0,
    };

    /// A mode from its natural angular frequency in rad/s and its damping ratio.
    #[must_use]
    pub fn new(frequency: f64, damping_ratio: f64) -> Self {
        Self {
            stiffness: frequency * frequency,
            decay: damping_ratio * frequency,
        }
    }

    /// What `dt` seconds do.
    #[must_use]
    pub fn after(&self, dt: f64) -> Transition {
        let Self { stiffness, decay } = *self;
        if stiffness == 0.0 && decay == 0.0 {
            return Transition {
                state: Matrix2::new(1.0, dt, 0.0, 1.0),
                input: Vector2::new(0.5 * dt * dt, dt),
            };
        }
        // Of the damped oscillation squared: negative where nothing oscillates.
        let turning = stiffness - decay * decay;
        // The decaying cosine and sine of it, the latter over its frequency: it has a limit at none.
        let (even, odd) = if turning > 0.0 {
            let frequency = turning.sqrt();
            let (sine, cosine) = libm::sincos(frequency * dt);
            let envelope = libm::exp(-decay * dt);
            (envelope * cosine, envelope * sine / frequency)
        } else if turning < 0.0 {
            // Of the two exponentials the slower one taken out, so that neither overflows.
            let rate = (-turning).sqrt();
            let slow = libm::exp((rate - decay) * dt);
            let fades = libm::expm1(-2.0 * rate * dt);
            (slow * (1.0 + 0.5 * fades), -slow * fades / (2.0 * rate))
        } else {
            let envelope = libm::exp(-decay * dt);
            (envelope, envelope * dt)
        };
        let state = Matrix2::new(
            even + decay * odd,
            odd,
            -stiffness * odd,
            even - decay * odd,
        );
        // A constant acceleration shifts the place of rest to a / ω₀². Without a spring there is
        // none, and the damper alone brings the velocity to a / 2δ.
        let displaced = if stiffness > 0.0 {
            (1.0 - state.m11) / stiffness
        } else {
            (dt - odd) / (2.0 * decay)
        };
        Transition {
            state,
            input: Vector2::new(displaced, odd),
        }
    }
}

impl Transition {
    /// Position and velocity at the end of a step, from those at its beginning.
    #[must_use]
    pub fn apply(&self, state: Vector2<f64>, acceleration: f64) -> Vector2<f64> {
        self.state * state + self.input * acceleration
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn assert_close(found: Vector2<f64>, expected: Vector2<f64>, scale: f64) {
        let error = (found - expected).norm();
        assert!(error <= 1e-9 * scale, "{found:?}, expected {expected:?}");
    }

    #[test]
    fn an_undamped_mode_swings_as_the_cosine() {
        let mode = Mode::new(80.0, 0.0);
        let state = mode.after(0.013).apply(Vector2::new(2.0, 0.0), 0.0);
        let phase = 80.0 * 0.013_f64;
        let expected = Vector2::new(2.0 * phase.cos(), -160.0 * phase.sin());
        assert_close(state, expected, 160.0);
    }

    #[test]
    fn a_constant_acceleration_ends_at_the_spring_s_balance() {
        for damping in [0.02, 0.7, 1.0, 3.0] {
            let mode = Mode::new(50.0, damping);
            let state = mode.after(60.0).apply(Vector2::new(0.3, -4.0), 10.0);
            assert_close(state, Vector2::new(10.0 / 2500.0, 0.0), 1.0);
        }
    }

    #[test]
    fn a_damper_without_a_spring_ends_at_its_speed() {
        let mode = Mode {
            stiffness: 0.0,
            decay: 5.0,
        };
        let state = mode.after(10.0).apply(Vector2::zeros(), 2.0);
        assert_close(state, Vector2::new(2.0 / 10.0 * (10.0 - 0.1), 0.2), 2.0);
    }

    proptest! {
        /// Two steps are one step of both lengths, whatever the damping.
        #[test]
        fn steps_join(
            frequency in 0.0..2000.0,
            damping in 0.0..3.0,
            lengths in (1e-6..2e-3, 1e-6..2e-3),
            from in (-1.0..1.0, -100.0..100.0),
            acceleration in -1e4..1e4,
        ) {
            let mode = Mode::new(frequency, damping);
            let from = Vector2::new(from.0, from.1);
            let halfway = mode.after(lengths.0).apply(from, acceleration);
            let joined = mode.after(lengths.1).apply(halfway, acceleration);
            let at_once = mode.after(lengths.0 + lengths.1).apply(from, acceleration);
            prop_assert!((joined - at_once).norm() <= 1e-9 * (1.0 + at_once.norm()));
        }
    }
}
