//! Values over time: strips of equal width under each other, with one time axis.

use super::{
    html::escape,
    scale::{Scale, extent},
};
use std::fmt::Write;

const WIDTH: f64 = 1120.0;
const LEFT: f64 = 78.0;
const RIGHT: f64 = 12.0;
const STRIP: f64 = 96.0;
const GAP: f64 = 24.0;
/// Width of a letter of a label at most.
const LETTER: f64 = 6.5;

/// One line of a strip.
pub(super) struct Line<'a> {
    /// CSS class: its colour.
    pub(super) class: &'static str,
    /// Its name, where a strip has several.
    pub(super) name: &'static str,
    pub(super) values: &'a [f64],
    /// Held from one value to the next instead of joined by a slope.
    pub(super) stepped: bool,
}

/// One quantity over time.
pub(super) struct Strip<'a> {
    pub(super) title: &'a str,
    pub(super) unit: &'a str,
    /// What stands at its right end: greatest value, limit.
    pub(super) note: String,
    pub(super) lines: Vec<Line<'a>>,
    /// Values not to be exceeded. Drawn where the data come near them.
    pub(super) limits: Vec<f64>,
}

/// A moment worth a mark on every strip.
pub(super) struct Mark {
    pub(super) time: f64,
    pub(super) text: String,
}

/// An SVG of all strips; an empty text where there is nothing to show.
pub(super) fn strips(label: &str, time: &[f64], strips: &[Strip<'_>], marks: &[Mark]) -> String {
    let Some(span) = extent(time.iter().copied()) else {
        return String::new();
    };
    let x = Scale::new(span, (LEFT, WIDTH - RIGHT));
    let height = strips.len() as f64 * (STRIP + GAP) + 26.0;
    let mut svg = format!(
        "<svg class=chart viewBox='0 0 {WIDTH} {height:.0}' role=img aria-label='{}'>",
        escape(label)
    );
    for (n, strip) in strips.iter().enumerate() {
        let top = n as f64 * (STRIP + GAP) + GAP - 6.0;
        draw(&mut svg, strip, time, x, top, marks);
    }
    let foot = height - 26.0;
    for (tick, label) in x.ticks(10) {
        let half = (label.chars().count() + 2) as f64 * LETTER / 2.0;
        _ = write!(
            svg,
            "<text class=tick x={:.1} y={:.1} text-anchor=middle>{label} s</text>",
            x.at(tick).min(WIDTH - half),
            foot + 16.0,
        );
    }
    svg + "</svg>"
}

fn draw(svg: &mut String, strip: &Strip<'_>, time: &[f64], x: Scale, top: f64, marks: &[Mark]) {
    let data = extent(strip.lines.iter().flat_map(|line| line.values).copied());
    let (least, most) = data.unwrap_or((0.0, 0.0));
    // A limit far outside would flatten the data; its value stands in the note.
    let reach = least.abs().max(most.abs());
    let near: Vec<f64> = strip
        .limits
        .iter()
        .copied()
        .filter(|limit| limit.abs() <= reach * 4.0)
        .collect();
    let all = near.iter().copied().chain([least, most]);
    let (least, most) = extent(all).unwrap_or((0.0, 1.0));
    let margin = (most - least) * 0.07;
    let y = Scale::new((least - margin, most + margin), (top + STRIP, top));

    let (x0, x1) = x.range;
    let keys: String = strip
        .lines
        .iter()
        .filter(|line| !line.name.is_empty())
        .map(|line| {
            format!(
                "<tspan class=key-{} dx=10>{}</tspan>",
                line.class, line.name
            )
        })
        .collect();
    _ = write!(
        svg,
        "<text class=name x={x0} y={:.1}>{} <tspan class=unit>{}</tspan>{keys}</text>\
         <text class=note x={x1} y={:.1} text-anchor=end>{}</text>\
         <rect class=frame x={x0} y={top} width={:.1} height={STRIP} />",
        top - 5.0,
        escape(strip.title),
        escape(strip.unit),
        top - 5.0,
        escape(&strip.note),
        x1 - x0,
    );
    for (tick, label) in y.ticks(4) {
        let at = y.at(tick);
        let class = if tick == 0.0 { "zero" } else { "grid" };
        _ = write!(
            svg,
            "<path class={class} d='M{x0} {at:.1}H{x1}'/>\
             <text class=tick x={:.1} y={:.1} text-anchor=end>{label}</text>",
            x0 - 6.0,
            at + 3.5,
        );
    }
    for (tick, _) in x.ticks(10) {
        _ = write!(
            svg,
            "<path class=grid d='M{:.1} {top}v{STRIP}'/>",
            x.at(tick)
        );
    }
    for limit in near {
        _ = write!(svg, "<path class=limit d='M{x0} {:.1}H{x1}'/>", y.at(limit));
    }
    for mark in marks.iter().filter(|mark| mark.time.is_finite()) {
        _ = write!(
            svg,
            "<path class=mark d='M{:.1} {top}v{STRIP}'><title>{}</title></path>",
            x.at(mark.time.clamp(x.domain.0, x.domain.1)),
            escape(&mark.text)
        );
    }
    for line in &strip.lines {
        let columns = (x1 - x0) as usize;
        let points = decimate(time, line.values, x.domain, columns);
        let mut place = None;
        let mut d = String::new();
        for (t, value) in points {
            let (px, py) = (x.at(t), y.at(value));
            if place.is_none() {
                _ = write!(d, "M{px:.1} {py:.1}");
            } else if line.stepped {
                _ = write!(d, "H{px:.1}V{py:.1}");
            } else {
                _ = write!(d, "L{px:.1} {py:.1}");
            }
            place = Some(px);
        }
        // The last value holds to the end; a single value is a dot.
        if line.values.len() == 1 {
            d += "h3";
        }
        _ = write!(svg, "<path class='line {}' d='{d}'/>", line.class);
    }
}

/// At most four points for each column of pixels, first, least, greatest and last, in their
/// order: what a screen can show, and no peak lost.
fn decimate(time: &[f64], values: &[f64], span: (f64, f64), columns: usize) -> Vec<(f64, f64)> {
    let width = (span.1 - span.0) / columns.max(1) as f64;
    let column = |t: f64| ((t - span.0) / width) as usize;
    let points: Vec<(f64, f64)> = time
        .iter()
        .copied()
        .zip(values.iter().copied())
        .filter(|(t, value)| t.is_finite() && value.is_finite())
        .collect();
    points
        .chunk_by(|a, b| column(a.0) == column(b.0))
        .flat_map(|chunk| {
            let by_value = |a: &usize, b: &usize| chunk[*a].1.total_cmp(&chunk[*b].1);
            let least = (0..chunk.len()).min_by(by_value).unwrap_or(0);
            let most = (0..chunk.len()).max_by(by_value).unwrap_or(0);
            let mut kept = [0, least, most, chunk.len() - 1];
            kept.sort_unstable();
            let mut kept = kept.to_vec();
            kept.dedup();
            kept.into_iter().map(|n| chunk[n]).collect::<Vec<_>>()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn decimation_keeps_ends_and_peaks(
            values in prop::collection::vec(-1e6..1e6f64, 1..3000), columns in 1usize..300,
        ) {
            let time: Vec<f64> = (0..values.len()).map(|n| n as f64 * 0.002).collect();
            let span = (0.0, time[time.len() - 1].max(1e-3));
            let points = decimate(&time, &values, span, columns);
            prop_assert!(points.len() <= 4 * (columns + 1));
            prop_assert_eq!(points[0], (time[0], values[0]));
            prop_assert_eq!(points[points.len() - 1].1, values[values.len() - 1]);
            prop_assert_eq!(extent(points.iter().map(|p| p.1)), extent(values.iter().copied()));
            prop_assert!(points.is_sorted_by(|a, b| a.0 < b.0));
        }
    }
}
