//! Programs run and shown as text.

use std::fmt::Write;

use syncline_controller::gcode::{
    Action, Axis, AxisSet, Command, Direction, Error, Feed, Interpreter, Point, Setup,
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
    let axes = setup.axes;
    let mut text = String::new();
    for command in Interpreter::from_text("part.ngc", program, setup) {
        match command {
            Ok(Command { span, action }) => {
                writeln!(text, "{:3}: {}", span.line, show(axes, &action)).unwrap();
            }
            Err(error) => writeln!(text, "{error}").unwrap(),
        }
    }
    text
}

pub(crate) fn listing(program: &str) -> String {
    listing_with(xyz(), program)
}

fn show(axes: AxisSet, action: &Action) -> String {
    match action {
        Action::Rapid { to } => format!("rapid {}", point(axes, to)),
        Action::Feed { to, feed } => format!("feed {} {}", point(axes, to), rate(feed)),
        Action::Arc { arc, feed } => format!(
            "{} {} centre {} {} radius {} {} sweep {}° {}",
            match arc.direction() {
                Direction::Clockwise => "cw",
                Direction::Counterclockwise => "ccw",
            },
            point(axes, &arc.to),
            round(arc.center[0]),
            round(arc.center[1]),
            round(arc.start_radius),
            round(arc.end_radius),
            round(arc.sweep.to_degrees()),
            rate(feed),
        ),
        other => format!("{other:?}"),
    }
}

fn point(axes: AxisSet, point: &Point) -> String {
    let words: Vec<String> = Axis::ALL
        .into_iter()
        .filter(|axis| axes.contains(*axis))
        .map(|axis| format!("{axis}{}", round(point[axis])))
        .collect();
    words.join(" ")
}

fn rate(feed: &Feed) -> String {
    match feed {
        Feed::Rate(rate) => format!("at {}/s", round(*rate)),
        Feed::Duration(time) => format!("in {} s", round(*time)),
    }
}

/// Nine decimals at most, without a negative zero.
fn round(value: f64) -> f64 {
    (value * 1e9).round() / 1e9 + 0.0
}
