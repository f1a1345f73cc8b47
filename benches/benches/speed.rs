//! Planning time beside rsruckig: random full-state problems of 1, 3 and 6 axes that arrive together,
//! for each problem the least of several repeats that alternate between the two planners:
//! `cargo bench -p syncline-benches --bench speed -- [CASES [REPEATS]]`.

use std::hint::black_box;
use std::time::Instant;
use syncline_benches::cases::{Case, Class, Rng};
use syncline_benches::peer::{Peer, input};
use syncline_trajectory::profile::Profile;
use syncline_trajectory::state_to_state::Problem;
use syncline_trajectory::synchronise::{Synchronisation, plan};

fn main() {
    let mut numbers = std::env::args()
        .skip(1)
        .filter_map(|a| a.parse::<usize>().ok());
    let cases = numbers.next().unwrap_or(100_000);
    let repeats = numbers.next().unwrap_or(7);
    println!("{cases} problems, least of {repeats} interleaved repeats each, µs");
    println!(
        "{:4} {:>9} {:>9} {:>6}   {:>9} {:>9} {:>6}   {:>9} {:>9}",
        "axes", "mean", "rsruckig", "ratio", "p99.9", "rsruckig", "ratio", "p50", "rsruckig"
    );
    compare::<1>(cases, repeats);
    compare::<3>(cases, repeats);
    compare::<6>(cases, repeats);
}

fn compare<const N: usize>(cases: usize, repeats: usize) {
    let mut rng = Rng::new(7);
    let mut peer = Peer::<N>::default();
    let mut problems = Vec::with_capacity(cases);
    while problems.len() < cases {
        let problem: [Case; N] = [(); N].map(|()| Class::Generic.draw(&mut rng));
        let input = input(&problem);
        // Both planners have a plan.
        if peer.plan(&input).is_some() {
            problems.push((
                problem.map(|c| Problem::new(c.start, c.target, c.limits)),
                input,
            ));
        }
    }
    let mut ours = vec![u64::MAX; cases];
    let mut theirs = vec![u64::MAX; cases];
    for _ in 0..repeats {
        for (i, (axes, input)) in problems.iter().enumerate() {
            let mut profiles = axes.map(|a| Profile::new(a.start));
            let begin = Instant::now();
            let duration = plan(black_box(axes), Synchronisation::Time, 0.0, &mut profiles);
            ours[i] = ours[i].min(begin.elapsed().as_nanos() as u64);
            let _ = black_box((duration, &profiles));
            let begin = Instant::now();
            let duration = peer.plan(black_box(input));
            theirs[i] = theirs[i].min(begin.elapsed().as_nanos() as u64);
            black_box((duration, &peer.trajectory));
        }
    }
    let summary = |times: &mut Vec<u64>| {
        times.sort_unstable();
        let mean = times.iter().sum::<u64>() as f64 / times.len() as f64;
        let at = |q: f64| times[((times.len() - 1) as f64 * q) as usize] as f64;
        (mean * 1e-3, at(0.999) * 1e-3, at(0.5) * 1e-3)
    };
    let (a, b) = (summary(&mut ours), summary(&mut theirs));
    println!(
        "{N:4} {:9.3} {:9.3} {:6.3}   {:9.3} {:9.3} {:6.3}   {:9.3} {:9.3}",
        a.0,
        b.0,
        a.0 / b.0,
        a.1,
        b.1,
        a.1 / b.1,
        a.2,
        b.2
    );
}
