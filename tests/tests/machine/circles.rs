//! The circular test that a validation makes of full circles: errors of a machine whose size is known.

use proptest::prelude::*;
use serde_json::Value;
use std::f64::consts::TAU;
use syncline_tests::command::{Folder, ended, machine_with, syncline};

const LIMITS: &str = "soft_limits = [-250.0, 250.0]\nfollowing_error_limit = 1.0\n";
const LIMITS_Y: &str = "soft_limits = [-200.0, 200.0]\nfollowing_error_limit = 1.0\n";

/// The circles of a program on the xyz machine, and the report.
fn circles(more: &str, replaced: &[(&str, &str)], program: &str) -> (Value, String) {
    let folder = Folder::new();
    let machine = folder.file("xyz.toml", &(machine_with("xyz", replaced) + more));
    let program = folder.file("program.ngc", program);
    let report = folder.path("report.html");
    let output = syncline()
        .args(["validate", "--json", "-", "--report"])
        .args([&report, &machine, &program])
        .output()
        .unwrap();
    let (_, json, errors) = ended(&output);
    let json = serde_json::from_str(json).unwrap_or_else(|error| panic!("{error}: {errors}"));
    (json, std::fs::read_to_string(report).unwrap_or_default())
}

fn all(json: &Value) -> &[Value] {
    json["circles"].as_array().map_or(&[], Vec::as_slice)
}

fn number(json: &Value, pointer: &str) -> f64 {
    let value = json.pointer(pointer).and_then(Value::as_f64);
    value.unwrap_or_else(|| panic!("no number {pointer} in {json:#}"))
}

fn reversal(circle: &Value, axis: &str, side: &str) -> f64 {
    let all = circle["reversals"].as_array().unwrap();
    let it = all
        .iter()
        .find(|it| it["axis"] == axis && it["side"] == side);
    it.and_then(|it| it["error_mm"].as_f64())
        .unwrap_or_else(|| panic!("no {axis}{side} in {circle:#}"))
}

/// Play of 0.1 mm in X alone, both ways round: X's reversals and the hysteresis have its size, Y's reversals nothing. Without play there is
/// none. Half a circle, a helix and arcs about other centres are no circles; two and four arcs about one are. Each has its picture.
#[test]
fn play_is_seen_at_the_quadrants() {
    let program = "G21 G90 G61 G17\nG0 X50 Y0\nG2 X50 Y0 I-50 J0 P3 F3000\nG3 X50 Y0 I-50 J0 P3\n\
                   G3 X-50 Y0 I-50\nG1 X-20\nG1 X50\nG3 X50 Y0 Z-5 I-50\n\
                   G2 X-50 I-50\nG2 X50 I50\nG0 Z0\nG3 X0 Y50 I-50\nG3 X-50 Y0 J-50\nG3 X0 Y-50 I50\nG3 X50 Y0 J50\nM2\n";
    let of = |simulation: &str| {
        let axis = format!("{LIMITS}[axis.simulation]\nload = 40.0\n{simulation}\n");
        circles("", &[(LIMITS, &axis)], program)
    };
    let (stiff, report) = of("");
    let lines = |json: &Value| -> Vec<_> {
        let told = all(json).iter();
        told.map(|it| (it["line"].as_u64().unwrap(), it["turn"].as_u64().unwrap()))
            .collect()
    };
    let expected = [
        (3, 1),
        (3, 2),
        (3, 3),
        (4, 1),
        (4, 2),
        (4, 3),
        (9, 1),
        (12, 1),
    ];
    assert_eq!(lines(&stiff), expected, "{stiff:#}");
    assert_eq!(
        report.matches("Deviation round the circle").count(),
        expected.len()
    );
    for it in all(&stiff) {
        assert_eq!(
            (it["plane"].as_str(), it["clockwise"].as_bool()),
            (Some("XY"), Some(it["line"] == 3 || it["line"] == 9))
        );
        assert!((number(it, "/radius_mm") - 50.0).abs() < 1e-9);
        assert!((number(it, "/feed_mm_min") - 3000.0).abs() < 1e-6);
        let deviation = number(it, "/circular_deviation_mm");
        assert!(deviation > 0.0 && deviation < 0.025, "{it:#}");
    }
    let both = |json: &Value| number(json, "/circles/4/both_ways/hysteresis_mm");
    assert!(both(&stiff) < 0.02, "{}", both(&stiff));
    let (play, _) = of("transmission = \"rack\"\nplay = 0.1\nfriction = 30.0");
    assert_eq!(lines(&play), expected);
    let middle = &all(&play)[1];
    for (axis, size) in [("X", 0.1), ("Y", 0.0)] {
        for side in ["+", "-"] {
            let error = reversal(middle, axis, side);
            // Without play friction makes a spike of 10 µm until the speed loop has turned its torque.
            let beyond = error - size;
            assert!((-0.005..0.03).contains(&beyond), "{axis}{side} {error}");
        }
    }
    assert!((both(&play) - 0.1).abs() < 0.015, "{}", both(&play));
    assert!(number(middle, "/circular_deviation_mm") > 0.08);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8, ..ProptestConfig::default() })]

    /// Position loops without velocity feed-forward lag by 1 / Kp, and go round a circle that is smaller by R (1 − 1 / √(1 + (v / R Kp)²)), at any
    /// radius, feed, place and direction: in the middle of three turns, where the feed is even. What the loops' cycles and filters
    /// delay by d besides makes it less by the part 2 d Kp.
    #[test]
    fn loops_that_lag_make_the_radius_less(
        radius in 20.0..60.0_f64, part in 0.3..0.5_f64, gain in 200..300_u32, clockwise in any::<bool>(), from in 0.0..TAU,
    ) {
        // As much as the accelerations allow.
        let feed = part * (300.0 * radius).sqrt();
        let loops = |name: &str| (
            format!("name = \"{name}\"\n"),
            format!("name = \"{name}\"\nsdo = [[\"3012:3\", {gain}], [\"3012:6\", 0], [\"3011:A\", 0]]\n"),
        );
        let (x, y) = (loops("left-right"), loops("front-back"));
        let wide = [LIMITS, LIMITS_Y].map(|it| it.replace("limit = 1.0", "limit = 10.0"));
        let replaced = [(&*x.0, &*x.1), (&y.0, &y.1), (LIMITS, &wide[0]), (LIMITS_Y, &wide[1])];
        let (sin, cos) = from.sin_cos();
        let code = if clockwise { "G2" } else { "G3" };
        let program = format!(
            "G21 G90 G61 G17\nG1 X{:.6} Y{:.6} F600\n{code} I{:.6} J{:.6} P3 F{:.3}\nM2\n",
            radius * cos, radius * sin, -radius * cos, -radius * sin, 60.0 * feed
        );
        let (json, _) = circles("", &replaced, &program);
        prop_assert_eq!(all(&json).len(), 3, "{:#}", json);
        let middle = &all(&json)[1];
        prop_assert!((number(middle, "/speed_mm_min") / (60.0 * feed) - 1.0).abs() < 1e-3, "{:#}", middle);
        let lag = feed / radius / (0.1 * f64::from(gain));
        let less = radius * (1.0 - 1.0 / lag.hypot(1.0));
        let found = -number(middle, "/mean_deviation_mm");
        prop_assert!((0.93..1.01).contains(&(found / less)), "{found} {less}");
        prop_assert!(number(middle, "/circular_deviation_mm") < 0.01, "{:#}", middle);
    }
}

/// What `[validation]` allows decides at the number that is told.
#[test]
fn a_tolerance_decides() {
    let program = "G61 F2000\nG0 X30\nG3 I-30\nM2\n";
    let (free, _) = circles("", &[], program);
    assert_eq!(free["verdict"], "pass", "{free:#}");
    let told = number(&free, "/circles/0/circular_deviation_mm");
    for (part, verdict) in [(1.0 + 1e-6, "pass"), (1.0 - 1e-6, "fail")] {
        let tolerance = format!("[validation]\ncircular_deviation = {}\n", told * part);
        let (json, _) = circles(&tolerance, &[], program);
        assert_eq!(json["verdict"], verdict, "{json:#}");
        let first = &json["violations"][0]["what"];
        assert!(
            verdict == "pass" || first == "circular_deviation",
            "{json:#}"
        );
    }
}
