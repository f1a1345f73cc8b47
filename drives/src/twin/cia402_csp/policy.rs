//! What the profile leaves to a drive's maker, each as an option with a name.
//!
//! Every default here is an **assumption** of the twin, never a statement of CiA 402.

use syncline_canopen::time::Duration;

/// Options where the profile is silent. Every default is an assumption of the twin.
#[derive(Clone, Debug, PartialEq)]
pub struct Policies {
    /// Time from the command to enable until the power stage is on and the brake open.
    pub enable_time: Duration,
    /// Whether 60C2h can be written only outside of NMT Operational.
    pub period_before_operational: bool,
    /// SYNCs in a row that may be missing, while setpoints are followed, before EMCY 8700h;
    /// `None`: never an error. The reference rests at the last setpoint meanwhile.
    pub missing_syncs: Option<u32>,
    /// Whether a following error beyond 6065h for longer than 6066h is an error, EMCY 8611h; if
    /// not, statusword bit 13 alone tells it.
    pub following_error_is_fault: bool,
    /// Whether statusword bit 12 says that setpoints are followed; if not, it stays off.
    pub tells_following: bool,
    /// Whether the velocity goes to 60FFh in a straight line within the period of SYNC in mode 9; otherwise at once.
    pub interpolates: bool,
    /// Whether 604Ch says what 6042h counts; otherwise it counts as the drive is made.
    pub has_dimension_factor: bool,
    /// Whether EMCY 0000h announces a fault reset.
    pub emcy_on_reset: bool,
}

impl Default for Policies {
    fn default() -> Self {
        Self {
            enable_time: Duration::from_millis(4),
            period_before_operational: true,
            missing_syncs: Some(2),
            following_error_is_fault: true,
            tells_following: true,
            interpolates: true,
            has_dimension_factor: true,
            emcy_on_reset: true,
        }
    }
}

impl Policies {
    /// For masters on ordinary PCs: SYNC may come when it likes, and an axis that is late with it
    /// is no fault.
    #[must_use]
    pub fn tolerant() -> Self {
        Self {
            missing_syncs: None,
            ..Self::default()
        }
    }
}
