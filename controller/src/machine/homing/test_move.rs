//! `test_move` of `[axis.homing]`: whether a drive goes as fast as it is sent.

use crate::machine::{Axis, AxisLimits, Machine};
use std::ops::Range;
use std::time::Duration;
use syncline_strict_toml::{Log, Table};

/// A slow move by which an axis whose drive is sent velocities shows that it goes as fast as it is sent, to the side
/// that it is sent to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TestMove {
    /// How far the axis goes, and back; above 0 in its positive direction. mm.
    pub distance: f64,
}

impl TestMove {
    /// How long it would take at its greatest speed.
    pub const TIME: Duration = Duration::from_secs(2);
    /// In which it gets to that speed.
    pub const RAMP: Duration = Duration::from_millis(500);
    /// How long it rests there until it is looked how far it came.
    pub const SETTLING: Duration = Duration::from_millis(250);
    /// By so much of what it is sent it may go further or less far.
    pub const TOLERANCE: f64 = 0.03;

    /// Increments that it goes at least, so that one is little of its tolerance.
    const INCREMENTS: f64 = 200.0;
    /// Units of the drive's velocity that its speed is at least, lest what is rounded takes it away.
    const UNITS: f64 = 4.0;

    /// Its greatest speed, mm/s.
    #[must_use]
    pub fn speed(self) -> f64 {
        self.distance.abs() / Self::TIME.as_secs_f64()
    }

    /// Further than that from where it has been sent so far it is stopped, mm.
    #[must_use]
    pub fn most_off(self) -> f64 {
        0.25 * self.distance.abs()
    }

    /// Acceleration and jerk of an axis with those limits, mm/s² and mm/s³: little, so that a drive that goes many times
    /// as fast as it is sent is seen while it is slow.
    #[must_use]
    pub fn ramps(self, limits: &AxisLimits) -> [f64; 2] {
        let ramp = Self::RAMP.as_secs_f64();
        let acceleration = self.speed() / ramp;
        let jerk = acceleration / (0.2 * ramp);
        [acceleration.min(limits.acceleration), jerk.min(limits.jerk)]
    }
}

/// Reads it, and where the file has it.
pub(super) fn read(
    log: &mut Log<'_>,
    table: &mut Table<'_, '_>,
    unit: &str,
) -> Option<(TestMove, Range<usize>)> {
    let allowed = format!("a number from -1000 to 1000 {unit}, and not 0");
    let is_one = |distance: f64| distance != 0.0 && distance.abs() <= 1e3;
    let distance = table.number_if(log, "test_move", &allowed, is_one)?;
    let place = distance.span();
    let distance = distance.into_inner();
    Some((TestMove { distance }, place))
}

/// Whether each axis that is to make one has a loop that it is for, and can. `places` are where the file has it.
pub(in crate::machine) fn check(
    log: &mut Log<'_>,
    machine: &Machine,
    places: &[Option<Range<usize>>],
) {
    for (index, (axis, place)) in machine.axes.iter().zip(places).enumerate() {
        let (Some(test), Some(place)) = (axis.homing.test_move, place) else {
            continue;
        };
        let refused = if machine.closes_loop(index) {
            cannot(machine, axis, test)
        } else {
            let problem = "the controller closes no loop about the axis".to_owned();
            let help =
                "leave the key out: it is for an axis of the path whose drive is sent velocities";
            Some((problem, help.to_owned()))
        };
        if let Some((problem, help)) = refused {
            let problem = format!("axis \"{}\": homing: `test_move`: {problem}", axis.name());
            log.report(place.clone(), problem, help);
        }
    }
}

/// Why an axis cannot make it, and what is to be done.
fn cannot(machine: &Machine, axis: &Axis, test: TestMove) -> Option<(String, String)> {
    let unit = axis.units()[0];
    let distance = test.distance.abs();
    let (least, most) = axis.limits.position;
    let mut finest = 0.0_f64;
    for &drive in &axis.drives {
        let device = machine.device(drive);
        let resolution = machine.drives[drive].scaling.resolution();
        let quantum =
            (device.drive()?.dynamics()).map_or(0.0, |dynamics| dynamics.quantum * resolution);
        finest = finest
            .max(TestMove::INCREMENTS * resolution)
            .max(TestMove::UNITS * quantum * TestMove::TIME.as_secs_f64());
    }
    if let Some(feedback) = axis.feedback.filter(|it| it.closes_loop) {
        let encoder = &machine.encoders[feedback.encoder];
        finest = finest.max(TestMove::INCREMENTS * encoder.scaling.resolution());
    }
    let follows = axis.limits.following_error_at_rest;
    if axis.homing.moved_limit.is_some() {
        let problem = "with `absolute`, an axis that is referenced without being homed".to_owned();
        let help = "leave one of them out";
        Some((problem, help.to_owned()))
    } else if distance < finest {
        let problem = format!("{distance} {unit} are too little to measure by");
        let help = format!(
            "allowed: at least {finest:.3} {unit}, by its increments and its unit of velocity"
        );
        Some((problem, help))
    } else if test.most_off() > follows {
        let problem =
            format!("a quarter of {distance} {unit} is more than `following_error_limit_at_rest`");
        let help = format!("allowed: up to {} {unit}", 4.0 * follows);
        Some((problem, help))
    } else if 2.0 * distance > most - least || test.speed() > axis.limits.velocity {
        let problem =
            format!("{distance} {unit} are too much for its travel or its `max_velocity`");
        let help = "allowed: half of the travel, and what it goes in 2 s";
        Some((problem, help.to_owned()))
    } else {
        None
    }
}
