//! Every command is accepted or refused, and soon.

use super::{Checker, Found, Scene};
use crate::session::{Command, Event};
use std::collections::VecDeque;

const NAME: &str = "answers";

/// Wake-ups until an answer.
const SOON: u32 = 6;

/// Commands that are not answered, and for how many wake-ups.
#[derive(Default)]
pub(super) struct Answers(VecDeque<(Command, u32)>);

impl Answers {
    fn answered(&mut self, command: &Command) {
        if let Some(place) = self.0.iter().position(|(of, _)| of == command) {
            self.0.remove(place);
        }
    }
}

impl Checker for Answers {
    fn commanded(&mut self, _: &Scene<'_>, command: &Command, _: &mut Found) {
        // Of several stops at once one is obeyed for all.
        let is_stop = |(of, since): &(Command, u32)| *of == Command::Stop && *since == 0;
        if *command != Command::Stop || !self.0.iter().any(is_stop) {
            self.0.push_back((command.clone(), 0));
        }
    }

    fn told(&mut self, scene: &Scene<'_>, event: &Event, found: &mut Found) {
        match event {
            Event::Accepted(it) => {
                self.answered(&it.command);
                if scene.state == crate::control::State::Off && scene.cycle > 0 {
                    found.violate(NAME, scene, "accepted by a machine that is off", || {
                        format!("{:?}", it.command)
                    });
                }
            }
            Event::Refused(it) => self.answered(&it.command),
            _ => {}
        }
    }

    fn woken(&mut self, scene: &Scene<'_>, found: &mut Found) {
        for (command, since) in &mut self.0 {
            *since += 1;
            if *since == SOON {
                found.violate(NAME, scene, "a command is not answered", || {
                    format!("{command:?}, machine {}", scene.state)
                });
            }
        }
    }
}
