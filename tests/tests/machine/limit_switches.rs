//! Limit switches that are wired to inputs of the machine: no axis goes on beyond one, whatever it is told, and the way
//! back is free.

use super::homing::{failure, go, home, is_referenced, settle, state, truth};
use proptest::prelude::*;
use syncline_controller::control::fault::AxisCause;
use syncline_controller::control::{Event, Fault, HomingFailure, Refusal as OrderRefusal, State};
use syncline_controller::session::{Command, Direction, Jog, Refusal};
use syncline_drives::twin::Disturbance;
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

const Y: usize = 2;

/// Where the switches of Y come on, and how far beyond.
const LIMITS: [(f64, f64); 2] = [(-60.0, -10.0), (810.0, 900.0)];

/// Y with two limit switches, each to an input of its drive.
fn wired(names: [&str; 2]) -> String {
    let input = |name: &str, signal: &str, (from, to): (f64, f64)| {
        format!(
            "[[input]]\nname = \"{name}\"\ndrive = \"Y\"\nsignal = \"{signal}\"\nfunction = \"limit\"\n\
             simulated = [{from:?}, {to:?}]\n\n"
        )
    };
    input(names[0], "DI2", LIMITS[0]) + &input(names[1], "DI3", LIMITS[1])
}

/// The homing of Y in the example, up to the place of its edge.
const HOMING: &str = "\
switches = [\"home Y\"]
direction = \"negative\"
speed = 80.0
slow_speed = 2.0
back_off = 5.0
position = -4.0
final_position = 0.0
";

/// The input of its home switch.
const HOME: &str = "name = \"home Y\"\ndrive = \"Y\"\nsignal = \"DI0\"\nfunction = \"home\"";
const SPARE: &str = "name = \"spare\"\ndrive = \"Y\"\nsignal = \"DI0\"\nnumber = 5";

/// The router, whose Y starts there, with limit switches of these names, and homed in another way if that is said.
fn router(names: [&str; 2], start: f64, homing: Option<&str>, seed: u64) -> Rig {
    let inputs = format!("{}[machine]\n", wired(names));
    let start = format!("start = {start:?}");
    let axis = "name = \"Y\"\ndrives = [\"Y\"]\n";
    let with_limits = format!("{axis}negative_limit = [\"Y-\"]\npositive_limit = [\"Y+\"]\n");
    let mut replacements = vec![
        ("[machine]\n", inputs.as_str()),
        (axis, with_limits.as_str()),
        ("start = 95.0", start.as_str()),
    ];
    if let Some(homing) = homing {
        replacements.push((HOMING, homing));
        if !homing.contains("home Y") {
            replacements.push((HOME, SPARE));
        }
    }
    let mut rig = Rig::staying_on("router", &replacements, |drive, config| {
        config.seed = seed + drive as u64;
    });
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    rig
}

/// As `home` does, G28.2 leads an axis off the limit switch by which it is homed, also where all axes are referenced; a
/// job that does not home it first does not begin there.
#[test]
fn a_referenced_axis_is_homed_off_its_limit_switch_by_a_program() {
    for (positive, input) in [(true, 3), (false, 2)] {
        let homing = by_limit(positive, [80.0, 4.0, 5.0]);
        let mut rig = router(["Y-", "Y+"], 400.0, Some(&homing), 1);
        go(&mut rig, Command::Home([false; 9]));
        let referenced = rig.session.status().referenced;
        assert!(referenced.iter().all(|it| *it), "{:?}", rig.events);
        rig.twin(Y).disturb(Disturbance::Input(input, true));
        let until = rig.rows.len() + 50;
        rig.run_to_row(until);
        go(&mut rig, Command::Mdi("G91 G1 Y1 F100".into()));
        assert_eq!(on_limit(&rig), [positive]);
        rig.refused.clear();
        rig.command(Command::Mdi("G28.2 Y0".into()));
        rig.run_until(|rig| state(rig) == State::Homing || !rig.refused.is_empty());
        assert_eq!(rig.refused, []);
        rig.twin(Y).disturb(Disturbance::Input(input, false));
        settle(&mut rig);
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        assert_eq!(limits(&rig), []);
        assert!(is_referenced(&rig, AxisLetter::Y), "{:?}", rig.events);
    }
}

/// The router as it is, whose Y may be jogged further while it is not referenced.
fn wide(names: [&str; 2]) -> Rig {
    let homing = format!("{HOMING}jog_distance = 100.0\n");
    router(names, 40.0, Some(&homing), 1)
}

/// A homing by the limit switch at the positive or the negative end.
fn by_limit(positive: bool, [speed, slow_speed, back_off]: [f64; 3]) -> String {
    let (switch, direction, position) = match positive {
        true => ("Y+", "positive", LIMITS[1].0),
        false => ("Y-", "negative", LIMITS[0].1),
    };
    format!(
        "switches = [\"{switch}\"]\ndirection = \"{direction}\"\nspeed = {speed:?}\nslow_speed = {slow_speed:?}\n\
         back_off = {back_off:?}\nposition = {position:?}\nmax_distance = 2000.0\n\
         jog_distance = 2000.0\njog_speed = 100.0\n"
    )
}

fn jog(distance: f64, speed: f64) -> Command {
    Command::Jog(Jog::By {
        axis: AxisLetter::Y,
        distance,
        speed: Some(speed),
    })
}

/// What the limit switches said: which end, and whether the axis moved away from it.
fn limits(rig: &Rig) -> Vec<(bool, bool)> {
    let limit = |event: &Event| match event {
        Event::Fault(Fault::Axis(
            _,
            AxisCause::LimitSwitch {
                positive,
                moving_away,
                ..
            },
        )) => Some((*positive, *moving_away)),
        _ => None,
    };
    rig.events.iter().filter_map(limit).collect()
}

fn on_limit(rig: &Rig) -> Vec<bool> {
    let on = |refusal: &Refusal| match refusal {
        Refusal::Machine(OrderRefusal::OnLimit { axis: 1, positive }) => *positive,
        other => panic!("{other}"),
    };
    rig.refused.iter().map(|it| on(&it.reason)).collect()
}

#[test]
fn an_axis_stops_on_its_limit_switch_and_is_jogged_off() {
    let mut rig = wide(["Y-", "Y+"]);
    go(&mut rig, jog(-90.0, 60.0));
    assert_eq!(state(&rig), State::Faulted, "{:?}", rig.events);
    assert_eq!(limits(&rig), [(false, false)]);
    // By the drive's quick stop, from 60 mm/s and two cycles of 2 ms.
    let rests = truth(&mut rig, Y);
    assert!((-12.0..-10.0).contains(&rests), "{rests}");
    go(&mut rig, Command::Reset);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert_eq!(limits(&rig).len(), 1, "a reset moves nothing");

    // Further on, or by a job that may lead there: no. Back: yes.
    go(&mut rig, jog(-1.0, 10.0));
    go(
        &mut rig,
        Command::Jog(Jog::Continuous {
            axis: AxisLetter::Y,
            direction: Direction::Negative,
            speed: None,
        }),
    );
    assert_eq!(on_limit(&rig), [false; 2]);
    rig.refused.clear();
    go(&mut rig, jog(5.0, 10.0));
    assert_eq!(rig.refused, []);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    let rests = truth(&mut rig, Y);
    assert!(rests > -8.0, "{rests}");
    go(&mut rig, home(AxisLetter::Y));
    assert!(is_referenced(&rig, AxisLetter::Y), "{:?}", rig.events);
    assert_eq!(limits(&rig).len(), 1);
}

#[test]
fn switches_that_are_wired_the_wrong_way_round_stop_it_too() {
    let mut rig = wide(["Y+", "Y-"]);
    go(&mut rig, jog(-90.0, 60.0));
    assert_eq!(state(&rig), State::Faulted, "{:?}", rig.events);
    assert_eq!(limits(&rig), [(true, true)]);
    let rests = truth(&mut rig, Y);
    assert!((-12.0..-10.0).contains(&rests), "{rests}");
    // It bars the way on, whatever it is called.
    go(&mut rig, Command::Reset);
    go(&mut rig, jog(-20.0, 60.0));
    assert_eq!(on_limit(&rig), [true]);
    rig.refused.clear();
    go(&mut rig, jog(20.0, 60.0));
    assert_eq!(rig.refused, []);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    let rests = truth(&mut rig, Y);
    assert!(rests > 0.0, "{rests}");
}

/// Runs until Y has come beyond a place in positive direction.
fn run_beyond(rig: &mut Rig, place: f64) {
    rig.run_until(|rig| truth(rig, Y) > place);
}

fn press(rig: &mut Rig, input: u8, cycles: usize) {
    rig.twin(Y).disturb(Disturbance::Input(input, true));
    for _ in 0..2 * cycles {
        rig.step();
    }
    rig.twin(Y).disturb(Disturbance::Input(input, false));
}

#[test]
fn a_switch_may_bounce_as_its_axis_leaves_it_and_not_later() {
    let mut rig = wide(["Y-", "Y+"]);
    go(&mut rig, jog(-90.0, 60.0));
    go(&mut rig, Command::Reset);
    rig.command(jog(30.0, 40.0));
    run_beyond(&mut rig, LIMITS[0].1 + 0.5);
    press(&mut rig, 2, 3);
    run_beyond(&mut rig, LIMITS[0].1 + 1.5);
    assert_eq!(limits(&rig).len(), 1);
    run_beyond(&mut rig, LIMITS[0].1 + 12.0);
    press(&mut rig, 2, 3);
    assert_eq!(limits(&rig), [(false, false), (false, true)]);
}

#[test]
fn a_homing_masks_its_own_limit_switch_alone() {
    let homing = by_limit(false, [40.0, 2.0, 3.0]);
    let mut rig = router(["Y-", "Y+"], 40.0, Some(&homing), 1);
    rig.command(home(AxisLetter::Y));
    rig.run_until(|rig| truth(rig, Y) < 20.0);
    press(&mut rig, 3, 3);
    settle(&mut rig);
    assert_eq!(limits(&rig), [(true, true)]);
    assert_eq!(state(&rig), State::Faulted);
}

#[test]
fn a_search_that_is_stopped_comes_to_rest_on_its_switch() {
    let homing = by_limit(false, [100.0, 2.0, 3.0]);
    let mut rig = router(["Y-", "Y+"], 40.0, Some(&homing), 1);
    rig.command(home(AxisLetter::Y));
    rig.run_until(|rig| truth(rig, Y) < LIMITS[0].1 - 0.1);
    go(&mut rig, Command::Stop);
    assert_eq!(limits(&rig), []);
    assert_eq!(state(&rig), State::Ready);
    assert!(!is_referenced(&rig, AxisLetter::Y));
    go(&mut rig, jog(-5.0, 10.0));
    assert_eq!(on_limit(&rig), [false]);
}

#[test]
fn no_job_begins_on_a_limit_switch() {
    let mut rig = router(["Y-", "Y+"], 40.0, None, 1);
    go(&mut rig, Command::Home([false; 9]));
    rig.refused.clear();
    // Somebody presses it.
    rig.twin(Y).disturb(Disturbance::Input(3, true));
    for _ in 0..10 {
        rig.step();
    }
    go(&mut rig, Command::Mdi("G0 Y10".to_owned()));
    assert_eq!(on_limit(&rig), [true]);
    assert_eq!(limits(&rig), []);
    rig.refused.clear();
    rig.twin(Y).disturb(Disturbance::Input(3, false));
    for _ in 0..10 {
        rig.step();
    }
    go(&mut rig, Command::Mdi("G0 Y10".to_owned()));
    assert_eq!(rig.refused, []);
    assert_eq!(rig.session.status().setpoint[AxisLetter::Y.index()], 10.0);
}

#[test]
fn a_search_the_wrong_way_ends_at_the_other_limit_switch() {
    // By its home switch, which is at the other end.
    let wrong = HOMING
        .replace("negative", "positive")
        .replace("-4.0", "-60.0");
    let wrong = wrong.replace("final_position = 0.0", "max_distance = 2000.0");
    let mut rig = router(["Y-", "Y+"], 700.0, Some(&wrong), 1);
    go(&mut rig, home(AxisLetter::Y));
    assert_eq!(state(&rig), State::Faulted, "{:?}", rig.events);
    assert_eq!(limits(&rig), [(true, false)]);
    assert!(!is_referenced(&rig, AxisLetter::Y));
    let rests = truth(&mut rig, Y);
    assert!((810.0..814.0).contains(&rests), "{rests}");
}

/// What is done while it is homed.
#[derive(Clone, Copy, Debug)]
enum Meanwhile {
    Nothing,
    /// A stop so many cycles later.
    Stop(usize),
    /// The other limit switch is pressed so many cycles later.
    Other(usize),
}

fn meanwhile() -> impl Strategy<Value = Meanwhile> {
    prop_oneof![
        2 => Just(Meanwhile::Nothing),
        2 => (0usize..3000).prop_map(Meanwhile::Stop),
        1 => (0usize..3000).prop_map(Meanwhile::Other),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 5, ..ProptestConfig::default() })]

    /// Homed by either of its limit switches from wherever it stands, an axis comes to know where it is, and that switch
    /// stops nothing on the way; the other one does. Behind it the way onto the switch is barred again.
    #[test]
    fn an_axis_is_homed_by_its_limit_switch(
        positive in any::<bool>(),
        start in prop_oneof![-55.0..-12.0, -30.0..30.0, 0.0..800.0, 780.0..830.0, 812.0..890.0],
        speed in 10.0..120.0,
        slow_speed in 0.5..8.0,
        back_off in 1.0..8.0,
        meanwhile in meanwhile(),
        seed in 0..1000_u64,
    ) {
        let homing = by_limit(positive, [speed, slow_speed, back_off]);
        let mut rig = router(["Y-", "Y+"], start, Some(&homing), seed);
        rig.command(home(AxisLetter::Y));
        if let Meanwhile::Stop(after) | Meanwhile::Other(after) = meanwhile {
            for _ in 0..after {
                rig.step();
            }
        }
        let homes = state(&rig) == State::Homing;
        match meanwhile {
            Meanwhile::Nothing => {}
            Meanwhile::Stop(_) => rig.command(Command::Stop),
            Meanwhile::Other(_) => {
                let input = if positive { 2 } else { 3 };
                rig.twin(Y).disturb(Disturbance::Input(input, true));
            }
        }
        settle(&mut rig);
        let told = limits(&rig);
        match meanwhile {
            // Whether it moved then is not known here.
            Meanwhile::Other(_) => prop_assert!(
                told.iter().all(|(end, _)| *end != positive), "{:?}", told
            ),
            _ => prop_assert_eq!(&told, &[], "{:?}", rig.events),
        }
        if told.is_empty() && (matches!(meanwhile, Meanwhile::Nothing) || !homes) {
            prop_assert_eq!(failure(&rig), None::<HomingFailure>);
            prop_assert!(is_referenced(&rig, AxisLetter::Y), "{:?}", rig.events);
            let end = if positive { 800.0 } else { 0.0 };
            let shown = rig.session.status().setpoint[1];
            prop_assert!((shown - end).abs() < 1e-6, "{} {}", shown, end);
            for _ in 0..200 {
                rig.step();
            }
            let error = truth(&mut rig, Y) - end;
            // An edge by samples, and the encoder's noise.
            prop_assert!(error.abs() < slow_speed * 0.001 + 0.003, "{}", error);
        }
        if state(&rig) == State::Faulted {
            rig.twin(Y).disturb(Disturbance::Input(2, false));
            rig.twin(Y).disturb(Disturbance::Input(3, false));
            go(&mut rig, Command::Reset);
        }
        prop_assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
        // Wherever it stands then, it does not get further onto either switch.
        let faults = limits(&rig).len();
        for (end, sign) in [(0, -1.0), (1, 1.0)] {
            for _ in 0..2 {
                go(&mut rig, jog(sign * 1000.0, 100.0));
                if state(&rig) == State::Faulted {
                    go(&mut rig, Command::Reset);
                }
            }
            let (edge, rests) = (LIMITS[end], truth(&mut rig, Y));
            let beyond = sign * (rests - if end == 0 { edge.1 } else { edge.0 });
            // From 100 mm/s by the drive's quick stop; from where it had come to rest before, no further.
            let from = sign * (start - if end == 0 { edge.1 } else { edge.0 });
            prop_assert!(beyond < 4.0_f64.max(from + 4.0), "{} beyond, started {}", beyond, from);
        }
        prop_assert!(limits(&rig).len() <= faults + 2);
    }
}
