//! An encoder that says where an axis is, beside its drive: a TWK CRN on the screw of the portal's Z.

use proptest::prelude::*;
use syncline_canopen::{Address, CanId, CobId, NodeId};
use syncline_controller::control::fault::{AxisCause, DeviceCause};
use syncline_controller::control::{End, Event, Fault, Phase};
use syncline_drives::bus::Sender;
use syncline_drives::twin::{Config, Disturbance, ErrorClass};
use syncline_tests::rig::{PORTAL_PROGRAM, Rig};

/// The encoder's place behind the drives of the machine file.
const ENCODER: usize = 4;

/// The axis that it sees.
const Z: usize = 2;

/// Allowed difference, mm.
const LIMIT: f64 = 0.2;

/// By how much both may differ in motion without a slip, mm.
const MARGIN: f64 = 0.02;

/// Down and up again, and X meanwhile.
const PROGRAM: &str = "G21 G90 G94 G61\nG1 Z-40 X20 F12000\nG1 Z-5 X0\nM2\n";

/// On its way to −300 mm the reading turns over: 300 mm are 245 760 increments.
const TABLE: &str = r#"[[encoder]]
name = "screw"
bus = "portal"
node = 5
model = "twk_crn"
pitch = 10.0
zero = 10_000

[[axis]]
name = "X""#;

const FEEDBACK: &str = "max_jerk = 80_000.0\nfeedback = \"screw\"\ndifference_limit = 0.2";

fn node() -> NodeId {
    NodeId::new(5).unwrap()
}

fn portal_with(
    more: &[(&str, &str)],
    program: &str,
    configure: impl Fn(usize, &mut Config),
) -> Rig {
    let mut replacements = vec![
        ("[[axis]]\nname = \"X\"", TABLE),
        ("max_jerk = 80_000.0", FEEDBACK),
    ];
    replacements.extend(more);
    Rig::new("portal", &replacements, program, configure)
}

fn portal(program: &str) -> Rig {
    portal_with(&[], program, |_, _| ())
}

/// Every object that was written to the encoder.
fn written(rig: &Rig) -> Vec<String> {
    let requests = rig.sent(CobId::r_sdo(node()));
    let object = |data: &[u8]| match *data {
        [0x22..=0x2F, low, high, sub, ..] => {
            Some(Address::new(u16::from_le_bytes([low, high]), sub).to_string())
        }
        _ => None,
    };
    let written = requests.iter().filter_map(|it| object(it.frame.data()));
    written.collect()
}

/// What was told to be set anew: object, from, to.
fn rewritten(rig: &Rig) -> Vec<(String, u32, u32)> {
    let told = |event: &Event| match *event {
        Event::Rewritten {
            object,
            found,
            value,
            ..
        } => Some((object.to_string(), found, value)),
        _ => None,
    };
    rig.events.iter().filter_map(told).collect()
}

// --- it agrees ---

#[test]
fn it_agrees_through_a_program_and_where_its_reading_turns_over() {
    let mut rig = portal(PORTAL_PROGRAM);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let position = CobId::t_pdo(2, node());
    let told: Vec<u32> = (rig.frames().iter())
        .filter(|it| it.frame.id() == CanId::from(position) && it.sender != Sender::Port)
        .map(|it| u32::from_le_bytes(it.frame.data().try_into().unwrap()))
        .collect();
    // Below 10 000 increments from machine zero it reads from the end of its range again.
    assert!(told.iter().any(|it| *it < 11_000) && told.iter().any(|it| *it > 33_000_000));
    assert!(told.len() >= rig.rows.len());
}

/// T_PDO1 would flood the bus, a preset would move machine zero, and scaling deletes the preset.
#[test]
fn nothing_is_written_that_could_move_its_zero() {
    let mut rig = portal(PROGRAM);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let first = CanId::from(CobId::t_pdo(1, node()));
    assert!(rig.frames().iter().all(|it| it.frame.id() != first));
    let expected = [
        "1800h:1", "100Ch:0", "100Dh:0", "1802h:3", "1802h:2", "1802h:1",
    ];
    assert_eq!(written(&rig), expected);
    assert_eq!(rewritten(&rig), []);
}

/// An encoder that counts otherwise is set to count as the machine file says, which is told.
#[test]
fn its_scaling_is_written_where_it_is_another_one() {
    let scaled = "[model.twk_crn]\nunits_per_turn = 4000\nturns_exponent = 5\n[[encoder]]";
    let mut rig = portal_with(&[("[[encoder]]", scaled)], PROGRAM, |_, _| ());
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_eq!(
        rewritten(&rig),
        [
            ("6000h:0".into(), 0, 4),
            ("6001h:0".into(), 8192, 4000),
            ("6002h:0".into(), 8192 * 4096, 4000 << 5)
        ]
    );
    assert_eq!(written(&rig)[..3], ["6000h:0", "6001h:0", "6002h:0"]);
}

/// Noise, delays and oscillators of a hundred machines, and no difference in any.
#[test]
fn a_hundred_machines_agree() {
    for seed in 0..100 {
        let mut rig = portal_with(&[], PROGRAM, |device, config| {
            config.seed = seed << 8 | device as u64;
        });
        assert_eq!(rig.finish(), End::Finished, "seed {seed}: {:?}", rig.events);
    }
}

// --- it disagrees ---

/// Interferes at a row of the program; the fault, and how many cycles it took.
fn found(rig: &mut Rig, row: usize, interfere: impl FnOnce(&mut Rig)) -> (Fault, usize) {
    rig.run_to_row(row);
    interfere(rig);
    let before = rig.rows.len();
    rig.run_until(|rig| !rig.controller().faults().is_empty());
    let cycles = rig.rows.len() - before;
    (rig.finish_with_fault(), cycles)
}

fn difference(fault: Fault) -> f64 {
    match fault {
        Fault::Axis(Z, AxisCause::FeedbackDifference { difference }) => difference,
        fault => panic!("another fault: {fault:?}"),
    }
}

#[test]
fn a_slip_is_found_at_the_next_sync_and_stops_the_machine_on_its_path() {
    let mut rig = portal(PROGRAM);
    let (fault, cycles) = found(&mut rig, 60, |rig| rig.slip(0, 0.05));
    assert!((difference(fault) - 0.5).abs() < MARGIN, "{fault:?}");
    assert!(cycles <= 1, "{cycles}");
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
    let text = fault.describe(&*rig.layout);
    assert!(text.starts_with("axis Z: its encoder is "), "{text}");
}

/// What slipped while the machine was off shows before a drive is switched on.
#[test]
fn a_difference_from_before_is_found_before_the_drives_are_enabled() {
    let mut rig = portal_with(&[], PROGRAM, |device, config| {
        if device == ENCODER {
            config.position -= 0.1;
        }
    });
    let fault = rig.finish_with_fault();
    assert!((difference(fault) + 1.0).abs() < MARGIN, "{fault:?}");
    let mut phases = rig.phases.iter();
    assert!(phases.all(|(phase, _)| *phase != Phase::OperationEnabled));
}

/// A broken coupling is found at the first SYNC at which the axis is further away than is allowed.
#[test]
fn a_broken_coupling_is_found_once_the_axis_has_left_it() {
    // So slow that it matters little when in its cycle it breaks.
    let mut rig = portal("G21 G90 G94 G61\nG1 Z-40 F600\nM2\n");
    rig.run_to_row(200);
    rig.part(0);
    let stays = rig.rows.last().unwrap().axes[Z].act;
    let before = rig.rows.len();
    let told = difference(rig.finish_with_fault()).abs();
    let mut away = (rig.rows[before..].iter()).map(|row| (row.axes[Z].act - stays).abs());
    let surely = away.find(|away| *away > LIMIT + MARGIN).unwrap();
    assert!(told > LIMIT && told <= surely + MARGIN, "{told}, {surely}");
}

#[test]
fn an_encoder_that_is_lost_stops_the_machine_by_its_missing_t_pdo() {
    for disturbance in [
        Disturbance::Mute(true),
        Disturbance::Reset,
        Disturbance::LoseTPdos(5),
    ] {
        let mut rig = portal(PROGRAM);
        let (fault, cycles) = found(&mut rig, 60, |rig| rig.twin(ENCODER).disturb(disturbance));
        let missing = DeviceCause::MissingTPdo { misses: 2 };
        assert_eq!(fault, Fault::Device(ENCODER, missing), "{disturbance:?}");
        assert!(cycles <= 3, "{disturbance:?}: {cycles}");
        rig.trace().assert_within_limits();
    }
    let mut rig = portal(PROGRAM);
    rig.run_to_row(60);
    rig.twin(ENCODER).disturb(Disturbance::LoseTPdos(1));
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
}

#[test]
fn its_own_error_stops_the_machine() {
    let mut rig = portal(PROGRAM);
    let error = Disturbance::Fault(ErrorClass::StopAndSwitchOff);
    let (fault, _) = found(&mut rig, 60, |rig| rig.twin(ENCODER).disturb(error));
    let text = fault.describe(&*rig.layout);
    let expected = "node 5 (screw, TWK CRN): EMCY FFFFh, error register 81h";
    assert!(text.starts_with(expected), "{text}");
}

#[test]
fn an_encoder_that_does_not_answer_is_told_by_name() {
    let mut rig = portal(PROGRAM);
    rig.twin(ENCODER).disturb(Disturbance::Mute(true));
    let fault = Fault::Device(ENCODER, DeviceCause::NoAnswer);
    assert_eq!(rig.finish_with_fault(), fault);
}

/// Six switches tell 64 nodes apart.
#[test]
fn a_node_id_that_it_cannot_have_is_refused() {
    let file = syncline_tests::command::machine_file("mixed");
    let text = std::fs::read_to_string(&file).unwrap();
    for (node, allowed) in [(64, true), (65, false), (126, false)] {
        let text = text.replace(
            "bus = \"slow\"\nnode = 5",
            &format!("bus = \"slow\"\nnode = {node}"),
        );
        let wrong = syncline_controller::machine::Machine::parse(&file, &text).err();
        let told = wrong.map(|wrong| wrong.to_string()).unwrap_or_default();
        let expected = format!("encoder \"screw\": node {node} is none that a TWK CRN can have");
        assert_eq!(told.contains(&expected), !allowed, "{told}");
        assert_eq!(told.is_empty(), allowed, "{told}");
    }
}

#[test]
fn another_disc_is_refused() {
    let mut rig = portal_with(&[], PROGRAM, |device, config| {
        if device == ENCODER {
            config.assumed = vec![("steps_per_turn", 4096)];
        }
    });
    let text = rig.finish_with_fault().describe(&*rig.layout);
    let expected = "6501h:0 (steps per turn) reads 00001000h, expected 00002000h";
    assert!(text.contains(expected), "{text}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// Slips of every size, either way and at any time. What is clearly beyond the limit is found, at its
    /// full size, so before anything else has moved; what is clearly within it never.
    #[test]
    fn a_slip_is_found_if_it_is_beyond_the_limit(
        row in 5..150usize, size in 0.0..0.5f64, backward: bool,
    ) {
        let turns = if backward { -size } else { size };
        let mut rig = portal(PROGRAM);
        rig.run_to_row(row);
        rig.slip(0, turns);
        let end = rig.finish();
        if size * 10.0 > LIMIT + MARGIN {
            let End::Fault(fault) = end else {
                return Err(TestCaseError::fail(format!("not found: {end:?}")));
            };
            prop_assert!((difference(fault) - turns * 10.0).abs() < MARGIN, "{fault:?}");
        } else if size * 10.0 < LIMIT - MARGIN {
            prop_assert_eq!(end, End::Finished);
        }
    }
}
