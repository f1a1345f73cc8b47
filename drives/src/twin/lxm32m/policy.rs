//! What the manual at hand leaves open, each as an option with a name.
//!
//! Every default here is an **assumption** of the twin, never a fact about the drive. Lines are
//! those of the manual's text, D-24 and the like the doubts listed in `docs/lxm32m.md`.

use core::ops::RangeInclusive;
use syncline_canopen::dictionary::Refusals;
use syncline_canopen::time::Duration;

/// Options where the manual is silent. Every default is an assumption of the twin.
#[derive(Clone, Debug, PartialEq)]
pub struct Policies {
    /// Time from the command to enable until the power stage is on and the brake open.
    pub enable_time: Duration,
    /// What 60C2h:1 takes, milliseconds with the default of 60C2h:2.
    pub periods: RangeInclusive<i64>,
    /// What 3022h:4 `SyncMechTol` counts: a SYNC may be off by its value times this.
    pub sync_tolerance_unit: Duration,
    /// SYNCs within tolerance in a row until 3022h:6 says synchronised.
    pub lock_cycles: u32,
    /// SYNCs in a row that may be missing or out of tolerance before B404h ("missing more than
    /// twice", vendor FAQ000270642); `None`: never a fault.
    pub missing_syncs: Option<u32>,
    /// SYNCs in a row without a setpoint, while interpolating, before a fault; `None`: never one.
    pub missing_setpoints: Option<u32>,
    /// What the reference does in a cycle without a new setpoint.
    pub setpoint_gap: SetpointGap,
    /// Greatest distance of the first setpoint from the actual position, in revolutions, when
    /// Interpolated Position starts; further away is a fault. `None`: the axis jumps after it.
    pub first_setpoint_window: Option<f64>,
    /// Whether Interpolated Position starts only while 3022h:6 says synchronised.
    pub start_needs_lock: bool,
    /// Whether the positions of 607Dh are limits only with a valid zero point (statusword bit 15).
    pub software_limits_need_reference: bool,
    /// Whether EMCY 0000h announces a fault reset (D-24).
    pub emcy_on_reset: bool,
    /// Which abort codes a wrong length and a value out of range get (lxm32m 1979-1985 lists
    /// several).
    pub refusals: Refusals,
    /// Whether a received PDO that is too short raises EMCY 8210h (lxm32m 936 hints at it).
    pub emcy_on_short_pdo: bool,
}

/// What the reference does while no setpoint comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetpointGap {
    /// It goes on with the last velocity.
    Extrapolate,
    /// It stays where the last setpoint was.
    Hold,
}

impl Default for Policies {
    fn default() -> Self {
        Self {
            enable_time: Duration::from_millis(4),
            periods: 1..=20,
            sync_tolerance_unit: Duration::from_micros(250),
            lock_cycles: 20,
            missing_syncs: Some(2),
            missing_setpoints: Some(2),
            setpoint_gap: SetpointGap::Extrapolate,
            first_setpoint_window: Some(0.05),
            start_needs_lock: true,
            software_limits_need_reference: true,
            emcy_on_reset: true,
            refusals: Refusals::default(),
            emcy_on_short_pdo: true,
        }
    }
}

impl Policies {
    /// For masters on ordinary PCs: SYNC may come when it likes, gaps in the setpoints are
    /// ridden out by holding the last one.
    #[must_use]
    pub fn tolerant() -> Self {
        Self {
            sync_tolerance_unit: Duration::from_millis(10),
            missing_syncs: None,
            missing_setpoints: None,
            setpoint_gap: SetpointGap::Hold,
            first_setpoint_window: None,
            start_needs_lock: false,
            ..Self::default()
        }
    }
}
