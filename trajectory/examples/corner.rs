//! Draws the same corner under G61.1, G61 and G64: path, speed, acceleration and jerk of both axes.
//! `cargo run -p syncline-trajectory --example corner -- DIRECTORY`

use std::fmt::Write;
use syncline_trajectory::path::{
    Command, Curve, Feed, JerkSegment, Limits, Move, PathControlMode, PathItem, PathSegment,
    Planner,
};

const LIMITS: Limits<2> = Limits {
    velocity: [300.0; 2],
    acceleration: [3_000.0; 2],
    jerk: [60_000.0; 2],
};
const FEED: f64 = 100.0;
const LEG: f64 = 8.0;

/// Time, position, and of both axes acceleration and jerk; path speed.
struct Sample {
    t: f64,
    q: [f64; 2],
    speed: f64,
    acceleration: [f64; 2],
    jerk: [f64; 2],
}

fn samples(mode: PathControlMode) -> Vec<Sample> {
    let points = [[0.0, 0.0], [LEG, 0.0], [LEG, LEG]];
    let mut planner = Planner::new(LIMITS, points[0]);
    for pair in points.windows(2) {
        let motion = Move {
            curve: Curve::line(pair[0], pair[1]).expect("points apart"),
            feed: Feed::Rate(FEED),
            mode,
            tag: 0,
        };
        planner
            .push(PathItem::Move(motion))
            .expect("one after another");
    }
    planner.finish();
    let mut sections: Vec<Vec<PathSegment<2>>> = Vec::new();
    let mut steps: Vec<Option<(usize, JerkSegment)>> = Vec::new();
    while let Some(command) = planner.pop() {
        match command {
            Command::Section { .. } => {
                sections.push(Vec::new());
                steps.push(None);
            }
            Command::PathSegment(path_segment) => {
                sections.last_mut().expect("a section").push(path_segment)
            }
            Command::JerkSegment(segment) => steps.push(Some((sections.len() - 1, segment))),
            Command::ReplaceTail(step) => steps.truncate(step as usize),
            _ => {}
        }
    }
    let mut out = Vec::new();
    let mut begin = 0.0;
    for (section, segment) in steps.into_iter().flatten() {
        let path_segments = &sections[section];
        let after = |s: &PathSegment<2>| s.start <= segment.distance + 1e-9;
        let path_segment = &path_segments[path_segments.partition_point(after).max(1) - 1];
        // Jerk jumps from jerk segment to jerk segment, so both ends are drawn; on curves it changes in between.
        let parts = if path_segment.curve.direction().is_some() && segment.jerk == 0.0 {
            1
        } else {
            4
        };
        for k in 0..=parts {
            let t = segment.duration * f64::from(k) / f64::from(parts);
            let (ds, v, a) = segment.at(t);
            let at = path_segment
                .curve
                .at(segment.distance - path_segment.start + ds);
            out.push(Sample {
                t: begin + t,
                q: at.q,
                speed: v,
                acceleration: [0, 1].map(|i| at.d2[i] * v * v + at.d1[i] * a),
                jerk: [0, 1].map(|i| {
                    at.d3[i] * v * v * v + 3.0 * at.d2[i] * v * a + at.d1[i] * segment.jerk
                }),
            });
        }
        begin += segment.duration;
    }
    out
}

/// One panel: curves in their colours over a frame, limits dashed.
fn panel(
    svg: &mut String,
    [left, top]: [f64; 2],
    title: &str,
    [x0, x1, y0, y1]: [f64; 4],
    limits: &[f64],
    curves: &[(&str, Vec<[f64; 2]>)],
) {
    const SIZE: [f64; 2] = [300.0, 170.0];
    let x = |v: f64| left + SIZE[0] * (v - x0) / (x1 - x0);
    let y = |v: f64| top + SIZE[1] * (y1 - v) / (y1 - y0);
    let _ = writeln!(
        svg,
        r##"<rect x="{left}" y="{top}" width="{}" height="{}" fill="none" stroke="#bbb"/><text x="{left}" y="{}">{title}</text>"##,
        SIZE[0],
        SIZE[1],
        top - 6.0
    );
    for &limit in limits {
        let _ = writeln!(
            svg,
            r##"<path d="M{left} {0:.1}h{1}" stroke="#c33" stroke-dasharray="4 3"/>"##,
            y(limit),
            SIZE[0]
        );
    }
    for (colour, points) in curves {
        let _ = write!(svg, r#"<path fill="none" stroke="{colour}" d=""#);
        let mut before = String::new();
        let mut command = 'M';
        for p in points.iter().filter(|p| p[0] >= x0 && p[0] <= x1) {
            let here = format!("{:.1} {:.1}", x(p[0]), y(p[1]));
            if here != before {
                let _ = write!(svg, "{command}{here}");
                command = 'L';
                before = here;
            }
        }
        let _ = writeln!(svg, r#""/>"#);
    }
}

fn main() -> std::io::Result<()> {
    let directory = std::env::args().nth(1).unwrap_or_else(|| ".".into());
    let modes = [
        ("g61-1", "G61.1", PathControlMode::Stop),
        ("g61", "G61 within 0.001 mm", PathControlMode::Exact(0.001)),
        ("g64-p005", "G64 P0.05", PathControlMode::Blend(0.05)),
        ("g64-p02", "G64 P0.2", PathControlMode::Blend(0.2)),
        ("g64-p1", "G64 P1", PathControlMode::Blend(1.0)),
    ];
    for (file, name, mode) in modes {
        let rows = samples(mode);
        let time = rows.last().map_or(0.0, |r| r.t);
        println!("{name}: {time:.4} s");
        let of = |f: &dyn Fn(&Sample) -> f64| rows.iter().map(|r| [r.t, f(r)]).collect();
        let mut svg = String::from(
            r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 660 430" font-family="sans-serif" font-size="12">"#,
        );
        let programmed = vec![[LEG - 1.9, 0.0], [LEG, 0.0], [LEG, 1.13]];
        let path = rows.iter().map(|r| r.q).filter(|q| q[1] <= 1.13).collect();
        let title = format!("{name}, {time:.3} s: path, 2 × 1.1 mm about the corner");
        let frame = [LEG - 1.9, LEG + 0.1, -0.033, 1.1];
        let curves = [("#ccc", programmed), ("#06c", path)];
        panel(&mut svg, [20.0, 30.0], &title, frame, &[], &curves);
        let until = 0.3;
        let speed = [("#06c", of(&|r| r.speed))];
        let title = "path speed, 0 … 100 mm/s, over 0.3 s";
        let frame = [0.0, until, 0.0, 1.1 * FEED];
        panel(&mut svg, [340.0, 30.0], title, frame, &[FEED], &speed);
        for (left, title, limit, of_axis) in [
            (
                20.0,
                "acceleration of x and y, ±3000 mm/s²",
                3_000.0,
                [of(&|r| r.acceleration[0]), of(&|r| r.acceleration[1])],
            ),
            (
                340.0,
                "jerk of x and y, ±60 000 mm/s³",
                60_000.0,
                [of(&|r| r.jerk[0]), of(&|r| r.jerk[1])],
            ),
        ] {
            let frame = [0.0, until, -1.1 * limit, 1.1 * limit];
            let [x, y] = of_axis;
            let curves = [("#06c", x), ("#e80", y)];
            panel(
                &mut svg,
                [left, 245.0],
                title,
                frame,
                &[limit, -limit],
                &curves,
            );
        }
        svg.push_str("</svg>\n");
        std::fs::write(format!("{directory}/corner-{file}.svg"), svg)?;
    }
    Ok(())
}
