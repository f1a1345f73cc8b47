//! What fits a cycle and what does not, and the analysis behind it against a published example
//! and a plain simulation.

use proptest::prelude::*;
use std::time::Duration;
use syncline_canopen::budget::{NodeTraffic, Traffic, Verdict};
use syncline_canopen::response_time::{Message, Queue, bit_time, worst_case, worst_case_bits};
use syncline_canopen::{CanId, CobId, NodeId};

const RESPONSE: Duration = Duration::from_micros(100);

fn axes(count: u8, cycle_ms: u64) -> Traffic {
    Traffic {
        bit_rate: 1_000_000,
        cycle: Duration::from_millis(cycle_ms),
        nodes: (1..=count)
            .map(|id| NodeTraffic::interpolated(NodeId::new(id).unwrap(), 6, RESPONSE))
            .collect(),
    }
}

#[test]
fn stuffing_bounds_are_those_of_the_paper() {
    let standard = CanId::standard(0x281).unwrap();
    let extended = CanId::extended(0x281).unwrap();
    assert_eq!(worst_case_bits(standard, 0), 55);
    assert_eq!(worst_case_bits(standard, 8), 135);
    assert_eq!(worst_case_bits(extended, 8), 160);
    assert_eq!(bit_time(135, 125_000), Duration::from_micros(1080));
}

#[test]
fn four_axes_at_one_millisecond_are_refused() {
    let budget = axes(4, 1).budget();
    assert_eq!(budget.demand, Duration::from_micros(1110));
    assert_eq!(budget.verdict, Verdict::DoesNotFit);
    assert_eq!(
        budget.to_string(),
        "SYNC 55 + 4 T_PDO 460 + 4 R_PDO 460 + one blocking frame 135 = 1110 bits at 1000 kbit/s \
         = 1.110 ms of 1.000 ms (111.0 %): does not fit"
    );
    let last = budget.pdos.last().unwrap();
    assert_eq!(
        last.response, None,
        "beyond its period, no bound is claimed"
    );
    let cycles = (1..=20).map(Duration::from_millis);
    assert_eq!(
        axes(4, 1).smallest_cycle(cycles),
        Some(Duration::from_millis(2))
    );
    for half in axes(4, 1).on_two_buses() {
        assert_eq!(half.nodes.len(), 2);
        assert_eq!(half.budget().demand, Duration::from_micros(650));
        assert_eq!(half.budget().verdict, Verdict::Fits);
    }
}

#[test]
fn three_axes_at_one_millisecond_are_warned() {
    let budget = axes(3, 1).budget();
    assert_eq!(budget.demand, Duration::from_micros(880));
    assert_eq!(budget.verdict, Verdict::FitsTightly);
    let slowest = budget.pdos.iter().filter_map(|pdo| pdo.response).max();
    assert_eq!(slowest, Some(budget.demand));
    // Heartbeats, 65 bits, are in nobody's way, before the T_PDOs or before the burst …
    let (t_pdos, burst) = (55 + 100 + 345, 345);
    assert_eq!(
        budget.setpoint_offset,
        Duration::from_micros((65 + t_pdos + 1000 - burst - 65) / 2)
    );
    // … but the longest frame is, and it says so.
    assert!(budget.setpoint_offset < budget.t_pdos_in);
    assert!(budget.burst_out > budget.cycle);
}

#[test]
fn six_axes_at_two_milliseconds_fit() {
    let budget = axes(6, 2).budget();
    assert_eq!(budget.demand, Duration::from_micros(1570));
    assert_eq!(budget.verdict, Verdict::Fits);
    assert_eq!(budget.sdo_room, Duration::from_micros(430));
    assert_eq!(budget.sdo_transfers, 1);
    assert_eq!(budget.latest_burst, Duration::from_micros(1310));
    assert_eq!(budget.sync_jitter, Duration::from_micros(135));
    let slowest = budget.pdos.iter().filter_map(|pdo| pdo.response).max();
    assert_eq!(slowest, Some(budget.demand));
    assert_eq!(
        budget.t_pdos_in,
        Duration::from_micros(135 + 55 + 690 + 100)
    );
    assert!(budget.burst_out <= budget.cycle);
}

#[test]
fn a_slow_drive_does_not_fit_although_its_frames_do() {
    let mut traffic = axes(3, 1);
    traffic.nodes[1].response = Duration::from_micros(200);
    let budget = traffic.budget();
    assert!(budget.demand < budget.cycle);
    assert_eq!(budget.verdict, Verdict::DoesNotFit);
    let words = budget.to_string();
    assert!(
        words.ends_with("does not fit: T_PDOs are in by 0.735 ms, the burst takes 0.345 ms more"),
        "{words}"
    );
}

/// The example that refuted the original analysis: 125 kbit/s, 7 bytes, 1 ms a frame; the second
/// instance of the third message is the late one (Davis et al. 2007).
#[test]
fn the_busy_period_goes_on_beyond_the_first_instance() {
    let message = |id, period_us| Message {
        id: CanId::standard(id).unwrap(),
        bytes: 7,
        period: Duration::from_micros(period_us),
        jitter: Duration::ZERO,
        queue: Queue::Priority,
    };
    let responses = worst_case(
        &[message(1, 2500), message(2, 3500), message(3, 3500)],
        0,
        125_000,
    );
    let micros: Vec<u128> = responses
        .iter()
        .map(|response| response.unwrap().as_micros())
        .collect();
    assert_eq!(micros, [2000, 3000, 3500]);
}

/// Late releases and time spent in a FIFO queue let frames come closer together than their period.
#[test]
fn jitter_of_the_more_urgent_delays_twice() {
    let message = |id, period_us, jitter_us, queue| Message {
        id: CanId::standard(id).unwrap(),
        bytes: 8,
        period: Duration::from_micros(period_us),
        jitter: Duration::from_micros(jitter_us),
        queue,
    };
    let late = [
        message(1, 1000, 900, Queue::Priority),
        message(2, 2000, 0, Queue::Priority),
    ];
    let responses = worst_case(&late, 0, 1_000_000);
    assert_eq!(responses[1], Some(Duration::from_micros(135 + 2 * 135)));

    let queued = [
        message(1, 500, 0, Queue::Fifo(0)),
        message(2, 2000, 0, Queue::Priority),
        message(3, 1000, 0, Queue::Fifo(0)),
    ];
    let responses = worst_case(&queued, 0, 1_000_000);
    assert_eq!(
        responses[1],
        Some(Duration::from_micros(135 + 2 * 135 + 135))
    );
}

#[test]
fn an_overloaded_bus_has_no_bound() {
    let message = |id| Message {
        id: CobId::new(id).unwrap().into(),
        bytes: 8,
        period: Duration::from_micros(200),
        jitter: Duration::ZERO,
        queue: Queue::Priority,
    };
    let responses = worst_case(&[message(1), message(2)], 0, 1_000_000);
    assert!(responses[0].is_some());
    assert_eq!(responses[1], None);
}

/// A plain bus: frames are released, stations offer by their queue, the lowest identifier wins.
/// Gives each message's longest response in nanoseconds. Written without the analysis in mind, so
/// that it can disagree with it.
fn simulate(messages: &[Message], offsets: &[u64], jitters: &[Vec<u64>], horizon: u64) -> Vec<u64> {
    #[derive(Clone, Copy)]
    struct Pending {
        message: usize,
        event: u64,
        queued: u64,
    }
    let mut pending: Vec<Pending> = Vec::new();
    for (message, kind) in messages.iter().enumerate() {
        let period = kind.period.as_nanos() as usize;
        let events = (offsets[message]..horizon).step_by(period);
        pending.extend(
            events
                .zip(jitters[message].iter().cycle())
                .map(|(event, late)| Pending {
                    message,
                    event,
                    queued: event + late,
                }),
        );
    }
    let mut worst = vec![0; messages.len()];
    let mut now = 0;
    while !pending.is_empty() {
        let first_in = pending
            .iter()
            .filter(|frame| messages[frame.message].queue != Queue::Priority)
            .map(|frame| (frame.queued, frame.message))
            .min();
        let offers = |frame: &Pending| {
            frame.queued <= now
                && (messages[frame.message].queue == Queue::Priority
                    || Some((frame.queued, frame.message)) == first_in)
        };
        let next = (0..pending.len())
            .filter(|&at| offers(&pending[at]))
            .min_by_key(|&at| (messages[pending[at].message].id.raw(), pending[at].queued));
        let Some(next) = next else {
            now = pending.iter().map(|frame| frame.queued).min().unwrap();
            continue;
        };
        let sent = pending.swap_remove(next);
        let kind = &messages[sent.message];
        now += bit_time(worst_case_bits(kind.id, kind.bytes), 1_000_000).as_nanos() as u64;
        worst[sent.message] = worst[sent.message].max(now - sent.event);
    }
    worst
}

prop_compose! {
    fn message()(bytes in 0u8..=8, period in 4u64..40, jitter in 0u64..300, fifo: bool)
        -> Message {
        Message {
            id: CobId::SYNC.into(),
            bytes,
            period: Duration::from_micros(period * 100),
            jitter: Duration::from_micros(jitter),
            queue: if fifo { Queue::Fifo(1) } else { Queue::Priority },
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// No offsets and no jitter let a frame take longer than its bound. Two of one message in a
    /// FIFO queue at a time are outside what its analysis covers: no bound, and then none for the
    /// frames that they delay.
    #[test]
    fn simulation_never_exceeds_the_bound(
        mut messages in prop::collection::vec(message(), 2..9),
        offsets in prop::collection::vec(0u64..3_000_000, 9),
        shares in prop::collection::vec(prop::collection::vec(0u64..=100, 1..5), 9),
    ) {
        for (index, message) in messages.iter_mut().enumerate() {
            message.id = CanId::standard(index as u16 * 7 + 3).unwrap();
        }
        let bounds = worst_case(&messages, 0, 1_000_000);
        let jitters: Vec<Vec<u64>> = messages
            .iter()
            .zip(&shares)
            .map(|(message, shares)| {
                let most = message.jitter.as_nanos() as u64;
                shares.iter().map(|share| most * share / 100).collect()
            })
            .collect();
        let measured = simulate(&messages, &offsets, &jitters, 20_000_000);
        let fifo_covered = messages
            .iter()
            .zip(&bounds)
            .all(|(message, bound)| message.queue == Queue::Priority || bound.is_some());
        if fifo_covered {
            for ((message, bound), measured) in messages.iter().zip(&bounds).zip(measured) {
                let Some(bound) = bound else { continue };
                prop_assert!(
                    measured <= bound.as_nanos() as u64,
                    "{message:?}: {measured} ns > {bound:?}"
                );
            }
        }
    }
}
