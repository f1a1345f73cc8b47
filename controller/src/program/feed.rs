//! What F counts of a move: X Y Z, else U V W, else the turns of A B C.

use crate::machine::{COORDINATES, Position};
use syncline_gcode::{Action, Feed};
use syncline_trajectory::path::{Curve, Limits};

/// Travel below this is rounding of the program's, mm or degrees.
const ROUNDING: f64 = 1e-7;

/// What F counts is the first of these that moves: X Y Z, U V W, A B C.
const COUNTED: [[usize; 3]; 3] = [[0, 1, 2], [6, 7, 8], [3, 4, 5]];

/// Which of [`COUNTED`] are degrees.
const TURNS: usize = 2;

/// What X Y Z, U V W and A B C move each.
#[must_use]
pub fn moved(change: &Position) -> [f64; 3] {
    COUNTED.map(|axes| {
        let squares = axes.map(|i| change[i] * change[i]);
        (squares[0] + squares[1] + squares[2]).sqrt()
    })
}

/// Of the speeds of what is [`moved`], the place of the one that F counts; `None` at rest.
#[must_use]
pub fn counted_group(speeds: &[f64; 3]) -> Option<usize> {
    let most = speeds.iter().copied().fold(0.0, f64::max);
    // The rounding of axes that rest is no movement.
    speeds.iter().position(|speed| *speed > 1e-9 * most)
}

/// Of a velocity, the speed as F counts it, and whether that is of a turn: degrees, not mm.
#[must_use]
pub fn counted_speed(velocity: &Position) -> (f64, bool) {
    let groups = moved(velocity);
    counted_group(&groups).map_or((0.0, false), |group| (groups[group], group == TURNS))
}

/// The length of a move as F counts it, and whether it is that of a turn: degrees, not mm.
pub(super) fn counted_length(curve: &Curve<COORDINATES>) -> (f64, bool) {
    let Curve::Line(_) = curve else {
        return (curve.length(), false);
    };
    let groups = moved(&change(curve));
    let counted = groups.iter().position(|travel| *travel > ROUNDING);
    counted.map_or((0.0, false), |group| (groups[group], group == TURNS))
}

fn change(curve: &Curve<COORDINATES>) -> Position {
    let (start, end) = (curve.start(), curve.end());
    std::array::from_fn(|i| end[i] - start[i])
}

/// The feed of a motion, but for rapids.
pub(super) fn feed(action: &Action) -> Option<Feed> {
    match action {
        Action::Feed { feed, .. } | Action::Arc { feed, .. } | Action::Spline { feed, .. } => {
            Some(*feed)
        }
        _ => None,
    }
}

/// Feeds that fall short by less than this part are reached.
const REACHED: f64 = 1e-6;

/// The part of its feed that the axes can along the curves of a motion, where they are slowest; `None` if that is
/// all of it.
pub(super) fn reached(
    curves: &[Curve<COORDINATES>],
    action: &Action,
    limits: &Limits<COORDINATES>,
) -> Option<f64> {
    let feed = feed(action)?;
    let length: f64 = curves.iter().map(Curve::length).sum();
    let parts = curves.iter().map(|curve| {
        let speed = programmed_speed(curve, feed, length);
        let [along, ..] = curve.derivative_bounds();
        let axes = along.iter().zip(&limits.velocity);
        let most = axes
            .map(|(along, most)| most / along)
            .fold(f64::INFINITY, f64::min);
        most / speed
    });
    let least = parts.fold(f64::INFINITY, f64::min);
    (least < 1.0 - REACHED).then_some(least)
}

/// The path speed that a motion of that length, of which this is a part, is programmed with.
pub(super) fn programmed_speed(curve: &Curve<COORDINATES>, feed: Feed, length: f64) -> f64 {
    let speed = feed.speed(length);
    match feed {
        Feed::Duration(_) => speed,
        Feed::Rate(_) | Feed::PerTurn { .. } => path_speed(curve, speed),
    }
}

/// The path speed at which a move has a programmed feed.
fn path_speed(curve: &Curve<COORDINATES>, feed: f64) -> f64 {
    let Curve::Line(_) = curve else {
        return feed;
    };
    let groups = moved(&change(curve));
    let fed = groups.into_iter().find(|travel| *travel > ROUNDING);
    match fed {
        Some(fed) if groups.iter().any(|other| *other > 0.0 && *other != fed) => {
            feed * curve.length() / fed
        }
        _ => feed,
    }
}
