//! How punctual a cycle was: distributions with what they can honestly say.
//!
//! Recording allocates nothing. A percentile is stated only where at least ten samples lie beyond
//! it; the least and the greatest value are kept with their instants, so that they can be looked up in a trace.

use hdrhistogram::Histogram;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::time::Duration;
use syncline_canopen::Instant;

/// Longer values are counted as this one.
const LONGEST: Duration = Duration::from_secs(10);

/// The percentiles that reports show where they can.
const PERCENTILES: [f64; 6] = [50.0, 90.0, 99.0, 99.9, 99.99, 99.999];

/// Samples that must lie beyond a percentile for it to be stated.
const BEYOND: f64 = 10.0;

/// A distribution of times with a resolution of a nanosecond up to 2 µs and of a thousandth above.
#[derive(Clone, Debug)]
pub struct Distribution {
    name: &'static str,
    histogram: Histogram<u64>,
    least: Option<(Duration, Instant)>,
    greatest: Option<(Duration, Instant)>,
}

impl Distribution {
    /// An empty one.
    ///
    /// # Panics
    /// Never: the bounds are valid.
    #[must_use]
    pub fn new(name: &'static str) -> Self {
        let mut histogram =
            Histogram::new_with_bounds(1, LONGEST.as_nanos() as u64, 3).expect("valid bounds");
        // Touches every page of it now, not at the first sample that falls there.
        histogram.clear();
        Self {
            name,
            histogram,
            least: None,
            greatest: None,
        }
    }

    /// What it is a distribution of.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Takes a time that was measured at `at`.
    pub fn record(&mut self, time: Duration, at: Instant) {
        self.histogram.saturating_record(time.as_nanos() as u64);
        if self.least.is_none_or(|(least, _)| time < least) {
            self.least = Some((time, at));
        }
        if self.greatest.is_none_or(|(greatest, _)| time > greatest) {
            self.greatest = Some((time, at));
        }
    }

    /// Samples taken.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.histogram.len()
    }

    /// The greatest time and its instant.
    #[must_use]
    pub fn greatest(&self) -> Option<(Duration, Instant)> {
        self.greatest
    }

    /// The least and the greatest time, if there is one.
    #[must_use]
    pub fn extent(&self) -> Option<(Duration, Duration)> {
        let ((least, _), (greatest, _)) = self.least.zip(self.greatest)?;
        Some((least, greatest))
    }

    /// The times that were recorded, to the resolution, each with its count, ascending.
    pub fn counts(&self) -> impl Iterator<Item = (Duration, u64)> + '_ {
        self.histogram.iter_recorded().map(|recorded| {
            let time = Duration::from_nanos(recorded.value_iterated_to());
            (time, recorded.count_at_value())
        })
    }

    /// The time that `percent` of the samples do not exceed; `None` where fewer than ten samples
    /// lie beyond.
    #[must_use]
    pub fn percentile(&self, percent: f64) -> Option<Duration> {
        let beyond = self.count() as f64 * (1.0 - percent / 100.0);
        // Tolerates the rounding of 1 − p: ten of ten thousand are ten.
        (beyond >= BEYOND - 1e-6)
            .then(|| Duration::from_nanos(self.histogram.value_at_quantile(percent / 100.0)))
    }

    /// The percentiles that can be stated.
    pub fn percentiles(&self) -> impl Iterator<Item = (f64, Duration)> + '_ {
        PERCENTILES
            .into_iter()
            .filter_map(|percent| Some((percent, self.percentile(percent)?)))
    }

    /// The mean.
    #[must_use]
    pub fn mean(&self) -> Duration {
        Duration::from_nanos(self.histogram.mean() as u64)
    }

    /// One line: count, least with its time since `start`, percentiles, greatest with its time; times in µs.
    #[must_use]
    pub fn line(&self, start: Instant) -> String {
        let mut line = format!("{:<22}n={}", self.name, self.count());
        let end = |name: &str, (time, at): (Duration, Instant)| {
            let at = at.saturating_since(start).as_secs_f64();
            format!("  {name} {} us at {at:.3} s", micros(time))
        };
        line.extend(self.least.map(|least| end("min", least)));
        for (percent, time) in self.percentiles() {
            let _ = write!(line, "  p{percent} {}", micros(time));
        }
        line.extend(self.greatest.map(|greatest| end("max", greatest)));
        line
    }

    /// The same for machines; times in µs.
    #[must_use]
    pub fn json(&self, start: Instant) -> Value {
        let percentiles: serde_json::Map<String, Value> = self
            .percentiles()
            .map(|(percent, time)| (format!("p{percent}"), json!(time.as_nanos() as f64 / 1e3)))
            .collect();
        let time = |(time, _): (Duration, Instant)| time.as_nanos() as f64 / 1e3;
        let at = |(_, at): (Duration, Instant)| at.saturating_since(start).as_secs_f64();
        json!({
            "count": self.count(),
            "mean_us": self.mean().as_nanos() as f64 / 1e3,
            "min_us": self.least.map(time),
            "min_at_s": self.least.map(at),
            "percentiles_us": percentiles,
            "max_us": self.greatest.map(time),
            "max_at_s": self.greatest.map(at),
        })
    }

    /// The whole distribution as HdrHistogram's own percentile table, times in µs, for its
    /// plotter.
    #[must_use]
    pub fn hgrm(&self) -> String {
        let mut text = format!("# {}\n", self.name);
        text += "       Value     Percentile TotalCount 1/(1-Percentile)\n\n";
        let mut total = 0;
        for step in self.histogram.iter_quantiles(5) {
            total += step.count_since_last_iteration();
            let quantile = step.quantile_iterated_to();
            let _ = write!(
                text,
                "{:12.3} {quantile:.12} {total:10}",
                step.value_iterated_to() as f64 / 1e3,
            );
            let _ = if quantile < 1.0 {
                writeln!(text, " {:14.2}", 1.0 / (1.0 - quantile))
            } else {
                writeln!(text)
            };
        }
        let _ = writeln!(
            text,
            "#[Mean    = {:12.3}, StdDeviation   = {:12.3}]\n#[Max     = {:12.3}, Total count    = {:12}]",
            self.histogram.mean() / 1e3,
            self.histogram.stdev() / 1e3,
            self.histogram.max() as f64 / 1e3,
            self.count()
        );
        text
    }
}

/// A stage of a wake-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Until the thread ran.
    WakeUp,
    /// Taking what had arrived.
    Receive,
    /// The controller.
    Compute,
    /// Handing over what it sends.
    Send,
}

impl Stage {
    /// In their order.
    pub const ALL: [Self; 4] = [Self::WakeUp, Self::Receive, Self::Compute, Self::Send];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::WakeUp => "wake-up",
            Self::Receive => "receive",
            Self::Compute => "compute",
            Self::Send => "send",
        }
    }
}

/// Where a wake-up's time went, from the instant it was due until its frames were handed over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stages {
    /// When, from the start of measuring.
    pub at: Duration,
    /// Until the thread ran.
    pub wake: Duration,
    /// Taking what had arrived.
    pub receive: Duration,
    /// The controller.
    pub compute: Duration,
    /// Handing over what it sends.
    pub send: Duration,
}

impl Stages {
    fn of(&self, stage: Stage) -> Duration {
        match stage {
            Stage::WakeUp => self.wake,
            Stage::Receive => self.receive,
            Stage::Compute => self.compute,
            Stage::Send => self.send,
        }
    }

    /// All of them.
    #[must_use]
    pub fn total(&self) -> Duration {
        Stage::ALL.map(|stage| self.of(stage)).iter().sum()
    }

    /// The longest one, the earliest of equals.
    #[must_use]
    pub fn longest(&self) -> Stage {
        let longer = |a, b| if self.of(b) > self.of(a) { b } else { a };
        Stage::ALL.into_iter().fold(Stage::WakeUp, longer)
    }
}

/// When, how long each stage took, and which one took longest.
impl std::fmt::Display for Stages {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "at {:.3} s: ", self.at.as_secs_f64())?;
        for (place, stage) in Stage::ALL.into_iter().enumerate() {
            let separator = if place > 0 { ", " } else { "" };
            write!(f, "{separator}{} {}", stage.name(), micros(self.of(stage)))?;
        }
        write!(f, " us: {}", self.longest().name())
    }
}

/// A time in µs with three decimals below 10 µs and one above.
#[must_use]
pub fn micros(time: Duration) -> String {
    let micros = time.as_nanos() as f64 / 1e3;
    if micros < 10.0 {
        format!("{micros:.3}")
    } else {
        format!("{micros:.1}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_stage_is_named() {
        let micros = Duration::from_micros;
        let stages = Stages {
            at: Duration::from_millis(1250),
            wake: micros(7),
            receive: micros(40),
            compute: micros(11),
            send: micros(400),
        };
        assert_eq!(
            stages.to_string(),
            "at 1.250 s: wake-up 7.000, receive 40.0, compute 11.0, send 400.0 us: send"
        );
        assert_eq!(stages.total(), micros(458));
        assert_eq!(Stages::default().longest(), Stage::WakeUp);
    }

    fn filled(count: u64) -> Distribution {
        let mut distribution = Distribution::new("test");
        for value in 1..=count {
            distribution.record(Duration::from_nanos(value), Instant::from_nanos(value));
        }
        distribution
    }

    #[test]
    fn a_percentile_needs_ten_samples_beyond_it() {
        assert_eq!(filled(999).percentile(99.0), None);
        assert_eq!(
            filled(1000).percentile(99.0),
            Some(Duration::from_nanos(990))
        );
        assert!(filled(10_000).percentile(99.9).is_some());
        assert_eq!(filled(19).percentiles().count(), 0);
    }

    #[test]
    fn the_greatest_is_exact_and_dated() {
        let mut distribution = filled(10);
        distribution.record(Duration::from_secs(60), Instant::from_nanos(5));
        let (greatest, at) = distribution.greatest().unwrap();
        assert_eq!(greatest, Duration::from_secs(60));
        assert_eq!(at, Instant::from_nanos(5));
    }

    #[test]
    fn reports_say_the_same_in_text_json_and_table() {
        let distribution = filled(1000);
        let line = distribution.line(Instant::ZERO);
        assert_eq!(
            line,
            "test                  n=1000  min 0.001 us at 0.000 s  p50 0.500  p90 0.900  p99 0.990  max 1.000 us at 0.000 s"
        );
        let json = distribution.json(Instant::ZERO);
        assert_eq!(json["percentiles_us"]["p99"], 0.99);
        assert_eq!(json["percentiles_us"].get("p99.9"), None);
        let table = distribution.hgrm();
        assert!(table.contains("Total count    =         1000"), "{table}");
        assert!(
            table.contains("       0.500 0.500000000000        500"),
            "{table}"
        );
    }
}
