//! Plans a move of one axis as fast as its limits allow, prints it, and has it certified.
//! `cargo run -p syncline-trajectory --example plan_a_move`

use syncline_trajectory::limits::Limits;
use syncline_trajectory::profile::State;
use syncline_trajectory::state_to_state::{self, PlanError, Problem};
use syncline_trajectory::verify;

fn main() -> Result<(), PlanError> {
    // From rest at 0 to rest at 100 mm: 200 mm/s, 2,000 mm/s², 40,000 mm/s³.
    let limits = Limits::symmetric(200.0, 2_000.0, 40_000.0);
    let problem = Problem::new(State::at_rest(0.0), State::at_rest(100.0), limits);
    let profile = state_to_state::plan(&problem, 0.0)?;

    println!(
        "{:>8} {:>10} {:>10} {:>10}",
        "t, s", "p, mm", "v, mm/s", "a, mm/s²"
    );
    for step in 0..=13 {
        let t = f64::from(step) * 0.05;
        let State { p, v, a } = profile.at(t);
        println!("{t:8.3} {p:10.3} {v:10.3} {a:10.1}");
    }
    println!(
        "{} segments, {:.3} s",
        profile.segments().len(),
        profile.duration()
    );

    // 100 mm at 200 mm/s, 200 mm/s at 2,000 mm/s², 2,000 mm/s² at 40,000 mm/s³.
    assert!((profile.duration() - (0.5 + 0.1 + 0.05)).abs() < 1e-12);
    // The checker has arithmetic of its own.
    assert!(verify::axis(&profile, &problem).holds(1e-9));
    Ok(())
}
