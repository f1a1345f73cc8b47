//! Every twin on a bus, whatever a master writes to its communication objects and whenever: time passes.

use crate::common::{Bench, id, ms};
use proptest::prelude::*;
use syncline_canopen::{CanId, Frame};
use syncline_drives::bus::Band;
use syncline_drives::twin::{Config, TWINS};

/// What a master or another node does.
#[derive(Clone, Debug)]
enum Step {
    /// To one of the device's writable communication objects, or to one of those that supervise.
    Write(bool, prop::sample::Index, u32),
    Frame(u16, Vec<u8>),
    Guard,
    Wait(u64),
}

fn step() -> impl Strategy<Value = Step> {
    // Times, identifiers in use and not, nodes to be watched with their times, SYNC to be generated.
    let values = prop::sample::select(vec![
        0u32,
        1,
        5,
        20,
        200,
        0x81,
        0x8000_0081,
        0x4000_0080,
        0x0002_0005,
        0x0003_0014,
        0x181,
        0x8000_0181,
    ]);
    let frame = prop_oneof![
        1 => prop::sample::select(vec![1u8, 2, 0x80]).prop_map(|command| (0, vec![command, 1])),
        1 => (0x702u16..0x704).prop_map(|id| (id, vec![5])),
        // Too short an R_PDO causes an EMCY; a segmented transfer that nobody ends times out.
        3 => Just((0x201, vec![])),
        1 => Just((0x601, vec![0x40, 0x08, 0x10, 0, 0, 0, 0, 0])),
        1 => Just((0x080, vec![])),
    ];
    prop_oneof![
        6 => (any::<bool>(), any::<prop::sample::Index>(), values)
            .prop_map(|(supervises, row, value)| Step::Write(supervises, row, value)),
        6 => frame.prop_map(|(id, data)| Step::Frame(id, data)),
        1 => Just(Step::Guard),
        2 => (0u64..40).prop_map(Step::Wait),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// The bus itself looks whether a device that was polled wants to be polled later.
    #[test]
    fn none_stays_due(
        kind in 0..TWINS.len(),
        steps in prop::collection::vec(step(), 1..80),
    ) {
        let twin = TWINS[kind];
        let entries = twin.dictionary.iter();
        let written: Vec<_> = entries.filter(|entry| entry.access.writable()).collect();
        let rows = |indices: std::ops::Range<u16>| {
            let rows = written.iter().filter(move |entry| indices.contains(&entry.address.index));
            rows.copied().collect::<Vec<_>>()
        };
        let [all, supervising] = [rows(0x1004..0x1A00), rows(0x100C..0x1018)];
        let mut bench = Bench::of([(twin.make)(&Config::new(id(1)))]);
        bench.wait(ms(500));
        bench.send(0x000, &[1, 1]);
        for step in steps {
            match step {
                Step::Write(supervises, row, value) => {
                    let rows = if supervises { &supervising } else { &all };
                    let Some(entry) = rows.get(row.index(rows.len().max(1))) else {
                        continue;
                    };
                    let [low, high] = entry.address.index.to_le_bytes();
                    let size = entry.data_type.size().min(4) as u8;
                    let mut request = vec![0x23 | (4 - size) << 2, low, high, entry.address.sub];
                    request.extend(value.to_le_bytes());
                    bench.send(0x601, &request);
                    bench.wait(ms(1));
                }
                Step::Frame(id, data) => bench.send(id, &data),
                Step::Guard => {
                    let request = Frame::remote(CanId::Standard(0x701), 1).unwrap();
                    bench.bus.send(Band::Acyclic, request);
                }
                Step::Wait(time) => bench.wait(ms(time)),
            }
        }
        bench.wait(ms(300));
    }
}
