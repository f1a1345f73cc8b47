//! What stands on the console's screen: a picture of the [`Model`], drawn anew each time.
//!
//! Positions and speeds come first, then what the program does, then what happened. Everything has its
//! place from 80 columns and 24 rows on; more room shows more of the program and of the messages.

use super::model::Model;
use super::signals::DRIVES;
use super::values;
use crate::control::State;
use crate::session::Status;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Clear, Paragraph, Wrap};

/// Columns of the positions: axis, work, machine, to go with its unit.
const POSITIONS: u16 = 43;
/// From this width on the program stands beside the messages.
const WIDE: u16 = 120;
/// Columns and rows of the speeds, overrides and what else stands beside the positions.
const VALUES: u16 = 32;
const VALUE_ROWS: u16 = 8;

/// Every key, and what it does.
const KEYS: [(&str, &str); 17] = [
    (
        "Enter",
        "cycle start: go on at a stop; without a job run the program",
    ),
    ("space", "feed hold, and resume"),
    ("+ -", "feed override, by 10 %"),
    ("> <", "rapid override, by 10 %"),
    ("s", "single block on and off"),
    ("o", "optional stop on and off"),
    ("b", "retrace to the beginning of the block"),
    (
        "arrows",
        "jog X and Y by the step; held, on and on if `jog` says so",
    ),
    ("page keys", "jog Z in the same way"),
    ("[ ]", "jog step smaller, greater"),
    ("q", "stop what moves; the job is over"),
    ("e d", "enable, disable the drives"),
    ("r", "reset after a fault"),
    ("h", "home all axes"),
    (
        ":",
        "type a command: mdi G0 X5, load FILE …; Tab lists them",
    ),
    ("Ctrl-C", "stop; where nothing moves switch off"),
    ("?", "these keys, and away again"),
];

/// Draws all of it.
pub(super) fn draw(frame: &mut Frame, model: &Model) {
    let axes = model.axes.len() as u16;
    let signals = signal_rows(model, frame.area().width);
    // Beside each other, or below where there is no room for that.
    let is_narrow = frame.area().width < POSITIONS + VALUES;
    let height = match is_narrow {
        true => axes + 1 + VALUE_ROWS,
        false => (axes + 2).max(VALUE_ROWS),
    };
    let [head, body, wired, codes, block, rest, foot] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(height),
        Constraint::Length(signals.len() as u16),
        Constraint::Length(2),
        Constraint::Length(1),
        Constraint::Min(3),
        Constraint::Length(1),
    ])
    .areas(frame.area());
    let [positions, values] = match is_narrow {
        true => Layout::vertical([Constraint::Length(axes + 1), Constraint::Min(0)]),
        false => Layout::horizontal([Constraint::Length(POSITIONS), Constraint::Min(0)]),
    }
    .areas(body);
    frame.render_widget(header(model, head.width), head);
    frame.render_widget(Paragraph::new(position_rows(model)), positions);
    frame.render_widget(Paragraph::new(value_rows(model, values.width)), values);
    frame.render_widget(Paragraph::new(signals), wired);
    let modes = Paragraph::new(model.status.modes.as_str()).wrap(Wrap { trim: true });
    frame.render_widget(modes, codes);
    frame.render_widget(current_block(model), block);
    let resumed = || resumable(model).map(|line| format!("resume takes up line {line}"));
    if let Some(note) = values::waiting(model).or_else(resumed) {
        let note = format!("  {note} ");
        let width = (note.chars().count() as u16).min(block.width);
        let x = block.right() - width;
        let place = Rect { x, width, ..block };
        frame.render_widget(Clear, place);
        frame.render_widget(Line::raw(note), place);
    }
    if rest.width >= WIDE {
        let halves = [Constraint::Percentage(50), Constraint::Percentage(50)];
        let [program, messages] = Layout::horizontal(halves).areas(rest);
        draw_program(frame, model, program);
        draw_messages(frame, model, messages);
    } else {
        draw_messages(frame, model, rest);
    }
    frame.render_widget(footer(model), foot);
    if model.help {
        draw_keys(frame);
    }
}

fn bold(text: impl Into<String>) -> Span<'static> {
    Span::styled(text.into(), Style::new().add_modifier(Modifier::BOLD))
}

/// State, program and time.
fn header(model: &Model, width: u16) -> Line<'static> {
    let state = model.status.state;
    let colour = match state {
        State::Ready | State::Off | State::Disabled => Color::Reset,
        State::Faulted => Color::Red,
        State::Held | State::Stopping => Color::Yellow,
        State::Starting | State::Homing | State::Jogging | State::Mdi | State::Running => {
            Color::Green
        }
    };
    let style = Style::new()
        .fg(colour)
        .add_modifier(Modifier::BOLD | Modifier::REVERSED);
    let name = format!(" {} ", model.status.state_in_words().to_uppercase());
    let time = values::time(model);
    // Of a long name the beginning is shown; the time stays whole.
    let room = usize::from(width).saturating_sub(name.chars().count() + 2);
    let room = room.saturating_sub(time.chars().count() + 1);
    let program = shortened(&values::program(model), room);
    Line::from(vec![
        Span::styled(name, style),
        Span::raw(format!("  {program:room$} {time}")),
    ])
}

/// Where each axis is.
fn position_rows(model: &Model) -> Vec<Line<'static>> {
    let Status {
        actual, referenced, ..
    } = &model.status;
    let work = model.status.work_position();
    let (distance, distances) = values::distances(model);
    let mut rows = vec![Line::raw(format!(
        " {:>14}{:>14}{distance:>12}",
        "work", "machine"
    ))];
    for (axis, distance) in distances {
        let at = axis.letter.index();
        let unit = if axis.letter.is_linear() { "" } else { "°" };
        let distance = distance.map_or_else(
            || "–".to_owned(),
            |distance| format!("{:.3}", values::rounded(distance)),
        );
        // Where nobody knows where it is, its positions count from where it was switched on.
        let mark = if referenced[at] { ' ' } else { '?' };
        rows.push(Line::from(vec![
            bold(format!(
                " {}{mark}{:>12.3}",
                axis.name(),
                values::rounded(work[at])
            )),
            Span::raw(format!(
                "{:>14.3}{distance:>12}{unit}",
                values::rounded(actual[at])
            )),
        ]));
    }
    rows
}

/// Speeds, overrides, tool, spindle, coolant and switches.
fn value_rows(model: &Model, width: u16) -> Vec<Line<'static>> {
    let rows = values::values(model)
        .into_iter()
        .map(|(name, value)| Line::raw(shortened(&format!("{name:<9}{value}"), width.into())));
    rows.collect()
}

/// The offsets, what the drives do and what is on, a row each.
fn signal_rows(model: &Model, width: u16) -> Vec<Line<'static>> {
    let status = &model.status;
    let failed = status.drives.iter().any(|power| power.is_fault());
    let offsets = ("offsets", values::offsets(model));
    let rows = [offsets].into_iter().chain(model.signals.rows(status));
    let rows = rows.map(|(name, text)| {
        let row = Line::raw(shortened(&format!(" {name:<9}{text}"), width.into()));
        match name == DRIVES && failed {
            true => row.style(Style::new().fg(Color::Red)),
            false => row,
        }
    });
    rows.collect()
}

/// A text that ends within so many columns.
fn shortened(text: &str, width: usize) -> String {
    if text.chars().count() <= width {
        return text.to_owned();
    }
    let kept = text.chars().take(width.saturating_sub(1));
    kept.chain(['…']).collect()
}

/// The program's line with its text.
fn current_block(model: &Model) -> Line<'static> {
    let (line, text) = values::block(model);
    let line = line.map_or_else(|| "typed".to_owned(), |line| line.to_string());
    Line::from(vec![
        bold(format!(" {line:>6}  ")),
        Span::raw(text.to_owned()),
    ])
}

/// The line of the program that was interrupted, where it can be resumed now.
fn resumable(model: &Model) -> Option<u32> {
    let Status {
        state, interrupted, ..
    } = &model.status;
    interrupted.filter(|_| matches!(state, State::Ready | State::Held))
}

/// The program around its line.
fn draw_program(frame: &mut Frame, model: &Model, area: Rect) {
    let block = Block::new().borders(Borders::TOP).title(" program ");
    let rows = block.inner(area).height;
    let (at_work, _) = values::block(model);
    let line = at_work.unwrap_or_default().max(1);
    let first = line.saturating_sub(u32::from(rows / 2)).max(1);
    let lines = (first..first + u32::from(rows)).map_while(|number| {
        let text = format!(" {number:>6}  {}", model.text_of(number)?);
        Some(if at_work == Some(number) {
            Line::styled(text, Style::new().add_modifier(Modifier::REVERSED))
        } else {
            Line::raw(text)
        })
    });
    let lines: Vec<_> = lines.collect();
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// What stopped the machine, the first cause on top, then the last messages.
fn draw_messages(frame: &mut Frame, model: &Model, area: Rect) {
    let block = Block::new().borders(Borders::TOP).title(" messages ");
    let inner = block.inner(area);
    let [width, height] = [inner.width, inner.height].map(usize::from);
    let rows = |text: &String| wrapped(text, width);
    let faults: Vec<_> = model.faults().iter().map(rows).collect();
    let mut messages = model.messages.iter().rev().map(rows);
    // The first cause and what was told last have their beginnings shown however little room there is.
    let newest = messages.next().unwrap_or_default();
    let first = faults.first().map_or(0, Vec::len);
    let for_newest = newest.len().min(height.saturating_sub(first));
    let for_newest = for_newest.max(newest.len().min(height / 2));
    let mut room = height - for_newest;
    let mut red = Vec::new();
    for row in faults.into_iter().flatten() {
        if room > 0 {
            room -= 1;
            red.push(Line::styled(row, Style::new().fg(Color::Red)));
        }
    }
    let mut told = vec![newest[..for_newest].to_vec()];
    for message in messages {
        let rows = message.len().min(room);
        room -= rows;
        told.push(message[..rows].to_vec());
    }
    let told = told.into_iter().rev().flatten().map(Line::raw);
    let lines: Vec<Line> = red.into_iter().chain(told).collect();
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// The rows of a text, none wider than so many columns: words stay whole if they fit.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut rows = Vec::new();
    for line in text.lines() {
        let mut rest: Vec<char> = line.chars().collect();
        while rest.len() > width {
            let space = rest[..=width].iter().rposition(|it| *it == ' ');
            let at = space.filter(|at| *at > 0).unwrap_or(width.max(1));
            let behind = rest.split_off(at);
            rows.push(rest.into_iter().collect());
            rest = behind.into_iter().skip_while(|it| *it == ' ').collect();
        }
        rows.push(rest.into_iter().collect());
    }
    rows
}

fn footer(model: &Model) -> Line<'static> {
    match &model.prompt {
        Some(text) => Line::from(vec![bold(": "), Span::raw(text.clone()), Span::raw("▏")]),
        None => Line::styled(
            format!(" ? keys   : command   {}", values::way_on(model)),
            Style::new().add_modifier(Modifier::DIM),
        ),
    }
}

fn draw_keys(frame: &mut Frame) {
    let area = frame.area();
    let (width, height) = (72.min(area.width), (KEYS.len() as u16 + 2).min(area.height));
    let centred = Rect {
        x: (area.width - width) / 2,
        y: (area.height - height) / 2,
        width,
        height,
    };
    let keys =
        KEYS.map(|(key, what)| Line::from(vec![bold(format!(" {key:<10}")), Span::raw(what)]));
    let keys = Paragraph::new(keys.to_vec()).block(Block::bordered().title(" keys "));
    frame.render_widget(Clear, centred);
    frame.render_widget(keys, centred);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::{MeasuredSample, SpindleSample, Waiting, ZeroOverrides};
    use crate::machine::Machine;
    use crate::observe::switched::{coolant_name, running};
    use crate::session::{Settings, Squareness, Stopped};
    use proptest::prelude::*;
    use proptest::sample::select;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use syncline_drives::model::PowerState;
    use syncline_gcode::{Orientation, Turning, Way};

    /// A portal in the midst of a program.
    fn model() -> Model {
        let mut status = Status {
            state: State::Running,
            line: 3,
            time: Some(12.5),
            feed: Some(100.0),
            remaining: Some(4261.5),
            tool: 2,
            tool_name: "end mill 6 mm".to_owned(),
            program: Some("/parts/plate.ngc".into()),
            modes: "G1 G17 G21 G40 G43 G54 G90 G91.1 G94 G98 G64 P0.05 F6000 S12000 M3 M8 T2 M6"
                .to_owned(),
            settings: Settings {
                feed_override: 90.0,
                ..Settings::default()
            },
            ..Status::default()
        };
        status.actual[..3].copy_from_slice(&[1412.3456, 803.25, -71.5]);
        status.offset[..3].copy_from_slice(&[400.0, 300.0, -52.3]);
        status.velocity[0] = 90.0;
        status.setpoint = status.actual;
        let mut target = status.actual;
        target[0] -= 87.654;
        status.target = Some(target);
        status.spindle.speed = 12000.0;
        status.spindle.turning = Turning::Clockwise;
        let portal = "../examples/portal/machine.toml".as_ref();
        let mut model = Model::new(&Machine::load(portal).unwrap(), false);
        status.drives = vec![PowerState::Enabled; model.signals.drives.len()];
        model.status = status;
        (model.speed, model.elapsed) = (89.9, 83.4);
        model.take_text("G21 G90\nT2 M6\nG1 X1000 F6000\nY500\nM2\n");
        model.tell("line 2: tool change (M6): load tool 2".to_owned());
        model.tell("going on".to_owned());
        model.tell(
            "no jog while the machine is running: feed hold rests on the path, stop ends the job"
                .to_owned(),
        );
        model
    }

    fn drawn(model: &Model, width: u16, height: u16) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| draw(frame, model)).unwrap();
        terminal.backend().to_string()
    }

    #[test]
    fn a_small_terminal_shows_all_that_matters() {
        insta::assert_snapshot!(drawn(&model(), 80, 24));
    }

    #[test]
    fn a_narrow_one_has_the_values_below_the_positions() {
        insta::assert_snapshot!(drawn(&model(), 60, 30));
    }

    #[test]
    fn a_large_one_shows_the_program_too() {
        insta::assert_snapshot!(drawn(&model(), 160, 50));
    }

    #[test]
    fn a_jog_shows_how_far_it_goes_on() {
        let mut model = model();
        model.status.state = State::Jogging;
        model.status.off_path = true;
        model.status.settings.rapid_override = 50.0;
        model.releases = true;
        insta::assert_snapshot!(drawn(&model, 80, 24));
    }

    #[test]
    fn what_is_wired_is_shown_by_name() {
        let mut model = model();
        model.signals.inputs = ["door", "clamped", "probe"].map(str::to_owned).into();
        model.signals.outputs = ["coolant", "clamp"].map(str::to_owned).into();
        model.signals.analog_outputs = ["laser"].map(str::to_owned).into();
        model.status.inputs = vec![false, true, false];
        model.status.outputs = vec![true, false];
        model.status.analog_outputs = vec![37.5];
        model.status.drives[1] = PowerState::Fault;
        insta::assert_snapshot!(drawn(&model, 80, 24));
    }

    #[test]
    fn how_square_a_gantry_is_stands_among_the_signals() {
        let mut model = model();
        model.signals.gantries = vec![(syncline_gcode::AxisLetter::X, "mm")];
        let square = |stored, measured| Some(Squareness { stored, measured });
        model.status.squareness[0] = square(-0.8, None);
        let screen = drawn(&model, 80, 24);
        let told = "square   X not measured, stored -0.8000 mm";
        assert!(screen.contains(told), "{screen}");
        model.status.squareness[0] = square(0.8, Some(-1.98761));
        let screen = drawn(&model, 80, 24);
        let told = "square   X was -1.9876 mm out, stored 0.8000 mm";
        assert!(screen.contains(told), "{screen}");
    }

    #[test]
    fn encoders_on_shafts_of_their_own_stand_among_the_signals() {
        let mut model = model();
        model.signals.measured = ["belt", "table"].map(str::to_owned).into();
        let at = |position| Some(MeasuredSample { position, age: 0 });
        model.status.measured[..2].copy_from_slice(&[at(-1412.34567), at(0.0)]);
        let screen = drawn(&model, 80, 24);
        let told = "encoders belt -1412.346, table 0.000";
        assert!(screen.contains(told), "{screen}");
    }

    #[test]
    fn many_signals_end_with_the_screen() {
        let mut model = model();
        model.signals.inputs = (0..40).map(|number| format!("input {number}")).collect();
        model.status.inputs = vec![true; 40];
        let screen = drawn(&model, 80, 24);
        let row = screen.lines().find(|row| row.contains("inputs")).unwrap();
        assert!(row.ends_with("…\""), "{row}");
        assert!(row.contains(" inputs   input 0, input 1, "), "{row}");
    }

    #[test]
    fn what_a_job_waits_for_is_shown() {
        let mut model = model();
        model.signals.inputs = vec!["clamped".to_owned()];
        model.status.inputs = vec![false];
        model.status.waiting = Some(Waiting::Input {
            input: 0,
            on: true,
            left: 2.43,
        });
        let screen = drawn(&model, 80, 24);
        let told = "waits for input \"clamped\" on, 2.4 s left \"";
        assert!(screen.contains(told), "{screen}");
        let zero = ZeroOverrides {
            feed: true,
            rapid: false,
        };
        model.status.waiting = Some(Waiting::Override(zero));
        model.status.state = State::Held;
        let screen = drawn(&model, 80, 24);
        assert!(
            screen.contains("the feed override is 0: raise it to go on \""),
            "{screen}"
        );
        assert!(
            screen.contains("command   raise the override to go on"),
            "{screen}"
        );
    }

    #[test]
    fn nothing_has_no_sign() {
        let mut model = model();
        model.status.actual = [-0.0004; 9];
        model.status.offset = [0.0; 9];
        model.status.setpoint = [1e-9; 9];
        model.status.target = Some([0.0; 9]);
        let screen = drawn(&model, 80, 24);
        assert!(
            screen.contains(" 0.000 ") && !screen.contains("-0.000"),
            "{screen}"
        );
    }

    #[test]
    fn a_program_that_can_be_resumed_is_shown() {
        let mut model = model();
        model.status.state = State::Ready;
        model.status.interrupted = Some(4);
        let screen = drawn(&model, 80, 24);
        assert!(screen.contains("resume takes up line 4 \""), "{screen}");
        model.status.state = State::Running;
        assert!(!drawn(&model, 80, 24).contains("resume takes up"));
    }

    #[test]
    fn every_key_is_shown() {
        let mut model = model();
        model.help = true;
        insta::assert_snapshot!(drawn(&model, 80, 24));
    }

    #[test]
    fn the_first_cause_of_a_stop_is_on_top() {
        let mut model = model();
        model.status.state = State::Faulted;
        model.status.interrupted = Some(3);
        model.status.stopped = Some(Stopped {
            faults: vec![
                "drive Y: drive fault, statusword 0238h: read its error memory, and clear its \
                 cause"
                    .to_owned(),
                "drive Z: heartbeat lost: check cabling and supply".to_owned(),
            ],
            line: Some(3),
            ..Stopped::default()
        });
        model.prompt = Some("mdi G0 X0".to_owned());
        insta::assert_snapshot!(drawn(&model, 80, 24));
    }

    proptest! {
        /// Speeds, overrides, spindle, coolant, jog and stops have their places, whatever they are.
        #[test]
        fn no_value_is_cut_off_at_80_columns(
            (speed, actual, rotary) in (0.0..2000.0f64, 0.0..2000.0f64, any::<bool>()),
            (turning, told, turns) in (
                select(vec![Turning::Off, Turning::Clockwise, Turning::Counterclockwise]),
                0.0..60_000.0f64,
                prop::option::of(-60_000.0..60_000.0f64),
            ),
            (mist, flood) in any::<(bool, bool)>(),
            (feed, rapid) in (0..=200u32, 0..=100u32),
            angle in prop::option::of(0.0..360.0f64),
            (offset, rotation) in (
                prop::array::uniform3(select(vec![0.0, -1234.5678, 0.25])),
                select(vec![0.0, -12.5]),
            ),
            jog_step in select(vec![0.01, 0.1, 1.0, 10.0, 100.0]),
            (single_block, optional_stop, releases) in any::<(bool, bool, bool)>(),
        ) {
            let mut model = model();
            let status = &mut model.status;
            status.velocity[0] = 0.0;
            status.velocity[if rotary { 3 } else { 1 }] = speed;
            (status.spindle.turning, status.spindle.speed) = (turning, told);
            status.spindle.orientation = angle
                .filter(|_| turning == Turning::Off)
                .map(|angle| Orientation { angle, way: Way::Clockwise, within: None });
            status.offset[..3].copy_from_slice(&offset);
            status.rotation = rotation;
            status.spindle_actual = turns.map(|speed| SpindleSample { speed, turns: 0.0, age: 0 });
            (status.coolant.mist, status.coolant.flood) = (mist, flood);
            status.settings = Settings {
                feed_override: f64::from(feed),
                rapid_override: f64::from(rapid),
                jog_step,
                single_block,
                optional_stop,
            };
            (model.speed, model.releases) = (actual, releases);
            let screen = drawn(&model, 80, 24);
            prop_assert!(!screen.contains('…'), "{}", screen);
            let on = |on: bool| if on { "on" } else { "off" };
            let held = if releases { "held on and on" } else { "steps only" };
            let mut shown = vec![
                format!("min, actual {:.0}", actual * 60.0),
                format!("feed {feed} %, rapid {rapid} %"),
                format!("coolant  {}", coolant_name(running(model.status.coolant))),
                format!("jog      by {jog_step} mm, {held}"),
                format!("stops    single block {}, M1 {}", on(single_block), on(optional_stop)),
            ];
            shown.extend(turns.map(|turns| format!(", turns at {turns:.0}")));
            let held = model.status.spindle.orientation.filter(|_| turns.is_none());
            shown.extend(held.map(|it| format!("M19 R{}", (it.angle * 10.0).round() / 10.0)));
            let row = |axis: &str, offset: f64| (offset != 0.0).then(|| format!("{axis}{offset:.3}"));
            let origins = ["X", "Y", "Z"].iter().zip(offset).filter_map(|(axis, it)| row(axis, it));
            shown.extend(origins);
            if rotation != 0.0 {
                shown.push("turned by -12.5°".to_owned());
            }
            if offset == [0.0; 3] && rotation == 0.0 {
                shown.push("offsets  none".to_owned());
            }
            for text in shown {
                prop_assert!(screen.contains(&format!("{text} ")) || screen.contains(&format!("{text}\"")), "{} in {}", text, screen);
            }
        }
    }

    /// Texts of messages: a few words, or several rows of them, some of which fit no row.
    fn text() -> impl Strategy<Value = String> {
        let word = select(vec![
            "axis",
            "X:",
            "a",
            "not",
            "G1X1000.123Y-500.25Z-1",
            "homed,",
        ]);
        let line = prop::collection::vec(word, 1..60).prop_map(|words| words.join(" "));
        prop::collection::vec(prop_oneof![line, "[a-z]{1,200}"], 1..5)
            .prop_map(|lines| lines.join("\n"))
    }

    proptest! {
        /// However much there is to tell: the first cause begins on top, what was told last begins below, and how long
        /// it takes stands in the first row.
        #[test]
        fn what_matters_most_is_seen_at_80_columns(
            faults in prop::collection::vec(text(), 0..6),
            messages in prop::collection::vec(text(), 0..6),
            inputs in 0..12usize,
            name in "[a-z]{1,120}",
        ) {
            let mut model = model();
            model.signals.inputs = (0..inputs).map(|it| format!("an input {it}")).collect();
            model.status.inputs = vec![true; inputs];
            model.status.program = Some(format!("/parts/{name}.ngc").into());
            messages.iter().for_each(|text| model.tell(text.clone()));
            if !faults.is_empty() {
                model.status.state = State::Faulted;
                let faults = faults.clone();
                model.status.stopped = Some(Stopped { faults, ..Stopped::default() });
            }
            let screen = drawn(&model, 80, 24);
            let newest = messages.last().map_or("no jog while", String::as_str);
            for text in faults.first().map(String::as_str).into_iter().chain([newest]) {
                let begins = wrapped(text, 80).swap_remove(0);
                prop_assert!(screen.contains(&format!("\"{begins}")), "{begins}: {screen}");
            }
            let first = screen.lines().next().unwrap_or_default();
            prop_assert!(first.ends_with(" left\""), "{first}");
        }

        /// Words are in their order and whole where they fit, and no row is too wide.
        #[test]
        fn rows_have_all_words(text in text(), width in 1..100usize) {
            let rows = wrapped(&text, width);
            prop_assert!(rows.iter().all(|row| row.chars().count() <= width));
            let joined = |rows: &[String]| rows.concat().replace(' ', "");
            prop_assert_eq!(joined(&rows), text.replace([' ', '\n'], ""));
        }
    }

    #[test]
    fn no_size_of_a_terminal_is_too_small() {
        for (width, height) in [(1, 1), (20, 5), (79, 10), (80, 3), (300, 8)] {
            let _ = drawn(&model(), width, height);
        }
    }
}
