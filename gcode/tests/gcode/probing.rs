//! Probing: what the program asks for, what it is told of the result, and what is refused.

use syncline_gcode::{Action, Feed, Interpreter, Point, Probe, Probed, Setup};

use super::listing::{refusals_with, xyz};

fn with_probe() -> Setup {
    let mut setup = xyz();
    setup.has_probe = true;
    setup
}

/// Goes on to the next probing or the end; the probing, if it came to one, and the rapids on the way.
fn next_probing(program: &mut Interpreter) -> (Option<(Point, Probe)>, Vec<Point>) {
    let mut rapids = Vec::new();
    while let Some(command) = program.next() {
        match command.unwrap().action {
            Action::Probe { to, feed, probe } => {
                assert_eq!(feed, Feed::Rate(2.0));
                assert!(program.awaits_machine() && program.next().is_none());
                return (Some((to, probe)), rapids);
            }
            Action::Rapid { to } => rapids.push(to),
            _ => {}
        }
    }
    (None, rapids)
}

fn point(x: f64, y: f64, z: f64) -> Point {
    let mut point = Point::ZERO;
    point.0[..3].copy_from_slice(&[x, y, z]);
    point
}

#[test]
fn the_program_goes_on_with_what_is_found() {
    let text = "\
G21 G90 G94 G54
#5221 = 10
G38.2 X30 F120
o1 if [#5070 EQ 1]
  G0 X#5061 Y[#5061 + 1]
o1 else
  G0 X-1
o1 endif
G20
G38.5 Z-1
G0 X#5061 Z[#5063 + #5070]
M2
";
    let mut program = Interpreter::from_text("part.ngc", text, with_probe());
    let (found, _) = next_probing(&mut program);
    let towards = Probe {
        away: false,
        required: true,
    };
    assert_eq!(found, Some((point(40.0, 0.0, 0.0), towards)));
    // It touched, and went on for a little.
    program.probed(Probed {
        contact: Some(point(25.0, 0.0, 0.0)),
        at: point(25.5, 0.0, 0.0),
    });
    assert_eq!(program.position(), point(25.5, 0.0, 0.0));
    let (found, rapids) = next_probing(&mut program);
    assert_eq!(rapids, [point(25.0, 16.0, 0.0)]);
    let away = Probe {
        away: true,
        required: false,
    };
    assert_eq!(found, Some((point(25.0, 16.0, -25.4), away)));
    // It did not: the results are of where that ended, in inches.
    program.probed(Probed {
        contact: None,
        at: point(25.0, 16.0, -25.4),
    });
    let (found, rapids) = next_probing(&mut program);
    assert_eq!((found, rapids.len()), (None, 1));
    let near = rapids[0].0.iter().zip(point(25.0, 16.0, -25.4).0);
    for (is, meant) in near {
        assert!((is - meant).abs() < 1e-9, "{rapids:?}");
    }
}

#[test]
fn what_cannot_be_is_refused() {
    let refused = refusals_with(
        &with_probe(),
        &[
            ("G38.2 F100", "1:1"),
            ("G38.3 Z-0.25 F100", "1:1"),
            ("G38.4 Z-5", "1:1"),
            ("G93 G38.5 Z-5 F1", "1:5"),
            ("T1 M61 Q1 G10 L1 P1 R2\nG41 D1 G38.2 X50 F100", "2:8"),
        ],
    );
    insta::assert_snapshot!(refused);
    let mut turns = with_probe();
    turns.axes.insert(syncline_gcode::AxisLetter::A);
    let refused = refusals_with(&turns, &[("G38.2 X5 A5 F100", "1:10")]);
    assert!(refused.contains("G38.2 does not turn A"), "{refused}");
    // Behind a probing nothing is known.
    let text = "G38.2 Z-5 F100\nG0 X1\nM2\n";
    let mut program = Interpreter::from_text("part.ngc", text, with_probe());
    let error = program.enter_at_line(2).unwrap_err().to_string();
    assert!(error.contains("line 2 is behind a probing"), "{error}");
}
