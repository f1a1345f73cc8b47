//! What a run came to, in tables: what bounded its time, its tools, drives and gantries, and where it is from.

use super::html::{escape, line, line_text, more, section};
use super::plot::{self, Along, Curve};
use super::scale::number;
use crate::observe::loops::{Gain, Response};
use crate::observe::summary::Summary;
use crate::observe::switched::coolant_name;
use std::fmt::Write;

/// Shares of the time, as a bar and in words.
pub(super) fn bounds(summary: &Summary) -> String {
    let Some(bounds) = &summary.time_bounds else {
        return String::new();
    };
    let mut bar = String::new();
    let mut rows = String::new();
    for (n, bound) in bounds.bounds.iter().enumerate() {
        let name = match bound.axis {
            Some(axis) => format!("{} of {axis}", bound.what),
            None => bound.what.to_owned(),
        };
        let class = format!("share-{}", n % 8);
        let percent = 100.0 * bound.share;
        if percent > 0.05 {
            _ = write!(
                bar,
                "<div class={class} style='flex:{percent:.2}' title='{}'></div>",
                escape(&name)
            );
        }
        _ = writeln!(
            rows,
            "<tr><td><i class={class}></i>{}<td class=n>{percent:.1} %<td class=n>{:.3} s</tr>",
            escape(&name),
            bound.saves_s
        );
    }
    section(
        "What bounds the time",
        format!(
            "<div class=shares>{bar}</div><div class=scroll><table><tr><th>Bound<th class=n>Share\
             <th class=n>Saved with 5 % more of it alone</tr>\n{rows}</table></div>"
        ),
    )
}

/// Tools and operations.
pub(super) fn tools(summary: &Summary) -> String {
    if summary.operations.is_empty() {
        return String::new();
    }
    let mut html = String::from(
        "<div class=scroll><table><tr><th class=n>Tool<th class=n>Motion<th class=n>At a feed</tr>\n",
    );
    for tool in &summary.tools {
        _ = writeln!(
            html,
            "<tr><td class=n>{}<td class=n>{:.3} s<td class=n>{:.3} s</tr>",
            tool.tool, tool.motion_s, tool.feed_s
        );
    }
    html += "</table></div><div class=scroll><table><tr><th class=n>From line<th class=n>At\
             <th class=n>Tool<th class=n>Spindle<th class=n>Motion<th class=n>At a feed</tr>\n";
    for operation in &summary.operations {
        _ = writeln!(
            html,
            "<tr data-time='{:.6}' data-half={:.3} tabindex=0><td class=n>{}<td class=n>{:.3} s<td class=n>{}\
             <td class=n>{} 1/min<td class=n>{:.3} s<td class=n>{:.3} s</tr>",
            operation.time_s + 0.5 * operation.motion_s,
            0.5 * operation.motion_s,
            line(operation.line),
            operation.time_s,
            operation.tool,
            operation.spindle,
            operation.motion_s,
            operation.feed_s
        );
    }
    html += "</table></div>";
    section(
        "Tools and operations",
        html + &more(summary.operations_left_off),
    )
}

/// What M-codes switched.
pub(super) fn outputs(summary: &Summary) -> String {
    if summary.switched.is_empty() {
        return String::new();
    }
    let mut html = String::from(
        "<div class=scroll><table><tr><th class=n>At<th class=n>Line<th class=n>Tool<th class=n>Spindle\
         <th>Coolant<th>Digital outputs on<th>Analog outputs</tr>\n",
    );
    for state in &summary.switched {
        let coolant = coolant_name(state.coolant);
        let digital: Vec<String> = state
            .digital_outputs
            .iter()
            .map(|it| format!("P{it}"))
            .collect();
        let analog = state.analog_outputs.iter().enumerate();
        let analog: Vec<String> = analog
            .filter(|(_, value)| **value != 0.0)
            .map(|(n, value)| format!("E{n} {}", number(*value)))
            .collect();
        let told = |all: &[String]| match all {
            [] => "–".to_owned(),
            all => all.join(", "),
        };
        _ = writeln!(
            html,
            "<tr data-time='{:.6}' tabindex=0><td class=n>{:.3} s<td class=n>{}<td class=n>{}<td class=n>{} 1/min\
             <td>{coolant}<td>{}<td>{}</tr>",
            state.time,
            state.time,
            line(state.line),
            state.tool,
            state.spindle,
            told(&digital),
            told(&analog)
        );
    }
    html += "</table></div>";
    section("Outputs", html + &more(summary.switched_left_off))
}

/// Drives and gantries, as they truly were.
pub(super) fn drives(summary: &Summary) -> String {
    let mut rows = String::new();
    for drive in &summary.drives {
        _ = writeln!(
            rows,
            "<tr><th>{}<td>{}</tr>",
            escape(&drive.name),
            escape(&drive.to_string())
        );
    }
    for gantry in &summary.gantries {
        _ = writeln!(
            rows,
            "<tr><th>gantry {}<td>{}</tr>",
            gantry.axis,
            escape(&gantry.to_string())
        );
    }
    if let Some(cutting) = &summary.cutting {
        _ = writeln!(
            rows,
            "<tr><th>cutting<td>{}</tr>",
            escape(&cutting.to_string())
        );
    }
    match rows.is_empty() {
        true => rows,
        false => section(
            "Drives",
            format!("<div class=scroll><table class=words>{rows}</table></div>"),
        ),
    }
}

/// How far loads were from where their motors say.
pub(super) fn transmissions(summary: &Summary) -> String {
    let rows = summary.transmissions.iter();
    let rows: String = rows
        .map(|it| {
            let said = escape(&it.to_string());
            format!("<tr><th>{}<td>{said}</tr>\n", it.axis)
        })
        .collect();
    match rows.is_empty() {
        true => rows,
        false => section(
            "Transmissions",
            format!("<div class=scroll><table class=words>{rows}</table></div>"),
        ),
    }
}

/// How the structure swayed, and how far a force at the tool bends it.
pub(super) fn structure(summary: &Summary) -> String {
    let mut rows = String::new();
    let mut plots = String::new();
    for it in &summary.structures {
        _ = writeln!(
            rows,
            "<tr><th>{}<td>{}</tr>",
            it.axis,
            escape(&it.to_string())
        );
        let points = it.response.iter().map(|at| (at.frequency, at.um_per_n));
        let points: Vec<_> = points.collect();
        plots += &plot::curves(
            &format!("Compliance along {}", it.axis),
            ("Hz", "µm/N"),
            (Along::Decades, Along::Decades),
            &[Curve {
                class: "act",
                name: "",
                points: &points,
            }],
        );
    }
    match rows.is_empty() {
        true => rows,
        false => section(
            "Structure",
            format!(
                "<div class=scroll><table class=words>{rows}</table></div><div class=pair>{plots}</div>"
            ),
        ),
    }
}

/// The loops of the drives, with their open loops over frequency.
pub(super) fn loops(summary: &Summary) -> String {
    let mut rows = String::new();
    let mut plots = String::new();
    for it in &summary.loops {
        _ = writeln!(
            rows,
            "<tr><th>{}<td>{}</tr>",
            escape(&it.drive),
            escape(&it.to_string())
        );
        let points = |of: &dyn Fn(&Response) -> Option<f64>| -> Vec<(f64, f64)> {
            let told = it.response.iter();
            told.filter_map(|at| Some((at.frequency, of(at)?)))
                .collect()
        };
        let plot = |what: &str, unit, of: fn(&Gain) -> f64| {
            let speed = points(&|at| Some(of(&at.speed)));
            let position = points(&|at| at.position.as_ref().map(of));
            plot::curves(
                &format!("Open loops of {}, {what}", it.drive),
                ("Hz", unit),
                (Along::Decades, Along::Evenly),
                &[
                    Curve {
                        class: "set",
                        name: "speed",
                        points: &speed,
                    },
                    Curve {
                        class: "act",
                        name: "position",
                        points: &position,
                    },
                ],
            )
        };
        plots += &plot("gain", "dB", |it| it.decibels);
        plots += &plot("phase", "°", |it| it.phase);
    }
    match rows.is_empty() {
        true => rows,
        false => section(
            "Loops",
            format!(
                "<div class=scroll><table class=words>{rows}</table></div>\
                 <details><summary>Their responses</summary><div class=pair>{plots}</div></details>"
            ),
        ),
    }
}

/// The blocks that lost most time.
pub(super) fn slowest(summary: &Summary, lines: &[&str]) -> String {
    if summary.slowest_places.is_empty() {
        return String::new();
    }
    let mut html = String::from(
        "<div class='scroll tall'><table><tr><th class=n>Line<th class=n>From<th class=n>At a feed for\
         <th class=n>Lost<th>Block</tr>\n",
    );
    for place in &summary.slowest_places {
        _ = writeln!(
            html,
            "<tr data-time='{:.6}' data-half={:.3} tabindex=0><td class=n>{}<td class=n>{:.3} s<td class=n>{:.3} s\
             <td class=n>{:.3} s<td><code>{}</code></tr>",
            place.at.time + 0.5 * place.feed_s,
            0.5 * place.feed_s + 0.05,
            line(place.at.line),
            place.at.time,
            place.feed_s,
            place.lost_s,
            escape(line_text(lines, place.at.line))
        );
    }
    section("Slower than their feed", html + "</table></div>")
}

/// The lines that cut with the greatest force.
pub(super) fn hardest(summary: &Summary, lines: &[&str]) -> String {
    let hardest = summary.cutting.iter().flat_map(|it| &it.hardest_lines);
    let rows: String = hardest
        .map(|it| {
            format!(
                "<tr data-time='{:.6}' data-half=0.1 tabindex=0><td class=n>{}<td class=n>{:.3} s<td class=n>{} N\
                 <td class=n>{} N<td class=n>{} µm<td><code>{}</code></tr>\n",
                it.at.time,
                line(it.at.line),
                it.at.time,
                number(it.max_force_n),
                number(it.rms_force_n),
                number(1000.0 * it.max_deflection_mm),
                escape(line_text(lines, it.at.line))
            )
        })
        .collect();
    match rows.is_empty() {
        true => rows,
        false => section(
            "Hardest cuts",
            format!(
                "<div class='scroll tall'><table><tr><th class=n>Line<th class=n>At<th class=n>Force<th class=n>RMS\
                 <th class=n>Deflection<th>Block</tr>\n{rows}</table></div>"
            ),
        ),
    }
}

/// Where the result is from.
pub(super) fn about(summary: &Summary) -> String {
    let mut facts: Vec<(&str, String)> = Vec::new();
    if let Some(it) = &summary.provenance {
        facts.push(("again", it.command.clone()));
        facts.push(("date", it.date.clone()));
        facts.push(("version", it.version.to_owned()));
        facts.push(("host", it.host.clone()));
        facts.push(("cycle", format!("{} ms", number(1000.0 * it.cycle_s))));
        facts.push(("machine file, SHA-256", it.machine_sha256.clone()));
        for of in &it.descriptions {
            let told = format!("{} of {}", of.sha256, of.file);
            facts.push(("description, SHA-256", told));
        }
        let program = it.program_sha256.clone();
        facts.extend(program.map(|it| ("program, SHA-256", it)));
    }
    facts.extend(summary.seed.map(|it| ("seed", it.to_string())));
    let frames = summary.frames_sha256.clone();
    facts.extend(frames.map(|it| ("frames, SHA-256", it)));
    if facts.is_empty() {
        return String::new();
    }
    let rows: String = facts
        .iter()
        .map(|(name, value)| format!("<tr><th>{name}<td><code>{}</code></tr>\n", escape(value)))
        .collect();
    section(
        "About this run",
        format!("<div class=scroll><table class=words>{rows}</table></div>"),
    )
}
