//! A program is read as far ahead as the machine needs, and no further: its moves are kept until the machine has
//! passed them, so that the memory for a program does not grow with its length. What is planned is the same.

use proptest::prelude::*;
use std::fmt::Write;
use std::fs;
use std::path::Path;
use syncline_controller::control::{Instruction, StopPoint};
use syncline_controller::machine::{COORDINATES, Machine};
use syncline_controller::program::{Moves, Program};
use syncline_trajectory::path::Command;

/// Parts of a program of micro-lines.
#[derive(Clone, Debug)]
enum Part {
    /// Back and forth along X, and by so much along Y from line to line.
    Lines { count: u32, step: f64, zigzag: f64 },
    /// Around a circle of this radius.
    Turns { count: u32, step: f64, radius: f64 },
    /// A stop, or what is switched without one.
    Between(&'static str),
}

impl Part {
    fn write(&self, text: &mut String) {
        let mut line = |x: f64, y: f64| writeln!(text, "X{x:.5} Y{y:.5}").unwrap();
        match *self {
            Self::Lines {
                count,
                step,
                zigzag,
            } => {
                for index in 0..=count {
                    let along = f64::from(index) * step % 200.0;
                    let x = if along > 100.0 { 200.0 - along } else { along };
                    line(x, zigzag * f64::from(index % 2));
                }
            }
            Self::Turns {
                count,
                step,
                radius,
            } => {
                for index in 0..=count {
                    let angle = f64::from(index) * step / radius;
                    line(radius * angle.sin(), radius - radius * angle.cos());
                }
            }
            Self::Between(words) => {
                writeln!(text, "{words}\nG1").unwrap();
            }
        }
    }
}

fn program(parts: &[Part]) -> String {
    let mut text = "G21 G90 G64 P0.01\nG1 F600 X0 Y0\n".to_owned();
    for part in parts {
        part.write(&mut text);
    }
    text + "M2\n"
}

/// What a program makes the machine do, and the most moves that were kept on the way. The machine passes
/// so many moves at a time, and only where nothing is to be had for now; or nobody follows it.
fn played(text: &str, pace: Option<u32>) -> (Vec<Instruction<COORDINATES>>, u32) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.ngc");
    fs::write(&file, text).unwrap();
    let machine_file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/xyz/machine.toml");
    let machine = Machine::load(&machine_file).unwrap();
    let program = Program::new(&file, &machine, &machine_file).unwrap();
    let (upcoming, moves) = Moves::new();
    let mut following = pace.map(|pace| (pace, moves));
    let mut feeder = program.feeder(machine.rest(), upcoming).unwrap();
    let (mut played, mut most) = (Vec::new(), 0);
    let (mut first, mut handed_out) = (0, 0);
    loop {
        let instruction = feeder.next_instruction().unwrap();
        if let Some((_, moves)) = &mut following {
            moves.take_up();
            let mut kept = most;
            while moves.motion(first + kept).is_some() {
                kept += 1;
            }
            most = kept;
        }
        match instruction {
            Some(instruction) => {
                if let Instruction::Plan(Command::PathSegment(segment)) = &instruction {
                    handed_out = segment.tag;
                }
                let ends = matches!(
                    instruction,
                    Instruction::Mark {
                        stop: StopPoint::End,
                        ..
                    }
                );
                played.push(instruction);
                if ends {
                    return (played, most);
                }
            }
            None => {
                let (pace, moves) = following.as_mut().expect("nobody is waited for");
                assert!(first < handed_out, "all is passed, and nothing comes");
                first = (first + *pace).min(handed_out);
                moves.passed(first);
            }
        }
    }
}

fn part() -> impl Strategy<Value = Part> {
    let count = || 1_000..30_000_u32;
    let step = || (-4.0..-1.0).prop_map(|exponent: f64| 10_f64.powf(exponent));
    let between = prop::sample::select(vec![
        "G4 P0.1",
        "M0",
        "M3 S100",
        "M8",
        "M62 P0",
        "G64 P0.05",
        "G0 X5",
    ]);
    prop_oneof![
        (count(), step(), 0.0..0.005).prop_map(|(count, step, zigzag)| Part::Lines {
            count,
            step,
            zigzag
        }),
        (count(), step(), 1.0..50.0).prop_map(|(count, step, radius)| Part::Turns {
            count,
            step,
            radius
        }),
        between.prop_map(Part::Between),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4))]

    /// However slowly the machine follows, it is given what it would be given at once.
    #[test]
    fn what_is_planned_does_not_depend_on_the_pace_of_the_machine(
        parts in prop::collection::vec(part(), 3..6),
        pace in 1..5_000_u32,
    ) {
        let text = program(&parts);
        let (at_once, _) = played(&text, None);
        let (waited_for, _) = played(&text, Some(pace));
        prop_assert!(at_once == waited_for, "another plan at pace {pace}");
    }
}

#[test]
fn a_program_of_any_length_keeps_as_many_moves() {
    let zigzag = |count| {
        let (step, zigzag) = (0.001, 0.002);
        program(&[Part::Lines {
            count,
            step,
            zigzag,
        }])
    };
    let [(_, short), (_, long)] =
        [50_000, 100_000].map(|count| played(&zigzag(count), Some(1_000)));
    assert!(
        long <= short + short / 20,
        "{short} moves of 50,000, {long} of 100,000"
    );
    assert!(short < 40_000, "{short}");
}

#[test]
fn a_program_that_is_read_as_it_runs_tells_how_far_it_is_read() {
    let text = program(&[Part::Lines {
        count: 20_000,
        step: 0.01,
        zigzag: 0.002,
    }]);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("p.ngc");
    fs::write(&file, &text).unwrap();
    let machine_file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/xyz/machine.toml");
    let machine = Machine::load(&machine_file).unwrap();
    let program = Program::new(&file, &machine, &machine_file).unwrap();
    assert!(program.reading().is_none(), "it is read as a whole before");
    let program = program.stream(true);
    program.check(machine.rest()).unwrap();
    let reading = program.reading().unwrap();
    assert_eq!(reading.of, Some(text.len() as u64));
    assert_eq!(reading.bytes(), 0);
    let mut feeder = program.feeder(machine.rest(), Moves::new().0).unwrap();
    let mut places = vec![0];
    while feeder.next_instruction().unwrap().is_some() {
        let place = reading.bytes();
        assert!(place >= places[places.len() - 1]);
        places.push(place);
    }
    assert_eq!(reading.bytes(), text.len() as u64);
    places.dedup();
    assert!(places.len() > 10, "{} places", places.len());
    // Who walks it a second time is no progress.
    let other = program.apart().reading().unwrap();
    assert_eq!(other.bytes(), 0);
}
