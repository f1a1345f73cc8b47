//! A machine that stays on: what it takes in each state, programs that begin at a line, whatever is asked for and
//! happens; and days at a console, by lines and by keys.

mod mishaps;
mod scenes;
mod whole;

use proptest::prelude::*;
use proptest::sample::select;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Stdio};
use std::thread;
use std::time::Duration;
use syncline_canopen::{CanId, CobId};
use syncline_controller::control::{self, NotNow, Refusal as OrderRefusal, State, Switch};
use syncline_controller::session::{
    self, Command, Direction, Jog, Override, Refusal, StepChange, SwitchChange,
};
use syncline_drives::bus::Transmission;
use syncline_drives::model::PowerState;
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_gcode::{AxisLetter, Tables, Turning};
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::Rig;
use syncline_tests::terminal::Terminal;

/// A portal that is ready for the first job of the day.
fn ready() -> Rig {
    ready_with(&[])
}

/// The same with parts of its file replaced.
pub(super) fn ready_with(replacements: &[(&str, &str)]) -> Rig {
    let mut rig = Rig::staying_on("portal", replacements, |_, _| ());
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    rig
}

pub(super) fn state(rig: &Rig) -> State {
    rig.session.status().state
}

/// Goes on until the machine rests and waits for an operator, or is off.
pub(super) fn settle(rig: &mut Rig) {
    use State::{Disabled, Faulted, Held, Off, Ready};
    // What is commanded, also by who goes on at a tool change, shows some wake-ups later.
    let mut since = 0;
    while since < 6 && rig.step() {
        let rests = matches!(state(rig), Ready | Held | Faulted | Disabled | Off);
        since = if rests { since + 1 } else { 0 };
    }
}

/// Commands something, and goes on until the machine rests again.
pub(super) fn go(rig: &mut Rig, command: Command) {
    rig.command(command);
    settle(rig);
}

pub(super) fn mdi(rig: &mut Rig, lines: &str) {
    go(rig, Command::Mdi(lines.to_owned()));
}

pub(super) fn positions<const N: usize>(axes: [(AxisLetter, f64); N]) -> [Option<f64>; 9] {
    let mut positions = [None; 9];
    for (axis, position) in axes {
        positions[axis.index()] = Some(position);
    }
    positions
}

pub(super) fn at(rig: &Rig, axis: AxisLetter) -> f64 {
    rig.session.status().setpoint[axis.index()]
}

/// Where an axis is in work coordinates.
pub(super) fn work(rig: &Rig, axis: AxisLetter) -> f64 {
    at(rig, axis) - rig.session.status().offset[axis.index()]
}

/// Every motion was inside the limits. While the drives were disabled there was none of the
/// controller's.
pub(super) fn assert_moves_within_limits(rig: &mut Rig) {
    let rows = std::mem::take(&mut rig.rows);
    for enabled in rows.chunk_by(|one, next| next.cycle == one.cycle + 1) {
        rig.rows = enabled.to_vec();
        rig.trace().assert_within_limits();
    }
    rig.rows = rows;
}

#[test]
fn a_machine_that_is_off_takes_no_command() {
    let mut rig = ready();
    let file = rig.folder.file("part.ngc", "M2\n");
    go(&mut rig, Command::SwitchOff);
    while rig.step() {}
    assert_eq!((state(&rig), rig.refused.len()), (State::Off, 0));
    let settings = rig.session.status().settings;
    let commands = [
        Command::JogStep(StepChange::Greater),
        Command::RenewJog(AxisLetter::X),
        Command::EndJog(AxisLetter::X),
        Command::FeedOverride(Override::To(40.0)),
        Command::RapidOverride(Override::To(40.0)),
        Command::SingleBlock(SwitchChange::Toggle),
        Command::OptionalStop(SwitchChange::Toggle),
        Command::Load(file),
        Command::Run { from_line: None },
        Command::Jog(Jog::Step {
            axis: AxisLetter::X,
            direction: Direction::Positive,
        }),
        Command::Stop,
        Command::Reset,
        Command::SwitchOff,
    ];
    for (count, command) in (1..).zip(commands) {
        rig.command(command);
        rig.step();
        assert_eq!(rig.refused.len(), count, "{:?}", rig.refused);
    }
    assert_eq!(rig.session.status().settings, settings);
}

/// What is told, and confirmed by cycle start before anything moves or is switched.
#[test]
fn a_program_that_begins_at_a_line_waits_for_cycle_start() {
    let mut rig = ready();
    rig.goes_on = false;
    let text = "G1 X20 F6000\nM3 S500\nM8\nX40\nX60 Y10\nM2\n";
    let file = rig.folder.file("part.ngc", text);
    rig.command(Command::Load(file));
    let here = rig.session.status().setpoint;
    go(&mut rig, Command::Run { from_line: Some(5) });
    assert_eq!(state(&rig), State::Held);
    let (line, told) = &rig.messages[0];
    assert_eq!(*line, 5);
    for part in [
        "begins with G1 G17 G21 G40 G49 G54 G90 ",
        " F6000 S500 M3 M8, at X40.000 Y",
        "; switched on the way there: the spindle, flood on",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let paused = control::Event::Paused {
        line: 5,
        reason: control::Pause::Beginning,
    };
    assert!(rig.events.contains(&paused), "{:?}", rig.events);
    assert_eq!(rig.session.status().setpoint, here);
    assert_eq!(rig.session.status().spindle.turning, Turning::Off);
    // Also what is jogged before comes back first.
    go(
        &mut rig,
        Command::Jog(Jog::Step {
            axis: AxisLetter::Y,
            direction: Direction::Positive,
        }),
    );
    let begun = rig.rows.len();
    go(&mut rig, Command::CycleStart);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    let rows = &rig.rows[begun..];
    let cut = rows.iter().position(|row| row.plan.position[1] > 5.0);
    let cut = &rows[cut.expect("line 5 leads there")];
    assert_eq!(cut.functions.spindle.turning, Turning::Clockwise);
    assert!(cut.functions.coolant.flood);
    // Where it cannot begin, no cycle start has the whole program begin instead.
    go(
        &mut rig,
        Command::Run {
            from_line: Some(99),
        },
    );
    assert_eq!(std::mem::take(&mut rig.problems).len(), 1);
    go(&mut rig, Command::CycleStart);
    let refused = rig.refused.pop().expect("it is refused").reason;
    let is_named = matches!(refused, Refusal::NotAtLine { line: 99 });
    assert!(is_named, "{refused}");
    assert_eq!(state(&rig), State::Ready);
    // Also where it was not the time for it.
    go(&mut rig, Command::Run { from_line: None });
    go(&mut rig, Command::Disable);
    go(&mut rig, Command::Run { from_line: Some(4) });
    go(&mut rig, Command::Enable);
    go(&mut rig, Command::CycleStart);
    let refused = std::mem::take(&mut rig.refused).pop();
    let refused = refused.expect("it is refused").reason;
    let is_named = matches!(refused, Refusal::NotAtLine { line: 4 });
    assert!(is_named, "{refused}");
    // A stop gives it up, and nothing was switched.
    go(&mut rig, Command::Run { from_line: Some(5) });
    let there = rig.session.status().setpoint;
    go(&mut rig, Command::Stop);
    assert_eq!(state(&rig), State::Ready);
    assert_eq!(rig.session.status().setpoint, there);
    assert_eq!(rig.session.status().spindle.turning, Turning::Off);
    assert_eq!(rig.refused, []);
}

/// Moves and switches of a program.
const BLOCKS: [&str; 12] = [
    "X10",
    "X20",
    "X30",
    "M64 P1",
    "M65 P1",
    "M62 P1",
    "M63 P1",
    "M62 P9",
    "M68 E1 Q2.5",
    "M67 E1 Q-4",
    "M3 S500",
    "M8",
];

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 30, ..ProptestConfig::with_cases(6) })]

    /// What is switched on the way to the line that a program begins at is told before, and is there what it is
    /// in a whole run.
    #[test]
    fn a_line_begins_with_what_a_whole_run_has_switched(
        blocks in prop::collection::vec(select(&BLOCKS[..]), 0..16),
    ) {
        let mut rig = ready();
        rig.goes_on = true;
        let text = format!("G1 X5 F6000\n{}X200\nM2\n", blocks.join("\n") + "\n");
        let line = text.lines().position(|line| line == "X200").map(|place| place as u32 + 1);
        let file = rig.folder.file("part.ngc", &text);
        rig.command(Command::Load(file));
        let [whole, begun] = [None, line].map(|from_line| {
            let switched = rig.switches.len();
            rig.command(Command::Run { from_line });
            rig.run_until(|rig| at(rig, AxisLetter::X) < 100.0);
            rig.run_until(|rig| at(rig, AxisLetter::X) > 150.0);
            let functions = rig.rows.last().expect("it moves").functions;
            let switched = rig.switches[switched..].to_vec();
            settle(&mut rig);
            (functions, switched)
        });
        let (_, told) = rig.messages.last().expect("what the line finds");
        for switch in begun.1 {
            if let Switch::Output(output) = switch {
                prop_assert!(told.contains(&output.to_string()), "{output}: {told}");
            }
        }
        let (whole, begun) = (whole.0, begun.0);
        prop_assert_eq!(begun.outputs, whole.outputs);
        prop_assert_eq!(begun.spindle.turning, whole.spindle.turning);
        prop_assert_eq!(begun.coolant, whole.coolant);
    }
}

/// Where lines are typed in.
#[derive(Clone, Copy, Debug)]
enum Typed {
    Ready,
    /// Where a program is held.
    Held,
    /// Where lines rest themselves.
    LinesHeld,
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Of lines that come in one cycle the first are done or refused and the others refused, and nothing is lost by that: what
    /// was held goes on to its end, and the machine takes lines as before.
    #[test]
    fn lines_that_come_together_lose_nothing(
        place in select(vec![Typed::Ready, Typed::Held, Typed::LinesHeld]),
        lines in prop::collection::vec(select(vec!["G90", "M8", "G91 G1 Y1 F600", "M0", "G1 X"]), 1..4),
        stops: bool,
    ) {
        let mut rig = ready();
        rig.goes_on = false;
        let file = rig.folder.file("part.ngc", "G21 G90 G61\nG1 X5 F1500\nM0\nG1 X10\nM2\n");
        match place {
            Typed::Ready => {}
            Typed::Held => {
                rig.command(Command::Load(file));
                go(&mut rig, Command::Run { from_line: None });
                prop_assert_eq!(state(&rig), State::Held);
            }
            Typed::LinesHeld => {
                mdi(&mut rig, "M0");
                prop_assert_eq!(state(&rig), State::Held);
            }
        }
        for line in &lines {
            rig.command(Command::Mdi((*line).to_owned()));
        }
        settle(&mut rig);
        if stops {
            go(&mut rig, Command::Stop);
        }
        // What is held still.
        for _ in 0..6 {
            if state(&rig) == State::Held {
                go(&mut rig, Command::CycleStart);
            }
            if state(&rig) == State::Held {
                go(&mut rig, Command::Resume);
            }
        }
        prop_assert_eq!(state(&rig), State::Ready, "{:?} {:?}", rig.refused, rig.events);
        if matches!(place, Typed::Held) && !stops {
            prop_assert_eq!(at(&rig, AxisLetter::X), 10.0, "{:?}", rig.refused);
        }
        let refused = rig.refused.len();
        mdi(&mut rig, "G90 G0 X20");
        prop_assert_eq!(&rig.refused[refused..], &[]);
        prop_assert_eq!(at(&rig, AxisLetter::X), 20.0);
    }

    /// Whatever a feed hold stops, it is shown as held once that stands: also on its way back from where it was jogged.
    #[test]
    fn what_is_shown_as_held_stands(way in 20.0..150.0f64, wake_ups in 0..300usize, first in 50..300usize) {
        let mut rig = ready();
        let file = rig.folder.file("part.ngc", "G21 G90 G61\nG1 X30 F1500\nG1 X0\nM2\n");
        rig.command(Command::Load(file));
        rig.command(Command::Run { from_line: None });
        for _ in 0..first {
            rig.step();
        }
        go(&mut rig, Command::FeedHold);
        let (axis, distance, speed) = (AxisLetter::Y, way, None);
        go(&mut rig, Command::Jog(Jog::By { axis, distance, speed }));
        prop_assert_eq!(state(&rig), State::Held);
        rig.command(Command::Resume);
        for _ in 0..wake_ups {
            rig.step();
        }
        rig.command(Command::FeedHold);
        rig.run_until(|rig| matches!(state(rig), State::Held | State::Ready));
        if state(&rig) == State::Held {
            let resumed = rig.refused.is_empty();
            let stood = rig.rows.last().is_some_and(|row| row.plan.velocity.iter().all(|it| *it == 0.0));
            prop_assert!(!resumed || stood, "{:?}", rig.rows.last());
        }
        for _ in 0..3 {
            go(&mut rig, Command::Resume);
        }
        prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.refused);
    }
}

/// Cycle start ends no feed hold, and says so.
#[test]
fn a_feed_hold_is_no_pause() {
    let mut rig = ready();
    rig.goes_on = false;
    let file = rig
        .folder
        .file("part.ngc", "G21 G90\nG1 X30 F1500\nM0\nG1 X0\nM2\n");
    rig.command(Command::Load(file));
    rig.command(Command::Run { from_line: None });
    for _ in 0..100 {
        rig.step();
    }
    go(&mut rig, Command::FeedHold);
    go(&mut rig, Command::CycleStart);
    let why: Vec<_> = rig.refused.iter().map(|it| &it.reason).collect();
    assert_eq!(why, [&Refusal::Machine(OrderRefusal::FeedHeld)]);
    assert_eq!(state(&rig), State::Held);
    go(&mut rig, Command::Resume);
    assert_eq!((state(&rig), rig.refused.len()), (State::Held, 1));
    go(&mut rig, Command::CycleStart);
    assert_eq!((state(&rig), rig.refused.len()), (State::Ready, 1));
}

/// Each time it is frozen anew, a little beside where it was; and while SYNC is off no cycle is full.
#[test]
fn a_machine_that_is_enabled_again_is_judged_from_where_it_stands() {
    let mut rig = ready();
    for to in ["G0 X20 Y30", "G0 X0 Y0 Z0", "G0 X5"] {
        mdi(&mut rig, to);
        go(&mut rig, Command::Disable);
        go(&mut rig, Command::Enable);
        assert_eq!(state(&rig), State::Ready);
    }
    rig.twin(2).disturb(Disturbance::Reset);
    settle(&mut rig);
    rig.run_until(|rig| state(rig) == State::Faulted);
    go(&mut rig, Command::Reset);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    go(&mut rig, Command::SwitchOff);
    let summary = rig.judge();
    // The drive that was reset stopped the machine once; else nothing is wrong.
    let [fault] = &summary.violations[..] else {
        panic!("{:#?}", summary.violations);
    };
    assert!(fault.what.starts_with("fault: node 3 "), "{fault:?}");
    let [bus] = &summary.bus[..] else {
        panic!("the portal has one bus");
    };
    assert!(bus.peak_utilisation < 1.0, "{}", bus.peak_utilisation);
}

/// The work offset that the tables beside a machine's file have, once they have it.
pub(super) fn offset_of(machine: &Path, axis: AxisLetter) -> Option<f64> {
    let tables = Tables::load(&Tables::beside(machine)).ok()?;
    Some(tables.work_offsets[0][axis])
}

/// The whole command in real time, by lines of text.
#[test]
fn lines_of_text_are_a_day_too() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let part = folder.file("part.ngc", "G1 X30 F12000\nM0 (look)\nX0\nM3 S100\nM2\n");
    let lines = format!(
        "?\njog X+10\nset_offset X0 Y0\nbogus\nstatus 1\nload /\nmdi G0 X5; X\nmdi G0 X5\nwait\nfeed_override 80\nstatus\nload {}\nrun\nwait\n\
         disable\nwait\nrun\nenable\n",
        part.display()
    );
    let told = console_by_lines(&machine, &lines);
    for part in [
        "  single_block       the path rests behind each block: `on` or `off`",
        "unknown event `bogus`",
        "`status` takes no value",
        "switch_off, ?, status, faults, wait",
        "is a directory",
        "ready: work X",
        "\nprogram: no program, ",
        "\nstops in: X",
        "\ntyped: G0 X5\n",
        "\nspeed: 0 mm/min, actual ",
        "\noverride: feed 80 %, rapid 100 %\ntool: T0\nspindle: off\ncoolant: off\njog: by 1 mm",
        "\nstops: single block off, M1 off\noffsets: X",
        "\ndrives: all enabled",
        "jogging: feed hold stops the axes",
        "write a value",
        "line 2: program stop (M0); cycle_start goes on",
        "held: work X",
        "disabled: enable the drives",
        "refused: no new program while the machine is disabled: enable the drives",
        "off: start the command again",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let offset = offset_of(&machine, AxisLetter::X).unwrap_or_default();
    assert!((offset - 10.0).abs() < 0.01, "{offset}");
}

/// A switch that is wired to a drive is told once, by its name.
#[test]
fn a_console_tells_an_input_by_its_name() {
    let folder = Folder::new();
    let told = console_by_lines(&folder.machine("router"), "home Z\n");
    assert!(told.contains("input \"home Z\" on\n"), "{told}");
    assert!(!told.contains("DI4"), "{told}");
}

/// A line that is no text, or without end, is told, and those behind it are done.
#[test]
fn lines_that_are_none_keep_nobody_from_those_behind_them() {
    let folder = Folder::new();
    let machine = folder.file("machine.toml", &machine_with("xyz", &[]));
    let mut lines = b"jog X+1\nmdi (MSG, f\xFCr) G0 X3\n".to_vec();
    lines.extend([b'x'; 10_000]);
    lines.extend(b"\nmdi (MSG, the last) G4 P0.1\nstatus\n");
    let told = console_by_lines(&machine, &lines);
    for part in [
        "not done, as it is no UTF-8: mdi (MSG, f",
        "not done, as a line has 4096 bytes at most",
        "the last",
    ] {
        assert!(told.contains(part), "no {part:?} in {told}");
    }
}

/// Who switches off before lines that wait is told which are not done; behind a `wait` all of them are.
#[test]
fn a_console_tells_what_it_leaves_undone_as_it_switches_off() {
    let folder = Folder::new();
    let machine = folder.file("machine.toml", &machine_with("xyz", &[]));
    let lines = "jog X+1\nmdi G0 X3\nmdi (MSG, the last) G0 X4\n";
    let told = console_by_lines(&machine, format!("{lines}switch_off\n"));
    let undone = "not done, as `switch_off` came before it: mdi";
    assert!(told.contains(undone), "{told}");
    let told = console_by_lines(&machine, format!("{lines}wait\nswitch_off\n"));
    assert!(
        told.contains("the last") && !told.contains("not done"),
        "{told}"
    );
}

/// What the machine refuses has not been at work.
#[test]
fn a_line_that_is_refused_is_never_told_as_at_work() {
    let folder = Folder::new();
    let told = console_by_lines(&folder.machine("router"), "mdi G0 X1\nstatus\n");
    assert!(told.contains("refused: axis X is not referenced"), "{told}");
    assert!(!told.contains("MDI:"), "{told}");
}

/// A gantry that stands a little askew, as it is enabled; behind that it is square.
#[test]
fn a_console_tells_that_a_gantry_is_taken_square() {
    let folder = Folder::new();
    let skewed = (
        "drive_soft_limits = true\n",
        "drive_soft_limits = true\nsimulation = { start = 300.0, start_skew = -0.25 }\n",
    );
    let machine = folder.file("machine.toml", &machine_with("portal", &[skewed]));
    let told = console_by_lines(&machine, "wait\ndisable\nwait\nenable\n");
    let what = "axis X: its sides are -0.250 mm out of square: they are taken square before the machine is ready";
    let times = told.matches("out of square").count();
    assert!(told.contains(what) && times == 1, "{told}");
}

/// A program that is stopped where it is held does not run any more; in real time its stop is over before the planner has left it.
#[test]
fn a_stop_where_a_program_is_held_tells_no_running() {
    let folder = Folder::new();
    let part = folder.file("part.ngc", "G91 G1 X1 F3000\nM0\nG1 X1\nM2\n");
    let (mut console, mut input) = console_that_reads(&folder.machine("portal"));
    let mut told = BufReader::new(console.stdout.take().unwrap()).lines();
    let mut until = |state: &str| {
        let mut before = Vec::new();
        for line in told.by_ref().map(Result::unwrap) {
            before.push(line);
            if before.last().is_some_and(|line| line.starts_with(state)) {
                return before;
            }
        }
        panic!("no {state:?}: {before:?}");
    };
    writeln!(input, "wait\nload {}\nrun", part.display()).unwrap();
    assert!(until("held: ").iter().any(|it| it.starts_with("running: ")));
    // Behind what the hold itself still does.
    thread::sleep(Duration::from_millis(300));
    writeln!(input, "stop").unwrap();
    let behind = until("ready: ");
    assert!(
        !behind.iter().any(|it| it.starts_with("running: ")),
        "{behind:?}"
    );
    drop(input);
    until("off: ");
    assert!(console.wait().unwrap().success());
}

/// In mid-program axes are jogged while it is held: what waits for rest waits for them, too, and a jog adds to the one before.
#[test]
fn what_waits_where_a_program_is_held_waits_for_jogs() {
    let folder = Folder::new();
    let part = folder.file("part.ngc", "G91 G1 X1 F3000\nM0\nG1 X1\nM2\n");
    let lines = format!(
        "load {}\nrun\nwait\njog Z-20\njog Z-20\nwait\nstatus\nmove_to Z-30\nwait\nstatus\nresume\n",
        part.display()
    );
    let told = console_by_lines(&folder.machine("portal"), &lines);
    let held = told.lines().filter(|line| line.starts_with("held: "));
    let places: Vec<f64> = held
        .filter_map(|line| line.split_once("machine ")?.1.split(&[' ', ','][..]).nth(2))
        .map(|z| z[1..].parse().unwrap())
        .collect();
    // At M0, behind both jogs, and behind the move; encoders have their noise.
    assert_eq!(places.len(), 3, "{told}");
    for (place, wanted) in places.iter().zip([0.0, -40.0, -30.0]) {
        assert!(
            (place - wanted).abs() < 0.02,
            "{place}, not {wanted}: {told}"
        );
    }
}

/// A console by lines, in real time, and where it reads them.
fn console_that_reads(machine: &Path) -> (Child, ChildStdin) {
    let mut console = syncline();
    console.arg("console").arg(machine);
    let console = console
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut console = console.spawn().expect("it starts");
    let input = console.stdin.take().unwrap();
    (console, input)
}

/// What a console tells that is given these lines, in real time, until the machine is off.
fn console_by_lines(machine: &Path, lines: impl AsRef<[u8]>) -> String {
    let (console, mut input) = console_that_reads(machine);
    input.write_all(lines.as_ref()).unwrap();
    drop(input);
    let output = console.wait_with_output().unwrap();
    let (code, told, errors) = ended(&output);
    assert_eq!(code, 0, "{told}{errors}");
    told.to_owned()
}

/// A console on a terminal of 80 columns and 24 rows.
pub(super) fn console_on_a_terminal(machine: &Path, options: &str) -> Terminal {
    Terminal::run(&format!(
        "stty rows 24 cols 80; {} console {} {options}",
        syncline().get_program().to_string_lossy(),
        machine.display()
    ))
}

/// The list of the keys hides where the axes are: any key closes it, and moves nothing.
#[test]
fn keys_move_nothing_behind_their_list() {
    let folder = Folder::new();
    let mut keys = console_on_a_terminal(&folder.machine("xyz"), "");
    keys.wait_until(|screen| screen.starts_with(" READY"));
    let part = folder.file("part.ngc", "G0 X50\nM2\n");
    keys.press(format!(":load {}\r", part.display()).as_bytes());
    keys.wait_until(|screen| screen.contains("part.ngc"));
    for key in [&b"\x1B[C"[..], b"?", b"\r", b":", b" "] {
        keys.press(b"?");
        keys.wait_until(|screen| !screen.contains("speed "));
        // It is held, and repeats itself.
        keys.press(key);
        keys.wait_until(|screen| screen.contains("speed "));
        for _ in 0..20 {
            thread::sleep(Duration::from_millis(30));
            keys.press(key);
        }
        thread::sleep(Duration::from_secs(1));
    }
    keys.press(b"\x1B[C");
    keys.wait_until(|screen| screen.contains("1.000"));
    thread::sleep(Duration::from_millis(300));
    let screen = keys.wait_until(|screen| screen.starts_with(" READY"));
    assert!(screen.contains("\n X        1.000 "), "{screen}");
    keys.press(b":switch_off\r");
}

/// On a terminal that tells when a key is released: the answer to whether it does, and an arrow to the
/// right that is pressed, repeated and released.
#[test]
fn a_key_that_is_held_jogs_until_it_is_released() {
    const TELLS: &[u8] = b"\x1B[?0u\x1B[?62c";
    const PRESSED: &[u8] = b"\x1B[1;1:1C";
    const REPEATED: &[u8] = b"\x1B[1;1:2C";
    const RELEASED: &[u8] = b"\x1B[1;1:3C";
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let mut terminal = console_on_a_terminal(&machine, "");
    terminal.wait_for("\x1B[?u");
    terminal.press(TELLS);
    terminal.wait_for("\x1B[>3u");
    // Where it rests: offsets are refused before.
    let rests = |terminal: &mut Terminal| {
        let before = offset_of(&machine, AxisLetter::X);
        for _ in 0..300 {
            terminal.press(b":set_offset X-7\r");
            thread::sleep(Duration::from_millis(100));
            let offset = offset_of(&machine, AxisLetter::X);
            if offset.is_some() && offset != before {
                return offset.unwrap_or_default();
            }
        }
        panic!("X stays at {before:?}");
    };
    let begin = rests(&mut terminal);
    let held = |terminal: &mut Terminal| {
        // What was typed in vain is over by then.
        thread::sleep(Duration::from_secs(1));
        terminal.press(PRESSED);
        for _ in 0..10 {
            thread::sleep(Duration::from_millis(30));
            terminal.press(REPEATED);
        }
    };
    held(&mut terminal);
    terminal.press(RELEASED);
    let there = rests(&mut terminal);
    assert!(there > begin + 20.0, "{begin} {there}");
    // The terminal is lost: nobody hears that the key is released, and no repetition comes.
    held(&mut terminal);
    let lost = rests(&mut terminal);
    assert!(lost > there + 20.0 && lost < 1400.0, "{there} {lost}");
    terminal.press(b":switch_off\r");
    let _ = terminal.end();
}

/// A stop of a program is ended by an Enter that repeats itself, as that of a finger that stays on the key: not the next one as
/// well, and behind the last one no other program is begun.
#[test]
fn an_enter_that_repeats_itself_ends_one_stop_and_begins_no_program() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let part = folder.file("part.ngc", "G91 G1 X5 F12000\nM0\nG1 X2\nM6 T3\nM2\n");
    let mut terminal = console_on_a_terminal(&machine, "");
    terminal.wait_until(|screen| screen.contains("READY"));
    terminal.press(format!(":load {}\r", part.display()).as_bytes());
    thread::sleep(Duration::from_secs(1));
    terminal.press(b"\r");
    terminal.wait_until(|screen| screen.contains("HELD"));
    for (said, state) in [
        ("press it again to go on", "HELD"),
        ("press it again to begin", "READY"),
    ] {
        thread::sleep(Duration::from_secs(1));
        for _ in 0..100 {
            terminal.press(b"\r");
            thread::sleep(Duration::from_millis(30));
        }
        let screen = terminal.wait_until(|screen| screen.contains(said));
        assert!(screen.contains(state), "{screen}");
    }
    terminal.press(b":switch_off\r");
    let _ = terminal.end();
}

/// A machine that is held has nothing to wait for once nobody is there any more.
#[test]
fn a_console_whose_terminal_is_lost_switches_off() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let ended = machine.with_file_name("ended");
    // The shell outlives its terminal.
    let mut terminal = Terminal::run(&format!(
        "trap '' HUP; stty rows 24 cols 80; {} console {}; echo $? > {}",
        syncline().get_program().to_string_lossy(),
        machine.display(),
        ended.display(),
    ));
    terminal.wait_until(|screen| screen.contains("READY"));
    terminal.press(b":mdi G91 G1 X100 F300\r");
    terminal.wait_until(|screen| screen.contains("MDI"));
    terminal.press(b" ");
    terminal.wait_until(|screen| screen.contains("HELD"));
    drop(terminal);
    let code = (0..300).find_map(|_| {
        thread::sleep(Duration::from_millis(100));
        std::fs::read_to_string(&ended)
            .ok()
            .filter(|code| !code.is_empty())
    });
    // Off, but for what could not be written any more.
    assert_eq!(code.as_deref(), Some("1\n"));
}

/// The states that may follow one.
fn successors(state: State) -> &'static [State] {
    use State::{
        Disabled, Faulted, Held, Homing, Jogging, Mdi, Off, Ready, Running, Starting, Stopping,
    };
    match state {
        Off => &[],
        Starting => &[Ready, Stopping],
        Ready => &[Homing, Jogging, Mdi, Running, Stopping],
        Homing | Jogging => &[Ready, Stopping],
        Mdi | Running => &[Ready, Held, Stopping],
        Held => &[Mdi, Running, Stopping],
        Stopping => &[Ready, Disabled, Faulted, Off],
        Faulted => &[Starting, Stopping],
        Disabled => &[Starting, Stopping, Faulted],
    }
}

/// What an operator or the world does.
#[derive(Clone, Debug)]
pub(super) enum Deed {
    Command(Command),
    Disturb(usize, Disturbance),
}

const PROGRAMS: [&str; 4] = [
    "G0 X20 Y10\nG1 X40 F3000\nM0\nG2 X60 Y30 I20 J0\nM3 S100\nX0 Y0\nM2\n",
    "G91 G1 X5 F6000\nG4 P0.05\nX-5\n",
    "G1 X10 F600\nX2000\nM2\n",
    "T1 M6\nG0 Z-5\nM30\n",
];

/// Lays the programs where deeds load them from.
pub(super) fn lay_out_programs(rig: &Rig) {
    for (name, text) in PROGRAMS.iter().enumerate() {
        let _ = rig.folder.file(&format!("{name}.ngc"), text);
    }
}

impl Deed {
    pub(super) fn done_to(self, rig: &mut Rig) {
        match self {
            Self::Command(Command::Load(file)) => {
                let file = rig.folder.path(file.to_str().expect("a plain name"));
                rig.command(Command::Load(file));
            }
            Self::Command(command) => rig.command(command),
            Self::Disturb(drive, disturbance) => rig.twin(drive).disturb(disturbance),
        }
    }
}

pub(super) fn deed() -> impl Strategy<Value = Deed> {
    let axis = || select(&[AxisLetter::X, AxisLetter::Y, AxisLetter::Z][..]);
    let direction = || select(&[Direction::Positive, Direction::Negative][..]);
    let jog = prop_oneof![
        (axis(), direction()).prop_map(|(axis, direction)| Jog::Step { axis, direction }),
        (axis(), direction()).prop_map(|(axis, direction)| Jog::Continuous {
            axis,
            direction,
            speed: Some(20.0)
        }),
        (axis(), -10.0..400.0).prop_map(|(axis, to)| Jog::To(positions([(axis, to)]))),
    ];
    let command = prop_oneof![
        3 => (0..PROGRAMS.len()).prop_map(|it| Command::Load(format!("{it}.ngc").into())),
        4 => Just(Command::Run { from_line: None }),
        4 => select(&["G0 X5", "G1 F1200 X7 Y3", "G1 X", "M0", "G4 P0.1", "M3 S7", "G91", "G90"][..])
            .prop_map(|line| Command::Mdi(line.to_owned())),
        4 => jog.prop_map(Command::Jog),
        1 => (axis(), -5.0..5.0).prop_map(|(axis, to)| Command::GoTo(positions([(axis, to)]))),
        1 => (axis(), -5.0..5.0)
            .prop_map(|(axis, to)| Command::SetWorkOffset(positions([(axis, to)]))),
        1 => Just(Command::SetToolLength(positions([(AxisLetter::Z, 0.0)]))),
        12 => select(vec![
            Command::CycleStart,
            Command::FeedHold,
            Command::Resume,
            Command::ToggleFeedHold,
            Command::SingleBlock(SwitchChange::Toggle),
            Command::OptionalStop(SwitchChange::Toggle),
            Command::Retrace,
            Command::FeedOverride(Override::To(40.0)),
            Command::FeedOverride(Override::To(0.0)),
            Command::FeedOverride(Override::To(120.0)),
            Command::Stop,
            Command::Enable,
            Command::Disable,
            Command::Reset,
        ]),
        4 => select(vec![Command::Enable, Command::Reset]),
    ];
    // Not the gantry's: one side that stops alone leaves it skewed, which no reset mends.
    let disturb = (
        2..4usize,
        select(vec![
            Disturbance::Fault(ErrorClass::Warning),
            Disturbance::Fault(ErrorClass::QuickStop),
            Disturbance::Fault(ErrorClass::StopAndSwitchOff),
            Disturbance::Fault(ErrorClass::SwitchOff),
            Disturbance::LoseTPdos(1),
            Disturbance::LoseTPdos(20),
            Disturbance::Mute(true),
            Disturbance::Mute(false),
            Disturbance::Reset,
            Disturbance::Mains(false),
            Disturbance::Mains(true),
        ]),
    );
    prop_oneof![
        9 => command.prop_map(Deed::Command),
        1 => disturb.prop_map(|(drive, disturbance)| Deed::Disturb(drive, disturbance)),
    ]
}

/// What a drive's last two T_PDO2s on the bus say of its power stage, since the last one may not have been looked at;
/// of one that is silent now nothing is known.
fn last_told(rig: &mut Rig, drive: usize) -> Vec<PowerState> {
    let id = CanId::from(CobId::t_pdo(2, rig.machine.drives[drive].node));
    let now = rig.session.timeline().now();
    let frames = rig.frames();
    let told = frames
        .iter()
        .rev()
        .filter(|it| it.frame.id() == id && it.end <= now);
    let told: Vec<_> = told.take(2).collect();
    let heard = |it: &&Transmission| now < it.end + rig.machine.cycle * 2;
    let silent = !told.first().is_some_and(heard);
    let states = told.iter().map(|it| power_state(it.frame.data()[0]));
    states
        .chain(silent.then_some(PowerState::Unknown))
        .collect()
}

/// The state in the low byte of a statusword (CiA 402-2, table of the state coding).
fn power_state(low: u8) -> PowerState {
    match (low & 0x4F, low & 0x6F) {
        (0x00 | 0x40, _) => PowerState::Off,
        (_, 0x21 | 0x23) => PowerState::Ready,
        (_, 0x27) => PowerState::Enabled,
        (_, 0x07) => PowerState::QuickStop,
        (0x0F, _) => PowerState::FaultReaction,
        (0x08, _) => PowerState::Fault,
        _ => PowerState::Unknown,
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// Whatever is asked for and whatever happens, in whatever state: only legal transitions, every
    /// command answered, every drive shown as it told last, nothing moves that was not asked to, and the machine
    /// goes off in the end.
    #[test]
    fn the_session_is_always_in_a_state_and_always_answers(
        // Commands take effect at every other wake-up.
        deeds in prop::collection::vec((deed(), 2..900usize), 1..16),
    ) {
        let mut rig = Rig::staying_on("portal", &[], |_, _| ());
        lay_out_programs(&rig);
        rig.goes_on = false;
        let told = rig.session.subscribe();
        let (mut asked, mut answered) = (0, 0);
        settle(&mut rig);
        for (deed, wait) in deeds {
            asked += usize::from(matches!(deed, Deed::Command(_)));
            deed.done_to(&mut rig);
            for _ in 0..wait {
                rig.step();
                let rests = matches!(state(&rig), State::Ready | State::Disabled | State::Faulted);
                if let Some(row) = rig.session.timeline().row() && rests {
                    prop_assert_eq!(row.plan.velocity, [0.0; 9]);
                }
            }
            answered += told.events().filter(|it| matches!(it, session::Event::Accepted(_) | session::Event::Refused(_))).count();
            for drive in 0..rig.machine.drives.len() {
                let shown = rig.session.status().drives[drive];
                let told = last_told(&mut rig, drive);
                prop_assert!(told.contains(&shown), "drive {}: {} shown, {:?} told", drive, shown, told);
            }
        }
        prop_assert_eq!(answered, asked);
        go(&mut rig, Command::SwitchOff);
        while rig.step() {}
        prop_assert_eq!(state(&rig), State::Off);
        let states = [State::Starting].into_iter().chain(rig.states.iter().copied());
        let states: Vec<_> = states.collect();
        for step in states.windows(2) {
            prop_assert!(successors(step[0]).contains(&step[1]), "{:?}", states);
        }
        for refused in &rig.refused {
            if let Refusal::Machine(OrderRefusal::NotNow(NotNow { request, state })) = refused.reason {
                prop_assert!(!state.allows(request));
            }
        }
        assert_moves_within_limits(&mut rig);
    }
}
