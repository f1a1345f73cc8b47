//! What an operator asks of the machine: by a key, by a line of an events file, from a panel.

use super::settings::{Override, StepChange, SwitchChange};
use crate::control::Order;
use crate::machine::COORDINATES;
use serde::{Deserialize, Serialize};
use syncline_gcode::Axis;
use syncline_trajectory::path;

/// Something that an operator asks for. It takes effect in the next cycle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Ends a program stop or a tool change.
    CycleStart,
    /// Rests on the path.
    FeedHold,
    /// Ends a feed hold, also one that a single block came to.
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
    /// Moves axes while the path rests: at a feed hold, or at a program stop.
    Jog(Jog),
    /// Changes by how much [`Jog::Step`] moves.
    JogStep(StepChange),
    /// Stops on the path and ends the job.
    Stop,
}

/// A move beside the path. Speeds are in mm/s or °/s; without one, the axis' greatest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Jog {
    /// By the jog step that is set.
    Step {
        /// Which axis.
        #[serde(with = "letter")]
        axis: Axis,
        /// To which side.
        direction: Direction,
    },
    /// By a distance.
    By {
        /// Which axis.
        #[serde(with = "letter")]
        axis: Axis,
        /// With its sign, mm or degrees.
        distance: f64,
        /// How fast.
        speed: Option<f64>,
    },
    /// On and on, to the end of the travel or to the next feed hold.
    Continuous {
        /// Which axis.
        #[serde(with = "letter")]
        axis: Axis,
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
            Self::Line(positions) => path::Jog::Line(positions),
        })
    }
}

/// An axis as its letter.
mod letter {
    use serde::de::Error;
    use serde::{Deserialize, Deserializer, Serializer};
    use syncline_gcode::Axis;

    pub(super) fn serialize<S: Serializer>(axis: &Axis, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_char(axis.letter())
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Axis, D::Error> {
        let letter = char::deserialize(from)?;
        Axis::from_letter(letter)
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
                    axis: Axis::X,
                    direction: Direction::Negative,
                    speed: None,
                }),
                r#"{"jog":{"continuous":{"axis":"X","direction":"negative","speed":null}}}"#,
            ),
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
