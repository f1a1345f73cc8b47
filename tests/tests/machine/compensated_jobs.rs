//! What machines do all day with axes that have backlash and a lead error, and compensate both: probe, jog, cut threads, home, retrace,
//! and go through it once more. What counts is where the load is.

use super::compensation::{LIMITS, LIMITS_Y, lead_error, load};
use super::homing::{Y as ROUTER_Y, failure, go, home, settle, state};
use super::own_homing::{BY_SWITCH, HOME_Y};
use super::probing::{self, contacts, probe, tip};
use super::replayed::again;
use super::threads::{ALLOWED, EVEN, SETTLED, Thread};
use proptest::prelude::*;
use std::process::Stdio;
use syncline_controller::control::{End, State};
use syncline_controller::session::{self, Command, Direction, Jog};
use syncline_drives::model::Increments;
use syncline_drives::twin::Observation;
use syncline_gcode::AxisLetter;
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::Rig;

/// Of X and Y of the xyz machine, mm.
const PLAY: f64 = 0.04;

/// What a load may be off by where its axis rests, mm: by how much the screw gives way to its friction, and what straight lines
/// between the points of a lead error differ from a curve.
const OFF: f64 = 0.003;

/// X and Y of the xyz machine with play and lead error, and with what makes up for them. Friction holds their carriages as they slow down.
fn keys(compensated: bool) -> [(&'static str, String); 2] {
    let table = lead_error(15.0, -200);
    let simulation = format!(
        "[axis.simulation]\nload = 5.0\ntransmission = \"screw\"\nplay = {PLAY}\nfriction = 40.0\n{table}\n"
    );
    let stated = match compensated {
        true => format!("backlash = {PLAY}\n{table}"),
        false => String::new(),
    };
    [LIMITS, LIMITS_Y].map(|limits| (limits, format!("{limits}{stated}{simulation}")))
}

/// The xyz machine, ready.
fn ready() -> Rig {
    let [x, y] = keys(true);
    let mut rig = Rig::staying_on("xyz", &[(x.0, &*x.1), (y.0, &*y.1)], |_, _| ());
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    rig
}

/// How far the loads of X and Y are from where the machine shows their axes, mm, at the most.
fn off(rig: &mut Rig) -> f64 {
    [(0, AxisLetter::X), (1, AxisLetter::Y)]
        .map(|(drive, axis)| {
            let at = load(rig, drive);
            (at - rig.session.status().setpoint[axis.index()]).abs()
        })
        .into_iter()
        .fold(0.0, f64::max)
}

/// Switches off, and has all that was sent judged.
fn judged(mut rig: Rig) {
    assert_eq!(rig.refused, []);
    assert_eq!(rig.problems, [""; 0]);
    rig.command(Command::SwitchOff);
    let summary = rig.judge();
    assert_eq!(summary.verdict, "pass", "{:?}", summary.violations);
}

/// A probe touches with the load: where it did is told of that, from whichever side it came.
#[test]
fn what_is_probed_is_where_the_load_was() {
    let off = |compensated| {
        let [x, y] = keys(compensated);
        let probes = probing::with(&probing::wired(&probing::ALL));
        let changes = [(probing::HERE, &*probes), (x.0, &*x.1), (y.0, &*y.1)];
        let mut rig = Rig::new("xyz", &changes, probing::AROUND, |_, _| ());
        let found = contacts(&mut rig);
        assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
        assert_eq!(found.len(), 8);
        let probe = probe(&rig);
        let off = |it: &probing::Contact| probe.clearance(tip(&it.at)).abs() - it.uncertainty;
        found.iter().map(off).fold(0.0, f64::max)
    };
    let (open, closed) = (off(false), off(true));
    println!("contacts are off by up to {open:.4} mm without, {closed:.4} mm with compensation");
    assert!(open > 0.015, "{open}");
    assert!(closed < OFF, "{closed}");
}

/// To and fro, by steps and for as long as a key is held.
#[test]
fn jogs_to_and_fro_end_where_they_are_shown() {
    let mut rig = ready();
    let (x, y) = (AxisLetter::X, AxisLetter::Y);
    // The first motion takes up what of the backlash it finds.
    go(&mut rig, Command::Mdi("G0 X1 Y1".to_owned()));
    let mut worst = off(&mut rig);
    for (axis, distance) in [
        (x, 10.0),
        (y, -5.0),
        (x, -0.5),
        (x, 0.01),
        (y, 0.2),
        (x, -0.03),
        (y, -40.0),
        (x, 60.0),
    ] {
        go(
            &mut rig,
            Command::Jog(Jog::By {
                axis,
                distance,
                speed: None,
            }),
        );
        worst = worst.max(off(&mut rig));
    }
    for direction in [
        Direction::Positive,
        Direction::Negative,
        Direction::Positive,
    ] {
        rig.command(Command::Jog(Jog::Continuous {
            axis: x,
            direction,
            speed: Some(50.0),
        }));
        for _ in 0..100 {
            rig.step();
        }
        go(&mut rig, Command::EndJog(x));
        worst = worst.max(off(&mut rig));
    }
    println!("jogged loads are off by up to {worst:.4} mm");
    assert!(worst < OFF, "{worst}");
    judged(rig);
}

/// By how much the load of Z is out of step with the spindle at the most.
fn out_of_step(compensated: bool) -> f64 {
    let thread = Thread {
        speed: 600.0,
        lead: 1.5,
        ..EVEN
    };
    let table: String = (-150..=50)
        .step_by(5)
        .map(|at| format!("[{at}, {:.3}], ", 12.0 * (f64::from(at) / 3.0).sin()))
        .collect();
    let table = format!("lead_error = [{table}]\n");
    let limits = "soft_limits = [-150.0, 50.0]\n";
    let stated = match compensated {
        true => format!("backlash = {PLAY}\n{table}"),
        false => String::new(),
    };
    let axis = format!(
        "{limits}{stated}simulation = {{ load = 10.0, transmission = \"screw\", play = {PLAY}, friction = 60.0, {} }}\n",
        table.trim()
    );
    let end = 40.0 - thread.length();
    // A thread, and the passes of a cycle, which begin behind a way back.
    let program = format!(
        "G21 G90 G61 G18\nM3 S600\nG0 X5 Z40\nG33 Z{end:.6} K1.5\nG0 X8\nZ40\nG76 P1.5 Z{end:.6} I-1 J0.3 K0.6 H1\nM5\nM2\n"
    );
    let mut rig = Rig::new("drill", &[(limits, &axis)], &program, |_, _| ());
    rig.goes_on = false;
    let (mut worst, mut samples, mut since) = (0.0_f64, 0, None);
    while rig.step() {
        let Some(row) = rig.rows.last() else { continue };
        let (plan, at) = (row.plan, row.at.as_nanos() as f64 * 1e-9);
        if !plan.off_path || plan.speed < 0.9 * thread.feed() {
            since = None;
            continue;
        }
        let since = *since.get_or_insert(at);
        let left = plan.position[2] - end;
        if at - since < SETTLED || left < thread.run_out() {
            continue;
        }
        let z = rig.twin(2).observe();
        let spindle = rig.twin(3).observe();
        let at = |it: &Observation| it.at.unwrap().as_nanos() as f64 * 1e-9;
        let turns = spindle.position + spindle.velocity * (at(&z) - at(&spindle));
        let scaling = rig.machine.drives[2].scaling;
        let turn = scaling.to_mm(Increments::new(1 << 17)) - scaling.to_mm(Increments::ZERO);
        let tool = z.load_position * turn + scaling.to_mm(Increments::ZERO);
        let off = (40.0 - tool) - thread.lead * turns;
        let off = off - (off / thread.lead).round() * thread.lead;
        worst = worst.max(off.abs());
        samples += 1;
    }
    assert_eq!(rig.end(), Some(End::Finished), "{:?}", rig.events);
    assert!(samples > 1200, "{samples}");
    rig.trace().assert_within_limits();
    worst
}

/// A thread is cut by the load, at the lead of the spindle and not of the screw, and every pass meets the first.
#[test]
fn a_threads_load_is_in_step() {
    let (open, closed) = (out_of_step(false), out_of_step(true));
    println!("out of step by {open:.4} mm without, {closed:.4} mm with compensation");
    assert!(open > ALLOWED, "{open}");
    assert!(closed < 0.6 * open && closed < ALLOWED, "{closed}");
}

/// The router's Y, homed in one of its ways: how far the load is from where the axis says, mm, the least and the greatest of
/// all places.
fn homed(homing: &str, wired: &str, simulated: &str) -> [f64; 2] {
    let table = lead_error(30.0, 0);
    let limits = "soft_limits = [0.0, 800.0]\n";
    let stated = format!("{limits}backlash = 0.08\n{table}");
    let simulation = format!(
        "start = 95.0\n{simulated}load = 5.0\ntransmission = \"screw\"\nplay = 0.08\nfriction = 40.0\n{table}"
    );
    let changes = [
        (HOME_Y, wired),
        (BY_SWITCH, homing),
        (limits, &*stated),
        ("start = 95.0", &*simulation),
    ];
    let mut rig = Rig::staying_on("router", &changes, |_, _| ());
    settle(&mut rig);
    go(&mut rig, home(AxisLetter::Y));
    assert_eq!(failure(&rig), None, "{:?}", rig.events);
    let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
    for place in [10.0, 120.0, 70.0, 70.05, 70.0, 30.0, 110.0, 10.0] {
        go(&mut rig, Command::Mdi(format!("G0 Y{place}")));
        let off = load(&mut rig, ROUTER_Y) - place;
        ends = [ends[0].min(off), ends[1].max(off)];
    }
    judged(rig);
    ends
}

/// A switch is tripped by the carriage, so that the load is where the axis says. A drive that has homed by itself does not say on which
/// flank it ended: all positions are off alike then, by half of the backlash at the most.
#[test]
fn the_load_is_where_a_homed_axis_says() {
    let [least, most] = homed(BY_SWITCH, HOME_Y, "");
    println!("by a switch it is off by {least:.4} to {most:.4} mm");
    assert!(least > -0.005 && most < 0.005, "{least} {most}");
    // Either has its edge at -4, and comes there from its own side.
    for (method, switch) in [(27, "[-60.0, -4.0]"), (23, "[-4.0, 60.0]")] {
        let homing = format!(
            "kind = \"drive\"\norder = 2\nmethod = {method}\nspeed = 80.0\nslow_speed = 4.0\nposition = -4.0\nfinal_position = 0.0"
        );
        let switches = format!("reference_switch = {switch}\nlimit_switches = [-90.0, 860.0]\n");
        let [least, most] = homed(&homing, "", &switches);
        println!("by its drive's method {method} it is off by {least:.4} to {most:.4} mm");
        assert!(most - least < 0.006, "{least} {most}");
        // Its reference point is 200 increments beside the edge, by the drive's default.
        let beside = 200.0 * 20.0 / 131_072.0;
        let (least, most) = (least.abs() - beside, most.abs() - beside);
        assert!(least.abs() < 0.042 && most.abs() < 0.042, "{least} {most}");
    }
}

/// Back along the path, block by block, and on: the load rests where it is shown each time.
#[test]
fn a_path_is_retraced_to_where_it_was() {
    let mut rig = ready();
    let file = rig.folder.file(
        "part.ngc",
        "G21 G90 G94 G61\nG1 X30 Y10 F3000\nX20 Y25\nX60 Y40\nX10 Y60\nM2\n",
    );
    rig.command(Command::Load(file));
    rig.command(Command::Run { from_line: None });
    let x = AxisLetter::X.index();
    rig.run_until(|rig| {
        let at = rig.session.status().setpoint;
        at[x] < 40.0 && at[AxisLetter::Y.index()] > 45.0
    });
    go(&mut rig, Command::FeedHold);
    let mut worst = off(&mut rig);
    for place in [60.0, 20.0, 30.0] {
        rig.command(Command::Retrace);
        rig.run_until(|rig| state(rig) != State::Held);
        settle(&mut rig);
        assert_eq!(state(&rig), State::Held, "{:?}", rig.events);
        worst = worst.max(off(&mut rig));
        let at = rig.session.status().setpoint[x];
        assert!((at - place).abs() < 0.01, "{at} in place of {place}");
    }
    go(&mut rig, Command::Resume);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    worst = worst.max(off(&mut rig));
    println!("retraced loads are off by up to {worst:.4} mm");
    assert!(worst < OFF, "{worst}");
    judged(rig);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// What such axes are sent is a function of the commands and of the frames.
    #[test]
    fn a_day_goes_the_same_way_once_more(
        jogs in prop::collection::vec((any::<bool>(), -20.0..20.0_f64, 0..300usize), 1..6),
        lost in 0..40u32,
    ) {
        let [x, y] = keys(true);
        let mut rig = Rig::staying_on("xyz", &[(x.0, &*x.1), (y.0, &*y.1)], |_, _| ());
        let told = rig.session.subscribe();
        settle(&mut rig);
        for (is_x, distance, wake_ups) in jogs {
            let axis = if is_x { AxisLetter::X } else { AxisLetter::Y };
            rig.command(Command::Jog(Jog::By { axis, distance, speed: None }));
            for _ in 0..wake_ups {
                rig.step();
            }
            if wake_ups % 3 == 0 {
                rig.command(Command::Stop);
            }
            settle(&mut rig);
        }
        rig.command(Command::Mdi("G1 X20 Y20 F2000\nX-20 Y5\nX0".to_owned()));
        for _ in 0..100 {
            rig.step();
        }
        rig.bus().drop_bursts = lost % 2;
        settle(&mut rig);
        rig.command(Command::SwitchOff);
        while rig.step() {}
        let accepted: Vec<_> = told.events().filter_map(|event| match event {
            session::Event::Accepted(it) => Some(it),
            _ => None,
        }).collect();
        prop_assert_eq!(again(&mut rig, None, &accepted), accepted);
    }
}

/// A run is found to be the same by `replay`, and another one with another backlash or table.
#[test]
fn replay_finds_what_was_compensated_otherwise() {
    let folder = Folder::new();
    let [x, y] = keys(true);
    let text = machine_with("xyz", &[(x.0, &*x.1), (y.0, &*y.1)]);
    let machine = folder.file("machine.toml", &text);
    let program = folder.file(
        "part.ngc",
        "G21 G90 G94\nG1 X30 Y20 F3000\nX-10 Y25\nX20\nM2\n",
    );
    let log = folder.path("log");
    let mut command = syncline();
    command
        .args(["run", "--wait-for-plan"])
        .args([&machine, &program]);
    command.arg("--candump").arg(&log).stdin(Stdio::null());
    let output = command.output().unwrap();
    let (code, told, errors) = ended(&output);
    assert_eq!(code, 0, "{told}{errors}");
    let backlash = format!("backlash = {PLAY}");
    let table = lead_error(15.0, -200);
    for (stated, other, same) in [
        ("", "", true),
        (&*backlash, "backlash = 0.05", false),
        (&*table, &*lead_error(16.0, -200), false),
    ] {
        let text = text.replacen(stated, other, 1);
        let machine = folder.file("replayed.toml", &text);
        let mut command = syncline();
        command.arg("replay").arg(&log).args([&machine, &program]);
        let output = command.output().unwrap();
        let (code, told, errors) = ended(&output);
        assert_eq!(code == 0, same, "{other}: {code} {told}{errors}");
        let differs = format!("{told}{errors}").contains("R_PDO");
        assert_eq!(!differs, same, "{other}: {told}{errors}");
    }
}
