//! Whether corners rounded with a continuous change of curvature (G3) are passed sooner than those with
//! continuous curvature (G2): `cargo bench -p syncline-benches --bench blends`.
//!
//! Between lines that meet in C both are C + (A − C)(1 − u)ⁿ + (B − C) uⁿ, with n = 3 and n = 4, as long
//! as the tolerance lets them be.

use syncline_benches::contours::{MILL, Plan};
use syncline_trajectory::path::{Curve, Derivatives, Feed, Move, PathControlMode, PathItem, Poly};

/// Length of what is before and behind the corner, mm.
const LEG: f64 = 100.0;

/// Time from rest over a corner with that turn to rest, s.
fn time(degree: i32, turn: f64, tolerance: f64, feed: f64) -> f64 {
    let along = [[1.0, 0.0, 0.0], [turn.cos(), turn.sin(), 0.0]];
    // The corner is furthest from the middle.
    let cut = tolerance * 2.0_f64.powi(degree) / (2.0 * (0.5 * turn).sin());
    assert!(cut < LEG, "the items are too short");
    let at = |k: usize, s: f64| Derivatives {
        q: along[k].map(|d| d * s),
        d1: along[k],
        d2: [0.0; 3],
        d3: [0.0; 3],
    };
    let n = f64::from(degree);
    let (from, to) = (at(0, -cut), at(1, cut));
    let blend = Poly::joining(&from, &to, n * cut, n * (n - 1.0) * cut).expect("no reversal");
    let curves = [
        Curve::line(at(0, -LEG).q, from.q).expect("a line"),
        Curve::Poly(blend),
        Curve::line(to.q, at(1, LEG).q).expect("a line"),
    ];
    let items = curves.map(|curve| {
        PathItem::Move(Move {
            curve,
            feed: Feed::Rate(feed),
            mode: PathControlMode::Exact(1e-6),
            tag: 0,
        })
    });
    let plan = Plan::of(&MILL, items.into_iter());
    assert_eq!(plan.sections.len(), 1, "smooth joints");
    plan.time()
}

fn main() {
    println!("| turn | P | mm/s | G2, s | G3, s | G3 longer by |\n|---|---|---|---|---|---|");
    for turn in [10.0_f64, 30.0, 60.0, 90.0, 120.0] {
        for tolerance in [0.001, 0.01, 0.1, 0.5] {
            for feed in [20.0, 100.0, 400.0] {
                let [g2, g3] = [3, 4].map(|n| time(n, turn.to_radians(), tolerance, feed));
                let longer = 100.0 * (g3 / g2 - 1.0);
                println!("| {turn}° | {tolerance} | {feed} | {g2:.4} | {g3:.4} | {longer:.2} % |");
            }
        }
    }
}
