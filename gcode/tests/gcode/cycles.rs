//! Canned cycles.

use syncline_gcode::{AxisLetter, Setup};

use super::listing::{listing, places, refusal_with, refusals, xyz};

#[test]
fn each_cycle() {
    let cycles = [
        "G81 X10 Y5 Z-6 R2",
        "G82 X10 Y5 Z-6 R2 P0.5",
        "G83 X10 Y5 Z-6 R2 Q3",
        "G73 X10 Y5 Z-6 R2 Q3",
        "G85 X10 Y5 Z-6 R2",
        "G86 X10 Y5 Z-6 R2 P0.5",
        "G89 X10 Y5 Z-6 R2 P0.5",
    ];
    let text: Vec<String> = cycles
        .iter()
        .map(|cycle| {
            let program = format!("S100 M3 F120 G0 Z10\n{cycle}\nG99 X20\nM2");
            format!("{cycle}\n{}", listing(&program))
        })
        .collect();
    insta::assert_snapshot!(text.concat());
}

#[test]
fn series() {
    insta::assert_snapshot!(listing(
        "F120 G0 Z10
G98 G81 X1 Y1 Z-1 R2 (back to Z10)
X2 (all numbers stay)
Z-2
G99 X3 Z-3 R1 (back to R)
G82 X4 Z-4 P0.1 (R stays)
G98 X5 (the first level still is Z10)
G80
G0 Z0
G64 P0.1 G81 X6 Z-1 R3 (from below R)
G61
G0 Z0
G91 G81 X4 Y5 Z-0.6 R1.8 L3 (incremental)
G90 G20 G81 X1 Y0 Z-0.1 R0.1 L2 (inches, twice the same hole)
G21 G18 G81 X0 Z5 Y-3 R20 (another plane)
M2"
    ));
}

#[test]
fn what_cannot_be_drilled() {
    let mut messages = refusals(&[
        ("G81 X1 Z-1 R1", "1:1"),
        ("F100 G81", "1:6"),
        ("F100 G81 X1 R1", "1:6"),
        ("F100 G81 X1 Z-1", "1:6"),
        ("F100 G81 X1 Z3 R1", "1:6"),
        ("F100 G82 X1 Z-1 R1", "1:6"),
        ("F100 G82 X1 Z-1 R1 P-1", "1:20"),
        ("F100 G83 X1 Z-1 R1", "1:6"),
        ("F100 G83 X1 Z-1 R1 Q0", "1:20"),
        ("F100 G83 X1 Z-1 R1 Q0.000001", "1:6"),
        ("F100 G81 X1 Z-1 R1 L0", "1:20"),
        ("F100 G86 X1 Z-1 R1", "1:6"),
        ("G93 G81 X1 Z-1 R1 F1", "1:5"),
        ("F100 G81 X1 Z-1 R1 Q1", "1:20"),
        ("F100 G81 X1 Z-1 R1\nG82 X2 P1", "2:1"),
        ("G84 X1 Z-1 R1", "1:1"),
        ("G74 X1 Z-1 R1", "1:1"),
        ("G87 X1 Z-1 R1", "1:1"),
        ("G98 G99", "1:5"),
        ("F100 G53 G81 X1 Z-1 R1", "1:6"),
    ]);
    let rotary = Setup::new(AxisLetter::ALL[..4].iter().copied().collect());
    messages += &refusal_with(rotary, "F100 G81 X1 Z-1 R1 A90");
    insta::assert_snapshot!(messages);
}

/// Where holes have their bottom, as the program's motions go down to it.
fn bottoms(program: &str) -> Vec<[f64; 3]> {
    let all = places(xyz(), program);
    let deepest = |window: &[[f64; 3]]| {
        let [before, here, behind] = [window[0][2], window[1][2], window[2][2]];
        (here < before && here < behind).then_some(window[1])
    };
    all.windows(3).filter_map(deepest).collect()
}

/// Under G91 R is counted from the level before the series, and the depth from R (NIST RS274NGC 3.5.16): each hole of a
/// series has the same.
#[test]
fn incremental_holes_are_all_as_deep() {
    for (back, first, levels, bottom) in [
        ("G99", "G81 X1 Y1 Z-3 R-2", [8.0, 8.0], 5.0),
        ("G98", "G81 X1 Y1 Z-3 R-2", [10.0, 8.0], 5.0),
        ("G99", "G81 X1 Y1 Z-3 R2", [12.0, 12.0], 9.0),
        ("G98", "G83 X1 Y1 Z-3 R2 Q3", [12.0, 12.0], 9.0),
    ] {
        let program = format!("G0 Z10 F100\nG91 {back}\n{first}\nX1\nX1 L2\nM2");
        let holes = bottoms(&program);
        assert_eq!(
            holes,
            [1.0, 2.0, 3.0, 4.0].map(|x| [x, 1.0, bottom]),
            "{program}"
        );
        let all = places(xyz(), &program);
        assert_eq!(all.last(), Some(&[4.0, 1.0, levels[0]]), "{program}");
        assert_eq!(all[all.len() - 3][2], levels[1], "{program}");
    }
}

/// The level before the series is one of the program: above work whose origin is higher it is higher too.
#[test]
fn the_first_level_goes_with_the_work() {
    for shift in ["G55", "G92 Z2", "G43.1 Z8"] {
        let program =
            format!("G10 L2 P2 Z8\nG0 Z10 F100\nG98 G81 X1 Y1 Z-3 R2\n{shift}\nG81 X5\nX9\nM2");
        let all = places(xyz(), &program);
        assert_eq!(
            bottoms(&program)[1..],
            [[5.0, 1.0, 5.0], [9.0, 1.0, 5.0]],
            "{shift}"
        );
        assert_eq!(all[all.len() - 4], [9.0, 1.0, 18.0], "{shift}: {all:?}");
        assert_eq!(all.last(), Some(&[9.0, 1.0, 18.0]), "{shift}");
        // The first of them too is gone to up there.
        let first = all.iter().find(|place| place[0] == 5.0);
        assert_eq!(first, Some(&[5.0, 1.0, 18.0]), "{shift}: {all:?}");
    }
}

/// Depth and levels are of one axis: those of another plane are written anew.
#[test]
fn another_plane_is_another_series() {
    let message = refusals(&[("G0 Z10 F100\nG81 X1 Y1 Z-3 R5\nG18\nX2", "4:1")]);
    assert!(message.contains("needs the depth"), "{message}");
}
