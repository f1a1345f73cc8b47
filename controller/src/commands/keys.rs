//! Keys on the terminal while a program runs.

use crossbeam::channel::{self, Receiver, Sender};
use rustix::io::{Errno, read};
use rustix::process::getpgrp;
use rustix::termios::{
    LocalModes, OptionalActions, SpecialCodeIndex, Termios, isatty, tcgetattr, tcgetpgrp, tcsetattr,
};
use std::io::{self, stdin};
use std::time::{Duration, Instant};

/// What a person does by a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Key {
    /// Space
    Hold,
    /// `+`, `-`: feed override, %.
    Feed(i32),
    /// `>`, `<`: rapid override, %.
    Rapid(i32),
    /// `s`
    StopAfterBlock,
    /// `b`
    StepBack,
    /// `q`
    Stop,
    /// Enter
    GoOn,
}

/// For the person at the terminal.
pub(super) const HELP: &str = "keys: space hold and go on, + - feed, < > rapid, s stop after block, \
                               b step back, q stop";

/// How much an override changes by a key, %.
const STEP: i32 = 10;

impl Key {
    fn of(byte: u8) -> Option<Self> {
        Some(match byte {
            b' ' => Self::Hold,
            b'+' | b'=' => Self::Feed(STEP),
            b'-' => Self::Feed(-STEP),
            b'>' => Self::Rapid(STEP),
            b'<' => Self::Rapid(-STEP),
            b's' => Self::StopAfterBlock,
            b'b' => Self::StepBack,
            b'q' => Self::Stop,
            b'\n' | b'\r' => Self::GoOn,
            _ => return None,
        })
    }
}

/// The terminal hands over every key at once until this is dropped, also by a panic.
pub(super) struct Keys {
    before: Termios,
    pressed: Receiver<Key>,
}

impl Keys {
    /// Begins to listen; `None` where standard input is not this process's terminal.
    ///
    /// # Errors
    /// The terminal cannot be set.
    pub(super) fn listen() -> io::Result<Option<Self>> {
        let input = stdin();
        // In the background the terminal is somebody else's.
        if !isatty(&input) || tcgetpgrp(&input).ok() != Some(getpgrp()) {
            return Ok(None);
        }
        let before = tcgetattr(&input)?;
        let mut modes = before.clone();
        // Ctrl-C stays a signal. Ctrl-Z does not: it would stop the cycle, and the drives with it.
        modes.local_modes -= LocalModes::ICANON | LocalModes::ECHO;
        modes.special_codes[SpecialCodeIndex::VSUSP] = 0;
        modes.special_codes[SpecialCodeIndex::VMIN] = 0;
        modes.special_codes[SpecialCodeIndex::VTIME] = 1;
        tcsetattr(&input, OptionalActions::Now, &modes)?;
        let (sender, pressed) = channel::bounded(16);
        std::thread::spawn(move || hand_over(&sender));
        Ok(Some(Self { before, pressed }))
    }

    /// The next key, if one was pressed.
    pub(super) fn pressed(&self) -> Option<Key> {
        self.pressed.try_recv().ok()
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        // The terminal may be gone.
        let _ = tcsetattr(stdin(), OptionalActions::Now, &self.before);
    }
}

/// Hands over keys until nobody wants them any more.
fn hand_over(keys: &Sender<Key>) {
    let mut bytes = [0; 16];
    loop {
        let asked = Instant::now();
        let count = match read(stdin(), &mut bytes) {
            Ok(count) => count,
            Err(Errno::INTR) => continue,
            Err(_) => return,
        };
        // Nothing comes after a tenth of a second; at once it comes from a terminal that is gone.
        if count == 0 && asked.elapsed() < Duration::from_millis(50) {
            return;
        }
        for key in bytes[..count].iter().copied().filter_map(Key::of) {
            if keys.send(key).is_err() {
                return;
            }
        }
    }
}
