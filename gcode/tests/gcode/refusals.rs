//! What is refused, where, and what the message says to do.

use proptest::prelude::*;
use syncline_gcode::{Action, AxisLetter, Interpreter, MAX_LINE, Setup};

use super::listing::{refusal, refusal_with, refusals, refusals_with, run, run_with, xyz};

/// Each program with the place of its fault; the messages are in the snapshot.
#[test]
fn each_with_its_place() {
    let programs = [
        // The text.
        ("G0 X1 !", "1:7"),
        ("G0 X1 (to the left", "1:7"),
        ("G0 X1\nG\0 0", "2:1"),
        ("G0 (a (b) c) X1", "1:7"),
        ("#<depth = 1", "1:2"),
        ("#<> = 1", "1:2"),
        ("G0 X", "1:5"),
        ("G0 X1,5 Y2", "1:5"),
        ("G0 X1, Y2", "1:6"),
        ("G0 X(1)1", "1:5"),
        ("O100 CALLSUB", "1:6"),
        ("O100 ENDSUBB", "1:6"),
        ("O100 WHLE [1]", "1:6"),
        ("G0 X1.2.3", "1:8"),
        ("G0 X.", "1:5"),
        ("G0 X[1 + ]", "1:10"),
        ("G0 X[1", "1:7"),
        ("G0 X[ATAN[1]]", "1:13"),
        ("G0 X[EXISTS[#1]]", "1:14"),
        ("G0 XFOO[1]", "1:5"),
        ("#1 = ", "1:6"),
        ("#1 X5", "1:4"),
        ("G0 N10 X1", "1:4"),
        ("N-1 G0", "1:2"),
        ("G0 X1 O100", "1:7"),
        ("O100 FOO", "1:6"),
        ("O100 IF", "1:8"),
        ("O100 SUB G0", "1:10"),
        ("% G0", "1:3"),
        ("O100 G0 X5", "1:6"),
        ("WHILE[#1LT2]DO1", "1:1"),
        ("IF[#1GT5]GOTO50", "1:1"),
        ("N50 GOTO 50", "1:5"),
        ("END1", "1:1"),
        // Values.
        ("G0 X#0", "1:5"),
        ("G0 X#6000", "1:5"),
        ("G0 X#1.5", "1:5"),
        ("#5070 = 1", "1:1"),
        ("G0 X[2^2]", "1:7"),
        ("G0 X#<nothing>", "1:5"),
        ("G0 X#<_hal[motion.digital-in-00]>", "1:5"),
        ("#<_hal[spindle.0.on]> = 1", "1:1"),
        ("G0 X#<_ini[axis_x]max_limit>", "1:5"),
        ("#500 = 1 #5555 = 2", "1:10"),
        ("G0 X[1/0]", "1:7"),
        ("G0 XSQRT[-1]", "1:5"),
        ("G0 XLN[0]", "1:5"),
        ("G0 XACOS[2]", "1:5"),
        ("G0 X[-2 ** 0.5]", "1:9"),
        ("G1 X1 F0", "1:1"),
        ("F0\nG93 G1 X1 F0", "2:5"),
        ("F0.0001", "1:1"),
        ("F-1", "1:1"),
        ("S-1 M3", "1:1"),
        ("T1.5", "1:1"),
        ("G100", "1:1"),
        ("G1.25 X1", "1:1"),
        ("M3.5", "1:1"),
        ("G0 X1e5", "1:6"),
        ("G0 X10000000000", "1:4"),
        // Words.
        ("G0 A1", "1:4"),
        ("G6 X1", "1:1"),
        ("M77", "1:1"),
        ("G33 Z-5 K1", "1:1"),
        ("G76 Z-5", "1:1"),
        ("G33.1 Z-5 K1", "1:1"),
        ("G84 Z-5 R1", "1:1"),
        ("G74 Z-5 R1", "1:1"),
        ("G95 F0.1", "1:1"),
        ("G96 S100", "1:1"),
        ("M19 R0", "1:1"),
        ("M3 M19 R0", "1:4"),
        ("G41 D1", "1:5"),
        ("G38.2 Z-5", "1:1"),
        ("F100 G5.1 X1 Y1", "1:6"),
        ("F100 G5 X1 I1 P1 Q1", "1:6"),
        ("F100 G5 X1 P1 Q1", "1:6"),
        ("F100 G5 X1 I1 J1 Q1", "1:6"),
        ("F100 G5 X1 I1 J1 P1 Q1\nG1 X2\nG5 X1 P1 Q1", "3:1"),
        ("F100 G5 X1 Z1 I1 J1 P1 Q1", "1:12"),
        ("F100 G18 G5 X1 I1 J1 P1 Q1", "1:10"),
        ("G5.1 X1 I1", "1:1"),
        ("F100 G5.1 X0 Y0 I0", "1:6"),
        ("F100 G5.1 X1 I1 J20000000", "1:17"),
        ("G53 F100 G5.1 X1 I1", "1:1"),
        ("G5.3", "1:1"),
        ("F100 G5.2 L3\nX1\nG5.3", "3:1"),
        ("F100 G5.2 L2 X1", "1:11"),
        ("F100 G5.2 P1\nX1 P1001", "2:4"),
        ("F100 G5.2 P0", "1:11"),
        ("F100 G5.2\nX1 L4", "2:4"),
        ("F100 G5.2 X1\nG1 X2", "2:1"),
        ("F100 G5.2 X1\nM3", "2:1"),
        ("F100 G5.2 X1\nM2", "2:1"),
        ("F100 G5.2 X1", "2:1"),
        ("G5.2 X1", "1:1"),
        ("G93 G5.2 X1 F1", "1:5"),
        ("G0 X1 X2", "1:7"),
        ("G0 G1 X1", "1:4"),
        ("G90 G91", "1:5"),
        ("G20\nG17 G18", "2:5"),
        ("M3 M4", "1:4"),
        ("M7 M9", "1:4"),
        ("G0 X1 P5", "1:7"),
        ("G1 X1 F100 I5", "1:12"),
        ("H1", "1:1"),
        ("G4 G64 P1", "1:8"),
        ("G4", "1:1"),
        ("G4 P-1", "1:4"),
        ("G64 P-1", "1:5"),
        ("M61", "1:1"),
        ("M64", "1:1"),
        ("M65 P64", "1:5"),
        ("M67 E4 Q1", "1:5"),
        ("M68 E0", "1:1"),
        ("M66 P1 L3 Q1", "1:5"),
        ("M50 P0", "1:5"),
        ("M49", "1:1"),
        ("G12 I5", "1:1"),
        ("G51 X2", "1:1"),
        ("G69", "1:1"),
        ("G7", "1:1"),
        ("G70", "1:1"),
        ("G71 G91.1", "1:1"),
        ("G15", "1:1"),
        ("G92", "1:1"),
        ("G28.1 X1", "1:7"),
        ("G43.2 H9", "1:7"),
        ("M72", "1:1"),
        ("M70\nM71\nM72", "3:1"),
        ("M70\nO1 SUB\nM72\nO1 ENDSUB\nO1 CALL", "3:1"),
        ("M70 M72", "1:5"),
        ("G64 P0.1 Q-1", "1:10"),
        // Motion.
        ("G1 X1", "1:1"),
        ("F100 G93 G1 X1\nG1 X2", "2:1"),
        ("F100\nG93\nG1 X1", "3:1"),
        ("F100 G93\nG94 G1 X1", "2:5"),
        ("F100\nG93\nG94 G1 X1", "3:5"),
        ("X1", "1:1"),
        ("G80 Y2 X1", "1:5"),
        ("G53 X1", "1:1"),
        ("G0 @1 ^2 Y1", "1:10"),
        ("G18 G0 @1 ^2", "1:8"),
        ("G0 @1", "1:4"),
        ("G91 G0 @1", "1:8"),
        ("G53 G0 @1 ^2", "1:8"),
        ("G92 X1 @1 ^0", "1:8"),
        ("@1 ^2", "1:1"),
        ("G53 G2 X1 I1 F100", "1:1"),
        ("F100 G2", "1:6"),
        ("F100 G2 X5", "1:6"),
        ("F100 G2 X10 K5", "1:13"),
        ("F100 G18 G2 X10 J5", "1:17"),
        ("F100 G2 X10 I5 R5", "1:16"),
        ("F100 G2 I0", "1:6"),
        ("F100 G2 Y-0.01 I-20", "1:6"),
        ("F100 G2 X10 I5.02", "1:6"),
        ("F100 G2 R5", "1:6"),
        ("F100 G2 X10 R4", "1:6"),
        ("F100 G2 X10 I5 P0", "1:16"),
        ("F100 G2 X10 I5 P1.5", "1:16"),
        ("F100 G90.1 G2 X10 I5", "1:12"),
        ("G2 X10 I5", "1:1"),
        // The program.
        ("%\nG0 X1\n", "3:1"),
    ];
    insta::assert_snapshot!(refusals(&programs));
}

/// Typed lines have no rest of a program in which something could be defined.
#[test]
fn typed_lines_have_nothing_behind_them() {
    let setup = Setup {
        typed: true,
        ..xyz()
    };
    let programs = [("o<foo> call", "1:1"), ("M98 P5", "1:1")];
    insta::assert_snapshot!(refusals_with(&setup, &programs));
}

/// What has no end is told by what keeps it from one.
#[test]
fn a_program_that_begins_anew_has_no_end() {
    let setup = Setup {
        max_blocks: Some(100),
        ..xyz()
    };
    let programs = [
        ("G0 X1\nG0 X0\nM99", "2:1"),
        ("O1 WHILE [1]\nG0 X1\nG0 X0\nO1 ENDWHILE", "1:1"),
    ];
    insta::assert_snapshot!(refusals_with(&setup, &programs));
}

#[test]
fn soft_limits_hold_for_the_whole_motion() {
    let mut setup = xyz();
    setup.limits[0] = Some((0.0, 100.0));
    setup.limits[1] = Some((0.0, 50.0));
    setup.limits[2] = Some((-30.0, 0.0));
    setup.tables.work_offsets[1][syncline_gcode::AxisLetter::X] = 20.0;
    let programs = [
        ("G0 X100 Y50 Z-30\nX100.001", "2:1"),
        ("G0 Y-0.5 X1", "1:4"),
        ("G0 Y-0.000001", "1:4"),
        ("G0 X[100 + 0.000001]", "1:4"),
        ("G91 G0 X60\nX60", "2:1"),
        ("G55 G0 X80.5", "1:8"),
        ("G0 X10 Y45\nG2 X20 R5 F100\nG2 X30 Y45.001 R5", "3:8"),
        ("G0 X99 Y10\nG3 X99 Y20 J5 F100", "2:4"),
        ("G0 X20 Y20\nG19 G3 J4 K-10 P2 F100 X25", "2:5"),
        ("G0 X50 Y25 Z-10\nG17 G2 I30 F100 Z-20", "2:5"),
    ];
    insta::assert_snapshot!(refusals_with(&setup, &programs));
}

#[test]
fn soft_limits_can_be_reached() {
    let mut setup = xyz();
    setup.limits[0] = Some((-10.0, 0.1 + 0.2));
    // What the sum of the words rounds is no matter.
    assert!(run_with(setup.clone(), "G0 X-10\nX0.3\nG91 X-0.2\nX0.2\nM2").is_ok());
    // A machine that stands outside may come back, and may move its other axes.
    setup.start.0[0] = -20.0;
    assert!(run_with(setup.clone(), "G0 Y5\nX-5\nM2").is_ok());
    assert!(run_with(setup.clone(), "G0 X-15\nM2").is_err());
    assert!(run_with(setup, "G2 J5 F100\nM2").is_err());
}

/// Where an encoder's noise has an axis stand a little outside as a program begins, the program may come back to there, by any
/// motion, and no further.
#[test]
fn a_program_comes_back_to_where_it_began() {
    for noise in [-0.01, -0.000_153, -1e-6, 0.0, 100.000_2, 100.01] {
        let mut setup = xyz();
        setup.limits[0] = Some((0.0, 100.0));
        setup.start.0[0] = noise;
        let way = if noise > 50.0 { -10 } else { 10 };
        for back in [
            format!("G91 G1 X{way} F100\nX{}", -way),
            format!("G91 G0 X{way}\nG0 X{}", -way),
            format!("G2 I{} F100", way / 2),
            format!(
                "G91 G3 X{way} I{} F100\nG3 X{} I{}",
                way / 2,
                -way,
                -way / 2
            ),
        ] {
            let ran = run_with(setup.clone(), &format!("G21\n{back}\nM2"));
            assert!(ran.is_ok(), "{noise}: {back}: {ran:?}");
        }
        let further = format!("G91 G0 X{way}\nG0 X{}", -f64::from(way) * 1.0021);
        assert!(
            run_with(setup.clone(), &format!("{further}\nM2")).is_err(),
            "{noise}"
        );
    }
    // Whoever begins elsewhere does not get there.
    let mut setup = xyz();
    setup.limits[0] = Some((0.0, 100.0));
    setup.start.0[0] = 5.0;
    assert!(run_with(setup, "G0 X-0.0001\nM2").is_err());
}

#[test]
fn the_spindle_has_its_speeds_and_the_machine_its_inputs() {
    let mut setup = xyz();
    setup.spindle_speeds = Some((100.0, 3000.0));
    setup.inputs = 1 << 5;
    for good in ["S0", "S100 M3", "S3000", "M66 P5 L3 Q0"] {
        assert!(
            run_with(setup.clone(), &format!("{good}\nM2")).is_ok(),
            "{good}"
        );
    }
    for bad in [
        "S99",
        "S3001 M4",
        "M66 P4 L3 Q0",
        "M66 P5 L0 Q1",
        "M66 P5 L3",
    ] {
        assert!(
            run_with(setup.clone(), &format!("{bad}\nM2")).is_err(),
            "{bad}"
        );
    }
}

#[test]
fn nothing_of_a_refused_block_is_handed_out() {
    let mut program = Interpreter::from_text("part.ngc", "M3 S100 G1 X1\nG0 X1", xyz());
    assert!(program.next().unwrap().is_err());
    assert!(program.next().is_none());
}

#[test]
fn a_long_line_is_refused() {
    let message = refusal(&format!("G0 X1 ({})", "x".repeat(MAX_LINE)));
    assert!(
        message.starts_with("part.ngc:1:1: the line has more than"),
        "{message}"
    );
}

/// A medium that fails after its first block.
struct Failing(std::io::Cursor<&'static [u8]>);

impl std::io::Read for Failing {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        match self.0.read(buffer)? {
            0 => Err(std::io::Error::other("the medium is gone")),
            read => Ok(read),
        }
    }
}

impl std::io::Seek for Failing {
    fn seek(&mut self, to: std::io::SeekFrom) -> std::io::Result<u64> {
        self.0.seek(to)
    }
}

#[test]
fn a_medium_that_fails() {
    let input = Failing(std::io::Cursor::new(b"G0 X1\nG0 X2\n"));
    let result: Result<Vec<_>, _> = Interpreter::new("part.ngc", input, xyz()).collect();
    insta::assert_snapshot!(result.unwrap_err().to_string());
    let nowhere = std::path::Path::new("nowhere.ngc");
    let error = Interpreter::open(nowhere, xyz()).err().unwrap().to_string();
    assert!(error.starts_with("nowhere.ngc:1:1: cannot read"), "{error}");
}

#[test]
fn arcs_need_the_axes_of_their_plane() {
    let lathe = Setup::new([AxisLetter::X, AxisLetter::Z].into_iter().collect());
    let message = refusal_with(lathe.clone(), "F100 G2 X10 I5");
    assert!(
        message.starts_with("part.ngc:1:6: the machine has no axis Y"),
        "{message}"
    );
    assert!(run_with(lathe, "F100 G18 G2 X10 I5\nM2").is_ok());
}

#[test]
fn deep_nesting_is_refused() {
    for open in ["[", "-", "#", "[-#"] {
        let message = refusal(&format!("G0 X{}1", open.repeat(500)));
        assert!(message.contains("nested deeper"), "{message}");
    }
}

#[test]
fn what_a_terminal_acts_upon_is_not_shown() {
    let message = refusal("G0 X1 (\x1b[2J\x07) !");
    assert!(!message.contains(['\x1b', '\x07']), "{message:?}");
}

#[test]
fn a_comment_may_hold_any_bytes() {
    let program = b"G21 (\xd8 6 mm \xff)\n; \x80\nM2\n".to_vec();
    let commands: Result<Vec<_>, _> =
        Interpreter::new("part.ngc", std::io::Cursor::new(program), xyz()).collect();
    assert_eq!(commands.unwrap().len(), 1);
}

#[test]
fn the_example_reads_well() {
    insta::assert_snapshot!(refusal("N10 G21\nN20 G1 X10 Y5\n"));
}

/// Runs a program for a while; what it hands out has to be numbers within reach.
fn judge(program: &str) {
    let mut setup = xyz();
    setup.max_blocks = Some(500);
    let reach = |point: &syncline_gcode::Point| {
        assert!(
            point.0.iter().all(|value| value.abs() <= 1e10),
            "{program:?}"
        );
    };
    for command in Interpreter::from_text("x", program, setup).take(2000) {
        match command.map(|command| command.action) {
            Ok(Action::Rapid { to }) => reach(&to),
            Ok(Action::Feed { to, .. }) => reach(&to),
            Ok(Action::Arc { arc, .. }) => {
                reach(&arc.to);
                reach(&arc.from);
                assert!(arc.sweep.is_finite() && arc.sweep != 0.0, "{program:?}");
                assert!(
                    arc.center.iter().all(|value| value.is_finite()),
                    "{program:?}"
                );
            }
            _ => {}
        }
    }
}

proptest! {
    #[test]
    fn random_bytes_never_panic(bytes: Vec<u8>) {
        let _ = Interpreter::new("x", std::io::Cursor::new(bytes), xyz()).count();
    }

    #[test]
    fn random_words_never_panic(
        program in proptest::collection::vec(
            "[ ]?(G|M|X|Y|Z|I|J|K|P|R|F|S|T|L|Q|O|N|#|=|\\[|\\]|-|\\.|[0-9]{1,4}|9{300}|SIN|MOD|\\*\\*|<a>|\n|/|%|\\(a\\))",
            0..40,
        )
    ) {
        judge(&program.concat());
    }

    /// Sentences of the language rather than its letters: most are accepted somewhere.
    #[test]
    fn random_blocks_never_panic(
        program in proptest::collection::vec(
            "(G(0|1|2|3|28|30|43.1|52|53 G0|80|81|82|83|73|85|89|91|90|90.1|91.1|92|92.1|92.3|10 L2|10 L20|10 L1) )?\
             (G(17|18|19|20|21|93|94|98|99|54|55) )?(F[1-9]00 )?(S1 M3 )?\
             (X-?[0-9]{1,3} )?(Y#[1-3] )?(Z\\[#1\\*2-3\\] )?(I[0-9] )?(J-[0-9] )?(R[0-9] )?(P[0-9] )?(L[0-9] )?(Q[1-9] )?\
             |#[123] ?= ?(\\[#[123] ?(\\+|-|MOD|\\*|/|GT) ?[0-9.]\\]|-?[0-9]{1,9})\
             |#(5161|5211|5221|5241|<a>|<_b>)=(-?9{1,310}|#1)\
             |o[123] (sub|endsub|call \\[#1\\]|return|if \\[#2\\]|else|endif|while \\[#1\\]|endwhile|do|repeat \\[3\\]|endrepeat|break|continue)\
             |o[123]|M98 P[123]( L2)?|M99|M2|%|T1 M6|/G0 X1",
            1..30,
        )
    ) {
        judge(&program.join("\n"));
    }

    /// The same with what a program without a mistake has: loops that end where they should.
    #[test]
    fn nested_flow_is_followed(depth in 1usize..8, count in 1u32..4) {
        let mut program = "G91\n".to_owned();
        for label in 0..depth {
            program += &format!("o{label} repeat [{count}]\n");
        }
        program += "G0 X1\n";
        for label in (0..depth).rev() {
            program += &format!("o{label} endrepeat\n");
        }
        program += "M2";
        let commands = run(&program).unwrap();
        prop_assert_eq!(commands.len(), count.pow(depth as u32) as usize + 1);
    }

    #[test]
    fn numbers_round_trip(value in -1e9f64..1e9) {
        let commands = run(&format!("G0 X{value}\nM2")).unwrap();
        let Action::Rapid { to } = commands[0].action else {
            panic!("{commands:?}")
        };
        prop_assert_eq!(to.0[0], value);
    }
}
