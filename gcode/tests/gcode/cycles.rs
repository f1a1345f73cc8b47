//! Canned cycles.

use syncline_gcode::{AxisLetter, Setup};

use super::listing::{listing, refusal_with, refusals};

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
