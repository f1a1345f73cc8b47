//! The page and its parts.

use super::plot::{self, Along, Curve};
use super::strips::{Line, Mark, Strip, strips};
use super::{
    AxisReport, Report, Summary, Violation, circles, data, distribution,
    scale::{count, number},
    spectrum, tables,
    toolpath::ToolPath,
    worst,
};
use crate::text::shown;
use std::fmt::Write;

/// Violations listed; more are counted.
const LISTED: usize = 200;

/// The whole file.
pub(super) fn page(report: &Report, summary: Option<&Summary>) -> String {
    let mut html = opened(&format!("{} · {}", report.machine, report.program));
    html += &head(report, summary);
    html += &violations(&report.violations, report.violations_left_off);
    let lines: Vec<&str> = report.source.lines().collect();
    let of = |part: &dyn Fn(&Summary) -> String| summary.map(part).unwrap_or_default();
    html += &of(&tables::bounds);
    html += &limits(&report.axes);
    html += &toolpath(report);
    html += &of(&|it| {
        let title = "Furthest from the path";
        section(title, worst::cards(report, &lines, &it.worst_places))
    });
    html += &of(&|it| circles::section(&lines, it));
    html += &path_over_time(report);
    html += &of(&|it| tables::slowest(it, &lines));
    html += &of(&|it| tables::hardest(it, &lines));
    for axis in &report.axes {
        html += &axis_over_time(report, axis);
    }
    html += &errors(report);
    html += &of(&tables::outputs);
    html += &of(&tables::tools);
    html += &of(&tables::drives);
    html += &of(&tables::transmissions);
    html += &of(&tables::structure);
    html += &of(&tables::loops);
    html += &distributions(report);
    html += &of(&tables::about);
    html += "</main>\n";
    if !report.time.is_empty() {
        html += &script(report);
    }
    html + "</body>\n</html>\n"
}

/// The beginning of a page with that title.
pub(super) fn opened(title: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=en>\n<head>\n<meta charset=utf-8>\n\
         <meta name=viewport content='width=device-width, initial-scale=1'>\n\
         <meta name=color-scheme content='light dark'>\n\
         <title>{}</title>\n<style>\n{}</style>\n</head>\n<body>\n<main>\n",
        escape(title),
        include_str!("style.css")
    )
}

/// The cursor's bar, the rows, and what shows them.
fn script(report: &Report) -> String {
    // Memory is written to, which takes everything.
    let packed = data::packed(report).unwrap_or_default();
    format!(
        "<div id=bar hidden><div><p id=where>Point at a plot or at the tool path.</p><p id=said></p></div>\
         <div class=acts><span id=span></span>\
         <button data-act=back title='back (←)'>◀</button><button data-act=on title='on (→)'>▶</button>\
         <button data-act=closer title='closer (+)'>+</button><button data-act=wider title='wider (−)'>−</button>\
         <button data-act=whole title='all of it (Esc)'>All</button></div></div>\n\
         <script type='application/octet-stream' id=data>{packed}</script>\n<script>\n{}</script>\n",
        include_str!("script.js")
    )
}

/// Verdict, what ran, and the facts.
fn head(report: &Report, summary: Option<&Summary>) -> String {
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
    let cause = summary.and_then(|it| it.cause.as_ref());
    let cause = cause.map(|it| ("cause".to_owned(), it.to_string()));
    for (name, value) in cause.iter().chain(&report.facts) {
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

fn violations(violations: &[Violation], left_off: u64) -> String {
    if violations.is_empty() {
        return String::new();
    }
    let all = violations.len() as u64 + left_off;
    let mut html = format!(
        "<section class=violations>\n<h2>{} violation{}</h2>\n<div class=scroll><table>\n<tr>\
         <th>What<th>Axis<th class=n>Time<th class=n>Line<th class=n>Value<th class=n>Limit</tr>\n",
        count(all),
        if all == 1 { "" } else { "s" }
    );
    for violation in violations.iter().take(LISTED) {
        // A fault has no value.
        let told = |value| match violation.unit {
            "" => "–".to_owned(),
            unit => format!("{} {}", number(value), escape(unit)),
        };
        _ = writeln!(
            html,
            "<tr data-time='{:.6}' tabindex=0><td>{}<td>{}<td class=n>{:.4} s<td class=n>{}<td class=n>{}<td class=n>{}</tr>",
            violation.time,
            escape(&violation.what),
            escape(violation.axis.as_deref().unwrap_or("–")),
            violation.time,
            line(violation.line),
            told(violation.value),
            told(violation.limit),
        );
    }
    html += "</table></div>\n";
    html += &more(all.saturating_sub(LISTED as u64));
    html + "</section>\n"
}

/// What stands below a list that leaves so many off.
pub(super) fn more(left_off: u64) -> String {
    match left_off {
        0 => String::new(),
        _ => format!("<p class=quiet>… and {} more.</p>\n", count(left_off)),
    }
}

/// Cards, the first ones at once and the others behind that summary of all.
pub(super) fn cards(cards: &[String], all: &str) -> String {
    /// So many are shown at once.
    const SHOWN: usize = 6;
    let (first, others) = cards.split_at(cards.len().min(SHOWN));
    let mut html = format!("<div class=cards>{}</div>", first.concat());
    if !others.is_empty() {
        html += &format!(
            "<details><summary>{all}</summary><div class=cards>{}</div></details>",
            others.concat()
        );
    }
    html
}

/// The text of one of the program's lines.
pub(super) fn line_text<'a>(lines: &[&'a str], line: u32) -> &'a str {
    let place = line.checked_sub(1);
    let text = place.and_then(|it| lines.get(it as usize));
    text.copied().unwrap_or_default()
}

/// A line's number.
pub(super) fn line(line: u32) -> String {
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
    html += &path.legend();
    html += &magnified(report, &path);
    html + "<p class=quiet><label><input type=checkbox id=follows checked> Show the stretch that the plots show</label></p>\n</section>\n"
}

/// The path that the tool went, with its contour error magnified.
fn magnified(report: &Report, path: &ToolPath) -> String {
    let extents = path.work().unwrap_or_else(|| path.padded());
    let Some((tool, times)) = ToolPath::magnified(report, &extents) else {
        return String::new();
    };
    format!(
        "<h3>Contour error, magnified {} times</h3>\n<div class=pair>\n<figure><figcaption>from above</figcaption>{}</figure>\n\
         <figure><figcaption>in space</figcaption>{}</figure>\n</div>{}",
        count(times as u64),
        tool.above(&extents),
        tool.in_space(&extents),
        tool.legend(),
    )
}

fn path_over_time(report: &Report) -> String {
    let most = |values: &[f64]| {
        let most = values.iter().copied().filter(|it| it.is_finite());
        format!("max {}", number(most.fold(0.0, f64::max)))
    };
    let feed = Strip::new("Feed", "mm/s", most(&report.feed), "feed");
    let programmed = Line {
        stepped: true,
        ..Line::below("programmed", "programmed")
    };
    let turns = report.turning.iter().any(|speed| *speed > 0.0);
    // Where A, B and C turn alone there is none.
    let goes = report.feed.iter().any(|feed| *feed > 0.0);
    let mut all = Vec::new();
    if goes || !turns {
        all.push(feed.over("reached", programmed));
    }
    if turns {
        let title = "Feed of turns alone";
        all.push(Strip::new(title, "°/s", most(&report.turning), "turning"));
    }
    let errors = Strip::new(
        "Contour error",
        "mm",
        most(&report.contour_error),
        "contour_error",
    );
    all.push(errors.over("tool", Line::below("setpoint", "rounding")));
    all.push(Strip::new("Program line", "", String::new(), "line").stepped());
    let marks: Vec<Mark> = report.violations.iter().take(LISTED).map(mark).collect();
    let plots = strips("Feed, contour error and program line", &all, &marks);
    let listing = "<div class=program><h3>Program, with the greatest contour error of each block</h3><div id=listing tabindex=0><div></div></div></div>";
    section("Along the path", plots + listing)
}

fn axis_over_time(report: &Report, axis: &AxisReport) -> String {
    let column = |what: &str| format!("{}.{what}", axis.name);
    let strip = |title, unit, what, limit: f64, max: f64| {
        let note = format!("max {} · limit {}", number(max), number(limit));
        Strip::new(title, unit, note, &column(what)).within(&[limit, -limit])
    };
    let limits = &axis.limits;
    let (least, most) = limits.position;
    let [position, velocity, acceleration, jerk] = axis.units;
    let soft = format!("soft limits {} … {}", number(least), number(most));
    let all = [
        Strip::new("Position", position, soft, &column("set"))
            .over("set", Line::below("actual", &column("act")))
            .within(&[least, most]),
        strip(
            "Velocity",
            velocity,
            "velocity",
            limits.velocity,
            axis.max_velocity,
        ),
        strip(
            "Acceleration",
            acceleration,
            "acceleration",
            limits.acceleration,
            axis.max_acceleration,
        ),
        strip("Jerk", jerk, "jerk", limits.jerk, axis.max_jerk).stepped(),
        strip(
            "Following error",
            position,
            "following_error",
            limits.following_error,
            axis.max_following_error,
        ),
    ];
    let is_own = |it: &&Violation| it.axis.as_ref().is_none_or(|name| *name == axis.name);
    let own = report.violations.iter().filter(is_own).take(LISTED);
    let own: Vec<Mark> = own.map(mark).collect();
    let title = format!("Axis {}", axis.name);
    section(&title, strips(&title, &all, &own))
}

/// How the errors are distributed, and what frequencies they have.
fn errors(report: &Report) -> String {
    let period = match report.time[..] {
        [first, second, ..] => second - first,
        _ => return String::new(),
    };
    let micrometres = |values: &[f64]| values.iter().map(|it| 1000.0 * it).collect::<Vec<_>>();
    let mut plots = plot::histogram("Contour error", "µm", &micrometres(&report.contour_error));
    for axis in &report.axes {
        let unit = if axis.units[0] == "mm" { "µm" } else { "m°" };
        let density = spectrum::of(&micrometres(&axis.following_error), period);
        let curve = Curve {
            class: "set",
            name: "",
            points: &density,
        };
        plots += &plot::curves(
            &format!("Following error of {}, by frequency", axis.name),
            ("Hz", &format!("{unit}/√Hz")),
            (Along::Decades, Along::Decades),
            &[curve],
        );
    }
    match plots.is_empty() {
        true => plots,
        false => section("Errors", format!("<div class=pair>{plots}</div>")),
    }
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

/// A part of the page under a title; nothing without content.
pub(super) fn section(title: &str, content: String) -> String {
    if content.is_empty() {
        return content;
    }
    format!(
        "<section>\n<h2>{}</h2>\n{content}\n</section>\n",
        escape(title)
    )
}

/// Text of others as a page shows it, in an attribute too.
pub(super) fn escape(text: &str) -> String {
    quoted(&shown(text))
}

/// What is in an attribute or between tags, to the letter.
pub(super) fn quoted(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
        .replace('\'', "&#39;")
}
