//! A machine's structure, which the forces of its axes bend, so that the tool moves against the workpiece.
//!
//! What an axis accelerates, a mass m by a, is pushed by the structure, which is pushed back by F = −m a. It answers in its
//! modes, oscillators that know nothing of each other, each with the mass M that it has where the tool is:
//!
//! ```text
//! q̈ + 2ζω q̇ + ω² q = F / M
//! ```
//!
//! The tool is off by the sum of all q. Encoders and scales are on the structure and do not see it, so no loop takes
//! it back; and it is not felt by the axes either, which is right up to about m / M of what it does.
//!
//! Velocities are known from step to step, so the force of a step is its mean, Δ(m v) / Δt: no impulse is lost, however
//! long a step is. Against a force that swings with the frequency f a step of h seconds lets (π f h)² / 6 of it be
//! missing, 0.04 % of 8 Hz at 2 ms and 4 % of 80 Hz.

use super::mode::{Mode, Transition};
use core::f64::consts::TAU;
use nalgebra::Vector2;

/// How a structure sways in one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StructureMode {
    /// Natural frequency, Hz.
    pub frequency: f64,
    /// Damping ratio, less than 1.
    pub damping: f64,
    /// The mass that sways, with the amplitude of the tool, kg.
    pub mass: f64,
}

impl StructureMode {
    /// How far a force bends it that swings so many times a second, m/N; 0 Hz: a steady one.
    #[must_use]
    pub fn compliance(&self, frequency: f64) -> (f64, f64) {
        let (own, swings) = (TAU * self.frequency, TAU * frequency);
        let stiff = self.mass * (own * own - swings * swings);
        let damped = self.mass * 2.0 * self.damping * own * swings;
        let squared = stiff * stiff + damped * damped;
        (stiff / squared, -damped / squared)
    }
}

/// A structure in one direction, as it sways.
#[derive(Clone, Debug)]
pub struct Structure {
    modes: Vec<Swing>,
    /// The last step, s, for which the transitions are.
    step: f64,
}

#[derive(Clone, Debug)]
struct Swing {
    mode: Mode,
    mass: f64,
    transition: Transition,
    /// m and m/s.
    state: Vector2<f64>,
    /// By the force of the last step, m/s².
    acceleration: f64,
}

impl Structure {
    /// With these modes, at rest.
    #[must_use]
    pub fn new(modes: &[StructureMode]) -> Self {
        let swing = |it: &StructureMode| {
            let mode = Mode::new(TAU * it.frequency, it.damping);
            Swing {
                mode,
                mass: it.mass,
                transition: mode.after(0.0),
                state: Vector2::zeros(),
                acceleration: 0.0,
            }
        };
        Self {
            modes: modes.iter().map(swing).collect(),
            step: 0.0,
        }
    }

    /// Lets `dt` seconds pass with a force upon it, N.
    pub fn step(&mut self, dt: f64, force: f64) {
        let changed = dt != self.step;
        self.step = dt;
        for swing in &mut self.modes {
            if changed {
                swing.transition = swing.mode.after(dt);
            }
            swing.acceleration = force / swing.mass;
            swing.state = swing.transition.apply(swing.state, swing.acceleration);
        }
    }

    /// How far the tool is off, m.
    #[must_use]
    pub fn sway(&self) -> f64 {
        self.modes.iter().map(|it| it.state.x).sum()
    }

    /// How far it will be a step after the last one, if the force lasts, m.
    #[must_use]
    pub fn sway_ahead(&self) -> f64 {
        let ahead = |it: &Swing| it.transition.apply(it.state, it.acceleration).x;
        self.modes.iter().map(ahead).sum()
    }

    /// How far the tool will sway at most from now on if nothing pushes any more, but for damping, m.
    #[must_use]
    pub fn amplitude(&self) -> f64 {
        let amplitude = |it: &Swing| {
            let Mode { stiffness, decay } = it.mode;
            let frequency = (stiffness - decay * decay).sqrt();
            it.state
                .x
                .hypot((it.state.y + decay * it.state.x) / frequency)
        };
        self.modes.iter().map(amplitude).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const MODE: StructureMode = StructureMode {
        frequency: 8.0,
        damping: 0.02,
        mass: 500.0,
    };

    #[test]
    fn a_steady_force_bends_it_as_its_stiffness_has_it() {
        let mut structure = Structure::new(&[MODE]);
        for _ in 0..20_000 {
            structure.step(0.002, 300.0);
        }
        let stiffness = 500.0 * (TAU * 8.0_f64).powi(2);
        let bent = 300.0 / stiffness;
        assert!((structure.sway() - bent).abs() < 1e-9 * bent);
        assert!((structure.sway_ahead() - bent).abs() < 1e-9 * bent);
        assert!((MODE.compliance(0.0).0 - 1.0 / stiffness).abs() < 1e-18);
    }

    /// A force that swings, in its resonance and beside it, long after it began.
    #[test]
    fn a_swinging_force_bends_it_as_its_compliance_has_it() {
        for frequency in [1.0, 6.0, 8.0, 11.0, 40.0] {
            let mut structure = Structure::new(&[
                MODE,
                StructureMode {
                    frequency: 23.0,
                    ..MODE
                },
            ]);
            let h = 1e-4;
            let mut most = 0.0_f64;
            for n in 0..200_000 {
                structure.step(h, (TAU * frequency * h * f64::from(n)).cos());
                if n > 150_000 {
                    most = most.max(structure.sway().abs());
                }
            }
            let (one, other) = (
                MODE.compliance(frequency),
                StructureMode {
                    frequency: 23.0,
                    ..MODE
                }
                .compliance(frequency),
            );
            let expected = (one.0 + other.0).hypot(one.1 + other.1);
            assert!(
                (most / expected - 1.0).abs() < 2e-3,
                "{frequency} {most} {expected}"
            );
        }
    }

    proptest! {
        /// A push leaves v = I / M, whose amplitude fades by the damping alone, at any steps.
        #[test]
        fn a_push_swings_on(
            frequency in 0.5..50.0,
            damping in 0.0..0.3,
            mass in 1.0..1e5,
            steps in prop::collection::vec(1e-4..4e-3, 1..200),
        ) {
            let mode = StructureMode { frequency, damping, mass };
            let mut structure = Structure::new(&[mode]);
            let short = 1e-7;
            structure.step(short, 10.0 / short);
            let own = TAU * frequency;
            let turns = own * (1.0 - damping * damping).sqrt();
            let mut left = 10.0 / mass / turns;
            prop_assert!((structure.amplitude() / left - 1.0).abs() < 1e-4);
            for dt in steps {
                structure.step(dt, 0.0);
                left *= (-damping * own * dt).exp();
                prop_assert!((structure.amplitude() / left - 1.0).abs() < 1e-4);
                prop_assert!(structure.sway().abs() <= structure.amplitude() * (1.0 + 1e-12));
            }
        }
    }
}
