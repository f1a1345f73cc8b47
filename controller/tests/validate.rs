//! `syncline validate` as a user meets it, and its results checked by other means.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use syncline_controller::machine::Machine;

const PORTAL: &str = "examples/portal/machine.toml";
const XYZ: &str = "examples/xyz/machine.toml";

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

fn syncline(arguments: &[&str], environment: &[(&str, &str)]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_syncline"))
        .arg("validate")
        .args(arguments)
        .envs(environment.iter().copied())
        .current_dir(root())
        .output()
        .unwrap()
}

/// The JSON of a validation, and its exit code.
fn json(arguments: &[&str]) -> (Value, Option<i32>) {
    let arguments = [arguments, &["--json", "-"]].concat();
    let output = syncline(&arguments, &[]);
    let value = serde_json::from_slice(&output.stdout).unwrap_or_else(|error| {
        panic!("{error}: {}", String::from_utf8_lossy(&output.stderr));
    });
    (value, output.status.code())
}

/// Every example: machine and program.
fn examples() -> Vec<(&'static str, PathBuf)> {
    let mut examples = Vec::new();
    for machine in [PORTAL, XYZ] {
        let folder = root().join(machine);
        for entry in fs::read_dir(folder.parent().unwrap()).unwrap() {
            let file = entry.unwrap().path();
            if file.extension().is_some_and(|extension| extension == "ngc") {
                examples.push((machine, file));
            }
        }
    }
    examples.sort();
    examples
}

/// A trace: time, line, and set and actual position of each axis by name.
struct Trace {
    time: Vec<f64>,
    line: Vec<u32>,
    axes: Vec<(String, Vec<f64>, Vec<f64>)>,
}

fn read_trace(file: &Path) -> Trace {
    let text = fs::read_to_string(file).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert_eq!(header[..2], ["t_s", "line"]);
    let (axes, states) = header[2..].split_at(header.len() - 5);
    assert_eq!(states, ["spindle", "coolant", "tool"]);
    let names = axes.chunks(2).map(|pair| {
        let name = pair[0].strip_suffix("_set").unwrap();
        assert_eq!(pair[1], format!("{name}_act"));
        name.to_owned()
    });
    let mut trace = Trace {
        time: Vec::new(),
        line: Vec::new(),
        axes: names.map(|name| (name, Vec::new(), Vec::new())).collect(),
    };
    for line in lines {
        let fields: Vec<&str> = line.split(',').collect();
        assert_eq!(fields.len(), header.len());
        let number = |n: usize| -> f64 { fields[n].parse().unwrap() };
        trace.time.push(number(0));
        trace.line.push(fields[1].parse().unwrap());
        for (n, (_, set, act)) in trace.axes.iter_mut().enumerate() {
            set.push(number(2 + 2 * n));
            act.push(number(3 + 2 * n));
        }
    }
    trace
}

/// The distance to the next f64 of greater magnitude.
fn ulp(value: f64) -> f64 {
    let magnitude = value.abs();
    f64::from_bits(magnitude.to_bits() + 1) - magnitude
}

/// Plain differences of the setpoints against an axis's limits: the mean of a derivative over a
/// stretch is no more than its greatest value, whatever happens between the samples. 1e-6 relative
/// is allowed, and what the rounding of the positions to f64 can feign. What is beyond is returned.
fn beyond_limits(set: &[f64], cycle: f64, limits: [f64; 3]) -> Vec<String> {
    let greatest = set
        .iter()
        .fold(0.0, |greatest: f64, p| greatest.max(p.abs()));
    let rounding = 8.0 * 4.0 * ulp(greatest);
    let mut beyond = Vec::new();
    let mut differences = set.to_vec();
    for (order, limit) in (1..).zip(limits) {
        differences = differences
            .windows(2)
            .map(|pair| pair[1] - pair[0])
            .collect();
        let time = cycle.powi(order);
        for (n, difference) in differences.iter().enumerate() {
            let value = (difference / time).abs();
            if value > limit * (1.0 + 1e-6) + rounding / time {
                beyond.push(format!("order {order} at row {n}: {value} > {limit}"));
            }
        }
    }
    beyond
}

#[test]
fn every_example_passes_and_its_trace_keeps_the_limits() {
    let folder = tempfile::tempdir().unwrap();
    let trace_file = folder.path().join("trace.csv");
    for (machine_file, program) in examples() {
        let program = program.to_str().unwrap();
        let (result, code) = json(&[
            machine_file,
            program,
            "--trace",
            trace_file.to_str().unwrap(),
        ]);
        assert_eq!(code, Some(0), "{program}: {result:#}");
        assert_eq!(result["verdict"], "pass");
        assert_eq!(result["violations"], Value::Array(Vec::new()));
        assert_eq!(result["late_setpoints"], 0);
        assert!(result["path"]["max_deviation_mm"].as_f64().unwrap() < 0.05);

        let machine = Machine::load(&root().join(machine_file)).unwrap();
        let cycle = machine.cycle.as_secs_f64();
        let trace = read_trace(&trace_file);
        assert_eq!(trace.axes.len(), machine.axes.len());
        assert!(trace.line.iter().any(|line| *line > 0));
        for (n, time) in trace.time.iter().enumerate() {
            assert!((time - n as f64 * cycle).abs() < 1e-9);
        }
        for ((axis, (name, set, act)), told) in machine
            .axes
            .iter()
            .zip(&trace.axes)
            .zip(result["axes"].as_array().unwrap())
        {
            assert_eq!((name, &told["name"]), (&axis.name, &Value::from(&**name)));
            let limits = [axis.max_velocity, axis.max_acceleration, axis.max_jerk];
            let beyond = beyond_limits(set, cycle, limits);
            assert!(beyond.is_empty(), "{program} {name}: {beyond:?}");
            // The maxima told are those of the cycles; between them it may be a little more.
            let told = ["max_velocity", "max_acceleration", "max_jerk"]
                .map(|key| told[key].as_f64().unwrap() * 1.001);
            let beyond = beyond_limits(set, cycle, told);
            assert!(beyond.is_empty(), "{program} {name}: {beyond:?}");

            // Where a machine stands at a limit at first, its encoder's noise may be beyond.
            let noise = 4.0 * machine.drives[axis.drives[0]].scaling.resolution();
            let (least, most) = axis.soft_limits;
            let (least, most) = (least - noise, most + noise);
            assert!(set.iter().all(|p| (least..=most).contains(p)), "{name}");
            // The tool arrives.
            let (end, arrived) = (set[set.len() - 1], act[act.len() - 1]);
            assert!(
                (end - arrived).abs() < axis.standstill_window,
                "{end} {arrived}"
            );
            let off = set.iter().zip(act).map(|(set, act)| (set - act).abs());
            // Without the drive's delay taken out there is a cycle's travel more.
            let allowed = axis.following_error_limit + 2.0 * axis.max_velocity * cycle;
            assert!(off.fold(0.0, f64::max) < allowed);
        }
    }
}

/// The check above must see a limit that is exceeded, by a hair and between two samples.
#[test]
fn the_independent_check_sees_what_it_is_for() {
    let cycle = 0.002;
    // 1000 mm/s³ for a tenth of a second, from 500 mm.
    let ramp: Vec<f64> = (0..50)
        .map(|n| {
            let t = f64::from(n) * cycle;
            500.0 + 1000.0 * t * t * t / 6.0
        })
        .collect();
    assert!(beyond_limits(&ramp, cycle, [5.0, 100.0, 1000.0]).is_empty());
    assert!(!beyond_limits(&ramp, cycle, [5.0, 100.0, 998.0]).is_empty());
    assert!(!beyond_limits(&ramp, cycle, [5.0, 95.0, 1000.0]).is_empty());
    assert!(!beyond_limits(&ramp, cycle, [4.5, 100.0, 1000.0]).is_empty());
    let mut jump = ramp;
    jump[30] += 1e-4;
    assert!(!beyond_limits(&jump, cycle, [5.0, 100.0, 1000.0]).is_empty());
}

#[test]
fn the_end_is_where_the_program_says_to_an_increment() {
    let folder = tempfile::tempdir().unwrap();
    let (program, trace) = (
        folder.path().join("part.ngc"),
        folder.path().join("trace.csv"),
    );
    fs::write(
        &program,
        "G53 G0 X100 Y50 Z-20\nG53 G1 X333.3337 Y123.4567 F12000\nG91 G2 X10 Y0 I5 J0\n\
         G53 G90 G0 Z-77.7777\n",
    )
    .unwrap();
    for machine_file in [PORTAL, XYZ] {
        let (text, x) = match machine_file {
            PORTAL => (fs::read_to_string(&program).unwrap(), 333.3337),
            // Within the other machine's soft limits.
            _ => (
                fs::read_to_string(&program)
                    .unwrap()
                    .replace("333.3337", "233.3337"),
                233.3337,
            ),
        };
        fs::write(&program, text).unwrap();
        let arguments = [
            machine_file,
            program.to_str().unwrap(),
            "--trace",
            trace.to_str().unwrap(),
        ];
        let (result, code) = json(&arguments);
        assert_eq!(code, Some(0), "{result:#}");
        let machine = Machine::load(&root().join(machine_file)).unwrap();
        let trace = read_trace(&trace);
        for (name, set, _) in &trace.axes {
            let axis = machine.axes.iter().find(|axis| axis.name == *name).unwrap();
            let programmed = match name.as_str() {
                "X" => x + 10.0,
                "Y" => 123.4567,
                _ => -77.7777,
            };
            let scaling = &machine.drives[axis.drives[0]].scaling;
            let off = set[set.len() - 1] - programmed;
            assert!(
                off.abs() <= scaling.resolution(),
                "{machine_file} {name} off {off}"
            );
        }
    }
}

#[test]
fn a_seed_gives_its_frames_again_with_and_without_the_cpus_vector_units() {
    let hash = |arguments: &[&str], environment: &[(&str, &str)]| {
        let arguments = [arguments, &["--json", "-"]].concat();
        let output = syncline(&arguments, environment);
        let result: Value = serde_json::from_slice(&output.stdout).unwrap();
        let hash = result["frames_sha256"].as_str().unwrap().to_owned();
        assert_eq!(hash.len(), 64);
        hash
    };
    let part = [XYZ, "examples/xyz/engraving.ngc"];
    let first = hash(&part, &[]);
    assert_eq!(first, hash(&part, &[]));
    let masked = [("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-AVX2,-FMA")];
    assert_eq!(first, hash(&part, &masked));
    let other = [&part[..], &["--seed", "7"]].concat();
    let seven = hash(&other, &[]);
    assert_ne!(first, seven);
    assert_eq!(seven, hash(&other, &masked));
}

#[test]
fn a_program_runs_on_both_machines() {
    for (machine, program) in [
        (PORTAL, "examples/xyz/engraving.ngc"),
        (PORTAL, "examples/xyz/spiral.ngc"),
        (XYZ, "examples/portal/bracket.ngc"),
    ] {
        let (result, code) = json(&[machine, program]);
        assert_eq!(code, Some(0), "{machine} {program}: {result:#}");
    }
}

#[test]
fn bad_input_is_refused_before_anything_runs() {
    let folder = tempfile::tempdir().unwrap();
    let program = folder.path().join("part.ngc");
    fs::write(&program, "G0 X10\nG1 X20\n").unwrap();
    let program = program.to_str().unwrap();
    let trace = folder.path().join("trace.csv");
    for arguments in [
        &[PORTAL, program, "--trace", trace.to_str().unwrap()][..],
        &[PORTAL, "no/such/part.ngc"],
        &["no/such/machine.toml", program],
        &[PORTAL],
        &[PORTAL, program, "--seed", "many"],
    ] {
        let output = syncline(arguments, &[]);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(output.stdout.is_empty() && !output.stderr.is_empty());
    }
    assert!(!trace.exists() || fs::read_to_string(&trace).unwrap().lines().count() <= 1);
    // A result that cannot be written is told.
    let output = syncline(
        &[
            PORTAL,
            "examples/portal/corners.ngc",
            "--report",
            "/no/such/folder/report.html",
        ],
        &[],
    );
    assert_ne!(output.status.code(), Some(0));
}

#[test]
fn trace_json_and_report_tell_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let [trace, report] = ["trace.csv", "report.html"].map(|name| folder.path().join(name));
    let (result, _) = json(&[
        XYZ,
        "examples/xyz/spiral.ngc",
        "--trace",
        trace.to_str().unwrap(),
        "--report",
        report.to_str().unwrap(),
    ]);
    let trace = read_trace(&trace);
    assert_eq!(result["cycles"], trace.time.len());
    let html = fs::read_to_string(report).unwrap();
    for part in [
        "<b>Pass</b>",
        "Tool path",
        "Axis X",
        "Axis Y",
        "Axis Z",
        "Following error",
        result["frames_sha256"].as_str().unwrap(),
    ] {
        assert!(html.contains(part), "{part}");
    }
    for key in [
        "verdict",
        "duration_s",
        "cycles",
        "late_setpoints",
        "frames_sha256",
        "path",
        "bus",
        "axes",
        "violations",
    ] {
        assert!(result.get(key).is_some(), "{key}");
    }
    let load = result["bus"][0]["peak_utilisation"].as_f64().unwrap();
    assert!((0.1..1.0).contains(&load), "{load}");
}

/// Spindle, coolant and tool are on the trace while the moves that they belong to run, and outputs
/// are told in their order.
#[test]
fn what_a_program_switches_is_on_the_trace() {
    let folder = tempfile::tempdir().unwrap();
    let (program, trace) = (
        folder.path().join("part.ngc"),
        folder.path().join("trace.csv"),
    );
    fs::write(
        &program,
        "G21 F6000\nM64 P1\nG0 X5 Y9\nM3 S900 M8\nG2 X5 I5\nM5 M9 M101 P0.5 Q2\nG4 P0.1\nT7 M6\n\
         G1 X20\nM4 S50 M7\nG1 X5\nM65 P1\nM30\n",
    )
    .unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_syncline"))
        .args(["validate", "examples/portal/machine.toml"])
        .args([&program, Path::new("--trace"), &trace])
        .current_dir(root())
        .output()
        .unwrap();
    let told = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(0), "{told}");
    assert_eq!(
        told,
        "line 2: M64 P1\nline 6: M101 P0.5 Q2\nline 12: M65 P1\n"
    );
    let mut states: Vec<String> = Vec::new();
    for row in fs::read_to_string(trace).unwrap().lines().skip(1) {
        let fields: Vec<&str> = row.split(',').collect();
        let state = [&fields[1..2], &fields[fields.len() - 3..]]
            .concat()
            .join(",");
        if states.last() != Some(&state) {
            states.push(state);
        }
    }
    // All that stands between two moves is switched when the first of them is done.
    let expected = ["3,0,0,0", "5,900,2,0", "5,0,0,7", "9,0,0,7", "11,-50,1,7"];
    assert_eq!(states, expected);
}
