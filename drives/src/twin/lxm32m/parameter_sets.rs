//! Control loop parameters: the two sets (lxm32m 2424-2428, 2438-2469) and what both share
//! (2411-2424). The manual at hand prints no values but 1000 for 100 % of velocity feed-forward (1632): units
//! and selection are assumptions, in the table of `docs/lxm32m.md`. 0 leaves what [`Gains`] say.

use super::drive::Drive;
use crate::dictionary::lxm32m_units::{
    CURRENT, FREQUENCY, POSITION_GAIN, RPM, SHARE, SPEED_GAIN, TIME,
};
use crate::twin::servo::cascade::Gains;
use crate::twin::servo::filter::{NotchShape, OvershootSuppression};
use syncline_canopen::Address;
use syncline_canopen::dictionary::{Dictionary, Row};

/// 3011h:19 and 3011h:18 for set 2; anything else is set 1.
const SET_2: i64 = 2;
/// 3011h:16: from set 1 to set 2, and back.
const COPY_1_TO_2: i64 = 1;
const COPY_2_TO_1: i64 = 2;

macro_rules! parameters {
    ($($(#[$doc:meta])* $name:ident = $sub:literal;)*) => {
        /// Handles of the rows of a set.
        #[derive(Clone, Copy, Debug)]
        pub(super) struct ParameterSet {
            $($(#[$doc])* $name: Row,)*
        }

        /// Where they are, in 3012h and 3013h.
        const SUBINDICES: &[u8] = &[$($sub,)*];

        impl ParameterSet {
            /// # Panics
            /// If the table lacks one of them, which a unit test of the table excludes.
            fn new(objects: &Dictionary, index: u16) -> Self {
                Self {
                    $($name: objects.row(index, $sub).expect(stringify!($name)),)*
                }
            }

            /// All of them, in the order of their subindices.
            fn rows(&self) -> [Row; SUBINDICES.len()] {
                [$(self.$name,)*]
            }
        }
    };
}

parameters! {
    speed_gain = 0x01;
    speed_integral = 0x02;
    position_gain = 0x03;
    speed_filter = 0x04;
    torque_filter = 0x05;
    velocity_feed_forward = 0x06;
    notch_1_damping = 0x08;
    notch_1_frequency = 0x09;
    notch_1_bandwidth = 0x0A;
    notch_2_damping = 0x0B;
    notch_2_frequency = 0x0C;
    notch_2_bandwidth = 0x0D;
    overshoot_damping = 0x0E;
    overshoot_delay = 0x0F;
    friction_compensation = 0x10;
}

/// Where the sets are.
const SETS: [u16; 2] = [0x3012, 0x3013];

/// Whether an object is a parameter of a set.
pub(super) fn is_in_a_set(address: Address) -> bool {
    SETS.contains(&address.index) && SUBINDICES.contains(&address.sub)
}

impl ParameterSet {
    /// Both.
    pub(super) fn both(objects: &Dictionary) -> [Self; 2] {
        SETS.map(|index| Self::new(objects, index))
    }
}

impl Drive {
    /// The set chosen for power-up is selected, and in effect.
    pub(super) fn select_at_power_up(&mut self) {
        let set = self.objects.get(self.rows.parameter_set_at_power_up);
        self.objects.set(self.rows.parameter_set_selected, set);
        self.use_parameters();
    }

    /// A current of 0.01 A as torque, N·m.
    pub(super) fn torque_of_current(&self, current: i64) -> f64 {
        current as f64 * CURRENT * self.own_gains.torque_constant
    }

    fn use_parameters(&mut self) {
        let second = self.objects.get(self.rows.parameter_set_selected) == SET_2;
        let set = self.parameter_sets[usize::from(second)];
        let gains = self.gains(&set, !second);
        self.servo.loops.cascade.retune(gains);
        let active = 1 + i64::from(second);
        self.objects.set(self.rows.parameter_set_active, active);
    }

    /// The gains of a set; the global gain, 3011h:15, acts on set 1 alone (lxm32m 2424), on both
    /// loops' gains and on the integral time.
    fn gains(&self, set: &ParameterSet, has_global: bool) -> Gains {
        let rows = &self.rows;
        let own = &self.own_gains;
        let value = |row: Row| self.objects.get(row) as f64;
        let or = |row: Row, unit: f64, own: f64| match value(row) {
            0.0 => own,
            value => value * unit,
        };
        let global = match has_global {
            true => or(rows.global_gain, SHARE, 1.0),
            false => 1.0,
        };
        let notch = |damping: Row, frequency: Row, bandwidth: Row| {
            let shape = NotchShape {
                frequency: value(frequency) * FREQUENCY,
                bandwidth: value(bandwidth) * SHARE,
                depth: (value(damping) * SHARE).min(1.0),
            };
            let is_on = shape.frequency > 0.0 && shape.bandwidth > 0.0 && shape.depth > 0.0;
            is_on.then_some(shape)
        };
        let suppression = OvershootSuppression {
            share: (value(set.overshoot_damping) * SHARE).min(1.0),
            delay: value(set.overshoot_delay) * TIME,
        };
        let suppresses = suppression.share > 0.0 && suppression.delay > 0.0;
        let torque_of = |unit: f64| unit * own.torque_constant;
        Gains {
            position: or(set.position_gain, POSITION_GAIN, own.position) * global,
            velocity_feed_forward: or(set.velocity_feed_forward, SHARE, own.velocity_feed_forward),
            acceleration_feed_forward: or(
                rows.acceleration_feed_forward,
                SHARE,
                own.acceleration_feed_forward,
            ),
            overshoot_suppression: suppresses.then_some(suppression),
            friction_compensation: or(
                set.friction_compensation,
                torque_of(CURRENT),
                own.friction_compensation,
            ),
            friction_speed: or(rows.friction_speed, RPM, own.friction_speed),
            speed: or(set.speed_gain, torque_of(SPEED_GAIN / RPM), own.speed) * global,
            speed_integral_time: or(set.speed_integral, TIME, own.speed_integral_time) / global,
            speed_reference_filter: or(set.speed_filter, TIME, own.speed_reference_filter),
            speed_filter: or(rows.speed_filter_actual, TIME, own.speed_filter),
            torque_filter: or(set.torque_filter, TIME, own.torque_filter),
            notches: [
                notch(
                    set.notch_1_damping,
                    set.notch_1_frequency,
                    set.notch_1_bandwidth,
                ),
                notch(
                    set.notch_2_damping,
                    set.notch_2_frequency,
                    set.notch_2_bandwidth,
                ),
            ],
            torque_limit: or(rows.current_limit, torque_of(CURRENT), own.torque_limit),
            speed_limit: self.servo.loops.cascade.gains().speed_limit,
            ..own.clone()
        }
    }

    /// A row of this module has been written, or another one.
    pub(super) fn parameter_written(&mut self, row: Row) {
        let rows = &self.rows;
        let shared = [
            rows.parameter_set_selected,
            rows.speed_filter_actual,
            rows.friction_speed,
            rows.acceleration_feed_forward,
            rows.current_limit,
            rows.global_gain,
        ];
        let [first, second] = self.parameter_sets.map(|set| set.rows());
        if row == rows.parameter_set_copy {
            let (from, to) = match self.objects.get(row) {
                COPY_1_TO_2 => (first, second),
                COPY_2_TO_1 => (second, first),
                _ => return,
            };
            self.objects.set(row, 0);
            for (from, to) in from.into_iter().zip(to) {
                self.objects.set(to, self.objects.get(from));
            }
        } else if !shared.contains(&row) && !first.contains(&row) && !second.contains(&row) {
            return;
        }
        self.use_parameters();
    }
}
