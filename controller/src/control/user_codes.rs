//! M-codes of the user's that run a command outside: the path rests until it is known what came of it.
//!
//! The cycle runs nothing. It tells that the path has come to such a code ([`Event::UserCode`]), and counts how long
//! nobody says how that ended ([`Order::UserCodeEnded`](super::Order::UserCodeEnded)). A command that fails, or takes
//! longer than it may, is a pause: an operator goes on, or stops. What is said of a call that is over changes nothing.
//! Where the path is gone back over and on again the code is not run twice: what came of it counts as it did.

use super::{Controller, Event, Pause};
use syncline_canopen::time::Duration;

/// So much later than a command's time is over nobody is waited for who is to say so, with the reason.
pub(super) const GRACE: Duration = Duration::from_millis(500);

/// An M-code of the user's with its words.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UserCall {
    /// 100 … 199.
    pub code: u16,
    /// Its P word.
    pub p: Option<f64>,
    /// Its Q word.
    pub q: Option<f64>,
}

/// The calls of a machine so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct UserCalls {
    /// How many there were: the number of the last one.
    number: u32,
    /// The last one of the job at work.
    last: Option<Call>,
}

/// A call.
#[derive(Clone, Copy, Debug)]
struct Call {
    /// The mark of the plan that it stands at.
    mark: u32,
    /// The cycle in which it began.
    since: u64,
    /// Whether the command has ended well, once it has ended.
    ended: Option<bool>,
}

impl UserCalls {
    /// Another job begins.
    pub(super) fn restart(&mut self) {
        self.last = None;
    }

    /// The cycle in which the last one of the job at work began.
    pub(super) fn since(&self) -> Option<u64> {
        self.last.map(|last| last.since)
    }

    /// Takes what came of the call with that number.
    pub(super) fn end(&mut self, number: u32, ok: bool) {
        if let Some(last) = self.last.as_mut().filter(|_| number == self.number) {
            last.ended.get_or_insert(ok);
        }
    }
}

impl<const N: usize> Controller<N> {
    /// The path rests until the command of the code has ended, which may take so long.
    pub(super) fn await_user_code(&mut self, call: UserCall, within: Duration, line: u32) {
        let Some((mark, _)) = self.stop_point else {
            return;
        };
        // Marks count up along the program.
        let Some(last) = self.calls.last.filter(|last| last.mark >= mark) else {
            self.calls.number += 1;
            self.calls.last = Some(Call {
                mark,
                since: self.cycle,
                ended: None,
            });
            let number = self.calls.number;
            return self.tell(Event::UserCode { number, call, line });
        };
        let waited = self.layout.cycle * (self.cycle - last.since) as u32;
        match last.ended {
            _ if mark < last.mark => self.executor.pass(),
            Some(true) => self.executor.pass(),
            None if waited < within + GRACE => {}
            Some(false) | None => {
                self.pause_told = true;
                let reason = Pause::UserCode(call.code);
                self.tell(Event::Paused { line, reason });
            }
        }
    }
}
