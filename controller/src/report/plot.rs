//! Curves and bars over anything but time.

use super::html::escape;
use super::scale::{Scale, extent, number};
use std::fmt::Write;

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 210.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = WIDTH - 12.0;
const TOP: f64 = 12.0;
const FOOT: f64 = HEIGHT - 30.0;

/// How values lie along an axis of a plot.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Along {
    Evenly,
    Decades,
}

impl Along {
    fn place(self, value: f64) -> f64 {
        match self {
            Self::Evenly => value,
            Self::Decades => value.max(f64::MIN_POSITIVE).log10(),
        }
    }

    /// Places of a scale worth a line, with their names.
    fn ticks(self, scale: &Scale, count: usize) -> Vec<(f64, String)> {
        if self == Self::Evenly {
            return scale.ticks(count);
        }
        let (from, to) = scale.domain;
        let decades = from.ceil() as i32..=to.floor() as i32;
        let every = decades.clone().count().div_ceil(count).max(1);
        let all = decades.step_by(every);
        all.map(|decade| (f64::from(decade), number(10f64.powi(decade))))
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
    let mut svg = frame(caption, (&x, along, x_unit), (&y, up, y_unit));
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
    figure(caption, &svg)
}

/// How many values lie where, with as many bars.
pub(super) fn bars(caption: &str, unit: &str, values: &[f64], count: usize) -> String {
    let finite = || values.iter().copied().filter(|it| it.is_finite());
    let Some((least, most)) = extent(finite()) else {
        return String::new();
    };
    let width = (most - least).max(1e-12) / count as f64;
    let mut heights = vec![0_u64; count];
    for value in finite() {
        heights[(((value - least) / width) as usize).min(count - 1)] += 1;
    }
    let tallest = heights.iter().copied().max().unwrap_or(1);
    let x = Scale::new((least, most.max(least + 1e-12)), (LEFT, RIGHT));
    let y = Scale::new((-0.3, (tallest as f64).log10().max(0.7)), (FOOT, TOP));
    let mut svg = frame(
        caption,
        (&x, Along::Evenly, unit),
        (&y, Along::Decades, "rows"),
    );
    let cell = (RIGHT - LEFT) / count as f64;
    for (n, height) in heights.iter().enumerate().filter(|(_, it)| **it > 0) {
        let top = y.at((*height as f64).log10());
        _ = write!(
            svg,
            "<rect class=bar x={:.1} y={top:.1} width={:.1} height={:.1} />",
            LEFT + n as f64 * cell,
            cell - 1.0,
            FOOT - top
        );
    }
    figure(caption, &svg)
}

fn frame(
    label: &str,
    (x, along, x_unit): (&Scale, Along, &str),
    (y, up, y_unit): (&Scale, Along, &str),
) -> String {
    let mut svg = format!(
        "<svg class=view viewBox='0 0 {WIDTH} {HEIGHT}' role=img aria-label='{}'>",
        escape(label)
    );
    for (tick, name) in up.ticks(y, 5) {
        let at = y.at(tick);
        _ = write!(
            svg,
            "<path class=grid d='M{LEFT} {at:.1}H{RIGHT}'/>\
             <text class=tick x={:.1} y={:.1} text-anchor=end>{name}</text>",
            LEFT - 6.0,
            at + 3.5
        );
    }
    for (tick, name) in along.ticks(x, 7) {
        let at = x.at(tick);
        _ = write!(
            svg,
            "<path class=grid d='M{at:.1} {TOP}V{FOOT}'/>\
             <text class=tick x={at:.1} y={:.1} text-anchor=middle>{name}</text>",
            FOOT + 14.0
        );
    }
    _ = write!(
        svg,
        "<text class=tick x={RIGHT:.1} y={:.1} text-anchor=end>{}</text>\
         <text class=tick x=4 y={:.1}>{}</text>",
        HEIGHT - 3.0,
        escape(x_unit),
        HEIGHT - 3.0,
        escape(y_unit)
    );
    svg
}

fn figure(caption: &str, svg: &str) -> String {
    format!(
        "<figure><figcaption>{}</figcaption>{svg}</svg></figure>",
        escape(caption)
    )
}
