//! Keys on the terminal while a program runs: each is a command to the session.

use crate::session::{
    Command, Direction, Jog, NotTaken, Operator, Override, Status, StatusView, StepChange,
    SwitchChange,
};
use rustix::io::{Errno, read};
use rustix::process::getpgrp;
use rustix::termios::{
    LocalModes, OptionalActions, SpecialCodeIndex, Termios, isatty, tcgetattr, tcgetpgrp, tcsetattr,
};
use std::io::{self, stdin};
use std::thread;
use std::time::{Duration, Instant};
use syncline_gcode::AxisLetter;

/// For the operator at the terminal.
pub(super) const HELP: &str = "keys: space feed hold and resume, + - feed, < > rapid, s single block, \
                               o optional stop, b retrace, q stop, Enter cycle start at a program stop; while \
                               held: arrows and page keys jog X Y Z, [ ] by less or more";

/// How much an override changes by a key, %.
const STEP: f64 = 10.0;

/// What a character commands.
pub(super) fn command(byte: u8) -> Option<Command> {
    Some(match byte {
        b' ' => Command::ToggleFeedHold,
        b'+' | b'=' => Command::FeedOverride(Override::By(STEP)),
        b'-' => Command::FeedOverride(Override::By(-STEP)),
        b'>' => Command::RapidOverride(Override::By(STEP)),
        b'<' => Command::RapidOverride(Override::By(-STEP)),
        b's' => Command::SingleBlock(SwitchChange::Toggle),
        b'o' => Command::OptionalStop(SwitchChange::Toggle),
        b'b' => Command::Retrace,
        b'[' => Command::JogStep(StepChange::Smaller),
        b']' => Command::JogStep(StepChange::Greater),
        b'q' => Command::Stop,
        b'\n' | b'\r' => Command::CycleStart,
        _ => return None,
    })
}

/// What a key without a character commands; a terminal sends it behind escape and `[`, or `O`.
pub(super) fn command_of_sequence(sequence: &[u8]) -> Option<Command> {
    let (axis, direction) = match sequence {
        b"C" => (AxisLetter::X, Direction::Positive),
        b"D" => (AxisLetter::X, Direction::Negative),
        b"A" => (AxisLetter::Y, Direction::Positive),
        b"B" => (AxisLetter::Y, Direction::Negative),
        b"5~" => (AxisLetter::Z, Direction::Positive),
        b"6~" => (AxisLetter::Z, Direction::Negative),
        _ => return None,
    };
    Some(Command::Jog(Jog::Step { axis, direction }))
}

/// Whether a key's command is wanted as things are. A key that is held repeats itself: of an axis that still
/// moves no step is, as the steps would pile up and be run after the key was released.
pub(super) fn is_wanted(command: &Command, status: &Status) -> bool {
    match command {
        Command::Jog(Jog::Step { axis, .. }) => status.velocity[axis.index()] == 0.0,
        _ => true,
    }
}

/// The longest time from a key to its repetition: terminals wait for up to half a second before the first one.
pub(super) const REPEATS: Duration = Duration::from_millis(700);

/// What a key's command comes to where the key may only have repeated itself, as it is held: while what moves still brakes,
/// a space that is held would let it go on, and Enter would end the next pause.
pub(super) fn of_repeated(command: Command) -> Option<Command> {
    match command {
        Command::ToggleFeedHold => Some(Command::FeedHold),
        Command::CycleStart => None,
        command => Some(command),
    }
}

/// The command of the last key, and when that came.
#[derive(Debug, Default)]
struct LastKey(Option<(Command, Instant)>);

impl LastKey {
    /// What a key's command comes to behind the last one.
    fn followed_by(&mut self, command: Command, now: Instant) -> Option<Command> {
        let last = self.0.replace((command.clone(), now));
        match last {
            Some((same, at)) if same == command && now - at < REPEATS => of_repeated(command),
            _ => Some(command),
        }
    }
}

/// Takes apart what a terminal sends.
#[derive(Debug, Default)]
struct Decoder {
    /// Since an escape, that included. A terminal sends it in one burst, an operator does not.
    sequence: Vec<u8>,
}

impl Decoder {
    /// What the keys of what was read command; that is nothing where a tenth of a second brought
    /// nothing.
    fn commands<'a>(&'a mut self, read: &'a [u8]) -> impl Iterator<Item = Command> + 'a {
        if read.is_empty() {
            self.sequence.clear();
        }
        read.iter().filter_map(|byte| self.command(*byte))
    }

    /// The command of the key that a byte completes.
    fn command(&mut self, byte: u8) -> Option<Command> {
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
            return command(byte);
        }
        self.sequence.push(byte);
        if self.sequence.len() == 2 || byte < b'@' {
            // Longer than any key's.
            if self.sequence.len() > 16 {
                self.sequence.clear();
            }
            return None;
        }
        let command = command_of_sequence(&self.sequence[2..]);
        self.sequence.clear();
        command
    }
}

/// The terminal hands over every key at once until this is dropped, also by a panic.
pub(super) struct Keys {
    before: Termios,
}

impl Keys {
    /// Begins to listen for the operator; `None` where standard input is not this process's
    /// terminal.
    ///
    /// # Errors
    /// The terminal cannot be set.
    pub(super) fn listen(operator: Operator, view: StatusView) -> io::Result<Option<Self>> {
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
        thread::spawn(move || hand_over(&operator, &view));
        Ok(Some(Self { before }))
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        // The terminal may be gone.
        let _ = tcsetattr(stdin(), OptionalActions::Now, &self.before);
    }
}

/// Commands what is typed until the session is over.
fn hand_over(operator: &Operator, view: &StatusView) {
    let mut bytes = [0; 16];
    let mut decoder = Decoder::default();
    let mut last = LastKey::default();
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
        for command in decoder.commands(&bytes[..count]) {
            let Some(command) = last.followed_by(command, Instant::now()) else {
                continue;
            };
            if !is_wanted(&command, &view.get()) {
                continue;
            }
            while let Err(reason) = operator.command(command.clone()) {
                match reason {
                    NotTaken::Busy => thread::sleep(Duration::from_millis(1)),
                    NotTaken::Over => return,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn keys(bytes: &[u8]) -> Vec<Command> {
        Decoder::default().commands(bytes).collect()
    }

    fn jog(axis: AxisLetter, direction: Direction) -> Command {
        Command::Jog(Jog::Step { axis, direction })
    }

    /// What a person types slowly: each byte, then nothing for a while.
    fn slowly(bytes: &[u8]) -> Vec<Command> {
        let mut decoder = Decoder::default();
        let mut keys = Vec::new();
        for byte in bytes {
            keys.extend(decoder.commands(&[*byte]));
            assert_eq!(decoder.commands(&[]).next(), None);
        }
        keys
    }

    #[test]
    fn a_key_that_is_held_lets_nothing_go() {
        let begin = Instant::now();
        let mut last = LastKey::default();
        let mut at = |ms, command| last.followed_by(command, begin + Duration::from_millis(ms));
        let space = || Command::ToggleFeedHold;
        assert_eq!(at(0, space()), Some(space()));
        for ms in [500, 530, 1_200] {
            assert_eq!(at(ms, space()), Some(Command::FeedHold), "{ms}");
        }
        assert_eq!(at(2_000, space()), Some(space()));
        assert_eq!(at(2_010, Command::Stop), Some(Command::Stop));
        assert_eq!(at(2_020, space()), Some(space()));
        assert_eq!(at(2_030, Command::CycleStart), Some(Command::CycleStart));
        assert_eq!(at(2_530, Command::CycleStart), None);
        assert_eq!(at(2_560, Command::CycleStart), None);
        assert_eq!(at(3_300, Command::CycleStart), Some(Command::CycleStart));
    }

    #[test]
    fn arrows_and_page_keys_jog() {
        let [right, down] = [
            jog(AxisLetter::X, Direction::Positive),
            jog(AxisLetter::Y, Direction::Negative),
        ];
        assert_eq!(keys(b"\x1B[C\x1BOB"), [right, down]);
        let [up, down] =
            [Direction::Positive, Direction::Negative].map(|to| jog(AxisLetter::Z, to));
        assert_eq!(
            keys(b"\x1B[5~]\x1B[6~"),
            [up, Command::JogStep(StepChange::Greater), down]
        );
    }

    #[test]
    fn keys_that_mean_nothing_hide_none_that_do() {
        // F5, shift and an arrow, delete.
        assert_eq!(keys(b"\x1B[15~\x1B[1;2C\x1B[3~b"), [Command::Retrace]);
        for before in ["", "\x1B", "\x1B\x1B", "\x1B[", "\x1B[1", "\x1B[15;2"] {
            let typed = [before.as_bytes(), b" "].concat();
            assert_eq!(keys(&typed), [Command::ToggleFeedHold], "{before:?}");
        }
        assert_eq!(
            slowly(b"\x1B[q"),
            [Command::JogStep(StepChange::Smaller), Command::Stop]
        );
        assert_eq!(slowly(b"\x1BOb"), [Command::Retrace]);
        let endless = [b"\x1B[".as_slice(), &[b'1'; 40], b"\x1B[A"].concat();
        assert_eq!(
            keys(&endless).last(),
            Some(&jog(AxisLetter::Y, Direction::Positive))
        );
    }
}
