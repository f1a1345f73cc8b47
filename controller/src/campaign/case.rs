//! A case: all that a seed stands for, as data. It can be written to a file, made smaller and played
//! again, whatever became of the generators since.

use super::dice::Dice;
use super::interference::{self, Interference, ToDrive, Trouble};
use super::machine::{MachineSpec, Wire};
use super::operator::{self, Deed};
use super::program;
use crate::session::Command;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fs;
use std::io;
use std::path::Path;
use syncline_strict_toml::input;

/// Virtual time of a case from where its machine is ready for the first time, s: the shortest and the
/// longest.
const DURATION: (f64, f64) = (1.0, 8.0);

/// In each part of a case that lasts a machine works for so long, s, without anything happening to it, once what did is mended.
const QUIET: f64 = 22.0;

/// How many operators leave a machine that does not go on by itself where it is, and for how long, s: so that what is to be true of it
/// after a while is looked at.
const LEAVES: f64 = 0.3;
const LEFT: (f64, f64) = (2.2, 3.5);

/// A random machine with its programs, its operators and what goes wrong.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Case {
    /// Where it comes from; also of the twins' noise, delays and oscillators.
    pub seed: u64,
    /// The machine.
    pub machine: MachineSpec,
    /// The programs, line by line; the first is `0.ngc`.
    pub programs: Vec<Vec<String>>,
    /// What operators command.
    pub deeds: Vec<Deed>,
    /// Wake-ups for which somebody waits who goes on where the machine rests; `None`: nobody is there.
    pub patience: Option<u32>,
    /// Wake-ups for which they leave a machine besides that a fault has stopped, or that was disabled.
    #[serde(default)]
    pub leave: u32,
    /// What goes wrong.
    pub troubles: Vec<Trouble>,
    /// Cycles from where the machine is ready first until it is switched off.
    pub cycles: u32,
}

/// An instant of a case, in cycles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum When {
    /// Since the machine was switched on.
    On(u32),
    /// Since it was ready for the first time.
    Ready(u32),
}

impl When {
    /// Some time in a case of so many cycles; now and then while the machine comes up.
    pub(super) fn draw(dice: &mut Dice, cycles: u32) -> Self {
        if dice.chance(0.12) {
            Self::On(dice.whole(0..=400))
        } else {
            Self::Ready(dice.whole(0..=cycles))
        }
    }

    /// So many cycles later.
    pub(super) fn later(self, cycles: u32) -> Self {
        match self {
            Self::On(cycle) => Self::On(cycle + cycles),
            Self::Ready(cycle) => Self::Ready(cycle + cycles),
        }
    }

    /// Whether it has come, so many cycles after switching on, and since the machine was ready.
    pub(super) fn has_come(self, on: u64, ready: Option<u64>) -> bool {
        match self {
            Self::On(cycle) => on >= cycle.into(),
            Self::Ready(cycle) => ready.is_some_and(|since| since >= cycle.into()),
        }
    }
}

impl Case {
    /// The case of a seed: a function of the seed and of this version.
    #[must_use]
    pub fn of(seed: u64) -> Self {
        let dice = &mut Dice::new(seed, 2);
        let seconds = dice.between(DURATION.0, DURATION.1);
        let patience = (dice.chance(0.9)).then(|| *dice.pick(&[1, 10, 60, 300]));
        let machine = MachineSpec::of(seed);
        let dice = &mut Dice::new(seed, 41);
        let leave = match dice.chance(LEAVES) {
            // Two wake-ups a cycle.
            true => 2 * machine.cycles(dice.between(LEFT.0, LEFT.1)),
            false => 0,
        };
        let mut case = Self {
            seed,
            machine,
            programs: Vec::new(),
            deeds: Vec::new(),
            patience,
            leave,
            troubles: Vec::new(),
            cycles: 0,
        };
        case.go_on(0, seconds);
        case
    }

    /// The case of a seed that goes on for so many seconds, as a day at the machine does: behind what
    /// [`Case::of`] has come other parts, each with programs, operators and troubles of its own. Somebody goes
    /// on wherever the machine rests, nobody switches it off before, and what was broken in a part is mended before the machine works for
    /// a while without trouble.
    #[must_use]
    pub fn lasting(seed: u64, seconds: f64) -> Self {
        let mut case = Self::of(seed);
        case.patience = case.patience.or(Some(60));
        case.mend(0);
        let cycles = case.machine.cycles(seconds);
        for part in 1.. {
            if case.cycles >= cycles {
                break;
            }
            let since = case.troubles.len();
            case.go_on(part, DURATION.1);
            case.mend(since);
            case.cycles += case.machine.cycles(QUIET);
        }
        case.deeds.retain(|deed| deed.command != Command::SwitchOff);
        case
    }

    /// Goes on with another part, of so many seconds.
    fn go_on(&mut self, part: u64, seconds: f64) {
        let (machine, cycles) = (&self.machine, self.machine.cycles(seconds));
        let dice = |stream| Dice::new(self.seed, part << 8 | stream);
        let mut draw = dice(1);
        let programs = (0..draw.whole(1..=3)).map(|_| program::draw(&mut draw, machine));
        let mut programs: Vec<_> = programs.collect();
        programs.extend(program::special(&mut dice(6), machine));
        programs.extend(program::shifted(&mut dice(36), machine));
        if let Some(circles) = program::circles(&mut dice(33), machine) {
            programs[0] = circles;
        }
        program::go(&mut dice(16), machine, &mut programs);
        program::read_inputs(&mut dice(18), machine, &mut programs);
        program::orient(&mut dice(20), machine, &mut programs);
        self.programs.extend(programs);

        let deeds = operator::draw(&mut dice(3), machine, self.programs.len(), cycles);
        let mut troubles = interference::draw(&mut dice(4), machine, cycles);
        interference::answer_wrongly(&mut dice(7), machine, &mut troubles);
        interference::switch_inputs(&mut dice(8), machine, cycles, &mut troubles);
        interference::slip(&mut dice(12), machine, cycles, &mut troubles);
        interference::part(&mut dice(43), machine, cycles, &mut troubles);
        interference::command_besides(&mut dice(22), machine, cycles, &mut troubles);
        interference::be_strange(&mut dice(37), machine, cycles, &mut troubles);
        // The machine comes up once, in the first part.
        let so_far = self.cycles;
        let begins = |at: &When| part == 0 || matches!(at, When::Ready(_));
        let deeds = deeds.into_iter().filter(|deed| begins(&deed.at));
        self.deeds.extend(deeds.map(|deed| Deed {
            at: deed.at.later(so_far),
            ..deed
        }));
        let troubles = troubles.into_iter().filter(|trouble| begins(&trouble.at));
        self.troubles.extend(troubles.map(|trouble| Trouble {
            at: trouble.at.later(so_far),
            ..trouble
        }));
        self.cycles += cycles;
    }

    /// Has somebody mend here what went wrong since so many troubles.
    fn mend(&mut self, since: usize) {
        let at = When::Ready(self.cycles);
        let wrong = self.troubles[since..].iter();
        let remedies = wrong.filter_map(|trouble| trouble.what.remedy(&self.machine));
        let remedies: Vec<_> = remedies.map(|what| Trouble { at, what }).collect();
        self.troubles.extend(remedies);
        // A fault may have left any axis where it must not be enabled.
        let rest = (0..self.machine.axes.len()).map(Interference::Align);
        let rest = rest.chain([Interference::Mended]);
        (self.troubles).extend(rest.map(|what| Trouble { at, what }));
    }

    /// Whether nothing goes wrong, so that nothing may be told to be wrong. An input that is switched is
    /// nothing wrong, unless the drives may not be enabled then, or an axis is homed by it.
    #[must_use]
    pub fn is_untroubled(&self) -> bool {
        let disturbs = |trouble: &Trouble| match trouble.what {
            Interference::StarvePlanner(_) => false,
            Interference::Drive(drive, ToDrive::Input(place, _)) => {
                (self.machine).has_wire(drive, place, Wire::misleads)
            }
            _ => true,
        };
        !self.troubles.iter().any(disturbs)
    }

    /// Reads a case.
    ///
    /// # Errors
    /// It cannot be read, or is none.
    pub fn load(file: &Path) -> io::Result<Self> {
        from_json(file)
    }

    /// Writes it.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn save(&self, file: &Path) -> io::Result<()> {
        fs::write(file, self.to_json()?)
    }

    /// Its text in a file.
    ///
    /// # Errors
    /// There is none, which does not happen.
    pub fn to_json(&self) -> io::Result<String> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }
}

/// What a file has as JSON. Errors name it.
///
/// # Errors
/// It cannot be read, or is something else.
pub fn from_json<T: DeserializeOwned>(file: &Path) -> io::Result<T> {
    let read = input::read(file).and_then(|text| Ok(serde_json::from_slice(&text)?));
    read.map_err(|why| {
        let told = format!("cannot read {}: {why}", file.display());
        io::Error::new(why.kind(), told)
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Seen, Wanted, run};
    use super::*;
    use crate::control::State;
    use crate::session::Event;
    use std::collections::BTreeSet;

    #[test]
    fn a_case_is_read_as_it_was_written() {
        for seed in 0..200 {
            let case = Case::of(seed);
            assert_eq!(case, Case::of(seed));
            let text = serde_json::to_string(&case).unwrap();
            assert_eq!(serde_json::from_str::<Case>(&text).unwrap(), case, "{seed}");
        }
    }

    #[test]
    fn a_case_that_lasts_goes_on_where_that_of_its_seed_ends() {
        for seed in 0..100 {
            let (case, long) = (Case::of(seed), Case::lasting(seed, 60.0));
            assert_eq!(long, Case::lasting(seed, 60.0));
            let (machine, seconds) = (&case.machine, 60.0);
            assert_eq!(&long.machine, machine);
            assert!(long.cycles >= machine.cycles(seconds), "{seed}");
            assert!(long.programs.starts_with(&case.programs), "{seed}");
            assert!(long.programs.len() >= 3, "{seed}: {}", long.programs.len());
            let off = |deed: &Deed| deed.command == Command::SwitchOff;
            assert!(!long.deeds.iter().any(off), "{seed}");
            let wrong = long.troubles.iter();
            for remedy in wrong.filter_map(|it| it.what.remedy(machine)) {
                let mut troubles = long.troubles.iter();
                assert!(troubles.any(|it| it.what == remedy), "{seed}: {remedy:?}");
            }
        }
    }

    /// Each kind of trouble by itself, whatever it leaves behind: once it is mended somebody gets the machine to work again.
    #[test]
    fn what_is_mended_works_again() {
        let mut kinds = BTreeSet::new();
        for seed in 0..40 {
            let mut case = Case::of(seed);
            case.deeds.clear();
            case.troubles.clear();
            (case.patience, case.leave) = (Some(10), 0);
            case.programs = vec![Vec::new()];
            let machine = case.machine.clone();
            let what = interference::one(&mut Dice::new(seed, 99), &machine);
            kinds.insert(what.kind());
            case.troubles.push(Trouble {
                at: When::Ready(machine.cycles(0.2)),
                what: what.clone(),
            });
            // It has to be set up once more.
            case.troubles.push(Trouble {
                at: When::Ready(machine.cycles(0.4)),
                what: Interference::Drive(0, ToDrive::Error(3)),
            });
            case.cycles = machine.cycles(3.0);
            case.mend(0);
            case.cycles += machine.cycles(12.0);
            let mut ready = false;
            let outcome = run(&case, Wanted::default(), &mut |seen| match seen {
                Seen::Interfered(Interference::Mended) => ready = false,
                Seen::Told(Event::State(State::Running)) => ready = true,
                _ => {}
            });
            assert_eq!(outcome.violations, [], "{seed}: {what:?}");
            // One that is homed for long may not be there yet.
            let homes = machine.axes.iter().any(|axis| axis.homing.is_some());
            assert!(ready || homes, "{seed}: {what:?}");
        }
        assert!(kinds.len() > 15, "{kinds:?}");
    }

    #[test]
    fn cases_are_of_every_kind() {
        let cases: Vec<Case> = (0..300).map(Case::of).collect();
        let untroubled = cases.iter().filter(|case| case.is_untroubled()).count();
        assert!((50..160).contains(&untroubled), "{untroubled}");
        let alone = cases.iter().filter(|case| case.deeds.is_empty()).count();
        assert!((30..120).contains(&alone), "{alone}");
    }
}
