//! The numbers of a validation, the tolerances that make verdicts of them, and which cause comes first.

use proptest::prelude::*;
use serde_json::Value;
use syncline_tests::command::{Folder, ended, machine_with, syncline};

/// A square with G64, an arc, and a move that crosses both.
const PROGRAM: &str = "G64 P0.05 F9000\nG0 X-80 Y-60\nG1 X80\nG1 Y60\nG3 X40 Y100 R40\nG1 X-80\nG1 Y-60\n\
                       G1 X60 Y80\nG0 X0 Y0\nM2\n";

/// The validation of a program on the xyz machine with more in its file and parts of it replaced.
fn validated(more: &str, replaced: &[(&str, &str)], program: &str) -> Value {
    validated_in(&Folder::new(), more, replaced, program)
}

/// The same beside other files.
fn validated_in(folder: &Folder, more: &str, replaced: &[(&str, &str)], program: &str) -> Value {
    let machine = folder.file("xyz.toml", &(machine_with("xyz", replaced) + more));
    let program = folder.file("program.ngc", program);
    let output = syncline()
        .args(["validate", "--json", "-"])
        .args([&machine, &program])
        .output()
        .unwrap();
    let (_, json, errors) = ended(&output);
    serde_json::from_str(json).unwrap_or_else(|error| panic!("{error}: {errors}"))
}

fn number(json: &Value, pointer: &str) -> f64 {
    let value = json.pointer(pointer).and_then(Value::as_f64);
    value.unwrap_or_else(|| panic!("no number {pointer} in {json:#}"))
}

fn first_violation(json: &Value) -> &str {
    json["violations"][0]["what"].as_str().unwrap_or("none")
}

/// Each tolerance fails the run just below what was measured, with that number and its place, and passes it just
/// above.
#[test]
fn each_tolerance_decides_at_the_number_that_is_told() {
    let free = validated("", &[], PROGRAM);
    assert_eq!(free["verdict"], "pass", "{free:#}");
    let following = (0..3)
        .map(|axis| number(&free, &format!("/axes/{axis}/max_following_error_mm")))
        .fold(0.0, f64::max);
    let contour = number(&free, "/path/max_contour_error_mm");
    let torque = (0..3).map(|drive| number(&free, &format!("/drives/{drive}/torque_reserve")));
    let torque = torque.fold(1.0, f64::min);
    let rms = (0..3)
        .map(|drive| {
            let of = |key| number(&free, &format!("/drives/{drive}/{key}"));
            of("rms_torque") / of("continuous_torque")
        })
        .fold(0.0, f64::max);
    let margin = |of: &str| {
        let loops = ["speed", "position"];
        let all = (0..3).flat_map(|drive| loops.map(|it| format!("/loops/{drive}/{it}/{of}")));
        all.map(|it| number(&free, &it))
            .fold(f64::INFINITY, f64::min)
    };
    for (key, what, value, more) in [
        ("phase_margin", "phase_margin, ", margin("phase"), -1.0),
        ("gain_margin", "gain_margin, ", margin("gain"), -1.0),
        ("contour_error", "contour_error", contour, 1.0),
        ("following_error", "following_error", following, 1.0),
        ("torque_reserve", "torque of drive", torque, -1.0),
        ("rms_torque", "rms_torque of drive", rms, 1.0),
    ] {
        let judged =
            |value: f64| validated(&format!("[validation]\n{key} = {value}\n"), &[], PROGRAM);
        let above = judged(value * (1.0 + 1e-6 * more));
        assert_eq!(above["verdict"], "pass", "{key}: {above:#}");
        let below = judged(value * (1.0 - 1e-6 * more));
        assert_eq!(below["verdict"], "fail", "{key}");
        assert!(
            first_violation(&below).starts_with(what),
            "{key}: {below:#}"
        );
        assert_eq!(below["frames_sha256"], free["frames_sha256"]);
        if key == "contour_error" {
            let (violation, at) = (
                &below["violations"][0],
                &free["path"]["max_contour_error_at"],
            );
            assert_eq!(
                [&violation["time_s"], &violation["line"]],
                [&at["time_s"], &at["line"]]
            );
        }
    }
}

/// A drive that comes and goes above what it may use is told once for each block, at its worst.
#[test]
fn a_torque_that_is_passed_again_and_again_is_told_once_for_a_block() {
    let program = "G61 F9000\nG1 X-80\nG1 X80\nG1 X-80\nG1 X0\nM2\n";
    let json = validated("[validation]\ntorque_reserve = 0.95\n", &[], program);
    let violations = json["violations"].as_array().unwrap();
    let of_x = violations
        .iter()
        .filter(|it| it["what"] == "torque of drive left-right");
    let lines: Vec<_> = of_x
        .clone()
        .map(|it| it["line"].as_u64().unwrap())
        .collect();
    assert_eq!(lines, [2, 3, 4, 5], "{violations:#?}");
    let worst = of_x.map(|it| it["value"].as_f64().unwrap());
    assert_eq!(
        worst.fold(0.0, f64::max),
        number(&json, "/drives/0/max_torque")
    );
}

/// The tool is off the program by no more than rounding and drives make together, and the drives are what a soft
/// position loop makes worse.
#[test]
fn the_contour_error_is_no_more_than_its_parts() {
    let parts = |replaced: &[(&str, &str)]| {
        let json = validated("", replaced, PROGRAM);
        let of = |key| number(&json, &format!("/path/max_{key}_mm"));
        let [whole, rounding, drives] = ["contour_error", "deviation", "drive_deviation"].map(of);
        assert!(
            whole <= rounding + drives + 1e-6,
            "{whole} {rounding} {drives}"
        );
        assert!(
            whole >= drives - rounding - 1e-6,
            "{whole} {rounding} {drives}"
        );
        (rounding, drives)
    };
    let (rounding, stiff) = parts(&[]);
    assert!(rounding > 0.03 && rounding <= 0.05, "{rounding}");
    // Half of the position loops' gain.
    let soft = [
        (
            "node = 17\nmodel = \"lxm32m\"\n",
            "node = 17\nmodel = \"lxm32m\"\nsdo = [[\"3012:3\", 200]]\n",
        ),
        (
            "node = 9\nmodel = \"lxm32m\"\n",
            "node = 9\nmodel = \"lxm32m\"\nsdo = [[\"3012:3\", 200]]\n",
        ),
    ];
    let (_, soft) = parts(&soft);
    assert!(soft > 1.5 * stiff, "{soft} {stiff}");
}

/// What accelerates a known inertia, against the motor's torque; and Coulomb friction, which the RMS shows where the
/// axis runs evenly for long.
#[test]
fn torque_is_that_of_the_inertia_and_the_friction() {
    let there_and_back =
        "G61 G1 F12000\n".to_owned() + &"G1 Y190\nG1 Y-190\n".repeat(4) + "G1 Y0\nM2\n";
    let with = |friction: f64| {
        let limits = "soft_limits = [-200.0, 200.0]\nfollowing_error_limit = 1.0\n";
        let axis = format!(
            "{limits}[axis.simulation]\nmotor = \"generic-3\"\nload = 60.0\nfriction = {friction:?}\n\
             motor_friction = 0.0\nmotor_viscous_friction = 0.0\n"
        );
        let slow = (
            "max_jerk = 50_000.0\nsoft_limits = [-200.0",
            "max_jerk = 5_000.0\nsoft_limits = [-200.0",
        );
        let json = validated("", &[slow, (limits, &axis)], &there_and_back);
        assert_eq!(json["verdict"], "pass", "{json:#}");
        json
    };
    // The travel for a radian of the motor, m.
    let radius = 0.020 / 1.5 / std::f64::consts::TAU;
    let json = with(0.0);
    // √(v j) is reached, and through a reversal that of twice the speed; cogging is up to 0.015 N·m.
    let accelerating = (2.8e-4 + 60.0 * radius * radius) * 2.0_f64.sqrt() / radius;
    let most = number(&json, "/drives/1/max_torque");
    // The loops overshoot a little.
    assert!(
        most > 0.95 * accelerating && most < 1.25 * accelerating,
        "{most} {accelerating}"
    );
    // 200 mm/s.
    let speed = number(&json, "/drives/1/max_speed_rpm");
    assert!(
        (speed / (200.0 / 20.0 * 1.5 * 60.0) - 1.0).abs() < 0.02,
        "{speed}"
    );
    let no_load = 560.0 / 6.0_f64.sqrt() / (1.2 / 3.0) / std::f64::consts::TAU;
    let reserve = number(&json, "/drives/1/speed_reserve");
    assert!(
        (reserve - (1.0 - speed / 60.0 / no_load)).abs() < 1e-9,
        "{reserve}"
    );

    let rms = number(&with(400.0), "/drives/1/rms_torque");
    let friction = 400.0 * radius;
    assert!(
        rms > 0.95 * friction && rms < 1.3 * friction,
        "{rms} {friction}"
    );
}

/// A motor that is too weak is told as that, before the following error that it leads to.
#[test]
fn a_weak_motor_is_the_first_cause() {
    let axis = "[axis.simulation]\nmotor = \"generic-0.4\"\nload = 400.0\n";
    let replaced = [(
        "soft_limits = [-200.0, 200.0]\nfollowing_error_limit = 1.0\n",
        &format!("soft_limits = [-200.0, 200.0]\nfollowing_error_limit = 1.0\n{axis}")[..],
    )];
    let json = validated("[validation]\ntorque_reserve = 0.02\n", &replaced, PROGRAM);
    assert_eq!(json["verdict"], "fail", "{json:#}");
    assert_eq!(
        first_violation(&json),
        "torque of drive front-back",
        "{json:#}"
    );
    let following = |it: &Value| it["what"].as_str().unwrap().contains("following");
    assert!(
        json["violations"].as_array().unwrap().iter().any(following),
        "{json:#}"
    );
}

/// A value that is set is as if it stood in the file, and tables that are named as if they stood beside it.
#[test]
fn values_and_tables_can_be_given_for_a_run() {
    let folder = Folder::new();
    let program = folder.file("program.ngc", PROGRAM);
    let hash = |machine: &str, more: &[&str]| {
        let mut command = syncline();
        command
            .args(["validate", "--json", "-"])
            .arg(folder.path(machine))
            .arg(&program);
        let output = command.args(more).output().unwrap();
        let (code, json, errors) = ended(&output);
        let json: Value = serde_json::from_str(json).unwrap_or_default();
        (code, json["frames_sha256"].clone(), errors.to_owned())
    };
    let plain = machine_with("xyz", &[]);
    let changed = plain.replacen("max_jerk = 50_000.0", "max_jerk = 20_000.0", 1)
        + "[path]\nexact_tolerance = 0.02\n";
    let _ = folder.file("plain.toml", &plain);
    let _ = folder.file("changed.toml", &changed);
    let set = [
        "--set",
        "axis.X.max_jerk=20000",
        "--set",
        "path.exact_tolerance=0.02",
    ];
    assert_eq!(hash("plain.toml", &set), hash("changed.toml", &[]));
    assert_ne!(hash("plain.toml", &[]).1, hash("changed.toml", &[]).1);

    let tables = "[work_offsets.G54]\nX = 3.0\nY = -2.0\n";
    let named = folder.file("other.toml", tables);
    // Those beside the machine file are not looked at then.
    let _ = folder.file("plain.tables.toml", "no table");
    let named = hash("plain.toml", &["--tables", named.to_str().unwrap()]);
    let _ = folder.file("plain.tables.toml", "");
    assert_ne!(named.1, hash("plain.toml", &[]).1);
    let _ = folder.file("plain.tables.toml", tables);
    assert_eq!(named, hash("plain.toml", &[]));

    for (option, value, why) in [
        ("--set", "axis.Q.max_jerk=1", "there is no axis \"Q\""),
        ("--set", "axis.X.max_jerk", "no `KEY=VALUE` as"),
        ("--set", "axis.X.max_jerk=-1", "`max_jerk` is -1"),
        ("--set", "axis.X.max_jrk=1", "unknown key `max_jrk`"),
        ("--tables", "none.toml", "cannot read none.toml"),
    ] {
        let (code, _, errors) = hash("plain.toml", &[option, value]);
        assert!(
            code == 2 && errors.matches(why).count() == 1,
            "{value}: {code} {errors}"
        );
    }
}

/// The sides of the portal on their beam: skew, racking torque and fight, and a tolerance for the first.
#[test]
fn a_gantry_tells_of_its_sides() {
    let folder = Folder::new();
    let beam = "skew_limit = 0.5\nsimulation = { mechanics = \"rigid_beam\", mass = 80.0, inertia = 15.0, span = \
                1500.0, racking_stiffness = 2e6, racking_damping = 300.0, carriage = \"Y\", carriage_mass = 35.0 }";
    let text = machine_with("portal", &[("skew_limit = 0.5", beam)]);
    let program = folder.file(
        "program.ngc",
        "F9000\nG1 X400 Y100\nG1 X100 Y700\nG1 X0 Y0\nM2\n",
    );
    let json = |more: &str| -> Value {
        let machine = folder.file("portal.toml", &(text.clone() + more));
        let output = syncline()
            .args(["validate", "--json", "-"])
            .args([&machine, &program])
            .output()
            .unwrap();
        let (_, json, errors) = ended(&output);
        serde_json::from_str(json).unwrap_or_else(|error| panic!("{error}: {errors}"))
    };
    let free = json("");
    assert_eq!(free["verdict"], "pass", "{free:#}");
    assert_eq!(free["gantries"][0]["axis"], "X");
    let of = |key: &str| number(&free, &format!("/gantries/0/{key}"));
    let (skew, torque) = (of("max_skew_mm"), of("max_racking_torque"));
    assert!(skew > 0.0 && skew < 0.1, "{skew}");
    // k θ, with a little of d θ̇.
    assert!(
        (torque / (2e6 * 1e-3 * skew / 1.5) - 1.0).abs() < 0.3,
        "{torque} {skew}"
    );
    assert!(of("rms_torque_fight") > 0.0 && of("rms_torque_fight") < of("max_torque_fight"));
    let judged = json(&format!("\n[validation]\nskew = {}\n", 0.9 * skew));
    assert_eq!(first_violation(&judged), "skew", "{judged:#}");
}

/// A speed loop whose gain is raised beyond its gain margin swings: it is said to, and fails, and only then, though no
/// margin is asked for.
#[test]
fn loops_that_swing_fail() {
    let gain = |gain: f64| {
        let name = "name = \"front-back\"";
        let entry = format!("{name}\nsdo = [[\"3012:1\", {}]]", gain.round());
        validated("", &[(name, &entry)], "G1 X1 F600\nM2\n")
    };
    let loops = |json: &Value| json["loops"][1].clone();
    let margin = |json: &Value| number(&loops(json), "/speed/gain");
    let one = gain(200.0);
    assert_eq!(loops(&one)["stable"], true, "{one:#}");
    // A greater gain has that much less of a margin, and swings once there is none.
    let lost = margin(&one) - margin(&gain(400.0));
    assert!((lost - 20.0 * 2.0_f64.log10()).abs() < 0.05, "{lost}");
    let least = 200.0 * 10.0_f64.powf(margin(&one) / 20.0);
    let calm = gain(0.95 * least);
    assert_eq!(loops(&calm)["stable"], true);
    assert!(
        !calm["violations"].to_string().contains("unstable"),
        "{calm:#}"
    );
    let swinging = gain(1.05 * least);
    assert_eq!(loops(&swinging)["stable"], false);
    assert_eq!(swinging["verdict"], "fail", "{swinging:#}");
    let violations = swinging["violations"].as_array().unwrap();
    let told = violations.iter().map(|it| it["what"].as_str().unwrap());
    assert!(
        told.clone()
            .any(|it| it == "unstable loop of drive front-back"),
        "{swinging:#}"
    );
}

/// What a motor cannot do over and over is told, with when it would be limited, and fails where that is asked for. Nothing is said of a motor that stands it, nor of one of which the file says nothing.
#[test]
fn what_is_too_much_for_ever_fails() {
    let strokes = "G61\n".to_owned() + &"G0 Y40\nG0 Y-40\n".repeat(4) + "M2\n";
    let with = |more: &str, simulation: &str| {
        let limits = "soft_limits = [-200.0, 200.0]\nfollowing_error_limit = 1.0\n";
        let axis = format!("{limits}{simulation}");
        let json = validated(more, &[(limits, &axis)], &strokes);
        let told = json["violations"].as_array().unwrap().iter();
        let told = told.map(|it| it["what"].as_str().unwrap().to_owned());
        let told: Vec<_> = told.filter(|it| it.starts_with("rms_torque")).collect();
        let of = |key| number(&json, &format!("/drives/1/{key}"));
        let load = of("rms_torque") / of("continuous_torque");
        let after = json["drives"][1]["limited_after_s"].as_f64();
        ((load, after), told, json["verdict"].clone())
    };
    let weak = "[axis.simulation]\nmotor = \"generic-0.4\"\nload = 60.0\nfriction = 180.0\n";
    let ((load, after), told, verdict) = with("", weak);
    assert_eq!(
        (told, verdict),
        (vec![], "pass".into()),
        "it is told, and not asked for"
    );
    let (_, told, verdict) = with("[validation]\nrms_torque = 1.0\n", weak);
    assert!(load > 1.0 && load < 1.5, "{load}");
    // From cold: the motor's 15 s, sooner than the drive's 4 s with half as much again.
    let expected = -15.0 * (1.0 - 1.0 / (load * load)).ln();
    assert!(
        after.is_some_and(|it| (it - expected).abs() < 1e-6),
        "{after:?} {expected}"
    );
    let expected = vec!["rms_torque of drive front-back".to_owned()];
    assert_eq!((told, verdict), (expected, "fail".into()));
    let (_, told, verdict) = with("[validation]\nrms_torque = 2.0\n", weak);
    assert_eq!((told, verdict), (vec![], "pass".into()));
    let strong = weak.replace("0.4", "3");
    let ((load, after), told, verdict) = with("", &strong);
    assert!(load < 1.0 && after.is_none(), "{load} {after:?}");
    assert_eq!((told, verdict), (vec![], "pass".into()));
    let (_, told, verdict) = with("", "");
    assert_eq!((told, verdict), (vec![], "pass".into()));
}

/// The tool is at the load: what lies between it and the motor is part of the contour error, and not where a scale sees the load.
#[test]
fn the_contour_error_is_that_of_the_load() {
    let limits = "soft_limits = [-250.0, 250.0]\nfollowing_error_limit = 1.0\n";
    let of = |simulation: &str| {
        let axis = format!("{limits}[axis.simulation]\nload = 40.0\n{simulation}\n");
        let diagonal = "G21 G90 G61\nG1 X100 Y100 F6000\nG4 P0.2\nG1 X0 Y0\nM2\n";
        validated("", &[(limits, &axis)], diagonal)
    };
    let contour = |json: &Value| number(json, "/path/max_contour_error_mm");
    let off = |json: &Value| {
        json.pointer("/transmissions/0/max_off_mm")
            .and_then(Value::as_f64)
    };
    let stiff = of("");
    assert!(contour(&stiff) < 0.01 && off(&stiff).is_none(), "{stiff:#}");
    // 100 µm along X where both lines end.
    let lead = of("lead_error = [[0.0, 0.0], [100.0, 100.0]]");
    assert!((off(&lead).unwrap() - 0.1).abs() < 1e-3, "{:?}", off(&lead));
    let beside = (contour(&lead) - 0.1).abs();
    assert!(beside < contour(&stiff) + 1e-3, "{}", contour(&lead));
    // 11.5 µm/m/K of steel, from the bearing on: nothing at 0, 23 µm at 100 mm.
    let warm = of("temperature_rise = 20.0");
    assert!((off(&warm).unwrap() - 0.023).abs() < 2e-4, "{warm:#}");
    let beside = (contour(&warm) - 0.023).abs();
    assert!(beside < contour(&stiff) + 1e-3, "{}", contour(&warm));
    // As it warms, 1 m from its bearing: some hundredths of 230 µm in the seconds that the program takes.
    let warming = of("temperature_rise = 20.0\nfixed_at = -1000.0\nwarming_time = 100.0");
    let given = off(&warming).unwrap();
    assert!((0.003..0.06).contains(&given), "{given}");
    let seen = of("temperature_rise = 20.0\nscale_step = 0.1");
    assert!(off(&seen).is_none());
    // From the middle between the flanks to one of them, and what twists.
    let play = of("transmission = \"rack\"\nplay = 0.1\nfriction = 30.0");
    let given = off(&play).unwrap();
    assert!((0.05..0.12).contains(&given), "{given}");
    assert!(contour(&play) > 0.03, "{}", contour(&play));
    let seen = of("transmission = \"rack\"\nplay = 0.1\nfriction = 30.0\nscale_step = 0.1");
    assert!(off(&seen).is_none());
}

/// A force of 2000 N/mm² on 1 mm at 0.1 mm a turn, 200 N, twists a screw of 20 N/µm by 10 µm, bends the structure by its static
/// compliance, and a quarter of it acts across.
#[test]
fn a_tool_that_cuts_pushes_at_the_loads() {
    let limits = "soft_limits = [-250.0, 250.0]\nfollowing_error_limit = 1.0\n";
    let axis = format!(
        "{limits}[axis.simulation]\nmotor = \"generic-3\"\nload = 40.0\ntransmission = \"screw\"\nstiffness = 20.0\n\
         structure = [[200.0, 0.3, 10.0]]\n"
    );
    let of = |cutting: &str, program: &str| validated(cutting, &[(limits, &axis)], program);
    let steel = "[[simulation.cutting]]\ntool = 7\nspecific_force = 1.0\nwidth = 1.0\n\
                 [[simulation.cutting]]\nspecific_force = 2000.0\nwidth = 1.0\nacross = 0.25\n";
    let program = "G21 G90 G61 M3 S6000\nG1 X60 F600\nM2\n";
    let force = |json: &Value| number(json, "/cutting/max_force_n");
    let off = |json: &Value| number(json, "/transmissions/0/max_off_mm");
    let cut = of(steel, program);
    assert_eq!(cut["verdict"], "pass", "{cut:#}");
    assert!(
        (force(&cut) - 200.0 * 1.0625_f64.sqrt()).abs() < 0.1,
        "{}",
        force(&cut)
    );
    assert!((off(&cut) - 0.010).abs() < 1e-3, "{}", off(&cut));
    let stiffness = 10.0 * (std::f64::consts::TAU * 200.0).powi(2);
    let sway = number(&cut, "/structures/0/max_sway_mm");
    // The force comes in steps of a cycle, which the structure overshoots a little.
    assert!((1.0..1.2).contains(&(sway / (200e3 / stiffness))), "{sway}");
    let least = |json: &Value| number(json, "/drives/0/rms_torque");
    let free = of("", program);
    assert!(free["cutting"].is_null() && off(&free) < 0.003, "{free:#}");
    assert!(least(&cut) > least(&free) + 0.2);
    // By line, hardest first: one that comes again stands with its hardest pass, and rapids are none.
    let program = "G21 G90 G61 M3 S6000\n#1=300\nO1 REPEAT [2]\nG0 X0\nG1 X20 F#1\n#1=600\nO1 ENDREPEAT\n\
                   G0 X0\nG1 X20 F1200\nG0 X0\nM2\n";
    let told = of(steel, program);
    let lines = told["cutting"]["hardest_lines"].as_array().expect("lines");
    assert_eq!(lines.len(), 2, "{lines:#?}");
    for (line, (place, against)) in lines.iter().zip([(9, 400.0), (5, 200.0)]) {
        assert_eq!(line["line"], place);
        let [most, mean, off] = ["max_force_n", "rms_force_n", "max_deflection_mm"]
            .map(|key| number(line, &format!("/{key}")));
        let expected = against * 1.0625_f64.sqrt();
        assert!((most / expected - 1.0).abs() < 1e-3, "{most}");
        assert!((0.95..1.0).contains(&(mean / most)), "{mean}");
        // What the screw twists by, and the structure bends.
        let bent = against / 20e3 + against * 1e3 / stiffness;
        assert!((1.0..1.15).contains(&(off / bent)), "{off} {bent}");
    }
    assert_eq!(force(&told), number(&lines[0], "/max_force_n"));
    // Neither in a rapid nor without a spindle.
    for other in [
        "G21 G90 G61 M3 S6000\nG0 X60\nM2\n",
        "G21 G90 G61\nG1 X60 F600\nM2\n",
    ] {
        let idle = of(steel, other);
        assert_eq!(force(&idle), 0.0);
        assert_eq!(idle["frames_sha256"], of("", other)["frames_sha256"]);
    }
}

/// A motor that holds a weight is heated by the square of its torque as its time constant has it; one that lets the weight
/// down charges its DC bus, and its braking resistor takes the rest of what the weight gives.
#[test]
fn what_a_power_stage_is_loaded_with_is_told() {
    let limits = "soft_limits = [-250.0, 250.0]\nfollowing_error_limit = 1.0\n";
    let of = |program: &str| {
        let axis = format!(
            "{limits}[axis.simulation]\nmotor = \"generic-3\"\nload = 40.0\ngravity = 600.0\n\
             motor_friction = 0.0\nmotor_viscous_friction = 0.0\n"
        );
        validated("", &[(limits, &axis)], program)
    };
    let supply = |json: &Value, key: &str| number(json, &format!("/drives/0/supply/{key}"));
    let held = of("G4 P10\nG1 X0.01 F600\nM2\n");
    let torque = 600.0 * 0.02 / 1.5 / std::f64::consts::TAU;
    // 10 s and what switching on takes: below 5 s.
    let expected = |after: f64, load: f64, time: f64| load * load * (1.0 - (-after / time).exp());
    for (key, load, time) in [
        ("max_motor_i2t", torque / 3.0, 35.0),
        ("max_drive_i2t", torque / 4.5, 4.0),
    ] {
        let [least, most] = [10.0, 15.0].map(|after| expected(after, load, time));
        let found = supply(&held, key);
        assert!(
            (0.99 * least..1.02 * most).contains(&found),
            "{key} {found} {least} {most}"
        );
    }
    // Cogging alone sends a little back.
    assert!((560.0..560.1).contains(&supply(&held, "max_bus_voltage")));
    assert_eq!(supply(&held, "braked_j"), 0.0);
    // 400 mm of 600 N: 240 J, of which the winding takes some; the bus holds 57.5 J from 560 to 780 V.
    let lowered = of("G0 X-200\nG0 X200\nG4 P0.1\nG1 X199.99 F600\nM2\n");
    let (stored, braked) = (
        supply(&lowered, "max_bus_energy_j"),
        supply(&lowered, "braked_j"),
    );
    let to_braking = 0.5 * 390e-6 * (780.0_f64.powi(2) - 560.0_f64.powi(2));
    assert!(
        (0.98 * to_braking..1.02 * to_braking).contains(&stored),
        "{stored} {to_braking}"
    );
    assert!(
        (0.8 * 240.0..240.0).contains(&(stored + braked)),
        "{stored} {braked}"
    );
    assert!(supply(&lowered, "max_bus_voltage") < 800.0);
    let power = supply(&lowered, "braking_power_w");
    assert!(power > 0.0 && power < braked);
}

/// A force along the path from a file, 200 N against X from 20 to 40 mm: the screw of 20 N/µm twists by 10 µm there and nowhere else. A
/// file of zeros changes nothing, and what the file says is found again by where the path is.
#[test]
fn forces_come_along_the_path() {
    let limits = "soft_limits = [-250.0, 250.0]\nfollowing_error_limit = 1.0\n";
    let axis = format!(
        "{limits}[axis.simulation]\nmotor = \"generic-3\"\nload = 40.0\ntransmission = \"screw\"\nstiffness = 20.0\n"
    );
    let validate = |forces: &str, program: &str| -> Value {
        let folder = Folder::new();
        let _ = folder.file("forces.csv", forces);
        let more = if forces.is_empty() {
            ""
        } else {
            "[simulation]\nforces = \"forces.csv\"\n"
        };
        validated_in(&folder, more, &[(limits, &axis)], program)
    };
    let program = "G21 G90 G61\nG0 X10\nG1 X60 F600\nM2\n";
    let free = validate("", program);
    assert!(free["cutting"].is_null(), "{free:#}");
    let zeros = validate("path_mm,x_n,y_n,z_n\n0,0,0,0\n60,0,0,0\n", program);
    assert_eq!(zeros["frames_sha256"], free["frames_sha256"]);
    assert_eq!(number(&zeros, "/cutting/max_force_n"), 0.0);
    let steps = "path_mm,x_n,y_n,z_n\n20,0,0,0\n20.001,-200,0,0\n40,-200,0,0\n40.001,0,0,0\n";
    let cut = validate(steps, program);
    assert_eq!(cut["verdict"], "pass", "{cut:#}");
    assert!(
        (number(&cut, "/cutting/max_force_n") - 200.0).abs() < 1e-6,
        "{cut:#}"
    );
    let off = number(&cut, "/transmissions/0/max_off_mm");
    let without = number(&free, "/transmissions/0/max_off_mm");
    assert!((off - without - 0.010).abs() < 1e-3, "{off} {without}");
    assert_eq!(cut["cutting"]["max_force_at"]["line"], 3);
    // A ramp whose end the path does not come to, in Y as well: the greatest force is where the path ends.
    let ramp = validate("path_mm,x_n,y_n,z_n\n0,0,0,0\n120,-400,300,0\n", program);
    let most = number(&ramp, "/cutting/max_force_n");
    assert!((most - 250.0).abs() < 0.5, "{most}");
    // What probes is not on it, and the path goes on behind that.
    let probe = "[[input]]\nname = \"probe\"\ndrive = \"left-right\"\nsignal = \"DI0\"\nfunction = \"probe\"\n";
    let folder = Folder::new();
    let _ = folder.file(
        "forces.csv",
        "path_mm,x_n,y_n,z_n\n0,0,0,0\n120,-400,300,0\n",
    );
    let more = format!("[simulation]\nforces = \"forces.csv\"\n{probe}");
    let probes = program.replace("X60", "X30 F600\nG38.3 Y5 F300\nG1 X60");
    let probed = validated_in(&folder, &more, &[(limits, &axis)], &probes);
    assert_eq!(probed["verdict"], "pass", "{probed:#}");
    let most = number(&probed, "/cutting/max_force_n");
    assert!((most - 250.0).abs() < 0.5, "{most}");
    // Behind its last line there is none.
    let short = validate("path_mm,x_n,y_n,z_n\n0,-50,0,0\n5,-50,0,0\n", program);
    assert_eq!(short["cutting"]["max_force_at"]["line"], 2, "{short:#}");
    let file = &short["provenance"]["descriptions"][0]["file"];
    assert!(
        file.as_str().is_some_and(|it| it.ends_with("forces.csv")),
        "{short:#}"
    );
}

/// X alone brakes: its own DC bus stores the energy by itself, that which it shares with Y by halves, so that the square of the voltage rises half
/// as far, which Y tells as well; nothing else changes.
#[test]
fn drives_share_a_dc_bus() {
    let [x, y] = ["[-250.0, 250.0]", "[-200.0, 200.0]"]
        .map(|soft| format!("soft_limits = {soft}\nfollowing_error_limit = 1.0\n"));
    let simulated =
        |limits: &str| format!("{limits}[axis.simulation]\nmotor = \"generic-3\"\nload = 60.0\n");
    let (of_x, of_y) = (simulated(&x), simulated(&y));
    let replaced = [(&*x, &*of_x), (&*y, &*of_y)];
    let program = "G21 G90 G61\nG0 X200\nG4 P0.1\nG0 X0\nM2\n";
    let shared = "[[simulation.dc_bus]]\ndrives = [\"left-right\", \"front-back\"]\n";
    let [own, shared] = ["", shared].map(|more| validated(more, &replaced, program));
    assert_eq!(shared["verdict"], "pass", "{shared:#}");
    assert_eq!(own["frames_sha256"], shared["frames_sha256"]);
    let voltage = |json: &Value, drive: usize| {
        number(json, &format!("/drives/{drive}/supply/max_bus_voltage"))
    };
    let beyond = |json: &Value, drive: usize| voltage(json, drive).powi(2) - 560.0_f64.powi(2);
    assert!((voltage(&own, 1) - 560.0).abs() < 0.01, "{own:#}");
    assert!(
        voltage(&own, 0) > 580.0 && voltage(&own, 0) < 780.0,
        "{own:#}"
    );
    assert!(
        (voltage(&shared, 0) - voltage(&shared, 1)).abs() < 1.0,
        "{shared:#}"
    );
    let half = beyond(&shared, 0) / beyond(&own, 0);
    assert!((half - 0.5).abs() < 0.02, "{half}");
    let energy = |json: &Value, drive: usize| {
        number(json, &format!("/drives/{drive}/supply/max_bus_energy_j"))
    };
    let both = energy(&shared, 0) + energy(&shared, 1);
    assert!((both / energy(&own, 0) - 1.0).abs() < 0.03, "{both}");
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(12) })]

    /// Where nothing is rounded and nothing gives way, all of the contour error is the drives', also where these lead.
    #[test]
    fn the_drives_part_is_no_more_than_the_whole(
        moves in prop::collection::vec(
            (prop::sample::select(vec!["G0", "G1 F9000"]), prop::array::uniform3(prop::option::of(-9..10_i32))),
            0..6,
        ),
        along_x in prop::bool::ANY,
    ) {
        // Along one axis there is nothing but lag and lead.
        let mut program = "G61.1\nG0 X1\nG0 X2\nG0 X5\n".to_owned();
        for (code, mut to) in moves {
            to[1..].iter_mut().for_each(|to| *to = to.filter(|_| !along_x));
            let words = (["X", "Y", "Z"].iter().zip(to)).filter_map(|(axis, to)| Some(format!(" {axis}{}", to?)));
            let words: String = words.collect();
            if !words.is_empty() {
                program += &format!("{code}{words}\n");
            }
        }
        let found = validated("", &[], &(program + "M2\n"));
        let [whole, drives] = ["contour_error", "drive_deviation"].map(|of| number(&found, &format!("/path/max_{of}_mm")));
        prop_assert!(drives <= whole + 1e-9, "{drives} of {whole}");
    }

    /// Lines, arcs, full circles, helices and splines cross each other anywhere, whatever rounds them: what crosses from elsewhere
    /// is no part of the error.
    #[test]
    fn what_crosses_from_elsewhere_makes_no_error(
        tolerance in 2..20_u32,
        method in prop::sample::select(vec!["", "clock", "coordinates"]),
        moves in prop::collection::vec((0..6_u32, prop::array::uniform2(-40..41_i32)), 4..10),
    ) {
        let mut program = format!("G64 P0.{tolerance:02} F6000\nG0 X-50 Y-50\n");
        for (kind, [x, y]) in moves {
            let centre = (f64::from(x) / 4.0, f64::from(y) / 4.0);
            program += &match kind {
                0 if [x, y] != [0, 0] => format!("G2 I{} J{}\n", centre.0, centre.1),
                1 if [x, y] != [0, 0] => format!("G3 I{} J{} Z1 P2\nG1 Z0\n", centre.0, centre.1),
                2 => format!("G2 X{x} Y{y} R120\n"),
                3 => format!("G5 I{x} J{y} P{y} Q{} X{y} Y{x}\n", -x),
                _ => format!("G1 X{x} Y{y}\n"),
            };
        }
        let shaper = match method {
            "" => String::new(),
            _ => format!("\n[shaper]\nkind = \"zv\"\nmethod = \"{method}\"\nmodes = [[8.0, 0.02]]\n"),
        };
        let found = validated(&shaper, &[], &(program.clone() + "M2\n"));
        prop_assert_eq!(&found["violations"], &Value::Array(Vec::new()), "{}{}", shaper, program);
        let of = |key| number(&found, &format!("/path/max_{key}_mm"));
        let [whole, rounding, drives] = ["contour_error", "deviation", "drive_deviation"].map(of);
        prop_assert!(whole <= rounding + drives + 1e-6, "{whole} {rounding} {drives}\n{program}");
    }

    /// A later move through the very place where a corner is rounded most hides nothing of the rounding.
    #[test]
    fn what_crosses_a_rounding_hides_nothing_of_it(
        tolerance in 2..20_u32,
        angle in 60..150_u32,
        across in 0..180_u32,
        moves_between in 0..4_u32,
    ) {
        let tolerance = f64::from(tolerance) * 0.01;
        let (sin, cos) = f64::from(angle).to_radians().sin_cos();
        let corner = format!("G64 P{tolerance}\nG0 X-50 Y0\nG1 F6000 X0\nX{} Y{}\nG4 P0.01\nG61\n", -50.0 * cos, 50.0 * sin);
        let rounded = |rest: &str| {
            let found = validated("", &[], &format!("{corner}{rest}M2\n"));
            let deviation = number(&found, "/path/max_deviation_mm");
            (deviation, number(&found, "/path/max_contour_error_mm"))
        };
        let alone = rounded("");
        prop_assert!(alone.0 > 0.05 * tolerance, "{} of {tolerance}", alone.0);
        // The rounding's middle is off the corner, half way between the two lines.
        let (y, x) = (0.5 * f64::from(angle)).to_radians().sin_cos();
        let off = alone.0 / y;
        let (dy, dx) = f64::from(across).to_radians().sin_cos();
        let through = |by: f64| format!("X{} Y{}\n", by * dx - off * x, by * dy + off * y);
        let between = "Z-1\nZ0\n".repeat(moves_between as usize);
        let crossed = rounded(&format!("{between}{}{}", through(30.0), through(-30.0)));
        prop_assert!((crossed.0 - alone.0).abs() < 1e-9 && crossed.1 >= alone.1 - 1e-9, "{crossed:?}, alone {alone:?}");
    }
}

/// Each job of a day counts its path from its own beginning: whatever was before, also a curve that ends where it begins is followed.
#[test]
fn each_job_is_measured_along_its_own_path() {
    for curve in ["G2 I10.5 J1", "G3 I-7.5 J1 Z1 P2; G1 Z0", "G2 I4.5 J1 P2"] {
        let mut events = "t_s,event,value\n".to_owned();
        for lines in [3, 1, 5] {
            let before: Vec<_> = (1..=lines).map(|at| format!("; G1 X{at}")).collect();
            events += &format!(",mdi,G61.1 F6000{}\n,mdi,{curve}\n", before.concat());
        }
        let folder = Folder::new();
        let events = folder.file("day.csv", &events);
        let output = syncline()
            .args(["validate", "--json", "-", "--events"])
            .args([&events, &folder.machine("xyz")])
            .output()
            .unwrap();
        let (_, json, errors) = ended(&output);
        let found: Value =
            serde_json::from_str(json).unwrap_or_else(|error| panic!("{error}: {errors}"));
        assert_eq!(found["violations"], Value::Array(Vec::new()), "{curve}");
        assert!(
            number(&found, "/path/max_contour_error_mm") < 0.03,
            "{found:#}"
        );
    }
}
