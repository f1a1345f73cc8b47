//! `syncline validate`: verdict, numbers, determinism, and what independent checkers say.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use syncline_controller::machine::Machine;
use syncline_tests::command::{
    Folder, build, ended, examples, machine_file, machine_with, syncline, text,
};
use syncline_tests::plan::Plan;
use syncline_tests::rig::{PORTAL_PROGRAM, example};
use syncline_tests::trace::Trace;

fn validate(machine: &Path, program: &Path, arguments: &[&str]) -> Output {
    let mut command = syncline();
    command.arg("validate").arg(machine).arg(program);
    command.args(arguments).output().unwrap()
}

/// The JSON of a validation and its exit code.
fn json(machine: &Path, program: &Path, arguments: &[&str]) -> (Value, i32) {
    let output = validate(machine, program, &[&["--json", "-"], arguments].concat());
    let (code, json, errors) = ended(&output);
    let json = serde_json::from_str(json).unwrap_or_else(|error| panic!("{error}: {errors}"));
    (json, code)
}

fn number(json: &Value, pointer: &str) -> f64 {
    let value = json.pointer(pointer).and_then(Value::as_f64);
    value.unwrap_or_else(|| panic!("no number {pointer} in {json:#}"))
}

#[test]
fn every_example_passes_inside_its_limits() {
    for (machine_file, program) in examples() {
        let folder = Folder::new();
        let trace = folder.path("trace.csv");
        let arguments = ["--trace", trace.to_str().unwrap()];
        let (json, code) = json(&machine_file, &program, &arguments);
        let name = program.display();
        assert_eq!(
            (code, &json["verdict"]),
            (0, &"pass".into()),
            "{name}: {json:#}"
        );
        assert_eq!(json["violations"], Value::Array(vec![]), "{name}");

        let machine = Machine::load(&machine_file).unwrap();
        let trace = Trace::read(&machine, &folder.read("trace.csv"));
        trace.assert_within_limits();
        assert!(trace.ends_at_rest(3), "{name}");
        Plan::of(&machine, &machine_file, &program).assert_good();

        // What the summary says is what the trace shows.
        let cycles = number(&json, "/cycles");
        assert_eq!(cycles as usize, trace.line.len(), "{name}");
        let duration = number(&json, "/duration_s");
        assert!(duration > 5.0 && duration <= 60.0, "{name}: {duration} s");
        assert!(duration <= cycles * trace.cycle, "{name}");
        let moves = number(&json, "/times/motion_s");
        assert!(
            duration >= moves - 1e-9,
            "{name}: {moves} s of {duration} s"
        );
        assert_eq!(number(&json, "/late_setpoints"), 0.0);
        assert_eq!(json["frames_sha256"].as_str().unwrap().len(), 64);
        assert!(number(&json, "/path/length_mm") > 100.0);
        let deviation = number(&json, "/path/max_deviation_mm");
        assert!(
            deviation <= allowed_deviation(&program),
            "{name}: {deviation} mm"
        );
        let contour = number(&json, "/path/max_contour_error_mm");
        assert!(contour > 0.0 && contour < 0.1, "{name}: {contour} mm");
        let load = number(&json, "/bus/0/peak_utilisation");
        assert!(load > 0.2 && load < 0.95, "{name}: {load}");
        for (index, axis) in trace.axes.iter().enumerate() {
            let of = |key: &str| number(&json, &format!("/axes/{index}/{key}"));
            assert_eq!(json["axes"][index]["name"], axis.name.as_str());
            let [velocity, acceleration, jerk] = axis.limits;
            assert_eq!(of("velocity_limit"), velocity);
            assert_eq!(of("acceleration_limit"), acceleration);
            assert_eq!(of("jerk_limit"), jerk);
            if axis.by_itself {
                assert_eq!(of("max_velocity"), 0.0, "{name}");
                continue;
            }
            for (what, limit) in [
                ("max_velocity", velocity),
                ("max_acceleration", acceleration),
                ("max_jerk", jerk),
            ] {
                assert!(of(what) > 0.0 && of(what) <= limit * (1.0 + 1e-9), "{name}");
            }
            let pieces = axis.by_reference(trace.cycle);
            let pairs = pieces.iter().flat_map(|(_, set)| set.windows(2));
            let steps = pairs.map(|pair| (pair[1] - pair[0]).abs());
            let fastest = steps.fold(0.0, f64::max) / trace.cycle;
            assert!(
                (of("max_velocity") - fastest).abs() <= 0.02 * velocity,
                "{name}"
            );
            let (least, most) = machine.axes[index].limits.position;
            // Where a machine stands at a limit at first, its encoder's noise may be beyond.
            let told_by = match machine.axes[index].feedback {
                Some(it) if it.closes_loop => machine.encoders[it.encoder].scaling,
                _ => machine.drives[machine.axes[index].drives[0]].scaling,
            };
            let noise = 4.0 * told_by.resolution();
            let inside = least - noise..=most + noise;
            // Before an axis is referenced its soft limits mean nothing, and its switch may be beyond them.
            let (_, referenced) = pieces.last().unwrap();
            let homing = referenced
                .iter()
                .take_while(|set| axis.homes && !inside.contains(set));
            let homed = &referenced[homing.count()..];
            assert!(!homed.is_empty(), "{name}");
            let outside = homed.iter().find(|set| !inside.contains(set));
            assert_eq!(outside, None, "{name}");
            let (most, mean) = (of("max_following_error_mm"), of("rms_following_error_mm"));
            assert!(mean > 0.0 && mean < most, "{name}");
            assert!(
                most < machine.axes[index].limits.following_error / 2.0,
                "{name}"
            );
        }
        assert_eq!(json["axes"].as_array().unwrap().len(), trace.axes.len());
        // What is told are the maxima at the cycles; between them it may be a little more.
        let mut told = trace;
        for (index, axis) in told.axes.iter_mut().enumerate() {
            axis.limits = ["max_velocity", "max_acceleration", "max_jerk"]
                .map(|key| number(&json, &format!("/axes/{index}/{key}")) * 1.001);
        }
        told.assert_within_limits();
    }
}

/// What the path modes of an example allow: the P of its G64, or the default of G61, mm.
fn allowed_deviation(program: &Path) -> f64 {
    let program = std::fs::read_to_string(program).unwrap();
    let blends = program.split("G64 P").nth(1);
    blends.map_or(0.001, |rest| {
        let number = rest.split_whitespace().next().unwrap();
        number.parse().unwrap()
    })
}

/// Neither an arc in place of short segments nor a rounded joint leads beyond a soft limit that the program
/// just reaches; further inside both are there.
#[test]
fn the_path_stays_inside_the_soft_limits() {
    let folder = Folder::new();
    let machine = folder.machine("xyz");
    for (inside, mode) in [(0.0, "P0.8"), (5.0, "P0.8")] {
        let most = 250.0 - inside;
        let mut program = format!("G64 {mode} F6000\nG0 X{} Y-60\n", most - 30.0);
        // Chords of a circle that touches the limit in the middle of the one in front.
        for step in -5..=5 {
            let (sin, cos) = (f64::from(step) * 0.17).sin_cos();
            let x = most + 60.0 * (cos - (0.085_f64).cos());
            program += &format!("G1 X{:.4} Y{:.4}\n", x.min(most), 60.0 * sin);
        }
        // Joints on the limit: of a line and an arc, of two arcs.
        program += &format!(
            "G0 Y-50\nG0 X{most}\nG1 Y0\nG3 X{} Y20 R20\nG1 X200\nG0 Y-50\n\
             G1 X{}\nG3 X{most} Y-40 R10\nG3 X{} Y-10 R30\nG1 X200\nM2\n",
            most - 20.0,
            most - 10.0,
            most - 30.0
        );
        let program = folder.file("edge.ngc", &program);
        let trace = folder.path("trace.csv");
        let output = syncline()
            .args(["validate", "--trace"])
            .args([&trace, &machine, &program])
            .output()
            .unwrap();
        let (code, printed, errors) = ended(&output);
        assert_eq!(code, 0, "{mode}: {errors}{printed}");
        let trace = Trace::read(&example("xyz"), &folder.read("trace.csv"));
        trace.assert_within_limits();
        let x = &trace.axis("X").set;
        let furthest = x.iter().copied().fold(0.0, f64::max);
        assert!(furthest <= 250.0 + 1e-6, "{mode}: {furthest}");
        assert!(furthest > most - 0.1, "{mode}: {furthest}");
        if inside > 0.0 {
            assert!(furthest > most + 0.01, "nothing is rounded: {furthest}");
        }
    }
}

/// What is near the setpoint is found behind any number of moves, a tiny one among them.
#[test]
fn a_tiny_move_behind_a_corner_is_no_deviation() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let mut program = String::from("G64 P0.01\nG1 F6000\nG0 X100 Y0\n");
    for k in 0..10 {
        program += &format!("G1 X{} Y{}\n", 105 + 5 * k, k % 2);
    }
    program += "G1 X170 Y0\nG1 X170 Y0.0001\nG1 X170 Y0.3\nM2\n";
    let program = folder.file("tiny.ngc", &program);
    let output = syncline()
        .arg("validate")
        .args([&machine, &program])
        .output()
        .unwrap();
    let (code, printed, errors) = ended(&output);
    assert_eq!(code, 0, "{errors}{printed}");
}

/// A short program for either machine.
fn short() -> (Folder, PathBuf) {
    let folder = Folder::new();
    let program = folder.file("short.ngc", PORTAL_PROGRAM);
    (folder, program)
}

pub(crate) fn digest(machine: &Path, program: &Path, arguments: &[&str]) -> String {
    let (json, code) = json(machine, program, arguments);
    assert_eq!(code, 0, "{json:#}");
    json["frames_sha256"].as_str().unwrap().to_owned()
}

#[test]
fn the_tool_ends_where_the_program_says_to_an_increment() {
    let folder = Folder::new();
    let inch = "G0 X0 Y0 Z0\nG20 G91 G1 X1.23456789 Y2 Z-0.1 F600\nG90 G21 G2 X110 Y90 R100\nM2\n";
    for (name, to, program) in [
        (
            "portal",
            [412.345_678, 250.5, -33.333],
            "G0 X412.345678 Y250.5 Z-33.333\nM30\n",
        ),
        ("portal", [110.0, 90.0, -2.54], inch),
        (
            "xyz",
            [-123.456_7, 99.999, -77.7],
            "G61 G1 X-123.4567 Y99.999 Z-77.7 F9000\nM2\n",
        ),
    ] {
        let program = folder.file("end.ngc", program);
        let trace = folder.path("trace.csv");
        let arguments = ["--trace", trace.to_str().unwrap()];
        let output = validate(&folder.machine(name), &program, &arguments);
        assert_eq!(ended(&output).0, 0, "{}", text(&output.stderr));
        let machine = example(name);
        let trace = Trace::read(&machine, &folder.read("trace.csv"));
        for axis in &machine.axes {
            let increment = machine.drives[axis.drives[0]].scaling.resolution();
            let coordinate = ["X", "Y", "Z"]
                .iter()
                .position(|it| *it == axis.name())
                .unwrap();
            let end = *trace.axis(axis.name()).set.last().unwrap();
            let off = (end - to[coordinate]).abs();
            assert!(
                off <= increment,
                "{name} {}: {end}, off by {off}",
                axis.name()
            );
            let act = *trace.axis(axis.name()).act.last().unwrap();
            assert!(
                (act - end).abs() < axis.limits.standstill,
                "{name} {}",
                axis.name()
            );
        }
    }
}

#[test]
fn the_seed_alone_decides_over_the_frames() {
    let (_folder, program) = short();
    for name in ["portal", "xyz"] {
        let machine = machine_file(name);
        // Unequal starts are no obstacle: soft limits of xyz are smaller.
        let program = if name == "portal" {
            program.clone()
        } else {
            let folder = machine.with_file_name("");
            folder.join("spiral.ngc")
        };
        let of = |seed: &str| digest(&machine, &program, &["--seed", seed]);
        let first = of("1");
        assert_eq!(first, of("1"));
        assert_ne!(first, of("2"));
        assert_eq!(of("0"), digest(&machine, &program, &[]));
    }
}

#[test]
fn the_processors_extensions_do_not_change_the_frames() {
    let (_folder, program) = short();
    let machine = machine_file("portal");
    let output = syncline()
        .args(["validate", "--json", "-"])
        .args([&machine, &program])
        .env("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2,-FMA")
        .output()
        .unwrap();
    let json: Value = serde_json::from_str(ended(&output).1).unwrap();
    assert_eq!(json["frames_sha256"], digest(&machine, &program, &[]));
}

#[test]
#[ignore = "builds the command in both profiles: .ci/run does"]
fn debug_and_release_give_the_same_frames() {
    let digests = [false, true].map(|release| {
        let binary = build(release);
        let digest = |(machine, program): (PathBuf, PathBuf)| {
            let mut command = Command::new(&binary);
            let arguments = ["validate", "--json", "-", "--seed", "3"];
            let output = command.args(arguments).args([machine, program]).output();
            let json: Value = serde_json::from_slice(&output.unwrap().stdout).unwrap();
            json["frames_sha256"].as_str().unwrap().to_owned()
        };
        examples().into_iter().map(digest).collect::<Vec<_>>()
    });
    assert_eq!(digests[0], digests[1]);
}

#[test]
fn a_machine_that_cannot_follow_fails_with_the_reason() {
    let folder = Folder::new();
    // A hundredth of the lag that the drives need at full speed.
    let machine = machine_with(
        "portal",
        &[(
            "following_error_limit = 2.0",
            "following_error_limit = 0.001",
        )],
    )
    .replacen(
        "drive_following_error = true",
        "drive_following_error = false",
        1,
    );
    let machine = folder.file("machine.toml", &machine);
    let program = folder.file("p.ngc", "G0 X300\nM2\n");
    let (json, code) = json(&machine, &program, &[]);
    assert_eq!((code, &json["verdict"]), (1, &"fail".into()));
    let violations = json["violations"].as_array().unwrap();
    let of = |what: &str| {
        let starts = |it: &&Value| it["what"].as_str().unwrap().starts_with(what);
        violations
            .iter()
            .find(starts)
            .unwrap_or_else(|| panic!("no {what} in {json:#}"))
    };
    let following = of("following_error");
    assert_eq!(following["axis"], "X");
    assert_eq!(following["line"], 1);
    assert_eq!(following["limit"], 0.001);
    assert!(following["value"].as_f64().unwrap() > 0.001);
    assert!(following["time_s"].as_f64().unwrap() > 0.0);
    assert!(of("fault: axis X: following error")["what"].is_string());
}

/// Spindle, coolant and tool are on the trace while the moves that they belong to run, and outputs
/// are told in their order.
#[test]
fn what_a_program_switches_is_on_the_trace() {
    let folder = Folder::new();
    let program = folder.file(
        "part.ngc",
        "G21 F6000\nM64 P1\nG0 X5 Y9\nM3 S900 M8\nG2 X5 I5\nM5 M9 M101 P0.5 Q2\nG4 P0.1\nT7 M6\n\
         G1 X20\nM4 S50 M7\nG1 X5\nM65 P1\nM30\n",
    );
    let trace = folder.path("trace.csv");
    let arguments = ["--trace", trace.to_str().unwrap(), "--json", "-"];
    let output = validate(&machine_file("portal"), &program, &arguments);
    let (code, json, told) = ended(&output);
    assert_eq!(code, 0, "{told}");
    let json: Value = serde_json::from_str(json).unwrap();
    let lines = json["switched"]
        .as_array()
        .expect("what was switched")
        .iter();
    let lines: Vec<_> = lines.map(|state| state["line"].as_u64()).collect();
    // The end switches off with what stands right before it.
    assert_eq!(lines, [2, 4, 6, 8, 10, 13].map(Some));
    let outputs = "line 2: M64 P1\nline 6: M101 P0.5 Q2\nline 12: M65 P1\n";
    assert_eq!(told, outputs);
    let mut states: Vec<String> = Vec::new();
    for row in folder.read("trace.csv").lines().skip(1) {
        let fields: Vec<&str> = row.split(',').collect();
        // Spindle, coolant, tool and digital outputs; behind them are four analog outputs.
        let switched = &fields[fields.len() - 8..fields.len() - 4];
        states.push([&fields[1..2], switched].concat().join(","));
    }
    states.dedup();
    let expected = [
        "3,0,0,0,0",
        "3,0,0,0,2",
        "5,900,2,0,2",
        // Switched off behind the arc of line 5, while the dwell of line 7 is served.
        "7,0,0,0,2",
        "8,0,0,7,2",
        "9,0,0,7,2",
        "11,-50,1,7,2",
        "11,0,0,7,0",
    ];
    assert_eq!(states, expected);
}

#[test]
fn a_report_is_one_file_that_needs_no_network() {
    let (folder, program) = short();
    let report = folder.path("report.html");
    let output = validate(
        &machine_file("portal"),
        &program,
        &["--report", report.to_str().unwrap(), "--json", "-"],
    );
    let (code, json, _) = ended(&output);
    assert_eq!(code, 0);
    let json: Value = serde_json::from_str(json).unwrap();
    let html = folder.read("report.html");
    for part in [
        "<b>Pass</b>",
        "<svg",
        "Tool path",
        "Axis X",
        "Jerk",
        "Following error",
        "short.ngc",
        "portal",
        json["frames_sha256"].as_str().unwrap(),
    ] {
        assert!(html.contains(part), "no {part}");
    }
    let is_link = |it: &&str| it.starts_with("http") && !it.starts_with("http://www.w3.org/");
    let links: Vec<&str> = html.split(['"', '\'', '(']).filter(is_link).collect();
    assert_eq!(links, [""; 0]);
}
