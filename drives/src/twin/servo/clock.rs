//! The clock that paces a drive's loops: its own oscillator, or that oscillator locked to SYNC.

use super::cascade::{SPEED_STEP_NS, SPEED_STEPS};
use crate::twin::random::Random;
use syncline_canopen::Instant;

/// Steps of the speed loop in a cycle without SYNC: the drive's millisecond.
const FREE_STEPS: u32 = 16;

/// Share of a phase error that the next cycle's boundary and the estimated period take over.
const PHASE_GAIN: f64 = 0.2;
const PERIOD_GAIN: f64 = 0.02;

/// How far, of the nominal period, the estimated one may stray.
const PULL_RANGE: f64 = 0.005;

/// Divides time into cycles and each cycle into equal steps of the speed loop.
///
/// A cycle is the interpolation period while locked to SYNC, a millisecond otherwise.
#[derive(Clone, Debug)]
pub struct Clock {
    /// True nanoseconds per nominal nanosecond of the oscillator.
    rate: f64,
    boundary: u64,
    nominal: f64,
    period: f64,
    steps: u32,
    coming: u32,
    /// When the present step ends, and its true length, s: both are asked for several times in a step.
    step_end: Instant,
    step_length: f64,
}

impl Clock {
    /// A free-running clock that starts at `now` with an oscillator `ppm` parts per million slow.
    #[must_use]
    pub fn new(now: Instant, ppm: f64) -> Self {
        Self::cycles(1.0 + ppm * 1e-6, now, u64::from(FREE_STEPS) * SPEED_STEP_NS)
    }

    /// A free-running clock from the origin of time on, with one of the oscillators that are at most
    /// `ppm` parts per million slow or fast.
    #[must_use]
    pub fn within(ppm: f64, mut random: Random) -> Self {
        Self::new(Instant::ZERO, random.between(-ppm, ppm))
    }

    fn cycles(rate: f64, now: Instant, nominal_ns: u64) -> Self {
        let nominal = nominal_ns as f64 * rate;
        let mut clock = Self {
            rate,
            boundary: now.as_nanos(),
            nominal,
            period: nominal,
            steps: (nominal_ns / SPEED_STEP_NS).max(1) as u32,
            coming: 1,
            step_end: now,
            step_length: 0.0,
        };
        clock.measure_step();
        clock
    }

    /// The present step is of another length.
    fn measure_step(&mut self) {
        self.step_end = self.step_instant(self.coming);
        self.step_length = self.period / f64::from(self.steps) * 1e-9;
    }

    /// When the present step of the speed loop ends.
    #[inline]
    #[must_use]
    pub fn step_end(&self) -> Instant {
        self.step_end
    }

    /// The present step's number within the cycle, from 0, and its true length in seconds.
    #[inline]
    #[must_use]
    pub fn step(&self) -> (u32, f64) {
        (self.coming - 1, self.step_length)
    }

    /// Whether the position loop steps with the present step.
    #[inline]
    #[must_use]
    pub fn is_position_step(&self) -> bool {
        (self.coming - 1).is_multiple_of(SPEED_STEPS)
    }

    /// Time that has passed in the present step, s.
    #[must_use]
    pub fn since_step(&self, now: Instant) -> f64 {
        let begin = self.step_instant(self.coming - 1);
        now.saturating_since(begin).as_nanos() as f64 * 1e-9
    }

    /// Steps of a cycle.
    #[must_use]
    pub fn steps(&self) -> u32 {
        self.steps
    }

    /// Takes the steps that end until an instant, up to one behind which the position loop steps or a cycle ends: each with its end
    /// and its length in seconds. Whether the cycle has ended.
    #[inline(always)]
    pub(super) fn take_steps(
        &mut self,
        until: Instant,
        mut take: impl FnMut(Instant, f64),
    ) -> bool {
        while self.step_end <= until {
            take(self.step_end, self.step_length);
            let ends = self.next_step();
            if ends || self.is_position_step() {
                return ends;
            }
        }
        false
    }

    /// Goes on to the next step; true if it is the first of a cycle.
    #[inline]
    pub fn next_step(&mut self) -> bool {
        let ends = self.coming == self.steps;
        if ends {
            self.boundary = self.step_end.as_nanos();
            self.coming = 0;
        }
        self.coming += 1;
        self.step_end = self.step_instant(self.coming);
        ends
    }

    /// Starts cycles of `nominal_ns` at the SYNC that arrived at `now`.
    pub fn lock(&mut self, now: Instant, nominal_ns: u64) {
        *self = Self::cycles(self.rate, now, nominal_ns);
    }

    /// Runs free again from `now`.
    pub fn unlock(&mut self, now: Instant) {
        *self = Self::cycles(self.rate, now, u64::from(FREE_STEPS) * SPEED_STEP_NS);
    }

    /// How long after the nearest boundary `now` lies, nanoseconds; negative if before.
    #[must_use]
    pub fn phase_error(&self, now: Instant) -> i64 {
        let since = now.as_nanos().saturating_sub(self.boundary) as i64;
        let period = self.period as i64;
        if since > period / 2 {
            since - period
        } else {
            since
        }
    }

    /// Pulls the clock by the phase error of a SYNC.
    pub fn correct(&mut self, error_ns: i64) {
        let error = error_ns as f64;
        let stray = self.nominal * PULL_RANGE;
        let period = self.period + PERIOD_GAIN * error;
        self.period = period.clamp(self.nominal - stray, self.nominal + stray);
        self.boundary = self
            .boundary
            .saturating_add_signed((PHASE_GAIN * error) as i64);
        self.measure_step();
    }

    #[inline]
    fn step_instant(&self, step: u32) -> Instant {
        let into = self.period * f64::from(step) / f64::from(self.steps);
        // Of numbers with a sign most processors have an instruction for this.
        Instant::from_nanos(self.boundary + into as i64 as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syncline_canopen::time::Duration;

    const PERIOD: u64 = 2_000_000;

    /// Lets the clock run up to `now`, counting cycles.
    fn run(clock: &mut Clock, now: Instant) -> u32 {
        let mut cycles = 0;
        while clock.step_end() <= now {
            cycles += u32::from(clock.next_step());
        }
        cycles
    }

    #[test]
    fn a_free_clock_goes_wrong_by_its_oscillator() {
        let mut clock = Clock::new(Instant::ZERO, 100.0);
        let second = Instant::from_nanos(1_000_000_000);
        run(&mut clock, second);
        // A millisecond's cycle takes 100 ns too long, so the thousandth is not over yet.
        assert_eq!(clock.phase_error(second), -100_000);
    }

    #[test]
    fn a_locked_clock_follows_sync_whatever_its_oscillator_and_rides_out_jitter() {
        for ppm in [-100.0, 0.0, 100.0] {
            let mut clock = Clock::new(Instant::ZERO, ppm);
            let mut sync = Instant::from_nanos(777_777);
            clock.lock(sync, PERIOD);
            let mut cycles = 0;
            for k in 1..=500u64 {
                sync += Duration::from_nanos(PERIOD);
                let late = sync + Duration::from_nanos(k * 7919 % 2_000);
                cycles += run(&mut clock, late);
                let error = clock.phase_error(late);
                assert!(error.abs() < 3_000, "{ppm} ppm, SYNC {k}: {error} ns");
                clock.correct(error);
            }
            assert_eq!(cycles + u32::from(clock.phase_error(sync) < 0), 500);
        }
    }
}
