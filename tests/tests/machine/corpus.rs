//! Generated programs through `syncline validate`, and what it sends checked by other means:
//! limits, distance from what is programmed, and the end.

use std::path::Path;
use syncline_controller::machine::Machine;
use syncline_tests::command::{Folder, ended, machine_with, syncline};
use syncline_tests::corpus::{
    Sample, Shape, circles, corners, duplicates, planes, reversals, s_bends, segments, zigzags,
};
use syncline_tests::plan::Plan;
use syncline_tests::trace::Trace;

/// Lines before and behind a row's own that its setpoint may be near to: a blend's.
const NEIGHBOURS: usize = 24;

/// The portal with room for circles of 10 m.
fn machine(folder: &Folder) -> std::path::PathBuf {
    let text = machine_with(
        "portal",
        &[
            (
                "soft_limits = [0.0, 1500.0]",
                "soft_limits = [-11000.0, 11000.0]",
            ),
            (
                "soft_limits = [0.0, 1000.0]",
                "soft_limits = [-11000.0, 11000.0]",
            ),
        ],
    );
    let (before, z) = text.split_once("soft_limits = [-300.0, 0.0]").unwrap();
    // Z counts 10 mm a turn from a zero of its own: less room there.
    folder.file(
        "machine.toml",
        &format!("{before}soft_limits = [-11000.0, 11000.0]{z}"),
    )
}

/// Everything that has to be so for a program of the corpus; the faults, in words.
fn faults(sample: &Sample) -> Vec<String> {
    let folder = Folder::new();
    let file = machine(&folder);
    let program = folder.file("p.ngc", &sample.text);
    let trace = folder.path("trace.csv");
    let output = syncline()
        .args(["validate", "--json", "-", "--trace"])
        .args([&trace, &file, &program])
        .output()
        .unwrap();
    let (code, json, errors) = ended(&output);
    if code == 2 {
        return vec![format!("{}: {errors}", sample.name)];
    }
    let json: serde_json::Value = serde_json::from_str(json).unwrap();
    let mut faults = Vec::new();
    let mut complain = |what: String| faults.push(format!("{}: {what}", sample.name));
    if code != 0 || json["verdict"] != "pass" {
        complain(format!("{} {errors}", json["violations"]));
    }
    if json["path"]["max_deviation_mm"].as_f64().unwrap() > sample.tolerance {
        complain(format!("deviation {}", json["path"]["max_deviation_mm"]));
    }
    let machine = Machine::load(&file).unwrap();
    let trace = Trace::read(&machine, &folder.read("trace.csv"));
    if let Some(excess) = trace.excesses().first() {
        complain(format!("{excess}"));
    }
    check_distance(sample, &trace, &machine, &mut complain);
    check_plan(sample, &machine, &file, &program, &mut complain);
    println!(
        "{}: {} s, {} rows, deviation {}",
        sample.name,
        json["duration_s"],
        trace.line.len(),
        json["path"]["max_deviation_mm"]
    );
    faults
}

/// Every setpoint is near what is programmed around its line, and the last one at the end.
fn check_distance(
    sample: &Sample,
    trace: &Trace,
    machine: &Machine,
    complain: &mut impl FnMut(String),
) {
    let axes = ["X", "Y", "Z"].map(|name| &trace.axis(name).set);
    let increments = ["X", "Y", "Z"].map(|name| {
        let axis = machine.axes.iter().find(|axis| axis.name == name).unwrap();
        machine.drives[axis.drives[0]].scaling.resolution()
    });
    // Setpoints are whole increments.
    let grain = increments
        .iter()
        .map(|it| it * it / 4.0)
        .sum::<f64>()
        .sqrt();
    let mut worst = (0.0, 0, 0);
    for (row, &line) in trace.line.iter().enumerate() {
        let line = line as usize;
        if sample.shapes[line].is_none() {
            continue;
        }
        let at = axes.map(|set| set[row]);
        let allowed = sample.tolerance + grain;
        let mut nearest = f64::INFINITY;
        for away in 0..NEIGHBOURS {
            for line in [line + away, line.wrapping_sub(away)] {
                if let Some(Some(shape)) = sample.shapes.get(line) {
                    nearest = nearest.min(shape.distance(&at));
                }
            }
            if nearest <= allowed {
                break;
            }
        }
        if nearest > allowed && nearest > worst.0 {
            worst = (nearest, row, line);
        }
    }
    if worst.0 > 0.0 {
        let (distance, row, line) = worst;
        complain(format!(
            "{distance} mm off the path in row {row}, line {line}"
        ));
    }
    for axis in 0..3 {
        let last = *axes[axis].last().unwrap();
        let off = (last - sample.end[axis]).abs();
        if off > increments[axis] {
            complain(format!("axis {axis} ends {off} mm off"));
        }
    }
}

/// The plan keeps the limits between the samples too, and meets every programmed point.
fn check_plan(
    sample: &Sample,
    machine: &Machine,
    file: &Path,
    program: &Path,
    complain: &mut impl FnMut(String),
) {
    let plan = Plan::of(machine, file, program);
    if let Some(fault) = plan.faults().first() {
        complain(fault.clone());
    }
    let mut spans = plan.spans();
    let points = sample.shapes.iter().flatten().map(|shape| shape.at(1.0));
    for (index, point) in points.enumerate() {
        let missed = spans.pass_by(&point, sample.tolerance + 1e-9);
        if missed > sample.tolerance + 1e-9 {
            return complain(format!("misses point {index} by {missed} mm"));
        }
    }
}

fn assert_good(samples: &[Sample]) {
    let faults: Vec<String> = samples.iter().flat_map(faults).collect();
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
#[ignore = "a campaign of minutes"]
fn corners_of_every_angle() {
    assert_good(&corners(20));
}

#[test]
#[ignore = "a campaign of minutes"]
fn s_bends_tangent_or_nearly() {
    for (kink, decimals) in [(0.0, 6), (0.0, 3), (0.5, 3)] {
        assert_good(&s_bends(kink, decimals));
    }
}

#[test]
#[ignore = "a campaign of minutes"]
fn short_segments() {
    for mode in [("G61", 0.001), ("G64 P0.01", 0.01)] {
        assert_good(&[segments(2000, 0.05, mode)]);
    }
}

#[test]
#[ignore = "a campaign of minutes"]
fn full_circles() {
    let diameters = [0.01, 0.1, 1.0, 10.0, 100.0, 1000.0];
    assert_good(&[circles(&diameters, &[17])]);
}

#[test]
#[ignore = "a campaign of minutes"]
fn points_that_come_twice() {
    assert_good(&duplicates());
}

#[test]
#[ignore = "a campaign of minutes"]
fn single_axes_there_and_back() {
    assert_good(&reversals());
}

#[test]
#[ignore = "a campaign of minutes"]
fn arcs_in_all_planes() {
    assert_good(&planes());
}

#[test]
#[ignore = "a campaign of minutes"]
fn blends_that_want_the_same_segment() {
    assert_good(&zigzags());
}

#[test]
#[ignore = "a campaign of minutes"]
fn the_whole_corpus() {
    let mut samples = corners(1);
    for kink in [0.0, 0.01, 0.1, 0.5, 2.0, 10.0] {
        for decimals in [6, 4, 3] {
            samples.extend(s_bends(kink, decimals));
        }
    }
    for mode in [("G61", 0.001), ("G64 P0.01", 0.01)] {
        samples.push(segments(150_000, 0.05, mode));
        samples.push(segments(20_000, 0.5, mode));
    }
    samples.push(circles(
        &[0.01, 0.02, 0.1, 0.5, 1.0, 5.0, 10.0],
        &[17, 18, 19],
    ));
    samples.push(circles(&[10_000.0], &[17]));
    assert_good(&samples);
}

/// The checker is checked: a program that is not what it claims to be is found out.
#[test]
#[ignore = "a campaign of minutes"]
fn a_path_that_is_not_the_programmed_one_is_seen() {
    let mut sample = corners(60).remove(2);
    sample.tolerance /= 10.0;
    let told = faults(&sample).join("\n");
    for part in ["deviation", "off the path", "misses point"] {
        assert!(told.contains(part), "{part}: {told}");
    }
    let mut sample = corners(60).remove(0);
    if let Some(Some(Shape::Line(_, to))) = sample.shapes.get_mut(5) {
        to[1] += 0.01;
    }
    sample.end[0] += 0.01;
    let told = faults(&sample).join("\n");
    for part in ["off the path", "misses point", "axis 0 ends"] {
        assert!(told.contains(part), "{part}: {told}");
    }
}
