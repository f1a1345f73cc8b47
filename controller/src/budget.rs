//! Whether a machine's frames fit its cycle: each bus's budget, and when the setpoints leave.

use crate::bus::BURST_CAPACITY;
use crate::machine::{Machine, Node, Seat};
use std::fmt;
use std::ops::RangeInclusive;
use std::time::Duration;
use syncline_canopen::budget::{BLOCKING_BITS, Budget, Direction, Pdo, Traffic, Verdict};
use syncline_canopen::response_time::bit_time;
use syncline_canopen::{CobId, Frame, guarding};
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
    /// Share of the bus's time that frames take on average in motion, by their exact lengths.
    pub typical_load: f64,
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
    /// One of its devices is asked by SDO while axes move, so that a frame more than the PDOs has to fit every
    /// cycle.
    pub is_polled: bool,
    /// The least cycle that fits and that all its drives take.
    pub smallest_cycle: Option<Duration>,
}

/// All of a machine's buses, and the one instant of the cycle that they share.
#[derive(Clone, Debug)]
pub struct MachineBudget {
    /// In the order of the machine file.
    pub buses: Vec<BusBudget>,
    /// From SYNC to receiving, supervising and sending the setpoints: the machine file's, or the
    /// latest of the buses' defaults.
    pub setpoint_offset: Duration,
    /// Whether the machine file says that.
    is_stated: bool,
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
        "bus {bus}: a request by SDO behind the setpoints is out {} after SYNC, in a cycle of {}: the next \
         SYNC waits up to {} for it, and its drives' clocks follow one that is {} late; take a longer \
         cycle, a higher bit rate or another bus for some of the drives",
        Millis(*.request_out), Millis(*.cycle), Millis(*.blocking), Millis(*.tolerance)
    )]
    Requests {
        /// As the machine file names it.
        bus: String,
        /// When a request is out, after SYNC.
        request_out: Duration,
        /// From there on it is in the way of SYNC …
        cycle: Duration,
        /// … for so long …
        blocking: Duration,
        /// … and not longer may it be.
        tolerance: Duration,
    },
    /// A device is polled while axes move, and its answer may be in the way of the setpoints.
    #[error(
        "bus {bus}: a device on it is polled by SDO while axes move, and there is no room in a cycle for \
         request and answer beside the setpoints; take a longer cycle, a higher bit rate or a bus of its own for it"
    )]
    Polls {
        /// As the machine file names it.
        bus: String,
    },
    /// The machine file's `setpoint_offset_us` leaves too little time before it or behind it.
    #[error(
        "bus {bus}: setpoint_offset_us = {offset}: T_PDOs may arrive until {earliest}, and the \
         setpoints must leave from {latest}; leave the key out or set {earliest}…{latest}",
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
        "bus {bus}: its setpoints must leave {latest} µs after SYNC, and the T_PDOs of bus {other} may arrive until {needed} µs; \
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

/// Devices on a bus at the most: in one cycle each may be told an NMT command and asked by SDO, beside a heartbeat.
const MOST_DEVICES: usize = (BURST_CAPACITY - 1) / 2;

impl MachineBudget {
    /// A machine's budget, whether it fits or not.
    #[must_use]
    pub fn of(machine: &Machine) -> Self {
        let mut buses: Vec<BusBudget> = (0..machine.buses.len())
            .map(|bus| BusBudget::of(machine, bus))
            .collect();
        let default = buses.iter().map(|bus| bus.budget.setpoint_offset).max();
        let latest = buses.iter().map(|bus| bus.budget.latest_burst).min();
        let stated = machine.controller.setpoint_offset;
        let setpoint_offset = stated.or(default).unwrap_or_default();
        for bus in &mut buses {
            bus.verdict = verdict(&bus.budget, setpoint_offset, bus.sync_tolerance);
        }
        Self {
            setpoint_offset,
            is_stated: stated.is_some(),
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
        let mut others = self.buses.iter();
        let latest = others.find(|it| it.budget.setpoint_offset == self.setpoint_offset);
        for bus in &self.buses {
            let earliest = bus.budget.t_pdos_in.min(bus.budget.setpoint_offset);
            let allowed = earliest..=bus.budget.latest_offset;
            if !allowed.contains(&self.setpoint_offset)
                && !self.is_stated
                && let Some(other) = latest
            {
                return Err(DoesNotFit::Apart {
                    bus: bus.bus.clone(),
                    latest: bus.budget.latest_offset,
                    other: other.bus.clone(),
                    needed: other.budget.t_pdos_in,
                });
            }
            if !allowed.contains(&self.setpoint_offset) {
                return Err(DoesNotFit::Offset {
                    bus: bus.bus.clone(),
                    offset: self.setpoint_offset,
                    earliest: *allowed.start(),
                    latest: *allowed.end(),
                });
            }
            let request_out = bus.budget.request_out(self.setpoint_offset);
            // The request leaves in the cycle's rest, and its answer is in the way like an EMCY.
            let holds_polls = bus.budget.outlasts_emcy && request_out <= bus.budget.cycle;
            if bus.is_polled && !holds_polls {
                let bus = bus.bus.clone();
                return Err(DoesNotFit::Polls { bus });
            }
            if let Some(tolerance) = bus.sync_tolerance
                && requests_delay_sync(&bus.budget, self.setpoint_offset, tolerance)
            {
                return Err(DoesNotFit::Requests {
                    bus: bus.bus.clone(),
                    request_out: bus.budget.request_out(self.setpoint_offset),
                    cycle: bus.budget.cycle,
                    blocking: bus.budget.sync_jitter,
                    tolerance,
                });
            }
        }
        Ok(())
    }
}

/// Whether a request by SDO that leaves behind the setpoints may keep SYNC from the drives for longer than
/// their clocks follow.
fn requests_delay_sync(budget: &Budget, setpoint_offset: Duration, tolerance: Duration) -> bool {
    budget.sync_jitter > tolerance && budget.request_out(setpoint_offset) > budget.cycle
}

/// Whether a bus fits with setpoints that leave at that offset.
fn verdict(budget: &Budget, setpoint_offset: Duration, tolerance: Option<Duration>) -> Verdict {
    let delays = |tolerance| requests_delay_sync(budget, setpoint_offset, tolerance);
    match tolerance.is_some_and(delays) {
        true => Verdict::DoesNotFit,
        false => budget.verdict,
    }
}

impl BusBudget {
    fn of(machine: &Machine, bus: usize) -> Self {
        let nodes: Vec<(Node<'_>, Device)> = (machine.nodes().enumerate())
            .filter(|(_, node)| node.bus == bus)
            .map(|(index, node)| (node, machine.device(index)))
            .collect();
        let devices = nodes.iter().map(|(_, device)| device);
        let traffic = Traffic {
            bit_rate: machine.buses[bus].bitrate,
            cycle: machine.cycle,
            nodes: (devices.clone())
                .map(|device| device.spec().traffic())
                .collect(),
        };
        let taken_by_all = |cycle: &Duration| {
            let mut models = nodes.iter().map(|(node, _)| node.model);
            models.all(|model| model.takes_cycle(*cycle))
        };
        let budget = traffic.budget();
        let locks = devices
            .clone()
            .filter_map(|device| device.spec().clock_lock);
        let sync_tolerance = locks.map(|lock| lock.tolerance).min();
        let is_on_time = |cycle: &Duration| {
            let budget = traffic.in_cycle(*cycle).budget();
            let stated = machine.controller.setpoint_offset;
            let offset = stated.unwrap_or(budget.setpoint_offset);
            !sync_tolerance.is_some_and(|most| requests_delay_sync(&budget, offset, most))
        };
        let cycles = (1..=LONGEST_CYCLE_MS)
            .map(Duration::from_millis)
            .filter(taken_by_all)
            .filter(is_on_time);
        let is_polled =
            (devices.clone()).any(|device| matches!(device.spec().monitoring, Monitoring::Poll(_)));
        let answers = devices.map(|device| device.spec().sdo_response);
        let transfers = budget.sdo_transfers(answers.max().unwrap_or_default());
        // One at a time of each node.
        let sdo_per_cycle = transfers.min(nodes.len().max(1));
        let poll = match is_polled {
            true => bit_time(2 * BLOCKING_BITS, budget.bit_rate),
            false => Duration::ZERO,
        };
        let sdo = bit_time(3 * BLOCKING_BITS, budget.bit_rate) * sdo_per_cycle as u32;
        Self {
            bus: machine.buses[bus].name.clone(),
            load_in_motion: budget.load + poll,
            load: budget.load + sdo,
            sdo_per_cycle,
            is_polled,
            sync_tolerance,
            verdict: budget.verdict,
            budget,
            typical_load: typical_load(machine, &nodes, traffic.bit_rate),
            smallest_cycle: traffic.smallest_cycle(cycles),
            traffic,
        }
    }

    /// What would fit, or fit better, in words.
    #[must_use]
    pub fn advice(&self) -> String {
        let cycle = match self.smallest_cycle {
            Some(cycle) => format!("the least cycle that fits is {}", Millis(cycle)),
            None => "no cycle that its drives take fits".into(),
        };
        let budgets = self.traffic.on_two_buses().map(|half| half.budget());
        let [most, _] = &budgets;
        let verdicts = (budgets.each_ref())
            .map(|half| verdict(half, half.setpoint_offset, self.sync_tolerance));
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

/// No drive of ours takes a longer one.
const LONGEST_CYCLE_MS: u64 = 100;

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
                    "{} after SYNC, {}…{} hold; the burst takes {burst}{emcy}",
                    Millis(budget.setpoint_offset),
                    Millis(budget.t_pdos_in),
                    Millis(budget.latest_offset)
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
                    "{}, {} transfers a cycle",
                    Millis(budget.sdo_room),
                    self.sdo_per_cycle
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
                format!("{:.1} % of the bus", self.typical_load * 100.0),
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

    /// Three drives at 250 kbit/s: their requests were let stand in the way of one SYNC after the other.
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
            "bus one: a request by SDO behind the setpoints is out 5.080 ms after SYNC, in a cycle of \
             4.000 ms: the next SYNC waits up to 0.540 ms for it, and its drives' clocks follow one that \
             is 0.250 ms late; take a longer cycle, a higher bit rate or another bus for some of the drives"
        );
        // What `budget` prints says the same.
        let [bus] = &MachineBudget::of(&machine(4000)).buses[..] else {
            panic!("one bus");
        };
        assert_eq!(bus.verdict, Verdict::DoesNotFit);
        assert_eq!(bus.smallest_cycle, Some(Duration::from_millis(6)));
        assert!(
            bus.to_string().starts_with("bus one: does not fit\n"),
            "{bus}"
        );
        assert_eq!(MachineBudget::of(&machine(6000)).check(), Ok(()));
        assert!(MachineBudget::of(&machine(5000)).check().is_err());
    }
}
