//! Machines and paths by chance that several tests share.

use proptest::prelude::*;
use std::ops::Range;
use syncline_trajectory::path::{
    Command, Curve, Limits, PathItem, PathSegment, Plane, Planner, curve::ArcDefinition,
};

pub(crate) const LIMITS: Limits<3> = Limits {
    velocity: [500.0, 400.0, 200.0],
    acceleration: [5_000.0, 3_000.0, 2_000.0],
    jerk: [80_000.0, 50_000.0, 40_000.0],
};

fn point(size: f64) -> impl Strategy<Value = [f64; 3]> {
    prop::array::uniform3(-size..size)
}

/// Connected lines, and now and then an arc, about as long as `sizes`, mm.
pub(crate) fn contour(sizes: Range<f64>) -> impl Strategy<Value = Vec<Curve<3>>> {
    sizes
        .prop_flat_map(|size| {
            let bulge = prop::option::weighted(0.4, -1.5..1.5_f64);
            prop::collection::vec((point(size), bulge), 2..7)
        })
        .prop_filter_map("no length", |points| {
            let joined = points.windows(2).map(|pair| {
                let (start, end) = (pair[0].0, pair[1].0);
                let Some(bulge) = pair[0].1 else {
                    return Curve::line(start, end).ok();
                };
                let (mx, my) = ((start[0] + end[0]) / 2.0, (start[1] + end[1]) / 2.0);
                let (dx, dy) = (end[0] - start[0], end[1] - start[1]);
                Curve::arc(ArcDefinition {
                    start,
                    end,
                    plane: Plane::Xy,
                    centre: (mx - bulge * dy, my + bulge * dx),
                    clockwise: bulge < 0.0,
                    turns: 0,
                })
                .ok()
            });
            joined.collect()
        })
}

/// A path that is planned in one go when nobody acts: its planner, and its path segments by their distance
/// from the beginning; `take` is handed every command.
pub(crate) fn planned(
    items: &[PathItem<3>],
    start: [f64; 3],
    mut take: impl FnMut(Command<3>),
) -> (Planner<3>, Vec<PathSegment<3>>) {
    let mut planner = Planner::new(LIMITS, start);
    let (mut path_segments, mut origin) = (Vec::<PathSegment<3>>::new(), 0.0);
    for item in items {
        planner.push(*item).unwrap();
    }
    planner.finish();
    while let Some(command) = planner.pop() {
        match command {
            Command::Section { origin: o, .. } => origin = o,
            Command::PathSegment(path_segment) => path_segments.push(PathSegment {
                start: origin + path_segment.start,
                ..path_segment
            }),
            _ => {}
        }
        take(command);
    }
    (planner, path_segments)
}
