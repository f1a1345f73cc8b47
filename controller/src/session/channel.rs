//! Who commands the machine, and who is told what happens: bounded queues that nobody waits at.

use super::{Command, Refusal};
use crate::control::{self, State};
use crate::observe::flight_recorder::FaultFiles;
use crate::run::RunError;
use crossbeam::channel::{self, Receiver, RecvTimeoutError, Sender, TryIter, TrySendError};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Commands that wait for the session at most.
const COMMANDS: usize = 256;
/// Stops that wait for the session at most: all of them are obeyed by the first.
const STOPS: usize = 1;
/// Likewise switching off, where there is no room beside other commands.
const SWITCH_OFFS: usize = 1;
/// Events that wait for a subscriber at most.
const EVENTS: usize = 4096;

/// A source of commands.
#[derive(Clone, Debug)]
pub struct Operator {
    name: Arc<str>,
    lanes: Lanes,
}

/// The ways to the session. A stop has one of its own, so that no crowd of other commands keeps it
/// out, and it goes first. What it overtakes is known by the order in which all were given. Switching off has a place behind
/// all others.
#[derive(Clone, Debug)]
struct Lanes {
    stops: Sender<Issued>,
    commands: Sender<Given>,
    switch_offs: Sender<Issued>,
    /// How many commands were given.
    count: Arc<AtomicU64>,
    /// Which of them was the last stop.
    last_stop: Arc<AtomicU64>,
}

/// A command on its way.
#[derive(Clone, Debug)]
pub(super) struct Issued {
    pub(super) source: Arc<str>,
    pub(super) command: Command,
}

/// A command with its number among all that were given.
#[derive(Clone, Debug)]
struct Given {
    number: u64,
    issued: Issued,
}

/// What became of a command that is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    /// It waits, and will be told as accepted or refused with the name of its source.
    Queued,
    /// One of the same kind waits, which does for both and is told once, with the name of whoever gave it.
    Merged,
}

/// Why a command is not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotTaken {
    /// Too many others wait; later there is room.
    #[error("too many commands at once")]
    Busy,
    /// The session is over.
    #[error("the session is over")]
    Over,
}

impl Operator {
    /// Commands something; commands take effect in the order in which they are taken, but for
    /// [`Command::Stop`], which overtakes what waits. What it overtakes and would set something going is refused. Neither that
    /// nor [`Command::SwitchOff`] is ever refused for want of room.
    ///
    /// # Errors
    /// It is not taken.
    pub fn command(&self, command: Command) -> Result<Taken, NotTaken> {
        let stops = command == Command::Stop;
        let issued = Issued {
            source: Arc::clone(&self.name),
            command,
        };
        let lanes = &self.lanes;
        let number = lanes.count.fetch_add(1, Ordering::SeqCst) + 1;
        if stops {
            lanes.last_stop.fetch_max(number, Ordering::SeqCst);
            return queued_or_merged(&lanes.stops, issued);
        }
        match lanes.commands.try_send(Given { number, issued }) {
            Ok(()) => Ok(Taken::Queued),
            Err(TrySendError::Disconnected(_)) => Err(NotTaken::Over),
            Err(TrySendError::Full(given)) if given.issued.command == Command::SwitchOff => {
                queued_or_merged(&lanes.switch_offs, given.issued)
            }
            Err(TrySendError::Full(_)) => Err(NotTaken::Busy),
        }
    }
}

/// Gives a command to a lane where the one that waits is as good.
fn queued_or_merged(lane: &Sender<Issued>, issued: Issued) -> Result<Taken, NotTaken> {
    match lane.try_send(issued) {
        Ok(()) => Ok(Taken::Queued),
        Err(TrySendError::Full(_)) => Ok(Taken::Merged),
        Err(TrySendError::Disconnected(_)) => Err(NotTaken::Over),
    }
}

/// The session's end of its operators.
pub(super) struct Inlet {
    stops: Receiver<Issued>,
    commands: Receiver<Given>,
    switch_offs: Receiver<Issued>,
    given: Lanes,
}

impl Default for Inlet {
    fn default() -> Self {
        let (first, stops) = channel::bounded(STOPS);
        let (others, commands) = channel::bounded(COMMANDS);
        let (last, switch_offs) = channel::bounded(SWITCH_OFFS);
        let given = Lanes {
            stops: first,
            commands: others,
            switch_offs: last,
            count: Arc::default(),
            last_stop: Arc::default(),
        };
        Self {
            stops,
            commands,
            switch_offs,
            given,
        }
    }
}

impl Inlet {
    /// A source with this name.
    pub(super) fn operator(&self, name: &str) -> Operator {
        Operator {
            name: name.into(),
            lanes: self.given.clone(),
        }
    }

    /// What has come, a stop first; and why what a stop has overtaken is not to be done. `pending` commands were taken before and
    /// are not in effect yet: so many fewer are taken now.
    pub(super) fn commands(
        &self,
        pending: usize,
    ) -> impl Iterator<Item = (Issued, Result<(), Refusal>)> {
        let stops = self.stops.try_iter().map(|issued| (issued, Ok(())));
        // Whoever goes on giving commands keeps nobody from what is behind them.
        let room = COMMANDS.saturating_sub(pending);
        let others = self.commands.try_iter().take(room);
        let others = others.map(|Given { number, issued }| {
            let overtaken = number < self.given.last_stop.load(Ordering::SeqCst);
            match overtaken && issued.command.sets_going() {
                true => (issued, Err(Refusal::Stopped)),
                false => (issued, Ok(())),
            }
        });
        // Behind all others, once these are taken.
        let switch_offs = std::iter::from_fn(|| {
            let is_next = self.commands.is_empty();
            is_next.then(|| self.switch_offs.try_recv().ok()).flatten()
        });
        let switch_offs = switch_offs.map(|issued| (issued, Ok(())));
        stops.chain(others).chain(switch_offs)
    }
}

/// A command that took effect; in the order of a session's log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Accepted {
    /// In this cycle of the controller's, counted from its beginning.
    pub cycle: u64,
    /// Whose it was.
    pub source: String,
    /// What it was.
    pub command: Command,
}

/// A command that was refused, and changed nothing.
#[derive(Clone, Debug, PartialEq)]
pub struct Refused {
    /// Whose it was.
    pub source: String,
    /// What it was.
    pub command: Command,
    /// Why, and what to do.
    pub reason: Refusal,
}

/// Something that happened.
#[derive(Clone, Debug)]
pub enum Event {
    /// The controller tells it.
    Machine(control::Event),
    /// A command took effect.
    Accepted(Accepted),
    /// A command was refused.
    Refused(Refused),
    /// The machine is in this state now.
    State(State),
    /// The program tells its operator something, at its place on the path.
    Message {
        /// The program's line.
        line: u32,
        /// What.
        text: String,
    },
    /// What led to a fault is written.
    Recorded(FaultFiles),
    /// A bus failed, or the program cannot go on.
    Problem(Arc<RunError>),
}

impl Event {
    /// Whether it says what became of a command of that source: that it took effect, or was refused.
    #[must_use]
    pub fn answers(&self, source: &str) -> bool {
        match self {
            Self::Accepted(it) => it.source == source,
            Self::Refused(it) => it.source == source,
            _ => false,
        }
    }
}

/// The session's end of its subscribers. What is told is delivered once the status shows what it has led to.
#[derive(Default)]
pub(super) struct Outlets {
    all: Vec<Outlet>,
    told: Vec<Event>,
}

struct Outlet {
    events: Sender<Event>,
    missed: Arc<AtomicU64>,
}

/// Somebody's events, in their order.
#[derive(Debug)]
pub struct Subscription {
    events: Receiver<Event>,
    missed: Arc<AtomicU64>,
}

impl Outlets {
    pub(super) fn subscribe(&mut self) -> Subscription {
        let (tell, events) = channel::bounded(EVENTS);
        let missed = Arc::new(AtomicU64::new(0));
        self.all.push(Outlet {
            events: tell,
            missed: Arc::clone(&missed),
        });
        Subscription { events, missed }
    }

    /// Tells everybody, with the next delivery.
    pub(super) fn tell(&mut self, event: Event) {
        self.told.push(event);
    }

    /// Delivers what was told. Who does not listen misses it, and it is counted.
    pub(super) fn deliver(&mut self) {
        for event in self.told.drain(..) {
            self.all.retain(|outlet| {
                let told = outlet.events.try_send(event.clone());
                if let Err(TrySendError::Full(_)) = told {
                    outlet.missed.fetch_add(1, Ordering::Relaxed);
                }
                !matches!(told, Err(TrySendError::Disconnected(_)))
            });
        }
    }
}

impl Subscription {
    /// The events that have come.
    pub fn events(&self) -> TryIter<'_, Event> {
        self.events.try_iter()
    }

    /// The next event, waited for; `Ok(None)` where none comes in time.
    ///
    /// # Errors
    /// The session is over and all its events are fetched.
    pub fn wait(&self, at_most: Duration) -> Result<Option<Event>, NotTaken> {
        match self.events.recv_timeout(at_most) {
            Ok(event) => Ok(Some(event)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(NotTaken::Over),
        }
    }

    /// Events that found no room, as they were not fetched.
    #[must_use]
    pub fn missed(&self) -> u64 {
        self.missed.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Whoever counts what is queued is answered as often, however many stop and switch off at once.
        #[test]
        fn each_source_is_answered_as_often_as_it_counts(
            given in prop::collection::vec((0_usize..3, 0..4_u8), 0..600),
        ) {
            let inlet = Inlet::default();
            let names = ["lines", "signals", "keys"];
            let operators = names.map(|name| inlet.operator(name));
            let mut unanswered = [0_usize; 3];
            let hear = |unanswered: &mut [usize; 3]| {
                for (issued, _) in inlet.commands(0) {
                    let source = names.iter().position(|name| **name == *issued.source).unwrap();
                    unanswered[source] -= 1;
                }
            };
            for (source, what) in given {
                let command = match what {
                    0 => Command::Stop,
                    1 => Command::SwitchOff,
                    2 => Command::Retrace,
                    _ => Command::FeedHold,
                };
                if operators[source].command(command) == Ok(Taken::Queued) {
                    unanswered[source] += 1;
                }
                if what == 3 && source == 2 && unanswered[2] > 90 {
                    hear(&mut unanswered);
                }
            }
            hear(&mut unanswered);
            prop_assert_eq!(unanswered, [0; 3]);
        }
    }

    #[test]
    fn events_come_once_the_status_shows_them() {
        let mut outlets = Outlets::default();
        let listener = outlets.subscribe();
        outlets.tell(Event::State(State::Ready));
        assert_eq!(listener.events().count(), 0);
        outlets.deliver();
        outlets.deliver();
        assert_eq!(listener.events().count(), 1);
    }

    #[test]
    fn no_crowd_of_commands_keeps_a_stop_or_switching_off_out() {
        let inlet = Inlet::default();
        let [crowd, person] = ["crowd", "person"].map(|name| inlet.operator(name));
        while crowd.command(Command::Retrace).is_ok() {}
        assert_eq!(crowd.command(Command::FeedHold), Err(NotTaken::Busy));
        // Those that wait do for all, and are told once.
        for (command, waiting) in [(Command::Stop, STOPS), (Command::SwitchOff, SWITCH_OFFS)] {
            for count in 0..2 * waiting {
                let taken = match count < waiting {
                    true => Taken::Queued,
                    false => Taken::Merged,
                };
                assert_eq!(person.command(command.clone()), Ok(taken));
            }
        }
        let mut taken = inlet.commands(0);
        let (first, _) = taken.next().unwrap();
        assert_eq!((&*first.source, first.command), ("person", Command::Stop));
        let others: Vec<_> = taken.map(|(issued, _)| issued.command).collect();
        assert_eq!(others.len(), COMMANDS + SWITCH_OFFS);
        assert_eq!(others.last(), Some(&Command::SwitchOff));
        drop(inlet);
        assert_eq!(person.command(Command::Stop), Err(NotTaken::Over));
    }

    /// With those that are not in effect yet no more wait than there is room for; a stop is taken all the same, and switching off
    /// comes behind all that were given before it.
    #[test]
    fn what_is_not_in_effect_yet_takes_room() {
        let inlet = Inlet::default();
        let person = inlet.operator("person");
        for _ in 0..COMMANDS {
            assert_eq!(person.command(Command::FeedHold), Ok(Taken::Queued));
        }
        assert_eq!(person.command(Command::SwitchOff), Ok(Taken::Queued));
        assert_eq!(person.command(Command::Stop), Ok(Taken::Queued));
        let taken = |pending: usize| {
            let taken = inlet.commands(pending).map(|(issued, _)| issued.command);
            taken.collect::<Vec<_>>()
        };
        assert_eq!(taken(COMMANDS), [Command::Stop]);
        assert_eq!(taken(COMMANDS - 56), vec![Command::FeedHold; 56]);
        let rest = taken(0);
        assert_eq!(rest.len(), COMMANDS - 56 + 1);
        assert_eq!(rest.last(), Some(&Command::SwitchOff));
    }
}
