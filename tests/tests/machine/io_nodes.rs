//! An I/O node by CiA 401 beside the portal's drives: its outputs, its inputs, and what is done without it.

use proptest::prelude::*;
use proptest::sample::select;
use std::time::Duration;
use syncline_canopen::{CobId, Instant, NodeId};
use syncline_controller::control::fault::DeviceCause;
use syncline_controller::control::{End, Event, Fault, Phase, State as MachineState};
use syncline_controller::session::{self, Command, Jog, Override, SwitchChange};
use syncline_drives::bus::Transmission;
use syncline_drives::twin::cia401::Twin;
use syncline_drives::twin::{Disturbance, ErrorClass, SimulatedDevice};
use syncline_gcode::{AxisLetter, Turning};
use syncline_tests::rig::Rig;

use super::day::{go, settle, state};

/// The node's place behind the drives of the machine file.
const IO: usize = 4;

pub(super) const WIRED: &str = r#"
[[io]]
name = "cabinet"
bus = "portal"
node = 9
model = "cia401"

[spindle]
max_speed = 24000
ramp_ms = 200

[[output]]
name = "valve"
io = "cabinet"
signal = "DO1"
number = 1

[[output]]
name = "clamp"
io = "cabinet"
signal = "DO9"
active_low = true
safe = "on"
number = 2

[[output]]
name = "speed"
io = "cabinet"
signal = "AO0"
full_scale = 24000
function = "spindle_speed"

[[output]]
name = "laser"
io = "cabinet"
signal = "AO2"
full_scale = 10
safe = -1
number = 3

[[input]]
name = "enable"
io = "cabinet"
signal = "DI0"
function = "enable"

[[input]]
name = "part"
io = "cabinet"
signal = "DI12"
active_low = true
number = 5

[machine]
"#;
const ENABLE: u8 = 0;
const PART: u8 = 12;

/// Analog outputs and their full scale: the clamp is on where its output is off, the laser at a tenth.
const SAFE: (u16, [i16; 4]) = (0, [0, 0, -3277, 0]);

fn node() -> NodeId {
    NodeId::new(9).unwrap()
}

/// The portal with such a node, its enable on.
fn wired_with(more: &[(&str, &str)], program: &str) -> Rig {
    let mut replacements = vec![("[machine]\n", WIRED)];
    replacements.extend(more);
    let mut rig = Rig::new("portal", &replacements, program, |_, _| ());
    set(&mut rig, ENABLE, true);
    rig
}

fn wired(program: &str) -> Rig {
    wired_with(&[], program)
}

fn set(rig: &mut Rig, input: u8, on: bool) {
    rig.twin(IO).disturb(Disturbance::Input(input, on));
}

/// What the node puts out.
pub(super) fn outputs(rig: &mut Rig) -> (u16, [i16; 4]) {
    let twin: &mut Twin = rig.twin_as(IO);
    (twin.outputs(), twin.analog_outputs())
}

/// What it was sent, changes only, with the cycle of each: digital outputs, and the three analog ones up to the
/// last that is used.
fn sent(rig: &Rig) -> Vec<(Instant, u16, [i16; 3])> {
    let digital = rig.sent(CobId::r_pdo(1, node()));
    let analog = rig.sent(CobId::r_pdo(2, node()));
    let mut sent: Vec<_> = (digital.iter().zip(&analog))
        .map(|(digital, analog)| {
            let &[low, high] = digital.frame.data() else {
                panic!("{digital:?}");
            };
            let &[a, b, c, d, e, f] = analog.frame.data() else {
                panic!("{analog:?}");
            };
            let analog = [[a, b], [c, d], [e, f]].map(i16::from_le_bytes);
            (digital.start, u16::from_le_bytes([low, high]), analog)
        })
        .collect();
    sent.dedup_by_key(|(_, digital, analog)| (*digital, *analog));
    sent
}

fn speed(rig: &Rig) -> f64 {
    rig.rows.last().map_or(0.0, |row| row.plan.speed)
}

#[test]
fn outputs_follow_the_program_and_are_safe_before_and_behind() {
    let program = "G21 G90 F6000\nM64 P1\nG4 P0.5\nM65 P1\nM3 S12000\nM68 E3 Q10\nG1 X20\nM67 E3 Q-2.5\nG1 X30\n\
                   M64 P2 M5\nG1 X0\nM2\n";
    let mut rig = wired(program);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_eq!(outputs(&mut rig), SAFE);
    let sent = sent(&rig);
    let states: Vec<_> = sent
        .iter()
        .map(|(_, digital, analog)| (*digital, *analog))
        .collect();
    let (full, quarter) = (32767, -8192);
    // What stands at one place comes with one setpoint.
    let expected = [
        (0, [0, 0, -3277]),
        (0x0200, [0, 0, 0]),
        (0x0202, [0, 0, 0]),
        (0x0200, [16384, 0, full]),
        (0x0200, [16384, 0, quarter]),
        (0, [0, 0, quarter]),
        (0, [0, 0, -3277]),
    ];
    assert_eq!(states, expected);
    let pulse = sent.iter().position(|it| it.1 == 0x0202).unwrap();
    let length = sent[pulse + 1].0.saturating_since(sent[pulse].0);
    let cycles = length.as_nanos() / rig.machine.cycle.as_nanos();
    assert!(cycles.abs_diff(250) <= 1, "{cycles} cycles");
}

#[test]
fn its_inputs_mean_what_the_file_says_at_sync_and_by_event() {
    let by_event = (
        "model = \"cia401\"",
        "model = \"cia401\"\ninputs = \"event\"",
    );
    let by_words = (
        "[machine]\n",
        "[model.cia401]\ndigital_words = 1\n[machine]\n",
    );
    for more in [&[][..], &[by_event], &[by_words], &[by_event, by_words]] {
        let mut rig = wired_with(more, "G21 G90 F6000\nG1 X10\nM66 P5 L3 Q3\nG1 X20\nM2\n");
        set(&mut rig, PART, true);
        rig.run_until(|rig| speed(rig) > 0.0);
        rig.run_until(|rig| speed(rig) == 0.0);
        let until = rig.rows.len() + 300;
        rig.run_to_row(until);
        assert_eq!(speed(&rig), 0.0);
        set(&mut rig, PART, false);
        let came = rig.rows.len();
        rig.run_until(|rig| speed(rig) > 0.0);
        assert!(
            rig.rows.len() - came <= 8,
            "{more:?}: {} cycles",
            rig.rows.len() - came
        );
        assert_eq!(rig.finish(), End::Finished);
        let told = rig
            .frames()
            .iter()
            .filter(|it| it.frame.id() == CobId::t_pdo(1, node()).into())
            .count();
        let by_event = more.contains(&by_event);
        assert_eq!(told < rig.syncs().len() / 10, by_event, "{told} T_PDOs");
    }
}

#[test]
fn its_enable_lost_stops_all() {
    let mut rig = wired("G21 G90 F6000\nM3 S12000\nM64 P1\nG1 X400\nM2\n");
    rig.run_until(|rig| speed(rig) > 50.0);
    set(&mut rig, ENABLE, false);
    rig.run_until(|rig| rig.end().is_some());
    set(&mut rig, ENABLE, true);
    assert!(matches!(rig.finish_with_fault(), Fault::NotEnabled { .. }));
    assert!(rig.ends_at_rest());
    assert_eq!(outputs(&mut rig), SAFE);
}

/// What happens to the node, and whether it is told at once or has to be missed.
const LOSSES: [(Disturbance, &str); 3] = [
    (Disturbance::Mute(true), "heartbeat lost"),
    (Disturbance::Reset, "rebooted"),
    (Disturbance::Fault(ErrorClass::SwitchOff), "EMCY"),
];

#[test]
fn without_the_node_the_machine_stops_on_the_path_and_says_so() {
    for by_event in [false, true] {
        for (loss, _) in LOSSES {
            let more = (
                "model = \"cia401\"",
                "model = \"cia401\"\ninputs = \"event\"",
            );
            let more = if by_event { vec![more] } else { vec![] };
            let mut rig = wired_with(&more, "G21 G90 F6000\nM3 S12000\nG1 X700\nM2\n");
            rig.run_until(|rig| speed(rig) > 50.0);
            rig.twin(IO).disturb(loss);
            let fault = rig.finish_with_fault();
            let Fault::Device(IO, cause) = fault else {
                panic!("{loss:?}: {fault:?}");
            };
            if by_event && loss == Disturbance::Mute(true) {
                assert_eq!(cause, DeviceCause::HeartbeatLost);
            }
            let told = fault.describe(&*rig.layout);
            assert!(told.contains("node 9 (cabinet, CiA 401)"), "{told}");
            rig.trace().assert_within_limits();
            assert!(rig.ends_at_rest());
            let quick = |event: &&Event| matches!(event, Event::Phase(Phase::QuickStop));
            assert!(rig.events.iter().find(quick).is_none(), "{loss:?}");
        }
    }
}

#[test]
fn outputs_are_safe_within_two_cycles_of_a_fault() {
    let mut rig = wired("G21 G90 F6000\nM3 S12000\nM64 P1\nM64 P2\nG1 X400\nM2\n");
    rig.run_until(|rig| speed(rig) > 50.0);
    assert_eq!(outputs(&mut rig), (0x0002, [16384, 0, 0, 0]));
    rig.twin(0)
        .disturb(Disturbance::Fault(ErrorClass::SwitchOff));
    rig.run_until(|rig| rig.end().is_some());
    let told = rig.session.timeline().now();
    let _ = rig.finish_with_fault();
    let (safe, digital, analog) = *sent(&rig).last().expect("outputs");
    assert_eq!((digital, analog), (0, [0, 0, -3277]));
    assert!(
        safe <= told + 2 * rig.machine.cycle,
        "safe at {safe:?}, told at {told:?}"
    );
}

/// The controller is gone, in the middle of a program: the node falls back by itself once it misses its heartbeat.
#[test]
fn without_the_controller_outputs_are_safe_by_the_nodes_own_error_mode() {
    let mut rig = wired("G21 G90 F6000\nM3 S12000\nM64 P1\nM64 P2\nG1 X400\nM2\n");
    rig.run_until(|rig| speed(rig) > 50.0);
    let puts_out = outputs(&mut rig);
    assert_eq!(puts_out, (0x0002, [16384, 0, 0, 0]));
    let heartbeats = rig.sent(CobId::error_control(NodeId::new(127).unwrap()));
    let heard = heartbeats.last().expect("a heartbeat").start;
    let timeout = rig.machine.controller.heartbeat_timeout;
    let ms = Duration::from_millis(1);
    let mut now = rig.session.timeline().now();
    while now + 2 * ms < heard + timeout {
        now += ms;
        rig.session.timeline().world().advance_to(now);
        assert_eq!(outputs(&mut rig), puts_out, "{now:?}");
    }
    rig.session
        .timeline()
        .world()
        .advance_to(heard + timeout + 2 * ms);
    assert_eq!(outputs(&mut rig), SAFE);
}

/// Outputs of the spindle and the coolant, before the first input of the file.
const FUNCTIONS: (&str, &str) = (
    "[[input]]\nname = \"enable\"\nio",
    r#"[[output]]
name = "mist"
io = "cabinet"
signal = "DO2"
function = "mist"

[[output]]
name = "flood"
io = "cabinet"
signal = "DO3"
function = "flood"

[[output]]
name = "run"
io = "cabinet"
signal = "DO4"
function = "spindle"

[[output]]
name = "reverse"
io = "cabinet"
signal = "DO5"
function = "spindle_reverse"

[[input]]
name = "enable"
io"#,
);

/// What a program switches: P1, P2, E3, the spindle (the other way, its speed), the coolant by its M-code.
#[derive(Clone, Copy, Debug)]
enum Step {
    Digital(u8, bool, bool),
    Analog(bool, i8),
    Spindle(Option<(bool, u16)>),
    Coolant(u8),
    Dwell(u16),
    Move(i8),
    /// Until P5 has come on and gone off again (M66).
    Await,
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        3 => (1u8..3, any::<bool>(), any::<bool>()).prop_map(|(number, on, at_once)| Step::Digital(number, on, at_once)),
        2 => (any::<bool>(), -100i8..=100).prop_map(|(at_once, tenths)| Step::Analog(at_once, tenths)),
        2 => prop::option::of((any::<bool>(), 1u16..=24_000)).prop_map(Step::Spindle),
        2 => (7u8..=9).prop_map(Step::Coolant),
        2 => (5u16..150).prop_map(Step::Dwell),
        2 => (0i8..100).prop_map(Step::Move),
        1 => Just(Step::Await),
    ]
}

/// Digital and analog outputs.
type State = (u16, [i16; 3]);

/// States one after the other, each with the time from the beginning of the one before, if that is known, s.
type States = Vec<(State, Option<f64>)>;

/// The program, and what it puts out, one state after the other: each with the time from the beginning of the one
/// before, where only dwells are between them; and which of them begin as soon as what was awaited has come.
fn programmed(steps: &[Step]) -> (String, States, Vec<usize>) {
    let mut program = "G21 G90 G61 F6000\n".to_owned();
    // A program begins with all off, the clamp, which is active low, too.
    let mut state: State = (0x0200, [0; 3]);
    let mut states = vec![(state, None)];
    let mut with_motion: Vec<Step> = Vec::new();
    let (mut since, mut at) = (None, 0);
    // As many states as there are where the program awaits last, with nothing behind that takes time.
    let (mut awaited, mut awaits) = (Vec::new(), None);
    for &step in steps {
        let mut now = Vec::new();
        let mut moves = false;
        match step {
            Step::Digital(number, on, at_once) => {
                program += &format!(
                    "M{} P{number}\n",
                    62 + u8::from(!on) + 2 * u8::from(at_once)
                );
                let waits = if at_once { &mut now } else { &mut with_motion };
                waits.push(step);
            }
            Step::Analog(at_once, tenths) => {
                let value = f64::from(tenths) / 10.0;
                program += &format!("M{} E3 Q{value}\n", 67 + u8::from(at_once));
                let waits = if at_once { &mut now } else { &mut with_motion };
                waits.push(step);
            }
            Step::Spindle(speed) => {
                program += &speed.map_or("M5\n".into(), |(reverse, speed)| {
                    format!("M{} S{speed}\n", if reverse { 4 } else { 3 })
                });
                now.push(step);
            }
            Step::Coolant(code) => {
                program += &format!("M{code}\n");
                now.push(step);
            }
            Step::Await => {
                program += "M66 P5 L3 Q9\nM66 P5 L4 Q9\n";
                since = None;
            }
            Step::Dwell(ms) => {
                program += &format!("G4 P{}\n", f64::from(ms) / 1e3);
                since = since.map(|since| since + f64::from(ms) / 1e3);
            }
            Step::Move(to) => {
                program += &format!("G0 X{to}\n");
                moves = std::mem::replace(&mut at, to) != to;
                if moves {
                    now = std::mem::take(&mut with_motion);
                }
            }
        }
        if moves || matches!(step, Step::Dwell(_) | Step::Await) {
            awaited.extend(awaits.take().filter(|&begun| begun < states.len()));
        }
        if let Step::Await = step {
            awaits = Some(states.len());
        }
        now.into_iter().for_each(|step| put_out(&mut state, step));
        since = follow(&mut states, state, since).filter(|_| !moves);
    }
    // What stands at the end has no length otherwise; the end switches spindle and coolant off, before outputs are safe.
    put_out(&mut state, Step::Spindle(None));
    put_out(&mut state, Step::Coolant(9));
    awaited.extend(awaits.filter(|&begun| begun < states.len()));
    follow(&mut states, state, since.map(|since| since + 0.01));
    (program + "G4 P0.01\nM2\n", states, awaited)
}

/// What a step makes of the outputs.
fn put_out(state: &mut State, step: Step) {
    let scaled = |value: f64, full: f64| (value / full * 32767.0).round() as i16;
    match step {
        Step::Digital(number, on, _) => {
            let (bit, on) = if number == 1 {
                (0x0002, on)
            } else {
                (0x0200, !on)
            };
            state.0 = state.0 & !bit | if on { bit } else { 0 };
        }
        Step::Analog(_, tenths) => state.1[2] = scaled(f64::from(tenths) / 10.0, 10.0),
        Step::Spindle(turning) => {
            let speed = turning.map_or(0.0, |(_, speed)| speed.into());
            state.1[0] = scaled(speed, 24_000.0);
            let bits = turning.map_or(0, |(reverse, _)| 0x10 | if reverse { 0x20 } else { 0 });
            state.0 = state.0 & !0x30 | bits;
        }
        Step::Coolant(7) => state.0 |= 0x04,
        Step::Coolant(8) => state.0 |= 0x08,
        Step::Coolant(_) => state.0 &= !0x0C,
        Step::Dwell(_) | Step::Move(_) | Step::Await => {}
    }
}

/// The state of the outputs as the session shows it.
fn shown_outputs(rig: &Rig) -> State {
    let status = rig.session.status();
    let mut state = (0, [0; 3]);
    put_out(&mut state, Step::Digital(1, status.outputs[0], true));
    put_out(&mut state, Step::Digital(2, status.outputs[1], true));
    for (on, bit) in status.outputs[2..].iter().zip([0x04, 0x08, 0x10, 0x20]) {
        state.0 |= if *on { bit } else { 0 };
    }
    let analog = rig
        .machine
        .analog_outputs
        .iter()
        .zip(&status.analog_outputs);
    let analog: Vec<_> = analog
        .map(|(output, &value)| output.scaled(value))
        .collect();
    (state.1[0], state.1[2]) = (analog[0], analog[1]);
    state
}

/// A state behind the others, `since` the last one of them began; since when the last of all has been then. What
/// stands at one place comes with one setpoint, and what does not change anything does not show.
fn follow(states: &mut States, state: State, since: Option<f64>) -> Option<f64> {
    let (last, before) = *states.last().expect("the first one");
    if last == state {
        return since;
    }
    if since != Some(0.0) {
        states.push((state, since));
        return Some(0.0);
    }
    states.pop();
    match states.last() {
        Some((earlier, _)) if *earlier == state => before,
        _ => {
            states.push((state, before));
            since
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// Whatever a program switches, and wherever: every state comes, in order, and lasts as long as the program dwells
    /// in it, to one cycle, or until what it awaits in it has come; and whoever looks is shown the same.
    #[test]
    fn outputs_come_in_program_order_with_the_dwells_between_them(steps in prop::collection::vec(step(), 0..16)) {
        let (program, expected, awaited) = programmed(&steps);
        let mut rig = wired_with(&[FUNCTIONS], &program);
        // Before the first cycle that sends any they are shown as off.
        let mut shown = vec![shown_outputs(&rig)];
        let mut was_on = None;
        while rig.step() {
            shown.push(shown_outputs(&rig));
            // P5, which is active low, goes off with every tenth of a second.
            let is_on = since_off(rig.session.timeline().now()) >= 50;
            if was_on.replace(is_on) != Some(is_on) {
                set(&mut rig, PART, !is_on);
            }
        }
        prop_assert_eq!(rig.end(), Some(End::Finished), "{}{:?}", program, rig.events);
        shown.dedup();
        let sent = sent(&rig);
        let states: Vec<State> = sent.iter().map(|(_, digital, analog)| (*digital, *analog)).collect();
        let safe = (SAFE.0, [SAFE.1[0], SAFE.1[1], SAFE.1[2]]);
        let wanted: Vec<State> = expected.iter().map(|(state, _)| *state).collect();
        let mut all = [&[safe][..], &wanted, &[safe]].concat();
        all.dedup();
        prop_assert_eq!(&states, &all, "{}", program);
        prop_assert_eq!(&shown[1..], &all, "{}", program);
        let cycle = rig.machine.cycle.as_secs_f64();
        // The first one is that before the program.
        for (place, (_, since)) in expected.iter().enumerate() {
            let length = sent[place + 1].0.saturating_since(sent[place].0).as_secs_f64();
            if let Some(since) = since {
                prop_assert!((length - since).abs() <= cycle * 1.01, "{} s, not {}: {}", length, since, program);
            }
        }
        for place in awaited {
            let late = since_off(sent[place + 1].0);
            prop_assert!(late <= 12, "state {} came {} ms behind P5: {}", place, late, program);
        }
    }
}

/// Since when P5 of the property is off, or was before it came on, ms.
fn since_off(now: Instant) -> u64 {
    now.as_nanos() / 1_000_000 % 100
}

/// The portal with such a node, staying on, and a spindle's output besides.
pub(super) fn staying_on() -> Rig {
    staying_on_with("")
}

/// The same, with more of these in its machine file.
pub(super) fn staying_on_with(more: &str) -> Rig {
    const TURNS: &str = "\n[[output]]\nname = \"turns\"\nio = \"cabinet\"\nsignal = \"DO3\"\nfunction = \"spindle\"\n\n[machine]\n";
    let mut rig = switched_on_with(&format!("{more}{}", TURNS.trim_start()));
    settle(&mut rig);
    rig
}

/// The portal with such a node and these in its machine file, as it begins to come up.
fn switched_on_with(more: &str) -> Rig {
    let wired = WIRED.replace("[machine]\n", more);
    let mut rig = Rig::staying_on("portal", &[("[machine]\n", &wired)], |_, _| ());
    set(&mut rig, ENABLE, true);
    rig
}

pub(super) fn output(name: &str, on: bool) -> Command {
    let name = name.to_owned();
    Command::Output { name, on }
}

/// Digital outputs, a few cycles later.
fn digital_after(rig: &mut Rig, command: Command) -> u16 {
    rig.command(command);
    (0..12).for_each(|_| assert!(rig.step()));
    outputs(rig).0
}

#[test]
fn outputs_are_switched_by_hand_where_the_machine_rests() {
    let mut rig = staying_on();
    let (valve, clamp_is_off) = (0x0002, 0x0200);
    assert_eq!(outputs(&mut rig).0, SAFE.0);
    // The others keep their safe values.
    assert_eq!(digital_after(&mut rig, output("valve", true)), valve);
    let text = "G91 G1 X20 F600\nM65 P1\nG1 X-20\nM2\n";
    let file = rig.folder.file("part.ngc", text);
    rig.command(Command::Load(file));
    // A program begins with what was switched by hand, and switches it as it likes.
    let run = Command::Run { from_line: None };
    assert_eq!(digital_after(&mut rig, run), valve | clamp_is_off);
    assert_eq!(
        digital_after(&mut rig, output("valve", false)),
        valve | clamp_is_off
    );
    let refused = rig.refused.pop().unwrap().reason.to_string();
    assert!(
        refused.starts_with("no switching of outputs by hand while the machine is running"),
        "{refused}"
    );
    rig.command(Command::FeedHold);
    rig.run_until(|rig| state(rig) == MachineState::Held);
    assert_eq!(digital_after(&mut rig, output("clamp", true)), valve);
    assert_eq!(
        digital_after(&mut rig, output("valve", false)),
        0,
        "{:?}",
        rig.refused
    );
    // Going on it is what the program made of it.
    let on = digital_after(&mut rig, Command::Resume);
    assert_eq!(on, valve | clamp_is_off);
    rig.run_until(|rig| rig.session.status().line == 3);
    assert_eq!(outputs(&mut rig).0, clamp_is_off);
    settle(&mut rig);
    assert_eq!(outputs(&mut rig).0, SAFE.0);
    digital_after(&mut rig, output("valve", true));
    assert_eq!(digital_after(&mut rig, Command::Disable), SAFE.0);
    go(&mut rig, Command::Enable);
    assert_eq!(outputs(&mut rig).0, SAFE.0);
    for (name, why) in [
        ("turns", "output \"turns\" is the spindle's"),
        ("door", "no output \"door\"; allowed: valve, clamp, turns"),
    ] {
        assert_eq!(digital_after(&mut rig, output(name, true)), SAFE.0);
        let refused = rig.refused.pop().unwrap().reason.to_string();
        assert!(refused.contains(why), "{refused}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// A typed line that is wrong switches nothing, whatever overrides and single block are.
    #[test]
    fn a_wrong_line_switches_nothing(
        feed in select(vec![20.0, 100.0, 130.0]), rapid in select(vec![50.0, 100.0]), single: bool,
        before in select(vec!["M64 P1", "M8 M64 P2", "M3 S500\nM64 P1", "M65 P1"]),
        wrong in select(vec!["G1 X", "G999", "G1 X1e9 F100", "o<x> call", "M64 P99", "G2 X1", "G41 D99"]),
        waits in 0..40usize,
    ) {
        let mut rig = staying_on();
        go(&mut rig, Command::FeedOverride(Override::To(feed)));
        go(&mut rig, Command::RapidOverride(Override::To(rapid)));
        go(&mut rig, Command::SingleBlock(SwitchChange::To(single)));
        go(&mut rig, Command::Mdi(before.to_owned()));
        for _ in 0..20 {
            if state(&rig) == MachineState::Held {
                go(&mut rig, Command::Resume);
            }
        }
        prop_assert_eq!(state(&rig), MachineState::Ready, "{:?}", rig.events);
        let on = outputs(&mut rig);
        let told = rig.events.len();
        rig.command(Command::Mdi(wrong.to_owned()));
        for _ in 0..waits + 10 {
            rig.step();
            prop_assert_eq!(outputs(&mut rig), on, "{}", wrong);
        }
        settle(&mut rig);
        prop_assert!(!rig.problems.is_empty(), "{} is right", wrong);
        prop_assert_eq!(outputs(&mut rig), on, "{}", wrong);
        prop_assert_eq!(state(&rig), MachineState::Ready);
        let switched = |event: &Event| matches!(event, Event::Output { .. } | Event::AnalogOutput { .. });
        prop_assert!(!rig.events[told..].iter().any(switched), "{:?}", &rig.events[told..]);
    }
}

/// What an operator does.
fn deed() -> impl Strategy<Value = Command> {
    let hand = (select(vec!["valve", "clamp"]), any::<bool>());
    let jog = Command::Jog(Jog::By {
        axis: AxisLetter::X,
        distance: 5.0,
        speed: None,
    });
    let others = vec![
        Command::Run { from_line: None },
        Command::Run { from_line: None },
        Command::FeedHold,
        Command::FeedHold,
        Command::Resume,
        Command::CycleStart,
        jog,
        Command::Stop,
        Command::Disable,
        Command::Enable,
        Command::Mdi("M64 P1".to_owned()),
        Command::Mdi("M65 P2\nG4 P0.1".to_owned()),
    ];
    prop_oneof![1 => hand.prop_map(|(name, on)| output(name, on)), 1 => select(others)]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// Whatever is done and whenever: where the machine rests what was switched by hand stays until a stop, everywhere else
    /// outputs are the program's, or safe.
    #[test]
    fn by_hand_nothing_is_switched_but_where_the_machine_rests(
        deeds in prop::collection::vec((deed(), 1..400usize), 1..24),
    ) {
        let mut rig = staying_on();
        rig.goes_on = false;
        let text = "G91 G1 X20 F3000\nM64 P1\nG1 X-20\nM64 P2\nM0\nM65 P1\nG1 X10\nG1 X-10\nM65 P2\nG4 P0.3\nM2\n";
        let file = rig.folder.file("part.ngc", text);
        rig.command(Command::Load(file));
        let told = rig.session.subscribe();
        let mut before_row = (MachineState::Ready, Vec::new(), rig.rows.len());
        // By output: what it was switched to by hand since the machine has rested.
        let mut by_hand = [None; 2];
        for (deed, wait) in deeds {
            rig.command(deed);
            for _ in 0..wait {
                let before = state(&rig);
                rig.step();
                let now = state(&rig);
                let rests = matches!(now, MachineState::Ready | MachineState::Jogging | MachineState::Held);
                if !rests {
                    by_hand = [None; 2];
                }
                for event in told.events() {
                    let session::Event::Accepted(it) = event else {
                        continue;
                    };
                    match it.command {
                        Command::Output { name, on } => {
                            by_hand[usize::from(name == "clamp")] = Some(on);
                        }
                        Command::Stop => by_hand = [None; 2],
                        _ => {}
                    }
                }
                // What happens within a cycle shows at its end.
                if before != now {
                    continue;
                }
                let shown = &rig.session.status().outputs;
                match now {
                    MachineState::Ready | MachineState::Jogging | MachineState::Held => {
                        for (output, on) in by_hand.iter().enumerate() {
                            prop_assert!(on.is_none_or(|on| on == shown[output]), "{:?}, {:?}", by_hand, shown);
                        }
                    }
                    MachineState::Running | MachineState::Mdi => {
                        // A row has what was switched before it.
                        let (was, shown, rows) = &before_row;
                        if *was == now && rig.rows.len() > *rows {
                            let functions = rig.rows[*rows].functions;
                            let programmed = [1, 2].map(|number| functions.outputs.digital >> number & 1 != 0);
                            prop_assert_eq!(&shown[..2], &programmed);
                        }
                    }
                    MachineState::Disabled | MachineState::Faulted => {
                        prop_assert_eq!(&shown[..2], &[false, true]);
                    }
                    _ => {}
                }
                before_row = (now, rig.session.status().outputs.clone(), rig.rows.len());
            }
        }
    }
}

/// What makes a machine safe whose spindle was switched on by a typed line.
#[derive(Clone, Copy, Debug)]
enum Safe {
    Disabled,
    Stopped,
    StoppedInJog,
    Enable,
    Held,
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 10, ..ProptestConfig::default() })]

    /// Once outputs were made safe nothing but an M-code switches spindle and coolant on again: no S, no line, no program
    /// that has none.
    #[test]
    fn what_was_made_safe_stays_off(
        how in select(vec![Safe::Disabled, Safe::Stopped, Safe::StoppedInJog, Safe::Enable, Safe::Held]),
        on in select(vec!["M3 S5000", "M4 S800\nM8", "M7", "M64 P1\nM3 S5000"]),
        behind in select(vec!["S7000", "G91 G1 X1 F600 S900", "M9\nS200", "M65 P1\nS300"]),
        runs: bool,
        waits in 0..300usize,
    ) {
        let mut rig = staying_on();
        rig.goes_on = false;
        if let Safe::Held = how {
            let text = "M64 P1\nM3 S6000\nG91 G1 X20 F1200\nG1 X-20\nM2\n";
            let file = rig.folder.file("held.ngc", text);
            rig.command(Command::Load(file));
            rig.command(Command::Run { from_line: None });
            for _ in 0..700 {
                rig.step();
            }
            go(&mut rig, Command::FeedHold);
            prop_assert_eq!(state(&rig), MachineState::Held);
        }
        go(&mut rig, Command::Mdi(on.to_owned()));
        for _ in 0..waits {
            rig.step();
        }
        match how {
            Safe::Disabled => go(&mut rig, Command::Disable),
            Safe::Stopped | Safe::Held => go(&mut rig, Command::Stop),
            Safe::StoppedInJog => {
                let (axis, distance, speed) = (AxisLetter::X, 5.0, Some(2.0));
                rig.command(Command::Jog(Jog::By { axis, distance, speed }));
                for _ in 0..40 {
                    rig.step();
                }
                prop_assert_eq!(state(&rig), MachineState::Jogging);
                go(&mut rig, Command::Stop);
            }
            Safe::Enable => {
                set(&mut rig, ENABLE, false);
                settle(&mut rig);
                set(&mut rig, ENABLE, true);
                settle(&mut rig);
                go(&mut rig, Command::Reset);
            }
        }
        prop_assert_eq!(outputs(&mut rig), SAFE, "{:?}", state(&rig));
        if state(&rig) == MachineState::Disabled {
            go(&mut rig, Command::Enable);
        }
        prop_assert_eq!(state(&rig), MachineState::Ready, "{:?}", rig.events);
        prop_assert_eq!(outputs(&mut rig), SAFE);
        if runs {
            let file = rig.folder.file("then.ngc", &format!("{behind}\nG91 G1 X1 F600\nM2\n"));
            rig.command(Command::Load(file));
            rig.command(Command::Run { from_line: None });
        } else {
            rig.command(Command::Mdi(behind.to_owned()));
        }
        for _ in 0..400 {
            rig.step();
            let status = rig.session.status();
            prop_assert_eq!(status.spindle.turning, Turning::Off);
            prop_assert!(!status.coolant.flood && !status.coolant.mist);
            let (_, [speed, ..]) = outputs(&mut rig);
            prop_assert_eq!(speed, 0);
        }
        prop_assert_eq!(state(&rig), MachineState::Ready);
    }

    /// A typed line switches what it names, and nothing else: what is safe stays so.
    #[test]
    fn typed_lines_switch_what_they_name(
        lines in prop::collection::vec(select(vec![
            ("G91 G1 X1 F600", None), ("G1 X1e9 F100", None), ("G54", None), ("(MSG, x)", None), ("M3 S500", None),
            ("M64 P1", Some((0, true))), ("M65 P1", Some((0, false))), ("M64 P2", Some((1, true))),
            ("M65 P2", Some((1, false))), ("M62 P2", Some((1, true))),
        ]), 1..6),
    ) {
        let mut rig = staying_on();
        let mut on = [false, true];
        for (line, switches) in lines {
            go(&mut rig, Command::Mdi(line.to_owned()));
            // At a motion, which does not come.
            if let Some((output, switched)) = switches && !line.starts_with("M62") {
                on[output] = switched;
            }
            prop_assert_eq!(&rig.session.status().outputs[..2], &on, "{}", line);
            let (digital, analog) = outputs(&mut rig);
            prop_assert_eq!((digital >> 9 & 1 == 0, analog[2]), (on[1], SAFE.1[2]), "{}", line);
        }
        go(&mut rig, Command::Stop);
        prop_assert_eq!(outputs(&mut rig), SAFE);
    }
}

/// What keeps a machine from coming up.
#[derive(Clone, Copy, Debug)]
enum Kept {
    Disabled,
    /// A drive is not heard any more.
    Mute,
    /// The I/O node's enable goes.
    Enable,
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

    /// A machine that does not come up has safe outputs once its devices are known: also one that is safe where its terminal is
    /// on, of which a node that hears no R_PDO yet knows nothing.
    #[test]
    fn a_machine_that_does_not_come_up_has_safe_outputs(
        phase in select(vec![
            Phase::Boot, Phase::SetUp, Phase::Start, Phase::Lock, Phase::Disabled, Phase::ReadyToSwitchOn,
            Phase::OperationEnabled, Phase::ModeStart,
        ]),
        kept in select(vec![Kept::Disabled, Kept::Mute, Kept::Enable]),
        wake_ups in prop_oneof![0..4usize, 0..60usize],
    ) {
        const LAMP: &str = "\n[[output]]\nname = \"lamp\"\nio = \"cabinet\"\nsignal = \"DO5\"\nsafe = \"on\"\nnumber = 9\n\n[machine]\n";
        let mut rig = switched_on_with(LAMP.trim_start());
        rig.run_to(phase);
        for _ in 0..wake_ups {
            rig.step();
        }
        // What is written to it comes behind its identity.
        let is_download = |sent: &Transmission| sent.frame.data()[0] >> 5 == 1;
        let is_known = rig.sent(CobId::r_sdo(node())).iter().any(is_download);
        match kept {
            Kept::Disabled => rig.command(Command::Disable),
            Kept::Mute => rig.twin(2).disturb(Disturbance::Mute(true)),
            Kept::Enable => set(&mut rig, ENABLE, false),
        }
        // What falls away shows some cycles later.
        for _ in 0..10 {
            rig.step();
        }
        settle(&mut rig);
        let state = state(&rig);
        prop_assert!(matches!(state, MachineState::Disabled | MachineState::Faulted), "{:?}", state);
        let (digital, analog) = SAFE;
        let seen = outputs(&mut rig);
        prop_assert!(!is_known || seen == (digital | 1 << 5, analog), "{:?}: {:?}", state, seen);
        // Nothing is said of outputs of which the node was told nothing.
        let said = rig.events.iter().any(|it| matches!(it, Event::Output { on: true, .. }));
        prop_assert!(!said || outputs(&mut rig).0 & 1 << 5 != 0, "{:?}", rig.events);
    }
}

/// Enabling switches nothing on that typed lines left on before the drives were disabled.
#[test]
fn enabling_switches_nothing_on() {
    let mut rig = staying_on();
    go(&mut rig, Command::Mdi("M64 P1\nM3 S12000".to_owned()));
    assert_eq!(outputs(&mut rig).0 & 0x000A, 0x000A);
    go(&mut rig, Command::Disable);
    assert_eq!(outputs(&mut rig), SAFE);
    assert_eq!(rig.session.status().spindle.turning, Turning::Off);
    go(&mut rig, Command::Enable);
    assert_eq!(state(&rig), MachineState::Ready);
    assert_eq!(outputs(&mut rig), SAFE);
}

/// Before the first move nothing leads back, and what the path waits for is still there behind a retrace: an operator, an input, the
/// confirmation that the program begins in its middle.
#[test]
fn a_retrace_where_nothing_leads_back_keeps_what_is_awaited() {
    let beginnings = [
        ("M0", None),
        ("M6 T2", None),
        ("M66 P5 L3 Q30", None),
        ("M64 P1\nG4 P0.2\nM1", None),
        ("G1 X0\nG1 X0", Some(4)),
    ];
    for (beginning, from_line) in beginnings {
        for (retraced, resumed) in [(40, 0), (40, 1), (40, 60), (300, 0), (300, 300), (1, 1)] {
            let mut rig = staying_on();
            rig.goes_on = false;
            rig.command(Command::OptionalStop(SwitchChange::To(true)));
            set(&mut rig, PART, true);
            let text = format!("G21 G90 G61 F3000\n{beginning}\nM64 P2\nG1 X5\nM2\n");
            let file = rig.folder.file("part.ngc", &text);
            rig.command(Command::Load(file));
            rig.command(Command::Run { from_line });
            let steps = |rig: &mut Rig, wake_ups: usize| {
                (0..wake_ups).for_each(|_| assert!(rig.step()));
            };
            steps(&mut rig, retraced);
            rig.command(Command::Retrace);
            steps(&mut rig, resumed);
            rig.command(Command::Resume);
            steps(&mut rig, 600);
            let case = format!("{beginning} {retraced} {resumed}: {:?}", rig.events);
            let at = |rig: &Rig| rig.session.status().setpoint[0];
            assert!(at(&rig).abs() < 1e-3, "{case}");
            assert_ne!(state(&rig), MachineState::Ready, "{case}");
            let clamp_is_off = outputs(&mut rig).0 & 0x0200 != 0;
            let is_entered = from_line.is_some();
            assert!(clamp_is_off || is_entered, "{case}");
            set(&mut rig, PART, false);
            rig.command(Command::CycleStart);
            steps(&mut rig, 600);
            assert!((at(&rig) - 5.0).abs() < 1e-3, "{case}");
        }
    }
}

/// A drive that falls silent before the first burst keeps all R_PDOs from going out: an I/O node that was started by then is told
/// what its outputs are by SDO.
#[test]
fn an_io_node_that_was_never_sent_an_r_pdo_is_told_its_safe_outputs() {
    const LAMP: &str = "\n[[output]]\nname = \"lamp\"\nio = \"cabinet\"\nsignal = \"DO5\"\nsafe = \"on\"\nnumber = 9\n\n[machine]\n";
    let mut rig = switched_on_with(LAMP.trim_start());
    rig.run_to(Phase::Start);
    rig.twin(2).disturb(Disturbance::Mute(true));
    for _ in 0..10 {
        rig.step();
    }
    settle(&mut rig);
    assert_eq!(state(&rig), MachineState::Faulted);
    let (digital, analog) = SAFE;
    assert_eq!(outputs(&mut rig), (digital | 1 << 5, analog));
}
