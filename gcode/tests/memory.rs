//! A program of any length costs the memory of one block: once a block of each kind was seen,
//! interpreting allocates nothing.

use std::fmt::Write;

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use syncline_gcode::{AxisSet, Interpreter, Setup};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

#[test]
fn blocks_cost_no_memory() {
    let mut text = String::from("G21 G90 F600 #1 = 0\nG0 X0 Y0\n");
    for block in 0..3000 {
        let x = 10 + block % 7;
        writeln!(text, "N{block} G1 X[{x} + #1 MOD 3] Y-{x}.5 (a move)").unwrap();
        writeln!(text, "#1 = [#1 + 1] G3 X{x} Y0 R[2 * {x}] F500 ; an arc").unwrap();
        writeln!(text, "G54 M8 S100 M3 G4 P0.1").unwrap();
        writeln!(text, "M9 M5").unwrap();
    }
    text += "M2\n";
    let mut program = Interpreter::from_text("part.ngc", text, Setup::new(AxisSet::XYZ));
    let seen = program.by_ref().take(200).filter(Result::is_ok).count();
    assert_eq!(seen, 200, "{:?}", program.last());
    let rest = assert_no_alloc(|| program.by_ref().take(10_000).filter(Result::is_ok).count());
    assert_eq!(rest, 10_000);
}
