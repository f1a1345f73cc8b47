//! Bad input as a user meets it: exit code 2, the place, what is wrong and what to do, and nothing
//! has moved.

use std::path::Path;
use syncline_tests::command::{Folder, ended, machine_file, machine_with, syncline};

/// The complaint of `run`, which must refuse before it does anything.
fn refusal(machine: &Path, program: &Path, arguments: &[&str]) -> String {
    let mut command = syncline();
    command.arg("run").arg(machine).arg(program).args(arguments);
    let output = command.output().unwrap();
    let (code, printed, errors) = ended(&output);
    assert_eq!(code, 2, "{errors}");
    assert_eq!(printed, "", "nothing ran");
    assert!(errors.starts_with("error: "), "{errors}");
    assert!(!errors.contains("real time: "), "nothing ran: {errors}");
    errors.to_owned()
}

/// Beyond `back_off` the second switch of a gantry is not looked for.
#[test]
fn a_gantry_is_not_squared_over_more_than_its_switches_are_looked_for() {
    let folder = Folder::new();
    let program = folder.file("p.ngc", "G0 X5\nM2\n");
    let with = |skew: &str| {
        let backs_off = "direction = \"negative\"\nspeed = 80.0";
        let skew = format!("max_skew = {skew}\n{backs_off}");
        folder.file(
            "router.toml",
            &machine_with("router", &[(backs_off, &skew)]),
        )
    };
    let told = refusal(&with("5.5"), &program, &[]);
    for part in [
        "`max_skew` is 5.5 mm",
        "`back_off`, 5 mm",
        "a greater `back_off`",
    ] {
        assert!(told.contains(part), "{told}");
    }
    let good = with("5.0");
    let output = syncline()
        .arg("check")
        .args([&good, &program])
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");
}

/// Each mistake in the portal's machine file, and what a user has to be told: place, key, what is
/// allowed, the nearest valid key.
#[test]
fn mistakes_in_the_machine_file() {
    let axis_y = "max_jerk = 100_000.0";
    let travel = "soft_limits = [0.0, 1000.0]";
    for (mistake, told) in [
        (
            ("cycle_us = 2000", "cycel_us = 2000"),
            &["6:1:", "`cycel_us`", "nearest", "`cycle_us`"][..],
        ),
        (
            ("cycle_us = 2000", ""),
            &["4:1:", "missing key `cycle_us`", "add `cycle_us`"],
        ),
        (
            ("cycle_us = 2000", "cycle_us = 2500"),
            &["6:12:", "`cycle_us` is 2500", "LXM32M", "1000…20000 µs"],
        ),
        (
            ("cycle_us = 2000", "cycle_us = 1000"),
            &["does not fit", "1.110 ms", "2.000 ms"],
        ),
        (
            ("node = 3", "node = 2"),
            &["39:8:", "node 2 is already X2", "1…127"],
        ),
        (
            ("node = 3", "node = 127"),
            &["39:8:", "already the controller"],
        ),
        (
            (axis_y, "max_jerk = 0.0"),
            &["72:12:", "axis \"Y\": `max_jerk` is 0.0", "from 0.001"],
        ),
        (
            (axis_y, "max_jerk = -1.0"),
            &["72:12:", "axis \"Y\": `max_jerk` is -1.0", "from 0.001"],
        ),
        (
            (axis_y, "max_jerk = \"a lot\""),
            &["72:12:", "`max_jerk`", "a number"],
        ),
        (
            ("model = \"lxm32m\"", "model = \"lxm23m\""),
            &["24:9:", "`model`", "nearest: \"lxm32m\""],
        ),
        (
            ("bus = \"portal\"", "bus = \"portla\""),
            &["22:7:", "there is no bus", "nearest: \"portal\""],
        ),
        // ±16384 revolutions of 20 mm.
        (
            (travel, "soft_limits = [0.0, 2_000_000.0]"),
            &["73:15:", "`soft_limits`", "2147483647 increments"],
        ),
        (
            ("name = \"portal\"", "name = portal"),
            &["5:8:", "not TOML"],
        ),
    ] {
        let folder = Folder::new();
        let file = folder.file("machine.toml", &machine_with("portal", &[mistake]));
        let program = folder.file("p.ngc", "M2\n");
        let complaint = refusal(&file, &program, &[]);
        for part in told {
            assert!(
                complaint.contains(part),
                "{mistake:?}: no {part} in {complaint}"
            );
        }
        if !complaint.contains("does not fit") {
            let place = format!("{}:", file.display());
            assert!(
                complaint.contains(&place),
                "{mistake:?}: no {place} in {complaint}"
            );
        }
    }
}

/// All mistakes in the tables beside the machine file at once, told in the same way.
#[test]
fn mistakes_in_the_tables() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = folder.file("p.ngc", "M2\n");
    let tables = "[work_offsets]\nG54 = { X = 1.0, YY = 2.0 }\nG60 = { X = 3.0 }\nG59.1 = { Z = 1 }\n\n\
                  [[tool]]\nnumber = 1\ndiametre = 6.0\n\n[[tool]]\nnumber = -2\n\n\
                  [[tool]]\noffset = { Z = \"long\" }\n";
    let file = folder.file("portal.tables.toml", tables);
    let complaint = refusal(&machine, &program, &[]);
    for told in [
        "2:18: work_offsets: G54: unknown key `YY`",
        "3:1: work_offsets: unknown key `G60`",
        "nearest valid key: `G54`",
        "4:5: work_offsets: G59: unknown key `1`",
        "probably meant: \"G59.1\", in quotes",
        "8:1: tool 1: unknown key `diametre`",
        "nearest valid key: `diameter`",
        "11:10: tool -2: `number` is -2",
        "13:1: tool: missing key `number`",
        "14:16: tool: offset: `Z` is \"long\"",
    ] {
        assert!(complaint.contains(told), "no {told} in {complaint}");
    }
    let places = complaint.matches(&format!("{}:", file.display())).count();
    assert_eq!(places, 7, "{complaint}");
    // The machine alone is checked with its tables too.
    let check = syncline().arg("check").arg(&machine).output().unwrap();
    assert_eq!(ended(&check), (2, "", &*complaint));
}

/// Each mistake in a program, and what a user has to be told: `file:line:column`, the block, what
/// to do.
#[test]
fn mistakes_in_the_program() {
    for (program, told) in [
        ("G0 X10\nG1 X20\nM2\n", &[":2:1:", "G1 X20", "F"][..]),
        ("G95\n", &[":1:1:", "G95"]),
        ("G0 X1\nG0 X10 Q3\n", &[":2:8:", "uses Q"]),
        (
            "F600\nG2 X10 Y10 I3 J0\n",
            &[":2:", "G2 X10 Y10 I3 J0", "from the centre", "correct"],
        ),
        ("G0 X10\n  G0 X1600\n", &[":2:6:", "G0 X1600", "1500"]),
        // The end is inside the soft limits, the arc is not.
        (
            "G0 X1 Y500\nG2 X1 Y600 R300 F600\n",
            &[":2:", "R300", "X", "0"],
        ),
        ("G0 X[1 + ]\n", &[":1:", "X[1 + ]"]),
        ("G0 X1..5\n", &[":1:", "X1..5"]),
        ("G0 X#<nothing>\n", &[":1:", "#<nothing>"]),
        ("O100 call\n", &[":1:", "O100"]),
    ] {
        let folder = Folder::new();
        let file = folder.file("part.ngc", program);
        let complaint = refusal(&folder.machine("portal"), &file, &[]);
        for part in told {
            assert!(
                complaint.contains(part),
                "{program:?}: no {part} in {complaint}"
            );
        }
        let place = format!("{}:", file.display());
        assert!(complaint.contains(&place), "{program:?}: {complaint}");
    }
}

#[test]
fn files_and_buses_that_are_not_there() {
    let folder = Folder::new();
    let (machine, program) = (machine_file("portal"), folder.file("p.ngc", "M2\n"));
    let none = folder.path("none");
    assert!(refusal(&none, &program, &[]).contains("cannot read"));
    assert!(refusal(&machine, &none, &[]).contains(none.to_str().unwrap()));
    let complaint = refusal(&machine, &program, &["--bus", "gantry=sim"]);
    assert!(complaint.contains("no bus `gantry`"), "{complaint}");
    let complaint = refusal(&machine, &program, &["--bus", "nocan17"]);
    assert!(complaint.contains("nocan17"), "{complaint}");
    let complaint = refusal(&machine, &program, &["--bus", "nocan17", "--wait-for-plan"]);
    assert!(complaint.contains("no real bus does"), "{complaint}");
    for option in ["--trace", "--json", "--report"] {
        let complaint = refusal(&machine, &program, &[option, "/no/such/folder/file"]);
        assert!(
            complaint.contains("cannot write /no/such/folder/file"),
            "{complaint}"
        );
    }
}

/// What `run` refuses, `validate` and `check` refuse in the same words.
#[test]
fn the_three_commands_agree() {
    let folder = Folder::new();
    let machine = machine_file("portal");
    let program = folder.file("p.ngc", "G0 X10\nG1 X20\nM2\n");
    let [run, validate, check] = ["run", "validate", "check"].map(|command| {
        let output = syncline().arg(command).args([&machine, &program]).output();
        let output = output.unwrap();
        let (code, _, errors) = ended(&output);
        assert_eq!(code, 2, "{command}");
        errors.to_owned()
    });
    assert_eq!(run, validate);
    assert_eq!(run, check);
}

#[test]
fn arguments_that_do_not_parse() {
    for arguments in [&["run"][..], &["run", "a", "b", "--what"], &["mill"], &[]] {
        let output = syncline().args(arguments).output().unwrap();
        let (code, _, errors) = ended(&output);
        assert_eq!(code, 2, "{arguments:?}");
        assert!(errors.contains("Usage"), "{errors}");
    }
}

/// Each file that cannot be written is told by its name: before anything moves, or when it is full.
#[test]
fn files_that_cannot_be_written() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = folder.file("p.ngc", "G0 X1\nM2\n");
    for (code, file) in [(2, "/nowhere/file"), (1, "/dev/full")] {
        for option in ["--candump", "--pcapng", "--trace"] {
            let mut command = syncline();
            command.args(["validate", option, file]);
            let output = command.args([&machine, &program]).output().unwrap();
            let (ended, printed, errors) = ended(&output);
            assert_eq!(ended, code, "{option} {file}: {errors}");
            let told = format!("cannot write {file}");
            assert_eq!(errors.matches(&told).count(), 1, "{option}: {errors}");
            // A log that is cut short does not cost the result.
            if code == 1 && option != "--trace" {
                assert!(printed.contains("verdict            pass"), "{printed}");
            }
        }
    }
}

/// Help and version are told of as any other result is.
#[test]
fn help_that_cannot_be_written() {
    for arguments in [&["--help"][..], &["--version"], &["run", "--help"]] {
        let full = std::fs::File::options().write(true).open("/dev/full");
        let mut command = syncline();
        command.args(arguments).stdout(full.unwrap());
        let output = command.output().unwrap();
        let (code, _, errors) = ended(&output);
        assert_eq!(code, 1, "{arguments:?}");
        assert!(
            errors.contains("cannot write standard output"),
            "{arguments:?}: {errors}"
        );
        assert_eq!(
            syncline().args(arguments).output().unwrap().status.code(),
            Some(0)
        );
    }
}

/// A link to where nothing is yet: what it leads to is made where something is written, and not where it is refused.
#[test]
fn a_link_to_nowhere() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = folder.file("p.ngc", "G0 X1\nM2\n");
    for (link, target) in [("a.json", "portal.tables.toml"), ("b.json", "result.json")] {
        std::os::unix::fs::symlink(target, folder.path(link)).unwrap();
    }
    let tables = folder.path("portal.tables.toml");
    // The example's own.
    let _ = std::fs::remove_file(&tables);
    let validate = |link: &str| {
        let mut command = syncline();
        command.arg("validate").args([&machine, &program]);
        command.arg("--json").arg(folder.path(link));
        let output = command.output().unwrap();
        ended(&output).0
    };
    assert_eq!(validate("a.json"), 2);
    assert!(!tables.exists(), "nothing is made of what is refused");
    assert!(folder.path("a.json").is_symlink());
    assert_eq!(validate("b.json"), 0);
    let written = std::fs::read_to_string(folder.path("result.json")).unwrap();
    assert!(written.starts_with('{'), "{written}");
}

/// Who has no tables is told so where a tool is asked for, and nowhere else.
#[test]
fn tables_that_are_not_there() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let tables = folder.path("portal.tables.toml");
    let told = format!("there is no {}", tables.display());
    let _ = std::fs::remove_file(&tables);
    let program = folder.file("p.ngc", "G43 H1\nG0 X1 Q3\nM2\n");
    let complaint = refusal(&machine, &program, &[]);
    assert!(complaint.contains(&told), "{complaint}");
    let other = folder.file("q.ngc", "G0 X1 Q3\nM2\n");
    assert!(!refusal(&machine, &other, &[]).contains(&told));
    std::fs::write(&tables, "").unwrap();
    assert!(!refusal(&machine, &program, &[]).contains(&told));
}

/// A line that is too long, and a mistake in a loop, are told once each.
#[test]
fn mistakes_that_are_met_again_and_again() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let text = format!(
        "({})\no1 repeat [50]\nG0 X1 Q3\no1 endrepeat\nM2\n",
        "x".repeat(100_000)
    );
    let program = folder.file("p.ngc", &text);
    let complaint = refusal(&machine, &program, &[]);
    for told in ["p.ngc:1:1: the line has more than", "p.ngc:3:7: "] {
        assert_eq!(complaint.matches(told).count(), 1, "{complaint}");
    }
    assert!(!complaint.contains("the same in line"), "{complaint}");
}

#[test]
fn why_a_thread_cannot_be_cut_is_told_once() {
    let folder = Folder::new();
    let program = folder.file("p.ngc", "G21 M3 S2900\nG0 X10 Z3\nG33 Z-10 K20\nM2\n");
    let complaint = refusal(&machine_file("drill"), &program, &[]);
    assert!(
        complaint.contains("p.ngc:3:1: no thread: S2900"),
        "{complaint}"
    );
    assert_eq!(complaint.matches("S2900").count(), 1, "{complaint}");
}
