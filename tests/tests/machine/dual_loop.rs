//! A scale at the load as second feedback, on a machine of an axis whose transmission is not what it should be.

use super::causes::Dice;
use serde_json::Value;
use syncline_tests::command::{Folder, ended, machine_with, syncline};

const PROGRAM: &str = "G64 P0.05 F6000\nG1 Y40 X10\nG1 Y-20\nG1 Y0 X0\nM2\n";

/// Keys of the axes; each is a feed axis of a screw with a load of its own.
fn keys(load: f64, more: &str) -> Vec<String> {
    ["X", "Y"]
        .iter()
        .map(|axis| {
            format!(
                "axis.{axis}.simulation={{motor=\"generic-3\",transmission=\"screw\",load={load},friction=20.0{more}}}"
            )
        })
        .collect()
}

fn validate(machine: &str, program: &str, keys: &[String]) -> (i32, Value, String) {
    let folder = Folder::new();
    let machine = folder.file("machine.toml", &machine_with(machine, &[]));
    let program = folder.file("program.ngc", program);
    let mut command = syncline();
    command.args(["validate", "--json", "-"]);
    for key in keys {
        command.args(["--set", key]);
    }
    let output = command.args([&machine, &program]).output().unwrap();
    let (code, json, errors) = ended(&output);
    (
        code,
        serde_json::from_str(json).unwrap_or_default(),
        errors.to_owned(),
    )
}

fn number(of: &Value, path: &str) -> f64 {
    let found = of.pointer(path).and_then(Value::as_f64);
    found.unwrap_or_else(|| panic!("no {path}: {of:#}"))
}

/// The encoder says that all is well where the lead is wrong; a scale shows it while the axis is on its way, and the motor makes up
/// for it: of a lead that is 2 % too long it turns 2 % less.
#[test]
fn a_scale_makes_up_for_a_lead_that_is_wrong() {
    let long = ",lead_error=[[-200.0,-4000.0],[200.0,4000.0]]";
    let speed = |more: &str| {
        let (code, json, errors) = validate("xyz", PROGRAM, &keys(50.0, more));
        assert_eq!(code, 0, "{errors} {json:#}");
        let drives = json["drives"].as_array().unwrap();
        let drive = drives.iter().find(|it| it["name"] == "front-back").unwrap();
        number(drive, "/max_speed_rpm")
    };
    let right = speed("");
    assert!((speed(long) / right - 1.0).abs() < 2e-3, "{right}");
    let with_scale = speed(&format!("{long},scale_step=0.5"));
    assert!(
        (with_scale * 1.02 / right - 1.0).abs() < 4e-3,
        "{with_scale} {right}"
    );
}

/// Machines that are drawn, softer and heavier ones with scales of any step: as commissioned they follow, and their margins are
/// told with the load in the loop.
#[test]
fn drawn_axes_follow_by_a_scale() {
    for case in 0..12 {
        let mut dice = Dice(1000 + case);
        let load = dice.between([20.0, 120.0]);
        let stiffness = dice.between([15.0_f64.ln(), 120.0_f64.ln()]).exp();
        let step = dice.between([0.05_f64.ln(), 2.0_f64.ln()]).exp();
        let play = if case % 3 == 0 { 0.01 } else { 0.0 };
        let axis = format!(",stiffness={stiffness},play={play}");
        let scale = format!("{axis},scale_step={step}");
        let (code, json, errors) = validate("xyz", PROGRAM, &keys(load, &scale));
        assert_eq!(
            code, 0,
            "{case}: {load} kg, {stiffness} N/µm, {step} µm: {errors} {json:#}"
        );
        let (_, by_encoder, _) = validate("xyz", PROGRAM, &keys(load, &axis));
        let of = |json: &Value| {
            let loops = json["loops"].as_array().unwrap();
            loops
                .iter()
                .find(|it| it["drive"] == "front-back")
                .unwrap()
                .clone()
        };
        let [with, without] = [of(&json), of(&by_encoder)];
        assert_eq!(with["stable"], true, "{case}: {with:#}");
        assert_ne!(with["position"], without["position"]);
        assert_eq!(with["speed"], without["speed"], "{case}");
        assert!(number(&with, "/position/phase") >= 44.9, "{case}: {with:#}");
        assert!(number(&with, "/position/gain") >= 7.9, "{case}: {with:#}");
    }
}

/// What makes no scale, and what cannot be identified with one, is refused.
#[test]
fn what_is_no_scale_is_refused() {
    for (more, why) in [
        (",scale_step=0.0", "a number from 0.001 to 1000 (µm)"),
        (",scale_step=-1.0", "a number from 0.001 to 1000 (µm)"),
        (",scale_step=true", "a number from 0.001 to 1000 (µm)"),
    ] {
        let (code, _, errors) = validate("xyz", PROGRAM, &keys(50.0, more));
        assert!(code == 2 && errors.contains(why), "{more}: {code} {errors}");
    }
    let beam = "axis.X.simulation={mechanics=\"rigid_beam\",mass=80.0,inertia=15.0,span=1500.0,scale_step=1.0}";
    let (code, _, errors) = validate("portal", PROGRAM, &[beam.to_owned()]);
    assert!(
        code == 2 && errors.contains("scale_step"),
        "{code} {errors}"
    );

    let folder = Folder::new();
    let scale = "[axis.simulation]\nscale_step = 1.0\n\n[model.lxm32m]";
    let text = machine_with("xyz", &[("[model.lxm32m]", scale)]);
    let machine = folder.file("machine.toml", &text);
    let mut command = syncline();
    command.arg("identify").arg(&machine).args(["--axis", "Y"]);
    let output = command.output().unwrap();
    let (code, _, errors) = ended(&output);
    assert!(
        code == 2 && errors.contains("take `scale_step` out"),
        "{code} {errors}"
    );
}
