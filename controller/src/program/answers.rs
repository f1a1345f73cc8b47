//! What a machine has answered a program: of probings, and of inputs and outputs that it read. Whoever reads the program
//! once more, to resume it, is told the same.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use syncline_gcode::Answer;

/// Answers that those who read a program and those who may resume it share.
#[derive(Clone, Debug, Default)]
pub(super) struct Answers(Arc<Mutex<Vec<Answer>>>);

impl Answers {
    pub(super) fn of(answers: Vec<Answer>) -> Self {
        Self(Arc::new(Mutex::new(answers)))
    }

    /// Those so far, the first one first.
    pub(super) fn so_far(&self) -> Vec<Answer> {
        self.lock().clone()
    }

    /// Those behind so many were of a reading that is given up.
    pub(super) fn keep(&self, count: usize) {
        self.lock().truncate(count);
    }

    pub(super) fn push(&self, answer: Answer) {
        self.lock().push(answer);
    }

    fn lock(&self) -> MutexGuard<'_, Vec<Answer>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
