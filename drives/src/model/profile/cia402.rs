//! A master's side of CiA 402: how a drive is surveyed, switched on and off, and what its
//! statusword says. The words and states themselves are [`syncline_canopen::cia402`]'s.

use crate::model::{
    Address, Data, DriveStatus, ModeDisplay, PowerCommand, PowerState, Survey, Write,
};
use syncline_canopen::cia402::{Controlword, State, Statusword};

/// 6040h.
pub(in crate::model) const CONTROLWORD: Address = Address::new(0x6040, 0);
const STATUSWORD: Address = Address::new(0x6041, 0);
const MODE_DISPLAY: Address = Address::new(0x6061, 0);

/// A drive's state by 6041h; 6040h = 0000h switches it off.
pub(in crate::model) const SURVEY: Survey = Survey {
    address: STATUSWORD,
    status: |value| status(Statusword(value as u16)),
    disable: Write {
        address: CONTROLWORD,
        data: Data::u16(Controlword::DISABLE_VOLTAGE.0),
    },
};

/// 6061h must show this mode.
pub(in crate::model) const fn shows(mode: i8) -> ModeDisplay {
    ModeDisplay {
        address: MODE_DISPLAY,
        mode,
    }
}

/// The controlword of a command. `start` are the bits that start the mode on top of Enable
/// Operation; none for a mode that runs as soon as the drive is enabled.
pub(in crate::model) const fn controlword(command: PowerCommand, start: u16) -> Controlword {
    match command {
        PowerCommand::Disable => Controlword::DISABLE_VOLTAGE,
        PowerCommand::Prepare => Controlword::SHUTDOWN,
        PowerCommand::Enable => Controlword::ENABLE_OPERATION,
        PowerCommand::Run => Controlword::ENABLE_OPERATION.with(start),
        PowerCommand::QuickStop => Controlword::QUICK_STOP,
    }
}

/// What a statusword says by the bits that mean the same in every mode that takes a setpoint a
/// cycle: bit 12 is set while the drive follows them. Bits that a maker or a mode gives another
/// meaning are left out: bit 13 is no error here.
pub(in crate::model) fn status(statusword: Statusword) -> DriveStatus {
    DriveStatus {
        power: power_state(statusword),
        mode_runs: statusword.has(Statusword::MODE_12),
        remote: statusword.has(Statusword::REMOTE),
        warning: statusword.has(Statusword::WARNING),
        error: false,
        statusword,
    }
}

fn power_state(statusword: Statusword) -> PowerState {
    match statusword.state() {
        Some(State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::SwitchedOn) => {
            PowerState::Off
        }
        Some(State::ReadyToSwitchOn) => PowerState::Ready,
        Some(State::OperationEnabled) => PowerState::Enabled,
        Some(State::QuickStopActive) => PowerState::QuickStop,
        Some(State::FaultReactionActive) => PowerState::FaultReaction,
        Some(State::Fault) => PowerState::Fault,
        None => PowerState::Unknown,
    }
}
