//! The budget's bounds against the simulated bus: no random machine ever measures more.

use proptest::prelude::*;
use std::mem::take;
use std::time::Duration;
use syncline_canopen::budget::{Budget, Direction, NodeTraffic, Pdo, Traffic, Verdict};
use syncline_canopen::response_time::bit_time;
use syncline_canopen::{CobId, Frame, Instant, NodeId, Transmit};
use syncline_drives::bus::{Band, BitRate, BusNode, SimBus, Transmission};

/// Sends its T_PDOs at a given time after each SYNC, or each nth.
struct Drive {
    divider: usize,
    replies: Vec<Frame>,
    /// By cycle, in turn.
    delays: Vec<Duration>,
    cycle: usize,
    due: Option<Instant>,
}

impl BusNode for Drive {
    fn on_frame(&mut self, now: Instant, frame: &Frame, _: &mut dyn Transmit) {
        if frame.id() == CobId::SYNC.into() {
            let delay = self.delays[self.cycle % self.delays.len()];
            self.due = self.cycle.is_multiple_of(self.divider).then(|| now + delay);
            self.cycle += 1;
        }
    }

    fn poll(&mut self, _: Instant, tx: &mut dyn Transmit) {
        self.due = None;
        self.replies.iter().for_each(|frame| tx.transmit(*frame));
    }

    fn deadline(&self) -> Option<Instant> {
        self.due
    }
}

/// Sends a frame at given instants: heartbeats, EMCY messages.
struct Sender {
    frame: Frame,
    instants: Vec<Instant>,
    sent: usize,
}

impl BusNode for Sender {
    fn on_frame(&mut self, _: Instant, _: &Frame, _: &mut dyn Transmit) {}

    fn poll(&mut self, _: Instant, tx: &mut dyn Transmit) {
        tx.transmit(self.frame);
        self.sent += 1;
    }

    fn deadline(&self) -> Option<Instant> {
        self.instants.get(self.sent).copied()
    }
}

enum Peer {
    Drive(Drive),
    Sender(Sender),
}

impl BusNode for Peer {
    fn on_frame(&mut self, now: Instant, frame: &Frame, tx: &mut dyn Transmit) {
        match self {
            Self::Drive(drive) => drive.on_frame(now, frame, tx),
            Self::Sender(sender) => sender.on_frame(now, frame, tx),
        }
    }

    fn poll(&mut self, now: Instant, tx: &mut dyn Transmit) {
        match self {
            Self::Drive(drive) => drive.poll(now, tx),
            Self::Sender(sender) => sender.poll(now, tx),
        }
    }

    fn deadline(&self) -> Option<Instant> {
        match self {
            Self::Drive(drive) => drive.deadline(),
            Self::Sender(sender) => sender.deadline(),
        }
    }
}

#[derive(Clone, Debug)]
struct Case {
    traffic: Traffic,
    data: [u8; 8],
    /// Shares of each node's response time, in percent, by cycle.
    shares: Vec<u32>,
    /// Shares of the cycle at which the nodes and the controller send heartbeats, in per mille.
    heartbeats: Vec<u32>,
    /// By cycle, in turn: at which share the first node sends an EMCY, in per mille, if it does.
    emcys: Vec<Option<u32>>,
}

prop_compose! {
    fn case()(
        kbit in prop::sample::select(vec![125_u32, 250, 500, 1000]),
        cycle_ms in 1_u64..=20,
        nodes in prop::collection::vec((0_u8..=8, 0_u8..=8, 0_u64..=1000, any::<bool>(), prop_oneof![2 => Just(1_u32), 1 => 2..=5_u32]),
            1..=16,
        ),
        data: [u8; 8],
        shares in prop::collection::vec(0_u32..=100, 1..8),
        heartbeats in prop::collection::vec(0_u32..1000, 17),
        emcys in prop::collection::vec(prop::option::of(0_u32..1000), 1..4),
    ) -> Case {
        let pdo = |direction, cob_id, bytes| Pdo { direction, cob_id, bytes };
        let nodes = nodes.iter().zip(1..).map(|(&(t, r, response, second, divider), id)| {
            let node = NodeId::new(id).unwrap();
            // What answers every nth SYNC is sent its R_PDO in each cycle all the same.
            let mut pdos = vec![
                pdo(Direction::Transmit, CobId::t_pdo(2, node), t),
                pdo(Direction::Receive, CobId::r_pdo(2, node), r),
            ];
            if second {
                pdos.push(pdo(Direction::Transmit, CobId::t_pdo(4, node), r));
            }
            NodeTraffic { node, divider, response: Duration::from_micros(response), pdos, events: None }
        });
        Case {
            traffic: Traffic {
                bit_rate: kbit * 1000,
                cycle: Duration::from_millis(cycle_ms),
                nodes: nodes.collect(),
            },
            data,
            shares,
            heartbeats,
            emcys,
        }
    }
}

/// Of some cycles the worst, after the SYNC instant: ends of SYNC and of the last T_PDO, beginning
/// of the last R_PDO, and the same of each PDO, in the order of the nodes; and the most bits between two SYNCs.
struct Measured {
    sync: Duration,
    t_pdos: Duration,
    r_pdos: Duration,
    pdos: Vec<Duration>,
    bits: u32,
}

/// A bus on which every node sends its heartbeat in every other cycle, and one of them an EMCY.
fn measure(case: &Case, budget: &Budget) -> Measured {
    const CYCLES: u32 = 20;
    let Traffic {
        cycle,
        ref nodes,
        bit_rate,
    } = case.traffic;
    let mut bus = SimBus::new(BitRate::from_kbit(bit_rate / 1000).unwrap());
    let frames = |node: &NodeTraffic, direction| -> Vec<Frame> {
        let pdos = node.pdos.iter().filter(|pdo| pdo.direction == direction);
        pdos.map(|pdo| Frame::new(pdo.cob_id, &case.data[..pdo.bytes.into()]))
            .collect()
    };
    for node in nodes {
        bus.attach(Peer::Drive(Drive {
            divider: node.divider as usize,
            replies: frames(node, Direction::Transmit),
            delays: case
                .shares
                .iter()
                .map(|share| node.response * *share / 100)
                .collect(),
            cycle: 0,
            due: None,
        }));
    }
    // So that what one cycle leaves to the next is not counted as a second one there.
    let every_other = (0..CYCLES).step_by(2);
    let at = |number: u32, moment: u32| Instant::ZERO + cycle * number + cycle * moment / 1000;
    let controller = NodeId::new(127).unwrap();
    let ids = nodes.iter().map(|node| node.node).chain([controller]);
    for (id, &moment) in ids.zip(&case.heartbeats) {
        bus.attach(Peer::Sender(Sender {
            frame: Frame::new(CobId::error_control(id), &[5]),
            instants: every_other
                .clone()
                .map(|number| at(number, moment))
                .collect(),
            sent: 0,
        }));
    }
    let emcys = every_other.zip(case.emcys.iter().cycle());
    bus.attach(Peer::Sender(Sender {
        frame: Frame::new(CobId::emcy(nodes[0].node), &[0; 8]),
        instants: emcys
            .filter_map(|(number, moment)| Some(at(number, (*moment)?)))
            .collect(),
        sent: 0,
    }));
    let burst: Vec<Frame> = nodes
        .iter()
        .flat_map(|node| frames(node, Direction::Receive))
        .collect();
    let pdos: Vec<&Pdo> = nodes.iter().flat_map(|node| &node.pdos).collect();

    let mut worst = Measured {
        sync: Duration::ZERO,
        t_pdos: Duration::ZERO,
        r_pdos: Duration::ZERO,
        pdos: vec![Duration::ZERO; pdos.len()],
        bits: 0,
    };
    let mut bits = 0;
    for number in 0..CYCLES {
        let start = Instant::ZERO + cycle * number;
        let setpoint = start + budget.setpoint_offset;
        let mut watch = |sent: &Transmission| {
            let (begun, ended) = (sent.start, sent.end);
            if sent.frame.id() == CobId::SYNC.into() {
                worst.sync = worst.sync.max(ended.saturating_since(start));
                worst.bits = worst.bits.max(take(&mut bits));
            } else if let Some(place) =
                (pdos.iter()).position(|pdo| sent.frame.id() == pdo.cob_id.into())
            {
                // One that ends behind the next SYNC's instant began before it.
                let of = if begun < start {
                    cycle * number.saturating_sub(1)
                } else {
                    cycle * number
                };
                let (time, all) = match pdos[place].direction {
                    Direction::Transmit => (ended.saturating_since(start), &mut worst.t_pdos),
                    Direction::Receive => {
                        let after = begun.saturating_since(Instant::ZERO + of);
                        (after, &mut worst.r_pdos)
                    }
                };
                *all = time.max(*all);
                worst.pdos[place] = time.max(worst.pdos[place]);
            }
            bits += sent.bits;
        };
        bus.send(Band::Sync, Frame::new(CobId::SYNC, &[]));
        bus.advance_to(setpoint, &mut watch);
        burst.iter().for_each(|frame| bus.send(Band::Pdo, *frame));
        bus.advance_to(start + cycle, &mut watch);
    }
    worst
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// Whatever the nodes answer, and whenever heartbeats and EMCY messages come.
    #[test]
    fn the_simulated_bus_never_measures_more_than_the_bound(case in case()) {
        let budget = case.traffic.budget();
        prop_assume!(budget.verdict != Verdict::DoesNotFit);
        let mut case = case;
        if !budget.outlasts_emcy {
            case.emcys = vec![None];
        }
        let measured = measure(&case, &budget);
        let Measured { sync, t_pdos, r_pdos, pdos, bits } = measured;
        let sync_time = bit_time(budget.sync_bits, budget.bit_rate);
        prop_assert!(sync <= budget.sync_jitter + sync_time, "SYNC {sync:?}");
        let offset = budget.setpoint_offset;
        prop_assert!(t_pdos <= offset, "T_PDOs {t_pdos:?} > {offset:?}");
        prop_assert!(r_pdos <= budget.cycle, "burst {r_pdos:?} > {:?}", budget.cycle);
        let load = bit_time(bits, budget.bit_rate);
        prop_assert!(load <= budget.load, "{load:?} > {:?}", budget.load);
        if case.emcys == [None] {
            prop_assert!(t_pdos <= budget.t_pdos_in, "T_PDOs {t_pdos:?} > {:?}", budget.t_pdos_in);
            let latest = budget.cycle - budget.latest_offset + offset;
            prop_assert!(r_pdos <= latest, "burst {r_pdos:?} > {latest:?}");
            for (time, pdo) in pdos.into_iter().zip(&budget.pdos) {
                prop_assert!(pdo.latest.is_some_and(|latest| time <= latest), "{time:?}: {pdo:?}");
            }
        }
    }
}
