//! Planning and evaluation touch no heap.

use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use syncline_trajectory::limits::{Limits, PositionLimits};
use syncline_trajectory::path::{Executor, Jog, Travel};
use syncline_trajectory::profile::{Profile, State};
use syncline_trajectory::state_to_state::{Problem, plan};
use syncline_trajectory::synchronise::{Synchronisation, plan as plan_all};
use syncline_trajectory::synchronous::{AngleObserver, Follower, Thread};
use syncline_trajectory::verify;

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

#[test]
fn planning_evaluation_and_verification_allocate_nothing() {
    let limits = Limits::symmetric(1.0, 2.0, 10.0);
    let start = State {
        p: 0.0,
        v: 0.3,
        a: -0.5,
    };
    let axes = [
        Problem::new(
            start,
            State {
                p: 1.0,
                v: 0.2,
                a: 0.1,
            },
            limits,
        ),
        Problem::new(State { v: 1.5, ..start }, State::at_rest(-3.0), limits),
        Problem {
            bounds: Some(PositionLimits {
                min: -9.0,
                max: 9.0,
            }),
            ..Problem::new(start, State::at_rest(2.0), limits)
        },
    ];
    let mut profiles = axes.map(|a| Profile::new(a.start));
    assert_no_alloc(|| {
        for (axis, min_duration) in axes.iter().zip([0.0, 50.0, 7.0]) {
            let profile = plan(axis, min_duration).unwrap();
            assert!(verify::axis(&profile, axis).holds(1e-12));
            assert!(profile.at(0.5).is_finite() && profile.extrema().velocity.max > 0.0);
        }
        plan_all(&axes, Synchronisation::Time, 20.0, &mut profiles).unwrap();
        plan_all(&axes, Synchronisation::None, 0.0, &mut profiles).unwrap();
    });
}

#[test]
fn jogs_allocate_nothing() {
    let travel = Travel {
        limits: Limits::symmetric(100.0, 1_000.0, 20_000.0),
        bounds: PositionLimits {
            min: -100.0,
            max: 100.0,
        },
    };
    let mut executor = Executor::new([0.0; 3], 0.002);
    assert_no_alloc(|| {
        for jog in [
            Jog::Continuous {
                axis: 0,
                velocity: 50.0,
            },
            Jog::Step {
                axis: 1,
                distance: -10.0,
                speed: 20.0,
            },
            Jog::To([Some(-90.0), None, Some(90.0)]),
            Jog::Line {
                to: [Some(20.0), Some(20.0), Some(20.0)],
                speed: f64::INFINITY,
            },
        ] {
            executor.jog(jog, &[Some(travel); 3]).unwrap();
            for _ in 0..100 {
                assert!(executor.advance().off_path);
            }
        }
        executor.resume();
        while executor.is_off_path() {
            executor.advance();
        }
    });
}

#[test]
fn threads_allocate_nothing() {
    let thread = Thread {
        length: 20.0,
        lead: 1.0,
        reverse: false,
        tolerance: 0.1,
        tapping: None,
    };
    let limits = Limits::symmetric(100.0, 1_000.0, 20_000.0);
    let mut observer = AngleObserver::new(0.002, 1e-4);
    let mut follower = Follower::new(thread, limits, 0.002);
    assert_no_alloc(|| {
        for cycle in 0..20_000 {
            observer.advance(0.002);
            observer.measure(10.0 * 0.002 * f64::from(cycle));
            follower.advance(&mut observer, 0.002, 0.002).unwrap();
            if follower.is_over() {
                return;
            }
        }
        panic!("it never ends");
    });
}
