//! Expedited SDO transfers a second against a node with a model's whole dictionary, in process:
//! request in, answer out. Each pass goes through every object once.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use syncline_canopen::dictionary::{DataType, Dictionary, Entry};
use syncline_canopen::node::{Node, Options};
use syncline_canopen::time::Duration;
use syncline_canopen::{CobId, Frame, Instant, NodeId, Transmit};
use syncline_drives::model::{Model, REFERENCE};
use syncline_drives::twin::{Config, Kind};

/// Keeps the last answer and counts those that are no abort.
#[derive(Default)]
struct Answers {
    served: usize,
    refused: usize,
}

impl Transmit for Answers {
    fn transmit(&mut self, frame: Frame) {
        match black_box(frame).data() {
            [0x80, ..] => self.refused += 1,
            _ => self.served += 1,
        }
    }
}

/// One request for each object that an expedited transfer can carry.
fn requests(model: &Model, id: NodeId, command: impl Fn(&Entry) -> Option<u8>) -> Vec<Frame> {
    let number = |entry: &&Entry| {
        entry.data_type.is_number() && entry.data_type.size() <= 4 && entry.access.readable()
    };
    let request = |entry: &Entry| {
        let [low, high] = entry.address.index.to_le_bytes();
        let message = [command(entry)?, low, high, entry.address.sub, 0, 0, 0, 0];
        Some(Frame::new(CobId::r_sdo(id), &message))
    };
    let entries = model.dictionary.iter();
    entries.filter(number).filter_map(request).collect()
}

fn upload(_: &Entry) -> Option<u8> {
    Some(0x40)
}

/// Writes 0 to what a write of 0 does not set in motion and to which 0 is no error: of the reference
/// model the objects of its loops.
fn download(entry: &Entry) -> Option<u8> {
    let plain = entry.address.index >= 0x3010
        && entry.address.index < 0x3016
        && entry.access.writable()
        && entry.range.is_none();
    let unused = 4 - entry.data_type.size() as u8;
    (plain && entry.data_type != DataType::Bool).then_some(0x23 | unused << 2)
}

fn sdo(c: &mut Criterion) {
    let id = NodeId::new(1).expect("1…127");
    let mut group = c.benchmark_group("sdo");
    let model = REFERENCE;
    for (name, requests) in [
        ("upload", requests(model, id, upload)),
        ("download", requests(model, id, download)),
    ] {
        group.throughput(Throughput::Elements(requests.len() as u64));

        let mut objects = Dictionary::new(model.dictionary, id);
        let mut node = Node::new(id, &objects, Options::default());
        node.power_on(Instant::ZERO);
        node.poll(Instant::ZERO, &mut objects, &mut Answers::default());
        let mut pass = || {
            let mut answers = Answers::default();
            for request in &requests {
                node.on_frame(Instant::ZERO, request, &mut objects, &mut answers);
            }
            answers
        };
        assert_eq!(
            (pass().served, pass().refused),
            (requests.len(), 0),
            "{name}"
        );
        group.bench_function(format!("node/{name}"), |b| b.iter(&mut pass));

        let kind = Kind::by_name(model.name).expect("every model has a twin");
        let mut twin = (kind.make)(&Config {
            prompt: true,
            boot_time: Some(Duration::ZERO),
            ..Config::new(id)
        });
        let now = Instant::from_nanos(1_000_000);
        twin.poll(now, &mut Answers::default());
        let mut pass = || {
            let mut answers = Answers::default();
            for request in &requests {
                twin.on_frame(now, request, &mut answers);
            }
            answers
        };
        assert_eq!(
            (pass().served, pass().refused),
            (requests.len(), 0),
            "{name}"
        );
        group.bench_function(format!("twin/{name}"), |b| b.iter(&mut pass));
    }
    group.finish();
}

criterion_group!(benches, sdo);
criterion_main!(benches);
