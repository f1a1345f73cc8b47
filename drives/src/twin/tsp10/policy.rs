//! What the manual leaves open, each as an option with a name.
//!
//! Every default here is an **assumption** of the twin, never a fact about the controller. Numbers are
//! lines of the manual's text.

use syncline_canopen::node::BootUp;
use syncline_canopen::time::Duration;

/// Options where the manual is silent. Every default is an assumption.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Policies {
    /// How the device says that it has booted; not described.
    pub boot_up: BootUp,
    /// What sends a T_PDO (383-421): its type is 255, without inhibit time and event timer.
    pub t_pdo: TPdoTrigger,
    /// Whether a request for node guarding is answered; neither that nor a heartbeat is described.
    pub answers_guarding: bool,
    /// What becomes of a start while a movement is under way (761-766).
    pub second_target: SecondTarget,
    /// What becomes of a target on the way to which it was halted (640), when bit 8 falls.
    pub halted_target: HaltedTarget,
    /// What a relative target is counted from.
    pub relative_to: RelativeTo,
    /// Whether an absolute target is taken before homing (912).
    pub absolute_without_reference: bool,
    /// What 2001h:1 counts: per cent by its table, thousandths by its text (558-564).
    pub standby_unit: StandbyUnit,
    /// Units, and the revolutions a minute at which 60FFh and 606Ch count so many (783-798); none: they count steps/s.
    pub velocity_unit: Option<[u32; 2]>,
    /// Whether statusword bits 12 and 13 tell of homing as CiA 402 has it; not described.
    pub homing_bits: bool,
    /// Whether 000Fh leads from Ready To Switch On to Operation Enabled; the table of transitions has
    /// two (141-167).
    pub enables_at_once: bool,
    /// Whether a limit switch met in modes 1 and 3 is a fault; the drive stops there in any case.
    pub limit_is_fault: bool,
}

/// When a T_PDO of type 255 is sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TPdoTrigger {
    /// When the statusword changes.
    Status,
    /// When anything in it changes.
    Value,
    /// When the statusword changes, and after each such time.
    Period(Duration),
}

/// What a start does while a movement is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SecondTarget {
    /// It is ignored.
    Ignored,
    /// The new target takes over.
    AtOnce,
}

/// What becomes of a target on the way to which the drive was halted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HaltedTarget {
    /// It goes on there, as CiA 402 has it, and as the manual has it in its other modes.
    Kept,
    /// It rests where it is.
    Dropped,
}

/// What a relative target is counted from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RelativeTo {
    /// The target before.
    Target,
    /// Where the demand is.
    Demand,
}

/// What the standby current is a share in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StandbyUnit {
    /// Hundredths.
    Percent,
    /// Thousandths.
    Thousandths,
}

impl Default for Policies {
    fn default() -> Self {
        Self {
            boot_up: BootUp::Message,
            t_pdo: TPdoTrigger::Status,
            answers_guarding: false,
            second_target: SecondTarget::AtOnce,
            halted_target: HaltedTarget::Kept,
            relative_to: RelativeTo::Demand,
            absolute_without_reference: true,
            standby_unit: StandbyUnit::Percent,
            velocity_unit: None,
            homing_bits: true,
            enables_at_once: false,
            limit_is_fault: false,
        }
    }
}
