//! Steering towards what was not reached.
//!
//! Random cases reach again and again what is common: most commands come while a program runs or the
//! machine is ready, most troubles where a path is at work. A state that lasts for milliseconds, or needs
//! several things before it, is met by few of them. An explorer remembers by state and by phase cases that
//! were in it, and when. Into one of those it puts at that moment what the tables lack there. As a case is a
//! function of its data, it is in that state again: all is the same until then. What comes of it is
//! remembered in its turn, so that rare states lead on to rarer ones.
//!
//! A part of the cases is drawn as ever, or the same few would be varied for ever. What the explorer plays
//! depends on all that was played before; so a case that fails is kept whole, not by a number.

use super::case::{Case, When};
use super::coverage::{Cell, Coverage, Moment, SELDOM};
use super::dice::Dice;
use super::interference::{self, Trouble};
use super::operator::{self, Deed, OPERATORS};
use super::stage::Seen;
use crate::control::State;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Share of the cases that are drawn as ever.
const DRAWN: f64 = 0.3;

/// Cases that are kept for a moment.
const KEPT: usize = 50;

/// Commands and troubles of a case that is varied no more.
const MOST: usize = 100;

/// Attempts at a cell until it is given up: what is put there may be taken for something else, or too late.
const ATTEMPTS: u32 = 3 * SELDOM as u32;

/// The stream of random choices of explorers, and of sightings.
const STREAMS: [u64; 2] = [100, 101];

/// See the module.
#[derive(Debug)]
pub struct Explorer {
    dice: Dice,
    cases: BTreeMap<Moment, Vec<(Arc<Case>, When)>>,
    attempts: BTreeMap<Cell, u32>,
}

/// When a case was where: a moment of each kind, any of them with the same chance.
#[derive(Debug)]
pub struct Sightings {
    dice: Dice,
    /// Until the machine is switched off, and nothing is commanded any more.
    cycles: u64,
    ready: Option<u64>,
    moments: BTreeMap<Moment, (u32, When)>,
}

impl Sightings {
    /// Of a case, with a number for the choice among its moments.
    #[must_use]
    pub fn new(case: &Case, number: u64) -> Self {
        Self {
            dice: Dice::new(number, STREAMS[1]),
            cycles: case.cycles.into(),
            ready: None,
            moments: BTreeMap::new(),
        }
    }

    /// Takes what is seen.
    pub fn see(&mut self, seen: &Seen) {
        let Seen::Woken(woken) = seen else {
            return;
        };
        if woken.state == State::Ready {
            self.ready.get_or_insert(woken.cycle);
        }
        let since = self.ready.map(|ready| woken.cycle - ready);
        let at = match since {
            Some(since) => When::Ready(since as u32),
            None => When::On(woken.cycle as u32),
        };
        let is_over = since.is_some_and(|since| since >= self.cycles);
        let state = (!is_over).then_some(Moment::State(woken.state));
        for moment in state.into_iter().chain([Moment::Phase(woken.phase)]) {
            let (count, kept) = self.moments.entry(moment).or_insert((0, at));
            *count += 1;
            if self.dice.below(*count as usize) == 0 {
                *kept = at;
            }
        }
    }
}

impl Explorer {
    /// One that has seen nothing.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self {
            dice: Dice::new(seed, STREAMS[0]),
            cases: BTreeMap::new(),
            attempts: BTreeMap::new(),
        }
    }

    /// The next case, where this was reached so far: one that is steered, or that of the seed.
    #[must_use]
    pub fn next(&mut self, seed: u64, reached: &Coverage) -> Case {
        let drawn = self.dice.chance(DRAWN);
        let steered = (!drawn).then(|| self.steered(reached)).flatten();
        steered.unwrap_or_else(|| Case::of(seed))
    }

    /// A case in which something comes where it came seldom.
    fn steered(&mut self, reached: &Coverage) -> Option<Case> {
        let mut cells = reached.cells();
        cells.retain(|(count, cell)| {
            let attempts = self.attempts.get(cell).copied().unwrap_or_default();
            *count < SELDOM && attempts < ATTEMPTS && self.cases.contains_key(&cell.moment)
        });
        if cells.is_empty() {
            return None;
        }
        let (_, cell) = cells.swap_remove(self.dice.below(cells.len()));
        *self.attempts.entry(cell.clone()).or_default() += 1;
        let cases = self.cases.get(&cell.moment)?;
        let first = self.dice.below(cases.len());
        // Not every machine has what the cell is about.
        let cases = [&cases[first..], &cases[..first]].concat();
        cases.into_iter().find_map(|(case, at)| {
            let mut case = Case::clone(&case);
            self.put(&mut case, at, &cell)?;
            Some(case)
        })
    }

    /// Puts into a case what a cell is about, if its machine can have it.
    fn put(&mut self, case: &mut Case, at: When, cell: &Cell) -> Option<()> {
        let dice = &mut self.dice;
        match cell.moment {
            Moment::State(_) => {
                let programs = case.programs.len();
                let command = operator::of_kind(dice, &case.machine, programs, &cell.kind)?;
                let operator = dice.below(OPERATORS);
                case.deeds.push(Deed {
                    at,
                    operator,
                    command,
                });
                case.deeds.sort_by_key(|deed| deed.at);
            }
            Moment::Phase(_) => {
                let what = interference::of_kind(dice, &case.machine, &cell.kind)?;
                case.troubles.push(Trouble { at, what });
                case.troubles.sort_by_key(|trouble| trouble.at);
            }
        }
        Some(())
    }

    /// Remembers where a case was that was played.
    pub fn remember(&mut self, case: Case, sightings: Sightings) {
        if case.deeds.len() + case.troubles.len() > MOST {
            return;
        }
        let case = Arc::new(case);
        for (moment, (_, at)) in sightings.moments {
            let cases = self.cases.entry(moment).or_default();
            if cases.len() < KEPT {
                cases.push((Arc::clone(&case), at));
            } else {
                cases[self.dice.below(KEPT)] = (Arc::clone(&case), at);
            }
        }
    }

    /// Cells that were tried for and given up.
    pub fn given_up<'a>(&'a self, reached: &Coverage) -> impl Iterator<Item = &'a Cell> {
        let cells = reached.cells();
        let seldom = move |cell: &Cell| {
            let mut cells = cells.iter();
            cells.any(|(count, it)| it == cell && *count < SELDOM)
        };
        let attempts = self.attempts.iter();
        attempts
            .filter(move |(cell, attempts)| **attempts >= ATTEMPTS && seldom(cell))
            .map(|(cell, _)| cell)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Wanted, coverage, run};
    use super::*;

    /// A short case, and where it was.
    fn played(seed: u64) -> (Case, Sightings, Coverage) {
        let mut case = Case::of(seed);
        case.cycles /= 8;
        let mut sightings = Sightings::new(&case, seed);
        let outcome = run(&case, Wanted::default(), &mut |seen| sightings.see(seen));
        (case, sightings, outcome.coverage)
    }

    #[test]
    fn what_is_put_into_a_case_comes_where_it_is_wanted() {
        let mut explorer = Explorer::new(0);
        let mut reached = Coverage::default();
        for seed in 0..8 {
            let (case, sightings, coverage) = played(seed);
            reached.merge(coverage);
            explorer.remember(case, sightings);
        }
        let mut missed = Vec::new();
        for (kind, state) in [
            ("jog", State::Starting),
            ("retrace", State::Ready),
            ("stop", State::Running),
            ("home", State::Stopping),
        ] {
            let moment = Moment::State(state);
            let (case, at) = explorer.cases[&moment][0].clone();
            let mut steered = Case::clone(&case);
            let kind = kind.to_owned();
            let cell = Cell { kind, moment };
            explorer.put(&mut steered, at, &cell).unwrap();
            let (mut now, mut came) = (State::Starting, false);
            let _ = run(&steered, Wanted::default(), &mut |seen| match seen {
                Seen::Woken(woken) => now = woken.state,
                Seen::Commanded(command) if coverage::name(command) == cell.kind => {
                    came |= now == state;
                }
                _ => {}
            });
            missed.extend((!came).then(|| cell.to_string()));
        }
        assert_eq!(missed, [""; 0]);
        let steered = explorer.steered(&reached).unwrap();
        assert_eq!(explorer.attempts.len(), 1);
        assert!(steered.machine.machine().is_ok());
    }
}
