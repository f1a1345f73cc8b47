//! The console on a terminal: a thread that draws, and one that hears keys. So a terminal that takes
//! nothing is in the way of no key.
//!
//! # Keys that are held
//!
//! An arrow that is pressed jogs by a step. Where it is held, and the terminal tells keys that repeat and that
//! are released from those that are pressed (kitty's keyboard protocol, for which it is asked), the axis goes
//! on from the first repetition until the key is released. Each repetition renews the jog, and nothing else
//! does: this side of a connection that hangs cannot know that the key is still held. A terminal that is lost
//! thus stops the axis by [`HOLD_TO_RUN`](crate::control::HOLD_TO_RUN). Any other terminal has steps only.
//!
//! Enter that is held repeats itself too, and a terminal need not tell that. At the last stop of a program it would begin the
//! program again as soon as that has ended: an Enter begins none so soon after another one.
//!
//! # A terminal that is lost
//!
//! Nobody is there any more: the machine comes to rest and is switched off, in whatever state it is.

use super::super::events::{self, EVENTS};
use super::super::keys;
use super::lines::FAULTS;
use super::model::Model;
use super::view;
use crate::control::{Layout, State};
use crate::machine::{COORDINATES, Machine};
use crate::run::Timeline;
use crate::session::{Command, Jog, NotTaken, Operator, Session, StatusView, Subscription};
use crossbeam::channel::{self, Receiver, Sender};
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{
    self, Event as Input, KeyCode, KeyEvent, KeyEventKind, KeyModifiers, KeyboardEnhancementFlags,
    PopKeyboardEnhancementFlags, PushKeyboardEnhancementFlags,
};
use ratatui::crossterm::{execute, terminal};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use std::io;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// How often the screen is drawn.
const REDRAW: Duration = Duration::from_millis(50);

/// How often it is looked whether the terminal is still there.
const LOOK: Duration = Duration::from_millis(50);

/// What a key does to the screen.
enum Screen {
    /// Whether the terminal tells when a key is released: with that drawing begins.
    Releases(bool),
    /// What is typed behind `:`; `None` once it is done.
    Prompt(Option<String>),
    /// Whether the keys are shown.
    Help(bool),
    /// What stopped the machine, once more.
    Faults,
    /// For the operator alone.
    Tell(String),
}

/// Begins to hear keys and to draw; the thread that draws ends with the session, and leaves the terminal
/// as it was.
pub(super) fn listen(
    session: &mut Session<impl Timeline>,
    machine: &Machine,
    layout: Arc<Layout>,
    verbose: bool,
) -> io::Result<JoinHandle<()>> {
    let (tell, told) = channel::unbounded();
    let keyboard = Keyboard {
        operator: session.operator("keys"),
        view: session.view(),
        tell,
        prompt: None,
        held: Vec::new(),
        last: None,
        help: false,
        closed_list: false,
    };
    let model = Model::new(machine, verbose);
    let (events, view) = (session.subscribe(), session.view());
    let terminal = ratatui::try_init()?;
    let spawn = |name: &str| thread::Builder::new().name(name.into());
    spawn("keys").spawn(move || keyboard.hear())?;
    spawn("console").spawn(move || {
        if let Err(error) = draw_all(terminal, model, &events, &view, &told, &layout) {
            eprintln!("error: cannot draw: {error}");
        }
    })
}

/// Draws until the session is over.
fn draw_all(
    mut terminal: DefaultTerminal,
    mut model: Model,
    events: &Subscription,
    view: &StatusView,
    told: &Receiver<Screen>,
    layout: &Layout,
) -> io::Result<()> {
    let mut drawn = Ok(());
    // Until then the terminal is being asked, and what is drawn would come in between.
    if let Ok(Screen::Releases(releases)) = told.recv() {
        model.releases = releases;
    }
    while let Ok(event) = events.wait(REDRAW) {
        if let Some(event) = event {
            model.happened(&event, layout);
            // More may have come; all of it is drawn at once.
            for event in events.events() {
                model.happened(&event, layout);
            }
        }
        for change in told.try_iter() {
            match change {
                Screen::Prompt(text) => model.prompt = text,
                Screen::Releases(releases) => model.releases = releases,
                Screen::Help(shown) => model.help = shown,
                Screen::Faults => model.tell_faults(),
                Screen::Tell(text) => model.tell(text),
            }
        }
        model.take(view.get());
        drawn = drawn.and(terminal.draw(|frame| view::draw(frame, &model)).map(|_| ()));
    }
    if model.releases {
        // It is left anyway.
        let _ = execute!(io::stdout(), PopKeyboardEnhancementFlags);
    }
    let _ = ratatui::try_restore();
    if drawn.is_err() {
        // Dropped, it would say that its cursor cannot be shown, and panic because it cannot say so.
        std::mem::forget(terminal);
    }
    // What was told last would be gone with the screen.
    let last = model.messages.iter().rev().take(1).cloned();
    for text in model.faults().into_iter().chain(last) {
        eprintln!("{text}");
    }
    drawn
}

/// Hears keys.
struct Keyboard {
    operator: Operator,
    view: StatusView,
    tell: Sender<Screen>,
    /// What is typed behind `:`.
    prompt: Option<String>,
    /// Keys that jog for as long as they are held.
    held: Vec<KeyCode>,
    /// The key that was pressed last, or repeated itself, and when.
    last: Option<(KeyCode, Instant)>,
    /// The keys are shown, which hides where the axes are.
    help: bool,
    /// The last key closed their list; while it is held it does nothing else.
    closed_list: bool,
}

impl Keyboard {
    /// Until the session, or the terminal, is gone.
    fn hear(mut self) {
        self.show(Screen::Releases(ask_for_releases()));
        if self.hear_keys().is_ok() {
            return;
        }
        // Where the session is over it is off.
        let _ = self.operator.command(Command::SwitchOff);
    }

    /// Until the session is over.
    ///
    /// # Errors
    /// The terminal is gone.
    fn hear_keys(&mut self) -> io::Result<()> {
        loop {
            wait_for_input()?;
            while event::poll(Duration::ZERO)? {
                if let Input::Key(key) = event::read()?
                    && self.take(key) == Err(NotTaken::Over)
                {
                    return Ok(());
                }
            }
        }
    }

    /// A key is pressed, repeats itself or is released.
    fn take(&mut self, key: KeyEvent) -> Result<(), NotTaken> {
        let repeats = self.is_repeated(key);
        if key.kind != KeyEventKind::Release {
            self.closed_list &= repeats;
            if self.help {
                self.list_keys(false);
                self.closed_list = !self.stops(key);
            }
            if self.closed_list && !self.stops(key) {
                return Ok(());
            }
        }
        let step = command(key.code).filter(|_| self.prompt.is_none());
        match (step, key.kind) {
            (Some(Command::Jog(Jog::Step { axis, direction })), KeyEventKind::Repeat) => {
                if self.held.contains(&key.code) {
                    return self.command(Command::RenewJog(axis));
                }
                self.held.push(key.code);
                self.command(Command::Jog(Jog::Continuous {
                    axis,
                    direction,
                    speed: None,
                }))
            }
            (Some(Command::Jog(Jog::Step { axis, .. })), KeyEventKind::Release)
                if self.held.contains(&key.code) =>
            {
                self.held.retain(|held| *held != key.code);
                self.command(Command::EndJog(axis))
            }
            (_, KeyEventKind::Release) => Ok(()),
            _ => self.press(key, repeats),
        }
    }

    /// A key is pressed, or `repeats` itself.
    fn press(&mut self, key: KeyEvent, repeats: bool) -> Result<(), NotTaken> {
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return match key.code {
                KeyCode::Char('c') => self.command(super::end_of(self.view.get().state)),
                _ => Ok(()),
            };
        }
        if let Some(text) = self.prompt.take() {
            return self.edit(text, key.code);
        }
        let sets_going = match (key.code, self.view.get().state) {
            (KeyCode::Enter, State::Ready) => {
                Some("Enter may only have repeated itself: press it again to begin the program")
            }
            (KeyCode::Enter, State::Held) => {
                Some("Enter may only have repeated itself: press it again to go on")
            }
            (KeyCode::Char(' '), State::Held) => {
                Some("space may only have repeated itself: press it again to go on")
            }
            _ => None,
        };
        if let Some(why) = sets_going.filter(|_| repeats) {
            self.show(Screen::Tell(why.to_owned()));
            return Ok(());
        }
        match key.code {
            KeyCode::Char(':') => self.type_on(String::new()),
            KeyCode::Char('?') => self.list_keys(true),
            code => {
                let wanted = |it: &Command| keys::is_wanted(it, &self.view.get());
                let command = command(code).filter(wanted).and_then(|it| match repeats {
                    true => keys::of_repeated(it),
                    false => Some(it),
                });
                return command.map_or(Ok(()), |command| self.command(command));
            }
        }
        Ok(())
    }

    /// Shows the keys, or shows them no longer.
    fn list_keys(&mut self, shown: bool) {
        self.help = shown;
        self.show(Screen::Help(shown));
    }

    /// Whether a key stops what moves, which it does also behind the list of the keys.
    fn stops(&self, key: KeyEvent) -> bool {
        let would_hold = || self.view.get().state != State::Held;
        key.modifiers.contains(KeyModifiers::CONTROL)
            || match command(key.code) {
                Some(Command::Stop) => true,
                Some(Command::ToggleFeedHold) => would_hold(),
                _ => false,
            }
    }

    /// Whether a key may be the repetition of the same one, which is held.
    fn is_repeated(&mut self, key: KeyEvent) -> bool {
        if key.kind == KeyEventKind::Release {
            self.last.take_if(|(code, _)| *code == key.code);
            return false;
        }
        let before = self.last.replace((key.code, Instant::now()));
        before.is_some_and(|(code, at)| code == key.code && at.elapsed() < keys::REPEATS)
    }

    /// Goes on with what is typed.
    fn edit(&mut self, mut text: String, code: KeyCode) -> Result<(), NotTaken> {
        match code {
            KeyCode::Enter => {
                self.show(Screen::Prompt(None));
                if text == FAULTS {
                    self.show(Screen::Faults);
                    return Ok(());
                }
                let (name, value) = text.split_once(' ').unwrap_or((&text, ""));
                return match events::command(name, value.trim(), &[FAULTS]) {
                    Ok(command) => self.command(command),
                    Err(problem) => {
                        self.show(Screen::Tell(problem));
                        Ok(())
                    }
                };
            }
            KeyCode::Esc => self.show(Screen::Prompt(None)),
            KeyCode::Backspace => {
                text.pop();
                self.type_on(text);
            }
            KeyCode::Tab => {
                let known = EVENTS.iter().map(|event| event.name).chain([FAULTS]);
                let known: Vec<_> = known.filter(|name| name.starts_with(&text)).collect();
                self.show(Screen::Tell(known.join(", ")));
                self.type_on(match known[..] {
                    [only] => format!("{only} "),
                    _ => text,
                });
            }
            KeyCode::Char(typed) => {
                text.push(typed);
                self.type_on(text);
            }
            _ => self.type_on(text),
        }
        Ok(())
    }

    fn type_on(&mut self, text: String) {
        self.show(Screen::Prompt(Some(text.clone())));
        self.prompt = Some(text);
    }

    fn show(&self, change: Screen) {
        // Nobody drawing any more is fine.
        let _ = self.tell.send(change);
    }

    fn command(&self, command: Command) -> Result<(), NotTaken> {
        match self.operator.command(command) {
            Err(NotTaken::Busy) => {
                self.show(Screen::Tell(NotTaken::Busy.to_string()));
                Ok(())
            }
            taken => taken.map(|_| ()),
        }
    }
}

/// Waits for something to read, for a while. Crossterm, which reads it, would go on reading without end from a
/// terminal that is gone.
///
/// # Errors
/// It is gone.
fn wait_for_input() -> io::Result<()> {
    let keyboard = io::stdin();
    let mut waiting = [PollFd::new(&keyboard, PollFlags::IN)];
    let time = Timespec {
        tv_sec: 0,
        tv_nsec: LOOK.subsec_nanos().into(),
    };
    match poll(&mut waiting, Some(&time)) {
        Ok(_) | Err(Errno::INTR) => {}
        Err(error) => return Err(error.into()),
    }
    let gone = PollFlags::HUP | PollFlags::ERR | PollFlags::NVAL;
    match waiting[0].revents().intersects(gone) {
        true => Err(io::ErrorKind::UnexpectedEof.into()),
        false => Ok(()),
    }
}

/// Has the terminal tell when a key is released; whether it does.
fn ask_for_releases() -> bool {
    let flags = KeyboardEnhancementFlags::DISAMBIGUATE_ESCAPE_CODES
        | KeyboardEnhancementFlags::REPORT_EVENT_TYPES;
    matches!(terminal::supports_keyboard_enhancement(), Ok(true))
        && execute!(io::stdout(), PushKeyboardEnhancementFlags(flags)).is_ok()
}

/// What a key commands.
fn command(code: KeyCode) -> Option<Command> {
    match code {
        KeyCode::Char('e') => Some(Command::Enable),
        KeyCode::Char('d') => Some(Command::Disable),
        KeyCode::Char('r') => Some(Command::Reset),
        KeyCode::Char('h') => Some(Command::Home([false; COORDINATES])),
        KeyCode::Char(character) => keys::command(u8::try_from(character).ok()?),
        KeyCode::Enter => keys::command(b'\n'),
        KeyCode::Right => keys::command_of_sequence(b"C"),
        KeyCode::Left => keys::command_of_sequence(b"D"),
        KeyCode::Up => keys::command_of_sequence(b"A"),
        KeyCode::Down => keys::command_of_sequence(b"B"),
        KeyCode::PageUp => keys::command_of_sequence(b"5~"),
        KeyCode::PageDown => keys::command_of_sequence(b"6~"),
        _ => None,
    }
}
