//! `syncline bench` says what it measured in every form that it offers, and no more than the samples
//! can bear. How fast this host is is not tested.

use serde_json::Value;
use std::collections::BTreeSet;
use std::fs;
use std::process::{Command, Output};
use std::thread::available_parallelism;
use syncline_drives::model::MODELS;
use tempfile::TempDir;

fn bench(arguments: &str, files: Option<&TempDir>) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_syncline"));
    command.arg("bench").args(arguments.split_whitespace());
    if let Some(folder) = files {
        command
            .arg("--report")
            .arg(folder.path().join("report.html"));
        command.arg("--hgrm").arg(folder.path().join("table"));
    }
    command.output().unwrap()
}

fn json(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{text}");
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Percentiles with ten samples beyond them and no others, a greatest value with its time.
fn assert_bearable(name: &str, distribution: &Value) {
    let count = distribution["count"].as_f64().unwrap();
    let stated: BTreeSet<String> = (distribution["percentiles_us"].as_object().unwrap())
        .keys()
        .cloned()
        .collect();
    let bearable = ["50", "90", "99", "99.9", "99.99", "99.999"]
        .into_iter()
        .filter(|percent| count * (1.0 - percent.parse::<f64>().unwrap() / 100.0) > 10.0 - 1e-6)
        .map(|percent| format!("p{percent}"))
        .collect();
    assert_eq!(stated, bearable, "{name}, {count} samples");
    let number = |key: &str| distribution[key].as_f64().unwrap();
    assert!(
        number("max_at_s") >= 0.0 && number("max_us") >= number("mean_us") * 0.999,
        "{name}"
    );
    assert!(
        number("min_at_s") >= 0.0 && number("min_us") <= number("mean_us") * 1.001,
        "{name}"
    );
}

/// The same distributions in the JSON, in a table each, and in the report.
fn assert_told_in_all_forms(found: &Value, folder: &TempDir) {
    let distributions = found["distributions"].as_object().unwrap();
    let report = fs::read_to_string(folder.path().join("report.html")).unwrap();
    for (name, distribution) in distributions {
        assert_bearable(name, distribution);
        assert!(report.contains(name), "{name} in the report");
        let file = format!("table-{}.hgrm", name.replace(' ', "-"));
        let table = fs::read_to_string(folder.path().join(file)).unwrap();
        let total = format!(
            "Total count    = {:>12}]",
            distribution["count"].as_u64().unwrap()
        );
        assert!(table.contains(&total), "{total}: {table}");
    }
}

#[test]
fn the_cycle_is_told_in_all_forms() {
    let folder = TempDir::new().unwrap();
    let arguments = "cycle --axes 3 --period 1ms --duration 1200ms --control --json";
    let found = json(&bench(arguments, Some(&folder)));
    assert_told_in_all_forms(&found, &folder);
    let distributions = &found["distributions"];
    for (name, times) in [
        ("wake-up for SYNC", 1),
        ("SYNC handed over", 1),
        ("SYNC stamped", 1),
        ("wake-up for setpoints", 1),
        ("receive", 1),
        ("send", 1),
        ("T_PDO after SYNC", 3),
        ("setpoints before SYNC", 1),
        ("bare wake-up", 1),
    ] {
        assert_eq!(distributions[name]["count"], 1200 * times, "{name}");
    }
    // Cycles in which the processor was taken away are left out, and counted.
    for name in ["compute per cycle", "compute per axis"] {
        let counted = distributions[name]["count"].as_u64().unwrap();
        assert_eq!(counted + found["preempted"].as_u64().unwrap(), 1200);
    }
    assert!(distributions["bare compute"]["count"].as_u64() <= Some(1200));
    assert_eq!(found["load_s"].as_array().map(Vec::len), Some(0));
    assert_eq!(found["late_setpoints"], 0);
    assert!(found["processor_s"].as_f64().unwrap() > 0.0);
    for quantile in ["median", "p99"] {
        let number = |key: &str| found["control"][quantile][key].as_f64().unwrap();
        assert!(number("low_us") <= number("high_us"), "{quantile}");
    }
    let stages = ["wake-up", "receive", "compute", "send"];
    assert!(stages.contains(&found["worst_stage"].as_str().unwrap()));
    for said in [&found["facts"]["worst cycle"], &found["facts"]["processor"]] {
        assert!(said.as_str().is_some_and(|text| !text.is_empty()));
    }
    assert!(!found["realtime"].as_array().unwrap().is_empty());
}

/// SYNC is handed over behind the wake-up for it, and what a wake-up for setpoints is late is no margin any more.
#[test]
fn a_late_wake_up_is_told_of_in_all_that_follows_it() {
    let arguments = "cycle --axes 2 --period 1ms --duration 1s --load --json";
    let found = json(&bench(arguments, None));
    let micros = |name: &str, key: &str| found["distributions"][name][key].as_f64().unwrap();
    let late = micros("wake-up for SYNC", "max_us");
    assert!(micros("SYNC handed over", "max_us") >= late);
    let left = (1000.0 - micros("wake-up for setpoints", "max_us")).max(0.0);
    assert!(micros("setpoints before SYNC", "min_us") <= left);
}

/// A thread a processor, each at work for a hundredth of the time at the very least, and over with the
/// command.
#[test]
fn the_load_is_on_all_processors() {
    let found = json(&bench("cycle --axes 1 --duration 2s --load --json", None));
    let load = found["load_s"].as_array().unwrap();
    assert_eq!(load.len(), available_parallelism().unwrap().get());
    for busy in load {
        assert!(busy.as_f64().unwrap() > 0.02, "{load:?}");
    }
    let said = format!("{} threads, ", load.len());
    assert!(found["facts"]["load"].as_str().unwrap().starts_with(&said));
}

#[test]
fn the_parts_of_a_simulation_are_told_in_the_same_way() {
    for what in ["bus", "plant", "plan"] {
        let folder = TempDir::new().unwrap();
        let found = json(&bench(
            &format!("{what} --steps 1100 --json"),
            Some(&folder),
        ));
        assert_told_in_all_forms(&found, &folder);
        assert!(found["steps_per_second"].as_f64().unwrap() > 0.0, "{what}");
        let text = bench(&format!("{what} --steps 20"), None);
        let text = String::from_utf8(text.stdout).unwrap();
        assert!(
            text.contains(" a second") && text.contains("n=20  min"),
            "{text}"
        );
    }
}

/// Every model that moves an axis, each in a cycle that it takes; one that moves none is refused by name.
#[test]
fn every_model_of_a_drive_can_be_measured() {
    for model in MODELS.iter().filter(|model| model.moves_axes()) {
        let drives = format!("--model {} --axes 2", model.name);
        let found = json(&bench(
            &format!("cycle {drives} --period 4ms --duration 100ms --json"),
            None,
        ));
        assert_eq!(found["facts"]["drives"], model.title);
        assert_eq!(found["cycles"], 25, "{drives}");
        json(&bench(&format!("plant {drives} --steps 20 --json"), None));
    }
    for model in MODELS.iter().filter(|model| !model.moves_axes()) {
        let refused = bench(&format!("cycle --model {}", model.name), None);
        let text = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(2), "{text}");
        assert!(text.contains("possible values"), "{text}");
    }
}

/// Many axes, on as few buses as take them or on those asked for; refused where they do not fit.
#[test]
fn axes_are_spread_over_buses_that_take_them() {
    let short = "--duration 100ms --json";
    for (arguments, buses) in [
        ("--axes 64 --period 4ms", "4, simulated bus"),
        ("--axes 64 --buses 8 --period 4ms", "8, simulated bus"),
        ("--axes 64 --buses 22 --period 1ms", "22, simulated bus"),
    ] {
        let found = json(&bench(&format!("cycle {arguments} {short}"), None));
        assert_eq!(found["facts"]["buses"], buses, "{arguments}");
    }
    for (arguments, why) in [
        ("--axes 64 --buses 21 --period 1ms", "1.110 ms"),
        (
            "--axes 1 --period 21ms",
            "1000 to 20000 µs in steps of 1000 µs",
        ),
        (
            "--axes 1 --period 1500us",
            "1000 to 20000 µs in steps of 1000 µs",
        ),
        ("--axes 2 --buses 2 --bus vcan0", "cannot be used with"),
    ] {
        let refused = bench(&format!("cycle {arguments} {short}"), None);
        let text = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(2), "{text}");
        assert!(text.contains(why), "{arguments}: {text}");
    }
}
