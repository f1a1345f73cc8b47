//! Whether a machine's frames fit its cycle: each bus's budget, and when the setpoints leave.

use crate::bus::BURST_CAPACITY;
use crate::counted::counted;
use crate::machine::{Machine, Node, POLL, STATE_POLL, Seat};
use std::fmt;
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Duration;
use syncline_canopen::budget::{BLOCKING_BITS, Budget, Direction, Pdo, Traffic, Verdict};
use syncline_canopen::response_time::bit_time;
use syncline_canopen::{BIT_RATES, CobId, Frame, guarding};
use syncline_drives::bus::frame_bits;
use syncline_drives::model::{Device, Increments, Monitoring, PowerCommand, Setpoint};
use thiserror::Error;

/// The budget of one bus of a machine.
#[derive(Clone, Debug)]
pub struct BusBudget {
    /// As the machine file names it.
    pub bus: String,
    /// What the nodes on it add to a cycle.
    pub traffic: Traffic,
    /// Worst case.
    pub budget: Budget,
    /// Whether it fits, SYNC on time beside requests by SDO included.
    pub verdict: Verdict,
    /// SDO requests that the controller sends in a cycle, with their answers, beside SYNC and PDOs; at
    /// least one, as none is sent while axes move.
    pub sdo_per_cycle: usize,
    /// All that can be queued in one cycle while axes move: SYNC, PDOs, every heartbeat, an EMCY, and a request by SDO with its
    /// answer where a device is polled.
    pub load_in_motion: Duration,
    /// All that can be queued in one cycle of a whole run: before and after motion SDO, whose answers may be
    /// those to the requests of two cycles.
    pub load: Duration,
    /// By how much SYNC may come late for the clocks of all its drives to follow it, if any has one that
    /// does.
    pub sync_tolerance: Option<Duration>,
    /// The longest time that one of its devices takes to answer a request by SDO.
    pub sdo_response: Duration,
    /// From SYNC to the setpoints, which leave all buses at once.
    pub setpoint_offset: Duration,
    /// Its devices that are asked by SDO while axes move, so that a frame more than the PDOs has to fit every
    /// cycle, and each has its turn often enough.
    pub polled: Vec<String>,
    /// What it is a bus of, and which: what would fit is asked of these, and only where somebody wants to know.
    machine: Arc<Machine>,
    index: usize,
}

/// All of a machine's buses, and the one instant of the cycle that they share.
#[derive(Clone, Debug)]
pub struct MachineBudget {
    /// In the order of the machine file.
    pub buses: Vec<BusBudget>,
    /// From SYNC to receiving, supervising and sending the setpoints: the machine file's, or the
    /// latest of the buses' defaults.
    pub setpoint_offset: Duration,
    /// From SYNC, the last instant at which every bus's burst still begins before the next one.
    pub latest_burst: Duration,
}

/// Why a machine's cycle cannot be held.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub enum DoesNotFit {
    /// A bus has more to carry than its cycle takes.
    #[error("bus {bus}: {arithmetic}; {advice}")]
    Bus {
        /// As the machine file names it.
        bus: String,
        /// The sum that decides.
        arithmetic: String,
        /// What would fit.
        advice: String,
    },
    /// The drives do not take the cycle.
    #[error("a cycle of {} µs is not what the drives take: {} to {} µs in steps of {} µs",
        .cycle.as_micros(), .allowed.start().as_micros(), .allowed.end().as_micros(), .step.as_micros())]
    Cycle {
        /// What is asked for.
        cycle: Duration,
        /// What they take …
        allowed: RangeInclusive<Duration>,
        /// … in multiples of this.
        step: Duration,
    },
    /// The SDO requests while SYNC runs, which ask whether a drive's clock follows it, would keep it from
    /// that.
    #[error(
        "bus {bus}: the answer to a request by SDO behind the setpoints is out {} after SYNC, in a cycle of {}: the next \
         SYNC waits up to {} for it, and its drives' clocks follow one that is {} late: {advice}; or put some \
         of the drives on another bus",
        Millis(*.answer_out), Millis(*.cycle), Millis(*.blocking), Millis(*.tolerance)
    )]
    Requests {
        /// As the machine file names it.
        bus: String,
        /// When the answer to a request is out, after SYNC.
        answer_out: Duration,
        /// From there on it is in the way of SYNC …
        cycle: Duration,
        /// … for so long …
        blocking: Duration,
        /// … and not longer may it be.
        tolerance: Duration,
        /// What would fit.
        advice: String,
    },
    /// Devices are polled while axes move, and the request for one or its answer may be in the way of SYNC or the setpoints.
    #[error(
        "bus {bus}: {devices}, asked by SDO while axes move: a request behind the setpoints is out {} after SYNC, in a cycle of {}{}, \
         so that there is no room for request and answer; {advice}, or take a bus of its own for each",
        Millis(*.request_out), Millis(*.cycle),
        if *.outlasts_answer { "" } else { ", and the answer may make a T_PDO or a setpoint late" }
    )]
    Polls {
        /// As the machine file names it.
        bus: String,
        /// Which they are.
        devices: String,
        /// When a request is out, after SYNC.
        request_out: Duration,
        /// It has to be out by then.
        cycle: Duration,
        /// A cycle has room for the answer.
        outlasts_answer: bool,
        /// What would fit.
        advice: String,
    },
    /// There are more devices to poll than have their turn often enough.
    #[error(
        "bus {bus}: {devices}, asked by SDO for their positions every {} ms and their states every {} ms: a cycle of {} has room for \
         {transfers} of their answers, so that each has its turn every {}, and needs one every {}; {advice}; in this cycle the bus has \
         room for {most} of them",
        POLL.as_millis(), STATE_POLL.as_millis(), Millis(*.cycle), Millis(*.turn), Millis(LONGEST_TURN)
    )]
    Turns {
        /// As the machine file names it.
        bus: String,
        /// Which they are.
        devices: String,
        /// From one time that a device is asked to the next is a multiple of this.
        cycle: Duration,
        /// So many are asked in one.
        transfers: usize,
        /// How often each has its turn.
        turn: Duration,
        /// What would fit.
        advice: String,
        /// So many of them would.
        most: usize,
    },
    /// The machine file's `setpoint_offset_us` leaves too little time before it or behind it.
    #[error(
        "bus {bus}: setpoint_offset_us = {offset}: T_PDOs may arrive until {earliest}, and the \
         setpoints must leave by {latest}; leave the key out or set {earliest}…{latest}",
        offset = .offset.as_micros(), earliest = .earliest.as_micros(), latest = .latest.as_micros()
    )]
    Offset {
        /// As the machine file names it.
        bus: String,
        /// What the file says.
        offset: Duration,
        /// The least that it may say.
        earliest: Duration,
        /// The most that it may say.
        latest: Duration,
    },
    /// Setpoints leave all buses at once, and one has them leave later than another one has time for.
    #[error(
        "bus {bus}: its setpoints must leave by {latest} µs after SYNC, and the T_PDOs of bus {other} may arrive until {needed} µs; \
         take a longer cycle, a higher bit rate for {other}, or make either of them less busy",
        latest = .latest.as_micros(), needed = .needed.as_micros()
    )]
    Apart {
        /// As the machine file names it.
        bus: String,
        /// When its setpoints have to leave at the latest.
        latest: Duration,
        /// Another one, as the machine file names it …
        other: String,
        /// … and until when its T_PDOs may arrive.
        needed: Duration,
    },
    /// A bus has more devices than the controller talks to in a cycle.
    #[error(
        "bus {bus}: {devices} devices with {r_pdos} R_PDOs; at most {most} and {r_pdos_most}: take another bus for some of them"
    )]
    TooMany {
        /// As the machine file names it.
        bus: String,
        /// On it.
        devices: usize,
        /// Of them.
        r_pdos: usize,
        /// Devices at the most.
        most: usize,
        /// R_PDOs at the most.
        r_pdos_most: usize,
    },
}

/// A device that is polled is asked for its position and for its state, one at a time: it needs a turn so often on average. One
/// that is due waits for the others, and its position for its state: with turns no longer than this two positions are less
/// than [`POLL`] and two turns apart, so less than the 50 ms for which an axis has to stand to be taken to rest.
const LONGEST_TURN: Duration = {
    let (position, state) = (POLL.as_nanos() as u64, STATE_POLL.as_nanos() as u64);
    Duration::from_nanos(position * state / (position + state))
};

/// Devices on a bus at the most: in one cycle each may be told an NMT command and asked by SDO, beside a heartbeat.
const MOST_DEVICES: usize = (BURST_CAPACITY - 1) / 2;

impl MachineBudget {
    /// A machine's budget, whether it fits or not.
    #[must_use]
    pub fn of(machine: &Machine) -> Self {
        let kept = Arc::new(machine.clone());
        let mut buses: Vec<BusBudget> = (0..machine.buses.len())
            .map(|bus| BusBudget::of(&kept, bus))
            .collect();
        let latest = buses.iter().map(|bus| bus.budget.latest_burst).min();
        let stated = machine.controller.setpoint_offset;
        let setpoint_offset = stated.unwrap_or_else(|| default_offset(&buses));
        for bus in &mut buses {
            bus.setpoint_offset = setpoint_offset;
            bus.verdict = bus.requests().verdict(&bus.budget, setpoint_offset);
        }
        Self {
            setpoint_offset,
            latest_burst: latest.unwrap_or(machine.cycle),
            buses,
        }
    }

    /// By which part of a cycle the setpoints of a bus arrive before the SYNC that they are for, once the burst
    /// has left.
    #[must_use]
    pub fn early(&self, bus: usize, cycle: Duration) -> f64 {
        let Budget {
            r_pdo_bits,
            bit_rate,
            ..
        } = self.buses[bus].budget;
        let arrive = self.setpoint_offset + bit_time(r_pdo_bits, bit_rate);
        1.0 - arrive.as_secs_f64() / cycle.as_secs_f64()
    }

    /// The start-up check.
    ///
    /// # Errors
    /// The first bus that does not fit, with the arithmetic and what would.
    pub fn check(&self) -> Result<(), DoesNotFit> {
        for bus in &self.buses {
            let nodes = &bus.traffic.nodes;
            let pdos = nodes.iter().flat_map(|node| &node.pdos);
            let r_pdos = pdos
                .filter(|pdo| pdo.direction == Direction::Receive)
                .count();
            let devices = nodes.len();
            if devices > MOST_DEVICES || r_pdos > BURST_CAPACITY {
                return Err(DoesNotFit::TooMany {
                    bus: bus.bus.clone(),
                    devices,
                    r_pdos,
                    most: MOST_DEVICES,
                    r_pdos_most: BURST_CAPACITY,
                });
            }
            if bus.budget.verdict == Verdict::DoesNotFit {
                return Err(DoesNotFit::Bus {
                    bus: bus.bus.clone(),
                    arithmetic: bus.budget.to_string(),
                    advice: bus.advice(),
                });
            }
        }
        self.check_offset()?;
        for bus in &self.buses {
            bus.check_requests(self.setpoint_offset)?;
        }
        Ok(())
    }

    /// Whether the setpoints leave when every bus's T_PDOs are in and its burst has time.
    fn check_offset(&self) -> Result<(), DoesNotFit> {
        let Some([(last, earliest), (first, latest)]) = window(&self.buses) else {
            return Ok(());
        };
        if earliest > latest {
            return Err(DoesNotFit::Apart {
                bus: first.bus.clone(),
                latest,
                other: last.bus.clone(),
                needed: earliest,
            });
        }
        let offset = self.setpoint_offset;
        if !(earliest..=latest).contains(&offset) {
            // What has no room whenever setpoints leave is not helped by another offset.
            for bus in &self.buses {
                if bus.check_requests(earliest_offset(&bus.budget)).is_err() {
                    bus.check_requests(offset)?;
                }
            }
            let which = if offset < earliest { last } else { first };
            return Err(DoesNotFit::Offset {
                bus: which.bus.clone(),
                offset,
                earliest,
                latest,
            });
        }
        Ok(())
    }
}

/// The buses whose T_PDOs are in last and whose setpoints have to leave first, each with when that is: so early that requests
/// have room on each bus, where that can be.
fn window(buses: &[BusBudget]) -> Option<[(&BusBudget, Duration); 2]> {
    let in_last = buses.iter().map(|bus| (bus, earliest_offset(&bus.budget)));
    let in_last = in_last.max_by_key(|(_, at)| *at)?;
    let with_room = |bus: &BusBudget| bus.requests().latest_offset(&bus.budget);
    let without = |bus: &BusBudget| latest_offset(&bus.budget);
    let leaves_first = |latest: &dyn Fn(&BusBudget) -> Duration| {
        let latest = buses.iter().map(|bus| (bus, latest(bus)));
        latest.min_by_key(|(_, at)| *at)
    };
    let with_room = leaves_first(&with_room).filter(|(_, latest)| in_last.1 <= *latest);
    Some([in_last, with_room.or_else(|| leaves_first(&without))?])
}

/// The first whole microsecond at which a bus's T_PDOs are in.
fn earliest_offset(budget: &Budget) -> Duration {
    let micros = budget.t_pdos_in.as_nanos().div_ceil(1000);
    Duration::from_micros(micros as u64)
}

/// The last whole microsecond at which its setpoints may leave.
fn latest_offset(budget: &Budget) -> Duration {
    Duration::from_micros(budget.latest_offset.as_micros() as u64)
}

/// What requests by SDO behind the setpoints must not be in the way of.
#[derive(Clone, Copy)]
struct Requests {
    /// Devices of the bus are asked while axes move, so that there has to be room for request and answer.
    polls: bool,
    /// How far SYNC may come late to the drives whose clocks follow it.
    sync_tolerance: Option<Duration>,
    /// The longest time that a device takes to answer.
    response: Duration,
}

impl Requests {
    /// Whether requests are in nobody's way behind setpoints that leave at that offset.
    fn have_room(self, budget: &Budget, offset: Duration) -> bool {
        (!self.polls || has_room_for_poll(budget, offset)) && !self.delay_sync(budget, offset)
    }

    /// Whether a request by SDO that leaves behind setpoints at that offset, or its answer, may keep SYNC from the drives for
    /// longer than their clocks follow.
    fn delay_sync(self, budget: &Budget, offset: Duration) -> bool {
        self.sync_tolerance.is_some_and(|tolerance| {
            let request_delays = budget.request_out(offset) > budget.cycle;
            // Answers come seldom that are as long as a frame can be.
            let answer_delays = budget.answer_out(offset, self.response) > budget.cycle;
            budget.sync_jitter > tolerance && request_delays
                || budget.plain_frame() > tolerance && answer_delays
        })
    }

    /// Whether a bus fits with setpoints that leave at that offset.
    fn verdict(self, budget: &Budget, offset: Duration) -> Verdict {
        match self.delay_sync(budget, offset) {
            true => Verdict::DoesNotFit,
            false => budget.verdict,
        }
    }

    /// The last whole microsecond at which the setpoints of a bus may leave: so early that requests have room, where that can be.
    fn latest_offset(self, budget: &Budget) -> Duration {
        let micros = |micros: u64| Duration::from_micros(micros);
        let [mut least, mut most] =
            [earliest_offset(budget), latest_offset(budget)].map(|it| it.as_micros() as u64);
        if self.have_room(budget, micros(most)) || !self.have_room(budget, micros(least)) {
            return micros(most);
        }
        // The later, the less room there is.
        while least + 1 < most {
            let middle = u64::midpoint(least, most);
            match self.have_room(budget, micros(middle)) {
                true => least = middle,
                false => most = middle,
            }
        }
        micros(least)
    }

    /// Whether a bus alone holds everything with setpoints at the stated offset, or else at its own.
    fn hold(self, budget: &Budget, stated: Option<Duration>) -> bool {
        let window = [earliest_offset(budget), self.latest_offset(budget)];
        let offset = stated.unwrap_or_else(|| offset_within(window, budget.setpoint_offset));
        budget.verdict != Verdict::DoesNotFit
            && (window[0]..=window[1]).contains(&offset)
            && self.have_room(budget, offset)
    }
}

/// An offset that is wanted, or else, where there is one at all, the middle of what is taken.
fn offset_within([earliest, latest]: [Duration; 2], wanted: Duration) -> Duration {
    match earliest <= latest && !(earliest..=latest).contains(&wanted) {
        true => {
            let middle = earliest + (latest - earliest) / 2;
            Duration::from_micros(middle.as_micros() as u64)
        }
        false => wanted,
    }
}

/// When the setpoints leave all buses: as the slowest of them would have it, or else in the middle of what all of them take.
fn default_offset(buses: &[BusBudget]) -> Duration {
    let slowest = buses.iter().map(|bus| bus.budget.setpoint_offset).max();
    let slowest = slowest.unwrap_or_default();
    match window(buses) {
        Some([(_, earliest), (_, latest)]) => offset_within([earliest, latest], slowest),
        None => slowest,
    }
}

/// Whether a request by SDO that leaves behind setpoints at that offset, and its answer, are never in the way.
fn has_room_for_poll(budget: &Budget, setpoint_offset: Duration) -> bool {
    // The request leaves in the cycle's rest, and its answer is in the way like an EMCY.
    budget.outlasts_emcy && budget.request_out(setpoint_offset) <= budget.cycle
}

/// How often each of so many devices has its turn, of which so many are asked in a cycle, where that is too seldom. One that is
/// asked in every cycle cannot be asked more often.
fn long_turn(devices: usize, transfers: usize, cycle: Duration) -> Option<Duration> {
    let turn = cycle * devices.div_ceil(transfers) as u32;
    (devices > transfers && turn > LONGEST_TURN).then_some(turn)
}

/// A bus's nodes, each with its index among all.
fn nodes_of(machine: &Machine, bus: usize) -> impl Iterator<Item = (usize, Node<'_>)> {
    let nodes = machine.nodes().enumerate();
    nodes.filter(move |(_, node)| node.bus == bus)
}

/// A bus's nodes, each with its device.
fn nodes(machine: &Machine, bus: usize) -> Vec<(Node<'_>, Device)> {
    nodes_of(machine, bus)
        .map(|(index, node)| (node, machine.device(index)))
        .collect()
}

/// Whether a device is asked by SDO while axes move.
fn is_polled(device: &Device) -> bool {
    matches!(device.spec().monitoring, Monitoring::Poll(_))
}

/// SDO requests in a cycle, to devices that take so long to answer: one at a time of each node.
fn transfers(budget: &Budget, nodes: usize, answer: Duration) -> usize {
    budget.sdo_transfers(answer).min(nodes.max(1))
}

impl BusBudget {
    fn of(machine: &Arc<Machine>, bus: usize) -> Self {
        let nodes = nodes(machine, bus);
        let devices = nodes.iter().map(|(_, device)| device);
        let traffic = Traffic {
            bit_rate: machine.buses[bus].bitrate,
            cycle: machine.cycle,
            nodes: (devices.clone())
                .map(|device| device.spec().traffic())
                .collect(),
        };
        let budget = traffic.budget();
        let locks = devices
            .clone()
            .filter_map(|device| device.spec().clock_lock);
        let sync_tolerance = locks.map(|lock| lock.tolerance).min();
        let answers = devices.map(|device| device.spec().sdo_response);
        let answer = answers.max().unwrap_or_default();
        let sdo_per_cycle = transfers(&budget, nodes.len(), answer);
        let name = |(node, _): &(Node<'_>, Device)| format!("{} ({})", node.name, node.model.title);
        let polled = nodes.iter().filter(|(_, device)| is_polled(device));
        let polled: Vec<String> = polled.map(name).collect();
        let poll = match !polled.is_empty() {
            true => bit_time(2 * BLOCKING_BITS, budget.bit_rate),
            false => Duration::ZERO,
        };
        let sdo = bit_time(3 * BLOCKING_BITS, budget.bit_rate) * sdo_per_cycle as u32;
        Self {
            bus: machine.buses[bus].name.clone(),
            load_in_motion: budget.load + poll,
            load: budget.load + sdo,
            sdo_per_cycle,
            sync_tolerance,
            sdo_response: answer,
            setpoint_offset: budget.setpoint_offset,
            verdict: budget.verdict,
            polled,
            budget,
            traffic,
            machine: Arc::clone(machine),
            index: bus,
        }
    }

    /// Whether all of another traffic of it is on time, so many of whose devices are polled.
    fn is_on_time(&self, traffic: &Traffic, polled: usize) -> bool {
        let budget = traffic.budget();
        let requests = Requests {
            polls: polled > 0,
            ..self.requests()
        };
        let transfers = transfers(&budget, traffic.nodes.len(), self.sdo_response);
        let has_turns = long_turn(polled, transfers, budget.cycle).is_none();
        requests.hold(&budget, self.machine.controller.setpoint_offset) && has_turns
    }

    /// The least cycle that fits and that all devices of the machine take.
    #[must_use]
    pub fn smallest_cycle(&self) -> Option<Duration> {
        let machine = &self.machine;
        let places = nodes_of(machine, self.index).map(|(index, _)| index);
        let places: Vec<usize> = places.collect();
        // What a device sends in a cycle may depend on that.
        let in_cycle = |cycle: Duration| Traffic {
            bit_rate: self.traffic.bit_rate,
            cycle,
            nodes: (places.iter())
                .map(|&index| machine.device_in(index, cycle).spec().traffic())
                .collect(),
        };
        least(&cycles(machine).collect::<Vec<_>>(), |cycle| {
            self.is_on_time(&in_cycle(cycle), self.polled.len())
        })
    }

    /// The least higher bit rate that all its devices take and that fits this cycle.
    fn higher_bit_rate(&self) -> Option<u32> {
        let mut rates = BIT_RATES.iter().copied().filter(|rate| {
            let mut models = nodes_of(&self.machine, self.index).map(|(_, node)| node.model);
            *rate > self.traffic.bit_rate && models.all(|model| model.bitrates.contains(rate))
        });
        let at_rate = |bit_rate| Traffic {
            bit_rate,
            ..self.traffic.clone()
        };
        rates.find(|rate| self.is_on_time(&at_rate(*rate), self.polled.len()))
    }

    /// So many of those that are polled the cycle has room for beside the other devices, where not for all of them.
    fn most_polled(&self) -> usize {
        let nodes = nodes(&self.machine, self.index);
        // Without the last of them.
        let with_polled = |count: usize| {
            let mut left = count;
            let stays = nodes.iter().map(|(_, device)| {
                let stays = !is_polled(device) || left > 0;
                left -= usize::from(is_polled(device) && stays);
                stays
            });
            let kept = self.traffic.nodes.iter().zip(stays);
            let kept = kept.filter(|(_, stays)| *stays);
            Traffic {
                nodes: kept.map(|(node, _)| node.clone()).collect(),
                ..self.traffic.clone()
            }
        };
        let mut fewer = (1..self.polled.len()).rev();
        let most = fewer.find(|count| self.is_on_time(&with_polled(*count), *count));
        most.unwrap_or(0)
    }

    /// Share of the bus's time that frames take on average in motion, by their exact lengths.
    #[must_use]
    pub fn typical_load(&self) -> f64 {
        let nodes = nodes(&self.machine, self.index);
        typical_load(&self.machine, &nodes, self.traffic.bit_rate)
    }

    /// What requests on it must not be in the way of.
    fn requests(&self) -> Requests {
        Requests {
            polls: !self.polled.is_empty(),
            sync_tolerance: self.sync_tolerance,
            response: self.sdo_response,
        }
    }

    /// After SYNC, the first and the last instant at which its setpoints may leave: T_PDOs are in, and requests by SDO have room,
    /// where that can be.
    #[must_use]
    pub fn offsets(&self) -> [Duration; 2] {
        [
            earliest_offset(&self.budget),
            self.requests().latest_offset(&self.budget),
        ]
    }

    /// Whether requests by SDO are in nobody's way behind setpoints that leave at that offset, and each device that is asked
    /// while axes move has its turn often enough.
    fn check_requests(&self, setpoint_offset: Duration) -> Result<(), DoesNotFit> {
        self.check_polls(setpoint_offset)?;
        let budget = &self.budget;
        match self.sync_tolerance {
            Some(tolerance) if self.requests().delay_sync(budget, setpoint_offset) => {
                Err(DoesNotFit::Requests {
                    bus: self.bus.clone(),
                    answer_out: budget.answer_out(setpoint_offset, self.sdo_response),
                    cycle: budget.cycle,
                    blocking: budget.sync_jitter,
                    tolerance,
                    advice: self.other_cycle(),
                })
            }
            _ => Ok(()),
        }
    }

    fn check_polls(&self, setpoint_offset: Duration) -> Result<(), DoesNotFit> {
        let Self { budget, polled, .. } = self;
        let (bus, devices, cycle) = (self.bus.clone(), polled.join(", "), budget.cycle);
        if polled.is_empty() {
            return Ok(());
        }
        if !has_room_for_poll(budget, setpoint_offset) {
            return Err(DoesNotFit::Polls {
                bus,
                devices,
                request_out: budget.request_out(setpoint_offset),
                cycle,
                outlasts_answer: budget.outlasts_emcy,
                advice: self.other_cycle(),
            });
        }
        let transfers = self.sdo_per_cycle;
        if let Some(turn) = long_turn(polled.len(), transfers, cycle) {
            return Err(DoesNotFit::Turns {
                bus,
                devices,
                cycle,
                transfers,
                turn,
                advice: self.other_cycle(),
                most: self.most_polled(),
            });
        }
        Ok(())
    }

    /// The least cycle that fits, or else the least higher bit rate.
    fn other_cycle(&self) -> String {
        if let Some(cycle) = self.smallest_cycle() {
            return format!("the least cycle that fits is {}", Millis(cycle));
        }
        match self.higher_bit_rate() {
            Some(rate) => format!(
                "no cycle that its drives take fits; the least bit rate that fits is {} kbit/s",
                rate / 1000
            ),
            None => "neither a cycle nor a higher bit rate that its drives take fits".to_owned(),
        }
    }

    /// What would fit, or fit better, in words.
    #[must_use]
    pub fn advice(&self) -> String {
        let cycle = self.other_cycle();
        if self.traffic.nodes.len() < 2 {
            return cycle;
        }
        let budgets = self.traffic.on_two_buses().map(|half| half.budget());
        let [most, _] = &budgets;
        let requests = self.requests();
        let verdicts = (budgets.each_ref()).map(|half| {
            let window = [earliest_offset(half), requests.latest_offset(half)];
            requests.verdict(half, offset_within(window, half.setpoint_offset))
        });
        let verdict = match verdicts.contains(&Verdict::DoesNotFit) {
            true => Verdict::DoesNotFit,
            false => verdicts[0],
        };
        format!(
            "{cycle}; on two buses it is {} of {} each: {verdict}",
            Millis(most.demand),
            Millis(most.cycle)
        )
    }
}

/// The first of some cycles that fits: looked for in strides, and in the last one by halves, as a longer cycle has more room.
fn least(cycles: &[Duration], fits: impl Fn(Duration) -> bool) -> Option<Duration> {
    const STRIDE: usize = 100;
    let stride = cycles
        .chunks(STRIDE)
        .find(|stride| stride.last().is_some_and(|last| fits(*last)))?;
    stride
        .get(stride.partition_point(|cycle| !fits(*cycle)))
        .copied()
}

/// The cycles that all devices of the machine take, the least first: all its buses have the same one.
fn cycles(machine: &Machine) -> impl Iterator<Item = Duration> {
    let models = || machine.nodes().map(|node| node.model);
    let step = models().map(|model| model.cycle_step).max();
    let longest = models().map(|model| *model.cycles.end()).min();
    let steps = step.zip(longest).into_iter().flat_map(|(step, longest)| {
        (1..)
            .map(move |count| step * count)
            .take_while(move |cycle| *cycle <= longest)
    });
    steps.filter(move |cycle| models().all(|model| model.takes_cycle(*cycle)))
}

/// Positions along each axis that the typical load is averaged over.
const POSITIONS: u32 = 256;

/// The PDOs of a device in one cycle of motion at `position`, if it can be there.
fn in_motion(device: &Device, position: Increments) -> Option<Vec<Frame>> {
    let mut frames = device.feedback()?.in_motion(position);
    if let Some(drive) = device.drive() {
        let setpoint = Setpoint::at(position);
        drive.check(setpoint).ok()?;
        let r_pdos = drive.spec().r_pdos.iter();
        let mut r_pdos: Vec<_> = r_pdos.map(|pdo| Frame::new(pdo.cob_id, &[])).collect();
        (drive.clone_box()).encode(PowerCommand::Run, setpoint, &mut r_pdos);
        frames.extend(r_pdos);
    }
    Some(frames)
}

/// The PDOs of a device that has no place, in a cycle in which all that they carry is 0; those that come by event
/// do not.
fn at_rest(device: &Device) -> Vec<Frame> {
    let spec = device.spec();
    let t_pdos = spec.t_pdos.iter().filter(|_| spec.answers_sync);
    let frame = |pdo: &Pdo| Frame::new(pdo.cob_id, &[0; 8][..pdo.bytes.into()]);
    t_pdos.chain(&spec.r_pdos).map(frame).collect()
}

/// Mean exact bits of SYNC, PDOs and heartbeats over the axes' whole travel, as a share of time.
fn typical_load(machine: &Machine, nodes: &[(Node<'_>, Device)], bit_rate: u32) -> f64 {
    let bits = |frame: &Frame| f64::from(frame_bits(frame));
    let mut per_cycle = bits(&Frame::new(CobId::SYNC, &[]));
    for (node, device) in nodes {
        let Some(Seat { axis, scaling }) = node.seat else {
            per_cycle += at_rest(device).iter().map(bits).sum::<f64>();
            continue;
        };
        let (least, most) = machine.axes[axis].limits.position;
        let lengths: Vec<f64> = (0..POSITIONS)
            .map(|step| least + (most - least) * f64::from(step) / f64::from(POSITIONS))
            .filter_map(|mm| scaling.to_increments(mm).ok())
            .filter_map(|position| in_motion(device, position))
            .map(|frames| frames.iter().map(bits).sum())
            .collect();
        per_cycle += lengths.iter().sum::<f64>() / lengths.len().max(1) as f64;
    }
    let operational = [0x05];
    let guarding: f64 = nodes
        .iter()
        .filter_map(|(node, device)| match device.spec().monitoring {
            Monitoring::Guarding { every } => Some((node.id, every)),
            _ => None,
        })
        .map(|(node, every)| {
            let answer = bits(&Frame::new(CobId::error_control(node), &operational));
            let request = guarding::request(node).as_ref().map_or(0.0, bits);
            (request + answer) / every.as_secs_f64()
        })
        .sum();
    let heartbeats: f64 = nodes
        .iter()
        .filter(|(_, device)| device.spec().monitoring == Monitoring::Heartbeat)
        .map(|(node, _)| node.id)
        .chain([machine.controller.node])
        .map(|node| bits(&Frame::new(CobId::error_control(node), &operational)))
        .sum();
    let seconds = |bits: f64| bits / f64::from(bit_rate);
    seconds(per_cycle) / machine.cycle.as_secs_f64()
        + seconds(guarding)
        + seconds(heartbeats) / machine.controller.heartbeat.as_secs_f64()
}

/// A time as messages show it: milliseconds, three decimals.
struct Millis(Duration);

impl fmt::Display for Millis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.3} ms", self.0.as_secs_f64() * 1e3)
    }
}

/// The whole answer in words.
impl fmt::Display for BusBudget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let budget = &self.budget;
        writeln!(f, "bus {}: {}", self.bus, self.verdict)?;
        writeln!(f, "  {budget}")?;
        writeln!(f, "  {}", self.advice())?;
        writeln!(f)?;
        writeln!(
            f,
            "  PDO     node  id      bits               latest    deadline"
        )?;
        for pdo in &budget.pdos {
            let (kind, event) = match pdo.pdo.direction {
                Direction::Transmit => ("T_PDO", "in by"),
                Direction::Receive => ("R_PDO", "begins by"),
            };
            let latest = pdo
                .latest
                .map_or_else(|| "no bound".into(), |it| Millis(it).to_string());
            let times = match pdo.times {
                1 => String::new(),
                times => format!("{times}×"),
            };
            writeln!(
                f,
                "  {kind}   {:<4}  {:03X}h   {:>4}  {event:>9} {latest:>9}   {:>9}",
                pdo.node,
                pdo.pdo.cob_id.get(),
                format!("{times}{}", pdo.bits),
                Millis(pdo.deadline).to_string()
            )?;
        }
        writeln!(f)?;
        let emcy = if budget.outlasts_emcy {
            ""
        } else {
            "; an EMCY makes a T_PDO or a setpoint of its cycle late, which is counted"
        };
        let hold = match self.offsets() {
            [earliest, latest] if earliest <= latest => {
                format!("{}…{} hold", Millis(earliest), Millis(latest))
            }
            _ => "none holds".to_owned(),
        };
        let burst = Millis(bit_time(budget.r_pdo_bits, budget.bit_rate));
        let share = |time: Duration| time.as_secs_f64() / budget.cycle.as_secs_f64();
        for (name, value) in [
            (
                "SYNC jitter",
                format!(
                    "0…{}, by one frame that is already on its way",
                    Millis(budget.sync_jitter)
                ),
            ),
            (
                "T_PDOs in",
                format!("{} after SYNC", Millis(budget.t_pdos_in)),
            ),
            (
                "setpoint offset",
                format!(
                    "{} after SYNC, {hold}; the burst takes {burst}{emcy}",
                    Millis(self.setpoint_offset)
                ),
            ),
            (
                "quiet window",
                format!(
                    "{} before SYNC no SDO is under way",
                    Millis(budget.quiet_window)
                ),
            ),
            (
                "room for SDO",
                format!(
                    "{}, {} a cycle",
                    Millis(budget.sdo_room),
                    counted(self.sdo_per_cycle as u64, "transfer", "transfers")
                ),
            ),
            (
                "load",
                format!(
                    "{:.1} % of a cycle at most in motion, {:.1} % with SDO",
                    share(self.load_in_motion) * 100.0,
                    share(self.load) * 100.0
                ),
            ),
            (
                "typical load",
                format!("{:.1} % of the bus", self.typical_load() * 100.0),
            ),
        ] {
            writeln!(f, "  {name:<16}{value}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::path::Path;

    fn machine(drives: u32, cycle_us: u32, setpoint_offset: &str) -> Machine {
        let mut file = format!(
            "[machine]\nname = \"m\"\ncycle_us = {cycle_us}\n\
             [controller]\n{setpoint_offset}\n\
             [[bus]]\nname = \"one\"\nbitrate = 1_000_000\nport = \"sim\"\n"
        );
        for (axis, name) in ["X", "Y", "Z", "A", "B", "C"]
            .iter()
            .take(drives as usize)
            .enumerate()
        {
            file += &format!(
                "[[drive]]\nname = \"{name}1\"\nbus = \"one\"\nnode = {}\nmodel = \"lxm32m\"\nzero = 0\n\
                 [[axis]]\nname = \"{name}\"\ndrives = [\"{name}1\"]\npitch = 10.0\ngear = 1.0\n\
                 max_velocity = 100.0\nmax_acceleration = 1000.0\nmax_jerk = 10000.0\n\
                 soft_limits = [0.0, 500.0]\nfollowing_error_limit = 1.0\nstandstill_window = 0.1\n",
                axis + 1
            );
        }
        Machine::parse(Path::new("m.toml"), &file).unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn a_machine_that_does_not_fit_is_refused_with_the_arithmetic() {
        let file = std::fs::read_to_string("../examples/portal/machine.toml").unwrap();
        let file = file.replace("cycle_us = 2000", "cycle_us = 1000");
        let portal = Machine::parse(Path::new("portal.toml"), &file).unwrap();
        let refused = MachineBudget::of(&portal).check().unwrap_err();
        assert_eq!(
            refused.to_string(),
            "bus portal: SYNC 55 + 4 T_PDO 460 + 4 R_PDO 460 + one blocking frame 135 = 1110 bits \
             at 1000 kbit/s = 1.110 ms of 1.000 ms (111.0 %): does not fit; the least cycle that \
             fits is 2.000 ms; on two buses it is 0.650 ms of 1.000 ms each: fits, with a warning"
        );
    }

    #[test]
    fn an_offset_that_the_file_states_is_checked() {
        for (offset, good) in [("500", false), ("900", true), ("1750", false)] {
            let machine = machine(3, 2000, &format!("setpoint_offset_us = {offset}"));
            let budget = MachineBudget::of(&machine);
            assert_eq!(
                budget.check().is_ok(),
                good,
                "{offset}: {:?}",
                budget.check()
            );
        }
    }

    /// Two buses of which one is slow: it is the one that is told, and no key that is not there.
    #[test]
    fn the_bus_that_does_not_fit_is_told() {
        let machine = |bitrate| {
            let mut machine = machine(4, 2000, "");
            let mut slow = machine.buses[0].clone();
            (slow.name, slow.bitrate) = ("slow".to_owned(), bitrate);
            machine.buses.push(slow);
            for drive in &mut machine.drives[2..] {
                drive.bus = 1;
            }
            MachineBudget::of(&machine).check()
        };
        assert_eq!(machine(1_000_000), Ok(()));
        for bitrate in [125_000, 250_000] {
            let told = machine(bitrate).unwrap_err().to_string();
            assert!(told.starts_with("bus slow: "), "{told}");
        }
        // In between either fits alone, and both together do not.
        let apart = (260_000..1_000_000).step_by(10_000).map(machine);
        for told in apart.filter_map(Result::err).map(|it| it.to_string()) {
            assert!(told.contains("bus slow"), "{told}");
            assert!(!told.contains("setpoint_offset_us"), "{told}");
        }
    }

    fn parsed(file: &str) -> Machine {
        Machine::parse(Path::new("m.toml"), file).unwrap_or_else(|error| panic!("{error}"))
    }

    /// Two buses, the slow one with an encoder alone: there are offsets that both take, and neither's own is one.
    const APART: &str = "[machine]\nname = \"a\"\ncycle_us = 5000\n\
        [[bus]]\nname = \"slow\"\nbitrate = 125_000\n[[bus]]\nname = \"fast\"\nbitrate = 500_000\n\
        [[drive]]\nname = \"X\"\nbus = \"fast\"\nnode = 1\nmodel = \"tlc5xx\"\n\
        [[drive]]\nname = \"Z\"\nbus = \"fast\"\nnode = 2\nmodel = \"tsp10\"\n\
        [[encoder]]\nname = \"e\"\nbus = \"slow\"\nnode = 3\nmodel = \"twk_crn\"\npitch = 10.0\n\
        [[axis]]\nname = \"X\"\ndrives = [\"X\"]\npitch = 10.0\nmax_velocity = 50.0\nmax_acceleration = 400.0\n\
        max_jerk = 20_000.0\nsoft_limits = [-300.0, 0.0]\nfollowing_error_limit = 1.0\n\
        [[axis]]\nname = \"Z\"\ndrives = [\"Z\"]\npitch = 10.0\nmax_velocity = 50.0\nmax_acceleration = 400.0\n\
        max_jerk = 20_000.0\nsoft_limits = [-300.0, 0.0]\nfollowing_error_limit = 1.0\nfeedback = \"e\"\n\
        difference_limit = 0.2\n";

    #[test]
    fn buses_share_an_offset_that_none_would_have_alone() {
        let budget = MachineBudget::of(&parsed(APART));
        assert_eq!(budget.check(), Ok(()));
        let own = budget.buses.iter().map(|bus| bus.budget.setpoint_offset);
        let own: Vec<_> = own.collect();
        let micros = Duration::from_micros;
        assert_eq!(own, [3910, 2410].map(micros));
        // T_PDOs of the slow one come until 2540 µs, and setpoints on the other one have to leave at 2800 µs.
        assert_eq!(budget.setpoint_offset, micros(2670));
    }

    proptest! {
        /// Buses are refused as too far apart where there is no offset that each of them takes, and only there; else the default is
        /// one.
        #[test]
        fn buses_are_apart_where_they_take_no_offset_in_common(
            drives in prop::collection::vec((0..3usize, prop::sample::select(vec!["lxm32m", "cia402_csp", "tlc5xx"])), 2..7),
            kbit in prop::array::uniform3(prop::sample::select(vec![125u32, 250, 500, 1000])),
            cycle_ms in 2..16u32,
        ) {
            let mut machine = machine(drives.len() as u32, cycle_ms * 1000, "");
            let bus = |kbit: u32| super::super::machine::Bus {
                name: format!("{kbit}"),
                bitrate: kbit * 1000,
                ..machine.buses[0].clone()
            };
            machine.buses = kbit.map(bus).to_vec();
            for (drive, (bus, model)) in machine.drives.iter_mut().zip(drives) {
                drive.bus = bus;
                drive.model = syncline_drives::model::Model::by_name(model).unwrap();
            }
            let budget = MachineBudget::of(&machine);
            prop_assume!(budget.buses.iter().all(|bus| bus.budget.verdict != Verdict::DoesNotFit));
            let takes = |bus: &BusBudget, offset: Duration| {
                (bus.budget.t_pdos_in..=bus.budget.latest_offset).contains(&offset)
            };
            let offsets = (0..=u64::from(cycle_ms) * 1000).map(Duration::from_micros);
            let mut common = offsets.filter(|offset| budget.buses.iter().all(|bus| takes(bus, *offset)));
            let is_apart = matches!(budget.check(), Err(DoesNotFit::Apart { .. }));
            let has_room = |bus: &BusBudget, offset| bus.requests().have_room(&bus.budget, offset);
            let holds = |offset| budget.buses.iter().all(|bus| has_room(bus, offset));
            if common.clone().any(holds) {
                prop_assert_eq!(budget.check(), Ok(()));
            }
            prop_assert_eq!(is_apart, common.next().is_none());
            let offset = budget.setpoint_offset;
            prop_assert!(is_apart || budget.buses.iter().all(|bus| takes(bus, offset)), "{:?}", offset);
        }
    }

    /// So many TSP10-CBE on one bus, and an encoder.
    fn steppers(count: usize, cycle_us: u32) -> MachineBudget {
        let mut file = format!(
            "[machine]\nname = \"s\"\ncycle_us = {cycle_us}\n[[bus]]\nname = \"b\"\nbitrate = 1_000_000\n\
             [[encoder]]\nname = \"e\"\nbus = \"b\"\nnode = 40\nmodel = \"twk_crn\"\npitch = 10.0\n"
        );
        for (place, axis) in ["X", "Y", "Z", "U", "V", "W", "A"][..count]
            .iter()
            .enumerate()
        {
            let at_home = match place {
                0 => "feedback = \"e\"\ndifference_limit = 0.3\n",
                _ => "homing = { kind = \"set_here\" }\n",
            };
            file += &format!(
                "[[drive]]\nname = \"D{place}\"\nbus = \"b\"\nnode = {}\nmodel = \"tsp10\"\n\
                 [[axis]]\nname = \"{axis}\"\ndrives = [\"D{place}\"]\npitch = 10.0\nmax_velocity = 20.0\n\
                 max_acceleration = 100.0\nmax_jerk = 2000.0\nsoft_limits = [-300.0, 300.0]\n\
                 following_error_limit = 1.0\n{at_home}",
                place + 1
            );
        }
        MachineBudget::of(&parsed(&file))
    }

    #[test]
    fn devices_that_are_polled_too_seldom_are_refused() {
        let told = steppers(5, 10_000).check().unwrap_err().to_string();
        insta::assert_snapshot!(told);
        assert!(matches!(
            steppers(7, 12_000).check(),
            Err(DoesNotFit::Turns { .. })
        ));
        for count in 1..=7 {
            for cycle_ms in 2..=20 {
                let budget = steppers(count, cycle_ms * 1000);
                let told = budget.check();
                let transfers = budget.buses[0].sdo_per_cycle;
                // Requests in a cycle, each for 20 ms or 50 ms of it.
                let asked = count as f64 * f64::from(cycle_ms) * (1.0 / 20.0 + 1.0 / 50.0);
                let is_too_much = asked > transfers as f64 && count > transfers;
                match &told {
                    Ok(()) => assert!(!is_too_much, "{count} at {cycle_ms} ms"),
                    Err(DoesNotFit::Turns { .. }) => assert!(count > transfers),
                    // No room at all.
                    Err(DoesNotFit::Bus { .. } | DoesNotFit::Polls { .. }) => {}
                    Err(other) => panic!("{count} at {cycle_ms} ms: {other}"),
                }
                // What is advised is taken.
                if let Err(DoesNotFit::Turns { most, .. }) = told {
                    let cycle = budget.buses[0]
                        .smallest_cycle()
                        .map(|it| it.as_micros() as u32);
                    assert!(cycle.is_none_or(|cycle| steppers(count, cycle).check().is_ok()));
                    let fewer = (most > 0).then(|| steppers(most, cycle_ms * 1000).check());
                    assert!(
                        fewer.as_ref().is_none_or(Result::is_ok),
                        "{most} of {count} at {cycle_ms} ms: {fewer:?}"
                    );
                }
            }
        }
    }

    /// A bus without room for one request names the devices and the cycle that has room.
    #[test]
    fn a_bus_without_room_for_polls_names_the_devices() {
        let told = steppers(1, 2250).check().unwrap_err().to_string();
        insta::assert_snapshot!(told);
    }

    /// Where no cycle fits, the bit rate that does is named.
    #[test]
    fn the_bit_rate_that_fits_is_named() {
        let file = "[machine]\nname = \"a\"\ncycle_us = 20_000\n[[bus]]\nname = \"b\"\nbitrate = 10_000\n\
            [[drive]]\nname = \"X\"\nbus = \"b\"\nnode = 1\nmodel = \"cia402_csp\"\n\
            [[axis]]\nname = \"X\"\ndrives = [\"X\"]\npitch = 10.0\nmax_velocity = 50.0\nmax_acceleration = 400.0\n\
            max_jerk = 20_000.0\nsoft_limits = [-300.0, 0.0]\nfollowing_error_limit = 1.0\n";
        let told = MachineBudget::of(&parsed(file))
            .check()
            .unwrap_err()
            .to_string();
        let advice =
            "no cycle that its drives take fits; the least bit rate that fits is 50 kbit/s";
        assert!(told.contains(advice), "{told}");
        let faster = file.replace("10_000", "50_000");
        assert_eq!(MachineBudget::of(&parsed(&faster)).check(), Ok(()));
    }

    #[test]
    fn more_devices_than_the_controller_talks_to_in_a_cycle_are_refused() {
        let mut machine = machine(6, 20_000, "");
        let mut drive = machine.drives[5].clone();
        for node in 7..=40 {
            drive.node = syncline_canopen::NodeId::new(node).unwrap();
            machine.drives.push(drive.clone());
            let fits = MachineBudget::of(&machine).check();
            let told = matches!(fits, Err(DoesNotFit::TooMany { .. }));
            assert_eq!(told, node > 31, "{fits:?}");
        }
    }

    /// Three drives at 250 kbit/s: requests, or their answers, were let stand in the way of one SYNC after the other.
    #[test]
    fn a_slow_bus_without_room_for_a_request_is_refused() {
        let machine = |cycle_us| {
            let mut machine = machine(3, cycle_us, "");
            machine.buses[0].bitrate = 250_000;
            machine
        };
        let refused = MachineBudget::of(&machine(4000)).check().unwrap_err();
        assert_eq!(
            refused.to_string(),
            "bus one: the answer to a request by SDO behind the setpoints is out 6.620 ms after SYNC, in a cycle of \
             4.000 ms: the next SYNC waits up to 0.540 ms for it, and its drives' clocks follow one that is \
             0.250 ms late: the least cycle that fits is 7.000 ms; or put some of the drives on another bus"
        );
        // What `budget` prints says the same.
        let [bus] = &MachineBudget::of(&machine(4000)).buses[..] else {
            panic!("one bus");
        };
        assert_eq!(bus.verdict, Verdict::DoesNotFit);
        assert_eq!(bus.smallest_cycle(), Some(Duration::from_millis(7)));
        assert!(
            bus.to_string().starts_with("bus one: does not fit\n"),
            "{bus}"
        );
        // With setpoints that leave earlier than it would have them otherwise.
        assert_eq!(MachineBudget::of(&machine(7000)).check(), Ok(()));
        assert!(MachineBudget::of(&machine(6000)).check().is_err());
    }
}
