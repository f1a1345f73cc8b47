//! From setpoint to setpoint, of a drive whose loops are not locked to SYNC: each SYNC sends a reference in a straight line
//! to the setpoint that it put into effect, and there it rests until the next one.

use super::ramp::Ramp;
use syncline_canopen::Instant;
use syncline_canopen::time::Duration;

/// The way of a reference from where it was at a SYNC to the setpoint. Positions are increments, and of a drive that is sent
/// velocities what is a position here is a velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    from: f64,
    to: f64,
    since: Instant,
    /// Seconds.
    period: f64,
    acceleration: f64,
}

impl Segment {
    /// The way to the first setpoint, within a period of so many seconds.
    #[must_use]
    pub fn new(from: f64, to: f64, since: Instant, period: f64) -> Self {
        Self::behind(0.0, from, to, since, period)
    }

    /// The way to the next setpoint, from where this one has led at that SYNC.
    #[must_use]
    pub fn next(&self, to: f64, since: Instant, period: f64) -> Self {
        let from = self.at(since).position;
        Self::behind(self.velocity(), from, to, since, period)
    }

    fn behind(velocity: f64, from: f64, to: f64, since: Instant, period: f64) -> Self {
        let mut segment = Self {
            from,
            to,
            since,
            period,
            acceleration: 0.0,
        };
        segment.acceleration = (segment.velocity() - velocity) / period;
        segment
    }

    /// Where the reference is.
    #[must_use]
    pub fn at(&self, now: Instant) -> Ramp {
        if self.is_over(now) {
            return Ramp::at(self.to);
        }
        let velocity = self.velocity();
        Ramp {
            position: self.from + velocity * seconds(now.saturating_since(self.since)),
            velocity,
        }
    }

    /// Whether the reference has come to the setpoint, where it rests.
    #[must_use]
    pub fn is_over(&self, now: Instant) -> bool {
        seconds(now.saturating_since(self.since)) >= self.period
    }

    /// Mean change of velocity since the setpoint before, increments/s², for the acceleration feed-forward.
    #[must_use]
    pub fn acceleration(&self) -> f64 {
        self.acceleration
    }

    /// Whether more than `most` SYNCs in a row are missing: each is so once it is overdue by half a period.
    #[must_use]
    pub fn misses_more_than(&self, most: u32, now: Instant) -> bool {
        let periods = f64::from(most) + 1.5;
        seconds(now.saturating_since(self.since)) > self.period * periods
    }

    /// On the way, increments/s.
    fn velocity(&self) -> f64 {
        (self.to - self.from) / self.period
    }
}

/// A time in seconds.
#[must_use]
pub fn seconds(time: Duration) -> f64 {
    time.as_nanos() as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(millis: u64) -> Instant {
        Instant::ZERO + Duration::from_millis(millis)
    }

    #[test]
    fn it_goes_in_a_line_and_rests_until_the_next_setpoint() {
        let first = Segment::new(10.0, 30.0, at(0), 0.01);
        assert_eq!(first.acceleration(), 200_000.0);
        for (millis, position, velocity) in [(0, 10.0, 2000.0), (5, 20.0, 2000.0), (10, 30.0, 0.0)]
        {
            let expected = Ramp { position, velocity };
            assert_eq!(first.at(at(millis)), expected, "{millis} ms");
        }
        // Early, it goes on from where it is.
        let next = first.next(20.0, at(5), 0.01);
        assert_eq!(
            next.at(at(5)),
            Ramp {
                position: 20.0,
                velocity: 0.0
            }
        );
        assert_eq!(next.acceleration(), -200_000.0);
    }

    #[test]
    fn a_sync_is_missing_half_a_period_behind_its_time() {
        let segment = Segment::new(0.0, 1.0, at(0), 0.01);
        assert!(!segment.misses_more_than(2, at(35)));
        assert!(segment.misses_more_than(2, at(36)));
        assert!(segment.misses_more_than(0, at(16)));
    }
}
