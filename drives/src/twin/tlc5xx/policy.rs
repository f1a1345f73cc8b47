//! What the manual leaves open, each as an option with a name.
//!
//! Every default here is an **assumption** of the twin, never a fact about the controller. Lines are
//! those of the manual's text, D-02 and the like the doubts listed in `docs/tlc5xx.md`.

use crate::twin::device::Config;
use syncline_canopen::node::BootUp;
use syncline_canopen::time::Duration;

/// Options where the manual is silent or contradicts itself. Every default is an assumption.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Policies {
    /// How the device says that it has booted (D-01): by an EMCY without data (1889-1896), or by a
    /// byte 0 on 700h + id (2271).
    pub boot_up: BootUp,
    /// Controlword bit 6 of an absolute target: set as printed (2996), or clear as DSP-402 has it
    /// (D-02).
    pub absolute: Bit6,
    /// Statusword bit 9 while the fieldbus has control: clear (15104), or set (2813) (D-04).
    pub remote: Bit9,
    /// Statusword bits 0 to 3 of a fault: 1111 as printed (2792), or 1000 as DSP-402 has it (D-20).
    pub fault: FaultBits,
    /// What the position factor 6093h relates.
    pub position_factor: PositionFactor,
    /// What 60FFh and 606Ch count for 1 r/min while the factor 6094h is 1 (D-53), above 0.
    pub units_per_rpm: u32,
    /// What 20A7h counts, the speed of offset positioning (D-30).
    pub offset_speed: OffsetSpeed,
    /// Whether an absolute target is taken before a reference point is defined, by homing or by
    /// setting the position. The manual asks for one (3154) and prints no reaction: EMCY FF22h.
    pub absolute_without_reference: bool,
    /// Time from the command to switch on until the power stage is on.
    pub enable_time: Duration,
    /// Whether COB-IDs and mappings can be changed in Operational, which the manual places in
    /// Pre-Operational (1856, 2032).
    pub parameters_in_operational: bool,
    /// Whether EMCY 0000h tells that a fault is reset; the manual mentions none.
    pub emcy_on_reset: bool,
}

/// Which level of controlword bit 6 makes a target absolute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bit6 {
    /// 1, as this manual prints.
    SetIsAbsolute,
    /// 0, as DSP-402 has it.
    ClearIsAbsolute,
}

/// Which level of statusword bit 9 says that the fieldbus has control.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bit9 {
    /// 0.
    ClearIsFieldbus,
    /// 1.
    SetIsFieldbus,
}

/// How the statusword shows a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultBits {
    /// 1111, in both of its states.
    AllFour,
    /// 1111 while it reacts, 1000 afterwards.
    OfProfile,
}

/// What 6093h is the ratio of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PositionFactor {
    /// Revolutions for a user unit, as 6094h and 6097h are read: with the default a user unit is an
    /// increment.
    RevolutionsPerUnit,
    /// User units for an increment: with the default a user unit is a revolution.
    UnitsPerIncrement,
}

/// What 20A7h counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OffsetSpeed {
    /// As its description and the list of objects print (12664).
    IncrementsPerSecond,
    /// As the figure prints (4423), and as its range of 12000 suggests.
    RevolutionsPerMinute,
}

impl Policies {
    /// As a machine file takes the controller to be.
    pub(super) fn assumed(self, config: &Config) -> Self {
        Self {
            absolute: match config.assumed("absolute_bit") {
                Some(0) => Bit6::ClearIsAbsolute,
                Some(_) => Bit6::SetIsAbsolute,
                None => self.absolute,
            },
            remote: match config.assumed("remote_bit") {
                Some(0) => Bit9::ClearIsFieldbus,
                Some(1) => Bit9::SetIsFieldbus,
                // It is taken to say nothing.
                _ => self.remote,
            },
            units_per_rpm: config
                .assumed("units_per_rpm")
                .unwrap_or(self.units_per_rpm),
            ..self
        }
    }
}

impl Default for Policies {
    fn default() -> Self {
        Self {
            boot_up: BootUp::EmptyEmergency,
            absolute: Bit6::SetIsAbsolute,
            remote: Bit9::ClearIsFieldbus,
            fault: FaultBits::AllFour,
            position_factor: PositionFactor::RevolutionsPerUnit,
            units_per_rpm: 1,
            offset_speed: OffsetSpeed::IncrementsPerSecond,
            absolute_without_reference: false,
            enable_time: Duration::from_millis(4),
            parameters_in_operational: false,
            emcy_on_reset: false,
        }
    }
}
