//! Durations and soundness beside rsruckig on random problems of twelve classes:
//! `cargo bench -p syncline-benches --bench optimality -- [CASES [SEED [SHOWN]]]`.

use syncline_benches::campaign::{Tally, run, together};
use syncline_benches::cases::Class;

fn main() {
    let mut numbers = std::env::args()
        .skip(1)
        .filter_map(|a| a.parse::<u64>().ok());
    let cases = numbers.next().unwrap_or(120_000);
    let seed = numbers.next().unwrap_or(1);
    let shown = numbers.next().unwrap_or(3);
    println!(
        "{:20} {:>9} {:>6} {:>7} {:>9} {:>9} {:>9} {:>7} {:>8} {:>9} {:>8} {:>8}",
        "class",
        "cases",
        "failed",
        "unsound",
        "end",
        "excess",
        "compared",
        "longer",
        "shorter",
        "worst",
        "peer bad",
        "peer err"
    );
    for class in Class::ALL {
        let mut left = shown;
        let Tally {
            cases,
            failed,
            unsound,
            end_error,
            limit_excess,
            compared,
            longer,
            shorter,
            worst,
            peer_failed,
            peer_unsound,
            ..
        } = run(class, cases / 12, seed, |what, case, by| {
            if left > 0 {
                left -= 1;
                println!("  {what} by {by:e}: {case:?}");
            }
        });
        println!(
            "{:20} {cases:9} {failed:6} {unsound:7} {end_error:9.1e} {limit_excess:9.1e} {compared:9} {longer:7} {shorter:8} {worst:9.1e} {peer_unsound:8} {peer_failed:8}",
            format!("{class:?}")
        );
    }
    let mut left = shown;
    let tally = together(cases / 12, seed, |what, case, by| {
        if left > 0 {
            left -= 1;
            println!("  {what} by {by:e}: {case:?}");
        }
    });
    println!("three axes together: {tally:?}");
}
