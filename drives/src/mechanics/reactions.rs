//! What holds two shafts back: friction, brakes, blocks and stops, without chatter.
//!
//! Friction at rest is not a function of speed: it is whatever keeps a shaft at rest, up to a
//! bound. A smooth curve through zero (a hyperbolic tangent) lets a load creep down a slope and
//! needs steps as short as it is steep; a sign chatters. Here friction, brake, block and end stop
//! are one thing, a set-valued reaction: constant during the step, within bounds, that brings its
//! shaft to rest by the end of the step if it can.
//!
//! With `v` the speeds after a step without reactions and `W` what constant reactions λ of the step
//! add to them, the reactions minimise ½ λᵀ W λ + vᵀ λ within their bounds (Gauss's principle of
//! least constraint; Moreau 1988). `W` is symmetric and positive, so that there is exactly one
//! minimum. Two unknowns in a box: it is at `W λ = −v` if that is inside, otherwise on one of the
//! four edges, where it is a parabola's. So it is found exactly, and nothing is iterated.

use nalgebra::{Matrix2, Vector2};

/// The reactions between `least` and `greatest` that bring `speeds` to rest as far as they can.
/// `inverse` is `W`, `mass` its inverse. Bounds may be infinite.
#[must_use]
pub fn reactions(
    mass: &Matrix2<f64>,
    inverse: &Matrix2<f64>,
    speeds: &Vector2<f64>,
    least: &Vector2<f64>,
    greatest: &Vector2<f64>,
) -> Vector2<f64> {
    let stop = -(mass * speeds);
    let inside = |side: usize| least[side] <= stop[side] && stop[side] <= greatest[side];
    if inside(0) && inside(1) {
        return stop;
    }
    let work =
        |reaction: &Vector2<f64>| 0.5 * reaction.dot(&(inverse * reaction)) + speeds.dot(reaction);
    let mut best = (f64::INFINITY, Vector2::zeros());
    for fixed in 0..2 {
        let other = 1 - fixed;
        for bound in [least[fixed], greatest[fixed]] {
            // What is blocked is at no edge: no reaction is too much for it.
            if bound.is_infinite() {
                continue;
            }
            let mut edge = Vector2::zeros();
            edge[fixed] = bound;
            let speed = speeds[other] + inverse[(other, fixed)] * bound;
            let stop = -speed / inverse[(other, other)];
            edge[other] = stop.clamp(least[other], greatest[other]);
            let work = work(&edge);
            if work < best.0 {
                best = (work, edge);
            }
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Whatever comes: a reaction is within its bounds, and it brings its shaft to rest or acts
        /// against it with all it has. A stop, with one bound infinite, lets nothing pass.
        #[test]
        fn reactions_are_complementary(
            speeds in (-50.0..50.0, -50.0..50.0),
            bounds in (0.0..0.02, 0.0..0.02),
            stop in prop::option::of(any::<bool>()),
            mass in (1e-4..1e-2, 1e-4..1e-2, -0.99..0.99),
        ) {
            let shared = mass.2 * libm::sqrt(mass.0 * mass.1);
            let mass = Matrix2::new(mass.0, shared, shared, mass.1);
            let inverse = mass.try_inverse().unwrap();
            let speeds = Vector2::new(speeds.0, speeds.1);
            let mut least = -Vector2::new(bounds.0, bounds.1);
            let mut greatest = -least;
            match stop {
                Some(true) => greatest.y = f64::INFINITY,
                Some(false) => least.y = f64::NEG_INFINITY,
                None => {}
            }
            let found = reactions(&mass, &inverse, &speeds, &least, &greatest);
            let after = speeds + inverse * found;
            for side in 0..2 {
                let (reaction, speed) = (found[side], after[side]);
                prop_assert!(least[side] <= reaction && reaction <= greatest[side]);
                let at_rest = speed.abs() < 1e-7;
                let against = if speed > 0.0 { least[side] } else { greatest[side] };
                prop_assert!(at_rest || reaction == against, "{reaction} against {speed}");
            }
        }
    }
}
