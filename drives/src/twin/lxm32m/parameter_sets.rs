//! The two sets of control loop parameters (lxm32m 2424-2428, 2438-2469). The manual at hand
//! prints no values but 1000 for 100 % of feed-forward (1632): units and selection are
//! assumptions. 0 leaves what [`Gains`](crate::twin::servo::cascade::Gains) say.

use super::drive::Drive;
use syncline_canopen::dictionary::Row;

/// 3011h:19 and 3011h:18 for set 2; anything else is set 1.
const SET_2: i64 = 2;
/// 3011h:16: from set 1 to set 2, and back.
const COPY_1_TO_2: i64 = 1;
const COPY_2_TO_1: i64 = 2;

impl Drive {
    /// Integral time and reference filter of the speed loop, 0.01 ms; gain, 0.1 1/s, and velocity
    /// feed-forward, 0.1 %, of the position loop.
    fn parameter_sets(&self) -> [[Row; 4]; 2] {
        let r = &self.rows;
        [
            [
                r.speed_integral_1,
                r.speed_filter_1,
                r.position_gain_1,
                r.feed_forward_1,
            ],
            [
                r.speed_integral_2,
                r.speed_filter_2,
                r.position_gain_2,
                r.feed_forward_2,
            ],
        ]
    }

    /// The set chosen for power-up is selected, and in effect.
    pub(super) fn select_at_power_up(&mut self) {
        let set = self.objects.get(self.rows.parameter_set_at_power_up);
        self.objects.set(self.rows.parameter_set_selected, set);
        self.use_parameter_set();
    }

    fn use_parameter_set(&mut self) {
        let second = self.objects.get(self.rows.parameter_set_selected) == SET_2;
        let set = self.parameter_sets()[usize::from(second)];
        let [integral, filter, gain, forward] = set.map(|row| self.objects.get(row));
        let own = &self.own_gains;
        let or = |value: i64, unit: f64, own: f64| match value {
            0 => own,
            _ => value as f64 * unit,
        };
        let gains = &mut self.cascade.gains;
        gains.speed_integral_time = or(integral, 1e-5, own.speed_integral_time);
        gains.speed_reference_filter = or(filter, 1e-5, own.speed_reference_filter);
        gains.position = or(gain, 0.1, own.position);
        gains.velocity_feed_forward = or(forward, 1e-3, own.velocity_feed_forward);
        let active = 1 + i64::from(second);
        self.objects.set(self.rows.parameter_set_active, active);
    }

    /// A row of this module has been written, or another one.
    pub(super) fn parameter_written(&mut self, row: Row) {
        let [first, second] = self.parameter_sets();
        if row == self.rows.parameter_set_copy {
            let (from, to) = match self.objects.get(row) {
                COPY_1_TO_2 => (first, second),
                COPY_2_TO_1 => (second, first),
                _ => return,
            };
            self.objects.set(row, 0);
            for (from, to) in from.into_iter().zip(to) {
                self.objects.set(to, self.objects.get(from));
            }
        } else if row != self.rows.parameter_set_selected
            && !first.contains(&row)
            && !second.contains(&row)
        {
            return;
        }
        self.use_parameter_set();
    }
}
