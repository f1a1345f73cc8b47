//! Work offsets, tools, reference points and the tables file.

use std::path::Path;

use syncline_gcode::{Action, AxisLetter, Interpreter, Point, Setup, Tables, TablesError, Tool};

use super::listing::{listing, listing_with, places, refusals, run_with, xyz};

fn with_tools() -> Setup {
    let mut setup = xyz();
    for (number, length) in [(1, 50.0), (2, 72.5)] {
        let tool = Tool {
            offset: Point::xyz(0.0, 0.0, length),
            ..Tool::default()
        };
        setup.tables.tools.insert(number, tool);
    }
    setup.tables.work_offsets[0] = Point::xyz(100.0, 100.0, 0.0);
    setup
}

#[test]
fn tool_lengths() {
    insta::assert_snapshot!(listing_with(
        with_tools(),
        "T1 M6 G43
G0 X0 Z0
G43 H2 Z0
G49 Z0
G43.1 Z10 (the motion rests for this block)
Z0
T2 M6
G43 H0 Z0 (the tool in the spindle)
G10 L1 P2 Z80 R3
G43 Z0
G10 L10 P2 Z5
G43 Z5
G10 L11 P2 Z-5
G43 Z5
G53 Z0
M2"
    ));
}

#[test]
fn work_offsets_and_shifts() {
    insta::assert_snapshot!(listing_with(
        with_tools(),
        "G0 X1 Y1 Z1
G10 L2 P1 X10
X1
G10 L20 P0 Y0 Z0
Y5
G55 G10 L20 P2 X50
X50
G92 X0 Y0
X1 Y1
G92.2 X1
G92.3 X1
G92.1 X1
G52 X100 Z2
X0 Z0
G20 G92 X1 Z0
X1 Z0
#5221=7 #5241=8
G92.1
G54 G21 X0
G55 X0
M30"
    ));
}

/// Whatever else is in effect, after G10 L20 the position has the given coordinates.
#[test]
fn a_calculated_work_offset_counts_tool_and_shift() {
    let program = "G0 X7 Y8 Z9\nG43 H1 G52 X3 Z4\nG10 L20 P0 X1 Y2 Z3\n\
                   G53 G0 X#5420 Y#5421 Z#5422\nM2";
    let commands = run_with(with_tools(), program).unwrap();
    let Action::Rapid { to } = commands[1].action else {
        panic!("{commands:?}")
    };
    assert_eq!(to, Point::xyz(1.0, 2.0, 3.0));
}

#[test]
fn reference_points() {
    insta::assert_snapshot!(listing_with(
        with_tools(),
        "G0 X5 Y5 Z-5
G28.1
G0 X50 Y50 Z-20
G91 G28 Z2
G90 G28 X40 Y40 (both over the given point)
G30
G1 F100 X1
G30 Z1 (the motion rests)
X2
#5183=-7
G30 Z0
M2"
    ));
}

#[test]
fn what_the_system_parameters_show() {
    insta::assert_snapshot!(listing_with(
        with_tools(),
        "T2 M6 G43 G20
G0 X1 Y2 Z3
G53 G0 X[#5021+#5083] Y[#5420+#<_y>] Z[#<_abs_z>+#5220+#5221]
G21 S500 M3 F90 M8 G55 G91.1 G18
G53 G0 X#<_motion_mode> Y#<_coord_system> Z[#<_spindle_on>+#<_rpm>+#<_feed>+#<_plane>+#<_flood>]
G53 G0 X#5400 Y#5403 Z#<_line>
M2"
    ));
}

#[test]
fn what_cannot_be_set() {
    insta::assert_snapshot!(refusals(&[
        ("G43 H9", "1:5"),
        ("T9 M6\nG43", "2:1"),
        ("G43.1", "1:1"),
        ("G43.1 Z1 G0", "1:7"),
        ("G43 G49", "1:5"),
        ("G92", "1:1"),
        ("G92 G0 X1", "1:8"),
        ("G10 P1 X1", "1:1"),
        ("G10 L2 X1", "1:1"),
        ("G10 L2 P10 X1", "1:8"),
        ("G10 L3 P1 X1", "1:5"),
        ("G10 L2 P1 R450", "1:11"),
        ("G10 L1 P0 Z1", "1:8"),
        ("G10 L1 P1 R-99999999", "1:11"),
        ("G28 G92 X1", "1:5"),
        ("G28 G4 P1 X1 A1", "1:14"),
        ("#<_x> = 1", "1:1"),
        ("#5021 = 1", "1:1"),
    ]));
}

#[test]
fn outputs_are_handed_on() {
    insta::assert_snapshot!(listing(
        "M64 P3\nG0 X1 M101 P1.5 Q2\nM63 P0\nM62 P63\nM68 E3 Q-2.5\nM67 E0 Q0\nM65 P1\nM2"
    ));
}

const TABLES: &str = r#"
[work_offsets]
G54 = { X = 400.0, Y = 300.0, Z = -250.0 }
"G59.1" = { Z = 1 }

[reference_points]
G28 = { Z = -1.0 }

[[tool]]
number = 3
name = "end mill 6 mm"
diameter = 6.0
offset = { Z = 52.3 }
"#;

/// Writes tables into a file as a program does that leaves them so.
fn save(tables: &Tables, file: &Path, since: &Tables) -> Result<(), TablesError> {
    let mut setup = xyz();
    setup.tables = tables.clone();
    Interpreter::from_text("part.ngc", "M2", setup).save_tables(file, since)
}

#[test]
fn tables_round_trip_through_their_file() {
    let file = Path::new("portal.tables.toml");
    let tables = Tables::parse(file, TABLES).unwrap();
    assert_eq!(tables.work_offsets[0], Point::xyz(400.0, 300.0, -250.0));
    assert_eq!(tables.work_offsets[6][AxisLetter::Z], 1.0);
    assert_eq!(tables.tools[&3].offset[AxisLetter::Z], 52.3);

    let directory = tempfile::tempdir().unwrap();
    let saved = Tables::beside(&directory.path().join("portal.toml"));
    assert!(saved.ends_with("portal.tables.toml"));
    assert_eq!(Tables::load(&saved).unwrap(), Tables::default());
    save(&tables, &saved, &Tables::default()).unwrap();
    assert_eq!(Tables::load(&saved).unwrap(), tables);
    assert_eq!(std::fs::read_dir(directory.path()).unwrap().count(), 1);
    insta::assert_snapshot!(std::fs::read_to_string(&saved).unwrap());
}

/// A person's file with all that a person may write, and three values in it.
const BY_HAND: &str = r#"# Vice at the left stop; checked on Monday.
[[tool]]      # the one with the chip
number = 3
diameter = 6
offset = { Z = 52.3 } # measured

[work_offsets]
"G59.1" = { Z = 1 }   # probe
G54={X=400.0,Y=300.0} # stop
# G55 = { X = 1 } was the old one
"#;

/// What a program sets is written in its place, and nothing else is touched.
#[test]
fn a_tables_file_keeps_its_comments_order_and_layout() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("portal.tables.toml");
    std::fs::write(&file, BY_HAND).unwrap();
    let before = Tables::load(&file).unwrap();
    let mut after = before.clone();
    // With the dust of arithmetic, which is not stored.
    after.work_offsets[0][AxisLetter::X] = 401.250_000_000_000_06;
    after.work_offsets[0][AxisLetter::Y] = 299.999_999_999_999_94;
    after.work_offsets[0][AxisLetter::Z] = -7.5;
    after.tools.get_mut(&3).unwrap().offset[AxisLetter::Z] = 52.0;
    after.g28[AxisLetter::Z] = -1.0;
    save(&after, &file, &before).unwrap();
    let text = std::fs::read_to_string(&file).unwrap();
    let expected = BY_HAND
        .replace("Z = 52.3", "Z = 52.0")
        .replace("{X=400.0,Y=300.0}", "{ X = 401.25, Y = 300.0, Z = -7.5 }");
    assert_eq!(
        text,
        expected + "\n[reference_points]\nG28 = { Z = -1.0 }\n"
    );
    // Nothing changed, nothing written.
    save(&after, &file, &after).unwrap();
    assert_eq!(std::fs::read_to_string(&file).unwrap(), text);
}

/// Two runs, or a run and a person, that set different values lose nothing; the same value is
/// refused by name.
#[test]
fn what_others_set_meanwhile_is_kept() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("portal.tables.toml");
    std::fs::write(&file, BY_HAND).unwrap();
    let before = Tables::load(&file).unwrap();
    let with = |change: fn(&mut Tables)| {
        let mut tables = before.clone();
        change(&mut tables);
        tables
    };
    let one = with(|tables| tables.work_offsets[0][AxisLetter::X] = 1.0);
    let other = with(|tables| tables.work_offsets[0][AxisLetter::Y] = 2.0);
    save(&one, &file, &before).unwrap();
    save(&other, &file, &before).unwrap();
    let both = Tables::load(&file).unwrap();
    assert_eq!(both.work_offsets[0], Point::xyz(1.0, 2.0, 0.0));

    let late = with(|tables| tables.work_offsets[0][AxisLetter::X] = 3.0);
    let error = save(&late, &file, &before).unwrap_err().to_string();
    let told = ": G54 X was 400 at the start, is 1 now, and the program sets 3: ";
    assert!(error.contains(told), "{error}");
    assert_eq!(Tables::load(&file).unwrap(), both);
}

/// A program that sets a value sets it also where it was the same at its start: what somebody else has set meanwhile is told,
/// and a file that has it already stays as it is.
#[test]
fn a_value_that_is_set_to_what_it_was_is_set() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("portal.tables.toml");
    let tables = "[work_offsets]\nG54 = { X = 400.0, R = 3.0 }\nG55 = { Y = 1.0 }\n\n[reference_points]\nG28 = { Z = 0.0 }\n\n\
                  [[tool]]\nnumber = 1\ndiameter = 6.0\noffset = { Z = 52.0 }\n";
    for (block, from, to, place) in [
        ("G10 L2 P1 X400", "X = 400.0", "X = 7.0", "G54 X"),
        ("G10 L2 P1 R3", "R = 3.0", "R = 4.0", "G54 R"),
        ("G10 L2 P2 Z0", "Y = 1.0", "Y = 1.0, Z = 2.0", "G55 Z"),
        ("#5242=1", "Y = 1.0", "Y = 2.0", "G55 Y"),
        ("#5163=0", "Z = 0.0", "Z = 9.0", "G28 Z"),
        ("G28.1", "Z = 0.0", "Z = 9.0", "G28 Z"),
        ("G10 L1 P1 Z52", "Z = 52.0", "Z = 51.0", "tool 1 Z"),
        (
            "G10 L1 P1 R3",
            "diameter = 6.0",
            "diameter = 5.0",
            "tool 1 diameter",
        ),
    ] {
        std::fs::write(&file, tables).unwrap();
        let before = Tables::load(&file).unwrap();
        let mut setup = xyz();
        setup.tables = before.clone();
        let mut program = Interpreter::from_text("part.ngc", format!("{block}\nM2"), setup);
        assert!(program.by_ref().all(|it| it.is_ok()), "{block}");
        program.save_tables(&file, &before).unwrap();
        assert_eq!(std::fs::read_to_string(&file).unwrap(), tables, "{block}");
        let other = tables.replacen(from, to, 1);
        std::fs::write(&file, &other).unwrap();
        let error = program.save_tables(&file, &before).unwrap_err().to_string();
        assert!(
            error.contains(&format!(": {place} was ")),
            "{block}: {error}"
        );
        assert_eq!(std::fs::read_to_string(&file).unwrap(), other, "{block}");
    }
}

/// What a file has already, in whatever form, leaves it as it is, and makes none; zeros of what it does not name among it.
#[test]
fn what_is_set_and_there_writes_nothing() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("portal.tables.toml");
    let tables = "[work_offsets]\nG54 = { X = 400 }\n";
    for (text, block) in [
        (Some(tables), "G92.1\nG10 L2 P3 X0 Y0\nG10 L2 P1 X400"),
        (Some(""), "G92.1\nG10 L2 P3 X0 Y0 R0"),
        (None, "G92.1\nG10 L2 P3 X0 Y0"),
    ] {
        let _ = std::fs::remove_file(&file);
        let mut setup = xyz();
        if let Some(text) = text {
            std::fs::write(&file, text).unwrap();
            setup.tables = Tables::load(&file).unwrap();
        }
        let before = setup.tables.clone();
        let mut program = Interpreter::from_text("part.ngc", format!("{block}\nM2"), setup);
        assert!(program.by_ref().all(|it| it.is_ok()), "{block}");
        program.save_tables(&file, &before).unwrap();
        let left = std::fs::read_to_string(&file).ok();
        assert_eq!(left.as_deref(), text, "{block}");
    }
}

/// A link in the place of the new file leads nowhere, a link to the tables to the tables.
#[test]
fn saving_follows_no_planted_link() {
    let directory = tempfile::tempdir().unwrap();
    let at = |name: &str| directory.path().join(name);
    std::fs::write(at("precious"), "worth keeping").unwrap();
    std::fs::write(at("shared.toml"), BY_HAND).unwrap();
    std::os::unix::fs::symlink(at("shared.toml"), at("portal.tables.toml")).unwrap();
    for name in ["shared.toml.new", "portal.tables.toml.new"] {
        std::os::unix::fs::symlink(at("precious"), at(name)).unwrap();
    }
    let file = at("portal.tables.toml");
    Tables::probe(&file).unwrap();
    let before = Tables::load(&file).unwrap();
    let mut after = before.clone();
    after.g30[AxisLetter::X] = 5.0;
    save(&after, &file, &before).unwrap();
    assert_eq!(Tables::load(&at("shared.toml")).unwrap(), after);
    assert!(file.is_symlink());
    let precious = std::fs::read_to_string(at("precious")).unwrap();
    assert_eq!(precious, "worth keeping");
}

/// A file that does not end is not read to its end.
#[test]
fn a_tables_file_is_bounded() {
    let error = Tables::load(Path::new("/dev/zero"))
        .unwrap_err()
        .to_string();
    assert_eq!(error, "cannot read /dev/zero");
}

#[test]
fn tables_that_cannot_be_used() {
    let mut messages = String::new();
    for text in [
        "[work_offsets]\nG60 = { X = 1 }",
        "[work_offsets]\nG54 = { Q = 1 }",
        "[work_offsets]\nG59.3 = { X = 1 }",
        "[work_offsets]\nG54 = { X = nan }",
        "[reference_points]\nG29 = { X = 1 }",
        "[[tool]]\nnumber = 1\n[[tool]]\nnumber = 1",
        "[[tool]]\nnumber = 1\ndiameter = -2e9",
        "[[tool]]\nnumber = 0",
        "[[tool]]\nnumber = 100_000",
        "[[tool]]\nnumber = 1\nlength = 3",
        "[tools]",
        "= 1",
        // All at once, each with its place.
        "tool = 3\n[work_offset]\nG54 = {}\n[reference_points]\nG28 = 5\nG92 = { z = 1, Y = \"a\", W = inf }",
        "[work_offsets]\nG55 = { X = 2e9 }\n[[tool]]\nname = 1\n[[tool]]\nnumber = 2\noffset = [1]\ndiameter = nan",
    ] {
        let error = Tables::parse(Path::new("portal.tables.toml"), text).unwrap_err();
        messages += &format!("{error}\n");
    }
    insta::assert_snapshot!(messages);
}

#[test]
fn the_interpreter_keeps_what_the_program_sets() {
    let mut program =
        Interpreter::from_text("part.ngc", "G10 L2 P3 X5\nG0 X1\nG28.1\nM2", with_tools());
    assert!(program.by_ref().all(|command| command.is_ok()));
    assert_eq!(program.tables().work_offsets[2][AxisLetter::X], 5.0);
    assert_eq!(program.tables().g28[AxisLetter::X], 101.0);
}

/// Where an axis was measured at the start, what tables take of it is no noise; where a move has led it, they
/// take what was programmed.
#[test]
fn no_encoder_noise_comes_into_the_tables() {
    let noisy = || {
        let mut setup = xyz();
        setup.start = Point::xyz(10.000_153, -0.200_21, 4.999_9);
        setup
    };
    for (program, work, reference) in [
        ("G10 L20 P1 X0 Y0 Z0", [10.0, -0.2, 5.0], 0.0),
        (
            "G0 X1.23456\nG10 L20 P1 X0 Y0 Z0",
            [1.23456, -0.2, 5.0],
            0.0,
        ),
        ("G28.1", [0.0; 3], 10.0),
        ("G10 L2 P1 X0.00015", [0.00015, 0.0, 0.0], 0.0),
    ] {
        let mut interpreter = Interpreter::from_text("p.ngc", program, noisy());
        while interpreter.next().is_some() {}
        let tables = interpreter.tables();
        assert_eq!(tables.work_offsets[0].0[..3], work, "{program}");
        assert_eq!(tables.g28[AxisLetter::X], reference, "{program}");
    }
}

/// A rotation is in the tables file as the offset's R, and changes of two runs in one offset meet.
#[test]
fn rotations_are_kept() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("portal.tables.toml");
    std::fs::write(
        &file,
        "[work_offsets]\nG54 = { X = 1.0, R = 30.0 } # the vice\n",
    )
    .unwrap();
    let before = Tables::load(&file).unwrap();
    assert_eq!(before.rotations[0], 30.0);
    let mut setup = xyz();
    setup.tables = before.clone();
    let mut program = Interpreter::from_text("part.ngc", "G10 L2 P1 R-12.5\n#5250=7\nM2", setup);
    assert!(program.by_ref().all(|it| it.is_ok()));
    program.save_tables(&file, &before).unwrap();
    let text = std::fs::read_to_string(&file).unwrap();
    assert_eq!(
        text,
        "[work_offsets]\nG54 = { X = 1.0, R = -12.5 } # the vice\nG55 = { R = 7.0 }\n"
    );
    let other = Tables {
        rotations: [1.0; 9],
        ..before.clone()
    };
    let error = save(&other, &file, &before).unwrap_err().to_string();
    assert!(
        error.contains("G54 R was 30 at the start, is -12.5 now"),
        "{error}"
    );
    std::fs::write(&file, "[work_offsets]\nG54 = { R = 361.0 }\n").unwrap();
    let error = Tables::load(&file).unwrap_err().to_string();
    assert!(
        error.contains("allowed: a number within ±360 (°)"),
        "{error}"
    );
}

/// A parameter that moves the origin does so behind its block, as every setting takes effect, also on a level with what is shown
/// of it.
#[test]
fn an_origin_that_is_set_moves_behind_its_block() {
    for (setting, behind) in [
        ("#5221=10", 10.0),
        ("G92 X0\n#5211=10", 10.0),
        ("#5221=4 #5221=10", 10.0),
        ("#[5220 + 1]=[5 + 5]", 10.0),
    ] {
        let program = format!("{setting} G0 X1\nX1\nM2").replace("\n#", "\n(MSG, -)\n#");
        let x: Vec<f64> = places(xyz(), &program)
            .into_iter()
            .map(|place| place[0])
            .collect();
        assert_eq!(x, [1.0, 1.0 + behind], "{program}");
    }
    let program = "#5230=90 G0 X1\nY1\nM2";
    assert_eq!(places(xyz(), program), [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]);
    let text = listing("#5221=10 G0 X1 (DEBUG, #5221 #5420)\n(DEBUG, #5221 #5420)\nM2");
    assert!(
        text.contains("\"10 0\"") && text.contains("\"10 -9\""),
        "{text}"
    );
    // Points of G28 too.
    let program = "#5161=3 G28\nG28\nM2";
    let x: Vec<f64> = places(xyz(), program)
        .into_iter()
        .map(|place| place[0])
        .collect();
    assert_eq!(x, [3.0]);
}

/// G53 is absolute, whatever the distance mode.
#[test]
fn machine_coordinates_are_absolute_under_g91() {
    assert_eq!(
        places(xyz(), "G10 L2 P1 X5\nG91 G0 X7\nG53 G0 X-4\nX1\nM2"),
        [[7.0, 0.0, 0.0], [-4.0, 0.0, 0.0], [-3.0, 0.0, 0.0]]
    );
}
