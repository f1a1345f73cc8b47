//! A person moves single axes while the program is held, and goes on: away from the path and back to
//! it, by the trace inside every limit.

use serde_json::Value;
use std::path::Path;
use syncline_controller::control::{End, Event, NotNow, Order, Request, State};
use syncline_tests::command::{Folder, ended, syncline};
use syncline_tests::rig::{Rig, example};
use syncline_tests::terminal::Terminal;
use syncline_tests::trace::Trace;
use syncline_trajectory::path::Jog;

/// A line into a half circle and a line out of it, at 100 mm/s.
const PROGRAM: &str = "\
G17 G21 G90 G94 G61 F6000
G1 X300 Y100
G3 X300 Y300 J100
G1 X0
M2
";

/// What `validate` says to a program with events: exit code, summary, trace, messages.
pub(super) fn validate(program: &str, events: &str) -> (i32, Value, Trace, String) {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = folder.file("p.ngc", program);
    let events = folder.file("events.csv", &format!("t_s,event,value\n{events}"));
    let trace = folder.path("trace.csv");
    let output = syncline()
        .args(["validate", "--json", "-", "--events"])
        .args([&events, Path::new("--trace"), &trace, &machine, &program])
        .output()
        .unwrap();
    let (code, json, errors) = ended(&output);
    let json = serde_json::from_str(json).unwrap_or_else(|_| panic!("{json}{errors}"));
    let trace = Trace::read(&example("portal"), &folder.read("trace.csv"));
    (code, json, trace, errors.to_owned())
}

fn number(json: &Value, pointer: &str) -> f64 {
    json.pointer(pointer).and_then(Value::as_f64).unwrap()
}

/// The drives begin where an increment is.
fn near(one: [f64; 3], other: [f64; 3]) -> bool {
    let mut apart = one.iter().zip(other).map(|(a, b)| (a - b).abs());
    apart.all(|apart| apart < 2e-3)
}

#[test]
fn hold_jog_and_resume_by_events() {
    let (_, without, untouched, _) = validate(PROGRAM, "");
    let events = "\
4,feed_hold,
5,jog,Z-30
5.1,jog,X+ F3000
5.15,jog,X- F12000
5.6,feed_hold,
6.5,jog,Y+40
6.52,jog,Y-10
7.5,move_to,X500 Y50 Z-100
7.7,jog_to,X450 Z-60
9.5,resume,
";
    let (code, json, trace, errors) = validate(PROGRAM, events);
    assert_eq!((code, errors.as_str()), (0, ""), "{json}");
    assert_eq!(json["verdict"], "pass");
    trace.assert_within_limits();
    assert!(number(&json, "/path/max_deviation_mm") <= 0.001, "{json}");
    // Planned anew from the hold on, it may be another one by a rounding.
    let length = |json: &Value| number(json, "/path/length_mm");
    assert!((length(&json) - length(&without)).abs() < 1e-6, "{json}");
    let set = |trace: &Trace, row: usize| ["X", "Y", "Z"].map(|name| trace.axis(name).set[row]);
    // By the row: held, looked at, back where it was, and the same end.
    let row = |seconds: f64| (seconds / trace.cycle) as usize;
    let held = set(&trace, row(4.9));
    assert!((held[0] - 350.0).hypot(held[1] - 200.0) > 1.0, "{held:?}");
    let there = set(&trace, row(7.4));
    assert!(
        near(there, [there[0], held[1] + 30.0, held[2] - 30.0]),
        "{there:?}"
    );
    let there = set(&trace, row(9.4));
    assert!(near(there, [450.0, there[1], -60.0]), "{there:?}");
    let back = (row(9.5)..row(12.0)).find(|&row| set(&trace, row) == held);
    assert!(back.is_some(), "met again");
    let last = |trace: &Trace| set(trace, trace.line.len() - 1);
    let ends = last(&trace).into_iter().zip(last(&untouched));
    assert!(
        ends.into_iter()
            .all(|(end, other)| (end - other).abs() < 1e-9)
    );
    // The same again gives the same frames.
    assert_eq!(
        json["frames_sha256"],
        validate(PROGRAM, events).1["frames_sha256"]
    );
}

#[test]
fn a_jog_while_the_machine_moves_is_refused_and_changes_nothing() {
    let (_, without, ..) = validate(PROGRAM, "");
    let (code, json, _, errors) = validate(PROGRAM, "2,jog,Z-30\n3,move_to,X5\n");
    assert_eq!(code, 0);
    let refused =
        errors.matches("no jog while the machine is running: feed hold rests on the path");
    assert_eq!(refused.count(), 2, "{errors}");
    assert_eq!(json["frames_sha256"], without["frames_sha256"]);
}

#[test]
fn a_soft_limit_ends_a_long_jog_and_nothing_leads_beyond() {
    let events = "1,feed_hold,\n2,jog,X+\n2,jog,Z+500\n6,jog_to,Y1000.001\n6,jog,A+1\n7,resume,\n";
    let (code, json, trace, errors) = validate(PROGRAM, events);
    assert_eq!(
        (code, &json["verdict"]),
        (0, &Value::from("pass")),
        "{errors}{json}"
    );
    assert!(
        errors.contains("no jog: the position is outside of the soft limits of Y"),
        "{errors}"
    );
    assert!(
        errors.contains("no jog: the machine has no axis A"),
        "{errors}"
    );
    trace.assert_within_limits();
    let most = |name: &str| {
        trace
            .axis(name)
            .set
            .iter()
            .copied()
            .fold(f64::MIN, f64::max)
    };
    assert_eq!((most("X"), most("Z")), (1500.0, 0.0));
}

fn run_for(rig: &mut Rig, rows: usize) {
    let until = rig.rows.len() + rows;
    rig.run_until(|rig| rig.rows.len() >= until);
}

fn held_rig() -> Rig {
    let mut rig = Rig::portal(PROGRAM);
    rig.run_to_row(1500);
    rig.controller().obey(Order::FeedHold).unwrap();
    run_for(&mut rig, 300);
    rig
}

const UP: Jog<9> = Jog::Continuous {
    axis: 2,
    velocity: -100.0,
};

#[test]
fn the_end_is_orderly_in_mid_jog_too() {
    let mut rig = held_rig();
    rig.controller().obey(Order::Jog(UP)).unwrap();
    run_for(&mut rig, 50);
    rig.controller().interrupt();
    assert_eq!(rig.finish(), End::Interrupted);
    assert!(rig.ends_at_rest());
    rig.trace().assert_within_limits();
    assert!(rig.rows.last().unwrap().plan.off_path);
    let (request, state) = (Request::Jog, State::Off);
    let refused = NotNow { request, state }.into();
    assert_eq!(rig.controller().obey(Order::Jog(UP)), Err(refused));
}

#[test]
fn a_jog_is_told_as_a_hold_that_lasts() {
    let mut rig = held_rig();
    rig.controller().obey(Order::Jog(UP)).unwrap();
    run_for(&mut rig, 100);
    assert!(!rig.events.contains(&Event::Resumed), "{:?}", rig.events);
    // Space, and in mid-return once more.
    rig.controller().obey(Order::ToggleFeedHold).unwrap();
    run_for(&mut rig, 10);
    rig.controller().obey(Order::ToggleFeedHold).unwrap();
    run_for(&mut rig, 300);
    let plan = rig.rows.last().unwrap().plan;
    assert!(plan.off_path && plan.velocity == [0.0; 9], "{plan:?}");
    rig.controller().obey(Order::ToggleFeedHold).unwrap();
    assert_eq!(rig.finish(), End::Finished);
    rig.trace().assert_within_limits();
    let told = rig
        .events
        .iter()
        .filter(|it| matches!(it, Event::Held | Event::Resumed));
    use Event::{Held, Resumed};
    assert!(told.eq(&[Held, Resumed, Held, Resumed]), "{:?}", rig.events);
}

/// Keys on a terminal: in a hold, and at a program stop.
#[test]
fn arrows_and_page_keys() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = folder.file("p.ngc", "G0 X20\nM0\nG1 X60 F6000\nM2\n");
    let trace = folder.path("trace.csv");
    let run = syncline();
    let line = format!(
        "{} run {} {} --trace {} 2>&1 | cat",
        run.get_program().display(),
        machine.display(),
        program.display(),
        trace.display()
    );
    let mut terminal = Terminal::run(&line);
    terminal.wait_for("press Enter");
    // X + 1, then Y + 10 twice, Z - 10; then it goes back by itself.
    terminal.press(b"\x1B[C]\x1B[A\x1B[A\x1B[6~");
    terminal.wait_for("held on the path");
    std::thread::sleep(std::time::Duration::from_millis(700));
    terminal.press(b"\n");
    terminal.wait_for("program finished");
    let _ = terminal.end();
    let trace = Trace::read(&example("portal"), &folder.read("trace.csv"));
    trace.assert_within_limits();
    let set = |row: usize| ["X", "Y", "Z"].map(|name| trace.axis(name).set[row]);
    let rows = 0..trace.line.len();
    let seen = |at: [f64; 3]| rows.clone().position(|row| near(set(row), at));
    let (away, on) = (seen([21.0, 20.0, -10.0]), seen([60.0, 0.0, 0.0]));
    assert!(away.is_some() && away < on, "{away:?} {on:?}");
    let back = (away.unwrap()..on.unwrap()).find(|row| near(set(*row), [20.0, 0.0, 0.0]));
    assert!(back.is_some());
}
