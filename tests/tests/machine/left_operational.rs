//! Drives that another master takes out of NMT Operational while they move, as a tool does that sends all nodes to Pre-Operational: they
//! hear no R_PDO any more and go on as they were told last. The controller's heartbeat they hear, and SDO.

use super::day::{go, settle, state};
use super::{described, losses, stepper, velocity};
use proptest::prelude::*;
use syncline_canopen::time::Duration;
use syncline_canopen::{CobId, Frame, nmt};
use syncline_controller::control::fault::{AxisCause, BusCause, DeviceCause};
use syncline_controller::control::{End, Fault, State};
use syncline_controller::port::Port;
use syncline_controller::session::Command;
use syncline_drives::twin::{Disturbance, SimulatedDevice, cia401};
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

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// One whose supply failed for a moment has all outputs off, and is told those that are safe where they are on, however
    /// long it takes to boot.
    #[test]
    fn outputs_of_an_io_node_that_booted_are_made_safe(row in 0..200usize, boot_ms in 1..3000u64) {
        let more = [
            ("cycle_us = 2000", "cycle_us = 4000"),
            ("[machine]\n", WIRED),
        ];
        let changes = [&more[..], &stepper::CHANGES].concat();
        let mut rig = Rig::staying_on("portal", &changes, |device, config| {
            if device == CABINET {
                config.boot_time = Some(Duration::from_millis(boot_ms));
            }
        });
        settle(&mut rig);
        rig.command(Command::Mdi("G1 X300 F6000".to_owned()));
        rig.run_until(|rig| rig.session.status().setpoint[0] > 20.0);
        let begin = rig.rows.len() + row;
        rig.run_to_row(begin);
        rig.twin(CABINET).disturb(Disturbance::Reset);
        settle(&mut rig);
        prop_assert_eq!(state(&rig), State::Faulted);
        let end = rig.session.timeline().now() + Duration::from_secs(4);
        rig.run_until(|rig| rig.session.timeline().now() > end);
        prop_assert_eq!(cabinet(&mut rig), (LAMP, 0));
    }
}

/// Of examples/mixed: those on its first bus, X1 that has an output, and the I/O node.
const FAST: [usize; 5] = [0, 1, 2, 4, 6];
const WITH_OUTPUT: usize = 0;
const MIXED_CABINET: usize = 6;

/// Outputs of the I/O node and of a drive, by their numbers.
const OUTPUTS: &str = r#"
[[output]]
name = "valve"
io = "cabinet"
signal = "DO9"
number = 1

[[output]]
name = "lamp"
io = "cabinet"
signal = "DO8"
safe = "on"
number = 2

[[output]]
name = "blast"
drive = "X1"
signal = "DQ0"
number = 3

[spindle]
"#;

/// When somebody takes devices out of Operational.
#[derive(Clone, Copy, Debug)]
enum Moment {
    Moving,
    Resting,
    /// So many wake-ups after the command to enable the drives.
    Enabling(u32),
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, max_shrink_iters: 20, ..ProptestConfig::default() })]

    /// Whichever devices are taken out of Operational, whenever, to Pre-operational or to Stopped, where they take no SDO
    /// either: the machine stays on and is stopped by a fault, and there no drive has power and no output is on but for those
    /// that are safe so.
    #[test]
    fn a_machine_that_is_stopped_by_a_fault_is_without_power(
        device in prop::option::of(prop::sample::select(FAST.to_vec())),
        stopped: bool,
        // Another master's command is heard, and what a device does by itself is not.
        heard: bool,
        moment in prop_oneof![
            2 => Just(Moment::Moving),
            1 => Just(Moment::Resting),
            2 => (1..400u32).prop_map(Moment::Enabling),
        ],
        row in 0..60usize,
    ) {
        let mut rig = Rig::staying_on("mixed", &[("[spindle]\n", OUTPUTS)], |_, _| ());
        settle(&mut rig);
        prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.session.faults());
        let switched = |rig: &mut Rig| {
            for line in ["M64 P1", "M65 P2", "M64 P3", "M3 S12000", "M8"] {
                go(rig, Command::Mdi(line.to_owned()));
            }
        };
        match moment {
            Moment::Moving => {
                switched(&mut rig);
                rig.command(Command::Mdi("G1 X300 Y300 F6000".to_owned()));
                rig.run_until(|rig| rig.session.status().setpoint[0] > 5.0);
                let begin = rig.rows.len() + row;
                rig.run_to_row(begin);
            }
            Moment::Resting => switched(&mut rig),
            Moment::Enabling(wake_ups) => {
                go(&mut rig, Command::Disable);
                rig.command(Command::Enable);
                (0..wake_ups).for_each(|_| { rig.step(); });
            }
        }
        let command = if stopped { nmt::Command::Stop } else { nmt::Command::EnterPreOperational };
        let node = device.map(|device| rig.layout.devices[device].device.spec().node);
        let request = nmt::Request { command, node };
        let before = rig.session.timeline().now();
        if heard {
            rig.intrude(0, request.encode());
        } else {
            rig.bus().send_acyclic(&[request.encode()]).unwrap();
        }
        rig.run_until(|rig| !rig.session.faults().is_empty());
        if heard {
            let first = Fault::Bus(0, BusCause::SecondNmtMaster { request });
            prop_assert_eq!(rig.session.faults().first(), Some(&first));
            let took = rig.session.timeline().now() - before;
            prop_assert!(took <= rig.machine.cycle * 2, "{took:?}");
        }
        let end = rig.session.timeline().now() + Duration::from_secs(9);
        rig.run_until(|rig| rig.session.timeline().now() > end);
        prop_assert_eq!(state(&rig), State::Faulted, "{:?}", rig.session.faults());
        for drive in FAST {
            let seen = rig.twin(drive).observe();
            prop_assert!(!seen.is_powered && seen.velocity.abs() < 0.01, "{drive}: {seen:?}");
        }
        let cabinet: &mut cia401::Twin = rig.twin_as(MIXED_CABINET);
        prop_assert_eq!((cabinet.outputs(), cabinet.analog_outputs()[0]), (1 << 8, 0));
        prop_assert_eq!(rig.twin(WITH_OUTPUT).outputs() & 1, 0);
        go(&mut rig, Command::Reset);
        // One side of the gantry may have stopped later than the other.
        let skewed = |fault: &Fault| matches!(fault, Fault::Axis(_, AxisCause::Skew { .. }));
        let is_askew = device.is_some_and(|it| it < 2) && rig.session.faults().iter().any(skewed);
        prop_assert!(state(&rig) == State::Ready || is_askew, "{:?}", rig.session.faults());
    }
}

/// A controller that is started beside another one hears that before it has commanded a node, and takes none from it.
#[test]
fn a_controller_that_hears_another_one_at_first_leaves_its_nodes_alone() {
    for wake_ups in [1, 2, 5, 40, 5000] {
        let mut rig = Rig::portal("G0 X10\nM2\n");
        for _ in 0..wake_ups {
            if rig.sent(CobId::NMT).is_empty() {
                rig.step();
            }
        }
        let owns = !rig.sent(CobId::NMT).is_empty();
        assert_eq!(owns, wake_ups >= 40, "{wake_ups}: {:?}", rig.phases);
        rig.intrude(0, Frame::new(CobId::SYNC, &[]));
        let fault = rig.finish_with_fault();
        assert_eq!(fault, Fault::Bus(0, BusCause::SecondSync));
        let last = rig.sent(CobId::NMT).pop().map(|it| it.frame.data()[0]);
        assert_eq!(last, owns.then_some(0x80), "{wake_ups}");
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

/// A drive that tells nobody its NMT state shows that it hears no velocity once it is to have another one, as start-up tells.
#[test]
fn a_stepper_at_a_steady_velocity_shows_it_as_start_up_tells() {
    let mut rig = losses::machine_with("G21 G90\nG1 Z-250 F3000\nM2\n", |_, _| ());
    let told = rig.layout.supervision(losses::Z);
    let expected = "shows it once axis Z is to have another one, by a following error of";
    assert!(told.contains(expected), "{told}");
    let velocity = |rig: &Rig| rig.rows.last().map_or(0.0, |row| row.plan.velocity[2]);
    rig.run_until(|rig| velocity(rig) < -49.999);
    // Until the loop has nothing more to add.
    let begin = rig.rows.len() + 100;
    rig.run_to_row(begin);
    leaves(&mut rig, losses::Z);
    rig.run_until(|rig| velocity(rig) > -49.0);
    assert!(rig.controller().faults().is_empty());
    rig.run_until(|rig| !rig.controller().faults().is_empty());
    let error = rig.rows.last().unwrap().axes[2].following_error.abs();
    let fault = rig.finish_with_fault();
    let Fault::Axis(axis, AxisCause::FollowingError { .. }) = fault else {
        panic!("{fault:?}");
    };
    let axis = &rig.layout.axes[axis];
    assert_eq!(axis.name.to_string(), "Z");
    let most = axis.limits.following_error + 50.0 * rig.machine.cycle.as_secs_f64();
    assert!(error <= most, "{error} of {most} mm");
}

/// One that is sent targets, by the next of them.
#[test]
fn a_stepper_that_goes_point_to_point_shows_it_as_start_up_tells() {
    let program = "G21 G90\nG1 X60 F3000\nG0 W6\nM2\n";
    let mut rig = losses::machine_with(program, |_, _| ());
    let told = rig.layout.supervision(losses::W);
    let time = rig.layout.state_timeout.as_secs_f64() * 1e3;
    let expected = format!("its next target, which it does not acknowledge within {time} ms");
    assert!(told.contains(&expected), "{told}");
    rig.run_to_row(100);
    leaves(&mut rig, losses::W);
    let fault = rig.finish_with_fault();
    let unacknowledged = matches!(fault, Fault::Axis(_, AxisCause::NotAcknowledged { .. }));
    assert!(unacknowledged, "{fault:?}");
}

/// Behind the drives and the encoder.
const CABINET: usize = 5;

/// Outputs beside the enable chain, which is DO3: one of them is safe where it is on.
const WIRED: &str = r#"
[spindle]
max_speed = 24000
ramp_ms = 200

[[output]]
name = "valve"
io = "cabinet"
signal = "DO9"
number = 1

[[output]]
name = "lamp"
io = "cabinet"
signal = "DO1"
safe = "on"
number = 2

[[output]]
name = "speed"
io = "cabinet"
signal = "AO0"
full_scale = 24000
function = "spindle_speed"

[machine]
"#;
const CHAIN: u16 = 1 << 3;
const VALVE: u16 = 1 << 9;
const LAMP: u16 = 1 << 1;

fn cabinet(rig: &mut Rig) -> (u16, i16) {
    let twin: &mut cia401::Twin = rig.twin_as(CABINET);
    (twin.outputs(), twin.analog_outputs()[0])
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// An I/O node hears no R_PDO either: its outputs are told their safe values by SDO, while the axes come to rest, and the
    /// enable chain opens behind that.
    #[test]
    fn outputs_of_an_io_node_are_made_safe(row in 0..200usize, words: bool) {
        let words = format!("[model.cia401]\ndigital_words = {}\n{WIRED}", u8::from(words));
        let more = [("cycle_us = 2000", "cycle_us = 4000"), ("[machine]\n", &*words)];
        let changes = [&more[..], &stepper::CHANGES].concat();
        let program = "G21 G90 G94 G61\nM3 S12000\nM64 P1\nM65 P2\nG1 X400 Y300 Z-40 F6000\nM2\n";
        let mut rig = Rig::new("portal", &changes, program, |_, _| ());
        rig.run_until(|rig| rig.rows.last().is_some_and(|row| row.plan.speed > 50.0));
        let begin = rig.rows.len() + row;
        rig.run_to_row(begin);
        prop_assert_eq!(cabinet(&mut rig), (CHAIN | VALVE, 16384));
        leaves(&mut rig, CABINET);
        let mut safe_in_motion = false;
        rig.run_until(|rig| {
            let (outputs, speed) = cabinet(rig);
            let drives = [0, 1, 2, 3].map(|drive| rig.twin(drive).observe());
            let moves = drives.iter().any(|it| it.velocity.abs() > 0.05);
            assert!(!moves || outputs & CHAIN != 0, "the chain opens while drives move");
            safe_in_motion |= moves && (outputs, speed) == (CHAIN | LAMP, 0);
            rig.end().is_some() && drives.iter().all(|it| !it.is_powered)
        });
        prop_assert!(safe_in_motion);
        let fault = rig.finish_with_fault();
        prop_assert!(matches!(fault, Fault::Device(CABINET, _)), "{fault:?}");
        prop_assert!(rig.ends_at_rest());
        prop_assert_eq!(cabinet(&mut rig), (LAMP, 0));
    }
}

/// In a machine that stays on nothing else would ever make them safe: its controller is there. After the reset they are told by R_PDO again.
#[test]
fn a_machine_that_stays_on_makes_them_safe_too_and_is_brought_back() {
    let more = [
        ("cycle_us = 2000", "cycle_us = 4000"),
        ("[machine]\n", WIRED),
    ];
    let changes = [&more[..], &stepper::CHANGES].concat();
    let mut rig = Rig::staying_on("portal", &changes, |_, _| ());
    settle(&mut rig);
    for line in ["M64 P1", "M65 P2", "M3 S12000"] {
        go(&mut rig, Command::Mdi(line.to_owned()));
    }
    rig.command(Command::Mdi("G1 X300 F6000".to_owned()));
    rig.run_until(|rig| rig.session.status().setpoint[0] > 20.0);
    assert_eq!(cabinet(&mut rig), (CHAIN | VALVE, 16384));
    leaves(&mut rig, CABINET);
    settle(&mut rig);
    assert_eq!(state(&rig), State::Faulted, "{:?}", rig.events);
    assert_eq!(cabinet(&mut rig), (LAMP, 0));
    go(&mut rig, Command::Reset);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.session.faults());
    assert_eq!(cabinet(&mut rig), (CHAIN | LAMP, 0));
    let node = rig.layout.devices[CABINET].device.spec().node;
    let before = rig.sent(CobId::r_sdo(node)).len();
    go(&mut rig, Command::Mdi("M64 P1".to_owned()));
    assert_eq!(cabinet(&mut rig), (CHAIN | LAMP | VALVE, 0));
    let behind = rig.sent(CobId::r_sdo(node)).len();
    assert_eq!(before, behind);
}

/// A drive that no R_PDO reaches from the beginning, in Operational as it is, shows it by not being enabled. Its outputs are made safe by
/// SDO then.
#[test]
fn outputs_of_a_drive_that_does_not_do_as_it_is_told_are_made_safe() {
    const LAMP: &str = "[[output]]\nname = \"lamp\"\ndrive = \"Z\"\nsignal = \"DQ0\"\nsafe = \"on\"\nnumber = 1\n\n[machine]\n";
    const Z: usize = 3;
    let mut rig = Rig::staying_on("portal", &[("[machine]\n", LAMP)], |_, _| ());
    rig.twin(Z).disturb(Disturbance::Deaf(true));
    settle(&mut rig);
    assert_eq!(state(&rig), State::Faulted);
    let fault = rig.session.faults()[0];
    let is_timeout = |cause| matches!(cause, DeviceCause::StateTimeout { .. });
    assert!(
        matches!(fault, Fault::Device(Z, cause) if is_timeout(cause)),
        "{fault:?}"
    );
    assert_eq!(rig.twin(Z).outputs() & 1, 1);
}
