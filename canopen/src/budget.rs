//! Whether one SYNC cycle's frames fit their cycle, and where in it they end.
//!
//! Two questions, two numbers.
//!
//! **Deadlines** decide. SYNC leaves at the cycle's instant; the T_PDOs that it causes must have come
//! when the controller computes, at the setpoint offset; the R_PDOs of the burst that it sends then must
//! each have *begun* when the next SYNC is due, for a frame on its way ends before SYNC does. Both legs
//! are bounded by [`response_time`](crate::response_time), each from the event that releases its frames:
//!
//! ```text
//!  SYNC due       SYNC ends    T_PDOs queued                 setpoint offset            SYNC due
//!   │ a frame │ SYNC │ response │ heartbeat │ EMCY │ T_PDO × N │ … │ heartbeat │ R_PDO × N │
//! ```
//!
//! What the bus carries besides in motion: a heartbeat a node and one of the controller's, which are
//! less urgent than PDOs and so only block, one at each of the two places (another one waits until the
//! PDOs are through); and EMCY messages, which are more urgent than PDOs and go before them, at a
//! stated rate of one a cycle. T_PDOs that come by event, each as often as its node says, may stand at both places, all at once.
//! A machine that holds its deadlines with heartbeats but not with an EMCY
//! besides fits with a warning: a node that sends one has stopped or is to be stopped, and what it
//! costs is one T_PDO or one burst, which is counted. SDO is kept out of motion by the controller;
//! before, nothing moves yet.
//!
//! **Load** tells how full a cycle can get: all that can be queued in one. It is what a measurement of
//! the busiest cycle is to be held against, and decides nothing.
//!
//! Heartbeats count as if all came at once. Offsets would bound nothing: a master can write only a heartbeat's period
//! (1017h), and each node counts it by an oscillator of its own from an instant of its own. At 50 ppm apart two of them
//! drift by a cycle of 2 ms in 40 s, and periods that differ meet at their beat. How
//! many heartbeats there are does not touch the deadlines, as only one can block at a place; it is in the load.
//!
//! Tried before: releasing all frames with SYNC and one blocking frame a cycle. That is no bound,
//! since a heartbeat can stand before SYNC, another one before the T_PDOs and a third before the
//! burst, and a machine that it accepted sent a burst too late in one of some hundred runs.

use crate::id::{CanId, CobId, NodeId};
use crate::response_time::{Message, bit_time, worst_case, worst_case_bits};
use core::fmt;
use core::time::Duration;

/// A frame with a standard identifier and eight bytes, without stuff bits, and the intermission behind it.
const PLAIN_BITS: u32 = 111;

/// The longest frame that anyone may put on the bus unasked: 8 data bytes, standard identifier.
pub const BLOCKING_BITS: u32 = worst_case_bits(CanId::Standard(0), 8);

/// A heartbeat: one data byte.
const HEARTBEAT_BITS: u32 = worst_case_bits(CanId::Standard(0), 1);

/// The node whose messages are the most urgent of their kind.
const FIRST_NODE: NodeId = NodeId::new(1).expect("node ids begin with 1");

/// Share of the cycle above which a fitting machine is warned, in percent.
pub const WARNING_PERCENT: u32 = 80;

/// The two directions of a PDO, named from the drive's side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// T_PDO: the drive sends it after SYNC.
    Transmit,
    /// R_PDO: the controller sends it before the next SYNC.
    Receive,
}

/// One PDO that travels in each cycle of its node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pdo {
    /// Who sends it.
    pub direction: Direction,
    /// Identifier.
    pub cob_id: CobId,
    /// Mapped bytes, 0…8.
    pub bytes: u8,
}

impl Pdo {
    /// Its worst-case bits on the wire.
    const fn bits(&self) -> u32 {
        worst_case_bits(CanId::Standard(self.cob_id.get()), self.bytes)
    }
}

/// What one node adds to a cycle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeTraffic {
    /// The node.
    pub node: NodeId,
    /// Its T_PDOs travel every `divider` cycles, its R_PDOs in each; at least 1.
    pub divider: u32,
    /// Longest time from the end of SYNC until its T_PDOs stand in its transmit queue.
    pub response: Duration,
    /// Its cyclic PDOs.
    pub pdos: Vec<Pdo>,
    /// When its T_PDOs come that do not come at SYNC.
    pub events: Option<Events>,
}

/// How many times in a cycle each T_PDO of a node comes at most that comes by event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Events {
    /// Whenever they like; at least 1.
    pub any_time: u32,
    /// Besides, behind the node's R_PDO of the cycle.
    pub behind_r_pdo: u32,
}

impl NodeTraffic {
    /// How many times in a cycle a PDO of it travels at most.
    fn times(&self, pdo: Pdo) -> u32 {
        match pdo.direction {
            Direction::Transmit => self.events.map_or(1, |it| it.any_time + it.behind_r_pdo),
            Direction::Receive => 1,
        }
    }
}

/// The cyclic traffic of one bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Traffic {
    /// Bits per second, above zero.
    pub bit_rate: u32,
    /// SYNC to SYNC, above zero.
    pub cycle: Duration,
    /// The nodes on this bus.
    pub nodes: Vec<NodeTraffic>,
}

/// The answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Everything arrives in its cycle.
    Fits,
    /// It does, but takes more than [`WARNING_PERCENT`] of the cycle.
    FitsTightly,
    /// Something may be late.
    DoesNotFit,
}

/// One PDO's part in the budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PdoTime {
    /// The node that it belongs to.
    pub node: NodeId,
    /// The PDO.
    pub pdo: Pdo,
    /// Worst-case bits on the wire.
    pub bits: u32,
    /// How many times in a cycle it travels at most.
    pub times: u32,
    /// After SYNC's instant, when at the latest a T_PDO has come, an R_PDO begins; EMCY apart.
    /// `None`: no bound.
    pub latest: Option<Duration>,
    /// What that must not exceed: the setpoint offset for a T_PDO, the cycle for an R_PDO.
    pub deadline: Duration,
}

/// One bus's cycle, worst case.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Bits per second.
    pub bit_rate: u32,
    /// SYNC to SYNC.
    pub cycle: Duration,
    /// SYNC's bits.
    pub sync_bits: u32,
    /// Bits of all T_PDOs.
    pub t_pdo_bits: u32,
    /// Bits of all R_PDOs: the burst.
    pub r_pdo_bits: u32,
    /// SYNC + all PDOs + one blocking frame.
    pub demand: Duration,
    /// The answer.
    pub verdict: Verdict,
    /// Whether the deadlines hold in a cycle with an EMCY, too.
    pub outlasts_emcy: bool,
    /// Each PDO, in the order of the nodes.
    pub pdos: Vec<PdoTime>,
    /// SYNC leaves up to this late: one frame that was already on its way.
    pub sync_jitter: Duration,
    /// After SYNC's instant, when the last T_PDO has come; EMCY apart.
    pub t_pdos_in: Duration,
    /// After SYNC's instant, when the controller computes and sends the burst: behind the last T_PDO
    /// with a margin. Whole microseconds.
    pub setpoint_offset: Duration,
    /// After SYNC's instant, the last one at which a burst may be sent: its last frame still begins
    /// before the next SYNC, behind a heartbeat.
    pub latest_offset: Duration,
    /// The same with nothing in the burst's way: what is sent later is late.
    pub latest_burst: Duration,
    /// After SYNC's instant, when the burst sent at `setpoint_offset` has left, with the longest
    /// frame before it.
    pub burst_out: Duration,
    /// Before SYNC, no acyclic frame may be started that long: its longest frame.
    pub quiet_window: Duration,
    /// What SYNC, PDOs and one blocking frame leave of the cycle's bus time; for how many transfers a
    /// cycle, see [`sdo_transfers`](Self::sdo_transfers).
    pub sdo_room: Duration,
    /// All that can be queued in one cycle while axes move: SYNC, PDOs, every heartbeat, an EMCY.
    pub load: Duration,
}

impl Budget {
    /// SDO transfers in a cycle: requests that are sent behind the burst and answered, where a node takes
    /// `answer` at most for that, before the quiet window begins. At least one: where there is no room
    /// for it, it is sent all the same, as there are none while axes move.
    #[must_use]
    pub fn sdo_transfers(&self, answer: Duration) -> usize {
        let busy = self.burst_out + self.quiet_window + answer;
        let transfer = bit_time(2 * BLOCKING_BITS, self.bit_rate);
        let room = self.cycle.saturating_sub(busy).as_nanos() / transfer.as_nanos();
        (room as usize).max(1)
    }

    /// After SYNC's instant, when a request has left that is sent behind a burst at `setpoint_offset`,
    /// with the longest frame before them. Where that is beyond the cycle the next SYNC may wait for it.
    #[must_use]
    pub fn request_out(&self, setpoint_offset: Duration) -> Duration {
        setpoint_offset + bit_time(self.r_pdo_bits + 2 * BLOCKING_BITS, self.bit_rate)
    }

    /// A frame of eight bytes without a stuff bit.
    #[must_use]
    pub fn plain_frame(&self) -> Duration {
        bit_time(PLAIN_BITS, self.bit_rate)
    }

    /// After SYNC's instant, when the answer to such a request has come, of a node that takes `response` at most to queue it.
    #[must_use]
    pub fn answer_out(&self, setpoint_offset: Duration, response: Duration) -> Duration {
        self.request_out(setpoint_offset) + response + bit_time(BLOCKING_BITS, self.bit_rate)
    }
}

impl Traffic {
    /// The budget. The bits of one cycle are to be below 2³².
    ///
    /// # Panics
    /// If the bit rate, the cycle, a divider or [`Events::any_time`] is zero.
    #[must_use]
    pub fn budget(&self) -> Budget {
        let sum = |direction| {
            let pdos = self.pdos().filter(|(_, pdo)| pdo.direction == direction);
            let bits = pdos.map(|(node, pdo)| pdo.bits() * node.times(pdo));
            bits.sum::<u32>()
        };
        let time = |bits| bit_time(bits, self.bit_rate);
        let sync_bits = worst_case_bits(CobId::SYNC.into(), 0);
        let t_pdo_bits = sum(Direction::Transmit);
        let r_pdo_bits = sum(Direction::Receive);
        let pdo_bits = t_pdo_bits + r_pdo_bits;
        let blocking = time(BLOCKING_BITS);
        let demand = time(sync_bits + pdo_bits + BLOCKING_BITS);

        let [calm, with_emcy] = [false, true].map(|emcy| self.bounds(emcy));
        let outlasts_emcy = with_emcy.hold(self.cycle);
        let verdict = if demand > self.cycle || !calm.hold(self.cycle) {
            Verdict::DoesNotFit
        } else if !outlasts_emcy || demand * 100 > self.cycle * WARNING_PERCENT {
            Verdict::FitsTightly
        } else {
            Verdict::Fits
        };
        let bounds = if outlasts_emcy { &with_emcy } else { &calm };
        // One frame that was on its way when SYNC was due, and one that comes between SYNC and the T_PDOs.
        let generous = time(2 * BLOCKING_BITS + sync_bits + t_pdo_bits) + self.slowest_response();
        let setpoint_offset = bounds.setpoint_offset(generous + self.cycle / 20, self.cycle);

        let burst_begun = calm.burst_begun().unwrap_or(self.cycle);
        let mut t_pdos = calm.t_pdos.iter();
        let mut r_pdos = calm.r_pdos.iter();
        let times = self.pdos().map(|(node, pdo)| {
            let (latest, deadline) = match pdo.direction {
                Direction::Transmit => (t_pdos.next().copied().flatten(), setpoint_offset),
                Direction::Receive => {
                    let begun = r_pdos.next().copied().flatten();
                    (begun.map(|it| setpoint_offset + it), self.cycle)
                }
            };
            PdoTime {
                node: node.node,
                pdo,
                bits: pdo.bits(),
                times: node.times(pdo),
                latest,
                deadline,
            }
        });
        let sdo_room = self.cycle.saturating_sub(demand);
        let heartbeats = HEARTBEAT_BITS * (self.nodes.len() as u32 + 1);
        Budget {
            bit_rate: self.bit_rate,
            cycle: self.cycle,
            sync_bits,
            t_pdo_bits,
            r_pdo_bits,
            demand,
            verdict,
            outlasts_emcy,
            pdos: times.collect(),
            sync_jitter: blocking,
            t_pdos_in: calm.t_pdos_in().unwrap_or(self.cycle),
            setpoint_offset,
            latest_offset: self.cycle.saturating_sub(burst_begun),
            latest_burst: self
                .cycle
                .saturating_sub(burst_begun.saturating_sub(time(HEARTBEAT_BITS))),
            burst_out: setpoint_offset + blocking + time(r_pdo_bits),
            quiet_window: blocking,
            sdo_room,
            load: time(sync_bits + pdo_bits + heartbeats + BLOCKING_BITS),
        }
    }

    fn pdos(&self) -> impl Iterator<Item = (&NodeTraffic, Pdo)> {
        let of = |node| move |pdo| (node, pdo);
        (self.nodes.iter()).flat_map(move |node| node.pdos.iter().copied().map(of(node)))
    }

    /// Bounds of the cycle's two legs, with an EMCY a cycle or without.
    fn bounds(&self, emcy: bool) -> Bounds {
        // Before SYNC: a heartbeat, the last of the burst, or a T_PDO that comes when it likes.
        let in_the_way = (self.pdos())
            .filter(|(node, pdo)| pdo.direction == Direction::Receive || node.events.is_some())
            .map(|(_, pdo)| pdo.bits())
            .fold(HEARTBEAT_BITS, u32::max);
        let sync_bits = worst_case_bits(CobId::SYNC.into(), 0);
        let sync_over = bit_time(in_the_way + sync_bits, self.bit_rate);
        let t_pdos = self.leg(Direction::Transmit, emcy);
        let t_pdos = t_pdos.map(|(_, over)| Some(sync_over + over?)).collect();

        let r_pdos = self.leg(Direction::Receive, emcy);
        let mut r_pdos: Vec<(Pdo, Option<Duration>)> = r_pdos
            .map(|(pdo, over)| (pdo, over.map(|it| it - bit_time(pdo.bits(), self.bit_rate))))
            .collect();
        // The burst is sent at once: none of its frames begins behind its least urgent one.
        let least_urgent = r_pdos.iter().max_by_key(|(pdo, _)| pdo.cob_id.get());
        if let Some(&(_, last)) = least_urgent {
            for (_, begun) in &mut r_pdos {
                *begun = (*begun).min(last);
            }
        }
        Bounds {
            t_pdos,
            r_pdos: r_pdos.into_iter().map(|(_, begun)| begun).collect(),
        }
    }

    /// The PDOs of a direction, each with its response time from the event that releases them all.
    fn leg(
        &self,
        direction: Direction,
        emcy: bool,
    ) -> impl Iterator<Item = (Pdo, Option<Duration>)> {
        let pdos = self
            .pdos()
            .filter(move |(_, pdo)| pdo.direction == direction);
        let (pdos, mut messages): (Vec<Pdo>, Vec<Message>) = pdos
            .map(|(node, pdo)| {
                let message = Message {
                    id: pdo.cob_id.into(),
                    bytes: pdo.bytes,
                    period: match direction {
                        Direction::Transmit => self.cycle * node.divider,
                        Direction::Receive => self.cycle,
                    },
                    jitter: match direction {
                        Direction::Transmit => node.response,
                        Direction::Receive => Duration::ZERO,
                    },
                };
                (pdo, message)
            })
            .unzip();
        messages.extend(self.events(direction));
        messages.extend(emcy.then_some(Message {
            id: CobId::emcy(FIRST_NODE).into(),
            bytes: 8,
            period: self.cycle,
            jitter: Duration::ZERO,
        }));
        let responses = worst_case(&messages, HEARTBEAT_BITS, self.bit_rate);
        pdos.into_iter().zip(responses)
    }

    /// What comes by event in one of the cycle's legs and may all come at once; one of each is among the T_PDOs already.
    fn events(&self, direction: Direction) -> impl Iterator<Item = Message> {
        let burst = || {
            let r_pdos = self
                .pdos()
                .filter(|(_, pdo)| pdo.direction == Direction::Receive);
            r_pdos.map(|(node, pdo)| (pdo.cob_id.get(), node.node))
        };
        // What follows a node's R_PDO is in nobody's way where that is the last of the burst.
        let last = burst().max().map(|(_, node)| node);
        self.pdos().flat_map(move |(node, pdo)| {
            let events = node.events.filter(|_| pdo.direction == Direction::Transmit);
            let times = events.map_or(0, |it| match direction {
                Direction::Transmit => it.any_time - 1,
                Direction::Receive if last == Some(node.node) => it.any_time,
                Direction::Receive => it.any_time + it.behind_r_pdo,
            });
            let message = Message {
                id: pdo.cob_id.into(),
                bytes: pdo.bytes,
                period: self.cycle * node.divider,
                jitter: Duration::ZERO,
            };
            // More than a cycle's time is no bound, however many.
            let most = self.cycle.as_nanos() / bit_time(pdo.bits(), self.bit_rate).as_nanos() + 1;
            let times = u128::from(times).min(most);
            (0..times).map(move |_| message)
        })
    }

    fn slowest_response(&self) -> Duration {
        let responses = self.nodes.iter().map(|node| node.response);
        responses.max().unwrap_or_default()
    }

    /// The same traffic in another cycle.
    #[must_use]
    pub fn in_cycle(&self, cycle: Duration) -> Self {
        Self {
            cycle,
            ..self.clone()
        }
    }

    /// The same nodes on two buses, dealt out in turn.
    #[must_use]
    pub fn on_two_buses(&self) -> [Self; 2] {
        [0, 1].map(|bus| Self {
            nodes: self.nodes.iter().skip(bus).step_by(2).cloned().collect(),
            ..*self
        })
    }
}

/// The worst case of a cycle's two legs; `None`: no bound.
struct Bounds {
    /// By T_PDO in the order of the nodes: when it has come, after SYNC's instant.
    t_pdos: Vec<Option<Duration>>,
    /// By R_PDO in the order of the nodes: when it begins, after the burst is sent.
    r_pdos: Vec<Option<Duration>>,
}

/// The latest; `None` if one has no bound.
fn latest(of: &[Option<Duration>]) -> Option<Duration> {
    (of.iter()).try_fold(Duration::ZERO, |latest, it| Some(latest.max((*it)?)))
}

impl Bounds {
    /// When the last T_PDO has come, after SYNC's instant.
    fn t_pdos_in(&self) -> Option<Duration> {
        latest(&self.t_pdos)
    }

    /// When the last R_PDO begins, after the burst is sent.
    fn burst_begun(&self) -> Option<Duration> {
        latest(&self.r_pdos)
    }

    /// The first whole microsecond at which the last T_PDO has come.
    fn earliest_offset(&self) -> Option<Duration> {
        let micros = self.t_pdos_in()?.as_nanos().div_ceil(1000);
        Some(Duration::from_micros(micros as u64))
    }

    /// Whether there is a whole microsecond for the burst behind the T_PDOs and before the next SYNC.
    fn hold(&self, cycle: Duration) -> bool {
        let whole = self.earliest_offset().zip(self.burst_begun());
        whole.is_some_and(|(earliest, burst)| earliest + burst <= cycle)
    }

    /// Where both legs have room, `generous`, or else the middle of what there is, in whole
    /// microseconds.
    fn setpoint_offset(&self, generous: Duration, cycle: Duration) -> Duration {
        let earliest = self.earliest_offset().unwrap_or(cycle);
        let latest = cycle.saturating_sub(self.burst_begun().unwrap_or(cycle));
        let offset = if (earliest..=latest).contains(&generous) {
            generous
        } else {
            earliest + latest.saturating_sub(earliest) / 2
        };
        Duration::from_micros(offset.as_micros() as u64)
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Fits => "fits",
            Self::FitsTightly => "fits, with a warning",
            Self::DoesNotFit => "does not fit",
        })
    }
}

/// The arithmetic that decides, in one line.
impl fmt::Display for Budget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = |direction| {
            let pdos = self
                .pdos
                .iter()
                .filter(|pdo| pdo.pdo.direction == direction);
            pdos.map(|pdo| pdo.times).sum::<u32>()
        };
        write!(
            f,
            "SYNC {} + {} T_PDO {} + {} R_PDO {} + one blocking frame {} = {} bits at {} kbit/s \
             = {:.3} ms of {:.3} ms ({:.1} %): {}",
            self.sync_bits,
            count(Direction::Transmit),
            self.t_pdo_bits,
            count(Direction::Receive),
            self.r_pdo_bits,
            BLOCKING_BITS,
            self.sync_bits + self.t_pdo_bits + self.r_pdo_bits + BLOCKING_BITS,
            self.bit_rate / 1000,
            self.demand.as_secs_f64() * 1e3,
            self.cycle.as_secs_f64() * 1e3,
            self.demand.as_secs_f64() / self.cycle.as_secs_f64() * 100.0,
            self.verdict
        )?;
        if self.verdict == Verdict::DoesNotFit && self.demand <= self.cycle {
            write!(
                f,
                ": T_PDOs are in by {:.3} ms, and the last R_PDO begins {:.3} ms later",
                self.t_pdos_in.as_secs_f64() * 1e3,
                (self.cycle.saturating_sub(self.latest_offset)).as_secs_f64() * 1e3
            )?;
        }
        Ok(())
    }
}
