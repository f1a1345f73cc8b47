//! What the objects say that the loops and the state machine go by.

use super::INTERPOLATED_POSITION;
use crate::dictionary::CIA402_CSP;
use syncline_canopen::Address;
use syncline_canopen::dictionary::{Dictionary, Preset};
use syncline_canopen::time::Duration;

/// 605Ah and 605Eh: off at once.
pub(super) const SWITCH_OFF: i64 = 0;
/// 605Ah: brake with the quick stop ramp and stay in Quick Stop Active.
pub(super) const BRAKE_AND_STAY: i64 = 6;

/// Taken anew from the objects with each write.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settings {
    /// 6060h.
    pub(super) mode: i64,
    /// 607Ah, or 60C1h:1 in Interpolated Position, within 607Dh: increments.
    pub(super) target: f64,
    /// It is outside of 607Dh.
    pub(super) target_is_limited: bool,
    /// 60FFh, 6083h and 6084h, in units of velocity, and of them in a second.
    pub(super) target_velocity: i64,
    pub(super) ramps: [i64; 2],
    /// 60C2h, seconds; `None`: there is no such object.
    pub(super) period: Option<f64>,
    /// 6065h, increments; `None`: not watched.
    pub(super) following_error: Option<f64>,
    /// 6066h.
    pub(super) following_error_time: Duration,
    /// 6067h, increments; `None`: not watched.
    pub(super) window: Option<f64>,
    /// 6068h.
    pub(super) window_time: Duration,
    /// 6085h, increments/s².
    pub(super) quick_stop_deceleration: f64,
    /// 605Ah.
    pub(super) quick_stop: i64,
    /// 605Eh.
    pub(super) fault_reaction: i64,
    /// 6007h.
    pub(super) abort_connection: i64,
}

impl Settings {
    pub(super) fn of(objects: &Dictionary) -> Self {
        // What it does not have is as the profile's table says.
        let value = |index, sub| {
            let own = objects.value(index, sub);
            own.unwrap_or_else(|| usual(Address::new(index, sub)))
        };
        // FFFF FFFFh switches a window off (CiA 402).
        let window = |index| {
            let increments = value(index, 0);
            (increments != u32::MAX.into()).then_some(increments as f64)
        };
        let millis = |index| Duration::from_millis(value(index, 0) as u64);
        let (least, most) = (value(0x607D, 1), value(0x607D, 2));
        let mode = value(0x6060, 0);
        let target = match mode {
            INTERPOLATED_POSITION => value(0x60C1, 1),
            _ => value(0x607A, 0),
        };
        let limited = target.max(least).min(most);
        Self {
            mode,
            target: limited as f64,
            target_is_limited: limited != target,
            target_velocity: value(0x60FF, 0),
            ramps: [value(0x6083, 0), value(0x6084, 0)],
            period: (objects.row(0x60C2, 1))
                .map(|_| value(0x60C2, 1) as f64 * power_of_ten(value(0x60C2, 2))),
            following_error: window(0x6065),
            following_error_time: millis(0x6066),
            window: window(0x6067),
            window_time: millis(0x6068),
            quick_stop_deceleration: value(0x6085, 0) as f64,
            quick_stop: value(0x605A, 0),
            fault_reaction: value(0x605E, 0),
            abort_connection: value(0x6007, 0),
        }
    }
}

/// What an object of the profile's table has after power-on.
fn usual(address: Address) -> i64 {
    let mut entries = CIA402_CSP.iter();
    match entries.find(|entry| entry.address == address) {
        Some(entry) => match entry.preset {
            Preset::Number(value) | Preset::Assumed(value) => value,
            _ => 0,
        },
        None => 0,
    }
}

/// 10 to a power of −6…0.
fn power_of_ten(exponent: i64) -> f64 {
    1.0 / 10u32.pow(-exponent.clamp(-6, 0) as u32) as f64
}
