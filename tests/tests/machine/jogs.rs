//! A person moves single axes while the program is held, and goes on: away from the path and back to
//! it, by the trace inside every limit.

use super::day::{go, ready_with, settle, state};
use proptest::prelude::*;
use proptest::sample::select;
use serde_json::Value;
use std::path::Path;
use syncline_controller::control::{End, Event, HOLD_TO_RUN, Hold, NotNow, Order, Request, State};
use syncline_controller::session::{
    self, Accepted, Command, Direction, Jog as SessionJog, Override, StepChange,
};
use syncline_gcode::AxisLetter;
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
    assert_eq!(code, 1);
    let refused =
        errors.matches("no jog while the machine is running: feed hold rests on the path");
    assert_eq!(refused.count(), 2, "{errors}");
    assert_eq!(json["frames_sha256"], without["frames_sha256"]);
}

#[test]
fn a_soft_limit_ends_a_long_jog_and_nothing_leads_beyond() {
    let renewed: String = (1..30)
        .map(|time| format!("{:.2},renew_jog,X\n", 2.0 + 0.13 * f64::from(time)))
        .collect();
    let events = format!(
        "1,feed_hold,\n2,jog,X+\n2,jog,Z+500\n{renewed}6,jog_to,Y1000.001\n6,jog,A+1\n7,resume,\n"
    );
    let (code, json, trace, errors) = validate(PROGRAM, &events);
    assert_eq!(
        (code, &json["verdict"]),
        (1, &Value::from("fail")),
        "{errors}{json}"
    );
    assert!(
        errors.contains(
            "not moved: Y would go to 1000.0010, and may go from 0.0000 to 1000.0000 (machine coordinates)"
        ),
        "{errors}"
    );
    assert!(
        errors.contains("not moved: the machine has no axis A"),
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
    run_for(&mut rig, 60);
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
        .filter(|it| matches!(it, Event::Held(_) | Event::Resumed));
    use Event::{Held, Resumed};
    let held = Held(Hold::Operator);
    assert!(told.eq(&[held, Resumed, held, Resumed]), "{:?}", rig.events);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

    /// That an axis has stopped at the end of its travel is told, once, and of no other stop: in a hold and without a job,
    /// of a step and of a jog that is held on.
    #[test]
    fn a_jog_that_ends_at_a_soft_limit_says_so(
        held: bool,
        on_and_on: bool,
        positive: bool,
        distance in prop_oneof![1.0..100.0f64, 200.0..2000.0f64],
    ) {
        let mut rig = ready_with(&[]);
        rig.goes_on = false;
        go(&mut rig, Command::Mdi("G0 Z-60".to_owned()));
        if held {
            rig.command(Command::Mdi("G1 X300 F6000".to_owned()));
            rig.run_until(|rig| rig.session.status().setpoint[0] > 50.0);
            go(&mut rig, Command::FeedHold);
        }
        let direction = if positive { Direction::Positive } else { Direction::Negative };
        let axis = AxisLetter::Z;
        let jog = match on_and_on {
            true => SessionJog::Continuous { axis, direction, speed: Some(50.0) },
            false => SessionJog::By { axis, distance: direction.of(distance), speed: None },
        };
        // The axis and its travel.
        let spec = rig.layout.axes.iter().position(|it| it.coordinate == axis.index());
        let spec = spec.expect("Z");
        let (min, max) = rig.layout.axes[spec].limits.position;
        let end = if positive { max } else { min };
        rig.command(Command::Jog(jog));
        let time = if on_and_on { (distance / 50.0).min(6.0) } else { 6.0 };
        for _ in 0..(time / rig.machine.cycle.as_secs_f64()) as usize / 40 {
            wait(&mut rig, 40);
            rig.command(Command::RenewJog(axis));
        }
        wait(&mut rig, 500);
        let there = rig.session.status().setpoint[axis.index()];
        let told: Vec<_> = rig.events.iter().filter(|it| matches!(it, Event::TravelEnds { .. })).collect();
        let expected = Event::TravelEnds { axis: spec, end, referenced: true };
        match there == end {
            true => prop_assert_eq!(told, [&expected]),
            false => prop_assert!(told.is_empty(), "{told:?} at {there}"),
        }
        let text = expected.describe(&*rig.layout).unwrap_or_default();
        prop_assert!(text.contains("stops at its soft limit"), "{}", text);
        if there == end {
            // Also where it stands there already.
            rig.events.clear();
            rig.command(Command::Jog(jog));
            wait(&mut rig, 500);
            let told: Vec<_> = rig.events.iter().filter(|it| matches!(it, Event::TravelEnds { .. })).collect();
            prop_assert_eq!(told, [&expected]);
        }
    }
}

/// Also an axis says so that stands there already, or beyond it by its encoder's noise.
#[test]
fn a_jog_that_has_no_way_to_go_says_so() {
    let folder = Folder::new();
    let day = folder.file("day.csv", "t_s,event,value\n,jog,Z+5\n");
    for start in ["0.0", "0.005"] {
        let mut command = syncline();
        command.arg("validate").arg(folder.machine("portal"));
        command.arg("--set").arg(format!(
            "axis.Z.simulation={{ motor = \"generic-3\", start = {start} }}"
        ));
        let output = command.arg("--events").arg(&day).output().unwrap();
        let (code, told, errors) = ended(&output);
        assert_eq!(code, 0, "{told}{errors}");
        let text = format!("{told}{errors}");
        let times = text.matches("axis Z stops at its soft limit").count();
        assert_eq!(times, 1, "{start}: {text}");
    }
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
    terminal.press(b"\x1B[C]\x1B[A");
    terminal.wait_for("held on the path");
    for step in [b"\x1B[A".as_slice(), b"\x1B[6~", b"\n"] {
        std::thread::sleep(std::time::Duration::from_millis(700));
        terminal.press(step);
    }
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

/// A jog that goes on for as long as it is renewed, at the axis' greatest speed.
fn on(axis: AxisLetter, direction: Direction) -> Command {
    Command::Jog(SessionJog::Continuous {
        axis,
        direction,
        speed: None,
    })
}

/// The same, and so many cycles further.
fn wait(rig: &mut Rig, cycles: usize) {
    (0..2 * cycles).for_each(|_| {
        rig.step();
    });
}

#[test]
fn a_jog_goes_on_for_as_long_as_it_is_renewed() {
    let mut rig = ready_with(&[]);
    rig.command(on(AxisLetter::X, Direction::Positive));
    for _ in 0..6 {
        wait(&mut rig, 75);
        assert_eq!(state(&rig), State::Jogging);
        rig.command(Command::RenewJog(AxisLetter::X));
    }
    // Released: it stops at once, and no renewal that comes late sets it in motion again.
    wait(&mut rig, 75);
    let from = rig.session.status().setpoint[0];
    rig.command(Command::EndJog(AxisLetter::X));
    settle(&mut rig);
    let there = rig.session.status().setpoint;
    let limits = rig.layout.axes[0].limits;
    let stop = limits.stopping_distance(limits.velocity);
    let cycle = limits.velocity * rig.layout.cycle.as_secs_f64();
    let gone = there[0] - from;
    assert!(
        from > 300.0 && (gone - stop).abs() < 2.0 * cycle,
        "{gone}, not {stop}"
    );
    go(&mut rig, Command::RenewJog(AxisLetter::X));
    assert_eq!(rig.session.status().setpoint, there);
    assert!(
        !(rig.events.iter()).any(|event| matches!(event, Event::JogNotRenewed { .. })),
        "{:?}",
        rig.events
    );
    // Lost: it stops after its time.
    rig.command(on(AxisLetter::X, Direction::Negative));
    settle(&mut rig);
    assert!(rig.events.contains(&Event::JogNotRenewed { axis: 0 }));
    let gone = there[0] - rig.session.status().setpoint[0];
    let most = limits.velocity * 0.2 + stop;
    assert!(gone > 0.0 && gone < most, "{gone} of {most}");
    assert_eq!(rig.refused, []);
}

/// Who takes over an axis is not kept moving by who had it before.
#[test]
fn nobody_renews_what_somebody_else_began() {
    let mut rig = ready_with(&[]);
    let [lost, other] = ["lost", "other"].map(|name| rig.session.operator(name));
    other
        .command(on(AxisLetter::X, Direction::Negative))
        .unwrap();
    wait(&mut rig, 10);
    lost.command(on(AxisLetter::X, Direction::Positive))
        .unwrap();
    for _ in 0..10 {
        wait(&mut rig, 50);
        other.command(Command::RenewJog(AxisLetter::X)).unwrap();
    }
    wait(&mut rig, 1);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert!(rig.events.contains(&Event::JogNotRenewed { axis: 0 }));
    // What it stops is its own business or not.
    lost.command(on(AxisLetter::X, Direction::Positive))
        .unwrap();
    wait(&mut rig, 10);
    other.command(Command::EndJog(AxisLetter::X)).unwrap();
    settle(&mut rig);
    let jogs = rig.events.iter();
    let jogs = jogs.filter(|event| matches!(event, Event::JogNotRenewed { .. }));
    assert_eq!(jogs.count(), 1);
}

/// What is refused takes nothing over.
#[test]
fn a_jog_that_is_refused_is_nobodys() {
    let mut rig = ready_with(&[]);
    let [keys, panel] = ["keys", "panel"].map(|name| rig.session.operator(name));
    keys.command(on(AxisLetter::X, Direction::Positive))
        .unwrap();
    wait(&mut rig, 10);
    let nowhere = Command::Jog(SessionJog::Continuous {
        axis: AxisLetter::X,
        direction: Direction::Positive,
        speed: Some(f64::NAN),
    });
    panel.command(nowhere).unwrap();
    for _ in 0..6 {
        wait(&mut rig, 75);
        assert_eq!(state(&rig), State::Jogging, "{:?}", rig.events);
        keys.command(Command::RenewJog(AxisLetter::X)).unwrap();
    }
    assert_eq!(rig.refused.len(), 1, "{:?}", rig.refused);
}

/// What two operators do who jog on and on, and nothing else that moves an axis.
fn jogging() -> impl Strategy<Value = (usize, Command)> {
    let axis = || select(&[AxisLetter::X, AxisLetter::Y, AxisLetter::Z][..]);
    let direction = select(&[Direction::Positive, Direction::Negative][..]);
    let speed = prop::option::of(1.0..1000.0);
    let jog = (axis(), direction, speed).prop_map(|(axis, direction, speed)| {
        Command::Jog(SessionJog::Continuous {
            axis,
            direction,
            speed,
        })
    });
    let command = prop_oneof![
        6 => jog,
        8 => axis().prop_map(Command::RenewJog),
        2 => axis().prop_map(Command::EndJog),
        1 => select(&[0.0, 3.0, 50.0, 100.0][..])
            .prop_map(|percent| Command::RapidOverride(Override::To(percent))),
        2 => select(vec![
            Command::FeedHold,
            Command::ToggleFeedHold,
            Command::JogStep(StepChange::Greater),
            Command::FeedOverride(Override::To(0.0)),
            Command::FeedOverride(Override::To(200.0)),
            Command::Mdi("M3 S7".to_owned()),
            Command::CycleStart,
            Command::Stop,
            Command::Disable,
            Command::Enable,
        ]),
    ];
    (0..2_usize, command)
}

/// Rows by which an axis rests at the latest, from when its time is over: it may be speeding up as it
/// begins to stop.
fn rows_to_rest(rig: &Rig, axis: usize) -> u64 {
    let limits = &rig.layout.axes[axis].limits;
    let (v, a, j) = (limits.velocity, limits.acceleration, limits.jerk);
    let cycle = rig.layout.cycle.as_secs_f64();
    ((HOLD_TO_RUN.as_secs_f64() + v / a + 2.0 * a / j) / cycle) as u64 + 3
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Whatever operators do and whoever of them is lost: no axis moves by a jog later than its time and its
    /// stop after the last command that may let it.
    #[test]
    fn no_jog_outlasts_who_holds_it(
        deeds in prop::collection::vec((jogging(), 1..160_usize), 1..24),
    ) {
        let mut rig = ready_with(&[]);
        let operators = ["one", "other"].map(|name| rig.session.operator(name));
        let told = rig.session.subscribe();
        // By axis: whose the jog is, and the last row before it was renewed.
        let mut held: [(String, u64); 3] = Default::default();
        let mut last = rig.session.status().setpoint;
        let most = [0, 1, 2].map(|axis| rows_to_rest(&rig, axis));
        let mut row = 0;
        let lost = ((0, Command::RenewJog(AxisLetter::X)), 500);
        for ((operator, command), cycles) in deeds.into_iter().chain([lost]) {
            operators[operator].command(command).unwrap();
            for _ in 0..2 * cycles {
                let rows = rig.rows.len();
                rig.step();
                for event in told.events() {
                    let session::Event::Accepted(Accepted { source, command, .. }) = event else {
                        continue;
                    };
                    match command {
                        Command::Jog(SessionJog::Continuous { axis, .. }) => {
                            held[axis.index()] = (source, row);
                        }
                        Command::RenewJog(axis) if held[axis.index()].0 == source => {
                            held[axis.index()].1 = row;
                        }
                        _ => {}
                    }
                }
                if rig.rows.len() == rows {
                    continue;
                }
                row += 1;
                let now = rig.rows[rows].plan.position;
                for axis in 0..3 {
                    let rests = (now[axis] - last[axis]).abs() < 1e-9;
                    // Where the drives were disabled meanwhile it stands a little beside.
                    let enabled = rig.rows[rows].plan.velocity[axis] != 0.0;
                    prop_assert!(
                        rests || !enabled || row <= held[axis].1 + most[axis],
                        "axis {} in row {}, held until {}", axis, row, held[axis].1
                    );
                }
                last = now;
            }
        }
        rig.trace().assert_within_limits();
    }
}
