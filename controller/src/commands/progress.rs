//! What stands on the terminal during a run: messages, and a progress bar below them. A thread of its
//! own writes it, so that nobody waits for a terminal that takes nothing.

use super::output::Stream;
use super::repeats::{self, Repeats};
use super::writers::GIVE_UP;
use super::{told, told_event};
use crate::control::fault::Names;
use crate::control::{self, Layout};
use crate::machine::Machine;
use crate::program::{Extent, Program, Reading, counted_speed};
use crate::session::{Event, Settings, Status, StatusView, Subscription};
use crossbeam::channel::{self, Receiver, Sender};
use indicatif::{ProgressBar, ProgressStyle};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// How often the bar is drawn.
const REDRAW: Duration = Duration::from_millis(50);
/// Messages that wait at most.
const MESSAGES: usize = 1024;

/// Something to be written.
enum Message {
    /// A line above the bar.
    Line(String),
    /// What stands there in the end, instead of the bar.
    Result(Stream, String),
    /// There is no more.
    End,
}

/// Takes messages for the terminal, and waits for nobody: where too many wait they are left out.
#[derive(Clone)]
pub(super) struct Messages(Sender<Message>);

impl Messages {
    /// Shows a line.
    pub(super) fn tell(&self, text: String) {
        let _ = self.0.try_send(Message::Line(text));
    }

    /// Shows the run's result.
    pub(super) fn conclude(&self, stream: Stream, text: String) {
        let _ = self.0.try_send(Message::Result(stream, text));
    }
}

/// What is shown.
pub(super) struct Screen {
    pub(super) events: Subscription,
    pub(super) view: StatusView,
    pub(super) layout: Arc<Layout>,
    pub(super) machine: Machine,
    pub(super) scale: Scale,
    /// Also what happens in every run.
    pub(super) verbose: bool,
}

/// Messages on their way to a terminal that is still to come.
pub(super) struct Waiting(Receiver<Message>);

/// The terminal of a run.
pub(super) struct Console {
    messages: Messages,
    thread: JoinHandle<()>,
    /// Counts what the thread has done.
    done: Arc<AtomicU64>,
}

impl Console {
    /// What takes messages, before there is anything to show.
    pub(super) fn messages() -> (Messages, Waiting) {
        let (tell, queue) = channel::bounded(MESSAGES);
        (Messages(tell), Waiting(queue))
    }

    /// Shows messages and what there is to see of a session.
    pub(super) fn start(
        screen: Screen,
        messages: Messages,
        Waiting(queue): Waiting,
    ) -> io::Result<Self> {
        let done = Arc::<AtomicU64>::default();
        let count = Arc::clone(&done);
        let thread = thread::Builder::new().name("console".into());
        let thread = thread.spawn(move || screen.show(&queue, &count))?;
        Ok(Self {
            messages,
            thread,
            done,
        })
    }

    /// Waits until all is written, as long as the terminal takes any of it.
    pub(super) fn finish(self) {
        let _ = self.messages.0.send_timeout(Message::End, GIVE_UP);
        let mut last = (0, Instant::now());
        while !self.thread.is_finished() && last.1.elapsed() < GIVE_UP {
            thread::sleep(Duration::from_millis(2));
            let done = self.done.load(Ordering::Relaxed);
            if done != last.0 {
                last = (done, Instant::now());
            }
        }
    }
}

impl Screen {
    /// Shows all until the end.
    fn show(self, queue: &Receiver<Message>, done: &AtomicU64) {
        let bar = self.scale.bar();
        let (start, mut repeats) = (Instant::now(), Repeats::default());
        let mut over = false;
        loop {
            let message = if over {
                queue.recv().unwrap_or(Message::End)
            } else {
                match self.events.wait(REDRAW) {
                    Ok(Some(Event::Machine(event)))
                        if !repeats.is_news(&event, start.elapsed()) => {}
                    Ok(Some(event)) => self.tell(&event, &bar),
                    Ok(None) => {}
                    Err(_) => over = true,
                }
                let due = if over { Duration::MAX } else { start.elapsed() };
                for (event, more) in repeats.due(due) {
                    if let Some(text) = self.text(&event) {
                        bar.suspend(|| eprintln!("{}", repeats::told(&text, more)));
                    }
                }
                let status = self.view.get();
                if !over && status.time.is_some() {
                    bar.set_position(self.scale.position(&status));
                    bar.set_message(self.progress(&status));
                }
                match queue.try_recv() {
                    Ok(message) => message,
                    Err(_) => continue,
                }
            };
            match message {
                Message::Line(text) => bar.suspend(|| eprintln!("{text}")),
                Message::Result(stream, text) => {
                    bar.finish_and_clear();
                    stream.print(&text);
                }
                Message::End => return bar.finish_and_clear(),
            }
            done.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn tell(&self, event: &Event, bar: &ProgressBar) {
        match event {
            Event::Machine(event) => {
                if let Some(text) = self.text(event) {
                    bar.suspend(|| eprintln!("{text}"));
                }
                if let control::Event::Paused { .. } = event {
                    bar.suspend(|| eprintln!("press Enter for cycle start, to go on"));
                }
            }
            Event::Refused(refused) => bar.suspend(|| eprintln!("{}", refused.reason)),
            Event::Message { line, text } => {
                bar.suspend(|| eprintln!("line {line}: {text}"));
            }
            Event::Recorded(files) => bar.suspend(|| eprintln!("{files}")),
            Event::Problem(error) => bar.suspend(|| eprintln!("{}", told(&**error))),
            // What comes of a command is seen.
            Event::Accepted(_) | Event::State(_) => {}
        }
    }

    /// The line of an event that is worth one.
    fn text(&self, event: &control::Event) -> Option<String> {
        told_event(event, &self.layout, self.verbose)
    }

    /// What the machine does, beside the bar.
    fn progress(&self, status: &Status) -> String {
        let otherwise = set_otherwise(&status.settings);
        let line = status.line;
        if status.off_path || status.waits {
            let axes = self.machine.axes.iter().map(|axis| axis.letter);
            let at = axes.map(|axis| {
                let unit = if axis.is_linear() { "" } else { "°" };
                format!("{axis}{:.3}{unit} ", status.setpoint[axis.index()])
            });
            let at: String = at.collect();
            let step = status.settings.jog_step;
            return format!("line {line}, {at}by {step} mm{otherwise}");
        }
        if let Some(waiting) = status.waiting {
            let waiting = waiting.describe(|input| self.layout.input(input));
            return format!("line {line}, {waiting}{otherwise}");
        }
        let (speed, turns) = counted_speed(&status.velocity);
        let unit = if turns { "°" } else { "mm" };
        format!("line {line}, {:.0} {unit}/min{otherwise}", speed * 60.0)
    }
}

/// What a run's progress is counted by.
pub(super) enum Scale {
    /// The path, mm and degrees together.
    Path(Extent),
    /// The bytes that have been read, of a program that is read as it runs.
    Read(Reading),
}

impl Scale {
    /// Of a program that amounts to that.
    pub(super) fn of(program: &Program, extent: Extent) -> Self {
        program.reading().map_or(Self::Path(extent), Self::Read)
    }

    /// The bar of a run: how far it has come, and of how much where that is known.
    pub(super) fn bar(&self) -> ProgressBar {
        let (bar, template) = match *self {
            Self::Read(Reading {
                of: Some(bytes), ..
            }) => (
                ProgressBar::new(bytes),
                "{wide_bar} {bytes}/{total_bytes} read, {msg}",
            ),
            Self::Read(_) => (ProgressBar::new_spinner(), "{spinner} {bytes} read, {msg}"),
            // Behind what is not known yet there may be more.
            Self::Path(Extent {
                known_to: Some(_), ..
            }) => (
                ProgressBar::new_spinner(),
                "{spinner} {pos} mm and °, {msg}",
            ),
            Self::Path(Extent { length, turned, .. }) => (
                ProgressBar::new((length + turned) as u64),
                match turned {
                    0.0 => "{wide_bar} {pos}/{len} mm, {msg}",
                    _ => "{wide_bar} {pos}/{len} mm and °, {msg}",
                },
            ),
        };
        let style = ProgressStyle::with_template(template);
        bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
    }

    /// Where on the bar a run is.
    pub(super) fn position(&self, status: &Status) -> u64 {
        match self {
            Self::Path(_) => status.passed as u64,
            Self::Read(reading) => reading.bytes(),
        }
    }
}

/// What is set otherwise than usual: parts of the programmed speeds, and switches.
fn set_otherwise(settings: &Settings) -> String {
    let tell = |what: &str, percent: f64| {
        if percent == 100.0 {
            String::new()
        } else {
            format!(", {what} {percent} %")
        }
    };
    let on = |what: &str, on: bool| {
        if on {
            format!(", {what}")
        } else {
            String::new()
        }
    };
    [
        tell("feed", settings.feed_override),
        tell("rapid", settings.rapid_override),
        on("single block", settings.single_block),
        on("optional stop", settings.optional_stop),
    ]
    .concat()
}
