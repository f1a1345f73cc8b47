//! Axes that have to be homed: from switching on to a program, by each kind and through each failure.

use super::day::positions;
use super::skew::braking;
use proptest::prelude::*;
use std::ops::Range;
use syncline_controller::control::fault::AxisCause;
use syncline_controller::control::{
    Event, Fault, HomingFailure, Phase, Refusal as OrderRefusal, State,
};
use syncline_controller::session::{Command, Direction, Jog, Override, Refusal};
use syncline_drives::model::Increments;
use syncline_drives::twin::Disturbance;
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

pub(super) const ALL: Command = Command::Home([false; 9]);

/// Drives of the router.
const X1: usize = 0;
const X2: usize = 1;
pub(super) const Y: usize = 2;

pub(super) fn home(axis: AxisLetter) -> Command {
    let mut letters = [false; 9];
    letters[axis.index()] = true;
    Command::Home(letters)
}

pub(super) fn state(rig: &Rig) -> State {
    rig.session.status().state
}

/// The router, switched on and not homed.
pub(super) fn switched_on(replacements: &[(&str, &str)]) -> Rig {
    let mut rig = Rig::staying_on("router", replacements, |_, _| ());
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    rig
}

/// Goes on until the machine rests and waits for an operator, or is off.
pub(super) fn settle(rig: &mut Rig) {
    use State::{Disabled, Faulted, Held, Off, Ready};
    let mut since = 0;
    while since < 6 && rig.step() {
        let rests = matches!(state(rig), Ready | Held | Faulted | Disabled | Off);
        since = if rests { since + 1 } else { 0 };
    }
}

pub(super) fn go(rig: &mut Rig, command: Command) {
    rig.command(command);
    settle(rig);
}

/// Where a drive really is, mm: simulated drives count as the machine file says.
pub(super) fn truth(rig: &mut Rig, drive: usize) -> f64 {
    let turns = rig.twin(drive).observe().position;
    let scaling = rig.machine.drives[drive].scaling;
    scaling.to_mm(Increments::new((turns * 131_072.0).round() as i64))
}

/// How far the drives of an axis are from where the session shows it, mm.
pub(super) fn errors(rig: &mut Rig, axis: AxisLetter) -> Vec<f64> {
    // As long as the loops take to come to rest.
    for _ in 0..200 {
        rig.step();
    }
    let shown = rig.session.status().setpoint[axis.index()];
    let mut axes = rig.machine.axes.iter();
    let drives = axes.find(|it| it.letter == axis).unwrap().drives.clone();
    let errors = drives.into_iter().map(|drive| truth(rig, drive) - shown);
    errors.collect()
}

pub(super) fn is_referenced(rig: &Rig, axis: AxisLetter) -> bool {
    rig.session.status().referenced[axis.index()]
}

/// Why the last homing failed, if it did.
pub(super) fn failure(rig: &Rig) -> Option<HomingFailure> {
    let failed = |event: &Event| match event {
        Event::HomingFailed { failure, .. } => Some(*failure),
        _ => None,
    };
    rig.events.iter().rev().find_map(failed)
}

fn refusals(rig: &Rig) -> Vec<OrderRefusal> {
    let machine = |refusal: &Refusal| match refusal {
        Refusal::Machine(refusal) => *refusal,
        other => panic!("{other}"),
    };
    let refused = rig.refused.iter();
    refused.map(|refused| machine(&refused.reason)).collect()
}

/// A day that begins with a homing; what it put on the bus, by its digest.
fn day() -> String {
    let mut rig = switched_on(&[]);
    assert_eq!(
        rig.session.status().state_in_words(),
        "ready (unreferenced)"
    );
    go(&mut rig, ALL);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert_eq!(rig.session.status().state_in_words(), "ready");
    for axis in [AxisLetter::X, AxisLetter::Y, AxisLetter::Z] {
        assert!(is_referenced(&rig, axis), "{:?}", rig.events);
        assert_eq!(rig.session.status().setpoint[axis.index()], 0.0);
        for error in errors(&mut rig, axis) {
            assert!(error.abs() < 0.004, "{axis}: {error}");
        }
    }
    go(&mut rig, Command::Mdi("G0 X20 Y30 Z-5".to_owned()));
    // Again, from where it stands.
    go(&mut rig, ALL);
    go(
        &mut rig,
        Command::Mdi("G0 X20 Y30 Z-5\nG0 X0 Y0 Z0".to_owned()),
    );
    assert_eq!(rig.refused, []);
    go(&mut rig, Command::SwitchOff);
    assert_eq!(rig.problems, [""; 0]);
    assert_eq!(failure(&rig), None);
    rig.session.timeline().frames().result().0
}

#[test]
fn a_cold_start_homes_and_runs_and_is_the_same_twice() {
    assert_eq!(day(), day());
}

#[test]
fn a_run_homes_first_where_the_file_says_so() {
    let program = "G0 X20 Y30 Z-5\nG1 X40 F3000\nM2\n";
    let rig = Rig::new("router", &[], program, |_, _| ());
    let summary = rig.judge();
    assert_eq!(summary.verdict, "pass", "{:?}", summary.violations);
    let no = ("at_start = true", "at_start = false");
    let mut rig = Rig::new("router", &[no], program, |_, _| ());
    assert_eq!(
        rig.finish_with_fault(),
        Fault::Axis(0, AxisCause::Unreferenced)
    );
    let absent = ("active_low = true\nsimulated = [3.0, 40.0]", "");
    let mut rig = Rig::new("router", &[absent], program, |_, _| ());
    assert_eq!(
        rig.finish_with_fault(),
        Fault::Axis(2, AxisCause::Homing(HomingFailure::NotFound))
    );
}

#[test]
fn nothing_goes_to_machine_positions_before_there_are_any() {
    let mut rig = switched_on(&[]);
    let mut to = [None; 9];
    to[AxisLetter::Y.index()] = Some(10.0);
    go(&mut rig, Command::Mdi("G0 X1".to_owned()));
    go(&mut rig, Command::GoTo(to));
    go(&mut rig, Command::Jog(Jog::To(to)));
    let (x, y) = (AxisLetter::X.index(), AxisLetter::Y.index());
    assert_eq!(
        refusals(&rig),
        [
            OrderRefusal::Unreferenced(x),
            OrderRefusal::Unreferenced(y),
            OrderRefusal::Unreferenced(y),
        ]
    );
    // A jog goes slowly, and not far.
    let before = rig.rows.len();
    go(
        &mut rig,
        Command::Jog(Jog::Continuous {
            axis: AxisLetter::Y,
            direction: Direction::Positive,
            speed: None,
        }),
    );
    let rows = &rig.rows[before..];
    let fastest = rows.iter().map(|row| row.plan.velocity[y]);
    let fastest = fastest.fold(0.0, f64::max);
    assert!((fastest - 80.0).abs() < 1e-6 || fastest < 80.0, "{fastest}");
    let gone = rig.session.status().setpoint[y];
    assert!((gone - 10.0).abs() < 0.01, "{gone}");
    // Where the machine file allows it, programs move.
    let allow = (
        "at_start = true",
        "at_start = true\nunreferenced_jobs = true",
    );
    let mut rig = switched_on(&[allow]);
    go(&mut rig, Command::Mdi("G0 X1".to_owned()));
    assert_eq!(rig.refused, []);
}

#[test]
fn an_operator_says_where_an_axis_stands() {
    let by_hand = (
        "kind = \"switch\"\norder = 1\nswitches = [\"home Z\"]\ndirection = \"positive\"\n\
         speed = 30.0\nslow_speed = 1.0\nback_off = 3.0\nposition = 3.0\nfinal_position = 0.0",
        "kind = \"set_here\"\nposition = -40.0",
    );
    let no_switch = (
        "# It opens at the top, as a broken wire does.\n[[input]]\nname = \"home Z\"\ndrive = \"Z\"\n\
         signal = \"DI4\"\nfunction = \"home\"\nactive_low = true\nsimulated = [3.0, 40.0]",
        "",
    );
    let mut rig = switched_on(&[by_hand, no_switch, ("at_start = true", "")]);
    go(&mut rig, ALL);
    assert!(is_referenced(&rig, AxisLetter::X) && !is_referenced(&rig, AxisLetter::Z));
    go(&mut rig, home(AxisLetter::Z));
    assert!(is_referenced(&rig, AxisLetter::Z));
    assert_eq!(rig.session.status().setpoint[AxisLetter::Z.index()], -40.0);
    assert!(errors(&mut rig, AxisLetter::Z)[0].abs() < 0.002);
    go(&mut rig, home(AxisLetter::A));
    assert_eq!(
        refusals(&rig),
        [OrderRefusal::NoSuchAxis(AxisLetter::A.index())]
    );
}

/// Homes an axis, does something to a drive once it has gone so far, and goes on to rest.
fn disturbed(rig: &mut Rig, axis: AxisLetter, far: f64, deeds: &[(usize, Disturbance)]) {
    rig.command(home(axis));
    let from = rig.session.status().setpoint[axis.index()];
    for &(drive, disturbance) in deeds {
        rig.run_until(|rig| {
            let here = rig.session.status().setpoint[axis.index()];
            (here - from).abs() > far
        });
        rig.twin(drive).disturb(disturbance);
        for _ in 0..20 {
            rig.step();
        }
    }
    settle(rig);
}

const Y_SWITCH: &str =
    "drive = \"Y\"\nsignal = \"DI0\"\nfunction = \"home\"\nsimulated = [-60.0, -4.0]";

/// The switch of Y with other keys.
fn y_switch(keys: &str) -> String {
    format!("drive = \"Y\"\nsignal = \"DI0\"\nfunction = \"home\"\n{keys}")
}

#[test]
fn a_switch_that_is_not_found_stops_the_axis() {
    for keys in ["", "simulated = [850.0, 900.0]"] {
        let mut rig = switched_on(&[(Y_SWITCH, &y_switch(keys))]);
        go(&mut rig, home(AxisLetter::Y));
        assert_eq!(failure(&rig), Some(HomingFailure::NotFound), "{keys}");
        assert_eq!(state(&rig), State::Ready);
        // It went as far as it may, 1.5 times the travel, and stopped there.
        let y = rig.session.status().setpoint[AxisLetter::Y.index()];
        assert!((y + 1200.0).abs() < 0.01, "{y}");
        assert!(!is_referenced(&rig, AxisLetter::Y));
    }
}

#[test]
fn a_switch_that_stays_on_is_told() {
    // Stuck from the beginning, wired the other way round, and stuck once it came on.
    let mut rig = switched_on(&[]);
    rig.twin(Y).disturb(Disturbance::Input(0, true));
    for _ in 0..4 {
        rig.step();
    }
    go(&mut rig, home(AxisLetter::Y));
    assert_eq!(failure(&rig), Some(HomingFailure::NeverOff));
    let mut rig = switched_on(&[(Y_SWITCH, &y_switch("active_low = true"))]);
    go(&mut rig, home(AxisLetter::Y));
    assert_eq!(failure(&rig), Some(HomingFailure::NeverOff));
    let mut rig = switched_on(&[]);
    disturbed(
        &mut rig,
        AxisLetter::Y,
        60.0,
        &[(Y, Disturbance::Input(0, true))],
    );
    assert_eq!(failure(&rig), Some(HomingFailure::StaysOn));
    assert_eq!(state(&rig), State::Ready);
    // Mended, it homes.
    rig.twin(Y).disturb(Disturbance::Input(0, false));
    for _ in 0..4 {
        rig.step();
    }
    go(&mut rig, home(AxisLetter::Y));
    assert!(is_referenced(&rig, AxisLetter::Y), "{:?}", rig.events);
}

#[test]
fn a_switch_that_is_loose_is_told() {
    let mut rig = switched_on(&[]);
    let deeds = [
        (Y, Disturbance::Input(0, true)),
        (Y, Disturbance::Input(0, false)),
    ];
    disturbed(&mut rig, AxisLetter::Y, 30.0, &deeds);
    assert_eq!(failure(&rig), Some(HomingFailure::Lost));
}

#[test]
fn another_error_of_its_drive_tells_of_nothing_in_the_way() {
    let mut rig = switched_on(&[]);
    let deeds = [(Y, Disturbance::Mains(false))];
    disturbed(&mut rig, AxisLetter::Y, 30.0, &deeds);
    let fault = rig.session.faults()[0];
    assert!(matches!(fault, Fault::Device(Y, _)), "{fault:?}");
    assert_eq!((state(&rig), failure(&rig)), (State::Faulted, None));
}

#[test]
fn each_side_of_a_gantry_needs_its_switch() {
    let x2 = "drive = \"X2\"\nsignal = \"DI0\"\nfunction = \"home\"\nsimulated = [-60.0, -4.0]";
    let without = "drive = \"X2\"\nsignal = \"DI0\"\nfunction = \"home\"";
    let mut rig = switched_on(&[(x2, without)]);
    rig.command(home(AxisLetter::X));
    let mut skew = 0.0_f64;
    while failure(&rig).is_none() && rig.step() {
        skew = skew.max(apart(&mut rig).abs());
    }
    settle(&mut rig);
    assert_eq!(failure(&rig), Some(HomingFailure::OneSide { side: 1 }));
    assert!(skew < 0.5, "{skew} mm");
    // A side that is jammed stops both.
    for side in [X1, X2] {
        let mut rig = switched_on(&[]);
        disturbed(
            &mut rig,
            AxisLetter::X,
            50.0,
            &[(side, Disturbance::Block(true))],
        );
        assert_eq!(state(&rig), State::Faulted);
        assert_eq!(failure(&rig), Some(HomingFailure::SideJammed { side }));
        let fault = rig.session.faults()[0];
        assert!(matches!(fault, Fault::Axis(0, _)), "{fault:?}");
        assert!(!is_referenced(&rig, AxisLetter::X));
        let apart = apart(&mut rig);
        assert!(apart.abs() < most_skew(&rig), "{apart}");
    }
}

/// An axis, or a side of one, that something stops on its way to its switch, or off it.
#[derive(Clone, Debug)]
struct Blocked {
    axis: AxisLetter,
    /// By side; of Y the first one.
    sides: [bool; 2],
    /// It stands on its switch.
    on: bool,
    /// How far its edge is from where it stands, mm, and the part of that where it is stopped.
    distance: f64,
    part: f64,
    seed: u64,
}

fn blocked() -> impl Strategy<Value = Blocked> {
    let sides = prop::sample::select(vec![[true, false], [false, true], [true, true]]);
    let way = (any::<bool>(), 5.0..50.0_f64, 0.0..0.95_f64);
    (any::<bool>(), sides, way, 0..1000u64).prop_map(
        |(gantry, sides, (on, distance, part), seed)| Blocked {
            axis: if gantry { AxisLetter::X } else { AxisLetter::Y },
            sides: if gantry { sides } else { [true, false] },
            on,
            distance,
            part,
            seed,
        },
    )
}

impl Blocked {
    fn expected(&self) -> HomingFailure {
        match self.sides {
            [true, false] if self.axis == AxisLetter::X => HomingFailure::SideJammed { side: 0 },
            [false, true] => HomingFailure::SideJammed { side: 1 },
            _ if self.on => HomingFailure::BlockedOnSwitch,
            _ => HomingFailure::BlockedBefore,
        }
    }

    /// Homes it, and has it stopped on the way; how far the sides of X got apart meanwhile, mm.
    fn play(&self) -> (Rig, f64) {
        let start = -4.0
            + if self.on {
                -self.distance
            } else {
                self.distance
            };
        let start = format!("start = {start:?}");
        let (was, drives) = match self.axis {
            AxisLetter::X => ("start = 180.0", [X1, X2]),
            _ => ("start = 95.0", [Y, Y]),
        };
        let seed = self.seed;
        let mut rig = Rig::staying_on("router", &[(was, &start)], |drive, config| {
            config.seed = seed + drive as u64;
        });
        settle(&mut rig);
        let from = rig.session.status().setpoint[self.axis.index()];
        rig.command(home(self.axis));
        rig.run_until(|rig| {
            let here = rig.session.status().setpoint[self.axis.index()];
            (here - from).abs() > self.part * self.distance
        });
        for (drive, _) in drives.iter().zip(self.sides).filter(|(_, stops)| *stops) {
            rig.twin(*drive).disturb(Disturbance::Block(true));
        }
        let mut skew = 0.0_f64;
        while state(&rig) == State::Homing && rig.step() {
            skew = skew.max(apart(&mut rig).abs());
        }
        settle(&mut rig);
        skew = skew.max(apart(&mut rig).abs());
        (rig, skew)
    }
}

/// How far the sides of X may get apart on their way to their switches, whatever holds one of them: what docs/supervision.md
/// states, at the search's 80 mm/s, and what a loop overshoots as it stops.
fn most_skew(rig: &Rig) -> f64 {
    let limits = &rig.machine.axes[0].limits;
    let cycle = rig.machine.cycle.as_secs_f64();
    limits.skew.unwrap() + 4.0 * cycle * 80.0 + 3200.0 / braking(rig) + 0.1
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

    /// What stops an axis while it searches is told by what it may be, and as the fault that it is.
    #[test]
    fn what_stops_a_search_is_told(case in blocked()) {
        let (mut rig, skew) = case.play();
        prop_assert_eq!(state(&rig), State::Faulted, "{:?}", rig.events);
        prop_assert_eq!(failure(&rig), Some(case.expected()));
        prop_assert!(skew < most_skew(&rig), "{} mm", skew);
        let fault = rig.session.faults()[0];
        prop_assert!(matches!(fault, Fault::Axis(..)), "{:?}", fault);
        prop_assert!(!is_referenced(&rig, case.axis));
        // Freed and reset, it homes.
        for drive in [X1, X2, Y] {
            rig.twin(drive).disturb(Disturbance::Block(false));
        }
        go(&mut rig, Command::Reset);
        go(&mut rig, home(case.axis));
        prop_assert!(is_referenced(&rig, case.axis), "{:?}", rig.events);
    }
}

#[test]
fn what_stops_an_axis_behind_its_search_is_the_fault_alone() {
    let mut rig = switched_on(&[]);
    rig.command(home(AxisLetter::Y));
    // It has found its switch, and goes back.
    let mut least = f64::INFINITY;
    rig.run_until(|rig| {
        let here = rig.session.status().setpoint[AxisLetter::Y.index()];
        least = least.min(here);
        here > least + 0.5
    });
    rig.twin(Y).disturb(Disturbance::Block(true));
    settle(&mut rig);
    assert_eq!(state(&rig), State::Faulted);
    assert_eq!(failure(&rig), None);
    // A side that is jammed in a line that is typed in has nothing to do with the homing before.
    let mut rig = switched_on(&[]);
    go(&mut rig, ALL);
    rig.command(Command::Mdi("G1 X100 F6000".to_owned()));
    rig.run_until(|rig| rig.session.status().setpoint[AxisLetter::X.index()] > 50.0);
    rig.twin(X1).disturb(Disturbance::Block(true));
    settle(&mut rig);
    assert_eq!(state(&rig), State::Faulted);
    assert_eq!(failure(&rig), None);
}

#[test]
fn time_and_speed_end_a_homing() {
    let short = ("back_off = 3.0", "back_off = 3.0\nmax_time_ms = 500");
    let mut rig = switched_on(&[short]);
    go(&mut rig, home(AxisLetter::Z));
    assert_eq!(failure(&rig), Some(HomingFailure::TooLong));
    go(&mut rig, Command::RapidOverride(Override::To(0.0)));
    go(&mut rig, home(AxisLetter::Z));
    assert_eq!(failure(&rig), Some(HomingFailure::NoSpeed));
    assert_eq!(state(&rig), State::Ready);
}

#[test]
fn a_stop_leaves_the_axis_unreferenced() {
    let mut rig = switched_on(&[]);
    rig.command(ALL);
    rig.run_until(|rig| is_referenced(rig, AxisLetter::Z) && state(rig) == State::Homing);
    for _ in 0..900 {
        rig.step();
    }
    go(&mut rig, Command::Stop);
    assert_eq!(state(&rig), State::Ready);
    assert!(is_referenced(&rig, AxisLetter::Z));
    assert!(!is_referenced(&rig, AxisLetter::X) && !is_referenced(&rig, AxisLetter::Y));
    go(&mut rig, ALL);
    assert!(is_referenced(&rig, AxisLetter::X));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

    /// Cut off at any instant, also where the axes are homed once more, beyond their soft limits too: that is no fault,
    /// and the axes are moved and homed as before.
    #[test]
    fn a_homing_that_is_cut_off_is_no_fault(
        wake_ups in 0..6000usize, once_more: bool, disables: bool, back: bool,
    ) {
        let mut rig = switched_on(&[]);
        if once_more {
            go(&mut rig, ALL);
        }
        rig.command(ALL);
        for _ in 0..wake_ups {
            rig.step();
        }
        prop_assume!(state(&rig) == State::Homing);
        go(&mut rig, if disables { Command::Disable } else { Command::Stop });
        if disables {
            prop_assert_eq!(state(&rig), State::Disabled);
            go(&mut rig, Command::Enable);
        }
        let distance = if back { -1.0 } else { 1.0 };
        for axis in [AxisLetter::X, AxisLetter::Y, AxisLetter::Z] {
            if !is_referenced(&rig, axis) {
                go(&mut rig, Command::Jog(Jog::By { axis, distance, speed: None }));
            }
        }
        prop_assert_eq!(rig.session.faults(), []);
        go(&mut rig, ALL);
        for axis in [AxisLetter::X, AxisLetter::Y, AxisLetter::Z] {
            prop_assert!(is_referenced(&rig, axis), "{:?}", rig.events);
            let errors = errors(&mut rig, axis);
            prop_assert!(errors.iter().all(|error| error.abs() < 0.01), "{:?}", errors);
        }
        prop_assert_eq!(violations(rig), [""; 0]);
    }
}

/// What the judge finds of a machine that is switched off now.
fn violations(mut rig: Rig) -> Vec<String> {
    go(&mut rig, Command::SwitchOff);
    let violations = rig.judge().violations;
    violations.into_iter().map(|it| it.what).collect()
}

#[test]
fn one_switch_of_two_axes_says_nothing_while_it_is_on() {
    let shared = [
        (
            Y_SWITCH,
            "drive = \"Y\"\nsignal = \"DI0\"\nnumber = 1\nsimulated = [-60.0, -4.0]",
        ),
        ("switches = [\"home Y\"]", "switches = [\"home Z\"]"),
        ("start = -40.0", "start = 5.0"),
    ];
    let mut rig = switched_on(&shared);
    go(&mut rig, home(AxisLetter::Y));
    assert_eq!(failure(&rig), Some(HomingFailure::Shared));
    assert!(!is_referenced(&rig, AxisLetter::Y));
}

/// What a typed line neither moves nor goes by need not be referenced.
#[test]
fn a_typed_line_asks_only_of_the_axes_that_it_moves() {
    let mut rig = switched_on(&[]);
    go(&mut rig, home(AxisLetter::X));
    let mdi = |rig: &mut Rig, line: &str| go(rig, Command::Mdi(line.to_owned()));
    for line in [
        "G0 X5",
        "G91 G1 X2 F600",
        "G90",
        "G10 L20 P2 X0",
        "#1 = [#<_x> + 1]",
        "G1 X#1",
    ] {
        mdi(&mut rig, line);
        assert_eq!(refusals(&rig), [], "{line}");
        assert_eq!(state(&rig), State::Ready, "{line}: {:?}", rig.events);
    }
    let at = |axis: AxisLetter| rig.session.status().setpoint[axis.index()];
    assert!(
        (at(AxisLetter::X) - 8.0).abs() < 1e-6,
        "{}",
        at(AxisLetter::X)
    );
    let offset = positions([(AxisLetter::X, 3.0)]);
    go(&mut rig, Command::SetWorkOffset(offset));
    assert_eq!(refusals(&rig), []);
    for (count, line) in (1..).zip([
        "G0 X4 Y1",
        "G53 G0 Z0",
        "G28.1",
        "G92 Y0",
        "G10 L20 P1 Z0",
        "#1 = #5022",
        "G0 X[4 + #<_z> / 100]",
        "o1 if [#<_abs_y> LT 1000]\nM0\no1 endif\nG28",
    ]) {
        mdi(&mut rig, line);
        assert_eq!(refusals(&rig).len(), count, "{line}: {:?}", rig.events);
        let is_unreferenced =
            matches!(refusals(&rig)[count - 1], OrderRefusal::Unreferenced(1 | 2));
        assert!(is_unreferenced, "{line}: {:?}", refusals(&rig));
    }
    // Turned, a move in X is one of Y.
    mdi(&mut rig, "G10 L2 P1 R30");
    assert_eq!(refusals(&rig).len(), 8);
    mdi(&mut rig, "G0 X4");
    assert_eq!(refusals(&rig).len(), 9);
}

#[test]
fn a_drive_that_was_without_supply_is_homed_again() {
    let mut rig = switched_on(&[]);
    go(&mut rig, ALL);
    // Disabled and enabled again, and after a fault that leaves the drives their counts, it stays.
    go(&mut rig, Command::Disable);
    go(&mut rig, Command::Enable);
    assert!(is_referenced(&rig, AxisLetter::Y));
    rig.twin(Y).disturb(Disturbance::Fault(
        syncline_drives::twin::ErrorClass::StopAndSwitchOff,
    ));
    settle(&mut rig);
    go(&mut rig, Command::Reset);
    assert_eq!(rig.session.status().state_in_words(), "ready");
    assert!(errors(&mut rig, AxisLetter::Y)[0].abs() < 0.004);
    // A new start of the drive's own does not.
    go(&mut rig, Command::Disable);
    rig.twin(Y).disturb(Disturbance::Reset);
    for _ in 0..200 {
        rig.step();
    }
    assert!(!is_referenced(&rig, AxisLetter::Y), "{:?}", rig.events);
    assert!(is_referenced(&rig, AxisLetter::X));
    settle(&mut rig);
    if state(&rig) == State::Faulted {
        go(&mut rig, Command::Reset);
    } else {
        go(&mut rig, Command::Enable);
    }
    settle(&mut rig);
    if state(&rig) == State::Faulted {
        go(&mut rig, Command::Reset);
    }
    go(&mut rig, Command::Mdi("G0 Y1".to_owned()));
    assert_eq!(
        refusals(&rig),
        [OrderRefusal::Unreferenced(AxisLetter::Y.index())]
    );
    go(&mut rig, home(AxisLetter::Y));
    assert!(is_referenced(&rig, AxisLetter::Y), "{:?}", rig.events);
}

const X_SWITCHES: &str = "switches = [\"home X1\", \"home X2\"]";

/// The edges of X are taken from samples, although its drives could capture them.
const X_BY_SAMPLES: &str = "switches = [\"home X1\", \"home X2\"]\nlatch = false";

/// X of the router, whose second side stands so much further, with that speed of the approach. What ties that side to its
/// motor, if it gives way, does so `yielding` times as much as that of the first one, and rubs as much more.
fn skewed_router(
    (skew, yielding): (f64, f64),
    slow_speed: f64,
    seed: u64,
    (switches, mechanics): (&str, &str),
) -> Rig {
    let start = format!("start = 180.0\nstart_skew = {skew:?}\n{mechanics}");
    let slow = format!("slow_speed = {slow_speed:?}");
    let replacements = [
        ("start = 180.0", &start[..]),
        ("slow_speed = 2.0", &slow),
        (X_SWITCHES, switches),
    ];
    let mut rig = Rig::staying_on("router", &replacements, |drive, config| {
        config.seed = seed * 8 + drive as u64;
        if drive == X2
            && let Some(axis) = &mut config.axis
            && let Some(tie) = &mut axis.train.elasticity
        {
            tie.stiffness /= yielding;
            axis.train.guide.coulomb *= yielding;
            axis.train.guide.breakaway *= yielding;
        }
    });
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    rig
}

/// How far the second side of X really stands beyond the first, mm.
pub(super) fn apart(rig: &mut Rig) -> f64 {
    truth(rig, X2) - truth(rig, X1)
}

/// Homes X, and holds its skew beside what is planned against a limit all the time; how square it ends.
pub(super) fn squared(rig: &mut Rig, limit: f64) -> f64 {
    let begin = apart(rig);
    let x = AxisLetter::X.index();
    rig.command(home(AxisLetter::X));
    for _ in 0..4 {
        rig.step();
    }
    while state(rig) == State::Homing {
        rig.step();
        let row = rig.session.timeline().row();
        let Some(planned) = row.map(|row| row.axes[x].apart) else {
            continue;
        };
        // Before they are referenced the sides are to stay as far apart as they were.
        let planned = match is_referenced(rig, AxisLetter::X) {
            true => planned,
            false => begin,
        };
        let skew = apart(rig) - planned;
        assert!(
            skew.abs() < limit,
            "{skew} with {planned} {:?}",
            rig.events.last()
        );
    }
    assert!(is_referenced(rig, AxisLetter::X), "{:?}", failure(rig));
    // Their loops have the sides move by what their encoders' noise is.
    let (mut sum, samples) = (0.0, 1000);
    for _ in 0..samples {
        rig.step();
        sum += apart(rig);
    }
    sum / f64::from(samples)
}

/// An increment of the router's X, mm: 20 mm a turn.
pub(super) const INCREMENT: f64 = 20.0 / 131_072.0;

/// What the sides of X move, as the seed has it: each by itself and stiff; each by a screw that gives way, against friction;
/// a beam, against its guides.
fn mechanics(seed: u64) -> String {
    let part = |of: u64| (seed / 3 % of) as f64 / of as f64;
    match seed % 3 {
        0 => String::new(),
        1 => {
            let (stiffness, friction) = screw(seed);
            format!("transmission = \"screw\"\nstiffness = {stiffness:?}\nfriction = {friction:?}")
        }
        _ => {
            let (stiffness, friction) = (1e5 * (1.0 + 3.0 * part(4)), 5.0 + 30.0 * part(5));
            format!(
                "mechanics = \"rigid_beam\"\nmass = 60.0\ninertia = 12.0\nspan = 1500.0\n\
                 racking_stiffness = {stiffness:?}\nracking_damping = 300.0\nfriction = {friction:?}"
            )
        }
    }
}

/// Stiffness of a screw that gives way, N/µm, and friction behind it, N.
fn screw(seed: u64) -> (f64, f64) {
    let part = |of: u64| (seed / 3 % of) as f64 / of as f64;
    (20.0 + 80.0 * part(4), 20.0 * part(5))
}

/// So many times as much as the first one's the second side's screw gives way, and has friction.
fn yielding(seed: u64) -> f64 {
    1.5 + (seed % 4) as f64
}

/// How far friction may have the sides rest from where their loops want them, mm.
fn held_by_friction(seed: u64) -> f64 {
    if seed.is_multiple_of(3) { 0.0 } else { 0.001 }
}

/// How much further the load of the second side is behind its motor than that of the first as each comes to its switch, mm: friction winds
/// up a screw that gives way, and the second has as much more of it as it gives way more.
fn wound(seed: u64) -> f64 {
    let (stiffness, friction) = screw(seed);
    match seed % 3 {
        1 => friction / stiffness * (yielding(seed).powi(2) - 1.0) * 1e-3,
        _ => 0.0,
    }
}

/// Takes X square from 3 mm, either way, over speeds of the approach, noise and mechanics: `judge` is told the speed,
/// what is left, what was told to be taken out and how sure that was, and what it really was, mm. Skew beside what is
/// planned stays below `skew`.
fn square(
    seeds: Range<u64>,
    (switches, skew): (&str, f64),
    judge: impl Fn(u64, f64, f64, (f64, f64), f64),
) {
    let mut worst = [0.0_f64; 3];
    for seed in seeds {
        let which = (seed / 3 % 3) as usize;
        let slow_speed = [0.5, 2.0, 8.0][which];
        let out = if seed % 2 == 0 { 3.0 } else { -3.0 };
        let mechanics = mechanics(seed);
        let mut rig = skewed_router(
            (out, yielding(seed)),
            slow_speed,
            seed,
            (switches, &mechanics),
        );
        let begin = apart(&mut rig);
        let left = squared(&mut rig, skew);
        judge(seed, slow_speed, left, told(&rig), begin);
        worst[which] = worst[which].max(left.abs());
    }
    println!("left at 0.5, 2 and 8 mm/s, mm: {worst:.5?}");
}

fn square_by_captured_edges(seeds: Range<u64>) {
    let judge = |seed, slow_speed, left: f64, (told, uncertainty), begin| {
        // The sides stand as exactly as their loops hold them.
        let off: f64 = told - begin;
        let wound = wound(seed);
        assert!(
            off.abs() < 5.0 * INCREMENT + wound,
            "{seed}: {told} of {begin}"
        );
        let sure = 2.0 * INCREMENT + slow_speed * 11e-6;
        assert!(uncertainty < sure, "{seed}: {uncertainty}");
        let most = 2.0 * INCREMENT + held_by_friction(seed) + wound;
        assert!(left.abs() < most, "{seed}: {left}");
    };
    square(seeds, (X_SWITCHES, 0.5), judge);
}

fn square_by_samples(seeds: Range<u64>) {
    let judge = |seed, slow_speed, left: f64, (told, _), begin| {
        // Either edge is off by half of what the axis moves in a cycle, and by an increment.
        let most = slow_speed * 0.002 + 0.001 + held_by_friction(seed) + wound(seed);
        assert!(left.abs() < most, "{seed}: {left}");
        let off: f64 = told - begin;
        let most = slow_speed * 0.002 + 0.002 + wound(seed);
        assert!(off.abs() < most, "{seed}: {off}");
    };
    square(seeds, (X_BY_SAMPLES, 0.5), judge);
}

/// Nine seeds are every mechanics with every speed.
#[test]
fn a_gantry_is_taken_square_by_captured_edges_at_any_speed() {
    square_by_captured_edges(0..9);
}

#[test]
fn a_gantry_is_taken_square_by_its_switches() {
    square_by_samples(0..9);
}

/// What docs/measured.md has of it.
#[test]
#[ignore = "takes a minute"]
fn thirty_gantries_are_taken_square_in_both_ways() {
    square_by_captured_edges(0..30);
    square_by_samples(0..30);
}

/// Contact while the sides of a gantry go where they belong has them rest.
#[test]
fn contact_interrupts_squaring() {
    let probe = "[[input]]\nname = \"probe\"\ndrive = \"X1\"\nsignal = \"DI1\"\nfunction = \"probe\"\n\n[[input]]\nname = \"home Y\"";
    let replacements = [
        ("start = 180.0", "start = 180.0\nstart_skew = 3.0"),
        ("[[input]]\nname = \"home Y\"", probe),
    ];
    let mut rig = switched_on(&replacements);
    let x = AxisLetter::X.index();
    rig.command(home(AxisLetter::X));
    let planned = |rig: &mut Rig| rig.session.timeline().row().map(|row| row.axes[x].apart);
    rig.run_until(|rig| {
        let apart = planned(rig);
        is_referenced(rig, AxisLetter::X)
            && apart.is_some_and(|apart| (0.5..2.0).contains(&apart.abs()))
    });
    rig.twin(X1).disturb(Disturbance::Input(1, true));
    // They come to rest on the plan that takes the squareness out.
    while state(&rig) == State::Homing && rig.step() {
        let Some(planned) = planned(&mut rig) else {
            continue;
        };
        let skew = apart(&mut rig) - planned;
        assert!(skew.abs() < 0.5, "{skew} beside {planned}");
    }
    settle(&mut rig);
    assert!(rig.events.contains(&Event::Touched), "{:?}", rig.events);
    assert_eq!(state(&rig), State::Ready);
    let left = apart(&mut rig);
    assert!(left.abs() > 0.3, "{left}");
    // It is left off, and done again when asked.
    rig.twin(X1).disturb(Disturbance::Input(1, false));
    assert!(squared(&mut rig, 0.5).abs() < 2.0 * INCREMENT);
}

/// What the last homing told: by how much the gantry was out of square, and by how much the place may be off, mm.
fn told(rig: &Rig) -> (f64, f64) {
    let told = rig.events.iter().rev().find_map(|event| match event {
        Event::Referenced {
            apart, uncertainty, ..
        } => Some((*apart, uncertainty.unwrap_or_default())),
        _ => None,
    });
    told.unwrap()
}

#[test]
fn the_squareness_of_the_switches_is_kept() {
    let skewed = (
        "name = \"home X2\"\ndrive = \"X2\"\nsignal = \"DI0\"\nfunction = \"home\"\nsimulated = \
         [-60.0, -4.0]",
        "name = \"home X2\"\ndrive = \"X2\"\nsignal = \"DI0\"\nfunction = \"home\"\nsimulated = \
         [-60.0, -3.2]",
    );
    let known = (
        "final_position = 0.0",
        "final_position = 0.0\nsquareness = 0.8",
    );
    let mut rig = switched_on(&[skewed, known]);
    let left = squared(&mut rig, 0.1);
    assert!(left.abs() < 0.006, "{left}");
    let shown =
        |rig: &Rig| rig.session.status().squareness[AxisLetter::X.index()].expect("a gantry");
    assert_eq!(shown(&rig).stored, 0.8);
    assert!(shown(&rig).measured.is_some_and(|it| it.abs() < 0.006));
    // What was measured goes with the reference.
    rig.twin(X2).disturb(Disturbance::Reset);
    settle(&mut rig);
    assert!(!is_referenced(&rig, AxisLetter::X), "{:?}", rig.events);
    assert_eq!(shown(&rig).measured, None);
}

#[test]
fn a_run_takes_a_gantry_square_and_passes() {
    let start = ("start = 180.0", "start = 180.0\nstart_skew = -2.5");
    let rig = Rig::new("router", &[start], "G0 X20\nG1 X40 F3000\nM2\n", |_, _| ());
    let summary = rig.judge();
    assert_eq!(summary.verdict, "pass", "{:?}", summary.violations);
}

/// The portal, whose encoders are absolute, may be taken square.
const MAY_BE_SQUARED: (&str, &str) = (
    "drive_soft_limits = true\n",
    "drive_soft_limits = true\nhoming = { kind = \"encoder\", max_skew = 6.0 }\n",
);

#[test]
fn a_gantry_that_stands_askew_is_taken_square_when_asked() {
    for skew in [3.0, -3.0] {
        let mut rig = Rig::staying_on("portal", &[MAY_BE_SQUARED], |drive, config| {
            config.seed = drive as u64 + 1;
            if drive == X2 {
                // 20 mm a turn, mirrored.
                config.position -= (skew + 300.0) / 20.0;
            } else if drive == X1 {
                config.position += 300.0 / 20.0;
            }
        });
        settle(&mut rig);
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        assert_eq!(
            rig.session.status().state_in_words(),
            "ready (unreferenced)"
        );
        go(&mut rig, Command::Mdi("G0 X1".to_owned()));
        let (axis, direction) = (AxisLetter::X, Direction::Positive);
        go(&mut rig, Command::Jog(Jog::Step { axis, direction }));
        let x = axis.index();
        assert_eq!(refusals(&rig), [OrderRefusal::Askew(x); 2]);
        assert!((apart(&mut rig) - skew).abs() < 0.01);
        // Broken off, it may be taken up again.
        rig.command(ALL);
        for _ in 0..100 {
            rig.step();
        }
        go(&mut rig, Command::Stop);
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        let left = apart(&mut rig);
        assert!(left * skew > 0.0 && left.abs() < skew.abs(), "{left}");
        go(&mut rig, home(AxisLetter::X));
        for _ in 0..200 {
            rig.step();
        }
        let left = apart(&mut rig);
        assert!(left.abs() < 0.002, "{left}");
        assert_eq!(rig.session.status().state_in_words(), "ready");
        go(&mut rig, Command::Mdi("G0 X310".to_owned()));
        assert_eq!(rig.refused.len(), 2);
        assert!((rig.session.status().actual[x] - 310.0).abs() < 0.01);
    }
}

#[test]
fn after_a_fault_of_one_side_there_is_a_way_on() {
    let mut rig = Rig::staying_on("portal", &[MAY_BE_SQUARED], |_, _| ());
    settle(&mut rig);
    rig.command(Command::Mdi("G1 X400 F9000".to_owned()));
    rig.run_until(|rig| rig.session.status().setpoint[0] > 100.0);
    rig.twin(X2).disturb(Disturbance::Fault(
        syncline_drives::twin::ErrorClass::StopAndSwitchOff,
    ));
    settle(&mut rig);
    assert_eq!(state(&rig), State::Faulted);
    let skew = apart(&mut rig);
    assert!((0.5..6.0).contains(&skew.abs()), "{skew}");
    go(&mut rig, Command::Reset);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.session.faults());
    go(&mut rig, ALL);
    assert_eq!(rig.session.status().state_in_words(), "ready");
    go(&mut rig, Command::Mdi("G0 X0".to_owned()));
    assert_eq!(rig.refused, []);
    let left = apart(&mut rig);
    assert!(left.abs() < 0.01, "{left}");
}

/// One homing of Z by a switch.
#[derive(Clone, Debug)]
struct Case {
    positive: bool,
    active_low: bool,
    /// The drive captures the edge; otherwise it sees the switch and does not, or it is wired elsewhere.
    latch: Option<bool>,
    /// Where the axis stands.
    start: f64,
    /// Machine position of the edge that is searched, and how wide the switch is behind it, mm.
    edge: f64,
    width: f64,
    speed: f64,
    slow_speed: f64,
    back_off: f64,
    max_distance: f64,
    seed: u64,
}

fn case() -> impl Strategy<Value = Case> {
    let speeds = (8.0..200.0, 0.05..1.0, 0.5..12.0, 5.0..400.0);
    let places = (-180.0..0.0, -220.0..40.0, 0.05..80.0);
    let wiring = (any::<[bool; 2]>(), any::<Option<bool>>());
    (wiring, places, speeds, 0..1000u64).prop_map(
        |(
            ([positive, active_low], latch),
            (start, edge, width),
            (speed, slow, back_off, max),
            seed,
        )| Case {
            positive,
            active_low,
            latch,
            start,
            edge,
            width,
            speed,
            slow_speed: f64::min(slow * 8.0, speed),
            back_off,
            max_distance: max,
            seed,
        },
    )
}

impl Case {
    fn direction(&self) -> f64 {
        if self.positive { 1.0 } else { -1.0 }
    }

    /// The switch, least position first.
    fn switch(&self) -> (f64, f64) {
        let far = self.edge + self.direction() * self.width;
        (self.edge.min(far), self.edge.max(far))
    }

    fn rig(&self) -> Rig {
        let (from, to) = self.switch();
        let text = |key: &str, value: &dyn std::fmt::Debug| format!("{key} = {value:?}");
        let direction = if self.positive {
            "positive"
        } else {
            "negative"
        };
        let seed = self.seed;
        let (signal, latch) = match self.latch {
            Some(true) => ("DI1", ""),
            Some(false) => ("DI0", "latch = false"),
            None => ("DI4", ""),
        };
        let replacements = [
            ("active_low = true", text("active_low", &self.active_low)),
            ("signal = \"DI4\"", text("signal", &signal)),
            (
                "switches = [\"home Z\"]",
                format!("switches = [\"home Z\"]\n{latch}"),
            ),
            ("simulated = [3.0, 40.0]", text("simulated", &[from, to])),
            ("direction = \"positive\"", text("direction", &direction)),
            ("speed = 30.0", text("speed", &self.speed)),
            ("slow_speed = 1.0", text("slow_speed", &self.slow_speed)),
            (
                "back_off = 3.0",
                format!(
                    "back_off = {:?}\nmax_distance = {:?}",
                    self.back_off, self.max_distance
                ),
            ),
            (
                "position = 3.0\nfinal_position = 0.0",
                text("position", &self.edge),
            ),
            ("start = -40.0", text("start", &self.start)),
        ];
        let replacements: Vec<_> = replacements
            .iter()
            .map(|(old, new)| (*old, new.as_str()))
            .collect();
        let mut rig = Rig::staying_on("router", &replacements, |drive, config| {
            config.seed = seed + drive as u64;
        });
        settle(&mut rig);
        rig
    }

    /// How far the edge is ahead; negative behind.
    fn ahead(&self) -> f64 {
        (self.edge - self.start) * self.direction()
    }

    /// Whether a homing has to find the edge.
    fn must_succeed(&self) -> bool {
        let margin = 0.5 + self.speed * 0.01;
        // Seen at speed for two samples at least, and at slow speed.
        let seen = self.width > 0.01 * self.speed + 0.01;
        let reached = self.ahead() > margin && self.ahead() + margin < self.max_distance;
        let left = self.ahead() < -margin
            && -self.ahead() < self.width - margin
            // Off the switch, and as far beyond as it takes to stop and to back off.
            && -self.ahead() + self.back_off + margin < self.max_distance;
        let backs_off = self.max_distance > self.back_off + margin - self.ahead().min(0.0);
        seen && backs_off && (reached || left)
    }

    /// Whether no homing can find the edge.
    fn must_fail(&self) -> bool {
        let beyond = self.ahead() < -self.width - 0.5;
        beyond || self.ahead() > self.max_distance + 0.5
    }
}

/// Runs a case, and holds it against what must be.
fn judge(case: &Case) -> Result<(), TestCaseError> {
    let mut rig = case.rig();
    prop_assert_eq!(state(&rig), State::Ready);
    let z = AxisLetter::Z.index();
    let from = rig.session.status().setpoint[z];
    let began = rig.rows.len();
    go(&mut rig, home(AxisLetter::Z));
    prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    let known = is_referenced(&rig, AxisLetter::Z);
    prop_assert!(known != failure(&rig).is_some());
    prop_assert!(known || !case.must_succeed(), "{:?}", failure(&rig));
    prop_assert!(!known || !case.must_fail());
    // No search leaves its distance: until it is referenced positions count from where it began.
    let told = rig.events.iter().find_map(|event| match event {
        Event::Referenced { uncertainty, .. } => *uncertainty,
        _ => None,
    });
    let farthest = rig.rows[began..]
        .iter()
        .map(|row| row.plan.position[z] - from);
    if told.is_none() {
        let farthest = farthest.map(f64::abs).fold(0.0, f64::max);
        prop_assert!(farthest < case.max_distance + 1e-6, "{}", farthest);
        if case.ahead() > case.max_distance + 0.5 || case.ahead() < -case.width - 0.5 {
            prop_assert_eq!(failure(&rig), Some(HomingFailure::NotFound));
        }
    }
    if let Some(uncertainty) = told {
        let most = match case.latch {
            Some(true) => case.slow_speed * 11e-6 + 0.0002,
            _ => case.slow_speed * 0.002 * 0.6 + 0.001,
        };
        prop_assert!(uncertainty <= most, "{} > {}", uncertainty, most);
        let error = errors(&mut rig, AxisLetter::Z)[0];
        prop_assert!(
            error.abs() < uncertainty + 0.0015,
            "{} > {}",
            error,
            uncertainty
        );
        let (least, most) = rig.machine.axes[2].limits.position;
        let shown = rig.session.status().setpoint[z];
        prop_assert!((least..=most).contains(&shown), "{}", shown);
        // Once more from there: referenced as it is, it goes as far beyond its soft limits.
        go(&mut rig, home(AxisLetter::Z));
        prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    }
    prop_assert!(rig.ends_at_rest());
    prop_assert_eq!(violations(rig), [""; 0]);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

    /// Wherever the axis stands and whatever the switch is like: it ends referenced, with its position
    /// within the stated error of the truth, or at rest inside its distance with the reason.
    #[test]
    fn every_homing_ends_referenced_or_with_its_reason(case in case()) {
        judge(&case)?;
    }
}

#[test]
fn phases_of_a_homing_are_those_of_a_machine_that_is_ready() {
    let mut rig = switched_on(&[]);
    go(&mut rig, ALL);
    assert!(!rig.phases.iter().any(|(phase, _)| *phase == Phase::Stop));
}
