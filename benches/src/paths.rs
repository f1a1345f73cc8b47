//! Paths in the plane, and a planner and an executor that follow them, for what is measured in the
//! cycle and between.

use syncline_trajectory::path::{
    Curve, Executor, Feed, Limits, Move, PathControlMode, PathItem, Plane, Planner,
    curve::ArcDefinition,
};

/// Of the cycle, s.
pub const PERIOD: f64 = 0.002;

/// The same for every axis.
pub fn limits<const N: usize>() -> Limits<N> {
    Limits {
        velocity: [500.0; N],
        acceleration: [5_000.0; N],
        jerk: [80_000.0; N],
    }
}

/// A point of the plane, mm.
pub fn point<const N: usize>(x: f64, y: f64) -> [f64; N] {
    let mut point = [0.0; N];
    (point[0], point[1]) = (x, y);
    point
}

/// Lines from point to point.
///
/// # Panics
/// Where two in succession are the same.
pub fn lines<const N: usize>(points: impl Iterator<Item = [f64; N]>) -> Vec<Curve<N>> {
    let points: Vec<_> = points.collect();
    let line = |ends: &[[f64; N]]| Curve::line(ends[0], ends[1]).expect("two points");
    points.windows(2).map(line).collect()
}

/// So many lines up and down by 8 mm, 10 mm further each.
pub fn zigzag<const N: usize>(count: u32) -> Vec<Curve<N>> {
    lines((0..=count).map(|k| point(10.0 * f64::from(k), 8.0 * f64::from(k % 2))))
}

/// A full circle.
///
/// # Panics
/// Where the radius, in mm, is none.
pub fn circle<const N: usize>(radius: f64) -> Vec<Curve<N>> {
    let circle = Curve::arc(ArcDefinition {
        start: point(0.0, 0.0),
        end: point(0.0, 0.0),
        plane: Plane::Xy,
        centre: (radius, 0.0),
        clockwise: true,
        turns: 0,
    });
    vec![circle.expect("a circle")]
}

/// A planner that knows the whole path, at a feed in mm/s and corners rounded within a tolerance in mm,
/// and an executor where it begins.
///
/// # Panics
/// Where the curves are not a path.
pub fn begin<const N: usize>(
    curves: &[Curve<N>],
    feed: f64,
    tolerance: f64,
) -> (Planner<N>, Executor<N>) {
    let mut planner = Planner::new(limits(), curves[0].start());
    for curve in curves {
        let motion = Move {
            curve: *curve,
            feed: Feed::Rate(feed),
            mode: PathControlMode::Blend(tolerance),
            tag: 0,
        };
        planner.push(PathItem::Move(motion)).expect("a path");
    }
    planner.finish();
    (planner, Executor::new(curves[0].start(), PERIOD))
}

/// Hands over what there is room for.
pub fn supply<const N: usize>(planner: &mut Planner<N>, plan: &mut Executor<N>) {
    while plan.room() > 0
        && let Some(command) = planner.pop()
    {
        plan.accept(command);
    }
}
