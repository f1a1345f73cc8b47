//! Cycles that are lost because a wake-up comes late: in mid-motion, also on machines whose drives have latencies of their own.

use super::homing::{home, is_referenced, settle, state};
use proptest::prelude::*;
use syncline_canopen::time::Duration;
use syncline_controller::control::fault::{AxisCause, BusCause};
use syncline_controller::control::{End, Fault, Phase, State, Wake};
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

/// The drives of X, on both machines.
const X1: usize = 0;
const X2: usize = 1;

/// When a wake-up is late, and by how many cycles.
pub(super) type Late = (usize, f64);

/// Moves of X, Y and Z, each slow enough that a lost cycle of it is no following error.
fn moves() -> impl Strategy<Value = Vec<([f64; 3], f64)>> {
    let places = [10.0..300.0, 10.0..300.0, -90.0..-1.0];
    prop::collection::vec((places, 500.0..6000.0), 1..5)
}

fn program(moves: &[([f64; 3], f64)]) -> String {
    let line =
        |([x, y, z], feed): &([f64; 3], f64)| format!("G1 X{x:.3} Y{y:.3} Z{z:.3} F{feed:.0}\n");
    let lines: String = moves.iter().map(line).collect();
    format!("G21 G90 G94 G64 P0.1\n{lines}M2\n")
}

pub(super) fn is_guarded(fault: &Fault) -> bool {
    matches!(fault, Fault::Axis(_, AxisCause::SetpointGuard { .. }))
}

/// Goes on with wake-ups that are late, in turn.
pub(super) fn oversleep(rig: &mut Rig, lates: &[Late]) {
    for &(wake_ups, cycles) in lates {
        for _ in 0..wake_ups {
            if !rig.step() {
                return;
            }
        }
        let by = rig.machine.cycle.as_secs_f64() * cycles;
        let by = Duration::from_secs_f64(by);
        rig.session.timeline().wake_late(by);
    }
}

/// How often a drive of an axis was sent somewhere that no motion within the axis' limits leads to.
pub(super) fn jumps(rig: &Rig, drive: usize, axis: usize) -> usize {
    let resolution = rig.machine.drives[drive].scaling.resolution();
    let limits = &rig.machine.axes[axis].sent_limits;
    let cycle = rig.machine.cycle.as_secs_f64();
    let most = 1.1 * limits.jerk * cycle.powi(3) / resolution + 4.0;
    // While it follows them: bit 4 of the controlword.
    let follows = |it: &(_, u16, i32)| it.1 & 1 << 4 != 0;
    let commands = rig.commands(drive).into_iter().filter(follows);
    let sent: Vec<_> = commands.map(|it| f64::from(it.2)).collect();
    let third = |it: &[f64]| (it[3] - 3.0 * it[2] + 3.0 * it[1] - it[0]).abs();
    let jumps = (sent.windows(4).enumerate()).filter(|it| third(it.1) > most);
    let places: Vec<_> = jumps.map(|it| it.0).collect();
    // A setpoint that is off shows in the three that follow it as well.
    places.chunk_by(|a, b| b - a <= 3).count()
}

/// A portal in mid-motion along X, its next wake-up being SYNC.
fn in_motion() -> Rig {
    let mut rig = Rig::portal("G21 G90 G94 G61\nG1 X300 F6000\nM2\n");
    rig.run_until(|rig| rig.rows.len() > 1 && x(rig, 0) > 100.0);
    rig.run_until(|rig| matches!(rig.controller().next_wake(), Some(Wake::Sync(_))));
    let advance = x(&rig, 0) - x(&rig, 1);
    assert!(advance > 0.15, "in motion: {advance} mm a cycle");
    rig
}

/// Where the plan has X, so many rows back, mm.
fn x(rig: &Rig, back: usize) -> f64 {
    rig.rows[rig.rows.len() - 1 - back].plan.position[0]
}

/// The two wake-ups of a cycle.
fn one_cycle(rig: &mut Rig) {
    rig.step();
    rig.step();
}

#[test]
fn one_lost_cycle_is_counted_and_the_next_setpoint_is_that_of_its_own_instant() {
    let mut rig = in_motion();
    let cycle = rig.machine.cycle;
    let (before, advance) = (x(&rig, 0), x(&rig, 0) - x(&rig, 1));
    let error = |rig: &Rig| rig.rows.last().map(|row| row.axes[0].following_error.abs());
    let steady = error(&rig).unwrap();
    let grid = rig.controller().next_wake().unwrap().at();
    rig.session.timeline().wake_late(cycle + cycle / 10);
    one_cycle(&mut rig);
    assert_eq!(rig.controller().late_setpoints(), 1);
    assert_eq!(rig.end(), None);
    let next = rig.controller().next_wake().unwrap().at();
    assert_eq!(next, grid + 2 * cycle, "SYNC keeps its grid");
    one_cycle(&mut rig);
    // The setpoint that SYNC latched one cycle late is the one that it is compared with.
    let behind = error(&rig).unwrap();
    assert!(
        behind < steady + 2.0 * advance,
        "{steady}, then {behind} mm, {advance} mm a cycle"
    );
    // One setpoint left out: from the last row to this one are three cycles of motion.
    let passed = x(&rig, 0) - before;
    assert!(
        (passed - 3.0 * advance).abs() < 0.02,
        "{passed} mm, {advance} mm a cycle"
    );
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_eq!(rig.controller().late_setpoints(), 1);
}

#[test]
fn two_lost_cycles_are_a_fault_and_the_stop_begins_where_the_plan_was_left() {
    let mut rig = in_motion();
    let cycle = rig.machine.cycle;
    let (before, advance) = (x(&rig, 0), x(&rig, 0) - x(&rig, 1));
    rig.session.timeline().wake_late(2 * cycle + cycle / 10);
    rig.step();
    let late = Fault::Bus(0, BusCause::LateSetpoints { count: 2 });
    assert_eq!(rig.end(), Some(End::Fault(late)));
    rig.step();
    let after = x(&rig, 0);
    assert!(
        (after - before).abs() < 1.5 * advance,
        "{before} mm, then {after} mm"
    );
    // No step of the plan is left out.
    one_cycle(&mut rig);
    let next = x(&rig, 0) - after;
    assert!(
        (next - (after - before)).abs() < 0.02,
        "{before}, {after} and {next} mm more"
    );
    assert_eq!(rig.finish(), End::Fault(late), "{:?}", rig.events);
}

/// A machine that begins late still asks its drives what they do before it resets anything.
#[test]
fn a_late_first_wake_up_leaves_nothing_out() {
    let mut rig = Rig::portal("G0 X10\nM2\n");
    let cycle = rig.machine.cycle;
    rig.session.timeline().wake_late(3 * cycle + cycle / 10);
    rig.run_to(Phase::SetUp);
    let phases: Vec<Phase> = rig.phases.iter().map(|it| it.0).collect();
    assert_eq!(phases, [Phase::Survey, Phase::Boot, Phase::SetUp]);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Drives that are sent the plan later than others, as they answer sooner, leave out the same SYNC as those, whatever the
    /// latencies are: nothing is sent that an axis may not be sent, before or after.
    #[test]
    fn a_lost_cycle_is_left_out_by_all_drives_at_once(
        moves in moves(), interpolation in 0..=10u32, lag in 0..30_000u32,
        lates in prop::collection::vec((0..1500usize, 0.0..2.9_f64), 1..4),
    ) {
        let models = format!(
            "[model.lxm32m]\ninterpolation_delay = {interpolation}\n[model.tlc5xx]\nposition_lag_us = {lag}\n[spindle]"
        );
        let mut rig = Rig::new("mixed", &[("[spindle]", &models)], &program(&moves), |_, _| ());
        rig.run_until(|rig| state(rig) == State::Running);
        oversleep(&mut rig, &lates);
        rig.finish();
        let faults = rig.session.faults();
        // That setpoints were late is one, and what drives make of a SYNC that is late or missing is another.
        prop_assert!(!faults.iter().any(is_guarded), "{:?}", faults);
        for drive in [X1, X2] {
            prop_assert!(jumps(&rig, drive, 0) <= lates.len(), "drive {}: {}", drive, jumps(&rig, drive, 0));
        }
    }

    /// Also while the sides of a gantry go to where they belong: they go on from where they were left.
    #[test]
    fn the_sides_of_a_gantry_go_on_where_cycles_were_lost(
        skew in -0.4..0.4_f64, lates in prop::collection::vec((0..60usize, 0.0..2.9_f64), 1..3),
    ) {
        let start = format!("start = 180.0\nstart_skew = {skew:?}");
        let mut rig = Rig::staying_on("router", &[("start = 180.0", &start)], |_, _| ());
        settle(&mut rig);
        rig.command(home(AxisLetter::X));
        rig.run_until(|rig| is_referenced(rig, AxisLetter::X) || state(rig) == State::Ready && rig.rows.len() > 50);
        oversleep(&mut rig, &lates);
        settle(&mut rig);
        let faults = rig.session.faults();
        prop_assert!(!faults.iter().any(is_guarded), "{:?}", faults);
        for drive in [X1, X2] {
            prop_assert!(jumps(&rig, drive, 0) <= lates.len(), "drive {}: {}", drive, jumps(&rig, drive, 0));
        }
    }
}
