//! Runs the commands of M-codes of the user's, M100 to M199, and says how they end.
//!
//! A thread of its own does, so that nothing waits for a program that somebody else wrote. A command has standard input
//! and output of its own, which are nothing, and a process group of its own: Ctrl-C at the terminal is not for it. It is
//! killed with all that it has started when it fails, when its time is over, or when the job ends before it does. What one that
//! ended well has left running is the user's.

use crate::control::{Event as MachineEvent, UserCall};
use crate::machine::{Machine, UserCode};
use crate::run::Timeline;
use crate::session::{Command, Event, NotTaken, Operator, Session, Subscription};
use rustix::process::{Pid, Signal, kill_process_group};
use std::io;
use std::os::unix::process::CommandExt;
use std::process::{Child, Command as Process, Stdio};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// How often it is looked whether a command has ended.
const LOOK: Duration = Duration::from_millis(5);

/// What runs the commands of a machine.
pub(super) struct UserCodes(Option<JoinHandle<()>>);

impl UserCodes {
    /// Has the commands of a machine run from now on, if it has any.
    pub(super) fn start<T: Timeline>(
        session: &mut Session<T>,
        machine: &Machine,
    ) -> io::Result<Self> {
        let codes = machine.user_codes.clone();
        if codes.is_empty() {
            return Ok(Self(None));
        }
        session.await_user_codes();
        let (operator, events) = (session.operator("user codes"), session.subscribe());
        let thread = thread::Builder::new().name("user codes".into());
        let thread = thread.spawn(move || attend(&codes, &operator, &events))?;
        Ok(Self(Some(thread)))
    }

    /// Once the session is over: no command is left at work.
    pub(super) fn finish(self) {
        // Where it panicked, that is written.
        let _ = self.0.map(JoinHandle::join);
    }
}

fn attend(codes: &[UserCode], operator: &Operator, events: &Subscription) {
    let mut running: Option<Running<'_>> = None;
    loop {
        let patience = running.as_ref().map_or(Duration::MAX, |_| LOOK);
        let Ok(event) = events.wait(patience) else {
            return;
        };
        match event {
            Some(Event::Machine(MachineEvent::UserCode { number, call, .. })) => {
                let code = codes.iter().find(|code| code.code == call.code);
                running = code.and_then(|code| match Running::begin(number, code, call) {
                    Ok(running) => Some(running),
                    Err(error) => {
                        let what = format!("cannot be run: {error}");
                        say(operator, number, Some(code.failed(&what)));
                        None
                    }
                });
            }
            // Dropped, it is killed.
            Some(Event::Machine(MachineEvent::JobOver { .. })) => running = None,
            _ => {}
        }
        if let Some(over) = &mut running
            && let Some(ended) = over.ended()
        {
            say(operator, over.number, ended.err());
            running = None;
        }
    }
}

/// Says how the command of a call has ended; that a crowd of others commands the machine is no reason not to.
fn say(operator: &Operator, number: u32, failure: Option<String>) {
    let command = Command::UserCodeEnded { number, failure };
    while operator.command(command.clone()) == Err(NotTaken::Busy) {
        thread::sleep(LOOK);
    }
}

impl UserCode {
    fn failed(&self, what: &str) -> String {
        format!("M{}: {} {what}", self.code, self.command[0])
    }
}

/// A command that runs. Dropped, it is killed with all that it has started, unless it has ended well.
struct Running<'a> {
    number: u32,
    code: &'a UserCode,
    child: Child,
    until: Instant,
    ended_well: bool,
}

impl<'a> Running<'a> {
    fn begin(number: u32, code: &'a UserCode, call: UserCall) -> io::Result<Self> {
        let words = [call.p, call.q].map(|word| word.map_or_else(String::new, |it| it.to_string()));
        let child = Process::new(&code.command[0])
            .args(&code.command[1..])
            .args(words)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .process_group(0)
            .spawn()?;
        let until = Instant::now() + code.within;
        Ok(Self {
            number,
            code,
            child,
            until,
            ended_well: false,
        })
    }

    /// How it has ended, once it has, or its time is over; what was wrong with it as an error.
    fn ended(&mut self) -> Option<Result<(), String>> {
        match self.child.try_wait() {
            Ok(Some(status)) if status.success() => {
                self.ended_well = true;
                Some(Ok(()))
            }
            Ok(Some(status)) => Some(Err(self.code.failed(&format!("has ended with {status}")))),
            Ok(None) if Instant::now() < self.until => None,
            Ok(None) => {
                let time = self.code.within.as_secs_f64();
                Some(Err(self.code.failed(&format!("took longer than {time} s"))))
            }
            Err(error) => Some(Err(self.code.failed(&format!("is lost: {error}")))),
        }
    }
}

impl Drop for Running<'_> {
    fn drop(&mut self) {
        if self.ended_well {
            return;
        }
        // Of its group there may be nothing left to be killed.
        let _ = kill_process_group(Pid::from_child(&self.child), Signal::KILL);
        let _ = self.child.wait();
    }
}
