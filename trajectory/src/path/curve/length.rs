//! Derivatives by path length, and bounds of them, from those by any parameter.

use super::Derivatives;

/// Derivatives that are bounded.
pub const ORDERS: usize = 6;

/// Upper bounds of the magnitudes of a function's Taylor coefficients, f⁽ᵏ⁾/k!, at every point of a
/// stretch.
pub(super) type Jet = [f64; ORDERS];

/// Upper bounds of the magnitudes of the derivatives by path length, the first to the sixth, of
/// every axis.
pub type Growth<const N: usize> = [[f64; N]; ORDERS];

/// Bounds by path length from those of q′ by any parameter; `least` is the least of σ² there and
/// `square` bounds its coefficients. Cauchy's products of bounds bound the product's coefficients.
pub(super) fn growth<const N: usize>(first: &[Jet; N], least: f64, square: &Jet) -> Growth<N> {
    if least.is_nan() || least <= 0.0 {
        return [[f64::INFINITY; N]; ORDERS];
    }
    // 1/σ = (σ²)^(−1/2): k f_k σ² = −Σ (j/2 + k − j) (σ²)_j f_(k−j).
    let mut slow = [0.0; ORDERS];
    slow[0] = 1.0 / least.sqrt();
    for k in 1..ORDERS {
        let sum: f64 = (1..=k)
            .map(|j| (k as f64 - 0.5 * j as f64) * square[j] * slow[k - j])
            .sum();
        slow[k] = sum / (k as f64 * least);
    }
    let mut out = [[0.0; N]; ORDERS];
    for i in (0..N).filter(|&i| first[i] != [0.0; ORDERS]) {
        // d/ds = 1/σ d/du; of every derivative one coefficient fewer is known, and asked for.
        let mut jet = first[i];
        for order in 0..ORDERS {
            for k in (0..ORDERS - order).rev() {
                let mut sum = jet[0] * slow[k];
                for j in 1..=k {
                    sum += jet[j] * slow[k - j];
                }
                jet[k] = sum;
            }
            out[order][i] = jet[0];
            for k in 1..ORDERS - order {
                jet[k - 1] = k as f64 * jet[k];
            }
        }
    }
    out
}

/// Derivatives by path length from those by any parameter u, with σ = ds/du, σ′, σ″.
pub(super) fn by_length<const N: usize>(
    q: [f64; N],
    u1: &[f64; N],
    u2: &[f64; N],
    u3: &[f64; N],
    sigma: f64,
    sigma1: f64,
    sigma2: f64,
) -> Derivatives<N> {
    // u(s): u′ = 1/σ, u″ = −σ′/σ³, u‴ = (3σ′² − σσ″)/σ⁵
    let a = 1.0 / sigma;
    let b = -sigma1 * a * a * a;
    let c = (3.0 * sigma1 * sigma1 - sigma * sigma2) * a * a * a * a * a;
    Derivatives {
        q,
        d1: std::array::from_fn(|i| u1[i] * a),
        d2: std::array::from_fn(|i| u2[i] * a * a + u1[i] * b),
        d3: std::array::from_fn(|i| u3[i] * a * a * a + 3.0 * u2[i] * a * b + u1[i] * c),
    }
}

/// Gauss–Legendre nodes and weights on [0, 1].
pub(super) const GAUSS4: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];

/// Gauss–Legendre nodes on [0, 1] of [−1, 1], which is symmetric, and their weights.
pub(super) const GAUSS8: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_3),
];
