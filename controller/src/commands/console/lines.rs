//! The console as lines of text: commands in, what happens out. It works without a terminal.

use super::super::events::{self, EVENTS};
use super::super::told_event;
use super::model::Model;
use super::{told, values};
use crate::control::{Event as MachineEvent, HOLD_TO_RUN, Layout, State};
use crate::machine::Machine;
use crate::run::Timeline;
use crate::session::{
    Command, Event, Jog, NotTaken, Operator, Session, Status, StatusView, Subscription, Taken,
};
use crossbeam::channel::{self, Receiver, RecvTimeoutError};
use std::collections::VecDeque;
use std::io::{self, BufRead, Read};
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;
use syncline_gcode::AxisLetter;

/// Who the lines come from, in the log.
const NAME: &str = "lines";
/// How often it is looked whether a line that waits may begin. A state that a command leads to is seen
/// by then.
const LOOK: Duration = Duration::from_millis(20);
/// Behind an answer, until axes are seen to move that it sets in motion, cycles.
const SETTLES: f64 = 10.0;
/// Lines that are read ahead.
const LINES: usize = 64;
/// The word that asks what stopped the machine, on the screen, too.
pub(super) const FAULTS: &str = "faults";
/// The line that waits for nothing but what is under way.
const WAIT: &str = "wait";

/// Bytes of a line at most, with its end.
const LONGEST: u64 = 4096;

/// What is told to who asks, by the word that asks for it.
const ASKED: [(&str, &str); 4] = [
    ("?", "this list"),
    (
        "status",
        "all that the screen shows: state, positions, program, speeds, drives, inputs …",
    ),
    (
        FAULTS,
        "what stopped the machine, where, and what may be done",
    ),
    (
        WAIT,
        "the lines behind it, but for stop and feed_hold, wait until the machine rests",
    ),
];

/// Begins to obey the lines of standard input and to tell what happens; the thread that tells ends
/// with the session.
pub(super) fn listen(
    session: &mut Session<impl Timeline>,
    machine: Machine,
    layout: Arc<Layout>,
    verbose: bool,
) -> io::Result<JoinHandle<()>> {
    let (give, lines) = channel::bounded(LINES);
    let mut model = Model::new(&machine, verbose);
    // A jog goes on for as long as it is renewed.
    model.releases = true;
    let reader = Reader {
        lines,
        over: false,
        waiting: VecDeque::new(),
        unanswered: 0,
        busy: None,
        operator: session.operator(NAME),
        answers: session.subscribe(),
        view: session.view(),
        model,
        machine: machine.clone(),
    };
    let events = session.subscribe();
    let teller = Teller::new(session, machine, layout, verbose);
    let spawn = |name: &str| thread::Builder::new().name(name.into());
    spawn("input").spawn(move || {
        let mut input = io::stdin().lock();
        while let Ok(Some(line)) = next_line(&mut input) {
            let said = match line {
                Ok(line) => give.send(line).map_err(drop),
                Err(why) => {
                    println!("{why}");
                    Ok(())
                }
            };
            if said.is_err() {
                return;
            }
        }
    })?;
    spawn("lines").spawn(move || reader.read_all())?;
    spawn("console").spawn(move || {
        while let Ok(event) = events.wait(Duration::MAX) {
            if let Some(text) = event.and_then(|event| teller.text(&event)) {
                println!("{text}");
            }
        }
    })
}

/// The next line, or why it is none to obey; `None` behind the last one.
fn next_line(input: &mut impl BufRead) -> io::Result<Option<Result<String, String>>> {
    let mut line = Vec::new();
    if input.take(LONGEST).read_until(b'\n', &mut line)? == 0 {
        return Ok(None);
    }
    if !line.ends_with(b"\n") && line.len() as u64 == LONGEST {
        input.skip_until(b'\n')?;
        let why = format!("not done, as a line has {LONGEST} bytes at most");
        return Ok(Some(Err(why)));
    }
    Ok(Some(String::from_utf8(line).map_err(|line| {
        let line = String::from_utf8_lossy(line.as_bytes()).trim().to_owned();
        format!("not done, as it is no UTF-8: {line}")
    })))
}

/// Obeys lines.
struct Reader {
    lines: Receiver<String>,
    /// There are no more lines.
    over: bool,
    /// What waits until what is under way is over.
    waiting: VecDeque<String>,
    /// Commands that have neither taken effect nor been refused.
    unanswered: usize,
    /// When an axis moved last, or a command had no answer or just had it, in the machine's time, s.
    busy: Option<f64>,
    operator: Operator,
    answers: Subscription,
    view: StatusView,
    model: Model,
    machine: Machine,
}

impl Reader {
    /// Until the session is over.
    fn read_all(mut self) {
        loop {
            let line = match self.lines.recv_timeout(LOOK) {
                Ok(line) => Some(line),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => {
                    self.over = true;
                    thread::sleep(LOOK);
                    None
                }
            };
            self.model.take(self.view.get());
            let done = match line {
                Some(line) => self.hear(&line),
                None => self.go_on(),
            };
            if done == Err(NotTaken::Over) {
                return;
            }
        }
    }

    /// Takes a line: at once, or behind what waits.
    fn hear(&mut self, line: &str) -> Result<(), NotTaken> {
        let line = line.trim();
        let behind = self.waiting.iter().any(|waiting| waiting == WAIT);
        match line {
            "feed_hold" => {}
            "stop" => self.leave_undone(line),
            _ if behind || line == WAIT || parsed(line).is_ok_and(|it| begins(&it)) => {
                self.waiting.push_back(line.to_owned());
                return Ok(());
            }
            "disable" | "switch_off" => self.leave_undone(line),
            _ => {}
        }
        self.obey(line)
    }

    /// What waits is not done any more, as this line comes before it.
    fn leave_undone(&mut self, line: &str) {
        let dropped = self.waiting.drain(..).filter(|waiting| waiting != WAIT);
        dropped.for_each(|it| println!("not done, as `{line}` came before it: {it}"));
    }

    fn obey(&mut self, line: &str) -> Result<(), NotTaken> {
        match line {
            "" | WAIT => {}
            "?" => self.help(),
            "status" => println!("{}", explained(&self.model, &self.machine)),
            FAULTS => println!("{}", listed(&self.view.get(), &self.machine)),
            _ => match parsed(line) {
                Ok(command) => return self.command(command),
                Err(problem) => println!("{problem}"),
            },
        }
        Ok(())
    }

    /// Does what may begin now.
    fn go_on(&mut self) -> Result<(), NotTaken> {
        let status = self.view.get();
        let answers = self.answers.events();
        let answered = answers.filter(|event| event.answers(NAME)).count();
        if answered > 0 || self.unanswered > 0 || !status.stands() {
            self.busy = status.time;
        }
        if answered > 0 {
            // The state that this leads to is seen with the next look.
            self.unanswered = self.unanswered.saturating_sub(answered);
            return Ok(());
        }
        let stood = status.time.zip(self.busy).map(|(now, busy)| now - busy);
        let settles = SETTLES * self.machine.cycle.as_secs_f64();
        let rests = match status.state {
            State::Ready | State::Faulted | State::Disabled => true,
            // In mid-program axes are jogged in this state, too.
            State::Held => stood.is_none_or(|stood| stood >= settles),
            _ => false,
        };
        // A jog adds to the one that is under way.
        let adds = matches!(status.state, State::Jogging | State::Held)
            && (self.waiting.front()).is_some_and(|line| line.starts_with("jog"));
        if self.unanswered > 0 || !(rests || adds) {
            return Ok(());
        }
        match self.waiting.pop_front() {
            Some(line) => self.obey(&line),
            None if self.over => self.command(Command::SwitchOff),
            None => Ok(()),
        }
    }

    fn command(&mut self, command: Command) -> Result<(), NotTaken> {
        loop {
            match self.operator.command(command.clone()) {
                Ok(taken) => {
                    self.unanswered += usize::from(taken == Taken::Queued);
                    return Ok(());
                }
                Err(NotTaken::Busy) => thread::sleep(LOOK),
                Err(NotTaken::Over) => return Err(NotTaken::Over),
            }
        }
    }

    fn help(&self) {
        println!(
            "commands, a line each; one that begins something waits until what is under way is over:"
        );
        for (word, meaning) in ASKED {
            println!("  {word:<18} {meaning}");
        }
        for event in &EVENTS {
            println!("  {event}");
        }
    }
}

/// The command of a line.
fn parsed(line: &str) -> Result<Command, String> {
    let (name, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
    let asked = ASKED.map(|(word, _)| word);
    if asked.contains(&name) {
        return Err(format!("`{name}` takes no value"));
    }
    events::command(name, value.trim(), &asked)
}

/// Whether it begins something, and waits for what is under way.
fn begins(command: &Command) -> bool {
    matches!(
        command,
        Command::Run { .. }
            | Command::Mdi(_)
            | Command::SetWorkOffset(_)
            | Command::SetToolLength(_)
            | Command::GoTo(_)
            | Command::Home(_)
            | Command::Jog(_)
    )
}

/// The state, where the machine stands and what is in effect.
fn shown(status: &Status, machine: &Machine) -> String {
    let letters = || machine.axes.iter().map(|axis| axis.letter);
    let positions = |position: &[f64]| -> String {
        letters()
            .map(|axis| format!(" {axis}{:.3}", values::rounded(position[axis.index()])))
            .collect()
    };
    let (work, machine) = (
        positions(&status.work_position()),
        positions(&status.actual),
    );
    let unreferenced: String = letters()
        .filter(|axis| !status.referenced[axis.index()])
        .map(|axis| format!(" {axis}"))
        .collect();
    let unreferenced = match unreferenced.is_empty() {
        true => unreferenced,
        false => format!(", not homed{unreferenced}"),
    };
    format!(
        "{}: work{work}, machine{machine}{unreferenced}, tool {}, {}",
        status.state_in_words(),
        status.tool,
        status.modes
    )
}

/// The same with all else that the screen shows.
fn explained(model: &Model, machine: &Machine) -> String {
    let status = &model.status;
    let mut text = shown(status, machine);
    if let Some(line) = status.interrupted {
        text += &format!("\ninterrupted: line {line}; `resume` takes the program up there");
    }
    let mut tell = |name: &str, what: &str| text += &format!("\n{name}: {what}");
    let (program, time) = (values::program(model), values::time(model));
    tell("program", &format!("{program}, {time}"));
    match values::block(model) {
        (Some(0), _) | (None, "") => {}
        (Some(line), block) => tell(&format!("line {line}"), block),
        (None, typed) => tell("typed", typed),
    }
    if let Some(waiting) = values::waiting(model) {
        tell("rests", &waiting);
    }
    let (name, distances) = values::distances(model);
    let distances: Vec<_> = distances
        .iter()
        .filter_map(|(axis, distance)| {
            Some(format!(
                "{}{:.3}",
                axis.letter,
                values::rounded((*distance)?)
            ))
        })
        .collect();
    if !distances.is_empty() {
        tell(name, &distances.join(" "));
    }
    for (name, what) in values::values(model) {
        tell(name, what.trim_end());
    }
    tell("offsets", &values::offsets(model));
    for (name, what) in model.signals.rows(status) {
        tell(name, &what);
    }
    text
}

/// What stopped the machine, the first cause on top, where it stands and what may be done.
fn listed(status: &Status, machine: &Machine) -> String {
    let Some(stopped) = &status.stopped else {
        return "no fault".to_owned();
    };
    let mut text = String::new();
    for (place, fault) in (1..).zip(&stopped.faults) {
        text += &format!("{place}. {fault}\n");
    }
    text += &shown(status, machine);
    if let Some((what, resumed)) = values::not_completed(status) {
        text += &format!("\nnot completed: {what}");
        if let Some(there) = resumed {
            text += &format!("; once it is reset, `resume` takes the program up {there}");
        }
    }
    format!("{text}\n{}", status.state.way_on())
}

/// What happens, in words.
pub(in crate::commands) struct Teller {
    view: StatusView,
    machine: Machine,
    layout: Arc<Layout>,
    verbose: bool,
}

impl Teller {
    /// Of a session.
    pub(in crate::commands) fn new(
        session: &Session<impl Timeline>,
        machine: Machine,
        layout: Arc<Layout>,
        verbose: bool,
    ) -> Self {
        Self {
            view: session.view(),
            machine,
            layout,
            verbose,
        }
    }

    /// The line of an event that is worth one.
    pub(in crate::commands) fn text(&self, event: &Event) -> Option<String> {
        match event {
            Event::State(state @ (State::Ready | State::Held)) => {
                let status = Status {
                    state: *state,
                    ..self.view.get()
                };
                Some(shown(&status, &self.machine))
            }
            Event::State(state) => Some(format!("{state}: {}", state.way_on())),
            Event::Machine(event) => {
                let text = told_event(event, &self.layout, self.verbose)?;
                Some(match event {
                    MachineEvent::Paused { .. } => format!("{text}; cycle_start goes on"),
                    _ => text,
                })
            }
            Event::Refused(refused) => Some(format!("refused: {}", refused.reason)),
            Event::Message { line, text } => Some(format!("line {line}: {text}")),
            Event::Recorded(files) => Some(files.to_string()),
            Event::Problem(error) => Some(told(&**error)),
            Event::Accepted(accepted) => match accepted.command {
                Command::Jog(Jog::Continuous { axis, speed, .. }) => self.stopping(axis, speed),
                _ => None,
            },
        }
    }

    /// How an axis stops that is jogged on and on, with this speed at most.
    fn stopping(&self, letter: AxisLetter, speed: Option<f64>) -> Option<String> {
        let mut axes = self.machine.axes.iter();
        let axis = axes.find(|axis| axis.letter == letter)?;
        let status = self.view.get();
        let fastest = axis.fastest_jog(status.referenced[letter.index()]);
        let rapid = status.settings.rapid_part();
        let speed = speed.unwrap_or(fastest).min(fastest * rapid);
        let [unit, ..] = axis.units();
        Some(format!(
            "jog {letter}: stops in {:.3} {unit}, {} ms after the last `renew_jog {letter}`",
            axis.stopping_distance(speed),
            HOLD_TO_RUN.as_millis()
        ))
    }
}
