//! A recorded run fed back through the controller: does it send, bit for bit, what it sent?
//!
//! A run is a machine that was switched on, for one program or for a day: jobs one after the other, jogs,
//! faults that were reset.
//!
//! What the controller sends is a function of its machine and program, of its own clock, and of
//! which frames had come in by each of its wake-ups. A log of the buses from before the run began
//! holds all of that:
//!
//! - **the clock**: the stamps of SYNC, or of heartbeats where there is none, give the cycles, the least
//!   delayed of them their phase, and the controller's first heartbeat gives the first one. A SYNC left out
//!   is a cycle lost.
//! - **what had come in**: frames whose end lies before the wake-up for the setpoints. Where the
//!   stamp alone cannot tell, as a real wake-up is some µs late, what the controller sent then does.
//! - **bursts that never left** are missing from the log; the controller is told that they were
//!   dropped.
//! - **operators**: what they commanded is handed in as in any session, which here is driven by the
//!   recorded run ([`Replay`] is a [`Timeline`]). Where nothing of them was recorded, how many cycles
//!   the machine rested behind a pause shows in the setpoints, and whether the run was interrupted in
//!   the first ones that leave the plan; what else they did cannot be told from frames.
//! - **the planner**: how many cycles the machine rested before a job shows in the setpoints, and all else that was
//!   planned is taken to have come in time: where all buses were simulated, in the cycle that asked for it.
//!
//! What an adapter reported of its bus, and a plan that came late, is in no frame: behind that a replay
//! differs.
//!
//! - `log`: whose frames are in the log, and what its stamps say of the controller's clock
//! - `arrivals`: what had come in by each wake-up
//! - `recording`: the log with its jobs, whose plans are fed in each wake-up
//! - `by_trial`: what operators did where nobody recorded it
//! - `state`: where a replay is; a copy of it is a trial
//!
//! Stamps are ends of frame, rounded up to a microsecond as [`candump`](crate::bus_log::candump)
//! does; cycle and setpoint offset are whole microseconds, so that nothing is lost by that.

mod arrivals;
mod by_trial;
mod log;
mod recording;
mod state;

use super::inline_planning::InlinePlanning;
use super::{CycleReport, Orders, Progress, RunError, Timeline, Work};
use crate::control::fault::BusIndex;
use crate::control::{End, Layout, Order, Phase, Wake};
use crate::program::{Moves, Program, ProgramError};
use log::Log;
use recording::{Recording, Step, Tape};
use state::State;
use std::collections::VecDeque;
use std::sync::Arc;
use syncline_canopen::{Frame, Instant};

/// Cycles after which a frame that the controller sent is missing from the log.
const PATIENCE: u32 = 3;
/// Cycles between two states to which the search for an interruption goes back.
const CHECKPOINT: u64 = 32;

/// A frame of a log, its stamp by the log's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Logged {
    /// End of frame.
    pub at: Instant,
    /// The machine's bus.
    pub bus: BusIndex,
    /// The frame.
    pub frame: Frame,
}

/// What a bus of the machine is to a replay.
#[derive(Clone, Copy, Debug)]
pub struct ReplayBus {
    /// bit/s
    pub bitrate: u32,
    /// The controller was told when its frames had left.
    pub echoes: bool,
    /// It was simulated, and its time went with the cycle.
    pub simulated: bool,
}

/// What is known of the operators of a recorded run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Operators {
    /// All that they commanded: it is handed in.
    Recorded,
    /// Nothing: they ended pauses and interrupted the run where the frames show it.
    Unknown,
}

/// Log and controller disagree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Difference {
    /// By the log's clock.
    pub at: Instant,
    /// The bus.
    pub bus: BusIndex,
    /// Cycles since the controller began.
    pub cycle: u64,
    /// What the controller was at.
    pub phase: Phase,
    /// What the log has there.
    pub logged: Option<Frame>,
    /// What the controller sends instead.
    pub sent: Option<Frame>,
}

/// What a replay found.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// The first difference.
    pub difference: Option<Difference>,
    /// Frames of the controller that are the same.
    pub same: u64,
    /// Cycles replayed.
    pub cycles: u64,
    /// How the run ended; `None` if the log ends before it does.
    pub end: Option<End>,
    /// Bursts that the controller sent and that never came to the bus.
    pub dropped: u64,
    /// The cycle in which the run was interrupted.
    pub interrupted: Option<u64>,
}

/// Why a log cannot be replayed.
#[derive(Debug, thiserror::Error)]
pub enum NoReplay {
    /// The controller has sent nothing in it.
    #[error(
        "the log has no SYNC and no heartbeat of the controller on the machine's buses: no run is in it"
    )]
    NoRun,
    /// Its beginning is missing.
    #[error(
        "the log begins in the middle of a run: it must have been recorded from before the \
         controller's first heartbeat on"
    )]
    NoBeginning,
}

/// A recorded run, as a machine that goes through it once more.
#[derive(Debug)]
pub struct Replay {
    recording: Recording,
    state: State,
    /// Where the search for an interruption begins, the newest first.
    checkpoints: VecDeque<State>,
    orders: Orders,
    interrupted: Option<u64>,
    difference: Option<Difference>,
    over: bool,
}

impl Replay {
    /// A log, in the order of its stamps, of a machine that was switched on for one program, and where
    /// the program's moves come up.
    ///
    /// # Errors
    /// The log holds no run, or not its beginning.
    pub fn new(
        layout: Arc<Layout>,
        buses: Vec<ReplayBus>,
        operators: Operators,
        program: Program,
        log: Vec<Logged>,
    ) -> Result<(Self, Moves), NoReplay> {
        let (upcoming, moves) = Moves::new();
        let mut replay = Self::of(layout, buses, operators, log)?;
        replay.state.controller.works_on(program.only_job());
        replay.prepare(Work {
            number: 0,
            program,
            upcoming,
        });
        Ok((replay, moves))
    }

    /// The same of a machine that stayed on, and whose jobs came one by one; all that its operators
    /// commanded is known.
    ///
    /// # Errors
    /// The log does not begin where the machine was switched on.
    pub fn staying_on(
        layout: Arc<Layout>,
        buses: Vec<ReplayBus>,
        log: Vec<Logged>,
    ) -> Result<Self, NoReplay> {
        let mut replay = Self::of(layout, buses, Operators::Recorded, log)?;
        replay.state.controller.stay_on();
        Ok(replay)
    }

    fn of(
        layout: Arc<Layout>,
        buses: Vec<ReplayBus>,
        operators: Operators,
        frames: Vec<Logged>,
    ) -> Result<Self, NoReplay> {
        let log = Log::new(layout, buses, frames);
        Ok(Self {
            state: State::new(log.first_wake()?, &log.layout),
            recording: Recording {
                log,
                operators,
                planning: InlinePlanning::default(),
                tape: Tape::default(),
            },
            checkpoints: VecDeque::new(),
            orders: Orders::default(),
            interrupted: None,
            difference: None,
            over: false,
        })
    }

    /// The cycle whose setpoints are next, if they are: what is ordered now takes effect with them.
    #[must_use]
    pub fn setpoints_of(&self) -> Option<u64> {
        let controller = &self.state.controller;
        let next = controller.next_wake();
        matches!(next, Some(Wake::Setpoint(_))).then(|| controller.cycle())
    }

    /// What was found so far.
    #[must_use]
    pub fn outcome(&self) -> Outcome {
        let State {
            controller,
            same,
            cycle,
            dropped,
            ..
        } = &self.state;
        Outcome {
            difference: self.difference,
            same: *same,
            cycles: *cycle,
            end: (controller.phase() == Phase::Done)
                .then(|| controller.end())
                .flatten(),
            dropped: *dropped,
            interrupted: self.interrupted,
        }
    }

    /// Goes on to the next wake-up; false once there is none, or the run differs from the log.
    fn step(&mut self) -> Result<bool, ProgramError> {
        let Self {
            recording, state, ..
        } = self;
        let unknown = recording.operators == Operators::Unknown;
        let begins = !matches!(state.controller.next_wake(), Some(Wake::Setpoint(_)));
        if unknown && begins && state.cycle.is_multiple_of(CHECKPOINT) {
            self.checkpoints.truncate(1);
            self.checkpoints.push_front(state.clone());
            let oldest = &self.checkpoints[self.checkpoints.len() - 1];
            recording.tape.forget(oldest.instruction);
        }
        if !unknown {
            recording.tape.forget(state.instruction);
        }
        let difference = match recording.wake(state)? {
            Step::GoesOn => return Ok(true),
            Step::Ended => return Ok(false),
            Step::Differs(difference) => difference,
        };
        if unknown
            && self.interrupted.is_none()
            && let Some((cycle, with)) =
                recording.interruption(&self.checkpoints, self.state.cycle)?
        {
            self.interrupted = Some(cycle);
            self.state = with;
            return Ok(true);
        }
        self.difference = Some(difference);
        Ok(false)
    }
}

impl Timeline for Replay {
    fn prepare(&mut self, work: Work) {
        self.recording.planning.prepare(work);
    }

    fn order(&mut self, number: u64, order: Order) {
        self.orders.push(number, order);
    }

    /// One wake-up.
    fn advance(&mut self, report: &mut dyn FnMut(CycleReport)) -> Result<Progress, RunError> {
        if self.over {
            return Ok(Progress::Ended);
        }
        if self.setpoints_of().is_some() {
            self.orders.obey(&mut self.state.controller, report);
        }
        let stepped = self.step();
        self.over = matches!(stepped, Ok(false));
        self.state.hear();
        for event in self.state.told.drain(..) {
            report(CycleReport::Event(event));
        }
        if let Some(row) = self.state.controller.row() {
            report(CycleReport::Row(*row));
        }
        let planning = &mut self.recording.planning;
        planning.report_over(&self.state.controller, report)?;
        stepped?;
        Ok(if self.over {
            Progress::Ended
        } else {
            Progress::More
        })
    }
}
