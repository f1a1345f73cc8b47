//! The machine of drives of several kinds, `examples/mixed`: its program runs, and how far each kind takes the tool off
//! the path.

use super::scripted::Day;
use serde_json::Value;
use syncline_tests::command::{Folder, ended, machine_file, machine_with, syncline};

/// All of the path on LXM32M, with the limits as they are.
const PURE: [(&str, &str); 3] = [
    (
        "node = 3\nmodel = \"tlc5xx\"\nzero = 50_266",
        "node = 3\nmodel = \"lxm32m\"\nzero = 402_131",
    ),
    (
        "node = 4\nmodel = \"tsp10\"\nsdo = [[\"6075:0\", 5000]]",
        "node = 4\nmodel = \"lxm32m\"",
    ),
    (
        "position_loop = \"encoder\"\nunsupervised_stop = \"hardware\"\n",
        "",
    ),
];

/// The lag of the TLC53x is not known to the controller.
const UNLED: (&str, &str) = (
    "[spindle]",
    "[model.tlc5xx]\nposition_lag_us = 0\n[spindle]",
);

/// The controller takes the LXM32M for a drive that is where it was sent as soon as it has the setpoint.
const UNCOMPENSATED: (&str, &str) = (
    "[spindle]",
    "[model.lxm32m]\ninterpolation_delay = 0\n[spindle]",
);

/// The example's program, or `program`, on the machine with these changes.
fn validate(changes: &[(&str, &str)], program: Option<&str>) -> Value {
    let folder = Folder::new();
    let machine = folder.file("machine.toml", &machine_with("mixed", changes));
    let example = syncline_tests::command::root().join("examples/mixed/parts.ngc");
    let program = program.map_or(example, |text| folder.file("program.ngc", text));
    let json = folder.path("result.json");
    let output = syncline()
        .arg("validate")
        .args([&machine, &program])
        .arg("--json")
        .arg(&json)
        .output()
        .unwrap();
    let (_, printed, told) = ended(&output);
    let result = serde_json::from_str(&folder.read("result.json"));
    result.unwrap_or_else(|_| panic!("{printed}{told}"))
}

fn contour_error(result: &Value) -> f64 {
    let error = result.pointer("/path/max_contour_error_mm");
    error.and_then(Value::as_f64).expect("it was measured")
}

fn following_error(result: &Value, axis: &str) -> f64 {
    let axes = result["axes"].as_array().expect("a list");
    let axis = axes.iter().find(|it| it["name"] == axis).expect("its axis");
    axis["max_following_error_mm"].as_f64().expect("a number")
}

#[test]
fn its_program_passes_and_each_axis_is_within_its_own_bound() {
    let mixed = validate(&[], None);
    assert_eq!(mixed["verdict"], "pass", "{mixed:#}");
    let pure = validate(&PURE, None);
    assert_eq!(pure["verdict"], "pass", "{pure:#}");
    let errors = ["X", "Y", "Z"].map(|axis| [&mixed, &pure].map(|it| following_error(it, axis)));
    println!(
        "contour {} {}, axes {errors:?}",
        contour_error(&mixed),
        contour_error(&pure)
    );
    let [[x, pure_x], [y, _], [z, _]] = errors;
    // As `velocity` and `stepper` have them.
    assert!(x < 0.03 && y <= 0.1 && z <= 0.05, "{errors:?}");
    assert!(contour_error(&mixed) <= x.hypot(y).hypot(z) + 0.001);
    // The other kinds of drives are nothing to X.
    assert!((x - pure_x).abs() < 0.001, "{x}, {pure_x}");
}

/// A day with it runs it twice, is the same again, frame for frame, and is replayed.
#[test]
fn a_day_runs_its_program() {
    let parts = syncline_tests::command::root().join("examples/mixed/parts.ngc");
    let events = format!(",load,{}\n,run,\n,run,\n", parts.display());
    let machine = machine_file("mixed");
    let day = Day::of(&machine, &events, &[]);
    assert_eq!(day.code, 0, "{}", day.told);
    assert_eq!(day.json["verdict"], "pass", "{:#}", day.json);
    let axes = day.json["axes"].as_array().expect("a list");
    let feeder = axes.iter().find(|it| it["name"] == "U").expect("its axis");
    assert_eq!(feeder["positioning"]["moves"], 5);
    assert_eq!(Day::of(&machine, &events, &[]).frames(), day.frames());
    let (code, text) = day.replay(&machine);
    assert_eq!(code, 0, "{text}");
}

/// Also where a stepper controller tells each change of its statusword by itself, several times in a cycle.
#[test]
fn no_cycle_is_busier_than_its_bus_is_told_to_be() {
    let result = validate(&[], None);
    let mut budget = syncline();
    budget
        .arg("budget")
        .arg(machine_file("mixed"))
        .arg("--json");
    let budget: Value = serde_json::from_slice(&budget.output().unwrap().stdout).unwrap();
    for bus in 0..2 {
        let of = |json: &Value, path: &str| json.pointer(path).and_then(Value::as_f64).unwrap();
        let busiest = of(&result, &format!("/bus/{bus}/peak_utilisation"));
        let told = of(&budget, &format!("/buses/{bus}/load"));
        println!("bus {bus}: {busiest} of {told}");
        assert!(
            busiest <= told && told < 1.0,
            "bus {bus}: {busiest} of {told}"
        );
    }
}

#[test]
fn a_lag_that_is_not_led_shows_on_its_circle() {
    let circle =
        "G21 G90 G94 G61\nG0 X220 Y200\nG1 F6000\nG3 X220 Y200 I-20\nG3 X220 Y200 I-20\nM2\n";
    let [led, unled] = [&[][..], &[UNLED]].map(|changes| validate(changes, Some(circle)));
    let [led, unled] = [led, unled].map(|result| contour_error(&result));
    println!("{led} {unled}");
    assert!(unled >= 5.0 * led, "{led}, {unled}");
}

/// All axes are at the same place of the path at the same instant, as each is sent the plan earlier by what its drive is late.
/// Where the controller does not know of the latency of one, that axis is late by it.
#[test]
fn a_latency_that_is_not_compensated_shows_on_circles() {
    // In X and Y, and in X and Z, in whose plane Z allows half of the speed.
    let circles = [
        "G21 G90 G94 G61\nG1 X220 Y200 F6000\nG3 X220 Y200 I-20\nG3 X220 Y200 I-20\nM2\n",
        "G21 G90 G94 G61 G18\nG1 X220 Z-40 F3000\nG3 X220 Z-40 I-20\nG3 X220 Z-40 I-20\nM2\n",
    ];
    for (circle, velocity) in circles.into_iter().zip([100.0, 50.0]) {
        let errors =
            [&[][..], &[UNCOMPENSATED]].map(|it| contour_error(&validate(it, Some(circle))));
        let [with, without] = errors;
        println!("{with} {without}");
        assert!(without >= 5.0 * with, "{with}, {without}");
        // An axis that is late by a cycle makes an ellipse of the circle, which is off by half of its way meanwhile.
        let expected = velocity * 4e-3 / 2.0;
        assert!((without - expected).abs() < 0.02, "{without}, {expected}");
    }
}

/// What an axis that goes point to point did is told: how often, how long, how near to its targets, and where it is.
#[test]
fn the_moves_of_the_feeder_are_told() {
    let program = "G21 G90 G94 G61\nG0 U100\nG0 X200\nG0 U60\nG1 U80 F6000\nM2\n";
    let result = validate(&[], Some(program));
    assert_eq!(result["verdict"], "pass", "{result:#}");
    let axes = result["axes"].as_array().expect("a list");
    let of = |name: &str| axes.iter().find(|it| it["name"] == name).expect("its axis");
    assert_eq!(of("X").get("positioning"), None);
    let moves = &of("U")["positioning"];
    let number = |key: &str| moves.pointer(key).and_then(Value::as_f64).expect(key);
    assert_eq!(number("/moves"), 3.0, "{moves:#}");
    // The `standstill_window` of the axis, and less than a tenth of a millimetre.
    let (error, last) = (number("/max_error_mm"), number("/position_mm"));
    assert!(
        error <= 0.1 && (last - 80.0).abs() <= error + 1e-9,
        "{moves:#}"
    );
    // G1 over 20 mm at 100 mm/s takes more than 0.2 s; the longest one is that of line 2 or 4.
    let (longest, line) = (number("/longest_s"), number("/longest_at/line"));
    assert!(
        longest > 0.2 && longest < 10.0 && [2.0, 4.0, 5.0].contains(&line),
        "{moves:#}"
    );
    assert!(
        [2.0, 4.0, 5.0].contains(&number("/max_error_at/line")),
        "{moves:#}"
    );
}

/// The sides of a gantry may be of different kinds, which are sent different setpoints, at different times, for the same place:
/// each is held against its own.
#[test]
fn sides_of_any_two_kinds_are_one_axis() {
    const PROGRAM: &str = "G21 G90 G61\nG0 X40\nG1 F600 X-10\nG64\nG1 X0\nG1 F1500 X12\nM2\n";
    let kinds = ["lxm32m", "cia402_csp", "cia402_csv", "tlc5xx"];
    for one in kinds {
        for other in kinds {
            let folder = Folder::new();
            let drive = |name: &str, node: u8, model: &str, direction: &str| {
                format!(
                    "[[drive]]\nname = \"{name}\"\nbus = \"b\"\nnode = {node}\nmodel = \"{model}\"\ndirection = \"{direction}\"\n"
                )
            };
            let machine = format!(
                "[machine]\nname = \"g\"\ncycle_us = 4000\n[[bus]]\nname = \"b\"\nbitrate = 1_000_000\nport = \"sim\"\n{}{}\
                 [[axis]]\nname = \"X\"\ndrives = [\"A\", \"B\"]\npitch = 10.0\nmax_velocity = 50.0\nmax_acceleration = 300.0\n\
                 max_jerk = 6000.0\nsoft_limits = [-100.0, 100.0]\nfollowing_error_limit = 1.0\nskew_limit = 0.5\n\
                 simulation = {{ start_skew = 0.3 }}\n",
                drive("A", 1, one, "positive"),
                drive("B", 2, other, "negative"),
            );
            let machine = folder.file("machine.toml", &machine);
            let program = folder.file("part.ngc", PROGRAM);
            let output = syncline()
                .arg("validate")
                .args([machine, program])
                .output()
                .unwrap();
            let (code, printed, told) = ended(&output);
            assert_eq!(code, 0, "{one} {other}: {printed}{told}");
        }
    }
}
