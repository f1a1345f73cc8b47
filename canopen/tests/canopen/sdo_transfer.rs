//! SDO client and server against each other: what is written is what is read, whatever its
//! length, in each kind of transfer, and with block segments lost on the way.

use proptest::prelude::*;
use syncline_canopen::dictionary::{DataType::*, Dictionary, Entry, ro, rw, table};
use syncline_canopen::sdo::{AbortCode, Client, Direction, Failure, NotStarted, Reason, Server};
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, CobId, Frame, Instant, NodeId};

const CAPACITY: usize = 2000;
const TIMEOUT: Duration = Duration::from_millis(100);
const DOMAIN: Address = Address::new(0x2000, 0);
const NUMBER: Address = Address::new(0x2001, 0);

static TABLE: [Entry; 3] = table([
    rw(0x2000, 0, "Program", Domain(CAPACITY as u16)),
    rw(0x2001, 0, "Number", U32).range(0, 9),
    ro(0x2002, 0, "Text", Text(8)).default_text("text"),
]);

#[derive(Clone, Copy, Debug)]
enum Kind {
    Ordinary,
    Block,
}

struct Pair {
    client: Client,
    server: Server,
    objects: Dictionary,
    requests: Vec<Frame>,
    random: u32,
    /// Loses one block segment in so many, never a block's last.
    lose_one_in: Option<u32>,
}

type Outcome = Result<Vec<u8>, Failure>;

impl Pair {
    fn new(block_size: u8) -> Self {
        let node = NodeId::new(7).expect("node");
        Self {
            client: Client::new(node, TIMEOUT, CAPACITY),
            server: Server::new(CobId::r_sdo(node), CobId::t_sdo(node), CAPACITY)
                .with_block_size(block_size),
            objects: Dictionary::new(&TABLE, node),
            requests: Vec::new(),
            random: 1,
            lose_one_in: None,
        }
    }

    fn write(&mut self, kind: Kind, address: Address, data: &[u8]) -> Outcome {
        let (now, tx) = (Instant::ZERO, &mut self.requests);
        match kind {
            Kind::Ordinary => self.client.download(now, address, data, tx),
            Kind::Block => self.client.download_block(now, address, data, tx),
        }
        .expect("idle");
        self.run()
    }

    fn read(&mut self, kind: Kind, address: Address, block_size: u8) -> Outcome {
        let (now, tx) = (Instant::ZERO, &mut self.requests);
        match kind {
            Kind::Ordinary => self.client.upload(now, address, tx),
            Kind::Block => self.client.upload_block(now, address, block_size, tx),
        }
        .expect("idle");
        self.run()
    }

    fn loses(&mut self, frame: &Frame, burst: bool) -> bool {
        let first = frame.data()[0];
        self.random = self
            .random
            .wrapping_mul(1_664_525)
            .wrapping_add(1_013_904_223);
        burst
            && first & 0x80 == 0
            && self
                .lose_one_in
                .is_some_and(|n| (self.random >> 8).is_multiple_of(n))
    }

    /// Carries frames to and fro until the transfer ends.
    fn run(&mut self) -> Outcome {
        for _ in 0..10_000 {
            let mut answers = Vec::new();
            let requests = std::mem::take(&mut self.requests);
            for (place, frame) in requests.iter().enumerate() {
                if !self.loses(frame, place + 1 < requests.len()) {
                    self.server
                        .on_frame(Instant::ZERO, frame, &mut self.objects, &mut answers);
                }
            }
            for (place, frame) in answers.iter().enumerate() {
                if self.loses(frame, place + 1 < answers.len()) {
                    continue;
                }
                if let Some(result) = self
                    .client
                    .on_frame(Instant::ZERO, frame, &mut self.requests)
                {
                    let result = result.map(<[u8]>::to_vec);
                    let last_words = std::mem::take(&mut self.requests);
                    for frame in last_words {
                        self.server.on_frame(
                            Instant::ZERO,
                            &frame,
                            &mut self.objects,
                            &mut Vec::new(),
                        );
                    }
                    assert!(!self.client.is_busy() && !self.server.is_busy());
                    return result;
                }
            }
            if self.requests.is_empty() {
                panic!("the transfer stands still");
            }
        }
        panic!("the transfer does not end");
    }
}

proptest! {
    #[test]
    fn what_is_written_is_read(
        data in proptest::collection::vec(any::<u8>(), 0..CAPACITY),
        blocks in any::<[bool; 2]>(),
        sizes in (1u8..=127, 1u8..=127),
        lose_one_in in proptest::option::of(2u32..40),
    ) {
        let kind = |block| if block { Kind::Block } else { Kind::Ordinary };
        let mut pair = Pair::new(sizes.0);
        pair.lose_one_in = lose_one_in;
        prop_assert_eq!(pair.write(kind(blocks[0]), DOMAIN, &data), Ok(vec![]));
        prop_assert_eq!(pair.read(kind(blocks[1]), DOMAIN, sizes.1), Ok(data));
    }

    #[test]
    fn abort_codes_round_trip(code in any::<u32>()) {
        prop_assert_eq!(AbortCode::from(code).code(), code);
    }

    /// Whatever comes in, neither side panics, and both serve the next transfer.
    #[test]
    fn noise_does_no_harm(
        messages in proptest::collection::vec((any::<bool>(), any::<[u8; 8]>()), 0..60),
        start in 0..4u8,
    ) {
        let mut pair = Pair::new(20);
        let mut sink = Vec::new();
        let now = Instant::ZERO;
        match start {
            0 => pair.client.upload(now, DOMAIN, &mut sink),
            1 => pair.client.download(now, DOMAIN, &[1; 100], &mut sink),
            2 => pair.client.upload_block(now, DOMAIN, 9, &mut sink),
            _ => pair.client.download_block(now, DOMAIN, &[1; 100], &mut sink),
        }
        .expect("idle");
        for (to_server, bytes) in messages {
            if to_server {
                let frame = Frame::new(CobId::new(0x607).expect("id"), &bytes);
                pair.server.on_frame(now, &frame, &mut pair.objects, &mut sink);
            } else {
                let frame = Frame::new(CobId::new(0x587).expect("id"), &bytes);
                let _ = pair.client.on_frame(now, &frame, &mut sink);
            }
        }
        pair.client.abort(AbortCode::General, &mut sink);
        pair.server.reset();
        prop_assert_eq!(pair.write(Kind::Ordinary, NUMBER, &[5, 0, 0, 0]), Ok(vec![]));
        prop_assert_eq!(pair.read(Kind::Ordinary, NUMBER, 1), Ok(vec![5, 0, 0, 0]));
    }
}

#[test]
fn refusals_reach_the_caller() {
    let mut pair = Pair::new(127);
    for kind in [Kind::Ordinary, Kind::Block] {
        let failure = pair.write(kind, NUMBER, &[10, 0, 0, 0]).expect_err("range");
        assert_eq!(failure.reason, Reason::Refused(AbortCode::InvalidValue));
        assert_eq!(
            failure.to_string(),
            "SDO write 2001h:0 aborted 0609 0030h \"invalid value for parameter\""
        );
        let failure = pair.write(kind, Address::new(0x2002, 0), b"xxxxx");
        assert_eq!(
            failure.expect_err("read only").reason,
            Reason::Refused(AbortCode::ReadOnly)
        );
    }
}

#[test]
fn server_without_block_transfer_refuses_it() {
    let mut pair = Pair::new(127);
    pair.server = pair.server.without_block_transfer();
    let refused = Reason::Refused(AbortCode::CommandSpecifier);
    let up = pair.read(Kind::Block, DOMAIN, 127).expect_err("refused");
    let down = pair
        .write(Kind::Block, DOMAIN, b"12345")
        .expect_err("refused");
    assert_eq!((up.reason, down.reason), (refused, refused));
}

#[test]
fn damaged_block_is_refused_by_its_crc() {
    let mut pair = Pair::new(127);
    pair.client
        .download_block(Instant::ZERO, DOMAIN, &[7; 30], &mut pair.requests)
        .expect("idle");
    let mut answers = Vec::new();
    let mut reason = None;
    for _ in 0..4 {
        for frame in std::mem::take(&mut pair.requests) {
            let mut bytes = [0; 8];
            bytes.copy_from_slice(frame.data());
            if bytes[0] == 2 {
                bytes[3] ^= 0x10;
            }
            let frame = Frame::new(frame.id(), &bytes);
            pair.server
                .on_frame(Instant::ZERO, &frame, &mut pair.objects, &mut answers);
        }
        for frame in std::mem::take(&mut answers) {
            if let Some(Err(failure)) =
                pair.client
                    .on_frame(Instant::ZERO, &frame, &mut pair.requests)
            {
                reason = Some(failure.reason);
            }
        }
    }
    assert_eq!(reason, Some(Reason::Refused(AbortCode::Crc)));
    assert!(
        pair.objects
            .bytes(pair.objects.row(0x2000, 0).expect("row"))
            .is_empty()
    );
}

/// What the client makes of a node's answers, one after the other.
fn answered(start: impl FnOnce(&mut Client, &mut Vec<Frame>), answers: &[[u8; 8]]) -> Outcome {
    let mut client = Pair::new(127).client;
    let mut tx = Vec::new();
    start(&mut client, &mut tx);
    for answer in answers {
        let frame = Frame::new(CobId::new(0x587).expect("id"), answer);
        if let Some(result) = client.on_frame(Instant::ZERO, &frame, &mut tx) {
            return result.map(<[u8]>::to_vec);
        }
    }
    panic!("no end after {tx:?}");
}

#[test]
fn wrong_answers_are_given_up() {
    let upload = |client: &mut Client, tx: &mut Vec<Frame>| {
        let started = client.upload(Instant::ZERO, DOMAIN, tx);
        started.expect("idle");
    };
    let block = |client: &mut Client, tx: &mut Vec<Frame>| {
        let started = client.upload_block(Instant::ZERO, DOMAIN, 1, tx);
        started.expect("idle");
    };
    let segments = [[0x41, 0, 0x20, 0, 8, 0, 0, 0], [0x01, 1, 2, 3, 4, 5, 6, 7]];
    let blocks = |crc: u8| {
        [
            [0xC6, 0, 0x20, 0, 7, 0, 0, 0],
            [0x81, 1, 2, 3, 4, 5, 6, 7],
            [0xC1, crc, 0xB8, 0, 0, 0, 0, 0],
        ]
    };
    let given_up = |outcome: Outcome| outcome.expect_err("given up").reason;
    for (outcome, code) in [
        (answered(upload, &segments), AbortCode::LengthMismatch),
        (answered(block, &blocks(0)), AbortCode::Crc),
        (
            answered(upload, &[[0x41, 0, 0x20, 0, 0xFF, 0xFF, 0, 0]]),
            AbortCode::OutOfMemory,
        ),
        (
            answered(upload, &[[0x60, 0, 0x20, 0, 0, 0, 0, 0]]),
            AbortCode::CommandSpecifier,
        ),
    ] {
        assert_eq!(given_up(outcome), Reason::GivenUp(code));
    }
    // An abort that names another object belongs to an earlier transfer.
    let late_abort = [0x80, 1, 0x20, 0, 0, 0, 4, 5];
    let value = [0x4F, 0, 0x20, 0, 9, 0, 0, 0];
    assert_eq!(answered(upload, &[late_abort, value]), Ok(vec![9]));
}

#[test]
fn silent_node_is_given_up() {
    let mut pair = Pair::new(127);
    let mut tx = Vec::new();
    pair.client
        .upload(Instant::ZERO, NUMBER, &mut tx)
        .expect("idle");
    assert_eq!(
        pair.client.upload(Instant::ZERO, NUMBER, &mut tx),
        Err(NotStarted::Busy)
    );
    let deadline = pair.client.deadline().expect("waiting");
    assert_eq!(deadline, Instant::ZERO + TIMEOUT);
    assert_eq!(pair.client.poll(Instant::ZERO, &mut tx), None);
    assert_eq!(
        pair.client.poll(deadline, &mut tx),
        Some(Failure {
            direction: Direction::Upload,
            address: NUMBER,
            reason: Reason::TimedOut
        })
    );
    assert_eq!(
        format!("{tx:?}"),
        "[607#4001200000000000, 607#8001200000000405]"
    );
    // The answer comes after all, while the next transfer waits for its own.
    pair.client
        .upload(deadline, DOMAIN, &mut tx)
        .expect("idle again");
    let late = Frame::new(
        CobId::new(0x587).expect("id"),
        &[0x43, 1, 0x20, 0, 9, 0, 0, 0],
    );
    assert_eq!(pair.client.on_frame(deadline, &late, &mut tx), None);
    assert!(pair.client.is_busy());
}
