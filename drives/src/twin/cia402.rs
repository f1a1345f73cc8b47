//! What CiA 402 says of every drive: what a command leads to in its state machine, and how 60C2h counts.
//!
//! Of the transitions only those that are commanded are here. What a drive does by itself (T0, T1, T12 to T14), how
//! long it takes to switch its power stage on, and how it brakes is its own.

use syncline_canopen::cia402::{Command, State};

/// The state that a command leads to; `None` where it means nothing. A fault is left by its reset
/// alone, whose result is [`State::SwitchOnDisabled`].
#[must_use]
pub fn commanded(state: State, command: Command) -> Option<State> {
    use Command::{DisableVoltage, EnableOperation, QuickStop, Shutdown, SwitchOn};
    use State::{OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn};
    Some(match (command, state) {
        (DisableVoltage, ReadyToSwitchOn | SwitchedOn | OperationEnabled | QuickStopActive)
        | (QuickStop, ReadyToSwitchOn | SwitchedOn) => SwitchOnDisabled,
        (QuickStop, OperationEnabled) => QuickStopActive,
        (Shutdown, SwitchOnDisabled | SwitchedOn | OperationEnabled) => ReadyToSwitchOn,
        (SwitchOn, ReadyToSwitchOn | OperationEnabled) => SwitchedOn,
        (EnableOperation, ReadyToSwitchOn | SwitchedOn | QuickStopActive) => OperationEnabled,
        _ => return None,
    })
}

/// The period of 60C2h in seconds: its value (:1) times 10 to the power of its index (:2), −6…0.
#[must_use]
pub fn interpolation_period(value: i64, index: i64) -> f64 {
    value as f64 * (1.0 / 10u32.pow(-index.clamp(-6, 0) as u32) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The transitions of the standard, by their numbers (lxm32m 1366-1375).
    #[test]
    fn commands_lead_where_the_standard_says() {
        use Command::{DisableVoltage, EnableOperation, QuickStop, Shutdown, SwitchOn};
        use State::{
            OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn,
        };
        let transitions = [
            (SwitchOnDisabled, Shutdown, ReadyToSwitchOn), // T2
            (ReadyToSwitchOn, SwitchOn, SwitchedOn),       // T3
            (ReadyToSwitchOn, EnableOperation, OperationEnabled), // T3 and T4
            (SwitchedOn, EnableOperation, OperationEnabled), // T4
            (OperationEnabled, SwitchOn, SwitchedOn),      // T5
            (SwitchedOn, Shutdown, ReadyToSwitchOn),       // T6
            (ReadyToSwitchOn, DisableVoltage, SwitchOnDisabled), // T7
            (ReadyToSwitchOn, QuickStop, SwitchOnDisabled), // T7
            (OperationEnabled, Shutdown, ReadyToSwitchOn), // T8
            (OperationEnabled, DisableVoltage, SwitchOnDisabled), // T9
            (SwitchedOn, DisableVoltage, SwitchOnDisabled), // T10
            (SwitchedOn, QuickStop, SwitchOnDisabled),     // T10
            (OperationEnabled, QuickStop, QuickStopActive), // T11
            (QuickStopActive, DisableVoltage, SwitchOnDisabled), // T12
            (QuickStopActive, EnableOperation, OperationEnabled), // T16
        ];
        for (state, ..) in State::ALL {
            for command in [
                Shutdown,
                SwitchOn,
                DisableVoltage,
                QuickStop,
                EnableOperation,
            ] {
                let known = transitions
                    .iter()
                    .find(|(from, by, _)| *from == state && *by == command);
                let expected = known.map(|(.., to)| *to);
                assert_eq!(
                    commanded(state, command),
                    expected,
                    "{command:?} in {state}"
                );
            }
        }
    }
}
