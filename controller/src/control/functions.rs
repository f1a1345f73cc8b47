//! What M-codes switch: the spindle, the coolant, the tool, outputs.
//!
//! An M-code between two moves is a waypoint of the path: the path does not stop there, and what the
//! M-code switches is switched with the first setpoint behind it. So between the M-codes of a program
//! there is what the program has between them, dwells too. What is to be switched comes into the
//! cycle in the program's order and apart from the plan, which is replaced as an operator acts: it is
//! never replaced, waits here for the path to come to its waypoint, and is executed once.

use std::collections::VecDeque;
use std::fmt;
use syncline_gcode::{Coolant, Output, Spindle, Turning};

/// M-codes that the cycle has room for. Where a program has more without a stop, the path rests for
/// them to be executed.
pub const SWITCHES: usize = 16_384;

/// M-codes that are executed in a cycle at most; where more stand at one place, the others follow.
pub(super) const MOST_SWITCHED: usize = 64;

/// What an M-code switches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Switch {
    /// The spindle: M3, M4, M5, S.
    Spindle(Spindle),
    /// The coolant: M7, M8, M9.
    Coolant(Coolant),
    /// The tool that M6 loaded.
    Tool(u32),
    /// An M-code for the machine's outputs, and its line.
    Output(u32, Output),
}

/// What the program has switched.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MachineFunctions {
    /// M3, M4, M5, S.
    pub spindle: Spindle,
    /// M7, M8, M9.
    pub coolant: Coolant,
    /// The tool that M6 loaded.
    pub tool: u32,
}

impl MachineFunctions {
    fn switch(&mut self, switch: Switch) {
        match switch {
            Switch::Spindle(spindle) => self.spindle = spindle,
            Switch::Coolant(coolant) => self.coolant = coolant,
            Switch::Tool(tool) => self.tool = tool,
            Switch::Output(..) => {}
        }
    }
}

/// What has been switched, and what is to be as soon as the path comes to its waypoint.
#[derive(Clone)]
pub(super) struct Switches {
    pub(super) functions: MachineFunctions,
    /// How many were executed.
    executed: u32,
    waiting: VecDeque<Switch>,
}

impl Switches {
    pub(super) fn new() -> Self {
        Self {
            functions: MachineFunctions::default(),
            executed: 0,
            waiting: VecDeque::with_capacity(SWITCHES),
        }
    }

    /// Forgets what waits: another path begins.
    pub(super) fn restart(&mut self) {
        self.executed = 0;
        self.waiting.clear();
    }

    /// Switches off what a job that is stopped leaves on: spindle and coolant.
    pub(super) fn stop(&mut self, mut tell: impl FnMut(Switch)) {
        let MachineFunctions {
            spindle, coolant, ..
        } = self.functions;
        let turning = Turning::Off;
        for (is_on, off) in [
            (
                spindle.turning != turning,
                Switch::Spindle(Spindle { turning, ..spindle }),
            ),
            (
                coolant != Coolant::default(),
                Switch::Coolant(Coolant::default()),
            ),
        ] {
            if is_on {
                self.functions.switch(off);
                tell(off);
            }
        }
    }

    /// Takes what is switched at the next waypoint; false if there is no room for it.
    pub(super) fn push(&mut self, switch: Switch) -> bool {
        let room = self.waiting.len() < SWITCHES;
        if room {
            self.waiting.push_back(switch);
        }
        room
    }

    /// Whether any at the first `waypoints` of the path are still to be executed.
    pub(super) fn lag(&self, waypoints: u32) -> bool {
        self.executed < waypoints && !self.waiting.is_empty()
    }

    /// Executes the next M-code of those at the first `waypoints` of the path.
    pub(super) fn next(&mut self, waypoints: u32) -> Option<Switch> {
        let due = self.executed < waypoints;
        let switch = due.then(|| self.waiting.pop_front()).flatten()?;
        self.executed += 1;
        self.functions.switch(switch);
        Some(switch)
    }
}

impl fmt::Debug for Switches {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Switches")
            .field("functions", &self.functions)
            .field("executed", &self.executed)
            .field("waiting", &self.waiting.len())
            .finish()
    }
}
