//! Gantries whose sides stand apart as they are enabled, by less than `skew_limit`: they are taken square before the machine
//! is ready, and nothing else moves them.

use super::homing::{ALL, apart, go, home, is_referenced, settle, state};
use proptest::prelude::*;
use syncline_canopen::Instant;
use syncline_controller::control::fault::AxisCause;
use syncline_controller::control::{End, Event, Fault, HomingFailure, Phase, State};
use syncline_controller::session::Command;
use syncline_drives::twin::{Config, Disturbance, ErrorClass};
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

/// Drives of the portal and of the router.
const X1: usize = 0;
const X2: usize = 1;
const Y: usize = 2;
const Z: usize = 3;

/// mm of the portal's X
const INCREMENT: f64 = 20.0 / 131_072.0;
/// So far sides stand apart that are sent to be square, mm: friction holds a loop beside its setpoint.
const SQUARE: f64 = 0.003;
/// And so far apart are their setpoints, by the noise of both encoders as they were enabled, and rounding.
const SENT_SQUARE: f64 = 3.0 * INCREMENT;
/// `square_speed` of the portal where it is not said, mm/s, and its acceleration and jerk.
const LIMITS: [f64; 3] = [7.0, 300.0, 6000.0];

/// A portal that stands in the midst of its travel, its second side further by that.
fn skewed(skew: f64) -> impl Fn(usize, &mut Config) {
    move |drive, config| match drive {
        // 20 mm a turn; the second one is mirrored.
        X1 => config.position += 300.0 / 20.0,
        X2 => config.position -= (300.0 + skew) / 20.0,
        _ => {}
    }
}

/// Signals at Z of the portal.
const WIRED: &str = r#"
[[input]]
name = "enable"
drive = "Z"
signal = "DI0"
function = "enable"

[[input]]
name = "door"
drive = "Z"
signal = "DI1"
function = "door"

[[input]]
name = "hold"
drive = "Z"
signal = "DI2"
function = "feed_hold"

[machine]
"#;
const ENABLE: u8 = 0;
const DOOR: u8 = 1;
const HOLD: u8 = 2;

fn set(rig: &mut Rig, input: u8, on: bool) {
    rig.twin(Z).disturb(Disturbance::Input(input, on));
}

fn switched_on(skew: f64) -> Rig {
    let mut rig = Rig::staying_on("portal", &[("[machine]\n", WIRED)], skewed(skew));
    set(&mut rig, ENABLE, true);
    rig
}

/// What was told of gantries that are out of square: how far, and whether they stay so.
fn told(rig: &Rig) -> Vec<(f64, bool)> {
    let told = rig.events.iter().filter_map(|event| match event {
        Event::OutOfSquare {
            axis: 0,
            apart,
            stays,
        } => Some((*apart, *stays)),
        _ => None,
    });
    told.collect()
}

/// How far its sides really are apart once its loops have come to rest, too.
fn apart_at_rest(rig: &mut Rig) -> f64 {
    for _ in 0..200 {
        rig.step();
    }
    apart(rig)
}

/// The setpoints of the sides since their mode runs, mm from where those stood, the second side's with its own sign.
fn setpoints(rig: &Rig, from: Instant) -> Vec<[f64; 2]> {
    let of = |drive, sign: f64| {
        let commands = rig.commands(drive).into_iter();
        let of_mode = commands.filter(move |it| it.1 == 0x1F && it.0 >= from);
        let mm: Vec<f64> = of_mode
            .map(|it| sign * f64::from(it.2) * INCREMENT)
            .collect();
        let first = mm.first().copied().unwrap_or_default();
        mm.into_iter().map(move |it| it - first)
    };
    of(X1, 1.0)
        .zip(of(X2, -1.0))
        .map(|(one, other)| [one, other])
        .collect()
}

/// Its sides went against each other about the middle, without a jump and no faster than `limits` allow.
fn assert_gentle(setpoints: &[[f64; 2]], limits: [f64; 3]) {
    let period = 0.002;
    for [one, other] in setpoints {
        assert!((one + other).abs() < 1.5 * INCREMENT, "{one} {other}");
    }
    let mut rates: Vec<f64> = setpoints.iter().map(|it| it[1] - it[0]).collect();
    let mut rounding = 2.0 * INCREMENT;
    for limit in limits {
        rates = rates
            .windows(2)
            .map(|pair| (pair[1] - pair[0]) / period)
            .collect();
        rounding *= 2.0 / period;
        let most = rates
            .iter()
            .fold(0.0_f64, |most, rate| most.max(rate.abs()));
        assert!(most <= 1.001 * limit + rounding, "{most} of {limit}");
    }
}

/// What happens while it is taken square, so many cycles from its beginning.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Interruption {
    Stop,
    Disable,
    Door,
    Hold,
    EnableLost,
    /// Of a drive that has no part in it, and of one that has.
    DriveFault(usize),
    SwitchOff,
}

fn interruption() -> impl Strategy<Value = Interruption> {
    use Interruption::{Disable, Door, DriveFault, EnableLost, Hold, Stop, SwitchOff};
    prop_oneof![
        Just(Stop),
        Just(Disable),
        Just(Door),
        Just(Hold),
        Just(EnableLost),
        prop_oneof![Just(Y), Just(X2)].prop_map(DriveFault),
        Just(SwitchOff),
    ]
}

fn interrupt(rig: &mut Rig, by: Interruption) {
    match by {
        Interruption::Stop => rig.command(Command::Stop),
        Interruption::Disable => rig.command(Command::Disable),
        Interruption::SwitchOff => rig.command(Command::SwitchOff),
        Interruption::Door => set(rig, DOOR, true),
        Interruption::Hold => set(rig, HOLD, true),
        Interruption::EnableLost => set(rig, ENABLE, false),
        Interruption::DriveFault(drive) => {
            let fault = Disturbance::Fault(ErrorClass::StopAndSwitchOff);
            rig.twin(drive).disturb(fault);
        }
    }
}

/// Enables the drives of a machine that was stopped so; it is square then.
fn bring_back(rig: &mut Rig, by: Interruption) {
    for input in [DOOR, HOLD] {
        set(rig, input, false);
    }
    set(rig, ENABLE, true);
    if state(rig) == State::Faulted {
        go(rig, Command::Reset);
    }
    if state(rig) == State::Ready {
        go(rig, Command::Disable);
    }
    assert_eq!(state(rig), State::Disabled, "{by:?} {:?}", rig.events);
    go(rig, Command::Enable);
    assert_eq!(state(rig), State::Ready, "{by:?} {:?}", rig.events);
    let left = apart_at_rest(rig);
    assert!(left.abs() < SQUARE, "{by:?}: {left}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// As the machine is switched on its sides go where they belong, within limits of their own, and it is ready then. What
    /// comes between has them rest where they are, or be quick-stopped; the next enabling goes on with it.
    #[test]
    fn a_gantry_is_square_when_the_machine_is_ready(
        skew in prop_oneof![0.0005..0.49_f64, -0.49..-0.0005_f64],
        interrupted in prop::option::of((interruption(), 0_usize..120)),
    ) {
        let mut rig = switched_on(skew);
        rig.run_until(|rig| matches!(rig.phases.last(), Some((Phase::Square | Phase::Program, _))));
        let (phase, began) = *rig.phases.last().unwrap();
        prop_assert_eq!(phase, Phase::Square);
        prop_assert_eq!(state(&rig), State::Starting);
        let [(apart_at_first, false)] = told(&rig)[..] else {
            panic!("{:?}", rig.events);
        };
        prop_assert!((apart_at_first - skew).abs() < SQUARE, "{}", apart_at_first);
        if let Some((by, cycles)) = interrupted {
            for _ in 0..2 * cycles {
                rig.step();
            }
            let was = state(&rig);
            interrupt(&mut rig, by);
            settle(&mut rig);
            let sides = setpoints(&rig, began);
            let brakes = matches!(by, Interruption::EnableLost | Interruption::DriveFault(X2));
            if !brakes {
                assert_gentle(&sides, LIMITS);
            }
            let left = apart(&mut rig);
            prop_assert!(left * skew.signum() > -0.05 && left.abs() < skew.abs() + 0.02, "{} of {}", left, skew);
            match by {
                Interruption::SwitchOff => {
                    prop_assert_eq!(state(&rig), State::Off);
                    return Ok(());
                }
                Interruption::Door | Interruption::Hold => prop_assert_eq!(state(&rig), State::Ready),
                Interruption::Stop if was == State::Ready => prop_assert_eq!(state(&rig), State::Ready),
                Interruption::Stop | Interruption::Disable => prop_assert_eq!(state(&rig), State::Disabled),
                Interruption::EnableLost | Interruption::DriveFault(_) => prop_assert_eq!(state(&rig), State::Faulted),
            }
            bring_back(&mut rig, by);
        } else {
            settle(&mut rig);
            prop_assert_eq!(state(&rig), State::Ready);
            let sides = setpoints(&rig, began);
            assert_gentle(&sides, LIMITS);
            let taken_out = sides.last().map_or(0.0, |it| it[1] - it[0]);
            prop_assert!((taken_out + apart_at_first).abs() < SENT_SQUARE, "{}", taken_out);
            let left = apart_at_rest(&mut rig);
            prop_assert!(left.abs() < SQUARE, "{}", left);
            go(&mut rig, Command::Mdi("G0 X350".to_owned()));
            prop_assert_eq!(&rig.refused[..], &[]);
            let left = apart(&mut rig);
            prop_assert!(left.abs() < 0.01, "{}", left);
        }
    }
}

/// In its midst what interrupts it has its sides rest at once, by their own limits, and count from where they rest.
#[test]
fn what_interrupts_it_comes_at_once() {
    use Interruption::{Disable, Door, DriveFault, Hold, Stop, SwitchOff};
    for by in [Stop, Disable, SwitchOff, DriveFault(Y), Door, Hold] {
        let mut rig = switched_on(0.45);
        rig.run_to(Phase::Square);
        // Later it would take as long to rest as to get square.
        for _ in 0..16 {
            rig.step();
        }
        interrupt(&mut rig, by);
        settle(&mut rig);
        let stops = rig.phases.iter().any(|(phase, _)| *phase == Phase::Stop);
        assert_eq!(stops, !matches!(by, Door | Hold), "{by:?}");
        let left = apart(&mut rig);
        assert!((0.2..0.449).contains(&left), "{by:?}: {left}");
        if !stops {
            assert_eq!(state(&rig), State::Ready);
            assert!(matches!(told(&rig)[..], [(_, false), (_, true)]), "{by:?}");
            assert_eq!(rig.rows.last().unwrap().axes[0].apart, 0.0, "{by:?}");
        }
    }
}

/// One side goes further than the soft limit to which the axis goes then: by half of what its sides are left apart.
#[test]
fn an_axis_whose_sides_stay_apart_goes_to_its_soft_limits() {
    for limit in ["0", "1500"] {
        let mut rig = switched_on(0.45);
        rig.run_to(Phase::Square);
        for _ in 0..16 {
            rig.step();
        }
        interrupt(&mut rig, Interruption::Hold);
        settle(&mut rig);
        assert!(matches!(told(&rig)[..], [(_, false), (_, true)]));
        set(&mut rig, HOLD, false);
        let _ = apart_at_rest(&mut rig);
        go(&mut rig, Command::Mdi(format!("G0 X{limit}")));
        assert_eq!(rig.refused, []);
        rig.command(Command::SwitchOff);
        let summary = rig.judge();
        assert_eq!(summary.violations, [], "X {limit}");
    }
}

#[test]
fn a_run_takes_a_gantry_square_before_it_begins() {
    let program = "G4 P0.05\nG0 X100\nM2\n";
    let mut rig = Rig::new("portal", &[], program, skewed(0.3));
    rig.run_to(Phase::Program);
    let left = apart(&mut rig);
    assert!(left.abs() < SQUARE, "{left}");
    assert_eq!(told(&rig).len(), 1);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    rig.trace().assert_within_limits();
    let summary = Rig::new("portal", &[], program, skewed(-0.3)).judge();
    assert_eq!(summary.verdict, "pass", "{:?}", summary.violations);
}

#[test]
fn a_gantry_that_stands_square_is_left_alone() {
    let mut rig = switched_on(0.0);
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready);
    assert_eq!(told(&rig), []);
    assert!(rig.phases.iter().all(|(phase, _)| *phase != Phase::Square));
}

/// With an open door nothing moves, nor as it is closed.
#[test]
fn an_open_door_leaves_a_gantry_as_it_is() {
    let mut rig = switched_on(0.3);
    set(&mut rig, DOOR, true);
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    let [(apart_at_first, true)] = told(&rig)[..] else {
        panic!("{:?}", rig.events);
    };
    assert!((apart_at_first - 0.3).abs() < SQUARE);
    set(&mut rig, DOOR, false);
    for _ in 0..400 {
        rig.step();
    }
    let sides = setpoints(&rig, Instant::ZERO);
    assert!(sides.iter().all(|it| *it == [0.0; 2]));
    assert_eq!(rig.rows.last().unwrap().axes[0].apart, 0.0);
    // Its skew is supervised as it is: not beside what is left of it.
    go(&mut rig, home(AxisLetter::X));
    let left = apart_at_rest(&mut rig);
    assert!(left.abs() < SQUARE, "{left}");
}

/// A reset moves nothing, nor does it keep the program from going on: the next enabling takes the gantry square.
#[test]
fn a_reset_leaves_a_gantry_as_it_is() {
    let mut rig = Rig::staying_on("router", &[], |_, _| ());
    settle(&mut rig);
    // Not referenced, nobody knows what is square.
    assert_eq!(told(&rig), []);
    go(&mut rig, ALL);
    rig.command(Command::Mdi("G1 X200 F1200".to_owned()));
    rig.run_until(|rig| rig.session.status().setpoint[0] > 30.0);
    rig.twin(X2)
        .disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
    settle(&mut rig);
    assert_eq!(state(&rig), State::Faulted);
    assert!(is_referenced(&rig, AxisLetter::X));
    let skew = apart(&mut rig);
    assert!((0.005..0.3).contains(&skew.abs()), "{skew}");
    rig.command(Command::Reset);
    rig.run_to(Phase::ModeStart);
    let (_, began) = *rig.phases.last().unwrap();
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    let sides = setpoints(&rig, began);
    assert!(sides.len() > 3 && sides.iter().all(|it| *it == [0.0; 2]));
    assert!(matches!(told(&rig)[..], [(_, true)]), "{:?}", told(&rig));
    go(&mut rig, Command::Mdi("G0 X60".to_owned()));
    assert_eq!(rig.refused, []);
    let left = apart(&mut rig);
    assert!((left - skew).abs() < 0.01, "{left} of {skew}");
    go(&mut rig, Command::Disable);
    go(&mut rig, Command::Enable);
    let left = apart(&mut rig);
    assert!(left.abs() < 0.002, "{left}");
}

/// Where the feed hold comes on while a gantry is taken square, the program that is to begin then waits for an operator.
#[test]
fn a_run_that_is_held_as_its_gantry_is_taken_square_begins_held() {
    let wired = [("[machine]\n", WIRED)];
    for (input, name, goes_off) in [
        (HOLD, "hold", false),
        (DOOR, "door", false),
        (HOLD, "hold", true),
        (DOOR, "door", true),
    ] {
        let mut rig = Rig::new("portal", &wired, "G0 X400\nM2\n", skewed(0.4));
        set(&mut rig, ENABLE, true);
        rig.run_to(Phase::Square);
        for _ in 0..16 {
            rig.step();
        }
        set(&mut rig, input, true);
        if goes_off {
            for _ in 0..8 {
                rig.step();
            }
            set(&mut rig, input, false);
        }
        rig.run_to(Phase::Program);
        let before = rig.rows.last().unwrap().plan.position;
        for _ in 0..1000 {
            rig.step();
        }
        assert_eq!(rig.rows.last().unwrap().plan.position, before);
        assert_eq!(state(&rig), State::Held);
        // It is told what holds it, and not as a feed hold of somebody's.
        let held = (rig.events.iter()).filter(|it| matches!(it, Event::Held(_)));
        let held: Vec<_> = held.filter_map(|it| it.describe(&*rig.layout)).collect();
        let [told] = &held[..] else {
            panic!("{held:?}");
        };
        assert!(
            told.starts_with(&format!("input \"{name}\" holds the path")),
            "{told}"
        );
        set(&mut rig, input, false);
        for _ in 0..8 {
            rig.step();
        }
        rig.command(Command::Resume);
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    }
}

/// A homing that is to come before the program does not wait as that does: it is not begun.
#[test]
fn a_run_that_is_held_as_its_gantry_is_taken_square_homes_nothing() {
    let at_start = format!("[homing]\nat_start = true\n{WIRED}");
    let homing = "[axis.homing]\nkind = \"hard_stop\"\ndirection = \"negative\"\nweight = \"none\"\ntorque = 30.0\nspeed = 5.0\n\
                  back_off = 5.0\nmax_distance = 100.0\nposition = 0.0\n\n[[axis]]\nname = \"Z\"";
    let absolute = "max_jerk = 100_000.0\nsoft_limits = [0.0, 1000.0]\nfollowing_error_limit = 2.0\n\
                    standstill_window = 0.05\ndrive_following_error = true\ndrive_soft_limits = true\n";
    let unreferenced = absolute.replace("drive_soft_limits = true\n", "");
    let changes = [
        ("[machine]\n", &*at_start),
        (absolute, &*unreferenced),
        ("[[axis]]\nname = \"Z\"", homing),
    ];
    for (input, failure) in [
        (HOLD, HomingFailure::FeedHold),
        (DOOR, HomingFailure::DoorOpen),
    ] {
        let mut rig = Rig::new("portal", &changes, "G0 X400\nM2\n", skewed(0.4));
        set(&mut rig, ENABLE, true);
        rig.run_to(Phase::Square);
        for _ in 0..16 {
            rig.step();
        }
        set(&mut rig, input, true);
        for _ in 0..8 {
            rig.step();
        }
        // Closed again it is as good a reason.
        set(&mut rig, input, false);
        let fault = rig.finish_with_fault();
        assert_eq!(fault, Fault::Axis(1, AxisCause::Homing(failure)));
    }
}
