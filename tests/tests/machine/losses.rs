//! Devices of several kinds that are lost, each noticed by its own means and in the time that start-up tells: Y of the
//! portal on a TLC53x that is sent velocities, Z on a TSP10-CBE with a TWK CRN on its screw, U and W point to point on
//! a TLC53x and a TSP10-CBE.

use super::day::{at, go, settle, state};
use super::{point_to_point, stepper, velocity};
use proptest::prelude::*;
use proptest::sample::select;
use std::fmt::Write as _;
use std::ops::Range;
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, CobId};
use syncline_controller::bus::BusFault;
use syncline_controller::control::fault::{AxisCause, BusCause, Names};
use syncline_controller::control::loss::{Compared, Sign};
use syncline_controller::control::{End, Event, Fault, State};
use syncline_controller::session::Command;
use syncline_drives::twin::{Config, Disturbance, ErrorClass};
use syncline_gcode::AxisLetter;
use syncline_tests::command::{Folder, ended, syncline};
use syncline_tests::rig::Rig;

// Among the devices.
pub(super) const Y: usize = 2;
pub(super) const Z: usize = 3;
pub(super) const U: usize = 4;
pub(super) const W: usize = 6;
pub(super) const SCREW: usize = 7;

/// U makes room for the encoder.
const MOVED: (&str, &str) = (
    "node = 5\nmodel = \"tlc5xx\"",
    "node = 8\nmodel = \"tlc5xx\"",
);

/// Two stepper controllers, each change of whose statuswords is told, are much for one bus.
const CYCLE: (&str, &str) = ("cycle_us = 4000", "cycle_us = 6000");

/// Path and single axes by turns.
pub(super) const PROGRAM: &str = "G21 G90 G94 G61 G18\nG1 X40 Y30 Z-40 F3000\nG0 U80 W6\nG2 X40 Z-40 I20\nG0 U0 W2\n\
    G1 X100 Y80 Z-10\nG1 Z-60 Y0 F4800\nG1 Z-5 Y90\nM2\n";

/// Rows of it; a loss is before that.
const ROWS: usize = 1000;

fn changes<'a>(more: &[(&'a str, &'a str)]) -> Vec<(&'a str, &'a str)> {
    let of_kinds = [&velocity::CHANGES[..], &stepper::CHANGES, more].concat();
    [&point_to_point::CHANGES[..], &[MOVED, CYCLE], &of_kinds].concat()
}

fn machine_of(more: &[(&str, &str)], program: &str, configure: impl Fn(usize, &mut Config)) -> Rig {
    Rig::new("portal", &changes(more), program, configure)
}

pub(super) fn machine_with(program: &str, configure: impl Fn(usize, &mut Config)) -> Rig {
    machine_of(&[], program, configure)
}

/// The same machine without a program.
pub(super) fn staying_on(more: &[(&str, &str)]) -> Rig {
    Rig::staying_on("portal", &changes(more), |_, _| ())
}

fn machine() -> Rig {
    machine_with(PROGRAM, |_, _| ())
}

/// What happens to a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Loss {
    /// The power stage's supply fails.
    Power,
    /// The control supply fails and returns.
    Control,
    /// Nothing that it sends arrives.
    Bus,
    /// Its heartbeat alone does not.
    Heartbeat,
    /// A panel takes control of it.
    LocalControl,
    /// Its own monitoring finds an error.
    Error,
}

/// How a loss is noticed: by what is stated for a sign, or as the device tells of it.
#[derive(Clone, Copy, Debug)]
pub(super) enum By {
    Sign(fn(Sign) -> bool),
    Telling,
}

const T_PDOS: By = By::Sign(|sign| sign == Sign::TPdos);
const HEARTBEAT: By = By::Sign(|sign| sign == Sign::Heartbeat);
const ANSWERS: By = By::Sign(|sign| matches!(sign, Sign::Answers(_)));

/// Each loss of each device, by what it is noticed and what is said.
pub(super) const LOSSES: [(usize, Loss, By, &str); 20] = [
    (Y, Loss::Power, By::Telling, "EMCY 3120h"),
    (Y, Loss::Control, T_PDOS, "no T_PDO in 2 cycles in a row"),
    (Y, Loss::Bus, T_PDOS, "no T_PDO in 2 cycles in a row"),
    (Y, Loss::Heartbeat, HEARTBEAT, "heartbeat lost"),
    (Y, Loss::Error, By::Telling, "EMCY 8611h"),
    (Z, Loss::Power, By::Telling, "drive fault, statusword"),
    (Z, Loss::Control, ANSWERS, "booted in the middle of the run"),
    (Z, Loss::Bus, ANSWERS, "no answer to the polls of 6064h:0"),
    (Z, Loss::Error, By::Telling, "drive fault, statusword"),
    (U, Loss::Power, By::Telling, "EMCY 3120h"),
    (U, Loss::Control, T_PDOS, "no T_PDO in 2 cycles in a row"),
    (U, Loss::Bus, T_PDOS, "no T_PDO in 2 cycles in a row"),
    (U, Loss::Heartbeat, HEARTBEAT, "heartbeat lost"),
    (
        U,
        Loss::LocalControl,
        By::Telling,
        "not under fieldbus control",
    ),
    (W, Loss::Power, By::Telling, "drive fault, statusword"),
    (W, Loss::Control, ANSWERS, "booted in the middle of the run"),
    (W, Loss::Bus, ANSWERS, "no answer to the polls of 6064h:0"),
    (
        SCREW,
        Loss::Control,
        T_PDOS,
        "no T_PDO in 2 cycles in a row",
    ),
    (SCREW, Loss::Bus, T_PDOS, "no T_PDO in 2 cycles in a row"),
    (SCREW, Loss::Error, By::Telling, "EMCY FFFFh"),
];

pub(super) fn happen(rig: &mut Rig, device: usize, loss: Loss) {
    let disturbance = match loss {
        Loss::Power => Disturbance::Mains(false),
        Loss::Control => Disturbance::Reset,
        Loss::Bus => Disturbance::Mute(true),
        Loss::LocalControl => Disturbance::Remote(false),
        Loss::Error => Disturbance::Fault(ErrorClass::StopAndSwitchOff),
        Loss::Heartbeat => {
            let node = rig.layout.devices[device].device.spec().node;
            let heartbeat = CanId::from(CobId::error_control(node));
            rig.bus().doctor = Some(Box::new(move |received| received.frame.id() != heartbeat));
            return;
        }
    };
    rig.twin(device).disturb(disturbance);
}

/// The first fault after a loss, in words, and when it was raised after it.
fn lost(rig: &mut Rig, device: usize, loss: Loss) -> (String, Duration) {
    let before = rig.session.timeline().now();
    happen(rig, device, loss);
    rig.run_until(|rig| !rig.controller().faults().is_empty());
    let fault = rig.controller().faults()[0];
    let fault = fault.describe(&*rig.layout);
    (fault, rig.session.timeline().now().saturating_since(before))
}

/// The time in which it has to be noticed.
pub(super) fn stated(rig: &Rig, device: usize, by: By) -> Duration {
    match by {
        By::Telling => rig.layout.tells_within(device),
        By::Sign(is) => {
            let mut notices = rig.layout.notices(device);
            notices.find(|it| is(it.sign)).expect("it has it").within
        }
    }
}

#[test]
fn the_program_goes_to_its_end_without_a_loss() {
    let mut rig = machine();
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert!(rig.rows.len() > ROWS, "{}", rig.rows.len());
}

/// Loses a device at a wake-up and holds what follows against what is stated.
fn check(row: usize, wake_ups: usize, (device, loss, by, text): (usize, Loss, By, &str)) {
    let mut rig = machine();
    rig.run_to_row(row);
    for _ in 0..wake_ups {
        rig.step();
    }
    let (fault, after) = lost(&mut rig, device, loss);
    let (node, name, _) = rig.layout.device(device);
    let case = format!("{name} {loss:?} at row {row}: {fault}, {after:?}");
    println!("{case}");
    let who = format!("node {node} ({name}, ");
    // A stepper without current does not stay where its encoder tells that it should.
    let moved = (device, loss) == (Z, Loss::Control) && fault.starts_with("axis Z: ");
    assert!(
        moved || fault.starts_with(&who) && fault.contains(text),
        "{case}"
    );
    assert!(after <= stated(&rig, device, by), "{case}");
    assert!(matches!(rig.finish(), End::Fault(_)), "{case}");
    assert!(rig.ends_at_rest(), "{case}");
    // Whoever cannot be reached stops by its own supervision, or by the enable chain.
    let end = rig.session.timeline().now() + Duration::from_secs(1);
    rig.session.timeline().world().advance_to(end);
    for drive in 0..rig.machine.drives.len() {
        let seen = rig.twin(drive).observe();
        assert!(seen.velocity.abs() < 0.01, "{case}: {drive} {seen:?}");
    }
}

#[test]
fn each_loss_has_its_own_message_and_is_noticed_in_time() {
    for case in LOSSES {
        check(150, 0, case);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Every loss of every device at every instant, whether its axis moves or rests.
    #[test]
    fn a_loss_is_noticed_at_any_time(
        case in 0..LOSSES.len(), row in 1..ROWS, wake_ups in 0..3usize,
    ) {
        check(row, wake_ups, LOSSES[case]);
    }
}

/// A TSP10-CBE that stands and begins anew without telling is found by its state in the time that start-up tells.
fn begins_anew_at_rest(cycle: &str, wake_ups: usize) {
    let cycle = [(CYCLE.1, cycle)];
    let mut rig = machine_of(&cycle, "G21 G90\nG4 P5\nM2\n", |_, _| ());
    rig.run_to_row(50);
    for _ in 0..wake_ups {
        rig.step();
    }
    // What it would tell does not arrive.
    happen(&mut rig, W, Loss::Heartbeat);
    let (fault, after) = lost(&mut rig, W, Loss::Control);
    let state = By::Sign(|sign| matches!(sign, Sign::State(_)));
    println!("{fault}, {after:?}");
    assert!(fault.contains("power stage off, statusword"), "{fault}");
    assert!(after <= stated(&rig, W, state), "{after:?}");
    assert!(matches!(rig.finish(), End::Fault(_)));
}

/// Also where a cycle is as long as it is from one request for its position to the next.
#[test]
fn one_that_begins_anew_at_rest_is_found_by_its_state() {
    begins_anew_at_rest(CYCLE.1, 0);
    begins_anew_at_rest("cycle_us = 20000", 0);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    #[test]
    fn one_that_begins_anew_at_rest_is_found_whenever_it_does(wake_ups in 0..300usize) {
        begins_anew_at_rest(CYCLE.1, wake_ups);
    }
}

// --- steps are lost ---

/// The place of Z among the coordinates. The encoder on its screw is allowed to be 0.1 mm from its drive.
const Z_COORDINATE: usize = 2;
/// Of its screw, mm.
const PITCH: f64 = 10.0;
/// By how much both differ without a loss, mm.
const MARGIN: f64 = 0.02;

/// What has Z sent velocities; without it, it goes point to point, and its encoder only watches.
const SENT_VELOCITIES: &str = "position_loop = \"encoder\"\nunsupervised_stop = \"hardware\"";

fn axis_z(rig: &Rig) -> usize {
    let mut axes = rig.layout.axes.iter();
    axes.position(|axis| axis.name == "Z").expect("it has one")
}

/// What the screw slips against the motor is as a loss of steps; how long it takes until that is a fault.
fn slips(rig: &mut Rig, mm: f64) -> Duration {
    let z = axis_z(rig);
    let before = rig.session.timeline().now();
    rig.slip(0, mm / PITCH);
    rig.run_until(|rig| !rig.controller().faults().is_empty());
    match rig.controller().faults()[0] {
        Fault::Axis(axis, AxisCause::FeedbackDifference { difference }) if axis == z => {
            assert!((difference - mm).abs() < MARGIN, "{difference}, {mm}");
        }
        other => panic!("another fault: {other:?}"),
    }
    rig.session.timeline().now().saturating_since(before)
}

/// The drive tells its position at SYNC, and the axis moves or rests.
fn found_at_sync(row: usize, wake_ups: usize, mm: f64) {
    const WATCHED: (&str, &str) = (
        "max_jerk = 80_000.0",
        "max_jerk = 80_000.0\nfeedback = \"screw\"\ndifference_limit = 0.1",
    );
    let program = "G21 G90 G94 G61\nG1 Z-40 X20 F6000\nG4 P0.2\nG1 Z-5 X0\nG4 P1\nM2\n";
    let encoder = stepper::CHANGES[1];
    let mut rig = Rig::new("portal", &[encoder, WATCHED], program, |_, _| ());
    rig.run_to_row(row);
    for _ in 0..wake_ups {
        rig.step();
    }
    let (compared, within) = rig.layout.comparison(axis_z(&rig)).unwrap();
    assert_eq!(compared, Compared::AtSync);
    let after = slips(&mut rig, mm);
    println!("at SYNC: {mm} mm at row {row}: {after:?} of {within:?}");
    assert!(after <= within, "{mm} mm at row {row}: {after:?}");
}

/// The drive is asked for its position, and the loop makes up for the loss before both rest again.
fn found_at_rest(row: usize, mm: f64) {
    let mut rig = machine_of(&[], "G21 G90\nG4 P5\nM2\n", |_, _| ());
    rig.run_to_row(row);
    let (compared, within) = rig.layout.comparison(axis_z(&rig)).unwrap();
    assert_eq!(compared, Compared::AtRest);
    let after = slips(&mut rig, mm);
    // The axis is where it was within its `standstill_window`.
    let act: Vec<f64> = rig
        .rows
        .iter()
        .map(|row| row.axes[Z_COORDINATE].act)
        .collect();
    let rests = |position: &&f64| (**position - act[act.len() - 1]).abs() <= 0.05;
    let rested = rig.layout.cycle * act.iter().rev().take_while(rests).count() as u32;
    let rested = rested.min(after);
    println!("at rest: {mm} mm at row {row}: {after:?}, rested {rested:?} of {within:?}");
    assert!(
        rested <= within,
        "{mm} mm at row {row}: {rested:?} of {within:?}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    #[test]
    fn lost_steps_are_found_in_the_time_that_start_up_tells(
        row in 5..600usize, wake_ups in 0..3usize, mm in 0.13..0.9f64, backward: bool,
    ) {
        let mm = if backward { -mm } else { mm };
        found_at_sync(row, wake_ups, mm);
        // More at once is a jump, and found at the next SYNC.
        found_at_rest(row, mm.clamp(-0.5, 0.5));
    }
}

/// Steps that a motor really loses, as its rotor is held fast on the way: the drive, which counts what it sends, notices nothing, and
/// the encoder tells it once both rest, or as soon as it has stood while the drive says that it went on.
#[test]
fn steps_that_a_motor_loses_on_its_way_are_found() {
    let goes = (SENT_VELOCITIES, "");
    for rows in [5, 20, 60] {
        let mut rig = machine_of(&[goes], "G21 G90\nG0 Z-40\nG4 P2\nM2\n", |_, _| ());
        let act = |rig: &Rig| {
            rig.rows
                .last()
                .map_or(0.0, |row| row.axes[Z_COORDINATE].act)
        };
        rig.run_until(|rig| act(rig) < -10.0);
        rig.twin(Z).disturb(Disturbance::Block(true));
        let row = rig.rows.len() + rows;
        rig.run_until(|rig| rig.rows.len() >= row || !rig.controller().faults().is_empty());
        rig.twin(Z).disturb(Disturbance::Block(false));
        let (compared, within) = rig.layout.comparison(axis_z(&rig)).unwrap();
        assert_eq!(compared, Compared::AtRest);
        let mut moved = rig.session.timeline().now();
        while rig.controller().faults().is_empty() {
            assert!(rig.step(), "{rows}: not found");
            if rig.twin(Z).observe().velocity.abs() > 0.01 {
                moved = rig.session.timeline().now();
            }
        }
        let after = rig.session.timeline().now().saturating_since(moved);
        let lost = rig
            .twin_as::<syncline_drives::twin::tsp10::Twin>(Z)
            .lost_steps()
            / 1000.0;
        let fault = rig.controller().faults()[0];
        println!("{rows} rows: {lost} mm, {after:?} of {within:?}, {fault:?}");
        let Fault::Axis(_, AxisCause::FeedbackDifference { difference }) = fault else {
            panic!("{fault:?}");
        };
        // What the drive told last is what it had lost a few polls before.
        assert!(
            (0.4 * lost.abs()..lost.abs() + MARGIN).contains(&difference.abs()),
            "{difference}, {lost}"
        );
        assert!(after <= within, "{rows}: {after:?} of {within:?}");
        assert!(matches!(rig.finish(), End::Fault(_)));
    }
}

/// A stepper that counts from where it is switched on comes up where the encoder that watches it says, and does so again behind
/// the reset that follows lost steps, and where it is enabled after it was moved without power.
fn learns_its_place(start: f64, mm: f64) {
    let goes = format!("simulation = {{ start = {start} }}");
    let goes = (SENT_VELOCITIES, &*goes);
    let case = format!("{start}, {mm}");
    let mut rig = staying_on(&[goes]);
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{case}: {:?}", rig.events);
    let z = |rig: &Rig| at(rig, AxisLetter::Z);
    assert!((z(&rig) - start).abs() < MARGIN, "{case}: {}", z(&rig));
    let there = start / 2.0;
    go(&mut rig, Command::Mdi(format!("G90 G0 Z{there}")));
    assert_eq!(state(&rig), State::Ready, "{case}: {:?}", rig.events);
    slips(&mut rig, mm);
    settle(&mut rig);
    go(&mut rig, Command::Reset);
    if state(&rig) == State::Disabled {
        go(&mut rig, Command::Enable);
    }
    assert_eq!(state(&rig), State::Ready, "{case}: {:?}", rig.events);
    let found = z(&rig) - there;
    assert!((found - mm).abs() < MARGIN, "{case}: {found}");
    let before = rig.twin(Z).observe().position;
    go(&mut rig, Command::Mdi(format!("G90 G0 Z{there}")));
    assert_eq!(state(&rig), State::Ready, "{case}: {:?}", rig.events);
    let made_up = 10.0 * (rig.twin(Z).observe().position - before);
    assert!((made_up + mm).abs() < MARGIN, "{case}: {made_up}");
    // By hand, while nothing holds it.
    go(&mut rig, Command::Disable);
    rig.slip(0, 10.0 * mm / PITCH);
    go(&mut rig, Command::Enable);
    assert_eq!(
        state(&rig),
        State::Ready,
        "{case}: {:?}",
        rig.session.faults()
    );
    let found = z(&rig) - there;
    assert!((found - 10.0 * mm).abs() < MARGIN, "{case}: {found}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    #[test]
    fn a_stepper_learns_its_place_from_the_encoder_that_watches_it(
        start in -290.0..-10.0f64, mm in 0.13..0.5f64, backward: bool,
    ) {
        learns_its_place(start, if backward { -mm } else { mm });
    }
}

/// What slips while its drive rests is found at once, also while it goes on and other axes move.
#[test]
fn what_slips_while_its_drive_rests_is_found_while_it_slips() {
    let mut rig = machine_of(
        &[(SENT_VELOCITIES, "")],
        "G21 G90 G61\nG1 X300 Y90 F2000\nM2\n",
        |_, _| (),
    );
    rig.run_to_row(400);
    let before = rig.rows.len();
    // 30 mm/s, as a load that its motor does not hold.
    while rig.controller().faults().is_empty() && rig.rows.len() < before + 400 {
        rig.slip(0, -0.018);
        rig.step();
        rig.step();
    }
    let z = axis_z(&rig);
    let fault = rig.controller().faults().first().copied();
    let Some(Fault::Axis(axis, AxisCause::FeedbackDifference { difference })) = fault else {
        panic!("{fault:?}");
    };
    assert!(axis == z && difference.abs() < 0.8, "{difference}");
    assert!(matches!(rig.finish(), End::Fault(_)));
}

/// A target is reached once the encoder was held against the drive there: behind a rotor that was held fast no block begins.
#[test]
fn nothing_goes_on_behind_a_rotor_that_was_held_fast() {
    for rows in [5, 20, 60] {
        let program = "G21 G90\nG0 Z-40\nG1 X30 F3000\nM2\n";
        let mut rig = machine_of(&[(SENT_VELOCITIES, "")], program, |_, _| ());
        let act = |rig: &Rig| {
            rig.rows
                .last()
                .map_or(0.0, |row| row.axes[Z_COORDINATE].act)
        };
        rig.run_until(|rig| act(rig) < -10.0);
        rig.twin(Z).disturb(Disturbance::Block(true));
        let row = rig.rows.len() + rows;
        rig.run_until(|rig| rig.rows.len() >= row || !rig.controller().faults().is_empty());
        rig.twin(Z).disturb(Disturbance::Block(false));
        assert!(matches!(rig.finish(), End::Fault(Fault::Axis(..))));
        let went = rig.rows.iter().map(|row| row.plan.position[0]);
        assert_eq!(went.fold(0.0, f64::max), 0.0, "{rows}");
    }
}

/// One that counts from where it is set up is not referenced any more behind a reset, whatever the fault was of.
#[test]
fn a_stepper_that_was_homed_is_to_be_homed_again_behind_a_reset() {
    let mut rig = staying_on(&[]);
    settle(&mut rig);
    go(&mut rig, super::homing::home(AxisLetter::W));
    go(&mut rig, Command::Mdi("G90 G0 W20".to_owned()));
    let referenced = |rig: &Rig| rig.session.status().referenced[AxisLetter::W.index()];
    assert!(
        referenced(&rig) && state(&rig) == State::Ready,
        "{:?}",
        rig.events
    );
    happen(&mut rig, Y, Loss::Error);
    settle(&mut rig);
    go(&mut rig, Command::Reset);
    if state(&rig) == State::Disabled {
        go(&mut rig, Command::Enable);
    }
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert!(!referenced(&rig));
}

// --- a bus is lost ---

/// The drives of the gantry.
const GANTRY: [usize; 2] = [0, 1];

/// The buses of the machine of several kinds, and its drives on each: gantry, Y and the feeder, beside the I/O node that opens
/// the enable chain; Z, beside its encoder.
const BUSES: [(&str, &[usize]); 2] = [("fast", &[0, 1, 2, 4]), ("slow", &[3])];

/// A bus is gone: that is told by its name, at once. Drives on it stop by themselves, the steppers by the enable chain; of the
/// others those stop on the path, or by their quick stop where a gantry is among the lost ones.
fn loses_a_bus(bus: usize, row: usize, wake_ups: usize) {
    let mut rig = Rig::new("mixed", &[], MIXED, |_, _| ());
    rig.run_to_row(row);
    for _ in 0..wake_ups {
        rig.step();
    }
    let before = rig.session.timeline().now();
    rig.bus_at(bus).unplugged = true;
    rig.run_until(|rig| !rig.controller().faults().is_empty());
    let after = rig.session.timeline().now().saturating_since(before);
    let fault = rig.controller().faults()[0];
    let (name, lost) = BUSES[bus];
    let case = format!("{name} at row {row}: {}", fault.describe(&*rig.layout));
    assert_eq!(fault, Fault::Bus(bus, BusCause::Failed), "{case}");
    let told = format!("bus {name}: the interface failed");
    assert!(fault.describe(&*rig.layout).starts_with(&told), "{case}");
    assert!(after <= rig.layout.cycle, "{case}: {after:?}");
    assert_eq!(rig.finish(), End::Fault(fault), "{case}");
    rig.trace().assert_within_limits();
    // Whoever could be reached had SYNC and heartbeats all the way, and was switched off in order.
    let off = rig.session.timeline().now().saturating_since(before);
    let cycles = off.as_nanos() / rig.layout.cycle.as_nanos();
    let syncs = rig.syncs().iter().filter(|at| **at > before).count() as u128;
    assert!(
        syncs.abs_diff(cycles) < 10,
        "{case}: {syncs} SYNCs in {cycles} cycles"
    );
    let heartbeats = rig.sent(CobId::error_control(rig.machine.controller.node));
    let is_heard = heartbeats.iter().any(|it| it.start > before);
    assert!(
        is_heard || off < 2 * rig.machine.controller.heartbeat,
        "{case}"
    );
    for side in GANTRY.into_iter().filter(|side| !lost.contains(side)) {
        let mut words: Vec<u16> = rig.commands(side).iter().map(|it| it.1).collect();
        words.dedup();
        assert!(words.ends_with(&[0x06, 0x00]), "{case}: {words:04X?}");
    }
    let drives = 0..rig.machine.drives.len();
    for drive in drives.clone().filter(|drive| !lost.contains(drive)) {
        assert!(!rig.twin(drive).observe().is_powered, "{case}: {drive}");
    }
    // And the others by their own supervision.
    let end = rig.session.timeline().now() + Duration::from_secs(1);
    rig.session.timeline().world().advance_to(end);
    for drive in drives {
        let seen = rig.twin(drive).observe();
        let stands = seen.velocity.abs() < 0.01 && !seen.is_powered;
        assert!(stands, "{case}: drive {drive} is left at {seen:?}");
    }
}

/// A bus that is about to be lost is told, and stops the machine in order once it is error passive.
#[test]
fn an_error_warning_is_told_and_error_passive_stops_in_order() {
    const SLOW: usize = 1;
    let mut rig = Rig::new("mixed", &[], MIXED, |_, _| ());
    rig.run_to_row(400);
    rig.bus_at(SLOW).condition = Some(BusFault::ErrorWarning);
    for _ in 0..100 {
        rig.step();
    }
    let warnings = rig.events.iter().filter_map(|event| match event {
        Event::BusWarning { bus, fault } => Some((*bus, *fault)),
        _ => None,
    });
    let warnings: Vec<_> = warnings.collect();
    assert_eq!(warnings, [(SLOW, BusFault::ErrorWarning)]);
    assert_eq!(rig.end(), None);
    rig.bus_at(SLOW).condition = Some(BusFault::ErrorPassive);
    let fault = rig.finish_with_fault();
    assert_eq!(fault, Fault::Bus(SLOW, BusCause::ErrorPassive));
    rig.trace().assert_within_limits();
    assert!(rig.ends_at_rest());
    for drive in 0..rig.machine.drives.len() {
        assert!(!rig.twin(drive).observe().is_powered, "{drive}");
    }
}

/// Path and feeder by turns.
const MIXED: &str = "G21 G90 G94 G61\nG0 X100 Y100 Z-5\nG1 X220 Z-20 F6000\nG3 X220 Y100 I-20\nG0 U60\nG1 X300 Y160 Z-40\n\
    G1 Z-5 Y100\nM2\n";

#[test]
fn each_bus_of_the_mixed_machine_that_is_lost_has_its_own_message() {
    for bus in 0..BUSES.len() {
        for row in [150, 500] {
            loses_a_bus(bus, row, 0);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    #[test]
    fn a_bus_of_the_mixed_machine_is_lost_at_any_time(
        bus in 0..BUSES.len(), row in 1..1000usize, wake_ups in 0..3usize,
    ) {
        loses_a_bus(bus, row, wake_ups);
    }
}

// --- the controller is lost ---

/// What start-up tells of each device is what it does: a TLC53x stops by itself in time, a TSP10-CBE that is sent
/// velocities has no power any more once the enable chain is open, and one that goes point to point gets to its target.
#[test]
fn without_the_controller_each_drive_does_what_start_up_tells() {
    const SECOND: Duration = Duration::from_secs(1);
    let told = |rig: &Rig, device| rig.layout.supervision(device);
    let velocity = |rig: &mut Rig, device| rig.twin(device).observe().velocity;
    let die = |rig: &mut Rig| {
        let end = rig.session.timeline().now() + SECOND;
        rig.session.timeline().world().advance_to(end);
    };
    let mut rig = machine_with("G21 G90\nG1 Y300 Z-250 F3000\nM2\n", |_, _| ());
    rig.run_to_row(200);
    let before = [Y, Z].map(|device| velocity(&mut rig, device));
    assert!(before.iter().all(|it| it.abs() > 0.5), "{before:?}");
    die(&mut rig);
    let after = [Y, Z].map(|device| velocity(&mut rig, device));
    assert!(after.iter().all(|it| it.abs() < 0.01), "{after:?}");
    assert!(!rig.twin(Z).observe().is_powered);
    let timeout = rig.machine.controller.heartbeat_timeout.as_millis();
    let stops = format!("it stops by itself {timeout} ms after");
    assert!(told(&rig, Y).contains(&stops), "{}", told(&rig, Y));
    let opens = format!("the enable chain opens: by node 9 (cabinet, CiA 401), {timeout} ms");
    assert!(told(&rig, Z).contains(&opens), "{}", told(&rig, Z));

    let mut rig = machine_with("G21 G90\nG0 W50\nM2\n", |_, _| ());
    rig.run_until(|rig| rig.rows.last().is_some_and(|row| row.axes[8].act > 5.0));
    die(&mut rig);
    let there = rig.twin(W).observe();
    assert!(
        (there.position - 5.0).abs() < 0.01 && there.velocity.abs() < 0.01,
        "{there:?}"
    );
    assert!(told(&rig, W).contains("goes on to its target and rests there"));
}

// --- nothing is lost ---

/// Machines whose devices differ by their noise, their clocks and the times that they take to answer.
fn clean(seeds: Range<u64>) {
    for seed in seeds {
        let mut rig = machine_with(PROGRAM, |device, config| {
            config.seed = 1000 * seed + device as u64;
        });
        let end = rig.finish();
        assert_eq!(end, End::Finished, "seed {seed}: {:?}", rig.events);
    }
}

#[test]
fn no_loss_and_no_lost_step_is_found_where_there_is_none() {
    clean(1..4);
}

/// A stepper with its encoder, that goes to targets or is sent velocities, whose difference limit is `limit`.
fn stepper(cycle_ms: u32, sent: bool, [window, limit, acceleration, velocity]: [f64; 4]) -> String {
    let chain = "[[io]]\nname = \"cabinet\"\nbus = \"b\"\nnode = 9\nmodel = \"cia401\"\n\
         [[output]]\nname = \"chain\"\nio = \"cabinet\"\nsignal = \"DO3\"\nfunction = \"enable_chain\"\n";
    let (chain, sent) = if sent {
        (chain, SENT_VELOCITIES)
    } else {
        ("", "")
    };
    format!(
        "[machine]\nname = \"s\"\ncycle_us = {}\n[[bus]]\nname = \"b\"\nbitrate = 1_000_000\n\
         [[drive]]\nname = \"d\"\nbus = \"b\"\nnode = 5\nmodel = \"tsp10\"\nsdo = [[\"6075:0\", 5000]]\n\
         [[encoder]]\nname = \"e\"\nbus = \"b\"\nnode = 6\nmodel = \"twk_crn\"\npitch = 10.0\nzero = 8_000_000\n{chain}\
         [[axis]]\nname = \"X\"\ndrives = [\"d\"]\npitch = 10.0\nmax_velocity = {velocity}\nmax_acceleration = {acceleration}\n\
         max_jerk = 8000.0\nsoft_limits = [-100.0, 100.0]\nfollowing_error_limit = 1.0\nstandstill_window = {window}\n\
         feedback = \"e\"\ndifference_limit = {limit}\n{sent}\n",
        1000 * cycle_ms
    )
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, max_shrink_iters: 30, ..ProptestConfig::with_cases(24) })]

    /// Nor where a stepper sets off and stops all the time, with a difference that is hardly more than what it may creep at rest.
    #[test]
    fn no_lost_step_is_found_where_moves_are_short(
        cycle_ms in select(&[4, 5, 8, 10, 20][..]),
        sent in any::<bool>(),
        window in select(&[0.1, 0.2][..]),
        part in select(&[1.0, 1.2, 1.5, 2.0][..]),
        acceleration in select(&[60.0, 100.0, 200.0, 400.0][..]),
        velocity in select(&[20.0, 40.0][..]),
        moves in prop::collection::vec(
            (select(&[0.05, 0.3, 0.5, 1.0, 3.0, 10.0][..]), 0.7..1.3_f64, any::<bool>(), select(&[0, 60, 300, 1200][..]), 0..100_u32),
            20),
    ) {
        let mut program = String::from("G21 G90\n");
        let mut x: f64 = 0.0;
        for (step, part, back, feed, dwell) in moves {
            x = (x + if back { -step } else { step } * part).clamp(-90.0, 90.0);
            let _ = match feed {
                0 => writeln!(program, "G0 X{x:.3}"),
                feed => writeln!(program, "G1 F{feed} X{x:.3}"),
            };
            let _ = writeln!(program, "G4 P{}", f64::from(dwell) / 1000.0);
        }
        let folder = Folder::new();
        let text = stepper(cycle_ms, sent, [window, part * window, acceleration, velocity]);
        let machine = folder.file("machine.toml", &text);
        let program = folder.file("program.ngc", &(program + "M2\n"));
        let output = syncline().arg("validate").args([&machine, &program]).output().unwrap();
        let (code, told, errors) = ended(&output);
        prop_assert_eq!(code, 0, "{}{}", told, errors);
    }
}

#[test]
#[ignore = "takes minutes"]
fn no_loss_and_no_lost_step_is_found_in_100_machines() {
    clean(1..101);
}
