//! Worst-case response times on a CAN bus.
//!
//! The exact busy-period form of Davis, Burns, Bril, Lukkien, "Controller Area Network (CAN)
//! schedulability analysis: refuted, revisited and revised", Real-Time Systems 35 (2007), with
//! release jitter and blocking. Every station offers its most urgent frame; a burst that is handed
//! over in the order of its identifiers does so out of a first-in-first-out queue, too. Integer
//! arithmetic in nanoseconds throughout: no rounding hides a miss.

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

/// A periodic or sporadic frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Message {
    /// Identifier, its priority. Of several frames with the same one, which come from one node, each may be the last.
    pub id: CanId,
    /// Data bytes, 0…8.
    pub bytes: u8,
    /// Period, or least time between two; above zero.
    pub period: Duration,
    /// Most time between the event that causes the frame and its entry into the queue.
    pub jitter: Duration,
}

/// The analysis gives up on a busy period that is longer than this many of the longest period; a
/// bus whose load leaves it shorter than that has no bound that anyone could use.
const LONGEST_BUSY_PERIODS: u64 = 100;

/// The worst-case response time of each message, from the event that causes it to the end of its
/// intermission, in the order of `messages`; `None` where there is no bound.
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
    let length = |message: &Message| worst_case_bits(message.id, message.bytes);
    let frames: Vec<Analysed> = messages
        .iter()
        .map(|message| Analysed {
            urgency: urgency(message.id),
            length: nanos(bit_time(length(message), bit_rate)),
            period: nanos(message.period),
            jitter: nanos(message.jitter),
        })
        .collect();
    let outside = nanos(bit_time(blocking_bits, bit_rate));
    let longest = frames.iter().map(|frame| frame.period + frame.jitter).max();
    let horizon = LONGEST_BUSY_PERIODS * longest.unwrap_or(0);
    (0..frames.len())
        .map(|place| response(place, &frames, outside, bit, horizon).map(Duration::from_nanos))
        .collect()
}

/// A message in nanoseconds.
struct Analysed {
    urgency: u64,
    length: u64,
    period: u64,
    jitter: u64,
}

impl Analysed {
    /// The bus time that this frame takes from less urgent ones in a window of `window`.
    fn interference(&self, window: u64) -> u64 {
        (window + self.jitter).div_ceil(self.period) * self.length
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
fn response(
    place: usize,
    frames: &[Analysed],
    outside: u64,
    bit: u64,
    horizon: u64,
) -> Option<u64> {
    let this = &frames[place];
    let blocking = frames
        .iter()
        .filter(|other| other.urgency > this.urgency)
        .map(|other| other.length)
        .fold(outside, u64::max);
    let more_urgent = || {
        let others = frames
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != place);
        let others = others.map(|(_, other)| other);
        others.filter(|other| other.urgency <= this.urgency)
    };

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
