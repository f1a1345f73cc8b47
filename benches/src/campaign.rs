//! Optimality against the reference on random problems of twelve classes.

use crate::cases::{Case, Class, Rng, is_inside};
use crate::peer::{Peer, input};
use syncline_trajectory::state_to_state::{Axis, plan};
use syncline_trajectory::verify;

/// Our own plans are held to this.
pub const TOLERANCE: f64 = 1e-12;
/// Longer than the reference by more than this, relative, is a loss.
pub const LONGER: f64 = 1e-9;

/// What a class came to.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// Problems.
    pub cases: u64,
    /// Problems we have no plan for.
    pub failed: u64,
    /// Plans of ours that do not pass the checker.
    pub unsound: u64,
    /// Plans that miss the position by no more than the rounding of the positions.
    pub rounded: u64,
    /// Worst end error and limit excess.
    pub end_error: f64,
    /// Worst limit excess.
    pub limit_excess: f64,
    /// Problems whose start is inside the limits and for which the reference's plan passes.
    pub compared: u64,
    /// Of these: ours is longer.
    pub longer: u64,
    /// Of these: ours is shorter.
    pub shorter: u64,
    /// The worst relative excess of duration.
    pub worst: f64,
    /// Reference failed.
    pub peer_failed: u64,
    /// Reference's plan does not pass the checker.
    pub peer_unsound: u64,
}

/// Runs `cases` problems of a class; `report` sees those that are lost.
pub fn run(class: Class, cases: u64, seed: u64, mut report: impl FnMut(&str, &Case, f64)) -> Tally {
    let mut rng = Rng::new(seed ^ (class as u64) << 32);
    let mut peer = Peer::<1>::default();
    let mut tally = Tally::default();
    for _ in 0..cases {
        let case = class.draw(&mut rng);
        tally.cases += 1;
        let axis = Axis::new(case.start, case.target, case.limits);
        let Ok(ours) = plan(&axis, 0.0) else {
            tally.failed += 1;
            report("failed", &case, 0.0);
            continue;
        };
        let certificate = verify::axis(&ours, &axis);
        tally.limit_excess = tally.limit_excess.max(certificate.limit_excess);
        if !certificate.holds(TOLERANCE) {
            tally.unsound += 1;
            report(
                "unsound",
                &case,
                certificate.end_error.max(certificate.limit_excess),
            );
        } else {
            tally.end_error = tally.end_error.max(certificate.end_error);
        }
        let duration = ours.duration();
        let Some(theirs) = peer.plan(&input(&[case])) else {
            tally.peer_failed += 1;
            continue;
        };
        let sound = peer
            .profile(0, &case)
            .is_some_and(|p| verify::axis(&p, &axis).holds(TOLERANCE));
        if !sound {
            tally.peer_unsound += 1;
            continue;
        }
        if !is_inside(&case.start, &case.limits) {
            continue;
        }
        tally.compared += 1;
        let longer = (duration - theirs) / theirs;
        if longer > tally.worst {
            tally.worst = longer;
        }
        if longer > LONGER {
            tally.longer += 1;
            report("longer", &case, longer);
        } else if longer < -LONGER {
            tally.shorter += 1;
        }
    }
    tally
}
