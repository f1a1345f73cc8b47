//! What a cycle costs: the controller's share for 1 to 64 axes, packing of PDOs, the frame codecs,
//! the exact length of a frame, and the simulated bus.

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, SamplingMode, criterion_group, criterion_main};
use std::hint::black_box;
use std::time::{Duration, Instant as Clock};
use syncline_canopen::{CobId, Frame, Instant};
use syncline_controller::bench::rig::{Shape, Shuttle, ready_machine};
use syncline_controller::bus_log::candump::Line;
use syncline_controller::control::Wake;
use syncline_controller::port::socketcan::{from_raw, to_raw};
use syncline_drives::bus::{Band, BitRate, BusNode, SimBus, frame_bits};
use syncline_drives::model::{Increments, PowerCommand, REFERENCE, Setpoint};

/// What the processor's caches hold before a wake-up for the setpoints.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Caches {
    /// What the cycle before left.
    Warm,
    /// Nothing of the cycle.
    Cold,
    /// As after a spin, which begins with a rehearsal.
    Rehearsed,
}

/// Beyond what any cache holds, in bytes.
const BEYOND_CACHES: usize = 128 << 20;

/// Both wake-ups of a cycle, controller only: frames in, supervision, sampling, scaling, frames out.
fn compute<const N: usize>(group: &mut BenchmarkGroup<'_, WallTime>, axes: usize, caches: Caches) {
    let shape = Shape::on_fewest_buses(axes, Duration::from_millis(4)).expect("it fits");
    let mut machine = ready_machine::<N>(&shape);
    let mut plan = Shuttle::new(axes);
    let mut memory = vec![
        1_u8;
        if caches == Caches::Warm {
            0
        } else {
            BEYOND_CACHES
        }
    ];
    let mut cycle = || {
        while machine.controller.room() > 0 {
            machine.controller.accept(plan.instruction());
        }
        let mut spent = Duration::ZERO;
        for _ in 0..2 {
            let now = machine
                .controller
                .next_wake()
                .map_or(Instant::ZERO, Wake::at);
            machine.collect(now).expect("a simulated bus");
            if machine.setpoints_are_next() {
                (memory.iter_mut().step_by(64)).for_each(|byte| *byte = byte.wrapping_add(1));
                black_box(&memory);
                if caches == Caches::Rehearsed {
                    machine.controller.rehearse();
                }
            }
            let began = Clock::now();
            machine.compute(now);
            spent += began.elapsed();
            machine.send().expect("a simulated bus");
        }
        spent
    };
    group.bench_function(format!("{caches:?}/{axes}"), |bencher| {
        bencher.iter_custom(|cycles| (0..cycles).map(|_| cycle()).sum());
    });
}

fn cycles(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("compute per cycle");
    compute::<9>(&mut group, 1, Caches::Warm);
    compute::<9>(&mut group, 4, Caches::Warm);
    compute::<9>(&mut group, 6, Caches::Warm);
    compute::<9>(&mut group, 8, Caches::Warm);
    compute::<16>(&mut group, 16, Caches::Warm);
    compute::<64>(&mut group, 64, Caches::Warm);
    // One at a time: emptying the caches takes a thousand times as long as the cycle.
    group.sampling_mode(SamplingMode::Flat).sample_size(100);
    group.warm_up_time(Duration::from_nanos(1));
    group.measurement_time(Duration::from_nanos(1));
    for caches in [Caches::Cold, Caches::Rehearsed] {
        compute::<9>(&mut group, 1, caches);
        compute::<9>(&mut group, 6, caches);
        compute::<64>(&mut group, 64, caches);
    }
}

fn frames(criterion: &mut Criterion) {
    let shape = Shape {
        model: REFERENCE,
        axes: 1,
        buses: 1,
        period: Duration::from_millis(2),
    };
    let mut device = shape.device(0);
    let drive = device.drive_mut().expect("axes have drives");
    let setpoint = Setpoint::at(Increments::from(1_234_567));
    let mut frames = [Frame::new(CobId::SYNC, &[])];
    criterion.bench_function("pack an R_PDO", |bencher| {
        bencher.iter(|| {
            drive.encode(PowerCommand::Run, black_box(setpoint), &mut frames);
            frames
        });
    });
    let [frame] = frames;
    criterion.bench_function("unpack a T_PDO", |bencher| {
        bencher.iter(|| {
            let data = black_box(frame.data());
            (drive.status(0, data), drive.sample(0, data))
        });
    });
    criterion.bench_function("a frame to the kernel's form and back", |bencher| {
        bencher.iter(|| from_raw(black_box(&to_raw(black_box(&frame)))));
    });
    let line = Line {
        at: Duration::from_micros(1_436_509_052_249_713),
        bus: "can0",
        frame,
    };
    criterion.bench_function("a frame to a candump line", |bencher| {
        bencher.iter(|| black_box(&line).to_string());
    });
    let line = line.to_string();
    criterion.bench_function("a frame from a candump line", |bencher| {
        bencher.iter(|| Line::parse(black_box(&line)));
    });
    criterion.bench_function("exact bits of a frame", |bencher| {
        bencher.iter(|| frame_bits(black_box(&frame)));
    });
}

/// Nobody answers: the bus alone.
struct Silent;

impl BusNode for Silent {
    fn on_frame(&mut self, _: Instant, _: &Frame, _: &mut dyn syncline_canopen::Transmit) {}
    fn poll(&mut self, _: Instant, _: &mut dyn syncline_canopen::Transmit) {}
    fn deadline(&self) -> Option<Instant> {
        None
    }
}

fn bus(criterion: &mut Criterion) {
    let mut sim = SimBus::new(BitRate::from_kbit(1000).expect("1 Mbit/s"));
    for _ in 0..6 {
        sim.attach(Silent);
    }
    criterion.bench_function("a frame over the simulated bus, 6 nodes", |bencher| {
        bencher.iter(|| {
            sim.send(Band::Sync, Frame::new(CobId::SYNC, &[]));
            let end = sim.now() + Duration::from_micros(200);
            sim.advance_to(end, &mut |sent| {
                black_box(sent);
            });
            while let Some(received) = sim.receive() {
                black_box(received);
            }
        });
    });
}

criterion_group!(benches, cycles, frames, bus);
criterion_main!(benches);
