//! What the machine works on: one job after the other, each from where the last one left the axes.
//!
//! A job's plan comes from outside of the cycle, instruction by instruction, once it has begun.

use super::beside_path::BesidePath;
use super::state::{NotNow, Request, State};
use super::{
    Controller, End, Event, Fault, Goal, Hold, Instruction, Phase, Refusal, StopPoint, Switch,
    event_sink,
};
use std::mem::{replace, take};
use syncline_gcode::AxisSet;
use syncline_trajectory::path::{Command as PathCommand, ReplanRequest};

/// What the machine works on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Job {
    /// Greater than those of all jobs before.
    pub number: u64,
    /// What it is.
    pub kind: JobKind,
    /// It is a program that begins in its middle, and brings the machine into the state of that place itself.
    pub is_entered: bool,
    /// It is read as it comes, and may stand still for as long as it likes in real time: then it is
    /// no fault that no plan comes.
    pub waits_for_input: bool,
    /// The axes that need not be referenced where it begins, as it homes them before it moves any.
    pub homes_first: AxisSet,
    /// It moves no axis and turns no spindle, so that it may be done also while nothing may begin to move.
    pub is_still: bool,
    /// Axes that it leaves where they are, and for which it does the same wherever that is: nothing is asked of them.
    pub leaves: AxisSet,
}

/// What a job is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobKind {
    /// A part program.
    Program,
    /// Lines that were typed in.
    Mdi,
}

impl JobKind {
    /// The state of a machine that works on one.
    pub(crate) const fn state(self) -> State {
        match self {
            Self::Program => State::Running,
            Self::Mdi => State::Mdi,
        }
    }
}

/// How a job ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// To its end.
    Finished,
    /// An operator or a fault stopped it.
    Stopped,
    /// It could not begin, or a block of it could not be run.
    Broken,
    /// It was held, and left for lines that are typed in; it may be taken up.
    SetAside,
}

/// What became of a program that was held and left for lines that are typed in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Aside {
    /// There is none.
    #[default]
    None,
    /// It may be taken up.
    Rests,
    /// It is the job, and waits to be confirmed before it moves or switches anything.
    TakenUp,
}

impl Job {
    /// The job that a machine is switched on for.
    pub const ONLY: Self = Self {
        number: 0,
        kind: JobKind::Program,
        is_entered: false,
        waits_for_input: false,
        homes_first: AxisSet::NONE,
        is_still: false,
        leaves: AxisSet::NONE,
    };
}

impl<const N: usize> Controller<N> {
    /// The machine stays on without a job until it is switched off; otherwise it is switched on for
    /// one job, which begins as soon as it is ready, and goes off with that, or with a fault.
    pub fn stay_on(&mut self) {
        self.stays_on = true;
        self.job = None;
    }

    /// The state of the machine as its operators have it.
    #[must_use]
    pub fn state(&self) -> State {
        match self.phase {
            Phase::Done => State::Off,
            Phase::Disabled if self.goal == Goal::Ready => State::Starting,
            Phase::Disabled if self.is_faulty() => State::Faulted,
            Phase::Disabled => State::Disabled,
            phase if phase < Phase::Program && self.goal == Goal::Ready => State::Starting,
            Phase::Program if self.homing.is_active() => State::Homing,
            Phase::Program => match self.job {
                None if self.aside == Aside::Rests => State::Held,
                None if self.executor.is_off_path() => State::Jogging,
                None => State::Ready,
                Some(_) if self.held || self.pause_told => State::Held,
                Some(job) => job.kind.state(),
            },
            _ => State::Stopping,
        }
    }

    /// Begins a job where the machine rests.
    pub(super) fn begin(&mut self, job: Job) {
        self.job = Some(job);
        // Also lines that are typed where it was to be changed are for the tool that is there.
        self.confirm_tool();
        self.begun = false;
        self.stop_point = None;
        self.calls.restart();
        self.probing.abort();
        self.beside_path = BesidePath::new();
        self.signals_read = None;
        self.threading.abort();
        self.pause_told = false;
        self.unplanned = 0;
        self.held_by = Hold::Operator;
        self.rest_here();
    }

    /// The job has an instruction: it is not wrong in its first line, and outputs are its own.
    fn begin_instructions(&mut self) {
        if !replace(&mut self.begun, true)
            && let Some(job) = self.job
        {
            let line = self.switches.functions.line;
            let mut events = event_sink(&mut self.events);
            let told = |switch| events(Event::Switched { line, switch });
            self.switches.begin(&self.layout, &job, told);
        }
    }

    /// Whether a job is to begin that has not said anything yet.
    pub(super) fn awaits_instructions(&self) -> bool {
        self.job.is_some() && !self.begun && self.phase == Phase::Program
    }

    /// Begins lines that are typed in where a program is held: that is set aside.
    ///
    /// # Errors
    /// The axes move, or are beside the path for something that cannot be left.
    pub(super) fn begin_beside(&mut self, lines: Job) -> Result<(), Refusal> {
        if self.job.is_some_and(|job| job.kind == JobKind::Mdi) {
            return Err(Refusal::LinesHeld);
        }
        if self.probing.is_active() || matches!(self.reached(), Some(StopPoint::Probe { .. })) {
            return Err(Refusal::Probing);
        }
        if self.threading.is_active() {
            return Err(Refusal::Threading);
        }
        if self.has_goers() || matches!(self.reached(), Some(StopPoint::PointToPoint { .. })) {
            return Err(Refusal::NoWayBack);
        }
        if !self.rests_held() {
            return Err(Refusal::Moving);
        }
        if self.job.is_some() {
            self.aside = Aside::Rests;
            self.end_job(Outcome::SetAside);
            self.tell(Event::SetAside);
        }
        self.begin(lines);
        Ok(())
    }

    /// Begins the rest of the program that was set aside.
    ///
    /// # Errors
    /// None was, or the axes move.
    pub(super) fn take_up(&mut self, job: Job) -> Result<(), Refusal> {
        if !self.rests_aside() {
            let (request, state) = (Request::Begin, self.state());
            return Err(NotNow { request, state }.into());
        }
        if !self.rests_held() {
            return Err(Refusal::Moving);
        }
        self.aside = Aside::TakenUp;
        self.begin(job);
        Ok(())
    }

    /// Whether the axes of a machine that is held rest, and none is about to move: with the first of a motion the speed is
    /// still 0.
    fn rests_held(&self) -> bool {
        let plan = &self.planned;
        let rates = plan.velocity.iter().chain(&plan.acceleration);
        let still = rates.chain(&plan.jerk).all(|rate| *rate == 0.0);
        still && self.axes_rest() && !self.executor.is_jogged()
    }

    /// Whether a program is set aside and nothing is at work.
    pub(super) fn rests_aside(&self) -> bool {
        self.aside == Aside::Rests && self.job.is_none() && self.phase == Phase::Program
    }

    /// Forgets what is left of a plan: the machine rests where it is.
    pub(super) fn rest_here(&mut self) {
        self.executor.restart(self.planned.position);
        self.switches.restart();
        self.plan_from_rest();
        self.held = false;
    }

    /// The plan begins anew where the executor rests.
    pub(super) fn plan_from_rest(&mut self) {
        self.planned = self.executor.setpoint();
        self.shaping.restart(self.planned);
    }

    /// The job that is at work.
    #[must_use]
    pub fn job(&self) -> Option<Job> {
        self.job
    }

    /// The last job that is over, and how it ended.
    #[must_use]
    pub fn over(&self) -> Option<(u64, Outcome)> {
        self.over
    }

    /// Where the plan of the job has to start, machine coordinates in mm, once the machine is ready
    /// for it.
    #[must_use]
    pub fn ready(&self) -> Option<[f64; N]> {
        let begins = self.takes_plan() && self.phase == Phase::Program;
        begins.then_some(self.planned.position)
    }

    /// How many more instructions are taken now.
    #[must_use]
    pub fn room(&self) -> usize {
        if self.takes_plan() && self.beside_path.awaits_plan() {
            return 1;
        }
        // While held, nothing: the plan will be replaced.
        let held = self.executor.leads_to_hold()
            || (self.executor.awaits_replacement() && self.executor.replan_request().is_none());
        if self.takes_plan() && !held {
            self.executor.room()
        } else {
            0
        }
    }

    /// Whether the path rests for want of a plan, or another one was asked for.
    #[must_use]
    pub fn lacks_plan(&self) -> bool {
        let lacks = self.beside_path.awaits_plan()
            || self.executor.wants_plan()
            || self.executor.replan_request().is_some();
        self.takes_plan() && lacks
    }

    /// While it stops: the way to rest, and nothing beyond. A homing comes before the job; a probing and a thread have no
    /// plan.
    pub(super) fn takes_plan(&self) -> bool {
        let elsewhere =
            self.homing.is_active() || self.probing.is_active() || self.threading.is_active();
        self.job.is_some() && !elsewhere && matches!(self.phase, Phase::Program | Phase::Stop)
    }

    /// What is to be known of the one job that a machine is switched on for.
    pub fn works_on(&mut self, job: Job) {
        if let Some(only) = &mut self.job {
            *only = job;
        }
    }

    /// Takes the next instruction of the program; false if there is no room for it.
    pub fn accept(&mut self, instruction: Instruction<N>) -> bool {
        if self.room() == 0 {
            return false;
        }
        // A message is told whatever comes behind it.
        if !matches!(
            instruction,
            Instruction::Switch {
                switch: Switch::Message,
                ..
            }
        ) {
            self.begin_instructions();
        }
        if let Instruction::Found(number) = instruction {
            self.beside_path.begin_plan(number);
            return true;
        }
        if self.beside_path.awaits_plan() {
            return true;
        }
        match instruction {
            Instruction::Plan(command) => self.executor.accept(command),
            Instruction::Mark { item, mark, stop } => {
                // A plan that is to be replaced is dropped, its marks with it: they come again.
                if !self.executor.awaits_replacement() {
                    self.stop_point = Some((mark, stop));
                }
                self.executor.accept(PathCommand::Mark { item, mark })
            }
            Instruction::Switch { line, switch } => self.switches.push(line, switch),
            Instruction::Probe(next) => {
                self.probing.take(next);
                self.beside_path.forget_found();
                true
            }
            Instruction::Thread(next) => {
                self.threading.take(next);
                true
            }
            Instruction::Home { number, axes } => {
                self.beside_path.take_home(number, axes);
                true
            }
            Instruction::Found(_) => true,
        }
    }

    /// The stop point at which the path rests.
    pub(super) fn reached(&self) -> Option<StopPoint> {
        let (mark, stop) = self.stop_point?;
        (self.executor.mark() == Some(mark)).then_some(stop)
    }

    /// From where on the program's path has to be planned anew, if it has, also to rest at the end; for
    /// [`Feeder::replan`](crate::program::Feeder::replan).
    #[must_use]
    pub fn replan_request(&self) -> Option<ReplanRequest> {
        (self.takes_plan() && !self.beside_path.awaits_plan())
            .then(|| self.executor.replan_request())
            .flatten()
    }

    /// An operator ends a pause; what was jogged meanwhile goes back first. With a retraction that is leg by leg,
    /// each at an operator's word, also while held.
    pub fn go_on(&mut self) {
        if self.awaits_leg() {
            return self.executor.resume();
        }
        if take(&mut self.pause_told) {
            if self.aside == Aside::TakenUp {
                self.aside = Aside::None;
            }
            if self.executor.is_off_path() {
                self.executor.resume();
            }
            // What needs an angle waits for it once more.
            if !matches!(self.reached(), Some(StopPoint::Orient { .. })) {
                self.executor.pass();
            }
            self.confirm_tool();
            // Held besides, it stays so.
            self.tell(match self.executor.is_held() {
                true => Event::Held(self.holds()),
                false => Event::Resumed,
            });
        }
    }

    /// Whether the next leg of a way back is at an operator's word.
    fn awaits_leg(&self) -> bool {
        let beside = self.job.is_some() && self.executor.is_off_path() && !self.probing.is_active();
        let ends_there = self.executor.next_leg().is_some_and(|leg| leg.last) && self.pause_told;
        beside && self.layout.retraction.is_some() && !ends_there
    }

    /// Whether it is cycle start that goes on from where it rests.
    pub(super) fn awaits_cycle_start(&self) -> bool {
        self.pause_told || self.awaits_leg()
    }

    /// Stops what moves; the job is over. A machine that was switched on for one job goes off.
    pub fn interrupt(&mut self) {
        let works = self.job.is_some()
            || self.aside == Aside::Rests
            || self.homing.is_active()
            || self.executor.is_off_path();
        let moves = self.phase == Phase::Program && works;
        if !self.stays_on && self.end().is_none() {
            self.tell(Event::Interrupted);
            self.go_to(Goal::Off(End::Interrupted));
        } else if moves {
            self.tell(Event::Interrupted);
            if self.job.is_none() {
                // What a job before it has left on: where nothing moves the stop is over within this cycle.
                self.switch_off_outputs();
            }
            self.enter(Phase::Stop, &mut []);
        } else if self.phase == Phase::Program && self.stays_on {
            self.switch_off_outputs();
        } else if self.state() == State::Starting {
            self.go_to(Goal::Disabled);
        }
    }

    /// The program cannot go on: stops on the path.
    pub fn abandon(&mut self) {
        if !self.stays_on {
            self.fail(Fault::Program);
        } else if self.job.is_some() && self.phase == Phase::Program {
            if self.has_not_moved() {
                // What cannot be taken up is left as it was.
                if self.aside == Aside::TakenUp {
                    self.aside = Aside::Rests;
                }
                return self.rest_after(Outcome::Broken);
            }
            self.end_job(Outcome::Broken);
            self.enter(Phase::Stop, &mut []);
        }
    }

    /// Whether all rests and nothing is on its way: as where the job's first line is wrong.
    fn has_not_moved(&self) -> bool {
        let rests = self.executor.is_at_rest() && self.axes_rest();
        let on_path = !self.executor.is_off_path() && !self.has_goers();
        rests && on_path && self.reached().is_none()
    }

    /// The job has ended.
    pub(super) fn end_job(&mut self, outcome: Outcome) {
        if let Some(job) = self.job.take() {
            // What is wrong was not begun where nothing has moved, and stops nothing.
            let ends = match job.kind {
                _ if outcome == Outcome::Stopped => true,
                JobKind::Program => self.begun && self.aside != Aside::Rests,
                JobKind::Mdi => false,
            };
            if outcome == Outcome::Stopped {
                self.give_tool_change_up();
            }
            if ends && self.stays_on {
                self.switch_off_outputs();
            }
            if self.aside == Aside::TakenUp {
                self.aside = Aside::None;
            }
            self.over = Some((job.number, outcome));
            self.tell(Event::JobOver {
                job: job.number,
                outcome,
            });
        }
    }
}
