//! The drive behind the CANopen node: loops, monitoring, what its objects show.

use super::fault::DriveError;
use super::policy::Policies;
use super::settings::Settings;
use super::{
    CYCLIC_SYNCHRONOUS_POSITION, CYCLIC_SYNCHRONOUS_VELOCITY, INTERPOLATED_POSITION,
    PROFILE_VELOCITY, TwinConfig, VELOCITY,
};
use crate::twin::device::{Disturbance, ErrorClass, Ripple};
use crate::twin::node::Firmware;
use crate::twin::rounding::nearest;
use crate::twin::servo::cascade::{POSITION_STEP, Reference};
use crate::twin::servo::firmware::{Servo, ServoFirmware};
use crate::twin::servo::lasting::Lasting;
use crate::twin::servo::loops::Loops;
use crate::twin::servo::option_codes::{ByOptionCodes, OptionCodes};
use crate::twin::servo::ramp::{Limits, Ramp};
use crate::twin::servo::segment::{Segment, seconds};
use core::f64::consts::TAU;
use syncline_canopen::cia402::{Controlword, State, Statusword};
use syncline_canopen::dictionary::Dictionary;
use syncline_canopen::{Address, Instant};

/// What the position reference does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Motion {
    /// It rests.
    Hold,
    /// It brakes with this deceleration, increments/s².
    Stop(f64),
    /// It runs to the setpoint that the last SYNC brought, within the period of 60C2h, or within that of SYNC.
    Follow(Segment),
    /// Its velocity goes to the one that the last SYNC brought, and stays there.
    Turn(Segment),
    /// Its velocity goes to 60FFh or 6042h with the profile's ramps.
    Profile,
}

/// A drive without its bus.
pub struct Drive {
    pub(super) objects: Dictionary,
    pub(super) settings: Settings,
    /// The one value of 6060h with which it follows setpoints.
    pub(super) mode: i64,
    /// Increments/s of a unit of velocity; of 6042h where there is no 604Ch.
    velocity_unit: f64,
    ripple: Option<Ripple>,
    pub(super) policies: Policies,
    pub(super) warning: bool,
    pub(super) servo: Servo<DriveError>,

    /// Whether the node is in NMT Operational.
    pub(super) is_operational: bool,

    pub(super) reference: Ramp,
    pub(super) motion: Motion,
    last_sync: Option<Instant>,
    too_far: Lasting,
    in_window: Lasting,
    following_error: bool,
    target_reached: bool,
}

impl Drive {
    pub(super) fn new(objects: Dictionary, config: TwinConfig) -> Self {
        let counts = f64::from(config.encoder_increments);
        let loops = Loops::of(&config.processor, config.servo, config.position, counts);
        let encoder = loops.encoder;
        let mut drive = Self {
            settings: Settings::of(&objects),
            mode: config.mode.into(),
            velocity_unit: match (config.velocity_unit, i64::from(config.mode)) {
                (Some([units, rpm]), _) => f64::from(rpm) / 60.0 * counts / f64::from(units),
                (None, VELOCITY) => counts / 60.0,
                (None, _) => 1.0,
            },
            ripple: config.ripple,
            objects,
            servo: Servo::new(
                loops,
                State::NotReadyToSwitchOn,
                config.policies.enable_time,
                config.policies.emcy_on_reset,
            ),
            policies: config.policies,
            warning: false,
            is_operational: false,
            reference: Ramp::at(encoder as f64),
            motion: Motion::Hold,
            last_sync: None,
            too_far: Lasting::default(),
            in_window: Lasting::default(),
            following_error: false,
            target_reached: false,
        };
        let [vendor_id, product_code] = config.identity;
        let modes = drive.objects.value(0x6502, 0).unwrap_or(0);
        let rated_torque = drive.servo.loops.cascade.gains().continuous_torque;
        for (address, value) in [
            (Address::new(0x1018, 1), vendor_id),
            (Address::new(0x1018, 2), product_code),
            // Bit 0 is mode 1.
            (
                Address::new(0x6502, 0),
                Some(modes as u32 | 1 << (config.mode - 1)),
            ),
            (
                Address::new(0x6076, 0),
                Some(libm::round(rated_torque * 1000.0) as u32),
            ),
            (Address::new(0x608F, 1), Some(config.encoder_increments)),
        ] {
            if let Some(value) = value {
                drive.preset(address, value.into());
            }
        }
        for (address, value) in config.mapped {
            drive.preset(address, value);
        }
        drive
    }

    // ---- time ----

    fn move_reference(&mut self) {
        match self.motion {
            Motion::Hold => self.reference.velocity = 0.0,
            Motion::Stop(deceleration) => {
                if self.reference.brake(deceleration, POSITION_STEP) {
                    self.motion = Motion::Hold;
                }
            }
            Motion::Follow(segment) => self.reference = segment.at(self.servo.now),
            Motion::Turn(segment) => {
                let velocity = segment.at(self.servo.now).position;
                self.reference.position +=
                    0.5 * (self.reference.velocity + velocity) * POSITION_STEP;
                self.reference.velocity = velocity;
            }
            Motion::Profile => {
                let unit = self.velocity_unit();
                let [acceleration, deceleration] = self.settings.ramps.map(|ramp| ramp * unit);
                let limits = Limits {
                    velocity: f64::INFINITY,
                    acceleration,
                    deceleration,
                };
                let target = self.ramp_target();
                self.reference
                    .towards_velocity(target, &limits, POSITION_STEP);
            }
        }
    }

    /// What its reference is multiplied by where the shaft is.
    fn unevenness(&self) -> f64 {
        let Some(Ripple { part, periods }) = self.ripple.filter(|_| self.motion == Motion::Profile)
        else {
            return 1.0;
        };
        let turns = self.servo.loops.shaft.position();
        1.0 + part * libm::sin(TAU * f64::from(periods) * (turns - turns.floor()))
    }

    /// Increments/s of a unit of velocity.
    fn velocity_unit(&self) -> f64 {
        let has_factor = self.mode == VELOCITY && self.policies.has_dimension_factor;
        let rpm = self.settings.dimension.filter(|_| has_factor);
        let counts = self.servo.loops.increments_per_revolution;
        rpm.map_or(self.velocity_unit, |rpm| rpm / 60.0 * counts)
    }

    /// 60FFh or 6042h, increments/s.
    fn target_velocity(&self) -> f64 {
        self.settings.target_velocity as f64 * self.velocity_unit()
    }

    /// Where the ramp leads: in velocity mode not without controlword bit 6, and nowhere without bits 4 and 5.
    fn ramp_target(&self) -> f64 {
        let has = |bits| self.mode != VELOCITY || self.servo.controlword.has(bits);
        if !has(Controlword::MODE_4 | Controlword::MODE_5) {
            self.reference.velocity
        } else if !has(Controlword::MODE_6) || self.servo.controlword.has(Controlword::HALT) {
            0.0
        } else {
            self.target_velocity()
        }
    }

    /// Whether it is enabled in its mode.
    fn runs(&self) -> bool {
        self.servo.state == State::OperationEnabled && self.settings.mode == self.mode
    }

    /// Whether it goes to a velocity by ramps of its own, whenever that is written.
    fn has_ramps(&self) -> bool {
        matches!(self.mode, VELOCITY | PROFILE_VELOCITY)
    }

    /// Whether its loops control a velocity, and no position.
    fn is_sent_velocities(&self) -> bool {
        self.has_ramps() || self.mode == CYCLIC_SYNCHRONOUS_VELOCITY
    }

    /// By how much the motor is away from the position reference, increments; 0 without one.
    fn deviation(&self, position: i64) -> f64 {
        match self.is_sent_velocities() {
            true => 0.0,
            false => self.reference.position - position as f64,
        }
    }

    /// A SYNC, after the synchronous R_PDOs have been put into effect.
    pub(super) fn on_sync(&mut self, now: Instant) {
        self.servo.loops.begin_cycle();
        self.offset_torque();
        let since_last = self.last_sync.replace(now);
        let since_last = since_last.map_or(0.0, |last| seconds(now.saturating_since(last)));
        if !self.runs() || self.has_ramps() {
            return;
        }
        let started = self.servo.controlword.has(Controlword::MODE_4);
        if self.mode == INTERPOLATED_POSITION && !started {
            self.brake();
            return;
        }
        let period = self.settings.period.unwrap_or(since_last);
        let period = period.max(POSITION_STEP);
        if self.mode == CYCLIC_SYNCHRONOUS_VELOCITY {
            let to = self.target_velocity();
            let from = match self.motion {
                _ if !self.policies.interpolates => to,
                Motion::Turn(segment) => segment.at(now).position,
                _ => self.reference.velocity,
            };
            self.motion = Motion::Turn(Segment::new(from, to, now, period));
            return;
        }
        let to = self.settings.target;
        self.motion = Motion::Follow(match self.motion {
            Motion::Follow(segment) => segment.next(to, now, period),
            _ => Segment::new(self.reference.position, to, now, period),
        });
    }

    /// Has the loops add 60B2h, where they control a position.
    fn offset_torque(&mut self) {
        let cascade = &mut self.servo.loops.cascade;
        let rated = cascade.gains().continuous_torque;
        if !matches!(
            self.mode,
            INTERPOLATED_POSITION | CYCLIC_SYNCHRONOUS_POSITION
        ) {
            return;
        }
        let runs = self.settings.mode == self.mode;
        let offset = if runs {
            self.settings.torque_offset
        } else {
            0.0
        };
        cascade.offset_torque(offset * rated);
    }

    /// Another mode than the one that follows setpoints: what moves comes to rest.
    pub(super) fn mode_changed(&mut self) {
        if self.settings.mode != self.mode {
            self.brake();
        }
    }

    // ---- monitoring ----

    fn monitor(&mut self) {
        if self.servo.has_braked(self.motion == Motion::Hold) {
            self.stopped();
        } else if self.misses_sync() {
            self.raise(DriveError::SYNC_LOST);
        }
        let Settings {
            following_error,
            following_error_time,
            window,
            window_time,
            ..
        } = self.settings;
        let deviation = self.deviation(self.servo.loops.encoder).abs();
        let too_far = following_error.is_some_and(|limit| deviation > limit);
        let now = self.servo.now;
        self.following_error = self.too_far.for_time(following_error_time, now, too_far);
        if self.following_error && self.policies.following_error_is_fault && !self.servo.braking {
            self.raise(DriveError::FOLLOWING_ERROR);
        }
        let is_in = window.is_some_and(|window| deviation <= window);
        self.target_reached = match self.mode {
            VELOCITY | PROFILE_VELOCITY => self.reference.velocity == self.target_velocity(),
            _ => self.in_window.for_time(window_time, now, is_in),
        };
    }

    /// Whether more SYNCs are missing than may be.
    fn misses_sync(&self) -> bool {
        match (self.motion, self.policies.missing_syncs) {
            (Motion::Follow(segment) | Motion::Turn(segment), Some(most)) => {
                segment.misses_more_than(most, self.servo.now)
            }
            _ => false,
        }
    }

    // ---- objects ----

    /// Gives an object another value, now and after each reset.
    pub(super) fn preset(&mut self, address: Address, value: i64) {
        self.servo
            .tampering
            .preset(&mut self.objects, address, value);
    }

    /// Brings the objects that show the drive's condition up to `now`.
    pub(super) fn publish(&mut self, now: Instant) {
        let ahead = self.servo.loops.clock.since_step(now);
        let position = self.servo.loops.read(ahead);
        let reference = match self.motion {
            Motion::Follow(segment) => segment.at(now).position,
            _ => self.reference.position,
        };
        let deviation = match self.is_sent_velocities() {
            true => 0,
            false => nearest(reference) - position,
        };
        let unit = self.velocity_unit();
        let velocity = self.servo.velocity.velocity() / unit;
        let of_16_bits = |velocity: f64| i64::from(libm::round(velocity) as i16);
        let torque = self.servo.loops.mean_torque()
            / self.servo.loops.cascade.gains().continuous_torque
            * 1000.0;
        for (index, value) in [
            (0x1001, self.servo.errors.register().into()),
            (
                0x603F,
                self.servo
                    .errors
                    .active()
                    .map_or(0, |error| error.code)
                    .into(),
            ),
            (0x6041, self.statusword().0.into()),
            (0x6043, of_16_bits(self.reference.velocity / unit)),
            (0x6044, of_16_bits(velocity)),
            (0x6061, self.settings.mode),
            // What turns on and on begins anew.
            (0x6064, (position as i32).into()),
            (0x606C, nearest(velocity)),
            (0x6077, nearest(torque)),
            (0x60F4, deviation),
        ] {
            self.objects.put(index, 0, value);
        }
    }

    /// 6041h.
    pub(super) fn statusword(&self) -> Statusword {
        let follows = matches!(self.motion, Motion::Follow(_) | Motion::Turn(_));
        let stands = self.mode == PROFILE_VELOCITY && self.reference.velocity == 0.0;
        let flags = [
            (self.servo.has_mains, Statusword::VOLTAGE_ENABLED),
            (self.warning, Statusword::WARNING),
            (self.servo.remote, Statusword::REMOTE),
            (
                self.target_reached && self.is_powered(),
                Statusword::TARGET_REACHED,
            ),
            (
                match self.motion {
                    Motion::Profile => self.settings.velocity_is_limited,
                    _ => follows && self.settings.target_is_limited,
                },
                Statusword::INTERNAL_LIMIT,
            ),
            (
                follows && self.policies.tells_following || stands && self.is_powered(),
                Statusword::MODE_12,
            ),
            (
                self.following_error
                    && self.is_powered()
                    && self.mode == CYCLIC_SYNCHRONOUS_POSITION,
                Statusword::BIT_13,
            ),
        ];
        Statusword::of(self.servo.state.bits(), &flags)
    }
}

impl ByOptionCodes for Drive {
    const CONNECTION_LOST: DriveError = DriveError::CONNECTION_LOST;

    fn option_codes(&self) -> OptionCodes {
        self.settings.option_codes
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
        if self.is_sent_velocities() {
            let counts = self.servo.loops.increments_per_revolution;
            let velocity = self.reference.velocity / counts;
            return Reference::Velocity(velocity * self.unevenness());
        }
        Reference::Position {
            position: self.reference.position,
            velocity: self.reference.velocity,
            acceleration: match self.motion {
                Motion::Hold | Motion::Turn(_) | Motion::Profile => 0.0,
                Motion::Stop(deceleration) => -deceleration * self.reference.velocity.signum(),
                Motion::Follow(segment) => segment.acceleration(),
            },
        }
    }

    fn position_step(&mut self, _: u32) {
        self.change_state();
        if self.runs() && self.has_ramps() {
            self.motion = Motion::Profile;
        }
        if self.is_powered() {
            self.move_reference();
            self.monitor();
        } else {
            self.reference = Ramp::at(self.servo.loops.encoder as f64);
        }
    }

    /// The reference is where the motor is.
    fn switched_on(&mut self) {
        self.reference = Ramp::at(self.servo.loops.encoder as f64);
        self.motion = Motion::Hold;
        self.too_far = Lasting::default();
        self.following_error = false;
    }

    fn switched_off(&mut self) {
        self.motion = Motion::Hold;
    }

    /// Lets the reference come to rest with the quick stop ramp. Where SYNC is a little late it rests at its setpoint
    /// already and the motor turns on: from the motor's velocity then, as a ramp from rest would be none.
    fn brake(&mut self) {
        if let Motion::Follow(segment) = self.motion
            && segment.is_over(self.servo.now)
        {
            self.reference.velocity = self.servo.velocity.velocity();
        }
        if self.motion != Motion::Hold {
            self.motion = Motion::Stop(match self.mode {
                VELOCITY => self.settings.velocity_quick_stop * self.velocity_unit(),
                _ => self.settings.quick_stop_deceleration,
            });
        }
    }

    fn reaction(&self, class: ErrorClass) -> ErrorClass {
        self.settings.option_codes.reaction(class)
    }

    fn warned(&mut self, _: DriveError) {
        self.warning = true;
    }

    fn forget_warnings(&mut self) {
        self.warning = false;
    }

    fn forget_own(&mut self) {
        self.forget_warnings();
    }

    fn disturb_own(&mut self, disturbance: Disturbance) {
        match disturbance {
            Disturbance::Remote(remote) => self.servo.remote = remote,
            Disturbance::Vendor(id) => self.preset(Address::new(0x1018, 1), id.into()),
            Disturbance::Replaced(by) => self.preset(Address::new(0x1018, 4), by.into()),
            // It has no inputs.
            _ => {}
        }
    }
}
