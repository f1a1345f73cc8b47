//! What a simulated drive's plant and loops cost: a millisecond of each while the axis moves, 16 steps
//! of the speed loop of 62.5 µs, under a torque that swings, as it does on a contour:
//! `cargo bench -p syncline-benches --features measure --bench plants`. What is measured is the thread's processor time, so
//! that others on the host count little.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::Duration;
use syncline_controller::realtime::thread_time;
use syncline_drives::mechanics::drive_train::{DriveTrain, Elasticity, FeedAxis};
use syncline_drives::mechanics::friction::Friction;
use syncline_drives::mechanics::rigid::Rigid;
use syncline_drives::mechanics::{Load, Mechanics, Motion};
use syncline_drives::twin::servo::cascade::{Cascade, Gains, Reference};
use syncline_drives::twin::servo::motor::Motor;
use syncline_drives::twin::servo::power_stage::{DcBus, PowerStage};

const STEP: f64 = 62.5e-6;
const STEPS: u32 = 16;

/// A screw's axis: 65 Hz and 138 Hz, without friction.
fn elastic(play: f64) -> DriveTrain {
    DriveTrain {
        elasticity: Some(Elasticity {
            stiffness: 66.0,
            damping: 0.01,
            play,
        }),
        bearing: Friction::default(),
        ..DriveTrain::default()
    }
}

/// The same with friction of every kind.
fn rubbing(play: f64) -> DriveTrain {
    let friction = |coulomb| Friction {
        coulomb,
        breakaway: 1.5 * coulomb,
        stribeck_speed: 3.0,
        viscous: 1e-3,
    };
    DriveTrain {
        bearing: friction(0.02),
        guide: friction(0.05),
        load_torque: -0.05,
        ..elastic(play)
    }
}

/// Processor time of so many calls.
fn time<T>(calls: u64, mut call: impl FnMut() -> T) -> Duration {
    let begin = thread_time();
    for _ in 0..calls {
        black_box(call());
    }
    thread_time() - begin
}

/// A millisecond of mechanics. Each cycle of 2 ms is a little longer or shorter than the one before,
/// as a drive's clock is that follows SYNC.
fn mechanics(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("mechanics of a drive, 1 ms");
    let mut bench = |name: &str, mechanics: &mut dyn Mechanics| {
        let (mut step, mut shaft) = (0_u32, [Motion::default()]);
        group.bench_function(BenchmarkId::from_parameter(name), |bencher| {
            let mut millisecond = || {
                for _ in 0..STEPS {
                    let cycle = f64::from(step / (2 * STEPS) % 2);
                    let phase = f64::from(step % 3200) / 3200.0;
                    // A triangle: nothing is measured but the mechanics.
                    let torque = 2.4 * (phase - 0.5).abs() - 0.6;
                    let load = Load {
                        torque,
                        outside: 0.0,
                        brake_open: true,
                        blocked: false,
                    };
                    mechanics.step(STEP * (1.0 + 1e-6 * cycle), &[load], &mut shaft);
                    step = step.wrapping_add(1);
                }
                shaft[0]
            };
            bencher.iter_custom(|calls| time(calls, &mut millisecond));
        });
    };
    bench("rigid", &mut Rigid::default());
    bench("stiff feed axis", &mut FeedAxis::new(DriveTrain::default()));
    bench("elastic", &mut FeedAxis::new(elastic(0.0)));
    bench("elastic, friction", &mut FeedAxis::new(rubbing(0.0)));
    bench("elastic, friction, play", &mut FeedAxis::new(rubbing(1e-3)));
}

/// A millisecond of the loops, with a motor that follows its reference.
fn loops(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("loops of a drive, 1 ms");
    group.bench_function("cascade", |bencher| {
        let mut cascade = Cascade::new(Gains::default(), 0);
        let mut encoder = 0;
        let mut millisecond = || {
            let mut torque = 0.0;
            for step in 0..STEPS {
                encoder += 80;
                let reference = Reference::Position {
                    position: encoder as f64 + 20.0,
                    velocity: 1.3e6,
                    acceleration: 0.0,
                };
                if step % 4 == 0 {
                    cascade.position_step(reference, encoder, 131_072.0);
                }
                torque = cascade.speed_step(reference, encoder, 131_072.0, false);
            }
            torque
        };
        bencher.iter_custom(|calls| time(calls, &mut millisecond));
    });
    group.bench_function("power stage", |bencher| {
        let mut stage = PowerStage::new(Motor::default(), DcBus::default());
        let mut position = 0.0;
        let mut millisecond = || {
            let mut torque = 0.0;
            for _ in 0..STEPS {
                position += 10.0 * STEP;
                torque = stage.step(black_box(0.7), position, 10.0, STEP);
            }
            torque
        };
        bencher.iter_custom(|calls| time(calls, &mut millisecond));
    });
}

criterion_group!(benches, mechanics, loops);
criterion_main!(benches);
