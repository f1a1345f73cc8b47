//! Heartbeat, guarding, EMCY and SYNC as time passes.

use syncline_canopen::emcy::{self, Emergency};
use syncline_canopen::nmt::State;
use syncline_canopen::time::Duration;
use syncline_canopen::{CobId, Frame, Instant, NodeId, guarding, heartbeat, sync};

const MS: Duration = Duration::from_millis(1);

fn at(ms: u64) -> Instant {
    Instant::from_nanos(ms * 1_000_000)
}

fn node() -> NodeId {
    NodeId::new(3).expect("1…127")
}

#[test]
fn heartbeats_keep_their_pace_and_are_missed_once() {
    let mut producer = heartbeat::Producer::new();
    let mut consumer = heartbeat::Consumer::new(node(), 25 * MS);
    let mut tx: Vec<Frame> = Vec::new();
    producer.start(at(10), 10 * MS);
    let mut told = Vec::new();
    for ms in 0..=100 {
        if ms < 50 {
            producer.poll(
                at(ms),
                CobId::error_control(node()),
                State::Operational,
                &mut tx,
            );
        }
        for frame in tx.drain(..) {
            told.extend(
                consumer
                    .on_frame(at(ms), &frame)
                    .map(|event| (ms, Ok(event))),
            );
        }
        if consumer.poll(at(ms)) {
            told.push((ms, Err("missing")));
        }
    }
    assert_eq!(
        told,
        [
            (10, Ok(heartbeat::Event::State(State::Operational))),
            (65, Err("missing")) // last heard at 40 ms
        ]
    );
    let boot_up = heartbeat::encode(node(), State::Initialising);
    assert_eq!(
        consumer.on_frame(at(200), &boot_up),
        Some(heartbeat::Event::BootUp)
    );
    assert_eq!(consumer.deadline(), None);
}

#[test]
fn a_look_at_a_node_allows_it_the_whole_time() {
    let mut consumer = heartbeat::Consumer::new(node(), 25 * MS);
    let says = |byte| Frame::new(CobId::error_control(node()), &[byte]);
    assert!(!consumer.is_alive(at(0)), "never heard");
    consumer.on_frame(at(0), &says(0x00));
    assert_eq!(consumer.state(), Some(State::Initialising));
    assert!(consumer.is_alive(at(25)) && !consumer.is_alive(at(26)));
    consumer.on_frame(at(30), &says(0x05));
    assert_eq!(consumer.state(), Some(State::Operational));
    // As in an answer to guarding: a sign of life, but no heartbeat.
    assert_eq!(consumer.on_frame(at(40), &says(0x85)), None);
    assert_eq!(
        (consumer.state(), consumer.deadline()),
        (None, Some(at(55)))
    );
    assert_eq!(consumer.byte(), Some(0x85));
    assert!(consumer.is_alive(at(65)) && !consumer.is_alive(at(66)));
    consumer.forget();
    assert_eq!(consumer.byte(), None);
    assert!(!consumer.is_alive(at(41)) && consumer.deadline().is_none());
}

#[test]
fn late_producer_sends_one_heartbeat_not_several() {
    let mut producer = heartbeat::Producer::new();
    let mut tx: Vec<Frame> = Vec::new();
    producer.start(at(10), 10 * MS);
    producer.poll(
        at(95),
        CobId::error_control(node()),
        State::Stopped,
        &mut tx,
    );
    assert_eq!(format!("{tx:?}"), "[703#04]");
    assert_eq!(producer.deadline(), Some(at(105)));
}

#[test]
fn guarding_toggles_and_both_sides_notice_silence() {
    let mut slave = guarding::Slave::new();
    let mut master = guarding::Master::new(node(), 10 * MS, 3, at(0));
    slave.set_life_time(30 * MS);
    assert_eq!(slave.deadline(), None, "starts with the first request");
    let mut told = Vec::new();
    let mut answers: Vec<Frame> = Vec::new();
    for ms in 0..200 {
        let mut tx: Vec<Frame> = Vec::new();
        // The master is cut off from 50 to 100 ms; from 120 ms on the slave does not answer.
        if !(50..100).contains(&ms) {
            told.extend(master.poll(at(ms), &mut tx).map(|event| (ms, event)));
        }
        for request in tx {
            assert!(request.is_remote());
            if ms < 120 {
                let id = CobId::error_control(node());
                slave.answer(at(ms), id, State::PreOperational, &mut answers);
                let answer = answers.last().expect("answered");
                told.extend(master.on_frame(answer).map(|event| (ms, event)));
            }
        }
        if slave.poll(at(ms)) {
            told.push((ms, guarding::Event::Toggle)); // stands for the slave's loss
        }
    }
    let bytes: Vec<u8> = answers.iter().map(|frame| frame.data()[0]).collect();
    assert_eq!(bytes, [0x7F, 0xFF, 0x7F, 0xFF, 0x7F, 0xFF, 0x7F]);
    assert_eq!(
        told,
        [
            (0, guarding::Event::State(State::PreOperational)),
            (70, guarding::Event::Toggle),
            (140, guarding::Event::Toggle),
            (150, guarding::Event::Lost),
        ]
    );
}

/// A life time factor of 0 is no life guarding (CiA 301, 100Dh).
#[test]
fn a_node_that_never_answers_is_lost_once() {
    for (factor, lost) in [(0, None), (1, Some(1)), (3, Some(3)), (255, Some(255))] {
        let mut master = guarding::Master::new(node(), 10 * MS, factor, at(0));
        let mut told = (0..70_000).filter(|&ask| {
            let mut tx: Vec<Frame> = Vec::new();
            master.poll(at(10 * ask), &mut tx).is_some()
        });
        assert_eq!((told.next(), told.next()), (lost, None), "{factor}");
    }
}

#[test]
fn master_notices_a_wrong_toggle_bit() {
    let mut master = guarding::Master::new(node(), 10 * MS, 3, at(0));
    let answer = |byte| Frame::new(CobId::error_control(node()), &[byte]);
    assert_eq!(
        master.on_frame(&answer(0x05)),
        Some(guarding::Event::State(State::Operational))
    );
    assert_eq!(
        master.on_frame(&answer(0x05)),
        Some(guarding::Event::Toggle)
    );
    assert_eq!(master.on_frame(&answer(0x85)), None);
    assert_eq!(
        master.on_frame(&answer(0x00)),
        Some(guarding::Event::BootUp)
    );
}

#[test]
fn emergencies_wait_for_the_inhibit_time() {
    let mut producer = emcy::Producer::new();
    let mut tx: Vec<Frame> = Vec::new();
    let cob_id = CobId::emcy(node());
    let emergency = |code| Emergency {
        code,
        register: 1,
        vendor: [0, 0, 0, 0x34, 0x12],
    };
    producer.set_inhibit_time(10 * MS);
    producer.raise(at(0), cob_id, emergency(0x1000), &mut tx);
    producer.raise(at(1), cob_id, emergency(0x2000), &mut tx);
    producer.raise(at(2), cob_id, emergency(0x0000), &mut tx);
    assert_eq!(format!("{tx:?}"), "[083#0010010000003412]");
    assert_eq!(producer.deadline(), Some(at(10)));
    producer.poll(at(10), cob_id, &mut tx);
    producer.poll(at(20), cob_id, &mut tx);
    assert_eq!(tx.len(), 3);
    assert_eq!(producer.deadline(), None);
}

#[test]
fn sync_counts_from_one_to_its_overflow_value() {
    let mut producer = sync::Producer::new(CobId::SYNC, 2 * MS, 3);
    let mut tx: Vec<Frame> = Vec::new();
    producer.start(at(10));
    for ms in 0..20 {
        producer.poll(at(ms), &mut tx);
    }
    assert_eq!(
        format!("{tx:?}"),
        "[080#01, 080#02, 080#03, 080#01, 080#02]"
    );
    // Two are missed: the next is on the old grid.
    producer.poll(at(25), &mut tx);
    assert_eq!(producer.deadline(), Some(at(26)));
    let decoded = sync::Sync::decode(&tx[0], CobId::SYNC);
    assert_eq!(decoded, Some(sync::Sync { counter: Some(1) }));
}
