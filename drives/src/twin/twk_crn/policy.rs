//! What the manual leaves open, each as an option with a name.
//!
//! Every default here is an **assumption** of the twin, never a fact about the encoder.

use syncline_canopen::node::{BootUp, LifeGuarding};

/// Options where the manual is silent or contradicts itself. Every default is an assumption.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Policies {
    /// How the encoder says that it has booted: the manual names the simple boot-up of DS 301 V3.0
    /// and describes no message (crn S34, S21).
    pub boot_up: BootUp,
    /// Whether a late guarding request is found when the life time is over or when it comes
    /// (crn S11, S42).
    pub life_guarding: LifeGuarding,
    /// Whether EMCY 8100h tells of it (crn S35; S36 says that there is no life guarding).
    pub emcy_on_lost_guarding: bool,
    /// Whether the confirmation of an SDO download repeats the data, as the manual's only example
    /// does (crn S28), although DS 301 has zeros.
    pub sdo_echo: bool,
    /// How 1008h…100Ah come, which have more bytes than the expedited answers that the manual
    /// describes (crn S13, S15).
    pub texts: Texts,
    /// Whether bit 31 of 1005h has to be set for the encoder to take SYNC (crn S44).
    pub sync_by_bit_31: bool,
    /// Whether a PDO takes transmission type 255, which the manual does not name (crn S18).
    pub takes_type_255: bool,
    /// Whether a position on a limit of the work area counts as outside ("on reaching", crn S41).
    pub limit_is_outside: bool,
    /// Whether a preset beyond the range is cut to it; refused with 0609 0030h otherwise.
    pub preset_wraps: bool,
    /// Whether 6001h and 6002h take more than the disc resolves; refused with 0609 0030h otherwise.
    pub scales_beyond_disc: bool,
}

/// How a text of more than four bytes is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Texts {
    /// Whole, in segments.
    Segmented,
    /// Its first four bytes.
    Cut,
    /// Not at all: 0601 0000h.
    Refused,
}

impl Default for Policies {
    fn default() -> Self {
        Self {
            boot_up: BootUp::Silent,
            life_guarding: LifeGuarding::AtExpiry,
            emcy_on_lost_guarding: true,
            sdo_echo: true,
            texts: Texts::Segmented,
            sync_by_bit_31: true,
            takes_type_255: false,
            limit_is_outside: true,
            preset_wraps: false,
            scales_beyond_disc: true,
        }
    }
}
