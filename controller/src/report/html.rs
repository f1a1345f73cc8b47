//! The page and its parts.

use super::{
    AxisReport, Report, Violation,
    chart::{self, Line, Mark, Strip},
    distribution,
    scale::{count, number},
    toolpath::ToolPath,
};
use std::fmt::Write;

/// Violations listed; more are counted.
const LISTED: usize = 200;

/// The whole file.
pub(super) fn page(report: &Report) -> String {
    let mut html = format!(
        "<!doctype html>\n<html lang=en>\n<head>\n<meta charset=utf-8>\n\
         <meta name=viewport content='width=device-width, initial-scale=1'>\n\
         <meta name=color-scheme content='light dark'>\n\
         <title>{} · {}</title>\n<style>\n{}</style>\n</head>\n<body>\n<main>\n",
        escape(&report.machine),
        escape(&report.program),
        include_str!("style.css")
    );
    html += &head(report);
    html += &violations(&report.violations);
    html += &limits(&report.axes);
    html += &toolpath(report);
    html += &path_over_time(report);
    for axis in &report.axes {
        html += &axis_over_time(report, axis);
    }
    html += &distributions(report);
    html + "</main>\n</body>\n</html>\n"
}

/// Verdict, what ran, and the facts.
fn head(report: &Report) -> String {
    let (class, word) = match report.verdict {
        "pass" => ("pass", "Pass"),
        "interrupted" => ("fail", "Interrupted"),
        _ => ("fail", "Fail"),
    };
    let mut html = format!(
        "<header class={class}>\n<div><h1>{} <span>{}</span></h1>\n<p class=quiet>{}</p></div>\n\
         <div class=verdict><b>{word}</b><p>{}</p></div>\n</header>\n<dl class=facts>\n",
        escape(&report.machine),
        escape(&report.program),
        escape(&report.mode),
        escape(&report.outcome),
    );
    for (name, value) in &report.facts {
        // A hash gets a line of its own.
        let class = if value.len() > 32 { " class=wide" } else { "" };
        _ = writeln!(
            html,
            "<div{class}><dt>{}</dt><dd>{}</dd></div>",
            escape(name),
            escape(value)
        );
    }
    html + "</dl>\n"
}

fn violations(violations: &[Violation]) -> String {
    if violations.is_empty() {
        return String::new();
    }
    let mut html = format!(
        "<section class=violations>\n<h2>{} violation{}</h2>\n<div class=scroll><table>\n<tr>\
         <th>What<th>Axis<th class=n>Time<th class=n>Line<th class=n>Value<th class=n>Limit</tr>\n",
        count(violations.len() as u64),
        if violations.len() == 1 { "" } else { "s" }
    );
    for violation in violations.iter().take(LISTED) {
        // A fault has no value.
        let told = |value| match violation.unit {
            "" => "–".to_owned(),
            unit => format!("{} {}", number(value), escape(unit)),
        };
        _ = writeln!(
            html,
            "<tr><td>{}<td>{}<td class=n>{:.4} s<td class=n>{}<td class=n>{}<td class=n>{}</tr>",
            escape(&violation.what),
            escape(violation.axis.as_deref().unwrap_or("–")),
            violation.time,
            line(violation.line),
            told(violation.value),
            told(violation.limit),
        );
    }
    html += "</table></div>\n";
    if violations.len() > LISTED {
        let rest = count((violations.len() - LISTED) as u64);
        _ = writeln!(html, "<p class=quiet>… and {rest} more.</p>");
    }
    html + "</section>\n"
}

fn line(line: u32) -> String {
    if line == 0 {
        "–".into()
    } else {
        line.to_string()
    }
}

/// Each axis's greatest values against its limits.
fn limits(axes: &[AxisReport]) -> String {
    if axes.is_empty() {
        return String::new();
    }
    let mut html = String::from(
        "<section>\n<h2>Against the limits</h2>\n<div class=scroll><table class=limits>\n<tr><th>\
         Axis<th>Velocity<th>Acceleration<th>Jerk<th>Following error<th class=n>RMS</tr>\n",
    );
    for axis in axes {
        _ = write!(html, "<tr><th>{}</th>", escape(&axis.name));
        let [position, velocity, acceleration, jerk] = axis.units;
        for (value, limit, unit) in [
            (axis.max_velocity, axis.limits.velocity, velocity),
            (
                axis.max_acceleration,
                axis.limits.acceleration,
                acceleration,
            ),
            (axis.max_jerk, axis.limits.jerk, jerk),
            (
                axis.max_following_error,
                axis.limits.following_error,
                position,
            ),
        ] {
            let share = if limit > 0.0 { value / limit } else { 0.0 };
            // The plan is allowed its rounding.
            let class = if share > 1.0 + 1e-6 {
                " class=over"
            } else {
                ""
            };
            _ = write!(
                html,
                "<td{class}><div class=meter><div style='width:{:.1}%'></div></div>{} \
                 <span>of {} {unit} · {:.0} %</span>",
                (share * 100.0).clamp(0.0, 100.0),
                number(value),
                number(limit),
                share * 100.0
            );
        }
        _ = writeln!(
            html,
            "<td class=n>{} {position}</tr>",
            number(axis.rms_following_error)
        );
    }
    html + "</table></div>\n</section>\n"
}

fn toolpath(report: &Report) -> String {
    let Some(path) = ToolPath::new(report) else {
        return String::new();
    };
    let whole = path.whole();
    let mut html = String::from("<section>\n<h2>Tool path</h2>\n");
    let mut views = |title: &str, extents| {
        _ = writeln!(
            html,
            "<div class=pair>\n<figure><figcaption>{title}from above</figcaption>{}</figure>\n\
             <figure><figcaption>{title}in space</figcaption>{}</figure>\n</div>",
            path.above(extents),
            path.in_space(extents),
        );
    };
    if let Some(work) = path.work() {
        views("The work, ", &work);
        views("All of it, ", &whole);
    } else {
        views("", &whole);
    }
    html + &path.legend() + "\n</section>\n"
}

fn path_over_time(report: &Report) -> String {
    let lines: Vec<f64> = report.line.iter().map(|line| f64::from(*line)).collect();
    let strip = |title, unit, note, values, stepped| Strip {
        title,
        unit,
        note,
        lines: vec![Line {
            class: "set",
            name: "",
            values,
            stepped,
        }],
        limits: Vec::new(),
    };
    let most = |values: &[f64]| {
        let most = values.iter().copied().fold(0.0, f64::max);
        format!("max {}", number(most))
    };
    let mut strips = vec![strip(
        "Feed",
        "mm/s",
        most(&report.feed),
        &report.feed[..],
        false,
    )];
    if report.turning.iter().any(|speed| *speed > 0.0) {
        let note = most(&report.turning);
        strips.push(strip(
            "Feed of turns alone",
            "°/s",
            note,
            &report.turning,
            false,
        ));
    }
    strips.push(strip("Program line", "", String::new(), &lines, true));
    let all: Vec<Mark> = report.violations.iter().take(LISTED).map(mark).collect();
    section(
        "Along the path",
        chart::strips("Feed and program line", &report.time, &strips, &all),
    )
}

fn axis_over_time(report: &Report, axis: &AxisReport) -> String {
    let strip = |title, unit, values, limit: f64, max: f64, stepped| Strip {
        title,
        unit,
        note: format!("max {} · limit {}", number(max), number(limit)),
        lines: vec![Line {
            class: "set",
            name: "",
            values,
            stepped,
        }],
        limits: vec![limit, -limit],
    };
    let (least, most) = axis.limits.position;
    let [position, velocity, acceleration, jerk] = axis.units;
    let strips = [
        Strip {
            title: "Position",
            unit: position,
            note: format!("soft limits {} … {}", number(least), number(most)),
            lines: vec![
                Line {
                    class: "act",
                    name: "actual",
                    values: &axis.act,
                    stepped: false,
                },
                Line {
                    class: "set",
                    name: "set",
                    values: &axis.set,
                    stepped: false,
                },
            ],
            limits: vec![least, most],
        },
        strip(
            "Velocity",
            velocity,
            &axis.velocity,
            axis.limits.velocity,
            axis.max_velocity,
            false,
        ),
        strip(
            "Acceleration",
            acceleration,
            &axis.acceleration,
            axis.limits.acceleration,
            axis.max_acceleration,
            false,
        ),
        strip(
            "Jerk",
            jerk,
            &axis.jerk,
            axis.limits.jerk,
            axis.max_jerk,
            true,
        ),
        strip(
            "Following error",
            position,
            &axis.following_error,
            axis.limits.following_error,
            axis.max_following_error,
            false,
        ),
    ];
    let own: Vec<Mark> = report
        .violations
        .iter()
        .filter(|violation| {
            violation
                .axis
                .as_ref()
                .is_none_or(|name| *name == axis.name)
        })
        .take(LISTED)
        .map(mark)
        .collect();
    let title = format!("Axis {}", axis.name);
    section(&title, chart::strips(&title, &report.time, &strips, &own))
}

fn mark(violation: &Violation) -> Mark {
    Mark {
        time: violation.time,
        text: format!(
            "{} {}: {} {unit}, limit {} {unit}, line {}",
            violation.axis.as_deref().unwrap_or_default(),
            violation.what,
            number(violation.value),
            number(violation.limit),
            line(violation.line),
            unit = violation.unit,
        ),
    }
}

fn distributions(report: &Report) -> String {
    let cards: String = report
        .distributions
        .iter()
        .map(distribution::card)
        .collect();
    if cards.is_empty() {
        return cards;
    }
    format!("<section>\n<h2>Times of the cycle</h2>\n<div class=pair>{cards}</div>\n</section>\n")
}

fn section(title: &str, content: String) -> String {
    if content.is_empty() {
        return content;
    }
    format!(
        "<section>\n<h2>{}</h2>\n{content}\n</section>\n",
        escape(title)
    )
}

/// Text as HTML shows it, in an attribute too.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&#39;")
}
