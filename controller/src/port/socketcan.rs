//! A Linux SocketCAN interface as a [`Port`].
//!
//! Three raw sockets, one for each band of pfifo_fast: SYNC first, the burst second, acyclic
//! frames last. The burst's socket also receives: kernel filters for exactly the identifiers in
//! use, its own frames echoed when they have left. Each call of the port is one system call
//! however many frames it carries.
//!
//! The echo is the driver's word that a frame is on the wire; it also says how many of ours still
//! wait, so that a burst is queued only where all of it fits behind what waits already.
#![allow(unsafe_code)]

mod batch;
mod interface;

pub use batch::{from_raw, to_raw};

use super::arrival::Arrivals;
use super::error_frame;
use super::wire::Wire;
use super::{Port, PortError};
use crate::bus::{Burst, BusFault, FaultCounts, Received, Severity};
use crate::realtime;
use batch::{Batch, send_all};
use interface::{check_interface, fit_transmit_queue};
use libc::{c_int, can_frame};
use socketcan::{CanErrorFrame, CanFilter, CanFrame, CanSocket, Socket, SocketOptions};
use std::ffi::CString;
use std::io;
use std::mem::{size_of, zeroed};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::time::Duration;
use syncline_canopen::{CanId, CobId, Frame, Instant};
use syncline_drives::world::BusId;

/// SO_PRIORITY values and the band of pfifo_fast that each lands in (tc-prio(8), default map).
const FIRST_BAND: c_int = 6;
const MIDDLE_BAND: c_int = 0;
const LAST_BAND: c_int = 1;

/// Frames that one receive call takes beyond one of each identifier.
const BATCH_SLACK: usize = 32;

/// Receive calls in a row before the rest is left to the next wake-up, so that a flooded bus
/// cannot hold the cycle.
const MOST_CALLS: usize = 4;

/// What the port is opened for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// The bit rate that the interface must run at; not checked where it has none (vcan).
    pub bit_rate: u32,
    /// Identifiers to receive: T_PDOs, SDO answers, EMCY, error control. What only a master sends is received, too.
    pub receive: Vec<CobId>,
    /// Identifier of the controller's own heartbeat: from elsewhere it is received, too.
    pub heartbeat: CobId,
    /// Identifiers of the burst: the R_PDOs. At most [`BURST_CAPACITY`](crate::bus::BURST_CAPACITY).
    pub burst: Vec<CobId>,
}

/// Where [`Received::at`] comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StampSource {
    /// The adapter stamps frames as they pass the wire.
    Hardware,
    /// The kernel stamps frames when the driver hands them over.
    Software,
}

/// A SocketCAN interface.
pub struct SocketCan {
    name: String,
    sync: CanSocket,
    burst: CanSocket,
    acyclic: CanSocket,
    /// Frames in one burst.
    burst_length: usize,
    batch: Batch,
    arrivals: Arrivals,
    wire_clock: WireClock,
    queued: Queued,
    faults: FaultCounts,
    /// The worst that was reported and lets the bus be used on, until it is asked for.
    condition: Option<BusFault>,
    /// Frames that the socket had no room for, as the kernel last told it.
    overruns: u32,
    stamps: StampSource,
    notes: Vec<String>,
}

impl SocketCan {
    /// Opens `interface` for one machine's traffic.
    ///
    /// # Errors
    /// With what to type to mend it: no SocketCAN in the kernel, no such interface, interface
    /// down or off the bus, another bit rate, a transmit queue shorter than the burst.
    pub fn open(interface: &str, options: &Options) -> Result<Self, PortError> {
        let fail = |what: String| PortError {
            bus: interface.into(),
            what,
        };
        check_interface(interface, options.bit_rate).map_err(fail)?;
        let sockets = || -> io::Result<_> {
            let burst = receiving_socket(interface, options)?;
            let sync = sending_socket(interface, FIRST_BAND)?;
            let acyclic = sending_socket(interface, LAST_BAND)?;
            Ok((sync, burst, acyclic))
        };
        let (sync, burst, acyclic) =
            sockets().map_err(|error| fail(format!("cannot open its sockets: {error}")))?;
        let stamps = if burst.has_hw_timestamps() {
            StampSource::Hardware
        } else {
            StampSource::Software
        };
        let mut notes = Vec::new();
        let length = options.burst.len().max(1);
        fit_transmit_queue(interface, &burst, length, &mut notes).map_err(fail)?;
        Ok(Self {
            name: interface.into(),
            sync,
            burst,
            acyclic,
            burst_length: options.burst.len(),
            batch: Batch::new(options.receive.len() + options.burst.len() + BATCH_SLACK),
            arrivals: Arrivals::new(),
            wire_clock: WireClock::default(),
            queued: Queued::new(options.heartbeat),
            faults: FaultCounts::default(),
            condition: None,
            overruns: 0,
            stamps,
            notes,
        })
    }

    /// Where the stamps come from.
    #[must_use]
    pub fn stamps(&self) -> StampSource {
        self.stamps
    }

    /// Faults that the adapter has reported since the port was opened.
    #[must_use]
    pub fn faults(&self) -> FaultCounts {
        self.faults
    }

    fn fail(&mut self, doing: &str, error: &io::Error) -> PortError {
        self.queued.fails(error);
        failure(&self.name, doing, error)
    }

    /// Counts a fault; an error if the bus cannot be used any longer.
    fn fault(&mut self, fault: BusFault) -> Result<(), PortError> {
        self.faults.add(fault, 1);
        if matches!(fault, BusFault::BusOff | BusFault::Restarted) {
            self.queued.forget();
        }
        match fault.severity() {
            Severity::Count => Ok(()),
            Severity::Warn => {
                self.condition.get_or_insert(fault);
                Ok(())
            }
            Severity::Stop => {
                self.condition = Some(fault);
                Ok(())
            }
            Severity::Lose => Err(PortError {
                bus: self.name.clone(),
                what: fault.to_string().replace("DEV", &self.name),
            }),
        }
    }
}

/// What of this port's frames was queued and has not been told to have left.
#[derive(Debug)]
struct Queued {
    /// Frames of bursts.
    bursts: usize,
    /// What other sockets of this port send and the receiving one gets as well, SYNCs, NMT commands and heartbeats: how many
    /// have not come back to it.
    returning: [(CanId, usize); 3],
}

impl Queued {
    /// Nothing; the controller's heartbeat has that identifier.
    fn new(heartbeat: CobId) -> Self {
        Self {
            bursts: 0,
            returning: [CobId::SYNC, CobId::NMT, heartbeat].map(|id| (id.into(), 0)),
        }
    }

    /// A call has failed. With an interface that goes down the kernel empties its queue, and the driver what it had of it:
    /// nothing of that leaves later, or comes back.
    fn fails(&mut self, error: &io::Error) {
        if error.raw_os_error() == Some(libc::ENETDOWN) {
            self.forget();
        }
    }

    /// Nothing of it leaves any more.
    fn forget(&mut self) {
        self.bursts = 0;
        self.returning.iter_mut().for_each(|(_, count)| *count = 0);
    }

    /// Whether a frame is one of ours that left. The burst's own socket marks its frames; SYNC, NMT commands and the
    /// heartbeat come from other sockets of this port, so as many are ours as were sent.
    fn is_echo(&mut self, frame: &Frame, flags: c_int) -> bool {
        if flags & libc::MSG_CONFIRM != 0 {
            self.bursts = self.bursts.saturating_sub(1);
            return true;
        }
        let of_this_host = flags & libc::MSG_DONTROUTE != 0;
        let mut returning = self.returning.iter_mut();
        let own = returning.find(|(id, count)| of_this_host && *id == frame.id() && *count > 0);
        own.map(|(_, count)| *count -= 1).is_some()
    }

    /// Frames were queued by a socket that is not the receiving one.
    fn beside(&mut self, frames: &[Frame]) {
        for frame in frames {
            let mut returning = self.returning.iter_mut();
            if let Some((_, count)) = returning.find(|(id, _)| *id == frame.id()) {
                *count += 1;
            }
        }
    }
}

impl Port for SocketCan {
    fn simulated(&self) -> Option<BusId> {
        None
    }

    fn echoes(&self) -> bool {
        true
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn condition(&mut self) -> Option<BusFault> {
        self.condition.take()
    }

    fn receive(&mut self, sink: &mut dyn FnMut(Received)) -> Result<(), PortError> {
        for _ in 0..MOST_CALLS {
            let asked = realtime::now();
            let count = match self.batch.receive(&self.burst) {
                Ok(count) => count,
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    self.arrivals.found_empty(asked);
                    return Ok(());
                }
                Err(error) => return Err(self.fail("receiving", &error)),
            };
            let reading = self.arrivals.read();
            let mut failed = None;
            for index in 0..count {
                let message = self.batch.message(index);
                if let Some(overruns) = message.overruns {
                    let lost = overruns.wrapping_sub(self.overruns);
                    self.faults.add(BusFault::ReceiveOverrun, lost.into());
                    self.overruns = overruns;
                }
                if message.raw.can_id & libc::CAN_ERR_FLAG != 0 {
                    if let CanFrame::Error(error) = CanFrame::from(message.raw) {
                        failed = self.error_frame(error).err().or(failed);
                    }
                    continue;
                }
                let Some(frame) = from_raw(&message.raw) else {
                    continue;
                };
                let echo = self.queued.is_echo(&frame, message.flags);
                let kernel = reading.at(message.software);
                let at = match message.hardware {
                    Some(wire) => {
                        let at = self.wire_clock.monotonic(wire, kernel.as_nanos());
                        Instant::from_nanos(at)
                    }
                    None => kernel,
                };
                sink(Received { at, frame, echo });
            }
            if let Some(error) = failed {
                return Err(error);
            }
            if count < self.batch.capacity() {
                self.arrivals.found_empty(asked);
                return Ok(());
            }
        }
        Ok(())
    }

    fn send_sync(&mut self, frame: &Frame) -> Result<(), PortError> {
        match send_all(&self.sync, std::slice::from_ref(frame)) {
            Ok(_) => {
                self.queued.beside(std::slice::from_ref(frame));
                Ok(())
            }
            Err(error) => Err(self.fail("sending SYNC", &error)),
        }
    }

    fn send_burst(&mut self, frames: &[Frame]) -> Result<Burst, PortError> {
        if frames.len() + self.queued.bursts > self.burst_length {
            return Ok(Burst::Dropped);
        }
        match send_all(&self.burst, frames) {
            Ok(queued) => {
                self.queued.bursts += queued;
                Ok(if queued == frames.len() {
                    Burst::Queued
                } else {
                    Burst::Torn { queued }
                })
            }
            Err(error) if is_full(&error) => Ok(Burst::Dropped),
            Err(error) => Err(self.fail("sending setpoints", &error)),
        }
    }

    fn send_acyclic(&mut self, frames: &[Frame]) -> Result<(), PortError> {
        match send_all(&self.acyclic, frames) {
            Ok(sent) => {
                self.queued.beside(&frames[..sent]);
                Ok(())
            }
            Err(error) if !is_full(&error) => Err(self.fail("sending", &error)),
            _ => Ok(()),
        }
    }
}

impl SocketCan {
    fn error_frame(&mut self, frame: CanErrorFrame) -> Result<(), PortError> {
        let error = frame.into_error();
        error_frame::faults(&error).try_for_each(|fault| self.fault(fault))
    }
}

/// A socket whose frames go to one band of the transmit queue, never waiting.
fn socket_in_band(interface: &str, band: c_int) -> io::Result<CanSocket> {
    let socket = CanSocket::open(interface)?;
    socket.set_nonblocking(true)?;
    socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_PRIORITY, band)?;
    Ok(socket)
}

/// A socket that receives nothing.
fn sending_socket(interface: &str, band: c_int) -> io::Result<CanSocket> {
    let socket = socket_in_band(interface, band)?;
    socket.set_filter_drop_all()?;
    Ok(socket)
}

/// The burst's socket: receives what the machine uses and the echo of its own frames, with
/// stamps, error frames, and the count of what was lost.
fn receiving_socket(interface: &str, options: &Options) -> io::Result<CanSocket> {
    let socket = socket_in_band(interface, MIDDLE_BAND)?;
    let ids = options.receive.iter().chain(&options.burst);
    let ids = ids.chain([&CobId::SYNC, &CobId::NMT, &options.heartbeat]);
    let filters: Vec<CanFilter> = ids.map(exactly).collect();
    socket.set_filters(&filters)?;
    socket.set_recv_own_msgs(true)?;
    socket.set_error_filter(libc::CAN_ERR_MASK)?;
    socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_RXQ_OVFL, 1)?;
    stamp_frames(&socket)?;
    Ok(socket)
}

/// Has received frames stamped by the kernel, and by the adapter if it can.
fn stamp_frames(socket: &CanSocket) -> io::Result<()> {
    let stamping = libc::SOF_TIMESTAMPING_RX_SOFTWARE
        | libc::SOF_TIMESTAMPING_SOFTWARE
        | libc::SOF_TIMESTAMPING_RX_HARDWARE
        | libc::SOF_TIMESTAMPING_RAW_HARDWARE;
    socket.set_socket_option_int(libc::SOL_SOCKET, libc::SO_TIMESTAMPING, stamping as c_int)
}

/// A raw socket for simulated drives: receives all that others send, sends at the adapter's pace.
pub(crate) struct DriveSocket {
    name: String,
    socket: CanSocket,
    batch: Batch,
    arrivals: Arrivals,
}

impl DriveSocket {
    /// # Errors
    /// As [`SocketCan::open`].
    pub(crate) fn open(interface: &str, bit_rate: u32) -> Result<Self, PortError> {
        let fail = |what: String| PortError {
            bus: interface.into(),
            what,
        };
        check_interface(interface, bit_rate).map_err(fail)?;
        let socket = socket_in_band(interface, MIDDLE_BAND)
            .and_then(|socket| stamp_frames(&socket).map(|()| socket))
            .map_err(|error| fail(format!("cannot open its socket: {error}")))?;
        Ok(Self {
            name: interface.into(),
            socket,
            batch: Batch::new(BATCH_SLACK),
            arrivals: Arrivals::new(),
        })
    }

    fn fail(&self, doing: &str, error: &io::Error) -> PortError {
        failure(&self.name, doing, error)
    }
}

impl Wire for DriveSocket {
    fn name(&self) -> &str {
        &self.name
    }

    fn wait(&mut self, most: Duration) -> Result<(), PortError> {
        realtime::wait_readable(&self.socket, most).map_err(|error| self.fail("waiting", &error))
    }

    fn receive(&mut self, sink: &mut dyn FnMut(Instant, &Frame)) -> Result<bool, PortError> {
        let asked = realtime::now();
        let count = match self.batch.receive(&self.socket) {
            Ok(count) => count,
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                self.arrivals.found_empty(asked);
                return Ok(false);
            }
            Err(error) => return Err(self.fail("receiving", &error)),
        };
        let reading = self.arrivals.read();
        for index in 0..count {
            let message = self.batch.message(index);
            if let Some(frame) = from_raw(&message.raw) {
                sink(reading.at(message.software), &frame);
            }
        }
        Ok(count > 0)
    }

    fn send(&mut self, frames: &mut Vec<Frame>) -> Result<(), PortError> {
        while !frames.is_empty() {
            match send_all(&self.socket, frames) {
                Ok(sent) => drop(frames.drain(..sent)),
                Err(error) if is_full(&error) => break,
                Err(error) => return Err(self.fail("sending", &error)),
            }
        }
        Ok(())
    }
}

/// A frame that the kernel sends by itself, again and again, until this value goes.
pub struct BroadcastManager {
    _socket: OwnedFd,
}

/// `struct bcm_msg_head` with one frame (linux/can/bcm.h).
#[repr(C)]
struct BroadcastOrder {
    opcode: u32,
    flags: u32,
    count: u32,
    /// Between the first `count` frames.
    first_interval: libc::timeval,
    /// Between all others.
    interval: libc::timeval,
    can_id: u32,
    frames: u32,
    frame: can_frame,
}

impl BroadcastManager {
    /// Sends `frame` now and then every `period`, which is rounded to microseconds.
    ///
    /// # Errors
    /// The kernel has no broadcast manager, or does not know the interface.
    pub fn start(interface: &str, frame: &Frame, period: Duration) -> Result<Self, PortError> {
        const CAN_BCM: c_int = 2;
        const TX_SETUP: u32 = 1;
        const SETTIMER: u32 = 1;
        const STARTTIMER: u32 = 2;
        let fail = |doing: &str| PortError {
            bus: interface.into(),
            what: format!("{doing}: {}", io::Error::last_os_error()),
        };
        let modprobe = "cannot open the broadcast manager (`sudo modprobe can-bcm`)";
        let name = CString::new(interface).unwrap_or_default();
        let raw = to_raw(frame);
        let order = BroadcastOrder {
            opcode: TX_SETUP,
            flags: SETTIMER | STARTTIMER,
            count: 0,
            first_interval: libc::timeval {
                tv_sec: 0,
                tv_usec: 0,
            },
            interval: libc::timeval {
                tv_sec: period.as_secs() as libc::time_t,
                tv_usec: period.subsec_micros().into(),
            },
            can_id: raw.can_id,
            frames: 1,
            frame: raw,
        };
        // SAFETY: the calls read a name with its zero, one sockaddr_can and one order, with their
        // true sizes, all alive during the calls; sockaddr_can is plain data for which all zeroes
        // is valid; the socket is owned by nobody else.
        unsafe {
            let socket = libc::socket(libc::PF_CAN, libc::SOCK_DGRAM | libc::SOCK_CLOEXEC, CAN_BCM);
            if socket < 0 {
                return Err(fail(modprobe));
            }
            let socket = OwnedFd::from_raw_fd(socket);
            let mut address: libc::sockaddr_can = zeroed();
            address.can_family = libc::AF_CAN as libc::sa_family_t;
            address.can_ifindex = libc::if_nametoindex(name.as_ptr()) as c_int;
            if address.can_ifindex == 0 {
                return Err(fail("no such interface"));
            }
            let length = size_of::<libc::sockaddr_can>() as libc::socklen_t;
            if libc::connect(socket.as_raw_fd(), (&raw const address).cast(), length) < 0 {
                return Err(fail("cannot connect the broadcast manager"));
            }
            let length = size_of::<BroadcastOrder>();
            if libc::write(socket.as_raw_fd(), (&raw const order).cast(), length) < 0 {
                return Err(fail("the broadcast manager does not take the frame"));
            }
            Ok(Self { _socket: socket })
        }
    }
}

/// A filter that passes this standard data frame and nothing else; in this form the kernel finds
/// it by table, not by search.
fn exactly(id: &CobId) -> CanFilter {
    CanFilter::new(
        id.get().into(),
        libc::CAN_SFF_MASK | libc::CAN_EFF_FLAG | libc::CAN_RTR_FLAG,
    )
}

fn is_full(error: &io::Error) -> bool {
    matches!(
        error.raw_os_error(),
        Some(libc::ENOBUFS | libc::EAGAIN | libc::ENOMEM)
    )
}

/// What a failed call means.
fn failure(interface: &str, doing: &str, error: &io::Error) -> PortError {
    PortError {
        bus: interface.into(),
        what: match error.raw_os_error() {
            Some(libc::ENETDOWN) => {
                format!("{doing}: the interface went down, `sudo ip link set {interface} up`")
            }
            Some(libc::ENODEV | libc::ENXIO) => format!("{doing}: the interface is gone"),
            _ => format!("{doing}: {error}"),
        },
    }
}

/// The adapter's clock in terms of CLOCK_MONOTONIC: the kernel's stamp is the adapter's plus an
/// offset and a delay that is never negative, so the least difference seen is the best offset;
/// it may grow by as much as the clocks may drift.
#[derive(Clone, Copy, Debug, Default)]
struct WireClock {
    last: Option<(u64, i64)>,
}

impl WireClock {
    /// Drift that two crystals may have, as a divisor: 200 ppm.
    const DRIFT: u64 = 5_000;

    /// The CLOCK_MONOTONIC instant of the adapter's stamp `wire`, given the kernel's.
    fn monotonic(&mut self, wire: u64, kernel: u64) -> u64 {
        let seen = kernel.wrapping_sub(wire) as i64;
        let offset = match self.last {
            Some((last, offset)) => {
                let drift = wire.saturating_sub(last) / Self::DRIFT;
                seen.min(offset.saturating_add(drift as i64))
            }
            None => seen,
        };
        self.last = Some((wire, offset));
        wire.wrapping_add(offset as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syncline_canopen::NodeId;

    #[test]
    fn frames_survive_the_kernel_layout() {
        let node = NodeId::new(5).unwrap();
        for frame in [
            Frame::new(CobId::SYNC, &[]),
            Frame::new(CobId::r_pdo(2, node), &[1, 2, 3, 4, 5, 6]),
            Frame::new(CanId::extended(0x1234_5678).unwrap(), &[9; 8]),
            Frame::remote(CobId::error_control(node), 1).unwrap(),
        ] {
            assert_eq!(from_raw(&to_raw(&frame)), Some(frame));
        }
        let mut long = to_raw(&Frame::new(CobId::SYNC, &[]));
        long.can_dlc = 9;
        assert_eq!(from_raw(&long), None);
    }

    /// Offset and drift are found again under delays that are never negative.
    #[test]
    fn the_wire_clock_follows_the_least_delay() {
        let mut clock = WireClock::default();
        let truth = |wire: u64| 5_000_000_000 + wire + wire / 20_000;
        let mut worst = 0;
        for cycle in 0..10_000_u64 {
            let wire = 1_000_000 * cycle;
            let delay = 3_000 + (cycle * 7919) % 50_000;
            let mapped = clock.monotonic(wire, truth(wire) + delay);
            assert!(mapped >= truth(wire));
            if cycle > 100 {
                worst = worst.max(mapped - truth(wire));
            }
        }
        assert!(worst < 12_000, "{worst} ns over the least delay of 3 us");
    }

    /// What went down with the interface is waited for no more: as it is up again there is room for the next burst, and a
    /// SYNC that comes is another node's.
    #[test]
    fn what_an_interface_had_goes_down_with_it() {
        let sync = Frame::new(CobId::SYNC, &[]);
        let heartbeat = CobId::error_control(NodeId::new(127).unwrap());
        for (error, left) in [(libc::ENOBUFS, 4), (libc::ENETDOWN, 0)] {
            let mut queued = Queued::new(heartbeat);
            queued.bursts += 4;
            queued.beside(&[sync]);
            queued.fails(&io::Error::from_raw_os_error(error));
            assert_eq!(queued.bursts, left);
            assert_eq!(queued.is_echo(&sync, libc::MSG_DONTROUTE), left > 0);
        }
    }

    #[test]
    fn without_an_interface_the_refusal_says_what_to_type() {
        let options = Options {
            bit_rate: 1_000_000,
            receive: Vec::new(),
            heartbeat: CobId::NMT,
            burst: Vec::new(),
        };
        let Err(error) = SocketCan::open("can-none", &options) else {
            panic!("there is no such interface");
        };
        let text = error.to_string();
        assert!(
            text.contains("modprobe") || text.contains("ip -details"),
            "{text}"
        );
    }
}
