//! The machine as an operator has it: the one thing that a console, an events file, a panel or a
//! test talks to, in real and in virtual time.
//!
//! ```text
//!  operators: keys, signals,  ──Command──►  Session  ──Order──►  cycle  ◄──plan──  planner
//!  events file, panel, test                    │   ◄──CycleReport──┘ └──PlanRequest──►┘
//!                                              ├──► Event, to every subscriber
//!                                              ├──► Status, the latest, to whoever looks
//!                                              └──► observers, row by row
//! ```
//!
//! - [`Command`]: what an operator asks for; any number of sources, each with a name
//! - [`Settings`]: what operators have set, here and nowhere else
//! - [`Event`], [`Status`]: what happens and how things are, to any number of subscribers
//! - `job`: the program that runs: where on its moves the setpoint is
//!
//! Whoever calls [`Session::advance`] lends the session its thread, and nothing in there waits: not
//! for a subscriber, not for an operator, not for the planner of a machine in real time. So a
//! command that came is on its way into the cycle with the next call. Every command that took effect
//! is told with its source and its cycle ([`Accepted`]): with the same machine and program, the same
//! commands in the same cycles make the same run.

mod channel;
mod command;
mod job;
mod settings;
mod status;

pub use channel::{Accepted, Event, NotTaken, Operator, Subscription};
pub use command::{Command, Direction, Jog};
pub use settings::{LEAST, MOST_FEED, MOST_RAPID, Override, Settings, StepChange, SwitchChange};
pub use status::{Status, StatusView};

use crate::control::{self, Row};
use crate::machine::{COORDINATES, Machine};
use crate::observe::{Observed, Observers};
use crate::program::Moves;
use crate::run::{CycleReport, Progress, RunError, Timeline};
use channel::{Inlet, Issued, Outlets};
use job::Job;
use std::collections::VecDeque;
use std::sync::Arc;

/// A machine, its job, its operators and all who watch, on a [`Timeline`].
pub struct Session<T> {
    timeline: T,
    inlet: Inlet,
    desk: Desk,
}

/// The session's side of what the cycle reports.
struct Desk {
    settings: Settings,
    /// Commands that have not taken effect, the oldest first, and whether each is for the session
    /// alone.
    waiting: VecDeque<(Issued, bool)>,
    /// The number of the first of them.
    first: u64,
    /// The cycle in which the last one took effect.
    cycle: u64,
    outlets: Outlets,
    status: Status,
    view: StatusView,
    job: Job,
    observers: Observers,
    /// Coordinates that have an axis.
    coordinates: Vec<usize>,
}

impl<T: Timeline> Session<T> {
    /// A session with one job: the program on the timeline, whose moves come up in `moves`.
    #[must_use]
    pub fn new(machine: &Machine, timeline: T, moves: Moves, observers: Observers) -> Self {
        let status = Status::default();
        Self {
            timeline,
            inlet: Inlet::default(),
            desk: Desk {
                settings: status.settings,
                waiting: VecDeque::new(),
                first: 0,
                cycle: 0,
                outlets: Outlets::default(),
                view: StatusView::new(status),
                status,
                job: Job::new(moves),
                observers,
                coordinates: (machine.axes.iter())
                    .map(|axis| axis.letter.index())
                    .collect(),
            },
        }
    }

    /// Somebody who commands the machine; the name is for the log.
    #[must_use]
    pub fn operator(&self, name: &str) -> Operator {
        self.inlet.operator(name)
    }

    /// Somebody who is told every event from now on.
    pub fn subscribe(&mut self) -> Subscription {
        self.desk.outlets.subscribe()
    }

    /// How things are, for anybody in any thread to look at.
    #[must_use]
    pub fn view(&self) -> StatusView {
        self.desk.view.clone()
    }

    /// How things are.
    #[must_use]
    pub fn status(&self) -> &Status {
        &self.desk.status
    }

    /// Goes on: hands over what operators command and takes what the cycle reports. In virtual time
    /// this is one wake-up of the cycle; in real time it waits for nothing.
    pub fn advance(&mut self) -> Progress {
        let Self {
            timeline,
            inlet,
            desk,
        } = self;
        for issued in inlet.commands() {
            let order = desk.settings.order(issued.command);
            let number = desk.keep(issued, order.is_none());
            if let Some(order) = order {
                timeline.order(number, order);
            }
        }
        desk.accept_own();
        let progress = timeline.advance(&mut |report| desk.take(report));
        desk.status.settings = desk.settings;
        desk.view.show(&desk.status);
        progress.unwrap_or_else(|error| {
            desk.problem(error);
            Progress::More
        })
    }

    /// The machine on its timeline, for tests to interfere with.
    pub fn timeline(&mut self) -> &mut T {
        &mut self.timeline
    }

    /// Ends the session: the timeline, and what was observed.
    #[must_use]
    pub fn end(self) -> (T, Observers) {
        (self.timeline, self.desk.observers)
    }
}

impl Desk {
    /// Keeps a command until it takes effect; its number.
    fn keep(&mut self, issued: Issued, own: bool) -> u64 {
        self.waiting.push_back((issued, own));
        self.first + self.waiting.len() as u64 - 1
    }

    /// What is for the session alone takes effect in its turn, behind what was ordered before it.
    fn accept_own(&mut self) {
        while self.waiting.front().is_some_and(|(_, own)| *own)
            && let Some((issued, _)) = self.waiting.pop_front()
        {
            self.first += 1;
            self.accept(issued);
        }
    }

    /// Tells that a command has taken effect.
    fn accept(&mut self, issued: Issued) {
        self.outlets.tell(&Event::Accepted(Accepted {
            cycle: self.cycle,
            source: issued.source.to_string(),
            command: issued.command,
        }));
    }

    fn problem(&mut self, error: RunError) {
        self.outlets.tell(&Event::Problem(Arc::new(error)));
    }

    fn take(&mut self, report: CycleReport) {
        match report {
            CycleReport::Obeyed { number, cycle } => {
                self.cycle = cycle;
                while self.first <= number
                    && let Some((issued, _)) = self.waiting.pop_front()
                {
                    self.first += 1;
                    self.accept(issued);
                }
                self.accept_own();
            }
            CycleReport::Event(event) => {
                if let control::Event::Phase(phase) = event {
                    self.status.phase = phase;
                }
                self.status.waits = event.rests().unwrap_or(self.status.waits);
                self.outlets.tell(&Event::Machine(event));
            }
            CycleReport::Row(row) => self.follow(&row),
            CycleReport::BusFailed(error) => self.problem(RunError::Port(error)),
        }
    }

    /// Takes what happened at one SYNC of the program.
    fn follow(&mut self, row: &Row<COORDINATES>) {
        self.job.follow(row);
        let mut actual = row.plan.position;
        for &at in &self.coordinates {
            actual[at] = row.axes[at].act;
        }
        let time = self.observers.observe(&Observed {
            row,
            actual,
            line: self.job.line,
            moves: &self.job.moves,
            tags: self.job.tags.as_ref(),
        });
        self.status = Status {
            time: Some(time),
            line: self.job.line,
            setpoint: row.plan.position,
            actual,
            velocity: row.plan.velocity,
            passed: self.observers.passed(),
            off_path: row.plan.off_path,
            ..self.status
        };
    }
}
