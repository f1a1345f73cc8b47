//! Drives that another master takes out of NMT Operational while they move, as a tool does that sends all nodes to Pre-Operational: they
//! hear no R_PDO any more and go on as they were told last. The controller's heartbeat they hear, and SDO.

use super::day::{go, settle, state};
use super::{described, losses, velocity};
use proptest::prelude::*;
use syncline_canopen::nmt;
use syncline_canopen::time::Duration;
use syncline_controller::control::{End, State};
use syncline_controller::port::Port;
use syncline_controller::session::Command;
use syncline_tests::rig::Rig;

/// Sends a device there that is the only one of these on the first bus.
fn leaves(rig: &mut Rig, device: usize) {
    let command = nmt::Command::EnterPreOperational;
    let node = Some(rig.layout.devices[device].device.spec().node);
    let frame = nmt::Request { command, node }.encode();
    rig.bus().send_acyclic(&[frame]).unwrap();
}

/// Has a drive leave Operational; how far it goes from there, and from the fault that follows, until it stands, revolutions.
fn goes_on(mut rig: Rig, device: usize) -> [f64; 2] {
    let before = rig.twin(device).observe();
    assert!(before.velocity.abs() > 0.5, "{before:?}");
    leaves(&mut rig, device);
    rig.run_until(|rig| !rig.controller().faults().is_empty());
    let at_fault = rig.twin(device).observe();
    assert!(matches!(rig.finish(), End::Fault(_)), "{:?}", rig.events);
    let end = rig.session.timeline().now() + Duration::from_secs(1);
    rig.session.timeline().world().advance_to(end);
    let after = rig.twin(device).observe();
    assert!(
        after.velocity.abs() < 0.01 && !after.is_powered,
        "{after:?}"
    );
    [before, at_fault].map(|it| (after.position - it.position).abs())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// A TLC53x is as far from there as its quick stop takes it, and the cycles until it is missed and told by SDO.
    #[test]
    fn a_drive_that_is_sent_velocities_stops(share in 0.1..0.99f64, row in 0..40usize) {
        let speed = 800.0 * share;
        let program = format!("G21 G90 G94 G61\nG1 Y900 F{}\nM2\n", speed * 60.0);
        let mut rig = Rig::new("portal", &velocity::CHANGES, &program, |_, _| ());
        rig.run_until(|rig| rig.rows.last().is_some_and(|row| row.plan.velocity[1] > 0.999 * speed));
        let begin = rig.rows.len() + row;
        rig.run_to_row(begin);
        let [way, _] = goes_on(rig, 2);
        // Three cycles until it is missed, four until it has the request; what its loop lags by, twice.
        let most = speed * speed / (2.0 * 5000.0) + speed * (7.0 * 2e-3 + 2.0 * 12.5e-3) + 1.0;
        prop_assert!(way * 20.0 <= most, "{speed} mm/s: {} of {most} mm", way * 20.0);
    }
}

/// A TSP10-CBE is asked by SDO, and answers as before: that it hears no velocities any more shows by the following error, once they would
/// be others. Then it stops.
#[test]
fn a_stepper_that_is_sent_velocities_stops() {
    let mut rig = losses::machine_with("G21 G90\nG1 Z-250 F3000\nM2\n", |_, _| ());
    rig.run_until(|rig| {
        rig.rows
            .last()
            .is_some_and(|row| row.plan.velocity[2] < -49.9)
    });
    // A quick stop with 800 mm/s² from 50 mm/s, and the cycles until it has the request.
    let [_, way] = goes_on(rig, losses::Z);
    assert!(way * 10.0 <= 1.6 + 50.0 * 0.06, "{} mm", way * 10.0);
}

/// So it is with drives of the profile, whoever made them.
#[test]
fn drives_of_the_profile_that_are_sent_velocities_stop() {
    for drive in [0, 1] {
        let program = "G21 G90\nG1 X250 Y180 F6000\nM2\n";
        let mut rig = described::velocity_with(program, |_, _| ());
        rig.run_to_row(300);
        let [way, _] = goes_on(rig, drive);
        // A few cycles at 80 mm/s; 6085h, as it is after power-on, has it stand at once.
        assert!(way * 10.0 <= 10.0, "{drive}: {} mm", way * 10.0);
    }
}

/// In a machine that stays on nothing else would ever stop it: its controller is there.
#[test]
fn a_machine_that_stays_on_stops_it_too_and_is_brought_back() {
    let mut rig = losses::staying_on(&[]);
    settle(&mut rig);
    rig.command(Command::Mdi("G1 Y300 F6000".to_owned()));
    rig.run_until(|rig| rig.session.status().setpoint[1] > 20.0);
    leaves(&mut rig, losses::Y);
    settle(&mut rig);
    assert_eq!(state(&rig), State::Faulted, "{:?}", rig.events);
    let seen = rig.twin(losses::Y).observe();
    assert!(seen.velocity.abs() < 0.01 && !seen.is_powered, "{seen:?}");
    go(&mut rig, Command::Reset);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.session.faults());
}
