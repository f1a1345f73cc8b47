//! The line that is shown is that of the block at work, also where the path takes many blocks for one
//! curve; a single block and a retrace are one block there, and what begins again at the line leaves
//! nothing uncut.

use proptest::prelude::*;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use syncline_controller::control::{Event, Hold, Layout, Waiting};
use syncline_controller::machine::Machine;
use syncline_controller::observe::Observers;
use syncline_controller::program::Program;
use syncline_controller::run::Progress;
use syncline_controller::run::virtual_time::VirtualMachine;
use syncline_controller::session::{Command, Session, SwitchChange};
use syncline_tests::command::Folder;
use syncline_tests::rig::Rig;

type Point = [f64; 2];

fn distance(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Of a point from a stretch.
fn apart(point: Point, [a, b]: [Point; 2]) -> f64 {
    let side = [b[0] - a[0], b[1] - a[1]];
    let square = side[0] * side[0] + side[1] * side[1];
    let along = (point[0] - a[0]) * side[0] + (point[1] - a[1]) * side[1];
    let part = if square > 0.0 {
        (along / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    distance(point, [a[0] + part * side[0], a[1] + part * side[1]])
}

/// A contour in short segments, a line of the program each, from the line [`FIRST`] on.
#[derive(Debug)]
struct Contour {
    program: String,
    points: Vec<Point>,
}

/// The line of the first segment.
const FIRST: u32 = 4;

impl Contour {
    fn new(mode: &str, feed: u32, points: Vec<Point>) -> Self {
        let [x, y] = points[0];
        let mut program = format!("{mode}\nG0 X{x:.4} Y{y:.4}\nF{feed}\n");
        for [x, y] in &points[1..] {
            let _ = writeln!(program, "G1 X{x:.4} Y{y:.4}");
        }
        program += "M2\n";
        Self { program, points }
    }

    /// A circle of that many segments.
    fn circle(mode: &str, radius: f64, segments: u32) -> Self {
        let point = |k: u32| {
            let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / f64::from(segments)).sin_cos();
            [100.0 + radius * cos, 100.0 + radius * sin]
        };
        Self::new(mode, 3000, (0..=segments).map(point).collect())
    }

    /// The segment of a line.
    fn segment(&self, line: u32) -> [Point; 2] {
        let index = (line.max(FIRST) - FIRST) as usize;
        let index = index.min(self.points.len() - 2);
        [self.points[index], self.points[index + 1]]
    }

    /// How far along the contour a segment begins, and one ends.
    fn lengths(&self, line: u32) -> [f64; 2] {
        let index = (line.max(FIRST) - FIRST) as usize;
        let length = |to: usize| -> f64 {
            let points = &self.points[..=to.min(self.points.len() - 1)];
            points
                .windows(2)
                .map(|pair| distance(pair[0], pair[1]))
                .sum()
        };
        [length(index), length(index + 1)]
    }
}

/// Where a run cut, and the line that it showed in the end.
struct Cut {
    stretches: Vec<[Point; 2]>,
    line: u32,
    /// Rows in which the path dwelt, and the line that each showed.
    dwells: Vec<(usize, u32)>,
}

impl Cut {
    fn length(&self) -> f64 {
        self.stretches.iter().map(|[a, b]| distance(*a, *b)).sum()
    }

    /// How far a point is from what was cut.
    fn left_at(&self, point: Point) -> f64 {
        let stretches = self.stretches.iter();
        stretches
            .map(|it| apart(point, *it))
            .fold(f64::INFINITY, f64::min)
    }
}

/// Runs a program from a line on, and stops it after so many rows.
fn cut(machine: &Machine, file: &Path, program: &Path, from: Option<u32>, rows: usize) -> Cut {
    let layout = Arc::new(Layout::new(machine).expect("it fits"));
    let program = Program::new(program, machine, file)
        .expect("no tables")
        .from_line(from);
    let (timeline, moves) =
        VirtualMachine::new(machine, Arc::clone(&layout), program, 0).expect("simulated");
    let observers = Observers::new(machine, None, None, false);
    let mut session = Session::new(&layout, timeline, moves, observers);
    let operator = session.operator("test");
    let (mut seen, mut last, mut stretches) = (0, None, Vec::new());
    let mut dwells = Vec::new();
    while session.advance() != Progress::Ended {
        let Some(row) = session.timeline().row() else {
            continue;
        };
        seen += 1;
        let dwells_now = matches!(row.waiting, Some(Waiting::Dwell { .. }));
        let [x, y, ..] = row.plan.position;
        let cuts = row.plan.feed.is_finite();
        if let Some(last) = last.replace([x, y])
            && cuts
        {
            stretches.push([last, [x, y]]);
        }
        if dwells_now {
            dwells.push((seen, session.status().line));
        }
        if seen == rows {
            operator.command(Command::Stop).expect("there is room");
        }
    }
    let line = session.status().line;
    Cut {
        stretches,
        line,
        dwells,
    }
}

fn files(folder: &Folder, program: &str) -> (Machine, PathBuf, PathBuf) {
    let file = folder.machine("portal");
    let machine = Machine::load(&file).expect("an example");
    (machine, file, folder.file("p.ngc", program))
}

/// Stops a run there, begins again at the line that was shown then, and looks for what is left of the
/// contour.
fn assert_nothing_uncut(contour: &Contour, stop: usize, tolerance: f64) {
    let folder = Folder::new();
    let (machine, file, program) = files(&folder, &contour.program);
    let mut done = cut(&machine, &file, &program, None, stop);
    let line = done.line;
    if line < FIRST {
        return;
    }
    let rest = cut(&machine, &file, &program, Some(line), usize::MAX);
    done.stretches.extend(rest.stretches);
    for pair in contour.points.windows(2) {
        let parts = (distance(pair[0], pair[1]) / 0.2).ceil().max(1.0);
        for k in 0..=parts as u32 {
            let part = f64::from(k) / parts;
            let point = [0, 1].map(|i| pair[0][i] + part * (pair[1][i] - pair[0][i]));
            let left = done.left_at(point);
            assert!(
                left <= tolerance,
                "{left} mm at {point:?}: stopped in row {stop}, begun again at line {line}\n{}",
                contour.program
            );
        }
    }
}

/// Contours that are merged to lines, fitted by curves, rounded, and all of it.
fn contours() -> impl Strategy<Value = (Contour, f64)> {
    let segments = prop::collection::vec((-0.35..0.35_f64, 0.05..2.0_f64), 30..150);
    let modes = prop_oneof![
        (0.01..0.2_f64).prop_map(|p| (format!("G64 P{p:.3}"), p)),
        (0.01..0.1_f64, 0.005..0.1_f64).prop_map(|(p, q)| (format!("G64 P{p:.3} Q{q:.3}"), p + q)),
        Just(("G61".to_owned(), 0.001)),
    ];
    (segments, modes, 600u32..12_000).prop_map(|(segments, (mode, tolerance), feed)| {
        let (mut at, mut heading) = ([300.0, 300.0], 0.0_f64);
        let mut points = vec![at];
        for (turn, length) in segments {
            heading += turn;
            let (sin, cos) = heading.sin_cos();
            at = [at[0] + length * cos, at[1] + length * sin];
            points.push(at.map(|it| (it * 1e4).round() / 1e4));
        }
        (Contour::new(&mode, feed, points), tolerance)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 30, failure_persistence: None, ..ProptestConfig::with_cases(4) })]

    /// A stop anywhere, then a beginning at the line that was shown, leaves nothing uncut.
    #[test]
    fn what_begins_at_the_line_shown_leaves_nothing_uncut(
        (contour, tolerance) in contours(), part in 0.0..1.0_f64,
    ) {
        let length = contour.lengths(u32::MAX / 2)[0];
        // About as many rows as it takes, behind the way to the contour's start.
        let rows = 600 + (part * 1.2 * length / 0.05) as usize;
        // And what lies between two rows.
        assert_nothing_uncut(&contour, rows, tolerance + 0.03);
    }

    /// The setpoint is on the segment of the line that is shown, as near to it as the tolerance says; and lines
    /// come in their order.
    #[test]
    fn the_line_shown_is_that_of_the_block_at_work((contour, tolerance) in contours()) {
        let mut rig = Rig::portal(&contour.program);
        let mut shown = 0;
        while rig.step() {
            let line = rig.session.status().line;
            let Some(row) = rig.rows.last() else { continue };
            if !row.plan.feed.is_finite() || row.plan.speed == 0.0 || line < FIRST {
                continue;
            }
            let [x, y, ..] = row.plan.position;
            // In a rounding it is beside either.
            let near = [line, line + 1].map(|line| contour.segment(line));
            let off = near.map(|segment| apart([x, y], segment));
            let off = off[0].min(off[1]);
            prop_assert!(off <= 2.0 * tolerance + 1e-6, "{off} mm off line {}", line);
            prop_assert!(line >= shown, "{} behind {shown}", line);
            shown = line;
        }
        prop_assert!(shown + 2 >= FIRST + contour.points.len() as u32 - 1, "ends at {shown}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 30, failure_persistence: None, ..ProptestConfig::with_cases(4) })]

    /// A single block rests where one ends, also where that is in a rounding or on a curve that stands for many: as near to it
    /// as the tolerance says.
    #[test]
    fn a_single_block_rests_where_one_ends((contour, tolerance) in contours()) {
        let mut rig = Rig::portal(&contour.program);
        rig.goes_on = false;
        rig.command(Command::SingleBlock(SwitchChange::To(true)));
        let mut count = 0;
        while rig.step() {
            if rests(&rig) == count {
                continue;
            }
            count += 1;
            rig.command(Command::Resume);
            let Some(row) = rig.rows.last() else { continue };
            let [x, y, ..] = row.plan.position;
            let off = contour.points.iter().map(|point| distance(*point, [x, y]));
            let off = off.fold(f64::INFINITY, f64::min);
            prop_assert!(off <= 2.0 * tolerance + 1e-6, "rest {count}: {off} mm from the end of a block");
        }
        prop_assert!((contour.points.len() / 2..=contour.points.len()).contains(&count), "{count} rests");
    }

    /// What is switched behind a block is switched as the path goes on from a single block's rest there, in the middle of a
    /// rounding as at a stop.
    #[test]
    fn a_single_block_rests_before_what_comes_behind_it(
        mode in prop::sample::select(&["G64 P0.02", "G64 P0.3", "G61", "G61.1"][..]),
        feed in 300..3000_u32,
        points in prop::collection::vec(prop::array::uniform2(20.0..200.0_f64), 4..9),
    ) {
        rests_before_what_comes(mode, feed, &points);
    }
}

/// Moves and all that the path rests for, in any order, from the line [`FIRST`] on.
fn resting(mode: &str, blocks: &[usize]) -> String {
    let mut program = format!("{mode}\nG0 X20 Y20\nF6000\n");
    for (number, block) in blocks.iter().enumerate() {
        let x = 20 + 10 * (number % 2);
        let _ = match block {
            0 => writeln!(program, "G1 X{x} Y{}", 21 + number),
            1 => writeln!(program, "G4 P0.03"),
            2 => writeln!(program, "M0"),
            3 => writeln!(program, "M1"),
            _ => writeln!(program, "T{} M6", number + 1),
        };
    }
    program + "M2\n"
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 30, failure_persistence: None, ..ProptestConfig::with_cases(6) })]

    /// While the path rests for a block, the line shown is that block's, a dwell's as that of a stop: so each line is shown once, in
    /// the program's order.
    #[test]
    fn the_line_shown_at_rest_is_that_of_what_it_rests_for(
        mode in prop::sample::select(&["G64 P0.1", "G61", "G61.1"][..]),
        blocks in prop::collection::vec(0..5_usize, 2..14),
    ) {
        let mut rig = Rig::portal(&resting(mode, &blocks));
        rig.command(Command::OptionalStop(SwitchChange::To(true)));
        let mut shown = Vec::new();
        while rig.step() {
            let line = rig.session.status().line;
            if line >= FIRST && shown.last() != Some(&line) {
                shown.push(line);
            }
        }
        let lines: Vec<_> = (FIRST..FIRST + blocks.len() as u32).collect();
        prop_assert_eq!(shown, lines, "{:?}", blocks);
    }

    /// What was stopped in a dwell and begins at the line that was shown leaves nothing uncut, and cuts nothing twice.
    #[test]
    fn what_begins_at_a_dwell_goes_on_behind_the_move_before_it(
        mode in prop::sample::select(&["G64 P0.1", "G61.1"][..]),
        blocks in prop::collection::vec(0..2_usize, 3..10),
        part in 0.0..1.0_f64,
    ) {
        let folder = Folder::new();
        let (machine, file, program) = files(&folder, &resting(mode, &[&[0, 1], &blocks[..], &[0]].concat()));
        let whole = cut(&machine, &file, &program, None, usize::MAX);
        // A stop takes a row to act, and the dwell is not to be over then.
        let dwells: Vec<_> = (whole.dwells.iter())
            .filter(|(row, line)| whole.dwells.contains(&(row + 3, *line)))
            .collect();
        let (row, line) = *dwells[(part * dwells.len() as f64) as usize];
        let before = cut(&machine, &file, &program, None, row);
        prop_assert_eq!(before.line, line);
        let behind = cut(&machine, &file, &program, Some(line), usize::MAX);
        let ends = before.stretches.last().map(|it| it[1]);
        let begins = behind.stretches.first().map(|it| it[0]);
        prop_assert!(ends.zip(begins).is_none_or(|(a, b)| distance(a, b) < 0.002), "{ends:?} {begins:?}");
        for [_, point] in &whole.stretches {
            let left = before.left_at(*point).min(behind.left_at(*point));
            prop_assert!(left < 0.002, "{left} mm at {point:?} by line {line}: {blocks:?}");
        }
        let cut = before.length() + behind.length();
        prop_assert!((cut - whole.length()).abs() < 0.01, "{cut} mm of {} by line {line}: {blocks:?}", whole.length());
    }
}

fn rests_before_what_comes(mode: &str, feed: u32, points: &[[f64; 2]]) {
    /// The line of the first M-code, which another one comes two lines behind.
    const SWITCHED: u32 = 4;
    let [x, y] = points[0];
    let mut program = format!("{mode}\nG0 X{x:.3} Y{y:.3}\nF{feed}\n");
    for (number, [x, y]) in points[1..].iter().enumerate() {
        let _ = writeln!(program, "M{}\nG1 X{x:.3} Y{y:.3}", 8 + number % 2);
    }
    let mut rig = Rig::portal(&(program + "M2\n"));
    rig.goes_on = false;
    rig.command(Command::SingleBlock(SwitchChange::To(true)));
    let mut count = 0;
    while rig.step() {
        if rests(&rig) == count {
            continue;
        }
        count += 1;
        for _ in 0..20 {
            rig.step();
        }
        let switched = rig.rows.last().expect("it is at work").functions.line;
        let wanted = match count {
            1 => 0,
            _ => SWITCHED + 2 * (count as u32 - 2),
        };
        assert_eq!(switched, wanted, "rest {count}");
        rig.command(Command::Resume);
    }
    assert_eq!(count, points.len());
}

/// The end of a block in the middle of a rounding behind which no further block is known yet: it was passed, as a window was planned to
/// the rounding's end.
#[test]
fn a_single_block_passes_no_end_in_the_last_rounding_that_is_known() {
    let points = [
        [20.0, 195.227],
        [97.541, 36.979],
        [44.162, 20.0],
        [20.0, 47.814],
    ];
    rests_before_what_comes("G64 P0.3", 1681, &points);
}

/// Rests that were told.
fn rests(rig: &Rig) -> usize {
    rig.events
        .iter()
        .filter(|event| **event == Event::Held(Hold::Operator))
        .count()
}

/// A single block on a curve that stands for many goes to the end of one of them, and a retrace back to the
/// beginning of one.
#[test]
fn single_block_and_retrace_are_one_block_on_merged_lines() {
    for mode in ["G64 P0.2", "G64 P0.05 Q0.05"] {
        let contour = Contour::circle(mode, 15.0, 120);
        let mut rig = Rig::portal(&contour.program);
        rig.run_until(|rig| rig.session.status().line >= FIRST + 40);
        rig.command(Command::SingleBlock(SwitchChange::To(true)));
        rig.run_until(|rig| rests(rig) == 1);
        let place = |rig: &Rig| {
            let [x, y, ..] = rig.rows.last().expect("rows").plan.position;
            [x, y]
        };
        let ends = |rig: &Rig| {
            let nearest = contour
                .points
                .iter()
                .map(|point| distance(*point, place(rig)));
            nearest.fold(f64::INFINITY, f64::min)
        };
        assert!(
            ends(&rig) < 0.25,
            "{mode}: {} mm from the end of a block",
            ends(&rig)
        );
        let chord = distance(contour.points[0], contour.points[1]);
        for (count, command) in [
            (2, Command::Resume),
            (3, Command::Resume),
            (4, Command::Retrace),
            (5, Command::Retrace),
            (6, Command::Resume),
        ] {
            let before = (place(&rig), rig.session.status().line);
            rig.command(command.clone());
            rig.run_until(|rig| rests(rig) == count);
            let way = distance(before.0, place(&rig));
            assert!(
                (way - chord).abs() < 0.1 * chord,
                "{mode}: {command:?} went {way} mm of {chord}, from line {} to {}",
                before.1,
                rig.session.status().line
            );
        }
        rig.command(Command::SingleBlock(SwitchChange::To(false)));
        rig.command(Command::Resume);
        rig.finish();
        assert_eq!(rig.judge().verdict, "pass");
    }
}

/// However far the path goes back, it is judged against the part that it is on.
#[test]
fn a_path_that_goes_back_over_merged_lines_is_on_its_path() {
    let contour = Contour::circle("G64 P0.05 Q0.05", 40.0, 400);
    let mut rig = Rig::portal(&contour.program);
    rig.run_until(|rig| rig.session.status().line >= FIRST + 350);
    rig.command(Command::FeedHold);
    rig.run_until(|rig| rests(rig) == 1);
    for count in 2..12 {
        let line = rig.session.status().line;
        rig.command(Command::Retrace);
        rig.run_until(|rig| rests(rig) == count);
        assert!(rig.session.status().line <= line);
    }
    rig.command(Command::Resume);
    let summary = rig.judge();
    assert_eq!(summary.verdict, "pass", "{:#?}", summary.violations);
    assert!(
        summary.path.max_contour_error_mm < 0.2,
        "{:?}",
        summary.path
    );
}
