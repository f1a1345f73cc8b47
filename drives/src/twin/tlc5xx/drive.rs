//! The drive behind the CANopen node: loops, monitoring, what its objects show.

use super::TwinConfig;
use super::fault::DriveError;
use super::modes::{CatchUp, Homing, List, Manual, Mode, Movement, Offset, Target};
use super::motion::Motion;
use super::policy::Policies;
use super::settings::{INCREMENTS_PER_REVOLUTION, RPM, Settings};
use super::signals::{Captures, Inputs, Switches};
use crate::twin::device::Disturbance;
use crate::twin::node::Firmware;
use crate::twin::rounding::nearest;
use crate::twin::servo::cascade::{POSITION_STEP, Reference};
use crate::twin::servo::firmware::{Servo, ServoFirmware};
use crate::twin::servo::lasting::Lasting;
use crate::twin::servo::loops::Loops;
use crate::twin::servo::ramp::Ramp;
use crate::twin::servo::velocity::VelocityMeter;
use std::collections::VecDeque;
use syncline_canopen::cia402::State;
use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::time::Duration;
use syncline_canopen::{Address, Instant, nmt};

/// Increments on either side of 0 that the axis has (5217).
const POSITION_RANGE: f64 = 2_147_483_648.0;

/// What brakes it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum StopBy {
    /// The ramp of 6085h.
    #[default]
    QuickStop,
    /// The ramp of the movement.
    Ramp,
    /// The current of 204Dh.
    Current,
}

/// A drive without its bus.
pub struct Drive {
    pub(super) objects: Dictionary,
    pub(super) settings: Settings,
    pub(super) policies: Policies,
    /// 2400h, the newest first.
    pub(super) error_memory: VecDeque<u16>,
    pub(super) servo: Servo<DriveError>,
    pub(super) nmt_state: nmt::State,

    /// Encoder reading at user position 0.
    pub(super) zero: i64,
    /// Whether a reference point has been defined.
    pub(super) is_referenced: bool,
    pub(super) ramp: Ramp,
    pub(super) motion: Motion,
    /// Greatest following error, increments (2013h).
    peak_error: f64,

    pub(super) switches: Switches,
    pub(super) inputs: Inputs,
    pub(super) captures: Captures,
    /// 2048h, 2062h: what has stopped a movement, until the fault reset.
    pub(super) latched_signals: u16,
    /// 2062h bit 2: the position has left the range of 32 bits (5215-5228), until the fault reset.
    pub(super) overrun: bool,
    /// A warning has been told, until the fault reset.
    pub(super) has_warning: bool,
    /// How it is braked next by a signal, and how it is braked now.
    pub(super) next_stop: StopBy,
    stopped_by: StopBy,

    /// The active mode; 6060h may ask for another until the motor stands.
    pub(super) mode: Mode,
    pub(super) wanted_mode: Mode,
    pub(super) movement: Movement,
    /// Which movements there have been since the reset, a bit each.
    pub(super) begun: u8,
    pub(super) target: Option<Target>,
    pub(super) next_target: Option<Target>,
    pub(super) homing: Homing,
    pub(super) manual: Manual,
    pub(super) offset: Offset,
    pub(super) catch_up: CatchUp,
    pub(super) list: List,
    /// The movement that Halt interrupted (5342-5349).
    pub(super) halted: Option<Motion>,
    /// Pulses/s at the pulse interface of module M1.
    pub(super) pulse_frequency: f64,

    pub(super) setpoint_acknowledged: bool,
    pub(super) target_reached: bool,
    settling: Lasting,
    pub(super) following_error: bool,
    pub(super) movement_failed: bool,
}

impl Drive {
    pub(super) fn new(objects: Dictionary, config: TwinConfig) -> Self {
        let counts = INCREMENTS_PER_REVOLUTION;
        let loops = Loops::of(&config.processor, config.servo, config.position, counts);
        let encoder = loops.encoder;
        Self {
            settings: Settings::of(&objects, &config.policies),
            objects,
            policies: config.policies,
            error_memory: VecDeque::new(),
            servo: Servo::new(
                loops,
                State::NotReadyToSwitchOn,
                config.policies.enable_time,
                config.policies.emcy_on_reset,
            ),
            nmt_state: nmt::State::Initialising,
            zero: 0,
            is_referenced: false,
            ramp: Ramp::at(encoder as f64),
            motion: Motion::Hold,
            peak_error: 0.0,
            switches: config.switches,
            inputs: Inputs::default(),
            captures: Captures::default(),
            latched_signals: 0,
            overrun: false,
            has_warning: false,
            next_stop: StopBy::default(),
            stopped_by: StopBy::default(),
            mode: Mode::ProfilePosition,
            wanted_mode: Mode::ProfilePosition,
            movement: Movement::None,
            begun: 0,
            target: None,
            next_target: None,
            homing: Homing::default(),
            manual: Manual::default(),
            offset: Offset::default(),
            catch_up: CatchUp::default(),
            list: List::default(),
            halted: None,
            pulse_frequency: 0.0,
            setpoint_acknowledged: false,
            target_reached: false,
            settling: Lasting::default(),
            following_error: false,
            movement_failed: false,
        }
    }

    // ---- time ----

    /// The direction of rotation has changed (5141): where it is counts the other way.
    pub(super) fn turn_round(&mut self) {
        self.servo.loops.turn_to(self.settings.direction);
        self.servo.velocity = VelocityMeter::at(self.servo.loops.encoder);
        self.ramp = Ramp::at(self.servo.loops.encoder as f64);
    }

    fn move_reference(&mut self) {
        let ramp = &mut self.ramp;
        let arrived = match self.motion {
            Motion::Hold => {
                ramp.velocity = 0.0;
                false
            }
            Motion::Stop(deceleration) => ramp.brake(deceleration, POSITION_STEP),
            Motion::Velocity(target, limits) => {
                ramp.towards_velocity(target, &limits, POSITION_STEP) && target == 0.0
            }
            Motion::Position(target, limits) => {
                ramp.towards_position(target, &limits, POSITION_STEP)
            }
            Motion::Gear => {
                self.follow_pulses();
                false
            }
        };
        if arrived {
            self.motion = Motion::Hold;
        }
    }

    // ---- monitoring ----

    fn monitor(&mut self) {
        let deviation = (self.ramp.position - self.servo.loops.encoder as f64).abs() - self.lag();
        self.peak_error = self.peak_error.max(deviation);
        let has_braked = self.servo.has_braked(self.motion == Motion::Hold);
        if self.servo.braking {
            if has_braked {
                self.end_braking();
            }
            return;
        }
        if deviation > self.settings.following_error {
            self.following_error = true;
            let response = self.objects.value(0x204F, 0).unwrap_or(0);
            self.raise(DriveError::FOLLOWING_ERROR.of_class(response));
            return;
        }
        self.overrun |= self.position().abs() >= POSITION_RANGE;
        self.watch_limits();
        self.watch_target();
    }

    /// What a position loop lags behind at constant velocity, increments.
    fn lag(&self) -> f64 {
        let gains = self.servo.loops.cascade.gains();
        let share = 1.0 - gains.velocity_feed_forward;
        (self.ramp.velocity * share / gains.position).abs()
    }

    /// Whether reference and motor stand.
    pub(super) fn is_at_rest(&self) -> bool {
        self.motion == Motion::Hold && self.servo.stands()
    }

    /// Increments/s, averaged.
    pub(super) fn actual_velocity(&self) -> f64 {
        self.servo.velocity.velocity()
    }

    /// Whether the motor has been within the standstill window of its reference for its time.
    pub(super) fn has_settled(&mut self) -> bool {
        let deviation = (self.ramp.position - self.servo.loops.encoder as f64).abs();
        let is_there = self.is_at_rest() && deviation <= self.settings.window;
        let time = Duration::from_millis(self.settings.window_ms);
        self.settling.for_time(time, self.servo.now, is_there)
    }

    // ---- movement ----

    /// A movement begins.
    pub(super) fn begin(&mut self, motion: Motion) {
        self.motion = motion;
        self.begun |= 1 << self.movement as u8;
        self.target_reached = false;
        self.movement_failed = false;
        self.settling = Lasting::default();
    }

    /// Brings the motor to rest with a deceleration in increments/s².
    pub(super) fn stop(&mut self, deceleration: f64) {
        if self.motion != Motion::Hold {
            self.motion = Motion::Stop(deceleration);
        }
    }

    /// User position 0 is at `zero` increments from now on.
    pub(super) fn reference_at(&mut self, zero: f64) {
        self.zero = nearest(zero);
        self.is_referenced = true;
    }

    /// Position in increments from user position 0.
    pub(super) fn position(&self) -> f64 {
        self.servo.loops.encoder.saturating_sub(self.zero) as f64
    }

    // ---- objects ----

    /// Gives an object another value, now and after each reset.
    pub(super) fn preset(&mut self, address: Address, value: i64) {
        self.servo
            .tampering
            .preset(&mut self.objects, address, value);
    }

    /// Forgets the greatest following error: any write to 2013h (9399).
    pub(super) fn forget_peak(&mut self) {
        self.peak_error = 0.0;
    }

    /// Brings the objects that show the drive's condition up to `now`.
    pub(super) fn publish(&mut self, now: Instant) {
        let ahead = self.servo.loops.clock.since_step(now);
        let encoder = self.servo.loops.read(ahead).saturating_sub(self.zero) as f64;
        let reference = self.ramp.position - self.zero as f64;
        let settings = self.settings;
        let (position, _) = settings.user(encoder);
        let (user_reference, remainder) = settings.user(reference);
        let rpm = |velocity: f64| nearest(velocity / RPM);
        let user_velocity = |velocity: f64| nearest(velocity / settings.velocity);
        let (target, target_velocity) = match self.motion {
            Motion::Position(target, limits) => {
                let (target, _) = settings.user(target - self.zero as f64);
                (target, user_velocity(limits.velocity))
            }
            Motion::Velocity(velocity, _) => (user_reference, user_velocity(velocity)),
            Motion::Hold | Motion::Stop(_) | Motion::Gear => (user_reference, 0),
        };
        let loops = &self.servo.loops;
        // Of the motor's nominal current (6410h:7).
        let nominal = self.objects.value(0x6410, 7).unwrap_or(0) as f64;
        let nominal = nominal / loops.cascade.gains().continuous_torque;
        let current = |torque: f64| nearest(torque * nominal);
        let (wanted, actual) = (
            loops.cascade.torque(),
            loops.mean_torque() * loops.direction(),
        );
        let within = encoder.rem_euclid(INCREMENTS_PER_REVOLUTION) as i64;
        let error = nearest(reference - encoder);
        let shown = [
            (0x1001, self.servo.errors.register().into()),
            (0x2013, nearest(self.peak_error.max(0.0))),
            (0x2041, self.drive_status().into()),
            (0x2042, self.movement as i64),
            (0x2048, i64::from(self.latched_signals & 0x0F)),
            (0x2062, self.internal_signals().into()),
            (0x2071, nearest(reference)),
            (0x2072, encoder as i64),
            (0x2073, error),
            (0x2074, rpm(self.ramp.velocity)),
            (0x2075, rpm(self.actual_velocity())),
            (0x2076, current(wanted)),
            (0x2077, current(actual)),
            (0x2078, within),
            (0x2083, nearest(self.ramp.velocity)),
            (0x2085, target),
            (0x2086, user_reference),
            (0x2089, position),
            (0x208A, user_velocity(self.ramp.velocity)),
            (0x208C, remainder),
            (0x208D, target_velocity),
            (0x20B3, position),
            (0x20EB, user_velocity(self.ramp.velocity)),
            (0x6041, self.statusword().0.into()),
            (0x6061, self.mode as i64),
            (0x6063, encoder as i64),
            (0x6064, position),
            (0x6069, nearest(self.actual_velocity())),
            (0x606C, user_velocity(self.actual_velocity())),
            (0x60F4, nearest(error as f64 / settings.position)),
            (0x60FD, self.input_image().into()),
        ];
        for (index, value) in shown {
            self.objects.put(index, 0, value);
        }
        self.publish_states();
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
        Reference::Position {
            position: self.ramp.position,
            velocity: self.ramp.velocity,
            // Its acceleration feed-forward is 0 as delivered (60FBh:15).
            acceleration: 0.0,
        }
    }

    fn position_step(&mut self, _: u32) {
        self.change_state();
        self.watch_captures();
        if self.motion != Motion::Gear {
            self.miss_pulses();
        }
        if self.is_powered() {
            self.step_mode();
            self.move_reference();
            self.monitor();
        } else {
            self.change_mode();
            self.ramp = Ramp::at(self.servo.loops.encoder as f64);
        }
    }

    fn switched_on(&mut self) {
        self.ramp = Ramp::at(self.servo.loops.encoder as f64);
        self.motion = Motion::Hold;
        self.following_error = false;
    }

    fn switched_off(&mut self) {
        self.end_movement();
        self.motion = Motion::Hold;
    }

    /// By the quick stop current no more than that brakes (5101).
    fn torque_limit(&self) -> f64 {
        let most = self.servo.loops.torque_source.torque_limit();
        match self.stopped_by {
            StopBy::Current if self.servo.braking => most.min(self.stop_torque()),
            _ => most,
        }
    }

    /// The movement is over.
    fn brake(&mut self) {
        let ramp = self.motion.deceleration();
        self.end_movement();
        self.stopped_by = core::mem::take(&mut self.next_stop);
        self.stop(match self.stopped_by {
            StopBy::Ramp => ramp.unwrap_or(self.settings.manufacturer.deceleration),
            StopBy::Current => self.stop_deceleration(),
            StopBy::QuickStop => self.settings.quick_stop,
        });
    }

    fn warned(&mut self, warning: DriveError) {
        self.servo.errors.tell(warning);
        self.has_warning = true;
        self.show_error(warning);
    }

    fn failed(&mut self, error: DriveError) {
        self.show_error(error);
        self.movement_failed = true;
    }

    fn error_reset(&mut self) {
        self.movement_failed = false;
        self.latched_signals = 0;
        self.overrun = false;
    }

    fn forget_warnings(&mut self) {
        self.has_warning = false;
    }

    fn forget_own(&mut self) {
        self.error_memory.clear();
    }

    fn disturb_own(&mut self, disturbance: Disturbance) {
        match disturbance {
            Disturbance::Remote(remote) => self.take_control(remote),
            Disturbance::Vendor(id) => self.preset(Address::new(0x1018, 1), id.into()),
            Disturbance::Replaced(by) => self.preset(Address::new(0x2007, 0), by.into()),
            // Its inputs are set by [`Twin::set_inputs`].
            _ => {}
        }
    }
}
