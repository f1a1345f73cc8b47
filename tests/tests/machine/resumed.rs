//! Programs that are interrupted and resumed: after a fault, after a stop, and where they are held for offsets and lines
//! that are typed in. What is left to be gone along is held against a run that nobody interrupts.

use super::day::{assert_moves_within_limits, go, mdi, positions, ready_with, settle, state};
use proptest::prelude::*;
use proptest::sample::select;
use syncline_controller::control::{
    Event, MachineFunctions, Pause, Refusal as OrderRefusal, State,
};
use syncline_controller::session::{Command, Direction, Jog, Refusal, Refused, SwitchChange};
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_gcode::{AxisLetter, Tables, Turning};
use syncline_tests::rig::Rig;

/// Where a move ends, and what is switched there.
type End = ([f64; 3], MachineFunctions);
/// All moves of a program, and in how many rows.
type Whole = (Vec<End>, usize);

const BUS: &str = "[[bus]]\nname = \"portal\"";

const RETRACTION: &str = "[retraction]\naxis = \"Z\"\nclearance = -20.0\napproach_speed = 10.0\n\n";

/// A loop, in which a line comes twice, between stops.
const PROGRAM: &str = "\
G17 G21 G90 G94 G61 F6000
M3 S500
M8 M64 P1
G0 X100 Y100
G1 Z-50
o1 repeat [2]
  X200
  Y150
  X100
  Y100
o1 endrepeat
M0
M65 P1
G2 X150 Y150 I50 J0
X100 Y100 I-50 J0
G0 Z-20
M2
";

/// A portal with a retraction and a program, which runs.
fn begun(program: &str) -> Rig {
    let file = format!("{RETRACTION}{BUS}");
    let mut rig = ready_with(&[(BUS, &file)]);
    rig.goes_on = false;
    let file = rig.folder.file("part.ngc", program);
    rig.command(Command::Load(file));
    rig.command(Command::Run { from_line: None });
    rig
}

fn setpoint(rig: &Rig) -> [f64; 3] {
    let [x, y, z, ..] = rig.session.status().setpoint;
    [x, y, z]
}

fn assert_at(rig: &Rig, expected: [f64; 3]) {
    let at = setpoint(rig);
    let near = at
        .iter()
        .zip(expected)
        .all(|(at, to)| (at - to).abs() < 0.02);
    assert!(near, "{at:?}, not {expected:?}: {:?}", rig.messages);
}

fn fail(rig: &mut Rig) {
    let y = Disturbance::Fault(ErrorClass::StopAndSwitchOff);
    rig.twin(2).disturb(y);
    settle(rig);
    assert_eq!(state(rig), State::Faulted, "{:?}", rig.events);
}

fn told(rig: &Rig) -> &str {
    &rig.messages.last().expect("a message").1
}

/// Begins what was told last, and waits until the machine rests.
fn start(rig: &mut Rig) {
    go(rig, Command::CycleStart);
}

/// What is gone along, one entry for each move: where it ends, and what is switched there.
fn moves(rig: &Rig, from: usize) -> Vec<End> {
    let rows = &rig.rows[from..];
    let on_path: Vec<_> = rows
        .iter()
        .filter(|row| row.plan.busy && !row.plan.off_path)
        .collect();
    let moves = on_path.chunk_by(|one, next| one.plan.tag == next.plan.tag);
    let ends = moves.map(|rows| {
        let row = rows[rows.len() - 1];
        let [x, y, z, ..] = row.plan.position;
        ([x, y, z], row.functions)
    });
    ends.collect()
}

#[test]
fn after_a_fault_a_program_is_resumed_in_the_midst_of_a_loop() {
    let mut rig = begun(PROGRAM);
    // In line 8 for the second time.
    rig.run_until(|rig| rig.session.status().line == 10);
    rig.run_until(|rig| rig.session.status().line == 8 && setpoint(rig)[1] > 120.0);
    fail(&mut rig);
    let stopped = rig.session.status().stopped.clone().expect("the list");
    assert_eq!(stopped.line, Some(8));
    assert_eq!(rig.session.status().interrupted, Some(8));
    go(&mut rig, Command::Reset);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    let there = setpoint(&rig);
    go(&mut rig, Command::Resume);
    assert_eq!(state(&rig), State::Held, "{:?}", rig.refused);
    let begins = told(&rig).to_owned();
    for part in [
        "begins with G1 ",
        "X200.000 Y100.000 Z-50.000 in machine coordinates; switched on the way there: the spindle, flood on, \
         M64 P1",
    ] {
        assert!(begins.contains(part), "{begins}");
    }
    assert_eq!(setpoint(&rig), there);
    assert_eq!(rig.session.status().spindle.turning, Turning::Off);
    // Up, over and down, each told before and begun by cycle start alone.
    start(&mut rig);
    assert_eq!(
        told(&rig),
        "way back: cycle start takes Z to -20.000 in machine coordinates"
    );
    assert_eq!(setpoint(&rig), there);
    assert_eq!(rig.session.status().spindle.turning, Turning::Clockwise);
    assert!(rig.session.status().coolant.flood);
    start(&mut rig);
    let over = "way back: cycle start takes X to 200.000, Y to 100.000 in machine coordinates";
    assert_eq!(told(&rig), over);
    assert_at(&rig, [there[0], there[1], -20.0]);
    start(&mut rig);
    let down = "way back: cycle start takes Z to -50.000 at 600 mm/min in machine coordinates, where the path goes on";
    assert_eq!(told(&rig), down);
    assert_at(&rig, [200.0, 100.0, -20.0]);
    let begun = rig.rows.len();
    start(&mut rig);
    // The rest of the loop, to M0.
    assert_at(&rig, [100.0, 100.0, -50.0]);
    let ends: Vec<_> = moves(&rig, begun).iter().map(|(end, _)| *end).collect();
    let expected = [
        [200.0, 100.0, -50.0],
        [200.0, 150.0, -50.0],
        [100.0, 150.0, -50.0],
        [100.0, 100.0, -50.0],
    ];
    assert_eq!(ends.len(), expected.len(), "{ends:?}");
    for (end, expected) in ends.iter().zip(expected) {
        let near = end
            .iter()
            .zip(expected)
            .all(|(at, to)| (at - to).abs() < 1.0);
        assert!(near, "{ends:?}");
    }
    let down = &rig.rows[begun..];
    let fastest = down
        .iter()
        .map(|row| row.plan.velocity[2].abs())
        .fold(0.0, f64::max);
    assert!((9.0..10.01).contains(&fastest), "{fastest}");
    start(&mut rig);
    assert_eq!(state(&rig), State::Ready);
    assert_at(&rig, [100.0, 100.0, -20.0]);
    assert_eq!(rig.session.status().interrupted, None);
    assert_eq!(rig.refused, []);
    assert_eq!(rig.problems, [""; 0]);
    assert_moves_within_limits(&mut rig);
}

#[test]
fn an_offset_and_a_tools_length_are_set_where_a_program_stops() {
    let mut rig = begun(PROGRAM);
    rig.run_until(|rig| state(rig) == State::Held);
    settle(&mut rig);
    let here = setpoint(&rig);
    let distance = 30.0;
    let (axis, speed) = (AxisLetter::Z, None);
    go(
        &mut rig,
        Command::Jog(Jog::By {
            axis,
            distance,
            speed,
        }),
    );
    rig.run_until(|rig| rig.rows.last().is_some_and(|row| row.plan.speed == 0.0));
    let away = setpoint(&rig);
    assert!((away[2] - here[2] - 30.0).abs() < 1e-6);
    let switched = rig.session.status().spindle;
    go(
        &mut rig,
        Command::SetWorkOffset(positions([(AxisLetter::X, 90.0)])),
    );
    // It is in the tables, nothing has moved, and the program waits.
    assert_eq!(rig.refused, []);
    assert_eq!(state(&rig), State::Held);
    assert!(rig.events.contains(&Event::SetAside), "{:?}", rig.events);
    assert_eq!(setpoint(&rig), away);
    assert_eq!(rig.session.status().spindle, switched, "it goes on");
    let file = Tables::beside(&rig.folder.path("machine.toml"));
    let offset = Tables::load(&file).expect("they are written").work_offsets[0][AxisLetter::X];
    assert!((offset - 10.0).abs() < 1e-6, "{offset}");
    // Codes live from one line to the next; a measuring hand wants the spindle off.
    mdi(&mut rig, "G91 M5");
    mdi(&mut rig, "G0 Y5");
    assert_eq!(rig.session.status().spindle.turning, Turning::Off);
    assert_at(&rig, [here[0], here[1] + 5.0, away[2]]);
    mdi(&mut rig, "M64 P5");
    // What is held is not what goes on by itself.
    go(&mut rig, Command::Retrace);
    let refused = rig.refused.pop().expect("nothing leads back");
    assert_eq!(refused.reason, Refusal::Machine(OrderRefusal::SetAside));
    go(&mut rig, Command::Run { from_line: Some(3) });
    assert_eq!(rig.refused.len(), 1, "not while it is held");
    rig.refused.clear();
    go(&mut rig, Command::CycleStart);
    let begins = told(&rig);
    assert!(
        begins.starts_with("behind it the program goes on with G1 "),
        "{begins}"
    );
    assert!(begins.contains("at X110.000 Y100.000 Z-50.000"), "{begins}");
    assert!(
        begins.contains("on the way there: the spindle, M65 P5"),
        "{begins}"
    );
    let digital = |rig: &Rig| rig.rows.last().expect("rows").functions.outputs.digital;
    assert_eq!(digital(&rig), 1 << 1 | 1 << 5, "nothing is switched");
    for leg in [
        "takes X to 110.000, Y to 100.000",
        "takes Z to -50.000 at 600 mm/min",
    ] {
        start(&mut rig);
        assert!(told(&rig).contains(leg), "{leg}: {}", told(&rig));
        assert_eq!(digital(&rig), 1 << 1, "the program's own again");
    }
    assert_eq!(rig.session.status().spindle.turning, Turning::Clockwise);
    start(&mut rig);
    assert_eq!(state(&rig), State::Ready);
    assert_at(&rig, [110.0, 100.0, -20.0]);
    assert_eq!(rig.refused, []);
    assert_eq!(rig.problems, [""; 0]);
    assert_moves_within_limits(&mut rig);
}

/// A tool that is measured where the program changes it has its length from there on.
#[test]
fn a_tool_is_measured_where_the_program_changes_it() {
    let mut rig = ready_with(&[]);
    rig.goes_on = false;
    mdi(&mut rig, "G10 L1 P1 Z0");
    let text = "G90 G0 X10 Z-30\nT1 M6 G43 H1\nG0 Z-20\nM2\n";
    let file = rig.folder.file("part.ngc", text);
    rig.command(Command::Load(file));
    rig.command(Command::Run { from_line: None });
    rig.run_until(|rig| state(rig) == State::Held);
    settle(&mut rig);
    assert_eq!(rig.session.status().tool, 1);
    go(
        &mut rig,
        Command::SetToolLength(positions([(AxisLetter::Z, -5.0)])),
    );
    assert_eq!(rig.refused, []);
    let file = Tables::beside(&rig.folder.path("machine.toml"));
    let length = Tables::load(&file).expect("they are written").tools[&1].offset[AxisLetter::Z];
    assert!((length + 25.0).abs() < 1e-6, "{length}");
    go(&mut rig, Command::CycleStart);
    assert!(told(&rig).contains("nothing is switched"), "{}", told(&rig));
    start(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.messages);
    assert_at(&rig, [10.0, 0.0, -45.0]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Wrong lines where a program is held change nothing of what is in effect there, and what a person is sent to by the
    /// program's coordinates is there; nothing of it is left once the hold is.
    #[test]
    fn a_wrong_line_in_a_hold_changes_nothing(
        codes in prop::sample::subsequence(vec!["G55", "G18", "G61", "G91.1", "G52 X1", "G92 Y3", "S300"], 0..=7),
        wrong in prop::collection::vec(select(vec!["G1 X", "G1 X9999 F100", "Q1", "G0 X[1/0]", "G2 X1 Y1 R0"]), 1..4),
        disables: bool,
    ) {
        let program = format!("G10 L2 P2 X10 Y5\nG21 G90 F1200\n{}\nG1 X60 Y20\nX61\nM0\nG1 X62\nM2\n", codes.join("\n"));
        let mut rig = begun(&program);
        settle(&mut rig);
        prop_assert_eq!(state(&rig), State::Held, "{:?}", rig.events);
        let shown = |rig: &Rig| {
            let status = rig.session.status();
            (status.modes.clone(), status.offset, status.rotation)
        };
        let (held, here) = (shown(&rig), rig.session.status().work_position()[0]);
        for line in wrong {
            mdi(&mut rig, line);
            prop_assert_eq!(state(&rig), State::Held, "{}", line);
            prop_assert_eq!(&shown(&rig), &held, "{}", line);
        }
        let mut to = [None; 9];
        to[0] = Some(here + 5.0);
        rig.command(Command::GoTo(to));
        for _ in 0..20 {
            rig.step();
        }
        let misspelt = |it: &Refused| matches!(it.reason, Refusal::Misspelt(_));
        prop_assert!(rig.refused.iter().all(misspelt), "{:?}", rig.refused);
        rig.run_until(|rig| rig.rows.last().is_some_and(|row| row.plan.velocity == [0.0; 9]));
        for _ in 0..100 {
            rig.step();
        }
        let at = rig.session.status().work_position()[0];
        prop_assert!((at - here - 5.0).abs() < 0.02, "{at} behind {here}");
        if disables {
            go(&mut rig, Command::Disable);
            go(&mut rig, Command::Enable);
            prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
            let left = shown(&rig);
            mdi(&mut rig, "(MSG, nothing)");
            prop_assert_eq!(shown(&rig), left);
        }
    }
}

#[test]
fn what_cannot_be_left_or_resumed_says_so() {
    let mut rig = begun(PROGRAM);
    rig.run_until(|rig| setpoint(rig)[0] > 120.0);
    go(&mut rig, Command::FeedHold);
    // While an axis is jogged nothing else begins.
    let (axis, direction, speed) = (AxisLetter::Z, Direction::Positive, None);
    rig.command(Command::Jog(Jog::Continuous {
        axis,
        direction,
        speed,
    }));
    for _ in 0..20 {
        rig.step();
    }
    rig.command(Command::Mdi("M5".to_owned()));
    for _ in 0..6 {
        rig.step();
    }
    let refused = rig.refused.pop().expect("an axis moves");
    assert_eq!(refused.reason, Refusal::Machine(OrderRefusal::Moving));
    rig.run_until(|rig| {
        rig.rows
            .last()
            .is_some_and(|row| row.plan.velocity == [0.0; 9])
    });
    settle(&mut rig);
    // A wrong line is told, and the program still waits.
    mdi(&mut rig, "G1 X9999 F100");
    assert_eq!(state(&rig), State::Held);
    assert_eq!(rig.problems.len(), 1);
    // Lines that are held themselves are not left.
    mdi(&mut rig, "M0");
    mdi(&mut rig, "M5");
    let refused = rig.refused.pop().expect("lines are held");
    assert_eq!(refused.reason, Refusal::Machine(OrderRefusal::LinesHeld));
    go(&mut rig, Command::CycleStart);
    // A program that was changed is not resumed anywhere; it can be once it is as it was.
    let line = rig.session.status().interrupted;
    let spindle = rig.session.status().spindle;
    let _ = rig.folder.file(
        "part.ngc",
        &PROGRAM.replace("G1 Z-50", "(one)\n(more)\nG1 Z-50"),
    );
    go(&mut rig, Command::Resume);
    let problem = rig.problems.last().expect("it is another one");
    assert!(
        problem.contains("does not come to line 7 as it did"),
        "{problem}"
    );
    assert_eq!(state(&rig), State::Held, "it waits on");
    assert_eq!(rig.session.status().spindle, spindle);
    assert_eq!(rig.session.status().interrupted, line);
    let _ = rig.folder.file("part.ngc", PROGRAM);
    go(&mut rig, Command::Resume);
    assert!(
        rig.messages.last().is_some_and(|(line, _)| *line == 7)
            && told(&rig).starts_with("begins with"),
        "{}",
        told(&rig)
    );
    // A stop gives it up, but for who resumes it once more.
    go(&mut rig, Command::Stop);
    assert_eq!(
        (state(&rig), rig.session.status().interrupted),
        (State::Ready, Some(7))
    );
    go(&mut rig, Command::Run { from_line: None });
    assert_eq!(rig.session.status().interrupted, None);
}

#[test]
fn a_stop_where_lines_are_typed_switches_off() {
    let mut rig = begun(PROGRAM);
    rig.run_until(|rig| setpoint(rig)[0] > 120.0);
    go(&mut rig, Command::FeedHold);
    mdi(&mut rig, "M64 P3");
    assert_eq!(rig.session.status().spindle.turning, Turning::Clockwise);
    let there = setpoint(&rig);
    go(&mut rig, Command::Stop);
    assert_eq!(state(&rig), State::Ready);
    assert_eq!(rig.session.status().spindle.turning, Turning::Off);
    for _ in 0..4 {
        rig.step();
    }
    assert_eq!(rig.rows.last().expect("rows").functions.outputs.digital, 0);
    assert_eq!(setpoint(&rig), there);
}

/// What is held is resumed, also where another program has been loaded meanwhile, which is run behind it.
#[test]
fn what_is_held_outlasts_another_program_that_is_loaded() {
    let mut rig = begun(PROGRAM);
    rig.run_until(|rig| setpoint(rig)[0] > 120.0);
    go(&mut rig, Command::FeedHold);
    mdi(&mut rig, "M64 P3");
    let line = rig.session.status().interrupted;
    let other = rig.folder.file("other.ngc", "G21 G90 G0 X20\nM2\n");
    go(&mut rig, Command::Load(other));
    assert_eq!(rig.session.status().interrupted, line);
    go(&mut rig, Command::Resume);
    assert!(told(&rig).contains("begins with"), "{}", told(&rig));
    settle_through(&mut rig);
    assert_eq!(state(&rig), State::Ready);
    assert_eq!(rig.problems, [""; 0]);
    assert_eq!(rig.session.status().interrupted, None);
    go(&mut rig, Command::Run { from_line: None });
    assert_eq!((state(&rig), setpoint(&rig)[0]), (State::Ready, 20.0));
}

/// Blocks that end on a grid of 5 mm in X and Y, at least 20 mm away from where they begin.
#[derive(Clone, Debug)]
enum Piece {
    Line(bool, i32, i32),
    Arc(bool, i32),
    Down(i32),
    Drill,
    Loop(u32, i32),
    Pocket,
    Code(&'static str),
}

fn piece() -> impl Strategy<Value = Piece> {
    let way = || select(&[-40, -20, 20, 25, 40][..]);
    let codes = [
        "M64 P1",
        "M65 P1",
        "M62 P2",
        "M63 P2",
        "M68 E1 Q2",
        "M67 E1 Q3",
        "M3 S400",
        "M4 S200",
        "M5",
        "M7",
        "M8",
        "M9",
        "G4 P0.05",
        "M0",
        "M1",
        "T2 M6",
    ];
    prop_oneof![
        6 => (any::<bool>(), way(), way()).prop_map(|(rapid, x, y)| Piece::Line(rapid, x, y)),
        2 => (any::<bool>(), way()).prop_map(|(clockwise, x)| Piece::Arc(clockwise, x)),
        2 => select(&[-40, -20, -60][..]).prop_map(Piece::Down),
        1 => Just(Piece::Drill),
        2 => (2..4_u32, way()).prop_map(|(times, x)| Piece::Loop(times, x)),
        1 => Just(Piece::Pocket),
        5 => select(codes.to_vec()).prop_map(Piece::Code),
    ]
}

/// The program of pieces: in lines of their own, in the middle of the portal.
fn program(pieces: &[Piece]) -> String {
    let mut text = String::from("G17 G21 G90 G94 G61 F9000\nG0 X300 Y300 Z-20\nG91\n");
    for (number, piece) in pieces.iter().enumerate() {
        text += &match *piece {
            Piece::Line(true, x, y) => format!("G0 X{x} Y{y}\n"),
            Piece::Line(false, x, y) => format!("G1 X{x} Y{y}\n"),
            Piece::Arc(clockwise, x) => {
                let code = if clockwise { "G2" } else { "G3" };
                format!("{code} X{x} I{}\n", f64::from(x) / 2.0)
            }
            Piece::Down(z) => format!("G90 G1 Z{z}\nG91\n"),
            Piece::Drill => "G90 G0 Z-20\nG91 G99 G81 X20 R-10 Z-20 L2\nG80\n".to_owned(),
            Piece::Loop(times, x) => {
                format!(
                    "o{number} repeat [{times}]\nG1 X{x} Y20\nM64 P4\nY-20\no{number} endrepeat\n"
                )
            }
            Piece::Pocket => {
                "G41.1 D6\nG1 X20\nX30\nY30\nX-30\nG40 G1 X5 Y-15\nX-5 Y-15\n".to_owned()
            }
            Piece::Code(code) => format!("{code}\n"),
        };
    }
    text + "G90 G0 Z-20\nM2\n"
}

/// All that a program does if nobody interrupts it, and in how many rows; where it goes out of the portal, `None`.
fn whole(text: &str) -> Option<Whole> {
    let mut rig = begun(text);
    rig.goes_on = true;
    rig.run_until(|rig| state(rig) == State::Running || !rig.problems.is_empty());
    settle_through(&mut rig);
    let problem = rig.problems.first();
    assert!(
        problem.is_none_or(|it| it.contains("soft limit")),
        "{problem:?}\n{text}"
    );
    problem.is_none().then(|| (moves(&rig, 0), rig.rows.len()))
}

/// The program again, up to an instant of it; how many of its moves are done then.
fn up_to(text: &str, whole: &Whole, at: f64) -> (Rig, usize) {
    let mut rig = begun(text);
    rig.goes_on = true;
    rig.run_until(|rig| state(rig) == State::Running);
    let first = rig.rows.len();
    let last = first + (at * whole.1 as f64) as usize;
    rig.run_until(|rig| rig.rows.len() > last || state(rig) == State::Ready);
    rig.goes_on = false;
    (rig, first)
}

/// How many of the moves are done.
fn done(rig: &Rig, first: usize, whole: &[End]) -> usize {
    let begun = moves(rig, first).len();
    let Some(before) = begun.checked_sub(1) else {
        return 0;
    };
    let at = setpoint(rig);
    let ends = whole[before]
        .0
        .iter()
        .zip(at)
        .all(|(end, at)| (end - at).abs() < 0.5);
    before + usize::from(ends)
}

/// Goes on at every stop until the program is over.
fn settle_through(rig: &mut Rig) {
    loop {
        settle(rig);
        match state(rig) {
            State::Held => rig.command(Command::CycleStart),
            _ => return,
        }
        rig.step();
        rig.step();
    }
}

fn same(one: &[f64; 3], other: &[f64; 3], shift: [f64; 3]) -> bool {
    let mut axes = one.iter().zip(other).zip(shift);
    axes.all(|((one, other), shift)| (one - other - shift).abs() < 1.0)
}

/// The rest of a program behind a resumption is the rest of the whole one, from a move that was not completed
/// on, up to `shift`.
fn assert_rest(rig: &Rig, from: usize, whole: &[End], done: usize, shift: [f64; 3]) {
    // A leg ends where a move may end that is missing: it is none of the path's.
    let told = rig.messages.iter();
    let legs = told
        .filter(|(_, text)| text.starts_with("way back"))
        .count();
    let rest = moves(rig, from);
    let of = |first: usize| {
        let left = &whole[first..];
        let skipped = rest.len().checked_sub(left.len())?;
        let mut both = rest[skipped..].iter().zip(left);
        let same = both.all(|((at, now), (end, then))| {
            let then = MachineFunctions {
                line: now.line,
                ..*then
            };
            same(at, end, shift) && *now == then
        });
        (same && skipped == legs).then_some(first)
    };
    let found = (0..=done.min(whole.len())).rev().find_map(of);
    assert!(
        found.is_some_and(|first| first + 2 >= done),
        "resumed from move {found:?} of {}, {done} were done:\n{rest:?}\n{whole:?}\n{:?}\n{:?}",
        whole.len(),
        rig.messages,
        rig.problems
    );
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 20, ..ProptestConfig::with_cases(5) })]

    /// Wherever a fault comes, and wherever the axes are taken behind it: what is resumed is what was left, with all that
    /// is switched, and nothing of the path is left out.
    #[test]
    fn what_a_fault_has_left_is_gone_along(
        pieces in prop::collection::vec(piece(), 1..10),
        at in 0.0..1.0_f64,
        jogs in prop::collection::vec((select(&[AxisLetter::X, AxisLetter::Y, AxisLetter::Z][..]), -15.0..15.0_f64), 0..3),
    ) {
        let text = program(&pieces);
        let Some(whole) = whole(&text) else { return Ok(()) };
        let (mut rig, first) = up_to(&text, &whole, at);
        if state(&rig) == State::Ready {
            return Ok(());
        }
        let done = done(&rig, first, &whole.0);
        fail(&mut rig);
        go(&mut rig, Command::Reset);
        prop_assert_eq!(state(&rig), State::Ready);
        for (axis, distance) in jogs {
            let speed = None;
            go(&mut rig, Command::Jog(Jog::By { axis, distance, speed }));
        }
        prop_assert!(rig.session.status().interrupted.is_some(), "{:?}", rig.events);
        go(&mut rig, Command::Resume);
        prop_assert_eq!(state(&rig), State::Held, "{:?} {:?}", &rig.refused, &rig.problems);
        let begun = rig.rows.len();
        settle_through(&mut rig);
        prop_assert_eq!(state(&rig), State::Ready);
        prop_assert!(rig.problems.is_empty(), "{:?}\n{}", &rig.problems, text);
        assert_rest(&rig, begun, &whole.0, done, [0.0; 3]);
        assert_moves_within_limits(&mut rig);
    }

    /// Wherever a program is held, wherever the axes are taken and whatever is typed there: nothing moves but what a line
    /// moves, and what is resumed is what was left, moved by the offset that was set, with all that the program itself
    /// has switched.
    #[test]
    fn what_is_held_for_typed_lines_is_gone_along_behind_them(
        pieces in prop::collection::vec(piece(), 1..10),
        at in 0.0..1.0_f64,
        deeds in prop::collection::vec(typed(), 1..5),
    ) {
        let text = program(&pieces);
        let Some(whole) = whole(&text) else { return Ok(()) };
        let (mut rig, first) = up_to(&text, &whole, at);
        go(&mut rig, Command::FeedHold);
        // With the first of a motion the path rests, and comes to rest once more.
        for _ in 0..100 {
            rig.step();
        }
        if state(&rig) != State::Held {
            return Ok(());
        }
        let done = done(&rig, first, &whole.0);
        let mut offset = None;
        let mut lines = 0;
        for deed in deeds {
            let before = setpoint(&rig);
            match deed {
                Typed::Jog(axis, distance) => {
                    let speed = None;
                    go(&mut rig, Command::Jog(Jog::By { axis, distance, speed }));
                    rig.run_until(|rig| rig.rows.last().is_some_and(|row| row.plan.velocity == [0.0; 9]));
                    settle(&mut rig);
                }
                Typed::Offset(axis, by) => {
                    let was = offset_of(&rig);
                    let i = axis.index();
                    go(&mut rig, Command::SetWorkOffset(positions([(axis, before[i] - was[i] - by)])));
                    // Inside of a compensated contour it is refused, as in any program.
                    if rig.problems.is_empty() {
                        // Where no move of the line's led, it is measured to a micrometre.
                        let set = offset_of(&rig);
                        let near = |at: usize| (set[at] - was[at] - if at == i { by } else { 0.0 }).abs() < 2e-3;
                        prop_assert!((0..3).all(near), "{:?} {:?} {}", set, was, by);
                        offset = Some(set);
                    }
                    prop_assert_eq!(setpoint(&rig), before);
                    lines += 1;
                }
                Typed::Line(text, moves) => {
                    mdi(&mut rig, text);
                    prop_assert!(moves || setpoint(&rig) == before, "{}", text);
                    lines += 1;
                }
            }
            rig.problems.clear();
            prop_assert_eq!(state(&rig), State::Held, "{:?} {:?}", &rig.events, &rig.refused);
        }
        prop_assert!(rig.refused.is_empty(), "{:?}", &rig.refused);
        let begun = rig.rows.len();
        settle_through(&mut rig);
        prop_assert_eq!(state(&rig), State::Ready);
        let shift = offset.unwrap_or_default();
        // Its first line leads on from the offset's own place.
        if rig.problems.is_empty() && lines > 0 {
            assert_rest(&rig, begun, &whole.0, done, shift);
        }
        assert_moves_within_limits(&mut rig);
    }
}

/// What an operator does where a program is held.
#[derive(Clone, Debug)]
enum Typed {
    Jog(AxisLetter, f64),
    Offset(AxisLetter, f64),
    /// A line, and whether it moves.
    Line(&'static str, bool),
}

fn typed() -> impl Strategy<Value = Typed> {
    let axis = || select(&[AxisLetter::X, AxisLetter::Y, AxisLetter::Z][..]);
    let lines = [
        ("M5", false),
        ("M3 S300", false),
        ("M9", false),
        ("M7", false),
        ("M64 P1", false),
        ("M65 P1", false),
        ("M68 E1 Q1", false),
        ("G90", false),
        ("G91", false),
        ("G20", false),
        ("G1 X", false),
        ("G4 P0.1", false),
        ("(MSG, here)", false),
        ("G53 G0 Z-10", true),
        ("G91 G0 X3", true),
    ];
    prop_oneof![
        2 => (axis(), -10.0..10.0_f64).prop_map(|(axis, by)| Typed::Jog(axis, by)),
        2 => (axis(), -8.0..8.0_f64).prop_map(|(axis, by)| Typed::Offset(axis, by)),
        4 => select(lines.to_vec()).prop_map(|(line, moves)| Typed::Line(line, moves)),
    ]
}

/// G54, as it is in the tables.
fn offset_of(rig: &Rig) -> [f64; 3] {
    let file = Tables::beside(&rig.folder.path("machine.toml"));
    let tables = Tables::load(&file).expect("good tables");
    [AxisLetter::X, AxisLetter::Y, AxisLetter::Z].map(|axis| tables.work_offsets[0][axis])
}

/// What is misspelt is refused, and the program that is held goes on from where it is, as if nothing had been typed.
#[test]
fn a_misspelt_line_leaves_what_is_held() {
    for line in [
        "G1 X",
        "G1 X1..2",
        "G1 X1 X2",
        "G77",
        "M64 P1\nG1 Y",
        "(open",
        "G0 G1 X5",
    ] {
        let mut rig = Rig::staying_on("portal", &[], |_, _| ());
        settle(&mut rig);
        let file = rig.folder.file("part.ngc", "G21 G90\nG1 X50 F3000\nM2\n");
        go(&mut rig, Command::Load(file));
        rig.command(Command::Run { from_line: None });
        rig.run_until(|rig| rig.session.status().setpoint[0] > 20.0);
        go(&mut rig, Command::FeedHold);
        let here = setpoint(&rig);
        go(&mut rig, Command::Mdi(line.to_owned()));
        let refused = rig.refused.pop().map(|it| it.reason.to_string());
        assert!(
            refused.as_ref().is_some_and(|it| it.contains("as before")),
            "{line}: {refused:?}"
        );
        assert_eq!(state(&rig), State::Held);
        assert!(!rig.events.contains(&Event::SetAside), "{line}");
        rig.command(Command::Resume);
        let mut least = f64::INFINITY;
        rig.run_until(|rig| {
            least = least.min(rig.session.status().setpoint[0]);
            state(rig) == State::Ready
        });
        assert!(least >= here[0] - 1e-6, "{line}: {least} of {here:?}");
        assert_eq!(setpoint(&rig)[0], 50.0);
    }
}

/// A stop that a retrace has taken back is still to come, also behind lines that are typed in meanwhile.
#[test]
fn a_stop_that_was_taken_back_comes_behind_typed_lines() {
    for beginning in ["", "G1 X5\n"] {
        for stop in ["M0", "M6 T1", "M1"] {
            for at_once in [true, false] {
                let program = format!("G21 G90 F3000\n{beginning}{stop}\nG1 X10\nM2\n");
                let mut rig = begun(&program);
                rig.command(Command::OptionalStop(SwitchChange::To(true)));
                settle(&mut rig);
                assert_eq!(state(&rig), State::Held, "{program}{:?}", rig.events);
                rig.command(Command::Retrace);
                if at_once {
                    rig.command(Command::FeedHold);
                }
                settle(&mut rig);
                mdi(&mut rig, "G4 P0.1");
                let since = rig.events.len();
                go(&mut rig, Command::Resume);
                for _ in 0..6 {
                    go(&mut rig, Command::CycleStart);
                    let told = |event: &Event| matches!(event, Event::Paused { reason, .. } if *reason != Pause::Beginning && *reason != Pause::NextLeg);
                    if rig.events[since..].iter().any(told) {
                        break;
                    }
                    assert_eq!(state(&rig), State::Held, "{program}{:?}", rig.events);
                }
            }
        }
    }
}
