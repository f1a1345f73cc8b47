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
//! - `jobs`: programs and typed lines of a machine that stays on, one after the other
//! - `job`: the program that runs: where on its moves the setpoint is
//! - `remaining`: how long it still takes
//! - [`Recorded`]: commands of a session that was recorded, given once more
//! - [`PassesStops`]: an operator who goes on at every program stop
//!
//! Whoever calls [`Session::advance`] lends the session its thread, and nothing in there waits: not
//! for a subscriber, not for an operator, not for the planner of a machine in real time. So a
//! command that came is on its way into the cycle with the next call. Every command that took effect
//! is told with its source and its cycle ([`Accepted`]): with the same machine and program, the same
//! commands in the same cycles make the same run.

mod channel;
mod command;
mod job;
mod jobs;
mod recorded;
mod remaining;
mod settings;
mod status;
mod stops;

pub use channel::{Accepted, Event, NotTaken, Operator, Refused, Subscription, Taken};
pub use command::{Command, Direction, Jog, Refusal};
pub use recorded::Recorded;
pub use settings::{LEAST, MOST_FEED, MOST_RAPID, Override, Settings, StepChange, SwitchChange};
pub use status::{Squareness, Status, StatusView, Stopped};
pub use stops::PassesStops;

use crate::control::{
    self, Fault, Layout, MachineFunctions, NotNow, Order, Outcome, Request, Row, State, Switch,
};
use crate::machine::COORDINATES;
use crate::observe::flight_recorder::FlightRecorder;
use crate::observe::{Observed, Observers};
use crate::program::{Moves, Programs};
use crate::run::{CycleReport, Progress, RunError, Timeline};
use channel::{Inlet, Issued, Outlets};
use command::by_hand;
use job::Job;
use jobs::{Begin, Jobs, Resumable};
use remaining::Remaining;
use std::collections::VecDeque;
use std::sync::Arc;
use syncline_drives::model::PowerState;
use syncline_gcode::{CoolantChange, InEffect, Point, Turning, Unlike};

/// A machine, its job, its operators and all who watch, on a [`Timeline`].
pub struct Session<T> {
    timeline: T,
    inlet: Inlet,
    desk: Desk,
}

/// The session's side of what the cycle reports.
struct Desk {
    settings: Settings,
    /// Commands that have not taken effect, the oldest first.
    waiting: VecDeque<Waiting>,
    /// The number of the first of them.
    first: u64,
    /// The cycle in which the last one took effect.
    cycle: u64,
    outlets: Outlets,
    /// Of the machine, as it told.
    state: State,
    status: Status,
    view: StatusView,
    /// The job that the setpoint follows.
    job: Job,
    /// Where it is to be resumed since a fault stopped it.
    left: Resumable,
    /// Those of a machine that stays on.
    jobs: Option<Jobs>,
    /// By letter: who began its last continuous jog.
    joggers: [Option<Arc<str>>; COORDINATES],
    faults: Vec<Fault>,
    observers: Observers,
    recorder: Option<FlightRecorder>,
    /// Whether the session itself says that the command of each M-code of the user's has ended well, in the next cycle.
    passes_user_codes: bool,
    /// The call of which it has still to say so.
    user_call: Option<u32>,
    /// The tool whose change was given up since the last row, which may have it still.
    given_up: Option<u32>,
    /// How long programs still take, if somebody wants to know.
    remaining: Option<Remaining>,
    /// What the job at work has switched.
    functions: MachineFunctions,
    /// For the words of faults.
    layout: Arc<Layout>,
    /// Coordinates that have an axis.
    coordinates: Vec<usize>,
}

/// A command that has not taken effect.
struct Waiting {
    issued: Issued,
    what: What,
}

/// What a command comes to.
enum What {
    /// An order is on its way.
    Order,
    /// The order to begin the job with that number, whose moves come up there.
    Begin(u64, Box<Moves>),
}

impl<T: Timeline> Session<T> {
    /// A session with one job: the program on the timeline, whose moves come up in `moves`.
    #[must_use]
    pub fn new(layout: &Arc<Layout>, timeline: T, moves: Moves, observers: Observers) -> Self {
        Self::with(layout, timeline, moves, None, observers)
    }

    /// A session of a machine that stays on until it is switched off, and runs one job after the
    /// other.
    #[must_use]
    pub fn staying_on(
        layout: &Arc<Layout>,
        timeline: T,
        programs: Programs,
        observers: Observers,
    ) -> Self {
        let jobs = Some(Jobs::new(programs, layout));
        let mut session = Self::with(layout, timeline, Moves::new().1, jobs, observers);
        session.desk.show_programs();
        session.desk.view.show(&session.desk.status);
        session
    }

    fn with(
        layout: &Arc<Layout>,
        timeline: T,
        moves: Moves,
        jobs: Option<Jobs>,
        observers: Observers,
    ) -> Self {
        let mut status = Status::default();
        for axis in &layout.axes {
            status.referenced[axis.coordinate] = axis.homing.is_absolute();
            // Where encoders tell how square a gantry is, there is nothing to show of one that is.
            let searched = axis.homing.square.filter(|_| !axis.homing.tells_place());
            status.squareness[axis.coordinate] = searched.map(|square| Squareness {
                stored: square.squareness,
                measured: None,
            });
        }
        status.drives = vec![PowerState::Unknown; layout.drives().count()];
        status.inputs = vec![false; layout.inputs.len()];
        status.outputs = vec![false; layout.outputs.len()];
        status.analog_inputs = vec![0.0; layout.analog_inputs.len()];
        status.analog_outputs = vec![0.0; layout.analog_outputs.len()];
        Self {
            timeline,
            inlet: Inlet::default(),
            desk: Desk {
                settings: status.settings,
                waiting: VecDeque::new(),
                first: 0,
                cycle: 0,
                outlets: Outlets::default(),
                state: status.state,
                view: StatusView::new(status.clone()),
                status,
                job: Job::new(control::Job::ONLY.number, moves),
                left: None,
                jobs,
                joggers: Default::default(),
                faults: Vec::new(),
                observers,
                recorder: None,
                passes_user_codes: true,
                user_call: None,
                given_up: None,
                remaining: None,
                functions: MachineFunctions::default(),
                coordinates: layout.axes.iter().map(|axis| axis.coordinate).collect(),
                layout: Arc::clone(layout),
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
        let mut has_news = false;
        for (issued, wanted) in inlet.commands(desk.waiting.len()) {
            has_news = true;
            match wanted {
                Ok(()) => desk.hand_over(issued, timeline),
                Err(reason) => desk.refuse(issued, reason),
            }
        }
        if let Some(number) = desk.user_call.take() {
            let source = "simulation".into();
            let command = Command::UserCodeEnded {
                number,
                failure: None,
            };
            desk.hand_over(Issued { source, command }, timeline);
        }
        let mut has_row = false;
        let progress = timeline.advance(&mut |report| {
            has_news = true;
            has_row |= matches!(report, CycleReport::Row(_));
            desk.take(report);
        });
        if has_row {
            (desk.observers).observe_drives(|drive| timeline.observe_drive(drive));
        }
        // It changes by what is commanded and reported alone: of a cycle's two wake-ups one reports.
        if has_news {
            desk.status.settings = desk.settings;
            desk.view.show(&desk.status);
        }
        let progress = progress.unwrap_or_else(|error| {
            desk.problem(error);
            Progress::More
        });
        desk.record(timeline, progress == Progress::Ended);
        desk.outlets.deliver();
        progress
    }

    /// Has the status tell how long the program at work still takes, from the next job on. That takes a thread which
    /// plans the program once more.
    pub fn tell_remaining(&mut self) {
        self.desk.remaining = Some(Remaining::default());
    }

    /// Somebody else runs the commands of M-codes of the user's from now on, and says how they end
    /// ([`Command::UserCodeEnded`]). Otherwise nothing is run, and all end well.
    pub fn await_user_codes(&mut self) {
        self.desk.passes_user_codes = false;
    }

    /// Has what leads to a fault written, from now on.
    pub fn record_faults(&mut self, recorder: FlightRecorder) {
        self.desk.recorder = Some(recorder);
    }

    /// Hands over a command of a recorded session. What was before it in there is before it here, also
    /// before a stop, which overtakes nothing any more.
    fn repeat(&mut self, accepted: Accepted) {
        let Accepted {
            source, command, ..
        } = accepted;
        let source = source.into();
        let issued = Issued { source, command };
        self.desk.hand_over(issued, &mut self.timeline);
    }

    /// What stopped the machine, the first cause on top, until it is reset.
    #[must_use]
    pub fn faults(&self) -> &[Fault] {
        &self.desk.faults
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

/// What a command comes to, and what that takes.
enum Asked {
    Order(Order),
    Begin(Box<Begin>),
}

impl Desk {
    /// Hands over what a command asks for, or tells why it is refused.
    fn hand_over(&mut self, issued: Issued, timeline: &mut impl Timeline) {
        match self.ask(&issued) {
            Ok(Asked::Order(order)) => {
                let number = self.keep(issued, What::Order);
                timeline.order(number, order);
            }
            Ok(Asked::Begin(begin)) => {
                let Begin { work, order, moves } = *begin;
                let what = What::Begin(work.number, Box::new(moves));
                if let Some(remaining) = &mut self.remaining {
                    remaining.begin(&work.program, self.status.setpoint);
                }
                timeline.prepare(work);
                let number = self.keep(issued, what);
                timeline.order(number, order);
            }
            Err(reason) => self.refuse(issued, reason),
        }
    }

    /// What a command comes to in the state that the machine is in.
    fn ask(&mut self, issued: &Issued) -> Result<Asked, Refusal> {
        let Issued { command, source } = issued;
        if let (Command::Run { from_line }, Some(jobs)) = (command, &mut self.jobs) {
            jobs.asked_for(*from_line);
        }
        let shown = self.status.state;
        let state = (self.jobs.as_ref()).map_or(shown, |jobs| jobs.expected(shown));
        // The cycle asks the table about all others, as their orders take effect.
        let resumes = (self.jobs.as_ref()).is_some_and(|jobs| jobs.resumes(command, state));
        let asks = match command {
            _ if resumes && state == State::Held => Some(Request::GoOn),
            _ if resumes => Some(Request::Begin),
            Command::CycleStart if state == State::Ready => Some(Request::Begin),
            Command::Run { .. } => Some(Request::Begin),
            Command::Mdi(_) | Command::SetWorkOffset(_) | Command::SetToolLength(_) => {
                Some(Request::TypedLines)
            }
            Command::Load(_)
            | Command::JogStep(_)
            | Command::RenewJog(_)
            | Command::FeedOverride(_)
            | Command::RapidOverride(_)
            | Command::SingleBlock(_)
            | Command::OptionalStop(_) => Some(Request::Set),
            _ => None,
        };
        if let Some(request) = asks
            && !state.allows(request)
        {
            return Err(control::Refusal::from(NotNow { request, state }).into());
        }
        // It would prolong what somebody else, who may be lost, began.
        if let Command::RenewJog(axis) = command
            && self.joggers[axis.index()].as_ref() != Some(source)
        {
            return Ok(Asked::Order(Order::Nothing));
        }
        if let Command::Output { name, on } = command {
            let (output, on) = (by_hand(&self.layout, name)?, *on);
            return Ok(Asked::Order(Order::Switch { output, on }));
        }
        if let Command::UserCodeEnded {
            failure: Some(text),
            ..
        } = command
        {
            let (line, text) = (self.job.line, text.clone());
            self.outlets.tell(Event::Message { line, text });
        }
        let begins = resumes || matches!(asks, Some(Request::Begin | Request::TypedLines));
        let Some(jobs) = &mut self.jobs else {
            if asks == Some(Request::TypedLines) {
                return Err(Refusal::OneProgram);
            }
            let order = self.settings.order(command);
            return Ok(Asked::Order(order.unwrap_or(Order::Nothing)));
        };
        let held = self.job.place(Some(&self.status.setpoint));
        // What is ordered already, and has not taken effect.
        let ordered = self.waiting.iter().map(|it| &it.issued.command);
        if begins {
            let outputs = self.functions.outputs;
            let now = self.status.in_effect(&self.layout, outputs, ordered);
            if let Some(begin) = jobs.begin(command, &self.status, now, held)? {
                return Ok(Asked::Begin(Box::new(begin)));
            }
        }
        let order = match command {
            Command::Load(file) => {
                jobs.load(file, state)?;
                self.show_programs();
                None
            }
            Command::GoTo(positions) => {
                let here = Point(self.status.setpoint);
                let to = self.status.coordinates().place(positions, here);
                self.settings.order(&Command::Jog(Jog::Line(to)))
            }
            _ => self.settings.order(command),
        };
        Ok(Asked::Order(order.unwrap_or(Order::Nothing)))
    }

    /// Keeps a command until it takes effect; its number.
    fn keep(&mut self, issued: Issued, what: What) -> u64 {
        self.waiting.push_back(Waiting { issued, what });
        self.first + self.waiting.len() as u64 - 1
    }

    /// Tells that the first command that waits has taken effect.
    fn accept_next(&mut self) {
        let Some(Waiting { issued, what }) = self.waiting.pop_front() else {
            return;
        };
        self.first += 1;
        match (&issued.command, what) {
            (command, What::Begin(number, moves)) => self.begun(number, *moves, command),
            (Command::Reset, _) => {
                self.faults.clear();
                self.status.stopped = None;
            }
            (Command::Jog(Jog::Continuous { axis, .. }), _) => {
                self.joggers[axis.index()] = Some(Arc::clone(&issued.source));
            }
            _ => {}
        }
        self.outlets.tell(Event::Accepted(Accepted {
            cycle: self.cycle,
            source: issued.source.to_string(),
            command: issued.command,
        }));
    }

    /// A job has begun, maybe in the place of one that is held.
    fn begun(&mut self, number: u64, moves: Moves, command: &Command) {
        let Status {
            line,
            tool,
            setpoint,
            ..
        } = self.status;
        let held = (self.job.place(Some(&setpoint)), self.job.modal.take());
        if let Some(jobs) = &mut self.jobs {
            let MachineFunctions {
                spindle,
                coolant,
                outputs,
                ..
            } = self.functions;
            let now = InEffect {
                tool,
                spindle,
                coolant,
                outputs,
            };
            jobs.begun(number, held, &now, line);
        }
        self.tell_typed();
        self.job = Job::new(number, moves);
        self.status.typed = match command {
            Command::Mdi(lines) => Some(lines.clone()),
            Command::SetWorkOffset(_) | Command::SetToolLength(_) => Some(String::new()),
            _ => None,
        };
        self.left = None;
        self.show_programs();
    }

    /// Tells what of what was in effect before does not hold in the program that begins, and what holds in it.
    fn tell_typed(&mut self) {
        let Unlike { reset, stays } =
            (self.jobs.as_ref()).map_or_else(Unlike::default, Jobs::unlike_fresh);
        let mut told = Vec::new();
        if !reset.is_empty() {
            let reset = reset.join(", ");
            told.push(format!(
                "{reset}: typed before, not in effect in the program, which begins with G17 G54 G90 G94"
            ));
        }
        if !stays.is_empty() {
            let stays = stays.join(", ");
            told.push(format!("{stays}: in effect in the program from before"));
        }
        for text in told {
            self.outlets.tell(Event::Message { line: 1, text });
        }
    }

    /// A job is over.
    fn ended(&mut self, number: u64, outcome: Outcome) {
        if number != self.job.number {
            return;
        }
        let left = self.left.take().or_else(|| self.job.place(None));
        if let Some(jobs) = &mut self.jobs {
            let moved = self.job.has_moved();
            jobs.ended(number, outcome, left, self.status.line, moved);
        }
        self.job.end();
        self.forget_remaining();
    }

    fn refuse(&mut self, issued: Issued, reason: Refusal) {
        self.outlets.tell(Event::Refused(Refused {
            source: issued.source.to_string(),
            command: issued.command,
            reason,
        }));
    }

    /// Commands have taken effect in a cycle, all before the one with this number.
    fn accept_before(&mut self, number: u64, cycle: u64) {
        if self.first < number {
            self.cycle = cycle;
        }
        while self.first < number && !self.waiting.is_empty() {
            self.accept_next();
        }
    }

    fn problem(&mut self, error: RunError) {
        self.observers.problem(&error);
        self.outlets.tell(Event::Problem(Arc::new(error)));
    }

    /// Hands the flight recorder the frames. Once the machine rests after a fault it is written what was
    /// before, and told what came of that.
    fn record(&mut self, timeline: &mut impl Timeline, ended: bool) {
        let Some(recorder) = &mut self.recorder else {
            return;
        };
        while let Some(frame) = timeline.carried() {
            recorder.carry(frame);
        }
        let rests = ended || self.state == State::Faulted;
        let begun = if rests { recorder.write() } else { None };
        match begun.or_else(|| recorder.written(ended)) {
            Some(Ok(files)) => self.outlets.tell(Event::Recorded(files)),
            Some(Err(error)) => self.problem(error.into()),
            None => {}
        }
    }

    /// The cycle has refused the order that waits first.
    fn refused(&mut self, refusal: control::Refusal) {
        if let Some(Waiting { issued, what }) = self.waiting.pop_front() {
            self.first += 1;
            if let (What::Begin(job, _), Some(jobs)) = (what, &mut self.jobs) {
                jobs.refused(job);
                self.forget_remaining();
            }
            self.refuse(issued, refusal.into());
        }
    }

    /// How a job came to its end tells nothing of what comes from now on.
    fn forget_ending(&mut self) {
        if let Some(jobs) = &mut self.jobs {
            jobs.forget_ending();
        }
    }

    fn take(&mut self, report: CycleReport) {
        match report {
            CycleReport::Obeyed {
                number,
                cycle,
                functions,
            } => {
                self.functions = functions;
                self.accept_before(number + 1, cycle);
                self.forget_ending();
                // A job that has begun may be held in the very same cycle.
                self.show_state();
            }
            CycleReport::Refused {
                number,
                cycle,
                refusal,
            } => {
                self.accept_before(number, cycle);
                self.refused(refusal);
                self.show_state();
            }
            CycleReport::JobOver { job, outcome, left } => {
                if let Some(jobs) = &mut self.jobs {
                    jobs.over(job, outcome, left, self.status.tool);
                }
                self.leave_hold();
                self.show_programs();
                self.show_state();
            }
            CycleReport::Event(control::Event::State(state)) => {
                self.state = state;
                self.leave_hold();
                self.show_state();
                self.forget_ending();
            }
            CycleReport::Event(event) => {
                self.observers.tell(&event);
                if let Some(recorder) = &mut self.recorder {
                    recorder.tell(&event);
                }
                match event {
                    control::Event::Phase(phase) => self.status.phase = phase,
                    control::Event::Fault(fault) => self.stopped_by(fault),
                    control::Event::JobOver { job, outcome } => self.ended(job, outcome),
                    control::Event::Paused { line, .. } => self.job.pauses(line),
                    control::Event::Retracing => self.job.steps_back(),
                    control::Event::ToolNotChanged { asked, .. } => self.given_up = Some(asked),
                    control::Event::Probed { line, .. }
                    | control::Event::Threaded { line, .. }
                    | control::Event::ProgramHomed { line } => {
                        self.job.found(line);
                    }
                    control::Event::UserCode { number, .. } if self.passes_user_codes => {
                        self.user_call = Some(number);
                    }
                    control::Event::Referenced { axis, apart, .. } => {
                        self.show_reference(axis, true, Some(apart));
                    }
                    control::Event::OutOfSquare { axis, apart, .. } => {
                        self.show_reference(axis, true, Some(apart));
                    }
                    control::Event::Recalled { axis, .. } => self.show_reference(axis, true, None),
                    control::Event::Unreferenced { axis, .. }
                    | control::Event::Askew { axis, .. } => self.show_reference(axis, false, None),
                    control::Event::Power { device, power } => {
                        let drive = self.layout.drives().position(|it| it == device);
                        if let Some(drive) = drive {
                            self.status.drives[drive] = power;
                        }
                    }
                    // Before the first row says so.
                    control::Event::Frozen { axis, position } => {
                        let at = self.coordinates[axis];
                        (self.status.setpoint[at], self.status.actual[at]) = (position, position);
                    }
                    control::Event::Input { input, on } => self.status.inputs[input] = on,
                    control::Event::Output { output, on } => self.status.outputs[output] = on,
                    control::Event::AnalogOutput { output, value } => {
                        self.status.analog_outputs[output] = value;
                    }
                    _ => {}
                }
                if let control::Event::Switched { line, switch } = event {
                    self.show_switched(line, switch);
                    self.switched_off(switch);
                }
                self.status.waits = event.rests().unwrap_or(self.status.waits);
                self.outlets.tell(Event::Machine(event));
            }
            CycleReport::Row(row) => self.follow(&row),
            CycleReport::BusFailed(error) => self.problem(RunError::Port(error)),
        }
    }

    /// Lists a fault behind those before.
    fn stopped_by(&mut self, fault: Fault) {
        let works = match self.state {
            State::Running | State::Mdi | State::Held => true,
            // By a program.
            State::Homing => self.job.rests_for().is_some(),
            _ => false,
        };
        let line = works.then_some(self.status.line);
        let position = self.status.actual;
        self.left = self.left.or_else(|| self.job.place(None));
        let stopped = self.status.stopped.get_or_insert_with(|| Stopped {
            line,
            position,
            ..Stopped::default()
        });
        stopped.faults.push(fault.describe(&*self.layout));
        self.faults.push(fault);
    }

    /// Takes what happened at one SYNC of the program.
    fn follow(&mut self, row: &Row<COORDINATES>) {
        if self.job.follow(row) {
            self.show_programs();
        }
        let mut actual = row.plan.position;
        for &at in &self.coordinates {
            actual[at] = row.axes[at].act;
        }
        let inputs = self.status.analog_inputs.iter_mut();
        inputs.zip(row.analog_inputs).for_each(|(of, is)| *of = is);
        if let Some(stopped) = &mut self.status.stopped {
            stopped.position = actual;
        }
        let time = self.observers.observe(&Observed {
            row,
            actual,
            line: self.job.line,
            waits: self.status.waits,
            idle: matches!(self.state, State::Ready | State::Faulted | State::Disabled),
            job: self.job.number,
            moves: &self.job.moves,
            tag: self.job.tag,
        });
        if self.given_up.take() != Some(row.functions.tool) {
            self.show_tool(row.functions.tool);
        }
        if let Some(recorder) = &mut self.recorder {
            recorder.observe(row, self.state, self.job.line);
        }
        self.functions = row.functions;
        let motion = self.job.moves.motion(row.plan.tag);
        let ahead = motion.filter(|_| row.plan.busy && !row.plan.off_path);
        let target = ahead.map(|motion| motion.curve().end());
        let remaining = (self.remaining.as_mut())
            .and_then(|remaining| remaining.at(row.plan.distance, &self.settings));
        self.status = Status {
            remaining,
            time: Some(time),
            target,
            spindle_actual: row.spindle,
            measured: row.measured,
            feed: Some(row.plan.feed).filter(|feed| feed.is_finite()),
            line: self.job.line,
            setpoint: row.plan.position,
            actual,
            velocity: row.plan.velocity,
            passed: self.observers.passed(),
            off_path: row.plan.off_path,
            waiting: row.waiting,
            ..std::mem::take(&mut self.status)
        };
    }

    /// What is switched off stays off in the next job, too.
    fn switched_off(&mut self, switch: Switch) {
        let is_off = match switch {
            Switch::Spindle(spindle) => spindle.turning == Turning::Off,
            Switch::Coolant(change) => change == CoolantChange::OFF,
            Switch::Tool(_) | Switch::Output(_) | Switch::Message => false,
        };
        if let Some(jobs) = self.jobs.as_mut().filter(|_| is_off) {
            jobs.switched_off(switch);
            self.show_programs();
        }
    }

    /// No program is at work any more.
    fn forget_remaining(&mut self) {
        self.status.remaining = None;
        if let Some(remaining) = &mut self.remaining {
            remaining.end();
        }
    }

    /// Where the machine is in a state that no hold leads to, no program is held for typed lines any more.
    fn leave_hold(&mut self) {
        use State::{Disabled, Faulted, Off, Ready, Starting};
        if let Some(jobs) = &mut self.jobs
            && matches!(self.state, Ready | Faulted | Disabled | Starting | Off)
        {
            jobs.leave_hold();
            self.show_programs();
        }
    }
}
