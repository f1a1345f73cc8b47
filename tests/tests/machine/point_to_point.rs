//! Axes that go point to point beside the portal: U and V on two TLC53x, W on a TSP10-CBE.

use super::day::{go, settle, state};
use super::homing::home;
use super::velocity;
use proptest::prelude::*;
use syncline_canopen::{CanId, CobId};
use syncline_controller::control::fault::AxisCause;
use syncline_controller::control::{
    End, Event, Fault, KnownBy, Refusal as OrderRefusal, Row, State,
};
use syncline_controller::machine::COORDINATES;
use syncline_controller::session::{Command, Direction, Jog, Override, Refusal, SwitchChange};
use syncline_drives::twin::Disturbance;
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

const X: usize = 0;
const Z: usize = 2;
const U: usize = 6;
const V: usize = 7;
const W: usize = 8;

/// Of the drive of U among the devices.
const DRIVE: usize = 4;

const TABLES: &str = r#"
[[drive]]
name = "U"
bus = "portal"
node = 5
model = "tlc5xx"

[[drive]]
name = "V"
bus = "portal"
node = 6
model = "tlc5xx"
direction = "negative"

[[drive]]
name = "W"
bus = "portal"
node = 7
model = "tsp10"
sdo = [["6075:0", 5000]]

[[axis]]
name = "U"
drives = ["U"]
motion = "point_to_point"
pitch = 20.0
max_velocity = 400.0
max_acceleration = 4000.0
max_jerk = 1e6
soft_limits = [-300.0, 300.0]
following_error_limit = 1.0
standstill_window = 0.05

[[axis]]
name = "V"
drives = ["V"]
motion = "point_to_point"
pitch = 10.0
max_velocity = 200.0
max_acceleration = 2000.0
max_jerk = 1e6
soft_limits = [-300.0, 300.0]
following_error_limit = 1.0
standstill_window = 0.05

[[axis]]
name = "W"
drives = ["W"]
pitch = 10.0
max_velocity = 80.0
max_acceleration = 800.0
max_jerk = 1e6
soft_limits = [-300.0, 300.0]
following_error_limit = 1.0
standstill_window = 0.05

[axis.homing]
kind = "set_here"

[homing]
unreferenced_jobs = true

[[axis]]
name = "X"
"#;

const WINDOW: f64 = 0.05;

/// A probe on Z, and a table that it touches 30.5 mm below.
pub(super) const PROBE: &str = r#"
[[input]]
name = "probe"
drive = "Z"
signal = "DI0"
function = "probe"

[simulation]
ball = 4.0

[[simulation.workpiece]]
name = "table"
shape = "plane"
facing = "+Z"
at = -32.5

[machine]"#;

/// The portal with them.
pub(super) const CHANGES: [(&str, &str); 2] = [
    ("cycle_us = 2000", "cycle_us = 4000"),
    ("[[axis]]\nname = \"X\"\n", TABLES),
];

/// Y on a drive that goes in a straight line from one velocity to the next: a cycle later than the others.
const LATE: [(&str, &str); 3] = [
    (
        "node = 3\nmodel = \"lxm32m\"",
        "node = 3\nmodel = \"cia402_csv\"",
    ),
    (velocity::SUPERVISED, velocity::UNSUPERVISED),
    (
        "[machine]",
        "[model.cia402_csv]\nencoder_increments = 131072\n\n[machine]",
    ),
];

fn portal(program: &str) -> Rig {
    Rig::new("portal", &CHANGES, program, |_, _| ())
}

/// A machine that stays on, with these lines at work.
fn at_work(lines: &str) -> Rig {
    let mut rig = Rig::staying_on("portal", &CHANGES, |_, _| ());
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    rig.command(Command::Mdi(lines.to_owned()));
    rig
}

/// The same with a probe.
fn at_work_with_probe(lines: &str) -> Rig {
    let changes = [CHANGES[0], CHANGES[1], ("[machine]", PROBE)];
    let mut rig = Rig::staying_on("portal", &changes, |_, _| ());
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    rig.command(Command::Mdi(lines.to_owned()));
    rig
}

fn act(row: &Row<COORDINATES>, axis: usize) -> f64 {
    row.axes[axis].act
}

/// Where the axes are at last.
fn ends(rig: &Rig, axis: usize) -> f64 {
    act(rig.rows.last().unwrap(), axis)
}

/// By how much an axis moves in all of these rows.
fn travel(rows: &[Row<COORDINATES>], axis: usize) -> f64 {
    let at = || rows.iter().map(|row| act(row, axis));
    at().fold(f64::MIN, f64::max) - at().fold(f64::MAX, f64::min)
}

#[test]
fn the_path_waits_while_they_go() {
    let mut rig = portal("G21 G90 G94 G64\nG1 X50 F6000\nG0 U60 V-20 W5\nG1 X0\nG0 U0 V0 W0\nM2\n");
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let goes = |row: &Row<COORDINATES>| {
        [U, V, W]
            .map(|axis| row.axes[axis].by_itself)
            .contains(&true)
    };
    let beside: Vec<_> = rig.rows.iter().filter(|row| goes(row)).copied().collect();
    assert!(travel(&beside, U) > 59.0 && travel(&beside, V) > 19.0 && travel(&beside, W) > 4.9);
    assert!(beside.iter().all(|row| row.plan.speed == 0.0));
    let away = rig.rows.iter().filter(|row| act(row, U) > 59.9);
    assert!(away.clone().all(|row| act(row, W) > 4.9) && away.count() > 0);
    for axis in [U, V, W] {
        assert!(ends(&rig, axis).abs() <= WINDOW, "{}", ends(&rig, axis));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4, ..ProptestConfig::default() })]

    /// The line told is that of the block at work, along the path or beside it; at a fault, too.
    #[test]
    fn the_line_is_that_of_the_block_at_work(
        places in prop::collection::vec(5.0..60.0_f64, 2..5), fault_at in prop::option::of(0..1500usize),
    ) {
        let mut program = "G21 G90 G94 G61\n".to_owned();
        for (number, place) in places.iter().enumerate() {
            let side = [*place, -place][number % 2];
            program += &format!("G1 X{} F6000\nG0 U{side:.3}\n", 20 * (number + 1));
        }
        program += "M2\n";
        let mut rig = portal(&program);
        let mut looked = 0;
        let mut line = 0;
        while rig.step() {
            let status = rig.session.status();
            let Some(row) = rig.rows.last() else { continue };
            let x = row.plan.position[X];
            if row.axes[U].by_itself && (x / 20.0).fract() == 0.0 && x > 0.0 {
                line = 1 + 2 * (x / 20.0) as u32;
                prop_assert_eq!(status.line, line, "{} at X{}", program, x);
                looked += 1;
            } else if row.plan.speed > 10.0 {
                line = 2 * (x / 20.0).ceil() as u32;
                prop_assert_eq!(status.line, line, "{} at X{}", program, x);
            }
            if fault_at == Some(looked) && looked > 0 {
                rig.twin(DRIVE).disturb(Disturbance::Mute(true));
                break;
            }
        }
        if fault_at.is_some_and(|at| at == looked && at > 0) {
            rig.run_until(|rig| rig.session.status().stopped.is_some());
            let told = rig.session.status().stopped.clone().and_then(|stopped| stopped.line);
            // Between two looks another block may have begun.
            prop_assert!(told.is_some_and(|told| (line..=line + 1).contains(&told)), "{:?}, {}", told, line);
        }
    }
}

/// The level of bit 6 at which a target of a TLC53x is absolute is doubtful (D-02), and so is that of bit 9 (D-04): each way round it gets to
/// its targets.
#[test]
fn bits_6_and_9_are_as_the_machine_file_says() {
    for (absolute, remote) in [(0, 0), (0, 1), (1, 1), (1, 2)] {
        let table =
            format!("[model.tlc5xx]\nabsolute_bit = {absolute}\nremote_bit = {remote}\n\n[[bus]]");
        let changes = [&CHANGES[..], &[("[[bus]]", &table)]].concat();
        let mut rig = Rig::new(
            "portal",
            &changes,
            "G21 G90\nG0 U30\nG0 U-12 V5\nM2\n",
            |_, _| (),
        );
        assert_eq!(rig.finish(), End::Finished, "{table}: {:?}", rig.events);
        assert!(
            (act(rig.rows.last().unwrap(), U) + 12.0).abs() <= WINDOW,
            "{table}"
        );
    }
}

#[test]
fn what_they_do_passes_validation() {
    let rig = portal("G21 G90 G94 G64\nG1 X50 F6000\nG0 U60 V-20 W5\nG1 X0\nG1 W0 F600\nM2\n");
    let summary = rig.judge();
    assert!(summary.violations.is_empty(), "{:?}", summary.violations);
}

#[test]
fn a_path_that_takes_one_along_is_refused() {
    for block in ["G1 X10 U10 F600", "G2 X10 U5 I5 F600"] {
        let mut rig = at_work(&format!("G21 G90 {block}"));
        settle(&mut rig);
        let told = rig.problems.join("\n");
        assert!(told.contains("axis U goes point to point"), "{told}");
    }
    // A rapid of both goes along the path first.
    let mut rig = portal("G21 G90 G0 X20 U10\nM2\n");
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    let early = rig.rows.iter().filter(|row| act(row, X) < 19.0);
    assert!(early.into_iter().all(|row| act(row, U).abs() < WINDOW));
    assert!((ends(&rig, U) - 10.0).abs() <= WINDOW);
}

#[test]
fn no_jog_moves_one() {
    let mut rig = at_work("G4 P0");
    settle(&mut rig);
    let axis = AxisLetter::ALL[U];
    go(
        &mut rig,
        Command::Jog(Jog::Continuous {
            axis,
            direction: Direction::Positive,
            speed: None,
        }),
    );
    let refused: Vec<_> = rig.refused.iter().map(|it| it.reason.clone()).collect();
    let expected = Refusal::Machine(OrderRefusal::PointToPoint(U));
    assert_eq!(refused, [expected]);
}

/// Rests on the way, with the drive halted, and goes on to the same target.
#[test]
fn a_feed_hold_rests_them_and_resume_goes_on() {
    let mut rig = at_work("G0 U200 W30");
    rig.run_until(|rig| rig.rows.last().is_some_and(|row| act(row, U) > 40.0));
    rig.command(Command::FeedHold);
    for _ in 0..400 {
        rig.step();
    }
    assert_eq!(state(&rig), State::Held);
    let held = rig.rows.len();
    for _ in 0..400 {
        rig.step();
    }
    for axis in [U, W] {
        assert!(travel(&rig.rows[held..], axis) < 0.02);
    }
    assert!((45.0..190.0).contains(&ends(&rig, U)), "{}", ends(&rig, U));
    go(&mut rig, Command::Resume);
    assert_eq!(state(&rig), State::Ready);
    assert!((ends(&rig, U) - 200.0).abs() <= WINDOW && (ends(&rig, W) - 30.0).abs() <= WINDOW);
}

/// What is left of the target is forgotten with the power, and the next job begins where it stands.
#[test]
fn a_stop_ends_the_move() {
    let mut rig = at_work("G0 U200 W30");
    rig.run_until(|rig| rig.rows.last().is_some_and(|row| act(row, U) > 40.0));
    rig.command(Command::Stop);
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    let stopped = [U, W].map(|axis| ends(&rig, axis));
    assert!((45.0..190.0).contains(&stopped[0]), "{stopped:?}");
    let rests = rig.rows.len();
    go(&mut rig, Command::Mdi("G4 P2".to_owned()));
    for axis in [U, W] {
        assert!(travel(&rig.rows[rests..], axis) < 0.02);
    }
    go(&mut rig, Command::Mdi("G90 G0 U-10".to_owned()));
    assert!((ends(&rig, U) + 10.0).abs() <= WINDOW, "{}", ends(&rig, U));
    assert!((ends(&rig, W) - stopped[1]).abs() < 0.02);
}

/// A stop between the profiles and the targets: the next move has a profile of its own.
#[test]
fn a_stop_before_it_sets_off_forgets_the_profile() {
    let mut rig = at_work("G90 G0 U200");
    let requests = CobId::r_sdo(rig.machine.drives[DRIVE].node);
    let told = rig.sent(requests).len();
    rig.run_until(|rig| rig.sent(requests).len() > told);
    rig.command(Command::Stop);
    settle(&mut rig);
    assert!(ends(&rig, U).abs() <= WINDOW, "{}", ends(&rig, U));
    let from = rig.rows.len();
    go(&mut rig, Command::Mdi("G94 G1 U10 F600".to_owned()));
    let slow = rig.rows[from..].iter().filter(|row| row.axes[U].by_itself);
    assert!(slow.count() > 200 && (ends(&rig, U) - 10.0).abs() <= WINDOW);
}

#[test]
fn overrides_count_as_a_move_begins() {
    let mut rig = at_work("G4 P0");
    settle(&mut rig);
    let took = |rig: &mut Rig, line: &str| {
        let from = rig.rows.len();
        go(rig, Command::Mdi(line.to_owned()));
        rig.rows[from..]
            .iter()
            .filter(|row| row.axes[U].by_itself)
            .count()
    };
    let fast = took(&mut rig, "G90 G0 U100");
    rig.command(Command::RapidOverride(Override::To(25.0)));
    let slow = took(&mut rig, "G90 G0 U0");
    assert!(slow > 2 * fast, "{fast}, {slow}");
    rig.command(Command::RapidOverride(Override::To(0.0)));
    rig.command(Command::Mdi("G90 G0 U100".to_owned()));
    for _ in 0..400 {
        rig.step();
    }
    assert!(ends(&rig, U).abs() <= WINDOW);
    go(&mut rig, Command::RapidOverride(Override::To(100.0)));
    assert!((ends(&rig, U) - 100.0).abs() <= WINDOW);
}

#[test]
fn one_that_does_not_get_there_is_told() {
    let mut rig = portal("G21 G90\nG0 W100\nM2\n");
    rig.run_until(|rig| rig.rows.last().is_some_and(|row| act(row, W) > 20.0));
    // DE5 is the stop switch, of which the drive tells nothing by its state.
    rig.twin(DRIVE + 2).disturb(Disturbance::Input(4, true));
    let fault = rig.finish_with_fault();
    assert!(
        matches!(fault, Fault::Axis(_, AxisCause::NotThere { .. })),
        "{fault:?}"
    );
    let text = fault.describe(&*rig.layout);
    assert!(
        text.starts_with("axis W: its drive has not told that it has got to where it was sent"),
        "{text}"
    );
}

/// There is no way back over such a move, begun or done, and the operator is told so.
#[test]
fn no_retrace_takes_one_back() {
    let mut rig = at_work("G21 G90 G94\nG1 X50 F6000\nG0 U100\nG1 X100");
    rig.run_until(|rig| ends(rig, U) > 20.0);
    go(&mut rig, Command::Retrace);
    let refused: Vec<_> = rig.refused.iter().map(|it| it.reason.clone()).collect();
    assert_eq!(refused, [Refusal::Machine(OrderRefusal::NoWayBack)]);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    rig.command(Command::Mdi("G1 X50\nG0 U0\nG1 X20".to_owned()));
    rig.run_until(|rig| ends(rig, U).abs() < 1.0 && ends(rig, X) < 40.0);
    for told in [0, 1] {
        go(&mut rig, Command::Retrace);
        assert_eq!(state(&rig), State::Held);
        assert!((ends(&rig, X) - 50.0).abs() <= WINDOW, "{}", ends(&rig, X));
        let no_way = rig.events.iter().filter(|it| **it == Event::NoWayBack);
        assert_eq!(no_way.count(), told);
    }
    go(&mut rig, Command::Resume);
    assert_eq!(state(&rig), State::Ready);
    assert!((ends(&rig, X) - 20.0).abs() <= WINDOW && ends(&rig, U).abs() <= WINDOW);
}

/// How long it takes from now until there is a fault, s, and which.
fn until_fault(rig: &mut Rig) -> (f64, String) {
    let from = rig.controller().cycle();
    let fault_of = |rig: &Rig| {
        let mut events = rig.events.iter();
        events.find_map(|event| match event {
            Event::Fault(fault) => Some(fault.describe(&*rig.layout)),
            _ => None,
        })
    };
    rig.run_until(|rig| fault_of(rig).is_some());
    let cycles = rig.controller().cycle() - from;
    (cycles as f64 * PERIOD, fault_of(rig).unwrap_or_default())
}

/// The machine's cycle, and its `state_timeout_ms`, s.
const PERIOD: f64 = 4e-3;
const PATIENCE: f64 = 2.0;

/// A drive that does not hear of its target is found by that it does not acknowledge it.
#[test]
fn one_that_never_acknowledges_its_target_is_told() {
    for (axis, device) in [("U", DRIVE), ("W", DRIVE + 2)] {
        let mut rig = at_work("G4 P0");
        settle(&mut rig);
        rig.twin(device).disturb(Disturbance::Deaf(true));
        rig.command(Command::Mdi(format!("G90 G0 {axis}200")));
        let (after, text) = until_fault(&mut rig);
        let expected =
            format!("axis {axis}: its drive has not acknowledged where it was sent for 2.0");
        assert!(text.starts_with(&expected), "{text}");
        assert!((PATIENCE..PATIENCE + 0.1).contains(&after), "{after} s");
        settle(&mut rig);
        assert_eq!(state(&rig), State::Faulted);
    }
}

/// A drive that goes on while the machine is held, or its job is stopped, is found once it has had the time to halt.
#[test]
fn one_that_never_halts_is_told() {
    for (axis, device) in [("U", DRIVE), ("W", DRIVE + 2)] {
        for how in [Command::FeedHold, Command::Stop] {
            let mut rig = at_work(&format!("G94 G1 {axis}200 F1200"));
            let index = if axis == "U" { U } else { W };
            rig.run_until(|rig| rig.rows.last().is_some_and(|row| act(row, index) > 20.0));
            rig.twin(device).disturb(Disturbance::Deaf(true));
            rig.command(how.clone());
            let (after, text) = until_fault(&mut rig);
            let expected =
                format!("axis {axis}: its drive was told to halt and has not come to rest for 2.");
            assert!(text.starts_with(&expected), "{text}");
            assert!((PATIENCE..PATIENCE + 0.2).contains(&after), "{after} s");
            settle(&mut rig);
            assert_eq!(state(&rig), State::Faulted);
        }
    }
}

/// A panel may take control of one between its targets, as whoever set it up has it.
#[test]
fn who_may_control_one_stays_as_it_is() {
    let mut rig = portal("G21 G90\nG0 U20\nM2\n");
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_eq!(velocity::only_by_fieldbus(&rig, 5), [0; 0]);
}

#[test]
fn each_loss_has_its_own_message() {
    let cases = [
        (
            DRIVE,
            Disturbance::Mute(true),
            "no T_PDO in 2 cycles in a row",
        ),
        (
            DRIVE,
            Disturbance::Remote(false),
            "not under fieldbus control",
        ),
        (DRIVE, Disturbance::Mains(false), "EMCY"),
        (
            DRIVE + 2,
            Disturbance::Mute(true),
            "no answer to the polls of 6064h:0",
        ),
        (
            DRIVE + 2,
            Disturbance::Mains(false),
            "drive fault, statusword",
        ),
    ];
    for (device, disturbance, text) in cases {
        let mut rig = portal("G21 G90\nG0 U200 W100\nM2\n");
        rig.run_until(|rig| rig.rows.last().is_some_and(|row| act(row, U) > 40.0));
        rig.twin(device).disturb(disturbance);
        let fault = rig.finish_with_fault().describe(&*rig.layout);
        assert!(fault.contains(text), "{disturbance:?}: {fault}");
    }
}

/// An axis of a straight line as its drive rounds it.
struct Goer {
    device: usize,
    /// mm for a turn.
    pitch: f64,
    direction: f64,
    /// Its limits, mm/s and mm/s².
    velocity: f64,
    ramp: f64,
    /// The units of its velocity and of its ramps, mm/s and mm/s².
    units: [f64; 2],
    /// By how much its shaft lags behind its profile, s, and is beside it, mm.
    lag: f64,
    beside: f64,
}

/// U, V and W. Of a TLC53x velocities are eighths of 1 r/min, as many as leave U its 1200 r/min and a fifth more, and ramps
/// whole r/(min·s). A TSP10-CBE counts in steps; its rotor is beside its field by a quarter of a pole pair at most, and it
/// sets off as its frame arrives, a cycle earlier.
const GOERS: [Goer; 3] = [
    Goer {
        device: DRIVE,
        pitch: 20.0,
        direction: 1.0,
        velocity: 400.0,
        ramp: 4000.0,
        units: [20.0 / 60.0 / 8.0, 20.0 / 60.0],
        lag: 12.5e-3,
        beside: 0.01,
    },
    Goer {
        device: DRIVE + 1,
        pitch: 10.0,
        direction: -1.0,
        velocity: 200.0,
        ramp: 2000.0,
        units: [10.0 / 60.0 / 8.0, 10.0 / 60.0],
        lag: 12.5e-3,
        beside: 0.01,
    },
    Goer {
        device: DRIVE + 2,
        pitch: 10.0,
        direction: 1.0,
        velocity: 80.0,
        ramp: 800.0,
        units: [1e-3, 1e-3],
        lag: -4e-3,
        beside: 0.05,
    },
];

/// How far each two of the axes may be beside the straight line to these distances, mm, with this profile at most
/// (1/s, 1/s²): by what the units of their velocities and ramps round, as each adds up over the way, and by their lags as
/// they differ.
fn straightness(distances: [f64; 3], [one, other]: [usize; 2], [velocity, ramp]: [f64; 2]) -> f64 {
    let peak = velocity.min(ramp.sqrt());
    let rounded = |axis: usize| {
        let Goer { units, beside, .. } = &GOERS[axis];
        units[0] / peak + units[1] / ramp + beside
    };
    let [a, b] = [one, other].map(|axis| distances[axis].abs());
    let apart = (GOERS[one].lag - GOERS[other].lag).abs();
    rounded(one) + rounded(other) + a * b / f64::hypot(a, b) * peak * apart
}

/// A distance that an axis goes, or none.
fn distance() -> impl Strategy<Value = f64> {
    let whole = |way: f64| (way * 1000.0).round() / 1000.0;
    prop_oneof![
        1 => Just(0.0),
        3 => (1.0..250.0f64).prop_map(whole),
        3 => (-250.0..-1.0f64).prop_map(whole),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Each two of U, V and W keep to the straight line by their shafts, with a rapid as with a feed.
    #[test]
    fn a_line_stays_straight(
        distances in prop::array::uniform3(distance()),
        feed in prop::option::of(0.3..1.5f64),
        scale in prop_oneof![Just(1.0), 0.02..1.0f64],
    ) {
        let distances = distances.map(|it| (it * scale * 1000.0).round() / 1000.0);
        let [u, v, w] = distances;
        let length = (u * u + v * v + w * w).sqrt();
        prop_assume!(length > 0.5);
        let words = match feed {
            None => "G0".to_owned(),
            Some(velocity) => format!("G1 F{:.3}", velocity * length * 60.0),
        };
        let mut rig = portal(&format!("G21 G90 G94\n{words} U{u} V{v} W{w}\nM2\n"));
        let goers = || (0..3).filter(|&axis| distances[axis] != 0.0);
        let least = |limit: fn(&Goer) -> f64| {
            goers().map(|axis| limit(&GOERS[axis]) / distances[axis].abs()).fold(f64::INFINITY, f64::min)
        };
        let profile = [least(|it| it.velocity).min(feed.unwrap_or(f64::INFINITY)), least(|it| it.ramp)];
        rig.run_to_row(1);
        let turned = |rig: &mut Rig, axis: usize| {
            let Goer { device, pitch, direction, .. } = GOERS[axis];
            direction * pitch * rig.twin(device).observe().position
        };
        let began = [0, 1, 2].map(|axis| turned(&mut rig, axis));
        let pairs = [[0, 1], [0, 2], [1, 2]];
        let pairs = pairs.map(|it| it.iter().all(|&axis| distances[axis] != 0.0).then_some(it));
        let mut worst = [0.0_f64; 3];
        while rig.step() {
            let at = [0, 1, 2].map(|axis| turned(&mut rig, axis) - began[axis]);
            for (worst, [one, other]) in worst.iter_mut().zip(pairs).filter_map(|(it, pair)| Some((it, pair?))) {
                let (a, b) = (distances[one], distances[other]);
                *worst = worst.max((at[one] * b - at[other] * a).abs() / f64::hypot(a, b));
            }
        }
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        for (worst, pair) in worst.iter().zip(pairs).filter_map(|(it, pair)| Some((it, pair?))) {
            let bound = straightness(distances, pair, profile);
            prop_assert!(*worst <= bound, "{pair:?}: {worst} mm, bound {bound}");
        }
        for axis in [U, V] {
            prop_assert!((ends(&rig, axis) - distances[axis - U]).abs() <= WINDOW);
        }
    }

    /// Whatever they are sent to, in whatever order, with holds between: they end at the last target, one move after
    /// the other, and rest while held.
    #[test]
    fn moves_end_at_their_targets_in_order(
        moves in prop::collection::vec((0..3usize, -120..120i32, prop::option::of(600.0..9000.0f64)), 1..5),
        holds in prop::collection::vec((1..400u32, 1..200u32), 0..3),
    ) {
        let mut program = "G21 G90 G94\n".to_owned();
        for (axis, to, feed) in &moves {
            let letter = ["U", "V", "W"][*axis];
            let to = f64::from(*to) / if *axis == 2 { 8.0 } else { 1.0 };
            program += &match feed {
                Some(feed) => format!("G1 {letter}{to:.3} F{feed:.0}\n"),
                None => format!("G0 {letter}{to:.3}\n"),
            };
        }
        let mut rig = at_work(&program);
        for (before, held) in holds {
            for _ in 0..before {
                rig.step();
            }
            rig.command(Command::FeedHold);
            for _ in 0..300 {
                rig.step();
            }
            let rests = rig.rows.len();
            for _ in 0..held {
                rig.step();
            }
            for axis in [U, V, W] {
                prop_assert!(travel(&rig.rows[rests..], axis) < 0.03);
            }
            rig.command(Command::Resume);
        }
        settle(&mut rig);
        prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        let mut last = [0.0; 3];
        for (axis, to, _) in &moves {
            last[*axis] = f64::from(*to) / if *axis == 2 { 8.0 } else { 1.0 };
        }
        for (axis, to) in [U, V, W].into_iter().zip(last) {
            prop_assert!((ends(&rig, axis) - to).abs() <= WINDOW, "{}: {} for {}", axis, ends(&rig, axis), to);
        }
        for row in &rig.rows {
            let goers = [U, V, W].iter().filter(|&&axis| row.axes[axis].by_itself).count();
            prop_assert!(goers <= 1);
        }
    }

    /// In a cycle with a request by SDO, or with its answer, no drive is sent another setpoint than in the one before, also where
    /// setpoints wait for a drive that is later than theirs, as Y is here: they go on when the plan rests already.
    #[test]
    fn profiles_are_told_while_every_setpoint_rests(
        moves in prop::collection::vec((10..60i32, 10..60i32, -60..-10i32, 10..50i32), 1..4),
        feed in prop::option::of(600.0..20_000.0f64),
    ) {
        let mut program = "G21 G90 G94\n".to_owned();
        for (x, y, z, u) in moves {
            let along = feed.map_or("G0".to_owned(), |feed| format!("G1 F{feed:.0}"));
            program += &format!("{along} X{x} Y{y} Z{z}\nG0 U{u}\n");
        }
        let changes = [&CHANGES[..], &LATE[..]].concat();
        let mut rig = Rig::staying_on("portal", &changes, |_, _| ());
        settle(&mut rig);
        prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        let first = rig.frames().len();
        rig.command(Command::Mdi(program));
        settle(&mut rig);
        let nodes: Vec<_> = [0, 1, 3].iter().map(|&drive| rig.machine.drives[drive].node).collect();
        // U and V alone: W is asked all the time.
        let asked: Vec<_> = [DRIVE, DRIVE + 1].iter().map(|&drive| rig.machine.drives[drive].node).collect();
        let (mut requests, mut changed, mut told) = (0, false, vec![None; nodes.len()]);
        let mut all = 0;
        for sent in &rig.frames()[first..] {
            let id = sent.frame.id();
            if id == CanId::from(CobId::SYNC) {
                prop_assert!(!(changed && requests > 0), "{requests} requests and answers at {:?}", sent.start);
                (requests, changed) = (0, false);
            }
            if asked.iter().any(|&node| [CobId::r_sdo(node), CobId::t_sdo(node)].map(CanId::from).contains(&id)) {
                requests += 1;
                all += 1;
            }
            for (&node, told) in nodes.iter().zip(&mut told) {
                if id == CanId::from(CobId::r_pdo(2, node)) {
                    let setpoint = sent.frame.data()[2..].to_vec();
                    changed |= told.replace(setpoint.clone()).is_some_and(|before| before != setpoint);
                }
            }
        }
        prop_assert!(all > 0);
    }

    /// A drive that is cut off from its R_PDOs at any time of a long move, and held then: there is a fault within the
    /// time that it has for both. It never goes on for longer.
    #[test]
    fn one_that_is_cut_off_does_not_go_on_for_long(wait in 0..400u32, slow: bool, cut in 0..3u32) {
        let (axis, device) = if slow { ("W", DRIVE + 2) } else { ("U", DRIVE) };
        let mut rig = at_work(&format!("G94 G1 {axis}200 F1200"));
        for _ in 0..wait {
            rig.step();
        }
        rig.twin(device).disturb(Disturbance::Deaf(true));
        for _ in 0..cut {
            rig.step();
        }
        rig.command(Command::FeedHold);
        let until = rig.controller().cycle() + ((PATIENCE + 0.5) / PERIOD) as u64;
        rig.run_until(|rig| rig.controller().cycle() >= until);
        let index = if slow { W } else { U };
        let told = rig.events.iter().any(|it| matches!(it, Event::Fault(_)));
        // Nobody has sent it yet.
        let rests = ends(&rig, index).abs() <= WINDOW && state(&rig) == State::Held;
        prop_assert!(told || rests, "{:?}", rig.events);
    }

    /// Retraced, held and resumed at any times: every axis is where the program has it at each place of the path, and
    /// the program comes to its end.
    #[test]
    fn a_retrace_leads_back_over_no_move(
        acts in prop::collection::vec((1..500u32, 0..4u8), 1..7), single: bool, mixed: bool, u in 10..200i32, w in 2..20i32,
    ) {
        let mut rig = at_work("G4 P0");
        settle(&mut rig);
        let go_there = if mixed { format!("G0 X100 U{u}") } else { format!("X100\nG0 U{u}") };
        let start = rig.rows.len();
        rig.command(Command::Mdi(format!(
            "G21 G90 G94 G64\nG1 F9000 X50\n{go_there}\nG1 X150\nX200\nM0\nG0 W{w}\nG1 X300"
        )));
        if single {
            rig.command(Command::SingleBlock(SwitchChange::To(true)));
        }
        for (wait, act) in acts {
            for _ in 0..wait {
                rig.step();
            }
            rig.command(match act {
                0 | 1 => Command::Retrace,
                2 => Command::Resume,
                _ => Command::FeedHold,
            });
        }
        for _ in 0..12 {
            settle(&mut rig);
            rig.command(Command::Resume);
            settle(&mut rig);
            rig.command(Command::CycleStart);
        }
        settle(&mut rig);
        prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        let there = [(X, 300.0), (U, f64::from(u)), (W, f64::from(w))];
        for (axis, to) in there {
            prop_assert!((ends(&rig, axis) - to).abs() <= WINDOW, "{}: {}", axis, ends(&rig, axis));
        }
        for row in &rig.rows[start..] {
            for (axis, to, from) in [(U, f64::from(u), 100.0), (W, f64::from(w), 200.0)] {
                let along = act(row, X) - from;
                let expected = if along < 0.0 { 0.0 } else { to };
                let off = (act(row, axis) - expected).abs();
                prop_assert!(along.abs() < 1.0 || off <= WINDOW, "{} at {} with X {}", axis, act(row, axis), along);
            }
        }
    }

    /// Jogged off the path while it goes: it waits until the path is back where it began.
    #[test]
    fn none_goes_on_before_the_path_is_back(wait in 1..140usize, retraction: bool, to in 20..250i32) {
        let with = ("[machine]", "[retraction]\naxis = \"Z\"\nclearance = -20.0\napproach_speed = 10.0\n\n[machine]");
        let changes = [&CHANGES[..], &[with][..usize::from(retraction)]].concat();
        let mut rig = Rig::staying_on("portal", &changes, |_, _| ());
        settle(&mut rig);
        rig.command(Command::Mdi(format!("G21 G90 G94 G64\nG1 X50 Z-50 F6000\nG0 U{to}\nG1 X0")));
        let away = |rig: &Rig| (ends(rig, X) - 50.0).abs() > 4.0 * WINDOW;
        rig.run_until(|rig| ends(rig, U) > 0.5);
        for _ in 0..wait {
            rig.step();
        }
        // As long as its drive brakes.
        let begins = rig.rows.len() + 60;
        rig.command(Command::FeedHold);
        settle(&mut rig);
        prop_assume!(state(&rig) == State::Held && !away(&rig));
        rig.command(Command::Jog(Jog::By { axis: AxisLetter::X, distance: 20.0, speed: None }));
        for _ in 0..1200 {
            rig.step();
        }
        prop_assume!(state(&rig) == State::Held && away(&rig));
        for _ in 0..6 {
            rig.command(Command::Resume);
            settle(&mut rig);
        }
        prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        prop_assert!((ends(&rig, U) - f64::from(to)).abs() <= WINDOW && ends(&rig, X).abs() <= WINDOW);
        let back = rig.rows[begins..].iter().position(|row| (act(row, X) - 50.0).abs() <= WINDOW);
        let back = begins + back.expect("it comes back");
        prop_assert!(travel(&rig.rows[begins..back], U) < 0.03, "{}", travel(&rig.rows[begins..back], U));
    }

    /// A probing goes where the path leads, with or without contact, and leaves those where they are that went before.
    #[test]
    fn they_stay_while_the_path_probes(
        u in -120..120i32, v in -120..120i32, w in -20..20i32, to in 10..60i32, inches: bool,
        across in prop_oneof![Just(0), 1..30i32],
    ) {
        let unit = if inches { 25.4 } else { 1.0 };
        let of = |mm: i32| f64::from(mm) / unit;
        // To where X stands it is a way, too, as long as its encoder's noise.
        let x = if across == 0 { String::new() } else { format!("X{:.4}", of(across)) };
        let mut rig = at_work_with_probe(&format!(
            "{} G90 G94\nG0 U{:.4} V{:.4} W{:.4}\nG38.3 {x} Z{:.4} F{}\nG1 Z0 F{}\nG0 U0",
            if inches { "G20" } else { "G21" }, of(u), of(v), of(w), of(-to), 300.0 / unit, 3000.0 / unit,
        ));
        settle(&mut rig);
        prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        let found = rig.events.iter().find_map(|event| match event {
            Event::Probed { found, .. } => Some(found.map(|(_, by)| by)),
            _ => None,
        });
        // X captures nothing.
        let by = if across == 0 { KnownBy::Captured } else { KnownBy::Inferred };
        prop_assert_eq!(found, Some((to > 30).then_some(by)), "{:?}", rig.events);
        let depth = rig.rows.iter().map(|row| act(row, Z)).fold(0.0, f64::min);
        let expected = -f64::from(to).min(30.5);
        prop_assert!((depth - expected).abs() < 0.1, "{} for {}", depth, expected);
        let probes = rig.rows.iter().filter(|row| row.plan.off_path);
        for row in probes {
            for (axis, to) in [(U, u), (V, v), (W, w)] {
                prop_assert!((act(row, axis) - f64::from(to)).abs() <= WINDOW, "{}", act(row, axis));
            }
        }
        prop_assert!(ends(&rig, U).abs() <= WINDOW && ends(&rig, Z).abs() <= WINDOW);
    }

    /// Single block rests behind every block: of the path, of each axis that goes point to point, of a probing.
    #[test]
    fn single_block_rests_behind_each(blocks in prop::collection::vec(0..5usize, 1..6), rapid: bool) {
        let mut program = format!("G21 G90 G94 F6000 G{}", u32::from(!rapid));
        let mut axes = Vec::new();
        for (index, kind) in blocks.iter().enumerate() {
            let (axis, to) = ([X, U, V, W, Z][*kind], f64::from(index as u32 + 1));
            let (letter, to) = (["X", "U", "V", "W", "Z"][*kind], if axis == Z { -to } else { to });
            program += &match axis {
                Z => format!("\nG38.3 Z{to} F300\nF6000 G{}", u32::from(!rapid)),
                _ => format!("\n{letter}{to}"),
            };
            axes.push((axis, to));
        }
        let mut rig = at_work_with_probe("G4 P0");
        settle(&mut rig);
        go(&mut rig, Command::SingleBlock(SwitchChange::To(true)));
        go(&mut rig, Command::Mdi(program));
        let mut there = [0.0; COORDINATES];
        for (axis, to) in axes {
            there[axis] = to;
            prop_assert_eq!(state(&rig), State::Held, "{:?}", rig.events);
            for axis in [X, Z, U, V, W] {
                prop_assert!((ends(&rig, axis) - there[axis]).abs() <= WINDOW, "{}: {}", axis, ends(&rig, axis));
            }
            go(&mut rig, Command::Resume);
        }
        prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    }

    /// A stop at any time: from then on nothing moves until something is commanded.
    #[test]
    fn nothing_moves_after_a_stop(wait in 1..600u32, to in 20..250i32) {
        let mut rig = at_work(&format!("G90 G0 U{to} V-{to} W{}", to / 10));
        for _ in 0..wait {
            rig.step();
        }
        rig.command(Command::Stop);
        settle(&mut rig);
        prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        let rests = rig.rows.len();
        go(&mut rig, Command::Mdi("G4 P1".to_owned()));
        for axis in [U, V, W] {
            prop_assert!(travel(&rig.rows[rests..], axis) < 0.03);
        }
        go(&mut rig, Command::Mdi("G90 G0 U5 V5 W5".to_owned()));
        for axis in [U, V, W] {
            prop_assert!((ends(&rig, axis) - 5.0).abs() <= WINDOW);
        }
    }
}

// --- lost steps, and no encoder ---

/// W among the drives.
const W_DRIVE: usize = 6;

/// W, homed, is blocked on its way and loses steps; nobody sees it, and it goes to where the mark of its place is. How far
/// it is off then, mm.
fn loses_steps(rig: &mut Rig) -> f64 {
    settle(rig);
    go(rig, home(AxisLetter::W));
    assert_eq!(state(rig), State::Ready, "{:?}", rig.events);
    let mark = rig.twin(W_DRIVE).observe().position;
    rig.command(Command::Mdi("G90 G0 W5".to_owned()));
    rig.run_until(|rig| rig.twin(W_DRIVE).observe().position > mark + 0.05);
    rig.twin(W_DRIVE).disturb(Disturbance::Block(true));
    for _ in 0..20 {
        rig.step();
    }
    rig.twin(W_DRIVE).disturb(Disturbance::Block(false));
    settle(rig);
    assert_eq!(state(rig), State::Ready, "{:?}", rig.events);
    assert!((ends(rig, W) - 5.0).abs() <= WINDOW);
    let lost = 5.0 - 10.0 * (rig.twin(W_DRIVE).observe().position - mark);
    assert!(lost > 0.15, "{lost}");
    go(rig, Command::Mdi(format!("G90 G0 W{lost:.4}")));
    let at = rig.twin(W_DRIVE).observe().position;
    assert!((at - mark).abs() < 2e-3, "{at}, {mark}");
    lost
}

/// Where it is homed again it is told how far it was from where it believed to be; beyond `reference_limit` that is a fault, and
/// it is homed once more.
#[test]
fn lost_steps_are_told_where_it_is_homed_again() {
    let homing = "kind = \"set_here\"\n\n[homing]";
    for (limit, is_fault) in [(None, false), (Some(0.1), true), (Some(20.0), false)] {
        let key = limit.map_or(String::new(), |mm| format!("reference_limit = {mm}\n"));
        let limited = format!("kind = \"set_here\"\n{key}\n[homing]");
        let changes = [&CHANGES[..], &[(homing, &*limited)]].concat();
        let mut rig = Rig::staying_on("portal", &changes, |_, _| ());
        let lost = loses_steps(&mut rig);
        let told = |rig: &Rig| {
            let events = rig.events.iter().rev();
            let mut found = events.filter_map(|event| match event {
                Event::Referenced { moved, .. } => Some(*moved),
                _ => None,
            });
            found.next().flatten()
        };
        assert_eq!(told(&rig), None);
        go(&mut rig, home(AxisLetter::W));
        if is_fault {
            assert_eq!(state(&rig), State::Faulted, "{:?}", rig.events);
            let faults = rig.controller().faults().to_vec();
            let [Fault::Axis(_, AxisCause::ReferenceMoved { difference })] = faults[..] else {
                panic!("{faults:?}");
            };
            assert!((difference - lost).abs() < 0.01, "{difference}, {lost}");
            assert!(!rig.session.status().referenced[AxisLetter::W.index()]);
            go(&mut rig, Command::Reset);
            go(&mut rig, Command::Enable);
            go(&mut rig, home(AxisLetter::W));
            assert_eq!(told(&rig), None);
        } else {
            let moved = told(&rig).expect("it was homed before");
            assert!((moved - lost).abs() < 0.01, "{moved}, {lost}");
        }
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        // Its place is known again, and it is not told anew.
        go(&mut rig, home(AxisLetter::W));
        let moved = told(&rig).expect("it was homed before");
        assert!(moved.abs() < 0.01, "{moved}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 10, ..ProptestConfig::default() })]

    /// However short the moves, however slow, and whatever the window in which an axis stands: the program goes on once the drive
    /// has come to rest at its target, and no target is lost.
    #[test]
    fn short_moves_are_awaited(
        moves in prop::collection::vec((0.002..0.6_f64, any::<bool>(), 10.0..400.0_f64), 1..10),
        which in 0..3usize, window in prop::sample::select(vec![0.05, 0.5]), holds in prop::option::of(0..400usize),
    ) {
        let (axis, letter) = [(U, 'U'), (V, 'V'), (W, 'W')][which];
        let windows = TABLES.replace("standstill_window = 0.05", &format!("standstill_window = {window:?}"));
        let changes = [CHANGES[0], (CHANGES[1].0, &windows[..])];
        let mut program = "G21 G90 G94 G61\n".to_owned();
        let mut targets = vec![0.0];
        for (by, forth, feed) in moves {
            let last: f64 = *targets.last().unwrap();
            let target = ((last + if forth { by } else { -by }) * 1e3).round() / 1e3;
            targets.push(target);
            program += &format!("G1 {letter}{target:.3} F{feed:.0}\n");
        }
        program += "M2\n";
        let mut rig = Rig::new("portal", &changes, &program, |_, _| ());
        let truth = |rig: &mut Rig| {
            let travel = rig.machine.drives[DRIVE + which].scaling.travel_per_revolution();
            rig.twin(DRIVE + which).observe().position * travel
        };
        let begin = truth(&mut rig);
        let (mut line, mut steps) = (0, 0);
        while rig.step() {
            steps += 1;
            if holds == Some(steps / 20) && steps % 20 == 0 {
                rig.command(Command::FeedHold);
            } else if steps % 20 == 10 {
                rig.command(Command::Resume);
            }
            let now = rig.session.status().line;
            if now != line && (2..=targets.len() as u32).contains(&line) {
                let (target, at) = (targets[line as usize - 1], truth(&mut rig) - begin);
                prop_assert!((at - target).abs() < 0.02, "line {}: {} of {}: {}", line, at, target, program);
            }
            line = now;
        }
        prop_assert_eq!(rig.end(), Some(End::Finished), "{}{:?}", program, rig.events);
        let last = *targets.last().unwrap();
        prop_assert!((ends(&rig, axis) - last).abs() < 0.02, "{} of {}", ends(&rig, axis), last);
    }
}
