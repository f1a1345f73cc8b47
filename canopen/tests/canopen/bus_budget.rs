//! What fits a cycle and what does not, and the analysis behind it against a published example
//! and a plain simulation.

use proptest::prelude::*;
use std::time::Duration;
use syncline_canopen::budget::{Direction, Events, NodeTraffic, Pdo, Traffic, Verdict};
use syncline_canopen::response_time::{Message, bit_time, worst_case, worst_case_bits};
use syncline_canopen::{CanId, CobId, NodeId};

const RESPONSE: Duration = Duration::from_micros(100);

fn axes(count: u8, cycle_ms: u64) -> Traffic {
    Traffic {
        bit_rate: 1_000_000,
        cycle: Duration::from_millis(cycle_ms),
        nodes: (1..=count)
            .map(|id| interpolated(NodeId::new(id).unwrap(), 6, RESPONSE))
            .collect(),
    }
}

/// A node with one T_PDO2 and one R_PDO2 of so many bytes each at their default identifiers, every cycle.
fn interpolated(node: NodeId, bytes: u8, response: Duration) -> NodeTraffic {
    let pdo = |direction, cob_id| Pdo {
        direction,
        cob_id,
        bytes,
    };
    NodeTraffic {
        node,
        divider: 1,
        response,
        pdos: vec![
            pdo(Direction::Transmit, CobId::t_pdo(2, node)),
            pdo(Direction::Receive, CobId::r_pdo(2, node)),
        ],
        events: None,
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
    assert!(last.latest.is_none_or(|latest| latest > last.deadline));
    let in_two = axes(4, 1).in_cycle(Duration::from_millis(2)).budget();
    assert_ne!(in_two.verdict, Verdict::DoesNotFit);
    for half in axes(4, 1).on_two_buses() {
        assert_eq!(half.nodes.len(), 2);
        assert_eq!(half.budget().demand, Duration::from_micros(650));
        // With all but an EMCY, which takes 15 µs too much.
        assert_eq!(half.budget().verdict, Verdict::FitsTightly);
        assert!(!half.budget().outlasts_emcy);
    }
}

/// Nobody knows when they come: the burst has to leave earlier by all of them that are more urgent, and by the longest of the others.
#[test]
fn t_pdos_by_event_may_all_come_in_front_of_the_burst() {
    let node = NodeId::new(9).unwrap();
    let pdo = |number| Pdo {
        direction: Direction::Transmit,
        cob_id: CobId::t_pdo(number, node),
        bytes: 8,
    };
    let with = |numbers: &[u8], events| {
        let mut traffic = axes(2, 2);
        traffic.nodes.push(NodeTraffic {
            node,
            divider: 1,
            response: RESPONSE,
            pdos: numbers.iter().map(|number| pdo(*number)).collect(),
            events,
        });
        traffic.budget()
    };
    let times = |any_time, behind_r_pdo| {
        Some(Events {
            any_time,
            behind_r_pdo,
        })
    };
    let at_sync = with(&[1, 2], None);
    assert_eq!(at_sync.latest_offset, axes(2, 2).budget().latest_offset);
    // R_PDO2 of the axes, 300h on, is behind both; the heartbeat in its way is none of them.
    for (numbers, frames) in [(&[1][..], 1), (&[1, 2], 2), (&[1, 2, 3], 3)] {
        let budget = with(numbers, times(1, 0));
        let earlier = at_sync.latest_offset - budget.latest_offset;
        let least = bit_time(135 * frames.min(2), 1_000_000);
        assert!(earlier >= least, "{numbers:?}: {earlier:?}");
        // Each three times in a cycle: so many frames more, and none of them earlier.
        let often = with(numbers, times(3, 0));
        let more = bit_time(2 * 135 * numbers.len() as u32, 1_000_000);
        assert_eq!(often.demand, budget.demand + more);
        assert_eq!(often.load, budget.load + more);
        assert!(often.latest_offset < budget.latest_offset && often.t_pdos_in > budget.t_pdos_in);
    }
}

/// What an R_PDO causes comes behind it: not between SYNC and the burst, and in the burst's way only where others follow.
#[test]
fn t_pdos_behind_an_r_pdo_are_in_the_way_of_those_r_pdos_that_follow() {
    let with = |id, behind_r_pdo| {
        let mut traffic = axes(4, 4);
        let node = NodeId::new(id).unwrap();
        let one = traffic.nodes.iter_mut().find(|it| it.node == node).unwrap();
        let t_pdo = one
            .pdos
            .iter_mut()
            .find(|it| it.direction == Direction::Transmit);
        t_pdo.unwrap().cob_id = CobId::t_pdo(1, node);
        one.events = Some(Events {
            any_time: 1,
            behind_r_pdo,
        });
        traffic.budget()
    };
    for (id, follow) in [(1, true), (4, false)] {
        let [none, two] = [0, 2].map(|behind| with(id, behind));
        let more = bit_time(2 * 115, 1_000_000);
        assert_eq!(two.load, none.load + more);
        assert_eq!(two.t_pdos_in, none.t_pdos_in);
        let earlier = none.latest_offset - two.latest_offset;
        assert_eq!(earlier, if follow { more } else { Duration::ZERO });
    }
}

#[test]
fn three_axes_at_one_millisecond_are_warned() {
    let budget = axes(3, 1).budget();
    assert_eq!(budget.demand, Duration::from_micros(880));
    assert_eq!(budget.verdict, Verdict::FitsTightly);
    // With a heartbeat or the last R_PDO before SYNC, and a heartbeat behind it …
    let t_pdos_in = 115 + 55 + 100 + 65 + 345;
    assert_eq!(budget.t_pdos_in, Duration::from_micros(t_pdos_in));
    // … and one before the burst, whose last frame begins before the next SYNC.
    let latest = 1000 - (65 + 2 * 115);
    assert_eq!(budget.latest_offset, Duration::from_micros(latest));
    assert_eq!(
        budget.setpoint_offset,
        Duration::from_micros((t_pdos_in + latest) / 2)
    );
    // An EMCY besides is too much.
    assert!(!budget.outlasts_emcy);
    assert!(
        budget
            .pdos
            .iter()
            .all(|pdo| pdo.latest.unwrap() <= pdo.deadline)
    );
}

#[test]
fn six_axes_at_two_milliseconds_fit() {
    let budget = axes(6, 2).budget();
    assert_eq!(budget.demand, Duration::from_micros(1570));
    assert_eq!(budget.verdict, Verdict::Fits);
    assert_eq!(budget.sdo_room, Duration::from_micros(430));
    assert_eq!(budget.sdo_transfers(Duration::ZERO), 1);
    assert_eq!(budget.latest_burst, Duration::from_micros(2000 - 5 * 115));
    assert_eq!(
        budget.latest_offset,
        budget.latest_burst - Duration::from_micros(65)
    );
    assert_eq!(budget.sync_jitter, Duration::from_micros(135));
    assert_eq!(
        budget.t_pdos_in,
        Duration::from_micros(115 + 55 + 100 + 65 + 690)
    );
    assert!(budget.outlasts_emcy);
    assert_eq!(
        budget.load,
        Duration::from_micros(55 + 690 + 690 + 7 * 65 + 135)
    );
}

#[test]
fn sdo_has_what_lies_between_the_burst_and_the_quiet_window() {
    // A request with its answer takes 270 µs on the bus.
    let budget = axes(6, 10).budget();
    let left = Duration::from_millis(10) - budget.burst_out - budget.quiet_window;
    let transfer = Duration::from_micros(270);
    for count in [1, 7, 20] {
        let answer = left - count * transfer;
        assert_eq!(budget.sdo_transfers(answer), count as usize);
        let longer = answer + Duration::from_nanos(1);
        assert_eq!(budget.sdo_transfers(longer), (count as usize - 1).max(1));
    }
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
        words.ends_with(
            "does not fit: T_PDOs are in by 0.715 ms, and the last R_PDO begins 0.295 ms later"
        ),
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

/// Late releases let frames come closer together than their period.
#[test]
fn jitter_of_the_more_urgent_delays_twice() {
    let message = |id, period_us, jitter_us| Message {
        id: CanId::standard(id).unwrap(),
        bytes: 8,
        period: Duration::from_micros(period_us),
        jitter: Duration::from_micros(jitter_us),
    };
    let late = [message(1, 1000, 900), message(2, 2000, 0)];
    let responses = worst_case(&late, 0, 1_000_000);
    assert_eq!(responses[1], Some(Duration::from_micros(135 + 2 * 135)));
}

#[test]
fn an_overloaded_bus_has_no_bound() {
    let message = |id| Message {
        id: CobId::new(id).unwrap().into(),
        bytes: 8,
        period: Duration::from_micros(200),
        jitter: Duration::ZERO,
    };
    let responses = worst_case(&[message(1), message(2)], 0, 1_000_000);
    assert!(responses[0].is_some());
    assert_eq!(responses[1], None);
}

/// A plain bus: frames are released, the lowest identifier of those that wait wins. Gives each message's longest response in nanoseconds. Written without the analysis in mind, so
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
        let next = (0..pending.len())
            .filter(|&at| pending[at].queued <= now)
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

/// Frames at their worst-case lengths on a plain bus, as (release, identifier, bytes) in ns: when each
/// begins and ends.
fn on_the_bus(frames: &[(u64, CobId, u8)]) -> Vec<(u64, u64)> {
    let mut times = vec![None; frames.len()];
    let mut now = 0;
    while let Some(first) = (0..frames.len())
        .filter(|&at| times[at].is_none())
        .min_by_key(|&at| (frames[at].0.max(now), frames[at].1.get()))
    {
        let (release, id, bytes) = frames[first];
        let begin = release.max(now);
        now = begin + bit_time(worst_case_bits(id.into(), bytes), 1_000_000).as_nanos() as u64;
        times[first] = Some((begin, now));
    }
    times.into_iter().flatten().collect()
}

proptest! {
    /// What the budget bounds is reached, to a few nanoseconds, where everything comes as badly as it can.
    #[test]
    fn the_bounds_are_reached_with_aligned_phases(
        pdos in prop::collection::vec((0_u8..=8, 1_u8..=8), 1..=12),
        response in 1_u64..500,
        cycle_ms in 1_u64..=10,
    ) {
        let response = Duration::from_micros(response);
        let nodes = (1..).zip(&pdos).map(|(id, &(t, r))| {
            let node = NodeId::new(id).unwrap();
            let mut traffic = interpolated(node, t, response);
            traffic.pdos[1].bytes = r;
            traffic
        });
        let cycle = Duration::from_millis(cycle_ms);
        let traffic = Traffic { bit_rate: 1_000_000, cycle, nodes: nodes.collect() };
        let budget = traffic.budget();
        prop_assume!(budget.verdict != Verdict::DoesNotFit);
        let of = |direction| {
            let pdos = traffic.nodes.iter().flat_map(|node| &node.pdos);
            pdos.filter(move |pdo| pdo.direction == direction)
        };
        let nanos = |time: Duration| time.as_nanos() as u64;

        // The longest R_PDO has just begun when SYNC is due, a heartbeat when the T_PDOs come, …
        let due = 1_000_000;
        let before = of(Direction::Receive).max_by_key(|pdo| pdo.bytes).unwrap();
        let mut frames = vec![(due - 1, before.cob_id, before.bytes), (due, CobId::SYNC, 0)];
        let sync_over = on_the_bus(&frames)[1].1;
        let answers = sync_over + nanos(response);
        let heartbeat = CobId::error_control(NodeId::MAX);
        frames.push((answers - 1, heartbeat, 1));
        frames.extend(of(Direction::Transmit).map(|pdo| (answers, pdo.cob_id, pdo.bytes)));
        let t_pdos_in = on_the_bus(&frames).iter().map(|frame| frame.1).max().unwrap();
        let bound = nanos(budget.t_pdos_in);
        prop_assert!((bound - 3..=bound).contains(&(t_pdos_in - due)), "{} of {bound}", t_pdos_in - due);

        // … and another one when the burst is sent.
        let sent = due + nanos(budget.latest_offset);
        let mut frames = vec![(sent - 1, heartbeat, 1)];
        frames.extend(of(Direction::Receive).map(|pdo| (sent, pdo.cob_id, pdo.bytes)));
        let begun = on_the_bus(&frames).iter().map(|frame| frame.0).max().unwrap();
        let end = nanos(cycle);
        prop_assert!((end - 3..=end).contains(&(begun - due)), "{} of {end}", begun - due);
    }
}

prop_compose! {
    fn message()(bytes in 0u8..=8, period in 4u64..40, jitter in 0u64..300) -> Message {
        Message {
            id: CobId::SYNC.into(),
            bytes,
            period: Duration::from_micros(period * 100),
            jitter: Duration::from_micros(jitter),
        }
    }
}

proptest! {
    /// At every bit rate: the controller computes behind the last T_PDO, and the last of its burst has
    /// begun when SYNC is due.
    #[test]
    fn the_setpoint_offset_is_within_the_bounds(
        bit_rate in prop_oneof![Just(125_000u32), Just(500_000), Just(800_000), 50_000u32..=1_000_000],
        bytes in prop::collection::vec((0_u8..=8, 1_u8..=8), 1..=6),
        response in 1_u64..2_000_000,
        // Cycles that the traffic just fits, and longer ones.
        more in prop_oneof![0_u64..3_000, 0_u64..5_000_000],
    ) {
        let response = Duration::from_nanos(response);
        let nodes = (1..).zip(&bytes).map(|(id, &(t, r))| {
            let mut traffic = interpolated(NodeId::new(id).unwrap(), t, response);
            traffic.pdos[1].bytes = r;
            traffic
        });
        let long = Traffic { bit_rate, cycle: Duration::from_secs(1), nodes: nodes.collect() };
        let legs = long.budget();
        let least = legs.t_pdos_in + (long.cycle - legs.latest_offset);
        let budget = long.in_cycle(least + Duration::from_nanos(more)).budget();
        prop_assume!(budget.verdict != Verdict::DoesNotFit);
        let offset = budget.setpoint_offset;
        prop_assert_eq!(offset.subsec_nanos() % 1000, 0);
        prop_assert!(offset >= budget.t_pdos_in, "{offset:?}, T_PDOs {:?}", budget.t_pdos_in);
        prop_assert!(offset <= budget.latest_offset, "{offset:?}, latest {:?}", budget.latest_offset);
        for pdo in &budget.pdos {
            prop_assert!(pdo.latest.is_some_and(|it| it <= pdo.deadline), "{pdo:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// No offsets and no jitter let a frame take longer than its bound.
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
        for ((message, bound), measured) in messages.iter().zip(&bounds).zip(measured) {
            let Some(bound) = bound else { continue };
            prop_assert!(
                measured <= bound.as_nanos() as u64,
                "{message:?}: {measured} ns > {bound:?}"
            );
        }
    }
}

#[test]
fn a_request_is_out_behind_a_frame_and_the_burst() {
    let offset = Duration::from_micros(900);
    let out = Duration::from_micros(900 + 135 + 345 + 135);
    assert_eq!(axes(3, 2).budget().request_out(offset), out);
}
