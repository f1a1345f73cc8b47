//! Programs on a machine: what the modes promise, and where a run ends that cannot go on.

use serde_json::Value;
use std::f64::consts::PI;
use std::path::Path;
use std::process::Stdio;
use syncline_controller::machine::Machine;
use syncline_tests::command::{Folder, ended, syncline};
use syncline_tests::plan::Plan;
use syncline_tests::rig::example;
use syncline_tests::terminal::Terminal;
use syncline_tests::trace::Trace;

/// With `--stream` the block is not known to be bad until it is read, far ahead of the machine.
#[test]
fn a_bad_block_in_a_stream_stops_the_machine_where_it_stands_in_the_program() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = "G64 P0.1 F12000\nG1 X100\nY100\nX200\nX300 Y150 H2\nX0\nM2\n";
    let program = folder.file("stream.ngc", program);
    let trace = folder.path("trace.csv");
    let output = syncline()
        .args(["validate", "--stream", "--trace"])
        .args([&trace, &machine, &program])
        .output()
        .unwrap();
    let (code, printed, errors) = ended(&output);
    assert_eq!(code, 1, "{errors}");
    assert!(errors.contains("stream.ngc:5:11:"), "{errors}");
    assert!(
        printed.contains("VIOLATION          fault: the program"),
        "{printed}"
    );
    let outcome = printed.lines().find(|line| line.starts_with("outcome"));
    assert!(
        outcome.is_some_and(|line| line.contains("stream.ngc:5:11: ")),
        "{printed}"
    );
    let trace = Trace::read(&example("portal"), &folder.read("trace.csv"));
    trace.assert_within_limits();
    for (axis, end) in [("X", 200.0), ("Y", 100.0), ("Z", 0.0)] {
        let last = *trace.axis(axis).set.last().unwrap();
        assert!((last - end).abs() < 1e-3, "{axis}: {last}");
    }
    // The same block in a program that is read first moves nothing.
    let output = syncline()
        .arg("validate")
        .args([&machine, &program])
        .output();
    let output = output.unwrap();
    assert_eq!(ended(&output).0, 2);
}

/// An axis that runs against its end stop is there, and not where its setpoint was.
#[test]
fn a_run_that_is_stopped_tells_where_its_axes_are() {
    let folder = Folder::new();
    let machine = folder.machine("xyz");
    let program = folder.file("p.ngc", "G1 X40 F12000\nM2\n");
    let trace = folder.path("trace.csv");
    let output = syncline()
        .args(["validate", "--json", "-", "--trace"])
        .args([&trace, &machine, &program])
        .args(["--set", "axis.X.simulation.end_stops=[-10.0, 20.0]"])
        .output()
        .unwrap();
    let (code, json, errors) = ended(&output);
    assert_eq!(code, 1, "{errors}");
    let json: Value = serde_json::from_str(json).unwrap();
    let stopped = json["stopped"]["position"]["X"].as_f64().unwrap();
    let trace = Trace::read(&example("xyz"), &folder.read("trace.csv"));
    let (set, act) = (&trace.axis("X").set, &trace.axis("X").act);
    assert!((stopped - act.last().unwrap()).abs() < 1e-3, "{stopped}");
    assert!((19.9..20.1).contains(&stopped), "{stopped}");
    let beyond = set.iter().any(|set| set - stopped > 1.0);
    assert!(beyond, "its setpoints were not followed");
}

/// The work offset, the distance mode and the shift that typed lines have left do not hold in a program, which says so; one that is
/// refused leaves them as they are.
#[test]
fn a_program_goes_to_its_places_whatever_was_typed() {
    let folder = Folder::new();
    let machine = folder.machine("xyz");
    let good = folder.file("good.ngc", "G0 X20 Y5\nM2\n");
    let bad = folder.file("bad.ngc", "G0 X1\nG1 Y1\nM2\n");
    let typed = ",mdi,G10 L2 P2 X100\n,mdi,G55 G91 G18\n,mdi,G0 X1\n,mdi,G92 Y7\n";
    let ends = |name: &str, events: &str| {
        let script = format!("t_s,event,value\n{typed}{events}");
        let script = folder.file(&format!("{name}.csv"), &script);
        let trace = folder.path("trace.csv");
        let output = syncline()
            .args(["validate", "--trace"])
            .args([&trace, &machine])
            .arg("--events")
            .arg(&script)
            .output()
            .unwrap();
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        let trace = Trace::read(&example("xyz"), &folder.read("trace.csv"));
        let end = ["X", "Y"].map(|axis| *trace.axis(axis).set.last().unwrap());
        (end, errors)
    };
    let (end, told) = ends("runs", &format!(",load,{}\n,run,\n", good.display()));
    assert!(
        (end[0] - 20.0).abs() < 1e-3 && (end[1] - 5.0).abs() < 1e-3,
        "{end:?}"
    );
    assert!(told.contains("line 1: G18, G55, G91, the shift by G92 or G52: typed before, not in effect in the program"), "{told}");
    let refused = format!(
        ",load,{}\n,run,\n,mdi,X3\n,mdi,G90 G0 X50 Y7\n",
        bad.display()
    );
    let (end, told) = ends("refused", &refused);
    assert!(
        (end[0] - 150.0).abs() < 1e-3 && end[1].abs() < 1e-3,
        "{end:?}: {told}"
    );
    // The tool would go along the contour itself.
    let (end, told) = ends("compensated", ",mdi,G41.1 D4 G1 X20 F600\n");
    assert!((end[0] - 1.0).abs() < 1e-3, "{end:?}");
    assert!(told.contains("the typed lines end with G41.1 on"), "{told}");
}

/// `syncline … | head` closes the pipe: no reason to panic, least of all while axes move.
#[test]
fn a_reader_that_goes_away_changes_nothing() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = folder.file("p.ngc", "G0 X20\nM2\n");
    for command in ["validate", "run"] {
        let closed = || {
            let (reader, writer) = std::io::pipe().unwrap();
            drop(reader);
            Stdio::from(writer)
        };
        let mut child = syncline();
        child
            .args([command, "--verbose"])
            .args([&machine, &program]);
        child.stdin(Stdio::null()).stdout(closed()).stderr(closed());
        assert_eq!(child.status().unwrap().code(), Some(0), "{command}");
    }
}

/// A program's JSON and its trace's text, on a machine that it passes on.
fn passes(machine: &Path, folder: &Folder, program: &str) -> (Value, String) {
    let program = folder.file("p.ngc", program);
    let trace = folder.path("trace.csv");
    let output = syncline()
        .args(["validate", "--json", "-", "--trace"])
        .args([trace.as_path(), machine, &program])
        .output()
        .unwrap();
    let (code, json, errors) = ended(&output);
    assert_eq!(code, 0, "{errors}{json}");
    let json = serde_json::from_str(json).unwrap();
    (json, folder.read("trace.csv"))
}

/// How long each line of a program moves, s.
fn times(trace: &Trace, lines: std::ops::RangeInclusive<u32>) -> Vec<f64> {
    let rows = |line| trace.line.iter().filter(|of| **of == line).count();
    lines.map(|line| rows(line) as f64 * trace.cycle).collect()
}

#[test]
fn a_rotary_axis_follows_the_tool() {
    let folder = Folder::new();
    let machine = folder.machine("rotary");
    let program = "\
        G21 G90 G94 G61.1 G0 Z100 F600\n\
        G1 X100 A90\n\
        G1 A180\n\
        G93 G1 X150 A360 F6\n\
        G1 A350 F12\n\
        G94 G91 G1 X0.1 A-1 F600\n\
        X0.2 A-1\n\
        G20 G90 X[150.3 / 25.4 + 0.0000000001] A258\n\
        G1 A158\n\
        X10 F100\n\
        G21 G1 X254.001 A-1080 F6000\n\
        G2 X274 I10 A0 F6000\n\
        M2\n";
    let (_, csv) = passes(&machine, &folder, program);
    let trace = Trace::read(&example("rotary"), &csv);
    trace.assert_within_limits();
    let Ok(machine) = Machine::load(&machine) else {
        unreachable!("it passed")
    };
    Plan::of(&machine, &folder.path("rotary.toml"), &folder.path("p.ngc")).assert_good();
    // 100 mm at 10 mm/s; 90° at 10°/s; a sixth and a twelfth of a minute; then 90° and 100° at
    // 10°/s, whatever the units of length are and however X is rounded.
    let took = times(&trace, 2..=9);
    for (took, expected) in took
        .into_iter()
        .zip([10.0, 9.0, 10.0, 5.0, 0.02, 0.03, 9.0, 10.0])
    {
        assert!((took - expected).abs() < 0.2, "{took} s, not {expected} s");
    }
    let [x, a] = ["X", "A"].map(|name| &trace.axis(name).set);
    for (row, line) in trace.line.iter().enumerate() {
        let apart = match line {
            2 => a[row] - 0.9 * x[row],
            4 => (a[row] - 180.0) - 3.6 * (x[row] - 100.0),
            _ => 0.0,
        };
        // At first the machine stands beside its zero by an increment or two.
        assert!(apart.abs() < 2e-4, "row {row}: {apart}");
    }
    assert!((x.last().unwrap() - 274.0).abs() < 1e-9);
    assert!(a.last().unwrap().abs() < 1e-9);
    // The way of the micrometre is as long as that of 1,238° at 180°/s.
    let rotation = times(&trace, 11..=11)[0];
    assert!((rotation - 1238.0 / 180.0).abs() < 0.5, "{rotation} s");
}

/// Millimetres are those of the tool, degrees those of turns alone, in every form in which they are
/// told.
#[test]
fn degrees_are_told_as_degrees() {
    let folder = Folder::new();
    let machine = folder.machine("rotary");
    // From beside the machine's zero to Z100 first.
    let program = "G0 Z100\nG61.1 G1 X30 A90 F1200\nG1 A180 F5400\nG2 X50 I10 A0 F1200\nM2\n";
    let (mm, degrees) = (100.0 + 30.0 + 10.0 * PI, 90.0);
    let (json, _) = passes(&machine, &folder, program);
    for (key, expected) in [("length_mm", mm), ("turned_deg", degrees)] {
        let told = json["path"][key].as_f64().unwrap();
        assert!((told - expected).abs() < 1e-2, "{key}: {told}");
    }
    assert_eq!(json["axes"][3]["unit"], "°");
    let (file, report) = (folder.path("p.ngc"), folder.path("report.html"));
    let output = |arguments: &[&str]| {
        let mut command = syncline();
        command.args(arguments).args([&machine, &file]);
        let output = command.output().unwrap();
        let (code, told, errors) = ended(&output);
        assert_eq!(code, 0, "{errors}");
        told.to_owned()
    };
    let checked = output(&["check"]);
    assert!(checked.ends_with(": 5 blocks, 161.4 mm of path, 90.0 ° of turns\n"));
    let validated = output(&["validate", "--report", report.to_str().unwrap()]);
    assert!(validated.contains("\npath               161.4") && validated.contains(" mm and 90.0"));
    assert!(validated.contains(" of 180 °/s, "), "{validated}");
    let report = folder.read("report.html");
    // No more than F1200 and a rapid for the tool, F5400 for the turn.
    for part in [
        " mm and 90.0",
        "Feed of turns alone",
        "max 90&quot;",
        "0 … 400",
    ] {
        assert!(report.contains(part), "{part}");
    }
    let colours = report.split_once("class=legend").unwrap().1;
    assert!(
        colours.split("</svg>").next().unwrap().contains(">20<"),
        "mm/s"
    );
}

#[test]
fn a_rotary_axis_keeps_its_soft_limits_and_the_tolerance() {
    let folder = Folder::new();
    let machine = folder.machine("rotary");
    let mut program = String::from("G61.1 G0 Z100 X200\nG64 P0.05 F6000\n");
    for k in 0..20 {
        let (x, y) = (200 + 7 * (k % 3), 9 * (k % 4));
        program += &format!("G1 X{x} Y{y} A{}\n", (k * k * 7) % 41);
    }
    let (json, csv) = passes(&machine, &folder, &(program + "M2\n"));
    let deviation = json["path"]["max_deviation_mm"].as_f64().unwrap();
    assert!(deviation > 0.02 && deviation <= 0.05, "{deviation}");
    Trace::read(&example("rotary"), &csv).assert_within_limits();

    let program = folder.file("far.ngc", "G0 A3600\nG91 G0 A0.5\nM2\n");
    let output = syncline()
        .arg("validate")
        .args([&machine, &program])
        .output()
        .unwrap();
    let (code, _, errors) = ended(&output);
    assert_eq!(code, 2, "{errors}");
    assert!(
        errors.contains("far.ngc:2:8: A would go to 3600.5"),
        "{errors}"
    );
}

#[test]
fn lines_nearly_in_line_become_one_within_q() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let waver = |mode: &str| {
        let mut program = format!("G0 X100 Y100\n{mode} F20000\n");
        for k in 1..=60 {
            let side = f64::from([0, 4, -3, 2][k as usize % 4]) * 0.002;
            program += &format!("G1 X{} Y{}\n", 100 + 3 * k, 100.0 + side);
        }
        // A corner is no line, and is rounded within P.
        let program = program + "G1 Y200\nM2\n";
        let (json, csv) = passes(&machine, &folder, &program);
        let number = |pointer: &str| json.pointer(pointer).and_then(Value::as_f64).unwrap();
        let found = (number("/duration_s"), number("/path/max_deviation_mm"));
        let loaded = Machine::load(&machine).unwrap();
        let plan = Plan::of(&loaded, &machine, &folder.path("p.ngc"));
        plan.assert_good();
        let path_segments = plan.path_segments().count();
        let trace = Trace::read(&loaded, &csv);
        trace.assert_within_limits();
        let (x, y) = (&trace.axis("X").set, &trace.axis("Y").set);
        let corner = |(x, y): (&f64, &f64)| (x - 280.0).hypot(y - 100.0);
        let corner = x.iter().zip(y).map(corner).fold(f64::INFINITY, f64::min);
        (found.0, found.1, path_segments, corner)
    };
    let (time, deviation, path_segments, _) = waver("G64 P0.01");
    let (merged_time, merged_deviation, merged_path_segments, corner) = waver("G64 P0.01 Q0.02");
    assert!(deviation <= 0.01, "{deviation}");
    assert!(
        merged_deviation > 0.005 && merged_deviation <= 0.03,
        "{merged_deviation}"
    );
    assert!(
        merged_path_segments <= 10 && path_segments > 60,
        "{merged_path_segments} {path_segments}"
    );
    assert!(merged_time < 0.95 * time, "{merged_time} s and {time} s");
    // Some of the corner is between two setpoints.
    assert!(corner < 0.5, "{corner}");
    let (_, narrow, narrow_path_segments, _) = waver("G64 P0.01 Q0.001");
    assert!(
        narrow <= 0.011 && narrow_path_segments > 60,
        "{narrow} {narrow_path_segments}"
    );
}

#[test]
fn what_is_switched_between_merged_lines_is_switched_there() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = "G64 P0.01 Q0.05 F6000\nG1 X20\nX40\nM8\nX60\nX80\nM2\n";
    let (_, csv) = passes(&machine, &folder, program);
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let columns = reader.headers().unwrap().clone();
    let column = |name| columns.iter().position(|it| it == name).unwrap();
    let (x, coolant) = (column("X_set"), column("coolant"));
    let on = reader.records().map(Result::unwrap);
    let mut on = on.filter(|row| &row[coolant] == "2");
    let at: f64 = on.next().expect("it is switched on")[x].parse().unwrap();
    assert!((40.0..40.5).contains(&at), "{at}");
}

/// An Enter that was typed before the question is no answer to it.
#[test]
fn what_was_typed_ahead_confirms_nothing() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = folder.file("p.ngc", "G1 X10 F3000\nX20\nM2\n");
    let line = format!(
        "read first; {} run {} {} --from-line 2; echo exit $?",
        syncline().get_program().display(),
        machine.display(),
        program.display()
    );
    let mut terminal = Terminal::run(&line);
    // Both lines are there when the shell has read the first.
    terminal.press(b"first\n\n");
    terminal.wait_for("press Enter");
    // The end of input.
    terminal.press(b"\x04");
    let rest = terminal.end();
    assert!(
        rest.iter().any(|line| line.contains("nobody can confirm")),
        "{rest:?}"
    );
    assert!(rest.iter().any(|line| line.contains("exit 2")), "{rest:?}");
}
