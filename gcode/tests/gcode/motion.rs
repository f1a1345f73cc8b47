//! Motions, modes and units.

use super::listing::{listing, listing_with, run, xyz};
use syncline_gcode::{Action, AxisLetter, AxisSet, Interpreter, Point, Setup};

#[test]
fn a_plain_part() {
    insta::assert_snapshot!(listing(
        "%
(a plate, 40 x 30)
N10 G17 G21 G90 G94 G54
N20 T3 M6
N30 S12000 M3 M8
N40 G0 X-5 Y-5
N50 Z2
N60 G1 Z-1.5 F150
N70 X45 F900 ; along the front
N80 Y35
N90 G3 X40 Y40 I-5
N100 G2 X35 Y45 R5
N110 G61
N120 G0 Z20 M9
N130 M5
N140 G4 P0.5
N150 M30
%
"
    ));
}

#[test]
fn blanks_and_case_mean_nothing() {
    let squeezed = run("G0X+0.1234Y7\nM2").unwrap();
    let spread = run("  g 0 x + 0. 12 34 y 7\nm 2").unwrap();
    assert_eq!(squeezed[0].action, spread[0].action);
}

#[test]
fn distances_and_units() {
    insta::assert_snapshot!(listing(
        "G20 G0 X1 Y2
G91 X1 Z-.5
G21 X-0.8
G90 G1 G20 X0 F10
G21 X1
G93 G1 X2 F2
G94 F600 X3
M2"
    ));
}

#[test]
fn offsets_and_machine_coordinates() {
    let mut setup = xyz();
    setup.start = Point::xyz(1.0, 2.0, 3.0);
    setup.tables.work_offsets[0] = Point::xyz(100.0, 200.0, -50.0);
    setup.tables.work_offsets[8] = Point::xyz(-1.0, 0.0, 0.0);
    insta::assert_snapshot!(listing_with(
        setup,
        "G0 X0
G53 G0 Y0 Z0
G59.3 X5 Y5
G55 X5
G54 G91 G53 Z-1
X1
M30"
    ));
}

#[test]
fn a_motion_keeps_the_axes_that_it_does_not_name() {
    let mut setup = xyz();
    setup.start = Point::xyz(0.1, 0.2, 0.3);
    setup.tables.work_offsets[0] = Point::xyz(0.1, 0.7, 0.1);
    let commands: Vec<_> = Interpreter::from_text("part.ngc", "G0 Z1\nM2", setup)
        .collect::<Result<_, _>>()
        .unwrap();
    let Action::Rapid { to } = commands[0].action else {
        panic!("{commands:?}")
    };
    assert_eq!((to[AxisLetter::X], to[AxisLetter::Y]), (0.1, 0.2));
}

#[test]
fn path_modes() {
    insta::assert_snapshot!(listing(
        "G61\nG61.1\nG64\nG64 P0.05\nG64 P0.05 Q0\nG20 G64 P0.001 Q0.0005\nM2"
    ));
}

#[test]
fn rotary_axes_follow_in_degrees() {
    let setup = Setup::new(
        [AxisLetter::X, AxisLetter::A]
            .into_iter()
            .collect::<AxisSet>(),
    );
    insta::assert_snapshot!(listing_with(setup, "G20 F6 G1 X1 A90\nA180\nG0 A0\nM2"));
}

#[test]
fn stops_and_switches() {
    let program = "M0\nM1\n/G0 X1\nT7\nM6\nG0 X2\nM2\nG0 X99";
    let mut setup = xyz();
    let off = listing_with(setup.clone(), program);
    setup.block_delete = true;
    let on = listing_with(setup, program);
    insta::assert_snapshot!(format!("off\n{off}on\n{on}"));
}

#[test]
fn spindle_is_told_when_it_changes_and_coolant_each_time() {
    insta::assert_snapshot!(listing("S1000\nM3\nM3\nS2000\nM7 M8\nM8\nM9\nM4\nM5\nM2"));
}

#[test]
fn parameters_and_expressions() {
    insta::assert_snapshot!(listing(
        "#1=3 #2=4 #<Side A>=2 #<_depth>=-1.5
G0 X[SQRT[#1**2+#2**2]] Y[#<sidea> * [1 + 2] MOD 4] Z#<_depth>
#1=#2 G0 X#1
G0 X#1 Y[ATAN[1]/[-1]] Z-[2]
G0 X##1
G0 X[-7 MOD 3] Y[7 MOD -3] Z[-6 MOD 3]
G0 X[2 NE 2.0000001] Y[1 LE 1 XOR 3 GE 4] Z[0 OR -0.5]
G0 X[-2 ** 2] Y[10 - 4 - 3] Z[2 ** 3 ** 2]
G0 XFIX[-0.5] YFUP[0.1] ZROUND[-2.5]
G0 XLN[EXP[2]] YTAN[45] ZACOS[0]
G0 X-[1] Y--2 Z-ABS[-3]
G0 XASIN[0.5] YCOS[60] ZSIN[30]
G0 X[1 + 2 * 3 ** 2 / 6 - 1] Y[5 GT 3 AND 2 LT 1] Z[EXISTS[#<nope>] + EXISTS[#<_depth>]]
G[1+1] X7 I[ABS[-4]/2] F[60*10] Y[FIX[-2.8]+FUP[-2.8]+ROUND[4.5]]
M2"
    ));
}

#[test]
fn preambles_as_post_processors_write_them() {
    insta::assert_snapshot!(listing(
        "G0 G17 G40 G49 G80 G90 G21
X1
G90 G80 G1 F100 X2
G81 X3 Z-1 R1
G80 G0 Z5
M2"
    ));
    assert!(run("G80 G81 X1 Z-1 R1 F100").is_err());
}

#[test]
fn ends() {
    for program in ["M2", "M30", "%\n%", "G21", "", "\n\n%\nG21\n%\nrubbish !"] {
        let commands = run(program).unwrap();
        assert_eq!(commands.len(), 1, "{program:?}");
        assert_eq!(commands[0].action, Action::End);
    }
}

#[test]
fn the_block_of_a_command_is_at_hand() {
    let mut program = Interpreter::from_text("part.ngc", "G21\n  N5 G0 X1 (hop)\nM2", xyz());
    let command = program.next().unwrap().unwrap();
    assert_eq!(program.block(), "  N5 G0 X1 (hop)");
    assert_eq!(command.span.line, 2);
    assert_eq!(
        (command.span.columns.start, command.span.columns.end),
        (3, 17)
    );
}
