//! What the status, and with it every screen, shows as in effect: of a program at work that of its block, with the work
//! coordinates that it counts in.

use super::day::{go, positions, ready_with, settle, state};
use proptest::prelude::*;
use syncline_controller::control::State;
use syncline_controller::session::{Command, SwitchChange};
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

/// What the axes rest beside their setpoints, mm.
const NOISE: f64 = 0.02;

/// A move in a work offset of its own, behind which the program stops.
#[derive(Clone, Copy, Debug)]
struct Block {
    /// G54 to G59.
    system: u32,
    /// Its origin, and by how much it is turned, degrees.
    origin: [f64; 3],
    turned: f64,
    /// G43.1
    tool: f64,
    /// G92 X: by how much it shifts.
    shift: Option<f64>,
    to: [f64; 3],
    feed: u32,
}

fn block() -> impl Strategy<Value = Block> {
    let origin = (300.0..900.0, 300.0..600.0, -120.0..-80.0_f64);
    let to = (-100.0..100.0, -100.0..100.0, -20.0..20.0_f64);
    let shift = prop::option::of(-50.0..50.0_f64);
    (
        54..60u32,
        origin,
        -90.0..90.0_f64,
        0.0..40.0_f64,
        shift,
        to,
        3000..20_000u32,
    )
        .prop_map(
            |(system, (x, y, z), turned, tool, shift, (to_x, to_y, to_z), feed)| Block {
                system,
                origin: [x, y, z],
                turned,
                tool,
                shift,
                to: [to_x, to_y, to_z],
                feed,
            },
        )
}

impl Block {
    fn text(&self) -> String {
        let Self {
            system,
            origin: [x, y, z],
            turned,
            tool,
            to: [to_x, to_y, to_z],
            feed,
            ..
        } = self;
        let number = system - 53;
        // By so much it calls where the machine stands something else.
        let shift = self.shift.map_or("G92.1".to_owned(), |by| {
            format!("G92.1\nG92 X[#<_x> + {by:.3}]")
        });
        format!(
            "G10 L2 P{number} X{x:.3} Y{y:.3} Z{z:.3} R{turned:.3}\nG{system} G43.1 Z{tool:.3}\n{shift}\n\
             G1 X{to_x:.3} Y{to_y:.3} Z{to_z:.3} F{feed}\nM0\n"
        )
    }
}

/// Goes on until the axes rest; a jog of a held program is no state of its own.
fn rest(rig: &mut Rig) {
    let mut since = 0;
    while since < 20 {
        rig.step();
        let rests = rig.session.status().velocity.iter().all(|it| *it == 0.0);
        since = if rests { since + 1 } else { 0 };
    }
}

/// Where the axes are as they are shown.
#[track_caller]
fn assert_shown(rig: &Rig, to: [f64; 3]) {
    let shown = rig.session.status().work_position();
    for (shown, to) in shown.iter().zip(to) {
        assert!((shown - to).abs() < NOISE, "{shown} for {to}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 5, ..ProptestConfig::default() })]

    /// At each stop: the codes of the block, and where the program has the axes; a command goes by what is shown, and behind
    /// the program what it leaves is in effect.
    #[test]
    fn it_is_that_of_the_block_at_work(blocks in prop::collection::vec(block(), 1..5)) {
        let mut rig = ready_with(&[]);
        rig.goes_on = false;
        let program = blocks.iter().map(Block::text).collect::<String>() + "M2\n";
        let file = rig.folder.file("part.ngc", &program);
        rig.command(Command::Load(file));
        settle(&mut rig);
        go(&mut rig, Command::Run { from_line: None });
        for block in &blocks {
            prop_assert_eq!(state(&rig), State::Held, "{}{:?}", program, rig.problems);
            let modes = rig.session.status().modes.clone();
            for code in [format!("G{}", block.system), format!("F{}", block.feed), "G43".into()] {
                prop_assert!(modes.split(' ').any(|it| it == code), "{} in {}", code, modes);
            }
            let [x, y, z] = block.to;
            assert_shown(&rig, block.to);
            // Away by what is shown, and back.
            let there = rig.session.status().setpoint;
            rig.command(Command::GoTo(positions([(AxisLetter::X, x + 5.0), (AxisLetter::Z, z + 2.0)])));
            rest(&mut rig);
            assert_shown(&rig, [x + 5.0, y, z + 2.0]);
            rig.command(Command::Resume);
            rest(&mut rig);
            let back = rig.session.status().setpoint;
            prop_assert!(there.iter().zip(back).all(|(one, other)| (one - other).abs() < 1e-6));
            go(&mut rig, Command::CycleStart);
        }
        prop_assert_eq!(state(&rig), State::Ready, "{}{:?}", program, rig.problems);
        let status = rig.session.status();
        prop_assert!(status.modes.split(' ').any(|it| it == "G54"), "{}", status.modes);
        let tool = blocks.last().map_or(0.0, |it| it.tool);
        let own = blocks.iter().rev().find(|it| it.system == 54);
        let origin = own.map_or(tool, |it| it.origin[2] + tool);
        prop_assert!((status.offset[2] - origin).abs() < 1e-2, "{:?} for {}", status.offset, origin);
    }
}

/// Something that an operator ends, with the codes in front of it, and moves in between.
#[derive(Clone, Debug)]
struct Rest {
    system: u32,
    feed: u32,
    stop: &'static str,
    /// Ends of moves behind it, in another work offset.
    moves: Vec<f64>,
}

fn rest_of() -> impl Strategy<Value = Rest> {
    let stop = prop::sample::select(vec!["M0", "M1", "T2 M6", "T3 M6", "G4 P0.05 M0"]);
    let moves = prop::collection::vec(10.0..90.0_f64, 0..3);
    (54..57u32, 3000..9000u32, stop, moves).prop_map(|(system, feed, stop, moves)| Rest {
        system,
        feed,
        stop,
        moves,
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Whatever moves before and behind it, or nothing yet: at a stop its own line is shown, and what is in effect in it.
    #[test]
    fn a_stop_shows_its_own_block(rests in prop::collection::vec(rest_of(), 1..6)) {
        let mut rig = ready_with(&[]);
        rig.goes_on = false;
        rig.command(Command::OptionalStop(SwitchChange::Toggle));
        let mut lines = Vec::new();
        let mut shown = Vec::new();
        for rest in &rests {
            lines.push(format!("G{} F{}", rest.system, rest.feed));
            lines.push(rest.stop.to_owned());
            shown.push((lines.len() as u32, rest));
            lines.push(format!("G{} F100", rest.system + 1));
            lines.extend(rest.moves.iter().map(|to| format!("G1 X{to:.3} Y{:.3} F9000", to / 2.0)));
        }
        let program = lines.join("\n") + "\nM2\n";
        let file = rig.folder.file("part.ngc", &program);
        rig.command(Command::Load(file));
        settle(&mut rig);
        go(&mut rig, Command::Run { from_line: None });
        for (line, rest) in shown {
            prop_assert_eq!(state(&rig), State::Held, "{}{:?}", program, rig.problems);
            let status = rig.session.status();
            prop_assert_eq!(status.line, line, "{}", program);
            let tool = rest.stop.strip_suffix(" M6");
            for code in [format!("G{}", rest.system), format!("F{}", rest.feed)].iter().map(String::as_str).chain(tool) {
                let is_shown = status.modes.split(' ').any(|it| it == code);
                prop_assert!(is_shown, "{} at {}: {}\n{}", code, line, status.modes, program);
            }
            go(&mut rig, Command::CycleStart);
        }
        prop_assert_eq!(state(&rig), State::Ready, "{}{:?}", program, rig.problems);
    }
}

/// Lines that are typed in are no lines of the program that is loaded.
#[test]
fn what_was_typed_is_shown_as_that() {
    let mut rig = ready_with(&[]);
    rig.goes_on = false;
    let file = rig.folder.file("part.ngc", "G0 X20\nM0\nG0 X30\nM2\n");
    rig.command(Command::Load(file));
    let typed = |rig: &Rig| rig.session.status().typed.clone();
    go(&mut rig, Command::Mdi("G0 X10".to_owned()));
    assert_eq!(typed(&rig).as_deref(), Some("G0 X10"));
    go(&mut rig, Command::Run { from_line: None });
    assert_eq!(state(&rig), State::Held);
    assert_eq!(typed(&rig), None);
    let offset = positions([(AxisLetter::X, 0.0)]);
    go(&mut rig, Command::SetWorkOffset(offset));
    assert_eq!(typed(&rig).as_deref(), Some(""));
    go(&mut rig, Command::Resume);
    assert_eq!(typed(&rig), None);
}
