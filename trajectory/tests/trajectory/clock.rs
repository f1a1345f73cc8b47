//! A path whose clock is shaped, beside one whose coordinates are: where a fast line leads into a slow arc, what either leaves of
//! a vibration on curves and in corners, and what it takes in time.

use crate::machine::Machine;
use crate::shaping::{EXACT, PERIOD, left, stays_inside};
use std::f64::consts::PI;
use syncline_trajectory::path::curve::ArcDefinition;
use syncline_trajectory::path::{
    Curve, Feed, Limits, Move, PathControlMode, PathItem, Plane, Shaping,
};
use syncline_trajectory::shaper::{Kind, Method, Shaper, Vibration};

/// What is to be suppressed, in X and in Y alike.
const MODE: Vibration = Vibration {
    frequency: 8.0,
    damping: 0.02,
};

/// As of the moves of sixty lengths.
const LIMITS: Limits<3> = Limits {
    velocity: [500.0; 3],
    acceleration: [3_000.0; 3],
    jerk: [60_000.0; 3],
};

/// An arc from (x, 0) on that turns left from the direction of X.
fn arc(x: f64, radius: f64, angle: f64) -> Curve<3> {
    Curve::arc(ArcDefinition {
        start: [x, 0.0, 0.0],
        end: [x + radius * angle.sin(), radius * (1.0 - angle.cos()), 0.0],
        plane: Plane::Xy,
        centre: (x, radius),
        clockwise: false,
        turns: 0,
    })
    .unwrap()
}

fn line(from: [f64; 3], to: [f64; 3]) -> Curve<3> {
    Curve::line(from, to).unwrap()
}

/// The speed on an arc is in the mean while the axes are in the tight rounding behind it already: it has to be the rounding's by then.
#[test]
fn a_fast_arc_into_a_tight_rounding_is_as_slow_as_that_in_its_zone() {
    let modes = [(37.0, 0.0), (15.3, 0.0)];
    let modes = modes.map(|(frequency, damping)| Vibration { frequency, damping });
    let shaper = Shaper::new(Kind::Zvd, &modes);
    let arc = Curve::arc(ArcDefinition {
        start: [-11.6, 0.0, 0.0],
        end: [0.0; 3],
        plane: Plane::Xy,
        centre: (-5.8, -1.4),
        clockwise: true,
        turns: 0,
    });
    let curves = [arc.unwrap(), line([0.0; 3], [0.0, 0.0, -9.0])];
    for feed in [100.0, 200.0, 300.0] {
        let by = (&shaper, Some(Method::Clock));
        stays_inside(&curves, PathControlMode::Exact(0.001), feed, by, &[], None).unwrap();
    }
}

/// The amplitude, mm, of the vibration in X and Y behind a motion, and how long that takes, s.
fn leaves(
    curves: &[Curve<3>],
    feed: f64,
    mode: PathControlMode,
    shaped: Option<(&Shaper, Method)>,
) -> (f64, f64) {
    let item = |&curve: &Curve<3>| {
        PathItem::Move(Move {
            curve,
            feed: Feed::Rate(feed),
            mode,
            tag: 0,
        })
    };
    let items: Vec<_> = curves.iter().map(item).collect();
    let mut machine = Machine::new(LIMITS, &items, curves[0].start(), PERIOD);
    let none = Shaper::none();
    let shaper = shaped.map_or(&none, |(shaper, method)| {
        machine.shape_by(shaper.spread(PERIOD).unwrap(), Some(method), EXACT);
        shaper
    });
    let mut shaping = Shaping::new(shaper, PERIOD, machine.executor.setpoint());
    let mut positions = vec![machine.executor.setpoint().position];
    loop {
        let planned = match machine.advance() {
            Some(planned) => planned,
            None if shaping.is_settled() => break,
            None => machine.executor.advance(),
        };
        positions.push(shaping.shape(planned, &machine.executor).position);
    }
    let [x, y] = [0, 1].map(|axis: usize| {
        let of: Vec<_> = positions.iter().map(|it| it[axis]).collect();
        left(&of, MODE)
    });
    (x.hypot(y), positions.len() as f64 * PERIOD)
}

/// On curves coordinates leave next to nothing. The clock leaves the more, the more of what excites goes across the path: its
/// acceleration κṡ̃² is no mean of earlier ones, and turns with the path.
#[test]
fn on_curves_the_clock_suppresses_less_than_coordinates() {
    let shaper = Shaper::new(Kind::Zvd, &[MODE]);
    let measured = |name: &str, curves: &[Curve<3>], feed: f64, mode: PathControlMode| {
        let (unshaped, alone) = leaves(curves, feed, mode, None);
        let both = [Method::Clock, Method::Coordinates];
        let [clock, coordinates] =
            both.map(|method| leaves(curves, feed, mode, Some((&shaper, method))));
        println!(
            "| {name} | {feed} | {:.1} | {:.2} | {:.1} | {:.2} | {:.1} | {:.2} |",
            1e3 * unshaped,
            alone,
            1e3 * clock.0,
            clock.1,
            1e3 * coordinates.0,
            coordinates.1
        );
        assert!(
            coordinates.0 <= 0.02 * unshaped + 1e-4,
            "{name} {feed}: {} mm",
            coordinates.0
        );
        (unshaped, clock.0)
    };
    for feed in [50.0, 200.0] {
        let along = line([0.0; 3], [100.0, 50.0, 0.0]);
        let (unshaped, clock) = measured("line", &[along], feed, PathControlMode::Stop);
        assert!(clock <= 0.02 * unshaped + 1e-4, "{feed}: {clock} mm");
    }
    let mut most = 0.0_f64;
    for radius in [1.0, 5.0, 20.0, 100.0] {
        for feed in [10.0, 50.0, 200.0] {
            let half = [arc(0.0, radius, PI)];
            let mode = PathControlMode::Exact(0.01);
            let (_, clock) = measured(&format!("radius {radius}"), &half, feed, mode);
            most = most.max(clock);
        }
    }
    assert!(most > 1e-3, "{most} mm");
    for tolerance in [0.01, 0.1, 1.0] {
        let corner = [100.0, 0.0, 0.0];
        let legs = [line([0.0; 3], corner), line(corner, [100.0, 100.0, 0.0])];
        let mode = PathControlMode::Blend(tolerance);
        measured(&format!("corner P{tolerance}"), &legs, 100.0, mode);
    }
}
