//! Curves and bars over anything but time.

use super::html::escape;
use super::scale::{Scale, count, extent, number};
use std::fmt::Write;

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 210.0;
const LEFT: f64 = 76.0;
const RIGHT: f64 = WIDTH - 12.0;
const TOP: f64 = 12.0;
const FOOT: f64 = HEIGHT - 30.0;
/// Bars of a histogram.
pub(super) const BARS: usize = 64;

/// How values lie along an axis of a plot.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Along {
    Evenly,
    Decades,
}

impl Along {
    pub(super) fn place(self, value: f64) -> f64 {
        match self {
            Self::Evenly => value,
            Self::Decades => value.max(f64::MIN_POSITIVE).log10(),
        }
    }

    /// Places of a scale worth a line, so many at most, with their names.
    fn ticks(self, scale: &Scale, most: usize) -> Vec<(f64, String)> {
        if self == Self::Evenly {
            return scale.ticks(most);
        }
        let (from, to) = scale.domain;
        let all: Vec<(f64, String)> = (from.floor() as i32..=to.ceil() as i32)
            .flat_map(|decade| [1.0, 2.0, 5.0].map(|n| n * 10f64.powi(decade)))
            .map(|tick| (tick.log10(), number(tick)))
            .filter(|(at, _)| (from..=to).contains(at))
            .collect();
        // Whole decades rather than any others.
        let every = match all.len() > most {
            true => 3 * (all.len() / 3).div_ceil(most).max(1),
            false => 1,
        };
        let first = all
            .iter()
            .position(|(at, _)| every == 1 || at.fract().abs() < 1e-9);
        all.into_iter()
            .skip(first.unwrap_or(0))
            .step_by(every)
            .collect()
    }
}

/// A curve.
pub(super) struct Curve<'a> {
    /// CSS class: its colour.
    pub(super) class: &'static str,
    pub(super) name: &'a str,
    pub(super) points: &'a [(f64, f64)],
}

/// A plot with its caption; nothing where there is no finite point.
pub(super) fn curves(
    caption: &str,
    (x_unit, y_unit): (&str, &str),
    (along, up): (Along, Along),
    curves: &[Curve<'_>],
) -> String {
    let finite = |it: &&(f64, f64)| it.0.is_finite() && it.1.is_finite();
    let points = || curves.iter().flat_map(|it| it.points).filter(finite);
    let (Some(across), Some(reach)) = (
        extent(points().map(|it| along.place(it.0))),
        extent(points().map(|it| up.place(it.1))),
    ) else {
        return String::new();
    };
    let margin = 0.05 * (reach.1 - reach.0).max(1e-9);
    let x = Scale::new(across, (LEFT, RIGHT));
    let y = Scale::new((reach.0 - margin, reach.1 + margin), (FOOT, TOP));
    let mut svg = frame(caption, &y, &up.ticks(&y, 5), y_unit);
    for (tick, _) in along.ticks(&x, 7) {
        _ = write!(
            svg,
            "<path class=grid d='M{:.1} {TOP}V{FOOT}'/>",
            x.at(tick)
        );
    }
    for (n, curve) in curves.iter().enumerate() {
        let mut d = String::new();
        let mut last = (f64::NAN, f64::NAN);
        for point in curve.points.iter().filter(finite) {
            let at = (x.at(along.place(point.0)), y.at(up.place(point.1)));
            if (at.0 - last.0).abs() < 0.4 && (at.1 - last.1).abs() < 0.4 {
                continue;
            }
            let pen = if d.is_empty() { 'M' } else { 'L' };
            _ = write!(d, "{pen}{:.1} {:.1}", at.0, at.1);
            last = at;
        }
        _ = write!(svg, "<path class='line {}' d='{d}'/>", curve.class);
        if !curve.name.is_empty() {
            _ = write!(
                svg,
                "<text class=key-{} x={:.1} y={:.1} text-anchor=end>{}</text>",
                curve.class,
                RIGHT - 6.0,
                TOP + 14.0 + 14.0 * n as f64,
                escape(curve.name)
            );
        }
    }
    foot(&mut svg, &x, along, x_unit);
    figure(caption, &(svg + "</svg>"))
}

/// How many values lie where, by as many bars of equal width from one end of a range of places to the other.
pub(super) fn bars(
    caption: &str,
    unit: &str,
    along: Along,
    range: (f64, f64),
    heights: &[u64],
) -> String {
    let tallest = heights.iter().copied().max().unwrap_or(1).max(1) as f64;
    let x = Scale::new(range, (LEFT, RIGHT));
    let y = Scale::new((-0.3, tallest.log10().max(0.7)), (FOOT, TOP));
    let decades = 0..=tallest.log10() as u32;
    let decades: Vec<_> = decades
        .map(|decade| (f64::from(decade), count(10u64.pow(decade))))
        .collect();
    let mut svg = frame(caption, &y, &decades, "");
    let cell = (RIGHT - LEFT) / heights.len() as f64;
    for (n, height) in heights.iter().enumerate().filter(|(_, it)| **it > 0) {
        let top = y.at((*height as f64).log10());
        _ = write!(
            svg,
            "<rect class=bar x={:.1} y={top:.1} width={:.1} height={:.1}><title>{}</title></rect>",
            LEFT + n as f64 * cell,
            cell - 1.0,
            FOOT - top,
            count(*height)
        );
    }
    foot(&mut svg, &x, along, unit);
    svg + "</svg>"
}

/// The same of values, evenly.
pub(super) fn histogram(caption: &str, unit: &str, values: &[f64]) -> String {
    let finite = || values.iter().copied().filter(|it| it.is_finite());
    let Some((least, most)) = extent(finite()) else {
        return String::new();
    };
    let width = (most - least).max(1e-12) / BARS as f64;
    let mut heights = [0_u64; BARS];
    for value in finite() {
        heights[(((value - least) / width) as usize).min(BARS - 1)] += 1;
    }
    let range = (least, most.max(least + 1e-12));
    figure(
        caption,
        &bars(caption, unit, Along::Evenly, range, &heights),
    )
}

/// The beginning of a plot, with lines at some heights and their names.
fn frame(label: &str, y: &Scale, ticks: &[(f64, String)], unit: &str) -> String {
    let mut svg = format!(
        "<svg class=view viewBox='0 0 {WIDTH} {HEIGHT}' role=img aria-label='{}'>",
        escape(label)
    );
    for (tick, name) in ticks {
        let at = y.at(*tick);
        _ = write!(
            svg,
            "<path class=grid d='M{LEFT} {at:.1}H{RIGHT:.1}'/>\
             <text class=tick x={:.1} y={:.1} text-anchor=end>{name}</text>",
            LEFT - 6.0,
            at + 3.5
        );
    }
    if !unit.is_empty() {
        let (foot, unit) = (HEIGHT - 1.0, escape(unit));
        _ = write!(svg, "<text class=tick x=4 y={foot:.1}>{unit}</text>");
    }
    svg
}

/// Names along its foot.
fn foot(svg: &mut String, x: &Scale, along: Along, unit: &str) {
    for (tick, name) in along.ticks(x, 9) {
        _ = write!(
            svg,
            "<text class=tick x={:.1} y={:.1} text-anchor=middle>{name}</text>",
            x.at(tick),
            FOOT + 16.0
        );
    }
    _ = write!(
        svg,
        "<text class=tick x={RIGHT:.1} y={:.1} text-anchor=end>{}</text>",
        HEIGHT - 1.0,
        escape(unit)
    );
}

fn figure(caption: &str, svg: &str) -> String {
    format!(
        "<figure><figcaption>{}</figcaption>{svg}</figure>",
        escape(caption)
    )
}
