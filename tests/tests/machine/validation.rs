//! The numbers of a validation, the tolerances that make verdicts of them, and which cause comes first.

use serde_json::Value;
use syncline_tests::command::{Folder, ended, machine_with, syncline};

/// A square with G64, an arc, and a move that crosses both.
const PROGRAM: &str = "G64 P0.05 F9000\nG0 X-80 Y-60\nG1 X80\nG1 Y60\nG3 X40 Y100 R40\nG1 X-80\nG1 Y-60\n\
                       G1 X60 Y80\nG0 X0 Y0\nM2\n";

/// The validation of a program on the xyz machine with more in its file and parts of it replaced.
fn validated(more: &str, replaced: &[(&str, &str)], program: &str) -> Value {
    let folder = Folder::new();
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
    // From the middle between the flanks to one of them, and what twists.
    let play = of("transmission = \"rack\"\nplay = 0.1\nfriction = 30.0");
    let given = off(&play).unwrap();
    assert!((0.05..0.12).contains(&given), "{given}");
    assert!(contour(&play) > 0.03, "{}", contour(&play));
    let seen = of("transmission = \"rack\"\nplay = 0.1\nfriction = 30.0\nscale_step = 0.1");
    assert!(off(&seen).is_none());
}
