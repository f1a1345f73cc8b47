//! A program's way into the cycle, in a thread of its own: no plan, however long it takes, is in
//! the way of what a person does and of what the cycle tells.

use crate::control::Instruction;
use crate::machine::{COORDINATES, Position};
use crate::program::{Feeder, Program, ProgramError, Upcoming};
use crossbeam::channel::{self, Receiver, RecvTimeoutError, Sender};
use rtrb::Producer;
use std::io;
use std::thread::JoinHandle;
use std::time::Duration;
use syncline_trajectory::path::ReplanRequest;

/// How often it is looked for room in the cycle.
const POLL: Duration = Duration::from_millis(1);

/// A program that is being planned.
pub struct Planning {
    start: Sender<Position>,
    replan_requests: Sender<ReplanRequest>,
    errors: Receiver<ProgramError>,
    /// Until it is seen to be over.
    thread: Option<JoinHandle<Planned>>,
    feeder: Option<Feeder>,
}

/// The program as it was left, if it began.
type Planned = Result<Option<Feeder>, ProgramError>;

/// Why nothing more comes of a program.
#[derive(Debug, thiserror::Error)]
pub enum PlanningError {
    /// The program cannot be run from where the machine stands.
    #[error(transparent)]
    Program(#[from] ProgramError),
    /// The thread panicked; the panic's own message stands above.
    #[error("the planner failed: this is a defect of syncline, please report it with the program")]
    Panic,
}

/// The thread's side.
struct Planner {
    replan_requests: Receiver<ReplanRequest>,
    errors: Sender<ProgramError>,
    instructions: Producer<Instruction<COORDINATES>>,
}

impl Planning {
    /// A program that waits for its start; its thread ends with the cycle that takes the
    /// instructions, and at once where [`Program::abandon`] is called.
    ///
    /// # Errors
    /// There is no thread for it.
    pub fn new(
        program: Program,
        upcoming: Upcoming,
        instructions: Producer<Instruction<COORDINATES>>,
    ) -> io::Result<Self> {
        let (start, starts) = channel::bounded(1);
        let (replan_requests, seen) = channel::unbounded();
        let (told, errors) = channel::unbounded();
        let planner = Planner {
            replan_requests: seen,
            errors: told,
            instructions,
        };
        let thread = std::thread::Builder::new().name("planner".into());
        let thread = thread.spawn(move || {
            let Ok(start) = starts.recv() else {
                return Ok(None);
            };
            program.check(start)?;
            let feeder = program.feeder(start, upcoming)?;
            Ok(Some(planner.feed(feeder)))
        })?;
        Ok(Self {
            start,
            replan_requests,
            errors,
            thread: Some(thread),
            feeder: None,
        })
    }

    /// The machine stands there, ready for the program; it starts once.
    pub fn begin(&self, start: Position) {
        // A thread that is over is seen by its end.
        let _ = self.start.try_send(start);
    }

    /// The path has to be planned anew from there.
    pub fn replan(&self, request: ReplanRequest) {
        let _ = self.replan_requests.send(request);
    }

    /// A block that cannot be run; the machine comes as far as that.
    pub fn error(&self) -> Option<ProgramError> {
        self.errors.try_recv().ok()
    }

    /// Looks whether the thread is over before the cycle is.
    ///
    /// # Errors
    /// Nothing more comes of the program; told once.
    pub fn check(&mut self) -> Result<(), PlanningError> {
        match self.thread.take_if(|thread| thread.is_finished()) {
            Some(thread) => self.join(thread),
            None => Ok(()),
        }
    }

    /// Waits for the thread, which ends with the cycle; the program as it was left, if it began.
    ///
    /// # Errors
    /// As [`check`](Self::check).
    pub fn end(mut self) -> Result<Option<Feeder>, PlanningError> {
        if let Some(thread) = self.thread.take() {
            self.join(thread)?;
        }
        Ok(self.feeder)
    }

    fn join(&mut self, thread: JoinHandle<Planned>) -> Result<(), PlanningError> {
        self.feeder = thread.join().map_err(|_| PlanningError::Panic)??;
        Ok(())
    }
}

impl Planner {
    /// Keeps the cycle's queue full until the cycle is gone.
    fn feed(mut self, mut feeder: Feeder) -> Feeder {
        while !self.instructions.is_abandoned() {
            // Where one came while another was answered, that is out of date.
            if let Some(request) = self.replan_requests.try_iter().last() {
                feeder.replan(&request);
            }
            let next = if self.instructions.is_full() {
                Ok(None)
            } else {
                feeder.next_instruction()
            };
            match next {
                Ok(Some(instruction)) => {
                    let given = self.instructions.push(instruction);
                    debug_assert!(given.is_ok(), "there is room");
                }
                Ok(None) => match self.replan_requests.recv_timeout(POLL) {
                    Ok(request) => feeder.replan(&request),
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => break,
                },
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
    fn planning(file: &Path) -> (Program, Planning, rtrb::Consumer<Instruction<COORDINATES>>) {
        let portal = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/portal/machine.toml");
        let machine = Machine::load(&portal).unwrap();
        let program = Program::new(file, &machine, &portal).unwrap().stream(true);
        let (instructions, taken) = RingBuffer::new(4);
        let planning = Planning::new(program.clone(), Moves::new().0, instructions).unwrap();
        planning.begin([0.0; COORDINATES]);
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
        let Err(PlanningError::Program(_)) = planning.check() else {
            panic!("there is no such file");
        };
        assert!(planning.check().is_ok());
        assert!(planning.end().unwrap().is_none());
    }
}
