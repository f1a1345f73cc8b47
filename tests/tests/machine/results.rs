//! What a run's summary says: the same in the verdict, the violations and the JSON, after a fault and after a
//! stop too.

use serde_json::Value;
use std::path::Path;
use syncline_tests::command::{Folder, ended, machine_with, syncline};

/// A probe at the Z drive of the xyz machine.
const PROBE: &str =
    "\n[[input]]\nname = \"probe\"\ndrive = \"up-down\"\nsignal = \"DI1\"\nfunction = \"probe\"\n";

/// The JSON of a validation, and what it prints.
fn validate(machine: &Path, program: &Path, events: Option<&Path>) -> (Value, String) {
    let folder = Folder::new();
    let json = folder.path("result.json");
    let mut command = syncline();
    command.arg("validate").args([machine, program]);
    command.arg("--json").arg(&json);
    if let Some(events) = events {
        command.arg("--events").arg(events);
    }
    let output = command.output().unwrap();
    let (_, printed, _) = ended(&output);
    (
        serde_json::from_str(&folder.read("result.json")).unwrap(),
        printed.to_owned(),
    )
}

fn number(json: &Value, pointer: &str) -> f64 {
    let value = json.pointer(pointer).and_then(Value::as_f64);
    value.unwrap_or_else(|| panic!("no number {pointer} in {json:#}"))
}

#[test]
fn all_the_time_of_a_run_is_named() {
    let folder = Folder::new();
    let program = "G4 P0.5\nG0 X10\nG4 P0.3\nG1 Y5 F600\nM0\nG0 X0\nG4 P0.2\nM2\n";
    let program = folder.file("p.ngc", program);
    let events = folder.file("e.csv", "t_s,event,value\n1.2,feed_hold,\n1.6,resume,\n");
    let (json, printed) = validate(&folder.machine("portal"), &program, Some(&events));
    assert_eq!(json["verdict"], "pass", "{json:#}");
    let of = |what: &str| number(&json, &format!("/times/{what}_s"));
    // Where a dwell begins and ends between two cycles, these are motion.
    assert!((of("dwell") - 1.0).abs() <= 0.008, "{json:#}");
    assert!(of("waiting") > 0.3 && of("waiting") < 0.45, "{json:#}");
    assert!(of("settling") > 0.04 && of("settling") < 0.06, "{json:#}");
    assert_eq!(of("jogging"), 0.0);
    let names = [
        "motion", "dwell", "waiting", "awaiting", "jogging", "planning", "settling",
    ];
    let all: f64 = names.into_iter().map(of).sum();
    assert!(
        (all - 0.002 * number(&json, "/cycles")).abs() < 1e-9,
        "{json:#}"
    );
    // From the first to the last motion there is one of the dwells, and the rests.
    let least = of("motion") + of("waiting") + 0.29;
    let duration = number(&json, "/duration_s");
    assert!(duration >= least && duration < least + 0.05, "{json:#}");
    for told in [
        "motion time",
        "dwells",
        "waiting for an operator",
        "settling",
    ] {
        assert!(printed.contains(told), "{printed}");
    }
}

/// Until a spindle turns, and until it stands at its angle.
#[test]
fn the_time_that_a_program_waits_for_its_spindle_is_named() {
    let folder = Folder::new();
    let program = "M3 S2000\nG1 X20 F1200\nM19 R90\nG0 X0\nM5\nM2\n";
    let program = folder.file("p.ngc", program);
    let (json, printed) = validate(&folder.machine("drill"), &program, None);
    assert_eq!(json["verdict"], "pass", "{json:#}");
    let of = |what: &str| number(&json, &format!("/times/{what}_s"));
    // Up to 2000 of 3000 1/min in 300 ms, down again, up to half a turn, and 50 ms of standing each time.
    let awaiting = of("awaiting");
    assert!((0.6..1.2).contains(&awaiting), "{awaiting} s");
    assert!(of("planning") < 0.01, "{json:#}");
    assert!(printed.contains("waiting for the machine"), "{printed}");
    let states = json["switched"].as_array().unwrap();
    let held: Vec<_> = states.iter().map(|it| &it["orientation_deg"]).collect();
    assert!(held.iter().any(|angle| *angle == 90.0) && held.last().unwrap().is_null());
}

#[test]
fn a_fault_is_told_when_it_arose_with_its_value_and_the_maxima_go_on() {
    let folder = Folder::new();
    let machine = machine_with(
        "portal",
        &[(
            "following_error_limit = 2.0",
            "following_error_limit = 0.005",
        )],
    )
    .replacen(
        "drive_following_error = true",
        "drive_following_error = false",
        1,
    );
    let machine = folder.file("machine.toml", &machine);
    let program = folder.file("p.ngc", "G0 X300\nM2\n");
    let (json, printed) = validate(&machine, &program, None);
    assert_eq!(json["verdict"], "fail");
    let violations = json["violations"].as_array().unwrap();
    let of = |what: &str| {
        let found = |it: &&Value| it["what"].as_str().unwrap().starts_with(what);
        violations
            .iter()
            .find(found)
            .unwrap_or_else(|| panic!("no {what}: {json:#}"))
    };
    let (fault, following) = (of("fault: axis X"), of("following_error"));
    assert_eq!(fault["unit"], "mm");
    assert_eq!(number(fault, "/limit"), 0.005);
    let value = number(fault, "/value");
    // A cycle behind the limit it is not far beyond it.
    assert!(value > 0.005 && value < 0.01, "{fault}");
    // It arose while the axis went on, which then came to rest by itself: what was worst came no sooner.
    assert!(
        number(fault, "/time_s") <= number(following, "/time_s"),
        "{json:#}"
    );
    assert!(
        number(fault, "/time_s") < 0.002 * number(&json, "/cycles") - 0.02,
        "{json:#}"
    );
    let most = number(&json, "/axes/0/max_following_error_mm");
    assert_eq!(most, number(following, "/value"), "{json:#}");
    let times = violations.iter().map(|it| number(it, "/time_s"));
    assert!(times.is_sorted(), "{json:#}");
    assert!(printed.contains(&format!("{:.4} rms", most)), "{printed}");
}

#[test]
fn a_stop_says_where_it_was_and_what_was_left() {
    let folder = Folder::new();
    let program = folder.file("p.ngc", "G1 X50 F6000\nG1 Y50\nG1 X0\nG1 Y0\nM2\n");
    let events = folder.file("e.csv", "t_s,event,value\n0.8,stop,\n");
    let (json, printed) = validate(&folder.machine("portal"), &program, Some(&events));
    assert_eq!(json["verdict"], "interrupted", "{json:#}");
    assert_eq!(json["outcome"], "interrupted by a stop");
    assert_eq!(json["stopped"]["line"], 2, "{json:#}");
    assert!((number(&json, "/stopped/position/X") - 50.0).abs() < 1e-3);
    let y = number(&json, "/stopped/position/Y");
    assert!(y > 1.0 && y < 49.0, "{json:#}");
    let (left, done) = (
        number(&json, "/stopped/left_mm"),
        number(&json, "/path/length_mm"),
    );
    assert!((left + done - 200.0).abs() < 1e-6, "{json:#}");
    assert!(
        printed.contains("verdict            interrupted"),
        "{printed}"
    );
    assert!(
        printed.contains("stopped            in line 2 at X50.000"),
        "{printed}"
    );
    let program = folder.file("p.ngc", "G1 X5 F6000\nM2\n");
    let (json, _) = validate(&folder.machine("portal"), &program, None);
    assert_eq!(
        (&json["verdict"], &json["stopped"]),
        (&"pass".into(), &Value::Null)
    );
}

/// Behind a probing that a program waits for, nobody knows what is left.
#[test]
fn what_probings_decide_is_not_told_as_left() {
    let folder = Folder::new();
    let program = folder.file(
        "p.ngc",
        "G0 Z5\nG38.3 Z3 F600\nG1 X50 F1200\nY50\nX0\nY0\nM2\n",
    );
    let probe = folder.file("xyz.toml", &(machine_with("xyz", &[]) + PROBE));
    for (time, line) in [(0.2, 2), (2.0, 3)] {
        let events = folder.file("e.csv", &format!("t_s,event,value\n{time},stop,\n"));
        let (json, printed) = validate(&probe, &program, Some(&events));
        assert_eq!(json["stopped"]["line"], line, "{json:#}");
        assert_eq!(json["stopped"]["left_mm"], Value::Null, "{json:#}");
        assert!(!printed.contains("mm left"), "{printed}");
    }
}

/// A stop while axes are homed is in no line, and has no position of those that are not yet.
#[test]
fn a_stop_while_axes_are_homed_has_no_positions() {
    let folder = Folder::new();
    let program = folder.file("p.ngc", "G1 X50 F6000\nM2\n");
    let events = folder.file("e.csv", "t_s,event,value\n0.5,stop,\n");
    let (json, printed) = validate(&folder.machine("router"), &program, Some(&events));
    let stopped = &json["stopped"];
    assert_eq!(stopped["position"], serde_json::json!({}), "{json:#}");
    assert_eq!(
        stopped["unreferenced"].as_array().unwrap().len(),
        3,
        "{json:#}"
    );
    assert!(
        printed.contains("before the first line, without a reference of X, Y, Z"),
        "{printed}"
    );
}

/// The way to the line that a program is begun in is none of its path.
#[test]
fn what_was_left_counts_from_the_line_that_it_began_in() {
    let folder = Folder::new();
    let program = folder.file("p.ngc", "G1 X50 F6000\nG1 Y50\nG1 X0\nG1 Y0\nM2\n");
    let events = folder.file("e.csv", "t_s,event,value\n1.1,stop,\n");
    let machine = folder.machine("portal");
    let begun = |events: Option<&Path>| {
        let mut command = syncline();
        command.args(["validate", "--json", "-", "--from-line", "3"]);
        command.args(
            events
                .into_iter()
                .flat_map(|it| [Path::new("--events"), it]),
        );
        let output = command.args([&machine, &program]).output().unwrap();
        let (_, json, errors) = ended(&output);
        serde_json::from_str::<Value>(json).unwrap_or_else(|error| panic!("{error}: {errors}"))
    };
    let whole = begun(None);
    assert!(
        (number(&whole, "/path/length_mm") - 100.0).abs() < 0.01,
        "{whole:#}"
    );
    let stopped = begun(Some(&events));
    assert_eq!(stopped["stopped"]["line"], 4, "{stopped:#}");
    let [left, y] = ["/stopped/left_mm", "/stopped/position/Y"].map(|of| number(&stopped, of));
    assert!(y > 1.0 && (left - y).abs() < 0.01, "{stopped:#}");
}

/// Between jobs nothing is waited for.
#[test]
fn rest_between_jobs_is_no_wait() {
    let folder = Folder::new();
    let events = folder.file(
        "e.csv",
        "t_s,event,value\n0,mdi,G0 X20\n20,mdi,G0 X0\n25,jog_to,X10\n40,mdi,G0 X5\n",
    );
    let mut command = syncline();
    let command = command
        .args(["validate", "--json", "-", "--events"])
        .arg(&events);
    let output = command.arg(folder.machine("xyz")).output().unwrap();
    let (_, json, errors) = ended(&output);
    let json: Value =
        serde_json::from_str(json).unwrap_or_else(|error| panic!("{error}: {errors}"));
    let [idle, planning] = ["/times/idle_s", "/times/planning_s"].map(|of| number(&json, of));
    assert!(idle > 35.0 && planning < 0.1, "{json:#}");
}

/// The worst place is where the greatest error was, the blocks that are slower than their feed are those that are programmed so, and
/// the files that it was made from are told by their digests.
#[test]
fn places_and_origin_are_told() {
    let folder = Folder::new();
    // A long move has time for its feed; short ones back and forth have none.
    let program = "G61.1\nG1 X200 Y100 F6000\nG1 X201 F30000\nG1 X200\nG1 X201\nG0 X100\n\
                   G2 X100 Y100 I10 F3000\nM2\n";
    let program = folder.file("p.ngc", program);
    let machine = folder.machine("portal");
    let (json, _) = validate(&machine, &program, None);
    assert_eq!(json["verdict"], "pass", "{json:#}");
    let worst = json["worst_places"].as_array().unwrap();
    assert_eq!(
        number(&worst[0], "/contour_error_mm"),
        number(&json, "/path/max_contour_error_mm")
    );
    for key in ["time_s", "line"] {
        assert_eq!(worst[0][key], json["path"]["max_contour_error_at"][key]);
    }
    // The circle is where the tool leaves the path.
    assert_eq!(worst[0]["line"], 7, "{worst:#?}");
    let slowest = json["slowest_places"].as_array().unwrap();
    let lines: Vec<_> = slowest
        .iter()
        .map(|it| it["line"].as_u64().unwrap())
        .collect();
    assert!(
        lines[..3].iter().all(|it| (3..=5).contains(it)),
        "{lines:?}"
    );
    for place in slowest {
        let [lost, feed] = ["lost_s", "feed_s"].map(|key| place[key].as_f64().unwrap());
        assert!(lost > 0.0 && lost < feed, "{place}");
    }

    let from = &json["provenance"];
    for (key, file) in [("machine_sha256", &machine), ("program_sha256", &program)] {
        let sum = std::process::Command::new("sha256sum")
            .arg(file)
            .output()
            .unwrap();
        let (_, sum, _) = ended(&sum);
        assert_eq!(from[key].as_str(), sum.split(' ').next(), "{from:#}");
    }
    let command = from["command"].as_str().unwrap();
    assert!(
        command.contains("validate") && command.contains(program.to_str().unwrap()),
        "{command}"
    );
    assert_eq!(number(from, "/cycle_s"), 0.002);
    let date = from["date"].as_str().unwrap();
    assert!(
        date.len() == 20 && date.starts_with("20") && date.ends_with('Z'),
        "{date}"
    );
}
