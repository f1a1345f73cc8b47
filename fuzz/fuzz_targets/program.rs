//! Part programs: each block is executed or refused, what comes of it is finite, and a program that has no
//! mistake amounts to something on a machine.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::io::Cursor;
use std::path::Path;
use std::sync::LazyLock;
use syncline_controller::machine::Machine;
use syncline_controller::program::{ProgramError, Programs};
use syncline_gcode::{AxisLetter, AxisSet, Interpreter, Setup, Tables};

/// Blocks and moves of a program at most.
const MOST: u64 = 2000;
/// Mistakes of a program at most.
const MISTAKES: usize = 50;

static MACHINE: LazyLock<Machine> = LazyLock::new(|| {
    let text = include_str!("../../examples/xyz/machine.toml");
    Machine::parse(Path::new("machine.toml"), text).expect("an example")
});

/// The machine with its soft limits.
fn three_axes() -> Setup {
    let mut axes = AxisSet::default();
    MACHINE.axes.iter().for_each(|axis| axes.insert(axis.letter));
    let mut setup = Setup::new(axes);
    for axis in &MACHINE.axes {
        setup.limits[axis.letter.index()] = Some(axis.limits.position);
    }
    setup.start.0 = MACHINE.rest();
    setup
}

/// Every axis that there is, and no limits.
fn nine_axes() -> Setup {
    let mut axes = AxisSet::default();
    AxisLetter::ALL.into_iter().for_each(|axis| axes.insert(axis));
    let mut setup = Setup::new(axes);
    setup.inputs = 0b1111;
    setup
}

/// Blocks that were read, unless there is a mistake.
fn interpret(text: &[u8], mut setup: Setup) -> Option<u64> {
    setup.max_blocks = Some(MOST);
    setup.max_idle_blocks = MOST;
    let mut interpreter = Interpreter::new("p.ngc", Cursor::new(text.to_owned()), setup);
    let mut mistakes = 0;
    while let Some(command) = interpreter.next() {
        if let Err(error) = command {
            assert!(error.to_string().starts_with("p.ngc:"));
            mistakes += 1;
            if mistakes == MISTAKES || !interpreter.go_on(&error) {
                break;
            }
        }
        let position = interpreter.position().0;
        assert!(position.iter().all(|it| it.is_finite()), "{position:?}");
    }
    let _ = interpreter.memory();
    (mistakes == 0).then(|| interpreter.executed())
}

fuzz_target!(|text: &[u8]| {
    interpret(text, nine_axes());
    if let Some(blocks) = interpret(text, three_axes()) {
        let programs = Programs::with_tables(&MACHINE, Tables::default());
        match programs.text("p.ngc", text).check(MACHINE.rest()) {
            Ok(extent) => assert_eq!(extent.blocks, blocks),
            Err(ProgramError::Curve { .. }) => {}
            Err(error) => panic!("good by its blocks: {error}"),
        }
    }
});
