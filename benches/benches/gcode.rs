//! Interpreting a program of 170,000 lines as a CAM post-processor writes them: at most a second.

use std::fmt::Write;
use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use syncline_gcode::{AxisSet, Interpreter, Setup};

const LINES: u32 = 170_000;

fn program() -> String {
    let mut text = String::from("G21 G90 G94 G17\nG0 X0 Y0 Z5\nF3000\n");
    for line in 0..LINES {
        let (x, y) = (line % 1999, line * 7 % 997);
        writeln!(
            text,
            "N{line} G1 X{}.{:04} Y{}.{:04} Z-0.{y:04}",
            x / 10,
            y * 7,
            y / 10,
            x
        )
        .unwrap_or_default();
    }
    text.push_str("M30\n");
    text
}

fn interpret(criterion: &mut Criterion) {
    let text = program();
    let mut group = criterion.benchmark_group("gcode");
    group.throughput(Throughput::Elements(u64::from(LINES)));
    group.sample_size(10);
    group.bench_function("170,000 lines", |bencher| {
        bencher.iter(|| {
            let setup = Setup::new(AxisSet::XYZ);
            let commands = Interpreter::from_text("part.ngc", text.clone(), setup);
            assert_eq!(black_box(commands).filter(Result::is_ok).count(), 170_002);
        });
    });
    group.finish();
}

criterion_group!(benches, interpret);
criterion_main!(benches);
