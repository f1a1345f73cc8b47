//! The machine in its time: real, virtual, or that of a recorded run.
//!
//! - `cutting`: the force of the tool upon simulated drives
//! - [`driver`]: a controller on its buses
//! - [`virtual_time`]: as fast as the CPU allows, deterministic
//! - [`real_time`]: on the host's clock
//! - `ends`: what it tells of jobs that are over, in order
//! - [`planning`]: the program on its way there, in a thread of its own
//! - `inline_planning`: the same where the cycle's time is not the host's
//! - [`replay`]: a recorded run once more
//!
//! A [`Timeline`] is a machine with its program in either time, as a session drives it.

mod cutting;
pub mod driver;
mod ends;
mod inline_planning;
pub mod planning;
pub mod real_time;
pub mod replay;
pub mod virtual_time;

use crate::control::{Controller, Event, MachineFunctions, Order, Outcome, Refusal, Row};
use crate::machine::COORDINATES;
use crate::observe::flight_recorder::{Carried, NotRecorded};
use crate::port::PortError;
use crate::program::{Left, Program, ProgramError, Upcoming};
use std::collections::VecDeque;
use syncline_drives::twin::Observation;
use syncline_gcode::TablesError;

/// What the cycle reports.
#[derive(Debug)]
#[allow(clippy::large_enum_variant)] // a ring's slots are all of one size
pub enum CycleReport {
    /// An order took effect, and so did those before it of which no report came.
    Obeyed {
        /// The order's number.
        number: u64,
        /// The controller's cycle.
        cycle: u64,
        /// What the job at work has switched, or begins with.
        functions: MachineFunctions,
    },
    /// Something worth a line in the log.
    Event(Event),
    /// What happened at one SYNC of the program.
    Row(Row<COORDINATES>),
    /// A job is over, and this is what it has left if it finished.
    JobOver {
        /// Its number.
        job: u64,
        /// How it ended.
        outcome: Outcome,
        /// What goes on with the next one.
        left: Option<Left>,
    },
    /// An order was refused, and nothing changed; those before it took effect.
    Refused {
        /// The order's number.
        number: u64,
        /// The controller's cycle.
        cycle: u64,
        /// Why.
        refusal: Refusal,
    },
    /// A bus' interface failed.
    BusFailed(PortError),
}

/// What there is to do on a timeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// It goes on at once.
    More,
    /// Nothing, for about a millisecond.
    Idle,
    /// The machine is at its end, and all has been reported.
    Ended,
}

/// Why a run cannot go on as it was meant to. The machine comes to its end all the same.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A bus failed.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The program cannot be run from where the machine stands, or a block of it cannot.
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// What a program changed in the tables could not be written.
    #[error(transparent)]
    Tables(#[from] TablesError),
    /// The last seconds before a fault could not be written.
    #[error(transparent)]
    Recorder(#[from] NotRecorded),
    /// The planner's thread panicked; the panic's own message stands above.
    #[error("the planner failed: this is a defect of syncline, please report it with the program")]
    Planner,
}

/// A job on its way to the planner.
pub struct Work {
    /// The job's number.
    pub number: u64,
    /// What is planned once it begins.
    pub program: Program,
    /// Where its moves come up.
    pub upcoming: Upcoming,
}

/// A machine, in real or in virtual time.
pub trait Timeline {
    /// Hands the planner a job; it begins where [`Order::Begin`] with its number takes effect.
    fn prepare(&mut self, work: Work);

    /// Orders something. No order gets lost; each takes effect in the next cycle, in turn, and is
    /// reported by the number that it is given here.
    fn order(&mut self, number: u64, order: Order);

    /// Goes on by what there is to do, without waiting, and reports what happened.
    ///
    /// # Errors
    /// Something cannot go on; the machine comes to its end when this is called further.
    fn advance(&mut self, report: &mut dyn FnMut(CycleReport)) -> Result<Progress, RunError>;

    /// The next of the frames that the controller has received and sent, where its buses can be tapped.
    fn carried(&mut self) -> Option<Carried> {
        None
    }

    /// What is true of the drive with this index, if it is simulated here.
    fn observe_drive(&self, _drive: usize) -> Option<Observation> {
        None
    }
}

/// Has a controller obey an order, and says what became of that.
fn obey(controller: &mut Controller<COORDINATES>, number: u64, order: Order) -> CycleReport {
    let cycle = controller.cycle();
    match controller.obey(order) {
        Ok(()) => CycleReport::Obeyed {
            number,
            cycle,
            functions: controller.functions(),
        },
        Err(refusal) => CycleReport::Refused {
            number,
            cycle,
            refusal,
        },
    }
}

/// Orders on their way into a cycle whose time is not the host's.
#[derive(Debug, Default)]
struct Orders(VecDeque<(u64, Order)>);

impl Orders {
    fn push(&mut self, number: u64, order: Order) {
        self.0.push_back((number, order));
    }

    /// Has the controller obey them, in turn, and reports what became of each.
    fn obey(
        &mut self,
        controller: &mut Controller<COORDINATES>,
        report: &mut dyn FnMut(CycleReport),
    ) {
        for (number, order) in self.0.drain(..) {
            report(obey(controller, number, order));
        }
    }
}
