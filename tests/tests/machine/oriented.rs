//! M19: a spindle that a drive turns is brought to an angle and held there, on `examples/drill`. What is judged is where the
//! simulated rotor is.

use proptest::prelude::*;
use proptest::sample::select;
use syncline_canopen::time::Duration;
use syncline_canopen::{CobId, Instant, NodeId};
use syncline_controller::control::fault::SpindleCause;
use syncline_controller::control::{End, Event, Fault, Pause, State};
use syncline_controller::session::Command;
use syncline_drives::twin::Disturbance;
use syncline_tests::rig::Rig;
use syncline_trajectory::profile::State as Motion;
use syncline_trajectory::state_to_state;

use super::day::{assert_moves_within_limits, go, mdi, settle, state};
use super::driven_spindle::{
    SPINDLE, assert_let_go_at_rest, begun_with, drill_with, tell_spindle, turns_at,
};

/// By how much an angle may be off where `orientation_tolerance` is left out, degrees, and the rotor besides: what it moves by
/// within a cycle.
const ALLOWED: f64 = 0.5;
/// By how much it may swing where it is braked, degrees.
const SWINGS: f64 = 3.0;

/// Where the rotor is, degrees from the drive's zero as the spindle turns, of a motor that makes so many turns for one of it.
fn angle(rig: &mut Rig, gear: f64) -> f64 {
    rig.twin(SPINDLE).observe().position / gear * 360.0
}

/// By how much it is away from an angle, degrees, the shorter way round.
fn off(angle: f64, from: f64) -> f64 {
    (angle - from + 180.0).rem_euclid(360.0) - 180.0
}

/// Whether the program has paused for this reason.
fn paused(rig: &Rig, why: Pause) -> bool {
    let is_it = |event: &Event| matches!(event, Event::Paused { reason, .. } if *reason == why);
    rig.events.iter().any(is_it)
}

/// Goes on to where the program rests in M0.
fn to_the_stop(rig: &mut Rig) {
    rig.run_until(|rig| paused(rig, Pause::ProgramStop) || rig.end().is_some());
    assert_eq!(rig.end(), None, "{:?}", rig.events);
}

fn drill(program: &str) -> Rig {
    drill_with(&[], program, |_, _| ())
}

// --- there and held ---

#[test]
fn it_comes_to_its_angle_and_stays_there() {
    let mut rig = drill("G21 G90\nM3 S3000\nG4 P0.5\nM19 R90\nG0 X50\nG1 X0 F3000\nM0\nM2\n");
    rig.run_until(|rig| rig.rows.last().is_some_and(|row| row.plan.speed > 0.0));
    assert!(off(angle(&mut rig, 1.0), 90.0).abs() < ALLOWED);
    let before = rig.rows.len();
    let mut worst = 0.0_f64;
    rig.run_until(|rig| {
        worst = worst.max(off(angle(rig, 1.0), 90.0).abs());
        rig.rows.last().is_some_and(|row| row.plan.speed == 0.0)
    });
    assert!(rig.rows.len() > before + 200 && worst < ALLOWED, "{worst}°");
    to_the_stop(&mut rig);
    rig.command(Command::CycleStart);
    assert_eq!(rig.finish(), End::Finished);
    assert_let_go_at_rest(&mut rig);
}

/// From where it stands after another M19.
#[test]
fn the_way_round_is_the_one_that_is_asked_for() {
    for (from, word, to) in [
        (90.0, "R80", -10.0),
        (90.0, "R100 P0", 10.0),
        (90.0, "R80 P1", 350.0),
        (90.0, "R100 P1", 10.0),
        (90.0, "R80 P2", -10.0),
        (90.0, "R100 P2", -350.0),
        (350.0, "R10", 20.0),
        (10.0, "", -10.0),
        (90.0, "R89.8 P1", 359.8),
        (90.0, "R90.2 P2", -359.8),
    ] {
        let program = format!("M19 R{from}\nM0\nM19 {word}\nM0\nM2\n");
        let mut rig = drill(&program);
        to_the_stop(&mut rig);
        let before = angle(&mut rig, 1.0);
        rig.events.clear();
        rig.command(Command::CycleStart);
        to_the_stop(&mut rig);
        let turned = angle(&mut rig, 1.0) - before;
        assert!(
            (turned - to).abs() < 2.0 * ALLOWED,
            "{word}: {turned}°, not {to}°"
        );
    }
}

#[test]
fn a_spindle_that_turns_again_waits_for_its_speed_before_the_cut() {
    let mut rig =
        drill("G21 G90\nM19 R45\nM3 S1200\nG1 X20 F1200\nM19 R45 P1\nM5\nG4 P0.1\nG1 X0\nM2\n");
    rig.goes_on = true;
    assert_eq!(rig.finish(), End::Finished);
    super::driven_spindle::assert_cuts_at_speed(&rig);
    assert_let_go_at_rest(&mut rig);
}

// --- what goes wrong ---

/// Nobody goes on past an angle that is not there: cycle start waits for it once more.
#[test]
fn a_spindle_that_cannot_come_pauses_until_it_can() {
    let mut rig = drill("M19 R120 Q0.4\nM0\nM2\n");
    rig.run_until(|rig| rig.session.status().state == State::Running);
    rig.twin(SPINDLE).disturb(Disturbance::Block(true));
    let begun = rig.session.timeline().now();
    rig.run_until(|rig| paused(rig, Pause::NotOriented));
    let waited = (rig.session.timeline().now() - begun).as_secs_f64();
    assert!((0.38..0.42).contains(&waited), "{waited} s");
    rig.events.clear();
    rig.command(Command::CycleStart);
    rig.run_until(|rig| paused(rig, Pause::NotOriented));
    rig.twin(SPINDLE).disturb(Disturbance::Block(false));
    rig.command(Command::CycleStart);
    to_the_stop(&mut rig);
    assert!(off(angle(&mut rig, 1.0), 120.0).abs() < ALLOWED);
}

/// What is measured slips by so many counts from here on.
fn slip(rig: &mut Rig, counts: i32) {
    tell_spindle(rig, move |count| count + counts);
}

#[test]
fn what_slips_is_brought_back_by_the_loop() {
    let mut rig = drill("G21 G90\nM19 R30\nG1 X50 F1200\nM0\nM2\n");
    rig.run_until(|rig| rig.session.status().setpoint[0] > 10.0);
    slip(&mut rig, 10_000);
    to_the_stop(&mut rig);
    let slipped = 360.0 * 10_000.0 / f64::from(1 << 20);
    let off = off(angle(&mut rig, 1.0) + slipped, 30.0);
    assert!(off.abs() < 0.2, "{off}°");
}

/// Further than the loop takes back: it is led back the way that it went, whatever P says.
#[test]
fn what_was_there_goes_back_the_shorter_way() {
    let mut rig = drill("M19 R30 P1\nM0\nM2\n");
    to_the_stop(&mut rig);
    let before = angle(&mut rig, 1.0);
    slip(&mut rig, 100_000);
    for _ in 0..2000 {
        rig.step();
    }
    let turned = angle(&mut rig, 1.0) - before;
    assert!(
        (turned + 360.0 * 100_000.0 / f64::from(1 << 20)).abs() < ALLOWED,
        "{turned}°"
    );
}

/// Turned away while axes move.
#[test]
fn an_oriented_spindle_that_is_turned_away_stops_the_path() {
    let mut rig = drill("G21 G90\nM19 R30\nG1 X150 F1200\nM2\n");
    rig.run_until(|rig| rig.session.status().setpoint[0] > 10.0);
    // Its coupling slips, and it is stuck there.
    rig.twin(SPINDLE).disturb(Disturbance::Block(true));
    slip(&mut rig, 10_000);
    let fault = rig.finish_with_fault();
    assert!(
        matches!(fault, Fault::Spindle(SpindleCause::Angle { .. })),
        "{fault:?}"
    );
    let text = fault.describe(&*rig.layout);
    assert!(
        text.contains("away from its angle, allowed is 0.5°"),
        "{text}"
    );
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
}

/// What a resumed program needs it brings back: the spindle is oriented before the axes move.
#[test]
fn a_program_that_is_resumed_has_its_spindle_oriented_first() {
    let mut rig = begun_with(&[], "G21 G90\nM19 R200\nG1 X60 F1200\nG1 X0\nM2\n");
    rig.run_until(|rig| rig.session.status().setpoint[0] > 20.0);
    rig.command(Command::Stop);
    settle(&mut rig);
    mdi(&mut rig, "M3 S500");
    mdi(&mut rig, "M5");
    settle(&mut rig);
    go(&mut rig, Command::Resume);
    let before = rig.rows.len();
    go(&mut rig, Command::CycleStart);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    let moves = |row: &&_| -> bool {
        let row: &syncline_controller::control::Row<9> = row;
        row.plan.speed > 0.0
    };
    let first = rig.rows[before..].iter().find(moves).unwrap();
    let turned = first.spindle.unwrap().turns * 360.0;
    assert!(off(turned, 200.0).abs() < ALLOWED, "{turned}°");
    assert_moves_within_limits(&mut rig);
}

// --- the whole input space ---

#[derive(Clone, Debug)]
struct Case {
    /// S before, 1/min, negative counterclockwise; 0: it stands.
    speed: i32,
    /// So long before M19, ms: it may still speed up.
    after: u32,
    angle: f64,
    way: Option<u32>,
    gear: f64,
    reversed: bool,
    ramp: u32,
    /// 60FFh, units of a turn in a minute.
    units: u32,
    cycle: u32,
    /// A feed hold so long behind M19, ms.
    hold: Option<u32>,
    /// A T_PDO of its drive is lost so long behind M19, ms.
    lost: u32,
}

fn case() -> impl Strategy<Value = Case> {
    (
        prop_oneof![Just(0), -3000..-60_i32, 60..3000_i32],
        0..600_u32,
        0.0..360.0_f64,
        prop::option::of(0..3_u32),
        select(vec![0.5, 1.0, 1.5, 4.0]),
        any::<bool>(),
        select(vec![100, 300, 1000]),
        select(vec![10, 100]),
        select(vec![2000, 4000]),
        (prop::option::of(0..700_u32), 0..900_u32),
    )
        .prop_map(
            |(speed, after, angle, way, gear, reversed, ramp, units, cycle, (hold, lost))| Case {
                speed,
                after,
                angle: (angle * 10.0).round() / 10.0,
                way,
                gear,
                reversed,
                ramp,
                units,
                cycle,
                hold,
                lost,
            },
        )
}

/// The speeds that its drive was sent, 1/min of the spindle, and when.
fn told(rig: &Rig, case: &Case) -> Vec<(Instant, f64)> {
    let frames = rig.sent(CobId::r_pdo(1, NodeId::new(4).unwrap()));
    let told = frames.iter().map(|it| match *it.frame.data() {
        [_, _, v0, v1, v2, v3] => {
            let units = f64::from(i32::from_le_bytes([v0, v1, v2, v3]));
            (it.start, units / f64::from(case.units) / case.gear)
        }
        ref data => panic!("{data:?}"),
    });
    told.collect()
}

fn rig_of(case: &Case) -> Rig {
    let spin = match case.speed {
        0 => String::new(),
        speed if speed > 0 => format!("M3 S{speed}\n"),
        speed => format!("M4 S{}\n", -speed),
    };
    let way = case.way.map_or(String::new(), |way| format!(" P{way}"));
    let program = format!(
        "G21 G90\n{spin}G4 P{}\nM19 R{}{way}\nG0 X10\nM0\nM2\n",
        f64::from(case.after) / 1000.0,
        case.angle,
    );
    let node = "node = 4\n";
    let direction = if case.reversed {
        "negative"
    } else {
        "positive"
    };
    let direction = format!("{node}direction = \"{direction}\"\n");
    let ramp = format!("ramp_ms = {}", case.ramp);
    let units = format!("velocity_units = {}", case.units);
    let cycle = format!("cycle_us = {}", case.cycle);
    let gear = format!("tolerance = 0.03\ngear = {:.1}", case.gear);
    let changes = [
        (node, &*direction),
        ("ramp_ms = 300", &ramp),
        ("velocity_units = 10", &units),
        ("cycle_us = 2000", &cycle),
        ("tolerance = 0.03", &gear),
    ];
    drill_with(&changes, &program, |_, _| ())
}

/// What became of the spindle since M19, degrees and 1/min, as the program turns it.
#[derive(Debug)]
struct Watched {
    begun: Instant,
    /// When a T_PDO of its drive is lost.
    loses: Option<Instant>,
    /// Where it stood first.
    from: Option<f64>,
    /// Where it was as the axes set off.
    there: Option<f64>,
    fastest: f64,
    /// When it stood first.
    stood: Option<Instant>,
    /// How far it was clockwise and the other way round at most, since.
    furthest: (f64, f64),
}

impl Watched {
    fn new(begun: Instant, case: &Case) -> Self {
        Self {
            begun,
            loses: Some(begun + Duration::from_millis(case.lost.into())),
            from: None,
            there: None,
            fastest: 0.0,
            stood: None,
            furthest: (f64::NEG_INFINITY, f64::INFINITY),
        }
    }

    fn step(&mut self, rig: &mut Rig, case: &Case) {
        let now = rig.session.timeline().now();
        if self.loses.take_if(|at| *at <= now).is_some() {
            rig.twin(SPINDLE).disturb(Disturbance::LoseTPdos(1));
        }
        rig.step();
        let sign = if case.reversed { -1.0 } else { 1.0 };
        let at = sign * angle(rig, case.gear);
        let speed = turns_at(rig).abs() / case.gear;
        self.fastest = self.fastest.max(speed);
        if speed < 0.05 {
            self.from.get_or_insert(at);
            self.stood.get_or_insert(now);
        }
        if self.from.is_some() {
            let (most, least) = self.furthest;
            self.furthest = (most.max(at), least.min(at));
        }
        if rig.rows.last().is_some_and(|row| row.plan.speed > 0.0) {
            self.there.get_or_insert(at);
        }
    }
}

/// From any speed, either way round, with any gear and drive: it is where it was told before the axes move, the way asked
/// for, never faster than it may, and stays.
fn assert_oriented(case: &Case) {
    let mut rig = rig_of(case);
    rig.run_until(|rig| rig.session.status().spindle.orientation.is_some());
    let mut watched = Watched::new(rig.session.timeline().now(), case);
    if let Some(hold) = case.hold {
        let mut go_on_for = |rig: &mut Rig, ms: u32| {
            for _ in 0..ms * 2000 / case.cycle {
                watched.step(rig, case);
            }
        };
        go_on_for(&mut rig, hold);
        rig.command(Command::FeedHold);
        go_on_for(&mut rig, 500);
        rig.command(Command::Resume);
    }
    while !paused(&rig, Pause::ProgramStop) {
        watched.step(&mut rig, case);
    }
    let Watched {
        begun,
        from,
        there,
        fastest,
        stood,
        furthest,
        ..
    } = watched;
    let there = there.expect("the axes moved");
    assert!(off(there, case.angle).abs() < ALLOWED, "{case:?}: {there}°");
    assert!(fastest < 1.05 * 3000.0, "{case:?}: {fastest} 1/min");
    let from = from.expect("it stood before");
    let turned = there - from;
    let span = match case.way {
        Some(1) => -2.0..362.0,
        Some(2) => -362.0..2.0,
        _ => -182.0..182.0,
    };
    assert!(span.contains(&turned), "{case:?}: turned by {turned}°");
    // It goes no further than there; where it was braked it may have swung.
    let (most, least) = furthest;
    let ends = (there + ALLOWED).max(from + SWINGS)..(there - ALLOWED).min(from - SWINGS);
    assert!(
        most < ends.start && least > ends.end,
        "{case:?}: {least} to {most}, {ends:?}"
    );
    // It is told to stand until it does, and then no more than its drive's ramp can follow.
    let most = 3000.0 * f64::from(case.cycle) / 1000.0 / f64::from(case.ramp);
    let limits = rig.layout.spindle.unwrap().orientation.unwrap().limits;
    let [begins, ends] = [from, there].map(|angle| Motion::at_rest(angle / 360.0));
    let way =
        state_to_state::plan(&state_to_state::Problem::new(begins, ends, limits), 0.0).unwrap();
    let extrema = way.extrema();
    let peak = 60.0 * extrema.velocity.max.max(-extrema.velocity.min);
    let mut before = 0.0;
    for (at, speed) in told(&rig, case) {
        if at <= begun {
            continue;
        }
        if stood.is_some_and(|stood| at < stood) {
            assert_eq!(speed, 0.0, "{case:?} at {at:?}");
        }
        let change: f64 = speed - before;
        assert!(change.abs() < most, "{case:?}: {before} to {speed} 1/min");
        assert!(
            speed.abs() < 1.02 * peak + 5.0,
            "{case:?}: {speed} of {peak} 1/min"
        );
        before = speed;
    }
    let sign = if case.reversed { -1.0 } else { 1.0 };
    let stays = sign * angle(&mut rig, case.gear);
    assert!(off(stays, case.angle).abs() < ALLOWED, "{case:?}: {stays}°");
    assert!(!paused(&rig, Pause::NotOriented), "{case:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    #[test]
    fn it_is_oriented_from_any_state_by_any_drive(case in case()) {
        assert_oriented(&case);
    }
}
