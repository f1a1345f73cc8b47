//! What the program feeds to the cycle, and what happens where the path rests for it.

use super::{InputWait, Pause, PointToPoint, ProbeMove, Switch, ThreadMove, UserCall};
use syncline_canopen::time::Duration;
use syncline_gcode::TakenInput;
use syncline_trajectory::path::Command as PathCommand;

/// What the program feeds to the cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(clippy::large_enum_variant)] // a ring's slots are all of one size
pub enum Instruction<const N: usize> {
    /// The next command of the plan, but for its marks.
    Plan(PathCommand<N>),
    /// The next mark of the plan, and what it stands for.
    Mark {
        /// As in [`PathCommand::Mark`].
        item: u64,
        /// As in [`PathCommand::Mark`].
        mark: u32,
        /// What happens once the path rests there.
        stop: StopPoint,
    },
    /// What the next [`StopPoint::Probe`] asks for; it comes before the plan leads there.
    Probe(ProbeMove<N>),
    /// What the next [`StopPoint::Thread`] asks for; it comes before the plan leads there.
    Thread(ThreadMove<N>),
    /// What the next [`StopPoint::Home`] homes; it comes before the plan leads there.
    Home {
        /// Counts homings, probings and threads of a job, from 1.
        number: u32,
        /// By coordinate.
        axes: [bool; N],
    },
    /// The plan behind the probing, homing or thread with this number begins; what came before it is of no use any more.
    Found(u32),
    /// What is switched at the next waypoint of the plan; it comes before the plan leads there.
    Switch {
        /// Its line.
        line: u32,
        /// What.
        switch: Switch,
    },
}

/// What happens at a mark of the plan. The path rests there until that is done, so that no
/// replacement of the plan, whenever it comes, leaves it out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StopPoint {
    /// Rest with drives enabled until an operator goes on.
    Pause {
        /// Why.
        reason: Pause,
        /// Program line.
        line: u32,
    },
    /// The job is complete.
    End,
    /// The path goes on at once: so many M-codes have come without a stop that there is no room for more
    /// of them.
    Rest,
    /// The path goes on once an input is there.
    AwaitInput {
        /// Which one, and what it has to do.
        wait: InputWait,
        /// The program asks at once what came of it, so that it goes on where the input did not come.
        asks: bool,
        /// Program line.
        line: u32,
    },
    /// The path goes on once the spindle is where it is oriented to.
    Orient {
        /// Program line.
        line: u32,
    },
    /// The path goes on at once, and what an input is there is kept.
    TakeInput {
        /// Which one.
        input: TakenInput,
        /// Program line.
        line: u32,
    },
    /// The path goes on once axes beside it are where they go.
    PointToPoint {
        /// Where they go.
        motion: PointToPoint,
        /// Program line.
        line: u32,
    },
    /// The path goes on once the command of an M-code of the user's has ended.
    UserCode {
        /// The code.
        call: UserCall,
        /// How long its command may take.
        within: Duration,
        /// Program line.
        line: u32,
    },
    /// The program probes, and goes on with what is found.
    Probe {
        /// Program line.
        line: u32,
    },
    /// The axes go along a line in step with the spindle, and the program goes on behind it.
    Thread {
        /// Program line.
        line: u32,
    },
    /// The program homes axes, and goes on from where they are then.
    Home {
        /// Program line.
        line: u32,
    },
    /// The program goes on with what the inputs and outputs are.
    ReadSignals {
        /// As in [`SignalLevels::number`](super::SignalLevels::number).
        number: u32,
        /// Program line.
        line: u32,
    },
    /// What comes next in the program cannot be run: a fault.
    Broken,
}

impl StopPoint {
    /// Whether axes move there beside the path: nothing leads back over that.
    pub(super) fn leaves_path(self) -> bool {
        matches!(
            self,
            Self::PointToPoint { .. }
                | Self::Probe { .. }
                | Self::Thread { .. }
                | Self::Home { .. }
        )
    }

    /// The line of the block that is at work while the path rests there.
    #[must_use]
    pub fn works_on(&self) -> Option<u32> {
        match *self {
            Self::AwaitInput { line, .. }
            | Self::Orient { line }
            | Self::TakeInput { line, .. }
            | Self::PointToPoint { line, .. }
            | Self::UserCode { line, .. }
            | Self::ReadSignals { line, .. }
            | Self::Probe { line }
            | Self::Thread { line }
            | Self::Home { line } => Some(line),
            Self::Pause { .. } | Self::End | Self::Rest | Self::Broken => None,
        }
    }
}
