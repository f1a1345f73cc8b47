//! Tables of offsets and tools: a mistake is told with its place.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::path::Path;
use syncline_gcode::{AxisLetter, AxisSet, Interpreter, Setup, Tables};

fuzz_target!(|text: &str| {
    match Tables::parse(Path::new("tables.toml"), text) {
        Err(mistakes) => assert!(mistakes.to_string().contains("tables.toml")),
        Ok(tables) => {
            let mut axes = AxisSet::default();
            AxisLetter::ALL.into_iter().for_each(|axis| axes.insert(axis));
            let mut setup = Setup::new(axes);
            setup.tables = tables.clone();
            // Every offset in turn, and a tool that may be there.
            let program = "G43 H1\nG55 G0 X1\nG59.3 G0 Y1\nG28 Z0\nG30\n";
            let mut interpreter = Interpreter::from_text("p", program, setup);
            while let Some(command) = interpreter.next() {
                if command.is_err() {
                    break;
                }
            }
            assert!(interpreter.position().0.iter().all(|it| it.is_finite()));
            assert_eq!(*interpreter.tables(), tables, "the program sets none");
        }
    }
});
