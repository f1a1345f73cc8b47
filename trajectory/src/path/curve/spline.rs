//! Splines of the fifth degree by their control points, in Bernstein's form.
//!
//! A polynomial is good for the planner where its parameter runs about as fast as the path length and where it bends
//! little. So a spline is halved (de Casteljau) until each part is like that; halves are the same curve, so the parts join
//! with all their derivatives. A part is judged by the differences of its control points, of which its derivative
//! is a mean everywhere: where all of them go ahead along the chord, so does the curve. A spline that stands still or turns
//! back somewhere has no such parts there.

use super::{Curve, CurveError, Poly, Quintic};

/// Part of the fastest difference with which every one goes ahead along the chord.
const AHEAD: f64 = 0.3;
/// Times that a spline is halved, at most.
const HALVINGS: u32 = 16;

/// The control points of a polynomial of degree five.
type Controls<const N: usize> = [[f64; N]; 6];

impl<const N: usize> Curve<N> {
    /// The spline with these control points, in parts of which each begins where the one before it ends.
    ///
    /// # Errors
    /// A coordinate is not finite; or the spline has no length, stands still or turns back on the way.
    pub fn spline(controls: Controls<N>) -> Result<Vec<Self>, CurveError> {
        let Some(last) = controls.last() else {
            return Err(CurveError::NoLength);
        };
        if !controls.as_flattened().iter().all(|x| x.is_finite()) {
            return Err(CurveError::NotFinite);
        }
        if controls.iter().all(|point| point == last) {
            return Err(CurveError::NoLength);
        }
        // Seen from its start, so that rounding is in proportion to the spline.
        let start = controls[0];
        let seen = controls.map(|point| std::array::from_fn(|i| point[i] - start[i]));
        let mut parts = Vec::new();
        cut(&seen, &start, HALVINGS, &mut parts)?;
        Ok(parts)
    }
}

fn cut<const N: usize>(
    controls: &Controls<N>,
    origin: &[f64; N],
    halvings: u32,
    parts: &mut Vec<Curve<N>>,
) -> Result<(), CurveError> {
    if goes_ahead(controls) {
        let quintic = Quintic {
            start: std::array::from_fn(|i| origin[i] + controls[0][i]),
            terms: terms(controls),
        };
        if let Some(poly) = Poly::new(quintic) {
            parts.push(Curve::Poly(poly));
            return Ok(());
        }
    }
    if halvings == 0 {
        return Err(CurveError::StandsStill);
    }
    let (first, second) = halves(controls);
    cut(&first, origin, halvings - 1, parts)?;
    cut(&second, origin, halvings - 1, parts)
}

/// Whether the tool goes ahead along the chord everywhere.
fn goes_ahead<const N: usize>(controls: &Controls<N>) -> bool {
    let tool = N.min(3);
    let between = |k: usize, n: usize| -> [f64; 3] {
        std::array::from_fn(|i| {
            if i < tool {
                controls[n][i] - controls[k][i]
            } else {
                0.0
            }
        })
    };
    let dot = |a: &[f64; 3], b: &[f64; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let chord = between(0, 5);
    let steps: [[f64; 3]; 5] = std::array::from_fn(|k| between(k, k + 1));
    let fastest = steps.iter().map(|step| dot(step, step)).fold(0.0, f64::max);
    let least = AHEAD * (fastest * dot(&chord, &chord)).sqrt();
    least > 0.0 && steps.iter().all(|step| dot(step, &chord) >= least)
}

/// Both halves, by the middles of the middles.
fn halves<const N: usize>(controls: &Controls<N>) -> (Controls<N>, Controls<N>) {
    let (mut first, mut second) = (*controls, *controls);
    for level in 1..6 {
        for k in (level..6).rev() {
            first[k] = std::array::from_fn(|i| 0.5 * (first[k - 1][i] + first[k][i]));
        }
        // What is last now is the end of the second half's control points, counted back.
        second[5 - level] = first[5];
    }
    (first, second)
}

/// The coefficients of u, u² … u⁵: the differences of the control points times 5, 10, 10, 5, 1.
fn terms<const N: usize>(controls: &Controls<N>) -> [[f64; N]; 5] {
    let mut differences = *controls;
    let mut terms = [[0.0; N]; 5];
    for (k, by) in [5.0, 10.0, 10.0, 5.0, 1.0].into_iter().enumerate() {
        for n in 0..5 - k {
            differences[n] = std::array::from_fn(|i| differences[n + 1][i] - differences[n][i]);
        }
        terms[k] = differences[0].map(|x| by * x);
    }
    terms
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point(controls: &Controls<3>, u: f64) -> [f64; 3] {
        let mut points = *controls;
        for level in 1..6 {
            for k in 0..6 - level {
                points[k] =
                    std::array::from_fn(|i| (1.0 - u) * points[k][i] + u * points[k + 1][i]);
            }
        }
        points[0]
    }

    proptest! {
        /// Whatever the control points: the parts join with position, tangent and curvature, their length is
        /// the spline's, and every point of the spline is on them.
        #[test]
        fn parts_are_the_spline(
            controls in prop::array::uniform6(prop::array::uniform3(-50.0..50.0_f64)),
            size in -3.0..1.0_f64,
        ) {
            let size = libm::exp10(size);
            let controls = controls.map(|point| point.map(|x| x * size + 300.0));
            let parts = match Curve::spline(controls) {
                Ok(parts) => parts,
                Err(error) => {
                    prop_assert_eq!(error, CurveError::StandsStill);
                    return Ok(());
                }
            };
            for pair in parts.windows(2) {
                let (end, start) = (pair[0].at(pair[0].length()), pair[1].at(0.0));
                let bend = end.d2.iter().fold(1.0_f64, |bend, x| bend.max(x.abs()));
                for i in 0..3 {
                    prop_assert!((end.q[i] - start.q[i]).abs() <= 1e-12 * 300.0);
                    prop_assert!((end.d1[i] - start.d1[i]).abs() <= 1e-10);
                    // Near a cusp parts are tiny, and their digits few.
                    prop_assert!((end.d2[i] - start.d2[i]).abs() <= 1e-7 * bend);
                }
            }
            let whole: f64 = parts.iter().map(Curve::length).sum();
            let steps = 20_000;
            let chords: f64 = (0..steps)
                .map(|k| {
                    let [a, b] = [k, k + 1].map(|k| point(&controls, f64::from(k) / f64::from(steps)));
                    super::super::path_norm(&[b[0] - a[0], b[1] - a[1], b[2] - a[2]])
                })
                .sum();
            prop_assert!((whole - chords).abs() <= 1e-5 * whole, "{whole} {chords}");
            prop_assert_eq!(parts[0].start(), controls[0]);
            let end = parts[parts.len() - 1].end();
            for (a, b) in end.iter().zip(controls[5]) {
                prop_assert!((a - b).abs() < 1e-11);
            }
            for k in 0..=20 {
                let q = point(&controls, f64::from(k) / 20.0);
                let near = |part: &Curve<3>| {
                    (0..=8).map(|n| part.distance_near(&q, part.length() * f64::from(n) / 8.0))
                        .fold(f64::INFINITY, f64::min)
                };
                let distance = parts.iter().map(near).fold(f64::INFINITY, f64::min);
                prop_assert!(distance < 1e-9 * (1.0 + size * 100.0), "{distance}");
            }
        }
    }

    #[test]
    fn a_line_is_one_part_and_a_standstill_none() {
        let along = |xs: [f64; 6]| xs.map(|x| [x, 0.0, 0.0]);
        assert_eq!(
            Curve::spline(along([0.0, 1.0, 2.0, 3.0, 4.0, 5.0]))
                .unwrap()
                .len(),
            1
        );
        for still in [
            [0.0, 0.0, 1.0, 2.0, 3.0, 4.0],
            [0.0, 5.0, 5.0, 0.0, 0.0, 5.0],
        ] {
            assert_eq!(
                Curve::spline(along(still)),
                Err(CurveError::StandsStill),
                "{still:?}"
            );
        }
        assert_eq!(Curve::spline(along([1.0; 6])), Err(CurveError::NoLength));
    }
}
