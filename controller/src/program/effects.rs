//! What a program does to a machine, looked at before it runs: which axes it homes first, leaves where they are, whether
//! it moves any, or what is misspelt in it.

use super::mistakes::Mistakes;
use super::{Program, ProgramError, Source};
use crate::machine::{COORDINATES, Position};
use syncline_gcode::{self as gcode, Action, AxisLetter, AxisSet, Output, Tables};

/// Commands that are looked at, so that who asks does not wait for long: what more of them do is not known.
const MOST_COMMANDS: usize = 1000;

impl Program {
    /// The axes that need not be referenced where it begins: those that it homes before it moves any; all where it moves
    /// none otherwise, and leaves the same tables wherever it begins. Of one that is read as it runs that is not known.
    #[must_use]
    pub fn homes_first(&self) -> AxisSet {
        if self.stream {
            return AxisSet::NONE;
        }
        let [here, there] = [0.0, 1.0].map(|at| self.homed_from([at; COORDINATES]));
        let (Some((homed, left)), Some((also, leaves))) = (here, there) else {
            return AxisSet::NONE;
        };
        let homed: AxisSet = homed.iter().filter(|axis| also.contains(*axis)).collect();
        match left.is_some() && left == leaves && !homed.is_empty() {
            true => self.setup.axes,
            false => homed,
        }
    }

    /// Which axes it homes before it moves any, and with which tables it ends if it moves none. Where it is begun in its
    /// middle, the way there comes first.
    fn homed_from(&self, start: Position) -> Option<(AxisSet, Option<Tables>)> {
        let (mut interpreter, entry) = self.interpret(start).ok()?;
        let begins_at = entry.map_or(start, |entry| entry.at.0);
        let rests = |axis: &AxisLetter| begins_at[axis.index()] == start[axis.index()];
        let mut homed = AxisSet::NONE;
        for _ in 0..MOST_COMMANDS {
            let Some(Ok(command)) = interpreter.next() else {
                let rests = self.setup.axes.iter().all(|axis| rests(&axis));
                return Some((homed, rests.then(|| interpreter.tables().clone())));
            };
            match command.action {
                Action::Home { axes, to } => {
                    axes.iter()
                        .filter(rests)
                        .for_each(|axis| homed.insert(axis));
                    interpreter.homed(to);
                }
                Action::Rapid { .. }
                | Action::Feed { .. }
                | Action::Arc { .. }
                | Action::Spline { .. }
                | Action::Thread { .. }
                | Action::Tap { .. }
                | Action::Probe { .. }
                | Action::ReadSignals { .. } => return Some((homed, None)),
                _ => {}
            }
        }
        // More of them are not looked at: it may move any.
        Some((homed, None))
    }

    /// Whether it moves no axis of a machine that stands `here`, turns no spindle, and runs no command of the user's, which
    /// may move what nobody here knows of. What cannot be told of it is none: neither what is wrong or awaits the machine, nor
    /// what goes on for long.
    #[must_use]
    pub fn is_still(&self, here: &Position) -> bool {
        let Ok((mut interpreter, _)) = self.interpret(*here) else {
            return false;
        };
        for command in interpreter.by_ref().take(MOST_COMMANDS) {
            let Ok(command) = command else {
                return false;
            };
            let is_still = match command.action {
                Action::Rapid { to } | Action::Feed { to, .. } => to.0 == *here,
                Action::Spindle(spindle) => spindle == spindle.stopped(),
                Action::Output(Output::User { .. })
                // A circle leads to where it begins.
                | Action::Arc { .. }
                | Action::Spline { .. }
                | Action::Thread { .. }
                | Action::Tap { .. }
                | Action::Probe { .. }
                | Action::Home { .. }
                | Action::ReadSignals { .. } => false,
                Action::Dwell { .. }
                | Action::Stop(_)
                | Action::Coolant(_)
                | Action::ToolLoaded(_)
                | Action::SelectTool(_)
                | Action::Output(_)
                | Action::Message(_)
                | Action::AwaitInput(_)
                | Action::TakeInput(_)
                | Action::PathMode(_)
                | Action::End => true,
            };
            if !is_still {
                return false;
            }
        }
        !interpreter.awaits_machine() && interpreter.next().is_none()
    }

    /// What is misspelt in its first commands, of lines that are typed in: it is wrong wherever the machine stands and whatever the
    /// modes are in which they begin. Of lines with parameters, whose values are not known, nothing is said.
    #[must_use]
    pub fn misspelling(&self) -> Option<ProgramError> {
        let is_plain = matches!(&self.source, Source::Lines(text) if !text.contains('#'));
        let (mut interpreter, _) = self
            .interpret([0.0; COORDINATES])
            .ok()
            .filter(|_| is_plain)?;
        for _ in 0..MOST_COMMANDS {
            let Err(error) = interpreter.next()? else {
                continue;
            };
            if error.fault.is_misspelling() {
                let mut mistakes = Mistakes::default();
                mistakes.add(error);
                return Some(ProgramError::Blocks(mistakes));
            }
            if !interpreter.go_on(&error) {
                return None;
            }
        }
        None
    }

    /// Of the axes that are `asked` about those that it leaves where they are, at a machine that stands `here`, and for
    /// which it does the same wherever that is.
    #[must_use]
    pub fn leaves(&self, here: &Position, asked: impl Fn(AxisLetter) -> bool) -> AxisSet {
        let axes = self.setup.axes.iter().filter(|axis| asked(*axis));
        axes.filter(|&axis| self.leaves_axis(axis, here).unwrap_or(false))
            .collect()
    }

    /// Whether it leaves an axis where it is and does the same if that is elsewhere; `None` for what cannot be said of a
    /// program before it runs.
    fn leaves_axis(&self, axis: AxisLetter, here: &Position) -> Option<bool> {
        let mut elsewhere = *here;
        elsewhere[axis.index()] += 1.0;
        let starts = [*here, elsewhere].map(gcode::Point);
        let (mut one, _) = self.interpret(*here).ok()?;
        let (mut other, _) = self.interpret(elsewhere).ok()?;
        for _ in 0..MOST_COMMANDS {
            let actions = match (one.next(), other.next()) {
                (None, None) => {
                    let knows = !one.awaits_machine() && !other.awaits_machine();
                    let leaves = one.tables() == other.tables() && one.memory() == other.memory();
                    return knows.then_some(leaves);
                }
                (Some(it), Some(also)) => [it.ok()?.action, also.ok()?.action],
                _ => return None,
            };
            if let [Action::Home { axes, to }, Action::Home { to: also, .. }] = actions {
                if axes.contains(axis) {
                    return Some(false);
                }
                one.homed(to);
                other.homed(also);
            }
            let mut stays = actions.iter().zip(starts).map(|(action, start)| {
                (action.leads_to()).is_none_or(|to| to[axis] == start[axis])
            });
            let [it, also] = actions.clone().map(|action| action.with_axis_at(axis, 0.0));
            if !stays.all(|stays| stays) || it != also {
                return Some(false);
            }
        }
        None
    }
}
