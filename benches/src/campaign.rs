//! Optimality against the reference on random problems of twelve classes.

use crate::cases::{Case, Class, Rng, is_inside};
use crate::peer::{Peer, input};
use syncline_trajectory::profile::Profile;
use syncline_trajectory::state_to_state::{Problem, plan};
use syncline_trajectory::synchronise::{self, Synchronisation};
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
        let problem = Problem::new(case.start, case.target, case.limits);
        let Ok(ours) = plan(&problem, 0.0) else {
            tally.failed += 1;
            report("failed", &case, 0.0);
            continue;
        };
        let certificate = verify::axis(&ours, &problem);
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
            .is_some_and(|p| verify::axis(&p, &problem).holds(TOLERANCE));
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

/// What planning several axes for one arrival came to.
#[derive(Clone, Copy, Debug, Default)]
pub struct Together {
    /// Problems of three axes.
    pub cases: u64,
    /// Problems without a plan.
    pub failed: u64,
    /// Problems of which some axis does not pass the checker.
    pub unsound: u64,
    /// Problems whose axes do not end within 1e-12 of each other.
    pub apart: u64,
    /// Worst end error and limit excess.
    pub worst_error: f64,
    /// The reference planned too and all axes of its plan pass.
    pub compared: u64,
    /// Ours is longer or shorter.
    pub longer: u64,
    /// Ours is shorter.
    pub shorter: u64,
    /// Problems where a minimum duration was asked for.
    pub stretched: u64,
    /// Of those: the plan is longer than asked for, as its duration is one that some axis cannot have.
    pub moved_on: u64,
}

/// Runs problems of three axes that arrive together, one half with a minimum duration.
pub fn together(cases: u64, seed: u64, mut report: impl FnMut(&str, &[Case; 3], f64)) -> Together {
    let mut rng = Rng::new(seed);
    let mut peer = Peer::<3>::default();
    let mut tally = Together::default();
    for _ in 0..cases {
        let class = [
            Class::Generic,
            Class::RestToRest,
            Class::AtLimits,
            Class::Asymmetric,
        ][rng.below(4) as usize];
        let mut problem = [(); 3].map(|()| class.draw(&mut rng));
        if rng.chance(0.5) {
            // Close together, where axes block each other.
            for case in &mut problem {
                case.target.p = case.start.p + rng.uniform(-1.0, 1.0);
            }
        }
        let axes = problem.map(|c| Problem::new(c.start, c.target, c.limits));
        let mut profiles = axes.map(|a| Profile::new(a.start));
        tally.cases += 1;
        let Ok(duration) = synchronise::plan(&axes, Synchronisation::Time, 0.0, &mut profiles)
        else {
            tally.failed += 1;
            report("failed", &problem, 0.0);
            continue;
        };
        let check = |profiles: &[Profile; 3], duration: f64, tally: &mut Together| {
            let mut worst = 0.0_f64;
            let mut apart = false;
            for (profile, axis) in profiles.iter().zip(&axes) {
                let c = verify::axis(profile, axis);
                worst = worst.max(c.end_error).max(c.limit_excess);
                apart |= (profile.duration() - duration).abs() > 1e-12 * duration;
            }
            tally.apart += u64::from(apart);
            tally.unsound += u64::from(worst > TOLERANCE);
            if worst <= TOLERANCE {
                tally.worst_error = tally.worst_error.max(worst);
            }
            (worst > TOLERANCE || apart).then_some(worst)
        };
        if let Some(worst) = check(&profiles, duration, &mut tally) {
            report("unsound", &problem, worst);
        }
        if let Some(theirs) = peer.plan(&input(&problem)) {
            let sound = (0..3).all(|i| {
                peer.profile(i, &problem[i])
                    .is_some_and(|p| verify::axis(&p, &axes[i]).holds(1e-9))
            });
            let inside = problem.iter().all(|c| is_inside(&c.start, &c.limits));
            if sound && inside {
                tally.compared += 1;
                let longer = (duration - theirs) / theirs;
                if longer > LONGER {
                    tally.longer += 1;
                    report("longer", &problem, longer);
                } else if longer < -LONGER {
                    tally.shorter += 1;
                }
            }
        }
        if rng.chance(0.5) {
            tally.stretched += 1;
            let asked = duration * (1.0 + rng.log(1e-4, 10.0));
            match synchronise::plan(&axes, Synchronisation::Time, asked, &mut profiles) {
                Ok(d) => {
                    tally.moved_on += u64::from(d > asked);
                    if let Some(worst) = check(&profiles, d, &mut tally) {
                        report("unsound when stretched", &problem, worst);
                    }
                }
                Err(_) => {
                    tally.failed += 1;
                    report("failed when stretched", &problem, asked);
                }
            }
        }
    }
    tally
}
