//! The tool's path: from above, and in parallel projection from the front right; as it was commanded, with its feed, and as it was
//! gone, with the contour error magnified.

use super::{
    Report,
    scale::{Scale, extent, number, round_down},
};
use std::fmt::Write;

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 470.0;
const MARGIN: f64 = 56.0;
/// Width of a letter of a label at most, also in the larger ones of narrow pages.
const LETTER: f64 = 8.5;
/// What is so much less than the rest is an encoder's noise, and not told.
const NOISE: f64 = 1e-3;
/// Points nearer than this to the last one drawn are left out, in tenths of pixels; twice as far, and so on, where the
/// path of a view would be longer than that, in bytes.
const RESOLUTION: i32 = 4;
const LONGEST: usize = 400_000;

/// Slow to fast, readable on white and on black.
const RAMP: [(u8, u8, u8); 5] = [
    (59, 110, 246),
    (16, 170, 160),
    (118, 184, 30),
    (240, 150, 16),
    (228, 52, 72),
];
const SHADES: usize = 32;
/// Room around what is shown, of its size.
const MARGIN_AROUND: f64 = 0.08;
/// What all but one in a thousand of the contour errors become at most, of the picture's size.
const MAGNIFIED: f64 = 0.04;

/// A position in machine coordinates, mm.
type Point = [f64; 3];

/// Least and greatest coordinate of each axis.
pub(super) type Extents = [(f64, f64); 3];

/// A path with a quantity at each point, which its colours show.
pub(super) struct ToolPath {
    points: Vec<Point>,
    values: Vec<f64>,
    cutting: Vec<bool>,
    /// The value of the last colour: the greatest in a cut, or without one that of all.
    scale: f64,
    greatest: f64,
    /// The quantity, with its unit.
    quantity: &'static str,
    /// What it goes beside, drawn below it.
    programmed: Vec<Point>,
}

impl ToolPath {
    /// The commanded path; `None` with no axis that is X, Y or Z, or with no finite point.
    pub(super) fn new(report: &Report) -> Option<Self> {
        let axis = |name: &str| report.axes.iter().find(|axis| axis.name == name);
        let axes = [axis("X"), axis("Y"), axis("Z")];
        axes.iter().flatten().next()?;
        let (mut points, mut values, mut cutting) = (Vec::new(), Vec::new(), Vec::new());
        for n in 0..report.time.len() {
            let point = axes.map(|axis| axis.map_or(Some(0.0), |axis| axis.set.get(n).copied()));
            if let [Some(x), Some(y), Some(z)] = point
                && x.is_finite()
                && y.is_finite()
                && z.is_finite()
            {
                points.push([x, y, z]);
                let feed = report.feed.get(n).copied().unwrap_or(0.0);
                values.push(if feed.is_finite() { feed } else { 0.0 });
                cutting.push(report.cutting.get(n).copied().unwrap_or(false));
            }
        }
        (!points.is_empty()).then(|| Self::coloured(points, values, cutting, "feed, mm/s"))
    }

    /// The path that the tool went, so many times as far beside the programmed one as it was, which is chosen for a picture of
    /// these extents; `None` where it was nowhere beside it.
    pub(super) fn magnified(report: &Report, extents: &Extents) -> Option<(Self, f64)> {
        let axis = |name: &str| report.axes.iter().find(|axis| axis.name == name);
        let axes = ["X", "Y", "Z"].map(axis);
        let size = |off: &Point| (off[0] * off[0] + off[1] * off[1] + off[2] * off[2]).sqrt();
        let rows: Vec<usize> = (0..report.off_path.len())
            .filter(|&n| size(&report.off_path[n]).is_finite())
            .collect();
        let mut errors: Vec<f64> = rows.iter().map(|&n| size(&report.off_path[n])).collect();
        let values = errors.iter().map(|error| 1000.0 * error).collect();
        let last = errors.len().checked_sub(1)?;
        let (_, most, _) = errors.select_nth_unstable_by(last - last / 1000, f64::total_cmp);
        let wide = extents.iter().map(|(least, most)| most - least);
        let times = round_down(MAGNIFIED * wide.fold(0.0, f64::max) / most.max(1e-9));
        let beside = |n: usize, times: f64| -> Point {
            let off = report.off_path[n];
            [0, 1, 2].map(|at| axes[at].map_or(0.0, |axis| axis.tool[n] + (times - 1.0) * off[at]))
        };
        let points = rows.iter().map(|&n| beside(n, times)).collect();
        let cutting = rows.iter().map(|&n| report.cutting.get(n) == Some(&true));
        let tool = Self::coloured(points, values, cutting.collect(), "contour error, µm");
        let programmed = rows.iter().map(|&n| beside(n, 0.0)).collect();
        (tool.greatest > 0.0).then_some((Self { programmed, ..tool }, times))
    }

    fn coloured(
        points: Vec<Point>,
        values: Vec<f64>,
        cutting: Vec<bool>,
        quantity: &'static str,
    ) -> Self {
        let greatest = values.iter().copied().fold(0.0, f64::max);
        let cuts = values.iter().zip(&cutting).filter(|(_, cutting)| **cutting);
        let in_cuts = cuts.map(|(value, _)| *value).fold(0.0, f64::max);
        Self {
            scale: if in_cuts > 0.0 { in_cuts } else { greatest },
            points,
            values,
            cutting,
            greatest,
            quantity,
            programmed: Vec::new(),
        }
    }

    /// Where it goes.
    pub(super) fn whole(&self) -> Extents {
        extents(self.points.iter())
    }

    /// The same with a margin.
    pub(super) fn padded(&self) -> Extents {
        let whole = self.whole();
        let wide = whole.iter().map(|(least, most)| most - least);
        let margin = wide.fold(0.0, f64::max) * MARGIN_AROUND;
        whole.map(|(least, most)| (least - margin, most + margin))
    }

    /// Where the tool works, with a margin, if that is but a small part of the whole.
    pub(super) fn work(&self) -> Option<Extents> {
        let points = self.points.iter().zip(&self.cutting);
        let work = extents(
            points
                .filter(|(_, cutting)| **cutting)
                .map(|(point, _)| point),
        );
        let size = |extents: &Extents| {
            let [x, y, _] = extents;
            (x.1 - x.0).max(y.1 - y.0)
        };
        let margin = size(&work) * MARGIN_AROUND;
        let padded = work.map(|(least, most)| (least - margin, most + margin));
        (margin > 0.0 && size(&self.whole()) > 1.5 * size(&padded)).then_some(padded)
    }

    fn shade(&self, value: f64) -> usize {
        if self.scale > 0.0 {
            ((value / self.scale * SHADES as f64) as usize).min(SHADES - 1)
        } else {
            0
        }
    }

    /// The path as `project` places it: one SVG path of all stretches of a shade, those of small values
    /// above; rapids thinner and below.
    fn draw(&self, svg: &mut String, extents: &Extents, project: impl Fn(&Point) -> (f64, f64)) {
        let mut resolution = RESOLUTION;
        let mut drawn = self.stretches(extents, &project, resolution);
        while drawn.iter().map(String::len).sum::<usize>() > LONGEST {
            resolution *= 2;
            drawn = self.stretches(extents, &project, resolution);
        }
        *svg += "<g transform='scale(.1)'>";
        for (class, kinds) in [("path rapid", 0..SHADES), ("path", SHADES..2 * SHADES)] {
            for kind in kinds.rev().filter(|kind| !drawn[*kind].is_empty()) {
                _ = write!(
                    svg,
                    "<path class='{class}' stroke='{}' d='{}'/>",
                    colour(kind % SHADES),
                    drawn[kind]
                );
            }
        }
        *svg += "</g>";
    }

    /// The stretches of each shade of rapids, then those of cuts, with no points nearer to each other than that.
    fn stretches(
        &self,
        extents: &Extents,
        project: impl Fn(&Point) -> (f64, f64),
        resolution: i32,
    ) -> [String; 2 * SHADES] {
        let mut drawn = [const { String::new() }; 2 * SHADES];
        // The last point drawn, in tenths of pixels, and in which shade.
        let mut pen: Option<((i32, i32), usize)> = None;
        for ((point, value), cutting) in self.points.iter().zip(&self.values).zip(&self.cutting) {
            if !contains(extents, point) {
                pen = None;
                continue;
            }
            let place = tenths(project(point));
            let kind = self.shade(*value) + if *cutting { SHADES } else { 0 };
            let ((x, y), before) = pen.unwrap_or((place, usize::MAX));
            let (dx, dy) = (place.0 - x, place.1 - y);
            // Where the shade changes within that, the path goes on in the one before.
            let goes_on = before == kind || (pen.is_some() && resolution > RESOLUTION);
            if goes_on && dx.abs().max(dy.abs()) < resolution {
                continue;
            }
            if before != kind {
                _ = write!(drawn[kind], "M{x} {y}");
            }
            _ = write!(drawn[kind], "l{dx} {dy}");
            pen = Some((place, kind));
        }
        drawn
    }

    /// X to the right, Y up.
    pub(super) fn above(&self, extents: &Extents) -> String {
        let [x, y, _] = *extents;
        let (sx, sy) = equal_scales(x, y, (MARGIN + 6.0, WIDTH - 14.0), (HEIGHT - 34.0, 14.0));
        let ((x0, x1), (y0, y1)) = (sx.linear(), sy.linear());
        let matrix = [x1, 0.0, 0.0, x0, 0.0, y1, 0.0, y0];
        let mut svg = open("Tool path from above", &matrix);
        let ((left, right), (bottom, top)) = (sx.range, sy.range);
        for (tick, label) in sx.ticks(6) {
            let at = sx.at(tick);
            _ = write!(
                svg,
                "<path class=grid d='M{at:.1} {bottom:.1}V{top:.1}'/>\
                 <text class=tick x={at:.1} y={:.1} text-anchor=middle>{label}</text>",
                bottom + 16.0,
            );
        }
        for (tick, label) in sy.ticks(6) {
            let at = sy.at(tick);
            _ = write!(
                svg,
                "<path class=grid d='M{left:.1} {at:.1}H{right:.1}'/>\
                 <text class=tick x={:.1} y={:.1} text-anchor=end>{label}</text>",
                left - 6.0,
                at + 3.5,
            );
        }
        _ = write!(
            svg,
            "<text class=name x={right:.1} y={:.1} text-anchor=end>X <tspan class=unit>mm</tspan>\
             </text><text class=name x={:.1} y={:.1}>Y <tspan class=unit>mm</tspan></text>",
            bottom - 6.0,
            left + 6.0,
            top + 13.0
        );
        let project = |p: &Point| (sx.at(p[0]), sy.at(p[1]));
        outline(&mut svg, "programmed", &self.programmed, extents, project);
        self.draw(&mut svg, extents, project);
        self.ends(&mut svg, extents, project);
        svg + "</svg>"
    }

    /// X to the right and a little down, Y away and up, Z up.
    pub(super) fn in_space(&self, extents: &Extents) -> String {
        // Turned by 30° about Z, seen from 37° above.
        const COS: f64 = 0.866_025_403_784_438_6;
        const SIN: f64 = 0.5;
        const RISE: f64 = 0.6;
        const LIFT: f64 = 0.8;
        let flat = |[x, y, z]: &Point| {
            let (across, away) = (x * COS - y * SIN, x * SIN + y * COS);
            (across, away * RISE + z * LIFT)
        };
        let [x, y, z] = *extents;
        let corner = |n: usize| {
            let end =
                |axis: (f64, f64), bit: usize| if n >> bit & 1 == 0 { axis.0 } else { axis.1 };
            [end(x, 0), end(y, 1), end(z, 2)]
        };
        let corners: Vec<Point> = (0..8).map(corner).collect();
        let across = extent(corners.iter().map(|p| flat(p).0)).unwrap_or((0.0, 1.0));
        let up = extent(corners.iter().map(|p| flat(p).1)).unwrap_or((0.0, 1.0));
        let (sx, sy) = equal_scales(across, up, (90.0, WIDTH - 20.0), (HEIGHT - 30.0, 20.0));
        let project = |p: &Point| {
            let (across, up) = flat(p);
            (sx.at(across), sy.at(up))
        };

        let ((x0, x1), (y0, y1)) = (sx.linear(), sy.linear());
        let rise = [RISE * SIN * y1, RISE * COS * y1, LIFT * y1, y0];
        let [a, b, c, d] = rise;
        let matrix = [COS * x1, -SIN * x1, 0.0, x0, a, b, c, d];
        let mut svg = open("Tool path in space", &matrix);
        for (a, b) in (0..8).flat_map(|a| [1, 2, 4].map(|bit| (a, a | bit))) {
            if a != b {
                let ((xa, ya), (xb, yb)) = (project(&corners[a]), project(&corners[b]));
                _ = write!(
                    svg,
                    "<path class=box d='M{xa:.1} {ya:.1}L{xb:.1} {yb:.1}'/>"
                );
            }
        }
        let floor = z.0;
        let on_floor = |p: &Point| project(&[p[0], p[1], floor]);
        outline(&mut svg, "shadow", &self.points, extents, on_floor);
        outline(&mut svg, "programmed", &self.programmed, extents, project);
        self.draw(&mut svg, extents, project);
        self.ends(&mut svg, extents, project);
        let longest = extents.iter().map(|(least, most)| most - least);
        let longest = longest.fold(0.0, f64::max);
        for (name, from, to) in [
            ("X", corners[0], corners[1]),
            ("Y", corners[0], corners[2]),
            ("Z", corners[2], corners[6]),
        ] {
            let ((xa, ya), (xb, yb)) = (project(&from), project(&to));
            let (dx, dy, anchor) = match name {
                "X" => (8.0, 14.0, "start"),
                "Y" => (-8.0, 14.0, "end"),
                _ => (-8.0, 3.5, "end"),
            };
            let length: f64 = (0..3).map(|axis| to[axis] - from[axis]).sum();
            if length < NOISE * longest {
                continue;
            }
            let length = number(length);
            let width = (name.len() + 4 + length.chars().count()) as f64 * LETTER;
            let at = match anchor {
                "end" => ((xa + xb) / 2.0 + dx).max(width),
                _ => ((xa + xb) / 2.0 + dx).min(WIDTH - width),
            };
            _ = write!(
                svg,
                "<text class=name x={at:.1} y={:.1} text-anchor={anchor}>{name} <tspan class=unit>\
                 {length} mm</tspan></text>",
                (ya + yb) / 2.0 + dy,
            );
        }
        svg + "</svg>"
    }

    /// Where it starts (a ring) and ends (a dot).
    fn ends(&self, svg: &mut String, extents: &Extents, project: impl Fn(&Point) -> (f64, f64)) {
        let ends = [
            (self.points.last(), "end", 3),
            (self.points.first(), "start", 5),
        ];
        for (point, name, radius) in ends {
            if let Some(point) = point.filter(|point| contains(extents, point)) {
                let (x, y) = project(point);
                _ = write!(
                    svg,
                    "<circle class={name} cx={x:.1} cy={y:.1} r={radius}><title>{name}</title>\
                     </circle>"
                );
            }
        }
    }

    /// What the colours mean.
    pub(super) fn legend(&self) -> String {
        let mut svg = String::from(
            "<svg class=legend viewBox='0 0 420 34' shape-rendering=crispEdges role=img aria-label='What the colours mean'>",
        );
        let cell = 250.0 / SHADES as f64;
        for shade in 0..SHADES {
            _ = write!(
                svg,
                "<rect x={:.2} y=4 width={:.2} height=8 fill='{}'/>",
                shade as f64 * cell,
                cell + 0.3,
                colour(shade)
            );
        }
        for (share, anchor) in [(0.0, "start"), (0.5, "middle"), (1.0, "end")] {
            _ = write!(
                svg,
                "<text class=tick x={:.1} y=26 text-anchor={anchor}>{}</text>",
                250.0 * share,
                number(self.scale * share)
            );
        }
        _ = write!(svg, "<text class=tick x=262 y=12>{}</text>", self.quantity);
        if self.greatest > self.scale {
            _ = write!(
                svg,
                "<text class=tick x=262 y=26>thin: rapid, up to {}</text>",
                number(self.greatest)
            );
        }
        svg + "</svg>"
    }
}

/// Points in one stroke, each as far from the last one as it can be seen.
fn outline(
    svg: &mut String,
    class: &str,
    points: &[Point],
    extents: &Extents,
    project: impl Fn(&Point) -> (f64, f64),
) {
    let mut resolution = 2 * RESOLUTION;
    let mut d = stroke(points, extents, &project, resolution);
    while d.len() > LONGEST / 4 {
        resolution *= 2;
        d = stroke(points, extents, &project, resolution);
    }
    if !d.is_empty() {
        _ = write!(svg, "<path class={class} transform='scale(.1)' d='{d}'/>");
    }
}

/// Points in one stroke, no nearer to each other than that.
fn stroke(
    points: &[Point],
    extents: &Extents,
    project: impl Fn(&Point) -> (f64, f64),
    resolution: i32,
) -> String {
    let mut d = String::new();
    let mut last: Option<(i32, i32)> = None;
    for point in points {
        if !contains(extents, point) {
            last = None;
            continue;
        }
        let (x, y) = tenths(project(point));
        match last {
            None => _ = write!(d, "M{x} {y}"),
            Some((x0, y0)) if (x - x0).abs().max((y - y0).abs()) >= resolution => {
                _ = write!(d, "l{} {}", x - x0, y - y0);
            }
            Some(_) => continue,
        }
        last = Some((x, y));
    }
    d
}

fn extents<'p>(points: impl Iterator<Item = &'p Point> + Clone) -> Extents {
    [0, 1, 2].map(|axis| extent(points.clone().map(|point| point[axis])).unwrap_or((0.0, 0.0)))
}

/// A place on the page in tenths of pixels.
fn tenths((x, y): (f64, f64)) -> (i32, i32) {
    ((x * 10.0).round() as i32, (y * 10.0).round() as i32)
}

fn contains(extents: &Extents, point: &Point) -> bool {
    let inside =
        |(coordinate, (least, most)): (&f64, &(f64, f64))| (*least..=*most).contains(coordinate);
    point.iter().zip(extents).all(inside)
}

/// A view, with what a point of the machine becomes on it: x and y, each of X, Y, Z and 1.
fn open(label: &str, matrix: &[f64; 8]) -> String {
    let matrix: Vec<String> = matrix.iter().map(|it| format!("{it:.9}")).collect();
    format!(
        "<svg class=view viewBox='0 0 {WIDTH} {HEIGHT}' data-matrix='{}' role=img aria-label='{label}'>",
        matrix.join(" ")
    )
}

/// Two scales with the same pixels per mm that hold both extents and fill the rectangle; `y` goes
/// up, from `vertical.0` at the bottom to `vertical.1` at the top.
fn equal_scales(
    x: (f64, f64),
    y: (f64, f64),
    horizontal: (f64, f64),
    vertical: (f64, f64),
) -> (Scale, Scale) {
    let (width, height) = (horizontal.1 - horizontal.0, vertical.0 - vertical.1);
    let needed = ((x.1 - x.0) / width).max((y.1 - y.0) / height) * 1.04;
    let mm_per_pixel = needed.max(1.0 / width);
    let domain = |(least, most): (f64, f64), pixels: f64| {
        let (middle, half) = ((least + most) / 2.0, pixels * mm_per_pixel / 2.0);
        (middle - half, middle + half)
    };
    (
        Scale::new(domain(x, width), horizontal),
        Scale::new(domain(y, height), vertical),
    )
}

fn colour(shade: usize) -> String {
    let at = shade as f64 / (SHADES - 1) as f64 * (RAMP.len() - 1) as f64;
    let low = (at as usize).min(RAMP.len() - 2);
    let mix = |a: u8, b: u8| {
        let (a, b) = (f64::from(a), f64::from(b));
        (a + (b - a) * (at - low as f64)).round() as u8
    };
    let ((r0, g0, b0), (r1, g1, b1)) = (RAMP[low], RAMP[low + 1]);
    format!("#{:02x}{:02x}{:02x}", mix(r0, r1), mix(g0, g1), mix(b0, b1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observe::record::AxisReport;
    use proptest::prelude::*;

    fn wide(extents: &Extents) -> f64 {
        let wide = extents.iter().map(|(least, most)| most - least);
        wide.fold(0.0, f64::max)
    }

    proptest! {
        /// Whatever axes there are, and however small or large its errors and its path: each point is as many times as far beside the
        /// programmed one as the tool was, all but one in a thousand by no more than a part of the picture; points off the path are none.
        #[test]
        fn the_tool_is_as_many_times_as_far_beside_the_path(
            places in prop::collection::vec(([-500.0..500.0_f64, -500.0..500.0, -500.0..500.0], [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0], any::<bool>()), 2..300),
            has_z in any::<bool>(),
            decade in -6.0..0.0_f64,
        ) {
            let error = 10f64.powf(decade);
            let axes = if has_z { 3 } else { 2 };
            let mut report = Report {
                axes: ["X", "Y", "Z"][..axes].iter().map(|name| AxisReport { name: (*name).into(), ..AxisReport::default() }).collect(),
                ..Report::default()
            };
            let mut programmed = Vec::new();
            for (place, off, is_on_path) in &places {
                let mut off = off.map(|it| error * it);
                off[axes..].fill(0.0);
                for (at, axis) in report.axes.iter_mut().enumerate() {
                    axis.set.push(place[at]);
                    axis.tool.push(place[at] + off[at]);
                }
                report.time.push(report.time.len() as f64);
                report.cutting.push(true);
                report.off_path.push(if *is_on_path { off } else { [f64::NAN; 3] });
                if *is_on_path {
                    let mut place = *place;
                    place[axes..].fill(0.0);
                    programmed.push((place, off));
                }
            }
            let extents = ToolPath::new(&report).unwrap().padded();
            let Some((tool, times)) = ToolPath::magnified(&report, &extents) else {
                prop_assert!(programmed.iter().all(|(_, off)| *off == [0.0; 3]));
                return Ok(());
            };
            prop_assert!(times >= 1.0);
            prop_assert_eq!(tool.points.len(), programmed.len());
            let mut beyond = 0;
            for (n, (place, off)) in programmed.iter().enumerate() {
                let size = off.iter().map(|it| it * it).sum::<f64>().sqrt();
                prop_assert!((tool.values[n] - 1000.0 * size).abs() < 1e-9);
                beyond += usize::from(times > 1.0 && times * size > MAGNIFIED * wide(&extents) * (1.0 + 1e-9));
                for at in 0..3 {
                    prop_assert!((tool.programmed[n][at] - place[at]).abs() < 1e-9);
                    prop_assert!((tool.points[n][at] - place[at] - times * off[at]).abs() < 1e-6);
                }
            }
            prop_assert!(beyond <= programmed.len() / 1000);
        }
    }
}
