//! Whether one SYNC cycle's frames fit their cycle, and where in it they end.
//!
//! What decides is SYNC + all PDOs + one blocking frame, each at its worst-case length, against
//! the cycle, and by [`response_time`](crate::response_time) each PDO against the SYNC that ends
//! its cycle; the controller's R_PDOs leave first in, first out.

use crate::id::{CobId, NodeId};
use crate::response_time::{Message, Queue, bit_time, worst_case, worst_case_bits};
use core::fmt;
use core::time::Duration;

/// The longest frame that anyone may put on the bus unasked: 8 data bytes, standard identifier.
pub const BLOCKING_BITS: u32 = 135;

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

/// One PDO that travels once a cycle of its node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pdo {
    /// Who sends it.
    pub direction: Direction,
    /// Identifier.
    pub cob_id: CobId,
    /// Mapped bytes, 0…8.
    pub bytes: u8,
}

/// What one node adds to a cycle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NodeTraffic {
    /// The node.
    pub node: NodeId,
    /// Its PDOs travel every `divider` cycles; at least 1.
    pub divider: u32,
    /// Longest time from the end of SYNC until its T_PDOs stand in its transmit queue.
    pub response: Duration,
    /// Its cyclic PDOs.
    pub pdos: Vec<Pdo>,
}

impl NodeTraffic {
    /// A node with one T_PDO2 and one R_PDO2 of `bytes` bytes each at their default identifiers,
    /// every cycle: an interpolated axis.
    #[must_use]
    pub fn interpolated(node: NodeId, bytes: u8, response: Duration) -> Self {
        Self {
            node,
            divider: 1,
            response,
            pdos: vec![
                Pdo {
                    direction: Direction::Transmit,
                    cob_id: CobId::t_pdo(2, node),
                    bytes,
                },
                Pdo {
                    direction: Direction::Receive,
                    cob_id: CobId::r_pdo(2, node),
                    bytes,
                },
            ],
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
    /// Worst-case response time when everything is released at SYNC; `None`: no bound.
    pub response: Option<Duration>,
    /// What it must not exceed: the cycle times the node's divider.
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
    /// Each PDO, in the order of the nodes.
    pub pdos: Vec<PdoTime>,
    /// SYNC leaves up to this late: one frame that was already on its way.
    pub sync_jitter: Duration,
    /// After SYNC's instant, when the last T_PDO has arrived with one blocking frame a cycle.
    pub t_pdos_in: Duration,
    /// After SYNC's instant, when the controller should compute and send the burst. Where the
    /// room is there, it outlasts a second blocking frame before the T_PDOs and a third before
    /// the burst; where it is not, a heartbeat before either. Whole microseconds.
    pub setpoint_offset: Duration,
    /// After SYNC's instant, when the burst sent at `setpoint_offset` has left, with a blocking
    /// frame before it. Beyond the cycle: such a frame makes setpoints late.
    pub burst_out: Duration,
    /// Before SYNC, no acyclic frame may be started that long: its longest frame.
    pub quiet_window: Duration,
    /// After SYNC's instant, the last one at which a burst still leaves before the next SYNC if
    /// nothing is in its way.
    pub latest_burst: Duration,
    /// What is left of the cycle for SDO.
    pub sdo_room: Duration,
    /// Requests with their answers that fit into `sdo_room`.
    pub sdo_transfers: u32,
}

impl Traffic {
    /// The budget.
    ///
    /// # Panics
    /// If the bit rate, the cycle or a divider is zero.
    #[must_use]
    pub fn budget(&self) -> Budget {
        let pdos = || {
            self.nodes
                .iter()
                .flat_map(|node| node.pdos.iter().map(move |pdo| (node, *pdo)))
        };
        let bits_of = |pdo: Pdo| worst_case_bits(pdo.cob_id.into(), pdo.bytes);
        let sum = |direction| {
            pdos()
                .filter(|(_, pdo)| pdo.direction == direction)
                .map(|(_, pdo)| bits_of(pdo))
                .sum::<u32>()
        };
        let time = |bits| bit_time(bits, self.bit_rate);
        let sync_bits = worst_case_bits(CobId::SYNC.into(), 0);
        let t_pdo_bits = sum(Direction::Transmit);
        let r_pdo_bits = sum(Direction::Receive);
        let demand = time(sync_bits + t_pdo_bits + r_pdo_bits + BLOCKING_BITS);

        let mut messages = vec![Message {
            id: CobId::SYNC.into(),
            bytes: 0,
            period: self.cycle,
            jitter: Duration::ZERO,
            queue: Queue::Priority,
        }];
        messages.extend(pdos().map(|(node, pdo)| Message {
            id: pdo.cob_id.into(),
            bytes: pdo.bytes,
            period: self.cycle * node.divider,
            jitter: Duration::ZERO,
            queue: match pdo.direction {
                Direction::Transmit => Queue::Priority,
                Direction::Receive => Queue::Fifo(0),
            },
        }));
        let responses = worst_case(&messages, BLOCKING_BITS, self.bit_rate);
        let pdo_times: Vec<PdoTime> = pdos()
            .zip(&responses[1..])
            .map(|((node, pdo), &response)| PdoTime {
                node: node.node,
                pdo,
                bits: bits_of(pdo),
                response,
                deadline: self.cycle * node.divider,
            })
            .collect();

        let blocking = time(BLOCKING_BITS);
        let device_response = self
            .nodes
            .iter()
            .map(|node| node.response)
            .max()
            .unwrap_or_default();
        let t_pdos_in = time(BLOCKING_BITS + sync_bits + t_pdo_bits) + device_response;
        let burst = time(r_pdo_bits);
        let setpoint_offset = self.setpoint_offset(t_pdos_in, burst, blocking);

        let sdo_room = self.cycle.saturating_sub(demand);

        let in_time = pdo_times.iter().all(|pdo| {
            pdo.response
                .is_some_and(|response| response <= pdo.deadline)
        });
        let verdict = if demand > self.cycle || t_pdos_in + burst > self.cycle || !in_time {
            Verdict::DoesNotFit
        } else if demand * 100 > self.cycle * WARNING_PERCENT {
            Verdict::FitsTightly
        } else {
            Verdict::Fits
        };
        Budget {
            bit_rate: self.bit_rate,
            cycle: self.cycle,
            sync_bits,
            t_pdo_bits,
            r_pdo_bits,
            demand,
            verdict,
            pdos: pdo_times,
            sync_jitter: blocking,
            t_pdos_in,
            setpoint_offset,
            burst_out: setpoint_offset + blocking + burst,
            quiet_window: blocking,
            latest_burst: self.cycle.saturating_sub(burst),
            sdo_room,
            sdo_transfers: (sdo_room.as_nanos() / (2 * blocking).as_nanos()) as u32,
        }
    }

    /// Behind the last T_PDO with a margin: a second blocking frame and a twentieth of the cycle,
    /// where the burst still leaves in time behind a blocking frame of its own. Where there is
    /// less room, half of it; but heartbeats, which come in every run, must make nothing late: with
    /// no room for a longer frame before the T_PDOs *and* a heartbeat before the burst, only
    /// heartbeats are reckoned with. The longer one, an EMCY, then costs a T_PDO.
    fn setpoint_offset(
        &self,
        t_pdos_in: Duration,
        burst: Duration,
        blocking: Duration,
    ) -> Duration {
        let generous = t_pdos_in + blocking + self.cycle / 20;
        let heartbeat = CobId::error_control(NodeId::MAX).into();
        let heartbeat = bit_time(worst_case_bits(heartbeat, 1), self.bit_rate);
        let half = self.cycle.saturating_sub(t_pdos_in + burst) / 2;
        let earliest = t_pdos_in - (blocking - heartbeat);
        let latest = self.cycle.saturating_sub(heartbeat + burst);
        let offset = if generous + blocking + burst <= self.cycle {
            generous
        } else if half >= heartbeat || latest < earliest {
            t_pdos_in + half
        } else {
            earliest + (latest - earliest) / 2
        };
        Duration::from_micros(offset.as_micros() as u64)
    }

    /// The first of `cycles` that this traffic fits, if any: the cycles that the devices can take,
    /// in ascending order.
    #[must_use]
    pub fn smallest_cycle(&self, cycles: impl IntoIterator<Item = Duration>) -> Option<Duration> {
        cycles.into_iter().find(|&cycle| {
            let traffic = Self {
                cycle,
                ..self.clone()
            };
            traffic.budget().verdict != Verdict::DoesNotFit
        })
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
            self.pdos
                .iter()
                .filter(|pdo| pdo.pdo.direction == direction)
                .count()
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
                ": T_PDOs are in by {:.3} ms, the burst takes {:.3} ms more",
                self.t_pdos_in.as_secs_f64() * 1e3,
                bit_time(self.r_pdo_bits, self.bit_rate).as_secs_f64() * 1e3
            )?;
        }
        Ok(())
    }
}
