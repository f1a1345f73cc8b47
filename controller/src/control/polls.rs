//! When a device is asked for what others tell by themselves: its position, and, if it is a drive, its state.
//!
//! One that begins anew may tell nobody, and then counts on from 0 with its power stage off. So its state is asked for
//! besides, at rest too. Its T_PDO may tell of a change while such an answer is on its way: it takes several in a row to
//! be believed against that.
//!
//! Where a bus has room for few requests, both are asked for by turns. A position that is asked for tells nothing of the time
//! up to the next answer: it has stood for as long as answers are apart that say the same.

use super::sdo_sequence::SdoSequence;
use crate::machine::{POLL, STATE_POLL};
use std::mem::take;
use syncline_canopen::Instant;
use syncline_drives::model::Address;

/// So many answers in a row have to contradict the state that was told last.
pub(super) const CONTRADICTIONS: u32 = 2;

/// When a device is asked next, and what it answered.
#[derive(Clone, Debug)]
pub(super) struct Polls {
    /// It is asked.
    on: bool,
    position_due: Instant,
    state_due: Instant,
    /// It was asked for its state last.
    state_asked: bool,
    /// Cycles since its position was known before, and whether it came since.
    unknown: u32,
    located: bool,
    /// Answers in a row that contradict the state that it told last.
    contradictions: u32,
}

impl Polls {
    /// None before they begin.
    pub(super) const NONE: Self = Self {
        on: false,
        position_due: Instant::ZERO,
        state_due: Instant::ZERO,
        state_asked: false,
        unknown: 0,
        located: false,
        contradictions: 0,
    };

    pub(super) fn begin(&mut self) {
        self.on = true;
    }

    /// Asks for the object that is due, if there is nothing else to ask for.
    pub(super) fn ask(
        &mut self,
        now: Instant,
        (position, state): (Address, Option<Address>),
        sequence: &mut SdoSequence,
    ) {
        if !self.on {
            return;
        }
        let position_due = now >= self.position_due;
        // The state first: where a cycle is as long as POLL, a position is due in each. But not twice in a row.
        let state_due = now >= self.state_due && !(self.state_asked && position_due);
        if let Some(state) = state.filter(|_| state_due) {
            if sequence.poll_object(state) {
                self.state_due = now + STATE_POLL;
                self.state_asked = true;
            }
        } else if position_due && sequence.poll_object(position) {
            self.position_due = now + POLL;
            self.state_asked = false;
        }
    }

    /// Its position has come.
    pub(super) fn locate(&mut self) {
        self.located = true;
    }

    /// A cycle passes: how many ago its position was known before, if it came since.
    pub(super) fn pass_cycle(&mut self) -> Option<u32> {
        self.unknown = self.unknown.saturating_add(1);
        take(&mut self.located).then(|| take(&mut self.unknown))
    }

    /// Cycles since its position was known last.
    pub(super) fn unknown(&self) -> u32 {
        self.unknown
    }

    /// Whether an answer is to be believed that contradicts what was told, or does not.
    pub(super) fn believes(&mut self, contradicts: bool) -> bool {
        self.contradictions = match contradicts {
            true => self.contradictions + 1,
            false => 0,
        };
        self.contradictions >= CONTRADICTIONS
    }

    /// It has told its state by itself.
    pub(super) fn told(&mut self) {
        self.contradictions = 0;
    }
}
