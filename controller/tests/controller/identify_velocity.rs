//! What is found of axes that follow velocities, drawn, and moved by other means than the estimator's own.

use proptest::prelude::*;
use syncline_controller::identify::lag::{Following, following};
use syncline_controller::identify::{AxisSample, ToldTorque};

/// An axis and what it is sent.
#[derive(Clone, Debug)]
struct Axis {
    cycle: f64,
    /// s
    delay: f64,
    lag: f64,
    /// How far it goes of what it is sent.
    factor: f64,
    /// What it is off after a second at any speed, mm.
    drift: f64,
    /// One increment, mm.
    resolution: f64,
    /// Of the strokes, mm/s.
    speed: f64,
    /// Where the swings of the velocity end, of the cycle's frequency.
    fastest: f64,
    /// Every so many samples are missing.
    missing: u32,
}

fn axis() -> impl Strategy<Value = Axis> {
    let times = (1..=5u32, -0.5..2.5_f64, 0.0..0.03_f64);
    let ways = (0.5..2.0_f64, -0.5..0.5_f64, 1e-5..5e-3_f64);
    (times, ways, 20.0..500.0_f64, 0.1..0.25_f64, 10..200u32).prop_map(
        |((cycle, delay, lag), (factor, drift, resolution), speed, fastest, missing)| {
            let cycle = f64::from(cycle) * 1e-3;
            Axis {
                cycle,
                delay: delay * cycle,
                lag,
                factor,
                drift,
                resolution,
                speed,
                fastest,
                missing,
            }
        },
    )
}

impl Axis {
    /// The velocity that it is sent so long after the beginning: strokes to and fro, with swings that get faster.
    fn sent(&self, time: f64) -> f64 {
        let (stroke, into) = ((time / 3.0).floor(), time.rem_euclid(3.0));
        if into > 2.5 {
            return 0.0;
        }
        let sign = if stroke % 2.0 == 0.0 { 1.0 } else { -1.0 };
        let speed = self.speed * [1.0, 0.3, 0.6][(stroke as usize / 2) % 3];
        let last = self.fastest / self.cycle;
        // Its frequency rises from 1 Hz on, as a geometric series.
        let rate = last.ln() / 2.5;
        let turns = ((rate * into).exp() - 1.0) / rate;
        sign * speed * (1.0 + 0.4 * (std::f64::consts::TAU * turns).sin())
    }

    /// What is seen of it for so many seconds: its position by small steps in time.
    fn seen(&self, length: f64) -> Vec<AxisSample> {
        const STEPS: u32 = 400;
        let step = self.cycle / f64::from(STEPS);
        let cycles = (length / self.cycle) as u32;
        let latched = |time: f64| match time < 0.0 {
            true => 0.0,
            false => self.sent((time / self.cycle).floor() * self.cycle),
        };
        let (mut reference, mut position) = (0.0, 0.0);
        let mut samples = Vec::new();
        for cycle in 0..cycles {
            let time = f64::from(cycle) * self.cycle;
            let place = self.factor * position + self.drift * time;
            let is_missing = cycle % self.missing == self.missing - 1;
            samples.push(AxisSample {
                time,
                set: 0.0,
                act: (place / self.resolution).round() * self.resolution,
                torque: ToldTorque::default(),
                velocity: (!is_missing).then(|| self.sent(time)),
            });
            for part in 0..STEPS {
                // What is latched later than this was not sent before.
                let now = time + (f64::from(part) + 0.5) * step - self.delay;
                let before = reference;
                reference += latched(now) * step;
                let middle = f64::midpoint(before, reference);
                position = match self.lag > 0.0 {
                    true => middle + (position - middle) * (-step / self.lag).exp(),
                    false => reference,
                };
            }
        }
        samples
    }

    fn found(&self) -> Following {
        following(&self.seen(36.0), self.cycle).unwrap()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn delay_and_lag_are_found_whatever_they_are(axis in axis()) {
        let found = axis.found();
        let off = (found.in_all.value - axis.delay - axis.lag).abs();
        // A missing sample hides what was sent for a cycle.
        let allowed = 3.0 * found.in_all.uncertainty + 0.01 * axis.cycle;
        let is_certain = found.in_all.uncertainty < 0.1 * axis.cycle;
        prop_assert!(off < allowed && (off < 0.1 * axis.cycle || !is_certain), "{} s: {:?}", off, found);
        let off = (found.factor.value - axis.factor).abs();
        prop_assert!(off < 0.01 * axis.factor, "{}: {:?}", off, found);
        if let Some(parts) = found.parts {
            for (figure, truth) in [(parts.delay, axis.delay), (parts.lag, axis.lag)] {
                let off = (figure.value - truth).abs();
                prop_assert!(off < 3.0 * figure.uncertainty + 0.02 * axis.cycle, "{} s: {:?}", off, found);
            }
        }
        // Where it is long beside the cycle it shows.
        prop_assert!(found.parts.is_some() || axis.lag < 2.0 * axis.cycle, "{:?}", found);
    }
}

#[test]
fn an_axis_that_rests_tells_nothing() {
    let rests = |at: u32| AxisSample {
        time: f64::from(at) * 2e-3,
        set: 0.0,
        act: 0.0,
        torque: ToldTorque::default(),
        velocity: Some(0.0),
    };
    let samples: Vec<_> = (0..20_000).map(rests).collect();
    assert!(following(&samples, 2e-3).is_err());
    assert!(following(&[], 2e-3).is_err());
}
