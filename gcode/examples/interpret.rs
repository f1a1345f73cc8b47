//! Interprets a program and prints what it asks of the machine, in machine coordinates.
//! `cargo run -p syncline-gcode --example interpret`

use syncline_gcode::{Action, AxisLetter, AxisSet, Error, Interpreter, Setup};

const PROGRAM: &str = "
G21 G90 G54 F600
#1 = 20           (side of the square, mm)
G0 X0 Y0
G1 X#1
   Y#1
G3 X0 R[#1 / 2]
G1 Y0
M2
";

fn main() -> Result<(), Error> {
    // The machine as far as a program needs it: axes, soft limits, work offsets.
    let mut setup = Setup::new(AxisSet::XYZ);
    setup.limits[AxisLetter::X.index()] = Some((0.0, 500.0));
    setup.tables.work_offsets[0][AxisLetter::X] = 100.0;

    let mut ends = Vec::new();
    for command in Interpreter::from_text("square.ngc", PROGRAM, setup) {
        let command = command?;
        println!("line {}: {:?}", command.span.line, command.action);
        match command.action {
            Action::Rapid { to } | Action::Feed { to, .. } => {
                ends.push((to[AxisLetter::X], to[AxisLetter::Y]))
            }
            Action::Arc { arc, .. } => ends.push((arc.to[AxisLetter::X], arc.to[AxisLetter::Y])),
            _ => {}
        }
    }
    let square = [
        (100.0, 0.0),
        (120.0, 0.0),
        (120.0, 20.0),
        (100.0, 20.0),
        (100.0, 0.0),
    ];
    assert_eq!(ends, square);

    // What cannot be is refused with its place and what to do.
    let mut setup = Setup::new(AxisSet::XYZ);
    setup.limits[AxisLetter::X.index()] = Some((0.0, 500.0));
    let mut program = Interpreter::from_text("far.ngc", "G0 X501\nM2\n", setup);
    let refusal = program.find_map(Result::err).expect("X leaves its travel");
    println!("{refusal}");
    Ok(())
}
