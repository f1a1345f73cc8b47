//! Why an axis was not homed.

use super::super::layout::AxisSpec;
use crate::machine::{HomingMethod, NotKept, OtherMark};

/// Why a homing failed. The axes came to rest; this one is not referenced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HomingFailure {
    /// The switch did not come on within the distance.
    NotFound,
    /// The switch did not go off in front of its edge.
    StaysOn,
    /// The switch was on as the search began, and did not go off over the whole distance.
    NeverOff,
    /// The axis did not follow on its way to the switch.
    BlockedBefore,
    /// The axis did not follow on its way off the switch on which it had stood.
    BlockedOnSwitch,
    /// Of a gantry, one side did not follow as the other one did.
    SideJammed {
        /// Its place among the axis' drives.
        side: usize,
    },
    /// Passed slowly, the switch did not come on where it had at speed.
    Lost,
    /// Of a gantry, the switch of one side did not come on where the other one's did.
    OneSide {
        /// Its place among the axis' drives.
        side: usize,
    },
    /// The drive of one side captured no edge where its switch came on.
    NotCaptured {
        /// Its place among the axis' drives.
        side: usize,
    },
    /// The drive of one side captured another edge than the one at which its switch came on.
    OtherEdge {
        /// Its place among the axis' drives.
        side: usize,
    },
    /// It took longer than allowed.
    TooLong,
    /// The level of the switch is not known.
    NoSignal,
    /// The switch is on, and is another axis' too.
    Shared,
    /// The rapid override is 0.
    NoSpeed,
    /// A door is open, or was opened.
    DoorOpen,
    /// The input for feed hold came on.
    FeedHold,
    /// An operator's feed hold.
    Held,
    /// The drive, which homes by itself, did not find its place.
    NotHome,
    /// The drive, which homes by itself, went further than it may.
    TooFar,
    /// The index that counts, of the drive's choice or of the controller's, is too near to the edge of the switch.
    IndexTooNear {
        /// By so many thousandths of a turn.
        thousandths: u16,
    },
    /// No hard stop stopped the axis within the distance.
    NoStop,
    /// Something stopped the axis nearer to where it began than a hard stop can be.
    TooEarly,
    /// What stopped the axis gave way.
    GaveWay,
    /// The axis, with its torque limited, did not follow on its way to the hard stop.
    Weak,
    /// The axis, with its torque limited, did not come off its hard stop.
    Holds,
    /// Its torque was limited to no more before the search.
    WeakAlready,
}

/// Why an axis is not referenced any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LostReference {
    /// Its drive was gone, and may count otherwise.
    DriveGone,
    /// Its drive homes by itself, and counts anew.
    Homes,
    /// Its homing was cut off.
    CutOff,
    /// Homed again, it was elsewhere than where it believed to be.
    Moved,
}

/// Why an axis that keeps its reference is not referenced when it is switched on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NotRecalled {
    /// None was kept.
    NotKept(NotKept),
    /// It has moved by so much without power, mm.
    Moved(f64),
}

impl NotRecalled {
    /// Why, and what to do next, in words.
    pub(in crate::control) fn describe(self, axis: &AxisSpec) -> String {
        let AxisSpec { name, unit, .. } = axis;
        let why = match self {
            Self::NotKept(NotKept::Unknown) => "nothing is known of it from before".to_owned(),
            Self::NotKept(NotKept::OtherCounts { .. }) => {
                "its drives, their scaling, direction or `zero` are not those of before".to_owned()
            }
            Self::NotKept(NotKept::OtherDevice(OtherMark {
                object,
                before,
                now,
            })) => {
                let now = now.map_or("is not there".to_owned(), |now| format!("reads {now}"));
                format!(
                    "a drive of it, or the motor on it, is another one ({object} {now}, and was {before})"
                )
            }
            Self::Moved(by) => {
                format!("it has moved by {by:.3} {unit} while it was off, more than `moved_limit`")
            }
        };
        format!("axis {name} is not referenced: {why}: home it")
    }
}

/// Sides and their drives by their places.
const ORDINALS: [&str; 2] = ["first", "second"];

impl HomingFailure {
    /// What happened, and what to do next, in words.
    pub(in crate::control) fn describe(self, axis: &AxisSpec) -> String {
        let AxisSpec { name, unit, .. } = axis;
        let (direction, far, back_off, most) = match &axis.homing.method {
            HomingMethod::Switch(it) => (it.direction, it.max_distance, it.back_off, it.max_time),
            HomingMethod::HardStop(it) => (it.direction, it.max_distance, it.back_off, it.max_time),
            HomingMethod::Drive(it) => (0.0, it.max_distance, 0.0, it.max_time),
            HomingMethod::Encoder | HomingMethod::SetHere { .. } => {
                return format!("axis {name} is not homed");
            }
        };
        let side = if direction > 0.0 {
            "positive"
        } else {
            "negative"
        };
        let why = match self {
            Self::NotFound => format!(
                "no switch came on within {far} {unit} in {side} direction: check the switch and its \
                 wiring, `direction`, and the drive's `direction`"
            ),
            Self::StaysOn => format!(
                "its switch stays on, {back_off} {unit} and more in front of its edge: check whether \
                 it is stuck, and `active_low`"
            ),
            Self::NeverOff => format!(
                "its switch was on as the search began, and {far} {unit} against {side} direction it still is: check \
                 whether it is stuck, `active_low`, and whether it is at the other end, by `direction`"
            ),
            Self::BlockedBefore => format!(
                "it did not follow in {side} direction, and no switch had come on: check what is in its way, the \
                 switch and its wiring, and whether it is at that end, by `direction`"
            ),
            Self::BlockedOnSwitch => format!(
                "its switch was on as the search began, and against {side} direction it did not follow: check what \
                 is in its way, `active_low`, and whether the switch is at the other end, by `direction`"
            ),
            Self::SideJammed { side } => format!(
                "its {} side did not follow as the other one did: check whether it is jammed, its motor and its \
                 brake",
                ORDINALS[side]
            ),
            Self::Lost => format!(
                "its switch came on at speed, and not again within {back_off} {unit} of there: check \
                 whether it is loose, or too narrow for `speed`"
            ),
            Self::OneSide { side } => format!(
                "the switch of its {} side did not come on within {back_off} {unit} of the other \
                 one's: check that switch, and whether the side is jammed",
                ORDINALS[side]
            ),
            Self::NotCaptured { side } => format!(
                "its {} drive did not capture where its switch came on: check that the switch is wired to the \
                 input that `signal` names, or set `latch = false`",
                ORDINALS[side]
            ),
            Self::OtherEdge { side } => format!(
                "its {} drive captured another place than the one where its switch came on: check whether the \
                 switch bounces, and which input it is wired to, or set `latch = false`",
                ORDINALS[side]
            ),
            Self::TooLong => format!(
                "it took longer than {} s: check `max_time_ms` and the rapid override",
                most.as_secs_f64()
            ),
            Self::NoSignal => {
                "its switch tells no level: check the drive that it is wired to".into()
            }
            Self::Shared => {
                "its switch is on already, and another axis has the same one: move the axes off it"
                    .into()
            }
            Self::NoSpeed => "the rapid override is 0: raise it, and home it again".into(),
            Self::DoorOpen => "a door is open: close it".into(),
            Self::FeedHold => "the input for feed hold came on: home it again once that is off".into(),
            Self::Held => "a feed hold ended it: home it again".into(),
            Self::NotHome => "its drive did not find its place by itself: check the switches wired to the drive, the \
                 functions of its inputs, and `method`"
                .into(),
            Self::TooFar => format!(
                "its drive went more than {far} {unit} from where it began: check the switches wired to the drive, \
                 `method` and `max_distance`"
            ),
            Self::IndexTooNear { thousandths } => format!(
                "the index pulse that counts is {:.1} % of a turn from the edge of its switch, less than 2 % or than what the \
                 edge may be off, and the next one may be another: move the switch by a quarter of a turn",
                f64::from(thousandths) / 10.0
            ),
            Self::NoStop
            | Self::TooEarly
            | Self::GaveWay
            | Self::Weak
            | Self::Holds
            | Self::WeakAlready => self.of_stop(axis, side),
        };
        format!("axis {name} is not homed: {why}")
    }

    /// The same of a search for a hard stop to that side.
    fn of_stop(self, axis: &AxisSpec, side: &str) -> String {
        let HomingMethod::HardStop(how) = &axis.homing.method else {
            return String::new();
        };
        let (unit, torque) = (axis.unit, 100.0 * how.torque);
        match self {
            Self::NoStop => format!(
                "nothing stopped it within {} {unit} in {side} direction: check the stop, `direction`, the drive's \
                 `direction`, and `max_distance`",
                how.max_distance
            ),
            Self::TooEarly => format!(
                "something stopped it less than {} {unit} from where it began, and it went back there: check what is in \
                 its way, whether {torque} % of its torque moves it, and `min_distance`",
                how.min_distance
            ),
            Self::GaveWay => format!(
                "what stopped it gave way: check what is in its way, whether {torque} % of its torque moves it, and \
                 `contact_ms`"
            ),
            Self::Weak => format!(
                "with {torque} % of its torque it did not follow in {side} direction, and did not stand either: check what \
                 brakes it, `torque`, and `speed`"
            ),
            Self::Holds => format!(
                "with {torque} % of its torque it did not come off what it had met: check what holds it, and `torque`"
            ),
            _ => format!(
                "its torque was limited to no more than {torque} % before: switch the drive's supply off and on if a \
                 search was cut off with the controller, or lower `torque`"
            ),
        }
    }
}
