//! Keeps the machine's state file: what encoders that count without power will still mean tomorrow.

use crate::control::Event as MachineEvent;
use crate::machine::{Machine, MachineState, StateError};
use crate::run::Timeline;
use crate::session::{Event, Session, Subscription};
use std::io;
use std::path::{Path, PathBuf};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Writes the state file in a thread of its own, so that no disk is in the way of an operator.
pub(super) struct StateKeeper(JoinHandle<Result<(), StateError>>);

impl StateKeeper {
    /// Keeps what the session of a machine tells from now on, beginning with what is known already.
    pub(super) fn start<T: Timeline>(
        session: &mut Session<T>,
        machine: &Machine,
        known: MachineState,
        file: PathBuf,
    ) -> io::Result<Self> {
        let (events, machine) = (session.subscribe(), machine.clone());
        let thread = thread::Builder::new().name("state".into());
        let keep = move || keep(&events, &machine, known, &file);
        Ok(Self(thread.spawn(keep)?))
    }

    /// Once the session is over: whether all was written.
    pub(super) fn finish(self) -> Result<(), StateError> {
        // It does not panic.
        self.0.join().unwrap_or(Ok(()))
    }
}

fn keep(
    events: &Subscription,
    machine: &Machine,
    mut known: MachineState,
    file: &Path,
) -> Result<(), StateError> {
    let mut written = known.clone();
    while let Ok(event) = events.wait(Duration::MAX) {
        // What was told at once is written at once.
        for event in event.into_iter().chain(events.events()) {
            if let Event::Machine(MachineEvent::Kept { device, kept }) = event {
                known.keep(&machine.drives[device], kept);
            }
        }
        if written != known {
            known.save(file)?;
            written = known.clone();
        }
    }
    Ok(())
}
