//! What a campaign has reached, as tables: which command in which state, which trouble in which phase,
//! which faults and refusals, how long stops took, and what became of troubles.

use super::checkers::{Scene, StopTimes};
use super::kinds;
use super::response::{Responses, Tracker};
use super::stage::Seen;
use crate::control::{self, Phase, State};
use crate::session::{Command, Event};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// See the module.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    /// By command, then state: accepted and refused.
    commands: BTreeMap<String, BTreeMap<State, [u64; 2]>>,
    /// By trouble, then phase.
    troubles: BTreeMap<String, BTreeMap<Phase, u64>>,
    /// What was told, by its kind.
    told: BTreeMap<String, u64>,
    /// By cause: cycles until rest.
    stops: BTreeMap<String, Counts>,
    /// States that machines were in.
    states: BTreeMap<String, u64>,
    /// What became of troubles.
    responses: Responses,
}

/// How often each of some whole numbers came: as small as there are different ones, and the same in whatever order they came.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Counts(BTreeMap<u64, u64>);

impl Counts {
    /// One that came.
    pub(super) fn add(&mut self, value: u64) {
        *self.0.entry(value).or_default() += 1;
    }

    /// Adds what came elsewhere.
    pub(super) fn merge(&mut self, other: Self) {
        for (value, count) in other.0 {
            *self.0.entry(value).or_default() += count;
        }
    }

    /// How many came.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.0.values().sum()
    }

    /// The least of them that so many per cent of them, or more, are no greater than; 0 of none.
    #[must_use]
    pub fn at(&self, percent: u64) -> u64 {
        let wanted = (self.total() * percent).div_ceil(100).max(1);
        let mut so_far = 0;
        let reaches = |(_, count): &(&u64, &u64)| {
            so_far += **count;
            so_far >= wanted
        };
        self.0.iter().find(reaches).map_or(0, |(value, _)| *value)
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.total() {
            0 => f.write_str("–"),
            _ => write!(f, "{} {} {}", self.at(50), self.at(99), self.at(100)),
        }
    }
}

/// Where in a case something may come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Moment {
    /// A machine in this state, as far as commands go.
    State(State),
    /// A controller in this phase, as far as troubles go.
    Phase(Phase),
}

/// A cell of the tables: what was commanded or went wrong, and where it came.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Cell {
    /// The kind of the command or of the trouble.
    pub kind: String,
    /// The state or the phase.
    pub moment: Moment,
}

impl fmt::Display for Cell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.moment {
            Moment::State(state) => write!(f, "{} while {state}", self.kind),
            Moment::Phase(phase) => write!(f, "{} in {phase:?}", self.kind),
        }
    }
}

impl Coverage {
    /// Takes what is seen, with the scene as it was before.
    pub(super) fn see(&mut self, scene: &Scene<'_>, seen: &Seen) {
        match seen {
            Seen::Interfered(what) => {
                let phases = self.troubles.entry(what.kind().to_owned()).or_default();
                *phases.entry(scene.phase).or_default() += 1;
            }
            Seen::Told(Event::Accepted(it)) => self.command(scene.state, &it.command, 0),
            Seen::Told(Event::Refused(it)) => {
                self.command(scene.state, &it.command, 1);
                self.count(kinds::refusal(&it.reason));
            }
            Seen::Told(Event::State(state)) => {
                *self.states.entry(state.to_string()).or_default() += 1;
            }
            Seen::Told(Event::Machine(event)) => match event {
                control::Event::Fault(fault) => self.count(kinds::fault(fault)),
                control::Event::Phase(_) | control::Event::State(_) => {}
                event => self.count(format!("event: {}", kinds::kind(event))),
            },
            Seen::Told(Event::Problem(error)) => {
                self.count(format!("problem: {}", kinds::kind(error)));
            }
            Seen::Frame { .. }
            | Seen::Commanded(_)
            | Seen::Woken(_)
            | Seen::Told(Event::Recorded(_) | Event::Message { .. }) => {}
        }
    }

    fn count(&mut self, what: String) {
        *self.told.entry(what).or_default() += 1;
    }

    fn command(&mut self, state: State, command: &Command, place: usize) {
        let states = self.commands.entry(name(command).to_owned()).or_default();
        states.entry(state).or_default()[place] += 1;
    }

    /// Takes how long the stops of a case took, and what became of its troubles.
    pub(super) fn end(&mut self, times: &StopTimes, troubles: Tracker) {
        for stop in &times.0 {
            let stops = self.stops.entry(stop.cause.to_owned()).or_default();
            stops.add(stop.cycles);
        }
        self.responses.merge(troubles.end(times));
    }

    /// What became of troubles.
    #[must_use]
    pub fn responses(&self) -> &Responses {
        &self.responses
    }

    /// Adds what another case reached.
    pub fn merge(&mut self, other: Self) {
        for (command, states) in other.commands {
            let mine = self.commands.entry(command).or_default();
            for (state, [accepted, refused]) in states {
                let counts = mine.entry(state).or_default();
                *counts = [counts[0] + accepted, counts[1] + refused];
            }
        }
        for (trouble, phases) in other.troubles {
            let mine = self.troubles.entry(trouble).or_default();
            for (phase, count) in phases {
                *mine.entry(phase).or_default() += count;
            }
        }
        for (mine, other) in [
            (&mut self.told, other.told),
            (&mut self.states, other.states),
        ] {
            for (what, count) in other {
                *mine.entry(what).or_default() += count;
            }
        }
        for (cause, cycles) in other.stops {
            self.stops.entry(cause).or_default().merge(cycles);
        }
        self.responses.merge(other.responses);
    }
}

/// A cell that was reached less often than that is told, and steered to.
pub(super) const SELDOM: u64 = 20;

impl Coverage {
    /// How often each cell was reached, of all the kinds that there were. A machine that is off takes no command, and to one that sends
    /// nothing any more nothing happens.
    #[must_use]
    pub fn cells(&self) -> Vec<(u64, Cell)> {
        let cell = |kind: &String, moment| {
            let kind = kind.clone();
            Cell { kind, moment }
        };
        let mut cells = Vec::new();
        for (command, counts) in &self.commands {
            for state in State::ALL.into_iter().filter(|it| *it != State::Off) {
                let [accepted, refused] = counts.get(&state).copied().unwrap_or_default();
                cells.push((accepted + refused, cell(command, Moment::State(state))));
            }
        }
        let phases = self.troubles.values().flat_map(|it| it.keys().copied());
        let phases: BTreeSet<Phase> = phases.filter(|it| *it != Phase::Done).collect();
        for (trouble, counts) in &self.troubles {
            for phase in &phases {
                let count = counts.get(phase).copied().unwrap_or_default();
                cells.push((count, cell(trouble, Moment::Phase(*phase))));
            }
        }
        cells
    }

    /// Which cells were reached seldom or never.
    fn seldom(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut cells = self.cells();
        let all = cells.len();
        cells.retain(|(count, _)| *count < SELDOM);
        let seldom = cells.len();
        writeln!(f, "of {all} cells {seldom} less than {SELDOM} times:")?;
        for (count, cell) in cells {
            writeln!(f, "  {count:>2} {cell}")?;
        }
        Ok(())
    }
}

/// A command's kind, as the tables name it.
pub(super) fn name(command: &Command) -> &'static str {
    match command {
        Command::CycleStart => "cycle start",
        Command::FeedHold => "feed hold",
        Command::Resume => "resume",
        Command::ToggleFeedHold => "toggle feed hold",
        Command::SingleBlock(_) => "single block",
        Command::OptionalStop(_) => "optional stop",
        Command::Retrace => "retrace",
        Command::FeedOverride(_) => "feed override",
        Command::RapidOverride(_) => "rapid override",
        Command::Jog(_) => "jog",
        Command::RenewJog(_) => "renew jog",
        Command::EndJog(_) => "end jog",
        Command::JogStep(_) => "jog step",
        Command::GoTo(_) => "go to",
        Command::Load(_) => "load",
        Command::Run { .. } => "run",
        Command::Mdi(_) => "MDI",
        Command::SetWorkOffset(_) => "set work offset",
        Command::SetToolLength(_) => "set tool length",
        Command::Stop => "stop",
        Command::Enable => "enable",
        Command::Disable => "disable",
        Command::Reset => "reset",
        Command::SwitchOff => "switch off",
        Command::Home(_) => "home",
        Command::Output { .. } => "output",
        Command::UserCodeEnded { .. } => "user code ended",
    }
}

impl fmt::Display for Coverage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "commands by state, accepted/refused:")?;
        for (command, counts) in &self.commands {
            write!(f, "  {command:<17}")?;
            for state in State::ALL {
                let [accepted, refused] = counts.get(&state).copied().unwrap_or_default();
                write!(f, " {state} {accepted}/{refused},")?;
            }
            writeln!(f)?;
        }
        writeln!(f, "troubles by phase:")?;
        for (trouble, phases) in &self.troubles {
            write!(f, "  {trouble:<32}")?;
            for (phase, count) in phases {
                write!(f, " {phase:?} {count},")?;
            }
            writeln!(f)?;
        }
        writeln!(f, "told:")?;
        for (what, count) in &self.told {
            writeln!(f, "  {count:>8} {what}")?;
        }
        let told = |kind: &str| self.told.contains_key(kind);
        for (what, why) in kinds::told_though(told) {
            writeln!(f, "  told, though it is said that {why}: {what}")?;
        }
        writeln!(f, "never told:")?;
        for (what, why) in kinds::not_told(told) {
            let why = why.map_or_else(String::new, |why| format!(": {why}"));
            writeln!(f, "           {what}{why}")?;
        }
        self.seldom(f)?;
        writeln!(f, "from cause to rest, cycles: count; median, 99 %, most:")?;
        for (cause, cycles) in &self.stops {
            writeln!(f, "  {cause:<12} {:>7}   {cycles}", cycles.total())?;
        }
        self.responses.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_are_those_of_the_numbers_in_their_order() {
        let mut counts = Counts::default();
        assert_eq!((counts.total(), counts.at(50)), (0, 0));
        for value in 1..=50 {
            counts.add(value);
        }
        let mut others = Counts::default();
        for value in (51..=200).rev() {
            others.add(value);
        }
        others.add(7);
        counts.merge(others);
        // 201 numbers, 7 twice.
        assert_eq!(counts.total(), 201);
        assert_eq!([0, 50, 99, 100].map(|at| counts.at(at)), [1, 100, 198, 200]);
        let mut two = Counts::default();
        two.add(1);
        two.add(100);
        assert_eq!([50, 99].map(|at| two.at(at)), [1, 100]);
    }
}
