//! A spindle that a CiA 402 drive on the bus turns in its velocity mode (vl): `examples/drill` with a `cia402_vl`.

use proptest::prelude::*;
use proptest::sample::select;
use syncline_canopen::{CanId, CobId, Frame, NodeId};
use syncline_controller::control::fault::SpindleCause;
use syncline_controller::control::{End, Fault, Phase};
use syncline_controller::machine::Machine;
use syncline_controller::program::Programs;
use syncline_drives::bus::Sender;
use syncline_drives::twin::Disturbance;
use syncline_tests::command::{Folder, machine_file};
use syncline_tests::rig::Rig;

use super::described::{leave_mapping_out, sheet};
use super::driven_spindle::{
    self, CUT, FROM_NEAR, LOSSES, SPINDLE, TURNED_ROUND, TWO_SPEEDS, assert_cuts_at_speed,
    assert_let_go_at_rest, assert_lost, assert_resumes_behind_a_fault,
    assert_stands_before_power_is_taken_off, assert_waits_for_a_held_rotor,
    assert_waits_until_it_is_turned_round, line, measured, program, turns_at,
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

/// The nearest speed that it can be sent is at speed, however far from S.
#[test]
fn what_a_coarse_unit_leaves_is_at_speed() {
    let model = "model = \"cia402_vl\"\n\n[model.cia402_vl]\nvelocity_units = 1\nvelocity_rpm = 20";
    let program = "G21 G90 G61\nM3 S70\nG1 X10 F3000\nM5\nM2\n";
    let mut rig = driven_spindle::drill_with(&[(PV, model)], program, |_, _| ());
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_eq!(sent(&rig).1, [0, 4, 0]);
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
    let swapped = [
        ("drives = [\"X\"]", "drives = [\"spindle\"]"),
        ("\ndrive = \"spindle\"", "\ndrive = \"X\""),
    ];
    for (changes, told) in [
        // 6042h has 16 bits.
        (
            &[("max_speed = 3000", "max_speed = 3277")][..],
            "beyond what drive \"spindle\" can be sent",
        ),
        (
            &swapped,
            "axis \"X\": drive \"spindle\" (CiA 402 VL) tells no position",
        ),
        (&swapped[..1], "drive \"spindle\" already moves axis \"X\""),
        (&[("ramp_ms = 300 ", "ramp_ms = 0 ")], "`ramp_ms` is 0"),
    ] {
        let changed = changes.iter().fold(text.clone(), |text, (from, to)| {
            assert!(text.contains(from), "{from}");
            text.replace(from, to)
        });
        let wrong = parse(&changed).unwrap_err();
        assert!(wrong.contains(told), "{wrong}");
    }
}

/// What 6044h tells is what counts.
#[test]
fn no_cut_begins_before_it_turns() {
    assert_waits_for_a_held_rotor(drill(TWO_SPEEDS));
}

#[test]
fn the_other_way_round_is_not_at_speed() {
    assert_waits_until_it_is_turned_round(drill(TURNED_ROUND));
}

/// What it turned meanwhile counts: a T_PDO that is missing now and then is no slower spindle.
#[test]
fn a_missing_t_pdo_is_no_loss_of_speed() {
    let mut rig = drill(CUT);
    let t_pdo = CanId::from(CobId::t_pdo(1, NodeId::new(4).unwrap()));
    let mut told = 0;
    rig.bus().doctor = Some(Box::new(move |received| {
        told += u32::from(received.frame.id() == t_pdo);
        received.frame.id() != t_pdo || told % 5 != 0
    }));
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_cuts_at_speed(&rig);
}

#[test]
fn a_cut_whose_spindle_falls_away_stops_on_the_path() {
    let mut rig = drill(CUT);
    rig.run_to_row(400);
    rig.twin(SPINDLE).disturb(Disturbance::Block(true));
    let before = rig.rows.len();
    let fault = rig.finish_with_fault();
    assert!(
        matches!(fault, Fault::Spindle(SpindleCause::Speed { told, .. }) if told == 2400.0),
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

// --- a file describes it ---

/// What a file says of the drive.
#[derive(Clone, Debug)]
struct Description {
    /// Units of speed at so many revolutions a minute.
    unit: [u32; 2],
    has_dimension_factor: bool,
    pdos: u8,
    /// Which PDOs it is sent and sends.
    numbers: [u8; 2],
    fixed_mapping: bool,
    /// What is mapped stands in the data sheet.
    tells_mapping: bool,
    vendor_id: u32,
}

impl Description {
    /// A unit is 30 1/min at most, and 3000 1/min have room in 16 bits.
    fn any() -> impl Strategy<Value = Self> {
        let fine = (1..=10u32, 1..=20u32).prop_map(|(finer, rpm)| [finer * rpm, rpm]);
        let unit = prop_oneof![fine, (2..=30u32).prop_map(|rpm| [1, rpm])];
        let pdos = (1..=4u8, 1..=4u8, 1..=4u8);
        (unit, any::<[bool; 3]>(), pdos, any::<u32>()).prop_map(
            |(
                unit,
                [has_dimension_factor, fixed_mapping, tells_mapping],
                (r_pdo, t_pdo, pdos),
                vendor_id,
            )| Self {
                unit,
                has_dimension_factor,
                pdos,
                numbers: [r_pdo, t_pdo],
                fixed_mapping,
                tells_mapping,
                vendor_id,
            },
        )
    }

    /// The machine file's line that names its file.
    fn write(&self, folder: &Folder) -> String {
        let fixed = self.fixed_mapping.then_some([0x6042_0010, 0x6044_0010]);
        let mut eds = sheet(2, self.pdos, self.numbers, fixed);
        if self.fixed_mapping && !self.tells_mapping {
            leave_mapping_out(&mut eds, self.numbers);
        }
        // It is no servo drive, and tells no position.
        eds.objects.retain(|index, _| {
            !matches!(index, 0x6064..=0x606C | 0x607A..=0x607F | 0x6083..=0x60FF)
                && (self.has_dimension_factor || *index != 0x604C)
        });
        let _sheet = folder.file("drive.eds", &eds.to_string());
        let [units, rpm] = self.unit;
        let [r_pdo, t_pdo] = self.numbers;
        let text = format!(
            "name = \"drawn\"\ngeneric = \"cia402_vl\"\neds = \"drive.eds\"\nvelocity_units = {units}\n\
             velocity_rpm = {rpm}\nhas_dimension_factor = {}\npdos = {}\nr_pdo = {r_pdo}\nt_pdo = {t_pdo}\n\
             fixed_mapping = {}\nvendor_id = {}\n",
            u8::from(self.has_dimension_factor),
            self.pdos,
            u8::from(self.fixed_mapping),
            self.vendor_id,
        );
        let file = folder.file("drive.toml", &text);
        format!("model = {:?}", file.display().to_string())
    }
}

#[test]
fn a_description_that_says_nothing_is_the_generic_drive() {
    let folder = Folder::new();
    let _sheet = folder.file("plain.eds", &sheet(2, 4, [1, 1], None).to_string());
    let plain = "name = \"plain\"\ngeneric = \"cia402_vl\"\neds = \"plain.eds\"\n";
    let file = folder.file("plain.toml", plain);
    let frames = |model: &str| {
        let model = format!("model = {model:?}");
        let mut rig = driven_spindle::drill_with(&[(PV, &*model)], TWO_SPEEDS, |_, _| ());
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let frames = rig.frames();
        // The generic drive knows other modes, too, and says so.
        let sent = frames.iter().filter(|it| it.sender == Sender::Port);
        let sent = sent.map(|it| (it.end, it.frame));
        sent.collect::<Vec<(_, Frame)>>()
    };
    assert_eq!(frames(&file.display().to_string()), frames("cia402_vl"));
}

#[test]
fn another_makers_drive_is_refused() {
    let folder = Folder::new();
    let described = Description {
        unit: [1, 1],
        has_dimension_factor: false,
        pdos: 1,
        numbers: [1, 1],
        fixed_mapping: true,
        tells_mapping: true,
        vendor_id: 0x1234,
    };
    let model = described.write(&folder);
    let mut rig = driven_spindle::drill_with(&[(PV, &*model)], TWO_SPEEDS, |_, _| ());
    rig.twin(SPINDLE).disturb(Disturbance::Vendor(0x4321));
    let told = rig.finish_with_fault().describe(&*rig.layout);
    let expected = "1018h:1 (vendor ID) reads 00004321h, expected 00001234h";
    assert!(
        told.contains("spindle, drawn") && told.contains(expected),
        "{told}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// Whatever a valid description says, the spindle turns as the program says, by the PDOs that it names.
    #[test]
    fn it_turns_as_told_whatever_describes_it(
        description in Description::any(),
        speeds in prop::collection::vec((60..=3000u32, any::<bool>()), 1..4),
        negative: bool,
        gear in select(vec![0.5, 1.0]),
    ) {
        let folder = Folder::new();
        let direction = if negative { "negative" } else { "positive" };
        let model = format!("{}\ndirection = \"{direction}\"", description.write(&folder));
        let gearing = format!("gear = {gear:?}\nramp_ms = 300 ");
        let replacements = [(PV, &*model), ("ramp_ms = 300 ", &*gearing)];
        let mut program = String::from("G21 G90 G61 F3000\n");
        for (number, (speed, back)) in speeds.iter().enumerate() {
            let code = if *back { 4 } else { 3 };
            program += &format!("M{code} S{speed}\nG1 X{}\n", 10 * (number + 1));
        }
        program += "M5\nM2\n";
        let mut rig = driven_spindle::drill_with(&replacements, &program, |_, _| ());
        // What the example lets it differ by, and what a unit leaves.
        let [units, rpm] = description.unit.map(f64::from);
        for (number, (speed, back)) in speeds.iter().enumerate() {
            let place = 10.0 * number as f64 + 5.0;
            rig.run_until(|rig| {
                let row = rig.rows.last();
                row.is_some_and(|row| row.plan.position[0] > place) || rig.end().is_some()
            });
            let wanted = f64::from(*speed) * if *back { -1.0 } else { 1.0 };
            let window = 0.03 * wanted.abs() + rpm / units / gear + 4.0;
            let motor = turns_at(&mut rig) * if negative { -1.0 } else { 1.0 };
            for turns in [motor / gear, measured(rig.rows.last().unwrap())] {
                prop_assert!((turns - wanted).abs() <= window, "{} for {} 1/min", turns, wanted);
            }
        }
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        assert_let_go_at_rest(&mut rig);
        let node = NodeId::new(4).unwrap();
        let frames = rig.frames();
        let [r_pdo, t_pdo] = description.numbers;
        for number in 1..=4 {
            let used = |id: CobId| frames.iter().any(|it| it.frame.id() == CanId::from(id));
            prop_assert_eq!(used(CobId::r_pdo(number, node)), number == r_pdo);
            prop_assert_eq!(used(CobId::t_pdo(number, node)), number == t_pdo);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

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
