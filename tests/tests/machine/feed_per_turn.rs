//! Feeds by the turns of a measured spindle (G95), on `examples/drill`. What is judged is how far the tool goes while the
//! simulated rotor makes a turn.

use proptest::prelude::*;
use proptest::sample::select;
use syncline_canopen::{CobId, Frame, NodeId};
use syncline_controller::control::fault::SpindleCause;
use syncline_controller::control::{End, Fault, Row, State};
use syncline_controller::machine::COORDINATES;
use syncline_controller::session::{Command, Override};
use syncline_drives::twin::Disturbance;
use syncline_tests::rig::Rig;

use super::threads::SPINDLE;

/// What a feed may be off by where neither spindle nor path change their speed, a part of it.
const ALLOWED: f64 = 0.01;
/// What the tests' spindle may be off its speed by.
const TOLERANCE: &str = "tolerance = 0.2\nspeed_loss_ms = 2000";
/// From so long behind a change of spindle or feed on, s.
const SETTLED: f64 = 0.35;

/// The drive of its spindle turns by another part of what it is told.
fn slipping(program: &str, part: f64) -> Rig {
    let changes = [("tolerance = 0.03", TOLERANCE)];
    let mut rig = Rig::new("drill", &changes, program, |_, _| ());
    rig.goes_on = false;
    turn_by(&mut rig, part);
    rig
}

fn turn_by(rig: &mut Rig, part: f64) {
    let sent = CobId::r_pdo(1, NodeId::new(4).unwrap());
    rig.bus().forger = Some(Box::new(move |frames| {
        for frame in frames {
            if let [c0, c1, v0, v1, v2, v3] = *frame.data()
                && frame.id() == sent.into()
            {
                let told = f64::from(i32::from_le_bytes([v0, v1, v2, v3]));
                let [v0, v1, v2, v3] = ((told * part) as i32).to_le_bytes();
                *frame = Frame::new(sent, &[c0, c1, v0, v1, v2, v3]);
            }
        }
    }));
}

/// Where the tool is along X, mm, and how far the rotor has turned.
fn places(rig: &mut Rig) -> [f64; 2] {
    [(0, 10.0), (SPINDLE, 1.0)].map(|(drive, each)| each * rig.twin(drive).observe().position)
}

fn x(rig: &Rig) -> f64 {
    rig.rows.last().map_or(0.0, |row| row.plan.position[0])
}

/// How far the tool goes in a turn of the rotor between two places of X, mm.
fn between(rig: &mut Rig, from: f64, to: f64) -> f64 {
    rig.run_until(|rig| x(rig) > from);
    let before = places(rig);
    rig.run_until(|rig| x(rig) > to);
    let after = places(rig);
    (after[0] - before[0]) / (after[1] - before[1]).abs()
}

fn assert_feeds(feed: f64, wanted: f64) {
    assert!(
        (feed / wanted - 1.0).abs() < ALLOWED,
        "{feed} for {wanted} mm"
    );
}

// --- what a turn is worth ---

/// Whatever the drive makes of what it is told, and whichever way round it is.
#[test]
fn the_feed_is_by_the_turns_that_are_measured() {
    for (code, part) in [("M3", 1.0), ("M3", 0.88), ("M4", 1.12)] {
        let program = format!("G21 G90 G61\n{code} S600\nG95 F0.5\nG1 X40\nG0 X0\nM2\n");
        let mut rig = slipping(&program, part);
        assert_feeds(between(&mut rig, 5.0, 35.0), 0.5);
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        rig.trace().assert_within_limits();
    }
}

#[test]
fn it_follows_a_spindle_that_slows_down_in_the_cut() {
    let mut rig = slipping("G21 G90\nM3 S900 G95\nG1 X90 F0.4\nM2\n", 1.0);
    assert_feeds(between(&mut rig, 5.0, 30.0), 0.4);
    turn_by(&mut rig, 0.85);
    // The drive is sent its speed in every cycle.
    assert_feeds(between(&mut rig, 35.0, 85.0), 0.4);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    rig.trace().assert_within_limits();
}

/// From M3 to M4 and S to S each cut waits for the spindle, and begins with its feed.
#[test]
fn each_speed_has_its_feed() {
    let program = "G21 G90 G61 G95\nM3 S900 F1\nG1 X60\nS300\nG1 X80\nM5\nM4 S600\nG1 X120\nM2\n";
    let mut rig = slipping(program, 0.95);
    for (from, to) in [(6.0, 55.0), (64.0, 78.0), (86.0, 115.0)] {
        assert_feeds(between(&mut rig, from, to), 1.0);
    }
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let cuts = rig.rows.iter().filter(|row| row.plan.speed > 0.0);
    let fastest = cuts.map(|row| row.plan.feed / measured(row));
    let fastest = fastest.fold(0.0, f64::max);
    assert!(fastest < 1.08, "{fastest} mm a turn");
    rig.trace().assert_within_limits();
}

#[test]
fn an_override_and_a_hold_have_effect() {
    let mut rig = slipping("G21 G90 G61 G95\nM3 S600\nG1 X100 F0.5\nM2\n", 1.1);
    rig.command(Command::FeedOverride(Override::To(150.0)));
    assert_feeds(between(&mut rig, 6.0, 30.0), 0.75);
    rig.command(Command::FeedHold);
    rig.run_until(|rig| rig.session.status().state == State::Held);
    rig.command(Command::FeedOverride(Override::To(50.0)));
    rig.command(Command::Resume);
    assert_feeds(between(&mut rig, 40.0, 50.0), 0.25);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    rig.trace().assert_within_limits();
}

#[test]
fn other_feeds_are_as_they_were() {
    let program = "G21 G90 G61\nM3 S600\nG95 G1 X20 F0.5\nG94 G1 X40 F600\nG93 G1 X60 F30\nM2\n";
    let mut rig = slipping(program, 0.9);
    assert_feeds(between(&mut rig, 5.0, 18.0), 0.5);
    // 10 mm/s, of a rotor that makes 9 turns a second.
    for (from, to) in [(25.0, 38.0), (45.0, 58.0)] {
        assert_feeds(between(&mut rig, from, to), 10.0 / 9.0);
    }
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    rig.trace().assert_within_limits();
}

/// No axis goes beyond its greatest speed.
#[test]
fn a_feed_beyond_the_axes_is_limited() {
    let mut rig = slipping("G21 G90 G95\nM3 S3000\nG1 X150 F20\nM2\n", 1.0);
    assert_feeds(between(&mut rig, 60.0, 90.0), 400.0 / 50.0);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    rig.trace().assert_within_limits();
}

/// It is no stall that nobody is told of, and no way back.
#[test]
fn a_spindle_that_stands_or_turns_round_stops_the_machine() {
    for part in [None, Some(-1.0), Some(0.0)] {
        let mut rig = slipping("G21 G90 G95\nM3 S600\nG1 X100 F0.5\nM2\n", 1.0);
        rig.run_until(|rig| x(rig) > 10.0);
        match part {
            None => rig.twin(SPINDLE).disturb(Disturbance::Block(true)),
            Some(part) => turn_by(&mut rig, part),
        }
        let fault = rig.finish_with_fault();
        let told = matches!(
            fault,
            Fault::Spindle(SpindleCause::Speed { .. }) | Fault::Device(SPINDLE, _)
        );
        assert!(told, "{fault:?}");
        assert!(x(&rig) < 24.0, "{}", x(&rig));
        let back = rig.rows.iter().any(|row| row.plan.velocity[0] < 0.0);
        assert!(!back && rig.ends_at_rest());
        rig.trace().assert_within_limits();
    }
}

// --- anything ---

/// A block of the generator; those by turns are below Z20.
#[derive(Clone, Debug)]
enum Block {
    Turns { feed: f64, arc: bool, length: f64 },
    Minutes { feed: f64, length: f64 },
    Time { seconds: f64, length: f64 },
    Spindle { code: &'static str, speed: f64 },
    Blend(f64),
}

fn block() -> impl Strategy<Value = Block> {
    prop_oneof![
        4 => (0.05..2.0f64, any::<bool>(), 1.0..15.0f64)
            .prop_map(|(feed, arc, length)| Block::Turns { feed, arc, length }),
        1 => (300.0..3000.0f64, 1.0..10.0f64).prop_map(|(feed, length)| Block::Minutes { feed, length }),
        1 => (0.2..1.0f64, 1.0..10.0f64).prop_map(|(seconds, length)| Block::Time { seconds, length }),
        1 => (select(vec!["M3", "M4", "M5\nM3"]), 300.0..2000.0f64)
            .prop_map(|(code, speed)| Block::Spindle { code, speed }),
        1 => (0.01..0.5f64).prop_map(Block::Blend),
    ]
}

/// The program, and the feeds by turns in their order.
fn write(blocks: &[Block]) -> String {
    let mut text = "G21 G91 G64 P0.1\nM3 S600\n".to_owned();
    let mut sign = 1.0;
    for block in blocks {
        sign = -sign;
        text += &match block {
            Block::Turns { feed, arc, length } => {
                let length = sign * length;
                let way = match arc {
                    true => format!("G2 X{length:.4} Y{length:.4} R{:.4}", 2.0 * length.abs()),
                    false => format!("G1 X{length:.4} Y{length:.4}"),
                };
                format!("G95 F{feed:.4} {way}\n")
            }
            Block::Minutes { feed, length } => {
                format!("G94 G1 Z40 F{feed:.3}\nX{:.4}\nG0 Z-40\n", sign * length)
            }
            Block::Time { seconds, length } => {
                let rate = 60.0 / seconds;
                format!(
                    "G0 Z40\nG93 G1 X{:.4} F{rate:.4}\nG94 G0 Z-40\n",
                    sign * length
                )
            }
            Block::Spindle { code, speed } => format!("{code} S{speed:.1}\n"),
            Block::Blend(tolerance) => format!("G64 P{tolerance:.4}\n"),
        };
    }
    text + "M2\n"
}

/// What a row says that the spindle makes, turns/s.
fn measured(row: &Row<COORDINATES>) -> f64 {
    row.spindle.map_or(0.0, |it| it.speed.abs() / 60.0)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3, ..ProptestConfig::default() })]

    /// Below Z20 the feed that is asked for is by the measured turns, from the cut's beginning on; it ends, within the limits.
    #[test]
    fn any_feed_by_turns_is_by_those_that_are_measured(
        blocks in proptest::collection::vec(block(), 2..10), part in 0.85..1.15f64,
        feed_override in select(vec![100.0, 100.0, 60.0, 140.0]), hold in proptest::option::of(0.1..4.0f64),
    ) {
        let mut rig = slipping(&write(&blocks), part);
        let feeds: Vec<f64> = blocks.iter().filter_map(|block| match block {
            Block::Turns { feed, .. } => Some(feed * feed_override / 100.0),
            _ => None,
        }).collect();
        rig.command(Command::FeedOverride(Override::To(feed_override)));
        let (mut since, mut held) = (0.0, hold.is_none());
        while rig.step() {
            let Some(row) = rig.rows.last() else { continue };
            let at = row.cycle as f64 * 0.002;
            if !held && hold.is_some_and(|hold| at > hold) {
                held = true;
                rig.command(Command::FeedHold);
                rig.command(Command::Resume);
                continue;
            }
            let cuts = row.plan.position[2] < 1e-6 && row.plan.speed > 0.0 && row.plan.feed.is_finite();
            if !cuts {
                since = at;
            }
            if at - since > SETTLED {
                let by_turns = row.plan.feed / measured(row);
                // A line's is along X and Y, as F counts it.
                let near = feeds.iter().any(|feed| (by_turns / feed - 1.0).abs() < 0.02);
                prop_assert!(near, "{by_turns} of {feeds:?}");
                prop_assert!(row.plan.speed <= row.plan.feed * 1.03);
            }
        }
        prop_assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
        rig.trace().assert_within_limits();
        prop_assert!(rig.ends_at_rest());
    }
}

#[test]
fn a_second_run_sends_the_same_frames() {
    let frames = || {
        let mut rig = slipping(
            "G21 G90 G95\nM3 S600\nG1 X20 F0.5\nG2 X30 Y10 R20\nM2\n",
            0.93,
        );
        assert_eq!(rig.finish(), End::Finished);
        rig.frames()
    };
    assert_eq!(frames(), frames());
}
