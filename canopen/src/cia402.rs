//! Controlword, statusword and state machine of a drive (CiA 402), numbered as the LXM32M's
//! manual numbers them (lxm32m 1301-1375).

use core::fmt;

/// A drive's state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum State {
    /// State 2: not ready to switch on.
    NotReadyToSwitchOn,
    /// State 3: switch on disabled.
    SwitchOnDisabled,
    /// State 4: ready to switch on.
    ReadyToSwitchOn,
    /// State 5: switched on.
    SwitchedOn,
    /// State 6: operation enabled; power stage on.
    OperationEnabled,
    /// State 7: quick stop active; power stage on.
    QuickStopActive,
    /// State 8: fault reaction active.
    FaultReactionActive,
    /// State 9: fault.
    Fault,
}

impl State {
    /// Every state, with its statusword's mask and value (lxm32m 1301-1311).
    pub const ALL: [(Self, u16, u16); 8] = [
        (Self::NotReadyToSwitchOn, 0x004F, 0x0000),
        (Self::SwitchOnDisabled, 0x004F, 0x0040),
        (Self::ReadyToSwitchOn, 0x006F, 0x0021),
        (Self::SwitchedOn, 0x006F, 0x0023),
        (Self::OperationEnabled, 0x006F, 0x0027),
        (Self::QuickStopActive, 0x006F, 0x0007),
        (Self::FaultReactionActive, 0x004F, 0x000F),
        (Self::Fault, 0x004F, 0x0008),
    ];

    /// The statusword's bits 0, 1, 2, 3, 5 and 6 in this state; bit 5 (no quick stop) is 1 where
    /// the state leaves it open.
    #[must_use]
    pub const fn bits(self) -> u16 {
        match self {
            Self::NotReadyToSwitchOn => 0x0020,
            Self::SwitchOnDisabled => 0x0060,
            Self::ReadyToSwitchOn => 0x0021,
            Self::SwitchedOn => 0x0023,
            Self::OperationEnabled => 0x0027,
            Self::QuickStopActive => 0x0007,
            Self::FaultReactionActive => 0x002F,
            Self::Fault => 0x0028,
        }
    }

    /// Whether the power stage is on (states 6 and 7, and 8 while it brakes).
    #[must_use]
    pub const fn is_powered(self) -> bool {
        matches!(
            self,
            Self::OperationEnabled | Self::QuickStopActive | Self::FaultReactionActive
        )
    }
}

impl State {
    /// As the standard calls it: `Operation Enabled`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::NotReadyToSwitchOn => "Not Ready To Switch On",
            Self::SwitchOnDisabled => "Switch On Disabled",
            Self::ReadyToSwitchOn => "Ready To Switch On",
            Self::SwitchedOn => "Switched On",
            Self::OperationEnabled => "Operation Enabled",
            Self::QuickStopActive => "Quick Stop Active",
            Self::FaultReactionActive => "Fault Reaction Active",
            Self::Fault => "Fault",
        }
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// 6041h: what a drive says of itself.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Statusword(pub u16);

impl Statusword {
    /// Bit 3: fault.
    pub const FAULT: u16 = 1 << 3;
    /// Bit 4: voltage enabled.
    pub const VOLTAGE_ENABLED: u16 = 1 << 4;
    /// Bit 7: warning.
    pub const WARNING: u16 = 1 << 7;
    /// Bit 8: halt request active on the LXM32M (lxm32m 1323); elsewhere as the maker says.
    pub const HALT: u16 = 1 << 8;
    /// Bit 9: remote; commands of the fieldbus are executed.
    pub const REMOTE: u16 = 1 << 9;
    /// Bit 10: target reached.
    pub const TARGET_REACHED: u16 = 1 << 10;
    /// Bit 11: internal limit active.
    pub const INTERNAL_LIMIT: u16 = 1 << 11;
    /// Bit 12, by mode: set-point acknowledged, interpolation active, homing attained …
    pub const MODE_12: u16 = 1 << 12;
    /// Bit 13, by mode; on the LXM32M x_err: an error that has to be dealt with (lxm32m 1343).
    pub const BIT_13: u16 = 1 << 13;
    /// Bit 14; on the LXM32M x_end: no movement under way (lxm32m 1347).
    pub const BIT_14: u16 = 1 << 14;
    /// Bit 15; on the LXM32M ref_ok: the zero point is valid (lxm32m 1351).
    pub const BIT_15: u16 = 1 << 15;

    /// The word with the bits of a state, and besides those whose flag is set.
    #[must_use]
    pub fn of(state: u16, flags: &[(bool, u16)]) -> Self {
        let set = flags.iter().filter(|(set, _)| *set);
        Self(set.fold(state, |word, (_, bit)| word | bit))
    }

    /// The state, or `None` for bits that mean no state.
    #[must_use]
    pub fn state(self) -> Option<State> {
        State::ALL
            .iter()
            .find(|(_, mask, value)| self.0 & mask == *value)
            .map(|&(state, ..)| state)
    }

    /// Whether all of these bits are set.
    #[must_use]
    pub const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }
}

impl fmt::Debug for Statusword {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h", self.0)
    }
}

/// As a person reads it: `4237h (Operation Enabled)`.
impl fmt::Display for Statusword {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.state() {
            Some(state) => write!(f, "{:04X}h ({state})", self.0),
            None => write!(f, "{:04X}h (no state)", self.0),
        }
    }
}

/// A command that a controlword gives by its bits 0…3 and 7 (lxm32m 1366-1375).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Command {
    /// To Ready To Switch On (T2, T6, T8).
    Shutdown,
    /// To Switched On (T3, T5).
    SwitchOn,
    /// To Switch On Disabled (T7, T9, T10, T12).
    DisableVoltage,
    /// To Quick Stop Active (T11), without power to Switch On Disabled (T7, T10).
    QuickStop,
    /// To Operation Enabled (T4, T16).
    EnableOperation,
}

/// 6040h: what a drive is told to do.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Controlword(pub u16);

impl Controlword {
    /// 0000h.
    pub const DISABLE_VOLTAGE: Self = Self(0x0000);
    /// 0006h.
    pub const SHUTDOWN: Self = Self(0x0006);
    /// 0007h; in Operation Enabled it disables operation.
    pub const SWITCH_ON: Self = Self(0x0007);
    /// 000Fh.
    pub const ENABLE_OPERATION: Self = Self(0x000F);
    /// 000Bh: quick stop as the LXM32M's examples give it (lxm32m 1777).
    pub const QUICK_STOP: Self = Self(0x000B);

    /// Bit 4, by mode: new set-point, enable interpolated position, start homing …
    pub const MODE_4: u16 = 1 << 4;
    /// Bit 5, by mode: change set immediately …
    pub const MODE_5: u16 = 1 << 5;
    /// Bit 6, by mode: relative …
    pub const MODE_6: u16 = 1 << 6;
    /// Bit 7: fault reset, by its rising edge.
    pub const BIT_7: u16 = 1 << 7;
    /// Bit 8: halt.
    pub const HALT: u16 = 1 << 8;
    /// Bit 9, by mode: change on set-point …
    pub const MODE_9: u16 = 1 << 9;

    /// With these bits set as well.
    #[must_use]
    pub const fn with(self, bits: u16) -> Self {
        Self(self.0 | bits)
    }

    /// Whether all of these bits are set.
    #[must_use]
    pub const fn has(self, bits: u16) -> bool {
        self.0 & bits == bits
    }

    /// The command in bits 0…3; `None` while bit 7 is set, which resets a fault by its edge.
    #[must_use]
    pub const fn command(self) -> Option<Command> {
        let bits = self.0;
        if bits & 0x80 != 0 {
            None
        } else if bits & 0x02 == 0 {
            Some(Command::DisableVoltage)
        } else if bits & 0x04 == 0 {
            Some(Command::QuickStop)
        } else if bits & 0x01 == 0 {
            Some(Command::Shutdown)
        } else if bits & 0x08 == 0 {
            Some(Command::SwitchOn)
        } else {
            Some(Command::EnableOperation)
        }
    }

    /// Whether this word after `previous` resets a fault: a rising edge of bit 7.
    #[must_use]
    pub const fn resets_fault(self, previous: Self) -> bool {
        self.has(Self::BIT_7) && !previous.has(Self::BIT_7)
    }
}

impl fmt::Debug for Controlword {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h", self.0)
    }
}

impl fmt::Display for Controlword {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (lxm32m 1755-1830): the statuswords that the manual prints.
    #[test]
    fn printed_statuswords() {
        for (word, state) in [
            (0x6231, State::ReadyToSwitchOn),
            (0x6631, State::ReadyToSwitchOn),
            (0x4237, State::OperationEnabled),
            (0x0637, State::OperationEnabled),
            (0x6617, State::QuickStopActive),
            (0xD637, State::OperationEnabled),
        ] {
            assert_eq!(Statusword(word).state(), Some(state), "{word:04X}h");
        }
    }

    #[test]
    fn every_word_means_at_most_one_state() {
        for word in 0..=u16::MAX {
            let meant = State::ALL
                .iter()
                .filter(|(_, mask, value)| word & mask == *value)
                .count();
            assert!(meant <= 1, "{word:04X}h");
        }
        for (state, ..) in State::ALL {
            assert_eq!(Statusword(state.bits()).state(), Some(state));
        }
    }

    #[test]
    fn commands() {
        for (word, command) in [
            (0x0000, Some(Command::DisableVoltage)),
            (0x0006, Some(Command::Shutdown)),
            (0x0007, Some(Command::SwitchOn)),
            (0x000F, Some(Command::EnableOperation)),
            (0x001F, Some(Command::EnableOperation)),
            (0x000B, Some(Command::QuickStop)),
            (0x0002, Some(Command::QuickStop)),
            (0x0080, None),
        ] {
            assert_eq!(Controlword(word).command(), command, "{word:04X}h");
        }
    }
}
