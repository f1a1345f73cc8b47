//! The smallest case that still fails: less of everything, as long as the same is found.
//!
//! A list is shrunk by leaving out runs of it, long ones first, then single places (delta debugging,
//! Zeller and Hildebrandt 2002); axes are left out with all that names them. A case is played at every
//! attempt, so their number is bounded.

use super::case::Case;
use super::interference::{Interference, Trouble};
use super::operator::Deed;
use crate::session::{Command, Jog};

/// Cases that are played at most.
const ATTEMPTS: usize = 400;

/// Makes a case smaller as long as it `fails`.
#[must_use]
pub fn shrink(case: &Case, mut fails: impl FnMut(&Case) -> bool) -> Case {
    let mut shrinking = Shrinking {
        best: case.clone(),
        left: ATTEMPTS,
        fails: &mut fails,
    };
    loop {
        let before = shrinking.best.clone();
        shrinking.list(|case| &mut case.troubles);
        shrinking.list(|case| &mut case.deeds);
        shrinking.time();
        shrinking.axes();
        for program in 0..shrinking.best.programs.len() {
            shrinking.list(move |case| &mut case.programs[program]);
        }
        shrinking.attempt(|case| case.patience = None);
        shrinking.attempt(|case| case.leave = 0);
        if shrinking.best == before || shrinking.left == 0 {
            return shrinking.best;
        }
    }
}

struct Shrinking<'a> {
    best: Case,
    left: usize,
    fails: &'a mut dyn FnMut(&Case) -> bool,
}

impl Shrinking<'_> {
    /// Keeps a change that is one and leaves the case failing.
    fn attempt(&mut self, change: impl FnOnce(&mut Case)) -> bool {
        let mut smaller = self.best.clone();
        change(&mut smaller);
        if self.left == 0 || smaller == self.best {
            return false;
        }
        self.left -= 1;
        let fails = (self.fails)(&smaller);
        if fails {
            self.best = smaller;
        }
        fails
    }

    /// Leaves out what can be left out of a list.
    fn list<T>(&mut self, list: impl Fn(&mut Case) -> &mut Vec<T> + Copy) {
        let mut run = list(&mut self.best).len();
        while run > 0 {
            let mut from = 0;
            while from < list(&mut self.best).len() {
                let without = self.attempt(|case| {
                    let list = list(case);
                    let end = (from + run).min(list.len());
                    list.drain(from..end);
                });
                if !without {
                    from += run;
                }
            }
            run /= 2;
        }
    }

    /// Ends the case sooner.
    fn time(&mut self) {
        for parts in [4, 2] {
            while self.attempt(|case| case.cycles -= case.cycles / parts) {}
        }
    }

    /// Leaves out axes with what names them.
    fn axes(&mut self) {
        let mut axis = 0;
        while axis < self.best.machine.axes.len() {
            let alone = self.best.machine.axes.len() == 1;
            if alone || !self.attempt(|case| without_axis(case, axis)) {
                axis += 1;
            }
        }
    }
}

/// Takes an axis out of a case.
fn without_axis(case: &mut Case, axis: usize) {
    let before: Vec<_> = case.machine.nodes().collect();
    let letter = case.machine.axes.remove(axis).letter;
    let left: Vec<_> = case.machine.nodes().collect();
    for program in &mut case.programs {
        program.retain(|line| !line.contains(letter));
    }
    case.deeds.retain(|deed| !names(deed, letter));
    case.troubles.retain_mut(|Trouble { what, .. }| match what {
        Interference::Align(aligned) if *aligned == axis => false,
        Interference::Align(aligned) => {
            *aligned -= usize::from(*aligned > axis);
            true
        }
        Interference::Drive(device, _)
        | Interference::Slip(device, _)
        | Interference::Part(device)
        | Interference::Join(device) => {
            let place = left.iter().position(|it| Some(it) == before.get(*device));
            *device = place.unwrap_or_default();
            place.is_some()
        }
        _ => true,
    });
    let buses = case.machine.buses.len();
    case.machine.leave_out_unused_buses();
    if case.machine.buses.len() != buses {
        let left = case.machine.buses.len();
        for Trouble { what, .. } in &mut case.troubles {
            if let Interference::Bus(bus, _) = what {
                *bus = (*bus).min(left - 1);
            }
        }
    }
}

/// Whether a deed is about an axis.
fn names(deed: &Deed, letter: char) -> bool {
    match &deed.command {
        Command::Mdi(lines) => lines.contains(letter),
        Command::Jog(
            Jog::Step { axis, .. } | Jog::By { axis, .. } | Jog::Continuous { axis, .. },
        )
        | Command::RenewJog(axis)
        | Command::EndJog(axis) => axis.letter() == letter,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::super::interference::ToDrive;
    use super::*;

    #[test]
    fn only_what_is_needed_is_left() {
        let large = (0..).map(Case::of);
        let mut large = large.filter(|case| {
            case.troubles.len() > 3 && case.machine.axes.len() > 3 && case.deeds.len() > 5
        });
        let mut case = large.next().unwrap();
        let wanted = Interference::Drive(case.machine.drives() - 1, ToDrive::Reset);
        case.troubles.insert(
            2,
            Trouble {
                at: case.troubles[1].at,
                what: wanted,
            },
        );
        let small = shrink(&case, |case| {
            let is = |it: &Trouble| matches!(it.what, Interference::Drive(_, ToDrive::Reset));
            case.troubles.iter().any(is)
        });
        assert_eq!(small.troubles.len(), 1);
        assert_eq!(small.machine.axes.len(), 1);
        assert_eq!(small.deeds.len() + small.programs.concat().len(), 0);
        assert!(small.machine.machine().is_ok());
    }
}
