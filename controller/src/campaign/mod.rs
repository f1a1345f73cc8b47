//! A campaign that hunts for the case nobody thought of.
//!
//! The idea is that of deterministic simulation testing: the whole machine, controller, planner, session,
//! buses, drives and mechanics, runs in virtual time and is a function of its inputs, so a random number
//! can stand for a whole day at the machine. From a seed a [`Case`] is drawn: a random machine, random
//! programs, operators who command what they like when they like, and things that go wrong. The case is
//! played, and beside it [`checkers`] watch what the buses carried and what is true of the drives; they
//! know nothing of the controller's insides and none of its numbers. So what they find is a violation
//! of what a machine owes to people, not a difference from how it was written. A seed that failed fails
//! again exactly, and its case is made smaller until little is left to look at.
//!
//! - `machine`, `program`, `operator`, `interference`: what a case is drawn from; `dice`: by which choices
//! - [`case`]: all of it as data, for files
//! - [`stage`]: where it is played
//! - [`checkers`]: what must hold
//! - [`coverage`]: what was reached; `kinds`: all that there is to be told
//! - [`response`]: what became of troubles, and how soon
//! - [`explore`]: steering towards what was not
//! - [`shrink`]: the smallest case that still fails
//!
//! Random cases are not alike: each draws which commands, blocks and troubles it is fond of and which it
//! does without ("swarm testing"), since what is everywhere at once hides what needs something rare.
//! Three in ten have no trouble at all, and there nothing may be told to be wrong.

pub mod case;
pub mod checkers;
pub mod coverage;
mod dice;
pub mod explore;
mod interference;
mod kinds;
mod machine;
mod operator;
mod program;
pub mod response;
pub mod shrink;
pub mod stage;

pub use case::{Case, When, from_json};
pub use checkers::{Checkers, Found, Violation};
pub use coverage::Coverage;
pub use interference::{Change, Interference, Tampering, ToBus, ToDrive, Traffic, Trouble};
pub use machine::{
    AxisSpec, DeviceSpec, EncoderSpec, ErrorSpec, IoSpec, MachineSpec, ShaperSpec, SpindleSpec,
    TransmissionSpec, WarmthSpec, Wire,
};
pub use operator::Deed;
pub use stage::{Seen, Wanted};

use std::any::Any;
use std::panic::{self, AssertUnwindSafe};

/// The name under which a panic, or a case that cannot be played, is told.
const STAGE: &str = "stage";

/// What came of a case.
#[derive(Debug, Default)]
pub struct Outcome {
    /// What must not be, in the order in which it was found.
    pub violations: Vec<Violation>,
    /// What was reached.
    pub coverage: Coverage,
    /// Digest of all frames.
    pub frames: String,
    /// Virtual time, s: of all, and of what a path moved.
    pub seconds: [f64; 2],
    /// By drive: its power stage is on at the end.
    pub powered: Vec<bool>,
    /// What the observers sum up.
    pub played: Option<stage::Played>,
}

/// Plays a case before its checkers; `show` sees what they see.
#[must_use]
pub fn run(case: &Case, wanted: Wanted, show: &mut dyn FnMut(&Seen)) -> Outcome {
    let mut outcome = Outcome::default();
    let played = panic::catch_unwind(AssertUnwindSafe(|| {
        let machine = case.machine.machine()?;
        let mut checkers = Checkers::new(case, &machine);
        let (mut coverage, mut troubles) = (Coverage::default(), response::Tracker::default());
        let played = stage::play(case, &machine, wanted, &mut |seen| {
            coverage.see(checkers.scene(), &seen);
            troubles.see(checkers.scene(), &seen);
            checkers.see(&seen);
            show(&seen);
        });
        let played = played.map_err(|error| error.to_string())?;
        checkers.end(&played);
        coverage.end(checkers.stop_times(), troubles);
        let plants = checkers.scene().plants.iter();
        let powered = plants.map(|plant| plant.is_powered).collect();
        Ok::<_, String>((checkers.found.0, coverage, powered, played))
    }));
    let failed = |what, detail| Violation {
        checker: STAGE,
        what,
        at: 0.0,
        detail,
    };
    match played {
        Ok(Ok((violations, coverage, powered, played))) => {
            outcome.powered = powered;
            outcome.violations = violations;
            outcome.coverage = coverage;
            outcome.frames.clone_from(&played.frames);
            outcome.seconds = [played.seconds, played.summary.times.motion_s];
            outcome.played = Some(played);
        }
        Ok(Err(why)) => outcome.violations.push(failed("cannot be played", why)),
        Err(panic) => outcome.violations.push(failed("a panic", words(&*panic))),
    }
    outcome
}

/// Plays a case twice: a second time the buses carry the same.
#[must_use]
pub fn run_twice(case: &Case) -> Outcome {
    let mut outcome = run(case, Wanted::default(), &mut |_| ());
    let again = run(case, Wanted::default(), &mut |_| ());
    if again.frames != outcome.frames {
        outcome.violations.push(Violation {
            checker: STAGE,
            what: "other frames the second time",
            at: 0.0,
            detail: format!("{} and {}", outcome.frames, again.frames),
        });
    }
    outcome
}

/// What a panic says.
fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
    text.unwrap_or("without words").to_owned()
}
