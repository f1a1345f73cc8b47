//! Constant surface speed (G96), on `examples/drill`, whose X stands for a lathe's. What is judged is how fast the surface
//! passes the simulated tool while the simulated rotor turns.

use proptest::prelude::*;
use proptest::sample::select;
use std::f64::consts::TAU;
use syncline_controller::control::fault::SpindleCause;
use syncline_controller::control::{End, Fault, Row, State};
use syncline_controller::machine::COORDINATES;
use syncline_controller::session::Command;
use syncline_drives::twin::Disturbance;
use syncline_tests::rig::Rig;

use super::threads::SPINDLE;

/// What `tolerance` of the example lets a speed differ by.
const TOLERANCE: f64 = 0.03;
const SLOWEST: f64 = 60.0;

fn lathe(program: &str) -> Rig {
    lathe_with(&[], program)
}

fn lathe_with(replacements: &[(&str, &str)], program: &str) -> Rig {
    let mut rig = Rig::new("drill", replacements, program, |_, _| ());
    rig.goes_on = false;
    rig
}

/// How fast the spindle is to turn at a radius, 1/min.
fn wanted(metres: f64, most: f64, radius: f64) -> f64 {
    (1000.0 * metres / (TAU * radius.abs())).clamp(SLOWEST, most)
}

fn measured(row: &Row<COORDINATES>) -> f64 {
    row.spindle.map_or(0.0, |it| it.speed)
}

fn cuts(row: &Row<COORDINATES>) -> bool {
    row.plan.speed > 0.0 && row.plan.feed.is_finite()
}

/// Along each cut the spindle has the speed of the radius, by what it lags behind: that of some time before.
fn assert_surface_speed(rig: &Rig, metres: f64, most: f64, centre: f64) {
    let speeds = |row: &Row<COORDINATES>| wanted(metres, most, row.plan.position[0] - centre);
    let mut cut = 0;
    for (n, row) in rig.rows.iter().enumerate().filter(|(_, row)| cuts(row)) {
        let lately = &rig.rows[n.saturating_sub(60)..=n];
        let least = lately.iter().map(speeds).fold(f64::INFINITY, f64::min);
        let fastest = lately.iter().map(speeds).fold(0.0, f64::max);
        let is = measured(row).abs();
        let window = TOLERANCE * fastest + 3.0;
        let x = row.plan.position[0];
        assert!(
            (least - window..=fastest + window).contains(&is),
            "{is:.1} at X{x:.3}, {least:.1} to {fastest:.1} 1/min"
        );
        cut += 1;
    }
    assert!(cut > 100, "{cut}");
}

// --- the spindle goes by X ---

#[test]
fn facing_turns_the_spindle_faster_to_its_limit_and_through_the_centre() {
    for code in ["M3", "M4"] {
        let program = format!(
            "G21 G90\n{code} G96 S120 D2500\nG0 X60 Z0\nG1 X-20 F1500\nG0 X60\nG97 S300\nG1 X55\nM2\n"
        );
        let mut rig = lathe(&program);
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let g96 = |row: &&Row<COORDINATES>| row.functions.spindle.surface.is_some();
        let behind = rig.rows.iter().filter(|row| !g96(row) && cuts(row));
        for row in behind {
            assert!(
                (measured(row).abs() - 300.0).abs() < 15.0,
                "{}",
                measured(row)
            );
        }
        rig.rows
            .retain(|row| row.functions.spindle.surface.is_some());
        assert_surface_speed(&rig, 120.0, 2500.0, 0.0);
        let fastest = rig.rows.iter().map(|row| measured(row).abs());
        let fastest = fastest.fold(0.0, f64::max);
        assert!((fastest - 2500.0).abs() < 60.0, "{fastest}");
        let sign = if code == "M3" { 1.0 } else { -1.0 };
        assert!(
            rig.rows
                .iter()
                .filter(|row| cuts(row))
                .all(|row| measured(row) * sign > 0.0)
        );
    }
}

/// Offsets and the tool's length along X move the centre with them; feet a minute under G20.
#[test]
fn the_centre_is_where_the_program_has_x0() {
    let program = "G21 G90 G10 L2 P1 X-30\nM3 G96 S100 D2000\nG43.1 X5\nG0 X70\nG1 X20 F1000\nM2\n";
    let mut rig = lathe(program);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_surface_speed(&rig, 100.0, 2000.0, -25.0);

    let mut rig = lathe("G20 G90\nM3 G96 S328.084 D2000\nG0 X2\nG1 X1 F40\nM2\n");
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_surface_speed(&rig, 100.0, 2000.0, 0.0);
}

/// Behind a rapid a cut waits for the speed of its place.
#[test]
fn each_cut_behind_a_rapid_waits() {
    let program =
        "G21 G90 G61\nM3 G96 S150 D2800\nG0 X100\nG1 Z-2 F600\nG0 Z0\nG0 X15\nG1 Z-2\nM2\n";
    // It takes longer than the rapid.
    let mut rig = lathe_with(&[("ramp_ms = 300", "ramp_ms = 3000")], program);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    for row in rig.rows.iter().filter(|row| cuts(row)) {
        let wanted = wanted(150.0, 2800.0, row.plan.position[0]);
        let off = (measured(row) / wanted - 1.0).abs();
        assert!(
            off < TOLERANCE + 0.002,
            "{off} at X{}",
            row.plan.position[0]
        );
    }
}

/// A spindle that cannot change its speed as fast is none that has lost it.
#[test]
fn a_slow_spindle_comes_after() {
    let slow = [("ramp_ms = 300", "ramp_ms = 6000")];
    let program = "G21 G90\nM3 G96 S120 D3000\nG0 X60\nG1 X8 F3000\nM2\n";
    let mut rig = lathe_with(&slow, program);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
}

/// Nor is one that has lost its speed hidden by it.
#[test]
fn a_spindle_that_stands_is_told() {
    let mut rig = lathe("G21 G90\nM3 G96 S120 D3000\nG0 X100\nG1 X20 F600\nM2\n");
    rig.run_until(|rig| {
        rig.rows
            .last()
            .is_some_and(|row| row.plan.position[0] < 90.0 && cuts(row))
    });
    rig.twin(SPINDLE).disturb(Disturbance::Block(true));
    let fault = rig.finish_with_fault();
    let told = matches!(
        fault,
        Fault::Spindle(SpindleCause::Speed { .. }) | Fault::Device(SPINDLE, _)
    );
    assert!(told, "{fault:?}");
    assert!(rig.rows.last().unwrap().plan.position[0] > 80.0);
    assert!(rig.ends_at_rest());
}

/// By the turns of a spindle that is the faster the nearer X is to the centre.
#[test]
fn a_feed_by_turns_follows() {
    let program = "G21 G90 G95\nM3 G96 S150 D2400\nG0 X80\nG1 X3 F0.2\nX80\nM2\n";
    let mut rig = lathe(program);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let mut begun = None;
    for row in rig.rows.iter().filter(|row| cuts(row)) {
        let begun = *begun.get_or_insert(row.cycle);
        if row.cycle < begun + 150 {
            continue;
        }
        let feed = row.plan.feed / (measured(row) / 60.0);
        assert!(
            (feed / 0.2 - 1.0).abs() < 0.06,
            "{feed} at X{}",
            row.plan.position[0]
        );
    }
    assert_surface_speed(&rig, 150.0, 2400.0, 0.0);
    rig.trace().assert_within_limits();
}

/// While the path is held the spindle stays, and X that is jogged takes it along.
#[test]
fn a_hold_keeps_the_speed() {
    let mut rig = lathe("G21 G90\nM3 G96 S120 D3000\nG0 X60\nG1 X20 F600\nM2\n");
    rig.run_until(|rig| {
        rig.rows
            .last()
            .is_some_and(|row| row.plan.position[0] < 40.0 && cuts(row))
    });
    rig.command(Command::FeedHold);
    rig.run_until(|rig| rig.session.status().state == State::Held);
    let until = rig.rows.len() + 300;
    rig.run_to_row(until);
    let row = rig.rows.last().unwrap();
    let wanted = wanted(120.0, 3000.0, row.plan.position[0]);
    assert!((measured(row) / wanted - 1.0).abs() < TOLERANCE);
    rig.command(Command::Resume);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_surface_speed(&rig, 120.0, 3000.0, 0.0);
}

// --- anything ---

proptest! {
    #![proptest_config(ProptestConfig { cases: 3, ..ProptestConfig::default() })]

    /// From anywhere to anywhere, through the centre too, either way round.
    #[test]
    fn any_cut_has_its_surface_speed(
        ways in proptest::collection::vec((-150.0..150.0f64, any::<bool>()), 2..7), metres in 20.0..200.0f64,
        most in 500.0..3000.0f64, feed in 300.0..2000.0f64, code in select(vec!["M3", "M4"]),
    ) {
        let (metres, most) = (metres.round(), most.round());
        let mut program = format!("G21 G90 G64\n{code} G96 S{metres} D{most} F{feed:.0}\n");
        for (x, cuts) in ways {
            program += &format!("{} X{x:.3}\n", if cuts { "G1" } else { "G0" });
        }
        let mut rig = lathe(&(program + "G1 X0\nG1 X40\nM2\n"));
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        assert_surface_speed(&rig, metres, most, 0.0);
        rig.trace().assert_within_limits();
        prop_assert!(rig.ends_at_rest());
    }
}

#[test]
fn a_second_run_sends_the_same_frames() {
    let frames = || {
        let mut rig = lathe("G21 G90\nM3 G96 S120 D2500\nG0 X30\nG1 X5 F1500\nM2\n");
        assert_eq!(rig.finish(), End::Finished);
        rig.frames()
    };
    assert_eq!(frames(), frames());
}
