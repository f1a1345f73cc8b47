//! The drive behind the CANopen node: state machine, loops, monitoring.

use super::fault::{DriveError, ErrorClass, Errors};
use super::motion::Ramp;
use super::policy::{Policies, SetpointGap};
use super::rows::Rows;
use super::synchronisation::{self, SyncStatus, Synchronisation, Verdict};
use crate::twin::clock::Clock;
use crate::twin::control::{Cascade, POSITION_STEP_NS, Reference, SPEED_STEP_NS, SPEED_STEPS};
use crate::twin::plant::{INCREMENTS_PER_REVOLUTION, Plant};
use syncline_canopen::Instant;
use syncline_canopen::cia402::{Command, Controlword, State, Statusword};
use syncline_canopen::dictionary::{Dictionary, Row};
use syncline_canopen::sdo::AbortCode;
use syncline_canopen::time::Duration;

/// Nominal seconds per step of the speed loop and of the position loop.
const SPEED_STEP: f64 = SPEED_STEP_NS as f64 * 1e-9;
const POSITION_STEP: f64 = POSITION_STEP_NS as f64 * 1e-9;

/// Position steps over which 606Ch averages: 8 ms.
const VELOCITY_WINDOW: usize = 32;

/// Speed below which the motor counts as standing, increments/s (10 rpm).
const STANDSTILL: f64 = INCREMENTS_PER_REVOLUTION / 6.0;

/// Least time that statusword bit 7 stays (lxm32m 1319).
const WARNING_TIME: Duration = Duration::from_millis(100);

/// Interpolated Position (lxm32m 1596).
const INTERPOLATED_POSITION: i64 = 7;

/// How a write reaches an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Channel {
    Sdo,
    Pdo,
}

/// What the profile generator does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    /// The reference rests.
    Hold,
    /// It brakes with this deceleration, increments/s².
    Stop(f64),
    /// It runs from setpoint to setpoint, one a SYNC cycle.
    Interpolate,
}

/// Interpolated Position: setpoints on their way to the reference.
#[derive(Clone, Copy, Debug, Default)]
struct Interpolation {
    /// The reference gets there at the end of this cycle; `None` in a gap.
    target: Option<f64>,
    /// For the next cycle: its SYNC came a little early.
    pending: Option<f64>,
    /// 60C1h:1 has been written since the last SYNC.
    fresh: bool,
    /// SYNCs in a row without a setpoint.
    gaps: u32,
    /// A rising edge of bit 4 came by SDO (lxm32m 1641).
    edge: bool,
    /// The mode was ended by Halt, Quick Stop or an error: bit 4 has to fall first.
    spent: bool,
}

/// A drive without its bus.
pub(super) struct Drive {
    pub(super) objects: Dictionary,
    pub(super) rows: Rows,
    pub(super) policies: Policies,
    pub(super) errors: Errors,
    now: Instant,
    state: State,
    state_since: Instant,
    controlword: Controlword,
    clock: Clock,
    plant: Plant,
    cascade: Cascade,
    encoder: i64,
    /// Encoder reading at user position 0.
    zero: i64,
    recent: [i64; VELOCITY_WINDOW],
    recent_place: usize,
    ramp: Ramp,
    motion: Motion,
    sync: Synchronisation,
    interpolation: Interpolation,
    enable_at: Option<Instant>,
    quick_stopping: bool,
    warning_until: Instant,
    mode_bit_12: bool,
    target_reached: bool,
    x_err: bool,
    x_end: bool,
    ref_ok: bool,
    status_event: bool,
}

impl Drive {
    pub(super) fn new(
        objects: Dictionary,
        policies: Policies,
        clock: Clock,
        mut plant: Plant,
        cascade: Cascade,
    ) -> Self {
        let encoder = plant.encoder(0.0);
        Self {
            rows: Rows::new(&objects),
            objects,
            policies,
            errors: Errors::new(),
            now: Instant::ZERO,
            state: State::SwitchOnDisabled,
            state_since: Instant::ZERO,
            controlword: Controlword(0),
            clock,
            plant,
            cascade,
            encoder,
            zero: 0,
            recent: [encoder; VELOCITY_WINDOW],
            recent_place: 0,
            ramp: Ramp::at(encoder as f64),
            motion: Motion::Hold,
            sync: Synchronisation::new(),
            interpolation: Interpolation::default(),
            enable_at: None,
            quick_stopping: false,
            warning_until: Instant::ZERO,
            mode_bit_12: false,
            target_reached: false,
            x_err: false,
            x_end: true,
            ref_ok: false,
            status_event: false,
        }
    }

    pub(super) fn state(&self) -> State {
        self.state
    }

    pub(super) fn plant(&self) -> &Plant {
        &self.plant
    }

    pub(super) fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }

    /// Torque of the motor, N·m.
    pub(super) fn torque(&self) -> f64 {
        self.cascade.torque()
    }

    /// Whether the power stage is on.
    pub(super) fn is_powered(&self) -> bool {
        self.state.is_powered()
    }

    // ---- time ----

    /// Lets the loops and the shaft run up to `now`.
    pub(super) fn advance(&mut self, now: Instant) {
        while self.clock.step_end() <= now {
            self.step();
        }
        self.now = now;
    }

    fn step(&mut self) {
        let (step, dt) = self.clock.step();
        if step % SPEED_STEPS == 0 {
            self.now = self.clock.step_end();
            self.position_step(step);
        }
        let reference = self.loop_reference();
        let torque = self.cascade.speed_step(
            reference,
            self.encoder,
            INCREMENTS_PER_REVOLUTION,
            SPEED_STEP,
        );
        self.plant.step(dt, torque, self.is_powered());
        self.encoder = self.plant.encoder(0.0);
        if self.clock.next_step() {
            self.interpolation.target = self.interpolation.pending.take();
        }
    }

    fn position_step(&mut self, step: u32) {
        self.recent[self.recent_place] = self.encoder;
        self.recent_place = (self.recent_place + 1) % VELOCITY_WINDOW;
        if step == self.clock.steps() / 2 / SPEED_STEPS * SPEED_STEPS {
            let verdict = self.sync.on_mid_cycle(&self.policies);
            self.judge_sync(verdict);
        }
        self.change_state();
        self.move_reference(step);
        let reference = self.loop_reference();
        self.cascade
            .position_step(reference, self.encoder, INCREMENTS_PER_REVOLUTION);
        self.monitor();
    }

    fn loop_reference(&self) -> Reference {
        if self.is_powered() {
            Reference::Position {
                position: self.ramp.position,
                velocity: self.ramp.velocity,
            }
        } else {
            Reference::Off
        }
    }

    fn move_reference(&mut self, step: u32) {
        if !self.is_powered() {
            self.ramp = Ramp::at(self.encoder as f64);
            return;
        }
        match self.motion {
            Motion::Hold => self.ramp.velocity = 0.0,
            Motion::Stop(deceleration) => {
                if self.ramp.towards_velocity(0.0, deceleration, POSITION_STEP) {
                    self.motion = Motion::Hold;
                }
            }
            Motion::Interpolate => self.interpolate(step),
        }
    }

    /// The reference at the beginning of this position step, and its velocity during it.
    fn interpolate(&mut self, step: u32) {
        self.ramp.position += self.ramp.velocity * POSITION_STEP;
        if let Some(target) = self.interpolation.target {
            let steps_left = (self.clock.steps() - step) / SPEED_STEPS;
            let distance = target - self.ramp.position;
            self.ramp.velocity = distance / (f64::from(steps_left.max(1)) * POSITION_STEP);
        } else if self.policies.setpoint_gap == SetpointGap::Hold {
            self.ramp.velocity = 0.0;
        }
    }

    fn monitor(&mut self) {
        let deviation = self.ramp.position - self.encoder as f64;
        let standing = self.actual_velocity().abs() < STANDSTILL;
        let at_rest = self.motion == Motion::Hold && standing;
        if self.state == State::OperationEnabled || self.state == State::QuickStopActive {
            let limit = self.increments_of(self.objects.get(self.rows.following_error_limit));
            if deviation.abs() > limit {
                self.raise(DriveError::FOLLOWING_ERROR);
                return;
            }
        }
        if self.motion == Motion::Interpolate {
            let window = self.increments_of(self.objects.get(self.rows.standstill_window));
            self.target_reached = self.ramp.velocity == 0.0 && deviation.abs() <= window;
        } else if at_rest && !self.x_end {
            self.x_end = true;
            self.target_reached |= self.controlword.has(Controlword::HALT);
        }
        if self.quick_stopping && at_rest {
            self.quick_stopping = false;
            match self.state {
                State::FaultReactionActive => self.enter(State::Fault),
                _ => self.target_reached = true,
            }
        }
    }

    // ---- state machine ----

    fn enter(&mut self, state: State) {
        if state == self.state {
            return;
        }
        let was_powered = self.is_powered();
        self.state = state;
        self.state_since = self.now;
        self.enable_at = None;
        if self.is_powered() && !was_powered {
            self.cascade.reset();
            self.ramp = Ramp::at(self.encoder as f64);
            self.motion = Motion::Hold;
            self.x_err = false;
            self.target_reached = false;
        }
        if was_powered && !self.is_powered() {
            self.end_mode();
            self.motion = Motion::Hold;
            self.quick_stopping = false;
            self.x_end = true;
        }
    }

    /// The changes that need no command.
    fn change_state(&mut self) {
        match self.state {
            // Factory setting of 301Bh:13: the examples show state 4 before any controlword (D-28).
            State::SwitchOnDisabled
                if self.objects.get(self.rows.ds402_compatible) == 0
                    && self.now.saturating_since(self.state_since) >= Duration::from_millis(1) =>
            {
                self.enter(State::ReadyToSwitchOn);
            }
            State::SwitchedOn if self.enable_at.is_some_and(|at| self.now >= at) => {
                self.enter(State::OperationEnabled);
            }
            _ => {}
        }
    }

    /// A controlword (lxm32m 1360-1393).
    fn command(&mut self, word: Controlword, channel: Channel) {
        let previous = core::mem::replace(&mut self.controlword, word);
        if word.resets_fault(previous) {
            self.reset_errors();
        }
        if matches!(self.state, State::FaultReactionActive | State::Fault) {
            return;
        }
        match (word.command(), self.state) {
            (Some(Command::DisableVoltage), State::ReadyToSwitchOn)
                if self.objects.get(self.rows.ds402_compatible) == 0 => {} // T7, and back at once
            (Some(Command::DisableVoltage), _)
            | (Some(Command::QuickStop), State::ReadyToSwitchOn | State::SwitchedOn) => {
                self.enter(State::SwitchOnDisabled);
            }
            (Some(Command::QuickStop), State::OperationEnabled) => {
                self.enter(State::QuickStopActive);
                self.x_err = true;
                self.quick_stop();
            }
            (Some(Command::Shutdown), State::SwitchOnDisabled)
            | (Some(Command::Shutdown), State::SwitchedOn | State::OperationEnabled) => {
                self.enter(State::ReadyToSwitchOn);
            }
            (Some(Command::SwitchOn), State::ReadyToSwitchOn | State::OperationEnabled) => {
                self.enter(State::SwitchedOn);
            }
            (Some(Command::SwitchOn), State::SwitchedOn) => self.enable_at = None,
            (Some(Command::EnableOperation), State::ReadyToSwitchOn | State::SwitchedOn) => {
                self.enter(State::SwitchedOn);
                self.enable_at
                    .get_or_insert(self.now + self.policies.enable_time);
            }
            (Some(Command::EnableOperation), State::QuickStopActive)
                if self.errors.active.is_none() =>
            {
                self.enter(State::OperationEnabled);
                self.x_err = false;
            }
            _ => {}
        }
        self.mode_command(previous, channel);
    }

    fn mode_command(&mut self, previous: Controlword, channel: Channel) {
        let word = self.controlword;
        let enabled = self.state == State::OperationEnabled;
        if word.has(Controlword::HALT) && !previous.has(Controlword::HALT) && enabled {
            self.end_mode();
            self.stop(self.profile_deceleration());
        }
        if !word.has(Controlword::MODE_4) {
            self.interpolation.edge = false;
            self.interpolation.spent = false;
            if self.motion == Motion::Interpolate {
                self.end_mode();
                self.stop(self.profile_deceleration());
            }
        } else if channel == Channel::Pdo || (enabled && !previous.has(Controlword::MODE_4)) {
            self.interpolation.edge = true;
        }
    }

    fn end_mode(&mut self) {
        self.mode_bit_12 = false;
        let edge = self.interpolation.edge;
        self.interpolation = Interpolation {
            edge,
            spent: edge,
            ..Interpolation::default()
        };
    }

    fn stop(&mut self, deceleration: f64) {
        self.motion = Motion::Stop(deceleration);
    }

    fn quick_stop(&mut self) {
        self.end_mode();
        self.quick_stopping = true;
        self.stop(self.acceleration_of(self.objects.get(self.rows.quick_stop_ramp)));
    }

    fn profile_deceleration(&self) -> f64 {
        self.acceleration_of(self.objects.get(self.rows.profile_deceleration))
    }

    /// Power is gone: nothing moves the shaft, and every error is forgotten.
    pub(super) fn power_off(&mut self) {
        self.enter(State::NotReadyToSwitchOn);
        self.errors = Errors::new();
    }

    /// The application starts with the objects as they were stored.
    pub(super) fn restart(&mut self) {
        if !matches!(self.state, State::Fault | State::FaultReactionActive) {
            self.enter(State::NotReadyToSwitchOn);
            self.enter(State::SwitchOnDisabled);
            self.x_err = false;
        }
        self.controlword = Controlword(0);
        self.sync.stop(&mut self.clock, self.now);
        for row in [self.rows.feed_forward, self.rows.velocity_limit] {
            self.written(row, Channel::Sdo);
        }
    }

    /// The statusword's row if something happened that it shows although its value may be the
    /// same as before.
    pub(super) fn take_status_event(&mut self) -> Option<Row> {
        core::mem::take(&mut self.status_event).then_some(self.rows.statusword)
    }

    /// Puts an enabled drive on the bus: somebody left it so.
    pub(super) fn start_enabled(&mut self) {
        self.controlword = Controlword::ENABLE_OPERATION;
        self.enter(State::OperationEnabled);
    }

    // ---- errors ----

    /// Raises an error and reacts as its class says.
    pub(super) fn raise(&mut self, error: DriveError) {
        if error.class == ErrorClass::Warning {
            self.objects
                .set(self.rows.last_warning, error.number.into());
            self.objects.set(self.rows.warnings_active, 1);
            self.objects.set(self.rows.warnings_latched, 1);
            self.warning_until = self.now + WARNING_TIME;
            return;
        }
        // The first error is the one to tell, unless a worse one follows.
        if self
            .errors
            .active
            .is_some_and(|active| active.class >= error.class)
        {
            return;
        }
        self.errors.active = Some(error);
        self.errors.tell(error, 0);
        self.objects.set(self.rows.last_error, error.number.into());
        self.x_err = true;
        let powered = self.is_powered();
        match error.class {
            ErrorClass::QuickStop if powered => {
                self.enter(State::QuickStopActive);
                self.quick_stop();
            }
            ErrorClass::StopAndSwitchOff if powered => {
                self.enter(State::FaultReactionActive);
                self.quick_stop();
            }
            _ => {
                self.enter(State::Fault);
            }
        }
    }

    fn reset_errors(&mut self) {
        self.warning_until = self.now;
        self.objects.set(self.rows.warnings_active, 0);
        let Some(active) = self.errors.active else {
            return;
        };
        if active.class == ErrorClass::Fatal
            || self.errors.cause_persists
            || self.state == State::FaultReactionActive
        {
            return;
        }
        self.errors.active = None;
        self.x_err = false;
        if self.policies.emcy_on_reset {
            self.errors.tell_reset();
        }
        if self.state == State::Fault {
            self.enter(State::SwitchOnDisabled);
        }
    }

    // ---- SYNC ----

    /// A SYNC, after the synchronous R_PDOs have been put into effect.
    pub(super) fn on_sync(&mut self, now: Instant) {
        let early = self.sync.is_paced() && self.clock.phase_error(now) < 0;
        let verdict = self.sync.on_sync(&mut self.clock, now, &self.policies);
        self.judge_sync(verdict);
        self.start_interpolation();
        if self.motion != Motion::Interpolate {
            self.interpolation.fresh = false;
            return;
        }
        let setpoint = core::mem::take(&mut self.interpolation.fresh).then(|| self.setpoint());
        if setpoint.is_some() {
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

    fn judge_sync(&mut self, verdict: Verdict) {
        if verdict == Verdict::Lost && self.is_powered() {
            self.raise(DriveError::SYNC_LOST);
        }
    }

    fn start_interpolation(&mut self) {
        let ready = self.state == State::OperationEnabled
            && self.motion == Motion::Hold
            && self.objects.get(self.rows.mode) == INTERPOLATED_POSITION
            && !self.controlword.has(Controlword::HALT)
            && self.interpolation.edge
            && !self.interpolation.spent
            && self.interpolation.fresh;
        let locked = self.sync.status() == SyncStatus::Synchronised;
        if !ready || (self.policies.start_needs_lock && !locked) {
            return;
        }
        let distance = (self.setpoint() - self.ramp.position) / INCREMENTS_PER_REVOLUTION;
        if let Some(window) = self.policies.first_setpoint_window
            && distance.abs() > window
        {
            self.raise(DriveError::SETPOINT_JUMP);
            return;
        }
        self.motion = Motion::Interpolate;
        self.status_event = true;
        self.mode_bit_12 = true;
        self.x_end = false;
    }

    /// The interpolation period of 60C2h in nanoseconds.
    fn period_ns(&self) -> u64 {
        let value = self.objects.get(self.rows.period_value).max(1) as u64;
        let exponent = self.objects.get(self.rows.period_index) + 9;
        let unit = 10u64.pow(exponent.clamp(4, 9) as u32);
        (value * unit).max(POSITION_STEP_NS)
    }

    fn setpoint(&self) -> f64 {
        self.increments_of(self.objects.get(self.rows.setpoint)) + self.zero as f64
    }

    // ---- objects ----

    /// Whether the drive's state permits this write.
    pub(super) fn check_write(&self, row: Row, value: i64) -> Result<(), AbortCode> {
        let rows = &self.rows;
        let positive = [
            rows.position_denominator,
            rows.position_numerator,
            rows.velocity_denominator,
            rows.velocity_numerator,
            rows.ramp_denominator,
            rows.ramp_numerator,
        ];
        if positive.contains(&row) {
            if value < 1 {
                return Err(AbortCode::InvalidValue);
            }
            if self.is_powered() {
                return Err(AbortCode::DeviceState);
            }
        }
        if row == rows.error_count && value != 0 {
            return Err(AbortCode::InvalidValue);
        }
        if row == rows.mode && value != 0 && value != INTERPOLATED_POSITION {
            return Err(AbortCode::InvalidValue);
        }
        Ok(())
    }

    /// A value has been written that the tables and [`Self::check_write`] permit.
    pub(super) fn written(&mut self, row: Row, channel: Channel) {
        let rows = self.rows;
        if row == rows.setpoint {
            self.interpolation.fresh = true;
        } else if row == rows.controlword {
            let word = Controlword(self.objects.get(row) as u16);
            self.command(word, channel);
        } else if row == rows.error_count {
            self.errors.history = 0;
        } else if row == rows.feed_forward {
            self.cascade.gains.velocity_feed_forward = self.objects.get(row) as f64 * 1e-3;
        } else if row == rows.velocity_limit {
            let limit = self.velocity_of(self.objects.get(row));
            self.cascade.gains.speed_limit = limit / INCREMENTS_PER_REVOLUTION;
        } else if row == rows.sync_start {
            if self.objects.get(row) == synchronisation::START {
                let unit = self.policies.sync_tolerance_unit.as_nanos() as u64;
                let tolerance = self.objects.get(rows.sync_tolerance) as u64 * unit;
                self.sync.start(self.period_ns(), tolerance);
            } else {
                self.sync.stop(&mut self.clock, self.now);
            }
        }
    }

    /// Brings the objects that show the drive's condition up to `now`.
    pub(super) fn publish(&mut self, now: Instant) {
        let rows = self.rows;
        let encoder = self.plant.encoder(self.clock.since_step(now)) - self.zero;
        let reference = self.ramp.position as i64 - self.zero;
        let velocity = self.actual_velocity();
        let objects = &mut self.objects;
        objects.set(rows.position_internal, encoder);
        objects.set(rows.reference_internal, reference);
        let rpm = velocity * 60.0 / INCREMENTS_PER_REVOLUTION;
        objects.set(rows.speed, libm::round(rpm) as i64);
        let continuous = self.cascade.gains.continuous_torque;
        let torque = libm::round(self.cascade.torque() / continuous * 1000.0) as i64;
        objects.set(rows.torque, torque);
        objects.set(rows.sync_status, self.sync.status() as i64);
        objects.set(rows.error_register, self.errors.register().into());
        objects.set(rows.error_field, self.errors.history.into());
        objects.set(rows.error_count, (self.errors.history != 0).into());
        objects.set(rows.mode_active, objects.get(rows.mode));
        let position = self.user_position(encoder);
        let reference = self.user_position(reference);
        let actual = self.user_velocity(velocity);
        let generated = self.user_velocity(self.ramp.velocity);
        let statusword = self.statusword();
        let objects = &mut self.objects;
        objects.set(rows.position, position);
        objects.set(rows.reference, reference);
        objects.set(rows.position_deviation, reference - position);
        objects.set(rows.velocity, actual);
        objects.set(rows.velocity_reference, generated);
        objects.set(rows.statusword, statusword.0.into());
    }

    /// 6041h (lxm32m 1301-1351).
    pub(super) fn statusword(&self) -> Statusword {
        let flags = [
            (true, Statusword::VOLTAGE_ENABLED),
            (self.now < self.warning_until, Statusword::WARNING),
            (self.controlword.has(Controlword::HALT), Statusword::HALT),
            (true, Statusword::REMOTE),
            (self.target_reached, Statusword::TARGET_REACHED),
            (self.mode_bit_12, Statusword::MODE_12),
            (self.x_err, Statusword::BIT_13),
            (self.x_end, Statusword::BIT_14),
            (self.ref_ok, Statusword::BIT_15),
        ];
        flags
            .iter()
            .filter(|(set, _)| *set)
            .fold(Statusword(self.state.bits()), |word, (_, bit)| {
                Statusword(word.0 | bit)
            })
    }

    /// Increments/s, averaged over the window.
    fn actual_velocity(&self) -> f64 {
        let moved = self.encoder - self.recent[self.recent_place];
        moved as f64 / (POSITION_STEP * VELOCITY_WINDOW as f64)
    }

    // ---- units: usr_p, usr_v, usr_a (numerator / denominator revolutions, rpm, rpm/s) ----

    fn scale(&self, numerator: Row, denominator: Row) -> f64 {
        let numerator = self.objects.get(numerator).max(1) as f64;
        numerator / self.objects.get(denominator).max(1) as f64
    }

    fn increments_of(&self, position: i64) -> f64 {
        let rows = &self.rows;
        position as f64
            * (self.scale(rows.position_numerator, rows.position_denominator)
                * INCREMENTS_PER_REVOLUTION)
    }

    fn user_position(&self, increments: i64) -> i64 {
        let numerator = i128::from(self.objects.get(self.rows.position_numerator).max(1));
        let denominator = i128::from(self.objects.get(self.rows.position_denominator).max(1));
        let unit = numerator * INCREMENTS_PER_REVOLUTION as i128;
        (i128::from(increments) * denominator + unit / 2).div_euclid(unit) as i64
    }

    fn velocity_of(&self, velocity: i64) -> f64 {
        let rows = &self.rows;
        velocity as f64
            * (self.scale(rows.velocity_numerator, rows.velocity_denominator)
                * INCREMENTS_PER_REVOLUTION
                / 60.0)
    }

    fn user_velocity(&self, velocity: f64) -> i64 {
        let rows = &self.rows;
        let unit = self.scale(rows.velocity_numerator, rows.velocity_denominator)
            * INCREMENTS_PER_REVOLUTION
            / 60.0;
        libm::round(velocity / unit) as i64
    }

    fn acceleration_of(&self, acceleration: i64) -> f64 {
        let rows = &self.rows;
        acceleration.max(1) as f64
            * (self.scale(rows.ramp_numerator, rows.ramp_denominator) * INCREMENTS_PER_REVOLUTION
                / 60.0)
    }
}
