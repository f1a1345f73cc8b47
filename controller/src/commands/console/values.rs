//! What the machine does now, by name and value: the same on the screen and in lines of text.

use super::model::Model;
use crate::control::{State, Waiting};
use crate::machine::Axis;
use crate::observe::switched::{coolant_name, running};
use crate::program::counted_speed;
pub(super) use crate::program::rounded;
use crate::session::Status;
use syncline_gcode::Turning;

/// The program that is loaded.
pub(super) fn program(model: &Model) -> String {
    let file = model.status.program.as_deref();
    file.and_then(|file| file.file_name()).map_or_else(
        || "no program".to_owned(),
        |name| name.to_string_lossy().into_owned(),
    )
}

/// For how long the job has been at work, and how long it still takes, if that is known: `83.4 s, 1:11:01 h left`.
pub(super) fn time(model: &Model) -> String {
    let remaining = model.status.remaining.map(in_words);
    let remaining = remaining.map_or_else(String::new, |left| format!(", {left} left"));
    format!("{}{remaining}", in_words(model.elapsed))
}

/// A time: `83.4 s`, `12:05 min`, `1:03:20 h`.
fn in_words(seconds: f64) -> String {
    let whole = seconds.max(0.0) as u64;
    let (hours, minutes, rest) = (whole / 3600, whole / 60 % 60, whole % 60);
    match hours {
        0 if whole < 100 => format!("{seconds:.1} s"),
        0 => format!("{minutes}:{rest:02} min"),
        _ => format!("{hours}:{minutes:02}:{rest:02} h"),
    }
}

/// What the job waits for while nothing moves and no operator holds it.
pub(super) fn waiting(model: &Model) -> Option<String> {
    let waiting = model.status.waiting?;
    let inputs = &model.signals.inputs;
    Some(waiting.describe(|input| inputs.get(input).map_or("?", String::as_str)))
}

/// What an operator does to get on.
pub(super) fn way_on(model: &Model) -> &'static str {
    let status = &model.status;
    match (status.state, status.waiting) {
        (State::Held, Some(Waiting::Override(_))) => {
            "raise the override to go on, stop ends the job"
        }
        (state, _) => state.way_on(),
    }
}

/// The line of the program at work, with its text; no line is named of what was typed in.
pub(super) fn block(model: &Model) -> (Option<u32>, &str) {
    let line = model.status.line;
    match &model.status.typed {
        Some(typed) => {
            let mut lines = typed.lines();
            let text = lines.nth(line.saturating_sub(1) as usize);
            (None, text.unwrap_or_default())
        }
        None => (Some(line), model.text_of(line).unwrap_or_default()),
    }
}

/// What a fault has left that was at work and is not completed, and where `resume` takes the program up, if it does.
pub(super) fn not_completed(status: &Status) -> Option<(String, Option<String>)> {
    let line = status.stopped.as_ref()?.line?;
    Some(match &status.typed {
        Some(_) => (
            "what was typed".to_owned(),
            status.interrupted.map(|line| format!("in line {line}")),
        ),
        None => (
            format!("line {line}"),
            status.interrupted.map(|_| "there".to_owned()),
        ),
    })
}

/// How far it is, by axis, and what to: where the move ends that the axes are on, or, without one of a program ahead, how far a jog goes on;
/// nothing for those of which that is not known.
pub(super) fn distances(model: &Model) -> (&'static str, Vec<(&Axis, Option<f64>)>) {
    let status = &model.status;
    let jogs = matches!(status.state, State::Ready | State::Jogging) || status.off_path;
    let distance = |axis: &Axis| {
        let at = axis.letter.index();
        match jogs {
            true => Some(model.stopping_distance(axis)),
            false => status.target.map(|target| target[at] - status.setpoint[at]),
        }
    };
    let distances = model.axes.iter().map(|axis| (axis, distance(axis)));
    (if jogs { "stops in" } else { "to go" }, distances.collect())
}

/// Where the origin of the work coordinates is in the machine, by work offset, G92 and tool length together: axes whose origins
/// differ, and by how much X and Y are turned.
pub(super) fn offsets(model: &Model) -> String {
    let status = &model.status;
    let shifted = model.axes.iter().filter_map(|axis| {
        let offset = status.offset[axis.letter.index()];
        (offset != 0.0).then(|| format!("{}{offset:.3}", axis.letter))
    });
    let turned = (status.rotation != 0.0).then(|| format!("turned by {}°", status.rotation));
    let all: Vec<_> = shifted.chain(turned).collect();
    match all.is_empty() {
        true => "none".to_owned(),
        false => all.join(" "),
    }
}

/// Speeds, overrides, tool, spindle, coolant and switches.
pub(super) fn values(model: &Model) -> [(&'static str, String); 8] {
    let status = &model.status;
    let settings = &status.settings;
    let (speed, turns) = counted_speed(&status.velocity);
    let unit = if turns { "°/min" } else { "mm/min" };
    let programmed = match status.feed {
        Some(feed) => format!("{:.0}", feed * 60.0),
        None => "rapid".to_owned(),
    };
    let (speed, actual) = (speed * 60.0, model.speed * 60.0);
    let on = |on: bool| if on { "on" } else { "off" };
    // By G96 it is a speed with any number of places.
    let tenths = |value: f64| (value * 10.0).round() / 10.0;
    let turns = tenths(status.spindle.speed);
    let turning = match (status.spindle.turning, status.spindle.orientation) {
        (Turning::Clockwise, _) => format!("M3 S{turns}"),
        (Turning::Counterclockwise, _) => format!("M4 S{turns}"),
        (Turning::Off, Some(held)) => format!("M19 R{}", tenths(held.angle)),
        (Turning::Off, None) => "off".to_owned(),
    };
    let turns = status.spindle_actual;
    let turns = turns.map_or(String::new(), |it| format!(", turns at {:.0}", it.speed));
    let held = match model.releases {
        true => ", held on and on",
        false => ", steps only",
    };
    let (feed, rapid) = (settings.feed_override, settings.rapid_override);
    let (single, optional) = (on(settings.single_block), on(settings.optional_stop));
    [
        ("feed", format!("{programmed}  of the program")),
        ("speed", format!("{speed:.0} {unit}, actual {actual:.0}")),
        ("override", format!("feed {feed} %, rapid {rapid} %")),
        ("tool", format!("T{} {}", status.tool, status.tool_name)),
        ("spindle", turning + &turns),
        ("coolant", coolant_name(running(status.coolant)).to_owned()),
        ("jog", format!("by {} mm{held}", settings.jog_step)),
        ("stops", format!("single block {single}, M1 {optional}")),
    ]
}
