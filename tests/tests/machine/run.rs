//! `syncline run`: a program in real time on simulated drives, as a user sees it.

use serde_json::Value;
use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use syncline_tests::command::{Folder, ended, machine_with, syncline, text};
use syncline_tests::rig::{PORTAL_PROGRAM, example};
use syncline_tests::trace::Trace;

fn run(machine: &Path, program: &Path, arguments: &[&str]) -> Command {
    let mut command = syncline();
    command.arg("run").arg(machine).arg(program).args(arguments);
    command.stdin(Stdio::null());
    command
}

/// Phases of the end, as `--verbose` names them, in their order.
const END: [&str; 6] = [
    "coming to rest",
    "ending the operating mode",
    "switching the power stages off",
    "ending the synchronisation",
    "NMT Pre-Operational",
    "SYNC off",
];

fn assert_in_order(log: &str, parts: &[&str]) {
    let mut rest = log;
    for part in parts {
        let (_, behind) = rest
            .split_once(part)
            .unwrap_or_else(|| panic!("no {part} in {log}"));
        rest = behind;
    }
}

#[test]
fn a_program_runs_to_its_end_and_leaves_its_files() {
    let folder = Folder::new();
    let program = folder.file("short.ngc", PORTAL_PROGRAM);
    let path = |name: &str| folder.path(name).display().to_string();
    let (trace, json, report) = (path("run.csv"), path("run.json"), path("run.html"));
    let (candump, packets) = (path("run.log"), path("run.pcapng"));
    let files = [
        ["--trace", &trace, "--json", &json, "--report", &report],
        ["--candump", &candump, "--pcapng", &packets, "--seed", "5"],
    ];
    let arguments = [files.as_flattened(), &["--verbose", "--wait-for-plan"]].concat();
    let machine = folder.machine("portal");
    let output = run(&machine, &program, &arguments).output().unwrap();
    let (code, printed, log) = ended(&output);
    assert_eq!(code, 0, "{log}");
    for part in [
        "program finished\n",
        "verdict            pass\n",
        "motion time",
        "late cycles",
        "wake-up latency",
        "SYNC jitter",
        "following error max",
    ] {
        assert!(printed.contains(part), "no {part} in {printed}");
    }
    // In one line what the kernel granted and what it did not.
    assert_eq!(
        log.lines()
            .filter(|line| line.starts_with("real time: "))
            .count(),
        1,
        "{log}"
    );
    assert_in_order(log, &["reading the drives' states", "ready"]);
    assert_in_order(log, &END);

    let json: serde_json::Value = serde_json::from_str(&folder.read("run.json")).unwrap();
    assert_eq!(json["verdict"], "pass");
    let html = folder.read("run.html");
    assert!(html.contains("program finished") && html.contains("wake-up latency"));

    // The setpoints of `run` and of `validate` are the same: not in the plan alone, but in every
    // column and every frame, as a simulated bus lives by the controller's cycle.
    let (other, digest) = (path("validate.csv"), &json["frames_sha256"]);
    let (other_log, other_packets) = (path("validate.log"), path("validate.pcapng"));
    let output = syncline()
        .args(["validate", "--seed", "5", "--json", "-", "--trace", &other])
        .args(["--candump", &other_log, "--pcapng", &other_packets])
        .args([&machine, &program])
        .output()
        .unwrap();
    let validated: serde_json::Value = serde_json::from_str(ended(&output).1).unwrap();
    for (one, other) in [
        (trace, other),
        (candump, other_log),
        (packets, other_packets),
    ] {
        assert!(
            fs::read(&one).unwrap() == fs::read(&other).unwrap(),
            "{one}"
        );
    }
    assert_eq!(&validated["frames_sha256"], digest);
}

/// The tool pushes at embedded drives in real time as it does in a validation: they send the same frames.
#[test]
fn a_tool_that_cuts_does_so_in_real_time() {
    let folder = Folder::new();
    let program = folder.file("part.ngc", "G21 G90 G61 M3 S6000\nG1 X5 F600\nM2\n");
    let digest = |command: &str, cutting: &str| {
        let machine = folder.file("xyz.toml", &(machine_with("xyz", &[]) + cutting));
        let json = folder.path("out.json");
        let waits: &[&str] = match command {
            "run" => &["--wait-for-plan"],
            _ => &[],
        };
        let output = syncline()
            .args([command, "--seed", "5", "--json"])
            .args([Path::new(&json), &machine, &program])
            .args(waits)
            .stdin(Stdio::null())
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        let json: Value = serde_json::from_str(&folder.read("out.json")).unwrap();
        json["frames_sha256"].clone()
    };
    let cutting = "[[simulation.cutting]]\nspecific_force = 2000.0\nwidth = 2.0\n";
    assert_ne!(digest("validate", cutting), digest("validate", ""));
    assert_eq!(digest("run", cutting), digest("validate", cutting));
}

#[test]
fn the_other_machine_runs_a_program_too() {
    let folder = Folder::new();
    let program = folder.file("p.ngc", "G0 X20 Y-20\nG3 X30 Y-10 J10 F6000\nG0 Z-5\nM30\n");
    let output = run(&folder.machine("xyz"), &program, &[]).output().unwrap();
    let (code, printed, log) = ended(&output);
    assert_eq!(code, 0, "{printed}{log}");
}

/// A run that is watched while it goes on.
struct Watched {
    child: Child,
    log: BufReader<std::process::ChildStderr>,
    seen: String,
}

impl Watched {
    fn start(command: &mut Command) -> Self {
        let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let log = BufReader::new(child.stderr.take().unwrap());
        Self {
            child,
            log,
            seen: String::new(),
        }
    }

    /// Waits for a line of the log.
    fn wait_for(&mut self, part: &str) {
        loop {
            let mut line = String::new();
            let bytes = self.log.read_line(&mut line).unwrap();
            self.seen += &line;
            assert!(bytes > 0, "no {part} in {}", self.seen);
            if line.contains(part) {
                return;
            }
        }
    }

    fn end(mut self) -> (Output, String) {
        self.log.read_to_string(&mut self.seen).unwrap();
        (self.child.wait_with_output().unwrap(), self.seen)
    }
}

#[test]
fn a_program_stop_goes_on_with_enter() {
    let folder = Folder::new();
    let program = folder.file("p.ngc", "G0 X50\nM0\nX60\nM1\nT3 M6\nX70\n/X90\nM2\n");
    let trace = folder.path("trace.csv");
    let machine = folder.machine("portal");
    let arguments = ["--no-block-delete", "--trace", trace.to_str().unwrap()];
    let mut command = run(&machine, &program, &arguments);
    let mut run = Watched::start(command.stdin(Stdio::piped()));
    let mut enter = run.child.stdin.take().unwrap();
    run.wait_for("line 2: program stop (M0)");
    run.wait_for("press Enter");
    enter.write_all(b"\n").unwrap();
    run.wait_for("going on");
    // M1 does not stop without --optional-stop.
    run.wait_for("line 5: tool change (M6): load tool 3");
    enter.write_all(b"\n").unwrap();
    let (output, log) = run.end();
    assert_eq!(ended(&output).0, 0, "{log}");
    assert!(!log.contains("M1"), "{log}");
    let trace = Trace::read(&example("portal"), &folder.read("trace.csv"));
    trace.assert_within_limits();
    let end = *trace.axis("X").set.last().unwrap();
    assert!(
        (end - 90.0).abs() < 1e-3,
        "with --no-block-delete `/` is nothing: {end}"
    );
}

#[test]
fn the_operators_switches_count() {
    let folder = Folder::new();
    let program = folder.file("p.ngc", "G0 X10\nM1\n/X90\nM2\n");
    let arguments = ["--optional-stop"];
    let mut command = run(&folder.machine("portal"), &program, &arguments);
    let mut run = Watched::start(command.stdin(Stdio::piped()));
    let mut enter = run.child.stdin.take().unwrap();
    run.wait_for("line 2: optional stop (M1)");
    enter.write_all(b"\n").unwrap();
    let (output, log) = run.end();
    let (code, printed, _) = ended(&output);
    assert_eq!(code, 0, "{log}");
    assert!(
        printed.contains("path               10.000 mm"),
        "{printed}"
    );
}

#[test]
fn a_program_stop_that_nobody_can_end_stops_the_machine() {
    let folder = Folder::new();
    let program = folder.file("p.ngc", "G0 X10\nM0\nX20\nM2\n");
    let output = run(&folder.machine("portal"), &program, &["--verbose"])
        .output()
        .unwrap();
    let (code, printed, log) = ended(&output);
    assert_eq!(code, 130, "{log}");
    assert!(log.contains("standard input is closed"), "{log}");
    assert!(printed.contains("interrupted"), "{printed}");
    assert_in_order(log, &END);
}

#[test]
fn ctrl_c_stops_on_the_path_and_switches_the_drives_off() {
    let folder = Folder::new();
    // 10 s along a line on which Y is half of X.
    let program = folder.file("p.ngc", "G1 X1000 Y500 F6000\nM2\n");
    let path = |name: &str| folder.path(name).display().to_string();
    let (trace, json) = (path("trace.csv"), path("run.json"));
    let arguments = ["--verbose", "--trace", &trace, "--json", &json];
    let mut command = run(&folder.machine("portal"), &program, &arguments);
    let mut run = Watched::start(&mut command);
    run.wait_for("ready");
    std::thread::sleep(std::time::Duration::from_millis(500));
    let kill = format!("kill -INT {}", run.child.id());
    assert!(
        Command::new("sh")
            .args(["-c", &kill])
            .status()
            .unwrap()
            .success()
    );
    let (output, log) = run.end();
    let (code, printed, _) = ended(&output);
    assert_eq!(code, 130, "{log}");
    assert!(printed.contains("interrupted by a stop"), "{printed}");
    assert_in_order(
        &log,
        &[&["interrupted: stopping on the path"], &END[..]].concat(),
    );

    let trace = Trace::read(&example("portal"), &folder.read("trace.csv"));
    trace.assert_within_limits();
    assert!(trace.ends_at_rest(3));
    let (x, y) = (trace.axis("X"), trace.axis("Y"));
    let end = *x.set.last().unwrap();
    assert!(end > 1.0 && end < 900.0, "stopped at {end}");
    let aside = x.set.iter().zip(&y.set).map(|(x, y)| (x / 2.0 - y).abs());
    // Off the line by no more than where the axes stood at the start.
    assert!(aside.fold(0.0, f64::max) < 2e-3);
    let json: serde_json::Value = serde_json::from_str(&folder.read("run.json")).unwrap();
    // A host that is too slow may have made setpoints late.
    let late = json["late_setpoints"] != 0;
    assert_eq!(json["verdict"], if late { "fail" } else { "interrupted" });
    assert!(json["stopped"]["left_mm"].as_f64().unwrap() > 0.0);
}

#[test]
fn a_fault_ends_the_run_with_its_reason() {
    let folder = Folder::new();
    let machine = machine_with(
        "portal",
        &[
            (
                "following_error_limit = 2.0",
                "following_error_limit = 0.001",
            ),
            (
                "drive_following_error = true",
                "drive_following_error = false",
            ),
        ],
    );
    let machine = folder.file("machine.toml", &machine);
    let program = folder.file("p.ngc", "G0 X300\nM2\n");
    let output = run(&machine, &program, &["--verbose"]).output().unwrap();
    let (code, printed, log) = ended(&output);
    assert_eq!(code, 1, "{log}");
    assert!(
        printed.contains("outcome            stopped: axis X: following error "),
        "{printed}"
    );
    assert!(
        printed.contains("VIOLATION          following_error of axis X, line 1"),
        "{printed}"
    );
    assert_in_order(
        log,
        &[
            "FAULT: axis X: following error",
            // Both sides of a gantry.
            "quick stop",
            "power stages off",
            "ending the synchronisation",
            "NMT Pre-Operational",
            "SYNC off",
        ],
    );
}

#[test]
fn a_strict_run_is_on_time_or_a_fault() {
    let folder = Folder::new();
    let program = folder.file("p.ngc", "G0 X5\nM2\n");
    let output = run(&folder.machine("portal"), &program, &["--strict"])
        .output()
        .unwrap();
    let (code, printed, log) = ended(&output);
    match code {
        0 => assert!(
            printed.contains("late cycles        0 wake-ups"),
            "{printed}"
        ),
        1 => assert!(log.contains("--strict allows none"), "{log}"),
        _ => panic!("{code}: {log}"),
    }
}

#[test]
fn each_command_explains_itself() {
    let help = |arguments: &[&str]| {
        let output = syncline().args(arguments).output().unwrap();
        let (code, printed, _) = ended(&output);
        assert_eq!(code, 0, "{arguments:?}");
        printed.to_owned()
    };
    let overview = help(&["--help"]);
    for (command, parts) in [
        (
            "run",
            &[
                "--bus",
                "--report",
                "--json",
                "--trace",
                "--seed",
                "--strict",
                "--wait-for-plan",
                "Ctrl-C",
                "Enter",
            ][..],
        ),
        (
            "validate",
            &["--json", "--trace", "--report", "--seed", "virtual time"],
        ),
        ("check", &["MACHINE", "[PROGRAM]"]),
    ] {
        assert!(overview.contains(command), "{overview}");
        let page = help(&[command, "--help"]);
        for part in parts {
            assert!(page.contains(part), "{command}: no {part} in {page}");
        }
        let documented = |line: &&str| line.trim_start().starts_with("--");
        assert!(page.lines().filter(documented).count() >= 1 || command == "check");
    }
    assert!(overview.contains("130 interrupted"), "{overview}");
    assert!(help(&["--version"]).starts_with("syncline "));
}

/// Paths that are relative are relative to where the user stands.
#[test]
fn relative_paths_and_standard_output() {
    let folder = Folder::new();
    let program = folder.file("p.ngc", "G0 X1\nM2\n");
    let _ = folder.machine("portal");
    let mut command = syncline();
    command.current_dir(program.parent().unwrap());
    command.args(["validate", "--json", "-", "--trace", "here.csv"]);
    let output = command.arg("portal.toml").arg("p.ngc").output().unwrap();
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["verdict"], "pass", "{}", text(&output.stderr));
    let trace = Trace::read(&example("portal"), &folder.read("here.csv"));
    trace.assert_within_limits();
}
