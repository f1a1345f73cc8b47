//! What an operator asks of the machine: by a key, by a line of an events file, from a panel.

use super::settings::{Override, StepChange, SwitchChange};
use crate::control::{self, Layout, Order};
use crate::machine::{COORDINATES, OutputSwitch};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use strum::VariantNames;
use syncline_gcode::AxisLetter;
use syncline_trajectory::path;

/// Something that an operator asks for. It takes effect in the next cycle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Ends a program stop or a tool change; without a job runs the program that is loaded, unless one was interrupted: then it
    /// has to be said whether that goes on ([`Resume`](Self::Resume)) or begins anew ([`Run`](Self::Run)).
    CycleStart,
    /// Rests on the path.
    FeedHold,
    /// Ends a feed hold, also one that a single block came to. A program that a fault or a stop has interrupted, or lines
    /// that were typed in where it was held, is read anew and goes on from the block that was at work, once cycle start
    /// confirms what that begins with.
    Resume,
    /// [`Command::Resume`] while held, otherwise [`Command::FeedHold`].
    ToggleFeedHold,
    /// Changes whether the path rests at the end of every block.
    SingleBlock(SwitchChange),
    /// Changes whether the program waits at M1.
    OptionalStop(SwitchChange),
    /// Goes back to the beginning of the block and rests there.
    Retrace,
    /// Changes what of the programmed feeds is wanted.
    FeedOverride(Override),
    /// Changes what of the rapids' speed is wanted.
    RapidOverride(Override),
    /// Moves axes while the path rests: without a job, at a feed hold, or at a program stop.
    Jog(Jog),
    /// Renews the continuous jog of an axis that the same source began, as it has to within
    /// [`HOLD_TO_RUN`](crate::control::HOLD_TO_RUN); where there is none nothing changes.
    RenewJog(#[serde(with = "letter")] AxisLetter),
    /// Ends the continuous jog of an axis, whoever began it, as when a key is released; where there is none
    /// nothing changes.
    EndJog(#[serde(with = "letter")] AxisLetter),
    /// Changes by how much [`Jog::Step`] moves.
    JogStep(StepChange),
    /// Goes to a position in work coordinates, mm and degrees by letter, on a straight line and as
    /// fast as the axes can. [`Jog::Line`] does so in machine coordinates.
    GoTo([Option<f64>; COORDINATES]),
    /// Loads a program; it is read when it runs.
    Load(PathBuf),
    /// Runs the program that is loaded.
    Run {
        /// Begin at this line instead of the first, in the state that it finds there, which is told and
        /// waits for cycle start.
        from_line: Option<u32>,
    },
    /// Executes lines as they would stand in a program. Where a program is held it is left for them, and to be resumed.
    Mdi(String),
    /// Makes the position here have these work coordinates, mm and degrees: sets the work offset that
    /// is in effect (`G10 L20 P0`).
    SetWorkOffset([Option<f64>; COORDINATES]),
    /// Makes the position here have these work coordinates, mm, by the length of the tool in the
    /// spindle, which is compensated from then on (`G10 L10`, `G43`).
    SetToolLength([Option<f64>; COORDINATES]),
    /// Stops what moves and ends the job. A machine that was switched on for one job goes off.
    Stop,
    /// Enables the drives.
    Enable,
    /// Disables the drives, once what moves has come to rest.
    Disable,
    /// Homes these axes, by letter; without any, all but those that an operator homes by hand.
    Home([bool; COORDINATES]),
    /// Brings the drives back after a fault, without a motion.
    Reset,
    /// Switches an output of the machine by hand, where the machine rests. In a hold the program's own state is back
    /// before the path goes on; without a job the next one begins with it.
    Output {
        /// As the machine file names it.
        name: String,
        /// Whether it is on then.
        on: bool,
    },
    /// The command that an M-code of the user's runs has ended; of another call than the one that the program waits
    /// for it changes nothing.
    UserCodeEnded {
        /// As [`Event::UserCode`](control::Event::UserCode) has it.
        number: u32,
        /// What was wrong with it, if anything was, for the operator.
        failure: Option<String>,
    },
    /// Switches the machine off, once what moves has come to rest.
    SwitchOff,
}

impl Command {
    /// Whether it begins something, or has it go on, that a stop which comes behind it was to stop.
    pub(super) fn sets_going(&self) -> bool {
        match self {
            Self::CycleStart
            | Self::Resume
            | Self::ToggleFeedHold
            | Self::Retrace
            | Self::Jog(_)
            | Self::GoTo(_)
            | Self::Run { .. }
            | Self::Mdi(_)
            | Self::SetWorkOffset(_)
            | Self::SetToolLength(_)
            | Self::Home(_)
            | Self::Enable
            | Self::Reset
            | Self::Output { .. } => true,
            Self::FeedHold
            | Self::SingleBlock(_)
            | Self::OptionalStop(_)
            | Self::FeedOverride(_)
            | Self::RapidOverride(_)
            | Self::RenewJog(_)
            | Self::EndJog(_)
            | Self::JogStep(_)
            | Self::Load(_)
            | Self::Stop
            | Self::Disable
            | Self::UserCodeEnded { .. }
            | Self::SwitchOff => false,
        }
    }
}

/// Why a command is refused, and what to do.
#[derive(Clone, Debug, PartialEq, thiserror::Error, VariantNames)]
pub enum Refusal {
    /// The machine would not.
    #[error(transparent)]
    Machine(#[from] control::Refusal),
    /// It was to set something going, and a stop came behind it before it was looked at.
    #[error("a stop came behind it: command it again if it is still wanted")]
    Stopped,
    /// There is nothing to run.
    #[error("no program is loaded: load one first")]
    NoProgram,
    /// A program was interrupted, and it was not said from where to go on.
    #[error("a program was interrupted: resume takes up line {line}, run begins it anew")]
    Interrupted {
        /// The line of the block with which it can be resumed.
        line: u32,
    },
    /// The program was to begin in its middle and could not.
    #[error(
        "the program did not begin at line {line}, as was told: run it from another line, or from its beginning"
    )]
    NotAtLine {
        /// The line that was asked for.
        line: u32,
    },
    /// The program cannot be opened.
    #[error("cannot read {}: {why}", .file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// Why.
        why: String,
    },
    /// There is but one program, and it was given.
    #[error("the machine is on for one program: lines and offsets are for the console")]
    OneProgram,
    /// Lines are misspelt that were typed in where a program is held.
    #[error("{0}\nnothing of it is begun, and the program is held as before")]
    Misspelt(String),
    /// Neither offset nor length is to be set.
    #[error("no axis is named: say which ones, as in X0 Y0")]
    NoAxis,
    /// Positions are numbers.
    #[error("there is a number that is none")]
    NotANumber,
    /// No output is called so.
    #[error("the machine has no output \"{name}\"; {}", listed(.outputs))]
    NoSuchOutput {
        /// The name.
        name: String,
        /// Those of the machine.
        outputs: Vec<String>,
    },
    /// The spindle has a state of its own, which a typed line changes.
    #[error("output \"{0}\" is the spindle's: type M3, M4 or M5 for it")]
    OutputOfSpindle(String),
    /// The enable chain is closed while drives are enabled, by nobody's hand.
    #[error("output \"{0}\" is the enable chain: it is on while the drives are enabled")]
    OutputOfEnableChain(String),
    /// There is no tool whose length could be set.
    #[error(
        "no tool is in the spindle: load one with T and M6, or say which one is there by M61 Q"
    )]
    NoTool,
}

/// The place of an output that may be switched by hand.
pub(super) fn by_hand(layout: &Layout, name: &str) -> Result<usize, Refusal> {
    let outputs = &layout.outputs;
    let Some(place) = outputs.iter().position(|output| output.name == name) else {
        return Err(Refusal::NoSuchOutput {
            name: name.to_owned(),
            outputs: outputs.iter().map(|output| output.name.clone()).collect(),
        });
    };
    match outputs[place].switch {
        OutputSwitch::Spindle | OutputSwitch::SpindleReverse => {
            Err(Refusal::OutputOfSpindle(name.to_owned()))
        }
        OutputSwitch::EnableChain => Err(Refusal::OutputOfEnableChain(name.to_owned())),
        OutputSwitch::Program(_) | OutputSwitch::Mist | OutputSwitch::Flood => Ok(place),
    }
}

/// Which output a command switches by hand, by its place in the machine file, and whether on.
pub(super) fn switched(layout: &Layout, command: &Command) -> Option<(usize, bool)> {
    match command {
        Command::Output { name, on } => Some((by_hand(layout, name).ok()?, *on)),
        _ => None,
    }
}

/// The outputs that there are, for who named another one.
fn listed(outputs: &[String]) -> String {
    match outputs.is_empty() {
        true => "it has none: [[output]] names them".to_owned(),
        false => format!("allowed: {}", outputs.join(", ")),
    }
}

/// A move beside the path. Speeds are in mm/s or °/s; without one, the axis' greatest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Jog {
    /// By the jog step that is set.
    Step {
        /// Which axis.
        #[serde(with = "letter")]
        axis: AxisLetter,
        /// To which side.
        direction: Direction,
    },
    /// By a distance.
    By {
        /// Which axis.
        #[serde(with = "letter")]
        axis: AxisLetter,
        /// With its sign, mm or degrees.
        distance: f64,
        /// How fast.
        speed: Option<f64>,
    },
    /// On and on for as long as it is renewed ([`Command::RenewJog`]), to the end of the travel at most.
    Continuous {
        /// Which axis.
        #[serde(with = "letter")]
        axis: AxisLetter,
        /// To which side.
        direction: Direction,
        /// How fast.
        speed: Option<f64>,
    },
    /// To positions, each axis on its own: machine coordinates by letter, mm and degrees.
    To([Option<f64>; COORDINATES]),
    /// The same along a straight line.
    Line([Option<f64>; COORDINATES]),
}

/// A side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// To greater positions.
    Positive,
    /// To smaller ones.
    Negative,
}

impl Direction {
    /// Of a magnitude, the value on this side.
    #[must_use]
    pub fn of(self, magnitude: f64) -> f64 {
        match self {
            Self::Positive => magnitude,
            Self::Negative => -magnitude,
        }
    }
}

impl Jog {
    /// The order to the cycle; `step` is the jog step that is set.
    pub(super) fn order(self, step: f64) -> Order {
        Order::Jog(match self {
            Self::Step { axis, direction } => path::Jog::Step {
                axis: axis.index(),
                distance: direction.of(step),
                speed: f64::INFINITY,
            },
            Self::By {
                axis,
                distance,
                speed,
            } => path::Jog::Step {
                axis: axis.index(),
                distance,
                speed: speed.unwrap_or(f64::INFINITY),
            },
            Self::Continuous {
                axis,
                direction,
                speed,
            } => path::Jog::Continuous {
                axis: axis.index(),
                velocity: direction.of(speed.unwrap_or(f64::INFINITY)),
            },
            Self::To(positions) => path::Jog::To(positions),
            Self::Line(positions) => path::Jog::Line {
                to: positions,
                speed: f64::INFINITY,
            },
        })
    }
}

/// An axis as its letter.
mod letter {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};
    use syncline_gcode::AxisLetter;

    pub(super) fn serialize<S: Serializer>(axis: &AxisLetter, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_char(axis.letter())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<AxisLetter, D::Error> {
        let letter = char::deserialize(from)?;
        AxisLetter::from_letter(letter)
            .ok_or_else(|| D::Error::custom(format!("`{letter}` is no axis: X Y Z A B C U V W")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_read_as_they_are_written() {
        let mut to = [None; COORDINATES];
        to[1] = Some(20.0);
        for (command, text) in [
            (Command::CycleStart, r#""cycle_start""#),
            (Command::ToggleFeedHold, r#""toggle_feed_hold""#),
            (
                Command::FeedOverride(Override::By(-10.0)),
                r#"{"feed_override":{"by":-10.0}}"#,
            ),
            (
                Command::RapidOverride(Override::To(80.0)),
                r#"{"rapid_override":{"to":80.0}}"#,
            ),
            (
                Command::SingleBlock(SwitchChange::To(true)),
                r#"{"single_block":{"to":true}}"#,
            ),
            (
                Command::OptionalStop(SwitchChange::Toggle),
                r#"{"optional_stop":"toggle"}"#,
            ),
            (
                Command::JogStep(StepChange::Greater),
                r#"{"jog_step":"greater"}"#,
            ),
            (
                Command::Jog(Jog::Continuous {
                    axis: AxisLetter::X,
                    direction: Direction::Negative,
                    speed: None,
                }),
                r#"{"jog":{"continuous":{"axis":"X","direction":"negative","speed":null}}}"#,
            ),
            (
                Command::Output {
                    name: "clamp".to_owned(),
                    on: true,
                },
                r#"{"output":{"name":"clamp","on":true}}"#,
            ),
            (Command::RenewJog(AxisLetter::X), r#"{"renew_jog":"X"}"#),
            (Command::EndJog(AxisLetter::Z), r#"{"end_jog":"Z"}"#),
            (
                Command::Jog(Jog::To(to)),
                r#"{"jog":{"to":[null,20.0,null,null,null,null,null,null,null]}}"#,
            ),
        ] {
            assert_eq!(serde_json::to_string(&command).unwrap(), text);
            assert_eq!(serde_json::from_str::<Command>(text).unwrap(), command);
        }
        let refused = r#"{"jog":{"step":{"axis":"Q","direction":"positive"}}}"#;
        let error = serde_json::from_str::<Command>(refused).unwrap_err();
        assert!(error.to_string().contains("`Q` is no axis"), "{error}");
    }
}
