//! Analog inputs of an I/O node, and what M66 tells a program: by `#5399`, by name, in the status and the trace.

use proptest::prelude::*;
use std::fmt::Write as _;
use std::time::Duration;
use syncline_canopen::{CanId, CobId, NodeId};
use syncline_controller::control::{End, Event, Pause};
use syncline_controller::session::Command;
use syncline_drives::twin::Disturbance;
use syncline_drives::twin::cia401::Twin;
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::rig::Rig;

use super::day::{mdi, settle};

/// The node's place behind the drives of the machine file.
const IO: usize = 4;

const WIRED: &str = r#"
[[io]]
name = "cabinet"
bus = "portal"
node = 9
model = "cia401"

[[input]]
name = "Pressure"
io = "cabinet"
signal = "AI2"
full_scale = 10
number = 3

[[input]]
name = "force"
io = "cabinet"
signal = "AI0"
full_scale = 500
number = 0

[[input]]
name = "part"
io = "cabinet"
signal = "DI4"
number = 5

[machine]
"#;
const PART: u8 = 4;
const PRESSURE: u8 = 2;
const FORCE: u8 = 0;

const BY_EVENT: (&str, &str) = (
    "model = \"cia401\"\n",
    "model = \"cia401\"\ninputs = \"event\"\n",
);

fn wired(more: &[(&str, &str)], program: &str) -> Rig {
    let mut replacements = vec![("[machine]\n", WIRED)];
    replacements.extend(more);
    let mut rig = Rig::new("portal", &replacements, program, |_, _| ());
    rig.goes_on = false;
    rig
}

fn set(rig: &mut Rig, input: u8, value: i16) {
    rig.twin_as::<Twin>(IO).set_analog_input(input, value);
}

/// What a value of the device is of a full scale.
fn part_of(value: i16) -> f64 {
    f64::from(value) / 32767.0
}

fn x(rig: &Rig) -> f64 {
    rig.rows.last().map_or(0.0, |row| row.plan.position[0])
}

#[test]
fn programs_read_them_at_their_place() {
    let program = "G21 G90 F6000\nG1 X100\nM66 E3 L0\nG1 X[200 + #5399]\nG1 X[300 + #<_hal[force]>]\nM66 E0\n\
                   (debug, #5399 #<_hal[pressure]>)\nM2\n";
    for more in [&[][..], &[BY_EVENT]] {
        let mut rig = wired(more, program);
        set(&mut rig, PRESSURE, -32767);
        rig.run_until(|rig| x(rig) > 90.0);
        // What counts is what it is where the path rests.
        set(&mut rig, PRESSURE, 16384);
        rig.run_until(|rig| x(rig) > 190.0);
        set(&mut rig, FORCE, 3277);
        set(&mut rig, PRESSURE, 32767);
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let rests = [200.0 + 10.0 * part_of(16384), 300.0 + 500.0 * part_of(3277)];
        for rest in rests {
            let there = rig.rows.iter().any(|row| row.plan.position[0] == rest);
            assert!(there, "never at {rest}");
        }
        assert_eq!(rig.messages.last().unwrap().1, "50.004578 10");
        let [pressure, force] = [10.0, 500.0 * part_of(3277)];
        let row = rig.rows.last().unwrap();
        assert_eq!(row.analog_inputs[..3], [pressure, force, 0.0]);
        assert_eq!(rig.session.status().analog_inputs, [pressure, force]);
        // Three of them, up to the last in use; by event only what changes, and now and then.
        let t_pdo = CanId::from(CobId::t_pdo(2, NodeId::new(9).unwrap()));
        let mut told = rig.frames();
        told.retain(|sent| sent.frame.id() == t_pdo);
        assert!(told.iter().all(|sent| sent.frame.data().len() == 6));
        let cycles = rig.rows.len();
        match more.is_empty() {
            true => assert!(told.len() > cycles, "{} in {cycles}", told.len()),
            false => assert!(told.len() < cycles / 10, "{} in {cycles}", told.len()),
        }
    }
}

/// Whatever is wired to a simulated one, a program reads what it is then: a constant, or a course over time.
#[test]
fn simulated_ones_are_what_the_machine_file_says() {
    let pressure = ("number = 3\n", "number = 3\nsimulated = [[0, 7.5]]\n");
    let force = (
        "number = 0\n",
        "number = 0\nsimulated = [[0, -100], [6, 500]]\n",
    );
    let program = "G21 G90 F6000\nG1 X10\nM66 E3 L0\n(debug, #5399)\nM66 E0 L0\n(debug, #5399)\nG4 P2\n\
                   M66 E0 L0\n(debug, #<_hal[force]>)\nG4 P20\nM66 E0 L0\n(debug, #5399)\nM2\n";
    for more in [&[pressure, force][..], &[pressure, force, BY_EVENT]] {
        let mut rig = wired(more, program);
        assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let told = rig.messages.iter().map(|it| it.1.parse::<f64>().unwrap());
        let told: Vec<f64> = told.collect();
        let [pressure, soon, later, last] = told[..] else {
            panic!("{told:?}")
        };
        assert!((pressure - 7.5).abs() < 1e-3, "{told:?}");
        assert!(
            soon >= -100.0 && (later - soon - 200.0).abs() < 3.0,
            "{told:?}"
        );
        assert!((last - 500.0).abs() < 0.02, "{told:?}");
        // Each row has what was told at its SYNC: 100 a second, and by event up to a cycle later.
        let mut rows = rig.rows.windows(2);
        let most = 2.0 * 100.0 * rig.machine.cycle.as_secs_f64() + 0.02;
        assert!(rows.all(|it| {
            let step = it[1].analog_inputs[1] - it[0].analog_inputs[1];
            (0.0..=most).contains(&step)
        }));
    }
}

/// A program that asks at once goes on with -1; one that does not is the operator's, who goes on, and it finds -1 later.
#[test]
fn a_time_out_is_the_programs_where_it_asks() {
    let paused = |rig: &mut Rig| {
        let told = |it: &Event| {
            matches!(
                it,
                Event::Paused {
                    reason: Pause::NoInput(5),
                    ..
                }
            )
        };
        rig.events.iter().any(told)
    };
    let mut rig = wired(
        &[],
        "G21 G90 F6000\nG1 X10\nM66 P5 L3 Q0.5\no1 if [#5399 LT 0]\nG1 X20\no1 else\nG1 X30\no1 endif\nM2\n",
    );
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert!(!paused(&mut rig) && x(&rig) == 20.0);

    let mut rig = wired(
        &[],
        "G21 G90 F6000\nG1 X10\nM66 P5 L3 Q0.5\nG1 X20\nG1 X[30 + #5399]\nM2\n",
    );
    rig.run_until(paused);
    assert_eq!(x(&rig), 10.0);
    rig.command(Command::CycleStart);
    assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
    assert_eq!(x(&rig), 29.0);
}

#[test]
fn what_a_typed_line_found_the_next_one_knows() {
    let mut rig = Rig::staying_on("portal", &[("[machine]\n", WIRED)], |_, _| ());
    settle(&mut rig);
    rig.twin(IO).disturb(Disturbance::Input(PART, true));
    mdi(&mut rig, "M66 P5 L0");
    rig.twin(IO).disturb(Disturbance::Input(PART, false));
    mdi(&mut rig, "G1 F6000 X[3 + #5399]");
    assert_eq!(x(&rig), 4.0);
}

/// Without the node's T_PDO2 nothing is known, and it is missed as any other, also where it is the only one.
#[test]
fn a_node_that_does_not_tell_them_is_a_fault() {
    let alone = (
        "[[input]]\nname = \"part\"\nio = \"cabinet\"\nsignal = \"DI4\"\nnumber = 5\n\n",
        "",
    );
    for more in [&[][..], &[alone]] {
        let mut rig = wired(more, "G21 G90 F6000\nG1 X300\nM2\n");
        rig.run_until(|rig| x(rig) > 50.0);
        rig.twin(IO).disturb(Disturbance::Mute(true));
        let fault = rig.finish_with_fault().describe(&*rig.layout);
        assert!(
            fault.contains("cabinet") && fault.contains("no T_PDO"),
            "{fault}"
        );
    }
}

#[test]
fn the_budget_and_the_trace_have_them() {
    let folder = Folder::new();
    let machine = folder.file(
        "machine.toml",
        &machine_with("portal", &[("[machine]\n", WIRED)]),
    );
    let part = folder.file(
        "part.ngc",
        "G21 G90 F6000\nG1 X10\nM66 E3 L0\nG1 X[20 + #5399]\nM2\n",
    );
    let trace = folder.path("trace.csv");
    let output = |arguments: &[&std::ffi::OsStr]| {
        let output = syncline().args(arguments).output().expect("it can be run");
        let (code, printed, told) = ended(&output);
        assert_eq!(code, 0, "{told}");
        printed.to_owned()
    };
    let printed = output(&["budget".as_ref(), machine.as_ref()]);
    assert!(printed.contains("289h"), "{printed}");
    let arguments = ["validate".as_ref(), "--trace".as_ref(), trace.as_os_str()];
    output(&[&arguments[..], &[machine.as_ref(), part.as_ref()]].concat());
    let trace = std::fs::read_to_string(&trace).unwrap();
    let header = trace.lines().next().unwrap();
    assert!(
        header.ends_with(",analog_input_3,analog_input_0"),
        "{header}"
    );
    assert!(trace.lines().nth(1).unwrap().ends_with(",0,0"));
}

/// An input of one of two nodes: which node and place, and what is there, a share of its full scale.
type Wired = (usize, usize, f64);

/// No two at the same place.
fn at_two_nodes() -> impl Strategy<Value = Vec<Wired>> {
    let places: Vec<_> = (0..2)
        .flat_map(|node| (0..4).map(move |place| (node, place)))
        .collect();
    let count = places.len();
    (prop::sample::subsequence(places, 2..=count).prop_shuffle())
        .prop_flat_map(|places| {
            let shares = prop::collection::vec(-1.0..=1.0f64, places.len());
            (Just(places), shares)
        })
        .prop_map(|(places, shares)| {
            let wired = places.into_iter().zip(shares);
            wired
                .map(|((node, place), share)| (node, place, share))
                .collect()
        })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 6, ..ProptestConfig::default() })]

    /// Whichever are wired to which of two nodes: each is what its own node tells at its own place, for a program by
    /// number and by name, and in the status.
    #[test]
    fn each_is_told_by_its_own_node(wired in at_two_nodes(), by_event: [bool; 2]) {
        let mut text = String::new();
        for (node, by_event) in by_event.into_iter().enumerate() {
            let inputs = if by_event { "event" } else { "sync" };
            write!(
                text,
                "[[io]]\nname = \"io{node}\"\nbus = \"portal\"\nnode = {}\nmodel = \"cia401\"\ninputs = \"{inputs}\"\n\n",
                9 + node
            )
            .unwrap();
        }
        let mut program = "G21\n".to_owned();
        let mut is = Vec::new();
        for (number, &(node, place, share)) in wired.iter().enumerate() {
            let full_scale = 10.0 * (number + 1) as f64;
            is.push(full_scale * share);
            write!(
                text,
                "[[input]]\nname = \"in{number}\"\nio = \"io{node}\"\nsignal = \"AI{place}\"\nfull_scale = {full_scale}\n\
                 number = {number}\nsimulated = [[0, {}]]\n\n",
                full_scale * share
            )
            .unwrap();
            write!(program, "M66 E{number} L0\n(debug, #5399)\n(debug, #<_hal[in{number}]>)\n").unwrap();
        }
        program += "M2\n";
        let mut rig = Rig::new("portal", &[("[machine]\n", &*(text + "[machine]\n"))], &program, |_, _| ());
        prop_assert_eq!(rig.finish(), End::Finished, "{:?}", rig.events);
        let told: Vec<f64> = rig.messages.iter().map(|it| it.1.parse().unwrap()).collect();
        let status = &rig.session.status().analog_inputs;
        prop_assert_eq!((told.len(), status.len()), (2 * is.len(), is.len()));
        for (number, is) in is.into_iter().enumerate() {
            for told in [told[2 * number], told[2 * number + 1], status[number]] {
                prop_assert!((told - is).abs() < 0.01, "in{}: {} for {}", number, told, is);
            }
        }
    }
}

#[derive(Clone, Copy, Debug)]
enum Step {
    Move(u8),
    /// M66 with L0, of the digital input or of one of the analog ones.
    Take(Option<bool>),
    /// M66 with this L, whose input is there or never comes.
    Await(u8),
    /// Moves X by what was found.
    Read,
    Dwell,
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        2 => (1u8..40).prop_map(Step::Move),
        2 => any::<Option<bool>>().prop_map(Step::Take),
        2 => (3u8..5).prop_map(Step::Await),
        4 => Just(Step::Read),
        1 => Just(Step::Dwell),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 12, ..ProptestConfig::default() })]

    /// Whatever it takes and waits for, and wherever it asks, whatever an operator does meanwhile: it is told what the last
    /// M66 found.
    #[test]
    fn each_block_is_told_what_the_last_m66_found(
        steps in prop::collection::vec(step(), 1..12),
        part: bool,
        values: [i16; 2],
        by_event: bool,
        held in prop::collection::vec(1usize..300, 0..3),
    ) {
        let mut text = "G21 G90 F9000\n#1 = 500\nG1 X#1\n".to_owned();
        let (mut x, mut found) = (500.0, 0.0);
        let mut places = Vec::new();
        for step in steps {
            match step {
                Step::Move(by) => {
                    x += f64::from(by);
                    write!(text, "#1 = [#1 + {by}]\nG1 X#1\nG4 P0.02\n").unwrap();
                    places.push(x);
                }
                Step::Take(which) => {
                    let (word, is) = match which {
                        None => ("P5", f64::from(u8::from(part))),
                        Some(true) => ("E3", 10.0 * part_of(values[0])),
                        Some(false) => ("E0", 500.0 * part_of(values[1])),
                    };
                    found = is;
                    writeln!(text, "M66 {word} L0").unwrap();
                }
                Step::Await(level) => {
                    let comes = part == (level == 3);
                    writeln!(text, "M66 P5 L{level} Q0.05").unwrap();
                    found = if comes { f64::from(u8::from(part)) } else { -1.0 };
                    if !comes {
                        // Otherwise it is an operator's.
                        text += "(debug, #5399)\n";
                    }
                }
                Step::Read => {
                    text += "G1 X[#1 + #5399]\nG4 P0.02\n";
                    places.push(x + found);
                    places.push(x);
                    text += "G1 X#1\nG4 P0.02\n";
                }
                Step::Dwell => text += "G4 P0.01\n",
            }
        }
        let more = [BY_EVENT];
        let mut rig = wired(if by_event { &more } else { &[] }, &(text.clone() + "M2\n"));
        rig.twin(IO).disturb(Disturbance::Input(PART, part));
        set(&mut rig, PRESSURE, values[0]);
        set(&mut rig, FORCE, values[1]);
        for after in held {
            for (rows, command) in [(after, Command::FeedHold), (60, Command::Resume)] {
                let until = rig.rows.len() + rows;
                while rig.rows.len() < until && rig.step() {}
                rig.command(command);
            }
        }
        prop_assert_eq!(rig.finish(), End::Finished, "{}{:?}", text, rig.events);
        let mut rows = rig.rows.iter();
        for place in places {
            let met = rows.any(|row| (row.plan.position[0] - place).abs() < 1e-6);
            prop_assert!(met, "{}: never at {}", text, place);
        }
        prop_assert!(rig.rows.len() as f64 * rig.machine.cycle.as_secs_f64() < Duration::from_secs(60).as_secs_f64());
    }
}
