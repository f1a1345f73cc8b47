//! Torques that drives are sent with their setpoints.

use super::torque_offsets::sent;
use std::io::Write;
use std::process::Stdio;
use std::thread;
use std::time::Duration;
use syncline_canopen::cia402::{State, Statusword};
use syncline_canopen::{CanId, CobId, Frame, NodeId};
use syncline_controller::control::{End, Fault};
use syncline_controller::machine::Machine;
use syncline_drives::bus::Transmission;
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::{PORTAL_PROGRAM, Rig};

/// Of a revolution of its motor, mm: 160 mm over a gear of 8.
pub(super) const TRAVEL: f64 = 20.0;

/// Of a revolution of its encoder.
pub(super) const COUNTS: f64 = 1_048_576.0;

/// Seconds.
pub(super) const CYCLE: f64 = 2e-3;

/// Of the motor, N·m.
pub(super) const RATED: f64 = 3.0;

/// On a belt that gives way, so that its loops are slow: 6.1e-4 kg·m² of load and 2.8e-4 of the motor, 0.1 N·m of
/// friction of the motor and 0.13 of the guide.
pub(super) const PLANT: &str = "{ motor = \"generic-3\", transmission = \"belt\", load = 60, friction = 40, gravity = -120, \
                     brake_torque = 6 }";

/// What it takes, as somebody has found who did not know the plant.
const INERTIA: f64 = 8.8e-4;
const FRICTION: f64 = 0.22;
const GRAVITY: f64 = 0.38;

/// By what it gives way as it is enabled at 0 it is not outside, and no fault.
pub(super) const WINDOWS: (&str, &str) = (
    "soft_limits = [0.0, 1000.0]\nfollowing_error_limit = 2.0\nstandstill_window = 0.05",
    "soft_limits = [-10.0, 1000.0]\nfollowing_error_limit = 2.0\nstandstill_window = 0.5",
);

/// The portal with Y on that plant, and with what else is said of that axis.
fn portal(said: &str, drive: &str) -> Rig {
    let axis = format!("max_velocity = 800.0\nsimulation = {PLANT}\n{said}");
    let replacements = [
        ("max_velocity = 800.0", axis.as_str()),
        ("model = \"cia402_csp\"", drive),
        WINDOWS,
    ];
    Rig::new("csp", &replacements, PORTAL_PROGRAM, |_, _| ())
}

fn feed_forward() -> String {
    format!(
        "feed_forward = {{ rated_torque = {RATED:?}, inertia = {INERTIA:e}, coulomb_friction = {FRICTION}, gravity = {GRAVITY} }}"
    )
}

fn node() -> NodeId {
    NodeId::new(3).unwrap()
}

/// The greatest following error of Y, mm.
fn worst(rig: &Rig) -> f64 {
    let errors = rig.rows.iter().map(|row| row.axes[1].following_error.abs());
    errors.fold(0.0, f64::max)
}

/// By how much Y gives way from where it stands without torque, in the first 40 ms for which it is enabled, mm: it is planned to rest then.
fn sags(rig: &Rig) -> f64 {
    let is_told = |it: &Transmission| it.frame.id() == CanId::from(CobId::t_pdo(2, node()));
    let told = rig.frames().into_iter().filter(is_told);
    let told = told.map(|it| match *it.frame.data() {
        [s0, s1, p0, p1, p2, p3] => (
            Statusword(u16::from_le_bytes([s0, s1])).state(),
            i32::from_le_bytes([p0, p1, p2, p3]),
        ),
        ref data => panic!("a T_PDO of {} bytes", data.len()),
    });
    let told: Vec<_> = told.collect();
    let enabled = told
        .iter()
        .filter(|it| it.0 == Some(State::OperationEnabled));
    let away = enabled.take(20).map(|it| (it.1 - told[0].1).abs()).max();
    f64::from(away.expect("it is enabled")) * TRAVEL / COUNTS
}

#[test]
fn a_soft_axis_follows_better_by_what_its_drive_is_sent() {
    let csp = "model = \"cia402_csp\"";
    let mirrored = "model = \"cia402_csp\"\ndirection = \"negative\"";
    let finished = |said: &str, drive| {
        let mut rig = portal(said, drive);
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        rig.trace().assert_within_limits();
        assert!(rig.ends_at_rest());
        rig
    };
    let without = finished("", csp);
    for drive in [csp, mirrored] {
        let with = finished(&feed_forward(), drive);
        let (was, is) = (worst(&without), worst(&with));
        println!("{drive}: {was:.4} mm, {is:.4} mm");
        assert!(is < 0.3 * was, "{is} mm in place of {was}");
        // As it is enabled, its brake opens, and it hangs on its loops alone, or on what they are sent.
        let (was, is) = (sags(&without), sags(&with));
        println!("sags {was:.4} mm, {is:.4} mm");
        assert!(is < 0.3 * was, "{is} mm in place of {was}");
    }
}

/// What the torques are parts of is the drive's, and is read before anything is written.
#[test]
fn a_motor_of_another_rated_torque_is_refused_by_name() {
    let said = "feed_forward = { rated_torque = 2.5, inertia = 8.8e-4 }";
    let mut rig = portal(said, "model = \"cia402_csp\"");
    let Fault::Device(_, cause) = rig.finish_with_fault() else {
        panic!("{:?}", rig.events);
    };
    let fault = cause.to_string();
    let expected = "object 6076h:0 (motor rated torque) reads 00000BB8h, expected 000009C4h";
    assert!(fault.contains(expected), "{fault}");
    assert!(sent(&rig, node()).is_empty());
}

/// CiA 402 does not ask for 6076h: a drive without it is refused before anything is written, with what to do.
#[test]
fn a_drive_that_does_not_tell_its_rated_torque_is_to_be_described() {
    let mut rig = portal(&feed_forward(), "model = \"cia402_csp\"");
    rig.bus().doctor = Some(Box::new(|received| {
        let answers = received.frame.id() == CanId::from(CobId::t_sdo(node()));
        if answers && received.frame.data()[1..3] == [0x76, 0x60] {
            let refused = [0x80, 0x76, 0x60, 0, 0, 0, 0x02, 0x06];
            received.frame = Frame::new(received.frame.id(), &refused);
        }
        true
    }));
    let Fault::Device(_, cause) = rig.finish_with_fault() else {
        panic!("{:?}", rig.events);
    };
    let fault = cause.to_string();
    for told in [
        "SDO read 6076h:0 aborted 0602 0000h",
        "the drive does not tell its motor's rated torque: describe it by a file of its own (docs/described.md)",
        "or leave `feed_forward` out",
    ] {
        assert!(fault.contains(told), "{fault}");
    }
    assert!(sent(&rig, node()).is_empty());
}

/// The line that `identify` tells is one of a machine file, and has what the plant takes.
#[test]
fn what_is_identified_can_be_sent() {
    let folder = Folder::new();
    let machine = |said: &str| {
        let axis = format!("max_velocity = 800.0\nsimulation = {PLANT}\n{said}");
        let text = machine_with("csp", &[("max_velocity = 800.0", &axis), WINDOWS]);
        folder.file("machine.toml", &text)
    };
    let log = folder.path("log.csv");
    let told = |machine, option: &str| {
        let mut command = syncline();
        command.args(["identify", "--axis", "Y", option]).arg(&log);
        let output = command.arg(machine).output().unwrap();
        let (code, text, errors) = ended(&output);
        assert_eq!(code, 0, "{errors}");
        let mut lines = text.lines();
        let line = lines.find(|it| it.starts_with("feed_forward = "));
        line.expect(text).to_owned()
    };
    let line = told(machine(""), "--write-log");
    let found = |said: &str| Machine::load(&machine(said)).unwrap().axes[1].feed_forward;
    // Of an axis with backlash also what turns while that is taken up: what its motor has.
    let backlash = "backlash = 0.02\n";
    let crosses = told(machine(backlash), "--log");
    let crosses = found(&format!("{backlash}{crosses}")).expect("it is stated");
    let (is, expected) = (crosses.motor_inertia, 2.8e-4);
    assert!((is / expected - 1.0).abs() < 0.03, "{is}");
    let found = found(&line).expect("it is stated");
    assert_eq!(found.motor_inertia, 0.0, "{line}");
    for (is, expected) in [
        (found.rated_torque, RATED),
        (found.inertia, 8.879e-4),
        (found.coulomb_friction, 0.2273),
        (found.viscous_friction, 8e-4),
        (found.gravity, 0.38197),
    ] {
        assert!(
            (is / expected - 1.0).abs() < 0.03,
            "{line}: {is} in place of {expected}"
        );
    }
}

/// A slip of a figure is refused before an axis jumps as it is enabled, or as it speeds up.
#[test]
fn what_no_motor_takes_is_refused() {
    let folder = Folder::new();
    for (figures, told) in [
        ("inertia = 5e-4", None),
        (
            "gravity = -2.9, coulomb_friction = 0.2",
            Some("takes 3.100 N·m to hold it up and break away"),
        ),
        (
            "inertia = 5e-4, motor_inertia = 3e-4",
            Some("`motor_inertia` of its `feed_forward` without `backlash`"),
        ),
        (
            "inertia = 8e-3",
            Some("takes 12.566 N·m at its greatest speed and acceleration"),
        ),
    ] {
        let axis =
            format!("max_velocity = 800.0\nfeed_forward = {{ rated_torque = 3.0, {figures} }}");
        let text = machine_with("csp", &[("max_velocity = 800.0", &axis)]);
        let loaded = Machine::load(&folder.file("machine.toml", &text));
        match (loaded, told) {
            (Ok(_), None) => {}
            (Err(wrong), Some(told)) => {
                let wrong = wrong.to_string();
                assert!(wrong.contains(told), "{told}\n{wrong}");
            }
            (loaded, told) => panic!("{figures}: {told:?}, {:?}", loaded.map(|_| ())),
        }
    }
}

/// Where the path comes to rest the torque changes once more: that is no motion to who looks into the frames for how long an
/// operator paused.
#[test]
fn a_pause_is_found_in_the_frames_although_torques_go_with_them() {
    let folder = Folder::new();
    let axis = format!(
        "max_velocity = 800.0\nsimulation = {PLANT}\n{}",
        feed_forward()
    );
    let text = machine_with("csp", &[("max_velocity = 800.0", &axis), WINDOWS]);
    let machine = folder.file("machine.toml", &text);
    let program = folder.file("part.ngc", "G1 X10 Y10 F3000\nM0\nX20 Y30\nM0\nX0 Y0\nM2\n");
    let log = folder.path("log");
    let mut command = syncline();
    command
        .args(["run", "--wait-for-plan"])
        .args([&machine, &program]);
    command.arg("--candump").arg(&log);
    command
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let mut run = command.spawn().unwrap();
    let mut operator = run.stdin.take().unwrap();
    for _ in 0..2 {
        thread::sleep(Duration::from_secs(2));
        operator.write_all(b"\n").unwrap();
    }
    assert!(run.wait().unwrap().success());
    let mut command = syncline();
    command.arg("replay").arg(&log).args([&machine, &program]);
    let output = command.output().unwrap();
    let (code, told, errors) = ended(&output);
    assert_eq!(code, 0, "{told}{errors}");
}
