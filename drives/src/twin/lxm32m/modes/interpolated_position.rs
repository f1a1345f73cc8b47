//! Interpolated Position (lxm32m 1596-1660): one setpoint a SYNC cycle.

use super::Mode;
use crate::twin::lxm32m::drive::Drive;
use crate::twin::lxm32m::fault::DriveError;
use crate::twin::lxm32m::motion::Motion;
use crate::twin::lxm32m::policy::SetpointGap;
use crate::twin::lxm32m::synchronisation::SyncStatus;
use crate::twin::lxm32m::units::INCREMENTS_PER_REVOLUTION;
use crate::twin::servo::cascade::{POSITION_STEP, POSITION_STEP_NS, SPEED_STEPS};
use crate::twin::servo::firmware::ServoFirmware;
use syncline_canopen::Instant;
use syncline_canopen::cia402::{Controlword, State};
use syncline_canopen::node::Origin;

/// Setpoints on their way to the reference.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::twin::lxm32m) struct Interpolation {
    /// The reference gets there at the end of this cycle; `None` in a gap.
    target: Option<f64>,
    /// For the next cycle: its SYNC came a little early.
    pending: Option<f64>,
    /// 60C1h:1 has been written since the last SYNC.
    fresh: bool,
    /// SYNCs in a row without a setpoint.
    gaps: u32,
    /// Bit 4 asks for the mode: by PDO its level, by SDO its rising edge in Operation Enabled
    /// (lxm32m 1641).
    asked: bool,
    /// The mode was ended by Halt, Quick Stop or an error: bit 4 has to fall first.
    spent: bool,
}

impl Interpolation {
    /// A setpoint has been written; it counts with the next SYNC.
    pub(super) fn offer(&mut self) {
        self.fresh = true;
    }

    /// A cycle of the drive's clock begins.
    pub(in crate::twin::lxm32m) fn next_cycle(&mut self) {
        self.target = self.pending.take();
    }

    pub(super) fn end(&mut self) {
        *self = Self {
            asked: self.asked,
            spent: self.asked,
            ..Self::default()
        };
    }
}

impl Drive {
    pub(super) fn command_interpolation(&mut self, start: bool, origin: Origin) {
        if !self.servo.controlword.has(Controlword::MODE_4) {
            self.interpolation.asked = false;
            self.interpolation.spent = false;
            if self.motion == Motion::Interpolate {
                self.end_mode();
                self.stop(self.profile_deceleration());
            }
        } else if matches!(origin, Origin::Pdo(_))
            || (start && self.servo.state == State::OperationEnabled)
        {
            self.interpolation.asked = true;
        }
    }

    /// A SYNC, after the synchronous R_PDOs have been put into effect.
    pub(in crate::twin::lxm32m) fn on_sync(&mut self, now: Instant) {
        let early = self.sync.is_paced() && self.servo.loops.clock.phase_error(now) < 0;
        let verdict = self
            .sync
            .on_sync(&mut self.servo.loops.clock, now, &self.policies);
        self.judge_sync(verdict);
        self.start_interpolation();
        let fresh = core::mem::take(&mut self.interpolation.fresh);
        if self.motion != Motion::Interpolate {
            return;
        }
        let setpoint = fresh.then(|| self.setpoint());
        if fresh {
            self.interpolation.gaps = 0;
        } else {
            self.interpolation.gaps += 1;
            let most = self.policies.missing_setpoints;
            if most.is_some_and(|most| self.interpolation.gaps > most) {
                self.raise(DriveError::SETPOINTS_MISSING);
                return;
            }
        }
        if early {
            self.interpolation.pending = setpoint;
        } else {
            self.interpolation.target = setpoint;
        }
    }

    fn start_interpolation(&mut self) {
        let locked = self.sync.status() == SyncStatus::Synchronised;
        let asked = self.interpolation.asked && !self.interpolation.spent;
        if self.mode != Mode::InterpolatedPosition
            || self.motion != Motion::Hold
            || !self.may_move()
            || !asked
            || !self.interpolation.fresh
            || (self.policies.start_needs_lock && !locked)
        {
            return;
        }
        let distance = (self.setpoint() - self.ramp.position) / INCREMENTS_PER_REVOLUTION;
        let window = self.policies.first_setpoint_window;
        if window.is_some_and(|window| distance.abs() > window) {
            self.raise(DriveError::SETPOINT_JUMP);
            return;
        }
        self.begin(Motion::Interpolate);
        self.bit_12 = true;
    }

    /// The reference at the beginning of this position step, and its velocity during it.
    pub(in crate::twin::lxm32m) fn interpolate(&mut self, step: u32) {
        self.ramp.position += self.ramp.velocity * POSITION_STEP;
        if let Some(target) = self.interpolation.target {
            let steps_left = (self.servo.loops.clock.steps() - step) / SPEED_STEPS;
            let distance = target - self.ramp.position;
            self.ramp.velocity = distance / (f64::from(steps_left.max(1)) * POSITION_STEP);
        } else if self.policies.setpoint_gap == SetpointGap::Hold {
            self.ramp.velocity = 0.0;
        }
    }

    /// Bit 10: position reached (lxm32m 1649); while setpoints move it is not (D-38).
    pub(super) fn watch_interpolation(&mut self) {
        if self.motion == Motion::Interpolate {
            self.target_reached = self.ramp.velocity == 0.0 && self.is_in_window();
        }
    }

    /// The interpolation period of 60C2h in nanoseconds.
    pub(super) fn period_ns(&self) -> u64 {
        let value = self.objects.get(self.rows.period_value).max(1) as u64;
        let exponent = self.objects.get(self.rows.period_index) + 9;
        let unit = 10u64.pow(exponent.clamp(4, 9) as u32);
        (value * unit).max(POSITION_STEP_NS)
    }

    fn setpoint(&self) -> f64 {
        self.target_of(self.objects.get(self.rows.setpoint))
    }
}
