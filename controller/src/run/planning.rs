//! A program's way into the cycle, in a thread of its own: no plan, however long it takes, is in
//! the way of what an operator does and of what the cycle reports.

use super::RunError;
use crate::control::Instruction;
use crate::machine::{COORDINATES, Position};
use crate::program::{Feeder, Program, ProgramError, Upcoming};
use crossbeam::channel::{self, Receiver, Sender};
use rtrb::{Consumer, Producer};
use std::io;
use std::thread::{self, JoinHandle};
use std::time::Duration;
use syncline_trajectory::path::ReplanRequest;

/// How often the planner looks for requests, and for room in the cycle, where there is none.
const POLL: Duration = Duration::from_millis(1);

/// What the cycle asks the planner for. It comes straight from there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PlanRequest {
    /// The machine stands there, ready for the program; it begins once.
    Begin(Position),
    /// The path has to be planned anew from there.
    Replan(ReplanRequest),
}

/// The planner's ends of its queues with the cycle.
pub struct PlanQueues {
    /// What the cycle asks for.
    pub requests: Consumer<PlanRequest>,
    /// The plan on its way into the cycle.
    pub instructions: Producer<Instruction<COORDINATES>>,
}

/// A program that is being planned.
pub struct Planning {
    errors: Receiver<ProgramError>,
    /// Until it is seen to be over.
    thread: Option<JoinHandle<Planned>>,
    feeder: Option<Feeder>,
}

/// The program as it was left, if it began.
type Planned = Result<Option<Feeder>, ProgramError>;

/// The thread's side.
struct Planner {
    queues: PlanQueues,
    errors: Sender<ProgramError>,
}

impl Planning {
    /// A program that waits for its start; its thread ends with the cycle that takes the
    /// instructions, and at once where [`Program::abandon`] is called.
    ///
    /// # Errors
    /// There is no thread for it.
    pub fn new(program: Program, upcoming: Upcoming, queues: PlanQueues) -> io::Result<Self> {
        let (told, errors) = channel::unbounded();
        let mut planner = Planner {
            queues,
            errors: told,
        };
        let thread = thread::Builder::new().name("planner".into());
        let thread = thread.spawn(move || {
            let Some(start) = planner.start() else {
                return Ok(None);
            };
            program.check(start)?;
            let feeder = program.feeder(start, upcoming)?;
            Ok(Some(planner.feed(feeder)))
        })?;
        Ok(Self {
            errors,
            thread: Some(thread),
            feeder: None,
        })
    }

    /// A block that cannot be run; the machine comes as far as that.
    pub fn error(&self) -> Option<ProgramError> {
        self.errors.try_recv().ok()
    }

    /// Looks whether the thread is over before the cycle is.
    ///
    /// # Errors
    /// Nothing more comes of the program; told once.
    pub fn check(&mut self) -> Result<(), RunError> {
        match self.thread.take_if(|thread| thread.is_finished()) {
            Some(thread) => self.join(thread),
            None => Ok(()),
        }
    }

    /// Waits for the thread, which ends with the cycle; the program as it was left, if it began.
    ///
    /// # Errors
    /// As [`check`](Self::check).
    pub fn end(mut self) -> Result<Option<Feeder>, RunError> {
        if let Some(thread) = self.thread.take() {
            self.join(thread)?;
        }
        Ok(self.feeder)
    }

    fn join(&mut self, thread: JoinHandle<Planned>) -> Result<(), RunError> {
        self.feeder = thread.join().map_err(|_| RunError::Planner)??;
        Ok(())
    }
}

impl Planner {
    /// Waits for where the program begins; `None` if the cycle ends before.
    fn start(&mut self) -> Option<Position> {
        loop {
            // Looked for first: what the cycle asked before it went is still there.
            let gone = self.queues.instructions.is_abandoned();
            match self.queues.requests.pop() {
                Ok(PlanRequest::Begin(start)) => return Some(start),
                Ok(PlanRequest::Replan(_)) => {}
                Err(_) if gone => return None,
                Err(_) => thread::sleep(POLL),
            }
        }
    }

    /// Keeps the cycle's queue full until the cycle is gone.
    fn feed(mut self, mut feeder: Feeder) -> Feeder {
        while !self.queues.instructions.is_abandoned() {
            let mut latest = None;
            // Where one came while another was answered, that is out of date.
            while let Ok(request) = self.queues.requests.pop() {
                if let PlanRequest::Replan(request) = request {
                    latest = Some(request);
                }
            }
            if let Some(request) = latest {
                feeder.replan(&request);
            }
            let next = if self.queues.instructions.is_full() {
                Ok(None)
            } else {
                feeder.next_instruction()
            };
            match next {
                Ok(Some(instruction)) => {
                    let given = self.queues.instructions.push(instruction);
                    debug_assert!(given.is_ok(), "there is room");
                }
                Ok(None) => thread::sleep(POLL),
                Err(error) => {
                    // Nobody listening any more is fine.
                    let _ = self.errors.send(error);
                }
            }
        }
        feeder
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;
    use crate::program::Moves;
    use rtrb::RingBuffer;
    use std::path::Path;

    /// A program on the portal that is being planned, and the cycle's end of it.
    fn planning(file: &Path) -> (Program, Planning, Consumer<Instruction<COORDINATES>>) {
        let portal = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/portal/machine.toml");
        let machine = Machine::load(&portal).unwrap();
        let program = Program::new(file, &machine, &portal).unwrap().stream(true);
        let (instructions, taken) = RingBuffer::new(4);
        let (mut ask, requests) = RingBuffer::new(1);
        let queues = PlanQueues {
            requests,
            instructions,
        };
        let planning = Planning::new(program.clone(), Moves::new().0, queues).unwrap();
        ask.push(PlanRequest::Begin([0.0; COORDINATES])).unwrap();
        (program, planning, taken)
    }

    #[test]
    fn a_program_that_is_abandoned_ends() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("p.ngc");
        for endless in ["M3 S100\nM99\n", "G91 G0 X1\nX-1\nM99\n"] {
            std::fs::write(&file, endless).unwrap();
            let (program, mut planning, taken) = planning(&file);
            assert!(planning.check().is_ok());
            drop(taken);
            program.abandon();
            assert!(planning.end().unwrap().is_some(), "{endless}");
        }
    }

    #[test]
    fn a_program_that_cannot_begin_is_told_once() {
        let (_, mut planning, _taken) = planning(Path::new("/nowhere/p.ngc"));
        while !planning.thread.as_ref().unwrap().is_finished() {
            std::thread::yield_now();
        }
        let Err(RunError::Program(_)) = planning.check() else {
            panic!("there is no such file");
        };
        assert!(planning.check().is_ok());
        assert!(planning.end().unwrap().is_none());
    }
}
