//! What is in effect in the blocks of a compensated contour.
//!
//! A block of one is handed out once those behind it are read, and these may have changed modes and offsets. So both are kept of
//! each block until it is over.

use std::collections::VecDeque;

use super::command::{Command, Span};
use super::coordinates::WorkCoordinates;
use super::execute::State;
use super::modal::Modes;

/// What is in effect in one block.
#[derive(Debug)]
pub(crate) struct InBlock {
    span: Span,
    pub(crate) modes: Modes,
    pub(crate) coordinates: WorkCoordinates,
}

impl InBlock {
    /// Of the block that was executed last.
    pub(crate) fn new(span: Span, state: &State) -> Self {
        Self {
            span,
            modes: state.modes.clone(),
            coordinates: state.coordinates(),
        }
    }
}

/// The blocks that are not handed out to their ends.
#[derive(Debug, Default)]
pub(crate) struct ReadAhead {
    blocks: VecDeque<InBlock>,
    /// Which of these was handed out last.
    at_work: usize,
}

impl ReadAhead {
    pub(crate) fn push(&mut self, block: InBlock) {
        self.blocks.push_back(block);
    }

    /// The block that was handed out last, if it is one of a compensated contour.
    pub(crate) fn at_work(&self) -> Option<&InBlock> {
        self.blocks.get(self.at_work)
    }

    /// A command is handed out. Corners belong to the move before them, and come behind what stands between two moves: only with
    /// the next move a block is over. Of a block that is not compensated nothing is kept.
    pub(crate) fn come_to(&mut self, command: &Command) {
        let place = self.blocks.iter().position(|it| it.span == command.span);
        let over = match place {
            Some(place) if command.action.destination().is_some() => place,
            Some(_) => 0,
            None => self.blocks.len(),
        };
        self.blocks.drain(..over);
        self.at_work = place.map_or(0, |place| place - over);
    }

    /// Nothing of it will be handed out.
    pub(crate) fn clear(&mut self) {
        *self = Self::default();
    }
}
