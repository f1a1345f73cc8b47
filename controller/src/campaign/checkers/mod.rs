//! What must hold of every case, from what buses carried, what is true of the drives, and what the
//! session told: nothing of the controller's insides, and no number of its own.
//!
//! A [`Checkers`] takes everything that is [`Seen`] of a case, keeps the [`Scene`], and shows it to each
//! checker. What a checker finds is a [`Violation`], the first one of each kind of it.
//!
//! - `setpoints`: within limits and soft limits, ever, as drives are sent them
//! - `carriage`: drives are sent beyond their axis by what its transmission is off, and no further
//! - `motion`: nothing moves that is not enabled and commanded; sides of a gantry stay together
//! - `stops`: at rest in time after every cause, and no motion until a person acted
//! - `transitions`: what may follow what, of states, NMT commands and controlwords
//! - `alarms`: every fault told once, in time, with the right subject; none where nothing is wrong
//! - `reactions`: what is done about each fault, in time, and which is told first
//! - `answers`: every command is accepted or refused in time
//! - `velocities`: drives that are sent velocities turn where they are told to, and no faster than there is reason for
//! - `outputs`: switched in the program's order and at their place, safe after every stop
//! - `faulted`: what a fault has stopped is without power, and its outputs are safe at their terminals
//! - `encoders`: those beside an axis are listened to
//! - `bus`: SYNC on time, all setpoints or none, no bus fuller than full
//! - `ending`: virtual time goes on, the machine goes off, and the observers agree
//!
//! They share `scene`, what is known of a case so far, and `script`, what its programs make of outputs.

mod alarms;
mod answers;
mod bus;
mod carriage;
mod encoders;
mod ending;
mod faulted;
mod motion;
mod outputs;
mod reactions;
mod scene;
mod script;
mod setpoints;
mod stops;
mod transitions;
mod velocities;

pub use scene::{DriveScene, Scene};
pub use stops::{StopTime, StopTimes};

use super::case::Case;
use super::interference::Interference;
use super::stage::{Played, Seen};
use crate::machine::Machine;
use crate::session::{Command, Event};
use serde::Serialize;
use std::fmt;

/// Something that must not be.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Violation {
    /// Which checker found it.
    pub checker: &'static str,
    /// What it found, in words that stay the same whatever the numbers.
    pub what: &'static str,
    /// When, s of virtual time.
    pub at: f64,
    /// Whom it concerns, and the numbers.
    pub detail: String,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            checker,
            what,
            at,
            detail,
        } = self;
        write!(f, "{checker}: {what} at {at:.6} s: {detail}")
    }
}

/// What was found.
#[derive(Debug, Default)]
pub struct Found(pub Vec<Violation>);

impl Found {
    /// Keeps the first violation of each kind.
    fn violate(
        &mut self,
        checker: &'static str,
        scene: &Scene<'_>,
        what: &'static str,
        detail: impl FnOnce() -> String,
    ) {
        let known = |it: &Violation| (it.checker, it.what) == (checker, what);
        if !self.0.iter().any(known) {
            self.0.push(Violation {
                checker,
                what,
                at: scene.seconds(),
                detail: detail(),
            });
        }
    }
}

/// One checker. It is shown what happens with the scene as it is then.
trait Checker {
    /// A SYNC has come on a bus: what its drives latched is in the scene.
    fn sync(&mut self, _scene: &Scene<'_>, _bus: usize, _found: &mut Found) {}

    /// A frame of a bus.
    fn frame(
        &mut self,
        _scene: &Scene<'_>,
        _bus: usize,
        _sent: &syncline_drives::bus::Transmission,
        _found: &mut Found,
    ) {
    }

    /// Something happened from outside.
    fn interfered(&mut self, _scene: &Scene<'_>, _what: &Interference, _found: &mut Found) {}

    /// An operator commands something.
    fn commanded(&mut self, _scene: &Scene<'_>, _command: &Command, _found: &mut Found) {}

    /// The session told something.
    fn told(&mut self, _scene: &Scene<'_>, _event: &Event, _found: &mut Found) {}

    /// A wake-up is over.
    fn woken(&mut self, _scene: &Scene<'_>, _found: &mut Found) {}

    /// The case is over.
    fn ended(&mut self, _scene: &Scene<'_>, _played: &Played, _found: &mut Found) {}
}

/// All checkers of a case.
pub struct Checkers<'a> {
    scene: Scene<'a>,
    setpoints: setpoints::Setpoints,
    carriage: carriage::Carriage,
    motion: motion::Motion,
    stops: stops::Stops,
    transitions: transitions::Transitions,
    alarms: alarms::Alarms,
    reactions: reactions::Reactions,
    answers: answers::Answers,
    outputs: outputs::Outputs,
    faulted: faulted::Faulted,
    bus: bus::Bus,
    encoders: encoders::Encoders,
    velocities: velocities::Velocities,
    ending: ending::Ending,
    /// What they found.
    pub found: Found,
}

impl<'a> Checkers<'a> {
    /// For a case with its machine.
    #[must_use]
    pub fn new(case: &'a Case, machine: &'a Machine) -> Self {
        let scene = Scene::new(case, machine);
        Self {
            setpoints: setpoints::Setpoints::new(machine),
            carriage: carriage::Carriage::new(machine),
            motion: motion::Motion::new(machine),
            stops: stops::Stops::new(&scene),
            transitions: transitions::Transitions::default(),
            alarms: alarms::Alarms::default(),
            reactions: reactions::Reactions::new(machine),
            answers: answers::Answers::default(),
            outputs: outputs::Outputs::new(&scene),
            faulted: faulted::Faulted::default(),
            bus: bus::Bus::new(machine),
            encoders: encoders::Encoders::new(&scene),
            velocities: velocities::Velocities::new(machine),
            ending: ending::Ending::default(),
            found: Found::default(),
            scene,
        }
    }

    /// Takes what is seen.
    pub fn see(&mut self, seen: &Seen) {
        match seen {
            Seen::Frame { bus, sent } => {
                let is_sync = self.scene.frame(*bus, sent);
                self.each(|checker, scene, found| checker.frame(scene, *bus, sent, found));
                if is_sync {
                    self.each(|checker, scene, found| checker.sync(scene, *bus, found));
                }
            }
            Seen::Interfered(what) => {
                self.scene.interfered(what);
                self.each(|checker, scene, found| checker.interfered(scene, what, found));
            }
            Seen::Commanded(command) => {
                self.each(|checker, scene, found| checker.commanded(scene, command, found));
            }
            Seen::Told(event) => {
                self.scene.told(event);
                self.each(|checker, scene, found| checker.told(scene, event, found));
            }
            Seen::Woken(woken) => {
                self.scene.woken(woken);
                self.each(|checker, scene, found| checker.woken(scene, found));
            }
        }
    }

    /// The case is over.
    pub fn end(&mut self, played: &Played) {
        self.each(|checker, scene, found| checker.ended(scene, played, found));
    }

    /// How long stops took.
    #[must_use]
    pub fn stop_times(&self) -> &StopTimes {
        &self.stops.times
    }

    /// How things are.
    #[must_use]
    pub fn scene(&self) -> &Scene<'a> {
        &self.scene
    }

    fn each(&mut self, mut show: impl FnMut(&mut dyn Checker, &Scene<'_>, &mut Found)) {
        let all: [&mut dyn Checker; 14] = [
            &mut self.setpoints,
            &mut self.carriage,
            &mut self.motion,
            &mut self.stops,
            &mut self.transitions,
            &mut self.alarms,
            &mut self.reactions,
            &mut self.answers,
            &mut self.outputs,
            &mut self.faulted,
            &mut self.bus,
            &mut self.encoders,
            &mut self.velocities,
            &mut self.ending,
        ];
        for checker in all {
            show(checker, &self.scene, &mut self.found);
        }
    }
}
