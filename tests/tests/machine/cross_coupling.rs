//! Gantries whose sides are coupled across, beside the same without: what it helps, that it keeps the limits, and where it is refused.

use super::homing::{home, settle, state, truth};
use proptest::prelude::*;
use syncline_controller::control::{End, Event, Phase, SidesApart, State, Waiting};
use syncline_controller::machine::Machine;
use syncline_controller::session::Command;
use syncline_drives::twin::{Config, Disturbance, ErrorClass};
use syncline_gcode::AxisLetter;
use syncline_tests::command::{Folder, machine_with};
use syncline_tests::rig::Rig;

const X2: usize = 1;
const Y: usize = 2;

/// There and back, with reversals and a dwell.
const PROGRAM: &str =
    "G21 G90 G64\nG1 X300 F30000\nX100 F18000\nX110 F3000\nX100\nG4 P0.3\nG1 X400 F36000\nX0\nM2\n";

/// The portal's X, without what its drives supervise themselves.
const PLAIN: (&str, &str) = (
    "following_error_limit = 2.0\nskew_limit = 0.5\nstandstill_window = 0.05\ndrive_following_error = true\n\
     drive_soft_limits = true\n",
    "following_error_limit = 80.0\nskew_limit = 40.0\nstandstill_window = 0.05\n",
);

/// A gantry as it is drawn.
#[derive(Clone, Debug)]
struct Drawn {
    cycle_ms: u32,
    /// Stiffness of what holds the beam square, N·m/rad; none: each side is by itself.
    beam: Option<f64>,
    /// Of the position loops, 1/s.
    gains: [f64; 2],
    /// Share of the velocity that goes straight to the speed loops.
    forward: f64,
    friction: f64,
    /// So many times as much has the second side, where each is by itself.
    harder: f64,
    noise: f64,
    /// Part of the span that the carriage stands aside of the middle.
    aside: f64,
}

impl Drawn {
    /// An even one, whose drives are as they are delivered.
    fn even() -> Self {
        Self {
            cycle_ms: 2,
            beam: Some(2e6),
            gains: [80.0; 2],
            forward: 1.0,
            friction: 10.0,
            harder: 1.0,
            noise: 1.0,
            aside: 0.0,
        }
    }

    /// With these keys besides, and a program.
    fn rig(&self, keys: &str, program: &str) -> Rig {
        let stands = format!("G0 Y{:.1}\n", 500.0 + 1000.0 * self.aside);
        let program = program.replacen("G64\n", &format!("G64\n{stands}"), 1);
        self.switched_on(keys, Some(&program))
    }

    /// With or without a program.
    fn switched_on(&self, keys: &str, program: Option<&str>) -> Rig {
        let Self {
            friction, noise, ..
        } = self;
        let of_side = format!("friction = {friction:?}, encoder_noise = {noise:?}");
        let simulation = match self.beam {
            Some(stiffness) => format!(
                "mechanics = \"rigid_beam\", mass = 80.0, inertia = 15.0, span = 1500.0, racking_stiffness = {stiffness:?}, \
                 racking_damping = {:?}, carriage = \"Y\", carriage_mass = 40.0, {of_side}",
                stiffness * 2e-4
            ),
            None => format!("load = 40.0, {of_side}"),
        };
        let axis = format!("{}{keys}simulation = {{ {simulation} }}\n", PLAIN.1);
        let [one, other] = self.gains.map(|gain| {
            let [gain, forward] = [10.0 * gain, 1000.0 * self.forward].map(f64::round);
            format!("sdo = [[\"3012:3\", {gain}], [\"3012:6\", {forward}]]\n")
        });
        let [one, other] = [
            format!("zero = 1_250_000\n{one}"),
            format!("zero = -843_776\n{other}"),
        ];
        let cycle = format!("cycle_us = {}", 1000 * self.cycle_ms);
        let changes: [(&str, &str); 4] = [
            (PLAIN.0, &axis),
            ("zero = 1_250_000\n", &one),
            ("zero = -843_776\n", &other),
            ("cycle_us = 2000", &cycle),
        ];
        let configure = |drive: usize, config: &mut Config| {
            if drive == X2
                && let Some(axis) = &mut config.axis
            {
                axis.train.guide.coulomb *= self.harder;
            }
        };
        match program {
            Some(program) => Rig::new("portal", &changes, program, configure),
            None => Rig::staying_on("portal", &changes, configure),
        }
    }

    /// Greatest and RMS skew, mm, racking torque, N·m, and time of motion, s, of a run that passes.
    fn run(&self, keys: &str) -> [f64; 4] {
        let mut rig = self.rig(keys, PROGRAM);
        assert_eq!(
            rig.finish(),
            End::Finished,
            "{self:?} {keys}: {:?}",
            rig.events
        );
        let summary = rig.judge();
        assert_eq!(
            summary.verdict, "pass",
            "{self:?} {keys}: {:?}",
            summary.violations
        );
        let gantry = &summary.gantries[0];
        [
            gantry.max_skew_mm,
            gantry.rms_skew_mm,
            gantry.max_racking_torque.unwrap_or_default(),
            summary.times.motion_s,
        ]
    }
}

fn coupled(position_gain: f64, more: &str) -> String {
    format!("cross_coupling = {{ position_gain = {position_gain:?}, limit = 2.5{more} }}\n")
}

/// A side whose loop is set lower lasts as long as the axis moves, and is taken out.
#[test]
fn a_side_that_is_set_lower_is_kept_with_the_other() {
    let gantry = Drawn {
        gains: [80.0, 70.0],
        forward: 0.0,
        ..Drawn::even()
    };
    let [open, closed, fast] =
        ["", &coupled(60.0, ""), &coupled(60.0, ", gain = 20.0")].map(|keys| gantry.run(keys));
    println!("without {open:.4?}, with {closed:.4?}, at the greatest gain {fast:.4?}");
    assert!(closed[1] < 0.55 * open[1], "{closed:?} {open:?}");
    assert!(closed[0] < 0.8 * open[0], "{closed:?} {open:?}");
    assert!(fast[1] < 0.4 * open[1], "{fast:?} {open:?}");
}

/// An even gantry is as it was.
#[test]
fn an_even_gantry_is_no_worse() {
    for beam in [None, Some(0.0), Some(2e6), Some(2e8)] {
        let gantry = Drawn {
            beam,
            ..Drawn::even()
        };
        let [open, closed] = ["", &coupled(60.0, "")].map(|keys| gantry.run(keys));
        println!("{beam:?}: without {open:.4?}, with {closed:.4?}");
        assert!(
            closed[0] < open[0] + 0.002 && closed[1] < open[1] + 0.0005,
            "{closed:?} {open:?}"
        );
    }
}

fn drawn() -> impl Strategy<Value = (Drawn, f64, f64)> {
    let beam = prop_oneof![
        Just(None),
        Just(Some(0.0)),
        (4.0..8.0_f64).prop_map(|it| Some(10_f64.powf(it)))
    ];
    // As slow as the drives bear what they are behind by.
    let gains = [80.0..140.0_f64, 0.75..1.3_f64];
    let forward = prop_oneof![Just(0.0), Just(1.0), 0.0..1.0_f64];
    let more = (forward, 0.0..60.0_f64, 0.0..4.0_f64, -0.4..0.4_f64);
    (2..=10_u32, beam, gains, more, 0.6..1.5_f64, 0.1..1.0_f64).prop_map(
        |(cycle_ms, beam, [gain, other], (forward, friction, noise, aside), stated, part)| {
            let gains = [gain, gain * other];
            let drawn = Drawn {
                cycle_ms,
                beam,
                gains,
                forward,
                friction,
                harder: 1.0,
                noise,
                aside,
            };
            (drawn, stated * gains[0].min(gains[1]), part)
        },
    )
}

/// The greatest `gain` that is allowed of a machine with such keys, 1/s.
fn greatest(drawn: &Drawn, position_gain: f64) -> f64 {
    let rig = drawn.rig(&coupled(position_gain, ""), PROGRAM);
    let axis = &rig.machine.axes[0];
    2.0 * axis.cross_coupling.expect("it is coupled").gain
}

fn no_drawn_gantry_is_worse(drawn: &Drawn, position_gain: f64, part: f64) {
    let gain = part * greatest(drawn, position_gain);
    let keys = coupled(position_gain, &format!(", gain = {gain:.3}"));
    let [open, closed] = ["", &keys].map(|keys| drawn.run(keys));
    println!("{drawn:?} {keys}: without {open:.4?}, with {closed:.4?}");
    assert!(
        closed[1] <= 1.2 * open[1] + 0.002,
        "{closed:.4?} {open:.4?}: {drawn:?} {keys}"
    );
    assert!(
        closed[0] <= 1.3 * open[0] + 0.005,
        "{closed:.4?} {open:.4?}: {drawn:?} {keys}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, failure_persistence: None, ..ProptestConfig::default() })]

    /// At any gain that is accepted: what is sent keeps every limit, nothing swings, and no gantry racks more than without.
    #[test]
    fn drawn_gantries_are_no_worse((drawn, position_gain, part) in drawn()) {
        no_drawn_gantry_is_worse(&drawn, position_gain, part);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    #[ignore = "takes minutes"]
    fn two_hundred_drawn_gantries_are_no_worse((drawn, position_gain, part) in drawn()) {
        no_drawn_gantry_is_worse(&drawn, position_gain, part);
    }
}

/// One whose second side is set lower.
fn uneven() -> Drawn {
    Drawn {
        gains: [80.0, 60.0],
        forward: 0.0,
        ..Drawn::even()
    }
}

/// From the fault of another axis on what the sides are sent apart runs out within its share, and nothing of it comes back as the axis
/// slows down.
#[test]
fn it_is_held_while_a_fault_stops_the_machine() {
    let mut rig = uneven().rig(&coupled(60.0, ""), "G21 G90 G64\nG1 X1400 F36000\nM2\n");
    let x = AxisLetter::X.index();
    rig.run_until(|rig| {
        rig.rows
            .last()
            .is_some_and(|row| row.axes[x].coupled.abs() > 1.0)
    });
    rig.twin(Y)
        .disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
    rig.run_to(Phase::Stop);
    let at = rig.rows.len();
    rig.run_until(|rig| rig.rows[rig.rows.len() - 1].plan.velocity[x] == 0.0);
    let coupled = |row: usize| rig.rows[row].axes[x].coupled;
    let (fault, end) = (coupled(at - 1), coupled(rig.rows.len() - 1));
    let of = rig.machine.axes[0].cross_coupling.expect("it is coupled");
    // And a few cycles go by until the fault is seen.
    let runs_on = 0.5 * of.rate * of.rate / of.slew + 2.0 * of.rate / of.smoothing + 0.01 * of.rate;
    assert!((end - fault).abs() < runs_on, "{fault} {end} {runs_on}");
    let settled = at + 90;
    assert!(rig.rows.len() > settled + 30, "{}", rig.rows.len() - at);
    let went = (coupled(settled) - end).abs();
    assert!(went < 1e-3, "{went}");
    rig.finish();
    let summary = rig.judge();
    let limits = ["velocity", "acceleration", "jerk", "soft"];
    let beyond = summary
        .violations
        .iter()
        .filter(|it| limits.iter().any(|what| it.what.contains(what)));
    assert_eq!(beyond.count(), 0, "{:?}", summary.violations);
}

/// Behind a SYNC that is left out the drives are sent two steps of the plan at once, and so two of what couples them: by steps it keeps
/// its bounds.
#[test]
fn a_lost_cycle_leaves_it_as_smooth_as_it_was() {
    let mut rig = uneven().rig(&coupled(60.0, ""), "G21 G90 G64\nG1 X1000 F6000\nM2\n");
    let x = AxisLetter::X.index();
    let cycle = rig.machine.cycle;
    for from in [0.03, 0.2] {
        rig.run_until(|rig| (rig.rows.last()).is_some_and(|row| row.axes[x].coupled.abs() > from));
        rig.session.timeline().wake_late(cycle.mul_f64(1.1));
    }
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let lost = |it: &&Event| matches!(it, Event::LostCycles { lost: 1, .. });
    assert_eq!(
        rig.events.iter().filter(lost).count(),
        2,
        "{:?}",
        rig.events
    );
    let of = rig.machine.axes[0].cross_coupling.expect("it is coupled");
    let period = cycle.as_secs_f64();
    // What it goes at from row to row, and over how many steps of the plan.
    let pairs = rig.rows.windows(2).filter_map(|rows| {
        let speed = rows
            .iter()
            .map(|it| it.plan.velocity[x])
            .fold(f64::INFINITY, f64::min);
        let went = rows[1].axes[x].set - rows[0].axes[x].set;
        let steps = (went / (speed * period)).round();
        let change = rows[1].axes[x].coupled - rows[0].axes[x].coupled;
        (speed > 50.0).then(|| (change / (steps * period), steps))
    });
    let pairs: Vec<_> = pairs.collect();
    let at_once = pairs.iter().filter(|it| it.1 == 2.0);
    assert_eq!(at_once.count(), 2);
    for pair in pairs.windows(2) {
        let [(before, over), (now, steps)] = [pair[0], pair[1]];
        let allowed = 0.5 * (over + steps) * of.slew * period;
        assert!((now - before).abs() <= allowed, "{before} {now} {allowed}");
    }
}

/// Encoders whose noise is more than what is left alone have an axis wait for no long time, at a hold and at a stop too; that is counted as
/// settling.
#[test]
fn noise_is_not_waited_for() {
    let noisy = Drawn {
        noise: 20.0,
        ..uneven()
    };
    let program = "G21 G90 G64\nG1 X100 F6000\nM0\nG1 X200\nM0\nG1 X0\nM2\n";
    let mut rig = noisy.rig(&coupled(60.0, ""), program);
    let period = rig.machine.cycle.as_secs_f64();
    let mut all = 0.0;
    let mut looks = |rig: &Rig, from: usize| {
        let rows = rig.rows[from..].iter();
        let corrects = rows.filter(|it| it.waiting == Some(Waiting::Corrections));
        let waited = corrects.count() as f64 * period;
        all += waited;
        assert!((0.02..0.9).contains(&waited), "{waited}");
    };
    for pause in 1..=2 {
        let from = rig.rows.len();
        rig.run_until(|rig| {
            let paused = rig.events.iter();
            paused
                .filter(|it| matches!(it, Event::Paused { .. }))
                .count()
                == pause
        });
        looks(&rig, from);
        rig.command(Command::CycleStart);
    }
    let x = AxisLetter::X.index();
    let moves = |rig: &mut Rig| rig.rows[rig.rows.len() - 1].plan.velocity[x] < -50.0;
    rig.run_until(moves);
    let from = rig.rows.len();
    rig.command(Command::FeedHold);
    rig.run_until(|rig| state(rig) == State::Held);
    looks(&rig, from);
    rig.command(Command::Resume);
    rig.run_until(moves);
    rig.command(Command::Stop);
    rig.run_until(|rig| rig.rows[rig.rows.len() - 1].plan.velocity[x] == 0.0);
    let rests = rig.rows.len();
    rig.finish();
    let until_over = (rig.rows.len() - rests) as f64 * period;
    assert!(until_over < 1.2, "{until_over}");
    let times = rig.judge().times;
    assert!(times.settling_s >= all && times.dwell_s < 0.01, "{times:?}");
}

/// A side that something holds is given up, which is told once, and the program goes on.
#[test]
fn a_side_that_is_held_is_given_up() {
    let keys = "cross_coupling = { position_gain = 60.0, limit = 0.05 }\n";
    let mut rig = Drawn {
        beam: None,
        ..Drawn::even()
    }
    .rig(keys, "G21 G90 G64\nG1 X100 F3000\nM0\nG4 P0.5\nM2\n");
    let x = AxisLetter::X.index();
    rig.run_until(|rig| rig.rows.last().is_some_and(|row| row.axes[x].set > 99.8));
    rig.twin(X2).disturb(Disturbance::Block(true));
    rig.run_until(|rig| {
        rig.events
            .iter()
            .any(|it| matches!(it, Event::Paused { .. }))
    });
    let given_up = rig.events.iter().filter_map(|it| match it {
        Event::SidesApart {
            axis: 0,
            what: SidesApart::GivenUp(apart),
        } => Some(*apart),
        _ => None,
    });
    let given_up: Vec<_> = given_up.collect();
    assert!(
        matches!(given_up[..], [apart] if (0.05..0.2).contains(&apart)),
        "{given_up:?}"
    );
    rig.twin(X2).disturb(Disturbance::Block(false));
    rig.command(Command::CycleStart);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
}

/// However late the drives follow, and so however small the gain is, the sides are together where an axis has come to rest, a homing
/// comes to its end, and leaves them so.
#[test]
fn slow_drives_are_waited_for_and_homed() {
    for position_gain in [2.0, 5.0, 10.0, 40.0] {
        let gantry = Drawn {
            gains: [80.0, 40.0],
            beam: None,
            ..uneven()
        };
        let mut rig = gantry.switched_on(&coupled(position_gain, ""), None);
        settle(&mut rig);
        rig.command(Command::Mdi("G1 X400 F2500".to_owned()));
        settle(&mut rig);
        let apart = truth(&mut rig, X2) - truth(&mut rig, 0);
        assert!(apart.abs() < 0.003, "{position_gain}: {apart}");
        rig.command(home(AxisLetter::X));
        settle(&mut rig);
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        let apart = truth(&mut rig, X2) - truth(&mut rig, 0);
        assert!(apart.abs() < 0.003, "{position_gain}: {apart}");
    }
}

/// A limit that does not suffice is told once; what is sent keeps to it.
#[test]
fn a_limit_that_does_not_suffice_is_told_once() {
    let keys = "cross_coupling = { position_gain = 60.0, limit = 0.05 }\n";
    let mut rig = uneven().rig(keys, PROGRAM);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let at_limit = Event::SidesApart {
        axis: 0,
        what: SidesApart::AtLimit(0.05),
    };
    let told = |it: &&Event| **it == at_limit;
    assert_eq!(
        rig.events.iter().filter(told).count(),
        1,
        "{:?}",
        rig.events
    );
    let x = AxisLetter::X.index();
    let greatest = rig.rows.iter().map(|row| row.axes[x].coupled.abs());
    let greatest = greatest.fold(0.0, f64::max);
    assert!((0.045..0.05 + 1e-9).contains(&greatest), "{greatest}");
    let summary = rig.judge();
    assert_eq!(summary.verdict, "pass", "{:?}", summary.violations);
    let told = summary.gantries[0].max_coupling_mm.expect("it is coupled");
    assert!((told - greatest).abs() < 1e-9, "{told} {greatest}");
    let read = summary.gantries[0].to_string();
    let expected = format!("cross-coupling max {told:.4} of 0.05 mm in line ");
    assert!(read.contains(&expected), "{read}");
}

/// A fault holds what the sides are sent apart, and the reset behind it begins with nothing.
#[test]
fn it_begins_anew_as_drives_are_enabled() {
    let mut rig = uneven().switched_on(&coupled(60.0, ""), None);
    settle(&mut rig);
    let x = AxisLetter::X.index();
    let sent = |rig: &Rig| rig.rows.last().map_or(0.0, |row| row.axes[x].coupled.abs());
    rig.command(Command::Mdi("G1 X1400 F36000".to_owned()));
    rig.run_until(|rig| sent(rig) > 1.0);
    rig.twin(Y)
        .disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
    settle(&mut rig);
    assert_eq!(state(&rig), State::Faulted, "{:?}", rig.events);
    assert!(sent(&rig) > 0.5, "{}", sent(&rig));
    rig.command(Command::Reset);
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert_eq!(sent(&rig), 0.0);
}

/// Sides that differ by no more than is left alone are apart, and a homing takes that out.
#[test]
fn what_is_left_alone_is_taken_out_by_a_homing() {
    let square = "homing = { kind = \"encoder\", max_skew = 40.0, square_speed = 5.0 }\n";
    let keys = coupled(60.0, ", dead_zone = 0.05") + square;
    let mut rig = uneven().switched_on(&keys, None);
    settle(&mut rig);
    rig.command(Command::Mdi("G1 X1400 F36000".to_owned()));
    settle(&mut rig);
    let apart = |rig: &mut Rig| truth(rig, X2) - truth(rig, 0);
    let before = apart(&mut rig);
    assert!(before.abs() > 0.005, "{before}");
    rig.command(home(AxisLetter::X));
    settle(&mut rig);
    let told = rig.events.iter().find_map(|it| match it {
        Event::Referenced { axis: 0, apart, .. } => Some(*apart),
        _ => None,
    });
    let told = told.expect("it was homed");
    assert!((told - before).abs() < 0.002, "{told} {before}");
    // Friction has so short a way take its time.
    for _ in 0..2000 {
        rig.step();
    }
    let after = apart(&mut rig);
    assert!(after.abs() < 0.002, "{after}");
    rig.command(Command::Mdi("G1 X0 F36000".to_owned()));
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
}

/// An axis that is set where it stands does not move by that, however often, with its sides held by friction or not.
#[test]
fn an_axis_that_is_set_here_stays() {
    for (friction, harder) in [(10.0, 1.0), (60.0, 4.0)] {
        let gantry = Drawn {
            gains: [80.0, 40.0],
            beam: None,
            friction,
            harder,
            ..uneven()
        };
        let homing = "homing = { kind = \"set_here\", position = 0.0 }\n";
        let keys = coupled(40.0, ", dead_zone = 0.05") + homing;
        let mut rig = gantry.switched_on(&keys, None);
        settle(&mut rig);
        rig.command(home(AxisLetter::X));
        settle(&mut rig);
        rig.command(Command::Mdi("G1 X400 F2000".to_owned()));
        settle(&mut rig);
        let sides = |rig: &mut Rig| [0, X2].map(|drive| truth(rig, drive));
        let before = sides(&mut rig);
        for _ in 0..10 {
            rig.command(home(AxisLetter::X));
            settle(&mut rig);
        }
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        let after = sides(&mut rig);
        for (before, after) in before.into_iter().zip(after) {
            assert!(
                (after - before).abs() < 0.005,
                "{before} {after}: {:?}",
                rig.events
            );
        }
    }
}

/// What a machine file says wrongly, or of drives that cannot be coupled.
#[test]
fn what_cannot_be_coupled_is_refused() {
    let folder = Folder::new();
    let skew = "skew_limit = 0.5\n";
    let with = |keys: &str| format!("{skew}cross_coupling = {{ {keys} }}\n");
    let told = |changes: &[(&str, &str)]| {
        let file = folder.file("portal.toml", &machine_with("portal", changes));
        Machine::load(&file)
            .map(|_| ())
            .expect_err(&format!("{changes:?}"))
            .to_string()
    };
    for (keys, parts) in [
        ("limit = 0.2", &["position_gain", "1 to 1000 (1/s)"][..]),
        (
            "position_gain = 60.0",
            &["limit", "at most 0.25 (mm), half of `skew_limit`"],
        ),
        (
            "position_gain = 60.0, limit = 0.0002",
            &["less than what these drives tell apart", "4 increments"],
        ),
        (
            "position_gain = 60.0, limit = 0.3",
            &["limit", "half of `skew_limit`"],
        ),
        (
            "position_gain = 60.0, limit = 0.2, gain = 21.0",
            &[
                "may swing against each other",
                "allowed: up to",
                "half of that",
            ],
        ),
        (
            "position_gain = 60.0, limit = 0.2, dead_zone = 0.3",
            &["dead_zone", "to 0.05 (mm), the axis's `standstill_window`"],
        ),
        (
            "position_gain = 60.0, limit = 0.02, dead_zone = 0.03",
            &["dead_zone", "to 0.02 (mm), its `limit`"],
        ),
        (
            "position_gain = 60.0, limit = 0.2, gian = 2.0",
            &["gian", "`gain`"],
        ),
    ] {
        let told = told(&[(skew, &with(keys))]);
        for part in parts {
            assert!(told.contains(part), "{keys}: {told}");
        }
    }
    // What is told to be allowed is, and what is a little more is not.
    for position_gain in (1..=50).map(|it| 7.3 * f64::from(it)) {
        let of = |gain: f64| {
            let keys = format!("position_gain = {position_gain:.1}, limit = 0.2, gain = {gain:.2}");
            let file = folder.file(
                "portal.toml",
                &machine_with("portal", &[(skew, &with(&keys))]),
            );
            Machine::load(&file)
                .map(|_| ())
                .map_err(|it| it.to_string())
        };
        let told = of(900.0).expect_err("it is too much");
        let (_, behind) = told.split_once("allowed: up to ").expect("it is told");
        let (greatest, _) = behind.split_once(" 1/s").expect("with its unit");
        let greatest: f64 = greatest.parse().expect("a number");
        assert_eq!(of(greatest), Ok(()));
        assert!(of(greatest + 0.01).is_err(), "{position_gain} {greatest}");
    }
    let one = "drives = [\"Y\"]\n";
    let coupled = format!("{one}cross_coupling = {{ position_gain = 60.0, limit = 0.2 }}\n");
    let one = told(&[(one, &coupled)]);
    assert!(one.contains("`cross_coupling` of one drive"), "{one}");
    let good = with("position_gain = 60.0, limit = 0.2");
    let velocities = told(&[
        (skew, &good),
        (
            "name = \"X1\"\nbus = \"portal\"\nnode = 1\nmodel = \"lxm32m\"",
            "name = \"X1\"\nbus = \"portal\"\nnode = 1\nmodel = \"cia402_csv\"",
        ),
        (
            "name = \"X2\"\nbus = \"portal\"\nnode = 2\nmodel = \"lxm32m\"",
            "name = \"X2\"\nbus = \"portal\"\nnode = 2\nmodel = \"cia402_csv\"",
        ),
        (
            "drive_following_error = true\ndrive_soft_limits = true\n",
            "",
        ),
    ]);
    assert!(
        velocities.contains("drive \"X1\"") && velocities.contains("is sent velocities"),
        "{velocities}"
    );
}

/// What docs/measured.md has of it.
#[test]
#[ignore = "prints a table"]
fn gantries_without_and_with_it() {
    let slow = Drawn {
        forward: 0.0,
        ..Drawn::even()
    };
    let cases = [
        (
            "even, stiff",
            Drawn {
                beam: Some(2e8),
                ..Drawn::even()
            },
        ),
        ("even", Drawn::even()),
        (
            "one gain lower",
            Drawn {
                gains: [80.0, 60.0],
                ..slow.clone()
            },
        ),
        (
            "one gain a little lower",
            Drawn {
                gains: [80.0, 76.0],
                ..slow.clone()
            },
        ),
        (
            "one gain lower, feed-forward",
            Drawn {
                gains: [80.0, 40.0],
                ..Drawn::even()
            },
        ),
        (
            "carriage aside",
            Drawn {
                aside: 0.4,
                ..slow.clone()
            },
        ),
        (
            "carriage aside, no racking stiffness",
            Drawn {
                aside: 0.4,
                beam: Some(0.0),
                ..slow.clone()
            },
        ),
        (
            "carriage aside, feed-forward",
            Drawn {
                aside: 0.4,
                ..Drawn::even()
            },
        ),
        (
            "more friction",
            Drawn {
                beam: None,
                friction: 40.0,
                harder: 5.0,
                ..slow.clone()
            },
        ),
        (
            "more friction, feed-forward",
            Drawn {
                beam: None,
                friction: 40.0,
                harder: 5.0,
                ..Drawn::even()
            },
        ),
    ];
    for (name, gantry) in cases {
        let [open, closed, fast] =
            ["", &coupled(60.0, ""), &coupled(60.0, ", gain = 20.0")].map(|keys| gantry.run(keys));
        let columns = [0, 1, 2].map(|of| {
            let [open, closed, fast] = [open, closed, fast].map(|it| it[of]);
            format!("{open:.4} | {closed:.4} | {fast:.4}")
        });
        println!("| {name} | {} |", columns.join(" | "));
    }
}
