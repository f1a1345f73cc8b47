//! The last look at a setpoint before it is sent: whether a drive that is sent there stays within the
//! limits of its axis.
//!
//! What a drive is sent is a sum: the plan, the offset at which its side of the axis was frozen, whatever is added
//! later. Each addend is planned within limits of its own; the guard sees the sum, in the drive's own
//! increments, and trusts none of them.
//!
//! A motion whose j-th derivative nowhere exceeds m has j-th differences of at most m·Tʲ between positions T
//! apart, since a difference is a mean of the derivative. So the greatest differences that the limits
//! permit are known beforehand, and what exceeds them is beyond a limit for certain. Rounding each position to
//! the nearest increment adds half an increment for each, by the binomial coefficients: 1, 2 and 4 increments. The
//! margin on top is for the plan's own rounding, and for the sides of a gantry that are being squared; a defect's
//! jump is far beyond it.

use crate::machine::AxisLimits;
use std::fmt;
use syncline_canopen::time::Duration;
use syncline_drives::model::{Direction, Increments, Scaling};

/// Setpoints that the third difference goes back.
const BACK: usize = 3;

/// So much more than a limit is not beyond it.
const MARGIN: f64 = 1.1;

/// What of a setpoint is beyond a limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// The position itself.
    Position,
    /// The first difference.
    Velocity,
    /// The second.
    Acceleration,
    /// The third.
    Jerk,
}

impl Quantity {
    /// Of the differences, in their order.
    const DIFFERENCES: [Self; BACK] = [Self::Velocity, Self::Acceleration, Self::Jerk];

    /// What an axis may do of it; nothing beyond the range of its positions.
    pub(super) fn limit(self, limits: &AxisLimits) -> f64 {
        match self {
            Self::Position => 0.0,
            Self::Velocity => limits.velocity,
            Self::Acceleration => limits.acceleration,
            Self::Jerk => limits.jerk,
        }
    }

    /// Its unit on an axis whose positions have that one.
    pub(super) fn unit(self, position: &str) -> &'static str {
        match (self, position) {
            (Self::Position, "°") => "°",
            (Self::Velocity, "°") => "°/s",
            (Self::Acceleration, "°") => "°/s²",
            (Self::Jerk, "°") => "°/s³",
            (Self::Position, _) => "mm",
            (Self::Velocity, _) => "mm/s",
            (Self::Acceleration, _) => "mm/s²",
            (Self::Jerk, _) => "mm/s³",
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Position => "position beyond its soft limits",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::Jerk => "jerk",
        })
    }
}

/// Guards the setpoints of one drive.
#[derive(Clone, Debug)]
pub(super) struct SetpointGuard {
    /// The last setpoints, the newest first, and how many of them there are.
    last: [i64; BACK],
    known: usize,
    /// Least and greatest position.
    range: [i64; 2],
    /// Greatest first, second and third difference.
    most: [f64; BACK],
    /// One increment, mm, and the cycle, s.
    resolution: f64,
    period: f64,
}

impl SetpointGuard {
    pub(super) fn new(limits: &AxisLimits, scaling: &Scaling, cycle: Duration) -> Self {
        let period = cycle.as_secs_f64();
        let resolution = scaling.resolution();
        // Where it was frozen it may stand by that much beyond a soft limit, or beside its other side.
        let window = limits.standstill + limits.skew.unwrap_or(0.0);
        let (least, greatest) = (limits.position.0 - window, limits.position.1 + window);
        let (least, greatest) = match scaling.direction() {
            Direction::Positive => (least, greatest),
            Direction::Negative => (greatest, least),
        };
        // Beyond what the drive can count there is nothing to guard.
        let end = |mm, beyond| scaling.to_increments(mm).unwrap_or(beyond).get();
        let derivatives = [limits.velocity, limits.acceleration, limits.jerk];
        let mut most = [0.0; BACK];
        for (order, limit) in (1..).zip(derivatives) {
            let rounding = f64::powi(2.0, order - 1);
            most[order as usize - 1] = limit * MARGIN * period.powi(order) / resolution + rounding;
        }
        Self {
            last: [0; BACK],
            known: 0,
            range: [end(least, Increments::MIN), end(greatest, Increments::MAX)],
            most,
            resolution,
            period,
        }
    }

    /// Knows nothing of the setpoints so far: the next one may be anywhere in range.
    pub(super) fn forget(&mut self) {
        self.known = 0;
    }

    /// Takes a setpoint as sent.
    pub(super) fn push(&mut self, setpoint: Increments) {
        self.last.rotate_right(1);
        self.last[0] = setpoint.get();
        self.known = BACK.min(self.known + 1);
    }

    /// Whether a setpoint may follow those before; `origin` is what the drive counts beyond its scaling, where the
    /// axis' soft limits count.
    ///
    /// # Errors
    /// What is beyond its limit, and how much it is: of differences the derivative in mm and s, of a
    /// position how far it is out of its range, mm.
    pub(super) fn check(
        &self,
        setpoint: Increments,
        origin: Option<Increments>,
    ) -> Result<(), (Quantity, f64)> {
        let next = setpoint.get();
        let [least, greatest] = self.range;
        let beyond = origin.map_or(0, |origin| {
            let count = next - origin.get();
            (least - count).max(count - greatest)
        });
        if beyond > 0 {
            return Err((Quantity::Position, beyond as f64 * self.resolution));
        }
        let [a, b, c] = self.last;
        let differences = [next - a, next - 2 * a + b, next - 3 * a + 3 * b - c];
        for (order, difference) in differences.into_iter().enumerate().take(self.known) {
            let magnitude = difference.unsigned_abs() as f64;
            if magnitude > self.most[order] {
                let value = magnitude * self.resolution / self.period.powi(order as i32 + 1);
                return Err((Quantity::DIFFERENCES[order], value));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CYCLE: Duration = Duration::from_millis(2);

    fn limits() -> AxisLimits {
        AxisLimits {
            position: (-100.0, 900.0),
            velocity: 500.0,
            acceleration: 4000.0,
            jerk: 60_000.0,
            standstill: 0.1,
            ..AxisLimits::default()
        }
    }

    fn scaling(direction: Direction) -> Scaling {
        Scaling::new(131_072, 20.0, direction, Increments::new(4711))
    }

    /// Positions of constant jerks, each for some cycles, by exact integration.
    fn positions(start: [f64; 3], jerks: &[(f64, usize)]) -> Vec<f64> {
        let t = CYCLE.as_secs_f64();
        let [mut p, mut v, mut a] = start;
        let mut positions = vec![p];
        for &(j, cycles) in jerks {
            for _ in 0..cycles {
                p += v * t + a * t * t / 2.0 + j * t * t * t / 6.0;
                v += a * t + j * t * t / 2.0;
                a += j * t;
                positions.push(p);
            }
        }
        positions
    }

    /// The first that is not passed, of which quantity.
    fn stopped(direction: Direction, positions: &[f64]) -> Option<(usize, Quantity)> {
        let scaling = scaling(direction);
        let mut guard = SetpointGuard::new(&limits(), &scaling, CYCLE);
        for (place, &mm) in positions.iter().enumerate() {
            let setpoint = scaling.to_increments(mm).unwrap();
            if let Err((what, _)) = guard.check(setpoint, Some(Increments::ZERO)) {
                return Some((place, what));
            }
            guard.push(setpoint);
        }
        None
    }

    fn direction() -> impl Strategy<Value = Direction> {
        prop_oneof![Just(Direction::Positive), Just(Direction::Negative)]
    }

    proptest! {
        /// Up to a velocity and back to rest, at any part of the limits, anywhere.
        #[test]
        fn what_is_within_the_limits_passes(
            direction in direction(), start in -90.0..500.0_f64, part in 0.01..1.0_f64, up in 1..12_usize,
        ) {
            let jerk = 60_000.0 * part;
            // Up for `up` cycles and down again: acceleration stays below 1500 mm/s², velocity below 40 mm/s.
            let bell = [(jerk, up), (-jerk, 2 * up), (jerk, up)];
            prop_assert_eq!(stopped(direction, &positions([start, 0.0, 0.0], &bell)), None);
            let at_speed = positions([start, 500.0 * part, 0.0], &[(0.0, 100)]);
            prop_assert_eq!(stopped(direction, &at_speed), None);
        }

        /// A step of a setpoint, of the velocity or of the acceleration, at any place of a motion.
        #[test]
        fn what_jumps_is_held_back_at_once(
            direction in direction(), at in 4..60_usize, speed in -400.0..400.0_f64, jump in 0.02..5.0_f64,
        ) {
            let mut positions = positions([400.0, speed, 0.0], &[(0.0, 80)]);
            for position in &mut positions[at..] {
                *position += jump;
            }
            let stopped = stopped(direction, &positions);
            prop_assert!(matches!(stopped, Some((place, _)) if place == at), "{:?}", stopped);
        }
    }

    #[test]
    fn each_limit_is_told_by_its_quantity() {
        let stopped = |positions: &[f64]| stopped(Direction::Negative, positions);
        assert_eq!(stopped(&[-100.1, -100.1]), None);
        assert_eq!(stopped(&[900.2]), Some((0, Quantity::Position)));
        assert_eq!(stopped(&[0.0, 1.2]), Some((1, Quantity::Velocity)));
        let accelerated = positions([0.0, 0.0, 5000.0], &[(0.0, 20)]);
        assert_eq!(stopped(&accelerated), Some((2, Quantity::Acceleration)));
        let jerky = positions([0.0; 3], &[(300_000.0, 20)]);
        assert_eq!(stopped(&jerky).map(|it| it.1), Some(Quantity::Jerk));
    }
}
