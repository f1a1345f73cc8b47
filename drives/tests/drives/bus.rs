//! The simulated bus from outside: who sends when, and who sees what at which nanosecond.

use proptest::prelude::*;
use std::collections::VecDeque;
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, Frame, Instant, Transmit};
use syncline_drives::bus::{Band, BitRate, BusNode, Sender, SimBus, Transmission};

/// Queues each frame at its instant; remembers what it received.
#[derive(Default)]
struct Script {
    plan: VecDeque<(Instant, Frame)>,
    seen: Vec<(Instant, Frame)>,
}

impl BusNode for Script {
    fn on_frame(&mut self, now: Instant, frame: &Frame, _: &mut dyn Transmit) {
        self.seen.push((now, *frame));
    }

    fn poll(&mut self, now: Instant, tx: &mut dyn Transmit) {
        while self.deadline().is_some_and(|due| due <= now) {
            if let Some((_, frame)) = self.plan.pop_front() {
                tx.transmit(frame);
            }
        }
    }

    fn deadline(&self) -> Option<Instant> {
        self.plan.front().map(|(at, _)| *at)
    }
}

fn us(us: u64) -> Instant {
    Instant::from_nanos(us * 1000)
}

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::new(CanId::Standard(id), data)
}

fn script(plan: impl IntoIterator<Item = (Instant, Frame)>) -> Script {
    Script {
        plan: plan.into_iter().collect(),
        ..Script::default()
    }
}

fn mbit() -> BitRate {
    BitRate::from_kbit(1000).unwrap()
}

fn run(bus: &mut SimBus<Script>, until: Instant) -> Vec<Transmission> {
    let mut sent = vec![];
    bus.advance_to(until, &mut |transmission| sent.push(*transmission));
    sent
}

#[test]
fn lowest_identifier_of_one_instant_wins_and_the_next_waits_for_the_intermission() {
    let mut bus = SimBus::new(mbit());
    bus.attach(script([(us(5), frame(0x282, &[0x55; 6]))]));
    bus.attach(script([(us(5), frame(0x281, &[0x55; 6]))]));
    bus.advance_to(us(5), &mut |_| panic!("nothing has been sent yet"));
    bus.send(Band::Pdo, frame(0x300, &[]));
    bus.send(Band::Sync, frame(0x080, &[]));
    let sent = run(&mut bus, us(2000));
    let ids: Vec<u32> = sent.iter().map(|sent| sent.frame.id().raw()).collect();
    assert_eq!(ids, [0x080, 0x281, 0x282, 0x300]);
    assert_eq!(sent[0].start, us(5));
    for pair in sent.windows(2) {
        assert_eq!(pair[1].start, pair[0].end + Duration::from_micros(3));
    }
    for sent in &sent {
        assert_eq!(
            sent.end - sent.start,
            Duration::from_micros(u64::from(sent.bits) - 3)
        );
    }
}

#[test]
fn a_frame_on_the_wire_is_not_interrupted() {
    let mut bus = SimBus::new(mbit());
    bus.attach(script([(us(0), frame(0x701, &[0x55; 8]))]));
    run(&mut bus, us(1));
    bus.send(Band::Sync, frame(0x080, &[]));
    let sent = run(&mut bus, us(1000));
    assert_eq!(sent[0].frame.id().raw(), 0x701);
    assert!(sent[1].start >= us(111));
}

#[test]
fn everybody_else_receives_at_the_end_of_frame_and_the_port_its_echo() {
    let mut bus = SimBus::new(mbit());
    let a = bus.attach(script([]));
    let b = bus.attach(script([(us(1), frame(0x181, &[1, 2]))]));
    bus.send(Band::Acyclic, frame(0x601, &[0; 8]));
    let sent = run(&mut bus, us(1000));
    assert_eq!(sent[0].sender, Sender::Port);
    assert_eq!(sent[1].sender, Sender::Node(b));
    assert_eq!(
        bus.node(a).seen,
        sent.iter()
            .map(|sent| (sent.end, sent.frame))
            .collect::<Vec<_>>()
    );
    assert_eq!(bus.node(b).seen, [(sent[0].end, sent[0].frame)]);
    let echo = bus.receive().unwrap();
    assert!(echo.own && echo.at == sent[0].end);
    let answer = bus.receive().unwrap();
    assert!(!answer.own && answer.at == sent[1].end && answer.frame == sent[1].frame);
    assert_eq!(bus.receive(), None);
}

#[test]
fn the_port_keeps_order_within_a_band_and_acyclic_frames_wait() {
    let mut bus = SimBus::<Script>::new(mbit());
    bus.send(Band::Acyclic, frame(0x000, &[1, 0]));
    bus.send(Band::Pdo, frame(0x303, &[]));
    bus.send(Band::Pdo, frame(0x301, &[]));
    let ids: Vec<u32> = run(&mut bus, us(1000))
        .iter()
        .map(|sent| sent.frame.id().raw())
        .collect();
    assert_eq!(ids, [0x303, 0x301, 0x000]);
}

#[test]
fn standard_beats_extended_and_data_beats_remote() {
    let mut bus = SimBus::new(mbit());
    let extended = Frame::new(CanId::extended(0x100 << 18).unwrap(), &[]);
    let remote = Frame::remote(CanId::Standard(0x100), 0).unwrap();
    for sent in [extended, remote, frame(0x100, &[])] {
        bus.attach(script([(us(0), sent)]));
    }
    let sent = run(&mut bus, us(1000));
    assert_eq!(sent[0].frame, frame(0x100, &[]));
    assert_eq!(sent[1].frame, remote);
    assert_eq!(sent[2].frame, extended);
}

#[test]
fn next_event_finds_everything_that_small_steps_find() {
    let build = || {
        let mut bus = SimBus::new(BitRate::from_kbit(250).unwrap());
        bus.attach(script(
            (0..20).map(|k| (us(700 * k), frame(0x181, &[k as u8; 4]))),
        ));
        bus.attach(script(
            (0..20).map(|k| (us(701 * k + 3), frame(0x182, &[k as u8; 8]))),
        ));
        bus
    };
    let stepped = {
        let mut bus = build();
        (1..40_000)
            .flat_map(|step| run(&mut bus, us(step)))
            .collect::<Vec<_>>()
    };
    let mut bus = build();
    let mut jumped = vec![];
    while let Some(next) = bus.next_event() {
        jumped.extend(run(&mut bus, next));
    }
    assert_eq!(stepped.len(), 40);
    assert_eq!(stepped, jumped);
}

proptest! {
    /// Frames never overlap, none is lost or invented, and one node's frames of one identifier
    /// keep their order.
    #[test]
    fn the_wire_carries_one_frame_at_a_time(
        plans in proptest::collection::vec(
            proptest::collection::vec((0u64..3000, 0u16..0x800, 0usize..9), 0..12), 1..6)
    ) {
        let mut bus = SimBus::new(mbit());
        let mut expected = vec![];
        for plan in &plans {
            let mut plan: Vec<_> = plan
                .iter()
                .map(|&(at, id, len)| (us(at), frame(id, &[id as u8; 8][..len])))
                .collect();
            plan.sort_by_key(|(at, _)| *at);
            expected.extend(plan.iter().map(|(_, frame)| *frame));
            bus.attach(script(plan));
        }
        let sent = run(&mut bus, us(1_000_000));
        for pair in sent.windows(2) {
            prop_assert!(pair[1].start >= pair[0].end + Duration::from_micros(3));
        }
        let mut carried: Vec<_> = sent.iter().map(|sent| sent.frame).collect();
        let key = |frame: &Frame| (frame.id().raw(), frame.dlc());
        carried.sort_by_key(key);
        expected.sort_by_key(key);
        prop_assert_eq!(carried, expected);
    }
}
