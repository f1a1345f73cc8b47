//! A drive by the profile alone, in Cyclic Synchronous Position, as one axis of a portal of LXM32M.

use crate::validate::digest;
use proptest::prelude::*;
use serde_json::Value;
use syncline_canopen::cia402::Statusword;
use syncline_canopen::{Address, CanId, CobId, Frame, NodeId, nmt};
use syncline_controller::bus::Received;
use syncline_controller::control::fault::DeviceCause;
use syncline_controller::control::{End, Fault, Phase};
use syncline_drives::bus::{Sender, Transmission};
use syncline_drives::twin::cia402_csp::{DriveError, Twin};
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_tests::command::{Folder, ended, machine_with, root, syncline};
use syncline_tests::rig::{PORTAL_PROGRAM, Rig};

/// The drive's place in the machine file.
const Y: usize = 2;

/// A row of [`PORTAL_PROGRAM`] in the midst of its first arc.
const ON_THE_ARC: usize = 900;

/// The PDOs as the example's file has them.
const PDOS: &str = "r_pdo = 2\nt_pdo = 2";

/// The increments that the drive reports at Y0.
const ZERO: i32 = 3_217_048;

fn node() -> NodeId {
    NodeId::new(3).unwrap()
}

fn portal(replacements: &[(&str, &str)]) -> Rig {
    Rig::new("csp", replacements, PORTAL_PROGRAM, |_, _| ())
}

/// Controlword and target position of each R_PDO.
fn commands(rig: &Rig, r_pdo: u8) -> Vec<(u16, i32)> {
    let command = |it: &Transmission| match *it.frame.data() {
        [c0, c1, p0, p1, p2, p3] => (
            u16::from_le_bytes([c0, c1]),
            i32::from_le_bytes([p0, p1, p2, p3]),
        ),
        ref data => panic!("an R_PDO of {} bytes", data.len()),
    };
    let frames = rig.sent(CobId::r_pdo(r_pdo, node()));
    frames.iter().map(command).collect()
}

fn is(received: &Received, id: CobId, begin: &[u8]) -> bool {
    received.frame.id() == CanId::from(id)
        && !received.echo
        && received.frame.data().starts_with(begin)
}

/// Controlwords of a drive that is enabled, and switched off once the axes rest.
const SWITCHED_OFF: [u16; 5] = [0x00, 0x06, 0x0F, 0x06, 0x00];
/// Controlwords of a drive that is enabled, and comes to rest by its own quick stop.
const QUICK_STOPPED: [u16; 5] = [0x00, 0x06, 0x0F, 0x0B, 0x00];

/// The drive was switched off in its order, and nothing was enabled again.
fn assert_switched_off(rig: &mut Rig, controlwords: [u16; 5]) {
    let mut words: Vec<u16> = commands(rig, 2).iter().map(|it| it.0).collect();
    words.dedup();
    assert_eq!(words, controlwords);
    for drive in 0..rig.machine.drives.len() {
        assert!(!rig.twin(drive).observe().is_powered, "drive {drive}");
    }
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
}

// --- it works ---

/// The example's bracket, with all that `validate` checks: path, limits, following error.
#[test]
fn the_bracket_passes_and_is_the_same_each_time() {
    let folder = Folder::new();
    let machine = folder.file("machine.toml", &machine_with("csp", &[]));
    let portal = root().join("examples/portal");
    let tables = std::fs::read_to_string(portal.join("machine.tables.toml")).unwrap();
    let _tables = folder.file("machine.tables.toml", &tables);
    let validated = |seed: &str| -> Value {
        let mut command = syncline();
        command.arg("validate").arg(&machine);
        command.arg(portal.join("bracket.ngc"));
        let output = command.args(["--json", "-", "--seed", seed]).output();
        let output = output.unwrap();
        let (code, json, errors) = ended(&output);
        assert_eq!(code, 0, "{json}{errors}");
        serde_json::from_str(json).unwrap()
    };
    let [once, again, other] = ["7", "7", "8"].map(validated);
    assert_eq!(once["verdict"], "pass", "{once:#}");
    assert_eq!(once["violations"], Value::Array(vec![]));
    assert_eq!(once["frames_sha256"], again["frames_sha256"]);
    assert_ne!(once["frames_sha256"], other["frames_sha256"]);
}

/// The same frames on every machine: these digests are kept.
#[test]
fn the_examples_frames_are_those_of_its_seed() {
    let folder = root().join("examples/csp");
    let (machine, program) = (folder.join("machine.toml"), folder.join("pocket.ngc"));
    for (seed, kept) in [("0", "2739154b9e405cab"), ("7", "b67411d5dd23707a")] {
        let now = digest(&machine, &program, &["--seed", seed]);
        assert!(now.starts_with(kept), "seed {seed}: {now}");
    }
}

#[test]
fn it_follows_beside_its_neighbours() {
    let mut rig = portal(&[]);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_switched_off(&mut rig, SWITCHED_OFF);
    let [x, y] = [0, 1].map(|axis| {
        let errors = rig.rows.iter().map(|row| row.axes[axis].following_error);
        errors.fold(0.0, |most: f64, error| most.max(error.abs()))
    });
    // As well as the LXM32M, which has the same loops behind it.
    assert!(y > 0.0 && y < 0.2, "{y} mm, X {x} mm");
}

#[test]
fn other_pdos_do_the_same() {
    for (numbers, r_pdo, t_pdo) in [
        ("r_pdo = 1\nt_pdo = 1", 1, 1),
        ("r_pdo = 3\nt_pdo = 4", 3, 4),
        ("r_pdo = 4\nt_pdo = 1\npdos = 4", 4, 1),
    ] {
        let mut rig = portal(&[(PDOS, numbers)]);
        assert_eq!(rig.finish(), End::Finished, "{numbers}: {:?}", rig.events);
        let used = |sender: fn(&Transmission) -> bool, ids: [CobId; 4]| {
            let frames = rig.frames();
            ids.map(|id| {
                let of = |it: &&Transmission| sender(it) && it.frame.id() == CanId::from(id);
                frames.iter().filter(of).count() > 0
            })
        };
        let alone = |number: u8| [1, 2, 3, 4].map(|other| other == number);
        let r_pdos = [1, 2, 3, 4].map(|n| CobId::r_pdo(n, node()));
        let t_pdos = [1, 2, 3, 4].map(|n| CobId::t_pdo(n, node()));
        assert_eq!(used(|it| it.sender == Sender::Port, r_pdos), alone(r_pdo));
        assert_eq!(used(|it| it.sender != Sender::Port, t_pdos), alone(t_pdo));
    }
}

#[test]
fn a_coarser_encoder_does_the_same() {
    let encoder = (
        "encoder_increments = 1_048_576",
        "encoder_increments = 10_000",
    );
    let mut rig = portal(&[encoder, ("zero = 3_217_048", "zero = 30_680")]);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_switched_off(&mut rig, SWITCHED_OFF);
}

/// Bit 12 follows enabling, and the first target is where the drive stands.
fn assert_no_jump(rig: &mut Rig) {
    rig.run_to(Phase::ReadyToSwitchOn);
    let before = rig.twin(Y).observe().position;
    rig.run_to(Phase::Program);
    let statusword = rig.twin_as::<Twin>(Y).statusword();
    assert!(statusword.has(Statusword::MODE_12), "{statusword}");
    let commands = commands(rig, 2);
    let mut enabled = commands.iter().filter(|it| it.0 == 0x0F);
    let first = enabled.next().expect("enabled").1;
    let stands = before * 1_048_576.0;
    assert!((f64::from(first) - stands).abs() < 20.0, "{first} {stands}");
    // From then on it is held there, not sent after its own noise.
    assert!(enabled.all(|it| it.1 == first));
    let after = rig.twin(Y).observe().position;
    assert!((after - before).abs() < 1e-4, "{before} {after} rev");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn wherever_it_stands_enabling_moves_it_not(mm in 0.0..1000.0, seed: u64) {
        let mut rig = Rig::new("csp", &[], PORTAL_PROGRAM, |drive, config| {
            if drive == Y {
                config.position = f64::from(ZERO) / 1_048_576.0 + mm / 20.0;
                config.seed = seed;
            }
        });
        assert_no_jump(&mut rig);
    }
}

// --- what is refused at the start ---

/// A drive that reads otherwise than the machine file says is never written to.
#[test]
fn another_resolution_or_gear_is_refused_by_name() {
    for (index, sub, found, text) in [
        (
            0x608F,
            1,
            131_072,
            "object 608Fh:1 (encoder increments) reads 00020000h, expected 00100000h",
        ),
        (
            0x608F,
            2,
            2,
            "object 608Fh:2 (motor revolutions) reads 00000002h, expected 00000001h",
        ),
        (
            0x6091,
            1,
            3,
            "object 6091h:1 (gear ratio, motor shaft) reads 00000003h, expected 00000001h",
        ),
        (
            0x6502,
            0,
            1,
            "object 6502h:0 (supported drive modes) reads 00000001h, expected 00000080h",
        ),
    ] {
        let object = Address::new(index, sub);
        let mut rig = portal(&[]);
        rig.twin_as::<Twin>(Y).preset(object, found);
        let Fault::Device(Y, cause @ DeviceCause::WrongIdentity { .. }) = rig.finish_with_fault()
        else {
            panic!("{:?}", rig.events);
        };
        assert!(cause.to_string().starts_with(text), "{cause}");
        assert!(commands(&rig, 2).is_empty());
        let written = rig.sent(CobId::r_sdo(node()));
        let mode = [0x2F, 0x60, 0x60];
        assert!(!written.iter().any(|it| it.frame.data().starts_with(&mode)));
    }
}

#[test]
fn another_mode_displayed() {
    let mut rig = portal(&[]);
    rig.bus().doctor = Some(Box::new(|it| {
        if is(it, CobId::t_sdo(node()), &[0x4F, 0x61, 0x60, 0]) {
            let mut data = it.frame.data().to_vec();
            data[4] = 1;
            it.frame = Frame::new(it.frame.id(), &data);
        }
        true
    }));
    let expected = DeviceCause::WrongMode {
        object: Address::new(0x6061, 0),
        expected: 8,
        found: 1,
    };
    assert_eq!(rig.finish_with_fault(), Fault::Device(Y, expected));
    assert_eq!(rig.rows.len(), 0, "nothing moved");
}

// --- what goes wrong in motion ---

fn fault_in_motion(interfere: impl FnOnce(&mut Rig)) -> Fault {
    let mut rig = portal(&[]);
    rig.run_to_row(ON_THE_ARC);
    interfere(&mut rig);
    let fault = rig.finish_with_fault();
    assert_switched_off(&mut rig, QUICK_STOPPED);
    fault
}

#[test]
fn an_emcy_message() {
    let error = DriveError {
        class: ErrorClass::SwitchOff,
        code: 0x3130,
        register: 4,
    };
    let fault = fault_in_motion(|rig| rig.twin_as::<Twin>(Y).raise(error));
    let Fault::Device(Y, DeviceCause::Emergency { emergency }) = fault else {
        panic!("{fault:?}");
    };
    assert_eq!((emergency.code, emergency.register), (0x3130, 5));
}

#[test]
fn a_fault_in_the_statusword_alone() {
    let fault = fault_in_motion(|rig| {
        rig.bus().doctor = Some(Box::new(|it| !is(it, CobId::emcy(node()), &[])));
        rig.twin(Y)
            .disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
    });
    assert!(
        matches!(fault, Fault::Device(Y, DeviceCause::Reported { .. })),
        "{fault:?}"
    );
}

#[test]
fn a_lost_heartbeat() {
    let fault = fault_in_motion(|rig| {
        let silent = |it: &mut Received| !is(it, CobId::error_control(node()), &[]);
        rig.bus().doctor = Some(Box::new(silent));
    });
    assert_eq!(fault, Fault::Device(Y, DeviceCause::HeartbeatLost));
}

/// A neighbour's fault brings it to rest with the others.
#[test]
fn a_neighbours_fault() {
    let fault = fault_in_motion(|rig| rig.twin(0).disturb(Disturbance::Mute(true)));
    assert_eq!(
        fault,
        Fault::Device(0, DeviceCause::MissingTPdo { misses: 2 })
    );
}

#[test]
fn a_blocked_axis_is_the_drives_own_following_error() {
    let mut rig = portal(&[]);
    rig.run_to_row(ON_THE_ARC);
    rig.twin(Y).disturb(Disturbance::Block(true));
    let fault = rig.finish_with_fault();
    let Fault::Device(Y, DeviceCause::Emergency { emergency }) = fault else {
        panic!("{fault:?}");
    };
    assert_eq!(emergency.code, 0x8611);
    assert_switched_off(&mut rig, QUICK_STOPPED);
}

/// The controller is gone: the drive comes to rest by itself, with EMCY 8700h.
#[test]
fn sync_that_stays_away() {
    let mut rig = portal(&[]);
    rig.run_to_row(ON_THE_ARC);
    let state = rig.twin(Y).observe();
    assert!(state.is_powered && state.nmt_state == nmt::State::Operational);
    let now = rig.syncs().last().copied().unwrap();
    let twin = rig.twin(Y);
    twin.run_until(now + syncline_canopen::time::Duration::from_millis(500));
    let seen = twin.observe();
    assert!(!seen.is_powered && seen.velocity.abs() < 1e-3, "{seen:?}");
}
