//! What a machine's buses carried.

use super::sent::{Hearing, SentSetpoints};
use crate::bus_log;
use crate::machine::Machine;
use rtrb::{Consumer, RingBuffer};
use sha2::{Digest, Sha256};
use std::collections::VecDeque;
use std::io;
use std::mem::take;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use syncline_canopen::time::Duration;
use syncline_canopen::{CanId, CobId, Frame, Instant};
use syncline_drives::bus::{Sender, Transmission};

/// Longer than any frame takes at the lowest bit rate of CANopen.
const LONGEST_FRAME: Duration = Duration::from_millis(20);

/// Frames of a bus on their way from the cycle to the log: of more than two seconds at 1 Mbit/s.
const RELAYED: usize = 1 << 15;

/// Where virtual time begins in a log, since 1970; can-utils take 0 for no time at all.
pub const VIRTUAL_ORIGIN: Duration = Duration::from_secs(1);

/// A digest of all frames and the load of each bus.
///
/// The digest is SHA-256 over, per frame by start of frame and then by bus: bus index u8, start
/// of frame in ns u64 LE, identifier u32 LE, data length code u8, data.
#[derive(Debug)]
pub struct FrameLog {
    digest: Sha256,
    buses: Vec<BusLoad>,
    hearing: Option<Hearing>,
    log: bus_log::BusLog,
    /// Instant zero in the log, since 1970.
    origin: Duration,
    /// The first failure to write the log.
    failed: Option<io::Error>,
    relays: Vec<Relay>,
}

/// Frames of a bus that a cycle in real time hands over.
#[derive(Debug)]
struct Relay {
    bus: usize,
    frames: Consumer<Transmission>,
    missed: Arc<AtomicU64>,
}

#[derive(Debug)]
struct BusLoad {
    /// Frames that have ended but may have started after one of another bus.
    pending: VecDeque<Transmission>,
    /// Bits since the last SYNC.
    bits: u64,
    /// Most bits from SYNC to SYNC, a cycle apart.
    peak_bits: u64,
    /// When the last SYNC began.
    synced: Option<Instant>,
    /// Bits in one cycle.
    capacity: f64,
    /// From one SYNC to the next where SYNC runs: while it does not, what is sent belongs to no cycle.
    longest_cycle: Duration,
}

impl FrameLog {
    /// For a machine's buses.
    #[must_use]
    pub fn new(machine: &Machine) -> Self {
        let bus = |bitrate: u32| BusLoad {
            pending: VecDeque::new(),
            bits: 0,
            peak_bits: 0,
            synced: None,
            capacity: f64::from(bitrate) * machine.cycle.as_secs_f64(),
            longest_cycle: machine.cycle * 2,
        };
        Self {
            digest: Sha256::new(),
            buses: machine.buses.iter().map(|spec| bus(spec.bitrate)).collect(),
            hearing: None,
            log: bus_log::BusLog::default(),
            origin: VIRTUAL_ORIGIN,
            failed: None,
            relays: Vec::new(),
        }
    }

    /// Takes a frame of a bus, in bus order.
    pub fn record(&mut self, bus: usize, frame: &Transmission) {
        if let Some(hearing) = &mut self.hearing {
            hearing.hear(bus, &frame.frame);
        }
        let log = &mut self.buses[bus];
        log.pending.push_back(*frame);
        if frame.frame.id() == CanId::from(CobId::SYNC) {
            let before = log.synced.replace(frame.start);
            if before.is_some_and(|before| frame.start < before + log.longest_cycle) {
                log.peak_bits = log.peak_bits.max(log.bits);
            }
            log.bits = 0;
        }
        log.bits += u64::from(frame.bits);
        self.digest_before(frame.start, LONGEST_FRAME);
    }

    /// Takes what was relayed, of all buses in the order in which their frames ended.
    fn catch_up(&mut self) {
        loop {
            let heads = self.relays.iter_mut().enumerate();
            let heads = heads.filter_map(|(at, relay)| Some((relay.frames.peek().ok()?.end, at)));
            let Some((_, first)) = heads.min() else { break };
            let relay = &mut self.relays[first];
            let bus = relay.bus;
            if let Ok(frame) = relay.frames.pop() {
                self.record(bus, &frame);
            }
        }
        let missed = self.relays.iter();
        let missed: u64 = (missed.map(|relay| relay.missed.load(Ordering::Relaxed))).sum();
        if missed > 0 && self.failed.is_none() {
            let what = format!(
                "{missed} frames came faster than they were recorded: the log, its digest and what is judged of sent \
                 setpoints lack them; run again on a host that does less beside"
            );
            self.failed = Some(io::Error::other(what));
        }
    }

    /// Digests what can no longer be overtaken: what started `margin` before `now`.
    fn digest_before(&mut self, now: Instant, margin: Duration) {
        loop {
            let heads = self.buses.iter().enumerate();
            let first = heads
                .filter_map(|(bus, log)| Some((log.pending.front()?.start, bus)))
                .min();
            match first {
                Some((start, bus)) if start + margin <= now => self.digest_first(bus),
                _ => return,
            }
        }
    }

    fn digest_first(&mut self, bus: usize) {
        if let Some(Transmission {
            start, end, frame, ..
        }) = self.buses[bus].pending.pop_front()
        {
            self.digest.update([bus as u8]);
            self.digest.update(start.as_nanos().to_le_bytes());
            self.digest.update(frame.id().raw().to_le_bytes());
            self.digest.update([frame.dlc()]);
            self.digest.update(frame.data());
            // Stamped as an adapter would: when it is complete.
            self.keep(bus, end, &frame);
        }
    }

    fn keep(&mut self, bus: usize, at: Instant, frame: &Frame) {
        let at = self.origin + Duration::from_nanos(at.as_nanos());
        if self.failed.is_none() {
            self.failed = self.log.keep(bus, at, frame).err();
        }
    }

    /// The digest of everything so far, in hexadecimal.
    #[must_use]
    pub fn sha256(&mut self) -> String {
        self.digest_before(Instant::from_nanos(u64::MAX), Duration::ZERO);
        let digest = self.digest.clone().finalize();
        hexadecimal(&digest)
    }

    /// Per bus: bits of the busiest interval from SYNC to SYNC, by the bits of a cycle. On a full bus that is
    /// up to a frame more than 1, for which the second SYNC waited.
    #[must_use]
    pub fn peak_utilisation(&self) -> Vec<f64> {
        let peak = |log: &BusLoad| log.peak_bits as f64 / log.capacity;
        self.buses.iter().map(peak).collect()
    }
}

/// A [`FrameLog`] that the buses of one machine share.
#[derive(Clone, Debug)]
pub struct SharedFrames(Arc<Mutex<FrameLog>>);

impl SharedFrames {
    /// For a machine's buses.
    #[must_use]
    pub fn new(machine: &Machine) -> Self {
        Self(Arc::new(Mutex::new(FrameLog::new(machine))))
    }

    /// What hands over the frames of a bus out of a cycle in real time: no lock is taken and no memory asked for there. They are
    /// recorded as somebody looks at the frames, or [catches up](Self::catch_up) with them.
    pub fn relay(&self, bus: usize) -> impl FnMut(&Transmission) + Send + 'static {
        let (mut tell, mut frames) = RingBuffer::new(RELAYED);
        // No page of it is touched for the first time in the cycle.
        let blank = Transmission {
            start: Instant::ZERO,
            end: Instant::ZERO,
            bits: 0,
            sender: Sender::Port,
            frame: Frame::new(CobId::SYNC, &[]),
        };
        while tell.push(blank).is_ok() {}
        while frames.pop().is_ok() {}
        let missed = Arc::new(AtomicU64::new(0));
        self.lock().relays.push(Relay {
            bus,
            frames,
            missed: Arc::clone(&missed),
        });
        move |frame| {
            if tell.push(*frame).is_err() {
                missed.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    /// Records what was [relayed](Self::relay) so far.
    pub fn catch_up(&self) {
        drop(self.lock());
    }

    /// What records the frames of a bus at once, in virtual time.
    pub fn observer(&self, bus: usize) -> impl FnMut(&Transmission) + Send + 'static {
        let frames = self.clone();
        move |frame| frames.lock().record(bus, frame)
    }

    /// Has the setpoints told that the machine's drives are sent, from now on; before the machine is
    /// switched on.
    #[must_use]
    pub fn listen(&self, machine: &Machine) -> SentSetpoints {
        let (hearing, mut sent) = Hearing::new(machine);
        let mut frames = self.lock();
        frames.hearing = Some(hearing);
        if !frames.relays.is_empty() {
            sent.hear_from(self.clone());
        }
        sent
    }

    /// Writes all frames from now on into a log of the machine's buses, where instant zero is
    /// `origin` past 1970.
    pub fn write_to(&self, log: bus_log::BusLog, origin: Duration) {
        let mut frames = self.lock();
        frames.log = log;
        frames.origin = origin;
    }

    /// Writes a frame that a bus which is not simulated carried.
    pub fn heard(&self, bus: usize, at: Instant, frame: &Frame) {
        self.lock().keep(bus, at, frame);
    }

    /// Ends the log with this failure.
    pub fn fail(&self, error: io::Error) {
        self.lock().failed.get_or_insert(error);
    }

    /// Writes the log to its end, and closes it.
    ///
    /// # Errors
    /// The log could not be written.
    pub fn finish_log(&self) -> io::Result<()> {
        let mut frames = self.lock();
        frames.digest_before(Instant::from_nanos(u64::MAX), Duration::ZERO);
        let mut log = take(&mut frames.log);
        frames.failed.take().map_or(Ok(()), Err)?;
        log.finish()
    }

    /// Digest and peak utilisation of each bus.
    #[must_use]
    pub fn result(&self) -> (String, Vec<f64>) {
        let mut frames = self.lock();
        (frames.sha256(), frames.peak_utilisation())
    }

    fn lock(&self) -> MutexGuard<'_, FrameLog> {
        let mut frames = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        frames.catch_up();
        frames
    }
}

/// Bytes as they are told, two digits each.
#[must_use]
pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
