//! A spindle that a CiA 402 drive on the bus turns, in Profile Velocity: `examples/drill`.

use proptest::prelude::*;
use proptest::sample::select;
use syncline_canopen::{CobId, Frame, NodeId};
use syncline_controller::control::fault::{DeviceCause, SpindleCause};
use syncline_controller::control::{End, Event, Fault, Pause, Phase, Row, State};
use syncline_controller::machine::{COORDINATES, Machine};
use syncline_controller::program::Programs;
use syncline_controller::session::Command;
use syncline_drives::twin::{Config, Disturbance, ErrorClass};
use syncline_gcode::Turning;
use syncline_tests::command::machine_file;
use syncline_tests::rig::Rig;

use super::day::{assert_moves_within_limits, go, mdi, settle, state};

/// Its place behind the drives of axes.
pub(super) const SPINDLE: usize = 3;
/// What `tolerance` of the example lets a speed differ by, and the resolution of what the drive tells, 1/min.
const TOLERANCE: f64 = 0.03;
const RESOLUTION: f64 = 0.1;
const FASTEST: f64 = 3000.0;

fn drill(program: &str) -> Rig {
    drill_with(&[], program, |_, _| ())
}

/// The example with parts of its file replaced, and a program that nobody goes on with.
pub(super) fn drill_with(
    replacements: &[(&str, &str)],
    program: &str,
    configure: impl Fn(usize, &mut Config),
) -> Rig {
    let mut rig = Rig::new("drill", replacements, program, configure);
    rig.goes_on = false;
    rig
}

/// What the drive was sent: controlword and velocity, 1/min.
fn sent(rig: &Rig) -> Vec<(u16, f64)> {
    let frames = rig.sent(CobId::r_pdo(1, NodeId::new(4).unwrap()));
    let told = frames.iter().map(|it| match *it.frame.data() {
        [c0, c1, v0, v1, v2, v3] => (
            u16::from_le_bytes([c0, c1]),
            f64::from(i32::from_le_bytes([v0, v1, v2, v3])) / 10.0,
        ),
        ref data => panic!("{data:?}"),
    });
    told.collect()
}

/// The velocities that it was sent, one after the other.
fn speeds(rig: &Rig) -> Vec<f64> {
    let mut speeds: Vec<_> = sent(rig).into_iter().map(|it| it.1).collect();
    speeds.dedup();
    speeds
}

/// How fast the spindle truly turns, 1/min.
pub(super) fn turns_at(rig: &mut Rig) -> f64 {
    rig.twin(SPINDLE).observe().velocity * 60.0
}

pub(super) fn measured(row: &Row<COORDINATES>) -> f64 {
    row.spindle.unwrap().speed
}

/// How fast the program has the spindle turn, 1/min.
fn wanted(row: &Row<COORDINATES>) -> f64 {
    match row.functions.spindle.turning {
        Turning::Off => 0.0,
        Turning::Clockwise => row.functions.spindle.speed,
        Turning::Counterclockwise => -row.functions.spindle.speed,
    }
}

/// Whenever the tool cuts, the spindle has its speed.
pub(super) fn assert_cuts_at_speed(rig: &Rig) {
    let cuts = |row: &&Row<COORDINATES>| {
        let feeds = row.plan.speed > 0.0 && row.plan.feed.is_finite();
        feeds && row.functions.spindle.turning != Turning::Off
    };
    for row in rig.rows.iter().filter(cuts) {
        let (wanted, measured) = (wanted(row), measured(row));
        let window = (TOLERANCE * wanted.abs()).max(0.001 * FASTEST) + RESOLUTION;
        assert!(
            (measured - wanted).abs() <= window,
            "{measured} for {wanted} 1/min"
        );
    }
}

/// The run is over, and neither axes nor spindle were let go in motion.
pub(super) fn assert_let_go_at_rest(rig: &mut Rig) {
    let standing = turns_at(rig).abs();
    assert!(standing < 1.0, "{standing} 1/min at the end");
    for drive in 0..=SPINDLE {
        assert!(!rig.twin(drive).observe().is_powered, "drive {drive}");
    }
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
}

// --- it turns as the program says ---

pub(super) const TWO_SPEEDS: &str =
    "G21 G90 G61\nM3 S2000\nG0 X10\nG1 X20 F1200\nM4 S500\nG1 X30\nM5\nG0 X0\nM2\n";

/// What the spindle's drive tells of its position comes as another one from here on.
pub(super) fn tell_spindle(rig: &mut Rig, mut as_another: impl FnMut(i32) -> i32 + Send + 'static) {
    let told = CobId::t_pdo(1, NodeId::new(4).unwrap());
    rig.bus().doctor = Some(Box::new(move |received| {
        let frame = &received.frame;
        if let [s0, s1, p0, p1, p2, p3] = *frame.data()
            && frame.id() == told.into()
        {
            let count = as_another(i32::from_le_bytes([p0, p1, p2, p3]));
            let [p0, p1, p2, p3] = count.to_le_bytes();
            received.frame = Frame::new(told, &[s0, s1, p0, p1, p2, p3]);
        }
        true
    }));
}

#[test]
fn each_cut_waits_for_its_speed_and_power_for_the_standstill() {
    let mut rig = drill(TWO_SPEEDS);
    rig.run_until(|rig| {
        rig.rows
            .last()
            .is_some_and(|row| row.plan.position[0] > 9.999)
    });
    // The rapid took less than the ramp.
    let begun = rig.rows.len();
    rig.run_until(|rig| {
        rig.rows
            .last()
            .is_some_and(|row| row.plan.position[0] > 10.01)
    });
    assert!(rig.rows.len() > begun + 10, "it waits");
    rig.run_to(Phase::ModeEnd);
    let standing = turns_at(&mut rig).abs();
    assert!(standing < 2.0, "{standing} 1/min");
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_eq!(speeds(&rig), [0.0, 2000.0, -500.0, 0.0]);
    assert_cuts_at_speed(&rig);
    assert_let_go_at_rest(&mut rig);
    let mut words: Vec<u16> = sent(&rig).into_iter().map(|it| it.0).collect();
    words.dedup();
    assert_eq!(words, [0x00, 0x06, 0x0F, 0x06, 0x00]);
    // Nothing but a spindle that the program has on is sent a velocity.
    assert!(
        sent(&rig)
            .iter()
            .all(|(word, speed)| *word == 0x0F || *speed == 0.0)
    );
}

/// Left on to the end, it is stopped by M2, and by an operator's stop in mid-cut.
#[test]
fn a_spindle_that_is_left_on_stands_before_power_is_taken_off() {
    assert_stands_before_power_is_taken_off(drill);
}

/// The same of any machine like it.
pub(super) fn assert_stands_before_power_is_taken_off(drill: impl Fn(&str) -> Rig) {
    let program = "G21 G90 G61\nM3 S3000\nG1 X100 F3000\nM2\n";
    for stops in [false, true] {
        let mut rig = drill(program);
        rig.run_until(|rig| {
            rig.rows
                .last()
                .is_some_and(|row| row.plan.position[0] > 50.0)
        });
        if stops {
            rig.command(Command::Stop);
        }
        rig.run_to(Phase::ModeEnd);
        let standing = turns_at(&mut rig).abs();
        assert!(standing < 2.0, "{standing} 1/min");
        let end = if stops {
            End::Interrupted
        } else {
            End::Finished
        };
        assert_eq!(rig.finish(), end);
        assert_let_go_at_rest(&mut rig);
    }
}

#[test]
fn other_units_and_a_gear_turn_it_as_fast() {
    let units = "encoder_increments = 1_048_576\nvelocity_units = 10";
    for (model, ratio, counts) in [
        ("encoder_increments = 65_536", 1.25, 65_536.0 / 60.0 * 1.25),
        (
            "encoder_increments = 1_048_576\nvelocity_units = 1",
            0.5,
            0.5,
        ),
    ] {
        let gear = format!("drive = \"spindle\"\ngear = {ratio}");
        let changes = [(units, model), ("drive = \"spindle\"", &*gear)];
        let mut rig = drill_with(&changes, TWO_SPEEDS, |_, _| ());
        rig.run_until(|rig| {
            rig.rows
                .last()
                .is_some_and(|row| row.plan.position[0] > 15.0)
        });
        let motor = turns_at(&mut rig);
        assert!(
            (motor / ratio - 2000.0).abs() < 20.0,
            "{motor} 1/min of the motor"
        );
        let row = rig.rows.last().unwrap();
        assert!((measured(row) - 2000.0).abs() < 20.0, "{}", measured(row));
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let told: Vec<f64> = speeds(&rig).iter().map(|speed| speed * 10.0).collect();
        let expected = [0.0, 2000.0, -500.0, 0.0].map(|speed: f64| (speed * counts).round());
        assert_eq!(told, expected);
    }
}

#[test]
fn a_speed_beyond_the_limits_is_refused_when_the_program_is_checked() {
    let file = machine_file("drill");
    let machine = Machine::load(&file).unwrap();
    let programs = Programs::new(&machine, &file).unwrap();
    let checked = |speed: &str| {
        let text = format!("G21 G90\nM3 S{speed}\nG1 X1 F100\nM2\n");
        let program = programs.text("fast.ngc", text.as_bytes());
        program.check(machine.rest()).map(|_| ())
    };
    for speed in ["60", "3000", "0"] {
        checked(speed).unwrap();
    }
    for speed in ["3000.1", "59"] {
        let told = checked(speed).unwrap_err().to_string();
        assert!(told.contains(&format!("S{speed}")), "{told}");
    }
}

/// Whether the path rests because the spindle did not come to its speed.
fn is_not_at_speed(rig: &mut Rig) -> bool {
    let told = |event: &Event| {
        let reason = Pause::NotAtSpeed;
        matches!(event, Event::Paused { reason: told, .. } if *told == reason)
    };
    rig.events.iter().any(told)
}

/// A rotor that its motor takes up more slowly than the ramp, and one that it cannot turn at all.
#[test]
fn what_counts_is_how_fast_it_truly_turns() {
    let heavy = [("load = 0.004", "load = 0.08")];
    let mut rig = drill_with(&heavy, TWO_SPEEDS, |_, _| ());
    rig.run_until(|rig| {
        rig.rows
            .last()
            .is_some_and(|row| row.plan.position[0] > 10.01)
    });
    let waited = rig.rows.len() as f64 * rig.machine.cycle.as_secs_f64();
    assert!(waited > 0.9, "{waited} s");
    assert_cuts_at_speed(&rig);

    assert_waits_for_a_held_rotor(drill(TWO_SPEEDS));
}

/// A rotor that is held is not at speed: no cut of [`TWO_SPEEDS`] begins before it turns.
pub(super) fn assert_waits_for_a_held_rotor(mut rig: Rig) {
    rig.twin(SPINDLE).disturb(Disturbance::Block(true));
    rig.run_until(is_not_at_speed);
    // Two ramps and a second.
    let waited = rig.rows.len() as f64 * rig.machine.cycle.as_secs_f64();
    assert!((1.6..2.0).contains(&waited), "{waited} s");
    assert!(rig.rows.last().unwrap().plan.position[0] <= 10.0);
    rig.twin(SPINDLE).disturb(Disturbance::Block(false));
    let until = rig.rows.len() + 500;
    rig.run_to_row(until);
    rig.command(Command::CycleStart);
    assert_eq!(rig.finish(), End::Finished);
    assert_cuts_at_speed(&rig);
}

/// At once it turns as fast as it is told next, and the other way round.
pub(super) const TURNED_ROUND: &str =
    "G21 G90 G61\nM3 S1000\nG1 X10 F3000\nM4 S1000\nG1 X20\nM3\nX10\nM5\nM2\n";

#[test]
fn the_other_way_round_is_not_at_speed() {
    assert_waits_until_it_is_turned_round(drill(TURNED_ROUND));
}

/// The same of any machine like it.
pub(super) fn assert_waits_until_it_is_turned_round(mut rig: Rig) {
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_cuts_at_speed(&rig);
    let cut = |way: f64| {
        let cuts = |row: &&Row<COORDINATES>| row.plan.speed > 0.0 && wanted(row) == way;
        rig.rows.iter().filter(cuts).count()
    };
    assert!(cut(1000.0) > 100 && cut(-1000.0) > 100);
}

/// Where the drive counts velocities otherwise than the machine file says, no cut begins.
#[test]
fn another_unit_of_its_velocity_is_never_at_speed() {
    let mut rig = drill_with(&[], TWO_SPEEDS, |drive, config| {
        if drive == SPINDLE {
            let units = config.assumed.iter_mut();
            let units = units.filter(|(name, _)| *name == "velocity_units");
            units.for_each(|(_, units)| *units = 60);
        }
    });
    rig.run_until(is_not_at_speed);
    assert!(rig.rows.last().unwrap().plan.position[0] <= 10.0);
    let row = rig.rows.last().unwrap();
    assert!(
        (measured(row) - 2000.0 / 6.0).abs() < 1.0,
        "{}",
        measured(row)
    );
}

/// On a machine that stays on it turns as typed lines leave it, and stands before power goes.
#[test]
fn typed_lines_leave_it_on_and_disabling_stops_it_first() {
    let mut rig = Rig::staying_on("drill", &[], |_, _| ());
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    mdi(&mut rig, "M4 S1500");
    let until = rig.rows.len() + 300;
    rig.run_to_row(until);
    let speed = turns_at(&mut rig);
    assert!((speed + 1500.0).abs() < 10.0, "{speed} 1/min");
    let told = rig.session.status().spindle_actual.unwrap();
    assert!((told.speed + 1500.0).abs() < 10.0, "{told:?}");
    rig.command(Command::Disable);
    rig.run_to(Phase::ModeEnd);
    let standing = turns_at(&mut rig).abs();
    assert!(standing < 2.0, "{standing} 1/min");
    settle(&mut rig);
    assert_eq!(state(&rig), State::Disabled);
    // Enabling turns nothing on.
    go(&mut rig, Command::Enable);
    let until = rig.rows.len() + 300;
    rig.run_to_row(until);
    assert!(turns_at(&mut rig).abs() < 1.0);
}

// --- it is lost ---

pub(super) const CUT: &str = "G21 G90 G61\nM3 S2400\nG1 X150 F6000\nX-150\nX150\nM2\n";

/// Each way in which it is lost, and what is told of it.
pub(super) const LOSSES: [(Disturbance, &str); 5] = [
    (Disturbance::Fault(ErrorClass::StopAndSwitchOff), "EMCY"),
    (Disturbance::Fault(ErrorClass::SwitchOff), "EMCY"),
    (Disturbance::Mute(true), "no T_PDO in 2 cycles"),
    (Disturbance::Reset, "no T_PDO in 2 cycles"),
    (Disturbance::Mains(false), "EMCY"),
];

fn begun(program: &str) -> Rig {
    begun_with(&[], program)
}

/// The same machine, which stays on, and runs a program from its file.
pub(super) fn begun_with(replacements: &[(&str, &str)], program: &str) -> Rig {
    let mut rig = Rig::staying_on("drill", replacements, |_, _| ());
    rig.goes_on = false;
    settle(&mut rig);
    let file = rig.folder.file("part.ngc", program);
    rig.command(Command::Load(file));
    rig.command(Command::Run { from_line: None });
    rig
}

/// Resumes what was interrupted, to its end.
fn resume(rig: &mut Rig) {
    go(rig, Command::Resume);
    assert_eq!(state(rig), State::Held, "{:?}", rig.refused);
    go(rig, Command::CycleStart);
    assert_eq!(state(rig), State::Ready, "{:?}", rig.events);
    assert_eq!(rig.session.status().setpoint[0], 60.0);
    assert_cuts_at_speed(rig);
    assert_eq!(rig.problems, [""; 0]);
    assert_moves_within_limits(rig);
}

pub(super) const FROM_NEAR: &str = "G21 G90 G61\nM3 S2000\nG1 X40 F1200\nX60\nM2\n";

/// After a fault, of an axis or of the spindle itself, it stands, and has its speed again before the cut goes on.
#[test]
fn a_cut_that_is_resumed_waits_for_its_speed() {
    for failing in [0, SPINDLE] {
        assert_resumes_behind_a_fault(begun(FROM_NEAR), failing);
    }
}

/// The same of a machine that has begun with [`FROM_NEAR`], and of one of its drives.
pub(super) fn assert_resumes_behind_a_fault(mut rig: Rig, failing: usize) {
    rig.run_until(|rig| rig.session.status().setpoint[0] > 20.0);
    let fault = Disturbance::Fault(ErrorClass::StopAndSwitchOff);
    rig.twin(failing).disturb(fault);
    settle(&mut rig);
    assert_eq!(state(&rig), State::Faulted);
    go(&mut rig, Command::Reset);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert_eq!(rig.session.status().interrupted, Some(3));
    let standing = turns_at(&mut rig).abs();
    assert!(standing < 1.0, "{standing} 1/min");
    resume(&mut rig);
}

/// Left for typed lines where it did not come to its speed: what was awaited is awaited still.
#[test]
fn a_cut_that_waited_waits_behind_typed_lines_too() {
    let mut rig = begun(FROM_NEAR);
    rig.run_until(|rig| rig.session.status().spindle.turning == Turning::Clockwise);
    rig.twin(SPINDLE).disturb(Disturbance::Block(true));
    settle(&mut rig);
    assert!(is_not_at_speed(&mut rig));
    mdi(&mut rig, "G10 L2 P2 X5");
    assert_eq!(state(&rig), State::Held);
    rig.twin(SPINDLE).disturb(Disturbance::Block(false));
    resume(&mut rig);
}

fn lost(row: usize, loss: (Disturbance, &str)) {
    assert_lost(drill(CUT), "PV", row, loss);
}

/// Has a spindle's drive of this mode lost in a row of [`CUT`]; the axes stop on their path, and nothing stays on.
pub(super) fn assert_lost(
    mut rig: Rig,
    mode: &str,
    row: usize,
    (disturbance, told): (Disturbance, &str),
) {
    rig.run_to_row(row);
    rig.twin(SPINDLE).disturb(disturbance);
    let before = rig.rows.len();
    let fault = rig.finish_with_fault();
    assert!(matches!(fault, Fault::Device(SPINDLE, _)), "{fault:?}");
    let text = fault.describe(&*rig.layout);
    let who = format!("the spindle's drive, node 4 (spindle, CiA 402 {mode}): ");
    assert!(text.starts_with(&who) && text.contains(told), "{text}");
    // No axis was quick-stopped: all came to rest on the line.
    assert!(rig.rows[before..].iter().all(|row| !row.axes[0].by_itself));
    let beside = |row: &Row<COORDINATES>| row.axes[1].set.abs().max(row.axes[2].set.abs());
    assert!(rig.rows.iter().all(|row| beside(row) < 0.001));
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
    assert!(!rig.twin(0).observe().is_powered);
}

#[test]
fn each_loss_of_it_stops_the_axes_on_their_path_with_its_own_message() {
    for loss in LOSSES {
        lost(400, loss);
    }
}

/// What stops the machine for another reason stops the spindle by its ramp.
#[test]
fn a_fault_of_an_axis_stops_it() {
    let mut rig = drill(CUT);
    rig.run_to_row(400);
    rig.twin(0)
        .disturb(Disturbance::Fault(ErrorClass::QuickStop));
    let fault = rig.finish_with_fault();
    let cause = matches!(fault, Fault::Device(0, DeviceCause::Emergency { .. }));
    assert!(cause, "{fault:?}");
    assert!(turns_at(&mut rig).abs() < 1.0);
    assert_eq!(speeds(&rig), [0.0, 2400.0, 0.0]);
}

// --- it keeps its speed in a cut ---

/// What `speed_loss_ms` is where it is left out, s.
const LOSS: f64 = 0.2;
/// Its speed is the mean of the last 20 ms.
const AVERAGED: f64 = 0.02;

/// Whether the path cuts with the spindle on, in a row.
fn cuts(row: &Row<COORDINATES>) -> bool {
    let feeds = row.plan.speed > 0.0 && row.plan.feed.is_finite() && !row.plan.off_path;
    feeds && row.functions.spindle.turning != Turning::Off
}

fn off_its_speed(row: &Row<COORDINATES>) -> bool {
    let window = (TOLERANCE * wanted(row).abs()).max(0.001 * FASTEST);
    (measured(row) - wanted(row)).abs() > window
}

/// For how many rows up to the first in which the tool may not cut any longer the spindle has been off its speed; none
/// if it may to the end.
fn first_bad_cut(rig: &Rig, loss: f64) -> Option<usize> {
    let most = (loss / rig.machine.cycle.as_secs_f64()).round() as usize;
    let (mut told, mut right, mut reached, mut off) = (0.0, 0, false, 0);
    rig.rows.iter().position(|row| {
        if wanted(row) != told {
            (told, right, reached, off) = (wanted(row), 0, false, 0);
        }
        right = if off_its_speed(row) { 0 } else { right + 1 };
        reached |= right >= 25 && told != 0.0;
        off = if reached && off_its_speed(row) {
            off + 1
        } else {
            0
        };
        off > most && cuts(row)
    })
}

fn lost_its_speed(fault: &Fault) -> bool {
    matches!(fault, Fault::Spindle(SpindleCause::Speed { .. }))
}

/// Held by the material, or with a motor that pulls no longer.
#[test]
fn a_cut_whose_spindle_falls_away_stops_on_the_path() {
    for hinders in [Disturbance::Block(true), Disturbance::LoseTorque(true)] {
        let mut rig = drill(CUT);
        rig.run_to_row(400);
        rig.twin(SPINDLE).disturb(hinders);
        let before = rig.rows.len();
        let fault = rig.finish_with_fault();
        let Fault::Spindle(SpindleCause::Speed { speed, told, .. }) = fault else {
            panic!("{fault:?}")
        };
        assert!(told == 2400.0 && speed < 2400.0 - 72.0, "{fault:?}");
        let text = fault.describe(&*rig.layout);
        assert!(
            text.contains("in a cut, told were 2400 ± 72 1/min"),
            "{text}"
        );
        let bad = first_bad_cut(&rig, LOSS).unwrap();
        let waited = (bad - before) as f64 * rig.machine.cycle.as_secs_f64();
        assert!(waited >= LOSS, "{waited} s");
        if matches!(hinders, Disturbance::Block(_)) {
            assert!(waited <= LOSS + AVERAGED, "{waited} s");
        }
        // It slows down at once, and no axis leaves the line for it.
        let slower = rig.rows[bad..bad + 4].last().unwrap().plan.speed;
        assert!(slower < rig.rows[bad].plan.speed, "{slower} mm/s");
        assert!(rig.rows[before..].iter().all(|row| !row.axes[0].by_itself));
        assert_eq!(speeds(&rig), [0.0, 2400.0, 0.0]);
        rig.trace().assert_within_limits();
        assert!(rig.ends_at_rest());
    }
}

/// On a machine that stays on it is an operator's: reset, and the block that was not completed.
#[test]
fn the_cut_is_resumed_after_the_reset() {
    let mut rig = begun(FROM_NEAR);
    rig.run_until(|rig| rig.session.status().setpoint[0] > 20.0);
    rig.twin(SPINDLE).disturb(Disturbance::Block(true));
    settle(&mut rig);
    assert_eq!(state(&rig), State::Faulted);
    assert!(lost_its_speed(&rig.controller().faults()[0]));
    rig.twin(SPINDLE).disturb(Disturbance::Block(false));
    go(&mut rig, Command::Reset);
    assert_eq!(rig.session.status().interrupted, Some(3));
    go(&mut rig, Command::Resume);
    go(&mut rig, Command::CycleStart);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert_eq!(rig.session.status().setpoint[0], 60.0);
}

const LOSS_OF_A_SECOND: (&str, &str) =
    ("tolerance = 0.03", "tolerance = 0.03\nspeed_loss_ms = 1000");

/// What is over within the time stops nothing.
#[test]
fn a_knock_is_no_loss() {
    let mut rig = drill_with(&[LOSS_OF_A_SECOND], CUT, |_, _| ());
    for row in [400, 1200] {
        rig.run_to_row(row);
        rig.twin(SPINDLE).disturb(Disturbance::Block(true));
        rig.run_to_row(row + 50);
        assert!(off_its_speed(rig.rows.last().unwrap()));
        rig.twin(SPINDLE).disturb(Disturbance::Block(false));
    }
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
}

/// Rapids go on; the first cut behind them does not even begin to dig in.
#[test]
fn a_rapid_is_no_cut() {
    let program = "G21 G90 G61\nM3 S2400\nG1 X10 F6000\nG0 X150\nX-150\nX150\nG1 X140\nM2\n";
    let blocked_at = |rig: &mut Rig| {
        rig.run_until(|rig| {
            rig.rows
                .last()
                .is_some_and(|row| row.plan.position[0] > 20.0)
        });
        rig.twin(SPINDLE).disturb(Disturbance::Block(true));
    };
    let mut rig = drill(program);
    blocked_at(&mut rig);
    let fault = rig.finish_with_fault();
    assert!(lost_its_speed(&fault), "{fault:?}");
    let last = rig.rows.last().unwrap().plan.position[0];
    assert!((149.99..=150.0).contains(&last), "{last} mm");

    let mut rig = drill(program);
    blocked_at(&mut rig);
    rig.run_until(|rig| {
        rig.rows
            .last()
            .is_some_and(|row| row.plan.position[0] < -100.0)
    });
    rig.twin(SPINDLE).disturb(Disturbance::Block(false));
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
}

/// Who goes on where it did not come to its speed has decided so: it is watched once it has had it.
#[test]
fn an_operator_may_cut_without_its_speed() {
    let mut rig = drill(TWO_SPEEDS);
    rig.twin(SPINDLE).disturb(Disturbance::Block(true));
    rig.run_until(is_not_at_speed);
    rig.command(Command::CycleStart);
    rig.run_until(|rig| {
        rig.rows
            .last()
            .is_some_and(|row| row.plan.position[0] > 19.999)
    });
    rig.twin(SPINDLE).disturb(Disturbance::Block(false));
    rig.run_until(|rig| {
        rig.rows
            .last()
            .is_some_and(|row| row.plan.position[0] > 25.0)
    });
    rig.twin(SPINDLE).disturb(Disturbance::Block(true));
    // 10 mm at 20 mm/s.
    let fault = rig.finish_with_fault();
    assert!(lost_its_speed(&fault), "{fault:?}");
}

// --- what it measures ---

/// Position and speed of each SYNC are those of the rotor, across the end of 6064h, either way round.
#[test]
fn its_position_is_counted_on_beyond_what_6064h_holds() {
    // Half a revolution before the end of 32 bits, of 20 for a revolution.
    let end = f64::from(1 << 11);
    for (code, start) in [("M3", end - 0.5), ("M4", 0.5 - end)] {
        let program = format!("G21 G90 G61\n{code} S1200\nG4 P1\nM5\nG4 P0.5\nM2\n");
        let mut rig = drill_with(&[], &program, |drive, config| {
            if drive == SPINDLE {
                config.position = start;
            }
        });
        let mut most: f64 = 0.0;
        let mut before: Option<f64> = None;
        let offset = rig.layout.setpoint_offset.as_secs_f64();
        while rig.step() {
            let seen = rig.rows.len();
            let Some(sample) = rig.rows.last().and_then(|row| row.spindle) else {
                continue;
            };
            let twin = rig.twin(SPINDLE).observe();
            assert_eq!(sample.age, 0);
            if let Some(before) = before.replace(sample.turns) {
                let step = (sample.turns - before).abs();
                assert!(step < 0.05, "{step} revolutions in row {seen}");
            }
            // The rotor has gone on since SYNC, for up to a cycle.
            let since = (twin.position - sample.turns).abs();
            assert!(
                since < 0.003 + twin.velocity.abs() * (offset + 1e-3),
                "{since}"
            );
            most = most.max(sample.turns.abs());
        }
        assert_eq!(rig.end(), Some(End::Finished));
        assert!(most > end + 10.0, "{most}");
    }
}

/// One T_PDO that is lost stops nothing, and shows as the age of what was measured.
#[test]
fn a_lost_t_pdo_ages_what_is_measured() {
    let mut rig = drill(CUT);
    for row in [300, 400, 403, 700] {
        rig.run_to_row(row);
        let before = rig.rows.last().unwrap().spindle.unwrap();
        rig.twin(SPINDLE).disturb(Disturbance::LoseTPdos(1));
        rig.run_to_row(row + 1);
        let old = rig.rows.last().unwrap().spindle.unwrap();
        assert_eq!((old.age, old.turns), (1, before.turns), "row {row}");
        rig.run_to_row(row + 2);
        let now = rig.rows.last().unwrap().spindle.unwrap();
        // Two cycles at 2400 1/min.
        let gone = now.turns - before.turns;
        assert!(
            now.age == 0 && (gone - 0.16).abs() < 0.002,
            "row {row}: {gone}"
        );
    }
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
}

// --- whatever the program ---

#[derive(Clone, Copy, Debug)]
pub(super) enum Line {
    Turn(bool, u32),
    Speed(u32),
    Off,
    Cut(f64, u32),
    Rapid(f64),
    Dwell(f64),
}

pub(super) fn line() -> impl Strategy<Value = Line> {
    let speed = || select(vec![60u32, 100, 333, 1000, 2500, 3000]);
    prop_oneof![
        3 => (any::<bool>(), speed()).prop_map(|(reverse, speed)| Line::Turn(reverse, speed)),
        2 => speed().prop_map(Line::Speed),
        1 => Just(Line::Off),
        3 => (1.0..20.0f64, 300..6000u32).prop_map(|(by, feed)| Line::Cut(by, feed)),
        2 => (1.0..40.0f64).prop_map(Line::Rapid),
        1 => (0.01..0.3f64).prop_map(Line::Dwell),
    ]
}

/// The program's text, and the speeds that the spindle is told in turn: where nothing lies between two M-codes, the last
/// one alone.
pub(super) fn program(lines: &[Line], mode: &str) -> (String, Vec<f64>) {
    let mut text = format!("G21 G91 {mode}\n");
    let (mut told, mut now) = (vec![0.0], 0.0);
    let (mut last, mut sign, mut way) = (0.0, 0.0, 1.0);
    for line in lines {
        match *line {
            Line::Turn(reverse, speed) => {
                text += &format!("{} S{speed}\n", if reverse { "M4" } else { "M3" });
                (last, sign) = (f64::from(speed), if reverse { -1.0 } else { 1.0 });
            }
            Line::Speed(speed) => {
                text += &format!("S{speed}\n");
                last = f64::from(speed);
            }
            Line::Off => {
                text += "M5\n";
                sign = 0.0;
            }
            Line::Cut(..) | Line::Rapid(_) | Line::Dwell(_) => {
                match *line {
                    Line::Cut(by, feed) => text += &format!("G1 X{:.3} F{feed}\n", way * by),
                    Line::Rapid(by) => text += &format!("G0 X{:.3}\n", way * by),
                    Line::Dwell(time) => text += &format!("G4 P{time:.3}\n"),
                    _ => {}
                }
                told.push(now);
                way = -way;
            }
        }
        now = if sign == 0.0 { 0.0 } else { last * sign };
    }
    // The last ones are in force for no more than a cycle before M2 ends them.
    told.push(0.0);
    told.dedup();
    (text + "M2\n", told)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// Speeds reach the drive in the program's order, each cut begins and goes on at its speed, the axes keep their
    /// limits, everything stands in the end, and a second run sends the same frames.
    #[test]
    fn any_program_turns_it_in_order(
        lines in prop::collection::vec(line(), 1..16),
        mode in select(vec!["G61", "G61.1", "G64"]),
        ramp in 150..1500u32,
        load in 0.0005..0.03f64,
    ) {
        let (text, told) = program(&lines, mode);
        let ramp = format!("ramp_ms = {ramp} ");
        let load = format!("load = {load:.5} ");
        let changes = [("ramp_ms = 300 ", &*ramp), ("load = 0.004 ", &*load)];
        let drill = |text: &str| drill_with(&changes, text, |_, _| ());
        let mut rig = drill(&text);
        prop_assert_eq!(rig.finish(), End::Finished, "{}", text);
        prop_assert_eq!(speeds(&rig), told, "{}", text);
        assert_cuts_at_speed(&rig);
        assert_let_go_at_rest(&mut rig);
        let mut again = drill(&text);
        again.finish();
        prop_assert_eq!(rig.frames(), again.frames());
    }

    /// Whatever the program, and whenever it is held up for how long: the path stops in the very cycle in which it has been
    /// off its speed for too long in a cut, and in no other.
    #[test]
    fn it_stops_exactly_where_a_cut_has_lost_its_speed(
        lines in prop::collection::vec(line(), 4..16),
        knocks in prop::collection::vec((50..600usize, 1..200usize), 1..4),
        loss in select(vec![20u32, 50, 200, 500]),
    ) {
        let (text, _) = program(&lines, "G61");
        let key = format!("tolerance = 0.03\nspeed_loss_ms = {loss}");
        let mut rig = drill_with(&[("tolerance = 0.03", &key)], &text, |_, _| ());
        let mut stopped = None;
        rig.goes_on = true;
        for (after, lasts) in knocks {
            for (rows, blocks) in [(after, true), (lasts, false)] {
                let until = rig.rows.len() + rows;
                while rig.rows.len() < until && rig.step() {
                    let is_faulty = !rig.controller().faults().is_empty();
                    stopped = stopped.or(is_faulty.then_some(rig.rows.len()));
                }
                rig.twin(SPINDLE).disturb(Disturbance::Block(blocks));
            }
        }
        while rig.step() {
            let is_faulty = !rig.controller().faults().is_empty();
            stopped = stopped.or(is_faulty.then_some(rig.rows.len()));
        }
        let bad = first_bad_cut(&rig, f64::from(loss) / 1e3);
        match (rig.end().unwrap(), bad) {
            (End::Fault(fault), Some(bad)) => {
                prop_assert!(lost_its_speed(&fault), "{:?}", fault);
                let after = stopped.unwrap() - bad;
                prop_assert!(after <= 2, "{} rows later", after);
            }
            (End::Finished, None) => {}
            (end, bad) => prop_assert!(false, "{:?}, row {:?} of {}", end, bad, text),
        }
        assert_let_go_at_rest(&mut rig);
    }

    /// Whenever and however it is lost.
    #[test]
    fn no_loss_of_it_takes_an_axis_off_its_path(row in 1..2000usize, loss in select(LOSSES.to_vec())) {
        lost(row, loss);
    }
}
