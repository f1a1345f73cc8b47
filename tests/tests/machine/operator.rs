//! What a person does while a program runs: overrides, feed hold, single block, retrace. The
//! path stays the programmed one and every axis inside its limits, by the trace.

use std::path::Path;
use std::thread::sleep;
use std::time::Duration;
use syncline_controller::control::{End, Event, Hold, Order};
use syncline_controller::session::Command;
use syncline_tests::command::{Folder, ended, syncline};
use syncline_tests::rig::{Rig, example};
use syncline_tests::terminal::Terminal;
use syncline_tests::trace::Trace;

/// Lines, arcs and a helix at 100 mm/s.
const PROGRAM: &str = "\
G17 G21 G90 G94 G61 F6000
G0 X100 Y100 Z-50
G1 X300
G3 X400 Y200 J100
G3 X400 Y200 I-50 Z-60
G1 Y350
X350 Y400
X100
M2
";

/// Where the blocks of [`PROGRAM`] end.
const POINTS: [[f64; 3]; 7] = [
    [100.0, 100.0, -50.0],
    [300.0, 100.0, -50.0],
    [400.0, 200.0, -50.0],
    [400.0, 200.0, -60.0],
    [400.0, 350.0, -60.0],
    [350.0, 400.0, -60.0],
    [100.0, 400.0, -60.0],
];

/// How far a position is from the programmed path, mm, by plain geometry.
fn off_the_path(at: &[f64]) -> f64 {
    let apart = |to: [f64; 3]| (0..3).map(|i| (at[i] - to[i]).powi(2)).sum::<f64>().sqrt();
    let line = |from: [f64; 3], to: [f64; 3]| {
        let way: f64 = (0..3).map(|i| (to[i] - from[i]).powi(2)).sum();
        let along: f64 = (0..3).map(|i| (at[i] - from[i]) * (to[i] - from[i])).sum();
        let part = (along / way).clamp(0.0, 1.0);
        apart(std::array::from_fn(|i| from[i] + part * (to[i] - from[i])))
    };
    let lines = [
        ([0.0; 3], POINTS[0]),
        (POINTS[0], POINTS[1]),
        (POINTS[3], POINTS[4]),
        (POINTS[4], POINTS[5]),
        (POINTS[5], POINTS[6]),
    ];
    let lines = lines.into_iter().map(|(from, to)| line(from, to));
    let around = |x: f64, y: f64, radius: f64| ((at[0] - x).hypot(at[1] - y) - radius).abs();
    let quarter = if at[0] >= 300.0 && at[1] <= 200.0 {
        around(300.0, 200.0, 100.0).hypot(at[2] + 50.0)
    } else {
        f64::INFINITY
    };
    // The helix: its height follows the angle.
    let angle = (at[1] - 200.0)
        .atan2(at[0] - 350.0)
        .rem_euclid(std::f64::consts::TAU);
    let height = |turn: f64| -50.0 - 10.0 * turn / std::f64::consts::TAU;
    let rise = (at[2] - height(angle)).abs();
    let rise = rise.min((at[2] - height(angle + std::f64::consts::TAU)).abs());
    let helix = around(350.0, 200.0, 50.0).hypot(rise);
    lines.fold(quarter.min(helix), f64::min)
}

fn position(rig: &Rig) -> [f64; 3] {
    let plan = rig.rows.last().unwrap().plan;
    [plan.position[0], plan.position[1], plan.position[2]]
}

fn speed(rig: &Rig) -> f64 {
    rig.rows.last().unwrap().plan.speed
}

/// Goes on until the plan is that far along the path, mm.
fn run_to(rig: &mut Rig, distance: f64) {
    rig.run_until(|rig| {
        rig.rows
            .last()
            .is_some_and(|row| row.plan.distance >= distance)
    });
}

/// Goes on for so many cycles.
fn rows(rig: &mut Rig, count: usize) {
    let until = rig.rows.len() + count;
    rig.run_until(|rig| rig.rows.len() >= until);
}

/// At rest at a programmed point, or where the rounding of its corner begins or ends.
fn assert_at(rig: &Rig, point: [f64; 3]) {
    let at = position(rig);
    let off = (0..3).map(|i| (at[i] - point[i]).abs()).fold(0.0, f64::max);
    assert!(off < 2.5, "{at:?} instead of {point:?}");
    assert_eq!(speed(rig), 0.0);
}

/// Ends the run and checks all of it.
fn assert_ends_well(mut rig: Rig) {
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    rig.trace().assert_within_limits();
    for (index, row) in rig.rows.iter().enumerate() {
        let off = off_the_path(&row.plan.position);
        assert!(off <= 0.001, "row {index}: {off} mm off, {:?}", row.plan);
    }
    let end = rig.rows.last().unwrap().plan.position;
    assert!(
        (0..3).all(|i| (end[i] - POINTS[6][i]).abs() < 1e-6),
        "{end:?}"
    );
}

/// Path distance at which a block ends; the first one begins in X0 Y0 Z0.
const FIRST: f64 = 150.0;

#[test]
fn a_hold_in_a_curve() {
    let mut rig = Rig::portal(PROGRAM);
    run_to(&mut rig, FIRST + 200.0 + 80.0);
    let before = speed(&rig);
    assert!((before - 100.0).abs() < 0.1, "{before}");
    rig.controller().obey(Order::FeedHold).unwrap();
    // The effect starts within 10 ms.
    rows(&mut rig, 5);
    assert!(speed(&rig) < before, "{}", speed(&rig));
    rows(&mut rig, 500);
    let held = position(&rig);
    assert_eq!(speed(&rig), 0.0);
    rows(&mut rig, 100);
    assert_eq!(position(&rig), held);
    rig.controller().obey(Order::Resume).unwrap();
    rows(&mut rig, 500);
    assert!(speed(&rig) > 0.0);
    assert_ends_well(rig);
}

/// The planner answers both, also once the program is given up.
#[test]
fn a_stop_for_good_is_as_short_as_a_hold() {
    let rounded = PROGRAM.replace("G61", "G64 P0.5");
    for distance in [345.0, 355.0, 430.0, 560.0, 1025.0, 1040.0] {
        let [held, stopped] = [Order::FeedHold, Order::Interrupt].map(|order| {
            let mut rig = Rig::portal(&rounded);
            run_to(&mut rig, distance);
            rig.controller().obey(order).unwrap();
            let from = rig.rows.len();
            let rests = |rig: &Rig| rig.rows.last().is_some_and(|row| row.plan.speed == 0.0);
            rig.run_until(|rig| rig.rows.len() > from && rests(rig));
            rig.rows.last().unwrap().plan.distance
        });
        assert_eq!(held, stopped, "from {distance}");
        assert!(held > distance);
    }
}

#[test]
fn overrides_to_half_double_and_nothing() {
    let mut rig = Rig::portal(PROGRAM);
    run_to(&mut rig, FIRST + 20.0);
    for (part, distance) in [
        (0.5, FIRST + 60.0),
        (2.0, FIRST + 150.0),
        (1.0, FIRST + 190.0),
    ] {
        rig.controller().obey(Order::FeedOverride(part)).unwrap();
        run_to(&mut rig, distance);
        assert!(
            (speed(&rig) - 100.0 * part).abs() < 0.1,
            "{part}: {}",
            speed(&rig)
        );
    }
    rig.controller().obey(Order::FeedOverride(0.0)).unwrap();
    rows(&mut rig, 500);
    let held = position(&rig);
    assert_eq!(speed(&rig), 0.0);
    rows(&mut rig, 100);
    assert_eq!(position(&rig), held);
    rig.controller().obey(Order::FeedOverride(1.5)).unwrap();
    assert_ends_well(rig);
}

#[test]
fn a_rapid_override_is_for_rapids() {
    let fastest = |override_: Option<f64>| {
        let mut rig = Rig::portal("G61 G0 X800\nG1 X600 F6000\nM2\n");
        rig.run_until(|rig| !rig.rows.is_empty());
        if let Some(part) = override_ {
            rig.controller().obey(Order::RapidOverride(part)).unwrap();
        }
        rig.finish();
        rig.trace().assert_within_limits();
        let of = |rapid: bool| {
            let rows = rig
                .rows
                .iter()
                .filter(|row| row.plan.velocity[0].is_sign_positive() == rapid);
            rows.map(|row| row.plan.speed).fold(0.0, f64::max)
        };
        [of(true), of(false)]
    };
    let [whole, feed] = fastest(None);
    assert!(
        (whole - 700.0).abs() < 1e-3 && (feed - 100.0).abs() < 1e-3,
        "{whole} {feed}"
    );
    let [quarter, feed] = fastest(Some(0.25));
    assert!(
        (quarter - 175.0).abs() < 1.0 && (feed - 100.0).abs() < 1e-3,
        "{quarter} {feed}"
    );
}

#[test]
fn a_stop_after_the_block_and_on() {
    let mut rig = Rig::portal(PROGRAM);
    run_to(&mut rig, FIRST + 100.0);
    for point in [1, 2, 3] {
        rig.controller().obey(Order::SingleBlock(true)).unwrap();
        rows(&mut rig, 2500);
        assert_at(&rig, POINTS[point]);
        rig.controller().obey(Order::SingleBlock(false)).unwrap();
        rig.controller().obey(Order::Resume).unwrap();
        rows(&mut rig, 50);
        assert!(speed(&rig) > 0.0);
    }
    assert_ends_well(rig);
}

#[test]
fn single_block_rests_at_the_end_of_every_block() {
    let mut rig = Rig::portal(PROGRAM);
    rig.controller().obey(Order::SingleBlock(true)).unwrap();
    for point in POINTS {
        rig.run_until(|rig| rig.events.last() == Some(&Event::Held(Hold::Operator)));
        assert_at(&rig, point);
        rig.controller().obey(Order::Resume).unwrap();
        rig.run_until(|rig| rig.events.last() == Some(&Event::Resumed));
    }
    assert_ends_well(rig);
}

#[test]
fn steps_back_and_on() {
    let mut rig = Rig::portal(PROGRAM);
    run_to(&mut rig, FIRST + 200.0 + 80.0);
    for point in [1, 0] {
        rig.controller().obey(Order::Retrace).unwrap();
        rows(&mut rig, 2500);
        assert_at(&rig, POINTS[point]);
    }
    // The first one in motion, the second one from rest.
    let told = (rig.events.iter()).filter(|it| matches!(it, Event::Held(_) | Event::Retracing));
    assert!(told.eq(&[
        Event::Held(Hold::Operator),
        Event::Retracing,
        Event::Held(Hold::Operator)
    ]));
    rig.controller().obey(Order::Resume).unwrap();
    assert_ends_well(rig);
}

/// At a program stop the way back begins at once, and the stop comes again.
#[test]
fn steps_back_from_a_program_stop() {
    let mut rig = Rig::portal("G0 X100\nM0\nG1 X200 F6000\nM2\n");
    rig.goes_on = false;
    let paused = |rig: &Rig| {
        let pauses = rig
            .events
            .iter()
            .filter(|it| matches!(it, Event::Paused { .. }));
        pauses.count()
    };
    rig.run_until(|rig| paused(rig) == 1);
    rig.controller().obey(Order::Retrace).unwrap();
    rows(&mut rig, 1500);
    assert_eq!(position(&rig)[0], 0.0);
    rig.controller().obey(Order::Resume).unwrap();
    rig.run_until(|rig| paused(rig) == 2);
    assert_eq!(position(&rig)[0], 100.0);
    rig.controller().obey(Order::CycleStart).unwrap();
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_eq!(position(&rig)[0], 200.0);
}

#[test]
fn going_on_from_a_program_stop_while_held() {
    let mut rig = Rig::portal("G1 X1 F6000\nM0\nX2\nM2\n");
    rig.goes_on = false;
    rig.run_until(|rig| matches!(rig.events.last(), Some(Event::Paused { .. })));
    rig.controller().obey(Order::FeedHold).unwrap();
    rows(&mut rig, 2);
    rig.controller().obey(Order::CycleStart).unwrap();
    rows(&mut rig, 100);
    assert_eq!(
        rig.events.last(),
        Some(&Event::Held(Hold::Operator)),
        "it does not go on"
    );
    assert!((position(&rig)[0] - 1.0).abs() < 1e-9);
    rig.controller().obey(Order::Resume).unwrap();
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert!(rig.events.contains(&Event::Resumed));
}

/// All of it again, by a file, through the command: the same frames each time.
#[test]
fn events_from_a_file() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = folder.file("p.ngc", PROGRAM);
    let events = "t_s,event,value\n0.2,rapid_override,40\n1.5,feed_override,50\n2,feed_hold,\n2.5,resume,\n\
                  3,feed_override,200\n4,retrace,\n6,resume,\n7,single_block,on\n11,single_block,off\n11,resume,\n";
    let events = folder.file("events.csv", events);
    let validate = |trace: &Path| {
        let output = syncline()
            .args(["validate", "--json", "-", "--events"])
            .args([&events, Path::new("--trace"), trace, &machine, &program])
            .output()
            .unwrap();
        let (code, json, errors) = ended(&output);
        assert_eq!(code, 0, "{errors}{json}");
        let json: serde_json::Value = serde_json::from_str(json).unwrap();
        assert!(
            json["path"]["max_deviation_mm"].as_f64().unwrap() <= 0.001,
            "{json}"
        );
        json["frames_sha256"].as_str().unwrap().to_owned()
    };
    let digest = validate(&folder.path("trace.csv"));
    assert_eq!(digest, validate(&folder.path("again.csv")));
    let trace = Trace::read(&example("portal"), &folder.read("trace.csv"));
    trace.assert_within_limits();
    let axes = ["X", "Y", "Z"].map(|name| &trace.axis(name).set);
    for row in 0..trace.line.len() {
        let off = off_the_path(&axes.map(|set| set[row]));
        // Within the tolerance and the rounding to increments.
        assert!(off < 0.0015, "row {row}: {off}");
    }
    let rests = |from: usize, to: usize| axes.iter().all(|set| set[from] == set[to]);
    assert!(rests(1230, 1250), "held");
    assert!(rests(2900, 3000), "stepped back");
    assert!(rests(5000, 5500), "stopped after the block");
    assert!(!rests(1400, 1500) && !rests(3050, 3100));
}

/// Nobody goes on after the last event: the run ends all the same, and says why.
#[test]
fn events_that_end_in_a_hold() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = folder.file("p.ngc", "G1 X100 F3000\nM2\n");
    for last in [
        "feed_hold,",
        "single_block,on",
        "feed_override,0",
        "feed_hold,\n1,jog,X+5 F60",
    ] {
        let events = format!("t_s,event,value\n0.5,{last}\n");
        let events = folder.file("events.csv", &events);
        let output = syncline()
            .args(["validate", "--json", "-", "--events"])
            .args([&events, &machine, &program])
            .output()
            .unwrap();
        let (code, json, errors) = ended(&output);
        assert_eq!(code, 1, "{last}: {errors}{json}");
        assert!(errors.contains("held: stopped"), "{last}: {errors}");
        let json: serde_json::Value = serde_json::from_str(json).unwrap();
        assert_eq!(json["outcome"], "interrupted by a stop", "{last}: {json}");
    }
}

/// The program is over before.
#[test]
fn events_that_never_come() {
    let folder = Folder::new();
    let program = folder.file("p.ngc", "G0 X5\nM2\n");
    let events = "t_s,event,value\n0.05,feed_override,50\n50,feed_hold,\n60,resume,\n";
    let output = syncline()
        .args(["validate", "--events"])
        .args([
            folder.file("e.csv", events),
            folder.machine("portal"),
            program,
        ])
        .output()
        .unwrap();
    let (code, _, errors) = ended(&output);
    assert_eq!(code, 0, "{errors}");
    assert!(
        errors.contains("2 events from 50 s on never come"),
        "{errors}"
    );
}

/// Whatever came shortly before.
#[test]
fn the_last_order_holds() {
    let program = "\
G64 P0.1
G0 X0 Y0
G1 X100 F6000
G3 X120 Y20 I0 J20
G1 Y100
G3 X100 Y120 I-20 J0
G1 X0
M2
";
    for (events, ends) in [
        ("1.4,feed_override,0\n1.405,feed_override,100", true),
        ("1.4,feed_override,0\n1.44,feed_override,100", true),
        ("1.4,single_block,on\n1.5,single_block,off", true),
        (
            "1.4,single_block,on\n1.5,feed_override,50\n1.6,single_block,off",
            true,
        ),
        ("1.9,retrace,\n2.15,resume,\n2.17,feed_hold,", false),
        ("1.9,retrace,\n2.15,resume,\n2.2,feed_hold,", false),
        (
            "2.0,feed_override,0\n2.6,feed_hold,\n2.8,feed_override,50",
            false,
        ),
    ] {
        let (code, json, ..) = super::jogs::validate(program, events);
        assert_eq!(code, i32::from(!ends), "{events}: {json}");
    }
}

#[test]
fn an_events_file_that_is_wrong() {
    let folder = Folder::new();
    let program = folder.file("p.ngc", "G0 X5\nM2\n");
    let events = folder.file("e.csv", "t_s,event,value\n1,feed_hold,\n0.5,resume,\n");
    let output = syncline()
        .args(["validate", "--events"])
        .args([events, folder.machine("portal"), program])
        .output()
        .unwrap();
    let (code, _, errors) = ended(&output);
    assert_eq!(code, 2);
    assert!(errors.contains("e.csv:3:1: `0.5` is no time"), "{errors}");
}

/// Keys on a terminal of its own, which is as it was in the end.
#[test]
fn keys_on_a_terminal() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = folder.file("p.ngc", "G1 X1400 F3000\nM2\n");
    let run = syncline();
    let line = format!(
        "stty -g; {} run {} {} --verbose 2>&1 | cat; stty -g",
        run.get_program().display(),
        machine.display(),
        program.display()
    );
    let mut terminal = Terminal::run(&line);
    let before = terminal.line();
    terminal.wait_for("keys: space feed hold");
    terminal.wait_for("ready");
    for (key, answer) in [
        (" ", "held on the path"),
        // Sooner it would be the repetition of a key that is held.
        ("wait", ""),
        (" ", "going on"),
        ("b", "held on the path"),
        ("+-><", ""),
        (" ", "going on"),
        ("q", "interrupted: stopping on the path"),
    ] {
        match key {
            "wait" => sleep(Duration::from_millis(800)),
            key => terminal.press(key.as_bytes()),
        }
        if !answer.is_empty() {
            terminal.wait_for(answer);
        }
    }
    terminal.wait_for("interrupted by a stop");
    let after = terminal.end().pop();
    assert_eq!(Some(before), after, "the terminal is as it was");
}

/// The planner has enough to do for ever, and hears nobody.
#[test]
fn a_loop_that_moves_nothing_is_stopped_by_a_key() {
    let folder = Folder::new();
    let line = format!(
        "{} run --stream {} {} --verbose 2>&1 | cat",
        syncline().get_program().display(),
        folder.machine("portal").display(),
        folder.file("p.ngc", "G0 X10\nM99\n").display()
    );
    let mut terminal = Terminal::run(&line);
    terminal.wait_for("ready");
    terminal.press(b"q");
    terminal.wait_for("interrupted by a stop");
    let _ = terminal.end();
}

/// The step of a jog is in view before the first one.
#[test]
fn the_step_of_a_jog_is_shown_while_held() {
    let folder = Folder::new();
    let line = format!(
        "TERM=xterm {} run {} {} --verbose; true",
        syncline().get_program().display(),
        folder.machine("portal").display(),
        folder.file("p.ngc", "G1 X1400 F3000\nM2\n").display()
    );
    let mut terminal = Terminal::run(&line);
    for (key, shown) in [
        ("", "ready"),
        (" ", "held on the path"),
        ("", " by 1 mm"),
        ("]", " by 10 mm"),
        (" ", "going on"),
        ("", "3000 mm/min"),
        ("q", "interrupted by a stop"),
    ] {
        terminal.press(key.as_bytes());
        terminal.wait_for(shown);
    }
    let _ = terminal.end();
}

/// What a rotary axis does is told in degrees.
#[test]
fn a_turn_is_shown_in_degrees() {
    let folder = Folder::new();
    let line = format!(
        "TERM=xterm {} run {} {} --verbose; true",
        syncline().get_program().display(),
        folder.machine("rotary").display(),
        folder.file("p.ngc", "G1 A3000 F7200\nM2\n").display()
    );
    let mut terminal = Terminal::run(&line);
    for (key, shown) in [
        ("", "/3000 mm and °, "),
        ("", "7200 °/min"),
        (" ", "held on the path"),
        ("", "° by 1 mm"),
        ("q", "interrupted by a stop"),
    ] {
        terminal.press(key.as_bytes());
        terminal.wait_for(shown);
    }
    let _ = terminal.end();
}

/// A feed hold that ends at a program stop does not say that the program goes on.
#[test]
fn a_hold_that_ends_at_a_program_stop_says_that_it_still_waits() {
    let mut rig = Rig::portal("G0 X20\nM0\nG0 X0\nM2\n");
    rig.goes_on = false;
    let paused = |event: &Event| matches!(event, Event::Paused { line: 2, .. });
    rig.run_until(|rig| rig.events.iter().any(paused));
    rig.command(Command::FeedHold);
    rig.run_until(|rig| rig.events.contains(&Event::Held(Hold::Operator)));
    rig.command(Command::Resume);
    let still = |event: &Event| matches!(event, Event::StillPaused { line: 2, .. });
    rig.run_until(|rig| rig.events.iter().any(still));
    for _ in 0..200 {
        rig.step();
    }
    assert!(!rig.events.contains(&Event::Resumed));
    assert!(rig.session.status().waits);
    rig.command(Command::CycleStart);
    assert_eq!(rig.finish(), End::Finished);
    assert!(rig.events.contains(&Event::Resumed));
}
