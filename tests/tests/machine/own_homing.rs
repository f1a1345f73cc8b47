//! Axes whose drives home by themselves: every method, from anywhere, and everything that ends it on its way.

use super::homing::{ALL, Y, errors, failure, go, home, is_referenced, settle, state, truth};
use proptest::prelude::*;
use syncline_controller::control::fault::AxisCause;
use syncline_controller::control::{Event, Fault, HomingFailure, LostReference, Phase, State};
use syncline_controller::session::{Command, Jog};
use syncline_drives::twin::{Disturbance, ErrorClass};
use syncline_gcode::AxisLetter;
use syncline_tests::rig::Rig;

/// The homing of the router's Y in its machine file.
pub(super) const BY_SWITCH: &str = "kind = \"switch\"\norder = 2\nswitches = [\"home Y\"]\ndirection = \"negative\"\nspeed = 80.0\nslow_speed = 2.0\nback_off = 5.0\nposition = -4.0\nfinal_position = 0.0";
pub(super) const HOME_Y: &str = "[[input]]\nname = \"home Y\"\ndrive = \"Y\"\nsignal = \"DI0\"\nfunction = \"home\"\nsimulated = [-60.0, -4.0]\n";
/// Travel of Y in a revolution of its motor, from one index pulse to the next, mm.
const TURN: f64 = 20.0;

/// What is different of the router where the drive of Y homes by itself.
fn by_drive(method: u8, more: &str, simulation: &str) -> Vec<(String, String)> {
    let homing = format!(
        "kind = \"drive\"\norder = 2\nmethod = {method}\nspeed = 80.0\nslow_speed = 4.0\n{more}"
    );
    vec![
        (HOME_Y.to_owned(), String::new()),
        (BY_SWITCH.to_owned(), homing),
        ("start = 95.0".to_owned(), simulation.to_owned()),
    ]
}

fn rig(replacements: &[(String, String)], seed: u64) -> Rig {
    let replacements: Vec<_> = replacements
        .iter()
        .map(|(old, new)| (old.as_str(), new.as_str()))
        .collect();
    let mut rig = Rig::staying_on("router", &replacements, |drive, config| {
        config.seed = seed + drive as u64;
    });
    settle(&mut rig);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    rig
}

/// To a reference switch in negative direction, outside, without the index pulse.
const REF_NEGATIVE: u8 = 27;
const SIMULATED: &str =
    "start = 95.0\nreference_switch = [-60.0, -4.0]\nlimit_switches = [-90.0, 860.0]";

fn usual() -> Vec<(String, String)> {
    by_drive(
        REF_NEGATIVE,
        "position = -4.0\nfinal_position = 0.0",
        SIMULATED,
    )
}

/// The same with a probe at the drive of X.
fn probing() -> Vec<(String, String)> {
    let probe =
        "[[input]]\nname = \"probe\"\ndrive = \"X1\"\nsignal = \"DI3\"\nfunction = \"probe\"\n";
    let mut replacements = usual();
    replacements[0].1 = probe.to_owned();
    replacements
}

/// Goes on until the drive of Y moves on its way home.
fn on_its_way(rig: &mut Rig) {
    rig.run_until(|rig| rig.twin(Y).observe().velocity.abs() > 1.0);
}

fn day() -> String {
    let mut rig = rig(&usual(), 0);
    go(&mut rig, ALL);
    assert_eq!(failure(&rig), None);
    for axis in [AxisLetter::X, AxisLetter::Y, AxisLetter::Z] {
        assert!(is_referenced(&rig, axis), "{:?}", rig.events);
        assert_eq!(rig.session.status().setpoint[axis.index()], 0.0);
    }
    // The reference point is 200 increments beside the edge, by the drive's default.
    assert!(errors(&mut rig, AxisLetter::Y)[0].abs() < 0.05);
    go(&mut rig, Command::Mdi("G0 X20 Y30 Z-5".to_owned()));
    go(&mut rig, home(AxisLetter::Y));
    go(&mut rig, Command::Mdi("G0 X0 Y0 Z0".to_owned()));
    assert_eq!(rig.refused, []);
    go(&mut rig, Command::SwitchOff);
    assert_eq!(rig.problems, [""; 0]);
    rig.session.timeline().frames().result().0
}

#[test]
fn a_drive_that_homes_by_itself_is_one_of_several_axes_and_the_same_twice() {
    assert_eq!(day(), day());
}

#[test]
fn a_run_that_homes_so_passes() {
    let usual = usual();
    let replacements: Vec<_> = usual.iter().map(|(old, new)| (&**old, &**new)).collect();
    let program = "G0 X20 Y30 Z-5\nG1 X40 Y60 F3000\nM2\n";
    let rig = Rig::new("router", &replacements, program, |_, _| ());
    let summary = rig.judge();
    assert_eq!(summary.verdict, "pass", "{:?}", summary.violations);
}

/// An index pulse near to the edge may be another one some day: told below 10 % of a turn, refused below 2 %.
#[test]
fn an_index_pulse_near_to_the_edge_is_told_or_refused() {
    for (beside, expected) in [
        (0.2, Err(())),
        (-0.2, Err(())),
        (1.0, Ok(true)),
        (-1.0, Ok(true)),
        (5.0, Ok(false)),
        (-9.0, Ok(false)),
    ] {
        let simulation = format!("start = 0.0\nlimit_switches = [{:?}, 860.0]", beside - 80.0);
        let keys = "position = 0.0\nfinal_position = 20.0";
        let mut rig = rig(&by_drive(1, keys, &simulation), 0);
        go(&mut rig, home(AxisLetter::Y));
        let told = rig.events.iter().find_map(|event| match event {
            Event::IndexNear { distance, .. } => Some(*distance),
            _ => None,
        });
        let refused = matches!(failure(&rig), Some(HomingFailure::IndexTooNear { .. }));
        assert_eq!(is_referenced(&rig, AxisLetter::Y), !refused);
        let came = if refused { Err(()) } else { Ok(told.is_some()) };
        assert_eq!(came, expected, "{beside}: {:?}", rig.events);
        if let Some(distance) = told {
            assert!((distance - f64::abs(beside)).abs() < 0.1, "{distance}");
        }
        // The machine goes on: it is homed again, or moved.
        if state(&rig) == State::Disabled {
            go(&mut rig, Command::Enable);
        }
        assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    }
}

/// A homing of Y by its drive.
#[derive(Clone, Debug)]
struct Case {
    method: u8,
    /// The drive counts the other way than the axis.
    negative: bool,
    start: f64,
    /// Where the reference switch is on, mm.
    switch: (f64, f64),
    seed: u64,
}

const METHODS: [u8; 23] = [
    1, 2, 7, 8, 9, 10, 11, 12, 13, 14, 17, 18, 23, 24, 25, 26, 27, 28, 29, 30, 33, 34, 35,
];

fn case() -> impl Strategy<Value = Case> {
    let method = prop::sample::select(METHODS.to_vec());
    let switch = (-40.0..760.0, 5.0..40.0_f64);
    (method, any::<bool>(), -40.0..840.0, switch, 0..1000u64).prop_map(
        |(method, negative, start, (from, width), seed)| Case {
            method,
            negative,
            start,
            switch: (from, from + width),
            seed,
        },
    )
}

fn judge(case: &Case) -> Result<(), TestCaseError> {
    let (from, to) = case.switch;
    let simulation = format!(
        "start = {:?}\nreference_switch = [{from:?}, {to:?}]\nlimit_switches = [-90.0, 860.0]",
        case.start
    );
    // Away from the limit switch.
    let upper = matches!(case.method, 2 | 18) != case.negative;
    let away = if upper { -1.0 } else { 1.0 };
    let final_position = 400.0 + 10.0 * away;
    let mut replacements = by_drive(
        case.method,
        &format!("position = 400.0\nmax_distance = 3000.0\nfinal_position = {final_position:?}"),
        &simulation,
    );
    // None of them is homed by hand at the start of a run.
    replacements.push(("at_start = true".to_owned(), String::new()));
    if case.negative {
        let drive = "name = \"Y\"\nbus = \"main\"\nnode = 3\n";
        replacements.push((
            drive.to_owned(),
            format!("{drive}direction = \"negative\"\n"),
        ));
    }
    let mut rig = rig(&replacements, case.seed);
    go(&mut rig, home(AxisLetter::Y));
    let edges = match case.method {
        1 | 2 | 17 | 18 => [-90.0, 860.0],
        _ => [from, to],
    };
    // How near to an edge an index pulse is.
    let apart = |edge: &f64| (edge / TURN - (edge / TURN).round()).abs() * TURN;
    let nearest = edges.iter().map(apart).fold(f64::INFINITY, f64::min);
    let warned = (rig.events.iter()).any(|event| matches!(event, Event::IndexNear { .. }));
    let by_both = matches!(case.method, 1..=14);
    prop_assert!(!warned || by_both && nearest < 0.1 * TURN + 0.1);
    if matches!(failure(&rig), Some(HomingFailure::IndexTooNear { .. })) {
        prop_assert!(by_both && nearest < 0.02 * TURN + 0.1, "{}", nearest);
        prop_assert!(!is_referenced(&rig, AxisLetter::Y));
        return Ok(());
    }
    prop_assert_eq!(failure(&rig), None, "{:?}", rig.events);
    prop_assert!(is_referenced(&rig, AxisLetter::Y));
    let at = AxisLetter::Y.index();
    for _ in 0..200 {
        rig.step();
    }
    let shown = rig.session.status().setpoint[at];
    prop_assert!((shown - final_position).abs() < 0.001, "{}", shown);
    // Where the reference point really is.
    let point = truth(&mut rig, Y) - shown + 400.0;
    let near = |far: f64| edges.iter().any(|edge| (point - edge).abs() < far);
    match case.method {
        35 => prop_assert!((point - case.start).abs() < 0.01, "{}", point),
        1..=14 | 33 | 34 => {
            let turns = (point / TURN).round() * TURN;
            prop_assert!((point - turns).abs() < 0.005, "{}", point);
            prop_assert!(near(TURN + 0.1) || case.method > 30, "{}", point);
        }
        // The distance behind the edge is the drive's, 200 increments.
        _ => prop_assert!(near(0.05), "{}", point),
    }
    let mut there = [None; 9];
    there[at] = Some(400.0 + 30.0 * away);
    go(&mut rig, Command::Jog(Jog::To(there)));
    for _ in 0..200 {
        rig.step();
    }
    prop_assert_eq!(rig.session.status().setpoint[at], 400.0 + 30.0 * away);
    prop_assert!((truth(&mut rig, Y) - point - 30.0 * away).abs() < 0.02);
    prop_assert_eq!(rig.problems.len(), 0, "{:?}", rig.problems);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// By every method, from wherever the axis stands: it counts from its edge or index pulse, and goes on from there.
    #[test]
    fn every_method_finds_its_place(case in case()) {
        judge(&case)?;
    }
}

/// What ends a homing on its way.
#[derive(Clone, Debug)]
enum Cut {
    Command(Command),
    Disturb(usize, Disturbance),
}

fn cut() -> impl Strategy<Value = Cut> {
    let commands = [Command::Stop, Command::Disable, Command::SwitchOff].map(Cut::Command);
    let disturbances = [
        Cut::Disturb(Y, Disturbance::Block(true)),
        Cut::Disturb(Y, Disturbance::Mains(false)),
        Cut::Disturb(Y, Disturbance::Mute(true)),
        Cut::Disturb(Y, Disturbance::Reset),
        Cut::Disturb(0, Disturbance::Mute(true)),
        Cut::Disturb(3, Disturbance::LoseTorque(true)),
        // Something touches the probe.
        Cut::Disturb(0, Disturbance::Input(3, true)),
    ];
    prop::sample::select([&commands[..], &disturbances[..]].concat())
}

/// Cuts a homing off, and has the machine begin it again.
fn cut_off(cut: &Cut, wake_ups: usize, seed: u64) -> Result<(), TestCaseError> {
    let mut rig = rig(&probing(), seed);
    rig.command(home(AxisLetter::Y));
    for _ in 0..wake_ups {
        rig.step();
    }
    let was_homing = state(&rig) == State::Homing;
    let moved = rig.twin(Y).observe().velocity.abs() > 0.5;
    match cut {
        Cut::Command(command) => rig.command(command.clone()),
        Cut::Disturb(drive, disturbance) => rig.twin(*drive).disturb(*disturbance),
    }
    settle(&mut rig);
    for _ in 0..50 {
        rig.step();
    }
    if moved && was_homing && matches!(cut, Cut::Disturb(_, Disturbance::Input(..))) {
        prop_assert!(rig.events.contains(&Event::Touched));
    }
    // It rests, and does not move by itself again.
    let stands = rig.twin(Y).observe();
    prop_assert!(stands.velocity.abs() < 0.05, "{:?}: {:?}", cut, stands);
    for _ in 0..300 {
        rig.step();
    }
    let moved = (rig.twin(Y).observe().position - stands.position).abs();
    prop_assert!(moved < 0.01, "{:?}: {}", cut, moved);
    if was_homing {
        let told = rig.events.iter().rev().find_map(|event| match event {
            Event::Referenced { axis: 1, .. } => Some(true),
            Event::Unreferenced { axis: 1, .. } => Some(false),
            _ => None,
        });
        prop_assert_eq!(is_referenced(&rig, AxisLetter::Y), told.unwrap_or(false));
    }
    // There is a way on.
    for (drive, disturbance) in [
        (Y, Disturbance::Block(false)),
        (Y, Disturbance::Mains(true)),
        (Y, Disturbance::Mute(false)),
        (0, Disturbance::Mute(false)),
        (3, Disturbance::LoseTorque(false)),
        (0, Disturbance::Input(3, false)),
    ] {
        rig.twin(drive).disturb(disturbance);
    }
    for _ in 0..100 {
        rig.step();
    }
    match state(&rig) {
        State::Off => return Ok(()),
        State::Faulted => go(&mut rig, Command::Reset),
        State::Disabled => go(&mut rig, Command::Enable),
        _ => {}
    }
    prop_assert_eq!(state(&rig), State::Ready, "{:?}: {:?}", cut, rig.events);
    go(&mut rig, home(AxisLetter::Y));
    prop_assert!(
        is_referenced(&rig, AxisLetter::Y),
        "{:?}: {:?}",
        cut,
        rig.events
    );
    prop_assert!(errors(&mut rig, AxisLetter::Y)[0].abs() < 0.05);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Whatever ends it, and whenever: the drive rests, the axis is not referenced, and is homed again.
    #[test]
    fn a_homing_cut_off_rests_and_is_begun_again(cut in cut(), wake_ups in 0..3000usize, seed in 0..1000u64) {
        cut_off(&cut, wake_ups, seed)?;
    }
}

/// Wake-ups until Y is referenced, of itself or with all others; `None` if it fails.
fn takes(max_time_ms: usize, homed: Command) -> Option<usize> {
    let more = format!("position = -4.0\nfinal_position = 0.0\nmax_time_ms = {max_time_ms}");
    let mut replacements = by_drive(REF_NEGATIVE, &more, SIMULATED);
    replacements.push(("start = 180.0".to_owned(), "start = 790.0".to_owned()));
    let mut rig = rig(&replacements, 0);
    rig.command(homed);
    let wake_ups = (0..40_000).find(|_| {
        rig.step();
        is_referenced(&rig, AxisLetter::Y) || failure(&rig).is_some()
    });
    wake_ups.filter(|_| is_referenced(&rig, AxisLetter::Y))
}

/// It waits until no axis of its group moves: X, which is searched for ten seconds.
#[test]
fn the_time_that_it_waits_for_others_is_not_its_own() {
    let alone = takes(120_000, home(AxisLetter::Y)).expect("it is homed");
    let ms = alone; // Two wake-ups are a cycle of 2 ms.
    let together = takes(ms + 200, ALL).expect("it is homed");
    assert!(together > 2 * alone, "{together}, {alone}");
    assert_eq!(takes(ms / 2, home(AxisLetter::Y)), None);
}

#[test]
fn one_that_goes_too_far_is_halted() {
    let homing = "position = -4.0\nfinal_position = 0.0\nmax_distance = 60.0";
    let mut rig = rig(&by_drive(REF_NEGATIVE, homing, SIMULATED), 0);
    let from = truth(&mut rig, Y);
    go(&mut rig, home(AxisLetter::Y));
    assert_eq!(failure(&rig), Some(HomingFailure::TooFar));
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert!(!is_referenced(&rig, AxisLetter::Y));
    let went = from - truth(&mut rig, Y);
    // Beyond it only as far as it takes the drive to come to rest, with the ramp that 6084h has by default.
    assert!((60.0..80.0).contains(&went), "{went}");
}

/// A drive that is told to halt is told nothing else before it is switched off: what would move on lives in it.
#[test]
fn a_halt_holds_until_the_drive_is_off() {
    for command in [Command::Stop, Command::Disable, Command::SwitchOff] {
        let mut rig = rig(&usual(), 0);
        rig.command(home(AxisLetter::Y));
        on_its_way(&mut rig);
        let told = rig.commands(Y).len();
        go(&mut rig, command);
        let words = rig.commands(Y).into_iter().skip(told).map(|it| it.1);
        let (enabled, halt) = (0x000F, 0x0100);
        let words: Vec<u16> = words.skip_while(|word| word & halt == 0).collect();
        let mut powered = words.iter().take_while(|word| *word & enabled == enabled);
        assert!(powered.all(|word| word & halt != 0), "{words:04X?}");
        assert!(words.contains(&0x0006), "{words:04X?}");
    }
}

#[test]
fn one_that_does_not_halt_is_a_fault() {
    let mut rig = rig(&usual(), 0);
    rig.command(home(AxisLetter::Y));
    on_its_way(&mut rig);
    rig.twin(Y).disturb(Disturbance::Deaf(true));
    let asked = rig.session.timeline().now();
    rig.command(Command::Stop);
    rig.run_until(|rig| rig.events.iter().any(|it| matches!(it, Event::Fault(_))));
    let within = rig.session.timeline().now().saturating_since(asked);
    assert!(within.as_secs_f64() < 2.2, "{within:?}");
    let fault = rig.session.faults()[0];
    assert!(
        matches!(fault, Fault::Axis(1, AxisCause::NotHalted { .. })),
        "{fault:?}"
    );
}

#[test]
fn one_without_its_switch_is_a_fault_with_its_reason() {
    let mut rig = rig(
        &by_drive(REF_NEGATIVE, "position = -4.0", "start = 95.0"),
        0,
    );
    go(&mut rig, home(AxisLetter::Y));
    assert_eq!(failure(&rig), Some(HomingFailure::NotHome));
    assert_eq!(state(&rig), State::Faulted);
    go(&mut rig, Command::Reset);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert!(!is_referenced(&rig, AxisLetter::Y));
}

/// An axis that was referenced is not any more from the moment on at which its drive counts anew.
#[test]
fn one_that_is_homed_again_is_not_referenced_meanwhile() {
    let mut rig = rig(&usual(), 0);
    go(&mut rig, home(AxisLetter::Y));
    assert!(is_referenced(&rig, AxisLetter::Y));
    rig.command(home(AxisLetter::Y));
    on_its_way(&mut rig);
    assert!(!is_referenced(&rig, AxisLetter::Y));
    rig.command(Command::Stop);
    settle(&mut rig);
    let homes = |event: &Event| {
        matches!(
            event,
            Event::Unreferenced {
                why: LostReference::Homes,
                ..
            }
        )
    };
    let told = rig
        .events
        .iter()
        .filter(|it| matches!(it, Event::Unreferenced { .. }));
    assert_eq!(
        (
            told.count(),
            rig.events.iter().filter(|it| homes(it)).count()
        ),
        (1, 1)
    );
    assert!(!is_referenced(&rig, AxisLetter::Y));
    // It was switched off, as what would have moved on lives in the drive, and on again.
    assert!(
        rig.phases
            .iter()
            .any(|(phase, _)| *phase == Phase::Disabled)
    );
    assert_eq!(state(&rig), State::Ready);
}

/// A reference counts as long as the drive says that it is homed (statusword bit 15): that outlives a fault and its reset,
/// and is over when the drive begins anew.
#[test]
fn a_drive_that_forgets_its_zero_is_homed_again() {
    let mut rig = rig(&usual(), 0);
    go(&mut rig, home(AxisLetter::Y));
    assert!(is_referenced(&rig, AxisLetter::Y));
    go(&mut rig, Command::Disable);
    go(&mut rig, Command::Enable);
    assert!(is_referenced(&rig, AxisLetter::Y));
    rig.twin(Y)
        .disturb(Disturbance::Fault(ErrorClass::StopAndSwitchOff));
    settle(&mut rig);
    assert_eq!(state(&rig), State::Faulted);
    go(&mut rig, Command::Reset);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert!(is_referenced(&rig, AxisLetter::Y));
    rig.twin(Y).disturb(Disturbance::Reset);
    settle(&mut rig);
    go(&mut rig, Command::Reset);
    assert_eq!(state(&rig), State::Ready, "{:?}", rig.events);
    assert!(!is_referenced(&rig, AxisLetter::Y));
}
