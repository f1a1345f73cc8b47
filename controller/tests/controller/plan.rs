//! `syncline plan` from outside: every status, the exit code, and plans that read back.

use std::process::{Command, Output};

const HEADER: &str = "id,sync,min_duration,interface,\
    p0_0,v0_0,a0_0,pf_0,vf_0,af_0,vmax_0,vmin_0,amax_0,amin_0,jmax_0,jmin_0,pmin_0,pmax_0,\
    p0_1,v0_1,a0_1,pf_1,vf_1,af_1,vmax_1,vmin_1,amax_1,amin_1,jmax_1";
/// A second axis that moves 5 in 7 s.
const SECOND: &str = "0,0,0,5,0,0,1,-1,1,-1,1";
/// No second axis.
const ALONE: &str = ",,,,,,,,,,";

fn plan(rows: &[String], options: &[&str]) -> Output {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("cases.csv");
    std::fs::write(&file, format!("{HEADER}\n{}\n", rows.join("\n"))).unwrap();
    Command::new(env!("CARGO_BIN_EXE_syncline"))
        .arg("plan")
        .arg(&file)
        .args(options)
        .output()
        .unwrap()
}

fn answers(output: &Output) -> Vec<Vec<String>> {
    let mut reader = csv::Reader::from_reader(output.stdout.as_slice());
    reader
        .records()
        .map(|r| r.unwrap().iter().map(String::from).collect())
        .collect()
}

#[test]
fn every_row_is_answered_with_its_own_status() {
    let axis = "0,0,0,1,0,0,1,-1,1,-1,1,,,";
    let cases = [
        ("ok", format!(",,,{axis},{SECOND}")),
        ("ok", format!("line,,,{axis},{SECOND}")),
        ("ok", format!("none,,,{axis},{ALONE}")),
        (
            "ok",
            format!(",,velocity,0,1,0.5,,0,0,1,-1,1,-1,1,,,,{ALONE}"),
        ),
        (
            "bad_row",
            format!(",,,0,zero,0,1,0,0,1,-1,1,-1,1,,,,{SECOND}"),
        ),
        ("bad_row", format!(",,,0,,0,1,0,0,1,-1,1,-1,1,,,,{SECOND}")),
        ("bad_row", format!("together,,,{axis},{SECOND}")),
        ("bad_row", format!(",soon,,{axis},{SECOND}")),
        ("bad_row", format!(",,,{axis},{SECOND},7")),
        ("bad_row", format!(",,,,,,,,,,,,,,,,,{ALONE}")),
        ("nan", format!(",,,0,nan,0,1,0,0,1,-1,1,-1,1,,,,{SECOND}")),
        ("nan", format!(",,,0,0,0,1,0,0,inf,-1,1,-1,1,,,,{SECOND}")),
        (
            "zero_limit",
            format!(",,,0,0,0,1,0,0,0,-1,1,-1,1,,,,{SECOND}"),
        ),
        (
            "zero_limit",
            format!(",,,0,0,0,1,0,0,1,1,1,-1,1,,,,{SECOND}"),
        ),
        (
            "target_breaks_limit",
            format!(",,,0,0,0,1,2,0,1,-1,1,-1,1,,,,{SECOND}"),
        ),
        (
            "target_breaks_limit",
            format!(",,,0,0,0,1,0.9,-0.9,1,-1,1,-1,1,,,,{SECOND}"),
        ),
        (
            "target_outside_position",
            format!(",,,0,0,0,1,0,0,1,-1,1,-1,1,,,0.5,{SECOND}"),
        ),
        (
            "start_outside_position",
            format!(",,,1,0,0,0,0,0,1,-1,1,-1,1,,,0.5,{SECOND}"),
        ),
        (
            "unreachable",
            format!(",,,0.4,1,0,0,0,0,1,-1,1,-1,1,,,0.5,{SECOND}"),
        ),
        (
            "not_straight",
            format!("line,,,0,1,0,1,0,0,1,-1,1,-1,1,,,,{SECOND}"),
        ),
        ("min_duration", format!(",-1,,{axis},{SECOND}")),
        ("too_large", format!(",1e300,,{axis},{SECOND}")),
        (
            "too_large",
            format!(",,,0,0,0,1e308,0,0,1,-1,1,-1,1,,,,{SECOND}"),
        ),
        (
            "too_large",
            format!(",,,0,0,1e200,1,0,0,1,-1,1,-1,1,,,,{SECOND}"),
        ),
        (
            "too_large",
            format!(",,,0,1e60,0,1,0,0,1000,-1000,1000,-1000,1e-6,,,,{SECOND}"),
        ),
        (
            "too_small",
            format!(",,,0,0,0,1,0,0,1,-1,1,-1,1e-20,,,,{SECOND}"),
        ),
    ];
    let rows: Vec<String> = cases
        .iter()
        .enumerate()
        .map(|(i, c)| format!("r{i},{}", c.1))
        .collect();
    let output = plan(&rows, &[]);
    let answers = answers(&output);
    assert_eq!(answers.len(), cases.len());
    for (i, ((status, row), answer)) in cases.iter().zip(&answers).enumerate() {
        assert_eq!(
            (&answer[0], answer[1].as_str()),
            (&format!("r{i}"), *status),
            "{row}"
        );
        if *status == "ok" {
            assert!(answer[2].parse::<f64>().unwrap() > 0.0);
            assert!(answer[3].parse::<f64>().unwrap() <= 1e-12, "{answer:?}");
            assert!(answer[4].parse::<f64>().unwrap() <= 1e-12, "{answer:?}");
        } else {
            assert_eq!(&answer[2..], ["", "", ""]);
        }
    }
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn segments_lead_from_the_start_to_the_target() {
    let rows = [format!("a,time,,,0,0.2,0,1,0,0,1,-1,1,-2,3,-1,,,{SECOND}")];
    let directory = tempfile::tempdir().unwrap();
    let out = directory.path().join("plans.csv");
    let output = plan(&rows, &["--segments", "--out", out.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stdout.is_empty());
    let mut reader = csv::Reader::from_path(&out).unwrap();
    let record = reader.records().next().unwrap().unwrap();
    assert_eq!(&record[2], "7");
    for (column, v0, target) in [(5, 0.2, 1.0), (6, 0.0, 5.0)] {
        let (mut p, mut v, mut a, mut total) = (0.0, v0, 0.0, 0.0);
        for pair in record[column].split(';') {
            let (t, j) = pair.split_once(':').unwrap();
            let (t, j): (f64, f64) = (t.parse().unwrap(), j.parse().unwrap());
            p += v * t + a * t * t / 2.0 + j * t * t * t / 6.0;
            v += a * t + j * t * t / 2.0;
            a += j * t;
            total += t;
        }
        assert!(
            (p - target).abs() < 1e-12 && v.abs() < 1e-12 && a.abs() < 1e-12,
            "{p} {v} {a}"
        );
        assert!((total - 7.0_f64).abs() < 1e-12);
    }
}

#[test]
fn a_file_without_its_columns_is_refused_by_name() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("cases.csv");
    std::fs::write(&file, "id,sync,p0_0\n1,,0\n").unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_syncline"))
        .arg("plan")
        .arg(&file)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(error.contains("no column v0_0"), "{error}");
}
