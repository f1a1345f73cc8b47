//! The report of runs from nothing at all to many minutes.

use base64::prelude::{BASE64_STANDARD, Engine};
use flate2::read::GzDecoder;
use std::io::Read;
use std::time::Duration;
use syncline_canopen::Instant;
use syncline_controller::machine::AxisLimits;
use syncline_controller::observe::record::{AxisReport, Report, Violation};
use syncline_controller::observe::timing::Distribution;
use syncline_trajectory::path::curve::ArcDefinition;
use syncline_trajectory::path::{
    Curve, Executor, Feed, Limits, Move, PathControlMode, PathItem, Plane, Planner,
};

const PERIOD: f64 = 0.002;
const LIMITS: Limits<3> = Limits {
    velocity: [700.0, 800.0, 500.0],
    acceleration: [3000.0, 5000.0, 4000.0],
    jerk: [60_000.0, 100_000.0, 80_000.0],
};

/// A plate with rounded corners and a ring of bores, `layers` deep.
fn plate(layers: u32) -> Vec<PathItem<3>> {
    let mut items = Vec::new();
    let mut at = [0.0, 0.0, 0.0];
    let mut tag = 0;
    let mut go = |at: &mut [f64; 3], to: [f64; 3], arc: Option<(f64, f64)>, feed: Feed| {
        tag += 1;
        let curve = match arc {
            None => Curve::line(*at, to),
            Some(centre) => Curve::arc(ArcDefinition {
                start: *at,
                end: to,
                plane: Plane::Xy,
                centre,
                clockwise: false,
                turns: 0,
            }),
        };
        items.push(PathItem::Move(Move {
            curve: curve.unwrap(),
            feed,
            mode: PathControlMode::Stop,
            tag,
        }));
        *at = to;
    };
    for layer in 1..=layers {
        let z = -120.0 - 4.0 * f64::from(layer);
        go(&mut at, [840.0, 200.0, -100.0], None, Feed::Rapid);
        go(&mut at, [840.0, 200.0, z], None, Feed::Rate(50.0));
        let cut = Feed::Rate(250.0);
        for (corner, centre, end) in [
            ([1360.0, 200.0], (1360.0, 240.0), [1400.0, 240.0]),
            ([1400.0, 560.0], (1360.0, 560.0), [1360.0, 600.0]),
            ([840.0, 600.0], (840.0, 560.0), [800.0, 560.0]),
            ([800.0, 240.0], (840.0, 240.0), [840.0, 200.0]),
        ] {
            go(&mut at, [corner[0], corner[1], z], None, cut);
            go(&mut at, [end[0], end[1], z], Some(centre), cut);
        }
        go(&mut at, [840.0, 200.0, -100.0], None, Feed::Rapid);
        for (x, y) in [
            (1100.0, 500.0),
            (1186.6, 450.0),
            (1186.6, 350.0),
            (1100.0, 300.0),
            (1013.4, 350.0),
            (1013.4, 450.0),
        ] {
            go(&mut at, [x + 15.0, y, -100.0], None, Feed::Rapid);
            go(&mut at, [x + 15.0, y, -110.0], None, Feed::Rate(80.0));
            // A helix down, a turn on the ground.
            go(&mut at, [x + 15.0, y, z], Some((x, y)), Feed::Rate(120.0));
            go(
                &mut at,
                [x + 15.0, y, z - 0.001],
                Some((x, y)),
                Feed::Rate(120.0),
            );
            go(&mut at, [x + 15.0, y, -100.0], None, Feed::Rapid);
        }
    }
    items
}

fn report(items: &[PathItem<3>]) -> Report {
    let mut planner = Planner::new(LIMITS, [0.0; 3]);
    let mut executor = Executor::new([0.0; 3], PERIOD);
    for item in items {
        planner.push(*item).unwrap();
    }
    planner.finish();
    let mut report = Report {
        machine: "portal".into(),
        program: "plate <1>.ngc".into(),
        mode: "Validated in virtual time on simulated drives, seed 1".into(),
        verdict: "pass",
        outcome: "Finished; every axis inside its limits".into(),
        axes: ["X", "Y", "Z"]
            .iter()
            .enumerate()
            .map(|(n, name)| AxisReport {
                units: ["mm", "mm/s", "mm/s²", "mm/s³"],
                name: (*name).into(),
                limits: AxisLimits {
                    position: [(0.0, 1500.0), (0.0, 1000.0), (-300.0, 0.0)][n],
                    velocity: LIMITS.velocity[n],
                    acceleration: LIMITS.acceleration[n],
                    jerk: LIMITS.jerk[n],
                    following_error: 2.0,
                    ..AxisLimits::default()
                },
                ..AxisReport::default()
            })
            .collect(),
        ..Report::default()
    };
    loop {
        while executor.room() > 0
            && let Some(command) = planner.pop()
        {
            assert!(executor.accept(command));
        }
        if executor.is_idle() {
            break;
        }
        let now = executor.advance();
        report.time.push(report.time.len() as f64 * PERIOD);
        report.line.push(now.tag);
        report.feed.push(now.speed);
        report.cutting.push(now.feed.is_finite());
        for (n, axis) in report.axes.iter_mut().enumerate() {
            let error = now.acceleration[n] * 8e-6 + now.velocity[n] * 2e-5;
            axis.set.push(now.position[n]);
            axis.act.push(now.position[n] - error);
            axis.velocity.push(now.velocity[n]);
            axis.acceleration.push(now.acceleration[n]);
            axis.jerk.push(now.jerk[n]);
            axis.following_error.push(error);
            axis.max_velocity = axis.max_velocity.max(now.velocity[n].abs());
            axis.max_acceleration = axis.max_acceleration.max(now.acceleration[n].abs());
            axis.max_jerk = axis.max_jerk.max(now.jerk[n].abs());
            axis.max_following_error = axis.max_following_error.max(error.abs());
            axis.rms_following_error = 0.011;
        }
    }
    let cycles = report.time.len();
    for (name, value) in [
        ("Motion time", format!("{:.2} s", cycles as f64 * PERIOD)),
        ("Cycles", cycles.to_string()),
        ("Late setpoints", "0".into()),
        ("Path length", "12 345.6 mm".into()),
        ("Greatest contour error", "0.043 mm".into()),
        ("Busiest cycle, portal", "48.6 %".into()),
        (
            "Frames, SHA-256",
            "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08".into(),
        ),
    ] {
        report.facts.push((name.into(), value));
    }
    let mut latency = Distribution::new("wake-up latency");
    let mut cycle = Distribution::new("SYNC to SYNC");
    for n in 0..cycles as u64 {
        let at = Instant::from_nanos(n * 2_000_000);
        let late = 3_000 + n * 7_919 % 9_000 + if n % 997 == 0 { 400_000 } else { 0 };
        latency.record(Duration::from_nanos(late), at);
        let period = 2_000_000 + n * 7_919 % 900 - 450;
        cycle.record(Duration::from_nanos(period), at);
    }
    report.distributions = vec![latency, cycle];
    report
}

fn violations(count: usize) -> Vec<Violation> {
    (0..count)
        .map(|n| Violation {
            what: "following error".into(),
            axis: Some("X".into()),
            time: 1.5 + n as f64 * 0.1,
            line: 12,
            value: 2.345,
            limit: 2.0,
            unit: "mm",
        })
        .collect()
}

/// What must hold of every report.
fn check(html: &str) {
    assert!(html.starts_with("<!doctype html>") && html.trim_end().ends_with("</html>"));
    // The page, what is packed for its script, and the script.
    let parts: Vec<&str> = html.split("<script").collect();
    for part in parts.iter().filter(|it| !it.contains("id=data")) {
        for forbidden in ["http", "url(", "<img", "@import", " src="] {
            assert!(!part.contains(forbidden), "{forbidden}");
        }
    }
    let html = parts[0];
    for forbidden in ["NaN", "inf ", "inf'", "null"] {
        assert!(!html.contains(forbidden), "{forbidden}");
    }
    for tag in ["svg", "section", "table", "figure", "div", "dl"] {
        let opened =
            html.matches(&format!("<{tag} ")).count() + html.matches(&format!("<{tag}>")).count();
        assert_eq!(opened, html.matches(&format!("</{tag}>")).count(), "{tag}");
    }
    check_labels(html);
}

/// Every label lies inside of its picture, in the fonts of all readers.
fn check_labels(html: &str) {
    let between = |text: &str, start: &str, end: &str| {
        let (_, rest) = text.split_once(start)?;
        Some(rest.split_once(end)?.0.to_owned())
    };
    for svg in html.split("<svg ").skip(1) {
        let svg = svg.split("</svg>").next().unwrap();
        let width = between(svg, "viewBox='0 0 ", " ").unwrap();
        let width: f64 = width.parse().unwrap();
        // Larger letters on narrow pages.
        let letter = if svg.starts_with("class=view") {
            7.0
        } else {
            5.5
        };
        for label in svg.split("<text ").skip(1) {
            let label = label.split("</text>").next().unwrap();
            let (head, content) = label.split_once('>').unwrap();
            let text: String = (content.split('<'))
                .map(|part| part.split_once('>').map_or(part, |(_, text)| text))
                .collect();
            let x = between(&format!("{head} "), "x=", " ").unwrap();
            let x: f64 = x.parse().unwrap();
            let long = text.chars().count() as f64 * letter;
            let left = match between(&format!("{head} "), "text-anchor=", " ").as_deref() {
                Some("end") => x - long,
                Some("middle") => x - long / 2.0,
                _ => x,
            };
            assert!(left >= 0.0 && left + long <= width, "{text:?} at {left}");
        }
    }
}

/// Flat, thin, tiny and huge paths: no label is cut off, and noise is not told as an extent.
#[test]
fn labels_fit_their_pictures() {
    for (size, told) in [
        ([130.0, 0.000_101_7, 60.0], &["X ", "Z "][..]),
        ([0.000_152_6, 0.0, 0.0], &["X "]),
        ([0.03, 12_345.6, 0.03], &["Y "]),
        ([0.037_71, 0.031_23, 0.033_33], &["X ", "Y ", "Z "]),
        ([123_456.7, 98_765.4, 123_456.7], &["X ", "Y ", "Z "]),
    ] {
        let mut report = report(&plate(1));
        for (axis, size) in report.axes.iter_mut().zip(size) {
            let cycles = axis.set.len() as f64;
            let steps = axis.set.iter_mut().enumerate();
            steps.for_each(|(n, set)| *set = size * n as f64 / (cycles - 1.0));
        }
        let html = report.to_html(None);
        check(&html);
        let (_, space) = html.split_once("aria-label='Tool path in space'").unwrap();
        let space = space.split("</svg>").next().unwrap();
        for name in ["X ", "Y ", "Z "] {
            let label = format!(">{name}<tspan class=unit>");
            assert_eq!(space.contains(&label), told.contains(&name), "{size:?}");
        }
        save(&format!("labels-{}", size[0]), &html);
    }
}

#[test]
fn a_part() {
    let report = report(&plate(1));
    let html = report.to_html(None);
    check(&html);
    assert!(html.contains("plate &lt;1&gt;.ngc") && html.contains("<b>Pass</b>"));
    assert!(html.contains("The work, from above") && html.contains("All of it, in space"));
    assert!(html.contains("SHA-256") && html.contains("p99.9 "));
    assert!(!html.contains("violation<") && !html.contains("class=over"));
    save("part", &html);
}

#[test]
fn a_failure_says_what_where_and_when() {
    let mut report = report(&plate(1));
    report.verdict = "fail";
    report.outcome = "Stopped: axis X, following error 2.345 mm > 2 mm in line 12".into();
    report.violations = violations(3);
    report.axes[0].max_following_error = 2.345;
    let html = report.to_html(None);
    check(&html);
    assert!(html.contains("<b>Fail</b>") && html.contains("3 violations"));
    assert!(html.contains(
        "<td>following error<td>X<td class=n>1.5000 s<td class=n>12<td class=n>2.345 mm"
    ));
    // On the path and on the axis that it concerns.
    let strips: Vec<&str> = html.split("<div class=strips").skip(1).collect();
    let marks = strips
        .iter()
        .map(|it| it.matches("limit 2 mm, line 12").count());
    assert_eq!(marks.collect::<Vec<_>>(), [3, 3, 0, 0]);
    assert_eq!(html.matches("class=over").count(), 1);
    save("failure", &html);
}

#[test]
fn three_cycles_one_cycle_none() {
    let full = report(&plate(1));
    for cycles in [3, 1, 0] {
        let mut report = full.clone();
        report.time.truncate(cycles);
        report.line.truncate(cycles);
        report.feed.truncate(cycles);
        for axis in &mut report.axes {
            for values in [
                &mut axis.set,
                &mut axis.act,
                &mut axis.velocity,
                &mut axis.acceleration,
                &mut axis.jerk,
                &mut axis.following_error,
            ] {
                values.truncate(cycles);
            }
        }
        let html = report.to_html(None);
        check(&html);
        save(&format!("cycles-{cycles}"), &html);
    }
    check(&Report::default().to_html(None));
    let mut odd = full;
    odd.violations = violations(1000);
    odd.axes[1].set.fill(f64::NAN);
    odd.axes[2].act.clear();
    let html = odd.to_html(None);
    check(&html);
    assert!(html.contains("and 800 more"));
}

/// Names and lines of programs that would pass for others, or act on what shows them, are escaped as on a terminal: on the page,
/// in what its script draws, and in the program that it lists.
#[test]
fn what_is_unseen_is_escaped() {
    let mut report = report(&plate(1));
    let odd = "part\u{202e}cgn.1\u{1b}[2J";
    let escaped = "part\\u{202e}cgn.1\\u{1b}[2J";
    report.machine = odd.into();
    report.program = odd.into();
    report.outcome = odd.into();
    report.facts.push((odd.into(), odd.into()));
    report.violations = violations(1);
    report.violations[0].what = odd.into();
    report.source = format!("G0 X1 ({odd})\r\nG1 X2\n");
    let html = report.to_html(None);
    check(&html);
    let is_odd = |c: char| matches!(c, '\u{202e}' | '\u{1b}');
    assert!(!html.contains(is_odd));
    assert!(html.contains(escaped));

    let (_, packed) = html.split_once("id=data>").unwrap();
    let (packed, _) = packed.split_once('<').unwrap();
    let zipped = BASE64_STANDARD.decode(packed).unwrap();
    let mut bytes = Vec::new();
    GzDecoder::new(&zipped[..]).read_to_end(&mut bytes).unwrap();
    let source = format!("G0 X1 ({escaped})\nG1 X2\n");
    assert!(bytes.ends_with(source.as_bytes()));
}

#[test]
fn a_long_run_stays_small() {
    let report = report(&plate(12));
    assert!(report.time.len() > 100_000, "{}", report.time.len());
    let html = report.to_html(None);
    check(&html);
    assert!(html.len() < 4_000_000, "{} bytes", html.len());
    save("long", &html);
}

/// For eyes: `SYNCLINE_REPORTS=folder cargo test --test controller report`.
fn save(name: &str, html: &str) {
    if let Some(folder) = std::env::var_os("SYNCLINE_REPORTS") {
        let file = std::path::Path::new(&folder).join(format!("{name}.html"));
        std::fs::write(file, html).unwrap();
    }
}
