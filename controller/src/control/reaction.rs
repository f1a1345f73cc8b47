//! What the machine does about what happens to it: the one table of causes and reactions.
//!
//! Whatever stops a machine is found somewhere of its own, a statusword in `node`, a following error in
//! `axis`, a door in `inputs`; what is done about it is decided here and nowhere else. [`RULES`] is the
//! table, `docs/supervision.md` shows it, and a test holds the two together.
//!
//! An axis that cannot follow its setpoints any longer is quick-stopped, and the others come to rest on the
//! path. Where that would tear something, all are quick-stopped: the two sides of a gantry, whichever of them
//! it is, and every axis of a machine whose file says `stop_together`. Where nothing moves yet, and no setpoint is
//! followed, every fault leads to disabled drives by the ordinary way down.

use super::fault::{AxisCause, BlockCause, BusCause, DeviceCause, Fault, SpindleCause};
use super::layout::Layout;
use std::fmt;
use std::mem::discriminant;

/// What the machine does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// The path comes to rest on itself, drives stay enabled, and the job can go on.
    FeedHold,
    /// The path comes to rest on itself, and the job is over; where it is a fault, the drives are disabled.
    StopOnPath,
    /// The axes concerned are quick-stopped, the others come to rest on the path; then the drives are disabled.
    QuickStopAxis,
    /// Every drive is quick-stopped, then disabled.
    QuickStopAll,
    /// Nothing moves yet: the drives are disabled, or are not enabled.
    Disable,
}

/// What ends it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clearing {
    /// An operator has the path go on.
    GoOn,
    /// Nobody: the machine is ready for the next job.
    Nobody,
    /// An operator resets the machine; that moves nothing.
    Reset,
}

/// What may happen to a machine, as far as it makes a difference to what is done about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// An operator's feed hold, or an input's.
    FeedHold,
    /// A door is opened.
    Door,
    /// An input tells in a cut that the spindle has lost its speed.
    SpeedLost,
    /// An operator's stop.
    Stop,
    /// A block cannot be run.
    Program,
    /// A probing fails, or the probe touches something else.
    Probing,
    /// A thread cannot be cut.
    Thread,
    /// A driven spindle falls away from its speed in a cut.
    SpindleSpeed,
    /// An oriented spindle is turned away while the path moves.
    SpindleAngle,
    /// An axis is not referenced where it has to be, or cannot be homed.
    Unreferenced,
    /// No plan came for long.
    NoPlan,
    /// A strict cycle woke up late.
    LateWakeUp,
    /// Setpoints missed their SYNC too often, or left in part.
    Setpoints,
    /// The adapter of a bus counts errors.
    ErrorPassive,
    /// Another node does what only the controller may.
    SecondMaster,
    /// A bus is lost.
    BusLost,
    /// A drive reports an error.
    DriveError,
    /// A drive follows no setpoints any longer.
    NotFollowing,
    /// A drive is not heard as it should be.
    Silent,
    /// A drive cannot be sent where its axis has to be.
    PositionRange,
    /// An axis lags its setpoint.
    FollowingError,
    /// An actual position jumped.
    Jump,
    /// An encoder of an axis and its drives disagree.
    Feedback,
    /// An axis is on a limit switch.
    LimitSwitch,
    /// A gantry's sides are apart.
    Skew,
    /// A setpoint would have an axis exceed its limits.
    SetpointGuard,
    /// The external enable is off.
    EnableLost,
    /// A drive does not come up, or an axis is not where it should be.
    BringUp,
}

/// A row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// What happens.
    pub cause: Cause,
    /// What is done.
    pub reaction: Reaction,
    /// What ends it.
    pub cleared_by: Clearing,
}

/// The table, in the order of [`Cause`].
pub const RULES: [Rule; 28] = [
    rule(Cause::FeedHold, Reaction::FeedHold, Clearing::GoOn),
    rule(Cause::Door, Reaction::FeedHold, Clearing::GoOn),
    rule(Cause::SpeedLost, Reaction::FeedHold, Clearing::GoOn),
    rule(Cause::Stop, Reaction::StopOnPath, Clearing::Nobody),
    rule(Cause::Program, Reaction::StopOnPath, Clearing::Nobody),
    rule(Cause::Probing, Reaction::StopOnPath, Clearing::Nobody),
    rule(Cause::Thread, Reaction::StopOnPath, Clearing::Reset),
    rule(Cause::SpindleSpeed, Reaction::StopOnPath, Clearing::Reset),
    rule(Cause::SpindleAngle, Reaction::StopOnPath, Clearing::Reset),
    rule(Cause::Unreferenced, Reaction::StopOnPath, Clearing::Reset),
    rule(Cause::NoPlan, Reaction::StopOnPath, Clearing::Reset),
    rule(Cause::LateWakeUp, Reaction::StopOnPath, Clearing::Reset),
    rule(Cause::Setpoints, Reaction::StopOnPath, Clearing::Reset),
    rule(Cause::ErrorPassive, Reaction::StopOnPath, Clearing::Reset),
    rule(Cause::SecondMaster, Reaction::StopOnPath, Clearing::Reset),
    rule(Cause::BusLost, Reaction::QuickStopAxis, Clearing::Reset),
    rule(Cause::DriveError, Reaction::QuickStopAxis, Clearing::Reset),
    rule(
        Cause::NotFollowing,
        Reaction::QuickStopAxis,
        Clearing::Reset,
    ),
    rule(Cause::Silent, Reaction::QuickStopAxis, Clearing::Reset),
    rule(
        Cause::PositionRange,
        Reaction::QuickStopAxis,
        Clearing::Reset,
    ),
    rule(
        Cause::FollowingError,
        Reaction::QuickStopAxis,
        Clearing::Reset,
    ),
    rule(Cause::Jump, Reaction::QuickStopAxis, Clearing::Reset),
    rule(Cause::Feedback, Reaction::StopOnPath, Clearing::Reset),
    rule(Cause::LimitSwitch, Reaction::QuickStopAxis, Clearing::Reset),
    rule(Cause::Skew, Reaction::QuickStopAll, Clearing::Reset),
    rule(
        Cause::SetpointGuard,
        Reaction::QuickStopAll,
        Clearing::Reset,
    ),
    rule(Cause::EnableLost, Reaction::QuickStopAll, Clearing::Reset),
    rule(Cause::BringUp, Reaction::Disable, Clearing::Reset),
];

const fn rule(cause: Cause, reaction: Reaction, cleared_by: Clearing) -> Rule {
    Rule {
        cause,
        reaction,
        cleared_by,
    }
}

impl Cause {
    /// Its row of the table.
    #[must_use]
    pub const fn rule(self) -> Rule {
        RULES[self as usize]
    }
}

impl Fault {
    /// Which row of the table it is.
    #[must_use]
    pub const fn cause(&self) -> Cause {
        match self {
            Self::Device(_, cause) => cause.cause(),
            Self::Axis(_, cause) => match cause {
                AxisCause::OutsideSoftLimits { .. } | AxisCause::Standstill { .. } => {
                    Cause::BringUp
                }
                AxisCause::Skew { .. } => Cause::Skew,
                AxisCause::FeedbackDifference { .. } | AxisCause::ReferenceMoved { .. } => {
                    Cause::Feedback
                }
                AxisCause::LimitSwitch { .. } => Cause::LimitSwitch,
                AxisCause::FollowingError { .. }
                | AxisCause::TestMove { .. }
                | AxisCause::NotThere { .. }
                | AxisCause::NotAcknowledged { .. }
                | AxisCause::NotHalted { .. } => Cause::FollowingError,
                AxisCause::Jump { .. } => Cause::Jump,
                AxisCause::SetpointGuard { .. } => Cause::SetpointGuard,
                AxisCause::Unreferenced | AxisCause::Homing(_) => Cause::Unreferenced,
            },
            Self::Bus(_, cause) => match cause {
                BusCause::LateSetpoints { .. } | BusCause::TornBurst => Cause::Setpoints,
                BusCause::ErrorPassive => Cause::ErrorPassive,
                BusCause::SecondSync
                | BusCause::SecondNmtMaster { .. }
                | BusCause::SecondController { .. } => Cause::SecondMaster,
                BusCause::Failed => Cause::BusLost,
            },
            Self::LateWakeUp { .. } => Cause::LateWakeUp,
            Self::Program => Cause::Program,
            Self::Spindle(SpindleCause::Speed { .. }) => Cause::SpindleSpeed,
            Self::Spindle(SpindleCause::Angle { .. }) => Cause::SpindleAngle,
            Self::Block(_, BlockCause::Probing(_)) | Self::Touched | Self::Pressed => {
                Cause::Probing
            }
            Self::Block(_, BlockCause::Thread(_)) => Cause::Thread,
            Self::NotEnabled { .. } => Cause::EnableLost,
            Self::NoPlan => Cause::NoPlan,
        }
    }

    /// Whether it says again what another one said: of the same drive, axis, bus or input, or where there is but one of its
    /// kind, in the same row of the table.
    pub(super) fn repeats(&self, other: &Self) -> bool {
        let same = match (self, other) {
            (Self::Device(one, _), Self::Device(other, _))
            | (Self::Axis(one, _), Self::Axis(other, _))
            | (Self::Bus(one, _), Self::Bus(other, _)) => one == other,
            (Self::NotEnabled { input: one }, Self::NotEnabled { input: other }) => one == other,
            _ => discriminant(self) == discriminant(other),
        };
        same && self.cause() == other.cause()
    }

    /// Whether it concerns a drive: itself, its own axis, the encoder with whose positions its loop is closed, or all that a
    /// bus carries.
    pub(super) fn concerns(&self, layout: &Layout, drive: usize) -> bool {
        match *self {
            Self::Device(of, _) => {
                let closes_loop = |axis: &super::layout::AxisSpec| {
                    let feedback = axis.feedback.filter(|it| it.closes_loop);
                    feedback.is_some_and(|it| it.encoder == of) && axis.drives.contains(&drive)
                };
                of == drive || layout.axes.iter().any(closes_loop)
            }
            Self::Axis(axis, _) => layout.axes[axis].drives.contains(&drive),
            Self::Bus(bus, _) => layout.devices[drive].bus == bus,
            _ => false,
        }
    }
}

impl DeviceCause {
    const fn cause(&self) -> Cause {
        match self {
            Self::NoBootUp
            | Self::NoAnswer
            | Self::WrongIdentity { .. }
            | Self::WriteAborted { .. }
            | Self::ReadAborted { .. }
            | Self::WrongAnswer { .. }
            | Self::ReadBack { .. }
            | Self::StaysEnabled { .. }
            | Self::NoSyncLock { .. }
            | Self::StateTimeout { .. }
            | Self::NotAtRest
            | Self::WrongMode { .. } => Cause::BringUp,
            Self::SdoTimeout { .. }
            | Self::SecondTPdo
            | Self::TwoNodes
            | Self::HeartbeatLost
            | Self::GuardingUnanswered
            | Self::PollUnanswered { .. }
            | Self::NoNmtState
            | Self::UnknownNmtState { .. }
            | Self::NmtState { .. }
            | Self::Rebooted
            | Self::MissingTPdo { .. } => Cause::Silent,
            Self::PositionRange => Cause::PositionRange,
            Self::Emergency { .. } | Self::Reported { .. } => Cause::DriveError,
            Self::NotFollowing { .. } => Cause::NotFollowing,
        }
    }
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::FeedHold => "feed hold, by an operator or an input",
            Self::Door => "a door is opened",
            Self::Stop => "stop, by an operator",
            Self::Program => "a block of the program cannot be run",
            Self::Probing => "a probing without contact, or with contact already; contact while nobody probes",
            Self::Thread => "a thread for which the spindle is too fast, too uneven, or does not turn",
            Self::SpeedLost => "the input `at_speed` goes off in a cut",
            Self::SpindleSpeed => "a spindle that a drive turns falls away from its speed in a cut",
            Self::SpindleAngle => "an oriented spindle is turned away from its angle while axes move",
            Self::Unreferenced => "an axis not referenced that has to be, or that cannot be homed",
            Self::NoPlan => "the path waits for its plan for 30 s",
            Self::LateWakeUp => "late wake-up of a cycle that is to be strict",
            Self::Setpoints => {
                "setpoints missed their SYNC twice in a row or three times in 1000 cycles, or left in part"
            }
            Self::ErrorPassive => "adapter of a bus error passive",
            Self::SecondMaster => "SYNC, an NMT command, or a node with the controller's id, that is not the controller's",
            Self::BusLost => "bus lost",
            Self::DriveError => "EMCY, or a fault that a drive tells",
            Self::NotFollowing => {
                "drive no longer enabled, in its mode or under fieldbus control"
            }
            Self::Silent => {
                "heartbeat lost, T_PDOs missing, a second T_PDO to one SYNC, no SDO answer, reboot, another NMT state, two \
                 drives with one node id"
            }
            Self::PositionRange => "setpoint beyond what a drive can count",
            Self::FollowingError => "following error, also in a test move",
            Self::Jump => "jump of an actual position",
            Self::Feedback => "difference between an axis' encoder and its drives, or between its reference and where it believed that",
            Self::LimitSwitch => "an axis moves further onto its limit switch, or its other one comes on",
            Self::Skew => "skew of a gantry",
            Self::SetpointGuard => "setpoint of a drive beyond its axis' limits",
            Self::EnableLost => "external enable off",
            Self::BringUp => "drive does not come up or go off, axis outside its soft limits or not at rest",
        })
    }
}

impl fmt::Display for Reaction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::FeedHold => "feed hold",
            Self::StopOnPath => "stop on the path",
            Self::QuickStopAxis => "quick stop of the axis, the others stop on the path",
            Self::QuickStopAll => "quick stop of all",
            Self::Disable => "disable",
        })
    }
}

impl fmt::Display for Clearing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::GoOn => "an operator: resume",
            Self::Nobody => "nobody: the next job can begin",
            Self::Reset => "an operator: reset",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::ProbeFailure;

    #[test]
    fn the_table_is_in_the_order_of_its_causes() {
        for (place, rule) in RULES.iter().enumerate() {
            assert_eq!(rule.cause as usize, place, "{}", rule.cause);
        }
        assert_eq!(Cause::BringUp as usize + 1, RULES.len());
    }

    /// A drive that does not come up says nothing of an axis beside its place, nor a probing of the probe.
    #[test]
    fn a_fault_repeats_none_of_another_subject() {
        let faults = [
            Fault::Device(1, DeviceCause::NotAtRest),
            Fault::Device(2, DeviceCause::NotAtRest),
            Fault::Axis(1, AxisCause::Standstill { distance: 0.1 }),
            Fault::Axis(2, AxisCause::OutsideSoftLimits { position: 0.1 }),
            Fault::Bus(1, BusCause::ErrorPassive),
            Fault::NotEnabled { input: 1 },
            Fault::Block(1, BlockCause::Probing(ProbeFailure::NoContact)),
            Fault::Touched,
            Fault::Pressed,
        ];
        for (one, fault) in faults.iter().enumerate() {
            for (other, known) in faults.iter().enumerate() {
                assert_eq!(fault.repeats(known), one == other, "{fault:?} {known:?}");
            }
        }
    }
}
