//! Programs' way into the cycle, in a thread of its own: no plan, however long it takes, is in
//! the way of what an operator does and of what the cycle reports.

use super::{RunError, Work};
use crate::control::{Found, Instruction, Outcome, SignalLevels};
use crate::machine::{COORDINATES, Position};
use crate::program::{Feeder, Left, Program, ProgramError};
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
    /// The job with this number begins, and the machine stands there.
    Begin(u64, Position),
    /// This came of the program's probing or homing.
    Found(Found<COORDINATES>),
    /// The program goes on with these inputs and outputs.
    SignalsRead(SignalLevels),
    /// The path has to be planned anew from there.
    Replan(ReplanRequest),
    /// The job with this number is over.
    Over(u64, Outcome),
}

/// The planner's ends of its queues with the cycle.
pub struct PlanQueues {
    /// What the cycle asks for.
    pub requests: Consumer<PlanRequest>,
    /// The plan on its way into the cycle, each instruction with the number of its job.
    pub instructions: Producer<(u64, Instruction<COORDINATES>)>,
}

/// What the planner's thread tells.
#[derive(Debug)]
#[allow(clippy::large_enum_variant)] // one a job
pub enum Told {
    /// A block cannot be run; the machine comes as far as that.
    Block(ProgramError),
    /// The job with this number cannot begin.
    NoBegin(u64, ProgramError),
    /// The job with this number is over, and has left this if it finished.
    Over(u64, Outcome, Option<Left>),
    /// What else went wrong at its end.
    Problem(RunError),
}

/// The jobs that are planned, one after the other.
pub struct Planning {
    work: Sender<Work>,
    told: Receiver<Told>,
    /// Until it is seen to be over.
    thread: Option<JoinHandle<Option<Feeder>>>,
    feeder: Option<Feeder>,
}

/// The thread's side.
struct Planner {
    queues: PlanQueues,
    work: Receiver<Work>,
    tell: Sender<Told>,
}

/// A job that is planned, or was planned last.
struct Planned {
    number: u64,
    program: Program,
    feeder: Feeder,
    over: bool,
}

impl Planning {
    /// A planner that waits for jobs; its thread ends with the cycle that takes the instructions,
    /// and at once where [`Program::abandon`](crate::program::Program::abandon) is called for the job
    /// at work.
    ///
    /// # Errors
    /// There is no thread for it.
    pub fn new(queues: PlanQueues) -> io::Result<Self> {
        let (tell, told) = channel::unbounded();
        let (work, waiting) = channel::unbounded();
        let planner = Planner {
            queues,
            work: waiting,
            tell,
        };
        let thread = thread::Builder::new().name("planner".into());
        let thread = thread.spawn(move || planner.plan())?;
        Ok(Self {
            work,
            told,
            thread: Some(thread),
            feeder: None,
        })
    }

    /// Hands over a job; it waits for its begin.
    pub fn prepare(&self, work: Work) {
        // Where the planner is gone, that is told already.
        let _ = self.work.send(work);
    }

    /// What the planner told next.
    pub fn told(&self) -> Option<Told> {
        self.told.try_recv().ok()
    }

    /// Looks whether the thread is over before the cycle is.
    ///
    /// # Errors
    /// It panicked; told once.
    pub fn check(&mut self) -> Result<(), RunError> {
        match self.thread.take_if(|thread| thread.is_finished()) {
            Some(thread) => self.join(thread),
            None => Ok(()),
        }
    }

    /// Waits for the thread, which ends with the cycle; the last job as it was left, if it began.
    ///
    /// # Errors
    /// As [`check`](Self::check).
    pub fn end(mut self) -> Result<Option<Feeder>, RunError> {
        if let Some(thread) = self.thread.take() {
            self.join(thread)?;
        }
        Ok(self.feeder)
    }

    fn join(&mut self, thread: JoinHandle<Option<Feeder>>) -> Result<(), RunError> {
        self.feeder = thread.join().map_err(|_| RunError::Planner)?;
        Ok(())
    }
}

impl Planner {
    /// Keeps the cycle's queue full until the cycle is gone; the last job as it was left.
    fn plan(mut self) -> Option<Feeder> {
        let mut planned: Option<Planned> = None;
        loop {
            // Looked for first: what the cycle asked before it went is still there.
            let gone = self.queues.instructions.is_abandoned();
            let mut latest = None;
            while let Ok(request) = self.queues.requests.pop() {
                match request {
                    PlanRequest::Begin(number, start) => {
                        latest = None;
                        planned = self.begin(number, start);
                    }
                    PlanRequest::Found(found) => {
                        latest = None;
                        if let Some(planned) = &mut planned {
                            planned.feeder.found(&found);
                        }
                    }
                    PlanRequest::SignalsRead(levels) => {
                        if let Some(planned) = &mut planned {
                            planned.feeder.signals_read(&levels);
                        }
                    }
                    // Where one came while another was answered, that is out of date.
                    PlanRequest::Replan(request) => latest = Some(request),
                    PlanRequest::Over(number, outcome) => {
                        latest = None;
                        self.finish(number, outcome, planned.as_mut());
                    }
                }
            }
            if gone {
                return planned.map(|planned| planned.feeder);
            }
            let working = planned.as_mut().filter(|planned| !planned.over);
            if !working.is_some_and(|planned| self.feed(planned, latest)) {
                thread::sleep(POLL);
            }
        }
    }

    /// The job with this number, from where the machine stands.
    fn begin(&self, number: u64, start: Position) -> Option<Planned> {
        let work = self.work.try_iter().find(|work| work.number == number)?;
        let Work {
            program, upcoming, ..
        } = work;
        let feeder = (program.check(start)).and_then(|_| program.feeder(start, upcoming));
        match feeder {
            Ok(feeder) => Some(Planned {
                number,
                program,
                feeder,
                over: false,
            }),
            // It is over already, and nobody wants to know why it could not begin.
            Err(_) if program.is_abandoned() => None,
            Err(error) => {
                self.tell(Told::NoBegin(number, error));
                None
            }
        }
    }

    /// Ends a job.
    fn finish(&self, number: u64, outcome: Outcome, planned: Option<&mut Planned>) {
        let planned = planned.filter(|planned| planned.number == number);
        let mut left = None;
        if let Some(planned) = planned {
            planned.over = true;
            if outcome == Outcome::Finished {
                let (leaves, kept) = planned.feeder.finish();
                left = Some(leaves);
                if let Err(error) = kept {
                    self.tell(Told::Problem(error.into()));
                }
            }
        }
        self.tell(Told::Over(number, outcome, left));
    }

    /// Plans on; false if there is nothing to do for now.
    fn feed(&mut self, planned: &mut Planned, request: Option<ReplanRequest>) -> bool {
        let Planned {
            number,
            program,
            feeder,
            ..
        } = planned;
        if let Some(request) = request {
            feeder.replan(&request);
        }
        if self.queues.instructions.is_full() {
            return false;
        }
        match feeder.next_instruction() {
            Ok(Some(instruction)) => {
                let given = self.queues.instructions.push((*number, instruction));
                debug_assert!(given.is_ok(), "there is room");
                true
            }
            Ok(None) => false,
            // As where it could not begin.
            Err(_) if program.is_abandoned() => false,
            Err(error) => {
                self.tell(Told::Block(error));
                true
            }
        }
    }

    fn tell(&self, told: Told) {
        // Nobody listening any more is fine.
        let _ = self.tell.send(told);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;
    use crate::program::Moves;
    use rtrb::RingBuffer;
    use std::path::Path;

    type Taken = Consumer<(u64, Instruction<COORDINATES>)>;

    /// A program on the portal that is being planned, and the cycle's end of it.
    fn planning(file: &Path) -> (Program, Planning, Taken) {
        let portal = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/portal/machine.toml");
        let machine = Machine::load(&portal).unwrap();
        let program = Program::new(file, &machine, &portal).unwrap().stream(true);
        let (instructions, taken) = RingBuffer::new(4);
        let (mut ask, requests) = RingBuffer::new(1);
        let queues = PlanQueues {
            requests,
            instructions,
        };
        let planning = Planning::new(queues).unwrap();
        planning.prepare(Work {
            number: 3,
            program: program.clone(),
            upcoming: Moves::new().0,
        });
        ask.push(PlanRequest::Begin(3, [0.0; COORDINATES])).unwrap();
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
        let (_, mut planning, taken) = planning(Path::new("/nowhere/p.ngc"));
        let told = planning.told.recv().unwrap();
        assert!(
            matches!(told, Told::NoBegin(3, ProgramError::Block(_))),
            "{told:?}"
        );
        assert!(planning.told().is_none());
        assert!(planning.check().is_ok());
        drop(taken);
        assert!(planning.end().unwrap().is_none());
    }
}
