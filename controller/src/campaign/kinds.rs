//! What there is to be told: every kind of fault and of refusal, so that a campaign can say which of them it never met, and why.

use crate::control::fault::{AxisCause, BlockCause, BusCause, DeviceCause, SpindleCause};
use crate::control::{self, Fault};
use crate::session;
use std::fmt::Debug;
use strum::VariantNames;

/// What no case meets, and why.
const NOT_MET: [(&str, &str); 25] = [
    ("fault: Device NoSyncLock", FOLLOWS),
    ("fault: Device GuardingUnanswered", NO_SHEETS),
    (
        "fault: Device PositionRange",
        "axes are drawn inside what their drives count",
    ),
    ("fault: Program", BY_RUN),
    ("fault: Axis Unreferenced", BY_RUN),
    ("fault: Axis Homing", BY_RUN),
    ("fault: Axis TestMove", NO_TEST_MOVES),
    ("refusal: Machine Untested", NO_TEST_MOVES),
    (
        "fault: Axis SetpointGuard",
        "it would be a mistake of the controller, which the checkers look for",
    ),
    ("fault: Axis LimitSwitch", NO_LIMITS),
    ("refusal: Machine OnLimit", NO_LIMITS),
    ("fault: Bus SecondSync", STRANGERS),
    ("fault: Bus SecondController", STRANGERS),
    ("fault: Spindle Speed", FREE_SPINDLES),
    ("fault: Spindle Angle", FREE_SPINDLES),
    ("fault: Block Probing", NO_PROBES),
    ("fault: Touched", NO_PROBES),
    ("fault: Pressed", NO_PROBES),
    ("refusal: Machine Probing", NO_PROBES),
    ("fault: Block Thread", NO_THREADS),
    ("refusal: Machine Threading", NO_THREADS),
    (
        "fault: LateWakeUp",
        "only a run that is to be strict ends with that",
    ),
    (
        "fault: NoPlan",
        "that comes after 30 s, and planners are starved for less",
    ),
    ("refusal: OneProgram", BY_RUN),
    ("refusal: NotANumber", "operators say numbers"),
];
const BY_RUN: &str = "only `run` does so, whose machine does not stay on";
const FOLLOWS: &str = "the clock of a simulated drive follows SYNC where there is one";
const FREE_SPINDLES: &str = "nothing holds back the spindles that are drawn";
const NO_LIMITS: &str = "limit switches are drawn at drives alone";
const NO_PROBES: &str = "no program probes";
const NO_SHEETS: &str = "no data sheet is drawn, and so no drive that is guarded";
const NO_TEST_MOVES: &str = "no axis is drawn that makes a test move first";
const NO_THREADS: &str = "no program cuts threads";
const STRANGERS: &str = "frames of strangers are drawn in the name of devices";

/// The kind of a value by its debug text: names of the first two variants, without what they carry.
pub(super) fn kind(value: &dyn Debug) -> String {
    let text = format!("{value:?}");
    let unquoted = text.split('"').next().unwrap_or_default();
    let names = unquoted.split(|c: char| !c.is_alphanumeric());
    let variants = names.filter(|name| name.starts_with(|c: char| c.is_ascii_uppercase()));
    let variants: Vec<&str> = variants.take(2).collect();
    variants.join(" ")
}

/// The kind of a fault.
pub(super) fn fault(fault: &Fault) -> String {
    format!("fault: {}", kind(fault))
}

/// The kind of a refusal: of the machine's with its reason.
pub(super) fn refusal(reason: &session::Refusal) -> String {
    let kind = match reason {
        session::Refusal::Machine(_) => kind(reason),
        _ => kind(reason).split(' ').take(1).collect(),
    };
    format!("refusal: {kind}")
}

/// Every kind of fault and of refusal that there is.
fn all() -> Vec<String> {
    let subjects: [(&str, &[&str]); 5] = [
        ("Device", DeviceCause::VARIANTS),
        ("Axis", AxisCause::VARIANTS),
        ("Bus", BusCause::VARIANTS),
        ("Spindle", SpindleCause::VARIANTS),
        ("Block", BlockCause::VARIANTS),
    ];
    let of = |all: &[(&str, &[&str])], names: &[&str], what: &str| -> Vec<String> {
        let causes = |name: &str| all.iter().find(|(subject, _)| *subject == name);
        let each = |name: &&str| match causes(name) {
            Some((_, causes)) => (causes.iter())
                .map(|cause| format!("{what}: {name} {cause}"))
                .collect(),
            None => vec![format!("{what}: {name}")],
        };
        names.iter().flat_map(each).collect()
    };
    let machine = [("Machine", control::Refusal::VARIANTS)];
    let mut all = of(&subjects, Fault::VARIANTS, "fault");
    all.extend(of(&machine, session::Refusal::VARIANTS, "refusal"));
    all
}

/// What was not told of all that there is, with the reason why no case meets it if there is one.
pub(super) fn not_told(told: impl Fn(&str) -> bool) -> Vec<(String, Option<&'static str>)> {
    let reason = |kind: &str| NOT_MET.iter().find(|(it, _)| *it == kind).map(|it| it.1);
    let missing = all().into_iter().filter(|kind| !told(kind));
    missing.map(|kind| (kind.clone(), reason(&kind))).collect()
}

/// What was told that no case is said to meet, and why.
pub(super) fn told_though(told: impl Fn(&str) -> bool) -> Vec<(&'static str, &'static str)> {
    NOT_MET.into_iter().filter(|(kind, _)| told(kind)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::HomingFailure;

    /// The names by which something is counted are those of the list.
    #[test]
    fn what_is_told_is_one_of_all_kinds() {
        let all = all();
        let faults = [
            Fault::Program,
            Fault::NotEnabled { input: 2 },
            Fault::Device(1, DeviceCause::HeartbeatLost),
            Fault::Axis(0, AxisCause::Homing(HomingFailure::NotFound)),
            Fault::Bus(0, BusCause::LateSetpoints { count: 3 }),
        ];
        for it in &faults {
            assert!(all.contains(&fault(it)), "{}", fault(it));
        }
        let refusals = [
            session::Refusal::Stopped,
            session::Refusal::Misspelt("G1 X".to_owned()),
            session::Refusal::Machine(control::Refusal::Untested(1)),
        ];
        for it in &refusals {
            assert!(all.contains(&refusal(it)), "{}", refusal(it));
        }
    }

    /// A reason belongs to what there is.
    #[test]
    fn what_is_not_met_is_one_of_all_kinds() {
        let all = all();
        for (kind, reason) in NOT_MET {
            assert!(all.iter().any(|it| it == kind), "{kind}: {reason}");
        }
        let missing = not_told(|kind| kind != "fault: Device NotAtRest");
        assert_eq!(missing, [("fault: Device NotAtRest".to_owned(), None)]);
        let not_met = NOT_MET.map(|(kind, _)| kind);
        assert!(told_though(|kind| kind == "fault: Device NotAtRest").is_empty());
        assert_eq!(told_though(|kind| kind == not_met[0]), [NOT_MET[0]]);
    }
}
