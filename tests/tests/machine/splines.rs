//! Splines on a machine: the path follows them within its limits and stops where the path mode says.

use proptest::prelude::*;
use serde_json::Value;
use syncline_controller::machine::Machine;
use syncline_controller::program::Program;
use syncline_tests::command::{Folder, ended, syncline};
use syncline_tests::plan::{Plan, Step};
use syncline_tests::trace::Trace;

/// A curve of cubics, each of which goes on as the one before it ended.
fn curve(first: [f64; 2], blocks: &[[f64; 4]]) -> String {
    let mut text = String::new();
    let (mut x, mut y) = (300.0, 300.0);
    for (k, [dx, dy, p, q]) in blocks.iter().enumerate() {
        (x, y) = (x + dx, y + dy);
        let start = match k {
            0 => format!("I{} J{}", first[0], first[1]),
            _ => String::new(),
        };
        text += &format!("G5 X{x} Y{y} {start} P{p} Q{q}\n");
    }
    text
}

fn sections(plan: &Plan) -> usize {
    let begins = |step: &&Step| matches!(step, Step::Section(_));
    plan.steps.iter().filter(begins).count()
}

/// The way of a block and the handle at its end, that goes ahead by a part of it at an angle.
fn block() -> impl Strategy<Value = [f64; 4]> {
    let block = (1.0..20.0_f64, -20.0..20.0_f64, 0.1..0.6_f64, -1.0..1.0_f64);
    block.prop_map(|(dx, dy, part, angle)| {
        let handle = part * dx.hypot(dy);
        [dx, dy, -handle * angle.cos(), -handle * angle.sin()]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]
    /// In every path mode limits are kept; the path rests behind each block under G61.1 and nowhere under G61 and
    /// G64, where the curves go on without a corner; no mode is slower than the one with more stops. Of handles
    /// that make loops and points all but cusps, limits alone are asked for.
    #[test]
    fn curves_are_followed_in_every_path_mode(
        first in prop::array::uniform2(0.5..5.0_f64),
        blocks in prop::collection::vec(block(), 1..6),
        wild in prop::bool::weighted(0.3),
        feed in 100.0..20_000.0_f64,
    ) {
        let folder = Folder::new();
        let file = folder.machine("portal");
        let machine = Machine::load(&file).unwrap();
        let stretch = if wild { 20.0 } else { 1.0 };
        let blocks: Vec<_> = (blocks.iter())
            .map(|[dx, dy, p, q]| [*dx, *dy, p * stretch, q * stretch])
            .collect();
        let curve = curve(first, &blocks);
        let plan = |mode: &str| {
            let program = format!("{mode} F{feed} G0 X300 Y300\nG4 P0\n{curve}M2\n");
            let program = folder.file("p.ngc", &program);
            Program::new(&program, &machine, &file).unwrap().check(machine.rest()).ok()?;
            let plan = Plan::of(&machine, &file, &program);
            plan.assert_good();
            Some(plan)
        };
        // Where a cubic turns back, or leaves the soft limits, it is refused.
        let Some(stop) = plan("G61.1") else {
            prop_assert!(wild);
            return Ok(());
        };
        let [exact, blend] = ["G61", "G64 P0.05"].map(|mode| plan(mode).unwrap());
        if wild {
            return Ok(());
        }
        prop_assert_eq!(sections(&stop), 1 + blocks.len());
        prop_assert_eq!(sections(&exact), 2);
        prop_assert_eq!(sections(&blend), 2);
        prop_assert!(exact.time() <= stop.time() * 1.001 + 1e-6);
        prop_assert!(blend.time() <= exact.time() * 1.001 + 1e-6);
    }
}

/// The machine passes each of its verdicts on all kinds, and is where the curve is: on a cubic that is a parabola.
#[test]
fn the_tool_is_on_the_curve() {
    let folder = Folder::new();
    let machine = folder.machine("portal");
    let program = "G0 X100 Y100\nG61 F9000\n\
        G5.1 X160 Y100 I30 J40\n\
        G5 X220 Y100 I20 J-26.666666666666668 P-20 Q-26.666666666666668\n\
        G91 G5.2 L4 X10 Y10\nX10 Y20\nX10 Y-30\nX10\nG5.3\n\
        G93 G5.1 X10 Y0 I5 J5 F60\nM2\n";
    let program = folder.file("p.ngc", program);
    let trace = folder.path("trace.csv");
    let output = syncline()
        .args(["validate", "--json", "-", "--trace"])
        .args([&trace, &machine, &program])
        .output()
        .unwrap();
    let (code, printed, errors) = ended(&output);
    assert_eq!(code, 0, "{printed}{errors}");
    let report: Value = serde_json::from_str(printed).unwrap();
    let deviation = report["path"]["max_deviation_mm"].as_f64().unwrap();
    assert!(deviation <= 0.001, "{deviation}");
    let trace = Trace::read(&Machine::load(&machine).unwrap(), &folder.read("trace.csv"));
    trace.assert_within_limits();
    let (x, y) = (&trace.axis("X").set, &trace.axis("Y").set);
    let parabola = |x: f64, from: f64, side: f64| {
        let u = (x - from) / 60.0;
        100.0 + side * 80.0 * u * (1.0 - u)
    };
    let mut rows = [0, 0];
    for (row, line) in trace.line.iter().enumerate() {
        let expected = match line {
            3 => parabola(x[row], 100.0, 1.0),
            4 => parabola(x[row], 160.0, -1.0),
            _ => continue,
        };
        rows[*line as usize - 3] += 1;
        assert!(
            (y[row] - expected).abs() < 2e-3,
            "{}: {} {expected}",
            x[row],
            y[row]
        );
    }
    assert!(rows.iter().all(|rows| *rows > 50), "{rows:?}");
}
