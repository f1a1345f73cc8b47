//! How long a program still takes, as it is told before and while it runs.

use proptest::prelude::*;
use std::path::Path;
use std::thread;
use std::time::Duration;
use syncline_controller::control::{End, State};
use syncline_controller::program::{Programs, Timetable};
use syncline_controller::session::{Command, Override};
use syncline_tests::rig::Rig;
use syncline_trajectory::path::Overrides;

use super::day::{go, ready_with, state};

const AS_PROGRAMMED: Overrides = Overrides {
    feed: 1.0,
    rapid: 1.0,
};

/// A block of a program on the portal.
#[derive(Clone, Copy, Debug)]
enum Block {
    Rapid(f64, f64),
    Feed(f64, f64, u16),
    Arc(f64),
    /// ms
    Dwell(u16),
    /// One of G61, G61.1, G64.
    Mode(u8),
    Coolant(bool),
}

fn block() -> impl Strategy<Value = Block> {
    let at = || (0u16..3000).prop_map(|tenths| f64::from(tenths) / 10.0);
    prop_oneof![
        2 => (at(), at()).prop_map(|(x, y)| Block::Rapid(x, y)),
        4 => (at(), at(), 300u16..20_000).prop_map(|(x, y, feed)| Block::Feed(x, y, feed)),
        2 => (0.1f64..20.0).prop_map(Block::Arc),
        2 => (0u16..800).prop_map(Block::Dwell),
        1 => (0u8..3).prop_map(Block::Mode),
        1 => any::<bool>().prop_map(Block::Coolant),
    ]
}

fn text(blocks: &[Block]) -> String {
    let line = |block: &Block| match *block {
        Block::Rapid(x, y) => format!("G0 X{x} Y{y}\n"),
        Block::Feed(x, y, feed) => format!("G1 X{x} Y{y} F{feed}\n"),
        Block::Arc(radius) => format!("G91 G2 X{radius:.3} Y{radius:.3} I{radius:.3} J0\nG90\n"),
        Block::Dwell(ms) => format!("G4 P{}\n", f64::from(ms) / 1e3),
        Block::Mode(mode) => ["G61\n", "G61.1\n", "G64 P0.1\n"][usize::from(mode)].to_owned(),
        Block::Coolant(on) => format!("M{}\n", if on { 8 } else { 9 }),
    };
    let lines: String = blocks.iter().map(line).collect();
    format!("G21 G90 F6000\nG0 X100 Y100\n{lines}M2\n")
}

/// The timetable of a program on the machine of a rig, from where that stands.
fn timetable(rig: &mut Rig, program: &str) -> Timetable {
    rig.run_until(|rig| !rig.rows.is_empty());
    let programs = Programs::new(&rig.machine, Path::new("none.toml")).unwrap();
    let program = programs.text("case", program.as_bytes());
    program.timetable(rig.rows[0].plan.position).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// Wherever a program is, it takes as long from there as was told before it began.
    #[test]
    fn a_program_takes_as_long_as_was_told(blocks in prop::collection::vec(block(), 1..24)) {
        takes_as_long_as_told(&text(&blocks))?;
    }
}

/// So long that it is planned window by window, each of which replaces the end of the one before.
#[test]
fn a_long_program_takes_as_long_as_was_told() {
    let lines = (0..600).map(|line| {
        let (at, across) = (f64::from(line) / 5.0, f64::from(line % 7) / 3.0);
        format!("G1 X{:.3} Y{:.3}\n", 100.0 + at, 100.0 + across)
    });
    let lines: String = lines.collect();
    let program = format!("G21 G90 F9000\nG0 X100 Y100\nG64 P0.1\n{lines}M2\n");
    takes_as_long_as_told(&program).unwrap();
}

/// Whether a program takes as long, from every place, as was told before it began.
fn takes_as_long_as_told(program: &str) -> Result<(), TestCaseError> {
    let mut rig = Rig::portal(program);
    let table = timetable(&mut rig, program);
    prop_assert!(table.is_whole());
    prop_assert_eq!(rig.finish(), End::Finished, "{}{:?}", program, rig.events);
    let Some(last) = rig.rows.iter().rposition(|row| row.plan.busy) else {
        return Ok(());
    };
    let end = rig.rows[last].cycle;
    let cycle = rig.machine.cycle.as_secs_f64();
    let mut before = f64::INFINITY;
    for row in &rig.rows[..=last] {
        let at = row.plan.distance;
        let told = table.remaining(at, AS_PROGRAMMED).unwrap();
        prop_assert!(told <= before + 1e-9, "{told} after {before}\n{program}");
        before = told;
        // At a place of rest the whole rest is told, from just before it until just behind it.
        if row.plan.speed > 1.0 {
            let left = (end - row.cycle) as f64 * cycle;
            // Between two places it is as if the speed did not change.
            let close = (told - left).abs() < 0.1 + 3.0 * cycle;
            prop_assert!(close, "{told} s told, {left} s left at {at} mm\n{program}");
        }
    }
    Ok(())
}

#[test]
fn overrides_change_what_is_left() {
    let program = "G21 G91 F3000\nG1 X200\nG0 X-200\nG4 P2\nM2\n";
    let mut rig = Rig::portal(program);
    let table = timetable(&mut rig, program);
    let left = |distance, feed, rapid| table.remaining(distance, Overrides { feed, rapid });
    let whole = left(0.0, 1.0, 1.0).unwrap();
    let slow = left(0.0, 0.5, 1.0).unwrap();
    assert!((slow - whole - 4.0).abs() < 0.2, "{slow} s, {whole} s");
    assert_eq!(left(0.0, 0.0, 1.0), None);
    // Nothing of the rest goes by a feed.
    let rapid = left(200.1, 0.0, 1.0).unwrap();
    assert!((2.0..4.0).contains(&rapid), "{rapid} s");
    let dwell = left(400.0, 0.0, 0.0);
    assert!((dwell.unwrap() - 2.0).abs() < 0.2, "{dwell:?}");
}

/// Whoever walks it goes no further once the job is over.
#[test]
fn a_program_without_end_is_not_walked_for_ever() {
    let rig = Rig::portal("M2\n");
    let text = "G21 G91 F3000\no1 while [1]\nG1 X5\nG1 X-5\no1 endwhile\nM2\n";
    let programs = Programs::new(&rig.machine, Path::new("none.toml")).unwrap();
    let program = programs.text("case", text.as_bytes());
    let apart = program.apart();
    let start = rig.machine.rest();
    let walker = {
        let apart = apart.clone();
        thread::spawn(move || apart.timetable(start))
    };
    thread::sleep(Duration::from_millis(50));
    apart.abandon();
    assert!(walker.join().unwrap().is_err());
    assert!(!program.is_abandoned());
}

#[test]
fn nobody_knows_how_long_a_probing_takes() {
    let program = "G21 G91 F600\nG1 X5\nG38.3 X1 F100\nM2\n";
    let mut rig = super::probing::rig(program);
    assert!(!timetable(&mut rig, program).is_whole());
}

#[test]
fn a_session_that_is_asked_counts_down() {
    let mut rig = ready_with(&[]);
    rig.session.tell_remaining();
    let file = rig
        .folder
        .file("part.ngc", "G21 G91 G0 X0\nM0\nG1 X200 F3000\nM2\n");
    go(&mut rig, Command::Load(file));
    rig.goes_on = false;
    go(&mut rig, Command::Run { from_line: None });
    assert_eq!(state(&rig), State::Held);
    // Another thread plans.
    let told = (0..1000).find_map(|_| {
        thread::sleep(Duration::from_millis(5));
        rig.step();
        rig.session.status().remaining
    });
    assert!((4.0..4.5).contains(&told.unwrap()), "{told:?}");
    rig.command(Command::CycleStart);
    let mut before = f64::INFINITY;
    rig.run_until(|rig| {
        let left = rig.session.status().remaining;
        assert!(
            left.is_none_or(|left| left <= before),
            "{left:?} after {before}"
        );
        before = left.unwrap_or(before);
        left.is_some_and(|left| left < 2.0)
    });
    rig.command(Command::FeedOverride(Override::To(50.0)));
    rig.run_until(|rig| {
        rig.session
            .status()
            .remaining
            .is_some_and(|left| left > 3.5)
    });
    rig.run_until(|rig| state(rig) == State::Ready);
    assert_eq!(rig.session.status().remaining, None);
}
