//! `syncline check` as a user meets it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use syncline_controller::machine::Machine;

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

fn check(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_syncline"))
        .arg("check")
        .args(arguments)
        .current_dir(root())
        .output()
        .unwrap()
}

fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// The output of a check that refuses: exit code 2, and the complaint.
fn refused(arguments: &[&str]) -> String {
    let output = check(arguments);
    let error = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
    error.to_owned()
}

const PORTAL: &str = "examples/portal/machine.toml";

#[test]
fn every_example_is_good() {
    for folder in fs::read_dir(root().join("examples")).unwrap() {
        let folder = folder.unwrap().path();
        let file = folder.join("machine.toml");
        let file = file.to_str().unwrap();
        let programs: Vec<PathBuf> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|extension| extension == "ngc"))
            .collect();
        assert!(!programs.is_empty(), "no program (.ngc) beside {file}");
        for program in programs {
            let output = check(&[file, program.to_str().unwrap()]);
            let (good, bad) = (text(&output.stdout), text(&output.stderr));
            assert_eq!(output.status.code(), Some(0), "{bad}");
            assert!(bad.is_empty() && good.contains("mm of path"), "{good}{bad}");
        }
        let output = check(&[file]);
        assert_eq!(output.status.code(), Some(0));
        let told = text(&output.stdout);
        let machine = Machine::load(file.as_ref()).unwrap();
        let timeout = machine.controller.heartbeat_timeout.as_millis();
        let devices: Vec<&str> = (told.lines())
            .filter(|line| line.contains("its loss shows by"))
            .collect();
        for (node, line) in machine.nodes().zip(&devices) {
            assert!(line.contains(&format!("({}, ", node.name)), "{told}");
        }
        assert_eq!(devices.len(), machine.nodes().count(), "{told}");
        let safe = format!("outputs are safe {timeout} ms after");
        let io = devices.iter().filter(|line| line.contains(&safe));
        assert_eq!(io.count(), machine.io_nodes.len(), "{told}");
        let encoders = devices.iter().filter(|line| line.contains("moves nothing"));
        assert_eq!(encoders.count(), machine.encoders.len(), "{told}");
        assert_eq!(
            told.lines().count() - devices.len(),
            1 + machine.buses.len(),
            "{told}"
        );
    }
}

#[test]
fn bad_tables_are_told_once() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("portal.toml");
    fs::copy(root().join(PORTAL), &file).unwrap();
    let tables = "[work_offsets]\nG59.3 = { X = 1 }\n";
    fs::write(folder.path().join("portal.tables.toml"), tables).unwrap();
    let bracket = "examples/portal/bracket.ngc";
    let error = refused(&[file.to_str().unwrap(), bracket]);
    assert_eq!(error.matches("unknown key").count(), 1, "{error}");
    assert!(error.contains("meant: \"G59.3\", in quotes"), "{error}");
}

#[test]
fn a_bad_machine_file_is_told_with_its_places() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("machine.toml");
    let good = fs::read_to_string(root().join(PORTAL)).unwrap();
    let bad = good
        .replace("node = 3", "node = 300")
        .replace("max_jerk = 100_000.0", "max_jrek = 100_000.0");
    fs::write(&file, bad).unwrap();
    let file = file.to_str().unwrap();
    let error = refused(&[file, "examples/portal/bracket.ngc"]);
    assert!(
        error.starts_with(&format!("error: {file}:39:8: drive \"Y\": `node` is 300\n")),
        "{error}"
    );
    assert!(error.contains(&format!(
        "{file}:72:1: axis \"Y\": unknown key `max_jrek`\n"
    )));
    assert!(error.contains("nearest valid key: `max_jerk`"), "{error}");

    assert!(refused(&["no/such/file.toml"]).starts_with("error: cannot read no/such/file.toml: "));
    assert!(refused(&["examples"]).starts_with("error: cannot read examples: "));
    fs::write(folder.path().join("latin.toml"), b"name = \"Fr\xE4se\"").unwrap();
    let latin = folder.path().join("latin.toml");
    assert!(refused(&[latin.to_str().unwrap()]).contains("UTF-8"));
}

#[test]
fn a_machine_that_does_not_fit_its_cycle_is_refused_with_the_arithmetic() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("machine.toml");
    let good = fs::read_to_string(root().join(PORTAL)).unwrap();
    fs::write(&file, good.replace("cycle_us = 2000", "cycle_us = 1000")).unwrap();
    let error = refused(&[file.to_str().unwrap()]);
    // SYNC + 8 PDOs of 6 bytes + one blocking frame: 55 + 8·115 + 135 bits.
    assert!(error.starts_with("error: bus portal: "), "{error}");
    assert!(error.contains("1110") || error.contains("1.110"), "{error}");
}

/// Each program with the place, and a word of the advice.
#[test]
fn a_bad_program_is_refused_before_anything_moves() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.ngc");
    for (program, place, words) in [
        ("G0 X10\nG1 X20\n", "2:", "F"),
        ("G0 X10\nG33 X20 K1\n", "2:1", "G33"),
        (
            "G0 X10 Y10 F100\nG2 X20 Y10 I4 J0\n",
            "2:",
            "from the centre",
        ),
        ("G0 X1501\n", "1:", "X"),
        ("G0 X-600 Y10\nG2 X-600 Y20 I0 J5 F100\n", "2:", "X"),
        ("G0 X[1+]\n", "1:", ""),
        ("G0 Xten\n", "1:5", ""),
        ("G0 A10\n", "1:4", "A"),
        ("G1 X10 F0\n", "1:", "F"),
        ("M98 P7\n", "1:1", "subprogram O7"),
    ] {
        fs::write(&file, program).unwrap();
        let file = file.to_str().unwrap();
        let error = refused(&[PORTAL, file]);
        assert!(
            error.starts_with(&format!("error: {file}:{place}")) && error.contains(words),
            "{program}{error}"
        );
        let line = place.split(':').next().unwrap().parse::<usize>().unwrap();
        let block = program.lines().nth(line - 1).unwrap();
        assert!(error.contains(block), "{error}");
    }
    assert!(refused(&[PORTAL, "no/such/part.ngc"]).contains("no/such/part.ngc"));
}

#[test]
fn every_mistake_of_a_program_is_told_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.ngc");
    let mut program = "G21\nG33 X1 K1\nG1 X10\nG1 X20\nG0 Z9999 F100\n".to_owned();
    program += &"G96 S100\n".repeat(40);
    program += "G0 Z1\nG2 X30 Y30 I1\nG0 X1,5\nG0 X1\n";
    fs::write(&file, program).unwrap();
    let file = file.to_str().unwrap();
    let error = refused(&[PORTAL, file]);
    let places: Vec<&str> = error
        .lines()
        .filter_map(|line| line.trim_start_matches("error: ").strip_prefix(file))
        .filter_map(|place| place.split(':').nth(1))
        .collect();
    assert_eq!(places, ["2", "3", "5", "6", "47", "48"], "{error}");
    assert!(error.contains("the same in line 4\n"), "{error}");
    assert!(error.contains("17, 18 and 27 more\n"), "{error}");
}

/// Nothing is said of places that are not known behind a block that could not be read.
#[test]
fn a_place_that_is_not_known_makes_no_mistake() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.ngc");
    let file = file.to_str().unwrap();
    let arcs = "G2 X20 Y10 I5 J0\nG2 X40 Y10 I2 J0\n";
    for lost in ["G1 X10 Y.0.\n", "G1 X15, Y10\n", "G1 Y10 X1,5\n"] {
        fs::write(file, format!("G0 X0 Y200 F500\n{lost}{arcs}")).unwrap();
        let error = refused(&[PORTAL, file]);
        assert!(error.contains(":2:"), "{error}");
        assert_eq!(error.matches("from the centre").count(), 1, "{error}");
        assert!(
            error.contains(":4:"),
            "line 3 led to a place that is known: {error}"
        );
    }
    // Nor of the limits of an axis, up to where a block says again where it is.
    fs::write(
        file,
        "G0 X0 Y0\nG0 X-90,5\nG91 X-1\nX-1\nY-999\nG90 X-2000\n",
    )
    .unwrap();
    let error = refused(&[PORTAL, file]);
    let told = |line| error.contains(&format!("part.ngc:{line}:"));
    assert_eq!(
        [2, 3, 4, 5, 6].map(told),
        [true, false, false, true, true],
        "{error}"
    );
}

/// The same mistake with other numbers is told with them.
#[test]
fn other_numbers_of_the_same_mistake_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.ngc");
    fs::write(
        &file,
        "F500 G0 X0\nG2 X20 R.25\nG0 X1\nG2 X30 R0.5\nG4\nG4\n",
    )
    .unwrap();
    let error = refused(&[PORTAL, file.to_str().unwrap()]);
    assert!(
        error.contains("the same in line 4: G2 X30 R0.5\n"),
        "{error}"
    );
    assert!(error.contains("the same in line 6"), "{error}");
}

/// Codes that are none are no one mistake.
#[test]
fn codes_that_are_unknown_are_each_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.ngc");
    fs::write(&file, "G16\nG15\nG6\nG9\nG6\n").unwrap();
    let error = refused(&[PORTAL, file.to_str().unwrap()]);
    for code in ["G16 is not", "G15 is not", "G6 is not", "G9 is not"] {
        assert!(error.contains(code), "{code}: {error}");
    }
    assert!(error.contains("the same in line 5"), "{error}");
}

#[test]
fn the_change_of_an_arc_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.ngc");
    fs::write(&file, "F600 G0 X10 Y0 Z-1\nG3 X0 Y10.02 I-10\n").unwrap();
    let output = check(&[PORTAL, file.to_str().unwrap()]);
    let good = text(&output.stdout);
    assert!(good.contains("mm (line 2)"), "{good}");
}

#[test]
fn block_delete_is_the_operators_choice() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.ngc");
    fs::write(&file, "G0 X10\n/G0 X5000\n").unwrap();
    let file = file.to_str().unwrap();
    let error = refused(&[PORTAL, file, "--no-block-delete"]);
    assert!(error.starts_with(&format!("error: {file}:2:")), "{error}");
    let output = check(&[PORTAL, file]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
}

#[test]
fn help_reads_like_a_manual() {
    let output = check(&["--help"]);
    let help = text(&output.stdout);
    for part in [
        "exit code 2",
        "Example: syncline check",
        "<MACHINE>",
        "[PROGRAM]",
    ] {
        assert!(help.contains(part), "{part}");
    }
}

#[test]
fn a_line_to_begin_at_is_described() {
    let bracket = "examples/portal/bracket.ngc";
    let output = check(&[PORTAL, bracket, "--from-line", "61"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let described = text(&output.stdout);
    assert!(
        described.contains("line 61: begins with G3 G17 G21") && described.contains("G61.1 F"),
        "{described}"
    );
    assert!(refused(&[PORTAL, bracket, "--from-line", "9999"]).contains("before line 9999"));
}

#[test]
fn an_endless_program_is_for_streaming() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.ngc");
    fs::write(&file, "G91 G0 X0\no1 while [1]\nG1 X0 F100\no1 endwhile\n").unwrap();
    let file = file.to_str().unwrap();
    let output = check(&[PORTAL, file, "--stream"]);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let told = text(&output.stdout);
    assert!(
        told.contains("part.ngc: not read") && !told.contains("0 blocks"),
        "{told}"
    );
}

#[test]
fn feeds_above_what_the_axes_can_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.ngc");
    let program =
        "F600 G1 X10\nF1000000 X20\nG93 F60000 X30\nG94 F600 X40\nF500000\nG2 X50 I5\nM2\n";
    fs::write(&file, program).unwrap();
    let output = check(&[PORTAL, file.to_str().unwrap()]);
    let good = text(&output.stdout);
    assert!(good.contains("feed: 3 moves ask for more"), "{good}");
    assert!(good.contains("line 2 has "), "{good}");
    fs::write(&file, "F600 G1 X10\nG0 X20\nM2\n").unwrap();
    let output = check(&[PORTAL, file.to_str().unwrap()]);
    assert!(!text(&output.stdout).contains("feed:"));
}

#[test]
fn a_program_comes_from_standard_input() {
    use std::io::Write;
    use std::process::Stdio;
    for (program, code, said) in [
        ("G0 X10\nM2\n", 0, "program -: 2 blocks"),
        ("G0 X10 H\n", 2, "standard input:1:9: "),
    ] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_syncline"))
            .current_dir(root())
            .args(["check", PORTAL, "-"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut input = child.stdin.take().unwrap();
        input.write_all(program.as_bytes()).unwrap();
        drop(input);
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(code));
        let told = [text(&output.stdout), text(&output.stderr)].concat();
        assert!(told.contains(said), "{told}");
    }
}

#[test]
fn a_program_in_place_of_the_machine_file_is_told_as_that() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("part.ngc");
    fs::write(&file, "G0 X10\nM2\n").unwrap();
    let told = refused(&[file.to_str().unwrap(), PORTAL]);
    assert!(
        told.contains("is no machine file, which is TOML: name the machine file first"),
        "{told}"
    );
}
