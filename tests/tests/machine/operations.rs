//! The time of motion by tool and by operation.

use serde_json::Value;
use syncline_tests::command::{Folder, ended, machine_with, syncline};

/// Validated on the xyz machine: JSON and what people read.
fn validated(program: &str) -> (Value, String) {
    validated_on("xyz", program)
}

fn validated_on(machine: &str, program: &str) -> (Value, String) {
    let folder = Folder::new();
    let machine = folder.file("machine.toml", &machine_with(machine, &[]));
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

/// A thread is motion at a feed with the spindle that cuts it, as long as the program has it, and a tap goes there and back.
#[test]
fn threads_are_motion_of_their_operations() {
    let (json, told) = validated_on(
        "drill",
        "G61\nM3 S600\nG0 Z3\nG33 Z-22 K1.5\nM4 S300\nG33 Z3 K2\nM3 S600\nG33.1 Z-20 K1.5\nM5\nM2\n",
    );
    let operations = json["operations"].as_array().unwrap();
    let spindles = operations.iter().map(|it| it["spindle"].as_f64().unwrap());
    assert!(spindles.eq([600.0, -300.0, 600.0]), "{json:#}");
    // Longer than at the full speed of the spindle, by the ramp and the last stop.
    for (operation, in_step) in [(0, 25.0 / 15.0), (1, 25.0 / 10.0), (2, 46.0 / 15.0)] {
        let feed = number(&json, &format!("/operations/{operation}/feed_s"));
        assert!(
            (in_step..1.5 * in_step).contains(&feed),
            "{operation}: {feed}: {json:#}"
        );
    }
    let sum: f64 = operations
        .iter()
        .map(|it| it["motion_s"].as_f64().unwrap())
        .sum();
    assert!(
        (sum - number(&json, "/times/motion_s")).abs() < 1e-9,
        "{json:#}"
    );
    assert_eq!(number(&json, "/times/jogging_s"), 0.0, "{json:#}");
    let length = number(&json, "/path/length_mm");
    assert!((length - (3.0 + 25.0 + 25.0 + 46.0)).abs() < 0.1, "{told}");
}
