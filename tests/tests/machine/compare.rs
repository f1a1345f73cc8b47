//! `compare` as a user runs it: programs, machine files, shapers and recordings.

use serde_json::Value;
use std::path::{Path, PathBuf};
use syncline_tests::command::{Folder, ended, machine_with, syncline};

const PROGRAM: &str =
    "G64 P0.05 F6000\nG1 X60 Y10\nG1 X60 Y60\nG3 X20 Y100 R40\nG1 X-40\nG1 X0 Y0\nM2\n";

/// Files of a test, and what `compare` says of two things.
struct Side {
    folder: Folder,
}

impl Side {
    fn new() -> Self {
        let folder = Folder::new();
        let _ = folder.file("xyz.toml", &machine_with("xyz", &[]));
        let _ = folder.file("program.ngc", PROGRAM);
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path(name)
    }

    /// Exit code, JSON and errors.
    fn compare(&self, first: &Path, second: &Path, more: &[&str]) -> (i32, Value, String) {
        let mut command = syncline();
        command
            .args(["compare", "--json", "-"])
            .args([first, second]);
        command.arg("--machine").arg(self.path("xyz.toml"));
        command.arg("--program").arg(self.path("program.ngc"));
        let output = command.args(more).output().unwrap();
        let (code, json, errors) = ended(&output);
        let json = serde_json::from_str(json).unwrap_or_default();
        (code, json, errors.to_owned())
    }

    /// The trace of a validation with values set.
    fn recorded(&self, name: &str, settings: &[&str]) -> PathBuf {
        let trace = self.path(name);
        let mut command = syncline();
        command.arg("validate").arg("--trace").arg(&trace);
        for setting in settings {
            command.args(["--set", setting]);
        }
        command.args([self.path("xyz.toml"), self.path("program.ngc")]);
        let output = command.output().unwrap();
        let (code, _, errors) = ended(&output);
        assert_eq!(code, 0, "{errors}");
        trace
    }
}

/// Setpoint less actual position of Y in each row of a trace.
fn following_errors(trace: &Path) -> Vec<f64> {
    let text = std::fs::read_to_string(trace).unwrap();
    let mut lines = text.lines();
    let header: Vec<_> = lines.next().unwrap().split(',').collect();
    let [set, act] =
        ["Y_set", "Y_act"].map(|name| header.iter().position(|it| *it == name).unwrap());
    let number = |field: &str| field.parse::<f64>().unwrap();
    let rows = lines.map(|line| line.split(',').collect::<Vec<_>>());
    rows.map(|row| number(row[set]) - number(row[act]))
        .collect()
}

fn number(json: &Value, pointer: &str) -> f64 {
    let value = json.pointer(pointer).and_then(Value::as_f64);
    value.unwrap_or_else(|| panic!("no number {pointer} in {json:#}"))
}

/// A recording beside the validation that it is of, and beside one of another machine: only then the model is wrong, on
/// that axis alone, by the difference of what both say of their following errors.
#[test]
fn a_recording_shows_where_the_model_is_wrong() {
    let side = Side::new();
    let program = side.path("program.ngc");
    let same = side.recorded("same.csv", &[]);
    let (code, json, errors) = side.compare(&same, &program, &[]);
    assert_eq!(code, 0, "{errors}");
    for pointer in [
        "/difference_s",
        "/max_path_difference_mm",
        "/max_contour_difference_mm",
        "/axes/0/max_difference_mm",
        "/axes/1/max_difference_mm",
        "/axes/2/max_difference_mm",
    ] {
        assert!(number(&json, pointer).abs() < 1e-9, "{pointer}: {json:#}");
    }

    // The machine's Y has a softer position loop than the model's.
    let slack = "drive.front-back.sdo=[[\"3012:3\",200]]";
    let slack = side.recorded("slack.csv", &[slack]);
    let (code, json, errors) = side.compare(&slack, &program, &[]);
    assert_eq!(code, 0, "{errors}");
    let of = |name: &str, key: &str| {
        let axes = json["axes"].as_array().unwrap();
        let axis = axes.iter().position(|it| it["name"] == name).unwrap();
        number(&json, &format!("/axes/{axis}/{key}"))
    };
    assert!(of("X", "max_difference_mm") < 1e-3, "{json:#}");
    // Both do the same at the same times: the difference can be seen row by row.
    let difference = following_errors(&slack)
        .iter()
        .zip(following_errors(&same))
        .map(|(one, other)| (one - other).abs())
        .fold(0.0, f64::max);
    let told = of("Y", "max_difference_mm");
    assert!(told > 0.01, "{json:#}");
    // The machine that is switched on stands an increment elsewhere.
    assert!((told - difference).abs() < 1e-3, "{told} {difference}");
    assert!(
        of("Y", "rms_difference_mm") > 20.0 * of("X", "rms_difference_mm"),
        "{json:#}"
    );
    assert!(number(&json, "/difference_s").abs() < 1e-6, "{json:#}");
}

/// Two machines with play, of which one takes it up: their axes say the same, and their tools are apart by the play behind a
/// reversal. A trace has that, too.
#[test]
fn tools_are_compared_where_play_has_them() {
    let side = Side::new();
    let [screw, play] =
        ["transmission=\"screw\"", "play=0.04"].map(|it| format!("axis.X.simulation.{it}"));
    let takes_up = "axis.X.backlash=0.04";
    let reversing = "G61.1 F6000\nG1 X60 Y10\nG1 X20\nG1 Y60\nG1 X0 Y0\nM2\n";
    let program = side.folder.file("program.ngc", reversing);
    let first = side.recorded("first.csv", &[&screw, &play]);
    let recorded = [&first, &program].map(|first| {
        let mut settings: Vec<&str> = Vec::new();
        if !first.ends_with("first.csv") {
            settings.extend(["--set-first", &screw, "--set-first", &play]);
        }
        for setting in [&*screw, &*play, takes_up] {
            settings.extend(["--set-second", setting]);
        }
        let (code, json, errors) = side.compare(first, &program, &settings);
        assert_eq!(code, 0, "{errors}");
        let apart = number(&json, "/max_contour_difference_mm");
        assert!((0.02..0.045).contains(&apart), "{json:#}");
        apart
    });
    assert!((recorded[0] - recorded[1]).abs() < 1e-9, "{recorded:?}");
}

/// Programs by their feed, machine files by their limits, shapers by what they cost: by line and in all.
#[test]
fn programs_machines_and_shapers_are_compared_by_line() {
    let side = Side::new();
    let program = side.path("program.ngc");
    let fast = (side.folder).file("fast.ngc", &PROGRAM.replace("F6000", "F12000"));
    let (_, json, errors) = side.compare(&program, &fast, &[]);
    assert!(number(&json, "/difference_s") < -0.5, "{errors} {json:#}");
    let lines = json["lines"].as_array().unwrap();
    let sum: f64 = lines
        .iter()
        .map(|it| it["difference_s"].as_f64().unwrap())
        .sum();
    assert!(
        (sum - number(&json, "/difference_s")).abs() < 1e-9,
        "{json:#}"
    );
    let whole = number(&json, "/duration_s/0");
    let validated = {
        let mut command = syncline();
        command.args(["validate", "--json", "-"]);
        let output = command
            .args([side.path("xyz.toml"), program.clone()])
            .output();
        let json: Value = serde_json::from_slice(&output.unwrap().stdout).unwrap();
        number(&json, "/duration_s")
    };
    // A cycle at either end.
    assert!(
        (whole - validated).abs() <= 2.0 * 0.004 + 1e-9,
        "{whole} {validated}"
    );

    let slow = machine_with("xyz", &[("max_jerk = 40_000.0", "max_jerk = 40_001.0")]);
    let slow = slow.replace("max_acceleration = 2500.0", "max_acceleration = 800.0");
    let slow = side.folder.file("slow.toml", &slow);
    let (_, json, errors) = side.compare(&side.path("xyz.toml"), &slow, &[]);
    assert!(number(&json, "/difference_s") > 0.1, "{errors} {json:#}");
    // The tolerance of the rounding, and what drives add.
    assert!(number(&json, "/max_path_difference_mm") < 0.06, "{json:#}");

    let jerk = ["--set-second", "axis.Y.max_jerk=5000"];
    let (code, json, errors) = side.compare(&program, &program, &jerk);
    assert!(
        code == 0 && number(&json, "/difference_s") > 0.1,
        "{errors} {json:#}"
    );
    assert_eq!(json["second"], format!("{} {}", program.display(), jerk[1]));
}

#[test]
fn what_cannot_be_compared_is_said() {
    let side = Side::new();
    let program = side.path("program.ngc");
    let file = |name: &str, text: &str| side.folder.file(name, text);
    for (first, why) in [
        (file("none.csv", "a,b\n1,2\n"), "no column `t_s`"),
        (
            file("no_act.csv", "t_s,line,X_set\n0,1,2\n"),
            "no column `X_act`",
        ),
        (
            file("word.csv", "t_s,line,X_set,X_act\n0,1,one,2\n"),
            "row 1: `one` is no number",
        ),
        (
            file("short.csv", "t_s,line,X_set,X_act\n0,1,1\n"),
            "3 fields, not 4",
        ),
        (
            file("still.csv", "t_s,line,X_set,X_act\n0,1,1,1\n"),
            "never change",
        ),
        (
            file("other.csv", "t_s,line,Q_set,Q_act\n0,1,0,0\n1,1,1,1\n"),
            "no axis is in both",
        ),
        (side.path("missing.csv"), "cannot read"),
    ] {
        let (code, _, errors) = side.compare(&first, &program, &[]);
        assert!(
            code == 2 && errors.contains(why),
            "{first:?}: {code} {errors}"
        );
    }
    // A side that does not pass is compared as far as it came.
    let stops = ["--set-second", "axis.Y.following_error_limit=0.001"];
    let (code, json, errors) = side.compare(&program, &program, &stops);
    assert!(code == 0 && errors.contains("does not pass"), "{errors}");
    assert_eq!(json["off_path_at"]["line"], 2, "{json:#}");
    let output = syncline()
        .arg("compare")
        .args([&program, &program])
        .output();
    let output = output.unwrap();
    let (code, _, errors) = ended(&output);
    assert!(code == 2 && errors.contains("--machine names"), "{errors}");
}
