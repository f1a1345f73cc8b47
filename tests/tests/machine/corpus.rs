//! Generated programs through `syncline validate`, and what it sends checked by other means:
//! limits, distance from what is programmed, the end, and that it takes no longer than it should.

use serde_json::Value;
use std::path::Path;
use syncline_controller::machine::{Machine, Motion};
use syncline_tests::command::{Folder, ended, examples, machine_with, syncline};
use syncline_tests::corpus::{Sample, Shape, corners, excerpt, many_segments, whole};
use syncline_tests::plan::Plan;
use syncline_tests::trace::Trace;

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
            (
                "soft_limits = [-300.0, 0.0]",
                "soft_limits = [-1000.0, 1000.0]",
            ),
        ],
    );
    folder.file("machine.toml", &text)
}

/// What was found of a program.
#[derive(Debug, Default)]
struct Findings {
    name: String,
    /// What is wrong, in words.
    faults: Vec<String>,
    duration: f64,
    /// Greatest acceleration and jerk of an axis as parts of their limits: between the samples, and
    /// by the differences of the trace.
    exact: [f64; 2],
    sampled: [f64; 2],
    /// Greatest distance of a setpoint from the programmed path, mm, and as a part of what is
    /// allowed.
    deviation: f64,
    strayed: f64,
    /// How far the last setpoint is from the programmed end, increments.
    end: f64,
}

impl Findings {
    /// Of a program on a machine, by `validate` and its trace.
    fn of(name: String, file: &Path, program: &Path) -> (Self, Option<(Machine, Trace, Plan)>) {
        let folder = Folder::new();
        let trace = folder.path("trace.csv");
        let output = syncline()
            .args(["validate", "--json", "-", "--trace"])
            .args([&trace, file, program])
            .output()
            .unwrap();
        let (code, json, errors) = ended(&output);
        let mut findings = Self {
            name,
            ..Self::default()
        };
        if code == 2 {
            findings.complain(errors);
            return (findings, None);
        }
        let json: Value = serde_json::from_str(json).unwrap();
        if code != 0 || json["verdict"] != "pass" {
            findings.complain(&format!("{} {errors}", json["violations"]));
        }
        findings.duration = json["duration_s"].as_f64().unwrap();
        findings.deviation = json["path"]["max_deviation_mm"].as_f64().unwrap();
        let machine = Machine::load(file).unwrap();
        let trace = Trace::read(&machine, &folder.read("trace.csv"));
        if let Some(excess) = trace.excesses().first() {
            findings.complain(&excess.to_string());
        }
        findings.sampled.copy_from_slice(&trace.loads()[1..]);
        let plan = Plan::of(&machine, file, program);
        let (faults, loads) = plan.examine();
        if let Some(fault) = faults.first() {
            findings.complain(fault);
        }
        findings.exact.copy_from_slice(&loads[1..]);
        (findings, Some((machine, trace, plan)))
    }

    fn complain(&mut self, what: &str) {
        self.faults.push(format!("{}: {what}", self.name));
    }

    /// The last setpoint is where the program ends, but of axes that go point to point, which the path does not know.
    fn check_end(&mut self, machine: &Machine, trace: &Trace, end: impl Fn(usize) -> f64) {
        let axes = machine.axes.iter().enumerate();
        for (index, axis) in axes.filter(|(_, axis)| axis.motion == Motion::Path) {
            let increment = machine.drives[axis.drives[0]].scaling.resolution();
            let last = *trace.axes[index].set.last().unwrap();
            let off = (last - end(axis.letter.index())).abs() / increment;
            self.end = self.end.max(off);
            if off > 1.0 {
                self.complain(&format!("axis {} ends {off} increments off", axis.name()));
            }
        }
    }
}

/// What is found of a program of the corpus.
fn judge(sample: &Sample) -> Findings {
    let folder = Folder::new();
    let file = machine(&folder);
    let program = folder.file("p.ngc", &sample.text);
    let (mut findings, run) = Findings::of(sample.name.clone(), &file, &program);
    let Some((machine, trace, plan)) = run else {
        return findings;
    };
    findings.strayed = findings.deviation / sample.tolerance;
    if findings.strayed > 1.0 {
        findings.complain(&format!("deviation {}", findings.deviation));
    }
    if findings.duration > sample.patience() {
        let duration = findings.duration;
        findings.complain(&format!("{duration} s, more than {}", sample.patience()));
    }
    check_distance(sample, &trace, &machine, &mut findings);
    findings.check_end(&machine, &trace, |axis| sample.end[axis]);
    let mut path_segments = plan.path_segments();
    let points = sample.shapes.iter().flatten().map(|shape| shape.at(1.0));
    for (index, point) in points.enumerate() {
        let missed = path_segments.pass_by(&point, sample.tolerance + 1e-9);
        if missed > sample.tolerance + 1e-9 {
            findings.complain(&format!("misses point {index} by {missed} mm"));
            break;
        }
    }
    findings
}

/// What is found of an example.
fn judge_example((file, program): &(std::path::PathBuf, std::path::PathBuf)) -> Findings {
    let name = program.file_name().unwrap().display().to_string();
    let (mut findings, run) = Findings::of(name, file, program);
    if let Some((machine, trace, plan)) = run
        && plan.is_whole
    {
        let end = plan.path_segments().end().unwrap();
        findings.check_end(&machine, &trace, |axis| end[axis]);
    }
    findings
}

/// Every setpoint is near what is programmed around its line.
fn check_distance(sample: &Sample, trace: &Trace, machine: &Machine, findings: &mut Findings) {
    let axes = ["X", "Y", "Z"].map(|name| &trace.axis(name).set);
    // Setpoints are whole increments.
    let grain = machine.axes.iter().map(|axis| {
        let increment = machine.drives[axis.drives[0]].scaling.resolution();
        increment * increment / 4.0
    });
    let allowed = sample.tolerance + grain.sum::<f64>().sqrt();
    let mut worst = (0.0, 0, 0);
    // Where the last setpoint was: the next one is not far.
    let mut near = 0;
    for (row, &line) in trace.line.iter().enumerate() {
        let line = line as usize;
        if sample.shapes[line].is_none() {
            continue;
        }
        let at = axes.map(|set| set[row]);
        let mut nearest = f64::INFINITY;
        let lines = line.saturating_sub(sample.neighbours)..=line + sample.neighbours;
        let from = near.clamp(*lines.start(), *lines.end());
        for away in 0..=2 * sample.neighbours {
            for place in [from + away, from.wrapping_sub(away)] {
                if lines.contains(&place)
                    && let Some(Some(shape)) = sample.shapes.get(place)
                {
                    let distance = shape.distance(&at);
                    if distance < nearest {
                        (nearest, near) = (distance, place);
                    }
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
        findings.complain(&format!(
            "{distance} mm off the path in row {row}, line {line}"
        ));
    }
}

/// Prints what was found of each program, and of all.
fn assert_good(all: impl Iterator<Item = Findings>) {
    let mut faults = Vec::new();
    let mut worst = Findings::default();
    let mut count = 0;
    let most = |a: [f64; 2], b: [f64; 2]| [a[0].max(b[0]), a[1].max(b[1])];
    let tell = |it: &Findings| {
        println!(
            "{}: {:.3} s; of the limits between samples {:?}, by the trace {:?}; {:.6} mm off, {:.3} \
             of the tolerance; end {:.2} increments off",
            it.name, it.duration, it.exact, it.sampled, it.deviation, it.strayed, it.end
        );
    };
    for findings in all {
        tell(&findings);
        findings
            .faults
            .iter()
            .for_each(|fault| println!("  {fault}"));
        worst.exact = most(worst.exact, findings.exact);
        worst.sampled = most(worst.sampled, findings.sampled);
        worst.deviation = worst.deviation.max(findings.deviation);
        worst.strayed = worst.strayed.max(findings.strayed);
        worst.end = worst.end.max(findings.end);
        worst.duration += findings.duration;
        count += 1;
        faults.extend(findings.faults);
    }
    worst.name = format!("{count} programs, the worst of all");
    tell(&worst);
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn an_excerpt_of_the_corpus() {
    assert_good(excerpt().iter().map(judge));
}

#[test]
#[ignore = "a campaign of many minutes: docs/measured.md"]
fn the_whole_corpus() {
    let generated = whole();
    let examples = examples();
    assert_good(
        examples
            .iter()
            .map(judge_example)
            .chain(generated.iter().map(judge)),
    );
}

#[test]
#[ignore = "a campaign of minutes: docs/measured.md"]
fn the_corpus_of_many_segments() {
    assert_good(many_segments().iter().map(judge));
}

/// The checker is checked: a program that is not what it claims to be is found out.
#[test]
fn a_path_that_is_not_the_programmed_one_is_seen() {
    let sees = |sample: &Sample, parts: &[&str]| {
        let told = judge(sample).faults.join("\n");
        for part in parts {
            assert!(told.contains(part), "{part}: {told}");
        }
    };
    let mut sample = corners(60).remove(2);
    sample.tolerance /= 10.0;
    sees(&sample, &["deviation", "off the path", "misses point"]);

    // The first line that no other one goes along as well.
    let mut sample = corners(60).remove(0);
    let line = sample.shapes.iter_mut().flatten().find_map(|it| match it {
        Shape::Line(from, to) if to[1] > from[1] => Some(to),
        _ => None,
    });
    line.unwrap()[1] += 0.01;
    sample.end[0] += 0.01;
    sees(&sample, &["off the path", "misses point", "axis X ends"]);

    // A path that is right and takes an eternity.
    let mut sample = corners(180).remove(0);
    sample.text = sample.text.replace("F12000", "F120");
    sees(&sample, &["s, more than"]);
}
