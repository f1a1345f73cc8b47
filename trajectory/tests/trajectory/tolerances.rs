//! More tolerance never takes more time: motion with a stop at every point, inside the micrometre of G61, and
//! under ever greater tolerances.

use crate::programs::{Draw, Program, campaign};
use syncline_trajectory::path::{Curve, Feed, Limits, PathControlMode};

/// Part by which motion may take longer: by which the optimum may be missed.
const TOLERANCE: f64 = 1e-3;

const LADDER: [PathControlMode; 8] = [
    PathControlMode::Stop,
    PathControlMode::Exact(0.001),
    PathControlMode::Blend(0.003),
    PathControlMode::Blend(0.01),
    PathControlMode::Blend(0.03),
    PathControlMode::Blend(0.1),
    PathControlMode::Blend(0.3),
    PathControlMode::Blend(1.0),
];

/// By what part motion takes longer in a mode than in any before it, at most.
fn growth<const N: usize>(program: &Program<N>, modes: &[PathControlMode], name: &str) -> f64 {
    let mut least = f64::INFINITY;
    let mut worst = 0.0_f64;
    for &mode in modes {
        let time = program.cost(mode).time;
        let longer = time / least - 1.0;
        if longer > TOLERANCE {
            println!("{name}: {time:.5} s under {mode:?}, {longer:.5} longer");
        }
        worst = worst.max(longer);
        least = least.min(time);
    }
    worst
}

/// One in four consists of short segments.
fn growth_of(seed: u64) -> f64 {
    let mut draw = Draw::of(seed);
    let program = match seed % 4 {
        3 => draw.short_segments().0,
        _ => draw.contour(),
    };
    growth(&program, &LADDER, &format!("seed {seed}"))
}

/// Of a program of any kind, under tolerances of any size.
fn growth_of_anything(seed: u64) -> f64 {
    let mut draw = Draw::of(seed);
    let program = draw.anything::<4>();
    let mut tolerances = [(); 4].map(|()| draw.log(1e-3, 10.0));
    tolerances.sort_by(f64::total_cmp);
    let merges = draw.unit() < 0.2;
    let rounded = tolerances.map(|tolerance| match merges {
        true => PathControlMode::Merge {
            tolerance,
            within: 0.5 * tolerance,
        },
        false => PathControlMode::Blend(tolerance),
    });
    let mut modes = vec![PathControlMode::Stop, PathControlMode::Exact(0.001)];
    modes.extend(rounded);
    growth(&program, &modes, &format!("seed {seed}"))
}

#[test]
fn motion_takes_hardly_longer_with_more_tolerance() {
    for seed in 10..14 {
        let growth = growth(&Draw::of(seed).contour(), &LADDER, &format!("seed {seed}"));
        assert!(growth < 0.01, "seed {seed}: {growth} longer");
    }
}

/// Runs of short segments that are longer with more tolerance, which no curve may take the place of, ended in lines
/// too short for a rounding: two stops each.
#[test]
fn what_short_segments_leave_is_no_stop() {
    for seed in [7, 19, 71, 75, 97] {
        let growth = growth_of(seed);
        assert!(growth <= TOLERANCE, "seed {seed}: {growth} longer");
    }
}

/// Short moves become one curve where roundings between them are passed sooner, and roundings beside arcs bend more
/// the larger they are: by up to 4.6 % longer before the sooner of both was taken.
#[test]
fn more_tolerance_takes_the_sooner_of_two_shapes() {
    for seed in [2, 24, 31, 39, 50, 59, 101] {
        let growth = growth_of(seed);
        assert!(growth <= TOLERANCE, "seed {seed}: {growth} longer");
    }
}

/// What is too long for one window is compared, too: by up to 3.1 % longer when such a stretch counted as not planned.
#[test]
fn a_stretch_of_several_windows_is_compared() {
    for seed in [38, 39, 130] {
        let growth = growth_of_anything(seed);
        assert!(growth <= TOLERANCE, "seed {seed}: {growth} longer");
    }
}

/// A stretch that comparing has not work enough for was taken to be as fast in all as where it was planned: by 16 % longer.
#[test]
fn what_is_not_known_is_not_taken_for_what_is() {
    let longer = longer_of(54);
    let worst = longer[..HOLD].iter().map(|(by, _)| *by).fold(0.0, f64::max);
    assert!(worst <= TOLERANCE, "{longer:.5?}");
}

/// A mode that may merge lines passes what has none to merge as one that does not. As long lines count as gathered there, a
/// choice among tolerances once had no end before that of the path, and more than it could compare: by up to 32 % longer.
#[test]
fn what_has_nothing_to_merge_is_passed_as_without() {
    for seed in [5, 25, 29, 37, 43] {
        let program = Draw::of(seed).anything::<4>();
        for tolerance in [0.005, 0.05, 0.5] {
            let blend = program.cost(PathControlMode::Blend(tolerance)).time;
            // As near as short segments have to be to a line without.
            let within = 1e-3 * tolerance;
            let merge = program
                .cost(PathControlMode::Merge { tolerance, within })
                .time;
            let longer = merge / blend - 1.0;
            assert!(
                longer <= TOLERANCE,
                "seed {seed}, P{tolerance}: {longer:.5} longer"
            );
        }
    }
}

/// How much longer programs take with more tolerance, and how many do not.
fn tell(growth: fn(u64) -> f64) {
    let mut growths: Vec<f64> = campaign().map(growth).collect();
    growths.sort_by(f64::total_cmp);
    let at = |part: f64| growths[((growths.len() - 1) as f64 * part) as usize];
    println!("{:?}", [0.5, 0.9, 0.99, 0.999, 1.0].map(at));
    let kept = growths.iter().filter(|growth| **growth <= TOLERANCE);
    println!("{} of {}", kept.count(), growths.len());
}

/// As long as is wanted: `CASES=1000`, from `SEED=0` on.
#[test]
#[ignore = "a measurement"]
fn how_motion_time_goes_with_the_tolerance() {
    tell(growth_of);
}

/// The same for programs of any kind.
#[test]
#[ignore = "a measurement"]
fn how_motion_time_of_anything_goes_with_the_tolerance() {
    tell(growth_of_anything);
}

/// What motion takes in a mode, against others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Against {
    /// More tolerance against any lesser one, G61's micrometre among them.
    LessTolerance,
    /// G64 against G61.
    ExactPath,
    /// G61 against G61.1.
    ExactStop,
    /// G64 against G61.1.
    Stops,
    /// G64 P below the micrometre of G61 against that: who asks for less than G61 rounds off gets it, sooner or later.
    Finer,
}

/// How many of these hold.
const HOLD: usize = 4;

const EVERY: [Against; 5] = [
    Against::LessTolerance,
    Against::ExactPath,
    Against::ExactStop,
    Against::Stops,
    Against::Finer,
];

/// By what part motion takes longer than in the other modes, for every one of them at most, and at which tolerance.
type Longer = [(f64, f64); 5];

/// Of a program of any kind, with modes that switch in its midst: what is G64 all over, under ever greater
/// tolerances.
fn longer<const N: usize>(draw: &mut Draw) -> Longer {
    let program = draw.anything::<N>();
    let mut tolerances = [(); 4].map(|()| match draw.unit() {
        0.0..0.1 => draw.log(1e-5, 1e-3),
        _ => draw.log(1e-3, 10.0),
    });
    tolerances.sort_by(f64::total_cmp);
    let merges = draw.unit() < 0.1;
    let switches = draw.unit() < 0.4;
    let mut kept = None;
    let modes: Vec<_> = (program.curves.iter())
        .map(|_| {
            if switches && draw.unit() < 0.15 {
                kept = match draw.unit() {
                    0.0..0.6 => None,
                    0.6..0.8 => Some(PathControlMode::Stop),
                    _ => Some(PathControlMode::Exact(EXACT)),
                };
            }
            kept
        })
        .collect();
    let time = |mode| {
        let cost = program.cost_by(|k| match mode {
            PathControlMode::Stop => mode,
            _ => modes[k].unwrap_or(mode),
        });
        cost.time
    };
    let (stops, exact) = (
        time(PathControlMode::Stop),
        time(PathControlMode::Exact(EXACT)),
    );
    let mut longer = [(f64::NEG_INFINITY, 0.0); 5];
    let mut take = |against: Against, by: f64, tolerance: f64| {
        let most = &mut longer[against as usize];
        if by > most.0 {
            *most = (by, tolerance);
        }
    };
    take(Against::ExactStop, exact / stops - 1.0, EXACT);
    let mut least = f64::INFINITY;
    for tolerance in tolerances {
        let rounded = match merges {
            true => PathControlMode::Merge {
                tolerance,
                within: 0.5 * tolerance,
            },
            false => PathControlMode::Blend(tolerance),
        };
        let rounded = time(rounded);
        if tolerance >= EXACT {
            take(Against::ExactPath, rounded / exact - 1.0, tolerance);
            least = least.min(exact);
        } else {
            take(Against::Finer, rounded / exact - 1.0, tolerance);
        }
        take(Against::Stops, rounded / stops - 1.0, tolerance);
        take(Against::LessTolerance, rounded / least - 1.0, tolerance);
        least = least.min(rounded);
    }
    longer
}

/// The tolerance of G61, mm.
const EXACT: f64 = 0.001;

/// On two to six axes.
fn longer_of(seed: u64) -> Longer {
    let mut draw = Draw::of(seed);
    match seed % 5 {
        0 => longer::<2>(&mut draw),
        1 => longer::<3>(&mut draw),
        2 => longer::<4>(&mut draw),
        3 => longer::<5>(&mut draw),
        _ => longer::<6>(&mut draw),
    }
}

/// Curves in place of short segments were fitted within the tolerance itself, and nothing was tried once the mode
/// changed, nor in a run of short segments behind another: by 5 % longer under G64 than under G61. And by 3 % under G61 than with
/// stops.
#[test]
fn curves_that_lesser_tolerances_give_are_tried() {
    for seed in [29, 35, 323] {
        let longer = longer_of(seed);
        let worst = longer[..HOLD].iter().map(|(by, _)| *by).fold(0.0, f64::max);
        assert!(worst <= TOLERANCE, "seed {seed}: {longer:.5?}");
    }
}

/// As long as is wanted: `CASES=1000`, from `SEED=0` on.
#[test]
#[ignore = "a measurement"]
fn how_motion_time_goes_with_the_mode() {
    let mut all: [Vec<(f64, u64, f64)>; 5] = Default::default();
    for seed in campaign() {
        for (of, (by, tolerance)) in all.iter_mut().zip(longer_of(seed)) {
            if by > TOLERANCE {
                println!("seed {seed}: {by:.5} longer under P{tolerance:.5}");
            }
            // None of its tolerances may be one of those.
            if by.is_finite() {
                of.push((by, seed, tolerance));
            }
        }
    }
    for (against, mut of) in EVERY.into_iter().zip(all) {
        of.sort_by(|a, b| a.0.total_cmp(&b.0));
        let at = |part: f64| of[((of.len() - 1) as f64 * part) as usize].0;
        let more = |than: f64| of.iter().filter(|(by, ..)| *by > than).count();
        println!(
            "{against:?}: {:.5?}, of {} longer by 0.1 %: {}, by 1 %: {}; worst {:.5?}",
            [0.5, 0.9, 0.99, 0.999, 1.0].map(at),
            of.len(),
            more(TOLERANCE),
            more(0.01),
            &of[of.len().saturating_sub(8)..],
        );
    }
}

const PLAIN: Limits<3> = Limits {
    velocity: [200.0; 3],
    acceleration: [2_000.0; 3],
    jerk: [40_000.0; 3],
};

/// A slow move to a kink of 4e-5 rad and a rapid behind it.
#[test]
fn a_rapid_is_no_slower_for_a_slow_move_before_it() {
    let points = [[0.0; 3], [0.002, 100.0, 0.0], [0.0, 150.0, 0.0]];
    let line = |k: usize| Curve::line(points[k], points[k + 1]).unwrap();
    let mut curves = vec![(line(0), Feed::Rate(1.0)), (line(1), Feed::Rapid)];
    for _ in 0..2 {
        let limits = PLAIN;
        let program = Program {
            limits,
            curves: curves.clone(),
        };
        let growth = growth(&program, &LADDER, "a kink");
        assert!(growth <= TOLERANCE, "{growth} longer");
        // The other way round.
        curves.reverse();
        for (curve, _) in &mut curves {
            *curve = curve.reversed();
        }
    }
}

/// Lines of 2 µm to and fro are passed as what they are within the tolerance: all but straight.
#[test]
fn a_fine_zigzag_is_passed_as_the_line_it_is() {
    for turn in [0.5_f64, 1.5, 2.5] {
        let mut at = [0.0; 3];
        let mut points = vec![at];
        for k in 0..1_000 {
            let side = if k % 2 == 0 { 0.5 } else { -0.5 };
            at[0] += 0.002 * (side * turn).cos();
            at[1] += 0.002 * (side * turn).sin();
            points.push(at);
        }
        let program = Program::polyline(PLAIN, &points, Feed::Rate(50.0));
        let ends = [points[0], *points.last().unwrap()];
        let straight = Program::polyline(PLAIN, &ends, Feed::Rate(50.0)).stopping();
        for tolerance in [0.01, 0.03, 0.1, 0.3] {
            let time = program.cost(PathControlMode::Blend(tolerance)).time;
            println!(
                "{turn} rad, P{tolerance}: {time} s, {} s straight",
                straight.time
            );
            assert!(time < 1.5 * straight.time, "{time} s, {} s", straight.time);
        }
    }
}

/// So are longer ones, up to two tolerances, that turn by more than short segments of a curve do. While lines above half of a
/// tolerance counted as corners, these ran at a thirtieth of their feed.
#[test]
fn a_zigzag_in_lines_of_a_tolerance_is_passed_as_the_line_it_is() {
    for tolerance in [0.01, 0.1] {
        for (along, aside) in [(0.31, 0.42), (0.5, 0.5), (1.0, 0.5), (1.6, 0.8)] {
            let [along, aside] = [along, aside].map(|it| it * tolerance);
            let point = |k: u32| [f64::from(k) * along, f64::from(k % 2) * aside, 0.0];
            let points: Vec<_> = (0..=4_000).map(point).collect();
            let program = Program::polyline(PLAIN, &points, Feed::Rate(10.0));
            let ends = [points[0], points[4_000]];
            let straight = Program::polyline(PLAIN, &ends, Feed::Rate(10.0)).stopping();
            let time = program.cost(PathControlMode::Blend(tolerance)).time;
            println!(
                "{along:.4} along, {aside:.4} aside, P{tolerance}: {time:.3} s, {:.3} s straight",
                straight.time
            );
            assert!(
                time < 1.2 * straight.time,
                "{time} s, {} s straight, lines of {along} and {aside} mm within {tolerance}",
                straight.time
            );
        }
    }
}

/// Lines of one length that turn by one angle, as CAM writes them with so many decimals.
fn star(turn: f64, length: f64, decimals: i32, lines: usize) -> Program<2> {
    const LIMITS: Limits<2> = Limits {
        velocity: [400.0; 2],
        acceleration: [2_500.0; 2],
        jerk: [50_000.0; 2],
    };
    let grid = 10_f64.powi(decimals);
    let mut at = [0.0; 2];
    let mut points = vec![at];
    for line in 0..lines {
        let heading = (line as f64 * turn).to_radians();
        at[0] += length * heading.cos();
        at[1] += length * heading.sin();
        points.push(at.map(|it| (it * grid).round() / grid));
    }
    Program::polyline(LIMITS, &points, Feed::Rate(114.0))
}

/// Of lines whose halves both roundings take all but a sliver is left: with 5 to 8 decimals windows over those had no solution, and
/// roundings were crawled along, 20 times as long as with stops.
#[test]
fn lines_of_equal_length_are_passed_whatever_their_decimals() {
    for turn in [120.0, 145.0, 155.0] {
        for (length, tolerance) in [(0.69, 0.13), (1.0, 0.2), (4.0, 0.8)] {
            for decimals in 3..7 {
                let program = star(turn, length, decimals, 8);
                let stops = program.stopping().time;
                let time = program.cost(PathControlMode::Blend(tolerance)).time;
                assert!(
                    time <= stops * (1.0 + TOLERANCE),
                    "{turn}°, {length} mm, {decimals} decimals: {time} s, with stops {stops} s"
                );
            }
        }
    }
}
