//! What is wrong with a drive now, and what it still has to tell.

use crate::twin::device::ErrorClass;
use std::collections::VecDeque;
use syncline_canopen::emcy::Emergency;

/// EMCYs that may wait for the bus; more are dropped.
const EMCY_CAPACITY: usize = 32;

/// An error as the drives of a maker tell it.
pub trait ServoError: Copy {
    /// The DC bus lost its voltage with the power stage on.
    const UNDERVOLTAGE: Self;

    /// Braking brought more into the DC bus than its resistor takes.
    const OVERVOLTAGE: Self;

    /// One of a class, whichever.
    fn of(class: ErrorClass) -> Self;

    /// How the drive reacts to it.
    fn class(&self) -> ErrorClass;

    /// The EMCY that tells it.
    fn emergency(&self) -> Emergency;
}

/// The errors of a drive.
#[derive(Clone, Debug)]
pub struct Errors<E> {
    active: Option<E>,
    untold: VecDeque<Emergency>,
}

impl<E: ServoError> Errors<E> {
    pub(super) fn new() -> Self {
        Self {
            active: None,
            untold: VecDeque::with_capacity(EMCY_CAPACITY),
        }
    }

    /// The error that stopped the drive, until it is reset.
    #[must_use]
    pub fn active(&self) -> Option<E> {
        self.active
    }

    /// Its class.
    #[must_use]
    pub fn active_class(&self) -> Option<ErrorClass> {
        self.active.map(|error| error.class())
    }

    /// 1001h: bit 0 while the drive has an error.
    #[must_use]
    pub fn register(&self) -> u8 {
        self.active.map_or(0, |error| error.emergency().register)
    }

    /// An error stops the drive, and is told.
    pub fn begin(&mut self, error: E) {
        self.active = Some(error);
        self.tell(error);
    }

    /// The error is reset, which is told by an EMCY too if it is to be `told`.
    pub fn reset(&mut self, told: bool) {
        self.active = None;
        if told {
            self.send(Emergency::default());
        }
    }

    /// An error is told, whatever becomes of the drive.
    pub fn tell(&mut self, error: E) {
        self.send(error.emergency());
    }

    fn send(&mut self, emergency: Emergency) {
        if self.untold.len() < EMCY_CAPACITY {
            self.untold.push_back(emergency);
        }
    }

    /// The next EMCY to be sent.
    pub fn next_emergency(&mut self) -> Option<Emergency> {
        self.untold.pop_front()
    }
}
