//! A working day by a file of events: a machine that stays on in virtual time.

use proptest::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};
use syncline_tests::command::{Folder, ended, machine_file, machine_with, root, syncline};

/// What `validate` makes of a day: its exit code, JSON and what it told.
pub(super) struct Day {
    folder: Folder,
    pub(super) code: i32,
    pub(super) json: Value,
    pub(super) told: String,
}

impl Day {
    fn play(machine: &Path, events: &Path, more: &[&str]) -> Self {
        let folder = Folder::new();
        let output = syncline()
            .args(["validate", "--json", "-", "--events"])
            .args([events, machine])
            .args([Path::new("--commands"), &folder.path("commands")])
            .args([Path::new("--candump"), &folder.path("log")])
            .args(more)
            .output()
            .unwrap();
        let (code, json, told) = ended(&output);
        Self {
            code,
            json: serde_json::from_str(json).unwrap_or_else(|_| panic!("{told}{json}")),
            told: told.to_owned(),
            folder,
        }
    }

    pub(super) fn of(machine: &Path, events: &str, more: &[&str]) -> Self {
        let folder = Folder::new();
        let events = folder.file("day.csv", &format!("t_s,event,value\n{events}"));
        Self::play(machine, &events, more)
    }

    fn number(&self, pointer: &str) -> f64 {
        let number = self.json.pointer(pointer).and_then(Value::as_f64);
        number.unwrap_or_else(|| panic!("no number {pointer} in {:#}", self.json))
    }

    /// What must not be and begins so.
    fn violations(&self, begins: &str) -> Vec<&str> {
        let found = self.json["violations"].as_array().expect("a list").iter();
        let found = found.map(|it| it["what"].as_str().expect("a text"));
        found.filter(|it| it.starts_with(begins)).collect()
    }

    pub(super) fn frames(&self) -> &str {
        self.json["frames_sha256"].as_str().unwrap()
    }

    /// Exit code and output of its replay.
    pub(super) fn replay(&self, machine: &Path) -> (i32, String) {
        let output = syncline()
            .args([Path::new("replay"), &self.folder.path("log"), machine])
            .args([Path::new("--commands"), &self.folder.path("commands")])
            .output()
            .unwrap();
        let (code, text, errors) = ended(&output);
        (code, format!("{text}{errors}"))
    }

    /// What was told, each once and in this order.
    fn assert_told(&self, texts: &[&str]) {
        let mut rest = &*self.told;
        for text in texts {
            let Some((_, behind)) = rest.split_once(text) else {
                panic!("no {text:?} behind what was before, in\n{}", self.told);
            };
            rest = behind;
        }
    }
}

/// Also before the first cycle of its own says so.
#[test]
fn where_the_axes_stand_is_known_as_the_machine_gets_ready() {
    let folder = Folder::new();
    let limits = "soft_limits = [-250.0, 250.0]\n";
    let start = format!("{limits}simulation = {{ start = 7.0 }}\n");
    let machine = folder.file("machine.toml", &machine_with("xyz", &[(limits, &start)]));
    let day = Day::of(&machine, ",jog,X+1\n", &[]);
    let (_, first) = day.told.split_once("ready: work ").expect("it gets ready");
    let first = first.lines().next().unwrap_or_default();
    assert!(first.contains("X7.000"), "{first}");
}

/// However late the last event comes, the machine is not switched off before that is done.
#[test]
fn the_last_event_is_done_whenever_it_is_due() {
    for time in ["", "0.3", "1.4", "5.0"] {
        let day = Day::of(&machine_file("xyz"), &format!("{time},mdi,G0 X10\n"), &[]);
        assert!(day.number("/times/motion_s") > 0.05, "{time}: {}", day.told);
        assert_eq!(day.code, 0);
    }
}

/// Of outputs the JSON has what is at their terminals: the clamp is safe where it is on, and a hand switches both.
#[test]
fn outputs_are_told_as_they_are_at_their_terminals() {
    let events = ",output,flood on\n,output,clamp off\n,output,flood off\n,mdi,G4 P0.1\n";
    let day = Day::of(&machine_file("mill"), events, &[]);
    assert_eq!(day.code, 0, "{}", day.told);
    let states = day.json["switched"].as_array().expect("states");
    let mut states: Vec<_> = states
        .iter()
        .map(|it| (it["coolant"].as_u64(), it["digital_outputs"].to_string()))
        .collect();
    states.dedup();
    let there = |coolant, on: &str| (Some(coolant), on.to_owned());
    let wanted = [
        there(0, "[1]"),
        there(2, "[1]"),
        there(2, "[]"),
        there(0, "[]"),
    ];
    assert_eq!(states[..4], wanted, "{states:?}");
}

/// A program that begins by switching on what is safe on, and is on, never has it off, and nobody is told so.
#[test]
fn no_state_is_told_that_never_was() {
    let folder = Folder::new();
    let part = folder.file("part.ngc", "G21 G90\nM64 P1\nM8\nG1 X5 F1500\nM9\nM2\n");
    let events = format!(",load,{}\n,run,\n", part.display());
    let day = Day::of(&machine_file("mill"), &events, &[]);
    assert_eq!(day.code, 0, "{}", day.told);
    let states = day.json["switched"].as_array().expect("states");
    assert!(states.iter().any(|it| it["coolant"] == 2), "{states:?}");
    let on = |it: &Value| it["digital_outputs"][0] == 1;
    assert!(states.iter().all(on), "{states:?}");
    assert!(!day.told.contains("output \"clamp\" off"), "{}", day.told);
}

/// What a program begins with was told as it was begun: no hand switches it while that is held before its first block.
#[test]
fn a_program_that_is_held_before_its_first_block_keeps_the_outputs_that_it_began_with() {
    let folder = Folder::new();
    let part = "G21 G90 G61\nM64 P1\nM8\nG1 X5 F1500\nG1 X10\nG1 X20\nG1 X0\nM2\n";
    let part = folder.file("part.ngc", part);
    for run in ["run,6", "run,"] {
        let events = format!(
            "0.5,load,{}\n1.0,{run}\n1.0,feed_hold,\n,output,clamp off\n,resume,\n,cycle_start,\n",
            part.display()
        );
        let day = Day::of(&machine_file("mill"), &events, &[]);
        day.assert_told(&["refused: the program is still to begin", "going on"]);
        let states = day.json["switched"].as_array().expect("states");
        let cuts = states
            .iter()
            .any(|it| it["coolant"] == 2 && it["digital_outputs"][0] == 1);
        assert!(cuts, "{run}: {states:?}");
    }
}

/// Stops that fall together are one: whoever gave the other waits for no answer to it.
#[test]
fn stops_that_fall_together_hold_up_nothing() {
    for stops in [
        "0.01,stop,",
        "0.01,stop,\n0.01,stop,\n0.01,switch_off,\n0.01,switch_off,",
    ] {
        let events = format!(",jog,X+5\n,stop,\n{stops}\n,jog,X-2\n,mdi,G91 G0 Y1\n");
        let day = Day::of(&machine_file("xyz"), &events, &[]);
        assert_eq!(day.code, 0, "{}", day.told);
        assert_eq!(day.json["outcome"], "switched off");
    }
}

#[test]
fn the_day_of_the_example() {
    let machine = machine_file("router");
    let events = root().join("examples/router/day.csv");
    let day = Day::play(&machine, &events, &[]);
    assert_eq!(day.code, 0, "{}", day.told);
    assert_eq!(day.json["verdict"], "pass");
    assert_eq!(day.json["outcome"], "switched off");
    day.assert_told(&[
        "ready (unreferenced)",
        "homing",
        "axis X is homed",
        "jogging",
        "ready: work X",
        "MDI",
        "touched off",
        "running",
        "14.092 s  feed hold",
        "held",
        "running",
        "disabled",
        "starting",
        "ready: work X",
        "MDI",
        "running",
        "ready: work X",
        "off",
    ]);
    assert!(day.number("/times/jogging_s") > 9.0, "{:#}", day.json);
    let again = Day::play(&machine, &events, &[]);
    assert_eq!(again.frames(), day.frames());
    let other = Day::play(&machine, &events, &["--seed", "7"]);
    assert_ne!(other.frames(), day.frames());
    let (code, text) = day.replay(&machine);
    assert_eq!(code, 0, "{text}");
}

#[test]
fn paths_of_all_jobs_add_up() {
    let machine = machine_file("portal");
    let folder = Folder::new();
    let square = "G1 X40 F6000\nY30\nG0 X0 Y0\nM2\n";
    let square = folder.file("square.ngc", square);
    let length = |more: &str| {
        let events = format!(
            ",load,{}\n,mdi,G0 X0 Y0 Z0\n,run,\n{more}",
            square.display()
        );
        let day = Day::of(&machine, &events, &[]);
        assert_eq!(day.code, 0, "{}", day.told);
        day.number("/path/length_mm")
    };
    // Out, up and back across, but for what ends within a job's last cycle; what is retraced comes off and on again.
    let more = length(",mdi,G1 Z-5 F1200\n,run,\n") - length("");
    assert!((more - 125.0).abs() < 0.01, "{more}");
    let held = length(",run,\n2.8,feed_hold,\n,retrace,\n,resume,\n") - length("");
    assert!((held - 120.0).abs() < 0.01, "{held}");
}

#[test]
fn behind_a_fault_the_day_goes_on_and_fails() {
    let machine = machine_file("portal");
    let day = Day::of(
        &machine,
        ",mdi,G0 X30\n,mdi,G0 X0\n,reset,\n,mdi,G0 Y5\n",
        &["--set", "axis.X.following_error_limit=0.001"],
    );
    assert_eq!(day.code, 1, "{}", day.told);
    assert_eq!(day.json["verdict"], "fail");
    let outcome = day.json["outcome"].as_str().unwrap();
    assert!(
        outcome.starts_with("switched off, after a fault: ") && outcome.contains("8611h"),
        "{outcome}"
    );
    // What cannot begin in a fault is told.
    day.assert_told(&[
        "MDI",
        "stopped by a fault",
        "refused: ",
        "ready",
        "MDI",
        "ready",
        "off",
    ]);
}

/// Two stops for one reason are two violations, each where it was.
#[test]
fn each_fault_of_a_day_is_a_violation() {
    let machine = machine_file("portal");
    let events = ",mdi,G0 X30\n,reset,\n,mdi,G0 X60\n,reset,\n,mdi,G0 Y5\n";
    let day = Day::of(
        &machine,
        events,
        &["--set", "axis.X.following_error_limit=0.001"],
    );
    let faults = day.violations("fault: ");
    assert!(
        faults.len() == 2 && faults.iter().all(|it| it.contains("8611h")),
        "{faults:?}"
    );
    let times = day.json["violations"].as_array().unwrap().iter();
    let mut times = times
        .filter(|it| it["what"].as_str().unwrap().starts_with("fault: "))
        .map(|it| it["time_s"].as_f64().unwrap());
    let (first, second) = (times.next().unwrap(), times.next().unwrap());
    assert!(first > 0.0 && second > first + 0.01, "{first} {second}");
}

/// A machine that refuses or fails is inside its limits; the file's wishes did not come about.
#[test]
fn a_day_on_which_something_did_not_come_about_fails() {
    let folder = Folder::new();
    let bad = folder.file("bad.ngc", "G0 X1\nG1 Y1\nM2\n");
    let bad = format!(",load,{}\n,run,\n", bad.display());
    let held = folder.file("held.ngc", "G1 X20 F1200\nX0\nM2\n");
    let aside = format!(
        ",load,{}\n,run,\n0.8,feed_hold,\n,mdi,G0 Z-1\n",
        held.display()
    );
    for (machine, events, what) in [
        ("portal", ",run,\n", "refused: no program is loaded"),
        (
            "router",
            ",home,\n0.3,feed_hold,\n",
            "failed: axis Z is not homed: a feed hold ended it",
        ),
        ("portal", &bad, "failed: "),
        (
            "portal",
            ",mdi,G1 X40 F1200\n0.8,feed_hold,\n",
            "not ended: held behind the last event",
        ),
        ("portal", &aside, "not ended: held behind the last event"),
    ] {
        let day = Day::of(&machine_file(machine), events, &[]);
        let found = day.violations("");
        assert!(
            found.len() == 1 && found[0].starts_with(what),
            "{what}: {found:?} {}",
            day.told
        );
        assert_eq!(day.json["verdict"], "fail", "{what}");
        assert_eq!(day.code, 1, "{what}");
    }
    // What the file stops, and what it takes up again, ends as it says.
    for end in ["1.5,stop,\n", ",resume,\n,cycle_start,\n", ",stop,\n"] {
        let day = Day::of(&machine_file("portal"), &format!("{aside}{end}"), &[]);
        assert_eq!(
            (day.code, day.violations("").len()),
            (0, 0),
            "{end}: {}",
            day.told
        );
    }
}

#[test]
fn what_is_left_and_what_is_held_is_told() {
    let machine = machine_file("portal");
    let day = Day::of(&machine, ",run,\n,mdi,G1 X40 F1200\n0.8,feed_hold,\n", &[]);
    day.assert_told(&[
        "refused: no program is loaded",
        "held",
        "the events end while a job is held: stopped",
        "off",
    ]);
    let day = Day::of(&machine, ",switch_off,\n9,home,\n", &[]);
    day.assert_told(&["off", "1 event from 9 s on never comes"]);
}

#[test]
fn what_is_of_a_program_needs_one() {
    let machine = machine_file("portal");
    let folder = Folder::new();
    let events = folder.file("day.csv", "t_s,event,value\n,home,\n");
    for option in ["--report", "--from-line", "--stream", "--time-bounds"] {
        let mut command = syncline();
        command
            .args(["validate", "--events"])
            .args([&events, &machine]);
        command.arg(option);
        match option {
            "--report" => command.arg(folder.path("r.html")),
            "--from-line" => command.arg("3"),
            _ => &mut command,
        };
        let output = command.output().unwrap();
        let (code, _, errors) = ended(&output);
        assert!(
            code == 2 && errors.contains("<PROGRAM>"),
            "{code}: {errors}"
        );
    }
    // In a program's events nothing waits for rest.
    let program = folder.file("p.ngc", "G0 X1\nM2\n");
    let output = syncline()
        .args(["validate", "--events"])
        .args([&events, &machine, &program])
        .output()
        .unwrap();
    let (code, _, errors) = ended(&output);
    assert!(
        code == 2 && errors.contains(":2:1: `` is no time"),
        "{errors}"
    );
}

#[test]
fn no_program_that_is_loaded_is_written_over() {
    let folder = Folder::new();
    let program = folder.file("part.ngc", "G0 X1\nM2\n");
    let events = format!("t_s,event,value\n,load,{}\n,run,\n", program.display());
    let events = folder.file("day.csv", &events);
    for option in ["--trace", "--json", "--candump", "--commands"] {
        let output = syncline()
            .args(["validate", "--events"])
            .args([&events, &machine_file("portal")])
            .args([Path::new(option), &program])
            .output()
            .unwrap();
        let (code, _, errors) = ended(&output);
        assert!(code == 2 && errors.contains("part.ngc"), "{errors}");
        assert_eq!(folder.read("part.ngc"), "G0 X1\nM2\n");
    }
}

/// Whatever an operator may do on a portal, sensible or not.
fn deed(program: PathBuf) -> impl Strategy<Value = String> {
    let program = program.display().to_string();
    prop_oneof![
        Just("home,".to_owned()),
        Just("mdi,G1 X20 Y10 F6000".to_owned()),
        Just("mdi,G0 Z-5\\;G4 P0.2".replace('\\', "")),
        Just("mdi,M0".to_owned()),
        Just("mdi,G1 X1e".to_owned()),
        Just(format!("load,{program}")),
        Just("load,nothing.ngc".to_owned()),
        Just("run,".to_owned()),
        Just("run,2".to_owned()),
        Just("feed_hold,".to_owned()),
        Just("resume,".to_owned()),
        Just("cycle_start,".to_owned()),
        Just("retrace,".to_owned()),
        Just("jog,X+3".to_owned()),
        Just("jog,Y- F600".to_owned()),
        Just("go_to,X5 Y5".to_owned()),
        Just("set_offset,X0 Y0".to_owned()),
        Just("single_block,on".to_owned()),
        Just("single_block,off".to_owned()),
        Just("feed_override,0".to_owned()),
        Just("feed_override,150".to_owned()),
        Just("rapid_override,0".to_owned()),
        Just("rapid_override,100".to_owned()),
        Just("stop,".to_owned()),
        Just("enable,".to_owned()),
        Just("disable,".to_owned()),
        Just("reset,".to_owned()),
        Just("switch_off,".to_owned()),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, failure_persistence: None, ..ProptestConfig::default() })]

    /// A day of any deeds comes to its end, inside the limits whatever is refused, and is replayed bit for bit.
    #[test]
    fn any_day_ends(seed in 0..100_u32, deeds in {
        let program = root().join("examples/portal/corners.ngc");
        prop::collection::vec((prop::option::of(0.0..0.7_f64), deed(program)), 1..10)
    }) {
        let machine = machine_file("portal");
        let (mut at, mut events) = (0.0, String::new());
        for (apart, deed) in deeds {
            match apart {
                Some(apart) => {
                    at += apart;
                    events += &format!("{at:.3},{deed}\n");
                }
                None => events += &format!(",{deed}\n"),
            }
        }
        let day = Day::of(&machine, &events, &["--seed", &seed.to_string()]);
        // What the machine did is right, also where it refused or could not do what these ask for.
        let found = day.violations("");
        let unmet = |it: &&str| ["refused: ", "failed: ", "not ended: "].iter().any(|of| it.starts_with(of));
        prop_assert!(found.iter().all(unmet), "{}\n{}{:#}", events, day.told, day.json);
        prop_assert_eq!(day.code, i32::from(!found.is_empty()));
        let (code, text) = day.replay(&machine);
        prop_assert_eq!(code, 0, "{}\n{}", events, text);
    }
}
