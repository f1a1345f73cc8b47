//! Worst-case response times on a CAN bus.
//!
//! Frames out of priority-ordered queues by the exact busy-period form of Davis, Burns, Bril,
//! Lukkien, "Controller Area Network (CAN) schedulability analysis: refuted, revisited and
//! revised", Real-Time Systems 35 (2007), with release jitter and blocking; frames out of a
//! first-in-first-out queue by Davis, Kollmann, Pollex, Slomka, "Schedulability analysis for
//! Controller Area Network (CAN) with FIFO queues, priority queues and gateways", Real-Time
//! Systems 49 (2013). Integer arithmetic in nanoseconds throughout: no rounding hides a miss.

use crate::id::CanId;
use core::time::Duration;

/// Most bits that a data frame of `bytes` data bytes takes on the wire with its stuff bits and the
/// three bits of intermission: 55 + 10·s with a standard identifier, 80 + 10·s with an extended
/// one (Davis et al. 2007, equations 1 and 2).
#[must_use]
pub const fn worst_case_bits(id: CanId, bytes: u8) -> u32 {
    let overhead = match id {
        CanId::Standard(_) => 55,
        CanId::Extended(_) => 80,
    };
    overhead + 10 * bytes as u32
}

/// The time that `bits` take at `bit_rate` bits per second, rounded up to a nanosecond.
///
/// # Panics
/// If `bit_rate` is zero.
#[must_use]
pub const fn bit_time(bits: u32, bit_rate: u32) -> Duration {
    Duration::from_nanos(((bits as u64) * 1_000_000_000).div_ceil(bit_rate as u64))
}

/// The queue that a frame waits in before it reaches the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Queue {
    /// Its station always offers its most urgent frame.
    Priority,
    /// First in, first out, shared by all frames with the same number.
    Fifo(u16),
}

/// A periodic or sporadic frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Message {
    /// Identifier, its priority; each may occur once.
    pub id: CanId,
    /// Data bytes, 0…8.
    pub bytes: u8,
    /// Period, or least time between two; above zero.
    pub period: Duration,
    /// Most time between the event that causes the frame and its entry into the queue.
    pub jitter: Duration,
    /// The queue that it waits in.
    pub queue: Queue,
}

/// The analysis gives up on a busy period that is longer than this many of the longest period; a
/// bus whose load leaves it shorter than that has no bound that anyone could use.
const LONGEST_BUSY_PERIODS: u64 = 100;

/// The worst-case response time of each message, from the event that causes it to the end of its
/// intermission, in the order of `messages`; `None` where there is no bound (or, for a frame in a
/// FIFO queue, none within its period: there the analysis is defined for one instance at a time).
///
/// `blocking_bits` is the longest frame outside `messages` with a lower priority than all of them.
///
/// # Panics
/// If `bit_rate` or a period is zero.
#[must_use]
pub fn worst_case(
    messages: &[Message],
    blocking_bits: u32,
    bit_rate: u32,
) -> Vec<Option<Duration>> {
    let bit = nanos(bit_time(1, bit_rate));
    let mut frames: Vec<Analysed> = messages
        .iter()
        .map(|message| Analysed {
            urgency: urgency(message.id),
            length: nanos(bit_time(
                worst_case_bits(message.id, message.bytes),
                bit_rate,
            )),
            period: nanos(message.period),
            jitter: nanos(message.jitter),
            buffering: 0,
            queue: message.queue,
            response: None,
        })
        .collect();
    let outside = nanos(bit_time(blocking_bits, bit_rate));
    let horizon = LONGEST_BUSY_PERIODS
        * frames
            .iter()
            .map(|frame| frame.period + frame.jitter)
            .max()
            .unwrap_or(0);

    // Most urgent first: a FIFO frame's buffering time is jitter to the less urgent ones. A FIFO
    // queue is analysed at its least urgent member; it is jitter to frames in between as well,
    // so repeat until nothing grows.
    let mut order: Vec<usize> = (0..frames.len()).collect();
    order.sort_by_key(|&index| frames[index].urgency);
    loop {
        let mut grew = false;
        for &index in &order {
            let (response, buffering) = match frames[index].queue {
                Queue::Priority => (
                    from_priority_queue(&frames, index, outside, bit, horizon),
                    0,
                ),
                Queue::Fifo(queue) => from_fifo(&frames, index, queue, outside, bit, horizon),
            };
            let frame = &mut frames[index];
            grew |= buffering > frame.buffering;
            frame.response = response;
            frame.buffering = buffering;
        }
        if !grew || frames.iter().any(|frame| frame.buffering > horizon) {
            break;
        }
    }
    frames
        .into_iter()
        .map(|frame| frame.response.map(Duration::from_nanos))
        .collect()
}

/// A message in nanoseconds with what has been found out of it.
struct Analysed {
    urgency: u64,
    length: u64,
    period: u64,
    jitter: u64,
    /// Most time spent in a FIFO queue before the frame stands for arbitration.
    buffering: u64,
    queue: Queue,
    response: Option<u64>,
}

impl Analysed {
    /// The bus time that this frame takes from less urgent ones in a window of `window`.
    fn interference(&self, window: u64) -> u64 {
        (window + self.jitter + self.buffering).div_ceil(self.period) * self.length
    }
}

/// Arbitration as a number, the lowest wins: a standard identifier beats the extended ones that
/// begin with the same 11 bits.
const fn urgency(id: CanId) -> u64 {
    match id {
        CanId::Standard(id) => (id as u64) << 19,
        CanId::Extended(id) => ((id as u64 >> 18) << 19) | (1 << 18) | (id as u64 & 0x3_FFFF),
    }
}

fn nanos(time: Duration) -> u64 {
    time.as_nanos() as u64
}

/// Davis et al. 2007, equations 7 to 11.
fn from_priority_queue(
    frames: &[Analysed],
    index: usize,
    outside: u64,
    bit: u64,
    horizon: u64,
) -> Option<u64> {
    let this = &frames[index];
    let blocking = frames
        .iter()
        .filter(|other| other.urgency > this.urgency)
        .map(|other| other.length)
        .fold(outside, u64::max);
    let more_urgent = || frames.iter().filter(|other| other.urgency < this.urgency);

    let busy = fixed_point(this.length, horizon, |window| {
        blocking
            + more_urgent()
                .chain([this])
                .map(|other| other.interference(window))
                .sum::<u64>()
    })?;
    let instances = (busy + this.jitter).div_ceil(this.period);
    let mut worst = 0;
    let mut wait = blocking;
    for instance in 0..instances {
        let ahead = blocking + instance * this.length;
        wait = fixed_point(wait.max(ahead), 2 * horizon, |window| {
            ahead
                + more_urgent()
                    .map(|other| other.interference(window + bit))
                    .sum::<u64>()
        })?;
        worst = worst.max(this.jitter + wait + this.length - instance * this.period);
    }
    Some(worst)
}

/// Davis et al. 2013, the FIFO-symmetric form: the frame stands behind one of each of its queue
/// and the whole queue is as urgent as its least urgent member. Gives response and buffering time.
fn from_fifo(
    frames: &[Analysed],
    index: usize,
    queue: u16,
    outside: u64,
    bit: u64,
    horizon: u64,
) -> (Option<u64>, u64) {
    let members = || {
        frames
            .iter()
            .filter(|frame| frame.queue == Queue::Fifo(queue))
    };
    let lowest = members().map(|frame| frame.urgency).max().unwrap_or(0);
    let longest = members().map(|frame| frame.length).max().unwrap_or(0);
    let shortest = members().map(|frame| frame.length).min().unwrap_or(0);
    let sum: u64 = members().map(|frame| frame.length).sum();
    let blocking = frames
        .iter()
        .filter(|other| other.urgency > lowest)
        .map(|other| other.length)
        .fold(outside.max(longest), u64::max);

    let ahead = blocking + sum - shortest;
    let wait = fixed_point(ahead, horizon, |window| {
        ahead
            + frames
                .iter()
                .filter(|other| other.urgency < lowest && other.queue != Queue::Fifo(queue))
                .map(|other| other.interference(window + bit))
                .sum::<u64>()
    });
    let Some(wait) = wait else {
        return (None, horizon + 1);
    };
    let response = frames[index].jitter + wait + shortest;
    ((response <= frames[index].period).then_some(response), wait)
}

/// The least fixed point of `next` at or above `start`, or `None` beyond `horizon`.
fn fixed_point(start: u64, horizon: u64, next: impl Fn(u64) -> u64) -> Option<u64> {
    let mut window = start;
    while window <= horizon {
        let grown = next(window);
        if grown <= window {
            return Some(window);
        }
        window = grown;
    }
    None
}
