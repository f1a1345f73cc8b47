//! What the tool cuts of a compensated contour: who is told of it, when, and what is none.

use std::fmt::Write;

use syncline_gcode::{Fault, Interpreter};

use super::listing::{refusals_with, run_with, xyz};

/// Contours that are as they should be, for tools of 6 mm.
#[test]
fn what_leads_on_and_off_may_be_cut() {
    let arc_on = "G0 X30 Y16\nG41.1 D6 G1 X30 Y10\nG3 X40 Y0 I10\n";
    let around = "G1 X60\nY60\nX0\nY0\n";
    let programs = [
        // A pocket, by arcs onto its wall and off it; with an overlap; a second time; deeper.
        format!("{arc_on}{around}X40\nG3 X50 Y10 J10\nG40 G1 X40 Y20"),
        format!("{arc_on}{around}X45\nG3 X55 Y10 J10\nG40 G1 X40 Y20"),
        format!("{arc_on}{around}{around}X40\nG3 X50 Y10 J10\nG40 G1 X40 Y20"),
        format!("{arc_on}{around}X40\nZ-1\n{around}X40\nG3 X50 Y10 J10\nG40 G1 X40 Y20"),
        // A square from outside, which begins before its corner and ends behind it.
        "G0 X-30 Y0\nG42.1 D6 G1 X-10\nX40\nY40\nX0\nY-10\nG40 Y-20".to_owned(),
        // A bore, down a helix and once around; a smaller helix before it.
        "G0 X30 Y0\nG41.1 D6 G1 X30 Y-9\nG3 X40 Y0 R10\nI-40 Z-1\nI-40 Z-2\nI-40\nG3 X30 Y10 I-10\nG40 G1 X0 Y0".to_owned(),
        "G0 X5 Y0\nG41.1 D6 G1 X10\nG3 I-10 Z-1\nI-10 Z-2\nG3 X-40 I-25\nI40\nG3 X0 I20\nG40 G1 X-10".to_owned(),
        // A slot that is hardly wider than the tool: what is cut from its other wall is the arc on.
        "G0 X27.3 Y9.3\nG41.1 D9.2 G1 X24 Y6\nG3 X30 Y0 I6\nG1 X50\nG3 Y14 J7\nG1 X0\nG3 Y0 J-7\nG1 X30\nG3 X36 Y6 J6\nG40 G1 X33 Y8".to_owned(),
        // A pocket, and the island in it.
        format!("{arc_on}{around}X40\nG3 X50 Y10 J10\nG1 Y20\nX20\nY30\nX40\nY12\nG40 G1 X50 Y12"),
        // A sheet, from both sides.
        "G0 X-10 Y0\nG41.1 D6 G1 X0\nX40\nX40.01 Y-0.1\nX2\nG40 G1 X-10 Y-20".to_owned(),
        // One that lies on the way at another height.
        "G0 X0 Y-20\nG41.1 D6 G1 X0 Y-10\nY30\nX20\nZ5\nY-30\nX-30\nY10\nG40 G1 X-50 Y10".to_owned(),
    ];
    for program in programs {
        let program = format!("F600\n{program}\nM2");
        let run = run_with(xyz(), &program);
        assert!(run.is_ok(), "{program}\n{}", run.unwrap_err());
    }
}

#[test]
fn each_gouge_is_refused_with_what_cuts_and_what_is_cut() {
    let corner = "F600 G0 X-20 Y0\nG42.1 D6 G1 X-10\nX40\nY40\nX0\n";
    let pocket = "F600 G0 X30 Y20\nG41.1 D6 G1 X30 Y10\nG3 X40 Y0 I10\nG1 X60\nY60\nX0\nY0\n";
    let programs = [
        // From behind: what comes later into what came before, and the other way round.
        (
            "F600\nG42.1 D6 G1 X20\nX80\nY60\nX20\nY4\nX60\nY30\nG40 X70".to_owned(),
            "6:1",
        ),
        (
            "F600\nG41.1 D6 G1 X20\nX50\nY-20\nX0\nY4\nX30\nG40 Y20".to_owned(),
            "6:1",
        ),
        // Across itself.
        (
            "F600\nG41.1 D6 G1 X20\nX50\nY30\nX40\nY-30\nG40 X50".to_owned(),
            "6:1",
        ),
        // A pocket's end runs through its wall; one that begins in a corner cuts it.
        (
            "F600 G0 X30 Y30\nG41.1 D6 G1 X30 Y10\nG1 Y0\nX60\nY60\nX40\nY-10\nG40 X60".to_owned(),
            "7:1",
        ),
        (
            "F600 G0 X30 Y30\nG41.1 D6 G1 X0 Y0\nX60\nY60\nX0\nY0\nG40 X30 Y30".to_owned(),
            "6:1",
        ),
        // The ways on and off.
        (
            "F600 G0 X-20 Y0\nG42.1 D6 G1 X0\nX40\nY40\nX0\nY0\nG40 X-20".to_owned(),
            "2:1",
        ),
        (
            "F600 G0 X10 Y30\nG41.1 D6 G1 X40 Y0\nX60\nY40\nX30\nY8\nG40 X40".to_owned(),
            "6:1",
        ),
        (format!("{corner}Y-10\nG40 X20 Y20"), "7:1"),
        (format!("{pocket}X40\nG40 Y-9"), "9:1"),
    ];
    let programs: Vec<_> = programs
        .iter()
        .map(|(text, at)| (text.as_str(), *at))
        .collect();
    insta::assert_snapshot!(refusals_with(&xyz(), &programs));
}

/// Two walls with so many blocks between them are found, a way that cuts is not handed out, and the last are remembered.
#[test]
fn thousands_of_blocks_between_two_walls() {
    let mut program = "F600\nG41.1 D6 G1 X20\n".to_owned();
    // More than may lead onto a loop: the way back may not cross it.
    for x in 21..=60 {
        writeln!(program, "X{x}").unwrap();
    }
    // Around the tip of a sheet of 4 mm, whose other side is a wall from behind.
    for k in 0..=5_000 {
        let turned = std::f64::consts::PI * f64::from(k) / 5_000.0;
        let (x, y) = (60.0 + 2.0 * turned.sin(), 2.0 * turned.cos() - 2.0);
        writeln!(program, "X{x:.6} Y{y:.6}").unwrap();
    }
    let back = program.lines().count() as u32 + 1;
    let comes_near = format!("{program}X57\nY1\nX30\nG40 Y20\nM2");
    let mut handed_out = 0;
    let error = Interpreter::from_text("part.ngc", comes_near, xyz()).find_map(|command| {
        match command {
            Ok(command) => handed_out = handed_out.max(command.span.line),
            Err(error) => return Some(error),
        }
        None
    });
    let error = error.unwrap();
    let Fault::CutterHasCut { line, .. } = error.fault else {
        panic!("{error}");
    };
    assert!((36..=42).contains(&line), "{error}");
    assert_eq!(error.line, back + 1);
    assert!(handed_out < back);
    assert!(run_with(xyz(), &format!("{program}X20\nG40 X0 Y-20\nM2")).is_ok());
}
