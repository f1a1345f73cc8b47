//! A recorded run fed back through the controller: does it send, bit for bit, what it sent?
//!
//! What the controller sends is a function of its machine and program, of its own clock, and of
//! which frames had come in by each of its wake-ups. A log of the buses from before the run began
//! holds all of that:
//!
//! - **the clock**: the stamps of SYNC give the cycles, the least delayed of them their phase, and
//!   the controller's first heartbeat gives the first one. A SYNC left out is a cycle lost.
//! - **what had come in**: frames whose end lies before the wake-up for the setpoints. Where the
//!   stamp alone cannot tell, as a real wake-up is some µs late, what the controller sent then does.
//! - **bursts that never left** are missing from the log; the controller is told that they were
//!   dropped.
//! - **operators**: what they commanded is handed in as in any session, which here is driven by the
//!   recorded run ([`Replay`] is a [`Timeline`]). Where nothing of them was recorded, how many cycles
//!   the machine rested behind a pause shows in the setpoints, and whether the run was interrupted in
//!   the first ones that leave the plan; what else they did cannot be told from frames.
//! - **the planner**: where all buses were simulated the cycle waited for it. On the host's clock how many
//!   cycles the machine rested before its program shows in the setpoints, and what is planned anew is
//!   taken to have come in time.
//!
//! Stamps are ends of frame, rounded up to a microsecond as [`candump`](crate::bus_log::candump)
//! does; cycle and setpoint offset are whole microseconds, so that nothing is lost by that.

use super::{CycleReport, Progress, RunError, Timeline, Work};
use crate::bus::{Burst, Outbox, Received};
use crate::control::fault::BusIndex;
use crate::control::{Controller, End, Event, Instruction, Layout, Order, Phase, Wake};
use crate::machine::{COORDINATES, Position};
use crate::program::{Feeder, Moves, Program, ProgramError};
use std::collections::{BTreeMap, VecDeque};
use std::mem::take;
use std::sync::Arc;
use std::time::Duration;
use syncline_canopen::response_time::bit_time;
use syncline_canopen::{CanId, CobId, Frame, Instant};
use syncline_drives::bus::frame_bits;

/// A frame cannot be told from its stamp to have come before or after a wake-up that it precedes
/// by less.
const UNCERTAIN: Duration = Duration::from_micros(200);
/// Cycles after which a frame that the controller sent is missing from the log.
const PATIENCE: u32 = 3;
/// Cycles between two states to which the search for an interruption goes back.
const CHECKPOINT: u64 = 32;
/// Cycles from an interruption until it shows, at most.
const LATENCY: u64 = 24;

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
    /// There is no SYNC in it.
    #[error("the log has no SYNC on the machine's buses: no run is in it")]
    NoSync,
    /// Its beginning is missing.
    #[error(
        "the log begins in the middle of a run: it must have been recorded from before the \
         controller's first heartbeat on"
    )]
    NoBeginning,
}

/// Priority band of a frame of the controller's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Band {
    Sync,
    Burst,
    Acyclic,
}

/// A recorded run, as a machine that goes through it once more.
#[derive(Debug)]
pub struct Replay {
    recording: Recording,
    state: State,
    /// Where the search for an interruption begins, the newest first.
    checkpoints: VecDeque<State>,
    /// What became of orders and is not reported.
    answers: VecDeque<CycleReport>,
    interrupted: Option<u64>,
    difference: Option<Difference>,
    over: bool,
}

/// A log with the machine and the program that it is of.
struct Recording {
    layout: Arc<Layout>,
    buses: Vec<ReplayBus>,
    operators: Operators,
    /// Jobs that have not begun.
    work: VecDeque<Work>,
    log: Vec<Logged>,
    start: Instant,
    tape: Option<Tape>,
}

impl std::fmt::Debug for Recording {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Recording")
            .field("frames", &self.log.len())
            .finish_non_exhaustive()
    }
}

/// What the program feeds to the cycle, kept for as long as a trial may want it again.
struct Tape {
    feeder: Feeder,
    kept: VecDeque<Instruction<COORDINATES>>,
    /// Place of the first that is kept.
    first: usize,
}

/// What the machine waits for and no frame tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Waits {
    /// For nothing: the plan is kept full.
    No,
    /// That many cycles until the plan comes.
    ForPlan(u64),
    /// That many cycles until an operator goes on.
    ForOperator(u64),
}

/// Everything that changes in a replay; a copy of it is a trial.
#[derive(Clone, Debug)]
struct State {
    controller: Controller<COORDINATES>,
    /// The first frame of the log that has not been taken.
    next: usize,
    /// By bus and band: sent, and not met in the log yet.
    sent: Vec<[VecDeque<(Instant, Frame)>; 3]>,
    outboxes: Vec<Outbox>,
    /// The last setpoints, of all buses.
    burst: Vec<Frame>,
    /// The first instruction that has not been taken.
    instruction: usize,
    began: bool,
    waits: Waits,
    /// Told in the last cycle that the program pauses.
    paused: bool,
    /// A trial; the plan is never replaced in one.
    trial: bool,
    /// What the controller told and is not reported.
    told: Vec<Event>,
    cycle: u64,
    same: u64,
    dropped: u64,
    last_wake: Instant,
}

impl Replay {
    /// A log, in the order of its stamps, to be replayed, and where its program's moves come up.
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
        let mut recording = Recording {
            layout,
            buses,
            operators,
            work: VecDeque::from([Work {
                number: 0,
                program,
                upcoming,
            }]),
            log,
            start: Instant::ZERO,
            tape: None,
        };
        recording.start = recording.first_wake()?;
        let replay = Self {
            state: State::new(recording.start, &recording.layout),
            recording,
            checkpoints: VecDeque::new(),
            answers: VecDeque::new(),
            interrupted: None,
            difference: None,
            over: false,
        };
        Ok((replay, moves))
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
            recording.forget(self.checkpoints[self.checkpoints.len() - 1].instruction);
        }
        if !unknown {
            recording.forget(state.instruction);
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
        self.recording.work.push_back(work);
    }

    fn order(&mut self, number: u64, order: Order) {
        let controller = &mut self.state.controller;
        let cycle = controller.cycle();
        self.answers.push_back(match controller.obey(order) {
            Ok(()) => CycleReport::Obeyed { number, cycle },
            Err(refusal) => CycleReport::Refused {
                number,
                cycle,
                refusal,
            },
        });
    }

    /// One wake-up.
    fn advance(&mut self, report: &mut dyn FnMut(CycleReport)) -> Result<Progress, RunError> {
        if self.over {
            return Ok(Progress::Ended);
        }
        self.answers.drain(..).for_each(&mut *report);
        let stepped = self.step();
        self.over = matches!(stepped, Ok(false));
        self.state.hear();
        for event in self.state.told.drain(..) {
            report(CycleReport::Event(event));
        }
        if let Some(row) = self.state.controller.row() {
            report(CycleReport::Row(*row));
        }
        stepped?;
        Ok(if self.over {
            Progress::Ended
        } else {
            Progress::More
        })
    }
}

impl Recording {
    /// When the controller was first woken.
    fn first_wake(&self) -> Result<Instant, NoReplay> {
        let cycle = self.layout.cycle.as_nanos() as i128;
        let starts = self.log.iter().filter(|it| is_sync(it));
        let starts = starts.map(|it| i128::from(self.start_of(it).as_nanos()));
        let mut starts = starts.peekable();
        let first = *starts.peek().ok_or(NoReplay::NoSync)?;
        // Every SYNC is some time late; the least late has the phase.
        let phase = starts
            .map(|start| start - (start - first + cycle / 2).div_euclid(cycle) * cycle)
            .min()
            .unwrap_or(first);
        // Whole microseconds, as all instants of a run; the stamps were rounded up to them.
        let phase = phase.div_euclid(1000) * 1000;
        let own = self.log.iter().find(|it| self.band(it).is_some());
        let own = own.ok_or(NoReplay::NoBeginning)?;
        if own.frame.id() != CanId::from(CobId::error_control(self.layout.node)) {
            return Err(NoReplay::NoBeginning);
        }
        let own = i128::from(self.start_of(own).as_nanos()) + 999;
        let before = (phase - own).div_euclid(cycle) + i128::from((phase - own) % cycle != 0);
        Ok(Instant::from_nanos((phase - before * cycle) as u64))
    }

    /// The instant at which a frame's first bit was on the bus.
    fn start_of(&self, logged: &Logged) -> Instant {
        /// Behind the end of frame, before the bus is free.
        const INTERMISSION_BITS: u32 = 3;
        let bits = frame_bits(&logged.frame) - INTERMISSION_BITS;
        let length = bit_time(bits, self.buses[logged.bus].bitrate);
        Instant::from_nanos(
            logged
                .at
                .as_nanos()
                .saturating_sub(length.as_nanos() as u64),
        )
    }

    /// The band of a frame that only the controller sends.
    fn band(&self, logged: &Logged) -> Option<Band> {
        let id = logged.frame.id();
        let is = |cob_id: CobId| id == CanId::from(cob_id);
        if is(CobId::SYNC) {
            return Some(Band::Sync);
        }
        if is(CobId::NMT) || is(CobId::error_control(self.layout.node)) {
            return Some(Band::Acyclic);
        }
        let mut drives = self.layout.buses[logged.bus].drives.iter();
        drives.find_map(|&drive| {
            let device = &self.layout.drives[drive].device;
            if device.spec().r_pdos.iter().any(|pdo| is(pdo.cob_id)) {
                Some(Band::Burst)
            } else {
                is(CobId::r_sdo(device.spec().node)).then_some(Band::Acyclic)
            }
        })
    }

    /// The latest cycle an interruption in which explains what the log has until beyond
    /// `difference`, with the state there.
    fn interruption(
        &mut self,
        checkpoints: &VecDeque<State>,
        difference: u64,
    ) -> Result<Option<(u64, State)>, ProgramError> {
        for cycle in (difference.saturating_sub(LATENCY)..=difference).rev() {
            let Some(before) = checkpoints.iter().find(|state| state.cycle <= cycle) else {
                break;
            };
            let mut state = before.trial();
            let mut agrees = true;
            while agrees && state.cycle < difference + u64::from(2 * PATIENCE) {
                if state.cycle == cycle {
                    state.controller.interrupt();
                }
                match self.cycle(&mut state)? {
                    Step::GoesOn => {}
                    Step::Ended => break,
                    Step::Differs(_) => agrees = false,
                }
            }
            if agrees {
                state.trial = false;
                // Most of it was told before.
                state.told.clear();
                return Ok(Some((cycle, state)));
            }
        }
        Ok(None)
    }

    /// One cycle: both wake-ups.
    fn cycle(&mut self, state: &mut State) -> Result<Step, ProgramError> {
        let cycle = state.cycle;
        loop {
            let step = self.wake(state)?;
            if !matches!(step, Step::GoesOn) || state.cycle > cycle {
                return Ok(step);
            }
        }
    }

    /// One wake-up.
    fn wake(&mut self, state: &mut State) -> Result<Step, ProgramError> {
        let Some(wake) = state.controller.next_wake() else {
            // What it sent last is still to come.
            let until = state.last_wake + PATIENCE * self.layout.cycle;
            let taken = self.take(state, self.until(until));
            let missing = taken.or_else(|| state.overdue(until));
            return Ok(missing.map_or(Step::Ended, |missing| {
                Step::Differs(missing.in_state(state))
            }));
        };
        let due = wake.at();
        let last = self.log.last().map_or(due, |last| last.at);
        if due > last + self.layout.cycle {
            return Ok(Step::Ended);
        }
        state.last_wake = due;
        match wake {
            Wake::Sync(_) => {
                self.sync(state, due);
                Ok(Step::GoesOn)
            }
            Wake::Setpoint(_) => {
                let fed = self.attend(state, due);
                if fed.is_err() && self.tape.is_none() {
                    state.controller.abandon();
                }
                let differs = self.setpoints(state, due);
                if !self.is_simulated() {
                    self.replan(state);
                }
                state.cycle += 1;
                match differs {
                    Some(difference) => Ok(Step::Differs(difference)),
                    None => fed.map(|()| Step::GoesOn),
                }
            }
        }
    }

    /// Whether the cycle waited for its plan.
    fn is_simulated(&self) -> bool {
        self.buses.iter().all(|bus| bus.simulated)
    }

    fn sync(&self, state: &mut State, due: Instant) {
        // A SYNC that came whole cycles late: the thread was not there.
        let half = self.layout.cycle.as_nanos() as u64 / 2;
        let from = self.until(Instant::from_nanos(due.as_nanos().saturating_sub(half)));
        let next = self.log[from..].iter().find(|it| is_sync(it));
        let next = next.map_or(due, |it| self.start_of(it));
        let streams = state
            .sent
            .iter()
            .any(|bus| !bus[Band::Burst as usize].is_empty());
        let now = if streams && next >= due + self.layout.cycle {
            next
        } else {
            due
        };
        state.wake(due, now);
    }

    /// The wake-up for the setpoints; the first difference up to it, if there is one.
    fn setpoints(&self, state: &mut State, due: Instant) -> Option<Difference> {
        let nominal = self.until(due);
        let mut cuts = self.uncertain(state, due);
        cuts.retain(|&cut| cut != nominal);
        cuts.sort_unstable_by_key(|&cut| cut.abs_diff(nominal));
        let mut differs = None;
        let mut chosen = None;
        for cut in std::iter::once(nominal).chain(cuts.iter().copied()) {
            if cuts.is_empty() {
                differs = self.take(state, cut);
                state.wake(due, due);
                break;
            }
            let mut trial = state.clone();
            let found = self.take(&mut trial, cut);
            trial.wake(due, due);
            if self.is_what_was_sent(&trial, due) {
                chosen = Some((trial, found));
                break;
            }
            chosen = chosen.or(Some((trial, found)));
        }
        if let Some((trial, found)) = chosen {
            *state = trial;
            differs = found;
        }
        state.burst.clear();
        for bus in 0..self.buses.len() {
            state.burst.extend(state.outboxes[bus].burst.as_slice());
            self.tell_burst(state, bus, due);
        }
        state.hear();
        let differs = differs.or_else(|| {
            let patience = PATIENCE * self.layout.cycle;
            state.overdue(Instant::from_nanos(
                due.as_nanos().saturating_sub(patience.as_nanos() as u64),
            ))
        });
        differs.map(|found| found.in_state(state))
    }

    /// The ends of what had come in by a wake-up, where the stamps leave that open.
    fn uncertain(&self, state: &State, due: Instant) -> Vec<usize> {
        let from = self.until(Instant::from_nanos(
            due.as_nanos().saturating_sub(UNCERTAIN.as_nanos() as u64),
        ));
        let from = from.max(state.next);
        let mut cuts = Vec::new();
        for (place, logged) in self.log.iter().enumerate().skip(from) {
            let own = self.band(logged);
            let sends = matches!(own, Some(Band::Burst | Band::Acyclic));
            if logged.at > due && (own.is_some() || logged.at > due + self.layout.cycle) {
                break;
            }
            if !sends && self.is_decisive(state, logged) {
                cuts.extend([place, place + 1]);
            }
        }
        cuts.dedup();
        cuts
    }

    /// Whether what the controller sends at once depends on a frame.
    fn is_decisive(&self, state: &State, logged: &Logged) -> bool {
        let operational = [0x05];
        let CanId::Standard(id) = logged.frame.id() else {
            return false;
        };
        match id & 0x780 {
            0x080 => id != CobId::SYNC.get(),
            0x580 => true,
            0x700 => logged.frame.data() != operational,
            _ => self.band(logged).is_none() && state.controller.phase() < Phase::ModeStart,
        }
    }

    /// Whether the outboxes hold what the log has from one wake-up for setpoints to the next SYNC.
    fn is_what_was_sent(&self, state: &State, due: Instant) -> bool {
        let heartbeat = CanId::from(CobId::error_control(self.layout.node));
        (state.outboxes.iter().enumerate()).all(|(bus, outbox)| {
            let sent = outbox
                .burst
                .as_slice()
                .iter()
                .chain(outbox.acyclic.as_slice());
            let next = due + self.layout.cycle;
            let here = self.log[self.until(due)..self.until(next)].iter();
            let here = here.filter(|it| it.bus == bus && it.frame.id() != heartbeat);
            let here = here.take_while(|it| !is_sync(it));
            let logged = here.filter(|it| self.band(it).is_some());
            logged.map(|it| it.frame).eq(sent.copied())
        })
    }

    /// What became of the burst of the last wake-up: it left at some time, or was dropped.
    fn tell_burst(&self, state: &mut State, bus: BusIndex, due: Instant) {
        let burst = state.outboxes[bus].burst.as_slice();
        let Some(first) = burst.first() else {
            return;
        };
        let (id, frames) = (first.id(), burst.len());
        let came = |cycles: u32| {
            let here = &self.log[self.until(due)..self.until(due + cycles * self.layout.cycle)];
            let same = |it: &&Logged| it.bus == bus && it.frame.id() == id;
            here.iter().filter(same).count()
        };
        let log_ends = self.until(due + self.layout.cycle) == self.log.len();
        let burst = if came(1) == 0 && came(2) < 2 && !log_ends {
            state.dropped += 1;
            state.sent[bus][Band::Burst as usize].retain(|(at, _)| *at != due);
            Burst::Dropped
        } else {
            Burst::Queued
        };
        let echoes = self.buses[bus].echoes;
        state.controller.burst_sent(bus, frames, burst, echoes);
    }

    /// Takes the log up to `cut`, bus by bus as the driver does: hands over what came in and
    /// compares what was sent.
    fn take(&self, state: &mut State, cut: usize) -> Option<Mismatch> {
        let mut differs: Option<Mismatch> = None;
        let range = state.next..cut.max(state.next);
        for bus in 0..self.buses.len() {
            for logged in self.log[range.clone()].iter().filter(|it| it.bus == bus) {
                let band = self.band(logged);
                if let Some(band) = band
                    && let Err(mismatch) = state.meet(logged, band)
                {
                    let earlier = differs.as_ref().is_none_or(|it| mismatch.at < it.at);
                    differs = if earlier { Some(mismatch) } else { differs };
                }
                let received = Received {
                    at: logged.at,
                    frame: logged.frame,
                    echo: band.is_some(),
                };
                state.controller.receive(bus, &received);
            }
        }
        state.next = range.end;
        differs
    }

    /// The place of the first frame that ended after `at`.
    fn until(&self, at: Instant) -> usize {
        self.log.partition_point(|it| it.at <= at)
    }

    // --- what no frame tells ---

    /// Feeds the plan, and does for operators what they did where nobody recorded it.
    fn attend(&mut self, state: &mut State, due: Instant) -> Result<(), ProgramError> {
        if !state.began
            && let Some(start) = state.controller.ready()
        {
            state.began = true;
            self.begin(start)?;
            if !self.is_simulated() {
                let cycles = self.rest(state, due, Waits::No)?;
                state.waits = Waits::ForPlan(cycles);
            }
        }
        if take(&mut state.paused) && self.operators == Operators::Unknown {
            let cycles = self.rest(state, due, Waits::ForOperator(0))?;
            state.waits = Waits::ForOperator(cycles);
        }
        match &mut state.waits {
            Waits::ForPlan(0) => state.waits = Waits::No,
            Waits::ForOperator(0) => {
                state.waits = Waits::No;
                state.controller.go_on();
            }
            Waits::ForPlan(cycles) | Waits::ForOperator(cycles) => *cycles -= 1,
            Waits::No => {}
        }
        if self.is_simulated() {
            self.replan(state);
        }
        if state.began && state.waits == Waits::No {
            while state.controller.room() > 0
                && let Some(instruction) = self.instruction(state.instruction)?
            {
                state.controller.accept(instruction);
                state.instruction += 1;
            }
        }
        Ok(())
    }

    fn begin(&mut self, start: Position) -> Result<(), ProgramError> {
        if let Some(Work {
            program, upcoming, ..
        }) = self.work.pop_front()
        {
            program.check(start)?;
            self.tape = Some(Tape {
                feeder: program.feeder(start, upcoming)?,
                kept: VecDeque::new(),
                first: 0,
            });
        }
        Ok(())
    }

    /// Has the plan replaced where what operators did wants that: at the instant at which the cycle
    /// asked for it.
    fn replan(&mut self, state: &State) {
        if !state.trial
            && self.operators == Operators::Recorded
            && let Some(tape) = &mut self.tape
            && let Some(request) = state.controller.replan_request()
            && tape.feeder.replan(&request)
        {
            tape.kept.truncate(state.instruction - tape.first);
        }
    }

    fn instruction(
        &mut self,
        place: usize,
    ) -> Result<Option<Instruction<COORDINATES>>, ProgramError> {
        let Some(tape) = &mut self.tape else {
            return Ok(None);
        };
        while tape.first + tape.kept.len() <= place {
            let Some(instruction) = tape.feeder.next_instruction()? else {
                return Ok(None);
            };
            tape.kept.push_back(instruction);
        }
        Ok(tape.kept.get(place - tape.first).copied())
    }

    /// Nobody will want instructions before `place` again.
    fn forget(&mut self, place: usize) {
        if let Some(tape) = &mut self.tape {
            while tape.first < place && tape.kept.pop_front().is_some() {
                tape.first += 1;
            }
        }
    }

    /// How many cycles the machine, at rest now, rests before `then`: as many as the log's
    /// setpoints stay, less those that the plan takes to show in them.
    fn rest(&mut self, state: &State, due: Instant, then: Waits) -> Result<u64, ProgramError> {
        let Some(moves) = self.next_change(state.next) else {
            return Ok(u64::MAX);
        };
        let still = moves.saturating_since(due).as_nanos() / self.layout.cycle.as_nanos();
        let mut trial = state.trial();
        trial.waits = then;
        for cycles in 0..=still as u64 {
            let ended = matches!(self.cycle(&mut trial)?, Step::Ended);
            if ended || trial.paused {
                return Ok(0);
            }
            if trial.burst != state.burst {
                return Ok((still as u64).saturating_sub(cycles));
            }
        }
        Ok(0)
    }

    /// When the first setpoint from `place` on is another than the one before it.
    fn next_change(&self, place: usize) -> Option<Instant> {
        let mut last: BTreeMap<(usize, u32), Frame> = BTreeMap::new();
        let from = place.saturating_sub(16 * self.layout.drives.len() + 16);
        for (index, logged) in self.log.iter().enumerate().skip(from) {
            if self.band(logged) != Some(Band::Burst) {
                continue;
            }
            let Logged { bus, frame, .. } = *logged;
            let before = last.insert((bus, frame.id().raw()), frame);
            if index >= place && before.is_some_and(|before| before != frame) {
                return Some(logged.at);
            }
        }
        None
    }
}

fn is_sync(logged: &Logged) -> bool {
    logged.frame.id() == CanId::from(CobId::SYNC)
}

/// What a cycle of a replay came to.
enum Step {
    GoesOn,
    Ended,
    Differs(Difference),
}

/// A difference without where the controller was.
#[derive(Clone, Copy, Debug)]
struct Mismatch {
    at: Instant,
    bus: BusIndex,
    logged: Option<Frame>,
    sent: Option<Frame>,
}

impl Mismatch {
    fn in_state(self, state: &State) -> Difference {
        Difference {
            at: self.at,
            bus: self.bus,
            cycle: state.cycle,
            phase: state.controller.phase(),
            logged: self.logged,
            sent: self.sent,
        }
    }
}

impl State {
    fn new(start: Instant, layout: &Arc<Layout>) -> Self {
        let buses = layout.buses.len();
        Self {
            controller: Controller::new(Arc::clone(layout), start),
            next: 0,
            sent: vec![Default::default(); buses],
            outboxes: vec![Outbox::default(); buses],
            burst: Vec::new(),
            instruction: 0,
            began: false,
            waits: Waits::No,
            paused: false,
            trial: false,
            told: Vec::new(),
            cycle: 0,
            same: 0,
            dropped: 0,
            last_wake: start,
        }
    }

    /// Wakes the controller at `now`, which was `due`, and keeps what it sends.
    fn wake(&mut self, due: Instant, now: Instant) {
        self.outboxes.iter_mut().for_each(Outbox::clear);
        self.controller.wake(now, &mut self.outboxes);
        for (sent, outbox) in self.sent.iter_mut().zip(&self.outboxes) {
            let keep = |frame: &Frame| (due, *frame);
            sent[Band::Sync as usize].extend(outbox.sync.iter().map(keep));
            sent[Band::Burst as usize].extend(outbox.burst.as_slice().iter().map(keep));
            sent[Band::Acyclic as usize].extend(outbox.acyclic.as_slice().iter().map(keep));
        }
    }

    /// A copy to try something with.
    fn trial(&self) -> Self {
        Self {
            trial: true,
            ..self.clone()
        }
    }

    /// Hears what the controller tells.
    fn hear(&mut self) {
        while let Some(event) = self.controller.event() {
            self.paused |= matches!(event, Event::Paused { .. });
            self.told.push(event);
        }
    }

    /// Compares a frame of the log with what the controller sent.
    fn meet(&mut self, logged: &Logged, band: Band) -> Result<(), Mismatch> {
        let sent = self.sent[logged.bus][band as usize].pop_front();
        let sent = sent.map(|(_, frame)| frame);
        if sent == Some(logged.frame) {
            self.same += 1;
            return Ok(());
        }
        Err(Mismatch {
            at: logged.at,
            bus: logged.bus,
            logged: Some(logged.frame),
            sent,
        })
    }

    /// A frame that was sent before `before` and never came.
    fn overdue(&self, before: Instant) -> Option<Mismatch> {
        let sent = self.sent.iter().enumerate();
        let heads = sent.flat_map(|(bus, bands)| bands.iter().map(move |it| (bus, it.front())));
        let oldest = heads.filter_map(|(bus, head)| Some((*head?, bus)));
        let oldest = oldest.min_by_key(|((at, _), _)| *at);
        let ((at, frame), bus) = oldest.filter(|((at, _), _)| *at < before)?;
        Some(Mismatch {
            at,
            bus,
            logged: None,
            sent: Some(frame),
        })
    }
}
