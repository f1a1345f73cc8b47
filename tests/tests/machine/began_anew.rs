//! Drives that begin to count anew while nothing is expected of them: an axis that was homed is not where it counts then.

use super::homing::{ALL, Y, go, home, is_referenced, settle, state, switched_on};
use super::velocity::CHANGES;
use proptest::prelude::*;
use proptest::sample::select;
use syncline_controller::control::State;
use syncline_controller::session::Command;
use syncline_drives::twin::Disturbance;
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

/// A machine whose axis Y is homed, and whose first drive has been silent for long enough to be a fault.
fn faulted(mut rig: Rig) -> Rig {
    go(&mut rig, Command::Mdi("G0 Y20".to_owned()));
    rig.twin(0).disturb(Disturbance::LoseTPdos(50));
    settle(&mut rig);
    assert_eq!(state(&rig), State::Faulted, "{:?}", rig.events);
    rig
}

fn router() -> Rig {
    let mut rig = switched_on(&[]);
    go(&mut rig, ALL);
    faulted(rig)
}

/// The portal with a TLC53x for Y, which says nothing as it begins, and counts from 0 then.
fn portal() -> Rig {
    let mut changes = CHANGES.to_vec();
    let homed = "following_error_limit = 2.0\nstandstill_window = 0.05\n\
        homing = { kind = \"set_here\", position = 10.0 }\n\n[[axis]]\nname = \"Z\"";
    changes[1].1 = homed;
    let mut rig = Rig::staying_on("portal", &changes, |_, _| ());
    settle(&mut rig);
    go(&mut rig, home(AxisLetter::Y));
    faulted(rig)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 5, ..ProptestConfig::default() })]

    /// Whenever it does so between a fault and *ready*: it is not taken for homed.
    #[test]
    fn a_drive_that_begins_anew_is_not_taken_for_homed(
        of in select(vec![router as fn() -> Rig, portal]),
        before in 0..400usize,
        within in prop::option::of(0..1200usize),
    ) {
        let mut rig = of();
        prop_assert!(is_referenced(&rig, AxisLetter::Y));
        for _ in 0..before {
            rig.step();
        }
        if within.is_none() {
            rig.twin(Y).disturb(Disturbance::Reset);
            // As long as it takes to boot, and no heartbeat to be missed.
            for _ in 0..800 {
                rig.step();
            }
        }
        rig.command(Command::Reset);
        let mut left = within;
        let mut since = 0;
        while since < 8 {
            if left == Some(0) && state(&rig) != State::Ready {
                rig.twin(Y).disturb(Disturbance::Reset);
            } else if left == Some(0) {
                // It is ready before: another case.
                return Ok(());
            }
            left = left.and_then(|left| left.checked_sub(1));
            rig.step();
            let rests = matches!(state(&rig), State::Ready | State::Faulted | State::Disabled);
            since = if rests && left.is_none() { since + 1 } else { 0 };
        }
        prop_assert!(
            state(&rig) != State::Ready || !is_referenced(&rig, AxisLetter::Y),
            "{:?}", rig.events
        );
    }
}
