//! M-codes of the user's that run a command outside: the path rests until it is known what came of it.
//!
//! The cycle runs nothing. It tells that the path has come to such a code ([`Event::UserCode`]), and counts how long
//! nobody says how that ended ([`Order::UserCodeEnded`](super::Order::UserCodeEnded)). A command that fails, or takes
//! longer than it may, is a pause: an operator goes on, or stops. What is said of a call that is over changes nothing.

use super::{Controller, Event, Pause};
use syncline_canopen::time::Duration;

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
    /// The one that the path rests for.
    open: Option<Open>,
}

/// A call whose end is awaited.
#[derive(Clone, Copy, Debug)]
struct Open {
    /// The cycle in which it began.
    since: u64,
    /// Whether the command has ended well, once it has ended.
    ended: Option<bool>,
}

impl UserCalls {
    /// The path rests for none.
    pub(super) fn close(&mut self) {
        self.open = None;
    }

    /// Takes what came of the call with that number.
    pub(super) fn end(&mut self, number: u32, ok: bool) {
        if let Some(open) = self.open.as_mut().filter(|_| number == self.number) {
            open.ended.get_or_insert(ok);
        }
    }
}

impl<const N: usize> Controller<N> {
    /// The path rests until the command of the code has ended, which may take so long.
    pub(super) fn await_user_code(&mut self, call: UserCall, within: Duration, line: u32) {
        let Some(open) = self.calls.open else {
            self.calls.number += 1;
            self.calls.open = Some(Open {
                since: self.cycle,
                ended: None,
            });
            let number = self.calls.number;
            return self.tell(Event::UserCode { number, call, line });
        };
        let waited = self.layout.cycle * (self.cycle - open.since) as u32;
        match open.ended {
            Some(true) => self.executor.pass(),
            None if waited < within => {}
            Some(false) | None => {
                self.pause_told = true;
                let reason = Pause::UserCode(call.code);
                self.tell(Event::Paused { line, reason });
            }
        }
    }
}
