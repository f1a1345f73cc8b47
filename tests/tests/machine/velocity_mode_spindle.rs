//! A spindle that a CiA 402 drive on the bus turns in its velocity mode (vl): `examples/drill` with a `cia402_vl`.

use proptest::prelude::*;
use proptest::sample::select;
use syncline_canopen::{CobId, NodeId};
use syncline_controller::control::{End, Fault, Phase};
use syncline_controller::machine::Machine;
use syncline_controller::program::Programs;
use syncline_drives::twin::Disturbance;
use syncline_tests::command::machine_file;
use syncline_tests::rig::Rig;

use super::driven_spindle::{
    self, CUT, FROM_NEAR, LOSSES, SPINDLE, TWO_SPEEDS, assert_cuts_at_speed, assert_let_go_at_rest,
    assert_lost, assert_resumes_behind_a_fault, assert_stands_before_power_is_taken_off,
    assert_waits_for_a_held_rotor, line, measured, program, turns_at,
};

const PV: &str = "model = \"cia402_pv\"\n\n# Its data sheet: a 20-bit encoder; 60FFh in 0.1 1/min.\n[model.cia402_pv]\nencoder_increments = 1_048_576\nvelocity_units = 10";
const VL: &str = "model = \"cia402_vl\"\n\n[model.cia402_vl]\nvelocity_units = 10";

fn drill(program: &str) -> Rig {
    driven_spindle::drill_with(&[(PV, VL)], program, |_, _| ())
}

/// Controlwords and speeds in units of 6042h that the drive was sent, one after the other.
fn sent(rig: &Rig) -> (Vec<u16>, Vec<i16>) {
    let frames = rig.sent(CobId::r_pdo(1, NodeId::new(4).unwrap()));
    let told = frames.iter().map(|it| match *it.frame.data() {
        [c0, c1, v0, v1] => (u16::from_le_bytes([c0, c1]), i16::from_le_bytes([v0, v1])),
        ref data => panic!("{data:?}"),
    });
    let (mut words, mut speeds): (Vec<_>, Vec<_>) = told.unzip();
    words.dedup();
    speeds.dedup();
    (words, speeds)
}

#[test]
fn it_turns_either_way_and_each_cut_waits_for_its_speed() {
    let mut rig = drill(TWO_SPEEDS);
    rig.run_to(Phase::ModeEnd);
    let standing = turns_at(&mut rig).abs();
    assert!(standing < 2.0, "{standing} 1/min");
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let (words, speeds) = sent(&rig);
    // The ramp runs and leads to zero, and to the speed while the program runs.
    assert_eq!(words, [0x00, 0x06, 0x3F, 0x7F, 0x3F, 0x06, 0x00]);
    assert_eq!(speeds, [0, 20_000, -5_000, 0]);
    assert_cuts_at_speed(&rig);
    assert_let_go_at_rest(&mut rig);
    // It took its ramp, 300 ms from rest to 3000 1/min, both ways.
    let row = |speed: f64| {
        let mut rows = rig.rows.iter();
        rows.position(|row| (measured(row) - speed).abs() < 20.0)
    };
    let [begun, there] = [100.0, 2000.0].map(|speed| row(speed).unwrap());
    let ramp = (there - begun) as f64 * rig.machine.cycle.as_secs_f64();
    assert!((0.18..0.22).contains(&ramp), "{ramp} s");
}

#[test]
fn a_drive_that_counts_otherwise_is_told_so_or_known_to() {
    for (model, speeds) in [
        ("velocity_units = 1", [0, 2000, -500, 0]),
        // 604Ch says 1/min in 4 units; a drive without counts so by itself.
        ("velocity_units = 4", [0, 8000, -2000, 0]),
        (
            "velocity_units = 4\nhas_dimension_factor = 0",
            [0, 8000, -2000, 0],
        ),
    ] {
        let model = format!("model = \"cia402_vl\"\n\n[model.cia402_vl]\n{model}");
        let mut rig = driven_spindle::drill_with(&[(PV, &*model)], TWO_SPEEDS, |_, _| ());
        rig.run_until(|rig| {
            let row = rig.rows.last();
            row.is_some_and(|row| row.plan.position[0] > 15.0) || rig.end().is_some()
        });
        let motor = turns_at(&mut rig);
        assert!((motor - 2000.0).abs() < 20.0, "{motor} 1/min");
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        assert_eq!(sent(&rig).1, speeds);
    }
}

#[test]
fn left_on_it_stands_before_power_is_taken_off() {
    assert_stands_before_power_is_taken_off(drill);
}

#[test]
fn it_is_held_to_what_it_can_do_when_files_are_checked() {
    let file = machine_file("drill");
    let text = std::fs::read_to_string(&file).unwrap().replace(PV, VL);
    let parse = |text: &str| Machine::parse(&file, text).map_err(|it| it.to_string());
    let machine = parse(&text).unwrap();
    let programs = Programs::new(&machine, &file).unwrap();
    let checked = |lines: &str| {
        let text = format!("G21 G90\n{lines}\nM2\n");
        let program = programs.text("part.ngc", text.as_bytes());
        program
            .check(machine.rest())
            .map(|_| ())
            .map_err(|it| it.to_string())
    };
    for speed in ["60", "3000", "0"] {
        checked(&format!("M3 S{speed}\nG1 X1 F100")).unwrap();
    }
    for (lines, told) in [
        ("M3 S3000.1\nG1 X1 F100", "S3000.1"),
        ("M4 S59\nG1 X1 F100", "S59"),
        ("M3 S500\nG33 Z-20 K1", "G33"),
        ("M3 S500\nG33.1 Z-20 K1", "G33.1"),
    ] {
        let wrong = checked(lines).unwrap_err();
        assert!(wrong.contains(told), "{wrong}");
    }
    for (from, to, told) in [
        // 6042h has 16 bits.
        (
            "max_speed = 3000",
            "max_speed = 3277",
            "beyond what drive \"spindle\" can be sent",
        ),
        (
            "drives = [\"X\"]",
            "drives = [\"spindle\"]",
            "axis \"X\": drive \"spindle\" (CiA 402 VL) tells no position",
        ),
        ("ramp_ms = 300 ", "ramp_ms = 0 ", "`ramp_ms` is 0"),
    ] {
        assert!(text.contains(from));
        let wrong = parse(&text.replace(from, to)).unwrap_err();
        assert!(wrong.contains(told), "{wrong}");
    }
}

/// What 6044h tells is what counts.
#[test]
fn no_cut_begins_before_it_turns() {
    assert_waits_for_a_held_rotor(drill(TWO_SPEEDS));
}

#[test]
fn a_cut_whose_spindle_falls_away_stops_on_the_path() {
    let mut rig = drill(CUT);
    rig.run_to_row(400);
    rig.twin(SPINDLE).disturb(Disturbance::Block(true));
    let before = rig.rows.len();
    let fault = rig.finish_with_fault();
    assert!(
        matches!(fault, Fault::SpindleSpeed { told, .. } if told == 2400.0),
        "{fault:?}"
    );
    assert!(rig.rows[before..].iter().all(|row| !row.axes[0].by_itself));
    assert_eq!(sent(&rig).1, [0, 24_000, 0]);
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
}

/// What stops the machine for another reason stops the spindle by its ramp, and after the reset the cut waits for it.
#[test]
fn after_a_fault_it_stands_and_has_its_speed_again_before_the_cut_goes_on() {
    for failing in [0, SPINDLE] {
        let rig = driven_spindle::begun_with(&[(PV, VL)], FROM_NEAR);
        assert_resumes_behind_a_fault(rig, failing);
    }
}

#[test]
fn each_loss_of_it_stops_the_axes_on_their_path_with_its_own_message() {
    for loss in LOSSES {
        assert_lost(drill(CUT), "VL", 400, loss);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

    /// Speeds reach the drive in the program's order, each cut goes on at its speed, everything stands in the end, and a
    /// second run sends the same frames.
    #[test]
    fn any_program_turns_it_in_order(
        lines in prop::collection::vec(line(), 1..16),
        mode in select(vec!["G61", "G61.1", "G64"]),
        ramp in 150..1500u32,
    ) {
        let (text, told) = program(&lines, mode);
        let ramp = format!("ramp_ms = {ramp} ");
        let replacements = [(PV, VL), ("ramp_ms = 300 ", &*ramp)];
        let drill = |text: &str| driven_spindle::drill_with(&replacements, text, |_, _| ());
        let mut rig = drill(&text);
        prop_assert_eq!(rig.finish(), End::Finished, "{}", text);
        let speeds: Vec<f64> = sent(&rig).1.iter().map(|it| f64::from(*it) / 10.0).collect();
        prop_assert_eq!(speeds, told, "{}", text);
        assert_cuts_at_speed(&rig);
        assert_let_go_at_rest(&mut rig);
        let mut again = drill(&text);
        again.finish();
        prop_assert_eq!(rig.frames(), again.frames());
    }

    /// Whenever and however it is lost.
    #[test]
    fn no_loss_of_it_takes_an_axis_off_its_path(row in 1..2000usize, loss in select(LOSSES.to_vec())) {
        assert_lost(drill(CUT), "VL", row, loss);
    }
}
