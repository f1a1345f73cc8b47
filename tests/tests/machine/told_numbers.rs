//! Every number that the report tells is in the JSON, too: who reads the one has what the other reads.

use serde_json::Value;
use syncline_tests::command::{Folder, ended, machine_with, syncline};

/// With numbers that are nowhere else by chance.
const PROGRAM: &str = "G64 P0.037 F4321\nT7 M6\nS1234 M3\nG1 X41.7 Y13.3\nG4 P0.123\nG1 Y57.9\nG3 X21.7 Y77.9 R20\nG3 I-17.7\n\
                       M5\nT12 M6\nG1 Z-11.3\nG0 X0 Y0 Z0\nM2\n";

/// What stands in a report for people to read, without what it is drawn with.
fn text_of(html: &str) -> String {
    let mut html = html.to_owned();
    for (begin, end) in [
        ("<style", "</style>"),
        ("<script", "</script>"),
        ("<svg", "</svg>"),
        // Lines of the program, and what makes the run again.
        ("<code", "</code>"),
    ] {
        while let Some(from) = html.find(begin) {
            let to = html[from..]
                .find(end)
                .map_or(html.len(), |at| from + at + end.len());
            html.replace_range(from..to, "|");
        }
    }
    let mut in_tag = false;
    let mut text = String::new();
    for letter in html.chars() {
        match letter {
            '<' => in_tag = true,
            '>' => {
                in_tag = false;
                text.push('|');
            }
            _ if !in_tag => text.push(letter),
            _ => {}
        }
    }
    text
}

/// The numbers of a text, each with half of its last digit; groups of digits are one.
fn numbers(text: &str) -> Vec<(f64, f64, String)> {
    let letters: Vec<char> = text.chars().collect();
    let mut found = Vec::new();
    let mut at = 0;
    while at < letters.len() {
        if !letters[at].is_ascii_digit() {
            at += 1;
            continue;
        }
        let begin = at;
        let is_part = |at: usize| {
            let here = letters[at];
            let between = at + 1 < letters.len() && letters[at + 1].is_ascii_digit();
            here.is_ascii_digit()
                || (between && matches!(here, '.' | '\u{202f}' | '\u{2009}' | '\u{a0}'))
        };
        while at < letters.len() && is_part(at) {
            at += 1;
        }
        let number: String = letters[begin..at]
            .iter()
            .filter(|it| !it.is_whitespace())
            .collect();
        let decimals = number.split_once('.').map_or(0, |(_, behind)| behind.len());
        let half = 0.5 * 10.0_f64.powi(-(decimals as i32));
        let from = begin.saturating_sub(30);
        let around = letters[from..(at + 12).min(letters.len())].iter().collect();
        // A version is none.
        if let Ok(value) = number.parse() {
            found.push((value, half, around));
        }
    }
    found
}

/// All numbers of a JSON, without their signs.
fn all_of(json: &Value, into: &mut Vec<f64>) {
    match json {
        Value::Number(number) => into.extend(number.as_f64().map(f64::abs)),
        // A cause says its figures in words.
        Value::String(text) => into.extend(numbers(text).into_iter().map(|it| it.0)),
        Value::Array(items) => items.iter().for_each(|it| all_of(it, into)),
        Value::Object(items) => items.values().for_each(|it| all_of(it, into)),
        _ => {}
    }
}

/// Of a run that passes, and of one that does not follow.
#[test]
fn every_number_of_the_report_is_in_the_json() {
    for (more, verdict) in [
        ("", "pass"),
        ("[validation]\nfollowing_error = 0.00523\n", "fail"),
    ] {
        let folder = Folder::new();
        let limit = (
            "following_error_limit = 1.0",
            "following_error_limit = 1.379",
        );
        let machine = folder.file("xyz.toml", &(machine_with("xyz", &[limit]) + more));
        let program = folder.file("program.ngc", PROGRAM);
        let [report, json] = ["r.html", "r.json"].map(|name| folder.path(name));
        let mut command = syncline();
        command.args(["validate", "--time-bounds", "--seed", "4711"]);
        command
            .arg("--report")
            .arg(&report)
            .arg("--json")
            .arg(&json);
        let output = command.args([&machine, &program]).output().unwrap();
        let (_, _, errors) = ended(&output);
        let [report, json] = [report, json].map(|file| std::fs::read_to_string(file).unwrap());
        let json: Value = serde_json::from_str(&json).unwrap();
        assert_eq!(json["verdict"], verdict, "{errors}");

        let mut known = Vec::new();
        all_of(&json, &mut known);
        for list in ["violations", "worst_places"] {
            known.push(json[list].as_array().unwrap().len() as f64);
        }
        // What part of its limit an axis uses is the one of its numbers by the other.
        for axis in json["axes"].as_array().unwrap() {
            let of = |key: &str| axis[key].as_f64().unwrap();
            for (most, limit) in [
                ("max_velocity", "velocity_limit"),
                ("max_acceleration", "acceleration_limit"),
                ("max_jerk", "jerk_limit"),
                ("max_following_error_mm", "following_error_limit_mm"),
            ] {
                known.push(of(most) / of(limit));
            }
        }
        let mut text = text_of(&report);
        // Names and units.
        let hash = json["frames_sha256"].as_str().unwrap();
        let program = program.display().to_string();
        for name in [hash, &program, "SHA-256", "1/min"] {
            text = text.replace(name, "");
        }
        let told = numbers(&text);
        assert!(told.len() > 80, "{text}");
        for (number, half, around) in told {
            let within = |it: f64| (it - number).abs() <= half * (1.0 + 1e-9) + 1e-12;
            // Percent, and micrometres and milliseconds.
            let is_known =
                (known.iter()).any(|&it| within(it) || within(100.0 * it) || within(1000.0 * it));
            assert!(is_known, "{number} is in the report only: …{around}…");
        }
    }
}
