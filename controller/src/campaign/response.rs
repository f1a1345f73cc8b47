//! What becomes of troubles: whether one of a kind is told as a fault, how soon, and how long the machine takes from there to rest.
//!
//! Of troubles that come together nobody can say which one a fault is of. So a fault is put down to a trouble that came alone: the first
//! one of a machine that nothing had happened to, or to which nothing had since all was mended, and behind which no other one came
//! before the fault. A starved planner counts as none: it is borne.

use super::checkers::{Scene, StopTimes};
use super::coverage::Counts;
use super::interference::{Interference, ToDrive};
use super::machine::{MachineSpec, Wire};
use super::stage::Seen;
use crate::control::{self, Phase};
use crate::session::Event;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;
use syncline_canopen::Instant;

/// What became of troubles, by their kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Responses(BTreeMap<String, Response>);

/// What became of those of one kind.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Response {
    /// So many came.
    came: u64,
    /// So many of these alone.
    alone: u64,
    /// Cycles until a fault was told, of those alone that led to one.
    told: Counts,
    /// Cycles from there to the last setpoint that changed.
    rests: Counts,
}

/// Looks for what becomes of a case's troubles.
#[derive(Debug, Default)]
pub(super) struct Tracker {
    responses: Responses,
    /// The trouble that came alone, and when.
    alone: Option<(&'static str, Instant)>,
    /// What was told as a fault, and when.
    told: Vec<(&'static str, Instant)>,
}

/// Whether something may lead to a fault: an input that is switched does where drives may not be enabled without it, or an axis is homed
/// by it.
fn is_harm(machine: &MachineSpec, what: &Interference) -> bool {
    match *what {
        Interference::Mended
        | Interference::Join(_)
        | Interference::Align(_)
        | Interference::StarvePlanner(_) => false,
        Interference::Drive(device, ToDrive::Input(place, _)) => {
            machine.has_wire(device, place, Wire::misleads)
        }
        Interference::Drive(_, what) => !matches!(
            what,
            ToDrive::Mains(true)
                | ToDrive::Block(false)
                | ToDrive::LoseTorque(false)
                | ToDrive::Mute(false)
                | ToDrive::ErrorPersists(_)
                | ToDrive::Remote(true)
                | ToDrive::Deaf(false)
                | ToDrive::Accept
        ),
        _ => true,
    }
}

impl Tracker {
    /// Takes what is seen, with the scene as it was before.
    pub(super) fn see(&mut self, scene: &Scene<'_>, seen: &Seen) {
        match seen {
            Seen::Interfered(what) => self.interfered(scene, what),
            Seen::Told(Event::Machine(control::Event::Fault(_))) => {
                if let Some((kind, since)) = self.alone.take() {
                    let passed = scene.now.saturating_since(since).as_nanos();
                    let cycles = passed / scene.machine.cycle.as_nanos();
                    self.responses.of(kind).told.add(cycles as u64);
                    self.told.push((kind, scene.now));
                }
            }
            _ => {}
        }
    }

    fn interfered(&mut self, scene: &Scene<'_>, what: &Interference) {
        let machine = &scene.case.machine;
        let mut earlier = scene.interferences.iter().map(|(_, it)| it);
        if *what == Interference::Mended {
            self.alone = None;
        }
        let mends = |it: &Interference| it.remedy(machine).as_ref() == Some(what);
        if scene.phase == Phase::Done || !is_harm(machine, what) || earlier.clone().any(mends) {
            return;
        }
        let is_first = !earlier.any(|it| is_harm(machine, it)) && !scene.faulted;
        if let Some((overtaken, _)) = self.alone {
            self.responses.of(overtaken).alone -= 1;
        }
        let response = self.responses.of(what.kind());
        response.came += 1;
        response.alone += u64::from(is_first);
        self.alone = is_first.then_some((what.kind(), scene.now));
    }

    /// What became of them, with how long the case's stops took.
    pub(super) fn end(mut self, stops: &StopTimes) -> Responses {
        for (kind, at) in self.told {
            let mut faults = stops.0.iter().filter(|it| it.cause == "fault");
            if let Some(stop) = faults.find(|it| it.since == at) {
                self.responses.of(kind).rests.add(stop.cycles);
            }
        }
        self.responses
    }
}

impl Responses {
    /// What became of troubles of a kind.
    fn of(&mut self, kind: &str) -> &mut Response {
        self.0.entry(kind.to_owned()).or_default()
    }

    /// Adds what became of other troubles.
    pub(super) fn merge(&mut self, other: Self) {
        for (kind, other) in other.0 {
            let mine = self.of(&kind);
            mine.came += other.came;
            mine.alone += other.alone;
            mine.told.merge(other.told);
            mine.rests.merge(other.rests);
        }
    }
}

impl fmt::Display for Responses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "troubles: how many came, how many of these alone, and how many of those were told as a fault; cycles from the \
             trouble to the fault, and from there to the last setpoint that changed: median, 99 %, most:"
        )?;
        for (kind, it) in &self.0 {
            let (came, alone, told) = (it.came, it.alone, it.told.total());
            writeln!(
                f,
                "  {kind:<34} {came:>7} {alone:>7} {told:>7}   {:<18} {}",
                it.told.to_string(),
                it.rests
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Case, Outcome, Wanted, When, run};
    use super::*;
    use crate::campaign::Trouble;
    use crate::control::State;
    use crate::session::Event as Told;

    /// A case that nothing happens to but these, once its machine is ready.
    fn played(seed: u64, troubles: &[(u32, Interference)]) -> (Outcome, Vec<String>) {
        let mut case = Case::of(seed);
        case.deeds.clear();
        case.programs = vec![Vec::new()];
        let trouble = |(at, what): &(u32, Interference)| Trouble {
            at: When::Ready(*at),
            what: what.clone(),
        };
        case.troubles = troubles.iter().map(trouble).collect();
        (case.patience, case.cycles) = (None, 300);
        let mut faults = Vec::new();
        let outcome = run(&case, Wanted::default(), &mut |seen| {
            if let Seen::Told(Told::Machine(control::Event::Fault(fault))) = seen {
                faults.push(format!("{fault:?}"));
            }
        });
        (outcome, faults)
    }

    /// Seeds whose machines come to be ready with nobody at them.
    fn seeds() -> Vec<u64> {
        let is_ready = |seed: &u64| {
            let mut case = Case::of(*seed);
            case.deeds.clear();
            case.troubles.clear();
            (case.patience, case.cycles) = (None, 10);
            let mut ready = false;
            let _ = run(&case, Wanted::default(), &mut |seen| {
                ready |= matches!(seen, Seen::Told(Told::State(State::Ready)));
            });
            ready
        };
        (0..20).filter(is_ready).take(3).collect()
    }

    #[test]
    fn a_trouble_that_comes_alone_is_counted_with_its_fault() {
        let unplugged = Interference::Bus(0, crate::campaign::ToBus::Unplug(30));
        let mut rested = 0;
        for seed in seeds() {
            let (outcome, faults) = played(seed, &[(20, unplugged.clone())]);
            assert!(!faults.is_empty(), "{seed}");
            let response = &outcome.coverage.responses().0["interface gone"];
            assert_eq!((response.came, response.alone), (1, 1), "{seed}");
            assert_eq!(response.told.total(), 1, "{seed}: {faults:?}");
            assert!(response.told.at(100) <= 2, "{seed}: {response:?}");
            rested += response.rests.total();
        }
        assert!(rested > 0);
    }

    /// The second one comes beside the first, whose it may be.
    #[test]
    fn a_fault_behind_two_troubles_is_nobodys() {
        let slow = Interference::Drive(0, ToDrive::EnableTime(1));
        let unplugged = Interference::Bus(0, crate::campaign::ToBus::Unplug(30));
        for seed in seeds() {
            let (outcome, faults) = played(seed, &[(20, slow.clone()), (21, unplugged.clone())]);
            assert!(!faults.is_empty(), "{seed}");
            let responses = &outcome.coverage.responses().0;
            let counts = |kind: &str| {
                let it = &responses[kind];
                (it.came, it.alone, it.told.total())
            };
            assert_eq!(counts("enabling takes longer"), (1, 0, 0), "{seed}");
            assert_eq!(counts("interface gone"), (1, 0, 0), "{seed}");
        }
    }
}
