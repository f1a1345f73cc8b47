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
        let keep = move || keep(told(&events), &machine, known, &file);
        Ok(Self(thread.spawn(keep)?))
    }

    /// Once the session is over: whether all was written.
    pub(super) fn finish(self) -> Result<(), StateError> {
        // It does not panic.
        self.0.join().unwrap_or(Ok(()))
    }
}

/// What is told until the session is over, and what is told at once together.
fn told(events: &Subscription) -> impl Iterator<Item = Vec<Event>> {
    std::iter::from_fn(|| {
        let first = events.wait(Duration::MAX).ok()?;
        Some(first.into_iter().chain(events.events()).collect())
    })
}

/// Writes what is known with each change of it. Where that fails the next change tries again, and at last the end.
fn keep(
    told: impl Iterator<Item = Vec<Event>>,
    machine: &Machine,
    mut known: MachineState,
    file: &Path,
) -> Result<(), StateError> {
    let mut tried = known.clone();
    let mut written = Ok(());
    for events in told {
        for event in events {
            if let Event::Machine(MachineEvent::Kept { device, kept }) = event {
                known.keep(&machine.drives[device], kept);
            }
        }
        if tried != known {
            written = known.save(file);
            tried = known.clone();
        }
    }
    written.or_else(|_| known.save(file))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Kept;
    use syncline_drives::model::Increments;

    fn told(position: i32) -> Vec<Event> {
        let kept = Some(Kept {
            origin: Increments::ZERO,
            position: Increments::from(position),
            marks: [None; 2],
        });
        vec![Event::Machine(MachineEvent::Kept { device: 0, kept })]
    }

    /// The disk is full, or the folder gone, for a while.
    #[test]
    fn what_could_not_be_written_is_written_later() {
        let machine = Machine::load(Path::new("../examples/portal/machine.toml")).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("later/machine.state.json");
        let there = || std::fs::create_dir(file.parent().unwrap()).unwrap();
        let first = MachineState::default;
        // Until the next change.
        let events = [told(1), told(2)].into_iter().enumerate();
        let events = events.inspect(|(at, _)| {
            if *at == 1 {
                there()
            }
        });
        let kept = keep(events.map(|(_, told)| told), &machine, first(), &file);
        assert!(kept.is_ok(), "{kept:?}");
        let second = MachineState::load(&file).unwrap();
        // Until the end; and never.
        std::fs::remove_dir_all(file.parent().unwrap()).unwrap();
        assert!(keep([told(2)].into_iter(), &machine, first(), &file).is_err());
        let end = std::iter::once(told(2)).chain(std::iter::once_with(|| {
            there();
            Vec::new()
        }));
        assert!(keep(end, &machine, first(), &file).is_ok());
        assert_eq!(MachineState::load(&file).unwrap(), second);
        assert_ne!(second, first());
    }
}
