//! What bounds the time of a program, and that it does.

use proptest::prelude::*;
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;
use syncline_controller::machine::Machine;
use syncline_controller::program::bounds::{BoundShare, STEP, TimeBounds};
use syncline_controller::program::{Program, Programs};
use syncline_strict_toml::set;
use syncline_tests::command::{Folder, ended, machine_with, syncline};

/// A program on a machine.
#[derive(Clone, Debug)]
struct Case {
    machine: String,
    /// With `{F}` where its feed stands, and `{P}` where its tolerance does.
    program: String,
    feed: f64,
    tolerance: f64,
}

impl Case {
    fn machine(&self) -> Machine {
        Machine::parse(Path::new("case.toml"), &self.machine).unwrap()
    }

    fn text(&self) -> String {
        let text = self.program.replace("{F}", &self.feed.to_string());
        text.replace("{P}", &self.tolerance.to_string())
    }

    fn program(&self) -> Program {
        let programs = Programs::new(&self.machine(), Path::new("none.toml")).unwrap();
        programs.text("case", self.text().as_bytes())
    }

    fn bounds(&self) -> TimeBounds {
        self.program().time_bounds(&self.machine()).unwrap()
    }

    fn time(&self) -> f64 {
        self.program().motion_time(self.machine().rest()).unwrap()
    }

    /// The same with a bound raised where a person would: in the machine file, or in the program.
    fn raised(&self, what: &str, axis: Option<&str>) -> Self {
        let mut raised = self.clone();
        match (what, axis) {
            ("feed", _) => raised.feed *= 1.0 + STEP,
            ("tolerance", _) => {
                raised.tolerance *= 1.0 + STEP;
                let exact = self.machine().path.exact * (1.0 + STEP);
                let setting = format!("path.exact_tolerance={exact}");
                raised.machine = set(&raised.machine, &setting).unwrap();
            }
            (what, Some(axis)) => {
                let machine = self.machine();
                let limits = machine
                    .axes
                    .iter()
                    .find(|it| it.name() == axis)
                    .unwrap()
                    .limits;
                let value = match what {
                    "velocity" => limits.velocity,
                    "acceleration" => limits.acceleration,
                    _ => limits.jerk,
                };
                let setting = format!("axis.{axis}.max_{what}={}", value * (1.0 + STEP));
                raised.machine = set(&raised.machine, &setting).unwrap();
            }
            other => panic!("{other:?}"),
        }
        raised
    }
}

/// The xyz machine, whose limits are these of X, Y and Z.
fn machine(limits: &[[f64; 3]; 3]) -> String {
    let axes = ["X", "Y", "Z"].iter().zip(limits);
    axes.fold(machine_with("xyz", &[]), |text, (axis, limits)| {
        let keys = ["velocity", "acceleration", "jerk"].iter().zip(limits);
        keys.fold(text, |text, (key, limit)| {
            set(&text, &format!("axis.{axis}.max_{key}={limit}")).unwrap()
        })
    })
}

fn log(range: std::ops::Range<f64>) -> impl Strategy<Value = f64> {
    (range.start.ln()..range.end.ln()).prop_map(f64::exp)
}

/// Lines and arcs of any length in every direction, rapids between them, all path modes, on machines whose axes
/// are slow and fast, soft and stiff.
fn case() -> impl Strategy<Value = Case> {
    let limits = || (log(30.0..900.0), log(200.0..8000.0), log(4e3..3e5));
    let axes = [limits(), limits(), limits()];
    let place = || (-190.0..190.0_f64, -190.0..190.0_f64, -140.0..10.0_f64);
    let block = (place(), 0_u8..6, 0.1..40.0_f64);
    let mode = prop_oneof![Just("G61.1"), Just("G61"), Just("G64 P{P}")];
    (
        axes,
        mode,
        log(300.0..30_000.0),
        log(0.002..0.5),
        prop::collection::vec(block, 2..12),
    )
        .prop_map(|(axes, mode, feed, tolerance, blocks)| {
            let limits = axes.map(|(v, a, j)| [v, a, j]);
            let mut program = format!("{mode} F{{F}}\n");
            for ((x, y, z), kind, by) in blocks {
                let _ = match kind {
                    0 => writeln!(program, "G0 X{x:.3} Y{y:.3} Z{z:.3}"),
                    1 => writeln!(program, "G91\nG1 X{by:.3}\nG90\nG1 X{x:.3}"),
                    // A circle wherever that is, of a radius that stays inside.
                    2 => writeln!(program, "G1 X{:.3} Y0 Z{z:.3}\nG3 I{by:.3}", 0.5 * x),
                    3 => writeln!(program, "G1 Z{z:.3}"),
                    _ => writeln!(program, "G1 X{x:.3} Y{y:.3}"),
                };
            }
            program += "M2\n";
            Case {
                machine: machine(&limits),
                program,
                feed,
                tolerance,
            }
        })
}

/// Of a line from rest to rest the time is D/F + F/A + A/J, and each share the derivative of that.
#[test]
fn shares_of_a_line_are_those_of_its_closed_form() {
    let (distance, feed, acceleration, jerk) = (150.0, 200.0, 2500.0, 50_000.0);
    let case = Case {
        machine: machine_with("xyz", &[]),
        program: "G61.1 F{F}\nG1 Y150\nM2\n".to_owned(),
        feed: 60.0 * feed,
        tolerance: 0.0,
    };
    let closed = |f: f64, a: f64, j: f64| distance / f + f / a + a / j;
    let time = closed(feed, acceleration, jerk);
    let (cruise, ramp, rise) = (distance / feed, feed / acceleration, acceleration / jerk);
    let bounds = case.bounds();
    assert!((bounds.motion_s - time).abs() < 1e-6, "{bounds:?} {time}");
    let more = 1.0 + STEP;
    let expected = [
        (
            "feed",
            None,
            cruise - ramp,
            closed(feed * more, acceleration, jerk),
        ),
        (
            "jerk",
            Some("Y"),
            3.0 * rise,
            closed(feed, acceleration, jerk * more),
        ),
        (
            "acceleration",
            Some("Y"),
            2.0 * (ramp - rise),
            closed(feed, acceleration * more, jerk),
        ),
    ];
    assert_eq!(bounds.bounds.len(), expected.len(), "{bounds:?}");
    for (found, (what, axis, part, raised)) in bounds.bounds.iter().zip(expected) {
        assert_eq!((found.what, found.axis), (what, axis), "{bounds:?}");
        assert!(
            (found.share - part / time).abs() < 0.01,
            "{found:?} {}",
            part / time
        );
        assert!(
            (found.saves_s - (time - raised)).abs() < 1e-6,
            "{found:?} {}",
            time - raised
        );
    }
}

/// A feed that the axis just allows: neither helps alone, and that is said.
#[test]
fn bounds_that_bind_together_are_told_as_that() {
    let case = Case {
        machine: machine_with("xyz", &[]),
        program: "G61.1 F{F}\nG1 Y190\nG1 Y-190\nM2\n".to_owned(),
        feed: 60.0 * 400.0,
        tolerance: 0.0,
    };
    let bounds = case.bounds().bounds;
    assert_eq!(bounds[0].what, "several", "{bounds:?}");
    let rest = bounds
        .iter()
        .all(|it| it.what != "feed" && it.what != "velocity");
    assert!(rest, "{bounds:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(2) })]

    /// Raising the first bound saves what is said, raising one that is not named next to nothing; and shares add up.
    #[test]
    fn what_is_said_to_bound_the_time_does(case in case()) {
        let bounds = case.bounds();
        let time = case.time();
        prop_assert!((bounds.motion_s - time).abs() < 1e-12);
        let sum: f64 = bounds.bounds.iter().map(|it| it.share).sum();
        prop_assert!((sum - 1.0).abs() < 1e-9, "{bounds:?}");
        let first = bounds.bounds.iter().find(|it| it.what != "several");
        if let Some(BoundShare { what, axis, saves_s, .. }) = first {
            let saved = time - case.raised(what, *axis).time();
            prop_assert!((saved / saves_s - 1.0).abs() < 0.2, "{what} {axis:?}: {saved} {saves_s}");
        }
        for what in ["feed", "tolerance", "velocity", "acceleration", "jerk"] {
            let axes: &[Option<&str>] = match what {
                "feed" | "tolerance" => &[None],
                _ => &[Some("X"), Some("Y"), Some("Z")],
            };
            for &axis in axes {
                let is_named = bounds.bounds.iter().any(|it| (it.what, it.axis) == (what, axis));
                if !is_named {
                    let saved = time - case.raised(what, axis).time();
                    prop_assert!(saved < 1e-3 * time, "{what} {axis:?}: {saved} of {time}");
                }
            }
        }
    }
}

/// The whole of it: what `validate` says of a program comes true where the bound is raised on the machine.
#[test]
fn what_validate_says_comes_true_on_the_machine() {
    let folder = Folder::new();
    let machine = folder.machine("xyz");
    let program = "G64 P0.02 F15000\nG0 X100 Y50\nG1 X-100\nG2 X-60 Y90 R40\nG1 X80 Y-80 Z-60\nG0 Z0\nG1 X0 Y0\nM2\n";
    let program = folder.file("program.ngc", program);
    let json = |more: &[&str]| -> Value {
        let mut command = syncline();
        command
            .args(["validate", "--json", "-"])
            .args([&machine, &program]);
        let output = command.args(more).output().unwrap();
        let (code, json, errors) = ended(&output);
        assert_eq!(code, 0, "{errors}");
        serde_json::from_str(json).unwrap()
    };
    let motion = |json: &Value| json["times"]["motion_s"].as_f64().unwrap();
    let plain = json(&["--time-bounds"]);
    let bounds = plain["time_bounds"]["bounds"].as_array().unwrap();
    let planned = plain["time_bounds"]["motion_s"].as_f64().unwrap();
    assert!(
        (planned - motion(&plain)).abs() < 0.05,
        "{planned} {plain:#}"
    );
    let of_axis = bounds.iter().find(|it| it["axis"].is_string()).unwrap();
    let (what, axis) = (
        of_axis["what"].as_str().unwrap(),
        of_axis["axis"].as_str().unwrap(),
    );
    let limit = Machine::load(&machine).unwrap();
    let limit = limit
        .axes
        .iter()
        .find(|it| it.name() == axis)
        .unwrap()
        .limits;
    let limit = match what {
        "velocity" => limit.velocity,
        "acceleration" => limit.acceleration,
        _ => limit.jerk,
    };
    let raised = json(&[
        "--set",
        &format!("axis.{axis}.max_{what}={}", limit * (1.0 + STEP)),
    ]);
    let saved = motion(&plain) - motion(&raised);
    let said = of_axis["saves_s"].as_f64().unwrap();
    // To a cycle of 4 ms at either end.
    assert!(
        (saved - said).abs() < 0.2 * said + 0.008,
        "{saved} {said} {of_axis}"
    );
}
