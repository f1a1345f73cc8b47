//! References of axes whose encoders count without power: from one day to the next, and each way in which one does
//! not hold any more.

use crate::homing::Y;
use proptest::prelude::*;
use std::fs::{self, File};
use syncline_canopen::Address;
use syncline_controller::control::{Event, NotRecalled, Refusal as OrderRefusal, State};
use syncline_controller::machine::{MachineState, NotKept};
use syncline_controller::session::{Command, Refusal};
use syncline_drives::twin::Disturbance;
use syncline_gcode::AxisLetter;
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::Rig;

/// X and Y of the router have encoders that count without power.
const ABSOLUTE: [(&str, &str); 2] = [
    (
        "order = 2                   # once Z is up",
        "order = 2\nabsolute = true",
    ),
    (
        "switches = [\"home Y\"]",
        "switches = [\"home Y\"]\nabsolute = true",
    ),
];

/// The router on a day that begins with what is known from the one before.
fn day(state: &MachineState, replacements: &[(&str, &str)]) -> Rig {
    let replacements = [&ABSOLUTE[..], replacements].concat();
    let mut rig = Rig::recalling("router", &replacements, state, |drive, config| {
        config.seed = drive as u64 + 1;
    });
    settle(&mut rig);
    rig
}

/// Goes on until the machine rests and waits for an operator, or is off.
fn settle(rig: &mut Rig) {
    use State::{Disabled, Faulted, Off, Ready};
    let mut since = 0;
    while since < 6 && rig.step() {
        let rests = matches!(rig.session.status().state, Ready | Faulted | Disabled | Off);
        since = if rests { since + 1 } else { 0 };
    }
}

fn go(rig: &mut Rig, command: Command) {
    rig.command(command);
    settle(rig);
}

/// What is to be kept of a day, on what was known before it.
fn kept(rig: &Rig, mut state: MachineState) -> MachineState {
    for event in &rig.events {
        if let Event::Kept { device, kept } = event {
            state.keep(&rig.machine.drives[*device], *kept);
        }
    }
    state
}

/// A day on which all axes are homed, X and Y go somewhere, and the machine is switched off.
fn first_day() -> MachineState {
    let mut rig = day(&MachineState::default(), &[]);
    assert_eq!(
        not_recalled(&rig),
        [NotRecalled::NotKept(NotKept::Unknown); 2]
    );
    go(&mut rig, Command::Home([false; 9]));
    go(&mut rig, Command::Mdi("G0 X210 Y130".to_owned()));
    go(&mut rig, Command::SwitchOff);
    assert_eq!(rig.problems, [""; 0]);
    kept(&rig, MachineState::default())
}

fn not_recalled(rig: &Rig) -> Vec<NotRecalled> {
    let why = |event: &Event| match event {
        Event::NotRecalled { why, .. } => Some(*why),
        _ => None,
    };
    rig.events.iter().filter_map(why).collect()
}

fn is_referenced(rig: &Rig, axis: AxisLetter) -> bool {
    rig.session.status().referenced[axis.index()]
}

/// Where the axes stand on the second day, mm.
fn stand(x: f64, y: f64) -> [(String, String); 2] {
    [
        ("start = 180.0".to_owned(), format!("start = {x:?}")),
        ("start = 95.0".to_owned(), format!("start = {y:?}")),
    ]
}

fn second_day(state: &MachineState, x: f64, y: f64) -> Rig {
    let stand = stand(x, y);
    let stand: Vec<_> = stand.iter().map(|(old, new)| (&**old, &**new)).collect();
    day(state, &stand)
}

#[test]
fn a_reference_holds_from_day_to_day() {
    let state = first_day();
    let mut rig = second_day(&state, 210.0, 130.2);
    assert_eq!(not_recalled(&rig), []);
    // Z counts from where it was switched on, as ever.
    assert!(is_referenced(&rig, AxisLetter::X) && is_referenced(&rig, AxisLetter::Y));
    assert!(!is_referenced(&rig, AxisLetter::Z));
    let (x, y) = (AxisLetter::X.index(), AxisLetter::Y.index());
    let status = rig.session.status();
    assert!((status.setpoint[x] - 210.0).abs() < 0.002, "{status:?}");
    assert!((status.setpoint[y] - 130.2).abs() < 0.002, "{status:?}");
    // It goes on being kept, also when the machine is not asked to do anything.
    go(&mut rig, Command::SwitchOff);
    let again = kept(&rig, state);
    let rig = second_day(&again, 210.0, 131.0);
    assert!(is_referenced(&rig, AxisLetter::Y));
}

#[test]
fn a_reference_that_does_not_hold_is_told_and_forgotten() {
    let state = first_day();
    let moved = |why: &[NotRecalled]| match why {
        [NotRecalled::Moved(by)] => (by - 5.0).abs() < 0.01,
        _ => false,
    };
    let mut rig = second_day(&state, 210.0, 135.0);
    assert!(moved(&not_recalled(&rig)), "{:?}", not_recalled(&rig));
    assert!(is_referenced(&rig, AxisLetter::X) && !is_referenced(&rig, AxisLetter::Y));
    go(&mut rig, Command::Mdi("G0 Y1".to_owned()));
    let reasons: Vec<_> = rig.refused.iter().map(|refused| &refused.reason).collect();
    assert!(
        matches!(
            reasons[..],
            [Refusal::Machine(OrderRefusal::Unreferenced(_))]
        ),
        "{reasons:?}"
    );
    go(&mut rig, Command::SwitchOff);
    let state = kept(&rig, state);
    let mut rig = second_day(&state, 210.0, 135.0);
    assert_eq!(not_recalled(&rig), [NotRecalled::NotKept(NotKept::Unknown)]);
    go(&mut rig, Command::Home([false; 9]));
    assert!(is_referenced(&rig, AxisLetter::Y), "{:?}", rig.events);
    // Other counts than those of before.
    let state = first_day();
    let other = (
        "node = 3\nmodel = \"lxm32m\"",
        "node = 3\nmodel = \"lxm32m\"\nzero = 7",
    );
    let turned = (
        "node = 3\nmodel = \"lxm32m\"",
        "node = 3\nmodel = \"lxm32m\"\ndirection = \"negative\"",
    );
    let geared = (
        "drives = [\"Y\"]\npitch = 160.0",
        "drives = [\"Y\"]\npitch = 150.0",
    );
    for change in [other, turned, geared] {
        let stand = stand(210.0, 130.0);
        let mut replacements: Vec<_> = stand.iter().map(|(old, new)| (&**old, &**new)).collect();
        replacements.push(change);
        let rig = day(&state, &replacements);
        let expected = NotRecalled::NotKept(NotKept::OtherCounts { drive: 2 });
        assert_eq!(not_recalled(&rig), [expected], "{change:?}");
        assert!(!is_referenced(&rig, AxisLetter::Y));
    }
}

/// Of a machine whose Y keeps its reference: one day with the drive that it has, the next with another in its place, told by
/// the object of its model, and a day more.
fn is_known_again(machine: &str, replacements: &[(&str, &str)], object: Address) {
    let on = |state: &MachineState, as_before: bool| {
        let mut rig = Rig::recalling(machine, replacements, state, |_, _| ());
        if !as_before {
            rig.twin(Y).disturb(Disturbance::Replaced(7));
        }
        settle(&mut rig);
        rig
    };
    let mut home = [false; 9];
    home[AxisLetter::Y.index()] = true;
    let mut rig = on(&MachineState::default(), true);
    go(&mut rig, Command::Home(home));
    go(&mut rig, Command::SwitchOff);
    let state = kept(&rig, MachineState::default());
    let rig = on(&state, true);
    assert!(is_referenced(&rig, AxisLetter::Y), "{:?}", rig.events);
    let mut rig = on(&state, false);
    let told = not_recalled(&rig);
    let [NotRecalled::NotKept(NotKept::OtherDevice(other))] = told[..] else {
        panic!("{told:?}");
    };
    assert_eq!((other.object, other.now), (object, Some(7)));
    assert!(!is_referenced(&rig, AxisLetter::Y));
    // The new one's place is another matter, and known from the next day on.
    go(&mut rig, Command::Home(home));
    go(&mut rig, Command::SwitchOff);
    let state = kept(&rig, state);
    assert!(is_referenced(&on(&state, false), AxisLetter::Y));
    assert!(!is_referenced(&on(&state, true), AxisLetter::Y));
}

#[test]
fn a_drive_that_was_replaced_has_no_reference() {
    let encoder = Address::new(0x300D, 3);
    let there = ("start = 95.0", "start = 0.0");
    is_known_again("router", &[ABSOLUTE[1], there], encoder);
    let by_hand = "name = \"Y\"\nhoming = { kind = \"set_here\", absolute = true }\ndrives";
    let by_hand = ("name = \"Y\"\ndrives", by_hand);
    // An axis that is homed has no soft limits in its drive.
    let own_limits = (
        "drive_soft_limits = true\n\n[[axis]]\nname = \"Z\"",
        "\n[[axis]]\nname = \"Z\"",
    );
    is_known_again("csp", &[by_hand, own_limits], Address::new(0x1018, 4));
    is_known_again("mixed", &[by_hand], Address::new(0x2007, 0));
}

#[test]
fn a_day_that_does_not_begin_forgets_nothing() {
    let state = first_day();
    let mut rig = Rig::recalling("router", &ABSOLUTE, &state, |_, _| ());
    rig.bus().unplugged = true;
    settle(&mut rig);
    go(&mut rig, Command::SwitchOff);
    assert_eq!(kept(&rig, state.clone()), state);
}

#[test]
fn a_state_file_is_the_old_one_or_the_new_one() {
    let folder = Folder::new();
    let file = MachineState::beside(&folder.file("machine.toml", ""));
    assert_eq!(MachineState::load(&file).unwrap(), MachineState::default());
    let state = first_day();
    state.save(&file).unwrap();
    assert_eq!(MachineState::load(&file).unwrap(), state);
    // A write that was killed leaves a part of the new one beside the old one.
    let text = fs::read_to_string(&file).unwrap();
    let beside = folder.file("machine.state.json.new", &text[..text.len() / 2]);
    assert_eq!(MachineState::load(&file).unwrap(), state);
    MachineState::default().save(&file).unwrap();
    assert!(!beside.exists());
    assert_eq!(MachineState::load(&file).unwrap(), MachineState::default());
    // What was not written so is refused, wherever it breaks off.
    for length in (0..text.trim_end().len()).step_by(7) {
        fs::write(&file, &text[..length]).unwrap();
        let error = MachineState::load(&file).unwrap_err().to_string();
        assert!(error.contains("remove it, and home the axes"), "{error}");
    }
    fs::write(&file, text.replace("origin", "orgin")).unwrap();
    assert!(MachineState::load(&file).is_err());
    // Nor is another digit of any number taken.
    for (place, _) in text.match_indices(|it: char| it.is_ascii_digit()) {
        let mut edited = text.clone().into_bytes();
        edited[place] = b'0' + (edited[place] - b'0' + 1) % 10;
        fs::write(&file, edited).unwrap();
        assert!(MachineState::load(&file).is_err(), "{place}");
    }
}

#[test]
fn the_console_keeps_references_beside_the_machine_file() {
    let folder = Folder::new();
    let stand = stand(0.0, 0.0);
    let stand = stand.iter().map(|(old, new)| (&**old, &**new));
    let router: Vec<_> = ABSOLUTE.into_iter().chain(stand).collect();
    let file = folder.file("machine.toml", &machine_with("router", &router));
    let console = |lines: &str| {
        let lines = File::open(folder.file("lines.txt", lines)).unwrap();
        let mut command = syncline();
        let command = command.arg("console").arg(&file).arg("--verbose");
        let output = command.stdin(lines).output().unwrap();
        let (code, told, errors) = ended(&output);
        assert_eq!(code, 0, "{told}{errors}");
        format!("{told}{errors}")
    };
    let first = console("home Y\n");
    assert!(
        first.contains("axis Y is not referenced: nothing is known of it"),
        "{first}"
    );
    let second = console("mdi G0 Y1\nmdi G0 Y0\n");
    assert!(
        second.contains("axis Y is referenced as it was before"),
        "{second}"
    );
    assert!(second.contains("axis X is not referenced"), "{second}");
    let state = MachineState::beside(&file);
    fs::write(&state, "{}").unwrap();
    let refused = syncline().arg("console").arg(&file).output().unwrap();
    let (code, _, told) = ended(&refused);
    assert_eq!(code, 2);
    assert!(
        told.contains("is not the machine's state as it was written"),
        "{told}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// However far the axis was moved without power, and whatever is allowed: it is referenced if and only if
    /// that is no more, and then shows where it really stands.
    #[test]
    fn a_reference_holds_within_its_limit_and_is_true(by in -3.0..3.0f64, limit in 0.0..3.0f64) {
        prop_assume!((by.abs() - limit).abs() > 0.01);
        let state = first_day();
        let switch = ABSOLUTE[1].1;
        let limit_key = format!("{switch}\nmoved_limit = {limit:?}");
        let stand = stand(210.0, 130.0 + by);
        let mut replacements: Vec<_> = stand.iter().map(|(old, new)| (&**old, &**new)).collect();
        replacements.push((switch, &limit_key));
        let rig = day(&state, &replacements);
        prop_assert_eq!(is_referenced(&rig, AxisLetter::Y), by.abs() < limit, "{:?}", not_recalled(&rig));
        if is_referenced(&rig, AxisLetter::Y) {
            let shown = rig.session.status().setpoint[AxisLetter::Y.index()];
            prop_assert!((shown - 130.0 - by).abs() < 0.002, "{}", shown);
        }
    }
}
