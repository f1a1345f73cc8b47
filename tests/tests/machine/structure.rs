//! A structure that sways between tool and workpiece as axes accelerate.

use serde_json::Value;
use std::f64::consts::TAU;
use std::process::Output;
use syncline_tests::command::{Folder, ended, machine_with, syncline};

/// Hz and damping ratio of what sways along X, and its mass, kg.
const SWAYS: [f64; 3] = [8.0, 0.02, 600.0];

/// A machine whose X pushes its structure.
struct Pushing {
    machine: &'static str,
    /// Of its simulation.
    keys: &'static str,
    /// What its drives move, kg: nothing gives way in between.
    mass: f64,
}

/// One drive, that counts the other way.
const ALONE: Pushing = Pushing {
    machine: "xyz",
    keys: "motor=\"generic-3\",load=60.0",
    mass: 60.0,
};

/// Both sides of a beam with what it carries.
const BEAM: Pushing = Pushing {
    machine: "portal",
    keys: "mechanics=\"rigid_beam\",mass=80.0,inertia=15.0,span=1500.0,racking_stiffness=2e6,racking_damping=300.0,\
           carriage=\"Y\",carriage_mass=35.0",
    mass: 115.0,
};

/// The shaper of a machine, as it stands in its file.
const ZVD: &str = "[shaper]\nkind = \"zvd\"\nmodes = [[8.0, 0.02]]\n\n[[bus]]\nname = \"main\"";

/// `validate` of a program on the machine `xyz`, along whose X a structure with these modes sways.
fn validate(folder: &Folder, modes: &str, shaper: bool, program: &str, more: &[&str]) -> Output {
    let replaced = [("[[bus]]\nname = \"main\"", ZVD)];
    let replaced = if shaper { &replaced[..] } else { &[] };
    let machine = machine_with(ALONE.machine, replaced);
    pushed(&ALONE, &machine, folder, modes, program, more)
}

/// The same on any machine.
fn pushed(
    pushing: &Pushing,
    machine: &str,
    folder: &Folder,
    modes: &str,
    program: &str,
    more: &[&str],
) -> Output {
    let machine = folder.file("machine.toml", machine);
    let program = folder.file("program.ngc", program);
    let simulation = format!("axis.X.simulation={{{},structure={modes}}}", pushing.keys);
    let mut command = syncline();
    command.args(["validate", "--json", "-", "--set", &simulation]);
    command
        .args(more)
        .args([&machine, &program])
        .output()
        .unwrap()
}

fn json(output: &Output) -> Value {
    let (_, json, errors) = ended(output);
    serde_json::from_str(json).unwrap_or_else(|error| panic!("{error}: {errors}"))
}

fn number(of: &Value, path: &str) -> f64 {
    let found = of.pointer(path).and_then(Value::as_f64);
    found.unwrap_or_else(|| panic!("no {path}: {of:#}"))
}

fn modes(frequency: f64) -> String {
    let [_, damping, mass] = SWAYS;
    format!("[[{frequency:?},{damping:?},{mass:?}]]")
}

/// A move of X, with time for what it leaves behind.
fn moved(mm: f64) -> String {
    format!("G21 G90 G61 F12000\nG1 X{mm:.3}\nG4 P0.3\nM2\n")
}

/// Where the axis was in every cycle says how far the tool swayed, by an integration of its own.
#[test]
fn the_sway_is_what_the_axis_s_acceleration_makes_of_it() {
    for pushing in [ALONE, BEAM] {
        let folder = Folder::new();
        let trace = folder.path("trace.csv");
        let program = "G21 G90 G61 F12000\nG1 X80\nG1 X75\nG1 X5\nG4 P0.3\nM2\n";
        let machine = machine_with(pushing.machine, &[]);
        let more = ["--trace", trace.to_str().unwrap()];
        let output = pushed(&pushing, &machine, &folder, &modes(8.0), program, &more);
        let sway = number(&json(&output), "/structures/0/max_sway_mm");
        let expected = swayed(&folder.read("trace.csv"), pushing.mass);
        assert!(
            expected > 0.1 && (sway / expected - 1.0).abs() < 0.03,
            "{} {sway} {expected}",
            pushing.machine
        );
    }
}

/// How far the tool swayed at most by a trace of X with so much mass. Between two SYNCs the axis is taken to accelerate as three
/// positions have it, in steps of a fiftieth.
fn swayed(trace: &str, mass: f64) -> f64 {
    let mut lines = trace.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| head.iter().position(|it| *it == name).unwrap();
    let (time, actual) = (column("t_s"), column("X_act"));
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        [time, actual].map(|at| cells[at].parse::<f64>().unwrap())
    };
    let rows: Vec<_> = lines.map(row).collect();
    let [frequency, damping, swaying] = SWAYS;
    let own = TAU * frequency;
    let (mut q, mut v, mut most) = (0.0_f64, 0.0_f64, 0.0_f64);
    for rows in rows.windows(3) {
        let h = rows[1][0] - rows[0][0];
        let acceleration = (rows[2][1] - 2.0 * rows[1][1] + rows[0][1]) / (h * h);
        for _ in 0..50 {
            let pushed = -mass * acceleration / swaying;
            v += (pushed - 2.0 * damping * own * v - own * own * q) * h / 50.0;
            q += v * h / 50.0;
            most = most.max(q.abs());
        }
    }
    most
}

/// What is left behind moves of so many lengths, each with a shaper over that without one: at the frequency of the shaper and 14 %
/// beside it. Torque ripple and friction of the drives may add 0.3 µm to a twentieth.
fn left(lengths: impl Iterator<Item = f64>) -> f64 {
    let folder = Folder::new();
    let mut worst = 0.0_f64;
    for length in lengths {
        for frequency in [8.0, 8.0 * 0.86, 8.0 * 1.14] {
            let [plain, shaped] = [false, true].map(|shaper| {
                let output = validate(&folder, &modes(frequency), shaper, &moved(length), &[]);
                number(&json(&output), "/structures/0/max_residual_mm")
            });
            assert!(
                shaped <= 0.05 * plain + 3e-4,
                "{length} {frequency}: {shaped} {plain}"
            );
            worst = worst.max(shaped / plain);
        }
    }
    worst
}

/// A shaper leaves at most a twentieth of the vibration of moves, with the loops of the drives in between.
#[test]
fn a_shaper_keeps_the_structure_from_swaying_on() {
    left([0.4, 41.0].into_iter());
}

#[test]
#[ignore = "a minute: 60 lengths"]
fn a_shaper_keeps_the_structure_from_swaying_on_behind_any_move() {
    let worst = left((0..60).map(|n| 0.1 * 1.12_f64.powi(n)));
    println!("at most {:.2} % left", 100.0 * worst);
}

/// The contour error is the tool's, not the axes': it is at most the sum of its parts, and what is too much of it is the
/// structure's and no axis's.
#[test]
fn a_sway_across_the_path_is_a_contour_error_and_named_as_its_cause() {
    let folder = Folder::new();
    let program = "G21 G90 G61 F9000\nG1 X60\nG1 Y40\nG1 X0\nM2\n";
    let tolerance = ["--set", "validation.contour_error=0.05"];
    let found = json(&validate(&folder, "[]", false, program, &tolerance));
    assert_eq!(found["verdict"], "pass", "{found:#}");
    assert!(found.get("structures").is_none());
    let rigid = number(&found, "/path/max_contour_error_mm");
    let output = validate(&folder, &modes(8.0), false, program, &tolerance);
    assert_eq!(output.status.code(), Some(1));
    let found = json(&output);
    let [contour, drives, rounding] = [
        "max_contour_error_mm",
        "max_drive_deviation_mm",
        "max_deviation_mm",
    ]
    .map(|key| number(&found, &format!("/path/{key}")));
    let sway = number(&found, "/structures/0/max_sway_mm");
    assert!(
        contour > 3.0 * rigid && contour <= rounding + drives + sway,
        "{found:#}"
    );
    assert_eq!(found["violations"][0]["what"], "contour_error", "{found:#}");
    assert_eq!(found["cause"]["what"], "structure", "{found:#}");
    assert_eq!(found["cause"]["axis"], "X");
    assert_eq!(
        found["cause"]["follows_with"][0],
        "axis.X.simulation.structure=[]"
    );
    let again = validate(&folder, "[]", true, program, &tolerance);
    assert_eq!(again.status.code(), Some(0), "{}", json(&again));
}

/// A steady force and one in resonance, by k = M ω² and 1 / 2ζ of it.
#[test]
fn its_compliance_is_told_over_frequency() {
    let folder = Folder::new();
    let report = folder.path("report.html");
    let more = ["--report", report.to_str().unwrap()];
    let found = json(&validate(&folder, &modes(8.0), false, &moved(10.0), &more));
    let [frequency, damping, mass] = SWAYS;
    let steady = 1e6 / (mass * (TAU * frequency).powi(2));
    let close = |path: &str, expected: f64| {
        let value = number(&found, path);
        assert!(
            (value / expected - 1.0).abs() < 1e-9,
            "{path}: {value} {expected}"
        );
    };
    close("/structures/0/static_compliance", steady);
    close("/structures/0/worst_compliance/frequency", frequency);
    close(
        "/structures/0/worst_compliance/um_per_n",
        steady / (2.0 * damping),
    );
    let html = folder.read("report.html");
    assert!(html.contains("Compliance along X") && html.contains("tool sways max"));
}

#[test]
fn what_cannot_sway_is_refused_with_what_can() {
    let folder = Folder::new();
    for wrong in [
        "[[8.0,0.02]]",
        "[[0.1,0.02,600.0]]",
        "[[8.0,0.0,600.0]]",
        "[[8.0,0.5,600.0]]",
        "[[8.0,0.02,0.0]]",
        "[[8.0,0.02,600.0],[7.0,0.02,600.0]]",
        "[[1,0.1,9],[2,0.1,9],[3,0.1,9],[4,0.1,9],[5,0.1,9],[6,0.1,9],[7,0.1,9],[8,0.1,9],[9,0.1,9]]",
    ] {
        let output = validate(&folder, wrong, false, &moved(1.0), &[]);
        let (code, _, errors) = ended(&output);
        assert_eq!(code, 2, "{wrong}: {errors}");
        assert!(
            errors.contains("[[frequency, damping, mass], …]"),
            "{wrong}: {errors}"
        );
    }
}
