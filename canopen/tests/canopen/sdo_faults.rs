//! SDO transfers on a bus that loses and repeats frames, and with a partner that never gets on: they
//! end, and what has arrived is what was sent.

use proptest::prelude::*;
use syncline_canopen::dictionary::{DataType::*, Dictionary, Entry, rw, table};
use syncline_canopen::sdo::{AbortCode, Client, Failure, Reason, Server};
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, CobId, Frame, Instant, NodeId};

const MS: Duration = Duration::from_millis(1);
const CAPACITY: usize = 1000;
const DOMAIN: Address = Address::new(0x2000, 0);

static TABLE: [Entry; 1] = table([rw(0x2000, 0, "Program", Domain(CAPACITY as u16))]);

/// What the bus makes of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fate {
    Arrives,
    Lost,
    /// The sender saw an error in the last bit, which the receiver did not see.
    Twice,
}

fn fates() -> impl Strategy<Value = Vec<Fate>> {
    let fate = prop_oneof![
        30 => Just(Fate::Arrives),
        1 => Just(Fate::Lost),
        1 => Just(Fate::Twice),
    ];
    prop::collection::vec(fate, 1..400)
}

struct Link {
    client: Client,
    server: Server,
    objects: Dictionary,
    now: Instant,
    /// Of one frame after the other, and so on from the beginning.
    fates: Vec<Fate>,
    carried: usize,
    /// How many frames of either side were aborts.
    aborts: usize,
}

type Outcome = Result<Vec<u8>, Failure>;

impl Link {
    fn new(block_size: u8, fates: Vec<Fate>) -> Self {
        let node = NodeId::new(7).expect("1…127");
        Self {
            client: Client::new(node, 20 * MS, CAPACITY),
            server: Server::new(CobId::r_sdo(node), CobId::t_sdo(node), CAPACITY)
                .with_block_size(block_size)
                .with_timeout(50 * MS),
            objects: Dictionary::new(&TABLE, node),
            now: Instant::ZERO,
            fates,
            carried: 0,
            aborts: 0,
        }
    }

    fn value(&self) -> &[u8] {
        let row = self.objects.row(0x2000, 0).expect("in the table");
        self.objects.bytes(row)
    }

    /// Those of `frames` that arrive, as often as they do.
    fn carry(&mut self, frames: &mut Vec<Frame>) -> Vec<Frame> {
        let mut arrived = Vec::new();
        for frame in frames.drain(..) {
            let fate = self.fates[self.carried % self.fates.len()];
            self.carried += 1;
            self.aborts += usize::from(frame.data()[0] == 0x80);
            let times = match fate {
                Fate::Arrives => 1,
                Fate::Lost => 0,
                Fate::Twice => 2,
            };
            arrived.extend((0..times).map(|_| frame));
        }
        arrived
    }

    /// Carries frames to and fro until the client is done, or no longer than anybody would wait.
    fn run(&mut self, mut requests: Vec<Frame>) -> Outcome {
        let mut answers = Vec::new();
        while self.carried < 200_000 {
            if requests.is_empty() && answers.is_empty() {
                let deadlines = self.client.deadline().into_iter();
                let due = deadlines.chain(self.server.deadline()).min();
                self.now = due.expect("whoever waits knows how long");
                self.server.poll(self.now, &mut answers);
                if let Some(failure) = self.client.poll(self.now, &mut requests) {
                    self.finish(requests);
                    return Err(failure);
                }
            }
            for frame in self.carry(&mut requests) {
                let (server, objects) = (&mut self.server, &mut self.objects);
                server.on_frame(self.now, &frame, objects, &mut answers);
            }
            for frame in self.carry(&mut answers) {
                if let Some(result) = self.client.on_frame(self.now, &frame, &mut requests) {
                    let result = result.map(<[u8]>::to_vec);
                    self.finish(requests);
                    return result;
                }
            }
        }
        panic!("the transfer does not end");
    }

    /// The client's last words arrive, and what the server says to them nobody hears.
    fn finish(&mut self, requests: Vec<Frame>) {
        for frame in requests {
            let (server, objects) = (&mut self.server, &mut self.objects);
            server.on_frame(self.now, &frame, objects, &mut Vec::new());
        }
        self.server.reset();
    }

    fn write(&mut self, data: &[u8]) -> Outcome {
        let mut requests = Vec::new();
        let started = (self.client).download_block(self.now, DOMAIN, data, &mut requests);
        started.expect("idle");
        self.run(requests)
    }

    fn read(&mut self, block_size: u8) -> Outcome {
        let mut requests = Vec::new();
        let started = (self.client).upload_block(self.now, DOMAIN, block_size, &mut requests);
        started.expect("idle");
        self.run(requests)
    }
}

proptest! {
    #[test]
    fn block_transfers_end_and_deliver_nothing_wrong(
        data in prop::collection::vec(any::<u8>(), 0..CAPACITY),
        sizes in (1u8..=127, 1u8..=127),
        fates in fates(),
    ) {
        let mut link = Link::new(sizes.0, fates);
        match link.write(&data) {
            Ok(_) => prop_assert_eq!(link.value(), &data),
            Err(_) => prop_assert!(link.value().is_empty() || link.value() == data),
        }
        let row = link.objects.row(0x2000, 0).expect("in the table");
        link.objects.set_bytes(row, &data);
        if let Ok(read) = link.read(sizes.1) {
            prop_assert_eq!(read, data);
        }
    }

    /// A segment that comes twice, or the last acknowledgement: the transfer does not even notice.
    #[test]
    fn a_repeated_segment_changes_nothing(
        data in prop::collection::vec(any::<u8>(), 1..300),
        sizes in (2u8..=20, 2u8..=20),
        place in any::<prop::sample::Index>(),
        writes in any::<bool>(),
    ) {
        let mut link = Link::new(sizes.0, vec![Fate::Arrives]);
        let row = link.objects.row(0x2000, 0).expect("in the table");
        if !writes {
            link.objects.set_bytes(row, &data);
        }
        // The initiation's request and answer come first, "start" before an upload, and an acknowledgement
        // behind each block.
        let segments = data.len().div_ceil(7);
        let (before, size) = if writes { (2, sizes.0) } else { (3, sizes.1) };
        let segment = place.index(segments + 1);
        let place = before + segment + segment.min(segments - 1) / usize::from(size);
        link.fates = (0..1000).map(|it| if it == place { Fate::Twice } else { Fate::Arrives }).collect();
        if writes {
            prop_assert_eq!(link.write(&data), Ok(vec![]));
            prop_assert_eq!(link.value(), data);
        } else {
            prop_assert_eq!(link.read(sizes.1), Ok(data));
        }
        prop_assert_eq!(link.aborts, 0);
    }

    /// A server that says anything, again and again, cannot hold a client for ever.
    #[test]
    fn no_answers_hold_a_client_for_ever(
        kind in 0u8..4,
        answers in prop::collection::vec(answer(), 1..12),
    ) {
        let node = NodeId::new(7).expect("1…127");
        let mut client = Client::new(node, 20 * MS, CAPACITY);
        let (mut now, mut tx) = (Instant::ZERO, Vec::new());
        match kind {
            0 => client.upload(now, DOMAIN, &mut tx),
            1 => client.download(now, DOMAIN, &[7; CAPACITY], &mut tx),
            2 => client.upload_block(now, DOMAIN, 4, &mut tx),
            _ => client.download_block(now, DOMAIN, &[7; CAPACITY], &mut tx),
        }
        .expect("idle");
        let begin = match kind {
            0 => [0x40, 0, 0x20, 0, 0, 0, 0, 0],
            1 => [0x60, 0, 0x20, 0, 0, 0, 0, 0],
            2 => [0xC4, 0, 0x20, 0, 0, 0, 0, 0],
            _ => [0xA4, 0, 0x20, 0, 4, 0, 0, 0],
        };
        for bytes in [begin].iter().chain(answers.iter().cycle()).take(20_000) {
            tx.clear();
            now += MS;
            let frame = Frame::new(CobId::t_sdo(node), bytes);
            if client.poll(now, &mut tx).is_some() || client.on_frame(now, &frame, &mut tx).is_some() {
                break;
            }
        }
        prop_assert!(!client.is_busy());
    }
}

proptest! {
    /// Where each segment is as the one before, none is taken for one that came twice.
    #[test]
    fn data_may_be_all_the_same(
        byte in any::<u8>(),
        length in 0..CAPACITY,
        sizes in (1u8..=4, 1u8..=4),
    ) {
        let mut link = Link::new(sizes.0, vec![Fate::Arrives]);
        let data = vec![byte; length];
        prop_assert_eq!(link.write(&data), Ok(vec![]));
        prop_assert_eq!(link.value(), &data);
        prop_assert_eq!(link.read(sizes.1), Ok(data));
    }
}

/// What a server may say behind the beginning.
fn answer() -> impl Strategy<Value = [u8; 8]> {
    let first = prop_oneof![
        // Segments, with and without data, and acknowledgements of such.
        prop::sample::select(&[0x00u8, 0x10, 0x0E, 0x1E, 0x20, 0x30][..]),
        // Of blocks: segments; end, acknowledgement.
        0x01u8..=0x05,
        0x81u8..=0x85,
        prop::sample::select(&[0xC1u8, 0xA1, 0xA2][..]),
    ];
    (first, 0u8..=5, 1u8..=5).prop_map(|(first, count, size)| [first, count, size, 0, 0, 0, 0, 0])
}

/// Its time-outs do not help: it is never silent.
#[test]
fn a_server_that_sends_empty_segments_is_given_up() {
    let mut link = Link::new(127, vec![Fate::Arrives]);
    let (now, mut tx) = (Instant::ZERO, Vec::new());
    let started = link.client.upload(now, DOMAIN, &mut tx);
    started.expect("idle");
    let begin = [0x40, 0, 0x20, 0, 0, 0, 0, 0];
    let [even, odd] = [0x0E, 0x1E].map(|first| [first, 0, 0, 0, 0, 0, 0, 0]);
    let mut answers = [begin].into_iter().chain([even, odd].into_iter().cycle());
    let ended = answers.by_ref().take(100).any(|answer| {
        let frame = Frame::new(CobId::new(0x587).expect("11 bits"), &answer);
        link.client.on_frame(now, &frame, &mut tx).is_some()
    });
    assert!(ended);
}

/// The bus is not there for one block after the other of which nothing arrives.
#[test]
fn a_client_that_takes_nothing_is_given_up() {
    let mut link = Link::new(127, vec![Fate::Arrives]);
    let row = link.objects.row(0x2000, 0).expect("in the table");
    link.objects.set_bytes(row, &[7; 100]);
    let mut ask = |data: [u8; 8]| {
        let mut answers = Vec::new();
        let frame = Frame::new(CobId::new(0x607).expect("11 bits"), &data);
        let (server, objects) = (&mut link.server, &mut link.objects);
        server.on_frame(Instant::ZERO, &frame, objects, &mut answers);
        answers
    };
    ask([0xA4, 0, 0x20, 0, 4, 0, 0, 0]);
    assert_eq!(ask([0xA3, 0, 0, 0, 0, 0, 0, 0]).len(), 4);
    let nothing = [0xA2, 0, 4, 0, 0, 0, 0, 0];
    let blocks = (0..1000).take_while(|_| ask(nothing).len() == 4).count();
    assert_eq!(blocks, 32);
    assert!(!link.server.is_busy());
}

#[test]
fn a_server_that_takes_nothing_is_given_up() {
    let mut link = Link::new(127, vec![Fate::Arrives]);
    let mut tx = Vec::new();
    let started = (link.client).download_block(Instant::ZERO, DOMAIN, &[7; 100], &mut tx);
    started.expect("idle");
    let answers = [[0xA4, 0, 0x20, 0, 4, 0, 0, 0], [0xA2, 0, 4, 0, 0, 0, 0, 0]];
    let again = answers[..1]
        .iter()
        .chain(std::iter::repeat_n(&answers[1], 100));
    let mut ended = again.filter_map(|answer| {
        let frame = Frame::new(CobId::new(0x587).expect("11 bits"), answer);
        let result = link.client.on_frame(Instant::ZERO, &frame, &mut tx)?;
        Some(result.map(<[u8]>::to_vec))
    });
    let failure = ended.next().expect("given up").expect_err("in vain");
    assert_eq!(failure.reason, Reason::GivenUp(AbortCode::SequenceNumber));
}

/// An answer to the transfer before, which was given up, names no object where it is of a segment.
#[test]
fn late_answers_are_none_of_the_next_transfer() {
    let late: [[u8; 8]; 8] = [
        [0x00, 1, 2, 3, 4, 5, 6, 7],
        [0x1D, 1, 0, 0, 0, 0, 0, 0],
        [0x20, 0, 0, 0, 0, 0, 0, 0],
        [0x30, 0, 0, 0, 0, 0, 0, 0],
        [0x41, 1, 0x20, 0, 4, 0, 0, 0],
        [0xA2, 3, 4, 0, 0, 0, 0, 0],
        [0xA1, 0, 0, 0, 0, 0, 0, 0],
        [0xC1, 0, 0, 0, 0, 0, 0, 0],
    ];
    for (late, kind) in late
        .into_iter()
        .flat_map(|it| [0, 1, 2, 3].map(|kind| (it, kind)))
    {
        let mut link = Link::new(127, vec![Fate::Arrives]);
        let (now, client, mut tx) = (Instant::ZERO, &mut link.client, Vec::new());
        match kind {
            0 => client.upload(now, DOMAIN, &mut tx),
            1 => client.download(now, DOMAIN, &[1, 2], &mut tx),
            2 => client.upload_block(now, DOMAIN, 4, &mut tx),
            _ => client.download_block(now, DOMAIN, &[1, 2], &mut tx),
        }
        .expect("idle");
        let frame = Frame::new(CobId::new(0x587).expect("11 bits"), &late);
        let heard = client.on_frame(now, &frame, &mut Vec::new());
        assert_eq!(heard, None, "{late:02X?}, {kind}");
        let expected = [[].as_slice(), &[], &[], &[]];
        assert!(
            link.run(tx).is_ok_and(|read| read == expected[kind]),
            "{late:02X?}, {kind}"
        );
    }
}
