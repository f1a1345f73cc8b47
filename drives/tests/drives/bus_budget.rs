//! The budget's bounds against the simulated bus: no random machine ever measures more.

use proptest::prelude::*;
use std::time::Duration;
use syncline_canopen::budget::{Budget, Direction, NodeTraffic, Pdo, Traffic, Verdict};
use syncline_canopen::response_time::bit_time;
use syncline_canopen::{CanId, CobId, Frame, Instant, NodeId, Transmit};
use syncline_drives::bus::{Band, BitRate, Node, SimBus};

/// Sends its T_PDOs at a given time after each SYNC.
struct Drive {
    replies: Vec<Frame>,
    /// By cycle, in turn.
    delays: Vec<Duration>,
    cycle: usize,
    due: Option<Instant>,
}

impl Node for Drive {
    fn on_frame(&mut self, now: Instant, frame: &Frame, _: &mut dyn Transmit) {
        if frame.id() == CobId::SYNC.into() {
            self.due = Some(now + self.delays[self.cycle % self.delays.len()]);
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

/// Sends one frame of the lowest priority a cycle, unasked, at any time in it.
struct Stranger {
    cycle: Duration,
    moments: Vec<Duration>,
    sent: usize,
}

impl Node for Stranger {
    fn on_frame(&mut self, _: Instant, _: &Frame, _: &mut dyn Transmit) {}

    fn poll(&mut self, _: Instant, tx: &mut dyn Transmit) {
        tx.transmit(Frame::new(CanId::standard(0x7FF).unwrap(), &[0; 8]));
        self.sent += 1;
    }

    fn deadline(&self) -> Option<Instant> {
        let start = Instant::ZERO + self.cycle * self.sent as u32;
        Some(start + self.moments[self.sent % self.moments.len()])
    }
}

enum Peer {
    Drive(Drive),
    Stranger(Stranger),
}

impl Node for Peer {
    fn on_frame(&mut self, now: Instant, frame: &Frame, tx: &mut dyn Transmit) {
        match self {
            Self::Drive(drive) => drive.on_frame(now, frame, tx),
            Self::Stranger(stranger) => stranger.on_frame(now, frame, tx),
        }
    }

    fn poll(&mut self, now: Instant, tx: &mut dyn Transmit) {
        match self {
            Self::Drive(drive) => drive.poll(now, tx),
            Self::Stranger(stranger) => stranger.poll(now, tx),
        }
    }

    fn deadline(&self) -> Option<Instant> {
        match self {
            Self::Drive(drive) => drive.deadline(),
            Self::Stranger(stranger) => stranger.deadline(),
        }
    }
}

#[derive(Clone, Debug)]
struct Case {
    traffic: Traffic,
    data: [u8; 8],
    /// Shares of each node's response time, in percent, by cycle.
    shares: Vec<u32>,
    /// Shares of the cycle at which the stranger sends, in per mille.
    moments: Vec<u32>,
}

prop_compose! {
    fn case()(
        kbit in prop::sample::select(vec![125_u32, 250, 500, 1000]),
        cycle_ms in 1_u64..=20,
        nodes in prop::collection::vec((0_u8..=8, 0_u8..=8, 0_u64..=1000, any::<bool>()), 1..=16),
        data: [u8; 8],
        shares in prop::collection::vec(0_u32..=100, 1..8),
        moments in prop::collection::vec(0_u32..1000, 1..4),
    ) -> Case {
        let pdo = |direction, cob_id, bytes| Pdo { direction, cob_id, bytes };
        let nodes = nodes.iter().zip(1..).map(|(&(t, r, response, second), id)| {
            let node = NodeId::new(id).unwrap();
            let mut pdos = vec![
                pdo(Direction::Transmit, CobId::t_pdo(2, node), t),
                pdo(Direction::Receive, CobId::r_pdo(2, node), r),
            ];
            if second {
                pdos.push(pdo(Direction::Transmit, CobId::t_pdo(4, node), r));
            }
            NodeTraffic { node, divider: 1, response: Duration::from_micros(response), pdos }
        });
        Case {
            traffic: Traffic {
                bit_rate: kbit * 1000,
                cycle: Duration::from_millis(cycle_ms),
                nodes: nodes.collect(),
            },
            data,
            shares,
            moments,
        }
    }
}

/// Ends of SYNC, of the last T_PDO and of the last R_PDO after the SYNC instant, the worst of
/// some cycles.
fn measure(case: &Case, budget: &Budget) -> [Duration; 3] {
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
    bus.attach(Peer::Stranger(Stranger {
        cycle,
        moments: case
            .moments
            .iter()
            .map(|moment| cycle * *moment / 1000)
            .collect(),
        sent: 0,
    }));
    let burst: Vec<Frame> = nodes
        .iter()
        .flat_map(|node| frames(node, Direction::Receive))
        .collect();
    let is = |frame: &Frame, direction| {
        let mut pdos = nodes.iter().flat_map(|node| &node.pdos);
        pdos.any(|pdo| pdo.direction == direction && frame.id() == pdo.cob_id.into())
    };

    let mut worst = [Duration::ZERO; 3];
    for number in 0..CYCLES {
        let start = Instant::ZERO + cycle * number;
        let setpoint = start + budget.setpoint_offset;
        let mut watch = |sent: &syncline_drives::bus::Transmission| {
            let after = sent.end.saturating_since(start);
            let kind = if sent.frame.id() == CobId::SYNC.into() {
                0
            } else if is(&sent.frame, Direction::Transmit) {
                1
            } else if is(&sent.frame, Direction::Receive) {
                2
            } else {
                return;
            };
            worst[kind] = worst[kind].max(after);
        };
        bus.send(Band::Sync, Frame::new(CobId::SYNC, &[]));
        bus.advance_to(setpoint, &mut watch);
        burst.iter().for_each(|frame| bus.send(Band::Pdo, *frame));
        bus.advance_to(start + cycle, &mut watch);
    }
    worst
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_simulated_bus_never_measures_more_than_the_bound(case in case()) {
        let budget = case.traffic.budget();
        prop_assume!(budget.verdict != Verdict::DoesNotFit);
        // Where a second blocking frame makes the burst late, the next SYNC finds the bus taken.
        prop_assume!(budget.burst_out <= budget.cycle);
        let [sync, t_pdos, r_pdos] = measure(&case, &budget);
        let sync_time = bit_time(budget.sync_bits, budget.bit_rate);
        prop_assert!(sync <= budget.sync_jitter + sync_time, "SYNC {sync:?}");
        // A stranger at changing moments can be in the way twice in one cycle: once across SYNC.
        let t_pdos_most = if case.moments.len() == 1 {
            budget.t_pdos_in
        } else {
            budget.setpoint_offset
        };
        prop_assert!(t_pdos <= t_pdos_most, "T_PDOs {t_pdos:?} > {t_pdos_most:?}");
        prop_assert!(r_pdos <= budget.burst_out, "burst {r_pdos:?} > {:?}", budget.burst_out);
    }
}
