//! Planning short lines as CAM systems write curves, from the moves to the jerk segments that a cycle follows:
//! at least 100,000 a second on one core.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use syncline_benches::contours::{MILL, Plan, polyline};
use syncline_trajectory::path::{Curve, Feed, Move, PathControlMode, PathItem};

const COUNT: usize = 50_000;

/// Short segments of 0.05 mm along a spiral from a radius of 5 mm by 1 mm a turn, rounded to `grain`.
fn spiral(grain: f64) -> Vec<Curve<3>> {
    let mut angle = 0.0_f64;
    let points: Vec<[f64; 3]> = (0..=COUNT)
        .map(|_| {
            let radius = 5.0 + angle / std::f64::consts::TAU;
            let (sin, cos) = angle.sin_cos();
            angle += 0.05 / radius;
            [radius * cos, radius * sin, 0.0].map(|x| (x / grain).round() * grain)
        })
        .collect();
    polyline(&points)
}

fn plan(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("short segments");
    group.throughput(Throughput::Elements(COUNT as u64));
    group.sample_size(10);
    for (name, grain, mode) in [
        (
            "G64 P0.01, rounded to 1 µm",
            1e-3,
            PathControlMode::Blend(0.01),
        ),
        (
            "G64 P0.01, rounded to 1 nm",
            1e-6,
            PathControlMode::Blend(0.01),
        ),
        ("G61, rounded to 1 nm", 1e-6, PathControlMode::Exact(0.001)),
        ("G61, rounded to 1 µm", 1e-3, PathControlMode::Exact(0.001)),
    ] {
        let curves = spiral(grain);
        let items = |curve: &Curve<3>| {
            PathItem::Move(Move {
                curve: *curve,
                feed: Feed::Rate(60.0),
                mode,
                tag: 0,
            })
        };
        let time = Plan::of(&MILL, curves.iter().map(items)).time();
        println!("{name}: {time:.3} s of motion");
        group.bench_function(name, |bencher| {
            bencher.iter(|| black_box(Plan::of(&MILL, curves.iter().map(items))));
        });
    }
    group.finish();
}

criterion_group!(benches, plan);
criterion_main!(benches);
