//! `syncline identify` of axes whose drives are sent velocities.

use super::identify::told;
use proptest::prelude::*;
use serde_json::Value;
use std::path::Path;
use std::sync::LazyLock;
use syncline_tests::command::{Folder, ended, machine_file, machine_with, root, syncline};

/// What is found of an axis; also written to `found.json` of the folder.
fn identified(folder: &Folder, machine: &Path, axis: &str, options: &[&str]) -> Value {
    let json = folder.path("found.json");
    let mut command = syncline();
    command.arg("identify").arg(machine).args(["--axis", axis]);
    command.args(options).arg("--json").arg(&json);
    let output = command.output().unwrap();
    let (code, _, errors) = ended(&output);
    assert_eq!(code, 0, "{errors}");
    serde_json::from_str(&folder.read("found.json")).unwrap()
}

/// A figure, s or a factor, and half of its interval.
fn figure(found: &Value, name: &str) -> [f64; 2] {
    let figure = &found["following"][name];
    ["value", "uncertainty"].map(|part| figure[part].as_f64().unwrap())
}

/// The greatest following error of an axis in a program, mm.
fn following_error(machine: &Path, program: &Path, axis: &str) -> f64 {
    let mut command = syncline();
    command.arg("validate").args([machine, program]);
    let output = command.args(["--json", "-"]).output().unwrap();
    let (_, json, errors) = ended(&output);
    let json: Value = serde_json::from_str(json).unwrap_or_else(|_| panic!("{errors}"));
    let axes = json["axes"].as_array().unwrap();
    let axis = axes.iter().find(|it| it["name"] == axis).unwrap();
    axis["max_following_error_mm"].as_f64().unwrap()
}

/// The greatest following error of Y of the example with what its manual says of it, mm.
static BY_MANUAL: LazyLock<f64> = LazyLock::new(|| {
    let program = root().join("examples/mixed/parts.ngc");
    following_error(&machine_file("mixed"), &program, "Y")
});

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2))]

    /// The position loop of a TLC53x has 80 1/s: it is 12.5 ms late, whatever the file says, by which it is driven meanwhile. With
    /// what is found it follows better than with what its manual says.
    #[test]
    fn a_lag_is_found_whatever_the_file_says(lag in 6000..14_000u32, delay in 0..1500u32) {
        let folder = Folder::new();
        let table = format!("[model.tlc5xx]\nposition_lag_us = {lag}\nvelocity_delay_us = {delay}\n[spindle]");
        let machine = folder.file("machine.toml", &machine_with("mixed", &[("[spindle]", &table)]));
        let found = identified(&folder, &machine, "Y", &["--update"]);
        let [in_all, uncertainty] = figure(&found, "in_all");
        prop_assert!((in_all - 12.5e-3).abs() < 0.15e-3 && uncertainty < 0.1e-3, "{found:#}");
        let [factor, _] = figure(&found, "factor");
        prop_assert!((factor - 1.0).abs() < 1e-3, "{found:#}");
        let program = root().join("examples/mixed/parts.ngc");
        let by_manual = *BY_MANUAL;
        let as_found = following_error(&machine, &program, "Y");
        prop_assert!(as_found < 0.8 * by_manual, "{} mm, {} mm by the manual", as_found, by_manual);
    }
}

/// With what is found an axis follows no worse than with what the manual says, or the file that describes its drive.
#[test]
fn what_is_found_makes_no_axis_worse() {
    let folder = Folder::new();
    let machine = folder.file("machine.toml", &machine_with("mixed", &[]));
    let program = root().join("examples/mixed/parts.ngc");
    let before = following_error(&machine, &program, "Z");
    let found = identified(&folder, &machine, "Z", &["--update"]);
    assert!(
        folder.read("machine.toml").contains("[model.tsp10]"),
        "{found:#}"
    );
    let after = following_error(&machine, &program, "Z");
    assert!(
        after < 0.8 * before,
        "{before} mm, then {after} mm: {found:#}"
    );

    for file in std::fs::read_dir(root().join("examples/velocity")).unwrap() {
        let from = file.unwrap().path();
        let name = from.file_name().and_then(|name| name.to_str());
        std::fs::copy(&from, folder.path(name.unwrap())).unwrap();
    }
    let program = folder.path("plate.ngc");
    let before = following_error(&machine, &program, "X");
    let (code, errors) = told(&machine, &["--axis", "X", "--update"]);
    assert_eq!(code, 2, "{errors}");
    assert!(
        errors.contains("the file that describes Wheel 9"),
        "{errors}"
    );
    let found = identified(&folder, &machine, "X", &[]);
    let keys = found["settings"].as_array().unwrap().iter();
    let keys: String = keys
        .map(|key| format!("{} = {}\n", key["key"].as_str().unwrap(), key["value"]))
        .collect();
    let _ = folder.file("wheel.toml", &(folder.read("wheel.toml") + "\n" + &keys));
    let after = following_error(&machine, &program, "X");
    assert!(
        after <= 1.05 * before,
        "{before} mm, then {after} mm: {found:#}"
    );
}

#[test]
fn a_log_says_what_the_run_said() {
    let folder = Folder::new();
    let log = folder.path("y.csv");
    let log = log.to_str().unwrap();
    let machine = machine_file("mixed");
    let run = identified(&folder, &machine, "Y", &["--write-log", log]);
    let again = identified(&folder, &machine, "Y", &["--log", log]);
    let [[one, wide], [other, _]] = [&run, &again].map(|found| figure(found, "in_all"));
    assert!((one - other).abs() <= 0.1 * wide, "{run:#} {again:#}");
    let page = folder.path("y.html");
    let page = page.to_str().unwrap();
    let (code, errors) = told(&machine, &["--axis", "Y", "--report", page]);
    assert_eq!(code, 2, "{errors}");
    assert!(errors.contains("leave --report out"), "{errors}");
}
