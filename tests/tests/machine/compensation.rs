//! Axes with play and lead error whose controller compensates them, beside the same without.

use super::homing::{errors as drives_beyond, failure, go, home, settle, state};
use super::lost_cycles::{is_guarded, jumps, oversleep};
use proptest::prelude::*;
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write as _;
use syncline_controller::control::State;
use syncline_controller::session::Command;
use syncline_drives::model::Increments;
use syncline_gcode::AxisLetter;
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::{PORTAL_PROGRAM, Rig};

pub(super) const LIMITS: &str = "soft_limits = [-250.0, 250.0]\nfollowing_error_limit = 1.0\n";
pub(super) const LIMITS_Y: &str = "soft_limits = [-200.0, 200.0]\nfollowing_error_limit = 1.0\n";

/// A screw that is off by up to so many µm, a period in 100 mm, every 10 mm, and right below `from`.
pub(super) fn lead_error(micrometres: f64, from: i32) -> String {
    let mut text = String::from("lead_error = [");
    for at in (-200..=200).step_by(10) {
        let turns = f64::from((at - from).max(0)) / 100.0;
        let error = 0.5 * micrometres * (1.0 - (TAU * turns).cos());
        let _ = write!(text, "[{at}, {error:.3}], ");
    }
    text + "]\n"
}

/// The circular test of the xyz machine with such axes, compensated or not.
fn circles(play: f64, error: f64, compensated: bool) -> Value {
    let lead_error = lead_error(error, -200);
    let keys = match compensated {
        true => format!("backlash = {play}\n{lead_error}"),
        false => String::new(),
    };
    let simulation = format!(
        "[axis.simulation]\nload = 40.0\ntransmission = \"screw\"\nplay = {play}\nfriction = 30.0\n{lead_error}\n"
    );
    let [x, y] = [LIMITS, LIMITS_Y].map(|limits| format!("{limits}{keys}{simulation}"));
    let folder = Folder::new();
    let machine = machine_with("xyz", &[(LIMITS, &x), (LIMITS_Y, &y)]);
    let machine = folder.file("xyz.toml", &machine);
    let program =
        "G21 G90 G61 G17\nG0 X25 Y0\nG2 X25 Y0 I-25 J0 P3 F1500\nG3 X25 Y0 I-25 J0 P3\nM2\n";
    let program = folder.file("program.ngc", program);
    let output = syncline()
        .args(["validate", "--json", "-"])
        .args([&machine, &program])
        .output()
        .expect("it runs");
    let (_, json, errors) = ended(&output);
    serde_json::from_str(json).unwrap_or_else(|error| panic!("{error}: {errors}"))
}

fn number(json: &Value, pointer: &str) -> f64 {
    let value = json.pointer(pointer).and_then(Value::as_f64);
    value.unwrap_or_else(|| panic!("no number {pointer} in {json:#}"))
}

/// The second turns either way round: the greatest reversal error, circular deviation and hysteresis, mm.
fn errors(json: &Value) -> [f64; 3] {
    let turn = &json["circles"][1];
    let reversals = turn["reversals"].as_array().expect("its reversals").iter();
    let worst = reversals.map(|it| it["error_mm"].as_f64().expect("a number").abs());
    [
        worst.fold(0.0, f64::max),
        number(turn, "/circular_deviation_mm"),
        number(json, "/circles/4/both_ways/hysteresis_mm"),
    ]
}

/// 40 µm of backlash and a screw that is off by up to 15 µm: what is left is hardly more than axes show that have neither.
#[test]
fn circles_are_round() {
    let [ideal, open, closed] = [(0.0, 0.0, false), (0.04, 15.0, false), (0.04, 15.0, true)]
        .map(|(play, error, compensated)| circles(play, error, compensated));
    assert_eq!(closed["verdict"], "pass", "{closed:#}");
    let [ideal, open, closed] = [ideal, open, closed].map(|json| errors(&json));
    println!("neither {ideal:.4?}, both {open:.4?}, both and compensated {closed:.4?}");
    for ((ideal, open), closed) in ideal.into_iter().zip(open).zip(closed) {
        assert!(open > ideal + 0.025, "{open}, without {ideal}");
        assert!(closed < ideal + 0.010, "{closed}, without {ideal}");
    }
}

/// The router's Y: homed against a hard stop, at which its load is, with play and a lead error.
fn router(play: f64, compensated: bool) -> Rig {
    let switch = "kind = \"switch\"\norder = 2\nswitches = [\"home Y\"]\ndirection = \"negative\"\nspeed = 80.0\nslow_speed = 2.0\nback_off = 5.0\nposition = -4.0\nfinal_position = 0.0";
    let input = "[[input]]\nname = \"home Y\"\ndrive = \"Y\"\nsignal = \"DI0\"\nfunction = \"home\"\nsimulated = [-60.0, -4.0]\n";
    let stop = "kind = \"hard_stop\"\norder = 2\ndirection = \"negative\"\nweight = \"none\"\ntorque = 30.0\nspeed = 15.0\n\
                contact_ms = 50\nback_off = 5.0\nmax_distance = 300.0\nposition = -6.0\n";
    // A stop is met where the screw has the load, whatever its error: none is there.
    let table = lead_error(30.0, 0);
    let limits = "soft_limits = [0.0, 800.0]\n";
    let keys = match compensated {
        true => format!("{limits}backlash = {play}\n{table}"),
        false => limits.to_owned(),
    };
    let simulation = format!(
        "start = 95.0\nend_stops = [-6.0, 2000.0]\nload = 5.0\ntransmission = \"screw\"\nplay = {play}\nfriction = 40.0\n{table}"
    );
    let changes = [
        (input, ""),
        (switch, stop),
        (limits, &*keys),
        ("start = 95.0", &*simulation),
    ];
    let mut rig = Rig::staying_on("router", &changes, |_, _| ());
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    rig
}

/// Where the load of a drive has come to rest, mm.
pub(super) fn load(rig: &mut Rig, drive: usize) -> f64 {
    for _ in 0..300 {
        rig.step();
    }
    let turns = rig.twin(drive).observe().load_position;
    let scaling = rig.machine.drives[drive].scaling;
    let (one, zero) = (Increments::new(1 << 17), Increments::ZERO);
    turns * (scaling.to_mm(one) - scaling.to_mm(zero)) + scaling.to_mm(zero)
}

/// Homed against its stop, the load is where the axis says, from whichever side it comes there.
#[test]
fn the_load_is_where_the_axis_says() {
    let off = |compensated| {
        let mut rig = router(0.08, compensated);
        go(&mut rig, home(AxisLetter::Y));
        assert_eq!(failure(&rig), None);
        let mut worst = 0.0_f64;
        for place in [10.0, 120.0, 70.0, 70.05, 70.0, 30.0, 110.0, 10.0] {
            go(&mut rig, Command::Mdi(format!("G0 Y{place}")));
            worst = worst.max((load(&mut rig, 2) - place).abs());
        }
        assert_eq!(rig.refused, []);
        assert_eq!(rig.problems, [""; 0]);
        worst
    };
    let (open, closed) = (off(false), off(true));
    println!("the load is off by up to {open:.4} mm without, {closed:.4} mm with compensation");
    assert!(open > 0.07, "{open}");
    assert!(closed < 0.005, "{closed}");
}

/// Parked at a soft limit, an axis whose carriage is off by more than its standstill window is inside: a simulated carriage stands where
/// the machine file has it stand.
#[test]
fn an_axis_that_is_corrected_stands_inside_its_soft_limits() {
    let limits = "soft_limits = [0.0, 250.0]\nfollowing_error_limit = 1.0\nlead_error = [[0, -300], [100, -250]]\n";
    let mut rig = Rig::staying_on("xyz", &[(LIMITS, limits)], |_, _| ());
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    let off = drives_beyond(&mut rig, AxisLetter::X)[0];
    assert!((off - 0.3).abs() < 0.001, "its drive is {off} mm beyond");
}

/// Keys of X and Y of the portal.
fn keys() -> [(String, String); 2] {
    let keys = "backlash = 0.05\nlead_error = [[0, 0], [100, 20], [250, -15], [400, 5]]\n";
    ["skew_limit = 0.5", "max_velocity = 800.0"]
        .map(|key| (key.to_owned(), format!("{key}\n{keys}")))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Where axes turn round all the time and cycles are lost, one by one or so many that the path is stopped, nothing is sent that an axis
    /// may not be sent, but behind the lost cycles themselves.
    #[test]
    fn lost_cycles_and_stops_leave_no_step(
        moves in prop::collection::vec(([10.0..390.0_f64, 10.0..390.0], 500.0..6000.0_f64, -0.6..0.6_f64), 2..6),
        lates in prop::collection::vec((0..1500usize, 0.0..2.9_f64), 1..4),
    ) {
        let line = |([x, y], feed, back): &([f64; 2], f64, f64)| {
            let (u, v) = (x + back, y - back);
            format!("G1 X{x:.3} Y{y:.3} F{feed:.0}\nX{u:.3} Y{v:.3}\nX{x:.3}\n")
        };
        let lines: String = moves.iter().map(line).collect();
        let program = format!("G21 G90 G94 G64 P0.1\n{lines}M2\n");
        let keys = keys();
        let keys: Vec<_> = keys.iter().map(|(old, new)| (&**old, &**new)).collect();
        let mut rig = Rig::new("portal", &keys, &program, |_, _| ());
        rig.run_until(|rig| state(rig) == State::Running);
        oversleep(&mut rig, &lates);
        rig.finish();
        let faults = rig.session.faults();
        prop_assert!(!faults.iter().any(is_guarded), "{:?}", faults);
        for (drive, axis) in [(0, 0), (1, 0), (2, 1)] {
            let jumps = jumps(&rig, drive, axis);
            prop_assert!(jumps <= lates.len(), "drive {}: {}", drive, jumps);
        }
    }
}

/// Both sides of a gantry, and beside them an axis whose drive is sent velocities.
#[test]
fn gantries_and_velocity_loops_are_compensated() {
    let [x, y] = keys();
    let changes = [(&*x.0, &*x.1), (&*y.0, &*y.1)];
    let rig = Rig::new("portal", &changes, PORTAL_PROGRAM, |_, _| ());
    let summary = rig.judge();
    assert_eq!(summary.verdict, "pass", "{:?}", summary.violations);
    let changes = [&changes[..], &super::velocity::CHANGES].concat();
    let rig = Rig::new("portal", &changes, PORTAL_PROGRAM, |_, _| ());
    let summary = rig.judge();
    assert_eq!(summary.verdict, "pass", "{:?}", summary.violations);
}
