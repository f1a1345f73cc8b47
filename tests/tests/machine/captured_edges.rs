//! Homing by edges that drives capture: those that a drive did not capture, or elsewhere, reference nothing.

use super::homing::{failure, go, home, is_referenced, settle, squared, state, switched_on};
use syncline_canopen::{CanId, CobId, Frame};
use syncline_controller::control::{HomingFailure, State, Wake};
use syncline_drives::twin::Disturbance;
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

/// Drives of the router, and the input that its switches of X are wired to.
const X1: usize = 0;
const X2: usize = 1;
const SWITCH: u8 = 0;

/// What the session tells of a homing of X that failed so, which stands unreferenced at rest; the next one succeeds.
fn assert_failed(rig: &mut Rig, because: HomingFailure, told: &str) {
    assert_eq!(failure(rig), Some(because), "{:?}", rig.events);
    assert_eq!(state(rig), State::Ready);
    assert!(!is_referenced(rig, AxisLetter::X));
    assert_eq!(
        rig.session.status().state_in_words(),
        "ready (unreferenced)"
    );
    assert!(rig.ends_at_rest());
    let mut texts = rig
        .events
        .iter()
        .filter_map(|event| event.describe(&*rig.layout));
    assert!(texts.any(|text| text.contains(told)), "{:?}", rig.events);
    rig.bus().doctor = None;
    let left = squared(rig, 0.1);
    assert!(left.abs() < 0.002, "{left}");
    assert!(is_referenced(rig, AxisLetter::X));
}

/// The second drive says that its touch probe has stored no edge (60B9h), as one does that another switch is wired to.
#[test]
fn an_edge_that_a_drive_did_not_capture() {
    let mut rig = switched_on(&[]);
    let answers: CanId = CobId::t_sdo(rig.machine.drives[X2].node).into();
    rig.bus().doctor = Some(Box::new(move |it| {
        if it.frame.id() == answers && it.frame.data()[..4] == [0x4B, 0xB9, 0x60, 0] {
            it.frame = Frame::new(it.frame.id(), &[0x4B, 0xB9, 0x60, 0, 0, 0, 0, 0]);
        }
        true
    }));
    go(&mut rig, home(AxisLetter::X));
    let because = HomingFailure::NotCaptured { side: 1 };
    assert_failed(
        &mut rig,
        because,
        "axis X is not homed: its second drive did not capture where its switch came on: check that the switch is wired",
    );
}

/// A switch that bounces on the slow approach, between two samples: the drive has captured that.
#[test]
fn a_switch_that_bounces_in_front_of_its_edge() {
    let mut rig = switched_on(&[]);
    let x = AxisLetter::X.index();
    rig.command(home(AxisLetter::X));
    // Towards the switch, off it, and towards it once more, by 2 mm/s.
    let approaches = |velocity: f64| (-2.0001..-1.9999).contains(&velocity);
    rig.run_until(|rig| rig.session.status().velocity[x] > 0.0);
    rig.run_until(|rig| approaches(rig.session.status().velocity[x]));
    rig.run_until(|rig| matches!(rig.controller().next_wake(), Some(Wake::Sync(_))));
    rig.twin(X1).disturb(Disturbance::Input(SWITCH, true));
    rig.step();
    rig.twin(X1).disturb(Disturbance::Input(SWITCH, false));
    settle(&mut rig);
    let because = HomingFailure::OtherEdge { side: 0 };
    assert_failed(
        &mut rig,
        because,
        "axis X is not homed: its first drive captured another place than the one where its switch came on: check whether",
    );
}
