//! M70 to M73: the modal state is saved and restored, at each level of calls for itself.
//!
//! What is restored is what RS-274/NGC's words set, but for the motion, the tools and the position:
//! these are where the program has come to.

use std::collections::VecDeque;

use super::axes::Point;
use super::command::{Action, CoolantChange};
use super::error::{Fault, Refusal};
use super::execute::State;
use super::lexer::Columns;
use super::modal::{Code, Group, Modes};
use super::words::Words;

/// The modal state as M70 or M73 found it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SavedModes {
    modes: Modes,
    tool_offset: Point,
    g92_applies: bool,
    /// M73: the subroutine's return restores it.
    at_return: bool,
}

impl State {
    /// M70, M71, M72, M73: behind what the block says of feed, spindle and coolant.
    pub(crate) fn save_or_restore(
        &mut self,
        words: &Words,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let Some(code) = words.code(Group::SavedModes) else {
            return Ok(());
        };
        let columns = words.code_columns(Group::SavedModes).unwrap_or_default();
        let level = self.call_level();
        match code {
            Code::M(71) => self.saved[level] = None,
            Code::M(72) => {
                let Some(saved) = self.saved[level].clone() else {
                    return Err(Refusal::new(columns, Fault::NothingSaved));
                };
                self.restore(saved, code, columns, commands)?;
            }
            _ => {
                self.saved[level] = Some(SavedModes {
                    modes: self.modes.clone(),
                    tool_offset: self.tool_offset,
                    g92_applies: self.g92_applies,
                    at_return: code == Code::M(73),
                });
            }
        }
        Ok(())
    }

    /// How many subroutines deep the program is.
    pub(crate) fn call_level(&self) -> usize {
        self.saved.len() - 1
    }

    /// A subroutine or subprogram begins.
    pub(crate) fn enter_call(&mut self) {
        self.saved.push(None);
    }

    /// It has ended, by something at these columns.
    pub(crate) fn leave_call(
        &mut self,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        if self.call_level() == 0 {
            return Ok(());
        }
        match self.saved.pop().flatten() {
            Some(saved) if saved.at_return => self.restore(saved, Code::M(73), columns, commands),
            _ => Ok(()),
        }
    }

    fn restore(
        &mut self,
        saved: SavedModes,
        code: Code,
        columns: Columns,
        commands: &mut VecDeque<Action>,
    ) -> Result<(), Refusal> {
        let now = &self.modes;
        let modes = Modes {
            motion: now.motion,
            selected_tool: now.selected_tool,
            tool: now.tool,
            ..saved.modes
        };
        if let Some(compensation) = modes.compensation {
            // Only a contour that goes on can be the same one.
            let of_contour = |modes: &Modes| {
                let Modes {
                    compensation,
                    plane,
                    work_offset,
                    feed_mode,
                    ..
                } = *modes;
                (compensation, plane, work_offset, feed_mode)
            };
            let goes_on = of_contour(now) == of_contour(&modes)
                && self.tool_offset == saved.tool_offset
                && self.g92_applies == saved.g92_applies;
            if !goes_on {
                let restored = compensation;
                return Err(Refusal::new(
                    columns,
                    Fault::RestoreCompensated { code, restored },
                ));
            }
        } else if now.compensation.is_some() {
            self.end_compensation();
        }
        self.lost.restore();
        self.g92_applies = saved.g92_applies;
        let tool_length = if self.modes.tool == saved.modes.tool {
            self.tool_offset = saved.tool_offset;
            modes.tool_length
        } else {
            // Another tool has another length.
            self.modes.tool_length
        };
        let before = std::mem::replace(
            &mut self.modes,
            Modes {
                tool_length,
                ..modes
            },
        );
        let modes = &self.modes;
        if modes.spindle != before.spindle {
            commands.push_back(Action::Spindle(modes.spindle));
        }
        if modes.coolant != before.coolant {
            let change = CoolantChange::between(before.coolant, modes.coolant);
            commands.push_back(Action::Coolant(change));
        }
        if modes.path_mode != before.path_mode {
            commands.push_back(Action::PathMode(modes.path_mode));
        }
        Ok(())
    }
}
