//! Expedited SDO transfers a second against a node with a model's whole dictionary, in process:
//! request in, answer out; of every model, against the node alone and against its twin. Each pass goes once
//! through every object: uploads of those that can be read, downloads of what is there to those that take it.

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use syncline_canopen::dictionary::{Dictionary, Entry};
use syncline_canopen::node::{LocalNode, Options};
use syncline_canopen::time::Duration;
use syncline_canopen::{CobId, Frame, Instant, NodeId};
use syncline_drives::model::{MODELS, Model};
use syncline_drives::twin::{Config, Kind};

/// An upload of each object that an expedited transfer can carry.
fn uploads(model: &Model, id: NodeId) -> Vec<Frame> {
    let number = |entry: &&Entry| {
        entry.data_type.is_number() && entry.data_type.size() <= 4 && entry.access.readable()
    };
    let request = |entry: &Entry| {
        let [low, high] = entry.address.index.to_le_bytes();
        let message = [0x40, low, high, entry.address.sub, 0, 0, 0, 0];
        Frame::new(CobId::r_sdo(id), &message)
    };
    let entries = model.dictionary.iter();
    entries.filter(number).map(request).collect()
}

/// The download of the value that an upload was answered with: as many bytes, the same unused.
fn download(id: NodeId, upload: &Frame) -> Option<Frame> {
    let mut message: [u8; 8] = upload.data().try_into().ok()?;
    message[0] = 0x23 | message[0] & 0x0C;
    Some(Frame::new(CobId::r_sdo(id), &message))
}

/// Measures uploads and downloads against what `answer` stands for.
fn measure(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    model: &Model,
    id: NodeId,
    mut answer: impl FnMut(&Frame, &mut Vec<Frame>),
) {
    let mut answers = Vec::with_capacity(8);
    let mut served = |request: &Frame| {
        answers.clear();
        answer(request, &mut answers);
        let answer = answers.first().copied();
        answer.filter(|answer| answer.data()[0] != 0x80)
    };
    let mut downloads = Vec::new();
    let mut uploads = uploads(model, id);
    uploads.retain(|request| {
        let told = served(request);
        downloads.extend(told.and_then(|told| download(id, &told)));
        told.is_some()
    });
    downloads.retain(|request| served(request).is_some());
    for (what, requests) in [("upload", uploads), ("download", downloads)] {
        assert!(requests.len() > 10, "{name}: {} to {what}", requests.len());
        group.throughput(Throughput::Elements(requests.len() as u64));
        group.bench_function(format!("{name}/{what}"), |bencher| {
            bencher.iter(|| {
                for request in &requests {
                    black_box(served(request));
                }
            });
        });
    }
}

fn sdo(c: &mut Criterion) {
    let id = NodeId::new(1).expect("1…127");
    for model in MODELS {
        let mut group = c.benchmark_group(format!("sdo/{}", model.name));

        let mut objects = Dictionary::new(model.dictionary, id);
        let mut node = LocalNode::new(id, &objects, Options::default());
        node.power_on(Instant::ZERO);
        node.poll(Instant::ZERO, &mut objects, &mut Vec::new());
        measure(&mut group, "node", model, id, |request, answers| {
            node.on_frame(Instant::ZERO, request, &mut objects, answers);
        });

        let kind = Kind::by_name(model.name).expect("every model has a twin");
        let mut twin = (kind.make)(&Config {
            prompt: true,
            boot_time: Some(Duration::ZERO),
            ..Config::new(id)
        });
        let now = Instant::from_nanos(1_000_000);
        twin.poll(now, &mut Vec::new());
        measure(&mut group, "twin", model, id, |request, answers| {
            twin.on_frame(now, request, answers);
        });
        group.finish();
    }
}

criterion_group!(benches, sdo);
criterion_main!(benches);
