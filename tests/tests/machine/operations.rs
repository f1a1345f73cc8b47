//! The time of motion by tool and by operation.

use serde_json::Value;
use syncline_tests::command::{Folder, ended, machine_with, syncline};

/// Validated on the xyz machine: JSON and what people read.
fn validated(program: &str) -> (Value, String) {
    let folder = Folder::new();
    let machine = folder.file("xyz.toml", &machine_with("xyz", &[]));
    let program = folder.file("program.ngc", program);
    let json = folder.path("result.json");
    let mut command = syncline();
    command.arg("validate").args([&machine, &program]);
    let output = command.arg("--json").arg(&json).output().unwrap();
    let (code, told, errors) = ended(&output);
    assert_eq!(code, 0, "{errors}");
    let json = std::fs::read_to_string(json).unwrap();
    (serde_json::from_str(&json).unwrap(), told.to_owned())
}

fn number(json: &Value, pointer: &str) -> f64 {
    let value = json.pointer(pointer).and_then(Value::as_f64);
    value.unwrap_or_else(|| panic!("no number {pointer} in {json:#}"))
}

/// What a tool does takes as long as that alone, and all tools and operations together as long as the motion.
#[test]
fn each_tool_has_the_time_of_its_moves() {
    let first = "F3000\nG1 X60\nG1 Y40\n";
    let back = "G0 X0 Y0\n";
    let second = "F6000\nG1 X-50\nG0 X0\n";
    let alone = |moves: &str| {
        let (json, _) = validated(&format!("G61.1\n{moves}M2\n"));
        assert_eq!(
            json.get("tools"),
            None,
            "neither tool nor spindle: {json:#}"
        );
        number(&json, "/times/motion_s")
    };
    let program = format!(
        "G61.1\nT1 M6\nS1000 M3\n{first}S2000\n{back}M5\nT2 M6\n{second}T1 M6\n{first}{back}M2\n"
    );
    let (json, told) = validated(&program);
    let cycle = 0.004;
    let both = alone(&format!("{first}{back}"));
    let [first, second] = [first, second].map(alone);
    let back = both - first;
    // A move that begins or ends within a cycle has all of it.
    let is = |pointer: &str, expected: f64| {
        let found = number(&json, pointer);
        assert!(
            (found - expected).abs() <= 4.0 * cycle,
            "{pointer}: {found} {expected}: {json:#}"
        );
    };
    is("/tools/0/motion_s", 2.0 * (first + back));
    is("/tools/1/motion_s", second);
    for (at, (tool, spindle, line, time)) in [
        (1, 1000.0, 5, first),
        (1, 2000.0, 8, back),
        (2, 0.0, 12, second),
        (1, 0.0, 16, first + back),
    ]
    .into_iter()
    .enumerate()
    {
        assert_eq!(json["operations"][at]["tool"], tool, "{json:#}");
        assert_eq!(json["operations"][at]["spindle"], spindle, "{json:#}");
        assert_eq!(json["operations"][at]["line"], line, "{json:#}");
        is(&format!("/operations/{at}/motion_s"), time);
    }
    is("/operations/0/feed_s", first);
    is("/operations/1/feed_s", 0.0);
    for list in ["tools", "operations"] {
        let times = json[list].as_array().unwrap().iter();
        let sum: f64 = times.map(|it| it["motion_s"].as_f64().unwrap()).sum();
        assert!(
            (sum - number(&json, "/times/motion_s")).abs() < 1e-9,
            "{list}: {json:#}"
        );
    }
    assert!(told.contains("tool 1             "), "{told}");
    assert!(
        told.contains("operation          line 5: tool 1, spindle 1000 1/min"),
        "{told}"
    );
}
