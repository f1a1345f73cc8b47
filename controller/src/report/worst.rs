//! The places where the tool was furthest from the programmed path, each with a picture of it: the path, and the tool
//! beside it with its error magnified.

use super::Report;
use super::html::{self, escape, line_text};
use super::scale::{extent, number, round_down};
use crate::observe::places::WorstPlace;
use crate::observe::summary::to_the_millionth;
use std::fmt::Write;

const WIDTH: f64 = 260.0;
const HEIGHT: f64 = 170.0;
const MARGIN: f64 = 16.0;
/// Before and behind a place, s.
const AROUND: f64 = 0.15;
/// What the greatest error becomes, of the picture's height.
const MAGNIFIED: f64 = 0.2;

/// A point of a picture.
type Point = (f64, f64);

/// All places, the first ones at once.
pub(super) fn cards(report: &Report, lines: &[&str], places: &[WorstPlace]) -> String {
    let cards: Vec<String> = places.iter().map(|it| card(report, lines, it)).collect();
    if cards.is_empty() {
        return String::new();
    }
    html::cards(&cards, &format!("All {} places", cards.len()))
}

fn card(report: &Report, lines: &[&str], place: &WorstPlace) -> String {
    let picture = picture(report, place.at.time).unwrap_or_default();
    let text = line_text(lines, place.at.line);
    format!(
        "<figure class=card data-time='{:.6}' data-half={AROUND} tabindex=0>{picture}\
         <figcaption><b>{} µm</b> in line {} at {:.3} s<br>of it rounding {} µm · feed {} mm/s\
         <br><code>{}</code></figcaption></figure>\n",
        place.at.time,
        number(1000.0 * place.contour_error_mm),
        place.at.line,
        place.at.time,
        // Of µm the picometre: what is less is none.
        number(to_the_millionth(1000.0 * place.rounding_mm)),
        number(place.feed_mm_s),
        escape(text)
    )
}

/// Pixels for each mm, so that the picture holds what goes from here to there across and up.
fn pixels(x: (f64, f64), y: (f64, f64)) -> f64 {
    ((WIDTH - 2.0 * MARGIN) / (x.1 - x.0).max(1e-3))
        .min((HEIGHT - 2.0 * MARGIN) / (y.1 - y.0).max(1e-3))
}

/// The path about an instant, seen along the axis in which it goes least far.
fn picture(report: &Report, time: f64) -> Option<String> {
    let from = report.time.partition_point(|it| *it < time - AROUND);
    let to = report.time.partition_point(|it| *it <= time + AROUND);
    let axis = |name: &str| report.axes.iter().find(|axis| axis.name == name);
    let axes = ["X", "Y", "Z"].map(axis);
    let rows: Vec<usize> = (from..to)
        .filter(|&n| {
            let off = report.off_path.get(n);
            off.is_some_and(|off| off.iter().all(|it| it.is_finite()))
        })
        .collect();
    // The programmed place is what the tool is off from.
    let programmed = |n: usize| -> [f64; 3] {
        let off = report.off_path[n];
        [0, 1, 2].map(|at| axes[at].map_or(0.0, |axis| axis.tool[n] - off[at]))
    };
    let points: Vec<[f64; 3]> = rows.iter().map(|&n| programmed(n)).collect();
    let size = |at: usize| {
        let seen = extent(points.iter().map(|it| it[at])).unwrap_or((0.0, 0.0));
        let off = extent(rows.iter().map(|&n| report.off_path[n][at])).unwrap_or((0.0, 0.0));
        // An axis along which there is an error is worth seeing, too.
        (seen.1 - seen.0).hypot(100.0 * (off.1 - off.0))
    };
    let least = (0..3).min_by(|&one, &other| size(one).total_cmp(&size(other)))?;
    let shown: Vec<usize> = (0..3).filter(|at| *at != least).collect();
    let [across, up] = [shown[0], shown[1]];
    let (x, y) = (
        extent(points.iter().map(|it| it[across]))?,
        extent(points.iter().map(|it| it[up]))?,
    );
    let most = rows.iter().map(|&n| {
        let off = report.off_path[n];
        off[across].hypot(off[up])
    });
    let most = most.fold(0.0, f64::max);
    // Where A, B and C turn alone there is no path to be seen, and nothing beside it.
    let stands = x.1 - x.0 == 0.0 && y.1 - y.0 == 0.0;
    if stands && most < 1e-9 {
        return None;
    }
    let times = round_down(MAGNIFIED * HEIGHT / (most.max(1e-9) * pixels(x, y)));
    // The picture has room for what is magnified, too.
    let besides: Vec<[f64; 2]> = (rows.iter().zip(&points))
        .map(|(&n, point)| [across, up].map(|axis| point[axis] + times * report.off_path[n][axis]))
        .collect();
    let (x, y) = (
        extent(besides.iter().map(|it| it[0]).chain([x.0, x.1]))?,
        extent(besides.iter().map(|it| it[1]).chain([y.0, y.1]))?,
    );
    let pixels = pixels(x, y);
    let at = |point: [f64; 2]| -> Point {
        (
            WIDTH / 2.0 + (point[0] - 0.5 * (x.0 + x.1)) * pixels,
            HEIGHT / 2.0 - (point[1] - 0.5 * (y.0 + y.1)) * pixels,
        )
    };
    let (mut path, mut tool, mut here) = (String::new(), String::new(), None);
    let mut nearest = f64::INFINITY;
    for ((&n, point), beside) in rows.iter().zip(&points).zip(besides) {
        let on = at([point[across], point[up]]);
        let beside = at(beside);
        let pen = if path.is_empty() { 'M' } else { 'L' };
        _ = write!(path, "{pen}{:.1} {:.1}", on.0, on.1);
        _ = write!(tool, "{pen}{:.1} {:.1}", beside.0, beside.1);
        let away = (report.time[n] - time).abs();
        if away < nearest {
            (nearest, here) = (away, Some((on, beside)));
        }
    }
    let (on, beside) = here?;
    let names = ["X", "Y", "Z"];
    Some(format!(
        "<svg viewBox='0 0 {WIDTH} {HEIGHT}' role=img aria-label='Tool and path'>\
         <path class=programmed d='{path}'/><path class='line act' d='{tool}'/>\
         <path class=error d='M{:.1} {:.1}L{:.1} {:.1}'/>\
         <text class=tick x=6 y={:.1}>{}{}, error × {}</text></svg>",
        on.0,
        on.1,
        beside.0,
        beside.1,
        HEIGHT - 5.0,
        names[across],
        names[up],
        number(times)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::AxisReport;
    use proptest::prelude::*;

    proptest! {
        /// Path, tool and error are within the picture, however large the errors are beside the path, and to whichever side.
        #[test]
        fn what_is_magnified_is_within_the_picture(
            places in prop::collection::vec(([-50.0..50.0_f64, -50.0..50.0, -50.0..50.0], [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0]), 2..40),
            flat in 0..4_usize,
            decade in -6.0..1.0_f64,
        ) {
            let error = 10f64.powf(decade);
            let mut report = Report {
                axes: ["X", "Y", "Z"].map(|name| AxisReport { name: name.into(), ..AxisReport::default() }).into(),
                ..Report::default()
            };
            for (n, (mut place, off)) in places.iter().copied().enumerate() {
                // A line along an axis.
                if flat < 3 {
                    for at in (0..3).filter(|at| *at != flat) {
                        place[at] = 1.0;
                    }
                }
                for (at, axis) in report.axes.iter_mut().enumerate() {
                    axis.tool.push(place[at] + error * off[at]);
                }
                report.off_path.push(off.map(|it| error * it));
                report.time.push(0.002 * n as f64);
            }
            let picture = picture(&report, 0.03).unwrap();
            let drawn = picture.split("d='").skip(1).filter_map(|it| it.split_once('\''));
            let mut points = 0;
            for (path, _) in drawn {
                for point in path.split(['M', 'L']).skip(1) {
                    let (x, y) = point.split_once(' ').unwrap();
                    let (x, y): (f64, f64) = (x.parse().unwrap(), y.parse().unwrap());
                    prop_assert!((MARGIN - 0.1..=WIDTH - MARGIN + 0.1).contains(&x), "{x}: {picture}");
                    prop_assert!((MARGIN - 0.1..=HEIGHT - MARGIN + 0.1).contains(&y), "{y}: {picture}");
                    points += 1;
                }
            }
            prop_assert_eq!(points, 2 * places.len() + 2);
        }
    }
}
