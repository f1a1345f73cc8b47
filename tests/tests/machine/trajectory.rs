//! `validate --trajectory` as a user runs it, on each kind of file.

use serde_json::Value;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use syncline_tests::command::{Folder, ended, machine_with, syncline};

const PROGRAM: &str = "G64 P0.05 F6000\nG1 X30 Y10\nG1 X30 Y40\nG1 X0 Y0\nM2\n";

/// Seconds from row to row of the machine's traces.
const STEP: f64 = 0.004;

struct Side {
    folder: Folder,
    machine: PathBuf,
}

impl Side {
    fn new() -> Self {
        let folder = Folder::new();
        let machine = folder.file("xyz.toml", &machine_with("xyz", &[]));
        Self { folder, machine }
    }

    /// Exit code, JSON and errors.
    fn judge(&self, trajectory: &Path, more: &[&str]) -> (i32, Value, String) {
        let mut command = syncline();
        command.args(["validate", "--json", "-"]).arg(&self.machine);
        command.arg("--trajectory").arg(trajectory);
        let output = command.args(more).output().unwrap();
        let (code, json, errors) = ended(&output);
        let json = serde_json::from_str(json).unwrap_or_default();
        (code, json, errors.to_owned())
    }

    /// The trace of the program on the machine.
    fn trace(&self) -> PathBuf {
        let program = self.folder.file("program.ngc", PROGRAM);
        let trace = self.folder.path("trace.csv");
        let mut command = syncline();
        command.arg("validate").arg("--trace").arg(&trace);
        let output = command.args([&self.machine, &program]).output().unwrap();
        let (code, _, errors) = ended(&output);
        assert_eq!(code, 0, "{errors}");
        trace
    }
}

/// The setpoints of X and Y in a trace.
fn setpoints(trace: &Path) -> Vec<[f64; 2]> {
    let text = std::fs::read_to_string(trace).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let columns = ["X_set", "Y_set"].map(|it| header.iter().position(|at| *at == it).unwrap());
    lines
        .map(|line| {
            let fields: Vec<&str> = line.split(',').collect();
            columns.map(|at| fields[at].parse().unwrap())
        })
        .collect()
}

fn limit<'a>(json: &'a Value, axis: &str, what: &str) -> &'a Value {
    let mut limits = json["limits"].as_array().unwrap().iter();
    let found = limits.find(|it| it["axis"] == axis && it["what"] == what);
    found.unwrap_or_else(|| panic!("no {what} of {axis}: {json:#}"))
}

/// What we plan passes with all its digits; another machine's limit is exceeded where the trace says so.
#[test]
fn our_own_trace_passes_and_fails_on_a_slower_machine() {
    let side = Side::new();
    let trace = side.trace();
    let (code, json, errors) = side.judge(&trace, &[]);
    assert_eq!(
        (code, &json["verdict"]),
        (0, &"pass".into()),
        "{errors} {json:#}"
    );

    let slower = ["--set", "axis.Y.max_jerk=20000"];
    let (code, json, errors) = side.judge(&trace, &slower);
    assert_eq!(
        (code, &json["verdict"]),
        (1, &"fail".into()),
        "{errors} {json:#}"
    );
    for it in json["limits"].as_array().unwrap() {
        let is_jerk_of_y = it["axis"] == "Y" && it["what"] == "jerk";
        let expected = if is_jerk_of_y { "exceeded" } else { "kept" };
        assert_eq!(it["judgement"], expected, "{it:#}");
    }
    let jerk = limit(&json, "Y", "jerk");
    let row = (jerk["window_s"][1].as_f64().unwrap() / STEP).round() as usize;
    let y = |back: usize| setpoints(&trace)[row - back][1];
    let mean = (y(0) - 3.0 * (y(1) - y(2)) - y(3)).abs() / STEP.powi(3);
    let told = jerk["value"].as_f64().unwrap();
    assert!((told - mean).abs() < 1e-6 * mean, "{told} {mean}");
}

/// The same motion as LinuxCNC and ROS write it has the same means, to what the digits allow.
#[test]
fn samples_of_others_are_read() {
    let side = Side::new();
    let trace = side.trace();
    let (mut hal, mut ros, mut inch) = (
        String::new(),
        "time_from_start,X.position,Y.position\n".to_owned(),
        "t,X,Y\n".to_owned(),
    );
    for (row, [x, y]) in setpoints(&trace).into_iter().enumerate() {
        let t = row as f64 * STEP;
        writeln!(hal, "{row} {x:.6} {y:.6} ").unwrap();
        writeln!(ros, "{t:.6},{:.9},{:.9}", x / 1000.0, y / 1000.0).unwrap();
        writeln!(inch, "{t},{:.12},{:.12}", x / 25.4, y / 25.4).unwrap();
    }
    let file = |name: &str, text: &str| side.folder.file(name, text);
    let (_, exact, _) = side.judge(&trace, &[]);
    for (trajectory, more) in [
        (
            file("hal.txt", &hal),
            &["--columns", "-,X,Y", "--step", "0.004"][..],
        ),
        (file("ros.csv", &ros), &[]),
        (file("inch.csv", &inch), &["--unit", "inch"]),
    ] {
        let (_, json, errors) = side.judge(&trajectory, more);
        for axis in ["X", "Y"] {
            for what in ["position", "velocity", "acceleration", "jerk"] {
                let [told, exact] = [&json, &exact].map(|it| limit(it, axis, what));
                let [value, off] = ["value", "uncertainty"].map(|it| told[it].as_f64().unwrap());
                let exact = exact["value"].as_f64().unwrap();
                // Of many means the greatest is taken, so that each may be off by so much.
                assert!(
                    (value - exact).abs() <= 1.01 * off + 1e-9,
                    "{errors} {told:#} {exact}"
                );
            }
        }
        // All of the jerk limit is used: six digits do not decide that, and say so; a machine that may more does.
        if trajectory.ends_with("hal.txt") {
            assert_eq!(json["verdict"], "undecidable", "{json:#}");
            let jerk = limit(&json, "X", "jerk");
            assert_eq!(jerk["judgement"], "undecidable", "{json:#}");
            assert!(jerk["kept_from_s"].as_f64().unwrap() > 0.016, "{json:#}");
            let faster = [
                "--set",
                "axis.X.max_jerk=60000",
                "--set",
                "axis.Y.max_jerk=60000",
            ];
            let (code, json, errors) = side.judge(&trajectory, &[more, &faster].concat());
            assert_eq!(code, 0, "{errors} {json:#}");
        }
    }
}

#[test]
fn what_cannot_be_judged_is_said() {
    let side = Side::new();
    let file = |name: &str, text: &str| side.folder.file(name, text);
    let bare = file("bare.txt", "0 1.0 2.0\n1 1.0 2.0\n");
    let by_hand: &[&str] = &["--columns", "-,X,Y", "--step", "0.001"];
    for (trajectory, more, why) in [
        (bare.clone(), &[][..], "name its 3 columns"),
        (bare.clone(), &by_hand[..2], "no column of times: --step"),
        (
            bare.clone(),
            &["--columns", "X,Y", "--step", "1"],
            "3 fields, not 2",
        ),
        (
            bare,
            &["--columns", "-,X,Q", "--step", "1"],
            "`Q` is neither t, - nor an axis",
        ),
        (
            file("lost.txt", "0 1 2\noverrun\n1 1 2\n"),
            by_hand,
            "row 2: `overrun` is no number",
        ),
        (
            file("uneven.csv", "t,X\n0,0\n0.004,0\n0.009,0\n"),
            &[],
            "row 2: 0.004 s after",
        ),
        (
            file("times.csv", "t,X\n0,0\n0.004,0\n"),
            &["--step", "0.004"],
            "leave out --step",
        ),
        (file("once.csv", "t,X\n0,0\n"), &[], "a single sample"),
        (
            file("other.csv", "t,Q\n0,0\n1,1\n"),
            &[],
            "no axis of the machine",
        ),
        (file("empty.csv", ""), &[], "is empty"),
        (side.folder.path("missing.csv"), &[], "cannot read"),
    ] {
        let (code, _, errors) = side.judge(&trajectory, more);
        assert!(
            code == 2 && errors.contains(why),
            "{trajectory:?} {more:?}: {code} {errors}"
        );
    }
}
