//! `[spindle]`: the speeds that a program may ask for, and how long they take to come.

use super::{InputMeaning, Machine};
use std::time::Duration;
use syncline_strict_toml::{Log, Table};

/// The machine's spindle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spindle {
    /// S within these, 1/min, or 0.
    pub speeds: (f64, f64),
    /// A speed is reached after so long, or within so long where an input tells when it is.
    pub ramp: Duration,
}

/// What is known of when the spindle has its speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpinUp {
    /// Nothing.
    Unknown,
    /// So long after the change.
    After(Duration),
    /// Once an input tells so, which it does within this time.
    Told {
        /// The greatest time.
        within: Duration,
    },
}

impl SpinUp {
    /// What a machine's file says.
    #[must_use]
    pub fn of(machine: &Machine) -> Self {
        let Some(spindle) = machine.spindle else {
            return Self::Unknown;
        };
        let mut inputs = machine.inputs.iter();
        let within = spindle.ramp;
        if inputs.any(|input| input.meaning == InputMeaning::AtSpeed) {
            Self::Told { within }
        } else if within > Duration::ZERO {
            Self::After(within)
        } else {
            Self::Unknown
        }
    }
}

/// Longest ramp, ms.
const MOST_RAMP: i64 = 600_000;

pub(super) fn read(log: &mut Log<'_>, mut table: Table<'_, '_>) -> Option<Spindle> {
    let most = table.positive(log, "max_speed", "(1/min)");
    let least = table.number_if(log, "min_speed", "a number from 0 (1/min)", |speed| {
        speed >= 0.0
    });
    let ramp = table.integer_or(log, "ramp_ms", 0, 0..=MOST_RAMP, " (ms)");
    if let (Some(least), Some(most)) = (&least, &most)
        && least.get_ref() > most.get_ref()
    {
        log.report(
            least.span(),
            format!("spindle: `min_speed` is {}", least.get_ref()),
            format!("allowed: up to `max_speed`, {}", most.get_ref()),
        );
    }
    table.finish(log);
    Some(Spindle {
        speeds: (
            least.map_or(0.0, |least| *least.get_ref()),
            *most?.get_ref(),
        ),
        ramp: Duration::from_millis(ramp as u64),
    })
}
