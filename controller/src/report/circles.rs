//! The circular test, each turn with a picture as such tests have it: round the programmed circle, and the tool beside it with its
//! deviation magnified; that of the same turn in the other direction behind it.

use super::html::{self, escape, line_text, more};
use super::scale::{number, round_down};
use crate::observe::circles::CircleSummary;
use crate::observe::summary::Summary;
use std::f64::consts::TAU;
use std::fmt::Write;

const WIDTH: f64 = 260.0;
const HEIGHT: f64 = 200.0;
/// The programmed circle.
const RADIUS: f64 = 60.0;
/// What the greatest deviation becomes.
const MOST: f64 = 28.0;
/// A deviation of less, mm, is none: it is not magnified beyond that.
const LEAST: f64 = 1e-6;
/// Turns that are listed.
const LISTED: usize = 500;

/// All turns.
pub(super) fn section(lines: &[&str], summary: &Summary) -> String {
    let circles = &summary.circles;
    let pictured = circles.iter().filter(|it| !it.profile.is_empty());
    let cards: Vec<String> = pictured.map(|it| card(circles, lines, it)).collect();
    if cards.is_empty() {
        return String::new();
    }
    let mut content = html::cards(&cards, "More pictures");
    let rows = circles.iter().take(LISTED).map(|it| {
        format!(
            "<tr data-time='{:.6}' data-half={:.3} tabindex=0><td class=n>line {}<td>{}</tr>\n",
            0.5 * (it.at.time + it.until_s),
            0.5 * (it.until_s - it.at.time),
            it.at.line,
            escape(&it.to_string())
        )
    });
    _ = write!(
        content,
        "<div class='scroll tall'><table class=words>{}</table></div>",
        rows.collect::<String>()
    );
    let listed = circles.len().saturating_sub(LISTED) as u64;
    html::section(
        "Circular test",
        content + &more(listed + summary.circles_left_off),
    )
}

fn card(circles: &[CircleSummary], lines: &[&str], circle: &CircleSummary) -> String {
    let other = circle.both_ways.as_ref().and_then(|both| {
        let same =
            |it: &&CircleSummary| (it.at.time, it.at.line) == (both.with_time_s, both.with_line);
        circles.iter().find(same)
    });
    let [least, most] = circle.radial_deviation_mm.map(|it| number(1000.0 * it));
    let mut said = format!(
        "<b>{} µm</b> in line {} at {:.3} s<br>radial {least} to {most} µm · radius {} mm · {} mm/min",
        number(1000.0 * circle.circular_deviation_mm),
        circle.at.line,
        circle.at.time,
        number(circle.radius_mm),
        number(circle.speed_mm_min),
    );
    if let Some(both) = &circle.both_ways {
        _ = write!(
            said,
            "<br>hysteresis {} µm with line {}",
            number(1000.0 * both.hysteresis_mm),
            both.with_line
        );
    }
    format!(
        "<figure class=card data-time='{:.6}' data-half={:.3} tabindex=0>{}<figcaption>{said}<br><code>{}</code></figcaption></figure>\n",
        0.5 * (circle.at.time + circle.until_s),
        0.5 * (circle.until_s - circle.at.time),
        picture(circle, other),
        escape(line_text(lines, circle.at.line))
    )
}

/// The deviations round the circle, and those of the other direction.
fn picture(circle: &CircleSummary, other: Option<&CircleSummary>) -> String {
    let all = circle
        .profile
        .iter()
        .chain(other.iter().flat_map(|it| &it.profile));
    let most = all.map(|it| it.1.abs()).fold(LEAST, f64::max);
    let pixels = MOST / most;
    let (x, y) = (0.5 * WIDTH, 0.5 * HEIGHT);
    let mut svg = format!(
        "<svg viewBox='0 0 {WIDTH} {HEIGHT}' role=img aria-label='Deviation round the circle'>\
         <circle class=programmed cx={x} cy={y} r={RADIUS} />"
    );
    // A whole number of nanometres between two rings.
    let ring = 1e-6 * round_down(1e6 * most);
    for radius in [RADIUS - ring * pixels, RADIUS + ring * pixels] {
        _ = write!(svg, "<circle class=ring cx={x} cy={y} r={radius:.1} />");
    }
    if let Some(other) = other {
        svg += &deviations(&other.profile, pixels, "act");
    }
    svg += &deviations(&circle.profile, pixels, "set");
    let mut axes = circle.plane.chars();
    let [across, up] = [axes.next(), axes.next()].map(Option::unwrap_or_default);
    _ = write!(
        svg,
        "<text class=key-set x=6 y=16>{}</text>",
        circle.direction()
    );
    if let Some(other) = other {
        _ = write!(
            svg,
            "<text class=key-act x=6 y=30>{}</text>",
            other.direction()
        );
    }
    svg + &format!(
        "<text class=tick x={:.1} y={:.1}>{across}</text><text class=tick x={x} y=10 text-anchor=middle>{up}</text>\
         <text class=tick x=6 y={:.1}>rings {} µm</text></svg>",
        x + RADIUS + MOST + 8.0,
        y + 4.0,
        HEIGHT - 5.0,
        number(1000.0 * ring)
    )
}

/// The deviations of a tool round the circle, so many pixels for a mm of deviation.
fn deviations(profile: &[(f64, f64)], pixels: f64, class: &str) -> String {
    let mut d = String::new();
    let mut last = (f64::NAN, f64::NAN);
    for (n, (angle, off)) in profile.iter().enumerate() {
        let (sin, cos) = angle.rem_euclid(TAU).sin_cos();
        let radius = RADIUS + off * pixels;
        let at = (0.5 * WIDTH + radius * cos, 0.5 * HEIGHT - radius * sin);
        if (at.0 - last.0).hypot(at.1 - last.1) < 0.4 {
            continue;
        }
        let pen = if n == 0 { 'M' } else { 'L' };
        _ = write!(d, "{pen}{:.1} {:.1}", at.0, at.1);
        last = at;
    }
    format!("<path class='line {class}' d='{d}'/>")
}
