//! The tool's path: from above, and in parallel projection from the front right.

use super::{
    Report,
    scale::{Scale, extent, number},
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

/// A position in machine coordinates, mm.
type Point = [f64; 3];

/// Least and greatest coordinate of each axis.
type Extents = [(f64, f64); 3];

/// The path with the speed at each point.
pub(super) struct ToolPath {
    points: Vec<Point>,
    speed: Vec<f64>,
    cutting: Vec<bool>,
    /// The speed of the last colour: the fastest cut, or without one the fastest move.
    scale: f64,
    fastest: f64,
}

impl ToolPath {
    /// The commanded path; `None` with no axis that is X, Y or Z, or with no finite point.
    pub(super) fn new(report: &Report) -> Option<Self> {
        let axis = |name: &str| report.axes.iter().find(|axis| axis.name == name);
        let axes = [axis("X"), axis("Y"), axis("Z")];
        axes.iter().flatten().next()?;
        let (mut points, mut speed, mut cutting) = (Vec::new(), Vec::new(), Vec::new());
        for n in 0..report.time.len() {
            let point = axes.map(|axis| axis.map_or(Some(0.0), |axis| axis.set.get(n).copied()));
            if let [Some(x), Some(y), Some(z)] = point
                && x.is_finite()
                && y.is_finite()
                && z.is_finite()
            {
                points.push([x, y, z]);
                let feed = report.feed.get(n).copied().unwrap_or(0.0);
                speed.push(if feed.is_finite() { feed } else { 0.0 });
                cutting.push(report.cutting.get(n).copied().unwrap_or(false));
            }
        }
        let fastest = speed.iter().copied().fold(0.0, f64::max);
        let cuts = speed.iter().zip(&cutting).filter(|(_, cutting)| **cutting);
        let fastest_cut = cuts.map(|(speed, _)| *speed).fold(0.0, f64::max);
        (!points.is_empty()).then_some(Self {
            scale: if fastest_cut > 0.0 {
                fastest_cut
            } else {
                fastest
            },
            points,
            speed,
            cutting,
            fastest,
        })
    }

    /// Where it goes.
    pub(super) fn whole(&self) -> Extents {
        extents(self.points.iter())
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
        let margin = size(&work) * 0.08;
        let padded = work.map(|(least, most)| (least - margin, most + margin));
        (margin > 0.0 && size(&self.whole()) > 1.5 * size(&padded)).then_some(padded)
    }

    fn shade(&self, speed: f64) -> usize {
        if self.scale > 0.0 {
            ((speed / self.scale * SHADES as f64) as usize).min(SHADES - 1)
        } else {
            0
        }
    }

    /// The path as `project` places it: one SVG path of all stretches of a shade, the slow ones
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
        for ((point, speed), cutting) in self.points.iter().zip(&self.speed).zip(&self.cutting) {
            if !contains(extents, point) {
                pen = None;
                continue;
            }
            let place = tenths(project(point));
            let kind = self.shade(*speed) + if *cutting { SHADES } else { 0 };
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

    /// The outline only, as a shadow on the floor.
    fn shadow(&self, svg: &mut String, extents: &Extents, project: impl Fn(&Point) -> (f64, f64)) {
        let mut resolution = 2 * RESOLUTION;
        let mut d = self.outline(extents, &project, resolution);
        while d.len() > LONGEST / 4 {
            resolution *= 2;
            d = self.outline(extents, &project, resolution);
        }
        _ = write!(svg, "<path class=shadow transform='scale(.1)' d='{d}'/>");
    }

    /// The whole path in one stroke, with no points nearer to each other than that.
    fn outline(
        &self,
        extents: &Extents,
        project: impl Fn(&Point) -> (f64, f64),
        resolution: i32,
    ) -> String {
        let mut d = String::new();
        let mut last: Option<(i32, i32)> = None;
        for point in &self.points {
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
        self.shadow(&mut svg, extents, |p| project(&[p[0], p[1], floor]));
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
            "<svg class=legend viewBox='0 0 420 34' shape-rendering=crispEdges role=img aria-label='Feed'>",
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
        svg += "<text class=tick x=262 y=12>feed, mm/s</text>";
        if self.fastest > self.scale {
            _ = write!(
                svg,
                "<text class=tick x=262 y=26>thin: rapid, up to {}</text>",
                number(self.fastest)
            );
        }
        svg + "</svg>"
    }
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
