//! Properties of the planner on many random cases:
//! `cargo bench -p syncline-benches --bench properties -- [CASES [SEED]]`.

use syncline_benches::properties::{brute_force, lines, lowering, metamorphic, replanning};

fn main() {
    let mut numbers = std::env::args()
        .skip(1)
        .filter_map(|a| a.parse::<u64>().ok());
    let cases = numbers.next().unwrap_or(100_000);
    let seed = numbers.next().unwrap_or(1);
    println!("{:#?}", metamorphic(cases, seed));
    println!("replanning {:?}", replanning(10 * cases, seed));
    println!("lowering {:?}", lowering(cases, seed));
    println!("lines {:?}", lines(cases, seed));
    let (count, ahead) = brute_force(cases / 20, seed);
    println!(
        "brute force {count:?}, ahead of it by {:.2} % on average",
        100.0 * ahead
    );
}
