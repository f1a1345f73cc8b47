//! Programs run and shown as text.

use std::fmt::Write;

use syncline_gcode::{
    Action, AxisLetter, AxisSet, Command, Direction, Entry, Error, Feed, Interpreter, Point, Setup,
};

pub(crate) fn xyz() -> Setup {
    Setup::new(AxisSet::XYZ)
}

pub(crate) fn run_with(setup: Setup, program: &str) -> Result<Vec<Command>, Error> {
    Interpreter::from_text("part.ngc", program, setup).collect()
}

pub(crate) fn run(program: &str) -> Result<Vec<Command>, Error> {
    run_with(xyz(), program)
}

/// The refusal's message; panics if the program is not refused.
pub(crate) fn refusal_with(setup: Setup, program: &str) -> String {
    match run_with(setup, program) {
        Err(error) => error.to_string(),
        Ok(commands) => panic!("{program:?} was not refused: {commands:?}"),
    }
}

pub(crate) fn refusal(program: &str) -> String {
    refusal_with(xyz(), program)
}

/// One line a command: line of the program, action.
pub(crate) fn listing_with(setup: Setup, program: &str) -> String {
    show_all(Interpreter::from_text("part.ngc", program, setup))
}

/// Begins a program at a line: what sets that up.
pub(crate) fn begun_at(program: &mut Interpreter, line: u32) -> Result<Vec<Action>, Error> {
    let Entry {
        set_up,
        approach,
        with_motion,
        ..
    } = program.enter_at_line(line)?;
    let with_motion = with_motion.into_iter().map(Action::Output);
    Ok(set_up
        .into_iter()
        .chain(approach)
        .chain(with_motion)
        .collect())
}

/// One line an action of a line.
pub(crate) fn show_actions(line: u32, actions: &[Action]) -> String {
    let shown = |action| format!("{line:3}: {}\n", show(action));
    actions.iter().map(shown).collect()
}

/// One line a command: line of the program, its file if it is another, action.
pub(crate) fn show_all(mut program: Interpreter) -> String {
    let mut text = String::new();
    while let Some(command) = program.next() {
        match command {
            Ok(Command { span, action }) => {
                let file = match span.file {
                    0 => String::new(),
                    other => format!("{}:", program.file(other)),
                };
                writeln!(text, "{file}{:3}: {}", span.line, show(&action)).unwrap();
            }
            Err(error) => writeln!(text, "{error}").unwrap(),
        }
    }
    text
}

pub(crate) fn listing(program: &str) -> String {
    listing_with(xyz(), program)
}

fn show(action: &Action) -> String {
    match action {
        Action::Rapid { to } => format!("rapid {}", point(to)),
        Action::Feed { to, feed } => format!("feed {} {}", point(to), rate(feed)),
        Action::Arc { arc, feed } => format!(
            "{} {} centre {} {} radius {} {} sweep {}° {}",
            match arc.direction() {
                Direction::Clockwise => "cw",
                Direction::Counterclockwise => "ccw",
            },
            point(&arc.to),
            round(arc.center[0]),
            round(arc.center[1]),
            round(arc.start_radius),
            round(arc.end_radius),
            round(arc.sweep.to_degrees()),
            rate(feed),
        ),
        Action::Spline { spline, feed } => {
            let [from, a, b, c, d, to] = spline.controls().map(|point| {
                let [x, y] = point.map(round);
                format!("{x} {y}")
            });
            format!("spline {from}, {a}, {b}, {c}, {d}, {to} {}", rate(feed))
        }
        other => format!("{other:?}"),
    }
}

fn point(point: &Point) -> String {
    let words: Vec<String> = AxisLetter::ALL
        .into_iter()
        .filter(|axis| AxisSet::XYZ.contains(*axis) || point[*axis] != 0.0)
        .map(|axis| format!("{axis}{}", round(point[axis])))
        .collect();
    words.join(" ")
}

fn rate(feed: &Feed) -> String {
    match feed {
        Feed::Rate(rate) => format!("at {}/s", round(*rate)),
        Feed::Duration(time) => format!("in {} s", round(*time)),
        Feed::PerTurn { travel, turns } => {
            format!("by {} in each of {} turns/s", round(*travel), round(*turns))
        }
    }
}

/// Nine decimals at most, without a negative zero.
fn round(value: f64) -> f64 {
    (value * 1e9).round() / 1e9 + 0.0
}

/// The messages of programs that are refused, each at its `line:column`.
pub(crate) fn refusals(programs: &[(&str, &str)]) -> String {
    refusals_with(&xyz(), programs)
}

pub(crate) fn refusals_with(setup: &Setup, programs: &[(&str, &str)]) -> String {
    let mut messages = String::new();
    for (program, place) in programs {
        let message = refusal_with(setup.clone(), program);
        assert!(
            message.starts_with(&format!("part.ngc:{place}: ")),
            "{program:?} is at {place}: {message}"
        );
        messages += &message;
        messages.push('\n');
    }
    messages
}

/// Where each motion of a program leads, X Y Z.
pub(crate) fn places(setup: Setup, program: &str) -> Vec<[f64; 3]> {
    let commands = run_with(setup, program).unwrap();
    let to = commands.iter().filter_map(|command| match &command.action {
        Action::Rapid { to } | Action::Feed { to, .. } => Some(to),
        Action::Arc { arc, .. } => Some(&arc.to),
        _ => None,
    });
    to.map(|to| [AxisLetter::X, AxisLetter::Y, AxisLetter::Z].map(|axis| round(to[axis])))
        .collect()
}
