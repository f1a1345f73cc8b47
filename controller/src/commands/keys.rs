//! Keys on the terminal while a program runs.

use crossbeam::channel::{self, Receiver, Sender};
use rustix::io::{Errno, read};
use rustix::process::getpgrp;
use rustix::termios::{
    LocalModes, OptionalActions, SpecialCodeIndex, Termios, isatty, tcgetattr, tcgetpgrp, tcsetattr,
};
use std::io::{self, stdin};
use std::time::{Duration, Instant};
use syncline_gcode::Axis;

/// What a person does by a key.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// Arrows and page keys: an axis by one step, and its direction.
    Jog(Axis, f64),
    /// `[`, `]`: a smaller or a greater step.
    JogStep(isize),
    /// `q`
    Stop,
    /// Enter
    GoOn,
}

/// For the person at the terminal.
pub(super) const HELP: &str = "keys: space hold and go on, + - feed, < > rapid, s stop after block, \
                               b step back, q stop, Enter go on at a program stop; while \
                               held: arrows and page keys jog X Y Z, [ ] by less or more";

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
            b'[' => Self::JogStep(-1),
            b']' => Self::JogStep(1),
            b'q' => Self::Stop,
            b'\n' | b'\r' => Self::GoOn,
            _ => return None,
        })
    }

    /// What a terminal sends behind escape and `[`, or `O`, for a key without a character.
    fn of_sequence(sequence: &[u8]) -> Option<Self> {
        Some(match sequence {
            b"C" => Self::Jog(Axis::X, 1.0),
            b"D" => Self::Jog(Axis::X, -1.0),
            b"A" => Self::Jog(Axis::Y, 1.0),
            b"B" => Self::Jog(Axis::Y, -1.0),
            b"5~" => Self::Jog(Axis::Z, 1.0),
            b"6~" => Self::Jog(Axis::Z, -1.0),
            _ => return None,
        })
    }
}

/// Takes apart what a terminal sends.
#[derive(Debug, Default)]
struct Decoder {
    /// Since an escape, that included. A terminal sends it in one burst, a person does not.
    sequence: Vec<u8>,
}

impl Decoder {
    /// The keys of what was read; that is nothing where a tenth of a second brought nothing.
    fn keys<'a>(&'a mut self, read: &'a [u8]) -> impl Iterator<Item = Key> + 'a {
        if read.is_empty() {
            self.sequence.clear();
        }
        read.iter().filter_map(|byte| self.key(*byte))
    }

    /// The key that a byte completes.
    fn key(&mut self, byte: u8) -> Option<Key> {
        const ESCAPE: u8 = 0x1B;
        let within = match self.sequence.len() {
            0 => false,
            1 => byte == b'[' || byte == b'O',
            _ => matches!(byte, b'0'..=b'?' | b'@'..=b'~'),
        };
        if byte == ESCAPE || !within {
            // Whatever else follows an escape is a key of its own: none that stops gets lost.
            self.sequence.clear();
            if byte == ESCAPE {
                self.sequence.push(byte);
                return None;
            }
            return Key::of(byte);
        }
        self.sequence.push(byte);
        if self.sequence.len() == 2 || byte < b'@' {
            // Longer than any key's.
            if self.sequence.len() > 16 {
                self.sequence.clear();
            }
            return None;
        }
        let key = Key::of_sequence(&self.sequence[2..]);
        self.sequence.clear();
        key
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
    let mut decoder = Decoder::default();
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
        for key in decoder.keys(&bytes[..count]) {
            if keys.send(key).is_err() {
                return;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(bytes: &[u8]) -> Vec<Key> {
        Decoder::default().keys(bytes).collect()
    }

    /// What a person types slowly: each byte, then nothing for a while.
    fn slowly(bytes: &[u8]) -> Vec<Key> {
        let mut decoder = Decoder::default();
        let mut keys = Vec::new();
        for byte in bytes {
            keys.extend(decoder.keys(&[*byte]));
            assert_eq!(decoder.keys(&[]).next(), None);
        }
        keys
    }

    #[test]
    fn arrows_and_page_keys_jog() {
        let [right, down] = [Key::Jog(Axis::X, 1.0), Key::Jog(Axis::Y, -1.0)];
        assert_eq!(keys(b"\x1B[C\x1BOB"), [right, down]);
        let [up, down] = [1.0, -1.0].map(|sign| Key::Jog(Axis::Z, sign));
        assert_eq!(keys(b"\x1B[5~]\x1B[6~"), [up, Key::JogStep(1), down]);
    }

    #[test]
    fn keys_that_mean_nothing_hide_none_that_do() {
        // F5, shift and an arrow, delete.
        assert_eq!(keys(b"\x1B[15~\x1B[1;2C\x1B[3~b"), [Key::StepBack]);
        for before in ["", "\x1B", "\x1B\x1B", "\x1B[", "\x1B[1", "\x1B[15;2"] {
            let typed = [before.as_bytes(), b" "].concat();
            assert_eq!(keys(&typed), [Key::Hold], "{before:?}");
        }
        assert_eq!(slowly(b"\x1B[q"), [Key::JogStep(-1), Key::Stop]);
        assert_eq!(slowly(b"\x1BOb"), [Key::StepBack]);
        let endless = [b"\x1B[".as_slice(), &[b'1'; 40], b"\x1B[A"].concat();
        assert_eq!(keys(&endless).last(), Some(&Key::Jog(Axis::Y, 1.0)));
    }
}
