//! The console on a terminal: a thread that draws, and one that hears keys. So a terminal that takes
//! nothing is in the way of no key.

use super::super::{events, keys};
use super::model::Model;
use super::view;
use crate::control::Layout;
use crate::machine::{COORDINATES, Machine};
use crate::run::Timeline;
use crate::session::{Command, NotTaken, Operator, Session, StatusView, Subscription};
use crossbeam::channel::{self, Receiver, Sender};
use ratatui::crossterm::event::{
    self, Event as Input, KeyCode, KeyEvent, KeyEventKind, KeyModifiers,
};
use std::io;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// How often the screen is drawn.
const REDRAW: Duration = Duration::from_millis(50);

/// What a key does to the screen.
enum Screen {
    /// What is typed behind `:`; `None` once it is done.
    Prompt(Option<String>),
    /// The keys are shown, or no longer.
    Help,
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
    };
    let axes = machine.axes.iter().map(|axis| axis.letter);
    let model = Model::new(axes.collect(), verbose);
    let (events, view) = (session.subscribe(), session.view());
    let spawn = |name: &str| thread::Builder::new().name(name.into());
    spawn("keys").spawn(move || keyboard.hear())?;
    spawn("console").spawn(move || {
        if let Err(error) = draw_all(model, &events, &view, &told, &layout) {
            eprintln!("error: cannot draw: {error}");
        }
    })
}

/// Draws until the session is over.
fn draw_all(
    mut model: Model,
    events: &Subscription,
    view: &StatusView,
    told: &Receiver<Screen>,
    layout: &Layout,
) -> io::Result<()> {
    let mut terminal = ratatui::try_init()?;
    let mut drawn = Ok(());
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
                Screen::Help => model.help = !model.help,
                Screen::Tell(text) => model.tell(text),
            }
        }
        model.take(view.get());
        drawn = drawn.and(terminal.draw(|frame| view::draw(frame, &model)).map(|_| ()));
    }
    ratatui::restore();
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
}

impl Keyboard {
    /// Until the session, or the terminal, is gone.
    fn hear(mut self) {
        loop {
            let pressed = match event::read() {
                Ok(Input::Key(key)) if key.kind != KeyEventKind::Release => self.press(key),
                Ok(_) => Ok(()),
                Err(_) => {
                    // Nobody can be heard any more.
                    let _ = self.command(Command::SwitchOff);
                    return;
                }
            };
            if pressed == Err(NotTaken::Over) {
                return;
            }
        }
    }

    fn press(&mut self, key: KeyEvent) -> Result<(), NotTaken> {
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return match key.code {
                KeyCode::Char('c') => self.command(super::end_of(self.view.get().state)),
                _ => Ok(()),
            };
        }
        if let Some(text) = self.prompt.take() {
            return self.edit(text, key.code);
        }
        match key.code {
            KeyCode::Char(':') => self.type_on(String::new()),
            KeyCode::Char('?') => self.show(Screen::Help),
            code => return command(code).map_or(Ok(()), |command| self.command(command)),
        }
        Ok(())
    }

    /// Goes on with what is typed.
    fn edit(&mut self, mut text: String, code: KeyCode) -> Result<(), NotTaken> {
        match code {
            KeyCode::Enter => {
                self.show(Screen::Prompt(None));
                let (name, value) = text.split_once(' ').unwrap_or((&text, ""));
                return match events::command(name, value.trim()) {
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
                let known = events::vocabulary().filter(|(name, _)| name.starts_with(&text));
                let known: Vec<_> = known.map(|(name, _)| name).collect();
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
            taken => taken,
        }
    }
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
