//! `validate --trajectory` as a user runs it, on each kind of file, and what simulated drives make of it.

use super::causes::Dice;
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

    /// A trajectory of X and Y.
    fn motion(&self, name: &str, step: f64, rows: &[[f64; 2]]) -> PathBuf {
        let mut text = "t,X,Y\n".to_owned();
        for (row, [x, y]) in rows.iter().enumerate() {
            writeln!(text, "{},{x},{y}", row as f64 * step).unwrap();
        }
        self.folder.file(name, &text)
    }

    /// The trace of the program on the machine, and what its validation says.
    fn traced(&self) -> (PathBuf, Value) {
        let program = self.folder.file("traced.ngc", PROGRAM);
        let trace = self.folder.path("traced.csv");
        let mut command = syncline();
        command.args(["validate", "--json", "-", "--trace"]);
        command.arg(&trace).args([&self.machine, &program]);
        let output = command.output().unwrap();
        let (code, json, errors) = ended(&output);
        assert_eq!(code, 0, "{errors}");
        (trace, serde_json::from_str(json).unwrap())
    }

    /// The trace of the program on the machine.
    fn trace(&self) -> PathBuf {
        self.traced().0
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

/// An axis that begins beside its soft limit by an encoder's noise stands there, as when a program begins.
#[test]
fn a_trace_may_begin_where_an_encoder_says() {
    let side = Side::new();
    let trace = side.trace();
    for (least, passes) in [(0.004, true), (0.02, false)] {
        let limits = format!("axis.Y.soft_limits=[{least}, 300]");
        let (code, json, errors) = side.judge(&trace, &["--set", &limits]);
        assert_eq!(code == 0, passes, "{errors} {json:#}");
        let told = &limit(&json, "Y", "position")["judgement"];
        assert_eq!(told, if passes { "kept" } else { "exceeded" }, "{json:#}");
    }
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

fn number(of: &Value, key: &str) -> f64 {
    let number = of[key].as_f64();
    number.unwrap_or_else(|| panic!("no {key}: {of:#}"))
}

fn named<'a>(list: &'a Value, name: &str) -> &'a Value {
    let mut all = list.as_array().unwrap().iter();
    let found = all.find(|it| it["name"] == name);
    found.unwrap_or_else(|| panic!("no {name}: {list:#}"))
}

/// Motion of a smooth step: at rest with no acceleration at both ends.
fn smooth(u: f64) -> f64 {
    u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
}

/// What the drives make of the trace of a program is what they made of the program.
#[test]
fn the_drives_follow_a_trace_as_they_followed_the_program() {
    let side = Side::new();
    let (trace, program) = side.traced();
    let (code, json, errors) = side.judge(&trace, &[]);
    let response = &json["response"];
    assert_eq!(
        (code, &response["verdict"]),
        (0, &"pass".into()),
        "{errors} {json:#}"
    );
    assert_eq!(json["not_simulated"], Value::Null);
    for axis in ["X", "Y", "Z"] {
        let [of, was] = [response, &program].map(|it| named(&it["axes"], axis));
        for (key, off) in [
            ("max_following_error_mm", 6e-4),
            ("rms_following_error_mm", 1e-4),
            ("max_velocity", 0.1),
        ] {
            let [of, was] = [of, was].map(|it| number(it, key));
            assert!((of - was).abs() < off, "{axis} {key}: {of}, was {was}");
        }
    }
    let at = |of: &Value| number(&named(&of["axes"], "X")["max_following_error_at"], "time_s");
    assert!(
        (at(response) - at(&program)).abs() < 0.5 * STEP,
        "{response:#}"
    );
    for drive in ["left-right", "front-back", "up-down"] {
        let [of, was] = [response, &program].map(|it| named(&it["drives"], drive));
        for (key, off) in [
            ("max_torque", 0.06),
            ("rms_torque", 0.01),
            ("max_speed_rpm", 3.0),
        ] {
            let [of, was] = [of, was].map(|it| number(it, key));
            assert!((of - was).abs() < off, "{drive} {key}: {of}, was {was}");
        }
    }
    let [path, was] = [response, &program].map(|it| &it["path"]);
    let drives = "max_drive_deviation_mm";
    assert!(
        (number(path, drives) - number(was, drives)).abs() < 5e-4,
        "{path:#} {was:#}"
    );
    assert!(
        (number(path, "length_mm") - number(was, "length_mm")).abs() < 0.1,
        "{path:#} {was:#}"
    );
    assert_eq!(number(path, "max_deviation_mm"), 0.0);
    let [moved, was] = [response, &program].map(|it| number(&it["times"], "motion_s"));
    assert!((moved - was).abs() < 2.5 * STEP, "{moved} {was}");
}

/// Drawn motions between drawn places, sampled at any step: the drives go all of each way, in its time, as fast as it is,
/// and the same from run to run; what the loops leave behind at a steady speed is what their closed form says.
#[test]
fn drawn_motions_are_followed_at_any_step() {
    let side = Side::new();
    for case in 0..24 {
        let mut dice = Dice(case);
        let step = [0.001, 0.004, dice.between([0.0007, 0.009])][case as usize % 3];
        let mut rows = vec![[dice.between([-60.0, 60.0]), dice.between([-60.0, 60.0])]];
        let (mut duration, mut length, mut fastest) = (0.0, 0.0, [0.0_f64; 2]);
        for _ in 0..3 {
            let from = *rows.last().unwrap();
            let to = [0, 1].map(|_| dice.between([-60.0, 60.0]));
            let way = [0, 1].map(|at| to[at] - from[at]);
            let longest = way[0].abs().max(way[1].abs());
            // The greatest of its derivatives are 1.875, 5.774 and 60 of the way by the time.
            let jerky = (60.0 * longest / 45_000.0).cbrt();
            let time = jerky
                .max((5.774 * longest / 2200.0).sqrt())
                .max(longest / 150.0);
            let count = (dice.between([1.0, 2.0]) * time / step).ceil();
            for row in 1..=count as usize {
                let u = smooth(row as f64 / count);
                rows.push([0, 1].map(|at| from[at] + u * way[at]));
            }
            duration += count * step;
            length += way[0].hypot(way[1]);
            for (fastest, way) in fastest.iter_mut().zip(way) {
                *fastest = fastest.max(1.875 * way.abs() / (count * step));
            }
        }
        let file = side.motion("drawn.csv", step, &rows);
        let (code, json, errors) = side.judge(&file, &[]);
        let response = &json["response"];
        assert_eq!(
            (code, &json["verdict"]),
            (0, &"pass".into()),
            "{case}: {errors} {json:#}"
        );
        let moved = number(response, "duration_s");
        // The first and the last samples may be too near to each other to be told apart.
        assert!(
            (moved - duration).abs() < 0.01 + 2.0 * step,
            "{case}: {moved} s of {duration}"
        );
        let way = number(&response["path"], "length_mm");
        assert!(
            (way - length).abs() < 1e-3 + 1e-4 * length,
            "{case}: {way} mm of {length}"
        );
        for (axis, most) in ["X", "Y"].into_iter().zip(fastest) {
            let it = named(&response["axes"], axis);
            let reached = number(it, "max_velocity");
            assert!(
                (reached - most).abs() < 0.01 * most + 0.1,
                "{case} {axis}: {reached} of {most}"
            );
            // At a steady speed v / Kp, 80 1/s, is what is left without velocity feed-forward; all of it has that here.
            let behind = number(it, "max_following_error_mm");
            assert!(
                behind < most / 80.0,
                "{case} {axis}: {behind} mm at {most} mm/s"
            );
            let at = &it["max_following_error_at"];
            let row = number(at, "time_s") / step;
            assert!(
                (number(at, "line") - 1.0 - row.floor()).abs() <= 1.0,
                "{case}: {at:#}"
            );
        }
        if case == 0 {
            let (_, again, _) = side.judge(&file, &[]);
            assert_eq!(again, json);
        }
    }
}

/// A line at a steady speed in Y that begins and ends smoothly.
fn steady(speed: f64) -> Vec<[f64; 2]> {
    let mut rows = vec![[0.0, 0.0]];
    let (ramp, count) = (200, 500);
    for row in 1..=2 * ramp + count {
        let share = match row {
            row if row < ramp => smooth(row as f64 / ramp as f64),
            row if row > ramp + count => smooth((2 * ramp + count - row) as f64 / ramp as f64),
            _ => 1.0,
        };
        let y = rows.last().unwrap()[1];
        rows.push([0.0, y + share * speed * 0.001]);
    }
    rows
}

/// A loop without velocity feed-forward lags by v / Kp: Kp is 80 1/s as the drives are by themselves, and what is written into them.
#[test]
fn a_steady_speed_lags_as_the_loops_closed_form_says() {
    let side = Side::new();
    let file = side.motion("steady.csv", 0.001, &steady(40.0));
    for (share, expected) in [(0, 40.0 / 80.0), (500, 20.0 / 80.0)] {
        let sdo = format!("drive.\"front-back\".sdo=[[\"3012:6\",{share}],[\"3013:6\",{share}]]");
        let (_, json, errors) = side.judge(&file, &["--set", &sdo]);
        let behind = number(
            named(&json["response"]["axes"], "Y"),
            "max_following_error_mm",
        );
        assert!(
            (behind - expected).abs() < 0.02 * expected,
            "{errors} {behind} mm of {expected}"
        );
    }
}

/// Drives that cannot follow fail a trajectory whose limits are kept, and the cause is named.
#[test]
fn drives_that_cannot_follow_fail_it() {
    let side = Side::new();
    let file = side.motion("steady.csv", 0.001, &steady(40.0));
    let tight = ["--set", "validation.following_error=0.002"];
    let (code, json, errors) = side.judge(&file, &tight);
    assert_eq!(
        (code, &json["verdict"]),
        (1, &"fail".into()),
        "{errors} {json:#}"
    );
    let violation = &json["response"]["violations"][0];
    assert_eq!(
        (&violation["what"], &violation["axis"]),
        (&"following_error".into(), &"Y".into())
    );
    // What is sampled is judged with its uncertainty, above; nothing of it is judged a second time.
    for it in json["limits"].as_array().unwrap() {
        assert_eq!(it["judgement"], "kept", "{it:#}");
    }

    // A fault on the way brings the axes to rest inside their limits, and the rest of the samples is not followed.
    let stopping = [
        "--set",
        "axis.Y.following_error_limit=0.4",
        "--set",
        "drive.\"front-back\".sdo=[[\"3012:6\",0],[\"3013:6\",0]]",
    ];
    let (code, json, errors) = side.judge(&file, &stopping);
    assert_eq!(code, 1, "{errors} {json:#}");
    let response = &json["response"];
    let outcome = response["outcome"].as_str().unwrap();
    assert!(outcome.contains("axis Y: following error 0.4"), "{outcome}");
    assert_eq!(response["cause"]["what"], "gains", "{response:#}");
    let at = number(&response["stopped"]["position"], "Y");
    assert!((1.0..20.0).contains(&at), "{response:#}");
    let y = named(&response["axes"], "Y");
    assert!(
        number(y, "max_acceleration") <= 2500.5 && number(y, "max_velocity") <= 40.1,
        "{y:#}"
    );
}

/// What ends in motion asks for a stop at once: the trajectory is told to be wrong, and not we.
#[test]
fn a_motion_that_does_not_end_at_rest_is_told_as_what_it_is() {
    let side = Side::new();
    let mut rows = steady(40.0);
    rows.truncate(rows.len() / 2);
    let file = side.motion("cut.csv", 0.001, &rows);
    let (code, json, errors) = side.judge(&file, &[]);
    assert_eq!(code, 1, "{errors} {json:#}");
    let outcome = json["response"]["outcome"].as_str().unwrap();
    let asks = "axis Y: a setpoint whose acceleration is ";
    assert!(
        outcome.contains(asks)
            && outcome.contains("the trajectory asks for more than the axis may do"),
        "{outcome}"
    );
}

/// A motion that keeps its limits, written with fewer and fewer decimals: what they do not decide stays undecidable, also
/// where the controller refuses such samples, and the machine is not blamed for them. What was wrong beside that is.
#[test]
fn digits_that_do_not_decide_are_no_fault_of_the_machine() {
    let side = Side::new();
    let rows: Vec<f64> = (0..=1000)
        .map(|row| 60.0 * smooth(f64::from(row) / 1000.0))
        .collect();
    let mut refused = 0;
    for decimals in [12, 5, 4, 3, 2] {
        let mut text = "t_s,X\n".to_owned();
        for (row, x) in rows.iter().enumerate() {
            writeln!(text, "{:.3},{x:.decimals$}", row as f64 * 0.001).unwrap();
        }
        let file = side.folder.file("rounded.csv", &text);
        let (code, json, errors) = side.judge(&file, &[]);
        let expected = match decimals {
            12 => (0, "pass"),
            _ => (1, "undecidable"),
        };
        let found = (code, json["verdict"].as_str().unwrap());
        assert_eq!(found, expected, "{decimals}: {errors} {json:#}");
        let response = &json["response"];
        assert_eq!(response["cause"], Value::Null, "{decimals}: {response:#}");
        refused += usize::from(response["verdict"] == "fail");
        let off = ["--set", "validation.following_error=1e-9"];
        let (_, json, _) = side.judge(&file, &off);
        assert_eq!(json["verdict"], "fail", "{decimals}: {json:#}");
    }
    assert!(refused > 0);
}

/// The fault and where the run stopped are told at one sample, whose number, from 1, and time belong together.
fn assert_refused_at_its_sample(response: &Value, step: f64) {
    let violations = response["violations"].as_array().unwrap();
    let mut faults = violations.iter();
    let fault = faults.find(|it| it["what"].as_str().unwrap().starts_with("fault: "));
    let fault = fault.unwrap_or_else(|| panic!("{response:#}"));
    let sample = 1.0 + (number(fault, "time_s") / step).round();
    assert_eq!(number(fault, "line"), sample, "{response:#}");
    assert_eq!(number(&response["stopped"], "line"), sample, "{response:#}");
}

/// Samples beyond a limit are not sent: the machine stops, and says whose fault it is. Where they begin beyond a soft limit
/// it cannot go there.
#[test]
fn what_is_beyond_a_limit_is_not_sent() {
    let side = Side::new();
    let file = side.motion("steady.csv", 0.001, &steady(40.0));
    let slow = ["--set", "axis.Y.max_velocity=20"];
    let (code, json, _) = side.judge(&file, &slow);
    let outcome = json["response"]["outcome"].as_str().unwrap();
    assert_eq!(
        (code, &limit(&json, "Y", "velocity")["judgement"]),
        (1, &"exceeded".into())
    );
    assert!(
        outcome.contains("the trajectory asks for more than the axis may do"),
        "{outcome}"
    );
    assert_refused_at_its_sample(&json["response"], 0.001);

    // The first of them comes to no axis.
    let rows: Vec<_> = (0..9).map(|row| [0.0, f64::from(row % 2)]).collect();
    let jerks = side.motion("jerks.csv", 0.004, &rows);
    let (_, json, _) = side.judge(&jerks, &[]);
    assert_refused_at_its_sample(&json["response"], 0.004);

    let outside = side.motion("outside.csv", 0.001, &[[0.0, 300.0], [0.0, 300.0]]);
    let (code, json, errors) = side.judge(&outside, &[]);
    let why = json["not_simulated"].as_str().unwrap_or_default();
    assert_eq!(
        (code, &json["verdict"]),
        (1, &"fail".into()),
        "{errors} {json:#}"
    );
    assert!(why.contains("its soft limits are -200 to 200"), "{why}");
    assert_eq!(json["response"], Value::Null);
}
