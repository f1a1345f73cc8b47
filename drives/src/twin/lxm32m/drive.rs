//! The drive behind the CANopen node: loops, monitoring, what its objects show.

use super::fault::DriveError;
use super::measured::Means;
use super::modes::{Gear, Homing, Interpolation, Jog, Mode, ProfilePosition, Sequence};
use super::motion::Motion;
use super::parameter_sets::ParameterSet;
use super::policy::Policies;
use super::rows::Rows;
use super::signals::Captures;
use super::state::{BY_PROFILE_AND_STAY, SwitchingOff};
use super::switches::{Pulses, Switches};
use super::synchronisation::{Synchronisation, Verdict};
use super::units::INCREMENTS_PER_REVOLUTION;
use super::windows::Windows;
use super::{Identity, TwinConfig};
use crate::twin::device::Disturbance;
use crate::twin::node::Firmware;
use crate::twin::rounding::nearest;
use crate::twin::servo::cascade::{
    Cascade, Gains, POSITION_STEP, Reference, SPEED_STEP, SPEED_STEPS,
};
use crate::twin::servo::firmware::{Servo, ServoFirmware};
use crate::twin::servo::lasting::Lasting;
use crate::twin::servo::loops::Loops;
use crate::twin::servo::ramp::Ramp;
use crate::twin::servo::shaft::Plant;
use syncline_canopen::Instant;
use syncline_canopen::cia402::{Controlword, State, Statusword};
use syncline_canopen::dictionary::{Dictionary, Row};
use syncline_canopen::time::Duration;

/// Least time that statusword bit 7 stays (lxm32m 1319).
const WARNING_TIME: Duration = Duration::from_millis(100);

/// A drive without its bus.
pub struct Drive {
    pub(super) objects: Dictionary,
    pub(super) rows: Rows,
    pub(super) parameter_sets: [ParameterSet; 2],
    pub(super) policies: Policies,
    pub(super) servo: Servo<DriveError>,
    pub(super) switches: Switches,
    pub(super) pulses: Pulses,
    pub(super) captures: Captures,

    /// A message of class 0 has come since the last step of the position loop.
    warned: bool,
    pub(super) warning_until: Instant,

    pub(super) sync: Synchronisation,
    /// Gains that no object sets.
    pub(super) own_gains: Gains,
    /// Encoder reading at user position 0.
    pub(super) zero: i64,
    pub(super) ramp: Ramp,
    /// Velocity of the ramp when the cycle began, and its mean acceleration since the one before:
    /// setpoints that are joined by straight lines have no other.
    cycle_velocity: f64,
    acceleration: f64,
    /// What the ramp of a Profile Velocity has come to, increments/s², if it is smoothed.
    ramp_acceleration: f64,
    pub(super) motion: Motion,

    /// The active mode; 6060h may ask for another until the motor stands.
    pub(super) mode: Mode,
    /// The mode that is asked for, once the object has been written that starts its movement.
    pub(super) start_waits: Option<Mode>,
    pub(super) interpolation: Interpolation,
    pub(super) position: ProfilePosition,
    pub(super) jog: Jog,
    pub(super) homing: Homing,
    pub(super) gear: Gear,
    pub(super) sequence: Sequence,

    pub(super) bit_12: bool,
    pub(super) target_reached: bool,
    /// Since when the target has been reached without a break.
    settling: Lasting,
    pub(super) windows: Windows,
    pub(super) switching_off: Option<SwitchingOff>,
    /// How long its motor's holding brake takes to close.
    pub(super) brake_closing: Duration,
    /// How often the power stage has gone on, and when it did last.
    pub(super) enable_cycles: i64,
    pub(super) enabled_at: Option<Instant>,
    pub(super) means: Means,
    /// Greatest deviation by load since the power stage went on, increments.
    pub(super) peak_deviation: f64,
    pub(super) x_err: bool,
    pub(super) x_end: bool,
    pub(super) ref_ok: bool,
    /// Something has happened that the statusword's value may not show.
    pub(super) status_event: bool,
    pub(super) identity: Identity,
    /// Whether no T_PDO tells more than [`Self::MAPPED`]; not known while their parameters may have changed.
    pub(super) tells_little: Option<bool>,
}

impl Drive {
    pub(super) fn new(objects: Dictionary, config: TwinConfig) -> Self {
        let TwinConfig {
            processor,
            initial_position,
            servo,
            switches,
            policies,
            identity,
        } = config;
        let revolutions = initial_position as f64 / INCREMENTS_PER_REVOLUTION;
        let own_gains = servo.gains.clone();
        let mut loops = Loops::of(&processor, servo, revolutions, INCREMENTS_PER_REVOLUTION);
        let brake_closing = match loops.shaft.plant() {
            Plant::FeedAxis(axis) => Duration::from_secs_f64(axis.train().brake.closing),
            Plant::Rigid(_) => Duration::ZERO,
        };
        let encoder = loops.encoder;
        // The speed is measured from where it has been put, not from a reading.
        loops.cascade = Cascade::new(own_gains.clone(), initial_position);
        Self {
            rows: Rows::new(&objects),
            parameter_sets: ParameterSet::both(&objects),
            objects,
            servo: Servo::new(
                loops,
                State::SwitchOnDisabled,
                policies.enable_time,
                policies.emcy_on_reset,
            ),
            policies,
            switches,
            pulses: Pulses::default(),
            captures: Captures::default(),
            warned: false,
            warning_until: Instant::ZERO,
            sync: Synchronisation::new(),
            own_gains,
            zero: 0,
            ramp: Ramp::at(encoder as f64),
            cycle_velocity: 0.0,
            acceleration: 0.0,
            ramp_acceleration: 0.0,
            motion: Motion::Hold,
            mode: Mode::None,
            start_waits: None,
            interpolation: Interpolation::default(),
            position: ProfilePosition::default(),
            jog: Jog::default(),
            homing: Homing::default(),
            gear: Gear::default(),
            sequence: Sequence::default(),
            bit_12: false,
            target_reached: false,
            settling: Lasting::default(),
            windows: Windows::default(),
            switching_off: None,
            brake_closing,
            enable_cycles: 0,
            enabled_at: None,
            means: Means::default(),
            peak_deviation: 0.0,
            x_err: false,
            x_end: true,
            ref_ok: false,
            status_event: false,
            identity,
            tells_little: None,
        }
    }

    pub(super) fn state(&self) -> State {
        self.servo.state
    }

    // ---- time ----

    fn move_reference(&mut self, step: u32) {
        let jerk_time = self.ramp_jerk_time();
        if jerk_time == 0.0 || !matches!(self.motion, Motion::Velocity(..)) {
            self.ramp_acceleration = 0.0;
        }
        let ramp = &mut self.ramp;
        match self.motion {
            Motion::Hold => ramp.velocity = 0.0,
            Motion::Stop(deceleration) => {
                if ramp.brake(deceleration, POSITION_STEP) {
                    self.motion = Motion::Hold;
                }
            }
            Motion::Velocity(target, limits) => {
                let reached = match jerk_time {
                    0.0 => ramp.towards_velocity(target, &limits, POSITION_STEP),
                    time => ramp.towards_velocity_smoothly(
                        &mut self.ramp_acceleration,
                        target,
                        &limits,
                        time,
                        POSITION_STEP,
                    ),
                };
                if reached && target == 0.0 {
                    self.motion = Motion::Hold;
                }
            }
            Motion::Position(target, limits) => {
                if ramp.towards_position(target, &limits, POSITION_STEP) {
                    self.motion = Motion::Hold;
                }
            }
            Motion::Through(target, limits) => {
                let direction = (target - ramp.position).signum();
                ramp.towards_velocity(direction * limits.velocity, &limits, POSITION_STEP);
                if (target - ramp.position) * direction <= 0.0 {
                    self.motion = Motion::Hold;
                }
            }
            Motion::Interpolate => self.interpolate(step),
            Motion::Gear => self.follow_pulses(),
            Motion::Torque(_) => {
                self.ramp = Ramp {
                    position: self.servo.loops.encoder as f64,
                    velocity: self.actual_velocity(),
                }
            }
        }
    }

    fn monitor(&mut self) {
        let error = self.limit_hit().or_else(|| self.deviation_error());
        if let Some(error) = error.or_else(|| self.velocity_error()) {
            let before = self.servo.state;
            self.raise(error);
            if self.servo.state != before {
                return;
            }
        }
        let at_rest = self.is_at_rest();
        if self.servo.has_braked(self.motion == Motion::Hold) {
            self.end_braking();
            if self.servo.state == State::Fault {
                return;
            }
            self.target_reached = true;
        }
        self.watch_target();
        if at_rest && !self.x_end && !self.is_busy() {
            self.x_end = true;
            self.target_reached |= self.servo.controlword.has(Controlword::HALT);
        }
    }

    /// Whether there is no reference but a torque.
    pub(super) fn is_torque_controlled(&self) -> bool {
        matches!(self.motion, Motion::Torque(_))
    }

    /// Whether reference and motor stand.
    pub(super) fn is_at_rest(&self) -> bool {
        self.motion == Motion::Hold && self.servo.stands()
    }

    /// Reference minus actual position, increments.
    pub(super) fn deviation(&self) -> f64 {
        self.ramp.position - self.servo.loops.encoder as f64
    }

    /// Whether the actual position is within the standstill window of the reference.
    pub(super) fn is_in_window(&self) -> bool {
        let window = self.increments_of(self.objects.get(self.rows.standstill_window));
        self.deviation().abs() <= window
    }

    /// Whether a target has been reached for the milliseconds of a row.
    pub(super) fn settled(&mut self, reached: bool, time: Row) -> bool {
        let time = Duration::from_millis(self.objects.get(time) as u64);
        self.settling.for_time(time, self.servo.now, reached)
    }

    /// The part of the deviation that a load causes, increments: a position loop with less than
    /// full velocity feed-forward may lag as it does at constant velocity.
    fn load_deviation(&self) -> f64 {
        if self.is_torque_controlled() {
            return 0.0;
        }
        let gains = self.servo.loops.cascade.gains();
        let lag = self.ramp.velocity * (1.0 - gains.velocity_feed_forward) / gains.position;
        let deviation = self.deviation();
        if (deviation - lag).abs() < deviation.abs() {
            deviation - lag
        } else {
            deviation
        }
    }

    /// Supervises it: against 6065h with the class of 3005h:B, and against 3006h:29 percent of it (0: not).
    fn deviation_error(&mut self) -> Option<DriveError> {
        let deviation = self.load_deviation().abs();
        self.peak_deviation = self.peak_deviation.max(deviation);
        let limit = self.increments_of(self.objects.get(self.rows.following_error_limit));
        let warning = self.objects.get(self.rows.deviation_warning);
        if deviation > limit {
            let response = self.objects.get(self.rows.deviation_response);
            Some(DriveError::FOLLOWING_ERROR.of_class(response))
        } else if warning > 0 && deviation > limit * warning as f64 * 1e-2 {
            Some(DriveError::FOLLOWING_WARNING)
        } else {
            None
        }
    }

    /// A message of class 0 is withdrawn with its cause.
    fn withdraw_warning(&mut self) {
        let warned = core::mem::take(&mut self.warned);
        if !warned && !self.servo.cause_persists {
            self.objects.set(self.rows.warnings_active, 0);
        }
    }

    /// Whether an error or a message is there: 301Ch:7, whose bits the manual does not print.
    fn monitors_something(&self) -> bool {
        let failed = matches!(self.servo.state, State::Fault | State::FaultReactionActive);
        failed || self.objects.get(self.rows.warnings_active) != 0
    }

    /// Bit 7: for as long as 301Ch:B has a message, and 100 ms at least (lxm32m 1319).
    fn shows_warning(&self) -> bool {
        let active = self.objects.get(self.rows.warnings_active) != 0;
        active || self.servo.now < self.warning_until
    }

    pub(super) fn judge_sync(&mut self, verdict: Verdict) {
        if verdict == Verdict::Lost && self.is_powered() {
            self.raise(DriveError::SYNC_LOST);
        }
    }

    // ---- movement ----

    /// A movement begins: x_end falls (lxm32m 1347), and the statusword is told even if another
    /// movement was under way (the Jog example, lxm32m 1762).
    pub(super) fn begin(&mut self, motion: Motion) {
        if self.is_torque_controlled() && !matches!(motion, Motion::Torque(_)) {
            self.servo.loops.cascade.reset();
        }
        self.motion = motion;
        self.x_end = false;
        self.target_reached = false;
        self.settling = Lasting::default();
        self.status_event = true;
    }

    /// Brings the motor to rest with a deceleration in increments/s².
    pub(super) fn stop(&mut self, deceleration: f64) {
        if self.is_torque_controlled() {
            self.servo.loops.cascade.reset();
        }
        if self.motion != Motion::Hold {
            self.motion = Motion::Stop(deceleration);
        }
    }

    /// Announces a change that may leave the statusword's value as it was.
    pub(super) fn note_status(&mut self) {
        self.status_event = true;
    }

    // ---- objects ----

    /// The objects that [`Self::publish_mapped`] brings up to date, as their indices are.
    pub(super) const MAPPED: [u16; 3] = [0x6041, 0x6064, 0x6077];

    /// Brings the objects that most T_PDOs tell up to `now`, and what is a mean or a maximum over time; where the encoder is, in
    /// increments and in user units.
    pub(super) fn publish_mapped(&mut self, now: Instant) -> (i64, i64) {
        let rows = self.rows;
        let since_step = self.servo.loops.clock.since_step(now);
        let encoder = self.servo.loops.read(since_step);
        let encoder = encoder.saturating_sub(self.zero);
        let torque = self.servo.loops.mean_torque() * self.servo.loops.direction();
        let torque = torque / self.servo.loops.cascade.gains().continuous_torque * 1000.0;
        let monitored = self.monitors_something().into();
        let latched = self.objects.get(rows.signals_latched).max(monitored);
        let position = self.user_position(encoder);
        let shown = [
            (rows.position, position),
            (rows.torque, nearest(torque)),
            (rows.statusword, self.statusword().0.into()),
            (rows.signals_active, monitored),
            (rows.signals_latched, latched),
        ];
        for (row, value) in shown {
            self.objects.set(row, value);
        }
        self.publish_over_time();
        (encoder, position)
    }

    /// Brings the objects that show the drive's condition up to `now`.
    pub(super) fn publish(&mut self, now: Instant) {
        let rows = self.rows;
        let (encoder, position) = self.publish_mapped(now);
        let reference = (self.ramp.position as i64).saturating_sub(self.zero);
        let velocity = self.actual_velocity();
        let rpm = velocity * 60.0 / INCREMENTS_PER_REVOLUTION;
        let user_reference = self.user_position(reference);
        let deviation = user_reference.saturating_sub(position);
        let load_deviation = self.user_position(self.load_deviation() as i64);
        let peak_deviation = self.user_position(self.peak_deviation as i64);
        let (user_velocity, speed) = (self.user_velocity(velocity), nearest(rpm));
        let ramp_speed = self.ramp.velocity * 60.0 / INCREMENTS_PER_REVOLUTION;
        let ramp_velocity = self.user_velocity(self.ramp.velocity);
        let (target, target_velocity) = match self.motion {
            Motion::Position(target, limits) | Motion::Through(target, limits) => {
                let direction = (target - self.ramp.position).signum();
                let target = self.user_position((target as i64).saturating_sub(self.zero));
                (target, self.user_velocity(direction * limits.velocity))
            }
            Motion::Velocity(target, _) => (user_reference, self.user_velocity(target)),
            _ => (user_reference, ramp_velocity),
        };
        let shown = [
            (rows.position_internal, encoder),
            (rows.reference_internal, reference),
            (rows.speed, speed),
            (rows.speed_reference, nearest(ramp_speed)),
            (rows.sync_status, self.sync.status() as i64),
            (rows.error_register, self.servo.errors.register().into()),
            (rows.mode_active, self.mode as i64),
            (rows.reference, user_reference),
            (rows.position_deviation, deviation),
            (rows.position_deviation_user, deviation),
            (rows.load_deviation, load_deviation),
            (rows.load_deviation_user, load_deviation),
            (rows.load_deviation_peak, peak_deviation),
            (rows.load_deviation_peak_user, peak_deviation),
            (
                rows.velocity_deviation,
                self.user_velocity(self.velocity_deviation()),
            ),
            (rows.velocity, user_velocity),
            (rows.velocity_reference, ramp_velocity),
            (rows.loop_velocity_reference, ramp_velocity),
            (rows.encoder_1_internal, encoder),
            (rows.encoder_1, position),
            (rows.encoder_1_speed, speed),
            (rows.encoder_1_velocity, user_velocity),
            (rows.profile_target, target),
            (rows.profile_position, user_reference),
            (rows.profile_velocity_target, target_velocity),
            (rows.feed_forward_velocity, ramp_velocity),
            (
                rows.feed_forward_acceleration,
                nearest(self.acceleration / self.acceleration_of(1)),
            ),
            (rows.pulse_position, self.pulses.position as i64),
            (rows.pulse_velocity, self.pulses.frequency as i64),
            (rows.sequence_data_set, self.sequence.active_number()),
            (rows.sequence_next, self.sequence.next_number()),
            (
                rows.gear_difference,
                self.user_position(self.gear.difference() as i64),
            ),
        ];
        let [most_position, most_velocity, most_ramp] = self.scale_most();
        let shown = shown.into_iter().chain([
            (rows.position_scale_most, most_position),
            (rows.velocity_scale_most, most_velocity),
            (rows.ramp_scale_most, most_ramp),
        ]);
        for (row, value) in shown {
            self.objects.set(row, value);
        }
        self.publish_measured();
        self.publish_signals(position);
    }

    /// 6041h (lxm32m 1301-1351).
    pub(super) fn statusword(&self) -> Statusword {
        let flags = [
            (self.servo.has_mains, Statusword::VOLTAGE_ENABLED),
            (self.shows_warning(), Statusword::WARNING),
            (
                self.servo.controlword.has(Controlword::HALT),
                Statusword::HALT,
            ),
            (self.servo.remote, Statusword::REMOTE),
            (self.target_reached, Statusword::TARGET_REACHED),
            (self.is_at_internal_limit(), Statusword::INTERNAL_LIMIT),
            (self.bit_12, Statusword::MODE_12),
            (self.x_err, Statusword::BIT_13),
            (self.x_end, Statusword::BIT_14),
            (self.ref_ok, Statusword::BIT_15),
        ];
        Statusword::of(self.servo.state.bits(), &flags)
    }

    /// Increments/s, averaged over the window.
    pub(super) fn actual_velocity(&self) -> f64 {
        self.servo.velocity.velocity()
    }
}

impl ServoFirmware for Drive {
    type Error = DriveError;

    fn servo(&self) -> &Servo<DriveError> {
        &self.servo
    }

    fn servo_mut(&mut self) -> &mut Servo<DriveError> {
        &mut self.servo
    }

    fn loop_reference(&self) -> Reference {
        if !self.is_powered() {
            return Reference::Off;
        }
        match self.motion {
            Motion::Torque(torque) => Reference::Torque(torque),
            _ => Reference::Position {
                position: self.ramp.position,
                velocity: self.ramp.velocity,
                acceleration: self.acceleration,
            },
        }
    }

    fn brake_grips(&self) -> bool {
        self.switching_off.is_some_and(|it| it.brake_closes())
    }

    fn position_step(&mut self, step: u32) {
        self.pulses.advance(POSITION_STEP);
        if step == self.servo.loops.clock.steps() / 2 / SPEED_STEPS * SPEED_STEPS {
            let verdict = self.sync.on_mid_cycle(&self.policies);
            self.judge_sync(verdict);
        }
        self.finish_switching_off();
        self.change_state();
        self.watch_captures();
        if self.is_powered() {
            self.step_mode();
            self.move_reference(step);
            self.monitor();
        } else {
            self.ramp = Ramp::at(self.servo.loops.encoder as f64);
        }
        self.watch_windows();
        self.withdraw_warning();
        if step == 0 {
            let cycle = f64::from(self.servo.loops.clock.steps()) * SPEED_STEP;
            self.acceleration = (self.ramp.velocity - self.cycle_velocity) / cycle;
            self.cycle_velocity = self.ramp.velocity;
        }
    }

    /// Most torque that the present movement may take, N·m: 3011h:D in a Quick Stop, 3011h:E in a
    /// Halt, 0 as `Gains` say; and what the power stage allows.
    fn torque_limit(&self) -> f64 {
        let row = if self.servo.braking {
            Some(self.rows.quick_stop_current)
        } else if self.servo.controlword.has(Controlword::HALT) {
            Some(self.rows.halt_current)
        } else {
            None
        };
        let limit = row.map_or(0, |row| self.objects.get(row));
        let limit = match limit {
            0 => f64::INFINITY,
            _ => self.torque_of_current(limit),
        };
        limit.min(self.servo.loops.torque_source.torque_limit())
    }

    fn end_cycle(&mut self) {
        self.interpolation.next_cycle();
    }

    fn switched_on(&mut self) {
        self.enable_cycles += 1;
        self.enabled_at = Some(self.servo.now);
        self.ramp = Ramp::at(self.servo.loops.encoder as f64);
        self.motion = Motion::Hold;
        self.x_err = false;
        self.target_reached = false;
        self.peak_deviation = 0.0;
    }

    fn switched_off(&mut self) {
        self.switching_off = None;
        self.end_mode();
        self.motion = Motion::Hold;
        self.x_end = true;
    }

    /// As [`BY_PROFILE_AND_STAY`] or otherwise says; the mode is ended.
    fn brake(&mut self) {
        self.x_err = true;
        self.switching_off = None;
        self.end_mode();
        match self.objects.get(self.rows.quick_stop_option) {
            BY_PROFILE_AND_STAY => self.stop(self.profile_deceleration()),
            _ => self.stop(self.quick_stop_deceleration()),
        }
    }

    fn warned(&mut self, warning: DriveError) {
        let rows = self.rows;
        self.objects.set(rows.last_warning, warning.number.into());
        self.objects.set(rows.warnings_active, 1);
        self.objects.set(rows.warnings_latched, 1);
        self.objects.set(rows.signals_latched, 1);
        self.warned = true;
        self.warning_until = self.servo.now + WARNING_TIME;
    }

    fn failed(&mut self, error: DriveError) {
        self.objects.set(self.rows.last_error, error.number.into());
        self.objects.set(self.rows.signals_latched, 1);
        self.remember(error.number.into(), error.class as i64);
        self.x_err = true;
    }

    fn forget_warnings(&mut self) {
        self.warning_until = self.servo.now;
        self.objects.set(self.rows.warnings_active, 0);
        self.objects.set(self.rows.signals_latched, 0);
    }

    fn error_reset(&mut self) {
        self.x_err = false;
    }

    fn disturb_own(&mut self, disturbance: Disturbance) {
        match disturbance {
            // While another access channel has it, parameters can be read and written, commands
            // are not executed (lxm32m 1327).
            Disturbance::Remote(remote) => self.servo.remote = remote,
            Disturbance::Input(input, on) => self.switches.sense(input, on),
            Disturbance::Vendor(id) => self.identity.vendor_id = id,
            Disturbance::Replaced(by) => self.identity.encoder_type = by.into(),
            // The rest is the node's and the shaft's.
            _ => {}
        }
    }

    fn touch_own(&mut self, input: u8, on: bool, place: f64) {
        self.switches.sense(input, on);
        self.captures.touch(input, place);
    }

    fn outputs_own(&self) -> u16 {
        let levels = self.output_levels().into_iter().zip(0..);
        levels.map(|(on, place)| u16::from(on) << place).sum()
    }
}
