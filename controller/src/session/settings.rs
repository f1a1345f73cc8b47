//! What an operator has set, and what of a command it takes to reach the cycle.

use super::command::Command;
use crate::control::Order;
use serde::{Deserialize, Serialize};

/// Greatest feed override, %.
pub const MOST_FEED: f64 = 200.0;
/// Greatest rapid override, %.
pub const MOST_RAPID: f64 = 100.0;
/// Least override that is not 0, %.
pub const LEAST: f64 = 0.1;

/// The jog steps that an operator goes through, mm or degrees.
const JOG_STEPS: [f64; 5] = [0.01, 0.1, 1.0, 10.0, 100.0];

/// What an operator has set. Every console shows the same.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Part of the programmed feeds, 0…200 %.
    pub feed_override: f64,
    /// Part of the rapids' speed, 0…100 %.
    pub rapid_override: f64,
    /// By how much a jog by a step moves, mm or degrees.
    pub jog_step: f64,
    /// The path rests at the end of every block.
    pub single_block: bool,
    /// The program waits for an operator at M1.
    pub optional_stop: bool,
}

/// A change of an override, in percent of what is programmed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Override {
    /// To that many.
    To(f64),
    /// By that many, up or down.
    By(f64),
}

/// A change of the jog step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StepChange {
    /// To that many mm or degrees.
    To(f64),
    /// The next smaller of the usual ones.
    Smaller,
    /// The next greater of the usual ones.
    Greater,
}

/// A change of what is on or off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SwitchChange {
    /// On, or off.
    To(bool),
    /// On if it is off, and off if it is on.
    Toggle,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            feed_override: 100.0,
            rapid_override: 100.0,
            jog_step: 1.0,
            single_block: false,
            optional_stop: false,
        }
    }
}

impl Settings {
    /// The part of the rapids' speed, 0…1.
    #[must_use]
    pub fn rapid_part(&self) -> f64 {
        self.rapid_override / 100.0
    }

    /// Takes over what a command sets; the order to the cycle, if it takes one.
    pub fn order(&mut self, command: &Command) -> Option<Order> {
        Some(match *command {
            Command::CycleStart => Order::CycleStart,
            Command::FeedHold => Order::FeedHold,
            Command::Resume => Order::Resume,
            Command::ToggleFeedHold => Order::ToggleFeedHold,
            Command::Retrace => Order::Retrace,
            Command::FeedOverride(change) => {
                self.feed_override = change.of(self.feed_override, MOST_FEED);
                Order::FeedOverride(self.feed_override / 100.0)
            }
            Command::RapidOverride(change) => {
                self.rapid_override = change.of(self.rapid_override, MOST_RAPID);
                Order::RapidOverride(self.rapid_part())
            }
            Command::SingleBlock(change) => {
                self.single_block = change.of(self.single_block);
                Order::SingleBlock(self.single_block)
            }
            Command::OptionalStop(change) => {
                self.optional_stop = change.of(self.optional_stop);
                Order::OptionalStop(self.optional_stop)
            }
            Command::Jog(jog) => jog.order(self.jog_step),
            Command::RenewJog(axis) => Order::RenewJog(axis.index()),
            Command::EndJog(axis) => Order::EndJog(axis.index()),
            Command::JogStep(change) => {
                self.jog_step = change.of(self.jog_step);
                return None;
            }
            Command::Stop => Order::Interrupt,
            Command::Enable => Order::Enable,
            Command::Disable => Order::Disable,
            Command::Home(axes) => Order::Home(axes),
            Command::Reset => Order::Reset,
            Command::SwitchOff => Order::SwitchOff,
            Command::UserCodeEnded {
                number,
                ref failure,
            } => Order::UserCodeEnded {
                number,
                ok: failure.is_none(),
            },
            // Jobs and names are the session's.
            Command::Load(_)
            | Command::Run { .. }
            | Command::Mdi(_)
            | Command::GoTo(_)
            | Command::Output { .. }
            | Command::SetWorkOffset(_)
            | Command::SetToolLength(_) => return None,
        })
    }
}

impl Override {
    /// The override after this change, %. What is no number changes nothing.
    fn of(self, now: f64, most: f64) -> f64 {
        let wanted = match self {
            Self::To(percent) => percent,
            Self::By(percent) => now + percent,
        };
        if wanted.is_nan() {
            now
        } else if wanted < LEAST {
            0.0
        } else {
            wanted.min(most)
        }
    }
}

impl StepChange {
    /// The jog step after this change. What is no distance changes nothing.
    fn of(self, now: f64) -> f64 {
        let mut steps = JOG_STEPS.into_iter();
        let found = match self {
            Self::To(step) => Some(step).filter(|step| step.is_finite() && *step > 0.0),
            Self::Smaller => steps.rfind(|step| *step < now),
            Self::Greater => steps.find(|step| *step > now),
        };
        found.unwrap_or(now)
    }
}

impl SwitchChange {
    /// Whether it is on after this change.
    fn of(self, now: bool) -> bool {
        match self {
            Self::To(on) => on,
            Self::Toggle => !now,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overrides_are_set_absolutely_and_relatively() {
        let mut settings = Settings::default();
        for (change, percent) in [
            (Override::By(10.0), 110.0),
            (Override::To(80.0), 80.0),
            (Override::By(-79.95), 0.0),
            (Override::By(-10.0), 0.0),
            (Override::By(500.0), 200.0),
            (Override::To(f64::NAN), 200.0),
        ] {
            let order = settings.order(&Command::FeedOverride(change));
            assert_eq!(order, Some(Order::FeedOverride(percent / 100.0)));
            assert_eq!(settings.feed_override, percent);
        }
        let order = settings.order(&Command::RapidOverride(Override::By(10.0)));
        assert_eq!(order, Some(Order::RapidOverride(1.0)));
    }

    #[test]
    fn switches_are_set_absolutely_and_toggled() {
        let mut settings = Settings::default();
        for (change, on) in [
            (SwitchChange::Toggle, true),
            (SwitchChange::To(true), true),
            (SwitchChange::Toggle, false),
            (SwitchChange::To(false), false),
            (SwitchChange::To(true), true),
        ] {
            let order = settings.order(&Command::SingleBlock(change));
            assert_eq!(order, Some(Order::SingleBlock(on)));
            let order = settings.order(&Command::OptionalStop(change));
            assert_eq!(order, Some(Order::OptionalStop(on)));
            assert_eq!([settings.single_block, settings.optional_stop], [on; 2]);
        }
    }

    #[test]
    fn the_jog_step_is_the_settings_own() {
        let mut settings = Settings::default();
        for (change, step) in [
            (StepChange::Greater, 10.0),
            (StepChange::Greater, 100.0),
            (StepChange::Greater, 100.0),
            (StepChange::To(0.5), 0.5),
            (StepChange::Smaller, 0.1),
            (StepChange::To(-1.0), 0.1),
            (StepChange::Smaller, 0.01),
            (StepChange::Smaller, 0.01),
        ] {
            assert_eq!(settings.order(&Command::JogStep(change)), None);
            assert_eq!(settings.jog_step, step);
        }
    }
}
