//! Limit and reference switches, other inputs, outputs, fast capture.

use super::drive::{Drive, StopBy};
use super::fault::DriveError;
use super::settings::INCREMENTS_PER_REVOLUTION;
use crate::twin::node::Firmware;
use crate::twin::servo::firmware::ServoFirmware;
use core::f64::consts::TAU;
use core::ops::Range;
use syncline_canopen::cia402::State;

/// Bits of 2046h, 2047h, 2048h and of the states of the modes (10276, 12251).
pub(super) const LIMP: u16 = 1 << 0;
pub(super) const LIMN: u16 = 1 << 1;
pub(super) const REF: u16 = 1 << 2;
pub(super) const STOP: u16 = 1 << 3;
/// Bits of 2062h and of the states of the modes (11015).
pub(super) const SW_LIMP: u16 = 1 << 5;
pub(super) const SW_LIMN: u16 = 1 << 6;

/// Switches along the axis, in revolutions from the encoder's zero. The index pulse comes at
/// every whole revolution. By default none is fitted, and its input rests.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Switches {
    /// LIMN: active below this position.
    pub negative_limit: Option<f64>,
    /// LIMP: active above this position.
    pub positive_limit: Option<f64>,
    /// REF: active within.
    pub reference: Option<Range<f64>>,
}

/// The inputs that nothing along the axis drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Inputs {
    /// Bits 31 to 16 of 60FDh (16458-16492).
    pub(super) levels: u32,
    /// Whether STOP is active.
    pub(super) stop: bool,
}

/// Bits of 60FDh.
const CAPTURE_1: u32 = 1 << 21;
const CAPTURE_2: u32 = 1 << 22;

/// Bit of 60FEh.
const TRIGGER: u32 = 1 << 22;

/// Both channels of the fast capture (5152-5209).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Captures {
    /// 2019h: armed channels.
    armed: u16,
    repeat: bool,
    /// 202Ah.
    status: u16,
    positions: [i64; 2],
    /// The inputs at the step before.
    levels: u32,
    revolution: i64,
}

impl Drive {
    /// Which of LIMP, LIMN, REF and STOP are active.
    pub(super) fn active_signals(&self) -> u16 {
        let position = self.servo.loops.shaft.position();
        let Switches {
            negative_limit,
            positive_limit,
            reference,
        } = &self.switches;
        // With the direction reversed the wiring has to be swapped (5141): here it is.
        let (limp, limn) = match self.settings.direction < 0.0 {
            false => (LIMP, LIMN),
            true => (LIMN, LIMP),
        };
        let bit = |active: bool, bit| if active { bit } else { 0 };
        bit(positive_limit.is_some_and(|limit| position > limit), limp)
            | bit(negative_limit.is_some_and(|limit| position < limit), limn)
            | bit(
                reference
                    .as_ref()
                    .is_some_and(|range| range.contains(&position)),
                REF,
            )
            | bit(self.inputs.stop, STOP)
    }

    /// Software limits that the position is beyond.
    fn software_limits(&self) -> u16 {
        let (position, _) = self.settings.user(self.position());
        let beyond = |limit: Option<i64>, is_beyond: fn(i64, i64) -> bool| {
            limit.is_some_and(|limit| is_beyond(position, limit))
        };
        let bit = |active: bool, bit| if active { bit } else { 0 };
        bit(
            beyond(self.settings.positive_limit, |at, limit| at > limit),
            SW_LIMP,
        ) | bit(
            beyond(self.settings.negative_limit, |at, limit| at < limit),
            SW_LIMN,
        )
    }

    /// Limits of either kind that are passed: statusword bit 11 (15097).
    pub(super) fn limit_signals(&self) -> u16 {
        let enabled = self.objects.value(0x2046, 0).unwrap_or(0) as u16;
        self.active_signals() & enabled & (LIMP | LIMN) | self.software_limits()
    }

    /// A limit stops a movement towards it, STOP every one (5230-5280).
    pub(super) fn watch_limits(&mut self) {
        let direction = self.ramp.velocity;
        let towards = match direction {
            up if up > 0.0 => LIMP | SW_LIMP,
            down if down < 0.0 => LIMN | SW_LIMN,
            _ => 0,
        };
        let enabled = self.objects.value(0x2046, 0).unwrap_or(0) as u16;
        // Homing runs onto the switches on purpose.
        let hard = match self.homing.is_active() {
            true => STOP,
            false => towards | STOP,
        };
        let signals = self.active_signals() & enabled & hard | self.software_limits() & towards;
        if signals == 0 || !self.is_moving() {
            return;
        }
        self.latched_signals |= signals;
        self.next_stop = self.stop_by(signals);
        self.raise(match signals & (LIMP | LIMN | STOP) {
            0 => DriveError::SOFTWARE_LIMIT,
            _ => DriveError::EXTERNAL_SIGNAL,
        });
        self.next_stop = StopBy::default();
    }

    /// What these signals brake by: 204Ch has a bit for each input, the ramp of the movement or the quick stop current
    /// (10516-10530); a software limit has none there.
    fn stop_by(&self, signals: u16) -> StopBy {
        let chosen = self.objects.value(0x204C, 0).unwrap_or(0) as u16;
        let inputs = [(LIMP, 0), (LIMN, 1), (STOP, 2)];
        let mut active = inputs.iter().filter(|(signal, _)| signals & signal != 0);
        match (
            signals & (LIMP | LIMN | STOP),
            active.any(|(_, bit)| chosen >> bit & 1 != 0),
        ) {
            (0, _) => StopBy::QuickStop,
            (_, true) => StopBy::Current,
            (_, false) => StopBy::Ramp,
        }
    }

    /// Torque of the quick stop current, 204Dh in 0.01 A (10544), N·m.
    pub(super) fn stop_torque(&self) -> f64 {
        let amperes = self.objects.value(0x204D, 0).unwrap_or(0) as f64 / 100.0;
        amperes * self.servo.loops.cascade.gains().torque_constant
    }

    /// What that brakes the axis with, as it was commissioned, increments/s².
    pub(super) fn stop_deceleration(&self) -> f64 {
        let gains = self.servo.loops.cascade.gains();
        let torque = self.stop_torque().min(gains.torque_limit);
        torque / (gains.inertia * TAU) * INCREMENTS_PER_REVOLUTION
    }

    /// 2062h (11015-11021): position overrun, software limits, a stop by command (204Ch has it as well), and a power
    /// stage that is off.
    pub(super) fn internal_signals(&self) -> u16 {
        let is_told_to_stop =
            self.servo.state == State::QuickStopActive && self.servo.errors.active().is_none();
        let bit = |set: bool, bit: u16| if set { 1 << bit } else { 0 };
        self.latched_signals & (SW_LIMP | SW_LIMN)
            | bit(self.overrun, 2)
            | bit(is_told_to_stop, 7)
            | bit(!self.is_powered(), 15)
    }

    /// 60FDh (16458-16492), in which LIMP and LIMN change places (D-43). A signal is active at the
    /// level of 2047h.
    pub(super) fn input_image(&self) -> u32 {
        let active = self.active_signals();
        let level = self.objects.value(0x2047, 0).unwrap_or(0) as u16;
        let high = |signal: u16, bit: u32| {
            let is_high = (active & signal != 0) == (level & signal != 0);
            u32::from(is_high) << bit
        };
        self.inputs.levels & 0xFFFF_0000
            | high(LIMN, 0)
            | high(LIMP, 1)
            | high(REF, 2)
            | high(STOP, 3)
    }

    /// Outputs that 60FEh:2 leaves to 60FEh:1 (16548-16592), and TRIGGER of the lists (4663).
    pub(super) fn outputs(&self) -> u32 {
        let value = |sub| self.objects.value(0x60FE, sub).unwrap_or(0) as u32;
        let trigger = if self.list.trigger() { TRIGGER } else { 0 };
        value(1) & value(2) & 0x007F_0000 | trigger
    }

    // ---- capture ----

    /// 2019h: bits 0 and 1 arm, bit 14 ends, bit 15 repeats (9631-9637).
    pub(super) fn start_capture(&mut self, bits: u16) {
        if bits & 1 << 14 != 0 {
            self.captures.armed = 0;
            return;
        }
        self.captures.armed |= bits & 0b11;
        self.captures.repeat = bits & 1 << 15 != 0;
        self.captures.status &= !(bits & 0b11);
    }

    /// Looks for the edges of 2016h and 2018h.
    pub(super) fn watch_captures(&mut self) {
        let before = self.captures;
        let revolution =
            (self.servo.loops.encoder as f64 / INCREMENTS_PER_REVOLUTION).floor() as i64;
        self.captures.levels = self.inputs.levels;
        self.captures.revolution = revolution;
        let value = |index| self.objects.value(index, 0).unwrap_or(0) as u16;
        let (sources, edges) = (value(0x2016), value(0x2018));
        for channel in 0..2_u16 {
            if self.captures.armed & 1 << channel == 0 {
                continue;
            }
            let rises = edges & 1 << channel != 0;
            let edge = |bit: u32| {
                let (was, is) = (before.levels & bit != 0, self.inputs.levels & bit != 0);
                was != is && is == rises
            };
            let at = self.position() as i64;
            let captured = match sources >> (2 * channel) & 0b11 {
                0 => edge(CAPTURE_1).then_some(at),
                1 => edge(CAPTURE_2).then_some(at),
                // Index pulse of the motor's sensor: where the revolution begins.
                3 if revolution != before.revolution => {
                    let pulse = revolution.max(before.revolution) as f64;
                    Some((pulse * INCREMENTS_PER_REVOLUTION) as i64 - self.zero)
                }
                // There is no sensor of setpoints.
                _ => None,
            };
            if let Some(position) = captured {
                self.captures.positions[usize::from(channel)] = position;
                self.captures.status |= 1 << channel;
                if !self.captures.repeat {
                    self.captures.armed &= !(1 << channel);
                }
            }
        }
    }

    pub(super) fn publish_captures(&mut self) {
        let [first, second] = self.captures.positions;
        self.objects.put(0x202A, 0, self.captures.status.into());
        self.objects.put(0x202B, 0, first);
        self.objects.put(0x202C, 0, second);
    }
}
