//! What the objects say that the loops and the state machine go by.

use super::{INTERPOLATED_POSITION, VELOCITY};
use crate::dictionary::CIA402_CSP;
use crate::twin::cia402::interpolation_period;
use crate::twin::servo::option_codes::OptionCodes;
use syncline_canopen::Address;
use syncline_canopen::dictionary::{Dictionary, Preset};
use syncline_canopen::time::Duration;

/// Taken anew from the objects with each write.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settings {
    /// 6060h.
    pub(super) mode: i64,
    /// 607Ah, or 60C1h:1 in Interpolated Position, within 607Dh: increments.
    pub(super) target: f64,
    /// It is outside of 607Dh.
    pub(super) target_is_limited: bool,
    /// 60B2h, as a part of the motor's rated torque.
    pub(super) torque_offset: f64,
    /// 60FFh, or 6042h within 6046h in velocity mode, in units of velocity.
    pub(super) target_velocity: i64,
    /// 6042h is outside of 6046h.
    pub(super) velocity_is_limited: bool,
    /// 6083h and 6084h, or 6048h and 6049h, in units of velocity in a second.
    pub(super) ramps: [f64; 2],
    /// 604Ah, in units of velocity in a second.
    pub(super) velocity_quick_stop: f64,
    /// 604Ch, 1/min of a unit of 6042h; `None`: there is no such object.
    pub(super) dimension: Option<f64>,
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
    pub(super) option_codes: OptionCodes,
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
        // A difference of speeds in so many seconds.
        let slope = |index| value(index, 1) as f64 / value(index, 2).max(1) as f64;
        let asked = match mode {
            VELOCITY => value(0x6042, 0),
            _ => value(0x60FF, 0),
        };
        let target_velocity = match mode {
            VELOCITY => amount_within(asked, [value(0x6046, 1), value(0x6046, 2)]),
            _ => asked,
        };
        Self {
            mode,
            target: limited as f64,
            target_is_limited: limited != target,
            torque_offset: value(0x60B2, 0) as f64 / 1000.0,
            target_velocity,
            velocity_is_limited: target_velocity != asked,
            ramps: match mode {
                VELOCITY => [slope(0x6048), slope(0x6049)],
                _ => [value(0x6083, 0) as f64, value(0x6084, 0) as f64],
            },
            velocity_quick_stop: slope(0x604A),
            dimension: (objects.row(0x604C, 1))
                .map(|_| value(0x604C, 1) as f64 / value(0x604C, 2) as f64)
                .filter(|it| it.is_finite()),
            period: (objects.row(0x60C2, 1))
                .map(|_| interpolation_period(value(0x60C2, 1), value(0x60C2, 2))),
            following_error: window(0x6065),
            following_error_time: millis(0x6066),
            window: window(0x6067),
            window_time: millis(0x6068),
            quick_stop_deceleration: value(0x6085, 0) as f64,
            option_codes: OptionCodes {
                quick_stop: value(0x605A, 0),
                fault_reaction: value(0x605E, 0),
                abort_connection: value(0x6007, 0),
            },
        }
    }
}

/// A speed whose amount is within these, unless it is 0, which stays so.
fn amount_within(speed: i64, [least, most]: [i64; 2]) -> i64 {
    speed.signum() * speed.abs().max(least).min(most)
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
