//! The states of a machine as its operators have it, and what may be asked of it in each.
//!
//! This is the table of the session. Whoever orders something is asked here in the cycle in which it
//! would take effect; what is refused names the state and what to do. `docs/design.md` shows the
//! table, and a test holds the two together.

use serde::{Deserialize, Serialize};
use std::fmt;

/// What state the machine is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Nothing is sent: the machine is off for good.
    Off,
    /// The drives are found, set up and enabled, and gantries taken square that stand a little askew.
    Starting,
    /// At rest, drives enabled, without a job.
    Ready,
    /// Axes are homed.
    Homing,
    /// Axes are jogged, or go to a position; no job is at work.
    Jogging,
    /// Lines that were typed in are at work.
    Mdi,
    /// A program is at work.
    Running,
    /// A job rests until an operator goes on: a feed hold, a single block or a program stop.
    Held,
    /// Coming to rest, and going down where the drives are to be disabled or switched off.
    Stopping,
    /// A fault stopped the machine; its drives are disabled.
    Faulted,
    /// The drives are disabled, on demand.
    Disabled,
}

/// What may be asked of a machine, as far as it matters to its state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Begin a program.
    Begin,
    /// Execute lines that are typed in, or set an offset or a tool's length here. Where a program is held it is left for
    /// them.
    TypedLines,
    /// Home axes.
    Home,
    /// Move axes by jogs, or to a position.
    Jog,
    /// Rest on the path; a homing ends by it.
    FeedHold,
    /// Go on, or change how the job at work goes on: resume, cycle start, retrace.
    GoOn,
    /// Stop what moves; the job is over.
    Stop,
    /// Enable the drives.
    Enable,
    /// Disable the drives.
    Disable,
    /// Bring the drives back after a fault.
    Reset,
    /// Switch the machine off.
    SwitchOff,
    /// Switch an output by hand.
    Switch,
    /// Change a setting.
    Set,
}

impl State {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Off,
        Self::Starting,
        Self::Ready,
        Self::Homing,
        Self::Jogging,
        Self::Mdi,
        Self::Running,
        Self::Held,
        Self::Stopping,
        Self::Faulted,
        Self::Disabled,
    ];

    /// Whether the machine does in this state what is asked.
    #[must_use]
    pub const fn allows(self, request: Request) -> bool {
        use State::{Disabled, Faulted, Held, Homing, Jogging, Mdi, Off, Ready, Running, Starting};
        match request {
            Request::Begin | Request::Home => matches!(self, Ready),
            Request::TypedLines => matches!(self, Ready | Held),
            Request::Jog | Request::Switch => matches!(self, Ready | Jogging | Held),
            Request::FeedHold => matches!(self, Homing | Jogging | Mdi | Running | Held),
            Request::GoOn => matches!(self, Mdi | Running | Held),
            Request::Enable => matches!(self, Disabled),
            Request::Disable => {
                matches!(
                    self,
                    Starting | Ready | Homing | Jogging | Mdi | Running | Held
                )
            }
            Request::Reset => matches!(self, Faulted),
            Request::Stop | Request::SwitchOff | Request::Set => !matches!(self, Off),
        }
    }

    /// What an operator does to get on from this state.
    #[must_use]
    pub const fn way_on(self) -> &'static str {
        match self {
            Self::Off => "start the command again",
            Self::Starting => "wait until the machine is ready",
            Self::Ready => "run a program, type a line, home, jog or go to a position",
            Self::Homing => "wait until the axes are homed; feed hold or stop ends that",
            Self::Jogging => "feed hold stops the axes",
            Self::Mdi | Self::Running => "feed hold rests on the path, stop ends the job",
            Self::Held => "resume goes on, at a pause cycle start; stop ends the job",
            Self::Stopping => "wait until the machine rests",
            Self::Faulted => "mend the cause, then reset",
            Self::Disabled => "enable the drives",
        }
    }
}

impl Request {
    /// All of them.
    pub const ALL: [Self; 13] = [
        Self::Begin,
        Self::TypedLines,
        Self::Home,
        Self::Jog,
        Self::FeedHold,
        Self::GoOn,
        Self::Stop,
        Self::Enable,
        Self::Disable,
        Self::Reset,
        Self::SwitchOff,
        Self::Switch,
        Self::Set,
    ];
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Off => "off",
            Self::Starting => "starting",
            Self::Ready => "ready",
            Self::Homing => "homing",
            Self::Jogging => "jogging",
            Self::Mdi => "MDI",
            Self::Running => "running",
            Self::Held => "held",
            Self::Stopping => "stopping",
            Self::Faulted => "stopped by a fault",
            Self::Disabled => "disabled",
        })
    }
}

impl fmt::Display for Request {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Begin => "new program",
            Self::TypedLines => "typed lines or offsets",
            Self::Home => "homing",
            Self::Jog => "jog",
            Self::FeedHold => "feed hold",
            Self::GoOn => "going on or back",
            Self::Stop => "stop",
            Self::Enable => "enabling",
            Self::Disable => "disabling",
            Self::Reset => "reset",
            Self::SwitchOff => "switching off",
            Self::Switch => "switching of outputs by hand",
            Self::Set => "setting",
        })
    }
}

/// What was asked is not possible in the state that the machine is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no {request} while the machine is {state}: {}", .state.way_on())]
pub struct NotNow {
    /// What was asked.
    pub request: Request,
    /// The state.
    pub state: State,
}
